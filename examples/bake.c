/* bake.c - ambient occlusion of a scene's triangles as vertex colours, to a PLY or OBJ file.    bake --help tells all.
   cc -O2 bake.c -o bake -lm -lpthread

   >>options  >>bake  >>write  >>main                                                   SPDX-License-Identifier: MIT OR Unlicense */

#define _POSIX_C_SOURCE 200809L
#define RT_IMPLEMENTATION
#include "../rt.h"
static const char program[] = "bake";
#include "pool.h"
#include "scene.h"
#include "options.h"
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAX_RAYS 4096
#define BLOCK 16                            /* triangles that a thread takes at once */

/* ---- >>options ------------------------------------------------------------------------------------------------------ */

struct options {
    const char *scene, *output;
    int rays, threads, seed;
    float distance;
    bool two_sided, quiet, help;
};

static bool set_output(options *o, const char *text)
{
    const char *dot = strrchr(text, '.');

    o->output = text;
    return dot && (strcmp(dot, ".ply") == 0 || strcmp(dot, ".obj") == 0);
}

static bool set_distance(options *o, const char *text) { return read_float(text, '\0', &o->distance, NULL) && o->distance > 0; }
static bool set_rays(options *o, const char *text) { return read_int(text, '\0', 1, MAX_RAYS, &o->rays, NULL); }
static bool set_threads(options *o, const char *text) { return read_int(text, '\0', 1, 1024, &o->threads, NULL); }
static bool set_seed(options *o, const char *text) { return read_int(text, '\0', 0, 2147483647, &o->seed, NULL); }
static bool set_two_sided(options *o, const char *text) { (void)text; return o->two_sided = true; }
static bool set_quiet(options *o, const char *text) { (void)text; return o->quiet = true; }
static bool set_help(options *o, const char *text) { (void)text; return o->help = true; }

static const option option_table[] = {
    { "-o",          "FILE", set_output,    "where to (default out/bake.ply)",                              "a path that ends in .ply or .obj" },
    { "--rays",      "N",    set_rays,      "a triangle (default 256)",                                     "1 to 4096" },
    { "--distance",  "D",    set_distance,  "farther surfaces hide nothing (default: all do)",              "above 0, up to 1e18" },
    { "--two-sided", NULL,   set_two_sided, "a triangle takes its side that sees more: for careless winding", NULL },
    { "--seed",      "N",    set_seed,      "other noise (default 0)",                                      "0 to 2147483647" },
    { "--threads",   "N",    set_threads,   "worker threads (default: all processors)",                     "1 to 1024" },
    { "--quiet",     NULL,   set_quiet,     "print nothing but errors",                                     NULL },
    { "--help",      NULL,   set_help,      "print this text",                                              NULL },
};
enum { OPTIONS = sizeof option_table / sizeof option_table[0] };

static bool parse_options(options *o, int argc, char **argv)
{
    return read_options(o, option_table, OPTIONS, argc, argv, &o->scene) && (o->scene || o->help || fail("no scene given; see --help"));
}

static void print_help(void)
{
    puts("usage: bake [options] SCENE\n\nTraces how much of the sky each triangle of SCENE sees, and writes it as grey vertex colours. SCENE is an\n"
         "OBJ or NFF file, or one of the procedural scenes that render --help lists. What render shows of the OBJ is the result.\n\noptions:");
    print_options(option_table, OPTIONS);
}

/* ---- >>bake --------------------------------------------------------------------------------------------------------- */

/* A vertex gets the mean of what its triangles see, weighted by its barycentric coordinate: so colours between vertices come as near to what
   was traced as linear ones can without a system of equations, and no ray starts on an edge, where it would see into the neighbours. */
typedef struct {
    const options *o;
    const scene *content;
    const rt_accel *accel;
    float (*seen)[3];                       /* of each triangle and corner: the part of the sky, */
    float (*weight)[3];                     /* and its weight, as large as the triangle */
} baker;

static void fetch(const scene *s, size_t triangle, rt_vec3 corner[3])
{
    int i;

    for (i = 0; i < 3; i++) {
        const float *v = s->vertices + 3 * (size_t)s->indices[3 * triangle + (size_t)i];

        corner[i].x = v[0], corner[i].y = v[1], corner[i].z = v[2];
    }
}

static rt_vec3 minus(rt_vec3 a, rt_vec3 b) { a.x -= b.x, a.y -= b.y, a.z -= b.z; return a; }

static rt_vec3 cross(rt_vec3 a, rt_vec3 b)
{
    rt_vec3 c;

    c.x = a.y * b.z - a.z * b.y, c.y = a.z * b.x - a.x * b.z, c.z = a.x * b.y - a.y * b.x;
    return c;
}

static float length(rt_vec3 a) { return sqrtf(a.x * a.x + a.y * a.y + a.z * a.z); }

static rt_vec3 scaled(rt_vec3 a, float s) { a.x *= s, a.y *= s, a.z *= s; return a; }

