/* accuracy.c - how near the hits of rt.h are to the truth, and what each way to find them costs.    accuracy --help tells all.
   cc -O2 accuracy.c -o accuracy -lm -lpthread -ldl

   >>ways  >>peers  >>measure  >>rows  >>output  >>main                                   SPDX-License-Identifier: MIT OR Unlicense

   The truth is found apart from rt.h, see accuracy_truth.h; what is traced with what stands in the table of accuracy_suites.h. Each way must
   find a hit where there is one, none where there is none, on the right primitive, unless rays that are as near as rounding may move them
   disagree. All ways must find the same bits; and those must be what the library's own tests of all primitives, alone, say (>>rule). */

#define _POSIX_C_SOURCE 200809L
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"
#include "../examples/pool.h"
#include "../examples/scene.h"

#ifdef RT_BENCH_EMBREE
#include <embree3/rtcore.h>
#endif
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static bool complain(const char *format, ...)
{
    va_list arguments;

    fputs("accuracy: ", stderr);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return false;
}

static void *need(size_t count, size_t size)
{
    void *memory = calloc(count ? count : 1, size);

    if (!memory) {
        complain("out of memory");
        exit(EXIT_FAILURE);
    }
    return memory;
}

static double seconds_now(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

#include "accuracy_truth.h"
#include "accuracy_suites.h"

/* ---- >>ways --------------------------------------------------------------------------------------------------------- */

typedef enum { OURS, DEVICE, PEER } kind;

typedef struct way {
    char name[64];
    kind kind;
    rt_structure structure;                 /* of ours */
    rt_trace_options options;
    bool usual;                             /* the first of all, and each algorithm's default width, without culling, on the best
                                               instruction set */
    void (*trace)(const suite *s, const struct way *w, const rt_ray *rays, size_t count, rt_hit *hits);
} way;

enum { MAX_WAYS = 512 };
static way ways[MAX_WAYS];
static size_t way_count;

static void trace_ours(const suite *s, const way *w, const rt_ray *rays, size_t count, rt_hit *hits)
{
    if (rt_trace(s->accels[w->structure], &w->options, rays, count, hits) != RT_OK) {
        complain("%s: refused", w->name);
        exit(EXIT_FAILURE);
    }
}

static void trace_device(const suite *s, const way *w, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rt_trace_options options = w->options;
    rt_error error;

    options.error = &error;
    if (rt_gpu_trace(s->gpu, s->there[w->structure], &options, rays, count, hits) != RT_OK) {
        complain("%s: %s", w->name, error.message);
        exit(EXIT_FAILURE);
    }
}

#define NAME_OF(name, text) text,
static const char *const structure_names[] = { RT_STRUCTURE_LIST(NAME_OF) };
static const char *const cull_names[] = { RT_CULL_LIST(NAME_OF) };
static const char *const isa_names[] = { RT_ISA_LIST(NAME_OF) };

static way *add_way(kind k, rt_structure structure, void (*trace)(const suite *, const way *, const rt_ray *, size_t, rt_hit *))
{
    way *w = &ways[way_count++];

    if (way_count == MAX_WAYS) {
        complain("more than %d ways", MAX_WAYS);
        exit(EXIT_FAILURE);
    }
    memset(w, 0, sizeof *w);
    w->kind = k;
    w->structure = structure;
    w->trace = trace;
    return w;
}

/* What packet_width 0 means, see rt_trace_options. */
static int usual_width(const rt_algorithm_info *info, const int *widths, size_t count)
{
    return info->culls && info->algorithm != RT_AUTO ? 16 : info->algorithm == RT_THREADED_PARALLEL ? 8 : count ? widths[count - 1] : 0;
}

static void add_algorithm(const suite *s, const rt_algorithm_info *info, bool device)
{
    int widths[16], structure, cull, isa;
    const size_t count = device ? rt_gpu_widths(info->algorithm, widths, COUNT(widths))
                                : rt_packet_widths(info->algorithm, widths, COUNT(widths));
    size_t i;

    for (structure = 0; structure < RT_STRUCTURE_COUNT; structure++)
        for (i = 0; i < count; i++)
            for (cull = 0; cull < (info->culls ? RT_CULL_COUNT : 1); cull++)
                for (isa = 0; isa < (device ? 1 : RT_ISA_COUNT); isa++) {
                    rt_trace_options o;
                    way *w;

                    if (info->structure != RT_STRUCTURE_COUNT && (int)info->structure != structure) continue;
                    memset(&o, 0, sizeof o);
                    o.algorithm = info->algorithm;
                    o.packet_width = widths[i];
                    o.cull = (rt_cull)cull;
                    o.isa = (rt_isa)isa;
                    if (!device && rt_trace(s->accels[structure], &o, NULL, 0, NULL) != RT_OK) continue;
                    if (isa && rt_best_isa() == (rt_isa)isa) continue;      /* that is auto */
                    w = add_way(device ? DEVICE : OURS, (rt_structure)structure, device ? trace_device : trace_ours);
                    w->options = o;
                    w->usual = way_count == 1 || (widths[i] == usual_width(info, widths, count) && !cull && !isa);
                    snprintf(w->name, sizeof w->name, "%s%s:%d%s%s%s%s%s%s", device ? "device " : "", info->name, widths[i],
                             info->structure == RT_STRUCTURE_COUNT ? " " : "",
                             info->structure == RT_STRUCTURE_COUNT ? structure_names[structure] : "",
                             cull ? " " : "", cull ? cull_names[cull] : "", isa ? " " : "", isa ? isa_names[isa] : "");
                }
}

/* ---- >>peers -------------------------------------------------------------------------------------------------------- */

/* As many write it (Moeller and Trumbore 1997): in floats, with an epsilon, boxes as they are. */
static void trace_moeller(const suite *s, const way *w, const rt_ray *rays, size_t count, rt_hit *hits)
{
    const model *m = s->tree.m;
    size_t n;

    (void)w;
    for (n = 0; n < count; n++) {
        const float o[3] = { rays[n].org.x, rays[n].org.y, rays[n].org.z }, d[3] = { rays[n].dir.x, rays[n].dir.y, rays[n].dir.z };
        const double toward[3] = { (double)d[0], (double)d[1], (double)d[2] };
        const float inverse[3] = { 1 / d[0], 1 / d[1], 1 / d[2] };
        uint32_t stack[128], top = 0, i;
        rt_hit best = { INFINITY, 0, 0, RT_NONE, RT_NONE };

        stack[top++] = 0;
        while (top) {
            const box *b = &s->tree.boxes[stack[--top]];
            float from = 0, to = best.t;
            int k;

            for (k = 0; k < 3; k++) {
                const float a = ((float)b->low[k] - o[k]) * inverse[k], c = ((float)b->high[k] - o[k]) * inverse[k];
                from = fmaxf(from, fminf(a, c));
                to = fminf(to, fmaxf(a, c));
            }
            if (!(from <= to)) continue;
            if (!b->count) {
                const uint32_t near = nearer(&s->tree, b, toward);

                stack[top++] = 2 * b->child + 1 - near, stack[top++] = near;
            }
            for (i = 0; i < b->count; i++) {
                const uint32_t prim = s->tree.order[b->first + i];
                const float *p = m->vertices + 3 * (size_t)m->indices[3 * prim], *q = m->vertices + 3 * (size_t)m->indices[3 * prim + 1];
                const float *r = m->vertices + 3 * (size_t)m->indices[3 * prim + 2];
                const float e[3] = { q[0] - p[0], q[1] - p[1], q[2] - p[2] }, f[3] = { r[0] - p[0], r[1] - p[1], r[2] - p[2] };
                const float g[3] = { o[0] - p[0], o[1] - p[1], o[2] - p[2] };
                const float h[3] = { d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0] };
                const float l[3] = { g[1] * e[2] - g[2] * e[1], g[2] * e[0] - g[0] * e[2], g[0] * e[1] - g[1] * e[0] };
                const float det = e[0] * h[0] + e[1] * h[1] + e[2] * h[2];
                float t, u, v;

                if (fabsf(det) < 1e-8f) continue;
                u = (g[0] * h[0] + g[1] * h[1] + g[2] * h[2]) / det;
                v = (d[0] * l[0] + d[1] * l[1] + d[2] * l[2]) / det;
                t = (f[0] * l[0] + f[1] * l[1] + f[2] * l[2]) / det;
                if (!(u >= 0 && v >= 0 && u + v <= 1 && t > 0 && t < best.t)) continue;
                best.t = t, best.u = u, best.v = v, best.prim = prim;
            }
        }
        hits[n] = best;
    }
}

