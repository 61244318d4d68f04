/* Attitude of a frame: from its stars, else by telemetry and its filtered error. */
#include <string.h>

#include "sim/optics/calibrated_camera.h"
#include "tracker/tracker_internal.h"

/* Error of the telemetry, beyond what was expected, that is kept beside the filter, rad: 5.7 deg.
 */
static const double LARGE_ERROR_RAD = 0.1;

/* Direction of a catalogue star, from the cache or the catalogue. */
static bool find_star(bst_tracker *t, uint32_t id, bst_vec3 *icrs) {
    cached_star *slot = &t->cache[(id * 2654435761u >> 16) & (STAR_CACHE - 1)];
    if (slot->id != id) {
        bst_vec3 direction;
        if (!t->star(t->star_user, id, &direction)) {
            return false;
        }
        *slot = (cached_star){.id = id, .icrs = direction};
    }
    *icrs = slot->icrs;
    return true;
}

bst_quat bst_tracker_telemetry(const bst_tracker_input *input) {
    return bst_quat_unit(input->q_telemetry_mid ? *input->q_telemetry_mid
                                                : input->detections->q_telemetry_from_gcrf);
}

/* Solves the attitude from the identified stars. Returns the number of t->stars considered. */
static int solve_attitude(bst_tracker *t, const bst_detections *d, const bst_light *light,
                          bst_quat q_telemetry, bst_attitude_solution *out) {
    int count = 0;
    for (int i = 0; i < d->count && count < MAX_STARS; i++) {
        const bst_detection *item = &d->items[i];
        bst_vec3 icrs;
        if (item->label != BST_LABEL_STAR || item->star_id == 0 ||
            (item->flags & (BST_DETECTION_EDGE | BST_DETECTION_BLEND)) ||
            !find_star(t, item->star_id, &icrs)) {
            continue;
        }
        t->stars[count++] =
            (bst_attitude_star){.id = item->star_id,
                                .apparent_gcrf = bst_light_apparent_star(light, icrs),
                                .x_px = item->x_px,
                                .y_px = item->y_px,
                                .cov_xx = item->cov_xx,
                                .cov_xy = item->cov_xy,
                                .cov_yy = item->cov_yy};
    }
    /* the stars were identified with this attitude: it is close */
    bst_quat q = d->q_cam_from_gcrf;
    bool given = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w > 0.5;
    bst_attitude_solve(&t->camera, &t->attitude_params, given ? q : q_telemetry, t->stars, count,
                       out);
    return count;
}

/* Adds the displacement that all streaks share to the covariance of an attitude: rotations about
 * camera x and y, which move the stars at the middle of the frame by -y and x. Returns the share of
 * the variance about both that was there before. */
static double add_shared_shift(const bst_camera *camera, const bst_detections *d,
                               double covariance[3][3]) {
    const double before = covariance[0][0] + covariance[1][1], scale = bst_camera_scale_rad(camera);
    double k[2][2];
    bst_camera_jacobian(camera, (bst_vec3){0.0, 0.0, 1.0}, k);
    /* px by rotation about x: -k[.][1] / scale, about y: k[.][0] / scale */
    const double a = -k[0][1], b = k[0][0], c = -k[1][1], e = k[1][0];
    const double f = scale / (a * e - b * c);
    const double inverse[2][2] = {{e * f, -b * f}, {-c * f, a * f}};
    const double shift[2][2] = {{d->shared_xx, d->shared_xy}, {d->shared_xy, d->shared_yy}};
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            for (int m = 0; m < 4; m++) {
                covariance[i][j] += inverse[i][m / 2] * shift[m / 2][m % 2] * inverse[j][m % 2];
            }
        }
    }
    const double after = covariance[0][0] + covariance[1][1];
    return after > 0.0 ? before / after : 1.0;
}

bst_quat bst_tracker_refer(const bst_tracker *t, bst_quat q_telemetry) {
    return t->referred ? bst_quat_unit(bst_quat_mul(q_telemetry, t->reference)) : q_telemetry;
}

/* Moves a large error from the filter to the reference if the filter just started with it: the
 * filter is one of small angles. An error that grew to that size stays in the filter, which follows
 * its rate.
 *
 * Given:     expected  error that the filter had predicted, GCRF axes, rad
 *            q_stars, covariance  the fix */
static void rebase(bst_tracker *t, bst_vec3 expected, bst_quat q_telemetry, bst_quat q_stars,
                   const double covariance[3][3]) {
    bst_vec3 e = bst_vec3_from_array(t->error.e);
    if (t->error.fixes > 1 || bst_vec3_norm(bst_vec3_sub(e, expected)) <= LARGE_ERROR_RAD) {
        return;
    }
    t->referred = true;
    t->reference = bst_quat_unit(bst_quat_mul(bst_quat_conj(q_telemetry), q_stars));
    t->error = (bst_attitude_error){.started = false};
    bst_attitude_error_update(&t->error, &t->error_params, bst_tracker_refer(t, q_telemetry),
                              (bst_vec3){0.0, 0.0, 0.0}, covariance);
}

