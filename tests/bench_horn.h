/* bench_horn.h - the tables of [Horn] (Horn, Sugerman, Houston, Hanrahan: Interactive k-D Tree GPU Raytracing, 2007) on our machine. Part
   of bench.c.    SPDX-License-Identifier: MIT OR Unlicense

   >>horn-scenes  >>horn-build  >>horn-rates  >>horn-nodes  >>horn-bounces  >>horn-plot  >>horn-frames  >>horn-scaling  >>horn-main

   Where the paper's numbers stand beside ours, they are those of its GPU, an ATI X1900 XTX of 2006: compare the steps from line to line,
   not the rates. What the tables call 4 rays and 8 rays are packets of packet_width 2 and 8; the paper's hold 4. */

#define HORN_SIZE 1024                      /* as in the paper */
#define HORN_ROUNDS 3
#define HORN_BOUNCES_MAX 8
#define HORN_BOUNCES_RAYS 1000              /* fewer are no measurement */
#define HORN_STACKS 8                       /* short stacks of 1 to so many entries are counted */

/* ---- >>horn-scenes -------------------------------------------------------------------------------------------------- */

enum { HORN_STEPS = 4, HORN_FRAME_KINDS = 4 };

/* The paper's scenes. Camera and light are ours: the paper shows its pictures too small to take them from. */
typedef struct {
    const char *title, *file;               /* the file within --scenes */
    const char *procedural;                 /* of its kind and size, where there is no such folder */
    rt_camera camera;
    rt_vec3 light;
    double rates[HORN_STEPS][2];            /* Table 2: restart, packets, push-down, short-stack; primary and shadow */
    double frames[HORN_FRAME_KINDS];        /* Table 1: shadow single, shadow packet, bounce single, bounce packet */
} horn_original;

static const horn_original horn_originals[] = {
    { "Cornell Box", "papers/cornell_32.obj", "cornell", { { 0, 1, 3.6f }, { 0, 1, 0 }, { 0, 1, 0 }, 40 }, { 0, 1.9f, -0.03f },
      { { 38.3, 34.8 }, { 17.5, 35.3 }, { 88.8, 74.7 }, { 91.3, 121.3 } }, { 18.7, 28.1, 19.6, 27.5 } },
    { "Kitchen", "papers/bart_kitchen_t0.obj", "rings:3",
      { { 3.75f, 2.3f, 3.6f }, { 3.4366f, 1.8802f, 2.7483f }, { 0, 1, 0 }, 40 }, { 2, 2, 1 },
      { { 8.6, 17.1 }, { 13.3, 21.1 }, { 12.5, 21.4 }, { 16.3, 27.3 } }, { 14.3, 18.3, 8.3, 8.6 } },
    { "Robots", "papers/bart_robots_t0.obj", "tetra:8",
      { { -3.5f, 2, -203 }, { -3.44119f, 2.0987f, -203.993f }, { 0, 1, 0 }, 36.87f }, { -8, 20, -195 },
      { { 7.7, 9.5 }, { 14.0, 13.5 }, { 14.7, 12.8 }, { 17.9, 16.2 } }, { 10.0, 12.1, 5.2, 6.6 } },
    { "Conference", "papers/conference.obj", "terrain:280000",
      { { 1200, 350, -300 }, { 0, 100, 0 }, { 0, 1, 0 }, 60 }, { 300, 500, -200 },
      { { 9.1, 15.2 }, { 13.6, 15.9 }, { 13.9, 16.1 }, { 15.2, 18.8 } }, { 12.1, 14.2, 6.0, 6.1 } },
};
enum { HORN_ORIGINALS = sizeof horn_originals / sizeof *horn_originals };

/* The lines of Table 2, the paper's first. */
static const struct { const char *label; rt_algorithm algorithm; int packet; } horn_rows[] = {
    { "plain restart", RT_KD_RESTART,  1 }, { "+ packets",     RT_KD_RESTART,    2 },
    { "+ push-down",   RT_KD_PUSHDOWN, 2 }, { "+ short-stack", RT_KD_SHORTSTACK, 2 },

    { NULL, RT_KD_STACK, 2 },   { NULL, RT_KD_RESTART, 8 }, { NULL, RT_KD_PUSHDOWN, 8 },   { NULL, RT_KD_SHORTSTACK, 8 },
    { NULL, RT_KD_STACK, 8 },   { NULL, RT_KD_PUSHDOWN, 1 }, { NULL, RT_KD_SHORTSTACK, 1 }, { NULL, RT_KD_STACK, 1 },
    { NULL, RT_KD_BACKTRACK, 1 }, { NULL, RT_BVH_STACK, 1 }, { NULL, RT_BVH_SIMD, 2 },      { NULL, RT_BVH_SIMD, 8 },
};
enum { HORN_ROWS = sizeof horn_rows / sizeof *horn_rows };

/* The forms of short-stack that Figure 2 and Table 1 compare. */
static const struct { const char *label; int packet; } horn_forms[] = { { "single", 1 }, { "4 rays", 2 }, { "8 rays", 8 } };
enum { HORN_FORMS = sizeof horn_forms / sizeof *horn_forms };

typedef struct {
    bench bench;
    char title[24];
    const horn_original *original;          /* NULL: a scene that is not the paper's */
    double rates[HORN_ROWS][2];             /* Mrays/s; 0: not measured */
    size_t bounce_rays[HORN_BOUNCES_MAX];
    double bounces[HORN_FORMS][HORN_BOUNCES_MAX];
} horn_scene;

typedef struct {
    arguments a;
    pool *threads;
    buffers memory;
    horn_scene *scenes;
    size_t count;
    double spread;                          /* the largest of the table at hand: (slowest - fastest) / median of a cell */
    bool fine;                              /* no hit has differed, nor a picture, and the plot is written */
} horn;

static size_t horn_primitives(const horn_scene *s)
{
    return s->bench.content.geometry.triangle_count + s->bench.content.geometry.sphere_count;
}

