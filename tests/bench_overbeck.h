/* bench_overbeck.h - the tables of [Overbeck] (Overbeck, Ramamoorthi, Mark: Large Ray Packets for Real-time Whitted Ray Tracing, 2008) on
   our machine. Part of bench.c.    SPDX-License-Identifier: MIT OR Unlicense

   >>overbeck-scenes  >>overbeck-ways  >>overbeck-rays  >>overbeck-frames  >>overbeck-packets  >>overbeck-plots  >>overbeck-depths
   >>overbeck-culling  >>overbeck-auto  >>overbeck-shots  >>overbeck-threads  >>overbeck-main

   The paper's numbers are those of 8 cores of 2008: compare ratios, not rates. Its ERW6, Toasters and Fairy scenes are not to be had;
   others of like size stand in for them. What the tables call 2x2 and 8 are SIMD rays, packets of bvh.simd; 4 to 32 are the sides of large
   packets. */

#define OVERBECK_SIZE 512                   /* of pictures whose rays are measured kind by kind: a fourth of the paper's, for the time */
#define OVERBECK_FRAME_SIZE 1024            /* of whole frames, as in the paper */
#define OVERBECK_ROUNDS 3
#define OVERBECK_THREAD_ROUNDS 5
#define OVERBECK_SECONDS 0.02               /* the least work that one of some thousand measurements times */
#define OVERBECK_IOR 1.5f                   /* where every surface is glass */

/* ---- >>overbeck-scenes ---------------------------------------------------------------------------------------------- */

typedef struct {
    const char *title, *file;               /* the file within --scenes */
    const char *procedural;                 /* of like size, where there is no such folder */
    rt_camera camera;                       /* fov 0: the file's camera and light */
    rt_vec3 light;
} overbeck_original;

/* By number of primitives. */
static const overbeck_original overbeck_originals[] = {
    { "Cornell Box", "papers/cornell_32.obj", "cornell", { { 0, 1, 3.6f }, { 0, 1, 0 }, { 0, 1, 0 }, 40 }, { 0, 1.9f, -0.03f } },
    { "Teapot", "spd/teapot_s12.nff", "sphere:10000", { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 }, { 0, 0, 0 } },
    { "Museum", "papers/bart_museum5_t0.obj", "balls:4", { { 0, 1.6f, -6 }, { 0, 1.6f, 0 }, { 0, 1, 0 }, 45 }, { 0, 4.5f, -2 } },
    { "Sponza", "papers/sponza.obj", "tetra:8", { { -9, 3, 0.5f }, { 10, 4.5f, -0.5f }, { 0, 1, 0 }, 60 }, { 0, 12, 0 } },
    { "Kitchen", "papers/bart_kitchen_t0.obj", "terrain:110000",
      { { 3.75f, 2.3f, 3.6f }, { 3.4366f, 1.8802f, 2.7483f }, { 0, 1, 0 }, 40 }, { 2, 2, 1 } },
    { "Rings", "spd/spd_rings_s5_t3.obj", "rings:6",
      { { -1, -2.61313f, 0.5f }, { -1, -1.61313f, 0.5f }, { 0, 0, 1 }, 45 }, { 3, -2.61313f, 3 } },
};
enum { OVERBECK_ORIGINALS = sizeof overbeck_originals / sizeof *overbeck_originals, OVERBECK_FAIRY = 4 };   /* what stands for the Fairy */

/* A scene for one picture of the paper's Table 2. */
typedef struct {
    overbeck_original scene;
    const char *stands_for;
    int depth;                              /* levels that follow an eye ray, of mirrors and glass alike; 0: the library's default */
    bool lit;                               /* one light, with shadows; else none */
    bool floor;                             /* stands on a mirror */
    bool polished;                          /* mirrors and glass as BART's own format has them, which the .mtl files do not ask for */
    const char *mirrors, *glass;            /* comma lists of names in the file */
    double simd, large, culling;            /* the paper: frames a second with 2x2 SIMD rays and with 16x16; what culling gains */
    const char *traversal;                  /* the paper's choice for mirrored and refracted rays */
} overbeck_shot;

static const overbeck_shot overbeck_shots[] = {
    { { "Teapot, floor", "models/teapot.obj", "sphere:10000", { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 0 }, { 0, 0, 0 } }, "Toasters",
      1, true, true, false, "", "", 1.9, 11.8, 1.35, "Ranged" },
    { { "Rings", "spd/spd_rings_s5_t3.obj", "rings:6",
        { { -1, -2.61313f, 0.5f }, { -1, -1.61313f, 0.5f }, { 0, 0, 1 }, 45 }, { 3, -2.61313f, 3 } }, "Fairy",
      1, false, false, false, "m000", "m004", 2.1, 6.7, 1.19, "Partition" },
    { { "Museum", "papers/bart_museum5_t0.obj", "mirrors:4",
        { { 0, 1.6f, -6 }, { 0, 1.6f, 0 }, { 0, 1, 0 }, 45 }, { 0, 4.5f, -2 } }, "BART Museum",
      3, false, false, true, "", "", 2.4, 8.5, 1.18, "Partition" },
    { { "Kitchen", "papers/bart_kitchen_t0.obj", "glass:4",
        { { 3.75f, 2.3f, 3.6f }, { 3.4366f, 1.8802f, 2.7483f }, { 0, 1, 0 }, 40 }, { 2, 2, 1 } }, "BART Kitchen",
      4, true, false, true, "", "", 1.2, 4, 1.19, "Partition" },
};
enum { OVERBECK_SHOTS = sizeof overbeck_shots / sizeof *overbeck_shots };

/* ---- >>overbeck-ways ------------------------------------------------------------------------------------------------ */

enum { METHODS = 3, SIDES = 4 };
static const struct { const char *name; rt_algorithm algorithm; } overbeck_methods[METHODS] = {
    { "masked", RT_BVH_MASKED }, { "ranged", RT_BVH_RANGED }, { "partition", RT_BVH_PARTITION }
};
enum { MASKED, RANGED, PARTITION };
static const int overbeck_sides[SIDES] = { 4, 8, 16, 32 };
enum { SIDE_16 = 2 };

/* How to trace: a SIMD ray, a single ray, auto, or a method of large packets with a side and a frustum. */
enum { WAY_SIMD_2, WAY_SIMD_8, WAY_STACK, WAY_AUTO, WAY_LARGE, WAYS = WAY_LARGE + METHODS * SIDES * RT_CULL_COUNT };

static int large_way(int method, int side, int cull) { return WAY_LARGE + (method * SIDES + side) * RT_CULL_COUNT + cull; }
static int way_method(int way) { return (way - WAY_LARGE) / (SIDES * RT_CULL_COUNT); }
static int way_side(int way) { return (way - WAY_LARGE) / RT_CULL_COUNT % SIDES; }
static rt_cull way_cull(int way) { return way < WAY_LARGE ? RT_CULL_NONE : (rt_cull)((way - WAY_LARGE) % RT_CULL_COUNT); }

static rt_algorithm way_algorithm(int way)
{
    static const rt_algorithm small[] = { RT_BVH_SIMD, RT_BVH_SIMD, RT_BVH_STACK, RT_AUTO };
    return way < WAY_LARGE ? small[way] : overbeck_methods[way_method(way)].algorithm;
}

static int way_packet(int way)
{
    static const int small[] = { 2, 8, 1, 0 };
    return way < WAY_LARGE ? small[way] : overbeck_sides[way_side(way)];
}

typedef struct { char text[32]; } overbeck_name;

static const char *way_name(int way, overbeck_name *out)
{
    static const char *const small[] = { "SIMD 2x2", "SIMD 8", "single", "auto" };
    const rt_cull cull = way_cull(way);
    if (way < WAY_LARGE) snprintf(out->text, sizeof out->text, "%s", small[way]);
    else snprintf(out->text, sizeof out->text, "%s %d%s%s", overbeck_methods[way_method(way)].name, way_packet(way),
                  cull == RT_CULL_NONE ? "" : " ", cull == RT_CULL_NONE ? "" : cull_names[cull]);
    return out->text;
}

/* Does this table of rays compare that way? */
static bool way_in(int table, int way)
{
    const rt_cull cull = way_cull(way);
    if (table == OVERBECK_RATES) return way < WAY_LARGE ? way <= WAY_SIMD_8 : cull == RT_CULL_BOTH;
    if (table == OVERBECK_CULLING) return way >= WAY_LARGE && way_method(way) == PARTITION;
    return table == OVERBECK_AUTO && (cull == RT_CULL_NONE || cull == RT_CULL_BOTH);
}

