/* accuracy_suites.h - of accuracy.c: the models, the rays, and the table of what is traced with what. SPDX-License-Identifier: MIT OR Unlicense

   >>suite  >>rule  >>models  >>rays  >>table */

/* ---- >>suite -------------------------------------------------------------------------------------------------------- */

/* What the first way's hits are held against beside the truth; all but hits by chance: see >>rule. */
typedef struct { size_t against_rule, against_exact, astray, unpaired, clean; } faults;

/* A model with its rays, what is true of them, and what traces it. */
typedef struct suite {
    char name[96];
    model m;
    truth_tree tree, child_tree;
    rt_ray *rays;
    truth *truths;
    rt_hit *rules;
    faults *found;                          /* one a chunk of rays */
    size_t count;
    bool all_timed;                         /* else the usual ways and peers alone */
    bool by_rule;                           /* what counts is decided by t as a float: the rule is the truth */
    rt_accel *accels[RT_STRUCTURE_COUNT], *child_accels[RT_STRUCTURE_COUNT];
    uint32_t *slots, *child_slots;          /* of the BVHs: where a primitive is */
    rt_gpu *gpu;                            /* NULL: none */
    rt_gpu_accel *there[RT_STRUCTURE_COUNT];
#ifdef RT_BENCH_EMBREE
    RTCScene scenes[2];                     /* fast, robust */
#endif
} suite;

static rt_vec3 vec3(const double v[3])
{
    const rt_vec3 out = { (float)v[0], (float)v[1], (float)v[2] };
    return out;
}

/* The ray as an instance's object sees it: as the library makes it, since by contract it is a ray of floats there. */
static rt_ray ray_in(const suite *s, uint32_t inst, const rt_ray *ray)
{
    rt_ray out = *ray;

    if (inst != RT_NONE) {
        const rti_instance *in = &s->accels[RT_BVH]->instances[s->accels[RT_BVH]->instance_slots[inst]];
        const float org[3] = { ray->org.x, ray->org.y, ray->org.z }, dir[3] = { ray->dir.x, ray->dir.y, ray->dir.z };
        float to_org[3], to_dir[3];

        rti_transform_ray(in->inverse, org, dir, to_org, to_dir);
        out.org.x = to_org[0], out.org.y = to_org[1], out.org.z = to_org[2];
        out.dir.x = to_dir[0], out.dir.y = to_dir[1], out.dir.z = to_dir[2];
    }
    return out;
}

static view view_in(const suite *s, uint32_t inst, const rt_ray *ray)
{
    const rt_ray there = ray_in(s, inst, ray);
    const view v = { inst == RT_NONE ? &s->tree : &s->child_tree, line_of(&there) };
    return v;
}

/* The nearest of what the model has itself and what its instances show. Of equals the lowest instance, none being the highest. */
static truth suite_truth(const suite *s, const rt_ray *ray)
{
    truth best = { false, RT_NONE, RT_NONE, 0, 0, 0 };
    view v = view_in(s, RT_NONE, ray);
    uint32_t i;

    if (!legal(ray)) return best;
    best = truth_find(&s->tree, &v.l);
    best.inst = RT_NONE;
    for (i = 0; i < s->m.instance_count; i++) {
        const rt_ray there = ray_in(s, i, ray);
        truth t;

        if (!legal(&there)) continue;
        v = view_in(s, i, ray);
        t = truth_find(&s->child_tree, &v.l);
        t.inst = i;
        if (t.hit && (!best.hit || t.t < best.t || (t.t <= best.t && best.inst == RT_NONE))) best = t;
    }
    return best;
}

/* ---- >>rule --------------------------------------------------------------------------------------------------------- */

/* What the library itself says, without its trees: each primitive on the line tested alone, from -infinity to infinity. The rule of the
   header holds to the last bit and without an excuse: the hit is the least (t, inst, prim) of these with tmin < t < tmax.

   The primitive test alone is held against the exact one too: they agree where the line passes no rim within rounding (see drift). And of
   a closed mesh, where a line passes no rim within rounding of any triangle near it, it enters as often as it leaves. For lines
   that do only the rule is promised: who steps along one, with tmin the last t, meets every t of the list once, ascending, of equal ones the
   lowest primitive. So two triangles that share an edge there may count once or twice. */
typedef struct { rt_hit hit; double t; int side; } crossing;
enum { MOST = 1 << 14 };
typedef struct { uint32_t prims[MOST]; crossing list[MOST]; size_t count; faults *found; bool clean; } ruler;

static void cross(ruler *r, const rti_packet_1 *p, double t, int side)
{
    crossing *c = &r->list[r->count];

    if (++r->count == MOST) {
        complain("more than %d hits on a line", MOST - 1);
        exit(EXIT_FAILURE);
    }
    c->hit.t = p->t[0], c->hit.u = p->u[0], c->hit.v = p->v[0], c->hit.prim = p->prim.id[0], c->hit.inst = p->inst.id[0];
    c->t = t, c->side = side;
}

/* Adds what one accel has on the ray: that of the model, or of an instance's child. */
static void rule_list(const suite *s, uint32_t inst, const rt_ray *ray, ruler *r)
{
    const bool top = inst == RT_NONE;
    const rt_accel *accel = top ? s->accels[RT_BVH] : s->child_accels[RT_BVH];
    const uint32_t *slots = top ? s->slots : s->child_slots;
    rt_ray whole = ray_in(s, inst, ray);
    rti_packet_1 p, one;
    double across[2][3];
    view v;
    size_t i, n;

    whole.tmin = -INFINITY, whole.tmax = INFINITY;
    if (!legal(&whole)) return;
    v = view_in(s, inst, ray);
    v.l.tmin = -HUGE_VAL, v.l.tmax = HUGE_VAL;
    if (!rti_prepare_1(accel, &p, rti_take_rays_1(accel, &rti_plain_jobs[RT_CLOSEST], &whole, 0, 1, &p), false)) return;
    across_line(&v.l, across);
    n = gather(v.tree, &v.l, r->prims, MOST);
    for (i = 0; i < n; i++) {
        const uint32_t prim = r->prims[i];
        const model *m = v.tree->m;
        const bool flat = prim < m->triangle_count;
        truth t = { false, 0, 0, 0, 0, 0 };
        bool inside, hit;
        double away;

        one = p;
        hit = (flat ? rti_hit_triangles_1(accel, &one, 1, NULL, slots[prim], 1, inst, 0)
                    : rti_hit_spheres_1(accel, &one, 1, NULL, slots[prim], 1, inst, 0)) != 0;
        away = rim(m, prim, &v.l, across, &inside);
        if (away <= drift(m, prim, &v.l)) r->clean = false;
        else if (hit != inside) r->found->against_exact++;
        if (!hit) continue;
        if (flat) {
            double p0[3], e[2][3], slack;
            int k;

            if (m->closed == 2) truth_triangle(m, prim, &v.l, &t);
            for (k = 0; k < 3; k++) {
                p0[k] = corner(m, prim, 0, k);
                e[0][k] = corner(m, prim, 1, k) - p0[k], e[1][k] = corner(m, prim, 2, k) - p0[k];
            }
            cross(r, &one, t.t, volume(v.l.dir, e[0], e[1], &slack) < 0 ? 1 : -1);
        } else {                            /* the far wall is what is behind the near one */
            const float near = one.t[0];

            cross(r, &one, 0, 1);
            one = p;
            one.tmin[0] = near;
            if (rti_hit_spheres_1(accel, &one, 1, NULL, slots[prim], 1, inst, 0)) cross(r, &one, 0, -1);
        }
    }
    for (i = 0; top && i < accel->plane_count; i++) {
        rt_accel alone;

        memset(&alone, 0, sizeof alone);
        alone.planes = &accel->planes[i], alone.plane_count = 1;
        one = p;
        if (rti_hit_planes_1(&alone, &one, 1, inst, &rti_plain_jobs[RT_CLOSEST])) cross(r, &one, 0, 0);
    }
}

