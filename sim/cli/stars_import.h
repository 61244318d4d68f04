/* boresight stars import: Tycho-2's archive, or a user's table, into a star catalogue. */
#ifndef BST_CLI_STARS_IMPORT_H
#define BST_CLI_STARS_IMPORT_H

#include <stdbool.h>

#include "boresight/status.h"
#include "sim/cli/options.h"

typedef struct bst_stars_import_request {
    const char *out, *subset, *base, *curves, *cone;
    double epoch_year, zero_point_mag, complete_to_v_mag; /* NAN: not given */
    bool help;
} bst_stars_import_request;

/* All defaults. */
bst_stars_import_request bst_stars_import_defaults(void);

extern const bst_option bst_stars_import_options[];

/* Imports `file`, whose first bytes say what it is, with progress on a terminal, and prints what
 * was made.
 *
 * Errors:    BST_ERR_ARGUMENT: an option that such a file does not take, or lacks; those of
 *            bst_star_install and bst_star_merge */
bst_status bst_stars_import(bst_ctx *ctx, const bst_stars_import_request *request,
                            const char *file) BST_MUST_CHECK;

#endif