/* Kinds of rays, each traced by itself. Whatever a ray hits mirrors it, or is glass; what misses ends. */
enum { SET_PRIMARY, SET_SHADOW, SET_REFRACT_1, SET_REFRACT_2, SET_REFLECT_1, SET_REFLECT_2, SET_DIFFUSE, SETS };
static const struct { const char *name; ray_kind kind; bool refracted; int bounces; } overbeck_sets[SETS] = {
    { "primary",   PRIMARY, false, 0 }, { "shadow",    SHADOW,  false, 1 }, { "refract 1", REFLECT, true, 1 },
    { "refract 2", REFLECT, true,  2 }, { "reflect 1", REFLECT, false, 1 }, { "reflect 2", REFLECT, false, 2 },
    { "diffuse",   DIFFUSE, false, 1 },
};

/* The rows of the paper's figures: the rays of a picture. */
enum { ROWS_OF_SETS = 4 };
static const struct { const char *name; int count, sets[3]; } overbeck_rows[ROWS_OF_SETS] = {
    { "primary", 1, { SET_PRIMARY } },
    { "primary + shadow", 2, { SET_PRIMARY, SET_SHADOW } },
    { "primary + 2 refractions", 3, { SET_PRIMARY, SET_REFRACT_1, SET_REFRACT_2 } },
    { "primary + 2 reflections", 3, { SET_PRIMARY, SET_REFLECT_1, SET_REFLECT_2 } },
};

typedef struct { uint64_t rays, frusta, culled; } overbeck_tally;

typedef struct {
    bench bench;
    char title[24];
    const overbeck_original *original;      /* NULL: not one of the files above */
    const overbeck_shot *shot;              /* NULL: its own materials and lights */
    bool measured;
    double spread;                          /* the largest of the numbers below */
    size_t counts[SETS];                    /* rays */
    double seconds[SETS][WAYS];             /* of one pass over them; 0: not measured */
    overbeck_tally tallies[SETS][SIDES][RT_CULL_COUNT];         /* of Partition */
} overbeck_scene;

typedef struct {
    arguments a, frame;                     /* with the defaults of single kinds of rays, and of whole frames */
    pool *threads;
    buffers memory;                         /* for a's size */
    rt_vec3 *pixels[2];                     /* for the larger of both sizes */
    overbeck_scene *scenes, *shots;         /* shots: of Table 2 */
    size_t count, shot_count;
    double spread;                          /* of the frames of the table at hand, as in horn */
    bool fine;
} overbeck;

static size_t overbeck_primitives(const overbeck_scene *s)
{
    return s->bench.content.geometry.triangle_count + s->bench.content.geometry.sphere_count;
}

static void overbeck_free(overbeck *h)
{
    size_t i;
    for (i = 0; i < h->count; i++) bench_free(&h->scenes[i].bench);
    for (i = 0; i < h->shot_count; i++) bench_free(&h->shots[i].bench);
    free(h->scenes), free(h->shots), free(h->pixels[0]), free(h->pixels[1]);
    buffers_free(&h->memory);
}

/* Puts a square mirror under all triangles, three times as wide as they are; y is up. False: out of memory. */
static bool overbeck_add_floor(scene *c)
{
    static const int corners[4][2] = { { -3, -3 }, { -3, 3 }, { 3, 3 }, { 3, -3 } }, cut[6] = { 0, 1, 2, 0, 2, 3 };
    const size_t n = c->geometry.triangle_count, v = c->geometry.vertex_count, ids = n + c->geometry.sphere_count;
    float *vertices = realloc(c->vertices, 3 * (v + 4) * sizeof *vertices);
    uint32_t *indices, *material_ids, *normals = NULL;
    rt_vec3 *colors = NULL, lower = vec(INFINITY, INFINITY, INFINITY), upper = vec(-INFINITY, -INFINITY, -INFINITY);
    rt_material *materials;
    float half;
    size_t i;

    if (!vertices) return complain("out of memory");
    c->geometry.vertices = c->vertices = vertices;
    indices = realloc(c->indices, 3 * (n + 2) * sizeof *indices);
    if (!indices) return complain("out of memory");
    c->geometry.indices = c->indices = indices;
    material_ids = realloc(c->material_ids, (ids + 2) * sizeof *material_ids);
    if (!material_ids) return complain("out of memory");
    c->material_ids = material_ids;
    materials = realloc(c->materials, (c->material_count + 1) * sizeof *materials);
    if (!materials) return complain("out of memory");
    c->materials = materials;
    if (c->normals && !(normals = realloc(c->normal_indices, 3 * (n + 2) * sizeof *normals))) return complain("out of memory");
    if (normals) c->normal_indices = normals;
    if (c->colors && !(colors = realloc(c->colors, (v + 4) * sizeof *colors))) return complain("out of memory");
    if (colors) c->colors = colors;

    for (i = 0; i < 3 * n; i++) {
        const rt_vec3 p = vertex_at(&c->geometry, indices[i]);
        lower = vec(fminf(lower.x, p.x), fminf(lower.y, p.y), fminf(lower.z, p.z));
        upper = vec(fmaxf(upper.x, p.x), fmaxf(upper.y, p.y), fmaxf(upper.z, p.z));
    }
    half = 0.5f * fmaxf(upper.x - lower.x, upper.z - lower.z);
    for (i = 0; i < 4; i++) {
        vertices[3 * (v + i)] = (lower.x + upper.x) / 2 + half * (float)corners[i][0];
        vertices[3 * (v + i) + 1] = lower.y;
        vertices[3 * (v + i) + 2] = (lower.z + upper.z) / 2 + half * (float)corners[i][1];
        if (colors) colors[v + i] = vec(1, 1, 1);
    }
    for (i = 0; i < 6; i++) {
        indices[3 * n + i] = (uint32_t)v + (uint32_t)cut[i];
        if (normals) normals[3 * n + i] = RT_NONE;
    }
    memmove(material_ids + n + 2, material_ids + n, (ids - n) * sizeof *material_ids);
    material_ids[n] = material_ids[n + 1] = (uint32_t)c->material_count;
    memset(&materials[c->material_count], 0, sizeof *materials);
    materials[c->material_count].diffuse = vec(0.4f, 0.4f, 0.4f);
    materials[c->material_count].reflect = vec(0.5f, 0.5f, 0.5f);
    materials[c->material_count++].ior = 1;
    c->geometry.vertex_count += 4;
    c->geometry.triangle_count += 2;
    return true;
}

/* Makes mirrors and glass of the materials, as the shot says. */
static void overbeck_polish(scene *c, const overbeck_shot *shot)
{
    size_t i;
    for (i = 0; i < c->material_count; i++) {
        rt_material *m = &c->materials[i];
        if (shot->polished && c->shiny_materials) *m = c->shiny_materials[i];
        if (listed(shot->mirrors, c->material_names[i])) {
            m->diffuse = vec(0.5f * m->diffuse.x, 0.5f * m->diffuse.y, 0.5f * m->diffuse.z);
            m->reflect = vec(0.5f, 0.5f, 0.5f);
        }
        if (!listed(shot->glass, c->material_names[i])) continue;
        m->transmit = vec(0.8f, 0.8f, 0.8f);
        m->ior = OVERBECK_IOR;
    }
}

/* Loads and builds given, or, where that is NULL, the original's file or what stands for it. */
static bool overbeck_open(overbeck *h, overbeck_scene *s, const char *given, const overbeck_original *original, const overbeck_shot *shot)
{
    const arguments *a = &h->a;
    scene *content = &s->bench.content;
    const char *name = given ? given : original->procedural, *slash;
    char path[4096];
    scene_error error;

    s->bench.memory = &h->memory;
    if (!given && a->scene_folder) {
        s->original = original;
        snprintf(path, sizeof path, "%s/%s", a->scene_folder, original->file);
        name = path;
    }
    if (!scene_load(content, name, NULL, NULL, &error)) return complain("%s", error.message);
    slash = strrchr(name, '/');
    snprintf(s->title, sizeof s->title, "%.19s", s->original ? original->title : slash ? slash + 1 : name);
    if (s->original && original->camera.fov > 0) {
        content->camera = original->camera;
        scene_default_lights(&original->camera, content->lights);
        content->lights[0].position = original->light;
        content->has_lights = true;
    }
    aim(content, a);
    if (!given && shot) {
        s->shot = shot;
        if (s->original) overbeck_polish(content, shot);
        if (shot->floor && !overbeck_add_floor(content)) return false;
    }
    return build(&s->bench, RT_BVH, a, h->threads);
}

/* The scenes of the paper's section 5; with --scene those. */
static bool overbeck_load(overbeck *h)
{
    size_t i, count = h->a.scene_count ? h->a.scene_count : OVERBECK_ORIGINALS;

    if (h->scenes) return true;
    h->scenes = calloc(count, sizeof *h->scenes);
    if (!h->scenes) return complain("out of memory");
    for (i = 0; i < count; i++) {
        h->count++;
        if (!overbeck_open(h, &h->scenes[i], h->a.scene_count ? h->a.scenes[i] : NULL, h->a.scene_count ? NULL : &overbeck_originals[i], NULL))
            return false;
    }
    return true;
}

