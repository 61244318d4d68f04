/* A user's own detector in place of bst_imgproc_detect: what comes of its detections is checked,
 * and what identification of stars needs to know of the frame follows from what it says. */
#ifndef BST_IMGPROC_DETECT_PLUGIN_DETECTOR_H
#define BST_IMGPROC_DETECT_PLUGIN_DETECTOR_H

#include "imgproc/detect/psf_wings.h"
#include "imgproc/imgproc.h"
#include "sim/onboard/stages.h"

typedef struct bst_plugged bst_plugged;

extern const bst_config_desc bst_plugged_table[]; /* of a bst_stage_use */

/* The camera and the maps outlive it. BST_ERR_CONFIG for a plug-in without its functions. */
bst_status bst_plugged_create(bst_ctx *ctx, const bst_stage_use *use, const bst_camera *camera,
                              const bst_imgproc_maps *maps, int capacity,
                              bst_plugged **out) BST_MUST_CHECK;
void bst_plugged_free(bst_plugged *plugged);

/* As bst_imgproc_detect. BST_ERR_STATE, naming the plug-in, for a place, size or noise that is not
 * finite, a place off the window, or more items than there is room for. */
bst_status bst_plugged_detect(bst_ctx *ctx, bst_plugged *plugged, const bst_imgproc_frame *frame,
                              int64_t exposure_id, const bst_motion *motion, bst_detections *out,
                              int capacity) BST_MUST_CHECK;

/* As bst_imgproc_v_limit, bst_imgproc_streak_px and bst_imgproc_ground (const void *user: the
 * bst_plugged), of the latest frame: a Gaussian PSF, smeared along the star streak, in the noise
 * that the plug-in gave. */
double bst_plugged_v_limit(const bst_plugged *plugged, double snr);
double bst_plugged_streak_px(const bst_plugged *plugged);
void bst_plugged_ground(const void *plugged, double x_px, double y_px, bst_wings_ground *out);

#endif
