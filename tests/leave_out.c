/* leave_out.c - what a scene does not have, counted: one case a call, whose work is all in measured().    tests/leave_out.sh prints the table.
   leave_out STRUCTURE ALGORITHM[:WIDTH] [THING]      16,384 eye rays at hills and as many that bounce off, or, ALGORITHM being "build", building
   leave_out picture THING                    64 x 64 pixels of 4 samples of hills and balls
   THING is what there is beside: none, sphere, instance, motion, plane, stats; of a picture none, mirror, glass, gloss, lens, shutter, motion, ...
   SPDX-License-Identifier: MIT OR Unlicense */

#define RT_IMPLEMENTATION
#include "../rt.h"
#include <stdlib.h>

enum { SIDE = 128, RAYS = SIDE * SIDE, CELLS = 96, TRIANGLES = 2 * CELLS * CELLS };

static float vertices[(CELLS + 1) * (CELLS + 1)][3];
static uint32_t indices[TRIANGLES][3];
static rt_ray rays[2 * RAYS];
static rt_hit hits[2 * RAYS];

static float noise(uint32_t n)              /* in [0,1) */
{
    n = (n ^ 61) * 0x9e3779b1u;
    n = (n ^ n >> 15) * 0x85ebca77u;
    return (float)((n ^ n >> 13) >> 8) / (1 << 24);
}

static void make_hills(rt_geometry *geometry)
{
    uint32_t x, z;
    for (z = 0; z <= CELLS; z++)
        for (x = 0; x <= CELLS; x++) {
            float *v = vertices[z * (CELLS + 1) + x];
            v[0] = 2 * (float)x / CELLS - 1;
            v[1] = 0.2f * sinf(7 * v[0]) * sinf(5 * (float)z / CELLS) + 0.03f * noise(z * (CELLS + 1) + x);
            v[2] = 2 * (float)z / CELLS - 1;
        }
    for (z = 0; z < CELLS; z++)
        for (x = 0; x < CELLS; x++) {
            const uint32_t at = z * (CELLS + 1) + x, two[2][3] = { { at, at + CELLS + 1, at + 1 }, { at + 1, at + CELLS + 1, at + CELLS + 2 } };
            memcpy(indices[2 * (z * CELLS + x)], two, sizeof two);
        }
    geometry->vertices = vertices[0];
    geometry->vertex_count = sizeof vertices / sizeof vertices[0];
    geometry->indices = indices[0];
    geometry->triangle_count = TRIANGLES;
}

/* Neighbours together, 8 x 8 by 8 x 8; then, where these hit, one ray each in any upward direction. */
static void make_rays(const rt_accel *accel)
{
    uint32_t i;
    for (i = 0; i < RAYS; i++) {
        const uint32_t block = i / 64, x = block % (SIDE / 8) * 8 + i % 8, y = block / (SIDE / 8) * 8 + i / 8 % 8;
        const rt_ray eye = { { 0, 1.5f, 2.2f }, 0, { ((float)x + 0.5f) / SIDE - 0.5f, -0.45f - 0.55f * ((float)y + 0.5f) / SIDE, -1 }, 100 };
        rt_hit hit;
        rt_ray *bounce = &rays[RAYS + i];
        rays[i] = *bounce = eye;
        if (!rt_intersect(accel, &eye, &hit)) continue;
        bounce->org.x += hit.t * eye.dir.x;
        bounce->org.y += hit.t * eye.dir.y + 1e-4f;
        bounce->org.z += hit.t * eye.dir.z;
        bounce->dir.x = 2 * noise(3 * i) - 1;
        bounce->dir.y = noise(3 * i + 1);
        bounce->dir.z = 2 * noise(3 * i + 2) - 1;
    }
}

typedef struct {
    rt_accel *accel, *shown;                /* by an instance */
    rt_geometry geometry, triangle;
    rt_build_options build;
    rt_trace_options trace;
    const char *how;
#ifndef RT_NO_SHADING
    rt_scene scene, part;
    const rt_scene *parts[1];
    rt_render_options render;
    rt_ray_counts counts;
    rt_vec3 pixels[64 * 64];
#endif
} job;

