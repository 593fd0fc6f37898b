/* Behind a crowd of macros: declarations, then the code, of rt.h and rt_gpu.h. */
#include "macros.h"
#include "rt.h"
#include "rt_gpu.h"
#define RT_IMPLEMENTATION
#include "rt.h"
#define RT_GPU_IMPLEMENTATION
#include "rt_gpu.h"

int main(void)
{
    static rt_sphere balls[100];
    static rt_ray rays[256];
    static rt_hit hits[256], same[256];
    static rt_geometry geometry;
    static rt_trace_options options;
    rt_accel *accel;
    rt_gpu_info info;
    size_t count;
    int i, wrong = 0;

    for (i = 0; i < 100; i++) {
        balls[i].center.x = (float)(i % 10);
        balls[i].center.y = (float)(i / 10);
        balls[i].radius = 0.4f;
    }
    for (i = 0; i < 256; i++) {
        rays[i].org.z = 5;
        rays[i].dir.x = (float)(i % 16);
        rays[i].dir.y = (float)(i / 16);
        rays[i].dir.z = -5;
        rays[i].tmax = 10;
    }
    geometry.spheres = balls;
    geometry.sphere_count = 100;
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
    options.algorithm = RT_BVH_STACK;
    rt_trace(accel, &options, rays, 256, same);
    rt_trace(accel, NULL, rays, 256, hits);
    for (i = 0; i < 256; i++) wrong += hits[i].prim != same[i].prim || (i % 16 < 10 && i / 16 < 10) != (hits[i].prim != RT_NONE);
    rt_free(accel);
    rt_gpu_list(&info, 1, &count, NULL);    /* there may be none */
    return wrong != 0;
}
