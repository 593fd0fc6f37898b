/* accuracy.c - how near the hits of rt.h are to the truth, and what each way to find them costs.    accuracy --help tells all.
   cc -O2 accuracy.c -o accuracy -lm -lpthread -ldl

   >>exact  >>models  >>rays  >>truth  >>ways  >>peers  >>measure  >>output  >>main         SPDX-License-Identifier: MIT OR Unlicense

   The truth is found apart from rt.h: boxes with wide margins in double, then signs and quotients of exact sums. Each way must find a hit
   where there is one, none where there is none, on the right primitive, unless rays that are as near as rounding may move them disagree. */

#define _POSIX_C_SOURCE 200809L
#define RT_IMPLEMENTATION
#include "../rt.h"
#define RT_GPU_IMPLEMENTATION
#include "../rt_gpu.h"
#include "../examples/pool.h"

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

/* ---- >>exact -------------------------------------------------------------------------------------------------------- */

/* A sum of doubles that do not overlap, by rising size (Shewchuk 1997); of none: 0. No bit is lost: coordinates are multiples of 2^-149 below
   2^60, directions below 2^100. So a volume, a product of two differences of coordinates and a direction or another difference, is a multiple
   of 2^-447 below 2^228: 675 bits at most, of which a double that does not overlap the next holds one or more; in fact each holds some 53, and
   so do all sums on the way. Products of two doubles end above 2^-1022, so that fma gives what they are rounded by, exactly. */
enum { TERMS = 256 };
typedef struct { int count; double x[TERMS]; } exact;

static void exact_add_double(exact *e, double b)
{
    int i, kept = 0;

    for (i = 0; i < e->count; i++) {        /* sum + error = b + x, exactly */
        const double a = e->x[i], sum = a + b, part = sum - a, error = (a - (sum - part)) + (b - part);
        if (error != 0) e->x[kept++] = error;
        b = sum;
    }
    if (b != 0) e->x[kept++] = b;
    e->count = kept;
}

static void exact_add(exact *e, const exact *b, int sign)
{
    int i;

    for (i = 0; i < b->count; i++) exact_add_double(e, sign * b->x[i]);
}

static void exact_product(const exact *a, const exact *b, exact *out)
{
    int i, j;

    out->count = 0;
    for (i = 0; i < a->count; i++)
        for (j = 0; j < b->count; j++) {
            const double high = a->x[i] * b->x[j];
            exact_add_double(out, fma(a->x[i], b->x[j], -high));
            exact_add_double(out, high);
        }
}

static exact exact_difference(double a, double b)
{
    exact e;

    e.count = 0;
    exact_add_double(&e, a);
    exact_add_double(&e, -b);
    return e;
}

static int exact_sign(const exact *e) { return !e->count ? 0 : e->x[e->count - 1] > 0 ? 1 : -1; }

/* Within 2 roundings of a double. */
static double exact_value(const exact *e)
{
    double sum = 0;
    int i;

    for (i = 0; i < e->count; i++) sum += e->x[i];
    return sum;
}

/* a . (b x c) */
static exact exact_volume(const exact a[3], const exact b[3], const exact c[3])
{
    exact sum, plane, product;
    int k;

    sum.count = 0;
    for (k = 0; k < 3; k++) {
        exact_product(&b[(k + 1) % 3], &c[(k + 2) % 3], &plane);
        exact_product(&b[(k + 2) % 3], &c[(k + 1) % 3], &product);
        exact_add(&plane, &product, -1);
        exact_product(&a[k], &plane, &product);
        exact_add(&sum, &product, 1);
    }
    return sum;
}

/* ---- >>models ------------------------------------------------------------------------------------------------------- */

typedef struct {
    char name[32];
    float *vertices;
    uint32_t *indices;
    size_t vertex_count, triangle_count;
    double center[3], radius;               /* around all of it */
} model;

static uint64_t random_seed;

static double unit(void)                    /* [0,1) */
{
    uint64_t x = random_seed += 0x9e3779b97f4a7c15u;

    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return (double)((x ^ x >> 31) >> 11) * 0x1p-53;
}

static void any_direction(double out[3])
{
    const double z = 2 * unit() - 1, turn = 6.283185307179586 * unit(), across = sqrt(1 - z * z);

    out[0] = across * cos(turn), out[1] = across * sin(turn), out[2] = z;
}

static void model_free(model *m)
{
    free(m->vertices);
    free(m->indices);
    memset(m, 0, sizeof *m);
}

/* The middle and the radius, once the vertices are there. */
static void model_measure(model *m)
{
    double low[3] = { HUGE_VAL, HUGE_VAL, HUGE_VAL }, high[3] = { -HUGE_VAL, -HUGE_VAL, -HUGE_VAL };
    size_t i;
    int k;

    for (i = 0; i < 3 * m->vertex_count; i++) {
        k = (int)(i % 3);
        low[k] = fmin(low[k], (double)m->vertices[i]);
        high[k] = fmax(high[k], (double)m->vertices[i]);
    }
    m->radius = 0;
    for (k = 0; k < 3; k++) {
        m->center[k] = (low[k] + high[k]) / 2;
        m->radius += (high[k] - low[k]) * (high[k] - low[k]) / 4;
    }
    m->radius = sqrt(m->radius);
}

