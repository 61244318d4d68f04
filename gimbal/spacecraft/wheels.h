/* Reaction wheels: torque distribution, friction, and imbalance torque. */
#ifndef BST_GIMBAL_SPACECRAFT_WHEELS_H
#define BST_GIMBAL_SPACECRAFT_WHEELS_H

#include <stdbool.h>

#include "boresight/config.h"
#include "boresight/rng.h"
#include "gimbal/spacecraft/spacecraft_body.h"

typedef struct bst_wheel_config {
    double axis[3];
    double inertia_kgm2;
    double torque_limit_nm;
    double speed_limit_rpm;
    double speed_rpm;
    double coulomb_nm, viscous_nms;
    double static_imbalance_kgm, dynamic_imbalance_kgm2;
    double position_m[3];
    bool failed;
} bst_wheel_config;

extern const bst_config_desc bst_wheel_config_table[];

typedef struct bst_wheel {
    bst_vec3 axis, position_m; /* unit, right-handed with axis: plane of the rotating imbalance */
    bst_vec3 across[2];        /* unit, with axis right-handed: where imbalance turns */
    double inertia_kgm2;
    double torque_limit_nm; /* 0: failed */
    double speed_limit_radps, start_radps;
    double coulomb_nm, viscous_nms;
    double static_kgm, dynamic_kgm2;
    double phase0_rad; /* phase of the imbalance at time 0 */
} bst_wheel;

typedef struct bst_wheels {
    int count;
    bst_wheel wheel[BST_WHEELS_MOST];
} bst_wheels;

/* Limitations of a torque distribution. */
enum {
    BST_WHEELS_TORQUE_LIMIT = 1u << 0,   /* all torques scaled down: a motor is at its limit */
    BST_WHEELS_MOMENTUM_LIMIT = 1u << 1, /* a wheel at its speed limit was excluded */
    BST_WHEELS_SHORT = 1u << 2,          /* the remaining wheels do not span three axes */
};

/* Initialises the configured wheels; imbalance phases from `key`. Errors: BST_ERR_CONFIG for an
 * axis of zero length. */
bst_status bst_wheels_init(bst_ctx *ctx, bst_wheels *wheels, const bst_wheel_config *config,
                           int count, bst_rng_key key) BST_MUST_CHECK;

/* Distributes a body torque over the wheels: motor torques (N m, on the wheels) that exert
 * torque_nm (body axes) on the body, by the pseudo-inverse of the usable wheels' axes (least sum of
 * squares).
 *
 * A wheel at its speed limit that would have to accelerate is excluded, and the others share again.
 * If a motor would exceed its limit, all are scaled down to keep the torque's direction. If the
 * remaining wheels do not span three axes, the torque is the least-squares approximation.
 *
 * Returned:  flags above
 * Reference: Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control
 * (2014), section 7.3 */
unsigned bst_wheels_share(const bst_wheels *wheels, const double *speed_radps, bst_vec3 torque_nm,
                          double *motor_nm);

/* Torque on a wheel over a step of dt_s: motor torque (none beyond the speed limit) minus friction.
 * Coulomb friction never reverses a wheel; it brings it to rest and holds it.
 *
 * Given:     load_kgm2  bst_spacecraft_body_wheel_load_kgm2 */
double bst_wheel_torque(const bst_wheel *wheel, double speed_radps, double motor_nm,
                        double load_kgm2, double dt_s);

/* Adds the imbalance torque on the body (N m, body axes) at a wheel's phase and speed: static,
 * force m r W^2 at the wheel's position; dynamic, I W^2 across the axis. Markley and Crassidis,
 * section 4.8.3. */
void bst_wheel_imbalance(const bst_wheel *wheel, double phase_rad, double speed_radps,
                         bst_vec3 *torque_nm);

/* Amplitude of the imbalance torque about each body axis, N m. */
bst_vec3 bst_wheel_imbalance_amplitude(const bst_wheel *wheel, double speed_radps);

#endif
