/* Fills the truth message with the sources of a field query. */
#ifndef BST_WORLD_SCENE_TRUTH_LIST_H
#define BST_WORLD_SCENE_TRUTH_LIST_H

#include "sim/world/scene/shape_truth.h"

/* Work space, reused for every frame. All zero: empty. */
typedef struct bst_truth_list {
    struct bst_truth_pick *picks;
    int capacity;
    int *source_of; /* [room] */
    int room;
    bst_shape_truth shapes;
} bst_truth_list;

/* Frees the memory of a list and clears the struct, which belongs to the caller. */
void bst_truth_list_free(bst_truth_list *list);

/* Expected electrons of source `index` in its brightest sensor pixel, without background and before
 * vignetting. */
typedef double (*bst_truth_peak_fn)(const void *user, int index, const bst_truth_item *item);

typedef struct bst_truth_request {
    const bst_field *field; /* after its query */
    const bst_camera *camera;
    const bst_los_track *track;
    const bst_scene_source *sources;
    int count;
    bst_window window;
    int binning;
    bst_truth_peak_fn peak_e;
    bool peak_of_points; /* peak_e takes a shape for a point: it is lowered by peak_ratio */
    const void *user;
} bst_truth_request;

/* Fills items (room for `capacity`) and shapes of `truth` by bst_field_truth_item, after
 * bst_field_query has filled its header. Sources `outside` the window are left out. Flags sources
 * that saturate a pixel's well or, after binning, the converter. If there is no room for all,
 * objects and the brightest stars are kept in source order; truth->lost counts the others.
 * source_of (may be NULL): [capacity], the source index of each item. BST_ERR_MEMORY. */
bst_status bst_truth_list_fill(bst_ctx *ctx, bst_truth_list *list, const bst_truth_request *request,
                               bst_truth *truth, int capacity, int *source_of) BST_MUST_CHECK;

#endif
