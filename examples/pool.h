/* pool.h - a pool of threads that shares out the calls of a loop; pool_for is an rt_parallel_for.    Needs POSIX threads.
   SPDX-License-Identifier: MIT OR Unlicense */

#ifndef POOL_H
#define POOL_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <unistd.h>

#define POOL_API static __attribute__((unused))     /* a program need not call all of them */

typedef struct pool {
    pthread_mutex_t lock;                   /* guards all that follows, but for next */
    pthread_cond_t wake, idle;
    pthread_t *threads;
    int thread_count;                       /* started; the thread that calls pool_for works too */
    int working;                            /* threads that have not finished the loop at hand; atomic */
    bool stop;
    size_t round;                           /* how many loops there have been: tells a thread that a new one is there; atomic */
    void (*body)(void *context, size_t index);      /* of the loop at hand; NULL between loops */
    void *context;
    size_t count;
    size_t next;                            /* the next index to hand out; atomic */
} pool;

#define POOL_LOOKS 4000                     /* some 50 microseconds */

/* What is waited for often comes at once, and to sleep and be woken takes longer than many a loop: so a thread looks a few times first. */
POOL_API void pool_pause(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

/* Runs calls of the loop at hand until none is left. The lock must not be held. */
POOL_API void pool_work(pool *p, size_t count, void (*body)(void *context, size_t index), void *context)
{
    for (;;) {
        size_t index = __atomic_fetch_add(&p->next, 1, __ATOMIC_RELAXED);

        if (index >= count) return;
        body(context, index);
    }
}

POOL_API void *pool_thread(void *pool_pointer)
{
    pool *p = (pool *)pool_pointer;
    size_t seen = 0;

    pthread_mutex_lock(&p->lock);
    for (;;) {
        void (*body)(void *context, size_t index);
        void *context;
        size_t count;
        int looks;

        pthread_mutex_unlock(&p->lock);
        for (looks = 0; looks < POOL_LOOKS && __atomic_load_n(&p->round, __ATOMIC_RELAXED) == seen; looks++) pool_pause();
        pthread_mutex_lock(&p->lock);
        while (!p->stop && p->round == seen) pthread_cond_wait(&p->wake, &p->lock);
        if (p->stop) break;
        seen = p->round;
        body = p->body;
        context = p->context;
        count = p->count;
        pthread_mutex_unlock(&p->lock);
        pool_work(p, count, body, context);
        pthread_mutex_lock(&p->lock);
        if (__atomic_sub_fetch(&p->working, 1, __ATOMIC_RELAXED) == 0) pthread_cond_signal(&p->idle);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* Ends the threads; NULL is fine. No loop may be running. */
POOL_API void pool_destroy(pool *p)
{
    int i;

    if (!p) return;
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_cond_broadcast(&p->wake);
    pthread_mutex_unlock(&p->lock);
    for (i = 0; i < p->thread_count; i++) pthread_join(p->threads[i], NULL);
    pthread_cond_destroy(&p->idle);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->lock);
    free(p->threads);
    free(p);
}

static long pool_processors(void)
{
#ifdef _WIN32
    return pthread_num_processors_np();     /* of winpthreads: Windows has no sysconf */
#else
    return sysconf(_SC_NPROCESSORS_ONLN);
#endif
}

/* threads counts the caller of pool_for; 0: as many as there are processors. NULL: out of memory, or the threads cannot start. */
POOL_API pool *pool_create(int threads)
{
    long processors = threads > 0 ? threads : pool_processors();
    int others = processors > 1 ? (int)processors - 1 : 0;
    pool *p = (pool *)calloc(1, sizeof *p);

    if (!p) return NULL;
    p->threads = (pthread_t *)calloc((size_t)others + 1, sizeof *p->threads);
    if (!p->threads) goto no_threads;
    if (pthread_mutex_init(&p->lock, NULL) != 0) goto no_lock;
    if (pthread_cond_init(&p->wake, NULL) != 0) goto no_wake;
    if (pthread_cond_init(&p->idle, NULL) != 0) goto no_idle;
    for (; p->thread_count < others; p->thread_count++)
        if (pthread_create(&p->threads[p->thread_count], NULL, pool_thread, p) != 0) {
            pool_destroy(p);
            return NULL;
        }
    return p;

no_idle:
    pthread_cond_destroy(&p->wake);
no_wake:
    pthread_mutex_destroy(&p->lock);
no_lock:
    free(p->threads);
no_threads:
    free(p);
    return NULL;
}

/* How many threads work on a loop, the caller of pool_for among them. */
POOL_API int pool_threads(const pool *p)
{
    return p->thread_count + 1;
}

/* Calls body(context, 0..count-1), each once and in any order, on all threads of the pool and this one; returns when all are done.
   A call from inside a body, or while another thread is in pool_for, is legal but runs on its own thread alone. */
POOL_API void pool_for(void *pool_pointer, size_t count, void (*body)(void *context, size_t index), void *context)
{
    pool *p = (pool *)pool_pointer;
    bool alone;
    size_t i;
    int looks;

    pthread_mutex_lock(&p->lock);
    alone = p->body != NULL || p->thread_count == 0 || count < 2;
    if (!alone) {
        p->body = body;
        p->context = context;
        p->count = count;
        __atomic_store_n(&p->working, p->thread_count, __ATOMIC_RELAXED);
        __atomic_store_n(&p->next, 0, __ATOMIC_RELAXED);
        __atomic_store_n(&p->round, p->round + 1, __ATOMIC_RELAXED);
        pthread_cond_broadcast(&p->wake);
    }
    pthread_mutex_unlock(&p->lock);
    if (alone) {
        for (i = 0; i < count; i++) body(context, i);
        return;
    }
    pool_work(p, count, body, context);
    for (looks = 0; looks < POOL_LOOKS && __atomic_load_n(&p->working, __ATOMIC_RELAXED) > 0; looks++) pool_pause();
    pthread_mutex_lock(&p->lock);
    while (p->working > 0) pthread_cond_wait(&p->idle, &p->lock);
    p->body = NULL;
    pthread_mutex_unlock(&p->lock);
}

#endif /* POOL_H */
