/* An attitude filter that has been running: what it knows at the epoch. */
#ifndef BST_GIMBAL_SPACECRAFT_ATTITUDE_WARM_UP_H
#define BST_GIMBAL_SPACECRAFT_ATTITUDE_WARM_UP_H

#include "gimbal/spacecraft/attitude_filter.h"
#include "gimbal/spacecraft/attitude_sensors.h"

typedef struct bst_attitude_past {
    double seconds; /* that it has been running */
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_radps;             /* of the body, body axes, all the time */
    const bst_spacecraft_gyro *gyro; /* as it is at the epoch */
    int trackers;                    /* those that saw stars */
    const bst_spacecraft_star_tracker *tracker[BST_TRACKERS_MOST];
    double rate_hz[BST_TRACKERS_MOST];
    bst_rng_key key; /* of the past's noise */
} bst_attitude_past;

/* Takes a filter, as bst_attitude_filter_init made it, from `seconds` before the epoch to the
 * epoch, on a body that turned evenly: with noise, alignment errors and scale factors as the
 * sensors have them, so that errors and covariance are those of a filter in service. Measurements
 * come without latency. Steps are the shortest period of a tracker, at most a second, or, where
 * that would take more than 5000, so much longer, with the noise of the measurements of a step
 * averaged. */
void bst_attitude_warm_up(const bst_attitude_past *past, bst_attitude_filter *filter);

#endif
