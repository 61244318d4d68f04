/* What the figures of a loop mean, frame by frame, against closed forms. */
#include "sim/eval/loop_figures.h"

#include "boresight/messages.h"
#include "tests/archive_support.h"

static const double px_rad = 2.5 * BST_ARCSEC_RAD;

static bst_camera camera_of(double rotation_deg, double k1) {
    bst_camera c = {.width_px = 1000,
                    .height_px = 800,
                    .pixel_scale_arcsec = 2.5,
                    .rotation_deg = rotation_deg,
                    .boresight_offset_px = {40, -25},
                    .distortion = {.k1 = k1}};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    return c;
}

/* On the whole sphere the size is the angle, and the position angle is the focal plane's. */
static void pointing_error_on_the_sphere(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++) {
        double rotation_deg = k == 0 ? 0 : k == 1 ? 37 : -120;
        bst_camera c = camera_of(rotation_deg, k == 1 ? 0.1 : 0);
        /* an attitude that is not the identity */
        bst_quat q = bst_quat_from_rotvec((bst_vec3){0.3, -1.1, 0.7});
        bst_quat back = {-q.x, -q.y, -q.z, q.w};
        for (int angle_deg = 1; angle_deg < 180; angle_deg += 16) {
            for (int way_deg = -170; way_deg < 180; way_deg += 20) {
                double angle = angle_deg * BST_DEG_RAD, way = way_deg * BST_DEG_RAD, x, y;
                bst_vec3 cam = {sin(angle) * cos(way), sin(angle) * sin(way), cos(angle)};
                double size = bst_eval_pointing_error_px(
                    &c, 0, q, bst_vec3_scale(bst_quat_rotate(back, cam), 3.0), &x, &y);
                /* the focal plane's columns lie rotation_deg from camera x towards camera y */
                double in_plane = way - rotation_deg * BST_DEG_RAD, px = angle / px_rad;
                bst_assert_close(size, px, 1e-8 * px); /* rounding of the rotations: 1e-15 rad */
                bst_assert_close(x, px * cos(in_plane), 1e-8 * px);
                bst_assert_close(y, px * sin(in_plane), 1e-8 * px);
            }
        }
    }
}

/* Close to the boresight it is the difference of places on the focal plane. */
static void pointing_error_near_the_boresight(void **state) {
    (void)state;
    const double rotations[] = {0, 37, -120};
    for (int k = 0; k < 3; k++) {
        bst_camera c = camera_of(rotations[k], 0.1);
        const double places[][2] = {{3, 0}, {0, 3}, {-2, 1.5}, {0.01, -0.02}};
        for (int i = 0; i < 4; i++) {
            double cx = bst_camera_centre_x(&c), cy = bst_camera_centre_y(&c), x, y;
            bst_vec3 cam = bst_camera_unproject(&c, cx + places[i][0], cy + places[i][1]);
            bst_eval_pointing_error_px(&c, 0, (bst_quat){0, 0, 0, 1}, cam, &x, &y);
            /* 3 px are 3.6e-5 rad: tangent, angle and distortion differ by 1e-9 of it; rounding of
             * directions 1e-11 px */
            bst_assert_close(x, places[i][0], 3e-9);
            bst_assert_close(y, places[i][1], 3e-9);
            /* an exposure of half the scale has twice the pixels */
            double twice =
                bst_eval_pointing_error_px(&c, 1.25, (bst_quat){0, 0, 0, 1}, cam, &x, &y);
            bst_assert_close(twice, 2 * hypot(places[i][0], places[i][1]), 6e-9);
        }
    }
}

