/* The sky background where an edge of the Earth's disc is on the sensor. */
#include "tests/world/skylight_scene.h"

/* With an edge on the sensor the map is drawn pixel by pixel, the same in every window. */
static void edges_are_drawn_pixel_by_pixel(void **state) {
    (void)state;
    bst_world *world = test_world(SKY_WORLD("300", "\"model\": \"sky\""));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    bst_scene_surroundings around = look_down((bst_vec3){4.2164e7, 0, 0}, 0);
    double to = asin(BST_EARTH_RADIUS_M / 4.2164e7);
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -to, 0}), around.q[k]);
    }
    bst_skylight *a, *b;
    const bst_skylight_map *whole = make(world, &around, (bst_window){0, 0, 300, 300}, &a);
    const bst_skylight_map *part = make(world, &around, (bst_window){2, 100, 31, 12}, &b);
    assert_true(whole->step_px == 1 && part->step_px == 1 && whole->columns == 300);
    for (int y = 100; y < 112; y++) {
        for (int x = 2; x < 33; x++) {
            assert_true(bst_skylight_at(whole, x, y) == bst_skylight_at(part, x, y));
        }
    }
    /* full daylight on one side, with the limb's glancing light; the dark sky on the other */
    double scale = bst_camera_scale_rad(camera);
    double day = bst_camera_electrons_per_s(camera, 0) * scale * scale * 0.3 / BST_PI * FULL_SUN;
    double left = bst_skylight_at(whole, 0, 150), right = bst_skylight_at(whole, 299, 150);
    double bright = fmax(left, right), dark = fmin(left, right);
    /* 150 px of 20 arcsec inside the limb, seen at an angle from the normal of asin(sine), which is
     * the Sun's less the direction's own; 1 % for the tangent plane and the flattening */
    double from_nadir = to - 150 * scale;
    double sine = sin(from_nadir) * 4.2164e7 / BST_EARTH_RADIUS_M;
    double sunward = cos(asin(sine) - from_nadir);
    bst_assert_close(bright, day * sunward, 0.01 * day * sunward);
    assert_true(dark < 1e-3 * bright && dark > 0);
    bst_skylight_free(a);
    bst_skylight_free(b);
    bst_world_free(world);
}

/* A map for places only has the same values as the whole one, at pixels and between them. */
static void places_agree_with_the_whole_map(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world(SKY_WORLD("300", "\"model\": \"sky\""));
    bst_scene_surroundings around = look_down((bst_vec3){4.2164e7, 0, 0}, 0);
    double to = asin(BST_EARTH_RADIUS_M / 4.2164e7);
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -to, 0}), around.q[k]);
    }
    const bst_window window = {10, 20, 250, 240};
    bst_skylight *a, *b;
    const bst_skylight_map *whole = make(world, &around, window, &a), *places;
    bst_assert_ok(&ctx, bst_skylight_create(&ctx, world, bst_world_camera(world, 0, 0), &b));
    bst_skylight_set_places_only(b);
    bst_assert_ok(&ctx, bst_skylight_make(&ctx, b, &around, window, &places));
    assert_true(places->at_pixels != NULL && places->step_px > 1 && !whole->at_pixels);
    double least = INFINITY, most = 0.0;
    for (int i = 0; i < 4000; i++) {
        /* outside of the window the border's value holds */
        double x = 5.0 + (i * 37 % 2600) * 0.1, y = 15.0 + (i * 91 % 2500) * 0.1;
        double e = bst_skylight_at(whole, x, y);
        /* what the whole map's squares are interpolated to, in sigma of the noise or as a share */
        bst_assert_close(bst_skylight_at(places, x, y), e, fmax(0.02 * sqrt(e), 4e-4 * e));
        least = fmin(least, e);
        most = fmax(most, e);
    }
    assert_true(most > 100 * least);
    bst_skylight_free(a);
    bst_skylight_free(b);
    bst_world_free(world);
}

