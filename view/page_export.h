/* One HTML file of a run: the viewer's page with the data in it, for `boresight export --page`. */
#ifndef BST_VIEW_PAGE_EXPORT_H
#define BST_VIEW_PAGE_EXPORT_H

#include <stdint.h>

#include "boresight/status.h"

#define BST_VIEW_PAGE_LIMIT_MB 20.0

/* What is written. */
typedef struct bst_view_page_request {
    const char *run;            /* its folder */
    const char *file;           /* the page */
    int64_t first, last, every; /* exposures: numbers of the first and last one, and every N-th */
    int64_t longest_side; /* of frames, px: larger ones are binned; 0: BST_VIEW_PAGE_SIDE_PX */
    double limit_bytes;   /* of the file */
} bst_view_page_request;

enum { BST_VIEW_PAGE_SIDE_PX = 640 };

/* Writes a page that needs no server and no network: frames whose pixels are binned (mean of n x
 * n), marks, reasons, plots, events and space. If the frames do not fit into the limit, every
 * second one of them is left out, until they do; what is left out stands on the page and is
 * printed. Paths of the run's folder are left out. The plots are of all exposures, as minimum and
 * maximum of each of their columns.
 *
 * Errors:    those of bst_view_run_open and of reading the run; BST_ERR_IO: the file cannot be
 *            written; BST_ERR_RANGE: the limit does not hold the page with a single frame of
 *            each sensor, or the run has no frame in the range; BST_ERR_INTERRUPTED */
bst_status bst_view_page_export(bst_ctx *ctx, const bst_view_page_request *request) BST_MUST_CHECK;

#endif
