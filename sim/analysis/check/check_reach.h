/* Predicts when a sensor cannot point at its cue, without a simulation. */
#ifndef BST_ANALYSIS_CHECK_CHECK_REACH_H
#define BST_ANALYSIS_CHECK_CHECK_REACH_H

#include "sim/engine/simulation.h"

/* longest examined duration, s: predicting a day takes 0.2 s */
#define BST_CHECK_LOOKED_S (3.0 * BST_DAY_S)

/* Logs a warning for each reason for which a sensor that follows a cue cannot point at it: Earth
 * occultation, keep-out cones, mount travel, mount limits, keyhole at the pole; and for impossible
 * moves (check_moves.h). A warning has the first time span, number and total duration. Assumptions:
 * the body follows its pointing law, the cue error is part of the cue, the boresight starts on the
 * cue. Returns errors of orbits and cues. */
bst_status bst_check_reach(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) BST_MUST_CHECK;

#endif