static void horn_free(horn *h)
{
    size_t i;
    for (i = 0; i < h->count; i++) bench_free(&h->scenes[i].bench);
    free(h->scenes);
    buffers_free(&h->memory);
}

/* Loads what --scene names; else the paper's scenes from --scenes; else procedural ones. Builds what the tables trace. */
static bool horn_load(horn *h)
{
    const arguments *a = &h->a;
    size_t i;

    h->count = a->scene_count ? a->scene_count : HORN_ORIGINALS;
    h->scenes = calloc(h->count, sizeof *h->scenes);
    if (!h->scenes) return h->count = 0, complain("out of memory");
    for (i = 0; i < h->count; i++) {
        horn_scene *s = &h->scenes[i];
        const char *name, *slash;
        char path[4096];
        scene_error error;

        if (!a->scene_count && a->scene_folder) s->original = &horn_originals[i];
        if (s->original) {
            snprintf(path, sizeof path, "%s/%s", a->scene_folder, s->original->file);
            name = path;
        } else {
            name = a->scene_count ? a->scenes[i] : horn_originals[i].procedural;
        }
        if (!scene_load(&s->bench.content, name, NULL, NULL, &error)) return complain("%s", error.message);
        slash = strrchr(name, '/');
        snprintf(s->title, sizeof s->title, "%.17s", s->original ? s->original->title : slash ? slash + 1 : name);
        s->bench.memory = &h->memory;
        if (s->original) {
            s->bench.content.camera = s->original->camera;
            scene_default_lights(&s->original->camera, s->bench.content.lights);
            s->bench.content.lights[0].position = s->original->light;
            s->bench.content.has_lights = true;
        }
        aim(&s->bench.content, a);
        if (!build(&s->bench, RT_BVH, a, h->threads)) return false;
        if (structure_built(RT_KDTREE) && !build(&s->bench, RT_KDTREE, a, h->threads)) return false;
    }
    return true;
}

/* Is this algorithm built, on this processor, and with a structure that s has? */
static bool horn_has(const bench *s, const arguments *a, rt_algorithm algorithm, int packet)
{
    const rt_accel *accel = s->accels[rt_algorithm_get((size_t)algorithm)->structure];
    return accel && takes(accel, a, algorithm, packet);
}

/* Appends the entry of an algorithm, if horn_has it. False: out of memory. */
static bool horn_add(horn *h, bench *s, rt_algorithm algorithm, int packet)
{
    const rt_algorithm_info *info = rt_algorithm_get((size_t)algorithm);
    return !horn_has(s, &h->a, algorithm, packet) || add_ours(s, info, info->structure, packet, RT_CULL_NONE, &h->a, h->threads);
}

/* The entry of an algorithm, or NULL. */
static const entry *horn_find(const bench *s, rt_algorithm algorithm, int packet)
{
    size_t i;
    for (i = 0; i < s->entry_count; i++)
        if (s->entries[i].options.algorithm == algorithm && s->entries[i].packet == packet) return &s->entries[i];
    return NULL;
}

/* A line for each algorithm of the paper that is not built. */
static void horn_print_missing(void)
{
    const rt_algorithm_info *info;
    size_t i;
    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++)
        if (info->structure == RT_KDTREE && !info->built) printf("  %s is not built\n", info->name);
}

/* The end of a table of rates. */
static void horn_print_spread(const horn *h)
{
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * h->spread);
}

/* The opening of a table. */
static void horn_print_title(const horn *h, const char *table, const char *title)
{
    printf("\n%s: %s\n  %dx%d, %d thread%s, median of %d; short stacks of %d\n", table, title, h->a.width, h->a.height,
           pool_threads(h->threads), pool_threads(h->threads) == 1 ? "" : "s", h->a.rounds, h->a.short_stack ? h->a.short_stack : 3);
}

/* A number where there is one. */
static void horn_print_cell(int width, int digits, double value)
{
    if (value > 0) printf(" %*.*f", width - 1, digits, value);
    else printf(" %*s", width - 1, "-");
}

/* ---- >>horn-build --------------------------------------------------------------------------------------------------- */

/* The trees that the table compares. */
static const struct { const char *label; rt_structure structure; bool no_backtrack; } horn_trees[] = {
    { "bvh", RT_BVH, false }, { "kdtree", RT_KDTREE, false }, { "kdtree, no_backtrack", RT_KDTREE, true }
};
enum { HORN_TREES = sizeof horn_trees / sizeof *horn_trees };

/* Builds and frees; seconds, or less than 0 when it fails. */
static double horn_time_build(const scene *content, const rt_build_options *options, rt_info *info)
{
    rt_accel *accel;
    double start = now(), seconds;

    if (rt_build(&accel, &content->geometry, options) != RT_OK) {
        complain("%s: %s", content->name, options->error->message);
        return -1;
    }
    seconds = now() - start;
    rt_get_info(accel, info);
    rt_free(accel);
    return seconds;
}

static void horn_print_tree(const horn *h, const horn_scene *s, int tree, double seconds, const rt_info *info, size_t bvh_bytes)
{
    double n = (double)(horn_primitives(s) ? horn_primitives(s) : 1);

    if (h->a.json) {
        begin_json("horn.build", s->bench.content.name);
        printf(",\"primitives\":%zu,\"structure\":\"%s\",\"no_backtrack\":%s,\"threads\":%d,\"build_s\":%.6f,\"bytes\":%zu,"
               "\"references\":%zu,\"nodes\":%zu,\"leaves\":%zu,\"empty_leaves\":%zu,\"max_leaf\":%zu,\"depth\":%d,\"sah\":%.4f}\n",
               horn_primitives(s), structure_names[horn_trees[tree].structure], horn_trees[tree].no_backtrack ? "true" : "false",
               pool_threads(h->threads), seconds, info->bytes, info->references, info->nodes, info->leaves, info->empty_leaves,
               info->max_leaf, info->depth, info->sah);
        return;
    }
    printf("  %-21s %8.4f %9.3f %8.1f %6.2f %6.2f %9zu %9zu %8zu %5d %8zu %8.2f\n", horn_trees[tree].label, seconds, n / seconds * 1e-6,
           (double)info->bytes / n, (double)info->bytes / (double)(bvh_bytes ? bvh_bytes : 1), (double)info->references / n, info->nodes,
           info->leaves, info->empty_leaves, info->depth, info->max_leaf, info->sah);
}

