/* render.c - renders a scene to a PPM picture: the main program of rt.h.    render --help tells all.
   cc -O2 render.c -o render -lm -lpthread -ldl

   >>options  >>output  >>progress  >>frame  >>refine  >>summary  >>main                        SPDX-License-Identifier: MIT OR Unlicense */

#define _POSIX_C_SOURCE 200809L
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"
static const char program[] = "render";
#include "pool.h"
#include "scene.h"
#include "options.h"
#include "output.h"
#include "refine.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define MAX_SIDE    65536                   /* the greatest width and height of a picture, and how many pixels it may have: */
#define MAX_PIXELS  100000000               /* 1.2 GB while it is rendered */
#define MAX_SPP     65536
#define MAX_THREADS 1024
#define TILE        64                      /* pixels a side, a multiple of the library's blocks: some hundred tiles a picture */

static const char *reason(rt_status status, const rt_error *error) { return error->message[0] ? error->message : rt_status_string(status); }

/* ---- >>options ------------------------------------------------------------------------------------------------------ */

struct options {
    const char *scene_name, *output;
    int width, height, spp, depth, threads; /* spp 0: see --help; threads 0: all processors */
    rt_structure structure;                 /* RT_STRUCTURE_COUNT until it is known */
    const rt_algorithm_info *algorithm;
    int packet;                             /* 0: the algorithm's default */
    int short_stack;                        /* entries of kd.shortstack; 0: its default */
    rt_cull cull;
    bool raster;                            /* rasterise eye rays */
    bool shiny;                             /* materials of .mtl files as if their illum asked for all secondary rays */
    xyz eye, look, up, light;
    float fov;                              /* 0: the scene's */
    rt_lens lens;
    rt_sampler_kind sampler;
    rt_filter filter;
    uint32_t frame, seed;
    float light_radius, light_width, light_depth;           /* 0: points */
    bool by_area;
    float roughness;                        /* of all that mirrors or refracts; negative: as the scene has it */
    rt_bounds bounds;                       /* of threaded trees */
    int branching;
    bool gpu;                               /* render on an OpenCL device, */
    const char *device;                     /* of that name; NULL: see rt_gpu_options */
    const char *report;                     /* where a table of the errors goes; NULL: none */
    float error, seconds;                   /* where to stop; 0: at spp */
    bool adaptive;
    bool quiet, help;
};

/* Is the picture drawn in rounds? */
static bool refines(const options *o) { return o->report || o->error > 0 || o->seconds > 0 || o->adaptive; }

static const char *const cull_names[] = { RT_CULL_LIST(NAME_OF) };
static const char *const sampler_names[] = { RT_SAMPLER_LIST(NAME_OF) };
static const char *const filter_names[] = { RT_FILTER_LIST(NAME_OF) };
static const char *const bounds_names[] = { RT_BOUNDS_LIST(NAME_OF) };

static bool set_output(options *o, const char *text)  { o->output = text; return text[0] != '\0'; }
static bool set_spp(options *o, const char *text)     { return read_int(text, '\0', 1, MAX_SPP, &o->spp, NULL); }
static bool set_depth(options *o, const char *text)   { return read_int(text, '\0', 0, RT_MAX_DEPTH, &o->depth, NULL); }
static bool set_packet(options *o, const char *text)  { return read_int(text, '\0', 0, INT_MAX, &o->packet, NULL); }
static bool set_stack(options *o, const char *text)   { return read_int(text, '\0', 1, RT_MAX_SHORT_STACK, &o->short_stack, NULL); }
static bool set_threads(options *o, const char *text) { return read_int(text, '\0', 1, MAX_THREADS, &o->threads, NULL); }
static bool set_eye(options *o, const char *text)     { return read_xyz(text, &o->eye); }
static bool set_look(options *o, const char *text)    { return read_xyz(text, &o->look); }
static bool set_up(options *o, const char *text)      { return read_xyz(text, &o->up); }
static bool set_light(options *o, const char *text)   { return read_xyz(text, &o->light); }
static bool set_structure(options *o, const char *text) { return read_structure(text, &o->structure); }
static bool set_algorithm(options *o, const char *text) { return read_algorithm(text, &o->algorithm); }
static bool set_branching(options *o, const char *text) { return read_int(text, '\0', 2, RT_MAX_BRANCHING, &o->branching, NULL); }

static bool read_length(const char *text, char end, float *value, const char **rest) { return read_float(text, end, value, rest) && *value >= 0; }

static bool set_lens(options *o, const char *text)    { return read_length(text, '\0', &o->lens.radius, NULL); }
static bool set_focus(options *o, const char *text)   { return read_length(text, '\0', &o->lens.focus, NULL) && o->lens.focus > 0; }
static bool set_radius(options *o, const char *text)  { return read_length(text, '\0', &o->light_radius, NULL); }
static bool set_roughness(options *o, const char *text) { return read_length(text, '\0', &o->roughness, NULL) && o->roughness <= 1; }

