/* Warm-up of an attitude filter: its state at the epoch after running for a while. */
#ifndef BST_GIMBAL_SPACECRAFT_ATTITUDE_WARM_UP_H
#define BST_GIMBAL_SPACECRAFT_ATTITUDE_WARM_UP_H

#include "gimbal/spacecraft/attitude_filter.h"
#include "gimbal/spacecraft/attitude_sensors.h"

typedef struct bst_attitude_past {
    double seconds; /* duration of the warm-up */
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_radps;             /* constant body rate, body axes */
    const bst_spacecraft_gyro *gyro; /* as at the epoch */
    int trackers;                    /* those that saw stars */
    const bst_spacecraft_star_tracker *tracker[BST_TRACKERS_MOST];
    double rate_hz[BST_TRACKERS_MOST];
    bst_rng_key key; /* of the warm-up's noise */
} bst_attitude_past;

/* Runs a filter, initialised by bst_attitude_filter_init, from `seconds` before the epoch to the
 * epoch, on a body at constant rate. Noise, alignment errors and scale factors are those of the
 * sensors, so that errors and covariance are those of a filter in service. Measurements have no
 * latency. The step is the shortest tracker period, at most one second. If more than 5000 steps
 * were needed it is longer, with averaged measurement noise. */
void bst_attitude_warm_up(const bst_attitude_past *past, bst_attitude_filter *filter);

#endif
