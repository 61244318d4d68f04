/* Spacecraft with rigid-body dynamics, wheels and flexible modes, attitude determination, and
 * control to a pointing law. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "gimbal/spacecraft/attitude_filter.h"
#include "gimbal/spacecraft/body_state.h"
#include "gimbal/spacecraft/spacecraft_config.h"
#include "gimbal/spacecraft/spacecraft_sky.h"

typedef struct bst_spacecraft bst_spacecraft;

/* Environment of a spacecraft. */
typedef struct bst_spacecraft_setup {
    double dt_s;        /* plant step */
    bst_quat q_nominal; /* body from GCRF at the epoch */
    bst_spacecraft_sky_fn sky_at;
    void *user;         /* of sky_at; must outlive the spacecraft */
    uint64_t seed, run; /* with instance: of its random streams */
    const char *instance;
} bst_spacecraft_setup;

/* Creates a spacecraft of type `rigid_body`. At step 0 it has attitude and rate of its pointing
 * law, plus initial_attitude_error_deg and initial_rate_degps.
 *
 * Errors:    BST_ERR_CONFIG as bst_spacecraft_body_init and bst_wheels_init, for rates that do not
 *            divide, parallel axes of the law, or a law other than `free` without wheels about
 *            three axes; those of sky_at
 * Ownership: free with bst_spacecraft_free */
bst_status bst_spacecraft_create(bst_ctx *ctx, const bst_spacecraft_config *config,
                                 const bst_spacecraft_setup *setup,
                                 bst_spacecraft **out) BST_MUST_CHECK;
void bst_spacecraft_free(bst_spacecraft *craft); /* NULL allowed */

/* Advances the spacecraft to plant step n = 0, 1, 2, ... in order, `seconds` after the epoch. It
 * does not allocate.
 *
 * Given:     reaction_nm  torque of the mount on the body over the step that ends now, N m, body
 *                         axes
 * Errors:    those of sky_at
 * Notes:     Wheel imbalance up to BST_JITTER_RESOLVED / dt is part of the motion; faster imbalance
 *            is in unresolved_rad2. Disturbance torques are computed at attitude.rate_hz and held.
 */
bst_status bst_spacecraft_step(bst_ctx *ctx, bst_spacecraft *craft, int64_t n, double seconds,
                               bst_vec3 reaction_nm) BST_MUST_CHECK;

/* Archives body, wheels, sensors, attitude filter, controller and environment. */
void bst_spacecraft_archive(bst_spacecraft *craft, bst_archive *archive);

/* True and estimated state after a step; lent, changed by the next one. */
typedef struct bst_spacecraft_now {
    bst_body_state body;                         /* true */
    bst_quat q_believed_from_gcrf;               /* estimate from gyro and star trackers */
    bst_vec3 rate_believed_radps;                /* body axes, mean over the newest gyro sample */
    bst_spacecraft_attitude_reference reference; /* wanted, at the controller's latest step */
    double wheel_radps[BST_WHEELS_MOST];
    unsigned wheel_flags; /* BST_WHEELS_... of the controller's latest step */
    bool tracked;         /* a star tracker saw stars at its latest measurement */
    bst_body_roll roll;   /* of the reference */
    /* variance of the body's motion about one axis (mean of three) missing between the steps */
    double unresolved_rad2;
} bst_spacecraft_now;
/* Current state of the spacecraft; it belongs to the spacecraft. */
const bst_spacecraft_now *bst_spacecraft_at(const bst_spacecraft *craft);

/* Number of its reaction wheels. */
int bst_spacecraft_wheel_count(const bst_spacecraft *craft);
/* State and limits of a wheel after the last step. */
bst_wheel_state bst_spacecraft_wheel_state(const bst_spacecraft *craft, int index);

/* Dynamics of the spacecraft, for tests and analysis; they belong to the spacecraft. */
const bst_spacecraft_body *bst_spacecraft_dynamics(const bst_spacecraft *craft);
/* Attitude filter of the spacecraft, for tests and analysis; it belongs to the spacecraft. */
const bst_attitude_filter *bst_spacecraft_filter(const bst_spacecraft *craft);
/* True bias of its gyro, rad/s. */
bst_vec3 bst_spacecraft_gyro_bias(const bst_spacecraft *craft);

/* Commands a roll: the wanted attitude rotates about the law's axis to roll_rad beyond roll_deg,
 * within the slew limits. No effect with the law `free`. */
void bst_spacecraft_command_roll(bst_spacecraft *craft, double roll_rad);

#endif
