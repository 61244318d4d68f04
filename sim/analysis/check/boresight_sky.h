/* Sky background at the boresight of a camera, without a simulation. */
#ifndef BST_ANALYSIS_CHECK_BORESIGHT_SKY_H
#define BST_ANALYSIS_CHECK_BORESIGHT_SKY_H

#include "sim/world/world.h"

/* Work space of one camera; for one thread. */
typedef struct bst_boresight_sky bst_boresight_sky;

/* Creates the sky at the boresight of a sensor's camera.
 *
 * Given:     world, view       must outlive it
 *            observer, sensor  indices in the world
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_boresight_sky_free */
bst_status bst_boresight_sky_create(bst_ctx *ctx, const bst_world *world, bst_world_view *view,
                                    int observer, int sensor,
                                    bst_boresight_sky **out) BST_MUST_CHECK;
void bst_boresight_sky_free(bst_boresight_sky *sky); /* NULL allowed */

/* Background of the pixel at the boresight, as frames are rendered: sky, stray light, the discs of
 * bright bodies and the Earth's limb glow; without dark current.
 *
 * Given:     seconds     mid-exposure, since the epoch
 *            direction   of the boresight, unit, GCRF; at rest during the exposure
 *            exposure_s  more than 0
 * Returned:  *e  electrons in the exposure
 * Errors:    those of orbits; BST_ERR_MEMORY */
bst_status bst_boresight_sky_at(bst_ctx *ctx, bst_boresight_sky *sky, double seconds,
                                bst_vec3 direction, double exposure_s, double *e) BST_MUST_CHECK;

#endif
