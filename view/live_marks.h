/* Marks of a frame from the messages of a run in progress, in the form of bst_view_run_frame. */
#ifndef BST_VIEW_LIVE_MARKS_H
#define BST_VIEW_LIVE_MARKS_H

#include <cjson/cJSON.h>

#include "boresight/camera.h"
#include "boresight/messages.h"

/* Adds "truth" of what is in the field, and "wcs" without distortion, in pixels of the frame. */
void bst_view_add_live_truth(cJSON *node, const bst_truth *truth, const bst_frame_message *frame,
                             const bst_camera *camera);
/* Adds "detections". */
void bst_view_add_live_detections(cJSON *node, const bst_detections *detections,
                                  const bst_frame_message *frame);
/* Adds "tracks", all of them of this frame. */
void bst_view_add_live_tracks(cJSON *node, const bst_tracks *tracks,
                              const bst_frame_message *frame);

/* Adds the windows of a frame that image processing searched: array "windows" as
 * bst_view_run_frame. */
void bst_view_add_live_windows(cJSON *node, const bst_regions_of_interest *regions,
                               const bst_frame_message *frame);

#endif
