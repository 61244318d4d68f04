/* Which end of a streak came first, by the header's rates of turn. */
#include <math.h>

#include "sim/process/process_internal.h"

bst_vec3 bst_process_turn(bst_quat from, bst_quat to) {
    return bst_quat_to_rotvec(bst_quat_mul(to, bst_quat_conj(from)));
}

void bst_process_reverse(bst_process_frame *f) {
    f->reversed = !f->reversed;
    for (int i = 0, k = f->node_count - 1; i <= k; i++, k--) {
        bst_process_node left = f->nodes[i];
        f->nodes[i] = (bst_process_node){1.0 - f->nodes[k].share, f->nodes[k].q_cam_from_gcrf};
        f->nodes[k] = (bst_process_node){1.0 - left.share, left.q_cam_from_gcrf};
    }
}

/* Trends of the speed that are too small to tell directions apart. */
static const double LEAST_TREND = 0.05;
/* Least standard errors of the header's trend. */
static const double CERTAIN = 3.0;

/* Change of the speed along the nodes, as bst_keyword_rate_trend has it. */
static double path_trend(const bst_process_frame *f) {
    double w = 0.0, t = 0.0, v = 0.0, tt = 0.0, tv = 0.0;
    for (int k = 1; k < f->node_count; k++) {
        const bst_process_node *a = &f->nodes[k - 1], *b = &f->nodes[k];
        double dt = b->share - a->share, middle = 0.5 * (a->share + b->share);
        double turn = bst_vec3_norm(bst_process_turn(a->q_cam_from_gcrf, b->q_cam_from_gcrf));
        w += dt;
        t += dt * middle;
        v += turn;
        tt += dt * middle * middle;
        tv += turn * middle;
    }
    return (tv - t * v / w) / (tt - t * t / w) / (v / w);
}

bool bst_process_orient_by_rates(bst_process_frame *f) {
    double along = path_trend(f);
    if (!(fabs(f->rate_trend) > fmax(LEAST_TREND, CERTAIN * f->rate_trend_sigma) &&
          fabs(along) > LEAST_TREND)) {
        return false;
    }
    if (f->rate_trend * along < 0.0) {
        bst_process_reverse(f);
    }
    return true;
}
