/* bench_gpu.h - bench --gpu: the kernels of rt_gpu.h beside bvh.stack in C, and programs for one scene beside general ones.
   Included by bench.c.    SPDX-License-Identifier: MIT OR Unlicense

   >>gpu-rows  >>gpu-device  >>gpu-measure  >>gpu-output  >>gpu-compare  >>gpu-tables

     rays       Those of bench.c. They and the hits stay on the device.
     time       What the device says that it was at a kernel, once a round; the rounds are C, row, row ... C, row, row ... C traces each
                k-th run of 16384 rays where there are more than a million.
     first call Seconds of the first trace of primary rays less those of the kernel: compiled, since each run gives the compiler another
                definition, but with --cached; and in another context, which finds what the driver has kept.
     checks     Hits are overwritten before each row's first trace, and then compared with rt_trace's, bit for bit. */

#define GPU_ROUNDS 20                       /* of a GPU, where --repeat does not say; others have SPEED_ROUNDS */
#define GPU_ROWS 128
#define GPU_SAMPLE ((size_t)1 << 20)        /* rays that C traces at least, where there are as many */

enum { GPU_COLD, GPU_CACHED, GPU_CALLS };

/* An algorithm on the device. */
typedef struct {
    const rt_algorithm_info *info;
    rt_structure structure;
    rt_trace_options options;
    rt_gpu_kernel kernel;
    char problem[sizeof((rt_error *)0)->message];       /* why there is no number; else empty */
    double first[GPU_CALLS];
    double seconds[MAX_ROUNDS];             /* by round, of the kind at hand */
    double rates[KIND_COUNT], spreads[KIND_COUNT];      /* Mrays/s; 0: none */
} gpu_row;

/* A context, and what it holds. */
typedef struct {
    rt_gpu *gpu;
    rt_gpu_accel *accels[RT_STRUCTURE_COUNT];
    rt_gpu_buffer *rays, *hits;
} gpu_side;

typedef struct {
    bench s;
    const arguments *a;
    pool *threads;
    rt_gpu_info device;
    unsigned run;                           /* a number that no other run has */
    gpu_row *rows;
    size_t row_count;
    size_t counts[KIND_COUNT];              /* rays */
    double base[KIND_COUNT];                /* Mrays/s of bvh.stack in C */
    bool same;
} gpu_bench;

/* ---- >>gpu-rows ----------------------------------------------------------------------------------------------------- */

/* An entry for what C traces; its hits go where *b says. */
static entry gpu_entry(const rt_accel *accel, rt_algorithm algorithm, const batch *b)
{
    entry e;
    memset(&e, 0, sizeof e);
    e.accel = accel;
    e.options.algorithm = algorithm;
    e.options.query = b->query;
    e.trace = our_trace;
    return e;
}

/* What every row must find. */
static void gpu_truth(const gpu_bench *g, const rt_accel *accel, const batch *b, rt_hit *hits)
{
    const entry e = gpu_entry(accel, RT_AUTO, b);
    batch all = *b;
    all.hits = hits;
    all.seconds = 0;
    measure(&e, &all, g->threads);
}

/* The rays that C traces: all, or each k-th CHUNK, in memory of its own. False: out of memory. */
static bool gpu_sample(const batch *b, batch *sample, rt_ray **memory)
{
    const size_t step = b->count / GPU_SAMPLE;
    size_t first;

    *sample = *b;
    *memory = NULL;
    if (step < 2) return true;
    *memory = malloc((b->count / step + CHUNK) * sizeof **memory);
    if (!*memory) return complain("out of memory");
    sample->rays = *memory;
    sample->count = 0;
    for (first = 0; first + CHUNK <= b->count; first += step * CHUNK, sample->count += CHUNK)
        memcpy(*memory + sample->count, b->rays + first, CHUNK * sizeof **memory);
    return true;
}

static bool gpu_add_row(gpu_bench *g, const rt_algorithm_info *info, rt_structure structure, int packet)
{
    gpu_row *row = &g->rows[g->row_count];

    if (g->row_count == GPU_ROWS) return complain("more than %d rows", GPU_ROWS);
    memset(row, 0, sizeof *row);
    row->info = info;
    row->structure = structure;
    row->options.algorithm = info->algorithm;
    row->options.packet_width = packet;
    row->options.cull = info->culls ? (rt_cull)g->a->cull : RT_CULL_NONE;
    row->options.short_stack = g->a->short_stack;
    g->row_count++;
    return true;
}

/* A row for each algorithm that is asked for and has kernels, on each structure that it runs on, with each packet width. auto only
   where it is named, being another row once more. */
