#include "sim/analysis/pd/pd_image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/psf_image.h"

enum {
    PER_PX = 16,
    REACH_PX = 12,
    POWER_REACH_PX = 7, /* light beyond this contributes less than 2e-4 to the sum of squares */
    PATH_PER_PX = 2,
    EXACT_PATH_PER_PX = 4,                  /* of shares at exact places */
    SIDE = 2 * PER_PX * (REACH_PX + 1) + 1, /* one more pixel for differences */
};

struct bst_pd_image {
    const bst_psf *psf;
    int room;      /* pixels per side of a stamp */
    double *table; /* [nodes][SIDE][SIDE] */
    double *share, *by_x, *by_y;
};

/* First pixel and size of a stamp. */
typedef struct stamp {
    int x0, y0, width, height;
} stamp;

bst_status bst_pd_image_create(bst_ctx *ctx, const bst_psf *psf, double longest_px,
                               bst_pd_image **out) {
    *out = NULL;
    bst_pd_image *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for images of targets");
    }
    int nodes = bst_psf_nodes(psf) / bst_psf_spectra(psf);
    size_t plane = (size_t)SIDE * SIDE;
    m->psf = psf;
    m->room = 2 * REACH_PX + 2 + (int)ceil(longest_px);
    size_t pixels = (size_t)m->room * (size_t)m->room;
    m->table = malloc((size_t)nodes * plane * sizeof *m->table);
    m->share = malloc(3 * pixels * sizeof *m->share);
    bst_status status = m->table && m->share
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for images of targets");
    for (int n = 0; n < nodes && status == BST_OK; n++) {
        status =
            bst_psf_image(ctx, psf, n, 0.0, PER_PX, REACH_PX + 1, m->table + (size_t)n * plane);
    }
    if (status != BST_OK) {
        bst_pd_image_free(m);
        return status;
    }
    m->by_x = m->share + pixels;
    m->by_y = m->by_x + pixels;
    *out = m;
    return BST_OK;
}

void bst_pd_image_free(bst_pd_image *m) {
    if (m) {
        free(m->table);
        free(m->share);
        free(m);
    }
}

/* PSF field nodes that are interpolated at a target's position. */
typedef struct mix {
    int count, node[4];
    double weight[4];
} mix;

/* Derivative along an axis by fourth-order central differences. */
static double slope(const double *at, int stride) {
    return (8.0 * (at[stride] - at[-stride]) - (at[2 * stride] - at[-2 * stride])) * PER_PX / 12.0;
}

/* Adds a part of the light at (x, y) relative to the stamp's first pixel. */
static void add_place(bst_pd_image *m, const stamp *s, const mix *nodes, double x, double y,
                      double weight, bool slopes) {
    int at_x = (int)lround(x * PER_PX), at_y = (int)lround(y * PER_PX);
    int middle = (SIDE - 1) / 2, reach = (slopes ? REACH_PX : POWER_REACH_PX) - 1;
    int first_x = (int)fmax(x - reach, 0.0), end_x = (int)fmin(x + reach + 1.0, s->width);
    int first_y = (int)fmax(y - reach, 0.0), end_y = (int)fmin(y + reach + 1.0, s->height);
    for (int j = first_y; j < end_y; j++) {
        int v = j * PER_PX - at_y;
        for (int i = first_x; i < end_x; i++) {
            int u = i * PER_PX - at_x, k = j * s->width + i;
            for (int n = 0; n < nodes->count; n++) {
                double w = weight * nodes->weight[n];
                const double *at = m->table + (size_t)nodes->node[n] * SIDE * SIDE +
                                   (size_t)(v + middle) * SIDE + (size_t)(u + middle);
                m->share[k] += w * at[0];
                if (slopes) {
                    /* derivative with respect to the source position: opposite sign */
                    m->by_x[k] -= w * slope(at, 1);
                    m->by_y[k] -= w * slope(at, SIDE);
                }
            }
        }
    }
}

