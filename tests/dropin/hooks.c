/* An allocator and assertions of one's own: all memory is asked for with the user's pointer, any request may fail, all is given back. */
#include "rt.h"
#include <setjmp.h>
#include <stdlib.h>

void *budget_take(void *user, size_t size);         /* what hooks_code.c calls */
void budget_give(void *user, void *pointer);
void misuse(void);

typedef struct { size_t held, blocks; long requests, fail_at; } budget;
typedef union { size_t size; double align[2]; } budget_head;        /* 16 bytes, in front of each block */

static jmp_buf misused;

void misuse(void) { longjmp(misused, 1); }

void *budget_take(void *user, size_t size)
{
    budget *b = (budget *)user;
    budget_head *head = ++b->requests == b->fail_at ? NULL : (budget_head *)malloc(sizeof *head + size);

    if (!head) return NULL;
    head->size = size;
    b->held += size;
    b->blocks++;
    return head + 1;
}

void budget_give(void *user, void *pointer)
{
    budget *b = (budget *)user;
    budget_head *head = (budget_head *)pointer - 1;

    b->held -= head->size;
    b->blocks--;
    free(head);
}

/* Fails every request in turn. The last build, in which none fails, holds what rt_get_info tells. */
static int sweep(rt_structure structure, const rt_geometry *geometry)
{
    static budget b;
    static rt_build_options options;
    rt_error error;
    rt_accel *accel;
    rt_info info;
    int good = 1;

    options.structure = structure;
    options.memory_user = &b;
    options.error = &error;
    for (b.fail_at = 1;; b.fail_at++) {
        b.requests = 0;
        if (rt_build(&accel, geometry, &options) == RT_OK) break;
        good &= error.status == RT_ERROR_MEMORY && !accel && b.held == 0 && b.blocks == 0;
    }
    rt_get_info(accel, &info);
    good &= b.fail_at > 2 && b.requests < b.fail_at && b.held >= info.bytes && b.held <= info.bytes + b.blocks;      /* an empty array takes a byte */
    rt_free(accel);
    return good && b.held == 0 && b.blocks == 0;
}

int main(void)
{
    static rt_sphere balls[50];
    static rt_geometry geometry;
    static const rt_ray ray = { { 0, 0, 1 }, 0, { 0, 0, -1 }, 1 };
    static const rt_hit miss = { 0, 0, 0, RT_NONE, RT_NONE };
    int i;

    for (i = 0; i < 50; i++) {
        balls[i].center.x = (float)i;
        balls[i].radius = 0.4f;
    }
    geometry.spheres = balls;
    geometry.sphere_count = 50;
    if (!sweep(RT_BVH, &geometry) || !sweep(RT_KDTREE, &geometry) || !sweep(RT_THREADED, &geometry)) return 1;
    if (setjmp(misused)) return 0;
    rt_spawn_origin(&geometry, NULL, &ray, &miss, ray.dir);         /* goes on from a miss */
    return 2;
}
