/* Displacement of single streaks from the common path. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/symmetric.h"
#include "sim/process/twin/star_image.h"

enum { UNKNOWNS = 3 /* across, along, flux */ };
/* Outliers beyond this do not count, standard deviations. */
static const double CLIP = 5.0;
/* Steps of the fit are so short that one linear step is enough. */
static const double LONGEST_PX = 2.0;

/* Adds the light of a node to the derivatives of a star's pixels. */
static void add_node(const bst_twin_model *m, const bst_twin_place *p, const double direction[2],
                     double weight, int component, double *derivative) {
    bst_twin_profile x, y;
    double sigma = bst_twin_sigma_px(&m->psf, component);
    bst_twin_profile_at((double)p->x_px, sigma, 0, m->width, &x);
    bst_twin_profile_at((double)p->y_px, sigma, 0, m->height, &y);
    for (int j = 0; j < y.count; j++) {
        for (int i = 0; i < x.count; i++) {
            double gx = weight * x.slope[i] * y.value[j], gy = weight * x.value[i] * y.slope[j];
            double *to =
                derivative +
                ((size_t)(y.first + j) * (size_t)m->width + (size_t)(x.first + i)) * UNKNOWNS;
            to[0] += gy * direction[0] - gx * direction[1];
            to[1] += gx * direction[0] + gy * direction[1];
            to[2] += weight * x.value[i] * y.value[j];
        }
    }
}

/* Derivatives of a star's pixels by displacement across and along its path, and by its light. */
static void differentiate(const bst_twin_model *m, const bst_twin_nodes *nodes,
                          const bst_twin_star *s, bst_twin_place *places, double *derivative) {
    for (int c = 0; c < 2; c++) {
        int n = nodes->count[c];
        double share = bst_twin_share(&m->psf, c);
        bst_twin_star_places(m, nodes, c, s->apparent, places);
        for (int i = 0; i < n; i++) {
            int a = i > 0 ? i - 1 : 0, b = i + 1 < n ? i + 1 : n - 1;
            double dx = (double)(places[b].x_px - places[a].x_px);
            double dy = (double)(places[b].y_px - places[a].y_px), length = hypot(dx, dy);
            const double direction[2] = {length > 0.0 ? dx / length : 1.0,
                                         length > 0.0 ? dy / length : 0.0};
            add_node(m, &places[i], direction, nodes->node[c][i].weight * share, c, derivative);
        }
    }
}

/* Solves for the displacement. */
static bool solve(const bst_twin_model *m, double flux, const float *residual,
                  const double *derivative, bst_twin_offset *out) {
    double a[UNKNOWNS * UNKNOWNS] = {0}, g[UNKNOWNS] = {0}, inverse[UNKNOWNS * UNKNOWNS];
    size_t pixels = (size_t)m->width * (size_t)m->height;
    for (size_t i = 0; i < pixels; i++) {
        double r = (double)residual[i], v = (double)m->variance_e2[i];
        const double *d = derivative + i * UNKNOWNS;
        if (d[2] == 0.0 || !isfinite(r) || r * r > CLIP * CLIP * v) {
            continue;
        }
        const double row[UNKNOWNS] = {flux * d[0], flux * d[1], flux * d[2]};
        for (int j = 0; j < UNKNOWNS; j++) {
            g[j] += row[j] * r / v;
            for (int k = 0; k < UNKNOWNS; k++) {
                a[j * UNKNOWNS + k] += row[j] * row[k] / v;
            }
        }
    }
    if (!bst_symmetric_invert(UNKNOWNS, a, inverse)) {
        return false;
    }
    double step[UNKNOWNS] = {0};
    for (int j = 0; j < UNKNOWNS; j++) {
        for (int k = 0; k < UNKNOWNS; k++) {
            step[j] += inverse[j * UNKNOWNS + k] * g[k];
        }
    }
    *out = (bst_twin_offset){step[0], step[1], sqrt(inverse[0]), sqrt(inverse[UNKNOWNS + 1])};
    return fabs(step[0]) < LONGEST_PX && fabs(step[1]) < LONGEST_PX;
}

bst_status bst_twin_star_offset(bst_ctx *ctx, const bst_twin_model *m, const bst_twin_star *s,
                                const float *residual, bst_twin_offset *out, bool *measured) {
    assert(m && s && residual && out && measured);
    size_t pixels = (size_t)m->width * (size_t)m->height;
    bst_twin_nodes nodes;
    *measured = false;
    BST_TRY(bst_twin_nodes_create(ctx, m, &nodes));
    double *derivative = calloc(pixels * UNKNOWNS, sizeof *derivative);
    bst_twin_place *places = malloc((size_t)nodes.count[0] * sizeof *places);
    bst_status status = BST_OK;
    if (derivative && places) {
        differentiate(m, &nodes, s, places, derivative);
        *measured = solve(m, s->flux_e, residual, derivative, out);
    } else {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pixels of a star");
    }
    free(derivative);
    free(places);
    bst_twin_nodes_free(&nodes);
    return status;
}
