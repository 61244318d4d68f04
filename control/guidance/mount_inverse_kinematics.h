/* Axis angles of a mount for directions, and which of the ways to point alike serves what is to
 * come: its turns of cable and its two sides of the pole. */
#ifndef BST_CONTROL_GUIDANCE_MOUNT_INVERSE_KINEMATICS_H
#define BST_CONTROL_GUIDANCE_MOUNT_INVERSE_KINEMATICS_H

#include "boresight/messages.h"

/* Whether the angles of a mount can be told from directions: two axes that are not redundant. */
bool bst_mount_steers(const bst_mount_status *mount);

/* The boresight in body axes at given angles. */
bst_vec3 bst_mount_boresight(const bst_mount_status *mount, const double angle_rad[BST_MOUNT_AXES]);

/* The angles that put the boresight on a direction (unit, body axes), a redundant axis at its
 * near_rad: none, one or two ways, the way nearest to near_rad first; each angle by the turn
 * nearest to near_rad, limits of travel not looked at. On the pole, where any outer angle will do,
 * it is that of near_rad. Paden and Kahan's subproblems 1 and 2 (Murray, Li and Sastry 1994, 3.2).
 */
int bst_mount_angles(const bst_mount_status *mount, bst_vec3 direction_body,
                     const double near_rad[BST_MOUNT_AXES], double angle_rad[2][BST_MOUNT_AXES]);

/* Whether an axis may stand at an angle. */
bool bst_mount_within(const bst_mount_axis *axis, double angle_rad);

/* The same as bst_mount_angles for the nearest way within travel, whole turns tried; false when
 * there is none. */
bool bst_mount_nearest(const bst_mount_status *mount, bst_vec3 direction_body,
                       const double near_rad[BST_MOUNT_AXES], double angle_rad[BST_MOUNT_AXES]);

typedef struct bst_mount_turn_choice {
    double angle_rad[BST_MOUNT_AXES]; /* at the first direction */
    int serves;                       /* of the directions, in a row from the first */
    double slew_s; /* of the axis that takes longest to get there at its rate limit */
} bst_mount_turn_choice;

/* Among all turns and both ways within travel at the first of `count` directions to come (unit,
 * body axes, close enough together that an axis moves by less than half a turn between two), the
 * one that can follow the most of them without leaving travel; of equals the one that is reached
 * soonest from the present angles. False when there is none. */
bool bst_mount_choose_turn(const bst_mount_status *mount, const bst_vec3 *directions_body,
                           int count, bst_mount_turn_choice *out);

#endif
