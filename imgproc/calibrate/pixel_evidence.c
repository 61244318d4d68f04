#include "imgproc/calibrate/pixel_evidence.h"
#include "sim/core/pages.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

bst_status bst_pixel_shows_create(bst_ctx *ctx, int capacity, bst_pixel_shows *out) {
    assert(out && capacity >= 0);
    *out = (bst_pixel_shows){.capacity = capacity};
    out->items = bst_pages_zero((size_t)capacity + 1, sizeof *out->items);
    out->checks = bst_pages_zero((size_t)capacity + 1, sizeof *out->checks);
    if (!out->items || !out->checks) {
        bst_pixel_shows_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the maxima of a frame, %d of them",
                        capacity);
    }
    return BST_OK;
}

void bst_pixel_shows_free(bst_pixel_shows *shows) {
    bst_pages_free(shows->items);
    bst_pages_free(shows->checks);
    *shows = (bst_pixel_shows){0};
}

/* Above this SNR the quick test alone clears a maximum of being a defective pixel, where it has the
 * power to. */
static const float CLEAR_SNR = 20.0f;

/* half width of the neighbourhood of a defective pixel searched for others, px */
enum { CLUSTER_PX = 2 };

/* Moves (x, y) to the brightest of the 3 x 3 pixels: the matched filter's maximum may lie beside a
 * hot pixel. */
static void move_to_brightest_pixel(const bst_sharpness *s, const bst_locate_frame *f, int *x,
                                    int *y) {
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

/* Context for adding the maxima of a frame to the bad-pixel evidence. */
typedef struct adder {
    bst_pixel_shows *shows;
    const bst_imgproc_locator *l;
    const bst_locate_frame *f;
    double noise_e; /* of a pixel at the maximum, e- */
} adder;

/* Records a maximum at frame pixel (x, y) as evidence, in full-sensor coordinates. */
static void add_evidence(const adder *a, int x, int y, const bst_sharpness_test *sharp) {
    const bst_locate_frame *f = a->f;
    double to_corner = 0.5 * (f->binning - 1.0);
    int64_t u = llround(f->origin_x_px - to_corner + f->binning * x);
    int64_t v = llround(f->origin_y_px - to_corner + f->binning * y);
    if (a->shows->count < a->shows->capacity) {
        a->shows->items[a->shows->count++] =
            (bst_pixel_show){(int32_t)(v * f->camera->width_px + u), *sharp};
    }
}

/* True if the pixel's neighbours are too faint for the PSF: a single-pixel defect or cosmic ray. */
static bool is_open(const adder *a, int x, int y) {
    return bst_sharpness_is_open(&a->l->sharpness, a->f->signal, a->f->width, a->f->height,
                                 (float)a->noise_e, x, y);
}

/* Compares the 3 x 3 pixels at (x, y) with the PSF. */
static bst_sharpness_test compare(const adder *a, int x, int y) {
    return bst_sharpness_compare(&a->l->sharpness, a->f->signal, a->f->width, a->f->height,
                                 a->noise_e, x, y);
}

/* Adds sharp pixels near a defective one: one maximum of the matched filter may hide a cluster of
 * defects. */
static void add_defect_cluster(const adder *a, int x, int y) {
    for (int v = y - CLUSTER_PX; v <= y + CLUSTER_PX; v++) {
        for (int u = x - CLUSTER_PX; u <= x + CLUSTER_PX; u++) {
            bool inside = u >= 0 && v >= 0 && u < a->f->width && v < a->f->height;
            if (inside && (u != x || v != y) && is_open(a, u, v)) {
                bst_sharpness_test sharp = compare(a, u, v);
                if ((double)sharp.worst > BST_SHARP_DEVIATION) {
                    add_evidence(a, u, v, &sharp);
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
        move_to_brightest_pixel(&l->sharpness, f, &x, &y);
        float signal = f->signal[(size_t)y * (size_t)f->width + (size_t)x];
        if (candidates->items[i].snr > CLEAR_SNR && !is_open(&a, x, y) &&
            bst_sharpness_is_telling(&l->sharpness, signal, (float)a.noise_e)) {
            continue;
        }
        bst_sharpness_test sharp = compare(&a, x, y);
        add_evidence(&a, x, y, &sharp);
        if ((double)sharp.worst > BST_SHARP_DEVIATION) {
            add_defect_cluster(&a, x, y);
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