static bool gpu_add_rows(gpu_bench *g)
{
    const arguments *a = g->a;
    const bool all = strcmp(a->algorithms, "all") == 0;
    const rt_algorithm_info *info;
    size_t i, k;
    int structure;

    for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++) {
        int widths[MAX_WIDTHS], none[1] = { 0 };
        const size_t known = rt_gpu_widths(info->algorithm, widths, MAX_WIDTHS);
        if (!listed(a->algorithms, info->name) || (all && info->algorithm == RT_AUTO)) continue;
        if (!known && info->algorithm != RT_AUTO) {
            if (!all) return complain("%s has no kernel", info->name);
            continue;
        }
        for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) {
            const bool each = a->packet == ALL_PACKETS && known;
            const int *list = each || a->packet > 0 ? widths : none;
            if (info->structure != RT_STRUCTURE_COUNT && (int)info->structure != structure) continue;
            if (a->structure != RT_STRUCTURE_COUNT && a->structure != structure) continue;
            if (!structure_built((rt_structure)structure)) continue;
            for (k = 0; k < (list == widths ? known : 1); k++)
                if ((each || list == none || list[k] == a->packet) && !gpu_add_row(g, info, (rt_structure)structure, list[k])) return false;
        }
    }
    return g->row_count || complain("no algorithm asked for has kernels, or packets of that width");
}

static bool gpu_needs(const gpu_bench *g, rt_structure structure)
{
    size_t i;
    for (i = 0; i < g->row_count; i++)
        if (g->rows[i].structure == structure) return true;
    return false;
}

/* ---- >>gpu-device --------------------------------------------------------------------------------------------------- */

static bool gpu_open(const arguments *a, bool general, unsigned run, rt_gpu **out)
{
    rt_gpu_options options;
    rt_error error;
    char flags[64];

    memset(&options, 0, sizeof options);
    snprintf(flags, sizeof flags, "-DRT_BENCH_RUN=%u", run);
    options.device = a->device;
    options.general = general;
    options.flags = flags;
    options.error = &error;
    return rt_gpu_open(out, &options) == RT_OK || complain("--gpu: %s", error.message);
}

/* Rows of a structure that cannot be there have that problem. */
static void gpu_upload(gpu_bench *g, gpu_side *side, rt_accel *const *accels)
{
    rt_error error;
    int structure;
    size_t i;

    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) {
        if (!gpu_needs(g, (rt_structure)structure)) continue;
        if (rt_gpu_upload(side->gpu, &side->accels[structure], accels[structure], &error) == RT_OK) continue;
        for (i = 0; i < g->row_count; i++)
            if ((int)g->rows[i].structure == structure) snprintf(g->rows[i].problem, sizeof g->rows[i].problem, "%s", error.message);
    }
}

/* A context with the accels and room for a ray a pixel. *side is to be closed in any case. */
static bool gpu_fill_side(gpu_bench *g, gpu_side *side, bool general, rt_accel *const *accels)
{
    const size_t pixels = (size_t)g->a->width * (size_t)g->a->height;
    rt_error error;

    memset(side, 0, sizeof *side);
    if (!gpu_open(g->a, general, g->run, &side->gpu)) return false;
    gpu_upload(g, side, accels);
    return (rt_gpu_buffer_new(side->gpu, &side->rays, pixels * sizeof(rt_ray), &error) == RT_OK &&
            rt_gpu_buffer_new(side->gpu, &side->hits, pixels * sizeof(rt_hit), &error) == RT_OK) ||
           complain("--gpu: %s: a smaller --size may do", error.message);
}

static bool gpu_send_rays(const gpu_side *side, const batch *b)
{
    rt_error error;
    return rt_gpu_write(side->rays, 0, b->rays, b->count * sizeof *b->rays, &error) == RT_OK || complain("--gpu: %s", error.message);
}

/* One trace of count rays; false: row->problem tells why not. */
static bool gpu_trace(const gpu_side *side, gpu_row *row, rt_query query, size_t count, double *seconds)
{
    rt_trace_options options = row->options;
    rt_gpu_event *event;
    rt_error error;

    memset(&error, 0, sizeof error);
    options.query = query;
    options.error = &error;
    *seconds = 0;
    if (rt_gpu_trace_buffers(side->gpu, side->accels[row->structure], &options, side->rays, NULL, count, side->hits, &event) == RT_OK &&
        rt_gpu_wait(event, seconds, &error) == RT_OK) {
        if (*seconds > 0) return true;
        snprintf(error.message, sizeof error.message, "the device does not tell how long it was at it");
    }
    snprintf(row->problem, sizeof row->problem, "%s", error.message);
    return false;
}

/* The first call of each row, and which kernel it is. */
static void gpu_first_calls(gpu_bench *g, const gpu_side *side, const batch *b, int call)
{
    size_t i;
    for (i = 0; i < g->row_count; i++) {
        gpu_row *row = &g->rows[i];
        double seconds, start = now();
        if (row->problem[0] || !gpu_trace(side, row, b->query, b->count, &seconds)) continue;
        row->first[call] = now() - start - seconds;
        rt_gpu_get_kernel(side->gpu, side->accels[row->structure], &row->options, &row->kernel);
    }
}

