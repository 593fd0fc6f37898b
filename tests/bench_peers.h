/* bench_peers.h - are we faster than Embree, and where? Part of bench.c.    SPDX-License-Identifier: MIT OR Unlicense

   >>peers-scenes  >>peers-ways  >>peers-measure  >>peers-rays  >>peers-build  >>peers-quality  >>peers-scale  >>peers-threads
   >>peers-main

   Embree is called in every way that its documentation offers for such rays, with denormals flushed to zero, and its best one counts:
   single rays, packets of 4, 8 and 16, and streams; told that rays are coherent, or that they are not; on trees of medium and high
   quality. A first look at a sample of the rays picks those ways that are measured on all of them. What runs on one thread is
   measured in processor time, which other programs spoil less; what runs on more by the clock on the wall. */

#define PEERS_SIZE 1024
#define PEERS_SMALL 512                     /* of tables with many trees, for the time */
#define PEERS_ROUNDS 5
#define PEERS_FEW_ROUNDS 3                  /* of builds, after one that warms up, and of tables that take long */
#define PEERS_SLICE 524288u                 /* rays from one change of turns to the next: some 10 to 200 ms, so that to read a tree again, which
                                               others have driven out of the caches, is a small part of it */
#define PEERS_TRIAL_BLOCK 1024u             /* the sample: one such block of rays of every PEERS_TRIAL_STEP */
#define PEERS_TRIAL_STEP 16u
#define PEERS_TRIALS 2
#define PEERS_NEAR 1.05                     /* what takes at most so much longer than its column's best in the first look is measured too */
#define PEERS_KEPT 2                        /* ... but at most so many a column */
#define PEERS_TINY 1000                     /* triangles; scenes of fewer are left out where builds are timed */

/* ---- >>peers-scenes ------------------------------------------------------------------------------------------------- */

/* Camera and light are ours but for those of BART. */
typedef struct {
    const char *title, *file;               /* the file within --scenes */
    rt_camera camera;
    rt_vec3 light;
    bool room;                              /* a scan: put into a room, where its light hangs and what it reflects ends */
} peers_original;

static const peers_original peers_originals[] = {
    { "Cornell Box", "papers/cornell_32.obj",      { { 0, 1, 3.6f }, { 0, 1, 0 }, { 0, 1, 0 }, 40 }, { 0, 1.9f, -0.03f }, false },
    { "Sponza",     "papers/sponza.obj",           { { -9, 3, 0.5f }, { 10, 4.5f, -0.5f }, { 0, 1, 0 }, 60 }, { 0, 12, 0 }, false },
    { "Robots",     "papers/bart_robots_t0.obj",
      { { -3.5f, 2, -203 }, { -3.44119f, 2.0987f, -203.993f }, { 0, 1, 0 }, 36.87f }, { -8, 20, -195 }, false },
    { "Kitchen",    "papers/bart_kitchen_t0.obj",
      { { 3.75f, 2.3f, 3.6f }, { 3.4366f, 1.8802f, 2.7483f }, { 0, 1, 0 }, 40 }, { 2, 2, 1 }, false },
    { "Conference", "papers/conference.obj",       { { 1200, 350, -300 }, { 0, 100, 0 }, { 0, 1, 0 }, 60 }, { 300, 500, -200 }, false },
    { "Buddha",     "models/buddha.obj",           { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 }, { 0, 0, 0 }, true },
    { "Dragon",     "models/dragon.obj",           { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 }, { 0, 0, 0 }, true },
};
enum { PEERS_ORIGINALS = sizeof peers_originals / sizeof *peers_originals };

static const char *const peers_procedural[] = { "cornell", "tetra:8", "sphere:100000", "cloud:100000", "terrain:200000", "hall:250000" };

typedef enum { PEERS_LOW, PEERS_MEDIUM, PEERS_HIGH, PEERS_QUALITIES } peers_quality;
static const rt_quality our_qualities[PEERS_QUALITIES] = { RT_BUILD_FAST, RT_BUILD_DEFAULT, RT_BUILD_HIGH };
static const char *const peers_quality_names[PEERS_QUALITIES] = { "low", "medium", "high" };
#ifdef RT_BENCH_EMBREE
static const enum RTCBuildQuality embree_qualities[PEERS_QUALITIES] = {
    RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM, RTC_BUILD_QUALITY_HIGH
};
#endif

/* A way to trace, of the entry at the same place in bench.entries. Ways of one column of a table compete for it. */
typedef struct {
    int column;
    char name[24];
    double trial;                           /* seconds of the sample */
    double seconds, spread;                 /* of all rays; 0: not measured */
} peers_way;

typedef struct {
    bench bench;
    char title[24];
    rt_accel *ours[PEERS_QUALITIES];
#ifdef RT_BENCH_EMBREE
    RTCScene trees[PEERS_QUALITIES][2];     /* fast and robust */
#endif
    peers_way *ways;
    size_t capacity;
} peers_scene;

typedef struct {
    arguments a;                            /* with the defaults of the table at hand */
    pool *threads, *two, *all;              /* as --threads says; of two; one a processor, for builds that are not timed */
    buffers memory;
    rt_ray *sample;
    peers_scene *scenes;
    size_t count;
    double spread;                          /* the largest of the table at hand */
    bool fine;                              /* no hit of ours has differed */
} peers;

static size_t peers_triangles(const peers_scene *s) { return s->bench.content.geometry.triangle_count; }

/* Frees what is built of a scene, and its ways. */
static void peers_clear(peers_scene *s)
{
    int q;

    for (q = 0; q < PEERS_QUALITIES; q++) {
        rt_free(s->ours[q]);
        s->ours[q] = NULL;
#ifdef RT_BENCH_EMBREE
        for (int robust = 0; robust < 2; robust++) {
            if (s->trees[q][robust]) rtcReleaseScene(s->trees[q][robust]);
            s->trees[q][robust] = NULL;
        }
#endif
    }
#ifdef RT_BENCH_EMBREE
    if (s->bench.device) rtcReleaseDevice(s->bench.device);
    s->bench.device = NULL;
#endif
    s->bench.entry_count = 0;
    free(s->ways);
    s->ways = NULL;
    s->capacity = 0;
}

