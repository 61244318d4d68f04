/* Matched filters with unit output noise, and their detection threshold for a given false-alarm
 * rate. */
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
    BST_FILTER_PHASES = 5, /* sub-pixel shifts from -1/2 to 1/2 px */
    BST_FILTER_PHASE_LANES = 8,
    BST_FILTER_RANK = 3, /* separable terms of a known PSF's kernel */
    BST_FILTER_LAGS = 4 * BST_FILTER_MAX_RADIUS + 1,
    BST_FILTER_PHASE_FLOATS = BST_FILTER_PHASES * BST_FILTER_PHASES *
                              (2 * BST_FILTER_MAX_RADIUS + 3) * 64, /* rows padded to SIMD lanes */
    BST_FILTER_WORK = 6 * (2 * BST_FILTER_MAX_RADIUS + 3) * (2 * BST_FILTER_MAX_RADIUS + 3),
};

/* Corrects a normalised row and its signal before it is filtered. It is called by several threads.
 */
typedef void (*bst_filter_row_fn)(const void *user, int y, int width, float *signal,
                                  float *normalised);

typedef struct bst_filter {
    int max_width, max_height, pad, stride; /* pad, stride: of the padded maps, px */
    int width, height;                      /* of the latest frame */
    float *point;                           /* padded map: SNR of a point source */
    float *best;  /* padded map: larger of point and streak SNR; valid if `kept` */
    bool kept;    /* false: the streak SNR is computed from `point` on demand */
    bool crowded; /* the latest frame has dense maxima: a map of the larger SNR is kept */
    /* local maxima above the threshold; those of row y start at index y * max_width, ascending in x
     */
    int *maxima; /* [height] */
    int32_t *maximum_x;
    float *maximum_snr;
    bst_filter_row_fn correct_row; /* applied in the next bst_filter_run; NULL: none */
    const void *correct_user;
    float *lines;               /* work space of all threads */
    size_t line_floats;         /* floats per thread */
    bst_scratch_pool *lent;     /* pool of work spaces */
    float *edge_x, *edge_y;     /* edge correction: 1 / norm of the kernel's part inside the frame,
                                   relative to the whole */
    const bst_known_psf *known; /* NULL: Gaussian PSF, whose kernel is one separable term */
    int radius;
    double norm;        /* sqrt(sum p^2) of the two-dimensional PSF of unit flux */
    double kernel_norm; /* the same for a source at a pixel's centre */
    double square_x[2 * BST_FILTER_MAX_RADIUS + 1]; /* squared unit-norm kernel summed by column */
    double square_y[2 * BST_FILTER_MAX_RADIUS + 1]; /* and by row */
    /* Gaussian kernel along one axis, unit norm */
    float kernel[2 * BST_FILTER_MAX_RADIUS + 4];
    /* autocorrelation of the one-axis kernel, by lag */
    double correlation[2 * BST_FILTER_MAX_RADIUS + 1];
    /* known PSF: kernel = sum over k of across[k] down[k], unit norm */
    int rank;
    float across[BST_FILTER_RANK][2 * BST_FILTER_MAX_RADIUS + 1];
    float down[BST_FILTER_RANK * (2 * BST_FILTER_MAX_RADIUS + 1)]; /* [rank][2 radius + 1] */
    double *lags; /* autocorrelation of the known kernel, [LAGS][LAGS], by lag in y and x */
    /* [PHASES][PHASES][2 radius + 3][lanes]: kernels shifted in y and x, unit norm */
    float *phases;
    int phase_stride;
    double *work; /* work space of the known kernels */
    /* streak filter: weighted sum of shifted point maps */
    bool streak;
    double dx_px, dy_px;
    int taps;
    int tap_x[BST_FILTER_MAX_TAPS], tap_y[BST_FILTER_MAX_TAPS];
    float tap_weight[BST_FILTER_MAX_TAPS];
    double streak_norm; /* sqrt(sum p^2) of the streaked PSF of unit flux */
    double overlap;     /* correlation of point and streak output at a pixel */
    /* unit-norm kernels: sums of powers, and expected density of maxima (see bst_filter_threshold)
     */
    bst_threshold_weights point_weights, streak_weights;
    double point_density, streak_density;
    /* output at a pixel for a point source between four pixels, relative to its maximum */
    double corner;
    /* latest detection threshold, and its false alarms per pixel */
    double threshold, threshold_density;
    double made_sigma, made_dx, made_dy; /* parameters of the current kernels */
    int made_binning;
    /* [pixel][shift]: shifted one-axis kernels; unused lanes are 0 */
    float phase[2 * BST_FILTER_MAX_RADIUS + 3][BST_FILTER_PHASE_LANES];
} bst_filter;

