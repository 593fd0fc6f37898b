/* rt_fuzz.c - bytes to scenes: loaders, builder and traversal on anything at all.    SPDX-License-Identifier: MIT OR Unlicense

   The first byte chooses: an OBJ file, an NFF file, an MTL file, or geometry with rays. A file that loads is built and rendered;
   geometry is built with or without its bad primitives, as any structure with any options, refitted where that is possible, and traced
   by every algorithm, whose hits must be those of a loop over all primitives. Anything else than that, or a finding of a sanitizer, aborts.

       clang -g -O1 -fsanitize=fuzzer,address,undefined -DRT_FUZZ_LIBFUZZER tests/rt_fuzz.c -o rt_fuzz -lm && ./rt_fuzz
       cc -g -O1 tests/rt_fuzz.c -o rt_fuzz -lm && ./rt_fuzz 10000        # that many random inputs; or files: ./rt_fuzz crash-*  */

#define _POSIX_C_SOURCE 200809L

#define RT_IMPLEMENTATION
#include "../rt.h"
#include "../examples/scene.h"

#define LEVELS 4                            /* accels that instance those before them; the last is traced */
#define MAX_TRIANGLES 24
#define MAX_SPHERES 12
#define MAX_INSTANCES 6
#define MAX_PLANES    3
#define MAX_RAYS 84                         /* ten and a half packets of 8, one and a bit of 8 x 8 */

typedef struct { const uint8_t *at, *end; } bytes;

static void fail(const char *what)
{
    fprintf(stderr, "rt_fuzz: %s\n", what);
    abort();
}

static uint32_t take(bytes *in) { return in->at < in->end ? *in->at++ : 0; }        /* zeros when all is used up */
static size_t take_below(bytes *in, size_t n) { return take(in) % n; }

/* ---- >>loaders ------------------------------------------------------------------------------------------------------ */

/* The path of a file of this process that ends so, holding data. */
static void write_file(char path[256], const char *extension, const void *data, size_t size)
{
    const char *folder = getenv("TMPDIR");
    FILE *file;
    snprintf(path, 256, "%s/rt_fuzz.%ld%s", folder ? folder : "/tmp", (long)getpid(), extension);
    file = fopen(path, "wb");
    if (!file || fwrite(data, 1, size, file) != size || fclose(file) != 0) fail("cannot write a temporary file");
}

static void count_line(void *user, const char *line)
{
    if (!*line) fail("an empty report");
    ++*(size_t *)user;
}

static void fuzz_loader(const char *extension, bytes in)
{
    const bool mtl = strcmp(extension, ".mtl") == 0;
    char path[256], mtl_path[256], user_of_mtl[400];
    scene loaded;
    scene_error error;
    size_t reports = 0;
    bool good;
    write_file(path, extension, in.at, (size_t)(in.end - in.at));
    if (mtl) {
        memcpy(mtl_path, path, sizeof path);
        snprintf(user_of_mtl, sizeof user_of_mtl, "mtllib %s\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl b\nf -1 -2 -3\n", path);
        write_file(path, ".obj", user_of_mtl, strlen(user_of_mtl));
    }
    good = scene_load(&loaded, path, count_line, &reports, &error);
    remove(path);
    if (mtl) remove(mtl_path);
    if (reports != error.errors || good != !reports || good != !error.message[0]) fail("a load that does not report its errors");
    if (good) {
        const rt_build_options options = { .skip_invalid = true };
        const rt_render_options small = { .width = 8, .height = 8 };
        rt_vec3 pixels[64];
        rt_accel *accel;
        rt_scene view;
        if (rt_build(&accel, &loaded.geometry, &options) != RT_OK || !rti_validate(accel)) fail("a loaded scene that does not build");
        view = scene_view(&loaded, accel);
        if (rt_render_tile(&view, &small, 0, 0, 8, 8, pixels, NULL) != RT_OK) fail("a loaded scene that does not render");
        rt_free(accel);
    } else if (loaded.vertices || loaded.materials || loaded.geometry.triangle_count) fail("a failed load that leaves something");
    scene_free(&loaded);
}

/* ---- >>geometry ----------------------------------------------------------------------------------------------------- */

typedef struct {
    float vertices[MAX_TRIANGLES * 9];
    uint32_t indices[MAX_TRIANGLES * 3];
    rt_sphere spheres[MAX_SPHERES];
    rt_instance instances[MAX_INSTANCES];
    rt_motion motions[MAX_INSTANCES];
    rt_plane planes[MAX_PLANES];
    rt_geometry geometry;
    rt_accel *accel;
    rt_accel *plain;                        /* the same as a BVH of plain ones: brute force reads its arrays */
} level;

