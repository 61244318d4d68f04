#include "imgproc/candidates.h"

#include <math.h>
#include <stdlib.h>

#include "imgproc/heapsort.h"

static const float SADDLE_SIGMA = 3.0f, SADDLE_SHARE = 0.15f;

bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height, bst_candidates *out) {
    size_t pixels = (size_t)max_width * (size_t)max_height;
    /* maxima of an 8-connected neighbourhood cannot be denser than one in four */
    *out = (bst_candidates){.capacity = ((max_width + 1) / 2) * ((max_height + 1) / 2)};
    out->pixel = calloc(pixels, sizeof *out->pixel);
    out->owner = calloc(pixels, sizeof *out->owner);
    out->items = calloc((size_t)out->capacity, sizeof *out->items);
    out->order = calloc((size_t)out->capacity, sizeof *out->order);
    out->parent = calloc((size_t)out->capacity, sizeof *out->parent);
    bst_status status = BST_OK;
    if (!out->pixel || !out->owner || !out->items || !out->order || !out->parent) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the candidates of a %d x %d frame",
                          max_width, max_height);
    } else {
        status = bst_cv_components_create(ctx, max_width, max_height, &out->components);
    }
    if (status != BST_OK) {
        bst_candidates_free(out);
    }
    return status;
}

void bst_candidates_free(bst_candidates *c) {
    bst_cv_components_free(c->components);
    free(c->pixel);
    free(c->owner);
    free(c->items);
    free(c->order);
    free(c->parent);
    *c = (bst_candidates){0};
}

static bool brighter_pixel(const void *context, int a, int b) {
    const float *map = context;
    return map[a] > map[b] || (map[a] == map[b] && a < b);
}

static bool brighter_candidate(const bst_candidate *a, const bst_candidate *b) {
    if (a->snr != b->snr) {
        return a->snr > b->snr;
    }
    return a->y != b->y ? a->y < b->y : a->x < b->x;
}

static int32_t root_of(bst_candidates *c, int32_t i) {
    while (c->parent[i] != i) {
        c->parent[i] = c->parent[c->parent[i]];
        i = c->parent[i];
    }
    return i;
}

/* Floods the component from its brightest pixel down; `first` is its first candidate. */
static void split_component(bst_candidates *c, const bst_filter *f, int pixels, int first) {
    int width = f->width, height = f->height;
    for (int k = 0; k < pixels; k++) {
        int p = c->pixel[k], x = p % width, y = p / width;
        float value = f->best[p];
        int32_t owner = -1;
        for (int dy = -1; dy <= 1; dy++) {
            for (int dx = -1; dx <= 1; dx++) {
                int nx = x + dx, ny = y + dy;
                if (nx < 0 || ny < 0 || nx >= width || ny >= height) {
                    continue;
                }
                int32_t other = c->owner[ny * width + nx] - 1;
                if (other < 0) {
                    continue;
                }
                other = root_of(c, other);
                if (owner < 0 || owner == other) {
                    owner = other;
                    continue;
                }
                int32_t high = owner, low = other;
                if (brighter_candidate(&c->items[low], &c->items[high])) {
                    high = other;
                    low = owner;
                }
                float peak = c->items[low].snr;
                if (peak - value < fmaxf(SADDLE_SIGMA, SADDLE_SHARE * peak)) {
                    c->parent[low] = high;
                    c->items[high].pixels += c->items[low].pixels;
                }
                owner = high;
            }
        }
        if (owner < 0) {
            owner = c->count++;
            c->items[owner] = (bst_candidate){x, y, value, 0};
            c->parent[owner] = owner;
        }
        c->items[owner].pixels++;
        c->owner[p] = owner + 1;
    }
    for (int k = 0; k < pixels; k++) {
        c->owner[c->pixel[k]] = 0;
    }
    /* keep the roots */
    int kept = first;
    for (int i = first; i < c->count; i++) {
        if (c->parent[i] == i) {
            c->items[kept++] = c->items[i];
        }
    }
    c->count = kept;
}

static bool before_candidate(const void *context, int a, int b) {
    const bst_candidate *items = context;
    return brighter_candidate(&items[a], &items[b]);
}

bst_status bst_candidates_find(bst_ctx *ctx, bst_candidates *c, const bst_filter *f) {
    c->count = 0;
    if (f->last_row < f->first_row) {
        return BST_OK;
    }
    const int32_t *labels;
    int stride, count, width = f->width;
    BST_TRY(bst_cv_components_label(ctx, c->components,
                                    f->mask + (size_t)f->first_row * (size_t)width, width,
                                    f->last_row - f->first_row + 1, &labels, &stride, &count));
    for (int label = 1; label < count; label++) {
        bst_cv_box box = bst_cv_components_box(c->components, label);
        int pixels = 0;
        for (int y = box.y; y < box.y + box.height; y++) {
            const int32_t *row = labels + (size_t)y * (size_t)stride;
            for (int x = box.x; x < box.x + box.width; x++) {
                if (row[x] == label) {
                    c->pixel[pixels++] = (y + f->first_row) * width + x;
                }
            }
        }
        bst_heapsort_indices(c->pixel, pixels, brighter_pixel, f->best);
        split_component(c, f, pixels, c->count);
    }
    for (int i = 0; i < c->count; i++) {
        c->order[i] = i;
    }
    bst_heapsort_indices(c->order, c->count, before_candidate, c->items);
    return BST_OK;
}