/* Those of section 6. */
static bool overbeck_load_shots(overbeck *h)
{
    size_t i, count = h->a.scene_count ? h->a.scene_count : OVERBECK_SHOTS;

    if (h->shots) return true;
    h->shots = calloc(count, sizeof *h->shots);
    if (!h->shots) return complain("out of memory");
    for (i = 0; i < count; i++) {
        h->shot_count++;
        const overbeck_shot *shot = h->a.scene_count ? NULL : &overbeck_shots[i];
        if (!overbeck_open(h, &h->shots[i], shot ? NULL : h->a.scenes[i], shot ? &shot->scene : NULL, shot)) return false;
    }
    return true;
}

/* The opening of a table. */
static void overbeck_print_title(const overbeck *h, const arguments *a, const char *table, const char *title)
{
    printf("\n%s: %s\n  %dx%d, %d thread%s, median of %d\n", table, title, a->width, a->height, pool_threads(h->threads),
           pool_threads(h->threads) == 1 ? "" : "s", a->rounds);
}

static void overbeck_print_scene(const overbeck_scene *s)
{
    printf("%s: %zu triangles", s->title, s->bench.content.geometry.triangle_count);
    if (s->bench.content.geometry.sphere_count) printf(", %zu spheres", s->bench.content.geometry.sphere_count);
    printf("\n");
}

/* ---- >>overbeck-rays ------------------------------------------------------------------------------------------------ */

/* Rays bent by Snell's law into or out of what rays have hit; mirrored where that is impossible. Returns how many; out may be rays. */
static size_t overbeck_refract(const rt_geometry *geometry, const rt_ray *rays, const rt_hit *hits, size_t count, rt_ray *out)
{
    size_t i, made = 0;

    for (i = 0; i < count; i++) {
        const rt_vec3 dir = unit(rays[i].dir), point = add_scaled(rays[i].org, rays[i].dir, hits[i].t);
        const float tmin = RAY_EPSILON * hits[i].t * length(rays[i].dir);
        rt_vec3 n;
        float eta = 1 / OVERBECK_IOR, c, cosine2;

        if (hits[i].prim == RT_NONE) continue;
        n = outer_normal(geometry, &hits[i], point);
        c = -dot(n, dir);
        if (c < 0) eta = OVERBECK_IOR, c = -c, n = vec(-n.x, -n.y, -n.z);
        cosine2 = 1 - eta * eta * (1 - c * c);
        out[made].org = point;
        out[made].dir = cosine2 <= 0 ? unit(add_scaled(dir, n, 2 * c))
                                     : unit(add_scaled(vec(eta * dir.x, eta * dir.y, eta * dir.z), n, eta * c - sqrtf(cosine2)));
        out[made].tmin = tmin;
        out[made++].tmax = INFINITY;
    }
    return made;
}

/* The next generation of a kind of rays, from those that have hit; out may be rays. */
static size_t overbeck_bounce(const scene *c, int set, const rt_ray *rays, const rt_hit *hits, size_t count, rt_ray *out)
{
    if (overbeck_sets[set].refracted) return overbeck_refract(&c->geometry, rays, hits, count, out);
    return make_secondary(overbeck_sets[set].kind, &c->geometry, c->lights[0].position, rays, hits, count, out);
}

/* One kind of rays, from the primary rays of trace_primary. */
static batch overbeck_rays(const overbeck *h, const bench *s, int set)
{
    const buffers *m = s->memory;
    batch b = make_batch(s, PRIMARY, &h->a);
    int bounce;

    b.kind = overbeck_sets[set].kind;
    b.query = b.kind == SHADOW ? RT_ANY : RT_CLOSEST;
    b.label = overbeck_sets[set].name;
    b.seconds = OVERBECK_SECONDS;
    if (overbeck_sets[set].bounces == 0) return b;
    b.rays = m->rays;
    b.count = overbeck_bounce(&s->content, set, m->primary, m->primary_hits, b.count, m->rays);
    for (bounce = 1; bounce < overbeck_sets[set].bounces; bounce++) {
        rt_trace(s->accels[RT_BVH], NULL, m->rays, b.count, m->truth);
        b.count = overbeck_bounce(&s->content, set, m->rays, m->truth, b.count, m->rays);
    }
    return b;
}

/* The tables that compare ways to trace single kinds of rays: from the same measurements. */
static const struct { int table; const char *word; } overbeck_ray_tables[] = {
    { OVERBECK_RATES, "overbeck.5" }, { OVERBECK_CULLING, "overbeck.7" }, { OVERBECK_AUTO, "overbeck.auto" }
};
enum { OVERBECK_RAY_TABLES = sizeof overbeck_ray_tables / sizeof *overbeck_ray_tables };

/* An object for each table that is asked for and compares that way. */
static void overbeck_print_json(const overbeck *h, const overbeck_scene *s, const batch *rays, const entry *e, int way)
{
    int i;
    for (i = 0; i < OVERBECK_RAY_TABLES; i++)
        if (wants(&h->a, "overbeck", overbeck_ray_tables[i].word) && way_in(overbeck_ray_tables[i].table, way))
            print_json(overbeck_ray_tables[i].word, e, rays, s->bench.content.name, overbeck_primitives(s), pool_threads(h->threads));
}

/* Measures every kind of ray with every way that some table asks for, unless that is done. */
static bool overbeck_measure(overbeck *h, overbeck_scene *s)
{
    bench *b = &s->bench;
    int ways[WAYS], set, way, i;
    size_t k;

    if (s->measured) return true;
    s->measured = true;
    b->entry_count = 0;
    for (way = 0; way < WAYS; way++) {
        const rt_algorithm_info *info = rt_algorithm_get((size_t)way_algorithm(way));
        bool wanted = false;
        for (i = 0; i < OVERBECK_RAY_TABLES; i++)
            wanted = wanted || (wants(&h->a, "overbeck", overbeck_ray_tables[i].word) && way_in(overbeck_ray_tables[i].table, way));
        if (!wanted || !takes(b->accels[RT_BVH], &h->a, info->algorithm, way_packet(way))) continue;
        ways[b->entry_count] = way;
        if (!add_ours(b, info, RT_BVH, way_packet(way), way_cull(way), &h->a, h->threads)) return false;
    }
    trace_primary(b, b->accels[RT_BVH], &h->a);
    for (set = 0; set < SETS; set++) {
        const batch rays = overbeck_rays(h, b, set);
        if (rays.count == 0 || (set == SET_DIFFUSE && !wants(&h->a, "overbeck", "overbeck.auto"))) continue;
        s->counts[set] = rays.count;
        if (!measure_batch(b, &rays, b->accels[RT_BVH], h->threads, h->a.rounds, &h->fine)) return false;
        for (k = 0; k < b->entry_count; k++) {
            const entry *e = &b->entries[k];
            way = ways[k];
            s->seconds[set][way] = e->median;
            s->spread = fmax(s->spread, e->spread);
            if (way >= WAY_LARGE && way_method(way) == PARTITION) {
                overbeck_tally *t = &s->tallies[set][way_side(way)][way_cull(way)];
                t->rays = e->stats.rays, t->frusta = e->stats.frusta, t->culled = e->stats.culled;
            }
            if (h->a.json) overbeck_print_json(h, s, &rays, e, way);
        }
    }
    return true;
}

static double overbeck_rate(const overbeck_scene *s, int set, int way)
{
    return s->seconds[set][way] > 0 ? (double)s->counts[set] / s->seconds[set][way] * 1e-6 : 0;
}

/* How much faster the first is than the second; 0 where one is not measured. */
static double overbeck_gain(double seconds, double of) { return seconds > 0 ? of / seconds : 0; }

/* The fastest of the ways that a table compares, other than auto; -1: none is measured. */
static int overbeck_best(int table, const double seconds[WAYS])
{
    int way, best = -1;
    for (way = 0; way < WAYS; way++)
        if (way != WAY_AUTO && way_in(table, way) && seconds[way] > 0 && (best < 0 || seconds[way] < seconds[best])) best = way;
    return best;
}

/* The geometric mean over the scenes of how much faster one way is than another on a kind of rays; 0: nothing to compare. */
static double overbeck_mean_gain(const overbeck *h, int set, int way, int of)
{
    double sum = 0;
    size_t i, n = 0;
    for (i = 0; i < h->count; i++) {
        const double *seconds = h->scenes[i].seconds[set];
        if (seconds[way] > 0 && seconds[of] > 0) sum += log(seconds[of] / seconds[way]), n++;
    }
    return n ? exp(sum / (double)n) : 0;
}