/* ---- >>gpu-measure -------------------------------------------------------------------------------------------------- */

/* Traces once, untimed, and compares. *same becomes false where a hit differs. */
static void gpu_check(const gpu_side *side, gpu_row *row, const batch *b, bool *same)
{
    const size_t bytes = b->count * sizeof *b->hits;
    rt_error error;
    double seconds;
    size_t i, differ = 0, first = 0;

    memset(b->hits, 0xa5, bytes);
    if (row->problem[0]) return;
    if (rt_gpu_write(side->hits, 0, b->hits, bytes, &error) != RT_OK || !gpu_trace(side, row, b->query, b->count, &seconds) ||
        rt_gpu_read(side->hits, 0, b->hits, bytes, &error) != RT_OK) {
        if (!row->problem[0]) snprintf(row->problem, sizeof row->problem, "%s", error.message);
        return;
    }
    for (i = b->count; i-- > 0;)
        if (memcmp(&b->hits[i], &b->truth[i], sizeof *b->hits) != 0) differ++, first = i;
    if (!differ) return;
    *same = complain("%s, packet %d, on %s finds %zu of %zu %s hits that differ: at ray %zu C has prim %u, t %a, u %a, v %a; it has prim %u, t %a, u "
                     "%a, v %a", row->info->name, row->kernel.packet_width, structure_names[row->structure], differ, b->count, b->label, first,
                     b->truth[first].prim, (double)b->truth[first].t, (double)b->truth[first].u, (double)b->truth[first].v,
                     b->hits[first].prim, (double)b->hits[first].t, (double)b->hits[first].u, (double)b->hits[first].v);
    snprintf(row->problem, sizeof row->problem, "%zu of %zu %s hits differ", differ, b->count, b->label);
}

static void gpu_note_rate(gpu_row *row, const batch *b, int rounds)
{
    const double middle = median(row->seconds, rounds);
    if (row->problem[0]) return;
    row->rates[b->kind] = (double)b->count / middle * 1e-6;
    row->spreads[b->kind] = (row->seconds[rounds - 1] - row->seconds[0]) / middle;
}

/* One kind of rays: truth, checks, rounds. */
static bool gpu_measure(gpu_bench *g, const gpu_side *side, const batch *b)
{
    const rt_accel *accel = g->s.accels[RT_BVH];
    const int rounds = g->a->rounds;
    double base[MAX_ROUNDS];
    batch sample;
    rt_ray *memory;
    entry c;
    size_t i;
    int round;

    g->counts[b->kind] = b->count;
    if (!b->count) return true;
    gpu_truth(g, accel, b, g->s.memory->truth);
    if (!gpu_send_rays(side, b)) return false;
    for (i = 0; i < g->row_count; i++) gpu_check(side, &g->rows[i], b, &g->same);
    if (!gpu_sample(b, &sample, &memory)) return false;
    c = gpu_entry(accel, RT_BVH_STACK, b);
    c.options.isa = (rt_isa)g->a->isa;
    for (round = 0; round < rounds; round++) {
        base[round] = measure(&c, &sample, g->threads);
        for (i = 0; i < g->row_count; i++)
            if (!g->rows[i].problem[0]) gpu_trace(side, &g->rows[i], b->query, b->count, &g->rows[i].seconds[round]);
    }
    g->base[b->kind] = (double)sample.count / median(base, rounds) * 1e-6;
    for (i = 0; i < g->row_count; i++) gpu_note_rate(&g->rows[i], b, rounds);
    free(memory);
    return true;
}

/* ---- >>gpu-output --------------------------------------------------------------------------------------------------- */

static void gpu_print_json_line(const gpu_bench *g, const gpu_row *row, ray_kind kind)
{
    const rt_structure structure = row ? row->structure : RT_BVH;
    const rt_geometry *geometry = &g->s.content.geometry;
    const double rate = row ? row->rates[kind] : g->base[kind];
    rt_info built;

    rt_get_info(g->s.accels[structure], &built);
    begin_json(NULL, g->s.content.name);
    printf(",\"primitives\":%zu,\"structure\":\"%s\",\"algorithm\":\"%s\",\"packet\":%d,\"cull\":\"%s\",\"rays\":\"%s\",\"threads\":%d,\"device\":",
           geometry->triangle_count + geometry->sphere_count, structure_names[structure], row ? row->info->name : "bvh.stack",
           row ? row->kernel.packet_width : 1, cull_names[row ? row->options.cull : RT_CULL_NONE], kind_names[kind],
           pool_threads(g->threads));
    if (row) print_json_string(g->device.name);
    else printf("null");
    if (rate > 0) printf(",\"mrays_per_s\":%.4f,\"x_bvh_stack\":%.4f", rate, rate / g->base[kind]);
    else printf(",\"mrays_per_s\":null,\"x_bvh_stack\":null");
    printf(",\"nodes_per_ray\":null,\"boxes_per_ray\":null,\"prims_per_ray\":null,\"build_s\":%.6f,\"bytes\":%zu",
           g->s.build_seconds[structure], built.bytes);
    if (row) printf(",\"spread\":%.4f,\"compile_s\":%.4f,\"cached_s\":%.4f,\"problem\":", row->spreads[kind], row->first[GPU_COLD], row->first[GPU_CACHED]);
    if (row && row->problem[0]) print_json_string(row->problem);
    else if (row) printf("null");
    printf("}\n");
}

