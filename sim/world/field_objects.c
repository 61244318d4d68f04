/* The objects of a field query. */
#include "sim/world/field_objects.h"

/* Whether the object's path over the image comes near the window. */
static bool path_touches(const bst_object_query *q, const bst_source *s) {
    enum { PIECES = 8 };
    bst_vec3 at[PIECES + 1];
    double x[PIECES + 1], y[PIECES + 1], bend = 0.0;
    bool front[PIECES + 1];
    for (int k = 0; k <= PIECES; k++) {
        at[k] = bst_source_direction(s, (double)k / PIECES);
        x[k] = y[k] = 0.0;
        front[k] = bst_camera_project(q->camera, bst_quat_rotate(q->q_mid, at[k]), &x[k], &y[k]);
    }
    for (int k = 1; k < PIECES; k++) {
        /* an eighth of this is what the path lies off the chord */
        bend = front[k - 1] && front[k] && front[k + 1]
                   ? fmax(bend,
                          hypot(x[k - 1] - 2.0 * x[k] + x[k + 1], y[k - 1] - 2.0 * y[k] + y[k + 1]))
                   : INFINITY;
    }
    for (int k = 0; k < PIECES; k++) {
        double arc = bst_vec3_angle(at[k], at[k + 1]);
        if (bst_vec3_angle(q->centre, at[k]) > q->radius + 1.25 * arc) {
            continue;
        }
        double reach = q->margin_px + bend;
        if (fmax(x[k], x[k + 1]) >= q->window.x0 - reach &&
            fmin(x[k], x[k + 1]) <= q->window.x0 + q->window.width - 1 + reach &&
            fmax(y[k], y[k + 1]) >= q->window.y0 - reach &&
            fmin(y[k], y[k + 1]) <= q->window.y0 + q->window.height - 1 + reach) {
            return true;
        }
    }
    return false;
}

bst_status bst_field_object(bst_ctx *ctx, const bst_object_query *q, int object,
                            bst_source_path *path, bst_source *out, bool *there) {
    bst_sight mid;
    *there = false;
    bst_status status =
        bst_view_path(ctx, q->view, q->observer, object, q->start_s, q->end_s, path, &mid);
    if (status == BST_ERR_NUMERIC) {
        return BST_OK;
    }
    BST_TRY(status);
    if (!(mid.range_m > 0.0)) {
        return BST_OK;
    }
    *out = (bst_source){.kind = BST_SOURCE_OBJECT,
                        .id = (uint32_t)object,
                        .apparent_mid = mid.apparent,
                        .path = path,
                        .v_mag = mid.v_mag,
                        .sunlit_fraction = mid.sunlit_fraction,
                        .phase_rad = mid.phase_rad,
                        .range_m = mid.range_m,
                        .occulted = mid.occulted};
    out->electrons_per_s =
        mid.occulted || isinf(mid.v_mag) ? 0.0 : bst_camera_electrons_per_s(q->camera, mid.v_mag);
    bst_vec3_to_radec(mid.geometric, &out->ra_rad, &out->dec_rad);
    *there = path_touches(q, out);
    return BST_OK;
}
