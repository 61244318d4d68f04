#include "imgproc/identify/predicted_stars.h"
#include "imgproc/window_plan.h"
#include "tests/test_support.h"

/* Where expected stars are put, undone by other functions: pixel to direction, aberration and
 * deflection off, against the catalogue's own direction. 1e-9 rad (0.2 mas, 7e-5 px): what the
 * inverse of the light corrections guarantees, with room for rounding at 1 rad. */
static void check(bst_camera camera) {
    bst_ctx ctx = {0};
    bst_stars *stars = NULL;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_light light = {{29000.0, -7000.0, 3000.0}, {1e11, 1.1e11, 0.2e11}};
    bst_vec3 direction = bst_vec3_from_radec(1.4, -0.1);
    bst_quat q = bst_quat_look(direction, (bst_vec3){0.1, 0.3, 0.9});
    bst_window window = {1000, 200, 2000, 1500};
    bst_predicted_stars sky;
    bst_assert_ok(&ctx, bst_predicted_stars_create(&ctx, &camera, stars, 2022.46, 4096, &sky));
    int count = 0;
    bst_predicted_stars_query query = {q, &light, window, 50.0, 7.0};
    bst_assert_ok(&ctx, bst_predicted_stars_expect(&ctx, &sky, &query, &count));
    assert_true(count > 10);
    for (int i = 0; i < count; i++) {
        const bst_imgproc_expected_star *e = &sky.expected[i];
        assert_true(e->x_px >= 950 && e->x_px <= 3049 && e->y_px >= 150 && e->y_px <= 1749);
        bst_star star;
        bst_assert_ok(&ctx, bst_stars_find(&ctx, stars, e->id, 2022.46, &star));
        bst_vec3 apparent =
            bst_quat_rotate(bst_quat_conj(q), bst_camera_unproject(&camera, e->x_px, e->y_px));
        bst_vec3 place = bst_light_catalogue_star(&light, apparent);
        bst_assert_close(bst_vec3_angle(place, star.icrs), 0.0, 1e-9);
        /* aberration is there: v/c sin(angle), up to 20 arcsec */
        assert_true(bst_vec3_angle(apparent, star.icrs) > 1e-5);
        assert_true(e->v_mag <= 7.0);
    }
    bst_predicted_stars_free(&sky);

    /* No star of the window is missed: a whole-sky query finds no other inside it. Room for fewer
     * stars than there are brings the brightest. */
    bst_predicted_stars small;
    bst_assert_ok(&ctx, bst_predicted_stars_create(&ctx, &camera, stars, 2022.46, 40, &small));
    int fewer = 0;
    query.v_limit = 9.0;
    bst_assert_ok(&ctx, bst_predicted_stars_expect(&ctx, &small, &query, &fewer));
    assert_true(fewer > 0 && fewer <= 40);
    bst_predicted_stars_free(&small);
    static bst_star all[60000];
    int total = 0, inside = 0;
    bst_assert_ok(
        &ctx, bst_stars_query(&ctx, stars, direction, BST_PI, 7.0, 2022.46, all, 60000, &total));
    assert_true(total > 10000 && total <= 60000);
    for (int i = 0; i < total; i++) {
        double x = 0, y = 0;
        bst_vec3 v = bst_quat_rotate(q, bst_light_apparent_star(&light, all[i].icrs));
        inside += bst_camera_project(&camera, v, &x, &y) && x >= 950 && x <= 3049 && y >= 150 &&
                  y <= 1749;
    }
    assert_int_equal(inside, count);
    bst_stars_close(stars);
}

static void expected_stars_lead_back_to_the_catalogue(void **state) {
    (void)state;
    bst_camera camera = {.width_px = 4096, .height_px = 2048, .pixel_scale_arcsec = 12.0};
    check(camera);
    /* rotated, 6 % of barrel distortion in the corner (0.133), then 10 % of pincushion */
    camera.rotation_deg = 130.0;
    camera.distortion.k1 = -0.06 / 0.0177;
    check(camera);
    camera.distortion.k1 = 0.1 / 0.0177;
    camera.boresight_offset_px[0] = -200;
    check(camera);
}

/* A window of these half widths, cut at the frame; edges within a pixel, by rounding. */
static void expect_window(const bst_region_of_interest *w, const bst_window *frame, double x,
                          double y, double half_x, double half_y) {
    double x0 = fmax(x - half_x, frame->x0), x1 = fmin(x + half_x, frame->x0 + frame->width - 1);
    double y0 = fmax(y - half_y, frame->y0), y1 = fmin(y + half_y, frame->y0 + frame->height - 1);
    for (int i = 0; i < w->count; i++) {
        const bst_window *a = &w->items[i];
        if (fabs(a->x0 - x0) <= 1.0 && fabs(a->x0 + a->width - 1 - x1) <= 1.0 &&
            fabs(a->y0 - y0) <= 1.0 && fabs(a->y0 + a->height - 1 - y1) <= 1.0) {
            return;
        }
    }
    fail_msg("no window about (%g, %g), %g and %g to the sides", x, y, half_x, half_y);
}

