/* The plant of the full gimbal types: axes with their dynamics, encoders and servos, on a moving
 * body. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_H
#define BST_GIMBAL_MOUNT_MOUNT_H

#include "gimbal/mount/axis.h"
#include "gimbal/mount/mount_response.h"

enum { BST_MOUNT_DELAYS = 17 }; /* most delay_steps, and the present step */

/* One axis' servo. */
typedef struct bst_mount_servo {
    bst_axis shaper; /* its reference: where the axis shall be when the torque of now acts, and a
                        step later */
    bst_compensator compensator;
    double torque_limit_nm, rate_limit_radps, output_limit_radps2;
    double ring_rad[BST_MOUNT_DELAYS + 1];   /* references, the newest at `steps` + delay + 1 */
    double ring_radps[BST_MOUNT_DELAYS + 1]; /* and their rates */
    double waiting_nm[BST_MOUNT_DELAYS];     /* torques on their way */
    double torque_nm;                        /* of the motor in the last step */
    double reading_rad;                      /* encoder, in (-pi, pi] and its steps */
    double unwrapped_rad;                    /* with the turns counted */
    double rate_radps;                       /* from readings, over the last 10 ms */
    double before_rad;                       /* unwrapped, at the last look */
    double watched_rad;                      /* unwrapped, when the watch for a stuck axis began */
    int64_t pushed;                          /* steps in a row with torque against standstill */
    bool saturated, stuck;
} bst_mount_servo;

/* What the body does, and what is known of it onboard, at a plant step. */
typedef struct bst_mount_body {
    bst_vec3 rate_radps;           /* true inertial rate, body axes */
    bst_quat q_believed_from_gcrf; /* what the servo points by */
    bst_vec3 believed_rate_radps;  /* inertial rate as known onboard, body axes */
} bst_mount_body;

typedef struct bst_mount {
    int type; /* bst_mount_type */
    int axes;
    bst_mount_joints joints;
    bst_mount_chain model; /* as the servo knows it: rigid */
    bst_mount_servo servo[BST_MOUNT_MOST];
    double sight_share[BST_MOUNT_MOST]; /* of the flex angles */
    double encoder_step_rad, encoder_noise_rad, settle_tolerance_rad;
    double feed_model, feed_friction;
    double travel_min_rad[BST_MOUNT_MOST], travel_max_rad[BST_MOUNT_MOST];
    int delay_steps, stuck_axis; /* stuck_axis < 0: none */
    int64_t stuck_from_step, rate_steps, stuck_steps;
    bst_rng_key encoder_key;
    double dt_s;
    int64_t steps;
    bst_vec3 base_rate_radps; /* of the last step, base frame */
    bst_vec3 target_body;     /* direction asked for in the last step; zero: none */
    bool want_reaction;
    /* after each step */
    bst_quat q_cam_from_body;  /* true */
    bst_quat q_seen_from_body; /* by the encoders; when measured */
    bst_vec3 reaction_nm;  /* mean torque of the mount on the body in the last step, about the point
                              where the axes meet, in the body's axes of the step to come, in which
                              it acts; with want_reaction */
    bool settled, limited; /* settled: when measured */
} bst_mount;

/* At rest at the start angles; step 0 is the first. Errors as bst_mount_config_joints and
 * bst_mount_servo_compensator. */
bst_status bst_mount_init(bst_ctx *ctx, bst_mount *mount, int type, const bst_mount_config *config,
                          double dt_s, bst_rng_key encoder_key) BST_MUST_CHECK;

/* Brings the mount to step n = 0, 1, 2, ... (time n * dt_s), at which the body moves as `body`
 * says (its rate changes linearly over a step); then reads the encoders and works out the torque of
 * the next step from `command` (NULL: hold the reference), evaluated command_age_s after its
 * reference. With measure false, `settled`, q_seen_from_body are left alone.
 *
 * Torque: compensator and feed-forward give an acceleration for each axis, and the rigid mass
 * matrix at the reference the torques for all of them together (computed torque), limited by the
 * motor. A reading acts delay_steps later; the reference is worked out so far ahead that
 * feed-forward comes in time. */
void bst_mount_step(bst_mount *mount, const bst_mount_body *body, const bst_los_command *command,
                    double command_age_s, bool measure);

/* Steps the joints alone under given torques: open loop. */
void bst_mount_drive(bst_mount *mount, const double torque_nm[BST_MOUNT_MOST], bst_vec3 rate_body);

/* Fills in mount_status; the body's attitude and rate are for the caller to add. */
void bst_mount_status_of(const bst_mount *mount, int64_t tick, bst_mount_status *out);

#endif
