/* What a run's folder holds. */
#ifndef BST_REPORT_REPORT_INFO_H
#define BST_REPORT_REPORT_INFO_H

#include <cjson/cJSON.h>
#include <stdbool.h>

#include "sim/io/run_reader.h"

/* Scenario, version, span of time, sensors, tables, summary figures, events, files and problems.
 * The caller frees it with cJSON_Delete. */
cJSON *bst_report_info(bst_run_reader *run);

/* Prints it for people; `columns`: those of the tables too. */
void bst_report_info_print(const bst_run_reader *run, const cJSON *info, bool columns);

#endif
