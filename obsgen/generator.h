/* Detections from the truth of an exposure, without an image. */
#ifndef BST_OBSGEN_GENERATOR_H
#define BST_OBSGEN_GENERATOR_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "boresight/rng.h"
#include "obsgen/calibration.h"
#include "obsgen/model/crlb_table.h"
#include "obsgen/model/matched_filter_theory.h"
#include "obsgen/model/response.h"

/* Settings of the image path that the generator follows. */
typedef struct bst_generator_settings {
    int capacity;
    double false_alarms_per_frame;
    double jitter_px;                    /* RMS per axis, sensor px: widens the onboard PSF */
    double streak_min_px, streak_max_px; /* star streaks that are filtered for */
    int mesh_px;                         /* side of the meshes of background and noise; 0: 64 */
    int column_correction;               /* see sim/optics/column_level.h */
} bst_generator_settings;

/* A detection with where it comes from. */
typedef struct bst_obsgen_generated {
    bst_detection detection;
    int32_t item; /* of the truth, the brightest that is in it; -1: none */
    bool hit;     /* a radiation hit */
    bool drawn;   /* fitted with the stars' path, its bend too */
} bst_obsgen_generated;

typedef struct bst_generator bst_generator;

/* camera: the true one, borrowed; knowledge: the onboard one, whose PSF and settings->jitter_px the
 * filters are made for. */
bst_status bst_generator_create(bst_ctx *ctx, const bst_camera *camera, const bst_camera *knowledge,
                                const bst_generator_settings *settings,
                                const bst_obsgen_calibration *calibration, bst_rng_key key,
                                bst_generator **out) BST_MUST_CHECK;
/* Frees a generator; NULL is allowed. */
void bst_generator_free(bst_generator *generator);

/* Takes the memory that frames with long streaks need up to this many pixels that are read; without
 * it, the first such frame does. BST_ERR_MEMORY. */
bst_status bst_generator_reserve_streaks(bst_ctx *ctx, bst_generator *generator, int width,
                                         int height) BST_MUST_CHECK;
/* What was exposed. */
typedef struct bst_generator_frame {
    const bst_truth *truth;
    bst_window window;
    int binning;
    double exposure_s;
    double sigma_px; /* of the Gaussian of the true PSF's noise-equivalent area, without the pixel's
                        width; sensor px */
    const bst_response *response; /* of the filter to that PSF; NULL: both are Gaussians */
    /* of images at rest with that PSF, and with the onboard one with its jitter, where `response`
     * is given; NULL: of Gaussians with the width of its gradient */
    const bst_crlb_table *image_bound, *onboard_bound;
    /* path of the stars in the middle of the window and its bend (bst_camera_motion_bend) as image
     * processing takes them from telemetry, sensor px */
    double streak_dx_px, streak_dy_px, bend_x_px, bend_y_px;
    /* the true path of a star there at path_count equal steps of the exposure, less its mean,
     * sensor px; fewer than 2: straight and uniform */
    const double *path_x_px, *path_y_px;
    int path_count;
} bst_generator_frame;

/* What image processing asks of a filter's output, and what noise does to it. */
typedef struct bst_generator_filter {
    double threshold; /* that the output of such noise exceeds as rarely as a normal one the frame's
                         threshold, SNR */
    double variance;  /* of the output, whose pixels share the offsets of rows and columns; 1: of
                         independent pixels */
    double shot;      /* variance that a source of SNR 1 adds by its own photons */
    double efficiency; /* SNR for a star over that of the filter for its real image */
} bst_generator_filter;

typedef struct bst_generator_result {
    const bst_obsgen_generated *items; /* by row, then column; held until the next call */
    int count, lost;
    double background_e, noise_e, threshold_snr;
    bst_generator_filter filter; /* of the stars */
    /* per pixel, of sources below the clip of background and noise: mean light, mean of its square
     */
    double faint_light_e, faint_square_e2;
    double streak_px; /* of the stars, as far as they are filtered for; sensor px */
    bool smeared;     /* stars moved further than is filtered for */
} bst_generator_result;

/* Makes the detections of a frame: draws depend on the key, the exposure's number and the sources'
 * identities alone. BST_ERR_MEMORY. */
bst_status bst_generator_run(bst_ctx *ctx, bst_generator *generator,
                             const bst_generator_frame *frame,
                             bst_generator_result *out) BST_MUST_CHECK;

/* V of the faintest star that the latest frame could show at `snr`. */
double bst_generator_v_limit(const bst_generator *generator, double snr);

/* Expected electrons of a source of the truth in its brightest sensor pixel: a Gaussian on the
 * middle of a pixel, drawn along its path. */
double bst_generator_peak_e(double sigma_px, const bst_truth_item *item);

#endif
