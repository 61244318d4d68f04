/* A frame's evidence of defective pixels, from what image processing knows of the frame. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H

#include "imgproc/calibrate/pixel_learner.h"
#include "imgproc/detect/region_of_interest.h"
#include "imgproc/measure/discriminate.h"

/* A frame whose stars were identified. */
typedef struct bst_pixel_step_input {
    const bst_imgproc_frame_knowledge *known;
    const bst_region_of_interest *windows; /* that were looked at; none: all of it */
    int binning;
    double time_s; /* of the exposure's middle */
    const bst_pixel_shows *shows;
    /* with the attitude from telemetry and the tracker, not that of this frame's stars, which a
     * frame without any lacks */
    const bst_detections *detections;
} bst_pixel_step_input;

/* Gives a frame's maxima to the learner, after stars were identified and before objects are.
 * Nothing is done with maxima of no use (shows->usable). */
void bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                    const bst_pixel_step_input *input);

#endif
