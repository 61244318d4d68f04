#include "sim/eval/pair_bound.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/core/chi_square.h"
#include "sim/core/symmetric.h"
#include "sim/eval/detection_theory.h"

enum {
    IMAGES = 6,     /* the pair, one source, and one moved by STEP_PX along each axis */
    ITERATIONS = 6, /* of Gauss-Newton; D^2 is stationary at the minimum */
    DIRECTIONS = 8,
    BISECTIONS = 12
};

/* Step of the central differences: their error is 1e-4 of the slope for a PSF of FWHM 1 px. */
static const double STEP_PX = 0.01;

/* Draws the pair's image in electrons, with `work` for a source. */
static void draw_pair(const bst_pair_image *image, const bst_close_pair *p, double *work,
                      double *out) {
    double faint = 1.0 / (1.0 + p->ratio);
    image->draw(image->user, p->x_px - faint * p->dx_px, p->y_px - faint * p->dy_px, out);
    image->draw(image->user, p->x_px + (1.0 - faint) * p->dx_px, p->y_px + (1.0 - faint) * p->dy_px,
                work);
    for (int i = 0; i < image->count; i++) {
        out[i] = p->flux_e * ((1.0 - faint) * out[i] + faint * work[i]);
    }
}

/* Images of a fit: the pair, one source, and that source moved along each axis. */
typedef struct images {
    double *both, *one, *left, *right, *down, *up; /* [count] */
} images;

/* Least squares fit of one source to the pair's image from a start at (x, y). Returns chi-square.
 */
static double fit_one(const bst_pair_image *image, const images *m, double x, double y, double flux,
                      const bst_eval_bound_noise *noise) {
    double chi = 0.0;
    for (int round = 0; round < ITERATIONS; round++) {
        image->draw(image->user, x, y, m->one);
        image->draw(image->user, x - STEP_PX, y, m->left);
        image->draw(image->user, x + STEP_PX, y, m->right);
        image->draw(image->user, x, y - STEP_PX, m->down);
        image->draw(image->user, x, y + STEP_PX, m->up);
        double a[3][3] = {{0.0}}, b[3] = {0.0}, inverse[3][3];
        chi = 0.0;
        for (int i = 0; i < image->count; i++) {
            double slope[3] = {m->one[i], 0.5 * flux / STEP_PX * (m->right[i] - m->left[i]),
                               0.5 * flux / STEP_PX * (m->up[i] - m->down[i])};
            double weight = 1.0 / (noise->noise_e * noise->noise_e +
                                   (noise->own_shot_noise ? fmax(m->both[i], 0.0) : 0.0));
            double residual = m->both[i] - flux * m->one[i];
            chi += weight * residual * residual;
            for (int p = 0; p < 3; p++) {
                for (int q = 0; q <= p; q++) {
                    a[p][q] += weight * slope[p] * slope[q];
                }
                b[p] += weight * slope[p] * residual;
            }
        }
        if (!bst_symmetric_invert(3, a[0], inverse[0])) {
            break;
        }
        flux += inverse[0][0] * b[0] + inverse[0][1] * b[1] + inverse[0][2] * b[2];
        x += inverse[1][0] * b[0] + inverse[1][1] * b[1] + inverse[1][2] * b[2];
        y += inverse[2][0] * b[0] + inverse[2][1] * b[1] + inverse[2][2] * b[2];
    }
    return chi;
}

bst_status bst_pair_distance(bst_ctx *ctx, const bst_pair_image *image, const bst_close_pair *pair,
                             const bst_eval_bound_noise *noise, double *distance) {
    assert(image && pair && noise && distance && pair->ratio > 0.0);
    const size_t n = (size_t)image->count;
    double *memory = malloc(IMAGES * n * sizeof *memory);
    if (!memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a pair on %d pixels", image->count);
    }
    const images m = {memory,         memory + n,     memory + 2 * n,
                      memory + 3 * n, memory + 4 * n, memory + 5 * n};
    draw_pair(image, pair, m.one, m.both);
    double faint = 1.0 / (1.0 + pair->ratio), share = pair->ratio < 1.0 ? 1.0 - faint : -faint;
    double brighter = pair->ratio < 1.0 ? faint : 1.0 - faint;
    double between = fit_one(image, &m, pair->x_px, pair->y_px, pair->flux_e, noise);
    /* separate sources: the best one is the brighter, and the place between them is a saddle */
    double at_brighter = fit_one(image, &m, pair->x_px + share * pair->dx_px,
                                 pair->y_px + share * pair->dy_px, brighter * pair->flux_e, noise);
    free(memory);
    *distance = sqrt(fmin(between, at_brighter));
    return BST_OK;
}

bst_pair_pd bst_pair_pd_at(double distance, double rate) {
    assert(rate > 0.0 && rate < 1.0);
    return (bst_pair_pd){bst_eval_normal_tail(bst_eval_normal_tail_inverse(rate) - distance),
                         bst_chi_square3_tail(bst_chi_square3_quantile(rate), distance)};
}

/* Means of both probabilities over directions and positions in the pixel. */
static bst_status mean_pd(bst_ctx *ctx, const bst_pair_image *image, bst_close_pair pair,
                          double separation_px, const bst_eval_bound_noise *noise, double rate,
                          bst_pair_pd *out) {
    *out = (bst_pair_pd){0.0, 0.0};
    double x = image->x_px, y = image->y_px;
    for (int k = 0; k < DIRECTIONS; k++) {
        double angle = 0.2 + k * BST_PI / DIRECTIONS, distance;
        pair.x_px = x + (double)k / DIRECTIONS;
        pair.y_px = y + fmod(0.55 * k, 1.0);
        pair.dx_px = separation_px * cos(angle);
        pair.dy_px = separation_px * sin(angle);
        BST_TRY(bst_pair_distance(ctx, image, &pair, noise, &distance));
        bst_pair_pd at = bst_pair_pd_at(distance, rate);
        out->known += at.known / DIRECTIONS;
        out->unknown += at.unknown / DIRECTIONS;
    }
    return BST_OK;
}

bst_status bst_pair_separations_at(bst_ctx *ctx, const bst_pair_image *image,
                                   const bst_close_pair *pair, const bst_eval_bound_noise *noise,
                                   double rate, double pd, bst_pair_separations *out) {
    assert(image && pair && noise && out && rate > 0.0 && rate < pd && pd < 1.0);
    double *const results[2] = {&out->known_px, &out->unknown_px};
    for (int which = 0; which < 2; which++) {
        double low = 0.0, high = image->largest_apart_px;
        bst_pair_pd at;
        BST_TRY(mean_pd(ctx, image, *pair, high, noise, rate, &at));
        if (!((which ? at.unknown : at.known) > pd)) {
            *results[which] = NAN;
            continue;
        }
        for (int step = 0; step < BISECTIONS; step++) {
            double middle = 0.5 * (low + high);
            BST_TRY(mean_pd(ctx, image, *pair, middle, noise, rate, &at));
            *((which ? at.unknown : at.known) > pd ? &high : &low) = middle;
        }
        *results[which] = 0.5 * (low + high);
    }
    return BST_OK;
}
