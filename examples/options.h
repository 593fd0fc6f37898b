/* options.h - the command lines of the programs: a table of options, read and printed; the scene.    SPDX-License-Identifier: MIT OR Unlicense
   Include ../rt.h and scene.h first. Before the include a program names itself, static const char program[] = "bake"; after it, it defines struct
   options. */

#ifndef OPTIONS_H
#define OPTIONS_H

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define OPTIONS_API static __attribute__((unused))  /* a program need not call all of them */

typedef struct options options;             /* what the program was asked for */

typedef struct {
    const char *name, *value;               /* "--size", "WxH"; value NULL: it takes none */
    bool (*set)(options *o, const char *text);      /* false: text is out of range */
    const char *help, *range;
} option;

/* Says what is wrong, in one line; false, so that a caller can return it. */
__attribute__((format(printf, 1, 2)))
OPTIONS_API bool fail(const char *format, ...)
{
    va_list arguments;

    fprintf(stderr, "%s: ", program);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return false;
}

OPTIONS_API double seconds_now(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

/* The place of text among names, or count. */
OPTIONS_API int find_name(const char *text, const char *const *names, int count)
{
    int i = 0;

    while (i < count && strcmp(text, names[i]) != 0) i++;
    return i;
}

/* An integer from low to high that ends at the character end. */
OPTIONS_API bool read_int(const char *text, char end, int low, int high, int *value, const char **rest)
{
    char *stop;
    long number;

    errno = 0;
    number = strtol(text, &stop, 10);
    if (stop == text || *stop != end || errno != 0 || number < low || number > high) return false;
    *value = (int)number;
    if (rest) *rest = stop + 1;
    return true;
}

/* A number up to RT_MAX_COORDINATE, sign aside, likewise. */
OPTIONS_API bool read_float(const char *text, char end, float *value, const char **rest)
{
    char *stop;

    *value = strtof(text, &stop);
    if (stop == text || *stop != end || !(fabsf(*value) <= RT_MAX_COORDINATE)) return false;
    if (rest) *rest = stop + 1;
    return true;
}

typedef struct { bool given; rt_vec3 value; } xyz;

/* X,Y,Z */
OPTIONS_API bool read_xyz(const char *text, xyz *out)
{
    out->given = true;
    return read_float(text, ',', &out->value.x, &text) && read_float(text, ',', &out->value.y, &text) &&
           read_float(text, '\0', &out->value.z, NULL);
}

/* Of the library's lists: an array of the names, and all of them as one text. */
#define NAME_OF(name, text) text,
#define LISTED(name, text) " " text
OPTIONS_API const char *const structure_names[] = { RT_STRUCTURE_LIST(NAME_OF) };

OPTIONS_API bool read_structure(const char *text, rt_structure *structure)
{
    *structure = (rt_structure)find_name(text, structure_names, RT_STRUCTURE_COUNT);
    return *structure != RT_STRUCTURE_COUNT;
}

OPTIONS_API bool read_algorithm(const char *text, const rt_algorithm_info **algorithm)
{
    size_t i = 0;

    while ((*algorithm = rt_algorithm_get(i)) != NULL && strcmp(text, (*algorithm)->name) != 0) i++;
    return *algorithm != NULL;
}

/* Leaves out of a build what that algorithm does not read. device: the accel goes to one, which makes wide nodes of its own. */
OPTIONS_API void keep_what_it_reads(rt_build_options *build, rt_algorithm algorithm, bool device)
{
    build->no_wide = device || (algorithm != RT_AUTO && algorithm != RT_BVH_WIDE);
    build->no_binary = !device && algorithm == RT_BVH_WIDE;
    build->no_backtrack = algorithm != RT_KD_BACKTRACK;
}

/* Is argument "name" or "name=..."? */
static bool names_option(const char *argument, const char *name)
{
    size_t length = strlen(name);

    return strncmp(argument, name, length) == 0 && (argument[length] == '\0' || argument[length] == '=');
}

/* Sets what the arguments say, as --name value or --name=value. operand: where a scene goes, which may be
   given once; NULL: nowhere. */
OPTIONS_API bool read_options(options *o, const option *table, size_t count, int argc, char **argv, const char **operand)
{
    int i;

    for (i = 1; i < argc; i++) {
        const char *argument = argv[i], *value;
        size_t row = 0;

        if (operand && argument[0] != '-') {
            if (*operand) return fail("two scenes given, '%s' and '%s'; one at a time", *operand, argument);
            *operand = argument;
            continue;
        }
        while (row < count && !names_option(argument, table[row].name)) row++;
        if (row == count) return fail("unknown option '%s'; see --help", argument);
        value = strchr(argument, '=');
        if (value) value++;
        if (table[row].value == NULL) {
            if (value) return fail("%s takes no value", table[row].name);
        } else if (value == NULL) {
            if (++i == argc) return fail("%s needs a value: %s", table[row].name, table[row].range);
            value = argv[i];
        }
        if (!table[row].set(o, value)) return fail("%s '%s': must be %s", table[row].name, value, table[row].range);
    }
    return true;
}

OPTIONS_API void print_options(const option *table, size_t count)
{
    size_t i;

    for (i = 0; i < count; i++) {
        char left[40];

        snprintf(left, sizeof left, "%s %s", table[i].name, table[i].value ? table[i].value : "");
        printf("  %-18s %s\n", left, table[i].help);
    }
}

/* Loads it, and says what is wrong; unless quiet, also what can be done without. */
OPTIONS_API bool load_scene(scene *out, const char *name, bool quiet)
{
    scene_error error = {0};

    if (!scene_load(out, name, NULL, NULL, &error)) {
        if (error.errors > 1) return fail("%s (and %zu more)", error.message, error.errors - 1);
        return fail("%s", error.message);
    }
    if (out->warnings && !quiet) {
        fprintf(stderr, "%s: warning: %s", program, out->warning);
        if (out->warnings > 1) fprintf(stderr, " (and %zu more)", out->warnings - 1);
        fputc('\n', stderr);
    }
    return true;
}

#endif /* OPTIONS_H */
