/* accuracy_truth.h - of accuracy.c: what is true of a ray, found apart from rt.h.              SPDX-License-Identifier: MIT OR Unlicense

   >>exact  >>model  >>tree  >>truth  >>excuses

   Boxes with wide margins in double, then signs and quotients of exact sums. */

/* ---- >>exact -------------------------------------------------------------------------------------------------------- */

/* A sum of doubles that do not overlap, by rising size (Shewchuk 1997); of none: 0. No bit is lost: coordinates are multiples of 2^-149 below
   2^60, directions below 2^100. So a volume, a product of two differences of coordinates and a direction or another difference, is a multiple
   of 2^-447 below 2^228: 675 bits at most, of which a double that does not overlap the next holds one or more; in fact each holds some 53, and
   so do all sums on the way. Products of two doubles end above 2^-1022, so that fma gives what they are rounded by, exactly. Discriminants, of
   four factors, and the squares of discs, of six, have 922 and some more bits where all is at its extremes; of the suites' they have far
   less, and what does not fit in TERMS ends the program. */
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
    if (kept == TERMS) {
        complain("a sum of more than %d terms", TERMS - 1);
        exit(EXIT_FAILURE);
    }
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

/* ---- >>model -------------------------------------------------------------------------------------------------------- */

/* What is traced. Primitives count as in rt.h: triangles, spheres, instances of child, planes. */
typedef struct model {
    float *vertices;
    uint32_t *indices;
    rt_sphere *spheres;
    rt_instance *instances;                 /* their accels are filled in once child's are built */
    rt_plane *planes;
    size_t vertex_count, triangle_count, sphere_count, instance_count, plane_count;
    struct model *child;
    uint32_t *twin;                         /* one a triangle: the first of those which are the same; NULL: there are none */
    int closed;                             /* every line leaves it as often as it enters it; 2: by turns */
    float traversal_cost;                   /* of the builders; 0: the default */
    double center[3], radius;               /* around all of it, but for planes */
    size_t detail;                          /* most rays are for the first triangles, so many; 0: for all alike */
    double near[3], reach;                  /* where half of the rays start then: around this point */
} model;

static double corner(const model *m, uint32_t triangle, int which, int k)
{
    return (double)m->vertices[3 * (size_t)m->indices[3 * (size_t)triangle + (size_t)which] + (size_t)k];
}

static double sphere_center(const model *m, uint32_t prim, int k)
{
    const rt_vec3 *c = &m->spheres[prim - m->triangle_count].center;

    return (double)(k == 0 ? c->x : k == 1 ? c->y : c->z);
}

static double sphere_radius(const model *m, uint32_t prim) { return (double)m->spheres[prim - m->triangle_count].radius; }

static size_t first_plane(const model *m) { return m->triangle_count + m->sphere_count + m->instance_count; }

static const rt_plane *plane_of(const model *m, uint32_t prim) { return &m->planes[prim - first_plane(m)]; }

/* A triangle's or sphere's box. */
static void prim_box(const model *m, uint32_t prim, double low[3], double high[3])
{
    int k;

    for (k = 0; k < 3; k++) {
        if (prim < m->triangle_count) {
            low[k] = fmin(corner(m, prim, 0, k), fmin(corner(m, prim, 1, k), corner(m, prim, 2, k)));
            high[k] = fmax(corner(m, prim, 0, k), fmax(corner(m, prim, 1, k), corner(m, prim, 2, k)));
        } else {
            low[k] = sphere_center(m, prim, k) - sphere_radius(m, prim);
            high[k] = sphere_center(m, prim, k) + sphere_radius(m, prim);
        }
    }
}

/* ---- >>tree --------------------------------------------------------------------------------------------------------- */

/* A tree of the test's own: boxes of halves by the middle of the longest axis. */
typedef struct { double low[3], high[3]; uint32_t first, count, child; } box;       /* count 0: children child and child + 1 */

typedef struct {
    const model *m;
    box *boxes;
    uint32_t *order, box_count;             /* box_count 0: no triangles and no spheres */
    uint32_t *pieces;                       /* of triangles: alike where vertices lead from one to the other */
    double far;                             /* the largest coordinate */
} truth_tree;

static const model *sort_model;             /* of qsort, which has no context: trees are built by one thread */
static int sort_axis;

