/* refine.h - a picture that refines in rounds, and tells how far from the truth it is, without knowing that.
   Include ../rt.h first.                                                               SPDX-License-Identifier: MIT OR Unlicense

   error     The picture is the mean of two halves whose random numbers have nothing in common. Both miss the truth independently, so the mean
             over all pixels of (half - half)^2 tells the variance of their mean: in expectation it is four times the squared error.
   uniform   All pixels get as many samples; each half goes on with its own sequence.
   adaptive  Each round has new sequences, and gives a pixel samples by the noise of the rounds before: they are n^-1.5 variances at best, so
             what is spent best grows with its 0.4th power. The picture is the sum of what rounds drew by weights that depend on the sizes of
             the rounds alone. So, whatever a pixel's samples were, and however few of them it got the next time, the round that follows has
             the right mean, and so has the sum. Were all samples to weigh alike, it would not (Kirk and Arvo 1991). */

#ifndef REFINE_H
#define REFINE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define REFINE_API static __attribute__((unused))   /* a program need not call all of them */

/* Draws a whole picture as how says. */
typedef rt_status (*refine_draw)(void *context, const rt_render_options *how, rt_vec3 *pixels);

typedef struct {
    rt_vec3 *picture;                       /* the best that is known: how.width * how.height */
    double samples;                         /* that went into it, a pixel on average */
    double error;                           /* estimates of the root of the mean squared error of its channels, and of the mean of squared */
    double relative;                        /* errors over squared values + 0.01; NAN where there is but one half */

    rt_render_options how;
    bool adaptive;
    refine_draw draw;
    void *context;
    int round;
    int drawn[2];                           /* samples of the halves, uniform */
    double weight;                          /* of all rounds so far, adaptive */
    double first;                           /* samples of a half in the first round */
    rt_vec3 *halves[2], *parts[2];          /* the second: of the round at hand */
    float *noise;                           /* a pixel's variance times samples^power, by the rounds so far */
    float *shares;                          /* of the samples, by the noise of a pixel and its neighbours */
    uint32_t *counts;
} refinement;

/* The power of samples by which variance falls. */
static double refine_power(const refinement *r) { return r->how.sampler == RT_SAMPLER_INDEPENDENT ? 1 : 1.5; }

REFINE_API void refine_end(refinement *r)
{
    int h;

    for (h = 0; h < 2; h++) {
        free(r->halves[h]);
        free(r->parts[h]);
    }
    free(r->picture);
    free(r->noise);
    free(r->shares);
    free(r->counts);
    memset(r, 0, sizeof *r);
}

/* how: of the picture; its spp is the most that a pixel will get. RT_SAMPLER_AUTO, which puts all pixels' samples at the same places, becomes
   RT_SAMPLER_SOBOL. False: out of memory. */
REFINE_API bool refine_begin(refinement *r, const rt_render_options *how, bool adaptive, refine_draw draw, void *context)
{
    const size_t pixels = (size_t)how->width * (size_t)how->height;
    bool good = true;
    int h;

    memset(r, 0, sizeof *r);
    r->how = *how;
    if (r->how.sampler == RT_SAMPLER_AUTO) r->how.sampler = RT_SAMPLER_SOBOL;
    r->adaptive = adaptive;
    r->draw = draw;
    r->context = context;
    r->error = r->relative = (double)NAN;
    r->picture = (rt_vec3 *)calloc(pixels, sizeof *r->picture);
    for (h = 0; h < 2; h++) {
        r->halves[h] = (rt_vec3 *)calloc(pixels, sizeof *r->halves[h]);
        r->parts[h] = (rt_vec3 *)calloc(pixels, sizeof *r->parts[h]);
        good = good && r->halves[h] && r->parts[h];
    }
    if (adaptive) {
        r->noise = (float *)calloc(pixels, sizeof *r->noise);
        r->shares = (float *)calloc(pixels, sizeof *r->shares);
        r->counts = (uint32_t *)calloc(pixels, sizeof *r->counts);
        good = good && r->noise && r->shares && r->counts;
    }
    if (!good || !r->picture) refine_end(r);
    return r->picture != NULL;
}

