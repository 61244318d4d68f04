/* Measured directions against differences of the chain of pixel, attitude and aberration; the
 * centroids of the newest frames. */
#include "sim/run/run_directions.h"

#include "tests/archive_support.h"

static const bst_camera camera = {.width_px = 900,
                                  .height_px = 500,
                                  .pixel_scale_arcsec = 40.0,
                                  .rotation_deg = 25.0,
                                  .distortion = {0.05, 0.0, 0.0, 2e-3, -1e-3}};

/* Direction of a pixel, with the camera turned by `error` (camera axes) from its attitude. */
static bst_vec3 direction_at(const bst_camera *c, bst_quat q, const bst_light *light,
                             const double at[5]) {
    const bst_quat turned = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){at[2], at[3], at[4]}), q);
    return bst_light_unaberrate(
        light, bst_quat_rotate(bst_quat_conj(turned), bst_camera_unproject(c, at[0], at[1])));
}

/* Far off the middle of a distorted, rotated camera, with errors that slant. */
static void directions_and_their_errors(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera c = camera;
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    const bst_light light = {.velocity_mps = {-21000.0, 15000.0, 9000.0},
                             .sun_m = {1.2e11, 8e10, 3e10}};
    const bst_quat q = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    const bst_attitude_fix attitude = {.valid = true,
                                       .q_cam_from_gcrf = q,
                                       .sigma_rad = {4e-5, 9e-5, 7e-4},
                                       .correlation = {0.5, 0.6, 0.3}}; /* xy, xz, yz */
    const double x = 840.0, y = 30.0, cov[3] = {0.09, -0.05, 0.16};
    double middle[5] = {x, y, 0.0, 0.0, 0.0}, j[2][5], full[5][5] = {{0.0}}, sum[2][2] = {{0.0}};
    const bst_vec3 seen = direction_at(&c, q, &light, middle);
    double px[2];
    assert_true(bst_camera_project(&c, bst_quat_rotate(q, bst_light_aberrate(&light, seen)), &px[0],
                                   &px[1]));
    bst_assert_close(px[0], x, 1e-6);
    bst_assert_close(px[1], y, 1e-6);
    const bst_vec3 e1 = bst_vec3_unit((bst_vec3){-seen.y, seen.x, 0.0});
    const bst_vec3 e2 = bst_vec3_cross(seen, e1);
    for (int i = 0; i < 5; i++) {
        const double step = i < 2 ? 0.1 : 1e-5;
        double side[5];
        memcpy(side, middle, sizeof side);
        side[i] += step;
        bst_vec3 d = direction_at(&c, q, &light, side);
        side[i] -= 2.0 * step;
        d = bst_vec3_scale(bst_vec3_sub(d, direction_at(&c, q, &light, side)), 0.5 / step);
        j[0][i] = bst_vec3_dot(d, e1);
        j[1][i] = bst_vec3_dot(d, e2);
    }
    full[0][0] = cov[0];
    full[0][1] = full[1][0] = cov[1];
    full[1][1] = cov[2];
    for (int i = 0; i < 3; i++) {
        full[2 + i][2 + i] = attitude.sigma_rad[i] * attitude.sigma_rad[i];
    }
    full[2][3] = full[3][2] = 0.5 * 4e-5 * 9e-5;
    full[2][4] = full[4][2] = 0.6 * 4e-5 * 7e-4;
    full[3][4] = full[4][3] = 0.3 * 9e-5 * 7e-4;
    bst_od_observation out = {.shared_change = 0.0};
    bst_run_measure_direction(&c, x, y, cov, &attitude, &light, &out);
    bst_assert_close(bst_vec3_angle(out.direction, seen), 0.0, 1e-11);
    for (int a = 0; a < 2; a++) {
        for (int b = 0; b < 2; b++) {
            for (int i = 0; i < 5; i++) {
                for (int k = 0; k < 5; k++) {
                    sum[a][b] += j[a][i] * full[i][k] * j[b][k];
                }
            }
            /* of the shared parts, about camera x and y, only products matter */
            double shared = 0.0, about_xy = 0.0;
            for (int i = 0; i < 2; i++) {
                shared += out.shared_rad[a][i] * out.shared_rad[b][i];
                for (int k = 0; k < 2; k++) {
                    about_xy += j[a][2 + i] * full[2 + i][2 + k] * j[b][2 + k];
                }
            }
            bst_assert_close(shared, about_xy, 1e-3 * 1e-8);
        }
    }
    /* aberration changes scales by 1e-4 */
    bst_assert_close(out.cov_11, sum[0][0], 1e-3 * sum[0][0]);
    bst_assert_close(out.cov_22, sum[1][1], 1e-3 * sum[1][1]);
    bst_assert_close(out.cov_12, sum[0][1], 1e-3 * sqrt(sum[0][0] * sum[1][1]));
    assert_true(fabs(sum[0][1]) > 0.1 * sqrt(sum[0][0] * sum[1][1]));
}

