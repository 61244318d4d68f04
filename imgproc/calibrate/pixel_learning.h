/* A frame's evidence of defective pixels, from what image processing knows of the frame. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H

#include "imgproc/calibrate/pixel_learner.h"
#include "imgproc/detect/region_of_interest.h"
#include "imgproc/measure/discriminate.h"

/* Gives a frame's maxima to the learner, after stars were identified and before objects are.
 *
 * Given: the frame's detections, with its attitude from telemetry and the tracker (not that of this
 * frame's stars, which a frame without any lacks); what is known of it; the windows that were
 * looked at (none: all of it). Nothing is done with maxima of no use (shows->usable). */
void bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                    const bst_imgproc_frame_knowledge *known, const bst_region_of_interest *windows,
                    int binning, double time_s, const bst_pixel_shows *shows,
                    const bst_detections *detections);

#endif