static bool horn_build(horn *h)
{
    static double seconds[HORN_TREES][MAX_ROUNDS];
    size_t i;

    if (!h->a.json)
        printf("\nhorn.build: trees, built in turns; %d thread%s, median of %d\n"
               "                         seconds   Mprim/s  bytes/p  x bvh refs/p     nodes    leaves    empty depth max leaf      sah\n",
               pool_threads(h->threads), pool_threads(h->threads) == 1 ? "" : "s", h->a.rounds);
    for (i = 0; i < h->count; i++) {
        const horn_scene *s = &h->scenes[i];
        rt_info info[HORN_TREES];
        int tree, round;

        for (round = 0; round < h->a.rounds; round++)
            for (tree = 0; tree < HORN_TREES; tree++) {
                rt_error error;
                rt_build_options options = build_options(horn_trees[tree].structure, &h->a, h->threads, &error);
                if (!structure_built(options.structure)) continue;
                options.no_backtrack = horn_trees[tree].no_backtrack;
                seconds[tree][round] = horn_time_build(&s->bench.content, &options, &info[tree]);
                if (seconds[tree][round] < 0) return false;
            }
        if (!h->a.json) printf("%s: %zu primitives\n", s->title, horn_primitives(s));
        for (tree = 0; tree < HORN_TREES; tree++)
            if (structure_built(horn_trees[tree].structure))
                horn_print_tree(h, s, tree, median(seconds[tree], h->a.rounds), &info[tree], info[0].bytes);
            else if (!h->a.json)
                printf("  %s is not built\n", horn_trees[tree].label);
    }
    return true;
}

/* ---- >>horn-rates --------------------------------------------------------------------------------------------------- */

/* One column of Table 2 for each kind of ray. */
static bool horn_measure_rates(horn *h, horn_scene *s)
{
    bench *b = &s->bench;
    int row, kind;
    size_t i;

    b->entry_count = 0;
    for (row = 0; row < HORN_ROWS; row++)
        if (!horn_add(h, b, horn_rows[row].algorithm, horn_rows[row].packet)) return false;
    trace_primary(b, b->accels[RT_BVH], &h->a);
    for (kind = PRIMARY; kind <= SHADOW; kind++) {
        const batch rays = make_batch(b, (ray_kind)kind, &h->a);
        if (rays.count == 0) continue;
        if (!measure_batch(b, &rays, b->accels[RT_BVH], h->threads, h->a.rounds, &h->fine)) return false;
        for (row = 0; row < HORN_ROWS; row++) {
            const entry *e = horn_find(b, horn_rows[row].algorithm, horn_rows[row].packet);
            if (!e) continue;
            s->rates[row][kind] = (double)rays.count / e->median * 1e-6;
            h->spread = fmax(h->spread, e->spread);
        }
        if (h->a.json)
            for (i = 0; i < b->entry_count; i++)
                print_json("horn.2", &b->entries[i], &rays, b->content.name, horn_primitives(s), pool_threads(h->threads));
    }
    return true;
}

/* How much the last of the paper's steps is faster than the first, on primary and shadow rays. */
static void horn_print_gain(const double first[2], const double last[2])
{
    int kind;
    for (kind = 0; kind < 2; kind++) horn_print_cell(10, 2, first[kind] > 0 ? last[kind] / first[kind] : 0);
}

static void horn_print_rates(const horn *h)
{
    size_t i;
    int row, kind;

    printf("%-28s", "");
    for (i = 0; i < h->count; i++) printf("   %-17s", h->scenes[i].title);
    printf("\n%-28s", "  the paper's steps");
    for (i = 0; i < h->count; i++) printf("   primary    shadow");
    printf("\n");
    for (row = 0; row < HORN_ROWS; row++) {
        char label[32];
        const int packet = horn_rows[row].packet;
        if (horn_rows[row].label) snprintf(label, sizeof label, "%s", horn_rows[row].label);
        else snprintf(label, sizeof label, "%s%s", rt_algorithm_get((size_t)horn_rows[row].algorithm)->name,
                      packet == 1 ? "" : packet == 2 ? ", 4 rays" : ", 8 rays");
        printf("  %-26s", label);
        for (i = 0; i < h->count; i++)
            for (kind = 0; kind < 2; kind++) horn_print_cell(10, 2, h->scenes[i].rates[row][kind]);
        printf("\n");
        if (row + 1 != HORN_STEPS) continue;
        printf("  %-26s", "x plain restart");
        for (i = 0; i < h->count; i++) horn_print_gain(h->scenes[i].rates[0], h->scenes[i].rates[HORN_STEPS - 1]);
        printf("\n  the other forms\n");
    }
    if (!h->scenes[0].original) return;
    printf("  the paper's GPU\n");
    for (row = 0; row < HORN_STEPS; row++) {
        printf("  %-26s", horn_rows[row].label);
        for (i = 0; i < h->count; i++)
            for (kind = 0; kind < 2; kind++) horn_print_cell(10, 1, h->scenes[i].original->rates[row][kind]);
        printf("\n");
    }
    printf("  %-26s", "x plain restart");
    for (i = 0; i < h->count; i++) horn_print_gain(h->scenes[i].original->rates[0], h->scenes[i].original->rates[HORN_STEPS - 1]);
    printf("\n");
}

static bool horn_rates(horn *h)
{
    size_t i;

    for (i = 0; i < h->count; i++)
        if (!horn_measure_rates(h, &h->scenes[i])) return false;
    if (h->a.json) return true;
    horn_print_title(h, "horn.2", "millions of rays a second; each of the paper's steps includes those above it");
    horn_print_rates(h);
    horn_print_spread(h);
    horn_print_missing();
    return true;
}

