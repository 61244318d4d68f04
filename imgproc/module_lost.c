/* Star identification of the module while telemetry may be wrong by any angle. */
#include <assert.h>
#include <math.h>

#include "imgproc/module_internal.h"

/* SNR of the faintest stars that patterns are made of. */
static const double PATTERN_SNR = 8.0;
/* Error of the pixel scale of a solved frame, relative: 1 px over half a field of 500 px. */
static const double SOLVED_SCALE_SIGMA = 2e-3;

void bst_imgproc_lost_open(bst_imgproc_state *m, const bst_stars *stars, double julian_year) {
    bool unknown = m->config->attitude == 1;
    m->lost = (bst_imgproc_lost){.enabled = unknown || m->config->lost_after_frames > 0,
                                 .lost = unknown,
                                 .error = BST_QUAT_IDENTITY,
                                 .built_v_limit = NAN,
                                 .julian_year = julian_year,
                                 .stars = stars};
}

void bst_imgproc_lost_close(bst_imgproc_lost *lost) {
    bst_lost_in_space_free(lost->solver);
    bst_star_patterns_free(lost->patterns);
    lost->solver = NULL;
    lost->patterns = NULL;
}

/* The patterns are not archived: they follow from the catalogue and built_v_limit. */
void bst_imgproc_lost_archive(bst_imgproc_lost *lost, bst_archive *archive) {
    if (!lost->enabled) {
        return;
    }
    bst_archive_bool(archive, &lost->lost);
    bst_archive_bool(archive, &lost->known);
    BST_ARCHIVE(archive, lost->error);
    BST_ARCHIVE(archive, lost->frames_without_stars);
    BST_ARCHIVE(archive, lost->built_v_limit);
    if (bst_archive_is_restoring(archive)) {
        bst_imgproc_lost_close(lost);
    }
}

bool bst_imgproc_lost_attitude(const bst_imgproc_lost *lost, bst_quat q_telemetry_from_gcrf,
                               bst_quat *q_cam_from_gcrf) {
    if (!lost->enabled || !lost->known) {
        return false;
    }
    *q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(q_telemetry_from_gcrf, lost->error));
    return true;
}

/* Shorter side of the camera's field, rad. */
static double field_rad(const bst_camera *camera) {
    double w = (double)camera->width_px, h = (double)camera->height_px;
    double x = 0.5 * (w - 1.0), y = 0.5 * (h - 1.0);
    return fmin(bst_vec3_angle(bst_camera_unproject(camera, -0.5, y),
                               bst_camera_unproject(camera, w - 0.5, y)),
                bst_vec3_angle(bst_camera_unproject(camera, x, -0.5),
                               bst_camera_unproject(camera, x, h - 0.5)));
}

/* Builds the patterns at their first use: their depth is that of the frame. */
static bst_status open_solver(bst_ctx *ctx, bst_imgproc_state *m, double v_limit) {
    bst_imgproc_lost *lost = &m->lost;
    if (lost->solver) {
        return BST_OK;
    }
    lost->built_v_limit = isnan(lost->built_v_limit) ? v_limit : lost->built_v_limit;
    const bst_star_patterns_options options = {.field_rad = field_rad(&m->camera),
                                               .v_limit = lost->built_v_limit,
                                               .julian_year = lost->julian_year};
    BST_TRY(bst_star_patterns_create(ctx, lost->stars, &options, &lost->patterns));
    return bst_lost_in_space_create(ctx, &m->camera, lost->stars, lost->patterns, lost->julian_year,
                                    (int)m->config->capacity, &lost->solver);
}

