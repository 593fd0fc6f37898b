/* scene.h - scenes for the programs of rt.h: OBJ + MTL and NFF files, procedural scenes, PPM pictures in and out.
   Include ../rt.h first. Needs POSIX for stat and getpid.

   >>types  >>memory  >>report  >>text  >>numbers  >>build  >>polygons  >>names  >>mtl  >>obj  >>nff  >>procedural  >>camera
   >>public  >>ppm                                                                     SPDX-License-Identifier: MIT OR Unlicense

   OBJ     v (with or without w and vertex colours), vn, vt, f, usemtl, mtllib; o, g, s, l, p are accepted and draw nothing; every
           other statement is a warning. Lines end in LF, CR LF or CR; UTF-8, or UTF-16 with a byte order mark. Indices may be negative,
           or point forward to vertices that are still to come.
   MTL     newmtl, Kd, Ks, Ke, Ns, illum; Ka, d, Tr, Ni are checked and not used; textures and other keys are passed over.
   NFF     b v l f s c p pp, as the Standard Procedural Databases write it. Cones and cylinders become SCENE_CONE_SEGMENTS sides.
   errors  A line that cannot be right (a bad number, too few of them, an index to nothing) is reported as "file:line: what is wrong",
           each one, and the load fails. What a picture can do without (a missing .mtl, an unknown statement) is a warning.  */

#ifndef SCENE_H
#define SCENE_H

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define SCENE_API static __attribute__((unused))    /* a program need not call all of them */
#define SCENE_HOT static inline __attribute__((unused))

#ifndef SCENE_CONE_SEGMENTS
#define SCENE_CONE_SEGMENTS 32              /* sides of a cone or cylinder */
#endif

/* ---- >>types -------------------------------------------------------------------------------------------------------- */

typedef struct {
    char name[256];                         /* as given to scene_load */
    rt_geometry geometry;                   /* points into the arrays below; for rt_build */
    float *vertices;                        /* 3 a vertex */
    uint32_t *indices;                      /* 3 a triangle */
    rt_sphere *spheres;
    rt_vec3 *normals;                       /* as rt_scene wants them; NULL if there are none */
    uint32_t *normal_indices;
    rt_vec3 *colors;                        /* one a vertex, or NULL */
    float *texcoords;                       /* as rt_scene wants them; NULL where no material has a texture */
    uint32_t *texcoord_indices;
    rt_texture *textures;                   /* of the materials; the images' levels are owned */
    size_t texture_count;
    rt_material *materials;
    rt_material *shiny_materials;           /* the same, but .mtl ones as if their illum asked for secondary rays: see sn_settle_mtl */
    size_t material_count;
    char (*material_names)[64];
    uint32_t *material_ids;                 /* one a triangle, then one a sphere */
    rt_light *lights;
    size_t light_count;
    rt_vec3 background, ambient;
    bool has_background, has_camera, has_lights;    /* the file gave them; else they are the defaults of >>camera */
    rt_camera camera;
    size_t shapes;                          /* as the file counts: a polygon, patch, cone, cylinder or sphere is 1 */
    size_t bytes_read;
    size_t warnings;                        /* things that do not stop rendering */
    char warning[256];                      /* the first of them, "file:line: text" */
} scene;

typedef struct { size_t errors; char message[512]; } scene_error;       /* message: the first, "file:line: what is wrong" */

/* Called for every malformed line, with "file:line: what is wrong". */
typedef void (*scene_report)(void *user, const char *line);

/* ---- >>memory ------------------------------------------------------------------------------------------------------- */

typedef struct { void *data; size_t count, capacity; } sn_array;        /* of items of one size, which the caller knows */
typedef struct { size_t start, length; } sn_name;                       /* a stretch of a text */
typedef struct { sn_array text, names, slots; } sn_names;               /* char; sn_name; a hash table of indices into names */

/* All that grows while a scene is made; sn_finish turns it into a scene. */
typedef struct {
    sn_array vertices, colors;              /* float[3]; rt_vec3, empty or one a vertex */
    sn_array normals;                       /* rt_vec3 */
    sn_array triangles, triangle_normals;   /* uint32_t[3]; the latter empty or one a triangle */
    sn_array texcoords, triangle_texcoords; /* float[2]; uint32_t[3], empty or one a triangle */
    sn_array textures;                      /* rt_texture, whose levels are owned: one a name of texture_names, then those of procedural scenes */
    sn_array triangle_materials, spheres, sphere_materials;
    sn_array materials, material_defined;   /* sn_material, bool: one a name of material_names */
    sn_names material_names, libraries;     /* libraries: the .mtl files already read */
    sn_names texture_names;                 /* paths of images */
    sn_array lights;
    sn_array corners, clip;                 /* scratch of polygons */
    uint32_t material;                      /* of the next triangle or sphere; RT_NONE: grey */
    uint64_t ear_budget;                    /* comparisons left for cutting polygons up; see sn_add_polygon */
    bool zero_normals;                      /* some normals are zero: triangles that use them are flat */
    bool no_memory;
    rt_camera camera;
    rt_vec3 background, ambient;
    bool has_camera, has_background;
    size_t shapes, bytes_read;

    const char *file;                       /* for messages: where we are */
    size_t line;
    size_t errors, warnings;
    char warning[256];
    scene_report report;
    void *user;
    scene_error *error;
} sn_builder;

typedef struct { uint32_t v, n, t; } sn_corner;                         /* n RT_NONE: no normal; t: texture coordinates from 1, 0: none */

static bool sn_grow(sn_array *array, size_t item, size_t more)
{
    size_t capacity = array->capacity < 32 ? 64 : array->capacity;
    void *data;

    if (more > SIZE_MAX - array->count) return false;
    while (capacity < array->count + more) {
        if (capacity > SIZE_MAX / 2) return false;
        capacity *= 2;
    }
    if (capacity > SIZE_MAX / item) return false;
    data = realloc(array->data, capacity * item);
    if (!data) return false;
    array->data = data;
    array->capacity = capacity;
    return true;
}

/* Room for more items at the end of array, not set yet; NULL, and b->no_memory, when there is none. */
SCENE_HOT void *sn_add(sn_builder *b, sn_array *array, size_t item, size_t more)
{
    void *added;

    if (array->capacity - array->count < more && !sn_grow(array, item, more)) {
        b->no_memory = true;
        return NULL;
    }
    added = (char *)array->data + array->count * item;
    array->count += more;
    return added;
}

/* The array's memory, trimmed, which the caller then owns; NULL if it is empty. */
static void *sn_take(sn_array *array, size_t item)
{
    void *data = array->data;

    if (array->count == 0) {
        free(data);
        data = NULL;
    } else if (array->count < array->capacity) {
        void *trimmed = realloc(data, array->count * item);

        if (trimmed) data = trimmed;
    }
    memset(array, 0, sizeof *array);
    return data;
}

static void sn_release(sn_builder *b)
{
    sn_array *arrays[] = { &b->vertices, &b->colors, &b->normals, &b->triangles, &b->triangle_normals, &b->triangle_materials,
                           &b->spheres, &b->sphere_materials, &b->materials, &b->material_defined, &b->material_names.text,
                           &b->material_names.names, &b->material_names.slots, &b->libraries.text, &b->libraries.names,
                           &b->libraries.slots, &b->lights, &b->corners, &b->clip, &b->texcoords, &b->triangle_texcoords, &b->textures,
                           &b->texture_names.text, &b->texture_names.names, &b->texture_names.slots };
    size_t i;

    for (i = 0; i < b->textures.count; i++) free((void *)((rt_texture *)b->textures.data)[i].levels);
    for (i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]->data);
}

/* ---- >>report ------------------------------------------------------------------------------------------------------- */

/* "file:line: text"; without the line number if that is 0. */
static void sn_message(const sn_builder *b, char *out, size_t size, const char *format, va_list arguments)
{
    int used = b->line ? snprintf(out, size, "%s:%zu: ", b->file, b->line) : snprintf(out, size, "%s: ", b->file);

    if (used >= 0 && (size_t)used < size) vsnprintf(out + used, size - (size_t)used, format, arguments);
}

/* Reports what is wrong at b->file, b->line; false, so that a caller can return it. */
__attribute__((format(printf, 2, 3)))
static bool sn_fail(sn_builder *b, const char *format, ...)
{
    char message[512];
    va_list arguments;

    va_start(arguments, format);
    sn_message(b, message, sizeof message, format, arguments);
    va_end(arguments);
    if (b->errors++ == 0 && b->error) memcpy(b->error->message, message, sizeof message);
    if (b->report) b->report(b->user, message);
    return false;
}

__attribute__((format(printf, 2, 3)))
static void sn_warn(sn_builder *b, const char *format, ...)
{
    va_list arguments;

    if (b->warnings++ > 0) return;
    va_start(arguments, format);
    sn_message(b, b->warning, sizeof b->warning, format, arguments);
    va_end(arguments);
}

/* ---- >>text --------------------------------------------------------------------------------------------------------- */

typedef struct {
    char *data;                             /* lines end in '\n', the last one too: parsers stop there and need no other bound */
    size_t size;                            /* without the '\n' that was put behind the last character */
    size_t bytes;                           /* of the file */
} sn_text;

SCENE_HOT bool sn_is_blank(char c) { return (unsigned char)c <= ' ' && c != '\n'; }
SCENE_HOT bool sn_is_break(char c) { return (unsigned char)c <= ' '; }
SCENE_HOT bool sn_is_digit(char c) { return (unsigned)(c - '0') < 10; }
SCENE_HOT bool sn_is_letter(char c) { return (unsigned)((c | 32) - 'a') < 26 || c == '_'; }

SCENE_HOT const char *sn_skip(const char *p)
{
    while (sn_is_blank(*p)) p++;
    return p;
}

/* Nothing, or only a comment, is left of the line. */
SCENE_HOT bool sn_at_end(const char *p) { return *p == '\n' || *p == '#'; }

SCENE_HOT const char *sn_token_end(const char *p)
{
    while (!sn_is_break(*p)) p++;
    return p;
}

/* The end of a token that begins with a letter and holds letters, digits and _ only; else NULL. */
static const char *sn_word_end(const char *p)
{
    if (!sn_is_letter(*p)) return NULL;
    while (sn_is_letter(*p) || sn_is_digit(*p)) p++;
    return sn_is_break(*p) ? p : NULL;
}

static bool sn_is_word(const char *p, const char *word)
{
    size_t length = strlen(word);

    return strncmp(p, word, length) == 0 && sn_is_break(p[length]);
}

/* The rest of the line without blanks around it; a comment may be part of a name. */
static sn_name sn_rest(const char *text, const char *p)
{
    const char *end;
    sn_name rest;

    p = sn_skip(p);
    end = strchr(p, '\n');
    while (end > p && sn_is_blank(end[-1])) end--;
    rest.start = (size_t)(p - text);
    rest.length = (size_t)(end - p);
    return rest;
}

/* A token for a message: short, and printable. */
typedef struct { char text[40]; } sn_quoted;

static sn_quoted sn_quote(const char *token, const char *end)
{
    sn_quoted quoted;
    size_t i = 0;

    for (; token < end && i < sizeof quoted.text - 4; token++)
        quoted.text[i++] = (char)((unsigned char)*token < ' ' || (unsigned char)*token >= 127 ? '?' : *token);
    memcpy(quoted.text + i, token < end ? "..." : "", token < end ? 4 : 1);
    return quoted;
}

/* UTF-16 to UTF-8; a surrogate without its mate becomes U+FFFD. out holds 3 bytes for 2 of text. */
static size_t sn_utf8(const unsigned char *text, size_t size, bool big, char *out)
{
    const int high = big ? 0 : 1;
    size_t i, used = 0;

    for (i = 0; i + 1 < size; i += 2) {
        uint32_t c = (uint32_t)text[i + (size_t)high] << 8 | text[i + 1 - (size_t)high];

        if ((c & 0xfc00) == 0xd800 && i + 3 < size && (text[i + 2 + (size_t)high] & 0xfc) == 0xdc) {
            uint32_t low = (uint32_t)text[i + 2 + (size_t)high] << 8 | text[i + 3 - (size_t)high];

            c = 0x10000 + ((c & 0x3ff) << 10 | (low & 0x3ff));
            i += 2;
        } else if ((c & 0xf800) == 0xd800) {
            c = 0xfffd;
        }
        if (c < 0x80) {
            out[used++] = (char)c;
        } else if (c < 0x800) {
            out[used++] = (char)(0xc0 | c >> 6);
            out[used++] = (char)(0x80 | (c & 63));
        } else {
            if (c >= 0x10000) {
                out[used++] = (char)(0xf0 | c >> 18);
                out[used++] = (char)(0x80 | (c >> 12 & 63));
            } else {
                out[used++] = (char)(0xe0 | c >> 12);
            }
            out[used++] = (char)(0x80 | (c >> 6 & 63));
            out[used++] = (char)(0x80 | (c & 63));
        }
    }
    return used;
}

/* CR LF and CR become LF, a NUL a blank. */
static void sn_normalise(sn_text *text)
{
    const char *from = text->data, *end = from + text->size;
    char *to = text->data;

    for (to = text->data; (to = (char *)memchr(to, '\0', (size_t)(end - to))) != NULL; ) *to = ' ';
    from = (const char *)memchr(from, '\r', text->size);
    if (!from) return;
    for (to = text->data + (from - text->data); from < end; from++) {
        if (*from != '\r') *to++ = *from;
        else if (from + 1 == end || from[1] != '\n') *to++ = '\n';
    }
    text->size = (size_t)(to - text->data);
}

/* Reads a whole file; false with *why set when it cannot be read, or with b->no_memory set. The caller frees text->data. */
static bool sn_read(sn_builder *b, const char *path, sn_text *text, const char **why)
{
    struct stat about;
    FILE *file;
    unsigned char *bytes;
    size_t size;

    memset(text, 0, sizeof *text);
    *why = NULL;
    if (stat(path, &about) != 0) return *why = strerror(errno), false;
    if (!S_ISREG(about.st_mode)) return *why = "not a file", false;
    if (about.st_size < 0 || (uintmax_t)about.st_size > SIZE_MAX / 2 - 16) return *why = "too large", false;
    file = fopen(path, "rb");
    if (!file) return *why = strerror(errno), false;
    size = (size_t)about.st_size;
    bytes = (unsigned char *)malloc(size + 2);
    if (!bytes) {
        fclose(file);
        return b->no_memory = true, false;
    }
    setvbuf(file, NULL, _IONBF, 0);         /* one read, straight into bytes */
    text->bytes = fread(bytes, 1, size, file);
    if (ferror(file)) {
        *why = strerror(errno);
        fclose(file);
        free(bytes);
        return false;
    }
    fclose(file);
    text->size = text->bytes;
    text->data = (char *)bytes;
    if (text->size >= 2 && (bytes[0] ^ bytes[1]) == 1 && (bytes[0] | bytes[1]) == 0xff) {       /* FE FF or FF FE */
        char *decoded = (char *)malloc(text->size / 2 * 3 + 2);

        if (!decoded) {
            free(bytes);
            return b->no_memory = true, false;
        }
        text->size = sn_utf8(bytes + 2, text->size - 2, bytes[0] == 0xfe, decoded);
        text->data = decoded;
        free(bytes);
    } else if (text->size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0) {
        memset(bytes, ' ', 3);
    }
    sn_normalise(text);
    text->data[text->size] = '\n';
    text->data[text->size + 1] = '\0';
    return true;
}

/* The end of the statement at p: joins lines that end in a backslash, counts the lines it takes. */
static char *sn_statement_end(const sn_text *text, char *p, size_t *lines)
{
    char *end = text->data + text->size;
    const bool comment = *sn_skip(p) == '#';
    char *stop = p;

    for (*lines = 1; ; ++*lines) {
        stop = (char *)memchr(stop, '\n', (size_t)(end - stop) + 1);
        if (comment || stop == p || stop[-1] != '\\') return stop;
        stop[-1] = ' ';
        if (stop == end) return stop;
        *stop = ' ';
    }
}

/* ---- >>numbers ------------------------------------------------------------------------------------------------------ */

typedef enum { SN_NUMBER, SN_NOT_FINITE, SN_NOT_A_NUMBER } sn_kind;

/* The slow way for a decimal number whose syntax is right: nearest float. strtof sees no decimal point, so the locale does not matter. */
static float sn_number_exact(const char *p, const char *end)
{
    char buffer[160];
    const size_t most = 128;                /* digits that decide which of two neighbouring floats is nearer: fewer than that */
    size_t used = 0;
    long exponent = 0, written = 0;
    bool point = false, more = false;

    if (*p == '-' || *p == '+') buffer[used++] = *p++;
    for (; p < end && (*p | 32) != 'e'; p++) {
        if (*p == '.') { point = true; continue; }
        if (point) exponent--;
        if (used < most) {
            if (*p != '0' || (used > 0 && sn_is_digit(buffer[used - 1]))) buffer[used++] = *p;
        } else {
            more = more || *p != '0';
            exponent++;
        }
    }
    if (more) {                             /* what is left out only matters by not being zero */
        buffer[used++] = '1';
        exponent--;
    }
    if (used == 0 || !sn_is_digit(buffer[used - 1])) buffer[used++] = '0';
    if (p < end) {
        bool negative = p[1] == '-';

        for (p += p[1] == '-' || p[1] == '+' ? 2 : 1; p < end; p++)
            if (written < 100000000) written = written * 10 + (*p - '0');
        exponent += negative ? -written : written;
    }
    snprintf(buffer + used, sizeof buffer - used, "e%ld", exponent);
    return strtof(buffer, NULL);
}

