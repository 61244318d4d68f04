/* Margins and predicted pointing of all sensors of a scenario. */
#ifndef BST_ANALYSIS_LOOP_LOOP_SENSORS_H
#define BST_ANALYSIS_LOOP_LOOP_SENSORS_H

#include "sim/analysis/loop/loop_model.h"

/* Which sensors are analysed, and where the results go. */
typedef struct bst_loop_report_request {
    bst_loop_options loop;
    const char *sensor; /* "observer/sensor"; NULL: all */
    const char *plot;   /* file for the plot of the first sensor; NULL: none */
    const char *json;   /* file; "-": the standard output in place of the tables; NULL: none */
} bst_loop_report_request;

/* Analyses the loops of each sensor whose mount moves under command, prints their tables to stdout
 * and writes the files.
 *
 * Errors:    BST_ERR_NOT_FOUND: no such sensor, or none with such a mount; those of
 *            bst_loop_model_create and of writing the files */
bst_status bst_loop_report_sensors(bst_ctx *ctx, const bst_loop_report_request *request,
                                   const bst_scenario *scenario) BST_MUST_CHECK;

#endif