/* Pixel fractions of a target and their derivatives; returns the number of pixels. */
static int draw(bst_pd_image *m, const bst_eval_match_target *place, bool slopes) {
    double half_x = 0.5 * fabs(place->dx_px) + REACH_PX;
    double half_y = 0.5 * fabs(place->dy_px) + REACH_PX;
    stamp s = {(int)ceil(place->x_px - half_x), (int)ceil(place->y_px - half_y), 0, 0};
    s.width = (int)floor(place->x_px + half_x) - s.x0 + 1;
    s.height = (int)floor(place->y_px + half_y) - s.y0 + 1;
    s.width = s.width < m->room ? s.width : m->room;
    s.height = s.height < m->room ? s.height : m->room;
    size_t bytes = (size_t)(s.width * s.height) * sizeof *m->share;
    memset(m->share, 0, bytes);
    memset(m->by_x, 0, bytes);
    memset(m->by_y, 0, bytes);
    mix nodes;
    nodes.count = bst_psf_weights(m->psf, place->x_px, place->y_px, nodes.node, nodes.weight);
    double length = hypot(place->dx_px, place->dy_px);
    int parts = length > 0.0 ? (int)ceil(length * PATH_PER_PX) : 1;
    for (int k = 0; k < parts; k++) {
        double u = (k + 0.5) / parts - 0.5;
        add_place(m, &s, &nodes, place->x_px + u * place->dx_px - s.x0,
                  place->y_px + u * place->dy_px - s.y0, 1.0 / parts, slopes);
    }
    return s.width * s.height;
}

void bst_pd_image_powers(bst_pd_image *m, const bst_eval_match_target *place, double out[2]) {
    int count = draw(m, place, false);
    out[0] = out[1] = 0.0;
    for (int i = 0; i < count; i++) {
        out[0] += m->share[i] * m->share[i];
        out[1] += m->share[i] * m->share[i] * m->share[i];
    }
}

bst_status bst_pd_image_bound(bst_ctx *ctx, bst_pd_image *m, const bst_eval_match_target *place,
                              double flux_e, const bst_eval_bound_noise *noise,
                              bst_location_bound *out) {
    int count = draw(m, place, true);
    const bst_location_image image = {m->share, m->by_x, m->by_y, count};
    return bst_location_bound_of(ctx, &image, flux_e, noise, out);
}

/* Weights of cubic Lagrange interpolation at t, 0 <= t < 1, from the samples -1, 0, 1 and 2. */
static void cubic_weights(double t, double out[4]) {
    out[0] = -t * (t - 1.0) * (t - 2.0) / 6.0;
    out[1] = 0.5 * (t + 1.0) * (t - 1.0) * (t - 2.0);
    out[2] = -0.5 * (t + 1.0) * t * (t - 2.0);
    out[3] = (t + 1.0) * t * (t - 1.0) / 6.0;
}

/* Adds a part of the light at (x, y) relative to the region's first pixel, from one table. */
static void add_exactly(const double *table, int width, int height, double x, double y,
                        double weight, double *share) {
    int cell_x = (int)floor(-x * PER_PX), cell_y = (int)floor(-y * PER_PX);
    int middle = (SIDE - 1) / 2, reach = REACH_PX - 1;
    double by_x[4], by_y[4];
    cubic_weights(-x * PER_PX - cell_x, by_x);
    cubic_weights(-y * PER_PX - cell_y, by_y);
    int first_x = (int)fmax(ceil(x - reach), 0.0), end_x = (int)fmin(x + reach + 1.0, width);
    int first_y = (int)fmax(ceil(y - reach), 0.0), end_y = (int)fmin(y + reach + 1.0, height);
    for (int j = first_y; j < end_y; j++) {
        for (int i = first_x; i < end_x; i++) {
            const double *at = table + (size_t)(middle + j * PER_PX + cell_y - 1) * SIDE +
                               (size_t)(middle + i * PER_PX + cell_x - 1);
            double sum = 0.0;
            for (int v = 0; v < 4; v++) {
                const double *row = at + (size_t)v * SIDE;
                sum += by_y[v] *
                       (by_x[0] * row[0] + by_x[1] * row[1] + by_x[2] * row[2] + by_x[3] * row[3]);
            }
            share[j * width + i] += weight * sum;
        }
    }
}

void bst_pd_image_shares(const bst_pd_image *m, const bst_eval_match_target *place, int x0, int y0,
                         int width, int height, double *share) {
    memset(share, 0, (size_t)width * (size_t)height * sizeof *share);
    mix nodes;
    nodes.count = bst_psf_weights(m->psf, place->x_px, place->y_px, nodes.node, nodes.weight);
    double length = hypot(place->dx_px, place->dy_px);
    int parts = length > 0.0 ? (int)ceil(length * EXACT_PATH_PER_PX) : 1;
    for (int k = 0; k < parts; k++) {
        double u = (k + 0.5) / parts - 0.5;
        for (int n = 0; n < nodes.count; n++) {
            add_exactly(m->table + (size_t)nodes.node[n] * SIDE * SIDE, width, height,
                        place->x_px + u * place->dx_px - x0, place->y_px + u * place->dy_px - y0,
                        nodes.weight[n] / parts, share);
        }
    }
}
