/* accuracy_leave.h - rays that go on from a hit: whether they meet the surface they leave, or leak out of a closed box. Part of accuracy.c.
   SPDX-License-Identifier: MIT OR Unlicense */

/* Of rays from that kind of origins, how many went wrong; and nanoseconds an origin, on one thread; 0: not measured. */
typedef struct { const char *name; uint64_t rays, wrong; double ns; bool ours; } leave_result;

/* How an origin is found. */
typedef enum { SPAWN, ALONG_RAY, FIXED, ORIGINS } origin_kind;
static const char *const origin_names[] = { "rt_spawn_origin", "org + t dir", "that + 1e-4 along the normal" };

static rt_vec3 to_vec(const double a[3])
{
    const rt_vec3 v = { (float)a[0], (float)a[1], (float)a[2] };

    return v;
}

static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* A kind of primitive, what it is seen through, and rays to it. */
typedef enum { ONE_TRIANGLE, ONE_SPHERE, ONE_PLANE, IN_INSTANCE, LEAVE_KINDS } leave_kind;
static const char *const leave_names[] = { "self-hits: triangles of 1e-8 to 1e8", "self-hits: spheres of 1e-6 to 1e6", "self-hits: planes and discs",
                                           "self-hits: triangles in sheared, mirrored, moving instances" };

typedef struct {
    float vertices[9];
    rt_sphere sphere;
    rt_plane plane;
    rt_instance instance;
    rt_motion motion;
    rt_geometry inner, world;
    rt_accel *inner_accel, *accel;
    float time;
} leave_model;

static void leave_build(rt_accel **accel, const rt_geometry *geometry)
{
    rt_build_options build;
    rt_error error;

    memset(&build, 0, sizeof build);
    build.error = &error;
    if (rt_build(accel, geometry, &build) == RT_OK) return;
    complain("leaving: %s", error.message);
    exit(EXIT_FAILURE);
}

/* center, size: where rays are to go. */
static void leave_make(leave_model *m, leave_kind which, uint64_t *d, double center[3], double *size)
{
    double low[3], high[3];
    int i, k;

    memset(m, 0, sizeof *m);
    for (k = 0; k < 3; k++) center[k] = (roll(d) < 0.5 ? -1 : 1) * roll_log(d, -8, 8);
    if (which == ONE_SPHERE) {
        const double away = roll_log(d, -3, 3);

        m->sphere.radius = (float)roll_log(d, -6, 6);
        for (k = 0; k < 3; k++) center[k] = (2 * roll(d) - 1) * away * (double)m->sphere.radius;
        m->sphere.center = to_vec(center);
        m->inner.spheres = &m->sphere, m->inner.sphere_count = 1;
        *size = (double)m->sphere.radius;
    } else if (which == ONE_PLANE) {
        double n[3];

        roll_direction(d, n);
        *size = roll_log(d, -4, 4);
        for (k = 0; k < 3; k++) center[k] = (2 * roll(d) - 1) * 100 * *size;
        m->plane.point = to_vec(center);
        m->plane.normal = to_vec(n);
        m->plane.radius = roll(d) < 0.5 ? 0 : (float)*size;
        m->inner.planes = &m->plane, m->inner.plane_count = 1;
    } else {
        for (i = 0; i < 9; i++) m->vertices[i] = (float)((roll(d) < 0.5 ? -1 : 1) * (which == ONE_TRIANGLE ? roll_log(d, -8, 8) : roll_log(d, -3, 3)));
        m->inner.vertices = m->vertices, m->inner.vertex_count = 3, m->inner.triangle_count = 1;
        for (k = 0, *size = 0; k < 3; k++) {
            low[k] = fmin(m->vertices[k], fmin(m->vertices[3 + k], m->vertices[6 + k]));
            high[k] = fmax(m->vertices[k], fmax(m->vertices[3 + k], m->vertices[6 + k]));
            center[k] = (low[k] + high[k]) / 2;
            *size = fmax(*size, high[k] - low[k]);
        }
    }
    leave_build(&m->inner_accel, &m->inner);
    if (which != IN_INSTANCE) return;
    for (i = 0; i < 12; i++) m->instance.transform[i] = (float)((2 * roll(d) - 1) * (i % 4 == 3 ? roll_log(d, -2, 3) : roll_log(d, -2, 2)));
    m->motion.move = to_vec(center);
    m->motion.axis.y = 1, m->motion.axis.x = 0.5f, m->motion.angle = (float)(3 * roll(d));
    m->time = roll(d) < 0.5 ? 0 : (float)roll(d);
    m->instance.motion = roll(d) < 0.5 ? &m->motion : NULL;
    m->instance.accel = m->inner_accel;
    m->world.instances = &m->instance, m->world.instance_count = 1;
    leave_build(&m->accel, &m->world);
}

