/* Makes a star catalogue of a user's table, with the stars of another catalogue. */
#ifndef BST_CATALOGUE_STAR_MERGE_H
#define BST_CATALOGUE_STAR_MERGE_H

#include "sim/catalogue/star_import.h"
#include "sim/catalogue/star_table.h"

typedef struct bst_star_merge_request {
    const char *table; /* see bst_star_table_open */
    bst_star_table_options options;
    const char *curves;            /* see bst_star_curves_read; NULL: none */
    const char *base;              /* catalogue to add to, as in bst_stars_open; NULL: none */
    double complete_to_v_mag;      /* of the table; NAN: it makes nothing complete */
    bool has_cone;                 /* complete within `cone` only, else over the whole sky */
    bst_star_patch cone;           /* its magnitude is not used */
    const char *out;               /* file to write */
    bst_star_progress_fn progress; /* may be NULL */
    void *progress_user;
} bst_star_merge_request;

typedef struct bst_star_merge_counts {
    int64_t rows, skipped;         /* of the table; skipped: without position or magnitude */
    int64_t base;                  /* stars of the base */
    int64_t same;                  /* rows that are stars of the base */
    int64_t at_rest;               /* rows with a star but without a proper motion */
    int64_t written;               /* stars in all */
    int64_t parallaxes, variables; /* of them, with a parallax; variable */
    int64_t curves_left;           /* stars with a light curve that no row of the table has */
} bst_star_merge_counts;

/* Imports a table. A row is a star of the base if they are less than 1.5 arcsec apart at J2000 (or,
 * for a star of Tycho-2 without a proper motion, at 1991.5) and differ in V by at most 1.5 mag; of
 * several the nearest counts, and a row that a nearer one displaces takes the next. Such a star
 * keeps its identity and takes position, motion and magnitudes from the table, unless it is
 * brighter than V 4, where the base is kept. A row without a proper motion is compared at its own
 * epoch, and the base keeps position and motion.
 *
 * A row with a period and an amplitude, or with a light curve, makes a variable star, a bright one
 * also with the magnitude of the base. A star of the base keeps a parallax and a variability that
 * the table does not give.
 *
 * Notes:     Radial velocity is not used, as in bst_stars_query_seen
 * Errors:    those of bst_star_curves_read, bst_star_table_open, bst_star_table_next,
 * bst_stars_open and bst_star_list_write; BST_ERR_RANGE: a star does not fit into a record, or too
 * many */
bst_status bst_star_merge(bst_ctx *ctx, const bst_star_merge_request *request,
                          bst_star_merge_counts *counts) BST_MUST_CHECK;

#endif
