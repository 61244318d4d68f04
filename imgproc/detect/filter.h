/* Matched filters with unit noise at their output, and the threshold for a false-alarm rate. */
#ifndef BST_IMGPROC_DETECT_FILTER_H
#define BST_IMGPROC_DETECT_FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "imgproc/detect/background.h"
#include "imgproc/detect/known_psf.h"
#include "imgproc/detect/row_kernels.h"
#include "sim/core/threshold_statistics.h"

enum {
    BST_FILTER_MAX_RADIUS = 24,
    BST_FILTER_MAX_TAPS = 4 * 256,
    BST_FILTER_PHASES = 5, /* shifts of -1/2 to 1/2 px */
    BST_FILTER_PHASE_LANES = 8,
    BST_FILTER_RANK = 3, /* products of rows and columns that a known PSF's kernel is a sum of */
    BST_FILTER_LAGS = 4 * BST_FILTER_MAX_RADIUS + 1,
    BST_FILTER_PHASE_FLOATS = BST_FILTER_PHASES * BST_FILTER_PHASES *
                              (2 * BST_FILTER_MAX_RADIUS + 3) * 64, /* of rows in lanes */
    BST_FILTER_WORK = 6 * (2 * BST_FILTER_MAX_RADIUS + 3) * (2 * BST_FILTER_MAX_RADIUS + 3),
};

/* Corrects a normalised row, and its signal, before it is filtered. Called from several threads. */
typedef void (*bst_filter_row_fn)(const void *user, int y, int width, float *signal,
                                  float *normalised);

typedef struct bst_filter {
    int max_width, max_height, pad, stride; /* of the padded map */
    int width, height;                      /* of the latest frame */
    float *point;                           /* padded map: SNR for a point */
    float *best;                            /* the same of the greater SNR, if kept */
    bool kept;                              /* else it is made of `point` where it is asked for */
    bool crowded;                           /* the latest frame: its maxima ask for it often */
    /* pixels above the threshold whose neighbours have a lower SNR: those of row y from index
     * y * max_width on, ascending */
    int *maxima; /* [height] */
    int32_t *maximum_x;
    float *maximum_snr;
    bst_filter_row_fn correct_row; /* of the next bst_filter_run; NULL: none */
    const void *correct_user;
    float *lines;           /* work space of each thread */
    size_t line_floats;     /* of one */
    bst_scratch_pool *lent; /* of lines */
    float *edge_x,
        *edge_y; /* 1 / norm of the kernel's part inside the frame, over the whole norm */
    const bst_known_psf *known; /* NULL: a Gaussian, whose kernel is one even product */
    int radius;
    double norm;        /* sqrt(sum p^2) of the two-dimensional PSF of unit flux */
    double kernel_norm; /* the same on a pixel's centre */
    double square_x[2 * BST_FILTER_MAX_RADIUS + 1]; /* of the kernel with unit norm, by column */
    double square_y[2 * BST_FILTER_MAX_RADIUS + 1]; /* and by row */
    /* a Gaussian, one axis, unit norm */
    float kernel[2 * BST_FILTER_MAX_RADIUS + 4];
    double correlation[2 * BST_FILTER_MAX_RADIUS + 1]; /* of the kernel with itself, by lag */
    /* a known PSF: sum over k of across[k] down[k], unit norm */
    int rank;
    float across[BST_FILTER_RANK][2 * BST_FILTER_MAX_RADIUS + 1];
    float down[BST_FILTER_RANK * (2 * BST_FILTER_MAX_RADIUS + 1)]; /* [rank][2 radius + 1] */
    double *lags;  /* of that kernel with itself, [LAGS][LAGS] by lag in y and x */
    float *phases; /* [PHASES][PHASES][2 radius + 3][lanes]: shifted in y and x, unit norm */
    int phase_stride;
    double *work; /* planes to make them in */
    /* the streak: a sum over shifted point maps */
    bool streak;
    double dx_px, dy_px;
    int taps;
    int tap_x[BST_FILTER_MAX_TAPS], tap_y[BST_FILTER_MAX_TAPS];
    float tap_weight[BST_FILTER_MAX_TAPS];
    double streak_norm; /* as norm, for the streak */
    double overlap;     /* correlation of both outputs at one place */
    /* of the kernels with unit norm: sums of powers, and the expected density of maxima (see
     * bst_filter_threshold) */
    bst_threshold_weights point_weights, streak_weights;
    double point_density, streak_density;
    double corner; /* output for a point between four pixels at one of them, over its greatest */
    double threshold, threshold_density; /* the latest, and the false alarms per pixel of it */
    double made_sigma, made_dx, made_dy; /* what the kernels were made for */
    int made_binning;
    /* one axis, by pixel, shifted; more lanes than shifts are 0 */
    float phase[2 * BST_FILTER_MAX_RADIUS + 3][BST_FILTER_PHASE_LANES];
} bst_filter;