static void peers_free_scene(peers_scene *s)
{
    peers_clear(s);
    bench_free(&s->bench);
}

/* Puts a box around the triangles, on whose floor they stand, so wide that it holds a camera made for them from outside; y is up. Hangs
   the light under its ceiling. What only pictures need is not kept in step. False: out of memory. */
static bool peers_add_room(scene *c)
{
    static const uint32_t sides[36] = { 0, 1, 3, 0, 3, 2, 4, 7, 5, 4, 6, 7, 0, 5, 1, 0, 4, 5, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3 };
    const size_t n = c->geometry.triangle_count, v = c->geometry.vertex_count;
    rt_vec3 lower = vec(INFINITY, INFINITY, INFINITY), upper = vec(-INFINITY, -INFINITY, -INFINITY), middle;
    float *vertices = realloc(c->vertices, 3 * (v + 8) * sizeof *vertices), wide;
    uint32_t *indices;
    size_t i;

    if (!vertices) return complain("out of memory");
    c->geometry.vertices = c->vertices = vertices;
    indices = realloc(c->indices, (3 * n + 36) * sizeof *indices);
    if (!indices) return complain("out of memory");
    c->geometry.indices = c->indices = indices;
    for (i = 0; i < 3 * n; i++) {
        const rt_vec3 p = vertex_at(&c->geometry, indices[i]);
        lower = vec(fminf(lower.x, p.x), fminf(lower.y, p.y), fminf(lower.z, p.z));
        upper = vec(fmaxf(upper.x, p.x), fmaxf(upper.y, p.y), fmaxf(upper.z, p.z));
    }
    middle = vec((lower.x + upper.x) / 2, (lower.y + upper.y) / 2, (lower.z + upper.z) / 2);
    wide = 1.6f * length(sub(upper, lower));
    for (i = 0; i < 8; i++) {
        vertices[3 * (v + i)] = middle.x + (i & 1 ? wide : -wide);
        vertices[3 * (v + i) + 1] = i & 2 ? middle.y + wide : lower.y;
        vertices[3 * (v + i) + 2] = middle.z + (i & 4 ? wide : -wide);
    }
    for (i = 0; i < 36; i++) indices[3 * n + i] = (uint32_t)v + sides[i];
    c->geometry.vertex_count += 8;
    c->geometry.triangle_count += 12;
    c->lights[0].position = vec(middle.x, middle.y + 0.95f * wide, middle.z + 0.3f * wide);
    c->has_lights = true;
    return true;
}

/* Loads a scene; original NULL: as it comes. */
static bool peers_open(peers *p, peers_scene *s, const char *name, const peers_original *original)
{
    scene *content = &s->bench.content;
    const char *slash = strrchr(name, '/');
    scene_error error;

    s->bench.memory = &p->memory;
    if (!scene_load(content, name, NULL, NULL, &error)) return complain("%s", error.message);
    snprintf(s->title, sizeof s->title, "%.17s", original ? original->title : slash ? slash + 1 : name);
    if (original && original->room) {
        if (!peers_add_room(content)) return false;
    } else if (original) {
        content->camera = original->camera;
        scene_default_lights(&original->camera, content->lights);
        content->lights[0].position = original->light;
        content->has_lights = true;
    }
    aim(content, &p->a);
    return true;
}

/* Those of --scene; else the files above; else procedural ones. */
static bool peers_load(peers *p)
{
    const arguments *a = &p->a;
    const bool files = !a->scene_count && a->scene_folder;
    const size_t count = a->scene_count ? a->scene_count : files ? PEERS_ORIGINALS : sizeof peers_procedural / sizeof *peers_procedural;
    char path[4096];
    size_t i;

    if (p->scenes) return true;
    p->scenes = calloc(count, sizeof *p->scenes);
    if (!p->scenes) return complain("out of memory");
    for (i = 0; i < count; i++) {
        p->count++;
        if (files) snprintf(path, sizeof path, "%s/%s", a->scene_folder, peers_originals[i].file);
        else snprintf(path, sizeof path, "%s", a->scene_count ? a->scenes[i] : peers_procedural[i]);
        if (!peers_open(p, &p->scenes[i], path, files ? &peers_originals[i] : NULL)) return false;
    }
    return true;
}

/* ---- >>peers-ways --------------------------------------------------------------------------------------------------- */

/* Room for one more way; NULL: out of memory. */
static peers_way *peers_next_way(peers_scene *s)
{
    const size_t capacity = s->bench.entry_count + 1;
    peers_way *grown = s->capacity < capacity ? realloc(s->ways, 2 * capacity * sizeof *grown) : s->ways;

    if (!grown) return complain("out of memory"), NULL;
    if (s->capacity < capacity) s->capacity = 2 * capacity;
    s->ways = grown;
    return memset(&s->ways[s->bench.entry_count], 0, sizeof *s->ways);
}

/* Takes rays and hits into the cache, where what fills Embree's leaves those. */
static void peers_touch(const entry *e, const batch *b, size_t first, size_t last)
{
    volatile float kept;
    float sum = 0;
    size_t i;

    (void)e;
    for (i = first; i < last; i++) sum += b->rays[i].org.x;
    kept = sum;
    (void)kept;
    memset(b->hits + first, 0, (last - first) * sizeof *b->hits);
}

/* Adds one of our algorithms on the tree of a quality, which is built where it is missing; nothing where the algorithm is not built. */
static bool peers_add_ours(peers *p, peers_scene *s, int column, rt_algorithm algorithm, peers_quality quality)
{
    const rt_algorithm_info *info = rt_algorithm_get((size_t)algorithm);
    arguments a = p->a;
    peers_way *way;
    bool ok;

    if (!info->built) return true;
    way = peers_next_way(s);
    if (!way) return false;
    way->column = column;
    snprintf(way->name, sizeof way->name, "%s", info->name);
    a.quality = (int)our_qualities[quality];
    s->bench.accels[RT_BVH] = s->ours[quality];         /* lent to what add_ours does */
    ok = add_ours(&s->bench, info, RT_BVH, 0, info->culls ? RT_CULL_BOTH : RT_CULL_NONE, &a, p->all);
    s->ours[quality] = s->bench.accels[RT_BVH];
    s->bench.accels[RT_BVH] = NULL;
    if (ok) s->bench.entries[s->bench.entry_count - 1].prepare = peers_touch;
    return ok;
}