/* Largest difference of a map from every pixel's own value, over what is allowed: 0.02 sigma of the
 * value's photon noise, or 4e-4 of the value where that is more. */
static double worst_pixel(bst_world *world, const bst_scene_surroundings *around) {
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double scale = bst_camera_scale_rad(camera);
    double sky = bst_camera_background_e_per_s(camera);
    double sun = bst_camera_electrons_per_s(camera, 0) * scale * scale;
    bst_skylight *s;
    const bst_skylight_map *map = make(world, around, (bst_window){0, 0, 300, 300}, &s);
    assert_int_equal(map->step_px, 1);
    bst_discs discs;
    bst_discs_make(camera, around, &discs);
    double worst = 0.0, least = INFINITY, most = 0.0;
    for (int i = 0; i < 300 * 300; i++) {
        int x = i % 300, y = i / 300;
        bst_disc_light l = bst_discs_light(&discs, bst_camera_unproject(camera, x, y));
        double e = sky * (1 - l.earth) + sun * l.sunlight;
        e *= bst_camera_illumination(camera, x, y);
        double allowed = fmax(0.02 * sqrt(fmax(e, 1.0)), 4e-4 * e);
        worst = fmax(worst, fabs(bst_skylight_at(map, x, y) - e) / allowed);
        least = fmin(least, e);
        most = fmax(most, e);
    }
    bst_skylight_free(s);
    assert_true(most > 2 * least);
    return worst;
}

/* Squares are interpolated where that is right: at the Earth's limb that fades over hundreds of
 * pixels, seen from a geostationary and a low orbit, at rest and while the camera slews along and
 * across it. */
static void interpolated_squares_are_right(void **state) {
    (void)state;
    static const struct {
        double radius_m, off_px, slew_px[2];
    } of[] = {{4.2164e7, 0, {0, 0}},     {4.2164e7, 40, {0, 90}},  {4.2164e7, -60, {70, 20}},
              {4.2164e7, 30, {600, 50}}, {7.2e6, 0, {0, 0}},       {7.2e6, 100, {40, 0}},
              {7.2e6, -100, {0, 200}},   {4.2164e7, 120, {0, 0.5}}};
    bst_world *world = test_world(SKY_WORLD("300", "\"zodiacal\": false"));
    double scale = bst_camera_scale_rad(bst_world_camera(world, 0, 0));
    for (size_t c = 0; c < sizeof of / sizeof *of; c++) {
        bst_scene_surroundings around = look_down((bst_vec3){of[c].radius_m, 0, 0}, 0);
        double to = asin(BST_EARTH_RADIUS_M / of[c].radius_m) + of[c].off_px * scale;
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            double u = ((double)k / BST_DISC_PARTS - 0.5) * scale;
            bst_quat turn = bst_quat_from_rotvec(
                (bst_vec3){of[c].slew_px[0] * u, -to + of[c].slew_px[1] * u, 0});
            around.q[k] = bst_quat_mul(turn, around.q[k]);
        }
        double worst = worst_pixel(world, &around);
        if (!(worst < 1.0)) {
            fail_msg("scene %zu: %g times what is allowed", c, worst);
        }
    }
    bst_world_free(world);
}

/* The same for a crescent of the Moon, 30 degrees from the Sun, for the Sun, and for the Earth's
 * limb beyond the edge of vignetting, at rest and in a slew. */