/* ---- >>horn-nodes --------------------------------------------------------------------------------------------------- */

enum { NODES_RESTART, NODES_PUSHDOWN, NODES_SHORT_1, NODES_STACK = NODES_SHORT_1 + HORN_STACKS, NODES_ROWS };
enum { NODES_SINGLE, NODES_PACKET, NODES_FORMS };               /* single rays, and packets of 4 as the paper's */

static rt_algorithm horn_nodes_algorithm(int row)
{
    if (row == NODES_RESTART) return RT_KD_RESTART;
    if (row == NODES_PUSHDOWN) return RT_KD_PUSHDOWN;
    return row == NODES_STACK ? RT_KD_STACK : RT_KD_SHORTSTACK;
}

/* Counts one line on the rays of b and checks the hits. */
static bool horn_count(horn *h, const horn_scene *s, const batch *b, int row, int form, rt_stats *stats)
{
    const rt_algorithm_info *info = rt_algorithm_get((size_t)horn_nodes_algorithm(row));
    const int packet = form == NODES_SINGLE ? 1 : 2;
    rt_trace_options options;
    rt_error error;
    double rays;

    memset(stats, 0, sizeof *stats);
    if (!horn_has(&s->bench, &h->a, info->algorithm, packet)) return true;
    memset(&options, 0, sizeof options);
    options.algorithm = info->algorithm;
    options.packet_width = packet;
    options.isa = (rt_isa)h->a.isa;
    if (info->algorithm == RT_KD_SHORTSTACK) options.short_stack = row - NODES_SHORT_1 + 1;
    options.stats = stats;
    options.error = &error;
    if (rt_trace(s->bench.accels[RT_KDTREE], &options, b->rays, b->count, b->hits) != RT_OK)
        return complain("%s: %s", info->name, error.message);
    if (memcmp(b->hits, b->truth, b->count * sizeof *b->hits) != 0)
        h->fine = complain("%s finds hits that differ in %s", info->name, s->title);
    if (!h->a.json) return true;
    rays = stats->rays ? (double)stats->rays : 1;
    begin_json("horn.nodes", s->bench.content.name);
    printf(",\"primitives\":%zu,\"structure\":\"kdtree\",\"algorithm\":\"%s\",\"packet\":%d,\"short_stack\":%d,\"rays\":\"primary\","
           "\"nodes_per_ray\":%.4f,\"leaves_per_ray\":%.4f,\"restarts_per_ray\":%.4f,\"pushes_per_ray\":%.4f,\"drops_per_ray\":%.4f,"
           "\"prims_per_ray\":%.4f,\"steps_per_ray\":%.4f,\"active_per_step\":%.4f}\n",
           horn_primitives(s), info->name, packet, options.short_stack, (double)stats->nodes / rays, (double)stats->leaves / rays,
           (double)stats->restarts / rays, (double)stats->pushes / rays, (double)stats->drops / rays, (double)stats->prims / rays,
           (double)stats->steps / rays, stats->steps ? (double)stats->active / (double)stats->steps : 0.0);
    return true;
}

/* How many per cent a is more than b. */
static double percent(uint64_t a, uint64_t b) { return b ? 100 * ((double)a / (double)b - 1) : 0; }

static void horn_print_nodes(const horn *h, rt_stats stats[NODES_ROWS][NODES_FORMS])
{
    const int three = NODES_SHORT_1 + (h->a.short_stack && h->a.short_stack <= HORN_STACKS ? h->a.short_stack : 3) - 1;
    int row, form;

    for (row = 0; row < NODES_ROWS; row++) {
        char label[24];
        if (row >= NODES_SHORT_1 && row < NODES_STACK) snprintf(label, sizeof label, "short-stack %d", row - NODES_SHORT_1 + 1);
        else snprintf(label, sizeof label, "%s", row == NODES_RESTART ? "restart" : row == NODES_PUSHDOWN ? "push-down" : "stack");
        printf("  %-16s", label);
        for (form = 0; form < NODES_FORMS; form++) {
            const rt_stats *t = &stats[row][form];
            double rays = t->rays ? (double)t->rays : 1;
            printf(" %8.2f %7.2f %8.3f %7.2f %7.3f %7.2f", (double)t->nodes / rays, (double)t->leaves / rays, (double)t->restarts / rays,
                   (double)t->pushes / rays, (double)t->drops / rays, (double)t->prims / rays);
            if (form == NODES_PACKET)
                printf(" %7.2f %7.2f", 4 * (double)t->steps / rays, t->steps ? (double)t->active / (double)t->steps : 0.0);
        }
        printf("\n");
    }
    for (form = 0; form < NODES_FORMS; form++)
        printf("  %s: push-down visits %+.1f%% nodes against restart, short-stack %d %+.1f%% against push-down, %+.2f%% against stack\n",
               form == NODES_SINGLE ? "single rays" : "4 rays",
               percent(stats[NODES_PUSHDOWN][form].nodes, stats[NODES_RESTART][form].nodes), three - NODES_SHORT_1 + 1,
               percent(stats[three][form].nodes, stats[NODES_PUSHDOWN][form].nodes),
               percent(stats[three][form].nodes, stats[NODES_STACK][form].nodes));
}