/* A closed surface of columns x rows quads, each two triangles; point gives its vertices. rows wrap round where round is true; else the first
   and the last row of vertices are one point each. */
static void model_wrap(model *m, size_t columns, size_t rows, bool round, void (*point)(double u, double v, double out[3]))
{
    const size_t lines = round ? rows : rows + 1;
    size_t x, y;
    uint32_t *to;

    m->vertex_count = columns * lines;
    m->vertices = need(3 * m->vertex_count, sizeof *m->vertices);
    m->indices = to = need(6 * columns * rows, sizeof *m->indices);
    for (y = 0; y < lines; y++)
        for (x = 0; x < columns; x++) {
            double at[3];
            int k;

            point(!round && (y == 0 || y == rows) ? 0 : (double)x / (double)columns, (double)y / (double)rows, at);
            for (k = 0; k < 3; k++) m->vertices[3 * (y * columns + x) + (size_t)k] = (float)at[k];
        }
    for (y = 0; y < rows; y++)
        for (x = 0; x < columns; x++) {
            const size_t left = x, right = (x + 1) % columns, low = y * columns, high = (y + 1) % lines * columns;
            const uint32_t a = (uint32_t)(low + left), b = (uint32_t)(low + right), c = (uint32_t)(high + left), d = (uint32_t)(high + right);
            const bool first = !round && y == 0, last = !round && y + 1 == rows;

            if (!first) *to++ = a, *to++ = b, *to++ = d;            /* at a pole one of the two has no area */
            if (!last) *to++ = a, *to++ = d, *to++ = c;
        }
    m->triangle_count = (size_t)(to - m->indices) / 3;
    if (round) return;
    for (x = 0; x < 3 * m->triangle_count; x++) {                   /* poles are one vertex each */
        if (m->indices[x] < columns) m->indices[x] = 0;
        if (m->indices[x] >= columns * rows) m->indices[x] = (uint32_t)(columns * rows);
    }
}

static void on_sphere(double u, double v, double out[3])
{
    const double turn = 6.283185307179586 * u, across = sin(3.141592653589793 * v);

    out[0] = across * cos(turn), out[1] = cos(3.141592653589793 * v), out[2] = across * sin(turn);
}

static void on_torus(double u, double v, double out[3])
{
    const double turn = 6.283185307179586 * u, around = 6.283185307179586 * v, reach = 1 + 0.4 * cos(around);

    out[0] = reach * cos(turn), out[1] = 0.4 * sin(around), out[2] = reach * sin(turn);
}

/* Long and thin triangles: aspects of 1e3 to 1e9. */
static void model_slivers(model *m, size_t count)
{
    size_t i;
    int k;

    m->vertex_count = 3 * count;
    m->triangle_count = count;
    m->vertices = need(9 * count, sizeof *m->vertices);
    m->indices = need(3 * count, sizeof *m->indices);
    for (i = 0; i < count; i++) {
        const double thin = pow(10, -3 - 6 * unit());
        double along[3], across[3];

        any_direction(along);
        any_direction(across);
        for (k = 0; k < 3; k++) {
            float *v = m->vertices + 9 * i + k;
            v[0] = (float)(2 * unit() - 1);
            v[3] = (float)((double)v[0] + along[k]);
            v[6] = (float)((double)v[0] + 0.5 * along[k] + thin * across[k]);
        }
        for (k = 0; k < 3; k++) m->indices[3 * i + (size_t)k] = (uint32_t)(3 * i) + (uint32_t)k;
    }
}

/* Scaled, then moved. */
static void model_place(model *m, double scale, double offset)
{
    size_t i;

    for (i = 0; i < 3 * m->vertex_count; i++) m->vertices[i] = (float)((double)m->vertices[i] * scale + offset * (double)(1 + i % 3) / 2);
    model_measure(m);
}

/* ---- >>rays --------------------------------------------------------------------------------------------------------- */

typedef enum { AT_RANDOM, AT_EDGES, AT_VERTICES, ON_GRID, AIMS } aim;
static const char *const aim_names[AIMS] = { "random", "edges", "vertices", "grid" };

/* A point that a ray is aimed at, on a triangle by chance: anywhere, on an edge, or a corner. */
static void aim_at(const model *m, aim how, double at[3])
{
    const size_t i = (size_t)(unit() * (double)m->triangle_count);
    double w[3] = { unit(), unit(), 0 };
    const float *v[3];
    int k;

    for (k = 0; k < 3; k++) v[k] = m->vertices + 3 * (size_t)m->indices[3 * i + (size_t)k];
    if (how == AT_EDGES) w[1] = 1 - w[0];
    if (how == AT_VERTICES || how == ON_GRID) w[0] = 1, w[1] = 0;
    if (w[0] + w[1] > 1) w[0] = 1 - w[0], w[1] = 1 - w[1];
    w[2] = 1 - w[0] - w[1];
    for (k = 0; k < 3; k++) at[k] = w[0] * (double)v[0][k] + w[1] * (double)v[1][k] + w[2] * (double)v[2][k];
}

