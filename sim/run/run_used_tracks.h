/* Ids of the tracks of a sensor that were used. */
#ifndef BST_RUN_RUN_USED_TRACKS_H
#define BST_RUN_RUN_USED_TRACKS_H

#include "boresight/archive.h"

/* A track that the tracker resumes has its old id and the detections that it had, so that its state
 * is no new observation. Initialise with zeros. */
typedef struct bst_run_used_tracks {
    int64_t *ids; /* [count], ascending */
    int count, room;
} bst_run_used_tracks;

/* True if the track of an id gave its observation. */
bool bst_run_used_tracks_has(const bst_run_used_tracks *used, int64_t id);

/* Adds an id that is not there yet.
 *
 * Errors:    BST_ERR_MEMORY; BST_ERR_STATE for more than 2^24 tracks */
bst_status bst_run_used_tracks_add(bst_ctx *ctx, bst_run_used_tracks *used,
                                   int64_t id) BST_MUST_CHECK;

/* Saves or restores the ids.
 *
 * Errors:    BST_ERR_MEMORY; BST_ERR_FORMAT: the saved state lacks some */
bst_status bst_run_used_tracks_archive(bst_run_used_tracks *used,
                                       bst_archive *archive) BST_MUST_CHECK;

/* Frees the ids. */
void bst_run_used_tracks_clear(bst_run_used_tracks *used);

#endif