static void gpu_print_json(const gpu_bench *g)
{
    size_t i;
    int kind;
    for (kind = 0; kind < KIND_COUNT; kind++) {
        if (!g->counts[kind]) continue;
        gpu_print_json_line(g, NULL, (ray_kind)kind);
        for (i = 0; i < g->row_count; i++) gpu_print_json_line(g, &g->rows[i], (ray_kind)kind);
    }
}

/* What a row is of: the columns that all tables begin with. */
static void gpu_print_name(const gpu_row *row)
{
    printf("  %-19s %-8s %2d %-7s", row->info->name, structure_names[row->structure],
           row->kernel.packet_width ? row->kernel.packet_width : row->options.packet_width,
           row->info->culls ? cull_names[row->options.cull] : "");
}

static void gpu_print_rate(double rate, double base)
{
    if (rate > 0) printf(" %9.2f %6.2f", rate, base > 0 ? rate / base : 0);
    else printf(" %9s %6s", "-", "");
}

static void gpu_print_table(const gpu_bench *g)
{
    double spread = 0;
    size_t i;
    int kind;

    printf("%-41s", "Mrays/s, x bvh.stack in C");
    for (kind = 0; kind < KIND_COUNT; kind++)
        if (g->counts[kind]) printf(" %16s", kind_names[kind]);
    printf("   first call, s\n%-41s", "  algorithm           on  packet cull");
    for (kind = 0; kind < KIND_COUNT; kind++)
        if (g->counts[kind]) printf(" %11zu rays", g->counts[kind]);
    printf("  compiled cached\n  %-39s", "bvh.stack in C");
    for (kind = 0; kind < KIND_COUNT; kind++)
        if (g->counts[kind]) gpu_print_rate(g->base[kind], g->base[kind]);
    printf("\n");
    for (i = 0; i < g->row_count; i++) {
        const gpu_row *row = &g->rows[i];
        gpu_print_name(row);
        if (row->problem[0]) {
            printf("  %s\n", row->problem);
            continue;
        }
        for (kind = 0; kind < KIND_COUNT; kind++) {
            if (g->counts[kind]) gpu_print_rate(row->rates[kind], g->base[kind]);
            spread = fmax(spread, row->spreads[kind]);
        }
        if (g->a->cached) printf(" %9s", "-");
        else printf(" %9.3f", row->first[GPU_COLD]);
        printf(" %6.3f\n", row->first[GPU_CACHED]);
    }
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * spread);
}

/* The row of an algorithm with packets of that width, if it has been measured on primary rays; else NULL. */
static const gpu_row *gpu_find(const gpu_bench *g, rt_algorithm algorithm, int packet)
{
    size_t i;
    for (i = 0; i < g->row_count; i++)
        if (g->rows[i].info->algorithm == algorithm && g->rows[i].kernel.packet_width == packet && g->rows[i].rates[PRIMARY] > 0)
            return &g->rows[i];
    return NULL;
}

/* Do the steps of Table 2 of Horn et al. gain one after the other, as they do there? With its packets of 2x2, and with single rays. */
static void gpu_print_horn(const gpu_bench *g)
{
    static const struct { const char *label; rt_algorithm algorithm; int packet; } steps[] = {
        { "restart", RT_KD_RESTART, 1 },           { "packets", RT_KD_RESTART, 2 },  { "push-down", RT_KD_PUSHDOWN, 2 },
        { "short-stack", RT_KD_SHORTSTACK, 2 },    { "restart", RT_KD_RESTART, 1 },  { "push-down", RT_KD_PUSHDOWN, 1 },
        { "short-stack", RT_KD_SHORTSTACK, 1 },
    };
    static const struct { const char *title; int first, last; } orders[] = { { "packets of 2x2", 0, 4 }, { "single rays", 4, 7 } };
    int order, i;

    for (order = 0; order < 2; order++) {
        bool rises = true, whole = true;
        for (i = orders[order].first; i < orders[order].last; i++) whole = whole && gpu_find(g, steps[i].algorithm, steps[i].packet);
        if (!whole) continue;
        printf("  Horn et al., Table 2, primary, %s:", orders[order].title);
        for (i = orders[order].first; i < orders[order].last; i++) {
            const double rate = gpu_find(g, steps[i].algorithm, steps[i].packet)->rates[PRIMARY];
            if (i > orders[order].first) {
                const bool rise = rate > gpu_find(g, steps[i - 1].algorithm, steps[i - 1].packet)->rates[PRIMARY];
                printf(rise ? " <" : " >");
                rises = rises && rise;
            }
            printf(" %s %.2f", steps[i].label, rate);
        }
        printf(rises ? ": holds\n" : ": does not hold\n");
    }
}

