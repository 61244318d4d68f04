#include "sim/process/twin/star_image.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Longest step of the image in a part of the exposure, px: narrow and wide Gaussian. */
static const double STEP_PX[2] = {2.0, 5.0};
/* Nodes and weights of Gauss's rule on 0 to 1 (Abramowitz and Stegun, table 25.4, n = 3). */
static const double GAUSS_T[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
static const double GAUSS_W[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
/* A place that no pixel is near. */
static const float FAR_PX = -1e6F;

enum { MOST_PARTS = 4096, SPEED_SAMPLES = 128 };

/* Largest rotation of the camera per exposure, rad, at the fastest moment. */
static double fastest_rad(const bst_twin_model *m) {
    double most = 0.0;
    bst_quat before = bst_twin_path_attitude(&m->path, 0.0);
    double radius = bst_camera_half_diagonal_rad(&m->camera);
    for (int i = 1; i <= SPEED_SAMPLES; i++) {
        bst_quat now = bst_twin_path_attitude(&m->path, (double)i / SPEED_SAMPLES);
        bst_vec3 turn = bst_quat_to_rotvec(bst_quat_mul(now, bst_quat_conj(before)));
        most = fmax(most, hypot(turn.x, turn.y) + fabs(turn.z) * radius);
        before = now;
    }
    return most * SPEED_SAMPLES;
}

bst_status bst_twin_nodes_create(bst_ctx *ctx, const bst_twin_model *m, bst_twin_nodes *out) {
    double length_px = fastest_rad(m) / bst_camera_scale_rad(&m->camera);
    *out = (bst_twin_nodes){.count = {0, 0}};
    for (int c = 0; c < 2; c++) {
        int parts = (int)fmin(ceil(length_px / STEP_PX[c]) + 1.0, MOST_PARTS);
        out->node[c] = malloc((size_t)parts * 3 * sizeof *out->node[c]);
        if (!out->node[c]) {
            bst_twin_nodes_free(out);
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d parts of an exposure", parts);
        }
        for (int i = 0; i < 3 * parts; i++) {
            bst_twin_node *n = &out->node[c][i];
            n->t = (i / 3 + GAUSS_T[i % 3]) / parts;
            n->weight = GAUSS_W[i % 3] / parts;
            n->q_cam_from_gcrf = bst_twin_path_attitude(&m->path, n->t);
            for (int k = 0; k < 2; k++) {
                n->first[k] = bst_twin_basis(m->path.count[k], n->t, n->basis[k]);
            }
        }
        out->count[c] = 3 * parts;
    }
    return BST_OK;
}

void bst_twin_nodes_free(bst_twin_nodes *nodes) {
    free(nodes->node[0]);
    free(nodes->node[1]);
    *nodes = (bst_twin_nodes){.count = {0, 0}};
}

void bst_twin_star_places(const bst_twin_model *m, const bst_twin_nodes *nodes, int component,
                          bst_vec3 apparent, bst_twin_place *places) {
    double per_rad = 1.0 / bst_camera_scale_rad(&m->camera);
    for (int i = 0; i < nodes->count[component]; i++) {
        bst_twin_place *p = &places[i];
        bst_vec3 v = bst_quat_rotate(nodes->node[component][i].q_cam_from_gcrf, apparent);
        double x, y, k[2][2];
        if (!bst_camera_project(&m->camera, v, &x, &y) || fabs(x) > 1e6 || fabs(y) > 1e6) {
            *p = (bst_twin_place){.x_px = FAR_PX, .y_px = FAR_PX};
            continue;
        }
        p->x_px = (float)x;
        p->y_px = (float)y;
        bst_camera_jacobian(&m->camera, v, k);
        /* rotation d moves v by d x v, and the tangent coordinates (a, b) accordingly */
        double a = v.x / v.z, b = v.y / v.z;
        const double da[3] = {-a * b, 1.0 + a * a, -b}, db[3] = {-1.0 - b * b, a * b, a};
        for (int axis = 0; axis < 3; axis++) {
            p->dx[axis] = (float)(per_rad * (k[0][0] * da[axis] + k[0][1] * db[axis]));
            p->dy[axis] = (float)(per_rad * (k[1][0] * da[axis] + k[1][1] * db[axis]));
        }
    }
}

void bst_twin_profile_at(double x_px, double sigma_px, int low, int high, bst_twin_profile *out) {
    double reach = BST_TWIN_REACH * sigma_px + 0.5, scale = 1.0 / (sigma_px * sqrt(2.0));
    double density = 1.0 / (sigma_px * sqrt(2.0 * BST_PI));
    int first = (int)fmax(ceil(x_px - reach), low), last = (int)fmin(floor(x_px + reach), high - 1);
    out->first = first;
    out->count = last < first ? 0 : last - first + 1;
    assert(out->count <= BST_TWIN_PROFILE);
    double u = first - 0.5 - x_px; /* left edge of the pixel from the place */
    double e0 = erf(u * scale), g0 = density * exp(-u * u * scale * scale);
    for (int i = 0; i < out->count; i++) {
        double w = u + 1.0, e1 = erf(w * scale), g1 = density * exp(-w * w * scale * scale);
        out->value[i] = 0.5 * (e1 - e0);
        out->slope[i] = g0 - g1;
        out->width[i] = u * g0 - w * g1;
        u = w;
        e0 = e1;
        g0 = g1;
    }
}
