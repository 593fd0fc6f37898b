/* animate.c - a moving scene to numbered PPM pictures: transforms, lens, soft shadows, gloss, motion blur, bumps.    animate --help tells all.
   cc -O2 animate.c -o animate -lm -lpthread -ldl

   >>options  >>scene  >>motion  >>frames  >>main                                       SPDX-License-Identifier: MIT OR Unlicense */

#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>

static size_t allocations;                  /* by the library, so far: an update should need none */
static void *count_malloc(size_t size) { __atomic_fetch_add(&allocations, 1, __ATOMIC_RELAXED); return malloc(size); }
#define RT_MALLOC(size, user) ((void)(user), count_malloc(size))
#define RT_FREE(pointer, user) ((void)(user), free(pointer))
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"
static const char program[] = "animate";
#include "pool.h"
#include "scene.h"
#include "options.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define TILE 64                             /* pixels a side that a thread draws at once: a multiple of the library's blocks */
#define MAX_FRAMES 1000000
#define MAX_CROWD 1000000

/* ---- >>options ------------------------------------------------------------------------------------------------------ */

enum { LENS, SOFT, GLOSS, BLUR, BUMP, EFFECTS };
static const char *const effect_names[EFFECTS] = { "lens", "soft", "gloss", "blur", "bump" };

struct options {
    const char *prefix, *obj;
    int frames, first, width, height, spp, depth, threads, crowd, packet;
    float fps;
    bool effects[EFFECTS], quiet, help;
    bool gpu;                               /* draw on an OpenCL device, */
    const char *device;                     /* of that name; NULL: see rt_gpu_options */
    rt_structure structure;
    const rt_algorithm_info *algorithm;
    rt_sampler_kind sampler;
    uint32_t seed;
};

static const char *const sampler_names[] = { RT_SAMPLER_LIST(NAME_OF) };

static bool set_output(options *o, const char *text)  { o->prefix = text; return text[0] && strlen(text) < 3000; }
static bool set_obj(options *o, const char *text)     { o->obj = text; return text[0]; }
static bool set_frames(options *o, const char *text)  { return read_int(text, '\0', 1, MAX_FRAMES, &o->frames, NULL); }
static bool set_first(options *o, const char *text)   { return read_int(text, '\0', 0, INT_MAX, &o->first, NULL); }
static bool set_spp(options *o, const char *text)     { return read_int(text, '\0', 1, 65536, &o->spp, NULL); }
static bool set_depth(options *o, const char *text)   { return read_int(text, '\0', 0, RT_MAX_DEPTH, &o->depth, NULL); }
static bool set_threads(options *o, const char *text) { return read_int(text, '\0', 1, 1024, &o->threads, NULL); }
static bool set_crowd(options *o, const char *text)   { return read_int(text, '\0', 0, MAX_CROWD, &o->crowd, NULL); }
static bool set_packet(options *o, const char *text)  { return read_int(text, '\0', 0, INT_MAX, &o->packet, NULL); }
static bool set_structure(options *o, const char *text) { return read_structure(text, &o->structure); }
static bool set_algorithm(options *o, const char *text) { return read_algorithm(text, &o->algorithm); }
static bool set_gpu(options *o, const char *text)     { (void)text; return o->gpu = true; }
static bool set_device(options *o, const char *text)  { o->device = text; return o->gpu = text[0]; }
static bool set_quiet(options *o, const char *text)   { (void)text; return o->quiet = true; }
static bool set_help(options *o, const char *text)    { (void)text; return o->help = true; }

static bool set_size(options *o, const char *text)
{
    return read_int(text, 'x', 1, 16384, &o->width, &text) && read_int(text, '\0', 1, 16384, &o->height, NULL);
}

static bool set_fps(options *o, const char *text)
{
    char *stop;

    o->fps = strtof(text, &stop);
    return stop != text && *stop == '\0' && o->fps >= 1 && o->fps <= 1000;
}

static bool set_seed(options *o, const char *text)
{
    int seed = 0;
    const bool good = read_int(text, '\0', 0, INT_MAX, &seed, NULL);

    o->seed = (uint32_t)seed;
    return good;
}

static bool set_sampler(options *o, const char *text)
{
    o->sampler = (rt_sampler_kind)find_name(text, sampler_names, RT_SAMPLER_COUNT);
    return o->sampler != RT_SAMPLER_COUNT;
}

