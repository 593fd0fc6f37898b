/* bench_lohr.h - the tables of [Lohr] (Lohr: GPU-Based Parallel Stackless BVH Traversal for Animated Distributed Ray Tracing, 2009) on our machine, and
   answers to its future work. Part of bench.c.    SPDX-License-Identifier: MIT OR Unlicense

   >>lohr-ways  >>lohr-rays  >>lohr-frames  >>lohr-trees  >>lohr-scaling  >>lohr-update  >>lohr-main

   The paper's numbers are those of graphics cards of 2008: compare ratios, not rates. Its 882-polygon character is not to be had; ours, of as many
   triangles, stands in for it: examples/imp.obj, found from the folder that bench is started in. */

#define LOHR_ROUNDS 3
#define LOHR_SECONDS 0.04                   /* the least work that one measurement times */
#define LOHR_CHARACTER "examples/imp.obj"

/* ---- >>lohr-ways ---------------------------------------------------------------------------------------------------- */

typedef struct { const char *title; rt_algorithm algorithm; int packet; } lohr_way;
static const lohr_way lohr_ways[] = {
    { "single", RT_THREADED_SINGLE, 1 },     { "parallel 2", RT_THREADED_PARALLEL, 2 },   { "parallel 4", RT_THREADED_PARALLEL, 4 },
    { "parallel 8", RT_THREADED_PARALLEL, 8 }, { "parallel 16", RT_THREADED_PARALLEL, 16 }, { "bvh.stack", RT_BVH_STACK, 1 },
};
enum { LOHR_SINGLE, LOHR_2, LOHR_4, LOHR_8, LOHR_16, LOHR_BVH, LOHR_WAYS };

typedef struct {
    arguments a;
    pool *threads;
    buffers memory;
    double spread;                          /* the largest of the table at hand */
    bool fine;
} lohr;

static bool lohr_open(lohr *h, bench *s, const char *name)
{
    scene_error error;

    memset(s, 0, sizeof *s);
    s->memory = &h->memory;
    if (!scene_load(&s->content, name, NULL, NULL, &error)) return complain("%s", error.message);
    aim(&s->content, &h->a);
    return build(s, RT_BVH, &h->a, h->threads) && build(s, RT_THREADED, &h->a, h->threads);
}

static size_t lohr_primitives(const bench *s) { return s->content.geometry.triangle_count + s->content.geometry.sphere_count; }

static bool lohr_add(bench *s, const rt_accel *accel, const lohr_way *way)
{
    entry *e = add_entry(s);
    rt_info info;

    if (!e) return complain("out of memory");
    rt_get_info(accel, &info);
    e->name = rt_algorithm_get((size_t)way->algorithm)->name;
    e->structure = structure_names[info.structure];
    e->options.algorithm = way->algorithm;
    e->packet = e->options.packet_width = way->packet;
    e->bytes = info.bytes;
    e->accel = accel;
    e->trace = our_trace;
    e->compare = our_compare;
    return true;
}

/* Entry i of s becomes way i. */
static bool lohr_add_ways(bench *s)
{
    size_t i;

    s->entry_count = 0;
    for (i = 0; i < LOHR_WAYS; i++)
        if (!lohr_add(s, s->accels[i == LOHR_BVH ? RT_BVH : RT_THREADED], &lohr_ways[i])) return false;
    return true;
}

/* Measures the entries of s on rays. */
static bool lohr_measure(lohr *h, bench *s, const rt_ray *rays, size_t count, rt_query query, const char *table, const char *label)
{
    batch b;
    size_t i;

    b.kind = query == RT_ANY ? SHADOW : PRIMARY;
    b.label = label;
    b.seconds = LOHR_SECONDS;
    b.query = query;
    b.rays = rays;
    b.count = count;
    b.truth = h->memory.truth;
    b.hits = h->memory.hits;
    b.packets = NULL;
    if (!measure_batch(s, &b, s->accels[RT_BVH], h->threads, h->a.rounds, &h->fine)) return false;
    for (i = 0; i < s->entry_count; i++) {
        h->spread = fmax(h->spread, s->entries[i].spread);
        if (h->a.json) print_json(table, &s->entries[i], &b, s->content.name, lohr_primitives(s), pool_threads(h->threads));
    }
    return true;
}

static double lohr_rate(const entry *e, size_t count) { return (double)count / e->median * 1e-6; }

