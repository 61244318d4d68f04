/* Puts a star catalogue where the program looks for it, or imports one to another file. */
#ifndef BST_CATALOGUE_STAR_INSTALL_H
#define BST_CATALOGUE_STAR_INSTALL_H

#include <stdbool.h>

#include "sim/catalogue/star_import.h"

typedef struct bst_star_install_request {
    const char *tarball; /* tycho2_2.orig.tar.xz */
    const char *subset;  /* file that says which stars to keep; NULL: all */
    const char *out;     /* file to write; NULL: bst_stars_default_path, folders are made */
    bst_star_progress_fn progress;
    void *progress_user;
} bst_star_install_request;

/* Downloads the whole catalogue to bst_stars_default_path, unless it is there.
 *
 * Returned:  path      file of the catalogue
 *            *already  true if nothing had to be done
 * Errors:    those of bst_stars_default_path and bst_star_fetch */
bst_status bst_star_install_fetched(bst_ctx *ctx, bst_star_progress_fn progress,
                                    void *progress_user, char *path, size_t path_bytes,
                                    bool *already) BST_MUST_CHECK;

/* Imports a tarball.
 *
 * Returned:  path         file that was written to; only set if request->out is NULL
 *            *stars       number of stars in it
 * Errors:    those of bst_star_subset_read, bst_stars_default_path, bst_folder_make_above and
 *            bst_star_import_tarball */
bst_status bst_star_install(bst_ctx *ctx, const bst_star_install_request *request, char *path,
                            size_t path_bytes, long long *stars) BST_MUST_CHECK;

#endif