static double refine_square(rt_vec3 a, rt_vec3 b)
{
    const double x = (double)a.x - (double)b.x, y = (double)a.y - (double)b.y, z = (double)a.z - (double)b.z;

    return (x * x + y * y + z * z) / 3;
}

static float refine_mix(float a, float b, double part) { return (float)((double)a + part * ((double)b - (double)a)); }

static void refine_add(rt_vec3 *half, const rt_vec3 *part, size_t pixels, double weight)
{
    size_t i;

    for (i = 0; i < pixels; i++) {
        half[i].x = refine_mix(half[i].x, part[i].x, weight);
        half[i].y = refine_mix(half[i].y, part[i].y, weight);
        half[i].z = refine_mix(half[i].z, part[i].z, weight);
    }
}

/* The picture, of which the second half is that part, and its errors. */
static void refine_sum_up(refinement *r, double part)
{
    const size_t pixels = (size_t)r->how.width * (size_t)r->how.height;
    double square = 0, relative = 0;
    size_t i;

    for (i = 0; i < pixels; i++) {
        const rt_vec3 a = r->halves[0][i], b = r->halves[1][i];
        const double x = (double)a.x - (double)b.x, y = (double)a.y - (double)b.y, z = (double)a.z - (double)b.z;
        rt_vec3 *m = &r->picture[i];

        m->x = refine_mix(a.x, b.x, part);
        m->y = refine_mix(a.y, b.y, part);
        m->z = refine_mix(a.z, b.z, part);
        square += x * x + y * y + z * z;
        relative += x * x / ((double)m->x * (double)m->x + 0.01) + y * y / ((double)m->y * (double)m->y + 0.01) +
                    z * z / ((double)m->z * (double)m->z + 0.01);
    }
    /* halves of n a and n b samples differ by a variance s (1 / n a + 1 / n b), and their mean errs by s / n */
    r->error = part > 0 ? sqrt(square * part * (1 - part) / (3 * (double)pixels)) : (double)NAN;
    r->relative = part > 0 ? relative * part * (1 - part) / (3 * (double)pixels) : (double)NAN;
}

/* How samples are best shared out: a power of the noise, as means over squares of 7 x 7 pixels, or what of those lies in the picture, since one
   pixel's, the square of one number, tells little. */
static void refine_weigh(refinement *r)
{
    const int width = r->how.width, height = r->how.height;
    int x, y, i, k;

    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            double sum = 0;
            int count = 0;

            for (k = y > 3 ? y - 3 : 0; k <= y + 3 && k < height; k++)
                for (i = x > 3 ? x - 3 : 0; i <= x + 3 && i < width; i++) {
                    sum += (double)r->noise[(size_t)k * (size_t)width + (size_t)i];
                    count++;
                }
            r->shares[(size_t)y * (size_t)width + (size_t)x] = (float)pow(sum / count, 1 / (1 + refine_power(r)));
        }
}

/* Gives each pixel scale times its share, but never below least; how many that is on average. Sobol' points are best by powers of two. */
static double refine_count(refinement *r, double scale, double least)
{
    const size_t pixels = (size_t)r->how.width * (size_t)r->how.height;
    double sum = 0;
    size_t i;

    for (i = 0; i < pixels; i++) {
        double count = fmin(fmax(scale * (double)r->shares[i], least), r->how.spp);
        int exponent;

        if (r->how.sampler == RT_SAMPLER_SOBOL) {
            const double part = frexp(count, &exponent);
            count = fmin(ldexp(1, part < 0.70710678 ? exponent - 1 : exponent), r->how.spp);
        }
        r->counts[i] = (uint32_t)(count + 0.5);
        sum += (double)r->counts[i];
    }
    return sum / (double)pixels;
}