/* Reads the number at *at, a whole token, as the nearest float, and moves *at behind it (not if there is none). */
SCENE_HOT sn_kind sn_number(const char **at, float *out)
{
    static const double powers[] = { 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
                                     1e17, 1e18, 1e19, 1e20, 1e21, 1e22 };
    const uint64_t full = UINT64_C(1000000000000000000);
    const char *p = *at, *digits;
    uint64_t number = 0, bits;
    int exponent = 0;
    bool negative = false, any;
    double value;

    if (*p == '-' || *p == '+') negative = *p++ == '-';
    for (digits = p; sn_is_digit(*p); p++) {
        if (number < full) number = number * 10 + (uint64_t)(*p - '0');
        else if (exponent < 100000) exponent++;
    }
    any = p > digits;
    if (*p == '.') {
        for (digits = ++p; sn_is_digit(*p); p++) {
            if (number >= full) continue;
            number = number * 10 + (uint64_t)(*p - '0');
            if (exponent > -100000) exponent--;
        }
        any = any || p > digits;
    }
    if (any && (*p | 32) == 'e') {
        const bool down = p[1] == '-';
        int given = 0;

        p += down || p[1] == '+' ? 2 : 1;
        if (!sn_is_digit(*p)) return SN_NOT_A_NUMBER;
        for (; sn_is_digit(*p); p++)
            if (given < 100000) given = given * 10 + (*p - '0');
        exponent += down ? -given : given;
    }
    if (!any || !sn_is_break(*p)) {         /* inf, nan, nan(ind), 1.#INF, 1.#QNAN: what printf writes for numbers that are none */
        const char *word = any && *p == '#' ? p + 1 : p;
        char lower[4] = "";
        size_t i;

        for (i = 0; i < 3 && sn_is_letter(word[i]); i++) lower[i] = (char)(word[i] | 32);
        if ((any ? *p == '#' : true) && (!strcmp(lower, "nan") || !strcmp(lower, "inf") || (any && (!strcmp(lower, "ind") ||
            !strcmp(lower, "qna") || !strcmp(lower, "sna"))))) return SN_NOT_FINITE;
        return SN_NOT_A_NUMBER;
    }
    /* number, the power and each operation are off by half a unit of double at most: the float is the nearest one unless the double
       lies within a few units of the middle between two floats. */
    value = (double)number;
    if (exponent < 0 && exponent >= -44) {
        value /= powers[exponent < -22 ? 22 : -exponent];
        if (exponent < -22) value /= powers[-22 - exponent];
    } else if (exponent > 0 && exponent <= 22) {
        value *= powers[exponent];
    }
    memcpy(&bits, &value, sizeof bits);
    if (number != 0 && (exponent < -44 || exponent > 22 || value < 1e-37 || value > 1e38 ||
                        (bits & 0x1fffffff) - 0x0ffffff0 <= 0x20)) {
        const float exact = sn_number_exact(*at, p);

        if (!isfinite(exact)) return SN_NOT_FINITE;
        *out = exact;
    } else {
        *out = (float)(negative ? -value : value);
    }
    *at = p;
    return SN_NUMBER;
}

/* Says what is wrong with the token at p. */
static bool sn_fail_number(sn_builder *b, const char *statement, const char *p, sn_kind kind)
{
    sn_quoted token = sn_quote(p, sn_token_end(p));

    return sn_fail(b, kind == SN_NOT_FINITE ? "%s: '%s' is not a finite number" : "%s: '%s' is not a number", statement, token.text);
}

/* Reads the numbers on the rest of the line, up to most; how many, or -1 after a report. Behind the last one nothing is read. */
SCENE_HOT int sn_numbers(sn_builder *b, const char *statement, const char **at, float *out, int least, int most)
{
    const char *p = *at;
    int count = 0;

    for (;;) {
        sn_kind kind;

        p = sn_skip(p);
        if (count == most || sn_at_end(p)) break;
        kind = sn_number(&p, &out[count]);
        if (kind != SN_NUMBER) return sn_fail_number(b, statement, p, kind), -1;
        count++;
    }
    *at = p;
    if (count >= least) return count;
    sn_fail(b, "%s: %d number%s expected, not %d", statement, least, least == 1 ? "" : "s", count);
    return -1;
}

/* ---- >>build -------------------------------------------------------------------------------------------------------- */