/* The rate of rt_gpu_trace, which copies rays there and hits back, of the row that is best on primary rays. */
static void gpu_print_whole(const gpu_bench *g, const gpu_side *side)
{
    const size_t count = g->counts[PRIMARY];
    const gpu_row *best = NULL;
    double seconds[3];
    size_t i;

    for (i = 0; i < g->row_count; i++)
        if (g->rows[i].rates[PRIMARY] > (best ? best->rates[PRIMARY] : 0)) best = &g->rows[i];
    if (!best) return;
    for (i = 0; i < 4; i++) {               /* the first makes buffers */
        const double start = now();
        if (rt_gpu_trace(side->gpu, side->accels[best->structure], &best->options, g->s.memory->primary, count, g->s.memory->hits) != RT_OK) return;
        if (i) seconds[i - 1] = now() - start;
    }
    printf("  rt_gpu_trace, copies and all: %.2f Mrays/s, primary, %s\n", 1e-6 * (double)count / median(seconds, 3), best->info->name);
}

/* What a ray costs in memory: bytes of what it reads; how fast memory is. *b is made of rays that miss. */
static void gpu_print_memory(gpu_bench *g, const gpu_side *side)
{
    const size_t count = (size_t)g->a->width * (size_t)g->a->height, bytes = sizeof(rt_ray) + sizeof(rt_hit);
    const rt_geometry *geometry = &g->s.content.geometry;
    const double primitives = fmax(1, (double)(geometry->triangle_count + geometry->sphere_count));
    rt_ray *rays = g->s.memory->rays;
    gpu_row *row = NULL;
    double seconds, best = HUGE_VAL, start, up, down;
    rt_info built;
    rt_error error;
    size_t i;
    int structure, round;

    printf("  bytes: node of bvh.stack %zu, of bvh.wide %zu for 8 children, of kd %zu, of threaded %zu; triangle %zu, sphere %zu; ray %zu, hit %zu\n",
           sizeof(rti_node), g->device.gpu ? sizeof(rti_gpu_compact) : sizeof(rti_wide), sizeof(rti_kdnode), sizeof(rti_node) + sizeof(rti_link),
           sizeof(rti_triangle), sizeof(rti_ball), sizeof(rt_ray), sizeof(rt_hit));
    printf("  bytes a primitive on the device:");
    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++)
        if (side->accels[structure]) printf(" %s %.1f", structure_names[structure], (double)rt_gpu_bytes(side->accels[structure]) / primitives);
    rt_get_info(g->s.accels[RT_BVH], &built);
    for (i = 0; i < count; i++) {           /* from beyond the upper corner of what there is, away from it */
        rays[i].org = vec(2 * built.upper.x - built.lower.x + 1, 2 * built.upper.y - built.lower.y + 1, 2 * built.upper.z - built.lower.z + 1);
        rays[i].dir = vec(1, 1, 1);
        rays[i].tmin = 0;
        rays[i].tmax = INFINITY;
    }
    start = now();
    if (rt_gpu_write(side->rays, 0, rays, count * sizeof *rays, &error) != RT_OK) return;
    up = now() - start;
    for (i = 0; i < g->row_count && !row; i++)
        if (g->rows[i].structure == RT_BVH && !g->rows[i].problem[0]) row = &g->rows[i];
    for (round = 0; row && round < g->a->rounds; round++)
        if (gpu_trace(side, row, RT_CLOSEST, count, &seconds)) best = fmin(best, seconds);
    start = now();
    if (rt_gpu_read(side->hits, 0, g->s.memory->hits, count * sizeof(rt_hit), &error) != RT_OK) return;
    down = now() - start;
    printf("\n  copies: to the device %.2f GB/s, back %.2f GB/s", 1e-9 * (double)(count * sizeof *rays) / up,
           1e-9 * (double)(count * sizeof(rt_hit)) / down);
    if (row && best < HUGE_VAL) printf("; rays that miss all, %s: %.0f Mrays/s, %.1f GB/s of rays and hits", row->info->name,
                                       1e-6 * (double)count / best, 1e-9 * (double)(count * bytes) / best);
    printf("\n");
    gpu_print_whole(g, side);
}

/* ---- >>gpu-compare -------------------------------------------------------------------------------------------------- */