#ifdef RT_BENCH_EMBREE
static void trace_embree(const suite *s, const way *w, const rt_ray *rays, size_t count, rt_hit *hits)
{
    struct RTCIntersectContext context;
    size_t i;

    rtcInitIntersectContext(&context);
    for (i = 0; i < count; i++) {
        const float most = fmaxf(fabsf(rays[i].dir.x), fmaxf(fabsf(rays[i].dir.y), fabsf(rays[i].dir.z)));
        struct RTCRayHit r;

        memset(&r, 0, sizeof r);
        if (!(most < 1.8e18f)) {            /* those it takes for no rays, and ends the program at in some builds, count as missed */
            hits[i].prim = hits[i].inst = RT_NONE;
            continue;
        }
        r.ray.org_x = rays[i].org.x, r.ray.org_y = rays[i].org.y, r.ray.org_z = rays[i].org.z;
        r.ray.dir_x = rays[i].dir.x, r.ray.dir_y = rays[i].dir.y, r.ray.dir_z = rays[i].dir.z;
        r.ray.tnear = rays[i].tmin, r.ray.tfar = rays[i].tmax, r.ray.mask = ~0u;
        r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(s->scenes[w->structure], &context, &r);
        hits[i].t = r.ray.tfar, hits[i].u = r.hit.u, hits[i].v = r.hit.v, hits[i].inst = RT_NONE;
        hits[i].prim = r.hit.geomID == RTC_INVALID_GEOMETRY_ID ? RT_NONE : r.hit.primID;
    }
}

