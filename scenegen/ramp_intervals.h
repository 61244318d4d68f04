/* Intervals between the reads of a ramp: requests of their own, with the line of sight, the light
 * and the background of the interval. */
#ifndef BST_SCENEGEN_RAMP_INTERVALS_H
#define BST_SCENEGEN_RAMP_INTERVALS_H

#include "scenegen/renderer.h"

typedef struct bst_ramp_intervals bst_ramp_intervals;

/* Creates the work space.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_ramp_intervals_free */
bst_status bst_ramp_intervals_create(bst_ctx *ctx, bst_ramp_intervals **out) BST_MUST_CHECK;
/* Frees the work space; NULL is allowed. */
void bst_ramp_intervals_free(bst_ramp_intervals *intervals);

/* One of `count` equal parts of a request's exposure.
 *
 * Given:     request   stays valid while *part is used
 *            interval  0 to count - 1
 * Returned:  *part     valid until the next call; sources in the order of the request
 * Errors:    BST_ERR_MEMORY */
bst_status bst_ramp_interval(bst_ctx *ctx, bst_ramp_intervals *intervals,
                             const bst_render_request *request, int interval, int count,
                             bst_render_request *part) BST_MUST_CHECK;

#endif
