#include "sim/world/scene/shape_light.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Grid points across a large image, and taps of the kernel on each side. */
enum { ACROSS = 64, TAPS = 12 };

/* The grid: point (i, j) is at (x0 + i step, y0 + j step), px from the boresight. */
typedef struct grid {
    double x0, y0, step;
    int width, height;
} grid;

void bst_shape_light_free(bst_shape_light *work) {
    free(work->grid[0]);
    free(work->grid[1]);
    *work = (bst_shape_light){0};
}

static bst_status reserve(bst_ctx *ctx, bst_shape_light *w, int count) {
    if (count <= w->capacity) {
        return BST_OK;
    }
    bst_shape_light_free(w);
    w->grid[0] = malloc((size_t)count * sizeof(double));
    w->grid[1] = malloc((size_t)count * sizeof(double));
    w->capacity = w->grid[0] && w->grid[1] ? count : 0;
    return w->capacity > 0 ? BST_OK
                           : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light of a shape");
}

/* Light, centroid and second moments. */
static void find_moments(const bst_resolved_image *image, bst_shape_light_figures *out) {
    double sum = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (int i = 0; i < image->width * image->height; i++) {
        const bst_resolved_cell *c = &image->cells[i];
        double light = (double)c->light;
        if (light == 0.0) {
            continue;
        }
        double column = i % image->width + 0.5, row = i / image->width + 0.5;
        double mx = (double)c->moment_x, my = (double)c->moment_y;
        sum += light;
        x += light * column + mx;
        y += light * row + my;
        /* within a cell: as if its light were at its centroid */
        double cx = column + mx / light, cy = row + my / light;
        xx += light * cx * cx;
        xy += light * cx * cy;
        yy += light * cy * cy;
    }
    *out = (bst_shape_light_figures){.snr_ratio = 1.0, .filter_ratio = 1.0, .peak_ratio = 1.0};
    if (!(sum > 0.0)) {
        return;
    }
    double cell = image->cell_px;
    x /= sum;
    y /= sum;
    out->light = sum;
    out->x_px = (image->x0 + x) * cell;
    out->y_px = (image->y0 + y) * cell;
    out->xx = fmax(xx / sum - x * x, 0.0) * cell * cell;
    out->xy = (xy / sum - x * y) * cell * cell;
    out->yy = fmax(yy / sum - y * y, 0.0) * cell * cell;
}

/* Puts the light of all cells on the grid, each on the four points about it, per grid cell. */
static void spread(const bst_resolved_image *image, const grid *g, double light, double *out) {
    memset(out, 0, (size_t)g->width * (size_t)g->height * sizeof *out);
    double cell = image->cell_px;
    for (int i = 0; i < image->width * image->height; i++) {
        const bst_resolved_cell *c = &image->cells[i];
        double part = (double)c->light;
        if (part == 0.0) {
            continue;
        }
        double px = (image->x0 + i % image->width + 0.5 + (double)c->moment_x / part) * cell;
        double py = (image->y0 + i / image->width + 0.5 + (double)c->moment_y / part) * cell;
        double u = (px - g->x0) / g->step, v = (py - g->y0) / g->step;
        int a = (int)fmin(fmax(floor(u), 0.0), g->width - 2.0);
        int b = (int)fmin(fmax(floor(v), 0.0), g->height - 2.0);
        u -= a;
        v -= b;
        part /= light;
        double *at = &out[b * g->width + a];
        at[0] += part * (1.0 - u) * (1.0 - v);
        at[1] += part * u * (1.0 - v);
        at[g->width] += part * (1.0 - u) * v;
        at[g->width + 1] += part * u * v;
    }
}

/* Convolves the rows of a grid and writes its transpose. */
static void convolve_rows(const double *from, int width, int height, const double *kernel, int taps,
                          double *to) {
    for (int j = 0; j < height; j++) {
        for (int i = 0; i < width; i++) {
            double sum = 0.0;
            int first = i < taps ? -i : -taps, last = i + taps < width ? taps : width - 1 - i;
            for (int k = first; k <= last; k++) {
                sum += kernel[k < 0 ? -k : k] * from[j * width + i + k];
            }
            to[i * height + j] = sum;
        }
    }
}