static RTCScene embree_scene(RTCDevice device, const model *m, bool robust)
{
    RTCScene made = rtcNewScene(device);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, m->vertex_count);
    void *indices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, m->triangle_count);

    if (!vertices || !indices) {
        complain("Embree fails");
        exit(EXIT_FAILURE);
    }
    memcpy(vertices, m->vertices, 12 * m->vertex_count);
    memcpy(indices, m->indices, 12 * m->triangle_count);
    rtcSetSceneFlags(made, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(made, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(made);
    return made;
}
#endif

/* ---- >>measure ------------------------------------------------------------------------------------------------------ */

/* An error, of t or of u and v: in units of the last place of what is true, beside it, and by itself. */
typedef struct { double ulp_most, ulp_sum, part_most, part_sum, most, sum; size_t parts; } losses;

/* Of hits on the right primitive: errors. lost: not what the rule says; see also faults. */
typedef struct { size_t rays, hits, missed, false_hits, wrong, excused, compared, lost; losses t, uv; faults faults; } score;

enum { CHUNK = 4096 };

typedef struct { suite *s; const way *w; rt_hit *hits; score *scores; size_t count; } job;

/* What the rule picks, and its place as it truly is. */
static truth truth_by_rule(const suite *s, const rt_ray *ray, const rt_hit *rule)
{
    truth t = { false, 0, 0, 0, 0, 0 };
    view v;

    if (rule->prim == RT_NONE) return t;
    v = view_in(s, rule->inst, ray);
    v.l.tmin = (double)rule->t - 1e-5 * fabs((double)rule->t);
    v.l.tmax = (double)rule->t + 1e-5 * fabs((double)rule->t);
    truth_of(v.tree->m, rule->prim, &v.l, &t);
    if (!t.hit) t.t = (double)rule->t, t.u = (double)rule->u, t.v = (double)rule->v;
    t.hit = true, t.prim = rule->prim, t.inst = rule->inst;
    return t;
}

static void find_truths(void *context, size_t chunk)
{
    suite *s = context;
    ruler *r = need(1, sizeof *r);
    size_t i;

    memset(&s->found[chunk], 0, sizeof s->found[chunk]);
    r->found = &s->found[chunk];
    for (i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < s->count; i++) {
        s->rules[i] = rule_find(s, &s->rays[i], r);
        s->truths[i] = s->by_rule ? truth_by_rule(s, &s->rays[i], &s->rules[i]) : suite_truth(s, &s->rays[i]);
        if (s->rules[i].inst != RT_NONE && is_astray(s, &s->rays[i], &s->rules[i])) r->found->astray++;
    }
    free(r);
}

static void trace_chunk(void *context, size_t chunk)
{
    const job *j = context;
    const size_t first = chunk * CHUNK, count = j->count - first < CHUNK ? j->count - first : CHUNK;

    j->w->trace(j->s, j->w, j->s->rays + first, count, j->hits + first);
}

static void add_error(losses *e, double is, double should)
{
    const double off = fabs(is - should), ulp = off / (fabs(should) < 0x1p-126 ? 0x1p-149 : ldexp(1, ilogb(should) - 23));

    e->most = fmax(e->most, off), e->sum += off;
    e->ulp_most = fmax(e->ulp_most, ulp), e->ulp_sum += ulp;
    if (should == 0) return;
    e->part_most = fmax(e->part_most, off / fabs(should)), e->part_sum += off / fabs(should);
    e->parts++;
}

static void sum_errors(losses *all, const losses *e)
{
    all->most = fmax(all->most, e->most), all->sum += e->sum;
    all->ulp_most = fmax(all->ulp_most, e->ulp_most), all->ulp_sum += e->ulp_sum;
    all->part_most = fmax(all->part_most, e->part_most), all->part_sum += e->part_sum;
    all->parts += e->parts;
}

static void judge(const suite *s, size_t i, const rt_hit *hit, bool peer, score *out)
{
    const truth *t = &s->truths[i];
    const bool found = hit->prim != RT_NONE, twin = found && hit->inst == RT_NONE && s->m.twin && hit->prim < s->m.triangle_count;

    out->rays++;
    out->hits += t->hit;
    out->lost += !peer && memcmp(hit, &s->rules[i], sizeof *hit) != 0;
    if (found != t->hit || (found && (hit->prim != t->prim || hit->inst != t->inst))) {
        bool excuse = false;

        if (!s->by_rule && legal(&s->rays[i]) && !(twin && s->m.twin[hit->prim] != hit->prim)) {
            const view at = view_in(s, found ? hit->inst : RT_NONE, &s->rays[i]), there = view_in(s, t->hit ? t->inst : RT_NONE, &s->rays[i]);
            excuse = excused(&at, hit, &there, t);
        }
        if (excuse) out->excused++;
        else if (!found) out->missed++;
        else if (!t->hit) out->false_hits++;
        else out->wrong++;
        return;
    }
    if (!found) return;
    out->compared++;
    add_error(&out->t, (double)hit->t, t->t);
    add_error(&out->uv, (double)hit->u, t->u);
    add_error(&out->uv, (double)hit->v, t->v);
}

static void judge_chunk(void *context, size_t chunk)
{
    const job *j = context;
    size_t i;

    for (i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < j->count; i++) judge(j->s, i, &j->hits[i], j->w->kind == PEER, &j->scores[chunk]);
}

static score judge_all(suite *s, const way *w, rt_hit *hits, size_t count, pool *threads)
{
    const size_t chunks = (count + CHUNK - 1) / CHUNK;
    job j = { s, w, hits, need(chunks, sizeof(score)), count };
    score all;
    size_t i;

    memset(&all, 0, sizeof all);
    pool_for(threads, chunks, judge_chunk, &j);
    for (i = 0; i < chunks; i++) {
        const score *part = &j.scores[i];
        all.rays += part->rays, all.hits += part->hits, all.missed += part->missed, all.false_hits += part->false_hits;
        all.wrong += part->wrong, all.excused += part->excused, all.compared += part->compared, all.lost += part->lost;
        sum_errors(&all.t, &part->t);
        sum_errors(&all.uv, &part->uv);
        if (w->kind == PEER) continue;
        all.faults.against_exact += s->found[i].against_exact, all.faults.astray += s->found[i].astray;
        all.faults.unpaired += s->found[i].unpaired, all.faults.clean += s->found[i].clean;
    }
    free(j.scores);
    return all;
}

/* How many rays a way traces. The usual ways: all. Peers, to excuse whose faults takes long: a quarter. Other widths, cullings and instruction
   sets, and devices, which may be this same processor: a sixteenth. */
static size_t share(const suite *s, const way *w)
{
    const size_t least = 8 * BLOCK;         /* with one thousand without order */
    const size_t part = s->count / (w->kind == PEER ? 4 : 16);

    if ((w->kind == OURS && w->usual) || s->count <= least) return s->count;
    return part > least ? part / least * least : least;
}

/* Nanoseconds a ray, on one thread: the best of three. Of these rays an eighth is without order. */
static double nanoseconds(const suite *s, const way *w, rt_hit *hits)
{
    const size_t count = s->count < 8 * BLOCK ? s->count : 8 * BLOCK;
    double best = HUGE_VAL;
    int round;

    for (round = 0; round < 3; round++) {
        const double start = seconds_now();

        w->trace(s, w, s->rays, count, hits);
        best = fmin(best, seconds_now() - start);
    }
    return 1e9 * best / (double)count;
}

/* ---- >>rows --------------------------------------------------------------------------------------------------------- */

/* What came of a way on a suite at a place. */
typedef struct { char suite[96]; const way *w; score s; bool same; double ns; } row;

/* A suite over its places: how many ways of ours found other bits; what the first of them, to which all are alike, and the peers make, in the
   order of ways, where they have traced; and how much longer than good rays bad ones took, where that was measured. */
enum { PEERS = 3 };
typedef struct { char suite[96]; size_t places, ways, differ; bool good; score ours, peers[PEERS]; double ns_least, ns_most, bad; } total;

static row *rows;
static total *totals;
static size_t row_count, row_room, total_count;

static void add_row(const suite *s, const way *w, const score *r, bool same, double ns)
{
    row *to;

    if (row_count == row_room) {
        row_room = row_room ? 2 * row_room : 4096;
        rows = realloc(rows, row_room * sizeof *rows);
        if (!rows) {
            complain("out of memory");
            exit(EXIT_FAILURE);
        }
    }
    to = &rows[row_count++];
    memcpy(to->suite, s->name, sizeof to->suite);
    to->w = w, to->s = *r, to->same = same, to->ns = ns;
}

static total *add_total(const char *name)
{
    total *to;

    totals = realloc(totals, (total_count + 1) * sizeof *totals);
    if (!totals) {
        complain("out of memory");
        exit(EXIT_FAILURE);
    }
    to = &totals[total_count++];
    memset(to, 0, sizeof *to);
    snprintf(to->suite, sizeof to->suite, "%s", name);
    to->good = true;
    to->ns_least = HUGE_VAL;
    return to;
}

static void add_score(score *all, const score *r)
{
    all->rays += r->rays, all->hits += r->hits, all->missed += r->missed, all->false_hits += r->false_hits, all->wrong += r->wrong;
    all->excused += r->excused, all->compared += r->compared, all->lost += r->lost;
    all->faults.against_exact += r->faults.against_exact, all->faults.astray += r->faults.astray;
    all->faults.unpaired += r->faults.unpaired, all->faults.clean += r->faults.clean;
    sum_errors(&all->t, &r->t);
    sum_errors(&all->uv, &r->uv);
}

/* ---- >>output ------------------------------------------------------------------------------------------------------- */

static double mean(double sum, size_t count) { return count ? sum / (double)count : 0; }

static void print_score(const char *name, const score *r, double ns)
{
    printf("  %-28s %8zu %8zu %8zu %8zu %10.3g %8.3f %10.3g", name, r->missed, r->false_hits, r->wrong, r->excused, r->t.ulp_most,
           mean(r->t.ulp_sum, r->compared), r->uv.most);
    if (ns > 0) printf(" %8.1f", ns);
    putchar('\n');
    if (r->lost) printf("  %zu hits are not what the library's own tests of all primitives say\n", r->lost);
    if (r->faults.against_exact) printf("  %zu tests of a primitive are wrong\n", r->faults.against_exact);
    if (r->faults.astray) printf("  %zu hits of instances are astray in the world\n", r->faults.astray);
    if (r->faults.unpaired) printf("  %zu lines leave a closed mesh not as often as they enter it\n", r->faults.unpaired);
}

static void write_errors(FILE *csv, const losses *e, size_t n)
{
    fprintf(csv, ",%.4g,%.4g,%.4g,%.4g,%.4g,%.4g", e->ulp_most, mean(e->ulp_sum, n), e->part_most, mean(e->part_sum, e->parts), e->most,
            mean(e->sum, n));
}

/* Through a file beside it, so that there is all of it or none. */
static bool write_rows(const char *path)
{
    char part[4096];
    FILE *csv;
    size_t i;

    snprintf(part, sizeof part, "%s.part", path);
    csv = fopen(part, "w");
    if (!csv) return complain("%s: %s", part, strerror(errno));
    fputs("suite,way,rays,hits,missed,false,wrong,excused,lost,compared,t_ulp_most,t_ulp_mean,t_relative_most,t_relative_mean,t_most,t_mean,"
          "uv_ulp_most,uv_ulp_mean,uv_relative_most,uv_relative_mean,uv_most,uv_mean,same_bits,ns\n", csv);
    for (i = 0; i < row_count; i++) {
        const score *r = &rows[i].s;

        fprintf(csv, "%s,%s,%zu,%zu,%zu,%zu,%zu,%zu,%zu,%zu", rows[i].suite, rows[i].w->name, r->rays, r->hits, r->missed, r->false_hits,
                r->wrong, r->excused, r->lost, r->compared);
        write_errors(csv, &r->t, r->compared);
        write_errors(csv, &r->uv, 2 * r->compared);
        fprintf(csv, ",%d,%.2f\n", rows[i].same, rows[i].ns);
    }
    if (fclose(csv) != 0 || rename(part, path) != 0) {
        complain("%s: %s", path, strerror(errno));
        remove(part);
        return false;
    }
    return true;
}

/* Whether write_rows will be able to; nothing is left. */
static bool can_write(const char *path)
{
    char part[4096];
    struct stat info;
    FILE *file;

    if (stat(path, &info) == 0 && S_ISDIR(info.st_mode)) return complain("%s: is a folder", path);
    if (snprintf(part, sizeof part, "%s.part", path) >= (int)sizeof part) return complain("%s: too long", path);
    file = fopen(part, "w");
    if (!file) return complain("%s: %s", path, strerror(errno));
    fclose(file);
    remove(part);
    return true;
}

#include "accuracy_images.h"
#include "accuracy_leave.h"
#include "accuracy_report.h"

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

typedef struct { size_t rays; bool quick, gpu; const char *output, *only, *report; } options;

static size_t passed, failed;

static double way_seconds[MAX_WAYS], truth_seconds, judge_seconds, ns_seconds, ray_seconds, build_seconds;

/* Bad rays must cost no more than 2.5 good ones, whatever is wrong with them: the best of several, good and bad by turns. */
static bool check_bad_times(suite *s, rt_hit *hits, double *worst)
{
    const size_t count = 4 * BLOCK;
    rt_ray *bad = need(count, sizeof *bad), *good = need(count, sizeof *good);
    bundle b;
    size_t i, k;
    bool fine = true;

    for (i = 0; i < count; i++) {
        if (i % BUNDLE == 0) start_bundle(s, true, &b);
        plain_ray(&b, AT_EDGES, &good[i]);
    }
    for (k = 0; k <= BADS; k++) {           /* the last: all kinds by turns */
        memcpy(bad, good, count * sizeof *bad);
        for (i = 0; i < count; i++) spoil(&bad[i], k < BADS ? (int)k : (int)(i % BADS));
        for (i = 0; i < way_count; i++) {
            const way *w = &ways[i];
            double best[2] = { HUGE_VAL, HUGE_VAL };
            int round, tries;

            if (w->kind != OURS || !w->usual) continue;
            for (tries = 0; tries < 3; tries++) {
                for (round = 0; round < 6; round++) {
                    const double start = seconds_now();

                    w->trace(s, w, round % 2 ? bad : good, count, hits);
                    best[round % 2] = fmin(best[round % 2], seconds_now() - start);
                }
                if (best[1] <= 2.5 * best[0]) break;    /* else it may have been something else on this machine */
            }
            *worst = fmax(*worst, best[1] / best[0]);
            if (best[1] > 2.5 * best[0]) {
                printf("  %s: bad rays of kind %zu take %.2f times as long as good ones\n", w->name, k, best[1] / best[0]);
                fine = false;
            }
        }
    }
    free(bad);
    free(good);
    return fine;
}

/* What peers take: bounds at floats of ours, and rays that are none, they are not given either. */
static bool is_mesh(const model *m) { return !m->sphere_count && !m->instance_count && !m->plane_count; }

/* All ways on one suite at one place. */
static void run_suite(suite *s, aim how, pool *threads, bool timed, total *sum)
{
    const size_t chunks = (s->count + CHUNK - 1) / CHUNK;
    const model *m = &s->m;
    const bool peers = !s->by_rule && how != BAD && is_mesh(m);
    rt_hit *first = need(s->count, sizeof *first), *hits = need(s->count, sizeof *hits);
    score ours, part, other;
    size_t i, differ = 0, same = 0, parted = 0, peer = 0;     /* part: of the first parted rays */
    double fastest = HUGE_VAL, slowest = 0, ns, start;

    start = seconds_now();
    s->found = need(chunks, sizeof *s->found);
    pool_for(threads, chunks, find_truths, s);
    truth_seconds += seconds_now() - start;
    memset(&ours, 0, sizeof ours);
    memset(&part, 0, sizeof part);
    for (i = 0; i < way_count; i++) {
        const way *w = &ways[i];
        rt_hit *to = i ? hits : first;
        const size_t count = share(s, w);
        job j = { s, w, to, NULL, count };

        if (w->kind == PEER && !peers) continue;
        start = seconds_now();
        memset(to, 0xcc, count * sizeof *to);
        if (w->kind == DEVICE) w->trace(s, w, s->rays, count, to);
        else pool_for(threads, (count + CHUNK - 1) / CHUNK, trace_chunk, &j);
        way_seconds[i] += seconds_now() - start;
        start = seconds_now();
        if (!i || w->kind == PEER || memcmp(first, to, count * sizeof *to) != 0) other = judge_all(s, w, to, count, threads);
        else if (count == s->count) other = ours;
        else {
            if (count != parted) part = judge_all(s, w, to, parted = count, threads);
            other = part;
        }
        judge_seconds += seconds_now() - start;
        start = seconds_now();
        if (w->kind == PEER) add_score(&sum->peers[peer++], &other);
        sum->ways += w->kind != PEER && !sum->places;
        if (!i) ours = other;
        ns = 0;
        if (w->kind == PEER || !i || memcmp(first, to, count * sizeof *to) != 0) {
            if (timed) ns = nanoseconds(s, w, to == first ? hits : to);
            if (!i) {
                printf("\n%s: %zu primitives, %zu rays, %zu hit\n  %-28s %8s %8s %8s %8s %10s %8s %10s %8s\n", s->name,
                       first_plane(m) + m->plane_count, s->count, ours.hits, "", "missed", "false", "wrong", "excused", "t: ulp, at", "mean",
                       "u, v: at", timed ? "ns" : "");
                printf("  %-28s %8s %8s %8s %8s %10s %8s %10s\n", "", "", "", "", "", "most", "", "most");
            } else differ += w->kind != PEER;
            print_score(w->name, &other, ns);
            add_row(s, w, &other, !i, ns);
        } else {
            if (timed && (w->usual || s->all_timed)) {
                ns = nanoseconds(s, w, hits);
                fastest = fmin(fastest, ns), slowest = fmax(slowest, ns);
            }
            same++;
            add_row(s, w, &other, true, ns);
        }
        ns_seconds += seconds_now() - start;
    }
    printf("  %zu more ways: the same bits", same);
    if (timed && same) printf(", %.1f to %.1f ns a ray", fastest, slowest);
    printf("%s\n", differ ? "; OTHERS DIFFER" : "");
    if (s->m.closed && ours.faults.clean)
        printf("  %zu lines pass no edge and leave as often as they enter\n", ours.faults.clean - ours.faults.unpaired);
    if (timed && how == BAD) {
        sum->good &= check_bad_times(s, hits, &sum->bad);
        printf("  bad rays take at most %.2f times as long as good ones\n", sum->bad);
    }
    add_score(&sum->ours, &ours);
    sum->differ += differ;
    sum->places++;
    sum->ns_least = fmin(sum->ns_least, fastest), sum->ns_most = fmax(sum->ns_most, slowest);
    sum->good &= !differ && !ours.missed && !ours.false_hits && !ours.wrong && !ours.lost && !ours.faults.against_exact && !ours.faults.astray &&
                 !ours.faults.unpaired;
    free(s->found);
    free(first);
    free(hits);
}

/* Where a BVH keeps its triangles and spheres. */
static uint32_t *slots_of(const rt_accel *accel)
{
    uint32_t *slots = need(accel->geo.triangle_count + accel->geo.sphere_count, sizeof *slots);
    size_t i;

    for (i = 0; i < accel->slots[RTI_TRIANGLE]; i++) slots[accel->triangles[i].prim] = (uint32_t)i;
    for (i = 0; i < accel->slots[RTI_SPHERE]; i++) slots[accel->balls[i].prim] = (uint32_t)i;
    return slots;
}

static bool build_accel(const suite *s, const model *m, rt_structure structure, pool *threads, rt_accel **out)
{
    rt_geometry geo;
    rt_build_options build;
    rt_error error;

    memset(&geo, 0, sizeof geo);
    memset(&build, 0, sizeof build);
    geo.vertices = m->vertices, geo.vertex_count = m->vertex_count;
    geo.indices = m->indices, geo.triangle_count = m->triangle_count;
    geo.spheres = m->spheres, geo.sphere_count = m->sphere_count;
    geo.instances = m->instances, geo.instance_count = m->instance_count;
    geo.planes = m->planes, geo.plane_count = m->plane_count;
    build.structure = structure;
    build.traversal_cost = m->traversal_cost;
    build.error = &error;
    build.parallel_for = pool_for;
    build.parallel_user = threads;
    return rt_build(out, &geo, &build) == RT_OK || complain("%s: %s", s->name, error.message);
}

static bool build_suite(suite *s, pool *threads)
{
    rt_error error;
    size_t i;
    int k;

    for (k = 0; k < RT_STRUCTURE_COUNT; k++) {
        if (s->m.child && !build_accel(s, s->m.child, (rt_structure)k, threads, &s->child_accels[k])) return false;
        for (i = 0; i < s->m.instance_count; i++) s->m.instances[i].accel = s->child_accels[k];
        if (!build_accel(s, &s->m, (rt_structure)k, threads, &s->accels[k])) return false;
        if (s->gpu && rt_gpu_upload(s->gpu, &s->there[k], s->accels[k], &error) != RT_OK) return complain("%s: %s", s->name, error.message);
    }
    truth_build(&s->tree, &s->m);
    s->slots = slots_of(s->accels[RT_BVH]);
    if (s->m.child) {
        truth_build(&s->child_tree, s->m.child);
        s->child_slots = slots_of(s->child_accels[RT_BVH]);
    }
    return true;
}

static void free_suite(suite *s)
{
    int k;

    for (k = 0; k < RT_STRUCTURE_COUNT; k++) {
        rt_gpu_free(s->there[k]);
        rt_free(s->accels[k]);
        rt_free(s->child_accels[k]);
    }
    truth_free(&s->tree);
    truth_free(&s->child_tree);
    model_free(&s->m);
    free(s->rays);
    free(s->truths);
    free(s->rules);
    free(s->slots);
    free(s->child_slots);
}

static void list_ways(const suite *s)
{
    const rt_algorithm_info *info;
    size_t i;
    int device;

    for (device = 0; device < (s->gpu ? 2 : 1); device++)
        for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++)
            if (info->algorithm != RT_AUTO && (device || info->built)) add_algorithm(s, info, device != 0);
    snprintf(add_way(PEER, RT_BVH, trace_moeller)->name, sizeof ways->name, "%s", "Moeller-Trumbore in floats");
#ifdef RT_BENCH_EMBREE
    snprintf(add_way(PEER, (rt_structure)0, trace_embree)->name, sizeof ways->name, "%s", "Embree");
    snprintf(add_way(PEER, (rt_structure)1, trace_embree)->name, sizeof ways->name, "%s", "Embree robust");
#endif
}

