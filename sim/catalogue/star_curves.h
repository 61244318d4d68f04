/* Light curves of variable stars: a table beside a table of stars. */
#ifndef BST_CATALOGUE_STAR_CURVES_H
#define BST_CATALOGUE_STAR_CURVES_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_star_curve_row {
    int64_t source; /* identity of the star in the table of stars */
    double time;    /* phase from 0 to 1, or barycentric Julian date (TDB) */
    double mag;     /* V less that of the table of stars */
    int line;       /* of the file */
    bool used;      /* first point of a star: a row of the table has its light curve */
} bst_star_curve_row;

typedef struct bst_star_curves {
    bst_star_curve_row *rows; /* [count], by source, then by time */
    int count;
    bool by_phase;
} bst_star_curves;

/* Reads light curves from a CSV file with the columns source_id, delta_mag, and phase or time_jd.
 *
 * Errors:    BST_ERR_FORMAT with file, line, column and what is allowed: also for a star with one
 *            point only, or two at the same time; BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY
 * Ownership: free rows with bst_star_curves_free, also after an error */
bst_status bst_star_curves_read(bst_ctx *ctx, const char *path,
                                bst_star_curves *out) BST_MUST_CHECK;
/* Frees the rows. */
void bst_star_curves_free(bst_star_curves *curves);

/* The points of a star in ascending time; NULL, *count 0: it has none. */
const bst_star_curve_row *bst_star_curves_of(const bst_star_curves *curves, int64_t source,
                                             int *count);

#endif
