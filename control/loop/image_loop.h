/* Image-error loop: a compensator corrects the pointing by the measured offset of the true
 * boresight from the commanded direction in the frame. */
#ifndef BST_CONTROL_LOOP_IMAGE_LOOP_H
#define BST_CONTROL_LOOP_IMAGE_LOOP_H

#include "boresight/compensator.h"
#include "control/loop/pointing_error.h"
#include "control/modes/aim_history.h"

/* Compensator names: those of bst_compensator_type, followed by: */
enum { BST_CONTROL_OBSERVER = BST_COMPENSATOR_TYPE_COUNT };

extern const char *const bst_control_compensators[];

/* Timing of the loop. */
typedef struct bst_image_loop_env {
    double tick_rate_hz;
    double frame_period_s, frame_exposure_s, frame_latency_s;
    double command_latency_s; /* from publication of a command to its effect */
    double servo_lag_s;       /* lag of the mount behind a change of the command */
    double jump_rad;          /* a larger change of the aim between two commands starts a slew */
} bst_image_loop_env;

/* One equal loop per GCRF axis, so that the two axes across the boresight are the image's. The
 * compensator's output is the rate of the correction. Without an integrator it leaves no constant
 * error, with one no error for a constant drift. The correction is stored as error and rate of a
 * bst_pointing_error, valid at any time. Frames without attitude, and frames exposed during a slew,
 * leave the integrators unchanged. */
typedef struct bst_image_loop {
    bst_image_loop_env env;
    bst_compensator axis[3];
    bst_aim_history aims; /* uncorrected aims */
    int64_t slew_tick;    /* latest jump of the aim */
    bool slewing;         /* the mount has not settled since */
    int64_t rest_tick;    /* frames that started before are ignored */
    int64_t frame_tick;   /* latest used frame */
    bool coasting;        /* the rate comes from the integrators only */
} bst_image_loop;

/* Initialises the loop. A specification is designed against the frame delays and the mount's lag.
 * Errors: BST_ERR_CONFIG as bst_compensator_init. */
bst_status bst_image_loop_init(bst_ctx *ctx, bst_image_loop *loop,
                               const bst_compensator_config *config,
                               const bst_image_loop_env *env) BST_MUST_CHECK;

/* Saves or restores the loop, for bst_module_desc.archive.
 *
 * Errors:    those of bst_compensator_archive */
bst_status bst_image_loop_archive(bst_image_loop *loop, bst_archive *archive) BST_MUST_CHECK;

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