/* From around the model, or within it, towards points of it; on a grid: along an axis through a vertex. */
static void make_rays(const model *m, aim how, rt_ray *rays, size_t count)
{
    size_t i;
    int k;

    for (i = 0; i < count; i++) {
        double from[3], at[3];
        float org[3], dir[3];

        any_direction(from);
        for (k = 0; k < 3; k++) from[k] = m->center[k] + m->radius * (unit() < 0.25 ? 0.3 : 2.5) * from[k];
        if (how == AT_RANDOM) {
            any_direction(at);
            for (k = 0; k < 3; k++) at[k] = m->center[k] + m->radius * cbrt(unit()) * at[k];
        } else aim_at(m, how, at);
        for (k = 0; k < 3; k++) {
            org[k] = (float)from[k];
            dir[k] = (float)(at[k] - (double)org[k]);
        }
        if (how == ON_GRID) {
            const int axis = (int)(3 * unit());
            for (k = 0; k < 3; k++)
                if (k != axis) org[k] = (float)at[k], dir[k] = 0;
        }
        rays[i].org.x = org[0], rays[i].org.y = org[1], rays[i].org.z = org[2];
        rays[i].dir.x = dir[0], rays[i].dir.y = dir[1], rays[i].dir.z = dir[2];
        if (dir[0] == 0 && dir[1] == 0 && dir[2] == 0) rays[i].dir.x = 1;
        rays[i].tmin = 0;
        rays[i].tmax = INFINITY;
    }
}

/* ---- >>truth -------------------------------------------------------------------------------------------------------- */

/* A tree of the test's own: boxes of halves by the middle of the longest axis. */
typedef struct { double low[3], high[3]; uint32_t first, count, child; } box;       /* count 0: children child and child + 1 */

typedef struct {
    const model *m;
    box *boxes;
    uint32_t *order, box_count;
    double far;                             /* the largest coordinate */
} truth_tree;

static double corner(const model *m, uint32_t triangle, int which, int k)
{
    return (double)m->vertices[3 * (size_t)m->indices[3 * (size_t)triangle + (size_t)which] + (size_t)k];
}

static double middle(const model *m, uint32_t triangle, int k) { return corner(m, triangle, 0, k) + corner(m, triangle, 1, k) + corner(m, triangle, 2, k); }

static const model *sort_model;             /* of qsort, which has no context: trees are built by one thread */
static int sort_axis;

static int by_middle(const void *a, const void *b)
{
    const double x = middle(sort_model, *(const uint32_t *)a, sort_axis), y = middle(sort_model, *(const uint32_t *)b, sort_axis);

    return (x > y) - (x < y);
}

static void split_box(truth_tree *tree, uint32_t at)
{
    box *b = &tree->boxes[at];
    uint32_t i, half;
    int k, axis = 0;

    for (k = 0; k < 3; k++) {
        b->low[k] = HUGE_VAL, b->high[k] = -HUGE_VAL;
        for (i = b->first; i < b->first + b->count; i++) {
            int c;
            for (c = 0; c < 3; c++) {
                b->low[k] = fmin(b->low[k], corner(tree->m, tree->order[i], c, k));
                b->high[k] = fmax(b->high[k], corner(tree->m, tree->order[i], c, k));
            }
        }
        if (b->high[k] - b->low[k] > b->high[axis] - b->low[axis]) axis = k;
    }
    if (b->count <= 4) return;
    sort_model = tree->m, sort_axis = axis;
    qsort(tree->order + b->first, b->count, sizeof *tree->order, by_middle);
    half = b->count / 2;
    b->child = tree->box_count;
    tree->boxes[b->child].first = b->first, tree->boxes[b->child].count = half;
    tree->boxes[b->child + 1].first = b->first + half, tree->boxes[b->child + 1].count = b->count - half;
    b->count = 0;
    tree->box_count += 2;
    split_box(tree, tree->boxes[at].child);
    split_box(tree, tree->boxes[at].child + 1);
}

static void truth_build(truth_tree *tree, const model *m)
{
    uint32_t i;

    memset(tree, 0, sizeof *tree);
    tree->m = m;
    tree->boxes = need(2 * m->triangle_count, sizeof *tree->boxes);
    tree->order = need(m->triangle_count, sizeof *tree->order);
    for (i = 0; i < m->triangle_count; i++) tree->order[i] = i;
    tree->boxes[0].count = (uint32_t)m->triangle_count;
    tree->box_count = 1;
    split_box(tree, 0);
    for (i = 0; i < 3; i++) tree->far = fmax(tree->far, fmax(fabs(tree->boxes[0].low[i]), fabs(tree->boxes[0].high[i])));
}

static void truth_free(truth_tree *tree)
{
    free(tree->boxes);
    free(tree->order);
}

