/* One structure alone: the others are refused by name, and what it has, by every algorithm, hits what all structures hit: the sum that main prints. */
#define RT_IMPLEMENTATION
#include "rt.h"

int main(void)
{
    static const char *const macros[] = { "RT_NO_BVH", "RT_NO_KDTREE", "RT_NO_THREADED" };
    static rt_sphere balls[500];
    static rt_ray rays[1024];
    static rt_hit hits[1024];
    rt_geometry geometry;
    uint32_t seed = 1, i, structure, built = 0;
    uint64_t sum_of_all = 0;
    memset(&geometry, 0, sizeof geometry);
    for (i = 0; i < 500; i++) {
        float *ball = &balls[i].center.x;
        int k;
        for (k = 0; k < 4; k++) ball[k] = (float)((seed = seed * 1664525 + 1013904223) >> 8) / (k < 3 ? 1 << 22 : 1 << 26);
    }
    geometry.spheres = balls;
    geometry.sphere_count = 500;
    for (i = 0; i < 1024; i++) {
        const rt_ray ray = { { 2, 2, -5 }, 0, { (float)(i % 32) / 40 - 0.4f, (float)(i / 32) / 40 - 0.4f, 1 }, 100 };
        rays[i] = ray;
    }
    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) {
        const rt_algorithm_info *info;
        rt_build_options options;
        rt_error error;
        rt_accel *accel;
        rt_status status;
        size_t at;
        memset(&options, 0, sizeof options);
        options.structure = (rt_structure)structure;
        options.error = &error;
        status = rt_build(&accel, &geometry, &options);
        if (status == RT_ERROR_UNSUPPORTED && !accel && strstr(error.message, macros[structure])) {
            options.no_binary = true;       /* of what is not there: says so too */
            if (rt_build(&accel, &geometry, &options) != RT_ERROR_UNSUPPORTED || !strstr(error.message, macros[structure])) return 1;
            continue;
        }
        if (status != RT_OK) return 1;
        built++;
        for (at = 0; (info = rt_algorithm_get(at)) != NULL; at++) {
            rt_trace_options trace;
            uint64_t sum = 0;
            memset(&trace, 0, sizeof trace);
            trace.algorithm = info->algorithm;
            if (info->structure != RT_STRUCTURE_COUNT && info->structure != options.structure) continue;
            status = rt_trace(accel, &trace, rays, 1024, hits);
            if (status != (info->built ? RT_OK : RT_ERROR_UNSUPPORTED)) return 1;
            if (status != RT_OK) continue;
            for (i = 0; i < 1024; i++) {
                uint32_t bits;
                memcpy(&bits, &hits[i].t, sizeof bits);
                sum = (sum * 31 + hits[i].prim) * 31 + bits;
            }
            if (sum_of_all && sum != sum_of_all) return 1;
            sum_of_all = sum;
        }
        rt_free(accel);
    }
    printf("%08lx%08lx\n", (unsigned long)(sum_of_all >> 32), (unsigned long)(sum_of_all & 0xffffffff));
    return built == 0;
}
