/* What an observer sees of an object, and what it is commanded to look for. */
#include "sim/onboard/knowledge.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"
#define MAS (BST_ARCSEC_RAD / 1000.0)

static void sight_agrees_with_astropy(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(GX5, "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    FILE *file = fopen("tests/world/data/sight_reference.txt", "r");
    assert_non_null(file);
    char line[1000];
    int rows = 0;
    while (fgets(line, sizeof line, file)) {
        double t, tau, phase;
        bst_vec3 eye, target, geometric, apparent;
        if (sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf", &t, &eye.x,
                   &eye.y, &eye.z, &target.x, &target.y, &target.z, &geometric.x, &geometric.y,
                   &geometric.z, &apparent.x, &apparent.y, &apparent.z, &tau, &phase) != 15) {
            continue;
        }
        rows++;
        bst_world_state s;
        bst_world_sight sight;
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, t, &s));
        /* 1e-8 rad between their Earth orientation and ours is 0.4 m at 4e7 m */
        bst_assert_close(test_distance(s.position_m, eye), 0, 0.1);
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &sight));
        bst_assert_close(test_distance(sight.geometric, geometric), 0, 1 * MAS);
        bst_assert_close(test_distance(sight.apparent, apparent), 0, 1 * MAS);
        bst_assert_close(sight.light_time_s, tau, 1e-9); /* 0.3 m */
        bst_assert_close(sight.range_m, test_distance(eye, target), 0.5);
        bst_assert_close(sight.phase_rad, phase, 1e-7); /* 15 m of the Sun's place, and less */
    }
    fclose(file);
    assert_int_equal(rows, 7);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* The light that arrives at t left tau earlier from where the object was then. */
static void light_time_is_consistent(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(GX5, "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 0; t < 6000; t += 700) {
        bst_world_sight sight;
        bst_world_state eye, then;
        bst_bodies bodies;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &sight));
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, t, &eye));
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, t, &bodies));
        bst_assert_ok(&ctx,
                      bst_world_view_object_state(&ctx, view, 0, t - sight.light_time_s, &then));
        bst_vec3 path =
            bst_light_path(&bodies, then.position_m, eye.position_m, sight.light_time_s);
        /* three rounds leave (v / c)^3 of the range: 40 um; positions round to 1e-8 m */
        bst_assert_close(bst_vec3_norm(path) / BST_LIGHT_SPEED_MPS, sight.light_time_s, 1e-12);
        bst_assert_close(test_distance(bst_vec3_unit(path), sight.geometric), 0, 1e-11);
        bst_assert_close(test_distance(eye.position_m, then.position_m), sight.range_m, 1e-3);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* The figures that the main scenario states. */
static void the_main_scene_is_as_described(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(GX5, "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_world_sight a, b;
    bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, 0, &a));
    bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, 1, &b));
    bst_assert_close(a.range_m, 4.0e7, 1e6);                /* "about 40,000 km" */
    bst_assert_close(a.phase_rad / BST_DEG_RAD, 19.0, 0.5); /* "19 degrees" */
    bst_assert_close(bst_vec3_angle(a.apparent, b.apparent) / BST_ARCSEC_RAD, 50, 5);
    /* 13.010 at 40,000 km and 1 au; 40,455 km add 0.0246, the Sun at 1.0159 au 0.0342 */
    bst_assert_close(a.v_mag, 13.069, 0.002);
    for (double t = 0; t <= 300; t += 10) {
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &a));
        assert_true(a.sunlit_fraction == 1.0);
        assert_false(a.occulted);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* In the course of a day the Earth gets in between, and in spring and autumn the satellite passes
 * through its shadow. */
