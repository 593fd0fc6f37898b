/* accuracy_images.h - how far pictures with noise are from what they tend to, and what that costs. Part of accuracy.c.

   >>stages  >>references  >>convergence  >>picture-ways  >>refining                    SPDX-License-Identifier: MIT OR Unlicense

   All times are of one thread, which draws a whole picture while others draw with other seeds; the device's are of the clock. */

#include "../examples/refine.h"

/* ---- >>stages ------------------------------------------------------------------------------------------------------- */

enum { STAGE_BALLS = 7, STAGE_CROWD = 5, MATERIALS = 4 };

/* What distribution ray tracing adds, each by itself, all together, and Cornell's box under a square lamp. */
typedef struct { const char *name; bool soft, lens, gloss, blur, box; } stage_kind;
static const stage_kind stage_kinds[] = {
    { "soft shadow", true, false, false, false, false },    { "depth of field", false, true, false, false, false },
    { "gloss", false, false, true, false, false },          { "motion blur", false, false, false, true, false },
    { "all together", true, true, true, true, false },      { "Cornell box", true, false, false, false, true },
};
enum { STAGES = COUNT(stage_kinds) };

typedef struct {
    const stage_kind *which;
    scene box;                              /* Cornell's */
    rt_sphere balls[STAGE_BALLS + 1], crowd_ball;
    rt_plane ground;
    rt_instance crowd[STAGE_CROWD];
    rt_motion motions[STAGE_CROWD];
    rt_geometry world, one;
    rt_accel *world_accel, *one_accel;
    rt_material materials[MATERIALS];
    uint32_t ids[STAGE_BALLS + 2];
    rt_light light;
    rt_scene view, part;
    const rt_scene *parts[STAGE_CROWD];
    rt_render_options how;
    size_t pixels;
} stage;

static rt_vec3 vec(float x, float y, float z)
{
    const rt_vec3 v = { x, y, z };

    return v;
}

static bool stage_build_one(rt_accel **accel, const rt_geometry *geometry, rt_structure structure)
{
    rt_build_options build;
    rt_error error;

    memset(&build, 0, sizeof build);
    build.structure = structure;
    build.error = &error;
    return rt_build(accel, geometry, &build) == RT_OK || complain("a picture's scene: %s", error.message);
}

static void stage_end(stage *s)
{
    rt_free(s->world_accel);
    rt_free(s->one_accel);
    if (s->which->box) scene_free(&s->box);
}

static bool stage_begin_box(stage *s, rt_structure structure)
{
    scene_error error;
    size_t i;

    if (!scene_load(&s->box, "cornell", NULL, NULL, &error)) return complain("%s", error.message);
    if (!stage_build_one(&s->world_accel, &s->box.geometry, structure)) return false;
    s->view = scene_view(&s->box, s->world_accel);
    for (i = 0; i < s->view.light_count; i++) {
        s->box.lights[i].edges[0] = vec(0.5f, 0, 0);
        s->box.lights[i].edges[1] = vec(0, 0, 0.5f);
    }
    return true;
}

