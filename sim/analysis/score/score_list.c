/* Lists of points and frames. */
#include <stdlib.h>

#include "sim/analysis/score/score_points.h"
#include "sim/eval/growing.h"

void bst_score_points_free(bst_score_points *points) {
    free(points->items);
    free(points->frames);
    *points = (bst_score_points){0};
}

int bst_score_key_compare(const bst_score_key *a, const bst_score_key *b) {
    return a->sequence != b->sequence ? (a->sequence > b->sequence ? 1 : -1)
                                      : (a->frame > b->frame) - (a->frame < b->frame);
}

bst_status bst_score_points_add_frame(bst_ctx *ctx, bst_score_points *p, bst_score_key key) {
    if (p->frame_count > 0 && bst_score_key_compare(&p->frames[p->frame_count - 1], &key) == 0) {
        return BST_OK;
    }
    void *frames = p->frames;
    BST_TRY(bst_grow(ctx, &frames, p->frame_count + 1, &p->frame_room, sizeof *p->frames));
    p->frames = frames;
    p->frames[p->frame_count++] = key;
    return BST_OK;
}

bst_status bst_score_points_add(bst_ctx *ctx, bst_score_points *p, const bst_score_point *point) {
    void *items = p->items;
    BST_TRY(bst_grow(ctx, &items, p->count + 1, &p->room, sizeof *p->items));
    p->items = items;
    p->items[p->count++] = *point;
    return bst_score_points_add_frame(ctx, p, point->key);
}
