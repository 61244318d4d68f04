#include "scenegen/smear/motion.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"

double bst_motion_spread_px(const bst_smear_path_point *path, int count, double scale_rad,
                            double stretch, double roll_px, double corner_px) {
    double corner = corner_px * scale_rad, worst = 0.0;
    for (int k = 0; k < count; k++) {
        double tilt = hypot(path[k].p[0], path[k].p[1]) * scale_rad / stretch;
        double roll = fabs(path[k].p[2]) / roll_px;
        /* first order, plus the products of rotations */
        double moved = roll * corner + tilt * corner * (corner + tilt);
        moved += 0.5 * roll * (roll * corner + tilt) + tilt * roll * corner * (1.0 + corner);
        worst = fmax(worst, moved);
    }
    return worst / scale_rad;
}

void bst_motion_to_shift(bst_smear_path_point *point, double scale_rad, double stretch,
                         double roll_px) {
    double tilt = scale_rad / stretch;
    bst_quat q = bst_quat_from_rotvec(
        (bst_vec3){point->p[0] * tilt, point->p[1] * tilt, point->p[2] / roll_px});
    bst_vec3 v = bst_quat_rotate(q, (bst_vec3){0.0, 0.0, 1.0});
    double f = v.z > 1e-6 ? 1.0 / (v.z * tilt) : 1e6 / tilt;
    *point = (bst_smear_path_point){{v.x * f, v.y * f, 0.0}, point->s};
}

bst_status bst_motion_midpoints(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                int parts, bst_smear_node_list *list) {
    assert(path && list && count >= 2 && parts >= 1);
    if (list->count + parts > list->capacity) {
        int capacity = list->count + parts;
        bst_smear_node *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d nodes of a smear", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    double from = path[0].s, total = path[count - 1].s - from;
    for (int n = 0, k = 0; n < parts; n++) {
        double s = from + total * (n + 0.5) / parts;
        while (k + 2 < count && path[k + 1].s < s) {
            k++;
        }
        double length = path[k + 1].s - path[k].s;
        double u = length > 0.0 ? (s - path[k].s) / length : 0.0;
        bst_smear_node *node = &list->items[list->count++];
        *node = (bst_smear_node){.weight = 1.0 / parts};
        for (int i = 0; i < 3; i++) {
            node->p[i] = path[k].p[i] + u * (path[k + 1].p[i] - path[k].p[i]);
        }
    }
    return BST_OK;
}

/* Brightness is constant between path points; a varying source gets this many parts per exposure,
 * and a part for each change by RATE_STEP of the mean. */
enum { RATE_PARTS = 512 };
#define RATE_STEP 0.02

double bst_motion_stretch(const bst_scene_source *source, double begin_s, double length_s,
                          double duration_s, double from, int *parts) {
    const bst_scene_source_rate *r = source->rate;
    *parts = 1;
    if (!r || !(length_s > 0.0) || !(duration_s > 0.0)) {
        return 1.0;
    }
    double start = (begin_s + from * length_s) / duration_s, per = length_s / duration_s;
    double to = 1.0;
    for (int n = 0; n < r->count; n++) {
        if (r->u[n] > start + 1e-9 * per) {
            to = fmin(1.0, from + (r->u[n] - start) / per);
            break;
        }
    }
    to = to > 1.0 - 1e-9 ? 1.0 : to;
    double end = start + (to - from) * per;
    double change =
        fabs(bst_scene_source_rate_at(source, end) - bst_scene_source_rate_at(source, start));
    double wanted = fmin(fmax(change / RATE_STEP, (end - start) * RATE_PARTS), 1000.0);
    *parts = wanted > 1.0 ? (int)ceil(wanted) : 1;
    return to;
}

double bst_smear_nodes_peak_share(const bst_smear_node *nodes, int count, double psf_sigma_px) {
    double scale = 0.5 / (psf_sigma_px * psf_sigma_px), best = 0.0;
    int stride = count / 128 + 1;
    for (int a = 0; a < count; a += stride) {
        double sum = 0.0;
        for (int n = 0; n < count; n++) {
            double dx = nodes[n].p[0] - nodes[a].p[0], dy = nodes[n].p[1] - nodes[a].p[1];
            double q = (dx * dx + dy * dy) * scale;
            sum += q < 20.0 ? nodes[n].weight * exp(-q) : 0.0;
        }
        best = fmax(best, sum);
    }
    double line = erf(0.5 / (psf_sigma_px * sqrt(2.0)));
    return best * line * line;
}

/* Where a straight part of a path, which begins within a ball, leaves it. Returned: share of the
 * part, 2 if its end is within too. */
static double leaves_ball(const double a[3], const double b[3], const double centre[3],
                          double reach) {
    double dd = 0.0, da = 0.0, aa = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = b[i] - a[i], from = a[i] - centre[i];
        dd += d * d;
        da += d * from;
        aa += from * from;
    }
    double free = reach * reach - aa; /* |a + t d - centre|^2 = reach^2 */
    return !(dd + 2.0 * da > free) ? 2.0 : (sqrt(fmax(da * da + dd * free, 0.0)) - da) / dd;
}

/* Most light of the pieces into which a path is cut where it is `reach` away from the piece's first
 * point. */
static double most_light(const bst_smear_path_point *path, int count, double reach) {
    double most = 0.0, begun = path[0].s, centre[3];
    memcpy(centre, path[0].p, sizeof centre);
    for (int k = 1; k < count; k++) {
        const bst_smear_path_point *a = &path[k - 1], *b = &path[k];
        double t = leaves_ball(a->p, b->p, centre, reach), light = b->s - a->s, length = 0.0;
        if (t > 1.0) {
            continue;
        }
        most = fmax(most, a->s + t * light - begun);
        for (int i = 0; i < 3; i++) {
            length += (b->p[i] - a->p[i]) * (b->p[i] - a->p[i]);
        }
        double piece = reach / sqrt(length), whole = floor((1.0 - t) / piece);
        if (whole > 0.0) {
            most = fmax(most, piece * light);
            t = fmin(t + whole * piece, 1.0);
        }
        for (int i = 0; i < 3; i++) {
            centre[i] = a->p[i] + t * (b->p[i] - a->p[i]);
        }
        begun = a->s + t * light;
    }
    return fmax(most, path[count - 1].s - begun);
}

bool bst_motion_rests(const bst_smear_path_point *path, int count, double reach_px) {
    double light = most_light(path, count, reach_px);
    return most_light(path, count, 0.25 * reach_px) > 0.6 * light ||
           light > 0.6 * most_light(path, count, 4.0 * reach_px);
}