/* Balls on the ground and a few more in instances, some of which move. */
static bool stage_begin(stage *s, const stage_kind *which, rt_structure structure, int width, int height)
{
    const rt_vec3 colors[STAGE_BALLS] = { { 0.8f, 0.2f, 0.15f }, { 0.2f, 0.6f, 0.25f }, { 0.2f, 0.3f, 0.8f } };
    int i;

    memset(s, 0, sizeof *s);
    s->which = which;
    s->how.width = width;
    s->how.height = height;
    s->pixels = (size_t)width * (size_t)height;
    s->how.depth = 3;
    s->how.lens.radius = which->lens ? 0.25f : 0;
    s->how.lens.focus = 6;
    s->how.lens.close = which->blur ? 1 : 0;
    if (which->box) return stage_begin_box(s, structure);
    for (i = 0; i < STAGE_BALLS; i++) {
        const float turn = 0.8975979f * (float)i, radius = 0.3f + 0.06f * (float)i, out = i ? 1.9f : 0;

        s->balls[i].radius = radius;
        s->balls[i].center = vec(out * cosf(turn), radius, out * sinf(turn));
        s->ids[i] = (uint32_t)(i % 3);
    }
    s->crowd_ball.radius = 0.3f;
    for (i = 0; i < 3; i++) s->materials[i].diffuse = colors[i];
    s->materials[3].diffuse = vec(0.6f, 0.55f, 0.5f);
    for (i = 0; i < 4 && which->gloss; i += 3) {
        s->materials[i].reflect = i ? vec(0.3f, 0.3f, 0.3f) : vec(0.7f, 0.7f, 0.7f);
        s->materials[i].diffuse = vec(0.3f, 0.25f, 0.2f);
        s->materials[i].roughness = 0.25f;
    }
    s->ids[STAGE_BALLS] = 3;                /* the ground's */
    s->ground.point = vec(0, 0, 0);
    s->ground.normal = vec(0, 1, 0);
    s->one.spheres = &s->crowd_ball;
    s->one.sphere_count = 1;
    if (!stage_build_one(&s->one_accel, &s->one, structure)) return false;
    s->part.accel = s->one_accel;
    s->part.geometry = &s->one;
    for (i = 0; i < STAGE_CROWD; i++) {
        const float m[12] = { 1, 0, 0, -1.6f + 0.8f * (float)i, 0, 1.2f, 0, 1.5f, 0, 0, 1, -1 };

        memcpy(s->crowd[i].transform, m, sizeof m);
        s->crowd[i].accel = s->one_accel;
        s->motions[i].move = vec(0.5f, i % 2 ? 0.4f : -0.4f, 0);
        s->crowd[i].motion = which->blur && i < 2 ? &s->motions[i] : NULL;
        s->parts[i] = &s->part;
    }
    s->world.spheres = s->balls;
    s->world.sphere_count = STAGE_BALLS;
    s->world.planes = &s->ground;
    s->world.plane_count = 1;
    s->world.instances = s->crowd;
    s->world.instance_count = STAGE_CROWD;
    if (!stage_build_one(&s->world_accel, &s->world, structure)) return false;
    s->light.position = vec(-3, 5, 3);
    s->light.color = vec(0.9f, 0.85f, 0.8f);
    s->light.radius = which->soft ? 1.2f : 0;
    s->view.accel = s->world_accel;
    s->view.geometry = &s->world;
    s->view.parts = s->parts;
    s->view.materials = s->materials;
    s->view.material_count = MATERIALS;
    s->view.material_ids = s->ids;
    s->view.lights = &s->light;
    s->view.light_count = 1;
    s->view.ambient = vec(0.12f, 0.13f, 0.16f);
    s->view.background = vec(0.35f, 0.5f, 0.75f);
    s->view.camera.eye = vec(0.6f, 2.2f, 6);
    s->view.camera.look = vec(0, 0.8f, 0);
    s->view.camera.up = vec(0, 1, 0);
    s->view.camera.fov = 42;
    return true;
}

/* Of the thread that calls. */
static double thread_seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void must_draw(rt_status status, const char *what)
{
    if (status == RT_OK) return;
    complain("%s: %s", what, rt_status_string(status));
    exit(EXIT_FAILURE);
}

static void stage_draw(const stage *s, const rt_render_options *how, rt_vec3 *pixels)
{
    must_draw(rt_render_tile(&s->view, how, 0, 0, how->width, how->height, pixels, NULL), s->which->name);
}

/* ---- >>references --------------------------------------------------------------------------------------------------- */

/* The truth, nearly: two halves, which tell how far their mean is from it. */
typedef struct { double *values, variance; size_t count; } reference;      /* count: 3 a pixel */

/* Errors of a picture. What the reference errs by is taken off: both err independently. */
typedef struct { double square, relative; } image_error;

static image_error compare(const rt_vec3 *pixels, const reference *ideal)
{
    image_error e = { -ideal->variance, 0 };
    size_t i;

    for (i = 0; i < ideal->count; i++) {
        const double want = ideal->values[i], away = (double)(&pixels[i / 3].x)[i % 3] - want;
        e.square += away * away / (double)ideal->count;
        e.relative += away * away / (want * want + 0.01) / (double)ideal->count;
    }
    e.square = fmax(e.square, 0);
    return e;
}

enum { PARTS = 8 };                         /* pictures that a reference is the mean of */