enum { COMPARE_TRIANGLES, COMPARE_SPHERES, COMPARE_INSTANCES, COMPARE_SCENES };
enum { COMPARE_BALLS = 64, COMPARE_COPIES = 8 };

/* What is compared: the triangles of a scene; with its spheres, or some small ones; eight copies of it, the first where it was. */
typedef struct {
    rt_geometry geometry[COMPARE_SCENES];
    rt_sphere balls[COMPARE_BALLS];
    rt_instance copies[COMPARE_COPIES];
    rt_accel *accels[COMPARE_SCENES][RT_STRUCTURE_COUNT];
} gpu_scenes;

static bool gpu_build_scenes(gpu_bench *g, gpu_scenes *scenes)
{
    const rt_geometry *content = &g->s.content.geometry;
    const rt_vec3 none = vec(0, 0, 0);
    rt_info built;
    rt_vec3 size;
    int structure, i, scene_index;

    memset(scenes, 0, sizeof *scenes);
    if (!content->triangle_count) return complain("--compare: %s has no triangles", g->s.content.name);
    scenes->geometry[COMPARE_TRIANGLES] = scenes->geometry[COMPARE_SPHERES] = *content;
    scenes->geometry[COMPARE_TRIANGLES].sphere_count = 0;
    rt_get_info(g->s.accels[RT_BVH], &built);
    size = sub(built.upper, built.lower);
    for (i = 0; i < COMPARE_BALLS; i++) {
        const uint32_t n = 3 * (uint32_t)i;
        scenes->balls[i].center = vec(built.lower.x + hashed(n) * size.x, built.lower.y + hashed(n + 1) * size.y,
                                      built.lower.z + hashed(n + 2) * size.z);
        scenes->balls[i].radius = 0.01f * length(add_scaled(none, size, 1));
    }
    if (!content->sphere_count) {
        scenes->geometry[COMPARE_SPHERES].spheres = scenes->balls;
        scenes->geometry[COMPARE_SPHERES].sphere_count = COMPARE_BALLS;
    }
    scenes->geometry[COMPARE_INSTANCES].instances = scenes->copies;
    scenes->geometry[COMPARE_INSTANCES].instance_count = COMPARE_COPIES;
    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) {
        if (structure != RT_BVH && !gpu_needs(g, (rt_structure)structure)) continue;
        for (scene_index = 0; scene_index < COMPARE_SCENES; scene_index++) {
            rt_error error;
            const rt_build_options options = build_options((rt_structure)structure, g->a, g->threads, &error);
            for (i = 0; i < COMPARE_COPIES; i++) {
                float *m = scenes->copies[i].transform;
                scenes->copies[i].accel = scenes->accels[COMPARE_TRIANGLES][structure];
                memset(m, 0, sizeof scenes->copies[i].transform);
                m[0] = m[5] = m[10] = 1;
                m[3] = i & 1 ? 1.1f * size.x : 0;
                m[7] = i & 2 ? 1.1f * size.y : 0;
                m[11] = i & 4 ? 1.1f * size.z : 0;
            }
            if (rt_build(&scenes->accels[scene_index][structure], &scenes->geometry[scene_index], &options) != RT_OK)
                return complain("%s: %s", g->s.content.name, error.message);
        }
    }
    return true;
}

static void gpu_free_scenes(gpu_scenes *scenes)
{
    int i, structure;
    for (i = COMPARE_SCENES; i-- > 0;)
        for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++) rt_free(scenes->accels[i][structure]);
}

static void gpu_print_compared(const gpu_bench *g, const gpu_row *special, const gpu_row *general, const char *what)
{
    static const ray_kind kinds[] = { PRIMARY, DIFFUSE };
    const char *problem = special->problem[0] ? special->problem : general->problem;
    size_t i;

    if (g->a->json) {
        begin_json("gpu.compare", g->s.content.name);
        printf(",\"with\":\"%s\",\"structure\":\"%s\",\"algorithm\":\"%s\",\"packet\":%d,\"device\":", what, structure_names[special->structure],
               special->info->name, special->kernel.packet_width);
        print_json_string(g->device.name);
        for (i = 0; i < 2; i++)
            printf(",\"%s_mrays_per_s\":%.4f,\"%s_general_mrays_per_s\":%.4f", kind_names[kinds[i]], special->rates[kinds[i]],
                   kind_names[kinds[i]], general->rates[kinds[i]]);
        printf(",\"compile_s\":%.4f,\"general_compile_s\":%.4f,\"private\":%zu,\"general_private\":%zu,\"local\":%zu,\"general_local\":%zu,"
               "\"group\":%zu,\"general_group\":%zu,\"problem\":", special->first[GPU_COLD], general->first[GPU_COLD],
               special->kernel.private_bytes, general->kernel.private_bytes, special->kernel.local_bytes, general->kernel.local_bytes,
               special->kernel.group, general->kernel.group);
        if (problem[0]) print_json_string(problem);
        else printf("null");
        printf("}\n");
        return;
    }
    gpu_print_name(special);
    if (problem[0]) {
        printf("  %s%s\n", special->problem[0] ? "" : "general: ", problem);
        return;
    }
    for (i = 0; i < 2; i++) printf(" %8.2f %8.2f %5.2f", special->rates[kinds[i]], general->rates[kinds[i]], special->rates[kinds[i]] / general->rates[kinds[i]]);
    printf(" %7.3f %7.3f %6zu %6zu %5zu %5zu %5zu %5zu\n", special->first[GPU_COLD], general->first[GPU_COLD], special->kernel.private_bytes,
           general->kernel.private_bytes, special->kernel.local_bytes, general->kernel.local_bytes, special->kernel.group, general->kernel.group);
}