static void the_earth_hides_and_shades(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const char *text = "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
                       "]}, \"observers\": [{\"name\": \"n\", " TEST_NEOSSAT
                       ", \"sensors\": [{" TEST_CAMERA "}]}]}";
    bst_world *world;
    bst_assert_ok(&ctx, test_world_try(&ctx, "2022-03-21T00:00:00Z", text, &world));
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    int hidden = 0, dark = 0, dim = 0;
    const int step = 30, n = 86400 / step;
    for (int i = 0; i < n; i++) {
        bst_world_sight s;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, i * step, &s));
        hidden += s.occulted;
        dark += s.sunlit_fraction == 0.0;
        dim += s.sunlit_fraction > 0.0 && s.sunlit_fraction < 1.0;
        /* in the umbra there is the light that the air bends into it, less and less */
        assert_true(isinf(s.v_mag) ? s.sunlit_fraction == 0.0
                                   : s.sunlit_fraction > 0.0 || s.v_mag > 17.0);
    }
    /* the longest umbra of a geostationary orbit lasts 67 to 69 minutes, the penumbra 2 on either
     * side (Montenbruck and Gill, section 3.4: angles of 17.4 and 0.53 degrees) */
    bst_assert_close(dark * step / 60.0, 68, 3);
    bst_assert_close(dim * step / 60.0, 4.3, 1.5);
    assert_true(hidden > 0 && hidden < n / 2);
    bst_world_view_free(view);
    bst_world_free(world);
}

static bst_onboard_cue cue_of(const bst_world *world, double seconds, bst_quat *attitude) {
    bst_ctx ctx = {0};
    bst_knowledge *k;
    bst_knowledge_view *view;
    bst_onboard_cue cue;
    bst_assert_ok(&ctx, bst_knowledge_create(&ctx, world, 0, 0, &k));
    bst_assert_ok(&ctx, bst_knowledge_view_create(&ctx, k, &view));
    bst_assert_ok(&ctx, bst_knowledge_cue_at(&ctx, view, seconds, &cue));
    if (attitude) {
        *attitude = bst_knowledge_body_attitude(k);
        bst_quat same = bst_world_body_attitude(world, 0, 0);
        assert_true(attitude->x == same.x && attitude->y == same.y && attitude->z == same.z &&
                    attitude->w == same.w);
    }
    assert_ptr_equal(bst_knowledge_stars(k), bst_world_stars(world));
    assert_int_equal(bst_knowledge_camera(k)->width_px, 1024);
    bst_assert_close(bst_knowledge_julian_year(k), 2022.4570, 1e-3);
    bst_knowledge_view_free(view);
    bst_knowledge_free(k);
    return cue;
}

/* The cue's error along each image axis: seen by a camera that points at the truth, the cue is
 * 0.6 degrees away along that axis. */
static void a_wrong_cue_is_wrong_along_its_axis(void **state) {
    (void)state;
    const char *axes[] = {"x", "-x", "y", "-y"};
    const double where[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    bst_world *right = test_world_with(GX5, ", \"cue\": {\"object\": \"GX5\"}");
    bst_onboard_cue nominal = cue_of(right, 0, NULL);
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_world_sight sight;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, right, &view));
    bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, 0, &sight));
    assert_true(nominal.valid);
    bst_assert_close(test_distance(nominal.direction_gcrf, sight.geometric), 0, 1e-12);
    for (int k = 0; k < 4; k++) {
        char text[200];
        snprintf(text, sizeof text,
                 ", \"cue\": {\"object\": \"GX5\", \"offset_deg\": 0.6, \"offset_axis\": \"%s\", "
                 "\"sigma_deg\": 0.4, \"rate_sigma_arcsec_per_s\": 2, \"v_mag\": 12.5}",
                 axes[k]);
        bst_world *world = test_world_with(GX5, text);
        bst_quat body;
        bst_onboard_cue cue = cue_of(world, 0, &body);
        bst_assert_close(bst_vec3_angle(cue.direction_gcrf, nominal.direction_gcrf) / BST_DEG_RAD,
                         0.6, 1e-12);
        bst_quat look = bst_quat_look(nominal.direction_gcrf, (bst_vec3){0, 0, 1});
        bst_vec3 c = bst_quat_rotate(look, cue.direction_gcrf);
        double s = sin(0.6 * BST_DEG_RAD);
        bst_assert_close(c.x, where[k][0] * s, 1e-14);
        bst_assert_close(c.y, where[k][1] * s, 1e-14);
        /* the body looks at the cue, x towards the pole as near as can be */
        bst_vec3 z = bst_quat_rotate(bst_quat_conj(body), (bst_vec3){0, 0, 1});
        bst_vec3 y = bst_quat_rotate(bst_quat_conj(body), (bst_vec3){0, 1, 0});
        bst_vec3 x = bst_quat_rotate(bst_quat_conj(body), (bst_vec3){1, 0, 0});
        bst_assert_close(test_distance(z, cue.direction_gcrf), 0, 1e-14);
        bst_assert_close(y.z, 0, 1e-14);
        assert_true(x.z > 0);
        bst_assert_close(cue.sigma_rad, 0.4 * BST_DEG_RAD, 1e-15);
        bst_assert_close(cue.rate_sigma_radps, 2 * BST_ARCSEC_RAD, 1e-18);
        bst_assert_close(cue.v_mag, 12.5, 0);
        bst_world_free(world);
    }
    bst_world_view_free(view);
    bst_world_free(right);
}

