/* Rigid-body dynamics of a mount: up to three stages that rotate about one point of a moving body,
 * each with an optional flexible mode about its axis. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_CHAIN_H
#define BST_GIMBAL_MOUNT_MOUNT_CHAIN_H

#include "boresight/vec.h"

enum { BST_CHAIN_MOST = 3 };

/* Mount chain. The base frame is fixed to the body: first axis along the mount's outer axis, second
 * along the inner one at zero angles. Stage k rotates about axis e(k) = 1, 2, 1 of the frame of the
 * stage below (0: the base). The third axis is along the outer one at zero angles and perpendicular
 * to it at an inner angle of 90 degrees. Stages are balanced about the axes' intersection, so that
 * translations of the body do not rotate them. */
typedef struct bst_mount_chain {
    int stages; /* 2 or 3 */
    /* Inertia of each stage without the stages on it, about the intersection, its own frame: xx,
     * yy, zz, xy, xz, yz (tensor elements: products of inertia with negative sign), kg m^2;
     * including the part on the spring. */
    double inertia[BST_CHAIN_MOST][6];
    /* Flexible mode: part of a stage's inertia about its axis on a torsion spring: kg m^2, N m/rad,
     * N m s/rad. Inertia 0: none. Its angle relative to the stage is `flex_rad`. */
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

/* Equations of motion: mass * accel + bias = torque about the axes (motor, friction, joint
 * springs). A flexible mode contributes its spring torque to `bias`. */
typedef struct bst_mount_chain_equations {
    double mass[BST_CHAIN_MOST][BST_CHAIN_MOST];
    double bias_nm[BST_CHAIN_MOST];
    double
        /* inertial acceleration about each axis if the joints do not accelerate */
        base_accel_radps2[BST_CHAIN_MOST];
    /* inertial acceleration about axis k per acceleration of joint j <= k */
    double share[BST_CHAIN_MOST][BST_CHAIN_MOST];
} bst_mount_chain_equations;

/* Equations of motion at a state: recursive Newton-Euler for the bias, composite inertias for the
 * mass matrix, rotations only.
 *
 * Given:     sine, cosine  of the joint angles
 * Reference: Featherstone, Rigid Body Dynamics Algorithms, 2008, tables 5.1 and 6.2 */
void bst_mount_chain_equations_at(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  const double sine[BST_CHAIN_MOST],
                                  const double cosine[BST_CHAIN_MOST],
                                  const bst_mount_chain_base *base, bst_mount_chain_equations *out);

/* Angular momentum of the mount about the axes' intersection, base frame, kg m^2/s. */
bst_vec3 bst_mount_chain_momentum(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                                  bst_vec3 base_rate_radps);

/* Kinetic energy of rotation and elastic energy of the modes, J. */
double bst_mount_chain_energy(const bst_mount_chain *chain, const bst_mount_chain_state *state,
                              bst_vec3 base_rate_radps);

/* Inertia of the whole mount with locked joints about the axes' intersection, base frame, as
 * `inertia` above. */
void bst_mount_chain_locked_inertia(const bst_mount_chain *chain,
                                    const double angle_rad[BST_CHAIN_MOST], double out[6]);

#endif