/* Both programs of each row on one of the scenes, in turns; primary and diffuse rays of the triangles alone. */
static bool gpu_compare_scene(gpu_bench *g, const gpu_scenes *scenes, int scene_index, const char *what)
{
    rt_accel *const *accels = scenes->accels[scene_index];
    gpu_row *rows[2], *const own = g->rows;
    gpu_side sides[2];
    bool fine = true;
    int kind, side, round;
    size_t i;

    memset(sides, 0, sizeof sides);
    rows[0] = malloc(GPU_ROWS * sizeof *rows[0]), rows[1] = malloc(GPU_ROWS * sizeof *rows[1]);
    fine = (rows[0] && rows[1]) || complain("out of memory");
    for (side = 0; fine && side < 2; side++) {
        g->rows = memcpy(rows[side], own, GPU_ROWS * sizeof *own);
        for (i = 0; i < g->row_count; i++) g->rows[i].problem[0] = '\0';
        fine = gpu_fill_side(g, &sides[side], side == 1, accels);
    }
    for (kind = PRIMARY; fine && kind < KIND_COUNT; kind++) {
        batch b;
        if (kind != PRIMARY && kind != DIFFUSE) continue;
        b = make_batch(&g->s, (ray_kind)kind, g->a);
        if (!b.count) continue;
        gpu_truth(g, accels[RT_BVH], &b, g->s.memory->truth);
        for (side = 0; fine && side < 2; side++) {
            g->rows = rows[side];
            fine = gpu_send_rays(&sides[side], &b);
            if (fine && kind == PRIMARY) gpu_first_calls(g, &sides[side], &b, GPU_COLD);
            for (i = 0; fine && i < g->row_count; i++) gpu_check(&sides[side], &g->rows[i], &b, &g->same);
        }
        for (round = 0; fine && round < g->a->rounds; round++)
            for (i = 0; i < g->row_count; i++)
                for (side = 0; side < 2; side++)
                    if (!rows[side][i].problem[0]) gpu_trace(&sides[side], &rows[side][i], b.query, b.count, &rows[side][i].seconds[round]);
        for (i = 0; fine && i < g->row_count; i++)
            for (side = 0; side < 2; side++) gpu_note_rate(&rows[side][i], &b, g->a->rounds);
    }
    g->rows = own;
    if (fine && !g->a->json) printf(" %s\n", what);
    for (i = 0; fine && i < g->row_count; i++) gpu_print_compared(g, &rows[0][i], &rows[1][i], what);
    for (side = 0; side < 2; side++) rt_gpu_close(sides[side].gpu);
    free(rows[0]), free(rows[1]);
    return fine;
}

/* Programs compiled for the scene beside those for any. */
static bool gpu_compare(gpu_bench *g)
{
    static const char *const what[COMPARE_SCENES] = { "triangles", "triangles and spheres", "instances" };
    gpu_scenes scenes;
    batch primary;
    bool fine = gpu_build_scenes(g, &scenes);
    int i;

    if (fine) {
        const rt_geometry whole = g->s.content.geometry;
        g->s.content.geometry = scenes.geometry[COMPARE_TRIANGLES];     /* whose surfaces the diffuse rays start from */
        primary = make_batch(&g->s, PRIMARY, g->a);
        gpu_truth(g, scenes.accels[COMPARE_TRIANGLES][RT_BVH], &primary, g->s.memory->primary_hits);
        if (!g->a->json)
            printf("programs for the scene beside general ones, which many scenes share; Mrays/s, seconds of the first call, bytes, work-items\n"
                   "                                           primary  general     x  diffuse  general     x compiled general private,gen. local,gen.  "
                   "group,gen.\n");
        for (i = 0; fine && i < COMPARE_SCENES; i++) fine = gpu_compare_scene(g, &scenes, i, what[i]);
        g->s.content.geometry = whole;
    }
    gpu_free_scenes(&scenes);
    return fine;
}

/* ---- >>gpu-tables --------------------------------------------------------------------------------------------------- */

