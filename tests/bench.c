/* bench.c - speed of every algorithm on every kind of ray, with Embree beside them; and the tables of the papers that the algorithms
   come from, on our machine.    SPDX-License-Identifier: MIT OR Unlicense

   >>vectors  >>memory  >>rays  >>entries  >>embree  >>arguments  >>measure  >>output  >>plots  >>scenes  >>speed, bench_horn.h,
   bench_overbeck.h, bench_lohr.h, bench_peers.h, bench_gpu.h, >>main

   How the numbers are made
     rays       One array for each scene and kind, made once, given to every algorithm in the same order. Primary rays of a pinhole, in
                tiles of 32 x 32 pixels in Z order, so that 4, 8, 16, 64, 256 and 1024 rays that follow each other are blocks of
                2 x 2, 4 x 2, 4 x 4 ... 32 x 32 pixels. Secondary rays keep the order of their primary rays; a primary ray that
                misses has none.
     time       Rounds A B C ... A B C ...; the number is their median. One measurement traces the whole array as often as it takes
                to fill MEASURE_SECONDS.
     counts     From a pass of its own before that, so that counting is not timed; it also warms up.
     checks     Every hit of every algorithm is compared with those of rt_trace's defaults, bit for bit: a difference is an error.
                Embree's hits are compared for information; it rounds differently.
     peers      Embree gets its own layout of the same rays, filled outside the timing, as ours are. It flushes denormals to zero, as
                its documentation asks for; ours run with the processor as every program finds it. */

#define _POSIX_C_SOURCE 200809L

#include <stddef.h>

/* What a builder holds. Builds that are not counted give no memory_user. */
typedef struct { size_t bytes, peak; } memory_count;
static void *counted_alloc(size_t size, memory_count *count);
static void counted_free(void *pointer, memory_count *count);

#define RT_MALLOC(size, user) counted_alloc(size, user)
#define RT_FREE(pointer, user) counted_free(pointer, user)
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"
#include "../examples/pool.h"
#include "../examples/scene.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#ifdef RT_BENCH_EMBREE
#include <embree3/rtcore.h>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif
#endif

#define MEASURE_SECONDS 0.1                 /* the least work that one measurement times, where the table does not say less */
#define CHUNK 16384u                        /* rays a thread takes at once, of several threads: a multiple of every packet size */
#define RAY_EPSILON 1e-4f                   /* secondary rays start and end this far, in units of their length, off what they join */
#define MAX_ROUNDS 1000
#define MAX_IMAGE 16384
#define MAX_WIDTHS 16
#define SPEED_SIZE 512                      /* of the pictures, and measured rounds, where no option says */
#define SPEED_ROUNDS 5                      /* the papers' tables have their own */

static const char *const default_scenes[] = { "cornell", "balls:3", "sphere:100000", "terrain:200000", "cloud:100000" };

/* ---- >>vectors ------------------------------------------------------------------------------------------------------ */

static rt_vec3 vec(float x, float y, float z)
{
    rt_vec3 v;
    v.x = x, v.y = y, v.z = z;
    return v;
}

