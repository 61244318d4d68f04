#include "gimbal/ideal.h"

#include <assert.h>
#include <math.h>

bst_status bst_ideal_at(bst_ideal *ideal, bst_ctx *ctx, double seconds, bst_vec3 *direction) {
    assert(ideal && direction && isfinite(seconds));
    double x = seconds * BST_IDEAL_NODES_PER_S;
    int64_t cell = (int64_t)floor(x);
    int64_t first = cell >= 1 || cell < 0 ? cell - 1 : cell;
    if (!ideal->filled || first != ideal->first) {
        for (int i = 0; i < 4; i++) {
            int64_t old = first + i - ideal->first;
            if (ideal->filled && old >= i && old < 4) {
                ideal->node[i] = ideal->node[old];
                continue;
            }
            double t = (double)(first + i) / BST_IDEAL_NODES_PER_S;
            bst_status status = ideal->direction_at(ideal->user, ctx, t, &ideal->node[i]);
            if (status != BST_OK) {
                ideal->filled = 0;
                return status;
            }
        }
        ideal->first = first;
        ideal->filled = 4;
    }
    double s = x - (double)first;
    double a = s, b = s - 1.0, c = s - 2.0, d = s - 3.0;
    bst_vec3 v = bst_vec3_scale(ideal->node[0], -b * c * d / 6.0);
    v = bst_vec3_axpy(v, a * c * d / 2.0, ideal->node[1]);
    v = bst_vec3_axpy(v, -a * b * d / 2.0, ideal->node[2]);
    v = bst_vec3_axpy(v, a * b * c / 6.0, ideal->node[3]);
    *direction = bst_vec3_unit(v);
    return BST_OK;
}

void bst_ideal_archive(bst_ideal *ideal, bst_archive *archive) {
    ideal->first = bst_archive_integer(archive, ideal->first, INT64_MIN / 4, INT64_MAX / 4);
    ideal->filled = (int)bst_archive_integer(archive, ideal->filled, 0, 4);
    BST_ARCHIVE(archive, ideal->node);
}