static bool horn_nodes(horn *h)
{
    size_t i;
    int row, form;

    if (!h->a.json) {
        horn_print_title(h, "horn.nodes", "what a primary ray visits: inner nodes, leaves, restarts, stack entries pushed and dropped, "
                         "primitives");
        printf("  the paper, of its three larger scenes: push-down -3 to -22%% against restart, short-stack 3 -48 to -52%% against\n"
               "  push-down, less than +3%% against stack. steps: nodes that a packet visits; live: rays that take part\n");
        if (!structure_built(RT_KDTREE)) return horn_print_missing(), true;
    }
    for (i = 0; i < h->count && structure_built(RT_KDTREE); i++) {
        bench *s = &h->scenes[i].bench;
        rt_stats stats[NODES_ROWS][NODES_FORMS];
        batch b;

        trace_primary(s, s->accels[RT_BVH], &h->a);
        b = make_batch(s, PRIMARY, &h->a);
        b.truth = h->memory.primary_hits;
        for (row = 0; row < NODES_ROWS; row++)
            for (form = 0; form < NODES_FORMS; form++)
                if (!horn_count(h, &h->scenes[i], &b, row, form, &stats[row][form])) return false;
        if (h->a.json) continue;
        printf("%-18s single rays                                       packets of 4 rays\n%18s", h->scenes[i].title, "");
        for (form = 0; form < NODES_FORMS; form++) printf("    nodes  leaves restarts  pushes   drops   prims");
        printf("   steps    live\n");
        horn_print_nodes(h, stats);
    }
    return true;
}

/* ---- >>horn-bounces ------------------------------------------------------------------------------------------------- */

/* Every surface is a mirror; a ray that misses ends. The rays of a bounce stand in the order of the pixels that they come from. */
static bool horn_measure_bounces(horn *h, horn_scene *s)
{
    bench *b = &s->bench;
    const buffers *m = &h->memory;
    size_t i;
    int bounce, form;
    batch rays;

    b->entry_count = 0;
    for (form = 0; form < HORN_FORMS; form++)
        if (!horn_add(h, b, RT_KD_SHORTSTACK, horn_forms[form].packet)) return false;
    trace_primary(b, b->accels[RT_BVH], &h->a);
    rays = make_batch(b, REFLECT, &h->a);
    for (bounce = 0; bounce < HORN_BOUNCES_MAX && rays.count >= HORN_BOUNCES_RAYS; bounce++) {
        s->bounce_rays[bounce] = rays.count;
        if (!measure_batch(b, &rays, b->accels[RT_BVH], h->threads, h->a.rounds, &h->fine)) return false;
        for (form = 0; form < HORN_FORMS; form++) {
            const entry *e = horn_find(b, RT_KD_SHORTSTACK, horn_forms[form].packet);
            if (!e) continue;
            s->bounces[form][bounce] = (double)rays.count / e->median * 1e-6;
            h->spread = fmax(h->spread, e->spread);
        }
        if (h->a.json)
            for (i = 0; i < b->entry_count; i++) {
                begin_json("horn.figure2", b->content.name);
                printf(",\"primitives\":%zu,\"structure\":\"kdtree\",\"algorithm\":\"%s\",\"packet\":%d,\"rays\":\"reflect\",\"bounce\":%d,"
                       "\"count\":%zu,\"threads\":%d,\"mrays_per_s\":%.4f,", horn_primitives(s), b->entries[i].name, b->entries[i].packet,
                       bounce + 1, rays.count, pool_threads(h->threads), (double)rays.count / b->entries[i].median * 1e-6);
                print_json_rate("nodes_per_ray", &b->entries[i], b->entries[i].stats.nodes);
                printf("\"build_s\":%.6f,\"bytes\":%zu}\n", b->entries[i].build_seconds, b->entries[i].bytes);
            }
        rays.count = make_secondary(REFLECT, &b->content.geometry, b->content.lights[0].position, m->rays, m->truth, rays.count, m->rays);
    }
    return true;
}

static bool horn_bounces(horn *h)
{
    size_t i;
    int bounce, form;

    for (i = 0; i < h->count; i++)
        if (!horn_measure_bounces(h, &h->scenes[i])) return false;
    if (h->a.json) return true;
    horn_print_title(h, "horn.figure2", "millions of specular rays a second by bounce, kd.shortstack, every surface a mirror");
    printf("%-28s", "");
    for (bounce = 1; bounce <= HORN_BOUNCES_MAX; bounce++) printf("%9d", bounce);
    printf("\n");
    for (i = 0; i < h->count; i++) {
        printf("%-18s %-9s", h->scenes[i].title, "rays");
        for (bounce = 0; bounce < HORN_BOUNCES_MAX; bounce++) printf(" %8zu", h->scenes[i].bounce_rays[bounce]);
        printf("\n");
        for (form = 0; form < HORN_FORMS; form++) {
            printf("%-18s %-9s", "", horn_forms[form].label);
            for (bounce = 0; bounce < HORN_BOUNCES_MAX; bounce++) horn_print_cell(9, 2, h->scenes[i].bounces[form][bounce]);
            printf("\n");
        }
    }
    horn_print_spread(h);
    horn_print_missing();
    return true;
}

/* ---- >>horn-plot ---------------------------------------------------------------------------------------------------- */

enum { PANEL_WIDTH = 260, PANEL_HEIGHT = 200, PANEL_LEFT = 56, PANEL_TOP = 34, PANEL_RIGHT = 14, PANEL_BOTTOM = 40 };

/* One scene's curves, in the panel whose left edge is at left. */
static void horn_plot_scene(FILE *file, const horn_scene *s, double left)
{
    static const char *const colors[HORN_FORMS] = { "#1b6ca8", "#d1495b", "#3a7d44" };
    const double x0 = left + PANEL_LEFT, y0 = PANEL_TOP + PANEL_HEIGHT, x_step = (double)PANEL_WIDTH / HORN_BOUNCES_MAX;
    double most = 1e-3;
    char label[32];
    int bounce, form;

    for (form = 0; form < HORN_FORMS; form++)
        for (bounce = 0; bounce < HORN_BOUNCES_MAX; bounce++) most = fmax(most, s->bounces[form][bounce]);
    svg_text(file, x0 + PANEL_WIDTH / 2.0, PANEL_TOP - 12, "middle", "#000", s->title);
    svg_text(file, x0, PANEL_TOP - 12, "end", "#000", "Mrays/s");
    svg_text(file, x0, y0 + 15, "end", "#000", "bounce");
    most = svg_scale(file, x0, y0, PANEL_WIDTH, PANEL_HEIGHT, most);
    for (bounce = 0; bounce < HORN_BOUNCES_MAX; bounce++) {
        snprintf(label, sizeof label, "%d", bounce + 1);
        svg_text(file, x0 + x_step * (bounce + 0.5), y0 + 15, "middle", "#000", label);
    }
    for (form = 0; form < HORN_FORMS; form++) {
        fprintf(file, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"2\" d=\"", colors[form]);
        for (bounce = 0; bounce < HORN_BOUNCES_MAX && s->bounces[form][bounce] > 0; bounce++)
            fprintf(file, "%c%.1f %.1f", bounce ? 'L' : 'M', x0 + x_step * (bounce + 0.5),
                    y0 - s->bounces[form][bounce] / most * PANEL_HEIGHT);
        fprintf(file, "\"/>\n");
        svg_text(file, x0 + PANEL_WIDTH * (form + 0.5) / HORN_FORMS, y0 + 32, "middle", colors[form], horn_forms[form].label);
    }
}