static bool set_shutter(options *o, const char *text)
{
    return read_length(text, ',', &o->lens.open, &text) && read_length(text, '\0', &o->lens.close, NULL) && o->lens.open <= o->lens.close &&
           o->lens.close <= 1;
}

static bool set_light_size(options *o, const char *text)
{
    return read_length(text, ',', &o->light_width, &text) && read_length(text, '\0', &o->light_depth, NULL) && o->light_width > 0 &&
           o->light_depth > 0;
}

static bool set_light_points(options *o, const char *text)
{
    o->by_area = strcmp(text, "area") == 0;
    return o->by_area || strcmp(text, "angle") == 0;
}

static bool set_sampler(options *o, const char *text)
{
    o->sampler = (rt_sampler_kind)find_name(text, sampler_names, RT_SAMPLER_COUNT);
    return o->sampler != RT_SAMPLER_COUNT;
}

static bool set_filter(options *o, const char *text)
{
    o->filter = (rt_filter)find_name(text, filter_names, RT_FILTER_COUNT);
    return o->filter != RT_FILTER_COUNT;
}

static bool set_bounds(options *o, const char *text)
{
    o->bounds = (rt_bounds)find_name(text, bounds_names, RT_BOUNDS_COUNT);
    return o->bounds != RT_BOUNDS_COUNT;
}

/* A number of 32 bits. */
static bool read_uint(const char *text, uint32_t *value)
{
    char *stop;
    unsigned long long number;

    errno = 0;
    number = strtoull(text, &stop, 10);
    if (text[0] < '0' || text[0] > '9' || *stop || errno != 0 || number > UINT32_MAX) return false;
    *value = (uint32_t)number;
    return true;
}

static bool set_frame(options *o, const char *text)   { return read_uint(text, &o->frame); }
static bool set_seed(options *o, const char *text)    { return read_uint(text, &o->seed); }
static bool set_report(options *o, const char *text)  { o->report = text; return text[0] != '\0'; }
static bool set_error(options *o, const char *text)   { return read_float(text, '\0', &o->error, NULL) && o->error > 0; }
static bool set_seconds(options *o, const char *text) { return read_float(text, '\0', &o->seconds, NULL) && o->seconds > 0; }
static bool set_adaptive(options *o, const char *text) { (void)text; o->adaptive = true; return true; }
static bool set_gpu(options *o, const char *text)     { (void)text; o->gpu = true; return true; }
static bool set_device(options *o, const char *text)  { o->gpu = true; o->device = text; return text[0] != '\0'; }
static bool set_quiet(options *o, const char *text)   { (void)text; o->quiet = true; return true; }
static bool set_help(options *o, const char *text)    { (void)text; o->help = true; return true; }

static bool set_fov(options *o, const char *text)
{
    return read_float(text, '\0', &o->fov, NULL) && o->fov >= 0.1f && o->fov <= 179;
}

static bool set_size(options *o, const char *text)
{
    return read_int(text, 'x', 1, MAX_SIDE, &o->width, &text) && read_int(text, '\0', 1, MAX_SIDE, &o->height, NULL) &&
           (long long)o->width * o->height <= MAX_PIXELS;
}

static bool set_cull(options *o, const char *text)
{
    o->cull = (rt_cull)find_name(text, cull_names, RT_CULL_COUNT);
    return o->cull != RT_CULL_COUNT;
}

static bool set_primary(options *o, const char *text)
{
    o->raster = strcmp(text, "raster") == 0;
    return o->raster || strcmp(text, "trace") == 0;
}

static bool set_illum(options *o, const char *text)
{
    o->shiny = strcmp(text, "all") == 0;
    return o->shiny || strcmp(text, "file") == 0;
}

#define TEXT_(number) #number
#define TEXT(number) TEXT_(number)

