/* Modules of the page inside an HTML file that opens without a server. */
#ifndef BST_VIEW_PAGE_MODULES_H
#define BST_VIEW_PAGE_MODULES_H

#include <stdio.h>

#include "boresight/status.h"
#include "view/page_files.h"

/* The embedded file of this name; NULL: there is none. */
const bst_view_page_file *bst_view_page_find(const char *name);

/* Writes the element with the content security policy: only scripts with the nonce and what they
 * import, styles with the nonce, pictures in the file; no connection, no form.
 *
 * Given:     nonce  letters and digits */
void bst_view_page_write_policy(FILE *out, const char *nonce);

/* Writes modules as an import map of data: addresses. A module imports others as './NAME.js' in
 * single quotes; these paths become names of the map.
 *
 * Given:     nonce  of the element
 *            names  of the modules, NULL at the end, closed under imports; NULL: all modules of the
 *                   viewer, with recorded_api.js in the place of api.js
 * Errors:    BST_ERR_MEMORY; those of the stream are left there */
bst_status bst_view_page_write_modules(bst_ctx *ctx, FILE *out, const char *nonce,
                                       const char *const *names) BST_MUST_CHECK;

/* Writes the script that starts a module of the import map. */
void bst_view_page_write_start(FILE *out, const char *nonce, const char *name);

#endif
