/* Spacecraft dynamics: rigid hub, reaction wheels and flexible modes.
 *
 * With pi the total angular momentum, w the body rate, W_i the wheel speeds relative to the body
 * along unit axes a_i, n_k the mode coordinates and d_k their coupling vectors:
 *     pi = I w + sum a_i J_i W_i + sum d_k n_k',   pi' + w x pi = T
 *     J_i (W_i' + a_i . w') = u_i - friction_i
 *     n_k'' + 2 z_k f_k n_k' + f_k^2 n_k = -d_k . w'
 * (Likins, JPL TR 32-1329 (1970), hybrid coordinates; Hughes, Spacecraft Attitude Dynamics,
 * sections 3.4 and 4.4). The state holds pi in GCRF, the wheels' absolute momenta g_i = J_i (W_i +
 * a_i . w) and the modes' momenta p_k = n_k' + d_k . w. Then w = M (pi - sum a_i g_i - sum d_k p_k)
 * with the constant M = (I - sum J_i a_i a_i' - sum d_k d_k')^-1. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_BODY_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_BODY_H

#include "boresight/archive.h"
#include "boresight/status.h"
#include "gimbal/spacecraft/body_state.h"
#include "sim/dynamics/integrators.h"

#define BST_WHEELS_MOST 8
#define BST_MODES_MOST 6

typedef struct bst_spacecraft_wheel {
    bst_vec3 axis; /* unit, body */
    double inertia_kgm2;
} bst_spacecraft_wheel;

typedef struct bst_spacecraft_mode {
    double frequency_radps; /* of the appendage on a fixed hub */
    double damping;         /* ratio */
    bst_vec3 coupling;      /* sqrt(kg) m, body axes */
} bst_spacecraft_mode;

typedef struct bst_spacecraft_spec {
    /* total, wheels and appendages at rest: xx, yy, zz, xy, xz, yz; tensor elements, so xy is minus
     * the integral of x y dm */
    double inertia_kgm2[6];
    int wheels, modes;
    bst_spacecraft_wheel wheel[BST_WHEELS_MOST];
    bst_spacecraft_mode mode[BST_MODES_MOST];
    bst_integrator integrator;
    double dt_s;
} bst_spacecraft_spec;

/* State and tables of the body; use its functions to read them. */
typedef struct bst_spacecraft_body {
    bst_spacecraft_spec spec;
    bst_mat3 inertia;                                               /* body axes */
    bst_quat q_principal_from_body;                                 /* principal axes of M */
    bst_vec3 wheel_axis[BST_WHEELS_MOST], coupling[BST_MODES_MOST]; /* principal axes */
    double per_moment[3];
    /* modes over half a step: (n, p) = keep (n, p) + drive M (pi - sum a g) */
    double keep[2 * BST_MODES_MOST][2 * BST_MODES_MOST], drive[2 * BST_MODES_MOST][3];
    double free_radps[BST_MODES_MOST]; /* of the modes on the free spacecraft, ascending */
    /* state */
    bst_quat q; /* principal from GCRF */
    bst_vec3 momentum_gcrf;
    double wheel_momentum[BST_WHEELS_MOST], mode_place[BST_MODES_MOST],
        mode_momentum[BST_MODES_MOST];
    bst_vec3 rate_principal;
} bst_spacecraft_body;

/* Initialises a body with modes at rest, rate rate_radps (body axes) and wheels at wheel_radps.
 *
 * Errors:    BST_ERR_CONFIG with the reason: unphysical inertia (not positive definite, or a
 *            principal moment above the sum of the others), wheels or appendages with more inertia
 *            than the whole, or a step longer than BST_MODE_STEP_CYCLES of the fastest mode's cycle
 *            on the free spacecraft; the message states the longest step */
bst_status bst_spacecraft_body_init(bst_ctx *ctx, bst_spacecraft_body *body,
                                    const bst_spacecraft_spec *spec, bst_quat q_body_from_gcrf,
                                    bst_vec3 rate_radps, const double *wheel_radps) BST_MUST_CHECK;

#define BST_MODE_STEP_CYCLES 0.1

/* Advances the body by dt_s under a body torque (N m, body axes) and wheel motor torques (friction
 * included), held over the step.
 *
 * Notes:     Half of the torque impulse is applied first and half last. In between, the modes step
 *            exactly (matrix exponential, body momentum held), the body rotates (spec.integrator),
 *            and the modes step again. The scheme is second-order and time-symmetric; without
 *            torques and damping it conserves momentum and energy to the integrator's order. With
 *            rk4 all variables are integrated together. */
void bst_spacecraft_body_step(bst_spacecraft_body *body, bst_vec3 torque_nm,
                              const double *wheel_torque_nm);

/* Archives the state of body, wheels and modes. */
void bst_spacecraft_body_archive(bst_spacecraft_body *body, bst_archive *archive);

bst_quat bst_spacecraft_body_attitude(const bst_spacecraft_body *body); /* q_body_from_gcrf */
bst_vec3 bst_spacecraft_body_rate(const bst_spacecraft_body *body);     /* body axes */

/* Speed of a wheel relative to the body, rad/s.
 *
 * Given:     wheel  index of the wheel */
double bst_spacecraft_body_wheel_radps(const bst_spacecraft_body *body, int wheel);
/* Effective inertia for a motor torque on a wheel: its own, reduced by the reaction of the body. */
double bst_spacecraft_body_wheel_load_kgm2(const bst_spacecraft_body *body, int wheel);

/* Angular momentum of body, wheels and flexible modes, N m s, GCRF. */
bst_vec3 bst_spacecraft_body_momentum(const bst_spacecraft_body *body);
/* Kinetic and elastic energy of body, wheels and flexible modes, J. */
double bst_spacecraft_body_energy(const bst_spacecraft_body *body);

/* Symmetric matrix of six elements in the order of bst_spacecraft_spec. */
bst_mat3 bst_spacecraft_inertia_matrix(const double inertia_kgm2[6]);

#endif