static float dot(rt_vec3 a, rt_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static float length(rt_vec3 a) { return sqrtf(dot(a, a)); }
static rt_vec3 sub(rt_vec3 a, rt_vec3 b) { return vec(a.x - b.x, a.y - b.y, a.z - b.z); }
static rt_vec3 add_scaled(rt_vec3 a, rt_vec3 b, float s) { return vec(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s); }
static rt_vec3 cross(rt_vec3 a, rt_vec3 b) { return vec(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x); }
static rt_vec3 unit(rt_vec3 a) { return add_scaled(vec(0, 0, 0), a, 1 / length(a)); }

/* ---- >>memory ------------------------------------------------------------------------------------------------------- */

enum { COUNTED_HEAD = 16 };                 /* room for a block's size before it; keeps malloc's alignment */

static void *counted_alloc(size_t size, memory_count *count)
{
    char *block = size <= SIZE_MAX - COUNTED_HEAD ? malloc(size + COUNTED_HEAD) : NULL;
    size_t bytes, peak;

    if (!block) return NULL;
    memcpy(block, &size, sizeof size);
    if (count) {
        bytes = __atomic_add_fetch(&count->bytes, size, __ATOMIC_RELAXED);
        peak = __atomic_load_n(&count->peak, __ATOMIC_RELAXED);
        while (peak < bytes && !__atomic_compare_exchange_n(&count->peak, &peak, bytes, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) { }
    }
    return block + COUNTED_HEAD;
}

static void counted_free(void *pointer, memory_count *count)
{
    char *block = (char *)pointer - COUNTED_HEAD;
    size_t size;

    if (!pointer) return;
    memcpy(&size, block, sizeof size);
    if (count) __atomic_sub_fetch(&count->bytes, size, __ATOMIC_RELAXED);
    free(block);
}

/* ---- >>rays --------------------------------------------------------------------------------------------------------- */

typedef enum { PRIMARY, SHADOW, REFLECT, DIFFUSE, KIND_COUNT } ray_kind;
static const char *const kind_names[KIND_COUNT] = { "primary", "shadow", "reflect", "diffuse" };

typedef struct {
    ray_kind kind;
    const char *label;                      /* the kind, and in papers' tables which bounce */
    double seconds;                         /* the least work that one measurement times */
    rt_query query;
    const rt_ray *rays;
    size_t count;
    const rt_hit *truth;                    /* what every algorithm must find */
    rt_hit *hits;                           /* what the one that ran last has found */
    uint32_t *packets;                      /* the rays in a peer's layout, and its answers */
} batch;

enum { TILE = 32, TILE_RAYS = TILE * TILE };

/* Bits 0, 2, 4, 6 and 8 of i, put together: x of the i-th cell along a Z curve over a tile; of i / 2: y. */
static int even_bits(unsigned i)
{
    return (int)((i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8) | (i >> 4 & 16));
}

/* One ray through the middle of each pixel; rays has room for width * height. */
static void make_primary(const rt_camera *camera, int width, int height, rt_ray *rays)
{
    int tile_x, tile_y;
    size_t count = 0;
    unsigned i;

    for (tile_y = 0; tile_y < height; tile_y += TILE)
        for (tile_x = 0; tile_x < width; tile_x += TILE)
            for (i = 0; i < TILE_RAYS; i++) {
                int x = tile_x + even_bits(i), y = tile_y + even_bits(i >> 1);
                if (x < width && y < height)
                    rays[count++] = rt_camera_ray(camera, (float)x + 0.5f, (float)y + 0.5f, width, height);
            }
}

/* A number in [0,1) for each n, always the same: the finaliser of MurmurHash3. */
static float hashed(uint32_t n)
{
    n = (n ^ n >> 16) * 0x85ebca6bu;
    n = (n ^ n >> 13) * 0xc2b2ae35u;
    n ^= n >> 16;
    return (float)(n >> 8) * (1.0f / 16777216.0f);
}

static uint32_t vertex_index(const rt_geometry *geometry, size_t corner)
{
    return geometry->indices ? geometry->indices[corner] : (uint32_t)corner;
}

static rt_vec3 vertex_at(const rt_geometry *geometry, size_t index)
{
    rt_vec3 v;
    size_t stride = geometry->vertex_stride ? geometry->vertex_stride : sizeof v;
    memcpy(&v, (const char *)geometry->vertices + stride * index, sizeof v);
    return v;
}

/* The surface's true normal at a hit, of unit length, outwards. */
static rt_vec3 outer_normal(const rt_geometry *geometry, const rt_hit *hit, rt_vec3 point)
{
    rt_vec3 corner[3];
    size_t i;

    if (hit->prim >= geometry->triangle_count) return unit(sub(point, geometry->spheres[hit->prim - geometry->triangle_count].center));
    for (i = 0; i < 3; i++) corner[i] = vertex_at(geometry, vertex_index(geometry, 3 * (size_t)hit->prim + i));
    return unit(cross(sub(corner[1], corner[0]), sub(corner[2], corner[0])));
}

/* The same, towards where the ray came from. */
static rt_vec3 facing_normal(const rt_geometry *geometry, const rt_hit *hit, rt_vec3 point, rt_vec3 dir)
{
    const rt_vec3 n = outer_normal(geometry, hit, point);
    return dot(n, dir) > 0 ? vec(-n.x, -n.y, -n.z) : n;
}

/* Cosine-weighted direction about n: a point of the unit sphere, shifted by n. */
static rt_vec3 diffuse_direction(rt_vec3 n, uint32_t seed)
{
    float z = 1 - 2 * hashed(2 * seed), r = sqrtf(1 - z * z), phi = 6.2831853f * hashed(2 * seed + 1);
    rt_vec3 d = add_scaled(n, vec(r * cosf(phi), r * sinf(phi), z), 0.999f);    /* less than 1: never the zero vector */
    return unit(d);
}

/* Rays of one secondary kind from where the primary rays hit; returns how many. rays has room for count. */
static size_t make_secondary(ray_kind kind, const rt_geometry *geometry, rt_vec3 light, const rt_ray *primary, const rt_hit *hits,
                             size_t count, rt_ray *rays)
{
    size_t i, made = 0;

    for (i = 0; i < count; i++) {
        rt_ray ray;
        rt_vec3 n;
        if (hits[i].prim == RT_NONE) continue;
        ray.org = add_scaled(primary[i].org, primary[i].dir, hits[i].t);
        if (kind == SHADOW) {
            ray.dir = sub(light, ray.org);
            ray.tmin = RAY_EPSILON;
            ray.tmax = 1 - RAY_EPSILON;
        } else {
            n = facing_normal(geometry, &hits[i], ray.org, primary[i].dir);
            if (kind == REFLECT) ray.dir = unit(add_scaled(primary[i].dir, n, -2 * dot(n, primary[i].dir)));
            else ray.dir = diffuse_direction(n, (uint32_t)i);
            ray.tmin = RAY_EPSILON * hits[i].t * length(primary[i].dir);
            ray.tmax = INFINITY;
        }
        rays[made++] = ray;
    }
    return made;
}

/* ---- >>entries ------------------------------------------------------------------------------------------------------ */

/* One row of the table: an algorithm of ours on a structure, or a mode of a peer. */
typedef struct entry entry;
struct entry {
    const char *name, *structure;
    int packet;                             /* width; 0: auto chooses it */
    size_t bytes;
    double build_seconds;
    bool counted;                           /* stats are known */
    rt_stats stats;
    double seconds[MAX_ROUNDS];             /* of one pass over the rays, by round */
    double median, spread;                  /* spread: (slowest - fastest) / median */
    size_t other_hits, other_prims;         /* rays whose hit, or only whose primitive, is not that of truth */

    void (*prepare)(const entry *, const batch *, size_t first, size_t last);       /* untimed, before each pass; may be NULL */
    void (*trace)(const entry *, const batch *, size_t first, size_t last);
    void (*compare)(entry *, const batch *);

    const rt_accel *accel;                  /* ours */
    rt_trace_options options;
#ifdef RT_BENCH_EMBREE
    RTCScene peer;                          /* Embree's */
    unsigned triangle_count;
    bool stream;                            /* all rays in one call */
    int coherence;                          /* what Embree is told of the rays: 1 coherent, -1 incoherent, 0 as their kind is */
#endif
};

static void our_trace(const entry *e, const batch *b, size_t first, size_t last)
{
    rt_trace(e->accel, &e->options, b->rays + first, last - first, b->hits + first);    /* counting pass: its options are allowed */
}

static void our_compare(entry *e, const batch *b)
{
    size_t i;
    e->other_hits = 0;
    for (i = 0; i < b->count; i++) e->other_hits += memcmp(&b->hits[i], &b->truth[i], sizeof(rt_hit)) != 0;
}

#ifdef RT_BENCH_EMBREE

/* ---- >>embree ------------------------------------------------------------------------------------------------------- */

static const struct {
    const char *name;
    int packet;
    enum RTCSceneFlags flags;
} embree_modes[] = {
    { "embree.single",         1, RTC_SCENE_FLAG_NONE },   { "embree.packet4",         4, RTC_SCENE_FLAG_NONE },
    { "embree.packet8",        8, RTC_SCENE_FLAG_NONE },   { "embree.robust.single",   1, RTC_SCENE_FLAG_ROBUST },
    { "embree.robust.packet4", 4, RTC_SCENE_FLAG_ROBUST }, { "embree.robust.packet8",  8, RTC_SCENE_FLAG_ROBUST },
};
enum { EMBREE_MODES = sizeof embree_modes / sizeof *embree_modes };

/* A packet of n rays is 20 rows of n words, which for n = 1, 4, 8, 16 is RTCRayHit, RTCRayHit4, RTCRayHit8, RTCRayHit16. Where any hit
   will do it is the first 12 of them: RTCRay, RTCRay4, RTCRay8, RTCRay16. */
enum { ROW_ORG = 0, ROW_TNEAR = 3, ROW_DIR = 4, ROW_TIME = 7, ROW_TFAR = 8, ROW_MASK = 9, ROW_ID = 10, ROW_FLAGS = 11,
       ROW_PRIM = 17, ROW_GEOMETRY = 18, ROW_INSTANCE = 19, ROWS = 20, ROWS_ANY = 12 };
enum { EMBREE_WIDEST = 16 };

static uint32_t *embree_lane(const entry *e, const batch *b, size_t ray)
{
    const size_t width = (size_t)e->packet, rows = b->query == RT_ANY ? ROWS_ANY : ROWS;
    return b->packets + ray / width * width * rows + ray % width;
}

/* Room for count rays in packets of any width; NULL: out of memory. */
static uint32_t *embree_packets(size_t count)
{
    void *out;
    return posix_memalign(&out, 64, (count + EMBREE_WIDEST - 1) * ROWS * sizeof(uint32_t)) == 0 ? out : NULL;
}

static uint32_t bits_of(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

static float float_of(uint32_t bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

static void embree_prepare(const entry *e, const batch *b, size_t first, size_t last)
{
    const size_t width = (size_t)e->packet, rows = b->query == RT_ANY ? ROWS_ANY : ROWS;
    size_t i;

    for (i = first; i < last; i++) {
        const rt_ray *ray = &b->rays[i];
        const uint32_t row[ROWS] = { bits_of(ray->org.x), bits_of(ray->org.y), bits_of(ray->org.z), bits_of(ray->tmin),
                                     bits_of(ray->dir.x), bits_of(ray->dir.y), bits_of(ray->dir.z), bits_of(0),
                                     bits_of(ray->tmax), ~0u, 0, 0, 0, 0, 0, 0, 0, RTC_INVALID_GEOMETRY_ID,
                                     RTC_INVALID_GEOMETRY_ID, RTC_INVALID_GEOMETRY_ID };
        uint32_t *lane = embree_lane(e, b, i);
        size_t k;
        for (k = 0; k < rows; k++) lane[k * width] = row[k];
    }
}

/* Flushes denormals to zero, results and operands, on this thread; returns what embree_leave restores. */
static unsigned embree_enter(void)
{
#ifdef __SSE2__
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040);
    return before;
#else
    return 0;
#endif
}

static void embree_leave(unsigned before)
{
#ifdef __SSE2__
    _mm_setcsr(before);
#else
    (void)before;
#endif
}

static void embree_closest(const entry *e, struct RTCIntersectContext *context, const int *valid, void *packet)
{
    if (e->packet == 1) rtcIntersect1(e->peer, context, packet);
    else if (e->packet == 4) rtcIntersect4(valid, e->peer, context, packet);
    else if (e->packet == 8) rtcIntersect8(valid, e->peer, context, packet);
    else rtcIntersect16(valid, e->peer, context, packet);
}

static void embree_any(const entry *e, struct RTCIntersectContext *context, const int *valid, void *packet)
{
    if (e->packet == 1) rtcOccluded1(e->peer, context, packet);
    else if (e->packet == 4) rtcOccluded4(valid, e->peer, context, packet);
    else if (e->packet == 8) rtcOccluded8(valid, e->peer, context, packet);
    else rtcOccluded16(valid, e->peer, context, packet);
}

static void embree_trace(const entry *e, const batch *b, size_t first, size_t last)
{
    static const int all[EMBREE_WIDEST] __attribute__((aligned(64))) = { -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1 };
    int tail[EMBREE_WIDEST] __attribute__((aligned(64)));
    const bool coherent = e->coherence ? e->coherence > 0 : b->kind != DIFFUSE;
    const size_t width = (size_t)e->packet;
    const unsigned before = embree_enter();
    struct RTCIntersectContext context;
    size_t i, k;

    rtcInitIntersectContext(&context);
    context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    if (e->stream) {
        void *rays = embree_lane(e, b, first);
        const unsigned count = (unsigned)(last - first);
        if (b->query == RT_CLOSEST) rtcIntersect1M(e->peer, &context, rays, count, ROWS * sizeof(uint32_t));
        else rtcOccluded1M(e->peer, &context, rays, count, ROWS_ANY * sizeof(uint32_t));
    }
    for (i = first; i < last && !e->stream; i += width) {
        void *packet = embree_lane(e, b, i);
        const int *valid = all;
        if (last - i < width) {
            for (k = 0; k < width; k++) tail[k] = k < last - i ? -1 : 0;
            valid = tail;
        }
        if (b->query == RT_CLOSEST) embree_closest(e, &context, valid, packet);
        else embree_any(e, &context, valid, packet);
    }
    embree_leave(before);
}

static void embree_compare(entry *e, const batch *b)
{
    size_t i, width = (size_t)e->packet;

    e->other_hits = e->other_prims = 0;
    for (i = 0; i < b->count; i++) {
        const uint32_t *lane = embree_lane(e, b, i);
        const float t = float_of(lane[ROW_TFAR * width]);
        const rt_hit *truth = &b->truth[i];
        uint32_t prim, geometry;

        if (b->query == RT_ANY) {
            e->other_hits += (t < 0) != (truth->prim != RT_NONE);
            continue;
        }
        geometry = lane[ROW_GEOMETRY * width];
        prim = lane[ROW_PRIM * width] + (geometry == 1 ? e->triangle_count : 0);
        if ((geometry != RTC_INVALID_GEOMETRY_ID) != (truth->prim != RT_NONE)) e->other_hits++;
        else if (truth->prim != RT_NONE && fabsf(t - truth->t) > 1e-4f * truth->t) e->other_hits++;
        else if (truth->prim != RT_NONE && prim != truth->prim) e->other_prims++;
    }
}

static bool embree_count_bytes(void *user, ssize_t bytes, bool after)
{
    (void)after;
    __atomic_fetch_add((size_t *)user, (size_t)bytes, __ATOMIC_RELAXED);
    return true;
}

typedef struct { double wall, processor; } embree_times;

static double seconds_of(clockid_t clock);

/* Embree's scene of geometry: triangles are geometry 0, spheres 1. The vertices are copied, since Embree reads 16 bytes at each; *times,
   unless that is NULL, is without the copying. NULL: Embree has failed. */
static RTCScene embree_build(RTCDevice device, const rt_geometry *geometry, enum RTCSceneFlags flags, enum RTCBuildQuality quality,
                             embree_times *times)
{
    RTCScene out = rtcNewScene(device);
    embree_times start;
    unsigned before;
    bool filled = true;
    size_t i;

    rtcSetSceneFlags(out, flags);
    rtcSetSceneBuildQuality(out, quality);
    if (geometry->triangle_count) {
        RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rt_vec3 *vertices =
            rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof *vertices, geometry->vertex_count);
        uint32_t *indices =
            rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof *indices, geometry->triangle_count);
        filled = vertices && indices;
        for (i = 0; filled && i < geometry->vertex_count; i++) vertices[i] = vertex_at(geometry, i);
        for (i = 0; filled && i < 3 * geometry->triangle_count; i++) indices[i] = vertex_index(geometry, i);
        rtcSetGeometryBuildQuality(mesh, quality);
        rtcCommitGeometry(mesh);
        rtcAttachGeometryByID(out, mesh, 0);
        rtcReleaseGeometry(mesh);
    }
    if (geometry->sphere_count) {
        RTCGeometry balls = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        rt_sphere *points =
            rtcSetNewGeometryBuffer(balls, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, sizeof *points, geometry->sphere_count);
        if (points) memcpy(points, geometry->spheres, sizeof *points * geometry->sphere_count);
        filled = filled && points;
        rtcCommitGeometry(balls);
        rtcAttachGeometryByID(out, balls, 1);
        rtcReleaseGeometry(balls);
    }
    before = embree_enter();
    start.wall = seconds_of(CLOCK_MONOTONIC);
    start.processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    rtcCommitScene(out);
    if (times) times->processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - start.processor;
    if (times) times->wall = seconds_of(CLOCK_MONOTONIC) - start.wall;
    embree_leave(before);
    if (filled && rtcGetDeviceError(device) == RTC_ERROR_NONE) return out;
    rtcReleaseScene(out);
    return NULL;
}

#endif /* RT_BENCH_EMBREE */

/* ---- >>arguments ---------------------------------------------------------------------------------------------------- */

#define TEXT(name, text) text,
static const char *const structure_names[] = { RT_STRUCTURE_LIST(TEXT) };
static const char *const cull_names[] = { RT_CULL_LIST(TEXT) };
static const char *const isa_names[] = { RT_ISA_LIST(TEXT) };
static const char *const quality_names[] = { "default", "fast", "high" };       /* of rt_quality */
enum { QUALITIES = sizeof quality_names / sizeof *quality_names };

enum { ALL_PACKETS = -1 };

typedef struct {
    const char **scenes;                    /* owned; the names are argv's */
    size_t scene_count;
    const char *rays, *algorithms, *papers; /* comma lists */
    const char *scene_folder;               /* NULL: none */
    const char *svg;                        /* where plots go, see >>plots; NULL: none */
    int structure;                          /* RT_STRUCTURE_COUNT: each */
    int packet, cull, isa, width, height, threads, rounds;              /* width, height, rounds 0, threads -1: the table's default */
    int short_stack, quality;               /* 0: the library's default */
    int most_triangles;                     /* of tables over the number of triangles */
    float traversal_cost, empty_bonus, max_duplication;
    const char *device;                     /* of --gpu; NULL: rt_gpu_open's choice */
    bool gpu, compare, cached, devices;
    bool json, help;
    bool has_eye, has_look, has_up, has_fov, has_light;
    rt_camera camera;
    rt_vec3 light;
} arguments;

/* A table of a paper: the word of --paper that asks for it, and what it tells. */
#define HORN_TABLES(X)                                                                        \
    X(HORN_BUILD,   "horn.build",   "builders and memory: k-d tree beside BVH")               \
    X(HORN_RATES,   "horn.2",       "Table 2: rates of primary and shadow rays")              \
    X(HORN_NODES,   "horn.nodes",   "5.1.1: nodes, restarts and stack entries a primary ray") \
    X(HORN_BOUNCES, "horn.figure2", "Figure 2: rates of specular bounces")                    \
    X(HORN_FRAMES,  "horn.1",       "Table 1: frames a second with shadows or a bounce")      \
    X(HORN_SCALING, "horn.scaling", "build time against the number of triangles")

#define OVERBECK_TABLES(X)                                                                          \
    X(OVERBECK_RATES,   "overbeck.5",       "Figure 5: Masked, Ranged, Partition by packet width")  \
    X(OVERBECK_DEPTHS,  "overbeck.6",       "Figure 6: tests by depth in the tree")                 \
    X(OVERBECK_CULLING, "overbeck.7",       "Figure 7: what frustum culling gains")                 \
    X(OVERBECK_FRAMES,  "overbeck.2",       "Table 2: frames a second, large packets beside SIMD")  \
    X(OVERBECK_AUTO,    "overbeck.auto",    "what auto picks, beside the best fixed choice")        \
    X(OVERBECK_THREADS, "overbeck.threads", "frames on one thread and on two")

#define LOHR_TABLES(X)                                                                              \
    X(LOHR_NEIGHBOURS, "lohr.2",       "Figure 2: coherent and incoherent neighbours")              \
    X(LOHR_COHERENCE,  "lohr.4",       "Figure 4: k rays of a pixel together")                      \
    X(LOHR_FRAMES,     "lohr.6",       "Figure 6: whole frames, parallel against naive")            \
    X(LOHR_WIDTHS,     "lohr.width",   "which width of the tree is best")                           \
    X(LOHR_ORDERS,     "lohr.orders",  "one list of links or one for each octant of directions")    \
    X(LOHR_BOUNDS,     "lohr.bounds",  "boxes against spheres")                                     \
    X(LOHR_SCALING,    "lohr.scaling", "cost against the number of primitives")                     \
    X(LOHR_UPDATE,     "lohr.update",  "1,000 moving transforms re-inserted")

#define PEERS_TABLES(X)                                                                             \
    X(PEERS_RAYS,    "peers.rays",    "what the default traces, and Embree's best, on every kind of ray") \
    X(PEERS_BUILD,   "peers.build",   "builders and memory, on one thread and on two")              \
    X(PEERS_QUALITY, "peers.quality", "rates by the quality of the build")                          \
    X(PEERS_SCALE,   "peers.scale",   "rates and memory against the number of triangles")           \
    X(PEERS_THREADS, "peers.threads", "rays on one thread and on two")

#define TABLE_ENUM(id, word, what) id,
#define TABLE_WORD(id, word, what) word,
enum { HORN_TABLES(TABLE_ENUM) HORN_TABLE_COUNT };
enum { OVERBECK_TABLES(TABLE_ENUM) OVERBECK_TABLE_COUNT };
enum { LOHR_TABLES(TABLE_ENUM) LOHR_TABLE_COUNT };
enum { PEERS_TABLES(TABLE_ENUM) PEERS_TABLE_COUNT };
static const char *const paper_words[] = { "speed", "horn", HORN_TABLES(TABLE_WORD) "overbeck", OVERBECK_TABLES(TABLE_WORD)
                                           "lohr", LOHR_TABLES(TABLE_WORD) "peers", PEERS_TABLES(TABLE_WORD) };
enum { PAPER_WORDS = sizeof paper_words / sizeof *paper_words };

static bool complain(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* One line on stderr; always false, so that a failing function can return it. */
static bool complain(const char *format, ...)
{
    va_list list;
    va_start(list, format);
    fputs("bench: ", stderr);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
    return false;
}

/* Is name one of the words of a comma list, or the list "all"? */
static bool listed(const char *list, const char *name)
{
    size_t n = strlen(name);
    const char *word = list;

    if (strcmp(list, "all") == 0) return true;
    for (; word; word = strchr(word, ',') ? strchr(word, ',') + 1 : NULL)
        if (strncmp(word, name, n) == 0 && (word[n] == ',' || word[n] == '\0')) return true;
    return false;
}

/* The index of text in names, or -1. */
static int find_name(const char *const *names, int count, const char *text)
{
    int i;
    for (i = 0; i < count; i++)
        if (strcmp(names[i], text) == 0) return i;
    return -1;
}

/* As complain: value is neither first, unless that is NULL, nor one of names. */
static bool complain_names(const char *option, const char *value, const char *first, const char *const *names, int count)
{
    char list[1024];
    size_t used = (size_t)snprintf(list, sizeof list, "%s%s", first ? first : "", first ? ", " : "");
    int i;

    for (i = 0; i < count && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, i ? ", %s" : "%s", names[i]);
    return complain("%s: '%s' is none of: %s", option, value, list);
}

static bool parse_name(const char *option, const char *value, const char *const *names, int count, int *out)
{
    *out = find_name(names, count, value);
    return *out >= 0 || complain_names(option, value, NULL, names, count);
}

static bool parse_int(const char *option, const char *value, int least, int most, int *out)
{
    char *end;
    long n;
    errno = 0;
    n = strtol(value, &end, 10);
    if (end == value || *end || errno || n < least || n > most)
        return complain("%s: '%s' is not a whole number from %d to %d", option, value, least, most);
    *out = (int)n;
    return true;
}

static bool parse_floats(const char *option, const char *value, float *out, int count)
{
    const char *at = value;
    int i;

    for (i = 0; i < count; i++) {
        char *end;
        out[i] = strtof(at, &end);
        if (end == at || !isfinite(out[i]) || *end != (i + 1 < count ? ',' : '\0'))
            return complain("%s: '%s' is not %s", option, value, count == 1 ? "a number" : "three numbers, X,Y,Z");
        at = end + 1;
    }
    return true;
}

static bool parse_float(const char *option, const char *value, float least, float most, float *out)
{
    if (!parse_floats(option, value, out, 1)) return false;
    if (*out >= least && *out <= most) return true;
    return complain("%s: '%s' is not a number from %g to %g", option, value, (double)least, (double)most);
}

static bool parse_vec3(const char *option, const char *value, rt_vec3 *out, bool *given)
{
    float f[3];
    if (!parse_floats(option, value, f, 3)) return false;
    *out = vec(f[0], f[1], f[2]);
    return *given = true;
}

static bool parse_size(const char *option, const char *value, int *width, int *height)
{
    char end;
    if (sscanf(value, "%5dx%5d%c", width, height, &end) == 2 && *width >= 1 && *width <= MAX_IMAGE && *height >= 1 && *height <= MAX_IMAGE)
        return true;
    return complain("%s: '%s' is not WIDTHxHEIGHT, each from 1 to %d", option, value, MAX_IMAGE);
}

/* Is every word of a comma list "all" or one of names? */
static bool check_list(const char *option, const char *list, const char *const *names, int count)
{
    char word[64];
    size_t n;

    for (; list; list = list[n] ? list + n + 1 : NULL) {
        n = strcspn(list, ",");
        snprintf(word, sizeof word, "%.*s", n < sizeof word ? (int)n : (int)sizeof word - 1, list);
        if (strcmp(word, "all") != 0 && find_name(names, count, word) < 0) return complain_names(option, word, "all", names, count);
    }
    return true;
}

/* Algorithms not built yet pass too: rt_trace tells which they are. */
static bool check_algorithms(const char *option, const char *list)
{
    const char *names[RT_ALGORITHM_COUNT + 16];
    const rt_algorithm_info *info;
    int count = 0;

    for (; (info = rt_algorithm_get((size_t)count)) != NULL; count++) names[count] = info->name;
#ifdef RT_BENCH_EMBREE
    for (size_t i = 0; i < EMBREE_MODES; i++) names[count++] = embree_modes[i].name;
#endif
    return check_list(option, list, names, count);
}

/* Does a ask for this table of this paper? */
static bool wants(const arguments *a, const char *paper, const char *word)
{
    return listed(a->papers, word) || listed(a->papers, paper);
}

static bool parse_option(arguments *a, const char *option, const char *value)
{
    if (strcmp(option, "--scene") == 0) return a->scenes[a->scene_count++] = value, true;
    if (strcmp(option, "--scenes") == 0) return a->scene_folder = value, true;
    if (strcmp(option, "--paper") == 0) return a->papers = value, check_list(option, value, paper_words, PAPER_WORDS);
    if (strcmp(option, "--device") == 0) return a->device = value, true;
    if (strcmp(option, "--svg") == 0) return a->svg = value, true;
    if (strcmp(option, "--triangles") == 0) return parse_int(option, value, 10000, 100000000, &a->most_triangles);
    if (strcmp(option, "--rays") == 0) return a->rays = value, check_list(option, value, kind_names, KIND_COUNT);
    if (strcmp(option, "--algorithm") == 0) return a->algorithms = value, check_algorithms(option, value);
    if (strcmp(option, "--structure") == 0) return parse_name(option, value, structure_names, RT_STRUCTURE_COUNT, &a->structure);
    if (strcmp(option, "--cull") == 0) return parse_name(option, value, cull_names, RT_CULL_COUNT, &a->cull);
    if (strcmp(option, "--isa") == 0) return parse_name(option, value, isa_names, RT_ISA_COUNT, &a->isa);
    if (strcmp(option, "--packet") == 0 && strcmp(value, "all") == 0) return a->packet = ALL_PACKETS, true;
    if (strcmp(option, "--packet") == 0) return parse_int(option, value, 0, 1024, &a->packet);
    if (strcmp(option, "--short-stack") == 0) return parse_int(option, value, 1, RT_MAX_SHORT_STACK, &a->short_stack);
    if (strcmp(option, "--quality") == 0) return parse_name(option, value, quality_names, QUALITIES, &a->quality);
    if (strcmp(option, "--traversal-cost") == 0) return parse_float(option, value, 0.01f, 100, &a->traversal_cost);
    if (strcmp(option, "--empty-bonus") == 0) return parse_float(option, value, -1, 1, &a->empty_bonus);
    if (strcmp(option, "--max-duplication") == 0) return parse_float(option, value, 1, 100, &a->max_duplication);
    if (strcmp(option, "--size") == 0) return parse_size(option, value, &a->width, &a->height);
    if (strcmp(option, "--threads") == 0) return parse_int(option, value, 0, 1024, &a->threads);
    if (strcmp(option, "--repeat") == 0) return parse_int(option, value, 1, MAX_ROUNDS - 1, &a->rounds);
    if (strcmp(option, "--eye") == 0) return parse_vec3(option, value, &a->camera.eye, &a->has_eye);
    if (strcmp(option, "--look") == 0) return parse_vec3(option, value, &a->camera.look, &a->has_look);
    if (strcmp(option, "--up") == 0) return parse_vec3(option, value, &a->camera.up, &a->has_up);
    if (strcmp(option, "--light") == 0) return parse_vec3(option, value, &a->light, &a->has_light);
    if (strcmp(option, "--fov") == 0) {
        if (!parse_floats(option, value, &a->camera.fov, 1)) return false;
        if (a->camera.fov <= 0 || a->camera.fov >= 180) return complain("--fov: '%s' is not between 0 and 180 degrees", value);
        return a->has_fov = true;
    }
    return complain("there is no option '%s' (--help lists them)", option);
}

/* Fills *a; its scenes are to be freed in any case. */
static bool parse_arguments(arguments *a, int argc, char **argv)
{
    static const arguments defaults = { .rays = "all", .algorithms = "all", .papers = "speed", .structure = RT_STRUCTURE_COUNT,
                                        .threads = -1, .most_triangles = 4000000 };
    int k;

    *a = defaults;
    a->scene_folder = getenv("RT_SCENES");
    a->scenes = calloc((size_t)argc, sizeof *a->scenes);
    if (!a->scenes) return complain("out of memory");
    for (k = 1; k < argc; k++) {
        const char *option = argv[k];
        if (strcmp(option, "--help") == 0) return a->help = true;
        if (strcmp(option, "--devices") == 0) return a->devices = true;
        if (strcmp(option, "--json") == 0) {
            a->json = true;
            continue;
        }
        if (strcmp(option, "--gpu") == 0 || strcmp(option, "--compare") == 0 || strcmp(option, "--cached") == 0) {
            a->gpu = true;
            a->compare = a->compare || option[3] == 'o';
            a->cached = a->cached || option[3] == 'a';
            continue;
        }
        if (strncmp(option, "--", 2) != 0) return complain("'%s' is no option; scenes are given with --scene", option);
        if (k + 1 == argc) return complain("%s needs a value, or is no option (--help lists them)", option);
        if (!parse_option(a, option, argv[++k])) return false;
    }
    if (a->gpu && strcmp(a->papers, "speed") != 0) return complain("--gpu has no tables of papers");
    if (a->threads < 0) a->threads = a->gpu ? 0 : 1;
    return true;
}

static void print_names(const char *title, const char *const *names, int count)
{
    int i;
    printf("%s", title);
    for (i = 0; i < count; i++) printf("%s%s", i ? ", " : "", names[i]);
    printf("\n");
}

static void print_help(void)
{
    const rt_algorithm_info *info;
    size_t i;

    printf("bench: speed of ray tracing algorithms, measured in turns on the same rays\n\n"
           "usage: bench [--scene S]... [option]...\n\n"
           "  --scene S          an .obj or .nff file, or a procedural scene (below); may be repeated; default: some of each\n"
           "  --rays LIST        primary,shadow,reflect,diffuse or all (the default)\n"
           "  --algorithm LIST   names from below, or all (the default): all that are built, and peers\n"
           "  --packet N         packet width for algorithms that have packets; 0: their default; all: each. With --algorithm all\n"
           "                     those that do not have N are left out\n"
           "  --structure NAME   only algorithms on this structure\n"
           "  --cull NAME        frustum culling, default none; others than bvh.masked, bvh.ranged and bvh.partition have none\n"
           "  --isa NAME         instructions to use; with --paper peers of Embree too\n"
           "  --size WxH         primary rays, default 512x512\n"
           "  --threads N        default 1, with --gpu 0: one a processor\n"
           "  --repeat N         measured rounds, default 5, with a GPU 20, after a pass that counts and warms up\n"
           "  --eye X,Y,Z --look X,Y,Z --up X,Y,Z --fov DEGREES --light X,Y,Z   instead of the scene's\n"
           "  --quality NAME     of the trees\n"
           "  --traversal-cost X, --empty-bonus X, --max-duplication X   of the builders, as in rt_build_options\n"
           "  --short-stack N    entries of kd.shortstack, 1 to %d, default 3\n"
           "  --json             one JSON object a line instead of tables\n"
           "  --gpu              the kernels of rt_gpu.h on an OpenCL device, beside bvh.stack in C: kernel time, and seconds of the first\n"
           "                     call, compiled and from the driver's cache. All that is above goes with it, but --isa is of C\n"
           "  --device NAME      gpu, cpu, a number of --devices, or part of a name; default: the environment's RT_GPU_DEVICE, else the\n"
           "                     first GPU, else the first device\n"
           "  --compare          as --gpu, but programs for the scene beside general ones, on primary and diffuse rays: of its triangles,\n"
           "                     with spheres, and as eight instances; and the memory of their kernels\n"
           "  --cached           as --gpu, but the first call may find programs of earlier runs in the driver's cache\n"
           "  --devices          lists OpenCL's devices\n"
           "  --paper LIST       what to print, default speed: words from below, or all\n"
           "\nthe tables of papers, on scenes like the paper's, median of 3, by default at 1024x1024, but at 512x512 for single kinds of\n"
           "rays of overbeck; --rays, --algorithm, --packet, --structure and --cull say nothing to them\n"
           "  --scenes DIR       on the paper's own scenes, from this folder; default: the environment's RT_SCENES, else procedural\n"
           "  --svg FILE         plots horn.figure2, overbeck.5, overbeck.6 and overbeck.7: where only one of them is asked for to FILE,\n"
           "                     else to horn_figure2.svg, overbeck_figure5.svg ... beside it. FILE may be a folder\n"
           "  --triangles N      the most in horn.scaling and peers.scale, default 4000000\n"
           "\nwords of --paper\n"
           "  speed              every algorithm on every kind of ray, and peers\n"
           "  horn               all of Horn et al. 2007, the k-d tree:\n", RT_MAX_SHORT_STACK);
#define TABLE_HELP(id, word, what) printf("    %-16s %s\n", word, what);
    HORN_TABLES(TABLE_HELP)
    printf("  overbeck           all of Overbeck et al. 2008, large packets of rays:\n");
    OVERBECK_TABLES(TABLE_HELP)
    printf("  lohr               all of Lohr 2009, the stackless hierarchy:\n");
    LOHR_TABLES(TABLE_HELP)
    printf("  peers              are we faster than Embree? In turns, median of 5, at 1024x1024, quality and scale at 512x512; not with --json\n");
    PEERS_TABLES(TABLE_HELP)
    printf("\nalgorithms\n");
    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++)
        printf("  %-21s %s%s\n", info->name, info->what, info->built ? "" : " (not built yet)");
#ifdef RT_BENCH_EMBREE
    for (i = 0; i < EMBREE_MODES; i++) printf("  %-21s Embree, %d ray%s a call%s\n", embree_modes[i].name, embree_modes[i].packet,
                                              embree_modes[i].packet > 1 ? "s" : "", embree_modes[i].flags ? ", robust" : "");
#endif
    print_names("structures: ", structure_names, RT_STRUCTURE_COUNT);
    print_names("culling: ", cull_names, RT_CULL_COUNT);
    print_names("instructions: ", isa_names, RT_ISA_COUNT);
    print_names("qualities: ", quality_names, QUALITIES);
    printf("\nprocedural scenes\n%s\ncolumns: spread = (slowest - fastest) / median; nodes, boxes, prims = visited or tested a ray;\n"
           "differs = rays whose hit, or only whose primitive, is not the one that we find\n", scene_procedural_list());
}

/* ---- >>measure ------------------------------------------------------------------------------------------------------ */

static double seconds_of(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double now(void) { return seconds_of(CLOCK_MONOTONIC); }

typedef struct {
    const entry *e;
    const batch *b;
    size_t chunk;
} work;

static void trace_chunk(void *context, size_t index)
{
    const work *w = context;
    size_t first = index * w->chunk, left = w->b->count - first;
    w->e->trace(w->e, w->b, first, first + (left < w->chunk ? left : w->chunk));
}

/* Seconds that one pass over the rays takes. */
static double measure(const entry *e, const batch *b, pool *threads)
{
    work w;
    double total = 0, start;
    int passes = 0;

    w.e = e, w.b = b;
    w.chunk = pool_threads(threads) > 1 ? CHUNK : b->count;
    do {
        if (e->prepare) e->prepare(e, b, 0, b->count);
        start = now();
        pool_for(threads, (b->count + w.chunk - 1) / w.chunk, trace_chunk, &w);
        total += now() - start;
        passes++;
    } while (total < b->seconds);
    return total / passes;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts values. */
static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}

/* Times all entries in turns and checks what they find. False: one of ours has found something else than the truth. */
static bool measure_all(entry *entries, size_t count, const batch *b, pool *threads, int rounds)
{
    bool same = true;
    size_t i;
    int round;

    for (round = 0; round < rounds; round++)
        for (i = 0; i < count; i++) {
            entries[i].seconds[round] = measure(&entries[i], b, threads);
            if (round == 0) entries[i].compare(&entries[i], b);
        }
    for (i = 0; i < count; i++) {
        entry *e = &entries[i];
        e->median = median(e->seconds, rounds);
        e->spread = (e->seconds[rounds - 1] - e->seconds[0]) / e->median;
        if (e->accel && e->other_hits)
            same = complain("%s on %s finds %zu of %zu %s hits that differ", e->name, e->structure, e->other_hits, b->count,
                            b->label);
    }
    return same;
}

/* One pass of each, not timed, which counts ours. */
static bool count_all(entry *entries, size_t count, const batch *b)
{
    size_t i;
    for (i = 0; i < count; i++) {
        entry *e = &entries[i];
        rt_trace_options options = e->options;
        rt_error error;
        if (!e->accel) {
            if (e->prepare) e->prepare(e, b, 0, b->count);
            e->trace(e, b, 0, b->count);
            continue;
        }
        memset(&e->stats, 0, sizeof e->stats);
        options.stats = &e->stats;
        options.error = &error;
        if (rt_trace(e->accel, &options, b->rays, b->count, b->hits) != RT_OK) return complain("%s: %s", e->name, error.message);
    }
    return true;
}

/* ---- >>output ------------------------------------------------------------------------------------------------------- */

static void print_json_string(const char *text)
{
    putchar('"');
    for (; *text; text++) {
        if (*text == '"' || *text == '\\') printf("\\%c", *text);
        else if ((unsigned char)*text < ' ') printf("\\u%04x", (unsigned)*text);
        else putchar(*text);
    }
    putchar('"');
}

/* What is counted, a ray; null for a peer, which does not tell, and where no ray was legal. */
static void print_json_rate(const char *key, const entry *e, uint64_t sum)
{
    if (e->accel && e->stats.rays) printf("\"%s\":%.4f,", key, (double)sum / (double)e->stats.rays);
    else printf("\"%s\":null,", key);
}

/* The start of an object: of a paper's table, where one is named. */
static void begin_json(const char *table, const char *scene_name)
{
    if (table) printf("{\"table\":\"%s\",", table);
    else putchar('{');
    printf("\"scene\":");
    print_json_string(scene_name);
}

static void print_json(const char *table, const entry *e, const batch *b, const char *scene_name, size_t primitives, int threads)
{
    begin_json(table, scene_name);
    printf(",\"primitives\":%zu,\"structure\":\"%s\",\"algorithm\":\"%s\",\"packet\":%d,\"cull\":\"%s\",\"rays\":\"%s\",\"threads\":%d,",
           primitives, e->structure, e->name, e->packet, cull_names[e->options.cull], b->label, threads);
    printf("\"mrays_per_s\":%.4f,", (double)b->count / e->median * 1e-6);
    print_json_rate("nodes_per_ray", e, e->stats.nodes);
    print_json_rate("boxes_per_ray", e, e->stats.boxes);
    print_json_rate("prims_per_ray", e, e->stats.prims);
    printf("\"build_s\":%.6f,\"bytes\":%zu}\n", e->build_seconds, e->bytes);
}

static void print_table(const entry *entries, size_t count, const batch *b)
{
    const entry *base = NULL;
    size_t i;

    for (i = 0; i < count; i++)
        if (strcmp(entries[i].name, "bvh.stack") == 0) base = &entries[i];
    printf("%-8s %8zu rays            packet cull     Mrays/s spread  x bvh.stack    nodes    boxes    prims  differs\n", b->label,
           b->count);
    for (i = 0; i < count; i++) {
        const entry *e = &entries[i];
        const bool culls = e->accel && rt_algorithm_get((size_t)e->options.algorithm)->culls;
        char packet[16] = "";
        if (e->packet) snprintf(packet, sizeof packet, "%d", e->packet);
        printf("  %-21s %-8s %4s %-7s %9.3f %5.1f%%", e->name, e->structure, packet, culls ? cull_names[e->options.cull] : "",
               (double)b->count / e->median * 1e-6, 100 * e->spread);
        if (base) printf(" %12.2f", base->median / e->median);
        else printf(" %12s", "");
        if (e->accel) {
            double rays = e->stats.rays ? (double)e->stats.rays : 1;
            printf(" %8.2f %8.2f %8.2f  %zu\n", (double)e->stats.nodes / rays, (double)e->stats.boxes / rays, (double)e->stats.prims / rays,
                   e->other_hits);
        } else {
            printf(" %8s %8s %8s  %zu + %zu\n", "", "", "", e->other_hits, e->other_prims);
        }
    }
}

/* ---- >>plots -------------------------------------------------------------------------------------------------------- */

/* The words of --paper that make a plot, and the names of their files. */
static const struct { const char *paper, *word, *file; } plots[] = {
    { "horn", "horn.figure2", "horn_figure2.svg" },       { "overbeck", "overbeck.5", "overbeck_figure5.svg" },
    { "overbeck", "overbeck.6", "overbeck_figure6.svg" }, { "overbeck", "overbeck.7", "overbeck_figure7.svg" },
};
enum { PLOTS = sizeof plots / sizeof *plots };

/* Where the plot of word goes: to --svg, if that is no folder and this is the only plot asked for; else to its own name in that folder. */
static void plot_path(const arguments *a, const char *word, char *out, size_t size)
{
    const char *slash = strrchr(a->svg, '/'), *name = NULL;
    struct stat status;
    const bool folder = stat(a->svg, &status) == 0 && S_ISDIR(status.st_mode);
    int i, wanted = 0;

    for (i = 0; i < PLOTS; i++) {
        wanted += wants(a, plots[i].paper, plots[i].word);
        if (strcmp(word, plots[i].word) == 0) name = plots[i].file;
    }
    if (folder) snprintf(out, size, "%s%s%s", a->svg, slash && !slash[1] ? "" : "/", name);
    else if (wanted == 1) snprintf(out, size, "%s", a->svg);
    else snprintf(out, size, "%.*s%s", slash ? (int)(slash - a->svg) + 1 : 0, a->svg, name);
}

/* Opens the plot of word; NULL, and a complaint: it cannot. */
static FILE *plot_open(const arguments *a, const char *word, double width, double height, const char *title)
{
    char path[4096];
    FILE *file;

    plot_path(a, word, path, sizeof path);
    file = fopen(path, "w");
    if (!file) return complain("%s: %s", path, strerror(errno)), NULL;
    fprintf(file, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" font-family=\"sans-serif\" "
            "font-size=\"11\">\n<title>%s</title><rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n", width, height, title);
    return file;
}

static bool plot_close(const arguments *a, const char *word, FILE *file)
{
    char path[4096];
    bool written;

    plot_path(a, word, path, sizeof path);
    fprintf(file, "</svg>\n");
    written = !ferror(file);
    if (fclose(file) != 0 || !written) return complain("%s: cannot be written", path);
    if (!a->json) printf("  plotted in %s\n", path);
    return true;
}

static void svg_text(FILE *file, double x, double y, const char *anchor, const char *color, const char *text)
{
    fprintf(file, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\">", x, y, anchor, color);
    for (; *text; text++)
        if (strchr("<>&", *text)) fprintf(file, "&#%d;", *text);
        else fputc(*text, file);
    fprintf(file, "</text>\n");
}

/* The least of 1, 2, 5, 10, 20, 50 ... that is not below x. */
static double round_up(double x)
{
    static const double steps[] = { 1, 2, 5, 10 };
    const double ten = pow(10, floor(log10(x)));
    int i = 0;
    while (i < 3 && steps[i] * ten < x) i++;
    return steps[i] * ten;
}

/* Horizontal lines with their numbers, of an axis from 0 to at least most; returns where it ends. x0, y0: the panel's left lower corner. */
static double svg_scale(FILE *file, double x0, double y0, double width, double height, double most)
{
    const double step = round_up(most / 5), end = step * ceil(most / step);
    char label[32];
    double y;

    for (y = 0; y <= end * 1.001; y += step) {
        const double at = y0 - y / end * height;
        fprintf(file, "<path d=\"M%.1f %.1fh%.1f\" stroke=\"#ddd\"/>\n", x0, at, width);
        snprintf(label, sizeof label, "%.6g", y);
        svg_text(file, x0 - 5, at + 4, "end", "#000", label);
    }
    return end;
}

/* ---- >>scenes ------------------------------------------------------------------------------------------------------- */

/* Room for one ray a pixel, which the scenes use one after the other. */
typedef struct {
    rt_ray *primary, *rays;
    rt_hit *primary_hits, *truth, *hits;
    uint32_t *packets;                      /* of a peer; NULL: none measured */
} buffers;

static void buffers_free(buffers *b)
{
    free(b->primary), free(b->rays), free(b->primary_hits), free(b->truth), free(b->hits), free(b->packets);
}

/* *b is to be freed in any case. */
static bool buffers_alloc(buffers *b, size_t pixels, bool peers)
{
    memset(b, 0, sizeof *b);
    b->primary = calloc(pixels, sizeof *b->primary);
    b->rays = calloc(pixels, sizeof *b->rays);
    b->primary_hits = calloc(pixels, sizeof *b->primary_hits);
    b->truth = calloc(pixels, sizeof *b->truth);
    b->hits = calloc(pixels, sizeof *b->hits);
    if (!b->primary || !b->rays || !b->primary_hits || !b->truth || !b->hits) return complain("out of memory");
#ifdef RT_BENCH_EMBREE
    if (peers) b->packets = embree_packets(pixels);
    if (peers && !b->packets) return complain("out of memory");
#else
    (void)peers;
#endif
    return true;
}

/* What is built of one scene. */
typedef struct {
    scene content;
    rt_accel *accels[RT_STRUCTURE_COUNT];   /* NULL where no entry needs one */
    double build_seconds[RT_STRUCTURE_COUNT];
    const buffers *memory;                  /* not owned */
    entry *entries;
    size_t entry_count, entry_capacity;
#ifdef RT_BENCH_EMBREE
    RTCDevice device;
    RTCScene peers[EMBREE_MODES];
#endif
} bench;

static void bench_free(bench *s)
{
    size_t i;
#ifdef RT_BENCH_EMBREE
    for (i = 0; i < EMBREE_MODES; i++)
        if (s->peers[i]) rtcReleaseScene(s->peers[i]);
    if (s->device) rtcReleaseDevice(s->device);
#endif
    for (i = 0; i < RT_STRUCTURE_COUNT; i++) rt_free(s->accels[i]);
    free(s->entries);
    scene_free(&s->content);
}

/* The next entry, zeroed; NULL: out of memory. Earlier pointers to entries become stale. */
static entry *add_entry(bench *s)
{
    if (s->entry_count == s->entry_capacity) {
        size_t capacity = 2 * s->entry_capacity + 8;
        entry *grown = realloc(s->entries, capacity * sizeof *grown);
        if (!grown) return NULL;
        s->entries = grown;
        s->entry_capacity = capacity;
    }
    return memset(&s->entries[s->entry_count++], 0, sizeof *s->entries);
}

/* The options that a says; threads NULL: on this thread alone. */
static rt_build_options build_options(rt_structure structure, const arguments *a, pool *threads, rt_error *error)
{
    rt_build_options options;

    memset(&options, 0, sizeof options);
    options.structure = structure;
    options.quality = (rt_quality)a->quality;
    options.traversal_cost = a->traversal_cost;
    options.empty_bonus = a->empty_bonus;
    options.max_duplication = a->max_duplication;
    options.error = error;
    if (threads && pool_threads(threads) > 1) {
        options.parallel_for = pool_for;
        options.parallel_user = threads;
    }
    return options;
}

/* Builds structure, unless that is done. */
static bool build(bench *s, rt_structure structure, const arguments *a, pool *threads)
{
    rt_error error;
    const rt_build_options options = build_options(structure, a, threads, &error);
    double start;

    if (s->accels[structure]) return true;
    start = now();
    if (rt_build(&s->accels[structure], &s->content.geometry, &options) != RT_OK) return complain("%s: %s", s->content.name, error.message);
    s->build_seconds[structure] = now() - start;
    return true;
}

/* Does accel take this algorithm with this packet_width, with the instructions that a asks for? */
static bool takes(const rt_accel *accel, const arguments *a, rt_algorithm algorithm, int packet)
{
    rt_trace_options options;

    memset(&options, 0, sizeof options);
    options.algorithm = algorithm;
    options.packet_width = packet;
    options.isa = (rt_isa)a->isa;
    return rt_trace(accel, &options, NULL, 0, NULL) == RT_OK;
}

/* The width that a packet_width of 0 stands for: the widest, of large packets 16. 0: the rays decide; or no width is allowed, and rt_trace
   will say why. */
static int default_width(const rt_accel *accel, const arguments *a, const rt_algorithm_info *info)
{
    int widths[MAX_WIDTHS];
    size_t count = rt_packet_widths(info->algorithm, widths, MAX_WIDTHS);

    if (info->algorithm == RT_AUTO) return 0;
    if (info->culls) return 16;
    while (count > 0)
        if (takes(accel, a, info->algorithm, widths[--count])) return widths[count];
    return 0;
}

static bool add_ours(bench *s, const rt_algorithm_info *info, rt_structure structure, int packet, rt_cull cull, const arguments *a,
                     pool *threads)
{
    entry *e;
    rt_info built;
    rt_trace_options check;
    rt_error error;

    if (!build(s, structure, a, threads)) return false;
    e = add_entry(s);
    if (!e) return complain("out of memory");
    rt_get_info(s->accels[structure], &built);
    e->name = info->name;
    e->structure = structure_names[structure];
    e->options.algorithm = info->algorithm;
    e->options.cull = cull;
    e->options.isa = (rt_isa)a->isa;
    e->options.short_stack = a->short_stack;
    e->accel = s->accels[structure];
    e->packet = e->options.packet_width = packet ? packet : default_width(e->accel, a, info);
    e->build_seconds = s->build_seconds[structure];
    e->bytes = built.bytes;
    e->trace = our_trace;
    e->compare = our_compare;
    check = e->options;
    check.error = &error;
    return rt_trace(e->accel, &check, NULL, 0, NULL) == RT_OK || complain("%s: %s", e->name, error.message);
}

/* Is there an algorithm of its own for structure? */
static bool structure_built(rt_structure structure)
{
    const rt_algorithm_info *info;
    size_t i;
    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++)
        if (info->built && info->structure == structure) return true;
    return false;
}

/* An entry for each of our algorithms that a asks for, on each structure it runs on, at each packet width. What only "all" has asked for
   is left out where it does not have the width; and culling is for those that can. */
static bool add_all_ours(bench *s, const arguments *a, pool *threads)
{
    const rt_algorithm_info *info;
    bool all = strcmp(a->algorithms, "all") == 0, any_packet = false, any_cull = false;
    size_t i, k;
    int structure;

    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++) {
        if (!listed(a->algorithms, info->name) || (all && !info->built)) continue;
        if (!info->built) return complain("%s is not built yet", info->name);
        for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) {
            int widths[MAX_WIDTHS] = { 0 };
            size_t count = 1;
            if (info->structure != RT_STRUCTURE_COUNT && (int)info->structure != structure) continue;
            if (a->structure != RT_STRUCTURE_COUNT && a->structure != structure) continue;
            if (!structure_built((rt_structure)structure)) continue;
            if (!build(s, (rt_structure)structure, a, threads)) return false;
            if (a->packet == ALL_PACKETS && info->packets) count = rt_packet_widths(info->algorithm, widths, MAX_WIDTHS);
            else if (info->packets) widths[0] = a->packet;
            for (k = 0; k < count; k++) {
                if ((all || count > 1) && !takes(s->accels[structure], a, info->algorithm, widths[k])) continue;
                any_packet = any_packet || widths[k];
                any_cull = any_cull || info->culls;
                if (!add_ours(s, info, (rt_structure)structure, widths[k], info->culls ? (rt_cull)a->cull : RT_CULL_NONE, a, threads))
                    return false;
            }
        }
    }
    if (a->packet > 0 && !any_packet) return complain("--packet %d: no algorithm asked for has packets of that width", a->packet);
    if (a->cull != RT_CULL_NONE && !any_cull) return complain("--cull %s: no algorithm asked for has a frustum", cull_names[a->cull]);
    return true;
}

