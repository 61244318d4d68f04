/* Channel los_command: where the boresight is commanded to point. */
#ifndef BORESIGHT_MESSAGES_LOS_COMMAND_H
#define BORESIGHT_MESSAGES_LOS_COMMAND_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/messages/mount_status.h"
#include "boresight/vec.h"

#define BST_CHANNEL_LOS_COMMAND "los_command"

/* los_command (latest): commanded direction of the boresight, by the onboard attitude.
 * The command at tick t is the unit vector along direction + rate * dt + acceleration * dt^2 / 2,
 * dt = (t - tick) / tick rate. All members after the rate zero: constant rate, by the nearest
 * angles of the mount. */
typedef struct bst_los_command {
    int64_t tick;                    /* of reference */
    bst_vec3 direction_gcrf;         /* unit, apparent */
    bst_vec3 rate_gcrf_radps;        /* d(direction)/dt, perpendicular to direction */
    bst_vec3 accel_gcrf_radps2;      /* d2(direction)/dt2 */
    bool near_given;                 /* preferred angles if several give this direction: */
    double near_rad[BST_MOUNT_AXES]; /* angles by axis of mount_status at `tick`; false: nearest to
                                        the present angles */
    double near_radps[BST_MOUNT_AXES]; /* their rates */
    bool roll_given;                   /* commanded angle of bst_body_roll: */
    double roll_rad;
} bst_los_command;

#endif
