/* Identification of the stars of a frame. */
#include <math.h>

#include "imgproc/module_internal.h"

/* Expected stars include those down to this share of the detection threshold, which noise may lift
 * above it. */
static const double SNR_SHARE_EXPECTED = 0.7;
/* Search radius for stars once the tracker has estimated the pointing error. */
static const double LOCKED_RADIUS_PX = 10.0;
/* Shift above which a distorted field is matched twice. */
static const double RESHIFT_PX = 2.0;

/* Keeps only the expected stars that can lie in the windows; returns their number. */
static int keep_stars_in_windows(bst_imgproc_state *m, int expected) {
    int kept = 0;
    for (int i = 0; i < expected; i++) {
        const bst_imgproc_expected_star *e = &m->sky.expected[i];
        if (bst_region_of_interest_hold(&m->windows, e->x_px, e->y_px, LOCKED_RADIUS_PX)) {
            m->sky.expected[kept++] = *e;
        }
    }
    return kept;
}

void bst_imgproc_forget_stars(bst_detections *out) {
    for (int i = 0; i < out->count; i++) {
        if (out->items[i].label == BST_LABEL_STAR) {
            out->items[i].label = BST_LABEL_UNKNOWN;
            out->items[i].label_probability = 0.0;
            out->items[i].star_id = 0;
        }
    }
}

bst_status bst_imgproc_identify_stars(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_lane *l,
                                      const bst_imgproc_exposure *e, bst_detections *out,
                                      bst_quat *q_cam_from_gcrf) {
    const bst_window window = e->message->window;
    double snr = SNR_SHARE_EXPECTED * out->threshold_snr;
    double v_limit =
        m->plugin ? bst_plugin_detector_v_limit(m->plugin, snr) : bst_imgproc_v_limit(l->ip, snr);
    int expected = 0;
    bst_predicted_stars_query query = {out->q_cam_from_gcrf, &e->light, window,
                                       m->config->search_radius_px, v_limit};
    BST_TRY(bst_predicted_stars_expect(ctx, &m->sky, &query, &expected));
    expected = m->windows.count > 0 ? keep_stars_in_windows(m, expected) : expected;
    bst_starid_options options = {m->config->search_radius_px,
                                  m->config->match_tolerance_px,
                                  bst_camera_centre_x(&m->camera),
                                  bst_camera_centre_y(&m->camera),
                                  window.width,
                                  window.height};
    bst_starid_result result = {0};
    if (e->locked && LOCKED_RADIUS_PX < options.search_radius_px) {
        options.search_radius_px = LOCKED_RADIUS_PX;
        bst_starid_match(m->starid, &options, m->sky.expected, expected, out->items, out->count,
                         &result);
        options.search_radius_px = m->config->search_radius_px;
    }
    if (result.matched == 0) {
        bst_starid_match(m->starid, &options, m->sky.expected, expected, out->items, out->count,
                         &result);
    }
    const bst_camera *camera = m->sky.camera;
    if (camera->geometry.general && result.matched > 0 &&
        hypot(result.shift_x_px, result.shift_y_px) > RESHIFT_PX) {
        /* distortion makes the shift uneven over the field: match again with the corrected attitude
         */
        *q_cam_from_gcrf = bst_starid_attitude(camera, &options, &result, out->q_cam_from_gcrf);
        bst_imgproc_forget_stars(out);
        query.q_cam_from_gcrf = *q_cam_from_gcrf;
        BST_TRY(bst_predicted_stars_expect(ctx, &m->sky, &query, &expected));
        expected = m->windows.count > 0 ? keep_stars_in_windows(m, expected) : expected;
        options.search_radius_px = fmin(options.search_radius_px, LOCKED_RADIUS_PX);
        bst_starid_match(m->starid, &options, m->sky.expected, expected, out->items, out->count,
                         &result);
    }
    if (result.matched > 0) {
        *q_cam_from_gcrf = bst_starid_attitude(camera, &options, &result, *q_cam_from_gcrf);
    }
    out->stars_identified = result.matched;
    for (int i = 0; i < out->count; i++) {
        int star = bst_starid_star_of(m->starid, i);
        if (star >= 0) {
            bst_optics_photometer_add(&m->photometer, &out->items[i], m->sky.expected[star].v_mag);
        }
    }
    return BST_OK;
}