/* A ray; rough: beside one, its origin being no float, and what doubles tell of it is enough. */
typedef struct { double org[3], dir[3], tmin, tmax; bool rough; } line;
typedef struct { bool hit; uint32_t prim; double t, u, v; } truth;

/* a . (b x c) in doubles; *slack: more than what they lose. */
static double volume(const double a[3], const double b[3], const double c[3], double *slack)
{
    double sum = 0, size = 0;
    int k;

    for (k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        sum += a[k] * (b[k1] * c[k2] - b[k2] * c[k1]);
        size += fabs(a[k]) * (fabs(b[k1] * c[k2]) + fabs(b[k2] * c[k1]));
    }
    *slack = 1e-14 * size;
    return sum;
}

/* The same where bits count: the volumes beside the edges, their sum and the height, exactly. False: the line passes beside. */
static bool exact_triangle(const model *m, uint32_t triangle, const line *l, double edges[3], double *sum, double *height)
{
    exact p[3][3], d[3], edge, all;
    int i, k, positive = 0, negative = 0;

    for (k = 0; k < 3; k++) {
        d[k] = exact_difference(l->dir[k], 0);
        for (i = 0; i < 3; i++) p[i][k] = exact_difference(corner(m, triangle, i, k), l->org[k]);
    }
    all.count = 0;
    for (i = 0; i < 3; i++) {
        edge = exact_volume(d, p[(i + 1) % 3], p[(i + 2) % 3]);
        positive += exact_sign(&edge) > 0, negative += exact_sign(&edge) < 0;
        edges[i] = exact_value(&edge);
        exact_add(&all, &edge, 1);
    }
    if ((positive && negative) || (!positive && !negative)) return false;
    edge = exact_volume(p[0], p[1], p[2]);
    *height = exact_value(&edge);
    *sum = exact_value(&all);
    return true;
}

/* Whether the triangle, closed, is on the line, by signs of volumes; then t, u, v, by their quotients. Doubles do where all signs are sure and
   t is good to 1e-9 of its last place as a float. */
static void truth_triangle(const model *m, uint32_t triangle, const line *l, truth *best)
{
    double p[3][3], edges[3], slack[4], height, sum, t;
    int i, k, positive = 0, negative = 0;
    bool sure = true;

    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) p[i][k] = corner(m, triangle, i, k) - l->org[k];
    for (i = 0; i < 3; i++) {
        edges[i] = volume(l->dir, p[(i + 1) % 3], p[(i + 2) % 3], &slack[i]);
        positive += edges[i] > slack[i], negative += edges[i] < -slack[i];
        sure = sure && fabs(edges[i]) > slack[i];
    }
    if (positive && negative) return;
    height = volume(p[0], p[1], p[2], &slack[3]);
    sum = edges[0] + edges[1] + edges[2];
    sure = sure && slack[0] + slack[1] + slack[2] < 1e-11 * fabs(sum) && slack[3] < 1e-11 * fabs(height);
    if (l->rough) {
        if ((edges[0] > 0 || edges[1] > 0 || edges[2] > 0) && (edges[0] < 0 || edges[1] < 0 || edges[2] < 0)) return;
        if (sum == 0) return;
    } else if (!sure && !exact_triangle(m, triangle, l, edges, &sum, &height)) return;
    t = height / sum;
    if (!(t > l->tmin && t < l->tmax) || (best->hit && t >= best->t * (1 - 1e-15))) return;
    best->hit = true;
    best->prim = triangle;
    best->t = t;
    best->u = edges[1] / sum;
    best->v = edges[2] / sum;
}

static truth truth_find(const truth_tree *tree, const line *l)
{
    uint32_t stack[128], top = 0;
    truth best = { false, 0, 0, 0, 0 };
    const double pad = 1e-9 * (tree->far + fmax(fabs(l->org[0]), fmax(fabs(l->org[1]), fabs(l->org[2]))));

    stack[top++] = 0;
    while (top) {
        const box *b = &tree->boxes[stack[--top]];
        double from = l->tmin, to = best.hit ? best.t : l->tmax;
        bool met = true;
        uint32_t i;
        int k;

        for (k = 0; k < 3 && met; k++) {
            const double low = b->low[k] - pad - l->org[k], high = b->high[k] + pad - l->org[k], d = l->dir[k];
            if (d == 0) met = low <= 0 && high >= 0;
            else {
                from = fmax(from, (d > 0 ? low : high) / d);
                to = fmin(to, (d > 0 ? high : low) / d);
            }
        }
        if (!met || !(from <= to * (1 + 1e-12) + 1e-300)) continue;
        for (i = 0; i < b->count; i++) truth_triangle(tree->m, tree->order[b->first + i], l, &best);
        if (!b->count) stack[top++] = b->child, stack[top++] = b->child + 1;
    }
    return best;
}

static line line_of(const rt_ray *ray)
{
    const line l = { { (double)ray->org.x, (double)ray->org.y, (double)ray->org.z },
                     { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z }, (double)ray->tmin, (double)ray->tmax, false };
    return l;
}