/* Mostly small numbers that meet each other; else powers of two, the edges of what is legal, or any bits. */
static float take_float(bytes *in)
{
    static const float edges[] = { 0, -0.0f, 1e18f, -1e18f, 1.1e18f, 1e-18f, 1e-38f, 1e-45f, HUGE_VALF, -HUGE_VALF, FLT_MAX, 0x1p-24f };
    const uint32_t kind = take(in);
    const int x = (int)take(in) - 128;
    uint32_t bits;
    float f;
    if (kind < 160) return (float)x / (float)(1 << kind % 8);
    if (kind < 224) return ldexpf(x < 0 ? -1.0f - (float)(kind % 7) / 8 : 1.0f + (float)(kind % 7) / 8, x % 64);
    if (kind < 240) return edges[(size_t)(x + 128) % (sizeof edges / sizeof *edges)];
    bits = (uint32_t)(x + 128);
    for (int i = 0; i < 3; i++) bits = bits << 8 | take(in);
    memcpy(&f, &bits, sizeof f);
    return f;
}

static void take_floats(bytes *in, float *to, size_t count)
{
    while (count-- > 0) *to++ = take_float(in);
}

static void point_to_arrays(level *l, bool indexed)
{
    l->geometry.vertices = l->vertices;
    l->geometry.indices = indexed ? l->indices : NULL;
    l->geometry.spheres = l->spheres;
    l->geometry.instances = l->instances;
    l->geometry.planes = l->planes;
}

/* Moves everything of the level; the counts stay. */
static void take_shapes(level *l, bytes *in)
{
    const rt_geometry *g = &l->geometry;
    take_floats(in, l->vertices, 3 * g->vertex_count);
    for (size_t i = 0; i < 3 * g->triangle_count; i++) l->indices[i] = (uint32_t)take_below(in, g->vertex_count + (take(in) == 255));
    for (size_t i = 0; i < g->sphere_count; i++) {
        take_floats(in, &l->spheres[i].center.x, 4);
        if (take(in) < 250) l->spheres[i].radius = fabsf(l->spheres[i].radius);
    }
    for (size_t i = 0; i < g->instance_count; i++) {
        const uint32_t kind = take(in);
        for (size_t k = 0; k < 12; k++) l->instances[i].transform[k] = kind < 100 && k % 4 < 3 ? (float)(k % 5 == 0) : take_float(in);
        l->instances[i].motion = kind % 3 == 0 ? &l->motions[i] : NULL;
        if (kind % 3) continue;
        take_floats(in, &l->motions[i].move.x, 9);
        l->motions[i].angle = kind % 2 ? (float)(kind - 128) / 9 : take_float(in);
    }
    for (size_t i = 0; i < g->plane_count; i++) {
        take_floats(in, &l->planes[i].point.x, 6);
        l->planes[i].radius = take(in) & 1 ? fabsf(take_float(in)) : 0;
    }
}

static void take_level(level *l, const level *lower, size_t lower_count, bytes *in)
{
    rt_geometry *g = &l->geometry;
    memset(l, 0, sizeof *l);
    g->triangle_count = take_below(in, MAX_TRIANGLES + 1);
    g->vertex_count = g->triangle_count ? 1 + take_below(in, 3 * MAX_TRIANGLES) : 0;
    g->sphere_count = take_below(in, MAX_SPHERES + 1);
    g->instance_count = lower_count ? take_below(in, MAX_INSTANCES + 1) : 0;
    g->plane_count = take(in) & 3 ? 0 : take_below(in, MAX_PLANES + 1);
    point_to_arrays(l, g->triangle_count * 3 > g->vertex_count || take(in) > 64);
    take_shapes(l, in);
    for (size_t i = 0; i < g->instance_count; i++) {
        const uint32_t choice = take(in);
        l->instances[i].accel = choice == 255 ? NULL : lower[choice % lower_count].accel;
    }
}

/* Lets the level's instances show the plain twins. */
static void use_plain(level *l, const level *lower, size_t lower_count)
{
    for (size_t i = 0; i < l->geometry.instance_count; i++)
        for (size_t k = 0; k < lower_count; k++)
            if (l->instances[i].accel == lower[k].accel) {
                l->instances[i].accel = lower[k].plain;
                break;
            }
}