SCENE_HOT rt_vec3 sn_vec3(float x, float y, float z)
{
    rt_vec3 v;

    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

SCENE_HOT void sn_add_vertex(sn_builder *b, rt_vec3 position)
{
    rt_vec3 *vertex = (rt_vec3 *)sn_add(b, &b->vertices, sizeof *vertex, 1);

    if (vertex) *vertex = position;
}

/* Gives the last vertex a colour; those before it without one are white. */
static void sn_color_vertex(sn_builder *b, rt_vec3 color)
{
    size_t missing = b->vertices.count - b->colors.count, i;
    rt_vec3 *colors = (rt_vec3 *)sn_add(b, &b->colors, sizeof *colors, missing);

    if (!colors || missing == 0) return;
    for (i = 0; i + 1 < missing; i++) colors[i] = sn_vec3(1, 1, 1);
    colors[missing - 1] = color;
}

/* Normals are stored with unit length, those without a direction as zero. */
static void sn_add_normal(sn_builder *b, float x, float y, float z)
{
    const double length = sqrt((double)x * (double)x + (double)y * (double)y + (double)z * (double)z);
    rt_vec3 *normal = (rt_vec3 *)sn_add(b, &b->normals, sizeof *normal, 1);

    if (!normal) return;
    if (length > 0 && isfinite(length)) {
        *normal = sn_vec3((float)((double)x / length), (float)((double)y / length), (float)((double)z / length));
    } else {
        *normal = sn_vec3(0, 0, 0);
        b->zero_normals = true;
    }
}

/* normals NULL, or one of them RT_NONE: flat. */
SCENE_HOT void sn_add_triangle(sn_builder *b, sn_corner c0, sn_corner c1, sn_corner c2)
{
    const bool smooth = c0.n != RT_NONE && c1.n != RT_NONE && c2.n != RT_NONE;
    uint32_t *v = (uint32_t *)sn_add(b, &b->triangles, 3 * sizeof *v, 1);
    uint32_t *material = (uint32_t *)sn_add(b, &b->triangle_materials, sizeof *material, 1);

    if (!v || !material) return;
    v[0] = c0.v;
    v[1] = c1.v;
    v[2] = c2.v;
    *material = b->material;
    if (smooth || b->triangle_normals.count > 0) {
        size_t missing = b->triangles.count - b->triangle_normals.count;
        uint32_t *n = (uint32_t *)sn_add(b, &b->triangle_normals, 3 * sizeof *n, missing);

        if (!n) return;
        if (missing > 1) memset(n, 0xff, (missing - 1) * 3 * sizeof *n);        /* RT_NONE */
        n += (missing - 1) * 3;
        n[0] = smooth ? c0.n : RT_NONE;
        n[1] = c1.n;
        n[2] = c2.n;
    }
    if ((c0.t && c1.t && c2.t) || b->triangle_texcoords.count > 0) {
        size_t missing = b->triangles.count - b->triangle_texcoords.count;
        uint32_t *t = (uint32_t *)sn_add(b, &b->triangle_texcoords, 3 * sizeof *t, missing);

        if (!t) return;
        if (missing > 1) memset(t, 0xff, (missing - 1) * 3 * sizeof *t);
        t += (missing - 1) * 3;
        t[0] = c0.t && c1.t && c2.t ? c0.t - 1 : RT_NONE;
        t[1] = c1.t - 1;
        t[2] = c2.t - 1;
    }
}

static void sn_add_texcoord(sn_builder *b, float u, float v)
{
    float *uv = (float *)sn_add(b, &b->texcoords, 2 * sizeof *uv, 1);

    if (!uv) return;
    uv[0] = u;
    uv[1] = v;
}

/* The number of a texture, whose levels are taken over; RT_NONE: out of memory. */
static uint32_t sn_add_texture(sn_builder *b, rt_texture texture)
{
    rt_texture *added = (rt_texture *)sn_add(b, &b->textures, sizeof *added, 1);

    if (!added) {
        free((void *)texture.levels);
        return RT_NONE;
    }
    *added = texture;
    return (uint32_t)(b->textures.count - 1);
}

static void sn_add_sphere(sn_builder *b, rt_vec3 center, float radius)
{
    rt_sphere *sphere = (rt_sphere *)sn_add(b, &b->spheres, sizeof *sphere, 1);
    uint32_t *material = (uint32_t *)sn_add(b, &b->sphere_materials, sizeof *material, 1);

    if (!sphere || !material) return;
    sphere->center = center;
    sphere->radius = radius;
    *material = b->material;
}

static void sn_add_light(sn_builder *b, rt_vec3 position, rt_vec3 color)
{
    rt_light *light = (rt_light *)sn_add(b, &b->lights, sizeof *light, 1);

    if (!light) return;
    memset(light, 0, sizeof *light);
    light->position = position;
    light->color = color;
}

/* ---- >>polygons ----------------------------------------------------------------------------------------------------- */

typedef struct { double x, y; uint32_t next, prev; } sn_clip_corner;

/* Twice the area of a triangle, positive if it turns left. */
static double sn_turn(const sn_clip_corner *a, const sn_clip_corner *b, const sn_clip_corner *c)
{
    return (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
}

static bool sn_same(const sn_clip_corner *a, const sn_clip_corner *b)
{
    return !(a->x < b->x || a->x > b->x || a->y < b->y || a->y > b->y);
}

/* Can the corner i be cut off? Corners that touch a corner of the ear do not count: polygons with a hole visit some places twice. */
static bool sn_is_ear(const sn_clip_corner *c, uint32_t i, uint64_t *budget)
{
    const sn_clip_corner *b = &c[i], *a = &c[b->prev], *d = &c[b->next];
    const sn_clip_corner *p;

    if (!(sn_turn(a, b, d) > 0)) return false;
    for (p = &c[d->next]; p != a; p = &c[p->next]) {
        if (*budget > 0) --*budget;
        if (sn_turn(a, b, p) >= 0 && sn_turn(b, d, p) >= 0 && sn_turn(d, a, p) >= 0 && !sn_same(p, a) && !sn_same(p, b) && !sn_same(p, d))
            return false;
    }
    return true;
}

/* Projects a polygon to the coordinate plane that it faces most; false if it faces none. */
static bool sn_project(const float (*vertices)[3], const sn_corner *corners, size_t count, sn_clip_corner *out)
{
    const float *origin = vertices[corners[0].v];
    double normal[3] = { 0, 0, 0 };
    size_t i, axis, u, v;

    for (i = 0; i < count; i++) {           /* Newell's normal; from the first corner, so that far away polygons keep their digits */
        const float *a = vertices[corners[i].v], *b = vertices[corners[i + 1 < count ? i + 1 : 0].v];

        for (axis = 0; axis < 3; axis++) {
            u = (axis + 1) % 3;
            v = (axis + 2) % 3;
            normal[axis] += ((double)a[u] - (double)origin[u]) * ((double)b[v] - (double)origin[v]) -
                            ((double)a[v] - (double)origin[v]) * ((double)b[u] - (double)origin[u]);
        }
    }
    axis = fabs(normal[0]) > fabs(normal[1]) ? 0 : 1;
    if (fabs(normal[2]) > fabs(normal[axis])) axis = 2;
    if (!(fabs(normal[axis]) > 0) || !isfinite(normal[axis])) return false;
    u = (axis + (normal[axis] > 0 ? 1 : 2)) % 3;
    v = 3 - axis - u;
    for (i = 0; i < count; i++) {
        out[i].x = (double)vertices[corners[i].v][u] - (double)origin[u];
        out[i].y = (double)vertices[corners[i].v][v] - (double)origin[v];
        out[i].next = (uint32_t)(i + 1 < count ? i + 1 : 0);
        out[i].prev = (uint32_t)(i > 0 ? i - 1 : count - 1);
    }
    return true;
}

static bool sn_is_convex(const sn_clip_corner *c, size_t count)
{
    size_t i;

    for (i = 0; i < count; i++)
        if (!(sn_turn(&c[c[i].prev], &c[i], &c[c[i].next]) > 0)) return false;
    return true;
}

/* Adds count - 2 triangles, always, by cutting ears off. Where no ear is left (the polygon crosses itself, or has no area) it settles
   for a corner without area, then for any; so too when the budget is spent, which only input made for that can do: it keeps
   the time of a load in proportion to its corners, though an ear takes a look at all corners that are left. */
static void sn_add_polygon(sn_builder *b, const sn_corner *corners, size_t count)
{
    size_t left = count, misses = 0, i;
    sn_clip_corner *c = NULL;
    uint32_t at = 0;

    if (count > 3 && count < RT_NONE) {
        b->clip.count = 0;
        c = (sn_clip_corner *)sn_add(b, &b->clip, sizeof *c, count);
        if (!c) return;
        if (!sn_project((const float (*)[3])b->vertices.data, corners, count, c) || sn_is_convex(c, count)) c = NULL;
    }
    if (!c) {
        for (i = 2; i < count; i++) sn_add_triangle(b, corners[0], corners[i - 1], corners[i]);
        return;
    }
    b->ear_budget += 256 * (uint64_t)count;
    while (left > 3) {
        const sn_clip_corner corner = c[at];
        const double turn = sn_turn(&c[corner.prev], &c[at], &c[corner.next]);

        if (b->ear_budget == 0 || misses >= 2 * left || (misses >= left && !(turn > 0 || turn < 0)) || sn_is_ear(c, at, &b->ear_budget)) {
            sn_add_triangle(b, corners[corner.prev], corners[at], corners[corner.next]);
            c[corner.prev].next = corner.next;
            c[corner.next].prev = corner.prev;
            left--;
            misses = 0;
            at = c[corner.next].next;       /* not the neighbour: cutting around in turns makes fatter triangles than a fan */
        } else {
            misses++;
            at = corner.next;
        }
    }
    sn_add_triangle(b, corners[c[at].prev], corners[at], corners[c[at].next]);
}

/* ---- >>names -------------------------------------------------------------------------------------------------------- */

static size_t sn_hash(const char *text, size_t length)
{
    uint64_t hash = UINT64_C(14695981039346656037);     /* FNV-1a */
    size_t i;

    for (i = 0; i < length; i++) hash = (hash ^ (unsigned char)text[i]) * UINT64_C(1099511628211);
    return (size_t)(hash ^ hash >> 32);
}

/* The slot that holds the name, or the empty one where it would go; slots.count is a power of 2, and some slot is empty. */
static uint32_t *sn_slot(const sn_names *set, const char *text, size_t length)
{
    const sn_name *names = (const sn_name *)set->names.data;
    uint32_t *slots = (uint32_t *)set->slots.data;
    size_t i;

    for (i = sn_hash(text, length) & (set->slots.count - 1); slots[i] != RT_NONE; i = (i + 1) & (set->slots.count - 1))
        if (names[slots[i]].length == length && memcmp((const char *)set->text.data + names[slots[i]].start, text, length) == 0) break;
    return &slots[i];
}

static uint32_t sn_find(const sn_names *set, const char *text, size_t length)
{
    return set->slots.count ? *sn_slot(set, text, length) : RT_NONE;
}

/* The number of a name, a new one if the set does not have it; RT_NONE when out of memory. */
static uint32_t sn_intern(sn_builder *b, sn_names *set, const char *text, size_t length)
{
    uint32_t found = b->no_memory ? RT_NONE : sn_find(set, text, length);
    sn_name *name;
    char *copy;
    size_t i;

    if (found != RT_NONE || b->no_memory) return found;
    copy = (char *)sn_add(b, &set->text, 1, length + 1);
    name = (sn_name *)sn_add(b, &set->names, sizeof *name, 1);
    if (!copy || !name) return RT_NONE;
    memcpy(copy, text, length);
    copy[length] = '\0';
    name->start = (size_t)(copy - (char *)set->text.data);
    name->length = length;
    if (set->names.count * 2 > set->slots.count) {
        size_t size = set->slots.count ? set->slots.count : 32;
        uint32_t *slots = (uint32_t *)sn_add(b, &set->slots, sizeof *slots, size);

        if (!slots) return RT_NONE;
        memset(set->slots.data, 0xff, set->slots.count * sizeof *slots);
        for (i = 0; i < set->names.count; i++) {
            const char *stored = (const char *)set->text.data + ((sn_name *)set->names.data)[i].start;

            *sn_slot(set, stored, ((sn_name *)set->names.data)[i].length) = (uint32_t)i;
        }
    } else {
        *sn_slot(set, copy, length) = (uint32_t)(set->names.count - 1);
    }
    return (uint32_t)(set->names.count - 1);
}

static const char *sn_name_text(const sn_names *set, size_t i)
{
    return (const char *)set->text.data + ((const sn_name *)set->names.data)[i].start;
}

static rt_material sn_grey(void)
{
    rt_material m;

    memset(&m, 0, sizeof m);
    m.diffuse = sn_vec3(0.8f, 0.8f, 0.8f);
    m.shininess = 1;
    m.ior = 1;
    return m;
}

/* As the file tells, and as it would be with all secondary rays. */
typedef struct { rt_material told, shiny; uint32_t texture, bump; } sn_material;      /* numbers of textures, or RT_NONE */

/* The number of the material with that name, which may be defined later; RT_NONE when out of memory. */
static uint32_t sn_use_material(sn_builder *b, const char *name, size_t length)
{
    uint32_t number = sn_intern(b, &b->material_names, name, length);

    if (number != RT_NONE && number == b->materials.count) {
        sn_material *m = (sn_material *)sn_add(b, &b->materials, sizeof *m, 1);
        bool *defined = (bool *)sn_add(b, &b->material_defined, sizeof *defined, 1);

        if (!m || !defined) return RT_NONE;
        m->told = m->shiny = sn_grey();
        m->texture = m->bump = RT_NONE;
        *defined = false;
    }
    return number;
}

/* Defines the material and makes it that of what is added next. */
static void sn_set_material(sn_builder *b, const char *name, rt_material m)
{
    uint32_t number = sn_use_material(b, name, strlen(name));
    sn_material *to;

    if (number == RT_NONE) return;
    to = &((sn_material *)b->materials.data)[number];
    to->told = to->shiny = m;
    ((bool *)b->material_defined.data)[number] = true;
    b->material = number;
}

/* ---- >>mtl ---------------------------------------------------------------------------------------------------------- */

/* What a newmtl says besides the numbers of rt_material. */
typedef struct {
    int illum;                              /* 0 and 1: dull, 2: with a highlight, 3 to 9: with secondary rays */
    float opacity;                          /* d, or 1 - Tr; negative: not given */
    rt_vec3 filter;                         /* Tf */
} sn_mtl_extra;

static const sn_mtl_extra sn_mtl_default = { 2, -1, { 1, 1, 1 } };

/* A highlight with an exponent below 1 would cover the whole surface: exporters write Ns 0 where there is none. */
static void sn_settle_highlight(rt_material *m)
{
    if (m->shininess < 1) {
        m->shininess = 0;
        m->specular = sn_vec3(0, 0, 0);
    }
}

static void sn_settle_illum(rt_material *m, const sn_mtl_extra *extra, int illum)
{
    const float opacity = extra->opacity, clear = opacity < 0 ? 1 : 1 - opacity;

    if (illum >= 3 && illum <= 6) m->reflect = m->specular;
    if (illum == 4 || illum == 6 || illum == 7) {
        m->transmit = sn_vec3(extra->filter.x * clear, extra->filter.y * clear, extra->filter.z * clear);
        m->fresnel = illum == 7;
        if (opacity >= 0) m->diffuse = sn_vec3(m->diffuse.x * opacity, m->diffuse.y * opacity, m->diffuse.z * opacity);
    }
    if (illum < 6 || m->ior == 0) m->ior = 1;       /* Ni 0 is written where none is meant */
    if (illum == 0 || illum == 1) m->specular = sn_vec3(0, 0, 0);
    sn_settle_highlight(m);
}

/* Secondary rays only where illum asks for them, since exporters write Ks, d and Ni for all: 3 and 5 mirror; 4 mirrors and lets pass, 6
   refracts too, in 7 Fresnel's equations say how much is mirrored. 8 and 9 are 3 and 4 for programs that do not trace rays. Without d,
   what lets pass is clear. With all of them, what has a highlight mirrors as much, and what d leaves over lets pass: so mean the formats
   that know no illum, NFF and AFF, and files that are converted from them. */
static void sn_settle_mtl(sn_material *m, const sn_mtl_extra *extra)
{
    const int illum = extra->illum == 8 ? 3 : extra->illum == 9 ? 4 : extra->illum;
    const bool clear = extra->opacity >= 0 && extra->opacity < 1;

    m->shiny = m->told;
    sn_settle_illum(&m->told, extra, illum);
    sn_settle_illum(&m->shiny, extra, illum >= 3 && illum <= 7 ? illum : clear ? 6 : 3);
}

/* The number, or the nearest that is allowed. */
static float sn_mtl_clamp(sn_builder *b, const char *key, float value, float most)
{
    const float nearest = value < 0 ? 0 : value > most ? most : value;

    if (value < 0) sn_warn(b, "%s: %g is negative; 0 is used", key, (double)value);
    else if (value > most) sn_warn(b, "%s: %g is above %g, which is used", key, (double)value, (double)most);
    return nearest;
}

/* r g b, or r alone for grey. */
static void sn_mtl_color(sn_builder *b, const char *key, const char *p, rt_vec3 *out)
{
    float c[3];
    int count;

    p = sn_skip(p);
    if (sn_is_word(p, "spectral") || sn_is_word(p, "xyz")) {
        sn_warn(b, "%s: '%.8s' colours are not supported", key, *p == 's' ? "spectral" : "xyz");
        return;
    }
    count = sn_numbers(b, key, &p, c, 1, 3);
    if (count == 2) sn_fail(b, "%s: 3 numbers expected, not 2", key);
    else if (count > 0) {
        int i;

        for (i = 0; i < count; i++) c[i] = sn_mtl_clamp(b, key, c[i], FLT_MAX);
        *out = count == 1 ? sn_vec3(c[0], c[0], c[0]) : sn_vec3(c[0], c[1], c[2]);
    }
}

static bool sn_read_ppm(const char *path, bool srgb, rt_vec3 **pixels, int *width, int *height, char *error, size_t error_size);

/* The number of the image at path, read the first time; RT_NONE where that fails, which is reported: what is wrong with a PPM is an error, another format
   a warning. Colours are sRGB, heights are as they stand; so a file of both is two textures, and the name of the latter ends with its 0. */
static uint32_t sn_image(sn_builder *b, const char *key, const char *path, bool heights)
{
    const size_t length = strlen(path), named = length + (heights ? 1 : 0);
    uint32_t number = sn_find(&b->texture_names, path, named);
    char why[512] = "";
    rt_texture texture;
    rt_vec3 *pixels;
    rt_vec3 *levels;
    size_t count;

    if (number != RT_NONE) return number;
    if (length < 4 || (strcmp(path + length - 4, ".ppm") != 0 && strcmp(path + length - 4, ".PPM") != 0)) {
        sn_warn(b, "%s: '%s' is no .ppm, the one format that is read; there is no texture", key, path);
        return RT_NONE;
    }
    memset(&texture, 0, sizeof texture);
    if (!sn_read_ppm(path, !heights, &pixels, &texture.width, &texture.height, why, sizeof why)) {
        if (strstr(why, "out of memory")) b->no_memory = true;
        else sn_fail(b, "%s: %s", key, why);
        return RT_NONE;
    }
    count = rt_count_texture_levels(texture.width, texture.height);
    levels = count ? (rt_vec3 *)malloc(count * sizeof *levels) : NULL;
    if (!count) sn_fail(b, "%s: %s: %d x %d pixels are too many for a texture", key, path, texture.width, texture.height);
    else if (!levels) b->no_memory = true;
    else {
        rt_make_texture_levels(pixels, texture.width, texture.height, levels);
        texture.levels = levels;
        number = sn_intern(b, &b->texture_names, path, named);
        if (number == RT_NONE) free(levels);
        else number = sn_add_texture(b, texture);
    }
    free(pixels);
    return number;
}

/* map_Kd, map_Bump, bump: options, then a path from the .mtl file's folder. Answers the number of the texture or RT_NONE. */
static uint32_t sn_mtl_map(sn_builder *b, const char *text, const char *key, const char *p, bool heights, float *multiplier)
{
    static const struct { const char *name; int least, most; } options[] = {       /* and how many words follow */
        { "-blendu", 1, 1 }, { "-blendv", 1, 1 }, { "-cc", 1, 1 }, { "-clamp", 1, 1 }, { "-texres", 1, 1 }, { "-imfchan", 1, 1 },
        { "-type", 1, 1 }, { "-boost", 1, 1 }, { "-mm", 2, 2 }, { "-o", 1, 3 }, { "-s", 1, 3 }, { "-t", 1, 3 }, { "-bm", 1, 1 },
    };
    const char *slash = strrchr(b->file, '/');
    const size_t folder = slash ? (size_t)(slash + 1 - b->file) : 0;
    sn_name name;
    char *path, *c;
    uint32_t number;

    for (p = sn_skip(p); *p == '-'; ) {
        size_t row = 0;
        int words = 0;

        while (row < sizeof options / sizeof *options && !sn_is_word(p, options[row].name)) row++;
        if (row == sizeof options / sizeof *options) break;         /* a file may be called so */
        p = sn_skip(sn_token_end(p));
        for (; words < options[row].most && !sn_at_end(p); words++) {
            const char *number_end = p;
            float value;

            if (options[row].most > 1 || row + 1 == sizeof options / sizeof *options) {
                if (sn_number(&number_end, &value) != SN_NUMBER || !sn_is_break(*number_end)) break;
                if (row + 1 == sizeof options / sizeof *options) *multiplier = value;
            }
            p = sn_skip(sn_token_end(p));
        }
        if (words < options[row].least) {
            sn_fail(b, "%s: %s lacks its number", key, options[row].name);
            return RT_NONE;
        }
        if (row + 1 < sizeof options / sizeof *options) sn_warn(b, "%s: %s is not supported", key, options[row].name);
    }
    name = sn_rest(text, p);
    if (name.length == 0) {
        sn_warn(b, "%s without a name", key);
        return RT_NONE;
    }
    path = (char *)malloc(folder + name.length + 1);
    if (!path) {
        b->no_memory = true;
        return RT_NONE;
    }
    memcpy(path, b->file, text[name.start] == '/' ? 0 : folder);
    memcpy(path + (text[name.start] == '/' ? 0 : folder), text + name.start, name.length);
    path[(text[name.start] == '/' ? 0 : folder) + name.length] = '\0';
    for (c = path + (text[name.start] == '/' ? 0 : folder); *c; c++)
        if (*c == '\\') *c = '/';
    number = sn_image(b, key, path, heights);
    free(path);
    return number;
}

static void sn_mtl(sn_builder *b, sn_text *text)
{
    static const char *const scalars[] = { "Ns", "d", "Tr", "Ni", "illum" };
    sn_material ignored, *m = NULL;
    rt_vec3 ambient;                        /* Ka: checked and forgotten */
    sn_mtl_extra extra = sn_mtl_default;
    char *p, *stop;
    size_t lines = 0;

    b->line = 1;
    for (p = text->data; p < text->data + text->size && !b->no_memory; p = stop + 1, b->line += lines) {
        const char *key, *end;
        size_t i;

        stop = sn_statement_end(text, p, &lines);
        key = sn_skip(p);
        if (sn_at_end(key)) continue;
        end = sn_token_end(key);
        if (sn_is_word(key, "newmtl")) {
            sn_name name = sn_rest(text->data, end);
            uint32_t number = sn_use_material(b, text->data + name.start, name.length);

            if (m) sn_settle_mtl(m, &extra);
            if (number == RT_NONE) return;
            ignored.told = sn_grey();       /* of two definitions the first one holds */
            ignored.texture = ignored.bump = RT_NONE;
            m = &ignored;
            if (!((bool *)b->material_defined.data)[number]) {
                ((bool *)b->material_defined.data)[number] = true;
                m = &((sn_material *)b->materials.data)[number];
                m->told.shininess = 0;
            }
            extra = sn_mtl_default;
            continue;
        }
        if (!m) {
            sn_warn(b, "'%s' before the first newmtl is ignored", sn_quote(key, end).text);
            continue;
        }
        if (sn_is_word(key, "Kd")) sn_mtl_color(b, "Kd", end, &m->told.diffuse);
        else if (sn_is_word(key, "Ks")) sn_mtl_color(b, "Ks", end, &m->told.specular);
        else if (sn_is_word(key, "Ke")) sn_mtl_color(b, "Ke", end, &m->told.emission);
        else if (sn_is_word(key, "Tf")) sn_mtl_color(b, "Tf", end, &extra.filter);
        else if (sn_is_word(key, "Ka")) sn_mtl_color(b, "Ka", end, &ambient);
        else if (sn_is_word(key, "map_Kd")) {
            float unused = 1;
            m->texture = sn_mtl_map(b, text->data, "map_Kd", end, false, &unused);
        } else if (sn_is_word(key, "map_Bump") || sn_is_word(key, "map_bump") || sn_is_word(key, "bump")) {
            m->told.bump_height = 1;
            m->bump = sn_mtl_map(b, text->data, "bump", end, true, &m->told.bump_height);
        }
        for (i = 0; i < sizeof scalars / sizeof *scalars; i++) {
            float value;

            if (!sn_is_word(key, scalars[i])) continue;
            end = sn_skip(end);
            if (i == 1 && sn_is_word(end, "-halo")) end += 5;
            if (sn_numbers(b, scalars[i], &end, &value, 1, 1) < 0) continue;
            if (i == 0) m->told.shininess = value;
            if (i == 1) extra.opacity = sn_mtl_clamp(b, "d", value, 1);
            if (i == 2) extra.opacity = 1 - sn_mtl_clamp(b, "Tr", value, 1);
            if (i == 3) m->told.ior = sn_mtl_clamp(b, "Ni", value, FLT_MAX);
            if (i == 4) extra.illum = value >= 0 && value <= 10 ? (int)value : 2;
        }
    }
    if (m) sn_settle_mtl(m, &extra);
}

/* Reads the .mtl file at path, if that has not been done; false if there is none. */
static bool sn_mtl_file(sn_builder *b, const char *path)
{
    const char *obj = b->file, *why;
    const size_t line = b->line, length = strlen(path);
    sn_text text;

    if (sn_find(&b->libraries, path, length) != RT_NONE) return true;
    if (!sn_read(b, path, &text, &why)) return b->no_memory;
    if (sn_intern(b, &b->libraries, path, length) != RT_NONE) {
        b->bytes_read += text.bytes;
        b->file = path;
        sn_mtl(b, &text);
        b->file = obj;
        b->line = line;
    }
    free(text.data);
    return true;
}

/* The same for a name beside the .obj file; one written on Windows may have backslashes. */
static bool sn_mtl_named(sn_builder *b, const char *name, size_t length)
{
    const char *slash = name[0] == '/' ? NULL : strrchr(b->file, '/');
    const size_t folder = slash ? (size_t)(slash + 1 - b->file) : 0;
    char *path = (char *)malloc(folder + length + 1), *p;
    bool found;

    if (!path) {
        b->no_memory = true;
        return true;
    }
    memcpy(path, b->file, folder);
    memcpy(path + folder, name, length);
    path[folder + length] = '\0';
    found = sn_mtl_file(b, path);
    if (!found && strchr(path + folder, '\\')) {
        for (p = path + folder; *p; p++)
            if (*p == '\\') *p = '/';
        found = sn_mtl_file(b, path);
    }
    free(path);
    return found;
}

/* mtllib a.mtl b.mtl. The names may be one that holds blanks, or have backslashes before their blanks. */
static void sn_mtllib(sn_builder *b, const char *text, const char *p)
{
    const sn_name all = sn_rest(text, p);
    const char *end = text + all.start + all.length;

    if (all.length == 0) {
        sn_warn(b, "mtllib without a name");
        return;
    }
    if (sn_mtl_named(b, text + all.start, all.length)) return;
    for (p = text + all.start; p < end && *p != '#'; p = sn_skip(p)) {
        char name[1024];
        size_t length = 0;

        while (p < end && !sn_is_break(*p) && length < sizeof name) {
            if (*p == '\\' && p + 1 < end && sn_is_blank(p[1])) p++;
            name[length++] = *p++;
        }
        if (length == sizeof name) p = sn_token_end(p);
        else if (sn_mtl_named(b, name, length)) continue;
        sn_warn(b, "mtllib: cannot read '%s'", sn_quote(name, name + length).text);
    }
}

/* ---- >>obj ---------------------------------------------------------------------------------------------------------- */

/* A face that refers to vertices further down: decided at the end of the file. */
typedef struct {
    size_t line, triangle;                  /* its first triangle */
    size_t corner, corner_count;            /* into sn_obj.later_corners, for more than 3 corners */
    uint64_t v, t, n;                       /* the greatest index of each kind, from 1, as the file has it */
} sn_later;

typedef struct {
    sn_builder *b;
    sn_array later, later_corners;          /* sn_later, sn_corner */
    bool unmet[3];                          /* faces have indices of a kind of which the file has none at all */
} sn_obj;

static void sn_obj_vertex(sn_obj *o, const char *p)
{
    sn_builder *b = o->b;
    float x[7];
    int count = 0;
    bool colored = true;

    /* A vertex even if the line is malformed, so that the indices of others keep their meaning. */
    sn_add_vertex(b, sn_vec3(0, 0, 0));
    for (p = sn_skip(p); count < 7 && !sn_at_end(p); p = sn_skip(p), count++) {
        sn_kind kind = sn_number(&p, &x[count]);

        if (kind == SN_NOT_FINITE && count >= 3) {
            colored = false;
            p = sn_token_end(p);
        } else if (kind != SN_NUMBER) {
            sn_fail_number(b, "v", p, kind);
            return;
        }
    }
    if (count < 3) {
        sn_fail(b, "v: 3 numbers expected, not %d", count);
        return;
    }
    if (b->no_memory) return;
    ((rt_vec3 *)b->vertices.data)[b->vertices.count - 1] = sn_vec3(x[0], x[1], x[2]);
    if (count == 5 || !sn_at_end(p)) sn_warn(b, "v: 3, 4, 6 or 7 numbers expected; those behind the position are ignored");
    else if (!colored) sn_warn(b, "v: a colour that is not finite; white is used");
    else if (count >= 6) sn_color_vertex(b, sn_vec3(x[count - 3], x[count - 2], x[count - 1]));
}

static void sn_obj_normal(sn_obj *o, const char *p)
{
    sn_builder *b = o->b;
    float n[3] = { 0, 0, 0 };
    sn_kind kind;
    int i;

    for (i = 0; i < 3; i++) {
        p = sn_skip(p);
        if (sn_at_end(p)) {
            sn_fail(b, "vn: 3 numbers expected, not %d", i);
            break;
        }
        kind = sn_number(&p, &n[i]);
        if (kind == SN_NOT_FINITE) {        /* of a triangle without area, mostly */
            sn_warn(b, "vn: a normal that is not finite; its faces are flat");
            n[0] = n[1] = n[2] = 0;
            break;
        }
        if (kind == SN_NOT_A_NUMBER) {
            sn_fail_number(b, "vn", p, kind);
            break;
        }
    }
    sn_add_normal(b, n[0], n[1], n[2]);
}

/* u, v and w, of which w is not used; what is not finite is 0. Coordinates even if the line is malformed, for the indices of others. */
static void sn_obj_texture(sn_obj *o, const char *p)
{
    float uv[2] = { 0, 0 }, number = 0;
    int count = 0;

    for (p = sn_skip(p); !sn_at_end(p); p = sn_skip(p), count++) {
        const char *end = p;
        sn_kind kind = sn_number(&end, &number);

        if (kind == SN_NOT_A_NUMBER) {
            sn_fail_number(o->b, "vt", p, kind);
            break;
        }
        if (count < 2 && kind == SN_NUMBER) uv[count] = number;
        p = sn_token_end(p);
    }
    if (count == 0 && sn_at_end(p)) sn_fail(o->b, "vt: 1 number expected, not 0");
    sn_add_texcoord(o->b, uv[0], uv[1]);
}

/* Reads an index from 1, or one from -1 that counts backwards from what has been given. *greatest keeps the greatest one, from 1. */
SCENE_HOT bool sn_obj_index(sn_builder *b, const char **at, const char *token, const char *what, size_t count, uint32_t *out,
                            uint64_t *greatest) {
    const char *p = *at;
    const bool negative = *p == '-';
    uint64_t index = 0;

    if (*p == '-' || *p == '+') p++;
    if (!sn_is_digit(*p))
        return sn_fail(b, "f: '%s' is not a corner (v, v/t, v//n or v/t/n)", sn_quote(token, sn_token_end(token)).text);
    for (; sn_is_digit(*p); p++)
        if (index < UINT64_C(100000000000000000)) index = index * 10 + (uint64_t)(*p - '0');
    *at = p;
    if (index == 0) return sn_fail(b, "f: %s index 0; indices count from 1", what);
    if (negative && index > count)
        return sn_fail(b, "f: '%s': %s index out of range: there are %zu so far", sn_quote(token, sn_token_end(token)).text, what, count);
    if (negative) index = count - index + 1;
    if (index > *greatest) *greatest = index;
    *out = (uint32_t)(index - 1);
    return true;
}

/* Says which index of a face refers to nothing, if one does. Texture and normal indices in a file that has no vt or vn do no harm. */
static bool sn_obj_check(sn_obj *o, const sn_later *face)
{
    const struct { const char *what; uint64_t index; size_t count; } kinds[] = {
        { "vertex", face->v, o->b->vertices.count }, { "texture", face->t, o->b->texcoords.count }, { "normal", face->n, o->b->normals.count }
    };
    size_t i;

    for (i = 0; i < 3; i++) {
        if (kinds[i].index <= kinds[i].count) continue;
        if (i == 0 || kinds[i].count > 0)
            return sn_fail(o->b, "f: %s index %llu out of range: the file has %zu", kinds[i].what, (unsigned long long)kinds[i].index,
                           kinds[i].count);
        if (!o->unmet[i]) sn_warn(o->b, "f: %s indices in a file that has none are ignored", kinds[i].what);
        o->unmet[i] = true;
    }
    return true;
}

static void sn_obj_face(sn_obj *o, const char *p)
{
    sn_builder *b = o->b;
    sn_later face = { 0, 0, 0, 0, 0, 0, 0 };
    size_t with_normal = 0, i;
    sn_corner *corners, *kept;
    sn_later *later;

    b->corners.count = 0;
    for (p = sn_skip(p); !sn_at_end(p); p = sn_skip(p)) {
        const char *token = p;
        sn_corner *corner = (sn_corner *)sn_add(b, &b->corners, sizeof *corner, 1);
        uint32_t texcoord = 0;

        if (!corner) return;
        corner->n = RT_NONE;
        corner->t = 0;
        if (!sn_obj_index(b, &p, token, "vertex", b->vertices.count, &corner->v, &face.v)) return;
        if (*p == '/') {
            p++;
            if (*p != '/' && !sn_is_break(*p)) {
                if (!sn_obj_index(b, &p, token, "texture", b->texcoords.count, &texcoord, &face.t)) return;
                corner->t = texcoord + 1;
            }
            if (*p == '/') {
                p++;
                if (!sn_is_break(*p)) {
                    if (!sn_obj_index(b, &p, token, "normal", b->normals.count, &corner->n, &face.n)) return;
                    with_normal++;
                }
            }
        }
        if (!sn_is_break(*p)) {
            sn_fail(b, "f: '%s' is not a corner (v, v/t, v//n or v/t/n)", sn_quote(token, sn_token_end(token)).text);
            return;
        }
    }
    face.corner_count = b->corners.count;
    if (face.corner_count < 3) {
        sn_fail(b, "f: a face needs 3 corners, not %zu", face.corner_count);
        return;
    }
    b->shapes++;
    corners = (sn_corner *)b->corners.data;
    if (with_normal > 0 && with_normal < face.corner_count) {
        sn_warn(b, "f: only some corners have a normal; the face is flat");
        for (i = 0; i < face.corner_count; i++) corners[i].n = RT_NONE;
    }
    if (face.v <= b->vertices.count && face.t <= o->b->texcoords.count && face.n <= b->normals.count) {
        if (face.corner_count == 3) sn_add_triangle(b, corners[0], corners[1], corners[2]);
        else sn_add_polygon(b, corners, face.corner_count);
        return;
    }
    face.line = b->line;
    face.triangle = b->triangles.count;
    face.corner = o->later_corners.count;
    later = (sn_later *)sn_add(b, &o->later, sizeof *later, 1);
    kept = (sn_corner *)sn_add(b, &o->later_corners, sizeof *kept, face.corner_count);
    if (!later || !kept) return;
    *later = face;
    memcpy(kept, corners, face.corner_count * sizeof *kept);
    for (i = 2; i < face.corner_count; i++) sn_add_triangle(b, corners[0], corners[i - 1], corners[i]);     /* holds the place */
}

/* Cuts up the faces that had to wait for their vertices, and reports those whose vertices never came. */
static void sn_obj_finish(sn_obj *o)
{
    sn_builder *b = o->b;
    size_t i;

    for (i = 0; i < o->later.count && !b->no_memory; i++) {
        const sn_later *face = (const sn_later *)o->later.data + i;
        const size_t added = b->triangles.count, bytes = (face->corner_count - 2) * 3 * sizeof(uint32_t);

        b->line = face->line;
        if (!sn_obj_check(o, face) || face->corner_count == 3) continue;
        sn_add_polygon(b, (const sn_corner *)o->later_corners.data + face->corner, face->corner_count);
        if (b->no_memory) return;
        memcpy((uint32_t *)b->triangles.data + 3 * face->triangle, (uint32_t *)b->triangles.data + 3 * added, bytes);
        if (b->triangle_normals.count > 0)
            memcpy((uint32_t *)b->triangle_normals.data + 3 * face->triangle, (uint32_t *)b->triangle_normals.data + 3 * added, bytes);
        if (b->triangle_texcoords.count > 0)
            memcpy((uint32_t *)b->triangle_texcoords.data + 3 * face->triangle, (uint32_t *)b->triangle_texcoords.data + 3 * added, bytes);
        if (b->triangle_texcoords.count > added) b->triangle_texcoords.count = added;
        b->triangles.count = b->triangle_materials.count = added;
        if (b->triangle_normals.count > added) b->triangle_normals.count = added;
    }
}

static void sn_obj_statement(sn_obj *o, const char *text, const char *p)
{
    sn_builder *b = o->b;
    const char *end;

    if (p[0] == 'v' && sn_is_break(p[1])) {
        sn_obj_vertex(o, p + 1);
    } else if (p[0] == 'f' && sn_is_break(p[1])) {
        sn_obj_face(o, p + 1);
    } else if (p[0] == 'v' && p[1] == 'n' && sn_is_break(p[2])) {
        sn_obj_normal(o, p + 2);
    } else if (p[0] == 'v' && p[1] == 't' && sn_is_break(p[2])) {
        sn_obj_texture(o, p + 2);
    } else if (sn_is_word(p, "usemtl")) {
        const sn_name name = sn_rest(text, p + 6);
        const uint32_t number = sn_use_material(b, text + name.start, name.length);

        if (number != RT_NONE) b->material = number;
    } else if (sn_is_word(p, "mtllib")) {
        sn_mtllib(b, text, p + 6);
    } else if (!strchr("ogslp", p[0]) || !sn_is_break(p[1])) {
        end = sn_word_end(p);
        if (end) sn_warn(b, "'%s' statements are not supported", sn_quote(p, end).text);
        else sn_fail(b, "'%s' is not a statement", sn_quote(p, sn_token_end(p)).text);
    }
}

/* Materials that were used and not defined: "red # like this" may stand for "red", on either side; else they stay grey. */
static void sn_obj_materials(sn_builder *b)
{
    bool *defined = (bool *)b->material_defined.data;
    sn_material *materials = (sn_material *)b->materials.data;
    size_t i, missing = 0, first = 0;

    for (i = 0; i < b->materials.count; i++) {
        const char *name = sn_name_text(&b->material_names, i), *comment = strstr(name, " #");
        size_t length = comment ? (size_t)(comment - name) : 0;
        uint32_t same;

        while (length > 0 && sn_is_blank(name[length - 1])) length--;
        if (!comment || (same = sn_find(&b->material_names, name, length)) == RT_NONE || defined[i] == defined[same]) continue;
        if (defined[i]) materials[same] = materials[i];
        else materials[i] = materials[same];
        defined[i] = defined[same] = true;
    }
    for (i = b->materials.count; i-- > 0; )
        if (!defined[i] && ++missing) first = i;
    if (missing == 0) return;
    b->line = 0;
    sn_warn(b, "%zu material%s not defined, '%.60s' first; grey is used", missing, missing == 1 ? " is" : "s are",
            sn_name_text(&b->material_names, first));
}

static void sn_obj_file(sn_builder *b, const sn_text *text)
{
    sn_obj o;
    char *p, *stop;
    size_t lines = 0;

    memset(&o, 0, sizeof o);
    o.b = b;
    b->line = 1;
    for (p = text->data; p < text->data + text->size && !b->no_memory; p = stop + 1, b->line += lines) {
        const char *statement;

        stop = sn_statement_end(text, p, &lines);
        statement = sn_skip(p);
        if (!sn_at_end(statement)) sn_obj_statement(&o, text->data, statement);
    }
    sn_obj_finish(&o);
    if (!b->no_memory && b->materials.count > 0) sn_obj_materials(b);
    free(o.later.data);
    free(o.later_corners.data);
}

/* ---- >>nff ---------------------------------------------------------------------------------------------------------- */

/* Numbers of a statement may go on over the following lines, so this is a stream of tokens. */
typedef struct {
    sn_builder *b;
    const char *p, *end;                    /* the next character; the '\n' behind the last one */
    size_t line;                            /* of p; b->line is where the statement began */
    const char *statement;                  /* "s", for messages */
} sn_nff;

static void sn_nff_next_line(sn_nff *r)
{
    r->p = (const char *)memchr(r->p, '\n', (size_t)(r->end - r->p) + 1);
    if (r->p == r->end) return;
    r->p++;
    r->line++;
}

/* Moves to the next token: of this line, or of any. False: there is none. */
static bool sn_nff_token(sn_nff *r, bool any_line)
{
    for (;;) {
        r->p = sn_skip(r->p);
        if (!sn_at_end(r->p)) return true;
        if (!any_line) return false;
        sn_nff_next_line(r);
        if (r->p == r->end) return false;
    }
}

/* Reads count numbers; false after a report, and then p is still on the line of what is missing or wrong. */
static bool sn_nff_numbers(sn_nff *r, float *out, int count)
{
    int i;

    for (i = 0; i < count; i++) {
        const sn_nff before = *r;
        const bool there = sn_nff_token(r, true);
        const sn_kind kind = there ? sn_number(&r->p, &out[i]) : SN_NOT_A_NUMBER;

        if (kind == SN_NUMBER) continue;
        if (there && (kind == SN_NOT_FINITE || r->line == before.line)) {
            r->b->line = r->line;
            return sn_fail_number(r->b, r->statement, r->p, kind);
        }
        *r = before;                        /* what follows is the next statement */
        return sn_fail(r->b, "%s: %d number%s expected, not %d", r->statement, count, count == 1 ? "" : "s", i);
    }
    return true;
}

/* Reads up to most further numbers of this line; how many. */
static int sn_nff_more(sn_nff *r, float *out, int most)
{
    int count = 0;

    while (count < most && sn_nff_token(r, false) && sn_number(&r->p, &out[count]) == SN_NUMBER) count++;
    return count;
}

static rt_vec3 sn_nff_vec3(const float *x)
{
    return sn_vec3(x[0], x[1], x[2]);
}

static bool sn_nff_background(sn_nff *r)
{
    float x[3];

    if (!sn_nff_numbers(r, x, 3)) return false;
    r->b->background = sn_nff_vec3(x);
    r->b->has_background = true;
    return true;
}

/* The product of two vectors, in double so that those of tiny components do not vanish; false if it is zero: they are parallel. */
static bool sn_cross(const rt_vec3 *a, const rt_vec3 *b, double out[3])
{
    out[0] = (double)a->y * (double)b->z - (double)a->z * (double)b->y;
    out[1] = (double)a->z * (double)b->x - (double)a->x * (double)b->z;
    out[2] = (double)a->x * (double)b->y - (double)a->y * (double)b->x;
    return fabs(out[0]) > 0 || fabs(out[1]) > 0 || fabs(out[2]) > 0;
}

/* v, then its parts, in any order. */
static bool sn_nff_view(sn_nff *r)
{
    enum { FROM, AT, UP, ANGLE, HITHER, RESOLUTION, PARTS };
    static const struct { const char *word; int count; } parts[PARTS] = {
        { "from", 3 }, { "at", 3 }, { "up", 3 }, { "angle", 1 }, { "hither", 1 }, { "resolution", 2 }
    };
    float x[PARTS][3] = { { 0 } };
    bool given[PARTS] = { false }, wrong = false;
    sn_builder *b = r->b;
    const size_t first = b->line;
    rt_camera *camera = &b->camera;
    rt_vec3 view;
    double side[3];
    int i;

    for (;;) {
        const sn_nff before = *r;

        i = sn_nff_token(r, true) ? 0 : PARTS;
        while (i < PARTS && !sn_is_word(r->p, parts[i].word)) i++;
        if (i == PARTS) {                   /* the next statement */
            *r = before;
            break;
        }
        r->p += strlen(parts[i].word);
        r->statement = parts[i].word;
        b->line = r->line;
        if (sn_nff_numbers(r, x[i], parts[i].count)) {
            given[i] = true;
        } else {
            wrong = true;
            sn_nff_next_line(r);
        }
    }
    if (wrong) return false;
    b->line = first;
    for (i = FROM; i <= ANGLE; i++)
        if (!given[i]) return sn_fail(b, "v: no '%s'", parts[i].word);
    camera->eye = sn_nff_vec3(x[FROM]);
    camera->look = sn_nff_vec3(x[AT]);
    camera->up = sn_nff_vec3(x[UP]);
    camera->fov = x[ANGLE][0];
    b->has_camera = true;
    view = sn_vec3(camera->look.x - camera->eye.x, camera->look.y - camera->eye.y, camera->look.z - camera->eye.z);
    if (!sn_cross(&view, &camera->up, side)) return sn_fail(b, "v: 'at' must differ from 'from', and 'up' not point along the view");
    if (!(camera->fov > 0 && camera->fov < 180)) return sn_fail(b, "v: an angle between 0 and 180 degrees expected");
    return true;
}

/* f r g b Kd Ks Shine T ior: what is missing at the end is as if the surface were dull. Ks mirrors too, and T lets pass, as the scenes
   of the SPD mean it. */
static bool sn_nff_fill(sn_nff *r)
{
    static const char *const names[] = { "r", "g", "b", "Kd", "Ks", "Shine", "T", "the index of refraction" };
    float x[8] = { 0, 0, 0, 1, 0, 0, 0, 1 };
    rt_material m = sn_grey();
    char name[32];
    int i;

    if (!sn_nff_numbers(r, x, 3)) return false;
    sn_nff_more(r, x + 3, 5);
    for (i = 0; i < 8; i++)
        if (x[i] < 0) return sn_fail(r->b, "f: %s is %g; it must not be negative", names[i], (double)x[i]);
    for (i = 4; i < 7; i += 2)
        if (x[i] > 1) return sn_fail(r->b, "f: %s is %g; it must lie between 0 and 1", names[i], (double)x[i]);
    m.diffuse = sn_vec3(x[0] * x[3], x[1] * x[3], x[2] * x[3]);
    if (!isfinite(m.diffuse.x) || !isfinite(m.diffuse.y) || !isfinite(m.diffuse.z))
        return sn_fail(r->b, "f: the colour times Kd is too large");
    m.specular = sn_vec3(x[4], x[4], x[4]);
    m.shininess = x[5];
    m.reflect = m.specular;
    m.transmit = sn_vec3(x[6], x[6], x[6]);
    m.ior = x[7] > 0 ? x[7] : 1;
    sn_settle_highlight(&m);
    snprintf(name, sizeof name, "line %zu", r->b->line);
    sn_set_material(r->b, name, m);
    return true;
}

/* A light without a colour of its own is marked; sn_share_lights gives it its part. */
static bool sn_nff_light(sn_nff *r)
{
    float x[6];
    int more;

    if (!sn_nff_numbers(r, x, 3)) return false;
    more = sn_nff_more(r, x + 3, 3);
    if (more == 1 || more == 2) return sn_fail(r->b, "l: 3 or 6 numbers expected, not %d", 3 + more);
    sn_add_light(r->b, sn_nff_vec3(x), more ? sn_nff_vec3(x + 3) : sn_vec3(-1, -1, -1));
    return true;
}

/* Marked lights share an intensity of 1, so that what faces them all is not burnt out. (The 1 / sqrt(lights) that the SPD name was
   chosen for displays that darken; pictures here are sRGB.) */
static void sn_share_lights(sn_builder *b)
{
    const float share = 1 / (float)b->lights.count;
    rt_light *lights = (rt_light *)b->lights.data;
    size_t i;

    for (i = 0; i < b->lights.count; i++)
        if (lights[i].color.x < 0) lights[i].color = sn_vec3(share, share, share);
}

static bool sn_nff_corners(sn_nff *r, bool normals)
{
    sn_builder *b = r->b;
    const char *digits;
    uint64_t count = 0, i;

    if (!sn_nff_token(r, true)) return sn_fail(b, "%s: the number of corners is missing", r->statement);
    for (digits = r->p; sn_is_digit(*r->p); r->p++)
        if (count < RT_NONE) count = count * 10 + (uint64_t)(*r->p - '0');
    if (!sn_is_break(*r->p) || count < 3) {
        r->p = digits;
        return sn_fail(b, "%s: '%s' is not a number of corners, 3 or more", r->statement, sn_quote(digits, sn_token_end(digits)).text);
    }
    b->corners.count = 0;
    for (i = 0; i < count && !b->no_memory; i++) {
        float x[6];
        sn_corner *corner;

        if (!sn_nff_numbers(r, x, normals ? 6 : 3)) return false;
        corner = (sn_corner *)sn_add(b, &b->corners, sizeof *corner, 1);
        if (!corner) break;
        corner->t = 0;
        corner->v = (uint32_t)b->vertices.count;
        corner->n = normals ? (uint32_t)b->normals.count : RT_NONE;
        sn_add_vertex(b, sn_nff_vec3(x));
        if (normals) sn_add_normal(b, x[3], x[4], x[5]);
    }
    if (b->no_memory) return true;
    sn_add_polygon(b, (const sn_corner *)b->corners.data, (size_t)count);
    b->shapes++;
    return true;
}

static bool sn_nff_polygon(sn_nff *r) { return sn_nff_corners(r, false); }
static bool sn_nff_patch(sn_nff *r)   { return sn_nff_corners(r, true); }

static bool sn_nff_sphere(sn_nff *r)
{
    float x[4];

    if (!sn_nff_numbers(r, x, 4)) return false;
    sn_add_sphere(r->b, sn_nff_vec3(x), fabsf(x[3]));   /* a negative radius: seen from inside only. Both walls are drawn anyway */
    r->b->shapes++;
    return true;
}

static rt_vec3 sn_along(rt_vec3 p, float distance, const double d[3])
{
    const double t = (double)distance;

    return sn_vec3((float)((double)p.x + t * d[0]), (float)((double)p.y + t * d[1]), (float)((double)p.z + t * d[2]));
}

/* An open cone: SCENE_CONE_SEGMENTS sides between two circles, or from a circle to a point, with the normals of the true cone. */
static void sn_add_cone(sn_builder *b, rt_vec3 base, float base_radius, rt_vec3 apex, float apex_radius)
{
    enum { SIDES = SCENE_CONE_SEGMENTS };
    const rt_vec3 axis = sn_vec3(apex.x - base.x, apex.y - base.y, apex.z - base.z);
    const double length = sqrt((double)axis.x * (double)axis.x + (double)axis.y * (double)axis.y + (double)axis.z * (double)axis.z);
    const double slope = ((double)base_radius - (double)apex_radius) / length, turn = 6.283185307179586 / SIDES;
    const uint32_t first = (uint32_t)b->vertices.count, first_normal = (uint32_t)b->normals.count;
    rt_vec3 least = { 0, 0, 0 };            /* the coordinate axis farthest from the cone's */
    double d[3], u[3], v[3], size;
    uint32_t i, k;

    if (fabsf(axis.x) <= fabsf(axis.y) && fabsf(axis.x) <= fabsf(axis.z)) least.x = 1;
    else if (fabsf(axis.y) <= fabsf(axis.z)) least.y = 1;
    else least.z = 1;
    d[0] = (double)axis.x / length;
    d[1] = (double)axis.y / length;
    d[2] = (double)axis.z / length;
    sn_cross(&axis, &least, u);
    size = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    for (i = 0; i < 3; i++) u[i] /= size;
    for (i = 0; i < 3; i++) v[i] = d[(i + 1) % 3] * u[(i + 2) % 3] - d[(i + 2) % 3] * u[(i + 1) % 3];

    for (i = 0; i < SIDES; i++) {
        const double c = cos(turn * i), s = sin(turn * i);
        double out[3];
        float normal[3];

        for (k = 0; k < 3; k++) {
            out[k] = c * u[k] + s * v[k];
            normal[k] = (float)(out[k] + slope * d[k]);
        }
        sn_add_vertex(b, sn_along(base, base_radius, out));
        sn_add_vertex(b, sn_along(apex, apex_radius, out));
        sn_add_normal(b, normal[0], normal[1], normal[2]);
    }
    for (i = 0; i < SIDES; i++) {
        const uint32_t j = (i + 1) % SIDES;
        const sn_corner base_i = { first + 2 * i, first_normal + i, 0 }, base_j = { first + 2 * j, first_normal + j, 0 };
        const sn_corner apex_i = { first + 2 * i + 1, first_normal + i, 0 }, apex_j = { first + 2 * j + 1, first_normal + j, 0 };

        if (base_radius > 0) sn_add_triangle(b, base_i, base_j, apex_i);
        if (apex_radius > 0) sn_add_triangle(b, apex_i, base_j, apex_j);
    }
    b->shapes++;
}

/* c base radius, apex radius; on lines of their own or not. */
static bool sn_nff_cone(sn_nff *r)
{
    sn_builder *b = r->b;
    float x[8];

    if (!sn_nff_numbers(r, x, 8)) return false;
    if (x[3] <= 0 && x[7] <= 0) {           /* both negative: seen from inside only, as spheres */
        x[3] = fabsf(x[3]);
        x[7] = fabsf(x[7]);
    }
    if (x[3] < 0 || x[7] < 0 || !(x[3] > 0 || x[7] > 0)) return sn_fail(b, "c: radii %g and %g make no cone", (double)x[3], (double)x[7]);
    if (!(x[0] < x[4] || x[0] > x[4] || x[1] < x[5] || x[1] > x[5] || x[2] < x[6] || x[2] > x[6]))
        return sn_fail(b, "c: the ends are the same point");
    sn_add_cone(b, sn_nff_vec3(x), x[3], sn_nff_vec3(x + 4), x[7]);
    return true;
}

static void sn_nff_file(sn_builder *b, const sn_text *text)
{
    static const struct { const char *word; bool (*read)(sn_nff *r); } statements[] = {
        { "b", sn_nff_background }, { "v", sn_nff_view }, { "l", sn_nff_light }, { "f", sn_nff_fill }, { "s", sn_nff_sphere },
        { "c", sn_nff_cone }, { "p", sn_nff_polygon }, { "pp", sn_nff_patch }
    };
    const size_t known = sizeof statements / sizeof *statements;
    sn_nff r = { b, text->data, text->data + text->size, 1, "" };

    while (!b->no_memory && sn_nff_token(&r, true)) {
        const char *end;
        bool skip = true;                   /* the numbers that follow, too */
        size_t i = 0;

        b->line = r.line;
        while (i < known && !sn_is_word(r.p, statements[i].word)) i++;
        if (i < known) {
            r.p += strlen(statements[i].word);
            r.statement = statements[i].word;
            skip = !statements[i].read(&r);
            if (!skip && sn_nff_token(&r, false)) {
                b->line = r.line;
                sn_warn(b, "%s: '%s' is ignored", statements[i].word, sn_quote(r.p, sn_token_end(r.p)).text);
            }
        } else if ((end = sn_word_end(r.p)) != NULL) {
            sn_warn(b, "'%s' statements are not supported", sn_quote(r.p, end).text);
        } else {
            sn_fail(b, "'%s' is not a statement", sn_quote(r.p, sn_token_end(r.p)).text);
        }
        sn_nff_next_line(&r);
        while (skip && sn_nff_token(&r, true) && (sn_is_digit(*r.p) || strchr("+-.", *r.p))) sn_nff_next_line(&r);
    }
    sn_share_lights(b);
}

/* ---- >>procedural --------------------------------------------------------------------------------------------------- */

static const rt_vec3 sn_spd_sky = { 0.078f, 0.361f, 0.753f };

static void sn_set_camera(sn_builder *b, rt_vec3 eye, rt_vec3 look, rt_vec3 up, float fov)
{
    b->camera.eye = eye;
    b->camera.look = look;
    b->camera.up = up;
    b->camera.fov = fov;
    b->has_camera = true;
}

static void sn_set_background(sn_builder *b, rt_vec3 color)
{
    b->background = color;
    b->has_background = true;
}

static void sn_set_phong(sn_builder *b, const char *name, rt_vec3 diffuse, float specular, float shininess)
{
    rt_material m = sn_grey();

    m.diffuse = diffuse;
    m.specular = sn_vec3(specular, specular, specular);
    m.shininess = shininess;
    sn_set_material(b, name, m);
}

/* The same, which also mirrors that much. */
static void sn_set_mirror(sn_builder *b, const char *name, rt_vec3 diffuse, float specular, float shininess)
{
    rt_material m = sn_grey();

    m.diffuse = diffuse;
    m.specular = m.reflect = sn_vec3(specular, specular, specular);
    m.shininess = shininess;
    sn_settle_highlight(&m);
    sn_set_material(b, name, m);
}

/* Clear, but for what it absorbs of each colour on a length of 1. */
static void sn_set_glass(sn_builder *b, const char *name, float ior, rt_vec3 absorb)
{
    rt_material m = sn_grey();

    m.diffuse = sn_vec3(0, 0, 0);
    m.specular = sn_vec3(0.5f, 0.5f, 0.5f);
    m.shininess = 100;
    m.transmit = sn_vec3(1, 1, 1);
    m.absorb = absorb;
    m.ior = ior;
    m.fresnel = true;
    sn_set_material(b, name, m);
}

/* A polygon as p of NFF would make it. */
static void sn_add_face(sn_builder *b, const rt_vec3 *points, uint32_t count)
{
    const uint32_t first = (uint32_t)b->vertices.count;
    sn_corner corners[4];
    uint32_t i;

    for (i = 0; i < count; i++) {
        sn_add_vertex(b, points[i]);
        corners[i].v = first + i;
        corners[i].n = RT_NONE;
        corners[i].t = 0;
    }
    if (b->no_memory) return;
    sn_add_polygon(b, corners, count);
    b->shapes++;
}

/* An upright block without its bottom: the corners of its top, in order. */
static void sn_add_block(sn_builder *b, const rt_vec3 top[4])
{
    int i;

    sn_add_face(b, top, 4);
    for (i = 0; i < 4; i++) {
        const rt_vec3 p = top[i], q = top[(i + 1) % 4];
        const rt_vec3 side[4] = { { p.x, 0, p.z }, p, q, { q.x, 0, q.z } };

        sn_add_face(b, side, 4);
    }
}

/* The measured box of Cornell University's Program of Computer Graphics, in millimetres; the ceiling is whole, the light hangs 0.8
   below it. Its light comes from the four corners of the lamp. */
static void sn_make_cornell(sn_builder *b, uint64_t size)
{
    static const rt_vec3 floor_[4] = { { 552.8f, 0, 0 }, { 0, 0, 0 }, { 0, 0, 559.2f }, { 549.6f, 0, 559.2f } };
    static const rt_vec3 ceiling[4] = { { 556, 548.8f, 0 }, { 556, 548.8f, 559.2f }, { 0, 548.8f, 559.2f }, { 0, 548.8f, 0 } };
    static const rt_vec3 back[4] = { { 549.6f, 0, 559.2f }, { 0, 0, 559.2f }, { 0, 548.8f, 559.2f }, { 556, 548.8f, 559.2f } };
    static const rt_vec3 right[4] = { { 0, 0, 559.2f }, { 0, 0, 0 }, { 0, 548.8f, 0 }, { 0, 548.8f, 559.2f } };
    static const rt_vec3 left[4] = { { 552.8f, 0, 0 }, { 549.6f, 0, 559.2f }, { 556, 548.8f, 559.2f }, { 556, 548.8f, 0 } };
    static const rt_vec3 small[4] = { { 130, 165, 65 }, { 82, 165, 225 }, { 240, 165, 272 }, { 290, 165, 114 } };
    static const rt_vec3 tall[4] = { { 423, 330, 247 }, { 265, 330, 296 }, { 314, 330, 456 }, { 472, 330, 406 } };
    static const rt_vec3 lamp[4] = { { 343, 548, 227 }, { 343, 548, 332 }, { 213, 548, 332 }, { 213, 548, 227 } };
    const rt_vec3 white = { 0.725f, 0.71f, 0.68f };
    rt_material glow = sn_grey();
    int i;

    (void)size;
    sn_set_phong(b, "white", white, 0, 0);
    sn_add_face(b, floor_, 4);
    sn_add_face(b, ceiling, 4);
    sn_add_face(b, back, 4);
    sn_set_phong(b, "green", sn_vec3(0.14f, 0.45f, 0.091f), 0, 0);
    sn_add_face(b, right, 4);
    sn_set_phong(b, "red", sn_vec3(0.63f, 0.065f, 0.05f), 0, 0);
    sn_add_face(b, left, 4);
    sn_set_phong(b, "white", white, 0, 0);
    sn_add_block(b, small);
    sn_add_block(b, tall);
    glow.emission = sn_vec3(1, 0.95f, 0.85f);
    sn_set_material(b, "lamp", glow);
    sn_add_face(b, lamp, 4);
    for (i = 0; i < 4; i++)                 /* hung lower than the lamp, so that the ceiling has light too */
        sn_add_light(b, sn_vec3(lamp[i].x, 500, lamp[i].z), sn_vec3(0.26f, 0.24f, 0.205f));
    sn_add_light(b, sn_vec3(278, 400, -800), sn_vec3(0.12f, 0.12f, 0.12f));
    b->ambient = sn_vec3(0.13f, 0.125f, 0.12f);
    sn_set_background(b, sn_vec3(0, 0, 0));
    sn_set_camera(b, sn_vec3(278, 273, -800), sn_vec3(278, 273, 0), sn_vec3(0, 1, 0), 39.3077f);   /* 25 mm of film behind a 35 mm lens */
}

/* A sphere with nine of a third of its size on it: six around its equator, three above, seen along direction. */
static void sn_add_flake(sn_builder *b, const double center[3], double radius, const double direction[3], uint64_t levels)
{
    const double x = direction[0], y = direction[1], z = direction[2], rise = sqrt(2.0 / 3.0), degree = 0.017453292519943295;
    int i, k;

    sn_add_sphere(b, sn_vec3((float)center[0], (float)center[1], (float)center[2]), (float)radius);
    b->shapes++;
    if (levels == 0 || b->no_memory) return;
    for (i = 0; i < 9; i++) {
        const double azimuth = degree * (i / 3 * 120 + (i % 3 == 0 ? 45 : i % 3 == 1 ? 15 : 75));
        const double up = i % 3 == 0 ? rise : 0, flat = sqrt(1 - up * up);
        const double u = flat * cos(azimuth), v = flat * sin(azimuth), turn = z > -0.9999 ? (x * u + y * v) / (1 + z) : 0;
        double child[3], place[3];

        if (z > -0.9999) {                  /* the shortest turn that takes +z to direction */
            child[0] = u - x * turn + x * up;
            child[1] = v - y * turn + y * up;
            child[2] = z * up - x * u - y * v;
        } else {
            child[0] = -u;
            child[1] = v;
            child[2] = -up;
        }
        for (k = 0; k < 3; k++) place[k] = center[k] + child[k] * radius * (4.0 / 3.0);
        sn_add_flake(b, place, radius / 3, child, levels - 1);
    }
}

/* SPD balls: E. Haines, A Proposal for Standard Graphics Environments, IEEE CG&A 7(11), 1987; so are rings and tetra. */
static void sn_make_balls(sn_builder *b, uint64_t size)
{
    static const rt_vec3 ground[4] = { { 12, 12, -0.5f }, { -12, 12, -0.5f }, { -12, -12, -0.5f }, { 12, -12, -0.5f } };
    const double center[3] = { 0, 0, 0 }, up[3] = { 0, 0, 1 };

    sn_set_background(b, sn_spd_sky);
    sn_set_camera(b, sn_vec3(2.1f, 1.3f, 1.7f), sn_vec3(0, 0, 0), sn_vec3(0, 0, 1), 45);
    sn_add_light(b, sn_vec3(4, 3, 2), sn_vec3(-1, -1, -1));
    sn_add_light(b, sn_vec3(1, -4, 4), sn_vec3(-1, -1, -1));
    sn_add_light(b, sn_vec3(-3, 1, 5), sn_vec3(-1, -1, -1));
    sn_set_phong(b, "ground", sn_vec3(0.8f, 0.6f, 0.264f), 0, 0);
    sn_add_face(b, ground, 4);
    sn_set_mirror(b, "ball", sn_vec3(0.5f, 0.45f, 0.35f), 0.5f, 3.0827f);
    sn_add_flake(b, center, 0.5, up, size);
}

/* SPD rings: a pyramid of rows of six interlocked pentagons, each of five cylinders and five spheres. */
static void sn_make_rings(sn_builder *b, uint64_t size)
{
    static const rt_vec3 colors[6] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 }, { 0, 1, 1 }, { 1, 0, 1 }, { 1, 1, 0 } };
    static const char *const names[6] = { "red", "green", "blue", "cyan", "magenta", "yellow" };
    const double thick = 0.07412, radius = 1 / (1 + thick), step = 1 / sin(0.39269908169872414);      /* 22.5 degrees */
    const double fifth = 1.2566370614359172, tenth = fifth / 2, flat = sqrt(0.2), steep = sqrt(0.8);
    const double n = (double)size, far_ = step * (n + 1), half = 1.01 * tan(0.39269908169872414) * (far_ + step);
    const float y = (float)step;
    rt_vec3 wall[4];
    uint64_t row, across, along;
    int ring, i;

    for (i = 0; i < 4; i++)                 /* fills the view */
        wall[i] = sn_vec3((float)(-1 + (i == 1 || i == 2 ? -half : half)), (float)far_, (float)(0.5 + (i < 2 ? half : -half)));
    sn_set_background(b, sn_spd_sky);
    sn_set_camera(b, sn_vec3(-1, -y, 0.5f), sn_vec3(-1, 1 - y, 0.5f), sn_vec3(0, 0, 1), 45);
    sn_add_light(b, sn_vec3(3, -y, 3), sn_vec3(-1, -1, -1));
    sn_add_light(b, sn_vec3(-4, -y, 1), sn_vec3(-1, -1, -1));
    sn_add_light(b, sn_vec3(2, -y, -4), sn_vec3(-1, -1, -1));
    sn_set_phong(b, "wall", sn_vec3(1, 1, 1), 0, 0);
    sn_add_face(b, wall, 4);
    for (row = 0; row < size; row++) for (along = 0; along <= row; along++) for (across = 0; across <= row; across++) {
        const double x = 2 * (double)across - (double)row, z = 2 * (double)along - (double)row, depth = step * (double)(row + 1);

        for (ring = 0; ring < 6 && !b->no_memory; ring++) {
            /* Around the axes of an icosahedron: z, and five that lean away from it by atan 2. */
            const double start = ring == 0 ? 0 : tenth + (ring - 1) * fifth, c = cos(start), s = sin(start);
            const double lean = ring == 0 ? 1 : flat, lift = ring == 0 ? 0 : steep;
            rt_vec3 corner[5];

            for (i = 0; i < 5; i++) {
                const double u = radius * cos(i * fifth), v = radius * sin(i * fifth);

                corner[i] = sn_vec3((float)(x + u * c - v * lean * s), (float)(depth + u * s + v * lean * c), (float)(z + v * lift));
            }
            sn_set_mirror(b, names[ring], sn_vec3(colors[ring].x / 2, colors[ring].y / 2, colors[ring].z / 2), 0.2f, 3.0827f);
            for (i = 0; i < 5; i++) {
                sn_add_cone(b, corner[i], (float)thick, corner[(i + 4) % 5], (float)thick);
                sn_add_sphere(b, corner[i], (float)thick);
                b->shapes++;
            }
        }
    }
}

