/* Content of a run's folder, for `boresight info`. */
#ifndef BST_REPORT_REPORT_INFO_H
#define BST_REPORT_REPORT_INFO_H

#include <cjson/cJSON.h>
#include <stdbool.h>

#include "sim/io/run_reader.h"

/* Collects scenario, version, time span, sensors, tables, summary, events, files and problems as
 * JSON. The caller frees it with cJSON_Delete. */
cJSON *bst_report_info(bst_run_reader *run);

/* Prints the information as text; `columns`: including table columns. */
void bst_report_info_print(const bst_run_reader *run, const cJSON *info, bool columns);

#endif