/* The end of a table; rays: of one of those that overbeck_measure serves. */
static void overbeck_print_spread(const overbeck *h, bool rays)
{
    double most = h->spread;
    size_t i;
    for (i = 0; i < h->count && rays; i++) most = fmax(most, h->scenes[i].spread);
    printf("  spread, (slowest - fastest) / median of one number: at most %.0f%%\n", 100 * most);
}

/* ---- >>overbeck-frames ---------------------------------------------------------------------------------------------- */

enum { FRAME_TILE = 64 };                   /* pixels a side that a thread draws at once: a multiple of the library's blocks */

typedef struct {
    const rt_scene *view;
    rt_render_options how;
    rt_vec3 *pixels;
    size_t columns;
    uint64_t rays[4];                       /* as in rt_ray_counts; atomic */
    int failed;                             /* atomic */
} overbeck_frame;

static void overbeck_draw_tile(void *context, size_t index)
{
    overbeck_frame *f = context;
    const int x = (int)(index % f->columns) * FRAME_TILE, y = (int)(index / f->columns) * FRAME_TILE;
    const int right = x + FRAME_TILE < f->how.width ? x + FRAME_TILE : f->how.width;
    const int bottom = y + FRAME_TILE < f->how.height ? y + FRAME_TILE : f->how.height;
    rt_ray_counts counts = { 0, 0, 0, 0 };
    uint64_t sums[4];
    int i;

    if (rt_render_tile(f->view, &f->how, x, y, right, bottom, f->pixels, &counts) != RT_OK)
        __atomic_store_n(&f->failed, 1, __ATOMIC_RELAXED);
    sums[0] = counts.primary, sums[1] = counts.shadow, sums[2] = counts.reflect, sums[3] = counts.refract;
    for (i = 0; i < 4; i++) __atomic_fetch_add(&f->rays[i], sums[i], __ATOMIC_RELAXED);
}

/* Draws a frame; seconds. rays may be NULL. */
static double overbeck_draw(overbeck *h, const rt_scene *view, const arguments *a, int depth, int way, pool *threads, rt_vec3 *pixels,
                            uint64_t rays[4])
{
    const size_t rows = (size_t)(a->height + FRAME_TILE - 1) / FRAME_TILE;
    overbeck_frame f;
    double start;

    memset(&f, 0, sizeof f);
    f.view = view;
    f.how.width = a->width;
    f.how.height = a->height;
    f.how.depth = depth;
    f.how.trace.algorithm = way_algorithm(way);
    f.how.trace.packet_width = way_packet(way);
    f.how.trace.cull = way_cull(way);
    f.how.trace.isa = (rt_isa)a->isa;
    f.pixels = pixels;
    f.columns = (size_t)(a->width + FRAME_TILE - 1) / FRAME_TILE;
    start = now();
    pool_for(threads, f.columns * rows, overbeck_draw_tile, &f);
    start = now() - start;
    if (f.failed) h->fine = complain("a frame cannot be drawn with %s", rt_algorithm_get((size_t)way_algorithm(way))->name);
    if (rays) memcpy(rays, f.rays, sizeof f.rays);
    return start;
}

/* Times frames of one view in turns, those ways that wanted says; 0: not measured. All pictures must be the same. */
static void overbeck_time_frames(overbeck *h, const overbeck_scene *s, const rt_scene *view, const arguments *a, int depth,
                                 const bool wanted[WAYS], double seconds[WAYS], uint64_t rays[4])
{
    static double all[WAYS][MAX_ROUNDS];
    const size_t bytes = (size_t)a->width * (size_t)a->height * sizeof *h->pixels[0];
    overbeck_name name;
    int round, way;

    overbeck_draw(h, view, a, depth, WAY_AUTO, h->threads, h->pixels[0], rays);         /* warms up, and is the picture to compare with */
    for (round = 0; round < a->rounds; round++)
        for (way = 0; way < WAYS; way++) {
            if (!wanted[way] || !takes(view->accel, a, way_algorithm(way), way_packet(way))) continue;
            all[way][round] = overbeck_draw(h, view, a, depth, way, h->threads, h->pixels[1], NULL);
            if (round == 0 && memcmp(h->pixels[0], h->pixels[1], bytes) != 0)
                h->fine = complain("%s: the picture of %s is another", s->title, way_name(way, &name));
        }
    for (way = 0; way < WAYS; way++) {
        const bool has = wanted[way] && takes(view->accel, a, way_algorithm(way), way_packet(way));
        seconds[way] = has ? median(all[way], a->rounds) : 0;
        if (has) h->spread = fmax(h->spread, (all[way][a->rounds - 1] - all[way][0]) / seconds[way]);
    }
}

static void overbeck_frame_json(const overbeck_scene *s, const char *table, const arguments *a, const char *effect, int way, int threads,
                                double seconds)
{
    begin_json(table, s->bench.content.name);
    printf(",\"primitives\":%zu,\"structure\":\"bvh\",\"algorithm\":\"%s\",\"packet\":%d,\"cull\":\"%s\",\"effect\":\"%s\","
           "\"size\":\"%dx%d\",\"threads\":%d,\"frames_per_s\":%.4f}\n", overbeck_primitives(s),
           rt_algorithm_get((size_t)way_algorithm(way))->name, way_packet(way), cull_names[way_cull(way)], effect, a->width, a->height,
           threads, 1 / seconds);
}

/* ---- >>overbeck-packets --------------------------------------------------------------------------------------------- */

/* A line for each way of Figure 5, three numbers a column: a rate in Mrays/s, or milliseconds where counts is NULL, and how much faster
   than SIMD rays of 2x2 and of 8 that is. Below, the best of each column. */
static void overbeck_print_ways(const char *what, int columns, const char *const *names, double (*seconds)[WAYS], const size_t *counts)
{
    overbeck_name name;
    int way, column;

    printf("  %-13s", what);
    for (column = 0; column < columns; column++) printf(" %-19.19s", names[column]);
    printf("\n%15s", "");
    for (column = 0; column < columns; column++) printf(" %8s %5s %4s", counts ? "Mrays/s" : "ms", "x 2x2", "x 8");
    printf("\n");
    for (way = 0; way < WAYS; way++) {
        if (!way_in(OVERBECK_RATES, way)) continue;
        way_name(way, &name);
        if (way >= WAY_LARGE) *strrchr(name.text, ' ') = '\0';
        printf("  %-13s", name.text);
        for (column = 0; column < columns; column++) {
            const double *of = seconds[column], took = of[way];
            horn_print_cell(9, counts ? 2 : 1, took > 0 ? counts ? (double)counts[column] / took * 1e-6 : 1e3 * took : 0);
            horn_print_cell(6, 2, overbeck_gain(took, of[WAY_SIMD_2]));
            horn_print_cell(5, 2, overbeck_gain(took, of[WAY_SIMD_8]));
        }
        printf("\n");
    }
    printf("  %-13s", "best");
    for (column = 0; column < columns; column++) {
        const int best = overbeck_best(OVERBECK_RATES, seconds[column]);
        name.text[0] = '\0';
        if (best >= 0) way_name(best, &name);
        if (best >= WAY_LARGE) *strrchr(name.text, ' ') = '\0';
        printf("  %18s", name.text);
    }
    printf("\n");
}

/* One line for each side: how two ways compare on each kind of rays, the mean of all scenes. */
static void overbeck_print_means(const overbeck *h, const char *what, int method, int of_method)
{
    int side, set;

    for (side = 0; side < SIDES; side++) {
        printf("  %-18s %2d", side ? "" : what, overbeck_sides[side]);
        for (set = 0; set < SET_DIFFUSE; set++)
            horn_print_cell(11, 2, overbeck_mean_gain(h, set, large_way(method, side, RT_CULL_BOTH),
                                                      large_way(of_method, side, RT_CULL_BOTH)));
        printf("\n");
    }
}

static bool overbeck_plot_ways(const overbeck *h, const char *word, const char *title, const int *methods, const int *culls,
                               const char *const *labels, int count);