/* SPD tetra: Sierpinski's tetrahedron in the cube from -1 to 1; at size 1 a single one, so 4^size triangles. */
static void sn_make_tetra(sn_builder *b, uint64_t size)
{
    static const double corners[4][3] = { { -1, -1, 1 }, { -1, 1, -1 }, { 1, -1, -1 }, { 1, 1, 1 } };
    static const int faces[4][3] = { { 0, 1, 2 }, { 3, 2, 1 }, { 2, 3, 0 }, { 1, 0, 3 } };
    const uint64_t count = UINT64_C(1) << (2 * (size - 1));
    uint64_t i;

    sn_set_background(b, sn_spd_sky);
    sn_set_camera(b, sn_vec3(1.02285f, -3.17715f, -2.17451f), sn_vec3(-0.004103f, -0.004103f, 0.216539f),
                  sn_vec3(-0.816497f, -0.816497f, 0.816497f), 45);
    sn_add_light(b, sn_vec3(2, -18, -5), sn_vec3(-1, -1, -1));
    sn_set_phong(b, "red", sn_vec3(1, 0.2f, 0.2f), 0, 0);
    for (i = 0; i < count && !b->no_memory; i++) {
        double center[3] = { 0, 0, 0 }, half = 1;
        rt_vec3 points[4], face[3];
        uint64_t level;
        int k, face_number;

        for (level = size - 1; level-- > 0; ) {         /* two bits of i a level: which corner the next smaller one lies in */
            half /= 2;
            for (k = 0; k < 3; k++) center[k] += half * corners[i >> (2 * level) & 3][k];
        }
        for (k = 0; k < 4; k++)
            points[k] = sn_vec3((float)(center[0] + half * corners[k][0]), (float)(center[1] + half * corners[k][1]),
                                (float)(center[2] + half * corners[k][2]));
        for (face_number = 0; face_number < 4; face_number++) {
            for (k = 0; k < 3; k++) face[k] = points[faces[face_number][k]];
            sn_add_face(b, face, 3);
        }
    }
}

