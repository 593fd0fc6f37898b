/* lidar.c - a spinning lidar on a moving platform: the point cloud of a scene, to a PLY, CSV or XYZ file.    lidar --help tells all.
   cc -O2 lidar.c -o lidar -lm -lpthread

   >>options  >>scanner  >>write  >>main                                                SPDX-License-Identifier: MIT OR Unlicense */

#define _POSIX_C_SOURCE 200809L
#define RT_IMPLEMENTATION
#include "../rt.h"
static const char program[] = "lidar";
#include "pool.h"
#include "scene.h"
#include "options.h"
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAX_PULSES 100000000                /* 3.2 GB, where all of them return */
#define SIDE 16                             /* steps, and channels, that a thread takes at once: a packet of neighbours */

/* ---- >>options ------------------------------------------------------------------------------------------------------ */

enum { SENSOR, WORLD, FRAMES };
static const char *const frame_names[FRAMES] = { "sensor", "world" };
enum { PLY, CSV, XYZ, FORMATS };
static const char *const format_names[FORMATS] = { ".ply", ".csv", ".xyz" };

struct options {
    const char *scene, *mover, *output;
    xyz from, to, forward, up, mover_from, mover_to;
    int channels, steps, sweeps, threads, seed, frame, format;
    float elevation[2], range[2], rate, noise;
    rt_structure structure;
    const rt_algorithm_info *algorithm;
    bool quiet, help;
};

static bool read_pair(const char *text, float pair[2])
{
    return read_float(text, ',', &pair[0], &text) && read_float(text, '\0', &pair[1], NULL);
}

static bool set_output(options *o, const char *text)
{
    const char *dot = strrchr(text, '.');

    o->output = text;
    o->format = dot ? find_name(dot, format_names, FORMATS) : FORMATS;
    return o->format < FORMATS;
}

static bool set_elevation(options *o, const char *text)
{
    return read_pair(text, o->elevation) && o->elevation[0] >= -90 && o->elevation[0] <= o->elevation[1] && o->elevation[1] <= 90;
}

static bool set_frame(options *o, const char *text) { return (o->frame = find_name(text, frame_names, FRAMES)) < FRAMES; }
static bool set_from(options *o, const char *text) { return read_xyz(text, &o->from); }
static bool set_to(options *o, const char *text) { return read_xyz(text, &o->to); }
static bool set_forward(options *o, const char *text) { return read_xyz(text, &o->forward); }
static bool set_up(options *o, const char *text) { return read_xyz(text, &o->up); }
static bool set_channels(options *o, const char *text) { return read_int(text, '\0', 1, 1024, &o->channels, NULL); }
static bool set_steps(options *o, const char *text) { return read_int(text, '\0', 1, 65536, &o->steps, NULL); }
static bool set_sweeps(options *o, const char *text) { return read_int(text, '\0', 1, 10000, &o->sweeps, NULL); }
static bool set_rate(options *o, const char *text) { return read_float(text, '\0', &o->rate, NULL) && o->rate >= 0.001f && o->rate <= 1000; }
static bool set_range(options *o, const char *text) { return read_pair(text, o->range) && o->range[0] >= 0 && o->range[0] < o->range[1]; }
static bool set_noise(options *o, const char *text) { return read_float(text, '\0', &o->noise, NULL) && o->noise >= 0; }
static bool set_seed(options *o, const char *text) { return read_int(text, '\0', 0, 2147483647, &o->seed, NULL); }
static bool set_mover(options *o, const char *text) { o->mover = text; return text[0] != '\0'; }
static bool set_mover_from(options *o, const char *text) { return read_xyz(text, &o->mover_from); }
static bool set_mover_to(options *o, const char *text) { return read_xyz(text, &o->mover_to); }
static bool set_structure(options *o, const char *text) { return read_structure(text, &o->structure); }
static bool set_algorithm(options *o, const char *text) { return read_algorithm(text, &o->algorithm); }
static bool set_threads(options *o, const char *text) { return read_int(text, '\0', 1, 1024, &o->threads, NULL); }
static bool set_quiet(options *o, const char *text) { (void)text; return o->quiet = true; }
static bool set_help(options *o, const char *text) { (void)text; return o->help = true; }

