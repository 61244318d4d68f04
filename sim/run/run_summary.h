/* Figures of a sensor for manifest and terminal. */
#ifndef BST_RUN_RUN_SUMMARY_H
#define BST_RUN_RUN_SUMMARY_H

#include "sim/run/run_scenario.h"

struct cJSON;

/* Summary of a sensor for the manifest; the caller frees it. NULL: out of memory. */
struct cJSON *bst_run_summary_json(const bst_run_sensor_figures *figures, double real_time_factor);

/* Prints a line of the table of results; "-" for NAN. */
void bst_run_print_row(const char *name, const char *format, double value, const char *unit);
/* Prints the lines of a sensor. */
void bst_run_summary_print(const bst_run_sensor_figures *figures);

#endif