/* A well mixed number made of another (the finaliser of SplitMix64). */
static uint64_t sn_mix(uint64_t x)
{
    x += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

/* The number of that index of a fixed random sequence, in [0, 1). */
static double sn_random(uint64_t index)
{
    return (double)(sn_mix(index) >> 11) * (1.0 / 9007199254740992.0);
}

/* Random triangles in the unit cube, with edges of about size^(-1/3), so that they lie as loosely for any size. */
static void sn_make_cloud(sn_builder *b, uint64_t size)
{
    const double spread = fmin(1, 1.5 * pow((double)size, -1.0 / 3));
    uint64_t i, k;

    sn_set_phong(b, "cloud", sn_vec3(0.9f, 0.9f, 0.9f), 0.25f, 20);
    for (i = 0; i < size && !b->no_memory; i++) {
        rt_vec3 points[3];

        for (k = 0; k < 3; k++) {
            const uint64_t n = 12 * i + 3 + 3 * k;

            points[k] = sn_vec3((float)(sn_random(12 * i) * (1 - spread) + sn_random(n) * spread),
                                (float)(sn_random(12 * i + 1) * (1 - spread) + sn_random(n + 1) * spread),
                                (float)(sn_random(12 * i + 2) * (1 - spread) + sn_random(n + 2) * spread));
        }
        sn_add_face(b, points, 3);
        for (k = 0; k < 3 && !b->no_memory; k++) {      /* the colour of each corner tells where it is */
            rt_vec3 *color = (rt_vec3 *)sn_add(b, &b->colors, sizeof *color, 1);

            if (color) *color = sn_vec3(0.15f + 0.8f * points[k].x, 0.15f + 0.8f * points[k].y, 0.15f + 0.8f * points[k].z);
        }
    }
}

/* Smooth noise in [0, 1): random values on the integers, blended in between. */
static double sn_noise(double x, double y, uint64_t seed)
{
    const double fx = floor(x), fy = floor(y), u = x - fx, v = y - fy;
    const double su = u * u * u * (u * (u * 6 - 15) + 10), sv = v * v * v * (v * (v * 6 - 15) + 10);
    double corner[4];
    int i;

    for (i = 0; i < 4; i++)
        corner[i] = sn_random(sn_mix((uint64_t)((int64_t)fx + (i & 1)) ^ seed) + (uint64_t)((int64_t)fy + (i >> 1)));
    return (corner[0] + (corner[1] - corner[0]) * su) * (1 - sv) + (corner[2] + (corner[3] - corner[2]) * su) * sv;
}

/* Ridged fractal noise: sharp where the noise passes its middle, rougher where it is high. */
static double sn_terrain_height(double x, double y)
{
    double height = 0, scale = 1, rough = 1, frequency = 1.2;
    int octave;

    for (octave = 0; octave < 11; octave++) {
        const double ridge = 1 - fabs(2 * sn_noise(x * frequency + 17, y * frequency + 5, (uint64_t)octave) - 1);

        height += scale * rough * ridge * ridge;
        rough = fmin(1, ridge * 1.4);
        scale *= 0.46;
        frequency *= 2.03;
    }
    return height * 0.3 - 0.2;
}

/* Mountains around a lake: a grid of 2 k k triangles over the square from -1 to 1. */
static void sn_make_terrain(sn_builder *b, uint64_t size)
{
    const uint64_t k = (uint64_t)(sqrt((double)size / 2) + 0.5), row = k + 1;
    const double cell = 2 / (double)k;
    const rt_vec3 water = { 0.06f, 0.16f, 0.26f }, sand = { 0.45f, 0.38f, 0.25f }, grass = { 0.13f, 0.24f, 0.06f };
    const rt_vec3 rock = { 0.30f, 0.27f, 0.24f }, snow = { 0.85f, 0.87f, 0.92f };
    const float *points;
    uint64_t i, j;

    for (j = 0; j <= k && !b->no_memory; j++)
        for (i = 0; i <= k; i++) {
            const double x = (double)i * cell - 1, y = (double)j * cell - 1;

            sn_add_vertex(b, sn_vec3((float)x, (float)y, (float)fmax(0, sn_terrain_height(x, y))));
        }
    if (b->no_memory) return;
    points = (const float *)b->vertices.data;
    for (j = 0; j <= k && !b->no_memory; j++)
        for (i = 0; i <= k; i++) {
            const uint64_t here = j * row + i, west = i > 0 ? here - 1 : here, east = i < k ? here + 1 : here;
            const uint64_t south = j > 0 ? here - row : here, north = j < k ? here + row : here;
            const float z = points[3 * here + 2];
            const double dx = (double)(points[3 * east + 2] - points[3 * west + 2]) / ((double)(east - west) * cell);
            const double dy = (double)(points[3 * north + 2] - points[3 * south + 2]) / ((double)((north - south) / row) * cell);
            const double steep = sqrt(dx * dx + dy * dy);
            rt_vec3 *color = (rt_vec3 *)sn_add(b, &b->colors, sizeof *color, 1);

            sn_add_normal(b, (float)-dx, (float)-dy, 1);
            if (!color) return;
            *color = z <= 0 ? water : steep > 0.95 ? rock : z > 0.22f ? snow : z < 0.012f ? sand : steep > 0.7 ? rock : grass;
        }
    for (j = 0; j < k && !b->no_memory; j++)
        for (i = 0; i < k; i++) {
            const uint64_t v[4] = { j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i };
            sn_corner c[4];
            bool lake = true;
            int n;

            for (n = 0; n < 4; n++) {
                c[n].v = c[n].n = (uint32_t)v[n];
                c[n].t = 0;
                lake = lake && points[3 * v[n] + 2] <= 0;
            }
            if (lake) sn_set_mirror(b, "lake", sn_vec3(1, 1, 1), 0.4f, 60);
            else sn_set_phong(b, "land", sn_vec3(1, 1, 1), 0, 0);
            sn_add_triangle(b, c[0], c[1], c[2]);
            sn_add_triangle(b, c[0], c[2], c[3]);
        }
    b->shapes = b->triangles.count;
    b->ambient = sn_vec3(0.20f, 0.23f, 0.30f);
    sn_set_background(b, sn_vec3(0.45f, 0.62f, 0.85f));
    sn_add_light(b, sn_vec3(-60, -15, 50), sn_vec3(1.1f, 1.0f, 0.85f));
    sn_set_camera(b, sn_vec3(-0.25f, -1.0f, 0.55f), sn_vec3(0.05f, 0.2f, 0), sn_vec3(0, 0, 1), 50);
}

/* A closed mesh: two poles, and rings of twice as many vertices as there are rows between them. */
static void sn_make_sphere(sn_builder *b, uint64_t size)
{
    const uint32_t rows = (uint32_t)((1 + sqrt(1 + (double)size)) / 2 + 0.5), sides = 2 * rows;
    const uint32_t south = (rows - 1) * sides, north = south + 1;
    const double pi = 3.141592653589793;
    uint32_t i, j;

    for (j = 1; j < rows && !b->no_memory; j++)
        for (i = 0; i < sides; i++) {
            const double latitude = pi * j / rows, longitude = 2 * pi * i / sides;
            const rt_vec3 p = { (float)(sin(latitude) * cos(longitude)), (float)(-cos(latitude)), (float)(sin(latitude) * sin(longitude)) };

            sn_add_vertex(b, p);
            sn_add_normal(b, p.x, p.y, p.z);
        }
    for (i = 0; i < 2; i++) {
        sn_add_vertex(b, sn_vec3(0, i ? 1.0f : -1.0f, 0));
        sn_add_normal(b, 0, i ? 1.0f : -1.0f, 0);
    }
    sn_set_phong(b, "sphere", sn_vec3(0.55f, 0.12f, 0.08f), 0.4f, 40);
    for (j = 0; j < rows && !b->no_memory; j++)
        for (i = 0; i < sides; i++) {
            const uint32_t next = (i + 1) % sides, below = (j - 1) * sides, above = j * sides;
            const uint32_t v[4] = { j > 0 ? below + i : south, j > 0 ? below + next : south, j + 1 < rows ? above + i : north,
                                    j + 1 < rows ? above + next : north };
            const sn_corner c[4] = { { v[0], v[0], 0 }, { v[1], v[1], 0 }, { v[2], v[2], 0 }, { v[3], v[3], 0 } };

            if (j > 0) sn_add_triangle(b, c[0], c[2], c[1]);
            if (j + 1 < rows) sn_add_triangle(b, c[1], c[2], c[3]);
        }
    b->shapes = b->triangles.count;
}

/* The square floor from -half to half, in count x count fields of two materials. */
static void sn_add_chequers(sn_builder *b, float y, float half, int count, const char *light, const char *dark)
{
    const float field = 2 * half / (float)count;
    int i, j;

    for (j = 0; j < count && !b->no_memory; j++)
        for (i = 0; i < count; i++) {
            const float x0 = field * (float)i - half, z0 = field * (float)j - half, x1 = x0 + field, z1 = z0 + field;
            const rt_vec3 corners[4] = { { x0, y, z0 }, { x0, y, z1 }, { x1, y, z1 }, { x1, y, z0 } };

            if ((i + j) % 2) sn_set_mirror(b, dark, sn_vec3(0.05f, 0.06f, 0.09f), 0.12f, 60);
            else sn_set_phong(b, light, sn_vec3(0.75f, 0.72f, 0.66f), 0, 0);
            sn_add_face(b, corners, 4);
        }
}

/* A closed box, its faces turned outwards; turned by an angle around y. */
static void sn_add_box(sn_builder *b, rt_vec3 center, rt_vec3 half, float turn)
{
    static const unsigned char faces[6][4] = { { 0, 4, 6, 2 }, { 1, 3, 7, 5 }, { 0, 1, 5, 4 }, { 2, 6, 7, 3 }, { 0, 2, 3, 1 },
                                               { 4, 5, 7, 6 } };
    const float c = cosf(turn), s = sinf(turn);
    rt_vec3 corners[8], face[4];
    int i, k;

    for (i = 0; i < 8; i++) {
        const float x = i & 1 ? half.x : -half.x, y = i & 2 ? half.y : -half.y, z = i & 4 ? half.z : -half.z;

        corners[i] = sn_vec3(center.x + c * x + s * z, center.y + y, center.z - s * x + c * z);
    }
    for (i = 0; i < 6; i++) {
        for (k = 0; k < 4; k++) face[k] = corners[faces[i][k]];
        sn_add_face(b, face, 4);
    }
}

/* A gallery between two mirrors that face each other, with N rows of coloured balls on pedestals. */
static void sn_make_mirrors(sn_builder *b, uint64_t size)
{
    static const rt_vec3 colors[3] = { { 0.75f, 0.12f, 0.08f }, { 0.08f, 0.45f, 0.15f }, { 0.1f, 0.2f, 0.7f } };
    static const char *const names[3] = { "red", "green", "blue" };
    const float length = 2.5f * (float)size + 2, half = length / 2, width = 3, height = 3;
    const rt_vec3 left[4] = { { -width, 0, -half }, { -width, height, -half }, { -width, height, half }, { -width, 0, half } };
    const rt_vec3 right[4] = { { width, 0, half }, { width, height, half }, { width, height, -half }, { width, 0, -half } };
    const rt_vec3 back[4] = { { -width, 0, -half }, { width, 0, -half }, { width, height, -half }, { -width, height, -half } };
    const rt_vec3 ceiling[4] = { { -width, height, half }, { -width, height, -half }, { width, height, -half }, { width, height, half } };
    uint64_t i;
    int k;

    sn_set_background(b, sn_vec3(0.02f, 0.02f, 0.03f));
    b->ambient = sn_vec3(0.15f, 0.15f, 0.16f);
    sn_set_camera(b, sn_vec3(-2.6f, 1.7f, half - 0.3f), sn_vec3(0.5f, 0.9f, half - 3.2f), sn_vec3(0, 1, 0), 60);
    for (i = 0; i < 2; i++) sn_add_light(b, sn_vec3(0, 2.8f, i ? -half / 2 : half / 2), sn_vec3(0.42f, 0.41f, 0.38f));
    for (i = 0; i < size; i++)
        for (k = 0; k < 3 && !b->no_memory; k++) {
            const float x = 1.6f * (float)(k - 1), z = half - 3 - 2.5f * (float)i + (k == 1 ? 0.8f : 0);

            sn_set_phong(b, "stone", sn_vec3(0.55f, 0.52f, 0.48f), 0, 0);
            sn_add_box(b, sn_vec3(x, 0.3f, z), sn_vec3(0.3f, 0.3f, 0.3f), 0.4f * (float)k);
            sn_set_mirror(b, names[((uint64_t)k + i) % 3], colors[((uint64_t)k + i) % 3], 0.25f, 50);
            sn_add_sphere(b, sn_vec3(x, 0.95f, z), 0.35f);
            b->shapes++;
        }
    sn_add_chequers(b, 0, half > width ? half : width, 2 * (int)(half > width ? half : width), "light", "dark");
    sn_set_phong(b, "plaster", sn_vec3(0.7f, 0.7f, 0.68f), 0, 0);
    sn_add_face(b, back, 4);
    sn_add_face(b, ceiling, 4);
    sn_set_mirror(b, "mirror", sn_vec3(0, 0, 0), 0.92f, 0);
    sn_add_face(b, left, 4);
    sn_add_face(b, right, 4);
}

/* On a chequered floor: N x N balls of clear and coloured glass, with a block of glass and a mirror ball behind them. */
static void sn_make_glass(sn_builder *b, uint64_t size)
{
    static const rt_vec3 tints[4] = { { 0.02f, 0.01f, 0.015f }, { 0.1f, 1.1f, 1.6f }, { 1.4f, 0.25f, 0.9f }, { 1.5f, 0.7f, 0.08f } };
    static const char *const names[4] = { "clear", "red glass", "green glass", "blue glass" };
    const float n = (float)size, radius = 0.42f;
    uint64_t i, j;

    sn_set_background(b, sn_vec3(0.35f, 0.5f, 0.75f));
    b->ambient = sn_vec3(0.2f, 0.2f, 0.22f);
    sn_set_camera(b, sn_vec3(0.45f * n + 0.6f, 0.6f * n + 1.2f, 1.1f * n + 2.2f), sn_vec3(0, 0.25f, -0.25f), sn_vec3(0, 1, 0), 42);
    sn_add_light(b, sn_vec3(-2 * n, 4 * n + 2, 2 * n), sn_vec3(0.6f, 0.58f, 0.55f));
    sn_add_light(b, sn_vec3(3 * n, 3 * n + 2, n + 2), sn_vec3(0.3f, 0.3f, 0.32f));
    sn_add_chequers(b, 0, n + 3, 2 * ((int)size + 3), "light", "dark");
    for (j = 0; j < size; j++)
        for (i = 0; i < size && !b->no_memory; i++) {
            const uint64_t kind = (i + 2 * j) % 4;

            sn_set_glass(b, names[kind], 1.5f, tints[kind]);
            sn_add_sphere(b, sn_vec3((float)i - (n - 1) / 2, radius + 0.01f, (float)j - (n - 1) / 2), radius);
            b->shapes++;
        }
    sn_set_glass(b, "block", 1.52f, sn_vec3(0.35f, 0.05f, 0.2f));
    sn_add_box(b, sn_vec3(-0.9f, 0.61f, -n / 2 - 0.7f), sn_vec3(0.7f, 0.6f, 0.25f), 0.35f);
    sn_set_mirror(b, "mirror", sn_vec3(0.04f, 0.04f, 0.04f), 0.9f, 300);
    sn_add_sphere(b, sn_vec3(0.9f, 0.8f, -n / 2 - 0.8f), 0.8f);
    b->shapes++;
}

/* A surface over the unit square; shape: its place and measures. */
typedef rt_vec3 (*sn_surface)(const double shape[6], double u, double v);

/* 0 on the border of each unit cell, 1 inside of it, with a slope in between. */
static double sn_panel(double x)
{
    return fmin(1, 8 * fmax(0, 0.42 - fabs(x - floor(x) - 0.5)));
}

/* A fluted column: foot x, y, z, radius, height. */
static rt_vec3 sn_column(const double shape[6], double u, double v)
{
    const double a = 6.283185307179586 * u, ends = fmax(0, fmax(1 - 14 * v, 1 - 9 * (1 - v)));
    const double radius = shape[3] * (1 - 0.12 * v + 0.5 * ends * ends - (ends > 0 ? 0 : 0.07 * fabs(sin(8 * a))));

    return sn_vec3((float)(shape[0] + radius * cos(a)), (float)(shape[1] + shape[4] * v), (float)(shape[2] + radius * sin(a)));
}

/* Half a ring that stands: its centre, its radius, half its thickness; 1: across the hall, 0: along it. */
static rt_vec3 sn_arch(const double shape[6], double u, double v)
{
    const double a = 6.283185307179586 * u, t = 3.141592653589793 * v, d = shape[3] + shape[4] * cos(a);
    const double along = d * cos(t), across = shape[4] * sin(a);

    return sn_vec3((float)(shape[0] + (shape[5] > 0 ? along : across)), (float)(shape[1] + d * sin(t)),
                   (float)(shape[2] + (shape[5] > 0 ? across : along)));
}

/* Half a tube with coffers, from z backwards: x, y and z where it starts, radius, length, coffers along it. */
static rt_vec3 sn_vault(const double shape[6], double u, double v)
{
    const double t = 3.141592653589793 * u, d = shape[3] + 0.18 * sn_panel(9 * u) * sn_panel(shape[5] * v);

    return sn_vec3((float)(shape[0] + d * cos(t)), (float)(shape[1] + d * sin(t)), (float)(shape[2] - shape[4] * v));
}

/* A wall with panels, from z backwards: x, y and z where it starts, height, length, how deep the panels are. */
static rt_vec3 sn_panels(const double shape[6], double u, double v)
{
    return sn_vec3((float)(shape[0] + shape[5] * sn_panel(2 * u) * sn_panel(v * shape[4] / 2)), (float)(shape[1] + shape[3] * u),
                   (float)(shape[2] - shape[4] * v));
}

/* An urn: foot x, y, z, radius, height. */
static rt_vec3 sn_urn(const double shape[6], double u, double v)
{
    const double a = 6.283185307179586 * u, belly = sin(3.3 * v * v + 0.1), lip = fmax(0, 8 * v - 7.2);
    const double radius = shape[3] * (0.25 + 0.75 * fmax(0, belly) * (1 + 0.05 * cos(12 * a)) + 0.4 * lip + fmax(0, 0.3 - 3 * v));

    return sn_vec3((float)(shape[0] + radius * cos(a)), (float)(shape[1] + shape[4] * v), (float)(shape[2] + radius * sin(a)));
}

/* A mesh of rows x columns quads, smooth, each side multiplied by detail; returns how many triangles. detail 0: only says how many
   for a detail of 1. */
static double sn_add_surface(sn_builder *b, sn_surface at, const double shape[6], double columns, double rows, double detail)
{
    const uint32_t n = (uint32_t)fmax(3, columns * detail + 0.5), m = (uint32_t)fmax(3, rows * detail + 0.5);
    const uint32_t vertex = (uint32_t)b->vertices.count, normal = (uint32_t)b->normals.count;
    const double step = 1e-3;
    uint32_t i, j, k;

    if (detail <= 0) return 2 * columns * rows;
    for (j = 0; j <= m && !b->no_memory; j++)
        for (i = 0; i <= n; i++) {
            const double u = (double)i / n, v = (double)j / m;
            const rt_vec3 left = at(shape, u - step, v), right = at(shape, u + step, v);
            const rt_vec3 below = at(shape, u, fmax(0, v - step)), above = at(shape, u, fmin(1, v + step));
            const rt_vec3 p = { right.x - left.x, right.y - left.y, right.z - left.z };
            const rt_vec3 q = { above.x - below.x, above.y - below.y, above.z - below.z };

            sn_add_vertex(b, at(shape, u, v));
            sn_add_normal(b, q.y * p.z - q.z * p.y, q.z * p.x - q.x * p.z, q.x * p.y - q.y * p.x);
        }
    for (j = 0; j < m && !b->no_memory; j++)
        for (i = 0; i < n; i++) {
            const uint32_t places[4] = { j * (n + 1) + i, (j + 1) * (n + 1) + i, (j + 1) * (n + 1) + i + 1, j * (n + 1) + i + 1 };
            sn_corner c[4];

            for (k = 0; k < 4; k++) {
                c[k].v = vertex + places[k];
                c[k].n = normal + places[k];
                c[k].t = 0;
            }
            sn_add_triangle(b, c[0], c[1], c[2]);
            sn_add_triangle(b, c[0], c[2], c[3]);
        }
    b->shapes++;
    return 2.0 * n * m;
}

enum { SN_BAYS = 8 };                       /* of the hall, each 4 long */

/* All curved things of the hall; returns as sn_add_surface. */
static double sn_add_arcades(sn_builder *b, double detail)
{
    const double length = 4 * SN_BAYS, vault[6] = { 0, 4.6, 0, 3, length, 2 * SN_BAYS };
    double count = 0;
    int side, i;

    sn_set_phong(b, "plaster", sn_vec3(0.72f, 0.68f, 0.6f), 0, 0);
    count += sn_add_surface(b, sn_vault, vault, 36, 64, detail);
    for (i = 0; i <= SN_BAYS; i++) {
        const double rib[6] = { 0, 4.6, fmin(-0.15, fmax(0.15 - length, -4 * i)), 2.95, 0.16, 1 };

        sn_set_phong(b, "rib", sn_vec3(0.55f, 0.5f, 0.42f), 0, 0);
        count += sn_add_surface(b, sn_arch, rib, 8, 24, detail);
    }
    for (side = -1; side <= 1; side += 2) {
        const double wall[6] = { 5 * side, 0, 0, 4.6, length, 0.15 * side };

        sn_set_phong(b, "panels", sn_vec3(0.5f, 0.3f, 0.2f), 0, 0);
        count += sn_add_surface(b, sn_panels, wall, 12, 64, detail);
        for (i = 0; i <= SN_BAYS; i++) {
            const double z = fmin(-0.3, fmax(0.3 - length, -4 * i)), column[6] = { 3 * side, 0, z, 0.3, 2.6 };

            sn_set_phong(b, "marble", sn_vec3(0.75f, 0.72f, 0.66f), 0.2f, 40);
            count += sn_add_surface(b, sn_column, column, 32, 14, detail);
        }
        for (i = 0; i < SN_BAYS; i++) {
            const double z = -4 * i - 2, arch[6] = { 3 * side, 2.6, z, 1.85, 0.22, 0 }, urn[6] = { 4.1 * side, 0.8, z, 0.35, 1 };

            sn_set_phong(b, "rib", sn_vec3(0.55f, 0.5f, 0.42f), 0, 0);
            count += sn_add_surface(b, sn_arch, arch, 8, 16, detail);
            sn_set_phong(b, i % 2 ? "bronze" : "glaze", i % 2 ? sn_vec3(0.4f, 0.25f, 0.1f) : sn_vec3(0.1f, 0.3f, 0.4f), 0.4f, 30);
            count += sn_add_surface(b, sn_urn, urn, 20, 16, detail);
        }
    }
    return count;
}

/* A closed hall of about N triangles: columns and arches on both sides, urns behind them, pews, stairs at its end, a vault above. */
static void sn_make_hall(sn_builder *b, uint64_t size)
{
    const float length = 4 * SN_BAYS;
    const double urn[6] = { 0, 2, 2.2 - 4 * SN_BAYS, 0.7, 1.8 };
    double rest;
    int side, i, k;

    sn_add_chequers(b, 0, length / 2, 2 * SN_BAYS, "light", "dark");        /* around the origin: z from 0 backwards comes below */
    for (i = 0; i < (int)b->vertices.count; i++) ((rt_vec3 *)b->vertices.data)[i].z -= length / 2;
    for (side = -1; side <= 1; side += 2) {
        const float x = 5.2f * (float)side, z = side > 0 ? 0 : -length;
        const rt_vec3 aisle[4] = { { x, 4.6f, 0 }, { x, 4.6f, -length }, { 3 * (float)side, 4.6f, -length }, { 3 * (float)side, 4.6f, 0 } };
        const rt_vec3 end[4] = { { -5.2f, 0, z }, { 5.2f, 0, z }, { 5.2f, 8, z }, { -5.2f, 8, z } };

        sn_set_phong(b, "plaster", sn_vec3(0.72f, 0.68f, 0.6f), 0, 0);
        sn_add_face(b, aisle, 4);
        sn_add_face(b, end, 4);
        for (i = 0; i < SN_BAYS; i++) {
            sn_set_phong(b, "stone", sn_vec3(0.45f, 0.43f, 0.4f), 0, 0);
            sn_add_box(b, sn_vec3(4.1f * (float)side, 0.4f, -4 * (float)i - 2), sn_vec3(0.35f, 0.4f, 0.35f), 0);
        }
        for (i = 0; i < 2 * SN_BAYS; i++) {
            const float pew = 1.4f * (float)side, at = -3 - 1.2f * (float)i;

            sn_set_phong(b, "wood", sn_vec3(0.35f, 0.18f, 0.08f), 0.1f, 20);
            sn_add_box(b, sn_vec3(pew, 0.45f, at), sn_vec3(0.9f, 0.03f, 0.22f), 0);
            sn_add_box(b, sn_vec3(pew, 0.75f, at - 0.22f), sn_vec3(0.9f, 0.25f, 0.03f), 0);
            for (k = -1; k <= 1; k++) sn_add_box(b, sn_vec3(pew + 0.85f * (float)k, 0.22f, at), sn_vec3(0.03f, 0.2f, 0.2f), 0);
        }
    }
    sn_set_phong(b, "stairs", sn_vec3(0.6f, 0.57f, 0.52f), 0, 0);
    for (i = 0; i < 8; i++)
        sn_add_box(b, sn_vec3(0, 0.075f + 0.15f * (float)i, 2 + 0.175f * (float)i - length), sn_vec3(2.6f, 0.075f, 2 - 0.175f * (float)i), 0);
    sn_add_box(b, sn_vec3(0, 1.6f, 2.2f - length), sn_vec3(0.6f, 0.4f, 0.6f), 0.4f);
    rest = fmax(0, (double)size - (double)b->triangles.count) / (sn_add_arcades(b, 0) + 2 * 24 * 32);
    sn_add_arcades(b, fmax(0.01, sqrt(rest)));
    sn_set_phong(b, "bronze", sn_vec3(0.4f, 0.25f, 0.1f), 0.4f, 30);
    sn_add_surface(b, sn_urn, urn, 32, 24, fmax(0.01, sqrt(rest)));
    for (i = 0; i < 4; i++) sn_add_light(b, sn_vec3(i % 2 ? 0.6f : -0.6f, 5.8f, -3 - 8 * (float)i), sn_vec3(0.24f, 0.22f, 0.19f));
    b->ambient = sn_vec3(0.14f, 0.14f, 0.16f);
    sn_set_background(b, sn_vec3(0, 0, 0));
    sn_set_camera(b, sn_vec3(-2.1f, 2.2f, -1), sn_vec3(0.6f, 2.3f, -14), sn_vec3(0, 1, 0), 62);
}

/* A quad with texture coordinates from (0, 0) in its first corner to size in its third. */
static void sn_add_textured(sn_builder *b, const rt_vec3 corner[4], float size)
{
    const uint32_t first = (uint32_t)b->vertices.count, texcoord = (uint32_t)b->texcoords.count + 1;
    sn_corner c[4];
    uint32_t i;

    for (i = 0; i < 4; i++) {
        sn_add_vertex(b, corner[i]);
        sn_add_texcoord(b, i == 1 || i == 2 ? size : 0, i >= 2 ? size : 0);
        c[i].v = first + i;
        c[i].n = RT_NONE;
        c[i].t = texcoord + i;
    }
    sn_add_triangle(b, c[0], c[1], c[2]);
    sn_add_triangle(b, c[0], c[2], c[3]);
    b->shapes++;
}

static void sn_wear(sn_builder *b, rt_texture texture, bool bump, float height)
{
    const uint32_t number = sn_add_texture(b, texture);
    sn_material *m = &((sn_material *)b->materials.data)[b->material];

    if (number == RT_NONE || b->no_memory) return;
    if (bump) {
        m->bump = number;
        m->told.bump_height = m->shiny.bump_height = height;
    } else m->texture = number;
}

/* Bricks, as an image of 96 x 96 pixels. */
static rt_texture sn_bricks(sn_builder *b)
{
    enum { SIDE = 96 };
    rt_texture texture;
    rt_vec3 *pixels = (rt_vec3 *)malloc(SIDE * SIDE * sizeof *pixels), *levels;
    int x, y;

    memset(&texture, 0, sizeof texture);
    texture.width = texture.height = SIDE;
    texture.levels = levels = (rt_vec3 *)malloc(rt_count_texture_levels(SIDE, SIDE) * sizeof *levels);
    if (!pixels || !levels) b->no_memory = true;
    for (y = 0; y < SIDE && !b->no_memory; y++)
        for (x = 0; x < SIDE; x++) {
            const int row = y / 24, across = (x + row % 2 * 24) % 48, brick = (x + row % 2 * 24) / 48 % 2 + 2 * row;
            const bool mortar = y % 24 < 3 || across < 3;
            const float shade = 0.8f + 0.05f * (float)(brick * 5 % 7);

            pixels[y * SIDE + x] = mortar ? sn_vec3(0.6f, 0.58f, 0.55f) : sn_vec3(0.5f * shade, 0.16f * shade, 0.1f * shade);
        }
    if (!b->no_memory) rt_make_texture_levels(pixels, SIDE, SIDE, levels);
    free(pixels);
    return texture;
}

static void sn_make_textures(sn_builder *b, uint64_t size)
{
    static const rt_vec3 ground[4] = { { -400, 0, 400 }, { 400, 0, 400 }, { 400, 0, -400 }, { -400, 0, -400 } };
    static const rt_vec3 wall[4] = { { -4, 0, -2 }, { -1.2f, 0, -3.2f }, { -1.2f, 2.4f, -3.2f }, { -4, 2.4f, -2 } };
    rt_texture checker, marble, waves;

    (void)size;
    memset(&checker, 0, sizeof checker);
    memset(&marble, 0, sizeof marble);
    memset(&waves, 0, sizeof waves);
    checker.kind = RT_TEXTURE_CHECKER;
    checker.colors[0] = sn_vec3(0.85f, 0.85f, 0.8f);
    checker.colors[1] = sn_vec3(0.12f, 0.15f, 0.2f);
    marble.kind = waves.kind = RT_TEXTURE_NOISE;
    marble.solid = waves.solid = true;
    marble.size = 0.6f;
    marble.colors[0] = sn_vec3(0.05f, 0.2f, 0.12f);
    marble.colors[1] = sn_vec3(0.9f, 0.95f, 0.85f);
    waves.size = 0.25f;
    sn_set_background(b, sn_vec3(0.45f, 0.6f, 0.85f));
    b->ambient = sn_vec3(0.22f, 0.22f, 0.25f);
    sn_set_camera(b, sn_vec3(0, 1.5f, 4.5f), sn_vec3(0, 0.9f, 0), sn_vec3(0, 1, 0), 45);
    sn_add_light(b, sn_vec3(-6, 10, 8), sn_vec3(0.8f, 0.78f, 0.74f));
    sn_set_phong(b, "ground", sn_vec3(1, 1, 1), 0, 1);
    sn_wear(b, checker, false, 0);
    sn_add_textured(b, ground, 800);
    sn_set_phong(b, "bricks", sn_vec3(1, 1, 1), 0, 1);
    sn_wear(b, sn_bricks(b), false, 0);
    sn_add_textured(b, wall, 2);
    sn_set_phong(b, "marble", sn_vec3(1, 1, 1), 0.4f, 60);
    sn_wear(b, marble, false, 0);
    sn_add_sphere(b, sn_vec3(-0.2f, 0.8f, -0.6f), 0.8f);
    sn_set_phong(b, "bumps", sn_vec3(0.8f, 0.55f, 0.2f), 0.5f, 40);
    sn_wear(b, waves, true, 0.08f);
    sn_add_sphere(b, sn_vec3(1.6f, 0.7f, 0.3f), 0.7f);
    checker.size = 0.0625f;
    sn_set_phong(b, "globe", sn_vec3(0.9f, 0.9f, 0.9f), 0.3f, 60);
    sn_wear(b, checker, false, 0);
    sn_add_sphere(b, sn_vec3(2.2f, 1, -2.8f), 1);
    b->shapes += 3;
}


/* THE table of procedural scenes: name, least and greatest N (0: takes none), N when left out, function, what --help says. The
   greatest N keep a scene below 2^32 vertices and some 15 GB. */
#define SCENE_PROCEDURAL_LIST(X)                                                                                                       \
    X("cornell", 0, 0, 0,               sn_make_cornell,  "cornell      the Cornell box: 32 triangles")                                \
    X("balls",   1, 8, 3,               sn_make_balls,    "balls:N      SPD sphereflake: (9^(N+1) - 1) / 8 spheres on a plane")        \
    X("rings",   1, 40, 3,              sn_make_rings,    "rings:N      SPD rings: a pyramid of rings, 10 N (N+1) (2N+1) shapes")      \
    X("tetra",   1, 13, 6,              sn_make_tetra,    "tetra:N      SPD Sierpinski tetrahedron: 4^N triangles")                    \
    X("cloud",   1, 100000000, 10000,   sn_make_cloud,    "cloud:N      N random triangles in a cube")                                 \
    X("terrain", 2, 100000000, 200000,  sn_make_terrain,  "terrain:N    mountains around a lake: about N triangles")                   \
    X("sphere",  8, 100000000, 10000,   sn_make_sphere,   "sphere:N     a closed sphere mesh: about N triangles")                     \
    X("mirrors", 1, 100, 4,             sn_make_mirrors,  "mirrors:N    N rows of balls between two mirrors")                         \
    X("glass",   1, 100, 3,             sn_make_glass,    "glass:N      N x N balls and a block of glass on a chequered floor")       \
    X("hall",    5000, 100000000, 250000, sn_make_hall,   "hall:N       a closed hall with columns, arches and a vault: about N triangles") \
    X("textures", 0, 0, 0,              sn_make_textures, "textures     images, checkers, noise and bumps, from here to the horizon")

#define SN_PROCEDURAL_ROW(name, least, most, fallback, make, help) { name, least, most, fallback, make },
#define SN_PROCEDURAL_HELP(name, least, most, fallback, make, help) "  " help "\n"

static const struct { const char *name; uint64_t least, most, fallback; void (*make)(sn_builder *b, uint64_t size); } sn_procedurals[] = {
    SCENE_PROCEDURAL_LIST(SN_PROCEDURAL_ROW)
};

/* Makes the scene that b->file names. */
static void sn_make(sn_builder *b)
{
    const char *name = b->file, *colon = strchr(name, ':'), *p;
    const size_t length = colon ? (size_t)(colon - name) : strlen(name), rows = sizeof sn_procedurals / sizeof *sn_procedurals;
    size_t i = 0;
    uint64_t size = 0;

    while (i < rows && (strlen(sn_procedurals[i].name) != length || strncmp(sn_procedurals[i].name, name, length) != 0)) i++;
    if (i == rows) {
        sn_fail(b, "neither an .obj or .nff file nor one of cornell, balls:N, rings:N, tetra:N, cloud:N, terrain:N, sphere:N, mirrors:N, "
                "glass:N, hall:N, textures");
        return;
    }
    if (!colon) {
        size = sn_procedurals[i].fallback;
    } else {
        for (p = colon + 1; sn_is_digit(*p); p++)
            if (size < UINT64_C(100000000000000000)) size = size * 10 + (uint64_t)(*p - '0');
        if (*p || p == colon + 1 || sn_procedurals[i].most == 0 || size < sn_procedurals[i].least || size > sn_procedurals[i].most) {
            if (sn_procedurals[i].most == 0) sn_fail(b, "%s takes no number", sn_procedurals[i].name);
            else sn_fail(b, "%s:N needs a whole N from %llu to %llu", sn_procedurals[i].name, (unsigned long long)sn_procedurals[i].least,
                         (unsigned long long)sn_procedurals[i].most);
            return;
        }
    }
    sn_procedurals[i].make(b, size);
    sn_share_lights(b);
}

/* ---- >>camera ------------------------------------------------------------------------------------------------------- */

static void sn_extend(double lower[3], double upper[3], const rt_vec3 *p, float radius)
{
    const float at[3] = { p->x, p->y, p->z };
    int i;

    for (i = 0; i < 3; i++) {
        lower[i] = fmin(lower[i], (double)at[i] - (double)radius);
        upper[i] = fmax(upper[i], (double)at[i] + (double)radius);
    }
}

/* A camera that sees the whole scene from the front, above and to the right; of an empty scene, the unit cube. */
SCENE_API rt_camera scene_default_camera(const scene *s)
{
    const rt_geometry *g = &s->geometry;
    double lower[3] = { DBL_MAX, DBL_MAX, DBL_MAX }, upper[3] = { -DBL_MAX, -DBL_MAX, -DBL_MAX }, distance = 0;
    const double direction[3] = { 0.55, 0.4, 0.9 }, length = sqrt(0.55 * 0.55 + 0.4 * 0.4 + 0.9 * 0.9);
    double look[3], eye[3];
    rt_camera camera;
    size_t i;

    for (i = 0; i < 3 * g->triangle_count; i++)
        sn_extend(lower, upper, (const rt_vec3 *)(const void *)(g->vertices + 3 * (size_t)g->indices[i]), 0);
    for (i = 0; i < g->sphere_count; i++) sn_extend(lower, upper, &g->spheres[i].center, g->spheres[i].radius);
    if (!(lower[0] <= upper[0]))
        for (i = 0; i < 3; i++) upper[i] = 0.5, lower[i] = -0.5;
    for (i = 0; i < 3; i++) {
        look[i] = (lower[i] + upper[i]) / 2;
        distance += (upper[i] - lower[i]) * (upper[i] - lower[i]);
    }
    distance = distance > 0 ? 1.5 * sqrt(distance) : 1;
    for (i = 0; i < 3; i++) {
        eye[i] = look[i] + distance * direction[i] / length;
        if (fabs(eye[i] - look[i]) < fabs(look[i]) * 1e-6) eye[i] = look[i] + fabs(look[i]) * 1e-6;     /* still another float */
    }
    camera.eye = sn_vec3((float)eye[0], (float)eye[1], (float)eye[2]);
    camera.look = sn_vec3((float)look[0], (float)look[1], (float)look[2]);
    camera.up = sn_vec3(0, 1, 0);
    camera.fov = 40;
    return camera;
}

/* Two lights for a scene without any: a strong one up and to the left of the camera, and a weak one at the camera, so that
   nothing that it sees is black. Call it again when the camera has moved. */
SCENE_API void scene_default_lights(const rt_camera *camera, rt_light lights[2])
{
    const rt_vec3 view = sn_vec3(camera->look.x - camera->eye.x, camera->look.y - camera->eye.y, camera->look.z - camera->eye.z);
    const double distance = sqrt((double)view.x * (double)view.x + (double)view.y * (double)view.y + (double)view.z * (double)view.z);
    const double up = sqrt((double)camera->up.x * (double)camera->up.x + (double)camera->up.y * (double)camera->up.y +
                           (double)camera->up.z * (double)camera->up.z);
    double right[3] = { 0, 0, 0 }, length = 1;

    if (sn_cross(&view, &camera->up, right)) length = sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2]);
    memset(lights, 0, 2 * sizeof *lights);
    lights[0].position = sn_vec3((float)((double)camera->eye.x + distance * (0.25 * (double)camera->up.x / up - 0.3 * right[0] / length)),
                                 (float)((double)camera->eye.y + distance * (0.25 * (double)camera->up.y / up - 0.3 * right[1] / length)),
                                 (float)((double)camera->eye.z + distance * (0.25 * (double)camera->up.z / up - 0.3 * right[2] / length)));
    lights[0].color = sn_vec3(0.6f, 0.58f, 0.55f);
    lights[1].position = camera->eye;
    lights[1].color = sn_vec3(0.42f, 0.43f, 0.45f);
}