/* How far rounding may move a ray aside of a triangle, see rti_prepare of rt.h: by 16 roundings of its farthest coordinate as seen from the
   ray's origin. */
static double drift(const truth_tree *tree, const line *l)
{
    double reach = 0;
    int k;

    for (k = 0; k < 3; k++) reach = fmax(reach, fmax(fabs(tree->boxes[0].low[k] - l->org[k]), fabs(tree->boxes[0].high[k] - l->org[k])));
    return 0x1p-20 * reach;
}

/* Two directions across a line's. */
static void across_line(const line *l, double out[2][3])
{
    const double length = sqrt(l->dir[0] * l->dir[0] + l->dir[1] * l->dir[1] + l->dir[2] * l->dir[2]);
    double rest = 0;
    int k, axis = 0;

    for (k = 1; k < 3; k++)
        if (fabs(l->dir[k]) < fabs(l->dir[axis])) axis = k;
    for (k = 0; k < 3; k++) {
        out[0][k] = (k == axis) - l->dir[axis] / length * l->dir[k] / length;
        rest += out[0][k] * out[0][k];
    }
    for (k = 0; k < 3; k++) out[0][k] /= sqrt(rest);
    for (k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        out[1][k] = (l->dir[k1] * out[0][k2] - l->dir[k2] * out[0][k1]) / length;
    }
}

/* How far a line passes a triangle, seen along it; 0: through it. */
static double distance(const model *m, uint32_t triangle, const line *l)
{
    double across[2][3], p[3][2], least = HUGE_VAL;
    int i, j, k, positive = 0, negative = 0;

    across_line(l, across);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 2; j++) {
            p[i][j] = 0;
            for (k = 0; k < 3; k++) p[i][j] += across[j][k] * (corner(m, triangle, i, k) - l->org[k]);
        }
    for (i = 0; i < 3; i++) {
        const double *a = p[i], *b = p[(i + 1) % 3], side[2] = { b[0] - a[0], b[1] - a[1] }, turn = a[0] * side[1] - a[1] * side[0];
        const double length = side[0] * side[0] + side[1] * side[1];
        double part = length > 0 ? -(a[0] * side[0] + a[1] * side[1]) / length : 0;

        positive += turn > 0, negative += turn < 0;
        part = fmin(fmax(part, 0), 1);
        least = fmin(least, hypot(a[0] + part * side[0], a[1] + part * side[1]));
    }
    return positive && negative ? least : 0;
}

/* Could rounding have led to that hit, or miss? The ray passes so near to the primitive; and what is true lies behind it, or is not there for
   one of 48 rays around: so at the rim of a closed mesh, but not where its triangles meet before the ray. */
static bool excused(const truth_tree *tree, const rt_ray *ray, const truth *t, const rt_hit *hit)
{
    const line straight = line_of(ray);
    const double away = drift(tree, &straight);
    double across[2][3];
    int i, k;

    if (hit->prim != RT_NONE) {
        if (distance(tree->m, hit->prim, &straight) > away) return false;
        if (!t->hit || (double)hit->t <= t->t * (1 + 1e-5)) return true;
    }
    across_line(&straight, across);
    for (i = 0; i < 48; i++) {
        const double turn = 0.39269908169872414 * i, part = away / (1 << i / 16 * 2);
        line aside = straight;
        truth other;

        aside.rough = true;
        for (k = 0; k < 3; k++) aside.org[k] += part * (cos(turn) * across[0][k] + sin(turn) * across[1][k]);
        other = truth_find(tree, &aside);
        if (!other.hit || (hit->prim != RT_NONE && (other.prim == hit->prim || other.t >= (double)hit->t * (1 - 1e-5)))) return true;
    }
    return false;
}

/* ---- >>ways --------------------------------------------------------------------------------------------------------- */

struct suite;


typedef enum { OURS, DEVICE, PEER } kind;

typedef struct way {
    char name[64];
    kind kind;
    rt_structure structure;                 /* of ours */
    rt_trace_options options;
    void (*trace)(const struct suite *s, const struct way *w, const rt_ray *rays, size_t count, rt_hit *hits);
} way;

/* A model with its rays, what is true of them, and what traces it. */
typedef struct suite {
    char name[96];
    model m;
    truth_tree tree;
    rt_ray *rays;
    truth *truths;
    size_t count;
    rt_accel *accels[RT_STRUCTURE_COUNT];
    rt_gpu *gpu;                            /* NULL: none */
    rt_gpu_accel *there[RT_STRUCTURE_COUNT];
#ifdef RT_BENCH_EMBREE
    RTCScene scenes[2];                     /* fast, robust */
#endif
} suite;

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

