/* Images of sources with the PSF that is known on board. */
#include <math.h>
#include <string.h>

#include "imgproc/image.h"

enum { PARTS = 3, SIDE = BST_PSF_MAX_SIDE + BST_LANES };

/* One function's profile about a centre that is `phase` of the table's steps past -1/2 px. */
static void add_profile(const bst_profiles *p, const double *samples, int phase, float *row) {
    const bst_known_psf *k = p->known;
    int b = p->binning;
    double centre = (double)phase / BST_PROFILE_PHASES - 0.5 + p->half;
    for (int i = 0; i < p->length; i++) {
        double v[PARTS] = {0.0};
        for (int sub = 0; sub < b; sub++) {
            bst_known_psf_taps taps;
            double d = b * (i - centre) + sub - 0.5 * (b - 1);
            int first = bst_known_psf_taps_at(k, d, taps);
            for (int part = 0; first >= 0 && part < PARTS; part++) {
                for (int q = 0; q < BST_KNOWN_PSF_POINTS; q++) {
                    v[part] += taps[part][q] * samples[first + q];
                }
            }
        }
        /* by the centre, which is the other way than by the distance from it */
        row[i] = (float)v[0];
        row[p->length + i] = (float)(-b * v[1]);
        row[2 * p->length + i] = (float)(0.5 * b * b * v[2]);
    }
}

void bst_profiles_set_known(bst_profiles *p) {
    const bst_known_psf *k = p->known;
    if (p->made_binning == p->binning) {
        return;
    }
    p->made_binning = p->binning;
    int half = (k->reach_px + p->binning - 1) / p->binning;
    half = half < BST_LANES / 2 - 1 ? BST_LANES / 2 - 1 : half;
    p->length = bst_lanes_up(2 * half + 1);
    p->length = p->length < BST_PROFILE_LENGTH ? p->length : BST_PROFILE_LENGTH;
    p->half = (p->length - 1) / 2;
    p->reach = p->half;
    size_t row = (size_t)PARTS * (size_t)p->length;
    int each = k->nodes * k->terms;
    for (int phase = 0; phase <= BST_PROFILE_PHASES; phase++) {
        for (int f = 0; f < each; f++) {
            add_profile(p, k->across + (size_t)f * (size_t)k->side, phase,
                        p->rows + (size_t)(phase * each + f) * row);
        }
        for (int t = 0; t < k->terms; t++) {
            add_profile(p, k->down + (size_t)t * (size_t)k->side, phase,
                        p->down + (size_t)(phase * k->terms + t) * row);
        }
    }
}

/* The nodes that mix at a source's place. */
typedef struct mix {
    int count, node[4];
    float weight[4];
} mix;

/* Where a profile about `centre` comes to lie on pixels 0 to side - 1. */
typedef struct laid {
    int before, phase, first, end; /* first and end of the part that is not 0 */
    float fraction;
} laid;

static inline bool lay(const bst_profiles *t, double centre, int side, laid *out) {
    if (!(fabs(centre) < 1e6)) {
        return false;
    }
    double at = floor(centre + 0.5), u = (centre + 0.5 - at) * BST_PROFILE_PHASES;
    int phase = (int)u;
    out->phase = phase < BST_PROFILE_PHASES ? phase : BST_PROFILE_PHASES - 1;
    out->fraction = (float)(u - out->phase);
    out->before = (int)at - t->half;
    out->first = (int)at - t->reach;
    out->end = (int)at + t->reach + 1;
    if (out->first >= side || out->end <= 0) {
        return false;
    }
    out->first = out->first < 0 ? 0 : out->first;
    out->end = out->end < side ? out->end : side;
    return true;
}

/* One function's part, mixed from `count` tables that are `apart` floats from one another, at the
 * profile's place among `side` pixels. */
static inline __attribute__((always_inline)) void shift_in(const bst_profiles *t, const laid *at,
                                                           const float *const *from,
                                                           const float *weight, int count,
                                                           size_t next_phase, int side,
                                                           float *out) {
    float padded[BST_PROFILE_LENGTH + 2 * BST_LANES];
    BST_STORE(padded, (bst_lanes){0});
    BST_STORE(padded + BST_LANES + t->length, (bst_lanes){0});
    for (int i = 0; i < t->length; i += BST_LANES) {
        bst_lanes sum = {0};
        for (int m = 0; m < count; m++) {
            bst_lanes a = BST_LOAD(from[m] + i), b = BST_LOAD(from[m] + next_phase + i);
            sum += weight[m] * (a + at->fraction * (b - a));
        }
        BST_STORE(padded + BST_LANES + i, sum);
    }
    for (int x = 0; x < side; x += BST_LANES) {
        int start = x - at->before + BST_LANES;
        bst_lanes v = {0};
        if (start >= 0 && start <= t->length + BST_LANES) {
            v = BST_LOAD(padded + start);
        }
        BST_STORE(out + x, v);
    }
}