typedef struct { const stage *s; rt_render_options how; double *sums; pthread_mutex_t lock; } reference_job;

static void draw_reference_part(void *context, size_t part)
{
    reference_job *work = context;
    rt_vec3 *pixels = need(work->s->pixels, sizeof *pixels);
    rt_render_options how = work->how;
    double *sums = work->sums + 3 * work->s->pixels * (part % 2);
    size_t i;

    how.seed = 0x51ed270bu + (uint32_t)part;
    stage_draw(work->s, &how, pixels);
    pthread_mutex_lock(&work->lock);
    for (i = 0; i < 3 * work->s->pixels; i++) sums[i] += (double)(&pixels[i / 3].x)[i % 3];
    pthread_mutex_unlock(&work->lock);
    free(pixels);
}

static bool read_reference(const char *path, const char *head, reference *out)
{
    FILE *file = path ? fopen(path, "rb") : NULL;
    char first[160];
    bool good;

    if (!file) return false;
    good = fgets(first, sizeof first, file) && strcmp(first, head) == 0 && fread(&out->variance, sizeof out->variance, 1, file) == 1 &&
           fread(out->values, sizeof *out->values, out->count, file) == out->count && fgetc(file) == EOF;
    fclose(file);
    return good;
}

static bool write_reference(const char *path, const char *head, const reference *r)
{
    char temporary[600];
    FILE *file;
    bool good;

    snprintf(temporary, sizeof temporary, "%s.new", path);
    if (!(file = fopen(temporary, "wb"))) return complain("%s: %s", temporary, strerror(errno));
    good = fputs(head, file) >= 0 && fwrite(&r->variance, sizeof r->variance, 1, file) == 1 &&
           fwrite(r->values, sizeof *r->values, r->count, file) == r->count;
    if (fclose(file) != 0 || !good || rename(temporary, path) != 0) {
        complain("%s: %s", path, strerror(errno));
        remove(temporary);
        return false;
    }
    return true;
}

/* By sampler, so that no picture is compared with one of its own kind, with spp samples. Kept in folder, if there is one. */
static bool find_reference(const stage *s, rt_sampler_kind sampler, int spp, const char *folder, pool *threads, reference *out)
{
    rt_vec3 *sample = need(s->pixels, sizeof *sample);         /* tells whether the picture is still the one that was kept */
    rt_render_options how = s->how;
    char path[512], head[160];
    uint32_t hash = 2166136261u;
    reference_job work;
    size_t i;

    how.sampler = sampler;
    how.spp = 4;
    stage_draw(s, &how, sample);
    for (i = 0; i < s->pixels * sizeof *sample; i++) hash = (hash ^ ((const unsigned char *)sample)[i]) * 16777619u;
    free(sample);

    snprintf(path, sizeof path, "%s/reference-%d-%d-%d.bin", folder ? folder : "", (int)(s->which - stage_kinds), (int)sampler, how.width);
    snprintf(head, sizeof head, "rt.h reference: %s, sampler %d, %d x %d, %d spp, %08x\n", s->which->name, (int)sampler, how.width, how.height,
             spp, (unsigned)hash);
    out->count = 3 * s->pixels;
    out->values = need(out->count, sizeof *out->values);
    if (folder && read_reference(path, head, out)) return true;
    work.s = s;
    work.how = s->how;
    work.how.sampler = sampler;
    work.how.spp = spp / PARTS;
    work.sums = need(2 * out->count, sizeof *work.sums);
    pthread_mutex_init(&work.lock, NULL);
    pool_for(threads, PARTS, draw_reference_part, &work);
    pthread_mutex_destroy(&work.lock);
    out->variance = 0;
    for (i = 0; i < out->count; i++) {
        const double a = work.sums[i] / (PARTS / 2), b = work.sums[out->count + i] / (PARTS / 2);
        out->values[i] = (a + b) / 2;
        out->variance += (a - b) * (a - b) / 4 / (double)out->count;
    }
    free(work.sums);
    return !folder || write_reference(path, head, out);
}

/* ---- >>convergence -------------------------------------------------------------------------------------------------- */

enum { SMALL_WIDTH = 48, SMALL_HEIGHT = 36, SEEDS = 8, LEVELS = 11 };      /* samples a pixel: 1, 2, 4 ... 1024 */

