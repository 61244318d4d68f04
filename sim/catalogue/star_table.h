/* Reads stars from a user's table: CSV and ECSV text, plain or gzipped, and FITS binary tables, as
 * Gaia's archive and VizieR deliver them. */
#ifndef BST_CATALOGUE_STAR_TABLE_H
#define BST_CATALOGUE_STAR_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_star_table_options {
    double epoch_year; /* Julian year of tables without a column of epochs; NAN: not known */
    double
        zero_point_mag; /* V of a star of 1 electron/s, for tables of electrons; NAN: not known */
} bst_star_table_options;

/* A star of a table. */
typedef struct bst_star_table_row {
    int64_t source;                          /* the table's identity; 0: none */
    double ra_deg, dec_deg;                  /* ICRS, at the epoch */
    double epoch_year;                       /* Julian year */
    double pm_ra_cosdec_masyr, pm_dec_masyr; /* 0 where unknown */
    bool has_motion;                         /* false: unknown */
    double v_mag, b_minus_v;                 /* Johnson; b_minus_v NAN: unknown */
    double parallax_mas;                     /* 0: unknown, or measured below 0 */
    double period_d;                         /* 0: not periodic, or unknown */
    double amplitude_mag;                    /* faintest less brightest; 0: unknown */
    double maximum_jd;                       /* a time of maximum light, or of phase 0 */
} bst_star_table_row;

typedef struct bst_star_table bst_star_table;

/* Opens a table and finds its columns by their names (bst_star_table_columns), in any case.
 *
 * Notes:     V and B-V come from Gaia's G, BP and RP by Riello et al. (2021, A&A 649, A3, tables
 *            C.1 and C.2, in Gaia EDR3's documentation 5.5.1), within their ranges of BP-RP
 * Errors:    BST_ERR_FORMAT: no such table, or a column is missing that is needed;
 *            BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_star_table_open(bst_ctx *ctx, const char *path,
                               const bst_star_table_options *options,
                               bst_star_table **out) BST_MUST_CHECK;

/* Reads the next star that has a position and a magnitude.
 *
 * Returned:  *end  true: there is none, *row is unset
 * Errors:    BST_ERR_FORMAT with file, line or row, column and value */
bst_status bst_star_table_next(bst_ctx *ctx, bst_star_table *table, bst_star_table_row *row,
                               bool *end) BST_MUST_CHECK;

/* Rows read so far, and those of them without position or magnitude. */
void bst_star_table_counts(const bst_star_table *table, int64_t *rows, int64_t *skipped);

/* Closes a table; NULL is allowed. */
void bst_star_table_close(bst_star_table *table);

#endif
