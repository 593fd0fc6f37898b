/* The code, behind an include of the declarations alone: as in a program whose other headers include rt.h. */
#include "rt.h"
#define RT_IMPLEMENTATION
#include "rt.h"
#include "rt.h"

RT_API int rt_seen_there(const rt_accel *accel);
RT_API int rt_seen_there(const rt_accel *accel)
{
    const rt_ray ray = { { 0.2f, 0.3f, -1 }, 0, { 0, 0, 1 }, 100 };
    rt_hit hit;

    return rt_occluded(accel, &ray) && rt_trace(accel, NULL, &ray, 1, &hit) == RT_OK && hit.prim == 0;
}
