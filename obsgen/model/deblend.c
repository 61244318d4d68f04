/* Source separation of the image path: two sources are resolved if their maxima of the filter
 * output on the pixel grid have a low enough saddle. */
#include <math.h>
#include <stdlib.h>

#include "obsgen/generator_internal.h"

/* Depth of the saddle, sigma and share of the fainter source, that separates two sources: those of
 * imgproc/detect/candidates.c; positions closer than CLOSEST_FWHM are one (SAME_FWHM of
 * imgproc/measure/deblend.c). */
static const double SADDLE_SIGMA = 3.0, SADDLE_SHARE = 0.15, CLOSEST_FWHM = 0.6;
/* Interpolation starts at these shares of the threshold: the output of a source between four pixels
 * on one of them, as in interpolation_threshold of imgproc/detect/detect.c. */
static const double LOOK_CORNER = 0.93, LOOK_SHARE = 0.65;
/* Sources farther apart than this, plus their streaks, share no maximum: the filter output of one
 * is exp(-8^2 / 4) = 1e-7 of its own there. */
static const double FAR_SIGMAS = 8.0;
/* Light below this SNR at both maxima does not affect the saddle. */
static const double LEAST_LIGHT = 0.3;
/* A saddle this many sigma away from the limit is decided without a noise draw: noise would change
 * 3e-5 of them. */
static const double CERTAIN_SIGMAS = 4.0;
/* Random stream of the noise between two maxima: 32 draws per source. */
static const uint64_t SADDLE_NOISE = (uint64_t)1 << 54;

enum { MOST_LIGHTS = 16, MOST_NOISY = 14, MOST_PIXELS = 256 };

/* Light on the pixels about two sources. Distances are scaled towards the brighter one by the
 * calibration. */
typedef struct scene {
    const bst_generator *g;
    double x, y; /* of the brighter source */
    generator_source light[MOST_LIGHTS];
    int count;
    bool mixed; /* points and streaks */
} scene;

typedef struct grid_place {
    int x, y;
    double value;
} grid_place;

/* Adds a source's light to the scene. */
static void add_light(scene *s, const generator_source *o) {
    double factor = s->g->calibration.blend_distance_factor;
    if (s->count < MOST_LIGHTS) {
        generator_source *at = &s->light[s->count++];
        *at = *o;
        s->mixed = s->mixed || o->as_streak != s->light[0].as_streak;
        at->x = s->x + (o->x - s->x) / factor;
        at->y = s->y + (o->y - s->y) / factor;
    }
}

/* Collects the sources whose light affects the saddle. */
static void collect_lights(scene *s, const generator_source *bright,
                           const generator_source *faint) {
    const bst_generator *g = s->g;
    add_light(s, bright);
    add_light(s, faint);
    double top = fmin(bright->y, faint->y) - g->reach, end = fmax(bright->y, faint->y) + g->reach;
    int k = (int)(faint - g->sources);
    while (k > 0 && g->sources[k - 1].y >= top) {
        k--;
    }
    for (; k < g->source_count && g->sources[k].y <= end; k++) {
        const generator_source *o = &g->sources[k];
        if (o == bright || o == faint || o->broken || !(o->level > 0.0) ||
            fabs(o->x - faint->x) > 2.0 * g->reach) {
            continue;
        }
        double most = o->level *
                      fmax(bst_generator_overlap(g, o, faint), bst_generator_overlap(g, o, bright));
        if (most > LEAST_LIGHT) {
            add_light(s, o);
        }
    }
}

/* Output at a pixel of the filter that does not show the light best, relative to its output at the
 * light's centre: a point in the streak filter is drawn out like a streak in the point filter. */
static double output_of_other(const bst_generator *g, const generator_source *light, int x, int y) {
    double c = g->star_path.dx / g->streak, n = g->star_path.dy / g->streak;
    double dx = x - light->x, dy = y - light->y, root = sqrt(2.0) * g->cross_sigma;
    double along = dx * c + dy * n, across = dy * c - dx * n, half = 0.5 * g->streak;
    double share = bst_matched_normal_below((along + half) / root) -
                   bst_matched_normal_below((along - half) / root);
    return exp(-0.5 * across * across / (root * root)) * share /
           (2.0 * bst_matched_normal_below(half / root) - 1.0);
}

/* Noise-free output of the filters at a pixel: where points and streaks meet, the larger one of
 * both, each with the light of all. */
static double output_of(const scene *s, int x, int y) {
    generator_source pixel = {.x = x, .y = y};
    double sum[2] = {0.0, 0.0};
    for (int i = 0; i < s->count; i++) {
        const generator_source *light = &s->light[i];
        sum[light->as_streak] += light->level * bst_generator_overlap(s->g, light, &pixel);
        if (s->mixed) {
            sum[!light->as_streak] +=
                light->level * light->other * output_of_other(s->g, light, x, y);
        }
    }
    return fmax(sum[0], sum[1]);
}

