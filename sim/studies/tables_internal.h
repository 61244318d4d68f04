/* Internal functions of the study tables. */
#ifndef BST_STUDIES_TABLES_INTERNAL_H
#define BST_STUDIES_TABLES_INTERNAL_H

#include "sim/studies/results.h"
#include "sim/studies/study_internal.h"
#include "sim/studies/table_out.h"

typedef struct bst_tables_job {
    bst_results *results;
    bst_tables_out *out;
    int metrics[BST_STUDY_METRICS]; /* selected metrics of the kind */
    int metric_count;
    bst_io_column *columns; /* scratch for one table */
    bst_io_value *row;
    bst_study_value *values;
    char **texts;
} bst_tables_job;

/* Description of the column of an axis. */
bst_io_column bst_study_axis_column(const bst_study_axis *axis);

/* Value of an axis in a run, as a cell of a table.
 *
 * Given:     axis  index of the axis
 *            base  index of the base scenario, for a value that is not varied
 * Returned:  *text  memory that the cell points to, or NULL; the caller frees it after use */
bst_io_value bst_study_axis_value(const bst_study *study, int axis, const bst_study_value *value,
                                  int base, char **text);

/* Writes the ranked sensitivity tables of designs one_at_a_time and morris, if the study has
 * any. */
bst_status bst_study_write_sensitivity(bst_ctx *ctx, const bst_tables_job *job) BST_MUST_CHECK;
/* Writes the series of the kind: per run, and over the runs of each setting. */
bst_status bst_study_write_series(bst_ctx *ctx, const bst_tables_job *job) BST_MUST_CHECK;

#endif
