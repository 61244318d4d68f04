/* The exposure clock: opens and closes exposures at exact ticks. */
#ifndef BST_ENGINE_KERNEL_EXPOSURE_CLOCK_H
#define BST_ENGINE_KERNEL_EXPOSURE_CLOCK_H

#include "boresight/module.h"

/* Role "exposure", type "clock"; its configuration is the sensor's "exposure" block
 * (bst_exposure_config). Reads sensor_command at each exposure's start, publishes `exposure` at its
 * end. The next exposure starts one period after the start of the previous one, or at its end if
 * that is later. */
extern const bst_module_desc bst_exposure_clock_module;

#endif
