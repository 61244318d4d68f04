/* Shared by the files of the standard controller. */
#ifndef BST_CONTROL_CONTROL_INTERNAL_H
#define BST_CONTROL_CONTROL_INTERNAL_H

#include "control/control.h"

static inline double bst_control_seconds(const bst_control *c, int64_t tick) {
    return (double)tick / c->env.tick_rate_hz;
}

static inline int64_t bst_control_ticks(const bst_control *c, double seconds) {
    return (int64_t)llround(seconds * c->env.tick_rate_hz);
}

/* The rotation that takes a direction among the stars to where telemetry's boresight has to be. */
static inline bst_quat bst_control_correction_at(const bst_control *c, int64_t tick) {
    return bst_model_error_correction(&c->model_error, &c->pointing_error, tick,
                                      c->env.tick_rate_hz);
}

/* ---- pointing_reference.c ---- */

/* Cue at a tick.
 *
 * Errors:    those of the onboard knowledge */
bst_status bst_control_cue_at(bst_ctx *ctx, const bst_control *c, int64_t tick,
                              bst_onboard_cue *out) BST_MUST_CHECK;

/* Geometric to apparent with what navigation knows. */
bst_vec3 bst_control_apparent(const bst_control *c, bst_vec3 geometric);

/* After a change of anything that bst_control_aim or the pointing error rests on. */
void bst_control_forget_aims(bst_control *c);

/* Where the telemetry's boresight has to be for the true one to be on the aim. */
bst_status bst_control_boresight_at(bst_ctx *ctx, bst_control *c, int64_t tick, bool *valid,
                                    bst_vec3 *direction) BST_MUST_CHECK;

/* The rate (rad/s) of what the cue expects in a direction: the cue's own, or that of the belt there
 * when it gives a region; *known false: there is none. */
bst_status bst_control_expected_rate(bst_ctx *ctx, const bst_control *c, int64_t tick,
                                     bst_vec3 direction, bool *known,
                                     bst_vec3 *rate_radps) BST_MUST_CHECK;

/* Whether the boresight dwells on places of the region as they move. */
bool bst_control_moves_with_region(const bst_control *c);

/* ---- search_mode.c ---- */

/* Changes the mode and notes the transition for the record.
 *
 * Given:     mode    a bst_mode
 *            reason  constant text */
void bst_control_enter(bst_control *c, int mode, int64_t tick, const char *reason);

/* Begins a search in BST_MODE_SEARCH or BST_MODE_REACQUIRE. */
bst_status bst_control_start_search(bst_ctx *ctx, bst_control *c, int mode, int64_t tick,
                                    const char *reason) BST_MUST_CHECK;
/* Back to the place of the search that a failed candidate interrupted. */
bst_status bst_control_resume_search(bst_ctx *ctx, bst_control *c, int64_t tick,
                                     const char *reason) BST_MUST_CHECK;

/* Goes on to the next tile of the search; starts the search again from the cue after the last one.
 *
 * Notes:     in BST_MODE_REACQUIRE it stays at the predicted position for reacquire_coast_s. */
bst_status bst_control_next_tile(bst_ctx *ctx, bst_control *c, int64_t tick) BST_MUST_CHECK;
/* A frame that shows nothing new counts for the dwell. */
bst_status bst_control_count_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                   const bst_tracks *tracks) BST_MUST_CHECK;
/* The best track that moves as the target should, NULL when there is none. */
bst_status bst_control_best_candidate(bst_ctx *ctx, const bst_control *c, const bst_tracks *tracks,
                                      const bst_track **out) BST_MUST_CHECK;

/* ---- modes.c ---- */

/* The first mode, out of BST_MODE_IDLE. */
bst_status bst_control_start(bst_ctx *ctx, bst_control *c, int64_t tick) BST_MUST_CHECK;

/* Transitions that time or telemetry bring about; arrived: the servo is at rest on the aim. */
bst_status bst_control_advance(bst_ctx *ctx, bst_control *c, int64_t tick,
                               bool arrived) BST_MUST_CHECK;

/* Transitions that the tracker's message about one frame brings about. */
bst_status bst_control_take_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                  const bst_tracks *tracks) BST_MUST_CHECK;

#endif
