/* A shared library that keeps rt.h to itself: compiled with -fvisibility=hidden it exports shared_sees alone. */
#define RT_IMPLEMENTATION
#include "rt.h"

__attribute__((visibility("default"))) int shared_sees(float x);
int shared_sees(float x)
{
    const rt_sphere ball = { { 0, 0, 0 }, 1 };
    const rt_ray ray = { { x, 0, 3 }, 0, { 0, 0, -1 }, 100 };
    static const rt_geometry nothing;
    rt_geometry geometry = nothing;
    rt_accel *accel;
    int seen;

    geometry.spheres = &ball;
    geometry.sphere_count = 1;
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return -1;
    seen = rt_occluded(accel, &ray);
    rt_free(accel);
    return seen;
}