static const char *const sampler_names[] = { RT_SAMPLER_LIST(NAME_OF) };

/* The root of the mean over seeds of squared errors, and so on. */
typedef struct { double rmse, relmse, seconds; } image_point;

typedef struct {
    stage scenes[STAGES];
    reference truths[STAGES][2];            /* by stratified samples; by Sobol's, for those */
    image_point points[STAGES][RT_SAMPLER_COUNT][LEVELS];
    double slopes[STAGES][RT_SAMPLER_COUNT];
    int levels;
} image_study;

typedef struct { image_study *study; const stage *s; const reference *ideal; rt_sampler_kind sampler; image_point (*points)[LEVELS]; } image_job;

/* Sequences go on where they were; strata are made anew for each number of samples. */
static void converge(void *context, size_t seed)
{
    const image_job *work = context;
    const size_t pixels = work->s->pixels;
    rt_vec3 *drawn = need(pixels, sizeof *drawn), *picture = need(pixels, sizeof *picture);
    rt_render_options how = work->s->how;
    double seconds = 0;
    int level;
    size_t i;

    how.sampler = work->sampler;
    how.seed = (uint32_t)seed;
    for (level = 0; level < work->study->levels; level++) {
        const bool anew = work->sampler == RT_SAMPLER_STRATIFIED || level == 0;
        image_point *point = &work->points[seed][level];
        double start = thread_seconds();
        image_error e;

        how.spp = work->sampler == RT_SAMPLER_STRATIFIED ? 1 << level : 1 << (work->study->levels - 1);
        how.first_sample = anew ? 0 : 1 << (level - 1);
        how.samples = anew ? 1 << level : 1 << (level - 1);
        stage_draw(work->s, &how, drawn);
        for (i = 0; i < pixels; i++) {
            const float part = anew ? 1 : 0.5f;
            picture[i].x += part * (drawn[i].x - picture[i].x);
            picture[i].y += part * (drawn[i].y - picture[i].y);
            picture[i].z += part * (drawn[i].z - picture[i].z);
        }
        start = thread_seconds() - start;
        seconds = work->sampler == RT_SAMPLER_STRATIFIED ? start : seconds + start;
        e = compare(picture, work->ideal);
        point->rmse = e.square, point->relmse = e.relative, point->seconds = seconds;
    }
    free(drawn);
    free(picture);
}

/* Of the line through the errors from 4 samples on, in logarithms. */
static double slope_of(const image_point *points, int levels)
{
    double x = 0, y = 0, xx = 0, xy = 0, n = 0;
    int level;

    for (level = 2; level < levels; level++) {
        const double e = log2(points[level].rmse);
        x += level, y += e, xx += level * level, xy += level * e, n++;
    }
    return (n * xy - x * y) / (n * xx - x * x);
}

/* Seconds, or samples, at which an error is reached: between two points, or along the line of the last three. */
static double reach(const double *costs, const double *errors, int count, double error)
{
    int i = 1;

    while (i < count - 1 && errors[i] > error) i++;
    if (errors[i] > error && count > 2) {
        const double steep = log(errors[count - 1] / errors[count - 3]) / log(costs[count - 1] / costs[count - 3]);
        return costs[count - 1] * pow(error / errors[count - 1], 1 / steep);
    }
    return costs[i] * pow(error / errors[i], log(costs[i - 1] / costs[i]) / log(errors[i - 1] / errors[i]));
}

static double seconds_to(const image_point *points, int levels, double error, bool samples)
{
    double costs[LEVELS], errors[LEVELS];
    int i;

    for (i = 0; i < levels; i++) {
        costs[i] = samples ? 1 << i : points[i].seconds;
        errors[i] = points[i].rmse;
    }
    return reach(costs, errors, levels, error);
}

/* The error that is reached in that time. */
static double error_after(const image_point *points, int levels, double seconds)
{
    double costs[LEVELS], errors[LEVELS];
    int i;

    for (i = 0; i < levels; i++) costs[levels - 1 - i] = points[i].seconds, errors[levels - 1 - i] = points[i].rmse;
    return reach(errors, costs, levels, seconds);
}

