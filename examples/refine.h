/* refine.h - a picture that refines in rounds, and tells how far from the truth it is, without knowing that.
   Include ../rt.h first.                                                               SPDX-License-Identifier: MIT OR Unlicense

   error     The picture is the mean of two halves whose random numbers have nothing in common. Both miss the truth independently, so the mean
             over all pixels of (half - half)^2 tells the variance of their mean: in expectation it is four times the squared error.
   uniform   All pixels get as many samples; each half goes on with its own sequence.
   adaptive  One sample in eight is a guide's, which has two halves of its own, is uniform, and tells where noise is: variances fall as n^-1.5 at
             best, so what is spent best grows with their 0.4th power. The guide's samples are no part of the picture: so the number of a
             pixel's samples knows nothing of their values, all may weigh alike, and their sequences go on from round to round. Were a pixel's
             own samples to tell how many more it gets, the mean would be biased (Kirk and Arvo 1991). */

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
    int drawn[2];                           /* samples of the halves, uniform; of those of the guide, adaptive */
    int round;
    rt_vec3 *halves[2], *guides[2], *parts[2];      /* parts: of the round at hand */
    float *shares;                          /* of the samples, by the noise of a pixel and its neighbours */
    uint32_t *counts, *had;                 /* samples of a half's pixels after this round and before it, adaptive */
    uint32_t *more;                         /* samples that are drawn at once, of pixels that had as many */
} refinement;

/* The power of samples by which variance falls. */
static double refine_power(const refinement *r) { return r->how.sampler == RT_SAMPLER_INDEPENDENT ? 1 : 1.5; }

REFINE_API void refine_end(refinement *r)
{
    int h;

    for (h = 0; h < 2; h++) {
        free(r->halves[h]);
        free(r->guides[h]);
        free(r->parts[h]);
    }
    free(r->picture);
    free(r->shares);
    free(r->counts);
    free(r->had);
    free(r->more);
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
        if (adaptive) r->guides[h] = (rt_vec3 *)calloc(pixels, sizeof *r->guides[h]);
        good = good && (!adaptive || r->guides[h]);
    }
    if (adaptive) {
        r->shares = (float *)calloc(pixels, sizeof *r->shares);
        r->counts = (uint32_t *)calloc(pixels, sizeof *r->counts);
        r->had = (uint32_t *)calloc(pixels, sizeof *r->had);
        r->more = (uint32_t *)calloc(pixels, sizeof *r->more);
        good = good && r->shares && r->counts && r->had && r->more;
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
   pixel's, the square of one number, tells little; and a bit of the whole picture's, for what has not been met. */
static void refine_weigh(refinement *r)
{
    const int width = r->how.width, height = r->how.height;
    double all = 1e-30;
    int x, y, i, k;

    for (i = 0; i < width * height; i++) all += refine_square(r->guides[0][i], r->guides[1][i]) / (64.0 * width * height);
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            double sum = 0;
            int count = 0;

            for (k = y > 3 ? y - 3 : 0; k <= y + 3 && k < height; k++)
                for (i = x > 3 ? x - 3 : 0; i <= x + 3 && i < width; i++) {
                    const size_t at = (size_t)k * (size_t)width + (size_t)i;

                    sum += refine_square(r->guides[0][at], r->guides[1][at]);
                    count++;
                }
            r->shares[(size_t)y * (size_t)width + (size_t)x] = (float)pow(sum / count + all, 1 / (1 + refine_power(r)));
        }
}

/* Gives each pixel scale times its share, but never below least, or what it has; how many that is on average. Sobol' points are best by powers
   of two. */
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
        if (r->counts[i] < r->had[i]) r->counts[i] = r->had[i];
        sum += (double)r->counts[i];
    }
    return sum / (double)pixels;
}

/* Shares out samples a pixel of a half. Each gets a quarter of that: there may be noise that has not been met yet, or that both halves of the guide
   happened to meet alike. */
static double refine_share_out(refinement *r, double samples)
{
    const double least = fmax(floor(samples / 4), 1);
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
    return drawn > 1.1 * samples ? refine_count(r, low, least) : drawn;        /* where all pixels are alike */
}

