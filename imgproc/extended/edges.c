#include "imgproc/extended/edges.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#include "boresight/vec.h"

/* Margin over the light that a straight edge spreads: a corner that is cut out of a plateau gets
 * up to twice as much, and there is noise. Above 1 / Q(1) = 6.3 plateaus would count as outside. */
static const double MARGIN = 3.0;
/* The table of slopes: distances in sigma. */
static const double FIRST = -1.0, STEP = 0.1;

/* Share of the light of a half plane at a distance outside of it, sigma. */
static double spread(double distance) {
    return 0.5 * erfc(distance / sqrt(2.0));
}

void bst_edges_init(bst_edges *edges, const float *signal, int width, int height, double sigma_px) {
    assert(edges && signal && width > 0 && height > 0 && sigma_px > 0.0);
    *edges = (bst_edges){.signal = signal, .width = width, .height = height};
    /* a pixel's side has the variance 1/12 */
    edges->sigma_px = sqrt(sigma_px * sigma_px + 1.0 / 12.0);
    int far = (int)fmax(round(sigma_px), 1.0);
    int diagonal = (int)fmax(round(sigma_px / sqrt(2.0)), 1.0);
    for (int k = 0, n = 0; k < 9; k++) {
        int u = k % 3 - 1, v = k / 3 - 1;
        if (u == 0 && v == 0) {
            continue;
        }
        int reach = u && v ? diagonal : far;
        edges->dx[n] = u * reach;
        edges->dy[n] = v * reach;
        edges->share[n++] = (float)(MARGIN * spread(reach * hypot(u, v) / sigma_px));
    }
    for (int k = 0; k < BST_EDGES_STEPS; k++) {
        double u = FIRST + STEP * k;
        edges->slope[k] = exp(-0.5 * u * u) / sqrt(2.0 * BST_PI) / spread(u);
    }
}

bool bst_edges_outside(const bst_edges *e, int x, int y) {
    assert(e && x >= 0 && y >= 0 && x < e->width && y < e->height);
    float here = e->signal[(size_t)y * (size_t)e->width + (size_t)x];
    for (int k = 0; k < BST_EDGES_NEIGHBOURS; k++) {
        int u = x + e->dx[k], v = y + e->dy[k];
        if (u >= 0 && v >= 0 && u < e->width && v < e->height &&
            here < e->share[k] * e->signal[(size_t)v * (size_t)e->width + (size_t)u]) {
            return true;
        }
    }
    return false;
}

double bst_edges_distance(const bst_edges *e, double slope_per_px) {
    assert(e);
    double slope = slope_per_px * e->sigma_px;
    int k = 0;
    while (k < BST_EDGES_STEPS - 2 && e->slope[k + 1] < slope) {
        k++;
    }
    double part = (slope - e->slope[k]) / (e->slope[k + 1] - e->slope[k]);
    return e->sigma_px * (FIRST + STEP * (k + fmin(fmax(part, 0.0), 1.0)));
}

/* Logarithm of the signal at a pixel, or at the nearest one in the frame. */
static double logarithm(const bst_edges *e, int x, int y, double least) {
    int u = x < 0 ? 0 : x >= e->width ? e->width - 1 : x;
    int v = y < 0 ? 0 : y >= e->height ? e->height - 1 : y;
    return log(fmax((double)e->signal[(size_t)v * (size_t)e->width + (size_t)u], least));
}

bst_outline_point bst_edges_place(const bst_edges *e, int x, int y, double least) {
    assert(e && x >= 0 && y >= 0 && x < e->width && y < e->height && least > 0.0);
    /* three rows and columns with the weights 1, 2, 1: less noise than one (Sobel) */
    static const double weight[] = {0.25, 0.5, 0.25};
    double gx = 0.0, gy = 0.0;
    for (int k = -1; k <= 1; k++) {
        double w = 0.5 * weight[k + 1];
        gx += w * (logarithm(e, x + 1, y + k, least) - logarithm(e, x - 1, y + k, least));
        gy += w * (logarithm(e, x + k, y + 1, least) - logarithm(e, x + k, y - 1, least));
    }
    double slope = hypot(gx, gy);
    double distance = slope > 0.0 ? bst_edges_distance(e, slope) / slope : 0.0;
    return (bst_outline_point){x + distance * gx, y + distance * gy};
}
