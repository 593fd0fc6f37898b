/* One of two copies in a program: everything, and nothing but main is seen outside. */
#define RT_STATIC
#define RT_IMPLEMENTATION
#include "rt.h"

int see_other(void);                        /* of static_other.c */

int main(void)
{
    static const rt_sphere ball = { { 0, 0, 0 }, 1 };
    static const rt_ray ray = { { 0, 0, 3 }, 0, { 0, 0, -1 }, 100 };
    static rt_geometry geometry;
    rt_accel *accel;
    int seen;

    geometry.spheres = &ball;
    geometry.sphere_count = 1;
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
    seen = rt_occluded(accel, &ray) && see_other();
    rt_free(accel);
    return seen ? 0 : 1;
}
