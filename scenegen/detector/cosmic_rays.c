#include "scenegen/detector/cosmic_rays.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

enum { MOST_HITS = 1000000, REACH = 20 };

struct bst_cosmic_rays {
    bst_detector_cosmic_ray_config config;
    int width, height, stride;
    bst_detector_edges_config overscan;
    bst_cosmic_rays_pixel *pixels;
    int count, capacity;
};

bst_status bst_cosmic_rays_create(bst_ctx *ctx, const bst_detector_cosmic_ray_config *config,
                                  int width, int height, int stride, bst_cosmic_rays **out) {
    assert(config && out && width > 0 && height > 0 && stride >= width);
    bst_cosmic_rays *h = calloc(1, sizeof *h);
    *out = h;
    if (!h) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for radiation hits");
    }
    h->config = *config;
    h->width = width;
    h->height = height;
    h->stride = stride;
    return BST_OK;
}

void bst_cosmic_rays_set_overscan(bst_cosmic_rays *hits, const bst_detector_edges_config *edges) {
    hits->overscan = *edges;
}

void bst_cosmic_rays_free(bst_cosmic_rays *hits) {
    if (hits) {
        free(hits->pixels);
        free(hits);
    }
}

/* Adds a charge deposit to a pixel. */
static bst_status add_pixel(bst_ctx *ctx, bst_cosmic_rays *h, int x, int y, double electrons) {
    if (x < h->overscan.left || y < h->overscan.bottom || x >= h->width - h->overscan.right ||
        y >= h->height - h->overscan.top || !(electrons > 0.0)) {
        return BST_OK;
    }
    if (h->count == h->capacity) {
        int capacity = h->capacity ? 2 * h->capacity : 1024;
        bst_cosmic_rays_pixel *more = realloc(h->pixels, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pixels of radiation hits");
        }
        h->pixels = more;
        h->capacity = capacity;
    }
    assert(h->count < h->capacity);
    h->pixels[h->count++] = (bst_cosmic_rays_pixel){y * h->stride + x, (float)electrons};
    return BST_OK;
}

/* Clips the parameter range [*t0, *t1] of p + t d to values between low and high; false if nothing
 * is left. */
static bool clip(double p, double d, double low, double high, double *t0, double *t1) {
    if (d == 0.0) {
        return p >= low && p < high;
    }
    double a = (low - p) / d, b = (high - p) / d;
    *t0 = fmax(*t0, fmin(a, b));
    *t1 = fmin(*t1, fmax(a, b));
    return *t0 < *t1;
}

/* Deposits the charge of a track from (x, y) along (dx, dy) px, uniform per length, in the pixels
 * it crosses (Amanatides and Woo, Eurographics 1987). Pixel n extends from n - 1/2 to n + 1/2. */
static bst_status add_track(bst_ctx *ctx, bst_cosmic_rays *h, double x, double y, double dx,
                            double dy, double electrons) {
    double t = 0.0, end = 1.0;
    if (!clip(x, dx, -0.5, h->width - 0.5, &t, &end) ||
        !clip(y, dy, -0.5, h->height - 0.5, &t, &end)) {
        return BST_OK;
    }
    /* the pixel just inside the sensor at which the track enters */
    double inside = fmin(1e-9, 0.5 * (end - t));
    int column = (int)floor(x + (t + inside) * dx + 0.5),
        row = (int)floor(y + (t + inside) * dy + 0.5);
    int step_x = dx > 0.0 ? 1 : -1, step_y = dy > 0.0 ? 1 : -1;
    while (t < end) {
        double to_x = dx != 0.0 ? (column + 0.5 * step_x - x) / dx : INFINITY;
        double to_y = dy != 0.0 ? (row + 0.5 * step_y - y) / dy : INFINITY;
        double next = fmin(fmin(to_x, to_y), end);
        BST_TRY(add_pixel(ctx, h, column, row, (next - t) * electrons));
        column += to_x <= to_y ? step_x : 0;
        row += to_y <= to_x ? step_y : 0;
        t = fmax(t, next);
    }
    return BST_OK;
}

/* qsort order by pixel index. */
static int by_index(const void *a, const void *b) {
    int p = ((const bst_cosmic_rays_pixel *)a)->index,
        q = ((const bst_cosmic_rays_pixel *)b)->index;
    return (p > q) - (p < q);
}

bst_status bst_cosmic_rays_draw(bst_ctx *ctx, bst_cosmic_rays *h, bst_rng_key key,
                                int64_t exposure_id, double collect_s,
                                const bst_cosmic_rays_pixel **pixels,
                                bst_cosmic_rays_summary *summary) {
    assert(h && pixels && summary && collect_s >= 0.0);
    const bst_detector_cosmic_ray_config *c = &h->config;
    h->count = 0;
    *summary = (bst_cosmic_rays_summary){0};
    /* tracks can enter beside the sensor, up to the length of most tracks */
    double reach = ceil(REACH * c->depth_um / c->pixel_pitch_um);
    double width = h->width + 2.0 * reach, height = h->height + 2.0 * reach;
    double pixel_cm2 = c->pixel_pitch_um * c->pixel_pitch_um * 1e-8;
    double expected = c->rate_per_cm2_s * pixel_cm2 * width * height * collect_s;
    if (expected > MOST_HITS) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "detector.cosmic_rays: %.3g hits are expected in one exposure; allowed are up to "
            "%d: lower rate_per_cm2_s or the exposure time",
            expected, MOST_HITS);
    }
    double arrival = 0.0;
    for (uint64_t i = 0;; i++) {
        uint64_t exposure = (uint64_t)exposure_id;
        arrival -= log(bst_rng_uniform(key, exposure, 8 * i));
        if (arrival > expected) {
            break;
        }
        double mu = sqrt(bst_rng_uniform(key, exposure, 8 * i + 1));
        double azimuth = 2.0 * BST_PI * bst_rng_uniform(key, exposure, 8 * i + 2);
        double x = width * bst_rng_uniform(key, exposure, 8 * i + 3) - reach - 0.5;
        double y = height * bst_rng_uniform(key, exposure, 8 * i + 4) - reach - 0.5;
        double z = bst_rng_normal(key, exposure, 8 * i + 5);
        double across = c->depth_um / c->pixel_pitch_um * sqrt(1.0 - mu * mu) / mu;
        double spread = 1.0 - c->straggling * log(z * z);
        double electrons = c->e_per_um * c->depth_um / mu * fmax(spread, 0.0);
        int before = h->count;
        BST_TRY(add_track(ctx, h, x, y, across * cos(azimuth), across * sin(azimuth), electrons));
        summary->tracks += h->count > before;
    }
    qsort(h->pixels, (size_t)h->count, sizeof *h->pixels, by_index);
    int kept = 0;
    for (int i = 0; i < h->count; i++) {
        summary->electrons += (double)h->pixels[i].electrons;
        if (kept > 0 && h->pixels[kept - 1].index == h->pixels[i].index) {
            h->pixels[kept - 1].electrons += h->pixels[i].electrons;
        } else {
            h->pixels[kept++] = h->pixels[i];
        }
    }
    h->count = kept;
    summary->pixels = kept;
    *pixels = h->pixels;
    return BST_OK;
}
