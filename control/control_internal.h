/* Declarations shared by the files of the standard controller. */
#ifndef BST_CONTROL_CONTROL_INTERNAL_H
#define BST_CONTROL_CONTROL_INTERNAL_H

#include "control/control.h"

/* Seconds since the epoch of a tick. */
static inline double bst_control_seconds(const bst_control *c, int64_t tick) {
    return (double)tick / c->env.tick_rate_hz;
}

/* Ticks in a time interval. */
static inline int64_t bst_control_ticks(const bst_control *c, double seconds) {
    return (int64_t)llround(seconds * c->env.tick_rate_hz);
}

/* Rotation from a true direction to the telemetry boresight that points there. */
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

/* Apparent direction of a geometric one, with the velocity of the navigation telemetry. */
bst_vec3 bst_control_apparent(const bst_control *c, bst_vec3 geometric);

/* Clears the cached aims; call it after any change that affects the aim or the pointing error. */
void bst_control_forget_aims(bst_control *c);

/* Direction that the telemetry's boresight must have for the true one to be on the aim.
 *
 * Returned:  *valid     false: there is no aim
 *            *direction  unit vector, apparent */
bst_status bst_control_boresight_at(bst_ctx *ctx, bst_control *c, int64_t tick, bool *valid,
                                    bst_vec3 *direction) BST_MUST_CHECK;

/* Rate that the cue expects in a direction: that of the cue, or that of the belt for a region.
 *
 * Returned:  *known       false: there is no cue
 *            *rate_radps  rad/s */
bst_status bst_control_expected_rate(bst_ctx *ctx, const bst_control *c, int64_t tick,
                                     bst_vec3 direction, bool *known,
                                     bst_vec3 *rate_radps) BST_MUST_CHECK;

/* True if the boresight follows the motion of the region's points while it dwells. */
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
/* Returns to the tile of the search that a failed candidate interrupted. */
bst_status bst_control_resume_search(bst_ctx *ctx, bst_control *c, int64_t tick,
                                     const char *reason) BST_MUST_CHECK;

/* Goes on to the next tile of the search; starts the search again from the cue after the last one.
 *
 * Notes:     in BST_MODE_REACQUIRE it stays at the predicted position for reacquire_coast_s. */
bst_status bst_control_next_tile(bst_ctx *ctx, bst_control *c, int64_t tick) BST_MUST_CHECK;
/* Counts a frame without a new candidate for the dwell. */
bst_status bst_control_count_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                   const bst_tracks *tracks) BST_MUST_CHECK;
/* Best track whose motion agrees with the expected one; *out NULL: none. */
bst_status bst_control_best_candidate(bst_ctx *ctx, const bst_control *c, const bst_tracks *tracks,
                                      const bst_track **out) BST_MUST_CHECK;

/* ---- modes.c ---- */

/* True if the configuration allows an unknown attitude. */
static inline bool bst_control_may_be_lost(const bst_control *c) {
    return c->config.attitude == 1 || c->config.lost_after_frames > 0;
}

/* Enters and leaves BST_MODE_LOST by the attitude of a frame: after enough frames without one, and
 * with the next one. An attitude that ends the mode starts the observer anew. */
void bst_control_watch_attitude(bst_control *c, int64_t tick, const bst_attitude_fix *fix);

/* Leaves BST_MODE_IDLE for the first mode. */
bst_status bst_control_start(bst_ctx *ctx, bst_control *c, int64_t tick) BST_MUST_CHECK;

/* Makes the transitions that time or telemetry causes.
 *
 * Given:     arrived  the servo has settled on the aim */
bst_status bst_control_advance(bst_ctx *ctx, bst_control *c, int64_t tick,
                               bool arrived) BST_MUST_CHECK;

/* Makes the transitions that the tracks of a frame cause. */
bst_status bst_control_take_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                  const bst_tracks *tracks) BST_MUST_CHECK;

#endif