#ifdef RT_BENCH_EMBREE
/* An entry for each mode of Embree that a asks for. */
static bool add_all_embree(bench *s, const arguments *a, int threads)
{
    char config[32];
    size_t i;

    snprintf(config, sizeof config, "threads=%d", threads);
    for (i = 0; i < EMBREE_MODES; i++) {
        entry *e;
        size_t bytes = 0;
        double start;
        if (!listed(a->algorithms, embree_modes[i].name)) continue;
        e = add_entry(s);
        if (!e) return complain("out of memory");
        if (!s->device) s->device = rtcNewDevice(config);
        if (!s->device) return complain("Embree does not start");
        rtcSetDeviceMemoryMonitorFunction(s->device, embree_count_bytes, &bytes);
        start = now();
        s->peers[i] = embree_build(s->device, &s->content.geometry, embree_modes[i].flags, RTC_BUILD_QUALITY_MEDIUM, NULL);
        e->build_seconds = now() - start;
        rtcSetDeviceMemoryMonitorFunction(s->device, NULL, NULL);
        if (!s->peers[i]) return complain("Embree cannot build %s", s->content.name);
        e->name = embree_modes[i].name;
        e->structure = "bvh";
        e->packet = embree_modes[i].packet;
        e->bytes = bytes;
        e->prepare = embree_prepare;
        e->trace = embree_trace;
        e->compare = embree_compare;
        e->peer = s->peers[i];
        e->triangle_count = (unsigned)s->content.geometry.triangle_count;
    }
    return true;
}
#endif

