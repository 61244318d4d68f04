/* Stages that a plug-in can replace, and their functions. A stage's descriptor
 * (include/boresight/stage.h) points to one of these structs. Onboard stages get the onboard model
 * of the camera, never the truth. `config` is the filled struct of the descriptor's own table and
 * outlives the stage. Functions report errors with bst_fail; an error ends the run. Results must
 * depend on the arguments alone, so that a run can be repeated. */
#ifndef BORESIGHT_STAGES_H
#define BORESIGHT_STAGES_H

#include "boresight/camera.h"
#include "boresight/camera_motion.h"
#include "boresight/compensator.h"
#include "boresight/stage.h"

#pragma GCC visibility push(default)

#define BST_STAGE_DETECTOR "detector" /* of imgproc: bst_detector_stage */
/* BST_STAGE_COMPENSATOR, of control and of a mount's servo: bst_compensator_stage, in
 * include/boresight/compensator.h */
#define BST_STAGE_FRAME "frame_stage" /* of scenegen: bst_frame_stage */

extern const char *const bst_stage_kinds[]; /* all kinds of stages, then NULL */

/* ---- detector: finds the sources in a frame. imgproc then identifies stars, calibrates photometry
 * and assigns labels. */

typedef struct bst_detector_env {
    const bst_camera *camera;  /* onboard camera model; outlives the stage */
    double electrons_per_s_v0; /* detected electrons per second of a source of V = 0 */
    int capacity;              /* maximum number of detections per frame */
    /* onboard calibration maps on the full sensor, [height_px][width_px]; NULL: none: dark current
     * minus its mean (e-/s), relative response, bad pixels (not zero) */
    const float *dark_e_per_s, *flat;
    const uint8_t *bad;
} bst_detector_env;

typedef struct bst_detector_frame {
    int64_t exposure_id;
    const uint16_t *pixels; /* [window.height / binning][window.width / binning], DN */
    bst_window window;      /* full-sensor pixels */
    int binning, bits;
    double exposure_s;
    const bst_camera_motion *motion; /* motion of the camera by telemetry; NULL: unknown */
} bst_detector_frame;

typedef struct bst_detector_stage {
    bst_status (*create)(bst_ctx *ctx, const void *config, const bst_detector_env *env,
                         void **self);
    /* Fills background_e and noise_e (per pixel), threshold_snr, count (at most env->capacity),
     * lost, and of each item x_px and y_px in full-sensor coordinates, cov_xx, cov_xy, cov_yy,
     * flux_e, flux_sigma_e, snr, length_px, width_px, angle_rad and flags; label: UNKNOWN, or
     * ARTEFACT for a detection that is not a source. Other members are zero. Frames come in
     * order of time. */
    bst_status (*detect)(void *self, bst_ctx *ctx, const bst_detector_frame *frame,
                         bst_detections *out);
    void (*destroy)(void *self);
    /* Saves the stage's state, or restores it into a stage that was created from the same
     * configuration, between two frames (bst_module_desc.archive). NULL: a simulation with this
     * stage cannot be saved. */
    bst_status (*archive)(void *self, bst_archive *archive);
} bst_detector_stage;

/* ---- frame_stage: changes a rendered frame before any module or the recorder reads it. */

typedef struct bst_frame_stage_env {
    const bst_camera *camera; /* the true camera; outlives the stage */
    const char *instance;     /* "observer/sensor/scenegen" */
    uint64_t seed, run;       /* for bst_rng_make_key */
} bst_frame_stage_env;

typedef struct bst_frame_stage_frame {
    int64_t exposure_id;
    double start_s, end_s; /* of the exposure, since the scenario's epoch */
    bst_window window;     /* full-sensor pixels */
    int width, height;     /* of the frame, binned */
    int binning, bits;
} bst_frame_stage_frame;

typedef struct bst_frame_stage {
    bst_status (*create)(bst_ctx *ctx, const void *config, const bst_frame_stage_env *env,
                         void **self);
    /* Changes pixels[height][width], DN, in place; at most 2^bits - 1. Frames come in order
     * of time. */
    bst_status (*apply)(void *self, bst_ctx *ctx, const bst_frame_stage_frame *frame,
                        uint16_t *pixels);
    void (*destroy)(void *self);
    /* As bst_detector_stage.archive. */
    bst_status (*archive)(void *self, bst_archive *archive);
} bst_frame_stage;

#pragma GCC visibility pop

#endif