/* What the time went to, of the way that took most first: for who makes this cheaper. */
static void print_times(void)
{
    size_t i, j;

    printf("\nseconds: trees %.1f, rays %.1f, truth %.1f, judging %.1f, timing %.1f, and tracing:\n", build_seconds, ray_seconds, truth_seconds,
           judge_seconds, ns_seconds);
    for (i = 0; i < 20 && i < way_count; i++) {
        size_t most = 0;

        for (j = 1; j < way_count; j++)
            if (way_seconds[j] > way_seconds[most]) most = j;
        printf("  %-36s %8.2f\n", ways[most].name, way_seconds[most]);
        way_seconds[most] = -1;
    }
}

/* Over all suites, or those that peers have traced. */
static void print_sums(void)
{
    size_t i, j, peer = 0;

    printf("\n  %-28s %11s %8s %8s %8s %9s\n", "in all", "rays", "missed", "false", "wrong", "excused");
    for (i = 0; i < way_count; i++) {
        score all;

        if (i && ways[i].kind != PEER) continue;
        memset(&all, 0, sizeof all);
        for (j = 0; j < total_count; j++) add_score(&all, i ? &totals[j].peers[peer] : &totals[j].ours);
        peer += i != 0;
        printf("  %-28s %11zu %8zu %8zu %8zu %9zu\n", ways[i].name, all.rays, all.missed, all.false_hits, all.wrong, all.excused);
    }
}

