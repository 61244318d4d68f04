/* What a scenario says of the times in a sensor's tracking loop. */
#ifndef BST_ENGINE_SCENARIO_LOOP_TIMING_H
#define BST_ENGINE_SCENARIO_LOOP_TIMING_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_loop_timing {
    double exposure_s, period_s; /* as commanded, else the exposure block's */
    double frame_latency_s;      /* from an exposure's end until its tracks reach control */
    double command_delay_s;      /* from a command's publication until the gimbal reads it */
    double gimbal_period_s;      /* 0: it has none */
} bst_loop_timing;

/* The sum of the declared delays on the way of a frame (exposure, frame, detections, tracks; of the
 * module that stands in for others where one does) and of a command. */
void bst_loop_timing_of(const bst_scenario *scenario, int observer, int sensor,
                        bst_loop_timing *out);

#endif
