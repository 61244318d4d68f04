/* The figures of a sensor as the manifest and the end of `run` show them. */
#ifndef BST_RUN_RUN_SUMMARY_H
#define BST_RUN_RUN_SUMMARY_H

#include "sim/run/run_scenario.h"

struct cJSON;

/* The sensor's summary for the manifest; the caller frees it. NULL without memory. */
struct cJSON *bst_run_summary_json(const bst_run_sensor_figures *figures, double real_time_factor);

/* A line of the table at the end of a run: "-" for what is not a number. */
void bst_run_print_row(const char *name, const char *format, double value, const char *unit);
/* The sensor's lines of that table. */
void bst_run_summary_print(const bst_run_sensor_figures *figures);

#endif
