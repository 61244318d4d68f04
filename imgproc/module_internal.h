/* State of the module imgproc, shared by its source files. */
#ifndef BST_IMGPROC_MODULE_INTERNAL_H
#define BST_IMGPROC_MODULE_INTERNAL_H

#include "imgproc/calibrate/pixel_learning.h"
#include "imgproc/detect/plugin_detector.h"
#include "imgproc/detect/region_of_interest.h"
#include "imgproc/extended/extended_step.h"
#include "imgproc/identify/predicted_stars.h"
#include "imgproc/imgproc.h"
#include "imgproc/measure/discriminate.h"
#include "imgproc/wing_labels.h"
#include "sim/optics/photometry.h"

/* Detector and results of one concurrent step. */
typedef struct bst_imgproc_lane {
    bst_imgproc *ip;      /* NULL: not created yet */
    bst_detections *made; /* detections computed ahead; NULL in lane 0 until needed */
    bool ready;           /* `made` holds the detections of the frame below */
    int map;              /* slot of the learned bad-pixel map used in the current step */
    int64_t exposure_id;
} bst_imgproc_lane;

typedef struct bst_imgproc_state {
    const bst_imgproc_config *config;
    bst_camera camera;
    int64_t tick_rate_hz;
    bst_imgproc_maps maps;
    bst_imgproc_lane lanes[BST_STEP_LANES];
    bst_starid *starid;
    bst_imgproc_discriminator *discriminator;
    bst_predicted_stars sky;
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

#endif