static void other_edges_are_right(void **state) {
    (void)state;
    enum { MOON, SUN, VIGNETTING, SCENES };
    bst_world *open = test_world(SKY_WORLD("300", "\"zodiacal\": false"));
    bst_world *vignetted = test_world(
        SKY_WORLD("300",
                  "\"zodiacal\": false}, \"optics\": {\"vignetting\": {\"model\": \"cos4\", "
                  "\"limit_px\": 120}"));
    double scale = bst_camera_scale_rad(bst_world_camera(open, 0, 0));
    for (int c = 0; c < 2 * SCENES; c++) {
        int kind = c / 2, slew_px = c % 2 * 40;
        bst_vec3 eye = {4.2164e7, 0, 0};
        double to = kind == VIGNETTING ? asin(BST_EARTH_RADIUS_M / eye.x) : 1.0;
        bst_vec3 towards = {-cos(to), sin(to), 0}; /* the middle of the sensor */
        bst_scene_surroundings around = look_down(eye, to);
        if (kind == MOON) {
            bst_vec3 sun = {-cos(to + BST_PI / 6), sin(to + BST_PI / 6), 0};
            around.bodies.moon_m = bst_vec3_axpy(eye, 3.844e8, towards);
            around.bodies.sun_m = bst_vec3_axpy(eye, BST_AU_M, sun);
        } else if (kind == SUN) {
            around.bodies.sun_m = bst_vec3_axpy(eye, BST_AU_M, towards);
        }
        around.light.sun_m = bst_vec3_sub(around.bodies.sun_m, eye);
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            double u = ((double)k / BST_DISC_PARTS - 0.5) * scale * slew_px;
            around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){u, u, 0}), around.q[k]);
        }
        double worst = worst_pixel(kind == VIGNETTING ? vignetted : open, &around);
        if (!(worst < 1.0)) {
            fail_msg("scene %d: %g times what is allowed", c, worst);
        }
    }
    bst_world_free(open);
    bst_world_free(vignetted);
}

/* A uniform sky that is cut off by vignetting at the farthest corner of a sensor of 300 x 200
 * pixels, whichever corner that is: each pixel has the sky's light or none, by its own distance. */
static void vignetting_cuts_any_corner(void **state) {
    (void)state;
    static const double offset[8][2] = {{21, 9},   {-21, 9},   {21, -9},   {-21, -9},
                                        {149, 99}, {-149, 99}, {149, -99}, {-149, -99}};
    static const double beyond_px[] = {-60, -33, -20, -5, -1.5, 2};
    for (int corner = 0; corner < 8; corner++) {
        const double cx = 149.5 + offset[corner][0], cy = 99.5 + offset[corner][1];
        const double far_px = hypot(fmax(cx, 299 - cx), fmax(cy, 199 - cy));
        for (size_t k = 0; k < sizeof beyond_px / sizeof *beyond_px; k++) {
            const double limit = far_px + beyond_px[k];
            char text[1500];
            snprintf(text, sizeof text,
                     "{\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": "
                     "\"neossat\", " TEST_NEOSSAT
                     ", \"sensors\": [{\"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": "
                     "0.15, \"width_px\": 300, \"height_px\": 200, \"background_mag_arcsec2\": 19, "
                     "\"boresight_offset_px\": [%g, %g], \"optics\": {\"vignetting\": "
                     "{\"limit_px\": %.6f}}}}]}]}",
                     offset[corner][0], offset[corner][1], limit);
            bst_world *world = test_world(text);
            const bst_camera *camera = bst_world_camera(world, 0, 0);
            bst_scene_surroundings around = look_down((bst_vec3){4.2164e7, 0, 0}, 0.5 * BST_PI);
            around.exposure_s = 100;
            const double sky = 100 * bst_camera_background_e_per_s(camera);
            bst_skylight *s;
            const bst_skylight_map *map = make(world, &around, (bst_window){0, 0, 300, 200}, &s);
            int dark = 0;
            for (int i = 0; i < 300 * 200; i++) {
                const double r = hypot(i % 300 - cx, i / 300 - cy);
                const double e = r <= limit ? sky : 0.0;
                /* floats */
                bst_assert_close(bst_skylight_at(map, i % 300, i / 300), e, 1e-5 * sky);
                dark += r > limit;
            }
            assert_true((dark > 0) == (beyond_px[k] < 0));
            bst_skylight_free(s);
            bst_world_free(world);
        }
    }
}