/* Convolves grid[0] with a Gaussian of a variance, in squared steps; nothing if that is 0. */
static void convolve(bst_shape_light *w, const grid *g, double variance) {
    double kernel[TAPS + 1], sum = 0.0;
    int taps = (int)fmin(ceil(4.0 * sqrt(fmax(variance, 0.0))), TAPS);
    if (taps < 1) {
        return;
    }
    for (int k = 0; k <= taps; k++) {
        kernel[k] = exp(-0.5 * k * k / variance);
        sum += k > 0 ? 2.0 * kernel[k] : kernel[k];
    }
    for (int k = 0; k <= taps; k++) {
        kernel[k] /= sum;
    }
    convolve_rows(w->grid[0], g->width, g->height, kernel, taps, w->grid[1]);
    convolve_rows(w->grid[1], g->height, g->width, kernel, taps, w->grid[0]);
}

/* Factor of a maximum over its sample by a Gaussian through three samples. */
static double between_samples(double before, double at, double after) {
    if (!(before > 0.0) || !(after > 0.0)) {
        return 1.0;
    }
    double slope = 0.5 * log(after / before), bend = log(at * at / (before * after));
    return bend > 0.0 ? exp(0.5 * slope * slope / bend) : 1.0;
}

/* Largest value of a grid, interpolated. */
static double largest(const double *value, const grid *g) {
    int best = 0;
    for (int i = 0; i < g->width * g->height; i++) {
        best = value[i] > value[best] ? i : best;
    }
    int x = best % g->width, y = best / g->width;
    if (x < 1 || y < 1 || x > g->width - 2 || y > g->height - 2) {
        return value[best];
    }
    return value[best] * between_samples(value[best - 1], value[best], value[best + 1]) *
           between_samples(value[best - g->width], value[best], value[best + g->width]);
}

bst_status bst_shape_light_measure(bst_ctx *ctx, bst_shape_light *w,
                                   const bst_resolved_image *image, double sigma_px,
                                   bst_shape_light_figures *out) {
    assert(w && image && out && sigma_px > 0.0);
    find_moments(image, out);
    if (!(out->light > 0.0)) {
        return BST_OK;
    }
    double wide = image->width * image->cell_px, high = image->height * image->cell_px;
    grid g = {.step = fmax(0.5 * sigma_px, fmax(wide, high) / ACROSS)};
    double margin = 6.0 * sigma_px + 2.0 * g.step;
    g.x0 = image->x0 * image->cell_px - margin;
    g.y0 = image->y0 * image->cell_px - margin;
    g.width = (int)ceil((wide + 2.0 * margin) / g.step) + 1;
    g.height = (int)ceil((high + 2.0 * margin) / g.step) + 1;
    BST_TRY(reserve(ctx, w, g.width * g.height));
    spread(image, &g, out->light, w->grid[0]);
    /* the grid itself blurs by a sixth of a step squared */
    double sigma2 = sigma_px * sigma_px / (g.step * g.step), square = 0.0;
    convolve(w, &g, fmax(sigma2 - 1.0 / 6.0, 0.0));
    for (int i = 0; i < g.width * g.height; i++) {
        square += w->grid[0][i] * w->grid[0][i];
    }
    double peak = largest(w->grid[0], &g);
    convolve(w, &g, sigma2);
    double output = largest(w->grid[0], &g);
    /* of a point, per step squared: sum of squares and output 1 / (4 pi sigma^2), peak twice that
     */
    double point = 1.0 / (4.0 * BST_PI * sigma2);
    out->snr_ratio = sqrt(fmin(square / point, 1.0));
    out->peak_ratio = fmin(0.5 * peak / point, 1.0);
    out->filter_ratio = fmin(output / point, 1.0);
    return BST_OK;
}