static bool set_only(options *o, const char *text)
{
    const int effect = find_name(text, effect_names, EFFECTS);

    memset(o->effects, 0, sizeof o->effects);
    if (effect < EFFECTS) o->effects[effect] = true;
    return effect < EFFECTS || strcmp(text, "none") == 0;
}

static bool set_without(options *o, const char *text)
{
    const int effect = find_name(text, effect_names, EFFECTS);

    if (effect < EFFECTS) o->effects[effect] = false;
    return effect < EFFECTS;
}

static const option option_table[] = {
    { "-o",          "PREFIX", set_output,    "of the pictures' names (default out/animate)",       "a path" },
    { "--frames",    "N",      set_frames,    "how many (default 24)",                              "1 to 1000000" },
    { "--first",     "K",      set_first,     "number of the first one (default 0)",                "0 to 2147483647" },
    { "--fps",       "X",      set_fps,       "frames a second (default 24)",                       "1 to 1000" },
    { "--size",      "WxH",    set_size,      "pixels (default 640x480)",                           "WxH, each 1 to 16384" },
    { "--spp",       "N",      set_spp,       "samples a pixel (default 16)",                       "1 to 65536" },
    { "--depth",     "N",      set_depth,     "levels of mirrored and refracted rays (default 5)",  "0 to 64" },
    { "--only",      "EFFECT", set_only,      "one of lens soft gloss blur bump, or none",          "lens, soft, gloss, blur, bump or none" },
    { "--without",   "EFFECT", set_without,   "all but that; may be repeated",                      "lens, soft, gloss, blur or bump" },
    { "--sampler",   "NAME",   set_sampler,   "where samples lie (default sobol)",                  "one of:" RT_SAMPLER_LIST(LISTED) },
    { "--seed",      "N",      set_seed,      "other noise (default 0)",                            "0 to 2147483647" },
    { "--instances", "N",      set_crowd,     "small imps besides, each moving by itself (default 0)", "0 to 1000000" },
    { "--obj",       "FILE",   set_obj,       "the character (default examples/imp.obj)",           "a path" },
    { "--structure", "NAME",   set_structure, "what to build (default: what the algorithm takes, or bvh)", "one of:" RT_STRUCTURE_LIST(LISTED) },
    { "--algorithm", "NAME",   set_algorithm, "how to trace (default auto)",                        "an algorithm's name: see render --help" },
    { "--packet",    "N",      set_packet,    "packet width (default 0: the algorithm's own)",      "0 or a width, see render --help" },
    { "--threads",   "N",      set_threads,   "worker threads (default: all processors)",           "1 to 1024" },
    { "--gpu",       NULL,     set_gpu,       "draw on an OpenCL device: the same pictures",        NULL },
    { "--device",    "NAME",   set_device,    "the same on that one (default: RT_GPU_DEVICE, else the first GPU, else any)",
      "gpu, cpu, a number or part of a name: build/bench --devices lists them" },
    { "--quiet",     NULL,     set_quiet,     "print nothing but errors",                           NULL },
    { "--help",      NULL,     set_help,      "print this text",                                    NULL },
};
enum { OPTIONS = sizeof option_table / sizeof option_table[0] };

static bool parse_options(options *o, int argc, char **argv)
{
    if (!read_options(o, option_table, OPTIONS, argc, argv, NULL)) return false;
    if (o->structure == RT_STRUCTURE_COUNT)
        o->structure = o->algorithm->structure == RT_STRUCTURE_COUNT ? RT_BVH : o->algorithm->structure;
    if (o->first > INT_MAX - o->frames) return fail("--first %d: its %d frames pass number %d", o->first, o->frames, INT_MAX);
    return true;
}

static void print_help(void)
{
    puts("usage: animate [options]\n\nRenders a moving scene of imps, balls and lamps to PREFIX0000.ppm, PREFIX0001.ppm ...\n\noptions:");
    print_options(option_table, OPTIONS);
}

/* ---- >>scene -------------------------------------------------------------------------------------------------------- */

enum { BALLS = 2, ACTORS = 2 };             /* loose balls; large imps: one that turns, one that rides */