/* Puts a's camera and light in the place of the scene's. Default lights follow the camera. */
static void aim(scene *content, const arguments *a)
{
    rt_camera *camera = &content->camera;

    if (a->has_eye) camera->eye = a->camera.eye;
    if (a->has_look) camera->look = a->camera.look;
    if (a->has_up) camera->up = a->camera.up;
    if (a->has_fov) camera->fov = a->camera.fov;
    if (!content->has_lights) scene_default_lights(camera, content->lights);
    if (a->has_light) content->lights[0].position = a->light;          /* scene_load always gives one */
}

/* Makes the primary rays and what they hit. */
static void trace_primary(const bench *s, const rt_accel *accel, const arguments *a)
{
    make_primary(&s->content.camera, a->width, a->height, s->memory->primary);
    rt_trace(accel, NULL, s->memory->primary, (size_t)a->width * (size_t)a->height, s->memory->primary_hits);
}

/* One kind of rays, from the primary rays of trace_primary. */
static batch make_batch(const bench *s, ray_kind kind, const arguments *a)
{
    const buffers *m = s->memory;
    size_t pixels = (size_t)a->width * (size_t)a->height;
    batch b;

    b.kind = kind;
    b.label = kind_names[kind];
    b.seconds = MEASURE_SECONDS;
    b.query = kind == SHADOW ? RT_ANY : RT_CLOSEST;
    b.rays = kind == PRIMARY ? m->primary : m->rays;
    b.count = pixels;
    if (kind != PRIMARY)
        b.count = make_secondary(kind, &s->content.geometry, s->content.lights[0].position, m->primary, m->primary_hits, pixels, m->rays);
    b.truth = m->truth;
    b.hits = m->hits;
    b.packets = m->packets;
    return b;
}

