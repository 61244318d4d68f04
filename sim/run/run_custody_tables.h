/* Tables of the custody of the catalogue, and small functions of their figures. */
#ifndef BST_RUN_RUN_CUSTODY_TABLES_H
#define BST_RUN_RUN_CUSTODY_TABLES_H

#include <math.h>

#include "sim/io/run_store.h"

/* Creates the tables custody_tracks and custody in a run. Errors: those of bst_io_table_create */
bst_status bst_run_custody_tables_create(bst_ctx *ctx, bst_run *store, bst_io_table **tracks,
                                         bst_io_table **objects) BST_MUST_CHECK;

/* An integer of a row; NULL unless it is known. */
static inline bst_io_value bst_custody_whole_number(int64_t value, bool known) {
    return (bst_io_value){.type = BST_COLUMN_INT, .is_null = !known, .as.integer = value};
}

/* A number of a row; NULL if it is not finite. */
static inline bst_io_value bst_custody_number(double value) {
    bool known = isfinite(value);
    return (bst_io_value){.type = BST_COLUMN_REAL, .is_null = !known, .as.real = value};
}

/* Value at a share of a list, which is sorted; NAN: empty. */
double bst_custody_quantile(double *values, int count, double share);

#endif
