#include "imgproc/image.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { PARTS = 3, SIDE = BST_PSF_MAX_SIDE + BST_LANES };

bst_status bst_profiles_create(bst_ctx *ctx, const bst_known_psf *known, bst_profiles *out) {
    *out = (bst_profiles){.known = known, .binning = 1};
    int length = known ? bst_lanes_up(2 * known->reach_px + 1) : BST_PROFILE_LENGTH;
    size_t row = (size_t)(BST_PROFILE_PHASES + 1) * PARTS * (size_t)length;
    size_t terms = known ? (size_t)known->terms : 1, nodes = known ? (size_t)known->nodes : 1;
    out->rows = calloc(nodes * terms * row, sizeof(float));
    out->down = known ? calloc(terms * row, sizeof(float)) : NULL;
    if (!out->rows || (known && !out->down)) {
        bst_profiles_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for profiles");
    }
    return BST_OK;
}

void bst_profiles_free(bst_profiles *p) {
    free(p->rows);
    free(p->down);
    *p = (bst_profiles){0};
}

void bst_profiles_on(bst_profiles *p, double origin_x_px, double origin_y_px, int binning) {
    p->origin_x_px = origin_x_px;
    p->origin_y_px = origin_y_px;
    p->binning = binning;
}

void bst_profiles_set(bst_profiles *p, const bst_gauss *psf, double sigma_px) {
    if (p->known) {
        p->sigma_px = sigma_px;
        bst_profiles_set_known(p);
        return;
    }
    if (p->sigma_px == sigma_px) {
        return;
    }
    p->sigma_px = sigma_px;
    int half = (int)ceil(4.5 * sigma_px);
    half = half < BST_LANES / 2 - 1 ? BST_LANES / 2 - 1 : half;
    p->length = bst_lanes_up(2 * half + 1);
    p->length = p->length < BST_PROFILE_LENGTH ? p->length : BST_PROFILE_LENGTH;
    p->half = (p->length - 1) / 2;
    p->reach = (int)ceil(4.5 * sigma_px) + 1;
    p->reach = p->reach < p->half ? p->reach : p->half;
    double share[BST_PROFILE_LENGTH], slope[BST_PROFILE_LENGTH], curvature[BST_PROFILE_LENGTH];
    for (int phase = 0; phase <= BST_PROFILE_PHASES; phase++) {
        double centre = (double)phase / BST_PROFILE_PHASES - 0.5 + p->half;
        bst_gauss_profile(psf, centre, sigma_px, p->length, share, slope, curvature);
        float *row = p->rows + (size_t)phase * PARTS * (size_t)p->length;
        for (int i = 0; i < p->length; i++) {
            row[i] = (float)share[i];
            row[p->length + i] = (float)slope[i];
            row[2 * p->length + i] = (float)(0.5 * curvature[i]);
        }
    }
}

size_t bst_image_scratch(int max_side) {
    size_t side = (size_t)bst_lanes_up(max_side);
    return 2 * BST_PSF_MAX_NODES * PARTS * side;
}

/* Nodes that reach a row or a block of columns. */
typedef struct range {
    short first, end;
} range;

/* The profile about `centre`, times weight, on pixels 0 to side - 1 (a multiple of the lanes):
 * three rows of `side`. Returns false when none of it lies there; else first and end of the part
 * that is not 0. */
static inline bool place(const bst_profiles *t, double centre, float weight, int side, float *out,
                         int *first, int *end) {
    if (!(fabs(centre) < 1e6)) {
        return false;
    }
    double at = floor(centre + 0.5), u = (centre + 0.5 - at) * BST_PROFILE_PHASES;
    int before = (int)at - t->half, phase = (int)u;
    phase = phase < BST_PROFILE_PHASES ? phase : BST_PROFILE_PHASES - 1;
    *first = (int)at - t->reach;
    *end = (int)at + t->reach + 1;
    if (*first >= side || *end <= 0) {
        return false;
    }
    float fraction = (float)(u - phase);
    float padded[BST_PROFILE_LENGTH + 2 * BST_LANES];
    BST_STORE(padded, (bst_lanes){0});
    BST_STORE(padded + BST_LANES + t->length, (bst_lanes){0});
    for (int part = 0; part < PARTS; part++) {
        const float *a = t->rows + ((size_t)phase * PARTS + (size_t)part) * (size_t)t->length;
        const float *b = a + PARTS * t->length;
        for (int i = 0; i < t->length; i += BST_LANES) {
            bst_lanes v = BST_LOAD(a + i) + fraction * (BST_LOAD(b + i) - BST_LOAD(a + i));
            BST_STORE(padded + BST_LANES + i, weight * v);
        }
        for (int x = 0; x < side; x += BST_LANES) {
            int from = x - before + BST_LANES;
            bst_lanes v = {0};
            if (from >= 0 && from <= t->length + BST_LANES) {
                v = BST_LOAD(padded + from);
            }
            BST_STORE(out + part * side + x, v);
        }
    }
    *first = *first < 0 ? 0 : *first;
    *end = *end < side ? *end : side;
    return true;
}

static inline void widen(range *r, int first, int end, int node) {
    for (int i = first; i < end; i++) {
        r[i].first = r[i].first < node ? r[i].first : (short)node;
        r[i].end = (short)(node + 1);
    }
}

/* A path laid out on a stamp. */
typedef struct layout {
    int stride, rows, used; /* rows: of the lanes; used: nodes that reach the stamp */
    const float *across, *down;
    range column[SIDE / BST_LANES], row[SIDE];
    float node[BST_PSF_MAX_NODES], bow[BST_PSF_MAX_NODES];
} layout;