/* Sums what rays from one side of a triangle see, by corner; side 1: that from which it is wound counterclockwise, or -1. */
static void look(const baker *b, size_t triangle, const rt_vec3 corner[3], float side, rt_ray *rays, rt_hit *hits, float seen[3], float weight[3])
{
    const rt_vec3 edge = minus(corner[1], corner[0]), across = cross(edge, minus(corner[2], corner[0]));
    const rt_vec3 normal = scaled(across, side / length(across)), tangent = scaled(edge, 1 / length(edge)), other = cross(normal, tangent);
    const int count = b->o->rays;
    rt_sampler sampler;
    rt_trace_options trace;
    float at[MAX_RAYS][2];
    int i, k;

    memset(&sampler, 0, sizeof sampler);
    memset(&trace, 0, sizeof trace);
    sampler.spp = (uint32_t)count;
    sampler.seed = (uint32_t)b->o->seed;
    trace.query = RT_ANY;
    for (i = 0; i < count; i++) {
        rt_ray from;
        rt_hit hit;
        float point[2], way[2], root, radius, up;

        rt_sample_2d(&sampler, (uint32_t)triangle, side < 0, (uint32_t)i, 0, point);
        rt_sample_2d(&sampler, (uint32_t)triangle, side < 0, (uint32_t)i, 1, way);
        root = sqrtf(point[0]);
        radius = sqrtf(way[0]);
        up = sqrtf(1 - way[0]);
        memset(&from, 0, sizeof from);
        memset(&hit, 0, sizeof hit);
        from.org = corner[0];
        from.dir = scaled(normal, -1);
        from.tmax = 1;
        hit.u = at[i][0] = root * (1 - point[1]);
        hit.v = at[i][1] = root * point[1];
        hit.prim = (uint32_t)triangle;
        hit.inst = RT_NONE;
        rays[i].dir = scaled(normal, up);
        for (k = 0; k < 2; k++) {
            const rt_vec3 axis = scaled(k ? other : tangent, radius * (k ? sinf(6.2831853f * way[1]) : cosf(6.2831853f * way[1])));

            rays[i].dir.x += axis.x, rays[i].dir.y += axis.y, rays[i].dir.z += axis.z;
        }
        rays[i].org = rt_spawn_origin(&b->content->geometry, NULL, &from, &hit, rays[i].dir);
        rays[i].tmin = 0;
        rays[i].tmax = b->o->distance > 0 ? b->o->distance : INFINITY;
    }
    (void)rt_trace(b->accel, &trace, rays, (size_t)count, hits);
    for (i = 0; i < count; i++) {
        const float part[3] = { 1 - at[i][0] - at[i][1], at[i][0], at[i][1] };

        for (k = 0; k < 3; k++) {
            weight[k] += part[k];
            if (hits[i].prim == RT_NONE) seen[k] += part[k];
        }
    }
}

static void bake_block(void *context, size_t block)
{
    const baker *b = (const baker *)context;
    const size_t first = block * BLOCK, left = b->content->geometry.triangle_count - first;
    rt_ray rays[MAX_RAYS];
    rt_hit hits[MAX_RAYS];
    size_t t;

    for (t = first; t < first + (left < BLOCK ? left : BLOCK); t++) {
        rt_vec3 corner[3];
        float area, seen[2][3] = { { 0 } }, weight[2][3] = { { 0 } };
        int side = 0, k;

        fetch(b->content, t, corner);
        area = length(cross(minus(corner[1], corner[0]), minus(corner[2], corner[0])));
        if (!(area > 0) || !(length(minus(corner[1], corner[0])) > 0)) continue;       /* it has no inside */
        look(b, t, corner, 1, rays, hits, seen[0], weight[0]);
        if (b->o->two_sided) {
            look(b, t, corner, -1, rays, hits, seen[1], weight[1]);
            side = seen[1][0] + seen[1][1] + seen[1][2] > seen[0][0] + seen[0][1] + seen[0][2];
        }
        for (k = 0; k < 3; k++) {
            b->seen[t][k] = area * seen[side][k];
            b->weight[t][k] = area * weight[side][k];
        }
    }
}

/* Adds up, in the order of triangles: the same for any number of threads. sums: two a vertex, 0. Vertices without a triangle see all. */
static void gather(const baker *b, double *sums, float *value)
{
    const scene *s = b->content;
    size_t t, v;
    int k;

    for (t = 0; t < s->geometry.triangle_count; t++)
        for (k = 0; k < 3; k++) {
            double *sum = sums + 2 * (size_t)s->indices[3 * t + (size_t)k];

            sum[0] += (double)b->seen[t][k];
            sum[1] += (double)b->weight[t][k];
        }
    for (v = 0; v < s->geometry.vertex_count; v++) value[v] = sums[2 * v + 1] > 0 ? (float)(sums[2 * v] / sums[2 * v + 1]) : 1;
}

/* ---- >>write -------------------------------------------------------------------------------------------------------- */