static void lohr_title(const lohr *h, const char *table, const char *title)
{
    if (h->a.json) return;
    printf("\n%s: %s\n  %d thread%s, median of %d\n", table, title, pool_threads(h->threads), pool_threads(h->threads) == 1 ? "" : "s",
           h->a.rounds);
}

static void lohr_print_spread(const lohr *h)
{
    if (!h->a.json) printf("  largest spread of a number: %.0f%%\n", 100 * h->spread);
}

/* ---- >>lohr-rays ---------------------------------------------------------------------------------------------------- */

static void lohr_shuffle(rt_ray *rays, size_t count)
{
    size_t i;

    for (i = count; i > 1; i--) {
        const size_t other = (size_t)(hashed((uint32_t)i) * (float)i) % i;
        const rt_ray ray = rays[i - 1];

        rays[i - 1] = rays[other];
        rays[other] = ray;
    }
}

/* Figure 2: neighbours alike, and none alike. */
static bool lohr_neighbours(lohr *h)
{
    static const int sizes[] = { 256, 512 };
    bench s;
    bool ok = lohr_open(h, &s, LOHR_CHARACTER);
    size_t k, i;

    lohr_title(h, "lohr.2", "Figure 2: frames a second of eye rays at the 882 triangles of the imp; incoherent: neighbours in random order");
    if (!h->a.json) {
        printf("  %-24s", "");
        for (i = 0; i < LOHR_WAYS; i++) printf(" %12s", lohr_ways[i].title);
        printf("\n");
    }
    for (k = 0; k < 4 && ok; k++) {
        const int side = sizes[k / 2];
        const size_t count = (size_t)side * (size_t)side;
        char label[40];

        snprintf(label, sizeof label, "%dx%d %s", side, side, k % 2 ? "incoherent" : "coherent");
        make_primary(&s.content.camera, side, side, h->memory.rays);
        if (k % 2) lohr_shuffle(h->memory.rays, count);
        ok = lohr_add_ways(&s) && lohr_measure(h, &s, h->memory.rays, count, RT_CLOSEST, "lohr.2", label);
        if (!ok || h->a.json) continue;
        printf("  %-24s", label);
        for (i = 0; i < LOHR_WAYS; i++) printf(" %12.1f", 1 / s.entries[i].median);
        printf("\n");
    }
    lohr_print_spread(h);
    bench_free(&s);
    return ok;
}

/* Figure 4: k rays of a pixel of a picture of 128 x 128: through it, through pixels up to 12 away, and through any. */
static void lohr_make_pixels(const rt_camera *camera, int k, int apart, rt_ray *rays)
{
    enum { SIDE = 128 };
    uint32_t seed = 1;
    unsigned i;
    int x, y, sample;
    size_t count = 0;

    for (y = 0; y < SIDE; y += TILE)
        for (x = 0; x < SIDE; x += TILE)
            for (i = 0; i < TILE_RAYS; i++)
                for (sample = 0; sample < k; sample++, seed += 4) {
                    const int px = x + even_bits(i), py = y + even_bits(i >> 1);
                    float u = (float)px + hashed(seed), v = (float)py + hashed(seed + 1);

                    if (apart == 1) u += 24 * hashed(seed + 2) - 12, v += 24 * hashed(seed + 3) - 12;
                    if (apart == 2) u = SIDE * hashed(seed + 2), v = SIDE * hashed(seed + 3);
                    rays[count++] = rt_camera_ray(camera, u, v, SIDE, SIDE);
                }
}

static bool lohr_coherence(lohr *h)
{
    static const char *const names[] = { "coherent", "partly coherent", "incoherent" };
    bench s;
    bool ok = lohr_open(h, &s, LOHR_CHARACTER);
    int k, apart;

    lohr_title(h, "lohr.4", "Figure 4: k rays of a pixel together against one after the other, millions of rays a second and their ratio");
    if (!h->a.json) printf("  %-18s %8s %8s %8s %8s %10s\n", "", "k", "single", "parallel", "ratio", "boxes");
    for (apart = 0; apart < 3 && ok; apart++)
        for (k = 2; k <= 16 && ok; k *= 2) {
            const size_t count = 128 * 128 * (size_t)k;
            const lohr_way way = { "", RT_THREADED_PARALLEL, k };

            lohr_make_pixels(&s.content.camera, k, apart, h->memory.rays);
            s.entry_count = 0;
            ok = lohr_add(&s, s.accels[RT_THREADED], &lohr_ways[LOHR_SINGLE]) && lohr_add(&s, s.accels[RT_THREADED], &way) &&
                 lohr_measure(h, &s, h->memory.rays, count, RT_CLOSEST, "lohr.4", names[apart]);
            if (ok && !h->a.json)
                printf("  %-18s %8d %8.2f %8.2f %8.2f %4.1f/%5.1f\n", names[apart], k, lohr_rate(&s.entries[0], count),
                       lohr_rate(&s.entries[1], count), s.entries[0].median / s.entries[1].median,
                       (double)s.entries[0].stats.boxes / (double)count, (double)s.entries[1].stats.boxes / (double)count);
        }
    lohr_print_spread(h);
    bench_free(&s);
    return ok;
}