/* All errors of all scenes and samplers. folder: where references are kept, or NULL. */
static bool study_images(image_study *study, int levels, const char *folder, pool *threads)
{
    image_point (*points)[LEVELS] = need(SEEDS, sizeof *points);
    size_t n, seed;
    int which, level;

    study->levels = levels;
    for (n = 0; n < STAGES; n++) {
        stage *s = &study->scenes[n];

        if (!stage_begin(s, &stage_kinds[n], RT_BVH, SMALL_WIDTH, SMALL_HEIGHT)) return false;
        for (which = 0; which < 2; which++)
            if (!find_reference(s, which ? RT_SAMPLER_SOBOL : RT_SAMPLER_STRATIFIED, 16 << (levels - 1), folder, threads, &study->truths[n][which]))
                return false;
        for (which = RT_SAMPLER_INDEPENDENT; which < RT_SAMPLER_COUNT; which++) {
            image_job work = { study, s, &study->truths[n][which == RT_SAMPLER_STRATIFIED], (rt_sampler_kind)which, points };
            image_point *out = study->points[n][which];

            pool_for(threads, SEEDS, converge, &work);
            for (level = 0; level < levels; level++) {
                for (seed = 0; seed < SEEDS; seed++) {
                    out[level].rmse += points[seed][level].rmse / SEEDS;
                    out[level].relmse += points[seed][level].relmse / SEEDS;
                    out[level].seconds += points[seed][level].seconds / SEEDS;
                }
                out[level].rmse = sqrt(out[level].rmse);
            }
            study->slopes[n][which] = slope_of(out, levels);
        }
    }
    free(points);
    return true;
}

static void free_images(image_study *study)
{
    size_t n;

    for (n = 0; n < STAGES; n++) {
        if (study->scenes[n].which) stage_end(&study->scenes[n]);
        free(study->truths[n][0].values);
        free(study->truths[n][1].values);
    }
}

/* ---- >>picture-ways ------------------------------------------------------------------------------------------------- */

/* Who traces a picture's rays. What differs from the first in a bit is an error. */
static const struct { const char *name; rt_structure structure; rt_algorithm algorithm; int packet; bool device; } picture_ways[] = {
    { "bvh.stack: single rays", RT_BVH, RT_BVH_STACK, 0, false },
    { "threaded.single: naive", RT_THREADED, RT_THREADED_SINGLE, 0, false },
    { "threaded.parallel: 4 rays", RT_THREADED, RT_THREADED_PARALLEL, 4, false },
    { "threaded.parallel: 8 rays", RT_THREADED, RT_THREADED_PARALLEL, 8, false },
    { "kd.shortstack: single rays", RT_KDTREE, RT_KD_SHORTSTACK, 1, false },
    { "kd.shortstack: packets", RT_KDTREE, RT_KD_SHORTSTACK, 0, false },
    { "bvh.simd: packets", RT_BVH, RT_BVH_SIMD, 0, false },
    { "bvh.ranged: 16x16", RT_BVH, RT_BVH_RANGED, 16, false },
    { "auto", RT_BVH, RT_AUTO, 0, false },
    { "device: auto", RT_BVH, RT_AUTO, 0, true },
    { "device: threaded.single", RT_THREADED, RT_THREADED_SINGLE, 0, true },
};
enum { PICTURE_WAYS = COUNT(picture_ways), WAY_LEVEL = 6 };     /* 64 samples */

/* Seconds of a picture, the best of three; 0: not there. */
typedef struct { double seconds[STAGES][PICTURE_WAYS]; size_t differ; } way_times;

static bool draw_way(stage *s, int tracer, rt_gpu *gpu, rt_vec3 *pixels, double *seconds)
{
    rt_render_options how = s->how;
    rt_gpu_scene *there = NULL;
    rt_status status = RT_OK;
    rt_error error;
    int round;

    how.spp = 1 << WAY_LEVEL;
    how.sampler = RT_SAMPLER_SOBOL;
    how.trace.algorithm = picture_ways[tracer].algorithm;
    how.trace.packet_width = picture_ways[tracer].packet;
    how.trace.error = &error;
    if (picture_ways[tracer].device) status = rt_gpu_upload_scene(gpu, &there, &s->view, &error);
    for (round = there ? -1 : 0, *seconds = HUGE_VAL; round < 3 && status == RT_OK; round++) {         /* the first compiles */
        const double start = there ? seconds_now() : thread_seconds();

        status = there ? rt_gpu_render_tile(gpu, there, &how, 0, 0, how.width, how.height, pixels, NULL)
                       : rt_render_tile(&s->view, &how, 0, 0, how.width, how.height, pixels, NULL);
        if (round >= 0) *seconds = fmin(*seconds, (there ? seconds_now() : thread_seconds()) - start);
    }
    rt_gpu_free_scene(there);
    return status == RT_OK || complain("%s, %s: %s", s->which->name, picture_ways[tracer].name, error.message);
}