/* The share of the stars that stay, 1 - d / s, has the integral s / 2 over d: that of exp(-2 d / s)
 * too. A roll keeps the field's middle. */
static void stars_leave_the_field(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera c = camera;
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    const double side = 700.0 * 40.0 * BST_ARCSEC_RAD;
    const bst_quat q = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    const bst_quat turned = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0.006, -0.008, 0.0}), q);
    const bst_quat rolled = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, 0.3}), q);
    bst_assert_close(bst_run_change_of_stars(&c, q, turned), 2.0 * 0.01 / side, 1e-9);
    bst_assert_close(bst_run_change_of_stars(&c, q, rolled), 0.0, 1e-9);
}

static bst_status archive_centroids(void *self, bst_archive *archive) {
    return bst_run_centroids_archive(self, archive);
}

/* Frame n has n % 4 + 1 detections. */
static void add_frame(bst_ctx *ctx, bst_run_centroids *c, int n) {
    bst_detections *d = calloc(1, sizeof *d + 4 * sizeof *d->items);
    assert_non_null(d);
    d->exposure_id = n;
    d->count = n % 4 + 1;
    for (int i = 0; i < d->count; i++) {
        d->items[i] = (bst_detection){.x_px = 10.0 * n + i,
                                      .y_px = 3.0 * n - i,
                                      .cov_xx = 1.0 + n + i,
                                      .cov_xy = 0.1 * n + i,
                                      .cov_yy = 2.0 + n + i};
    }
    bst_assert_ok(ctx, bst_run_centroids_add(ctx, c, d));
    free(d);
}

static void check_frames(const bst_run_centroids *c, int first, int last) {
    for (int n = 1; n <= last; n++) {
        for (int i = 0; i <= n % 4; i++) {
            const bst_run_centroid *found = bst_run_centroids_find(c, n, 10.0 * n + i, 3.0 * n - i);
            assert_true((found != NULL) == (n >= first));
            assert_true(!found ||
                        (found->x_px == 10.0 * n + i && found->y_px == 3.0 * n - i &&
                         found->cov_px2[0] == 1.0 + n + i && found->cov_px2[1] == 0.1 * n + i &&
                         found->cov_px2[2] == 2.0 + n + i));
        }
        assert_null(bst_run_centroids_find(c, n, 10.0 * n, 3.0 * n - 1));
        assert_null(bst_run_centroids_find(c, n, 10.0 * n + 1, 3.0 * n));
    }
}

/* The newest eight frames are kept, also by a saved state that goes on. */
static void the_newest_frames_are_kept(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_run_centroids c = {.next = 0}, again = {.next = 0};
    for (int n = 1; n <= 13; n++) {
        add_frame(&ctx, &c, n);
        check_frames(&c, n - BST_RUN_CENTROID_FRAMES + 1, n);
    }
    test_saved saved = test_save(archive_centroids, &c);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_centroids, &again, saved));
    check_frames(&again, 6, 13);
    add_frame(&ctx, &again, 14);
    check_frames(&again, 7, 14);
    free(saved.bytes);
    bst_run_centroids_clear(&c);
    bst_run_centroids_clear(&again);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(directions_and_their_errors),
        cmocka_unit_test(stars_leave_the_field),
        cmocka_unit_test(the_newest_frames_are_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
