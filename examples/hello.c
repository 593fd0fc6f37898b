/* hello.c - a ball on a chequered floor, drawn with letters.    cc -O2 hello.c -I.. -o hello -lm && ./hello */
#define RT_IMPLEMENTATION
#include "rt.h"
#include <math.h>
#include <stdio.h>

static rt_vec3 minus(rt_vec3 a, rt_vec3 b) { rt_vec3 c = { a.x - b.x, a.y - b.y, a.z - b.z }; return c; }
static float dot(rt_vec3 a, rt_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

int main(void)
{
    static const float corners[] = { -5,0,-5,  5,0,-5,  5,0,5,  -5,0,5 };
    static const uint32_t floor_indices[] = { 0,1,2,  0,2,3 };
    const rt_sphere ball = { {0, 1, 0}, 1 };
    const rt_geometry geometry = { .vertices = corners, .vertex_count = 4, .indices = floor_indices, .triangle_count = 2,
                                   .spheres = &ball, .sphere_count = 1 };       // primitives 0 and 1: the floor; 2: the ball
    const rt_camera camera = { {1, 2.4f, 6}, {0.5f, 0.85f, 0}, {0, 1, 0}, 28 };    // eye, look, up, vertical angle
    const rt_vec3 light = { -5, 7, 4 }, up = { 0, 1, 0 };
    rt_accel *accel;

    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
    for (int y = 0; y < 26; y++, putchar('\n')) {
        for (int x = 0; x < 78; x++) {                                          // a letter is twice as high as wide
            rt_ray ray = rt_camera_ray(&camera, (float)x + 0.5f, (float)(2 * y + 1), 78, 52);
            rt_hit hit;
            if (!rt_intersect(accel, &ray, &hit)) { putchar(' '); continue; }
            rt_vec3 p = { ray.org.x + hit.t * ray.dir.x, ray.org.y + hit.t * ray.dir.y, ray.org.z + hit.t * ray.dir.z };
            rt_vec3 normal = hit.prim == 2 ? minus(p, ball.center) : up, to_light = minus(light, p);
            rt_ray shadow = { p, 0.001f, to_light, 1 };                         // from just above the surface to the light
            float bright = hit.prim == 2 ? 1 : ((int)floorf(p.x) + (int)floorf(p.z)) % 2 ? 0.9f : 0.35f;
            float facing = dot(normal, to_light) / sqrtf(dot(to_light, to_light));
            if (facing < 0 || rt_occluded(accel, &shadow)) facing = 0;
            putchar(".:-=+*#%@@"[(int)(9 * bright * (0.1f + 0.9f * facing))]);
        }
    }
    rt_free(accel);
    return 0;
}
