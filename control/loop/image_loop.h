/* Pointing corrected by a compensator on the image error: how far, in the frame, the true boresight
 * was from where the command wanted it. */
#ifndef BST_CONTROL_LOOP_IMAGE_LOOP_H
#define BST_CONTROL_LOOP_IMAGE_LOOP_H

#include "boresight/compensator.h"
#include "control/loop/pointing_error.h"
#include "control/modes/aim_history.h"

/* In front of the names of bst_compensator_type stand those; after them: */
enum { BST_CONTROL_OBSERVER = BST_COMPENSATOR_TYPE_COUNT };

extern const char *const bst_control_compensators[];

/* What the loop needs to know of its surroundings. */
typedef struct bst_image_loop_env {
    double tick_rate_hz;
    double frame_period_s, frame_exposure_s, frame_latency_s;
    double command_latency_s; /* from a command's publication to its effect */
    double servo_lag_s;       /* how late the mount follows a change of the command */
    double jump_rad;          /* an aim that moves by more between two commands starts a slew */
} bst_image_loop_env;

/* One loop per axis of GCRF, all alike, so that the two across the boresight are the image's: the
 * compensator's output is the rate at which the correction turns, so that a compensator without an
 * integrator leaves no constant error and one with leaves none of a constant drift. The correction
 * is kept as error and rate of a bst_pointing_error, valid at any time. Frames without an attitude,
 * and frames exposed while the mount slews to a new aim, leave the integrators as they are. */
typedef struct bst_image_loop {
    bst_image_loop_env env;
    bst_compensator axis[3];
    bst_aim_history aims; /* uncorrected */
    int64_t slew_tick;    /* the latest jump of the aim */
    bool slewing;         /* the mount has not been seen to arrive since */
    int64_t rest_tick;    /* frames that began before do not count */
    int64_t frame_tick;   /* of the latest that was used */
    bool coasting;        /* the rate is the integrators' alone */
} bst_image_loop;

/* BST_ERR_CONFIG as bst_compensator_init: a specification is designed against the delays of the
 * frames and the mount's lag. */
bst_status bst_image_loop_init(bst_ctx *ctx, bst_image_loop *loop,
                               const bst_compensator_config *config,
                               const bst_image_loop_env *env) BST_MUST_CHECK;

/* Stores the command that takes effect at a tick.
 *
 * Given:     effect_tick   tick at which the command takes effect
 *            corrected     corrected directions at effect_tick, half_ticks later and half_ticks
 *                          earlier
 *            arrived       the mount is on its aim, by the telemetry of arrived_tick
 * Returned:  true if the correction was changed
 * Notes:     if frames are missing or the aim has jumped, the compensators' response to the latest
 *            error is removed; the correction continues from the state of their integrators. */
bool bst_image_loop_commanded(bst_image_loop *loop, bst_pointing_error *correction,
                              int64_t effect_tick, int64_t half_ticks, const bst_vec3 corrected[3],
                              bool arrived, int64_t arrived_tick);

/* Updates error and rate of the correction from the attitude of a frame.
 *
 * Given:     tick  now
 *            fix   attitude from the frame's stars
 * Returned:  true if the fix was used */
bool bst_image_loop_update(bst_image_loop *loop, bst_pointing_error *correction, int64_t tick,
                           const bst_attitude_fix *fix);

#endif
