/* OSPA(2) metric between the tracks of true objects and estimated tracks over a sliding window of
 * frames: it also counts changes of identity and breaks, which GOSPA of single frames does not
 * (Beard, Vo and Vo, IEEE Trans. Signal Processing 68, 2020). */
#ifndef BST_EVAL_OSPA2_H
#define BST_EVAL_OSPA2_H

#include <stdint.h>

#include "boresight/archive.h"
#include "sim/eval/gospa.h"

typedef struct bst_ospa2 bst_ospa2;

typedef struct bst_ospa2_params {
    int window;    /* frames of the window, 1 to 32 */
    double cutoff; /* in the unit of the distances */
    double order;
} bst_ospa2_params;

/* Creates the window.
 *
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY
 * Ownership: free with bst_ospa2_free */
bst_status bst_ospa2_create(bst_ctx *ctx, const bst_ospa2_params *params,
                            bst_ospa2 **out) BST_MUST_CHECK;
/* Frees the window; NULL is allowed. */
void bst_ospa2_free(bst_ospa2 *ospa2);

/* Saves or restores the window.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_ospa2_archive(bst_ospa2 *ospa2, bst_archive *archive) BST_MUST_CHECK;

/* A frame: visible objects, tracks, and the pairs of them nearer than the cutoff. */
typedef struct bst_ospa2_input {
    const int64_t *objects; /* [rows] identities of the visible objects */
    int rows;
    const int64_t *track_ids; /* [tracks] identities */
    int tracks;
    const bst_gospa_pair *pairs; /* [count] indices into objects and track_ids */
    int count;
} bst_ospa2_input;

/* Adds a frame and computes OSPA(2) over the latest `window` frames.
 *
 * Returned:  value  in the unit of the cutoff
 * Notes:     the distance of two tracks is the mean, over the frames of the window in which either
 *            exists, of min(distance, cutoff), with the cutoff where only one exists.
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY
 * Reference: Beard, Vo and Vo 2020, eq. 19 and 24 */
bst_status bst_ospa2_frame(bst_ctx *ctx, bst_ospa2 *ospa2, const bst_ospa2_input *frame,
                           double *value) BST_MUST_CHECK;

#endif
