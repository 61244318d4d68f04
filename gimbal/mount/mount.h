/* Plant of the full gimbal types: mount dynamics, encoders and servos on a moving body. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_H
#define BST_GIMBAL_MOUNT_MOUNT_H

#include "gimbal/mount/axis.h"
#include "gimbal/mount/mount_response.h"

enum { BST_MOUNT_DELAYS = 17 }; /* largest delay_steps plus the current step */

/* Servo of one axis. */
typedef struct bst_mount_servo {
    bst_axis shaper; /* reference: wanted angle when the current torque acts, and one step later */
    bst_compensator compensator;
    double torque_limit_nm, rate_limit_radps, output_limit_radps2;
    double ring_rad[BST_MOUNT_DELAYS + 1];   /* references, the newest at `steps` + delay + 1 */
    double ring_radps[BST_MOUNT_DELAYS + 1]; /* rates of the references */
    double waiting_nm[BST_MOUNT_DELAYS];     /* delayed torques */
    double torque_nm;                        /* motor torque of the last step */
    double reading_rad;                      /* encoder reading, in (-pi, pi], quantised */
    double unwrapped_rad;                    /* reading with whole turns counted */
    double rate_radps;                       /* from readings over the last 10 ms */
    double before_rad;                       /* unwrapped reading at the last evaluation */
    double watched_rad;                      /* unwrapped reading at the start of the stuck test */
    int64_t pushed;                          /* consecutive steps with torque at standstill */
    bool saturated, stuck;
} bst_mount_servo;

/* True and estimated motion of the body at a plant step. */
typedef struct bst_mount_body {
    bst_vec3 rate_radps;           /* true inertial rate, body axes */
    bst_quat q_believed_from_gcrf; /* attitude used by the servo */
    bst_vec3 believed_rate_radps;  /* inertial rate as known onboard, body axes */
} bst_mount_body;

typedef struct bst_mount {
    int type; /* bst_mount_type */
    int axes;
    bst_mount_joints joints;
    bst_mount_chain model; /* rigid model used by the servo */
    bst_mount_servo servo[BST_MOUNT_MOST];
    double sight_share[BST_MOUNT_MOST]; /* line-of-sight share of the flex angles */
    double encoder_step_rad, encoder_noise_rad, settle_tolerance_rad;
    double feed_model, feed_friction;
    double travel_min_rad[BST_MOUNT_MOST], travel_max_rad[BST_MOUNT_MOST];
    int delay_steps, stuck_axis; /* stuck_axis < 0: none */
    int64_t stuck_from_step, rate_steps, stuck_steps;
    bst_rng_key encoder_key;
    double dt_s;
    int64_t steps;
    bst_vec3 base_rate_radps; /* of the last step, base frame */
    bst_vec3 target_body;     /* commanded direction of the last step; zero: none */
    bool want_reaction;
    /* results of each step */
    bst_quat q_cam_from_body;  /* true */
    bst_quat q_seen_from_body; /* by the encoders; when measured */
    /* mean torque of the mount on the body in the last step, about the axes' intersection, in the
     * body axes of the coming step, in which it acts; with want_reaction */
    bst_vec3 reaction_nm;
    bool settled, limited; /* settled: when measured */
} bst_mount;

/* Initialises a mount at rest at the start angles; step 0 is the first. Errors: those of
 * bst_mount_config_joints and bst_mount_servo_compensator. */
bst_status bst_mount_init(bst_ctx *ctx, bst_mount *mount, int type, const bst_mount_config *config,
                          double dt_s, bst_rng_key encoder_key) BST_MUST_CHECK;

/* Archives joints, servos and the results of the last step.
 *
 * Errors:    those of bst_compensator_archive */
bst_status bst_mount_archive(bst_mount *mount, bst_archive *archive) BST_MUST_CHECK;

/* Advances the mount to step n = 0, 1, 2, ... (time n * dt_s), then reads the encoders and computes
 * the next torque.
 *
 * Given:     body           motion of the body at the step; its rate changes linearly over it
 *            command        NULL: hold the reference; evaluated command_age_s after its reference
 *            measure        false: `settled` and q_seen_from_body are not updated
 * Notes:     Computed torque: compensator and feed-forward give an acceleration per axis, and the
 *            rigid mass matrix at the reference gives all torques, limited by the motor. A reading
 *            acts delay_steps later; the reference is computed so far ahead that feed-forward is on
 *            time. */
void bst_mount_step(bst_mount *mount, const bst_mount_body *body, const bst_los_command *command,
                    double command_age_s, bool measure);

/* Steps the joints under given torques, open loop. */
void bst_mount_drive(bst_mount *mount, const double torque_nm[BST_MOUNT_MOST], bst_vec3 rate_body);

/* Fills mount_status; the caller adds the body's attitude and rate. */
void bst_mount_status_of(const bst_mount *mount, int64_t tick, bst_mount_status *out);

#endif
