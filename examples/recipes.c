/* recipes.c - what README.md shows under Recipes, each function tried where the answer is known.
   cc -O2 recipes.c -I.. -o recipes -lm -ldl -lpthread && ./recipes                                   SPDX-License-Identifier: MIT OR Unlicense */

#define _POSIX_C_SOURCE 200809L             /* pool.h */

/* ---- own memory */

#include <stdint.h>
#include <stdlib.h>

typedef struct { size_t held, limit; } budget;              // bytes
static budget everything = { 0, SIZE_MAX / 2 };             // where options name no other

static void *budget_take(void *user, size_t size)
{
    budget *b = user ? user : &everything;
    size_t *block = size > b->limit - b->held ? NULL : malloc(size + 16);       // 16: as aligned as malloc's
    if (!block) return NULL;                                // the build answers RT_ERROR_MEMORY, and has given all back
    *block = size;
    b->held += size;                                        // no lock: the pool's threads do not come here
    return (char *)block + 16;
}

static void budget_give(void *user, void *pointer)
{
    budget *b = user ? user : &everything;
    size_t *block = (size_t *)(void *)((char *)pointer - 16);
    b->held -= *block;
    free(block);
}

#define RT_MALLOC(size, user) budget_take(user, size)       // user is memory_user of the options
#define RT_FREE(pointer, user) budget_give(user, pointer)
#define RT_IMPLEMENTATION
#include "rt.h"
#include "pool.h"                                           // yours, or examples/pool.h

static rt_status build_within(budget *memory, pool *threads, const rt_geometry *geometry, rt_accel **accel)
{
    // pool_for(threads, count, body, context) calls body(context, 0 .. count - 1) on any threads, and returns when all are done
    const rt_build_options options = { .memory_user = memory, .parallel_for = pool_for, .parallel_user = threads };
    return rt_build(accel, geometry, &options);
}

#define RT_GPU_IMPLEMENTATION
#include "rt_gpu.h"
#include <math.h>
#include <stdio.h>

/* ---- pick */

/* The triangle under a pixel, and the point of it there; RT_NONE: the background. */
static uint32_t pick(const rt_accel *accel, const rt_geometry *mesh, const rt_camera *camera, int x, int y, int width, int height,
                     float point[3])
{
    const rt_ray ray = rt_camera_ray(camera, (float)x + 0.5f, (float)y + 0.5f, width, height);      // through the pixel's middle
    rt_hit hit;

    if (!rt_intersect(accel, &ray, &hit)) return RT_NONE;
    const uint32_t *index = mesh->indices + 3 * (size_t)hit.prim;
    const float *a = mesh->vertices + 3 * index[0], *b = mesh->vertices + 3 * index[1], *c = mesh->vertices + 3 * index[2];
    for (int k = 0; k < 3; k++)             // so is interpolated whatever vertices have: normals, colours, texture coordinates
        point[k] = (1 - hit.u - hit.v) * a[k] + hit.u * b[k] + hit.v * c[k];
    return hit.prim;
}

/* ---- ambient occlusion */

/* How much of the sky a point of a triangle sees, 0 to 1, weighted by the cosine: of a texel of a lightmap, say. n: the triangle's normal, of
   unit length, to the side that is asked about. What is farther than distance hides nothing. */
