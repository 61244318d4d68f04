/* Imports Tycho-2 (Hog et al. 2000, A&A 355, L27; byte format in the catalogue's ReadMe, CDS I/259)
 * into a star catalogue file. */
#ifndef BST_CATALOGUE_STAR_IMPORT_H
#define BST_CATALOGUE_STAR_IMPORT_H

#include <stdio.h>

#include "boresight/status.h"
#include "sim/catalogue/star_index.h"

#define BST_STAR_TYCHO2_COUNT 2557501LL /* main table and supplement 1 */
/* magnitude to which the catalogue has 98 % of all stars */
#define BST_STAR_TYCHO2_COMPLETE_V 11.0
#define BST_STAR_TYCHO2_SOURCE "Tycho-2"

/* Progress callback: current activity and amount done; total 0: unknown. */
typedef void (*bst_star_progress_fn)(void *user, const char *what, long long done, long long total);

/* Stars to keep: those to v_limit, and in each patch those to its own limit. */
typedef struct bst_star_subset {
    double v_limit; /* INFINITY keeps all */
    int patch_count;
    bst_star_patch patches[BST_STAR_PATCHES_MAX];
} bst_star_subset;

typedef struct bst_star_import_options {
    bst_star_subset subset;
    long long expected_rows;       /* an error unless this many rows are read; 0: any number */
    bst_star_progress_fn progress; /* may be NULL */
    void *progress_user;
} bst_star_import_options;

/* Import options: all stars, all 2,557,501 rows required, no progress callback. */
bst_star_import_options bst_star_import_all(void);

/* Reads a subset description: lines "sky V" (once) and "cone RA DEC RADIUS V" (degrees, ICRS); '#'
 * starts a comment. BST_ERR_FORMAT names file and line. */
bst_status bst_star_subset_read(bst_ctx *ctx, const char *path,
                                bst_star_subset *out) BST_MUST_CHECK;
/* Reads a subset description from memory; `name`: file name for messages. */
bst_status bst_star_subset_read_buffer(bst_ctx *ctx, const char *name, const char *data,
                                       size_t bytes, bst_star_subset *out) BST_MUST_CHECK;

/* Parses one row of Tycho-2 without its newline. Rows of 206 bytes are of the main table, of 122
 * bytes of supplement 1. Positions are brought to J2000: the main table's mean positions are there
 * already; a row without one (flag X) gives its observed position as it is; a double star's
 * component whose mean position is the pair's photocentre (flag P) gives its own observed position,
 * moved on by the pair's proper motion; supplement 1 gives J1991.25, moved on where the row has a
 * proper motion. A row with one of BT and VT only (and the supplement's Hp, taken as VT) is given
 * BT-VT = 0.7, a typical star's, and marked as without colour. BST_ERR_FORMAT says which bytes are
 * wrong. */
bst_status bst_star_parse_row(bst_ctx *ctx, const char *row, size_t bytes,
                              bst_star_values *out) BST_MUST_CHECK;

/* Reads rows until the end of `rows` and writes the catalogue to `out_path`, under a temporary name
 * that is renamed when complete. *stars_written may be NULL. */
bst_status bst_star_import_rows(bst_ctx *ctx, FILE *rows, const bst_star_import_options *options,
                                const char *out_path, long long *stars_written) BST_MUST_CHECK;

/* Imports rows from Debian's tycho2_2.orig.tar.xz, unpacked by tar and xz. */
bst_status bst_star_import_tarball(bst_ctx *ctx, const char *tarball_path,
                                   const bst_star_import_options *options, const char *out_path,
                                   long long *stars_written) BST_MUST_CHECK;

/* Writes a catalogue of given stars, under a temporary name that is renamed when complete.
 *
 * Given:     values, count  1 or more; a star of Tycho-2 stands in the sky cell that its identity
 *                           names; stars of a table (BST_STAR_TABLE_ID and more) are numbered anew
 *            complete       cap in which the catalogue is complete, and to which V
 * Errors:    BST_ERR_RANGE as bst_star_pack; BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_star_write(bst_ctx *ctx, const bst_star_values *values, size_t count,
                          const bst_star_patch *complete, const char *out_path) BST_MUST_CHECK;

#endif
