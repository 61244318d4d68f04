/* Matched filters with unit noise at their output, and the threshold for a false-alarm rate. */
#ifndef BST_IMGPROC_FILTER_H
#define BST_IMGPROC_FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "imgproc/background.h"

enum { BST_FILTER_MAX_RADIUS = 24, BST_FILTER_MAX_TAPS = 4 * 256 };

typedef struct bst_filter {
    int max_width, max_height, pad, stride; /* of the padded map */
    int width, height;                      /* of the latest frame */
    float *point;                           /* padded map: SNR for a point */
    float *best;                            /* [height][width]: the greater SNR */
    uint8_t *mask;                          /* [height][width]: 255 above the threshold */
    float *lines; /* rows of the separable pass: normalised, level, 1 / noise, ring */
    float *edge_x,
        *edge_y; /* 1 / norm of the kernel's part inside the frame, over the whole norm */
    int first_row, last_row; /* rows with anything above the threshold; last < first: none */
    /* the PSF, one axis, unit norm */
    int radius;
    float kernel[2 * BST_FILTER_MAX_RADIUS + 4];
    double norm; /* sqrt(sum p^2) of the two-dimensional PSF of unit flux */
    /* the streak: a sum over shifted point maps */
    bool streak;
    double dx_px, dy_px;
    int taps;
    int tap_x[BST_FILTER_MAX_TAPS], tap_y[BST_FILTER_MAX_TAPS];
    float tap_weight[BST_FILTER_MAX_TAPS];
    double streak_norm; /* as norm, for the streak */
    double overlap;     /* correlation of both outputs at one place */
} bst_filter;

bst_status bst_filter_create(bst_ctx *ctx, int max_width, int max_height, double streak_max_px,
                             bst_filter *out) BST_MUST_CHECK;
void bst_filter_free(bst_filter *filter);

/* Prepares the kernels: a Gaussian of sigma_px integrated over pixels, and, unless dx and dy are
 * both 0, the same drawn along (dx, dy). */
void bst_filter_set(bst_filter *filter, double sigma_px, double dx_px, double dy_px);

/* The SNR above which noise alone gives `false_alarms` detections in `pixels` pixels.
 *
 * The number of separate excursions of a smooth Gaussian field above u is N Q(u) theta_x theta_y,
 * theta the chance that the next pixel along an axis is below u given that this one is above, from
 * the bivariate normal with the kernel's lag-1 correlation: it has the right limits, one excursion
 * per pixel for white noise and the expected Euler characteristic for a field that is smooth on the
 * grid (Adler, The Geometry of Random Fields, 1981, ch. 5). A tilted kernel takes the determinant
 * of its roughness matrix. Both filters add up, less what they share. At least 2.5. */
double bst_filter_threshold(const bst_filter *filter, double false_alarms, double pixels);

/* One pass over a frame [height][width]: electrons become signal (background off, in place), then
 * the maps and the mask are made. Memory outside the frame counts as noise-free background. */
void bst_filter_run(bst_filter *filter, const bst_background *background, const uint16_t *raw,
                    float *electrons, int width, int height, int saturated_dn, float threshold);

static inline float bst_filter_point_at(const bst_filter *f, int x, int y) {
    return f->point[(long)(y + f->pad) * f->stride + x + f->pad];
}
/* The streak output at a pixel of the latest frame; only when filter->streak. */
float bst_filter_streak_at(const bst_filter *filter, int x, int y);

#endif