static float sky_seen(const rt_accel *accel, const rt_geometry *mesh, uint32_t triangle, float u, float v, rt_vec3 n, float distance)
{
    enum { RAYS = 256 };                    // a power of 2 suits the sampler
    const rt_sampler sampler = { .spp = RAYS };
    const float *corner = mesh->vertices + 3 * (size_t)mesh->indices[3 * (size_t)triangle];
    const rt_ray onto = { { corner[0], corner[1], corner[2] }, 0, { -n.x, -n.y, -n.z }, 1 };
    const rt_hit at = { 0, u, v, triangle, RT_NONE };
    const float sign = copysignf(1, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    const rt_vec3 s = { 1 + sign * n.x * n.x * a, sign * b, -sign * n.x }, t = { b, sign + n.y * n.y * a, -n.y };     // at right angles
    int seen = 0;

    for (uint32_t i = 0; i < RAYS; i++) {
        float p[2];
        rt_sample_2d(&sampler, triangle, 0, i, 0, p);
        const float r = sqrtf(p[0]), x = r * cosf(6.2831853f * p[1]), y = r * sinf(6.2831853f * p[1]), z = sqrtf(1 - p[0]);
        rt_ray ray = { .tmax = distance };
        ray.dir = (rt_vec3){ x * s.x + y * t.x + z * n.x, x * s.y + y * t.y + z * n.y, x * s.z + y * t.z + z * n.z };
        ray.org = rt_spawn_origin(mesh, NULL, &onto, &at, ray.dir);         // off the surface by what rounding needs, so tmin is 0
        seen += !rt_occluded(accel, &ray);
    }
    return (float)seen / RAYS;
}

/* ---- shadows */

/* Sets a bit for each pixel that a lamp reaches, of what its eye ray hit: a shadow map without its resolution and its bias. */
static void find_lit(const rt_accel *accel, const rt_geometry *geometry, const rt_ray *eye, const rt_hit *seen, size_t pixels,
                     rt_vec3 lamp, uint32_t *lit)
{
    enum { BATCH = 256 };
    const rt_trace_options any = { .query = RT_ANY };       // the first hit that is found will do
    rt_ray rays[BATCH];
    rt_hit shadows[BATCH];

    for (size_t at = 0; at < pixels; at += BATCH) {
        const size_t count = pixels - at < BATCH ? pixels - at : BATCH;
        for (size_t i = 0; i < count; i++) {
            const rt_ray *e = &eye[at + i];
            const rt_hit *h = &seen[at + i];
            rays[i] = (rt_ray){ .tmax = 0 };                // of a pixel that sees nothing: misses
            if (h->prim == RT_NONE) continue;
            // on the eye's side: a lamp behind what is seen is hidden by it
            const rt_vec3 o = rt_spawn_origin(geometry, NULL, e, h, (rt_vec3){ -e->dir.x, -e->dir.y, -e->dir.z });
            rays[i] = (rt_ray){ o, 0, { lamp.x - o.x, lamp.y - o.y, lamp.z - o.z }, 1 };    // up to the lamp, where t is 1
        }
        rt_trace(accel, &any, rays, count, shadows);
        for (size_t i = 0; i < count; i++)
            if (seen[at + i].prim != RT_NONE && shadows[i].prim == RT_NONE) lit[(at + i) / 32] |= 1u << (at + i) % 32;
    }
}

/* ---- lidar */

/* A turn of a scanner with 16 beams, 15 degrees down to 15 up: metres to what each meets, 0 where that is nothing or outside of the range. */
static void sweep(const rt_accel *accel, rt_vec3 from, int steps, float nearest, float farthest, float (*range)[16])
{
    for (int i = 0; i < steps; i++) {
        const float around = 6.2831853f * (float)i / (float)steps;
        rt_ray rays[16];
        rt_hit hits[16];

        for (int beam = 0; beam < 16; beam++) {
            const float up = 0.0174532925f * (2 * (float)beam - 15);
            const rt_vec3 way = { cosf(up) * cosf(around), cosf(up) * sinf(around), sinf(up) };     // of unit length: t is in metres
            rays[beam] = (rt_ray){ from, nearest, way, farthest };
        }
        rt_trace(accel, NULL, rays, 16, hits);
        for (int beam = 0; beam < 16; beam++) range[i][beam] = hits[beam].prim == RT_NONE ? 0 : hits[beam].t;
    }
}

/* ---- GPU */

/* The hits of a GPU, or where there is none, of the CPU: the same, bit for bit. A program that traces more than once keeps gpu and there. */
static rt_status trace_fast(const rt_accel *accel, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rt_gpu *gpu;
    rt_gpu_accel *there;
    rt_status status = rt_gpu_open(&gpu, NULL);             // the first GPU, else a CPU that OpenCL knows

    if (status == RT_ERROR_NO_DEVICE || status == RT_ERROR_UNSUPPORTED) return rt_trace(accel, NULL, rays, count, hits);
    if (status != RT_OK) return status;
    status = rt_gpu_upload(gpu, &there, accel, NULL);
    if (status == RT_OK) status = rt_gpu_trace(gpu, there, NULL, rays, count, hits);
    rt_gpu_close(gpu);                                      // and what it made
    return status;
}

/* ---- line of sight */

/* Which pairs of points see each other: ears and sources of sound, guards and doors. Nothing at the points themselves hides them. */
static void find_sight(const rt_accel *accel, const rt_vec3 *from, const rt_vec3 *to, size_t pairs, bool *clear)
{
    enum { BATCH = 256 };
    const rt_trace_options any = { .query = RT_ANY };
    rt_ray rays[BATCH];
    rt_hit hits[BATCH];

    for (size_t at = 0; at < pairs; at += BATCH) {
        const size_t count = pairs - at < BATCH ? pairs - at : BATCH;
        for (size_t i = 0; i < count; i++) {
            const rt_vec3 a = from[at + i], b = to[at + i];
            rays[i] = (rt_ray){ a, 1e-4f, { b.x - a.x, b.y - a.y, b.z - a.z }, 1 - 1e-4f };     // but for 1/10000 of the way at its ends
        }
        rt_trace(accel, &any, rays, count, hits);
        for (size_t i = 0; i < count; i++) clear[at + i] = hits[i].prim == RT_NONE;
    }
}

/* ---- moving instances */

/* Two of one thing: one stands 5 to the left, one goes 10 to the right while time runs from 0 to 1, and turns half way round. */
static rt_status place(const rt_accel *thing, rt_accel **accel)
{
    const rt_motion motion = { .move = { 10, 0, 0 }, .axis = { 0, 1, 0 }, .angle = 3.14159265f };
    const rt_instance instances[] = { { thing, { 1, 0, 0, -5,  0, 1, 0, 0,  0, 0, 1, 0 }, NULL },      // 3 rows of 4
                                      { thing, { 1, 0, 0, 0,   0, 1, 0, 0,  0, 0, 1, 0 }, &motion } };
    const rt_geometry geometry = { .instances = instances, .instance_count = 2 };

    return rt_build(accel, &geometry, NULL);                // copies all but thing, which must stay
}

/* What a ray meets at a time, and the normal there, of a triangle whose normal at home is given; false: nothing. */
static bool meet(const rt_accel *accel, const rt_ray *ray, float time, const rt_vec3 *normals, rt_hit *hit, rt_vec3 *normal)
{
    const rt_trace_options options = { .times = &time };    // one a ray
    float m[9];

    if (rt_trace(accel, &options, ray, 1, hit) != RT_OK || hit->prim == RT_NONE) return false;
    if (!rt_instance_transform_at(accel, hit->inst, time, NULL, m)) return false;
    const rt_vec3 n = normals[hit->prim];                   // prim counts in what the instance shows, inst says which one it is
    normal->x = m[0] * n.x + m[1] * n.y + m[2] * n.z;
    normal->y = m[3] * n.x + m[4] * n.y + m[5] * n.z;
    normal->z = m[6] * n.x + m[7] * n.y + m[8] * n.z;
    return true;
}

/* ---- what each must answer */

static int failures;

static void expect(bool good, const char *what)
{
    if (good) return;
    failures++;
    printf("recipes: wrong: %s\n", what);
}

static bool near_to(float a, float b, float by) { return fabsf(a - b) <= by; }

/* A floor of 2 triangles at y 0, 10 on 10, and a ball of radius 1 that hangs 2 above its middle. */
static const float corners[] = { -5,0,-5,  5,0,-5,  5,0,5,  -5,0,5 };
static const uint32_t floor_indices[] = { 0,2,1,  0,3,2 };
static const rt_sphere ball = { {0, 2, 0}, 1 };
static const rt_geometry room = { .vertices = corners, .vertex_count = 4, .indices = floor_indices, .triangle_count = 2, .spheres = &ball, .sphere_count = 1 };
enum { SIDE = 64, PIXELS = SIDE * SIDE };

static void check_pick(const rt_accel *accel)
{
    const rt_camera above = { {0, 10, 0}, {0, 0, 0}, {0, 0, -1}, 90 };          // a pixel of 100 is 0.2 of the floor
    const rt_geometry mesh = { .vertices = corners, .vertex_count = 4, .indices = floor_indices, .triangle_count = 2 };
    float p[3];

    expect(pick(accel, &mesh, &above, 70, 40, 100, 100, p) == 0, "pick: the triangle");
    expect(near_to(p[0], 4.1f, 1e-4f) && near_to(p[1], 0, 1e-4f) && near_to(p[2], -1.9f, 1e-4f), "pick: the point");
    expect(pick(accel, &mesh, &above, 30, 60, 100, 100, p) == 1, "pick: the other triangle");
    expect(pick(accel, &mesh, &above, 3, 40, 100, 100, p) == RT_NONE, "pick: beside the floor");
}

static void check_sky(const rt_accel *accel)
{
    const rt_vec3 up = { 0, 1, 0 }, down = { 0, -1, 0 };

    // the middle is on the edge of both triangles; a ball hides the square of radius by distance
    expect(near_to(sky_seen(accel, &room, 0, 0.5f, 0, up, INFINITY), 0.75f, 0.01f), "sky_seen: below the ball");
    expect(sky_seen(accel, &room, 0, 0.5f, 0, up, 0.9f) == 1, "sky_seen: not so far");
    expect(sky_seen(accel, &room, 0, 0.3f, 0.3f, down, INFINITY) == 1, "sky_seen: below the floor");
}

static void check_shadows(const rt_accel *accel)
{
    static rt_ray eye[PIXELS];
    static rt_hit seen[PIXELS];
    static uint32_t lit[PIXELS / 32];
    const rt_camera above = { {0, 10, 0}, {0, 0, 0}, {0, 0, -1}, 60 };
    const rt_vec3 lamp = { 0, 4, 0 };       // the shadow of the ball is a disc of radius 4 / sqrt(3)
    size_t wrong = 0, bright = 0;

    for (size_t i = 0; i < PIXELS; i++) eye[i] = rt_camera_ray(&above, (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, SIDE, SIDE);
    rt_trace(accel, NULL, eye, PIXELS, seen);
    find_lit(accel, &room, eye, seen, PIXELS, lamp, lit);
    for (size_t i = 0; i < PIXELS; i++) {
        const float x = eye[i].org.x + seen[i].t * eye[i].dir.x, y = eye[i].org.y + seen[i].t * eye[i].dir.y, z = eye[i].org.z + seen[i].t * eye[i].dir.z;
        const bool is = lit[i / 32] >> i % 32 & 1;
        const float inside = seen[i].prim == RT_NONE ? 1 : seen[i].prim < 2 ? 4 / sqrtf(3) - sqrtf(x * x + z * z) : 2.5f - y;

        bright += is;
        if (seen[i].prim == RT_NONE ? is : fabsf(inside) > 1e-3f && is != (inside < 0)) wrong++;
    }
    expect(wrong == 0 && bright > 100, "find_lit");
    memset(lit, 0, sizeof lit);
    find_lit(accel, &room, eye, seen, PIXELS, (rt_vec3){ 1, -3, 2 }, lit);
    for (size_t i = 0; i < PIXELS / 32; i++) expect(lit[i] == 0, "find_lit: from below the floor");
}

static void check_sweep(void)
{
    const rt_sphere shell = { {1, 2, 3}, 10 };
    const rt_geometry geometry = { .spheres = &shell, .sphere_count = 1 };
    static float range[90][16];
    rt_accel *accel;
    bool all[3] = { true, true, true };

    if (rt_build(&accel, &geometry, NULL) != RT_OK) { expect(false, "sweep: build"); return; }
    for (int gate = 0; gate < 3; gate++) {  // which holds the shell, ends before it, begins behind it
        sweep(accel, shell.center, 90, gate == 2 ? 10.5f : 0.5f, gate == 1 ? 9.5f : 100, range);
        for (int i = 0; i < 90 * 16; i++) all[gate] = all[gate] && near_to(range[i / 16][i % 16], gate == 0 ? 10 : 0, 1e-4f);
    }
    expect(all[0] && all[1] && all[2], "sweep");
    rt_free(accel);
}

static void check_fast(const rt_accel *accel)
{
    static rt_ray rays[PIXELS];
    static rt_hit hits[PIXELS], same[PIXELS];
    const rt_camera aside = { {3, 4, 9}, {0, 1, 0}, {0, 1, 0}, 50 };

    for (size_t i = 0; i < PIXELS; i++) rays[i] = rt_camera_ray(&aside, (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, SIDE, SIDE);
    expect(trace_fast(accel, rays, PIXELS, hits) == RT_OK, "trace_fast");
    rt_trace(accel, NULL, rays, PIXELS, same);
    expect(memcmp(hits, same, sizeof hits) == 0, "trace_fast: other hits");
}

static void check_sight(const rt_accel *accel)
{
    const rt_vec3 from[] = { {-3, 2, 0}, {-3, 2, 0},     {4, 0, 4}, {4, 1, 4},  {0, 3, 0} };
    const rt_vec3 to[]   = { {3, 2, 0},  {3, 2, 2.9f},   {4, 3, 4}, {4, -1, 4}, {4, 4, 4} };      // through the ball, beside it, off the
    const bool want[]    = { false,      true,           true,      false,      true };           // floor, through it, up from the ball
    bool clear[5];

    find_sight(accel, from, to, 5, clear);
    for (int i = 0; i < 5; i++) expect(clear[i] == want[i], "find_sight");
}

static void check_moving(void)
{
    static const float leaf[] = { -1,-1,0,  1,-1,0,  0,1,0 };
    const rt_geometry geometry = { .vertices = leaf, .vertex_count = 3, .triangle_count = 1 };
    const rt_vec3 normals[] = { {0, 0, 1} };
    static const struct { float x, time; bool seen; uint32_t inst; float normal; } cases[] = {
        { -5, 0, true, 0, 1 }, { -5, 1, true, 0, 1 }, { 0, 0, true, 1, 1 }, { 0, 1, false, 0, 0 }, { 10, 0, false, 0, 0 }, { 10, 1, true, 1, -1 },
        { 2.5f, 0.25f, true, 1, 0.70710678f },
    };
    rt_accel *thing, *accel;

    if (rt_build(&thing, &geometry, NULL) != RT_OK || place(thing, &accel) != RT_OK) { expect(false, "place"); return; }
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const rt_ray ray = { {cases[i].x, -0.5f, 5}, 0, {0, 0, -2}, 100 };
        rt_hit hit;
        rt_vec3 normal = { 0, 0, 0 };
        const bool seen = meet(accel, &ray, cases[i].time, normals, &hit, &normal);

        expect(seen == cases[i].seen && (!seen || (hit.inst == cases[i].inst && near_to(normal.z, cases[i].normal, 1e-5f))), "meet");
    }
    rt_free(accel);
    rt_free(thing);
}

static void check_budget(void)
{
    enum { BALLS = 20000 };
    static rt_sphere balls[BALLS];
    const rt_geometry geometry = { .spheres = balls, .sphere_count = BALLS };
    budget memory = { 0, 100000 };
    pool *threads = pool_create(2);
    rt_accel *accel;
    rt_info info;

    for (int i = 0; i < BALLS; i++) balls[i] = (rt_sphere){ {(float)(i % 100), (float)(i / 100), (float)(i % 7)}, 0.4f };
    if (!threads) { expect(false, "pool"); return; }
    expect(build_within(&memory, threads, &geometry, &accel) == RT_ERROR_MEMORY && memory.held == 0, "build_within: too little");
    memory.limit = 10000000;
    expect(build_within(&memory, threads, &geometry, &accel) == RT_OK, "build_within");
    rt_get_info(accel, &info);
    expect(memory.held >= info.bytes && memory.held <= memory.limit, "build_within: what it holds");
    rt_free(accel);
    expect(memory.held == 0, "build_within: what is left");
    pool_destroy(threads);
}

int main(void)
{
    rt_accel *accel;

    if (rt_build(&accel, &room, NULL) != RT_OK) return 1;
    check_pick(accel);
    check_sky(accel);
    check_shadows(accel);
    check_sweep();
    check_fast(accel);
    check_sight(accel);
    check_moving();
    check_budget();
    rt_free(accel);
    expect(everything.held == 0, "memory left");
    if (failures == 0) printf("all recipes answer as they should\n");
    return failures != 0;
}