/* Of a sequence: 0 and 1 are the halves', 2 and 3 the guide's. */
static rt_status refine_draw_part(refinement *r, int sequence, int first, int samples, const uint32_t *counts)
{
    rt_render_options how = r->how;

    how.first_sample = first;
    how.samples = samples;
    how.seed += 0x9e3779b9u * (uint32_t)sequence;
    how.counts = counts;
    return r->draw(r->context, &how, r->parts[sequence & 1]);
}

static rt_status refine_uniform(refinement *r, int sequence, const int wanted[2], rt_vec3 *const means[2])
{
    const size_t pixels = (size_t)r->how.width * (size_t)r->how.height;
    rt_status status = RT_OK;
    int h;

    for (h = 0; h < 2 && status == RT_OK; h++)
        if (wanted[h] > r->drawn[h]) status = refine_draw_part(r, sequence + h, r->drawn[h], wanted[h] - r->drawn[h], NULL);
    for (h = 0; h < 2 && status == RT_OK; h++)
        if (wanted[h] > r->drawn[h]) {
            refine_add(means[h], r->parts[h], pixels, 1 - (double)r->drawn[h] / wanted[h]);
            r->drawn[h] = wanted[h];
        }
    return status;
}

/* What counts ask for, of both halves: pixels that have as many go on together. Other sequences than Sobol's begin anew. */
static rt_status refine_draw_counts(refinement *r)
{
    const size_t pixels = (size_t)r->how.width * (size_t)r->how.height;
    const bool goes_on = r->how.sampler == RT_SAMPLER_SOBOL;
    uint32_t had = 0, next;
    rt_status status = RT_OK;
    size_t i;
    int h;

    for (; had != UINT32_MAX && status == RT_OK; had = next) {
        bool any = false;

        for (i = 0, next = UINT32_MAX; i < pixels; i++) {
            const bool now = !goes_on || r->had[i] == had;

            r->more[i] = now ? r->counts[i] - r->had[i] : 0;
            any = any || r->more[i];
            if (!now && r->had[i] > had && r->had[i] < next) next = r->had[i];
        }
        for (h = 0; h < 2 && any && status == RT_OK; h++)
            status = refine_draw_part(r, goes_on ? h : 4 * r->round + h, (int)had, r->how.spp - (int)had, r->more);
    }
    for (i = 0; i < pixels && status == RT_OK; i++) {
        const double part = r->counts[i] ? 1 - (double)r->had[i] / (double)r->counts[i] : 0;

        for (h = 0; h < 2 && part > 0; h++) refine_add(&r->halves[h][i], &r->parts[h][i], 1, part);
        r->had[i] = r->counts[i];
    }
    return status;
}

/* Draws until pixels have that many samples, more than now, on average, the guide's among them; adaptive 4 at least. 1: one half alone, which
   makes no estimate. What fails leaves the picture as it was. */
REFINE_API rt_status refine_until(refinement *r, int samples)
{
    double drawn = samples;
    rt_status status;
    int wanted[2];

    if (r->adaptive) {
        wanted[0] = wanted[1] = (samples + 15) / 16;
        status = refine_uniform(r, 2, wanted, r->guides);
        if (status == RT_OK) {
            drawn = 2 * (refine_share_out(r, samples / 2.0 - r->drawn[0]) + r->drawn[0]);
            status = refine_draw_counts(r);
        }
    } else {
        wanted[0] = (samples + 1) / 2;
        wanted[1] = samples / 2;
        status = refine_uniform(r, 0, wanted, r->halves);
    }
    if (status != RT_OK) return status;
    r->round++;
    r->samples = drawn;
    refine_sum_up(r, r->adaptive ? 0.5 : (double)r->drawn[1] / samples);
    return RT_OK;
}

/* How many samples a pixel it will take, by all that is known, until the error is that small; what the next round draws should end there, or
   before. */
REFINE_API double refine_needs(const refinement *r, double error)
{
    return r->samples * pow(r->error / error, 2 / refine_power(r));
}

#endif /* REFINE_H */