/* The rows of Figure 5 as whole frames, every surface a mirror or glass. Without lights no shadow rays: then the surroundings light. */
static bool overbeck_effects(overbeck *h, const overbeck_scene *s, double seconds[ROWS_OF_SETS][WAYS])
{
    rt_scene view = scene_view(&s->bench.content, s->bench.accels[RT_BVH]);
    rt_material *materials = calloc(view.material_count + 1, sizeof *materials);
    rt_light light;
    bool wanted[WAYS];
    size_t i;
    int row, way;

    if (!materials) return complain("out of memory");
    for (way = 0; way < WAYS; way++) wanted[way] = way_in(OVERBECK_RATES, way);
    light.position = s->bench.content.lights[0].position;
    light.color = vec(0.7f, 0.7f, 0.7f);
    view.lights = &light;
    view.materials = materials;
    for (row = 0; row < ROWS_OF_SETS; row++) {
        const bool lit = row == 1, glass = row == 2, mirror = row == 3;
        view.light_count = lit ? 1 : 0;
        view.ambient = lit ? vec(0.2f, 0.2f, 0.2f) : vec(0.8f, 0.8f, 0.8f);
        for (i = 0; i < view.material_count; i++) {
            rt_material *m = &materials[i];
            const float dim = glass || mirror ? 0.3f : 1;
            *m = s->bench.content.materials[i];
            m->diffuse = vec(dim * m->diffuse.x, dim * m->diffuse.y, dim * m->diffuse.z);
            m->specular = m->absorb = vec(0, 0, 0);
            m->reflect = mirror ? vec(0.7f, 0.7f, 0.7f) : vec(0, 0, 0);
            m->transmit = glass ? vec(0.7f, 0.7f, 0.7f) : vec(0, 0, 0);
            m->ior = OVERBECK_IOR;
            m->fresnel = false;
        }
        overbeck_time_frames(h, s, &view, &h->a, glass || mirror ? 2 : -1, wanted, seconds[row], NULL);
        for (way = 0; way < WAYS && h->a.json; way++)
            if (seconds[row][way] > 0)
                overbeck_frame_json(s, "overbeck.5", &h->a, overbeck_rows[row].name, way, pool_threads(h->threads), seconds[row][way]);
    }
    free(materials);
    return true;
}

static bool overbeck_packets(overbeck *h)
{
    static const int methods[] = { MASKED, RANGED, PARTITION }, culls[] = { RT_CULL_BOTH, RT_CULL_BOTH, RT_CULL_BOTH };
    static const char *const labels[] = { "Masked", "Ranged", "Partition" };
    const char *names[SETS];
    size_t i;
    int k;

    if (!overbeck_load(h)) return false;
    if (!h->a.json) {
        overbeck_print_title(h, &h->a, "overbeck.5", "Masked, Ranged and Partition by packet width, frustum culling both; every surface "
                             "a mirror, or glass");
        printf("  rays: each kind by itself. frames: with shading; the rays of the paper's figure together\n");
    }
    for (k = 0; k < SETS; k++) names[k] = overbeck_sets[k].name;
    for (i = 0; i < h->count; i++) {
        overbeck_scene *s = &h->scenes[i];
        const char *columns[ROWS_OF_SETS];
        double frames[ROWS_OF_SETS][WAYS];

        if (!overbeck_measure(h, s) || !overbeck_effects(h, s, frames)) return false;
        if (h->a.json) continue;
        overbeck_print_scene(s);
        overbeck_print_ways("rays", SET_DIFFUSE, names, s->seconds, s->counts);
        for (k = 0; k < ROWS_OF_SETS; k++) columns[k] = k ? strchr(overbeck_rows[k].name, '+') : overbeck_rows[k].name;
        overbeck_print_ways("frames", ROWS_OF_SETS, columns, frames, NULL);
        fflush(stdout);
    }
    if (!h->a.json) {
        printf("rates, geometric mean of the scenes\n%21s", "");
        for (k = 0; k < SET_DIFFUSE; k++) printf("%11s", names[k]);
        printf("\n");
        overbeck_print_means(h, "Masked x Ranged", MASKED, RANGED);
        overbeck_print_means(h, "Partition x Ranged", PARTITION, RANGED);
        overbeck_print_spread(h, true);
    }
    return !h->a.svg || overbeck_plot_ways(h, "overbeck.5", "Milliseconds of tracing the rays of a picture by packet width, frustum "
                                           "culling both", methods, culls, labels, METHODS);
}

/* ---- >>overbeck-plots ----------------------------------------------------------------------------------------------- */

enum { GRID_WIDTH = 150, GRID_HEIGHT = 105, GRID_LEFT = 46, GRID_TOP = 26, GRID_BOTTOM = 30, GRID_HEAD = 76 };
static const char *const overbeck_colors[] = { "#e0a000", "#1b6ca8", "#b8327a", "#3a7d44" };

/* Milliseconds that the rays of a row take that way; 0: not measured. */
static double overbeck_milliseconds(const overbeck_scene *s, int row, int way)
{
    double sum = 0;
    int i;
    for (i = 0; i < overbeck_rows[row].count; i++) {
        const int set = overbeck_rows[row].sets[i];
        if (s->counts[set] && s->seconds[set][way] <= 0) return 0;
        sum += 1e3 * s->seconds[set][way];
    }
    return sum;
}

static void overbeck_plot_panel(FILE *file, const overbeck_scene *s, int row, double x0, double y0, const int *methods, const int *culls,
                                int count)
{
    const double step = (double)GRID_WIDTH / SIDES;
    double most = 1e-3;
    char label[16];
    int side, k;

    for (k = 0; k < count; k++)
        for (side = 0; side < SIDES; side++) most = fmax(most, overbeck_milliseconds(s, row, large_way(methods[k], side, culls[k])));
    for (k = WAY_SIMD_2; k <= WAY_SIMD_8; k++) most = fmax(most, overbeck_milliseconds(s, row, k));
    most = svg_scale(file, x0, y0, GRID_WIDTH, GRID_HEIGHT, most);
    for (side = 0; side < SIDES; side++) {
        snprintf(label, sizeof label, "%d", overbeck_sides[side]);
        svg_text(file, x0 + step * (side + 0.5), y0 + 15, "middle", "#000", label);
    }
    for (k = WAY_SIMD_2; k <= WAY_SIMD_8; k++) {
        const double ms = overbeck_milliseconds(s, row, k);
        if (ms > 0)
            fprintf(file, "<path d=\"M%.1f %.1fh%d\" stroke=\"#555\" stroke-dasharray=\"%s\"/>\n", x0, y0 - ms / most * GRID_HEIGHT,
                    GRID_WIDTH, k == WAY_SIMD_2 ? "6 3" : "2 3");
    }
    for (k = 0; k < count; k++) {
        bool drawn = false;
        fprintf(file, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"2\" d=\"", overbeck_colors[k]);
        for (side = 0; side < SIDES; side++) {
            const double ms = overbeck_milliseconds(s, row, large_way(methods[k], side, culls[k]));
            if (ms <= 0) continue;
            fprintf(file, "%c%.1f %.1f", drawn ? 'L' : 'M', x0 + step * (side + 0.5), y0 - ms / most * GRID_HEIGHT);
            drawn = true;
        }
        fprintf(file, "\"/>\n");
    }
}

/* A small plot for each scene, from left to right, and each row of rays: a curve for each method and frustum; broken lines for SIMD rays,
   where they are measured. Every plot has a scale of its own, from 0. */
static bool overbeck_plot_ways(const overbeck *h, const char *word, const char *title, const int *methods, const int *culls,
                               const char *const *labels, int count)
{
    const double across = GRID_LEFT + GRID_WIDTH + 14, down = GRID_TOP + GRID_HEIGHT + GRID_BOTTOM;
    const bool simd = h->scenes[0].seconds[SET_PRIMARY][WAY_SIMD_2] > 0;
    const double width = fmax(across * (double)h->count, 640);
    FILE *file = plot_open(&h->a, word, width, GRID_HEAD + ROWS_OF_SETS * down, title);
    char text[160];
    size_t i;
    int row, k;

    if (!file) return false;
    svg_text(file, 10, 20, "start", "#000", title);
    for (k = 0; k < count; k++) {
        fprintf(file, "<path d=\"M%d 36h24\" stroke=\"%s\" stroke-width=\"2\"/>\n", 10 + 125 * k, overbeck_colors[k]);
        svg_text(file, 40 + 125 * k, 40, "start", overbeck_colors[k], labels[k]);
    }
    for (k = 0; k < 2 && simd; k++) {
        fprintf(file, "<path d=\"M%d 36h24\" stroke=\"#555\" stroke-dasharray=\"%s\"/>\n", 10 + 125 * (count + k), k ? "2 3" : "6 3");
        svg_text(file, 40 + 125 * (count + k), 40, "start", "#555", k ? "SIMD rays, 8" : "SIMD rays, 2x2");
    }
    for (i = 0; i < h->count; i++) {
        snprintf(text, sizeof text, "%s (%zu)", h->scenes[i].title, overbeck_primitives(&h->scenes[i]));
        fprintf(file, "<g font-weight=\"bold\">");
        svg_text(file, across * (double)i + GRID_LEFT + GRID_WIDTH / 2.0, 66, "middle", "#000", text);
        fprintf(file, "</g>\n");
        for (row = 0; row < ROWS_OF_SETS; row++) {
            const double x0 = across * (double)i + GRID_LEFT, y0 = GRID_HEAD + row * down + GRID_TOP + GRID_HEIGHT;
            svg_text(file, x0 + GRID_WIDTH / 2.0, y0 - GRID_HEIGHT - 11, "middle", "#000", overbeck_rows[row].name);
            overbeck_plot_panel(file, &h->scenes[i], row, x0, y0, methods, culls, count);
        }
    }
    return plot_close(&h->a, word, file);
}