/* Counts, times and checks all entries on *b. *same becomes false where one finds another thing than accel's default algorithm. False:
   one cannot be run; nothing is measured. */
static bool measure_batch(bench *s, const batch *b, const rt_accel *accel, pool *threads, int rounds, bool *same)
{
    rt_trace_options options;
    size_t i;

    memset(&options, 0, sizeof options);
    options.query = b->query;
    for (i = 0; i < s->entry_count; i++) s->entries[i].options.query = b->query;
    rt_trace(accel, &options, b->rays, b->count, s->memory->truth);
    if (!count_all(s->entries, s->entry_count, b)) return false;
    if (!measure_all(s->entries, s->entry_count, b, threads, rounds)) *same = false;
    return true;
}

/* ---- >>speed -------------------------------------------------------------------------------------------------------- */

/* The line above a scene's tables. */
static void print_scene(const bench *s, const arguments *a, int threads)
{
    const rt_geometry *geometry = &s->content.geometry;
    size_t primitives = geometry->triangle_count + geometry->sphere_count;
    int i;

    printf("\n%s: %zu triangles, %zu spheres; %dx%d, %d thread%s, median of %d\n", s->content.name, geometry->triangle_count,
           geometry->sphere_count, a->width, a->height, threads, threads == 1 ? "" : "s", a->rounds);
    for (i = 0; i < RT_STRUCTURE_COUNT; i++) {
        rt_info built;
        if (!s->accels[i]) continue;
        rt_get_info(s->accels[i], &built);
        printf("%s: built in %.3f s, %.1f bytes a primitive\n", structure_names[i], s->build_seconds[i],
               (double)built.bytes / (double)(primitives ? primitives : 1));
    }
}

