/* Checks the disk space for a run's frames. */
#ifndef BST_RUN_RUN_SPACE_H
#define BST_RUN_RUN_SPACE_H

#include "sim/engine/scenario/scenario.h"

/* Number of frames of a sensor in a run. */
double bst_run_sensor_frames(const bst_scenario *scenario, const bst_sensor_config *sensor);
/* Bytes that the frames and planes of a sensor take on the disk, without tables; about, where they
 * are compressed. */
double bst_run_sensor_bytes(const bst_scenario *scenario, const bst_sensor_config *sensor);

/* Logs the expected size of the frames from 0.1 GB on. BST_ERR_IO: the disk of `out` has less free
 * space; with `force` only a warning. */
bst_status bst_run_check_space(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                               bool force) BST_MUST_CHECK;

#endif