/* ---- >>overbeck-depths ---------------------------------------------------------------------------------------------- */

enum { DEPTH_RAYS = 2, DEPTH_METHODS = 2 };                     /* eye rays, mirrored rays of both bounces; Ranged and Partition */
static const char *const overbeck_depth_rays[DEPTH_RAYS] = { "primary", "2 reflections" };
typedef rt_stats overbeck_histogram[DEPTH_RAYS][DEPTH_METHODS];

/* Counts the tests of 16x16 packets, by depth. */
static bool overbeck_count_depths(overbeck *h, const overbeck_scene *s, overbeck_histogram stats)
{
    const bench *b = &s->bench;
    int set, k;

    memset(stats, 0, sizeof(overbeck_histogram));
    trace_primary(b, b->accels[RT_BVH], &h->a);
    for (set = 0; set < SETS; set++) {
        const int to = set == SET_PRIMARY ? 0 : 1;
        batch rays;

        if (set != SET_PRIMARY && set != SET_REFLECT_1 && set != SET_REFLECT_2) continue;
        rays = overbeck_rays(h, b, set);
        rt_trace(b->accels[RT_BVH], NULL, rays.rays, rays.count, b->memory->truth);
        for (k = 0; k < DEPTH_METHODS; k++) {
            rt_trace_options options;
            rt_error error;

            memset(&options, 0, sizeof options);
            options.algorithm = overbeck_methods[RANGED + k].algorithm;
            options.packet_width = overbeck_sides[SIDE_16];
            options.cull = RT_CULL_BOTH;
            options.isa = (rt_isa)h->a.isa;
            options.stats = &stats[to][k];
            options.error = &error;
            if (rt_trace(b->accels[RT_BVH], &options, rays.rays, rays.count, rays.hits) != RT_OK) return complain("%s", error.message);
            if (memcmp(rays.hits, rays.truth, rays.count * sizeof *rays.hits) != 0)
                h->fine = complain("%s finds hits that differ in %s", overbeck_methods[RANGED + k].name, s->title);
        }
    }
    return true;
}

/* One more than the depth of the deepest test. */
static int overbeck_deepest(overbeck_histogram stats)
{
    int depth, rays, k, most = 0;
    for (depth = 0; depth < RT_DEPTHS; depth++)
        for (rays = 0; rays < DEPTH_RAYS; rays++)
            for (k = 0; k < DEPTH_METHODS; k++)
                if (stats[rays][k].boxes_at[depth] + stats[rays][k].prims_at[depth]) most = depth + 1;
    return most;
}

static void overbeck_print_depths(const overbeck_scene *s, overbeck_histogram stats)
{
    const int deepest = overbeck_deepest(stats);
    int depth, rays, k;

    overbeck_print_scene(s);
    printf("  depth  primary: thousand boxes    thousand triangles     2 reflections: thousand boxes  thousand triangles\n       ");
    for (k = 0; k < 2 * DEPTH_RAYS; k++) printf("      Ranged   Partition");
    printf("\n");
    for (depth = 0; depth <= deepest; depth++) {
        if (depth < deepest) printf("  %5d", depth);
        else printf("    all");
        for (rays = 0; rays < DEPTH_RAYS; rays++) {
            for (k = 0; k < DEPTH_METHODS; k++)
                printf(" %11.1f", 1e-3 * (double)(depth < deepest ? stats[rays][k].boxes_at[depth] : stats[rays][k].boxes));
            for (k = 0; k < DEPTH_METHODS; k++)
                printf(" %11.1f", 1e-3 * (double)(depth < deepest ? stats[rays][k].prims_at[depth] : stats[rays][k].prims));
        }
        printf("\n");
    }
}

static void overbeck_list_json(const char *key, const uint64_t *sums, int count)
{
    int i;
    printf(",\"%s\":[", key);
    for (i = 0; i < count; i++) printf("%s%llu", i ? "," : "", (unsigned long long)sums[i]);
    printf("]");
}

static void overbeck_depths_json(const overbeck_scene *s, overbeck_histogram stats)
{
    const int deepest = overbeck_deepest(stats);
    int rays, k;

    for (rays = 0; rays < DEPTH_RAYS; rays++)
        for (k = 0; k < DEPTH_METHODS; k++) {
            begin_json("overbeck.6", s->bench.content.name);
            printf(",\"primitives\":%zu,\"structure\":\"bvh\",\"algorithm\":\"%s\",\"packet\":16,\"cull\":\"both\",\"rays\":\"%s\"",
                   overbeck_primitives(s), rt_algorithm_get((size_t)overbeck_methods[RANGED + k].algorithm)->name,
                   overbeck_depth_rays[rays]);
            overbeck_list_json("boxes_at", stats[rays][k].boxes_at, deepest);
            overbeck_list_json("prims_at", stats[rays][k].prims_at, deepest);
            printf("}\n");
        }
}

/* Bars of both methods by depth, in the panel whose left lower corner is x0, y0. */
static void overbeck_plot_depths(FILE *file, const rt_stats stats[DEPTH_METHODS], bool prims, int deepest, double x0, double y0,
                                 double width, double height)
{
    const double step = width / (deepest ? deepest : 1);
    double most = 1e-9;
    char label[16];
    int depth, k;

    for (depth = 0; depth < deepest; depth++)
        for (k = 0; k < DEPTH_METHODS; k++)
            most = fmax(most, 1e-6 * (double)(prims ? stats[k].prims_at[depth] : stats[k].boxes_at[depth]));
    most = svg_scale(file, x0, y0, width, height, most);
    for (depth = 0; depth < deepest; depth++) {
        if (depth % 5 == 0) {
            snprintf(label, sizeof label, "%d", depth);
            svg_text(file, x0 + step * (depth + 0.5), y0 + 15, "middle", "#000", label);
        }
        for (k = 0; k < DEPTH_METHODS; k++) {
            const double tall = 1e-6 * (double)(prims ? stats[k].prims_at[depth] : stats[k].boxes_at[depth]) / most * height;
            fprintf(file, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"%s\"/>\n",
                    x0 + step * (depth + 0.08 + 0.42 * k), y0 - tall, 0.42 * step, tall, overbeck_colors[RANGED + k]);
        }
    }
}

/* Four panels a scene. */
static bool overbeck_plot_histograms(const overbeck *h, const bool *chosen, overbeck_histogram *stats, size_t count)
{
    enum { WIDE = 420, HIGH = 150, LEFT = 60, TOP = 30, BELOW = 34, HEAD = 70 };
    const double down = TOP + HIGH + BELOW;
    FILE *file = plot_open(&h->a, "overbeck.6", 2 * (LEFT + WIDE + 16), (double)count * (HEAD + 2 * down), "Tests by depth in the tree");
    size_t i, at = 0;
    char text[160];
    int rays, prims;

    if (!file) return false;
    for (i = 0; i < h->count; i++) {
        const double top = (double)at * (HEAD + 2 * down);
        if (!chosen[i]) continue;
        snprintf(text, sizeof text, "%s (%zu): millions of tests of 16x16 packets by depth in the tree, %dx%d", h->scenes[i].title,
                 overbeck_primitives(&h->scenes[i]), h->a.width, h->a.height);
        svg_text(file, 10, top + 20, "start", "#000", text);
        svg_text(file, 10, top + 40, "start", overbeck_colors[RANGED], "Ranged");
        svg_text(file, 70, top + 40, "start", overbeck_colors[PARTITION], "Partition");
        for (rays = 0; rays < DEPTH_RAYS; rays++)
            for (prims = 0; prims < 2; prims++) {
                const double x0 = rays * (LEFT + WIDE + 16) + LEFT, y0 = top + HEAD + prims * down + TOP + HIGH;
                snprintf(text, sizeof text, "%s: ray-%s tests", overbeck_depth_rays[rays], prims ? "triangle" : "box");
                svg_text(file, x0 + WIDE / 2.0, y0 - HIGH - 12, "middle", "#000", text);
                overbeck_plot_depths(file, stats[at][rays], prims, overbeck_deepest(stats[at]), x0, y0, WIDE, HIGH);
            }
        at++;
    }
    return plot_close(&h->a, "overbeck.6", file);
}

