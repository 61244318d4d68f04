/* How the spacecraft's body moves: what its dynamics hand to the mount at each plant step. */
#ifndef BST_GIMBAL_SPACECRAFT_BODY_STATE_H
#define BST_GIMBAL_SPACECRAFT_BODY_STATE_H

#include "boresight/vec.h"

/* The true state of the body at one plant step. */
typedef struct bst_body_state {
    bst_quat q_body_from_gcrf; /* unit */
    bst_vec3 rate_radps;       /* of the body against GCRF, body axes */
    bst_vec3 accel_radps2;     /* change of rate_radps over the step before, by its length */
} bst_body_state;

#endif
