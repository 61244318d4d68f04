/* Channel predictions: predicted positions of tracks and the filtered attitude error. */
#ifndef BORESIGHT_MESSAGES_PREDICTIONS_H
#define BORESIGHT_MESSAGES_PREDICTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_PREDICTIONS "predictions"

typedef struct bst_prediction {
    int64_t track_id;
    bst_vec3 direction_gcrf; /* geometric, at the header's tick */
    bst_vec3 rate_gcrf_radps;
    double sigma_rad;
    bool target_of_interest;
} bst_prediction;

/* predictions (latest): predictions of the tracker for image processing of later frames. */
typedef struct bst_predictions {
    int64_t tick; /* of validity */
    bool attitude_valid;
    bst_vec3 attitude_error_cam_rad; /* as in bst_attitude_fix, filtered */
    bst_vec3 attitude_error_rate_cam_radps;
    int32_t count, lost;
    bst_prediction items[];
} bst_predictions;

#endif