static bool horn_plot(const horn *h)
{
    const int panel = PANEL_LEFT + PANEL_WIDTH + PANEL_RIGHT;
    FILE *file = plot_open(&h->a, "horn.figure2", (double)h->count * panel, PANEL_TOP + PANEL_HEIGHT + PANEL_BOTTOM,
                           "Mrays/s of specular rays by bounce");
    size_t i;

    if (!file) return false;
    for (i = 0; i < h->count; i++) horn_plot_scene(file, &h->scenes[i], (double)i * panel);
    return plot_close(&h->a, "horn.figure2", file);
}

/* ---- >>horn-frames -------------------------------------------------------------------------------------------------- */

enum { FRAME_SHADOW, FRAME_BOUNCE, FRAME_EFFECTS };
enum { FRAME_TRACED, FRAME_RASTERISED, FRAME_PRIMARIES };
static const char *const frame_primaries[FRAME_PRIMARIES] = { "traced", "rasterised" };
typedef double frame_rates[FRAME_PRIMARIES][FRAME_EFFECTS][HORN_FORMS];         /* frames a second */

/* How to draw one frame. */
typedef struct {
    const bench *s;
    int width, height, effect;
    bool rasterise;                         /* the primary hits, with every frame as if all had moved; else they are traced */
    rt_trace_options options;
    pool *threads;
    rt_vec3 *pixels;
} frame;

/* Phong's model, of the surface's true normal; lit: the light is seen. */
static rt_vec3 phong(const bench *s, const rt_ray *ray, const rt_hit *hit, bool lit)
{
    static const rt_material grey = { .diffuse = { 0.7f, 0.7f, 0.7f }, .shininess = 1 };
    const scene *content = &s->content;
    const rt_material *m = content->material_count ? &content->materials[content->material_ids[hit->prim]] : &grey;
    const rt_vec3 point = add_scaled(ray->org, ray->dir, hit->t), n = facing_normal(&content->geometry, hit, point, ray->dir);
    const rt_vec3 to = unit(sub(content->lights[0].position, point)), back = unit(vec(-ray->dir.x, -ray->dir.y, -ray->dir.z));
    const float cosine = dot(n, to), highlight = dot(add_scaled(vec(-to.x, -to.y, -to.z), n, 2 * cosine), back);
    rt_vec3 color = vec(content->ambient.x * m->diffuse.x, content->ambient.y * m->diffuse.y, content->ambient.z * m->diffuse.z);

    color = add_scaled(color, m->emission, 1);
    if (!lit || cosine <= 0) return color;
    color = add_scaled(color, m->diffuse, cosine);
    if (highlight <= 0 || dot(m->specular, m->specular) <= 0) return color;
    return add_scaled(color, m->specular, powf(highlight, m->shininess));
}

/* Draws one tile of pixels: primary hits, then a shadow ray or a specular bounce each. The camera's rays are those of trace_primary. */
static void draw_tile(void *context, size_t index)
{
    const frame *f = context;
    const rt_geometry *geometry = &f->s->content.geometry;
    const buffers *memory = f->s->memory;
    const int across = (f->width + TILE - 1) / TILE;
    const int left = (int)(index % (size_t)across) * TILE, top = (int)(index / (size_t)across) * TILE;
    const int rows = f->height - top < TILE ? f->height - top : TILE;
    const rt_ray *primary = memory->primary + (size_t)top * (size_t)f->width + (size_t)left * (size_t)rows;
    rt_trace_options options = f->options;
    rt_ray secondary[TILE_RAYS];
    rt_hit hits[TILE_RAYS], second[TILE_RAYS];
    rt_vec3 *pixel[TILE_RAYS];
    size_t count = 0, i, k;

    for (i = 0; i < TILE_RAYS; i++) {
        const int x = left + even_bits((unsigned)i), y = top + even_bits((unsigned)i >> 1);
        const size_t at = (size_t)y * (size_t)f->width + (size_t)x;
        if (x >= f->width || y >= f->height) continue;
        if (f->rasterise) hits[count] = memory->hits[at];
        pixel[count++] = &f->pixels[at];
    }
    options.query = RT_CLOSEST;
    if (!f->rasterise) rt_trace(f->s->accels[RT_KDTREE], &options, primary, count, hits);
    k = make_secondary(f->effect == FRAME_SHADOW ? SHADOW : REFLECT, geometry, f->s->content.lights[0].position, primary, hits, count,
                       secondary);
    if (f->effect == FRAME_SHADOW) options.query = RT_ANY;
    rt_trace(f->s->accels[RT_KDTREE], &options, secondary, k, second);
    for (i = k = 0; i < count; i++) {
        if (hits[i].prim == RT_NONE) {
            *pixel[i] = f->s->content.background;
            continue;
        }
        if (f->effect == FRAME_SHADOW) {
            *pixel[i] = phong(f->s, &primary[i], &hits[i], second[k].prim == RT_NONE);
        } else {
            const rt_vec3 mirrored = second[k].prim == RT_NONE ? f->s->content.background : phong(f->s, &secondary[k], &second[k], true);
            *pixel[i] = add_scaled(phong(f->s, &primary[i], &hits[i], true), mirrored, 0.5f);
        }
        k++;
    }
}