static void build_plain(level *l, const level *lower, size_t lower_count)
{
    const rt_build_options options = { .skip_invalid = true };
    rt_instance kept[MAX_INSTANCES];
    memcpy(kept, l->instances, sizeof kept);
    use_plain(l, lower, lower_count);
    if (rt_build(&l->plain, &l->geometry, &options) != RT_OK) fail("no plain tree");
    memcpy(l->instances, kept, sizeof kept);
}

/* Every primitive, no box: what the traversals must equal. accel is plain, p is prepared. */
static bool brute_force(const rt_accel *accel, rti_packet_1 *p, uint32_t inst)
{
    bool found = false;
    if (rti_hit_triangles_1(accel, p, 1, NULL, 0, (uint32_t)accel->slots[RTI_TRIANGLE], inst, 0)) found = true;
    if (rti_hit_spheres_1(accel, p, 1, NULL, 0, (uint32_t)accel->slots[RTI_SPHERE], inst, 0)) found = true;
    if (rti_hit_planes_1(accel, p, 1, inst, &rti_plain_jobs[RT_CLOSEST])) found = true;
    for (size_t i = 0; i < accel->slots[RTI_INSTANCE]; i++) {
        const rti_instance *in = &accel->instances[i];
        float org[3] = { p->org[0][0], p->org[1][0], p->org[2][0] }, dir[3] = { p->dir[0][0], p->dir[1][0], p->dir[2][0] };
        float to_org[3], to_dir[3];
        rti_packet_1 inner = *p;
        if (in->moves) rti_move_back(&in->motion, p->time[0], org, dir);
        rti_transform_ray(in->inverse, org, dir, to_org, to_dir);
        memcpy(inner.org, to_org, sizeof to_org);
        memcpy(inner.dir, to_dir, sizeof to_dir);
        if (!rti_prepare_1(in->accel, &inner, 1, false) || !brute_force(in->accel, &inner, inst + 1 + in->base)) continue;
        found = true;
        *p->t = *inner.t, *p->u = *inner.u, *p->v = *inner.v;
        p->prim = inner.prim, p->inst = inner.inst;
    }
    return found;
}

static void brute_force_hit(const rt_accel *accel, const rt_ray *ray, float time, rt_query query, rt_hit *hit)
{
    rti_packet_1 p;
    rti_load_rays_1(ray, &p);
    p.time[0] = rti_clamp_time(time);
    rti_no_hits_1(&p);
    if (!rti_prepare_1(accel, &p, 1, false) || !brute_force(accel, &p, RT_NONE)) rti_set_miss(hit);
    else if (query == RT_ANY) *hit = (rt_hit){ .inst = RT_NONE };
    else *hit = (rt_hit){ *p.t, *p.u, *p.v, *p.prim.id, *p.inst.id };
}

/* What a build may be asked for; mostly the defaults. */
static rt_build_options take_options(bytes *in)
{
    static const float costs[] = { 0, 0.01f, 1, 100 }, bonuses[] = { 0, -1, 0.5f, 1 }, duplications[] = { 0, 1, 1.5f, 16 };
    rt_build_options options = { .structure = (rt_structure)take_below(in, RT_STRUCTURE_COUNT), .quality = (rt_quality)take_below(in, 3) };
    const uint32_t flags = take(in);
    options.bounds = flags & 4 ? RT_BOUNDS_SPHERES : RT_BOUNDS_BOXES;
    options.branching = flags & 8 ? 2 + (int)(flags >> 4) % (RT_MAX_BRANCHING - 1) : 0;
    options.orders = flags & 32 ? 1 << (flags & 3) : 0;
    options.throw_back = flags & 64 ? 1e-6f : 0;
    options.reference = flags & 1;
    options.no_backtrack = flags & 2;
    options.no_wide = (flags & 144) == 128;
    options.no_binary = options.structure == RT_BVH && (flags & 144) == 144;
    options.traversal_cost = costs[take(in) & 3];
    options.empty_bonus = bonuses[take(in) & 3];
    options.max_duplication = duplications[take(in) & 3];
    return options;
}

