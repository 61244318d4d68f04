/* Tracker module of a scenario: role "tracker", type "ekf", "ukf" or "imm" by the filter of its
 * tracks. */
#ifndef BST_TRACKER_MODULE_H
#define BST_TRACKER_MODULE_H

#include "boresight/module.h"

/* Ports: detections (in, trigger), pointing_telemetry (in, optional), nav_telemetry (in), tracks
 * (out), predictions (out). Configuration: bst_tracker_config. */
extern const bst_module_desc bst_tracker_module; /* "ekf" */
extern const bst_module_desc bst_tracker_ukf_module;
extern const bst_module_desc bst_tracker_imm_module;

#endif