/* Out of line, so that what is counted is this and what it calls. */
#if defined(__GNUC__)
__attribute__((noinline))
#endif
void measured(job *j);
void measured(job *j)
{
    size_t i;
    if (!strcmp(j->how, "build")) (void)rt_build(&j->accel, &j->geometry, &j->build);
    else if (!strcmp(j->how, "rt_intersect"))
        for (i = 0; i < 2 * RAYS; i++) (void)rt_intersect(j->accel, &rays[i], &hits[i]);
    else if (!strcmp(j->how, "rt_occluded"))
        for (i = 0; i < 2 * RAYS; i++) hits[i].prim = rt_occluded(j->accel, &rays[i]);
#ifndef RT_NO_SHADING
    else if (!strcmp(j->how, "picture")) (void)rt_render_tile(&j->scene, &j->render, 0, 0, 64, 64, j->pixels, &j->counts);
#endif
    else (void)rt_trace(j->accel, &j->trace, rays, 2 * RAYS, hits);
}

static int usage(void)
{
    fprintf(stderr, "leave_out STRUCTURE ALGORITHM[:WIDTH]|build|rt_intersect|rt_occluded [THING], or leave_out picture THING\n");
    return 2;
}

#ifndef RT_NO_SPHERES
static const rt_sphere far_ball = { { 0, -3, 0 }, 0.5f };
#endif