static bool time_ways(way_times *out, rt_gpu *gpu)
{
    const size_t count = SMALL_WIDTH * SMALL_HEIGHT;
    rt_vec3 *first = need(count, sizeof *first), *pixels = need(count, sizeof *pixels);
    bool good = true;
    size_t n;
    int tracer;

    memset(out, 0, sizeof *out);
    for (n = 0; n < STAGES && good; n++)
        for (tracer = 0; tracer < PICTURE_WAYS && good; tracer++) {
            stage s;

            if (picture_ways[tracer].device && !gpu) continue;
            good = stage_begin(&s, &stage_kinds[n], picture_ways[tracer].structure, SMALL_WIDTH, SMALL_HEIGHT);
            if (good) good = draw_way(&s, tracer, gpu, tracer ? pixels : first, &out->seconds[n][tracer]);
            if (good && tracer && memcmp(first, pixels, count * sizeof *pixels) != 0) {
                complain("%s: %s draws another picture", stage_kinds[n].name, picture_ways[tracer].name);
                out->differ++;
            }
            stage_end(&s);
        }
    free(first);
    free(pixels);
    return good;
}

/* ---- >>refining ----------------------------------------------------------------------------------------------------- */

/* As render --error does it, beside one sequence for all samples, which tells nothing of its error. */
enum { ONE_SEQUENCE, UNIFORM, ADAPTIVE, REFINE_KINDS };
static const char *const refine_names[] = { "one sequence", "two halves", "adaptive" };
enum { LARGE_WIDTH = 192, LARGE_HEIGHT = 144, REFINE_SEEDS = 4, ROUNDS = 12 };

typedef struct { double samples, seconds, rmse, estimate; } refine_point;       /* means over seeds */
typedef struct {
    refine_point points[STAGES][REFINE_KINDS][ROUNDS];
    int counts[STAGES][REFINE_KINDS];
    double least, most;                     /* of estimate over error, of single pictures */
    double room[STAGES];                    /* how many times less samples could do, were each pixel's noise known: see below */
    double gains[STAGES];                   /* time of two halves over that of adaptive sampling to the least error of the latter */
} refine_study;

typedef struct { const stage *s; const reference *ideal; int which, most; refine_point (*points)[ROUNDS]; double *room; } refine_job;

static rt_status draw_stage(void *context, const rt_render_options *how, rt_vec3 *pixels)
{
    return rt_render_tile(&((const stage *)context)->view, how, 0, 0, how->width, how->height, pixels, NULL);
}

/* Samples of a uniform picture over those of the best one: where noise c a pixel leaves c n^-3/2 of n samples, n goes with c^2/5 at best. */
static double room_of(const refinement *r)
{
    double sum = 0, shares = 0, c;
    size_t i;

    for (i = 0; i < (size_t)r->how.width * (size_t)r->how.height; i++) {
        c = pow((double)r->shares[i], 2.5);
        sum += c, shares += (double)r->shares[i];
    }
    c = (double)r->how.width * r->how.height;
    return pow(sum / c, 1 / 1.5) / pow(shares / c, 2.5 / 1.5);
}

