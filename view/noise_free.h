/* Noise-free frames, from the planes that a run recorded beside its frames. */
#ifndef BST_VIEW_NOISE_FREE_H
#define BST_VIEW_NOISE_FREE_H

#include "view/recorded_run_internal.h"
#include "view/routes.h"

/* Adds the planes of light that a run has beside the frames of a sensor to its description:
 * "planes": names out of stars, targets, background. Call it with the lock held. */
void bst_view_add_planes(const bst_view_run *run, const bst_view_sensor *sensor, cJSON *out);

/* The route: the noise-free frame x->frame in digital numbers: the sum of the recorded planes
 * [electrons] over the gain, plus the offset, rounded, at most 65535.
 *
 * Returned:  x->bytes  [height][width] of uint16_t, rows as in the file
 * Errors:    BST_ERR_NOT_FOUND: no such frame, the run has no planes, or its frames no gain; those
 *            of bst_fits_source_open */
bst_status bst_view_route_noise_free(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
