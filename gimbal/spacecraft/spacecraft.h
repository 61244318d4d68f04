/* A spacecraft that turns as a rigid body with wheels and flexible modes, measures its attitude,
 * and holds itself to a pointing law. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_H

#include "boresight/messages.h"
#include "gimbal/spacecraft/attitude_filter.h"
#include "gimbal/spacecraft/body_state.h"
#include "gimbal/spacecraft/spacecraft_config.h"
#include "gimbal/spacecraft/spacecraft_sky.h"

typedef struct bst_spacecraft bst_spacecraft;

/* What it is placed in. */
typedef struct bst_spacecraft_setup {
    double dt_s;        /* plant step */
    bst_quat q_nominal; /* body from GCRF at the epoch */
    bst_spacecraft_sky_fn sky_at;
    void *user;         /* of sky_at; outlives the spacecraft */
    uint64_t seed, run; /* with instance: of its random streams */
    const char *instance;
} bst_spacecraft_setup;

/* Of type `rigid_body`. At step 0 it has the attitude and rate of its pointing law, turned by
 * initial_attitude_error_deg and with initial_rate_degps on top. BST_ERR_CONFIG: what
 * bst_spacecraft_body_init and bst_wheels_init refuse; rates that do not divide; parallel axes of
 * the law; a law other than `free` without wheels about three axes; passes on errors of sky_at. */
bst_status bst_spacecraft_create(bst_ctx *ctx, const bst_spacecraft_config *config,
                                 const bst_spacecraft_setup *setup,
                                 bst_spacecraft **out) BST_MUST_CHECK;
void bst_spacecraft_free(bst_spacecraft *craft); /* NULL allowed */

/* Brings it to plant step n = 0, 1, 2, ... in turn, `seconds` after the epoch. reaction_nm: torque
 * of the mount on the body over the step that ends now, N m, body axes. Wheel imbalance at up to
 * BST_JITTER_RESOLVED / dt is in the motion; what is faster is in unresolved_rad2. Torques of the
 * surroundings are worked out at attitude.rate_hz and held. No allocation. Passes on errors of
 * sky_at. */
bst_status bst_spacecraft_step(bst_ctx *ctx, bst_spacecraft *craft, int64_t n, double seconds,
                               bst_vec3 reaction_nm) BST_MUST_CHECK;

/* What it is and believes after a step; lent, changed by the next one. */
typedef struct bst_spacecraft_now {
    bst_body_state body;                         /* true */
    bst_quat q_believed_from_gcrf;               /* from gyro and star trackers */
    bst_vec3 rate_believed_radps;                /* body axes, mean over the newest gyro sample */
    bst_spacecraft_attitude_reference reference; /* wanted, at the controller's latest step */
    double wheel_radps[BST_WHEELS_MOST];
    unsigned wheel_flags;   /* BST_WHEELS_..., of the controller's latest step */
    bool tracked;           /* a star tracker saw stars at its latest measurement */
    bst_body_roll roll;     /* as the reference has it */
    double unresolved_rad2; /* variance of the body's shake about one axis, the mean of
                               the three, that is not between the steps */
} bst_spacecraft_now;
/* Present state of the spacecraft; it belongs to the spacecraft. */
const bst_spacecraft_now *bst_spacecraft_at(const bst_spacecraft *craft);

/* Dynamics of the spacecraft, for tests and analysis; they belong to the spacecraft. */
const bst_spacecraft_body *bst_spacecraft_dynamics(const bst_spacecraft *craft);
/* Attitude filter of the spacecraft, for tests and analysis; it belongs to the spacecraft. */
const bst_attitude_filter *bst_spacecraft_filter(const bst_spacecraft *craft);
/* True bias of its gyro, rad/s. */
bst_vec3 bst_spacecraft_gyro_bias(const bst_spacecraft *craft);

/* The wanted attitude turns about the law's axis to roll_rad more than roll_deg, within the limits
 * of a slew. Of no effect with the law `free`. */
void bst_spacecraft_command_roll(bst_spacecraft *craft, double roll_rad);

#endif
