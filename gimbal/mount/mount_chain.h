/* Rigid-body dynamics of a mount: up to three stages that turn about one point of a moving body,
 * each perhaps with a flexible mode about its axis. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_CHAIN_H
#define BST_GIMBAL_MOUNT_MOUNT_CHAIN_H

#include "boresight/vec.h"

enum { BST_CHAIN_MOST = 3 };

/* Frames. The base frame is fixed to the body and has its first axis along the mount's outer axis,
 * its second along the inner one at zero angles. Stage k turns about its axis e(k) = 1, 2, 1 of the
 * frame of the stage below (0 the base): the third axis lies along the outer one at zero angles and
 * crosses it at right angles when the inner axis has turned by 90 degrees. Stages are balanced
 * about the point where the axes meet, so that translations of the body do not turn them. */
typedef struct bst_mount_chain {
    int stages; /* 2 or 3 */
    /* of each stage without the stages on it, about the common point, its own frame: xx, yy, zz,
     * xy, xz, yz (elements of the tensor, products of inertia with their negative sign), kg m^2;
     * with what its mode holds */
    double inertia[BST_CHAIN_MOST][6];
    /* What of a stage's inertia about its axis hangs on a torsion spring: inertia kg m^2, stiffness
     * N m/rad, damping N m s/rad. Inertia 0: none. Its angle against the stage is `flex_rad`. */
    double flex_inertia[BST_CHAIN_MOST], flex_stiffness[BST_CHAIN_MOST],
        flex_damping[BST_CHAIN_MOST];
} bst_mount_chain;

typedef struct bst_mount_chain_state {
    double angle_rad[BST_CHAIN_MOST], rate_radps[BST_CHAIN_MOST];
    double flex_rad[BST_CHAIN_MOST], flex_radps[BST_CHAIN_MOST];
} bst_mount_chain_state;

/* Motion of the base: inertial rate and its derivative, base frame. */
typedef struct bst_mount_chain_base {
    bst_vec3 rate_radps, accel_radps2;
} bst_mount_chain_base;

/* mass * accel + bias = torque about the axes (motor, friction, springs of the joints). Of a stage
 * with a flexible mode, what hangs on the spring counts in `bias` by the spring's torque. */
typedef struct bst_mount_chain_equations {
    double mass[BST_CHAIN_MOST][BST_CHAIN_MOST];
    double bias_nm[BST_CHAIN_MOST];
    double
        base_accel_radps2[BST_CHAIN_MOST]; /* inertial, about each axis, joints not accelerating */
    double share[BST_CHAIN_MOST][BST_CHAIN_MOST]; /* inertial acceleration about axis k per
                                                     acceleration of joint j <= k */
} bst_mount_chain_equations;

/* Equations of motion at a state: recursive Newton-Euler for the bias and composite inertias for
 * the mass matrix (Featherstone, "Rigid Body Dynamics Algorithms", 2008, tables 5.1 and 6.2),
 * rotations only. sine, cosine: of the joint angles. */
void bst_mount_chain_equations_at(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  const double sine[BST_CHAIN_MOST],
                                  const double cosine[BST_CHAIN_MOST],
                                  const bst_mount_chain_base *base, bst_mount_chain_equations *out);

/* Angular momentum about the common point, base frame, kg m^2/s. */
bst_vec3 bst_mount_chain_momentum(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  bst_vec3 base_rate_radps);

/* Kinetic energy of rotation and elastic energy of the modes, J. */
double bst_mount_chain_energy(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                              bst_vec3 base_rate_radps);

/* Inertia of the whole mount about the common point with its joints locked, base frame, as
 * `inertia` above. */
void bst_mount_chain_locked_inertia(const bst_mount_chain *chain,
                                    const double angle_rad[BST_CHAIN_MOST], double out[6]);

#endif
