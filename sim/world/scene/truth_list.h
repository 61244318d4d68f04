/* The sources of a field query as the items of a truth message. */
#ifndef BST_WORLD_SCENE_TRUTH_LIST_H
#define BST_WORLD_SCENE_TRUTH_LIST_H

#include "sim/world/scene/field.h"

/* Work space, kept from frame to frame. All zero: empty. */
typedef struct bst_truth_list {
    struct bst_truth_pick *picks;
    int capacity;
} bst_truth_list;

/* Frees the memory of a list and clears the struct, which belongs to the caller. */
void bst_truth_list_free(bst_truth_list *list);

/* Expected electrons of source `index` (of those queried) in its brightest sensor pixel, without
 * background and before vignetting. */
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
    const void *user;
} bst_truth_request;

/* Fills the items of `truth` (room for `capacity`), whose header bst_field_query has filled, by
 * bst_field_truth_item; flags those whose brightest pixel fills its well, or the converter once
 * pixels are added. Where there is no room for all, the objects and the brightest stars stay, in
 * the order of the sources; the others are counted in truth->lost. source_of (may be NULL):
 * [capacity], the source of each item. BST_ERR_MEMORY. */
bst_status bst_truth_list_fill(bst_ctx *ctx, bst_truth_list *list, const bst_truth_request *request,
                               bst_truth *truth, int capacity, int *source_of) BST_MUST_CHECK;

#endif
