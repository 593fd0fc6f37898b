/* The other copy, with other types, allocator and file name: copies share nothing, so they need not agree. */
#include <stdlib.h>
#define RT_STATIC
#define RT_NO_SPHERES
#define RT_NO_INSTANCES
#define RT_NO_STATS
#define RT_MALLOC(size, user) ((void)(user), calloc(1, size))
#define RT_FREE(pointer, user) ((void)(user), free(pointer))
#define RT_IMPLEMENTATION
#define RT_SELF "raytracer.h"
#include "lib/raytracer.h"                  /* a copy of rt.h in a folder of its own */

int see_other(void);
int see_other(void)
{
    static const float corners[] = { 0, 0, 0,  1, 0, 0,  0, 1, 0 };
    static const rt_ray ray = { { 0.2f, 0.3f, 1 }, 0, { 0, 0, -1 }, 100 };
    static rt_geometry geometry;
    rt_accel *accel;
    int seen;

    geometry.vertices = corners;
    geometry.vertex_count = 3;
    geometry.triangle_count = 1;
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 0;
    seen = rt_occluded(accel, &ray);
    rt_free(accel);
    return seen;
}
