/* The sensors of a recorded run. */
#ifndef BST_RUN_RUN_SENSORS_H
#define BST_RUN_RUN_SENSORS_H

#include "sim/io/run_reader.h"

/* A sensor of the run. */
typedef struct bst_run_sensor {
    int64_t index; /* row of the table sensors */
    char observer[80], name[80];
    char target[80]; /* "" for none */
    char file[256];  /* FITS file of its frames; "" when none are kept */
} bst_run_sensor;

enum { BST_EXPORT_SENSORS = 64 };

/* The sensors that are asked for. BST_ERR_NOT_FOUND when there is none of that name: the message
 * lists what there is. A run without readable tables has one sensor, of the file frames.fits. */
bst_status bst_run_sensors(bst_ctx *ctx, const bst_run_reader *run, const char *sensor,
                           bst_run_sensor sensors[BST_EXPORT_SENSORS], int *count) BST_MUST_CHECK;

#endif
