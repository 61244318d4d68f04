#include "sim/eval/target_match.h"

#include <math.h>

bool bst_eval_match_belongs(const bst_eval_match_target *t, double reach, const bst_detection *d) {
    double x = d->x_px - t->x_px, y = d->y_px - t->y_px, length = hypot(t->dx_px, t->dy_px);
    if (0.5 * length <= reach) {
        return hypot(x, y) <= reach;
    }
    double along = (x * t->dx_px + y * t->dy_px) / length;
    double across = (y * t->dx_px - x * t->dy_px) / length;
    return fabs(along) <= 0.5 * length && fabs(across) <= reach;
}

static double distance(const bst_eval_match_target *t, const bst_detection *d) {
    return hypot(d->x_px - t->x_px, d->y_px - t->y_px);
}

int bst_eval_match_targets(const bst_eval_match_target *targets, int count, double reach_px,
                           const bst_detections *detections, int *of_target, int *of_detection) {
    int matched = 0;
    double widest = reach_px;
    for (int t = 0; t < count; t++) {
        of_target[t] = -1;
        widest = fmax(widest, reach_px + 0.5 * hypot(targets[t].dx_px, targets[t].dy_px));
    }
    for (int i = 0; i < detections->count; i++) {
        const bst_detection *d = &detections->items[i];
        int nearest = -1;
        for (int t = 0; t < count; t++) {
            if (fabs(d->y_px - targets[t].y_px) > widest ||
                fabs(d->x_px - targets[t].x_px) > widest ||
                !bst_eval_match_belongs(&targets[t], reach_px, d)) {
                continue;
            }
            if (nearest < 0 || distance(&targets[t], d) < distance(&targets[nearest], d)) {
                nearest = t;
            }
        }
        of_detection[i] = nearest;
        if (nearest < 0) {
            continue;
        }
        int held = of_target[nearest];
        if (held < 0 || distance(&targets[nearest], d) <
                            distance(&targets[nearest], &detections->items[held])) {
            of_target[nearest] = i;
        }
        matched += held < 0;
    }
    return matched;
}