/* Background at the nodes (32, 32) and (0, 0), and at (63, 63), in the band lwir behind optics of
 * 300 K, 0.2 m, 3 arcsec, a throughput of 0.5 and 0.8 e per photon; vignetted. */
static void lwir_background(const char *emissivity, const char *background,
                            const bst_scene_surroundings *around, double value[3]) {
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": "
             "\"neossat\", " TEST_NEOSSAT
             ", \"sensors\": [{\"camera\": {\"pixel_scale_arcsec\": "
             "3, \"aperture_m\": 0.2, \"width_px\": 64, \"height_px\": 64, "
             "\"quantum_efficiency\": 0.8, \"throughput\": 0.5, \"background_mag_arcsec2\": 21, "
             "\"band\": {\"preset\": \"lwir\", \"optics_temperature_k\": 300, "
             "\"optics_emissivity\": %s, \"optics_beam_factor\": 4}, \"optics\": {\"vignetting\": "
             "{\"model\": \"polynomial\", \"coefficients\": [-0.5, 0, 0]}}, \"background\": "
             "{\"starlight\": false, %s}}}]}]}",
             emissivity, background);
    bst_world *world = test_world(text);
    bst_skylight *s;
    const bst_skylight_map *map = make(world, around, (bst_window){0, 0, 64, 64}, &s);
    value[0] = bst_skylight_at(map, 32, 32);
    value[1] = bst_skylight_at(map, 0, 0);
    value[2] = bst_skylight_at(map, 63, 63);
    bst_skylight_free(s);
    bst_world_free(world);
}

/* Light of warm optics is added once, whatever the sky is, and is not vignetted: with an emissivity
 * of 0.1 over four times the beam 4.11576e9 e/s (test_band.c, by hand), without emission none. The
 * exposure lasts 3 s. */
static void warm_optics_count_once(void **state) {
    (void)state;
    static const char *const models[] = {"\"stray_e_per_s\": 1", "\"model\": \"sky\""};
    bst_scene_surroundings around = look_down((bst_vec3){4.2e7, 0, 0}, 2);
    around.exposure_s = 3;
    for (int m = 0; m < 2; m++) {
        double warm[3], cold[3];
        lwir_background("0.1", models[m], &around, warm);
        lwir_background("0", models[m], &around, cold);
        for (int place = 0; place < 2; place++) {
            assert_true(cold[place] >= 0 && cold[place] < 1e-6 * warm[place]);
            /* digits of the number above, and floats */
            bst_assert_close(warm[place] / (3 * 4.11576e9), 1, 1e-4);
        }
    }
}

/* The night side of an Earth of 300 K fills the field, or the part beyond a limb that passes
 * through its middle, in the equator's plane: 2.43206e19 e/s for each sr (test_band.c, by hand) of
 * pixels of 2.11539e-10 sr, less at the corner, where 1 - r^2 / 2 of it passes. */
static void heat_of_the_earth_is_vignetted(void **state) {
    (void)state;
    bst_scene_surroundings around = look_down((bst_vec3){-4.2e7, 0, 0}, BST_PI);
    around.exposure_s = 3;
    double value[3];
    lwir_background("0", "\"model\": \"sky\", \"earth_temperature_k\": 300", &around, value);
    for (int place = 0; place < 2; place++) {
        double px = place ? 31.5 : 0.5, passed = 1 - 0.5 * (2 * px * px) / (2 * 32 * 32);
        /* digits of the numbers above, and floats */
        bst_assert_close(value[place] / (3 * 2.43206e19 * 2.11539e-10 * passed), 1, 1e-4);
    }
    around = look_down((bst_vec3){-4.2e7, 0, 0}, BST_PI - asin(BST_EARTH_RADIUS_M / 4.2e7));
    around.exposure_s = 1e-3;
    lwir_background("0", "\"model\": \"sky\", \"earth_temperature_k\": 300", &around, value);
    double lower = fmin(value[1], value[2]), upper = fmax(value[1], value[2]);
    double passed = 1 - 0.5 * 2 * 31.5 * 31.5 / (2 * 32 * 32);
    bst_assert_close(upper / (1e-3 * 2.43206e19 * 2.11539e-10 * passed), 1, 1e-4);
    assert_true(lower >= 0 && lower < 1e-6 * upper);
}