static void trace_all(const rt_accel *accel, const rt_accel *plain, const rt_build_options *built, const rt_ray *rays, const float *times,
                      size_t count)
{
    static const int entries[] = { 0, 1, 2, RT_MAX_SHORT_STACK };
    const rt_algorithm_info *info;
    rt_hit want[MAX_RAYS], got[MAX_RAYS];
    int widths[16];
    for (int query = RT_CLOSEST; query <= RT_ANY; query++) {
        for (size_t i = 0; i < count; i++) brute_force_hit(plain, &rays[i], times[i], (rt_query)query, &want[i]);
        for (size_t a = 0; (info = rt_algorithm_get(a)) != NULL; a++) {
            const size_t tries = RT_ISA_COUNT * (info->algorithm == RT_KD_SHORTSTACK || info->culls ? sizeof entries / sizeof *entries : 1);
            if (!info->built || (info->structure != built->structure && info->structure != RT_STRUCTURE_COUNT)) continue;
            if (info->algorithm == RT_KD_BACKTRACK && built->no_backtrack) continue;
            if (info->algorithm == RT_BVH_WIDE && built->no_wide) continue;
            if (info->structure == RT_BVH && info->algorithm != RT_BVH_WIDE && built->no_binary) continue;
            for (size_t w = rt_packet_widths(info->algorithm, widths, 16); w-- > 0;)
                for (size_t i = 0; i < tries; i++) {
                    const int isa = (int)(i % RT_ISA_COUNT);
                    const rt_trace_options options = { .algorithm = info->algorithm, .packet_width = widths[w], .query = (rt_query)query,
                                                       .cull = (rt_cull)(info->culls ? i / RT_ISA_COUNT : RT_CULL_NONE),
                                                       .times = times,
                                                       .short_stack = info->culls ? 0 : entries[i / RT_ISA_COUNT], .isa = (rt_isa)isa };
                    if (rt_trace(accel, &options, rays, count, got) != RT_OK) {
                        if (isa == RT_ISA_AUTO) fail("a width of rt_packet_widths that rt_trace does not take");
                    } else if (memcmp(got, want, count * sizeof *got) != 0) {
                        fprintf(stderr, "rt_fuzz: %s, width %d, isa %d, query %d: ", info->name, widths[w], isa, query);
                        fail("not the hits of brute force");
                    }
                }
        }
    }
}

static rt_ray take_ray(const level *top, bytes *in)
{
    const size_t kind = take_below(in, 8), corners = top->geometry.vertex_count;
    const float *from = top->vertices + 3 * take_below(in, corners + !corners);
    const float *to = top->vertices + 3 * take_below(in, corners + !corners);
    rt_ray ray = { { 0, 0, 0 }, 0, { 0, 0, 0 }, HUGE_VALF };
    if (kind & 1) memcpy(&ray.org, from, sizeof ray.org);
    else take_floats(in, &ray.org.x, 3);
    take_floats(in, &ray.dir.x, 3);
    if (kind & 2) ray.dir = (rt_vec3){ to[0] - ray.org.x, to[1] - ray.org.y, to[2] - ray.org.z };
    if (kind & 4) take_floats(in, &ray.tmin, 1), take_floats(in, &ray.tmax, 1);
    return ray;
}

/* Makes rays stay together: about one direction, from one origin, or to one point at t = 1. */
static void bundle(rt_ray *rays, size_t count, bytes *in)
{
    const size_t kind = take_below(in, 4);
    const rt_vec3 org = rays[0].org, dir = rays[0].dir, end = { org.x + dir.x, org.y + dir.y, org.z + dir.z };
    for (size_t i = 1; i < count && kind; i++) {
        const float x = (float)(i % 8) / 64, y = (float)(i / 8) / 64;
        rt_ray *ray = &rays[i];
        if (take(in) % 16 == 0) continue;   /* as it was */
        *ray = rays[0];
        if (kind == 2) ray->dir = (rt_vec3){ dir.x + x * dir.y, dir.y + y * dir.z, dir.z - x * dir.x };
        else ray->org = (rt_vec3){ org.x + x * dir.y, org.y + y * dir.z, org.z - x * dir.x };
        if (kind == 3) {
            ray->dir = (rt_vec3){ end.x - ray->org.x, end.y - ray->org.y, end.z - ray->org.z };
            ray->tmax = rays[0].tmax = 1;
        }
    }
}

