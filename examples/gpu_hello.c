/* gpu_hello.c - a million rays on an OpenCL device, and on the CPU: the same hits.    cc -O2 gpu_hello.c -I.. -o gpu_hello -lm -ldl && ./gpu_hello */
#define RT_IMPLEMENTATION
#include "rt.h"
#define RT_GPU_IMPLEMENTATION
#include "rt_gpu.h"
#include <stdio.h>

enum { SIDE = 1024, COUNT = SIDE * SIDE, BALLS = 20000 };
static rt_sphere balls[BALLS];
static rt_ray rays[COUNT];
static rt_hit hits[COUNT], same[COUNT];

int main(void)
{
    const rt_geometry geometry = { .spheres = balls, .sphere_count = BALLS };
    const rt_camera camera = { {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 40 };           // eye, look, up, vertical angle
    rt_error error = { RT_OK, 0, "" };
    const rt_gpu_options options = { .error = &error };
    rt_gpu *gpu;
    rt_accel *accel;
    rt_gpu_accel *there;
    rt_gpu_info info;
    uint32_t seed = 1;
    size_t i, seen = 0;

    for (i = 0; i < BALLS; i++)
        for (int k = 0; k < 3; k++) ((float *)&balls[i].center)[k] = (float)((seed = seed * 1664525 + 1013904223) >> 8) / (1 << 23) - 1;
    for (i = 0; i < BALLS; i++) balls[i].radius = 0.02f;
    for (i = 0; i < COUNT; i++) rays[i] = rt_camera_ray(&camera, (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, SIDE, SIDE);
    if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
    if (rt_gpu_open(&gpu, &options) != RT_OK                                    // the first GPU, else a CPU
        || rt_gpu_upload(gpu, &there, accel, &error) != RT_OK
        || rt_gpu_trace(gpu, there, &(rt_trace_options){ .error = &error }, rays, COUNT, hits) != RT_OK) {
        fprintf(stderr, "gpu_hello: %s\n", error.message);
        return 1;
    }
    rt_gpu_get_info(gpu, &info);
    rt_trace(accel, NULL, rays, COUNT, same);
    for (i = 0; i < COUNT; i++) seen += hits[i].prim != RT_NONE;
    printf("%s: %lu of %d rays hit; %s the CPU's hits\n", info.name, (unsigned long)seen, COUNT, memcmp(hits, same, sizeof hits) ? "NOT" : "equal, bit for bit, to");
    rt_gpu_close(gpu);
    rt_free(accel);
    return 0;
}
