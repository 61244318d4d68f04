/* Observation generator: detections from the truth of an exposure, without rendering an image. */
#ifndef BST_OBSGEN_GENERATOR_H
#define BST_OBSGEN_GENERATOR_H

#include "boresight/camera.h"
#include "boresight/camera_motion.h"
#include "boresight/messages.h"
#include "boresight/rng.h"
#include "obsgen/calibration.h"
#include "obsgen/model/crlb_table.h"
#include "obsgen/model/matched_filter_theory.h"
#include "obsgen/model/response.h"

/* Settings of the image path that the generator reproduces. */
typedef struct bst_generator_settings {
    int capacity;
    double false_alarms_per_frame;
    double jitter_px;      /* RMS jitter per axis, sensor px, that widens the onboard PSF */
    double motion_bend_px; /* RMS bend per axis that neither telemetry nor jitter has, sensor px */
    double streak_min_px, streak_max_px; /* star streaks for which a streak filter is used */
    int mesh_px;                         /* side of a mesh of background and noise, px; 0: 64 */
    double false_splits; /* share of single sources that the pair test may split; 0: no pair test */
    int column_correction; /* see sim/optics/column_level.h */
} bst_generator_settings;

/* A generated detection and its origin. */
typedef struct bst_obsgen_generated {
    bst_detection detection;
    int32_t item; /* brightest truth item in it; -1: none */
    bool hit;     /* cosmic-ray hit */
    bool drawn;   /* fitted with the stars' path including its bend */
} bst_obsgen_generated;

typedef struct bst_generator bst_generator;

/* Creates a generator.
 *
 * Given:     camera     true camera, lent
 *            knowledge  onboard camera: its PSF and settings->jitter_px define the filters
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_generator_free */
bst_status bst_generator_create(bst_ctx *ctx, const bst_camera *camera, const bst_camera *knowledge,
                                const bst_generator_settings *settings,
                                const bst_obsgen_calibration *calibration, bst_rng_key key,
                                bst_generator **out) BST_MUST_CHECK;
/* Frees a generator; NULL is allowed. */
void bst_generator_free(bst_generator *generator);

/* Allocates the memory for long streaks in frames of up to width x height read-out pixels. Without
 * it, the first such frame does. Errors: BST_ERR_MEMORY. */
bst_status bst_generator_reserve_streaks(bst_ctx *ctx, bst_generator *generator, int width,
                                         int height) BST_MUST_CHECK;
/* Truth and settings of an exposure. */
typedef struct bst_generator_frame {
    const bst_truth *truth;
    const int32_t *ghost; /* [truth->count]: index of the camera's ghost that an item is; -1: of
                             none; NULL: all are none */
    bst_window window;
    int binning;
    double exposure_s;
    /* Gaussian with the true PSF's noise-equivalent area, without the pixel width; sensor px */
    double sigma_px;
    const bst_response *response; /* response of the filter to that PSF; NULL: both are Gaussian */
    /* Cramer-Rao bounds of images at rest with the true PSF and with the onboard one including
     * jitter, if `response` is given; NULL: of Gaussians */
    const bst_crlb_table *image_bound, *onboard_bound;
    /* star streak at the window's centre and its bend (bst_camera_motion_bend) as image processing
     * takes them from telemetry, sensor px */
    double streak_dx_px, streak_dy_px, bend_x_px, bend_y_px;
    bool followed; /* image processing draws the camera's whole path (imgproc/measure/own_path.h) */
    double bend_sigma_px; /* 1 sigma of the bend per axis by telemetry's noise, sensor px */
    /* true path of a star there at path_count equal steps of the exposure, minus its mean, sensor
     * px; fewer than 2: straight and uniform */
    const double *path_x_px, *path_y_px;
    int path_count;
} bst_generator_frame;

/* Detection threshold and noise of a matched filter's output. */
typedef struct bst_generator_filter {
    /* threshold in this filter's noise, SNR: equally improbable as the frame's threshold in normal
     * noise */
    double threshold;
    /* output variance relative to independent pixels; above 1 with offsets of rows and columns */
    double variance;
    double shot;       /* variance added by a source of SNR 1 through its shot noise */
    double efficiency; /* SNR of a star relative to the filter matched to its real image */
} bst_generator_filter;

typedef struct bst_generator_result {
    const bst_obsgen_generated *items; /* by row, then column; valid until the next call */
    int count, lost;
    double background_e, noise_e, threshold_snr;
    bst_generator_filter filter; /* for stars */
    bst_generator_filter point;  /* the frame's other filter, if stars are streaks */
    double shared_noise;         /* correlation of the noise of both */
    /* per pixel, of sources below the clip of background and noise: mean light and mean squared
     * light */
    double faint_light_e, faint_square_e2;
    double streak_px;                     /* streak length of the star filter; sensor px */
    double bend_before_px, bend_after_px; /* 1 sigma of the bend, without and with bright streaks */
    double ends_after_px; /* 1 sigma of end minus start by bright streaks, per axis; 0: by none */
    bool smeared;         /* stars moved further than is filtered for */
    /* displacement that all streaks of stars share: direction of the streaks, and variances along
     * and across it, sensor px */
    double shared_dx_px, shared_dy_px, shared_along_px2, shared_across_px2;
} bst_generator_result;

/* Sets the displacement that all streaks of stars share, and where the camera moved unevenly all
 * sources, as image processing states it (imgproc/detect/camera_motion_left.c).
 *
 * Given:     motion  by telemetry; not read where frame->followed is false */
void bst_generator_set_shared(const bst_camera_motion *motion, const bst_camera *camera,
                              const bst_generator_frame *frame, const bst_generator_result *made,
                              bst_detections *out);

/* Generates the detections of a frame. Random draws depend only on key, exposure number and source
 * identities. Errors: BST_ERR_MEMORY. */
bst_status bst_generator_run(bst_ctx *ctx, bst_generator *generator,
                             const bst_generator_frame *frame,
                             bst_generator_result *out) BST_MUST_CHECK;

/* V magnitude of the faintest star detectable in the latest frame at `snr`. */
double bst_generator_v_limit(const bst_generator *generator, double snr);

/* Expected electrons of a true source in its brightest sensor pixel: a Gaussian centred on a pixel,
 * smeared along its path. */
double bst_generator_peak_e(double sigma_px, const bst_truth_item *item);

#endif