/* Parsing, --help and the messages about bad values all come from this table. */
static const option option_table[] = {
    { "-o",          "FILE.ppm", set_output,    "the picture (default out.ppm)",                     "a file name" },
    { "--size",      "WxH",      set_size,      "pixels (default 800x600)",
      "WxH, each 1 to " TEXT(MAX_SIDE) ", at most " TEXT(MAX_PIXELS) " pixels together" },
    { "--spp",       "N",        set_spp,       "samples a pixel (default 4); with --error or --time: the most (default " TEXT(MAX_SPP) ")",
      "1 to " TEXT(MAX_SPP) },
    { "--error",     "TARGET",   set_error,     "refine until the estimated error, the root of the mean square, is that small", "a number above 0" },
    { "--time",      "SECONDS",  set_seconds,   "refine as far as these seconds of drawing allow",   "a number above 0" },
    { "--report",    "FILE.csv", set_report,    "refine, and write samples, seconds, rays and estimated errors", "a file name" },
    { "--adaptive",  NULL,       set_adaptive,  "refine by giving noisy pixels more samples",        NULL },
    { "--depth",     "N",        set_depth,     "levels of reflected and refracted rays (default 5; 0: none)", "0 to " TEXT(RT_MAX_DEPTH) },
    { "--structure", "NAME",     set_structure, "what to build (default: what the algorithm takes)", "one of:" RT_STRUCTURE_LIST(LISTED) },
    { "--algorithm", "NAME",     set_algorithm, "how to trace (default auto)",                       "an algorithm's name: see --help" },
    { "--packet",    "N",        set_packet,    "packet width (default 0: the algorithm's own)",     "0 or a width, see --help" },
    { "--short-stack", "N",      set_stack,     "entries of kd.shortstack (default 3)",              "1 to " TEXT(RT_MAX_SHORT_STACK) },
    { "--cull",      "NAME",     set_cull,      "frustum culling of packets (default none)",         "one of:" RT_CULL_LIST(LISTED) },
    { "--primary",   "NAME",     set_primary,   "eye rays: trace or raster (default trace)",         "one of: trace raster" },
    { "--illum",     "NAME",     set_illum,     "secondary rays of .mtl files: as illum says, or all that Ks, d, Ni allow (default file)",
      "one of: file all" },
    { "--threads",   "N",        set_threads,   "worker threads (default: all processors)",          "1 to " TEXT(MAX_THREADS) },
    { "--eye",       "X,Y,Z",    set_eye,       "where the camera stands (default: the scene's)",    "three numbers: X,Y,Z" },
    { "--look",      "X,Y,Z",    set_look,      "the point that it looks at",                        "three numbers: X,Y,Z" },
    { "--up",        "X,Y,Z",    set_up,        "the direction that is up in the picture",           "three numbers: X,Y,Z" },
    { "--fov",       "DEGREES",  set_fov,       "the picture's vertical angle",                      "0.1 to 179 degrees" },
    { "--light",     "X,Y,Z",    set_light,     "one white light there instead of the scene's",      "three numbers: X,Y,Z" },
    { "--lens",      "RADIUS",   set_lens,      "radius of the lens, in the scene's units (default 0: a pinhole)", "a number from 0 up" },
    { "--focus",     "DEPTH",    set_focus,     "how deep is sharp (default: as deep as --look)",    "a number above 0" },
    { "--shutter",   "T,T",      set_shutter,   "when it opens and closes (default 0,0)",            "two times, 0 <= open <= close <= 1" },
    { "--sampler",   "NAME",     set_sampler,   "where samples lie (default auto)",                  "one of:" RT_SAMPLER_LIST(LISTED) },
    { "--filter",    "NAME",     set_filter,    "how a pixel weighs them (default box)",             "one of:" RT_FILTER_LIST(LISTED) },
    { "--frame",     "N",        set_frame,     "gives new noise (default 0)",                       "0 to 4294967295" },
    { "--seed",      "N",        set_seed,      "gives other noise for the same frames (default 0)", "0 to 4294967295" },
    { "--light-radius", "R",     set_radius,    "makes lights spheres (default 0: points)",          "a number from 0 up" },
    { "--light-size", "X,Z",     set_light_size, "makes lights level rectangles",                    "two numbers above 0" },
    { "--light-by",  "NAME",     set_light_points, "their points: evenly by the angle that is seen, or by area (default angle)",
      "one of: angle area" },
    { "--roughness", "R",        set_roughness, "of all that mirrors or refracts (default: the scene's)", "0 to 1" },
    { "--bounds",    "NAME",     set_bounds,    "of threaded trees (default boxes)",                 "one of:" RT_BOUNDS_LIST(LISTED) },
    { "--branching", "N",        set_branching, "most children of a node of threaded trees (default " TEXT(RTI_BRANCHING) ")",
      "2 to " TEXT(RT_MAX_BRANCHING) },
    { "--gpu",       NULL,       set_gpu,       "render on an OpenCL device: the same picture",      NULL },
    { "--device",    "NAME",     set_device,    "the same on that one (default: RT_GPU_DEVICE, else the first GPU, else any)",
      "gpu, cpu, a number or part of a name: build/bench --devices lists them" },
    { "--quiet",     NULL,       set_quiet,     "print nothing but errors",                          NULL },
    { "--help",      NULL,       set_help,      "print this text",                                   NULL },
};
#define OPTION_COUNT (sizeof option_table / sizeof option_table[0])

static bool parse_options(options *o, int argc, char **argv)
{
    if (!read_options(o, option_table, OPTION_COUNT, argc, argv, &o->scene_name)) return false;
    if (o->help) return true;
    if (!o->scene_name) return fail("no scene given; see --help");
    if (!o->spp) o->spp = o->error > 0 || o->seconds > 0 ? MAX_SPP : 4;
    if (refines(o) && o->spp < 2) return fail("--spp %d: --report, --error, --time and --adaptive compare samples: choose 2 or more", o->spp);
    if (o->adaptive && o->spp < 4) return fail("--spp %d: --adaptive tells noise by two samples and draws others: choose 4 or more", o->spp);
    if (refines(o) && o->raster) return fail("--primary raster has its samples at regular places: --report, --error, --time and --adaptive "
                                             "need them by chance: choose --primary trace");
    return true;
}