static const option option_table[] = {
    { "-o",           "FILE",    set_output,     "where to (default out/lidar.ply)",                     "a path that ends in .ply, .csv or .xyz" },
    { "--frame",      "NAME",    set_frame,      "of the points: sensor or world (default sensor)",      "one of: sensor world" },
    { "--from",       "X,Y,Z",   set_from,       "where the platform is when the run begins (default: the scene's eye)", "three numbers: X,Y,Z" },
    { "--to",         "X,Y,Z",   set_to,         "where it is when the run ends (default: it stands still)", "three numbers: X,Y,Z" },
    { "--up",         "X,Y,Z",   set_up,         "the axis that it spins about (default: the scene's up)", "three numbers: X,Y,Z" },
    { "--forward",    "X,Y,Z",   set_forward,    "azimuth 0, once made level (default: ahead, or standing still where the scene's eye looks)",
      "three numbers: X,Y,Z" },
    { "--channels",   "N",       set_channels,   "beams above each other (default 32)",                  "1 to 1024" },
    { "--elevation",  "LO,HI",   set_elevation,  "degrees of the lowest and the highest one (default -25,15)", "two angles, -90 <= LO <= HI <= 90" },
    { "--steps",      "N",       set_steps,      "pulses of a beam in a turn (default 1024)",            "1 to 65536" },
    { "--sweeps",     "N",       set_sweeps,     "turns in the run (default 1)",                         "1 to 10000" },
    { "--rate",       "HZ",      set_rate,       "turns a second (default 10)",                          "0.001 to 1000" },
    { "--range",      "MIN,MAX", set_range,      "only what is farther than MIN and nearer than MAX (default 0,1000)",
      "two numbers, 0 <= MIN < MAX <= 1e18" },
    { "--noise",      "SIGMA",   set_noise,      "standard deviation of measured ranges (default 0)",    "a number from 0 up" },
    { "--seed",       "N",       set_seed,       "other noise (default 0)",                              "0 to 2147483647" },
    { "--mover",      "SCENE",   set_mover,      "another scene, which moves through the first one",     "a scene" },
    { "--mover-from", "X,Y,Z",   set_mover_from, "how far it is shifted when the run begins (default 0,0,0)", "three numbers: X,Y,Z" },
    { "--mover-to",   "X,Y,Z",   set_mover_to,   "and when the run ends (default: it stands still)",     "three numbers: X,Y,Z" },
    { "--structure",  "NAME",    set_structure,  "what to build (default: what the algorithm takes, or bvh)", "one of:" RT_STRUCTURE_LIST(LISTED) },
    { "--algorithm",  "NAME",    set_algorithm,  "how to trace (default auto)",                          "an algorithm's name: see render --help" },
    { "--threads",    "N",       set_threads,    "worker threads (default: all processors)",             "1 to 1024" },
    { "--quiet",      NULL,      set_quiet,      "print nothing but errors",                             NULL },
    { "--help",       NULL,      set_help,       "print this text",                                      NULL },
};
enum { OPTIONS = sizeof option_table / sizeof option_table[0] };

static bool parse_options(options *o, int argc, char **argv)
{
    if (!read_options(o, option_table, OPTIONS, argc, argv, &o->scene)) return false;
    if (o->help) return true;
    if (!o->scene) return fail("no scene given; see --help");
    if (!o->mover && (o->mover_from.given || o->mover_to.given)) return fail("--mover-from and --mover-to shift what --mover names: give one");
    if ((long long)o->channels * o->steps > MAX_PULSES / o->sweeps)
        return fail("%d channels x %d steps x %d sweeps are too many pulses: at most %d", o->channels, o->steps, o->sweeps, MAX_PULSES);
    if (o->structure == RT_STRUCTURE_COUNT) o->structure = o->algorithm->structure == RT_STRUCTURE_COUNT ? RT_BVH : o->algorithm->structure;
    return true;
}