static void the_cue_s_rate_is_its_derivative(void **state) {
    (void)state;
    bst_world *world =
        test_world_with(GX5, ", \"cue\": {\"object\": \"GX5\", \"offset_deg\": 0.6}");
    for (double t = 0; t < 600; t += 150) {
        bst_onboard_cue c = cue_of(world, t, NULL), a = cue_of(world, t - 2, NULL),
                        b = cue_of(world, t + 2, NULL);
        bst_vec3 rate = bst_vec3_scale(bst_vec3_sub(b.direction_gcrf, a.direction_gcrf), 1.0 / 4.0);
        /* third derivative x 4 s^2 / 6 of this wider difference: 7000 / 40000 x (1e-3)^3 */
        bst_assert_close(test_distance(rate, c.rate_gcrf_radps), 0, 3e-10);
        bst_assert_close(bst_vec3_dot(c.rate_gcrf_radps, c.direction_gcrf), 0, 1e-7 * 2.5e-4);
        bst_assert_close(bst_vec3_norm(c.rate_gcrf_radps) / BST_ARCSEC_RAD, 45, 12);
    }
    bst_world_free(world);
}

/* A burn changes where the target is, not what the onboard side knows. */
static void knowledge_never_sees_burns(void **state) {
    (void)state;
    const char *sensor = ", \"cue\": {\"object\": \"GX5\"}";
    bst_world *calm = test_world_with(GX5, sensor);
    bst_world *burnt = test_world_with("{\"name\": \"GX5\", " TEST_GX5
                                       ", \"burns\": [{\"time_s\": 100, \"dv_rtn_mps\": [0, 10, "
                                       "0]}]}",
                                       sensor);
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, burnt, &view));
    const double times[] = {0, 99, 100, 101, 300};
    for (int i = 0; i < 5; i++) {
        bst_onboard_cue a = cue_of(calm, times[i], NULL), b = cue_of(burnt, times[i], NULL);
        assert_true(test_distance(a.direction_gcrf, b.direction_gcrf) == 0);
        assert_true(test_distance(a.rate_gcrf_radps, b.rate_gcrf_radps) == 0);
        bst_world_sight sight;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, times[i], &sight));
        double off = bst_vec3_angle(sight.geometric, b.direction_gcrf) / BST_ARCSEC_RAD;
        if (times[i] <= 100) {
            bst_assert_close(off, 0, 1e-6);
        } else if (times[i] > 200) {
            assert_true(off > 5); /* up to 2000 m at 4e7 m: 10 arcsec */
        }
    }
    bst_world_view_free(view);
    bst_world_free(calm);
    bst_world_free(burnt);
}

/* Without an object the cue is a fixed place on the sky. */
static void a_cue_can_be_a_direction(void **state) {
    (void)state;
    bst_world *world = test_world_with("", ", \"cue\": {\"direction_radec_deg\": [30, -40]}");
    bst_onboard_cue a = cue_of(world, 0, NULL), b = cue_of(world, 100, NULL);
    double ra, dec;
    bst_vec3_to_radec(a.direction_gcrf, &ra, &dec);
    bst_assert_close(ra / BST_DEG_RAD, 30, 1e-12);
    bst_assert_close(dec / BST_DEG_RAD, -40, 1e-12);
    assert_true(test_distance(a.direction_gcrf, b.direction_gcrf) == 0);
    bst_assert_close(bst_vec3_norm(a.rate_gcrf_radps), 0, 0);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sight_agrees_with_astropy),
        cmocka_unit_test(light_time_is_consistent),
        cmocka_unit_test(the_main_scene_is_as_described),
        cmocka_unit_test(the_earth_hides_and_shades),
        cmocka_unit_test(a_wrong_cue_is_wrong_along_its_axis),
        cmocka_unit_test(the_cue_s_rate_is_its_derivative),
        cmocka_unit_test(knowledge_never_sees_burns),
        cmocka_unit_test(a_cue_can_be_a_direction),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