static void print_help(void)
{
    const rt_algorithm_info *info;
    size_t i;

    printf("usage: render SCENE [options]\n\n"
           "Renders SCENE to a PPM picture. SCENE is a file (.obj with .mtl, whose map_Kd and bump are read from .ppm files; .nff) or a "
           "procedural scene:\n\n%s\n"
           "options (--name value or --name=value):\n",
           scene_procedural_list());
    print_options(option_table, OPTION_COUNT);
    printf("\nalgorithms, and the structure and the packet widths that each takes:\n");
    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++) {
        int widths[16], count = (int)rt_packet_widths(info->algorithm, widths, 16), k;
        printf("  %-18s %-9s %s", info->name, info->structure < RT_STRUCTURE_COUNT ? structure_names[info->structure] : "any", info->what);
        for (k = 0; k < count && k < 16; k++) printf("%s%d", k ? ", " : ": ", widths[k]);
        count = (int)rt_gpu_widths(info->algorithm, widths, 16);
        if (count) printf("; with --gpu");
        for (k = 0; k < count && k < 16; k++) printf("%s%d", k ? ", " : " ", widths[k]);
        puts(info->built ? "" : count ? " only" : " - not built yet");
    }
    printf("\nculling:" RT_CULL_LIST(LISTED) "\nsamplers:" RT_SAMPLER_LIST(LISTED) "\nfilters:" RT_FILTER_LIST(LISTED) "\n");
}

/* Does a kernel have that? */
static bool check_kernel(const options *o)
{
    int widths[16];
    const size_t count = rt_gpu_widths(o->algorithm->algorithm, widths, 16);
    size_t i;

    if (o->algorithm->structure != RT_STRUCTURE_COUNT && o->algorithm->structure != o->structure)
        return fail("%s needs structure %s, not %s", o->algorithm->name, structure_names[o->algorithm->structure], structure_names[o->structure]);
    if (o->algorithm->algorithm == RT_AUTO && o->packet) return fail("--packet needs an --algorithm with --gpu");
    if (o->algorithm->algorithm == RT_AUTO) return true;
    if (!count) return fail("--gpu: no kernel has algorithm %s", o->algorithm->name);
    for (i = 0; i < count && o->packet; i++)
        if (widths[i] == o->packet) break;
    return i < count || !o->packet || fail("--gpu: no kernel of %s has packets of %d: see --help", o->algorithm->name, o->packet);
}

/* Completes the structure, and asks the library with an empty scene whether it can do what is wanted: before time goes into loading. */
static bool check_tracing(options *o, rt_trace_options *trace)
{
    rt_structure wanted = o->algorithm->structure;
    rt_geometry nothing = {0};
    rt_build_options build = {0};
    rt_error error = {0};
    rt_accel *accel;
    rt_ray ray = {0};
    rt_hit hit;
    rt_status status;

    if (o->structure == RT_STRUCTURE_COUNT) o->structure = wanted == RT_STRUCTURE_COUNT ? RT_BVH : wanted;
    trace->algorithm = o->algorithm->algorithm;
    trace->packet_width = o->packet;
    trace->cull = o->cull;
    trace->short_stack = o->short_stack;
    build.structure = o->structure;
    build.error = trace->error = &error;
    if (o->gpu) return check_kernel(o);
    status = rt_build(&accel, &nothing, &build);
    if (status == RT_OK) status = rt_trace(accel, trace, &ray, 0, &hit);
    rt_free(accel);
    trace->error = NULL;
    return status == RT_OK || fail("%s", reason(status, &error));
}

/* ---- >>output ------------------------------------------------------------------------------------------------------- */

/* For one thread only, as hold_signals. */
static bool write_picture(const options *o, const rt_vec3 *pixels)
{
    char message[256] = "";
    bool written;

    hold_signals(SIG_BLOCK);
    written = scene_write_ppm(o->output, pixels, o->width, o->height, message, sizeof message);
    hold_signals(SIG_UNBLOCK);
    return written || fail("%s", message);
}

/* ---- >>progress ----------------------------------------------------------------------------------------------------- */

#define BAR_WIDTH 30

typedef struct {
    bool shown;                             /* a person looks at stderr */
    double next;                            /* seconds after the start when it is drawn again */
} progress;

/* Replaces the line that is on the screen; "" clears it. */
static void progress_line(const progress *bar, const char *format, ...)
{
    va_list arguments;

    if (!bar->shown) return;
    fputc('\r', stderr);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputs("\033[K", stderr);                /* erases what a longer line left on the right */
}

/* part: how much of the round at hand, which has lasted for now seconds of all that have passed, is done, in (0, 1]. */
static void progress_draw(progress *bar, double elapsed, double now, double part, uint64_t rays)
{
    int full = (int)(part * BAR_WIDTH);
    long left = (long)(now * (1 - part) / part);

    if (elapsed < bar->next) return;
    bar->next = elapsed + 0.1;
    progress_line(bar, "%3d%% [%.*s%*s] %.2f Mrays/s, %ld:%02ld left", (int)(part * 100), full, "##############################",
                  BAR_WIDTH - full, "", (double)rays / elapsed * 1e-6, left / 60, left % 60);
}

/* ---- >>frame -------------------------------------------------------------------------------------------------------- */