typedef struct {
    scene imp;                              /* as loaded */
    rt_accel *imp_accel, *ride_accel, *world_accel;
    rt_scene imp_view, ride_view, view;
    rt_geometry ride, world;
    rt_instance rider, *actors;             /* in the ride; in the world: ACTORS and the crowd */
    rt_motion rider_motion, *motions;
    rt_sphere balls[BALLS];
    rt_plane ground;
    rt_texture fields, waves;
    rt_material materials[BALLS + 1];
    uint32_t ids[BALLS + 1];
    rt_light lights[2];
    const rt_scene *ride_part, **parts;
} show;

static rt_vec3 vec(float x, float y, float z)
{
    rt_vec3 v;

    v.x = x, v.y = y, v.z = z;
    return v;
}

static void show_free(show *s)
{
    rt_free(s->world_accel);
    rt_free(s->ride_accel);
    rt_free(s->imp_accel);
    scene_free(&s->imp);
    free(s->actors);
    free(s->motions);
    free((void *)s->parts);
}

/* The scene at rest, but for its accels. */
static bool show_make(show *s, const options *o)
{
    const size_t actors = ACTORS + (size_t)o->crowd;
    size_t i;

    if (!load_scene(&s->imp, o->obj, o->quiet)) return false;
    s->actors = (rt_instance *)calloc(actors, sizeof *s->actors);
    s->motions = (rt_motion *)calloc(actors, sizeof *s->motions);
    s->parts = (const rt_scene **)calloc(actors, sizeof *s->parts);
    if (!s->actors || !s->motions || !s->parts) return fail("out of memory for %zu instances", actors);

    s->balls[0].center = vec(-1.5f, 0.7f, 1.1f), s->balls[0].radius = 0.7f;
    s->balls[1].center = vec(1.0f, 0.55f, 2.1f), s->balls[1].radius = 0.55f;
    s->ground.point = vec(0, 0, 0), s->ground.normal = vec(0, 1, 0), s->ground.radius = 40;
    s->materials[0].diffuse = vec(0.1f, 0.1f, 0.12f), s->materials[0].reflect = vec(0.75f, 0.75f, 0.8f);
    s->materials[0].roughness = o->effects[GLOSS] ? 0.18f : 0;
    s->materials[1].transmit = vec(0.95f, 0.95f, 0.95f), s->materials[1].ior = 1.5f, s->materials[1].fresnel = true;
    s->materials[1].absorb = vec(0.6f, 0.15f, 0.05f);
    s->materials[2].diffuse = vec(1, 1, 1), s->materials[2].reflect = vec(0.12f, 0.12f, 0.12f);
    s->materials[2].roughness = o->effects[GLOSS] ? 0.12f : 0;
    s->fields.kind = RT_TEXTURE_CHECKER, s->fields.size = 1;
    s->fields.colors[0] = vec(0.75f, 0.72f, 0.62f), s->fields.colors[1] = vec(0.16f, 0.22f, 0.2f);
    s->waves.kind = RT_TEXTURE_NOISE, s->waves.solid = true, s->waves.size = 0.5f;
    s->materials[2].texture = &s->fields;
    if (o->effects[BUMP]) s->materials[2].bump = &s->waves, s->materials[2].bump_height = 0.15f;
    for (i = 0; i <= BALLS; i++) s->ids[i] = (uint32_t)i;
    s->lights[0].position = vec(-4, 7, 5), s->lights[0].color = vec(0.62f, 0.58f, 0.5f);
    s->lights[1].position = vec(5, 6, 2), s->lights[1].color = vec(0.26f, 0.3f, 0.38f);
    if (o->effects[SOFT]) {
        s->lights[0].radius = 0.9f;
        s->lights[1].edges[0] = vec(0, 0, 2.5f), s->lights[1].edges[1] = vec(1.2f, 1.2f, 0);
    }
    return true;
}

/* ---- >>motion ------------------------------------------------------------------------------------------------------- */

/* A turn about the y axis and a scale, then a shift. */
static void place(rt_instance *in, float angle, float scale, rt_vec3 at)
{
    const float c = scale * cosf(angle), s = scale * sinf(angle);
    const float m[12] = { c, 0, s, at.x, 0, scale, 0, at.y, -s, 0, c, at.z };

    memcpy(in->transform, m, sizeof m);
}

static float hop(float phase) { return 0.35f * fabsf(sinf(phase)); }