/* One row of the table. False: it could not be made. */
static bool run_entry(const options *o, size_t entry, rt_gpu *gpu, void *embree, pool *threads)
{
    const size_t places = table[entry].place_count;
    size_t at, before = total_count, count, parts = 0;
    int how;

    for (how = 0; how < AIMS; how++)
        if (table[entry].aims >> how & 1) {
            char name[96];

            parts += places;
            snprintf(name, sizeof name, "%s; rays %s", table[entry].name, aim_names[how]);
            if (!o->only || strstr(name, o->only)) (void)add_total(name);
        }
    if (o->quick) parts = places;
    count = (o->rays + parts - 1) / parts;
    for (at = 0; at < places && total_count > before; at++) {
        const place *where = &table[entry].places[at];
        size_t next = before;
        double start = seconds_now();
        suite s;

        memset(&s, 0, sizeof s);
        snprintf(s.name, sizeof s.name, "%s%s", table[entry].name, where->name);
        s.gpu = gpu;
        random_seed = entry;
        table[entry].make(&s.m, o->quick);
        if (!s.m.vertex_count && !s.m.sphere_count && !s.m.instance_count) {
            if (!o->quick) printf("\n%s: no model in the folder; left out (RT_SCENES tells where)\n", table[entry].name);
            total_count = before;
            return true;
        }
        model_place(&s.m, where->scale, where->offset);
        if (!build_suite(&s, threads)) return false;
        if (!way_count) list_ways(&s);
#ifdef RT_BENCH_EMBREE
        for (how = 0; how < 2 && is_mesh(&s.m); how++) s.scenes[how] = embree_scene((RTCDevice)embree, &s.m, how != 0);
#endif
        build_seconds += seconds_now() - start;
        s.count = count;
        s.rays = need(s.count, sizeof *s.rays);
        s.truths = need(s.count, sizeof *s.truths);
        s.rules = need(s.count, sizeof *s.rules);
        for (how = 0; how < AIMS; how++) {
            char name[96];

            snprintf(name, sizeof name, "%s; rays %s", table[entry].name, aim_names[how]);
            if (!(table[entry].aims >> how & 1) || (o->only && !strstr(name, o->only))) continue;
            snprintf(s.name, sizeof s.name, "%s%s; rays %s", table[entry].name, where->name, aim_names[how]);
            random_seed = (uint64_t)(entry * 10000 + (size_t)how * 100) + at;
            s.all_timed = table[entry].aims == table[0].aims && places > 1;         /* the sphere and the torus: others' times tell no more */
            s.by_rule = how == BOUNDS || how == STEPS;
            start = seconds_now();
            make_rays(&s, (aim)how);
            ray_seconds += seconds_now() - start;
            run_suite(&s, (aim)how, threads, !o->quick && !at, &totals[next++]);    /* times of models as they are */
        }
#ifdef RT_BENCH_EMBREE
        for (how = 0; how < 2 && is_mesh(&s.m); how++) rtcReleaseScene(s.scenes[how]);
#endif
        free_suite(&s);
    }
    (void)embree;
    return true;
}