typedef struct {
    const rt_scene *scene;
    rt_render_options how;
    rt_vec3 *pixels;
    size_t columns, tiles;
    double start, round;                    /* when drawing began, and the round at hand */
    pool *workers;
    pthread_mutex_t lock;                   /* of all that follows */
    size_t done;
    rt_ray_counts rays;
    rt_status status;                       /* the first failure of a tile */
    rt_error error;
    progress *bar;
    rt_gpu *gpu;                            /* NULL: on the CPU */
    rt_gpu_scene *there;
} frame;

static uint64_t all_rays(const rt_ray_counts *rays) { return rays->primary + rays->shadow + rays->reflect + rays->refract; }

static void render_one_tile(void *context, size_t index)
{
    frame *f = context;
    rt_render_options how = f->how;
    rt_ray_counts rays = {0};
    rt_error error = {0};
    rt_status status;
    int x = (int)(index % f->columns) * TILE, y = (int)(index / f->columns) * TILE;
    int right = x + TILE < how.width ? x + TILE : how.width, bottom = y + TILE < how.height ? y + TILE : how.height;

    how.trace.error = &error;
    status = rt_render_tile(f->scene, &how, x, y, right, bottom, f->pixels, &rays);
    pthread_mutex_lock(&f->lock);
    if (f->status == RT_OK && status != RT_OK) {
        f->status = status;
        f->error = error;
    }
    f->rays.primary += rays.primary;
    f->rays.shadow += rays.shadow;
    f->rays.reflect += rays.reflect;
    f->rays.refract += rays.refract;
    f->done++;
    progress_draw(f->bar, seconds_now() - f->start, seconds_now() - f->round, (double)f->done / (double)f->tiles, all_rays(&f->rays));
    pthread_mutex_unlock(&f->lock);
}

/* On a device, in bands, so that one sees how far it is: of pixels enough to keep it busy. */
static rt_status render_bands(frame *f)
{
    const int width = f->how.width, height = f->how.height;
    rt_gpu_info info;
    int rows, y;

    rt_gpu_get_info(f->gpu, &info);
    rows = (info.gpu ? 1 << 20 : 1 << 16) / width;
    if (rows < 1) rows = 1;
    if (f->how.raster) rows = height;       /* it is copied with each band */
    for (y = 0; y < height && f->status == RT_OK; y += rows) {
        const double part = (double)(y + rows < height ? y + rows : height) / height;

        f->status = rt_gpu_render_tile(f->gpu, f->there, &f->how, 0, y, width, y + rows < height ? y + rows : height, f->pixels, &f->rays);
        progress_draw(f->bar, seconds_now() - f->start, seconds_now() - f->round, part, all_rays(&f->rays));
    }
    return f->status;
}

/* Opens the device, copies the scene and compiles what draws it. */
static bool prepare_device(const options *o, frame *f)
{
    rt_error error = {0};
    rt_gpu_options choice = {0};
    rt_status status;

    choice.device = o->device;
    choice.error = f->how.trace.error = &error;
    status = rt_gpu_open(&f->gpu, &choice);
    if (status == RT_OK) status = rt_gpu_upload_scene(f->gpu, &f->there, f->scene, &error);
    if (status == RT_OK) status = rt_gpu_render_tile(f->gpu, f->there, &f->how, 0, 0, 0, 0, f->pixels, NULL);
    f->how.trace.error = &f->error;
    return status == RT_OK || fail("--gpu: %s", reason(status, &error));
}

static rt_status render_tiles(frame *f)
{
    f->columns = (size_t)(f->how.width + TILE - 1) / TILE;
    f->tiles = f->columns * ((size_t)(f->how.height + TILE - 1) / TILE);
    f->done = 0;
    pthread_mutex_init(&f->lock, NULL);
    pool_for(f->workers, f->tiles, render_one_tile, f);
    pthread_mutex_destroy(&f->lock);
    return f->status;
}

/* A refine_draw. */
static rt_status draw_frame(void *context, const rt_render_options *how, rt_vec3 *pixels)
{
    frame *f = context;

    f->how = *how;
    f->pixels = pixels;
    f->round = seconds_now();
    return f->gpu ? render_bands(f) : render_tiles(f);
}

/* ---- >>refine ------------------------------------------------------------------------------------------------------- */

typedef struct { double samples, seconds, error, relative; uint64_t rays; } round_row;
typedef struct { round_row rows[64]; size_t count; const char *why; } refine_log;   /* why: what ended it */

static bool write_report(const options *o, const refine_log *log)
{
    output report;
    size_t i;

    if (!o->report) return true;
    if (!open_output(&report, o->report)) return false;
    fputs("spp,seconds,rays,rmse,relmse\n", report.file);
    for (i = 0; i < log->count; i++)
        fprintf(report.file, "%.6g,%.6f,%llu,%.6g,%.6g\n", log->rows[i].samples, log->rows[i].seconds, (unsigned long long)log->rows[i].rays,
                log->rows[i].error, log->rows[i].relative);
    return close_output(&report, true);
}