/* Creates a matched filter for frames of up to max_width x max_height pixels.
 *
 * Given:     known          PSF, lent; NULL: Gaussian
 *            streak_max_px  longest streak, px
 *            threads        threads of its loops
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_filter_free */
bst_status bst_filter_create(bst_ctx *ctx, const bst_known_psf *known, int max_width,
                             int max_height, double streak_max_px, int threads,
                             bst_filter *out) BST_MUST_CHECK;
/* Frees the memory of a matched filter and clears the struct, which belongs to the caller. */
void bst_filter_free(bst_filter *filter);

/* Sets the kernels of the matched filter. The point kernel is the known PSF averaged over the field
 * in pixels of binning x binning, or else a pixel-integrated Gaussian of sigma_px. If (dx, dy) is
 * not (0, 0), a streak kernel along (dx, dy), px, is added. */
void bst_filter_set(bst_filter *filter, double sigma_px, int binning, double dx_px, double dy_px);

/* Detection threshold, sigma, above which noise alone gives `false_alarms` maxima in `pixels`
 * pixels, each interpolated between pixels (bst_filter_peak). At least 2.5.
 *
 * Notes:     The density of maxima of normalised normal noise above a high u is sqrt(det L) (2
 *            pi)^(-3/2) u exp(-u^2 / 2) per pixel, L the covariance of the gradient. The densities
 *            of point and streak filter add, less their overlap.
 * Reference: Adler, The Geometry of Random Fields, 1981, ch. 5; Siegmund and Worsley, Annals of
 * Statistics 23, 1995 */
double bst_filter_threshold(bst_filter *filter, double false_alarms, double pixels);

/* Input frame of the matched filter. If `gain` is not NULL, `read` equals (raw - offset) x gain. */
typedef struct bst_filter_input {
    const bst_background *background;
    bst_imgproc_pixel_fn read;
    const void *user;
    const uint16_t *raw; /* [height][width] */
    const bst_row_gain *gain;
    /* [height][width]: output, electrons above the background; NULL: not wanted */
    float *signal;
    int width, height;
    /* raw value from which a pixel is saturated: its signal becomes BST_PIXEL_SATURATED */
    int saturated_dn;
    /* a crowded frame is filtered again: `signal` is then undefined if the filter ends `crowded` */
    bool provisional;
} bst_filter_input;

/* Filters a frame: subtracts the background, computes the SNR maps and finds the maxima above the
 * threshold. Pixels outside the frame count as noise-free background. */
void bst_filter_run(bst_filter *filter, bst_parallel *pool, const bst_filter_input *input,
                    float threshold);

/* Masks stars in a row: sets out[i] to BST_PIXEL_BAD if a pixel within two rows and columns has a
 * filter output above `snr`. It needs a kept map (filter->crowded).
 *
 * Given:     y, x, count  run of `count` pixels of row y from column x on */
void bst_filter_mask(const bst_filter *filter, int y, int x, int count, float snr, float *out);

/* Peak of the matched-filter output within about half a pixel of (x, y), interpolated between
 * pixels.
 *
 * Point: kernels shifted by 1/4 px and a parabola through the best, with the noise at (x, y).
 * Streak: quadratic through the logarithms of 3 x 3 outputs, no further than these.
 *
 * Returned:  SNR, at least the output at (x, y) */
double bst_filter_peak(const bst_filter *filter, const float *signal, double noise_e, bool streak,
                       int x, int y);

/* SNR of a point source at pixel (x, y) of the latest frame. */
static inline float bst_filter_point_at(const bst_filter *f, int x, int y) {
    return f->point[(long)(y + f->pad) * f->stride + x + f->pad];
}
/* SNR of a streak at a pixel of the latest frame; only if filter->streak. */
float bst_filter_streak_at(const bst_filter *filter, int x, int y);
/* Larger of point and streak SNR at a pixel of the latest frame. */
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
/* Interpolated peak near a maximum (x, y) of the larger output, or of the point output: a quadratic
 * through the logarithms of 3 x 3 outputs. It is faster than bst_filter_peak and accurate to about
 * 1 %.
 *
 * Returned:  SNR of the peak
 *            *dx, *dy  offset of the peak from (x, y), up to 0.7 px */
double bst_filter_top(const bst_filter *filter, bool point, int x, int y, double *dx, double *dy);

#endif
