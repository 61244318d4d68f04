/* Calibration of the camera's geometry in flight: the module's part. */
#include <math.h>
#include <string.h>

#include "imgproc/identify/null_model.h"
#include "imgproc/module_internal.h"

enum { MOST_STARS = 256, MISSES = 3 };

/* Error that a step of the coarse search may leave in the field's corner, px: within the match
 * tolerance. */
static const double COARSE_PX = 2.0;
/* Reach of the coarse search, standard deviations. */
static const double COARSE_SIGMAS = 2.5;
/* Accepted probability of a wrong camera by chance. */
static const double FALSE_RATE = 1e-6;

void bst_imgproc_calibration_open(bst_imgproc_state *m) {
    bst_camera_calibrator_begin(&m->config->camera_calibration, &m->camera, &m->calibrator);
    m->sky.camera = &m->calibrator.camera;
}

bst_status bst_imgproc_calibration_archive(bst_imgproc_state *m, bst_archive *archive) {
    if (!m->config->camera_calibration.enabled) {
        return BST_OK;
    }
    BST_TRY(bst_camera_calibrator_archive(&m->calibrator, archive));
    m->calibration_misses = bst_archive_integer(archive, m->calibration_misses, 0, INT64_MAX / 2);
    if (bst_archive_is_restoring(archive) && m->calibrator.frames > 0) {
        bst_discriminator_use_camera(m->discriminator, &m->calibrator.camera);
    }
    return BST_OK;
}

/* Scale and rotation that the coarse search tries. */
typedef struct hypothesis {
    double scale, rotation_rad;
} hypothesis;

/* Counts the stars that fit a hypothesis.
 *
 * Given:     trials  number of hypotheses
 * Returned:  logarithm of the chance that as many fit one of all hypotheses and shifts */
static double log_chance_of(bst_imgproc_state *m, const bst_starid_options *options, hypothesis h,
                            double trials, int expected, bst_detections *out) {
    bst_starid_result result = {0};
    const double c = cos(h.rotation_rad) / h.scale, s = sin(h.rotation_rad) / h.scale;
    int inside = 0;
    for (int i = 0; i < expected; i++) {
        double dx = m->sky.expected[i].x_px - options->centre_x_px;
        double dy = m->sky.expected[i].y_px - options->centre_y_px;
        bst_imgproc_expected_star *to = &m->coarse[i];
        *to = m->sky.expected[i];
        to->x_px = options->centre_x_px + c * dx - s * dy;
        to->y_px = options->centre_y_px + s * dx + c * dy;
        inside += fabs(to->x_px - options->centre_x_px) < 0.5 * options->field_width_px &&
                  fabs(to->y_px - options->centre_y_px) < 0.5 * options->field_height_px;
    }
    bst_starid_match(m->starid, options, m->coarse, expected, out->items, out->count, &result);
    bst_imgproc_forget_stars(out);
    double radius = fmin(options->tolerance_px, 4.0 * fmax(result.rms_px, 0.25));
    double chance = bst_null_model_chance(out->count * BST_PI * radius * radius,
                                          options->field_width_px * options->field_height_px);
    double shifts = fmax(options->search_radius_px * options->search_radius_px, 1.0);
    /* two stars fix shift, scale and rotation */
    return bst_null_model_log_tail(inside > 2 ? inside - 2 : 0, result.matched - 2, chance) +
           log(trials * shifts);
}

/* Searches scale and rotation on a grid. Returns true if one is found; then *best holds. */
static bool search(bst_imgproc_state *m, const bst_starid_options *options, int expected,
                   bst_detections *out, double step, hypothesis *best) {
    const bst_camera_calibrator_config *config = &m->config->camera_calibration;
    int scales = (int)ceil(COARSE_SIGMAS * config->scale_sigma / step);
    int rotations =
        m->lost.enabled
            ? 0
            : (int)ceil(COARSE_SIGMAS * config->rotation_sigma_deg * BST_DEG_RAD / step);
    double trials = (2.0 * scales + 1.0) * (2.0 * rotations + 1.0), least = log(FALSE_RATE);
    bool found = false;
    for (int s = -scales; s <= scales; s++) {
        for (int r = -rotations; r <= rotations; r++) {
            const hypothesis h = {1.0 + s * step, r * step};
            double chance = log_chance_of(m, options, h, trials, expected, out);
            if (chance < least) {
                least = chance;
                *best = h;
                found = true;
            }
        }
    }
    return found;
}

