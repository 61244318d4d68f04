/* State of the module imgproc, shared by its source files. */
#ifndef BST_IMGPROC_MODULE_INTERNAL_H
#define BST_IMGPROC_MODULE_INTERNAL_H

#include "imgproc/calibrate/pixel_learning.h"
#include "imgproc/calibrate/reference_pixels.h"
#include "imgproc/detect/plugin_detector.h"
#include "imgproc/detect/region_of_interest.h"
#include "imgproc/extended/extended_step.h"
#include "imgproc/identify/lost_in_space.h"
#include "imgproc/identify/predicted_stars.h"
#include "imgproc/imgproc.h"
#include "imgproc/wing_labels.h"
#include "sim/onboard/discriminate.h"
#include "sim/optics/photometry.h"

/* Stars by which the camera's scale is found coarsely. */
enum { BST_IMGPROC_COARSE_STARS = 1024 };

/* Attitude that image processing finds by itself, while telemetry may be wrong by any angle. */
typedef struct bst_imgproc_lost {
    bool enabled;
    bool lost;      /* the attitude is unknown */
    bool known;     /* `error` holds */
    bst_quat error; /* q_true = q_telemetry * error, of the latest frame with stars */
    int64_t frames_without_stars;
    double built_v_limit; /* of `patterns`; NAN: none yet */
    bst_star_patterns *patterns;
    bst_lost_in_space *solver;
    double julian_year;
    const bst_stars *stars;
} bst_imgproc_lost;

/* Detector and results of one concurrent step. */
typedef struct bst_imgproc_lane {
    bst_imgproc *ip;      /* NULL: not created yet */
    bst_detections *made; /* detections computed ahead; NULL in lane 0 until needed */
    bool ready;           /* `made` holds the detections of the frame below */
    int map;              /* slot of the learned bad-pixel map used in the current step */
    int64_t exposure_id;
    bst_reference_pixels references;
} bst_imgproc_lane;

typedef struct bst_imgproc_state {
    const bst_imgproc_config *config;
    bst_camera camera;
    int64_t tick_rate_hz;
    bst_imgproc_maps maps;
    bst_imgproc_lane lanes[BST_STEP_LANES];
    bst_starid *starid;
    bst_discriminator *discriminator;
    bst_predicted_stars sky;
    double epoch_julian_year;       /* of the run's epoch */
    bst_region_of_interest windows; /* of the current frame; none: the whole frame */
    bst_stack *stack;               /* NULL: no stacking */
    bst_optics_photometer photometer;
    bst_pixel_learner *pixels; /* NULL: bad pixels are not learned */
    double window_v_limit;     /* of stars with windows, by the latest frame; NAN: none yet */
    int64_t steps;             /* number of steps so far */
    int first_slot;            /* slot of the map that lane 0 uses: 0, or by a restore */
    bst_psf_wings *wings;      /* NULL: the PSF has no wings */
    bst_extended_step extended;
    bst_plugin_detector *plugin; /* NULL: built-in detector */
    bst_imgproc_lost lost;
    bst_camera_calibrator calibrator; /* its camera predicts places; `camera` detects */
    int64_t calibration_misses;       /* frames in a row without an identified star */
    bst_imgproc_expected_star coarse[BST_IMGPROC_COARSE_STARS]; /* work space */
} bst_imgproc_state;

/* A frame and the onboard knowledge of its exposure. */
typedef struct bst_imgproc_exposure {
    const bst_frame_message *message;
    const bst_camera_motion *motion; /* NULL: unknown */
    bool navigated;                  /* `light` is known */
    bst_light light;
    const bst_predictions *predictions; /* NULL: none */
    bool locked;                        /* the tracker has estimated the pointing error */
} bst_imgproc_exposure;

/* Identifies the catalogue stars among the detections.
 *
 * Given:     *q_cam_from_gcrf  predicted attitude
 * Returned:  *q_cam_from_gcrf  attitude from the identified stars, if any
 * Errors:    those of the star catalogue */
bst_status bst_imgproc_identify_stars(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_lane *l,
                                      const bst_imgproc_exposure *e, bst_detections *out,
                                      bst_quat *q_cam_from_gcrf) BST_MUST_CHECK;

/* Removes the identities of the frame's stars, for another identification. */
void bst_imgproc_forget_stars(bst_detections *detections);

/* Prepares the calibration of the camera's geometry: at first it is the onboard camera. */
void bst_imgproc_calibration_open(bst_imgproc_state *m);

/* Saves or restores it, where it is enabled. */
bst_status bst_imgproc_calibration_archive(bst_imgproc_state *m,
                                           bst_archive *archive) BST_MUST_CHECK;

/* Learns the camera's geometry from the identified stars, where the configuration asks for it.
 *
 * Until the first frame with enough stars, and after three frames without any, scale and rotation
 * are searched for, and the stars identified again.
 *
 * Given:     *q_cam_from_gcrf  attitude from the identified stars, if any
 * Returned:  *q_cam_from_gcrf  the same after another identification
 * Errors:    those of the star catalogue */
bst_status bst_imgproc_calibrate_camera(bst_imgproc_state *m, struct bst_step *step,
                                        const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                        bst_detections *out,
                                        bst_quat *q_cam_from_gcrf) BST_MUST_CHECK;

/* Finds the long star streaks of a frame (long_streaks), where the camera moved further than is
 * filtered for.
 *
 * Given:     telemetry  attitudes during the exposure; may be NULL
 * Returned:  *followed  the detections are those of bst_imgproc_follow_streaks
 * Errors:    BST_ERR_MEMORY */
bst_status bst_imgproc_find_long_streaks(bst_ctx *ctx, const bst_imgproc_state *m,
                                         const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                         const bst_pointing_telemetry *telemetry,
                                         bst_detections *out, bool *followed) BST_MUST_CHECK;
/* Labels the streaks of bst_imgproc_find_long_streaks that no other label fits better: stars. */
void bst_imgproc_label_long_streaks(const bst_imgproc_lane *l, bst_detections *out);

/* Prepares identification without an attitude, where the configuration asks for it.
 *
 * Given:     stars        must outlive the module
 *            julian_year  epoch for proper motion */
void bst_imgproc_lost_open(bst_imgproc_state *m, const bst_stars *stars, double julian_year);
/* Frees its memory. */
void bst_imgproc_lost_close(bst_imgproc_lost *lost);
/* Saves or restores its state, where it is enabled. */
void bst_imgproc_lost_archive(bst_imgproc_lost *lost, bst_archive *archive);

/* Attitude of a frame by telemetry and the error found before. Returns false if it is not enabled,
 * or no attitude has been found yet; then *q is unchanged. */
bool bst_imgproc_lost_attitude(const bst_imgproc_lost *lost, bst_quat q_telemetry_from_gcrf,
                               bst_quat *q_cam_from_gcrf);

/* Identifies the stars of a frame as bst_imgproc_identify_stars, without an attitude where it is
 * lost. Publishes an event when the attitude is found and when it is lost.
 *
 * Given:     *q_cam_from_gcrf  predicted attitude
 * Returned:  *q_cam_from_gcrf  attitude from the identified stars, if any
 * Errors:    those of the star catalogue; BST_ERR_MEMORY */
bst_status bst_imgproc_lost_identify(bst_imgproc_state *m, struct bst_step *step,
                                     const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                     bst_detections *out, bst_quat *q_cam_from_gcrf) BST_MUST_CHECK;

#endif
