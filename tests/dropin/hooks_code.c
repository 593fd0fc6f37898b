/* The code of hooks.c's program: it calls these, and neither malloc nor abort. */
#include <stddef.h>
void *budget_take(void *user, size_t size);
void budget_give(void *user, void *pointer);
void misuse(void);
#define RT_MALLOC(size, user) budget_take(user, size)
#define RT_FREE(pointer, user) budget_give(user, pointer)
#define RT_ASSERT(x) ((x) ? (void)0 : misuse())
#define RT_IMPLEMENTATION
#include "rt.h"
#define RT_GPU_IMPLEMENTATION
#include "rt_gpu.h"
