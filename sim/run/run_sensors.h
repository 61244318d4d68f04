/* The sensors of a recorded run, from its tables. */
#ifndef BST_RUN_RUN_SENSORS_H
#define BST_RUN_RUN_SENSORS_H

#include "sim/io/run_reader.h"

/* A sensor of a recorded run. */
typedef struct bst_run_sensor {
    int64_t index; /* row of the table sensors */
    char observer[80], name[80];
    char target[80]; /* "": none */
    char file[256];  /* FITS file of its frames; "": none */
} bst_run_sensor;

enum { BST_EXPORT_SENSORS = 64 };

/* Finds the requested sensors. BST_ERR_NOT_FOUND: no such name; the message lists the sensors. A
 * run without readable tables has one sensor with the file frames.fits. */
bst_status bst_run_sensors(bst_ctx *ctx, const bst_run_reader *run, const char *sensor,
                           bst_run_sensor sensors[BST_EXPORT_SENSORS], int *count) BST_MUST_CHECK;

#endif