static inline __attribute__((always_inline)) void place_across(const bst_profiles *t,
                                                               const laid *at, const mix *nodes,
                                                               int side, float *out) {
    size_t row = (size_t)PARTS * (size_t)t->length;
    int terms = t->known->terms;
    size_t phase = (size_t)(t->known->nodes * terms) * row;
    for (int k = 0; k < terms; k++) {
        for (int part = 0; part < PARTS; part++) {
            const float *from[4] = {0};
            for (int m = 0; m < nodes->count; m++) {
                from[m] = t->rows + (size_t)at->phase * phase +
                          (size_t)(nodes->node[m] * terms + k) * row + (size_t)(part * t->length);
            }
            shift_in(t, at, from, nodes->weight, nodes->count, phase, side,
                     out + (k * PARTS + part) * side);
        }
    }
}

static inline __attribute__((always_inline)) void place_down(const bst_profiles *t, const laid *at,
                                                             float weight, int side, float *out) {
    size_t row = (size_t)PARTS * (size_t)t->length, phase = (size_t)t->known->terms * row;
    for (int k = 0; k < t->known->terms * PARTS; k++) {
        const float *from = t->down + (size_t)at->phase * phase + (size_t)(k * t->length);
        shift_in(t, at, &from, &weight, 1, phase, side, out + k * side);
    }
}

/* Adds one place of the path: the products of its profiles. */
static inline __attribute__((always_inline)) void add_products(
    const float *across, const float *down, int terms, int stride, int rows, const laid *at_x,
    const laid *at_y, int height, bool moved, const float by[4], float *planes) {
    int n = stride * height, last = at_y->end < height ? at_y->end : height;
    for (int j = at_y->first; j < last; j++) {
        for (int b = at_x->first / BST_LANES * BST_LANES; b < at_x->end; b += BST_LANES) {
            bst_lanes s = {0}, sx = {0}, sy = {0}, sv = {0};
            for (int k = 0; k < terms; k++) {
                const float *x = across + k * PARTS * stride + b, *y = down + k * PARTS * rows + j;
                bst_lanes share = BST_LOAD(x);
                s += y[0] * share;
                sx += y[0] * BST_LOAD(x + stride);
                sy += y[rows] * share;
                sv += y[0] * BST_LOAD(x + 2 * stride) + y[2 * rows] * share;
            }
            float *out = planes + j * stride + b;
            BST_STORE(out, BST_LOAD(out) + s);
            BST_STORE(out + n, BST_LOAD(out + n) + sx);
            BST_STORE(out + 2 * n, BST_LOAD(out + 2 * n) + sy);
            BST_STORE(out + 3 * n, BST_LOAD(out + 3 * n) + sv);
            if (moved) {
                float *length = out + BST_IMAGE_BY_LENGTH * n, *bend = out + BST_IMAGE_BY_BEND * n;
                float *side = out + BST_IMAGE_BY_ACROSS * n;
                bst_lanes along = by[0] * sx + by[1] * sy;
                BST_STORE(length, BST_LOAD(length) + by[2] * along);
                BST_STORE(side, BST_LOAD(side) + by[2] * (by[0] * sy - by[1] * sx));
                BST_STORE(bend, BST_LOAD(bend) + by[3] * along);
            }
        }
    }
}

BST_CLONES
void bst_image_render_known(const bst_profiles *t, const bst_gauss *psf, const bst_shape *shape,
                            const bst_stamp *stamp, bool moved, double ex, double ey,
                            float *scratch, float *planes) {
    int stride = bst_lanes_up(stamp->width), rows = bst_lanes_up(stamp->height);
    int terms = t->known->terms, n = stride * stamp->height;
    double bend = hypot(shape->bend_x_px, shape->bend_y_px);
    double length = (hypot(shape->dx_px, shape->dy_px) + 6.0 * bend) / t->sigma_px;
    int nodes = length < 1e-3 ? 1 : (int)fmin(2.6 + 1.05 * length, BST_PSF_MAX_NODES);
    const double *node = psf->node + nodes * (nodes - 1) / 2;
    const double *weight = psf->weight + nodes * (nodes - 1) / 2;
    float *across = scratch, *down = scratch + terms * PARTS * stride;
    double share[4];
    mix mixed;
    mixed.count = bst_psf_weights(t->known->psf, t->origin_x_px + t->binning * shape->x_px,
                                  t->origin_y_px + t->binning * shape->y_px, mixed.node, share);
    for (int m = 0; m < mixed.count; m++) {
        mixed.weight[m] = (float)share[m];
    }
    memset(planes, 0, (size_t)(moved ? BST_IMAGE_MOTION_PLANES : 4) * (size_t)n * sizeof *planes);
    for (int k = 0; k < nodes; k++) {
        double bow = 6.0 * node[k] * node[k] - 0.5;
        double x = shape->x_px + node[k] * shape->dx_px + bow * shape->bend_x_px - stamp->x0;
        double y = shape->y_px + node[k] * shape->dy_px + bow * shape->bend_y_px - stamp->y0;
        laid at_x, at_y;
        if (!lay(t, x, stride, &at_x) || !lay(t, y, rows, &at_y)) {
            continue;
        }
        place_across(t, &at_x, &mixed, stride, across);
        place_down(t, &at_y, (float)weight[k], rows, down);
        const float by[4] = {(float)ex, (float)ey, (float)node[k], (float)bow};
        add_products(across, down, terms, stride, rows, &at_x, &at_y, stamp->height, moved, by,
                     planes);
    }
}
