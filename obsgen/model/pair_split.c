/* Pairs that image processing finds by a likelihood ratio, closer than it separates maxima
 * (imgproc/measure/pair_split.c). */
#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "sim/core/chi_square.h"
#include "sim/core/symmetric.h"

/* Gain that is asked of pairs farther apart than NEAR_FWHM, and of streaks: those of
 * imgproc/measure/pair_split.c. */
static const double NEAR_FWHM = 1.0, ELSEWHERE = 5.5, ON_PATH = 1.4;
/* Pairs farther apart are separate maxima, or too faint to be a pair. */
static const double WIDEST_FWHM = 4.0;
/* Two paths of one shape: image processing fits both with one. */
static const double SAME_PATH_PX = 0.5;
/* Half side of the stamp that images fit, as in blends.c. */
static const double STAMP_SIGMAS = 3.6;
/* Step of the grid on which images are summed, and its margin, PSF sigmas: sums of Gaussians over
 * steps of half a sigma are exact to 1e-8. */
static const double STEP_SIGMAS = 0.5, MARGIN_SIGMAS = 4.0;
/* Random stream of the test. */
static const uint64_t SPLIT_NOISE = (uint64_t)1 << 50 | (uint64_t)1 << 55;

enum { MOST_ALONG = 400, MOST_ACROSS = 64, BOTH = 6, ONE = 3, ROUNDS = 8 };

/* A source's image on the axes along and across its path: a product. */
typedef struct profile {
    double flux, along[MOST_ALONG], across[MOST_ACROSS];
    double along_slope[MOST_ALONG], across_slope[MOST_ACROSS]; /* by its place */
} profile;

/* Grid and noise of a pair. */
typedef struct pair_grid {
    int along, across;
    double first_along, first_across, step, sigma, length, noise2, excess;
} pair_grid;

static double bell(double x, double sigma) {
    return exp(-0.5 * x * x / (sigma * sigma)) / (sigma * sqrt(2.0 * BST_PI));
}

/* Sets the profiles of a source at (s, t). */
static void set_profile(const pair_grid *p, double flux, double s, double t, profile *out) {
    double half = 0.5 * p->length, root = sqrt(2.0) * p->sigma;
    out->flux = flux;
    for (int i = 0; i < p->along; i++) {
        double x = p->first_along + i * p->step - s;
        if (half > 0.05 * p->sigma) {
            out->along[i] = 0.5 * (erf((x + half) / root) - erf((x - half) / root)) / p->length;
            out->along_slope[i] = (bell(x - half, p->sigma) - bell(x + half, p->sigma)) / p->length;
        } else {
            out->along[i] = bell(x, p->sigma);
            out->along_slope[i] = x / (p->sigma * p->sigma) * out->along[i];
        }
    }
    for (int i = 0; i < p->across; i++) {
        double y = p->first_across + i * p->step - t;
        out->across[i] = bell(y, p->sigma);
        out->across_slope[i] = y / (p->sigma * p->sigma) * out->across[i];
    }
}

/* Derivatives of an image by flux and place at a node. */
static void slopes_at(const profile *m, int i, int k, double out[ONE]) {
    out[0] = m->along[i] * m->across[k];
    out[1] = m->flux * m->along_slope[i] * m->across[k];
    out[2] = m->flux * m->along[i] * m->across_slope[k];
}

/* Weight of a node in sums over the image of a pair. */
static double weight_at(const pair_grid *p, const profile both[2], int i, int k, double *light) {
    *light = both[0].flux * both[0].along[i] * both[0].across[k] +
             both[1].flux * both[1].along[i] * both[1].across[k];
    return p->step * p->step / (p->noise2 + p->excess * *light);
}

