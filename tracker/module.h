/* The tracker as a module of a scenario: role "tracker", type "ekf". */
#ifndef BST_TRACKER_MODULE_H
#define BST_TRACKER_MODULE_H

#include "sim/core/module.h"

/* Ports: detections (in, trigger), pointing_telemetry (in, optional), nav_telemetry (in), tracks
 * (out), predictions (out). Configuration: bst_tracker_config. */
extern const bst_module_desc bst_tracker_module;

#endif