static bool overbeck_depths(overbeck *h)
{
    overbeck_histogram *stats;
    bool *chosen, ok;
    size_t i, count = 0;

    if (!overbeck_load(h)) return false;
    stats = calloc(h->count, sizeof *stats);
    chosen = calloc(h->count, sizeof *chosen);
    ok = (stats && chosen) || complain("out of memory");
    if (ok && !h->a.json)
        printf("\noverbeck.6: tests by depth in the tree, 16x16 packets, frustum culling both; %dx%d\n", h->a.width,
               h->a.height);
    for (i = 0; i < h->count && ok; i++) {
        if (!h->a.scene_count && i != OVERBECK_FAIRY) continue;
        chosen[i] = true;
        ok = overbeck_count_depths(h, &h->scenes[i], stats[count]);
        if (ok && h->a.json) overbeck_depths_json(&h->scenes[i], stats[count]);
        else if (ok) overbeck_print_depths(&h->scenes[i], stats[count]);
        count++;
    }
    if (ok && h->a.svg) ok = overbeck_plot_histograms(h, chosen, stats, count);
    free(stats), free(chosen);
    return ok;
}

/* ---- >>overbeck-culling --------------------------------------------------------------------------------------------- */

static void overbeck_print_culling(const overbeck_scene *s)
{
    int set, side, cull;

    overbeck_print_scene(s);
    for (set = 0; set < SET_DIFFUSE; set++)
        for (side = 0; side < SIDES; side++) {
            const double *seconds = s->seconds[set], none = seconds[large_way(PARTITION, side, RT_CULL_NONE)];
            const overbeck_tally *both = &s->tallies[set][side][RT_CULL_BOTH];
            printf("  %-9s %2d", side ? "" : overbeck_sets[set].name, overbeck_sides[side]);
            for (cull = 0; cull < RT_CULL_COUNT; cull++) horn_print_cell(9, 2, overbeck_rate(s, set, large_way(PARTITION, side, cull)));
            for (cull = 1; cull < RT_CULL_COUNT; cull++)
                horn_print_cell(9, 2, overbeck_gain(seconds[large_way(PARTITION, side, cull)], none));
            horn_print_cell(10, 3, both->rays ? (double)both->frusta / (double)both->rays : 0);
            for (cull = 1; cull < RT_CULL_COUNT; cull++) {
                const overbeck_tally *t = &s->tallies[set][side][cull];
                if (t->frusta) printf(" %7.1f%%", 100 * (double)t->culled / (double)t->frusta);
                else printf(" %8s", "-");
            }
            printf("\n");
        }
}

static bool overbeck_culling(overbeck *h)
{
    static const int methods[] = { PARTITION, PARTITION, PARTITION, PARTITION };
    static const int culls[] = { RT_CULL_NONE, RT_CULL_CORNERS, RT_CULL_PLANES, RT_CULL_BOTH };
    size_t i;
    int set, side;

    if (!overbeck_load(h)) return false;
    if (!h->a.json) {
        overbeck_print_title(h, &h->a, "overbeck.7", "Partition with frustum culling; tested, thrown out: boxes and triangles against the "
                             "frustum");
        printf("%13s %-36s %-27s %-9s %s\n%12s", "", "Mrays/s", "x none", "tested", "thrown out", "");
        printf("     none  corners   planes     both  corners   planes     both a ray, both corners  planes    both\n");
    }
    for (i = 0; i < h->count; i++) {
        if (!overbeck_measure(h, &h->scenes[i])) return false;
        if (!h->a.json) overbeck_print_culling(&h->scenes[i]);
        fflush(stdout);
    }
    if (!h->a.json) {
        printf("both x none, geometric mean of the scenes (the paper: up to 2 for primary and shadow, 1.2 to 1.3 for others)\n%12s", "");
        for (set = 0; set < SET_DIFFUSE; set++) printf(" %10s", overbeck_sets[set].name);
        printf("\n");
        for (side = 0; side < SIDES; side++) {
            printf("%12d", overbeck_sides[side]);
            for (set = 0; set < SET_DIFFUSE; set++)
                horn_print_cell(12, 2, overbeck_mean_gain(h, set, large_way(PARTITION, side, RT_CULL_BOTH),
                                                          large_way(PARTITION, side, RT_CULL_NONE)));
            printf("\n");
        }
        overbeck_print_spread(h, true);
    }
    return !h->a.svg || overbeck_plot_ways(h, "overbeck.7", "Milliseconds of tracing the rays of a picture by packet width, Partition: "
                                           "frustum culling", methods, culls, cull_names, RT_CULL_COUNT);
}

/* ---- >>overbeck-auto ------------------------------------------------------------------------------------------------ */

static bool overbeck_auto(overbeck *h)
{
    double log_sum = 0, least = HUGE_VAL;
    size_t i, n = 0;
    int set;

    if (!overbeck_load(h)) return false;
    if (!h->a.json) {
        overbeck_print_title(h, &h->a, "overbeck.auto", "auto beside every fixed choice: each method, side, culling none and both; SIMD; "
                             "single; Mrays/s");
        printf("%-20s %-10s %9s %10s %10s %8s  %-20s %10s %10s\n", "", "", "rays", "auto", "the best", "auto/it", "", "SIMD 8", "single");
    }
    for (i = 0; i < h->count; i++) {
        overbeck_scene *s = &h->scenes[i];
        if (!overbeck_measure(h, s)) return false;
        for (set = 0; set < SETS && !h->a.json; set++) {
            overbeck_name name;
            const int best = overbeck_best(OVERBECK_AUTO, s->seconds[set]);
            double ratio;

            if (best < 0) continue;
            ratio = overbeck_rate(s, set, WAY_AUTO) / overbeck_rate(s, set, best);
            log_sum += log(ratio), n++;
            least = fmin(least, ratio);
            printf("%-20s %-10s %9zu %10.2f %10.2f %8.3f  %-20s %10.2f %10.2f\n", set ? "" : s->title, overbeck_sets[set].name,
                   s->counts[set], overbeck_rate(s, set, WAY_AUTO), overbeck_rate(s, set, best), ratio, way_name(best, &name),
                   overbeck_rate(s, set, WAY_SIMD_8), overbeck_rate(s, set, WAY_STACK));
        }
        fflush(stdout);
    }
    if (!h->a.json && n)
        printf("  auto / the best: geometric mean %.3f, least %.3f. The best of so many noisy numbers is a little too high\n",
               exp(log_sum / (double)n), least);
    if (!h->a.json) overbeck_print_spread(h, true);
    return true;
}

/* ---- >>overbeck-shots ----------------------------------------------------------------------------------------------- */

/* The columns of Table 2. */
enum { SHOT_SIMD_2, SHOT_SIMD_8, SHOT_RANGED, SHOT_PARTITION, SHOT_RANGED_NONE, SHOT_PARTITION_NONE, SHOT_AUTO, SHOT_WAYS };

static int shot_way(int column)
{
    switch (column) {
    case SHOT_SIMD_2: return WAY_SIMD_2;
    case SHOT_SIMD_8: return WAY_SIMD_8;
    case SHOT_AUTO: return WAY_AUTO;
    default: return large_way(column == SHOT_RANGED || column == SHOT_RANGED_NONE ? RANGED : PARTITION, SIDE_16,
                              column == SHOT_RANGED || column == SHOT_PARTITION ? RT_CULL_BOTH : RT_CULL_NONE);
    }
}

/* How the scene is shown: with the one light of a shot, or none; else as it comes. */
static rt_scene overbeck_shot_view(const overbeck_scene *s, rt_light *light)
{
    rt_scene view = scene_view(&s->bench.content, s->bench.accels[RT_BVH]);

    if (!s->shot) return view;
    *light = view.lights[0];
    light->color = vec(0.7f, 0.7f, 0.7f);
    view.lights = light;
    view.light_count = s->shot->lit;
    view.ambient = s->shot->lit ? vec(0.25f, 0.25f, 0.25f) : vec(0.8f, 0.8f, 0.8f);
    return view;
}

static void overbeck_print_shot(const overbeck_scene *s, const double fps[SHOT_WAYS], const uint64_t rays[4])
{
    const bool ranged = fps[SHOT_RANGED] > fps[SHOT_PARTITION];
    const double large = ranged ? fps[SHOT_RANGED] : fps[SHOT_PARTITION];
    const double unculled = ranged ? fps[SHOT_RANGED_NONE] : fps[SHOT_PARTITION_NONE];
    int i;

    printf("%-20s %7zu", s->title, s->bench.content.geometry.triangle_count + s->bench.content.geometry.sphere_count);
    for (i = 0; i < 4; i++) horn_print_cell(7, 2, 1e-6 * (double)rays[i]);
    for (i = 0; i < SHOT_WAYS; i++) horn_print_cell(i == SHOT_PARTITION || i == SHOT_PARTITION_NONE ? 11 : 8, 2, fps[i]);
    horn_print_cell(8, 2, fps[SHOT_SIMD_2] > 0 ? large / fps[SHOT_SIMD_2] : 0);
    horn_print_cell(7, 2, fps[SHOT_SIMD_8] > 0 ? large / fps[SHOT_SIMD_8] : 0);
    horn_print_cell(9, 2, unculled > 0 ? large / unculled : 0);
    printf("  %s\n", ranged ? "Ranged" : "Partition");
}