static void add_algorithm(const suite *s, const rt_algorithm_info *info, bool device)
{
    int widths[16], structure, cull, isa;
    const size_t count = device ? rt_gpu_widths(info->algorithm, widths, COUNT(widths)) : rt_packet_widths(info->algorithm, widths, COUNT(widths));
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
                    snprintf(w->name, sizeof w->name, "%s%s:%d%s%s%s%s%s%s", device ? "device " : "", info->name, widths[i],
                             info->structure == RT_STRUCTURE_COUNT ? " " : "", info->structure == RT_STRUCTURE_COUNT ? structure_names[structure] : "",
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
            if (!b->count) stack[top++] = b->child, stack[top++] = b->child + 1;
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
        struct RTCRayHit r;

        memset(&r, 0, sizeof r);
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
    RTCScene scene = rtcNewScene(device);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, m->vertex_count);
    void *indices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, m->triangle_count);

    if (!vertices || !indices) {
        complain("Embree fails");
        exit(EXIT_FAILURE);
    }
    memcpy(vertices, m->vertices, 12 * m->vertex_count);
    memcpy(indices, m->indices, 12 * m->triangle_count);
    rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene);
    return scene;
}
#endif

/* ---- >>measure ------------------------------------------------------------------------------------------------------ */

/* Of hits on the right primitive: errors of t in units of the last place, and of u and v. */
typedef struct { size_t rays, hits, missed, false_hits, wrong, excused, compared; double t_worst, t_sum, t_relative, uv_worst, uv_sum; } score;

enum { CHUNK = 4096 };

typedef struct { const suite *s; const way *w; rt_hit *hits; score *scores; } job;

static void find_truths(void *context, size_t chunk)
{
    suite *s = context;
    size_t i;

    for (i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < s->count; i++) {
        const line l = line_of(&s->rays[i]);
        s->truths[i] = truth_find(&s->tree, &l);
    }
}

static void trace_chunk(void *context, size_t chunk)
{
    const job *j = context;
    const size_t first = chunk * CHUNK, count = j->s->count - first < CHUNK ? j->s->count - first : CHUNK;

    j->w->trace(j->s, j->w, j->s->rays + first, count, j->hits + first);
}

static void judge(const suite *s, size_t i, const rt_hit *hit, score *out)
{
    const truth *t = &s->truths[i];
    const bool found = hit->prim != RT_NONE;
    double ulp, error, weight;

    out->rays++;
    out->hits += t->hit;
    if (found != t->hit || (found && hit->prim != t->prim)) {
        if (excused(&s->tree, &s->rays[i], t, hit)) out->excused++;
        else if (!found) out->missed++;
        else if (!t->hit) out->false_hits++;
        else out->wrong++;
        return;
    }
    if (!found) return;
    ulp = ldexp(1, ilogb(t->t) - 23);
    error = fabs((double)hit->t - t->t) / ulp;
    weight = fmax(fabs((double)hit->u - t->u), fabs((double)hit->v - t->v));
    out->compared++;
    out->t_worst = fmax(out->t_worst, error);
    out->t_sum += error;
    out->t_relative = fmax(out->t_relative, fabs((double)hit->t - t->t) / t->t);
    out->uv_worst = fmax(out->uv_worst, weight);
    out->uv_sum += weight;
}

static void judge_chunk(void *context, size_t chunk)
{
    const job *j = context;
    size_t i;

    for (i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < j->s->count; i++) judge(j->s, i, &j->hits[i], &j->scores[chunk]);
}

static score judge_all(const suite *s, const way *w, rt_hit *hits, pool *threads)
{
    const size_t chunks = (s->count + CHUNK - 1) / CHUNK;
    job j = { s, w, hits, need(chunks, sizeof(score)) };
    score all;
    size_t i;

    memset(&all, 0, sizeof all);
    pool_for(threads, chunks, judge_chunk, &j);
    for (i = 0; i < chunks; i++) {
        const score *part = &j.scores[i];
        all.rays += part->rays, all.hits += part->hits, all.missed += part->missed, all.false_hits += part->false_hits;
        all.wrong += part->wrong, all.excused += part->excused, all.compared += part->compared;
        all.t_worst = fmax(all.t_worst, part->t_worst), all.t_sum += part->t_sum, all.t_relative = fmax(all.t_relative, part->t_relative);
        all.uv_worst = fmax(all.uv_worst, part->uv_worst), all.uv_sum += part->uv_sum;
    }
    free(j.scores);
    return all;
}

/* Nanoseconds a ray, on one thread: the best of three. */
static double nanoseconds(const suite *s, const way *w, rt_hit *hits)
{
    const size_t count = s->count < 4 * CHUNK ? s->count : 4 * CHUNK;
    double best = HUGE_VAL;
    int round;

    for (round = 0; round < 3; round++) {
        const double start = seconds_now();

        w->trace(s, w, s->rays, count, hits);
        best = fmin(best, seconds_now() - start);
    }
    return 1e9 * best / (double)count;
}

/* ---- >>output ------------------------------------------------------------------------------------------------------- */

static void print_score(const char *name, const score *r, double ns)
{
    const double n = r->compared ? (double)r->compared : 1;

    printf("  %-28s %8zu %8zu %8zu %8zu %10.3g %8.3f %10.3g %8.1f\n", name, r->missed, r->false_hits, r->wrong, r->excused, r->t_worst, r->t_sum / n,
           r->uv_worst, ns);
}