static bool write_ply(FILE *file, const scene *s, const float *value)
{
    size_t i;
    bool ok = fprintf(file, "ply\nformat ascii 1.0\ncomment ambient occlusion of %s\nelement vertex %zu\nproperty float x\nproperty float y\n"
                            "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face %zu\n"
                            "property list uchar uint vertex_indices\nend_header\n", s->name, s->geometry.vertex_count, s->geometry.triangle_count) > 0;

    for (i = 0; ok && i < s->geometry.vertex_count; i++) {
        const float *v = s->vertices + 3 * i;
        const int grey = (int)(255 * value[i] + 0.5f);

        ok = fprintf(file, "%.9g %.9g %.9g %d %d %d\n", (double)v[0], (double)v[1], (double)v[2], grey, grey, grey) > 0;
    }
    for (i = 0; ok && i < s->geometry.triangle_count; i++) {
        const uint32_t *at = s->indices + 3 * i;

        ok = fprintf(file, "3 %lu %lu %lu\n", (unsigned long)at[0], (unsigned long)at[1], (unsigned long)at[2]) > 0;
    }
    return ok;
}

static bool write_obj(FILE *file, const scene *s, const float *value)
{
    size_t i;
    bool ok = fprintf(file, "# ambient occlusion of %s: x y z red green blue\n", s->name) > 0;

    for (i = 0; ok && i < s->geometry.vertex_count; i++) {
        const float *v = s->vertices + 3 * i;
        const double grey = (double)value[i];

        ok = fprintf(file, "v %.9g %.9g %.9g %.6g %.6g %.6g\n", (double)v[0], (double)v[1], (double)v[2], grey, grey, grey) > 0;
    }
    for (i = 0; ok && i < s->geometry.triangle_count; i++) {
        const uint32_t *at = s->indices + 3 * i;

        ok = fprintf(file, "f %lu %lu %lu\n", (unsigned long)at[0] + 1, (unsigned long)at[1] + 1, (unsigned long)at[2] + 1) > 0;
    }
    return ok;
}

static bool write_file(const options *o, const scene *s, const float *value)
{
    output out;

    return open_output(&out, o->output) &&
           close_output(&out, (strcmp(strrchr(o->output, '.'), ".ply") == 0 ? write_ply : write_obj)(out.file, s, value));
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

static bool bake(const options *o, const scene *content)
{
    const size_t triangles = content->geometry.triangle_count, vertices = content->geometry.vertex_count;
    rt_build_options build;
    rt_accel *accel = NULL;
    rt_error error;
    pool *threads = NULL;
    baker b;
    double *sums = (double *)calloc(2 * vertices + 1, sizeof *sums), start = seconds_now(), built, traced;
    float *value = (float *)malloc((vertices + 1) * sizeof *value);
    bool ok;

    b.o = o;
    b.content = content;
    b.seen = (float (*)[3])calloc(triangles + 1, sizeof *b.seen);
    b.weight = (float (*)[3])calloc(triangles + 1, sizeof *b.weight);
    ok = (sums && value && b.seen && b.weight) || fail("out of memory");
    if (ok) ok = (threads = pool_create(o->threads)) != NULL || fail("cannot start the threads: choose a smaller --threads");
    if (ok) {
        memset(&build, 0, sizeof build);
        build.no_binary = true;             /* by which rays to all sides are no faster */
        build.parallel_for = pool_for;
        build.parallel_user = threads;
        build.error = &error;
        ok = rt_build(&accel, &content->geometry, &build) == RT_OK || fail("%s: %s", content->name, error.message);
    }
    if (ok) {
        built = seconds_now();
        b.accel = accel;
        pool_for(threads, (triangles + BLOCK - 1) / BLOCK, bake_block, &b);
        traced = seconds_now();
        gather(&b, sums, value);
        pool_destroy(threads);              /* leaves one thread, as hold_signals wants */
        threads = NULL;
        ok = write_file(o, content, value);
        if (ok && !o->quiet) {
            const double rays = (double)triangles * o->rays * (o->two_sided ? 2 : 1);

            printf("%s: %zu triangles, %zu vertices; tree %.3f s, %.0f rays %.3f s (%.2f Mrays/s); %s\n", content->name, triangles, vertices,
                   built - start, rays, traced - built, rays / (traced - built) * 1e-6, o->output);
        }
    }
    rt_free(accel);
    pool_destroy(threads);
    free(sums), free(value), free(b.seen), free(b.weight);
    return ok;
}

int main(int argc, char **argv)
{
    options o = { .output = "out/bake.ply", .rays = 256 };
    scene content;
    bool ok;

    if (!parse_options(&o, argc, argv)) return EXIT_FAILURE;
    if (o.help) {
        print_help();
        return EXIT_SUCCESS;
    }
    if (!check_output(o.output, o.scene)) return EXIT_FAILURE;
    if (!load_scene(&content, o.scene, o.quiet)) return EXIT_FAILURE;
    ok = (content.geometry.triangle_count || fail("%s: there are no triangles", o.scene)) && bake(&o, &content);
    scene_free(&content);
    return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