/* Those of our algorithms that a user might fix. */
static bool peers_add_fixed(peers *p, peers_scene *s, int column, peers_quality quality, bool large)
{
    return peers_add_ours(p, s, column, RT_BVH_WIDE, quality) && peers_add_ours(p, s, column, RT_BVH_SIMD, quality) &&
           (!large || peers_add_ours(p, s, column, RT_BVH_RANGED, quality));
}

#ifdef RT_BENCH_EMBREE

/* A device with so many threads, and the instructions of --isa. NULL: it does not start. */
static RTCDevice peers_device(const arguments *a, int threads)
{
    char config[64];
    RTCDevice device;

    snprintf(config, sizeof config, "threads=%d%s%s", threads, a->isa > RT_ISA_SCALAR ? ",isa=" : "",
             a->isa > RT_ISA_SCALAR ? isa_names[a->isa] : "");
    device = rtcNewDevice(config);
    if (!device) complain("Embree does not start");
    return device;
}

/* "Embree 3.13.5, packets of up to 16 rays": how wide they are tells its instructions. */
static const char *peers_name(const arguments *a)
{
    static char text[64];
    RTCDevice device = text[0] ? NULL : peers_device(a, 1);

    if (device) {
        snprintf(text, sizeof text, "Embree %d.%d.%d, packets of up to %d rays", (int)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MAJOR),
                 (int)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MINOR),
                 (int)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_PATCH),
                 rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) ? 16
                 : rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8 : 4);
        rtcReleaseDevice(device);
    }
    return text;
}

/* Adds all ways to call Embree on its tree of a quality, which is built where it is missing. */
static bool peers_add_embree(peers *p, peers_scene *s, int column, peers_quality quality, bool robust)
{
    static const struct { const char *name; int packet; bool stream; int needs; } calls[] = {
        { "single",   1,  false, -1 },
        { "packet4",  4,  false, RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED },
        { "packet8",  8,  false, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED },
        { "packet16", 16, false, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED },
        { "stream",   1,  true,  RTC_DEVICE_PROPERTY_RAY_STREAM_SUPPORTED },
    };
    RTCScene *tree = &s->trees[quality][robust];
    size_t i;
    int coherence;

    if (!s->bench.device) s->bench.device = peers_device(&p->a, pool_threads(p->all));
    if (!s->bench.device) return false;
    if (!*tree) *tree = embree_build(s->bench.device, &s->bench.content.geometry, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE,
                                     embree_qualities[quality], NULL);
    if (!*tree) return complain("Embree cannot build %s", s->bench.content.name);
    for (i = 0; i < sizeof calls / sizeof *calls; i++)
        for (coherence = -1; coherence <= 1; coherence += 2) {
            peers_way *way;
            entry *e;
            if (calls[i].needs >= 0 && !rtcGetDeviceProperty(s->bench.device, (enum RTCDeviceProperty)calls[i].needs)) continue;
            way = peers_next_way(s);
            e = way ? add_entry(&s->bench) : NULL;
            if (!e) return complain("out of memory");
            way->column = column;
            snprintf(way->name, sizeof way->name, "%s %c%c", calls[i].name, coherence > 0 ? 'c' : 'i', peers_quality_names[quality][0]);
            e->name = "embree";
            e->structure = "bvh";
            e->packet = calls[i].packet;
            e->stream = calls[i].stream;
            e->coherence = coherence;
            e->prepare = embree_prepare;
            e->trace = embree_trace;
            e->compare = embree_compare;
            e->peer = *tree;
            e->triangle_count = (unsigned)s->bench.content.geometry.triangle_count;
        }
    return true;
}

#else

static const char *peers_name(const arguments *a) { return (void)a, ""; }

static bool peers_add_embree(peers *p, peers_scene *s, int column, peers_quality quality, bool robust)
{
    (void)p, (void)s, (void)column, (void)quality, (void)robust;
    return true;
}

#endif

/* ---- >>peers-measure ------------------------------------------------------------------------------------------------ */

/* A way on the threads of a pool. */
typedef struct {
    size_t way;
    pool *threads;                          /* NULL: on one, in processor time */
    double seconds, spread;
} peers_run;

typedef struct {
    const entry *e;
    const batch *b;
    size_t first, last;
} peers_work;

static void peers_chunk(void *context, size_t index)
{
    const peers_work *w = context;
    const size_t first = w->first + index * CHUNK;
    w->e->trace(w->e, w->b, first, w->last - first < CHUNK ? w->last : first + CHUNK);
}

/* Seconds, by the clock that measures work on these threads; NULL: of processor time, of all threads of this program together. */
static double peers_clock(const pool *threads)
{
    return seconds_of(threads ? CLOCK_MONOTONIC : CLOCK_PROCESS_CPUTIME_ID);
}

/* Counts, which takes some 10 ms. */
static void peers_spin(void *context, size_t index)
{
    volatile unsigned n;
    (void)context, (void)index;
    for (n = 0; n < 10000000; n++) { }
}

/* How many processors two threads have that only count: less than two where other programs run, and numbers on two threads tell little. */
static double peers_processors(const peers *p)
{
    const double start = peers_clock(p->two), worked = peers_clock(NULL);
    pool_for(p->two, 8, peers_spin, NULL);
    return (peers_clock(NULL) - worked) / (peers_clock(p->two) - start);
}

static void peers_print_processors(const peers *p, double sum)
{
    if (p->count) printf("  two threads had %.2f processors on average, asked before each scene\n", sum / (double)p->count);
}