static int by_exact_t(const void *a, const void *b)
{
    const double x = ((const crossing *)a)->t, y = ((const crossing *)b)->t;

    return (x > y) - (x < y);
}

/* Fills r->list; answers the hit that the rule picks of it. */
static rt_hit rule_find(const suite *s, const rt_ray *ray, ruler *r)
{
    rt_hit best = { INFINITY, 0, 0, RT_NONE, RT_NONE };
    size_t i;
    int sum = 0;

    r->count = 0;
    r->clean = true;
    if (!legal(ray)) return best;
    rule_list(s, RT_NONE, ray, r);
    for (i = 0; i < s->m.instance_count; i++) rule_list(s, (uint32_t)i, ray, r);
    for (i = 0; i < r->count; i++) {
        const rt_hit *h = &r->list[i].hit;

        sum += r->list[i].side;
        if (!(h->t > ray->tmin && h->t < ray->tmax)) continue;
        if (best.prim == RT_NONE || h->t < best.t || (h->t <= best.t && (h->inst < best.inst || (h->inst == best.inst && h->prim < best.prim))))
            best = *h;
    }
    if (r->clean && s->m.closed) {
        r->found->clean++;
        r->found->unpaired += sum != 0;
        if (s->m.closed == 2 && sum == 0) {
            qsort(r->list, r->count, sizeof *r->list, by_exact_t);
            for (i = 0; i < r->count; i++)
                if (i && r->list[i].side == r->list[i - 1].side) r->found->unpaired++, i = r->count;
        }
    }
    return best;
}

/* In the world, where an instance's hit is: the point that u and v tell, through the transform, lies beside the ray by no more than
   rti_set_reach of rt.h allows for. */
static bool is_astray(const suite *s, const rt_ray *ray, const rt_hit *hit)
{
    const rt_accel *accel = s->accels[RT_BVH];
    const view v = view_in(s, RT_NONE, ray);
    const float *m = s->m.instances[hit->inst].transform;
    double at[3], off[3], reach = 0, t;
    int k;

    if (hit->prim >= s->m.child->triangle_count) return false;
    for (k = 0; k < 3; k++)
        at[k] = (1 - (double)hit->u - (double)hit->v) * corner(s->m.child, hit->prim, 0, k) +
                (double)hit->u * corner(s->m.child, hit->prim, 1, k) + (double)hit->v * corner(s->m.child, hit->prim, 2, k);
    for (k = 0; k < 3; k++) {
        off[k] = (double)m[4 * k] * at[0] + (double)m[4 * k + 1] * at[1] + (double)m[4 * k + 2] * at[2] + (double)m[4 * k + 3] - v.l.org[k];
        reach = fmax(reach, fabs(v.l.org[k]));
    }
    t = dot(off, v.l.dir) / dot(v.l.dir, v.l.dir);
    for (k = 0; k < 3; k++) off[k] -= t * v.l.dir[k];
    return sqrt(dot(off, off)) > 0x1p-24 * (double)accel->spread * (reach + (double)accel->extent);
}

/* ---- >>models ------------------------------------------------------------------------------------------------------- */

/* Numbers in [0,1) by chance; each thread may have a state of its own. */
static double roll(uint64_t *state)
{
    uint64_t x = *state += 0x9e3779b97f4a7c15u;

    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return (double)((x ^ x >> 31) >> 11) * 0x1p-53;
}

static double roll_log(uint64_t *state, double low, double high) { return pow(10, low + (high - low) * roll(state)); }

static void roll_direction(uint64_t *state, double out[3])
{
    const double z = 2 * roll(state) - 1, turn = 6.283185307179586 * roll(state), across = sqrt(1 - z * z);

    out[0] = across * cos(turn), out[1] = across * sin(turn), out[2] = z;
}

static uint64_t random_seed;                /* of models and rays, which one thread makes */

static double unit(void) { return roll(&random_seed); }
static void any_direction(double out[3]) { roll_direction(&random_seed, out); }

static void model_free(model *m)
{
    if (m->child) model_free(m->child);
    free(m->child);
    free(m->vertices);
    free(m->indices);
    free(m->spheres);
    free(m->instances);
    free(m->planes);
    free(m->twin);
    memset(m, 0, sizeof *m);
}

/* Room for so many more triangles, of so many more vertices; answers where the vertices begin. */
static uint32_t model_more(model *m, size_t vertices, size_t triangles)
{
    const uint32_t first = (uint32_t)m->vertex_count;

    m->vertices = realloc(m->vertices, 3 * (m->vertex_count + vertices) * sizeof *m->vertices);
    m->indices = realloc(m->indices, 3 * (m->triangle_count + triangles) * sizeof *m->indices);
    if (!m->vertices || !m->indices) {
        complain("out of memory");
        exit(EXIT_FAILURE);
    }
    m->vertex_count += vertices;
    m->triangle_count += triangles;
    memset(m->vertices + 3 * first, 0, 3 * vertices * sizeof *m->vertices);
    memset(m->indices + 3 * (m->triangle_count - triangles), 0, 3 * triangles * sizeof *m->indices);
    return first;
}

static void put_vertex(model *m, uint32_t i, double x, double y, double z)
{
    m->vertices[3 * i] = (float)x, m->vertices[3 * i + 1] = (float)y, m->vertices[3 * i + 2] = (float)z;
}