/* known: lent; NULL: the PSF is a Gaussian. For loops on up to `threads` threads. */
bst_status bst_filter_create(bst_ctx *ctx, const bst_known_psf *known, int max_width,
                             int max_height, double streak_max_px, int threads,
                             bst_filter *out) BST_MUST_CHECK;
/* Frees the memory of a matched filter and clears the struct, which belongs to the caller. */
void bst_filter_free(bst_filter *filter);

/* Prepares the kernels: the known PSF, mean of the field, in pixels of binning x binning; else a
 * Gaussian of sigma_px integrated over pixels; and, unless dx and dy are both 0, the same drawn
 * along (dx, dy). */
void bst_filter_set(bst_filter *filter, double sigma_px, int binning, double dx_px, double dy_px);

/* The output above which noise alone gives `false_alarms` maxima in `pixels` pixels, when each is
 * looked for between the pixels too (bst_filter_peak).
 *
 * A normalised field of normal noise has sqrt(det L) (2 pi)^(-3/2) u exp(-u^2 / 2) maxima above a
 * high u per pixel, L the covariance of its gradient (Adler, The Geometry of Random Fields, 1981,
 * ch. 5; Siegmund and Worsley, Annals of Statistics 23, 1995). Both filters add up, less what they
 * share. At least 2.5. */
double bst_filter_threshold(bst_filter *filter, double false_alarms, double pixels);

/* A frame of pixels as `read` gives them, which is (raw - offset) gain unless `gain` is NULL. */
typedef struct bst_filter_input {
    const bst_background *background;
    bst_imgproc_pixel_fn read;
    const void *user;
    const uint16_t *raw; /* [height][width] */
    const bst_row_gain *gain;
    float *signal; /* [height][width]: becomes electrons above the background */
    int width, height;
    int saturated_dn; /* signal is BST_PIXEL_SATURATED where raw is not below */
} bst_filter_input;

/* One pass over a frame: sets its signal, then makes maps, and maxima above the threshold. Memory
 * outside the frame counts as noise-free background. */
void bst_filter_run(bst_filter *filter, bst_parallel *pool, const bst_filter_input *input,
                    float threshold);

/* Sets to BST_PIXEL_BAD those of the `count` pixels of row y from column x on that lie within two
 * rows and columns of one where the greater output of the latest frame is above `snr`. Only when a
 * map of it is kept (filter->crowded). */
void bst_filter_mask(const bst_filter *filter, int y, int x, int count, float snr, float *out);

/* The greatest output within about half a pixel of (x, y) in between the pixels: for a point
 * by kernels shifted in steps of 1/4 px and a parabola through the best, on signal with the noise
 * at that place; for the streak by a quadratic through the logarithms of 3 x 3 outputs, no further
 * than these. Not below the output at (x, y). */
double bst_filter_peak(const bst_filter *filter, const float *signal, double noise_e, bool streak,
                       int x, int y);

static inline float bst_filter_point_at(const bst_filter *f, int x, int y) {
    return f->point[(long)(y + f->pad) * f->stride + x + f->pad];
}
/* The streak output at a pixel of the latest frame; only when filter->streak. */
float bst_filter_streak_at(const bst_filter *filter, int x, int y);
/* The greater output. */
static inline float bst_filter_best_at(const bst_filter *f, int x, int y) {
    float point = bst_filter_point_at(f, x, y);
    if (!f->streak) {
        return point;
    }
    if (f->kept) {
        return f->best[(long)(y + f->pad) * f->stride + x + f->pad];
    }
    float streak = bst_filter_streak_at(f, x, y);
    return streak > point ? streak : point;
}
/* The top between the pixels near a maximum (x, y) of the greater output, or of the point output,
 * by a quadratic through the logarithms of 3 x 3 outputs; (dx, dy): its place less (x, y), up to
 * 0.7 px. Quicker than bst_filter_peak, and good to about 1 %. */
double bst_filter_top(const bst_filter *filter, bool point, int x, int y, double *dx, double *dy);

#endif