/* Seconds of rays [first, last); threads NULL: of processor time, on this one. */
static double peers_time(const entry *e, const batch *b, size_t first, size_t last, pool *threads)
{
    peers_work w = { e, b, first, last };
    double start;

    if (e->prepare) e->prepare(e, b, first, last);
    start = peers_clock(threads);
    if (threads) pool_for(threads, (last - first + CHUNK - 1) / CHUNK, peers_chunk, &w);
    else e->trace(e, b, first, last);
    return peers_clock(threads) - start;
}

/* Measures all runs in turns, which change after each slice of rays, so that whatever else the machine does falls on all alike. The
   seconds of a run are the sum of its slices' medians. */
static bool peers_measure(const bench *s, peers_run *runs, size_t count, const batch *b, size_t slice, int rounds)
{
    const size_t slices = (b->count + slice - 1) / slice, n = (size_t)rounds;
    double *times = calloc(count * slices * n, sizeof *times), *whole = calloc(n, sizeof *whole);
    const bool ok = (times && whole) || complain("out of memory");
    size_t i, k, round;

    for (round = 0; round < n && ok; round++)
        for (k = 0; k < slices; k++)
            for (i = 0; i < count; i++)
                times[(i * slices + k) * n + round] = peers_time(&s->entries[runs[i].way], b, k * slice,
                                                                 k + 1 < slices ? (k + 1) * slice : b->count, runs[i].threads);
    for (i = 0; i < count && ok; i++) {
        memset(whole, 0, n * sizeof *whole);
        runs[i].seconds = 0;
        for (k = 0; k < slices; k++) {
            double *slice_times = &times[(i * slices + k) * n];
            for (round = 0; round < n; round++) whole[round] += slice_times[round];
            runs[i].seconds += median(slice_times, rounds);
        }
        runs[i].spread = 1 / median(whole, rounds);      /* which sorts */
        runs[i].spread *= whole[n - 1] - whole[0];
    }
    free(times), free(whole);
    return ok;
}

/* Times every way on a sample of the rays. */
static void peers_try(const peers *p, peers_scene *s, const batch *b)
{
    batch sample = *b;
    size_t i, first;
    int round;

    sample.rays = p->sample;
    sample.count = 0;
    for (first = 0; first < b->count; first += (size_t)PEERS_TRIAL_BLOCK * PEERS_TRIAL_STEP) {
        const size_t count = b->count - first < PEERS_TRIAL_BLOCK ? b->count - first : PEERS_TRIAL_BLOCK;
        memcpy(p->sample + sample.count, b->rays + first, count * sizeof *b->rays);
        sample.count += count;
    }
    for (i = 0; i < s->bench.entry_count; i++) s->ways[i].trial = (double)INFINITY;
    for (round = 0; round < PEERS_TRIALS; round++)
        for (i = 0; i < s->bench.entry_count; i++)
            s->ways[i].trial = fmin(s->ways[i].trial, peers_time(&s->bench.entries[i], &sample, 0, sample.count, NULL));
}

/* Is way among the fastest of its column, or hardly slower, on the sample? */
static bool peers_promising(const peers_scene *s, size_t way)
{
    const double trial = s->ways[way].trial;
    double best = trial;
    size_t i, better = 0;

    for (i = 0; i < s->bench.entry_count; i++) {
        if (s->ways[i].column != s->ways[way].column || s->ways[i].trial >= trial) continue;
        best = fmin(best, s->ways[i].trial);
        better++;
    }
    return better < PEERS_KEPT && trial <= PEERS_NEAR * best;
}

/* Finds what the rays hit, and a run for each way that is to be measured on all of them, with hits checked. runs has room for all ways. */
static size_t peers_select(peers *p, peers_scene *s, const batch *b, peers_run *runs)
{
    rt_trace_options options;
    size_t i, count = 0;

    memset(&options, 0, sizeof options);
    options.query = b->query;
    rt_trace(s->ours[PEERS_MEDIUM], &options, b->rays, b->count, p->memory.truth);
    for (i = 0; i < s->bench.entry_count; i++) s->bench.entries[i].options.query = b->query;
    peers_try(p, s, b);
    for (i = 0; i < s->bench.entry_count; i++) {
        entry *e = &s->bench.entries[i];
        s->ways[i].seconds = 0;
        if (!peers_promising(s, i)) continue;
        memset(&runs[count], 0, sizeof *runs);
        runs[count++].way = i;
        if (e->prepare) e->prepare(e, b, 0, b->count);
        e->trace(e, b, 0, b->count);
        e->compare(e, b);
        if (e->accel && e->other_hits)
            p->fine = complain("%s: %s finds %zu of %zu %s hits that differ", s->title, e->name, e->other_hits, b->count, b->label);
    }
    return count;
}

/* Measures the ways of all columns on b. */
static bool peers_compare(peers *p, peers_scene *s, const batch *b)
{
    peers_run *runs = calloc(s->bench.entry_count + 1, sizeof *runs);
    size_t i, count;
    bool ok;

    if (!runs) return complain("out of memory");
    count = peers_select(p, s, b, runs);
    for (i = 0; i < count; i++) runs[i].threads = pool_threads(p->threads) > 1 ? p->threads : NULL;
    ok = peers_measure(&s->bench, runs, count, b, pool_threads(p->threads) > 1 ? b->count : PEERS_SLICE, p->a.rounds);
    for (i = 0; i < count && ok; i++) {
        s->ways[runs[i].way].seconds = runs[i].seconds;
        p->spread = fmax(p->spread, runs[i].spread);
    }
    free(runs);
    return ok;
}

/* The fastest way of a column; RT_NONE: it has none. */
static size_t peers_best(const peers_scene *s, int column)
{
    size_t i, best = RT_NONE;
    for (i = 0; i < s->bench.entry_count; i++)
        if (s->ways[i].column == column && s->ways[i].seconds > 0 && (best == RT_NONE || s->ways[i].seconds < s->ways[best].seconds)) best = i;
    return best;
}

/* Mrays/s of a column; 0: it has none. */
static double peers_rate(const peers_scene *s, int column, const batch *b)
{
    const size_t way = peers_best(s, column);
    return way == RT_NONE ? 0 : (double)b->count / s->ways[way].seconds * 1e-6;
}

