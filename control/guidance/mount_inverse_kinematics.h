/* Inverse kinematics of a mount: axis angles for a direction, and the choice between equivalent
 * angles (whole turns, and the two sides of the pole) for the directions to come. */
#ifndef BST_CONTROL_GUIDANCE_MOUNT_INVERSE_KINEMATICS_H
#define BST_CONTROL_GUIDANCE_MOUNT_INVERSE_KINEMATICS_H

#include "boresight/messages.h"

/* True if a direction determines the angles of a mount: two of its axes are not redundant. */
bool bst_mount_steers(const bst_mount_status *mount);

/* Boresight in body axes (unit vector) at given angles. */
bst_vec3 bst_mount_boresight(const bst_mount_status *mount, const double angle_rad[BST_MOUNT_AXES]);

/* Axis angles that point the boresight in a direction.
 *
 * Given:     direction_body  unit vector, body axes
 *            near_rad        angles to be near to; a redundant axis is set to its value
 * Returned:  number of solutions, 0 to 2
 *            angle_rad  the solutions, the one nearest to near_rad first; each angle in the whole
 *                       turn nearest to near_rad. Limits of travel are not applied.
 * Notes:     on the pole, where the outer angle is arbitrary, it is that of near_rad.
 * Reference: Murray, Li and Sastry 1994, section 3.2 (Paden-Kahan subproblems 1 and 2) */
int bst_mount_angles(const bst_mount_status *mount, bst_vec3 direction_body,
                     const double near_rad[BST_MOUNT_AXES], double angle_rad[2][BST_MOUNT_AXES]);

/* True if an angle is within the travel of an axis. */
bool bst_mount_within(const bst_mount_axis *axis, double angle_rad);

/* As bst_mount_angles, but the nearest solution within travel, whole turns included.
 *
 * Returned:  false if there is none */
bool bst_mount_nearest(const bst_mount_status *mount, bst_vec3 direction_body,
                       const double near_rad[BST_MOUNT_AXES], double angle_rad[BST_MOUNT_AXES]);

typedef struct bst_mount_turn_choice {
    double angle_rad[BST_MOUNT_AXES]; /* at the first direction */
    int serves;    /* number of directions, from the first on, that it can follow */
    double slew_s; /* time of the slowest axis to get there at its rate limit */
} bst_mount_turn_choice;

/* Chooses angles for the first of the directions to come, from which most of them can be followed.
 *
 * Given:     directions_body  [count] unit vectors, body axes; an axis moves by less than half a
 *                             turn between two of them
 * Returned:  false if the first direction cannot be reached within travel
 *            *out  among all whole turns and both solutions within travel, the one that follows the
 *                  most directions without leaving travel; among equals the one reached soonest */
bool bst_mount_choose_turn(const bst_mount_status *mount, const bst_vec3 *directions_body,
                           int count, bst_mount_turn_choice *out);

#endif