static void print_help(void)
{
    printf("usage: lidar [options] SCENE\n\nScans SCENE with a spinning lidar and writes the points that return. SCENE is an OBJ or NFF file or "
           "a procedural scene:\n\n%s\noptions:\n", scene_procedural_list());
    print_options(option_table, OPTIONS);
    puts("\nLengths are in the scene's units, metres if it is in metres. The sensor's frame is right-handed: x forward, y left, z up. It turns\n"
         "counterclockwise seen from above, from x to y, and starts at azimuth 0; elevation is above the level plane. Beams are spaced evenly\n"
         "and numbered from the lowest, ring 0; one alone lies in the middle. All fire at once at each of the N steps, 360 / N degrees apart,\n"
         "of a turn; step k of all steps of all sweeps at k / (N HZ) seconds after the beginning. The platform, and what moves, go straight on\n"
         "at constant speed and do not turn; the end is when the step after the last one would fire.\n\n"
         "In the sensor's frame a point is where its pulse found it, seen from where the platform was at that pulse: as scanners report it, so\n"
         "a cloud of a moving platform is distorted. In the world's frame it lies where it is in the scene: the same cloud, undistorted.\n\n"
         "range      from the sensor; what is nearer than MIN neither returns a pulse nor stops it (the platform's own body)\n"
         "intensity  c cos(a) / range^2: c the mean of the surface's Kd, a the angle of incidence; noise and textures do not change it\n"
         "time       in seconds; ring: the beam; prim: the triangle, or the number of triangles + the sphere, from 0, of the scene or,\n"
         "           where mover is 1, of what moves\n\n"
         "A pulse is a line without width; it ends at the first surface, whatever that is made of, and has at most one return. Directions are off\n"
         "by 1e-7 radians, and without noise ranges by some 1e-6 of themselves and of the coordinates, more only where a beam grazes a surface.\n"
         "Noise is Gaussian, cut off at 5.8 SIGMA, and moves a point along its beam; what it moves out of MIN to MAX is lost. The file is the\n"
         "same for any number of threads, any structure and algorithm.\n\n"
         "PLY is binary, in the byte order of this machine; CSV has the same columns; XYZ has x y z alone.");
}

/* ---- >>scanner ------------------------------------------------------------------------------------------------------ */

typedef struct {                            /* a vertex of the PLY file; range 0: there was no return */
    float x, y, z, range, intensity, time;
    uint32_t prim;
    uint16_t ring, mover;
} echo;
typedef char echo_is_packed[sizeof(echo) == 32 ? 1 : -1];