/* ---- >>public ------------------------------------------------------------------------------------------------------- */

SCENE_API void scene_free(scene *s)
{
    size_t i;

    free(s->vertices);
    free(s->indices);
    free(s->spheres);
    free(s->normals);
    free(s->normal_indices);
    free(s->colors);
    free(s->texcoords);
    free(s->texcoord_indices);
    for (i = 0; i < s->texture_count; i++) free((void *)s->textures[i].levels);
    free(s->textures);
    free(s->materials);
    free(s->shiny_materials);
    free(s->material_names);
    free(s->material_ids);
    free(s->lights);
    memset(s, 0, sizeof *s);
}

/* Triangles that use a normal without a direction become flat. */
static void sn_flatten(sn_builder *b)
{
    const rt_vec3 *normals = (const rt_vec3 *)b->normals.data;
    uint32_t *n = (uint32_t *)b->triangle_normals.data;
    size_t i, k;

    for (i = 0; i < b->triangle_normals.count; i++, n += 3)
        for (k = 0; k < 3; k++)
            if (n[0] != RT_NONE && fabsf(normals[n[k]].x) + fabsf(normals[n[k]].y) + fabsf(normals[n[k]].z) <= 0) n[0] = RT_NONE;
}

/* Gives what has no material a grey one, the last. */
static void sn_fill_materials(sn_builder *b)
{
    uint32_t *ids = (uint32_t *)b->triangle_materials.data;
    const uint32_t grey = (uint32_t)b->materials.count;
    sn_material *material;
    size_t i;

    for (i = 0; i < b->triangle_materials.count; i++) {
        if (ids[i] != RT_NONE) continue;
        ids[i] = grey;
        if (b->materials.count > grey) continue;
        material = (sn_material *)sn_add(b, &b->materials, sizeof *material, 1);
        if (!material) return;
        material->told = material->shiny = sn_grey();
        material->texture = material->bump = RT_NONE;
    }
}