/* What a column of ratios comes to. */
typedef struct {
    double log_sum, least;
    size_t count;
    const char *where;                      /* the least is */
} peers_mean;

/* The ratio of two rates, which goes into its mean; 0: one of them is missing. */
static double peers_ratio(double ours, double theirs, const char *title, peers_mean *mean)
{
    const double ratio = theirs > 0 ? ours / theirs : 0;

    if (!(ratio > 0)) return 0;
    mean->log_sum += log(ratio);
    if (mean->count++ && ratio >= mean->least) return ratio;
    mean->least = ratio;
    mean->where = title;
    return ratio;
}

static void peers_print_mean(const char *label, const peers_mean *mean)
{
    if (!mean->count) return;
    printf("  %-40s geometric mean %.2f, least %.2f (%s)\n", label, exp(mean->log_sum / (double)mean->count), mean->least, mean->where);
}

/* The opening of a table: of rays on so many threads; 0: its columns tell; less than 0: of no rays. embree: what its numbers are. */
static void peers_print_title(peers *p, const char *table, const char *title, int threads, const char *embree)
{
    const char *name = peers_name(&p->a);

    printf("\n%s: %s\n  ", table, title);
    if (threads >= 0) printf("%dx%d, ", p->a.width, p->a.height);
    if (threads > 0) printf("%d thread%s, ", threads, threads == 1 ? "" : "s");
    printf("median of %d; ", p->a.rounds);
    if (*name) printf("%s: %s\n", name, embree);
    else printf("Embree is not linked, for want of libembree-dev: ours alone\n");
    p->spread = 0;
}

static void peers_print_way(int width, const peers_scene *s, int column)
{
    const size_t way = peers_best(s, column);
    printf(" %-*s", width - 1, way == RT_NONE ? "-" : s->ways[way].name);
}

/* ---- >>peers-rays --------------------------------------------------------------------------------------------------- */

enum { RAYS_AUTO, RAYS_FIXED, RAYS_FAST, RAYS_ROBUST };

static void peers_print_differing(const peers_scene *s, int column)
{
    const size_t way = peers_best(s, column);
    const entry *e = way == RT_NONE ? NULL : &s->bench.entries[way];
    char text[32] = "-";

    if (e) snprintf(text, sizeof text, "%zu + %zu", e->other_hits, e->other_prims);
    printf(" %12s", text);
}

static bool peers_rays_of(peers *p, peers_scene *s, peers_mean means[KIND_COUNT][2])
{
    bool ok = peers_add_ours(p, s, RAYS_AUTO, RT_AUTO, PEERS_MEDIUM) && peers_add_fixed(p, s, RAYS_FIXED, PEERS_MEDIUM, true);
    int kind, robust;

    for (robust = 0; robust < 2 && ok; robust++)
        ok = peers_add_embree(p, s, RAYS_FAST + robust, PEERS_MEDIUM, robust) && peers_add_embree(p, s, RAYS_FAST + robust, PEERS_HIGH, robust);
    if (!ok) return false;
    trace_primary(&s->bench, s->ours[PEERS_MEDIUM], &p->a);
    for (kind = 0; kind < KIND_COUNT; kind++) {
        const batch b = make_batch(&s->bench, (ray_kind)kind, &p->a);
        double ours;

        if (!listed(p->a.rays, kind_names[kind]) || b.count == 0) continue;
        if (!peers_compare(p, s, &b)) return false;
        ours = peers_rate(s, RAYS_AUTO, &b);
        printf("%-18s %-8s %6.3f", s->title, kind_names[kind], (double)b.count * 1e-6);
        horn_print_cell(9, 2, ours);
        horn_print_cell(9, 2, peers_rate(s, RAYS_FIXED, &b));
        peers_print_way(13, s, RAYS_FIXED);
        horn_print_cell(9, 2, peers_rate(s, RAYS_FAST, &b));
        peers_print_way(13, s, RAYS_FAST);
        horn_print_cell(9, 2, peers_rate(s, RAYS_ROBUST, &b));
        peers_print_way(13, s, RAYS_ROBUST);
        for (robust = 0; robust < 2; robust++)
            horn_print_cell(8 + robust, 2, peers_ratio(ours, peers_rate(s, RAYS_FAST + robust, &b), s->title, &means[kind][robust]));
        peers_print_differing(s, RAYS_FAST);
        peers_print_differing(s, RAYS_ROBUST);
        printf("\n");
        fflush(stdout);
    }
    return true;
}

static bool peers_rays(peers *p)
{
    peers_mean means[KIND_COUNT][2] = { { { 0, 0, 0, NULL } } };
    char label[64];
    size_t i;
    int kind, robust;

    peers_print_title(p, "peers.rays", "Mrays/s of our default, auto on an RT_BVH, and of the best of ours and of Embree's", pool_threads(p->threads),
                      "or streams of rays,\n  said to be c coherent or i incoherent; tree of m medium or h high quality");
    printf("  differ: rays whose hit, or only whose primitive, is not the one that we find\n");
    printf("%-18s %-8s %6s%9s%9s %-12s%9s %-12s%9s %-12s%8s%9s %12s %12s\n", "", "", "Mrays", "auto", "fixed", "the best", "fast", "Embree's",
           "robust", "Embree's", "/ fast", "/ robust", "differ: fast", "robust");
    for (i = 0; i < p->count; i++) {
        if (!peers_rays_of(p, &p->scenes[i], means)) return false;
        peers_clear(&p->scenes[i]);
    }
    for (kind = 0; kind < KIND_COUNT; kind++)
        for (robust = 0; robust < 2; robust++) {
            snprintf(label, sizeof label, "%s, ours / Embree %s:", kind_names[kind], robust ? "robust" : "fast");
            peers_print_mean(label, &means[kind][robust]);
        }
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * p->spread);
    return true;
}

/* ---- >>peers-build -------------------------------------------------------------------------------------------------- */

enum { BUILD_OURS, BUILD_EMBREE, BUILD_SIDES };