typedef struct {
    const options *o;
    const scene *parts[2];                  /* the scene, and what moves in it */
    rt_accel *accels[2];                    /* of both together, and of what moves */
    rt_trace_options trace;
    double axes[3][3];                      /* of the sensor's frame, in the world */
    double path[2][2][3];                   /* of the platform, and of what moves: where from, and how far in all */
    size_t columns;                         /* steps of all sweeps */
    echo *echoes;                           /* one a pulse: the channels of the first step, of the second ... */
} scanner;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double a[3], const double b[3], double out[3])
{
    int i;

    for (i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void set(double out[3], rt_vec3 v) { out[0] = (double)v.x, out[1] = (double)v.y, out[2] = (double)v.z; }

static void subtract(double a[3], const double b[3]) { a[0] -= b[0], a[1] -= b[1], a[2] -= b[2]; }

static bool normalize(double a[3])
{
    const double length = sqrt(dot(a, a));
    int i;

    for (i = 0; i < 3; i++) a[i] /= length;
    return length > 0;
}

/* Sets the paths and the frame. */
static bool mount(scanner *s)
{
    const options *o = s->o;
    const rt_camera *eye = &s->parts[0]->camera;
    const rt_vec3 from = o->from.given ? o->from.value : eye->eye;
    double *x = s->axes[0], *y = s->axes[1], *z = s->axes[2], (*path)[3] = s->path[0], (*moved)[3] = s->path[1];

    set(path[0], from);
    set(path[1], o->to.given ? o->to.value : from);
    subtract(path[1], path[0]);
    set(moved[0], o->mover_from.value);
    set(moved[1], o->mover_to.given ? o->mover_to.value : o->mover_from.value);
    subtract(moved[1], moved[0]);
    set(z, o->up.given ? o->up.value : eye->up);
    set(x, o->forward.given ? o->forward.value : eye->look);
    if (!o->forward.given) {
        set(y, eye->eye);
        subtract(x, y);
        if (dot(path[1], path[1]) > 0) memcpy(x, path[1], sizeof path[1]);
    }
    if (!normalize(z)) return fail("--up: 0,0,0 is no direction");
    if (!normalize(x)) return fail("--forward: 0,0,0 is no direction");
    cross(z, x, y);
    if (dot(y, y) < 1e-12) return fail("--forward: choose another direction than up and down, which cannot be made level");
    normalize(y);
    cross(y, z, x);
    return true;
}

static void circle(double degrees, double out[2])
{
    out[0] = cos(degrees * (3.14159265358979324 / 180));
    out[1] = sin(degrees * (3.14159265358979324 / 180));
}

/* The cosine and sine of a step's azimuth, and of a channel's elevation. */
static void turn(const options *o, size_t column, double out[2]) { circle(360 * (double)(column % (size_t)o->steps) / o->steps, out); }

static void tilt(const options *o, size_t channel, double out[2])
{
    const double low = (double)o->elevation[0], part = o->channels > 1 ? (double)channel / (o->channels - 1) : 0.5;

    circle(low + ((double)o->elevation[1] - low) * part, out);
}

static rt_ray aim(const scanner *s, size_t column, const double azimuth[2], const double elevation[2])
{
    const double part = (double)column / (double)s->columns;
    const double to[3] = { elevation[0] * azimuth[0], elevation[0] * azimuth[1], elevation[1] };
    float org[3], dir[3];
    rt_ray ray;
    int i;

    for (i = 0; i < 3; i++) {
        org[i] = (float)(s->path[0][0][i] + s->path[0][1][i] * part);
        dir[i] = (float)(to[0] * s->axes[0][i] + to[1] * s->axes[1][i] + to[2] * s->axes[2][i]);
    }
    ray.org.x = org[0], ray.org.y = org[1], ray.org.z = org[2];
    ray.dir.x = dir[0], ray.dir.y = dir[1], ray.dir.z = dir[2];
    ray.tmin = s->o->range[0];
    ray.tmax = s->o->range[1];
    return ray;
}

/* The normal of a primitive, of any length; at: the point of it, in its own space. */
static void normal_at(const scene *part, uint32_t prim, const double at[3], double normal[3])
{
    const rt_geometry *g = &part->geometry;
    double corner[3][3];
    int i;

    if (prim >= g->triangle_count) {
        set(corner[0], g->spheres[prim - g->triangle_count].center);
        memcpy(normal, at, sizeof corner[0]);
        subtract(normal, corner[0]);
        return;
    }
    for (i = 0; i < 9; i++)
        corner[i / 3][i % 3] = (double)part->vertices[3 * (size_t)g->indices[3 * (size_t)prim + (size_t)i / 3] + (size_t)i % 3];
    subtract(corner[1], corner[0]);
    subtract(corner[2], corner[0]);
    cross(corner[1], corner[2], normal);
}

/* Gaussian, of deviation 1 (Box and Muller). */
static double noise(const options *o, size_t column, size_t channel)
{
    const size_t steps = (size_t)o->steps;
    rt_sampler sampler = { RT_SAMPLER_INDEPENDENT, 1, 0, 0 };
    float u[2];

    sampler.seed = (uint32_t)o->seed;
    sampler.frame = (uint32_t)(column / steps);
    rt_sample_2d(&sampler, (uint32_t)(column % steps), (uint32_t)channel, 0, 0, u);
    return sqrt(-2 * log(1 - (double)u[0])) * cos(6.28318530717958648 * (double)u[1]);
}

static void receive(const scanner *s, size_t column, size_t channel, const rt_ray *ray, const rt_hit *hit, echo *out)
{
    const options *o = s->o;
    const int mover = hit->inst != RT_NONE;
    const double moved = mover ? (double)column / (double)s->columns : 0;
    const rt_material *material = &s->parts[mover]->materials[s->parts[mover]->material_ids[hit->prim]];
    const double color = ((double)material->diffuse.x + (double)material->diffuse.y + (double)material->diffuse.z) / 3;
    double org[3], dir[3], at[3], normal[3], to[3], length, range, measured, cosine;
    int i;

    set(org, ray->org);
    set(dir, ray->dir);
    length = sqrt(dot(dir, dir));
    range = (double)hit->t * length;
    measured = range + (o->noise > 0 ? (double)o->noise * noise(o, column, channel) : 0);
    if (!(measured > (double)o->range[0] && measured < (double)o->range[1])) return;
    for (i = 0; i < 3; i++) {
        at[i] = org[i] + (double)hit->t * dir[i] - (mover ? s->path[1][0][i] + s->path[1][1][i] * moved : 0);
        to[i] = o->frame == WORLD ? org[i] + measured / length * dir[i] : measured / length * dot(s->axes[i], dir);
    }
    normal_at(s->parts[mover], hit->prim, at, normal);
    cosine = fabs(dot(normal, dir)) / (sqrt(dot(normal, normal)) * length);
    out->x = (float)to[0], out->y = (float)to[1], out->z = (float)to[2];
    out->range = (float)measured;
    out->intensity = (float)(color * cosine / (range * range));
    out->time = (float)((double)column / ((double)o->steps * (double)o->rate));
    out->prim = hit->prim;
    out->ring = (uint16_t)channel;
    out->mover = (uint16_t)mover;
}

/* Every other bit: two of them number the squares of a tile in Morton order, so that packets are of neighbours. */
static size_t spread(size_t i) { return (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8); }

static void scan_tile(void *context, size_t tile)
{
    const scanner *s = (const scanner *)context;
    const size_t channels = (size_t)s->o->channels, across = (channels + SIDE - 1) / SIDE;
    const size_t first = tile / across * SIDE, lowest = tile % across * SIDE;
    double azimuths[SIDE][2], elevations[SIDE][2];
    rt_trace_options trace = s->trace;
    rt_ray rays[SIDE * SIDE];
    rt_hit hits[SIDE * SIDE];
    float times[SIDE * SIDE];
    size_t pulses[SIDE * SIDE], count = 0, i;

    for (i = 0; i < SIDE; i++) {
        turn(s->o, first + i, azimuths[i]);
        tilt(s->o, lowest + i, elevations[i]);
    }
    for (i = 0; i < SIDE * SIDE; i++) {
        const size_t x = spread(i >> 1), y = spread(i), column = first + x, channel = lowest + y;

        if (column >= s->columns || channel >= channels) continue;
        rays[count] = aim(s, column, azimuths[x], elevations[y]);
        times[count] = (float)((double)column / (double)s->columns);
        pulses[count++] = column * channels + channel;
    }
    trace.times = times;
    (void)rt_trace(s->accels[0], &trace, rays, count, hits);
    for (i = 0; i < count; i++)
        if (hits[i].prim != RT_NONE) receive(s, pulses[i] / channels, pulses[i] % channels, &rays[i], &hits[i], &s->echoes[pulses[i]]);
}

/* ---- >>write -------------------------------------------------------------------------------------------------------- */

static bool write_echoes(const options *o, const echo *echoes, size_t count)
{
    const uint16_t one = 1;
    output out;
    size_t i;

    if (!open_output(&out, o->output)) return false;
    if (o->format == PLY)
        fprintf(out.file, "ply\nformat binary_%s_endian 1.0\ncomment lidar of %s, %s frame\nelement vertex %zu\nproperty float x\nproperty float y\n"
                          "property float z\nproperty float range\nproperty float intensity\nproperty float time\nproperty uint prim\n"
                          "property ushort ring\nproperty ushort mover\nend_header\n",
                *(const unsigned char *)&one ? "little" : "big", o->scene, frame_names[o->frame], count);
    if (o->format == PLY) fwrite(echoes, sizeof *echoes, count, out.file);
    if (o->format == CSV) fputs("x,y,z,range,intensity,time,prim,ring,mover\n", out.file);
    for (i = 0; o->format != PLY && i < count && !ferror(out.file); i++) {
        const echo *e = &echoes[i];

        fprintf(out.file, o->format == CSV ? "%.9g,%.9g,%.9g" : "%.9g %.9g %.9g\n", (double)e->x, (double)e->y, (double)e->z);
        if (o->format == CSV)
            fprintf(out.file, ",%.9g,%.9g,%.9g,%lu,%u,%u\n", (double)e->range, (double)e->intensity, (double)e->time, (unsigned long)e->prim,
                    (unsigned)e->ring, (unsigned)e->mover);
    }
    return close_output(&out, true);
}

/* ---- >>main --------------------------------------------------------------------------------------------------------- */

static bool build(scanner *s, int which, const char *name, const rt_geometry *geometry, pool *threads)
{
    rt_build_options how = {0};
    rt_error error = {0};

    how.structure = s->o->structure;
    keep_what_it_reads(&how, s->o->algorithm->algorithm, false);
    how.parallel_for = pool_for;
    how.parallel_user = threads;
    how.error = &error;
    return rt_build(&s->accels[which], geometry, &how) == RT_OK || fail("%s: %s", name, error.message);
}

/* Builds the trees. What moves is an instance in the scene. */
static bool build_all(scanner *s, pool *threads)
{
    const double *from = s->path[1][0], *far = s->path[1][1];
    rt_geometry all = s->parts[0]->geometry;
    rt_motion motion = {0};
    rt_instance instance = { NULL, { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 }, NULL };
    int i;

    if (s->o->mover) {
        if (!build(s, 1, s->o->mover, &s->parts[1]->geometry, threads)) return false;
        for (i = 0; i < 3; i++) instance.transform[4 * i + 3] = (float)from[i];
        motion.move.x = (float)far[0], motion.move.y = (float)far[1], motion.move.z = (float)far[2];
        instance.accel = s->accels[1];
        instance.motion = dot(far, far) > 0 ? &motion : NULL;
        all.instances = &instance;
        all.instance_count = 1;
    }
    return build(s, 0, s->o->scene, &all, threads);
}

/* Moves the echoes to the front; how many there are. */
static size_t gather(echo *echoes, size_t pulses, double statistics[3])
{
    size_t count = 0, i;

    for (i = 0; i < pulses; i++) {
        const double range = (double)echoes[i].range;

        if (!(range > 0)) continue;
        statistics[0] = count ? fmin(statistics[0], range) : range;
        statistics[1] = count ? fmax(statistics[1], range) : range;
        statistics[2] += range;
        echoes[count++] = echoes[i];
    }
    return count;
}

static bool scan(scanner *s)
{
    const options *o = s->o;
    const size_t channels = (size_t)o->channels, pulses = s->columns * channels;
    const double start = seconds_now();
    double built, traced, ranges[3] = { 0, 0, 0 };
    rt_error error = {0};
    size_t count;
    pool *threads = pool_create(o->threads);
    bool ok = threads || fail("cannot start the threads: choose a smaller --threads");

    if (ok && !(s->echoes = (echo *)calloc(pulses, sizeof *s->echoes))) ok = fail("out of memory for %zu pulses", pulses);
    ok = ok && build_all(s, threads);
    s->trace.algorithm = o->algorithm->algorithm;
    s->trace.error = &error;
    if (ok && rt_trace(s->accels[0], &s->trace, NULL, 0, NULL) != RT_OK) ok = fail("%s", error.message);
    s->trace.error = NULL;                  /* threads would share it */
    built = seconds_now();
    if (ok) pool_for(threads, (s->columns + SIDE - 1) / SIDE * ((channels + SIDE - 1) / SIDE), scan_tile, s);
    traced = seconds_now();
    pool_destroy(threads);                  /* leaves one thread, as hold_signals wants */
    count = ok ? gather(s->echoes, pulses, ranges) : 0;
    ok = ok && write_echoes(o, s->echoes, count);
    if (ok && !o->quiet) {
        printf("%s: %zu pulses, %zu returns; tree %.3f s, pulses %.3f s (%.2f Mpulses/s); ", o->scene, pulses, count, built - start, traced - built,
               (double)pulses / (traced - built) * 1e-6);
        if (count) printf("range %.6g to %.6g, mean %.6g; ", ranges[0], ranges[1], ranges[2] / (double)count);
        puts(o->output);
    }
    rt_free(s->accels[0]);
    rt_free(s->accels[1]);
    free(s->echoes);
    return ok;
}

int main(int argc, char **argv)
{
    options o = { .output = "out/lidar.ply", .channels = 32, .steps = 1024, .sweeps = 1, .elevation = { -25, 15 }, .range = { 0, 1000 }, .rate = 10 };
    scene content = {0}, mover = {0};
    scanner s = {0};
    bool ok;

    o.structure = RT_STRUCTURE_COUNT;
    o.algorithm = rt_algorithm_get(0);
    if (!parse_options(&o, argc, argv)) return EXIT_FAILURE;
    if (o.help) {
        print_help();
        return EXIT_SUCCESS;
    }
    s.o = &o;
    s.parts[0] = &content;
    s.parts[1] = &mover;
    s.columns = (size_t)o.steps * (size_t)o.sweeps;
    ok = check_output(o.output, o.scene) && (!o.mover || check_output(o.output, o.mover)) && load_scene(&content, o.scene, o.quiet) &&
         (!o.mover || load_scene(&mover, o.mover, o.quiet)) && mount(&s) && scan(&s);
    scene_free(&mover);
    scene_free(&content);
    if (fflush(stdout) != 0) ok = fail("standard output: %s", strerror(errno));
    return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