static bool run_all(const options *o, pool *threads, rt_gpu *gpu)
{
    size_t i, bad = 0, rays = 0;
    bool made = true;
    void *embree = NULL;

#ifdef RT_BENCH_EMBREE
    embree = rtcNewDevice("threads=1");
#endif
    for (i = 0; i < COUNT(table) && made; i++) made = run_entry(o, i, gpu, embree, threads);
#ifdef RT_BENCH_EMBREE
    rtcReleaseDevice((RTCDevice)embree);
#endif
    if (!made) return false;
    for (i = 0; i < total_count; i++) {
        rays += totals[i].ours.rays;
        bad += !totals[i].good;
        if (!totals[i].good) printf("\nFAILED: %s", totals[i].suite);
    }
    if (!total_count) return complain("no suite is called so");
    if (!o->quick) print_times();
    print_sums();
    printf("\n%zu suites, %zu rays\n", total_count, rays);
    passed += total_count - bad, failed += bad;
    return true;
}

static void expect(bool good, const char *what)
{
    if (good) passed++;
    else failed++, printf("FAILED: %s\n", what);
}

/* Rays that go on from hits: ours must do no wrong, and the others some, or it is not measured. */
static void run_leaving(const options *o, pool *threads, report *r)
{
    static leave_result results[32];
    size_t i;

    r->leaving = results;
    r->leaving_count = measure_leaving(threads, o->quick, results, COUNT(results));
    printf("\n%-110s %9s %8s\n", "rays that leave a surface", "rays", "wrong");
    for (i = 0; i < r->leaving_count; i++) {
        printf("%-110s %9llu %8llu\n", results[i].name, (unsigned long long)results[i].rays, (unsigned long long)results[i].wrong);
        expect(results[i].ours ? !results[i].wrong : results[i].wrong > 0, results[i].name);
    }
}