typedef struct {
    double seconds[BUILD_SIDES][PEERS_QUALITIES][2][MAX_ROUNDS];        /* on one thread and on two */
    size_t bytes[BUILD_SIDES][PEERS_QUALITIES], lean;       /* lean: of the default with no_binary */
} peers_builds;

/* Seconds; threads NULL: of processor time, on this one. Less than 0: it fails. */
static double peers_build_ours(const peers *p, const peers_scene *s, peers_quality quality, bool lean, pool *threads, size_t *bytes)
{
    rt_error error;
    rt_build_options options = build_options(RT_BVH, &p->a, threads, &error);
    rt_accel *accel;
    rt_info info;
    double start, seconds;

    options.quality = our_qualities[quality];
    options.no_binary = lean;
    start = peers_clock(threads);
    if (rt_build(&accel, &s->bench.content.geometry, &options) != RT_OK) return complain("%s: %s", s->title, error.message), -1;
    seconds = peers_clock(threads) - start;
    rt_get_info(accel, &info);
    rt_free(accel);
    *bytes = info.bytes;
    return seconds;
}

#ifdef RT_BENCH_EMBREE
/* The same with a device of its own, since all devices together have as many threads as the one with the fewest. The bytes are without the
   copies of vertices and indices. */
static double peers_build_embree(const peers *p, const peers_scene *s, peers_quality quality, const pool *threads, size_t *bytes)
{
    const rt_geometry *g = &s->bench.content.geometry;
    const size_t input = g->vertex_count * sizeof(rt_vec3) + 3 * g->triangle_count * sizeof(uint32_t);
    RTCDevice device = peers_device(&p->a, threads ? pool_threads(threads) : 1);
    embree_times times;
    RTCScene built;

    if (!device) return -1;
    *bytes = 0;
    rtcSetDeviceMemoryMonitorFunction(device, embree_count_bytes, bytes);
    built = embree_build(device, g, RTC_SCENE_FLAG_NONE, embree_qualities[quality], &times);
    *bytes -= *bytes < input ? *bytes : input;
    rtcSetDeviceMemoryMonitorFunction(device, NULL, NULL);
    if (built) rtcReleaseScene(built);
    else complain("Embree cannot build %s", s->bench.content.name);
    rtcReleaseDevice(device);
    return !built ? -1 : threads ? times.wall : times.processor;
}
#else
static double peers_build_embree(const peers *p, const peers_scene *s, peers_quality quality, const pool *threads, size_t *bytes)
{
    (void)p, (void)s, (void)quality, (void)threads, (void)bytes;
    return 0;
}
#endif

static bool peers_build_scene(const peers *p, const peers_scene *s, peers_builds *out)
{
    pool *const pools[2] = { NULL, p->two };
    int round, quality, threads;

    for (round = -1; round < p->a.rounds; round++)
        for (quality = 0; quality < PEERS_QUALITIES; quality++)
            for (threads = 0; threads < 2; threads++) {
                const double ours = peers_build_ours(p, s, (peers_quality)quality, false, pools[threads], &out->bytes[BUILD_OURS][quality]);
                const double theirs = peers_build_embree(p, s, (peers_quality)quality, pools[threads], &out->bytes[BUILD_EMBREE][quality]);
                if (ours < 0 || theirs < 0) return false;
                if (round < 0) continue;
                out->seconds[BUILD_OURS][quality][threads][round] = ours;
                out->seconds[BUILD_EMBREE][quality][threads][round] = theirs;
            }
    return peers_build_ours(p, s, PEERS_MEDIUM, true, p->two, &out->lean) >= 0;
}

static bool peers_build(peers *p)
{
    static const char *const ours_names[PEERS_QUALITIES] = { "fast", "default", "high" };
    peers_mean means[PEERS_QUALITIES][2] = { { { 0, 0, 0, NULL } } };
    char label[64];
    static peers_builds builds;
    double processors = 0;
    size_t i;
    int side, quality, threads;

    peers_print_title(p, "peers.build", "million triangles built a second, on one thread and on two; bytes a triangle", -1,
                      "rtcCommitScene alone, its bytes without its copy of the input");
    printf("%28s%15s%15s%15s%15s%15s%15s%36s%26s\n", "", "ours: fast   ", "default   ", "high   ", "Embree: low   ", "medium   ", "high   ",
           "ours, bytes: fast to high, no_binary", "Embree: low to high");
    printf("%-18s%10s", "", "triangles");
    for (i = 0; i < BUILD_SIDES * PEERS_QUALITIES; i++) printf("%7d%7d ", 1, 2);
    printf("\n");
    for (i = 0; i < p->count; i++) {
        const peers_scene *s = &p->scenes[i];
        const double n = (double)peers_triangles(s);
        double rates[BUILD_SIDES][PEERS_QUALITIES][2];

        processors += peers_processors(p);
        if (n < PEERS_TINY) continue;
        if (!peers_build_scene(p, s, &builds)) return false;
        printf("%-18s %9.0f", s->title, n);
        for (side = 0; side < BUILD_SIDES; side++)
            for (quality = 0; quality < PEERS_QUALITIES; quality++, printf(" "))
                for (threads = 0; threads < 2; threads++) {
                    const double seconds = median(builds.seconds[side][quality][threads], p->a.rounds);
                    rates[side][quality][threads] = seconds > 0 ? n / seconds * 1e-6 : 0;
                    horn_print_cell(7, 2, rates[side][quality][threads]);
                }
        for (side = 0; side < BUILD_SIDES; side++, printf("  ")) {
            for (quality = 0; quality < PEERS_QUALITIES; quality++) horn_print_cell(8, 1, (double)builds.bytes[side][quality] / n);
            if (side == BUILD_OURS) horn_print_cell(12, 1, (double)builds.lean / n);
        }
        printf("\n");
        fflush(stdout);
        for (quality = 0; quality < PEERS_QUALITIES; quality++)
            for (threads = 0; threads < 2; threads++)
                peers_ratio(rates[BUILD_OURS][quality][threads], rates[BUILD_EMBREE][quality][threads], s->title, &means[quality][threads]);
    }
    for (quality = 0; quality < PEERS_QUALITIES; quality++)
        for (threads = 0; threads < 2; threads++) {
            snprintf(label, sizeof label, "ours, %s / Embree, %s, %d thread%s:", ours_names[quality], peers_quality_names[quality],
                     threads + 1, threads ? "s" : "");
            peers_print_mean(label, &means[quality][threads]);
        }
    peers_print_processors(p, processors);
    return true;
}