static void put_triangle(model *m, size_t i, uint32_t a, uint32_t b, uint32_t c)
{
    m->indices[3 * i] = a, m->indices[3 * i + 1] = b, m->indices[3 * i + 2] = c;
}

/* A triangle of its own. */
static void add_triangle(model *m, const double a[3], const double b[3], const double c[3])
{
    const uint32_t first = model_more(m, 3, 1);

    put_vertex(m, first, a[0], a[1], a[2]);
    put_vertex(m, first + 1, b[0], b[1], b[2]);
    put_vertex(m, first + 2, c[0], c[1], c[2]);
    put_triangle(m, m->triangle_count - 1, first, first + 1, first + 2);
}

/* columns x rows quads, from corner along two edges. */
static void add_grid(model *m, size_t columns, size_t rows, const double from[3], const double along[3], const double up[3])
{
    const size_t triangle = m->triangle_count;
    const uint32_t first = model_more(m, (columns + 1) * (rows + 1), 2 * columns * rows);
    size_t x, y;

    for (y = 0; y <= rows; y++)
        for (x = 0; x <= columns; x++) {
            const double u = (double)x / (double)columns, v = (double)y / (double)rows;
            const uint32_t a = first + (uint32_t)(y * (columns + 1) + x), c = a + (uint32_t)columns + 1;
            const size_t i = triangle + 2 * (y * columns + x);

            put_vertex(m, a, from[0] + u * along[0] + v * up[0], from[1] + u * along[1] + v * up[1], from[2] + u * along[2] + v * up[2]);
            if (x == columns || y == rows) continue;
            put_triangle(m, i, a, a + 1, c + 1);
            put_triangle(m, i + 1, a, c + 1, c);
        }
}

static void add_box(model *m, const double low[3], const double high[3])
{
    static const int quads[6][4] = { { 0, 2, 3, 1 }, { 4, 5, 7, 6 }, { 0, 1, 5, 4 }, { 2, 6, 7, 3 }, { 0, 4, 6, 2 }, { 1, 3, 7, 5 } };
    const size_t triangle = m->triangle_count;
    const uint32_t first = model_more(m, 8, 12);
    uint32_t i;

    for (i = 0; i < 8; i++) put_vertex(m, first + i, i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]);
    for (i = 0; i < 6; i++) {
        const int *q = quads[i];
        put_triangle(m, triangle + 2 * i, first + (uint32_t)q[0], first + (uint32_t)q[1], first + (uint32_t)q[2]);
        put_triangle(m, triangle + 2 * i + 1, first + (uint32_t)q[0], first + (uint32_t)q[2], first + (uint32_t)q[3]);
    }
}

static void add_sphere(model *m, const double center[3], double radius)
{
    rt_sphere *to;

    m->spheres = realloc(m->spheres, (m->sphere_count + 1) * sizeof *m->spheres);
    if (!m->spheres) {
        complain("out of memory");
        exit(EXIT_FAILURE);
    }
    to = &m->spheres[m->sphere_count++];
    to->center = vec3(center);
    to->radius = (float)radius;
}

static double power_of_ten(double low, double high) { return roll_log(&random_seed, low, high); }