static void refine_once(void *context, size_t seed)
{
    const refine_job *work = context;
    rt_render_options how = work->s->how;
    double start = thread_seconds(), lost = 0;
    const int first = work->which == ADAPTIVE ? 8 : 2;
    refinement r;
    int i = 0, samples;

    how.sampler = RT_SAMPLER_SOBOL;
    how.seed = 1000 + (uint32_t)seed;
    how.spp = 65536;
    if (!refine_begin(&r, &how, work->which == ADAPTIVE, draw_stage, (void *)(uintptr_t)work->s)) must_draw(RT_ERROR_MEMORY, work->s->which->name);
    for (samples = first; samples <= work->most; samples *= 2, i++) {
        refine_point *p = &work->points[seed][i];
        double now;

        if (work->which == ONE_SEQUENCE) {
            const int had = samples == first ? 0 : samples / 2;

            how.first_sample = had, how.samples = samples - had;
            stage_draw(work->s, &how, r.parts[0]);
            refine_add(r.picture, r.parts[0], work->s->pixels, (double)how.samples / samples);
            r.samples = samples;
        } else must_draw(refine_until(&r, samples), work->s->which->name);
        now = thread_seconds();
        p->samples = r.samples;
        p->seconds = now - start - lost;
        p->estimate = work->which == ONE_SEQUENCE ? 0 : r.error * r.error;
        p->rmse = compare(r.picture, work->ideal).square;
        lost += thread_seconds() - now;
    }
    if (work->which == ADAPTIVE) work->room[seed] = room_of(&r);
    refine_end(&r);
}

static void average_rounds(refine_study *out, size_t n, int which, refine_point (*points)[ROUNDS])
{
    int i, seed;

    for (i = 0; i < out->counts[n][which]; i++) {
        refine_point *p = &out->points[n][which][i];

        for (seed = 0; seed < REFINE_SEEDS; seed++) {
            const refine_point *one = &points[seed][i];
            const double ratio = sqrt(one->estimate / one->rmse);

            if (which != ONE_SEQUENCE) out->least = fmin(out->least, ratio);
            if (which != ONE_SEQUENCE) out->most = fmax(out->most, ratio);
            p->samples += one->samples / REFINE_SEEDS, p->seconds += one->seconds / REFINE_SEEDS;
            p->rmse += one->rmse / REFINE_SEEDS, p->estimate += one->estimate / REFINE_SEEDS;
        }
        p->rmse = sqrt(p->rmse), p->estimate = sqrt(p->estimate);
    }
}

static double refine_seconds_to(const refine_study *study, size_t n, int which, double error)
{
    double costs[ROUNDS], errors[ROUNDS];
    int i;

    for (i = 0; i < study->counts[n][which]; i++) costs[i] = study->points[n][which][i].seconds, errors[i] = study->points[n][which][i].rmse;
    return reach(costs, errors, study->counts[n][which], error);
}

static bool study_refining(refine_study *out, int most, bool small, const char *folder, pool *threads)
{
    refine_point (*points)[ROUNDS] = need(REFINE_SEEDS, sizeof *points);
    double room[REFINE_SEEDS];
    bool good = true;
    size_t n;
    int which, samples, seed;

    memset(out, 0, sizeof *out);
    out->least = HUGE_VAL;
    for (n = 0; n < STAGES && good; n++) {
        reference ideal = { NULL, 0, 0 };
        stage s;

        good = stage_begin(&s, &stage_kinds[n], RT_BVH, small ? SMALL_WIDTH : LARGE_WIDTH, small ? SMALL_HEIGHT : LARGE_HEIGHT) &&
               find_reference(&s, RT_SAMPLER_STRATIFIED, 16 * most, folder, threads, &ideal);
        for (which = 0; which < REFINE_KINDS && good; which++) {
            refine_job work = { &s, &ideal, which, which == ADAPTIVE ? most : 4 * most, points, room };

            for (samples = which == ADAPTIVE ? 8 : 2; samples <= work.most; samples *= 2) out->counts[n][which]++;
            pool_for(threads, REFINE_SEEDS, refine_once, &work);
            average_rounds(out, n, which, points);
        }
        if (good) {
            const double goal = out->points[n][ADAPTIVE][out->counts[n][ADAPTIVE] - 1].rmse;

            for (seed = 0; seed < REFINE_SEEDS; seed++) out->room[n] += room[seed] / REFINE_SEEDS;
            out->gains[n] = refine_seconds_to(out, n, UNIFORM, goal) / refine_seconds_to(out, n, ADAPTIVE, goal);
        }
        free(ideal.values);
        stage_end(&s);
    }
    free(points);
    return good;
}