/* Windows about tracks, where they are seen at mid-exposure, five sigma wider; and about the
 * brightest stars, wider by half of their way. None without the target in the frame. */
static void windows_about_tracks_and_stars(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_stars *stars = NULL;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    const bst_camera camera = {.width_px = 2200, .height_px = 1700, .pixel_scale_arcsec = 12.0};
    const double scale = bst_camera_scale_rad(&camera), age_s = 1.5;
    const bst_light light = {{29000.0, -7000.0, 3000.0}, {1e11, 1.1e11, 0.2e11}};
    const bst_quat q = bst_quat_look(bst_vec3_from_radec(1.4, -0.1), (bst_vec3){0.1, 0.3, 0.9});
    /* the images move by (r_y, -r_x) with a turn r: 30 to the right, 12 up */
    const bst_camera_motion motion = {.q_cam_from_gcrf = q,
                                      .turn_cam_rad = {12.0 * scale, 30.0 * scale, 0.0}};
    const bst_frame_message message = {.window = {300, 200, 1600, 1200}, .binning = 1};
    const bst_imgproc_config config = {.window_px = 40, .window_stars = 3};
    bst_predictions *predictions = calloc(1, sizeof *predictions + 2 * sizeof(bst_prediction));
    assert_non_null(predictions);
    bst_predicted_stars sky;
    bst_assert_ok(&ctx, bst_predicted_stars_create(&ctx, &camera, stars, 2022.0, 4096, &sky));
    const bst_window_plan_input in = {.camera = &camera,
                                      .config = &config,
                                      .v_limit = 7.0,
                                      .message = &message,
                                      .motion = &motion,
                                      .light = &light,
                                      .predictions = predictions,
                                      .predictions_age_s = age_s,
                                      .q_cam_from_gcrf = q};
    const double places[2][2] = {{1200.4, 330.7}, {1885.2, 900.6}}, sigmas_px[2] = {6.0, 2.0};
    for (int target = 0; target < 2; target++) {
        predictions->count = 2;
        for (int i = 0; i < 2; i++) { /* some 10 px before that at their epoch */
            bst_vec3 seen = bst_quat_rotate(
                bst_quat_conj(q), bst_camera_unproject(&camera, places[i][0], places[i][1]));
            bst_vec3 from = bst_light_unaberrate(&light, seen);
            bst_vec3 rate = bst_vec3_scale(bst_vec3_cross(from, (bst_vec3){0.2, 0.4, 0.3}), 1e-3);
            predictions->items[i] =
                (bst_prediction){.direction_gcrf = bst_vec3_axpy(from, -age_s, rate),
                                 .rate_gcrf_radps = rate,
                                 .sigma_rad = sigmas_px[i] * scale,
                                 .track_id = 7 + i,
                                 .target_of_interest = target && i == 0};
        }
        bst_region_of_interest windows;
        bool use;
        bst_assert_ok(&ctx, bst_window_plan_make(&ctx, &in, &sky, &windows, &use));
        assert_int_equal(use, target);
        if (!target) {
            continue;
        }
        assert_int_equal(windows.count, 5);
        assert_int_equal(windows.planned_count, 5);
        for (int i = 0; i < 5; i++) { /* why, and where it was expected */
            const bst_searched_window *p = &windows.planned[i];
            assert_int_equal(p->reason, i == 0   ? BST_REGION_TARGET
                                        : i == 1 ? BST_REGION_TRACK
                                                 : BST_REGION_STAR);
            assert_int_equal(p->track_id, i < 2 ? 7 + i : 0);
            assert_true((p->star_id != 0) == (i >= 2));
            if (i < 2) { /* the place is seen, moved on for age_s: rounding */
                bst_assert_close(p->x_px, places[i][0], 1e-3);
                bst_assert_close(p->y_px, places[i][1], 1e-3);
            }
        }
        for (int i = 0; i < 2; i++) {
            double half = 20.0 + 5.0 * sigmas_px[i];
            expect_window(&windows, &message.window, places[i][0], places[i][1], half, half);
        }
        int count;
        const bst_predicted_stars_query query = {q, &light, message.window, 0.0, 7.0};
        bst_assert_ok(&ctx, bst_predicted_stars_expect(&ctx, &sky, &query, &count));
        double before = -INFINITY;
        for (int k = 0; k < 3; k++) { /* the brightest one that is fainter than the last */
            int best = -1;
            for (int i = 0; i < count; i++) {
                double v = sky.expected[i].v_mag;
                best = v > before && (best < 0 || v < sky.expected[best].v_mag) ? i : best;
            }
            before = sky.expected[best].v_mag;
            expect_window(&windows, &message.window, sky.expected[best].x_px,
                          sky.expected[best].y_px, 20.0 + 15.0, 20.0 + 6.0);
        }
    }
    bst_predicted_stars_free(&sky);
    bst_stars_close(stars);
    free(predictions);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(expected_stars_lead_back_to_the_catalogue),
        cmocka_unit_test(windows_about_tracks_and_stars),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