/* The middle and the radius, once the rest is there. */
static void model_measure(model *m)
{
    double low[3] = { HUGE_VAL, HUGE_VAL, HUGE_VAL }, high[3] = { -HUGE_VAL, -HUGE_VAL, -HUGE_VAL };
    size_t i, j;
    int k, n;

    for (i = 0; i < m->triangle_count + m->sphere_count; i++) {
        double from[3], to[3];

        prim_box(m, (uint32_t)i, from, to);
        for (k = 0; k < 3; k++) low[k] = fmin(low[k], from[k]), high[k] = fmax(high[k], to[k]);
    }
    for (i = 0; i < m->instance_count; i++) {
        const float *t = m->instances[i].transform;

        for (j = 0; j < m->child->vertex_count; j++)
            for (k = 0; k < 3; k++) {
                double at = (double)t[4 * k + 3];
                for (n = 0; n < 3; n++) at += (double)t[4 * k + n] * (double)m->child->vertices[3 * j + (size_t)n];
                low[k] = fmin(low[k], at), high[k] = fmax(high[k], at);
            }
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

/* Scaled, then moved. */
static void model_place(model *m, double scale, double offset)
{
    size_t i;
    int k;

    if (scale == 1 && offset == 0) {
        model_measure(m);
        return;
    }
    for (i = 0; i < 3 * m->vertex_count; i++) m->vertices[i] = (float)((double)m->vertices[i] * scale + offset * (double)(1 + i % 3) / 2);
    for (i = 0; i < m->sphere_count; i++) {
        double at[3];

        for (k = 0; k < 3; k++) at[k] = sphere_center(m, (uint32_t)(m->triangle_count + i), k) * scale + offset * (1 + k) / 2;
        m->spheres[i].center = vec3(at);
        m->spheres[i].radius = (float)((double)m->spheres[i].radius * scale);
    }
    model_measure(m);
}

static void make_sphere(model *m, bool quick)
{
    model_wrap(m, quick ? 64 : 200, quick ? 32 : 100, false, on_sphere);
    m->closed = 2;
}

static void make_torus(model *m, bool quick)
{
    model_wrap(m, quick ? 48 : 120, quick ? 24 : 60, true, on_torus);
    m->closed = 2;
}

/* Each edge once each way? */
static bool is_closed(const model *m)
{
    const size_t count = 3 * m->triangle_count, room = 4 * count;
    uint64_t *edges = need(room, sizeof *edges);        /* a table of those seen, 0: none */
    size_t i, j, pass, found = 0;

    for (pass = 0; pass < 2; pass++)
        for (i = 0; i < count; i++) {
            const uint64_t a = m->indices[i], b = m->indices[i % 3 == 2 ? i - 2 : i + 1], edge = (pass ? b << 32 | a : a << 32 | b) + 1;

            for (j = (size_t)(edge * 0x9e3779b97f4a7c15u >> 20) % room; edges[j] && edges[j] != edge; j = (j + 1) % room) { }
            if (pass) found += edges[j] == edge;
            else if (edges[j] || a == b) {
                free(edges);
                return false;
            } else edges[j] = edge;
        }
    free(edges);
    return found == count;
}

/* The first scan that is there and closed. */
static void make_scan(model *m, bool quick)
{
    static const char *const names[] = { "armadillo.obj", "stanford-bunny.obj", "spot.obj", "rocker-arm.obj" };
    const char *folder = getenv("RT_SCENES");
    size_t i;

    if (quick) return;
    for (i = 0; i < COUNT(names); i++) {
        char path[512];
        scene loaded;
        scene_error why;

        snprintf(path, sizeof path, "%s/models/%s", folder ? folder : "../shared/scenes", names[i]);
        if (!scene_load(&loaded, path, NULL, NULL, &why)) continue;
        memset(m, 0, sizeof *m);
        (void)model_more(m, loaded.geometry.vertex_count, loaded.geometry.triangle_count);
        memcpy(m->vertices, loaded.vertices, 3 * m->vertex_count * sizeof *m->vertices);
        memcpy(m->indices, loaded.indices, 3 * m->triangle_count * sizeof *m->indices);
        scene_free(&loaded);
        m->closed = 1;
        if (is_closed(m)) {
            printf("\nscan: %s\n", names[i]);
            return;
        }
        model_free(m);
    }
}

/* Long and thin triangles: aspects of 1e3 to 1e9, the third corner in the middle of the long side, or at its end. */
static void thin_triangles(model *m, size_t count, double where)
{
    size_t i;
    int k;

    for (i = 0; i < count; i++) {
        const double thin = pow(10, -3 - 6 * unit());
        double a[3], b[3], c[3], along[3], across[3];

        any_direction(along);
        any_direction(across);
        for (k = 0; k < 3; k++) {
            a[k] = (double)(float)(2 * unit() - 1);
            b[k] = a[k] + along[k];
            c[k] = a[k] + where * along[k] + thin * across[k];
        }
        add_triangle(m, a, b, c);
    }
}

static void make_slivers(model *m, bool quick) { thin_triangles(m, quick ? 150 : 250, 0.5); }
static void make_needles(model *m, bool quick) { thin_triangles(m, quick ? 150 : 250, 1); }

/* Closed spindles that share one tip, 1e-2 to 1e-6 thick, of 32 needles to each end. */
static void make_spindles(model *m, bool quick)
{
    const size_t count = quick ? 8 : 16, around = 32;
    const uint32_t tip = model_more(m, 1, 0);
    size_t i, j;
    int k;

    for (i = 0; i < count; i++) {
        const size_t triangle = m->triangle_count;
        const uint32_t first = model_more(m, around + 1, 2 * around);
        const double thick = power_of_ten(-6, -2);
        line axis;
        double across[2][3];

        any_direction(axis.dir);
        across_line(&axis, across);
        for (j = 0; j < around; j++) {
            const double turn = 6.283185307179586 * (double)j / (double)around;
            const uint32_t a = first + (uint32_t)j, b = first + (uint32_t)((j + 1) % around);
            double at[3];

            for (k = 0; k < 3; k++) at[k] = 0.5 * axis.dir[k] + thick * (cos(turn) * across[0][k] + sin(turn) * across[1][k]);
            put_vertex(m, a, at[0], at[1], at[2]);
            put_triangle(m, triangle + 2 * j, tip, b, a);
            put_triangle(m, triangle + 2 * j + 1, first + (uint32_t)around, a, b);
        }
        put_vertex(m, first + (uint32_t)around, axis.dir[0], axis.dir[1], axis.dir[2]);
    }
    m->closed = 1;
}

/* 48 sheets, one above the other by one unit in the last place and up to 1e-3; and as many tilted. */
static void make_stack(model *m, bool quick)
{
    const size_t fine = 2;
    int tilt, i;

    (void)quick;
    for (tilt = 0; tilt < 2; tilt++) {
        double height = 1;

        for (i = 0; i < 48; i++) {
            const double from[3] = { tilt * 2.5, height, 0 }, along[3] = { 1, 0.3 * tilt, 0.1 * tilt }, up[3] = { 0, 0.2 * tilt, 1 };

            add_grid(m, fine, fine, from, along, up);
            height += i < 16 ? 0x1p-23 : 0x1p-23 * pow(1e-3 * 0x1p23, (i - 15) / 32.0);
        }
    }
}

/* Each triangle of a torus 2 to 16 times: the first of the same is what is hit. */
static void make_copies(model *m, bool quick)
{
    size_t once, i, round;

    model_wrap(m, quick ? 16 : 30, quick ? 10 : 16, true, on_torus);
    once = m->triangle_count;
    for (round = 1; round < 16; round++)
        for (i = 0; i < once; i++)
            if (round < 2 + i % 15) {
                (void)model_more(m, 0, 1);
                memcpy(m->indices + 3 * (m->triangle_count - 1), m->indices + 3 * i, 3 * sizeof *m->indices);
            }
    m->twin = need(m->triangle_count, sizeof *m->twin);
    for (i = 0, round = 0; round < 16; round++) {
        size_t j;
        for (j = 0; j < once; j++)
            if (!round || round < 2 + j % 15) m->twin[i++] = (uint32_t)j;
    }
}

/* A torus, and on it triangles without area: points, edges twice, edges with their middle, and the like apart from it. */
static void make_degenerate(model *m, bool quick)
{
    size_t count, i;

    model_wrap(m, quick ? 32 : 60, quick ? 16 : 30, true, on_torus);
    count = m->triangle_count;
    for (i = 0; i < count; i += 2) {
        const uint32_t a = m->indices[3 * i], b = m->indices[3 * i + 1];
        const uint32_t c = model_more(m, 1, 1);
        int k;

        for (k = 0; k < 3; k++) m->vertices[3 * c + (uint32_t)k] = (m->vertices[3 * a + (uint32_t)k] + m->vertices[3 * b + (uint32_t)k]) / 2;
        if (i % 8 == 6) put_vertex(m, c, 0.1, 0.2, 1e-3 * (double)i);
        if (i % 8 == 0) put_triangle(m, m->triangle_count - 1, a, a, a);
        else if (i % 8 == 2) put_triangle(m, m->triangle_count - 1, a, b, a);
        else if (i % 8 == 4) put_triangle(m, m->triangle_count - 1, a, c, b);
        else put_triangle(m, m->triangle_count - 1, c, c, a);
    }
    m->closed = 1;
}

/* The teapot in the stadium: a torus of size 1 on a ground a million times as large, in the middle of it and a way off. From afar rounding is
   as large as the torus: all of it is tested, so it is a coarse one. */
static void make_stadium(model *m, bool quick)
{
    const double from[3] = { -1e6, 0, -1e6 }, along[3] = { 2e6, 0, 0 }, up[3] = { 0, 0, 2e6 };

    (void)quick;
    model_wrap(m, 20, 10, true, on_torus);
    model_place(m, 1, 0.8);
    m->detail = m->triangle_count;
    memcpy(m->near, m->center, sizeof m->near);
    m->reach = m->radius;
    add_grid(m, 8, 8, from, along, up);
}

/* Half a metre of ground between its points, millimetres high, and a row of boxes millimetres apart. */
static void make_terrain(model *m, bool quick)
{
    const size_t side = 24;                 /* rounding covers many cells: of more, most would be tested */
    const double from[3] = { 0, 0, 0 }, along[3] = { 0.5 * (double)side, 0, 0 }, up[3] = { 0, 0, 0.5 * (double)side };
    size_t i;

    (void)quick;
    add_grid(m, side, side, from, along, up);
    for (i = 0; i < m->vertex_count; i++) m->vertices[3 * i + 1] = (float)(0.004 * unit());
    for (i = 0; i < 20; i++) {
        const double low[3] = { 0.2 + 0.503 * (double)i, 0.003, 5 }, high[3] = { low[0] + 0.5, 0.7, 5.5 };
        add_box(m, low, high);
    }
}

/* Spheres of 1e-6 to 1, many of them nested, some touching, some of radius 0. */
static void add_spheres(model *m, size_t count)
{
    size_t i;
    int k;

    for (i = 0; i < count; i++) {
        double center[3];

        any_direction(center);
        for (k = 0; k < 3; k++) center[k] *= 2 * cbrt(unit());
        add_sphere(m, center, i % 64 ? power_of_ten(-6, 0) * 0.3 : 0);
    }
    for (i = 0; i < count / 8; i++) {
        const double center[3] = { 1, 1, 1 }, in_a_row[3] = { -1 + 0.25 * (double)(i % 9), -1, 0.5 * (double)(i / 9) };
        add_sphere(m, center, 0.5 + 0x1p-20 * (double)(i * i));
        add_sphere(m, in_a_row, 0.125);
    }
}

static void make_spheres(model *m, bool quick) { add_spheres(m, quick ? 100 : 400); }

/* Radius 1e-6 a million away, and radius 1e6 with its wall beside the origin. */
static void make_far_spheres(model *m, bool quick)
{
    const double giant[3] = { 0, -1e6, 0 };
    int i, k;

    for (i = 0; i < (quick ? 50 : 200); i++) {
        double center[3];

        any_direction(center);
        for (k = 0; k < 3; k++) center[k] *= i % 4 ? 1e6 : 2;
        center[1] = fabs(center[1]);
        add_sphere(m, center, i % 4 ? power_of_ten(-6, 5) : power_of_ten(-6, 0));
    }
    add_sphere(m, giant, 1e6);
    m->reach = 2;
}

static void make_mixed(model *m, bool quick)
{
    model_wrap(m, quick ? 24 : 60, quick ? 12 : 30, true, on_torus);
    add_spheres(m, quick ? 50 : 200);
}

/* Triangles a thousand across, many of them nearly in one plane. */
static void make_large(model *m, bool quick)
{
    int i, j, k;

    (void)quick;
    for (i = 0; i < 60; i++) {
        double p[3][3];

        for (j = 0; j < 3; j++) {
            any_direction(p[j]);
            for (k = 0; k < 3; k++) p[j][k] *= 1000;
            if (i % 2) p[j][1] = 1e-3 * unit() * i;
        }
        add_triangle(m, p[0], p[1], p[2]);
    }
}

/* Unit boxes on integers, every third left out. */
static void make_boxes(model *m, bool quick)
{
    const int side = quick ? 5 : 8;
    int x, y, z;

    for (z = 0; z < side; z++)
        for (y = 0; y < side; y++)
            for (x = 0; x < side; x++)
                if ((x + y + z) % 3) {
                    const double low[3] = { x, y, z }, high[3] = { x + 1, y + 1, z + 1 };
                    add_box(m, low, high);
                }
}

/* Ever smaller triangles towards a corner, and trees that follow them down. */
static void make_deep(model *m, bool quick)
{
    double size = 1;
    int i;

    (void)quick;
    for (i = 0; i < 160; i++, size *= 0.7) {
        const double a[3] = { 0.99 * size, size, size }, b[3] = { size, 0.9 * size, size }, c[3] = { size, size, 0.9 * size };
        add_triangle(m, a, b, c);
    }
    m->traversal_cost = 0.01f;
}

/* A torus seen through transforms of all kinds: turned, sheared, mirrored, 1e-5 to 1e5 as large, or nearly flat. */
static void make_instances(model *m, bool quick)
{
    const size_t count = 12;
    size_t i;
    int j, k;

    (void)quick;
    m->child = need(1, sizeof *m->child);
    model_wrap(m->child, 12, 6, true, on_torus);
    model_measure(m->child);
    m->instances = need(count, sizeof *m->instances);
    m->instance_count = count;
    for (i = 0; i < count; i++) {
        const double size = pow(10, -5 + 10 * (double)i / (double)(count - 1));
        double rows[3][3], at[3];

        for (k = 0; k < 3; k++) any_direction(rows[k]);
        any_direction(at);
        if (i % 4 == 1)                     /* nearly singular: a row that is nearly the sum of the others */
            for (j = 0; j < 3; j++) rows[2][j] = rows[0][j] + rows[1][j] + power_of_ten(-6, -2) * rows[2][j];
        if (i % 4 == 2)                     /* one axis alone, mirrored */
            for (j = 0; j < 9; j++) rows[j / 3][j % 3] = j % 4 ? 0 : j ? 1 : -1;
        for (k = 0; k < 3; k++) {
            for (j = 0; j < 3; j++) m->instances[i].transform[4 * k + j] = (float)(size * rows[k][j]);
            m->instances[i].transform[4 * k + 3] = (float)(3 * size * at[k]);
        }
    }
}

/* Ground without end, discs on it and across, and something that stands there. */
static void make_planes(model *m, bool quick)
{
    const size_t count = 12;
    size_t i;

    model_wrap(m, quick ? 24 : 60, quick ? 12 : 30, true, on_torus);
    m->planes = need(count, sizeof *m->planes);
    m->plane_count = count;
    for (i = 0; i < count; i++) {
        double n[3], at[3];

        any_direction(n);
        any_direction(at);
        if (i < 2) n[0] = n[2] = 0, n[1] = 1, at[1] = -1 - (double)i * 0x1p-20;
        m->planes[i].point = vec3(at);
        m->planes[i].normal = vec3(n);
        m->planes[i].radius = i < 3 ? 0 : (float)power_of_ten(-3, 0.5);
    }
}

/* ---- >>rays --------------------------------------------------------------------------------------------------------- */

typedef enum { AT_RANDOM, AT_EDGES, AT_VERTICES, ON_GRID, GRAZING, ODD, LENGTHS, BOUNDS, STEPS, IN_PLANES, ON_SURFACES, BAD, AIMS } aim;
static const char *const aim_names[AIMS] = {
    "at random", "at edges", "at vertices", "along axes", "grazing", "with odd components", "of all lengths", "with bounds at hits",
    "stepping from hit to hit", "in planes", "from surfaces", "some bad",
};

/* Rays follow each other in packets of 256 that start at one point and go to neighbours; every eighth thousand is without order. Where there
   are few, packets of 16 and every eighth 64. */
enum { BUNDLE = 256, BLOCK = 1024 };

/* What the rays of a bundle have in common. */
typedef struct {
    const suite *s;
    const model *m;                         /* whose primitives are aimed at: s->m, or the child of an instance, with its transform */
    const truth_tree *tree;
    const float *transform;
    bool order;
    size_t start;                           /* the first primitive, in the tree's order */
    double from[3], at[3];                  /* where they start; around what those at random go */
} bundle;

/* transform NULL: where it is. */
static void to_world(const float *transform, double at[3])
{
    double out[3];
    int k;

    if (!transform) return;
    for (k = 0; k < 3; k++)
        out[k] = (double)transform[4 * k] * at[0] + (double)transform[4 * k + 1] * at[1] + (double)transform[4 * k + 2] * at[2] +
                 (double)transform[4 * k + 3];
    memcpy(at, out, sizeof out);
}

/* A triangle or sphere by chance, near the others of the bundle. */
static uint32_t choose(const bundle *b)
{
    const size_t count = b->m->triangle_count + b->m->sphere_count, detail = b->m->detail;
    const size_t number = b->order ? b->start + (size_t)(64 * unit()) : (size_t)(unit() * (double)count);

    if (detail && unit() < 0.9) return (uint32_t)(number % detail);
    return b->tree->order[number % count];
}

/* A point to aim at: anywhere on a triangle, on an edge, or a corner; on a sphere, where the ray from org touches it within rounding, or its
   middle. */
static void aim_at(const bundle *b, aim how, const double org[3], double at[3])
{
    const uint32_t prim = choose(b);
    double w[3] = { unit(), unit(), 0 };
    int k;

    if (prim >= b->m->triangle_count) {
        const double part = how == AT_EDGES ? 1 + (unit() - 0.5) * power_of_ten(-16, -6) : how == AT_VERTICES ? 0 : unit();
        const double radius = part * sphere_radius(b->m, prim);
        line l;
        double across[2][3], turn = 6.283185307179586 * unit();

        for (k = 0; k < 3; k++) {
            at[k] = sphere_center(b->m, prim, k);
            l.dir[k] = at[k] - org[k];
        }
        across_line(&l, across);            /* across the way to its middle, then on the cone of tangents: as far along as sine tells */
        w[0] = sqrt(dot(l.dir, l.dir));
        w[1] = w[0] > radius ? radius / w[0] : 1;
        for (k = 0; k < 3; k++)
            at[k] += radius * (sqrt(1 - w[1] * w[1]) * (cos(turn) * across[0][k] + sin(turn) * across[1][k]) - w[1] * l.dir[k] / w[0]);
        return;
    }
    if (how == AT_EDGES) w[1] = 1 - w[0];
    if (how == AT_VERTICES || how == ON_GRID) w[0] = 1, w[1] = 0;
    if (w[0] + w[1] > 1) w[0] = 1 - w[0], w[1] = 1 - w[1];
    w[2] = 1 - w[0] - w[1];
    for (k = 0; k < 3; k++) at[k] = w[0] * corner(b->m, prim, 0, k) + w[1] * corner(b->m, prim, 1, k) + w[2] * corner(b->m, prim, 2, k);
    to_world(b->transform, at);
}

static void start_bundle(const suite *s, bool order, bundle *b)
{
    const model *top = &s->m;
    const truth_tree *tree = top->child ? &s->child_tree : &s->tree;
    const double part = unit() < 0.25 ? 0.3 : 2.5;
    double center[3], size = top->radius;
    int k;

    b->s = s, b->m = tree->m, b->tree = tree, b->transform = NULL, b->order = order;
    b->start = (size_t)(unit() * (double)(b->m->triangle_count + b->m->sphere_count));
    memcpy(center, top->center, sizeof center);
    if (top->reach > 0 && unit() < 0.5) {
        memcpy(center, top->near, sizeof center);
        size = top->reach;
    }
    if (top->child) {
        b->transform = top->instances[(size_t)(unit() * (double)top->instance_count)].transform;
        memcpy(center, top->child->center, sizeof center);
        to_world(b->transform, center);
        for (k = 0, size = 0; k < 12; k++) size += k % 4 == 3 ? 0 : fabs((double)b->transform[k]);
        if (unit() < 0.2) size = top->radius;
    }
    any_direction(b->from);
    any_direction(b->at);
    for (k = 0; k < 3; k++) {
        b->from[k] = center[k] + part * size * b->from[k];
        b->at[k] = center[k] + cbrt(unit()) * size * b->at[k];
    }
}

static float component(rt_vec3 *v, int k, const float *set)
{
    float *x = k == 0 ? &v->x : k == 1 ? &v->y : &v->z;

    if (set) *x = *set;
    return *x;
}

static void set_ray(rt_ray *ray, const double org[3], const double at[3])
{
    double dir[3];
    int k;

    ray->org = vec3(org);
    for (k = 0; k < 3; k++) dir[k] = at[k] - (double)component(&ray->org, k, NULL);
    ray->dir = vec3(dir);
    if (ray->dir.x == 0 && ray->dir.y == 0 && ray->dir.z == 0) ray->dir.x = 1;
    ray->tmin = 0;
    ray->tmax = INFINITY;
}

/* Towards a point of the model, see aim_at; on a grid: along an axis through a vertex. */
static void plain_ray(const bundle *b, aim how, rt_ray *ray)
{
    double at[3], org[3], dir[3] = { 0, 0, 0 };
    int k;

    if (how == AT_RANDOM) {
        any_direction(at);
        for (k = 0; k < 3; k++) at[k] = b->at[k] + (b->order ? 0.05 : 1) * b->s->m.radius * unit() * at[k];
    } else aim_at(b, how, b->from, at);
    memcpy(org, b->from, sizeof org);
    if (how == ON_GRID) {
        const int axis = (int)(3 * (b->order ? (double)(b->start % 3) / 3 : unit()));

        for (k = 0; k < 3; k++)
            if (k != axis) org[k] = at[k];
        dir[axis] = (double)(float)at[axis] - (double)(float)org[axis];
        if (dir[axis] == 0) dir[axis] = 1;
        set_ray(ray, org, at);
        ray->dir = vec3(dir);
        return;
    }
    set_ray(ray, org, at);
}

/* Within 1e-7 of a triangle's or plane's plane, through a point of it, or by it. */
static void grazing_ray(const bundle *b, rt_ray *ray)
{
    const bool ground = b->m->plane_count && unit() < 0.7;
    const uint32_t prim = ground ? (uint32_t)first_plane(b->m) + (uint32_t)(unit() * (double)b->m->plane_count) : choose(b);
    double at[3], n[3], along[3], org[3], length, tilt = 2e-7 * (unit() - 0.5), back = power_of_ten(-3, 1);
    int i, k;

    if (prim >= b->m->triangle_count) {
        const rt_plane *plane = plane_of(b->m, prim);
        const line l = { { 0, 0, 0 }, { (double)plane->normal.x, (double)plane->normal.y, (double)plane->normal.z }, 0, 0, true };
        const double turn = 6.283185307179586 * unit(), from[3] = { (double)plane->point.x, (double)plane->point.y, (double)plane->point.z };
        double across[2][3];

        across_line(&l, across);
        length = sqrt(dot(l.dir, l.dir));
        for (k = 0; k < 3; k++) {
            n[k] = l.dir[k] / length;
            along[k] = cos(turn) * across[0][k] + sin(turn) * across[1][k];
            at[k] = from[k] + 2 * (double)plane->radius * (unit() - 0.5) * along[k];
        }
    } else {
        double e[2][3], u = unit(), v = unit();

        for (k = 0; k < 3; k++) {
            e[0][k] = corner(b->m, prim, 1, k) - corner(b->m, prim, 0, k);
            e[1][k] = corner(b->m, prim, 2, k) - corner(b->m, prim, 0, k);
            at[k] = corner(b->m, prim, 0, k) + u * e[0][k] + v * e[1][k];
        }
        u = unit() - 0.5, v = unit() - 0.5;
        for (k = 0; k < 3; k++) {
            const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            n[k] = e[0][k1] * e[1][k2] - e[0][k2] * e[1][k1];
            along[k] = u * e[0][k] + v * e[1][k];
        }
        length = sqrt(dot(n, n));
        for (k = 0; k < 3; k++) n[k] = length > 0 ? n[k] / length : 0;
    }
    length = sqrt(dot(along, along));
    for (i = 0; i < 3; i++) org[i] = at[i] - back * (along[i] + tilt * length * n[i]);
    set_ray(ray, org, at);
}

/* Components that are zero, of either sign, far below the others, or denormal; the largest within the limits. */
static void odd_ray(const bundle *b, rt_ray *ray)
{
    static const float parts[] = { 0, -0.0f, 1e-45f, -1e-45f, 1e-40f, 1.2e-38f, -1e-30f, 1e-20f, 1e-9f, -1e-7f };
    int k, most = 0;

    plain_ray(b, unit() < 0.5 ? AT_EDGES : ON_GRID, ray);
    for (k = 1; k < 3; k++)
        if (fabsf(component(&ray->dir, k, NULL)) > fabsf(component(&ray->dir, most, NULL))) most = k;
    for (k = 0; k < 3; k++) {
        const float part = parts[(size_t)(unit() * COUNT(parts))], old = component(&ray->dir, k, NULL);
        const float way = (float)(unit() < 0.5 ? (double)part : (double)part * (double)old);

        if (k != most && unit() < 0.6) (void)component(&ray->dir, k, &way);
    }
    if (unit() < 0.3) {                     /* the largest as small, or as large, as may be */
        const double size = fabs((double)component(&ray->dir, most, NULL));
        double to = unit() < 0.5 ? 1.001 * (double)RT_MIN_DIRECTION : 0.999 * (double)RT_MAX_DIRECTION;

        for (k = 0; k < 3; k++) {
            const float scaled = (float)((double)component(&ray->dir, k, NULL) / size * to);
            (void)component(&ray->dir, k, &scaled);
        }
    }
}

/* tmin and tmax at what the line meets, beside it, turned round, infinite, below 0. */
static void bounded_ray(const bundle *b, rt_ray *ray, ruler *r)
{
    const float low[] = { -INFINITY, -3, -0.0f, 0, INFINITY };
    float ends[2];
    int k;

    plain_ray(b, unit() < 0.5 ? AT_EDGES : AT_VERTICES, ray);
    (void)rule_find(b->s, ray, r);
    for (k = 0; k < 2; k++) {
        const double kind = unit();
        float t = r->count ? r->list[(size_t)(unit() * (double)r->count)].hit.t : 1;

        if (kind < 0.25) t = nextafterf(t, -INFINITY);
        else if (kind < 0.5) t = nextafterf(t, INFINITY);
        else if (kind > 0.85) t = low[(size_t)(unit() * COUNT(low))];
        ends[k] = t;
    }
    if (ends[0] > ends[1] && unit() < 0.8) ray->tmin = ends[1], ray->tmax = ends[0];
    else ray->tmin = ends[0], ray->tmax = ends[1];
    if (unit() < 0.3) ray->tmax = INFINITY;
}

/* In a plane of a vertex: an axis across it is not moved along at all; aimed at another vertex or along an axis, from whole numbers too. */
static void ray_in_planes(const bundle *b, rt_ray *ray)
{
    const int across = (int)(3 * unit()), second = (across + 1 + (int)(2 * unit())) % 3;
    double at[3], org[3];
    int k;

    aim_at(b, AT_VERTICES, b->from, at);
    for (k = 0; k < 3; k++) org[k] = unit() < 0.5 ? floor(b->from[k]) : b->from[k];
    org[across] = at[across];
    if (unit() < 0.5) org[second] = at[second];
    if (unit() < 0.2)
        for (k = 0; k < 3; k++) org[k] = k == across ? at[k] : 2 * at[k] - org[k];
    set_ray(ray, org, at);
}

/* On a primitive, to anywhere; of spheres: on the wall, within, along a tangent. */
static void ray_from_surface(const bundle *b, rt_ray *ray)
{
    const uint32_t prim = choose(b);
    double at[3], org[3];
    int k, axis = (int)(3 * unit());

    any_direction(at);
    if (prim >= b->m->triangle_count) {
        double to = sphere_radius(b->m, prim);

        for (k = 0; k < 3; k++) org[k] = sphere_center(b->m, prim, k);
        if (unit() < 0.6) {                 /* where an axis meets the wall; half of these go along the wall */
            org[axis] += unit() < 0.5 ? to : -to;
            if (unit() < 0.5) at[axis] = 0;
        } else {
            double side[3];

            any_direction(side);
            to *= unit() < 0.5 ? 1 : unit();
            for (k = 0; k < 3; k++) org[k] += to * side[k];
        }
    } else aim_at(b, unit() < 0.4 ? AT_EDGES : unit() < 0.5 ? AT_VERTICES : AT_RANDOM, b->from, org);
    set_ray(ray, org, org);
    ray->dir = vec3(at);
}

/* What misses whatever is there. */
enum { BADS = 14 };
static void spoil(rt_ray *ray, int how)
{
    const float wrong[] = { NAN, INFINITY, -INFINITY };
    const double kind = unit();
    const int k = (int)(3 * unit());
    const float value = wrong[how % 3], far = 1.001f * RT_MAX_COORDINATE, small = 0.99f * RT_MIN_DIRECTION, large = 1.01f * RT_MAX_DIRECTION;
    int i;

    if (how < 3) (void)component(&ray->org, k, &value);
    else if (how < 6) (void)component(&ray->dir, k, &value);
    else if (how == 6) (void)component(&ray->org, k, &far);
    else if (how == 7) (void)component(&ray->dir, k, &large);
    else if (how == 8) ray->dir.x = ray->dir.y = ray->dir.z = kind < 0.5 ? 0 : -0.0f;
    else if (how == 9)
        for (i = 0; i < 3; i++) (void)component(&ray->dir, i, &small);
    else if (how == 10) ray->tmin = NAN;
    else if (how == 11) ray->tmax = NAN;
    else if (how == 12) ray->tmin = 2, ray->tmax = kind < 0.5 ? 1 : 2;
    else ray->dir.x = ray->dir.y = 0, ray->dir.z = 1e-40f;
}

static void make_ray(const bundle *b, aim how, rt_ray *ray, ruler *r)
{
    double to;

    switch (how) {
    case GRAZING: grazing_ray(b, ray); break;
    case ODD: odd_ray(b, ray); break;
    case LENGTHS:
        plain_ray(b, AT_EDGES, ray);
        to = power_of_ten(-18, 18);
        ray->dir.x = (float)((double)ray->dir.x * to);
        ray->dir.y = (float)((double)ray->dir.y * to);
        ray->dir.z = (float)((double)ray->dir.z * to);
        break;
    case BOUNDS: bounded_ray(b, ray, r); break;
    case IN_PLANES: ray_in_planes(b, ray); break;
    case ON_SURFACES: ray_from_surface(b, ray); break;
    case BAD:
        plain_ray(b, AT_EDGES, ray);
        if (unit() < 0.3) spoil(ray, (int)(BADS * unit()));
        break;
    case STEPS: plain_ray(b, unit() < 0.5 ? AT_EDGES : AT_RANDOM, ray); break;
    default: plain_ray(b, how, ray);
    }
}

/* s->count rays. Stepping: each goes on behind the hit of the one before, until there is none. */
static void make_rays(suite *s, aim how)
{
    const bool few = s->count < 16 * BLOCK;
    ruler *r = need(1, sizeof *r);
    faults none;
    bundle b;
    rt_hit hit;
    size_t i;

    r->found = &none;
    for (i = 0; i < s->count; i++) {
        const bool order = i / (few ? BLOCK / 16 : BLOCK) % 8 != 7;

        if (!order || i % (few ? BUNDLE / 16 : BUNDLE) == 0) start_bundle(s, order, &b);
        if (how == STEPS && i % 16 && rt_intersect(s->accels[RT_BVH], &s->rays[i - 1], &hit)) {
            s->rays[i] = s->rays[i - 1];
            s->rays[i].tmin = hit.t;
        } else make_ray(&b, how, &s->rays[i], r);
    }
    free(r);
}

/* ---- >>table -------------------------------------------------------------------------------------------------------- */

typedef struct { const char *name; double scale, offset; } place;
static const place everywhere[] = {
    { "", 1, 0 }, { " x 1e-6", 1e-6, 0 }, { " x 1e6", 1e6, 0 }, { " 100 radii away", 1, 100 }, { " 2^17 radii away", 1, 131072 },
};
static const place on_maps[] = { { " at 5e5", 1, 5e5 }, { " at 4e6", 1, 4e6 } };

#define A(aim) (1u << (aim))
#define USUAL (A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES) | A(ON_GRID))

/* Each row with each aim is a suite over its places. */
static const struct { const char *name; void (*make)(model *m, bool quick); unsigned aims; const place *places; size_t place_count; } table[] = {
    { "sphere",      make_sphere,      USUAL, everywhere, COUNT(everywhere) },
    { "torus",       make_torus,       USUAL, everywhere, COUNT(everywhere) },
    { "torus",       make_torus,       A(ODD) | A(LENGTHS) | A(BOUNDS) | A(STEPS) | A(ON_SURFACES) | A(BAD), everywhere, 1 },
    { "scan",        make_scan,        USUAL | A(STEPS), everywhere, 1 },
    { "slivers",     make_slivers,     USUAL, everywhere, 1 },
    { "needles",     make_needles,     A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES) | A(GRAZING), everywhere, 1 },
    { "spindles",    make_spindles,    A(AT_EDGES) | A(AT_VERTICES) | A(STEPS) | A(LENGTHS), everywhere, 1 },
    { "stack",       make_stack,       A(AT_RANDOM) | A(AT_EDGES) | A(GRAZING) | A(BOUNDS) | A(STEPS), everywhere, 1 },
    { "copies",      make_copies,      A(AT_RANDOM) | A(AT_EDGES) | A(BOUNDS), everywhere, 1 },
    { "degenerate",  make_degenerate,  USUAL | A(STEPS), everywhere, 1 },
    { "stadium",     make_stadium,     A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES), everywhere, 1 },
    { "terrain",     make_terrain,     USUAL, on_maps, COUNT(on_maps) },
    { "spheres",     make_spheres,     A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES) | A(ON_SURFACES) | A(BOUNDS) | A(LENGTHS), everywhere, 1 },
    { "far spheres", make_far_spheres, A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES) | A(ON_SURFACES), everywhere, 1 },
    { "mixed",       make_mixed,       A(AT_RANDOM) | A(AT_EDGES) | A(STEPS), everywhere, 1 },
    { "large",       make_large,       A(AT_EDGES) | A(GRAZING), everywhere, 1 },
    { "boxes",       make_boxes,       A(AT_EDGES) | A(ON_GRID) | A(IN_PLANES) | A(STEPS) | A(ODD), everywhere, 1 },
    { "deep",        make_deep,        A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES), everywhere, 1 },
    { "instances",   make_instances,   A(AT_RANDOM) | A(AT_EDGES) | A(AT_VERTICES) | A(BOUNDS) | A(LENGTHS), everywhere, 1 },
    { "planes",      make_planes,      A(AT_RANDOM) | A(AT_EDGES) | A(GRAZING) | A(LENGTHS), everywhere, 1 },
};

#undef A
#undef USUAL
