/* Channel pointing_telemetry: the measured attitude of the camera. */
#ifndef BORESIGHT_MESSAGES_POINTING_TELEMETRY_H
#define BORESIGHT_MESSAGES_POINTING_TELEMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_POINTING_TELEMETRY "pointing_telemetry"

/* pointing_telemetry (latest, written in place): ring of measured attitudes. */
typedef struct bst_pointing_sample {
    int64_t tick;
    bst_quat q_cam_from_gcrf; /* measured: attitude estimate and encoders */
    double axis_rad[2];       /* encoder readings, outer and inner axis */
} bst_pointing_sample;

typedef struct bst_pointing_telemetry {
    int64_t written;
    int32_t capacity;
    bst_quat q_body_from_gcrf; /* newest estimate of the body attitude */
    bool settled;              /* the servo is within its settling tolerance of the command */
    bool limited;              /* an axis is at a rate, acceleration or travel limit */
    bst_pointing_sample items[];
} bst_pointing_telemetry;

#endif
