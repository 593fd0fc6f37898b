/* rt_test.c - the tests of rt.h.    SPDX-License-Identifier: MIT OR Unlicense

       cc -O2 -pthread tests/rt_test.c -o rt_test -lm && ./rt_test        all tests
       ./rt_test NAME...       those whose name contains one of the NAMEs
       ./rt_test --without NAME   not those whose name contains NAME; may be said again
       ./rt_test --list        names only
       ./rt_test --seed N      other random numbers (the checksum changes with them)
       ./rt_test --big         ten million triangles where otherwise one million
       ./rt_test --no-gpu      without OpenCL: no test of rt_gpu.h
       ./rt_test --any-gpu     on a device too that does not promise correctly rounded division, as simulators do not

   Every way to trace (algorithm x packet width x instructions x query) is compared by == on all bits with a scalar brute force
   that is written here from the documented arithmetic and shares no code with rt.h. The "hits checksum" hashes what the brute force
   found: it must be the same number from every compiler, with every flag, on every processor, so nothing that makes geometry
   or rays may depend on them: rtt_f and rtt_d force each operation to be rounded alone.

   What a test needs and does not find (a C compiler, memory, a file) is a failure: nothing is ever skipped.

   CONTENTS (search for the tag)

       >>memory  >>harness  >>exact  >>oracle  >>models  >>shapes  >>rays  >>compare  >>device
       tests: >>hits  >>instances  >>ugly  >>intervals  >>watertight  >>refit  >>builds  >>oom  >>options  >>stats  >>kdtree
              >>threads  >>shading  >>raster  >>programs  >>loaders  >>gpu
       >>main  */

#define _POSIX_C_SOURCE 200809L

#include <dirent.h>
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static void *rtt_malloc(size_t size, void *user);
static void rtt_free(void *pointer, void *user);
#define RT_MALLOC(n, user) rtt_malloc(n, user)
#define RT_FREE(p, user) rtt_free(p, user)
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"

#ifdef _WIN32                               /* what mingw-w64 lacks of POSIX */
#include <direct.h>
#include <io.h>
#define mkdir(path, mode) _mkdir(path)
static char *mkdtemp(char *path) { return _mktemp(path) && _mkdir(path) == 0 ? path : NULL; }
static int setenv(const char *name, const char *value, int replace) { return replace || !getenv(name) ? _putenv_s(name, value) : 0; }
static int unsetenv(const char *name) { return _putenv_s(name, ""); }
#endif

#define RTT_COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* ---- >>harness ------------------------------------------------------------------------------------------------------ */

typedef struct { const char *name; void (*run)(void); } rtt_test;

static struct {
    const char *test;                       /* the one that runs */
    int failures;                           /* of it */
    uint64_t seed, checksum, cases, rays;
    bool big, no_gpu, any_gpu;
    size_t scale;                           /* where programs are slow, under sanitizers and emulators: divides the sizes of big builds and of many
                                               rays (never of a case in the checksum); and where it is not 1, one in five ways to trace is
                                               tried, by turns */
} rtt;

/* Notes a failure; only the first few of a test are printed. */
static void __attribute__((format(printf, 1, 2))) rtt_fail(const char *format, ...)
{
    va_list arguments;

    if (rtt.failures++ >= 8)
        return;
    printf("    %s: ", rtt.test);
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    printf("\n");
}

static bool rtt_expect(bool condition, const char *text, int line)
{
    if (!condition)
        rtt_fail("line %d: %s", line, text);
    return condition;
}

#define CHECK(condition) rtt_expect(condition, #condition, __LINE__)

static bool rtt_expect_status(rt_status got, rt_status want, const char *text, int line)
{
    if (got != want)
        rtt_fail("line %d: %s: got \"%s\", expected \"%s\"", line, text, rt_status_string(got), rt_status_string(want));
    return got == want;
}

#define CHECK_STATUS(call, want) rtt_expect_status(call, want, #call, __LINE__)

/* A failure that leaves nothing to go on with. */
static void rtt_die(const char *what)
{
    fflush(stdout);
    fprintf(stderr, "rt_test: %s\n", what);
    exit(2);
}

static double rtt_seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- >>memory ------------------------------------------------------------------------------------------------------- */

/* What one user pointer of RT_MALLOC has seen. */
typedef struct {
    size_t live, peak;                      /* bytes */
    size_t blocks, calls;                   /* blocks not freed yet; allocations asked for */
    size_t fail_at;                         /* this call fails (1 = the first); 0 = none */
    bool fail_after;                        /* so do all later ones */
} rtt_memory;

typedef struct { rtt_memory *owner; size_t size; } rtt_block;          /* before each block */

static rtt_memory rtt_heap;                 /* where user is NULL */
static pthread_mutex_t rtt_heap_lock = PTHREAD_MUTEX_INITIALIZER;
static bool rtt_in_loop;                    /* of rtt_threads, whose caller waits: the others must not come for memory */
static const unsigned char rtt_fence[8] = { 0xf0, 0xe1, 0xd2, 0xc3, 0xb4, 0xa5, 0x96, 0x87 };      /* after each block */

static void *rtt_malloc(size_t size, void *user)
{
    rtt_memory *owner = user ? (rtt_memory *)user : &rtt_heap;
    rtt_block *block = NULL;

    if (rtt_in_loop)
        rtt_die("RT_MALLOC within parallel_for");
    pthread_mutex_lock(&rtt_heap_lock);
    owner->calls++;
    if (!(owner->fail_at && (owner->calls == owner->fail_at || (owner->fail_after && owner->calls > owner->fail_at)))
        && size <= SIZE_MAX - sizeof *block - sizeof rtt_fence)
        block = (rtt_block *)malloc(sizeof *block + size + sizeof rtt_fence);
    if (block) {
        block->owner = owner;
        block->size = size;
        owner->blocks++;
        owner->live += size;
        if (owner->peak < owner->live)
            owner->peak = owner->live;
    }
    pthread_mutex_unlock(&rtt_heap_lock);
    if (!block)
        return NULL;
    memset(block + 1, 0xa5, size);          /* so that what nobody wrote is not zero by luck */
    memcpy((char *)(block + 1) + size, rtt_fence, sizeof rtt_fence);
    return block + 1;
}

static void rtt_free(void *pointer, void *user)
{
    rtt_block *block = (rtt_block *)pointer - 1;

    if (!pointer)
        return;
    if (rtt_in_loop)
        rtt_die("RT_FREE within parallel_for");
    if (block->owner != (user ? (rtt_memory *)user : &rtt_heap))
        rtt_die("RT_FREE with another user pointer than RT_MALLOC");
    if (memcmp((char *)pointer + block->size, rtt_fence, sizeof rtt_fence) != 0)
        rtt_die("written past the end of a block");
    pthread_mutex_lock(&rtt_heap_lock);
    block->owner->blocks--;
    block->owner->live -= block->size;
    pthread_mutex_unlock(&rtt_heap_lock);
    memset(pointer, 0xdd, block->size);
    free(block);
}

/* For the test's own arrays: room for one more element in an array that holds count. */
static void *rtt_grow(void *array, size_t count, size_t size)
{
    if ((count & (count - 1)) != 0)
        return array;
    array = realloc(array, (count ? 2 * count : 1) * size);
    if (!array)
        rtt_die("out of memory");
    return array;
}

static void *rtt_array(size_t count, size_t size)
{
    void *array = calloc(count ? count : 1, size);

    if (!array)
        rtt_die("out of memory");
    return array;
}

/* ---- >>exact: arithmetic that no flag can change, and random numbers from it ---------------------------------------- */

/* The value as the format holds it: the volatile store keeps a compiler from contracting the operation with the next. */
static inline float rtt_f(float value) { volatile float rounded = value; return rounded; }
static inline double rtt_d(double value) { volatile double rounded = value; return rounded; }

static uint64_t rtt_mix(uint64_t hash, uint64_t word)
{
    hash = (hash ^ word) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 29);
}

/* A stream of numbers for this test (splitmix64); the same whether it runs alone or among others. */
typedef struct { uint64_t state; } rtt_random;

static rtt_random rtt_stream(void)
{
    rtt_random random = { rtt.seed };
    const char *c;

    for (c = rtt.test; *c; c++)
        random.state = rtt_mix(random.state, (unsigned char)*c);
    return random;
}

static uint32_t rtt_bits(rtt_random *random)
{
    uint64_t z = random->state += 0x9e3779b97f4a7c15u;

    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)(z >> 32);
}

static uint32_t rtt_below(rtt_random *random, uint32_t n) { return (uint32_t)(((uint64_t)rtt_bits(random) * n) >> 32); }

/* In [-1, 1), a multiple of 2^-23. */
static float rtt_signed(rtt_random *random) { return (float)((int32_t)(rtt_bits(random) >> 8) - (1 << 23)) * 0x1p-23f; }

/* +-1..2 times a power of two with exponent in [low, high]. */
static float rtt_log(rtt_random *random, int low, int high)
{
    int exponent = low + (int)rtt_below(random, (uint32_t)(high - low + 1));
    float mantissa = (float)((1u << 23) + (rtt_bits(random) >> 9)) * 0x1p-23f;

    return ldexpf((rtt_bits(random) & 1) ? mantissa : -mantissa, exponent);
}

static rt_vec3 rtt_v(float x, float y, float z) { rt_vec3 v; v.x = x; v.y = y; v.z = z; return v; }
static rt_vec3 rtt_add(rt_vec3 a, rt_vec3 b) { return rtt_v(rtt_f(a.x + b.x), rtt_f(a.y + b.y), rtt_f(a.z + b.z)); }
static rt_vec3 rtt_sub(rt_vec3 a, rt_vec3 b) { return rtt_v(rtt_f(a.x - b.x), rtt_f(a.y - b.y), rtt_f(a.z - b.z)); }
static rt_vec3 rtt_mul(rt_vec3 a, float s) { return rtt_v(rtt_f(a.x * s), rtt_f(a.y * s), rtt_f(a.z * s)); }

/* A point in the cube of half width size around center. */
static rt_vec3 rtt_point(rtt_random *random, rt_vec3 center, float size)
{
    rt_vec3 v;

    v.x = rtt_signed(random), v.y = rtt_signed(random), v.z = rtt_signed(random);
    return rtt_add(center, rtt_mul(v, size));
}

/* Whole coordinates in [-most, most]. (Random arguments of one call would come in the order that a compiler likes.) */
static rt_vec3 rtt_lattice(rtt_random *random, uint32_t most)
{
    rt_vec3 v;

    v.x = (float)rtt_below(random, 2 * most + 1) - (float)most;
    v.y = (float)rtt_below(random, 2 * most + 1) - (float)most;
    v.z = (float)rtt_below(random, 2 * most + 1) - (float)most;
    return v;
}

/* A unit axis: 0..5 = +x -x +y -y +z -z. */
static rt_vec3 rtt_axis(unsigned which)
{
    float sign = (which & 1) ? -1.0f : 1.0f;

    return rtt_v(which / 2 == 0 ? sign : 0, which / 2 == 1 ? sign : 0, which / 2 == 2 ? sign : 0);
}

static const rt_vec3 rtt_origin = { 0, 0, 0 };

/* ---- >>models: geometry that grows, and what the oracle must know of it --------------------------------------------- */

typedef struct rtt_model {
    float *vertices;       size_t vertex_count;
    uint32_t *indices;     size_t triangle_count;
    rt_sphere *spheres;    size_t sphere_count;
    rt_instance *instances; const struct rtt_model **children; size_t instance_count;
    rt_plane *planes;      size_t plane_count;
    rt_accel *accel;                        /* where it is a child of others */
    rt_structure structure;                 /* of accel */
    bool skip_invalid;
} rtt_model;

static rt_geometry rtt_geometry(const rtt_model *model)
{
    rt_geometry geometry;

    memset(&geometry, 0, sizeof geometry);
    geometry.vertices = model->vertices;
    geometry.vertex_count = model->vertex_count;
    geometry.indices = model->indices;
    geometry.triangle_count = model->triangle_count;
    geometry.spheres = model->spheres;
    geometry.sphere_count = model->sphere_count;
    geometry.instances = model->instances;
    geometry.instance_count = model->instance_count;
    geometry.planes = model->planes;
    geometry.plane_count = model->plane_count;
    return geometry;
}

static void rtt_model_free(rtt_model *model)
{
    rt_free(model->accel);
    free(model->vertices);
    free(model->indices);
    free(model->spheres);
    for (size_t i = 0; i < model->instance_count; i++)
        free((void *)model->instances[i].motion);
    free(model->planes);
    free(model->instances);
    free(model->children);
    memset(model, 0, sizeof *model);
}

static uint32_t rtt_vertex(rtt_model *model, rt_vec3 p)
{
    model->vertices = (float *)rtt_grow(model->vertices, model->vertex_count, 3 * sizeof(float));
    memcpy(model->vertices + 3 * model->vertex_count, &p, sizeof p);
    return (uint32_t)model->vertex_count++;
}

static void rtt_triangle(rtt_model *model, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *corner;

    model->indices = (uint32_t *)rtt_grow(model->indices, model->triangle_count, 3 * sizeof(uint32_t));
    corner = model->indices + 3 * model->triangle_count++;
    corner[0] = a, corner[1] = b, corner[2] = c;
}

static void rtt_face(rtt_model *model, rt_vec3 a, rt_vec3 b, rt_vec3 c)
{
    uint32_t first = rtt_vertex(model, a);

    rtt_vertex(model, b);
    rtt_vertex(model, c);
    rtt_triangle(model, first, first + 1, first + 2);
}

/* The parallelogram corner, corner + u, corner + u + v, corner + v. */
static void rtt_quad(rtt_model *model, rt_vec3 corner, rt_vec3 u, rt_vec3 v)
{
    uint32_t first = rtt_vertex(model, corner);

    rtt_vertex(model, rtt_add(corner, u));
    rtt_vertex(model, rtt_add(rtt_add(corner, u), v));
    rtt_vertex(model, rtt_add(corner, v));
    rtt_triangle(model, first, first + 1, first + 2);
    rtt_triangle(model, first, first + 2, first + 3);
}

static void rtt_ball(rtt_model *model, rt_vec3 center, float radius)
{
    model->spheres = (rt_sphere *)rtt_grow(model->spheres, model->sphere_count, sizeof(rt_sphere));
    model->spheres[model->sphere_count].center = center;
    model->spheres[model->sphere_count++].radius = radius;
}

/* Instances child, which is built the first time. */
static void rtt_instance(rtt_model *model, rtt_model *child, const float transform[12])
{
    rt_geometry geometry = rtt_geometry(child);
    rt_build_options options;

    memset(&options, 0, sizeof options);
    options.structure = child->structure;
    if (!child->accel)
        CHECK_STATUS(rt_build(&child->accel, &geometry, &options), RT_OK);
    model->instances = (rt_instance *)rtt_grow(model->instances, model->instance_count, sizeof(rt_instance));
    model->children = (const rtt_model **)rtt_grow((void *)model->children, model->instance_count, sizeof *model->children);
    model->instances[model->instance_count].accel = child->accel;
    memcpy(model->instances[model->instance_count].transform, transform, 12 * sizeof(float));
    model->instances[model->instance_count].motion = NULL;
    model->children[model->instance_count++] = child;
}

/* Moves the last instance. */
static void rtt_set_motion(rtt_model *model, rt_vec3 move, rt_vec3 pivot, rt_vec3 axis, float angle)
{
    rt_motion *motion = (rt_motion *)rtt_array(1, sizeof *motion);

    motion->move = move, motion->pivot = pivot, motion->axis = axis, motion->angle = angle;
    free((void *)model->instances[model->instance_count - 1].motion);
    model->instances[model->instance_count - 1].motion = motion;
}

static void rtt_ground(rtt_model *model, rt_vec3 point, rt_vec3 normal, float radius)
{
    model->planes = (rt_plane *)rtt_grow(model->planes, model->plane_count, sizeof(rt_plane));
    model->planes[model->plane_count].point = point;
    model->planes[model->plane_count].normal = normal;
    model->planes[model->plane_count++].radius = radius;
}

/* The diagonal transform with a translation. */
static void rtt_place(rtt_model *model, rtt_model *child, rt_vec3 scale, rt_vec3 offset)
{
    float transform[12] = { 0 };

    transform[0] = scale.x, transform[5] = scale.y, transform[10] = scale.z;
    transform[3] = offset.x, transform[7] = offset.y, transform[11] = offset.z;
    rtt_instance(model, child, transform);
}

static rt_vec3 rtt_corner(const rtt_model *model, size_t triangle, size_t corner)
{
    rt_vec3 p;

    memcpy(&p, model->vertices + 3 * (size_t)model->indices[3 * triangle + corner], sizeof p);
    return p;
}

static bool rtt_in_range(const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(fabsf(values[i]) <= RT_MAX_COORDINATE))
            return false;
    return true;
}

/* ---- >>oracle: brute force, operation by operation as documented ---------------------------------------------------- */

static bool rtt_legal(const rt_ray *ray)
{
    float largest = fabsf(ray->dir.x);

    if (fabsf(ray->dir.y) > largest)
        largest = fabsf(ray->dir.y);
    if (fabsf(ray->dir.z) > largest)
        largest = fabsf(ray->dir.z);
    return isfinite(ray->dir.x) && isfinite(ray->dir.y) && isfinite(ray->dir.z) && rtt_in_range(&ray->org.x, 3)
        && largest >= RT_MIN_DIRECTION && largest <= RT_MAX_DIRECTION && ray->tmin < ray->tmax;
}

/* The axes of a ray, and its shear onto the largest. */
typedef struct { int kx, ky, kz; float org[3], dir[3], sx, sy; } rtt_shear;

static rtt_shear rtt_shear_of(const rt_ray *ray)
{
    rtt_shear s;

    memcpy(s.org, &ray->org, sizeof s.org);
    memcpy(s.dir, &ray->dir, sizeof s.dir);
    s.kz = 0;
    if (fabsf(s.dir[1]) > fabsf(s.dir[0]))
        s.kz = 1;
    if (fabsf(s.dir[2]) > fabsf(s.dir[s.kz]))
        s.kz = 2;
    s.kx = (s.kz + 1) % 3;
    s.ky = (s.kx + 1) % 3;
    s.sx = rtt_f(s.dir[s.kx] / s.dir[s.kz]);
    s.sy = rtt_f(s.dir[s.ky] / s.dir[s.kz]);
    return s;
}

/* Where the triangle's plane is met, if inside; the interval of the ray is the caller's. */
static bool rtt_meet_triangle(const rtt_shear *s, const float *const corner[3], rt_hit *hit)
{
    float x[3], y[3], u, v, w;
    double ud, vd, wd, det, t, r, z[3];

    for (int i = 0; i < 3; i++) {
        float depth = rtt_f(corner[i][s->kz] - s->org[s->kz]);

        x[i] = rtt_f(rtt_f(corner[i][s->kx] - s->org[s->kx]) - rtt_f(s->sx * depth));
        y[i] = rtt_f(rtt_f(corner[i][s->ky] - s->org[s->ky]) - rtt_f(s->sy * depth));
        z[i] = rtt_d((double)corner[i][s->kz] - (double)s->org[s->kz]);
    }
    u = rtt_f(rtt_f(x[2] * y[1]) - rtt_f(y[2] * x[1]));
    v = rtt_f(rtt_f(x[0] * y[2]) - rtt_f(y[0] * x[2]));
    w = rtt_f(rtt_f(x[1] * y[0]) - rtt_f(y[1] * x[0]));
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0))
        return false;
    ud = rtt_d(rtt_d((double)x[2] * (double)y[1]) - rtt_d((double)y[2] * (double)x[1]));
    vd = rtt_d(rtt_d((double)x[0] * (double)y[2]) - rtt_d((double)y[0] * (double)x[2]));
    wd = rtt_d(rtt_d((double)x[1] * (double)y[0]) - rtt_d((double)y[1] * (double)x[0]));
    if ((ud < 0 || vd < 0 || wd < 0) && (ud > 0 || vd > 0 || wd > 0))
        return false;
    det = rtt_d(rtt_d(ud + vd) + wd);
    if (det == 0)
        return false;
    t = rtt_d(rtt_d(rtt_d(ud * z[0]) + rtt_d(vd * z[1])) + rtt_d(wd * z[2]));
    r = rtt_d(1.0 / det);
    hit->t = (float)rtt_d(rtt_d(t * r) * rtt_d(1.0 / (double)s->dir[s->kz]));
    hit->u = (float)rtt_d(vd * r);
    hit->v = (float)rtt_d(wd * r);
    return true;
}

static double rtt_dot(const double a[3], const double b[3])
{
    return rtt_d(rtt_d(rtt_d(a[0] * b[0]) + rtt_d(a[1] * b[1])) + rtt_d(a[2] * b[2]));
}

static bool rtt_meet_sphere(const rt_ray *ray, const rt_sphere *sphere, rt_hit *hit)
{
    double d[3] = { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z }, oc[3], l[3];
    double radius = (double)sphere->radius, a, b, c, k, q, disc, s, nearer, farther;

    oc[0] = rtt_d((double)sphere->center.x - (double)ray->org.x);
    oc[1] = rtt_d((double)sphere->center.y - (double)ray->org.y);
    oc[2] = rtt_d((double)sphere->center.z - (double)ray->org.z);
    a = rtt_dot(d, d);
    b = rtt_dot(oc, d);
    k = rtt_d(b / a);
    for (int i = 0; i < 3; i++)
        l[i] = rtt_d(oc[i] - rtt_d(k * d[i]));
    disc = rtt_d(rtt_d(radius * radius) - rtt_dot(l, l));
    if (disc < 0)
        return false;
    s = rtt_d(sqrt(rtt_d(a * disc)));
    c = rtt_d(rtt_dot(oc, oc) - rtt_d(radius * radius));
    q = b >= 0 ? rtt_d(b + s) : rtt_d(b - s);
    nearer = disc == 0 ? k : b >= 0 ? rtt_d(c / q) : rtt_d(q / a);
    farther = disc == 0 ? k : b >= 0 ? rtt_d(q / a) : rtt_d(c / q);
    hit->t = (float)nearer > ray->tmin ? (float)nearer : (float)farther;
    hit->u = hit->v = 0;
    return true;
}

static bool rtt_meet_plane(const rt_ray *ray, const rt_plane *plane, rt_hit *hit)
{
    double dir[3] = { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z }, to[3], off[3], t;
    double normal[3] = { (double)plane->normal.x, (double)plane->normal.y, (double)plane->normal.z };

    to[0] = rtt_d((double)plane->point.x - (double)ray->org.x);
    to[1] = rtt_d((double)plane->point.y - (double)ray->org.y);
    to[2] = rtt_d((double)plane->point.z - (double)ray->org.z);
    t = rtt_d(rtt_dot(normal, to) / rtt_dot(normal, dir));
    if (!isfinite(t))
        return false;
    for (int i = 0; i < 3; i++)
        off[i] = rtt_d(rtt_d(t * dir[i]) - to[i]);
    if (plane->radius > 0 && rtt_dot(off, off) > rtt_d((double)plane->radius * (double)plane->radius))
        return false;
    hit->t = (float)t;
    hit->u = hit->v = 0;
    return true;
}

/* The ray before a motion, by what rt.h says of it: its own polynomials, all in double, each operation rounded by itself. */
static rt_ray rtt_before_motion(const rt_motion *motion, float time, const rt_ray *ray)
{
    static const double sine[] = { 1, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800, 1.0 / 6227020800.0, -1.0 / 1307674368000.0 };
    static const double cosine[] = { 1, -0.5, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600.0, -1.0 / 87178291200.0 };
    const double axis[3] = { (double)motion->axis.x, (double)motion->axis.y, (double)motion->axis.z };
    const double pivot[3] = { (double)motion->pivot.x, (double)motion->pivot.y, (double)motion->pivot.z };
    const double move[3] = { (double)motion->move.x, (double)motion->move.y, (double)motion->move.z };
    const double org[3] = { (double)ray->org.x, (double)ray->org.y, (double)ray->org.z };
    double r[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, k[3], off[3], dir[3] = { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z };
    float o[3], d[3];
    rt_ray out = *ray;

    if (motion->angle != 0) {
        double angle = rtt_d((double)motion->angle * (double)time), quarters = floor(rtt_d(angle * 0.63661977236758134) + 0.5), x, y, s, c, most = 0;
        double length;
        int quarter = (int)quarters & 3;

        x = rtt_d(rtt_d(angle - rtt_d(quarters * 1.5707963267341256)) - rtt_d(quarters * 6.0771005065061922e-11));
        y = rtt_d(x * x);
        s = sine[7], c = cosine[7];
        for (int i = 6; i > 0; i--) {
            s = rtt_d(rtt_d(s * y) + sine[i]);
            c = rtt_d(rtt_d(c * y) + cosine[i]);
        }
        s = rtt_d(x + rtt_d(x * rtt_d(s * y)));
        c = rtt_d(1 + rtt_d(c * y));
        if (quarter & 1) {
            y = s;
            s = c;
            c = -y;
        }
        if (quarter & 2)
            s = -s, c = -c;
        for (int i = 0; i < 3; i++)
            most = fmax(most, fabs(axis[i]));
        for (int i = 0; i < 3; i++)
            k[i] = rtt_d(axis[i] / most);
        length = rtt_d(sqrt(rtt_dot(k, k)));
        for (int i = 0; i < 3; i++)
            k[i] = rtt_d(k[i] / length);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                double part = rtt_d(rtt_d(k[i] * k[j]) * rtt_d(1 - c));

                if (i == j)
                    r[i][j] = rtt_d(c + part);
                else
                    r[i][j] = j == (i + 1) % 3 ? rtt_d(part - rtt_d(k[3 - i - j] * s)) : rtt_d(part + rtt_d(k[3 - i - j] * s));
            }
    }
    for (int i = 0; i < 3; i++)
        off[i] = rtt_d(rtt_d(org[i] - rtt_d(move[i] * (double)time)) - pivot[i]);
    for (int i = 0; i < 3; i++) {
        double column[3] = { r[0][i], r[1][i], r[2][i] };

        o[i] = (float)rtt_d(rtt_dot(column, off) + pivot[i]);
        d[i] = (float)rtt_dot(column, dir);
    }
    memcpy(&out.org, o, sizeof o);
    memcpy(&out.dir, d, sizeof d);
    return out;
}

/* The inverse of a 3x4 transform; false where it has none. */
static bool rtt_invert(const float m[12], float inverse[12])
{
    double c[9], det, i[12];

    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++) {           /* entry (row, column) of the inverse: cofactor (column, row) */
            const float *p = m + 4 * ((column + 1) % 3), *q = m + 4 * ((column + 2) % 3);
            int a = (row + 1) % 3, b = (row + 2) % 3;

            c[3 * row + column] = rtt_d(rtt_d((double)p[a] * (double)q[b]) - rtt_d((double)p[b] * (double)q[a]));
        }
    det = rtt_d(rtt_d(rtt_d((double)m[0] * c[0]) + rtt_d((double)m[1] * c[3])) + rtt_d((double)m[2] * c[6]));
    for (int row = 0; row < 3; row++) {
        double t[3] = { (double)m[3], (double)m[7], (double)m[11] };

        for (int column = 0; column < 3; column++)
            i[4 * row + column] = rtt_d(c[3 * row + column] / det);
        i[4 * row + 3] = -rtt_dot(i + 4 * row, t);
    }
    for (int k = 0; k < 12; k++) {
        inverse[k] = (float)i[k];
        if (!isfinite(inverse[k]))
            det = 0;
    }
    return det != 0;
}

static rt_ray rtt_to_object(const float inverse[12], const rt_ray *ray)
{
    double org[3] = { (double)ray->org.x, (double)ray->org.y, (double)ray->org.z };
    double dir[3] = { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z };
    float o[3], d[3];
    rt_ray object = *ray;

    for (int k = 0; k < 3; k++) {
        double row[3] = { (double)inverse[4 * k], (double)inverse[4 * k + 1], (double)inverse[4 * k + 2] };

        o[k] = (float)rtt_d(rtt_dot(row, org) + (double)inverse[4 * k + 3]);
        d[k] = (float)rtt_dot(row, dir);
    }
    memcpy(&object.org, o, sizeof o);
    memcpy(&object.dir, d, sizeof d);
    return object;
}

/* Instance paths below a model: what one more instance of it takes from the numbers. */
static uint32_t rtt_paths(const rtt_model *model)
{
    uint32_t count = 0;

    for (size_t i = 0; i < model->instance_count; i++)
        count += 1 + rtt_paths(model->children[i]);
    return count;
}

/* Is primitive prim one that rt_build must refuse? */
static bool rtt_bad(const rtt_model *model, size_t prim)
{
    const rt_sphere *sphere;
    float inverse[12];

    if (prim < model->triangle_count) {
        for (size_t i = 0; i < 3; i++) {
            size_t vertex = model->indices ? model->indices[3 * prim + i] : 3 * prim + i;

            if (vertex >= model->vertex_count || !rtt_in_range(model->vertices + 3 * vertex, 3))
                return true;
        }
        return false;
    }
    prim -= model->triangle_count;
    if (prim < model->sphere_count) {
        sphere = &model->spheres[prim];
        return !rtt_in_range(&sphere->center.x, 3) || !(sphere->radius >= 0) || !(sphere->radius <= RT_MAX_COORDINATE);
    }
    prim -= model->sphere_count;
    if (prim < model->instance_count)
        return !rtt_invert(model->instances[prim].transform, inverse);
    return !rtt_in_range(&model->planes[prim - model->instance_count].point.x, 3);
}

static void rtt_offer(rt_hit *best, const rt_ray *ray, rt_hit *hit, size_t prim, uint32_t inst)
{
    hit->prim = (uint32_t)prim;
    hit->inst = inst;
    if (ray->tmin < hit->t && hit->t < ray->tmax
        && (best->prim == RT_NONE || hit->t < best->t
            || (hit->t == best->t && (inst < best->inst || (inst == best->inst && hit->prim < best->prim)))))
        *best = *hit;
}

/* Puts the closer of *best and what ray hits into *best. inst: the path that led here; first: the number of the first path below. */
static void rtt_search(const rtt_model *model, const rt_ray *ray, float time, uint32_t inst, uint32_t first, rt_hit *best)
{
    rtt_shear shear;
    rt_hit hit;

    if (!rtt_legal(ray))
        return;
    shear = rtt_shear_of(ray);
    for (size_t i = 0; i < model->triangle_count; i++) {
        const float *corner[3];

        if (model->skip_invalid && rtt_bad(model, i))
            continue;
        for (size_t k = 0; k < 3; k++)
            corner[k] = model->vertices + 3 * (model->indices ? (size_t)model->indices[3 * i + k] : 3 * i + k);
        if (rtt_meet_triangle(&shear, corner, &hit))
            rtt_offer(best, ray, &hit, i, inst);
    }
    for (size_t i = 0; i < model->sphere_count; i++)
        if (!(model->skip_invalid && rtt_bad(model, model->triangle_count + i)) && rtt_meet_sphere(ray, &model->spheres[i], &hit))
            rtt_offer(best, ray, &hit, model->triangle_count + i, inst);
    for (size_t i = 0; i < model->instance_count; i++) {
        float inverse[12];

        if (rtt_invert(model->instances[i].transform, inverse)) {
            rt_ray object = *ray;

            if (model->instances[i].motion)
                object = rtt_before_motion(model->instances[i].motion, time, ray);
            object = rtt_to_object(inverse, &object);
            rtt_search(model->children[i], &object, time, first, first + 1, best);
        }
        first += 1 + rtt_paths(model->children[i]);
    }
    for (size_t i = 0; i < model->plane_count; i++) {
        size_t prim = model->triangle_count + model->sphere_count + model->instance_count + i;

        if (!(model->skip_invalid && rtt_bad(model, prim)) && rtt_meet_plane(ray, &model->planes[i], &hit))
            rtt_offer(best, ray, &hit, prim, inst);
    }
}

static const rt_hit rtt_miss = { INFINITY, 0, 0, RT_NONE, RT_NONE };

static rt_hit rtt_closest(const rtt_model *model, const rt_ray *ray)
{
    rt_hit best = rtt_miss;

    rtt_search(model, ray, 0, RT_NONE, 0, &best);
    return best;
}

static rt_hit rtt_closest_at(const rtt_model *model, const rt_ray *ray, float time)
{
    rt_hit best = rtt_miss;

    rtt_search(model, ray, time > 0 ? time < 1 ? time : 1 : 0, RT_NONE, 0, &best);
    return best;
}

/* What RT_ANY answers where RT_CLOSEST answers closest. */
static rt_hit rtt_any(rt_hit closest)
{
    rt_hit any = { 0, 0, 0, 0, RT_NONE };

    return closest.prim == RT_NONE ? closest : any;
}

/* ---- >>rays --------------------------------------------------------------------------------------------------------- */

typedef struct { rt_ray *ray; size_t count; float *time; } rtt_rays;      /* time NULL: all 0 */

static void rtt_rays_free(rtt_rays *rays)
{
    free(rays->ray);
    free(rays->time);
    memset(rays, 0, sizeof *rays);
}

static void rtt_segment(rtt_rays *rays, rt_vec3 org, rt_vec3 dir, float tmin, float tmax)
{
    rt_ray *ray;

    rays->ray = (rt_ray *)rtt_grow(rays->ray, rays->count, sizeof(rt_ray));
    ray = &rays->ray[rays->count++];
    ray->org = org, ray->dir = dir;
    ray->tmin = tmin, ray->tmax = tmax;
}

static void rtt_aim(rtt_rays *rays, rt_vec3 org, rt_vec3 target) { rtt_segment(rays, org, rtt_sub(target, org), 0, INFINITY); }

/* No two neighbours alike, around the cube of half width size: from near and far, along axes, and finite segments. */
static void rtt_rays_mixed(rtt_rays *rays, rtt_random *random, rt_vec3 center, float size, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        rt_vec3 from = rtt_point(random, center, 2 * size), to = rtt_point(random, center, size);

        switch (i % 4) {
        case 0: rtt_aim(rays, from, to); break;
        case 1: rtt_aim(rays, rtt_point(random, center, 64 * size), to); break;
        case 2: rtt_segment(rays, from, rtt_axis(rtt_below(random, 6)), -size, INFINITY); break;
        default: rtt_segment(rays, from, rtt_sub(to, from), 0, 1); break;
        }
    }
}

/* What a camera at eye sends through a square of half width size in the z plane of center: width * width neighbours. */
static void rtt_rays_pinhole(rtt_rays *rays, rt_vec3 eye, rt_vec3 center, float size, int width)
{
    for (int y = 0; y < width; y++)
        for (int x = 0; x < width; x++) {
            rt_vec3 p = rtt_v((float)(2 * x + 1 - width), (float)(2 * y + 1 - width), 0);

            rtt_aim(rays, eye, rtt_add(center, rtt_mul(p, rtt_f(size / (float)width))));
        }
}

static rt_vec3 rtt_transform(const float m[12], rt_vec3 p)
{
    float out[3];

    for (int k = 0; k < 3; k++) {
        const float *row = m + 4 * k;

        out[k] = rtt_f(rtt_f(rtt_f(rtt_f(row[0] * p.x) + rtt_f(row[1] * p.y)) + rtt_f(row[2] * p.z)) + row[3]);
    }
    return rtt_v(out[0], out[1], out[2]);
}

/* Somewhere that rays get lost: a corner, a point of an edge, the inside of a triangle, the extreme of a sphere; of an instance too. */
static rt_vec3 rtt_feature(const rtt_model *model, rtt_random *random)
{
    size_t prims = model->triangle_count + model->sphere_count, pick;
    rt_vec3 p, q;

    if (prims + model->instance_count == 0)
        return rtt_origin;
    if (model->instance_count && (!prims || rtt_bits(random) & 1)) {
        pick = rtt_below(random, (uint32_t)model->instance_count);
        return rtt_transform(model->instances[pick].transform, rtt_feature(model->children[pick], random));
    }
    pick = rtt_below(random, (uint32_t)prims);
    if (pick >= model->triangle_count) {
        const rt_sphere *sphere = &model->spheres[pick - model->triangle_count];

        return rtt_add(sphere->center, rtt_mul(rtt_axis(rtt_below(random, 6)), sphere->radius));
    }
    p = rtt_corner(model, pick, rtt_below(random, 3));
    for (uint32_t blends = rtt_below(random, 3); blends > 0; blends--) {
        q = rtt_corner(model, pick, rtt_below(random, 3));
        p = rtt_add(rtt_mul(p, 0.5f), rtt_mul(q, 0.5f));
    }
    return p;
}

/* At features, from origins about distance away, and along axes. */
static void rtt_rays_features(rtt_rays *rays, rtt_random *random, const rtt_model *model, float distance, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        rt_vec3 target = rtt_feature(model, random), axis = rtt_axis(rtt_below(random, 6));

        if (i % 2)
            rtt_aim(rays, rtt_point(random, target, distance), target);
        else
            rtt_segment(rays, rtt_sub(target, rtt_mul(axis, distance)), axis, 0, INFINITY);
    }
}

/* For some rays that hit, the same with an interval that ends or starts on the hit, and just beside it. */
static void rtt_rays_tighten(rtt_rays *rays, const rtt_model *model, size_t count)
{
    size_t given = rays->count, step = given / (count ? count : 1) + 1;

    for (size_t i = 0; i < given; i += step) {
        rt_ray ray = rays->ray[i];
        float t = rtt_closest(model, &ray).t;

        if (!isfinite(t))
            continue;
        rtt_segment(rays, ray.org, ray.dir, ray.tmin, t);
        rtt_segment(rays, ray.org, ray.dir, ray.tmin, nextafterf(t, INFINITY));
        rtt_segment(rays, ray.org, ray.dir, t, ray.tmax);
        rtt_segment(rays, ray.org, ray.dir, nextafterf(t, -INFINITY), ray.tmax);
    }
}

/* ---- >>compare: every way to trace against the oracle --------------------------------------------------------------- */

/* One setting of the query options; the table holds all that this build and processor take. */
typedef struct {
    rt_trace_options options;
    rt_structure structure;                 /* RT_STRUCTURE_COUNT: any */
    bool large;
    char label[64];
} rtt_way;

static rtt_way rtt_ways[512];
static size_t rtt_way_count;

#define RTT_NAME(name, text) text,
static const char *const rtt_isa_names[] = { RT_ISA_LIST(RTT_NAME) };
static const char *const rtt_cull_names[] = { RT_CULL_LIST(RTT_NAME) };
static const char *const rtt_structure_names[] = { RT_STRUCTURE_LIST(RTT_NAME) };

/* Has any algorithm of it been built? */
static bool rtt_structure_built(rt_structure structure)
{
    const rt_algorithm_info *info;

    for (size_t i = 0; (info = rt_algorithm_get(i)) != NULL; i++)
        if (info->structure == structure && info->built)
            return true;
    return false;
}

/* Adds the way unless the library, asked with no rays on an empty accel, says that it cannot go it; with the automatic ISA and no
   culling it must. */
static void rtt_way_add(rt_accel *const *empty, const rt_algorithm_info *info, int width, rt_isa isa, rt_cull cull, int short_stack)
{
    for (int query = RT_CLOSEST; query <= RT_ANY; query++) {
        rtt_way *way = &rtt_ways[rtt_way_count];
        rt_status status;

        if (rtt_way_count == RTT_COUNT(rtt_ways))
            rtt_die("too many ways to trace");
        memset(way, 0, sizeof *way);
        way->structure = info->structure;
        way->large = info->culls;
        way->options.algorithm = info->algorithm;
        way->options.packet_width = width;
        way->options.isa = isa;
        way->options.cull = cull;
        way->options.query = (rt_query)query;
        way->options.short_stack = short_stack;
        snprintf(way->label, sizeof way->label, "%s:%d/%d/%s/%s/%s", info->name, short_stack, width, rtt_isa_names[isa],
                 rtt_cull_names[cull], query == RT_ANY ? "any" : "closest");
        status = rt_trace(empty[info->structure == RT_STRUCTURE_COUNT ? RT_BVH : info->structure], &way->options, NULL, 0, NULL);
        if (status == RT_OK)
            rtt_way_count++;
        else if (isa == RT_ISA_AUTO && cull == RT_CULL_NONE)
            rtt_fail("%s: %s", way->label, rt_status_string(status));
    }
}

static void rtt_ways_find(void)
{
    static const int entries[] = { 0, 1, 2, 3, 8, RT_MAX_SHORT_STACK };
    rt_accel *empty[RT_STRUCTURE_COUNT] = { NULL };
    const rt_algorithm_info *info;
    rt_geometry nothing;

    memset(&nothing, 0, sizeof nothing);
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++)
        if (rtt_structure_built((rt_structure)s)) {
            rt_build_options options;

            memset(&options, 0, sizeof options);
            options.structure = (rt_structure)s;
            CHECK_STATUS(rt_build(&empty[s], &nothing, &options), RT_OK);
        }
    for (size_t i = 0; (info = rt_algorithm_get(i)) != NULL; i++) {
        int widths[64];
        size_t count = rt_packet_widths(info->algorithm, widths, RTT_COUNT(widths));

        if (!info->built)
            continue;
        for (int isa = 0; isa < RT_ISA_COUNT; isa++)
            for (int cull = 0; cull < RT_CULL_COUNT && isa != (int)rt_best_isa(); cull++) {        /* the best is what auto picks */
                if (isa == RT_ISA_AUTO)
                    rtt_way_add(empty, info, 0, RT_ISA_AUTO, (rt_cull)cull, 0);
                for (size_t w = 0; w < count && w < RTT_COUNT(widths); w++)
                    for (size_t e = 0; e < (info->algorithm == RT_KD_SHORTSTACK ? RTT_COUNT(entries) : 1); e++)
                        rtt_way_add(empty, info, widths[w], (rt_isa)isa, (rt_cull)cull, entries[e]);
            }
    }
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++)
        rt_free(empty[s]);
}

static bool rtt_same(rt_hit a, rt_hit b) { return memcmp(&a, &b, sizeof a) == 0; }

/* Compares what one way answers with what is expected. The first ray that differs is told in hexadecimal, if told at all. */
static bool rtt_compare(const char *what, const char *way, const rtt_rays *rays, const rt_hit *got, const rt_hit *want, bool any, bool tell)
{
    for (size_t i = 0; i < rays->count; i++) {
        rt_hit expected = any ? rtt_any(want[i]) : want[i];
        const rt_ray *r = &rays->ray[i];

        if (rtt_same(got[i], expected))
            continue;
        if (tell)
            rtt_fail("%s, %s, ray %zu of %zu: org {%a,%a,%a} tmin %a dir {%a,%a,%a} tmax %a\n"
                     "        got      t %a u %a v %a prim %u inst %u\n        expected t %a u %a v %a prim %u inst %u",
                     what, way, i, rays->count, (double)r->org.x, (double)r->org.y, (double)r->org.z, (double)r->tmin, (double)r->dir.x,
                     (double)r->dir.y, (double)r->dir.z, (double)r->tmax, (double)got[i].t, (double)got[i].u, (double)got[i].v, got[i].prim,
                     got[i].inst, (double)expected.t, (double)expected.u, (double)expected.v, expected.prim, expected.inst);
        return false;
    }
    return true;
}

/* ---- >>device: the same on OpenCL ---- */

/* One context for all cases, with programs that serve any scene: few of them. What each does for a scene is in >>gpu. */
static struct {
    rt_gpu *gpu;
    rtt_memory memory;
    rtt_way ways[512];                      /* all that there are kernels for, as rt_gpu_widths tells */
    size_t way_count;
} rtt_device;

static void rtt_device_add(const rt_algorithm_info *info, int width, rt_cull cull, int short_stack, bool often)
{
    for (int query = RT_CLOSEST; query <= RT_ANY; query++) {
        rtt_way *way = &rtt_device.ways[rtt_device.way_count++];

        if (rtt_device.way_count == RTT_COUNT(rtt_device.ways))
            rtt_die("too many kernels");
        memset(way, 0, sizeof *way);
        way->structure = info->structure;
        way->large = !often;
        way->options.algorithm = info->algorithm;
        way->options.packet_width = width;
        way->options.cull = cull;
        way->options.query = (rt_query)query;
        way->options.short_stack = short_stack;
        snprintf(way->label, sizeof way->label, "gpu %s:%d/%d/%s/%s", info->name, short_stack, width, rtt_cull_names[cull],
                 query == RT_ANY ? "any" : "closest");
    }
}

/* Each algorithm once, often: with a packet width that suits cases of few rays; the others, less often: all widths, culls, entries. */
static void rtt_device_open(void)
{
    static const int entries[] = { 0, 1, 2, RT_MAX_SHORT_STACK };
    const rt_algorithm_info *info;
    rt_gpu_options options;
    rt_error error;

    memset(&options, 0, sizeof options);
    options.general = true;
    options.memory_user = &rtt_device.memory;
    options.inexact = rtt.any_gpu;
    options.error = &error;
    if (rt_gpu_open(&rtt_device.gpu, &options) != RT_OK) {
        rtt_fail("rt_gpu_open: %s (Debian: pocl-opencl-icd, ocl-icd-libopencl1)", error.message);
        return;
    }
    for (size_t i = 0; (info = rt_algorithm_get(i)) != NULL; i++) {
        int widths[16];
        size_t count = rt_gpu_widths(info->algorithm, widths, RTT_COUNT(widths));

        CHECK(count > 0 || !info->built || info->algorithm == RT_AUTO);
        for (size_t w = 0; w < count; w++)
            for (size_t c = 0; c < (info->culls ? RT_CULL_COUNT : 1); c++)
                for (size_t e = 0; e < (info->algorithm == RT_KD_SHORTSTACK && w == 0 ? RTT_COUNT(entries) : 1); e++)
                    rtt_device_add(info, widths[w], (rt_cull)c, entries[e],
                                   info->culls ? widths[w] == 8 && c == RT_CULL_BOTH : w < 2);
    }
}

/* One of the device's ways; got: room for the hits. */
static bool rtt_compare_kernel(rt_gpu *gpu, const char *what, const rt_gpu_accel *there, const rtt_way *way, const rtt_rays *rays,
                               rt_hit *got, const rt_hit *want, bool tell)
{
    rt_trace_options options = way->options;
    rt_status status;
    rt_error error;

    options.times = rays->time;
    options.error = &error;
    memset(got, 0xcc, rays->count * sizeof *got);
    status = rt_gpu_trace(gpu, there, &options, rays->ray, rays->count, got);
    if (status == RT_ERROR_UNSUPPORTED && options.packet_width == RT_MAX_PACKET && strstr(error.message, "local memory"))
        return true;                        /* of which OpenCL asks for less of a device */
    if (status != RT_OK) {
        rtt_fail("%s, %s: %s", what, way->label, error.message);
        return false;
    }
    return rtt_compare(what, way->label, rays, got, want, options.query == RT_ANY, tell);
}

#ifndef RT_NO_SHADING
/* Renders the tile on a device too: the same pixels and numbers of rays. What no kernel has is traced by another: pictures are the same. */
static void rtt_compare_pictures(rt_gpu *gpu, const char *what, const rt_scene *scene, const rt_render_options *opt, const int tile[4],
                                 const rt_vec3 *want, const rt_ray_counts *rays)
{
    const size_t width = (size_t)opt->width, count = width * (size_t)opt->height;
    rt_vec3 *got = (rt_vec3 *)rtt_array(count ? count : 1, sizeof *got);
    rt_render_options options = *opt;
    rt_gpu_scene *there = NULL;
    rt_ray_counts counts = { 0, 0, 0, 0 };
    rt_error error = { RT_OK, 0, "" };
    int widths[16];
    size_t known = rt_gpu_widths(opt->trace.algorithm, widths, RTT_COUNT(widths)), wrong = 0, first = 0;
    bool fits = opt->trace.packet_width == 0;
    rt_status status;

    for (size_t i = 0; i < known && i < RTT_COUNT(widths); i++)
        fits |= widths[i] == opt->trace.packet_width;
    if (opt->trace.algorithm == RT_AUTO || !known || !fits)
        memset(&options.trace, 0, sizeof options.trace);
#ifndef RT_NO_STATS
    options.trace.stats = NULL;
#endif
    options.trace.error = &error;
    for (size_t i = 0; opt->counts && i < count; i++)
        if (!opt->counts[i])
            got[i] = want[i];               /* what is to stay as it is */
    status = rt_gpu_upload_scene(gpu, &there, scene, &error);
    if (status == RT_OK)
        status = rt_gpu_render_tile(gpu, there, &options, tile[0], tile[1], tile[2], tile[3], got, &counts);
    if (status != RT_OK)
        rtt_fail("%s: %s\n%.2000s", what, error.message, rt_gpu_log(gpu));
    for (int y = tile[1]; y < tile[3] && status == RT_OK; y++)
        for (int x = tile[0]; x < tile[2]; x++) {
            const size_t at = (size_t)y * width + (size_t)x;
            if (memcmp(&want[at], &got[at], sizeof *got) != 0 && wrong++ == 0)
                first = at;
        }
    if (wrong)
        rtt_fail("%s: %zu pixels are others on the device, the first is %zu: %a %a %a, not %a %a %a", what, wrong, first, (double)got[first].x,
                 (double)got[first].y, (double)got[first].z, (double)want[first].x, (double)want[first].y, (double)want[first].z);
    if (status == RT_OK && memcmp(&counts, rays, sizeof counts) != 0)
        rtt_fail("%s: %lu %lu %lu %lu rays on the device, not %lu %lu %lu %lu", what, (unsigned long)counts.primary, (unsigned long)counts.shadow,
                 (unsigned long)counts.reflect, (unsigned long)counts.refract, (unsigned long)rays->primary, (unsigned long)rays->shadow,
                 (unsigned long)rays->reflect, (unsigned long)rays->refract);
    rt_gpu_free_scene(there);
    free(got);
}

/* In the place of rt_render_tile: every whole picture that a test draws, but the largest, is drawn on the device too; of a series of frames of
   a few pixels, which take a device as long as large ones, the first. */
static rt_status rtt_render_tile(const rt_scene *scene, const rt_render_options *opt, int x0, int y0, int x1, int y1, rt_vec3 *pixels,
                                 rt_ray_counts *rays)
{
    const int tile[4] = { x0, y0, x1, y1 };
    rt_ray_counts counts = { 0, 0, 0, 0 };
    const rt_status status = rt_render_tile(scene, opt, x0, y0, x1, y1, pixels, &counts);

    if (status == RT_OK && rtt_device.gpu && x0 == 0 && y0 == 0 && x1 == opt->width && y1 == opt->height && counts.primary < 65536 &&
        (opt->frame == 0 || opt->width * opt->height >= 16))
        rtt_compare_pictures(rtt_device.gpu, "a picture", scene, opt, tile, pixels, &counts);
    if (status == RT_OK && rays) {
        rays->primary += counts.primary;
        rays->shadow += counts.shadow;
        rays->reflect += counts.reflect;
        rays->refract += counts.refract;
    }
    return status;
}
#define rt_render_tile(scene, opt, x0, y0, x1, y1, pixels, rays) rtt_render_tile(scene, opt, x0, y0, x1, y1, pixels, rays)
#endif

/* The device's ways, those that are often used by turns as rtt_compare_ways has it, or all (every 0). */
static void rtt_compare_device(rt_gpu *gpu, const char *what, const rt_accel *accel, const rtt_rays *rays, const rt_hit *want, bool backtrack,
                               size_t turn, size_t every)
{
    rt_hit *got = (rt_hit *)rtt_array(rays->count, sizeof *got);
    size_t wrong = 0;
    rt_gpu_accel *there = NULL;
    rt_error error;
    rt_info info;

    rt_get_info(accel, &info);
    if (every && info.nesting > 3)
        every *= 7;                         /* each needs a large program of its own */
    if (rt_gpu_upload(gpu, &there, accel, &error) != RT_OK)
        rtt_fail("%s: rt_gpu_upload: %s", what, error.message);
    for (size_t w = 0; there && w < rtt_device.way_count; w++) {
        const rtt_way *way = &rtt_device.ways[w];

        if (way->structure != info.structure || (every && (way->large || (w + turn) % every != 0))
            || (way->options.algorithm == RT_KD_BACKTRACK && !backtrack))
            continue;
        if (!every && rt_algorithm_get(way->options.algorithm)->culls)
            continue;                       /* gpu.small and gpu.large have them */
        wrong += !rtt_compare_kernel(gpu, what, there, way, rays, got, want, wrong == 0);
    }
    if (wrong)
        rtt_fail("%s: %zu kernels are wrong", what, wrong);
    rt_gpu_free(there);
    free(got);
}

/* Traces rays every way that suits accel's structure and compares with want: each way whose turn, of every many, it is; of large packets,
   which are most of the ways, of 7 times as many. */
static void rtt_compare_ways(const char *what, const rt_accel *accel, const rtt_rays *rays, const rt_hit *want, bool backtrack,
                             size_t turn, size_t every)
{
    rt_hit *got = (rt_hit *)rtt_array(rays->count, sizeof *got);
    size_t calls = rtt_heap.calls, wrong = 0;
    rt_info info;

    if (rtt.scale > 1 && every < 5)
        every = 5;
    rt_get_info(accel, &info);
    for (size_t w = 0; w < rtt_way_count; w++) {
        rtt_way *way = &rtt_ways[w];

        way->options.times = rays->time;
        if ((way->structure != RT_STRUCTURE_COUNT && way->structure != info.structure)
            || (w + turn) % (way->large ? 7 * every : every) != 0)
            continue;
        if (way->options.algorithm == RT_KD_BACKTRACK && !backtrack)
            continue;
        if (rti_only_wide(accel) && way->options.algorithm != RT_BVH_WIDE && way->options.algorithm != RT_AUTO)
            continue;
        memset(got, 0xcc, rays->count * sizeof *got);
        CHECK_STATUS(rt_trace(accel, &way->options, rays->ray, rays->count, got), RT_OK);
        wrong += !rtt_compare(what, way->label, rays, got, want, way->options.query == RT_ANY, wrong == 0);
    }
    if (wrong)
        rtt_fail("%s: %zu ways to trace are wrong", what, wrong);
    for (size_t w = 0; w < rtt_way_count; w++)
        rtt_ways[w].options.times = NULL;
    for (size_t i = 0; i < rays->count && !rays->time; i++) {
        memset(&got[i], 0xcc, sizeof got[i]);
        if (rt_intersect(accel, &rays->ray[i], &got[i]) != (want[i].prim != RT_NONE))
            rtt_fail("%s: rt_intersect's answer for ray %zu", what, i);
        if (rt_occluded(accel, &rays->ray[i]) != (want[i].prim != RT_NONE))
            rtt_fail("%s: rt_occluded's answer for ray %zu", what, i);
    }
    if (!rays->time)
        rtt_compare(what, "rt_intersect", rays, got, want, false, wrong == 0);
    CHECK(rtt_heap.calls == calls);         /* a query allocates nothing */
    free(got);
}

static void rtt_compare_all(const char *what, const rt_accel *accel, const rtt_rays *rays, const rt_hit *want)
{
    static size_t turn;

    rtt_compare_ways(what, accel, rays, want, true, turn++, 1);
}

/* The tree's own invariants, then what rt_get_info says of it. */
static void rtt_check_accel(const char *what, const rt_accel *accel, const rt_geometry *geometry)
{
    size_t prims = geometry->triangle_count + geometry->sphere_count + geometry->instance_count, hollow = 0;
    size_t planes = geometry->plane_count;
    rt_info info;
    bool kdtree;

    if (!rti_validate(accel))
        rtt_fail("%s: rti_validate", what);
    rt_get_info(accel, &info);
    if (info.triangles != geometry->triangle_count || info.spheres != geometry->sphere_count || info.instances != geometry->instance_count
        || info.planes != planes)
        rtt_fail("%s: rt_info counts", what);
    kdtree = info.structure == RT_KDTREE;
    for (size_t i = 0; i < geometry->instance_count; i++) {            /* an instance of nothing is in no leaf */
        rt_info child;

        if (!geometry->instances[i].accel)
            continue;
        rt_get_info(geometry->instances[i].accel, &child);
        hollow += child.lower.x > child.upper.x;
    }
    if ((info.structure == RT_THREADED || rti_only_wide(accel) ? info.nodes < info.leaves || info.nodes > 2 * info.leaves : info.nodes != (info.leaves ? 2 * info.leaves - 1 : 0))
        || info.leaves < info.empty_leaves || info.max_leaf > prims || info.depth < 0
        || info.depth > RTI_MAX_DEPTH || !(info.sah >= 0) || (!kdtree && (info.empty_leaves || info.leaves > prims))
        || info.references < info.leaves - info.empty_leaves || info.references > (info.leaves - info.empty_leaves) * info.max_leaf
        || info.references + info.skipped + hollow < prims || (!kdtree && info.references > prims - info.skipped))
        rtt_fail("%s: rt_info: %zu nodes, %zu leaves, %zu empty, %zu references of %zu, leaf of %zu, depth %d, sah %g", what, info.nodes,
                 info.leaves, info.empty_leaves, info.references, prims, info.max_leaf, info.depth, info.sah);
    if (!planes && (prims == info.skipped) != (info.lower.x > info.upper.x))
        rtt_fail("%s: rt_info bounds", what);
}

/* As rt_parallel_for demands, yet backwards: an order that no builder expects. *user counts the calls. */
static void rtt_backwards(void *user, size_t count, void (*body)(void *context, size_t index), void *context)
{
    ++*(size_t *)user;
    while (count-- > 0)
        body(context, count);
}

/* Ways to build that rtt_check goes. Where there are many ways to trace, a build tries one of every so many, by turns: odd,
   since closest and any take turns in the table. */
static const struct { rt_build_options options; bool parallel; size_t every, device; } rtt_builds[] = {
    { { .structure = RT_BVH }, false, 1, 1 },
    { { .structure = RT_BVH, .quality = RT_BUILD_FAST, .reference = true }, true, 1, 9 },
    { { .structure = RT_BVH, .quality = RT_BUILD_HIGH }, false, 1, 9 },
    { { .structure = RT_BVH, .traversal_cost = 0.01f }, false, 4, 9 },
    { { .structure = RT_KDTREE }, false, 3, 1 },
    { { .structure = RT_KDTREE, .quality = RT_BUILD_FAST, .reference = true }, true, 11, 9 },
    { { .structure = RT_KDTREE, .quality = RT_BUILD_HIGH, .traversal_cost = 0.25f, .max_duplication = 16 }, false, 11, 9 },
    { { .structure = RT_KDTREE, .traversal_cost = 4, .empty_bonus = 0.9f }, false, 11, 9 },
    { { .structure = RT_KDTREE, .empty_bonus = -1, .max_duplication = 1, .no_backtrack = true }, false, 11, 9 },
    { { .structure = RT_THREADED }, false, 1, 1 },
    { { .structure = RT_THREADED, .bounds = RT_BOUNDS_SPHERES }, false, 1, 9 },
    { { .structure = RT_THREADED, .quality = RT_BUILD_FAST, .reference = true, .branching = 2, .orders = 1 }, true, 3, 9 },
    { { .structure = RT_THREADED, .bounds = RT_BOUNDS_SPHERES, .quality = RT_BUILD_HIGH, .branching = 7, .orders = 4, .throw_back = 1e-6f }, false, 3, 9 },
    { { .structure = RT_THREADED, .branching = 16, .orders = 2, .throw_back = -1 }, false, 3, 9 },
    { { .structure = RT_BVH, .no_binary = true }, false, 1, 0 },
    { { .structure = RT_BVH, .quality = RT_BUILD_FAST, .no_binary = true, .reference = true }, true, 3, 0 },
};

/* The whole promise for one model and its rays: oracle, checksum, then every structure, way of building and way of tracing. */
static void rtt_check(const char *what, const rtt_model *model, const rtt_rays *rays)
{
    rt_hit *want = (rt_hit *)rtt_array(rays->count, sizeof *want);
    rt_geometry geometry = rtt_geometry(model);
    rt_build_options options;
    rt_accel *accel;
    rt_error error;
    size_t calls = 0;

    for (size_t i = 0; i < rays->count; i++) {
        uint32_t words[5];

        want[i] = rtt_closest_at(model, &rays->ray[i], rays->time ? rays->time[i] : 0);
        memcpy(words, &want[i], sizeof words);
        for (size_t k = 0; k < 5; k++)
            rtt.checksum = rtt_mix(rtt.checksum, words[k]);
    }
    rtt.cases++;
    rtt.rays += rays->count;
    for (size_t b = 0; b < RTT_COUNT(rtt_builds); b++) {
        options = rtt_builds[b].options;
        options.parallel_for = rtt_builds[b].parallel ? rtt_backwards : NULL;
        options.parallel_user = &calls;
        options.skip_invalid = model->skip_invalid;
        options.error = &error;
        if (!rtt_structure_built(options.structure))
            continue;
        error.message[0] = 0;
        if (rt_build(&accel, &geometry, &options) != RT_OK) {
            rtt_fail("%s: %s does not build: %s", what, rtt_structure_names[options.structure], error.message);
            continue;
        }
        rtt_check_accel(what, accel, &geometry);
        rtt_compare_ways(what, accel, rays, want, !options.no_backtrack, rtt.cases + b, rtt_builds[b].every);
        if (rtt_device.gpu && !options.no_binary)
            rtt_compare_device(rtt_device.gpu, what, accel, rays, want, !options.no_backtrack, rtt.cases + b, rtt_builds[b].device);
        rt_free(accel);
    }
    free(want);
}

/* A model as each structure that there is. */
typedef struct { rt_accel *of[RT_STRUCTURE_COUNT]; } rtt_accels;

static bool rtt_accels_build(rtt_accels *accels, const rtt_model *model)
{
    rt_geometry geometry = rtt_geometry(model);
    bool good = true;

    memset(accels, 0, sizeof *accels);
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
        rt_build_options options;

        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)s;
        if (rtt_structure_built(options.structure))
            good = CHECK_STATUS(rt_build(&accels->of[s], &geometry, &options), RT_OK) && good;
    }
    return good;
}

static const rt_accel *rtt_accels_for(const rtt_accels *accels, const rtt_way *way)
{
    return accels->of[way->structure == RT_STRUCTURE_COUNT ? RT_BVH : way->structure];
}

static void rtt_accels_free(rtt_accels *accels)
{
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++)
        rt_free(accels->of[s]);
}

/* How many of the rays hit: for tests that must not pass by missing everything. */
static size_t rtt_hits(const rtt_model *model, const rtt_rays *rays)
{
    size_t hits = 0;

    for (size_t i = 0; i < rays->count; i++)
        hits += rtt_closest(model, &rays->ray[i]).prim != RT_NONE;
    return hits;
}

/* ---- >>shapes: meshes without a hole, and clouds -------------------------------------------------------------------- */

static rt_vec3 rtt_to(rt_vec3 p, float scale, rt_vec3 offset) { return rtt_add(rtt_mul(p, scale), offset); }

/* The surface of the cube [-scale, scale]^3 + offset, n x n squares a face, all corners shared; round: drawn onto the sphere. */
static void rtt_cube(rtt_model *model, int n, bool round, float scale, rt_vec3 offset)
{
    size_t side = (size_t)n + 1;
    uint32_t *id = (uint32_t *)rtt_array(side * side * side, sizeof *id);

    for (size_t i = 0; i < side * side * side; i++) {
        int x = (int)(i % side), y = (int)(i / side % side), z = (int)(i / side / side);
        double p[3] = { 2 * x - n, 2 * y - n, 2 * z - n }, length = n;

        if (x % n && y % n && z % n)
            continue;
        if (round)
            length = rtt_d(sqrt(rtt_dot(p, p)));
        id[i] = rtt_vertex(model, rtt_to(rtt_v((float)rtt_d(p[0] / length), (float)rtt_d(p[1] / length), (float)rtt_d(p[2] / length)),
                                         scale, offset));
    }
    for (size_t face = 0; face < 6; face++)
        for (size_t a = 0; a < side - 1; a++)
            for (size_t b = 0; b < side - 1; b++) {
                size_t step[3] = { 1, side, side * side };
                size_t u = step[(face + 1) % 3], v = step[(face + 2) % 3];
                size_t at = (face < 3 ? 0 : step[face % 3] * (side - 1)) + a * u + b * v;

                rtt_triangle(model, id[at], id[at + u], id[at + u + v]);
                rtt_triangle(model, id[at], id[at + u + v], id[at + v]);
            }
    free(id);
}

/* Point i of 4 q on the unit circle, from its rational parametrisation. */
static void rtt_circle(int i, int q, double *c, double *s)
{
    double t = rtt_d((double)(i % q) / q), w = rtt_d(1 + rtt_d(t * t)), x = rtt_d(rtt_d(1 - rtt_d(t * t)) / w), y = rtt_d(rtt_d(2 * t) / w);
    int quarter = i / q % 4;

    *c = quarter == 0 ? x : quarter == 1 ? -y : quarter == 2 ? -x : y;
    *s = quarter == 0 ? y : quarter == 1 ? x : quarter == 2 ? -y : -x;
}

/* Around the z axis: middle circle of radius 2, tube of radius 1; 4 q by 4 q squares. */
static void rtt_torus(rtt_model *model, int q, float scale, rt_vec3 offset)
{
    uint32_t n = 4 * (uint32_t)q, first = (uint32_t)model->vertex_count;

    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < n; j++) {
            double c1, s1, c2, s2;

            rtt_circle((int)i, q, &c1, &s1);
            rtt_circle((int)j, q, &c2, &s2);
            c2 = rtt_d(2 + c2);
            rtt_vertex(model, rtt_to(rtt_v((float)rtt_d(c2 * c1), (float)rtt_d(c2 * s1), (float)s2), scale, offset));
        }
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < n; j++) {
            uint32_t a = first + i * n + j, b = first + (i + 1) % n * n + j, c = first + (i + 1) % n * n + (j + 1) % n,
                     d = first + i * n + (j + 1) % n;

            rtt_triangle(model, a, b, c);
            rtt_triangle(model, a, c, d);
        }
}

/* Triangles of about the given extent, strewn in the cube of half width size. */
static void rtt_cloud(rtt_model *model, rtt_random *random, size_t count, rt_vec3 center, float size, float extent)
{
    for (size_t i = 0; i < count; i++) {
        rt_vec3 p = rtt_point(random, center, size), a = rtt_point(random, p, extent), b = rtt_point(random, p, extent);

        rtt_face(model, p, a, b);
    }
}

static void rtt_balls(rtt_model *model, rtt_random *random, size_t count, rt_vec3 center, float size, float extent)
{
    for (size_t i = 0; i < count; i++) {
        rt_vec3 p = rtt_point(random, center, size);

        rtt_ball(model, p, fabsf(rtt_f(extent * rtt_signed(random))));
    }
}

/* ---- >>hits: well-behaved geometry against the oracle ---------------------------------------------------------------- */

/* The oracle itself, on cases worked out by hand. */
static void rtt_test_oracle(void)
{
    rtt_model model = { 0 };
    rt_ray down = { { 0.25f, 0.5f, 3 }, 0, { 0, 0, -2 }, INFINITY }, along = { { -5, 0, 0 }, 0, { 1, 0, 0 }, INFINITY };
    rt_ray inside = { { 8, 0, 0 }, 0, { 1, 0, 0 }, INFINITY };
    rt_hit want = { 1.5f, 0.25f, 0.5f, 0, RT_NONE }, wall = { 12, 0, 0, 1, RT_NONE }, back = { 1, 0, 0, 1, RT_NONE };
    rt_hit instanced = { 0.5f, 0.25f, 0.5f, 0, 0 };
    rtt_model world = { 0 };

    rtt_face(&model, rtt_v(0, 0, 0), rtt_v(1, 0, 0), rtt_v(0, 1, 0));
    rtt_ball(&model, rtt_v(8, 0, 0), 1);
    CHECK(rtt_same(rtt_closest(&model, &down), want));
    CHECK(rtt_same(rtt_closest(&model, &along), wall));
    CHECK(rtt_same(rtt_closest(&model, &inside), back));
    down.tmax = 1.5f;
    CHECK(rtt_same(rtt_closest(&model, &down), rtt_miss));
    down.tmax = 2;
    rtt_place(&world, &model, rtt_v(1, 1, 1), rtt_v(0, 0, 2));
    CHECK(rtt_same(rtt_closest(&world, &down), instanced));
    CHECK(rtt_paths(&world) == 1 && rtt_same(rtt_any(instanced), (rt_hit){ 0, 0, 0, 0, RT_NONE }));
    rtt_model_free(&world);
    rtt_model_free(&model);
}

static void rtt_test_empty(void)
{
    rtt_model nothing = { 0 };
    rtt_random random = rtt_stream();
    rtt_rays rays = { 0 };
    rt_geometry geometry = rtt_geometry(&nothing);
    rt_accel *accel;
    rt_info info;

    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 40);
    rtt_check("empty", &nothing, &rays);
    CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK);
    rt_get_info(accel, &info);
    CHECK(info.lower.x > info.upper.x && info.lower.y > info.upper.y && info.lower.z > info.upper.z);
    CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
    rt_free(accel);
    rt_free(NULL);
    rtt_rays_free(&rays);
}

static void rtt_test_few(void)
{
    rtt_random random = rtt_stream();

    for (size_t n = 1; n <= 9; n++)
        for (size_t kind = 0; kind < 3; kind++) {
            rtt_model model = { 0 };
            rtt_rays rays = { 0 };

            if (kind != 1)
                rtt_cloud(&model, &random, n, rtt_origin, 1, 2);
            if (kind != 0)
                rtt_balls(&model, &random, n, rtt_origin, 1, 0.7f);
            rtt_rays_mixed(&rays, &random, rtt_origin, 1.5f, 60);
            rtt_rays_features(&rays, &random, &model, 3, 60);
            rtt_rays_tighten(&rays, &model, 20);
            rtt_check("few", &model, &rays);
            rtt_model_free(&model);
            rtt_rays_free(&rays);
        }
}

static void rtt_test_random(void)
{
    static const struct { size_t count; float size, extent; } clouds[] = {
        { 20, 1, 1 }, { 200, 1, 0.1f }, { 200, 1, 2 }, { 1500, 100, 5 }, { 700, 1e-6f, 1e-6f }, { 700, 1e6f, 1e5f }
    };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(clouds); i++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        float size = clouds[i].size;

        rtt_cloud(&model, &random, clouds[i].count, rtt_origin, size, clouds[i].extent);
        rtt_rays_mixed(&rays, &random, rtt_origin, size, 400);
        rtt_rays_pinhole(&rays, rtt_v(0, 0, -4 * size), rtt_origin, size, 16);
        rtt_rays_features(&rays, &random, &model, 2 * size, 300);
        rtt_rays_tighten(&rays, &model, 100);
        CHECK(rtt_hits(&model, &rays) > rays.count / 8);
        rtt_check("cloud", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Boxes that a ray must not miss by rounding although the triangle test, which rounds too, finds the triangle: outlines of small things
   seen from afar, of things afar seen from about the origin, and of both afar. */
static void rtt_test_far(void)
{
    rtt_random random = rtt_stream();

    for (int exponent = 0; exponent <= 40; exponent += 4)
        for (int kind = 0; kind < 3; kind++) {
            rtt_model model = { 0 };
            rtt_rays rays = { 0 };
            float distance = ldexpf(1, exponent), size = exponent > 16 && kind ? ldexpf(1, exponent - 16) : 1;
            rt_vec3 center = rtt_point(&random, rtt_origin, kind ? distance : 4);

            rtt_cloud(&model, &random, 40, center, size, 0.02f * size);
            rtt_balls(&model, &random, 10, center, size, 0.02f * size);
            rtt_quad(&model, rtt_add(center, rtt_v(2 * size, 0, 0)), rtt_v(0, size, 0), rtt_v(0, 0, size));
            if (kind != 1)
                rtt_rays_features(&rays, &random, &model, distance, 250);
            for (int i = 0; kind == 1 && i < 250; i++) {
                rt_vec3 from = rtt_point(&random, rtt_origin, i % 2 ? 0 : size);

                rtt_aim(&rays, from, rtt_feature(&model, &random));
            }
            rtt_check("far", &model, &rays);
            rtt_model_free(&model);
            rtt_rays_free(&rays);
        }
}

/* A grid of squares and a lattice of cubes on whole numbers; rays through corners, along edges, and in the planes of faces and boxes. */
static void rtt_test_grid(void)
{
    rtt_random random = rtt_stream();

    for (unsigned kind = 0; kind < 4; kind++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        rt_vec3 u = rtt_axis(2 * kind % 6), v = rtt_axis((2 * kind + 2) % 6);

        for (int i = 0; i < 5; i++)
            for (int j = 0; j < 5; j++)
                if (kind < 3)
                    rtt_quad(&model, rtt_add(rtt_mul(u, (float)i), rtt_mul(v, (float)j)), u, v);
                else
                    rtt_cube(&model, 2, false, 0.5f, rtt_v(0.5f + (float)i, 0.5f, 0.5f + (float)j));
        for (unsigned axis = 0; axis < 6; axis++)
            for (int i = -1; i <= 11; i++)
                for (int j = -1; j <= 11; j++) {
                    rt_vec3 p = rtt_mul(rtt_axis((axis + 2) % 6), 0.5f * (float)i), q = rtt_mul(rtt_axis((axis + 4) % 6), 0.5f * (float)j);

                    p = rtt_v(fabsf(p.x + q.x), fabsf(p.y + q.y), fabsf(p.z + q.z));
                    rtt_segment(&rays, rtt_add(p, rtt_mul(rtt_axis(axis), -9)), rtt_axis(axis), 0, INFINITY);
                }
        for (int i = 0; i < 300; i++) {     /* diagonals from and through lattice points */
            rt_vec3 dir = rtt_lattice(&random, 1), p = rtt_add(rtt_lattice(&random, 3), rtt_v(3, 3, 3));

            rtt_segment(&rays, i % 2 ? p : rtt_sub(p, rtt_mul(dir, 8)), dir, i % 3 ? 0 : -100, INFINITY);
        }
        rtt_rays_tighten(&rays, &model, 100);
        rtt_check("grid", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Overlapping triangles in one tilted plane: t differs only by rounding, so a box must not be dropped for being no nearer. */
static void rtt_test_coplanar(void)
{
    rtt_random random = rtt_stream();

    for (int kind = 0; kind < 4; kind++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        rt_vec3 u = kind == 0 ? rtt_v(1, 0, 0) : rtt_point(&random, rtt_origin, 1);
        rt_vec3 v = kind == 0 ? rtt_v(0, 1, 0) : rtt_point(&random, rtt_origin, 1);

        for (int i = 0; i < 200; i++) {
            rt_vec3 corner[3];

            for (int k = 0; k < 3; k++) {
                corner[k] = rtt_mul(u, rtt_signed(&random));
                corner[k] = rtt_add(corner[k], rtt_mul(v, rtt_signed(&random)));
            }
            rtt_face(&model, corner[0], corner[1], corner[2]);
        }
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 200);
        for (int e = 0; e <= 24; e += 8)
            rtt_rays_features(&rays, &random, &model, ldexpf(1, e), 100);
        rtt_check("coplanar", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

static void rtt_test_spheres(void)
{
    static const struct { size_t count; float size, extent; } sets[] = {
        { 40, 1, 0.5f }, { 500, 10, 0.5f }, { 100, 1e-3f, 1e-6f }, { 60, 1, 1e6f }, { 60, 1e6f, 1 }, { 100, 1e9f, 1e9f }
    };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(sets); i++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };

        rtt_balls(&model, &random, sets[i].count, rtt_origin, sets[i].size, sets[i].extent);
        rtt_rays_mixed(&rays, &random, rtt_origin, sets[i].size, 300);
        rtt_rays_pinhole(&rays, rtt_v(0, 0, -4 * sets[i].size), rtt_origin, sets[i].size, 12);
        rtt_rays_features(&rays, &random, &model, 2 * sets[i].size, 200);
        rtt_rays_features(&rays, &random, &model, 1e4f * sets[i].size, 200);
        rtt_rays_tighten(&rays, &model, 100);
        rtt_check("spheres", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Radius 0, tangents, origins at the centre and on the wall, the huge seen from beside it, shells around one centre. */
static void rtt_test_sphere_cases(void)
{
    static const float radii[] = { 0, 1e-30f, 1e-10f, 1, 1e5f, 1e10f, 9e17f };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(radii); i++)
        for (int at = 0; at < 3; at++) {
            rtt_model model = { 0 };
            rtt_rays rays = { 0 };
            float r = radii[i], reach = r > 0 ? r : 1;
            rt_vec3 center = at == 0 ? rtt_origin : rtt_point(&random, rtt_origin, at == 1 ? reach : 1e17f);

            if (r > 1e17f)
                center = rtt_mul(center, 0.01f);
            rtt_ball(&model, center, r);
            rtt_ball(&model, center, r);
            rtt_ball(&model, center, 0.5f * r);
            for (unsigned a = 0; a < 6; a++) {
                rt_vec3 axis = rtt_axis(a), side = rtt_axis((a + 2) % 6), wall = rtt_add(center, rtt_mul(axis, r));

                rtt_segment(&rays, center, axis, 0, INFINITY);
                rtt_segment(&rays, wall, axis, 0, INFINITY);
                rtt_segment(&rays, wall, rtt_mul(axis, -1), 0, INFINITY);
                rtt_segment(&rays, wall, side, 0, INFINITY);
                rtt_segment(&rays, wall, side, -reach, INFINITY);
                rtt_segment(&rays, rtt_sub(wall, rtt_mul(side, reach)), side, 0, INFINITY);
                rtt_segment(&rays, rtt_sub(center, rtt_mul(axis, reach)), axis, 0, INFINITY);
                rtt_segment(&rays, rtt_add(wall, axis), rtt_mul(axis, -1e-10f), 0, INFINITY);
                rtt_segment(&rays, rtt_add(wall, axis), rtt_mul(axis, -1e10f), 0, INFINITY);
            }
            rtt_rays_features(&rays, &random, &model, reach, 40);
            rtt_rays_features(&rays, &random, &model, r < 1e10f ? 1e6f * reach : reach, 40);
            rtt_rays_tighten(&rays, &model, 40);
            rtt_check("sphere", &model, &rays);
            rtt_model_free(&model);
            rtt_rays_free(&rays);
        }
}

/* A ray that starts exactly on a sphere leaves it (tmin 0 shuts the start out); a tangent there has no t but noise to offer. */
static void rtt_test_sphere_start(void)
{
    static const float points[][4] = { { 1, 0, 0, 1 }, { 0, -1, 0, 1 }, { 3, 4, 0, 5 }, { 3, 0, -4, 5 }, { 2, 3, 6, 7 } };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };

    for (size_t i = 0; i < RTT_COUNT(points); i++) {
        const float *p = points[i];
        rt_vec3 at = rtt_v(p[0], p[1], p[2]);
        rtt_model ball = { 0 };
        rt_geometry geometry;
        rt_accel *accel;

        rtt_ball(&ball, rtt_origin, p[3]);
        geometry = rtt_geometry(&ball);
        CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK);
        for (int k = 0; k < 10000; k++) {
            rt_ray ray = { at, 0, rtt_point(&random, rtt_origin, 1), INFINITY };
            rt_hit hit;
            double outwards = rtt_dot((double[]){ (double)at.x, (double)at.y, (double)at.z },
                                      (double[]){ (double)ray.dir.x, (double)ray.dir.y, (double)ray.dir.z });

            if (fabs(outwards) < 1e-5)      /* so nearly a tangent that its chord is a matter of rounding */
                continue;
            if (rt_intersect(accel, &ray, &hit) != (outwards < 0) || hit.t < 1e-9f)
                rtt_fail("a ray from (%g, %g, %g) on the sphere, outwards %g: t %g", (double)p[0], (double)p[1], (double)p[2], outwards,
                         (double)hit.t);
        }
        rt_free(accel);
        rtt_model_free(&ball);
    }
    rtt_ball(&model, rtt_origin, 0x1.f6b42ap+0f);      /* the quotient c / q was 2.8 and -0.69 for these: far outside the box */
    rtt_ball(&model, rtt_origin, 0x1.e6a404p+0f);
    rtt_segment(&rays, rtt_v(-0x1.81518ap+0f, -0x1.42dd02p+0f, -0x1.9750c6p-13f), rtt_v(-0x1.42dd02p+0f, 0x1.81518ap+0f, -0x1.cafce4p-40f),
                2.5f, INFINITY);
    rtt_segment(&rays, rtt_v(-0x1.9c65d2p+0f, -0x1.025adcp+0f, -0x1.8c3254p-14f), rtt_v(-0x1.025adcp+0f, 0x1.9c65d2p+0f, 0x1.e01aacp-38f),
                -INFINITY, -0.62f);
    rtt_segment(&rays, rtt_v(0, 0, 9), rtt_v(0, 0, -1), 0, INFINITY);
    rtt_check("tangent start", &model, &rays);          /* in one leaf, so without a box */
    for (int i = 1; i < 16; i++)
        rtt_ball(&model, rtt_v(0, 0, 100 * (float)i), 2);
    rtt_check("tangent start in boxes", &model, &rays);
    rtt_model_free(&model);
    rtt_rays_free(&rays);
}

/* The shortest rays among the largest coordinates: hits come at times near the end of floats, and spheres are too small to widen a box. */
static void rtt_test_short_rays(void)
{
    static const float found[12][9] = {     /* a ray of 2e-30 met triangle 1 after its box was left, where boxes were fma */
        { 0x1.328ea4p+48f, 0x1.99bd5p+31f, 0x1.3713bap+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713c2p+45f,
          0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f },
        { 0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f, 0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f,
          0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713c2p+45f },
        { 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713c2p+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713bap+45f,
          0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713bap+45f },
        { 0x1.328ea4p+48f, 0x1.99bd5p+31f, 0x1.3713c2p+45f, 0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f,
          0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f },
        { 0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.9a34b4p+31f, 0x1.3713cp+45f,
          0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f },
        { 0x1.328ea4p+48f, 0x1.9a34b4p+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.99bd5p+31f, 0x1.3713bap+45f,
          0x1.328ea4p+48f, 0x1.9a34b4p+31f, 0x1.3713cp+45f },
        { 0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bep+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713cp+45f,
          0x1.328ea4p+48f, 0x1.99bd5p+31f, 0x1.3713bap+45f },
        { 0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f, 0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f,
          0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bcp+45f },
        { 0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713c2p+45f,
          0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f },
        { 0x1.328ea4p+48f, 0x1.985726p+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713bap+45f,
          0x1.328ea4p+48f, 0x1.99bd5p+31f, 0x1.3713c2p+45f },
        { 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.9a34b4p+31f, 0x1.3713cp+45f,
          0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713cp+45f },
        { 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713cp+45f, 0x1.328ea4p+48f, 0x1.98ce8ap+31f, 0x1.3713c2p+45f,
          0x1.328ea4p+48f, 0x1.9945ecp+31f, 0x1.3713bep+45f } };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };

    for (size_t i = 0; i < RTT_COUNT(found); i++) {
        const float *v = found[i];

        rtt_face(&model, rtt_v(v[0], v[1], v[2]), rtt_v(v[3], v[4], v[5]), rtt_v(v[6], v[7], v[8]));
    }
    rtt_segment(&rays, rtt_v(0x1.328ebap+48f, 0x1.98e262p+31f, 0x1.3713cp+45f), rtt_v(-0x1.936ddep-99f, -0.0f, 0), 0x1.bebaeep+126f,
                INFINITY);
    rtt_segment(&rays, rtt_v(0x1.328ebap+48f, 0x1.98e262p+31f, 0x1.3713cp+45f), rtt_v(-0x1.936ddep-99f, -0.0f, 0), 0, INFINITY);
    rtt_check("short ray", &model, &rays);
    rtt_model_free(&model);
    rtt_rays_free(&rays);
    for (int i = 0; i < 60; i++) {
        rt_vec3 center = rtt_v(0x1.b7a5f8p+59f, rtt_log(&random, 20, 58), rtt_log(&random, 20, 58));

        for (int k = 0; k < 10; k++)
            rtt_ball(&model, center, fabsf(rtt_log(&random, -20, -12)));
        for (unsigned k = 0; k < 24; k++)
            rtt_segment(&rays, center, rtt_mul(rtt_axis(k % 6), fabsf(rtt_log(&random, -99, -95))), k % 4 ? -INFINITY : 0, INFINITY);
        rtt_rays_tighten(&rays, &model, 20);
        rtt_check("short rays", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

static void rtt_test_mixed(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 4; i++) {
        rtt_model model = { 0 }, child = { 0 };
        rtt_rays rays = { 0 };

        rtt_cloud(&child, &random, 30, rtt_origin, 0.5f, 0.3f);
        rtt_cloud(&model, &random, 300, rtt_origin, 1, 0.2f);
        rtt_balls(&model, &random, 100, rtt_origin, 1, 0.1f);
        for (int k = 0; i % 2 && k < 20; k++)
            rtt_place(&model, &child, rtt_mul(rtt_v(1, 1, 1), 0.3f), rtt_point(&random, rtt_origin, 1));
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 300);
        rtt_rays_pinhole(&rays, rtt_v(0.5f, 0, -3), rtt_origin, 1, 20);
        rtt_rays_features(&rays, &random, &model, 3, 200);
        rtt_rays_tighten(&rays, &model, 100);
        rtt_check("mixed", &model, &rays);
        rtt_model_free(&model);
        rtt_model_free(&child);
        rtt_rays_free(&rays);
    }
}

/* Equal t: the lower inst wins, then the lower prim; own primitives (inst RT_NONE) come last. */
static void rtt_test_ties(void)
{
    rtt_random random = rtt_stream();
    rtt_model child = { 0 }, world = { 0 };
    rtt_rays rays = { 0 };
    float identity[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    rt_hit hit;

    for (int i = 0; i < 12; i++)
        rtt_quad(&child, rtt_v(-1, -1, 0), rtt_v(2, 0, 0), rtt_v(0, 2, 0));
    for (int i = 0; i < 12; i++)
        rtt_ball(&child, rtt_v(5, 0, 0), 1);
    rtt_rays_features(&rays, &random, &child, 4, 200);
    rtt_rays_pinhole(&rays, rtt_v(0, 0, -4), rtt_origin, 1, 10);
    hit = rtt_closest(&child, &rays.ray[rays.count - 1]);
    CHECK(hit.prim == 0 || hit.prim == 1);
    rtt_check("ties of prims", &child, &rays);
    rtt_quad(&world, rtt_v(-1, -1, 0), rtt_v(2, 0, 0), rtt_v(0, 2, 0));
    for (int i = 0; i < 9; i++)
        rtt_instance(&world, &child, identity);
    CHECK(rtt_closest(&world, &rays.ray[rays.count - 1]).inst == 0);
    rtt_check("ties of instances", &world, &rays);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
}

/* ---- >>instances ---------------------------------------------------------------------------------------------------- */

/* Fills a 3x4 matrix: a random, well-conditioned 3x3 times scale, and the translation. */
static void rtt_matrix(rtt_random *random, float scale, rt_vec3 offset, float matrix[12])
{
    float inverse[12];

    do {
        for (int i = 0; i < 12; i++)
            matrix[i] = rtt_f(scale * rtt_signed(random));
        matrix[3] = offset.x, matrix[7] = offset.y, matrix[11] = offset.z;
        if (rtt_invert(matrix, inverse)) {
            float worst = 0;

            for (int i = 0; i < 12; i++)
                if (i % 4 != 3 && fabsf(inverse[i]) > worst)
                    worst = fabsf(inverse[i]);
            if (worst < rtt_f(4 / scale))
                return;
        }
    } while (true);
}

/* Shears, reflections, rotations; scales from 1e-5 to 1e5; children near and 2^17 radii off; the same child many times. */
static void rtt_test_instances(void)
{
    static const float scales[] = { 1e-5f, 1e-3f, 0.5f, 1, 300, 1e5f };
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(scales); s++)
        for (int far = 0; far < 2; far++) {
            rtt_model child = { 0 }, world = { 0 };
            rtt_rays rays = { 0 };
            float matrix[12], size = rtt_f(3 * scales[s]);
            rt_vec3 center = far ? rtt_point(&random, rtt_origin, rtt_f(131072 * scales[s])) : rtt_origin;

            child.structure = s % 2 ? RT_KDTREE : RT_BVH;
            rtt_cloud(&child, &random, 40, rtt_origin, 1, 0.4f);
            rtt_balls(&child, &random, 10, rtt_origin, 1, 0.2f);
            for (int i = 0; i < 12; i++) {
                rtt_matrix(&random, scales[s], rtt_point(&random, center, size), matrix);
                rtt_instance(&world, &child, matrix);
            }
            rtt_place(&world, &child, rtt_mul(rtt_v(-1, 1, 1), scales[s]), center);
            rtt_rays_mixed(&rays, &random, center, size, 200);
            rtt_rays_features(&rays, &random, &world, size, 200);
            rtt_rays_features(&rays, &random, &world, 1e3f * size, 200);
            rtt_rays_pinhole(&rays, rtt_add(center, rtt_v(0, 0, -4 * size)), center, size, 12);
            rtt_rays_tighten(&rays, &world, 50);
            rtt_check(far ? "instances far off" : "instances", &world, &rays);
            rtt_model_free(&world);
            rtt_model_free(&child);
            rtt_rays_free(&rays);
        }
}

/* a after b, as placed transforms; rounded like everything here. */
static void rtt_concat(const float a[12], const float b[12], float out[12])
{
    for (int column = 0; column < 4; column++) {
        rt_vec3 p = rtt_transform(a, rtt_v(b[column], b[4 + column], b[8 + column]));

        if (column < 3)                     /* a direction: without a's translation */
            p = rtt_sub(p, rtt_v(a[3], a[7], a[11]));
        out[column] = p.x, out[4 + column] = p.y, out[8 + column] = p.z;
    }
}

/* Needles, plates and one-axis scalings, also turned, near and afar: boxes in object space have little to do with those in the world. */
static void rtt_test_instances_skewed(void)
{
    static const float squeeze[][3] = { { 1e-3f, 1, 1 }, { 1, 1e4f, 1 }, { 1e3f, 1, 1e-3f }, { -1e-4f, -1e-4f, 1e4f } };
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(squeeze); s++)
        for (int afar = 0; afar < 2; afar++) {
            rtt_model child = { 0 }, box = { 0 }, world = { 0 };
            rtt_rays rays = { 0 };
            float turn[12], squash[12], matrix[12], shear[12] = { 1, 0, 0, 0, 1e3f, 1, 0, 0, 0, -1e3f, 1, 0 };
            rt_vec3 center = rtt_point(&random, rtt_origin, afar ? 1e6f : 3);

            child.structure = s % 2 ? RT_BVH : RT_KDTREE, box.structure = afar ? RT_KDTREE : RT_BVH;
            rtt_cube(&child, 2, true, 1, rtt_origin);
            rtt_cube(&box, 1, false, 1, rtt_origin);              /* its corners reach those of its bounds */
            rtt_place(&world, &child, rtt_v(squeeze[s][0], squeeze[s][1], squeeze[s][2]), center);
            rtt_instance(&world, &child, shear);
            for (int i = 0; i < 6; i++) {
                memset(squash, 0, sizeof squash);
                squash[0] = squeeze[s][0], squash[5] = squeeze[s][1], squash[10] = squeeze[s][2];
                rtt_matrix(&random, 1, rtt_origin, turn);
                rtt_concat(squash, turn, matrix);
                rtt_matrix(&random, 1, rtt_origin, turn);
                rtt_concat(turn, matrix, squash);
                squash[3] = center.x, squash[7] = center.y, squash[11] = center.z;
                rtt_instance(&world, i % 3 ? &box : &child, squash);
            }
            for (int e = -4; e <= 24; e += 4)
                rtt_rays_features(&rays, &random, &world, ldexpf(1, e), 80);
            for (int i = 0; i < 200; i++)
                rtt_aim(&rays, rtt_origin, rtt_feature(&world, &random));
            rtt_rays_tighten(&rays, &world, 50);
            rtt_check("instances skewed", &world, &rays);
            rtt_model_free(&world);
            rtt_model_free(&child);
            rtt_model_free(&box);
            rtt_rays_free(&rays);
        }
}

/* What underflows inside an instance is no longer small outside. */
static void rtt_test_instances_tiny(void)
{
    rtt_model child = { 0 }, model = { 0 };
    rtt_rays rays = { 0 };

    child.structure = RT_KDTREE;
    rtt_face(&child, rtt_origin, rtt_v(3e-44f, 0, 0), rtt_v(0, 3e-44f, 0));
    for (int i = 0; i < 16; i++)
        rtt_place(&model, &child, rtt_v(1e18f, 1e18f, 1e18f), rtt_v((float)i * 1e-25f, 0, 0));
    rtt_segment(&rays, rtt_v(-0.3e-27f, 3e-27f, 1e-25f), rtt_v(0, 0, -1e-7f), 0, 1);
    rtt_segment(&rays, rtt_v(3e-27f, 3e-27f, 1e-25f), rtt_v(0, 0, -1e-7f), 0, 1);
    rtt_check("tiny child", &model, &rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
}

/* As deep as allowed, two instances and triangles of its own a level, the structures by turns; hits must name the right path. */
static void rtt_test_instances_deep(void)
{
    rtt_random random = rtt_stream();
    rtt_model level[RT_MAX_NESTING + 2];
    rtt_rays rays = { 0 };
    rt_geometry geometry;
    rt_build_options options;
    rt_accel *accel;
    rt_error error;
    rt_info info;

    memset(level, 0, sizeof level);
    rtt_cloud(&level[0], &random, 6, rtt_origin, 1, 0.5f);
    rtt_ball(&level[0], rtt_origin, 0.3f);
    for (int k = 1; k <= RT_MAX_NESTING; k++) {
        float matrix[12];

        level[k].structure = k % 2 ? RT_KDTREE : RT_BVH;
        for (int i = 0; i < 2; i++) {
            rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
            rtt_instance(&level[k], &level[k - 1], matrix);
        }
        rtt_cloud(&level[k], &random, 2, rtt_origin, 1, 0.5f);
        rtt_rays_free(&rays);
        rtt_rays_mixed(&rays, &random, rtt_origin, 2, 100);
        rtt_rays_features(&rays, &random, &level[k], 4, 60);
        if (k == 1 || k == 3 || k == RT_MAX_NESTING)
            rtt_check("nested", &level[k], &rays);
    }
    rtt_instance(&level[RT_MAX_NESTING + 1], &level[RT_MAX_NESTING], level[1].instances[0].transform);
    rt_get_info(level[RT_MAX_NESTING].accel, &info);
    CHECK(info.nesting == RT_MAX_NESTING);
    memset(&options, 0, sizeof options);
    options.error = &error;
    geometry = rtt_geometry(&level[RT_MAX_NESTING + 1]);
    CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_LIMIT);
    CHECK(accel == NULL && error.status == RT_ERROR_LIMIT && error.message[0] != 0);
    for (size_t k = RTT_COUNT(level); k-- > 0;)
        rtt_model_free(&level[k]);
    rtt_rays_free(&rays);
}

/* More paths than 32 bits can number must be refused; nearly as many must not. */
static void rtt_test_instances_paths(void)
{
    for (size_t fan = 15; fan <= 16; fan++) {
        rtt_model level[RT_MAX_NESTING + 1];
        rt_geometry geometry;
        rt_accel *accel;
        uint64_t paths = 0;

        memset(level, 0, sizeof level);
        rtt_quad(&level[0], rtt_v(-1, -1, 0), rtt_v(2, 0, 0), rtt_v(0, 2, 0));
        for (int k = 1; k <= RT_MAX_NESTING; k++) {
            level[k - 1].structure = k % 3 ? RT_KDTREE : RT_BVH;
            for (size_t i = 0; i < fan; i++)
                rtt_place(&level[k], &level[k - 1], rtt_v(1, 1, 1), rtt_v(0, 0, i + 1 < fan ? -10.0f - (float)i : 0));
            paths = fan * (1 + paths);
        }
        geometry = rtt_geometry(&level[RT_MAX_NESTING]);
        CHECK_STATUS(rt_build(&accel, &geometry, NULL), paths <= RT_NONE ? RT_OK : RT_ERROR_LIMIT);
        if (accel) {                        /* the foremost is the last child all the way down: the last number */
            rt_ray ray = { { 0, 0.25f, 3 }, 0, { 0, 0, -1 }, INFINITY };
            rt_hit hit;
            float transform[12];

            CHECK(rt_intersect(accel, &ray, &hit) && hit.t == 3 && hit.inst == (uint32_t)(paths - 1));
            CHECK(rt_instance_transform(accel, hit.inst, transform, NULL) && transform[11] == 0);
            CHECK(!rt_instance_transform(accel, (uint32_t)paths, transform, NULL));
        }
        rt_free(accel);
        for (size_t k = RTT_COUNT(level); k-- > 0;)
            rtt_model_free(&level[k]);
    }
}

static void rtt_compose(const float a[12], const float b[12], float out[12])
{
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 4; column++) {
            double sum = column == 3 ? (double)a[4 * row + 3] : 0;

            for (int k = 0; k < 3; k++)
                sum += (double)a[4 * row + k] * (double)b[4 * k + column];
            out[4 * row + column] = (float)sum;
        }
}

static bool rtt_near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

/* Walks all paths of a model in the documented order and compares each transform with the composed matrices. */
static void rtt_walk(const rt_accel *root, const rtt_model *model, const float outer[12], uint32_t *number)
{
    for (size_t i = 0; i < model->instance_count; i++) {
        float want[12], got[12], normal[9], inverse[12];
        bool right = true;

        rtt_compose(outer, model->instances[i].transform, want);
        if (!CHECK(rt_instance_transform(root, *number, got, normal)))
            return;
        CHECK(rt_instance_transform(root, *number, NULL, NULL));
        for (int k = 0; k < 12; k++)
            right = right && rtt_near(got[k], want[k], 1e-4f);
        if (CHECK(rtt_invert(want, inverse)))
            for (int row = 0; row < 3; row++)
                for (int column = 0; column < 3; column++) {
                    float value = inverse[4 * column + row];

                    right = right && rtt_near(normal[3 * row + column], value, 1e-3f * (1 + fabsf(value)));
                }
        CHECK(right);
        ++*number;
        rtt_walk(root, model->children[i], want, number);
    }
}

static void rtt_test_instance_transform(void)
{
    static const float identity[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    rtt_random random = rtt_stream();
    rtt_model leaf = { 0 }, middle = { 0 }, side = { 0 }, top = { 0 };
    float matrix[12], transform[12], normal[9];
    rtt_accels accels;

    middle.structure = RT_KDTREE;
    rtt_cloud(&leaf, &random, 3, rtt_origin, 1, 1);
    for (int i = 0; i < 3; i++) {
        rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
        rtt_instance(&middle, &leaf, matrix);
        rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
        rtt_instance(&side, &leaf, matrix);
    }
    for (int i = 0; i < 5; i++) {
        rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
        rtt_instance(&top, i == 1 ? &leaf : i % 2 ? &side : &middle, matrix);
    }
    rtt_accels_build(&accels, &top);
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
        const rt_accel *accel = accels.of[s];
        uint32_t number = 0;

        if (!accel)
            continue;
        rtt_walk(accel, &top, identity, &number);
        CHECK(number == rtt_paths(&top));
        CHECK(!rt_instance_transform(accel, number, transform, normal));
        CHECK(rt_instance_transform(accel, RT_NONE, transform, normal) && memcmp(transform, identity, sizeof identity) == 0);
        CHECK(normal[0] == 1 && normal[4] == 1 && normal[8] == 1 && normal[1] == 0 && normal[3] == 0);
    }
    rtt_accels_free(&accels);
    rtt_model_free(&top);
    rtt_model_free(&side);
    rtt_model_free(&middle);
    rtt_model_free(&leaf);
}

/* What cannot be instanced is refused and named by its primitive id; skip_invalid leaves it out. An empty child is fine. */
static void rtt_test_instances_bad(void)
{
    static const float bad[][12] = {
        { 0 }, { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0 }, { 1, 2, 3, 0, 2, 4, 6, 0, 0, 0, 1, 0 }, { NAN, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 },
        { 1, 0, 0, INFINITY, 0, 1, 0, 0, 0, 0, 1, 0 }, { 1, 0, 0, 2e18f, 0, 1, 0, 0, 0, 0, 1, 0 },
        { 1e19f, 0, 0, 0, 0, 1e19f, 0, 0, 0, 0, 1, 0 }
    };
    static const float good[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        rtt_model child = { 0 }, empty = { 0 }, world = { 0 };
        rtt_rays rays = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel;
        rt_error error;
        rt_info info;

        rtt_cloud(&child, &random, 5, rtt_origin, 1, 1);
        rtt_cloud(&world, &random, 3, rtt_origin, 1, 0.2f);
        rtt_ball(&world, rtt_origin, 0.2f);
        rtt_instance(&world, &empty, good);
        rtt_instance(&world, &child, bad[i]);
        rtt_instance(&world, &child, good);
        rtt_instance(&world, &child, bad[i]);
        memset(&options, 0, sizeof options);
        options.error = &error;
        geometry = rtt_geometry(&world);
        CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_GEOMETRY);
        CHECK(accel == NULL && error.prim == 5 && error.message[0] != 0);
        options.skip_invalid = true;
        if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
            rt_get_info(accel, &info);
            CHECK(info.skipped == 2 && info.instances == 4);
        }
        rt_free(accel);
        if (i < 4) {                        /* the oracle knows these as bad */
            world.skip_invalid = true;
            rtt_rays_mixed(&rays, &random, rtt_origin, 1.5f, 60);
            rtt_check("bad instance left out", &world, &rays);
        }
        rtt_model_free(&world);
        rtt_model_free(&child);
        rtt_model_free(&empty);
        rtt_rays_free(&rays);
    }
}

/* ---- >>ugly: geometry that breaks builders and tests ----------------------------------------------------------------- */

/* Points, lines, slivers, needles, duplicates with their corners in another order, -0, among good triangles. */
static void rtt_degenerate(rtt_model *model, rtt_random *random)
{
    for (int i = 0; i < 30; i++) {
        rt_vec3 a = rtt_point(random, rtt_origin, 1), b = rtt_point(random, rtt_origin, 1), c = rtt_point(random, rtt_origin, 1);

        rtt_face(model, a, a, a);
        rtt_face(model, a, b, b);
        rtt_face(model, a, rtt_add(rtt_mul(a, 0.5f), rtt_mul(b, 0.5f)), b);
        rtt_face(model, a, b, rtt_add(b, rtt_v(0, 0x1p-23f, 0)));
        rtt_face(model, rtt_mul(a, 1e6f), rtt_mul(b, 1e-6f), rtt_add(rtt_mul(a, 1e6f), rtt_v(1, 0, 0)));
        rtt_face(model, a, b, c);
        rtt_face(model, b, c, a);
        rtt_face(model, c, b, a);
        rtt_face(model, rtt_v(-0.0f, a.y, -0.0f), rtt_v(0.0f, b.y, b.z), rtt_v(-0.0f, -0.0f, c.z));
    }
}

static void rtt_test_degenerate(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 4; i++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };

        rtt_degenerate(&model, &random);
        if (i % 2)
            for (int k = 0; k < 20; k++)
                rtt_ball(&model, rtt_origin, 0.5f);
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 150);
        rtt_rays_features(&rays, &random, &model, 3, 350);
        rtt_rays_tighten(&rays, &model, 60);
        rtt_check("degenerate", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Coordinates over 47 decades, so that boxes, bins and edge functions under- and overflow. */
static void rtt_test_log_spaced(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 4; i++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };

        for (int k = 0; k < 250; k++) {
            rt_vec3 corner[3];
            int e = (int)rtt_below(&random, 156) - 100;

            for (int c = 0; c < 3; c++) {
                corner[c].x = rtt_log(&random, i < 2 ? e : -100, i < 2 ? e : 56);
                corner[c].y = rtt_log(&random, i < 2 ? e : -100, i < 2 ? e : 56);
                corner[c].z = rtt_log(&random, i < 2 ? e : -100, i < 2 ? e : 56);
            }
            rtt_face(&model, corner[0], corner[1], corner[2]);
            if (k % 5 == 0 && i % 2)
                rtt_ball(&model, corner[0], fabsf(corner[1].x));
        }
        for (int e = -100; e <= 56; e += 12)
            rtt_rays_mixed(&rays, &random, rtt_origin, ldexpf(1, e), 24);
        for (int e = -60; e <= 56; e += 12)
            rtt_rays_features(&rays, &random, &model, ldexpf(1, e), 40);
        rtt_rays_tighten(&rays, &model, 100);
        rtt_check("log-spaced", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Denormal, at the greatest coordinates, and 2^17 of their size away from the origin. */
static void rtt_test_extremes(void)
{
    rtt_random random = rtt_stream();

    for (int kind = 0; kind < 6; kind++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        float size = kind == 0 ? 0x1p-140f : kind == 1 ? 0x1p-126f : kind == 2 ? 0.99e18f : kind == 3 ? 1e17f : 1;
        rt_vec3 center = kind < 4 ? rtt_origin : kind == 4 ? rtt_v(131072, -131072, 131072) : rtt_v(1e10f, 3, -5);

        for (int i = 0; i < 200; i++) {
            rt_vec3 a = rtt_point(&random, center, size), b = rtt_point(&random, center, size), c = rtt_point(&random, center, size);

            rtt_face(&model, a, b, c);
        }
        if (kind == 2) {
            rtt_quad(&model, rtt_v(-RT_MAX_COORDINATE, -RT_MAX_COORDINATE, -RT_MAX_COORDINATE), rtt_v(2e18f, 0, 0), rtt_v(0, 2e18f, 0));
            rtt_quad(&model, rtt_v(-RT_MAX_COORDINATE, -RT_MAX_COORDINATE, RT_MAX_COORDINATE), rtt_v(2e18f, 0, 0), rtt_v(0, 2e18f, 0));
        } else
            rtt_balls(&model, &random, 20, center, 0.5f * size, 0.5f * size);
        rtt_rays_mixed(&rays, &random, center, size, 300);
        rtt_rays_mixed(&rays, &random, center, kind < 2 ? 1e-10f : size, 100);
        rtt_rays_features(&rays, &random, &model, kind == 2 ? 1e16f : 3 * size, 300);
        rtt_rays_features(&rays, &random, &model, kind < 2 ? 1e-15f : kind == 2 ? 1e10f : 1e-3f * size, 100);
        rtt_rays_tighten(&rays, &model, 100);
        rtt_check("extremes", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* All alike, all in one plane, on one line, or nested with one centre: nothing for a builder to split by. */
static void rtt_test_unsplittable(void)
{
    rtt_random random = rtt_stream();

    for (int kind = 0; kind < 5; kind++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };

        for (int i = 0; i < 3000; i++) {
            float s = ldexpf((float)(i % 1000 + 1), -10);

            switch (kind) {
            case 0: rtt_face(&model, rtt_v(-1, -1, 0), rtt_v(1, -1, 0), rtt_v(0, 1, 0)); break;
            case 1: rtt_face(&model, rtt_v(-s, -s, -s), rtt_v(s, -s, s), rtt_v(0, 2 * s, 0)); break;
            case 2: rtt_face(&model, rtt_v(s, s, 0), rtt_v(s + 1, s, 0), rtt_v(s, s + 1, 0)); break;
            case 3: rtt_ball(&model, rtt_origin, s); break;
            default: rtt_ball(&model, rtt_v(0x1p-149f * (float)(i & 7), 0, 0), i % 2 ? 1.0f : 0.0f); break;
            }
        }
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 16);
        rtt_rays_features(&rays, &random, &model, 3, 24);
        rtt_check("unsplittable", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* Random bits as coordinates, radii and indices: NaN, infinities and the out of range are left out, the rest is traced. */
static void rtt_test_garbage(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 40; i++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        uint32_t word[4];

        for (int k = 0; k < 60; k++) {
            rt_vec3 p;

            for (int w = 0; w < 4; w++)
                word[w] = rtt_bits(&random);
            memcpy(&p, word, sizeof p);
            if (k % 2 && i % 2)
                p = rtt_point(&random, rtt_origin, 1);
            rtt_vertex(&model, p);
            memcpy(&p.x, &word[3], sizeof p.x);
            if (!(fabsf(p.x) > 1e17f && fabsf(p.x) < 2e18f))            /* centre + radius near the limit is for other tests */
                rtt_ball(&model, p, k % 3 ? p.x : rtt_log(&random, -20, 20));
        }
        for (int k = 0; k < 60; k++) {
            uint32_t a = rtt_below(&random, 62), b = rtt_below(&random, 60);

            rtt_triangle(&model, a, b, rtt_below(&random, 60));
        }
        rtt_triangle(&model, 0, 1, RT_NONE);
        for (size_t k = 0; k < model.sphere_count; k++)                /* extents that overflow only together with the centre */
            if (fabsf(model.spheres[k].center.x) > 1e17f || fabsf(model.spheres[k].center.y) > 1e17f
                || fabsf(model.spheres[k].center.z) > 1e17f || model.spheres[k].radius > 1e17f)
                model.spheres[k].radius = -1;
        model.skip_invalid = true;
        for (int e = -100; e <= 56; e += 26)
            rtt_rays_mixed(&rays, &random, rtt_origin, ldexpf(1, e), 24);
        rtt_check("garbage", &model, &rays);
        rtt_model_free(&model);
        rtt_rays_free(&rays);
    }
}

/* ---- >>intervals: ugly rays, intervals, batches ---------------------------------------------------------------------- */

static void rtt_ugly_rays(rtt_rays *rays, rtt_random *random)
{
    static const float odd[] = { NAN, INFINITY, -INFINITY, 0.0f, -0.0f, 0x1p-149f, -0x1p-149f, 1e-38f, 0.99f * RT_MIN_DIRECTION,
                                 RT_MIN_DIRECTION, 1e-18f, 1e-10f, 1, -1, 1e10f, RT_MAX_COORDINATE, 1.01f * RT_MAX_COORDINATE, -2e18f,
                                 RT_MAX_DIRECTION, 1.01f * RT_MAX_DIRECTION, FLT_MAX };
    static const float ends[] = { NAN, INFINITY, -INFINITY, 0.0f, -0.0f, -1, 1, 2.5f, 0x1p-149f, FLT_MAX, -FLT_MAX };

    for (size_t i = 0; i < RTT_COUNT(odd); i++)
        for (int axis = 0; axis < 3; axis++) {
            rt_vec3 org = rtt_point(random, rtt_origin, 2), dir = rtt_point(random, rtt_origin, 1), zero = rtt_origin;

            (&org.x)[axis] = odd[i];
            rtt_segment(rays, org, dir, 0, INFINITY);
            org = rtt_point(random, rtt_origin, 2);
            (&dir.x)[axis] = odd[i];
            rtt_segment(rays, org, dir, 0, INFINITY);
            (&zero.x)[axis] = odd[i];
            rtt_segment(rays, org, zero, 0, INFINITY);
            rtt_segment(rays, rtt_origin, zero, -INFINITY, INFINITY);
            rtt_segment(rays, rtt_mul(zero, -2), zero, 0, INFINITY);
            (&zero.x)[(axis + 1) % 3] = -0.0f;
            rtt_segment(rays, rtt_origin, zero, 0, INFINITY);
            rtt_segment(rays, org, rtt_mul(dir, RT_MIN_DIRECTION), 0, INFINITY);
            rtt_segment(rays, org, rtt_mul(dir, 2 * RT_MIN_DIRECTION), 0, INFINITY);
            rtt_segment(rays, org, rtt_mul(dir, RT_MAX_DIRECTION), 0, INFINITY);
        }
    for (size_t i = 0; i < RTT_COUNT(ends); i++)
        for (size_t j = 0; j < RTT_COUNT(ends); j++) {
            rt_vec3 p = rtt_point(random, rtt_origin, 1);

            rtt_segment(rays, rtt_v(0.1f, 0.2f, -3), rtt_v(0, 0, 1), ends[i], ends[j]);
            rtt_segment(rays, p, rtt_point(random, rtt_origin, 1), ends[i], ends[j]);
        }
}

static void rtt_ugly_scene(rtt_model *model, rtt_model *child, rtt_random *random)
{
    rtt_cloud(child, random, 20, rtt_origin, 1, 1);
    rtt_quad(model, rtt_v(-1, -1, 0), rtt_v(2, 0, 0), rtt_v(0, 2, 0));
    rtt_quad(model, rtt_v(0, -1, -1), rtt_v(0, 2, 0), rtt_v(0, 0, 2));
    rtt_cloud(model, random, 60, rtt_origin, 1, 0.5f);
    rtt_balls(model, random, 20, rtt_origin, 1, 0.5f);
    rtt_place(model, child, rtt_v(0.5f, 1, 2), rtt_v(1, 0, 0));
}

/* Each ugly ray alone in its batch of its own kind, then strewn among good ones, whose answers must not change. */
static void rtt_test_ugly_rays(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays ugly = { 0 }, mixed = { 0 };

    rtt_ugly_scene(&model, &child, &random);
    rtt_ugly_rays(&ugly, &random);
    rtt_check("ugly rays", &model, &ugly);
    for (size_t i = 0; i < ugly.count; i++) {
        if (i % 3 == 0)
            rtt_rays_pinhole(&mixed, rtt_v(0, 0.1f, -4), rtt_origin, 1, 2);
        rtt_rays_mixed(&mixed, &random, rtt_origin, 1, rtt_below(&random, 4));
        mixed.ray = (rt_ray *)rtt_grow(mixed.ray, mixed.count, sizeof(rt_ray));
        mixed.ray[mixed.count++] = ugly.ray[i];
    }
    rtt_check("ugly among good rays", &model, &mixed);
    rtt_rays_free(&ugly);
    rtt_rays_free(&mixed);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

/* tmin and tmax on every hit of a ray, one after the other: each is found once, in order, none twice. */
static void rtt_test_intervals(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 60);
    for (size_t i = 0; i < 60; i++) {
        rt_ray ray = rays.ray[i];
        float t;

        ray.tmin = -INFINITY;
        while (t = rtt_closest(&model, &ray).t, isfinite(t)) {
            rtt_segment(&rays, ray.org, ray.dir, ray.tmin, t);
            rtt_segment(&rays, ray.org, ray.dir, ray.tmin, nextafterf(t, INFINITY));
            rtt_segment(&rays, ray.org, ray.dir, nextafterf(t, -INFINITY), nextafterf(t, INFINITY));
            rtt_segment(&rays, ray.org, ray.dir, t, INFINITY);
            ray.tmin = t;
        }
    }
    CHECK(rays.count > 600);
    rtt_check("intervals", &model, &rays);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

/* Every count to 70 from any address: all answered, nothing written before or behind. */
static void rtt_test_batches(void)
{
    enum { MOST = 70 };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rtt_accels accels;
    rt_hit want[MOST];
    float *memory = (float *)rtt_array(8 * MOST + 16, sizeof *memory);
    rt_hit *hits = (rt_hit *)rtt_array(MOST + 8, sizeof *hits), sentinel;

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_pinhole(&rays, rtt_v(0, 0, -3), rtt_origin, 1, 7);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, MOST - rays.count);
    for (size_t i = 0; i < MOST; i++)
        want[i] = rtt_closest(&model, &rays.ray[i]);
    memset(&sentinel, 0xcc, sizeof sentinel);
    if (rtt_accels_build(&accels, &model))
        for (size_t w = 0; w < rtt_way_count; w++)
            for (size_t count = 0; count <= MOST; count += count < 34 ? 1 : 9) {
                const rtt_way *way = &rtt_ways[w];
                size_t shift = count % 8;   /* in floats: all that the type of a ray demands */
                rt_ray *unaligned = (rt_ray *)(void *)(memory + shift);

                memcpy(unaligned, rays.ray, count * sizeof(rt_ray));
                memset(hits, 0xcc, (MOST + 8) * sizeof *hits);
                CHECK_STATUS(rt_trace(rtt_accels_for(&accels, way), &way->options, unaligned, count, hits + shift), RT_OK);
                for (size_t i = 0; i < MOST + 8; i++) {
                    bool inside = i >= shift && i < shift + count;
                    rt_hit expected = !inside ? sentinel : way->options.query == RT_ANY ? rtt_any(want[i - shift]) : want[i - shift];

                    if (!rtt_same(hits[i], expected))
                        rtt_fail("%s: %zu rays at %zu: hit %zu", way->label, count, shift, i);
                }
            }
    rtt_accels_free(&accels);
    free(memory);
    free(hits);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

/* Rays in arrays, in packets of any size, with and without what may be left out: the hits of rays in structures. */
static void rtt_test_arrays(void)
{
    enum { MOST = 300 };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 }, plain = { 0 };
    rtt_accels accels;
    rt_hit want[2][MOST], sentinel;
    float from[8][MOST], to[3][MOST + 1];
    uint32_t ids[2][MOST + 1];

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_pinhole(&rays, rtt_v(0, 0, -3), rtt_origin, 1, 15);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, MOST - rays.count);
    for (size_t i = 0; i < MOST; i++) {     /* plain: the default interval, and one origin for all */
        const rt_ray *r = &rays.ray[i];
        const float values[8] = { r->org.x, r->org.y, r->org.z, r->dir.x, r->dir.y, r->dir.z, r->tmin, r->tmax };

        for (size_t k = 0; k < 8; k++)
            from[k][i] = values[k];
        rtt_segment(&plain, rays.ray[0].org, r->dir, 0, INFINITY);
        want[0][i] = rtt_closest(&model, r);
        want[1][i] = rtt_closest(&model, &plain.ray[i]);
    }
    memset(&sentinel, 0xcc, sizeof sentinel);
    if (rtt_accels_build(&accels, &model))
        for (size_t w = 0; w < rtt_way_count; w++)
            for (size_t n = 0; n < 6; n++) {
                static const size_t counts[] = { 0, 1, 13, 64, 257, MOST };
                const rtt_way *way = &rtt_ways[w];
                bool bare = n % 2, any = way->options.query == RT_ANY;
                size_t count = counts[n];
                rt_ray_arrays in = { { from[0], from[1], from[2] }, { from[3], from[4], from[5] }, bare ? NULL : from[6],
                                     bare ? NULL : from[7], bare };
                rt_hit_arrays out = { to[0], to[1], to[2], ids[0], ids[1] };

                memset(to, 0xcc, sizeof to);
                memset(ids, 0xcc, sizeof ids);
                if (w % 3 == 1)
                    out.u = out.v = NULL;
                if (w % 3 == 2)
                    out.inst = NULL;
                CHECK_STATUS(rt_trace_arrays(rtt_accels_for(&accels, way), &way->options, &in, count, &out), RT_OK);
                for (size_t i = 0; i <= count; i++) {
                    rt_hit got, expected = i == count ? sentinel : any ? rtt_any(want[bare][i]) : want[bare][i];

                    if (i < count && !out.u)
                        expected.u = expected.v = sentinel.u;
                    if (i < count && !out.inst)
                        expected.inst = sentinel.inst;
                    got.t = to[0][i];
                    got.u = to[1][i];
                    got.v = to[2][i];
                    got.prim = ids[0][i];
                    got.inst = ids[1][i];
                    if (!rtt_same(got, expected))
                        rtt_fail("%s: %zu rays in arrays: hit %zu", way->label, count, i);
                }
            }
    rtt_accels_free(&accels);
    rtt_rays_free(&rays);
    rtt_rays_free(&plain);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

/* Every argument that is missing is named. */
static void rtt_test_arrays_errors(void)
{
    const float numbers[3] = { 0, 0, 1 };
    const rt_hit_arrays nowhere = { NULL, NULL, NULL, NULL, NULL };
    rt_trace_options options;
    rt_geometry nothing;
    rt_accel *accel;
    rt_error error;

    memset(&options, 0, sizeof options);
    memset(&nothing, 0, sizeof nothing);
    options.error = &error;
    CHECK_STATUS(rt_build(&accel, &nothing, NULL), RT_OK);
    for (int bad = 0; bad < 10; bad++) {
        static const char *const parts[] = { "org.x", "org.y", "org.z", "dir.x", "dir.y", "dir.z", "accel", "rays", "hits", "count" };
        rt_ray_arrays in = { { numbers, numbers, numbers }, { numbers, numbers, numbers }, NULL, NULL, false };

        memset(&error, 0, sizeof error);
        if (bad < 3)
            in.org[bad] = NULL;
        else if (bad < 6)
            in.dir[bad - 3] = NULL;
        CHECK_STATUS(rt_trace_arrays(bad == 6 ? NULL : accel, &options, bad == 7 ? NULL : &in, bad == 9 ? (size_t)-1 : 1,
                                     bad == 8 ? NULL : &nowhere), RT_ERROR_ARGUMENT);
        CHECK(error.status == RT_ERROR_ARGUMENT && strstr(error.message, parts[bad]));
        if (bad >= 6)
            continue;
        CHECK_STATUS(rt_trace_arrays(accel, NULL, &in, 0, &nowhere), RT_OK);      /* nothing is read */
    }
    rt_free(accel);
}

/* ---- >>watertight ---------------------------------------------------------------------------------------------------- */

/* All rays must hit, every way, with equal bits. */
static void rtt_check_no_leak(const char *what, const rtt_model *model, const rtt_rays *rays)
{
    rt_hit *want = (rt_hit *)rtt_array(rays->count, sizeof *want);
    rt_geometry geometry = rtt_geometry(model);
    rt_build_options options;
    rt_accel *accel;
    size_t misses = 0;

    for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)s;
        if (!rtt_structure_built(options.structure) || !CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            continue;
        for (size_t i = 0; i < rays->count; i++)
            if (!rt_intersect(accel, &rays->ray[i], &want[i]) && misses++ == 0)
                rtt_fail("%s: ray %zu leaks: org {%a,%a,%a} dir {%a,%a,%a}", what, i, (double)rays->ray[i].org.x,
                         (double)rays->ray[i].org.y, (double)rays->ray[i].org.z, (double)rays->ray[i].dir.x, (double)rays->ray[i].dir.y,
                         (double)rays->ray[i].dir.z);
        rtt_compare_ways(what, accel, rays, want, true, rtt.cases, s == RT_KDTREE ? 13 : s == RT_THREADED ? 7 : 1);
        rt_free(accel);
    }
    if (misses)
        rtt_fail("%s: %zu of %zu rays leak", what, misses, rays->count);
    free(want);
}

/* The same, and a part of them against the oracle. Of very many rays a sanitizer, which sees nothing new in them, gets the first part; the
   sample, which the checksum has, is of all. */
static void rtt_check_closed(const char *what, const rtt_model *model, const rtt_rays *rays)
{
    rtt_rays sample = { 0 }, part = *rays;

    for (size_t i = 0; i < rays->count; i += rays->count / 40 + 1)
        rtt_segment(&sample, rays->ray[i].org, rays->ray[i].dir, rays->ray[i].tmin, rays->ray[i].tmax);
    rtt_check(what, model, &sample);
    if (part.count > 30000)
        part.count /= rtt.scale;
    rtt_check_no_leak(what, model, &part);
    rtt_rays_free(&sample);
}

/* From inside at nothing in particular, corners, edges; along axes from a lattice of points around center. */
static void rtt_rays_inside(rtt_rays *rays, rtt_random *random, const rtt_model *mesh, rt_vec3 center, float room, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        rt_vec3 from = rtt_to(rtt_lattice(random, 4), rtt_f(room * 0.25f), center), dir = rtt_point(random, rtt_origin, 1);

        if (i % 4 == 0 && (dir.x != 0 || dir.y != 0 || dir.z != 0))
            rtt_segment(rays, from, dir, 0, INFINITY);
        else if (i % 4 == 1)
            rtt_segment(rays, from, rtt_axis(rtt_below(random, 6)), 0, INFINITY);
        else
            rtt_aim(rays, i % 8 == 2 ? center : from, rtt_feature(mesh, random));
    }
}

static void rtt_test_watertight(void)
{
    static const float scales[] = { 1, 1e-6f, 0.37f, 1e6f };
    static const float offsets[] = { 0, 1024, 131072 };                /* in units of the scale */
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(scales); s++)
        for (size_t o = 0; o < RTT_COUNT(offsets); o++)
            for (int shape = 0; shape < 3; shape++) {
                rtt_model mesh = { 0 };
                rtt_rays rays = { 0 };
                float scale = scales[s];
                rt_vec3 offset = rtt_mul(rtt_v(1, -0.75f, 0.5f), rtt_f(scale * offsets[o]));

                if (shape < 2) {
                    rtt_cube(&mesh, 8, shape == 1, scale, offset);
                    rtt_rays_inside(&rays, &random, &mesh, offset, 0.25f * scale, 2000);
                } else {
                    rtt_torus(&mesh, 4, scale, offset);
                    for (int i = 0; i < 16; i++) {
                        double x, y;
                        rt_vec3 middle;

                        rtt_circle(i, 4, &x, &y);
                        middle = rtt_to(rtt_v((float)(2 * x), (float)(2 * y), 0), scale, offset);
                        rtt_rays_inside(&rays, &random, &mesh, middle, 0.25f * scale, 125);
                    }
                }
                rtt_check_closed(shape == 0 ? "closed cube" : shape == 1 ? "closed sphere" : "closed torus", &mesh, &rays);
                rtt_model_free(&mesh);
                rtt_rays_free(&rays);
            }
}

/* Meshes on whole numbers seen from outside along the axes, through every corner and edge within the outline. */
static void rtt_test_watertight_grid(void)
{
    for (int round = 0; round < 2; round++) {
        rtt_model mesh = { 0 };
        rtt_rays rays = { 0 };

        rtt_cube(&mesh, 16, round == 1, 1, rtt_origin);
        for (unsigned axis = 0; axis < 6; axis++)
            for (int i = -31; i <= 31; i++)
                for (int j = -31; j <= 31; j++) {
                    rt_vec3 p = rtt_mul(rtt_axis((axis + 2) % 6), (float)i / 32), q = rtt_mul(rtt_axis((axis + 4) % 6), (float)j / 32);

                    if (!round || abs(i) + abs(j) < 32)                /* the octahedron of the sphere's six poles lies within it */
                        rtt_segment(&rays, rtt_add(rtt_add(p, q), rtt_mul(rtt_axis(axis), -3)), rtt_axis(axis), 0, INFINITY);
                }
        rtt_check_closed("axis-parallel grid", &mesh, &rays);
        rtt_model_free(&mesh);
        rtt_rays_free(&rays);
    }
}

/* Many rays on a finer mesh. */
static void rtt_test_watertight_many(void)
{
    rtt_random random = rtt_stream();
    rtt_model mesh = { 0 };
    rtt_rays rays = { 0 };

    rtt_cube(&mesh, 40, true, 2, rtt_v(148376, 1234, -223423));
    rtt_rays_inside(&rays, &random, &mesh, rtt_v(148376, 1234, -223423), 0.5f, 60000);
    rtt_check_closed("large closed sphere", &mesh, &rays);
    rtt_model_free(&mesh);
    rtt_rays_free(&rays);
}

#if RTI_X86
/* A program may have denormals flushed to zero: hits may then differ from the oracle's, but not from each other, and nothing leaks. */
static void rtt_test_flush_to_zero(void)
{
    static const float scales[] = { 1, 1e-6f, 1e6f };
    const unsigned int given = _mm_getcsr(), flush = 0x8040;           /* FTZ and DAZ */
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(scales); s++) {
        rtt_model mesh = { 0 };
        rtt_rays rays = { 0 };

        rtt_cube(&mesh, 8, true, scales[s], rtt_origin);
        rtt_rays_inside(&rays, &random, &mesh, rtt_origin, 0.25f * scales[s], 2000);
        _mm_setcsr(given | flush);
        rtt_check_no_leak("flush to zero", &mesh, &rays);
        _mm_setcsr(given);
        rtt_model_free(&mesh);
        rtt_rays_free(&rays);
    }
}
#endif

/* ---- >>refit ---------------------------------------------------------------------------------------------------------- */

static void rtt_shake(rtt_model *model, rtt_random *random, float amount)
{
    for (size_t i = 0; i < 3 * model->vertex_count; i++)
        model->vertices[i] = rtt_f(model->vertices[i] + rtt_f(amount * rtt_signed(random)));
    for (size_t i = 0; i < model->sphere_count; i++) {
        model->spheres[i].center = rtt_point(random, model->spheres[i].center, amount);
        model->spheres[i].radius = fabsf(rtt_f(model->spheres[i].radius + rtt_f(amount * rtt_signed(random))));
    }
    for (size_t i = 0; i < model->instance_count; i++)
        for (int k = 0; k < 12; k++)
            model->instances[i].transform[k] = rtt_f(model->instances[i].transform[k] + rtt_f(0.1f * rtt_f(amount * rtt_signed(random))));
}

static void rtt_oracle_all(const rtt_model *model, const rtt_rays *rays, rt_hit *want)
{
    for (size_t i = 0; i < rays->count; i++)
        want[i] = rtt_closest_at(model, &rays->ray[i], rays->time ? rays->time[i] : 0);
}

/* Moves everything again and again; the hits are those of the moved geometry, nothing is allocated. */
static void rtt_test_refit(void)
{
    for (int kind = 0; kind < 4; kind++) {
        rtt_random random = rtt_stream();
        rtt_model model = { 0 }, child = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel;

        memset(&options, 0, sizeof options);
        options.reference = kind % 2 == 1;
        options.no_binary = kind >= 2;
        rtt_ugly_scene(&model, &child, &random);
        rtt_cloud(&model, &random, 200, rtt_origin, 1, 0.2f);
        geometry = rtt_geometry(&model);
        if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
            for (int frame = 0; frame < 6; frame++) {
                rtt_rays rays = { 0 };
                rt_hit *want;
                size_t calls = rtt_heap.calls;
                rt_info info;

                rtt_shake(&model, &random, frame == 5 ? 100.0f : 0.3f);
                if (frame == 3)             /* indices are read again */
                    model.indices[0] = model.indices[5];
                geometry = rtt_geometry(&model);
                CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
                CHECK(rtt_heap.calls == calls);
                rtt_check_accel("refit", accel, &geometry);
                rtt_rays_mixed(&rays, &random, rtt_origin, frame == 5 ? 50.0f : 1.5f, 200);
                rtt_rays_features(&rays, &random, &model, 4, 200);
                want = (rt_hit *)rtt_array(rays.count, sizeof *want);
                rtt_oracle_all(&model, &rays, want);
                rtt_compare_all("refit", accel, &rays, want);
                rt_get_info(accel, &info);
                CHECK(info.lower.x <= info.upper.x);
                free(want);
                rtt_rays_free(&rays);
            }
            rt_free(accel);
        }
        rtt_model_free(&model);
        rtt_model_free(&child);
    }
}

/* A refit that fails leaves every hit as it was, and says which primitive. */
static void rtt_check_refit_errors(const rt_build_options *options)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rt_geometry geometry, changed;
    rt_accel *accel;
    rt_error error;
    rt_hit *want;
    float kept;
    uint32_t kept_index;

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 200);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&model, &rays, want);
    geometry = rtt_geometry(&model);
    if (CHECK_STATUS(rt_build(&accel, &geometry, options), RT_OK)) {
        static const float bad[] = { NAN, INFINITY, -INFINITY, 1.01e18f };

        for (size_t i = 0; i < RTT_COUNT(bad); i++) {
            size_t last = model.triangle_count - 1;

            kept = model.vertices[3 * (size_t)model.indices[3 * last] + 1];
            model.vertices[0] = rtt_f(model.vertices[0] + 1);          /* good, and yet must not be taken over */
            model.vertices[3 * (size_t)model.indices[3 * last] + 1] = bad[i];
            CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_GEOMETRY);
            CHECK(error.status == RT_ERROR_GEOMETRY && error.prim == last && error.message[0] != 0);
            rtt_compare_all("failed refit", accel, &rays, want);
            model.vertices[3 * (size_t)model.indices[3 * last] + 1] = kept;

            kept = model.spheres[3].radius;
            model.spheres[3].radius = bad[i] > 0 && i < 2 ? bad[i] : -1;
            CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_GEOMETRY);
            CHECK(error.prim == model.triangle_count + 3);
            model.spheres[3].radius = kept;

            kept = model.instances[0].transform[0];
            model.instances[0].transform[0] = i ? bad[i] : 0;
            if (i < 3) {
                CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_GEOMETRY);
                CHECK(error.prim == model.triangle_count + model.sphere_count);
            }
            model.instances[0].transform[0] = kept;
            rtt_compare_all("failed refit", accel, &rays, want);
        }
        kept_index = model.indices[7];
        model.indices[7] = (uint32_t)model.vertex_count;
        CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_GEOMETRY);
        CHECK(error.prim == 2);
        model.indices[7] = kept_index;

        changed = geometry, changed.triangle_count--;
        CHECK_STATUS(rt_refit_error(accel, &changed, &error), RT_ERROR_ARGUMENT);
        CHECK(error.status == RT_ERROR_ARGUMENT && error.message[0] != 0);
        changed = geometry, changed.sphere_count--;
        CHECK_STATUS(rt_refit(accel, &changed), RT_ERROR_ARGUMENT);
        changed = geometry, changed.instance_count--;
        CHECK_STATUS(rt_refit(accel, &changed), RT_ERROR_ARGUMENT);
        CHECK_STATUS(rt_refit(accel, NULL), RT_ERROR_ARGUMENT);
        CHECK_STATUS(rt_refit(NULL, &geometry), RT_ERROR_ARGUMENT);
        rtt_compare_all("failed refit", accel, &rays, want);
        rt_free(accel);
    }
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

static void rtt_test_refit_errors(void)
{
    rt_build_options options;

    memset(&options, 0, sizeof options);
    rtt_check_refit_errors(&options);
    options.no_binary = true;
    rtt_check_refit_errors(&options);
}

/* A child is refitted, then its parent; what was left out at the build stays out. */
static void rtt_test_refit_nested(void)
{
    rtt_random random = rtt_stream();
    rtt_model child = { 0 }, world = { 0 };
    rtt_rays rays = { 0 };
    rt_geometry geometry;
    rt_build_options options;
    rt_accel *accel;
    rt_hit *want;
    rt_info info;

    rtt_cloud(&child, &random, 30, rtt_origin, 1, 0.5f);
    rtt_place(&world, &child, rtt_v(1, 2, 1), rtt_v(0, 0, 1));
    rtt_place(&world, &child, rtt_v(1, 1, -1), rtt_v(0, 3, 0));
    rtt_cloud(&world, &random, 30, rtt_origin, 1, 0.5f);
    world.vertices[4] = NAN;                /* triangle 0 */
    world.skip_invalid = true;
    memset(&options, 0, sizeof options);
    options.skip_invalid = true;
    geometry = rtt_geometry(&world);
    if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
        rtt_shake(&child, &random, 2);
        geometry = rtt_geometry(&child);
        CHECK_STATUS(rt_refit(child.accel, &geometry), RT_OK);
        geometry = rtt_geometry(&world);
        CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
        rtt_check_accel("refit nested", accel, &geometry);
        rt_get_info(accel, &info);
        CHECK(info.skipped == 1);
        rtt_rays_mixed(&rays, &random, rtt_origin, 3, 300);
        rtt_rays_features(&rays, &random, &child, 3, 100);
        want = (rt_hit *)rtt_array(rays.count, sizeof *want);
        rtt_oracle_all(&world, &rays, want);
        rtt_compare_all("refit nested", accel, &rays, want);
        world.vertices[4] = 0;              /* good again, and still out */
        CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
        rtt_compare_all("refit nested", accel, &rays, want);
        free(want);
        rt_free(accel);
    }
    rtt_rays_free(&rays);
    rtt_model_free(&world);
    rtt_model_free(&child);
}

/* ---- >>builds --------------------------------------------------------------------------------------------------------- */

typedef struct { void (*body)(void *context, size_t index); void *context; size_t count, next; pthread_mutex_t lock; } rtt_work;

static void *rtt_worker(void *pointer)
{
    rtt_work *work = (rtt_work *)pointer;
    size_t index;

    while (true) {
        pthread_mutex_lock(&work->lock);
        index = work->next++;
        pthread_mutex_unlock(&work->lock);
        if (index >= work->count)
            return NULL;
        work->body(work->context, index);
    }
}

static void rtt_threads(size_t thread_count, size_t count, void (*body)(void *context, size_t index), void *context)
{
    pthread_t threads[8];
    rtt_work work = { body, context, count, 0, PTHREAD_MUTEX_INITIALIZER };

    rtt_in_loop = true;
    for (size_t i = 0; i < thread_count; i++)
        if (pthread_create(&threads[i], NULL, rtt_worker, &work) != 0)
            rtt_die("cannot start a thread");
    for (size_t i = 0; i < thread_count; i++)
        pthread_join(threads[i], NULL);
    rtt_in_loop = false;
}

static void rtt_threaded(void *user, size_t count, void (*body)(void *context, size_t index), void *context)
{
    ++*(size_t *)user;
    rtt_threads(2, count, body, context);
}

static void rtt_threaded_7(void *user, size_t count, void (*body)(void *context, size_t index), void *context)
{
    ++*(size_t *)user;
    rtt_threads(7, count, body, context);
}

static bool rtt_same_bytes(const void *a, const void *b, size_t size) { return (!a && !b) || (a && b && memcmp(a, b, size) == 0); }

static bool rtt_same_tree(const rt_accel *a, const rt_accel *b)
{
    return a->node_count == b->node_count && a->skipped == b->skipped && a->depth == b->depth && a->bytes == b->bytes
           && memcmp(a->slots, b->slots, sizeof a->slots) == 0 && rtt_same_bytes(a->nodes, b->nodes, a->node_count * sizeof *a->nodes)
           && rtt_same_bytes(a->triangles, b->triangles, a->slots[RTI_TRIANGLE] * sizeof *a->triangles)
           && rtt_same_bytes(a->triangle_ids, b->triangle_ids, a->slots[RTI_TRIANGLE] * sizeof *a->triangle_ids)
           && rtt_same_bytes(a->balls, b->balls, a->slots[RTI_SPHERE] * sizeof *a->balls)
           && rtt_same_bytes(a->ball_ids, b->ball_ids, a->slots[RTI_SPHERE] * sizeof *a->ball_ids)
           && rtt_same_bytes(a->kdnodes, b->kdnodes, a->node_count * sizeof *a->kdnodes) && a->kdslot_count == b->kdslot_count
           && rtt_same_bytes(a->kdlinks, b->kdlinks, a->node_count / 2 * sizeof *a->kdlinks)
           && rtt_same_bytes(a->kdslots, b->kdslots, a->kdslot_count * sizeof *a->kdslots);
}

/* The same tree, bit for bit, whatever the compiler, its flags and the instructions that it may use. */
static void rtt_test_pinned(void)
{
    static const struct { rt_quality quality; uint64_t hash; } known[] = {
        { RT_BUILD_DEFAULT, UINT64_C(17418679197948549949) },
        { RT_BUILD_FAST, UINT64_C(7573738656887001668) },
        { RT_BUILD_HIGH, UINT64_C(16046738735141170099) }
    };
    enum { FACES = 30000 };
    static float vertices[9 * FACES];
    static rt_sphere spheres[100];
    rt_geometry geometry;
    uint32_t state = 1;

    for (size_t i = 0; i < RTT_COUNT(vertices); i++) {          /* no product whose sum might be contracted */
        state = state * 1664525 + 1013904223;
        vertices[i] = (float)(state >> 20) / 64 + (i < 9 ? 0 : vertices[i - 9]) / (i % 45 < 9 ? 16 : 1.125f);
    }
    for (size_t i = 0; i < RTT_COUNT(spheres); i++) {
        spheres[i].center = rtt_v(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
        spheres[i].radius = (float)(i % 8);
    }
    memset(&geometry, 0, sizeof geometry);
    geometry.vertices = vertices;
    geometry.vertex_count = 3 * (size_t)FACES;
    geometry.triangle_count = FACES;
    geometry.spheres = spheres;
    geometry.sphere_count = RTT_COUNT(spheres);
    for (size_t k = 0; k < RTT_COUNT(known); k++) {
        uint64_t hash = UINT64_C(14695981039346656037);
        rt_build_options options;
        rt_accel *accel;

        memset(&options, 0, sizeof options);
        options.quality = known[k].quality;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            return;
        CHECK(rti_validate(accel));
        for (size_t i = 0; i < accel->node_count; i++) {
            uint32_t words[8];

            memcpy(words, &accel->nodes[i], sizeof words);
            for (int j = 0; j < 8; j++)
                hash = (hash ^ words[j]) * UINT64_C(1099511628211);
        }
        for (size_t i = 0; i < accel->slots[RTI_TRIANGLE]; i++)
            hash = (hash ^ accel->triangles[i].prim) * UINT64_C(1099511628211);
        if (!CHECK(hash == known[k].hash))
            printf("    quality %d: a tree of hash %llu\n", (int)known[k].quality, (unsigned long long)hash);
        rt_free(accel);
    }
}

/* The same tree, bit for bit, with any parallel_for. */
static void rtt_test_parallel(void)
{
    static const size_t sizes[] = { 1, 2, 5, 100, 3000, 200000 };
    static const rt_parallel_for loops[] = { rtt_backwards, rtt_threaded, rtt_threaded_7 };
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(sizes); s++)
        for (int kind = 0; kind < 2 * RT_STRUCTURE_COUNT; kind++) {
            size_t n = sizes[s] > 10000 ? sizes[s] / rtt.scale : sizes[s];
            rtt_model model = { 0 };
            rt_build_options options;
            rt_geometry geometry;
            rt_accel *serial, *parallel;

            memset(&options, 0, sizeof options);
            options.structure = (rt_structure)(kind / 2);
            options.reference = kind % 2 == 1;
            options.skip_invalid = true;
            if (!rtt_structure_built(options.structure))
                continue;
            rtt_cloud(&model, &random, n - n / 3, rtt_origin, 1, 0.01f);
            rtt_balls(&model, &random, n / 6, rtt_origin, 1, 0.01f);
            for (size_t i = 0; i < n / 3 - n / 6; i++)
                rtt_face(&model, rtt_origin, rtt_v(1, 0, 0), rtt_v(0, 1, 0));
            if (s > 1)
                model.vertices[9] = NAN;
            geometry = rtt_geometry(&model);
            if (!CHECK_STATUS(rt_build(&serial, &geometry, &options), RT_OK))
                break;
            for (size_t k = 0; k < RTT_COUNT(loops); k++) {
                size_t calls = 0;

                options.parallel_for = loops[k];
                options.parallel_user = &calls;
                if (CHECK_STATUS(rt_build(&parallel, &geometry, &options), RT_OK)) {
                    CHECK(rtt_same_tree(serial, parallel));
                    CHECK(calls > 0 || n < 10000);
                    CHECK(rti_validate(parallel));
                    rt_free(parallel);
                }
            }
            rt_free(serial);
            rtt_model_free(&model);
        }
}

/* The first bad primitive is named, whatever the threads; *out is NULL; skip_invalid counts instead. */
static void rtt_test_bad_primitives(void)
{
    static const float bad[] = { NAN, INFINITY, -INFINITY, 1.01e18f, -FLT_MAX };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < 2 * RTT_COUNT(bad) + 8; i++)
        for (int kind = 0; kind < 2 * RT_STRUCTURE_COUNT; kind++) {
            rtt_model model = { 0 };
            rt_build_options options;
            rt_geometry geometry;
            rt_accel *accel = (rt_accel *)(void *)&model;
            size_t calls = 0, first, many = i % 2 ? 20000 : 10, skipped = 0;
            rt_error error;
            rt_info info;

            if (!rtt_structure_built((rt_structure)(kind / 2)))
                continue;
            rtt_cloud(&model, &random, many, rtt_origin, 1, 0.1f);
            rtt_balls(&model, &random, 10, rtt_origin, 1, 0.1f);
            if (i < RTT_COUNT(bad)) {
                first = many / 2;
                model.vertices[9 * first + i % 9] = bad[i];
                model.vertices[9 * (many - 1)] = NAN;
                model.spheres[0].radius = -1;
            } else if (i < 2 * RTT_COUNT(bad)) {
                first = many + 4;
                (&model.spheres[4].center.x)[i % 4] = bad[i - RTT_COUNT(bad)];          /* centre or radius */
                model.spheres[9].radius = -1;
            } else {
                first = i % 2 ? many / 3 : 0;
                model.indices[3 * first + i % 3] = i % 4 ? (uint32_t)model.vertex_count : RT_NONE;
                model.indices[3 * many - 1] = RT_NONE - 1;
            }
            geometry = rtt_geometry(&model);
            memset(&options, 0, sizeof options);
            options.structure = (rt_structure)(kind / 2);
            options.error = &error;
            options.parallel_for = kind % 2 ? rtt_threaded : NULL;
            options.parallel_user = &calls;
            CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_GEOMETRY);
            CHECK(accel == NULL && error.status == RT_ERROR_GEOMETRY && error.prim == first);
            CHECK(error.message[0] != 0 && strchr(error.message, '\n') == NULL);
            for (size_t k = 0; k < model.triangle_count + model.sphere_count; k++)
                skipped += rtt_bad(&model, k);
            options.skip_invalid = true;
            if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
                rt_get_info(accel, &info);
                CHECK(info.skipped == skipped);
                rtt_check_accel("skip_invalid", accel, &geometry);
            }
            rt_free(accel);
            rtt_model_free(&model);
        }
}

/* Without indices, with a stride; the caller's arrays may go after a build that copied; all primitives bad. */
static void rtt_test_layouts(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };
    rt_hit *want;

    rtt_cloud(&model, &random, 100, rtt_origin, 1, 0.3f);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 200);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&model, &rays, want);
    for (int kind = 0; kind < 8 * RT_STRUCTURE_COUNT; kind++) {
        size_t stride = kind & 2 ? 5 : 3, size = stride * model.vertex_count;
        float *vertices = (float *)rtt_array(size, sizeof *vertices);
        rt_geometry geometry = rtt_geometry(&model);
        rt_build_options options;
        rt_accel *accel;

        for (size_t i = 0; i < size; i++)
            vertices[i] = i % stride < 3 ? model.vertices[3 * (i / stride) + i % stride] : NAN;
        geometry.vertices = vertices;
        geometry.vertex_stride = kind & 2 ? stride * sizeof *vertices : 0;
        if (kind & 1)
            geometry.indices = NULL;
        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)(kind / 8);
        options.reference = (kind & 4) != 0;
        if (rtt_structure_built(options.structure) && CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
            rtt_check_accel("layout", accel, &geometry);
            rtt_compare_all("layout", accel, &rays, want);
            CHECK_STATUS(rt_refit(accel, &geometry), options.structure == RT_KDTREE ? RT_ERROR_UNSUPPORTED : RT_OK);
            for (size_t i = 0; !options.reference && i < size; i++)
                vertices[i] = NAN;
            rtt_compare_all("layout", accel, &rays, want);
            rt_free(accel);
        }
        free(vertices);
    }
    for (size_t i = 0; i < model.vertex_count; i++)
        model.vertices[3 * i] = NAN;
    model.skip_invalid = true;
    rtt_check("nothing left", &model, &rays);
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
}

/* A million triangles: memory within what the header says, all given back; then a million that are one and the same. */
static void rtt_test_million(void)
{
    const size_t n = (rtt.big ? (size_t)10000000 : 1000000) / rtt.scale;
    float *vertices = (float *)rtt_array(9 * n, sizeof *vertices);
    static const float one[9] = { -1, -1, 0, 1, -1, 0, 0, 1, 0 };
    double seconds[2];

    for (int same = 0; same < 2; same++) {
        rtt_random random = rtt_stream();
        rtt_memory memory = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel;
        rt_info info;
        rt_ray ray = { { 0.01f, 0.02f, -3 }, 0, { 0, 0, 1 }, INFINITY };
        rt_hit hit;

        for (size_t i = 0; i < 9 * n; i++)
            vertices[i] = same ? one[i % 9] : i % 9 < 3 ? rtt_signed(&random)
                               : rtt_f(vertices[i - i % 9 + i % 3] + rtt_f(0.003f * rtt_signed(&random)));
        memset(&geometry, 0, sizeof geometry);
        geometry.vertices = vertices;
        geometry.vertex_count = 3 * n;
        geometry.triangle_count = n;
        memset(&options, 0, sizeof options);
        options.memory_user = &memory;
        seconds[same] = rtt_seconds();
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            break;
        seconds[same] = rtt_seconds() - seconds[same];
        rt_get_info(accel, &info);
        printf("    %zu %s triangles: %.2f s, depth %d, %.1f bytes a triangle, %.1f at the peak of the build\n", n,
               same ? "equal" : "random", seconds[same], info.depth, (double)memory.live / (double)n, (double)memory.peak / (double)n);
        CHECK(memory.live == info.bytes || (memory.live >= info.bytes && memory.live - info.bytes <= 4096));
        CHECK(memory.peak <= n * 250 + 65536 && memory.live <= n * 175 + 65536);
        CHECK(info.depth <= RTI_MAX_DEPTH && rti_validate(accel));
        CHECK(rt_intersect(accel, &ray, &hit) || !same);
        CHECK(!same || hit.prim == 0);
        rt_free(accel);
        CHECK(memory.live == 0 && memory.blocks == 0);
    }
    CHECK(seconds[1] < 5 * seconds[0] + 1);
    free(vertices);
}

/* Every quality builds a right tree, and a better one costs less. */
static void rtt_test_quality(void)
{
    static const rt_quality order[] = { RT_BUILD_FAST, RT_BUILD_DEFAULT, RT_BUILD_HIGH };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rt_geometry geometry;
    double sah = HUGE_VAL;

    rtt_cube(&model, 40, true, 1, rtt_origin);
    rtt_cloud(&model, &random, 5000, rtt_origin, 1, 0.05f);
    geometry = rtt_geometry(&model);
    for (size_t i = 0; i < RTT_COUNT(order) * RT_STRUCTURE_COUNT; i++) {
        rt_build_options options;
        rt_accel *accel;
        rt_info info;

        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)(i / RTT_COUNT(order));
        options.quality = order[i % RTT_COUNT(order)];
        if (!rtt_structure_built(options.structure))
            continue;
        if (i % RTT_COUNT(order) == 0)
            sah = HUGE_VAL;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            break;
        rt_get_info(accel, &info);
        rtt_check_accel("quality", accel, &geometry);
        CHECK(info.sah > 1 && info.sah < 1.05 * sah);
        CHECK(info.sah < 200);              /* brute force costs 24,200 */
        sah = info.sah;
        rt_free(accel);
    }
    rtt_model_free(&model);
}

/* Reinsertion: long triangles across each other, and spheres, cost less with each quality, in the same tree with any parallel_for; of triangles
   one inside the other, which would be best as a list, the tree stays as deep as traversals allow. */
static void rtt_test_reinsertion(void)
{
    static const rt_quality order[] = { RT_BUILD_FAST, RT_BUILD_DEFAULT, RT_BUILD_HIGH };
    static const rt_parallel_for loops[] = { rtt_backwards, rtt_threaded, rtt_threaded_7 };
    rtt_random random = rtt_stream();
    double sah = HUGE_VAL;
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };
    rt_build_options options;
    rt_geometry geometry;
    rt_accel *accel, *parallel;
    rt_info info;
    rt_hit *want;

    for (size_t i = 0; i < 20000 / rtt.scale; i++) {
        rt_vec3 a = rtt_point(&random, rtt_origin, 1), along = rtt_v(0, 0, 0);

        *(i % 3 == 0 ? &along.x : i % 3 == 1 ? &along.y : &along.z) = 1;
        rtt_face(&model, a, rtt_add(a, along), rtt_add(a, rtt_point(&random, rtt_origin, 0.01f)));
    }
    rtt_cloud(&model, &random, 20000 / rtt.scale, rtt_origin, 1, 0.01f);
    rtt_balls(&model, &random, 2000, rtt_origin, 1, 0.02f);
    geometry = rtt_geometry(&model);
    memset(&options, 0, sizeof options);
    for (size_t q = 0; q < RTT_COUNT(order); q++) {
        options.quality = order[q];
        options.parallel_for = NULL;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            break;
        rt_get_info(accel, &info);
        rtt_check_accel("reinsertion", accel, &geometry);
        if (!CHECK(info.sah < 0.99 * sah))
            printf("    quality %d: %g, after %g\n", (int)order[q], info.sah, sah);
        sah = info.sah;
        for (size_t k = 0; k < RTT_COUNT(loops); k++) {
            size_t calls = 0;

            options.parallel_for = loops[k];
            options.parallel_user = &calls;
            if (CHECK_STATUS(rt_build(&parallel, &geometry, &options), RT_OK)) {
                CHECK(rtt_same_tree(accel, parallel));
                rt_free(parallel);
            }
        }
        rt_free(accel);
    }
    rtt_model_free(&model);

    memset(&model, 0, sizeof model);
    options.parallel_for = NULL;
    for (int i = 0; i < 600; i++) {
        const float size = rtt_f(1e17f * powf(0.9f, (float)i));

        rtt_face(&model, rtt_v(size, 0, 0), rtt_v(0, size, 0), rtt_v(0, 0, size));
    }
    for (int i = 0; i < 150; i++) {
        rtt_segment(&rays, rtt_origin, rtt_add(rtt_v(1, 1, 1), rtt_point(&random, rtt_origin, 0.3f)), 0, INFINITY);
        rtt_aim(&rays, rtt_point(&random, rtt_origin, rtt_f(1e17f * powf(0.8f, (float)i))), rtt_feature(&model, &random));
    }
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&model, &rays, want);
    geometry = rtt_geometry(&model);
    for (size_t q = 0; q < RTT_COUNT(order); q++) {
        options.quality = order[q];
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            break;
        rt_get_info(accel, &info);
        rtt_check_accel("reinsertion", accel, &geometry);
        if (!CHECK(info.depth <= RTI_MAX_DEPTH && (order[q] != RT_BUILD_HIGH || info.depth == RTI_MAX_DEPTH)))
            printf("    quality %d: depth %d\n", (int)order[q], info.depth);
        rtt_compare_all("reinsertion", accel, &rays, want);
        CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
        rtt_compare_all("reinsertion refitted", accel, &rays, want);
        rt_free(accel);
    }
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
}

/* ---- >>oom ------------------------------------------------------------------------------------------------------------ */

/* Fails allocation 1, 2, ... of a build until it succeeds: each time the status says so and nothing is kept. */
static void rtt_fail_each(const rtt_model *model, rt_build_options options)
{
    rt_geometry geometry = rtt_geometry(model);

    for (int after = 0; after < 2; after++)
        for (size_t k = 1;; k++) {
            rtt_memory memory = { 0 };
            rt_accel *accel = (rt_accel *)(void *)&memory;
            rt_status status;
            rt_error error;

            memset(&error, 0, sizeof error);
            memory.fail_at = k;
            memory.fail_after = after == 1;
            options.memory_user = &memory;
            options.error = &error;
            status = rt_build(&accel, &geometry, &options);
            if (status == RT_OK) {
                CHECK(memory.calls < k);
                CHECK(k > 1);               /* or nothing was allocated through the hook */
                CHECK(rti_validate(accel));
                rt_free(accel);
                CHECK(memory.live == 0 && memory.blocks == 0);
                break;
            }
            CHECK_STATUS(status, RT_ERROR_MEMORY);
            CHECK(accel == NULL && error.status == RT_ERROR_MEMORY && error.message[0] != 0);
            if (!CHECK(memory.live == 0 && memory.blocks == 0) || !CHECK(k < 1000))
                break;
        }
}

static void rtt_test_out_of_memory(void)
{
    static const size_t sizes[] = { 0, 1, 2, 9, 300, 20000 };
    rtt_random random = rtt_stream();
    size_t live = rtt_heap.live;

    for (size_t s = 0; s < RTT_COUNT(sizes); s++)
        for (int kind = 0; kind < 4 * RT_STRUCTURE_COUNT; kind++) {
            rtt_model model = { 0 }, child = { 0 };
            rt_build_options options;
            size_t calls = 0;

            memset(&options, 0, sizeof options);
            options.structure = (rt_structure)(kind / 4);
            options.reference = kind % 4 == 1;
            options.no_binary = kind % 4 == 2;
            options.skip_invalid = kind % 4 == 2;
            options.parallel_for = kind % 4 == 3 ? rtt_threaded : NULL;
            options.parallel_user = &calls;
            if (!rtt_structure_built(options.structure))
                continue;
            if (sizes[s] > 0) {
                size_t n = kind < 4 || sizes[s] < 4096 ? sizes[s] : 4096;              /* more than one task in any case */

                rtt_cloud(&model, &random, n, rtt_origin, 1, 0.1f);
                rtt_balls(&model, &random, n / 2, rtt_origin, 1, 0.1f);
                rtt_cloud(&child, &random, 4, rtt_origin, 1, 0.1f);
                if (n < 1000)
                    rtt_place(&model, &child, rtt_v(1, 1, 1), rtt_v(0, 0, 1));
                if (kind % 4 == 2)
                    model.vertices[0] = NAN;
            }
            rtt_fail_each(&model, options);
            rtt_model_free(&model);
            rtt_model_free(&child);
        }
    CHECK(rtt_heap.live == live);
}

/* ---- >>options: what is not allowed is said, and nothing is touched ----------------------------------------------------- */

/* One rt_trace that must fail with want; its message must hold part, its hits must stay. */
static void rtt_refused(const rt_accel *accel, rt_trace_options options, rt_status want, const char *part)
{
    rt_ray ray = { { 0.2f, 0.2f, 1 }, 0, { 0, 0, -1 }, INFINITY };
    rt_hit hits[3], untouched[3];
    rt_ray rays[3];
    rt_error error;

    for (int i = 0; i < 3; i++)
        rays[i] = ray;
    memset(hits, 0xcc, sizeof hits);
    memset(untouched, 0xcc, sizeof untouched);
    memset(&error, 0, sizeof error);
    options.error = &error;
    CHECK_STATUS(rt_trace(accel, &options, rays, 3, hits), want);
    CHECK(error.status == want && error.prim == RT_NONE);
    if (!strstr(error.message, part) || !error.message[0] || strchr(error.message, '\n'))
        rtt_fail("the message \"%s\" lacks \"%s\"", error.message, part);
    CHECK(memcmp(hits, untouched, sizeof hits) == 0);
    options.error = NULL;
    CHECK_STATUS(rt_trace(accel, &options, rays, 3, hits), want);
}

static void rtt_test_trace_options(void)
{
    const rt_algorithm_info *info;
    rt_trace_options options;
    rtt_model model = { 0 };
    rtt_accels accels;
    const rt_accel *accel;
    rt_ray ray = { { 0.2f, 0.2f, 1 }, 0, { 0, 0, -1 }, INFINITY };
    rt_hit hit;

    rtt_face(&model, rtt_origin, rtt_v(1, 0, 0), rtt_v(0, 1, 0));
    if (!rtt_accels_build(&accels, &model))
        return;
    for (size_t k = 0; (info = rt_algorithm_get(k % RT_ALGORITHM_COUNT)) != NULL && k < RT_ALGORITHM_COUNT * RT_STRUCTURE_COUNT; k++) {
        int widths[64], unset = 0x5a5a;
        size_t i = k % RT_ALGORITHM_COUNT, count = rt_packet_widths(info->algorithm, widths, RTT_COUNT(widths)), used = 0;
        rt_structure structure = (rt_structure)(k / RT_ALGORITHM_COUNT);
        char list[200];

        accel = accels.of[structure];
        if (!accel)
            continue;
        CHECK(info->algorithm == (rt_algorithm)i && info->name[0] && info->what[0]);
        CHECK(count <= RTT_COUNT(widths) && rt_packet_widths(info->algorithm, NULL, 0) == count);
        memset(&options, 0, sizeof options);
        options.algorithm = info->algorithm;
        if (!info->built) {
            CHECK(count == 0);
            rtt_refused(accel, options, RT_ERROR_UNSUPPORTED, info->name);
            continue;
        }
        CHECK(count > 0);
        if (info->structure != RT_STRUCTURE_COUNT && info->structure != structure) {
            const rt_algorithm_info *other;

            rtt_refused(accel, options, RT_ERROR_ARGUMENT, info->name);
            for (size_t o = 0; (other = rt_algorithm_get(o)) != NULL; o++)         /* the message lists what this accel takes */
                if (other->built && (other->structure == structure || other->structure == RT_STRUCTURE_COUNT))
                    rtt_refused(accel, options, RT_ERROR_ARGUMENT, other->name);
            continue;
        }
        for (size_t w = 0; w < count; w++)
            used += (size_t)snprintf(list + used, sizeof list - used, w ? ", %d" : ": %d", widths[w]);
        if (count > 1) {                    /* no more is written than there is room for */
            int room[2] = { unset, unset };

            CHECK(rt_packet_widths(info->algorithm, room, 1) == count && room[0] == widths[0] && room[1] == unset);
        }
        for (int width = -1; width <= 40; width++) {
            bool listed = width == 0;

            for (size_t w = 0; w < count; w++)
                listed = listed || widths[w] == width;
            options.packet_width = width;
            if (listed)
                CHECK_STATUS(rt_trace(accel, &options, &ray, 1, &hit), RT_OK);
            else
                rtt_refused(accel, options, RT_ERROR_ARGUMENT, list);
        }
        options.packet_width = 0;
        for (int cull = 1; cull < RT_CULL_COUNT; cull++) {
            rt_status status;

            options.cull = (rt_cull)cull;
            status = rt_trace(accel, &options, &ray, 1, &hit);
            if (status != RT_OK)
                rtt_refused(accel, options, status == RT_ERROR_UNSUPPORTED ? RT_ERROR_UNSUPPORTED : RT_ERROR_ARGUMENT, "cull");
        }
        for (int isa = 0; isa < RT_ISA_COUNT; isa++) {
            memset(&options, 0, sizeof options);
            options.algorithm = info->algorithm;
            options.isa = (rt_isa)isa;
            if (isa == RT_ISA_AUTO || isa == (int)rt_best_isa())
                CHECK_STATUS(rt_trace(accel, &options, &ray, 1, &hit), RT_OK);
            else if (rt_trace(accel, &options, &ray, 1, &hit) != RT_OK || isa > (int)rt_best_isa())
                rtt_refused(accel, options, RT_ERROR_UNSUPPORTED, rtt_isa_names[isa]);
        }
    }
    CHECK(rt_algorithm_get(RT_ALGORITHM_COUNT) == NULL && rt_algorithm_get(SIZE_MAX) == NULL);
    CHECK(rt_packet_widths((rt_algorithm)RT_ALGORITHM_COUNT, NULL, 0) == 0);
    accel = accels.of[RT_BVH];
    for (int bad = 0; bad < 8; bad++) {
        int value = bad % 2 ? 1000 : -1;

        memset(&options, 0, sizeof options);
        if (bad / 2 == 0)
            options.algorithm = (rt_algorithm)(bad % 2 ? RT_ALGORITHM_COUNT : value);
        else if (bad / 2 == 1)
            options.cull = (rt_cull)value;
        else if (bad / 2 == 2)
            options.query = (rt_query)value;
        else
            options.isa = (rt_isa)value;
        rtt_refused(accel, options, RT_ERROR_ARGUMENT, "");
    }
    memset(&options, 0, sizeof options);
    CHECK_STATUS(rt_trace(accel, NULL, &ray, 1, &hit), RT_OK);
    CHECK_STATUS(rt_trace(accel, &options, NULL, 0, NULL), RT_OK);
    CHECK_STATUS(rt_trace(NULL, &options, &ray, 1, &hit), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_trace(accel, &options, NULL, 1, &hit), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_trace(accel, &options, &ray, 1, NULL), RT_ERROR_ARGUMENT);
    rtt_accels_free(&accels);
    rtt_model_free(&model);
}

static void rtt_test_build_options(void)
{
    static const float triangle[] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    static const uint32_t indices[] = { 0, 1, 2 };
    static const rt_sphere sphere = { { 0, 0, 0 }, 1 };
    const struct { size_t field; rt_status want; } cases[] = {
        { 0, RT_ERROR_ARGUMENT }, { 1, RT_ERROR_ARGUMENT }, { 2, RT_ERROR_ARGUMENT }, { 3, RT_ERROR_ARGUMENT }, { 4, RT_ERROR_ARGUMENT },
        { 5, RT_ERROR_ARGUMENT }, { 6, RT_ERROR_ARGUMENT }, { 7, RT_ERROR_ARGUMENT }, { 8, RT_ERROR_ARGUMENT }, { 9, RT_ERROR_LIMIT },
        { 10, RT_ERROR_LIMIT }, { 11, RT_ERROR_GEOMETRY }, { 12, RT_ERROR_LIMIT }
    };
    const struct { size_t offset; float value; const char *name, *allowed; } bad[] = {
        { offsetof(rt_build_options, traversal_cost), -1, "traversal_cost", "0" },
        { offsetof(rt_build_options, traversal_cost), -0x1p-149f, "traversal_cost", "0" },
        { offsetof(rt_build_options, traversal_cost), NAN, "traversal_cost", "0" },
        { offsetof(rt_build_options, traversal_cost), INFINITY, "traversal_cost", "0" },
        { offsetof(rt_build_options, empty_bonus), NAN, "empty_bonus", "1" },
        { offsetof(rt_build_options, empty_bonus), 0x1.000002p0f, "empty_bonus", "1" },
        { offsetof(rt_build_options, empty_bonus), INFINITY, "empty_bonus", "1" },
        { offsetof(rt_build_options, max_duplication), 0x1.fffffep-1f, "max_duplication", "1" },
        { offsetof(rt_build_options, max_duplication), -4, "max_duplication", "1" },
        { offsetof(rt_build_options, max_duplication), NAN, "max_duplication", "1" },
    };
    rt_instance no_accel;
    rt_geometry whole;
    rt_accel *accel;

    memset(&whole, 0, sizeof whole);
    memset(&no_accel, 0, sizeof no_accel);
    no_accel.transform[0] = no_accel.transform[5] = no_accel.transform[10] = 1;
    whole.vertices = triangle, whole.vertex_count = 3;
    whole.indices = indices, whole.triangle_count = 1;
    whole.spheres = &sphere, whole.sphere_count = 1;
    for (size_t i = 0; i < RTT_COUNT(cases); i++) {
        rt_geometry geometry = whole;
        rt_build_options options;
        rt_error error;

        memset(&options, 0, sizeof options);
        memset(&error, 0, sizeof error);
        options.error = &error;
        switch (cases[i].field) {
        case 0: options.structure = (rt_structure)RT_STRUCTURE_COUNT; break;
        case 1: options.structure = (rt_structure)-1; break;
        case 2: options.quality = (rt_quality)3; break;
        case 3: options.quality = (rt_quality)-1; break;
        case 4: geometry.vertex_stride = 14; break;
        case 5: geometry.vertex_stride = 8; break;
        case 6: geometry.vertices = NULL; break;
        case 7: geometry.spheres = NULL; break;
        case 8: geometry.instance_count = 1; break;
        case 9: geometry.triangle_count = SIZE_MAX > UINT32_MAX ? (size_t)(UINT64_C(1) << 32) : SIZE_MAX; break;
        case 10: geometry.sphere_count = SIZE_MAX; break;
        case 11: geometry.indices = NULL, geometry.triangle_count = 2; break;
        default: geometry.triangle_count = RT_NONE, geometry.sphere_count = 2; break;
        }
        accel = (rt_accel *)(void *)&error;
        if (rt_build(&accel, &geometry, &options) != cases[i].want || accel || error.status != cases[i].want || !error.message[0])
            rtt_fail("case %zu: \"%s\" (%s)", i, rt_status_string(error.status), error.message);
        options.error = NULL;
        CHECK_STATUS(rt_build(&accel, &geometry, &options), cases[i].want);
    }
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
        rt_build_options options;
        rt_error error;

        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)s;
        options.error = &error;
        if (rtt_structure_built(options.structure))
            CHECK_STATUS(rt_build(&accel, &whole, &options), RT_OK);
        else {
            CHECK_STATUS(rt_build(&accel, &whole, &options), RT_ERROR_UNSUPPORTED);
            CHECK(accel == NULL && strstr(error.message, rtt_structure_names[s]) != NULL);
        }
        rt_free(accel);
    }
    for (size_t i = 0; i < RTT_COUNT(bad) * RT_STRUCTURE_COUNT; i++) {
        rt_build_options options;
        rt_error error;

        memset(&options, 0, sizeof options);
        memset(&error, 0, sizeof error);
        options.structure = (rt_structure)(i / RTT_COUNT(bad));
        options.error = &error;
        memcpy((char *)&options + bad[i % RTT_COUNT(bad)].offset, &bad[i % RTT_COUNT(bad)].value, sizeof(float));
        if (!rtt_structure_built(options.structure))
            continue;
        accel = (rt_accel *)(void *)&error;
        CHECK_STATUS(rt_build(&accel, &whole, &options), RT_ERROR_ARGUMENT);
        if (accel || error.status != RT_ERROR_ARGUMENT || error.prim != RT_NONE || !strstr(error.message, bad[i % RTT_COUNT(bad)].name)
            || !strstr(error.message, bad[i % RTT_COUNT(bad)].allowed) || strchr(error.message, '\n'))
            rtt_fail("%s %g: \"%s\"", bad[i % RTT_COUNT(bad)].name, (double)bad[i % RTT_COUNT(bad)].value, error.message);
    }
    CHECK_STATUS(rt_build(NULL, &whole, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_build(&accel, NULL, NULL), RT_ERROR_ARGUMENT);
    CHECK(accel == NULL);
    whole.instances = &no_accel, whole.instance_count = 1;
    CHECK(rt_build(&accel, &whole, NULL) != RT_OK && accel == NULL);
}

static void rtt_test_status_strings(void)
{
    for (int i = -2; i < RT_STATUS_COUNT + 3; i++) {
        const char *text = rt_status_string((rt_status)i);

        CHECK(text != NULL && text[0] != 0 && strchr(text, '\n') == NULL);
        for (int k = 0; k < i && i < RT_STATUS_COUNT; k++)
            CHECK(strcmp(text, rt_status_string((rt_status)k)) != 0);
    }
}

/* ---- >>stats ---------------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_STATS
static void rtt_test_stats(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rtt_accels accels;
    rt_hit *hits, *want;
    size_t legal = 0, hit = 0;

    rtt_cloud(&model, &random, 2000, rtt_origin, 1, 0.1f);
    rtt_cloud(&child, &random, 100, rtt_origin, 1, 0.1f);
    rtt_place(&model, &child, rtt_v(1, 1, 1), rtt_v(0, 0, 0.5f));
    rtt_rays_pinhole(&rays, rtt_v(0, 0, -3), rtt_origin, 1, 32);
    rtt_segment(&rays, rtt_origin, rtt_origin, 0, 1);                  /* not legal: not counted */
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    hits = (rt_hit *)rtt_array(rays.count, sizeof *hits);
    rtt_oracle_all(&model, &rays, want);
    for (size_t i = 0; i < rays.count; i++) {
        legal += rtt_legal(&rays.ray[i]);
        hit += want[i].prim != RT_NONE;
    }
    if (rtt_accels_build(&accels, &model))
        for (size_t w = 0; w < rtt_way_count; w++) {
            rt_trace_options options = rtt_ways[w].options;
            const rt_accel *accel = rtt_accels_for(&accels, &rtt_ways[w]);
            bool boxed = accel == accels.of[RT_BVH], ranged = options.algorithm == RT_BVH_RANGED;
            bool crowds = boxed && (options.algorithm == RT_AUTO ? !options.packet_width : options.algorithm == RT_BVH_WIDE && options.packet_width > 1);
            bool large = ranged || options.algorithm == RT_BVH_MASKED || options.algorithm == RT_BVH_PARTITION;
            uint64_t boxes = 0, prims = 0;
            rt_stats once, twice;

            memset(&once, 0, sizeof once);
            options.stats = &once;
            CHECK_STATUS(rt_trace(accel, &options, rays.ray, rays.count, hits), RT_OK);
            rtt_compare("with stats", rtt_ways[w].label, &rays, hits, want, options.query == RT_ANY, true);
            if (once.rays != legal || once.prims < hit || once.nodes < hit || once.leaves < hit || (boxed && !ranged && !crowds && once.boxes < once.nodes)
                || (boxed && once.prims > legal * 2101) || once.active < once.steps || (boxed && (once.restarts || once.drops)))
                rtt_fail("%s: rays %llu nodes %llu boxes %llu prims %llu steps %llu active %llu", rtt_ways[w].label,
                         (unsigned long long)once.rays, (unsigned long long)once.nodes, (unsigned long long)once.boxes,
                         (unsigned long long)once.prims, (unsigned long long)once.steps, (unsigned long long)once.active);
            for (int depth = 0; depth < RT_DEPTHS; depth++) {
                boxes += once.boxes_at[depth];
                prims += once.prims_at[depth];
            }
            CHECK(boxes == (large ? once.boxes : 0) && prims == (large ? once.prims : 0));
            CHECK(options.cull == RT_CULL_NONE && !crowds ? once.frusta == 0 : once.culled > 0 && once.culled < once.frusta);
            twice = once;                   /* a second call adds the same again */
            options.stats = &twice;
            CHECK_STATUS(rt_trace(accel, &options, rays.ray, rays.count, hits), RT_OK);
            CHECK(twice.rays == 2 * once.rays && twice.nodes == 2 * once.nodes && twice.boxes == 2 * once.boxes
                  && twice.prims == 2 * once.prims && twice.pushes == 2 * once.pushes && twice.active == 2 * once.active
                  && twice.leaves == 2 * once.leaves && twice.restarts == 2 * once.restarts && twice.drops == 2 * once.drops
                  && twice.steps == 2 * once.steps);
        }
    rtt_accels_free(&accels);
    free(want);
    free(hits);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}
#endif

/* ---- >>kdtree ---------------------------------------------------------------------------------------------------------- */

/* Scenes that put primitives where splitting planes will be, and rays into them. child: for those that instance something. */
typedef void (*rtt_maker)(rtt_model *model, rtt_model *child, rtt_random *random);

/* The walls of 4 x 4 x 4 rooms, so that cells meet by twos, fours and eights. */
static void rtt_make_rooms(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child, (void)random;
    for (unsigned axis = 0; axis < 3; axis++)
        for (int wall = 0; wall <= 4; wall++)
            for (int i = 0; i < 16; i++) {
                rt_vec3 u = rtt_axis((2 * axis + 2) % 6), v = rtt_axis((2 * axis + 4) % 6);
                rt_vec3 corner = rtt_mul(rtt_axis(2 * axis), (float)wall);

                corner = rtt_add(corner, rtt_add(rtt_mul(u, (float)(i % 4)), rtt_mul(v, (float)(i / 4))));
                rtt_quad(model, corner, u, v);
            }
}

/* Closed boxes of whole sizes on whole numbers, apart, touching and one in another. */
static void rtt_make_boxes(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    for (int i = 0; i < 12; i++) {
        rt_vec3 middle = rtt_add(rtt_lattice(random, 2), rtt_v(2, 2, 2));

        rtt_cube(model, 1, false, 0.5f * (float)(1 + i % 3), middle);
    }
}

/* Everything in one plane: boxes and cells without any thickness along that axis. */
static void rtt_make_flat(rtt_model *model, rtt_random *random, unsigned axis)
{
    rt_vec3 u = rtt_axis((2 * axis + 2) % 6), v = rtt_axis((2 * axis + 4) % 6), at = rtt_mul(rtt_axis(2 * axis), 2);

    for (int i = 0; i < 16; i++)
        rtt_quad(model, rtt_add(at, rtt_add(rtt_mul(u, (float)(i % 4)), rtt_mul(v, (float)(i / 4)))), u, v);
    for (int i = 0; i < 60; i++) {
        rt_vec3 corner[3];

        for (int k = 0; k < 3; k++) {
            corner[k] = rtt_add(at, rtt_mul(u, rtt_f(2 + 2 * rtt_signed(random))));
            corner[k] = rtt_add(corner[k], rtt_mul(v, rtt_f(2 + 2 * rtt_signed(random))));
        }
        rtt_face(model, corner[0], corner[1], corner[2]);
    }
}
static void rtt_make_flat_x(rtt_model *model, rtt_model *child, rtt_random *random) { (void)child; rtt_make_flat(model, random, 0); }
static void rtt_make_flat_y(rtt_model *model, rtt_model *child, rtt_random *random) { (void)child; rtt_make_flat(model, random, 1); }
static void rtt_make_flat_z(rtt_model *model, rtt_model *child, rtt_random *random) { (void)child; rtt_make_flat(model, random, 2); }

/* One point: triangles and spheres without any extent, all at one place. */
static void rtt_make_point(rtt_model *model, rtt_model *child, rtt_random *random)
{
    rt_vec3 p = rtt_v(1, 2, 3);

    (void)child, (void)random;
    for (int i = 0; i < 20; i++) {
        rtt_face(model, p, p, p);
        rtt_ball(model, p, 0);
    }
}

/* A thousand times the same triangle, and a few others through it. */
static void rtt_make_same(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    for (int i = 0; i < 1000; i++)
        rtt_face(model, rtt_v(0, 1, 0), rtt_v(4, 0, 1), rtt_v(1, 4, 3));
    rtt_cloud(model, random, 20, rtt_v(2, 2, 2), 2, 1);
}

/* Thin triangles from one side of everything to the other, along the axes and the diagonals. */
static void rtt_make_needles(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    for (int i = 0; i < 150; i++) {
        rt_vec3 p = rtt_point(random, rtt_v(2, 2, 2), 2), q = rtt_point(random, rtt_v(2, 2, 2), 2);

        if (i % 3 == 0)
            (&p.x)[i % 9 / 3] = 0, (&q.x)[i % 9 / 3] = 4;
        else if (i % 3 == 1)
            p = rtt_v(i % 2 ? 0 : 4, 0, i % 4 < 2 ? 0 : 4), q = rtt_sub(rtt_v(4, 4, 4), p);
        rtt_face(model, p, q, rtt_add(q, rtt_mul(rtt_axis((unsigned)i % 6), ldexpf(1, -(i % 22)))));
    }
}

/* Slivers in one direction, side by side and across each other, among small triangles. */
static void rtt_make_slivers(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    for (int i = 0; i < 60; i++) {
        float s = 4 * (float)i / 60;

        rtt_face(model, rtt_v(0, s, 0), rtt_v(4, s, 4), rtt_v(4, s + 0.01f, 4));
        rtt_face(model, rtt_v(s, 0, 4), rtt_v(s + 0.01f, 4, 0), rtt_v(s, 4, 0));
    }
    rtt_cloud(model, random, 60, rtt_v(2, 2, 2), 2, 0.1f);
}

/* Spheres over many cells, cells that lie inside one, walls that touch a plane, and little to make the planes with. */
static void rtt_make_bubbles(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    rtt_ball(model, rtt_v(2, 2, 2), 40);
    rtt_ball(model, rtt_v(2, 2, 2), 4);
    rtt_ball(model, rtt_v(2, 2, 2), 2);
    for (int i = 0; i < 8; i++)
        rtt_ball(model, rtt_v(i & 1 ? 3 : 1, i & 2 ? 3 : 1, i & 4 ? 3 : 1), 1);
    rtt_balls(model, random, 40, rtt_v(2, 2, 2), 2, 0.2f);
    rtt_cloud(model, random, 40, rtt_v(2, 2, 2), 2, 0.2f);
    for (unsigned axis = 0; axis < 6; axis++)                          /* small cells that the wall of a large sphere just reaches */
        rtt_cloud(model, random, 12, rtt_add(rtt_v(2, 2, 2), rtt_mul(rtt_axis(axis), 4)), 1e-3f, 1e-4f);
}

/* Triangles, spheres and instances at the same places: leaves of all kinds. */
static void rtt_make_kinds(rtt_model *model, rtt_model *child, rtt_random *random)
{
    rtt_cube(child, 1, false, 0.5f, rtt_origin);
    rtt_ball(child, rtt_origin, 0.6f);
    for (int i = 0; i < 27; i++) {
        rt_vec3 p = rtt_v((float)(2 * (i % 3)), (float)(2 * (i / 3 % 3)), (float)(2 * (i / 9)));

        rtt_quad(model, rtt_sub(p, rtt_v(0.5f, 0.5f, 0)), rtt_v(1, 0, 0), rtt_v(0, 1, 0));
        rtt_ball(model, p, 0.5f);
        if (i % 2)
            rtt_place(model, child, rtt_v(1, 1, 1), p);
    }
    rtt_cloud(model, random, 20, rtt_v(2, 2, 2), 2, 1);
}

/* Instances over each other, turned and not, of children with planes of their own. */
static void rtt_make_overlaps(rtt_model *model, rtt_model *child, rtt_random *random)
{
    rtt_make_boxes(child, NULL, random);
    for (int i = 0; i < 8; i++)
        rtt_place(model, child, rtt_v(i & 1 ? 1 : 0.5f, i & 2 ? 1 : -1, i & 4 ? 1 : 0.25f), rtt_v(0, i & 2 ? 0 : 4, (float)(i / 4)));
    for (int i = 0; i < 4; i++) {
        float matrix[12];

        rtt_matrix(random, 1, rtt_point(random, rtt_v(2, 2, 2), 1), matrix);
        rtt_instance(model, child, matrix);
    }
}

static void rtt_make_cloud(rtt_model *model, rtt_model *child, rtt_random *random)
{
    (void)child;
    rtt_cloud(model, random, 300, rtt_v(2, 2, 2), 2, 0.4f);
}

/* All lie in [0, 4]^3, more or less. */
static const struct { const char *name; rtt_maker make; rt_structure child; size_t rays; } rtt_scenes[] = {
    { "rooms", rtt_make_rooms, RT_BVH, 600 }, { "boxes", rtt_make_boxes, RT_BVH, 600 }, { "flat x", rtt_make_flat_x, RT_BVH, 300 },
    { "flat y", rtt_make_flat_y, RT_BVH, 300 }, { "flat z", rtt_make_flat_z, RT_BVH, 300 }, { "point", rtt_make_point, RT_BVH, 200 },
    { "same", rtt_make_same, RT_BVH, 120 }, { "needles", rtt_make_needles, RT_BVH, 400 }, { "slivers", rtt_make_slivers, RT_BVH, 400 },
    { "bubbles", rtt_make_bubbles, RT_BVH, 600 }, { "kinds, bvh", rtt_make_kinds, RT_BVH, 300 }, { "cloud", rtt_make_cloud, RT_BVH, 300 },
    { "kinds, kd", rtt_make_kinds, RT_KDTREE, 300 }, { "overlaps, bvh", rtt_make_overlaps, RT_BVH, 120 },
    { "overlaps, kd", rtt_make_overlaps, RT_KDTREE, 120 },
};

/* How a scene is stretched and moved; offsets are added after the scale. */
static const struct { float scale, offset; } rtt_placings[] = {
    { 1, 0 }, { 0.1f, 1 }, { 1e-3f, -1000 }, { 0x1p-60f, 0 }, { 0x1p40f, 0 }, { 2e16f, -3e17f }
};

static void rtt_scene_make(rtt_model *model, rtt_model *child, rtt_random *random, size_t scene, size_t placing)
{
    float scale = rtt_placings[placing].scale, offset = rtt_placings[placing].offset;

    child->structure = rtt_scenes[scene].child;
    rtt_scenes[scene].make(model, child, random);
    for (size_t i = 0; i < 3 * model->vertex_count; i++)
        model->vertices[i] = rtt_f(rtt_f(model->vertices[i] * scale) + offset);
    for (size_t i = 0; i < model->sphere_count; i++) {
        model->spheres[i].center = rtt_to(model->spheres[i].center, scale, rtt_v(offset, offset, offset));
        model->spheres[i].radius = rtt_f(model->spheres[i].radius * (scale > 1e15f ? 1e15f : scale));
    }
    for (size_t i = 0; i < model->instance_count; i++)
        for (int k = 0; k < 12; k++)
            model->instances[i].transform[k] = rtt_f(rtt_f(model->instances[i].transform[k] * scale) + (k % 4 == 3 ? offset : 0));
}

/* A whole number of units between -1 and 5. */
static float rtt_plane(rtt_random *random) { return (float)rtt_below(random, 7) - 1; }

/* Rays that decide at planes: in them, along the lines and through the points where they meet, within an ulp of either side, starting
   on them, from far away, nearly parallel to them. Neighbours in a batch point to all sides. */
static void rtt_rays_planes(rtt_rays *rays, rtt_random *random, const rtt_model *model, float scale, float offset, size_t count)
{
    static const float small[] = { 0.0f, -0.0f, 0x1p-149f, -0x1p-149f, 1e-38f, -1e-38f, 1e-20f, -1e-20f, 1e-7f, -1e-7f, 0x1p-24f };

    for (size_t i = 0; i < count; i++) {
        rt_vec3 place = rtt_v(offset, offset, offset), target, dir = rtt_lattice(random, 1), back;
        int axis = (int)rtt_below(random, 3);
        float distance, tmin = i % 8 == 7 ? -INFINITY : 0;

        target.x = rtt_plane(random), target.y = rtt_plane(random), target.z = rtt_plane(random);
        if (i % 3 == 0)                     /* in one plane, or in two, but nowhere special in the others */
            (&target.x)[axis] = rtt_f(2 + 2 * rtt_signed(random));
        target = i % 5 == 4 ? rtt_feature(model, random) : rtt_to(target, scale, place);
        if (dir.x == 0 && dir.y == 0 && dir.z == 0)
            dir = rtt_axis(rtt_below(random, 6));
        if (i % 4 == 1)                     /* no longer in the plane, or along it */
            (&target.x)[axis] = nextafterf((&target.x)[axis], i % 8 < 4 ? INFINITY : -INFINITY);
        if (i % 4 == 2) {
            (&dir.x)[axis] = small[rtt_below(random, RTT_COUNT(small))];
            (&dir.x)[(axis + 1) % 3] = rtt_bits(random) & 1 ? 1 : -0.5f;
        }
        if (i % 4 == 3) {
            dir = rtt_point(random, rtt_origin, 1);
            dir = rtt_mul(dir, ldexpf(1, (int)rtt_below(random, 80) - 40));
        }
        switch (i / 4 % 4) {
        case 0: distance = 0; break;        /* starts there */
        case 1: distance = rtt_f(scale * (float)(1 + rtt_below(random, 8))); break;
        case 2: distance = rtt_f(scale * rtt_f(8 * rtt_signed(random))); break;
        default: distance = rtt_f(scale * ldexpf(1, (int)rtt_below(random, 60))); break;
        }
        back = rtt_mul(dir, distance);
        if (fabsf(back.x) > 9e17f || fabsf(back.y) > 9e17f || fabsf(back.z) > 9e17f)
            back = rtt_origin;
        rtt_segment(rays, rtt_sub(target, back), dir, tmin, i % 16 == 5 ? rtt_f(2 * distance) : INFINITY);
        if (i % 4 == 0)
            rtt_aim(rays, rtt_to(rtt_lattice(random, 8), scale, place), target);
    }
}

static void rtt_test_kd_planes(void)
{
    rtt_random random = rtt_stream();

    for (size_t scene = 0; scene < RTT_COUNT(rtt_scenes); scene++)
        for (size_t placing = 0; placing < RTT_COUNT(rtt_placings); placing++) {
            float scale = rtt_placings[placing].scale, offset = rtt_placings[placing].offset;
            rt_vec3 middle = rtt_v(rtt_f(2 * scale + offset), rtt_f(2 * scale + offset), rtt_f(2 * scale + offset));
            rtt_model model = { 0 }, child = { 0 };
            rtt_rays rays = { 0 };
            char what[64];

            snprintf(what, sizeof what, "%s, scale %g offset %g", rtt_scenes[scene].name, (double)scale, (double)offset);
            rtt_scene_make(&model, &child, &random, scene, placing);
            rtt_rays_planes(&rays, &random, &model, scale, offset, rtt_scenes[scene].rays / (placing ? 4 : 1));
            rtt_rays_mixed(&rays, &random, middle, rtt_f(2 * scale), 24);
            rtt_rays_pinhole(&rays, rtt_add(middle, rtt_v(0, 0, -4 * scale)), middle, rtt_f(2 * scale), 7);
            rtt_rays_tighten(&rays, &model, 16);
            rtt_check(what, &model, &rays);
            rtt_model_free(&model);
            rtt_model_free(&child);
            rtt_rays_free(&rays);
        }
}

/* Ever smaller triangles towards a corner: trees of more than 32 levels, which rays out of the corner climb from end to end. */
static void rtt_test_kd_deep(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };
    rt_build_options options;
    rt_geometry geometry;
    rt_accel *accel;
    rt_info info;
    float size = 1;

    for (int i = 0; i < 1000; i++, size = rtt_f(size * 0.95f)) {
        rt_vec3 a = rtt_mul(rtt_v(1, 0.9f, 1), size), b = rtt_mul(rtt_v(1, 1, 0.9f), size);

        rtt_face(&model, rtt_mul(rtt_v(0.99f, 1, 1), size), a, b);
    }
    for (int i = 0; i < 150; i++) {
        rt_vec3 to;

        rtt_segment(&rays, rtt_origin, rtt_add(rtt_v(1, 1, 1), rtt_point(&random, rtt_origin, 0.3f)), 0, INFINITY);
        rtt_segment(&rays, rtt_v(2, 2, 2), rtt_sub(rtt_point(&random, rtt_origin, 0.3f), rtt_v(1, 1, 1)), 0, INFINITY);
        to = rtt_feature(&model, &random);
        rtt_aim(&rays, rtt_point(&random, rtt_origin, ldexpf(1, -(i % 40))), to);
        rtt_segment(&rays, rtt_origin, rtt_v(1, 0.97f, 0.97f), ldexpf(1, -(i % 60)), INFINITY);
    }
    CHECK(rtt_hits(&model, &rays) > 100);
    geometry = rtt_geometry(&model);
    memset(&options, 0, sizeof options);
    options.structure = RT_KDTREE;
    options.traversal_cost = 0.01f;
    if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
        rt_hit *want = (rt_hit *)rtt_array(rays.count, sizeof *want);

        rt_get_info(accel, &info);
        CHECK(info.depth > 32 && info.depth <= RTI_MAX_DEPTH);
        rtt_oracle_all(&model, &rays, want);
        rtt_compare_all("deep", accel, &rays, want);
        rt_free(accel);
        free(want);
    }
    rtt_rays_free(&rays);
    rtt_model_free(&model);
}

/* As deep as allowed with the structures by turns, beginning with either: hits are the same, and name the same path. */
static void rtt_test_kd_nested(void)
{
    for (int first = 0; first < 2; first++) {
        rtt_random random = rtt_stream();
        rtt_model level[RT_MAX_NESTING + 1];
        rtt_rays rays = { 0 };

        memset(level, 0, sizeof level);
        rtt_make_boxes(&level[0], NULL, &random);
        for (int k = 0; k < RT_MAX_NESTING; k++) {
            float matrix[12];

            level[k].structure = (k + first) % 2 ? RT_KDTREE : RT_BVH;
            rtt_place(&level[k + 1], &level[k], rtt_v(1, k % 3 ? 1 : -1, 1), rtt_v(0, k % 3 ? 0 : 4, 0));
            if (k % 4 == 1) {
                rtt_matrix(&random, 1, rtt_origin, matrix);
                rtt_instance(&level[k + 1], &level[k], matrix);
            }
            rtt_quad(&level[k + 1], rtt_v(0, 0, (float)k / 2), rtt_v(4, 0, 0), rtt_v(0, 4, 0));
            rtt_ball(&level[k + 1], rtt_v((float)k / 2, 2, 2), 0.25f);
        }
        rtt_rays_planes(&rays, &random, &level[RT_MAX_NESTING], 1, 0, 24);
        CHECK(rtt_hits(&level[RT_MAX_NESTING], &rays) > rays.count / 4);
        rtt_check("nested by turns", &level[RT_MAX_NESTING], &rays);
        for (size_t k = RTT_COUNT(level); k-- > 0;)
            rtt_model_free(&level[k]);
        rtt_rays_free(&rays);
    }
}

/* An instance in many leaves of each of eight levels: a ray goes through it once a level, whatever the number of leaves. */
static void rtt_test_kd_revisits(void)
{
    enum { RAYS = 200 };
    double prims[2];

    for (int kd = 0; kd < 2; kd++) {
        rtt_random random = rtt_stream();
        rt_accel *accels[RT_MAX_NESTING + 1];
        rt_trace_options trace;
        rt_ray rays[RAYS];
        rt_hit hits[RAYS];
        rt_stats stats;
        int built = 0;

        for (int k = 0; k <= RT_MAX_NESTING; k++) {
            rtt_model model = { 0 };
            rt_build_options options;
            rt_geometry geometry;
            rt_instance instance;

            for (int i = 0; i < 60; i++) {
                rt_vec3 at = rtt_point(&random, rtt_origin, 1);
                rtt_face(&model, at, rtt_add(at, rtt_v(0.02f, 0, 0)), rtt_add(at, rtt_v(0, 0.02f, 0.01f)));
            }
            geometry = rtt_geometry(&model);
            memset(&instance, 0, sizeof instance);
            instance.transform[0] = instance.transform[5] = instance.transform[10] = 1;
            if (k) {
                instance.accel = accels[k - 1];
                geometry.instances = &instance;
                geometry.instance_count = 1;
            }
            memset(&options, 0, sizeof options);
            options.structure = kd ? RT_KDTREE : RT_BVH;
            if (!CHECK_STATUS(rt_build(&accels[k], &geometry, &options), RT_OK))
                break;
            built++;
            rtt_model_free(&model);
        }
        for (int i = 0; i < RAYS; i++)
            rays[i] = (rt_ray){ rtt_point(&random, rtt_origin, 3), 0, rtt_point(&random, rtt_origin, 1), INFINITY };
        memset(&trace, 0, sizeof trace);
        memset(&stats, 0, sizeof stats);
        trace.packet_width = 1;
        trace.stats = &stats;
        CHECK_STATUS(rt_trace(accels[built - 1], &trace, rays, RAYS, hits), RT_OK);
        prims[kd] = (double)stats.prims;
        while (built)
            rt_free(accels[--built]);
    }
    CHECK(prims[1] < 50 * prims[0]);        /* thousands of times as many where each leaf traces it again */
}

/* Primitives that lie in ever more cells the finer the tree: references stay below the limit, depth and time bounded, hits right. */
static void rtt_test_kd_limits(void)
{
    enum { COUNT = 2000 };
    static const float limits[] = { 1, 1.5f, 0, 2, 10 };               /* 0: the default */
    rtt_random random = rtt_stream();
    double plain = 0;

    for (int kind = 0; kind < 7; kind++) {
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        rt_geometry geometry;
        rt_hit *want;

        for (int i = 0; i < COUNT; i++) {
            rt_vec3 p = rtt_point(&random, rtt_origin, 1), q = rtt_point(&random, rtt_origin, 1);
            float s = (float)i / COUNT;

            switch (kind) {
            case 0: rtt_face(&model, p, rtt_add(p, rtt_mul(q, 0.05f)), rtt_add(p, rtt_v(0, 0.05f, 0))); break;
            case 1: rtt_face(&model, p, rtt_mul(p, -1), rtt_add(p, rtt_v(0, 1e-4f, 0))); break;             /* all through the middle */
            case 2: rtt_face(&model, rtt_v(-1, -1, s), rtt_v(1, 1, -s), rtt_v(1, 1, 1e-5f - s)); break;     /* one diagonal, a fan */
            case 3: rtt_face(&model, p, q, rtt_point(&random, rtt_origin, 1)); break;                       /* large, anywhere */
            case 4: rtt_ball(&model, rtt_mul(p, 0.01f), 1 + s); break;                                      /* onions */
            case 5: rtt_face(&model, rtt_v(-1, -1, -1), rtt_v(1, 1, 1), rtt_v(1, -1, 0)); break;            /* the same */
            default: rtt_face(&model, rtt_mul(p, 1e-6f), rtt_mul(q, 1e6f), rtt_mul(rtt_axis((unsigned)i % 6), 1e3f)); break;
            }
        }
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 24);
        rtt_rays_features(&rays, &random, &model, 3, 24);
        want = (rt_hit *)rtt_array(rays.count, sizeof *want);
        rtt_oracle_all(&model, &rays, want);
        geometry = rtt_geometry(&model);
        for (size_t l = 0; l < RTT_COUNT(limits); l++) {
            double start = rtt_seconds(), limit = limits[l] > 0 ? (double)limits[l] : RTI_DUPLICATION;
            rt_build_options options;
            rt_accel *accel;
            rt_info info;

            memset(&options, 0, sizeof options);
            options.structure = RT_KDTREE;
            options.max_duplication = limits[l];
            if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
                break;
            start = rtt_seconds() - start;
            if (kind == 0 && start > plain)
                plain = start;
            rt_get_info(accel, &info);
            if (kind == 0 && limit >= 1.5 && info.max_leaf > COUNT / 50)    /* small triangles need no more */
                rtt_fail("limit %g: a leaf of %zu small triangles", limit, info.max_leaf);
            if (info.references < COUNT || (double)info.references > limit * COUNT || info.depth > RTI_MAX_DEPTH
                || start > 30 * plain + 0.5)
                rtt_fail("kind %d: %zu references of %d with a limit of %g, depth %d, %g s", kind, info.references, (int)COUNT, limit,
                         info.depth, start);
            rtt_check_accel("limits", accel, &geometry);
            rtt_compare_ways("limits", accel, &rays, want, true, l, l ? 5 : 1);
            rt_free(accel);
        }
        free(want);
        rtt_rays_free(&rays);
        rtt_model_free(&model);
    }
}

/* rt_info of a k-d tree: bytes are those asked for, no_backtrack saves some, and what then lacks says why. */
static void rtt_test_kd_info(void)
{
    static const float cases[][3] = { { 0, 0, 0 }, { 4, 0.9f, 0 }, { 0.25f, -1, 1 } };  /* traversal_cost, empty_bonus, max_duplication */
    rtt_random random = rtt_stream();

    for (size_t scene = 0; scene < RTT_COUNT(rtt_scenes); scene++)
        for (size_t i = 0; i < 2 * RTT_COUNT(cases); i++) {
            const float *c = cases[i / 2];
            rtt_model model = { 0 }, child = { 0 };
            rtt_rays rays = { 0 };
            rtt_memory memory[2];
            rt_build_options options;
            rt_geometry geometry;
            rt_accel *accel[2];
            rt_info info[2];
            rt_trace_options backtrack;
            rt_hit *want;

            rtt_scene_make(&model, &child, &random, scene, 0);
            geometry = rtt_geometry(&model);
            memset(memory, 0, sizeof memory);
            memset(&options, 0, sizeof options);
            options.structure = RT_KDTREE;
            options.reference = i % 2 == 1;
            options.traversal_cost = c[0], options.empty_bonus = c[1], options.max_duplication = c[2];
            for (int without = 0; without < 2; without++) {
                options.no_backtrack = without == 1;
                options.memory_user = &memory[without];
                if (!CHECK_STATUS(rt_build(&accel[without], &geometry, &options), RT_OK))
                    return;
                rt_get_info(accel[without], &info[without]);
                rtt_check_accel(rtt_scenes[scene].name, accel[without], &geometry);
                CHECK(info[without].structure == RT_KDTREE && memory[without].live - info[without].bytes < 4);     /* 1 an empty array */
            }
            CHECK(info[1].bytes < info[0].bytes && info[1].nodes == info[0].nodes && info[1].references == info[0].references);
            rtt_rays_planes(&rays, &random, &model, 1, 0, 40);
            want = (rt_hit *)rtt_array(rays.count, sizeof *want);
            rtt_oracle_all(&model, &rays, want);
            rtt_compare_ways("no_backtrack", accel[1], &rays, want, false, 0, 1);
            memset(&backtrack, 0, sizeof backtrack);
            backtrack.algorithm = RT_KD_BACKTRACK;
            rtt_refused(accel[1], backtrack, RT_ERROR_ARGUMENT, "no_backtrack");
            free(want);
            rt_free(accel[0]);
            rt_free(accel[1]);
            CHECK(memory[0].live == 0 && memory[0].blocks == 0 && memory[1].live == 0 && memory[1].blocks == 0);
            rtt_rays_free(&rays);
            rtt_model_free(&model);
            rtt_model_free(&child);
        }
}

#ifndef RT_NO_PACKETS
/* Triangles below a node that one leaf of RT_BVH_WIDE may hold; 0: none may. */
static uint32_t rtt_octet_size(const rt_accel *accel, uint32_t node)
{
    const rti_node *at = &accel->nodes[node];
    uint32_t left, right;

    if (at->count)
        return rti_leaf_kind(at) == RTI_TRIANGLE ? rti_leaf_count(at) : 0;
    left = rtt_octet_size(accel, at->index), right = rtt_octet_size(accel, at->index + 1);
    return left && right && left + right <= RTI_CHILDREN ? left + right : 0;
}

/* Children of a wide node whose places run from node down to nodes of kept. */
static uint32_t rtt_places(const rt_accel *accel, uint32_t node, const bool *kept)
{
    if (accel->nodes[node].count || kept[node] || rtt_octet_size(accel, node))
        return 1;
    return rtt_places(accel, accel->nodes[node].index, kept) + rtt_places(accel, accel->nodes[node].index + 1, kept);
}

/* Of all ways to collapse a small tree, the wide nodes have the least surface. */
static void rtt_test_collapse(void)
{
    rtt_random random = rtt_stream();
    size_t wides = 0;

    for (int round = 0; round < 24; round++) {
        rtt_model model = { 0 };
        rt_geometry geometry;
        rt_accel *accel;
        uint32_t inner[64];
        bool *kept;
        double least = HUGE_VAL, sum;
        int n = 0;

        rtt_cloud(&model, &random, 20 + 4 * (size_t)round, rtt_origin, 1, 0.1f);
        if (round % 4 == 3)
            rtt_balls(&model, &random, 5, rtt_origin, 1, 0.2f);
        geometry = rtt_geometry(&model);
        if (!CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK))
            return;
        kept = (bool *)rtt_array(accel->node_count, sizeof *kept);
        for (uint32_t i = 1; i < accel->node_count; i++)
            if (!accel->nodes[i].count && !rtt_octet_size(accel, i) && n < 64)
                inner[n++] = i;
        for (uint32_t ways = 0; n <= 16 && ways < 1u << n; ways++) {
            bool fits = true;
            double area = rti_node_area(&accel->nodes[0]);

            for (int i = 0; i < n; i++)
                kept[inner[i]] = ways >> i & 1;
            for (int i = -1; i < n && fits; i++) {
                const uint32_t at = i < 0 ? 0 : inner[i];

                if (i >= 0 && !kept[at])
                    continue;
                fits = accel->nodes[at].count || rtt_places(accel, accel->nodes[at].index, kept) + rtt_places(accel, accel->nodes[at].index + 1, kept) <= RTI_CHILDREN;
                area += i < 0 ? 0 : rti_node_area(&accel->nodes[at]);
            }
            if (fits && area < least)
                least = area;
        }
        sum = rti_node_area(&accel->nodes[0]);
        for (size_t w = 0; w < accel->wide_count; w++)
            for (int i = 0; i < RTI_CHILDREN; i++)
                if (accel->wides[w].count[i] == 0) {
                    rti_node node;

                    for (int k = 0; k < 6; k++)
                        node.bounds[k] = accel->wides[w].bounds[k][i];
                    sum += rti_node_area(&node);
                }
        if (n <= 16 && !CHECK(fabs(sum - least) <= 1e-5 * least))
            printf("    %zu wide nodes have %g, least is %g of %d binary ones\n", accel->wide_count, sum, least, n);
        wides += n <= 16 ? accel->wide_count : 0;
        free(kept);
        rt_free(accel);
        rtt_model_free(&model);
    }
    if (!CHECK(wides >= 30))
        printf("    %zu wide nodes in all\n", wides);
}
#endif

/* no_wide and no_binary save bytes; what then lacks says why, and what is left goes on without. */
static void rtt_test_less(void)
{
    static const char *const names[] = { "all", "no_wide", "no_binary" };
    rtt_random random = rtt_stream();

    for (size_t scene = 0; scene < RTT_COUNT(rtt_scenes); scene++) {
        rtt_model model = { 0 }, child = { 0 };
        rtt_rays rays = { 0 };
        rtt_memory memory[3];
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel[3];
        rt_info info[3];
        rt_hit *want;

        rtt_scene_make(&model, &child, &random, scene, 0);
        geometry = rtt_geometry(&model);
        memset(memory, 0, sizeof memory);
        rtt_rays_planes(&rays, &random, &model, 1, 0, 40);
        want = (rt_hit *)rtt_array(rays.count, sizeof *want);
        rtt_oracle_all(&model, &rays, want);
        for (int less = 0; less < 3; less++) {
            memset(&options, 0, sizeof options);
            options.no_wide = less == 1;
            options.no_binary = less == 2;
            options.memory_user = &memory[less];
            if (!CHECK_STATUS(rt_build(&accel[less], &geometry, &options), RT_OK))
                return;
            rt_get_info(accel[less], &info[less]);
            CHECK(memory[less].live - info[less].bytes < 4);           /* 1 an empty array */
            CHECK(memcmp(&info[less].lower, &info[0].lower, sizeof(rt_vec3)) == 0 && memcmp(&info[less].upper, &info[0].upper, sizeof(rt_vec3)) == 0);
            CHECK(info[less].references == info[0].references);
        }
        CHECK(info[1].bytes < info[0].bytes && info[1].nodes == info[0].nodes);
        CHECK(info[2].bytes < info[0].bytes && info[2].nodes <= info[0].nodes + 1 && info[2].depth <= info[0].depth + 1);
        for (int a = 0; a < RT_ALGORITHM_COUNT; a++) {
            rt_trace_options way;

            memset(&way, 0, sizeof way);
            way.algorithm = (rt_algorithm)a;
            if (rt_algorithm_get((size_t)a)->structure == RT_BVH)
                rtt_refused(accel[a == RT_BVH_WIDE ? 1 : 2], way, RT_ERROR_ARGUMENT, a == RT_BVH_WIDE ? "no_wide" : "no_binary");
            if (a == RT_KD_STACK) {         /* is told what is taken, and no more */
                rtt_refused(accel[1], way, RT_ERROR_ARGUMENT, "auto, bvh.stack, bvh.simd, bvh.masked");
                rtt_refused(accel[2], way, RT_ERROR_ARGUMENT, "a bvh and takes: auto, bvh.wide");
            }
        }
        for (int less = 0; less < 3; less++) {
            for (size_t i = 0; i < rays.count; i++) {
                rt_hit hit;

                if (rt_intersect(accel[less], &rays.ray[i], &hit) != (want[i].prim != RT_NONE) || memcmp(&hit, &want[i], sizeof hit) != 0
                    || rt_occluded(accel[less], &rays.ray[i]) != (want[i].prim != RT_NONE)) {
                    rtt_fail("%s: ray %zu differs, %s", rtt_scenes[scene].name, i, names[less]);
                    break;
                }
            }
            rt_free(accel[less]);
            CHECK(memory[less].live == 0 && memory[less].blocks == 0);
        }
        free(want);
        rtt_rays_free(&rays);
        rtt_model_free(&model);
        rtt_model_free(&child);
    }
}

/* Accels with no binary tree are instanced by such alone, with the same hits, however deep; else the build or the refit says which. So does
   what would leave nothing, and a device. */
static void rtt_test_no_binary(void)
{
    rtt_random random = rtt_stream();
    rtt_model child = { 0 }, world = { 0 };
    rtt_rays rays = { 0 };
    rt_build_options options;
    rt_geometry geometry;
    rt_accel *part, *outer, *held;
    rt_error error;
    rt_hit *want;

    rtt_cloud(&child, &random, 300, rtt_origin, 1, 0.5f);
    rtt_balls(&child, &random, 20, rtt_origin, 1, 0.3f);
    for (int i = 0; i < 40; i++)
        rtt_place(&world, &child, rtt_v(1, 2, 1), rtt_point(&random, rtt_origin, 6));
    rtt_cloud(&world, &random, 200, rtt_origin, 6, 0.5f);
    rtt_rays_mixed(&rays, &random, rtt_origin, 4, 600);
    rtt_rays_features(&rays, &random, &world, 6, 200);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&world, &rays, want);
    memset(&options, 0, sizeof options);
    options.error = &error;
    options.no_binary = true;
    geometry = rtt_geometry(&child);
    CHECK_STATUS(rt_build(&part, &geometry, &options), RT_OK);
    for (size_t i = 0; i < world.instance_count; i += 2)            /* the others keep both trees */
        world.instances[i].accel = part;
    geometry = rtt_geometry(&world);
    for (int s = 0; s <= RT_STRUCTURE_COUNT; s++) {                 /* last: as it must be */
        options.structure = s < RT_STRUCTURE_COUNT ? (rt_structure)s : RT_BVH;
        options.no_binary = options.structure != RT_BVH || s == RT_STRUCTURE_COUNT;
        if (!rtt_structure_built(options.structure))
            continue;
        CHECK_STATUS(rt_build(&outer, &geometry, &options), s < RT_STRUCTURE_COUNT ? RT_ERROR_ARGUMENT : RT_OK);
        CHECK(s == RT_STRUCTURE_COUNT || (!outer && error.prim == world.triangle_count + world.sphere_count && strstr(error.message, "no_binary")));
    }
    rtt_check_accel("no_binary in no_binary", outer, &geometry);
    rtt_compare_all("no_binary in no_binary", outer, &rays, want);
    CHECK_STATUS(rt_refit_error(outer, &geometry, &error), RT_OK);
    rtt_compare_all("refitted, no_binary in no_binary", outer, &rays, want);
    if (rtt_device.gpu) {
        rt_gpu_accel *there = (rt_gpu_accel *)(void *)&error;

        CHECK_STATUS(rt_gpu_upload(rtt_device.gpu, &there, outer, &error), RT_ERROR_ARGUMENT);
        CHECK(!there && strstr(error.message, "no_binary"));
    }
    rt_free(outer);

    for (size_t i = 0; i < world.instance_count; i++)
        world.instances[i].accel = child.accel;
    geometry = rtt_geometry(&world);
    options.no_binary = false;
    CHECK_STATUS(rt_build(&held, &geometry, &options), RT_OK);
    world.instances[7].accel = part;
    CHECK_STATUS(rt_refit_error(held, &geometry, &error), RT_ERROR_ARGUMENT);
    CHECK(error.prim == world.triangle_count + world.sphere_count + 7 && strstr(error.message, "no_binary"));
    rtt_compare_all("after a refit that failed", held, &rays, want);
    rt_free(held);
    rt_free(part);

    options.no_binary = options.no_wide = true;
    CHECK_STATUS(rt_build(&outer, &geometry, &options), RT_ERROR_ARGUMENT);
    CHECK(!outer && strstr(error.message, "no_binary"));
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&world);
    rtt_model_free(&child);
}

/* What each option of the builder is for: no gain from empty space without a bonus, a deeper tree where nodes are cheap. */
static void rtt_test_kd_options(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rt_geometry geometry;
    rt_build_options options;
    rt_accel *accel;
    rt_info usual, cheap, dear, once, eager;
    const struct { float traversal_cost, empty_bonus, max_duplication; rt_info *info; } cases[] = {
        { 0, 0, 0, &usual }, { 0.25f, 0, 0, &cheap }, { 8, 0, 0, &dear }, { 0, 0, 1, &once }, { 0, 0.9f, 0, &eager }
    };

    for (int i = 0; i < 6; i++)
        rtt_cube(&model, 6, true, 0.5f, rtt_mul(rtt_lattice(&random, 2), 2));
    geometry = rtt_geometry(&model);
    for (size_t i = 0; i < RTT_COUNT(cases); i++) {
        memset(&options, 0, sizeof options);
        options.structure = RT_KDTREE;
        options.traversal_cost = cases[i].traversal_cost;
        options.empty_bonus = cases[i].empty_bonus;
        options.max_duplication = cases[i].max_duplication;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            return;
        rt_get_info(accel, cases[i].info);
        rt_free(accel);
    }
    CHECK(usual.empty_leaves > 0 && usual.references > usual.triangles);
    CHECK(cheap.nodes > usual.nodes && usual.nodes > dear.nodes);
    CHECK(once.references == once.triangles);
    CHECK(eager.empty_leaves > usual.empty_leaves);
    rtt_model_free(&model);
}

/* What a k-d tree does not do is refused, and then nothing has changed. */
static void rtt_test_kd_refused(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 }, nothing = { 0 };
    rtt_rays rays = { 0 };
    rtt_accels accels, empty;
    rt_geometry geometry;
    rt_trace_options options;
    rt_error error;
    rt_hit *want;

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 100);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&model, &rays, want);
    geometry = rtt_geometry(&model);
    if (rtt_accels_build(&accels, &model) && rtt_accels_build(&empty, &nothing)) {
        rt_accel *kd = accels.of[RT_KDTREE];

        rtt_shake(&model, &random, 1);
        CHECK_STATUS(rt_refit_error(kd, &geometry, &error), RT_ERROR_UNSUPPORTED);
        CHECK(error.status == RT_ERROR_UNSUPPORTED && strstr(error.message, "kdtree") != NULL);
        CHECK_STATUS(rt_refit(kd, &geometry), RT_ERROR_UNSUPPORTED);
        rtt_compare_all("refit refused", kd, &rays, want);
        memset(&options, 0, sizeof options);
        for (int algorithm = RT_KD_STACK; algorithm <= RT_KD_BACKTRACK; algorithm++)
            for (int bad = 0; bad < 4; bad++) {
                memset(&options, 0, sizeof options);
                options.algorithm = (rt_algorithm)algorithm;
                options.short_stack = bad == 0 ? -1 : bad == 1 ? RT_MAX_SHORT_STACK + 1 : bad == 2 ? INT32_MIN : INT32_MAX;
                rtt_refused(kd, options, RT_ERROR_ARGUMENT, "short_stack");
                rtt_refused(kd, options, RT_ERROR_ARGUMENT, "32");
                rtt_refused(empty.of[RT_KDTREE], options, RT_ERROR_ARGUMENT, "short_stack");
            }
        memset(&options, 0, sizeof options);
        options.algorithm = RT_KD_BACKTRACK;
        for (int width = 2; width <= 16; width *= 2) {                 /* no packets: "no known method to add" them */
            options.packet_width = width;
            rtt_refused(kd, options, RT_ERROR_ARGUMENT, "one of: 1;");
        }
#if RTI_X86
        for (int algorithm = RT_KD_STACK; algorithm < RT_KD_BACKTRACK; algorithm++) {
            memset(&options, 0, sizeof options);
            options.algorithm = (rt_algorithm)algorithm;
            options.isa = RT_ISA_SSE2;
            options.packet_width = 8;
            rtt_refused(kd, options, RT_ERROR_ARGUMENT, "one of: 1, 2;");
        }
#endif
        for (int s = 0; s < RT_STRUCTURE_COUNT; s++)                   /* also where there is nothing to trace */
            if (empty.of[s]) {
                memset(&options, 0, sizeof options);
                options.algorithm = s == RT_KDTREE ? RT_BVH_STACK : RT_KD_RESTART;
                rtt_refused(empty.of[s], options, RT_ERROR_ARGUMENT, rtt_structure_names[s]);
            }
    }
    rtt_accels_free(&accels);
    rtt_accels_free(&empty);
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

#ifndef RT_NO_STATS
static rt_stats rtt_count(const rt_accel *accel, rt_algorithm algorithm, int short_stack, const rtt_rays *rays, const rt_hit *want)
{
    rt_hit *hits = (rt_hit *)rtt_array(rays->count, sizeof *hits);
    rt_trace_options options;
    rt_stats stats;

    memset(&options, 0, sizeof options);
    memset(&stats, 0, sizeof stats);
    options.algorithm = algorithm;
    options.packet_width = 1;
    options.short_stack = short_stack;
    options.stats = &stats;
    CHECK_STATUS(rt_trace(accel, &options, rays->ray, rays->count, hits), RT_OK);
    rtt_compare("counted", rt_algorithm_get(algorithm)->name, rays, hits, want, false, true);
    free(hits);
    return stats;
}

static bool rtt_same_visits(rt_stats a, rt_stats b) { return a.nodes == b.nodes && a.leaves == b.leaves && a.prims == b.prims; }

/* Two cubes with a gap: planes at both sides of the gap, one node over the other, three leaves. Each ray goes with its mirror image, so
   that sums do not depend on which plane is the upper one. */
static void rtt_test_kd_counts(void)
{
    static const struct { rt_ray ray; rt_algorithm algorithm; unsigned nodes, leaves, prims, pushes, restarts; } cases[] = {
        { { { -1, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_STACK, 3, 2, 24, 2, 0 },     /* from outside: the first cube */
        { { { -1, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_RESTART, 3, 2, 24, 0, 0 },
        { { { -1, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_SHORTSTACK, 3, 2, 24, 2, 0 },
        { { { -1, 0.25f, 0.5f }, 0, { 1, 0, 0 }, 0.5f }, RT_KD_STACK, 0, 0, 0, 0, 0 },          /* ends before the root box */
        { { { 2, 0.25f, 3 }, 0, { 0, 0, 1 }, INFINITY }, RT_KD_STACK, 0, 0, 0, 0, 0 },          /* starts behind it */
        { { { 5, -1, 0.5f }, 0, { 0, 1, 0 }, INFINITY }, RT_KD_STACK, 4, 0, 0, 0, 0 },          /* through the gap: empty, not visited */
        { { { 5, -1, 0.5f }, 0, { 0, 1, 0 }, INFINITY }, RT_KD_RESTART, 4, 0, 0, 0, 0 },
        { { { 5, -1, 0.5f }, 0, { 0, 1, 0 }, INFINITY }, RT_KD_BACKTRACK, 4, 0, 0, 0, 0 },
        { { { 2, 0.25f, 0.5f }, 0, { 1, 0, 0 }, 6 }, RT_KD_PUSHDOWN, 4, 0, 0, 0, 0 },           /* within it */
        { { { 2, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_STACK, 4, 2, 24, 1, 0 },      /* from it to a cube */
        { { { 2, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_RESTART, 5, 2, 24, 0, 1 },    /* the upper node again */
        { { { 2, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_PUSHDOWN, 5, 2, 24, 0, 1 },
        { { { 2, 0.25f, 0.5f }, 0, { 1, 0, 0 }, INFINITY }, RT_KD_SHORTSTACK, 4, 2, 24, 1, 0 },
    };
    rtt_model model = { 0 };
    rt_build_options options;
    rt_geometry geometry;
    rt_accel *accel;
    rt_info info;

    rtt_cube(&model, 1, false, 0.5f, rtt_v(0.5f, 0.5f, 0.5f));
    rtt_cube(&model, 1, false, 0.5f, rtt_v(9.5f, 0.5f, 0.5f));
    geometry = rtt_geometry(&model);
    memset(&options, 0, sizeof options);
    options.structure = RT_KDTREE;
    options.traversal_cost = 2;             /* too dear to cut the cubes' faces off */
    if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
        return;
    rt_get_info(accel, &info);
    CHECK(info.nodes == 5 && info.leaves == 3 && info.empty_leaves == 1 && info.depth == 2 && info.references == 24 && info.max_leaf == 12);
    CHECK(fabs(info.sah - (1 + 19.0 / 21 + 2 * 12 * 3.0 / 21)) < 1e-6);         /* half areas: 21 in all, 19 below, 3 a cube */
    for (size_t i = 0; i < RTT_COUNT(cases); i++)
        for (int shift = 0; shift < 2; shift++) {
            rt_ray ray = cases[i].ray, mirrored = ray;
            rtt_rays rays = { 0 };
            rt_hit want[2];
            rt_stats stats;

            mirrored.org.x = rtt_f(10 - ray.org.x), mirrored.dir.x = -ray.dir.x;
            rtt_segment(&rays, ray.org, ray.dir, ray.tmin, ray.tmax);
            rtt_segment(&rays, mirrored.org, mirrored.dir, mirrored.tmin, mirrored.tmax);
            rtt_oracle_all(&model, &rays, want);
            stats = rtt_count(accel, cases[i].algorithm, shift ? 1 : 0, &rays, want);
            if (stats.rays != 2 || stats.nodes != cases[i].nodes || stats.leaves != cases[i].leaves || stats.prims != cases[i].prims
                || stats.pushes != cases[i].pushes || stats.restarts != cases[i].restarts || (!shift && stats.drops))
                rtt_fail("case %zu: nodes %llu leaves %llu prims %llu pushes %llu restarts %llu drops %llu", i,
                         (unsigned long long)stats.nodes, (unsigned long long)stats.leaves, (unsigned long long)stats.prims,
                         (unsigned long long)stats.pushes, (unsigned long long)stats.restarts, (unsigned long long)stats.drops);
            rtt_rays_free(&rays);
        }
    rt_free(accel);
    rtt_model_free(&model);
}

/* [Horn] table by table: the more is remembered, the fewer nodes are visited twice; the leaves are the same in any case. */
static void rtt_test_kd_stats(void)
{
    static const int entries[] = { 1, 2, 3, 5, 8, 16, RT_MAX_SHORT_STACK };
    rtt_random random = rtt_stream();

    for (size_t scene = 0; scene < RTT_COUNT(rtt_scenes); scene++) {
        rtt_model model = { 0 }, child = { 0 };
        rtt_rays rays = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_stats stack, restart, pushdown, some[RTT_COUNT(entries)];
        bool pure;
        rt_accel *accel;
        rt_info info;
        rt_hit *want;

        rtt_scene_make(&model, &child, &random, scene, 0);
        rtt_rays_planes(&rays, &random, &model, 1, 0, 300);
        rtt_rays_pinhole(&rays, rtt_v(2, 2, -4), rtt_v(2, 2, 2), 2, 16);
        want = (rt_hit *)rtt_array(rays.count, sizeof *want);
        rtt_oracle_all(&model, &rays, want);
        memset(&options, 0, sizeof options);
        options.structure = RT_KDTREE;
        geometry = rtt_geometry(&model);
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            return;
        rt_get_info(accel, &info);
        pure = !model.instance_count || child.structure == RT_KDTREE;  /* no stack of a BVH within */
        stack = rtt_count(accel, RT_KD_STACK, 0, &rays, want);
        restart = rtt_count(accel, RT_KD_RESTART, 0, &rays, want);
        pushdown = rtt_count(accel, RT_KD_PUSHDOWN, 0, &rays, want);
        for (size_t e = 0; e < RTT_COUNT(entries); e++) {
            some[e] = rtt_count(accel, RT_KD_SHORTSTACK, entries[e], &rays, want);
            if (some[e].nodes > (e ? some[e - 1] : pushdown).nodes || some[e].nodes < stack.nodes || some[e].leaves != stack.leaves
                || some[e].prims != stack.prims || some[e].restarts > pushdown.restarts)
                rtt_fail("%s: %d entries: nodes %llu, leaves %llu, restarts %llu, drops %llu", rtt_scenes[scene].name, entries[e],
                         (unsigned long long)some[e].nodes, (unsigned long long)some[e].leaves, (unsigned long long)some[e].restarts,
                         (unsigned long long)some[e].drops);
        }
        if (stack.restarts || stack.drops || (pure && (restart.pushes || pushdown.pushes)) || restart.drops || pushdown.drops
            || pushdown.nodes > restart.nodes || pushdown.nodes < stack.nodes || pushdown.restarts != restart.restarts
            || pushdown.leaves != stack.leaves || restart.leaves != stack.leaves || restart.prims != stack.prims
            || pushdown.prims != stack.prims)
            rtt_fail("%s: nodes %llu %llu %llu, leaves %llu %llu %llu", rtt_scenes[scene].name, (unsigned long long)stack.nodes,
                     (unsigned long long)pushdown.nodes, (unsigned long long)restart.nodes, (unsigned long long)stack.leaves,
                     (unsigned long long)pushdown.leaves, (unsigned long long)restart.leaves);
        if (info.depth <= RT_MAX_SHORT_STACK && !model.instance_count)
            CHECK(rtt_same_visits(stack, some[RTT_COUNT(entries) - 1]) && some[RTT_COUNT(entries) - 1].restarts == 0
                  && some[RTT_COUNT(entries) - 1].drops == 0 && some[RTT_COUNT(entries) - 1].pushes == stack.pushes);
        if (info.nodes > 30)                /* or the above says nothing */
            CHECK(restart.restarts > 0 && stack.pushes > 0 && stack.nodes < restart.nodes);
        rt_free(accel);
        free(want);
        rtt_rays_free(&rays);
        rtt_model_free(&model);
        rtt_model_free(&child);
    }
}
#endif

/* ---- >>packets: rays that stay together ------------------------------------------------------------------------------ */

/* Bundles of 32 x 32 rays in Morton order, so that any packet of them is a square. */
typedef enum { RTT_EYE, RTT_INSIDE, RTT_SHADOW, RTT_SEGMENT, RTT_MIRROR, RTT_PARALLEL, RTT_ALONG, RTT_BEHIND, RTT_BUNDLES } rtt_bundle;

static void rtt_rays_bundle(rtt_rays *rays, rtt_random *random, const rtt_model *model, rtt_bundle bundle, rt_vec3 middle, float size)
{
    rt_vec3 eye = rtt_point(random, middle, rtt_f(3 * size)), toward = rtt_point(random, middle, size), light = rtt_point(random, middle, rtt_f(4 * size));
    unsigned axis = rtt_below(random, 3);
    float spread = rtt_f(size * (bundle == RTT_INSIDE ? 2.5f : 0.4f));

    if (bundle == RTT_INSIDE)
        eye = rtt_point(random, middle, rtt_f(0.5f * size));
    for (unsigned code = 0; code < 1024; code++) {
        unsigned x = 0, y = 0;
        rt_vec3 step, org = eye, target;
        rt_hit hit;

        for (unsigned bit = 0; bit < 5; bit++) {
            x |= (code >> (2 * bit) & 1) << bit;
            y |= (code >> (2 * bit + 1) & 1) << bit;
        }
        step = rtt_v((float)x / 16 - 1, (float)y / 16 - 1, ((float)x - (float)y) / 32);
        target = rtt_add(toward, rtt_mul(step, spread));
        if (bundle == RTT_PARALLEL || bundle == RTT_ALONG) {
            org = rtt_add(eye, rtt_mul(step, spread));
            target = bundle == RTT_PARALLEL ? rtt_add(org, rtt_sub(toward, eye)) : rtt_add(org, rtt_mul(rtt_axis(axis), size));
        }
        rtt_segment(rays, org, rtt_sub(target, org), bundle == RTT_BEHIND ? -1.5f : 0, INFINITY);
        if (bundle != RTT_SHADOW && bundle != RTT_SEGMENT && bundle != RTT_MIRROR)
            continue;
        hit = rtt_closest(model, &rays->ray[rays->count - 1]);
        if (hit.prim == RT_NONE)
            hit.t = 0.75f;
        rays->count--;
        org = rtt_add(org, rtt_mul(rtt_sub(target, org), hit.t));
        if (bundle == RTT_MIRROR) {         /* as a wavy mirror would send them */
            rt_vec3 dir = rtt_sub(target, eye);

            dir.x = rtt_f(dir.x + spread * 0.2f * (float)(x % 8));
            dir.y = -dir.y;
            rtt_segment(rays, org, dir, rtt_f(1e-4f), INFINITY);
        } else
            rtt_segment(rays, org, rtt_sub(light, org), bundle == RTT_SHADOW ? 0 : 1e-4f, bundle == RTT_SHADOW ? 1 : 0.9999f);
    }
    if (rtt_below(random, 2))               /* some that are not legal, and one that is to none of the others' side */
        for (int i = 0; i < 9; i++) {
            rt_ray *r = &rays->ray[rays->count - 1 - rtt_below(random, 1024)];

            if (i % 4 == 0)
                r->dir.x = NAN;
            else if (i % 4 == 1)
                r->org.y = INFINITY;
            else if (i % 4 == 2)
                r->tmin = r->tmax;
            else
                r->dir = rtt_mul(r->dir, -1);
        }
}

/* What coherent packets have and others have not: frusta, common origins and lights, all lanes alive. */
static void rtt_test_packets(void)
{
    rtt_random random = rtt_stream();
    unsigned turn = 0;

    for (size_t scene = 0; scene < RTT_COUNT(rtt_scenes); scene++)
        for (size_t placing = scene % 2; placing < RTT_COUNT(rtt_placings); placing += 2) {
            float scale = rtt_placings[placing].scale, offset = rtt_placings[placing].offset;
            rt_vec3 middle = rtt_v(rtt_f(2 * scale + offset), rtt_f(2 * scale + offset), rtt_f(2 * scale + offset));
            rtt_model model = { 0 }, child = { 0 };
            rt_geometry geometry;
            rt_accel *accel;

            rtt_scene_make(&model, &child, &random, scene, placing);
            geometry = rtt_geometry(&model);
            CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK);
            for (unsigned b = 0; b < 3; b++, turn++) {
                rtt_bundle bundle = (rtt_bundle)(turn % RTT_BUNDLES);
                rtt_rays rays = { 0 };
                rt_hit *want;
                char what[80];

                snprintf(what, sizeof what, "%s, scale %g offset %g, bundle %d", rtt_scenes[scene].name, (double)scale, (double)offset,
                         (int)bundle);
                rtt_rays_bundle(&rays, &random, &model, bundle, middle, rtt_f(2 * scale));
                rays.count -= turn % 3 ? 0 : 37;
                want = (rt_hit *)rtt_array(rays.count, sizeof *want);
                rtt_oracle_all(&model, &rays, want);
                rtt_compare_ways(what, accel, &rays, want, false, turn, 1);
                free(want);
                rtt_rays_free(&rays);
            }
            rt_free(accel);
            rtt_model_free(&model);
            rtt_model_free(&child);
        }
}

/* Packets through wide nodes, and what auto makes of them, against single rays. */
static void rtt_compare_crowds(const char *name, const rt_accel *accel, const rtt_rays *rays)
{
    static const int widths[] = { 4, 8, 16, 0 };
    rt_hit *want = (rt_hit *)rtt_array(rays->count, sizeof *want), *got = (rt_hit *)rtt_array(rays->count, sizeof *got);

    for (int query = RT_CLOSEST; query <= RT_ANY; query++) {
        rt_trace_options way;

        memset(&way, 0, sizeof way);
        way.algorithm = RT_BVH_STACK;
        way.query = (rt_query)query;
        CHECK_STATUS(rt_trace(accel, &way, rays->ray, rays->count, want), RT_OK);
        for (size_t w = 0; w < RTT_COUNT(widths); w++)
            for (int isa = RT_ISA_AUTO; isa <= (int)rt_best_isa(); isa++) {
                char what[80];

                way.algorithm = widths[w] ? RT_BVH_WIDE : RT_AUTO;
                way.packet_width = widths[w];
                way.isa = (rt_isa)isa;
                snprintf(what, sizeof what, "%s, width %d, isa %d", name, widths[w], isa);
                if (rt_trace(accel, &way, rays->ray, rays->count, got) == RT_OK)
                    rtt_compare(what, rt_algorithm_get((size_t)way.algorithm)->name, rays, got, want, query == RT_ANY, true);
                else
                    CHECK(isa == RT_ISA_SCALAR || !rt_algorithm_get(RT_BVH_WIDE)->built);
            }
    }
    free(want);
    free(got);
}

/* A ray without a direction among others, in a scene so small that the inverse of nothing is infinite. */
static void rtt_test_crowds_dead(void)
{
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };
    rt_geometry geometry;
    rt_accel *accel;

    rtt_face(&model, rtt_v(-0.005f, -0.005f, 0.01f), rtt_v(0.02f, -0.005f, 0.01f), rtt_v(-0.005f, 0.02f, 0.01f));
    for (int i = 0; i < 256; i++)
        rtt_segment(&rays, rtt_origin, i == 7 ? rtt_origin : rtt_v((float)(i % 16) * 0.02f, (float)(i / 16) * 0.02f, 1), 0, INFINITY);
    geometry = rtt_geometry(&model);
    if (CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK))
        rtt_compare_crowds("dead ray", accel, &rays);
    rt_free(accel);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
}

/* Packets through wide nodes against single rays: many small scenes, where rays from or to one point, or from a surface, pass along edges and
   vertices, near each other and not; some start far from the others. */
static void rtt_test_crowds(void)
{
    rtt_random random = rtt_stream();

    for (int round = 0; round < (int)(600 / rtt.scale); round++) {
        const float scale = round % 2 ? 1 : rtt_f(powf(10, rtt_f(rtt_f(14 * rtt_signed(&random)) * (round % 8 == 4 ? 1 : 0.5f))));
        const float away = round % 4 < 2 ? 0 : rtt_f(rtt_f(scale * powf(10, rtt_f(2.5f + 2.5f * rtt_signed(&random)))) * rtt_signed(&random));
        const rt_vec3 middle = rtt_v(away, away, away), view = rtt_point(&random, rtt_origin, 1);
        const float spread = powf(10, rtt_f(2 * rtt_signed(&random) - 2)), tmin = round % 3 ? 0 : 0.1f, tmax = round % 5 ? INFINITY : 2;
        const bool to_point = round % 3 == 1;
        const int side = 16, count = side * side * (1 + round % 3);
        rtt_model model = { 0 };
        rtt_rays rays = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel;
        rt_vec3 point;
        char what[32];

        rtt_cloud(&model, &random, 1 + rtt_below(&random, 1u << rtt_below(&random, 10)), middle, scale, rtt_f(scale * (round % 7 ? 0.1f : 1)));
        if (round % 4 == 3)
            rtt_balls(&model, &random, 10, middle, scale, rtt_f(0.2f * scale));
        for (int i = 0; i < 20 && round % 3 == 0; i++) {        /* on top of each other, and steps of the grid */
            const rt_vec3 corner = rtt_add(middle, rtt_mul(rtt_lattice(&random, 4), rtt_f(0.25f * scale)));

            rtt_quad(&model, corner, rtt_v(0, scale, 0), rtt_v(0, 0, scale));
            rtt_quad(&model, corner, rtt_v(scale, 0, 0), rtt_v(0, scale, 0));
        }
        point = round % 5 == 2 ? rtt_feature(&model, &random) : rtt_point(&random, middle, rtt_f((round % 2 ? 3 : 1) * scale));
        for (int i = 0; i < count; i++) {
            const float x = rtt_f((float)(i % side - side / 2) * spread / (float)side), y = rtt_f((float)(i / side - side / 2) * spread / (float)side);
            const rt_vec3 target = round % 4 == 1 ? rtt_feature(&model, &random)
                                 : rtt_add(point, rtt_mul(rtt_v(rtt_f(view.x + x), rtt_f(view.y + y), rtt_f(view.z + x - y)), scale));

            if (to_point)
                rtt_segment(&rays, target, rtt_sub(point, target), i % 2 ? 1e-4f : 0, i % 3 ? 1 : 1 - 1e-4f);
            else if (round % 3 == 2)        /* some cross all the others, and some groups lie half here and half there */
                rtt_segment(&rays, i % 64 == 3 ? point : target, round % 2 && i % 37 ? view : rtt_sub(target, point), round % 7 ? tmin : -1, tmax);
            else
                rtt_segment(&rays, point, rtt_sub(target, point), tmin, tmax);
        }
        if (round % 10 == 0)
            rays.ray[rtt_below(&random, (uint32_t)rays.count)].dir.x = NAN;
        if (round % 10 == 5)                /* no direction at all, which must not spoil its neighbours */
            rays.ray[rtt_below(&random, (uint32_t)rays.count)].dir = rtt_v(0, 0, 0);
        rays.count -= round % 6 ? 0 : 37;
        geometry = rtt_geometry(&model);
        memset(&options, 0, sizeof options);
        options.reference = round % 4 == 2;
        options.quality = (rt_quality)(round % 3);
        snprintf(what, sizeof what, "round %d", round);
        if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            rtt_compare_crowds(what, accel, &rays);
        rt_free(accel);
        rtt_rays_free(&rays);
        rtt_model_free(&model);
    }
}

/* ---- >>threads -------------------------------------------------------------------------------------------------------- */

typedef struct { const rtt_accels *accels; const rtt_rays *rays; const rt_hit *want; size_t first, wrong; } rtt_tracer;

static void *rtt_trace_alone(void *pointer)
{
    rtt_tracer *tracer = (rtt_tracer *)pointer;
    size_t count = tracer->rays->count;
    rt_hit *hits = (rt_hit *)rtt_array(count, sizeof *hits);

    for (size_t w = 0; w < rtt_way_count; w++) {
        const rtt_way *way = &rtt_ways[(w + tracer->first) % rtt_way_count];

        tracer->wrong += rt_trace(rtt_accels_for(tracer->accels, way), &way->options, tracer->rays->ray, count, hits) != RT_OK;
        for (size_t i = 0; i < count; i++)
            tracer->wrong += !rtt_same(hits[i], way->options.query == RT_ANY ? rtt_any(tracer->want[i]) : tracer->want[i]);
    }
    free(hits);
    return NULL;
}

/* Many threads, one accel of each structure, every way at once. */
static void rtt_test_threads(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rtt_accels accels;
    rt_hit *want;

    rtt_ugly_scene(&model, &child, &random);
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 500);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    rtt_oracle_all(&model, &rays, want);
    if (rtt_accels_build(&accels, &model)) {
        rtt_tracer tracers[8];
        pthread_t threads[8];

        for (size_t i = 0; i < RTT_COUNT(threads); i++) {
            tracers[i] = (rtt_tracer){ &accels, &rays, want, 5 * i, 0 };
            if (pthread_create(&threads[i], NULL, rtt_trace_alone, &tracers[i]) != 0)
                rtt_die("cannot start a thread");
        }
        for (size_t i = 0; i < RTT_COUNT(threads); i++) {
            pthread_join(threads[i], NULL);
            CHECK(tracers[i].wrong == 0);
        }
    }
    rtt_accels_free(&accels);
    free(want);
    rtt_rays_free(&rays);
    rtt_model_free(&model);
    rtt_model_free(&child);
}

/* ---- >>shading -------------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING
static double rtt_length(rt_vec3 v) { return sqrt((double)v.x * (double)v.x + (double)v.y * (double)v.y + (double)v.z * (double)v.z); }

/* The middle ray looks at the target; opposite pixels mirror each other; depth is 1; the edge of the picture is half the angle up. */
static void rtt_test_camera(void)
{
    rt_camera camera = { .eye = { 1, 2, 3 }, .look = { 1, 2, -7 }, .up = { 0, 1, 0 }, .fov = 90 };
    rt_ray middle = rt_camera_ray(&camera, 40, 30, 80, 60), top = rt_camera_ray(&camera, 40, 0, 80, 60);
    rt_ray left = rt_camera_ray(&camera, 0, 30, 80, 60);

    CHECK(memcmp(&middle.org, &camera.eye, sizeof camera.eye) == 0 && middle.tmin == 0 && middle.tmax == INFINITY);
    CHECK(rtt_near(middle.dir.x, 0, 1e-6f) && rtt_near(middle.dir.y, 0, 1e-6f) && rtt_near(middle.dir.z, -1, 1e-6f));
    CHECK(rtt_near(top.dir.x, 0, 1e-6f) && rtt_near(top.dir.y, 1, 1e-6f) && rtt_near(top.dir.z, -1, 1e-6f));
    CHECK(rtt_near(left.dir.x, -4.0f / 3, 1e-6f) && rtt_near(left.dir.y, 0, 1e-6f));
    for (int i = 0; i < 80; i++) {
        float x = (float)i + 0.5f, y = 0.7f * x;
        rt_ray a = rt_camera_ray(&camera, x, y, 80, 60), b = rt_camera_ray(&camera, 80 - x, 60 - y, 80, 60);

        CHECK(rtt_near(a.dir.x, -b.dir.x, 1e-5f) && rtt_near(a.dir.y, -b.dir.y, 1e-5f) && rtt_near(a.dir.z, -1, 1e-6f));
    }
    camera.look = rtt_v(-3, 5, 2);          /* oblique, up not perpendicular */
    middle = rt_camera_ray(&camera, 50, 50, 100, 100);
    CHECK(rtt_near((float)rtt_length(middle.dir), 1, 1e-5f) && middle.dir.x < 0 && middle.dir.y > 0 && middle.dir.z < 0);
    CHECK(rtt_near(middle.dir.x / middle.dir.z, 4, 1e-4f) && rtt_near(middle.dir.y / middle.dir.z, -3, 1e-4f));
}

/* A white floor, a sphere above its middle, a lamp above that; the camera looks down from the side. */
static void rtt_room(rtt_model *model, rt_scene *scene, rt_geometry *geometry, rt_accel **accel)
{
    static rt_material materials[2];
    static const uint32_t ids[] = { 0, 0, 1 };
    static const rt_light light = { .position = { 0, 8, 0 }, .color = { 0.9f, 0.9f, 0.9f } };

    materials[0].diffuse = rtt_v(0.8f, 0.8f, 0.8f);
    materials[1].diffuse = rtt_v(0.7f, 0.1f, 0.1f);
    materials[1].specular = rtt_v(0.5f, 0.5f, 0.5f), materials[1].shininess = 30;
    rtt_quad(model, rtt_v(-4, 0, -4), rtt_v(0, 0, 8), rtt_v(8, 0, 0));
    rtt_ball(model, rtt_v(0, 2, 0), 1);
    *geometry = rtt_geometry(model);
    if (!CHECK_STATUS(rt_build(accel, geometry, NULL), RT_OK))
        rtt_die("the room does not build");
    memset(scene, 0, sizeof *scene);
    scene->accel = *accel;
    scene->geometry = geometry;
    scene->materials = materials, scene->material_count = 2;
    scene->material_ids = ids;
    scene->lights = &light, scene->light_count = 1;
    scene->ambient = rtt_v(0.1f, 0.1f, 0.1f);
    scene->background = rtt_v(0.25f, 0.5f, 0.75f);
    scene->camera = (rt_camera){ { 0, 5, 9 }, { 0, 0.5f, 0 }, { 0, 1, 0 }, 50 };
}

static void rtt_test_render(void)
{
    enum { WIDTH = 61, HEIGHT = 43, PIXELS = WIDTH * HEIGHT };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_accels accels;
    rt_geometry geometry;
    rt_scene scene;
    rt_accel *accel;
    rt_vec3 *whole = (rt_vec3 *)rtt_array(PIXELS, sizeof *whole), *tiles = (rt_vec3 *)rtt_array(PIXELS, sizeof *tiles);
    size_t lit = 0, dark = 0, seen = 0;

    rtt_room(&model, &scene, &geometry, &accel);
    if (!rtt_accels_build(&accels, &model))
        rtt_die("the room does not build");
    for (int spp = 1; spp <= 4; spp += 3)
        for (size_t w = 0; w <= rtt_way_count; w++) {
            rt_render_options options;
            rt_ray_counts counts = { 0, 0, 0, 0 }, sum = { 0, 0, 0, 0 };
            uint32_t order[64];

            scene.accel = w ? rtt_accels_for(&accels, &rtt_ways[w - 1]) : accel;
            memset(&options, 0, sizeof options);
            options.width = WIDTH, options.height = HEIGHT;
            options.spp = spp;
            if (w == 0)                     /* the reference picture, whole; then each way in shuffled tiles */
                CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, WIDTH, HEIGHT, whole, &counts), RT_OK);
            else
                options.trace = rtt_ways[w - 1].options;
            memset(tiles, 0xff, PIXELS * sizeof *tiles);
            for (uint32_t i = 0; i < 64; i++) {
                uint32_t other = rtt_below(&random, i + 1);

                order[i] = order[other];
                order[other] = i;
            }
            for (int i = 0; i < 64; i++) {
                int x = (int)(order[i] % 8) * 8, y = (int)(order[i] / 8) * 6;

                CHECK_STATUS(rt_render_tile(&scene, &options, x < WIDTH ? x : WIDTH, y < HEIGHT ? y : HEIGHT, x + 8 < WIDTH ? x + 8 : WIDTH,
                                            y + 6 < HEIGHT ? y + 6 : HEIGHT, tiles, &sum), RT_OK);
            }
            if (memcmp(whole, tiles, PIXELS * sizeof *tiles) != 0)
                rtt_fail("%s draws another picture in tiles", w ? rtt_ways[w - 1].label : "the default");
            CHECK(sum.primary == (uint64_t)PIXELS * (uint64_t)spp && sum.shadow > 0 && sum.shadow <= sum.primary);
            CHECK(w > 0 || (counts.primary == sum.primary && counts.shadow == sum.shadow));
        }
    for (int i = -35; i <= 35; i++)     /* points of the floor that the sphere does not hide: look at their pixels */
        for (int j = -5; j <= 35; j++) {
            double axis[3] = { 0, -4.5, -9 }, up[3] = { 0, 9, -4.5 }, norm = sqrt(101.25);
            double scale = 0.5 * HEIGHT / 0.4663076581549986;          /* the tangent of half the angle */
            double to[3] = { 0.1 * i, -5, 0.1 * j - 9 }, depth = rtt_dot(axis, to) / norm, from_middle = sqrt(0.01 * (i * i + j * j));
            double x = 0.5 * WIDTH + scale * to[0] / depth, y = 0.5 * HEIGHT - scale * rtt_dot(up, to) / norm / depth;
            bool shadow = from_middle < 1, light = from_middle > 1.9;                 /* its edge: 8 tan(asin(1/6)) = 1.352 */

            if (x < 0 || x >= WIDTH || y < 0 || y >= HEIGHT || !(shadow || light))
                continue;
            seen++;
            dark += shadow && whole[(int)y * WIDTH + (int)x].x < 0.12f;
            lit += light && whole[(int)y * WIDTH + (int)x].x > 0.3f;
        }
    CHECK(dark > 100 && lit > 1000 && lit + dark == seen);
    CHECK(memcmp(&whole[0], &scene.background, sizeof scene.background) == 0);
    free(whole);
    free(tiles);
    rtt_accels_free(&accels);
    rt_free(accel);
    rtt_model_free(&model);
}

/* The room seen through two levels of instances that together move nothing is drawn the same, but for rounding. */
static void rtt_test_render_instances(void)
{
    enum { WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };
    static rt_vec3 direct[PIXELS], through[PIXELS];
    rtt_model room = { 0 }, inner = { 0 }, outer = { 0 };
    rt_geometry geometry, inner_geometry, outer_geometry;
    rt_scene scene, inner_scene, outer_scene;
    const rt_scene *part = &scene, *inner_part = &inner_scene;
    rt_render_options options;
    rt_accel *accel;
    size_t differ = 0;

    rtt_room(&room, &scene, &geometry, &accel);
    memset(&options, 0, sizeof options);
    options.width = WIDTH, options.height = HEIGHT;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, WIDTH, HEIGHT, direct, NULL), RT_OK);
    rtt_place(&inner, &room, rtt_v(2, 0.5f, 4), rtt_v(10, 20, 30));
    inner_geometry = rtt_geometry(&inner);
    inner_scene = scene;
    CHECK_STATUS(rt_build(&inner.accel, &inner_geometry, NULL), RT_OK);
    inner_scene.accel = inner.accel, inner_scene.geometry = &inner_geometry, inner_scene.parts = &part;
    rtt_place(&outer, &inner, rtt_v(0.5f, 2, 0.25f), rtt_v(-5, -40, -7.5f));
    outer_geometry = rtt_geometry(&outer);
    outer_scene = scene;
    CHECK_STATUS(rt_build(&outer.accel, &outer_geometry, NULL), RT_OK);
    outer_scene.accel = outer.accel, outer_scene.geometry = &outer_geometry;
    outer_scene.parts = NULL;
    CHECK_STATUS(rt_render_tile(&outer_scene, &options, 0, 0, WIDTH, HEIGHT, through, NULL), RT_ERROR_ARGUMENT);
    outer_scene.parts = &inner_part;
    CHECK_STATUS(rt_render_tile(&outer_scene, &options, 0, 0, WIDTH, HEIGHT, through, NULL), RT_OK);
    for (size_t i = 0; i < PIXELS; i++)
        differ += !rtt_near(direct[i].x, through[i].x, 1e-3f) || !rtt_near(direct[i].y, through[i].y, 1e-3f) ||
                  !rtt_near(direct[i].z, through[i].z, 1e-3f);
    CHECK(differ <= PIXELS / 500);          /* a pixel at an edge of the shadow may fall on the other side */
    rt_free(accel);
    rtt_model_free(&outer);
    rtt_model_free(&inner);
    rtt_model_free(&room);
}

/* A model with its materials, one a quad or ball in the order in which they were added, quads first. */
typedef struct {
    rtt_model model;
    rt_geometry geometry;
    rt_accel *accel;
    rt_scene scene;
    rt_material materials[16];
    uint32_t ids[32];
    rt_light light;
} rtt_stage;

static rt_material rtt_material(rt_vec3 diffuse, rt_vec3 emission, rt_vec3 reflect, rt_vec3 transmit, float ior, bool fresnel)
{
    rt_material m;

    memset(&m, 0, sizeof m);
    m.diffuse = diffuse, m.emission = emission, m.reflect = reflect, m.transmit = transmit, m.ior = ior, m.fresnel = fresnel;
    return m;
}

static rt_vec3 rtt_gray(float x) { return rtt_v(x, x, x); }
static rt_material rtt_glass(float ior, bool fresnel)
{
    return rtt_material(rtt_gray(0), rtt_gray(0), rtt_gray(0), rtt_gray(1), ior, fresnel);
}
static rt_material rtt_mirror(float part, float glow)
{
    return rtt_material(rtt_gray(0), rtt_gray(glow), rtt_gray(part), rtt_gray(0), 0, false);
}

/* Six quads of one material, turned outwards. */
static void rtt_slab(rtt_stage *stage, rt_vec3 lower, rt_vec3 upper, uint32_t material)
{
    const rt_vec3 x = rtt_v(upper.x - lower.x, 0, 0), y = rtt_v(0, upper.y - lower.y, 0), z = rtt_v(0, 0, upper.z - lower.z);
    const size_t first = stage->model.triangle_count;

    rtt_quad(&stage->model, lower, y, x);
    rtt_quad(&stage->model, lower, z, y);
    rtt_quad(&stage->model, lower, x, z);
    rtt_quad(&stage->model, rtt_add(lower, z), x, y);
    rtt_quad(&stage->model, rtt_add(lower, x), y, z);
    rtt_quad(&stage->model, rtt_add(lower, y), z, x);
    for (size_t i = first; i < stage->model.triangle_count; i++)
        stage->ids[i] = material;
}

static void rtt_stage_quad(rtt_stage *stage, rt_vec3 corner, rt_vec3 u, rt_vec3 v, uint32_t material)
{
    rtt_quad(&stage->model, corner, u, v);
    stage->ids[stage->model.triangle_count - 1] = stage->ids[stage->model.triangle_count - 2] = material;
}

static void rtt_stage_build(rtt_stage *stage)
{
    stage->geometry = rtt_geometry(&stage->model);
    if (!CHECK_STATUS(rt_build(&stage->accel, &stage->geometry, NULL), RT_OK))
        rtt_die("a stage does not build");
    stage->scene.accel = stage->accel, stage->scene.geometry = &stage->geometry;
    stage->scene.materials = stage->materials, stage->scene.material_count = RTT_COUNT(stage->materials);
    stage->scene.material_ids = stage->ids;
    stage->scene.lights = &stage->light;
    CHECK_STATUS(rt_check_scene(&stage->scene, NULL), RT_OK);
}

static void rtt_stage_free(rtt_stage *stage)
{
    rt_free(stage->accel);
    rtt_model_free(&stage->model);
}

static rt_ray_counts rtt_draw(const rt_scene *scene, int width, int height, int depth, rt_vec3 *pixels)
{
    rt_render_options options;
    rt_ray_counts counts = { 0, 0, 0, 0 };

    memset(&options, 0, sizeof options);
    options.width = width, options.height = height, options.depth = depth;
    CHECK_STATUS(rt_render_tile(scene, &options, 0, 0, width, height, pixels, &counts), RT_OK);
    return counts;
}

/* A mirror shows what is seen from behind it without it, left and right exchanged: shadows, mirrors in the mirror and all. */
static void rtt_test_render_mirror(void)
{
    enum { WIDTH = 60, HEIGHT = 45, PIXELS = WIDTH * HEIGHT };
    static rt_vec3 mirrored[PIXELS], direct[PIXELS];
    static bool in_mirror[PIXELS];
    rtt_stage stage;
    rt_ray_counts counts;
    size_t differ = 0, changed = 0, seen = 0;

    for (int with = 1; with >= 0; with--) {
        memset(&stage, 0, sizeof stage);
        stage.materials[0] = rtt_mirror(1, 0);
        stage.materials[1] = rtt_material(rtt_gray(0.7f), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
        stage.materials[2] = rtt_material(rtt_v(0.6f, 0.1f, 0.1f), rtt_gray(0), rtt_gray(0.3f), rtt_gray(0), 0, false);
        if (with)
            rtt_stage_quad(&stage, rtt_v(-50, -50, 0), rtt_v(100, 0, 0), rtt_v(0, 100, 0), 0);
        rtt_stage_quad(&stage, rtt_v(-8, -1, 0.25f), rtt_v(0, 0, 12), rtt_v(16, 0, 0), 1);
        for (int i = 0; i < 5; i++) {
            rtt_ball(&stage.model, rtt_v((float)(i - 2) * 1.25f + 0.3f, (float)(i % 2) * 0.8f, 2.5f + 0.5f * (float)i), 0.6f);
            stage.ids[stage.model.triangle_count + (size_t)i] = i % 2 ? 1 : 2;
        }
        rtt_stage_build(&stage);
        stage.scene.light_count = 1;
        stage.light.position = rtt_v(1, 6, 4), stage.light.color = rtt_gray(1);
        stage.scene.ambient = rtt_gray(0.1f), stage.scene.background = rtt_v(0.1f, 0.2f, 0.4f);
        stage.scene.camera = (rt_camera){ { 0.5f, 1.5f, with ? 9.0f : -9.0f }, { 0.2f, 1, 0 }, { 0, 1, 0 }, 50 };
        counts = rtt_draw(&stage.scene, WIDTH, HEIGHT, with ? 2 : 1, with ? mirrored : direct);
        for (int i = 0; i < PIXELS && with; i++) {
            const rt_ray ray = rt_camera_ray(&stage.scene.camera, (float)(i % WIDTH) + 0.5f, (float)(i / WIDTH) + 0.5f, WIDTH, HEIGHT);
            rt_hit hit;

            in_mirror[i] = rt_intersect(stage.accel, &ray, &hit) && hit.prim < 2;
            seen += in_mirror[i];
        }
        rtt_stage_free(&stage);
        CHECK(counts.refract == 0 && (!with || counts.reflect > 1000));
    }
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const rt_vec3 a = mirrored[y * WIDTH + x], b = direct[y * WIDTH + WIDTH - 1 - x];

            if (!in_mirror[y * WIDTH + x])
                continue;
            if (x == 0 || rtt_length(rtt_sub(a, mirrored[y * WIDTH + x - 1])) > 1e-3)
                changed++;
            differ += rtt_length(rtt_sub(a, b)) > 1e-3;
        }
    CHECK(seen > PIXELS / 3 && changed > seen / 8);             /* there is something to see */
    if (differ > seen / 200)                /* a pixel at an edge may fall on the other side */
        rtt_fail("%zu of %zu pixels differ from the mirrored scene", differ, seen);
}

/* Through a slab, to a wall whose colour tells the place: Snell's law bends twice, so that the ray leaves as it came; Beer's law absorbs on
   the way between. */
static void rtt_test_render_slab(void)
{
    enum { SIDE = 40, PIXELS = SIDE * SIDE };
    static const float indices[] = { 1.5f, 1, 2.4f, 0.8f, 0 };
    static rt_vec3 pixels[PIXELS];
    static rt_vec3 colors[64];
    const double thick = 1.5, before = 4, behind = 3, absorb = 0.4, size = 20;

    for (size_t n = 0; n < RTT_COUNT(indices); n++) {
        rtt_stage stage;
        rt_ray_counts counts;
        double worst = 0;

        memset(&stage, 0, sizeof stage);
        stage.materials[0] = rtt_glass(indices[n], false);
        stage.materials[0].absorb = rtt_v(0, 0, (float)(absorb));
        stage.materials[1] = rtt_material(rtt_gray(1), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
        rtt_slab(&stage, rtt_v(-30, -30, (float)(-thick)), rtt_v(30, 30, 0), 0);
        rtt_stage_quad(&stage, rtt_v(-20, -20, (float)(-thick - behind)), rtt_v(40, 0, 0), rtt_v(0, 40, 0), 1);
        rtt_stage_build(&stage);
        for (size_t i = 0; i < stage.geometry.vertex_count; i++) {
            colors[i].x = (float)(((double)stage.geometry.vertices[3 * i] + size) / (2 * size));
            colors[i].y = (float)(((double)stage.geometry.vertices[3 * i + 1] + size) / (2 * size));
            colors[i].z = 1;
        }
        stage.scene.colors = colors;
        stage.scene.ambient = rtt_gray(1);
        stage.scene.camera = (rt_camera){ { 0, 0, (float)(before) }, { 0, 0, 0 }, { 0, 1, 0 }, 70 };
        counts = rtt_draw(&stage.scene, SIDE, SIDE, 2, pixels);
        CHECK(counts.refract > (indices[n] < 1 && indices[n] > 0 ? PIXELS : 2 * PIXELS - 1) && counts.refract <= 2 * PIXELS);
        for (int i = 0; i < PIXELS; i++) {
            const rt_ray ray = rt_camera_ray(&stage.scene.camera, (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, SIDE, SIDE);
            const double index = indices[n] > 0 ? (double)indices[n] : 1, tangent = hypot((double)ray.dir.x, (double)ray.dir.y);
            const double sine = tangent / sqrt(1 + tangent * tangent) / index, cosine = sqrt(1 - sine * sine);
            const double out = tangent * (before + behind) + sine / cosine * thick;
            const double x = out * (double)ray.dir.x / tangent, y = out * (double)ray.dir.y / tangent;
            const double want[3] = { (x + size) / (2 * size), (y + size) / (2 * size), exp(-absorb * thick / cosine) };

            if (sine >= 1)
                continue;                   /* beyond the critical angle */
            worst = fmax(worst, fabs((double)pixels[i].x - want[0]));
            worst = fmax(worst, fabs((double)pixels[i].y - want[1]));
            worst = fmax(worst, fabs((double)pixels[i].z - want[2]));
        }
        if (worst > 2e-5)
            rtt_fail("index %g: a pixel is off by %g", (double)indices[n], worst);
        rtt_stage_free(&stage);
    }
}

/* From inside a block of glass: rays leave where Snell's law lets them, and otherwise are mirrored whole until they do. Of what reaches
   glass straight on, Fresnel's equations mirror ((n-1)/(n+1))^2, and each bounce between two faces as much again. */
static void rtt_test_render_fresnel(void)
{
    enum { SIDE = 64 };
    static rt_vec3 pixels[SIDE * SIDE];
    const double index = 1.5, part = (index - 1) * (index - 1) / ((index + 1) * (index + 1));
    rtt_stage stage;
    rt_ray_counts counts;
    int out = 0, kept = 0;

    memset(&stage, 0, sizeof stage);
    stage.materials[0] = rtt_glass((float)(index), false);
    rtt_slab(&stage, rtt_gray(-5), rtt_gray(5), 0);
    rtt_stage_build(&stage);
    stage.scene.background = rtt_v(1, 0.5f, 0.25f);
    stage.scene.camera = (rt_camera){ { 0.31f, 0.17f, 0.07f }, { 0.31f, 0.17f, -1 }, { 0, 1, 0 }, 120 };      /* so that no edge is met */
    rtt_draw(&stage.scene, SIDE, SIDE, 5, pixels);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const rt_ray ray = rt_camera_ray(&stage.scene.camera, (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, SIDE, SIDE);
        const double norm = rtt_length(ray.dir), least = sqrt(1 - 1 / (index * index));
        const double most = fmax(1, fmax(fabs((double)ray.dir.x), fabs((double)ray.dir.y))) / norm;      /* cosine with the steepest face */

        if (fabs(most - least) < 1e-3)
            continue;
        out += most > least, kept += most < least;
        CHECK(most > least ? rtt_length(rtt_sub(pixels[i], stage.scene.background)) < 1e-6 : pixels[i].x + pixels[i].y + pixels[i].z <= 0);
    }
    CHECK(out > 1000 && kept > 100);
    rtt_stage_free(&stage);

    for (int what = 0; what < 2; what++) {  /* what the front face mirrors; what a pane lets through */
        memset(&stage, 0, sizeof stage);
        stage.materials[0] = rtt_glass((float)(index), true);
        stage.materials[1] = rtt_material(rtt_gray(0), rtt_gray(1), rtt_gray(0), rtt_gray(0), 0, false);
        rtt_slab(&stage, rtt_v(-5, -5, -1), rtt_v(5, 5, 0), 0);
        rtt_stage_quad(&stage, rtt_v(-9, -9, what ? -8.0f : 8.0f), rtt_v(18, 0, 0), rtt_v(0, 18, 0), 1);
        rtt_stage_build(&stage);
        stage.scene.camera = (rt_camera){ { 0, 0, 5 }, { 0, 0, 0 }, { 0, 1, 0 }, 0.1f };
        counts = rtt_draw(&stage.scene, 1, 1, what ? RT_MAX_DEPTH : 1, pixels);
        CHECK(counts.reflect > 0 && counts.refract > 0);
        /* All bounces together let (1 - part) / (1 + part) through; those below 1/512 are left out. */
        CHECK(rtt_near(pixels[0].x, what ? (float)((1 - part) / (1 + part)) : (float)(part), what ? 2.0f / 512 : 1e-5f));
        rtt_stage_free(&stage);
    }
}

/* Between two mirrors that glow: the light of each level is weaker by their part. Depth is what is asked for. */
static void rtt_test_render_depth(void)
{
    enum { SIDE = 20, PIXELS = SIDE * SIDE };
    static const struct { int depth, levels; } cases[] = { { -1, 0 }, { -2147483647, 0 }, { 1, 1 }, { 2, 2 }, { 0, 5 }, { 50, 50 } };
    static rt_vec3 pixels[PIXELS];
    rtt_stage stage;

    memset(&stage, 0, sizeof stage);
    stage.materials[0] = rtt_mirror(0.9f, 1);
    rtt_stage_quad(&stage, rtt_v(-50, -50, -1), rtt_v(100, 0, 0), rtt_v(0, 100, 0), 0);
    rtt_stage_quad(&stage, rtt_v(-50, -50, 1), rtt_v(0, 100, 0), rtt_v(100, 0, 0), 0);
    rtt_stage_build(&stage);
    stage.scene.light_count = 1;            /* of which nothing would be seen: no shadow ray */
    stage.light.color = rtt_gray(1);
    stage.scene.camera = (rt_camera){ { 0, 0, 0 }, { 0, 0, -1 }, { 0, 1, 0 }, 20 };
    for (size_t c = 0; c < RTT_COUNT(cases); c++) {
        const rt_ray_counts counts = rtt_draw(&stage.scene, SIDE, SIDE, cases[c].depth, pixels);
        const float want = (float)((1 - pow(0.9, cases[c].levels + 1)) / 0.1);

        CHECK(counts.primary == PIXELS && counts.shadow == 0 && counts.refract == 0);
        CHECK(counts.reflect == (uint64_t)PIXELS * (uint64_t)cases[c].levels);
        for (int i = 0; i < PIXELS; i++)
            CHECK(rtt_near(pixels[i].x, want, 1e-4f) && rtt_near(pixels[i].z, want, 1e-4f));
    }
    rtt_stage_free(&stage);
}

/* Nothing makes the work boundless: mirrors that also are glass, numbers that no material should have. Light does not grow. */
static void rtt_test_render_bounded(void)
{
    enum { SIDE = 12, PIXELS = SIDE * SIDE };
    static rt_vec3 pixels[PIXELS];
    const float bad = NAN;
    rtt_stage stage;
    rt_ray_counts counts;

    memset(&stage, 0, sizeof stage);
    for (int i = 0; i < 27; i++)
        rtt_ball(&stage.model, rtt_v((float)(i % 3 - 1), (float)(i / 3 % 3 - 1), (float)(i / 9 - 1)), 0.7f);
    stage.materials[0] = rtt_glass(1.3f, false);
    stage.materials[0].reflect = rtt_gray(1);
    rtt_stage_build(&stage);
    stage.scene.background = rtt_gray(1);
    stage.scene.camera = (rt_camera){ { 0, 0.2f, 4 }, { 0, 0, 0 }, { 0, 1, 0 }, 45 };
    counts = rtt_draw(&stage.scene, SIDE, SIDE, RT_MAX_DEPTH, pixels);
    CHECK(counts.reflect > 10 * PIXELS && counts.refract > 10 * PIXELS && counts.reflect + counts.refract < 2048 * PIXELS);
    for (int i = 0; i < PIXELS; i++)
        CHECK(pixels[i].x <= 1.0001f && pixels[i].x > 0.2f);
    for (int i = 0; i < 6; i++) {           /* no hang, no trap, no more rays than before */
        rt_material *m = &stage.materials[0];

        *m = rtt_glass(1.3f, i % 2 == 0);
        if (i == 0) m->reflect = rtt_v(bad, 1, 1), m->transmit = rtt_v(1, bad, INFINITY);
        if (i == 1) m->reflect = rtt_gray(1e30f), m->transmit = rtt_gray(1e38f);
        if (i == 2) m->reflect = rtt_gray(-3), m->transmit = rtt_gray(4);
        if (i == 3) m->ior = bad, m->absorb = rtt_v(bad, -100, INFINITY);
        if (i == 4) m->ior = INFINITY, m->reflect = rtt_gray(0.5f);
        if (i == 5) m->ior = -2, m->shininess = bad, m->diffuse = rtt_gray(bad);
        CHECK_STATUS(rt_check_scene(&stage.scene, NULL), i == 1 ? RT_OK : RT_ERROR_ARGUMENT);
        counts = rtt_draw(&stage.scene, SIDE, SIDE, RT_MAX_DEPTH, pixels);
        CHECK(counts.reflect + counts.refract < 2048 * PIXELS);
    }
    rtt_stage_free(&stage);
}

/* Balls and a block of glass on a mirror, seen through an instance or not: the same picture from every way to trace, in tiles of any size,
   and with blocks of either size. */
static void rtt_test_render_ways(void)
{
    enum { WIDTH = 37, HEIGHT = 34, PIXELS = WIDTH * HEIGHT };
    static const int sides[] = { 7, 16, 20, 32, 64 };
    static rt_vec3 want[PIXELS], got[PIXELS];
    rtt_stage stage;
    rtt_accels accels;
    rt_ray_counts first, counts;

    memset(&stage, 0, sizeof stage);
    stage.materials[0] = rtt_material(rtt_v(0.3f, 0.3f, 0.2f), rtt_gray(0), rtt_gray(0.4f), rtt_gray(0), 0, false);
    stage.materials[1] = rtt_glass(1.5f, true);
    stage.materials[1].absorb = rtt_v(0.2f, 1, 0.1f), stage.materials[1].specular = rtt_gray(0.4f), stage.materials[1].shininess = 20;
    stage.materials[2] = rtt_mirror(0.8f, 0);
    stage.materials[3] = rtt_material(rtt_v(0.2f, 0.6f, 0.2f), rtt_gray(0), rtt_gray(0.1f), rtt_gray(0.4f), 1.2f, false);
    rtt_stage_quad(&stage, rtt_v(-6, 0, -6), rtt_v(0, 0, 12), rtt_v(12, 0, 0), 0);
    rtt_slab(&stage, rtt_v(-2, 0.1f, -1), rtt_v(-0.5f, 2, 0.5f), 1);
    for (uint32_t i = 0; i < 4; i++) {
        rtt_ball(&stage.model, rtt_v((float)i - 0.8f, 0.7f, 1.5f - 0.7f * (float)i), 0.6f);
        stage.ids[stage.model.triangle_count + i] = 1 + (i + 2) % 3;
    }
    rtt_stage_build(&stage);
    stage.scene.light_count = 1;
    stage.light.position = rtt_v(3, 8, 5), stage.light.color = rtt_gray(0.8f);
    stage.scene.ambient = rtt_gray(0.2f), stage.scene.background = rtt_v(0.3f, 0.5f, 0.8f);
    stage.scene.camera = (rt_camera){ { 1, 3, 6 }, { 0, 0.7f, 0 }, { 0, 1, 0 }, 45 };
    first = rtt_draw(&stage.scene, WIDTH, HEIGHT, 7, want);
    CHECK(first.reflect > PIXELS / 2 && first.refract > PIXELS / 2);
    if (!rtt_accels_build(&accels, &stage.model))
        rtt_die("a stage does not build");
    for (size_t w = 0; w < rtt_way_count; w++) {
        const int side = sides[w % RTT_COUNT(sides)];
        rt_render_options options;

        memset(&options, 0, sizeof options);
        memset(got, 0xff, sizeof got);
        memset(&counts, 0, sizeof counts);
        options.width = WIDTH, options.height = HEIGHT, options.depth = 7;
        options.trace = rtt_ways[w].options;
        stage.scene.accel = rtt_accels_for(&accels, &rtt_ways[w]);
        for (int y = 0; y < HEIGHT; y += side)
            for (int x = 0; x < WIDTH; x += side)
                CHECK_STATUS(rt_render_tile(&stage.scene, &options, x, y, x + side < WIDTH ? x + side : WIDTH,
                                            y + side < HEIGHT ? y + side : HEIGHT, got, &counts), RT_OK);
        if (memcmp(want, got, sizeof want) != 0)
            rtt_fail("%s, tiles of %d pixels: another picture", rtt_ways[w].label, side);
        if (memcmp(&first, &counts, sizeof first) != 0)
            rtt_fail("%s, tiles of %d pixels: other numbers of rays", rtt_ways[w].label, side);
    }
    {                                       /* blocks of 32 x 32 pixels, whatever widths there are */
        const int tile[4] = { 0, 0, WIDTH, HEIGHT };
        rti_render r;
        rt_trace_options trace;

        memset(&r, 0, sizeof r);
        memset(&trace, 0, sizeof trace);
        memset(got, 0xff, sizeof got);
        stage.scene.accel = stage.accel;
        CHECK_STATUS(rti_choose(stage.accel, &trace, RTI_BLOCK_RAYS, &r.batch, &r.job), RT_OK);
        rti_choose_shaders(&r, RT_ISA_AUTO);
        r.spp = r.samples = 1, r.depth = 7;
        rti_set_world(&r, &stage.scene, WIDTH, HEIGHT);
        rti_render_large(&r, tile, WIDTH, got);
        CHECK(memcmp(want, got, sizeof want) == 0 && memcmp(&first, &r.counts, sizeof first) == 0);
    }
    rtt_accels_free(&accels);
    rtt_stage_free(&stage);
}

/* In units of the last place of a float of that size, or, below the normal ones, of their last place. */
static double rtt_ulps(float got, double want)
{
    int exponent;

    frexp(want, &exponent);
    return fabs((double)got - want) / ldexp(1, (exponent < -125 ? -125 : exponent) - 24);
}

/* The functions of >>math against the C library's: errors, and what is special. */
static void rtt_test_shading_math(void)
{
    rtt_random random = rtt_stream();
    double worst[5] = { 0, 0, 0, 0, 0 };

    for (int i = 0; i < 200000; i++) {
        const float a = rtt_signed(&random), b = rtt_signed(&random), x = i % 2 ? 87 * a : a, p = 100 * fabsf(b);
        const float y = ldexpf(1 + fabsf(a), i % 250 - 126), turn = fabsf(a);
        const double power = pow(fabs((double)a), (double)p);
        float sine, cosine;

        worst[0] = fmax(worst[0], rtt_ulps(rti_expf(x), exp((double)x)));
        worst[1] = fmax(worst[1], rtt_ulps(rti_powf(fabsf(a), p), power));
        worst[2] = fmax(worst[2], rtt_ulps(rti_atan2f(a, b), atan2((double)a, (double)b)));
        worst[3] = fmax(worst[3], fabs(rti_arc_tangent_ratio((double)a, (double)b) - atan2((double)a, (double)b)));
#ifndef RT_NO_SAMPLING
        worst[0] = fmax(worst[0], rtt_ulps(rti_logf(y), log((double)y)));
        worst[3] = fmax(worst[3], fabs(rti_sum_arcs((double)a, (double)b) - acos((double)a) - acos((double)b)) / 4);
        rti_circle(turn, &sine, &cosine);
        worst[4] = fmax(worst[4], fmax(fabs((double)sine - sin(6.283185307179586 * (double)turn)), fabs((double)cosine - cos(6.283185307179586 * (double)turn))));
#else
        (void)y, (void)turn, (void)sine, (void)cosine;
#endif
    }
    if (!(worst[0] < 0.52 && worst[1] < 0.52 && worst[2] < 0.52 && worst[3] < 1e-15 && worst[4] < 2e-7))
        rtt_fail("errors of %g, %g, %g ulps, %g, %g", worst[0], worst[1], worst[2], worst[3], worst[4]);
    CHECK(rti_expf(0) == 1 && rti_expf(-INFINITY) == 0 && rti_expf(INFINITY) == INFINITY && isnan(rti_expf(NAN)) && rti_expf(-200) == 0);
    CHECK(rti_powf(0, 0) == 1 && rti_powf(0, 2) == 0 && rti_powf(1, INFINITY) == 1 && rti_powf(0.5f, INFINITY) == 0 && rti_powf(INFINITY, 2) == INFINITY);
    CHECK(rti_powf(0.3f, 1) == 0.3f && rti_powf(1, 5) == 1 && isnan(rti_powf(NAN, 2)) && rti_powf(1e-40f, 0.5f) > 0);
    CHECK(rti_log(1) == 0 && rti_log(0) == -HUGE_VAL && isnan(rti_log(-1)) && isnan(rti_log((double)NAN)) && rti_log(HUGE_VAL) == HUGE_VAL);
    CHECK(rti_atan2f(0, 0) == 0 && rti_atan2f(0, -1) == 3.14159265f && rti_atan2f(-0.0f, -1) == -3.14159265f && rti_atan2f(0, 1) == 0);
    CHECK(rti_atan2f(1, 0) == 1.57079633f && rti_atan2f(-1, 0) == -1.57079633f && rti_atan2f(1, 1) == 0.785398163f && signbit(rti_atan2f(-0.0f, 1)));
#ifndef RT_NO_SAMPLING
    for (int i = 0; i <= 8; i++) {
        float sine, cosine;

        rti_circle(0.125f * (float)i, &sine, &cosine);
        CHECK(i % 2 ? fabsf(fabsf(sine) - 0.707106781f) < 1e-6f : sine == (float)((i == 2) - (i == 6)) && cosine == (float)((i % 8 == 0) - (i == 4)));
    }
    CHECK(rti_sum_arcs(1, 1) == 0 && fabs(rti_sum_arcs(-1, -1) - 6.283185307179586) < 1e-15 && fabs(rti_sum_arcs(-1, 1) - 3.141592653589793) < 1e-15);
#endif
}

/* rt_check_scene names what is wrong. */
static void rtt_test_check_scene(void)
{
    static const struct { size_t field; const char *name; } fields[] = {
        { offsetof(rt_material, diffuse), "material 1: diffuse is" }, { offsetof(rt_material, specular), "material 1: specular is" },
        { offsetof(rt_material, emission), "material 1: emission is" }, { offsetof(rt_material, shininess), "material 1: shininess is" },
        { offsetof(rt_material, reflect), "material 1: reflect is" }, { offsetof(rt_material, transmit), "material 1: transmit is" },
        { offsetof(rt_material, absorb), "material 1: absorb is" }, { offsetof(rt_material, ior), "material 1: ior is" }
    };
    static const float bad[] = { -1, NAN, INFINITY };
    rtt_stage stage;
    rt_error error;

    memset(&stage, 0, sizeof stage);
    rtt_stage_quad(&stage, rtt_v(-1, 0, -1), rtt_v(0, 0, 2), rtt_v(2, 0, 0), 1);
    rtt_ball(&stage.model, rtt_v(0, 1, 0), 1);
    stage.ids[2] = 1;
    rtt_stage_build(&stage);
    stage.scene.light_count = 1;
    for (size_t f = 0; f < RTT_COUNT(fields); f++)
        for (size_t i = 0; i < RTT_COUNT(bad); i++) {
            float *field = (float *)(void *)((char *)&stage.materials[1] + fields[f].field);

            *field = bad[i];
            memset(&error, 0, sizeof error);
            CHECK_STATUS(rt_check_scene(&stage.scene, &error), RT_ERROR_ARGUMENT);
            CHECK(strstr(error.message, fields[f].name) != NULL);
            *field = 0;
        }
    stage.light.position.y = NAN;
    CHECK(rt_check_scene(&stage.scene, &error) == RT_ERROR_ARGUMENT && strstr(error.message, "light 0: its position"));
    stage.light.position.y = 0;
    stage.light.color.z = -1;
    CHECK(rt_check_scene(&stage.scene, &error) == RT_ERROR_ARGUMENT && strstr(error.message, "light 0: its color"));
    stage.light.color.z = 0;
    stage.scene.background.x = INFINITY;
    CHECK(rt_check_scene(&stage.scene, &error) == RT_ERROR_ARGUMENT && strstr(error.message, "background"));
    stage.scene.background.x = 0;
    stage.ids[2] = RTT_COUNT(stage.materials);
    CHECK(rt_check_scene(&stage.scene, &error) == RT_ERROR_ARGUMENT && error.prim == 2 && strstr(error.message, "material 16 of 16"));
    stage.scene.material_ids = NULL;
    CHECK_STATUS(rt_check_scene(&stage.scene, &error), RT_OK);
    stage.scene.geometry = NULL;
    CHECK_STATUS(rt_check_scene(&stage.scene, &error), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_check_scene(NULL, NULL), RT_ERROR_ARGUMENT);
    rtt_stage_free(&stage);
}

static void rtt_test_render_errors(void)
{
    rtt_model model = { 0 };
    rt_render_options options;
    rt_geometry geometry;
    rt_scene scene;
    rt_accel *accel;
    rt_error error = { RT_OK, 0, "" };
    rt_vec3 pixels[16], untouched[16];

    rtt_room(&model, &scene, &geometry, &accel);
    memset(&options, 0, sizeof options);
    memset(pixels, 0xcc, sizeof pixels);
    memset(untouched, 0xcc, sizeof untouched);
    options.width = options.height = 4;
    options.trace.algorithm = RT_KD_STACK;  /* of another structure than the room's */
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    options.trace.algorithm = RT_AUTO;
    options.trace.packet_width = -7;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    options.trace.packet_width = 0;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 5, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_render_tile(&scene, &options, -1, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 4, 4, NULL, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_render_tile(NULL, &options, 0, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    options.spp = -1;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    options.spp = 0;
    options.depth = RT_MAX_DEPTH + 1;
    options.trace.error = &error;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 4, 4, pixels, NULL), RT_ERROR_ARGUMENT);
    CHECK(strstr(error.message, "depth is 65") && strstr(error.message, "at most 64"));
    CHECK(memcmp(pixels, untouched, sizeof pixels) == 0);
    rt_free(accel);
    rtt_model_free(&model);
}

/* ---- >>raster --------------------------------------------------------------------------------------------------------- */

/* Pictures of the same as rt_trace sees it. */
typedef struct { int width, height; float dx, dy; } rtt_frame;

static rt_hit *rtt_trace_frame(const rtt_model *model, const rt_camera *camera, const rtt_frame *frame)
{
    size_t count = (size_t)frame->width * (size_t)frame->height;
    rt_ray *rays = (rt_ray *)rtt_array(count, sizeof *rays);
    rt_hit *hits = (rt_hit *)rtt_array(count, sizeof *hits);
    rt_geometry geometry = rtt_geometry(model);
    rt_build_options options;
    rt_accel *accel;

    memset(&options, 0, sizeof options);
    options.skip_invalid = model->skip_invalid;
    if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
        rtt_die("a scene does not build");
    for (size_t i = 0; i < count; i++)
        rays[i] = rt_camera_ray(camera, (float)(i % (size_t)frame->width) + frame->dx, (float)(i / (size_t)frame->width) + frame->dy,
                                frame->width, frame->height);
    CHECK_STATUS(rt_trace(accel, NULL, rays, count, hits), RT_OK);
    rt_free(accel);
    free(rays);
    return hits;
}

static bool rtt_same_frame(const char *what, const char *way, const rt_camera *camera, const rtt_frame *frame, const rt_hit *got,
                           const rt_hit *want)
{
    size_t count = (size_t)frame->width * (size_t)frame->height, wrong = 0, first = 0;

    for (size_t i = count; i-- > 0;)
        if (!rtt_same(got[i], want[i]))
            wrong++, first = i;
    if (wrong)
        rtt_fail("%s, %s: %zu of %d x %d pixels differ, eye {%a,%a,%a} look {%a,%a,%a} fov %a, sample %a %a; first (%zu, %zu):\n"
                 "        got      t %a u %a v %a prim %u inst %u\n        expected t %a u %a v %a prim %u inst %u", what, way, wrong,
                 frame->width, frame->height, (double)camera->eye.x, (double)camera->eye.y, (double)camera->eye.z, (double)camera->look.x,
                 (double)camera->look.y, (double)camera->look.z, (double)camera->fov, (double)frame->dx, (double)frame->dy,
                 first % (size_t)frame->width, first / (size_t)frame->width, (double)got[first].t, (double)got[first].u,
                 (double)got[first].v, got[first].prim, got[first].inst, (double)want[first].t, (double)want[first].u,
                 (double)want[first].v, want[first].prim, want[first].inst);
    return wrong == 0;
}

/* Rasterised with every instruction set, whole, in odd rectangles, and by rt_rasterize. Answers how many pixels hit something. */
static size_t rtt_check_raster(const char *what, const rtt_model *model, const rt_camera *camera, const rtt_frame *frame)
{
    size_t count = (size_t)frame->width * (size_t)frame->height, hits = 0;
    rt_hit *want = rtt_trace_frame(model, camera, frame), *got = (rt_hit *)rtt_array(count, sizeof *got);
    rt_geometry geometry = rtt_geometry(model);

    for (size_t i = 0; i < count; i++)
        hits += want[i].prim != RT_NONE;
    for (int isa = 0; isa < RT_ISA_COUNT; isa++) {
        rt_raster_options options;
        rt_raster_info info;
        rt_raster *r;
        rt_status status;
        size_t calls;

        memset(&options, 0, sizeof options);
        options.isa = (rt_isa)isa;
        options.skip_invalid = model->skip_invalid;
        options.offset_x = frame->dx - 0.5f;
        options.offset_y = frame->dy - 0.5f;
        status = rt_raster_create(&r, &geometry, camera, frame->width, frame->height, &options);
        if (isa != RT_ISA_AUTO && status == RT_ERROR_UNSUPPORTED)
            continue;
        if (!CHECK_STATUS(status, RT_OK))
            continue;
        rt_raster_get_info(r, &info);
        CHECK(info.seen <= geometry.triangle_count + geometry.sphere_count + geometry.instance_count);
        CHECK(info.entries <= 4 * info.seen && info.entries >= info.seen && info.tiles <= 2 * info.seen + RTI_MAX_LEVELS);
        calls = rtt_heap.calls;
        memset(got, 0xcc, count * sizeof *got);
        CHECK_STATUS(rt_raster_tile(r, 0, 0, frame->width, frame->height, frame->dx, frame->dy, got), RT_OK);
        CHECK(rtt_heap.calls == calls);
        rtt_same_frame(what, rtt_isa_names[isa], camera, frame, got, want);
        memset(got, 0xcc, count * sizeof *got);
        for (int y = 0, h; y < frame->height; y += h) {
            h = 1 + (y * 7 + 3) % 29 < frame->height - y ? 1 + (y * 7 + 3) % 29 : frame->height - y;
            for (int x = 0, w; x < frame->width; x += w) {
                w = 1 + (x * 5 + y + 11) % 37 < frame->width - x ? 1 + (x * 5 + y + 11) % 37 : frame->width - x;
                CHECK_STATUS(rt_raster_tile(r, x, y, x + w, y + h, frame->dx, frame->dy, got), RT_OK);
            }
        }
        rtt_same_frame(what, "in rectangles", camera, frame, got, want);
        rt_raster_free(r);
        if (0.5f + options.offset_x != frame->dx || 0.5f + options.offset_y != frame->dy)
            continue;
        memset(got, 0xcc, count * sizeof *got);
        CHECK_STATUS(rt_rasterize(&geometry, camera, frame->width, frame->height, &options, got), RT_OK);
        rtt_same_frame(what, "rt_rasterize", camera, frame, got, want);
    }
    free(want);
    free(got);
    return hits;
}

static rt_camera rtt_camera_at(rt_vec3 eye, rt_vec3 look, rt_vec3 up, float fov)
{
    rt_camera camera;

    camera.eye = eye, camera.look = look, camera.up = up, camera.fov = fov;
    return camera;
}

/* Cameras before, in, on, beside and behind a model of that size around center, pictures of many shapes, samples of many places. Answers
   the pixels that hit something. */
static size_t rtt_check_cameras(const char *what, const rtt_model *model, rtt_random *random, rt_vec3 center, float size)
{
    static const rtt_frame frames[] = { { 40, 30, 0.5f, 0.5f }, { 64, 64, 0.5f, 0.5f }, { 1, 1, 0.5f, 0.5f }, { 17, 33, 0, 1 },
                                        { 150, 3, 0.25f, 0.75f }, { 3, 90, 0.3f, 0.99f }, { 70, 50, 1, 0.1f } };
    static const float angles[] = { 60, 90, 179.9f, 179.9999f, 179.99999f, 1, 1e-2f, 1e-4f, 1e-5f, 1e-10f, 1e-37f };
    size_t hits = 0, next = 0;

    for (int place = 0; place < 8; place++)
        for (size_t a = 0; a < RTT_COUNT(angles); a++) {
            rt_vec3 eye, look, up = rtt_axis(rtt_below(random, 6));
            rt_camera camera;

            eye = rtt_point(random, center, place == 0 ? size : 4 * size);              /* inside; outside */
            look = rtt_feature(model, random);
            if (place == 2)                 /* on a vertex, a centre or an edge, */
                eye = rtt_feature(model, random);
            if (place == 3 || place == 4) { /* with vertices in the eye plane, along an axis, */
                eye = rtt_feature(model, random);
                look = rtt_add(eye, rtt_mul(rtt_axis(rtt_below(random, 6)), size));
                if (place == 4)
                    eye = rtt_sub(eye, rtt_mul(rtt_sub(look, eye), 3));
            }
            if (place == 5)                 /* close to something, */
                eye = rtt_add(look, rtt_point(random, rtt_origin, 1e-3f * size));
            if (place == 6)                 /* far away, */
                eye = rtt_point(random, center, 1e6f * size < 1e18f ? 1e6f * size : 1e18f);
            if (place == 7)                 /* looking the other way: */
                look = rtt_sub(rtt_add(eye, eye), center);
            camera = rtt_camera_at(eye, look, up, angles[a]);
            hits += rtt_check_raster(what, model, &camera, &frames[next++ % RTT_COUNT(frames)]);
        }
    return hits;
}

static void rtt_test_raster_shapes(void)
{
    rtt_random random = rtt_stream();
    rtt_model cube = { 0 }, torus = { 0 }, cloud = { 0 }, balls = { 0 }, grid = { 0 };
    static const float scales[] = { 1, 1e-5f, 1e5f };

    for (size_t s = 0; s < RTT_COUNT(scales); s++) {
        rtt_model mesh = { 0 };

        rtt_cube(&mesh, 5, s > 0, scales[s], rtt_v(scales[s], 0, -scales[s]));
        CHECK(rtt_check_cameras("cube", &mesh, &random, rtt_v(scales[s], 0, -scales[s]), scales[s]) > 10000);
        rtt_model_free(&mesh);
    }
    rtt_torus(&torus, 10, 1, rtt_origin);
    CHECK(rtt_check_cameras("torus", &torus, &random, rtt_origin, 1) > 5000);
    rtt_cloud(&cloud, &random, 500, rtt_v(5, 6, 7), 2, 0.5f);
    CHECK(rtt_check_cameras("cloud", &cloud, &random, rtt_v(5, 6, 7), 2) > 10000);
    rtt_balls(&balls, &random, 120, rtt_origin, 1, 0.3f);
    rtt_ball(&balls, rtt_origin, 1.5f);
    CHECK(rtt_check_cameras("balls", &balls, &random, rtt_origin, 1) > 10000);
    for (int i = 0; i < 150; i++) {         /* coincident planes and vertices, screen-filling triangles */
        rt_vec3 a = rtt_lattice(&random, 4), b = rtt_lattice(&random, 4), c = rtt_lattice(&random, 4);

        rtt_face(&grid, a, b, c);
    }
    CHECK(rtt_check_cameras("lattice", &grid, &random, rtt_origin, 4) > 10000);
    rtt_model_free(&cube);
    rtt_model_free(&torus);
    rtt_model_free(&cloud);
    rtt_model_free(&balls);
    rtt_model_free(&grid);
}

static void rtt_test_raster_instances(void)
{
    static const float scales[] = { 1, 1e-4f, 1e4f };
    rtt_random random = rtt_stream();

    for (size_t s = 0; s < RTT_COUNT(scales); s++) {
        rtt_model child = { 0 }, middle = { 0 }, world = { 0 }, nothing = { 0 };
        float matrix[12], size = 3 * scales[s];

        rtt_cloud(&child, &random, 30, rtt_origin, 1, 0.4f);
        rtt_balls(&child, &random, 5, rtt_origin, 1, 0.2f);
        for (int i = 0; i < 3; i++) {
            rtt_matrix(&random, 0.5f, rtt_point(&random, rtt_origin, 1), matrix);
            rtt_instance(&middle, &child, matrix);
        }
        rtt_place(&middle, &nothing, rtt_v(1, 1, 1), rtt_origin);
        rtt_ball(&middle, rtt_origin, 0.2f);
        for (int i = 0; i < 10; i++) {
            rtt_matrix(&random, scales[s], rtt_point(&random, rtt_origin, size), matrix);
            rtt_instance(&world, i % 2 ? &child : &middle, matrix);
        }
        rtt_place(&world, &child, rtt_mul(rtt_v(-1, 1, 1000), scales[s]), rtt_origin);
        rtt_cloud(&world, &random, 20, rtt_origin, size, size);
        rtt_balls(&world, &random, 8, rtt_origin, size, 0.3f * size);
        CHECK(rtt_check_cameras("instances", &world, &random, rtt_origin, size) > 10000);
        rtt_model_free(&world);
        rtt_model_free(&middle);
        rtt_model_free(&child);
        rtt_model_free(&nothing);
    }
}

/* What rounding moves inside a needle is stretched on the way out: seen from the origin and from where features fill the picture. */
static void rtt_test_raster_skewed(void)
{
    static const float squeeze[][3] = { { 1e-3f, 1, 1 }, { 1, 1e4f, 1 }, { 1e3f, 1, 1e-3f }, { -1e-4f, -1e-4f, 1e4f } };
    rtt_random random = rtt_stream();
    size_t hits = 0;

    for (size_t s = 0; s < RTT_COUNT(squeeze); s++)
        for (int afar = 0; afar < 2; afar++) {
            rtt_model box = { 0 }, world = { 0 };
            float turn[12], squash[12], matrix[12];
            rt_vec3 center = rtt_point(&random, rtt_origin, afar ? 1e6f : 3);

            rtt_cube(&box, 1, false, 1, rtt_origin);              /* its corners reach those of its bounds */
            for (int i = 0; i < 3; i++) {
                memset(squash, 0, sizeof squash);
                squash[0] = squeeze[s][0], squash[5] = squeeze[s][1], squash[10] = squeeze[s][2];
                rtt_matrix(&random, 1, rtt_origin, turn);
                rtt_concat(squash, turn, matrix);
                rtt_matrix(&random, 1, rtt_origin, turn);
                rtt_concat(turn, matrix, squash);
                squash[3] = center.x, squash[7] = center.y, squash[11] = center.z;
                rtt_instance(&world, &box, squash);
            }
            for (int i = 0; i < 120; i++) {
                rtt_frame frame = { 30, 30, 0.5f, 0.5f };
                rt_vec3 look = rtt_feature(&world, &random), eye = rtt_point(&random, look, ldexpf(1, i % 28 - 4));
                rt_camera camera = rtt_camera_at(i % 4 ? eye : rtt_origin, look, rtt_v(0, 1, 0), ldexpf(1, i % 9 - 6));

                hits += rtt_check_raster("skewed", &world, &camera, &frame);
            }
            rtt_model_free(&world);
            rtt_model_free(&box);
        }
    CHECK(hits > 10000);
}

static void rtt_test_raster_ugly(void)
{
    rtt_random random = rtt_stream();

    for (int kind = 0; kind < 8; kind++) {
        rtt_model model = { 0 };
        static const float sizes[] = { 1, 1, 1e18f, 0x1p-126f, 0x1p-140f, 1e17f, 1, 1 };
        rt_vec3 center = kind == 6 ? rtt_v(1e10f, 3, -5) : rtt_origin;
        float size = sizes[kind];

        if (kind == 0)
            rtt_degenerate(&model, &random);
        if (kind == 1)
            for (int k = 0; k < 250; k++) {
                rt_vec3 corner[3];

                for (int c = 0; c < 3; c++) {
                    corner[c].x = rtt_log(&random, k % 2 ? k % 150 - 100 : -100, k % 2 ? k % 150 - 100 : 56);
                    corner[c].y = rtt_log(&random, k % 2 ? k % 150 - 100 : -100, k % 2 ? k % 150 - 100 : 56);
                    corner[c].z = rtt_log(&random, k % 2 ? k % 150 - 100 : -100, k % 2 ? k % 150 - 100 : 56);
                }
                rtt_face(&model, corner[0], corner[1], corner[2]);
                if (k % 5 == 0)
                    rtt_ball(&model, corner[0], fabsf(corner[1].x));
            }
        if (kind == 2) {
            rtt_quad(&model, rtt_v(-1e18f, -1e18f, -1e18f), rtt_v(2e18f, 0, 0), rtt_v(0, 2e18f, 0));
            rtt_quad(&model, rtt_v(-1e18f, -1e18f, 1e18f), rtt_v(2e18f, 0, 0), rtt_v(0, 2e18f, 0));
        }
        if (kind >= 2 && kind < 7) {
            rtt_cloud(&model, &random, 150, center, 0.4f * size, 0.4f * size);
            rtt_balls(&model, &random, 20, center, 0.5f * size, 0.4f * size);
        }
        if (kind == 7) {                    /* bad ones strewn in */
            model.skip_invalid = true;
            for (int k = 0; k < 60; k++) {
                rt_vec3 a = rtt_point(&random, rtt_origin, 1), b = rtt_point(&random, rtt_origin, 1), c = rtt_point(&random, rtt_origin, 1);

                if (k % 3 == 1)
                    b.y = k % 2 ? NAN : 2e18f;
                rtt_face(&model, a, b, c);
                rtt_ball(&model, a, k % 4 == 0 ? -1 : 0.1f);
            }
            model.spheres[0].center.x = INFINITY;
        }
        rtt_check_cameras("ugly", &model, &random, center, size);
#if RTI_X86
        {
            const unsigned int given = _mm_getcsr(), flush = 0x8040;   /* FTZ and DAZ */

            _mm_setcsr(given | flush);
            rtt_check_cameras("ugly, flush to zero", &model, &random, center, size);
            _mm_setcsr(given);
        }
#endif
        rtt_model_free(&model);
    }
    for (int kind = 0; kind < 4; kind++) {  /* cameras that see nothing: no view, no eye, out of range */
        rtt_model model = { 0 };
        rtt_frame frame = { 20, 10, 0.5f, 0.5f };
        rt_camera camera = rtt_camera_at(rtt_v(0, 0, 3), rtt_origin, rtt_v(0, 1, 0), 50);

        rtt_cloud(&model, &random, 50, rtt_origin, 1, 1);
        if (kind == 0)
            camera.look = camera.eye;
        if (kind == 1)
            camera.eye.x = NAN;
        if (kind == 2)
            camera.eye.z = 2e18f;
        if (kind == 3)
            camera.up.y = INFINITY;
        CHECK(rtt_check_raster("blind", &model, &camera, &frame) == 0 || kind == 3);
        rtt_model_free(&model);
    }
    for (int e = 20; e <= 56; e++) {        /* a sphere that is smaller than the steps of the coordinates where it lies */
        rtt_model model = { 0 };
        rtt_frame frame = { 40, 30, 0.5f, 0.5f };
        rt_camera camera = rtt_camera_at(rtt_v(5, ldexpf(1, e), 0), rtt_v(0, ldexpf(1, e), 0), rtt_v(0, 1, 0), 60);

        rtt_ball(&model, camera.look, 1);
        CHECK(rtt_check_raster("small and far off", &model, &camera, &frame) > 50);
        rtt_model_free(&model);
    }
}

/* Things so far off, or seen so closely, that a pixel is of the size of the rounding of the rays: where margins decide. */
static void rtt_test_raster_margins(void)
{
    rtt_random random = rtt_stream();
    size_t hits = 0;

    for (int i = 0; i < 300; i++) {
        rtt_model model = { 0 };
        rtt_frame frame = { 40 + i % 30, 40, 0.5f, 0.5f };
        rt_vec3 eye = rtt_point(&random, rtt_origin, 100), center = rtt_point(&random, rtt_origin, 1);
        float distance = (float)rtt_length(rtt_sub(eye, center)), size = ldexpf(distance, -12 - i % 16);
        rt_camera camera;

        for (int k = 0; k < 8; k++) {
            rt_vec3 a = rtt_point(&random, center, size);

            rtt_face(&model, a, rtt_add(a, rtt_point(&random, rtt_origin, 0.2f * size)),
                     rtt_add(a, rtt_point(&random, rtt_origin, 0.2f * size)));
            rtt_ball(&model, rtt_point(&random, center, size), 0.05f * size);
        }
        if (i % 3 == 0)
            rtt_quad(&model, rtt_point(&random, center, 0.3f * size), rtt_point(&random, rtt_origin, 3 * distance),
                     rtt_point(&random, rtt_origin, 3 * distance));
        camera = rtt_camera_at(eye, center, rtt_v(0, 1, 0), fmaxf(1e-5f, 114.6f * size / distance));
        hits += rtt_check_raster("margins", &model, &camera, &frame);
        rtt_model_free(&model);
    }
    CHECK(hits > 20000);
}

/* As wide, and as high, as pictures may be: samples beyond 2^19 have 16 places a pixel. */
static void rtt_test_raster_huge(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };

    rtt_cloud(&model, &random, 500, rtt_origin, 1, 0.5f);
    rtt_balls(&model, &random, 100, rtt_origin, 1, 0.2f);
    for (int i = 0; i < 3; i++) {
        rtt_frame frame = { i == 1 ? 2 : 1 << 20, i == 1 ? 1 << 20 : i == 0 ? 1 : 3, 0.3f, 0.9f };
        rt_camera camera = rtt_camera_at(rtt_v(0, 0, 4), rtt_v(0.1f, 0, 0), rtt_v(0, 1, 0), i == 1 ? 60 : 0.0002f);

        CHECK(rtt_check_raster("huge", &model, &camera, &frame) > 1000);
    }
    rtt_model_free(&model);
}

/* The lists and hits are the same with any parallel_for. */
static void rtt_test_raster_threads(void)
{
    static const rt_parallel_for loops[] = { rtt_backwards, rtt_threaded };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 }, child = { 0 };
    rt_geometry geometry;
    rt_camera camera = rtt_camera_at(rtt_v(0, 0, 3), rtt_origin, rtt_v(0, 1, 0), 50);
    rtt_frame frame = { 301, 203, 0.5f, 0.5f };
    rt_hit *want, *got = (rt_hit *)rtt_array((size_t)301 * 203, sizeof *got);
    rt_raster *alone, *r;
    rt_raster_info a, b;

    rtt_cloud(&child, &random, 20, rtt_origin, 0.2f, 0.1f);
    rtt_cloud(&model, &random, 150000, rtt_origin, 1, 0.05f);
    rtt_balls(&model, &random, 1000, rtt_origin, 1, 0.05f);
    for (int i = 0; i < 50; i++)
        rtt_place(&model, &child, rtt_v(1, 1, 1), rtt_point(&random, rtt_origin, 1));
    geometry = rtt_geometry(&model);
    want = rtt_trace_frame(&model, &camera, &frame);
    CHECK_STATUS(rt_raster_create(&alone, &geometry, &camera, frame.width, frame.height, NULL), RT_OK);
    rt_raster_get_info(alone, &a);
    for (size_t k = 0; k < RTT_COUNT(loops); k++) {
        rt_raster_options options;
        size_t calls = 0;

        memset(&options, 0, sizeof options);
        options.parallel_for = loops[k];
        options.parallel_user = &calls;
        CHECK_STATUS(rt_raster_create(&r, &geometry, &camera, frame.width, frame.height, &options), RT_OK);
        rt_raster_get_info(r, &b);
        CHECK(memcmp(&a, &b, sizeof a) == 0 && calls == 3);
        CHECK(memcmp(alone->starts, r->starts, (a.tiles + 1) * sizeof *r->starts) == 0);
        CHECK(memcmp(alone->entries, r->entries, a.entries * sizeof *r->entries) == 0);
        rt_raster_free(r);
        memset(got, 0xcc, (size_t)frame.width * (size_t)frame.height * sizeof *got);
        CHECK_STATUS(rt_rasterize(&geometry, &camera, frame.width, frame.height, &options, got), RT_OK);
        rtt_same_frame("threads", "rt_rasterize", &camera, &frame, got, want);
        CHECK(calls == 7);
    }
    rt_raster_free(alone);
    rt_raster_free(NULL);
    rtt_model_free(&model);
    rtt_model_free(&child);
    free(want);
    free(got);
}

/* As many triangles as fill the picture, each: the lists must not grow with the tiles. */
static void rtt_test_raster_memory(void)
{
    static const size_t sizes[] = { 0, 1, 300, 20000 };
    rtt_random random = rtt_stream();
    rt_camera camera = rtt_camera_at(rtt_v(0, 0, 3), rtt_origin, rtt_v(0, 1, 0), 50);
    rtt_model filling = { 0 };
    rt_geometry geometry;
    rtt_memory memory = { 0 };
    rt_raster_options options;
    rt_raster *r;
    rt_raster_info info;

    for (size_t i = 0; i < 50000 / rtt.scale; i++)
        rtt_face(&filling, rtt_v(-10, -10, rtt_signed(&random)), rtt_v(10, -10, rtt_signed(&random)), rtt_v(0, 20, rtt_signed(&random)));
    geometry = rtt_geometry(&filling);
    memset(&options, 0, sizeof options);
    options.memory_user = &memory;
    CHECK_STATUS(rt_raster_create(&r, &geometry, &camera, 3840, 2160, &options), RT_OK);
    rt_raster_get_info(r, &info);
    CHECK(info.seen == filling.triangle_count && info.entries <= 4 * info.seen);
    CHECK(memory.live == info.bytes && memory.peak < 50 * filling.triangle_count + 10000);     /* for 8 million pixels */
    rt_raster_free(r);
    CHECK(memory.live == 0);
    rtt_model_free(&filling);
    for (size_t s = 0; s < RTT_COUNT(sizes); s++)
        for (int kind = 0; kind < 2; kind++)
            for (int whole = 0; whole < 2; whole++) {
                rtt_model model = { 0 }, child = { 0 };
                rt_hit hits[12 * 8], untouched[12 * 8];
                size_t calls = 0;

                if (sizes[s] > 0) {
                    rtt_cloud(&model, &random, sizes[s], rtt_origin, 1, 0.1f);
                    rtt_balls(&model, &random, sizes[s] / 2, rtt_origin, 1, 0.1f);
                    rtt_cloud(&child, &random, 4, rtt_origin, 1, 0.1f);
                    rtt_place(&model, &child, rtt_v(1, 1, 1), rtt_v(0, 0, 1));
                }
                geometry = rtt_geometry(&model);
                for (size_t k = 1; k < 100; k++) {
                    rt_status status;
                    rt_error error;

                    memset(&error, 0, sizeof error);
                    memset(&memory, 0, sizeof memory);
                    memset(hits, 0xcc, sizeof hits);
                    memset(untouched, 0xcc, sizeof untouched);
                    memory.fail_at = k;
                    options.error = &error;
                    options.parallel_for = kind ? rtt_threaded : NULL;
                    options.parallel_user = &calls;
                    r = (rt_raster *)(void *)&memory;
                    status = whole ? rt_rasterize(&geometry, &camera, 12, 8, &options, hits)
                                   : rt_raster_create(&r, &geometry, &camera, 12, 8, &options);
                    if (status == RT_OK) {
                        CHECK(k > 1 && memory.calls < k);
                        if (!whole)
                            rt_raster_free(r);
                        CHECK(memory.live == 0 && memory.blocks == 0);
                        break;
                    }
                    CHECK_STATUS(status, RT_ERROR_MEMORY);
                    CHECK(error.status == RT_ERROR_MEMORY && error.message[0] != 0 && (whole || r == NULL));
                    CHECK(memcmp(hits, untouched, sizeof hits) == 0);
                    CHECK(memory.live == 0 && memory.blocks == 0 && k < 50);
                }
                rtt_model_free(&model);
                rtt_model_free(&child);
            }
}

static void rtt_raster_refused(const rt_geometry *geometry, const rt_camera *camera, int width, int height, rt_raster_options options,
                               rt_status want, const char *part)
{
    rt_hit hits[4], untouched[4];
    rt_error error;

    for (int whole = 0; whole < 2; whole++) {
        rt_raster *r = (rt_raster *)(void *)&error;

        memset(&error, 0, sizeof error);
        memset(hits, 0xcc, sizeof hits);
        memset(untouched, 0xcc, sizeof untouched);
        options.error = &error;
        CHECK_STATUS(whole ? rt_rasterize(geometry, camera, width, height, &options, hits)
                           : rt_raster_create(&r, geometry, camera, width, height, &options), want);
        CHECK(memcmp(hits, untouched, sizeof hits) == 0 && (whole || r == NULL));
        if (error.status != want || !strstr(error.message, part))
            rtt_fail("\"%s\" does not say \"%s\"", error.message, part);
        options.error = NULL;
        CHECK_STATUS(whole ? rt_rasterize(geometry, camera, width, height, &options, hits)
                           : rt_raster_create(&r, geometry, camera, width, height, &options), want);
    }
}

static void rtt_test_raster_errors(void)
{
    rt_camera camera = rtt_camera_at(rtt_v(0, 0, 3), rtt_origin, rtt_v(0, 1, 0), 50), other;
    rtt_model model = { 0 };
    rt_geometry geometry;
    rt_raster_options options;
    rt_raster_info info;
    rt_raster *r;
    rt_error error;
    rt_hit hits[4 * 3], untouched[4 * 3];

    rtt_quad(&model, rtt_v(-1, -1, 0), rtt_v(2, 0, 0), rtt_v(0, 2, 0));
    rtt_ball(&model, rtt_origin, 0.5f);
    geometry = rtt_geometry(&model);
    memset(&options, 0, sizeof options);
    rtt_raster_refused(NULL, &camera, 4, 3, options, RT_ERROR_ARGUMENT, "geometry");
    rtt_raster_refused(&geometry, NULL, 4, 3, options, RT_ERROR_ARGUMENT, "camera");
    rtt_raster_refused(&geometry, &camera, 0, 3, options, RT_ERROR_ARGUMENT, "0 x 3");
    rtt_raster_refused(&geometry, &camera, 4, -1, options, RT_ERROR_ARGUMENT, "4 x -1");
    rtt_raster_refused(&geometry, &camera, (1 << 20) + 1, 3, options, RT_ERROR_ARGUMENT, "1048577");
    other = camera;
    other.fov = 180;
    rtt_raster_refused(&geometry, &other, 4, 3, options, RT_ERROR_ARGUMENT, "fov");
    other.fov = NAN;
    rtt_raster_refused(&geometry, &other, 4, 3, options, RT_ERROR_ARGUMENT, "fov");
    options.offset_x = 0.6f;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_ARGUMENT, "offset");
    options.offset_x = 0;
    options.offset_y = NAN;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_ARGUMENT, "offset");
    options.offset_y = 0;
    options.isa = (rt_isa)RT_ISA_COUNT;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_ARGUMENT, "isa");
    if (RTI_X86) {
        options.isa = RT_ISA_SCALAR;
        rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_UNSUPPORTED, "scalar");
    }
    options.isa = RT_ISA_AUTO;
    geometry.vertex_stride = 5;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_ARGUMENT, "vertex_stride");
    geometry.vertex_stride = 0;
    CHECK_STATUS(rt_raster_create(NULL, &geometry, &camera, 4, 3, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_rasterize(&geometry, &camera, 4, 3, NULL, NULL), RT_ERROR_ARGUMENT);

    model.spheres[0].radius = -1;           /* bad primitives: as rt_build says it */
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_GEOMETRY, "sphere 0");
    model.vertices[1] = NAN;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_GEOMETRY, "triangle 0");
    options.error = &error;
    CHECK_STATUS(rt_raster_create(&r, &geometry, &camera, 4, 3, &options), RT_ERROR_GEOMETRY);
    CHECK(error.prim == 0);
    model.vertices[1] = -1;
    model.indices[5] = 4;
    rtt_raster_refused(&geometry, &camera, 4, 3, options, RT_ERROR_GEOMETRY, "triangle 1");
    model.vertices[1] = NAN;
    options.skip_invalid = true;
    CHECK_STATUS(rt_raster_create(&r, &geometry, &camera, 4, 3, &options), RT_OK);
    rt_raster_get_info(r, &info);
    CHECK(info.skipped == 3 && info.seen == 0);
    rt_raster_free(r);
    model.indices[5] = 3;
    model.vertices[1] = -1;
    model.spheres[0].radius = 0.5f;

    memset(hits, 0xcc, sizeof hits);
    memset(untouched, 0xcc, sizeof untouched);
    CHECK_STATUS(rt_raster_create(&r, &geometry, &camera, 4, 3, NULL), RT_OK);
    CHECK_STATUS(rt_raster_tile(NULL, 0, 0, 4, 3, 0.5f, 0.5f, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 0, 0, 4, 3, 0.5f, 0.5f, NULL), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, -1, 0, 4, 3, 0.5f, 0.5f, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 0, 0, 5, 3, 0.5f, 0.5f, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 0, 2, 4, 1, 0.5f, 0.5f, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 0, 0, 4, 3, 1.1f, 0.5f, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 0, 0, 4, 3, 0.5f, NAN, hits), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_raster_tile(r, 2, 2, 2, 3, 0.5f, 0.5f, hits), RT_OK);
    CHECK(memcmp(hits, untouched, sizeof hits) == 0);
    rt_raster_free(r);
    rtt_model_free(&model);
}

/* rt_render_tile draws the same picture with rasterised eye rays; a raster of something else is refused. */
static void rtt_test_raster_render(void)
{
    enum { WIDTH = 61, HEIGHT = 43, PIXELS = WIDTH * HEIGHT };
    static rt_vec3 traced[PIXELS], drawn[PIXELS];
    rtt_model model = { 0 }, larger = { 0 };
    rt_geometry geometry, other_geometry;
    rt_render_options options;
    rt_ray_counts counts, drawn_counts;
    rt_scene scene;
    rt_accel *accel;
    rt_raster *r;

    rtt_room(&model, &scene, &geometry, &accel);
    CHECK_STATUS(rt_raster_create(&r, &geometry, &scene.camera, WIDTH, HEIGHT, NULL), RT_OK);
    memset(&options, 0, sizeof options);
    options.width = WIDTH, options.height = HEIGHT;
    for (int spp = 1; spp <= 5; spp++) {
        options.spp = spp;
        options.raster = NULL;
        memset(&counts, 0, sizeof counts);
        memset(&drawn_counts, 0, sizeof drawn_counts);
        CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, WIDTH, HEIGHT, traced, &counts), RT_OK);
        options.raster = r;
        memset(drawn, 0xcc, sizeof drawn);
        for (int y = 0; y < HEIGHT; y += 7)
            for (int x = 0; x < WIDTH; x += 23)
                CHECK_STATUS(rt_render_tile(&scene, &options, x, y, x + 23 < WIDTH ? x + 23 : WIDTH, y + 7 < HEIGHT ? y + 7 : HEIGHT, drawn,
                                            &drawn_counts), RT_OK);
        CHECK(memcmp(traced, drawn, sizeof drawn) == 0);
        CHECK(counts.primary == drawn_counts.primary && counts.shadow == drawn_counts.shadow);
    }
    memset(drawn, 0xcc, sizeof drawn);
    memset(traced, 0xcc, sizeof traced);
    options.width--;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 9, 9, drawn, NULL), RT_ERROR_ARGUMENT);
    options.width++;
    options.height++;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 9, 9, drawn, NULL), RT_ERROR_ARGUMENT);
    options.height--;
    scene.camera.fov++;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 9, 9, drawn, NULL), RT_ERROR_ARGUMENT);
    scene.camera.fov--;
    rtt_ball(&larger, rtt_origin, 1);
    other_geometry = rtt_geometry(&larger);
    scene.geometry = &other_geometry;
    CHECK_STATUS(rt_render_tile(&scene, &options, 0, 0, 9, 9, drawn, NULL), RT_ERROR_ARGUMENT);
    CHECK(memcmp(traced, drawn, sizeof drawn) == 0);
    rt_raster_free(r);
    rt_free(accel);
    rtt_model_free(&model);
    rtt_model_free(&larger);
}
#endif

/* ---- >>programs: the code in the documentation compiles and runs --------------------------------------------------------- */

/* A file of the project, found from where this one was compiled, or from the current folder; NULL if there is none. */
static char *rtt_read_project(const char *name)
{
    char path[4096];
    const char *slash = strrchr(__FILE__, '/');

    for (int try = 0; try < 2; try++) {
        FILE *file;
        char *text = NULL;
        size_t size = 0, got;

        if (try == 0)
            snprintf(path, sizeof path, "%.*s../%s", slash ? (int)(slash - __FILE__ + 1) : 0, __FILE__, name);
        else
            snprintf(path, sizeof path, "%s", name);
        file = fopen(path, "rb");
        if (!file)
            continue;
        do {
            text = (char *)realloc(text, size + 65536 + 1);
            if (!text)
                rtt_die("out of memory");
            got = fread(text + size, 1, 65536, file);
            size += got;
        } while (got);
        fclose(file);
        text[size] = 0;
        return text;
    }
    return NULL;
}

/* Compiles source beside copies of the headers in a folder of its own, runs it there, and hands back what it printed; NULL on failure. */
static char *rtt_compile_and_run(const char *source, char *output, size_t room)
{
    char folder[] = "/tmp/rt_test.XXXXXX", command[1024];
    const char *compiler = getenv("CC") ? getenv("CC") : "cc";
    char *header = rtt_read_project("rt.h"), *gpu = rtt_read_project("rt_gpu.h"), *kernels = rtt_read_project("rt_gpu_kernels.cl");
    struct { const char *name, *text; } files[] = { { "rt.h", header }, { "rt_gpu.h", gpu }, { "rt_gpu_kernels.cl", kernels },
                                                    { "program.c", source } };
    size_t got = 0;
    FILE *pipe;
    int status = -1;

    if (!CHECK(header && gpu && kernels) || !CHECK(mkdtemp(folder) != NULL)) {
        free(header);
        free(gpu);
        free(kernels);
        return NULL;
    }
    for (size_t i = 0; i < RTT_COUNT(files); i++) {
        FILE *file;

        snprintf(command, sizeof command, "%s/%s", folder, files[i].name);
        file = fopen(command, "wb");
        if (CHECK(file != NULL)) {
            CHECK(fputs(files[i].text, file) >= 0);
            CHECK(fclose(file) == 0);
        }
    }
    snprintf(command, sizeof command, "cd %s && %s -o program program.c -lm && ./program", folder, compiler);
    pipe = popen(command, "r");
    if (CHECK(pipe != NULL)) {
        got = fread(output, 1, room - 1, pipe);
        status = pclose(pipe);
    }
    output[got] = 0;
    snprintf(command, sizeof command, "rm -rf %s", folder);
    CHECK(system(command) == 0);
    free(header);
    free(gpu);
    free(kernels);
    return CHECK(status == 0) ? output : NULL;
}

/* The quick start of rt.h: its lines from after QUICK START to before CONTENTS, the preprocessor's first, the rest in a main. */
static void rtt_test_quick_start(void)
{
    char *header = rtt_read_project("rt.h"), *line, *stop, source[8192], output[256];
    size_t length;

    if (!CHECK(header != NULL))
        return;
    line = strstr(header, "QUICK START");
    stop = strstr(header, "CONTENTS");
    if (CHECK(line && stop && line < stop)) {
        length = (size_t)snprintf(source, sizeof source, "#include <stdio.h>\n");
        for (int body = 0; body < 2; body++) {
            char *at = strchr(line, '\n');

            if (body)
                length += (size_t)snprintf(source + length, sizeof source - length, "int main(void)\n{\n");
            while (at && at < stop) {
                char *next = strchr(++at, '\n');
                size_t indent = strspn(at, " ");

                if (!next || next > stop)
                    break;
                if ((at[indent] == '#') == (body == 0) && length < sizeof source)
                    length += (size_t)snprintf(source + length, sizeof source - length, "%.*s", (int)(next + 1 - at), at);
                at = next;
            }
        }
        length += (size_t)snprintf(source + length, sizeof source - length, "return 0;\n}\n");
        if (CHECK(length < sizeof source) && rtt_compile_and_run(source, output, sizeof output))
            CHECK(strcmp(output, "t 1, triangle 0\n") == 0);
    }
    free(header);
}

/* Every whole program in README.md compiles with its rt.h and runs; examples/hello.c and gpu_hello.c are shown there to the
   letter. */
static void rtt_test_readme(void)
{
    char *readme = rtt_read_project("README.md"), *hello = rtt_read_project("examples/hello.c"), output[4096];
    char *gpu_hello = rtt_read_project("examples/gpu_hello.c");
    char *block = readme;
    int programs = 0;

    while (block && (block = strstr(block, "```c\n")) != NULL) {
        char *start = block + 5, *end = strstr(start, "\n```");

        if (!CHECK(end != NULL))
            break;
        end[1] = 0;
        if (strstr(start, "int main(") && !(rtt.no_gpu && strstr(start, "rt_gpu.h"))) {
            char *text = (char *)rtt_array(strlen(start) + 1, 1), *from, *to = text;

            for (from = start; *from;)      /* programs of the project include "../rt.h" */
                if (strncmp(from, "\"../rt.h\"", 9) == 0) {
                    memcpy(to, "\"rt.h\"", 6);
                    to += 6, from += 9;
                } else
                    *to++ = *from++;
            CHECK(rtt_compile_and_run(text, output, sizeof output) && output[0] != 0);
            if (programs++ == 0 && hello)
                CHECK(strcmp(start, hello) == 0);
            if (strstr(start, "rt_gpu.h"))
                CHECK(gpu_hello && strcmp(start, gpu_hello) == 0 && strstr(output, "equal, bit for bit"));
            free(text);
        }
        block = end + 4;
    }
    CHECK(programs > 0);
    free(readme);
    free(hello);
    free(gpu_hello);
}

/* ---- >>loaders ------------------------------------------------------------------------------------------------------ */

/* The loaders' memory goes through these, so that a test can let the n-th request fail and count what was not given back. */
static long loader_requests, loader_fail_at, loader_held;

static bool loader_refuses(void)
{
    return ++loader_requests == loader_fail_at;
}

static void *loader_malloc(size_t size)
{
    void *memory = loader_refuses() ? NULL : malloc(size);

    loader_held += memory != NULL;
    return memory;
}

static void *loader_calloc(size_t count, size_t size)
{
    void *memory = loader_refuses() ? NULL : calloc(count, size);

    loader_held += memory != NULL;
    return memory;
}

static void *loader_realloc(void *old, size_t size)
{
    void *memory = loader_refuses() ? NULL : realloc(old, size);

    loader_held += memory != NULL && old == NULL;
    return memory;
}

static void loader_free(void *memory)
{
    loader_held -= memory != NULL;
    free(memory);
}

#define malloc loader_malloc
#define calloc loader_calloc
#define realloc loader_realloc
#define free loader_free
#include "../examples/pool.h"
#include "../examples/scene.h"
#include "../examples/refine.h"
#undef malloc
#undef calloc
#undef realloc
#undef free

static struct {
    char folder[256];                       /* a temporary one, with the files that a test writes */
    char path[512];
    char reports[1 << 16];                  /* all lines of the last load, without the folder, each with a newline */
    scene s;
    scene_error error;
} loader;

/* Gives the path of a file in the temporary folder, which is made when there is none. */
static const char *loader_path(const char *name)
{
    if (!loader.folder[0]) {
        const char *base = getenv("TMPDIR");

        snprintf(loader.folder, sizeof loader.folder, "%s/rt_test.XXXXXX", base && base[0] ? base : "/tmp");
        if (!mkdtemp(loader.folder))
            rtt_die("cannot make a temporary folder");
    }
    snprintf(loader.path, sizeof loader.path, "%s/%s", loader.folder, name);
    return loader.path;
}

static void loader_write_bytes(const char *name, const void *bytes, size_t size)
{
    FILE *file = fopen(loader_path(name), "wb");

    if (!file || fwrite(bytes, 1, size, file) != size || fclose(file) != 0)
        rtt_die("cannot write a temporary file");
}

static void loader_write(const char *name, const char *text)
{
    loader_write_bytes(name, text, strlen(text));
}

/* How many files lie in the temporary folder; all are removed. */
static int loader_clear(void)
{
    DIR *folder = loader.folder[0] ? opendir(loader.folder) : NULL;
    struct dirent *entry;
    char path[600];
    int count = 0;

    while (folder && (entry = readdir(folder)) != NULL) {
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", loader.folder, entry->d_name);
        if (remove(path) == 0)
            count++;
    }
    if (folder)
        closedir(folder);
    if (loader.folder[0])
        rmdir(loader.folder);               /* Windows' remove is for files only */
    loader.folder[0] = '\0';
    return count;
}

static void loader_report(void *user, const char *line)
{
    size_t used = strlen(loader.reports), folder = strlen(loader.folder);

    (void)user;
    if (folder > 0 && strncmp(line, loader.folder, folder) == 0)
        line += folder + 1;
    snprintf(loader.reports + used, sizeof loader.reports - used, "%s\n", line);
}

/* Loads into loader.s; of a failure nothing may remain. */
static bool loader_load(const char *name)
{
    static const scene zero;
    bool loaded;

    loader.reports[0] = '\0';
    loader_held = 0;
    loaded = scene_load(&loader.s, name, loader_report, NULL, &loader.error);
    if (!loaded) {
        CHECK(loader_held == 0);
        CHECK(memcmp(&loader.s, &zero, sizeof zero) == 0);
        CHECK(loader.error.errors > 0 && loader.error.message[0]);
    } else {
        CHECK(loader.error.errors == 0 && !loader.reports[0]);
    }
    return loaded;
}

static void loader_unload(void)
{
    scene_free(&loader.s);
    CHECK(loader_held == 0);
}

/* Is what was loaded fit for rt_build and rt_render_tile: all indices in range, all numbers finite? */
static void loader_check_whole(const char *name)
{
    const scene *s = &loader.s;
    const rt_geometry *g = &s->geometry;
    size_t i, bad = 0;

    for (i = 0; i < 3 * g->triangle_count; i++)
        bad += g->indices[i] >= g->vertex_count;
    for (i = 0; i < 3 * g->vertex_count; i++)
        bad += isfinite(g->vertices[i]) ? 0 : 1;
    for (i = 0; i < g->sphere_count; i++)
        bad += g->spheres[i].radius >= 0 && isfinite(g->spheres[i].radius) ? 0 : 1;
    for (i = 0; i < g->triangle_count + g->sphere_count; i++)
        bad += s->material_ids[i] >= s->material_count;
    for (i = 0; s->normal_indices && i < g->triangle_count; i++) {
        const uint32_t *n = s->normal_indices + 3 * i;
        int k;

        for (k = 0; k < 3 && n[0] != RT_NONE; k++) {
            rt_vec3 v = s->normals[n[k]];

            bad += !(fabsf(v.x * v.x + v.y * v.y + v.z * v.z - 1) < 1e-5f);
        }
    }
    bad += s->light_count == 0 || !s->lights || !(s->camera.fov > 0 && s->camera.fov < 180);
    if (bad)
        rtt_fail("%s: %zu things that cannot be rendered", name, bad);
}

/* Loads text as a file of that name; true, after complaint, if it loads and has these counts. */
static bool loader_text(const char *name, const char *text, size_t vertices, size_t triangles, size_t spheres, size_t shapes)
{
    const rt_geometry *g = &loader.s.geometry;

    loader_write(name, text);
    if (!loader_load(loader_path(name))) {
        rtt_fail("%s does not load: %s", text, loader.error.message);
        return false;
    }
    loader_check_whole(name);
    if (g->vertex_count == vertices && g->triangle_count == triangles && g->sphere_count == spheres && loader.s.shapes == shapes)
        return true;
    rtt_fail("%.60s...: %zu vertices, %zu triangles, %zu spheres, %zu shapes", text, g->vertex_count, g->triangle_count, g->sphere_count,
             loader.s.shapes);
    loader_unload();
    return false;
}

/* text must fail with exactly these reports, "file:line: what\n" each. */
static void loader_bad(const char *name, const char *text, const char *reports)
{
    size_t lines = 0, i;

    loader_write(name, text);
    if (loader_load(loader_path(name))) {
        rtt_fail("loads, and should not: %s", text);
        loader_unload();
        return;
    }
    if (strcmp(loader.reports, reports) != 0)
        rtt_fail("%s\n      reported %s      expected %s", text, loader.reports, reports);
    for (i = 0; reports[i]; i++)
        lines += reports[i] == '\n';
    CHECK(loader.error.errors == lines);
    CHECK(strncmp(loader.error.message + strlen(loader.folder) + 1, reports, strcspn(reports, "\n")) == 0);
}

/* text must load with so many warnings, the first of them as given (behind the folder). */
static void loader_warned(const char *name, const char *text, size_t warnings, const char *first)
{
    loader_write(name, text);
    if (!loader_load(loader_path(name))) {
        rtt_fail("%s does not load: %s", text, loader.error.message);
        return;
    }
    if (loader.s.warnings != warnings || strcmp(warnings ? loader.s.warning + strlen(loader.folder) + 1 : loader.s.warning, first) != 0)
        rtt_fail("%s: %zu warnings, %s", text, loader.s.warnings, loader.s.warning);
    loader_unload();
}

static bool loader_vec3(rt_vec3 v, float x, float y, float z)
{
    return fabsf(v.x - x) <= 1e-6f && fabsf(v.y - y) <= 1e-6f && fabsf(v.z - z) <= 1e-6f;
}

static const rt_material *loader_material(size_t prim) { return &loader.s.materials[loader.s.material_ids[prim]]; }

/* Every number becomes the nearest float, whatever its form, as strtof has it. */
static void rtt_test_obj_numbers(void)
{
    static const char *const forms[] = {
        "1", "+1", "-1", ".5", "-.5", "5.", "+5.", "0", "-0", "000123", "1e5", "1E5", "1e+5", "1E-5", "-1.25e-3", "0.1", "0.3", "1e38",
        "3.4028235e38", "3.40282346638528859811704183484516925440e38", "1.17549435e-38", "1e-45", "7.0064923e-46", "7.0064924e-46",
              "1e-400",
        "0e99999", "0e-99999999999", "16777217", "16777216.9999999999999999", "16777217.00000000000000000000000000000000001", "33554435",
        "8589973000", "9007199254740993", "1234567890123456789012345678901234567", "0.000000000000000000000000000000000000012345678",
        "5.5511151231257827021181583404541015625e-17", "100000000000000000000000000000000000000",
              "1.00000017881393421514957253748434595763683319091796875001",
        "1.00000017881393432617187499", "1.00000017881393432617187500", "1.00000017881393432617187501", "2.3509887e-38",
              "4.9406564584124654e-324"
    };
    char text[4096];
    uint64_t state = 42;
    size_t i, wrong = 0;
    sn_kind kind;

    for (i = 0; i < RTT_COUNT(forms); i++) {
        snprintf(text, sizeof text, "v %s 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", forms[i]);
        if (loader_text("t.obj", text, 3, 1, 0, 1)) {
            float want = strtof(forms[i], NULL);

            if (memcmp(&want, loader.s.vertices, sizeof want) != 0)
                rtt_fail("%s: %.9g, not %.9g", forms[i], (double)loader.s.vertices[0], (double)want);
            loader_unload();
        }
    }
    for (i = 0; i < 200000; i++) {          /* random ones: floats written with 1 to 20 digits, middles between two floats, any digits */
        const char *p = text;
        uint32_t bits;
        float value, next, want, got;

        state = sn_mix(state);
        bits = (uint32_t)state & 0x7fffffff;
        if (bits >= 0x7f7fffff)
            continue;
        memcpy(&value, &bits, sizeof value);
        bits++;
        memcpy(&next, &bits, sizeof next);
        if (i % 4 == 0)
            snprintf(text, sizeof text, "%.*e ", (int)(state >> 33) % 20, (double)value);
        else if (i % 4 == 1)
            snprintf(text, sizeof text, "%.17g ", ((double)value + (double)next) / 2);
        else if (i % 4 == 2)
            snprintf(text, sizeof text, "%.*f ", (int)(state >> 33) % 60, (double)(value * (value < 1e10f ? 1 : 0)));
        else
            snprintf(text, sizeof text, "%llu.%llue%d ", (unsigned long long)sn_mix(state + 1), (unsigned long long)sn_mix(state + 2),
                     (int)(state >> 40) % 60 - 50);
        want = strtof(text, NULL);
        kind = sn_number(&p, &got);
        wrong += isfinite(want) ? kind != SN_NUMBER || *p != ' ' || memcmp(&want, &got, sizeof got) != 0 : kind != SN_NOT_FINITE;
    }
    CHECK(wrong == 0);
    loader_clear();
}

/* The same cube, however its lines are written. */
static void rtt_test_obj_lines(void)
{
    static const char cube[] = "# a cube\n\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
        "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 4 1 5 8\n";
    static const char nul[] = "v 0 0 0\nv 1\0" "0 0\nv 0 1 0\nf 1 2 3\n", surrogates[] = "\xff\xfe#\0=\xd8\x00\xde\x00\xd8\n\0v\0 \0x\0";
    char text[4096], wide[8192];
    int way;

    for (way = 0; way < 14; way++) {
        size_t used = 0, size, i;
        const char *c;

        if (way == 4)
            used += (size_t)snprintf(text, sizeof text, "\xef\xbb\xbf");
        for (c = cube; *c; c++) {
            const bool number = c[0] == ' ' && c > cube && c[-1] != '#' && c[-1] != 'a';

            if (*c != '\n' && !(number && way >= 7 && way <= 11)) text[used++] = *c;
            else if (*c == '\n') used += (size_t)sprintf(text + used, "%s", way == 1 ? "\r\n" : way == 2 ? "\r" : way == 3 ? " \t\n \t" :
                                                                           way == 12 ? "\n\n# more\n" : way == 13 ? "   # end\n" : "\n");
            else used += (size_t)sprintf(text + used, "%s",
                  way == 7 ? "\t" : way == 8 ? "   " : way == 9 ? " \\\n" : way == 10 ? " \\\r\n " : " \f\v ");
        }
        if (way == 5)
            used--;                         /* no newline at the end */
        size = used;
        if (way == 6 || way == 0) {         /* UTF-16, either byte order */
            for (i = 0; i < used; i++) {
                wide[2 * i + 2] = way ? '\0' : text[i];
                wide[2 * i + 3] = way ? text[i] : '\0';
            }
            wide[0] = (char)(way ? 0xfe : 0xff);
            wide[1] = (char)(way ? 0xff : 0xfe);
            size = 2 * used + 2;
        }
        loader_write_bytes("t.obj", way == 6 || way == 0 ? wide : text, size);
        if (!CHECK(loader_load(loader_path("t.obj")))) {
            rtt_fail("way %d: %s", way, loader.reports);
            continue;
        }
        CHECK(loader.s.geometry.vertex_count == 8 && loader.s.geometry.triangle_count == 12 && loader.s.shapes == 6
              && loader.s.warnings == 0);
        CHECK(loader.s.bytes_read == size);
        for (i = 0; i < 8; i++) {
            const float *v = loader.s.vertices + 3 * i;

            CHECK(v[0] + v[1] * 2 + v[2] * 4 == (float)("01324576"[i] - '0'));
        }
        CHECK(loader.s.indices[0] == 3 && loader.s.indices[1] == 2 && loader.s.indices[2] == 1 && loader.s.indices[5] == 0);
        loader_unload();
    }
    /* Lines are counted over continuations and every kind of end; a lone backslash at the end of the file is no harm. */
    loader_bad("t.obj", "v 0 0 0\r\nv 1 0 \\\r\n 0\rv 0 1 x\n", "t.obj:4: v: 'x' is not a number\n");
    loader_bad("t.obj", "v 0 0 0\n# c \\\nv 1 0 \\\n\\\n y\nv 1\n", "t.obj:3: v: 'y' is not a number\n"
          "t.obj:6: v: 3 numbers expected, not 1\n");
    if (loader_text("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 \\", 3, 1, 0, 1)) loader_unload();
    if (loader_text("t.obj", "", 0, 0, 0, 0)) loader_unload();
    if (loader_text("t.obj", "\n\n \t \n#", 0, 0, 0, 0)) loader_unload();
    loader_write_bytes("t.obj", nul, sizeof nul - 1);           /* a NUL is a blank */
    CHECK(loader_load(loader_path("t.obj")));
    loader_unload();
    loader_write_bytes("t.obj", surrogates, sizeof surrogates); /* a pair, one alone, and an odd end (the string's own NUL) */
    CHECK(!loader_load(loader_path("t.obj")) && strcmp(loader.reports, "t.obj:2: v: 'x' is not a number\n") == 0);
    {                                       /* a line of a megabyte */
        static char line[1 << 20];

        memset(line, ' ', sizeof line);
        memcpy(line, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2", 29);
        memcpy(line + sizeof line - 4, " 3\n", 4);
        if (loader_text("t.obj", line, 3, 1, 0, 1)) loader_unload();
    }
    loader_clear();
}

static double loader_area(size_t triangle)
{
    const float *a = loader.s.vertices + 3 * loader.s.indices[3 * triangle],
          *b = loader.s.vertices + 3 * loader.s.indices[3 * triangle + 1];
    const float *c = loader.s.vertices + 3 * loader.s.indices[3 * triangle + 2];
    double u[3], v[3];
    int k;

    for (k = 0; k < 3; k++) {
        u[k] = (double)b[k] - (double)a[k];
        v[k] = (double)c[k] - (double)a[k];
    }
    return sqrt(pow(u[1] * v[2] - u[2] * v[1], 2) + pow(u[2] * v[0] - u[0] * v[2], 2) + pow(u[0] * v[1] - u[1] * v[0], 2)) / 2;
}

/* A polygon of n corners is n - 2 triangles that cover its area once. */
static void loader_polygon(const char *what, const double (*xy)[2], size_t count, double shift, int axis, bool simple)
{
    char *text = (char *)malloc(count * 100 + 64);
    double area = 0, covered = 0;
    size_t i, used = 0;

    if (!text)
        rtt_die("out of memory");
    for (i = 0; i < count; i++) {
        const double x = xy[i][0] + shift, y = xy[i][1] - shift, *p = xy[i], *q = xy[(i + 1) % count];

        used += (size_t)sprintf(text + used, axis == 0 ? "v 7 %.9g %.9g\n" : axis == 1 ? "v %.9g 7 %.9g\n" : "v %.9g %.9g 7\n", x, y);
        area += (p[0] * q[1] - p[1] * q[0]) / 2;
    }
    used += (size_t)sprintf(text + used, "f");
    for (i = 0; i < count; i++)
        used += (size_t)sprintf(text + used, " %zu", i + 1);
    sprintf(text + used, "\n");
    if (loader_text("t.obj", text, count, count - 2, 0, 1)) {
        for (i = 0; i < count - 2; i++)
            covered += loader_area(i);
        if (simple && !(fabs(covered - fabs(area)) <= 1e-4 * fabs(area)))
            rtt_fail("%s: the polygon has area %g, its triangles %g", what, fabs(area), covered);
        loader_unload();
    }
    free(text);
}

static void rtt_test_obj_polygons(void)
{
    static const double arrow[][2] = { { 0, 0 }, { 2, 1 }, { 0, 2 }, { 0.5, 1 } }, flat_[][2] = { { 0, 0 }, { 1, 0 }, { 2, 0 }, { 3, 0 },
          { 1.5, 0 } };
    static const double comb[][2] = { { 0, 0 }, { 7, 0 }, { 7, 3 }, { 6, 3 }, { 6, 1 }, { 5, 1 }, { 5, 3 }, { 4, 3 }, { 4, 1 }, { 3, 1 },
          { 3, 3 },
                                      { 2, 3 }, { 2, 1 }, { 1, 1 }, { 1, 3 }, { 0, 3 } };
    static const double hole[][2] = { { 0, 0 }, { 4, 0 }, { 4, 4 }, { 0, 4 }, { 0, 0 }, { 1, 1 }, { 1, 3 }, { 3, 3 }, { 3, 1 }, { 1, 1 } };
    static const double bow[][2] = { { 0, 0 }, { 1, 1 }, { 1, 0 }, { 0, 1 } }, point[][2] = { { 1, 1 }, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 1,
          1 } };
    static const double doubled[][2] = { { 0, 0 }, { 0, 0 }, { 2, 0 }, { 2, 0 }, { 2, 2 }, { 1, 0.5 }, { 1, 0.5 }, { 0, 2 } };
    static const double straight[][2] = { { 0, 0 }, { 1, 0 }, { 2, 0 }, { 2, 1 }, { 2, 2 }, { 1, 2 }, { 0, 2 }, { 0, 1 } };
    static const double square[][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };
    static double many[30000][2], backwards[64][2];
    uint64_t state = 7;
    size_t i, n;
    int axis;

    for (axis = 0; axis < 3; axis++) {
        loader_polygon("square", square, RTT_COUNT(square), 0, axis, true);
        loader_polygon("arrow", arrow, RTT_COUNT(arrow), 0, axis, true);
        loader_polygon("arrow far away", arrow, RTT_COUNT(arrow), 10000, axis, true);
        loader_polygon("comb", comb, RTT_COUNT(comb), 0, axis, true);
        loader_polygon("hole", hole, RTT_COUNT(hole), 0, axis, true);
        loader_polygon("straight corners", straight, RTT_COUNT(straight), 0, axis, true);
        loader_polygon("doubled corners", doubled, RTT_COUNT(doubled), 0, axis, true);
        loader_polygon("bow tie", bow, RTT_COUNT(bow), 0, axis, false);
        loader_polygon("no area", flat_, RTT_COUNT(flat_), 0, axis, false);
        loader_polygon("one point", point, RTT_COUNT(point), 0, axis, false);
    }
    for (n = 5; n < 64; n++) {              /* stars without order, seen from either side */
        for (i = 0; i < n; i++) {
            const double angle = 6.283185307179586 * (double)i / (double)n, radius = 0.1 + sn_random(state++);

            many[i][0] = radius * cos(angle);
            many[i][1] = radius * sin(angle);
        }
        for (i = 0; i < n; i++) {
            backwards[i][0] = many[n - 1 - i][0];
            backwards[i][1] = many[n - 1 - i][1];
        }
        loader_polygon("star", (const double (*)[2])many, n, 0, (int)(n % 3), true);
        loader_polygon("star backwards", (const double (*)[2])backwards, n, 0, (int)(n % 3), true);
    }
    for (n = 3; n < 40; n++) {              /* no polygon at all: random corners */
        for (i = 0; i < n; i++) {
            many[i][0] = floor(sn_random(state++) * 5);
            many[i][1] = floor(sn_random(state++) * 5);
        }
        loader_polygon("random corners", (const double (*)[2])many, n, 0, (int)(n % 3), false);
    }
    for (i = 0; i < 2000; i++) {            /* a spiral of some thousand corners is still cut right, and 30000 random ones end soon */
        const double turn = 0.05 * (double)(i < 1000 ? i : 1999 - i), radius = 1 + turn + (i < 1000 ? 0 : 2);

        many[i][0] = radius * cos(turn);
        many[i][1] = radius * sin(turn);
    }
    loader_polygon("spiral", (const double (*)[2])many, 2000, 0, 2, true);
    for (i = 0; i < 30000; i++) {
        many[i][0] = sn_random(state++);
        many[i][1] = sn_random(state++);
    }
    loader_polygon("30000 random corners", (const double (*)[2])many, 30000, 0, 2, false);
    loader_clear();
}

#define LOADER_SQUARE "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

static void rtt_test_obj_corners(void)
{
    static const char *const forms[] = { "f 1 2 3", "f 1/1 2/2 3/3", "f 1//1 2//1 3//2", "f 1/3/1 2/2/1 3/1/2", "f 1/1/ 2/1/ 3/3/",
          "f 1/ 2/ 3/", "f 1// 2// 3//",
                                         "f -4 -3 -2", "f -4/-3 -3/-2 -2/-1", "f -4//-2 -3//-2 -2//-1", "f -4/-3/-2 -3/-2/-2 -2/-1/-1",
                                               "f +1 +2 +3" };
    char text[512];
    size_t i;

    for (i = 0; i < RTT_COUNT(forms); i++) {
        const char *slashes = strstr(forms[i], "//");
        bool smooth = (slashes && sn_is_digit(slashes[2])) || (slashes && slashes[2] == '-') || (i == 3 || i == 10);

        snprintf(text, sizeof text, LOADER_SQUARE "vt 0 0\nvt 1\nvt 0 1 0\nvn 0 0 2\nvn 3 0 4\n%s # tail\n", forms[i]);
        if (!loader_text("t.obj", text, 4, 1, 0, 1))
            continue;
        CHECK(loader.s.indices[0] == 0 && loader.s.indices[1] == 1 && loader.s.indices[2] == 2 && loader.s.warnings == 0);
        CHECK(smooth == (loader.s.normal_indices != NULL));
        if (loader.s.normal_indices) {
            CHECK(loader.s.normal_indices[0] == 0 && loader.s.normal_indices[1] == 0 && loader.s.normal_indices[2] == 1);
            CHECK(loader_vec3(loader.s.normals[0], 0, 0, 1) && loader_vec3(loader.s.normals[1], 0.6f, 0, 0.8f));     /* of unit length */
        }
        loader_unload();
    }
    /* A face without normals among others is flat; so is one with a normal that has no direction, or lacks one. */
    if (loader_text("t.obj", LOADER_SQUARE "vn 0 0 1\nvn 0 0 0\nvn nan 0 0\nf 1 2 3\nf 1//1 2//1 3//1\nf 1 2 4\nf 1//1 2//2 3//1\n"
          "f 1//3 2//1 3//1\n"
                    "f 1//1 2 3//1\nf 1//1 2//1 3//1 4//1\n", 4, 8, 0, 7)) {
        static const bool smooth[] = { false, true, false, false, false, false, true, true };

        for (i = 0; i < 8; i++)
            CHECK((loader.s.normal_indices[3 * i] != RT_NONE) == smooth[i]);
        CHECK(loader.s.warnings == 2);      /* the nan, and the corner without */
        loader_unload();
    }
    /* Points, lines, groups, objects and smoothing draw nothing. */
    if (loader_text("t.obj", "o thing\ng a b\ng\ns 1\ns off\n" LOADER_SQUARE "l 1 2 3\np 1 2\nf 1 2 3\n", 4, 1, 0, 1)) {
        CHECK(loader.s.warnings == 0);
        loader_unload();
    }
    loader_clear();
}

/* Statements in any order: vertices, normals and materials may come after what uses them. */
static void rtt_test_obj_order(void)
{
    loader_write("late.mtl", "newmtl red\nKd 1 0 0\n");
    if (loader_text("t.obj", "usemtl red\nf 1//1 2//1 3//2\nf 1 2 3 4 5\nusemtl other\nf 1/1 2/2 3/3\nvt 0\nvt 0\nvt 0\n"
                    "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.2 1.5 0\nv 0.5 1 0\nf -5 -4 2\nvn 0 0 1\nvn 1 0 0\nmtllib late.mtl\n", 5, 6, 0, 4)) {
        double area = 0;
        size_t i;

        for (i = 1; i < 4; i++)
            area += loader_area(i);
        CHECK(fabs(area - 1.525) < 1e-6);     /* cut up right, though its corners came late */
        CHECK(loader.s.normal_indices[0] == 0 && loader.s.normal_indices[2] == 1 && loader.s.normal_indices[3] == RT_NONE);
        CHECK(loader_vec3(loader_material(0)->diffuse, 1, 0, 0) && loader_vec3(loader_material(3)->diffuse, 1, 0, 0));
        CHECK(loader_vec3(loader_material(4)->diffuse, 0.8f, 0.8f, 0.8f) && loader.s.warnings == 1);
        CHECK(strstr(loader.s.warning, "1 material is not defined, 'other' first") != NULL);
        CHECK(loader.s.indices[15] == 0 && loader.s.indices[16] == 1 && loader.s.indices[17] == 1);
        loader_unload();
    }
    loader_bad("t.obj", "f 1 2 3\nf 1 2 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3//1\nf 1//2 2 3\nf 1/5 2 3\nvn 0 0 1\nvt 0\n",
               "t.obj:2: f: vertex index 9 out of range: the file has 3\nt.obj:7: f: normal index 2 out of range: the file has 1\n"
               "t.obj:8: f: texture index 5 out of range: the file has 1\n");
    loader_warned("t.obj", LOADER_SQUARE "f 1/9/9 2/9/9 3/9/9\nf 1//1 2//2 3//3 4//4\n", 2,
          "t.obj:5: f: texture indices in a file that has none are ignored");
    loader_clear();
}

static void rtt_test_obj_colors(void)
{
    if (loader_text("t.obj", "v 0 0 0\nv 1 0 0 0.25 0.5 1\nv 0 1 0 0.9\nv 0 0 1 0.9 1 0.5 0\nv 1 1 1\nf 1 2 3\nf 3 4 5\n", 5, 2, 0, 2)) {
        CHECK(loader_vec3(loader.s.colors[0], 1, 1, 1) && loader_vec3(loader.s.colors[1], 0.25f, 0.5f, 1)
              && loader_vec3(loader.s.colors[2], 1, 1, 1));
        CHECK(loader_vec3(loader.s.colors[3], 1, 0.5f, 0) && loader_vec3(loader.s.colors[4], 1, 1, 1) && loader.s.warnings == 0);
        loader_unload();
    }
    if (loader_text("t.obj", LOADER_SQUARE "f 1 2 3\n", 4, 1, 0, 1)) {
        CHECK(!loader.s.colors && !loader.s.normals && !loader.s.normal_indices && loader.s.material_count == 1);
        loader_unload();
    }
    if (loader_text("t.obj", "v 0 0 0 1 0 0\nv 1 0 0 nan nan nan\nv 0 1 0 0 inf 0\nv 0 0 1 -nan(ind) 0 1.#IND\nf 1 2 3\n", 4, 1, 0, 1)) {
        CHECK(loader_vec3(loader.s.colors[0], 1, 0, 0) && loader_vec3(loader.s.colors[1], 1, 1, 1) && loader_vec3(loader.s.colors[3], 1,
              1, 1));
        CHECK(loader.s.warnings == 3);
        loader_unload();
    }
    loader_warned("t.obj", "v 0 0 0 1 2\n", 1, "t.obj:1: v: 3, 4, 6 or 7 numbers expected; those behind the position are ignored");
    loader_warned("t.obj", "v 0 0 0 1 2 3 4 5\n", 1, "t.obj:1: v: 3, 4, 6 or 7 numbers expected; those behind the position are ignored");
    loader_bad("t.obj", "v 0 0 0 1 x 3\n", "t.obj:1: v: 'x' is not a number\n");
    loader_clear();
}

static void rtt_test_obj_materials(void)
{
    loader_write("a.mtl", "\xef\xbb\xbf# comment\n\n  newmtl one # not the name\n\tKd 0.1 0.2 0.3 # trailing\n Ks 0.5 \n Ke 1 2 3\n"
          "Ns 20\nKa 9 9 9\nillum 2\nd 1\nd -halo 0.5\n"
                 "Tr 0\nNi 1.5\nmap_Kd a b.png\nmap_Bump -bm 2 x.png\nPr 0.5\nTf 1 1 1\nnorm y.png\nnewmtl two\nKs 1 1 1\nNs 0\n"
                 "newmtl matt\r\nKs 1 1 1\r\nNs 50\r\nillum 1\r\nKd spectral x.rfl\r\nnewmtl \r\nKd 0.5 0.5 0.5");
    loader_write("b c.mtl", "newmtl  with  blanks \nKd 0 1 0\nnewmtl two\nKd 0 0 1\n");
    loader_write("d.mtl", "newmtl windows\nKd 0 1 1\n");
    if (loader_text("t.obj", "mtllib ./a.mtl b\\ c.mtl missing.mtl\nmtllib b c.mtl\nmtllib .\\d.mtl\nmtllib ./a.mtl # again\n" LOADER_SQUARE
                    "f 1 2 3\nusemtl one\nf 1 2 3\nusemtl   with  blanks  \nf 1 2 3\nusemtl two # comment\nf 1 2 3\nusemtl windows\n"
                          "f 1 2 3\n"
                    "usemtl matt\nf 1 2 3\nusemtl\nf 1 2 3\n", 4, 7, 0, 7)) {
        const rt_material *one = loader_material(1);

        CHECK(loader_vec3(loader_material(0)->diffuse, 0.8f, 0.8f, 0.8f));      /* none in force yet */
        CHECK(loader_vec3(one->diffuse, 0.1f, 0.2f, 0.3f) && loader_vec3(one->specular, 0.5f, 0.5f, 0.5f));
        CHECK(loader_vec3(one->emission, 1, 2, 3) && one->shininess == 20);
        CHECK(loader_vec3(loader_material(2)->diffuse, 0, 1, 0));
        CHECK(loader_vec3(loader_material(3)->diffuse, 0.8f, 0.8f, 0.8f) && loader_vec3(loader_material(3)->specular, 0, 0,
              0));    /* Ns 0; the first two */
        CHECK(loader_vec3(loader_material(4)->diffuse, 0, 1, 1));
        CHECK(loader_vec3(loader_material(5)->specular, 0, 0, 0));              /* illum 1 */
        CHECK(loader_vec3(loader_material(6)->diffuse, 0.5f, 0.5f, 0.5f));      /* the name is empty */
        CHECK(loader.s.warnings == 4 && strstr(loader.s.warning, "a.mtl:14: map_Kd: '") && strstr(loader.s.warning, "a b.png' is no .ppm"));
        CHECK(one->texture == NULL && one->bump == NULL && one->bump_height == 2 && loader.s.texture_count == 0 && !loader.s.texcoords);
        CHECK(strcmp(loader.s.material_names[loader.s.material_ids[2]], "with  blanks") == 0);
        loader_unload();
    }
    loader_write("w.mtl", "newmtl two\nillum 2\nKs 0.5\nNs 20\nd 0.2\nNi 1.5\nTf 1 0 0\n"
                 "newmtl three\nKs 0.5 0.25 0\nNs 0\nillum 3\nNi 1.5\n"
                 "newmtl four\nillum 4\nd 0.25\nKd 0.4\nKs 0.1\nNs 9\nNi 1.3\nTf 1 0.5 0\n"
                 "newmtl six\nNi 1.3\nTr 0.75\nillum 6\nKs 0.2\nNs 9\n"
                 "newmtl seven\nillum 7\nNi 1.5\nKd 0.1\nKs 1\nNs 9\n"
                 "newmtl eight\nillum 8\nKs 0.5\n"
                 "newmtl nine\nillum 9\nKs 0.5\nd 0.5\nNi 0\n"
                 "newmtl clamped\nillum 6\nd 1.5\nNi -1\nKs -1 0 -2\n");
    if (loader_text("t.obj", "mtllib w.mtl\n" LOADER_SQUARE "usemtl two\nf 1 2 3\nusemtl three\nf 1 2 3\nusemtl four\nf 1 2 3\n"
                    "usemtl six\nf 1 2 3\nusemtl seven\nf 1 2 3\nusemtl eight\nf 1 2 3\nusemtl nine\nf 1 2 3\nusemtl clamped\nf 1 2 3\n",
                    4, 8, 0, 8)) {
        static const struct { float reflect[3], transmit[3], ior; bool fresnel; } want[] = {
            { { 0, 0, 0 }, { 0, 0, 0 }, 1, false }, { { 0.5f, 0.25f, 0 }, { 0, 0, 0 }, 1, false },
            { { 0.1f, 0.1f, 0.1f }, { 0.75f, 0.375f, 0 }, 1, false }, { { 0.2f, 0.2f, 0.2f }, { 0.75f, 0.75f, 0.75f }, 1.3f, false },
            { { 0, 0, 0 }, { 1, 1, 1 }, 1.5f, true }, { { 0.5f, 0.5f, 0.5f }, { 0, 0, 0 }, 1, false },
            { { 0.5f, 0.5f, 0.5f }, { 0.5f, 0.5f, 0.5f }, 1, false }, { { 0, 0, 0 }, { 0, 0, 0 }, 1, false }
        };

        for (size_t i = 0; i < RTT_COUNT(want); i++) {
            const rt_material *m = loader_material(i);

            if (!loader_vec3(m->reflect, want[i].reflect[0], want[i].reflect[1], want[i].reflect[2]) || m->ior != want[i].ior ||
                !loader_vec3(m->transmit, want[i].transmit[0], want[i].transmit[1], want[i].transmit[2]) || m->fresnel != want[i].fresnel)
                rtt_fail("w.mtl, material %zu: reflect %g transmit %g ior %g", i, (double)m->reflect.x, (double)m->transmit.x,
                         (double)m->ior);
        }
        CHECK(loader_vec3(loader_material(0)->specular, 0.5f, 0.5f, 0.5f) && loader_vec3(loader_material(1)->specular, 0, 0, 0));
        CHECK(loader_vec3(loader_material(2)->diffuse, 0.1f, 0.1f, 0.1f));      /* the rest lets pass */
        CHECK(loader_vec3(loader_material(4)->diffuse, 0.1f, 0.1f, 0.1f) && loader_vec3(loader_material(4)->specular, 1, 1, 1));
        CHECK(loader_vec3(loader.s.shiny_materials[loader.s.material_ids[0]].reflect, 0.5f, 0.5f, 0.5f));       /* as if illum were 6: */
        CHECK(loader_vec3(loader.s.shiny_materials[loader.s.material_ids[0]].transmit, 0.8f, 0, 0));
        CHECK(loader.s.shiny_materials[loader.s.material_ids[0]].ior == 1.5f && loader.s.shiny_materials[loader.s.material_ids[4]].fresnel);
        CHECK(loader.s.warnings == 4 && strstr(loader.s.warning, "w.mtl:43: d: 1.5 is above 1, which is used"));
        loader_unload();
    }
    loader_write("n.mtl", "newmtl a\nTf 1 -1 1\nTr -0.5\n");
    if (loader_text("t.obj", "mtllib n.mtl\n", 0, 0, 0, 0)) {
        CHECK(loader.s.warnings == 2 && strstr(loader.s.warning, "n.mtl:2: Tf: -1 is negative; 0 is used"));
        loader_unload();
    }
    loader_warned("t.obj", "mtllib none.mtl\n", 1, "t.obj:1: mtllib: cannot read 'none.mtl'");
    loader_warned("t.obj", "mtllib\n", 1, "t.obj:1: mtllib without a name");
    loader_warned("t.obj", "mtllib .\n", 1, "t.obj:1: mtllib: cannot read '.'");
    loader_write("e.mtl", "Kd 1 1 1\n");
    loader_warned("t.obj", "mtllib e.mtl\n", 1, "e.mtl:1: 'Kd' before the first newmtl is ignored");
    loader_clear();
}

static void rtt_test_obj_errors(void)
{
    static const struct { const char *text, *reports; } bad[] = {
        { "v 1 2\n", "t.obj:1: v: 3 numbers expected, not 2\n" },
        { "v\n", "t.obj:1: v: 3 numbers expected, not 0\n" },
        { "v 1 2 # 3\n", "t.obj:1: v: 3 numbers expected, not 2\n" },
        { "\nv 1 2 3.1+e2", "t.obj:2: v: '3.1+e2' is not a number\n" },
        { "v 1 2 0x10\n", "t.obj:1: v: '0x10' is not a number\n" },
        { "v 1e 2 3\nv 1 2e+ 3\nv 1 2 .\nv 1 2 -\nv 1,2,3\nv 1 2 3#4\n",
          "t.obj:1: v: '1e' is not a number\nt.obj:2: v: '2e+' is not a number\nt.obj:3: v: '.' is not a number\n"
                "t.obj:4: v: '-' is not a number\n"
          "t.obj:5: v: '1,2,3' is not a number\nt.obj:6: v: '3#4' is not a number\n" },
        { "v nan 0 0\nv 0 -inf 0\nv 0 0 1e39\nv 1.#INF 0 0\nv -1.#QNAN 0 0\nv Infinity 0 0\nv 1e999999999999 0 0\n",
          "t.obj:1: v: 'nan' is not a finite number\nt.obj:2: v: '-inf' is not a finite number\nt.obj:3: v: '1e39' is not a finite number\n"
          "t.obj:4: v: '1.#INF' is not a finite number\nt.obj:5: v: '-1.#QNAN' is not a finite number\n"
                "t.obj:6: v: 'Infinity' is not a finite number\n"
          "t.obj:7: v: '1e999999999999' is not a finite number\n" },
        { "vn 1 2\nvn 1 2 x\nvt\nvt x\nvt 0 0 y\n", "t.obj:1: vn: 3 numbers expected, not 2\nt.obj:2: vn: 'x' is not a number\n"
          "t.obj:3: vt: 1 number expected, not 0\nt.obj:4: vt: 'x' is not a number\nt.obj:5: vt: 'y' is not a number\n" },
        { LOADER_SQUARE "f 1 2\nf 1\nf\n", "t.obj:5: f: a face needs 3 corners, not 2\nt.obj:6: f: a face needs 3 corners, not 1\n"
          "t.obj:7: f: a face needs 3 corners, not 0\n" },
        { LOADER_SQUARE "f 1 2 0\nf 1/0 2 3\nf 1//0 2 3\nf 1 2 -0\n", "t.obj:5: f: vertex index 0; indices count from 1\n"
          "t.obj:6: f: texture index 0; indices count from 1\nt.obj:7: f: normal index 0; indices count from 1\n"
                "t.obj:8: f: vertex index 0; indices count from 1\n" },
        { LOADER_SQUARE "f 1 2 x\nf 1 2 3x\nf 1 2 3/x\nf 1 2 3//x\nf 1 2 3/1/1/1\nf 1 2 3.5\nf 1 2 --3\nf /1 2 3\n",
          "t.obj:5: f: 'x' is not a corner (v, v/t, v//n or v/t/n)\nt.obj:6: f: '3x' is not a corner (v, v/t, v//n or v/t/n)\n"
          "t.obj:7: f: '3/x' is not a corner (v, v/t, v//n or v/t/n)\nt.obj:8: f: '3//x' is not a corner (v, v/t, v//n or v/t/n)\n"
          "t.obj:9: f: '3/1/1/1' is not a corner (v, v/t, v//n or v/t/n)\nt.obj:10: f: '3.5' is not a corner (v, v/t, v//n or v/t/n)\n"
          "t.obj:11: f: '--3' is not a corner (v, v/t, v//n or v/t/n)\nt.obj:12: f: '/1' is not a corner (v, v/t, v//n or v/t/n)\n" },
        { LOADER_SQUARE "f -1 -2 -5\nf 1/-1 2 3\nf 1//-1 2 3\n", "t.obj:5: f: '-5': vertex index out of range: there are 4 so far\n"
          "t.obj:6: f: '1/-1': texture index out of range: there are 0 so far\n"
                "t.obj:7: f: '1//-1': normal index out of range: there are 0 so far\n" },
        { LOADER_SQUARE "f 1 2 5\nf 1 2 4294967296\nf 1 2 99999999999999999999999\n",
              "t.obj:5: f: vertex index 5 out of range: the file has 4\n"
          "t.obj:6: f: vertex index 4294967296 out of range: the file has 4\n"
                "t.obj:7: f: vertex index 999999999999999999 out of range: the file has 4\n" },
        { "v 0 0 x\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "t.obj:1: v: 'x' is not a number\n" },     /* and no more: vertex 3 is there */
        { "12 34\n\x01\x02\n@home\nwell...\n", "t.obj:1: '12' is not a statement\nt.obj:3: '@home' is not a statement\n"
              "t.obj:4: 'well...' is not a statement\n" },
        { "\x7f" "ELF\xff\n", "t.obj:1: '?ELF?' is not a statement\n" },
        { "v aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\n",
              "t.obj:1: v: 'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa...' is not a number\n" }
    };
    static const struct { const char *mtl, *reports; } bad_mtl[] = {
        { "newmtl a\nKd 1 2\nKs\nKe x\nNs\nNs y\nd z\nTr nan\nillum two\nNi 1e99\n",
          "m.mtl:2: Kd: 3 numbers expected, not 2\nm.mtl:3: Ks: 1 number expected, not 0\nm.mtl:4: Ke: 'x' is not a number\n"
                "m.mtl:5: Ns: 1 number expected, not 0\n"
          "m.mtl:6: Ns: 'y' is not a number\nm.mtl:7: d: 'z' is not a number\nm.mtl:8: Tr: 'nan' is not a finite number\n"
                "m.mtl:9: illum: 'two' is not a number\n"
          "m.mtl:10: Ni: '1e99' is not a finite number\nt.obj:2: v: 'q' is not a number\n" },
        { "newmtl a\nTf 1 1\nTf red\nNi\nd 1.0.0\n", "m.mtl:2: Tf: 3 numbers expected, not 2\nm.mtl:3: Tf: 'red' is not a number\n"
          "m.mtl:4: Ni: 1 number expected, not 0\nm.mtl:5: d: '1.0.0' is not a number\nt.obj:2: v: 'q' is not a number\n" },
        { "newmtl a\nKa 1 1\n", "m.mtl:2: Ka: 3 numbers expected, not 2\nt.obj:2: v: 'q' is not a number\n" }
    };
    size_t i;

    for (i = 0; i < RTT_COUNT(bad); i++)
        loader_bad("t.obj", bad[i].text, bad[i].reports);
    for (i = 0; i < RTT_COUNT(bad_mtl); i++) {
        loader_write("m.mtl", bad_mtl[i].mtl);
        loader_bad("t.obj", "mtllib m.mtl\nv q\n", bad_mtl[i].reports);
    }
    /* What cannot be read at all. */
    CHECK(!loader_load(loader_path("none.obj")) && strcmp(loader.reports, "none.obj: cannot read it: No such file or directory\n") == 0);
    CHECK(!loader_load("/.obj") && loader.error.errors == 1);
    snprintf(loader.path, sizeof loader.path, "%s/folder.obj", loader.folder);
    CHECK(mkdir(loader.path, 0700) == 0 && !loader_load(loader.path) && strcmp(loader.reports,
          "folder.obj: cannot read it: not a file\n") == 0);
    CHECK(rmdir(loader.path) == 0);
    CHECK(!scene_load(&loader.s, loader_path("none.obj"), NULL, NULL, NULL));       /* nobody listens */
    loader_clear();
}

static void rtt_test_obj_warnings(void)
{
    static const char *const statements[] = { "vp 0 0", "cstype bspline", "deg 3", "curv 0 1 1 2", "surf 0 1 0 1 1", "parm u 0 1",
          "trim 0 1 1", "end", "bevel on",
                                              "c_interp on", "lod 1", "maplib x", "usemap y", "shadow_obj z", "trace_obj z", "mg 1 2",
                                                    "call a.obj", "csh ls",
                                              "vw 0 0 1", "t crease 2/1/0", "fo 1 2 3", "some words that no loader knows" };
    char text[256], first[256];
    size_t i;

    for (i = 0; i < RTT_COUNT(statements); i++) {
        snprintf(text, sizeof text, "%s\n%s\n", statements[i], statements[i]);
        snprintf(first, sizeof first, "t.obj:1: '%.*s' statements are not supported", (int)strcspn(statements[i], " "), statements[i]);
        loader_warned("t.obj", text, 2, first);
    }
    loader_clear();
}

static void rtt_test_nff_statements(void)
{
    static const char view[] = "v\nfrom 1 2 3\nat 0 0 0\nup 0 0 1\nangle 45\nhither 1\nresolution 512 512\n";
    char text[1024];
    size_t i;

    snprintf(text, sizeof text, "# comment\nb 0.1 0.2 0.3\n%sl 1 2 3\nl 4 5 6 0.5 0.25 0\nf 1 0.5 0 0.5 0.25 20 0 1\np 4\n0 0 0\n1 0 0\n"
          "1 1 0 # corner\n0 1 0\n"
             "s 1 2 3 4\ns 0 0 0 -2\npp 3\n0 0 0 0 0 1\n1 0 0 0 0 2\n0 1 0 1 0 0\nf 1 1 1\nc 0 0 0 1\n0 0 2 1\nc 0 0 0 1 0 0 1 0", view);
    if (loader_text("t.nff", text, 7 + 4 * SCENE_CONE_SEGMENTS, 3 + 3 * SCENE_CONE_SEGMENTS, 2, 6)) {
        const scene *s = &loader.s;

        CHECK(s->warnings == 0 && s->has_background && loader_vec3(s->background, 0.1f, 0.2f, 0.3f) && s->has_camera && s->has_lights);
        CHECK(loader_vec3(s->camera.eye, 1, 2, 3) && loader_vec3(s->camera.look, 0, 0, 0) && loader_vec3(s->camera.up, 0, 0, 1)
              && s->camera.fov == 45);
        CHECK(s->light_count == 2 && loader_vec3(s->lights[0].position, 1, 2, 3) && loader_vec3(s->lights[1].color, 0.5f, 0.25f, 0));
        CHECK(s->lights[0].color.x > 0 && s->lights[0].color.x == s->lights[0].color.z);
        CHECK(loader_vec3(loader_material(0)->diffuse, 0.5f, 0.25f, 0) && loader_vec3(loader_material(0)->specular, 0.25f, 0.25f, 0.25f));
        CHECK(loader_material(0)->shininess == 20 && loader_material(0)->ior == 1);
        CHECK(loader_vec3(loader_material(0)->reflect, 0.25f, 0.25f, 0.25f) && loader_vec3(loader_material(0)->transmit, 0, 0, 0));
        CHECK(loader_vec3(loader_material(s->geometry.triangle_count - 1)->diffuse, 1, 1, 1));
        CHECK(loader_vec3(loader_material(s->geometry.triangle_count)->diffuse, 0.5f, 0.25f, 0));       /* spheres behind the triangles */
        CHECK(s->spheres[0].radius == 4 && loader_vec3(s->spheres[0].center, 1, 2, 3) && s->spheres[1].radius == 2);
        CHECK(s->normal_indices[0] == RT_NONE && s->normal_indices[6] != RT_NONE && loader_vec3(s->normals[s->normal_indices[7]], 0, 0, 1));
        for (i = 0; i < 2 * SCENE_CONE_SEGMENTS; i++) {         /* the cylinder: on its surface, normals across its axis */
            const float *v = s->vertices + 3 * (7 + i);
            const rt_vec3 n = s->normals[3 + i / 2];

            CHECK(fabsf(v[0] * v[0] + v[1] * v[1] - 1) < 1e-5f && v[2] == (i % 2 ? 2 : 0) && loader_vec3(n, v[0], v[1], 0));
        }
        for (i = 0; i < SCENE_CONE_SEGMENTS; i++)               /* the cone: 45 degrees */
            CHECK(fabsf(s->normals[3 + SCENE_CONE_SEGMENTS + i].z - 0.70710678f) < 1e-5f);
        loader_unload();
    }
    if (loader_text("t.nff", "f 0 0 0 0 0.3 0 0.7 1.5\ns 0 0 0 1\nf 0 0 0 0 0 0 1 0\ns 0 0 0 1\n", 0, 0, 2, 2)) {
        CHECK(loader_vec3(loader_material(0)->reflect, 0.3f, 0.3f, 0.3f) && loader_vec3(loader_material(0)->specular, 0, 0, 0));
        CHECK(loader_vec3(loader_material(0)->transmit, 0.7f, 0.7f, 0.7f) && loader_material(0)->ior == 1.5f);
        CHECK(!loader_material(0)->fresnel && loader_material(1)->ior == 1);    /* 0 is written where none is meant */
        loader_unload();
    }
    /* The parts of v in another order, on one line; names in capitals; no camera, no lights. */
    if (loader_text("T.NFF", "v up 0 1 0 angle 30 at 1 1 1 from 0 0 9\ns 0 0 0 1\n", 0, 0, 1, 1)) {
        CHECK(loader_vec3(loader.s.camera.eye, 0, 0, 9) && loader.s.camera.fov == 30 && !loader.s.has_lights && loader.s.light_count == 2);
        loader_unload();
    }
    if (loader_text("t.nff", "s 0 0 0 1", 0, 0, 1, 1)) {
        CHECK(!loader.s.has_camera && !loader.s.has_background && loader_vec3(loader.s.camera.look, 0, 0, 0));
        loader_unload();
    }
    /* A concave polygon, and the order of corners in several lines. */
    if (loader_text("t.nff", "p\n4 0 0 0 2 1 0 0 2 0\n0.5 1\n0", 4, 2, 0, 1)) {
        CHECK(fabs(loader_area(0) + loader_area(1) - 1.5) < 1e-6);
        loader_unload();
    }
    loader_warned("t.nff", "tess 4\ns 0 0 0 1 2 2\nf 1 0 0 0.5 0.5 45 0 1 wood.png\nhex 0 0 0 5 10 20\n", 4,
          "t.nff:1: 'tess' statements are not supported");
    loader_warned("t.nff", "tpp 3\n0 0 0 0 0 1\n1 0 0\n-1 0 0\n.5 .5 .5\ns 0 0 0 1\n", 1, "t.nff:1: 'tpp' statements are not supported");
    loader_warned("t.nff", "f 1 0 0 1 0 2 0 1 a b\n", 1, "t.nff:1: f: 'a' is ignored");
    loader_clear();
}

static void rtt_test_nff_errors(void)
{
    static const struct { const char *text, *reports; } bad[] = {
        { "s 1 2 3\ns 0 0 0 1\n", "t.nff:1: s: 4 numbers expected, not 3\n" },
        { "s 1 2", "t.nff:1: s: 4 numbers expected, not 2\n" },
        { "s 1 2 x 4\ns 1 nan 3 4\ns 1 2 3 1e40\n", "t.nff:1: s: 'x' is not a number\nt.nff:2: s: 'nan' is not a finite number\n"
              "t.nff:3: s: '1e40' is not a finite number\n" },
        { "p 2\n0 0 0\n1 1 1\ns 0 0\n", "t.nff:1: p: '2' is not a number of corners, 3 or more\nt.nff:4: s: 4 numbers expected, not 2\n" },
        { "p\n", "t.nff:1: p: the number of corners is missing\n" },
        { "p x\np -3\np 3.5\n", "t.nff:1: p: 'x' is not a number of corners, 3 or more\n"
              "t.nff:2: p: '-3' is not a number of corners, 3 or more\n"
          "t.nff:3: p: '3.5' is not a number of corners, 3 or more\n" },
        { "p 3\n0 0 0\n1 0 0\ns 0 0 0 1\np 4294967295\n1 2 3\n", "t.nff:1: p: 3 numbers expected, not 0\n"
              "t.nff:5: p: 3 numbers expected, not 0\n" },
        { "pp 3\n0 0 0 0 0 1\n1 0 0 0 y 1\n0 1 0 0 0 1\nb 1\n", "t.nff:3: pp: 'y' is not a number\n"
              "t.nff:5: b: 3 numbers expected, not 1\n" },
        { "c 0 0 0 0 0 0 1 0\n", "t.nff:1: c: radii 0 and 0 make no cone\n" },
        { "c 0 0 0 1 0 0 0 1\n", "t.nff:1: c: the ends are the same point\n" },
        { "c 0 0 0 1 0 0 1 -1\n", "t.nff:1: c: radii 1 and -1 make no cone\n" },
        { "c 0 0 0 1\n0 0\n", "t.nff:1: c: 8 numbers expected, not 6\n" },
        { "l 1 2\nl 1 2 3 4\nl 1 2 3 4 5\n", "t.nff:1: l: 3 numbers expected, not 2\nt.nff:2: l: 3 or 6 numbers expected, not 4\n"
              "t.nff:3: l: 3 or 6 numbers expected, not 5\n" },
        { "f 1 0\nb 1 2\n", "t.nff:1: f: 3 numbers expected, not 2\nt.nff:2: b: 3 numbers expected, not 2\n" },
        { "f 1 1 -1\nf 1 1 1 1 1.5\nf 1 1 1 1 0 0 2\nf 1 1 1 1 0 0 0 -1\n", "t.nff:1: f: b is -1; it must not be negative\n"
          "t.nff:2: f: Ks is 1.5; it must lie between 0 and 1\nt.nff:3: f: T is 2; it must lie between 0 and 1\n"
          "t.nff:4: f: the index of refraction is -1; it must not be negative\n" },
        { "v\nfrom 0 0 1\nat 0 0 0\nangle 45\n", "t.nff:1: v: no 'up'\n" },
        { "\nv\nfrom 0 0\nat 0 0 0\n", "t.nff:3: from: 3 numbers expected, not 2\n" },
        { "v\nfrom 0 0 0\nat 0 0 0\nup 0 1 0\nangle 45\n",
              "t.nff:1: v: 'at' must differ from 'from', and 'up' not point along the view\n" },
        { "v\nfrom 0 0 5\nat 0 0 0\nup 0 0 1\nangle 45\n",
              "t.nff:1: v: 'at' must differ from 'from', and 'up' not point along the view\n" },
        { "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 180\n", "t.nff:1: v: an angle between 0 and 180 degrees expected\n" },
        { "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 0\nhither 1\nresolution 5\n", "t.nff:7: resolution: 2 numbers expected, not 1\n" },
        { "1 2 3\n*\n", "t.nff:1: '1' is not a statement\nt.nff:2: '*' is not a statement\n" }
    };
    size_t i;

    for (i = 0; i < RTT_COUNT(bad); i++)
        loader_bad("t.nff", bad[i].text, bad[i].reports);
    loader_clear();
}

#define NO_SUCH_SCENE "neither an .obj or .nff file nor one of cornell, balls:N, rings:N, tetra:N, cloud:N, terrain:N, sphere:N, " \
                      "mirrors:N, glass:N, hall:N, textures\n"

static void rtt_test_procedural(void)
{
    static const struct { const char *name; size_t triangles, spheres, shapes; } published[] = {
        { "cornell", 32, 0, 16 },
        { "balls:1", 2, 10, 11 }, { "balls:2", 2, 91, 92 }, { "balls:3", 2, 820, 821 }, { "balls", 2, 820, 821 }, { "balls:4", 2, 7381,
              7382 },
        { "balls:5", 2, 66430, 66431 },
        { "rings:1", 2 + 30 * 2 * SCENE_CONE_SEGMENTS, 30, 61 }, { "rings:2", 2 + 150 * 2 * SCENE_CONE_SEGMENTS, 150, 301 },
        { "rings:3", 2 + 420 * 2 * SCENE_CONE_SEGMENTS, 420, 841 }, { "rings:5", 2 + 1650 * 2 * SCENE_CONE_SEGMENTS, 1650, 3301 },
        { "tetra:1", 4, 0, 4 }, { "tetra:4", 256, 0, 256 }, { "tetra:6", 4096, 0, 4096 },
        { "cloud:1", 1, 0, 1 }, { "cloud:1000", 1000, 0, 1000 }, { "terrain:2", 2, 0, 2 }, { "terrain:20000", 20000, 0, 20000 },
        { "sphere:8", 8, 0, 8 }, { "sphere:1000", 960, 0, 960 }, { "sphere:100000", 100488, 0, 100488 },
        { "mirrors:1", 116, 3, 61 }, { "mirrors:4", 440, 12, 232 }, { "glass:1", 140, 2, 72 }, { "glass:3", 300, 10, 160 },
        { "hall:5000", 5280, 0, 1433 }, { "hall", 250796, 0, 1433 }, { "textures", 4, 3, 5 }
    };
    static const struct { const char *name, *report; } bad[] = {
        { "balls:0", "balls:0: balls:N needs a whole N from 1 to 8\n" }, { "balls:9", "balls:9: balls:N needs a whole N from 1 to 8\n" },
        { "rings:-1", "rings:-1: rings:N needs a whole N from 1 to 40\n" }, { "tetra:x",
              "tetra:x: tetra:N needs a whole N from 1 to 13\n" },
        { "cloud:", "cloud:: cloud:N needs a whole N from 1 to 100000000\n" }, { "terrain:1.5",
              "terrain:1.5: terrain:N needs a whole N from 2 to 100000000\n" },
        { "sphere:99999999999999999999", "sphere:99999999999999999999: sphere:N needs a whole N from 8 to 100000000\n" },
        { "cornell:1", "cornell:1: cornell takes no number\n" },
        { "teapot", "teapot: " NO_SUCH_SCENE },
        { "a.ply", "a.ply: " NO_SUCH_SCENE },
        { "", ": " NO_SUCH_SCENE },
        { "ball:3", "ball:3: " NO_SUCH_SCENE }
    };
    size_t i, k;

    for (i = 0; i < RTT_COUNT(published); i++) {
        const rt_geometry *g = &loader.s.geometry;

        if (!CHECK(loader_load(published[i].name)))
            continue;
        loader_check_whole(published[i].name);
        if (g->triangle_count != published[i].triangles || g->sphere_count != published[i].spheres
              || loader.s.shapes != published[i].shapes)
            rtt_fail("%s: %zu triangles, %zu spheres, %zu shapes", published[i].name, g->triangle_count, g->sphere_count, loader.s.shapes);
        CHECK(strcmp(loader.s.name, published[i].name) == 0 && loader.s.warnings == 0 && loader.s.bytes_read == 0);
        for (k = 0; k < g->triangle_count && strncmp(published[i].name, "cloud", 5) != 0; k++)
            CHECK(loader_area(k) > 0);
        for (k = 0; k < 3 * g->vertex_count && strncmp(published[i].name, "cloud", 5) == 0; k++)
            CHECK(loader.s.vertices[k] >= 0 && loader.s.vertices[k] <= 1);
        loader_unload();
    }
    for (i = 0; i < RTT_COUNT(bad); i++) {
        CHECK(!loader_load(bad[i].name));
        if (strcmp(loader.reports, bad[i].report) != 0)
            rtt_fail("%s: %s", bad[i].name, loader.reports);
    }
    for (i = 0; i < RTT_COUNT(sn_procedurals); i++)             /* --help names them all */
        CHECK(strstr(scene_procedural_list(), sn_procedurals[i].name) != NULL);
}

/* The sphere is closed: every edge lies between two triangles that run along it in opposite directions. */
static void rtt_test_procedural_sphere(void)
{
    size_t i, k, sum = 0, product = 0;

    if (!CHECK(loader_load("sphere:5000")))
        return;
    CHECK(loader.s.geometry.vertex_count == loader.s.geometry.triangle_count / 2 + 2);          /* Euler: V - 3T/2 + T = 2 */
    for (i = 0; i < loader.s.geometry.triangle_count; i++)
        for (k = 0; k < 3; k++) {
            uint64_t a = loader.s.indices[3 * i + k], b = loader.s.indices[3 * i + (k + 1) % 3];

            CHECK(a != b);
            sum += (size_t)(sn_mix(a << 32 | b) - sn_mix(b << 32 | a));                          /* each edge cancels its opposite */
            product += (size_t)(sn_mix(a * 3 + 1) * sn_mix(b * 5 + 2) - sn_mix(b * 3 + 1) * sn_mix(a * 5 + 2));
        }
    CHECK(sum == 0 && product == 0);
    loader_unload();
}

static void rtt_test_scene_camera(void)
{
    rt_light lights[2];

    if (loader_text("t.obj", "v -0.5 -0.5 -0.5\nv 0.5 0.5 0.5\nv 0.5 0 0\nv 9 9 9\nf 1 2 3\n", 4, 1, 0, 1)) {
        const rt_camera *c = &loader.s.camera;

        CHECK(!loader.s.has_camera && c->fov == 40 && loader_vec3(c->up, 0, 1, 0) && loader_vec3(c->look, 0, 0, 0));
        CHECK(fabsf(c->eye.x - 1.26673f) < 1e-5f && fabsf(c->eye.y - 0.921262f) < 1e-5f && fabsf(c->eye.z - 2.07284f) < 1e-5f);
        CHECK(loader.s.light_count == 2 && !loader.s.has_lights);
        scene_default_lights(c, lights);
        CHECK(memcmp(lights, loader.s.lights, sizeof lights) == 0);
        loader_unload();
    }
    if (loader_text("t.obj", "", 0, 0, 0, 0)) {
        CHECK(loader.s.camera.eye.z > 0.5f && loader_vec3(loader.s.camera.look, 0, 0, 0) && !loader.s.geometry.vertices);
        loader_unload();
    }
    if (loader_text("t.obj", "v 1e7 1e7 1e7\nf 1 1 1\n", 1, 1, 0, 1)) {    /* a point far away: the eye is another point all the same */
        CHECK(loader.s.camera.eye.x > 1e7f && loader.s.camera.eye.y > 1e7f && loader.s.camera.eye.z > 1e7f);
        loader_unload();
    }
    if (loader_text("t.nff", "s 1 2 3 4\n", 0, 0, 1, 1)) {
        CHECK(loader_vec3(loader.s.camera.look, 1, 2, 3) && loader.s.camera.eye.z > 7);
        loader_unload();
    }
    loader_clear();
}

/* The view holds what the scene holds, and a picture of each procedural scene shows something: neither black nor burnt out. */
static void rtt_test_scene_view(void)
{
    static const char *const names[] = { "cornell", "balls:2", "rings:1", "tetra:3", "cloud:300", "terrain:2000", "sphere:200", "hall:5000" };
    size_t i;
    int k;

    for (i = 0; i < RTT_COUNT(names); i++) {
        rt_render_options options;
        rt_accel *accel;
        rt_scene view;
        rt_vec3 pixels[32 * 32];
        int dark = 0, bright = 0;

        if (!CHECK(loader_load(names[i])))
            continue;
        if (CHECK_STATUS(rt_build(&accel, &loader.s.geometry, NULL), RT_OK)) {
            memset(&options, 0, sizeof options);
            options.width = options.height = 32;
            view = scene_view(&loader.s, accel);
            CHECK(view.accel == accel && view.geometry == &loader.s.geometry && view.materials == loader.s.materials
                  && view.lights == loader.s.lights);
            CHECK_STATUS(rt_render_tile(&view, &options, 0, 0, 32, 32, pixels, NULL), RT_OK);
            for (k = 0; k < 32 * 32; k++) {
                dark += pixels[k].x + pixels[k].y + pixels[k].z < 0.05f;
                bright += pixels[k].x >= 1 && pixels[k].y >= 1 && pixels[k].z >= 1;
            }
            if (dark > 512 || bright > 512)
                rtt_fail("%s: %d black and %d white of 1024 pixels", names[i], dark, bright);
            rt_free(accel);
        }
        loader_unload();
    }
}

static void rtt_test_scene_ppm(void)
{
    rt_vec3 picture[6] = { { 0, 0.5f, 1 }, { -1, 2, 1e30f }, { 0.001f, 0.0031308f, 0.01f }, { 0.2f, 0.4f, 0.6f }, { 0.9f, 0.99f, 0.999f },
          { 0, 0, 0 } };
    static const unsigned char bytes[12] = { 0, 188, 255, 0, 255, 255, 3, 10, 25, 124, 170, 203 };
    static const char *const bad[] = { "", "P6", "P5\n1 1\n255\nx", "P6\n0 1\n255\n", "P6\n1 1\n65535\n12345", "P6\n1 1\n65536\n123456",
          "P6\n2 2\n255\n12345", "P6\n1 1\n64\nABA", "P6\n1 1\n256\nABABAB", "P3\n1 1\n9\n1 2", "P3\n1 1\n9\n1 2 10", "P3\n1 1\n9\n1 x 3",
          "P3\n2 1\n9\n1 2 3 4 -5 6", "P3\n1 1\n9\n1 2 3x",
          "P6\n1 x\n255\n123",
                                       "P6\n99999 99999\n255\n123", "P6\n1 1\n255", "P6 -1 1 255 123", "P6\n999999999999 1\n255\n" };
    rt_vec3 *back;
    char message[256];
    unsigned char file[64];
    FILE *in;
    size_t i;
    int width, height;

    picture[5].y = nanf("");
    loader_write("p.ppm", "what is there is replaced");
    CHECK(scene_write_ppm(loader_path("p.ppm"), picture, 3, 2, message, sizeof message));
    in = fopen(loader_path("p.ppm"), "rb");
    CHECK(in && fread(file, 1, sizeof file, in) == 11 + 18 && memcmp(file, "P6\n3 2\n255\n", 11) == 0 && memcmp(file + 11, bytes,
          sizeof bytes) == 0);
    if (in)
        fclose(in);
    CHECK(file[11 + 15] == 0 && file[11 + 16] == 0 && file[11 + 17] == 0);                      /* NaN is black */
    if (CHECK(scene_read_ppm(loader_path("p.ppm"), &back, &width, &height, message, sizeof message))) {
        CHECK(width == 3 && height == 2 && fabsf(back[0].y - 0.5f) < 0.005f && back[1].x == 0 && back[1].y == 1
              && fabsf(back[3].z - 0.6f) < 0.005f);
        CHECK(scene_write_ppm(loader_path("q.ppm"), back, 3, 2, message, sizeof message));      /* and back: the same bytes */
        loader_free(back);
        in = fopen(loader_path("q.ppm"), "rb");
        CHECK(in && fread(file, 1, sizeof file, in) == 11 + 18 && memcmp(file + 11, bytes, sizeof bytes) == 0);
        if (in)
            fclose(in);
    }
    loader_write("p.ppm", "P6 # comment\n#another\n 1\t1 # x\n255\nABC");
    if (CHECK(scene_read_ppm(loader_path("p.ppm"), &back, &width, &height, message, sizeof message)))
        loader_free(back);
    for (i = 0; i < 3; i++) {               /* as text; in 16 bits; of another greatest number */
        static const char *const pictures[3] = { "P3 1 2 255 0 188 # comment\n255\n255 0 124", "P6 1 2 65535\n\0\0\274\274\377\377\377\377\0\0||",
                                                 "P3\n1\n2\n510\n0 376 510 510 0 248\n" };
        static const size_t sizes[3] = { 40, 25, 31 };

        loader_write_bytes("p.ppm", pictures[i], sizes[i]);
        if (!CHECK(scene_read_ppm(loader_path("p.ppm"), &back, &width, &height, message, sizeof message))) {
            rtt_fail("%s", message);
            continue;
        }
        CHECK(width == 1 && height == 2 && back[0].x == 0 && fabsf(back[0].y - 0.5029f) < 1e-4f && back[0].z == 1 && back[1].x == 1
              && back[1].y == 0 && fabsf(back[1].z - 0.2016f) < 1e-4f);
        loader_free(back);
    }
    for (i = 0; i < RTT_COUNT(bad); i++) {
        loader_write("p.ppm", bad[i]);
        message[0] = '\0';
        CHECK(!scene_read_ppm(loader_path("p.ppm"), &back, &width, &height, message, sizeof message) && !back && message[0]);
    }
    CHECK(!scene_read_ppm(loader_path("none.ppm"), &back, &width, &height, message, sizeof message) && strstr(message, "No such file"));
    CHECK(loader_clear() == 2);             /* p and q: no temporary files */
    loader_path("x");
    CHECK(!scene_write_ppm(loader_path("no/where.ppm"), picture, 3, 2, message, sizeof message) && strstr(message, "No such file"));
    CHECK(!scene_write_ppm(loader_path("p.ppm"), picture, 0, 2, message, sizeof message));
    snprintf(loader.path, sizeof loader.path, "%s/dir", loader.folder);
    CHECK(mkdir(loader.path, 0700) == 0);
    CHECK(!scene_write_ppm(loader.path, picture, 3, 2, message, sizeof message));                /* cannot be renamed to a folder */
    CHECK(rmdir(loader.path) == 0 && loader_clear() == 0);                                      /* and leaves nothing behind */
}

/* Whichever request for memory fails, the load fails with that message and gives everything back. */
static void rtt_test_scene_oom(void)
{
    static const char wide[] = "\xff\xfev\0 \0" "1\0 \0" "2\0 \0" "3\0\n\0";
    static const char *const names[] = { "t.obj", "t.nff", "u.obj", "cornell", "rings:1", "balls:1", "tetra:2", "cloud:9", "terrain:8",
          "sphere:8", "textures" };
    size_t i;

    loader_path("t.obj");
    for (i = 0; i < RTT_COUNT(names); i++) {
        bool loaded = false;
        long n;

        loader_write("m.mtl", "newmtl a\nKd 1 0 0\nmap_Kd t.ppm\nnewmtl b\nbump -bm 2 t.ppm\n");
        loader_write("t.ppm", "P3 2 1 1 0 0 1 1 1 1");
        loader_write("t.obj", "mtllib none.mtl m.mtl\n" LOADER_SQUARE "v 3 3 3 1 0 0\nvt 1 1\nvn 0 0 1\nf 1 2 3\nusemtl a\nf 1/1/1 2/1/1 3/1/1\n"
              "usemtl c # d\nf 1 2 3 4 5\nf 6 7 8 9\n" LOADER_SQUARE);
        loader_write("t.nff", "l 1 1 1\nf 1 0 0\ns 0 0 0 1\nc 0 0 0 1 0 0 1 1\np 4\n0 0 0 2 1 0 0 2 0 0.5 1 0\npp 3\n"
              "0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n");
        loader_write_bytes("u.obj", wide, sizeof wide - 1);
        for (n = 1; !loaded && n < 10000; n++) {
            loader_requests = 0;
            loader_fail_at = n;
            loaded = loader_load(i < 3 ? loader_path(names[i]) : names[i]);
            loader_fail_at = 0;
            if (!loaded && !strstr(loader.reports, "out of memory"))
                rtt_fail("%s, request %ld: %s", names[i], n, loader.reports);
        }
        CHECK(loaded && n > 3);
        loader_unload();
    }
    loader_clear();
}

/* Every file of the scenes folder loads, with the counts that its SCENES.md gives, or is one of those that do not deserve to. */
static size_t loader_count_in(const char *row, const char *word)
{
    const char *at = strstr(row, word);
    size_t number = 0, unit = 1;

    while (at && at > row && (sn_is_digit(at[-1]) || at[-1] == ',')) {
        at--;
        if (*at == ',')
            continue;
        number += unit * (size_t)(*at - '0');
        unit *= 10;
    }
    return number;
}

static void rtt_test_scene_files(void)
{
    static const struct { const char *file, *report; } deserving[] = {
        { "nasty/assimp/invalid_malformed.obj", "vertex index 0" }, { "nasty/assimp/number_formats.obj", "'3.1+e2' is not a number" },
        { "nasty/tinyobjloader/invalid-relative-texture-index.obj", "texture index out of range" },
        { "nasty/tinyobjloader/invalid-relative-vertex-index.obj", "vertex index out of range" },
        { "nasty/tinyobjloader/issue-140-zero-face-idx.obj", "vertex index 0" }, { "nasty/tinyobjloader/test-nan.obj",
              "'nan' is not a finite number" }
    };
    static const struct { const char *file, *same; } twins[] = {
        { "spd/balls_s1.nff", "balls:1" }, { "spd/balls_s2.nff", "balls:2" }, { "spd/balls_s3.nff", "balls:3" }, { "spd/balls_s4.nff",
              "balls:4" },
        { "spd/balls_s5.nff", "balls:5" }, { "spd/rings_s1.nff", "rings:1" }, { "spd/rings_s2.nff", "rings:2" }, { "spd/rings_s3.nff",
              "rings:3" },
        { "spd/rings_s5.nff", "rings:5" }, { "spd/rings_s7.nff", "rings:7" }, { "spd/tetra_s4.nff", "tetra:4" }, { "spd/tetra_s6.nff",
              "tetra:6" }
    };
    const char *given = getenv("RT_SCENES"), *base = given && given[0] ? given : "../shared/scenes";
    char path[1024], row[4096];
    FILE *list;
    size_t i, k, rows = 0, failed = 0;

    snprintf(path, sizeof path, "%s/SCENES.md", base);
    list = fopen(path, "r");
    if (!list) {                            /* no scenes here: rtt_test_procedural holds the published counts */
        CHECK(!given || !given[0]);
        return;
    }
    while (fgets(row, sizeof row, list)) {
        const char *end = strchr(row + 2, '|'), *extension;
        size_t length;
        bool obj, nff;

        if (strncmp(row, "| ", 2) != 0 || !end)
            continue;
        length = (size_t)(end - row - 3);
        snprintf(path, sizeof path, "%s/%.*s", base, (int)length, row + 2);
        extension = path + strlen(path) - 4;
        obj = strcmp(extension, ".obj") == 0;
        nff = strcmp(extension, ".nff") == 0;
        if ((!obj && !nff) || (!strstr(end, " triangles (") && !strstr(end, " primitives:")))
            continue;
        rows++;
        for (i = 0; i < RTT_COUNT(deserving) && strncmp(row + 2, deserving[i].file, length) != 0; i++) { }
        if (loader_load(path)) {
            loader_check_whole(path);
            if (i < RTT_COUNT(deserving))
                rtt_fail("%s loads", path);
            if (obj && loader.s.geometry.triangle_count != loader_count_in(end, " triangles ("))
                rtt_fail("%s: %zu triangles", path, loader.s.geometry.triangle_count);
            if (obj && (loader.s.shapes != loader_count_in(end, " faces)") || loader.s.geometry.vertex_count != loader_count_in(end,
                  " vertices, ")))
                rtt_fail("%s: %zu faces, %zu vertices", path, loader.s.shapes, loader.s.geometry.vertex_count);
            if (nff && (loader.s.shapes != loader_count_in(end, " primitives:")
                  || loader.s.geometry.sphere_count != loader_count_in(strstr(end, " primitives:"), " spheres")))
                rtt_fail("%s: %zu shapes, %zu spheres", path, loader.s.shapes, loader.s.geometry.sphere_count);
            CHECK(strncmp(row + 2, "spd/", 4) != 0 || !nff || (loader.s.has_camera && loader.s.has_background && loader.s.warnings == 0
                  && loader.s.light_count == loader_count_in(end, " lights")));
            loader_unload();
        } else {
            failed++;
            if (i == RTT_COUNT(deserving) || !strstr(loader.reports, deserving[i].report))
                rtt_fail("%s", loader.reports);
        }
    }
    fclose(list);
    CHECK(rows > 150 && failed == RTT_COUNT(deserving));

    for (i = 0; i < RTT_COUNT(twins); i++) {        /* the procedural ones are the files: same order,
          same places but for the files' 6 digits */
        scene file;
        float most = 0;

        snprintf(path, sizeof path, "%s/%s", base, twins[i].file);
        if (!CHECK(loader_load(path)))
            continue;
        file = loader.s;
        if (CHECK(scene_load(&loader.s, twins[i].same, NULL, NULL, NULL))) {
            const rt_geometry *a = &file.geometry, *b = &loader.s.geometry;

            if (CHECK(a->triangle_count == b->triangle_count && a->sphere_count == b->sphere_count && a->vertex_count == b->vertex_count
                      && file.shapes == loader.s.shapes && file.light_count == loader.s.light_count)) {
                for (k = 0; k < 3 * a->vertex_count; k++)
                    most = fmaxf(most, fabsf(file.vertices[k] - loader.s.vertices[k]) / fmaxf(1, fabsf(file.vertices[k])));
                for (k = 0; k < a->sphere_count; k++)
                    most = fmaxf(most, fmaxf(fabsf(file.spheres[k].radius - loader.s.spheres[k].radius),
                                             fabsf(file.spheres[k].center.y - loader.s.spheres[k].center.y) / fmaxf(1,
                                                   file.spheres[k].center.y)));
                for (k = 0; k < a->triangle_count + a->sphere_count; k++) {
                    const rt_vec3 c = file.materials[file.material_ids[k]].diffuse;

                    CHECK(loader_vec3(loader_material(k)->diffuse, c.x, c.y, c.z));
                }
                CHECK(most < 1e-5f);
            }
            scene_free(&loader.s);
        }
        scene_free(&file);
        CHECK(loader_held == 0);
    }
}

/* ---- the pool of threads -------------------------------------------------------------------------------------------- */

typedef struct { pool *workers; int calls[1000], nested; } loader_loop;

static void loader_count_nested(void *context, size_t index)
{
    (void)index;
    __atomic_fetch_add(&((loader_loop *)context)->nested, 1, __ATOMIC_RELAXED);
}

static void loader_count_call(void *context, size_t index)
{
    loader_loop *loop = (loader_loop *)context;

    loop->calls[index]++;                   /* only this call has this index */
    pool_for(loop->workers, 3, loader_count_nested, loop);
}

static void *loader_other_caller(void *context)
{
    loader_loop *loop = (loader_loop *)context;
    int i;

    for (i = 0; i < 50; i++)
        pool_for(loop->workers, 1000, loader_count_call, loop);
    return NULL;
}

static void rtt_test_pool(void)
{
    static const size_t counts[] = { 0, 1, 2, 7, 1000 };
    static loader_loop loop, other;
    int threads;
    size_t i, k, round;
    pthread_t caller;

    loader_held = 0;
    for (threads = 1; threads <= 5; threads++) {
        loop.workers = other.workers = pool_create(threads);
        if (!CHECK(loop.workers && pool_threads(loop.workers) == threads))
            continue;
        for (i = 0; i < RTT_COUNT(counts); i++)
            for (round = 0; round < 20; round++) {
                memset(loop.calls, 0, sizeof loop.calls);
                loop.nested = 0;
                pool_for(loop.workers, counts[i], loader_count_call, &loop);
                for (k = 0; k < 1000; k++)
                    CHECK(loop.calls[k] == (k < counts[i]));
                CHECK((size_t)loop.nested == 3 * counts[i]);
            }
        memset(loop.calls, 0, sizeof loop.calls);               /* two callers at once */
        memset(other.calls, 0, sizeof other.calls);
        CHECK(pthread_create(&caller, NULL, loader_other_caller, &other) == 0);
        loader_other_caller(&loop);
        pthread_join(caller, NULL);
        for (k = 0; k < 1000; k++)
            CHECK(loop.calls[k] == 50 && other.calls[k] == 50);
        pool_destroy(loop.workers);
    }
    pool_destroy(NULL);
    loop.workers = pool_create(0);
    CHECK(loop.workers && pool_threads(loop.workers) >= 1);
    pool_destroy(loop.workers);
    CHECK(loader_held == 0);
    for (k = 1; k < 10; k++) {
        loader_requests = 0;
        loader_fail_at = (long)k;
        loop.workers = pool_create(2);
        loader_fail_at = 0;
        CHECK((loop.workers != NULL) == (k > 2));
        pool_destroy(loop.workers);
        CHECK(loader_held == 0);
    }
}

/* ---- >>ground: planes outside of the tree, and instances that move -------------------------------------------------- */

static void rtt_rays_times(rtt_rays *rays, rtt_random *random)
{
    static const float odd[] = { 0, 1, -1, 2, NAN, INFINITY, -INFINITY };

    rays->time = (float *)rtt_array(rays->count, sizeof *rays->time);
    for (size_t i = 0; i < rays->count; i++)
        rays->time[i] = i % 9 == 8 ? odd[i / 9 % RTT_COUNT(odd)] : 0.5f + 0.5f * rtt_signed(random);
}

/* Infinite planes and discs, tilted and straight, in the plane of triangles, alone, and within instances. */
static void rtt_test_ground(void)
{
    static const float scales[] = { 1, 1e-6f, 1e12f };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < 9; i++) {
        rtt_model model = { 0 }, child = { 0 };
        rtt_rays rays = { 0 };
        float size = scales[i / 3];

        if (i % 3) {
            rtt_cloud(&model, &random, 40, rtt_origin, size, 0.4f * size);
            rtt_balls(&model, &random, 10, rtt_origin, size, 0.2f * size);
            rtt_quad(&model, rtt_mul(rtt_v(-1, 0, -1), size), rtt_mul(rtt_v(2, 0, 0), size), rtt_mul(rtt_v(0, 0, 2), size));
        }
        rtt_ground(&model, rtt_origin, rtt_v(0, 1, 0), i == 5 ? 0 : size);
        rtt_ground(&model, rtt_mul(rtt_v(0, -0.25f, 0), size), rtt_v(0.1f, -1e30f, 0.3f), 0);
        rtt_ground(&model, rtt_origin, rtt_v(0, 1e-30f, 0), 0.5f * size);            /* ties with the first */
        rtt_ground(&model, rtt_mul(rtt_v(0.5f, 0, 0), size), rtt_v(1, 0.2f, -1), 0.7f * size);
        child.structure = (rt_structure)(i / 3);
        rtt_ground(&child, rtt_mul(rtt_v(0, 0.3f, 0), size), rtt_v(1, 3, 1), 0.4f * size);
        if (i == 5)
            rtt_cloud(&child, &random, 8, rtt_origin, size, size);
        for (int k = 0; i % 3 == 2 && k < 3; k++) {
            float matrix[12];

            rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, size), matrix);
            rtt_instance(&model, &child, matrix);
        }
        rtt_rays_mixed(&rays, &random, rtt_origin, size, 150);
        rtt_rays_pinhole(&rays, rtt_mul(rtt_v(0.5f, 1, -3), size), rtt_origin, size, 16);
        for (int k = 0; k < 40; k++) {      /* along the planes, from them, and in them */
            rt_vec3 p = rtt_point(&random, rtt_origin, size);
            float x = rtt_signed(&random), y = rtt_signed(&random);

            p.y = 0;
            rtt_segment(&rays, p, rtt_v(x, k % 4 ? 0 : y, 1), k % 2 ? 0 : -1, k % 3 ? INFINITY : 1);
            rtt_segment(&rays, rtt_add(p, rtt_mul(rtt_v(0, 0.5f, 0), size)), rtt_v(0, k % 2 ? -1e-20f : 1e20f, 0), 0, INFINITY);
        }
        rtt_rays_tighten(&rays, &model, 60);
        CHECK(rtt_hits(&model, &rays) > rays.count / 4);
        rtt_check("ground", &model, &rays);
        rtt_model_free(&model);
        rtt_model_free(&child);
        rtt_rays_free(&rays);
    }
}

static void rtt_test_ground_bad(void)
{
    const rt_plane good = { { 0, 0, 0 }, { 0, 1, 0 }, 1 };
    const rt_plane bad[] = {
        { { NAN, 0, 0 }, { 0, 1, 0 }, 1 }, { { 2e18f, 0, 0 }, { 0, 1, 0 }, 1 }, { { 0, 0, 0 }, { 0, 0, 0 }, 1 }, { { 0, 0, 0 }, { 0, INFINITY, 0 }, 1 },
        { { 0, 0, 0 }, { 0, 1, 0 }, -1 }, { { 0, 0, 0 }, { 0, 1, 0 }, NAN }, { { 9e17f, 0, 0 }, { 0, 1, 0 }, 5e17f }
    };
    rtt_model world = { 0 }, endless = { 0 };
    rt_build_options options;
    rt_geometry geometry;
    rt_accel *accel;
    rt_error error;
    rt_info info;

    memset(&options, 0, sizeof options);
    options.error = &error;
    for (size_t i = 0; i < RTT_COUNT(bad); i++)
        for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
            const rt_plane planes[] = { good, bad[i], good, bad[i] };
            rt_ray down = { { 0.1f, 1, 0.1f }, 0, { 0, -1, 0 }, INFINITY };
            rt_hit hit;

            memset(&geometry, 0, sizeof geometry);
            geometry.planes = planes;
            geometry.plane_count = 4;
            options.structure = (rt_structure)s;
            options.skip_invalid = false;
            CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_GEOMETRY);
            CHECK(accel == NULL && error.prim == 1 && strstr(error.message, "plane 1 "));
            options.skip_invalid = true;
            if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
                continue;
            rt_get_info(accel, &info);
            CHECK(info.planes == 4 && info.skipped == 2 && info.nodes == 0 && info.lower.x == -1 && info.upper.z == 1);
            CHECK(rt_intersect(accel, &down, &hit) && hit.prim == 0 && hit.t == 1 && hit.inst == RT_NONE && rt_occluded(accel, &down));
            rt_free(accel);
        }
    geometry.planes = NULL;
    CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_ARGUMENT);

    options.skip_invalid = false;
    rtt_ground(&endless, rtt_origin, rtt_v(0, 1, 0), 0);
    rtt_ball(&world, rtt_origin, 1);
    rtt_place(&world, &endless, rtt_v(1, 1, 1), rtt_origin);
    geometry = rtt_geometry(&world);
    CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_GEOMETRY);
    CHECK(error.prim == 1 && strstr(error.message, "instance 0 ") && strstr(error.message, "infinite plane"));
    rtt_model_free(&world);
    rtt_model_free(&endless);
}

/* A motion of the last instance within size; calls in a fixed order, for the same models from every compiler. */
static void rtt_any_motion(rtt_model *model, rtt_random *random, float size, float axis_size, float angle)
{
    rt_vec3 move = rtt_point(random, rtt_origin, size), pivot = rtt_point(random, rtt_origin, size), axis = rtt_point(random, rtt_origin, axis_size);

    rtt_set_motion(model, move, pivot, axis, angle);
}

/* Translated, turned, nested, whole turns and none, small and large, with a time for each ray. */
static void rtt_test_motion(void)
{
    static const float angles[] = { 0, 0.01f, 0.7f, -3, 6.2831855f, 100, -RT_MAX_ANGLE };
    static const float scales[] = { 1, 1e-5f, 1e9f };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(angles) + 2; i++) {
        rtt_model child = { 0 }, middle = { 0 }, world = { 0 };
        rtt_rays rays = { 0 };
        float angle = angles[i % RTT_COUNT(angles)], size = scales[i % 3], matrix[12];

        child.structure = (rt_structure)(i % RT_STRUCTURE_COUNT);
        middle.structure = (rt_structure)((i / 3 + i) % RT_STRUCTURE_COUNT);
        rtt_cloud(&child, &random, 25, rtt_origin, size, 0.5f * size);
        rtt_balls(&child, &random, 4, rtt_origin, size, 0.2f * size);
        for (int k = 0; k < 3; k++) {
            rtt_matrix(&random, 0.5f, rtt_point(&random, rtt_origin, size), matrix);
            rtt_instance(&middle, &child, matrix);
            if (k)
                rtt_any_motion(&middle, &random, size, k == 1 ? 1 : 1e-20f, angle);
        }
        rtt_ball(&middle, rtt_origin, 0.2f * size);
        for (int k = 0; k < 8; k++) {
            rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, size), matrix);
            rtt_instance(&world, k % 2 ? &middle : &child, matrix);
            if (k % 4)
                rtt_any_motion(&world, &random, size, angle != 0 ? 1e10f : 0, angle);
        }
        rtt_cloud(&world, &random, 10, rtt_origin, size, size);
        rtt_ground(&world, rtt_mul(rtt_v(0, -1, 0), size), rtt_v(0, 1, 0.1f), 2 * size);
        rtt_rays_mixed(&rays, &random, rtt_origin, 2 * size, 150);
        rtt_rays_pinhole(&rays, rtt_mul(rtt_v(0.5f, 1, -4), size), rtt_origin, size, 12);
        rtt_rays_times(&rays, &random);
        CHECK(rtt_hits(&world, &rays) > rays.count / 4);
        rtt_check("motion", &world, &rays);
        if (i == 2) {                       /* as at time 0 */
            free(rays.time);
            rays.time = NULL;
            rtt_check("motion at 0", &world, &rays);
        }
        rtt_model_free(&world);
        rtt_model_free(&middle);
        rtt_model_free(&child);
        rtt_rays_free(&rays);
    }
}

/* Sine, cosine and rotation, against the C library's. */
static void rtt_test_motion_turn(void)
{
    rtt_random random = rtt_stream();
    double worst = 0;

    for (int i = 0; i < 20000; i++) {
        double angle = i < 100 ? (i - 50) * 0.78539816339744828 : (double)rtt_signed(&random) * (i % 2 ? 1000 : 7), sine, cosine;

        rti_sine_cosine(angle, &sine, &cosine);
        worst = fmax(worst, fmax(fabs(sine - sin(angle)), fabs(cosine - cos(angle))));
    }
    CHECK(worst < 1e-12);
    for (int i = 0; i < 1000; i++) {
        rt_motion motion;
        double r[9];

        memset(&motion, 0, sizeof motion);
        motion.axis = rtt_point(&random, rtt_origin, i % 2 ? 1 : 1e15f);
        motion.angle = 30 * rtt_signed(&random);
        rti_turn(&motion, (double)rtt_signed(&random), r);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                double dot = r[3 * a] * r[3 * b] + r[3 * a + 1] * r[3 * b + 1] + r[3 * a + 2] * r[3 * b + 2];

                CHECK(fabs(dot - (a == b)) < 1e-13);
            }
    }
}

/* Where rt_instance_transform_at says that a point of a nested, moving instance is, a ray at that time finds it. */
static void rtt_test_motion_transform(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 60; i++) {
        rtt_model child = { 0 }, middle = { 0 }, world = { 0 };
        float matrix[12], m[12], still[12], n[9], time = 0.5f + 0.5f * rtt_signed(&random);
        rt_trace_options options;
        rt_geometry geometry;
        rt_accel *accel;

        rtt_ball(&child, rtt_v(0.2f, 0.1f, 0.3f), 0.1f);
        rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
        rtt_instance(&middle, &child, matrix);
        rtt_any_motion(&middle, &random, 3, 1, 2);
        rtt_matrix(&random, 1, rtt_point(&random, rtt_origin, 1), matrix);
        rtt_instance(&world, &middle, matrix);
        rtt_any_motion(&world, &random, 3, 1, -1);
        geometry = rtt_geometry(&world);
        memset(&options, 0, sizeof options);
        options.times = &time;
        if (CHECK_STATUS(rt_build(&accel, &geometry, NULL), RT_OK)) {
            float p[3];
            rt_ray ray;
            rt_hit hit;

            CHECK(rt_instance_transform_at(accel, 1, time, m, n) && rt_instance_transform(accel, 1, still, NULL));
            CHECK(memcmp(m, still, sizeof m) != 0 && rt_instance_transform_at(accel, 1, 0, m, NULL) && memcmp(m, still, sizeof m) == 0);
            CHECK(rt_instance_transform_at(accel, 1, time, m, n));
            for (int k = 0; k < 3; k++)
                p[k] = m[4 * k] * 0.2f + m[4 * k + 1] * 0.1f + m[4 * k + 2] * 0.3f + m[4 * k + 3];
            ray.org = rtt_add(rtt_v(p[0], p[1], p[2]), rtt_v(3, 4, 5));
            ray.dir = rtt_v(-3, -4, -5);
            ray.tmin = 0, ray.tmax = INFINITY;
            CHECK_STATUS(rt_trace(accel, &options, &ray, 1, &hit), RT_OK);
            CHECK(hit.inst == 1 && hit.t < 1 && hit.t > 0);
            rt_free(accel);
        }
        rtt_model_free(&world);
        rtt_model_free(&middle);
        rtt_model_free(&child);
    }
}

static void rtt_test_motion_bad(void)
{
    static const struct { rt_motion motion; const char *word; } bad[] = {
        { { { NAN, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, 1 }, "not finite" }, { { { 0, 0, 0 }, { 0, 2e18f, 0 }, { 0, 1, 0 }, 1 }, "not finite" },
        { { { 0, 0, 0 }, { 0, 0, 0 }, { 0, INFINITY, 0 }, 1 }, "not finite" }, { { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, 1001 }, "RT_MAX_ANGLE" },
        { { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, NAN }, "RT_MAX_ANGLE" }, { { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 1 }, "no axis" },
        { { { 9.9e17f, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 }, "RT_MAX_COORDINATE" }
    };
    rtt_model child = { 0 }, world = { 0 };
    rt_geometry geometry;
    rt_accel *accel, *top;
    rt_error error;
    rt_build_options options;
    rt_instance instances[2];

    memset(&options, 0, sizeof options);
    options.error = &error;
    rtt_ball(&child, rtt_origin, 1);
    rtt_place(&world, &child, rtt_v(1, 1, 1), rtt_origin);
    rtt_place(&world, &child, rtt_v(1, 1, 1), rtt_v(2e16f, 0, 0));
    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        world.instances[1].motion = &bad[i].motion;
        geometry = rtt_geometry(&world);
        CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_GEOMETRY);
        CHECK(error.prim == 1 && strstr(error.message, bad[i].word));
    }
    world.instances[1].motion = NULL;

    /* no cycle: an accel cannot come to show itself, or what shows it */
    geometry = rtt_geometry(&world);
    CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK);
    memset(instances, 0, sizeof instances);
    memcpy(instances, world.instances, sizeof instances);
    geometry.instances = instances;
    instances[0].accel = accel;
    error.message[0] = 0;
    CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_ARGUMENT);
    CHECK(error.prim == 0 && strstr(error.message, "instance 0"));
    {
        rt_geometry outer;

        memset(&outer, 0, sizeof outer);
        instances[0].accel = accel;
        outer.instances = instances;
        outer.instance_count = 1;
        CHECK_STATUS(rt_build(&top, &outer, &options), RT_OK);
        instances[0].accel = top;
        CHECK_STATUS(rt_refit_error(accel, &geometry, &error), RT_ERROR_ARGUMENT);
        rt_free(top);
    }
    rt_free(accel);
    rtt_model_free(&world);
    rtt_model_free(&child);
}

/* Planes and motions change: the hits are those of a new tree; nothing is allocated. */
static void rtt_test_motion_refit(void)
{
    static const struct { rt_structure structure; rt_bounds bounds; } ways[] = {
        { RT_BVH, RT_BOUNDS_BOXES }, { RT_THREADED, RT_BOUNDS_BOXES }, { RT_THREADED, RT_BOUNDS_SPHERES }
    };
    rtt_random random = rtt_stream();

    for (size_t w = 0; w < RTT_COUNT(ways); w++) {
        rtt_model child = { 0 }, world = { 0 };
        rt_build_options options;
        rt_geometry geometry;
        rt_accel *accel;

        memset(&options, 0, sizeof options);
        options.structure = ways[w].structure;
        options.bounds = ways[w].bounds;
        child.structure = RT_THREADED;
        rtt_cloud(&child, &random, 20, rtt_origin, 0.5f, 0.3f);
        for (int k = 0; k < 40; k++)
            rtt_place(&world, &child, rtt_v(0.3f, 0.3f, 0.3f), rtt_point(&random, rtt_origin, 2));
        rtt_ground(&world, rtt_v(0, -1, 0), rtt_v(0, 1, 0), 0);
        rtt_ground(&world, rtt_v(0, -1, 0), rtt_v(0, 1, 0.2f), 3);
        geometry = rtt_geometry(&world);
        if (CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK)) {
            for (int frame = 0; frame < 4; frame++) {
                rtt_rays rays = { 0 };
                rt_hit *want;
                size_t calls;

                for (size_t k = 0; k < world.instance_count; k++) {
                    rt_vec3 at = rtt_point(&random, rtt_origin, 2);

                    world.instances[k].transform[3] = at.x, world.instances[k].transform[7] = at.y;
                    free((void *)world.instances[k].motion);
                    world.instances[k].motion = NULL;
                    if (frame != 2 && k % 3) {
                        rt_motion *motion = (rt_motion *)rtt_array(1, sizeof *motion);

                        motion->move = rtt_point(&random, rtt_origin, 1), motion->axis = rtt_point(&random, rtt_origin, 1);
                        motion->angle = (float)frame;
                        world.instances[k].motion = motion;
                    }
                }
                world.planes[0].point.y = -1 - 0.1f * (float)frame;
                world.planes[1].radius = 1 + (float)frame;
                geometry = rtt_geometry(&world);
                calls = rtt_heap.calls;
                CHECK_STATUS(rt_refit(accel, &geometry), RT_OK);
                CHECK(rtt_heap.calls == calls);
                rtt_check_accel("motion refit", accel, &geometry);
                rtt_rays_mixed(&rays, &random, rtt_origin, 2, 200);
                rtt_rays_times(&rays, &random);
                want = (rt_hit *)rtt_array(rays.count, sizeof *want);
                rtt_oracle_all(&world, &rays, want);
                rtt_compare_ways("motion refit", accel, &rays, want, true, 0, 1);
                free(want);
                rtt_rays_free(&rays);
            }
            rt_free(accel);
        }
        rtt_model_free(&world);
        rtt_model_free(&child);
    }
}

static void rtt_test_ground_raster(void)
{
    rtt_random random = rtt_stream();

    for (int i = 0; i < 3; i++) {
        rtt_model model = { 0 }, child = { 0 };

        if (i)
            rtt_cloud(&model, &random, 60, rtt_origin, 1, 0.4f);
        rtt_balls(&child, &random, 5, rtt_origin, 0.3f, 0.1f);
        for (int k = 0; k < 4 && i == 2; k++) {
            rtt_place(&model, &child, rtt_v(1, 1, 1), rtt_point(&random, rtt_origin, 1));
            rtt_set_motion(&model, rtt_point(&random, rtt_origin, 1), rtt_origin, rtt_v(0, 1, 0), 1);
        }
        rtt_ground(&model, rtt_v(0, -0.3f, 0), rtt_v(0, 1, 0.1f), i == 1 ? 2.0f : 0);
        rtt_ground(&model, rtt_v(0.2f, 0, 0), rtt_v(1, 1, 0), 0.5f);
        CHECK(rtt_check_cameras("ground", &model, &random, rtt_origin, 1) > 5000);
        rtt_model_free(&model);
        rtt_model_free(&child);
    }
}

#define RTT_SAMPLING_HASH 0x3fa3406fu

/* ---- >>sampling: numbers in [0,1), and what they estimate ----------------------------------------------------------- */

static rt_sampler rtt_sampler(rt_sampler_kind kind, uint32_t spp)
{
    rt_sampler sampler;

    memset(&sampler, 0, sizeof sampler);
    sampler.kind = kind, sampler.spp = spp;
    return sampler;
}

static const rt_sampler_kind rtt_samplers[] = { RT_SAMPLER_INDEPENDENT, RT_SAMPLER_STRATIFIED, RT_SAMPLER_SOBOL, RT_SAMPLER_AUTO };

/* 65,536 samples of a pixel fall evenly into 16 x 16 fields, whatever the frame, the dimension and the seed. */
static void rtt_test_sampling_uniform(void)
{
    static const uint32_t frames[] = { 0, 1, 0x7fffffff, 0x80000000, 0xffffffff };

    for (size_t k = 0; k < RTT_COUNT(rtt_samplers); k++)
        for (size_t f = 0; f < RTT_COUNT(frames); f++) {
            rt_sampler sampler = rtt_sampler(rtt_samplers[k], 65536);
            uint32_t counts[256] = { 0 }, flat[256] = { 0 };
            double chi = 0, chi_flat = 0;

            sampler.frame = frames[f], sampler.seed = (uint32_t)f * 77;
            for (uint32_t i = 0; i < 65536; i++) {
                float u[2], v = rt_sample_1d(&sampler, 3, 70000, i, 9);

                rt_sample_2d(&sampler, 3, 70000, i, (uint32_t)f * 1000003, u);
                CHECK(u[0] >= 0 && u[0] < 1 && u[1] >= 0 && u[1] < 1 && v >= 0 && v < 1);
                counts[(int)(u[0] * 16) * 16 + (int)(u[1] * 16)]++;
                flat[(int)(v * 256)]++;
            }
            for (int i = 0; i < 256; i++) {
                chi += (counts[i] - 256.0) * (counts[i] - 256.0) / 256;
                chi_flat += (flat[i] - 256.0) * (flat[i] - 256.0) / 256;
            }
            CHECK(chi < 255 + 5 * sqrt(2 * 255) && chi_flat < 255 + 5 * sqrt(2 * 255));
            if (rtt_samplers[k] == RT_SAMPLER_INDEPENDENT)
                CHECK(chi > 255 - 5 * sqrt(2 * 255));
            else
                CHECK(chi_flat == 0);
        }
}

/* Sobol': each of n = 2^k samples in a cell of its own, for all 2^a x 2^b = n cells, and so each later block, and of 4^k samples in four
   dimensions, for all 4^a x 4^b x 4^c x 4^d = n cells, and of 256 samples for 16 x 16 cells of any two of sixteen numbers;
   stratified: one in each of n. */
static void rtt_test_sampling_strata(void)
{
    static char taken[1024];

    for (uint32_t round = 0; round < 6; round++) {
        rt_sampler sampler = rtt_sampler(RT_SAMPLER_SOBOL, 0);

        sampler.frame = round * 0x40000001u;
        for (int k = 0; k <= 10; k++)
            for (uint32_t block = 0; block < 4; block++)
                for (int a = 0; a <= k; a++) {
                    memset(taken, 0, sizeof taken);
                    for (uint32_t i = block << k; i < (block + 1) << k; i++) {
                        float u[2];
                        size_t cell;

                        rt_sample_2d(&sampler, round, 5, i, round * 31, u);
                        cell = ((size_t)(u[0] * (float)(1 << a)) << (k - a)) + (size_t)(u[1] * (float)(1 << (k - a)));
                        CHECK(!taken[cell]);
                        taken[cell] = 1;
                    }
                }
        for (int k = 0; k <= 5; k++)
            for (int code = 0; code < (k + 1) * (k + 1) * (k + 1); code++) {
                const int a = code % (k + 1), b = code / (k + 1) % (k + 1), c = code / (k + 1) / (k + 1), d = k - a - b - c;
                const uint32_t n = 1u << 2 * k;

                memset(taken, 0, sizeof taken);
                for (uint32_t i = round * n; i < (round + 1) * n && d >= 0; i++) {
                    float u[2], v[2];
                    size_t cell;

                    rt_sample_2d(&sampler, round, 6, i, 2 * round, u);
                    rt_sample_2d(&sampler, round, 6, i, 2 * round + 1, v);
                    cell = (((size_t)(u[0] * (float)(1 << 2 * a)) << 2 * b | (size_t)(u[1] * (float)(1 << 2 * b))) << 2 * c |
                            (size_t)(v[0] * (float)(1 << 2 * c))) << 2 * d | (size_t)(v[1] * (float)(1 << 2 * d));
                    CHECK(!taken[cell]);
                    taken[cell] = 1;
                }
            }
        for (uint32_t p = 1; p < 16; p++)
            for (uint32_t q = 0; q < p; q++) {
                memset(taken, 0, sizeof taken);
                for (uint32_t i = round * 256; i < (round + 1) * 256; i++) {
                    float u[2], v[2];
                    size_t cell;

                    rt_sample_2d(&sampler, 7, round, i, 8 * round + p / 2, u);
                    rt_sample_2d(&sampler, 7, round, i, 8 * round + q / 2, v);
                    cell = (size_t)(u[p % 2] * 16) * 16 + (size_t)(v[q % 2] * 16);
                    CHECK(!taken[cell]);
                    taken[cell] = 1;
                }
            }
    }
    for (uint32_t n = 1; n <= 1024; n = n < 70 ? n + 1 : 2 * n - 37) {
        rt_sampler sampler = rtt_sampler(RT_SAMPLER_STRATIFIED, n);
        uint32_t side = (uint32_t)sqrt((double)n);
        char rows[1024] = { 0 }, line[1024] = { 0 };

        memset(taken, 0, sizeof taken);
        for (uint32_t i = 0; i < n; i++) {
            float u[2], v = rt_sample_1d(&sampler, 8, n, i, 2);
            size_t row, cell;

            rt_sample_2d(&sampler, 8, n, i, 3, u);
            row = (size_t)(u[1] * (float)n), cell = (size_t)(u[1] * (float)side) * side + (size_t)(u[0] * (float)side);
            CHECK(row < n && !rows[row] && !line[(size_t)(v * (float)n)]);
            rows[row] = line[(size_t)(v * (float)n)] = 1;
            if (side * side == n) {
                CHECK(!taken[cell]);
                taken[cell] = 1;
            }
        }
    }
}

/* Pixels, dimensions, frames and seeds do not know of each other. */
static void rtt_test_sampling_independence(void)
{
    for (size_t k = 0; k < RTT_COUNT(rtt_samplers); k++)
        for (int what = 0; what < 5; what++) {
            double sum = 0;
            const int n = 20000;

            for (int i = 0; i < n; i++) {       /* first samples of pixels: within one they are stratified */
                rt_sampler a = rtt_sampler(rtt_samplers[k], 16), b = a;
                uint32_t x = (uint32_t)i * 5, y = (uint32_t)i / 100, d = 4;
                float u[2], v[2];

                b.frame += what == 2, b.seed += what == 3;
                rt_sample_2d(&a, x, y, 0, d, u);
                rt_sample_2d(&b, x + (what == 0), y + (what == 4), 0, d + (what == 1), v);
                sum += (double)(u[0] - 0.5f) * (double)(v[0] - 0.5f) + (double)(u[1] - 0.5f) * (double)(v[1] - 0.5f);
            }
            CHECK(fabs(sum) < 5 * sqrt(2.0 * n) / 12);
        }
}

/* Root of the mean squared error over many pixels of n samples' mean; of a smooth integrand, or of a disc. */
static double rtt_sampling_error(rt_sampler_kind kind, uint32_t n, bool disc)
{
    rt_sampler sampler = rtt_sampler(kind, n);
    double squares = 0;

    for (uint32_t pixel = 0; pixel < 200; pixel++) {
        double sum = 0, error;

        for (uint32_t i = 0; i < n; i++) {
            float u[2];

            rt_sample_2d(&sampler, pixel, 1, i, 0, u);
            sum += disc ? (double)(u[0] * u[0] + u[1] * u[1] < 1) : (double)(u[0] * u[1] * u[1] + u[0] * u[0]);
        }
        error = sum / n - (disc ? 0.78539816339744828 : 0.5);
        squares += error * error;
    }
    return sqrt(squares / 200);
}

static void rtt_test_sampling_convergence(void)
{
    static const struct { rt_sampler_kind kind; double smooth, disc; } bounds[] = {     /* slopes must lie below */
        { RT_SAMPLER_INDEPENDENT, -0.4, -0.4 }, { RT_SAMPLER_STRATIFIED, -0.85, -0.62 }, { RT_SAMPLER_SOBOL, -1.3, -0.68 }
    };

    for (size_t k = 0; k < RTT_COUNT(bounds); k++)
        for (int disc = 0; disc < 2; disc++) {
            double few = rtt_sampling_error(bounds[k].kind, 16, disc), many = rtt_sampling_error(bounds[k].kind, 1024, disc);
            double slope = log(many / few) / log(64.0);

            if (!(slope < (disc ? bounds[k].disc : bounds[k].smooth)))
                rtt_fail("sampler %d, %s: slope %g", (int)bounds[k].kind, disc ? "disc" : "smooth", slope);
            if (k == 0)
                CHECK(slope > -0.6);
        }
}

/* The numbers are part of the promise: pictures of the same frame and seed stay. */
static void rtt_test_sampling_golden(void)
{
    uint32_t hash = 0;

    for (size_t k = 0; k < 3; k++)
        for (uint32_t i = 0; i < 2000; i++) {
            rt_sampler sampler = rtt_sampler(rtt_samplers[k], 1 + i % 99);
            float u[3];
            uint32_t bits[3];

            sampler.frame = i * 7, sampler.seed = i / 3;
            rt_sample_2d(&sampler, i, i * i, i % 99, i % 13, u);
            u[2] = rt_sample_1d(&sampler, i, i * i, i % 99, i % 13);
            memcpy(bits, u, sizeof bits);
            for (int b = 0; b < 3; b++)
                hash = hash * 0x9e3779b1u + bits[b];
        }
    if (hash != RTT_SAMPLING_HASH)
        rtt_fail("the numbers have changed: 0x%08xu", hash);
}

/* ---- >>distribution: each effect against its value ------------------------------------------------------------------ */

typedef struct { double mean, error; } rtt_estimate;      /* error: deviation of the mean */

static rtt_estimate rtt_estimate_of(const double *values, int count)
{
    rtt_estimate e = { 0, 0 };

    for (int i = 0; i < count; i++)
        e.mean += values[i] / count;
    for (int i = 0; i < count; i++)
        e.error += (values[i] - e.mean) * (values[i] - e.mean);
    e.error = sqrt(e.error / (count - 1.0) / count);
    return e;
}

/* Red of the mean pixel over some frames of a picture. */
static rtt_estimate rtt_pixel(const rt_scene *seen, rt_render_options options, int x, int y, int frames)
{
    static rt_vec3 pixels[64 * 64];
    double values[64];

    for (int f = 0; f < frames; f++) {
        options.frame = (uint32_t)f;
        CHECK_STATUS(rt_render_tile(seen, &options, x, y, x + 1, y + 1, pixels, NULL), RT_OK);
        values[f] = (double)pixels[y * options.width + x].x;
    }
    return rtt_estimate_of(values, frames);
}

static void rtt_close_to(const char *what, rtt_estimate e, double truth, double slack)
{
    if (!(fabs(e.mean - truth) <= 5 * e.error + slack))
        rtt_fail("%s: %.6f +- %.6f instead of %.6f", what, e.mean, e.error, truth);
}

static void rtt_test_lobe(void)
{
    static const float roughness[] = { 1, 0.5f, 0.1f, 0.01f };
    rt_sampler sampler = rtt_sampler(RT_SAMPLER_SOBOL, 0);
    const rt_vec3 axis = rti_normalize(rtt_v(1, -2, 0.5f));

    for (size_t r = 0; r < RTT_COUNT(roughness); r++) {
        const float n = 2 / (roughness[r] * roughness[r]) - 2;
        rt_vec3 mean = rtt_origin;

        for (uint32_t i = 0; i < 16384; i++) {
            float u[2];
            rt_vec3 d;

            rt_sample_2d(&sampler, 0, 0, i, 0, u);
            d = rti_on_lobe(axis, n, u);
            CHECK(fabsf(rti_dot(d, d) - 1) < 1e-5f);
            mean = rtt_add(mean, rtt_mul(d, 1.0f / 16384));
        }
        CHECK(fabs((double)rti_dot(mean, axis) - (double)(n + 1) / (double)(n + 2)) < 2e-4);
        mean = rti_sub(mean, rti_scale(axis, rti_dot(mean, axis)));
        CHECK(rti_largest(mean) < 2e-3f);
    }
}

/* What a light of one unit sends to the origin with a wall in the way that leaves z > tan * x free, times the cosine to +z, by quadrature over the light's
   surface: of (cosine at the light) / distance^2, over the same without a wall. */
static double rtt_light_quadrature(const rt_light *light, double slope, bool wall)
{
    const int n = 1500;
    double sum = 0, all = 0;

    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            const double u = (i + 0.5) / n, v = (j + 0.5) / n;
            double p[3], normal[3], r2, weight, cosine;

            if (light->radius > 0) {
                const double z = 1 - 2 * u, s = sqrt(1 - z * z), a = 6.283185307179586 * v;

                normal[0] = s * cos(a), normal[1] = s * sin(a), normal[2] = z;
                p[0] = (double)light->position.x + (double)light->radius * normal[0];
                p[1] = (double)light->position.y + (double)light->radius * normal[1];
                p[2] = (double)light->position.z + (double)light->radius * normal[2];
            } else {
                const rt_vec3 a = light->edges[0], b = light->edges[1], c = rti_normalize(rti_cross(a, b));

                p[0] = (double)light->position.x + (u - 0.5) * (double)a.x + (v - 0.5) * (double)b.x;
                p[1] = (double)light->position.y + (u - 0.5) * (double)a.y + (v - 0.5) * (double)b.y;
                p[2] = (double)light->position.z + (u - 0.5) * (double)a.z + (v - 0.5) * (double)b.z;
                normal[0] = (double)c.x, normal[1] = (double)c.y, normal[2] = (double)c.z;
            }
            r2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
            weight = -(normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2]) / (r2 * sqrt(r2));
            if (light->radius <= 0)
                weight = fabs(weight);
            else if (weight < 0)
                weight = 0;
            cosine = p[2] / sqrt(r2);
            all += weight;
            if (cosine > 0 && (!wall || p[2] > slope * p[0]))
                sum += weight * cosine;
        }
    return sum / all;
}

static const rt_light rtt_area_lights[] = {
    { .position = { 0.5f, 0.3f, 3 }, .color = { 1, 1, 1 }, .radius = 1 },
    { .position = { 0.2f, 0.1f, 1.2f }, .color = { 1, 1, 1 }, .radius = 1.15f },
    { .position = { 0, 2, 40 }, .color = { 1, 1, 1 }, .radius = 0.05f },
    { .position = { 0.4f, 0, 2 }, .color = { 1, 1, 1 }, .edges = { { 1, 0, 0 }, { 0, 2, 0 } } },
    { .position = { 0.4f, 0.5f, 1 }, .color = { 1, 1, 1 }, .edges = { { 0, 1, 1 }, { 0.5f, 1, -1 } } },
    { .position = { -1, 0, 0.4f }, .color = { 1, 1, 1 }, .edges = { { 4, 0, 0 }, { 0, 3, 0 } } },
    { .position = { 3, 1, 90 }, .color = { 1, 1, 1 }, .edges = { { 0.02f, 0, 0 }, { 0, 0.01f, 0 } } },
};

/* Both ways to choose points tend to the same light, that of quadrature; so does what is seen past a wall: its penumbra. */
static void rtt_test_area_lights(void)
{
    for (size_t l = 0; l < RTT_COUNT(rtt_area_lights); l++)
        for (int by_area = 0; by_area < 2; by_area++)
            for (int wall = 0; wall < 2; wall++) {
                rt_light light = rtt_area_lights[l];
                double slope = wall ? (double)light.position.z / ((double)light.position.x + 0.1) : 0, values[16];
                rt_sampler sampler = rtt_sampler(RT_SAMPLER_SOBOL, 0);

                if (light.edges[0].z != 0)      /* not at right angles as written: turn the second */
                    light.edges[1] = rti_scale(rti_cross(rti_cross(light.edges[0], light.edges[1]), light.edges[0]), 0.5f);
                light.by_area = by_area;
                CHECK_STATUS(rti_check_light(&light, 0, NULL), RT_OK);
                for (int f = 0; f < 16; f++) {
                    values[f] = 0;
                    sampler.frame = (uint32_t)f;
                    for (uint32_t i = 0; i < 4096; i++) {
                        float u[2], share;
                        rt_vec3 to;

                        rt_sample_2d(&sampler, 0, 0, i, 0, u);
                        to = light.radius > 0 ? rti_on_sphere(&light, rtt_origin, u, &share) : rti_on_rectangle(&light, rtt_origin, u, &share);
                        if (!wall || (double)to.z > slope * (double)to.x)
                            values[f] += (double)(rti_positive(rti_normalize(to).z) * share) / 4096;
                    }
                }
                rtt_close_to("a light", rtt_estimate_of(values, 16), rtt_light_quadrature(&light, slope, wall), 1e-3);
            }
}

/* The same through the renderer: the pixel of a floor, a wall's edge overhead. */
static void rtt_test_penumbra(void)
{
    static const rt_sampler_kind kinds[] = { RT_SAMPLER_INDEPENDENT, RT_SAMPLER_STRATIFIED, RT_SAMPLER_AUTO };

    for (size_t l = 0; l < 5; l++)
        for (int at = -1; at <= 1 && l != 2 && l != 4; at++) {          /* 2 and 4 stand where no such wall parts them */
            rtt_stage stage;
            rt_render_options options;
            double truth, slope;

            memset(&stage, 0, sizeof stage);
            stage.materials[0] = rtt_material(rtt_gray(1), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
            stage.light = rtt_area_lights[l];
            slope = (double)stage.light.position.z / ((double)stage.light.position.x + 0.1 * at);
            rtt_stage_quad(&stage, rtt_v(-5, -5, 0), rtt_v(10, 0, 0), rtt_v(0, 10, 0), 0);
            rtt_stage_quad(&stage, rtt_v((float)(0.02 / slope), -50, 0.02f), rtt_v(50, 0, 0), rtt_v(0, 100, 0), 0);      /* free: z > slope x */
            rtt_stage_build(&stage);
            stage.scene.light_count = 1;
            stage.scene.camera = (rt_camera){ { -0.01f, 0, 0.01f }, { 0, 0, 0 }, { 0, 1, 0 }, 0.001f };
            memset(&options, 0, sizeof options);
            options.width = options.height = 1;
            options.spp = 1024;
            truth = rtt_light_quadrature(&stage.light, slope, true);
            CHECK(truth > 0.03 && truth < 0.97);
            for (size_t k = 0; k < RTT_COUNT(kinds); k++) {
                options.sampler = kinds[k];
                rtt_close_to(l == 0 ? "penumbra 0" : l == 1 ? "penumbra 1" : l == 2 ? "penumbra 2" : "penumbra 3", rtt_pixel(&stage.scene, options, 0, 0, 24), truth, 1e-3);
            }
            rtt_stage_free(&stage);
        }
}

/* A glowing half plane covers a part of the pixel: the filter's integral up to its edge. */
static void rtt_test_coverage(void)
{
    for (int filter = 0; filter < RT_FILTER_COUNT; filter++)
        for (int kind = 0; kind < RT_SAMPLER_COUNT; kind++)
            for (int e = -4; e <= 4; e++) {
                const double x = 0.3 * e, cut = erf(3 / sqrt(2.0));         /* the edge, in pixels from the middle */
                double truth = x < -0.5 ? 0 : x > 0.5 ? 1 : x + 0.5;
                rtt_stage stage;
                rt_render_options options;

                if (filter == RT_FILTER_TENT)
                    truth = x < -1 ? 0 : x > 1 ? 1 : x < 0 ? (1 + x) * (1 + x) / 2 : 1 - (1 - x) * (1 - x) / 2;
                if (filter == RT_FILTER_GAUSSIAN)
                    truth = 0.5 + 0.5 * erf(x * sqrt(2.0)) / cut;
                memset(&stage, 0, sizeof stage);
                stage.materials[0] = rtt_material(rtt_gray(0), rtt_gray(1), rtt_gray(0), rtt_gray(0), 0, false);
                rtt_stage_quad(&stage, rtt_v((float)(x / 10 - 9), -9, 0), rtt_v(9, 0, 0), rtt_v(0, 18, 0), 0);
                rtt_stage_build(&stage);
                stage.scene.camera = (rt_camera){ { 0, 0, 1 }, { 0, 0, 0 }, { 0, 1, 0 }, 2 * 26.565051f };    /* 10 pixels: one is 0.1 wide */
                stage.scene.camera.eye.x = stage.scene.camera.look.x = -0.05f;          /* pixel (5, 5) has its middle at 0 */
                memset(&options, 0, sizeof options);
                options.width = options.height = 10;
                options.spp = kind == RT_SAMPLER_AUTO && filter == RT_FILTER_BOX ? 4096 : 256;
                options.sampler = (rt_sampler_kind)kind, options.filter = (rt_filter)filter;
                rtt_close_to(e < 0 ? "coverage left" : "coverage", rtt_pixel(&stage.scene, options, 5, 5, 16), truth,
                             kind == RT_SAMPLER_AUTO && filter == RT_FILTER_BOX ? 1.0 / 64 : 5e-3);
                rtt_stage_free(&stage);
            }
}

/* First and second moments of the brightness of a picture, in pixels from its middle. */
typedef struct { double sum, x, xx, y, yy, farthest; } rtt_moments;

static rtt_moments rtt_moments_of(const rt_vec3 *pixels, int side)
{
    rtt_moments m = { 0, 0, 0, 0, 0, 0 };

    for (int i = 0; i < side * side; i++) {
        const double x = i % side + 0.5 - side / 2.0, y = i / side + 0.5 - side / 2.0, w = (double)pixels[i].x;

        m.sum += w, m.x += w * x, m.xx += w * x * x, m.y += w * y, m.yy += w * y * y;
        if (w > 0 && sqrt(x * x + y * y) > m.farthest)
            m.farthest = sqrt(x * x + y * y);
    }
    m.x /= m.sum, m.xx /= m.sum, m.y /= m.sum, m.yy /= m.sum;
    return m;
}

/* A small ball out of focus is seen as a disc: of radius lens * |1 - focus / depth| in the plane of focus, as bright all over. */
static void rtt_test_confusion(void)
{
    enum { SIDE = 48 };
    static rt_vec3 pixels[SIDE * SIDE];
    static const float depths[] = { 2.2f, 8 };

    for (size_t d = 0; d < RTT_COUNT(depths); d++) {
        const float focus = 4, lens = 0.6f, step = 2 * 0.25f / SIDE;        /* of a pixel, at depth 1 */
        const double circle = (double)(lens * fabsf(1 - focus / depths[d]) / focus / step), ball = 0.06 / (double)depths[d] / (double)step;
        rtt_stage stage;
        rt_render_options options;
        rtt_moments sharp, blurred;

        memset(&stage, 0, sizeof stage);
        stage.materials[0] = rtt_material(rtt_gray(0), rtt_gray(1), rtt_gray(0), rtt_gray(0), 0, false);
        rtt_ball(&stage.model, rtt_v(0, 0, -depths[d]), 0.06f);
        rtt_stage_build(&stage);
        stage.scene.camera = (rt_camera){ { 0, 0, 0 }, { 0, 0, -1 }, { 0, 1, 0 }, 2 * 14.0362435f };
        memset(&options, 0, sizeof options);
        options.width = options.height = SIDE;
        options.spp = 2048;
        options.sampler = RT_SAMPLER_SOBOL;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
        sharp = rtt_moments_of(pixels, SIDE);
        options.lens.radius = lens, options.lens.focus = focus;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
        blurred = rtt_moments_of(pixels, SIDE);
        CHECK(circle > 4 && circle < 28);
        CHECK(fabs(blurred.sum / sharp.sum - 1) < 0.03 && fabs(blurred.x) < 0.3 && fabs(blurred.y) < 0.3);
        CHECK(fabs((blurred.xx + blurred.yy - sharp.xx - sharp.yy) / (circle * circle / 2) - 1) < 0.05);
        CHECK(blurred.farthest < circle + ball + 1.5 && blurred.farthest > circle - 1.5);
        CHECK(fabs(blurred.xx / blurred.yy - 1) < 0.05);
        options.lens.focus = depths[d];     /* in focus: as through the pinhole */
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
        blurred = rtt_moments_of(pixels, SIDE);
        CHECK(fabs(blurred.xx - sharp.xx) < 0.3 && blurred.farthest < ball + 2);
        rtt_stage_free(&stage);
    }
    {
        const rt_camera camera = { { 1, 2, 3 }, { 4, 0, 1 }, { 0, 1, 0 }, 50 };
        const rt_lens lens = { 0.5f, 7, 0, 0 };
        const rt_ray pinhole = rt_camera_ray(&camera, 10, 30, 80, 60);

        for (int i = 0; i < 100; i++) {
            const float u[2] = { (float)(i % 10) / 10, (float)(i / 10) / 10 };
            const rt_ray ray = rt_lens_ray(&camera, &lens, 10, 30, 80, 60, u);
            const rt_vec3 off = rti_sub(ray.org, camera.eye);
            const rt_vec3 meet = rti_sub(rti_add(ray.org, rti_scale(ray.dir, 7)), rti_add(pinhole.org, rti_scale(pinhole.dir, 7)));

            CHECK(rti_largest(meet) < 1e-5f && rti_dot(off, off) < 0.2501f && fabsf(rti_dot(off, rti_normalize(rti_sub(camera.look, camera.eye)))) < 1e-5f);
        }
    }
}

/* A ball that moves while the shutter is open leaves a streak, from where it was to where it comes, as bright all along. */
static void rtt_test_streak(void)
{
    enum { SIDE = 64 };
    static rt_vec3 pixels[SIDE * SIDE];

    for (int turn = 0; turn < 2; turn++) {
        const float open = 0.25f, close = 0.75f;
        rtt_model child = { 0 };
        rt_scene part;
        rt_geometry inner;
        rtt_stage stage;
        rt_render_options options;
        const rt_scene *parts[1] = { &part };
        rtt_moments still, streak;

        memset(&stage, 0, sizeof stage);
        memset(&part, 0, sizeof part);
        stage.materials[0] = rtt_material(rtt_gray(0), rtt_gray(1), rtt_gray(0), rtt_gray(0), 0, false);
        rtt_ball(&child, turn ? rtt_v(20, 0, 0) : rtt_origin, 1);
        rtt_place(&stage.model, &child, rtt_v(1, 1, 1), turn ? rtt_origin : rtt_v(-20, 0, 0));
        if (turn)                           /* a quarter of a circle while it is open, from the right (at its start) to the top */
            rtt_set_motion(&stage.model, rtt_origin, rtt_origin, rtt_v(0, 0, 5), 3.14159265f);
        else
            rtt_set_motion(&stage.model, rtt_v(40, 0, 0), rtt_origin, rtt_origin, 0);
        inner = rtt_geometry(&child);
        part.accel = child.accel, part.geometry = &inner;
        part.materials = stage.materials, part.material_count = 1;
        stage.scene.parts = parts;
        rtt_stage_build(&stage);
        stage.scene.camera = (rt_camera){ { 0, 0, 1e4f }, { 0, 0, 0 }, { 0, 1, 0 }, 2 * 0.18334617f };     /* a pixel is one unit */
        memset(&options, 0, sizeof options);
        options.width = options.height = SIDE;
        options.spp = 1024;
        options.lens.open = options.lens.close = 0.5f;      /* shut at once: sharp, in the middle of the way */
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
        still = rtt_moments_of(pixels, SIDE);
        options.lens.open = open, options.lens.close = close;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
        streak = rtt_moments_of(pixels, SIDE);
        CHECK(fabs(streak.sum / still.sum - 1) < 0.03);
        if (turn) {                         /* between 45 and 135 degrees: means of the cosine 0, of the sine 2 sqrt 2 / pi */
            CHECK(fabs(still.x) < 0.1 && fabs(still.y + 20) < 0.1);
            CHECK(fabs(streak.x) < 0.15 && fabs(streak.y + 20 * 0.9003163) < 0.15);
            CHECK(fabs(streak.xx - still.xx - 400 * (0.5 - 1 / 3.14159265)) < 1.5);     /* of the squared cosine: 1/2 - 1/pi */
        } else {
            CHECK(fabs(still.x) < 0.1 && fabs(still.y) < 0.1 && fabs(streak.x) < 0.1 && fabs(streak.y) < 0.1);
            CHECK(fabs(streak.xx - still.xx - 400.0 / 12) < 1 && fabs(streak.yy - still.yy) < 0.1);      /* 20 long */
            CHECK(streak.farthest < 12 && streak.farthest > 10);
        }
        rtt_stage_free(&stage);
        rtt_model_free(&child);
    }
}

/* Everything at once: the same picture from every algorithm, packet, tile and block; another frame or seed is another. */
static void rtt_test_distribution_ways(void)
{
    enum { WIDTH = 33, HEIGHT = 29, PIXELS = WIDTH * HEIGHT };
    static const int sides[] = { 16, 9, 64 };
    static rt_vec3 want[PIXELS], got[PIXELS];
    rtt_model child = { 0 };
    rtt_stage stage;
    rtt_accels accels;
    rt_scene part;
    rt_geometry inner;
    const rt_scene *parts[2] = { &part, &part };
    rt_light lights[3];
    rt_render_options options;

    memset(&stage, 0, sizeof stage);
    memset(&part, 0, sizeof part);
    memset(lights, 0, sizeof lights);
    stage.materials[0] = rtt_material(rtt_v(0.6f, 0.5f, 0.4f), rtt_gray(0), rtt_gray(0.2f), rtt_gray(0), 0, false);
    stage.materials[1] = rtt_glass(1.5f, true);
    stage.materials[2] = rtt_mirror(0.8f, 0);
    stage.materials[0].roughness = 0.5f, stage.materials[1].roughness = 0.2f, stage.materials[2].roughness = 1;
    rtt_ground(&stage.model, rtt_origin, rtt_v(0, 1, 0), 6);
    for (uint32_t i = 0; i < 3; i++) {
        rtt_ball(&stage.model, rtt_v((float)i - 0.8f, 0.7f, 1.5f - 0.7f * (float)i), 0.6f);
        stage.ids[i] = i;
    }
    rtt_ball(&child, rtt_origin, 0.4f);
    for (int i = 0; i < 2; i++) {
        rtt_place(&stage.model, &child, rtt_v(1, 1.5f, 1), rtt_v(i ? 1.5f : -1.5f, 1.6f, 0));
        rtt_set_motion(&stage.model, rtt_v(0.3f, 0, 0), rtt_origin, rtt_v(0, 1, 1), i ? 1.0f : 0);
    }
    inner = rtt_geometry(&child);
    part.accel = child.accel, part.geometry = &inner, part.materials = &stage.materials[1], part.material_count = 1;
    stage.scene.parts = parts;
    rtt_stage_build(&stage);
    lights[0].position = rtt_v(3, 8, 5), lights[0].radius = 1;
    lights[1].position = rtt_v(-3, 6, 5), lights[1].edges[0] = rtt_v(1, 0, 0), lights[1].edges[1] = rtt_v(0, 1, 0);
    lights[2].position = rtt_v(0, 6, 0);
    for (int i = 0; i < 3; i++)
        lights[i].color = rtt_gray(0.4f);
    stage.scene.lights = lights, stage.scene.light_count = 3;
    CHECK_STATUS(rt_check_scene(&stage.scene, NULL), RT_OK);
    stage.scene.ambient = rtt_gray(0.2f), stage.scene.background = rtt_v(0.3f, 0.5f, 0.8f);
    stage.scene.camera = (rt_camera){ { 1, 3, 6 }, { 0, 0.7f, 0 }, { 0, 1, 0 }, 45 };
    memset(&options, 0, sizeof options);
    options.width = WIDTH, options.height = HEIGHT, options.spp = 3, options.depth = 4;
    options.sampler = RT_SAMPLER_SOBOL, options.filter = RT_FILTER_GAUSSIAN, options.frame = 0x7fffffff;
    options.lens.radius = 0.1f, options.lens.close = 0.5f;
    CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, WIDTH, HEIGHT, want, NULL), RT_OK);
    if (!rtt_accels_build(&accels, &stage.model))
        rtt_die("a stage does not build");
    for (size_t w = 0; w < rtt_way_count; w += rtt_ways[w].large ? 5 : 1) {
        const int side = sides[w % RTT_COUNT(sides)];

        memset(got, 0xff, sizeof got);
        options.trace = rtt_ways[w].options;
        stage.scene.accel = rtt_accels_for(&accels, &rtt_ways[w]);
        for (int y = 0; y < HEIGHT; y += side)
            for (int x = 0; x < WIDTH; x += side)
                CHECK_STATUS(rt_render_tile(&stage.scene, &options, x, y, x + side < WIDTH ? x + side : WIDTH,
                                            y + side < HEIGHT ? y + side : HEIGHT, got, NULL), RT_OK);
        if (memcmp(want, got, sizeof want) != 0)
            rtt_fail("%s, tiles of %d pixels: another picture", rtt_ways[w].label, side);
    }
    memset(&options.trace, 0, sizeof options.trace);
    options.frame = 0x80000000;
    CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, WIDTH, HEIGHT, got, NULL), RT_OK);
    CHECK(memcmp(want, got, sizeof want) != 0);
    options.frame = 0x7fffffff, options.seed = 1;
    CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, WIDTH, HEIGHT, got, NULL), RT_OK);
    CHECK(memcmp(want, got, sizeof want) != 0);
    stage.scene.accel = stage.accel;
    rtt_accels_free(&accels);
    rtt_stage_free(&stage);
    rtt_model_free(&child);
}

/* A point of a large triangle near the origin, seen from near: t errs by the triangle's size, and no shadow of its own may fall on it. */
static void rtt_test_large_triangles(void)
{
    static rt_vec3 pixels[32 * 32];
    static const float sizes[] = { 5, 500, 5e5f };

    for (size_t i = 0; i < RTT_COUNT(sizes); i++) {
        rtt_stage stage;
        rt_render_options options;

        memset(&stage, 0, sizeof stage);
        stage.materials[0] = rtt_material(rtt_gray(1), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
        rtt_stage_quad(&stage, rtt_v(-sizes[i], -sizes[i], 0), rtt_v(2 * sizes[i], 0, 0), rtt_v(0, 2 * sizes[i], 0), 0);
        rtt_stage_build(&stage);
        stage.light.position = rtt_v(0.5f, 0.3f, 3), stage.light.color = rtt_gray(1);
        stage.scene.light_count = 1;
        stage.scene.camera = (rt_camera){ { -0.01f, 0, 0.01f }, { 0, 0, 0 }, { 0, 1, 0 }, 1 };
        memset(&options, 0, sizeof options);
        options.width = options.height = 32;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, 32, 32, pixels, NULL), RT_OK);
        for (int k = 0; k < 32 * 32; k++)
            CHECK(pixels[k].x > 0.95f);
        rtt_stage_free(&stage);
    }
}

/* A picture drawn in parts: their mean is the whole. What counts ask for is, pixel by pixel, what a call for so many samples draws. */
static void rtt_test_parts(void)
{
    enum { SIDE = 37, SPP = 6 };
    static rt_vec3 whole[SIDE * SIDE], part[SIDE * SIDE], drawn[SPP + 1][SIDE * SIDE];
    static uint32_t counts[SIDE * SIDE];
    rtt_random random = rtt_stream();
    rt_render_options options;
    rtt_stage stage;
    rt_error error;

    memset(&stage, 0, sizeof stage);
    stage.materials[0] = rtt_material(rtt_gray(0.5f), rtt_gray(0.2f), rtt_gray(0), rtt_gray(0), 0, false);
    rtt_stage_quad(&stage, rtt_v(-3, -1, 3), rtt_v(6, 0, 0), rtt_v(0, 0, -6), 0);
    rtt_ball(&stage.model, rtt_v(0, 0, 0), 0.7f);
    rtt_stage_build(&stage);
    stage.light.position = rtt_v(2, 3, 1), stage.light.color = rtt_gray(1), stage.light.radius = 0.8f;
    stage.scene.light_count = 1;
    stage.scene.camera = (rt_camera){ { 0, 1, 4 }, { 0, -0.2f, 0 }, { 0, 1, 0 }, 40 };
    memset(&options, 0, sizeof options);
    options.width = options.height = SIDE;
    options.lens.radius = 0.1f;
    options.trace.error = &error;
    for (int kind = 0; kind < RT_SAMPLER_COUNT; kind++) {
        rt_ray_counts rays = { 0, 0, 0, 0 };
        uint64_t sum = 0;

        options.sampler = (rt_sampler_kind)kind;
        options.spp = SPP;
        options.first_sample = options.samples = 0;
        options.counts = NULL;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, whole, NULL), RT_OK);
        for (int n = 1; n <= SPP; n++) {
            options.samples = n;
            CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, drawn[n], NULL), RT_OK);
        }
        CHECK(memcmp(whole, drawn[SPP], sizeof whole) == 0 && memcmp(whole, drawn[2], sizeof whole) != 0);
        options.first_sample = 2;
        options.samples = 0;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, part, NULL), RT_OK);
        for (int i = 0; i < SIDE * SIDE; i++)
            CHECK(fabsf((2 * drawn[2][i].x + 4 * part[i].x) / 6 - whole[i].x) < 1e-6f);
        for (int i = 0; i < SIDE * SIDE; i++)
            counts[i] = i % 5 == 0 ? 0 : rtt_below(&random, SPP + 1);
        counts[7] = 1000;
        for (int i = 0; i < SIDE * SIDE; i++)
            sum += counts[i] < SPP ? counts[i] : SPP;
        options.first_sample = 0;
        options.counts = counts;
        memcpy(drawn[0], part, sizeof part);
        for (int width = 0; width <= 32; width += 32) {
            options.trace.algorithm = width ? RT_BVH_RANGED : RT_AUTO;
            options.trace.packet_width = width;
            memcpy(part, drawn[0], sizeof part);
            rays.primary = 0;
            CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, part, &rays), kind ? RT_OK : RT_ERROR_ARGUMENT);
            CHECK(rays.primary == (kind ? sum : 0));
            for (int i = 0; i < SIDE * SIDE; i++)
                CHECK(memcmp(&part[i], &drawn[!kind ? 0 : counts[i] < SPP ? counts[i] : SPP][i], sizeof *part) == 0);
        }
        memset(&options.trace, 0, sizeof options.trace);
        options.trace.error = &error;
    }
    for (int i = 0; i < 5; i++) {
        static const int bad[][3] = { { 4, -1, 0 }, { 4, 4, 0 }, { 4, 0, 5 }, { 4, 3, 2 }, { 0, 0, -1 } };

        options.counts = NULL;
        options.spp = bad[i][0], options.first_sample = bad[i][1], options.samples = bad[i][2];
        memset(&error, 0, sizeof error);
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, part, NULL), RT_ERROR_ARGUMENT);
        CHECK(strstr(error.message, "first_sample") != NULL);
    }
    rtt_stage_free(&stage);
}

static void rtt_test_distribution_errors(void)
{
    static const struct { size_t at; float value; const char *word; } bad[] = {
        { offsetof(rt_render_options, lens.radius), -1, "radius" },  { offsetof(rt_render_options, lens.radius), NAN, "radius" },
        { offsetof(rt_render_options, lens.focus), INFINITY, "focus" }, { offsetof(rt_render_options, lens.focus), -2, "focus" },
        { offsetof(rt_render_options, lens.open), 0.5f, "shutter" }, { offsetof(rt_render_options, lens.close), 1.5f, "shutter" },
        { offsetof(rt_render_options, lens.open), -0.1f, "shutter" }, { offsetof(rt_render_options, lens.close), NAN, "shutter" },
        { offsetof(rt_render_options, sampler), 1e9f, "sampler" }, { offsetof(rt_render_options, filter), 1e9f, "filter" },
    };
    rt_vec3 pixels[4], untouched[4];
    rtt_stage stage;
    rt_error error;
    rt_raster *raster;

    memset(&stage, 0, sizeof stage);
    rtt_stage_quad(&stage, rtt_v(-1, 0, -1), rtt_v(0, 0, 2), rtt_v(2, 0, 0), 1);
    rtt_stage_build(&stage);
    stage.scene.camera = (rt_camera){ { 0, 3, 6 }, { 0, 0, 0 }, { 0, 1, 0 }, 45 };
    memset(pixels, 0xcc, sizeof pixels);
    memset(untouched, 0xcc, sizeof untouched);
    for (size_t i = 0; i <= RTT_COUNT(bad); i++) {
        rt_render_options options;

        memset(&options, 0, sizeof options);
        memset(&error, 0, sizeof error);
        options.width = options.height = 2;
        options.trace.error = &error;
        if (i < RTT_COUNT(bad))
            memcpy((char *)&options + bad[i].at, &bad[i].value, sizeof(float));
        else
            options.spp = RT_MAX_SPP + 1;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, 2, 2, pixels, NULL), RT_ERROR_ARGUMENT);
        CHECK(strstr(error.message, i < RTT_COUNT(bad) ? bad[i].word : "spp") && memcmp(pixels, untouched, sizeof pixels) == 0);
    }
    CHECK_STATUS(rt_raster_create(&raster, &stage.geometry, &stage.scene.camera, 2, 2, NULL), RT_OK);
    for (int i = 0; i < 5; i++) {
        rt_render_options options;

        memset(&options, 0, sizeof options);
        options.width = options.height = 2;
        options.raster = raster;
        options.trace.error = &error;
        options.lens.radius = i == 1, options.lens.close = i == 2;
        options.sampler = i == 3 ? RT_SAMPLER_SOBOL : RT_SAMPLER_AUTO, options.filter = i == 4 ? RT_FILTER_TENT : RT_FILTER_BOX;
        CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, 2, 2, pixels, NULL), i ? RT_ERROR_ARGUMENT : RT_OK);
    }
    rt_raster_free(raster);
    for (int i = 0; i < 7; i++) {
        static const char *const words[] = { "radius", "radius", "edge", "radius and edges", "right angles", "right angles", "roughness" };
        rt_light light;

        memset(&light, 0, sizeof light);
        light.radius = i == 0 ? -1 : i == 1 ? NAN : i == 3 ? 1.0f : 0;
        light.edges[0].x = i == 2 ? INFINITY : i >= 3 && i < 6 ? 1.0f : 0;
        light.edges[1].y = i == 3 ? 1.0f : 0;
        light.edges[1].x = i == 4;
        stage.materials[0].roughness = i == 6 ? 1.5f : 0;
        stage.light = light;
        stage.scene.light_count = 1;
        CHECK_STATUS(rt_check_scene(&stage.scene, &error), RT_ERROR_ARGUMENT);
        CHECK(strstr(error.message, words[i]) != NULL);
    }
    rtt_stage_free(&stage);
}

/* ---- >>textures: filtered, bumped, loaded --------------------------------------------------------------------------- */

static rt_texture rtt_texture(rt_texture_kind kind, bool solid, float size)
{
    rt_texture texture;

    memset(&texture, 0, sizeof texture);
    texture.kind = kind, texture.solid = solid, texture.size = size;
    texture.colors[0] = rtt_v(0.1f, 0.2f, 0.9f), texture.colors[1] = rtt_v(0.9f, 0.8f, 0.3f);
    return texture;
}

/* Every level is the mean of what it stands for, whatever the size of the image; so all have one mean. */
static void rtt_test_texture_levels(void)
{
    static const int sizes[][2] = { { 1, 1 }, { 2, 2 }, { 8, 8 }, { 16, 2 }, { 1, 9 }, { 7, 5 }, { 100, 37 }, { 33, 1 } };
    rtt_random random = rtt_stream();

    for (size_t i = 0; i < RTT_COUNT(sizes); i++) {
        int width = sizes[i][0], height = sizes[i][1];
        size_t count = (size_t)width * (size_t)height, all = rt_count_texture_levels(width, height), at = 0;
        rt_vec3 *pixels = (rt_vec3 *)rtt_array(count, sizeof *pixels), *levels = (rt_vec3 *)rtt_array(all + 1, sizeof *levels);
        double mean = 0;

        for (size_t k = 0; k < count; k++) {
            pixels[k] = rtt_point(&random, rtt_v(0.5f, 0.5f, 0.5f), 0.5f);
            mean += (double)pixels[k].x / (double)count;
        }
        levels[all] = rtt_v(-7, -7, -7);
        rt_make_texture_levels(pixels, width, height, levels);
        CHECK(memcmp(pixels, levels, count * sizeof *pixels) == 0 && levels[all].x == -7);
        while (at < all) {
            double sum = 0;

            for (int k = 0; k < width * height; k++)
                sum += (double)levels[at + (size_t)k].x / (width * height);
            CHECK(fabs(sum - mean) < 1e-5);
            at += (size_t)width * (size_t)height;
            width = width > 1 ? width / 2 : 1, height = height > 1 ? height / 2 : 1;
        }
        CHECK(at == all);
        free(pixels);
        free(levels);
    }
    CHECK(!rt_count_texture_levels(0, 4) && !rt_count_texture_levels(4, -1) && !rt_count_texture_levels(16385, 1)
          && rt_count_texture_levels(16384, 16384) == ((size_t)4 << 28) / 3 + 0);
}

/* What is seen of a spot equals the mean of many points of it, within what the filter's shape may differ. */
static void rtt_test_texture_filter(void)
{
    rtt_random random = rtt_stream();
    rt_vec3 *pixels = (rt_vec3 *)rtt_array(64 * 64, sizeof *pixels), *levels = (rt_vec3 *)rtt_array(rt_count_texture_levels(64, 64), sizeof *levels);

    for (int i = 0; i < 64 * 64; i++)
        pixels[i] = rtt_mul(rtt_v(1, 1, 1), (i / 64 / 8 + i % 64 / 8) % 2 ? 0.9f : 0.2f);
    rt_make_texture_levels(pixels, 64, 64, levels);
    for (int kind = 0; kind < RT_TEXTURE_COUNT; kind++) {
        double worst = 0, sum = 0;

        for (int i = 0; i < 300; i++) {
            rt_texture texture = rtt_texture((rt_texture_kind)kind, false, kind == RT_TEXTURE_CHECKER ? 0.125f : 0.5f);
            float width = powf(2, -1 - 7 * (0.5f + 0.5f * rtt_signed(&random))), long_axis = width * (float)(1 + 3 * (i % 3));
            rti_spot spot, point;
            double mean = 0;
            rt_vec3 seen;

            texture.levels = levels, texture.width = texture.height = 64;
            if (kind == RT_TEXTURE_IMAGE)
                texture.size = 0;
            memset(&spot, 0, sizeof spot);
            spot.at[0] = 3 * rtt_signed(&random), spot.at[1] = 3 * rtt_signed(&random);
            spot.axes[0][i % 2] = long_axis, spot.axes[1][1 - i % 2] = width;
            for (int k = 0; k < 2 && kind == RT_TEXTURE_IMAGE; k++)
                spot.axes[0][k] *= 64, spot.axes[1][k] *= 64;
            seen = rti_look_at_texture(&texture, &spot);
            for (int k = 0; k < 4096; k++) {
                point = spot;
                memset(point.axes, 0, sizeof point.axes);
                point.at[i % 2] += long_axis * (((float)(k % 64) + 0.5f) / 64 - 0.5f);
                point.at[1 - i % 2] += width * (((float)(k / 64) + 0.5f) / 64 - 0.5f);
                point.axes[0][0] = point.axes[1][1] = 1e-5f;
                mean += (double)rti_look_at_texture(&texture, &point).x / 4096;
            }
            worst = fmax(worst, fabs((double)seen.x - mean));
            sum += fabs((double)seen.x - mean) / 300;
        }
        if (!(worst < (kind == RT_TEXTURE_CHECKER ? 0.02 : 0.25) && sum < (kind == RT_TEXTURE_CHECKER ? 0.004 : 0.05)))
            rtt_fail("texture %d: off by %g at most, %g on average", kind, worst, sum);
    }
    for (int kind = 0; kind < RT_TEXTURE_COUNT; kind++)            /* a huge spot has the mean; odd coordinates are colours too */
        for (int i = 0; i < 200; i++) {
            rt_texture texture = rtt_texture((rt_texture_kind)kind, kind != RT_TEXTURE_IMAGE && i % 2, 1);
            float far = i % 5 == 4 ? 1e30f : powf(10, (float)(i % 12) - 4);
            rti_spot spot;
            rt_vec3 seen;

            texture.levels = levels, texture.width = texture.height = 64;
            memset(&spot, 0, sizeof spot);
            for (int k = 0; k < 3; k++)
                spot.at[k] = far * rtt_signed(&random);
            spot.axes[0][0] = i % 3 ? 1e6f : 1e-4f, spot.axes[1][1] = i % 3 == 1 ? 1e6f : 1e-4f;
            seen = rti_look_at_texture(&texture, &spot);
            CHECK(seen.x >= 0 && seen.x <= 1 && seen.y >= 0 && seen.z >= 0);
            if (i % 3 == 1)
                CHECK(fabsf(seen.x - (kind == RT_TEXTURE_IMAGE ? 0.55f : 0.5f)) < 2e-3f);
        }
    free(pixels);
    free(levels);
}

/* A chequered floor to the horizon, looked at along its fields and across their corners: one sample a pixel is near the mean of 16 x 16 points of it, which a
   point is not. So of a camera that moves by parts of a pixel it changes little more than that mean does. Far away it has the mean colour. */
static void rtt_test_texture_shimmer(void)
{
    enum { SIDE = 64, VIEWS = 5, HORIZON = 6 };                    /* rows above the middle that see but ground */
    static rt_vec3 pixels[SIDE * SIDE];
    rt_texture texture = rtt_texture(RT_TEXTURE_CHECKER, false, 1);

    for (int turn = 0; turn < 3; turn++) {
        const float angle = 0.785398f * 0.5f * (float)turn;
        double error[2] = { 0, 0 }, spread[3] = { 0, 0, 0 };
        float low[3][SIDE * SIDE], high[3][SIDE * SIDE];
        rt_render_options options;
        rtt_stage stage;

        memset(&stage, 0, sizeof stage);
        memset(&options, 0, sizeof options);
        stage.materials[0] = rtt_material(rtt_gray(1), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
        stage.materials[0].texture = &texture;
        rtt_ground(&stage.model, rtt_origin, rtt_v(0, 1, 0), 0);
        rtt_stage_build(&stage);
        stage.scene.ambient = rtt_gray(1);
        options.width = options.height = SIDE;
        for (int i = 0; i < VIEWS; i++) {
            stage.scene.camera = (rt_camera){ { 0.31f, 1, 0.2f }, { 0.31f + sinf(angle), 0.9f, 0.2f - cosf(angle) }, { 0, 1, 0 }, 50 };
            stage.scene.camera.look.x += 0.003f * (float)i, stage.scene.camera.look.y += 0.002f * (float)i;
            CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels, NULL), RT_OK);
            for (int k = (SIDE / 2 - HORIZON + 2) * SIDE; k < SIDE * SIDE * 3 / 4; k++) {
                float seen[3] = { pixels[k].x, 0, 0 };             /* filtered, a point, the mean of points */

                for (int n = 0; n <= 256; n++) {
                    const float dx = n ? ((float)((n - 1) % 16) + 0.5f) / 16 : 0.5f, dy = n ? ((float)((n - 1) / 16) + 0.5f) / 16 : 0.5f;
                    rt_ray ray = rt_camera_ray(&stage.scene.camera, (float)(k % SIDE) + dx, (float)(k / SIDE) + dy, SIDE, SIDE);
                    rt_hit hit;
                    int x, z;

                    CHECK(rt_intersect(stage.accel, &ray, &hit));
                    x = (int)floorf(ray.org.x + hit.t * ray.dir.x), z = (int)floorf(-ray.org.z - hit.t * ray.dir.z);
                    seen[n ? 2 : 1] += ((x + z) % 2 ? 0.9f : 0.1f) / (n ? 256 : 1);
                }
                for (int w = 0; w < 3; w++) {
                    low[w][k] = i ? fminf(low[w][k], seen[w]) : seen[w];
                    high[w][k] = i ? fmaxf(high[w][k], seen[w]) : seen[w];
                    spread[w] += i == VIEWS - 1 ? (double)(high[w][k] - low[w][k]) : 0;
                    error[w & 1] += w < 2 ? fabs((double)(seen[w] - seen[2])) : 0;
                }
            }
            for (int k = (SIDE / 2 - HORIZON) * SIDE; k < (SIDE / 2 - HORIZON + 1) * SIDE; k++)
                CHECK(fabsf(pixels[k].x - 0.5f) < 0.06f);
        }
        if (!(error[0] < 0.12 * error[1] && spread[0] < 1.05 * spread[2] && spread[1] > 2 * spread[0]))
            rtt_fail("turned by %d: errors %g, of points %g; changes %g, of points %g, of their means %g", turn, error[0], error[1], spread[0],
                     spread[1], spread[2]);
        rtt_stage_free(&stage);
    }
}

/* A raised sphere, its normal by bump mapping against that of the surface which really stands there: the gradient of the height, by differences. */
static void rtt_test_bump(void)
{
    rt_texture texture = rtt_texture(RT_TEXTURE_NOISE, true, 0.7f);
    rtt_random random = rtt_stream();
    rt_material material;
    double worst = 0, tilt = 0;

    memset(&material, 0, sizeof material);
    texture.colors[0] = rtt_gray(0), texture.colors[1] = rtt_gray(1);
    material.bump = &texture, material.bump_height = 0.05f;
    for (int i = 0; i < 500; i++) {
        const rt_vec3 n = rti_normalize(rtt_point(&random, rtt_origin, 1));
        const float e = 0.03f;             /* more than the least step, a 32nd of a wave */
        rt_vec3 steps[2], x, y, truth = n, bumped;
        rti_mapping m = rti_map_sphere(n);

        rti_frame(n, &x, &y);
        steps[0] = rti_scale(x, e), steps[1] = rti_scale(y, e);
        for (int k = 0; k < 2; k++) {
            const rt_vec3 along = k ? y : x, a = rti_add(n, rti_scale(along, e / 2)), b = rti_sub(n, rti_scale(along, e / 2));
            const float pa[3] = { a.x / 0.7f, a.y / 0.7f, a.z / 0.7f }, pb[3] = { b.x / 0.7f, b.y / 0.7f, b.z / 0.7f };

            truth = rti_sub(truth, rti_scale(along, 0.05f * (rti_noise(pa, e / 0.7f) - rti_noise(pb, e / 0.7f)) / e));
        }
        truth = rti_normalize(truth);
        bumped = rti_bump(&material, &m, n, n, steps);
        worst = fmax(worst, (double)rti_largest(rti_sub(truth, bumped)));
        tilt += (double)(1 - rti_dot(n, bumped)) / 500;
        CHECK(fabsf(rti_dot(bumped, bumped) - 1) < 1e-5f);
        steps[0] = rti_scale(x, 50), steps[1] = rti_scale(y, 50);       /* far away: waves too short to be seen */
        CHECK(rti_dot(n, rti_bump(&material, &m, n, n, steps)) > 0.9999f);
    }
    if (!(worst < 1e-4 && tilt > 5e-4))
        rtt_fail("normals are off by %g, and tilted by %g", worst, tilt);
}

/* Texture coordinates: of spheres all around, of triangles those given or the weights, in space steps are those of the coordinates. */
static void rtt_test_texture_mapping(void)
{
    const float uv[] = { 0, 0, 2, 0, 0, 3 };
    const uint32_t given[] = { 0, 1, 2 }, none[] = { RT_NONE, 0, 0 };
    rtt_random random = rtt_stream();
    rti_shape seen;
    rt_hit hit;
    rti_mapping m;

    memset(&seen, 0, sizeof seen);
    memset(&hit, 0, sizeof hit);
    m = rti_map_sphere(rtt_v(2, 0, 0));
    CHECK(m.u == 0.5f && m.v == 0.5f);
    m = rti_map_sphere(rtt_v(0, 3, 0));
    CHECK(m.v == 1 && m.u >= 0 && m.u <= 1 && isfinite(m.across[0].x));
    m = rti_map_sphere(rtt_v(0, 0, 1));
    CHECK(fabsf(m.u - 0.75f) < 1e-6f);
    for (int i = 0; i < 300; i++) {         /* a small step changes u and v as across says */
        rt_vec3 p = rti_scale(rti_normalize(rtt_point(&random, rtt_origin, 1)), 2), x, y, step;
        rti_mapping a, b;

        if (fabsf(p.y) > 1.8f || p.x < -1.8f)
            continue;
        rti_frame(rti_scale(p, 0.5f), &x, &y);
        step = rti_scale(rti_add(rti_scale(x, rtt_signed(&random)), rti_scale(y, rtt_signed(&random))), 0.004f);
        a = rti_map_sphere(p), b = rti_map_sphere(rti_add(p, step));
        CHECK(fabsf(b.u - a.u - rti_dot(step, a.across[0])) < 1e-5f && fabsf(b.v - a.v - rti_dot(step, a.across[1])) < 1e-5f);
    }
    seen.texcoords = uv, seen.texcoord_indices = given;
    hit.u = 0.25f, hit.v = 0.5f;
    m = rti_map_triangle(&seen, &hit, rtt_v(4, 0, 0), rtt_v(1, 2, 0));
    CHECK(m.u == 0.5f && m.v == 1.5f);
    CHECK(fabsf(rti_dot(m.across[0], rtt_v(4, 0, 0)) - 2) < 1e-6f && fabsf(rti_dot(m.across[1], rtt_v(4, 0, 0))) < 1e-6f
          && fabsf(rti_dot(m.across[0], rtt_v(1, 2, 0))) < 1e-6f && fabsf(rti_dot(m.across[1], rtt_v(1, 2, 0)) - 3) < 1e-6f);
    seen.texcoord_indices = none;
    m = rti_map_triangle(&seen, &hit, rtt_v(4, 0, 0), rtt_v(1, 2, 0));
    CHECK(m.u == 0.25f && m.v == 0.5f);
    m = rti_map_plane(rtt_v(0, 7, 0), rtt_v(3, 0, -4));
    CHECK(m.u == 3 && m.v == 4);
}

static void rtt_test_texture_check(void)
{
    static const char *const words[] = { "kind", "size", "size", "color", "0 x 8", "without levels", "solid", "bump_height", "texcoord" };
    rtt_stage stage;
    rt_error error;

    memset(&stage, 0, sizeof stage);
    rtt_stage_quad(&stage, rtt_v(-1, 0, -1), rtt_v(0, 0, 2), rtt_v(2, 0, 0), 1);
    rtt_stage_build(&stage);
    for (int i = 0; i < 9; i++) {
        rt_texture texture = rtt_texture(i >= 4 && i < 7 ? RT_TEXTURE_IMAGE : RT_TEXTURE_NOISE, false, 1);
        rt_vec3 level[200];
        float uv[2] = { 0, 0 };

        texture.width = texture.height = 8, texture.levels = level;
        if (i == 0) texture.kind = (rt_texture_kind)77;
        if (i == 1) texture.size = -1;
        if (i == 2) texture.size = NAN;
        if (i == 3) texture.colors[1].y = -1;
        if (i == 4) texture.width = 0;
        if (i == 5) texture.levels = NULL;
        if (i == 6) texture.solid = true;
        memset(&stage.materials[2], 0, sizeof stage.materials[2]);
        stage.materials[2].texture = i % 2 ? &texture : NULL;
        stage.materials[2].bump = i % 2 ? NULL : &texture;
        stage.materials[2].bump_height = i == 7 ? INFINITY : 0;
        stage.scene.texcoords = i == 8 ? uv : NULL;
        CHECK_STATUS(rt_check_scene(&stage.scene, &error), RT_ERROR_ARGUMENT);
        if (!strstr(error.message, words[i]) || (i < 8 && !strstr(error.message, "material 2")))
            rtt_fail("%d: %s", i, error.message);
    }
    rtt_stage_free(&stage);
}

/* The same picture from any algorithm and tile, with textures on meshes, spheres and planes, and within instances. */
static void rtt_test_texture_ways(void)
{
    enum { WIDTH = 33, HEIGHT = 29, PIXELS = WIDTH * HEIGHT };
    static rt_vec3 want[PIXELS], got[PIXELS];
    rt_texture checker = rtt_texture(RT_TEXTURE_CHECKER, false, 0.5f), noise = rtt_texture(RT_TEXTURE_NOISE, true, 0.3f);
    rtt_model child = { 0 };
    rtt_stage stage;
    rtt_accels accels;
    rt_scene part;
    rt_geometry inner;
    const rt_scene *parts[1] = { &part };
    rt_render_options options;

    memset(&stage, 0, sizeof stage);
    memset(&part, 0, sizeof part);
    stage.materials[0] = rtt_material(rtt_v(0.6f, 0.5f, 0.4f), rtt_gray(0), rtt_gray(0.3f), rtt_gray(0), 0, false);
    stage.materials[0].texture = &checker, stage.materials[0].bump = &noise, stage.materials[0].bump_height = 0.05f;
    rtt_ground(&stage.model, rtt_origin, rtt_v(0, 1, 0), 0);
    rtt_quad(&stage.model, rtt_v(-2, 0, -1), rtt_v(4, 0, 0), rtt_v(0, 2, -0.5f));
    rtt_ball(&stage.model, rtt_v(1, 0.6f, 0.5f), 0.6f);
    rtt_ball(&child, rtt_origin, 0.4f);
    rtt_place(&stage.model, &child, rtt_v(1, 2, 1), rtt_v(-1, 0.8f, 0.5f));
    inner = rtt_geometry(&child);
    part.accel = child.accel, part.geometry = &inner, part.materials = &stage.materials[0], part.material_count = 1;
    stage.scene.parts = parts;
    rtt_stage_build(&stage);
    stage.light.position = rtt_v(3, 8, 5), stage.light.color = rtt_gray(0.8f), stage.scene.light_count = 1;
    stage.scene.ambient = rtt_gray(0.2f);
    stage.scene.camera = (rt_camera){ { 1, 2, 5 }, { 0, 0.7f, 0 }, { 0, 1, 0 }, 45 };
    memset(&options, 0, sizeof options);
    options.width = WIDTH, options.height = HEIGHT, options.depth = 3;
    CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, WIDTH, HEIGHT, want, NULL), RT_OK);
    if (!rtt_accels_build(&accels, &stage.model))
        rtt_die("a stage does not build");
    for (size_t w = 0; w < rtt_way_count; w += rtt_ways[w].large ? 7 : 1) {
        memset(got, 0xff, sizeof got);
        options.trace = rtt_ways[w].options;
        stage.scene.accel = rtt_accels_for(&accels, &rtt_ways[w]);
        for (int y = 0; y < HEIGHT; y += 17)
            for (int x = 0; x < WIDTH; x += 13)
                CHECK_STATUS(rt_render_tile(&stage.scene, &options, x, y, x + 13 < WIDTH ? x + 13 : WIDTH, y + 17 < HEIGHT ? y + 17 : HEIGHT,
                                            got, NULL), RT_OK);
        if (memcmp(want, got, sizeof want) != 0)
            rtt_fail("%s: another picture", rtt_ways[w].label);
    }
    stage.scene.accel = stage.accel;
    rtt_accels_free(&accels);
    rtt_stage_free(&stage);
    rtt_model_free(&child);
}

/* An instance stretched unevenly looks as a mesh does that is so of its own: its footprints and its bumps are those of the world. */
static void rtt_test_texture_instances(void)
{
    enum { SIDE = 48, PIXELS = SIDE * SIDE };
    static const rt_vec3 scale = { 3, 1, 40 };
    static rt_vec3 pixels[2][2][PIXELS];    /* texture or bump; mesh or instance */
    rt_texture checker = rtt_texture(RT_TEXTURE_CHECKER, false, 0.02f), noise = rtt_texture(RT_TEXTURE_NOISE, false, 0.05f);

    for (int kind = 0; kind < 2; kind++) {
        double off = 0, most = 0, contrast = 0;

        for (int way = 0; way < 2; way++) {
            rtt_model child = { 0 };
            rtt_stage stage;
            rt_scene part;
            rt_geometry inner;
            const rt_scene *parts[1] = { &part };
            rt_render_options options;

            memset(&stage, 0, sizeof stage);
            memset(&part, 0, sizeof part);
            memset(&options, 0, sizeof options);
            stage.materials[0] = rtt_material(rtt_gray(0.9f), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
            if (kind) stage.materials[0].bump = &noise, stage.materials[0].bump_height = 0.2f;
            else stage.materials[0].texture = &checker;
            rtt_quad(way ? &child : &stage.model, rtt_v(-1, 0, -1), rtt_v(0, 0, 2), rtt_v(2, 0, 0));
            if (way) {
                rtt_place(&stage.model, &child, scale, rtt_origin);
                inner = rtt_geometry(&child);
                part.accel = child.accel, part.geometry = &inner, part.materials = &stage.materials[0], part.material_count = 1;
                stage.scene.parts = parts;
            } else {
                for (size_t i = 0; i < stage.model.vertex_count; i++)
                    stage.model.vertices[3 * i] *= scale.x, stage.model.vertices[3 * i + 2] *= scale.z;
            }
            rtt_stage_build(&stage);
            stage.light.position = rtt_v(-2, 3, 30), stage.light.color = rtt_gray(1), stage.scene.light_count = 1;
            stage.scene.camera = (rt_camera){ { 0.4f, 1, 39 }, { 0, 0.4f, 30 }, { 0, 1, 0 }, 35 };
            options.width = options.height = SIDE;
            CHECK_STATUS(rt_render_tile(&stage.scene, &options, 0, 0, SIDE, SIDE, pixels[kind][way], NULL), RT_OK);
            rtt_stage_free(&stage);
            rtt_model_free(&child);
        }
        for (int i = 0; i < PIXELS; i++) {
            const double difference = fabs((double)(pixels[kind][0][i].x - pixels[kind][1][i].x));

            off += difference / PIXELS;
            most = fmax(most, difference);
            contrast += i ? fabs((double)(pixels[kind][0][i].x - pixels[kind][0][i - 1].x)) / PIXELS : 0;
        }
        if (!(off < (kind ? 0.004 : 1e-4) && most < (kind ? 0.06 : 1e-3) && contrast > (kind ? 0.006 : 0.02)))
            rtt_fail("%s: %g off on average, %g at most; neighbours differ by %g", kind ? "bump" : "texture", off, most, contrast);
    }
}

static void rtt_test_obj_textures(void)
{
    static const char square[] = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1 0\nvt 0.25 nan\nusemtl m\n";
    char text[1024];

    loader_write("t.ppm", "P6\n2 1\n255\n\xff\xff\xff" "abc");
    loader_write("a.mtl", "newmtl m\nKd 1 1 1\nmap_Kd t.ppm\nbump -bm 0.5 t.ppm\n");
    snprintf(text, sizeof text, "%sf 1/1 2/2 3/3 4/4\nf 1 2 3\nf -4/-4 -3/-3 -2/-2\n", square);
    if (loader_text("t.obj", text, 4, 4, 0, 3)) {
        const rt_material *m = loader_material(0);

        CHECK(loader.s.texture_count == 2 && m->texture == loader.s.textures && m->bump == m->texture + 1 && m->bump_height == 0.5f);
        CHECK(fabsf(m->bump->levels[1].x - 97 / 255.0f) < 1e-6f && fabsf(m->texture->levels[1].x - 0.11954f) < 1e-4f);     /* 'a': not sRGB; sRGB */
        CHECK(m->texture->kind == RT_TEXTURE_IMAGE && m->texture->width == 2 && m->texture->height == 1 && m->texture->levels[0].x == 1);
        CHECK(loader.s.texcoord_indices && loader.s.texcoord_indices[5] == 3 && loader.s.texcoord_indices[6] == RT_NONE
              && loader.s.texcoord_indices[9] == 0 && loader.s.texcoord_indices[11] == 2);
        CHECK(loader.s.texcoords[4] == 1 && loader.s.texcoords[6] == 0.25f && loader.s.texcoords[7] == 0);
        loader_unload();
    }
    loader_write("a.mtl", "newmtl m\nmap_Kd -s 2 2 -clamp on -o 0.5 t.ppm\n");      /* three options that are not supported */
    if (loader_text("t.obj", text, 4, 4, 0, 3)) {
        CHECK(loader.s.warnings == 3 && loader_material(0)->texture && strstr(loader.s.warning, "a.mtl:2: map_Kd: -s is not supported"));
        loader_unload();
    }
    {
        static const struct { const char *mtl, *ppm, *error; } bad[] = {
            { "map_Kd missing.ppm", NULL, "missing.ppm: cannot read it" }, { "map_Kd u.ppm", "P6\n2 2\n255\nabc", "ends too early" },
            { "bump u.ppm", "P5\n1 1\n255\n1", "not a P3 or P6 picture" }, { "map_Bump u.ppm", "", "not a P3 or P6 picture" },
            { "map_Kd u.ppm", "P6\n0 5\n255\nabcabc", "not a P3 or P6 picture" }, { "map_Kd u.ppm", "P3 1 1 5 1 6 2", "a number above its greatest" },
            { "bump u.ppm", "P3 1 1 5 1 y 2", "no number" }, { "map_Kd -s", NULL, "-s lacks its number" },
        };

        for (size_t i = 0; i < RTT_COUNT(bad); i++) {
            char mtl[128];

            snprintf(mtl, sizeof mtl, "newmtl m\n%s\n", bad[i].mtl);
            loader_write("a.mtl", mtl);
            if (bad[i].ppm)
                loader_write("u.ppm", bad[i].ppm);
            loader_write("t.obj", text);
            if (loader_load(loader_path("t.obj"))) {
                rtt_fail("%s loads", bad[i].mtl);
                loader_unload();
            } else if (!strstr(loader.error.message, "a.mtl:2: ") || !strstr(loader.error.message, bad[i].error))
                rtt_fail("%s: %s", bad[i].mtl, loader.error.message);
        }
    }
    loader_clear();
}

/* ---- >>threaded: the stackless hierarchy ---------------------------------------------------------------------------- */

static void rtt_test_threaded_options(void)
{
    static const struct { rt_build_options options; const char *word; } bad[] = {
        { { .structure = RT_THREADED, .branching = 1 }, "branching is 1" }, { { .structure = RT_THREADED, .branching = -4 }, "branching" },
        { { .structure = RT_THREADED, .branching = RT_MAX_BRANCHING + 1 }, "branching is 17" }, { { .structure = RT_THREADED, .orders = 3 }, "orders is 3" },
        { { .structure = RT_THREADED, .orders = -1 }, "orders" }, { { .structure = RT_THREADED, .throw_back = 1.5f }, "throw_back is 1.5" },
        { { .structure = RT_THREADED, .throw_back = NAN }, "throw_back" }, { { .structure = RT_THREADED, .bounds = (rt_bounds)9 }, "bounds 9" },
    };
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rt_geometry geometry;
    rt_accel *accel;
    rt_error error;

    rtt_cloud(&model, &random, 500, rtt_origin, 1, 0.2f);
    geometry = rtt_geometry(&model);
    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        rt_build_options options = bad[i].options;

        options.error = &error;
        CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_ERROR_ARGUMENT);
        CHECK(accel == NULL && strstr(error.message, bad[i].word) != NULL);
    }
    for (int branching = 2; branching <= RT_MAX_BRANCHING; branching++) {       /* no wider than asked for, and that wide where it is forced to */
        rt_build_options options;
        size_t widest = 0;

        memset(&options, 0, sizeof options);
        options.structure = RT_THREADED, options.branching = branching, options.throw_back = 1e-6f;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            continue;
        for (uint32_t i = 0; i < accel->node_count; i++) {
            size_t children = 0;

            for (uint32_t c = accel->links[i].hit; !accel->nodes[i].count && c != accel->links[i].miss; c = accel->links[c].miss)
                children++;
            widest = children > widest ? children : widest;
        }
        CHECK(widest == (size_t)branching);
        rt_free(accel);
    }
    for (int k = 0; k < 40; k++) {          /* rays together: 2, 4, 8, 16 */
        rt_trace_options trace;
        const bool good = k == 0 || k == 2 || k == 4 || k == 8 || k == 16;

        memset(&trace, 0, sizeof trace);
        trace.algorithm = RT_THREADED_PARALLEL, trace.packet_width = k, trace.error = &error;
        if (!k) {
            rt_build_options options;

            memset(&options, 0, sizeof options);
            options.structure = RT_THREADED;
            CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK);
        }
        CHECK_STATUS(rt_trace(accel, &trace, NULL, 0, NULL), good ? RT_OK : RT_ERROR_ARGUMENT);
        CHECK(good || strstr(error.message, "2, 4, 8, 16"));
    }
    rt_free(accel);
    rtt_model_free(&model);
}

/* A walk that tested too much would find the same hits: what it looks at is counted. Bounds cull, the links of a ray's directions come near first, and rays
   that go together share nodes. */
static void rtt_test_threaded_stats(void)
{
    rtt_random random = rtt_stream();
    rtt_model model = { 0 };
    rtt_rays rays = { 0 };
    rt_geometry geometry;
    rt_hit *hits;
    double boxes[4][2], prims[4][2];

    rtt_cloud(&model, &random, 4000, rtt_origin, 1, 0.05f);
    geometry = rtt_geometry(&model);
    rtt_rays_pinhole(&rays, rtt_v(0.5f, 0.7f, 3), rtt_origin, 1, 48);     /* against the order of a single list */
    hits = (rt_hit *)rtt_array(rays.count, sizeof *hits);
    for (int way = 0; way < 4; way++) {     /* a BVH, boxes, boxes with one list, spheres */
        rt_build_options options;
        rt_accel *accel;

        memset(&options, 0, sizeof options);
        options.structure = way ? RT_THREADED : RT_BVH;
        options.orders = way == 2 ? 1 : 0;
        options.bounds = way == 3 ? RT_BOUNDS_SPHERES : RT_BOUNDS_BOXES;
        if (!CHECK_STATUS(rt_build(&accel, &geometry, &options), RT_OK))
            continue;
        for (int any = 0; any < 2; any++) {
            rt_trace_options trace;
            rt_stats single, together;

            memset(&trace, 0, sizeof trace);
            memset(&single, 0, sizeof single);
            memset(&together, 0, sizeof together);
            trace.query = any ? RT_ANY : RT_CLOSEST;
            trace.algorithm = way ? RT_THREADED_SINGLE : RT_BVH_STACK;
            trace.stats = &single;
            CHECK_STATUS(rt_trace(accel, &trace, rays.ray, rays.count, hits), RT_OK);
            CHECK(single.rays == rays.count);
            boxes[way][any] = (double)single.boxes / (double)rays.count, prims[way][any] = (double)single.prims / (double)rays.count;
            if (way) {
                CHECK(single.nodes + single.leaves <= single.boxes && single.pushes == 0 && single.restarts == 0);
                trace.algorithm = RT_THREADED_PARALLEL, trace.stats = &together;
                for (int k = 2; k <= 16; k *= 2) {
                    trace.packet_width = k;
                    memset(&together, 0, sizeof together);
                    CHECK_STATUS(rt_trace(accel, &trace, rays.ray, rays.count, hits), RT_OK);
                    if (together.rays != rays.count || (double)together.boxes < 0.95 * (double)single.boxes || together.boxes > 4 * single.boxes)
                        rtt_fail("way %d, %d rays together: %g boxes a ray, singly %g", way, k, (double)together.boxes / (double)rays.count,
                                 boxes[way][any]);
                    CHECK(together.active <= (uint64_t)k * together.steps);
                }
            }
        }
        rt_free(accel);
    }
    for (int any = 0; any < 2; any++) {
        CHECK(boxes[1][any] < 1.1 * boxes[0][any] && prims[1][any] < 1.1 * prims[0][any]);
        CHECK(boxes[3][any] < 4 * boxes[0][any] && prims[3][any] < 4 * prims[0][any]);
    }
    if (!(boxes[2][0] > 1.1 * boxes[1][0]))
        rtt_fail("one list: %g boxes a ray, eight: %g", boxes[2][0], boxes[1][0]);
    free(hits);
    rtt_model_free(&model);
    rtt_rays_free(&rays);
}

/* Instances in threaded trees, some in a stack's, in all nestings, entered and left: by every number of rays at a time. The same subtree twice in one
   leaf, tiny and empty ones, and rays that are legal in some of them only. */
static void rtt_test_threaded_nested(void)
{
    rtt_random random = rtt_stream();

    for (int round = 0; round < 3; round++) {
        rtt_model level[5];
        rtt_rays rays = { 0 };
        float matrix[12];

        memset(level, 0, sizeof level);
        for (int k = 0; k < 5; k++) {
            level[k].structure = round % 3 == 2 && k % 2 ? RT_BVH : RT_THREADED;
            rtt_cloud(&level[k], &random, 6, rtt_origin, 1, 0.5f);
            rtt_ball(&level[k], rtt_point(&random, rtt_origin, 1), 0.2f);
            for (int i = 0; k && i < 3; i++) {
                rtt_matrix(&random, 0.7f, rtt_point(&random, rtt_origin, 0.6f), matrix);
                rtt_instance(&level[k], &level[i == 2 && k > 1 ? k - 2 : k - 1], matrix);
                if (i == 1)                 /* the same again */
                    rtt_instance(&level[k], &level[k - 1], matrix);
            }
            if (k == 2)
                rtt_place(&level[k], &level[0], rtt_v(1e-25f, 1e-25f, 1e-25f), rtt_origin);
        }
        rtt_rays_mixed(&rays, &random, rtt_origin, 2, 100);
        for (size_t i = 0; i < rays.count; i += 7)         /* too long or short in the tiny one */
            rays.ray[i].dir = rti_scale(rays.ray[i].dir, i % 2 ? 1e8f : 1e-8f);
        rtt_check("threaded nested", &level[4], &rays);
        for (int k = 4; k >= 0; k--)
            rtt_model_free(&level[k]);
        rtt_rays_free(&rays);
    }
}

/* ---- >>imp: the character, and the program that moves it ------------------------------------------------------------ */

static void rtt_test_imp(void)
{
    const rt_geometry *g = &loader.s.geometry;
    size_t open = 0;

    if (!loader_load("examples/imp.obj")) {
        rtt_fail("%s", loader.error.message);
        return;
    }
    CHECK(g->triangle_count == 882 && loader.s.shapes == 882 && g->sphere_count == 0 && loader.s.warnings == 0 && loader.s.material_count == 3);
    CHECK(loader.s.normals && loader.s.normal_indices);
    for (size_t i = 0; i < 3 * g->triangle_count; i++) {   /* every edge comes back the other way, once: closed */
        const uint32_t a = g->indices[i], b = g->indices[i / 3 * 3 + (i + 1) % 3];
        size_t back = 0, same = 0;

        for (size_t j = 0; j < 3 * g->triangle_count; j++) {
            const uint32_t c = g->indices[j], d = g->indices[j / 3 * 3 + (j + 1) % 3];

            back += c == b && d == a;
            same += c == a && d == b;
        }
        open += back != 1 || same != 1;
    }
    CHECK(open == 0);
    for (size_t i = 0; i < g->vertex_count; i++)
        CHECK(g->vertices[3 * i + 1] >= 0 && g->vertices[3 * i + 1] < 2.3f && fabsf(g->vertices[3 * i]) < 1.2f);
    loader_unload();
}

/* A program that make builds before it runs the tests. */
static bool rtt_has_program(const char *name)
{
    char path[64];

    snprintf(path, sizeof path, "build/%s", name);
    if (access(path, X_OK) == 0)
        return true;
    rtt_fail("%s is not there: make builds it", path);
    return false;
}

/* Runs a command and answers its exit status; what it says goes to a file of the loader's folder. */
static int rtt_run_program(const char *program, const char *arguments, char *said, size_t size)
{
    char command[2048];
    FILE *file;
    size_t n = 0;
    int status;

    snprintf(command, sizeof command, "build/%s %s >'%s' 2>&1", program, arguments, loader_path("said"));
    status = system(command);
    file = fopen(loader_path("said"), "r");
    if (file)
        n = fread(said, 1, size - 1, file), fclose(file);
    said[n] = '\0';
    return status;
}

static int rtt_run(const char *arguments, char *said, size_t size) { return rtt_run_program("animate", arguments, said, size); }

static bool rtt_same_files(const char *a, const char *b)
{
    char command[2048], first[512];

    snprintf(first, sizeof first, "%s", loader_path(a));
    snprintf(command, sizeof command, "cmp -s '%s' '%s'", first, loader_path(b));
    return system(command) == 0;
}

static void rtt_test_animate(void)
{
    static const char *const bad[][2] = {
        { "--frames 0", "--frames '0'" }, { "--size 0x4", "--size" }, { "--spp 65537", "1 to 65536" }, { "--only shine", "--only" },
        { "--fps nan", "--fps" }, { "--first -1", "--first" }, { "--first 2147483647", "--first" }, { "--structure tree", "--structure" },
        { "--algorithm kd.best", "--algorithm" }, { "--sampler noise", "--sampler" }, { "--bogus", "unknown option" }, { "--spp", "needs a value" },
        { "--quiet=1", "takes no value" }, { "--instances -1", "--instances" }, { "--packet 7", "packet_width" },
        { "--structure kdtree --algorithm bvh.stack", "kdtree" }, { "--obj no/such.obj", "no/such.obj" },
    };
    char said[4096], command[2048], base[512];

    if (!rtt_has_program("animate"))
        return;
    snprintf(base, sizeof base, "%s", loader_path("a"));
    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        snprintf(command, sizeof command, "-o '%s' --size 8x8 --frames 1 --spp 1 %s", base, bad[i][0]);
        CHECK(rtt_run(command, said, sizeof said) != 0);
        if (!strstr(said, bad[i][1]))
            rtt_fail("animate %s: %s", bad[i][0], said);
        snprintf(command, sizeof command, "%s0000.ppm", base);
        CHECK(access(command, F_OK) != 0);
    }
    loader_write("broken.obj", "v 1 2 3\nf 1 2 3\n");
    snprintf(command, sizeof command, "-o '%s' --size 8x8 --obj '%s'", base, loader_path("broken.obj"));
    CHECK(rtt_run(command, said, sizeof said) != 0 && strstr(said, "broken.obj:2:"));
    CHECK(rtt_run("-o no/such/folder/x --size 8x8", said, sizeof said) != 0 && strstr(said, "no/such/folder/x"));

    /* a frame alone is that frame of the run; with any number of threads, any structure and algorithm */
    snprintf(command, sizeof command, "-o '%s' --size 40x30 --spp 2 --frames 3 --first 5 --instances 20 --threads 1", base);
    CHECK(rtt_run(command, said, sizeof said) == 0 && strstr(said, "update") && strstr(said, "with 0 allocations"));
    for (int way = 0; way < 4; way++) {
        static const char *const ways[] = { "--threads 3", "--threads 2 --structure threaded", "--structure kdtree", "--algorithm threaded.single" };

        snprintf(command, sizeof command, "-o '%sb' --size 40x30 --spp 2 --frames 1 --first 6 --instances 20 --quiet %s", base, ways[way]);
        CHECK(rtt_run(command, said, sizeof said) == 0 && said[0] == '\0');
        if (!rtt_same_files("a0006.ppm", "ab0006.ppm"))
            rtt_fail("animate %s: another frame", ways[way]);
    }
    if (!rtt.no_gpu) {
        snprintf(command, sizeof command, "-o '%sb' --size 40x30 --spp 2 --frames 2 --first 5 --instances 20 --quiet --gpu", base);
        CHECK(rtt_run(command, said, sizeof said) == 0 && said[0] == '\0');
        CHECK(rtt_same_files("a0005.ppm", "ab0005.ppm") && rtt_same_files("a0006.ppm", "ab0006.ppm"));
    }
    CHECK(!rtt_same_files("a0005.ppm", "a0006.ppm"));
    snprintf(command, sizeof command, "-o '%sb' --size 40x30 --spp 2 --frames 1 --first 6 --instances 20 --quiet --only none", base);
    CHECK(rtt_run(command, said, sizeof said) == 0 && !rtt_same_files("a0006.ppm", "ab0006.ppm"));
    loader_clear();
}

/* The part of the sky that vertex k of a triangle of the floor, x from the wall at its corners, sees: a wall of height 1 takes (1 - x / sqrt(x^2 + 1)) / 2. */
static void rtt_add_sky(const float x[3], int k, double *sky, double *weight)
{
    for (int i = 0; i < 200; i++)
        for (int j = 0; j < 200 - i; j++) {
            const double w[3] = { 1 - (i + j + 0.66) / 200, (i + 0.33) / 200, (j + 0.33) / 200 };
            const double at = w[0] * (double)x[0] + w[1] * (double)x[1] + w[2] * (double)x[2];

            *sky += w[k] * (1 + at / sqrt(at * at + 1)) / 2;
            *weight += w[k];
        }
}

/* Recipes of README.md are of examples/recipes.c to the letter, which finds each to answer as it should: with a device, and without. */
static void rtt_test_recipes(void)
{
    char *readme = rtt_read_project("README.md"), *recipes = rtt_read_project("examples/recipes.c"), said[4096];
    char *section = readme ? strstr(readme, "\n## Recipes\n") : NULL, *stop = section ? strstr(section + 1, "\n## ") : NULL;
    const char *device = getenv("RT_GPU_DEVICE");
    char *asked = device ? strdup(device) : NULL;
    int headings = 0, shown = 0;

    if (CHECK(recipes && stop)) {
        *stop = '\0';
        for (char *at = section; (at = strstr(at, "\n### ")) != NULL; at++)
            headings++;
        for (char *at = section; (at = strstr(at, "\n```c\n")) != NULL;) {
            char *start = at + 6, *end = strstr(start, "\n```");

            if (!CHECK(end != NULL))
                break;
            *end = '\0';
            if (!strstr(recipes, start))
                rtt_fail("not of recipes.c: %.60s", start);
            shown++;
            at = end + 1;
        }
        CHECK(shown == headings && shown > 0);
    }
    free(readme);
    free(recipes);
    for (int any = 0; any < (rtt.no_gpu ? 1 : 2) && rtt_has_program("recipes"); any++) {
        if (any == 0)
            setenv("RT_GPU_DEVICE", "none", 1);
        else if (asked)
            setenv("RT_GPU_DEVICE", asked, 1);
        else
            unsetenv("RT_GPU_DEVICE");
        if (rtt_run_program("recipes", "", said, sizeof said) != 0)
            rtt_fail("%s", said);
    }
    if (asked)
        setenv("RT_GPU_DEVICE", asked, 1);
    else
        unsetenv("RT_GPU_DEVICE");
    free(asked);
}

static void rtt_test_bake(void)
{
    static const char *const bad[][2] = {
        { "cornell --rays 0", "--rays" }, { "cornell --rays 4097", "1 to 4096" }, { "cornell --distance 0", "--distance" }, { "cornell --distance inf", "--distance" },
        { "cornell -o x.png", ".ply or .obj" }, { "cornell --bogus", "unknown option" }, { "cornell --seed", "needs a value" }, { "--quiet", "no scene" },
        { "cornell sphere:100", "two scenes" }, { "cornell --two-sided=1", "takes no value" }, { "no/such.obj", "no/such.obj" },
        { "cornell -o no/such/folder/x.ply", "no/such/folder/x.ply" }, { "b.obj -o b.obj", "is the scene" },
    };
    char said[4096], command[2048], base[512];
    double sky[2] = { 0, 0 }, weight[2] = { 0, 0 };

    if (!rtt_has_program("bake"))
        return;
    snprintf(base, sizeof base, "%s", loader_path("b"));
    loader_write("ball.nff", "f 1 1 1 1 0 0 0 1\ns 0 0 0 1\n");
    snprintf(command, sizeof command, "-o '%s.ply' '%s'", base, loader_path("ball.nff"));
    CHECK(rtt_run_program("bake", command, said, sizeof said) != 0 && strstr(said, "no triangles"));
    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        snprintf(command, sizeof command, "-o '%s.ply' %s", base, bad[i][0]);
        CHECK(rtt_run_program("bake", command, said, sizeof said) != 0);
        if (!strstr(said, bad[i][1]))
            rtt_fail("bake %s: %s", bad[i][0], said);
        CHECK(access(loader_path("b.ply"), F_OK) != 0);
    }

    /* a box sees nothing inside and all outside, whatever the threads */
    for (int inward = 0; inward < 2; inward++) {
        loader_write("box.obj", inward ? "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
                                         "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
                                       : "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
                                         "f 3 4 2 1\nf 6 8 7 5\nf 2 6 5 1\nf 7 8 4 3\nf 5 7 3 1\nf 4 8 6 2\n");
        for (int two = 0; two < 2; two++) {
            snprintf(command, sizeof command, "-o '%s.obj' '%s' --threads 3 --quiet%s", base, loader_path("box.obj"), two ? " --two-sided" : "");
            CHECK(rtt_run_program("bake", command, said, sizeof said) == 0 && said[0] == '\0');
            if (!CHECK(loader_load(loader_path("b.obj")) && loader.s.geometry.vertex_count == 8 && loader.s.geometry.triangle_count == 12 && loader.s.colors))
                return;
            for (size_t i = 0; i < 8; i++)
                CHECK(loader.s.colors[i].x == (inward && !two ? 0.0f : 1.0f));
            loader_unload();
        }
    }
    loader_write("broken.obj", "v 1 2 3\nf 1 2 3\nv x\n");       /* told once, and how many more */
    snprintf(command, sizeof command, "-o '%s9.ply' '%s'", base, loader_path("broken.obj"));
    CHECK(rtt_run_program("bake", command, said, sizeof said) != 0 && strstr(said, "(and 1 more)\n") && strchr(said, '\n')[1] == '\0');
    loader_write("poor.obj", "mtllib no.mtl\nv 1 2 3\nv 2 2 3\nv 2 1 3\nf 1 2 3\n");
    snprintf(command, sizeof command, "-o '%s9.ply' '%s' --rays 1", base, loader_path("poor.obj"));
    CHECK(rtt_run_program("bake", command, said, sizeof said) == 0 && strstr(said, "bake: warning: ") && strstr(said, "no.mtl"));
    for (int threads = 1; threads < 4; threads += 2) {
        snprintf(command, sizeof command, "-o '%s%d.ply' rings:1 --rays 32 --threads %d --seed 3", base, threads, threads);
        CHECK(rtt_run_program("bake", command, said, sizeof said) == 0 && strstr(said, "Mrays/s"));
    }
    CHECK(rtt_same_files("b1.ply", "b3.ply"));

    /* a long floor beside a wall of height 1: what its vertices are to see is known */
    loader_write("wall.obj", "v 0 -200 0\nv 2 -200 0\nv 2 200 0\nv 0 200 0\nv 0 -200 1\nv 0 200 1\nv 0 -200 0\nv 0 200 0\nf 1 2 3\nf 1 3 4\nf 7 8 6 5\n");
    snprintf(command, sizeof command, "-o '%s.obj' '%s' --rays 4096 --quiet", base, loader_path("wall.obj"));
    CHECK(rtt_run_program("bake", command, said, sizeof said) == 0);
    if (CHECK(loader_load(loader_path("b.obj")) && loader.s.colors)) {
        const float first[3] = { 0, 2, 2 }, second[3] = { 0, 2, 0 };

        rtt_add_sky(first, 0, &sky[0], &weight[0]);
        rtt_add_sky(second, 0, &sky[0], &weight[0]);
        rtt_add_sky(first, 1, &sky[1], &weight[1]);
        for (int k = 0; k < 2; k++)
            if (!CHECK(fabs((double)loader.s.colors[k].x - sky[k] / weight[k]) < 0.01))
                printf("    vertex %d: %g, not %g\n", k, (double)loader.s.colors[k].x, sky[k] / weight[k]);
        loader_unload();
    }
    loader_clear();
}

/* A lidar in a room, x -4 to 6, y 0 to 3, z -5 to 2, of which it is known what it is to measure; ball: of radius 0.5, the centre of what moves. */
typedef struct {
    const char *arguments;
    int channels, steps, sweeps;
    double low, high, rate, gate[2], from[3], way[3], axes[3][3];
    bool world, moves;
    double ball[3], roll[3];
} rtt_lidar;

typedef struct { double range, cosine, albedo; int face; bool doubtful; } rtt_pulse;      /* range 0: no return; face 6: the ball */

static rtt_pulse rtt_lidar_pulse(const rtt_lidar *l, const double org[3], const double dir[3], double part)
{
    static const double room[2][3] = { { -4, 0, -5 }, { 6, 3, 2 } };
    rtt_pulse p = { 1e30, 0, 0, 0, false };
    double b = 0, c = -0.25, sign;

    for (int face = 0; face < 6; face++) {                  /* y 0 3, x -4 6, z -5 2 */
        const int axis = face < 2 ? 1 : face < 4 ? 0 : 2;
        const double t = (room[face % 2][axis] - org[axis]) / dir[axis];

        if (t > 0 && t < p.range)
            p.range = t, p.face = face, p.cosine = fabs(dir[axis]);
    }
    p.albedo = 0.5;
    for (int i = 0; i < 3; i++) {
        const double to = l->ball[i] + l->roll[i] * part - org[i];

        b += to * dir[i], c += to * to;
    }
    if (l->moves) {
        p.doubtful = fabs(b * b - c) < 1e-3;
        for (sign = -1; sign <= 1; sign += 2) {
            const double t = b * b > c ? b + sign * sqrt(b * b - c) : 0;

            p.doubtful |= fabs(t - l->gate[0]) < 1e-4;
            if (t > l->gate[0] && t < p.range)
                p.range = t, p.face = 6, p.cosine = sqrt(b * b - c) / 0.5, p.albedo = 1;
        }
    }
    p.doubtful |= fabs(p.range - l->gate[0]) < 1e-4 || fabs(p.range - l->gate[1]) < 1e-4;
    if (p.range < l->gate[0] || p.range > l->gate[1])
        p.range = 0;
    return p;
}

/* Compares every pulse with a CSV file. How many return from what moves; -1: they differ. */
static int rtt_lidar_check(const rtt_lidar *l, const char *path)
{
    const double degree = 3.14159265358979324 / 180, columns = (double)l->steps * l->sweeps;
    FILE *file = fopen(path, "r");
    char line[512] = "";
    int seen = 0;
    bool good = file && fgets(line, sizeof line, file) && strcmp(line, "x,y,z,range,intensity,time,prim,ring,mover\n") == 0, more;

    more = good && fgets(line, sizeof line, file);
    for (int i = 0; good && i < l->steps * l->sweeps * l->channels; i++) {
        const int column = i / l->channels, ring = i % l->channels;
        const double turn = 360.0 * (column % l->steps) / l->steps * degree, part = column / columns, time = column / (l->steps * l->rate);
        const double tilt = (l->channels > 1 ? l->low + (l->high - l->low) * ring / (l->channels - 1) : (l->low + l->high) / 2) * degree;
        double local[3] = { cos(tilt) * cos(turn), cos(tilt) * sin(turn), sin(tilt) }, org[3], dir[3], row[9], worst = 0;
        rtt_pulse p;

        for (int k = 0; k < 3; k++) {
            org[k] = l->from[k] + l->way[k] * part;
            dir[k] = local[0] * l->axes[0][k] + local[1] * l->axes[1][k] + local[2] * l->axes[2][k];
        }
        p = rtt_lidar_pulse(l, org, dir, part);
        if (more && sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", row, row + 1, row + 2, row + 3, row + 4, row + 5, row + 6, row + 7, row + 8) != 9)
            good = false;
        if (!more || row[7] != ring || fabs(row[5] - time) > 1e-6) {
            good &= p.doubtful || p.range == 0;
            if (!good)
                printf("    step %d, ring %d: no return, but one from %g\n", column, ring, p.range);
            continue;
        }
        more = fgets(line, sizeof line, file) != NULL;
        if (p.doubtful)
            continue;
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(row[k] - (l->world ? org[k] + p.range * dir[k] : p.range * local[k])));
        good &= worst < 5e-6 && fabs(row[3] - p.range) < 5e-6 && row[8] == (p.face == 6) && (p.face == 6 ? row[6] == 0 : (int)row[6] / 2 == p.face);
        good &= fabs(row[4] - p.albedo * p.cosine / (p.range * p.range)) < 1e-4 * row[4];
        if (!good)
            printf("    step %d, ring %d: range %.9g intensity %.9g prim %g, not %.9g %.9g of face %d\n", column, ring, row[3], row[4], row[6], p.range,
                   p.albedo * p.cosine / (p.range * p.range), p.face);
        seen += p.face == 6;
    }
    if (file)
        fclose(file);
    return good && !more ? seen : -1;
}

/* The three formats hold the same points. */
static void rtt_lidar_formats(const char *room, const char *base)
{
    static const char *const endings[] = { "csv", "ply", "xyz" };
    char said[4096], command[2048], line[512];
    const char *end;
    FILE *files[3];
    size_t count = 0, told = 0;

    for (int i = 0; i < 3; i++) {
        snprintf(command, sizeof command, "'%s' -o '%s.%s' --from 1,1,1 --range 2,4 --threads 3", room, base, endings[i]);
        CHECK(rtt_run_program("lidar", command, said, sizeof said) == 0 && strstr(said, "32768 pulses") && strstr(said, "Mpulses/s"));
        snprintf(command, sizeof command, "%s.%s", base, endings[i]);
        files[i] = fopen(command, "rb");
    }
    if (CHECK(files[0] && files[1] && files[2])) {
        bool good = fgets(line, sizeof line, files[0]) != NULL;

        while (fgets(line, sizeof line, files[1]) && strcmp(line, "end_header\n") != 0)
            if (strncmp(line, "element vertex ", 15) == 0)
                told = strtoul(line + 15, NULL, 10);
        while (good && fgets(line, sizeof line, files[0])) {
            struct { float f[6]; uint32_t prim; uint16_t ring, mover; } ply;
            float xyz[3];

            good &= fread(&ply, 32, 1, files[1]) == 1 && fscanf(files[2], "%f %f %f", &xyz[0], &xyz[1], &xyz[2]) == 3;
            end = line;
            for (int k = 0; good && k < 6; k++, end++) {
                char *stop;
                const float value = strtof(end, &stop);

                good &= stop != end && value == ply.f[k] && (k > 2 || value == xyz[k]);
                end = stop;
            }
            good &= ply.f[3] > 2 && ply.f[3] < 4 && strtoul(end, NULL, 10) == ply.prim;
            count++;
        }
        CHECK(good && count > 1000 && count < 32768 && count == told && fgetc(files[1]) == EOF);
    }
    for (int i = 0; i < 3; i++)
        if (files[i])
            fclose(files[i]);
    snprintf(command, sizeof command, "'%s' -o '%s.ply' --from 1,1,1 --range 50,60", room, base);      /* nothing there: no point, but a file */
    CHECK(rtt_run_program("lidar", command, said, sizeof said) == 0 && strstr(said, " 0 returns"));
}

/* Noise along the beams: its mean and deviation, other noise by seed alone. */
static void rtt_lidar_noise(const char *room, const char *base)
{
    static const char *const ways[] = { "", "--noise 0.02 --seed 7 --threads 1", "--noise 0.02 --seed 7 --threads 3", "--noise 0.02 --seed 8" };
    char said[4096], command[2048], line[2][512];
    double sum = 0, squares = 0, across = 0;
    size_t count = 0;
    FILE *files[2];

    for (int i = 0; i < 4; i++) {
        snprintf(command, sizeof command, "'%s' -o '%s%d.csv' --from 1,1,1 --sweeps 2 --quiet %s", room, base, i, ways[i]);
        CHECK(rtt_run_program("lidar", command, said, sizeof said) == 0);
    }
    CHECK(rtt_same_files("l1.csv", "l2.csv") && !rtt_same_files("l1.csv", "l3.csv"));
    files[0] = fopen(loader_path("l0.csv"), "r");
    files[1] = fopen(loader_path("l1.csv"), "r");
    while (files[0] && files[1] && fgets(line[0], sizeof line[0], files[0]) && fgets(line[1], sizeof line[1], files[1])) {
        double p[2][4], difference;

        if (line[0][0] == 'x')
            continue;
        for (int i = 0; i < 2; i++)
            CHECK(sscanf(line[i], "%lf,%lf,%lf,%lf", &p[i][0], &p[i][1], &p[i][2], &p[i][3]) == 4);
        difference = p[1][3] - p[0][3];
        sum += difference, squares += difference * difference, count++;
        for (int k = 0; k < 3; k++)
            across = fmax(across, fabs(p[1][k] / p[1][3] - p[0][k] / p[0][3]));
    }
    CHECK(count == 2 * 32768 && fabs(sum / (double)count) < 4 * 0.02 / 256 && fabs(sqrt(squares / (double)count) / 0.02 - 1) < 0.012 && across < 1e-6);
    for (int i = 0; i < 2; i++)
        if (files[i])
            fclose(files[i]);
}

static void rtt_test_lidar(void)
{
    static const char *const bad[][2] = {
        { "cornell --channels 0", "--channels" }, { "cornell --channels 1025", "1 to 1024" }, { "cornell --steps 65537", "--steps" }, { "cornell --range 2,2", "--range" },
        { "cornell --range -1,2", "--range" }, { "cornell --range nan,2", "--range" }, { "cornell --elevation 10,-10", "--elevation" }, { "cornell --elevation 0,91", "--elevation" },
        { "cornell --noise -1", "--noise" }, { "cornell --rate 0", "--rate" }, { "cornell --from 1,2", "--from" }, { "cornell --to 1,2,inf", "--to" },
        { "cornell --frame body", "sensor world" }, { "cornell --up 0,0,0", "--up" }, { "cornell --forward 0,0,0", "--forward" }, { "cornell --forward 0,-3,0", "--forward" },
        { "cornell --channels 1000 --steps 60000 --sweeps 2", "too many pulses" }, { "cornell --mover-to 1,2,3", "--mover" }, { "cornell --mover no/such.obj", "no/such.obj" },
        { "cornell --structure kdtree --algorithm bvh.stack", "kdtree" }, { "cornell --algorithm best", "--algorithm" }, { "cornell -o x.png", ".ply, .csv or .xyz" },
        { "cornell --bogus", "unknown option" }, { "cornell --seed", "needs a value" }, { "--quiet", "no scene" }, { "cornell sphere:100", "two scenes" },
        { "no/such.nff", "no/such.nff" }, { "cornell -o no/such/folder/x.ply", "no/such/folder/x.ply" }, { "cornell --mover l.csv -o l.csv", "is the scene" },
        { "cornell --mover cornell --mover-from 1e18,0,0", "RT_MAX_COORDINATE" },
    };
    static const rtt_lidar runs[] = {
        { "--channels 24 --steps 90 --sweeps 2 --elevation -40,60 --rate 20 --range 0.8,5 --from 0,1,-1 --to 2,1.5,-2 --mover-from -2,1,-2 --mover-to 3,1.5,0.5",
          24, 90, 2, -40, 60, 20, { 0.8, 5 }, { 0, 1, -1 }, { 2, 0.5, -1 },
          { { 0.89442719099991588, 0, -0.44721359549995794 }, { -0.44721359549995794, 0, -0.89442719099991588 }, { 0, 1, 0 } }, false, true,
          { -1.5, 1, -1.75 }, { 5, 0.5, 2.5 } },
        { "--channels 1 --steps 700 --elevation -20,40 --frame world --up 1,1,0 --forward 1,1,-2 --from 1,1,1 --range 0,100",
          1, 700, 1, -20, 40, 10, { 0, 100 }, { 1, 1, 1 }, { 0, 0, 0 },
          { { 0, 0, -1 }, { -0.70710678118654752, 0.70710678118654752, 0 }, { 0.70710678118654752, 0.70710678118654752, 0 } }, true, false,
          { 0, 0, 0 }, { 0, 0, 0 } },
        { "--channels 2 --steps 5 --sweeps 3 --elevation 0,20 --frame world --from 1,1,1 --to 1,1,-3 --range 0,100 --noise 0 --mover-from 0.5,1,-0.25 --mover-to 0.5,1,-4.25",
          2, 5, 3, 0, 20, 10, { 0, 100 }, { 1, 1, 1 }, { 0, 0, -4 }, { { 0, 0, -1 }, { -1, 0, 0 }, { 0, 1, 0 } }, true, true,
          { 1, 1, 0 }, { 0, 0, -4 } },
    };
    static const char *const ways[] = { "--threads 3", "--threads 2 --structure threaded", "--structure kdtree", "--algorithm bvh.wide", "--algorithm kd.restart" };
    char said[4096], command[2048], base[512], room[512], ball[512];

    if (!rtt_has_program("lidar"))
        return;
    snprintf(base, sizeof base, "%s", loader_path("l"));
    for (size_t i = 0; i < RTT_COUNT(bad); i++) {
        snprintf(command, sizeof command, "-o '%s.csv' --steps 8 %s", base, bad[i][0]);
        CHECK(rtt_run_program("lidar", command, said, sizeof said) != 0);
        if (!strstr(said, bad[i][1]))
            rtt_fail("lidar %s: %s", bad[i][0], said);
        CHECK(access(loader_path("l.csv"), F_OK) != 0);
    }

    /* each pulse against what it is to measure: distances, gate, motion, intensity */
    loader_write("room.mtl", "newmtl wall\nKd 0.2 0.5 0.8\n");
    loader_write("room.obj", "mtllib room.mtl\nv -4 0 -5\nv 6 0 -5\nv -4 3 -5\nv 6 3 -5\nv -4 0 2\nv 6 0 2\nv -4 3 2\nv 6 3 2\nusemtl wall\n"
                             "f 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\nf 1 2 4 3\nf 5 6 8 7\n");
    loader_write("ball.nff", "f 1 1 1 1 0 0 0 1\ns 0.5 0 0.25 0.5\n");
    snprintf(room, sizeof room, "%s", loader_path("room.obj"));
    snprintf(ball, sizeof ball, "%s", loader_path("ball.nff"));
    for (size_t i = 0; i < RTT_COUNT(runs); i++) {
        const char *mover = runs[i].moves ? " --mover " : "", *moved = runs[i].moves ? ball : "";
        int seen;

        snprintf(command, sizeof command, "'%s' -o '%s.csv' --quiet --threads 1 %s%s%s", room, base, runs[i].arguments, mover, moved);
        CHECK(rtt_run_program("lidar", command, said, sizeof said) == 0 && said[0] == '\0');
        seen = rtt_lidar_check(&runs[i], loader_path("l.csv"));
        if (seen < 0 || (seen > 0) != runs[i].moves)
            rtt_fail("lidar %s: %d returns from what moves", runs[i].arguments, seen);
        for (size_t k = 0; k < RTT_COUNT(ways); k++) {
            snprintf(command, sizeof command, "'%s' -o '%sb.csv' --quiet %s %s%s%s", room, base, ways[k], runs[i].arguments, mover, moved);
            CHECK(rtt_run_program("lidar", command, said, sizeof said) == 0);
            if (!rtt_same_files("l.csv", "lb.csv"))
                rtt_fail("lidar %s %s: other points", runs[i].arguments, ways[k]);
        }
    }
    rtt_lidar_formats(room, base);
    rtt_lidar_noise(room, base);
    loader_clear();
}

/* ---- leaving a surface: the long forms are in accuracy.c */

/* The origin lies within the stated bounds of the hit, on the side asked for; the next ray does not meet the surface, but what is near. */
static void rtt_test_spawn(void)
{
    rtt_random random = rtt_stream();
    size_t naive = 0, tested = 0;

    for (int round = 0; round < 400; round++) {
        struct { float pad, x, y, z; } near_one[6];     /* a triangle, and that one moved along its normal */
        const uint32_t indices[6] = { 2, 0, 1, 3, 4, 5 };
        const float size = fabsf(rtt_log(&random, -20, 20)), far = round % 2 ? 100 * size : size;
        const rt_vec3 center = rtt_point(&random, rtt_v(0, 0, 0), far);
        rt_geometry geo;
        rt_accel *accel, *alone;
        rt_vec3 v[3], n;
        double side[2][3], normal[3];
        float bound;

        memset(near_one, 0, sizeof near_one);
        memset(&geo, 0, sizeof geo);
        for (int i = 0; i < 3; i++)
            v[i] = rtt_point(&random, center, size);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 2; i++)
                side[i][k] = (double)(&v[i + 1].x)[k] - (double)(&v[0].x)[k];
        rti_cross3(side[0], side[1], normal);
        if (!(rti_unit3(normal) > 0))
            continue;
        n = rtt_v((float)normal[0], (float)normal[1], (float)normal[2]);
        bound = 2e-6f * 2 * size + 4e-7f * (rti_largest(center) + size);
        for (int i = 0; i < 6; i++) {
            const rt_vec3 p = i < 3 ? v[i] : rti_add(v[i - 3], rti_scale(n, 4 * bound));
            near_one[i].x = p.x, near_one[i].y = p.y, near_one[i].z = p.z;
        }
        geo.vertices = &near_one[0].x, geo.vertex_stride = sizeof near_one[0], geo.vertex_count = 6;
        geo.indices = indices, geo.triangle_count = 1;
        CHECK_STATUS(rt_build(&alone, &geo, NULL), RT_OK);
        geo.triangle_count = 2;
        CHECK_STATUS(rt_build(&accel, &geo, NULL), RT_OK);
        for (int i = 0; i < 40; i++) {
            const float a = 0.2f + 0.2f * rtt_signed(&random), b = 0.2f + 0.2f * rtt_signed(&random);
            const rt_vec3 at = rti_add(v[2], rti_add(rti_scale(rti_sub(v[0], v[2]), a), rti_scale(rti_sub(v[1], v[2]), b)));
            rt_ray ray, next;
            rt_hit hit, again;
            rt_vec3 origin;
            double off[3];

            memset(&ray, 0, sizeof ray);
            ray.org = rti_sub(rtt_point(&random, center, size), rti_scale(n, 5 * size));
            ray.dir = rti_sub(at, ray.org), ray.tmax = INFINITY;
            if (!rt_intersect(alone, &ray, &hit))
                continue;
            next = ray;
            next.dir = rtt_point(&random, rtt_v(0, 0, 0), 1);
            if (rti_dot(next.dir, n) < 0)
                next.dir = rti_scale(next.dir, -1);
            if (!(rti_dot(next.dir, n) > 0.2f))
                continue;
            origin = rt_spawn_origin(&geo, NULL, &ray, &hit, next.dir);
            for (int k = 0; k < 3; k++)
                off[k] = (double)(&origin.x)[k] - (double)(&v[2].x)[k];
            CHECK(rti_dot3(off, normal) > 0 && rti_dot3(off, normal) < (double)bound);
            next.org = origin;
            CHECK(!rt_intersect(alone, &next, &again));
            if (a > 0.05f && b > 0.05f && a + b < 0.95f)
                CHECK(rt_intersect(accel, &next, &again) && again.prim == 1);
            next.dir = rti_scale(next.dir, -1);
            next.org = rt_spawn_origin(&geo, NULL, &ray, &hit, next.dir);
            CHECK(!rt_intersect(alone, &next, &again));
            next.org = rti_add(ray.org, rti_scale(ray.dir, hit.t));
            naive += rt_intersect(alone, &next, &again);
            tested++;
        }
        rt_free(accel);
        rt_free(alone);
    }
    CHECK(tested > 5000 && naive > tested / 10);            /* what it is good for */
}

/* ---- pictures that refine */

enum { RTT_REFINE_SIDE = 24 };

/* A bright ball out of focus before grey ground under a round light: rare samples matter in the middle, none at the rim. */
static void rtt_refine_stage(rtt_stage *stage, rt_render_options *how)
{
    memset(stage, 0, sizeof *stage);
    stage->materials[0] = rtt_material(rtt_gray(0.3f), rtt_gray(0), rtt_gray(0), rtt_gray(0), 0, false);
    stage->materials[1] = rtt_material(rtt_gray(0), rtt_gray(3), rtt_gray(0), rtt_gray(0), 0, false);
    rtt_stage_quad(stage, rtt_v(-9, -9, -8), rtt_v(18, 0, 0), rtt_v(0, 18, 0), 0);
    rtt_ball(&stage->model, rtt_v(0, 0, -2), 0.03f);
    rtt_stage_build(stage);
    stage->light.position = rtt_v(1, 4, -3), stage->light.color = rtt_gray(1), stage->light.radius = 0.5f;
    stage->scene.light_count = 1;
    stage->scene.camera = (rt_camera){ { 0, 0, 0 }, { 0, 0, -1 }, { 0, 1, 0 }, 30 };
    memset(how, 0, sizeof *how);
    how->width = how->height = RTT_REFINE_SIDE;
    how->spp = 4096;
    how->lens.radius = 0.2f, how->lens.focus = 8;
}

static rt_status rtt_refine_draw(void *context, const rt_render_options *how, rt_vec3 *pixels)
{
    return (rt_render_tile)((const rt_scene *)context, how, 0, 0, how->width, how->height, pixels, NULL);
}

/* The estimate of the error is near the error, with each sampler, uniform and adaptive, from two samples on. */
static void rtt_test_refine_estimate(void)
{
    enum { PIXELS = RTT_REFINE_SIDE * RTT_REFINE_SIDE };
    static rt_vec3 reference[PIXELS];
    rt_render_options how;
    rtt_stage stage;

    rtt_refine_stage(&stage, &how);
    how.sampler = RT_SAMPLER_SOBOL;
    how.seed = 99;
    CHECK_STATUS((rt_render_tile)(&stage.scene, &how, 0, 0, how.width, how.height, reference, NULL), RT_OK);
    for (int kind = RT_SAMPLER_INDEPENDENT; kind < RT_SAMPLER_COUNT; kind++)
        for (int adaptive = 0; adaptive < 2; adaptive++)
            for (int samples = adaptive ? 8 : 2; samples <= 128; samples *= 4) {
                double estimate = 0, truth = 0;

                for (int seed = 0; seed < 8; seed++) {
                    refinement r;

                    how.sampler = (rt_sampler_kind)kind;
                    how.seed = (uint32_t)seed;
                    CHECK(refine_begin(&r, &how, adaptive, rtt_refine_draw, &stage.scene));
                    for (int now = adaptive ? 8 : 1; now <= samples; now *= 2)
                        CHECK_STATUS(refine_until(&r, now), RT_OK);
                    estimate += r.error * r.error;
                    for (int i = 0; i < PIXELS; i++)
                        truth += refine_square(r.picture[i], reference[i]) / PIXELS;
                    CHECK(adaptive ? fabs(r.samples / samples - 1) < 0.2 : r.samples == samples);
                    refine_end(&r);
                }
                if (!(estimate < 1.4 * truth && truth < 1.4 * estimate))
                    rtt_fail("sampler %d%s, %d samples: the error is %g, estimated as %g", kind, adaptive ? ", adaptive" : "", samples,
                             sqrt(truth / 8), sqrt(estimate / 8));
            }
    rtt_stage_free(&stage);
}

/* The mean over many adaptive pictures is that of uniform ones. That of samples that all weigh alike is not: so the test can tell. */
static void rtt_test_refine_bias(void)
{
    enum { PIXELS = RTT_REFINE_SIDE * RTT_REFINE_SIDE, RUNS = 1200 };
    rt_render_options how;
    rtt_stage stage;
    double sums[3] = { 0, 0, 0 }, squares[3] = { 0, 0, 0 };

    rtt_refine_stage(&stage, &how);
    stage.light.radius = 0;                 /* so the ball alone is noisy, where rays rarely meet it */
    how.sampler = RT_SAMPLER_INDEPENDENT;
    how.spp = 64;
    for (uint32_t run = 0; run < RUNS; run++) {
        double values[3] = { 0, 0, 0 };
        refinement r;

        how.frame = run;
        CHECK(refine_begin(&r, &how, true, rtt_refine_draw, &stage.scene));
        CHECK_STATUS(refine_until(&r, 8), RT_OK);
        for (int i = 0; i < PIXELS; i++) {
            const double count = (double)r.counts[i], guide = (double)(r.guides[0][i].x + r.guides[1][i].x) / 2;

            values[1] += (r.drawn[0] * guide + count * (double)r.picture[i].x) / (r.drawn[0] + count);
        }
        CHECK_STATUS(refine_until(&r, 16), RT_OK);
        for (int i = 0; i < PIXELS; i++)
            values[0] += (double)r.picture[i].x;
        refine_end(&r);
        CHECK(refine_begin(&r, &how, false, rtt_refine_draw, &stage.scene));
        how.frame = run + RUNS;
        r.how.frame = how.frame;
        CHECK_STATUS(refine_until(&r, 16), RT_OK);
        for (int i = 0; i < PIXELS; i++)
            values[2] += (double)r.picture[i].x;
        refine_end(&r);
        for (int k = 0; k < 3; k++)
            sums[k] += values[k], squares[k] += values[k] * values[k];
    }
    for (int k = 0; k < 2; k++) {
        const double away = (sums[k] - sums[2]) / RUNS;
        const double deviation = sqrt((squares[k] - sums[k] * sums[k] / RUNS + squares[2] - sums[2] * sums[2] / RUNS) / RUNS / RUNS);

        if (k ? fabs(away) < 3 * deviation : fabs(away) > 3.5 * deviation)
            rtt_fail("%s: the mean is off by %g deviations", k ? "with the guide's samples, which should show" : "adaptive", away / deviation);
    }
    rtt_stage_free(&stage);
}

/* A draw that fails leaves the picture as it was. */
static rt_status rtt_refine_fail(void *context, const rt_render_options *how, rt_vec3 *pixels)
{
    memset(pixels, 0x55, (size_t)how->width * (size_t)how->height * sizeof *pixels);
    return --*(int *)context < 0 ? RT_ERROR_MEMORY : RT_OK;
}

static void rtt_test_refine_failure(void)
{
    enum { PIXELS = RTT_REFINE_SIDE * RTT_REFINE_SIDE };
    static rt_vec3 before[PIXELS];
    rt_render_options how;

    memset(&how, 0, sizeof how);
    how.width = how.height = RTT_REFINE_SIDE;
    how.spp = 64;
    for (int adaptive = 0; adaptive < 2; adaptive++) {
        refinement r;
        double had;
        int left = adaptive ? 5 : 3;        /* the second half of the second round fails */

        CHECK(refine_begin(&r, &how, adaptive, rtt_refine_fail, &left));
        CHECK_STATUS(refine_until(&r, 8), RT_OK);
        memcpy(before, r.picture, sizeof before);
        had = r.samples;
        CHECK(had == (adaptive ? 6 : 8));       /* equal shares are powers of two */
        CHECK_STATUS(refine_until(&r, 16), RT_ERROR_MEMORY);
        CHECK(memcmp(before, r.picture, sizeof before) == 0 && r.samples == had && r.error == 0);
        refine_end(&r);
    }
}

/* render refuses each of those options with that word, and leaves no picture. */
static void rtt_check_refusals(const char *const (*bad)[2], size_t count)
{
    char said[4096], command[2048], picture[512];

    snprintf(picture, sizeof picture, "%s", loader_path("refused.ppm"));
    for (size_t i = 0; i < count; i++) {
        snprintf(command, sizeof command, "cornell -o '%s' --size 8x8 %s", picture, bad[i][0]);
        CHECK(rtt_run_program("render", command, said, sizeof said) != 0);
        if (!strstr(said, bad[i][1]) || access(picture, F_OK) == 0)
            rtt_fail("render %s: %s", bad[i][0], said);
    }
}

/* render --report, --error, --time and --adaptive. */
static void rtt_test_report(void)
{
    static const char *const bad[][2] = {
        { "--report no/such/folder/x.csv", "no/such/folder/x.csv" }, { "--report .", "is a folder" }, { "--error 0", "above 0" },
        { "--error nan", "above 0" }, { "--time -1", "above 0" }, { "--time x", "above 0" }, { "--adaptive=1", "takes no value" },
        { "--spp 1 --error 0.1", "2 or more" }, { "--spp 3 --adaptive", "4 or more" }, { "--primary raster --adaptive", "--primary trace" },
    };
    static const char *const runs[] = {
        "--spp 16", "--spp 13 --sampler independent", "--spp 200 --adaptive", "--error 0.02", "--error 0.02 --adaptive", "--time 0.2",
        "--time 0.2 --adaptive", "--spp 16 --sampler stratified --threads 1", "--error 1e-9 --spp 8", "--time 1e-6",
        "--adaptive", "--adaptive --spp 5",
    };
    char said[4096], command[2048], base[512], csv[520];

    if (!rtt_has_program("render"))
        return;
    snprintf(base, sizeof base, "%s", loader_path("r"));
    snprintf(csv, sizeof csv, "%s.csv", base);
    rtt_check_refusals(bad, RTT_COUNT(bad));
    for (size_t i = 0; i < RTT_COUNT(runs); i++) {
        double spp = 0, seconds = 0, rays = 0, error = 0, relative, last[3] = { 0, 0, 0 };
        FILE *file;
        int rows = 0;

        snprintf(command, sizeof command, "cornell -o '%s.ppm' --size 48x48 --light-radius 0.3 --report '%s' %s", base, csv, runs[i]);
        if (rtt_run_program("render", command, said, sizeof said) != 0 || !strstr(said, "estimated"))
            rtt_fail("render %s: %s", runs[i], said);
        file = fopen(csv, "r");
        CHECK(file && fgets(said, sizeof said, file) && strcmp(said, "spp,seconds,rays,rmse,relmse\n") == 0);
        while (file && fscanf(file, "%lf,%lf,%lf,%lf,%lf\n", &spp, &seconds, &rays, &error, &relative) == 5) {
            CHECK(spp > last[0] && seconds > last[1] && rays > last[2] && error > 0 && error < 1 && relative > 0);
            last[0] = spp, last[1] = seconds, last[2] = rays;
            if (!strstr(runs[i], "--adaptive") && !strstr(runs[i], "--time") && rows < 3)
                CHECK(spp == 1 << rows);
            rows++;
        }
        CHECK(rows > !strstr(runs[i], "--adaptive") && file && feof(file));
        if (file)
            fclose(file);
        CHECK(!strstr(runs[i], "--spp 16") || spp == 16);
        CHECK(!strstr(runs[i], "--spp 13") || spp == 13);
        CHECK(!strstr(runs[i], "--error 0.02") || error <= 0.02);
        CHECK(!strstr(runs[i], "--time 0.2") || (seconds < 2 && spp < 65536));
        CHECK(!strstr(runs[i], "1e-9") || spp == 8);
    }
    /* the picture is the mean of both halves, whoever draws it */
    for (int k = 0; k < 3; k++) {
        static const char *const ways[] = { "--threads 1", "--threads 3 --algorithm kd.shortstack", "--gpu" };

        if (k == 2 && rtt.no_gpu)
            continue;
        snprintf(command, sizeof command, "balls:2 -o '%s%d.ppm' --size 48x40 --light-radius 0.3 --adaptive --spp 40 --quiet %s", base, k, ways[k]);
        if (rtt_run_program("render", command, said, sizeof said) != 0 || said[0])
            rtt_fail("render %s: %s", command, said);
        snprintf(command, sizeof command, "r%d.ppm", k);
        CHECK(rtt_same_files("r0.ppm", command));
    }
    loader_clear();
}

/* render --gpu draws what render draws; what it cannot do it says before the work. */
static void rtt_test_gpu_programs(void)
{
    static const char *const scenes[] = {
        "cornell --spp 3", "glass:2 --depth 7 --algorithm kd.shortstack --packet 8", "balls:2 --primary raster", "textures --structure threaded --seed 9",
        "mirrors:2 --lens 0.1 --light-radius 0.4 --roughness 0.1 --filter tent --sampler independent --spp 2",
    };
    static const char *const bad[][2] = {
        { "--device nowhere", "nowhere" }, { "--gpu --algorithm bvh.simd --packet 3", "packets of 3" },
        { "--gpu --algorithm kd.stack --structure bvh", "needs structure kdtree" }, { "--gpu=1", "takes no value" },
    };
    char said[4096], command[2048], base[512];

    if (!rtt_has_program("render"))
        return;
    snprintf(base, sizeof base, "%s", loader_path("g"));
    for (size_t i = 0; i < RTT_COUNT(scenes); i++) {
        for (int gpu = 0; gpu < 2; gpu++) {
            snprintf(command, sizeof command, "%s -o '%s%d.ppm' --size 61x43 --quiet%s", scenes[i], base, gpu, gpu ? " --gpu" : "");
            if (gpu == 0 && strstr(command, "--packet"))
                memset(strstr(command, "--packet"), ' ', strlen("--packet 8"));
            if (rtt_run_program("render", command, said, sizeof said) != 0 || said[0])
                rtt_fail("render %s: %s", command, said);
        }
        if (!rtt_same_files("g0.ppm", "g1.ppm"))
            rtt_fail("render %s: another picture on the device", scenes[i]);
    }
    rtt_check_refusals(bad, RTT_COUNT(bad));
    snprintf(command, sizeof command, "cornell -o '%sx.ppm' --size 40x30 --gpu", base);
    CHECK(rtt_run_program("render", command, said, sizeof said) == 0 && strstr(said, "device ") && strstr(said, "Mrays/s"));
    loader_clear();
}

/* ---- >>gpu: rt_gpu.h ---------------------------------------------------------------------------------------------------- */

/* What hits are on devices is tested by rtt_check, with every case; here is the rest. */

/* Three levels of all that there is, and rays to meet it. */
static void rtt_gpu_scene(rtt_model *world, rtt_model *child, rtt_rays *rays, rt_structure structure)
{
    rtt_random random = rtt_stream();

    child->structure = (rt_structure)((structure + 1) % RT_STRUCTURE_COUNT);
    rtt_cloud(child, &random, 60, rtt_origin, 0.5f, 0.3f);
    rtt_balls(child, &random, 10, rtt_origin, 0.5f, 0.1f);
    world->structure = structure;
    rtt_cloud(world, &random, 400, rtt_origin, 1, 0.2f);
    rtt_balls(world, &random, 40, rtt_origin, 1, 0.1f);
    rtt_ground(world, rtt_v(0, -1, 0), rtt_v(0, 1, 0.1f), 0);
    for (int k = 0; k < 12; k++)
        rtt_place(world, child, rtt_mul(rtt_v(1, 1, 1), 0.4f), rtt_point(&random, rtt_origin, 1));
    rtt_rays_mixed(rays, &random, rtt_origin, 1, 400);
    rtt_rays_pinhole(rays, rtt_v(0.5f, 0, -3), rtt_origin, 1, 37);
}

/* Little work for every kernel: for simulators of devices, which are some thousand times slower. Of large packets, whose programs for a scene
   differ from general ones, some of either. */
static void rtt_test_gpu_small(void)
{
    rtt_random random = rtt_stream();
    rtt_model child = { 0 }, world = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu_options options;
    rt_gpu_accel *there;
    rtt_accels accels;
    rt_hit *want, *got;
    rt_gpu *gpu;

    child.structure = RT_THREADED;
    rtt_cloud(&child, &random, 4, rtt_origin, 0.5f, 0.5f);
    rtt_balls(&child, &random, 2, rtt_origin, 0.5f, 0.3f);
    rtt_cloud(&world, &random, 12, rtt_origin, 1, 0.6f);
    rtt_balls(&world, &random, 4, rtt_origin, 1, 0.2f);
    rtt_ground(&world, rtt_v(0, -1, 0), rtt_v(0, 1, 0.1f), 0);
    for (int k = 0; k < 3; k++)
        rtt_place(&world, &child, rtt_mul(rtt_v(1, 1, 1), 0.7f), rtt_point(&random, rtt_origin, 1));
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 9);
    rtt_rays_pinhole(&rays, rtt_v(0.5f, 0, -3), rtt_origin, 1, 5);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    for (size_t i = 0; i < rays.count; i++)
        want[i] = rtt_closest(&world, &rays.ray[i]);
    CHECK(rtt_hits(&world, &rays) > rays.count / 2);
    if (rtt_device.gpu && rtt_accels_build(&accels, &world)) {
        for (int s = 0; s < RT_STRUCTURE_COUNT; s++)
            rtt_compare_device(rtt_device.gpu, "small", accels.of[s], &rays, want, true, 0, 1);
        memset(&options, 0, sizeof options);
        options.memory_user = &rtt_device.memory;
        options.inexact = rtt.any_gpu;
        got = (rt_hit *)rtt_array(rays.count, sizeof *got);
        if (CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_OK) && CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_BVH], NULL), RT_OK))
            for (size_t w = 0; w < rtt_device.way_count; w++)
                if (rt_algorithm_get(rtt_device.ways[w].options.algorithm)->culls && w % 13 == 0)
                    CHECK(rtt_compare_kernel(gpu, "small", there, &rtt_device.ways[w], &rays, got, want, true));
        rt_gpu_close(gpu);
        free(got);
        rtt_accels_free(&accels);
    }
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
    free(want);
}

/* Large packets of every width, each way to cull, on all that there is below a BVH. */
static void rtt_test_gpu_large(void)
{
    rtt_random random = rtt_stream();
    rtt_model world = { 0 }, children[RT_STRUCTURE_COUNT] = { { 0 } }, inner = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu_accel *there;
    rtt_accels accels;
    rt_hit *want, *got;
    size_t ways = 0, wrong = 0;

    inner.structure = RT_KDTREE;
    rtt_cloud(&inner, &random, 30, rtt_origin, 0.5f, 0.3f);
    rtt_balls(&inner, &random, 5, rtt_origin, 0.5f, 0.2f);
    rtt_cloud(&world, &random, 300, rtt_origin, 1, 0.2f);
    rtt_balls(&world, &random, 30, rtt_origin, 1, 0.1f);
    rtt_ground(&world, rtt_v(0, -1, 0), rtt_v(0, 1, 0.1f), 0);
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++) {
        children[s].structure = (rt_structure)s;
        rtt_cloud(&children[s], &random, 30, rtt_origin, 0.5f, 0.3f);
        for (int k = 0; k < 2; k++)
            rtt_place(&children[s], &inner, rtt_mul(rtt_v(1, 1, 1), 0.5f), rtt_point(&random, rtt_origin, 0.5f));
        for (int k = 0; k < 4; k++) {
            rtt_place(&world, &children[s], rtt_mul(rtt_v(1, 1, 1), 0.4f), rtt_point(&random, rtt_origin, 1));
            if (k % 2)
                rtt_any_motion(&world, &random, 1, 1, 0.5f);
        }
    }
    rtt_rays_pinhole(&rays, rtt_v(0.5f, 0, -3), rtt_origin, 1, 45);        /* nearly 2 packets of 32x32, and then one that is cut short */
    rtt_rays_mixed(&rays, &random, rtt_origin, 1, 500);
    rtt_rays_times(&rays, &random);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    got = (rt_hit *)rtt_array(rays.count, sizeof *got);
    for (size_t i = 0; i < rays.count; i++)
        want[i] = rtt_closest_at(&world, &rays.ray[i], rays.time[i]);
    CHECK(rtt_hits(&world, &rays) > rays.count / 2);
    if (rtt_device.gpu && rtt_accels_build(&accels, &world) && CHECK_STATUS(rt_gpu_upload(rtt_device.gpu, &there, accels.of[RT_BVH], NULL), RT_OK)) {
        for (size_t w = 0; w < rtt_device.way_count; w++)
            if (rt_algorithm_get(rtt_device.ways[w].options.algorithm)->culls) {
                wrong += !rtt_compare_kernel(rtt_device.gpu, "large", there, &rtt_device.ways[w], &rays, got, want, wrong == 0);
                ways++;
            }
        CHECK(ways == 3 * 4 * RT_CULL_COUNT * 2 && !wrong);
        rt_gpu_free(there);
        rtt_accels_free(&accels);
    }
    rtt_model_free(&world);
    for (int s = 0; s < RT_STRUCTURE_COUNT; s++)
        rtt_model_free(&children[s]);
    rtt_model_free(&inner);
    rtt_rays_free(&rays);
    free(want);
    free(got);
}

/* Models that need less and less, each compiled for. */
static void rtt_test_gpu_specialised(void)
{
    rtt_random random = rtt_stream();
    rt_gpu_options options;
    rt_gpu *gpu;

    memset(&options, 0, sizeof options);
    options.memory_user = &rtt_device.memory;
    options.inexact = rtt.any_gpu;
    if (!CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_OK))
        return;
    for (int what = 0; what < 6; what++) {
        static const char *const names[] = { "triangles alone", "with spheres", "with instances", "with planes", "all", "moving" };
        rtt_model child = { 0 }, model = { 0 };
        rtt_rays rays = { 0 };
        rtt_accels accels;
        rt_hit *want;

        child.structure = (rt_structure)(what % RT_STRUCTURE_COUNT);
        rtt_cloud(&child, &random, 40, rtt_origin, 0.5f, 0.3f);
        rtt_cloud(&model, &random, 300, rtt_origin, 1, 0.2f);
        if (what == 1 || what >= 4)
            rtt_balls(&model, &random, 40, rtt_origin, 1, 0.1f);
        for (int k = 0; k < 6 && (what == 2 || what >= 4); k++) {
            rtt_place(&model, &child, rtt_mul(rtt_v(1, 1, 1), 0.4f), rtt_point(&random, rtt_origin, 1));
            if (what == 5)
                rtt_any_motion(&model, &random, 1, 1, 0.5f);
        }
        if (what == 3 || what == 4)
            rtt_ground(&model, rtt_v(0, -1, 0), rtt_v(0, 1, 0.1f), 0);
        rtt_rays_mixed(&rays, &random, rtt_origin, 1, 300);
        rtt_rays_pinhole(&rays, rtt_v(0.5f, 0, -3), rtt_origin, 1, 33);
        if (what == 5)
            rtt_rays_times(&rays, &random);
        want = (rt_hit *)rtt_array(rays.count, sizeof *want);
        for (size_t i = 0; i < rays.count; i++)
            want[i] = rtt_closest_at(&model, &rays.ray[i], rays.time ? rays.time[i] : 0);
        if (rtt_accels_build(&accels, &model))
            for (int s = 0; s < RT_STRUCTURE_COUNT; s++)            /* one with all widths, culls and entries, the others by turns */
                rtt_compare_device(gpu, names[what], accels.of[s], &rays, want, true, (size_t)what, what == 4 ? 0 : 9);
        rtt_accels_free(&accels);
        rtt_model_free(&model);
        rtt_model_free(&child);
        rtt_rays_free(&rays);
        free(want);
    }
    rt_gpu_close(gpu);
}

static void rtt_test_gpu_devices(void)
{
    static const char *const wrong[] = { "no such device", "999", "gpu of tomorrow" };
    rt_gpu_info infos[8], info;
    rt_gpu_options options;
    rt_gpu *gpu = (rt_gpu *)&options;
    rt_error error;
    size_t count = 0, usable = 0;
    char number[8];

    CHECK_STATUS(rt_gpu_list(infos, RTT_COUNT(infos), &count, &error), RT_OK);
    CHECK(count > 0);
    for (size_t i = 0; i < count && i < RTT_COUNT(infos); i++) {
        CHECK(infos[i].name[0] && infos[i].platform[0] && infos[i].memory > 0 && infos[i].usable == (infos[i].lacks[0] == 0));
        usable += infos[i].usable;
    }
    CHECK(usable > 0);
    CHECK_STATUS(rt_gpu_list(NULL, 0, &count, NULL), RT_OK);
    CHECK_STATUS(rt_gpu_list(NULL, 1, &count, &error), RT_ERROR_ARGUMENT);
    CHECK_STATUS(rt_gpu_list(infos, 1, NULL, &error), RT_ERROR_ARGUMENT);
    memset(&options, 0, sizeof options);
    options.error = &error;
    options.inexact = rtt.any_gpu;
    for (size_t i = 0; i < RTT_COUNT(wrong); i++) {
        options.device = wrong[i];
        gpu = (rt_gpu *)&options;
        CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_ERROR_NO_DEVICE);
        CHECK(!gpu && strstr(error.message, wrong[i]));
    }
    for (size_t i = 0; i < count && i < RTT_COUNT(infos); i++) {
        snprintf(number, sizeof number, "%zu", i);
        options.device = i % 2 ? infos[i].name : number;
        CHECK_STATUS(rt_gpu_open(&gpu, &options), infos[i].usable ? RT_OK : RT_ERROR_UNSUPPORTED);
        if (gpu) {
            rt_gpu_get_info(gpu, &info);
            CHECK(strcmp(info.name, infos[i].name) == 0);
        }
        rt_gpu_close(gpu);
    }
    options.device = NULL;
    setenv("RT_GPU_DEVICE", "nowhere", 1);
    CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_ERROR_NO_DEVICE);
    CHECK(strstr(error.message, "nowhere"));
    unsetenv("RT_GPU_DEVICE");
    setenv("RT_GPU_LIBRARY", "libNoOpenCL.so", 1);
    CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_ERROR_NO_DEVICE);
    CHECK(!gpu && strstr(error.message, "libNoOpenCL.so"));
    CHECK_STATUS(rt_gpu_list(infos, 1, &count, &error), RT_ERROR_NO_DEVICE);
    setenv("RT_GPU_LIBRARY", "libm.so.6", 1);
    CHECK_STATUS(rt_gpu_open(&gpu, &options), RT_ERROR_NO_DEVICE);
    CHECK(strstr(error.message, "lacks clGetPlatformIDs"));
    unsetenv("RT_GPU_LIBRARY");
    CHECK_STATUS(rt_gpu_open(NULL, &options), RT_ERROR_ARGUMENT);
    rt_gpu_close(NULL);
}

/* Each mistake has its status and message, and nothing is different afterwards. */
static void rtt_test_gpu_mistakes(void)
{
    rtt_model world = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu *gpu[2];
    rt_gpu_accel *there[2];
    rt_gpu_buffer *from[2], *to[2];
    rt_gpu_event *event;
    rt_gpu_options open;
    rt_trace_options opt;
    rtt_accels accels;
    rt_error error;
    rt_stats stats;
    rt_hit *hits;
    float time = 0;

    rtt_gpu_scene(&world, &child, &rays, RT_BVH);
    hits = (rt_hit *)rtt_array(rays.count, sizeof *hits);
    memset(&open, 0, sizeof open);
    open.memory_user = &rtt_device.memory;
    open.inexact = rtt.any_gpu;
    if (!rtt_accels_build(&accels, &world))
        return;
    for (int k = 0; k < 2; k++) {
        CHECK_STATUS(rt_gpu_open(&gpu[k], &open), RT_OK);
        CHECK_STATUS(rt_gpu_upload(gpu[k], &there[k], accels.of[RT_BVH], NULL), RT_OK);
        CHECK_STATUS(rt_gpu_buffer_new(gpu[k], &from[k], rays.count * sizeof *rays.ray, NULL), RT_OK);
        CHECK_STATUS(rt_gpu_buffer_new(gpu[k], &to[k], rays.count * sizeof *hits, NULL), RT_OK);
        CHECK_STATUS(rt_gpu_write(from[k], 0, rays.ray, rays.count * sizeof *rays.ray, NULL), RT_OK);
    }
    memset(&opt, 0, sizeof opt);
    opt.error = &error;
#define MISTAKE(call, status, words) do { error.message[0] = 0; CHECK_STATUS(call, status); \
        if (!strstr(error.message, words)) rtt_fail("line %d: \"%s\" says nothing of %s", __LINE__, error.message, words); } while (0)
    MISTAKE(rt_gpu_trace(NULL, there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "gpu is NULL");
    MISTAKE(rt_gpu_trace(gpu[0], NULL, &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "accel is NULL");
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, NULL, rays.count, hits), RT_ERROR_ARGUMENT, "rays is NULL");
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, NULL), RT_ERROR_ARGUMENT, "hits is NULL");
    MISTAKE(rt_gpu_trace(gpu[0], there[1], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "another context");
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, SIZE_MAX, hits), RT_ERROR_ARGUMENT, "too large");
    opt.algorithm = RT_KD_STACK;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "kd.stack is for a kdtree");
    opt.algorithm = RT_BVH_RANGED;
    opt.packet_width = 64;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "bvh.ranged takes packet_width 0 (default) or one of: 4, 8, 16, 32");
    opt.cull = (rt_cull)4;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "cull");
    opt.cull = RT_CULL_NONE;
    opt.algorithm = (rt_algorithm)77;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "77");
    opt.algorithm = RT_BVH_STACK;
    opt.packet_width = 3;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "packet_width");
    opt.packet_width = 0;
    opt.cull = RT_CULL_BOTH;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "cull");
    opt.cull = RT_CULL_NONE;
    opt.query = (rt_query)2;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "query");
    opt.query = RT_CLOSEST;
    opt.short_stack = -1;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_ARGUMENT, "short_stack");
    opt.short_stack = 0;
    opt.stats = &stats;
    MISTAKE(rt_gpu_trace(gpu[0], there[0], &opt, rays.ray, rays.count, hits), RT_ERROR_UNSUPPORTED, "stats");
    opt.stats = NULL;
    opt.times = &time;
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[0], NULL, rays.count, to[0], &event), RT_ERROR_ARGUMENT, "times");
    opt.times = NULL;
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[1], NULL, rays.count, to[0], &event), RT_ERROR_ARGUMENT, "rays belongs to another");
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[0], NULL, rays.count, to[1], &event), RT_ERROR_ARGUMENT, "hits belongs to another");
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[0], from[1], rays.count, to[0], &event), RT_ERROR_ARGUMENT, "times belongs to");
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[0], NULL, rays.count + 1, to[0], &event), RT_ERROR_ARGUMENT, "rays has");
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, NULL, NULL, rays.count, to[0], &event), RT_ERROR_ARGUMENT, "rays is NULL");
    MISTAKE(rt_gpu_trace_buffers(gpu[0], there[0], &opt, from[0], NULL, 0, to[0], &event), RT_ERROR_ARGUMENT, "no rays");
    CHECK(!event);
    MISTAKE(rt_gpu_upload(gpu[0], NULL, accels.of[RT_BVH], &error), RT_ERROR_ARGUMENT, "out is NULL");
    MISTAKE(rt_gpu_buffer_new(gpu[0], &from[1], 0, &error), RT_ERROR_ARGUMENT, "no bytes");
    CHECK(!from[1]);
    MISTAKE(rt_gpu_write(from[0], 8, rays.ray, rays.count * sizeof *rays.ray, &error), RT_ERROR_ARGUMENT, "of a buffer of");
    MISTAKE(rt_gpu_read(from[0], SIZE_MAX, rays.ray, 1, &error), RT_ERROR_ARGUMENT, "of a buffer of");
    MISTAKE(rt_gpu_read(from[0], 0, NULL, 1, &error), RT_ERROR_ARGUMENT, "NULL");
    MISTAKE(rt_gpu_write(NULL, 0, rays.ray, 1, &error), RT_ERROR_ARGUMENT, "NULL");
    MISTAKE(rt_gpu_wait(NULL, NULL, &error), RT_ERROR_ARGUMENT, "NULL");
    MISTAKE(rt_gpu_finish(NULL, &error), RT_ERROR_ARGUMENT, "NULL");
    for (int k = 0; k < 2; k++) {
        CHECK_STATUS(rt_gpu_trace(gpu[k], there[k], &opt, rays.ray, rays.count, hits), RT_OK);
        for (size_t i = 0; i < rays.count; i++)
            if (!rtt_same(hits[i], rtt_closest(&world, &rays.ray[i]))) {
                rtt_fail("context %d, ray %zu after mistakes", k, i);
                break;
            }
        rt_gpu_close(gpu[k]);               /* and with it all that it has made */
    }
    rtt_accels_free(&accels);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
    free(hits);
}

/* A compiler that refuses: its words are there, and the context lives on. */
static void rtt_test_gpu_log(void)
{
    rtt_model world = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu_options open;
    rt_trace_options opt;
    rt_gpu_accel *there;
    rt_gpu_buffer *buffer;
    rtt_accels accels;
    rt_error error;
    rt_gpu *gpu;
    rt_hit hit;

    rtt_gpu_scene(&world, &child, &rays, RT_BVH);
    memset(&open, 0, sizeof open);
    memset(&opt, 0, sizeof opt);
    open.memory_user = &rtt_device.memory;
    open.inexact = rtt.any_gpu;
    opt.error = &error;
    if (!rtt_accels_build(&accels, &world))
        return;
    open.flags = "-Drti_prepare=+";
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK(strcmp(rt_gpu_log(gpu), "") == 0);
    CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_BVH], NULL), RT_OK);
    for (int k = 0; k < 3; k++) {
        CHECK_STATUS(rt_gpu_trace(gpu, there, &opt, rays.ray, 1, &hit), RT_ERROR_UNSUPPORTED);
        CHECK(strstr(error.message, "cannot compile") && strstr(error.message, "error"));
        CHECK(strstr(rt_gpu_log(gpu), "error") && rt_gpu_program_count(gpu) == 0);
    }
    CHECK_STATUS(rt_gpu_buffer_new(gpu, &buffer, 100, NULL), RT_OK);
    CHECK_STATUS(rt_gpu_write(buffer, 0, &hit, sizeof hit, NULL), RT_OK);
    rt_gpu_close(gpu);
    open.flags = "-DRTT_HARMLESS";
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_BVH], NULL), RT_OK);
    CHECK_STATUS(rt_gpu_prepare(gpu, there, &opt), RT_OK);
    CHECK(rt_gpu_program_count(gpu) == 1);
    CHECK_STATUS(rt_gpu_trace(gpu, there, &opt, rays.ray, 1, &hit), RT_OK);
    CHECK(rt_gpu_program_count(gpu) == 1 && rtt_same(hit, rtt_closest(&world, rays.ray)));
    rt_gpu_close(gpu);
    rtt_accels_free(&accels);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
}

/* The device's memory ends, at the limit and for real; the host's, at every allocation. */
static void rtt_test_gpu_memory(void)
{
    rtt_model world = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rtt_memory memory = { 0 };
    rt_gpu_options open;
    rt_trace_options opt;
    rt_gpu_accel *there;
    rt_gpu_buffer *buffer;
    rtt_accels accels;
    rt_gpu_info info;
    rt_error error;
    rt_gpu *gpu;
    rt_hit *hits;
    size_t bytes;
    bool done = false;

    rtt_gpu_scene(&world, &child, &rays, RT_THREADED);
    hits = (rt_hit *)rtt_array(rays.count, sizeof *hits);
    memset(&open, 0, sizeof open);
    memset(&opt, 0, sizeof opt);
    open.memory_user = &memory;
    open.inexact = rtt.any_gpu;
    opt.error = open.error = &error;
    if (!rtt_accels_build(&accels, &world))
        return;
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    rt_gpu_get_info(gpu, &info);
    CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_THREADED], &error), RT_OK);
    bytes = rt_gpu_bytes(there);
    CHECK_STATUS(rt_gpu_buffer_new(gpu, &buffer, (size_t)info.largest + 1, &error), RT_ERROR_MEMORY);
    CHECK(!buffer && strstr(error.message, "MB"));
    CHECK_STATUS(rt_gpu_trace(gpu, there, &opt, rays.ray, 1, hits), RT_OK);
    rt_gpu_close(gpu);
    open.memory_limit = bytes + sizeof(rt_ray) + sizeof(rt_hit);
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_THREADED], &error), RT_OK);
    CHECK_STATUS(rt_gpu_trace(gpu, there, &opt, rays.ray, rays.count, hits), RT_ERROR_MEMORY);      /* no room for them */
    CHECK_STATUS(rt_gpu_trace(gpu, there, &opt, rays.ray, 1, hits), RT_OK);
    CHECK(rtt_same(hits[0], rtt_closest(&world, rays.ray)));
    rt_gpu_close(gpu);
    open.memory_limit = bytes - 1;
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload(gpu, &there, accels.of[RT_THREADED], &error), RT_ERROR_MEMORY);
    CHECK(!there);
    CHECK_STATUS(rt_gpu_buffer_new(gpu, &buffer, bytes - 1, &error), RT_OK);
    CHECK_STATUS(rt_gpu_buffer_new(gpu, &buffer, 1, &error), RT_ERROR_MEMORY);
    rt_gpu_close(gpu);
    CHECK(memory.blocks == 0);
    open.memory_limit = 0;
    for (size_t fail = 1; !done && fail < 200; fail++) {
        memory.calls = 0;
        memory.fail_at = fail;
        there = NULL;
        done = rt_gpu_open(&gpu, &open) == RT_OK && rt_gpu_upload(gpu, &there, accels.of[RT_THREADED], &error) == RT_OK
            && rt_gpu_trace(gpu, there, &opt, rays.ray, 1, hits) == RT_OK;
        CHECK(done || error.status == RT_ERROR_MEMORY);
        CHECK(!done || memory.calls < fail);
        rt_gpu_close(gpu);
        CHECK(memory.blocks == 0);
    }
    CHECK(done);
    rtt_accels_free(&accels);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
    free(hits);
}

#ifndef RT_NO_SHADING
/* A picture, and of what it shows those things whose bits are set. */
enum { RTT_SHAPES = 1, RTT_MIRRORS = 2, RTT_GLASS = 4, RTT_MOVING = 8, RTT_TEXTURES = 16, RTT_SPREAD = 32, RTT_NESTED = 64 };

typedef struct {
    rtt_stage stage;
    rtt_model child, inner;
    rt_geometry child_geometry, inner_geometry;
    rt_scene part, inner_part;
    const rt_scene *parts[3], *inner_parts[1];
    rt_texture checker, noise, image;
    rt_vec3 levels[64];
    rt_light lights[3];
    rt_render_options options;
} rtt_view;

static void rtt_view_build(rtt_view *v, int what)
{
    static const rt_vec3 pixels[6] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 }, { 1, 1, 0 }, { 0, 1, 1 }, { 1, 0.5f, 1 } };
    rtt_random random = rtt_stream();
    rtt_stage *stage = &v->stage;
    uint32_t k;

    memset(v, 0, sizeof *v);
    v->checker = rtt_texture(RT_TEXTURE_CHECKER, true, 0.4f), v->noise = rtt_texture(RT_TEXTURE_NOISE, false, 0.3f);
    rt_make_texture_levels(pixels, 3, 2, v->levels);
    v->image.kind = RT_TEXTURE_IMAGE, v->image.levels = v->levels, v->image.width = 3, v->image.height = 2;
    for (k = 0; k < 4; k++)
        stage->materials[k] = rtt_material(rtt_v(0.6f, 0.2f + 0.2f * (float)k, 0.4f), rtt_gray(k == 3 ? 0.05f : 0), rtt_gray(0), rtt_gray(0), 0, false);
    stage->materials[0].specular = rtt_gray(0.3f), stage->materials[0].shininess = 12.5f;
    if (what & RTT_MIRRORS) stage->materials[1].reflect = rtt_v(0.5f, 0.4f, 0.6f);
    if (what & RTT_GLASS) {
        stage->materials[2] = rtt_glass(1.5f, true);
        stage->materials[2].reflect = rtt_gray(0.1f), stage->materials[2].absorb = rtt_v(0.3f, 0.1f, 0.5f);
    }
    if (what & RTT_SPREAD) stage->materials[1].roughness = 0.2f, stage->materials[2].roughness = 0.1f;
    if (what & RTT_TEXTURES) {
        stage->materials[0].texture = &v->checker, stage->materials[3].texture = &v->image, stage->materials[1].texture = &v->image;
        stage->materials[3].bump = &v->noise, stage->materials[3].bump_height = 0.05f;
    }
    rtt_stage_quad(stage, rtt_v(-4, 0, -4), rtt_v(0, 0, 8), rtt_v(8, 0, 0), 0);
    rtt_slab(stage, rtt_v(-1.5f, 0.1f, -1), rtt_v(-0.5f, 1.4f, 0.3f), 2);
    rtt_slab(stage, rtt_v(0.5f, 0.1f, -1.5f), rtt_v(1.4f, 1.8f, -1), 1);
    k = (uint32_t)stage->model.triangle_count;
    if (what & RTT_SHAPES) {
        rtt_ball(&stage->model, rtt_v(0.2f, 0.6f, 0.6f), 0.5f);
        rtt_ball(&stage->model, rtt_v(1.3f, 0.5f, 0.7f), 0.4f);
        stage->ids[k++] = 2, stage->ids[k++] = 3;
        rtt_ground(&stage->model, rtt_v(0, -0.2f, 0), rtt_v(0, 1, 0), 0);
        stage->ids[k++] = 3;
    }
    if (what & RTT_MOVING) {
        rtt_cloud(&v->inner, &random, 4, rtt_origin, 0.4f, 0.5f);
        v->inner_geometry = rtt_geometry(&v->inner);
        v->inner_part.materials = stage->materials, v->inner_part.material_count = 4;
        v->child.structure = RT_BVH;
        rtt_cloud(&v->child, &random, 6, rtt_origin, 0.6f, 0.4f);
        rtt_balls(&v->child, &random, 2, rtt_origin, 0.6f, 0.2f);
        if (what & RTT_NESTED) {
            rtt_place(&v->child, &v->inner, rtt_v(1, 0.5f, 2), rtt_v(0, 0.4f, 0));
            rtt_set_motion(&v->child, rtt_v(0.3f, 0, 0), rtt_origin, rtt_v(0, 1, 0), 1);
        }
        v->child_geometry = rtt_geometry(&v->child);
        v->inner_parts[0] = &v->inner_part;
        v->part.parts = v->inner_parts, v->part.materials = stage->materials + 1, v->part.material_count = 3;
        for (k = 0; k < 3; k++) {
            rtt_place(&stage->model, &v->child, rtt_v(0.7f, 1, 0.6f), rtt_v((float)k - 1, 1.6f, 0.4f * (float)k));
            if (k != 1) rtt_set_motion(&stage->model, rtt_v(0, 0.2f, 0.1f), rtt_origin, rtt_v(1, 1, 0), 0.5f);
            v->parts[k] = &v->part;
        }
        stage->scene.parts = v->parts;
        v->options.lens.open = 0.1f, v->options.lens.close = 0.8f;
    }
    v->part.accel = v->child.accel, v->part.geometry = &v->child_geometry;
    v->inner_part.accel = v->inner.accel, v->inner_part.geometry = &v->inner_geometry;
    rtt_stage_build(stage);
    for (k = 0; k < 3; k++)
        v->lights[k].position = rtt_v(3 - 3 * (float)k, 5, 4), v->lights[k].color = rtt_v(0.3f, 0.3f + 0.1f * (float)k, 0.4f);
    if (what & RTT_SPREAD) {
        v->lights[0].radius = 0.7f;
        v->lights[1].edges[0] = rtt_v(1, 0, 0), v->lights[1].edges[1] = rtt_v(0, 0.5f, 0), v->lights[1].by_area = true;
        v->options.lens.radius = 0.04f;
        v->options.filter = RT_FILTER_GAUSSIAN;
        v->options.sampler = RT_SAMPLER_STRATIFIED;
    }
    stage->scene.lights = v->lights, stage->scene.light_count = 3;
    stage->scene.ambient = rtt_gray(0.1f), stage->scene.background = rtt_v(0.3f, 0.5f, 0.8f);
    stage->scene.camera = (rt_camera){ { 0.6f, 2.4f, 4.5f }, { 0, 0.7f, 0 }, { 0, 1, 0 }, 50 };
    v->options.width = 37, v->options.height = 29, v->options.spp = 2, v->options.depth = 4;
    CHECK_STATUS(rt_check_scene(&stage->scene, NULL), RT_OK);
}

static void rtt_view_free(rtt_view *v)
{
    rtt_stage_free(&v->stage);
    rtt_model_free(&v->child);
    rtt_model_free(&v->inner);
}

/* Pictures by programs that leave out what each does not show: whole, in part, in pieces that little memory asks for, and with eye rays that
   are rasterised. Every picture of the other tests is drawn by the program for all. */
static void rtt_test_gpu_pictures(void)
{
    static const int shown[] = { 0, RTT_SHAPES | RTT_GLASS, RTT_MOVING | RTT_MIRRORS, RTT_TEXTURES | RTT_SPREAD, 127 };
    static const int tiles[2][4] = { { 0, 0, 37, 29 }, { 5, 3, 30, 22 } };
    static rt_vec3 want[37 * 29];
    rt_gpu_options open;
    rt_gpu *gpu[2];

    memset(&open, 0, sizeof open);
    open.memory_user = &rtt_device.memory;
    open.inexact = rtt.any_gpu;
    CHECK_STATUS(rt_gpu_open(&gpu[0], &open), RT_OK);
    open.memory_limit = 400000;             /* some hundred pixels at a time */
    CHECK_STATUS(rt_gpu_open(&gpu[1], &open), RT_OK);
    for (size_t i = 0; i < RTT_COUNT(shown); i++)
        for (int t = 0; t < 2; t++) {
            const int *tile = tiles[t];
            rt_ray_counts rays = { 0, 0, 0, 0 };
            rt_raster *raster = NULL;
            rtt_view v;
            char label[64];

            rtt_view_build(&v, shown[i]);
            CHECK_STATUS((rt_render_tile)(&v.stage.scene, &v.options, tile[0], tile[1], tile[2], tile[3], want, &rays), RT_OK);
            snprintf(label, sizeof label, "picture %d, tile %d", shown[i], t);
            rtt_compare_pictures(gpu[0], label, &v.stage.scene, &v.options, tile, want, &rays);
            snprintf(label, sizeof label, "picture %d, tile %d, little memory", shown[i], t);
            if (t == 0)
                rtt_compare_pictures(gpu[1], label, &v.stage.scene, &v.options, tile, want, &rays);
            if (!(shown[i] & (RTT_MOVING | RTT_SPREAD))) {
                CHECK_STATUS(rt_raster_create(&raster, v.stage.scene.geometry, &v.stage.scene.camera, 37, 29, NULL), RT_OK);
                v.options.raster = raster;
                snprintf(label, sizeof label, "picture %d, tile %d, rasterised", shown[i], t);
                rtt_compare_pictures(gpu[1 - t], label, &v.stage.scene, &v.options, tile, want, &rays);
                rt_raster_free(raster);
            }
            rtt_view_free(&v);
        }
    rt_gpu_close(gpu[0]);
    rt_gpu_close(gpu[1]);
}

/* Some pixels for every kernel of pictures: for simulators, as gpu.small. */
static void rtt_test_gpu_small_pictures(void)
{
    static rt_vec3 want[7 * 5];

    for (int k = 0; k < 2; k++) {
        const int tile[4] = { 0, 0, 7, 5 };
        rt_ray_counts rays = { 0, 0, 0, 0 };
        rt_raster *raster = NULL;
        rtt_view v;

        rtt_view_build(&v, k ? RTT_SHAPES | RTT_GLASS : 63);
        v.options.width = 7, v.options.height = 5, v.options.spp = 1, v.options.depth = 2;
        CHECK_STATUS((rt_render_tile)(&v.stage.scene, &v.options, 0, 0, 7, 5, want, &rays), RT_OK);
        CHECK(rays.shadow > 20 && rays.reflect > 2 && rays.refract > 2);
        if (k) {
            CHECK_STATUS(rt_raster_create(&raster, v.stage.scene.geometry, &v.stage.scene.camera, 7, 5, NULL), RT_OK);
            v.options.raster = raster;
        }
        if (rtt_device.gpu)
            rtt_compare_pictures(rtt_device.gpu, k ? "small, rasterised" : "small", &v.stage.scene, &v.options, tile, want, &rays);
        rt_raster_free(raster);
        rtt_view_free(&v);
    }
}

/* Each mistake has its status and message, and pictures are right afterwards; memory ends at each allocation, the device's and the host's. */
static void rtt_test_gpu_picture_mistakes(void)
{
    static rt_vec3 want[37 * 29], got[37 * 29];
    const rt_camera other = { { 0, 3, 5 }, { 0, 0.7f, 0 }, { 0, 1, 0 }, 40 };
    rt_ray_counts rays = { 0, 0, 0, 0 };
    rtt_memory memory = { 0 };
    rt_gpu_options open;
    rt_gpu_scene *there, *away;
    rt_render_options o;
    rt_raster *raster;
    rt_error error;
    rt_gpu *gpu, *beside;
    rtt_view v;
    size_t bytes, fail;
    bool done = false;

    memset(&open, 0, sizeof open);
    open.memory_user = &memory;
    open.inexact = rtt.any_gpu;
    open.error = &error;
    rtt_view_build(&v, RTT_SHAPES | RTT_GLASS);
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_open(&beside, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload_scene(gpu, &there, &v.stage.scene, &error), RT_OK);
    CHECK_STATUS(rt_gpu_upload_scene(beside, &away, &v.stage.scene, NULL), RT_OK);
    o = v.options;
    o.trace.error = &error;
#define RTT_REFUSED(call, status, word) do { CHECK_STATUS(call, status); CHECK(strstr(error.message, word)); } while (0)
    RTT_REFUSED(rt_gpu_upload_scene(NULL, &there, &v.stage.scene, &error), RT_ERROR_ARGUMENT, "gpu is NULL");
    RTT_REFUSED(rt_gpu_upload_scene(gpu, NULL, &v.stage.scene, &error), RT_ERROR_ARGUMENT, "out is NULL");
    RTT_REFUSED(rt_gpu_upload_scene(gpu, &away, NULL, &error), RT_ERROR_ARGUMENT, "scene is NULL");
    v.stage.scene.accel = NULL;
    away = there;
    RTT_REFUSED(rt_gpu_upload_scene(gpu, &away, &v.stage.scene, &error), RT_ERROR_ARGUMENT, "accel");
    CHECK(!away);
    v.stage.scene.accel = v.stage.accel;
    CHECK_STATUS(rt_gpu_upload_scene(beside, &away, &v.stage.scene, NULL), RT_OK);
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, NULL, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT);
    RTT_REFUSED(rt_gpu_render_tile(NULL, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "gpu is NULL");
    RTT_REFUSED(rt_gpu_render_tile(gpu, NULL, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "scene is NULL");
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, NULL, NULL), RT_ERROR_ARGUMENT, "pixels is NULL");
    RTT_REFUSED(rt_gpu_render_tile(gpu, away, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "another context");
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 38, 29, got, NULL), RT_ERROR_ARGUMENT, "leaves the picture");
    o.depth = 65;
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "depth");
    o.depth = 4, o.trace.algorithm = RT_KD_STACK;
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "kd.stack");
    o.trace.algorithm = RT_BVH_SIMD, o.trace.packet_width = 3;
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT);
    o.trace.algorithm = RT_AUTO, o.trace.packet_width = 0;
    CHECK_STATUS(rt_raster_create(&raster, v.stage.scene.geometry, &other, 37, 29, NULL), RT_OK);
    o.raster = raster;
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_ARGUMENT, "another picture");
    rt_gpu_set_camera(there, &other);
    v.stage.scene.camera = other;
    CHECK_STATUS((rt_render_tile)(&v.stage.scene, &v.options, 0, 0, 37, 29, want, &rays), RT_OK);
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_OK);
    CHECK(memcmp(want, got, sizeof want) == 0);
    o.raster = NULL;
    rt_raster_free(raster);
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_OK);
    CHECK(memcmp(want, got, sizeof want) == 0);
    memset(&rays, 0, sizeof rays);
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 3, 0, 3, 8, got, &rays), RT_OK);      /* nothing to draw */
    CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 0, 4, 37, 4, got, &rays), RT_OK);
    CHECK(memcmp(want, got, sizeof want) == 0 && rays.primary == 0);
    {
        rtt_view moving;
        const rt_scene *part;

        rtt_view_build(&moving, RTT_MOVING | RTT_NESTED);
        part = moving.parts[1], moving.parts[1] = NULL;
        RTT_REFUSED(rt_gpu_upload_scene(gpu, &away, &moving.stage.scene, &error), RT_ERROR_ARGUMENT, "instance 1");
        moving.parts[1] = part, moving.part.parts = NULL;
        RTT_REFUSED(rt_gpu_upload_scene(gpu, &away, &moving.stage.scene, &error), RT_ERROR_ARGUMENT, "parts");
        CHECK(!away);
        rtt_view_free(&moving);
        CHECK_STATUS(rt_gpu_upload_scene(beside, &away, &v.stage.scene, NULL), RT_OK);
    }
    bytes = rt_gpu_scene_bytes(there);
    rt_gpu_close(gpu);
    for (fail = 0; fail < 1000; fail++) {
        const size_t blocks = memory.blocks;

        CHECK_STATUS(rt_gpu_upload_scene(beside, &there, &v.stage.scene, NULL), RT_OK);
        rt_gpu_free_scene(there);
        CHECK(memory.blocks == blocks);
    }
    rt_gpu_close(beside);
    rt_gpu_free_scene(NULL);
    open.memory_limit = bytes - 1;
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    RTT_REFUSED(rt_gpu_upload_scene(gpu, &there, &v.stage.scene, &error), RT_ERROR_MEMORY, "MB");
    CHECK(!there && gpu->used == 0);
    rt_gpu_close(gpu);
    open.memory_limit = bytes + 100;        /* not one pixel */
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload_scene(gpu, &there, &v.stage.scene, &error), RT_OK);
    RTT_REFUSED(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_ERROR_MEMORY, "MB");
    rt_gpu_close(gpu);
    open.memory_limit = bytes + 2000000;    /* what rays have taken makes way for a picture, and for what is asked for */
    CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK);
    CHECK_STATUS(rt_gpu_upload_scene(gpu, &there, &v.stage.scene, &error), RT_OK);
    {
        enum { COUNT = 36000 };
        rt_ray *many = (rt_ray *)rtt_array(COUNT, sizeof *many);
        rt_hit *hits = (rt_hit *)rtt_array(COUNT, sizeof *hits);
        rt_gpu_buffer *buffer;

        memset(many, 0, COUNT * sizeof *many);
        CHECK_STATUS(rt_gpu_trace(gpu, there->accel, NULL, many, COUNT, hits), RT_OK);
        CHECK_STATUS(rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL), RT_OK);
        CHECK(memcmp(want, got, sizeof want) == 0);
        CHECK_STATUS(rt_gpu_buffer_new(gpu, &buffer, 1900000, &error), RT_OK);
        free(many);
        free(hits);
    }
    rt_gpu_close(gpu);
    open.memory_limit = 0;
    for (fail = 1; !done && fail < 300; fail++) {
        memory.calls = 0;
        memory.fail_at = fail;
        done = rt_gpu_open(&gpu, &open) == RT_OK && rt_gpu_upload_scene(gpu, &there, &v.stage.scene, &error) == RT_OK
            && rt_gpu_render_tile(gpu, there, &o, 0, 0, 37, 29, got, NULL) == RT_OK;
        CHECK(done || error.status == RT_ERROR_MEMORY);
        rt_gpu_close(gpu);
        CHECK(memory.blocks == 0);
    }
    CHECK(done && memcmp(want, got, sizeof want) == 0);
    rtt_view_free(&v);
#undef RTT_REFUSED
}
#endif

/* Batches that follow each other without a wait, in two contexts that take turns; events say when each is done. */
static void rtt_test_gpu_async(void)
{
    enum { BATCHES = 8 };
    rtt_model world = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu *gpu[2];
    rt_gpu_accel *there[2];
    rt_gpu_buffer *from[2], *to[2][BATCHES];
    rt_gpu_event *events[2][BATCHES];
    rt_gpu_options open;
    rtt_accels accels;
    rt_hit *want, *got;
    size_t bytes;

    rtt_gpu_scene(&world, &child, &rays, RT_KDTREE);
    want = (rt_hit *)rtt_array(rays.count, sizeof *want);
    got = (rt_hit *)rtt_array(rays.count, sizeof *got);
    bytes = rays.count * sizeof *got;
    memset(&open, 0, sizeof open);
    open.memory_user = &rtt_device.memory;
    open.inexact = rtt.any_gpu;
    if (!rtt_accels_build(&accels, &world))
        return;
    for (size_t i = 0; i < rays.count; i++)
        want[i] = rtt_closest(&world, &rays.ray[i]);
    for (int k = 0; k < 2; k++) {
        CHECK_STATUS(rt_gpu_open(&gpu[k], &open), RT_OK);
        CHECK_STATUS(rt_gpu_upload(gpu[k], &there[k], accels.of[k ? RT_THREADED : RT_KDTREE], NULL), RT_OK);
        CHECK_STATUS(rt_gpu_buffer_new(gpu[k], &from[k], rays.count * sizeof *rays.ray, NULL), RT_OK);
        CHECK_STATUS(rt_gpu_write(from[k], 0, rays.ray, rays.count * sizeof *rays.ray, NULL), RT_OK);
        for (int b = 0; b < BATCHES; b++) CHECK_STATUS(rt_gpu_buffer_new(gpu[k], &to[k][b], bytes, NULL), RT_OK);
    }
    for (int b = 0; b < BATCHES; b++)
        for (int k = 0; k < 2; k++)
            CHECK_STATUS(rt_gpu_trace_buffers(gpu[k], there[k], NULL, from[k], NULL, rays.count, to[k][b], &events[k][b]), RT_OK);
    for (int b = BATCHES; b-- > 0;)
        for (int k = 0; k < 2; k++) {
            double seconds = -1;

            if (b % 3 == 0)
                while (!rt_gpu_done(events[k][b])) {}
            if (b % 2) CHECK_STATUS(rt_gpu_wait(events[k][b], &seconds, NULL), RT_OK);
            CHECK(b % 2 == 0 || (seconds > 0 && seconds < 60));
            CHECK_STATUS(rt_gpu_read(to[k][b], 0, got, bytes, NULL), RT_OK);
            CHECK(memcmp(got, want, bytes) == 0);
        }
    for (int k = 0; k < 2; k++) {
        CHECK_STATUS(rt_gpu_finish(gpu[k], NULL), RT_OK);
        rt_gpu_free(there[k]);
        rt_gpu_buffer_free(from[k]);
        rt_gpu_close(gpu[k]);               /* with the events that nobody waited for */
    }
    rtt_accels_free(&accels);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
    free(want);
    free(got);
}

static size_t rtt_resident(void)
{
    unsigned long kilobytes = 0;
    char line[256];
    FILE *file = fopen("/proc/self/status", "r");

    while (file && fgets(line, sizeof line, file) && sscanf(line, "VmRSS: %lu", &kilobytes) != 1) { }
    if (!kilobytes)
        rtt_die("/proc/self/status");
    fclose(file);
    return 1024 * (size_t)kilobytes;
}

/* 10,000 times an accel, a buffer and a trace; and contexts. What PoCL keeps of programs is not counted: they are compiled before. */
static void rtt_test_gpu_cycles(void)
{
    rtt_model world = { 0 }, child = { 0 };
    rtt_rays rays = { 0 };
    rt_gpu_options open;
    rtt_accels accels;
    rt_gpu *gpu = NULL;
    size_t start = 0, blocks = rtt_device.memory.blocks;
    rt_hit hit;

    rtt_gpu_scene(&world, &child, &rays, RT_BVH);
    memset(&open, 0, sizeof open);
    open.memory_user = &rtt_device.memory;
    open.inexact = rtt.any_gpu;
    if (!rtt_accels_build(&accels, &world) || !CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK))
        return;
    for (int i = 0; i < 10000; i++) {
        rt_gpu_accel *there;
        rt_gpu_buffer *buffer;

        if (i == 500)
            start = rtt_resident();
        if (rt_gpu_upload(gpu, &there, accels.of[i % RT_STRUCTURE_COUNT], NULL) != RT_OK || rt_gpu_buffer_new(gpu, &buffer, 1 << 20, NULL) != RT_OK
            || rt_gpu_write(buffer, (size_t)i, &hit, sizeof hit, NULL) != RT_OK || rt_gpu_trace(gpu, there, NULL, rays.ray, 1, &hit) != RT_OK) {
            rtt_fail("cycle %d", i);
            break;
        }
        rt_gpu_free(there);
        rt_gpu_buffer_free(buffer);
    }
    rt_gpu_close(gpu);
    if (rtt_resident() > start + (4u << 20))
        rtt_fail("9,500 accels: from %.1f to %.1f MB", 1e-6 * (double)start, 1e-6 * (double)rtt_resident());
    for (int i = 0; i < 1000; i++) {
        if (i == 100)
            start = rtt_resident();
        if (!CHECK_STATUS(rt_gpu_open(&gpu, &open), RT_OK))
            break;
        rt_gpu_close(gpu);
    }
    if (rtt_resident() > start + (4u << 20))
        rtt_fail("900 contexts: from %.1f to %.1f MB", 1e-6 * (double)start, 1e-6 * (double)rtt_resident());
    CHECK(rtt_device.memory.blocks == blocks);
    rtt_accels_free(&accels);
    rtt_model_free(&world);
    rtt_model_free(&child);
    rtt_rays_free(&rays);
}

/* ---- >>main ----------------------------------------------------------------------------------------------------------- */

static const rtt_test rtt_tests[] = {
    { "oracle", rtt_test_oracle },
    { "status.strings", rtt_test_status_strings },
    { "hits.empty", rtt_test_empty },
    { "hits.few", rtt_test_few },
    { "hits.random", rtt_test_random },
    { "hits.far", rtt_test_far },
    { "hits.grid", rtt_test_grid },
    { "hits.coplanar", rtt_test_coplanar },
    { "hits.spheres", rtt_test_spheres },
    { "hits.sphere-cases", rtt_test_sphere_cases },
    { "hits.sphere-start", rtt_test_sphere_start },
    { "hits.short-rays", rtt_test_short_rays },
    { "hits.mixed", rtt_test_mixed },
    { "hits.ties", rtt_test_ties },
    { "ground", rtt_test_ground },
    { "ground.bad", rtt_test_ground_bad },
    { "ground.raster", rtt_test_ground_raster },
    { "motion", rtt_test_motion },
    { "motion.turn", rtt_test_motion_turn },
    { "motion.transform", rtt_test_motion_transform },
    { "motion.bad", rtt_test_motion_bad },
    { "motion.refit", rtt_test_motion_refit },
    { "instances.affine", rtt_test_instances },
    { "instances.skewed", rtt_test_instances_skewed },
    { "instances.tiny", rtt_test_instances_tiny },
    { "instances.deep", rtt_test_instances_deep },
    { "instances.paths", rtt_test_instances_paths },
    { "instances.transform", rtt_test_instance_transform },
    { "instances.bad", rtt_test_instances_bad },
    { "ugly.degenerate", rtt_test_degenerate },
    { "ugly.log-spaced", rtt_test_log_spaced },
    { "ugly.extremes", rtt_test_extremes },
    { "ugly.unsplittable", rtt_test_unsplittable },
    { "ugly.garbage", rtt_test_garbage },
    { "rays.ugly", rtt_test_ugly_rays },
    { "rays.intervals", rtt_test_intervals },
    { "rays.batches", rtt_test_batches },
    { "rays.arrays", rtt_test_arrays },
    { "rays.arrays.errors", rtt_test_arrays_errors },
    { "packets", rtt_test_packets },
    { "packets.crowds", rtt_test_crowds },
    { "packets.dead", rtt_test_crowds_dead },
    { "watertight.shapes", rtt_test_watertight },
    { "watertight.grid", rtt_test_watertight_grid },
    { "watertight.many", rtt_test_watertight_many },
#if RTI_X86
    { "watertight.flush-to-zero", rtt_test_flush_to_zero },
#endif
    { "refit.moves", rtt_test_refit },
    { "refit.errors", rtt_test_refit_errors },
    { "refit.nested", rtt_test_refit_nested },
    { "build.parallel", rtt_test_parallel },
    { "build.pinned", rtt_test_pinned },
    { "build.bad", rtt_test_bad_primitives },
    { "build.layouts", rtt_test_layouts },
    { "build.million", rtt_test_million },
    { "build.quality", rtt_test_quality },
    { "build.reinsertion", rtt_test_reinsertion },
    { "memory.out-of", rtt_test_out_of_memory },
    { "options.trace", rtt_test_trace_options },
    { "options.build", rtt_test_build_options },
#ifndef RT_NO_STATS
    { "stats", rtt_test_stats },
#endif
    { "kdtree.planes", rtt_test_kd_planes },
    { "kdtree.deep", rtt_test_kd_deep },
    { "kdtree.nested", rtt_test_kd_nested },
    { "kdtree.revisits", rtt_test_kd_revisits },
    { "kdtree.limits", rtt_test_kd_limits },
#ifndef RT_NO_PACKETS
    { "build.collapse", rtt_test_collapse },
#endif
    { "build.less", rtt_test_less },
    { "build.no-binary", rtt_test_no_binary },
    { "kdtree.info", rtt_test_kd_info },
    { "kdtree.options", rtt_test_kd_options },
    { "kdtree.refused", rtt_test_kd_refused },
#ifndef RT_NO_STATS
    { "kdtree.counts", rtt_test_kd_counts },
    { "kdtree.stats", rtt_test_kd_stats },
#endif
    { "threads", rtt_test_threads },
#ifndef RT_NO_SHADING
    { "threaded.options", rtt_test_threaded_options },
    { "threaded.stats", rtt_test_threaded_stats },
    { "threaded.nested", rtt_test_threaded_nested },
    { "sampling.uniform", rtt_test_sampling_uniform },
    { "sampling.strata", rtt_test_sampling_strata },
    { "sampling.independence", rtt_test_sampling_independence },
    { "sampling.convergence", rtt_test_sampling_convergence },
    { "sampling.golden", rtt_test_sampling_golden },
    { "distribution.lobe", rtt_test_lobe },
    { "distribution.lights", rtt_test_area_lights },
    { "distribution.penumbra", rtt_test_penumbra },
    { "distribution.coverage", rtt_test_coverage },
    { "distribution.confusion", rtt_test_confusion },
    { "distribution.streak", rtt_test_streak },
    { "distribution.ways", rtt_test_distribution_ways },
    { "distribution.parts", rtt_test_parts },
    { "distribution.errors", rtt_test_distribution_errors },
    { "textures.levels", rtt_test_texture_levels },
    { "textures.filter", rtt_test_texture_filter },
    { "textures.shimmer", rtt_test_texture_shimmer },
    { "textures.bump", rtt_test_bump },
    { "textures.mapping", rtt_test_texture_mapping },
    { "textures.check", rtt_test_texture_check },
    { "textures.ways", rtt_test_texture_ways },
    { "textures.instances", rtt_test_texture_instances },
    { "loaders.obj.textures", rtt_test_obj_textures },
    { "programs.imp", rtt_test_imp },
    { "programs.animate", rtt_test_animate },
    { "programs.report", rtt_test_report },
    { "programs.bake", rtt_test_bake },
    { "programs.lidar", rtt_test_lidar },
    { "programs.recipes", rtt_test_recipes },
    { "spawn", rtt_test_spawn },
    { "refine.estimate", rtt_test_refine_estimate },
    { "refine.bias", rtt_test_refine_bias },
    { "refine.failure", rtt_test_refine_failure },
    { "shading.large-triangles", rtt_test_large_triangles },
    { "shading.math", rtt_test_shading_math },
    { "shading.camera", rtt_test_camera },
    { "shading.render", rtt_test_render },
    { "shading.instances", rtt_test_render_instances },
    { "shading.mirror", rtt_test_render_mirror },
    { "shading.slab", rtt_test_render_slab },
    { "shading.fresnel", rtt_test_render_fresnel },
    { "shading.depth", rtt_test_render_depth },
    { "shading.bounded", rtt_test_render_bounded },
    { "shading.ways", rtt_test_render_ways },
    { "shading.check-scene", rtt_test_check_scene },
    { "shading.errors", rtt_test_render_errors },
    { "raster.shapes", rtt_test_raster_shapes },
    { "raster.instances", rtt_test_raster_instances },
    { "raster.skewed", rtt_test_raster_skewed },
    { "raster.ugly", rtt_test_raster_ugly },
    { "raster.margins", rtt_test_raster_margins },
    { "raster.huge", rtt_test_raster_huge },
    { "raster.threads", rtt_test_raster_threads },
    { "raster.memory", rtt_test_raster_memory },
    { "raster.errors", rtt_test_raster_errors },
    { "raster.render", rtt_test_raster_render },
#endif
    { "loaders.obj.numbers", rtt_test_obj_numbers },
    { "loaders.obj.lines", rtt_test_obj_lines },
    { "loaders.obj.polygons", rtt_test_obj_polygons },
    { "loaders.obj.corners", rtt_test_obj_corners },
    { "loaders.obj.order", rtt_test_obj_order },
    { "loaders.obj.colors", rtt_test_obj_colors },
    { "loaders.obj.materials", rtt_test_obj_materials },
    { "loaders.obj.errors", rtt_test_obj_errors },
    { "loaders.obj.warnings", rtt_test_obj_warnings },
    { "loaders.nff.statements", rtt_test_nff_statements },
    { "loaders.nff.errors", rtt_test_nff_errors },
    { "loaders.procedural", rtt_test_procedural },
    { "loaders.procedural.sphere", rtt_test_procedural_sphere },
    { "loaders.scene.camera", rtt_test_scene_camera },
    { "loaders.scene.view", rtt_test_scene_view },
    { "loaders.scene.ppm", rtt_test_scene_ppm },
    { "loaders.scene.oom", rtt_test_scene_oom },
    { "loaders.scene.files", rtt_test_scene_files },
    { "loaders.pool", rtt_test_pool },
    { "programs.quick-start", rtt_test_quick_start },
    { "programs.readme", rtt_test_readme },
    { "gpu.devices", rtt_test_gpu_devices },
    { "gpu.small", rtt_test_gpu_small },
    { "gpu.large", rtt_test_gpu_large },
    { "gpu.specialised", rtt_test_gpu_specialised },
    { "gpu.mistakes", rtt_test_gpu_mistakes },
    { "gpu.log", rtt_test_gpu_log },
    { "gpu.memory", rtt_test_gpu_memory },
#ifndef RT_NO_SHADING
    { "gpu.small.pictures", rtt_test_gpu_small_pictures },
    { "gpu.pictures", rtt_test_gpu_pictures },
    { "gpu.programs", rtt_test_gpu_programs },
    { "gpu.pictures.mistakes", rtt_test_gpu_picture_mistakes },
#endif
    { "gpu.async", rtt_test_gpu_async },
    { "gpu.cycles", rtt_test_gpu_cycles },
};

int main(int argc, char **argv)
{
    int passed = 0, failed = 0, filters = 0, withouts = 0;
    const char *without[16];

    setenv("POCL_SIGFPE_HANDLER", "0", 1);  /* else programs go on after a division by zero */
    setvbuf(stdout, NULL, _IOLBF, 0);       /* a crash loses no line */
    rtt.seed = 1;
    rtt.scale = 1;
    rtt.test = "start";
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], "--list") == 0) {
            for (size_t t = 0; t < RTT_COUNT(rtt_tests); t++)
                printf("%s\n", rtt_tests[t].name);
            return 0;
        } else if (strcmp(argv[i], "--seed") == 0 && i + 1 < argc)
            rtt.seed = strtoull(argv[++i], NULL, 0);
        else if (strcmp(argv[i], "--scale") == 0 && i + 1 < argc && strtoul(argv[i + 1], NULL, 10) > 0)
            rtt.scale = strtoul(argv[++i], NULL, 10);
        else if (strcmp(argv[i], "--big") == 0)
            rtt.big = true;
        else if (strcmp(argv[i], "--no-gpu") == 0)
            rtt.no_gpu = true;
        else if (strcmp(argv[i], "--any-gpu") == 0)
            rtt.any_gpu = true;
        else if (strcmp(argv[i], "--without") == 0 && i + 1 < argc && withouts < (int)RTT_COUNT(without))
            without[withouts++] = argv[++i];
        else if (argv[i][0] == '-') {
            fprintf(stderr, "usage: %s [--list] [--seed N] [--scale N] [--big] [--no-gpu | --any-gpu] [--without NAME]... [NAME]...\n", argv[0]);
            return 2;
        } else
            argv[1 + filters++] = argv[i];
    rtt_ways_find();
    if (!rtt.no_gpu)
        rtt_device_open();
    printf("seed %llu, %s, %zu ways to trace\n", (unsigned long long)rtt.seed, rtt_isa_names[rt_best_isa()], rtt_way_count);
    failed += rtt.failures > 0;             /* a way that should be open is not */
    for (size_t t = 0; t < RTT_COUNT(rtt_tests); t++) {
        double start = rtt_seconds();
        bool wanted = filters == 0;

        for (int i = 1; i <= filters; i++)
            wanted = wanted || strstr(rtt_tests[t].name, argv[i]);
        for (int i = 0; i < withouts; i++)
            wanted = wanted && !strstr(rtt_tests[t].name, without[i]);
        if (!wanted || (rtt.no_gpu && strncmp(rtt_tests[t].name, "gpu.", 4) == 0))
            continue;
        rtt.test = rtt_tests[t].name;
        rtt.failures = 0;
        rtt_tests[t].run();
        if (rtt_heap.live != 0 || rtt_heap.blocks != 0) {
            rtt_fail("%zu bytes not freed", rtt_heap.live);
            rtt_heap.live = rtt_heap.blocks = 0;
        }
        printf("%-4s %-22s %6.2f s\n", rtt.failures ? "FAIL" : "ok", rtt.test, rtt_seconds() - start);
        fflush(stdout);
        passed += rtt.failures == 0;
        failed += rtt.failures != 0;
    }
    if (passed + failed == 0) {
        printf("no test has a name like that: see --list\n");
        failed = 1;
    }
    printf("hits checksum: 0x%016llx over %llu rays in %llu cases\n", (unsigned long long)rtt.checksum, (unsigned long long)rtt.rays,
           (unsigned long long)rtt.cases);
    if (rtt_device.gpu)
        printf("%zu programs for the device\n", rt_gpu_program_count(rtt_device.gpu));
    rt_gpu_close(rtt_device.gpu);
    if (rtt_device.memory.blocks != 0) {
        printf("FAIL %zu blocks of the device's context not freed\n", rtt_device.memory.blocks);
        failed++;
    }
    printf("%d passed, %d failed, 0 skipped\n", passed, failed);
    return failed ? 1 : 0;
}