/* Nothing of it is met by any ray. */
static bool add(job *j, const char *thing)
{
    if (!strcmp(thing, "none")) return true;
#ifndef RT_NO_SPHERES
    if (!strcmp(thing, "sphere")) {
        j->geometry.spheres = &far_ball;
        j->geometry.sphere_count = 1;
        return true;
    }
#endif
#ifndef RT_NO_INSTANCES
    if (!strcmp(thing, "instance") || !strcmp(thing, "motion")) {
        static const rt_motion motion = { { 0, -1, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 };
        static rt_instance instance = { NULL, { 1, 0, 0, 0,  0, 1, 0, -3,  0, 0, 1, 0 }, NULL };
        static const float corners[] = { 0, 0, 0, 1, 0, 0, 0, 0, 1 };
        j->triangle.vertices = corners;
        j->triangle.vertex_count = 3;
        j->triangle.triangle_count = 1;
        if (rt_build(&j->shown, &j->triangle, &j->build) != RT_OK) return false;
        instance.accel = j->shown;
        if (!strcmp(thing, "motion")) instance.motion = &motion;
        j->geometry.instances = &instance;
        j->geometry.instance_count = 1;
        return true;
    }
#endif
#ifndef RT_NO_PLANES
    if (!strcmp(thing, "plane")) {
        static const rt_plane disc = { { 0, -3, 0 }, { 0, 1, 0 }, 0.5f };
        j->geometry.planes = &disc;
        j->geometry.plane_count = 1;
        return true;
    }
#endif
#ifndef RT_NO_STATS
    if (!strcmp(thing, "stats")) {
        static rt_stats stats;
        j->trace.stats = &stats;
        return true;
    }
#endif
    return false;
}

#ifndef RT_NO_SHADING
/* What a picture may have, and a material, light or option for each. */
static bool draw(job *j, const char *thing)
{
    static const rt_vec3 grey = { 0.5f, 0.5f, 0.5f }, white = { 1, 1, 1 };
    static const rt_sphere balls[] = { { { -0.5f, 0.5f, 0.3f }, 0.3f }, { { 0.5f, 0.5f, 0.3f }, 0.3f } };
    static rt_texture texture;
    static rt_material materials[2];
    static uint32_t ids[TRIANGLES + 2];
    static rt_light light;
    rt_material *const ball = &materials[1];
    j->geometry.spheres = balls;
    j->geometry.sphere_count = 2;
    materials[0].diffuse = ball->diffuse = grey;
    ids[TRIANGLES] = ids[TRIANGLES + 1] = 1;
    light.position.y = 5;
    light.position.x = 2;
    light.color = white;
    j->scene.geometry = &j->geometry;
    j->scene.materials = materials;
    j->scene.material_count = 2;
    j->scene.material_ids = ids;
    j->scene.lights = &light;
    j->scene.light_count = 1;
    j->scene.background = white;
    j->scene.camera.eye.y = 1.5f;
    j->scene.camera.eye.z = 2.2f;
    j->scene.camera.up.y = 1;
    j->scene.camera.fov = 50;
    j->render.width = j->render.height = 64;
    j->render.spp = 4;
    j->render.trace.algorithm = RT_BVH_WIDE;            /* RT_AUTO tries by the clock: no two runs would count the same */
    j->render.trace.packet_width = 1;
    j->how = "picture";
    if (!strcmp(thing, "mirror")) ball->reflect = grey;
    else if (!strcmp(thing, "glass")) {
        ball->transmit = grey;
        ball->ior = 1.5f;
    } else if (!strcmp(thing, "checks")) {
        texture.kind = RT_TEXTURE_CHECKER;
        materials[0].texture = &texture;
    } else if (!strcmp(thing, "bumps")) {
        texture.kind = RT_TEXTURE_NOISE;
        materials[0].bump = &texture;
        materials[0].bump_height = 0.01f;
    }
#ifndef RT_NO_SAMPLING
    else if (!strcmp(thing, "gloss")) {
        ball->reflect = grey;
        ball->roughness = 0.3f;
    } else if (!strcmp(thing, "lens")) j->render.lens.radius = 0.05f;
    else if (!strcmp(thing, "shutter")) j->render.lens.close = 1;           /* nothing moves */
    else if (!strcmp(thing, "motion") && add(j, thing)) {
        j->render.lens.close = 1;
        j->part.accel = j->shown;
        j->part.geometry = &j->triangle;
        j->parts[0] = &j->part;
        j->scene.parts = j->parts;
    }
    else if (!strcmp(thing, "lamp")) light.radius = 0.5f;
    else if (!strcmp(thing, "filter")) j->render.filter = RT_FILTER_GAUSSIAN;
#endif
    else return !strcmp(thing, "none");
    return true;
}
#endif

static bool choose(job *j, const char *structure, const char *algorithm)
{
    static const char *const structures[] = { "bvh", "kdtree", "threaded" };
    size_t i;
    for (i = 0; i < RT_STRUCTURE_COUNT && strcmp(structure, structures[i]) != 0; i++) {}
    if (i == RT_STRUCTURE_COUNT) return false;
    j->build.structure = (rt_structure)i;
    j->how = algorithm;
    if (!strcmp(algorithm, "build") || !strcmp(algorithm, "rt_intersect") || !strcmp(algorithm, "rt_occluded")) return true;
    if (strchr(algorithm, ':')) j->trace.packet_width = atoi(strchr(algorithm, ':') + 1);
    for (i = 0; i < RT_ALGORITHM_COUNT; i++)
        if (!strncmp(algorithm, rt_algorithm_get(i)->name, strcspn(algorithm, ":"))) break;
    j->trace.algorithm = (rt_algorithm)i;
    return i < RT_ALGORITHM_COUNT;
}

int main(int argc, char **argv)
{
    static job j;
    make_hills(&j.geometry);
#ifndef RT_NO_SHADING
    if (argc == 3 && !strcmp(argv[1], "picture")) {
        rt_error error = { RT_OK, 0, "" };
        j.render.trace.error = &error;
        if (!draw(&j, argv[2])) return usage();
        if (rt_build(&j.accel, &j.geometry, NULL) != RT_OK) return 1;
        j.scene.accel = j.accel;
        if (rt_check_scene(&j.scene, &error) != RT_OK) return fprintf(stderr, "leave_out: %s\n", error.message), 1;
        measured(&j);
        rt_free(j.accel);
        rt_free(j.shown);
        printf("%lu %lu %lu %lu\n", (unsigned long)j.counts.primary, (unsigned long)j.counts.shadow, (unsigned long)j.counts.reflect,
               (unsigned long)j.counts.refract);
        return error.status != RT_OK;
    }
#endif
    if (argc < 3 || argc > 4 || !choose(&j, argv[1], argv[2]) || !add(&j, argc > 3 ? argv[3] : "none")) return usage();
    if (strcmp(j.how, "build") != 0) {
        rt_status status = rt_build(&j.accel, &j.geometry, &j.build);
        if (status != RT_OK) return fprintf(stderr, "leave_out: %s\n", rt_status_string(status)), 1;
        make_rays(j.accel);
    }
    measured(&j);
    if (!j.accel) return fprintf(stderr, "leave_out: not built\n"), 1;
    {
        uint64_t sum = 0;
        size_t i;
        for (i = 0; i < 2 * RAYS; i++) sum = sum * 31 + hits[i].prim;
        printf("%016lx\n", (unsigned long)sum);
    }
    rt_free(j.accel);
    rt_free(j.shown);
    return 0;
}