/* ---- >>peers-quality ------------------------------------------------------------------------------------------------ */

/* Columns: auto and the best fixed algorithm by quality, then Embree by quality. */
enum { QUALITY_AUTO, QUALITY_FIXED, QUALITY_EMBREE = 2 * PEERS_QUALITIES, QUALITY_COLUMNS = 3 * PEERS_QUALITIES };

static bool peers_quality_of(peers *p, peers_scene *s)
{
    static const ray_kind kinds[] = { PRIMARY, DIFFUSE };
    bool ok = true;
    int q, column;
    size_t k;

    for (q = 0; q < PEERS_QUALITIES && ok; q++)
        ok = peers_add_ours(p, s, 2 * q + QUALITY_AUTO, RT_AUTO, (peers_quality)q) &&
             peers_add_fixed(p, s, 2 * q + QUALITY_FIXED, (peers_quality)q, false) &&
             (q == PEERS_LOW || peers_add_embree(p, s, QUALITY_EMBREE + q, (peers_quality)q, false));
    if (!ok) return false;
    trace_primary(&s->bench, s->ours[PEERS_MEDIUM], &p->a);
    for (k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const batch b = make_batch(&s->bench, kinds[k], &p->a);
        if (b.count == 0) continue;
        if (!peers_compare(p, s, &b)) return false;
        printf("%-18s %-8s", s->title, b.label);
        for (column = 0; column < QUALITY_COLUMNS; column++)
            if (column != QUALITY_EMBREE + PEERS_LOW) {
                horn_print_cell(9, 2, peers_rate(s, column, &b));
                if (column >= QUALITY_EMBREE) peers_print_way(13, s, column);
            }
        printf("\n");
        fflush(stdout);
    }
    return true;
}

static bool peers_qualities(peers *p)
{
    size_t i;

    peers_print_title(p, "peers.quality", "Mrays/s by the quality of the tree; fixed: the better of bvh.wide, where it is built, and bvh.simd",
                      pool_threads(p->threads), "the best of its fast ways");
    printf("%27s%18s%18s%18s%9s%13s%9s\n", "", "ours: fast", "default", "high", "Embree:", "medium    ", "high");
    printf("%27s%9s%9s%9s%9s%9s%9s\n", "", "auto", "fixed", "auto", "fixed", "auto", "fixed");
    for (i = 0; i < p->count; i++) {
        if (!peers_quality_of(p, &p->scenes[i])) return false;
        peers_clear(&p->scenes[i]);
    }
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * p->spread);
    return true;
}

/* ---- >>peers-scale -------------------------------------------------------------------------------------------------- */

enum { SCALE_AUTO, SCALE_EMBREE };

/* What building takes: bytes of the tree, and those at the worst moment. */
static bool peers_weigh(const peers *p, const peers_scene *s, size_t *tree, size_t *peak)
{
    memory_count count = { 0, 0 };
    rt_error error;
    rt_build_options options = build_options(RT_BVH, &p->a, NULL, &error);
    rt_info info;

    options.memory_user = &count;
    if (horn_time_build(&s->bench.content, &options, &info) < 0) return false;
    *tree = info.bytes;
    *peak = count.peak;
    return count.bytes == 0 || complain("%s: %zu bytes are not given back", s->bench.content.name, count.bytes);
}

static bool peers_scale_of(peers *p, peers_scene *s)
{
    static const ray_kind kinds[] = { PRIMARY, DIFFUSE };
    const rt_geometry *g = &s->bench.content.geometry;
    const double n = (double)g->triangle_count, input = (double)(g->vertex_count * sizeof(rt_vec3) + 3 * g->triangle_count * sizeof(uint32_t));
    size_t tree, peak, k;

    if (!peers_weigh(p, s, &tree, &peak) || !peers_add_ours(p, s, SCALE_AUTO, RT_AUTO, PEERS_MEDIUM)) return false;
    if (!peers_add_embree(p, s, SCALE_EMBREE, PEERS_MEDIUM, false)) return false;
    printf("%-18s", s->title);
    horn_print_cell(11, 2, (double)tree * 1e-6);
    horn_print_cell(9, 1, (double)tree / n);
    horn_print_cell(11, 2, (double)peak * 1e-6);
    horn_print_cell(8, 2, (double)peak / ((double)tree + input));
    trace_primary(&s->bench, s->ours[PEERS_MEDIUM], &p->a);
    for (k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const batch b = make_batch(&s->bench, kinds[k], &p->a);
        double ours, theirs;
        if (b.count == 0 || !peers_compare(p, s, &b)) return b.count == 0;
        ours = peers_rate(s, SCALE_AUTO, &b);
        theirs = peers_rate(s, SCALE_EMBREE, &b);
        horn_print_cell(10, 2, ours);
        horn_print_cell(9, 2, theirs);
        peers_print_way(13, s, SCALE_EMBREE);
        horn_print_cell(7, 2, theirs > 0 ? ours / theirs : 0);
    }
    printf("\n");
    fflush(stdout);
    return true;
}

static bool peers_scale(peers *p)
{
    static const char *const scenes[] = { "terrain", "cloud" };
    static const int counts[] = { 1000, 10000, 100000, 1000000, 4000000, 10000000 };
    bool ok = true;
    size_t i, k;

    peers_print_title(p, "peers.scale", "memory and Mrays/s of our default against the number of triangles", pool_threads(p->threads),
                      "the best of its fast ways on a tree of medium quality");
    printf("  peak: all that is allocated at the worst moment of a build on one thread, and that beside tree and input together\n");
    printf("%-18s%11s%9s%11s%8s%10s%9s%-13s%7s%10s%9s%-13s%7s\n", "", "tree MB", "bytes/n", "peak MB", "x", "primary", "Embree", "", "x",
           "diffuse", "Embree", "", "x");
    for (i = 0; i < sizeof scenes / sizeof *scenes; i++)
        for (k = 0; k < sizeof counts / sizeof *counts && counts[k] <= p->a.most_triangles && ok; k++) {
            char name[64];
            peers_scene s;
            memset(&s, 0, sizeof s);
            snprintf(name, sizeof name, "%s:%d", scenes[i], counts[k]);
            ok = peers_open(p, &s, name, NULL) && peers_scale_of(p, &s);
            peers_free_scene(&s);
        }
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * p->spread);
    return ok;
}

