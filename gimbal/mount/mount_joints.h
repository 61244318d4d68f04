/* The joints of a mount: friction with stiction, cables, stops, and how they are stepped. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_JOINTS_H
#define BST_GIMBAL_MOUNT_MOUNT_JOINTS_H

#include <stdbool.h>
#include <stdint.h>

#include "gimbal/mount/mount_chain.h"

/* Friction of a sliding joint at the rate v is
 *   F(v) = coulomb + (breakaway - coulomb) / (1 + (v / stribeck)^2) + viscous |v|
 * (Hess and Soom, J. Tribology 112, 1990), against v; a joint at rest holds up to `breakaway`. */
typedef struct bst_mount_joint {
    double coulomb_nm, breakaway_nm; /* breakaway >= coulomb >= 0 */
    double stribeck_radps;           /* > 0 */
    double viscous_nms;              /* N m s/rad */
    double spring_nm;                /* cable: N m/rad ... */
    double spring_zero_rad;          /* ... from this angle, turns counted */
    double min_rad, max_rad;         /* stops; -INFINITY, INFINITY: none */
    double restitution;              /* of the stops: rate after over rate before, 0 to 1 */
    bool stuck;                      /* does not turn, whatever the torque */
} bst_mount_joint;

typedef enum bst_mount_joint_method {
    BST_JOINT_RK4 = 0,  /* Runge-Kutta of order 4 */
    BST_JOINT_LEAPFROG, /* drift, kick, drift: order 2, keeps the energy of what is not damped */
} bst_mount_joint_method;

typedef struct bst_mount_joints {
    bst_mount_chain chain;
    bst_mount_joint joint[BST_CHAIN_MOST];
    int method; /* bst_mount_joint_method */
    bst_mount_chain_state state;
    double sine[BST_CHAIN_MOST], cosine[BST_CHAIN_MOST]; /* of state.angle_rad */
    int8_t slide[BST_CHAIN_MOST];                        /* direction of sliding; 0: held */
    bool at_stop[BST_CHAIN_MOST];                        /* held by a stop in the last step */
    int64_t events; /* stops, reversals and break-aways so far */
} bst_mount_joints;

/* At rest at the given angles (within the stops). */
void bst_mount_joints_init(bst_mount_joints *joints, const double angle_rad[BST_CHAIN_MOST]);

/* Advances by dt_s under motor torques that are constant during the step and a base rate that
 * changes linearly from rate_before to rate_after (inertial, base frame).
 *
 * Between events the directions of friction are fixed and the motion is smooth; a joint that comes
 * to rest and one that meets a stop end a part of the step, at most 12 of them. A joint at rest
 * stays exactly there as long as friction and stop can hold it: that is looked at when it comes to
 * rest and at the start of each step. In the thirteenth part, what would have an event is held. */
void bst_mount_joints_step(bst_mount_joints *joints, double dt_s,
                           const double torque_nm[BST_CHAIN_MOST], bst_vec3 rate_before,
                           bst_vec3 rate_after);

/* Kinetic energy and that of modes and cables, J. */
double bst_mount_joints_energy(const bst_mount_joints *joints, bst_vec3 base_rate_radps);

#endif