/* Shares out samples a pixel. Each gets a quarter of that, and no fewer than at first: there may be noise that has not been met yet, or that both
   halves happened to meet alike. */
static double refine_share_out(refinement *r, double samples)
{
    const double least = fmax(floor(samples / 4), r->first);
    double low = 0, high = samples, drawn;
    int step;

    refine_weigh(r);
    for (step = 0; step < 100 && refine_count(r, high, least) < samples; step++) low = high, high *= 2;
    do {
        const double scale = (low + high) / 2;

        drawn = refine_count(r, scale, least);
        if (drawn < samples) low = scale;
        else high = scale;
    } while (step++ < 100 && fabs(drawn / samples - 1) > 0.005 && high - low > 1e-6 * high);
    return drawn;
}

static rt_status refine_draw_half(refinement *r, int half, int first, int samples)
{
    rt_render_options how = r->how;

    how.first_sample = first;
    how.samples = samples;
    how.seed += 0x9e3779b9u * (uint32_t)(2 * r->round + half);
    how.counts = r->adaptive && r->round ? r->counts : NULL;
    return r->draw(r->context, &how, r->parts[half]);
}

/* Draws until pixels have that many samples, on average; more than now, adaptive by as many as there were at first. 1: one half alone, which
   makes no estimate. What fails leaves the picture as it was. */
REFINE_API rt_status refine_until(refinement *r, int samples)
{
    const size_t pixels = (size_t)r->how.width * (size_t)r->how.height;
    double added[2] = { 0, 0 }, weights[2];
    rt_status status = RT_OK;
    int wanted[2], h;

    wanted[0] = (samples + 1) / 2;
    wanted[1] = samples / 2;
    if (r->adaptive) {
        const double more = (samples - r->samples) / 2;
        if (!r->round) r->first = ceil(more);
        added[0] = added[1] = r->round ? refine_share_out(r, more) : ceil(more);
        wanted[0] = wanted[1] = r->round ? r->how.spp : (int)ceil(more);
    }
    for (h = 0; h < 2 && status == RT_OK; h++) {
        const int first = r->adaptive ? 0 : r->drawn[h];

        if (!r->adaptive) added[h] = wanted[h] - first;
        if (added[h] > 0) status = refine_draw_half(r, h, first, wanted[h] - first);
        weights[h] = added[h] / wanted[h];
    }
    if (status != RT_OK) return status;
    if (r->adaptive) {
        const double power = refine_power(r), weight = pow(added[0], power);
        size_t i;

        r->weight += weight;
        weights[0] = weights[1] = weight / r->weight;
        for (i = 0; i < pixels; i++) {
            const double count = r->round ? (double)r->counts[i] : added[0];
            const double noise = refine_square(r->parts[0][i], r->parts[1][i]) * pow(count, power);
            r->noise[i] = refine_mix(r->noise[i], (float)noise, 1 / (r->round + 1.0));
        }
        r->round++;
    }
    for (h = 0; h < 2; h++) {
        if (added[h] > 0) refine_add(r->halves[h], r->parts[h], pixels, weights[h]);
        r->drawn[h] = wanted[h];
    }
    r->samples = r->adaptive ? r->samples + added[0] + added[1] : samples;
    refine_sum_up(r, r->adaptive ? 0.5 : (double)r->drawn[1] / samples);
    return RT_OK;
}

/* How many samples a pixel it will take, by all that is known, until the error is that small; what the next round draws should end there, or
   before. */
REFINE_API double refine_needs(const refinement *r, double error)
{
    const double times = r->error * r->error / (error * error), power = refine_power(r);

    return r->adaptive ? r->samples + 2 * pow(r->weight * fmax(times - 1, 0), 1 / power) : r->samples * pow(times, 1 / power);
}

#endif /* REFINE_H */
