/* Channel sensor_command: exposure, window and binning requested by control. */
#ifndef BORESIGHT_MESSAGES_SENSOR_COMMAND_H
#define BORESIGHT_MESSAGES_SENSOR_COMMAND_H

#include "boresight/messages/window.h"

#define BST_CHANNEL_SENSOR_COMMAND "sensor_command"

/* sensor_command (latest): settings that control requests from the exposure clock; they apply from
 * the next start of an exposure. */
typedef struct bst_sensor_command {
    double exposure_s;         /* <= 0: keep */
    double period_s;           /* <= 0: keep */
    bst_window window;         /* width 0: full sensor */
    int binning;               /* 0: keep */
    double pixel_scale_arcsec; /* at the boresight; <= 0: keep */
} bst_sensor_command;

#endif
