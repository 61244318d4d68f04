#include <math.h>
#include <stdlib.h>

#include "sim/optics/psf_internal.h"

bst_status bst_optics_grid_otf_create(bst_ctx *ctx, double step, int reach,
                                      bst_optics_grid_otf *out) {
    int stride = reach + 1 + 2 * BST_GRID_MARGIN, rows = 2 * (reach + BST_GRID_MARGIN) + 1;
    out->node = calloc((size_t)stride * (size_t)rows, 2 * sizeof *out->node);
    if (!out->node) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF's table of %d x %d frequencies",
                        stride, rows);
    }
    out->step = step;
    out->reach = reach;
    out->stride = stride;
    return BST_OK;
}

void bst_optics_grid_otf_free(bst_optics_grid_otf *table) {
    free(table->node);
    *table = (bst_optics_grid_otf){0};
}

void bst_optics_grid_otf_mirror(bst_optics_grid_otf *table) {
    int rows = table->reach + BST_GRID_MARGIN;
    for (int ky = -rows; ky <= rows; ky++) {
        for (int kx = 1; kx <= BST_GRID_MARGIN; kx++) {
            const float *from = bst_optics_grid_otf_node(table, kx, -ky);
            float *to = bst_optics_grid_otf_node(table, -kx, ky);
            to[0] = from[0];
            to[1] = -from[1];
        }
    }
}

/* Six-point Lagrange weights of the nodes -2 .. 3 at t in [0, 1]. */
static void lagrange6(double t, double w[6]) {
    double a = t + 2.0, b = t + 1.0, c = t - 1.0, d = t - 2.0, e = t - 3.0;
    w[0] = b * t * c * d * e * (-1.0 / 120.0);
    w[1] = a * t * c * d * e * (1.0 / 24.0);
    w[2] = a * b * c * d * e * (-1.0 / 12.0);
    w[3] = a * b * t * d * e * (1.0 / 12.0);
    w[4] = a * b * t * c * e * (-1.0 / 24.0);
    w[5] = a * b * t * c * d * (1.0 / 120.0);
}

void bst_optics_grid_otf_add(const bst_optics_grid_otf *table, double fx, double fy,
                             double out[2]) {
    double sign = 1.0;
    if (fx < 0.0) {
        fx = -fx;
        fy = -fy;
        sign = -1.0;
    }
    double u = fx / table->step, v = fy / table->step;
    if (!(u <= table->reach && fabs(v) <= table->reach)) {
        return;
    }
    int i = (int)u, j = (int)floor(v);
    double wx[6], wy[6], re = 0.0, im = 0.0;
    lagrange6(u - i, wx);
    lagrange6(v - j, wy);
    for (int row = 0; row < 6; row++) {
        const float *node = bst_optics_grid_otf_node(table, i - 2, j - 2 + row);
        double sum_re = 0.0, sum_im = 0.0;
        for (int k = 0; k < 6; k++) {
            sum_re += wx[k] * (double)node[2 * k];
            sum_im += wx[k] * (double)node[2 * k + 1];
        }
        re += wy[row] * sum_re;
        im += wy[row] * sum_im;
    }
    out[0] += re;
    out[1] += sign * im;
}
