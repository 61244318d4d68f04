/* Ghosts of a field query: second images of bright sources. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_FIELD_GHOSTS_H
#define BST_WORLD_SCENE_FIELD_GHOSTS_H

#include "sim/world/scene/field_internal.h"

/* Sets the light of a ghost that counts, from the noise of the darkest pixel of the exposure. */
void bst_field_limit_ghosts(const bst_field *field, bst_field_scene *q, const bst_truth *truth);

/* Finds the objects that may have ghosts in the exposure (field->ghost_near). Errors:
 * BST_ERR_MEMORY, and those of the world's view. */
bst_status bst_field_near_ghosts(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                 int *count) BST_MUST_CHECK;

/* Adds the ghosts of stars and objects to the sources, between stars and objects.
 *
 * Given:     stars  number of stars, which are the first sources
 *            near   objects that may have ghosts
 *            parts  those of field->parts in use; there is room for `near` more
 *            count  of sources
 * Returned:  *count  with the ghosts
 * Notes:     a ghost counts if its light in a read-out pixel is above ghost_sigma sigma of a dark
 *            pixel while it rests. */
bst_status bst_field_add_ghosts(bst_ctx *ctx, bst_field *field, const bst_field_scene *q, int stars,
                                int near, int parts, int *count) BST_MUST_CHECK;

#endif