/* ---- >>lohr-frames -------------------------------------------------------------------------------------------------- */

typedef struct {
    rt_scene view;
    rt_render_options how;
    rt_vec3 *pixels;
    int columns, failed;
} lohr_frame;

static void lohr_draw_tile(void *context, size_t index)
{
    lohr_frame *f = context;
    const int x = (int)(index % (size_t)f->columns) * FRAME_TILE, y = (int)(index / (size_t)f->columns) * FRAME_TILE;

    if (rt_render_tile(&f->view, &f->how, x, y, x + FRAME_TILE < f->how.width ? x + FRAME_TILE : f->how.width,
                       y + FRAME_TILE < f->how.height ? y + FRAME_TILE : f->how.height, f->pixels, NULL) != RT_OK)
        __atomic_store_n(&f->failed, 1, __ATOMIC_RELAXED);
}

/* Figure 6: whole frames with shadows and mirrors. */
static bool lohr_frames(lohr *h)
{
    enum { SIDE = 512 };
    static const char *const scenes[] = { "balls:3", "balls:4" };
    static const int samples[] = { 2, 16 };
    static double seconds[LOHR_WAYS][MAX_ROUNDS];
    rt_vec3 *first = calloc(SIDE * SIDE, sizeof *first), *pixels = calloc(SIDE * SIDE, sizeof *pixels);
    bool ok = (first && pixels) || complain("out of memory");
    size_t k, i;
    int round;

    lohr_title(h, "lohr.6", "Figure 6: seconds of whole frames, 512x512, shadows and mirrors; parallel against naive (single): the paper has 1.19 and 1.20 with 16 samples");
    if (!h->a.json) {
        printf("  %-16s %10s", "", "primitives");
        for (i = 0; i < LOHR_WAYS; i++) printf(" %12s", lohr_ways[i].title);
        printf("\n");
    }
    for (k = 0; k < 4 && ok; k++) {
        bench s;
        lohr_frame f;

        memset(&f, 0, sizeof f);
        ok = lohr_open(h, &s, scenes[k / 2]);
        f.how.width = f.how.height = SIDE;
        f.how.spp = samples[k % 2];
        f.columns = (SIDE + FRAME_TILE - 1) / FRAME_TILE;
        for (round = 0; round < h->a.rounds && ok; round++)
            for (i = 0; i < LOHR_WAYS; i++) {
                double start;

                f.view = scene_view(&s.content, s.accels[i == LOHR_BVH ? RT_BVH : RT_THREADED]);
                f.how.trace.algorithm = lohr_ways[i].algorithm;
                f.how.trace.packet_width = lohr_ways[i].packet;
                f.pixels = round || i ? pixels : first;
                start = now();
                pool_for(h->threads, (size_t)f.columns * (size_t)f.columns, lohr_draw_tile, &f);
                seconds[i][round] = now() - start;
                if (memcmp(first, f.pixels, SIDE * SIDE * sizeof *first) != 0) h->fine = complain("%s: another picture", lohr_ways[i].title);
            }
        if (f.failed) ok = complain("a frame cannot be drawn");
        if (ok && !h->a.json) printf("  %-8s %2d samples %6zu", scenes[k / 2], samples[k % 2], lohr_primitives(&s));
        for (i = 0; i < LOHR_WAYS && ok; i++) {
            const double single = median(seconds[LOHR_SINGLE], h->a.rounds), own = median(seconds[i], h->a.rounds);

            h->spread = fmax(h->spread, (seconds[i][h->a.rounds - 1] - seconds[i][0]) / own);
            if (!h->a.json) printf(" %6.3f %4.2fx", own, single / own);
            else {
                begin_json("lohr.6", s.content.name);
                printf(",\"primitives\":%zu,\"algorithm\":\"%s\",\"packet\":%d,\"spp\":%d,\"seconds\":%.5f}\n", lohr_primitives(&s),
                       rt_algorithm_get((size_t)lohr_ways[i].algorithm)->name, lohr_ways[i].packet, samples[k % 2], own);
            }
        }
        if (ok && !h->a.json) printf("\n");
        bench_free(&s);
    }
    lohr_print_spread(h);
    free(first);
    free(pixels);
    return ok;
}

