/* The objects of the onboard catalogue near a field, for identities of tracks. */
#ifndef BST_TRACKER_CATALOGUE_H
#define BST_TRACKER_CATALOGUE_H

#include "sim/onboard/knowledge.h"
#include "tracker/tracker.h"

typedef struct bst_tracker_catalogue bst_tracker_catalogue;

/* Creates the catalogue's user; knowledge and view must outlive it. The caller frees it.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_tracker_catalogue_create(bst_ctx *ctx, const bst_tracker_config *config,
                                        const bst_knowledge *knowledge, bst_knowledge_view *view,
                                        bst_tracker_catalogue **out) BST_MUST_CHECK;
/* Frees it; NULL is allowed. */
void bst_tracker_catalogue_free(bst_tracker_catalogue *catalogue);

/* Sets the time of the next search, s since the epoch, and the 1 sigma of its clock.
 *
 * Returned:  index of the cue's object, which searches leave out; negative: none */
int32_t bst_tracker_catalogue_set(bst_tracker_catalogue *catalogue, double seconds,
                                  double clock_sigma_s);

/* Finds objects: a bst_tracker_near_fn whose user is the catalogue. Left out are the spacecraft
 * itself, objects behind the Earth, in its umbra, and those without an orbit. */
int bst_tracker_catalogue_near(void *user, const bst_tracker_search *search,
                               bst_identity_object *out, int room, int *left_out);
/* Predicts one object at the time that was set: a bst_tracker_sight_fn whose user is the
 * catalogue. */
bool bst_tracker_catalogue_sight(void *user, int32_t object, bst_clock_sight *out);
/* True if a search since the time was set found no place of the spacecraft. */
bool bst_tracker_catalogue_failed(const bst_tracker_catalogue *catalogue);

#endif
