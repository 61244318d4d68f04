#include "sim/analysis/camera/camera_psf.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/core/json_number.h"
#include "sim/io/fits_reader.h"
#include "sim/io/psf_fits.h"

enum { PARTS = BST_EFFECTIVE_PSF_PARTS, MOST_STARS = 4000 };
/* Noise beside a star: median deviation of the border of its pixels, and the share of read noise
 * that it has at least. */
static const double SIGMA_PER_MEDIAN_DEVIATION = 1.4826, LEAST_NOISE = 0.5;

/* Stars with their pixels. */
typedef struct gathered {
    bst_effective_psf_star *stars;
    float *pixels;
    int count;
} gathered;

/* Noise of the pixels at the border of a star's. */
static double border_noise(const float *pixels, int side) {
    double v[8 * 64 + 8];
    int n = 0;
    for (int k = 0; k < side * side; k++) {
        int i = k % side, j = k / side;
        if (i == 0 || j == 0 || i == side - 1 || j == side - 1) {
            v[n++] = (double)pixels[k];
        }
    }
    qsort(v, (size_t)n, sizeof *v, bst_compare_doubles);
    double middle = v[n / 2];
    for (int i = 0; i < n; i++) {
        v[i] = fabs(v[i] - middle);
    }
    qsort(v, (size_t)n, sizeof *v, bst_compare_doubles);
    return SIGMA_PER_MEDIAN_DEVIATION * v[n / 2];
}

/* Takes the pixels of a star from its frame; false: they are not all in it. */
static bool take_star(const bst_camera_psf_stars *s, int index, const bst_fits_read_frame *frame,
                      int half, gathered *to) {
    const bst_camera_fit_star *star = &s->stars[index];
    const bst_camera *c = s->camera;
    const int side = 2 * half + 1;
    const double x = star->x_px - s->window[2 * index], y = star->y_px - s->window[2 * index + 1];
    const int x0 = (int)lround(x) - half, y0 = (int)lround(y) - half;
    if (x0 < 0 || y0 < 0 || x0 + side > frame->width || y0 + side > frame->height) {
        return false;
    }
    float *pixels = to->pixels + (size_t)to->count * (size_t)side * (size_t)side;
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            size_t at = (size_t)(y0 + j) * (size_t)frame->width + (size_t)(x0 + i);
            pixels[j * side + i] = (float)(c->gain_e_per_dn * frame->pixels[at]);
        }
    }
    to->stars[to->count++] = (bst_effective_psf_star){
        .pixels = pixels,
        .x_px = x - x0 - half,
        .y_px = y - y0 - half,
        .field_x = star->x_px / fmax((double)c->width_px - 1.0, 1.0),
        .field_y = star->y_px / fmax((double)c->height_px - 1.0, 1.0),
        .noise_e = fmax(border_noise(pixels, side),
                        fmax(LEAST_NOISE * c->read_noise_e, 0.3 * c->gain_e_per_dn)),
        .part = (int)((uint64_t)star->id % PARTS)};
    return true;
}

/* Takes the pixels of the stars, evenly over the frames if there are more than are needed. */
static bst_status gather(bst_ctx *ctx, const bst_camera_psf_stars *s, int half, gathered *to) {
    const size_t side = 2 * (size_t)half + 1;
    int64_t candidates = 0, seen = 0, loaded = -1;
    for (int i = 0; i < s->count; i++) {
        candidates += s->fits_index[i] >= 0;
    }
    const int64_t room = candidates < MOST_STARS ? candidates : MOST_STARS;
    to->stars = calloc((size_t)room + 1, sizeof *to->stars);
    to->pixels = calloc(((size_t)room + 1) * side * side, sizeof *to->pixels);
    if (!to->stars || !to->pixels) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pixels of %d stars", (int)room);
    }
    bst_fits_reader *reader;
    BST_TRY(bst_fits_reader_open(ctx, s->frames, &reader));
    const bool cube = bst_fits_reader_info(reader)->cube;
    bst_fits_read_frame frame = {0};
    bst_status status = BST_OK;
    for (int i = 0; i < s->count && status == BST_OK; i++) {
        if (s->fits_index[i] < 0) {
            continue;
        }
        bool taken = (seen + 1) * room / candidates > seen * room / candidates;
        seen++;
        if (taken && s->fits_index[i] != loaded) {
            /* extensions count from 1, planes of a cube from 0 */
            status = bst_fits_reader_frame(ctx, reader, s->fits_index[i] - !cube, &frame);
            loaded = s->fits_index[i];
        }
        if (taken && status == BST_OK) {
            (void)take_star(s, i, &frame, half, to); /* one at the border is left out */
        }
    }
    bst_fits_reader_close(reader);
    return status;
}

bst_status bst_camera_psf_fit(bst_ctx *ctx, const bst_camera_psf_stars *stars,
                              const bst_effective_psf_options *options, bst_effective_psf *out) {
    assert(stars && stars->frames && stars->camera && options && out);
    gathered g = {.stars = NULL};
    *out = (bst_effective_psf){.side = 0};
    bst_status status = gather(ctx, stars, options->half_px, &g);
    if (status == BST_OK) {
        status = bst_effective_psf_fit(ctx, g.stars, g.count, options, out);
    }
    free(g.stars);
    free(g.pixels);
    return status;
}

/* ---------------------------------------------------------------- files */

/* A node: its PSF before the pixel, the same without parts of the stars, and figures of all; then
 * standard errors, and pooled ones. */
enum { PLANES = 1 + PARTS + 2 };
typedef struct node {
    double *plane[PLANES];
    bst_effective_psf_figures figures[1 + PARTS];
} node;