/* Pixel of the output's maximum near a source. */
static grid_place find_maximum(const scene *s, const generator_source *from) {
    enum { MOST = 8 };
    grid_place at = {(int)lround(from->x), (int)lround(from->y), 0.0};
    at.value = output_of(s, at.x, at.y);
    for (int step = 0; step < MOST; step++) {
        grid_place best = at;
        for (int k = 0; k < 9; k++) {
            int x = at.x + k % 3 - 1, y = at.y + k / 3 - 1;
            double value = output_of(s, x, y);
            if (value > best.value) {
                best = (grid_place){x, y, value};
            }
        }
        if (best.x == at.x && best.y == at.y) {
            break;
        }
        at = best;
    }
    return at;
}

/* Noise correlation of the filter output between two pixels. */
static double correlation(const bst_generator *g, bool as_streak, const grid_place *a,
                          const grid_place *b) {
    double dx = b->x - a->x, dy = b->y - a->y, length = as_streak ? g->streak : 0.0;
    double c = length > 0.0 ? g->star_path.dx / length : 1.0;
    double s = length > 0.0 ? g->star_path.dy / length : 0.0;
    return bst_matched_falloff(dx * c + dy * s, dy * c - dx * s, length, g->filter_sigma);
}

/* Adds noise to the outputs between two maxima, conditional on the noise of the maxima (in the
 * sources' levels): normal draws with the conditional covariance. */
static void add_noise(const scene *s, const generator_source *faint, const grid_place ends[2],
                      grid_place *between, int count) {
    enum { ALL = MOST_NOISY + 2 };
    const bst_generator *g = s->g;
    const bst_generator_filter *filter = &g->filters[faint->as_streak];
    double factor[ALL][ALL] = {{0.0}}, normal[MOST_NOISY];
    int skip = (count + MOST_NOISY - 1) / MOST_NOISY, used = 0;
    grid_place *place[MOST_NOISY];
    const grid_place *all[ALL] = {&ends[0], &ends[1]};
    for (int i = 0; i < count && used < MOST_NOISY; i += skip, used++) {
        place[used] = &between[i];
        all[used + 2] = &between[i];
        normal[used] = bst_rng_normal(g->key, (uint64_t)g->exposure_id,
                                      SADDLE_NOISE | faint->name << 5 | (uint64_t)used);
    }
    for (int i = 0; i < used + 2; i++) { /* Cholesky factorisation */
        for (int k = 0; k <= i; k++) {
            double sum = correlation(g, faint->as_streak, all[i], all[k]);
            for (int n = 0; n < k; n++) {
                sum -= factor[i][n] * factor[k][n];
            }
            factor[i][k] = i == k ? sqrt(fmax(sum, 0.0)) : sum / fmax(factor[k][k], 1e-6);
        }
    }
    for (int i = 0; i < used; i++) {
        double z = 0.0;
        for (int n = 0; n <= i; n++) {
            z += factor[i + 2][n + 2] * normal[n];
        }
        place[i]->value += sqrt(filter->variance + filter->shot * fmax(place[i]->value, 0.0)) * z;
    }
}

double bst_generator_looks_from(const bst_generator *g) {
    /* output of a source between four pixels on one of them */
    double corner = exp(-0.125 / (g->filter_sigma * g->filter_sigma));
    return fmax(LOOK_CORNER * corner, LOOK_SHARE) * g->threshold;
}

double bst_generator_fall_of_saddle(double level) {
    return fmax(SADDLE_SIGMA, SADDLE_SHARE * level);
}

bool bst_generator_separates(const bst_generator *g, const generator_source *bright,
                             const generator_source *faint) {
    double factor = g->calibration.blend_distance_factor;
    double apart = hypot(faint->x - bright->x, faint->y - bright->y) / factor;
    if (apart < CLOSEST_FWHM * BST_FWHM_PER_SIGMA * g->fitted_sigma) {
        return false;
    }
    if (apart > FAR_SIGMAS * g->cross_sigma + fmax(bright->length, faint->length)) {
        return true;
    }
    scene s = {.g = g, .x = bright->x, .y = bright->y};
    collect_lights(&s, bright, faint);
    const grid_place ends[2] = {find_maximum(&s, &s.light[0]), find_maximum(&s, &s.light[1])};
    int dx = ends[1].x - ends[0].x, dy = ends[1].y - ends[0].y;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    double value = ends[1].value;
    double least = fmax(value - bst_generator_fall_of_saddle(value), bst_generator_looks_from(g));
    grid_place between[MOST_PIXELS];
    int count = 0;
    double lowest = INFINITY;
    for (int i = 1; i < steps && count < MOST_PIXELS; i++, count++) {
        double t = (double)i / steps;
        grid_place *p = &between[count];
        p->x = ends[0].x + (int)lround(t * dx);
        p->y = ends[0].y + (int)lround(t * dy);
        p->value = output_of(&s, p->x, p->y);
        lowest = fmin(lowest, p->value);
    }
    const bst_generator_filter *filter = &g->filters[faint->as_streak];
    double certain = CERTAIN_SIGMAS * sqrt(filter->variance + filter->shot * fmax(lowest, 0.0));
    if (count > 0 && fabs(lowest - least) < certain) {
        add_noise(&s, faint, ends, between, count);
        for (int i = 0; i < count; i++) {
            lowest = i == 0 ? between[0].value : fmin(lowest, between[i].value);
        }
    }
    return lowest < least;
}