static void gpu_print_scene(const gpu_bench *g)
{
    const rt_geometry *geometry = &g->s.content.geometry;
    printf("\n%s: %zu triangles, %zu spheres; %dx%d, median of %d\n%s (%s), %u units; beside it C on %d thread%s\n", g->s.content.name,
           geometry->triangle_count, geometry->sphere_count, g->a->width, g->a->height, g->a->rounds, g->device.name, g->device.platform,
           (unsigned)g->device.units, pool_threads(g->threads), pool_threads(g->threads) == 1 ? "" : "s");
}

/* The table of all rows. */
static bool gpu_speed(gpu_bench *g)
{
    gpu_side side;
    bool fine = true;
    int call, kind;
    const batch primary = make_batch(&g->s, PRIMARY, g->a);

    memset(&side, 0, sizeof side);
    gpu_truth(g, g->s.accels[RT_BVH], &primary, g->s.memory->primary_hits);
    for (call = g->a->cached ? GPU_CACHED : GPU_COLD; fine && call < GPU_CALLS; call++) {
        rt_gpu_close(side.gpu);
        fine = gpu_fill_side(g, &side, false, g->s.accels) && gpu_send_rays(&side, &primary);
        if (fine) gpu_first_calls(g, &side, &primary, call);
    }
    for (kind = 0; fine && kind < KIND_COUNT; kind++)
        if (listed(g->a->rays, kind_names[kind])) {
            const batch b = make_batch(&g->s, (ray_kind)kind, g->a);
            fine = gpu_measure(g, &side, &b);
        }
    if (fine && g->a->json) gpu_print_json(g);
    if (fine && !g->a->json) {
        gpu_print_table(g);
        gpu_print_horn(g);
        gpu_print_memory(g, &side);
    }
    rt_gpu_close(side.gpu);
    return fine;
}

/* g->s is to be freed in any case. */
static bool gpu_scene(gpu_bench *g, const char *name)
{
    scene_error error;
    int structure;

    if (!scene_load(&g->s.content, name, NULL, NULL, &error)) return complain("%s", error.message);
    aim(&g->s.content, g->a);
    g->row_count = 0;
    if (!gpu_add_rows(g)) return false;
    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++)
        if ((structure == RT_BVH || gpu_needs(g, (rt_structure)structure)) && !build(&g->s, (rt_structure)structure, g->a, g->threads)) return false;
    make_primary(&g->s.content.camera, g->a->width, g->a->height, g->s.memory->primary);
    if (!g->a->json) gpu_print_scene(g);
    return g->a->compare ? gpu_compare(g) : gpu_speed(g);
}

/* Which devices there are. */
static bool gpu_list(void)
{
    rt_gpu_info infos[64];
    rt_error error;
    size_t count, i;

    if (rt_gpu_list(infos, 64, &count, &error) != RT_OK) return complain("%s", error.message);
    for (i = 0; i < count && i < 64; i++)
        printf("%zu  %s, %s (%s): %s, %u units, %.1f GB, %.1f GB in one piece%s%s\n", i, infos[i].gpu ? "GPU" : "CPU", infos[i].name,
               infos[i].platform, infos[i].version, (unsigned)infos[i].units, 1e-9 * (double)infos[i].memory,
               1e-9 * (double)infos[i].largest, infos[i].usable ? "" : "; it ", infos[i].lacks);
    return true;
}

static bool gpu_tables(const arguments *given, pool *threads)
{
    const size_t defaults = sizeof default_scenes / sizeof *default_scenes, count = given->scene_count ? given->scene_count : defaults;
    arguments a = *given;
    buffers memory;
    gpu_bench *g;
    rt_gpu *gpu;
    bool fine;
    size_t i;

    if (!gpu_open(&a, false, 0, &gpu)) return false;
    g = calloc(1, sizeof *g);
    if (g) {
        rt_gpu_get_info(gpu, &g->device);
        g->rows = calloc(GPU_ROWS, sizeof *g->rows);
        a = with_defaults(given, SPEED_SIZE, g->device.gpu ? GPU_ROUNDS : SPEED_ROUNDS);
        g->a = &a;
        g->threads = threads;
        g->run = a.cached ? 0 : (unsigned)time(NULL);
        g->same = true;
    }
    rt_gpu_close(gpu);
    fine = buffers_alloc(&memory, (size_t)a.width * (size_t)a.height, false) && ((g && g->rows) || complain("out of memory"));
    for (i = 0; fine && i < count; i++) {
        memset(&g->s, 0, sizeof g->s);
        memset(g->counts, 0, sizeof g->counts);
        g->s.memory = &memory;
        fine = gpu_scene(g, a.scene_count ? a.scenes[i] : default_scenes[i]);
        bench_free(&g->s);
        fflush(stdout);
    }
    fine = fine && g->same;
    buffers_free(&memory);
    if (g) free(g->rows);
    free(g);
    return fine;
}