/* Value of a figure with its standard error. */
static void add_figure(cJSON *to, const char *key, const node *n, size_t offset) {
    double value[1 + PARTS];
    for (int p = 0; p <= PARTS; p++) {
        value[p] = *(const double *)(const void *)((const char *)&n->figures[p] + offset);
    }
    cJSON *one = cJSON_AddObjectToObject(to, key);
    bst_json_add_number(one, "value", value[0]);
    bst_json_add_number(one, "standard_error", bst_effective_psf_standard_error(value + 1));
}

static void report_node(cJSON *nodes, const node *n) {
    cJSON *one = cJSON_CreateObject();
    cJSON_AddItemToArray(nodes, one);
    add_figure(one, "xx_px2", n, offsetof(bst_effective_psf_figures, xx_px2));
    add_figure(one, "xy_px2", n, offsetof(bst_effective_psf_figures, xy_px2));
    add_figure(one, "yy_px2", n, offsetof(bst_effective_psf_figures, yy_px2));
    for (int r = 0; r < BST_EFFECTIVE_PSF_RADII; r++) {
        char key[64];
        snprintf(key, sizeof key, "encircled_%g_px", bst_effective_psf_radius_px[r]);
        add_figure(one, key, n,
                   offsetof(bst_effective_psf_figures, encircled) + (size_t)r * sizeof(double));
    }
}

/* Undoes the pixel of a node's samples, and measures them. Values that noise makes negative stay
 * so: without them the wings would have too much light. */
static bst_status make_node(bst_ctx *ctx, const bst_effective_psf *psf, size_t index, node *n,
                            float *value, float *sigma) {
    double *errors = n->plane[1 + PARTS], *pooled = n->plane[2 + PARTS];
    const size_t samples = (size_t)psf->side * (size_t)psf->side,
                 all = samples * (size_t)(psf->options.columns * psf->options.rows);
    for (size_t p = 0; p <= PARTS; p++) {
        const double *from = (p == 0 ? psf->value : psf->without + (p - 1) * all) + index * samples;
        BST_TRY(bst_effective_psf_undo_pixel(ctx, from, psf->side, n->plane[p]));
        n->figures[p] = bst_effective_psf_measure(n->plane[p], psf->side);
    }
    for (size_t k = 0; k < samples; k++) {
        double without[PARTS];
        for (int p = 0; p < PARTS; p++) {
            without[p] = n->plane[1 + p][k];
        }
        value[k] = (float)n->plane[0][k];
        errors[k] = bst_effective_psf_standard_error(without);
    }
    bst_effective_psf_pool_errors(errors, psf->side, pooled);
    for (size_t k = 0; k < samples; k++) {
        sigma[k] = (float)pooled[k];
    }
    return BST_OK;
}

static bst_status make_nodes(bst_ctx *ctx, const bst_effective_psf *psf, node *n, float *value,
                             float *sigma, cJSON *report) {
    const size_t samples = (size_t)psf->side * (size_t)psf->side;
    const int count = psf->options.columns * psf->options.rows;
    cJSON *root = cJSON_AddObjectToObject(report, "psf_file");
    cJSON_AddNumberToObject(root, "stars", psf->stars);
    cJSON_AddNumberToObject(root, "iterations", psf->iterations);
    cJSON_AddNumberToObject(root, "columns", psf->options.columns);
    cJSON_AddNumberToObject(root, "rows", psf->options.rows);
    cJSON_AddNumberToObject(root, "radius_px", psf->options.half_px);
    bst_json_add_number(root, "chi2_per_pixel", psf->chi_squared);
    bst_json_add_number(root, "form_error", psf->form_error);
    cJSON *nodes = cJSON_AddArrayToObject(root, "nodes");
    for (int i = 0; i < count; i++) {
        BST_TRY(make_node(ctx, psf, (size_t)i, n, value + (size_t)i * samples,
                          sigma + (size_t)i * samples));
        report_node(nodes, n);
    }
    return BST_OK;
}

bst_status bst_camera_psf_write(bst_ctx *ctx, const char *folder, const bst_effective_psf *psf,
                                cJSON *report) {
    assert(folder && psf && psf->value && report);
    const int count = psf->options.columns * psf->options.rows;
    const size_t samples = (size_t)psf->side * (size_t)psf->side;
    float *value = calloc(2 * samples * (size_t)count, sizeof *value);
    double *planes = calloc(samples * PLANES, sizeof *planes);
    node *n = calloc(1, sizeof *n);
    bst_status status = value && planes && n ? BST_OK
                                             : bst_fail(ctx, BST_ERR_MEMORY,
                                                        "no memory for a PSF of %d nodes", count);
    if (status == BST_OK) {
        float *sigma = value + samples * (size_t)count;
        for (size_t p = 0; p < PLANES; p++) {
            n->plane[p] = planes + p * samples;
        }
        status = make_nodes(ctx, psf, n, value, sigma, report);
        bst_psf_samples out = {value, psf->side, psf->side, count, BST_EFFECTIVE_PSF_OVERSAMPLING};
        char path[4096 + 32];
        if (status == BST_OK) {
            snprintf(path, sizeof path, "%.4000s/psf.fits", folder);
            status = bst_psf_fits_write(ctx, path, &out);
        }
        if (status == BST_OK) {
            snprintf(path, sizeof path, "%.4000s/psf_sigma.fits", folder);
            out.samples = sigma;
            status = bst_psf_fits_write(ctx, path, &out);
        }
    }
    free(value);
    free(planes);
    free(n);
    return status;
}