static void fuzz_geometry(bytes in)
{
    static level levels[LEVELS], moved;
    const size_t count = 1 + take_below(&in, LEVELS);
    level *top = &levels[count - 1];
    rt_build_options options = { 0 };
    rt_ray rays[MAX_RAYS];
    float times[MAX_RAYS];
    for (size_t i = 0; i < count; i++) {
        const bool lean = options.no_binary;           /* then all above must be */
        rt_status status;
        take_level(&levels[i], levels, i, &in);
        options = take_options(&in);
        if (lean) {
            options.structure = RT_BVH;
            options.no_binary = true;
            options.no_wide = false;
        }
        status = rt_build(&levels[i].accel, &levels[i].geometry, &options);
        if (status == RT_ERROR_GEOMETRY) {
            if (levels[i].accel) fail("a failed build that answers an accel");
            options.skip_invalid = true;
            status = rt_build(&levels[i].accel, &levels[i].geometry, &options);
        }
        if (status != RT_OK || !rti_validate(levels[i].accel)) fail("an invalid tree, or none with skip_invalid");
        build_plain(&levels[i], levels, i);
    }
    for (size_t i = 0; i < MAX_RAYS; i++) rays[i] = take_ray(top, &in);
    bundle(rays, MAX_RAYS, &in);
    for (size_t i = 0; i < MAX_RAYS; i++) times[i] = take(&in) & 7 ? (float)take(&in) / 255 : take_float(&in);
    trace_all(top->accel, top->plain, &options, rays, times, MAX_RAYS);
    if (take(&in) & 1) {
        rt_instance plain[MAX_INSTANCES];
        rt_status status;
        moved = *top;
        point_to_arrays(&moved, top->geometry.indices != NULL);
        take_shapes(&moved, &in);
        status = rt_refit(top->accel, &moved.geometry);                 /* may fail: then all is as it was */
        if (options.structure == RT_KDTREE && status == RT_OK) fail("a k-d tree that was refitted");
        if (!rti_validate(top->accel)) fail("an invalid tree after a refit");
        memcpy(plain, moved.instances, sizeof plain);
        use_plain(&moved, levels, count - 1);
        if (status == RT_OK && rt_refit(top->plain, &moved.geometry) != RT_OK) fail("a refit that fails for the plain tree only");
        memcpy(moved.instances, plain, sizeof plain);
        trace_all(top->accel, top->plain, &options, rays, times, MAX_RAYS);
    }
    for (size_t i = count; i-- > 0;) {
        rt_free(levels[i].accel);
        rt_free(levels[i].plain);
    }
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const extensions[] = { ".obj", ".nff", ".mtl" };
    bytes in = { data, data + size };
    const size_t kind = take_below(&in, 6);
    if (kind < 3) fuzz_loader(extensions[kind], in);
    else fuzz_geometry(in);
    return 0;
}

#ifndef RT_FUZZ_LIBFUZZER

static uint32_t next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

/* A kind, then random bytes; for a loader its words and numbers, here and there with another byte. */
static size_t random_input(uint64_t *state, uint8_t *data, size_t capacity)
{
    static const char *const words[] = {
        "v ", "vn ", "vt ", "f ", "g a", "usemtl a", "mtllib fuzz.mtl", "newmtl a", "newmtl b", "Kd ", "Ks ", "Ns ", "illum ", "d ", "Tr ",
        "b ", "l ", "f ", "s ", "c\n", "p 3\n", "pp 3\n", "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 8 8\n",
        "0 ", "1 ", "-1 ", "2 ", "3 ", "0.5 ", "1e18 ", "-2.25 ", "1e39 ", "nan ", "1//1 ", "2/2/2 ", "-1//-1 ", "4294967296 ",
        "\\\n", "#", "\r"
    };
    size_t size = 1, limit = 1 + next_random(state) % (capacity - 64);
    data[0] = (uint8_t)next_random(state);
    while (size < limit) {
        if (data[0] % 6 > 2 || next_random(state) % 100 == 0) {
            data[size++] = (uint8_t)next_random(state);
        } else {
            const char *word = next_random(state) % 4 == 0 ? "\n" : words[next_random(state) % (sizeof words / sizeof *words)];
            for (; *word && size < limit; word++) data[size++] = (uint8_t)*word;
        }
    }
    return size;
}

int main(int argc, char **argv)
{
    static uint8_t data[1 << 16];
    unsigned long runs = 10000;
    char *end = NULL;
    if (argc > 1) runs = strtoul(argv[1], &end, 10);
    if (argc > 1 && *end) {
        for (int i = 1; i < argc; i++) {
            FILE *file = fopen(argv[i], "rb");
            if (!file) return fprintf(stderr, "rt_fuzz: cannot read %s\n", argv[i]), 1;
            LLVMFuzzerTestOneInput(data, fread(data, 1, sizeof data, file));
            fclose(file);
        }
        return 0;
    }
    for (unsigned long run = 0; run < runs; run++) {
        uint64_t state = run;
        LLVMFuzzerTestOneInput(data, random_input(&state, data, 4096));
    }
    printf("rt_fuzz: %lu inputs\n", runs);
    return 0;
}

#endif
