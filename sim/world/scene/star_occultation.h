/* Stars behind satellites that are rendered with their shape. */
#ifndef BST_WORLD_SCENE_STAR_OCCULTATION_H
#define BST_WORLD_SCENE_STAR_OCCULTATION_H

#include "sim/world/scene/source_body.h"

/* Work space, and the light curves of the stars of the latest call. All zero: empty. */
typedef struct bst_star_occultation {
    bst_satellite_pose *pose;      /* of the latest model */
    bst_scene_source_rate **rates; /* [rate_capacity], each NULL until it is used */
    int rate_count, rate_capacity;
    int *stars;            /* [star_capacity] candidates */
    unsigned char *hidden; /* [star_capacity][BST_STAR_OCCULTATION_TIMES] */
    int star_capacity;
} bst_star_occultation;

/* Times of an exposure at which silhouettes are compared, at most. */
enum { BST_STAR_OCCULTATION_TIMES = 191 };

/* Frees the memory and clears the struct, which belongs to the caller. */
void bst_star_occultation_free(bst_star_occultation *work);

/* Takes the light of stars away while a source with a body hides them.
 *
 * Given:     sources  [count] of an exposure, complete paths and bodies
 * Returned:  sources  stars that are hidden for a part of the exposure have a `rate` and less
 *                     electrons_per_s; those hidden all the time are `occulted`
 * Errors:    BST_ERR_MEMORY
 * Ownership: `work` holds the rates until the next call
 * Notes:     the silhouette is that of all facets in perspective at each time; curved parts have
 *            the outline of their facets. Up to BST_STAR_OCCULTATION_TIMES times are compared, more
 *            for more motion, and between two that differ the time of contact is found to 1e-6 of
 *            the exposure. What passes a star between two times is missed. Without a body nothing
 *            is done. */
bst_status bst_star_occultation_apply(bst_ctx *ctx, bst_star_occultation *work,
                                      bst_scene_source *sources, int count) BST_MUST_CHECK;

#endif