/* Triangles at the end without texture coordinates, and those that name some which never came, have none. */
static void sn_drop_texcoords(sn_builder *b)
{
    size_t missing = b->triangle_texcoords.count ? b->triangles.count - b->triangle_texcoords.count : 0, i, k;
    uint32_t *t = missing ? (uint32_t *)sn_add(b, &b->triangle_texcoords, 3 * sizeof *t, missing) : NULL;

    if (t) memset(t, 0xff, missing * 3 * sizeof *t);
    t = (uint32_t *)b->triangle_texcoords.data;
    for (i = 0; i < b->triangle_texcoords.count; i++, t += 3)
        for (k = 0; k < 3; k++)
            if (t[0] != RT_NONE && t[k] >= b->texcoords.count) t[0] = RT_NONE;
}

/* Hands all over to *out, or sets b->no_memory. */
static void sn_finish(sn_builder *b, scene *out)
{
    const size_t spheres = b->spheres.count, named = b->material_names.names.count, lights = b->lights.count;
    uint32_t *ids = spheres ? (uint32_t *)sn_add(b, &b->triangle_materials, sizeof *ids, spheres) : NULL;
    size_t i;

    if (ids) memcpy(ids, b->sphere_materials.data, spheres * sizeof *ids);
    sn_fill_materials(b);
    if (b->colors.count > 0 && b->colors.count < b->vertices.count) sn_color_vertex(b, sn_vec3(1, 1, 1));      /* those at the end */
    out->material_names = (char (*)[64])calloc(b->materials.count + 1, sizeof *out->material_names);
    out->materials = (rt_material *)malloc((b->materials.count + 1) * sizeof *out->materials);
    out->shiny_materials = (rt_material *)malloc((b->materials.count + 1) * sizeof *out->shiny_materials);
    out->lights = lights ? (rt_light *)sn_take(&b->lights, sizeof(rt_light)) : (rt_light *)malloc(2 * sizeof(rt_light));
    if (b->no_memory || !out->material_names || !out->materials || !out->shiny_materials || !out->lights) {
        b->no_memory = true;
        return;
    }
    for (i = 0; i < b->materials.count; i++) {
        const sn_material *from = &((const sn_material *)b->materials.data)[i];

        snprintf(out->material_names[i], sizeof *out->material_names, "%s", i < named ? sn_name_text(&b->material_names, i) : "(none)");
        out->materials[i] = from->told;
        out->shiny_materials[i] = from->shiny;
        if (from->texture != RT_NONE) out->materials[i].texture = out->shiny_materials[i].texture = (rt_texture *)b->textures.data + from->texture;
        if (from->bump != RT_NONE) out->materials[i].bump = out->shiny_materials[i].bump = (rt_texture *)b->textures.data + from->bump;
    }
    out->textures = (rt_texture *)b->textures.data;         /* not trimmed: the materials point there */
    out->texture_count = b->textures.count;
    memset(&b->textures, 0, sizeof b->textures);
    if (out->texture_count == 0 || b->texcoords.count == 0) b->triangle_texcoords.count = 0;
    sn_drop_texcoords(b);
    out->texcoord_indices = (uint32_t *)sn_take(&b->triangle_texcoords, 3 * sizeof(uint32_t));
    if (out->texcoord_indices) out->texcoords = (float *)sn_take(&b->texcoords, 2 * sizeof(float));
    if (b->normals.count == 0) b->triangle_normals.count = 0;
    if (b->zero_normals) sn_flatten(b);
    out->geometry.vertex_count = b->vertices.count;
    out->geometry.triangle_count = b->triangles.count;
    out->geometry.sphere_count = spheres;
    out->material_count = b->materials.count;
    out->material_ids = (uint32_t *)sn_take(&b->triangle_materials, sizeof(uint32_t));
    out->geometry.vertices = out->vertices = (float *)sn_take(&b->vertices, 3 * sizeof(float));
    out->geometry.indices = out->indices = (uint32_t *)sn_take(&b->triangles, 3 * sizeof(uint32_t));
    out->geometry.spheres = out->spheres = (rt_sphere *)sn_take(&b->spheres, sizeof(rt_sphere));
    out->colors = (rt_vec3 *)sn_take(&b->colors, sizeof(rt_vec3));
    out->normal_indices = (uint32_t *)sn_take(&b->triangle_normals, 3 * sizeof(uint32_t));
    if (out->normal_indices) out->normals = (rt_vec3 *)sn_take(&b->normals, sizeof(rt_vec3));
    out->shapes = b->shapes;
    out->bytes_read = b->bytes_read;
    out->warnings = b->warnings;
    memcpy(out->warning, b->warning, sizeof out->warning);
    out->background = b->background;
    out->ambient = b->ambient;
    out->has_background = b->has_background;
    out->has_camera = b->has_camera;
    out->camera = b->has_camera ? b->camera : scene_default_camera(out);
    out->has_lights = lights > 0;
    out->light_count = lights > 0 ? lights : 2;
    if (!out->has_lights) scene_default_lights(&out->camera, out->lights);
}

