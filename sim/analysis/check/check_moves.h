/* Whether the limits of a mount let it make the moves that control commands: slews, steps of a
 * search, scans. (Whether they let it follow the cue is for check_reach.h.) */
#ifndef BST_ANALYSIS_CHECK_CHECK_MOVES_H
#define BST_ANALYSIS_CHECK_CHECK_MOVES_H

#include "control/control.h"

typedef struct bst_check_mount_moves {
    const bst_control_config *control;
    const bst_mount_status *mount; /* its lowest limits count */
    double period_s, exposure_s;   /* of frames */
    double width_rad, height_rad;  /* of the field */
    double cue_sigma_rad;          /* 0: there is no cue whose error is searched */
    bst_region region;
    double duration_s;
} bst_check_mount_moves;

/* Time of a slew by an angle, from rest to rest, under the mount's lowest limits; INFINITY when it
 * has no acceleration. 0 of a mount without limits. */
double bst_check_mount_slew_s(const bst_mount_status *mount, double angle_rad);

/* Time from the command of a search's next place until its dwell_frames are exposed there: a step
 * across search_step of the field's greater side, and whole frames at rest. 0: nothing is searched,
 * or the first place covers it. */
double bst_check_search_place_s(const bst_check_mount_moves *moves);

/* Logs a warning, with what was found, what is needed and what to do, for each move that the limits
 * do not allow: a place of the search that takes longer than dwell_timeout_s because of the step to
 * it, and a scan faster than the mount turns or whose turns it cannot make. Returns the number of
 * warnings. */
int bst_check_moves(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves);

/* The same for the first slew, by angle_rad: one that takes longer than the run. */
int bst_check_first_slew(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves,
                         double angle_rad);

#endif
