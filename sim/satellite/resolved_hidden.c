/* Poses of which something nearer, such as the Earth, hides a part. */
#include "sim/satellite/polygon_cut.h"
#include "sim/satellite/resolved_faces.h"

/* Part of a cell from which all of it is hidden. */
static const double FULL = 0.9999;

/* Body number and nearness of what hides: no facet has them. */
enum { FRONT_BODY = INT32_MAX };
#define FRONT_M 1e30F

void bst_resolved_set_hidden(bst_resolved_adding *a) {
    const bst_resolved_hidden *h = a->view->hidden;
    const bst_resolved_image *m = &a->r->image;
    a->hidden_count = h ? h->count : 0;
    for (int i = 0; i < a->hidden_count; i++) {
        a->hidden[i] =
            (bst_point2){h->corner[i].x / m->cell_px - m->x0, h->corner[i].y / m->cell_px - m->y0};
    }
}

static bool is_full(const bst_coverage_cell *c) {
    return c->count == 0 || c->area >= FULL;
}

bst_status bst_resolved_reach_hidden(bst_ctx *ctx, const bst_resolved_adding *a) {
    bst_polygon_coverage *hidden = &a->r->hidden;
    bst_polygon_coverage_clear(hidden);
    if (a->hidden_count == 0) {
        return BST_OK;
    }
    BST_TRY(bst_polygon_coverage_add(ctx, hidden, a->hidden, a->hidden_count, a->r->image.width,
                                     a->r->image.height));
    for (int i = 0; i < hidden->count; i++) {
        const bst_coverage_cell *c = &hidden->cells[i];
        if (!is_full(c)) {
            bst_visible_surface_reach(&a->r->surface, c->x, c->y, -1);
        }
    }
    return BST_OK;
}

bst_status bst_resolved_hide(bst_ctx *ctx, const bst_resolved_adding *a) {
    const bst_polygon_coverage *hidden = &a->r->hidden;
    for (int i = 0; i < hidden->count; i++) {
        const bst_coverage_cell *c = &hidden->cells[i];
        if (is_full(c)) {
            for (int x = c->x; x < c->x + c->run; x++) {
                bst_visible_surface_clear(&a->r->surface, x, c->y);
            }
            continue;
        }
        const bst_surface_fragment front = {.near = {FRONT_M, 0.0F, 0.0F},
                                            .area = (float)c->area,
                                            .area_x = (float)c->moment_x,
                                            .area_y = (float)c->moment_y,
                                            .body = FRONT_BODY,
                                            .part = -1,
                                            .front = true};
        BST_TRY(bst_visible_surface_add(ctx, &a->r->surface, c->x, c->y, &front,
                                        hidden->corners + c->first, c->count));
    }
    return BST_OK;
}

bool bst_resolved_cut_hidden(const bst_resolved_adding *a, int facet, bool whole) {
    const bst_resolved_areas *s = &a->r->areas;
    bst_polygon_clip *clip = &a->r->areas.eye.clip;
    if (a->hidden_count == 0) {
        return whole;
    }
    bst_point2 p[BST_LAYERS_CORNERS_MAX];
    const int *corner = s->net.corner + s->net.first[facet];
    int count = s->net.first[facet + 1] - s->net.first[facet];
    for (int i = 0; i < count; i++) { /* corners are clockwise */
        p[i] = s->eye.at[corner[count - 1 - i]];
    }
    bst_polygon_place place = bst_polygon_place_of(p, count, a->hidden, a->hidden_count);
    if (place == BST_POLYGON_APART) {
        return whole;
    }
    if (place == BST_POLYGON_WITHIN) {
        clip->piece_count = 0;
        return false;
    }
    if (whole) {
        bst_polygon_clip_start(clip, p, count);
    }
    bst_polygon_clip_subtract(clip, a->hidden, a->hidden_count, false);
    return false;
}
