#include "sim/process/twin/twin_path.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/cholesky.h"

/* Knot number i of the clamped knots for `count` splines of degree d. */
static double knot(int count, int d, int i) {
    int inner = count - d; /* intervals */
    return i <= d ? 0.0 : i >= count ? 1.0 : (double)(i - d) / inner;
}

int bst_twin_basis(int count, double t, double value[BST_TWIN_SUPPORT]) {
    assert(count >= 1 && count <= BST_TWIN_COEFFICIENTS);
    int d = count < BST_TWIN_SUPPORT ? count - 1 : BST_TWIN_SUPPORT - 1, intervals = count - d;
    int at = (int)floor(fmin(fmax(t, 0.0), 1.0) * intervals);
    at = at < intervals ? at : intervals - 1; /* interval; its splines are at to at + d */
    memset(value, 0, BST_TWIN_SUPPORT * sizeof *value);
    value[0] = 1.0;
    for (int k = 1; k <= d; k++) { /* degree k from degree k - 1 */
        double saved = 0.0;
        for (int r = 0; r < k; r++) {
            double right = knot(count, d, at + d + r + 1),
                   left = knot(count, d, at + d + 1 + r - k);
            double part = right > left ? value[r] / (right - left) : 0.0;
            value[r] = saved + (right - t) * part;
            saved = (t - left) * part;
        }
        value[k] = saved;
    }
    return at;
}

bst_quat bst_twin_path_attitude(const bst_twin_path *path, double t) {
    double angle[3] = {0.0, 0.0, 0.0}, b[BST_TWIN_SUPPORT];
    for (int axis = 0; axis < 3; axis++) {
        int count = path->count[axis == 2], first = bst_twin_basis(count, t, b);
        for (int k = 0; k < BST_TWIN_SUPPORT && first + k < count; k++) {
            angle[axis] += b[k] * path->coefficients[axis][first + k];
        }
    }
    bst_quat turn = bst_quat_from_rotvec((bst_vec3){angle[0], angle[1], angle[2]});
    return bst_quat_unit(bst_quat_mul(turn, path->q_reference));
}

/* Coefficients of one angle by least squares. */
static bool fit_angle(bst_twin_path *path, int axis, const bst_twin_attitude *nodes, int count) {
    enum { N = BST_TWIN_COEFFICIENTS };
    double a[N * N] = {0}, g[N] = {0}, b[BST_TWIN_SUPPORT];
    int n = path->count[axis == 2];
    for (int i = 0; i < count; i++) {
        bst_vec3 v = bst_quat_to_rotvec(
            bst_quat_mul(nodes[i].q_cam_from_gcrf, bst_quat_conj(path->q_reference)));
        double y = axis == 0 ? v.x : axis == 1 ? v.y : v.z;
        int first = bst_twin_basis(n, nodes[i].t, b);
        for (int j = 0; j < BST_TWIN_SUPPORT && first + j < n; j++) {
            g[first + j] += b[j] * y;
            for (int k = 0; k <= j; k++) {
                a[(first + j) * N + first + k] += b[j] * b[k];
            }
        }
    }
    for (int j = 0; j < n; j++) { /* times without an attitude: a little stiffness */
        a[j * N + j] += 1e-9;
    }
    if (!bst_cholesky_factor(a, N, n, 1e-14)) {
        return false;
    }
    bst_cholesky_solve(a, N, n, g);
    memcpy(path->coefficients[axis], g, (size_t)n * sizeof *g);
    return true;
}

bool bst_twin_path_fit(bst_twin_path *path, const bst_twin_attitude *nodes, int count) {
    assert(path && nodes && count > 0);
    return fit_angle(path, 0, nodes, count) && fit_angle(path, 1, nodes, count) &&
           fit_angle(path, 2, nodes, count);
}

bool bst_twin_path_refine(bst_twin_path *path, int count_xy, int count_roll) {
    enum { SAMPLES = 8 * BST_TWIN_COEFFICIENTS };
    bst_twin_attitude nodes[SAMPLES];
    for (int i = 0; i < SAMPLES; i++) {
        nodes[i].t = i / (SAMPLES - 1.0);
        nodes[i].q_cam_from_gcrf = bst_twin_path_attitude(path, nodes[i].t);
    }
    path->count[0] = count_xy;
    path->count[1] = count_roll;
    return bst_twin_path_fit(path, nodes, SAMPLES);
}