/* ---- >>lohr-trees --------------------------------------------------------------------------------------------------- */

/* One way to build, measured with eye rays and bounces, single and 8 together. */
typedef struct { const char *title; rt_build_options options; } lohr_tree;

static bool lohr_trees(lohr *h, const char *table, const char *const *scenes, size_t scene_count, const lohr_tree *trees, size_t tree_count)
{
    enum { MOST = 16 };
    bool ok = true;
    size_t k, i;
    int kind;

    if (!h->a.json) printf("  %-14s %-18s %7s %6s   %-35s %-35s\n", "", "tree", "nodes", "bytes", "eye rays: M/s, x bvh.stack, boxes, prims", "bounces");
    for (k = 0; k < scene_count && ok; k++) {
        rt_accel *accels[MOST] = { NULL };
        rt_info info[MOST];
        double rates[2][2 * MOST + 1], boxes[2][MOST], prims[2][MOST];
        bench s;

        ok = lohr_open(h, &s, scenes[k]);
        for (i = 0; i < tree_count && ok; i++) {
            rt_build_options options = build_options(RT_THREADED, &h->a, h->threads, NULL);

            options.bounds = trees[i].options.bounds;
            options.branching = trees[i].options.branching;
            options.orders = trees[i].options.orders;
            options.throw_back = trees[i].options.throw_back;
            ok = rt_build(&accels[i], &s.content.geometry, &options) == RT_OK || complain("%s: %s does not build", scenes[k], trees[i].title);
            if (ok) rt_get_info(accels[i], &info[i]);
        }
        for (kind = 0; kind < 2 && ok; kind++) {
            const rt_ray *rays;
            size_t count = (size_t)h->a.width * (size_t)h->a.height;

            trace_primary(&s, s.accels[RT_BVH], &h->a);
            rays = h->memory.primary;
            if (kind) {
                count = make_secondary(DIFFUSE, &s.content.geometry, s.content.lights[0].position, h->memory.primary, h->memory.primary_hits,
                                       count, h->memory.rays);
                rays = h->memory.rays;
            }
            s.entry_count = 0;
            ok = lohr_add(&s, s.accels[RT_BVH], &lohr_ways[LOHR_BVH]);
            for (i = 0; i < tree_count && ok; i++)
                ok = lohr_add(&s, accels[i], &lohr_ways[LOHR_SINGLE]) && lohr_add(&s, accels[i], &lohr_ways[LOHR_8]);
            ok = ok && lohr_measure(h, &s, rays, count, RT_CLOSEST, table, kind ? "diffuse" : "primary");
            for (i = 0; i < s.entry_count && ok; i++) rates[kind][i] = lohr_rate(&s.entries[i], count);
            for (i = 0; i < tree_count && ok; i++) {
                boxes[kind][i] = (double)s.entries[1 + 2 * i].stats.boxes / (double)count;
                prims[kind][i] = (double)s.entries[1 + 2 * i].stats.prims / (double)count;
            }
        }
        for (i = 0; i < tree_count && ok && !h->a.json; i++) {
            const double n = (double)lohr_primitives(&s);

            printf("  %-14.14s %-18s %7.2f %6.1f", i ? "" : scenes[k], trees[i].title, (double)info[i].nodes / n, (double)info[i].bytes / n);
            for (kind = 0; kind < 2; kind++)
                printf("   %6.2f %4.2f; 8: %6.2f  %5.1f %5.2f", rates[kind][1 + 2 * i], rates[kind][1 + 2 * i] / rates[kind][0],
                       rates[kind][2 + 2 * i], boxes[kind][i], prims[kind][i]);
            printf("\n");
        }
        for (i = 0; i < tree_count; i++) rt_free(accels[i]);
        bench_free(&s);
    }
    lohr_print_spread(h);
    return ok;
}

static const char *const lohr_scenes[] = { LOHR_CHARACTER, "balls:4", "terrain:200000", "cloud:100000" };
enum { LOHR_SCENES = sizeof lohr_scenes / sizeof *lohr_scenes };