/* Seconds that a frame takes; less than 0 when it fails. */
static double draw_frame(frame *f)
{
    const scene *content = &f->s->content;
    const size_t across = (size_t)((f->width + TILE - 1) / TILE), tiles = across * (size_t)((f->height + TILE - 1) / TILE);
    const double start = now();

    if (f->rasterise) {
        rt_raster_options options;
        rt_error error;
        memset(&options, 0, sizeof options);
        options.isa = f->options.isa;
        options.error = &error;
        if (pool_threads(f->threads) > 1) {
            options.parallel_for = pool_for;
            options.parallel_user = f->threads;
        }
        if (rt_rasterize(&content->geometry, &content->camera, f->width, f->height, &options, f->s->memory->hits) != RT_OK) {
            complain("%s: %s", content->name, error.message);
            return -1;
        }
    }
    pool_for(f->threads, tiles, draw_tile, f);
    return now() - start;
}

/* The frame of an effect and a form of a scene, to be drawn to pixels. */
static frame make_frame(const horn *h, const horn_scene *s, bool rasterise, int effect, int form, pool *threads, rt_vec3 *pixels)
{
    frame f;

    memset(&f, 0, sizeof f);
    f.s = &s->bench;
    f.rasterise = rasterise;
    f.threads = threads;
    f.width = h->a.width;
    f.height = h->a.height;
    f.effect = effect;
    f.options.algorithm = RT_KD_SHORTSTACK;
    f.options.packet_width = horn_forms[form].packet;
    f.options.short_stack = h->a.short_stack;
    f.options.isa = (rt_isa)h->a.isa;
    f.pixels = pixels;
    return f;
}

/* One line of Table 1: the frames of a scene, all in turns. The pictures must depend on nothing but the effect. */
static bool horn_measure_frames(horn *h, const horn_scene *s, pool *threads, rt_vec3 *pixels[2], frame_rates rates)
{
    static double seconds[FRAME_PRIMARIES][FRAME_EFFECTS][HORN_FORMS][MAX_ROUNDS];
    const size_t bytes = (size_t)h->a.width * (size_t)h->a.height * sizeof *pixels[0];
    int round, effect, primary, form;

    trace_primary(&s->bench, s->bench.accels[RT_BVH], &h->a);
    for (round = 0; round <= h->a.rounds; round++)
        for (effect = 0; effect < FRAME_EFFECTS; effect++)
            for (primary = 0; primary < FRAME_PRIMARIES; primary++)
                for (form = 0; form < HORN_FORMS; form++) {
                    const bool first = primary == 0 && form == 0;
                    frame f = make_frame(h, s, primary == FRAME_RASTERISED, effect, form, threads, pixels[!first]);
                    double took;
                    if (!horn_has(&s->bench, &h->a, RT_KD_SHORTSTACK, horn_forms[form].packet)) continue;
                    took = draw_frame(&f);
                    if (took < 0) return false;
                    if (round > 0) seconds[primary][effect][form][round - 1] = took;
                    else if (!first && memcmp(pixels[0], pixels[1], bytes) != 0)
                        h->fine = complain("%s: the picture of %s, %s, is another than that of single rays", s->title,
                                           horn_forms[form].label, frame_primaries[primary]);
                }
    for (primary = 0; primary < FRAME_PRIMARIES; primary++)
        for (effect = 0; effect < FRAME_EFFECTS; effect++)
            for (form = 0; form < HORN_FORMS; form++) {
                const bool has = horn_has(&s->bench, &h->a, RT_KD_SHORTSTACK, horn_forms[form].packet);
                rates[primary][effect][form] = has ? 1 / median(seconds[primary][effect][form], h->a.rounds) : 0;
                if (!h->a.json || !has) continue;
                begin_json("horn.1", s->bench.content.name);
                printf(",\"primitives\":%zu,\"structure\":\"kdtree\",\"algorithm\":\"kd.shortstack\",\"packet\":%d,\"effect\":\"%s\","
                       "\"primary\":\"%s\",\"threads\":%d,\"frames_per_s\":%.4f}\n", horn_primitives(s), horn_forms[form].packet,
                       effect == FRAME_SHADOW ? "shadow" : "bounce", frame_primaries[primary], pool_threads(threads),
                       rates[primary][effect][form]);
            }
    return true;
}

static void horn_print_frames(const horn *h, int threads, int primary, frame_rates *rates)
{
    const bool paper = h->scenes[0].original && primary == FRAME_PRIMARIES - 1;
    size_t i;
    int effect, form;

    printf("  primary hits %-10s %2d thread%-46s%s\n", frame_primaries[primary], threads, threads == 1 ? "" : "s",
           paper ? "the paper's GPU, rasterised" : "");
    printf("%-18s    %-29s %-29s %s\n", "", "shadow", "1 bounce", paper ? "  shadow            1 bounce" : "");
    printf("%-18s%10s%10s%10s%10s%10s%10s%s\n", "", horn_forms[0].label, horn_forms[1].label, horn_forms[2].label, horn_forms[0].label,
           horn_forms[1].label, horn_forms[2].label, paper ? "   single   packet   single   packet" : "");
    for (i = 0; i < h->count; i++) {
        printf("%-18s", h->scenes[i].title);
        for (effect = 0; effect < FRAME_EFFECTS; effect++)
            for (form = 0; form < HORN_FORMS; form++) horn_print_cell(10, 2, rates[i][primary][effect][form]);
        for (form = 0; form < HORN_FRAME_KINDS && paper; form++) horn_print_cell(9, 1, h->scenes[i].original->frames[form]);
        printf("\n");
    }
}