/* Chi-square of the best single source, without noise, from a start. */
static double chi_of_one(const pair_grid *p, const profile both[2], const double start[ONE]) {
    double at[ONE] = {start[0], start[1], start[2]}, chi = 0.0;
    profile one;
    for (int round = 0; round < ROUNDS; round++) {
        double a[ONE][ONE] = {{0.0}}, b[ONE] = {0.0}, inverse[ONE][ONE], j[ONE], light;
        set_profile(p, at[0], at[1], at[2], &one);
        chi = 0.0;
        for (int i = 0; i < p->along; i++) {
            for (int k = 0; k < p->across; k++) {
                double w = weight_at(p, both, i, k, &light);
                slopes_at(&one, i, k, j);
                double rest = light - one.flux * j[0];
                chi += w * rest * rest;
                for (int n = 0; n < ONE; n++) {
                    for (int m = 0; m <= n; m++) {
                        a[n][m] += w * j[n] * j[m];
                    }
                    b[n] += w * j[n] * rest;
                }
            }
        }
        if (!bst_symmetric_invert(ONE, a[0], inverse[0])) {
            break;
        }
        for (int n = 0; n < ONE; n++) {
            for (int m = 0; m < ONE; m++) {
                at[n] += inverse[n][m] * b[m];
            }
        }
    }
    return chi;
}

/* Errors in the fit of both sources. */
typedef struct joint_errors {
    double widen[2];    /* variance of each place over that in a fit of its own, both axes */
    double separation2; /* variance of the separation, px^2 */
} joint_errors;

/* Sets the errors for a pair (s, t) apart. False: not determined. */
static bool joint_fit(const pair_grid *p, const profile both[2], double s_px, double t_px,
                      joint_errors *out) {
    double a[BOTH][BOTH] = {{0.0}}, j[BOTH], light;
    for (int i = 0; i < p->along; i++) {
        for (int k = 0; k < p->across; k++) {
            double w = weight_at(p, both, i, k, &light);
            slopes_at(&both[0], i, k, j);
            slopes_at(&both[1], i, k, j + ONE);
            for (int n = 0; n < BOTH; n++) {
                for (int m = 0; m <= n; m++) {
                    a[n][m] += w * j[n] * j[m];
                }
            }
        }
    }
    double inverse[BOTH][BOTH], own[ONE][ONE];
    if (!bst_symmetric_invert(BOTH, a[0], inverse[0])) {
        return false;
    }
    for (int s = 0; s < 2; s++) {
        double alone[ONE][ONE];
        for (int n = 0; n < ONE; n++) {
            for (int m = 0; m < ONE; m++) {
                own[n][m] = a[ONE * s + (n > m ? n : m)][ONE * s + (n > m ? m : n)];
            }
        }
        if (!bst_symmetric_invert(ONE, own[0], alone[0])) {
            return false;
        }
        int x = ONE * s + 1, y = ONE * s + 2;
        out->widen[s] = (inverse[x][x] + inverse[y][y]) / (alone[1][1] + alone[2][2]);
    }
    double apart = hypot(s_px, t_px), c = s_px / apart, n = t_px / apart;
    const double unit[BOTH] = {0.0, -c, -n, 0.0, c, n};
    out->separation2 = 0.0;
    for (int i = 0; i < BOTH; i++) {
        for (int k = 0; k < BOTH; k++) {
            out->separation2 += unit[i] * unit[k] * inverse[i][k];
        }
    }
    return true;
}

/* True if image processing fits both sources with one shape. */
static bool are_alike(const generator_source *a, const generator_source *b) {
    return a->as_streak == b->as_streak && !a->broken && !b->broken &&
           hypot(a->path.dx - b->path.dx, a->path.dy - b->path.dy) < SAME_PATH_PX &&
           (a->as_streak || a->length < SAME_PATH_PX) &&
           a->shape_xx + a->shape_yy + b->shape_xx + b->shape_yy == 0.0;
}

