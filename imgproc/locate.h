/* Locates and measures the candidates of one frame. */
#ifndef BST_IMGPROC_LOCATE_H
#define BST_IMGPROC_LOCATE_H

#include "imgproc/candidates.h"
#include "imgproc/fit.h"
#include "sim/world/motion.h"

typedef struct bst_found {
    bst_source source;
    double noise_e; /* of the background there */
    double snr;     /* against the background's noise */
    double length_px, width_px, angle_rad;
    unsigned flags; /* BST_DETECTION_... */
    bool streak;    /* the shape that fits is not a point */
    bool artefact, dropped;
    float peak_snr;
    int peak_x, peak_y;
    int next; /* in the bucket of its row */
} bst_found;

typedef struct bst_locator {
    bst_psf psf;
    bst_fit fit;
    int max_side, capacity;
    bst_found *found;
    int count;
    int *bucket; /* first found in each band of rows */
    int buckets;
    double widening_sum, widening_weight;
} bst_locator;

/* What one frame gives. */
typedef struct bst_locate_frame {
    const float *signal; /* [height][width] */
    int width, height;
    const bst_background *background;
    const bst_filter *filter;
    double sigma_px;          /* of the PSF, in this frame's pixels */
    const bst_motion *motion; /* NULL: stars are points */
    const bst_camera *camera;
    double origin_x_px, origin_y_px, binning; /* full-sensor = origin + binning * frame pixel */
} bst_locate_frame;

bst_status bst_locator_create(bst_ctx *ctx, int capacity, int max_height, int max_side,
                              bst_locator *out) BST_MUST_CHECK;
void bst_locator_free(bst_locator *locator);

/* Fits the brightest `capacity` candidates, brightest first. Each is taken for a point or for a
 * streak as the greater filter output says; both are fitted where the outputs are close, and the
 * lower chi-square stays. Neighbours whose centres lie on its pixels are fitted with it. The
 * widening of the PSF (jitter) is measured on sources of SNR 20 and more and its mean is used for
 * the fainter ones. A point that turns out elongated is fitted again as a streak of its own length
 * and angle. */
void bst_locate(bst_locator *locator, const bst_locate_frame *frame,
                const bst_candidates *candidates);

#endif
