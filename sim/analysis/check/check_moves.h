/* Checks that a mount's limits permit slews, search steps and scans. (check_reach.h checks that it
 * can follow the cue.) */
#ifndef BST_ANALYSIS_CHECK_CHECK_MOVES_H
#define BST_ANALYSIS_CHECK_CHECK_MOVES_H

#include "control/control.h"

typedef struct bst_check_mount_moves {
    const bst_control_config *control;
    const bst_mount_status *mount; /* its lowest limits are used */
    double period_s, exposure_s;   /* frame period and exposure time */
    double width_rad, height_rad;  /* of the field */
    double cue_sigma_rad;          /* 1 sigma of the cue; 0: no search */
    bst_region region;
    double duration_s;
} bst_check_mount_moves;

/* Duration of a rest-to-rest slew by an angle, under the mount's lowest limits. INFINITY without
 * acceleration; 0 for a mount without limits. */
double bst_check_mount_slew_s(const bst_mount_status *mount, double angle_rad);

/* Time from commanding the next search position until its dwell_frames are exposed: a step of
 * search_step times the longer field side, then complete frames at rest. 0: no search, or the first
 * position covers it. */
double bst_check_search_place_s(const bst_check_mount_moves *moves);

/* Logs a warning with finding, requirement and remedy for each impossible move: a search position
 * that takes longer than dwell_timeout_s because of the step, and a scan beyond the rate or the
 * turn-around capability of the mount. Returns the number of warnings. */
int bst_check_moves(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves);

/* Logs a warning if the first slew, by angle_rad, takes longer than the run. */
int bst_check_first_slew(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves,
                         double angle_rad);

#endif
