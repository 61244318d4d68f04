/* Motion of the spacecraft's body: interface from its dynamics to the mount at each plant step. */
#ifndef BST_GIMBAL_SPACECRAFT_BODY_STATE_H
#define BST_GIMBAL_SPACECRAFT_BODY_STATE_H

#include "boresight/vec.h"

/* The true state of the body at one plant step. */
typedef struct bst_body_state {
    bst_quat q_body_from_gcrf; /* unit */
    bst_vec3 rate_radps;       /* relative to GCRF, body axes */
    bst_vec3 accel_radps2;     /* mean acceleration over the previous step */
} bst_body_state;

#endif