/* Decides whether the test finds a source beside the brighter one with which it is merged. */
static bool is_split(const bst_generator *g, const generator_source *bright,
                     const generator_source *faint, joint_errors *errors) {
    double dx = faint->x - bright->x, dy = faint->y - bright->y, apart = hypot(dx, dy);
    double fwhm = BST_FWHM_PER_SIGMA * g->total_sigma;
    if (!(apart > 0.0) || apart > WIDEST_FWHM * fwhm || !are_alike(bright, faint)) {
        return false;
    }
    double length = bright->as_streak ? bright->length : 0.0;
    double c = length > 0.0 ? bright->path.dx / length : 1.0,
           n = length > 0.0 ? bright->path.dy / length : 0.0;
    double s = c * dx + n * dy, t = c * dy - n * dx;
    pair_grid p = {.step = STEP_SIGMAS * g->total_sigma,
                   .sigma = g->total_sigma,
                   .length = length,
                   .noise2 = g->noise_e * g->noise_e,
                   .excess = g->excess};
    double margin = MARGIN_SIGMAS * p.sigma;
    p.first_along = fmin(s, 0.0) - 0.5 * length - margin;
    p.first_across = fmin(t, 0.0) - margin;
    p.along = (int)ceil((length + fabs(s) + 2.0 * margin) / p.step) + 1;
    p.across = (int)ceil((fabs(t) + 2.0 * margin) / p.step) + 1;
    if (p.along > MOST_ALONG || p.across > MOST_ACROSS) {
        return false;
    }
    profile both[2];
    set_profile(&p, bright->flux_e, 0.0, 0.0, &both[0]);
    set_profile(&p, faint->flux_e, s, t, &both[1]);
    double all = bright->flux_e + faint->flux_e, share = faint->flux_e / all;
    double chi = fmin(chi_of_one(&p, both, (double[]){all, share * s, share * t}),
                      chi_of_one(&p, both, (double[]){bright->flux_e, 0.0, 0.0}));
    if (!joint_fit(&p, both, s, t, errors)) {
        return false;
    }
    double least = bst_chi_square3_quantile(g->settings.false_splits), distance = sqrt(chi), pd;
    if (bright->as_streak) {
        pd = bst_chi_square3_tail(least + ON_PATH, distance);
    } else { /* by the separation that the fit finds */
        double far =
            bst_matched_normal_below((apart - NEAR_FWHM * fwhm) / sqrt(errors->separation2));
        pd = (1.0 - far) * bst_chi_square3_tail(least, distance) +
             far * bst_chi_square3_tail(least + ELSEWHERE, distance);
    }
    return bst_generator_uniform(g, SPLIT_NOISE | faint->name) < pd;
}

/* True if another detection is in the pixels that are fitted to a source, or these are cut off or
 * full. */
static bool is_disturbed(const bst_generator *g, const generator_source *s) {
    double reach = STAMP_SIGMAS * g->fitted_sigma;
    double half_x = 0.5 * fabs(s->path.dx) + reach, half_y = 0.5 * fabs(s->path.dy) + reach;
    if (s->saturated || s->x < half_x || s->y < half_y || s->x > g->width - 1.0 - half_x ||
        s->y > g->height - 1.0 - half_y) {
        return true;
    }
    for (int k = 0; k < g->source_count; k++) {
        const generator_source *o = &g->sources[k];
        if (o != s && o->found && fabs(o->x - s->x) < half_x && fabs(o->y - s->y) < half_y) {
            return true;
        }
    }
    return false;
}

void bst_generator_split_pairs(bst_generator *g) {
    assert(g && g->settings.false_splits > 0.0 && g->rank_count <= g->source_count);
    for (int r = 0; r < g->rank_count; r++) {
        generator_source *s = &g->sources[g->ranks[r].index];
        int head = s->head;
        if (head < 0 || !g->sources[head].found || g->sources[head].partner >= 0 ||
            is_disturbed(g, &g->sources[head])) {
            continue;
        }
        joint_errors errors;
        if (is_split(g, &g->sources[head], s, &errors)) {
            s->found = true;
            s->head = -1;
            s->peak = g->sources[head].peak;
            s->partner = head;
            s->partner_widen = errors.widen[1];
            g->sources[head].partner = (int)(s - g->sources);
            g->sources[head].partner_widen = errors.widen[0];
        }
    }
}