static void print_row(const options *o, const progress *bar, const round_row *row)
{
    progress_line(bar, "");
    if (!o->quiet) printf("%8.5g %9.3f %9.2f %12.6g %12.6g\n", row->samples, row->seconds, (double)row->rays * 1e-6, row->error, row->relative);
}

/* How many samples there shall be after the next round; 0: it is over, and log tells why. Rounds double them; where the goal is near they are as
   long as it seems to take. */
static int next_samples(const options *o, const refinement *r, refine_log *log)
{
    const round_row *last = log->count ? &log->rows[log->count - 1] : NULL;
    const double now = r->samples, step = o->adaptive ? 8 : now < 2 ? 1 : 2;
    double next = now * 2;

    log->why = "--spp";
    if (!last) return (int)fmin(step, o->spp);
    if (o->error > 0 && last->error <= (double)o->error) return log->why = "--error", 0;
    if (o->error > 0 && last->error > 0) next = fmin(next, now + ceil(1.05 * (refine_needs(r, (double)o->error) - now) / step) * step);
    if (next > o->spp) next = o->spp;
    if (now >= 2 && o->seconds > 0) {    /* one half alone tells nothing of its error: there are two at least */
        const double before = log->count > 1 ? last[-1].seconds : 0, had = log->count > 1 ? last[-1].samples : 0;
        const double room = ((double)o->seconds - last->seconds) * 0.97 * (last->samples - had) / (last->seconds - before);

        if (now + step > now + room) return log->why = "--time", 0;
        next = fmin(next, now + floor(room / step) * step);
    }
    if (next < now + step) next = now + step;
    return next > o->spp ? 0 : (int)next;
}

/* Draws in rounds until one of the goals is reached. */
static rt_status refine_picture(const options *o, frame *f, refinement *r, refine_log *log)
{
    rt_status status = RT_OK;
    int next;

    if (!o->quiet) puts("     spp   seconds     Mrays        error     relative");
    while (status == RT_OK && log->count < sizeof log->rows / sizeof log->rows[0] && (next = next_samples(o, r, log)) > 0) {
        round_row *row = &log->rows[log->count];

        status = refine_until(r, next);
        if (status != RT_OK) break;
        row->samples = r->samples;
        row->seconds = seconds_now() - f->start;
        row->rays = all_rays(&f->rays);
        row->error = r->error;
        row->relative = r->relative;
        log->count++;
        if (log->count == 2 && !o->adaptive) {          /* now one knows how far one half was from the truth */
            row[-1].error = row->error * sqrt(2);
            row[-1].relative = row->relative * 2;
            print_row(o, f->bar, row - 1);
        }
        if (log->count > 1 || o->adaptive) print_row(o, f->bar, row);
    }
    return status;
}

/* Puts the options' camera and light in the place of the scene's; default lights follow the camera. */
static bool aim(const options *o, const scene *loaded, rt_scene *view, rt_light lights[2])
{
    rt_camera *camera = &view->camera;
    double x, y, z;                         /* the view, in double so that products of tiny components do not vanish */

    if (o->eye.given)  camera->eye = o->eye.value;
    if (o->look.given) camera->look = o->look.value;
    if (o->up.given)   camera->up = o->up.value;
    if (o->fov > 0)    camera->fov = o->fov;
    x = (double)camera->look.x - (double)camera->eye.x;
    y = (double)camera->look.y - (double)camera->eye.y;
    z = (double)camera->look.z - (double)camera->eye.z;
    if (x == 0 && y == 0 && z == 0) return fail("the camera stands at the point that it looks at: choose --eye or --look");
    if (y * (double)camera->up.z == z * (double)camera->up.y && z * (double)camera->up.x == x * (double)camera->up.z &&
        x * (double)camera->up.y == y * (double)camera->up.x)
        return fail("the camera looks along its up direction: choose --up");
    if (o->light.given) {
        memset(&lights[0], 0, sizeof lights[0]);
        lights[0].position = o->light.value;
        lights[0].color.x = lights[0].color.y = lights[0].color.z = 1;
        view->lights = lights;
        view->light_count = 1;
    } else if (!loaded->has_lights) {
        scene_default_lights(camera, lights);
        view->lights = lights;
        view->light_count = 2;
    }
    return true;
}

/* Gives lights their size. */
static bool spread_lights(const options *o, rt_light *lights, size_t count)
{
    size_t i;

    if (o->light_radius > 0 && o->light_width > 0) return fail("--light-radius and --light-size: a light is a sphere or a rectangle");
    for (i = 0; i < count; i++) {
        lights[i].by_area = o->by_area;
        if (o->light_radius > 0) lights[i].radius = o->light_radius;
        if (o->light_width > 0) {
            lights[i].edges[0].x = o->light_width;
            lights[i].edges[1].z = o->light_depth;
        }
    }
    return true;
}

/* Gives mirrors and glass that roughness. */
static void roughen(rt_material *materials, size_t count, float roughness)
{
    size_t i;

    for (i = 0; i < count; i++) {
        const rt_vec3 a = materials[i].reflect, b = materials[i].transmit;

        if (a.x > 0 || a.y > 0 || a.z > 0 || b.x > 0 || b.y > 0 || b.z > 0) materials[i].roughness = roughness;
    }
}