static void write_row(FILE *csv, const suite *s, const way *w, const score *r, bool same, double ns)
{
    const double n = r->compared ? (double)r->compared : 1;

    if (!csv) return;
    fprintf(csv, "%s,%s,%zu,%zu,%zu,%zu,%zu,%zu,%.4g,%.4g,%.4g,%.4g,%.4g,%d,%.2f\n", s->name, w->name, r->rays, r->hits, r->missed, r->false_hits,
            r->wrong, r->excused, r->t_worst, r->t_sum / n, r->t_relative, r->uv_worst, r->uv_sum / n, same, ns);
}

/* How many rays a way traces: large packets, to which rays in any order are the hardest work, a sixteenth. */
static size_t share(const suite *s, const way *w)
{
    const bool large = w->kind == OURS && w->options.algorithm >= RT_BVH_MASKED && w->options.algorithm <= RT_BVH_PARTITION;

    return large && s->count > 16 * CHUNK ? s->count / 16 / CHUNK * CHUNK : s->count;
}

/* All ways on one suite. False: one of ours errs, or they differ. */
static bool run_suite(suite *s, pool *threads, FILE *csv, bool timed)
{
    const size_t chunks = (s->count + CHUNK - 1) / CHUNK;
    rt_hit *first = need(s->count, sizeof *first), *hits = need(s->count, sizeof *hits);
    score ours, other;
    size_t i, differ = 0, same = 0;
    double fastest = HUGE_VAL, slowest = 0, ns;
    bool good;

    pool_for(threads, chunks, find_truths, s);
    memset(&ours, 0, sizeof ours);
    for (i = 0; i < way_count; i++) {
        const way *w = &ways[i];
        rt_hit *to = i ? hits : first;
        const size_t count = share(s, w);
        job j = { s, w, to, NULL };

        memset(to, 0xcc, s->count * sizeof *to);
        if (w->kind == DEVICE) w->trace(s, w, s->rays, s->count, to);
        else pool_for(threads, (count + CHUNK - 1) / CHUNK, trace_chunk, &j);
        ns = timed ? nanoseconds(s, w, to) : 0;
        if (!i) {
            ours = judge_all(s, w, first, threads);
            printf("\n%s: %zu triangles, %zu rays, %zu hit\n  %-28s %8s %8s %8s %8s %10s %8s %10s %8s\n", s->name, s->m.triangle_count, s->count, ours.hits, "",
                   "missed", "false", "wrong", "excused", "t: ulp, at", "mean", "u, v: at", timed ? "ns" : "");
            printf("  %-28s %8s %8s %8s %8s %10s %8s %10s\n", "", "", "", "", "", "most", "", "most");
            print_score(w->name, &ours, ns);
            write_row(csv, s, w, &ours, true, ns);
        } else if (w->kind == PEER) {
            other = judge_all(s, w, hits, threads);
            print_score(w->name, &other, ns);
            write_row(csv, s, w, &other, false, ns);
        } else if (memcmp(first, hits, count * sizeof *hits) != 0) {
            other = judge_all(s, w, hits, threads);
            print_score(w->name, &other, ns);
            write_row(csv, s, w, &other, false, ns);
            differ++;
        } else {
            same++;
            fastest = fmin(fastest, ns);
            slowest = fmax(slowest, ns);
            write_row(csv, s, w, &ours, true, ns);
        }
    }
    printf("  %zu more ways: the same bits", same);
    if (timed && same) printf(", %.1f to %.1f ns a ray", fastest, slowest);
    printf("%s\n", differ ? "; OTHERS DIFFER" : "");
    good = !differ && !ours.missed && !ours.false_hits && !ours.wrong;
    free(first);
    free(hits);
    return good;
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

typedef struct { size_t rays; bool quick, gpu; const char *output; } options;

static bool build_suite(suite *s, pool *threads)
{
    rt_geometry geo;
    rt_build_options build;
    rt_error error;
    int k;

    memset(&geo, 0, sizeof geo);
    memset(&build, 0, sizeof build);
    geo.vertices = s->m.vertices, geo.vertex_count = s->m.vertex_count;
    geo.indices = s->m.indices, geo.triangle_count = s->m.triangle_count;
    build.error = &error;
    build.parallel_for = pool_for;
    build.parallel_user = threads;
    for (k = 0; k < RT_STRUCTURE_COUNT; k++) {
        build.structure = (rt_structure)k;
        if (rt_build(&s->accels[k], &geo, &build) != RT_OK) return complain("%s: %s", s->name, error.message);
        if (s->gpu && rt_gpu_upload(s->gpu, &s->there[k], s->accels[k], &error) != RT_OK) return complain("%s: %s", s->name, error.message);
    }
    truth_build(&s->tree, &s->m);
    return true;
}

static void free_suite(suite *s)
{
    int k;

    for (k = 0; k < RT_STRUCTURE_COUNT; k++) {
        rt_gpu_free(s->there[k]);
        rt_free(s->accels[k]);
    }
    truth_free(&s->tree);
    model_free(&s->m);
    free(s->rays);
    free(s->truths);
}

static const struct { const char *name; double scale, offset; } places[] = {
    { "", 1, 0 }, { " x 1e-6", 1e-6, 0 }, { " x 1e6", 1e6, 0 }, { " 100 radii away", 1, 100 }, { " 2^17 radii away", 1, 131072 },
};
enum { SPHERE, TORUS, SLIVERS, MODELS };
static const char *const model_names[] = { "sphere", "torus", "slivers" };

static void make_model(model *m, int which, bool quick)
{
    memset(m, 0, sizeof *m);
    if (which == SPHERE) model_wrap(m, quick ? 64 : 200, quick ? 32 : 100, false, on_sphere);
    else if (which == TORUS) model_wrap(m, quick ? 48 : 120, quick ? 24 : 60, true, on_torus);
    else model_slivers(m, quick ? 500 : 3000);
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

static bool run_all(const options *o, pool *threads, FILE *csv)
{
    rt_gpu_options open;
    rt_gpu *gpu = NULL;
    rt_error error;
    size_t place, bad = 0, suites = 0;
    int which, how;
#ifdef RT_BENCH_EMBREE
    RTCDevice device = rtcNewDevice("threads=1");
#endif

    memset(&open, 0, sizeof open);
    open.general = true;
    open.error = &error;
    if (o->gpu && rt_gpu_open(&gpu, &open) != RT_OK) return complain("--gpu: %s", error.message);
    for (which = 0; which < MODELS; which++)
        for (place = 0; place < COUNT(places); place++) {
            suite s;

            if (which == SLIVERS && place) continue;
            memset(&s, 0, sizeof s);
            s.gpu = gpu;
            make_model(&s.m, which, o->quick);
            model_place(&s.m, places[place].scale, places[place].offset);
            if (!build_suite(&s, threads)) return false;
#ifdef RT_BENCH_EMBREE
            s.scenes[0] = embree_scene(device, &s.m, false);
            s.scenes[1] = embree_scene(device, &s.m, true);
#endif
            if (!way_count) list_ways(&s);
            s.count = o->rays;
            s.rays = need(s.count, sizeof *s.rays);
            s.truths = need(s.count, sizeof *s.truths);
            for (how = 0; how < AIMS; how++) {
                snprintf(s.name, sizeof s.name, "%s%s; rays at %s", model_names[which], places[place].name, aim_names[how]);
                random_seed = (uint64_t)(which * 100 + how * 10) + place;
                make_rays(&s.m, (aim)how, s.rays, s.count);
                suites++;
                bad += !run_suite(&s, threads, csv, !o->quick && !place);       /* times of models as they are */
            }
#ifdef RT_BENCH_EMBREE
            rtcReleaseScene(s.scenes[0]);
            rtcReleaseScene(s.scenes[1]);
#endif
            free_suite(&s);
        }
#ifdef RT_BENCH_EMBREE
    rtcReleaseDevice(device);
#endif
    rt_gpu_close(gpu);
    printf("\n%zu passed, %zu failed, 0 skipped\n", suites - bad, bad);
    return bad == 0;
}

int main(int argc, char **argv)
{
    options o = { 200000, false, false, NULL };
    pool *threads = pool_create(0);
    FILE *csv = NULL;
    bool good;
    int i;

    for (i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--quick") == 0) o.quick = true, o.rays = 1000;
        else if (strcmp(argv[i], "--gpu") == 0) o.gpu = true;
        else if (strcmp(argv[i], "--rays") == 0 && i + 1 < argc && atoi(argv[i + 1]) > 0) o.rays = (size_t)atoi(argv[++i]);
        else if (strcmp(argv[i], "-o") == 0 && i + 1 < argc) o.output = argv[++i];
        else {
            printf("usage: accuracy [--quick] [--gpu] [--rays N] [-o FILE.csv]\n\nCompares the hits of every structure, algorithm, packet width, "
                   "culling and instruction set with the truth, found in exact arithmetic.\n  --quick   small models, 1000 rays a suite, no times\n"
                   "  --gpu     the OpenCL device too\n  --rays N  a suite (default 200000)\n  -o FILE   a row for each way and suite\n");
            return strcmp(argv[i], "--help") == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
        }
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (!threads) return complain("cannot start the threads"), EXIT_FAILURE;
    if (o.output && !(csv = fopen(o.output, "w"))) return complain("%s: %s", o.output, strerror(errno)), EXIT_FAILURE;
    if (csv) fputs("suite,way,rays,hits,missed,false,wrong,excused,t_ulp_most,t_ulp_mean,t_relative_most,uv_most,uv_mean,same_bits,ns\n", csv);
    good = run_all(&o, threads, csv);
    if (csv && fclose(csv) != 0) good = complain("%s: %s", o.output, strerror(errno));
    pool_destroy(threads);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