/* Solves the frame without an attitude; on success sets the attitude of the detections. */
static bst_status solve(bst_ctx *ctx, bst_imgproc_state *m, const bst_imgproc_lane *l,
                        const bst_imgproc_exposure *e, bst_detections *out,
                        bst_lost_in_space_result *result) {
    double snr = fmax(PATTERN_SNR, out->threshold_snr);
    double v_limit =
        m->plugin ? bst_plugin_detector_v_limit(m->plugin, snr) : bst_imgproc_v_limit(l->ip, snr);
    BST_TRY(open_solver(ctx, m, v_limit));
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.scale_tolerance = m->config->lost_scale_tolerance;
    const bst_lost_in_space_frame frame = {.items = out->items,
                                           .count = out->count,
                                           .window = e->message->window,
                                           .v_limit = v_limit,
                                           .light = &e->light};
    BST_TRY(bst_lost_in_space_solve(ctx, m->lost.solver, &options, &frame, result));
    if (result->solved) {
        out->q_cam_from_gcrf = result->q_cam_from_gcrf;
    }
    return BST_OK;
}

/* Publishes that the attitude was found. */
static void publish_found(struct bst_step *step, const bst_lost_in_space_result *result,
                          bst_quat error) {
    double ra, dec;
    bst_vec3_to_radec(
        bst_quat_rotate(bst_quat_conj(result->q_cam_from_gcrf), (bst_vec3){0.0, 0.0, 1.0}), &ra,
        &dec);
    bst_step_event(step, "attitude_found",
                   "boresight at RA %.5f Dec %.5f deg, telemetry off by %.4f deg, %d of %d "
                   "stars, scale %.5f",
                   ra / BST_DEG_RAD, dec / BST_DEG_RAD,
                   bst_vec3_norm(bst_quat_to_rotvec(error)) / BST_DEG_RAD, result->matched,
                   result->predicted, result->scale);
}

/* Counts a frame without stars; after enough of them the attitude is unknown. */
static void count_frame(bst_imgproc_state *m, struct bst_step *step) {
    bst_imgproc_lost *lost = &m->lost;
    lost->frames_without_stars++;
    if (!lost->lost && m->config->lost_after_frames > 0 &&
        lost->frames_without_stars >= m->config->lost_after_frames) {
        lost->lost = true;
        bst_step_event(step, "attitude_unknown", "no star identified in %lld frames",
                       (long long)lost->frames_without_stars);
    }
}

/* Starts the camera's calibration at the scale of a solved frame. */
static bst_status take_scale(bst_ctx *ctx, bst_imgproc_state *m, double scale) {
    if (!m->config->camera_calibration.enabled || m->calibrator.frames > 0) {
        return BST_OK;
    }
    return bst_camera_calibrator_set(ctx, &m->calibrator, scale, 0.0, SOLVED_SCALE_SIGMA);
}

bst_status bst_imgproc_lost_identify(bst_imgproc_state *m, struct bst_step *step,
                                     const bst_imgproc_lane *l, const bst_imgproc_exposure *e,
                                     bst_detections *out, bst_quat *q_cam_from_gcrf) {
    bst_ctx *ctx = bst_step_ctx(step);
    bst_imgproc_lost *lost = &m->lost;
    bool blind = lost->lost && !lost->known && m->config->attitude == 1;
    if (!blind) {
        BST_TRY(bst_imgproc_identify_stars(ctx, m, l, e, out, q_cam_from_gcrf));
    }
    bst_lost_in_space_result result = {.solved = false};
    if (lost->lost && out->stars_identified == 0 && m->windows.count == 0) {
        BST_TRY(solve(ctx, m, l, e, out, &result));
        if (result.solved) {
            *q_cam_from_gcrf = result.q_cam_from_gcrf;
            BST_TRY(take_scale(ctx, m, result.scale));
            BST_TRY(bst_imgproc_identify_stars(ctx, m, l, e, out, q_cam_from_gcrf));
        }
    }
    if (out->stars_identified == 0) {
        count_frame(m, step);
        return BST_OK;
    }
    lost->error = bst_quat_mul(bst_quat_conj(out->q_telemetry_from_gcrf), *q_cam_from_gcrf);
    lost->known = true;
    lost->lost = false;
    lost->frames_without_stars = 0;
    if (result.solved) {
        publish_found(step, &result, lost->error);
    }
    return BST_OK;
}