/* Pictures: slopes, estimates, and the same bits from all who trace them. */
static bool run_images(const options *o, pool *threads, rt_gpu *gpu, report *r)
{
    static image_study images;
    static refine_study refining;
    static way_times times;
    const int levels = o->quick ? 6 : LEVELS, last = levels - 1;
    size_t n;
    int which;

    if (!study_images(&images, levels, o->report, threads) || !study_refining(&refining, o->quick ? 32 : 128, o->quick, o->report, threads) ||
        !time_ways(&times, gpu)) return false;
    printf("\n%-16s %-13s %7s %12s %24s %13s %11s\n", "pictures", "sampler", "slope", "last error", "seconds to independent's", "times less",
           "of samples");
    for (n = 0; n < STAGES; n++)
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++) {
            const image_point *p = images.points[n][which], *plain = &images.points[n][RT_SAMPLER_INDEPENDENT][last];
            const double seconds = seconds_to(p, levels, plain->rmse, false), less = (1 << last) / seconds_to(p, levels, plain->rmse, true);

            printf("%-16s %-13s %7.3f %12.6f %24.4f %13.2f %11.2f\n", stage_kinds[n].name, sampler_names[which], images.slopes[n][which],
                   p[last].rmse, seconds, plain->seconds / seconds, less);
            if (which == RT_SAMPLER_INDEPENDENT) expect(fabs(images.slopes[n][which] + 0.5) < 0.03, "the slope of independent samples");
            else expect(images.slopes[n][which] < (which == RT_SAMPLER_SOBOL && !o->quick ? -0.6 : -0.51), "the slope of stratified samples");
            if (which == RT_SAMPLER_SOBOL && !o->quick) expect(less > 4, "four times less samples");
        }
    printf("\n%-16s %22s\n", "pictures", "adaptive: times less");
    for (n = 0; n < STAGES; n++) printf("%-16s %22.2f\n", stage_kinds[n].name, refining.gains[n]);
    printf("estimated over true errors: %.3f to %.3f\n", refining.least, refining.most);
    expect(refining.least > 1 / 1.5 && refining.most < 1.5, "estimated errors");
    expect(!times.differ, "who traces a picture changes it");
    r->images = &images;
    r->refining = &refining;
    r->times = &times;
    return true;
}