static int by_middle(const void *a, const void *b)
{
    double low[2][3], high[2][3], x, y;

    prim_box(sort_model, *(const uint32_t *)a, low[0], high[0]);
    prim_box(sort_model, *(const uint32_t *)b, low[1], high[1]);
    x = low[0][sort_axis] + high[0][sort_axis], y = low[1][sort_axis] + high[1][sort_axis];
    return (x > y) - (x < y);
}

static void split_box(truth_tree *tree, uint32_t at)
{
    box *b = &tree->boxes[at];
    uint32_t i, half;
    int k, axis = 0;

    for (k = 0; k < 3; k++) b->low[k] = HUGE_VAL, b->high[k] = -HUGE_VAL;
    for (i = b->first; i < b->first + b->count; i++) {
        double low[3], high[3];

        prim_box(tree->m, tree->order[i], low, high);
        for (k = 0; k < 3; k++) b->low[k] = fmin(b->low[k], low[k]), b->high[k] = fmax(b->high[k], high[k]);
    }
    for (k = 1; k < 3; k++)
        if (b->high[k] - b->low[k] > b->high[axis] - b->low[axis]) axis = k;
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

static uint32_t first_of(uint32_t *above, uint32_t i)
{
    while (above[i] != i) i = above[i] = above[above[i]];
    return i;
}

static void find_pieces(truth_tree *tree)
{
    const model *m = tree->m;
    uint32_t *above = need(m->vertex_count, sizeof *above);
    size_t i;

    tree->pieces = need(m->triangle_count, sizeof *tree->pieces);
    for (i = 0; i < m->vertex_count; i++) above[i] = (uint32_t)i;
    for (i = 0; i < 3 * m->triangle_count; i++) above[first_of(above, m->indices[i])] = first_of(above, m->indices[i / 3 * 3]);
    for (i = 0; i < m->triangle_count; i++) tree->pieces[i] = first_of(above, m->indices[3 * i]);
    free(above);
}

static void truth_build(truth_tree *tree, const model *m)
{
    const size_t count = m->triangle_count + m->sphere_count;
    uint32_t i;

    memset(tree, 0, sizeof *tree);
    tree->m = m;
    tree->boxes = need(2 * count, sizeof *tree->boxes);
    tree->order = need(count, sizeof *tree->order);
    find_pieces(tree);
    if (!count) return;
    for (i = 0; i < count; i++) tree->order[i] = i;
    tree->boxes[0].count = (uint32_t)count;
    tree->box_count = 1;
    split_box(tree, 0);
    for (i = 0; i < 3; i++) tree->far = fmax(tree->far, fmax(fabs(tree->boxes[0].low[i]), fabs(tree->boxes[0].high[i])));
}

static void truth_free(truth_tree *tree)
{
    free(tree->boxes);
    free(tree->order);
    free(tree->pieces);
}

/* ---- >>truth -------------------------------------------------------------------------------------------------------- */

/* A ray; rough: beside one, its origin being no float, and what doubles tell of it is enough. */
typedef struct { double org[3], dir[3], tmin, tmax; bool rough; } line;
typedef struct { bool hit; uint32_t prim, inst; double t, u, v; } truth;

static line line_of(const rt_ray *ray)
{
    const line l = { { (double)ray->org.x, (double)ray->org.y, (double)ray->org.z },
                     { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z }, (double)ray->tmin, (double)ray->tmax, false };
    return l;
}

/* What the header of rt.h says: others hit nothing. */
static bool legal(const rt_ray *ray)
{
    const line l = line_of(ray);
    double most = 0;
    int k;

    for (k = 0; k < 3; k++) {
        if (!(fabs(l.org[k]) <= (double)RT_MAX_COORDINATE) || !(fabs(l.dir[k]) <= (double)RT_MAX_DIRECTION)) return false;
        most = fmax(most, fabs(l.dir[k]));
    }
    return most >= (double)RT_MIN_DIRECTION && l.tmin < l.tmax;
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

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

/* Takes what is at t where it counts: the nearest, and of two as near as doubles tell the lower primitive. */
static void take(truth *best, const line *l, double t, double u, double v, uint32_t prim)
{
    const double near = best->hit ? 4e-15 * fabs(best->t) : 0;

    if (!(t > l->tmin && t < l->tmax)) return;
    if (best->hit && (t > best->t + near || (t >= best->t - near && prim > best->prim))) return;
    best->hit = true;
    best->prim = prim;
    best->t = t, best->u = u, best->v = v;
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
   t is good to 2^-12 of its last place as a float. */
static void truth_triangle(const model *m, uint32_t triangle, const line *l, truth *best)
{
    double p[3][3], edges[3], slack[4], height, sum;
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
    if (best->hit && slack[0] + slack[1] + slack[2] < 1e-8 * fabs(sum) && slack[3] < 1e-8 * fabs(height) &&
        height / sum > best->t + 1e-7 * fabs(best->t)) return;             /* behind, whatever the bits */
    if (l->rough) {
        if ((edges[0] > 0 || edges[1] > 0 || edges[2] > 0) && (edges[0] < 0 || edges[1] < 0 || edges[2] < 0)) return;
        if (sum == 0) return;
    } else if (!sure && !exact_triangle(m, triangle, l, edges, &sum, &height)) return;
    take(best, l, height / sum, edges[1] / sum, edges[2] / sum, triangle);
}

/* a . b */
static exact exact_dot(const exact a[3], const exact b[3])
{
    exact sum, product;
    int k;

    sum.count = 0;
    for (k = 0; k < 3; k++) {
        exact_product(&a[k], &b[k], &product);
        exact_add(&sum, &product, 1);
    }
    return sum;
}

/* t^2 a - 2 t b + c = 0, a ray against a sphere: a, b, c and b^2 - a c, each rounded once or twice from what is exact. */
static void exact_sphere(const model *m, uint32_t prim, const line *l, double *a, double *b, double *c, double *disc)
{
    const exact radius = exact_difference(sphere_radius(m, prim), 0);
    exact p[3], d[3], aa, bb, cc, product, sum;
    int k;

    for (k = 0; k < 3; k++) {
        d[k] = exact_difference(l->dir[k], 0);
        p[k] = exact_difference(sphere_center(m, prim, k), l->org[k]);
    }
    aa = exact_dot(d, d), bb = exact_dot(d, p), cc = exact_dot(p, p);
    exact_product(&radius, &radius, &product);
    exact_add(&cc, &product, -1);
    exact_product(&bb, &bb, &sum);
    exact_product(&aa, &cc, &product);
    exact_add(&sum, &product, -1);
    *a = exact_value(&aa), *b = exact_value(&bb), *c = exact_value(&cc), *disc = exact_value(&sum);
}

/* The near wall, or, where that does not count, the far one. The roots are quotients of sums without a difference, and of c and b^2 - a c,
   which are exact where doubles are not sure of them: so good to some 2^-50, as triangles are. */
static void truth_sphere(const model *m, uint32_t prim, const line *l, truth *best)
{
    const double r = sphere_radius(m, prim);
    double p[3], a, b, c, disc, q, near, far, size;
    truth wall = { false, 0, 0, 0, 0, 0 };
    int k;

    for (k = 0; k < 3; k++) p[k] = sphere_center(m, prim, k) - l->org[k];
    a = dot(l->dir, l->dir), b = dot(l->dir, p), c = dot(p, p) - r * r, size = dot(p, p) + r * r;
    disc = b * b - a * c;
    if (!l->rough) {
        if (disc < -1e-14 * a * size) return;
        if (disc < 1e-3 * a * size || fabs(c) < 1e-4 * size) exact_sphere(m, prim, l, &a, &b, &c, &disc);
    }
    if (disc < 0) return;
    q = b < 0 ? b - sqrt(disc) : b + sqrt(disc);
    near = far = q / a;
    if (disc > 0) near = fmin(q / a, c / q), far = fmax(q / a, c / q);
    take(&wall, l, near, 0, 0, prim);
    if (!wall.hit) take(&wall, l, far, 0, 0, prim);
    if (wall.hit) take(best, l, wall.t, 0, 0, prim);
}

/* A quotient of exact sums; of a disc, the exact sign of (t d - p)^2 - r^2 times the denominator's square. */
static void truth_plane(const model *m, uint32_t prim, const line *l, truth *best)
{
    const rt_plane *plane = plane_of(m, prim);
    const double at[3] = { (double)plane->point.x, (double)plane->point.y, (double)plane->point.z };
    const double across[3] = { (double)plane->normal.x, (double)plane->normal.y, (double)plane->normal.z };
    exact n[3], p[3], d[3], over, under, off[3], x, y, far;
    int k;

    for (k = 0; k < 3; k++) {
        n[k] = exact_difference(across[k], 0);
        p[k] = exact_difference(at[k], l->org[k]);
        d[k] = exact_difference(l->dir[k], 0);
    }
    over = exact_dot(n, p), under = exact_dot(n, d);
    if (!exact_sign(&under)) return;
    if (plane->radius > 0) {
        for (k = 0; k < 3; k++) {
            exact_product(&over, &d[k], &off[k]);
            exact_product(&under, &p[k], &x);
            exact_add(&off[k], &x, -1);
        }
        far = exact_dot(off, off);
        x = exact_difference((double)plane->radius, 0);
        exact_product(&x, &under, &y);
        exact_product(&y, &y, &x);
        exact_add(&far, &x, -1);
        if (exact_sign(&far) > 0) return;
    }
    take(best, l, exact_value(&over) / exact_value(&under), 0, 0, prim);
}

static void truth_of(const model *m, uint32_t prim, const line *l, truth *best)
{
    if (prim < m->triangle_count) truth_triangle(m, prim, l, best);
    else if (prim < m->triangle_count + m->sphere_count) truth_sphere(m, prim, l, best);
    else truth_plane(m, prim, l, best);
}

/* Does the line meet the box, moved out by pad, between from and to? */
static bool meets(const box *b, const line *l, double pad, double from, double to)
{
    int k;

    for (k = 0; k < 3; k++) {
        const double low = b->low[k] - pad - l->org[k], high = b->high[k] + pad - l->org[k], d = l->dir[k];
        if (d == 0) {
            if (low > 0 || high < 0) return false;
        } else {
            const double near = (d > 0 ? low : high) / d, far = (d > 0 ? high : low) / d;

            from = near > from ? near : from;
            to = far < to ? far : to;
        }
    }
    return from <= to + 1e-12 * fabs(to) + 1e-300;
}

/* More than doubles lose where a box is tested. */
static double pad_of(const truth_tree *tree, const line *l)
{
    return 1e-12 * (tree->far + fmax(fabs(l->org[0]), fmax(fabs(l->org[1]), fabs(l->org[2]))));
}

/* Which of a box's children comes first along dir. */
static uint32_t nearer(const truth_tree *tree, const box *b, const double dir[3])
{
    const box *one = &tree->boxes[b->child], *other = one + 1;
    double way = 0;
    int k;

    for (k = 0; k < 3; k++) way += dir[k] * (one->low[k] + one->high[k] - other->low[k] - other->high[k]);
    return b->child + (way > 0);
}

/* Of triangles, spheres and planes: the nearest. */
static truth truth_find(const truth_tree *tree, const line *l)
{
    uint32_t stack[128], top = 0, i;
    truth best = { false, RT_NONE, RT_NONE, 0, 0, 0 };
    const double pad = pad_of(tree, l);

    for (i = 0; i < tree->m->plane_count; i++) truth_plane(tree->m, (uint32_t)first_plane(tree->m) + i, l, &best);
    if (tree->box_count) stack[top++] = 0;
    while (top) {
        const box *b = &tree->boxes[stack[--top]];

        if (!meets(b, l, pad, l->tmin, best.hit ? best.t : l->tmax)) continue;
        for (i = 0; i < b->count; i++) truth_of(tree->m, tree->order[b->first + i], l, &best);
        if (!b->count) {
            const uint32_t near = nearer(tree, b, l->dir);

            stack[top++] = 2 * b->child + 1 - near, stack[top++] = near;
        }
    }
    return best;
}

/* All triangles and spheres that the line may meet anywhere, or as rounding may move it aside (see drift); how many, of at most max. */
static size_t gather(const truth_tree *tree, const line *l, uint32_t *prims, size_t max)
{
    uint32_t stack[128], top = 0, i;
    size_t count = 0;
    double pad = 0;
    int k;

    if (!tree->box_count) return 0;
    for (k = 0; k < 3; k++) pad = fmax(pad, fmax(fabs(tree->boxes[0].low[k] - l->org[k]), fabs(tree->boxes[0].high[k] - l->org[k])));
    pad = 0x1p-20 * pad + pad_of(tree, l);
    stack[top++] = 0;
    while (top) {
        const box *b = &tree->boxes[stack[--top]];

        if (!meets(b, l, pad, -HUGE_VAL, HUGE_VAL)) continue;
        if (count + b->count > max) {
            complain("more than %zu primitives on a line", max);
            exit(EXIT_FAILURE);
        }
        for (i = 0; i < b->count; i++) prims[count++] = tree->order[b->first + i];
        if (!b->count) stack[top++] = b->child, stack[top++] = b->child + 1;
    }
    return count;
}

/* ---- >>excuses ------------------------------------------------------------------------------------------------------ */

/* How far rounding may move a ray aside of a primitive. Of a triangle: its vertices, seen from the ray's origin at distances of up to R, move
   by up to 8.5 e R, with e = 2^-24, see rti_prepare of rt.h; signs of what is then computed are exact. 16 e R are allowed. Spheres and
   planes are computed in doubles from floats, which are exact: with e = 2^-53 the centre seen from the origin errs by e R, its
   distance along the ray by 4 e R more, what is left across it by 2 e R, its square against the radius's by 4 e R, with R the distance of
   the centre and the radius together: below 16 e R. */
static double drift(const model *m, uint32_t prim, const line *l)
{
    double reach = 0;
    int i, k;

    if (prim < m->triangle_count) {
        for (i = 0; i < 3; i++)
            for (k = 0; k < 3; k++) reach = fmax(reach, fabs(corner(m, prim, i, k) - l->org[k]));
        return 0x1p-20 * reach;
    }
    if (prim < m->triangle_count + m->sphere_count) {
        for (k = 0; k < 3; k++) reach += fabs(sphere_center(m, prim, k) - l->org[k]);
        return 0x1p-49 * (reach + sphere_radius(m, prim));
    }
    reach = fabs((double)plane_of(m, prim)->point.x - l->org[0]) + fabs((double)plane_of(m, prim)->point.y - l->org[1]);
    return 0x1p-49 * (reach + fabs((double)plane_of(m, prim)->point.z - l->org[2]) + (double)plane_of(m, prim)->radius);
}

/* Two directions across a line's. */
static void across_line(const line *l, double out[2][3])
{
    const double length = sqrt(dot(l->dir, l->dir));
    double rest = 0;
    int k, axis = 0;

    for (k = 1; k < 3; k++)
        if (fabs(l->dir[k]) < fabs(l->dir[axis])) axis = k;
    for (k = 0; k < 3; k++) {
        out[0][k] = (k == axis) - l->dir[axis] / length * (l->dir[k] / length);
        rest += out[0][k] * out[0][k];
    }
    for (k = 0; k < 3; k++) out[0][k] /= sqrt(rest);
    for (k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        out[1][k] = (l->dir[k1] * out[0][k2] - l->dir[k2] * out[0][k1]) / length;
    }
}

/* How far from the primitive's rim a line passes, seen along it, within or beside it. across: see across_line. */
static double rim(const model *m, uint32_t prim, const line *l, double across[2][3], bool *inside)
{
    double p[3][2], least = HUGE_VAL, area = 0;
    int i, j, k, positive = 0, negative = 0;

    if (prim >= m->triangle_count + m->sphere_count) {      /* of discs, in their plane, which is no less; planes have none */
        const rt_plane *plane = plane_of(m, prim);
        const double n[3] = { (double)plane->normal.x, (double)plane->normal.y, (double)plane->normal.z };
        double off[3] = { (double)plane->point.x - l->org[0], (double)plane->point.y - l->org[1], (double)plane->point.z - l->org[2] };
        const double t = dot(n, off) / dot(n, l->dir);

        for (k = 0; k < 3; k++) off[k] = t * l->dir[k] - off[k];
        least = sqrt(dot(off, off)) - (double)plane->radius;
        *inside = !(plane->radius > 0) || least <= 0;
        return plane->radius > 0 ? fabs(least) * fabs(dot(n, l->dir)) / sqrt(dot(n, n)) / sqrt(dot(l->dir, l->dir)) : HUGE_VAL;
    }
    if (prim >= m->triangle_count) {
        double off[2] = { 0, 0 };

        for (j = 0; j < 2; j++)
            for (k = 0; k < 3; k++) off[j] += across[j][k] * (sphere_center(m, prim, k) - l->org[k]);
        least = hypot(off[0], off[1]) - sphere_radius(m, prim);
        *inside = least <= 0;
        return fabs(least);
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 2; j++) {
            p[i][j] = 0;
            for (k = 0; k < 3; k++) p[i][j] += across[j][k] * (corner(m, prim, i, k) - l->org[k]);
        }
    for (i = 0; i < 3; i++) {
        const double *a = p[i], *b = p[(i + 1) % 3], side[2] = { b[0] - a[0], b[1] - a[1] }, turn = a[0] * side[1] - a[1] * side[0];
        const double length = side[0] * side[0] + side[1] * side[1];
        double part = length > 0 ? -(a[0] * side[0] + a[1] * side[1]) / length : 0;

        positive += turn > 0, negative += turn < 0, area += turn;
        part = fmin(fmax(part, 0), 1);
        least = fmin(least, (a[0] + part * side[0]) * (a[0] + part * side[0]) + (a[1] + part * side[1]) * (a[1] + part * side[1]));
    }
    *inside = !(positive && negative) && fabs(area) >= least;       /* which has room for a circle so large: not seen edge-on */
    return sqrt(least);
}

/* Is t one that a point of the primitive can have? A triangle's is a mean of its vertices', each good to a few roundings of floats. */
static bool within(const model *m, uint32_t prim, const line *l, double t)
{
    double low = HUGE_VAL, high = -HUGE_VAL;
    int i, axis = 0;

    if (prim >= m->triangle_count) return true;
    for (i = 1; i < 3; i++)
        if (fabs(l->dir[i]) > fabs(l->dir[axis])) axis = i;
    for (i = 0; i < 3; i++) {
        const double depth = (corner(m, prim, i, axis) - l->org[axis]) / l->dir[axis];
        low = fmin(low, depth), high = fmax(high, depth);
    }
    return t >= low - 1e-6 * fabs(low) - 1e-36 && t <= high + 1e-6 * fabs(high) + 1e-36;
}

/* Where a hit is looked at: the model, or the child of an instance with the ray as it is there. */
typedef struct { const truth_tree *tree; line l; } view;

/* The line, moved aside by part of what rounding may do: 48 ways. */
static line moved_aside(const line *l, double across[2][3], double away, int i)
{
    const double turn = 0.39269908169872414 * i, part = away / (1 << i / 16 * 2);
    line aside = *l;
    int k;

    aside.rough = true;
    for (k = 0; k < 3; k++) aside.org[k] += part * (cos(turn) * across[0][k] + sin(turn) * across[1][k]);
    return aside;
}

/* Does a line beside meet the piece of that triangle nowhere before a hit, or but where that is? */
static bool slips_past(const truth_tree *tree, const line *l, uint32_t triangle, uint32_t prim, double limit)
{
    double across[2][3];
    int i;

    across_line(l, across);
    for (i = 0; i < 48; i++) {
        line aside = moved_aside(l, across, drift(tree->m, triangle, l), i);
        truth other;

        while ((other = truth_find(tree, &aside)).hit && other.prim < tree->m->triangle_count && tree->pieces[other.prim] != tree->pieces[triangle])
            aside.tmin = other.t;
        if (!other.hit || other.prim == prim || other.t >= limit) return true;
    }
    return false;
}

/* Each piece that the line meets before the hit, if there is one, by itself. */
static bool slips_past_all(const truth_tree *tree, const line *l, truth t, uint32_t prim, double limit)
{
    line rest = *l;

    for (; t.hit && t.t < limit; t = truth_find(tree, &rest)) {
        if (t.prim >= tree->m->triangle_count || !slips_past(tree, l, t.prim, prim, limit)) return false;
        rest.tmin = t.t;
    }
    return true;
}

/* Could rounding have led to that hit, or miss? The ray passes so near to the primitive; and what is true lies behind it, or is not there for
   one of 48 rays around: so at the rim of a closed mesh, but not where its triangles meet before the ray. found, true_one: where the hit
   was found, and where it truly is. A ray may pass several pieces that share no vertex, whose roundings so have nothing in common: each by a
   ray of its own. */
static bool excused(const view *found, const rt_hit *hit, const view *true_one, const truth *t)
{
    const double limit = hit->prim == RT_NONE ? HUGE_VAL : (double)hit->t - 1e-5 * fabs((double)hit->t);
    double across[2][3], away;
    bool inside;
    int i;

    if (hit->prim != RT_NONE) {
        const model *m = found->tree->m;

        across_line(&found->l, across);
        away = rim(m, hit->prim, &found->l, across, &inside);
        if ((!inside && away > drift(m, hit->prim, &found->l)) || !within(m, hit->prim, &found->l, (double)hit->t)) return false;
        if (!t->hit || (double)hit->t <= t->t + 1e-5 * fabs(t->t)) return true;
    }
    across_line(&true_one->l, across);
    for (i = 0; i < 48; i++) {
        const line aside = moved_aside(&true_one->l, across, drift(true_one->tree->m, t->prim, &true_one->l), i);
        const truth other = truth_find(true_one->tree, &aside);

        if (!other.hit || (other.prim == hit->prim && t->inst == hit->inst) || other.t >= limit) return true;
    }
    return t->inst == RT_NONE && hit->inst == RT_NONE && slips_past_all(true_one->tree, &true_one->l, *t, hit->prim, limit);
}
