/* Passes a frame's evidence of defective pixels to the learner of the bad-pixel map. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H
#define BST_IMGPROC_CALIBRATE_PIXEL_LEARNING_H

#include "imgproc/calibrate/pixel_learner.h"
#include "imgproc/detect/region_of_interest.h"
#include "sim/onboard/discriminate.h"

/* Input of bst_pixel_step: a frame whose stars have been identified. */
typedef struct bst_pixel_step_input {
    const bst_frame_knowledge *known;
    const bst_region_of_interest *windows; /* windows searched; NULL or none: the whole frame */
    int binning;
    double time_s; /* mid-exposure */
    const bst_pixel_shows *shows;
    /* identified stars; attitude and tracks come from `known`, because a frame may have no stars */
    const bst_detections *detections;
} bst_pixel_step_input;

/* Updates the bad-pixel learner with a frame. Call it after the star identification and before
 * objects are classified. Frames whose evidence is not usable are skipped. */
void bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                    const bst_pixel_step_input *input);

#endif
