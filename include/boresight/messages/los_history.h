/* Channel los_history: the true attitude of the camera. */
#ifndef BORESIGHT_MESSAGES_LOS_HISTORY_H
#define BORESIGHT_MESSAGES_LOS_HISTORY_H

#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_LOS_HISTORY "los_history"

/* los_history (latest, written in place): ring of the true camera attitude at the plant rate.
 * Sample number n (0, 1, ...) is items[n % capacity]; the newest is number written - 1. */
typedef struct bst_los_sample {
    int64_t tick;
    bst_quat q_cam_from_gcrf;
} bst_los_sample;

typedef struct bst_los_history {
    int64_t written;
    int32_t capacity;
    double jitter_rad2; /* variance of the true line of sight, per axis, about linear
                           interpolation between samples: fast jitter, which widens the PSF */
    bst_los_sample items[];
} bst_los_history;

#endif