/* Does name end in extension, in capitals or not? */
static bool sn_has_extension(const char *name, const char *extension)
{
    size_t length = strlen(name), i;

    if (length < strlen(extension)) return false;
    for (i = 0, name += length - strlen(extension); extension[i]; i++)
        if (name[i] != extension[i] && (name[i] | 32) != extension[i]) return false;
    return true;
}

/* Loads a path that ends in .obj or .nff, or makes a procedural scene. report is called for every malformed line, and may be NULL, as
   may error. On failure *out is zeroed. */
SCENE_API bool scene_load(scene *out, const char *name, scene_report report, void *user, scene_error *error)
{
    const bool obj = sn_has_extension(name, ".obj"), nff = sn_has_extension(name, ".nff");
    sn_builder b;
    sn_text text;
    const char *why;

    memset(out, 0, sizeof *out);
    if (error) memset(error, 0, sizeof *error);
    memset(&b, 0, sizeof b);
    b.file = name;
    b.material = RT_NONE;
    b.ear_budget = 100000000;               /* some tenths of a second */
    b.report = report;
    b.user = user;
    b.error = error;
    b.background = sn_vec3(0.28f, 0.36f, 0.48f);
    b.ambient = sn_vec3(0.12f, 0.12f, 0.13f);
    if (!obj && !nff) {
        sn_make(&b);
    } else if (!sn_read(&b, name, &text, &why)) {
        if (!b.no_memory) sn_fail(&b, "cannot read it: %s", why);
    } else {
        b.bytes_read = text.bytes;
        if (obj) sn_obj_file(&b, &text);
        else sn_nff_file(&b, &text);
        free(text.data);
    }
    b.line = 0;
    if (b.vertices.count >= RT_NONE || b.normals.count >= RT_NONE) sn_fail(&b, "more vertices or normals than 32-bit indices can number");
    if (b.errors == 0 && !b.no_memory) sn_finish(&b, out);
    if (b.no_memory) sn_fail(&b, "out of memory");
    sn_release(&b);
    if (error) error->errors = b.errors;
    if (b.errors > 0) scene_free(out);
    else snprintf(out->name, sizeof out->name, "%s", name);
    return b.errors == 0;
}

/* What rt_render_tile wants; s and accel must outlive it. */
SCENE_API rt_scene scene_view(const scene *s, const rt_accel *accel)
{
    rt_scene view;

    memset(&view, 0, sizeof view);
    view.accel = accel;
    view.geometry = &s->geometry;
    view.normals = s->normals;
    view.normal_indices = s->normal_indices;
    view.colors = s->colors;
    view.texcoords = s->texcoords;
    view.texcoord_indices = s->texcoord_indices;
    view.materials = s->materials;
    view.material_count = s->material_count;
    view.material_ids = s->material_ids;
    view.lights = s->lights;
    view.light_count = s->light_count;
    view.ambient = s->ambient;
    view.background = s->background;
    view.camera = s->camera;
    return view;
}

/* A line for each procedural scene, for --help. */
SCENE_API const char *scene_procedural_list(void)
{
    return SCENE_PROCEDURAL_LIST(SN_PROCEDURAL_HELP);
}

/* ---- >>ppm ---------------------------------------------------------------------------------------------------------- */

static unsigned char sn_to_srgb(float linear)
{
    const float x = linear > 0 ? (linear < 1 ? linear : 1) : 0;         /* NaN is black */

    return (unsigned char)(255 * (x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f) + 0.5f);
}

static float sn_from_srgb(float x)
{
    return x <= 0.04045f ? x / 12.92f : powf((x + 0.055f) / 1.055f, 2.4f);
}

/* False, with the message in error. */
__attribute__((format(printf, 3, 4)))
static bool sn_fail_ppm(char *error, size_t size, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(error, size, format, arguments);
    va_end(arguments);
    return false;
}

/* As POSIX has rename: over a file that is there too. */
SCENE_API int scene_rename(const char *from, const char *to)
{
#ifdef _WIN32
    remove(to);
#endif
    return rename(from, to);
}

/* Writes linear colours as an sRGB PPM (P6): to a file beside it that is renamed when it is whole, and removed on failure. */
SCENE_API bool scene_write_ppm(const char *path, const rt_vec3 *pixels, int width, int height, char *error, size_t error_size)
{
    const size_t size = strlen(path) + 32;
    char *temporary;
    unsigned char *row;
    FILE *file;
    bool written;
    int x, y;

    if (width <= 0 || height <= 0) return sn_fail_ppm(error, error_size, "%s: a picture of %d x %d", path, width, height);
    temporary = (char *)malloc(size);
    row = (unsigned char *)malloc((size_t)width * 3);
    if (!temporary || !row) {
        free(temporary);
        free(row);
        return sn_fail_ppm(error, error_size, "%s: out of memory", path);
    }
    snprintf(temporary, size, "%s.tmp.%ld", path, (long)getpid());
    file = fopen(temporary, "wb");
    written = file && fprintf(file, "P6\n%d %d\n255\n", width, height) > 0;
    for (y = 0; written && y < height; y++) {
        for (x = 0; x < width; x++) {
            const rt_vec3 *p = &pixels[(size_t)y * (size_t)width + (size_t)x];

            row[3 * x] = sn_to_srgb(p->x);
            row[3 * x + 1] = sn_to_srgb(p->y);
            row[3 * x + 2] = sn_to_srgb(p->z);
        }
        written = fwrite(row, 3, (size_t)width, file) == (size_t)width;
    }
    if (file && fclose(file) != 0) written = false;
    if (!written || scene_rename(temporary, path) != 0) {
        written = sn_fail_ppm(error, error_size, "%s: cannot write it: %s", path, strerror(errno));
        if (file) remove(temporary);
    }
    free(temporary);
    free(row);
    return written;
}

/* The next number of a PPM, behind blanks and comments; -1 if there is none. */
static int sn_ppm_number(FILE *file)
{
    int c = getc(file), number = -1;

    while (c == ' ' || (c >= '\t' && c <= '\r') || c == '#') {
        if (c == '#')
            while (c != '\n' && c != EOF) c = getc(file);
        else c = getc(file);
    }
    for (; c >= '0' && c <= '9' && number < 100000; c = getc(file)) number = (number < 0 ? 0 : number * 10) + (c - '0');
    return c == ' ' || (c >= '\t' && c <= '\r') || c == EOF ? number : -1;
}

/* The next channel of a pixel, of a text or of 1 or 2 bytes; -1 if there is none. */
static int sn_ppm_channel(FILE *file, bool text, int most)
{
    int high = 0, low;

    if (text) return sn_ppm_number(file);
    if (most > 255) high = getc(file);
    low = getc(file);
    return high == EOF || low == EOF ? -1 : high * 256 + low;
}

/* Reads a PPM, P3 or P6 of 8 or 16 bits; the caller frees *pixels, which are NULL on failure. */
static bool sn_read_ppm(const char *path, bool srgb, rt_vec3 **pixels, int *width, int *height, char *error, size_t error_size)
{
    FILE *file = fopen(path, "rb");
    struct stat about;
    const char *wrong = NULL;
    float *table = NULL;
    int letter, kind = EOF, most = 0, i;
    size_t count = 0, least = 0, k;

    *pixels = NULL;
    if (!file) return sn_fail_ppm(error, error_size, "%s: cannot read it: %s", path, strerror(errno));
    letter = getc(file);
    if (letter == 'P') kind = getc(file);
    if ((kind != '3' && kind != '6') || (*width = sn_ppm_number(file)) <= 0 || (*height = sn_ppm_number(file)) <= 0 ||
        (most = sn_ppm_number(file)) <= 0 || most > 65535)
        wrong = "not a P3 or P6 picture";
    else {
        count = (size_t)*width * (size_t)*height;
        least = kind == '3' || most > 255 ? 6 : 3;          /* bytes a pixel; of a text's last one, 5 */
        if (stat(path, &about) != 0 || about.st_size < 0 || ((uintmax_t)about.st_size + 1) / least < count) wrong = "ends too early";
    }
    if (!wrong) {
        *pixels = (rt_vec3 *)malloc(count * sizeof **pixels);
        table = (float *)malloc(((size_t)most + 1) * sizeof *table);
        if (!*pixels || !table) wrong = "out of memory";
    }
    for (i = 0; !wrong && i <= most; i++) table[i] = srgb ? sn_from_srgb((float)i / (float)most) : (float)i / (float)most;
    for (k = 0; !wrong && k < count; k++) {
        int rgb[3];

        for (i = 0; i < 3 && !wrong; i++) {
            rgb[i] = sn_ppm_channel(file, kind == '3', most);
            if (rgb[i] > most) wrong = "a number above its greatest";
            else if (rgb[i] < 0) wrong = feof(file) ? "ends too early" : "something that is no number";
        }
        if (!wrong) (*pixels)[k] = sn_vec3(table[rgb[0]], table[rgb[1]], table[rgb[2]]);
    }
    fclose(file);
    free(table);
    if (!wrong) return true;
    free(*pixels);
    *pixels = NULL;
    return sn_fail_ppm(error, error_size, "%s: %s", path, wrong);
}

/* Reads an sRGB PPM as linear colours; the caller frees *pixels. On failure *pixels is NULL. */
SCENE_API bool scene_read_ppm(const char *path, rt_vec3 **pixels, int *width, int *height, char *error, size_t error_size)
{
    return sn_read_ppm(path, true, pixels, width, height, error, error_size);
}

#endif /* SCENE_H */