/* Finds scale and rotation coarsely, from the onboard camera. */
static bst_status find_coarsely(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_lane *l,
                                const bst_imgproc_exposure *e, bst_detections *out, bool *found) {
    const bst_window window = e->message->window;
    double v_limit = m->plugin ? bst_plugin_detector_v_limit(m->plugin, out->threshold_snr)
                               : bst_imgproc_v_limit(l->ip, out->threshold_snr);
    double corner_px = 0.5 * hypot(window.width, window.height);
    int expected = 0;
    *found = false;
    bst_predicted_stars_query query = {out->q_cam_from_gcrf, &e->light, window,
                                       m->config->search_radius_px, v_limit};
    bst_camera_calibrator_begin(&m->config->camera_calibration, &m->camera, &m->calibrator);
    BST_TRY(bst_predicted_stars_expect(ctx, &m->sky, &query, &expected));
    expected = expected < BST_IMGPROC_COARSE_STARS ? expected : BST_IMGPROC_COARSE_STARS;
    const bst_starid_options options = {m->config->search_radius_px,
                                        m->config->match_tolerance_px,
                                        bst_camera_centre_x(&m->camera),
                                        bst_camera_centre_y(&m->camera),
                                        window.width,
                                        window.height};
    hypothesis best;
    double step = 2.0 * COARSE_PX / corner_px;
    bst_imgproc_forget_stars(out);
    if (search(m, &options, expected, out, step, &best)) {
        *found = true;
        BST_TRY(
            bst_camera_calibrator_set(ctx, &m->calibrator, best.scale, best.rotation_rad, step));
    }
    return BST_OK;
}

/* Updates the estimate with the identified stars. */
static bool update(bst_imgproc_state *m, const bst_imgproc_exposure *e, const bst_detections *out) {
    bst_camera_calibrator_star stars[MOST_STARS];
    const uint32_t unusable = BST_DETECTION_SATURATED | BST_DETECTION_EDGE | BST_DETECTION_BLEND;
    bst_quat q = m->sky.q_cam_from_gcrf;
    int count = 0;
    for (int i = 0; i < out->count && count < MOST_STARS; i++) {
        const bst_detection *d = &out->items[i];
        int star = bst_starid_star_of(m->starid, i);
        if (star < 0 || (d->flags & unusable)) {
            continue;
        }
        const bst_imgproc_expected_star *s = &m->sky.expected[star];
        stars[count++] = (bst_camera_calibrator_star){
            .cam = bst_camera_unproject(&m->calibrator.camera, s->x_px, s->y_px),
            .x_px = d->x_px,
            .y_px = d->y_px,
            .cov_xx = d->cov_xx,
            .cov_xy = d->cov_xy,
            .cov_yy = d->cov_yy};
    }
    double middle = 0.5 * ((double)e->message->start_tick + (double)e->message->end_tick);
    bst_vec3 telemetry =
        bst_quat_to_rotvec(bst_quat_mul(out->q_telemetry_from_gcrf, bst_quat_conj(q)));
    const bst_camera_calibrator_frame frame = {
        .stars = stars,
        .count = count,
        .seconds = middle / (double)m->tick_rate_hz,
        /* a telemetry that may be wrong by any angle does not measure the roll */
        .telemetry_roll_rad = m->lost.enabled ? NAN : telemetry.z};
    return bst_camera_calibrator_update(&m->calibrator, &frame);
}

bst_status bst_imgproc_calibrate_camera(bst_imgproc_state *m, struct bst_step *step,
                                        const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                        bst_detections *out, bst_quat *q_cam_from_gcrf) {
    bst_ctx *ctx = bst_step_ctx(step);
    if (!m->config->camera_calibration.enabled || (m->lost.enabled && !m->lost.known)) {
        return BST_OK;
    }
    bool first = m->calibrator.frames == 0;
    m->calibration_misses = out->stars_identified > 0 ? 0 : m->calibration_misses + 1;
    bool lost_scale = m->lost.enabled && first && m->calibrator.x[0] != 0.0;
    if ((first && !lost_scale) || m->calibration_misses >= MISSES) {
        bool found;
        BST_TRY(find_coarsely(ctx, m, l, e, out, &found));
        bst_optics_photometer_begin(&m->photometer);
        *q_cam_from_gcrf = out->q_cam_from_gcrf;
        BST_TRY(bst_imgproc_identify_stars(ctx, m, l, e, out, q_cam_from_gcrf));
        if (!found) {
            return BST_OK;
        }
    }
    if (update(m, e, out)) {
        bst_discriminator_use_camera(m->discriminator, &m->calibrator.camera);
        m->calibration_misses = 0;
    }
    bst_camera_calibrator_get(&m->calibrator, &out->calibration);
    if (first && out->calibration.frames > 0) {
        bst_step_event(step, "camera_calibrated",
                       "pixel scale %.6f +- %.6f of the onboard one, rotation off by %.4f deg, %d "
                       "stars",
                       out->calibration.scale, sqrt(out->calibration.covariance[0][0]),
                       out->calibration.rotation_rad / BST_DEG_RAD, out->stars_identified);
    }
    return BST_OK;
}