static void a_track_is_on_target_within_5_px(void **state) {
    (void)state;
    /* moving along y, off along z, x and y; the place holds 2 s before the frame */
    const bst_vec3 truth = {1, 0, 0}, rate = {0, 4 * px_rad, 0};
    const struct {
        double y_px, z_px;
        bool on;
    } cases[] = {{0, 4.99, true},   {0, 5.01, false},  {0, -5.01, false}, {4.99, 0, true},
                 {-5.01, 0, false}, {3.5, -3.5, true}, {3.6, 3.6, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_vec3 then = {1, (cases[i].y_px - 8) * px_rad, cases[i].z_px * px_rad};
        assert_int_equal(bst_eval_track_is_on_target(bst_vec3_unit(then), rate, 2.0, truth, px_rad),
                         cases[i].on);
    }
    assert_true(bst_loop_settles(true, BST_MODE_TRACK, 2.999));
    assert_false(bst_loop_settles(true, BST_MODE_TRACK, 3.001));
    assert_false(bst_loop_settles(true, BST_MODE_ACQUIRE, 0.1));
    assert_false(bst_loop_settles(false, BST_MODE_TRACK, 0.1));
    assert_false(bst_loop_settles(true, BST_MODE_TRACK, NAN));
}

static bst_status archive_statistics(void *self, bst_archive *archive) {
    bst_error_statistics_archive(self, archive);
    return BST_OK;
}

static void statistics_of_both_axes(void **state) {
    (void)state;
    bst_error_statistics s = {0};
    assert_true(isnan(bst_error_statistics_rms(&s)) && isnan(bst_error_statistics_bias(&s)));
    assert_true(isnan(bst_error_statistics_quantile(&s, 0.5)));
    assert_true(isnan(bst_error_statistics_largest(&s)));
    const double errors[][2] = {{0, 3}, {4, 0}, {-0.5, -0.25}, {1, -7}, {0, 2}};
    double x = 0, y = 0, sum2 = 0;
    for (int i = 0; i < 5; i++) {
        bst_error_statistics_add(&s, errors[i][0], errors[i][1]);
        x += errors[i][0];
        y += errors[i][1];
        sum2 += errors[i][0] * errors[i][0] + errors[i][1] * errors[i][1];
    }
    bst_assert_close(bst_error_statistics_rms(&s), sqrt(sum2 / 5), 1e-14);
    bst_assert_close(bst_error_statistics_bias(&s), hypot(x, y) / 5, 1e-14);
    bst_assert_close(bst_error_statistics_largest(&s), sqrt(50), 1e-14);
    /* nearest rank, to half a bin of 0.1 % */
    bst_assert_close(bst_error_statistics_quantile(&s, 0.5) / 3, 1, 0.00051);
    bst_assert_close(bst_error_statistics_quantile(&s, 0.61) / 4, 1, 0.00051);
    bst_assert_close(bst_error_statistics_quantile(&s, 0.99) / sqrt(50), 1, 0.00051);
    bst_ctx ctx = {0};
    bst_error_statistics again = {0};
    test_saved saved = test_save(archive_statistics, &s);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_statistics, &again, saved));
    assert_memory_equal(&again, &s, sizeof s);
    free(saved.bytes);
    /* 180 degrees at 0.01 arcsec a pixel find a bin; no error at all is none */
    bst_error_statistics wide = {0}, none = {0};
    bst_error_statistics_add(&wide, 0, 6.48e7);
    bst_assert_close(bst_error_statistics_quantile(&wide, 0.5) / 6.48e7, 1, 0.00051);
    bst_error_statistics_add(&none, 0, 0);
    assert_true(bst_error_statistics_quantile(&none, 0.99) == 0.0);
}

/* Ten frames of which each is left out of some figure for one reason. */
static void tally_of_frames(void **state) {
    (void)state;
    const bst_loop_frame on = {.visible = true,
                               .in_track = true,
                               .acquired = true,
                               .settled = true,
                               .mode = BST_MODE_TRACK,
                               .error_px = 0.5,
                               .error_x_px = 0.3,
                               .error_y_px = -0.4};
    bst_loop_frame frames[10];
    for (int i = 0; i < 10; i++) {
        frames[i] = on;
    }
    frames[0].in_track = frames[0].acquired = frames[0].settled = false;
    frames[1].acquired = frames[1].settled = false;
    frames[2].settled = false;
    frames[3].mode = BST_MODE_COAST;
    frames[3].error_px = frames[3].error_y_px = 1e5;
    frames[4].visible = frames[4].in_track = false; /* hidden: neither lost nor pointing */
    frames[5].in_track = false;                     /* lost while visible: a break; it points */
    frames[5].error_x_px = 0;
    frames[5].error_px = 12;
    frames[5].error_y_px = 12;
    frames[6].mode = BST_MODE_REACQUIRE;
    frames[7].error_px = frames[7].error_x_px = frames[7].error_y_px = NAN;
    frames[9].in_track = false;
    bst_loop_tally t = {0};
    for (int i = 0; i < 10; i++) {
        bst_loop_tally_add(&t, &frames[i]);
    }
    bst_loop_figures f = {.wrong_target_frames = 3};
    bst_loop_tally_figures(&t, &f);
    assert_int_equal(f.frames, 10);
    assert_int_equal(f.visible_frames, 9);
    assert_int_equal(f.in_track_frames, 6);
    bst_assert_close(f.custody, 6.0 / 9.0, 1e-15);
    bst_assert_close(f.track_fraction, 5.0 / 7.0, 1e-15); /* frames 2, 3, 5 to 9 */
    assert_int_equal(f.breaks, 2);
    assert_false(f.in_track_at_end);
    assert_int_equal(f.wrong_target_frames, 3);
    assert_int_equal(f.pointing_frames, 3); /* 5, 8, 9 */
    bst_assert_close(f.pointing_rms_px, sqrt((144 + 0.25 + 0.25) / 3), 1e-14);
    bst_assert_close(f.pointing_bias_px, hypot(0.6, 12 - 0.8) / 3, 1e-14);
    bst_assert_close(f.pointing_max_px, 12, 1e-14);
    bst_assert_close(f.pointing_median_px, 0.5, 0.00026); /* half a bin of 0.1 % */
    bst_assert_close(f.pointing_p95_px, 12, 0.0061);

    bst_loop_tally none = {0};
    bst_loop_tally_figures(&none, &f);
    assert_true(isnan(f.custody) && f.track_fraction == 0 && isnan(f.pointing_rms_px));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pointing_error_on_the_sphere),
        cmocka_unit_test(pointing_error_near_the_boresight),
        cmocka_unit_test(a_track_is_on_target_within_5_px),
        cmocka_unit_test(statistics_of_both_axes),
        cmocka_unit_test(tally_of_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