static void leave_free(leave_model *m)
{
    rt_free(m->accel);
    rt_free(m->inner_accel);
}

static rt_hit trace_at(const rt_accel *accel, const rt_ray *ray, float time)
{
    rt_trace_options o;
    rt_hit hit;

    memset(&o, 0, sizeof o);
    o.algorithm = RT_BVH_STACK;
    o.times = &time;
    if (rt_trace(accel, &o, ray, 1, &hit) != RT_OK) hit.prim = RT_NONE;
    return hit;
}

/* The origin of a ray to dir from a hit, as that way has it; normal: towards dir. */
static rt_vec3 find_origin(origin_kind which, const rt_geometry *geo, const float *transform, const rt_ray *ray, const rt_hit *hit, const double normal[3],
                           rt_vec3 dir)
{
    rt_vec3 at = { ray->org.x + hit->t * ray->dir.x, ray->org.y + hit->t * ray->dir.y, ray->org.z + hit->t * ray->dir.z };

    if (which == SPAWN) return rt_spawn_origin(geo, transform, ray, hit, dir);
    if (which == FIXED) at.x += (float)(1e-4 * normal[0]), at.y += (float)(1e-4 * normal[1]), at.z += (float)(1e-4 * normal[2]);
    return at;
}

/* The unit normal at a hit, in the world. */
static void normal_at(const leave_model *m, leave_kind which, const float transform[12], const float normals[9], const rt_ray *ray, const rt_hit *hit, double n[3])
{
    double length, object[3];
    int k;

    if (which == ONE_SPHERE) {
        n[0] = (double)ray->org.x + (double)hit->t * (double)ray->dir.x - (double)m->sphere.center.x;
        n[1] = (double)ray->org.y + (double)hit->t * (double)ray->dir.y - (double)m->sphere.center.y;
        n[2] = (double)ray->org.z + (double)hit->t * (double)ray->dir.z - (double)m->sphere.center.z;
    } else if (which == ONE_PLANE) n[0] = (double)m->plane.normal.x, n[1] = (double)m->plane.normal.y, n[2] = (double)m->plane.normal.z;
    else {
        double a[3], b[3];
        for (k = 0; k < 3; k++) {
            a[k] = (double)m->vertices[3 + k] - (double)m->vertices[k];
            b[k] = (double)m->vertices[6 + k] - (double)m->vertices[k];
        }
        for (k = 0; k < 3; k++) object[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        for (k = 0; k < 3; k++)
            n[k] = transform ? (double)normals[3 * k] * object[0] + (double)normals[3 * k + 1] * object[1] + (double)normals[3 * k + 2] * object[2] : object[k];
    }
    length = sqrt(dot3(n, n));
    for (k = 0; k < 3; k++) n[k] /= length;
}

typedef struct { leave_kind which; origin_kind how; uint64_t rays_each; uint64_t *rays, *wrong; double *seconds; } leave_job;

/* One model: a ray to it, and many that go on to both sides, none of which may meet it, unless it is a sphere and they go into it. */
static void leave_one(void *context, size_t number)
{
    const leave_job *work = context;
    uint64_t d = number * 7919 + (uint64_t)work->which;     /* numbers of its own: as many threads as there are */
    double center[3], size, n[3], start;
    float transform[12], normals[9];
    const rt_accel *accel;
    uint64_t i, tries;
    leave_model m;
    int k;

    leave_make(&m, work->which, &d, center, &size);
    accel = m.accel ? m.accel : m.inner_accel;
    if (m.accel && !rt_instance_transform_at(accel, 0, m.time, transform, normals)) goto done;
    for (tries = 0; tries < 200; tries++) {
        double from[3], at[3], dir[3], side;
        rt_ray ray = { { 0, 0, 0 }, 0, { 0, 0, 0 }, INFINITY }, next = ray;
        const float *seen = m.accel ? transform : NULL;
        rt_hit hit;

        roll_direction(&d, from);
        roll_direction(&d, at);
        for (k = 0; k < 3; k++) {
            const double r = work->which == ONE_SPHERE && tries % 2 ? 0.5 : 3;
            from[k] = center[k] + r * size * from[k];
            at[k] = center[k] + 0.6 * size * roll(&d) * at[k];
        }
        if (work->which == ONE_TRIANGLE || work->which == IN_INSTANCE) {
            double u = roll(&d), v = roll(&d) * (1 - u);
            for (k = 0; k < 3; k++) at[k] = (1 - u - v) * (double)m.vertices[k] + u * (double)m.vertices[3 + k] + v * (double)m.vertices[6 + k];
        }
        to_world(seen, from);               /* where an instance shows them */
        to_world(seen, at);
        for (k = 0; k < 3; k++) dir[k] = at[k] - from[k];
        ray.org = to_vec(from);
        ray.dir = to_vec(dir);
        hit = trace_at(accel, &ray, m.time);
        if (hit.prim == RT_NONE) continue;
        normal_at(&m, work->which, seen, normals, &ray, &hit, n);
        start = thread_seconds();
        for (i = 0; i < work->rays_each; i++) {
            double to[3];

            roll_direction(&d, to);
            side = dot3(to, n);
            if (work->which == ONE_SPHERE && side < 0) {          /* the far wall is met, rightly */
                for (k = 0; k < 3; k++) to[k] = -to[k];
                side = -side;
            }
            next.dir = to_vec(to);
            for (k = 0; k < 3; k++) to[k] = side < 0 ? -n[k] : n[k];
            next.org = find_origin(work->how, &m.inner, seen, &ray, &hit, to, next.dir);
            work->wrong[number] += trace_at(accel, &next, m.time).prim != RT_NONE;
        }
        work->seconds[number] += thread_seconds() - start;
        work->rays[number] += work->rays_each;
        break;
    }
done:
    leave_free(&m);
}

/* A closed box of 12 triangles, turned, scaled and moved. */
static void box_make(leave_model *m, float vertices[24], uint32_t indices[36], uint64_t *d, bool straight)
{
    static const unsigned char faces[6][4] = { { 0, 2, 3, 1 }, { 4, 5, 7, 6 }, { 0, 1, 5, 4 }, { 2, 6, 7, 3 }, { 0, 4, 6, 2 }, { 1, 3, 7, 5 } };
    const double scale = roll_log(d, -3, 3), away = roll(d) < 0.5 ? 1 : 1000;
    double axes[3][3], size[3], at[3];
    int i, j, k;

    roll_direction(d, axes[0]);
    roll_direction(d, axes[1]);
    for (k = 0; k < 3 && straight; k++) axes[0][k] = k == 0, axes[1][k] = k == 1;
    for (k = 0; k < 3; k++) axes[2][k] = axes[0][(k + 1) % 3] * axes[1][(k + 2) % 3] - axes[0][(k + 2) % 3] * axes[1][(k + 1) % 3];
    for (k = 0; k < 3; k++) axes[1][k] = axes[2][(k + 1) % 3] * axes[0][(k + 2) % 3] - axes[2][(k + 2) % 3] * axes[0][(k + 1) % 3];
    for (i = 0; i < 3; i++) {
        const double length = sqrt(dot3(axes[i], axes[i]));
        size[i] = scale * (0.3 + roll(d));
        at[i] = away * scale * (2 * roll(d) - 1);
        for (k = 0; k < 3; k++) axes[i][k] /= length;
    }
    memset(m, 0, sizeof *m);
    for (i = 0; i < 8; i++)
        for (k = 0; k < 3; k++) {
            double x = at[k];
            for (j = 0; j < 3; j++) x += (i >> j & 1 ? 0.5 : -0.5) * size[j] * axes[j][k];
            vertices[3 * i + k] = (float)x;
        }
    for (i = 0; i < 6; i++) {
        const unsigned char *f = faces[i];
        const uint32_t two[6] = { f[0], f[1], f[2], f[0], f[2], f[3] };
        memcpy(indices + 6 * i, two, sizeof two);
    }
    m->inner.vertices = vertices, m->inner.vertex_count = 8;
    m->inner.indices = indices, m->inner.triangle_count = 12;
    leave_build(&m->inner_accel, &m->inner);
}

/* Rays from the middle of a box to within a millionth of its edges and corners; what goes on from there to the inside must meet the box. */
static void leak_one(void *context, size_t number)
{
    const leave_job *work = context;
    uint64_t d = number * 104729 + 5;
    float vertices[24];
    uint32_t indices[36];
    double middle[3] = { 0, 0, 0 }, start;
    leave_model m;
    uint64_t i;
    int j, k;

    box_make(&m, vertices, indices, &d, number % 2 == 0);
    for (j = 0; j < 8; j++)
        for (k = 0; k < 3; k++) middle[k] += (double)vertices[3 * j + k] / 8;
    start = thread_seconds();
    for (i = 0; i < work->rays_each; i++) {
        rt_ray ray = { { 0, 0, 0 }, 0, { 0, 0, 0 }, INFINITY }, next = ray;
        const uint32_t tri = (uint32_t)(12 * roll(&d)), *of = indices + 3 * tri;
        double w[3], at[3], to[3], e[2][3], n[3], side;
        rt_hit hit;

        w[0] = roll(&d) < 0.5 ? roll_log(&d, -9, -5) : roll(&d);
        w[1] = roll(&d) < 0.5 ? roll_log(&d, -9, -5) : roll(&d) * (1 - w[0]);
        w[2] = 1 - w[0] - w[1];
        j = (int)(3 * roll(&d));
        for (k = 0; k < 3; k++) {
            at[k] = w[j] * (double)vertices[3 * of[0] + (unsigned)k] + w[(j + 1) % 3] * (double)vertices[3 * of[1] + (unsigned)k] +
                    w[(j + 2) % 3] * (double)vertices[3 * of[2] + (unsigned)k];
            e[0][k] = at[k] - middle[k];
        }
        ray.org = to_vec(middle);
        ray.dir = to_vec(e[0]);
        hit = trace_at(m.inner_accel, &ray, 0);
        if (hit.prim == RT_NONE) {          /* closed, and rays do not slip through */
            work->wrong[number]++;
            continue;
        }
        of = indices + 3 * hit.prim;
        for (k = 0; k < 3; k++) {
            e[0][k] = (double)vertices[3 * of[1] + (unsigned)k] - (double)vertices[3 * of[0] + (unsigned)k];
            e[1][k] = (double)vertices[3 * of[2] + (unsigned)k] - (double)vertices[3 * of[0] + (unsigned)k];
        }
        for (k = 0; k < 3; k++) n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        side = sqrt(dot3(n, n));
        for (k = 0; k < 3; k++) n[k] /= side;
        for (k = 0, side = 0; k < 3; k++) side += n[k] * (middle[k] - (double)vertices[3 * of[0] + (unsigned)k]);
        for (k = 0; k < 3 && side < 0; k++) n[k] = -n[k];
        roll_direction(&d, to);
        side = dot3(to, n);
        for (k = 0; k < 3 && side < 0; k++) to[k] = -to[k];
        next.dir = to_vec(to);
        if (!((double)next.dir.x * n[0] + (double)next.dir.y * n[1] + (double)next.dir.z * n[2] > 0)) continue;     /* along the wall, by rounding */
        next.org = find_origin(work->how, &m.inner, NULL, &ray, &hit, n, next.dir);
        work->wrong[number] += trace_at(m.inner_accel, &next, 0).prim == RT_NONE;
    }
    work->seconds[number] += thread_seconds() - start;
    work->rays[number] += work->rays_each;
    leave_free(&m);
}

/* Nanoseconds of a call, of origins from a triangle. */
static double spawn_nanoseconds(void)
{
    enum { CALLS = 200000 };
    const rt_ray ray = { { 0.2f, 0.3f, 1 }, 0, { 0.1f, 0, -1 }, INFINITY };
    const rt_vec3 dir = { 0.3f, 0.2f, 1 };
    rt_hit hit = { 1, 0.3f, 0.3f, 0, RT_NONE };
    static const float vertices[9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    volatile float sum = 0;
    rt_geometry geo;
    double best = HUGE_VAL;
    int round, i;

    memset(&geo, 0, sizeof geo);
    geo.vertices = vertices, geo.vertex_count = 3, geo.triangle_count = 1;
    for (round = 0; round < 5; round++) {
        const double start = thread_seconds();
        for (i = 0; i < CALLS; i++) {
            hit.u = (float)i / (2 * CALLS);
            sum = sum + rt_spawn_origin(&geo, NULL, &ray, &hit, dir).z;
        }
        best = fmin(best, thread_seconds() - start);
    }
    return 1e9 * best / CALLS;
}

/* All of it; how many results. quick: few rays. */
static size_t measure_leaving(pool *threads, bool quick, leave_result *out, size_t most)
{
    enum { MODELS_EACH = 1000 };
    uint64_t *rays = need(MODELS_EACH, sizeof *rays), *wrong = need(MODELS_EACH, sizeof *wrong);
    double *seconds = need(MODELS_EACH, sizeof *seconds);
    static char names[64][160];
    size_t count = 0, i;
    int which, how;

    for (which = 0; which <= LEAVE_KINDS; which++)
        for (how = 0; how < ORIGINS && count < most; how++) {
            const bool leaks = which == LEAVE_KINDS;
            leave_job work = { (leave_kind)which, (origin_kind)how, 0, rays, wrong, seconds };
            leave_result *r = &out[count];

            work.rays_each = (leaks ? 10000 : 1000) / (uint64_t)(quick ? 100 : how && !leaks ? 10 : 1);
            memset(rays, 0, MODELS_EACH * sizeof *rays);
            memset(wrong, 0, MODELS_EACH * sizeof *wrong);
            pool_for(threads, MODELS_EACH, leaks ? leak_one : leave_one, &work);
            snprintf(names[count], sizeof *names, "%s; %s", leaks ? "leaks of a closed box near its edges" : leave_names[which], origin_names[how]);
            r->name = names[count++];
            r->ours = how == SPAWN;
            r->rays = r->wrong = 0;
            r->ns = how == SPAWN && which == ONE_TRIANGLE ? spawn_nanoseconds() : 0;
            for (i = 0; i < MODELS_EACH; i++) r->rays += rays[i], r->wrong += wrong[i];
        }
    free(rays);
    free(wrong);
    free(seconds);
    return count;
}
