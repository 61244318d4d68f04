/* Tables of a study: study.sqlite, and CSV files with the names of its tables. */
#ifndef BST_STUDIES_TABLES_H
#define BST_STUDIES_TABLES_H

#include "sim/studies/results.h"

/* Writes OUT/study.sqlite with
 *   about(key, value); tables, columns: what there is, with units
 *   scenarios(scenario, name, file); axes(axis, name, path, role, design, sweep)
 *   metrics(metric, unit, doc, kind)
 *   settings(setting, scenario, a column for each axis of the sweeps)
 *   runs(run, setting, replicate, run_number, scenario, status, error, a column for each axis, one
 *     for each metric)
 *   speed(run, wall_s, cpu_s): what differs from machine to machine, and is in no other table
 *   statistics(setting, metric, ...): of the settings' runs; setting NULL: of all runs. Settings of
 *     one run have none of their own
 *   the series of the kind: SERIES(run, ...) and SERIES_statistics(setting, ...)
 *   sensitivity(...): of designs one_at_a_time and morris (sim/studies/sensitivity.h), and
 *     speed_sensitivity of wall and processor time
 * and runs.csv, settings.csv, speed.csv, statistics.csv and so on. Numbers do not depend on who
 * executed the runs, in what order, and how often; runs without a row are left out. */
bst_status bst_study_write_tables(bst_ctx *ctx, bst_results *results,
                                  const char *out) BST_MUST_CHECK;

#endif