/* Measures one kind of rays and prints it. */
static bool speed_of_kind(bench *s, ray_kind kind, const rt_accel *accel, const arguments *a, pool *threads)
{
    const rt_geometry *geometry = &s->content.geometry;
    const batch b = make_batch(s, kind, a);
    bool same = true;
    size_t i;

    if (b.count == 0) {
        if (!a->json) printf("%-8s no rays: no primary ray hits\n", kind_names[kind]);
        return true;
    }
    if (!measure_batch(s, &b, accel, threads, a->rounds, &same)) return false;
    if (a->json)
        for (i = 0; i < s->entry_count; i++)
            print_json(NULL, &s->entries[i], &b, s->content.name, geometry->triangle_count + geometry->sphere_count,
                       pool_threads(threads));
    else
        print_table(s->entries, s->entry_count, &b);
    fflush(stdout);
    return same;
}

/* Builds one scene, then measures every kind of ray in it. *s is to be freed in any case. */
static bool speed_of_scene(bench *s, const char *name, const arguments *a, pool *threads)
{
    const rt_accel *accel = NULL;
    scene_error error;
    bool same = true;
    size_t i;
    int kind;

    if (!scene_load(&s->content, name, NULL, NULL, &error)) return complain("%s", error.message);
    aim(&s->content, a);
    if (!add_all_ours(s, a, threads)) return false;
#ifdef RT_BENCH_EMBREE
    if (!add_all_embree(s, a, pool_threads(threads))) return false;
#endif
    for (i = 0; i < RT_STRUCTURE_COUNT && !accel; i++) accel = s->accels[i];
    if (!accel) {
        if (!build(s, RT_BVH, a, threads)) return false;
        accel = s->accels[RT_BVH];
    }
    trace_primary(s, accel, a);
    if (!a->json) print_scene(s, a, pool_threads(threads));
    for (kind = 0; kind < KIND_COUNT; kind++)
        if (listed(a->rays, kind_names[kind]))
            same = speed_of_kind(s, (ray_kind)kind, accel, a, threads) && same;
    return same;
}

