/* Delays and periods of a sensor's tracking loop, from the scenario. */
#ifndef BST_ENGINE_SCENARIO_LOOP_TIMING_H
#define BST_ENGINE_SCENARIO_LOOP_TIMING_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_loop_timing {
    double exposure_s, period_s; /* as control commands them, else from the exposure block */
    double frame_latency_s;      /* from the end of an exposure until control reads its tracks */
    double command_delay_s;      /* from the publication of a command until the gimbal reads it */
    double gimbal_period_s;      /* 0: no periodic gimbal */
} bst_loop_timing;

/* Sums the declared delays of a frame (exposure, frame, detections, tracks) and of a command. If a
 * substitute module replaces others, its delays count. */
void bst_loop_timing_of(const bst_scenario *scenario, int observer, int sensor,
                        bst_loop_timing *out);

#endif
