#include "imgproc/calibrate/pixel_evidence.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

bst_status bst_pixel_shows_create(bst_ctx *ctx, int capacity, bst_pixel_shows *out) {
    assert(out && capacity >= 0);
    *out = (bst_pixel_shows){.capacity = capacity};
    out->items = calloc((size_t)capacity + 1, sizeof *out->items);
    out->checks = calloc((size_t)capacity + 1, sizeof *out->checks);
    if (!out->items || !out->checks) {
        bst_pixel_shows_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the maxima of a frame, %d of them",
                        capacity);
    }
    return BST_OK;
}

void bst_pixel_shows_free(bst_pixel_shows *shows) {
    free(shows->items);
    free(shows->checks);
    *shows = (bst_pixel_shows){0};
}

/* A maximum from this SNR on is taken for light by the quick test alone, where that can tell. */
static const float CLEAR_SNR = 20.0f;

enum { CLUSTER_PX = 2 }; /* about a pixel with charge */

/* The highest of the pixels about a maximum: the filter's maximum may lie beside a hot pixel. */
static void find_highest(const bst_sharpness *s, const bst_locate_frame *f, int *x, int *y) {
    int x0 = *x, y0 = *y;
    double highest = -INFINITY;
    for (int v = y0 - 1; v <= y0 + 1; v++) {
        for (int u = x0 - 1; u <= x0 + 1; u++) {
            if (u < 0 || v < 0 || u >= f->width || v >= f->height) {
                continue;
            }
            double here =
                bst_sharpness_signal(s, f->signal[(size_t)v * (size_t)f->width + (size_t)u]);
            bool middle = u == x0 && v == y0;
            if (here > highest || (middle && here == highest)) {
                highest = here;
                *x = u;
                *y = v;
            }
        }
    }
}

/* What adding the maxima of a frame needs. */
typedef struct adder {
    bst_pixel_shows *shows;
    const bst_imgproc_locator *l;
    const bst_locate_frame *f;
    double noise_e; /* at the maximum */
} adder;

static void add(const adder *a, int x, int y, const bst_sharpness_test *sharp) {
    const bst_locate_frame *f = a->f;
    double to_corner = 0.5 * (f->binning - 1.0);
    int64_t u = llround(f->origin_x_px - to_corner + f->binning * x);
    int64_t v = llround(f->origin_y_px - to_corner + f->binning * y);
    if (a->shows->count < a->shows->capacity) {
        a->shows->items[a->shows->count++] =
            (bst_pixel_show){(int32_t)(v * f->camera->width_px + u), *sharp};
    }
}

static bool is_open(const adder *a, int x, int y) {
    return bst_sharpness_is_open(&a->l->sharpness, a->f->signal, a->f->width, a->f->height,
                                 (float)a->noise_e, x, y);
}

static bst_sharpness_test compare(const adder *a, int x, int y) {
    return bst_sharpness_compare(&a->l->sharpness, a->f->signal, a->f->width, a->f->height,
                                 a->noise_e, x, y);
}

/* The other pixels about one that holds charge that hold charge too: what the filter shows as one
 * maximum may be several defects. */
static void add_cluster(const adder *a, int x, int y) {
    for (int v = y - CLUSTER_PX; v <= y + CLUSTER_PX; v++) {
        for (int u = x - CLUSTER_PX; u <= x + CLUSTER_PX; u++) {
            bool inside = u >= 0 && v >= 0 && u < a->f->width && v < a->f->height;
            if (inside && (u != x || v != y) && is_open(a, u, v)) {
                bst_sharpness_test sharp = compare(a, u, v);
                if ((double)sharp.worst > BST_SHARP_DEVIATION) {
                    add(a, u, v, &sharp);
                }
            }
        }
    }
}

void bst_pixel_shows_add(bst_pixel_shows *shows, const bst_imgproc_locator *l,
                         const bst_locate_frame *f, const bst_candidates *candidates) {
    assert(shows && l && f && candidates && shows->count <= shows->capacity);
    adder a = {shows, l, f, 0.0};
    shows->maxima += candidates->count;
    for (int i = 0; i < candidates->count; i++) {
        int x = candidates->items[i].x, y = candidates->items[i].y;
        a.noise_e = bst_locate_noise_at(f, x, y);
        find_highest(&l->sharpness, f, &x, &y);
        float signal = f->signal[(size_t)y * (size_t)f->width + (size_t)x];
        if (candidates->items[i].snr > CLEAR_SNR && !is_open(&a, x, y) &&
            bst_sharpness_is_telling(&l->sharpness, signal, (float)a.noise_e)) {
            continue;
        }
        bst_sharpness_test sharp = compare(&a, x, y);
        add(&a, x, y, &sharp);
        if ((double)sharp.worst > BST_SHARP_DEVIATION) {
            add_cluster(&a, x, y);
        }
    }
}

static int by_pixel(const void *a, const void *b) {
    const bst_pixel_show *p = a, *q = b;
    return (p->pixel > q->pixel) - (p->pixel < q->pixel);
}

static int check_by_pixel(const void *a, const void *b) {
    const bst_pixel_check *p = a, *q = b;
    return (p->pixel > q->pixel) - (p->pixel < q->pixel);
}

void bst_pixel_shows_sort(bst_pixel_shows *shows) {
    int kept = 0;
    bool ordered = true;
    for (int i = 1; i < shows->count && ordered; i++) {
        ordered = shows->items[i - 1].pixel <= shows->items[i].pixel;
    }
    if (!ordered) {
        qsort(shows->items, (size_t)shows->count, sizeof shows->items[0], by_pixel);
    }
    for (int i = 0; i < shows->count; i++) {
        if (kept == 0 || shows->items[kept - 1].pixel != shows->items[i].pixel) {
            shows->items[kept++] = shows->items[i];
        }
    }
    shows->count = kept;
    ordered = true;
    for (int i = 1; i < shows->check_count && ordered; i++) {
        ordered = shows->checks[i - 1].pixel <= shows->checks[i].pixel;
    }
    if (!ordered) {
        qsort(shows->checks, (size_t)shows->check_count, sizeof shows->checks[0], check_by_pixel);
    }
}

const bst_pixel_show *bst_pixel_shows_find(const bst_pixel_shows *shows, int32_t pixel) {
    bst_pixel_show key = {.pixel = pixel};
    return bsearch(&key, shows->items, (size_t)shows->count, sizeof key, by_pixel);
}
