#include "imgproc/identify/predicted_stars.h"
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(expected_stars_lead_back_to_the_catalogue),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
