/* Results of a study: rows in memory, and shard files that contain them. */
#ifndef BST_STUDIES_RESULTS_H
#define BST_STUDIES_RESULTS_H

#include "sim/studies/kind.h"

typedef enum bst_row_state { BST_ROW_MISSING, BST_ROW_DONE, BST_ROW_FAILED } bst_row_state;

/* Error of a failed run. */
typedef struct bst_study_row_error {
    int64_t run;
    char *text;
} bst_study_row_error;

/* Series rows of one run. */
typedef struct bst_study_series_part {
    int64_t run;
    size_t first; /* index of the first row */
    int rows;
} bst_study_series_part;

typedef struct bst_results {
    const bst_study *study;
    const bst_study_kind *kind;
    uint8_t *state;  /* [runs], bst_row_state */
    double *metrics; /* [runs][metric_count] */
    double *wall_s;  /* [runs] */
    double *cpu_s;   /* [runs], of all threads */
    bst_study_row_error *errors;
    int64_t error_count, error_room;
    bst_study_series_part *parts;
    int64_t part_count, part_room;
    double *series; /* [series_rows][series_count] */
    size_t series_rows, series_room;
    int64_t done, failed; /* number of runs in these states */
    int64_t doubled;      /* rows loaded more than once */
    int64_t differing;    /* of these, rows that differ from the first */
} bst_results;

/* Removes the row of a run, which is then repeated. */
void bst_results_forget(bst_results *results, int64_t run);

/* Allocates empty results for all runs of a study.
 *
 * Given:     study, kind  must outlive the results
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_results_free */
bst_status bst_results_create(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                              bst_results *out) BST_MUST_CHECK;
/* Frees the memory of the results and clears the struct, which belongs to the caller. */
void bst_results_free(bst_results *results);

/* Error text of a failed run; NULL: not failed. */
const char *bst_results_error(const bst_results *results, int64_t run);
/* Sorts errors and series by run, after all files are loaded. */
void bst_results_sort(bst_results *results);

/* ------------------------------------------------------------------ files of shards */

/* Rows of a shard, before they are written. */
typedef struct bst_study_shard_draft {
    FILE *stream;
    char *text;
    size_t bytes;
    int64_t first, count;
    const bst_study_kind *kind;
} bst_study_shard_draft;

/* Begins the file of a shard in memory: writes its header.
 *
 * Given:     first  number of the shard's first run
 * Errors:    BST_ERR_MEMORY */
bst_status bst_study_shard_begin(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                                 int64_t first, bst_study_shard_draft *out) BST_MUST_CHECK;
/* Adds the row of the next run. `error`: NULL if it succeeded. */
void bst_study_shard_add(bst_study_shard_draft *draft, const bst_study_result *result,
                         double wall_s, const char *error);
/* Publishes the rows as OUT/shards/FIRST-LAST.rows: atomically, flushed, and only if no such file
 * exists. Without rows it does nothing. Frees the draft, also after an error. */
bst_status bst_study_shard_publish(bst_ctx *ctx, bst_study_shard_draft *draft,
                                   const char *out) BST_MUST_CHECK;
/* Frees a draft without writing it, and clears it. */
void bst_study_shard_drop(bst_study_shard_draft *draft);

/* Path of the shard file of runs first .. first + count - 1. */
bst_status bst_study_shard_path(bst_ctx *ctx, const char *out, int64_t first, int64_t count,
                                char *path, size_t bytes) BST_MUST_CHECK;
/* Loads the rows of a shard file; existing rows are kept. BST_ERR_NOT_FOUND; BST_ERR_FORMAT:
 * damaged, or rows of other runs; BST_ERR_STATE: of another study. */
bst_status bst_results_load(bst_ctx *ctx, bst_results *results, const char *path) BST_MUST_CHECK;
/* Loads all files of OUT/shards with runs of first .. first + count - 1. `clean`: removes drafts of
 * dead workers, and renames damaged files (bst_results_reject). */
bst_status bst_results_load_folder(bst_ctx *ctx, bst_results *results, const char *out,
                                   int64_t first, int64_t count, bool clean) BST_MUST_CHECK;
/* Renames a shard file to PATH.rejected, so that its runs can be repeated, and logs a warning that
 * begins with `why`. */
void bst_results_reject(bst_ctx *ctx, const char *path, const char *why);

#endif
