/* The files of the page in one HTML file that opens without a server. */
#ifndef BST_VIEW_PAGE_BUNDLE_H
#define BST_VIEW_PAGE_BUNDLE_H

#include <stdio.h>

#include "view/recorded_run.h"

/* Writes index.html up to the end of its body, with styles, pictures and modules in it. Modules
 * import each other by an import map of data: addresses; module api.js is replaced by
 * recorded_api.js. The content security policy allows only these scripts, and no connection.
 *
 * Given:     nonce  of the file's own scripts and styles: letters and digits
 * Errors:    BST_ERR_MEMORY; those of the stream are left there */
bst_status bst_view_bundle_begin(bst_ctx *ctx, FILE *out, const char *nonce) BST_MUST_CHECK;

/* Writes an element with what the program answered to a request.
 *
 * Given:     key     route and query with its names in the order of the alphabet, for example
 *                    "frame?frame=3&sensor=0"
 *            packed  the answer, compressed as bst_view_bundle_pack does; width and height of
 * pixels
 */
void bst_view_bundle_add(FILE *out, const char *key, const bst_view_bytes *packed);

/* Writes the end of the file: the script that starts the page. */
void bst_view_bundle_end(FILE *out, const char *nonce);

/* Bytes that an element with a key of 40 bytes takes in the file. */
size_t bst_view_bundle_size(const bst_view_bytes *packed);

/* Compresses bytes (zlib, RFC 1950). Pixels (data->width > 0) are first split into their low and
 * high bytes.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free packed->data */
bst_status bst_view_bundle_pack(bst_ctx *ctx, const bst_view_bytes *data,
                                bst_view_bytes *packed) BST_MUST_CHECK;

#endif