static inline __attribute__((always_inline)) void lay_out(const bst_profiles *t,
                                                          const bst_gauss *psf,
                                                          const bst_shape *shape,
                                                          const bst_stamp *stamp, float *scratch,
                                                          layout *out) {
    int stride = bst_lanes_up(stamp->width), rows = bst_lanes_up(stamp->height);
    double bend = hypot(shape->bend_x_px, shape->bend_y_px);
    double length = (hypot(shape->dx_px, shape->dy_px) + 6.0 * bend) / t->sigma_px;
    int nodes = length < 1e-3 ? 1 : (int)fmin(2.6 + 1.05 * length, BST_PSF_MAX_NODES);
    const double *node = psf->node + nodes * (nodes - 1) / 2;
    const double *weight = psf->weight + nodes * (nodes - 1) / 2;
    float *across = scratch, *down = scratch + BST_PSF_MAX_NODES * PARTS * stride;
    for (int i = 0; i < stride / BST_LANES; i++) {
        out->column[i] = (range){BST_PSF_MAX_NODES, 0};
    }
    for (int j = 0; j < rows; j++) {
        out->row[j] = (range){BST_PSF_MAX_NODES, 0};
    }
    int used = 0;
    for (int k = 0; k < nodes; k++) {
        double bow = 6.0 * node[k] * node[k] - 0.5;
        double x = shape->x_px + node[k] * shape->dx_px + bow * shape->bend_x_px - stamp->x0;
        double y = shape->y_px + node[k] * shape->dy_px + bow * shape->bend_y_px - stamp->y0;
        int first, end, top, bottom;
        if (!place(t, x, 1.0f, stride, across + used * PARTS * stride, &first, &end) ||
            !place(t, y, (float)weight[k], rows, down + used * PARTS * rows, &top, &bottom)) {
            continue;
        }
        widen(out->column, first / BST_LANES, (end + BST_LANES - 1) / BST_LANES, used);
        widen(out->row, top, bottom, used);
        out->node[used] = (float)node[k];
        out->bow[used] = (float)bow;
        used++;
    }
    out->stride = stride;
    out->rows = rows;
    out->used = used;
    out->across = across;
    out->down = down;
}

/* Nodes that reach row j and block b. */
static inline range reaching(const layout *l, int j, int b) {
    range r = l->row[j], c = l->column[b];
    return (range){r.first > c.first ? r.first : c.first, r.end < c.end ? r.end : c.end};
}

BST_CLONES
void bst_image_render(const bst_profiles *t, const bst_gauss *psf, const bst_shape *shape,
                      const bst_stamp *stamp, float *scratch, float *planes) {
    if (t->known) {
        bst_image_render_known(t, psf, shape, stamp, false, 0.0, 0.0, scratch, planes);
        return;
    }
    layout l;
    lay_out(t, psf, shape, stamp, scratch, &l);
    int stride = l.stride, rows = l.rows, n = stride * stamp->height;
    for (int j = 0; j < stamp->height; j++) {
        for (int b = 0; b < stride / BST_LANES; b++) {
            bst_lanes s = {0}, sx = {0}, sy = {0}, sv = {0};
            range r = reaching(&l, j, b);
            for (int k = r.first; k < r.end; k++) {
                const float *x = l.across + k * PARTS * stride + b * BST_LANES;
                const float *y = l.down + k * PARTS * rows + j;
                bst_lanes share = BST_LOAD(x);
                s += y[0] * share;
                sx += y[0] * BST_LOAD(x + stride);
                sy += y[rows] * share;
                sv += y[0] * BST_LOAD(x + 2 * stride) + y[2 * rows] * share;
            }
            float *out = planes + j * stride + b * BST_LANES;
            BST_STORE(out, s);
            BST_STORE(out + n, sx);
            BST_STORE(out + 2 * n, sy);
            BST_STORE(out + 3 * n, sv);
        }
    }
}

BST_CLONES
void bst_image_render_motion(const bst_profiles *t, const bst_gauss *psf, const bst_shape *shape,
                             const bst_stamp *stamp, double ex, double ey, float *scratch,
                             float *planes) {
    layout l;
    lay_out(t, psf, shape, stamp, scratch, &l);
    int stride = l.stride, rows = l.rows, n = stride * stamp->height;
    float ux = (float)ex, uy = (float)ey;
    for (int j = 0; j < stamp->height; j++) {
        for (int b = 0; b < stride / BST_LANES; b++) {
            bst_lanes s = {0}, sx = {0}, sy = {0}, sv = {0};
            bst_lanes nx = {0}, ny = {0}, bx = {0}, by = {0};
            range r = reaching(&l, j, b);
            for (int k = r.first; k < r.end; k++) {
                const float *x = l.across + k * PARTS * stride + b * BST_LANES;
                const float *y = l.down + k * PARTS * rows + j;
                bst_lanes share = BST_LOAD(x);
                bst_lanes by_x = y[0] * BST_LOAD(x + stride), by_y = y[rows] * share;
                s += y[0] * share;
                sx += by_x;
                sy += by_y;
                sv += y[0] * BST_LOAD(x + 2 * stride) + y[2 * rows] * share;
                nx += l.node[k] * by_x;
                ny += l.node[k] * by_y;
                bx += l.bow[k] * by_x;
                by += l.bow[k] * by_y;
            }
            float *out = planes + j * stride + b * BST_LANES;
            BST_STORE(out, s);
            BST_STORE(out + n, sx);
            BST_STORE(out + 2 * n, sy);
            BST_STORE(out + 3 * n, sv);
            BST_STORE(out + BST_IMAGE_BY_LENGTH * n, ux * nx + uy * ny);
            BST_STORE(out + BST_IMAGE_BY_ACROSS * n, ux * ny - uy * nx);
            BST_STORE(out + BST_IMAGE_BY_BEND * n, ux * bx + uy * by);
        }
    }
}