/* Where the bound says that no edge and no terminator begins, none is in the field; it says so for
 * more than half of the views that have none. With none, nodes that are computed as they are asked
 * for are those of the whole map, to the bit. */
static void bounds_of_edges_hold(void **state) {
    (void)state;
    enum { VIEWS = 400, SIDE = 13 };
    bst_world *world = test_world(SKY_WORLD("300", "\"model\": \"sky\""));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    const double scale = bst_camera_scale_rad(camera), radius = 150.0 * sqrt(2.0) * scale;
    bst_ctx ctx = {0};
    bst_skylight *by_need;
    bst_assert_ok(&ctx, bst_skylight_create(&ctx, world, camera, &by_need));
    bst_skylight_set_places_only(by_need);
    int said = 0, none = 0, compared = 0;
    for (int view = 0; view < VIEWS; view++) {
        const double distance_m = view % 2 ? 4.2164e7 : 7.2e6;
        const double limb = asin(BST_EARTH_RADIUS_M / distance_m);
        const double off = 1.1 * limb * (2.0 * fmod(0.618034 * view, 1.0) - 1.0);
        bst_scene_surroundings around = look_down((bst_vec3){distance_m, 0, 0}, off);
        const double sun = 2.0 * BST_PI * fmod(0.414214 * view, 1.0);
        around.bodies.sun_m = (bst_vec3){BST_AU_M * cos(sun), BST_AU_M * sin(sun), 3e10};
        around.light.sun_m = bst_vec3_sub(around.bodies.sun_m, around.eye_m);
        bst_discs discs;
        bst_discs_make(camera, &around, &discs);
        double edge = INFINITY;
        bool day = false, night = false;
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double x = i % SIDE * 299.0 / (SIDE - 1), y = i / SIDE * 299.0 / (SIDE - 1);
            const bst_vec3 d = bst_camera_unproject(camera, x, y);
            const bool lit = bst_discs_light(&discs, d).sides & 1U;
            edge = fmin(edge, bst_discs_edge_px(&discs, d));
            day = day || lit;
            night = night || (bst_discs_any(&discs) && !lit);
        }
        const bool says = bst_discs_none_begins(&discs, (bst_vec3){0, 0, 1}, radius, 34.0);
        const bool has = edge < 34.0 || (day && night);
        assert_false(says && has);
        said += says;
        none += !has;
        if (!has && bst_discs_any(&discs) && compared < 20) {
            bst_skylight *all;
            const bst_window window = {0, 0, 300, 300};
            const bst_skylight_map *whole = make(world, &around, window, &all), *few;
            bst_assert_ok(&ctx, bst_skylight_make(&ctx, by_need, &around, window, &few));
            for (int i = 0; i < 50 && whole->step_px > 1; i++) {
                const double x = i * 37 % 300, y = i * 91 % 300 + 0.25;
                assert_true(bst_skylight_at(few, x, y) == bst_skylight_at(whole, x, y));
            }
            compared += few->at_nodes != NULL;
            bst_skylight_free(all);
        }
    }
    assert_true(none < VIEWS && 2 * said > none);
    assert_int_equal(compared, 20);
    bst_skylight_free(by_need);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_are_drawn_pixel_by_pixel),
        cmocka_unit_test(places_agree_with_the_whole_map),
        cmocka_unit_test(interpolated_squares_are_right),
        cmocka_unit_test(other_edges_are_right),
        cmocka_unit_test(vignetting_cuts_any_corner),
        cmocka_unit_test(warm_optics_count_once),
        cmocka_unit_test(heat_of_the_earth_is_vignetted),
        cmocka_unit_test(bounds_of_edges_hold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