/* Where everything is at the start of a frame, and how it moves until its end. */
static void show_move(show *s, const options *o, int frame)
{
    const float step = 1 / o->fps, start = (float)((double)frame / (double)o->fps), turn = 6.2831853f * step;
    size_t i;

    place(&s->actors[0], 0.35f + 0.25f * 6.2831853f * start, 1, vec(-0.2f, 0, -0.6f));
    s->motions[0].pivot = vec(-0.2f, 0, -0.6f), s->motions[0].axis = vec(0, 1, 0), s->motions[0].angle = 0.25f * turn;

    /* the rider hops in a carriage that goes round the first one */
    place(&s->rider, 0, 0.85f, vec(2.1f, hop(9 * start), 0));
    s->rider_motion.move = vec(0, hop(9 * (start + step)) - hop(9 * start), 0);
    place(&s->actors[1], 0.5f + 0.2f * 6.2831853f * start, 1, vec(-0.2f, 0, -0.6f));
    s->motions[1].pivot = vec(-0.2f, 0, -0.6f), s->motions[1].axis = vec(0, 1, 0), s->motions[1].angle = 0.2f * turn;

    for (i = ACTORS; i < s->world.instance_count; i++) {        /* on a spiral of seeds */
        const float n = (float)(i - ACTORS) + 20, radius = 0.75f * sqrtf(n), angle = 2.3999632f * n, own = 3 + fmodf(n * 0.618f, 3);
        const float now = hop(own * start + n), then = hop(own * (start + step) + n);

        place(&s->actors[i], angle + own * start, 0.3f, vec(radius * cosf(angle), now, radius * sinf(angle) - 0.6f));
        s->motions[i].move = vec(0, then - now, 0);
        s->motions[i].pivot = vec(radius * cosf(angle), 0, radius * sinf(angle) - 0.6f);
        s->motions[i].axis = vec(0, 1, 0), s->motions[i].angle = own * step;
    }
    s->rider.motion = o->effects[BLUR] ? &s->rider_motion : NULL;
    for (i = 0; i < s->world.instance_count; i++) s->actors[i].motion = o->effects[BLUR] ? &s->motions[i] : NULL;
}

static bool show_build_one(rt_accel **accel, const rt_geometry *geometry, const options *o, pool *threads)
{
    rt_build_options build = {0};
    rt_error error = {0};

    build.structure = o->structure;
    keep_what_it_reads(&build, o->algorithm->algorithm, o->gpu);
    build.parallel_for = pool_for;
    build.parallel_user = threads;
    build.error = &error;
    rt_free(*accel);
    return rt_build(accel, geometry, &build) == RT_OK || fail("%s", error.message);
}

/* The accels of the first frame, and the scene that shows them. */
static bool show_build(show *s, const options *o, pool *threads)
{
    rt_error error = {0};
    size_t i;

    s->world.instance_count = ACTORS + (size_t)o->crowd;
    show_move(s, o, o->first);
    if (!show_build_one(&s->imp_accel, &s->imp.geometry, o, threads)) return false;
    s->rider.accel = s->imp_accel;
    s->ride.instances = &s->rider;
    s->ride.instance_count = 1;
    if (!show_build_one(&s->ride_accel, &s->ride, o, threads)) return false;
    for (i = 0; i < s->world.instance_count; i++) s->actors[i].accel = i == 1 ? s->ride_accel : s->imp_accel;
    s->world.instances = s->actors;
    s->world.spheres = s->balls;
    s->world.sphere_count = BALLS;
    s->world.planes = &s->ground;
    s->world.plane_count = 1;
    if (!show_build_one(&s->world_accel, &s->world, o, threads)) return false;

    s->imp_view = scene_view(&s->imp, s->imp_accel);
    s->ride_part = &s->imp_view;
    s->ride_view.accel = s->ride_accel;
    s->ride_view.geometry = &s->ride;
    s->ride_view.parts = &s->ride_part;
    for (i = 0; i < s->world.instance_count; i++) s->parts[i] = i == 1 ? &s->ride_view : &s->imp_view;
    s->view.accel = s->world_accel;
    s->view.geometry = &s->world;
    s->view.parts = s->parts;
    s->view.materials = s->materials;
    s->view.material_count = BALLS + 1;
    s->view.material_ids = s->ids;
    s->view.lights = s->lights;
    s->view.light_count = 2;
    s->view.ambient = vec(0.16f, 0.17f, 0.2f);
    s->view.background = vec(0.35f, 0.5f, 0.75f);
    s->view.camera.eye = vec(1.6f, 2.2f, 7.5f);
    s->view.camera.look = vec(0, 1, 0);
    s->view.camera.up = vec(0, 1, 0);
    s->view.camera.fov = 36;
    return (rt_check_scene(&s->view, &error) == RT_OK && rt_check_scene(&s->imp_view, &error) == RT_OK) || fail("%s", error.message);
}