/* All lines of Table 1 on these threads. */
static bool horn_frames_on(horn *h, pool *threads, rt_vec3 *pixels[2])
{
    frame_rates *rates = calloc(h->count, sizeof *rates);
    bool ok = rates || complain("out of memory");
    size_t i;
    int primary;

    for (i = 0; i < h->count && ok; i++) ok = horn_measure_frames(h, &h->scenes[i], threads, pixels, rates[i]);
    for (primary = 0; primary < FRAME_PRIMARIES && ok && !h->a.json; primary++) horn_print_frames(h, pool_threads(threads), primary, rates);
    free(rates);
    return ok;
}

static bool horn_frames(horn *h)
{
    const size_t count = (size_t)h->a.width * (size_t)h->a.height;
    rt_vec3 *pixels[2];
    pool *one = NULL;
    bool ok;

    if (!h->a.json)
        horn_print_title(h, "horn.1", "frames a second, kd.shortstack: Phong shading with a shadow ray, or with a specular bounce");
    if (!structure_built(RT_KDTREE)) return h->a.json ? true : (horn_print_missing(), true);
    pixels[0] = calloc(count, sizeof *pixels[0]);
    pixels[1] = calloc(count, sizeof *pixels[1]);
    ok = (pixels[0] && pixels[1]) || complain("out of memory");
    if (ok && pool_threads(h->threads) > 1) {
        one = pool_create(1);
        ok = one ? horn_frames_on(h, one, pixels) : complain("the threads do not start");
    }
    ok = ok && horn_frames_on(h, h->threads, pixels);
    pool_destroy(one);
    free(pixels[0]), free(pixels[1]);
    return ok;
}

/* ---- >>horn-scaling ------------------------------------------------------------------------------------------------- */

/* Builds a scene's tree until MEASURE_SECONDS are over; seconds of one, or less than 0 when it fails. */
static double horn_mean_build(const scene *content, const rt_build_options *options, rt_info *info)
{
    double total = 0;
    int builds = 0;

    do {
        const double seconds = horn_time_build(content, options, info);
        if (seconds < 0) return seconds;
        total += seconds;
        builds++;
    } while (total < MEASURE_SECONDS);
    return total / builds;
}

static bool horn_scaling(horn *h)
{
    static const char *const scenes[] = { "terrain", "cloud" };
    static const int counts[] = { 10000, 30000, 100000, 300000, 1000000, 2000000, 4000000 };
    static const rt_structure structures[] = { RT_KDTREE, RT_BVH };
    size_t i, k, t;

    if (!h->a.json)
        printf("\nhorn.scaling: build time against the number of triangles n; 1 thread\n"
               "                          kdtree: s ns/(n log2 n)    bytes/n     refs/n         bvh: s ns/(n log2 n)    bytes/n\n");
    for (i = 0; i < sizeof scenes / sizeof *scenes; i++)
        for (k = 0; k < sizeof counts / sizeof *counts && counts[k] <= h->a.most_triangles; k++) {
            char name[64];
            scene content;
            scene_error error;
            bool ok = true;

            snprintf(name, sizeof name, "%s:%d", scenes[i], counts[k]);
            if (!scene_load(&content, name, NULL, NULL, &error)) return complain("%s", error.message);
            if (!h->a.json) printf("  %-16s", name);
            for (t = 0; t < sizeof structures / sizeof *structures && ok; t++) {
                const double n = (double)content.geometry.triangle_count;
                rt_error failure;
                const rt_build_options options = build_options(structures[t], &h->a, NULL, &failure);
                rt_info info;
                double seconds;

                if (!structure_built(structures[t])) {
                    if (!h->a.json) printf(" %48s", "not built");
                    continue;
                }
                seconds = horn_mean_build(&content, &options, &info);
                ok = seconds >= 0;
                if (!ok) break;
                if (h->a.json) {
                    begin_json("horn.scaling", name);
                    printf(",\"primitives\":%.0f,\"structure\":\"%s\",\"threads\":1,\"build_s\":%.6f,\"ns_per_n_log2_n\":%.4f,"
                           "\"bytes\":%zu,\"references\":%zu}\n", n, structure_names[structures[t]], seconds,
                           1e9 * seconds / (n * log2(n)), info.bytes, info.references);
                } else {
                    printf(" %16.4f %14.3f %10.1f", seconds, 1e9 * seconds / (n * log2(n)), (double)info.bytes / n);
                    if (structures[t] == RT_KDTREE) printf(" %10.2f", (double)info.references / n);
                }
            }
            if (!h->a.json) printf("\n");
            fflush(stdout);
            scene_free(&content);
            if (!ok) return false;
        }
    return true;
}

/* ---- >>horn-main ---------------------------------------------------------------------------------------------------- */

/* Those of the paper's tables that are asked for. */
static bool horn_tables(const arguments *given, pool *threads)
{
    static bool (*const tables[HORN_TABLE_COUNT])(horn *) = {
        [HORN_BUILD] = horn_build,     [HORN_RATES] = horn_rates,   [HORN_NODES] = horn_nodes,
        [HORN_BOUNCES] = horn_bounces, [HORN_FRAMES] = horn_frames, [HORN_SCALING] = horn_scaling
    };
    static const char *const words[HORN_TABLE_COUNT] = { HORN_TABLES(TABLE_WORD) };
    horn h;
    bool ok, any = false;
    int i;

    for (i = 0; i < HORN_TABLE_COUNT; i++) any = any || (i != HORN_SCALING && wants(given, "horn", words[i]));
    memset(&h, 0, sizeof h);
    h.a = with_defaults(given, HORN_SIZE, HORN_ROUNDS);
    h.threads = threads;
    h.fine = true;
    ok = !any || (buffers_alloc(&h.memory, (size_t)h.a.width * (size_t)h.a.height, false) && horn_load(&h));
    for (i = 0; i < HORN_TABLE_COUNT && ok; i++) {
        if (!wants(given, "horn", words[i])) continue;
        h.spread = 0;
        ok = tables[i](&h);
        if (ok && i == HORN_BOUNCES && h.a.svg && !horn_plot(&h)) h.fine = false;
        fflush(stdout);
    }
    horn_free(&h);
    return ok && h.fine;
}
