/* Detector supplied by a plug-in in place of bst_imgproc_detect. Its detections are checked.
 * Background, noise and limiting magnitude for the star identification are derived from its
 * results. */
#ifndef BST_IMGPROC_DETECT_PLUGIN_DETECTOR_H
#define BST_IMGPROC_DETECT_PLUGIN_DETECTOR_H

#include "boresight/stages.h"
#include "imgproc/detect/psf_wings.h"
#include "imgproc/imgproc.h"

typedef struct bst_plugin_detector bst_plugin_detector;

extern const bst_config_desc bst_plugin_detector_table[]; /* configuration of a bst_stage_use */

/* Creates the detector of a plug-in.
 *
 * Errors:    BST_ERR_CONFIG if the plug-in lacks functions
 * Ownership: camera and maps must outlive *out; free with bst_plugin_detector_free */
bst_status bst_plugin_detector_create(bst_ctx *ctx, const bst_stage_use *use,
                                      const bst_camera *camera, const bst_imgproc_maps *maps,
                                      int capacity, bst_plugin_detector **out) BST_MUST_CHECK;
/* Destroys the plug-in's stage and frees the detector; NULL is allowed. */
void bst_plugin_detector_free(bst_plugin_detector *plugin);

/* Saves or restores the state of the plug-in's stage, as bst_stage_archive. */
bst_status bst_plugin_detector_archive(bst_plugin_detector *plugin,
                                       bst_archive *archive) BST_MUST_CHECK;

/* Detects sources with the plug-in, as bst_imgproc_detect.
 *
 * Errors:    BST_ERR_STATE, naming the plug-in, for a position, size or noise that is not finite, a
 *            position outside the window, or more than `capacity` detections */
bst_status bst_plugin_detector_detect(bst_ctx *ctx, bst_plugin_detector *plugin,
                                      const bst_imgproc_frame *frame, int64_t exposure_id,
                                      const bst_camera_motion *motion, bst_detections *out,
                                      int capacity) BST_MUST_CHECK;

/* bst_imgproc_v_limit for the latest frame of a plug-in.
 *
 * Given:     snr  signal-to-noise ratio of the limit
 * Returned:  V magnitude, for a Gaussian PSF smeared along the star streak, in the noise that the
 *            plug-in gave */
double bst_plugin_detector_v_limit(const bst_plugin_detector *plugin, double snr);
/* bst_imgproc_streak_px for the latest frame: length of the stars' streaks, px. */
double bst_plugin_detector_streak_px(const bst_plugin_detector *plugin);

/* bst_imgproc_ground for the latest frame: the plug-in's background and noise, constant over the
 * frame.
 *
 * Given:     plugin     a bst_plugin_detector
 *            x_px, y_px  not used */
void bst_plugin_detector_ground(const void *plugin, double x_px, double y_px,
                                bst_psf_wings_ground *out);

#endif