/* Transforms alone: what is below an instance stays as it is. The planes of a k-d tree cannot be moved: its top levels are built again. */
static bool show_update(show *s, const options *o, pool *threads)
{
    rt_error error = {0};

    if (o->structure == RT_KDTREE) {
        if (!show_build_one(&s->ride_accel, &s->ride, o, threads)) return false;
        s->ride_view.accel = s->actors[1].accel = s->ride_accel;
        if (!show_build_one(&s->world_accel, &s->world, o, threads)) return false;
        s->view.accel = s->world_accel;
        return true;
    }
    return (rt_refit_error(s->ride_accel, &s->ride, &error) == RT_OK && rt_refit_error(s->world_accel, &s->world, &error) == RT_OK) ||
           fail("%s", error.message);
}

/* ---- >>frames ------------------------------------------------------------------------------------------------------- */

typedef struct {
    const rt_scene *view;
    rt_render_options how;
    rt_vec3 *pixels;
    int columns;
    int failed;                             /* atomic */
} drawing;

static void draw_tile(void *context, size_t index)
{
    drawing *d = context;
    const int x = (int)(index % (size_t)d->columns) * TILE, y = (int)(index / (size_t)d->columns) * TILE;

    if (rt_render_tile(d->view, &d->how, x, y, x + TILE < d->how.width ? x + TILE : d->how.width,
                       y + TILE < d->how.height ? y + TILE : d->how.height, d->pixels, NULL) != RT_OK)
        __atomic_store_n(&d->failed, 1, __ATOMIC_RELAXED);
}

static void draw_progress(int done, int frames, double elapsed)
{
    const int full = 30 * done / frames;
    const long left = done ? (long)(elapsed * (frames - done) / done) : 0;

    if (!isatty(STDERR_FILENO)) return;
    fprintf(stderr, "\r%3d%% [%.*s%*s] frame %d of %d, %ld:%02ld left \033[K", 100 * done / frames, full, "##############################",
            30 - full, "", done, frames, left / 60, left % 60);
    if (done == frames) fputs("\r\033[K", stderr);
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, compare);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}

/* Is there a folder that the first picture can be written to? Asked before the work. */
static bool check_output(const options *o)
{
    char path[4096];
    int file;

    snprintf(path, sizeof path, "%s%04d.ppm.try.%ld", o->prefix, o->first, (long)getpid());
    file = open(path, O_WRONLY | O_CREAT | O_EXCL, 0666);
    if (file < 0) return fail("%s: %s", o->prefix, strerror(errno));
    close(file);
    unlink(path);
    return true;
}