/* a with defaults in the place of what it leaves open. */
static arguments with_defaults(const arguments *a, int size, int rounds)
{
    arguments filled = *a;
    if (!filled.width) filled.width = filled.height = size;
    if (!filled.rounds) filled.rounds = rounds;
    return filled;
}

/* Every scene, one after the other. */
static bool speed_tables(const arguments *given, pool *threads)
{
    const arguments a = with_defaults(given, SPEED_SIZE, SPEED_ROUNDS);
    const size_t defaults = sizeof default_scenes / sizeof *default_scenes, count = a.scene_count ? a.scene_count : defaults;
    buffers memory;
    const bool ready = buffers_alloc(&memory, (size_t)a.width * (size_t)a.height, true);
    bool same = ready;
    size_t i;

    for (i = 0; ready && i < count; i++) {
        bench s;
        memset(&s, 0, sizeof s);
        s.memory = &memory;
        same = speed_of_scene(&s, a.scene_count ? a.scenes[i] : default_scenes[i], &a, threads) && same;
        bench_free(&s);
    }
    buffers_free(&memory);
    return same;
}

#include "bench_horn.h"
#include "bench_overbeck.h"
#include "bench_lohr.h"
#include "bench_peers.h"
#include "bench_gpu.h"

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

int main(int argc, char **argv)
{
    arguments a;
    pool *threads = NULL;
    bool ok = parse_arguments(&a, argc, argv);

    if (ok && a.help) print_help();
    if (ok && a.devices) ok = gpu_list();
    else if (ok && !a.help) {
        threads = pool_create(a.threads);
        ok = threads || complain("the threads do not start");
        if (threads && a.gpu) ok = gpu_tables(&a, threads) && ok;
        else if (threads && listed(a.papers, "speed")) ok = speed_tables(&a, threads) && ok;
        if (threads && !a.gpu) ok = horn_tables(&a, threads) && ok;
        if (threads && !a.gpu) ok = overbeck_tables(&a, threads) && ok;
        if (threads && !a.gpu) ok = lohr_tables(&a, threads) && ok;
        if (threads && !a.gpu) ok = peers_tables(&a, threads) && ok;
    }
    pool_destroy(threads);
    free(a.scenes);
    return ok ? 0 : 1;
}
