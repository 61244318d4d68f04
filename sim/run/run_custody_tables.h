/* Tables of the custody of the catalogue: scores and rows of objects, and a figure of them. */
#ifndef BST_RUN_RUN_CUSTODY_TABLES_H
#define BST_RUN_RUN_CUSTODY_TABLES_H

#include "sim/io/run_store.h"

/* Creates the tables custody_tracks and custody in a run. Errors: those of bst_io_table_create */
bst_status bst_run_custody_tables_create(bst_ctx *ctx, bst_run *store, bst_io_table **tracks,
                                         bst_io_table **objects) BST_MUST_CHECK;

/* Tracks that updated an object. */
typedef struct bst_custody_score {
    int64_t updates, cross_tags; /* cross_tags: of these, of another object, or of none */
    double last_s;               /* last update; NAN: none */
    double chi2_sum;             /* of those that updated it themselves, not with a new orbit */
    int64_t chi2_count;
} bst_custody_score;

/* Adds a track that updated an object. */
void bst_custody_score_add(bst_custody_score *score, bool crossed, double chi2, double time_s);

/* An object at the end. */
typedef struct bst_custody_row {
    int64_t object, true_object; /* ids in truth; -1: NULL */
    const char *name;
    int64_t norad;
    double sigma_m, error_m, nees; /* NAN: NULL */
} bst_custody_row;

/* Writes an object's row to the table custody. Errors: those of bst_io_table_append */
bst_status bst_run_custody_add_object(bst_ctx *ctx, bst_io_table *table, const bst_custody_row *row,
                                      const bst_custody_score *score, double end_s) BST_MUST_CHECK;

/* Value at a share of a list, which is sorted; NAN: empty. */
double bst_custody_quantile(double *values, int count, double share);

#endif
