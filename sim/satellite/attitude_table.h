/* Attitudes of a satellite from a file: tables (CSV) and CCSDS AEM. */
#ifndef BST_SATELLITE_ATTITUDE_TABLE_H
#define BST_SATELLITE_ATTITUDE_TABLE_H

#include "sim/astro/aem.h"

/* Where attitudes from files come from. */
typedef struct bst_attitude_source {
    const char *base_dir; /* base of relative paths */
    bst_time epoch;       /* reference of all times */
    /* Attitudes of an object that a sensor's frame updates give; NULL: there are none. The caller
     * frees *rows. */
    bst_status (*frames)(bst_ctx *ctx, const void *user, const char *path, const char *object,
                         bst_attitude_row **rows, int *count);
    const void *user; /* of `frames` */
} bst_attitude_source;

/* Reads the attitudes of a file.
 *
 * Given:     source  base folder, epoch, frame updates
 *            file    path: CSV with columns time_s, qx, qy, qz, qw, CCSDS AEM (recognised by its
 *                    first line), or frame updates (.json)
 *            object  of an AEM or of frame updates; "": the only one
 * Returned:  *rows   [*count], at least one; seconds that do not descend
 * Errors:    BST_ERR_CONFIG with file, line and what is allowed; BST_ERR_MEMORY
 * Ownership: free *rows with free; NULL on error */
bst_status bst_attitude_table_load(bst_ctx *ctx, const bst_attitude_source *source,
                                   const char *file, const char *object, bst_attitude_row **rows,
                                   int *count) BST_MUST_CHECK;

/* Attitude at a time, by rotation at a constant rate between rows (slerp); held before the first
 * and after the last one.
 *
 * Given:     rows  [count], at least one */
bst_quat bst_attitude_table_at(const bst_attitude_row *rows, int count, double seconds);

/* Largest rate of rows within a minute of a time, rad/s. */
double bst_attitude_table_rate_radps(const bst_attitude_row *rows, int count, double seconds);

#endif