static bool overbeck_frames(overbeck *h)
{
    bool wanted[WAYS] = { false };
    size_t i;
    int k;

    if (!overbeck_load_shots(h)) return false;
    for (k = 0; k < SHOT_WAYS; k++) wanted[shot_way(k)] = true;
    if (!h->a.json) {
        overbeck_print_title(h, &h->frame, "overbeck.2", "frames a second, SIMD rays beside packets of 16x16, frustum culling both and "
                             "none");
        printf("%27s  Mrays of a frame            SIMD            16x16, both        16x16, none                the better of both\n", "");
        printf("%27s %6s %6s %6s %6s %7s %7s %7s %10s %7s %10s %7s %7s %6s %8s\n", "", "eye", "shadow", "mirror", "glass",
               "2x2", "8", "ranged", "partition", "ranged", "partition", "auto", "x 2x2", "x 8", "x none");
    }
    for (i = 0; i < h->shot_count; i++) {
        const overbeck_scene *s = &h->shots[i];
        double seconds[WAYS], fps[SHOT_WAYS];
        uint64_t rays[4];
        rt_light light;
        const rt_scene view = overbeck_shot_view(s, &light);

        overbeck_time_frames(h, s, &view, &h->frame, s->shot ? s->shot->depth : 0, wanted, seconds, rays);
        for (k = 0; k < SHOT_WAYS; k++) {
            const double took = seconds[shot_way(k)];
            fps[k] = took > 0 ? 1 / took : 0;
            if (h->a.json && took > 0)
                overbeck_frame_json(s, "overbeck.2", &h->frame, s->shot ? s->shot->stands_for : "", shot_way(k), pool_threads(h->threads),
                                    took);
        }
        if (!h->a.json) overbeck_print_shot(s, fps, rays);
        fflush(stdout);
    }
    if (h->a.json) return true;
    if (h->shots[0].shot) {
        printf("  the paper, 8 cores      here                   2x2   16x16   x 2x2  x none  16x16 of secondary rays\n");
        for (i = 0; i < h->shot_count; i++) {
            const overbeck_shot *p = h->shots[i].shot;
            printf("  %-22s  %-18s %7.1f %7.1f %7.2f %7.2f  %s\n", p->stands_for, h->shots[i].title, p->simd, p->large, p->large / p->simd,
                   p->culling, p->traversal);
        }
        printf("  levels of mirrors and glass: 1, 1, 3, 4; one light with shadows in the first and the last, no lights in the others\n");
    }
    overbeck_print_spread(h, false);
    return true;
}

/* ---- >>overbeck-threads --------------------------------------------------------------------------------------------- */

static void overbeck_spin(void *context, size_t index)
{
    float *sums = context;
    uint32_t i;
    for (i = 0; i < 200000; i++) sums[index] += hashed(i);
}

/* What two threads gain where nothing but arithmetic is to do: what the machine has to give at the moment. */
static void overbeck_print_machine(pool *const pools[2], int rounds)
{
    static double seconds[2][MAX_ROUNDS];
    float sums[64] = { 0 };
    int round, t;

    for (round = 0; round < rounds; round++)
        for (t = 0; t < 2; t++) {
            const double start = now();
            pool_for(pools[t], sizeof sums / sizeof *sums, overbeck_spin, sums);
            seconds[t][round] = now() - start;
        }
    printf("  arithmetic alone: a gain of %.2f\n", median(seconds[0], rounds) / median(seconds[1], rounds));
}

static bool overbeck_threads(overbeck *h)
{
    static const int columns[] = { SHOT_AUTO, SHOT_SIMD_8, SHOT_PARTITION };
    enum { COLUMNS = sizeof columns / sizeof *columns };
    static double seconds[COLUMNS][2][MAX_ROUNDS];
    const int rounds = h->frame.rounds < OVERBECK_THREAD_ROUNDS ? OVERBECK_THREAD_ROUNDS : h->frame.rounds;
    pool *pools[2] = { pool_create(1), pool_create(2) };
    bool ok = (pools[0] && pools[1]) || complain("the threads do not start");
    overbeck_name name;
    size_t i;
    int round, k, t;

    ok = ok && overbeck_load_shots(h);
    if (ok && !h->a.json) {
        printf("\noverbeck.threads: milliseconds a frame on one thread and on two, %ld processors; %dx%d, in turns, median of %d\n%20s",
               sysconf(_SC_NPROCESSORS_ONLN), h->frame.width, h->frame.height, rounds, "");
        for (k = 0; k < COLUMNS; k++) printf("   %-24s", way_name(shot_way(columns[k]), &name));
        printf("\n%20s", "");
        for (k = 0; k < COLUMNS; k++) printf(" %9s %9s %6s", "1", "2", "gain");
        printf("\n");
    }
    for (i = 0; ok && i < h->shot_count; i++) {
        const overbeck_scene *s = &h->shots[i];
        rt_light light;
        const rt_scene view = overbeck_shot_view(s, &light);
        double medians[2];

        for (round = 0; round <= rounds; round++)
            for (k = 0; k < COLUMNS; k++)
                for (t = 0; t < 2; t++) {
                    const int way = shot_way(columns[k]);
                    double took;
                    if (!takes(view.accel, &h->a, way_algorithm(way), way_packet(way))) continue;
                    took = overbeck_draw(h, &view, &h->frame, s->shot ? s->shot->depth : 0, way, pools[t], h->pixels[0], NULL);
                    if (round > 0) seconds[k][t][round - 1] = took;
                }
        if (!h->a.json) printf("%-20s", s->title);
        for (k = 0; k < COLUMNS; k++) {
            const int way = shot_way(columns[k]);
            const bool has = takes(view.accel, &h->a, way_algorithm(way), way_packet(way));
            for (t = 0; t < 2; t++) {
                medians[t] = has ? median(seconds[k][t], rounds) : 0;
                if (has && h->a.json)
                    overbeck_frame_json(s, "overbeck.threads", &h->frame, s->shot ? s->shot->stands_for : "", way, t + 1, medians[t]);
                else if (!h->a.json) horn_print_cell(10, 1, 1e3 * medians[t]);
            }
            if (!h->a.json) horn_print_cell(7, 2, overbeck_gain(medians[1], medians[0]));
        }
        if (!h->a.json) printf("\n");
        fflush(stdout);
    }
    if (ok && !h->a.json) overbeck_print_machine(pools, rounds);
    pool_destroy(pools[0]);
    pool_destroy(pools[1]);
    return ok;
}

/* ---- >>overbeck-main ------------------------------------------------------------------------------------------------ */

/* Those of the paper's tables that are asked for. */
static bool overbeck_tables(const arguments *given, pool *threads)
{
    static bool (*const tables[OVERBECK_TABLE_COUNT])(overbeck *) = {
        [OVERBECK_RATES] = overbeck_packets, [OVERBECK_DEPTHS] = overbeck_depths, [OVERBECK_CULLING] = overbeck_culling,
        [OVERBECK_FRAMES] = overbeck_frames, [OVERBECK_AUTO] = overbeck_auto,     [OVERBECK_THREADS] = overbeck_threads
    };
    static const char *const words[OVERBECK_TABLE_COUNT] = { OVERBECK_TABLES(TABLE_WORD) };
    overbeck h;
    bool ok, any = false;
    size_t pixels;
    int i;

    for (i = 0; i < OVERBECK_TABLE_COUNT; i++) any = any || wants(given, "overbeck", words[i]);
    if (!any) return true;
    memset(&h, 0, sizeof h);
    h.a = with_defaults(given, OVERBECK_SIZE, OVERBECK_ROUNDS);
    h.frame = with_defaults(given, OVERBECK_FRAME_SIZE, OVERBECK_ROUNDS);
    h.threads = threads;
    h.fine = true;
    ok = buffers_alloc(&h.memory, (size_t)h.a.width * (size_t)h.a.height, false);
    pixels = (size_t)h.frame.width * (size_t)h.frame.height;    /* never less than a's */
    h.pixels[0] = calloc(pixels, sizeof *h.pixels[0]);
    h.pixels[1] = calloc(pixels, sizeof *h.pixels[1]);
    ok = ok && ((h.pixels[0] && h.pixels[1]) || complain("out of memory"));
    for (i = 0; i < OVERBECK_TABLE_COUNT && ok; i++) {
        if (!wants(given, "overbeck", words[i])) continue;
        h.spread = 0;
        ok = tables[i](&h);
        fflush(stdout);
    }
    overbeck_free(&h);
    return ok && h.fine;
}