static bool lohr_widths(lohr *h)
{
    static const lohr_tree trees[] = {
        { "2",              { .branching = 2 } },        { "up to 3",      { .branching = 3 } },  { "up to 4",  { .branching = 4 } },
        { "up to 8",        { .branching = 8 } },        { "up to 16",     { .branching = 16 } },
        { "4 where it can", { .branching = 4, .throw_back = 1e-6f } },     { "8 where it can", { .branching = 8, .throw_back = 1e-6f } },
        { "16 where it can", { .branching = 16, .throw_back = 1e-6f } },
    };

    lohr_title(h, "lohr.width", "the width of the tree (the paper's future work): children thrown back where their surface is above half of the parent's, "
               "or always");
    return lohr_trees(h, "lohr.width", lohr_scenes, LOHR_SCENES, trees, sizeof trees / sizeof *trees);
}

static bool lohr_orders(lohr *h)
{
    static const lohr_tree trees[] = {
        { "1 list (Lohr)", { .orders = 1 } }, { "2 lists", { .orders = 2 } }, { "4 lists", { .orders = 4 } }, { "8 lists", { .orders = 8 } }
    };

    lohr_title(h, "lohr.orders", "lists of links, by the signs of directions");
    return lohr_trees(h, "lohr.orders", lohr_scenes, LOHR_SCENES, trees, sizeof trees / sizeof *trees);
}

static bool lohr_bounds(lohr *h)
{
    static const lohr_tree trees[] = {
        { "boxes", { .bounds = RT_BOUNDS_BOXES } },          { "spheres", { .bounds = RT_BOUNDS_SPHERES } },
        { "boxes, 1 list", { .orders = 1 } },                { "spheres, 1 list", { .bounds = RT_BOUNDS_SPHERES, .orders = 1 } },
    };

    lohr_title(h, "lohr.bounds", "boxes against the paper's spheres");
    return lohr_trees(h, "lohr.bounds", lohr_scenes, LOHR_SCENES, trees, sizeof trees / sizeof *trees);
}

/* ---- >>lohr-scaling ------------------------------------------------------------------------------------------------- */

/* Figure 6's claim: cost grows slower than the number of primitives. */
static bool lohr_scaling(lohr *h)
{
    static const char *const scenes[] = { "balls:3", "balls:4", "balls:5", "balls:6", "terrain:1000", "terrain:7000", "terrain:70000", "terrain:700000" };
    double least = 0;
    size_t least_count = 1, k;
    bool ok = true;

    lohr_title(h, "lohr.scaling", "millions of eye rays a second; cost and primitives as multiples of the first of a kind");
    if (!h->a.json) printf("  %-16s %10s %8s %10s %10s %8s %8s\n", "", "primitives", "single", "parallel 8", "bvh.stack", "x prims", "x cost");
    for (k = 0; k < sizeof scenes / sizeof *scenes && ok; k++) {
        const size_t count = (size_t)h->a.width * (size_t)h->a.height;
        bench s;

        ok = lohr_open(h, &s, scenes[k]);
        if (ok) make_primary(&s.content.camera, h->a.width, h->a.height, h->memory.rays);
        s.entry_count = 0;
        ok = ok && lohr_add(&s, s.accels[RT_THREADED], &lohr_ways[LOHR_SINGLE]) && lohr_add(&s, s.accels[RT_THREADED], &lohr_ways[LOHR_8]) &&
             lohr_add(&s, s.accels[RT_BVH], &lohr_ways[LOHR_BVH]) && lohr_measure(h, &s, h->memory.rays, count, RT_CLOSEST, "lohr.scaling", "primary");
        if (ok && k % 4 == 0) least = s.entries[0].median, least_count = lohr_primitives(&s);
        if (ok && !h->a.json)
            printf("  %-16s %10zu %8.2f %10.2f %10.2f %8.1f %8.2f\n", scenes[k], lohr_primitives(&s), lohr_rate(&s.entries[0], count),
                   lohr_rate(&s.entries[1], count), lohr_rate(&s.entries[2], count), (double)lohr_primitives(&s) / (double)least_count,
                   s.entries[0].median / least);
        bench_free(&s);
    }
    lohr_print_spread(h);
    return ok;
}

/* ---- >>lohr-update -------------------------------------------------------------------------------------------------- */

