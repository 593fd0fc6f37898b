/* Declarations alone, as C or C++: builds and traces what two_code.c, the file with the code, traces too. */
#include "rt.h"
#include "rt.h"

RT_API int rt_seen_there(const rt_accel *accel);     /* RT_API: extern "C" in C++, so that either file may be either language */

int main()
{
    static const float corners[] = { 0, 0, 0,  1, 0, 0,  0, 1, 0 };
    static const rt_ray ray = { { 0.2f, 0.3f, 1 }, 0, { 0, 0, -1 }, 100 };
    static rt_geometry geometry;
    rt_accel *accel;
    rt_hit hit;
    int seen;

    geometry.vertices = corners;
    geometry.vertex_count = 3;
    geometry.triangle_count = 1;
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
    seen = rt_intersect(accel, &ray, &hit) && hit.prim == 0 && rt_seen_there(accel);
    rt_free(accel);
    return seen ? 0 : 1;
}
