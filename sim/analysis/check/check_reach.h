/* What of a scenario's cue cannot be pointed at, found without simulating. */
#ifndef BST_ANALYSIS_CHECK_CHECK_REACH_H
#define BST_ANALYSIS_CHECK_CHECK_REACH_H

#include "sim/engine/simulation.h"

/* Longer runs are looked at so far beforehand, s: a look at a day takes a fifth of a second. */
#define BST_CHECK_LOOKED_S (3.0 * 86400.0)

/* Logs a warning for each reason for which a sensor whose control follows a cue cannot point at it
 * or loses it, with the first time span, and number and sum of all: behind the Earth, in keep-out
 * cones, outside of the mount's travel, by its limits, in the keyhole at its pole; and for each
 * move that the mount's limits do not allow (check_moves.h). The body is where its pointing law
 * wants it, the cue's error part of the cue, and the boresight on it from the beginning. Passes on
 * errors of what it asks. */
bst_status bst_check_reach(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) BST_MUST_CHECK;

#endif