/* Transforms re-inserted for the next frame: milliseconds of rt_refit of so many moving instances of the imp. */
static bool lohr_update(lohr *h)
{
    static const struct { const char *title; rt_structure structure; rt_bounds bounds; } ways[] = {
        { "bvh", RT_BVH, RT_BOUNDS_BOXES }, { "threaded, boxes", RT_THREADED, RT_BOUNDS_BOXES }, { "threaded, spheres", RT_THREADED, RT_BOUNDS_SPHERES }
    };
    enum { COUNT = 1000, FRAMES = 40 };
    static rt_instance instances[COUNT];
    static rt_motion motions[COUNT];
    double times[FRAMES];
    bench s;
    bool ok = lohr_open(h, &s, LOHR_CHARACTER);
    size_t w, i;
    int turn;

    lohr_title(h, "lohr.update", "1,000 moving transforms of the imp (882,000 triangles as seen), ms a frame: transforms and motions set and rt_refit");
    for (w = 0; w < sizeof ways / sizeof *ways && ok; w++) {
        rt_build_options options;
        rt_geometry world;
        rt_accel *accel = NULL;

        memset(&options, 0, sizeof options);
        memset(&world, 0, sizeof world);
        options.structure = ways[w].structure;
        options.bounds = ways[w].bounds;
        world.instances = instances;
        world.instance_count = COUNT;
        for (turn = 0; turn < FRAMES && ok; turn++) {
            const double start = now();

            for (i = 0; i < COUNT; i++) {
                const float angle = 0.1f * (float)turn + (float)i, c = cosf(angle), sine = sinf(angle);
                const float m[12] = { c, 0, sine, 2 * (float)(i % 32), 0, 1, 0, 0, -sine, 0, c, 2 * (float)(i / 32) };

                memcpy(instances[i].transform, m, sizeof m);
                instances[i].accel = s.accels[RT_THREADED];
                instances[i].motion = &motions[i];
                motions[i].pivot = vec(m[3], 0, m[11]), motions[i].axis = vec(0, 1, 0), motions[i].angle = 0.1f;
            }
            ok = (accel ? rt_refit(accel, &world) : rt_build(&accel, &world, &options)) == RT_OK || complain("1,000 instances do not build");
            times[turn] = 1e3 * (now() - start);
        }
        if (ok) {
            const double first = times[0];

            times[0] = times[FRAMES - 1];
            if (!h->a.json) printf("  %-20s build %.3f, refit median %.3f", ways[w].title, first, median(times, FRAMES - 1));
            if (!h->a.json) printf(", most %.3f\n", times[FRAMES - 2]);
            else {
                begin_json("lohr.update", ways[w].title);
                printf(",\"instances\":%d,\"build_ms\":%.4f,\"refit_ms\":%.4f}\n", COUNT, first, median(times, FRAMES - 1));
            }
        }
        rt_free(accel);
    }
    bench_free(&s);
    return ok;
}

/* ---- >>lohr-main ---------------------------------------------------------------------------------------------------- */

/* Those of the paper's tables that are asked for. */
static bool lohr_tables(const arguments *given, pool *threads)
{
    static bool (*const tables[LOHR_TABLE_COUNT])(lohr *) = {
        [LOHR_NEIGHBOURS] = lohr_neighbours, [LOHR_COHERENCE] = lohr_coherence, [LOHR_FRAMES] = lohr_frames, [LOHR_WIDTHS] = lohr_widths,
        [LOHR_ORDERS] = lohr_orders,         [LOHR_BOUNDS] = lohr_bounds,       [LOHR_SCALING] = lohr_scaling, [LOHR_UPDATE] = lohr_update
    };
    static const char *const words[LOHR_TABLE_COUNT] = { LOHR_TABLES(TABLE_WORD) };
    size_t pixels;
    lohr h;
    bool ok = true, any = false;
    int i;

    for (i = 0; i < LOHR_TABLE_COUNT; i++) any = any || wants(given, "lohr", words[i]);
    if (!any) return true;
    if (!structure_built(RT_THREADED)) return given->json || printf("\nlohr: RT_NO_THREADED leaves its algorithms out\n");
    memset(&h, 0, sizeof h);
    h.a = with_defaults(given, 512, LOHR_ROUNDS);
    h.threads = threads;
    h.fine = true;
    pixels = (size_t)h.a.width * (size_t)h.a.height;
    ok = buffers_alloc(&h.memory, pixels < 512 * 512 ? 512 * 512 : pixels, false);
    for (i = 0; i < LOHR_TABLE_COUNT && ok; i++) {
        if (!wants(given, "lohr", words[i])) continue;
        h.spread = 0;
        ok = tables[i](&h);
        fflush(stdout);
    }
    buffers_free(&h.memory);
    return ok && h.fine;
}
