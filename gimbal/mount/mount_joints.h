/* Joints of a mount: friction with stiction, cables, stops, and their time stepping. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_JOINTS_H
#define BST_GIMBAL_MOUNT_MOUNT_JOINTS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "gimbal/mount/mount_chain.h"

/* Friction of a sliding joint at rate v, opposing it:
 *   F(v) = coulomb + (breakaway - coulomb) / (1 + (v / stribeck)^2) + viscous |v|
 * (Hess and Soom, J. Tribology 112, 1990). A joint at rest holds up to `breakaway`. */
typedef struct bst_mount_joint {
    double coulomb_nm, breakaway_nm; /* breakaway >= coulomb >= 0 */
    double stribeck_radps;           /* > 0 */
    double viscous_nms;              /* N m s/rad */
    double spring_nm;                /* cable stiffness, N m/rad ... */
    double spring_zero_rad;          /* ... and its zero angle, whole turns counted */
    double min_rad, max_rad;         /* stops; -INFINITY, INFINITY: none */
    double restitution; /* of the stops: ratio of rates after and before impact, 0 to 1 */
    bool stuck;         /* fault: does not turn at any torque */
} bst_mount_joint;

typedef enum bst_mount_joint_method {
    BST_JOINT_RK4 = 0,  /* fourth-order Runge-Kutta */
    BST_JOINT_LEAPFROG, /* second order; conserves the energy of undamped parts */
} bst_mount_joint_method;

typedef struct bst_mount_joints {
    bst_mount_chain chain;
    bst_mount_joint joint[BST_CHAIN_MOST];
    int method; /* bst_mount_joint_method */
    bst_mount_chain_state state;
    double sine[BST_CHAIN_MOST], cosine[BST_CHAIN_MOST]; /* of state.angle_rad */
    int8_t slide[BST_CHAIN_MOST];                        /* direction of sliding; 0: held */
    bool at_stop[BST_CHAIN_MOST];                        /* held by a stop in the last step */
    int64_t events; /* number of impacts, reversals and break-aways */
} bst_mount_joints;

/* Initialises the joints at rest at angles within the stops. */
void bst_mount_joints_init(bst_mount_joints *joints, const double angle_rad[BST_CHAIN_MOST]);

/* Advances the joints by dt_s under constant motor torques. The base rate (inertial, base frame)
 * changes linearly from rate_before to rate_after.
 *
 * Notes:     Between events friction directions are fixed and the motion is smooth. A joint that
 *            comes to rest or reaches a stop ends a part of the step, at most 12 parts. A joint at
 *            rest stays exactly there as long as friction and stop can hold it; this is tested when
 *            it comes to rest and at each step's start. In the thirteenth part a joint with an
 *            event is held. */
void bst_mount_joints_step(bst_mount_joints *joints, double dt_s,
                           const double torque_nm[BST_CHAIN_MOST], bst_vec3 rate_before,
                           bst_vec3 rate_after);

/* Archives the motion of the joints and their faults. */
void bst_mount_joints_archive(bst_mount_joints *joints, bst_archive *archive);

/* Kinetic energy plus energy of modes and cables, J. */
double bst_mount_joints_energy(const bst_mount_joints *joints, bst_vec3 base_rate_radps);

#endif
