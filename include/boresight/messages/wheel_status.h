/* Channel wheel_status: the reaction wheels of the spacecraft. */
#ifndef BORESIGHT_MESSAGES_WHEEL_STATUS_H
#define BORESIGHT_MESSAGES_WHEEL_STATUS_H

#include <stdint.h>

#define BST_CHANNEL_WHEEL_STATUS "wheel_status"

/* One reaction wheel. */
typedef struct bst_wheel_state {
    double speed_radps;       /* relative to the body, about the wheel's axis, by its tachometer */
    double speed_limit_radps; /* > 0 */
    double motor_nm;          /* commanded motor torque on the wheel */
    double motor_limit_nm;    /* 0: the wheel has failed */
} bst_wheel_state;

/* wheel_status (latest): the wheels of a spacecraft with dynamics, at the rate of
 * pointing_telemetry, in the order of the configuration. Not published without wheels. */
typedef struct bst_wheel_status {
    int64_t tick; /* of validity */
    int32_t count;
    bst_wheel_state items[];
} bst_wheel_status;

#endif
