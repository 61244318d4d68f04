/* False alarms on the wings of bright sources. Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_WING_ALARMS_H
#define BST_OBSGEN_MODEL_WING_ALARMS_H

#include "obsgen/generator.h"

/* Draws noise detections that the wings of bright sources lift above the threshold.
 *
 * Errors:    BST_ERR_MEMORY
 * Notes:     Image processing subtracts the background of the mesh, to which the wings contribute
 *            too; see bst_local_sky_add_wings. */
bst_status bst_wing_alarms_draw(bst_ctx *ctx, bst_generator *generator) BST_MUST_CHECK;

#endif