/* Sets the camera as image processing knows it in this frame; one that folds the image is not used.
 */
static void use_calibration(bst_tracker *t, const bst_detections *d) {
    bst_ctx ignored = {0};
    if (bst_camera_apply_calibration(&ignored, &t->onboard, &d->calibration, &t->camera) !=
        BST_OK) {
        t->camera = t->onboard;
    }
}

void bst_tracker_find_attitude(bst_tracker *t, const bst_tracker_input *input,
                               const bst_light *light, int64_t tick, double dt_s,
                               bst_tracker_attitude *out) {
    memset(out, 0, sizeof *out);
    use_calibration(t, input->detections);
    bst_quat q_telemetry = bst_tracker_telemetry(input);
    bst_attitude_solution solution;
    int star_count = solve_attitude(t, input->detections, light, q_telemetry, &solution);
    bst_attitude_error_predict(&t->error, &t->error_params, dt_s);
    out->fix.tick = tick;
    out->fix.stars = solution.stars_used;
    out->fix.valid = solution.valid;
    out->fix.rms_px = solution.rms_px;
    double by_stars = 1.0; /* share of the variance about camera x and y */
    if (solution.valid) {
        double covariance[3][3]; /* of the stars' own errors and of the displacement of all */
        memcpy(covariance, solution.covariance, sizeof covariance);
        by_stars = add_shared_shift(&t->camera, input->detections, covariance);
        out->q_cam_from_gcrf = solution.q_cam_from_gcrf;
        memcpy(out->covariance_cam, covariance, sizeof out->covariance_cam);
        out->fix.error_cam_rad =
            bst_quat_to_rotvec(bst_quat_mul(solution.q_cam_from_gcrf, bst_quat_conj(q_telemetry)));
        /* Stars that contradict the telemetry's history come from a camera that turned unevenly
         * during the exposure. Their attitude is not the mid-exposure one and must not be used for
         * pointing. */
        bst_quat q_known = bst_tracker_refer(t, q_telemetry);
        bst_vec3 e =
            t->referred
                ? bst_quat_to_rotvec(bst_quat_mul(solution.q_cam_from_gcrf, bst_quat_conj(q_known)))
                : out->fix.error_cam_rad;
        bst_vec3 expected =
            t->error.started ? bst_vec3_from_array(t->error.e) : (bst_vec3){0.0, 0.0, 0.0};
        out->usable =
            bst_attitude_error_update(&t->error, &t->error_params, q_known, e, covariance);
        if (out->usable) {
            rebase(t, expected, q_telemetry, solution.q_cam_from_gcrf, covariance);
        }
        out->fix.valid = out->usable;
        if (out->usable) {
            bst_attitude_shared_update(&t->shared, &solution, t->stars, star_count);
        }
    } else {
        bst_vec3 rate;
        bst_quat q_known = bst_tracker_refer(t, q_telemetry);
        bst_attitude_error_get(&t->error, &t->error_params, q_known, &out->fix.error_cam_rad, &rate,
                               out->covariance_cam);
        out->rate_sigma_radps =
            sqrt(fmax(fmax(t->error.p[3][3], t->error.p[4][4]), t->error.p[5][5]));
        out->usable = true;
        out->q_cam_from_gcrf =
            bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(out->fix.error_cam_rad), q_known));
        if (t->referred) {
            out->fix.error_cam_rad =
                bst_quat_to_rotvec(bst_quat_mul(out->q_cam_from_gcrf, bst_quat_conj(q_telemetry)));
        }
    }
    out->fix.q_cam_from_gcrf = out->q_cam_from_gcrf;
    out->fix.shared = by_stars * bst_attitude_shared_get(&t->shared);
    for (int i = 0; i < 3; i++) {
        out->fix.sigma_rad[i] = sqrt(out->covariance_cam[i][i]);
    }
    for (int i = 0; i < 3; i++) { /* xy, xz, yz */
        const int a = i / 2, b = i < 1 ? 1 : 2;
        const double of_both = out->fix.sigma_rad[a] * out->fix.sigma_rad[b];
        out->fix.correlation[i] =
            of_both > 0.0 ? fmin(fmax(out->covariance_cam[a][b] / of_both, -1.0), 1.0) : 0.0;
    }
    out->usable = out->usable &&
                  fmax(out->fix.sigma_rad[0], out->fix.sigma_rad[1]) <= t->max_attitude_sigma_rad;
}