/* gpu NULL: on the CPU. */
static bool animate(const options *o, show *s, pool *threads, rt_gpu *gpu, rt_vec3 *pixels, double *update, double *trace)
{
    const double begin = seconds_now();
    const size_t before = allocations;
    size_t tiles;
    rt_error error = {0};
    drawing d = {0};
    rt_gpu_scene *there = NULL;
    rt_gpu_info device;
    char where[160];
    int i;

    if (gpu) {
        rt_gpu_get_info(gpu, &device);
        snprintf(where, sizeof where, "%s", device.name);
    } else snprintf(where, sizeof where, "%d threads", pool_threads(threads));
    if (!check_output(o) || !show_build(s, o, threads)) return false;
    if (!o->quiet)
        printf("scene     %zu primitives of %zu instances, as many as %zu without them; built with %zu allocations\n",
               (size_t)BALLS + 1 + s->imp.geometry.triangle_count + s->world.instance_count, s->world.instance_count,
               (size_t)BALLS + 1 + s->imp.geometry.triangle_count * s->world.instance_count, allocations - before);
    d.how.width = o->width;
    d.how.height = o->height;
    d.how.spp = o->spp;
    d.how.depth = o->depth ? o->depth : -1;
    d.how.sampler = o->sampler;
    d.how.seed = o->seed;
    d.how.trace.algorithm = o->algorithm->algorithm;
    d.how.trace.packet_width = o->packet;
    d.how.trace.error = &error;
    if (!gpu && rt_trace(s->world_accel, &d.how.trace, NULL, 0, NULL) != RT_OK) return fail("%s", error.message);
    if (!gpu) d.how.trace.error = NULL;     /* threads would share it */
    if (o->effects[LENS]) d.how.lens.radius = 0.09f;
    if (o->effects[BLUR]) d.how.lens.close = 0.5f;          /* half of a frame, as cameras have it */
    d.pixels = pixels;
    d.columns = (o->width + TILE - 1) / TILE;
    tiles = (size_t)d.columns * (size_t)((o->height + TILE - 1) / TILE);
    for (i = 0; i < o->frames; i++) {
        size_t taken = allocations;
        char path[4096], message[512] = "";
        double start = seconds_now();

        draw_progress(i, o->frames, start - begin);
        show_move(s, o, o->first + i);
        if (!show_update(s, o, threads)) return false;
        if (gpu) {
            rt_gpu_free_scene(there);
            if (rt_gpu_upload_scene(gpu, &there, &s->view, &error) != RT_OK) return fail("--gpu: %s", error.message);
        }
        update[i] = 1e3 * (seconds_now() - start);
        taken = allocations - taken;
        d.view = &s->view;
        d.how.frame = (uint32_t)(o->first + i);
        start = seconds_now();
        if (!gpu) pool_for(threads, tiles, draw_tile, &d);
        else if (rt_gpu_render_tile(gpu, there, &d.how, 0, 0, o->width, o->height, pixels, NULL) != RT_OK)
            return fail("--gpu: %s", error.message);
        trace[i] = 1e3 * (seconds_now() - start);
        if (d.failed) return fail("frame %d cannot be drawn", o->first + i);
        snprintf(path, sizeof path, "%s%04d.ppm", o->prefix, o->first + i);
        if (!scene_write_ppm(path, pixels, o->width, o->height, message, sizeof message)) return fail("%s", message);
        if (!o->quiet && !isatty(STDERR_FILENO))
            printf("frame %4d  update %.3f ms with %zu allocations, trace %.1f ms\n", o->first + i, update[i], taken, trace[i]);
    }
    draw_progress(o->frames, o->frames, 1);
    if (!o->quiet)
        printf("median    update %.3f ms, trace %.1f ms a frame of %dx%d with %d samples, %s on %s\npictures  %s%04d.ppm ...\n",
               median(update, o->frames), median(trace, o->frames), o->width, o->height, o->spp, o->algorithm->name, where, o->prefix,
               o->first);
    return true;
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

int main(int argc, char **argv)
{
    options o = {0};
    show s = {0};
    pool *threads;
    rt_vec3 *pixels;
    double *update, *trace;
    rt_gpu *gpu = NULL;
    rt_gpu_options choice = {0};
    rt_error error = {0};
    bool done = false;

    o.prefix = "out/animate";
    o.obj = "examples/imp.obj";
    o.frames = 24;
    o.width = 640, o.height = 480, o.spp = 16, o.depth = 5;
    o.fps = 24;
    memset(o.effects, true, sizeof o.effects);
    o.structure = RT_STRUCTURE_COUNT;
    o.algorithm = rt_algorithm_get(0);
    o.sampler = RT_SAMPLER_SOBOL;
    if (!parse_options(&o, argc, argv)) return EXIT_FAILURE;
    if (o.help) {
        print_help();
        return EXIT_SUCCESS;
    }
    choice.device = o.device;
    choice.error = &error;
    threads = pool_create(o.threads);
    pixels = calloc((size_t)o.width * (size_t)o.height, sizeof *pixels);
    update = calloc((size_t)o.frames, sizeof *update);
    trace = calloc((size_t)o.frames, sizeof *trace);
    if (!threads) fail("cannot start the threads: choose a smaller --threads");
    else if (!pixels || !update || !trace) fail("out of memory");
    else if (o.gpu && rt_gpu_open(&gpu, &choice) != RT_OK) fail("--gpu: %s", error.message);
    else done = show_make(&s, &o) && animate(&o, &s, threads, gpu, pixels, update, trace);
    rt_gpu_close(gpu);
    show_free(&s);
    pool_destroy(threads);
    free(pixels);
    free(update);
    free(trace);
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
