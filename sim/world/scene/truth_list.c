#include "sim/world/scene/truth_list.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* A source that competes for an item of the truth message. */
typedef struct bst_truth_pick {
    double rate;
    int index;
    bool object;
} pick;

void bst_truth_list_free(bst_truth_list *list) {
    free(list->picks);
    free(list->source_of);
    bst_shape_truth_free(&list->shapes);
    *list = (bst_truth_list){0};
}

static int objects_then_brightest(const void *a, const void *b) {
    const pick *p = a, *q = b;
    if (p->object != q->object) {
        return p->object ? -1 : 1;
    }
    return p->rate != q->rate ? (p->rate > q->rate ? -1 : 1)
                              : (p->index > q->index) - (p->index < q->index);
}

static int by_index(const void *a, const void *b) {
    int p = ((const pick *)a)->index, q = ((const pick *)b)->index;
    return (p > q) - (p < q);
}

/* Selects the sources of the truth message: those near the window; if it has no room for all of
 * them, objects, then the brightest stars. */
static bst_status pick_sources(bst_ctx *ctx, bst_truth_list *list, const bst_scene_source *sources,
                               int count, int capacity) {
    if (count > list->capacity) {
        pick *more = realloc(list->picks, 2 * (size_t)count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the truth of %d sources", count);
        }
        list->picks = more;
        list->capacity = 2 * count;
    }
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (!sources[i].outside) {
            list->picks[n++] =
                (pick){sources[i].electrons_per_s, i, sources[i].kind == BST_SOURCE_OBJECT};
        }
    }
    if (n > capacity) {
        qsort(list->picks, (size_t)n, sizeof *list->picks, objects_then_brightest);
        qsort(list->picks, (size_t)capacity, sizeof *list->picks, by_index);
    }
    return BST_OK;
}

/* Ratio of light in the brightest binned pixel and in the brightest sensor pixel. A streak counts
 * as a Gaussian with its variance. */
static double binned_share(const bst_camera *camera, int binning, const bst_truth_item *item) {
    if (binning < 2) {
        return 1.0;
    }
    double psf = bst_camera_psf_sigma_px(camera), share = 1.0;
    const double way[2] = {item->x_end_px - item->x_start_px, item->y_end_px - item->y_start_px};
    for (int i = 0; i < 2; i++) {
        double spread = isfinite(way[i]) ? way[i] * way[i] / 12.0 : 0.0;
        double half = 0.5 / sqrt(2.0 * (psf * psf + spread));
        share *= erf(binning * half) / erf(half);
    }
    return share;
}

/* Makes room for the source indices of a truth message. */
static bst_status reserve_indices(bst_ctx *ctx, bst_truth_list *list, int count) {
    if (count > list->room) {
        int *more = realloc(list->source_of, 2 * (size_t)count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the truth of %d sources", count);
        }
        list->source_of = more;
        list->room = 2 * count;
    }
    return BST_OK;
}

/* Flags the items that saturate a pixel's well or the converter. */
static void flag_saturated(const bst_truth_list *list, const bst_truth_request *q,
                           bst_truth *truth) {
    const bst_camera *camera = q->camera;
    double top_e = ((double)((1 << camera->bits) - 1) - camera->offset_dn) * camera->gain_e_per_dn;
    int binning = q->binning > 1 ? q->binning : 1, added = binning * binning, shape = 0;
    for (int i = 0; i < truth->count; i++) {
        bst_truth_item *item = &truth->items[i];
        double x = item->x_chief_px, y = item->y_chief_px;
        double light = isfinite(x) ? bst_camera_illumination(camera, x, y) : 1.0;
        double dark_e = truth->dark_e + bst_field_background_e(q->field, truth, x, y);
        double peak_e = light * q->peak_e(q->user, list->source_of[i], item);
        while (shape < truth->shape_count && truth->shapes[shape].item < i) {
            shape++;
        }
        if (q->peak_of_points && shape < truth->shape_count && truth->shapes[shape].item == i) {
            peak_e *= truth->shapes[shape].peak_ratio;
        }
        /* wells saturate before binning, the converter after it */
        if (peak_e >= bst_camera_full_e(camera) - dark_e ||
            peak_e * binned_share(camera, binning, item) >= top_e - added * dark_e) {
            item->flags |= BST_TRUTH_SATURATED;
        }
    }
}

bst_status bst_truth_list_fill(bst_ctx *ctx, bst_truth_list *list, const bst_truth_request *q,
                               bst_truth *truth, int capacity, int *source_of) {
    assert(list && q && truth && capacity >= 0 && q->count >= 0);
    assert(q->sources || q->count == 0);
    int near = 0;
    for (int i = 0; i < q->count; i++) {
        near += !q->sources[i].outside;
    }
    truth->count = near < capacity ? near : capacity;
    truth->lost = near - truth->count;
    bool all = truth->count == q->count;
    if (!all) {
        BST_TRY(pick_sources(ctx, list, q->sources, q->count, capacity));
    }
    BST_TRY(reserve_indices(ctx, list, truth->count));
    int binning = q->binning > 1 ? q->binning : 1;
    for (int i = 0; i < truth->count; i++) {
        int k = all ? i : list->picks[i].index;
        bst_field_truth_item(q->field, q->track, &q->sources[k], q->window, binning, truth,
                             &truth->items[i]);
        list->source_of[i] = k;
        if (source_of) {
            source_of[i] = k;
        }
    }
    BST_TRY(
        bst_shape_truth_fill(ctx, &list->shapes, q->camera, q->sources, list->source_of, truth));
    flag_saturated(list, q, truth);
    return BST_OK;
}