/* ---- >>summary ------------------------------------------------------------------------------------------------------ */

typedef struct { char text[32]; } label;

/* 1234567 as "1,234,567". */
static const char *grouped(uint64_t value, label *out)
{
    char *at = out->text + sizeof out->text - 1;
    int digits = 0;

    *at = '\0';
    do {
        if (digits && digits % 3 == 0) *--at = ',';
        *--at = (char)('0' + value % 10);
        value /= 10;
        digits++;
    } while (value);
    return at;
}

static const char *byte_size(size_t bytes, label *out)
{
    static const char *const units[] = { "bytes", "KiB", "MiB", "GiB", "TiB" };
    double value = (double)bytes;
    int unit = 0;

    while (value >= 1024 && unit < 4) {
        value /= 1024;
        unit++;
    }
    snprintf(out->text, sizeof out->text, "%.*f %s", unit ? 1 : 0, value, units[unit]);
    return out->text;
}

static void print_summary(const options *o, const scene *loaded, const rt_info *tree, const frame *f, const refine_log *log, int threads,
                          double load_seconds, double build_seconds, double sort_seconds, double device_seconds, double render_seconds)
{
    size_t primitives = tree->triangles + tree->spheres;
    uint64_t rays = all_rays(&f->rays);
    label a, b, c, d, e;

    printf("scene     %s, loaded in %.3f s", o->scene_name, load_seconds);
    if (loaded->bytes_read) printf(" (%s)", byte_size(loaded->bytes_read, &a));
    printf("\nshapes    %s, as %s triangles and %s spheres\n", grouped(loaded->shapes, &a), grouped(tree->triangles, &b),
           grouped(tree->spheres, &c));
    printf("tree      %s, built in %.3f s: %s nodes, depth %d\n", structure_names[tree->structure], build_seconds,
           grouped(tree->nodes, &a), tree->depth);
    printf("memory    %s", byte_size(tree->bytes, &a));
    if (primitives) printf(", %.1f bytes a primitive", (double)tree->bytes / (double)primitives);
    if (f->how.raster) {
        rt_raster_info raster;
        rt_raster_get_info(f->how.raster, &raster);
        printf("\nprimary   rasterised: %s primitives seen, sorted in %.3f s, %s", grouped(raster.seen, &a), sort_seconds,
               byte_size(raster.bytes, &b));
    } else printf("\nprimary   traced");
    printf("\nrays      %s: %s primary, %s shadow, %s reflected, %s refracted\n", grouped(rays, &a), grouped(f->rays.primary, &b),
           grouped(f->rays.shadow, &c), grouped(f->rays.reflect, &d), grouped(f->rays.refract, &e));
    if (f->gpu) {
        rt_gpu_info info;
        rt_gpu_get_info(f->gpu, &info);
        printf("device    %s (%s), %s of the scene; ready in %.3f s\n", info.name, info.platform, byte_size(rt_gpu_scene_bytes(f->there), &a),
               device_seconds);
    }
    printf("speed     %.2f Mrays/s: %.3f s with %s on ", (double)rays / render_seconds * 1e-6, render_seconds, o->algorithm->name);
    if (f->gpu) puts("the device");
    else printf("%d thread%s\n", threads, threads == 1 ? "" : "s");
    if (log->count) {
        const round_row *last = &log->rows[log->count - 1];
        printf("error     %.3g estimated, %.3g relative: ended by %s\npicture   %s, %dx%d, %.4g samples a pixel, depth %d\n", last->error,
               last->relative, log->why, o->output, o->width, o->height, last->samples, o->depth);
    } else printf("picture   %s, %dx%d, %d sample%s a pixel, depth %d\n", o->output, o->width, o->height, o->spp, o->spp == 1 ? "" : "s",
                  o->depth);
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

/* All from the options to the written picture. */
static bool render(options *o)
{
    progress bar = {0};
    scene loaded = {0};
    pool *workers = NULL;
    rt_accel *accel = NULL;
    rt_raster *raster = NULL;
    rt_build_options build = {0};
    rt_raster_options sort = {0};
    rt_error error = {0};
    rt_scene view;
    rt_light lights[2];
    rt_info tree;
    frame f = {0};
    refinement rounds = {0};
    refine_log log = {0};
    rt_vec3 *pixels = NULL;
    rt_status status;
    int threads;
    double start, load_seconds, build_seconds, sort_seconds, device_seconds, render_seconds;
    bool ready, done = false;

    if (!check_tracing(o, &f.how.trace) || !check_output(o->output, o->scene_name)) return false;
    if (o->report && strcmp(o->report, o->output) == 0) return fail("%s: is the picture; choose another --report", o->report);
    if (o->report && !check_output(o->report, o->scene_name)) return false;
    bar.shown = !o->quiet && isatty(STDERR_FILENO);
    bar.next = 0.1;
    start = seconds_now();
    progress_line(&bar, "loading ...");
    ready = load_scene(&loaded, o->scene_name, o->quiet);
    progress_line(&bar, "");
    if (!ready) goto cleanup;
    load_seconds = seconds_now() - start;

    pixels = calloc((size_t)o->width * (size_t)o->height, sizeof *pixels);
    if (!pixels) { fail("out of memory for a picture of %dx%d", o->width, o->height); goto cleanup; }
    workers = pool_create(o->threads);
    if (!workers) { fail("cannot start the threads: choose a smaller --threads"); goto cleanup; }
    threads = pool_threads(workers);
    f.workers = workers;

    progress_line(&bar, "building ...");
    build.structure = o->structure;
    build.bounds = o->bounds;
    build.branching = o->branching;
    keep_what_it_reads(&build, o->algorithm->algorithm, o->gpu);
    build.parallel_for = pool_for;
    build.parallel_user = workers;
    build.error = &error;
    start = seconds_now();
    status = rt_build(&accel, &loaded.geometry, &build);
    build_seconds = seconds_now() - start;
    progress_line(&bar, "");
    if (status != RT_OK) { fail("%s: %s", o->scene_name, reason(status, &error)); goto cleanup; }
    rt_get_info(accel, &tree);

    view = scene_view(&loaded, accel);
    if (o->shiny) view.materials = loaded.shiny_materials;
    if (!aim(o, &loaded, &view, lights)) goto cleanup;
    if (!spread_lights(o, view.lights == lights ? lights : loaded.lights, view.light_count)) goto cleanup;
    if (o->roughness >= 0) roughen(o->shiny ? loaded.shiny_materials : loaded.materials, loaded.material_count, o->roughness);
    if (rt_check_scene(&view, &error) != RT_OK) { fail("%s: %s", o->scene_name, error.message); goto cleanup; }
    start = seconds_now();
    if (o->raster) {
        sort.parallel_for = pool_for;
        sort.parallel_user = workers;
        sort.error = &error;
        status = rt_raster_create(&raster, &loaded.geometry, &view.camera, o->width, o->height, &sort);
        if (status != RT_OK) { fail("%s: %s", o->scene_name, reason(status, &error)); goto cleanup; }
    }
    sort_seconds = seconds_now() - start;
    f.scene = &view;
    f.how.raster = raster;
    f.how.width = o->width;
    f.how.height = o->height;
    f.how.spp = o->spp;
    f.how.depth = o->depth ? o->depth : -1;
    f.how.lens = o->lens;
    f.how.sampler = o->sampler;
    f.how.filter = o->filter;
    f.how.frame = o->frame;
    f.how.seed = o->seed;
    f.bar = &bar;
    start = seconds_now();
    if (o->gpu) {
        progress_line(&bar, "compiling ...");
        f.pixels = pixels;
        if (!prepare_device(o, &f)) goto cleanup;
        progress_line(&bar, "");
    }
    device_seconds = seconds_now() - start;
    if (refines(o) && !refine_begin(&rounds, &f.how, o->adaptive, draw_frame, &f)) {
        fail("out of memory for a picture of %dx%d in rounds", o->width, o->height);
        goto cleanup;
    }
    f.start = seconds_now();
    status = refines(o) ? refine_picture(o, &f, &rounds, &log) : draw_frame(&f, &f.how, pixels);
    render_seconds = seconds_now() - f.start;
    progress_line(&bar, "");
    if (status != RT_OK) { fail("%s: %s", o->scene_name, reason(status, &f.error)); goto cleanup; }

    pool_destroy(workers);                  /* leaves one thread, as write_picture wants */
    workers = NULL;
    if (!write_picture(o, refines(o) ? rounds.picture : pixels) || !write_report(o, &log)) goto cleanup;
    if (o->error > 0 && log.rows[log.count - 1].error > (double)o->error)
        fprintf(stderr, "render: warning: the error is %.3g, not %g: %s ended it\n", log.rows[log.count - 1].error, (double)o->error, log.why);
    if (!o->quiet) print_summary(o, &loaded, &tree, &f, &log, threads, load_seconds, build_seconds, sort_seconds, device_seconds,
                                 render_seconds);
    done = true;
cleanup:
    rt_gpu_close(f.gpu);
    rt_raster_free(raster);
    rt_free(accel);
    pool_destroy(workers);
    refine_end(&rounds);
    free(pixels);
    scene_free(&loaded);
    return done;
}

int main(int argc, char **argv)
{
    options o = {0};

    o.output = "out.ppm";
    o.width = 800;
    o.height = 600;
    o.depth = 5;
    o.roughness = -1;
    o.structure = RT_STRUCTURE_COUNT;
    o.algorithm = rt_algorithm_get(0);
    if (!parse_options(&o, argc, argv)) return EXIT_FAILURE;
    if (o.help) print_help();
    else if (!render(&o)) return EXIT_FAILURE;
    if (fflush(stdout) != 0) { fail("standard output: %s", strerror(errno)); return EXIT_FAILURE; }
    return EXIT_SUCCESS;
}