static const char usage[] =
    "usage: accuracy [--quick] [--gpu] [--rays N] [--only TEXT] [-o FILE.csv] [--report FOLDER]\n\n"
    "Compares the hits of every structure, algorithm, packet width, culling and instruction set with the truth, found in exact arithmetic;\n"
    "follows rays that leave a surface; and measures how far pictures with noise are from what they tend to.\n"
    "  --quick          small models, few samples, no times of hits\n"
    "  --gpu            the OpenCL device too\n"
    "  --rays N         a scene, over its suites and places (default 1000000); with --quick, a suite (default 1024)\n"
    "  --only TEXT      suites of hits with that in their name, and nothing else\n"
    "  -o FILE          a row for each way, suite and place\n"
    "  --report FOLDER  there: accuracy.csv, images.csv, plots and report.html, which holds all of it. References of pictures are kept there\n"
    "                   for the next time. Needs gnuplot\n\n"
    "All rays are traced by each algorithm in its default width; a quarter of them by peers, a sixteenth by other widths, cullings, instruction\n"
    "sets and by the device: the rays of a row tell. Seven eighths come in packets that suit large ones, the others without order.\n";

/* False: unknown, or it lacks its value. */
static bool set_option(options *o, const char *name, const char *value, int *taken)
{
    *taken = 1;
    if (strcmp(name, "--quick") == 0) return o->quick = true, o->rays = 1024, true;
    if (strcmp(name, "--gpu") == 0) return o->gpu = true;
    *taken = 2;
    if (!value) return false;
    if (strcmp(name, "--rays") == 0) return o->rays = (size_t)strtoul(value, NULL, 10), o->rays > 0;
    if (strcmp(name, "--only") == 0) return o->only = value, true;
    if (strcmp(name, "-o") == 0) return o->output = value, true;
    if (strcmp(name, "--report") == 0) return o->report = value, true;
    return false;
}

int main(int argc, char **argv)
{
    options o = { 1000000, false, false, NULL, NULL, NULL };
    const double start = seconds_now();
    rt_gpu_options open;
    rt_gpu_info info;
    rt_gpu *gpu = NULL;
    rt_error error;
    report r;
    pool *threads;
    bool good;
    int i, taken;

    for (i = 1; i < argc; i += taken)
        if (!set_option(&o, argv[i], i + 1 < argc ? argv[i + 1] : NULL, &taken)) {
            fputs(usage, stdout);
            return strcmp(argv[i], "--help") == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
        }
    setvbuf(stdout, NULL, _IOLBF, 0);
    memset(&r, 0, sizeof r);
    memset(&open, 0, sizeof open);
    open.general = true;
    open.error = &error;
    if (o.only && o.report) return complain("--only leaves out what a report tells"), EXIT_FAILURE;
    if ((o.output && !can_write(o.output)) || (o.report && !report_possible(o.report))) return EXIT_FAILURE;
    if (o.gpu && rt_gpu_open(&gpu, &open) != RT_OK) return complain("--gpu: %s", error.message), EXIT_FAILURE;
    threads = pool_create(0);
    if (!threads) return complain("cannot start the threads"), EXIT_FAILURE;
    if (gpu) {
        rt_gpu_get_info(gpu, &info);
        r.device = info.name;
    }
    good = run_all(&o, threads, gpu);
    if (good && !o.only) {
        run_leaving(&o, threads, &r);
        good = run_images(&o, threads, gpu, &r);
    }
    r.seconds = seconds_now() - start;
    r.threads = pool_threads(threads);
    if (o.output && !write_rows(o.output)) good = false;
    if (good && o.report && !report_write(o.report, &r)) good = false;
    if (good) printf("\n%zu passed, %zu failed, 0 skipped\n", passed, failed);
    if (r.images) free_images((image_study *)(uintptr_t)r.images);
    rt_gpu_close(gpu);
    pool_destroy(threads);
    free(rows);
    free(totals);
    return good && !failed ? EXIT_SUCCESS : EXIT_FAILURE;
}