/* ---- >>peers-threads ------------------------------------------------------------------------------------------------ */

static bool peers_threads_of(peers *p, peers_scene *s, ray_kind kind)
{
    const batch b = make_batch(&s->bench, kind, &p->a);
    peers_run *tried, runs[4];
    double rates[4] = { 0, 0, 0, 0 };
    size_t i, count, n = 0;
    int side;

    if (b.count == 0) return true;
    tried = calloc(s->bench.entry_count + 1, sizeof *tried);
    if (!tried) return complain("out of memory");
    count = peers_select(p, s, &b, tried);
    for (side = SCALE_AUTO; side <= SCALE_EMBREE; side++) {
        size_t best = RT_NONE;
        for (i = 0; i < count; i++)
            if (s->ways[tried[i].way].column == side && (best == RT_NONE || s->ways[tried[i].way].trial < s->ways[best].trial))
                best = tried[i].way;
        for (i = 0; i < 2 && best != RT_NONE; i++, n++) {
            runs[n].way = best;
            runs[n].threads = i ? p->two : NULL;
        }
    }
    free(tried);
    if (!peers_measure(&s->bench, runs, n, &b, b.count, p->a.rounds)) return false;
    printf("%-18s %-8s", s->title, b.label);
    for (i = 0; i < n; i++) {
        rates[i] = (double)b.count / runs[i].seconds * 1e-6;
        p->spread = fmax(p->spread, runs[i].spread);
    }
    for (i = 0; i < 4; i += 2) {
        horn_print_cell(10, 2, rates[i]);
        horn_print_cell(9, 2, rates[i + 1]);
        horn_print_cell(8, 2, rates[i] > 0 ? rates[i + 1] / rates[i] : 0);
    }
    horn_print_cell(14, 2, rates[3] > 0 ? rates[1] / rates[3] : 0);
    printf("\n");
    fflush(stdout);
    return true;
}

static bool peers_threads(peers *p)
{
    static const ray_kind kinds[] = { PRIMARY, DIFFUSE };
    double processors = 0;
    size_t i, k;

    peers_print_title(p, "peers.threads", "Mrays/s of our default, and of Embree's best fast way, on one thread and on two", 0,
                      "on a tree of medium or high quality");
    printf("%-27s%10s%9s%8s%10s%9s%8s%14s\n", "", "ours: 1", "2", "x", "Embree: 1", "2", "x", "ours / Embree");
    for (i = 0; i < p->count; i++) {
        peers_scene *s = &p->scenes[i];
        processors += peers_processors(p);
        if (!peers_add_ours(p, s, SCALE_AUTO, RT_AUTO, PEERS_MEDIUM)) return false;
        if (!peers_add_embree(p, s, SCALE_EMBREE, PEERS_MEDIUM, false) || !peers_add_embree(p, s, SCALE_EMBREE, PEERS_HIGH, false)) return false;
        trace_primary(&s->bench, s->ours[PEERS_MEDIUM], &p->a);
        for (k = 0; k < sizeof kinds / sizeof *kinds; k++)
            if (!peers_threads_of(p, s, kinds[k])) return false;
        peers_clear(s);
    }
    peers_print_processors(p, processors);
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * p->spread);
    return true;
}

/* ---- >>peers-main --------------------------------------------------------------------------------------------------- */

/* Those of the tables that are asked for. */
static bool peers_tables(const arguments *given, pool *threads)
{
    static const struct { bool (*print)(peers *); int size, rounds; } tables[PEERS_TABLE_COUNT] = {
        [PEERS_RAYS]    = { peers_rays,      PEERS_SIZE,  PEERS_ROUNDS }, [PEERS_BUILD]   = { peers_build, PEERS_SIZE,  PEERS_FEW_ROUNDS },
        [PEERS_QUALITY] = { peers_qualities, PEERS_SMALL, PEERS_ROUNDS }, [PEERS_SCALE]   = { peers_scale, PEERS_SMALL, PEERS_FEW_ROUNDS },
        [PEERS_THREADS] = { peers_threads,   PEERS_SIZE,  PEERS_FEW_ROUNDS }
    };
    static const char *const words[PEERS_TABLE_COUNT] = { PEERS_TABLES(TABLE_WORD) };
    const arguments most = with_defaults(given, PEERS_SIZE, PEERS_ROUNDS);
    const size_t pixels = (size_t)most.width * (size_t)most.height;
    peers p;
    bool ok = true, any = false;
    size_t i;

    for (i = 0; i < PEERS_TABLE_COUNT; i++) any = any || wants(given, "peers", words[i]);
    if (!any || given->json) return true;
    memset(&p, 0, sizeof p);
    p.a = most;
    p.threads = threads;
    p.two = pool_create(2);
    p.all = pool_create(0);
    p.sample = calloc(pixels, sizeof *p.sample);
    p.fine = true;
    ok = (p.two && p.all && p.sample) || complain("out of memory");
    ok = ok && buffers_alloc(&p.memory, pixels, true) && peers_load(&p);
    for (i = 0; i < PEERS_TABLE_COUNT && ok; i++) {
        if (!wants(given, "peers", words[i])) continue;
        p.a = with_defaults(given, tables[i].size, tables[i].rounds);
        ok = tables[i].print(&p);
        fflush(stdout);
    }
    for (i = 0; i < p.count; i++) peers_free_scene(&p.scenes[i]);
    free(p.scenes), free(p.sample);
    buffers_free(&p.memory);
    pool_destroy(p.two), pool_destroy(p.all);
    return ok && p.fine;
}
