#include "imgproc/window_plan.h"

#include <math.h>

#include "boresight/vec.h"

/* Windows that cover a larger share of the frame than this save nothing. */
static const double WINDOWS_SHARE = 0.5;

/* Adds windows for the brightest of `count` expected stars; these are moved to the front, brightest
 * first. */
static void add_star_windows(const bst_window_plan_input *in, bst_predicted_stars *sky,
                             bst_region_of_interest *windows, int count) {
    double half = 0.5 * (double)in->config->window_px;
    int chosen = 0;
    for (; chosen < count && chosen < in->config->window_stars; chosen++) {
        bst_imgproc_expected_star *e = sky->expected;
        int best = chosen;
        for (int i = chosen + 1; i < count; i++) {
            best =
                e[i].v_mag < e[best].v_mag || (e[i].v_mag == e[best].v_mag && e[i].id < e[best].id)
                    ? i
                    : best;
        }
        bst_imgproc_expected_star star = e[best];
        e[best] = e[chosen];
        e[chosen] = star;
        double dx, dy;
        bst_camera_motion_streak(in->motion, in->camera, star.x_px, star.y_px, &dx, &dy);
        const bst_searched_window why = {
            .reason = BST_REGION_STAR, .star_id = star.id, .x_px = star.x_px, .y_px = star.y_px};
        (void)bst_region_of_interest_add(windows, &in->message->window, &why, half + 0.5 * fabs(dx),
                                         half + 0.5 * fabs(dy));
    }
}

bst_status bst_window_plan_make(bst_ctx *ctx, const bst_window_plan_input *in,
                                bst_predicted_stars *sky, bst_region_of_interest *windows,
                                bool *use) {
    const bst_predictions *predictions = in->predictions;
    const bst_window *frame = &in->message->window;
    *use = false;
    bst_region_of_interest_clear(windows);
    double half = 0.5 * (double)in->config->window_px, scale = bst_camera_scale_rad(in->camera);
    bool target = false;
    for (int i = 0; i < predictions->count; i++) {
        const bst_prediction *p = &predictions->items[i];
        bst_vec3 d = bst_vec3_unit(
            bst_vec3_axpy(p->direction_gcrf, in->predictions_age_s, p->rate_gcrf_radps));
        bst_vec3 v = bst_quat_rotate(in->q_cam_from_gcrf, bst_light_aberrate(in->light, d));
        double reach = half + 5.0 * p->sigma_rad / scale;
        bst_searched_window why = {
            .reason = p->target_of_interest ? BST_REGION_TARGET : BST_REGION_TRACK,
            .track_id = p->track_id};
        bool added = bst_camera_project(in->camera, v, &why.x_px, &why.y_px) &&
                     bst_region_of_interest_add(windows, frame, &why, reach, reach);
        target = target || (added && p->target_of_interest);
    }
    if (!target || windows->count == BST_WINDOWS_MAX) {
        return BST_OK;
    }
    int expected = 0;
    const bst_predicted_stars_query query = {in->q_cam_from_gcrf, in->light, *frame, 0.0,
                                             in->v_limit};
    BST_TRY(bst_predicted_stars_expect(ctx, sky, &query, &expected));
    add_star_windows(in, sky, windows, expected);
    *use = bst_region_of_interest_settle(windows, frame, in->message->binning, WINDOWS_SHARE);
    return BST_OK;
}
