/* Objects with a shape in a world: their light, its sampling, and errors of the configuration. */
#include "sim/core/tangent.h"
#include "sim/world/scene/field_objects.h"
#include "sim/world/scene/object_shape.h"
#include "tests/world/world_support.h"

#define SHAPE(parts)                                                                         \
    "\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"w\", " \
    "\"diffuse\": 0.25}], \"parts\": [" parts "]}"

/* The sphere of the other models, as a shape: the same magnitudes at all phases. */
static void a_round_shape_is_a_sphere(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"shape\", " SHAPE(
            "{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 2, "
            "\"material\": \"w\"}") ", " TEST_GX5
                                    "}, {\"name\": \"sphere\", \"area_m2\": "
                                    "12.566370614359172, \"albedo\": 0.25, " TEST_GX5 "}",
        "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 0; t < 40000; t += 4000) {
        bst_world_sight shape, sphere;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &shape));
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 1, t, &sphere));
        if (isfinite(sphere.v_mag)) {
            bst_assert_close(shape.v_mag, sphere.v_mag, 1e-9);
        }
        bst_assert_close(shape.glow.redness[0], sphere.glow.redness[0], 1e-12);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* The Sun's light goes with the square of its distance from the body, the Earth's with that of the
 * Sun from the Earth. */
static void farther_from_the_sun(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"shape\", " SHAPE("{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 2, "
                                       "\"material\": \"w\"}") ", " TEST_GX5 "}",
        "");
    const bst_world_object_info *info = bst_world_object(world, 0);
    bst_brightness_config config = *bst_brightness_config_of(info->brightness);
    bst_satellite_pose *pose;
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, info->shape->satellite, &pose));
    for (int earth = 0; earth < 2; earth++) {
        config.earthshine = earth;
        bst_scene_lighting l = {.object_m = {3e7, 2e7, 0},
                                .eye_m = {5e7, 4e7, 1e7},
                                .sun_m = {BST_AU_M, 1e9, 0},
                                .sunlit_fraction = 1 - earth};
        bst_scene_glow near, far;
        bst_object_shape_glow(info->shape, pose, &config, &l, (bst_vec3){0, 3e3, 0}, &near);
        bst_vec3 before = earth ? l.sun_m : bst_vec3_sub(l.sun_m, l.object_m);
        l.sun_m = bst_vec3_axpy(l.sun_m, 0.5, before);
        bst_vec3 after = earth ? l.sun_m : bst_vec3_sub(l.sun_m, l.object_m);
        bst_object_shape_glow(info->shape, pose, &config, &l, (bst_vec3){0, 3e3, 0}, &far);
        /* seen from the body the Sun turns by 1e-4 rad when it goes away from the Earth */
        bst_assert_close(far.v_mag - near.v_mag,
                         5.0 * log10(bst_vec3_norm(after) / bst_vec3_norm(before)),
                         earth ? 1e-3 : 1e-9);
    }
    bst_satellite_pose_free(pose);
    bst_world_free(world);
}

/* In the penumbra, with refraction and colours of the atmosphere, a shape has the light of points.
 */
static void penumbrae_are_those_of_points(void **state) {
    (void)state;
    bst_ctx ctx = {0};
#define LOW                                                                                 \
    "\"orbit\": {\"source\": \"numerical\", \"state\": {\"source\": \"keplerian\", "        \
    "\"semi_major_axis_m\": 7e6}, \"forces\": {\"gravity\": \"two_body\", \"sun\": false, " \
    "\"moon\": false, \"solar_pressure\": false, \"drag\": false}}}"
    bst_world *world = test_world_with(
        "{\"name\": \"shape\", " SHAPE("{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 2, "
                                       "\"material\": \"w\"}") ", " LOW
                                                               ", {\"name\": \"sphere\", "
                                                               "\"area_m2\": "
                                                               "12.566370614359172, "
                                                               "\"albedo\": 0.25, " LOW,
        "");
    bst_world_view *view;
    bst_world_sight shape, sphere;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    const bst_world_state eye = {{4.2e7, 0, 0}, {0, 3e3, 0}};
    int partial = 0;
    for (double t = 0; t < 5900; t += 2) {
        bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 1, t, &sphere));
        if (sphere.sunlit_fraction == 0 || sphere.sunlit_fraction == 1) {
            continue;
        }
        bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 0, t, &shape));
        bst_assert_close(shape.v_mag, sphere.v_mag, 1e-9); /* rounding */
        for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
            bst_assert_close(shape.glow.redness[k], sphere.glow.redness[k], 1e-12);
        }
        partial += sphere.glow.redness[0] < 0.99;
    }
    assert_true(partial >= 3);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* A plate that spins glints twice a turn; samples within an exposure agree with single sights, and
 * their mean with a dense sum. */
static void a_spinning_plate_glints(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"p\", \"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": "
        "[{\"name\": \"m\", \"library\": \"bare_aluminium\"}], \"parts\": [{\"name\": \"p\", "
        "\"kind\": \"plate\", \"material\": \"m\"}]}, \"attitude\": [{\"law\": \"spin\", "
        "\"rate_body_deg_per_s\": [60, 10, 0], \"from_s\": 0}], " TEST_GX5 "}",
        "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_scene_source_path path;
    bst_scene_path_light light;
    bst_world_sight mid, then, sight;
    const bst_world_view_span span = {0, 100, 112};
    bst_assert_ok(&ctx, bst_world_view_path(&ctx, view, &span, 0, &path, &light, &mid));
    double faint = 0, bright = 1e9;
    for (int i = 0; i <= 48; i++) {
        bst_scene_view_light(view, &span, 0, &path, &light, i / 48.0, &then);
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, 100 + 0.25 * i, &sight));
        if (sight.v_mag < 25) {
            /* light time changes by 2 km in a second: 7e-6 s, 1e-5 of a turn in 12 s */
            bst_assert_close(then.v_mag, sight.v_mag, 5e-2);
        }
        faint = fmax(faint, fmin(sight.v_mag, 99));
        bright = fmin(bright, sight.v_mag);
    }
    assert_true(faint - bright > 3);
    /* 61 degrees/s for 12 s: 12.7 rad, two samples for each 0.3 rad are more than the most */
    const bst_object_shape *shape = bst_world_object(world, 0)->shape;
    assert_int_equal(bst_object_shape_samples(shape, 106, 12), 64);
    assert_int_equal(bst_object_shape_samples(shape, 106, 0.1), 16);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* A cylinder of mirrors that spins fast: its glints last 1 ms of an exposure of 2 s. The mean of
 * the light is that of 20,000 samples, within the error that the light curve states. */
static void glints_are_neither_missed_nor_smeared(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    for (int n = 0; n < 2; n++) {
        char object[1024];
        snprintf(object, sizeof object,
                 "{\"name\": \"p\", \"brightness\": {\"model\": \"shape\"}, \"shape\": "
                 "{\"materials\": [{\"name\": \"m\", \"library\": \"optical_solar_reflector\"}, "
                 "{\"name\": \"w\", \"diffuse\": 0.2}], \"parts\": [{\"name\": \"b\", \"kind\": "
                 "\"cylinder\", \"material\": \"m\", \"segments\": 12, \"rotation_deg\": [90, 0, "
                 "0]}, {\"name\": \"s\", \"kind\": "
                 "\"sphere\", \"position_m\": [0, 0, 9], \"material\": \"w\"}]}, \"attitude\": "
                 "[{\"law\": \"spin\", \"rate_body_deg_per_s\": [%d, %d, 5], \"from_s\": 0}], %s}",
                 400 + 300 * n, 100 * n, TEST_GX5);
        bst_world *world = test_world_with(object, "");
        bst_world_view *view;
        bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
        const bst_camera *camera = bst_world_camera(world, 0, 0);
        bst_scene_object_query query = {
            .view = view,
            .camera = camera,
            .span = {0, 100, 100.5},
            .lit = {0, 0, (int)camera->width_px, (int)camera->height_px},
            .window = {0, 0, (int)camera->width_px, (int)camera->height_px},
            .q_mid = {0, 0, 0, 1},
            .cone = {{0, 0, 1}, BST_PI},
            .margin_px = 1e9};
        bst_scene_object_parts parts = {.body = NULL};
        bst_scene_source source;
        bool there;
        bst_world_sight mid, then;
        bst_scene_path_light light;
        bst_scene_source_path path;
        bst_assert_ok(&ctx, bst_world_view_path(&ctx, view, &query.span, 0, &path, &light, &mid));
        query.cone.axis = mid.apparent;
        query.q_mid = bst_quat_look(mid.apparent, (bst_vec3){0, 0, 1});
        bst_assert_ok(&ctx, bst_field_object(&ctx, &query, 0, &parts, &source, &there));
        assert_true(there && source.rate);
        const int dense = 5000;
        double sum = 0, most = 0;
        for (int i = 0; i < dense; i++) {
            bst_scene_view_light(view, &query.span, 0, &path, &light, (i + 0.5) / dense, &then);
            double e = bst_scene_glow_electrons_per_s(camera, &then.glow, NULL);
            sum += e / dense;
            most = fmax(most, e);
        }
        double error = fabs(source.electrons_per_s / sum - 1);
        assert_true(most / sum > 100);
        assert_true(error <= source.rate->error + 1e-4); /* of the dense sum */
        assert_true(source.rate->error < 0.02);
        free(parts.body);
        bst_world_view_free(view);
        bst_world_free(world);
    }
}

/* A sphere is a disc from a fiftieth of a pixel on: its light then comes from beside its centre. */
static void small_spheres_are_discs(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double areas_m2[2] = {20.0, 500.0}; /* 0.01 and 0.05 px across at 36,000 km */
    for (int n = 0; n < 2; n++) {
        char object[256];
        snprintf(object, sizeof object, "{\"name\": \"s\", \"area_m2\": %g, " TEST_GX5 "}",
                 areas_m2[n]);
        bst_world *world = test_world_with(object, "");
        bst_world_view *view;
        bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
        const bst_camera *camera = bst_world_camera(world, 0, 0);
        bst_scene_object_query query = {
            .view = view,
            .camera = camera,
            .span = {0, 100, 100.5},
            .lit = {0, 0, (int)camera->width_px, (int)camera->height_px},
            .window = {0, 0, (int)camera->width_px, (int)camera->height_px},
            .q_mid = {0, 0, 0, 1},
            .cone = {{0, 0, 1}, BST_PI},
            .margin_px = 1e9};
        bst_scene_object_parts parts = {.body = NULL};
        bst_scene_source source;
        bool there;
        bst_assert_ok(&ctx, bst_field_object(&ctx, &query, 0, &parts, &source, &there));
        assert_true(there && (source.shape != NULL) == (n == 1));
        if (source.shape) {
            const double radius = sqrt(areas_m2[n] / BST_PI) / source.range_m;
            bst_assert_close(source.shape->radius, radius, 1e-12);
        }
        bst_world_view_free(view);
        bst_world_free(world);
    }
}

/* An object beside a part of the sensor is in it if its disc is, whatever the distortion makes of
 * the disc: here 1.5 times as wide as at the boresight. */
static void discs_of_a_distorted_field(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("{\"name\": \"s\", \"area_m2\": 1e5, " TEST_GX5 "}", "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_camera camera = *bst_world_camera(world, 0, 0);
    camera.width_px = 1000;
    camera.height_px = 700;
    camera.pixel_scale_arcsec = 0.02;
    camera.distortion = (bst_camera_distortion){.k1 = 1e8};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_scene_object_query query = {.view = view,
                                    .camera = &camera,
                                    .span = {0, 100, 100.0001},
                                    .lit = {0, 0, 1000, 700},
                                    .window = {0, 0, 1000, 700},
                                    .q_mid = {0, 0, 0, 1},
                                    .cone = {{0, 0, 1}, BST_PI},
                                    .margin_px = 1e9};
    bst_scene_object_parts parts = {.body = NULL};
    bst_scene_source source;
    bool there;
    bst_assert_ok(&ctx, bst_field_object(&ctx, &query, 0, &parts, &source, &there));
    assert_true(there);
    const bst_vec3 place = bst_camera_unproject(&camera, 780.0, 540.0);
    bst_vec3 axis = bst_vec3_cross(source.apparent_mid, place);
    query.q_mid = bst_quat_from_rotvec(
        bst_vec3_scale(bst_vec3_unit(axis), bst_vec3_angle(source.apparent_mid, place)));
    query.margin_px = 0.0;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    const double radius = sqrt(1e5 / BST_PI) / source.range_m;
    const bst_tangent axes = bst_tangent_at(place);
    for (int k = 0; k < 360; k++) {
        double at[2], a = k * BST_PI / 180.0;
        bst_vec3 d =
            bst_tangent_exp(place, bst_tangent_vector(&axes, radius * cos(a), radius * sin(a)));
        assert_true(bst_camera_project(&camera, d, &at[0], &at[1]));
        for (int i = 0; i < 2; i++) {
            low[i] = fmin(low[i], at[i]);
            high[i] = fmax(high[i], at[i]);
        }
    }
    assert_true(high[0] - 780.0 > 1.2 * radius / bst_camera_scale_rad(&camera));
    for (int beyond = 0; beyond < 2; beyond++) { /* the last pixels of the disc, and far from it */
        const int by = beyond ? 300 : -2;
        const bst_window windows[4] = {{(int)ceil(high[0]) + by, 0, 50, 700},
                                       {0, 0, (int)floor(low[0]) - by, 700},
                                       {0, (int)ceil(high[1]) + by, 1000, 50},
                                       {0, 0, 1000, (int)floor(low[1]) - by}};
        for (int k = 0; k < 4; k++) {
            query.lit = query.window = windows[k];
            bst_assert_ok(&ctx, bst_field_object(&ctx, &query, 0, &parts, &source, &there));
            assert_int_equal(there, !beyond);
        }
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Earthlight on a shape is that of the sphere's model where the shape is a sphere. */
static void earthlight_is_that_of_spheres(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"shape\", \"brightness\": {\"model\": \"shape\", \"earthshine\": true}, "
        "\"shape\": {\"materials\": [{\"name\": \"w\", \"diffuse\": 0.25}], \"parts\": [{\"name\": "
        "\"s\", \"kind\": \"sphere\", \"segments\": 64, \"radius_m\": 2, \"material\": "
        "\"w\"}]}, " TEST_GX5
        "}, {\"name\": \"sphere\", \"area_m2\": 12.566370614359172, \"albedo\": 0.25, "
        "\"brightness\": {\"earthshine\": true}, " TEST_GX5 "}",
        "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 0; t < 40000; t += 8000) {
        bst_world_sight shape, sphere;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &shape));
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 1, t, &sphere));
        /* facets of 6 degrees, and 192 directions for the Earth: 2 %, or 0.2 % of a full Earth
         * where it is a crescent */
        bst_assert_close(shape.glow.earth_share, sphere.glow.earth_share,
                         0.02 * sphere.glow.earth_share + 2e-6);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* A plate that faces the Sun has the temperature of its balance, and with a heat capacity it lags
 * where the load changes. */
static void facets_have_their_temperatures(void **state) {
    (void)state;
    bst_ctx ctx = {0};
#define WARM(name, balance, capacity)                                                              \
    "{\"name\": \"" name "\", \"brightness\": {\"model\": \"shape\", \"heat_balance\": \"" balance \
    "\", \"earth_albedo\": 0, \"earth_infrared_w_per_m2\": 0}, \"shape\": {\"materials\": "        \
    "[{\"name\": \"w\", \"diffuse\": 0.5, \"absorptance\": 0.3, \"emissivity\": 0.6, "             \
    "\"heat_capacity_j_per_m2_k\": " capacity                                                      \
    "}], \"parts\": [{\"name\": \"p\", \"kind\": "                                                 \
    "\"sphere\", \"segments\": 8, \"material\": \"w\"}]}, \"attitude\": [{\"law\": \"sun\"}], "    \
    "\"orbit\": {\"source\": \"numerical\", \"state\": {\"source\": \"keplerian\", "               \
    "\"semi_major_axis_m\": 7e6}, \"forces\": {\"gravity\": \"two_body\", \"sun\": false, "        \
    "\"moon\": false, \"solar_pressure\": false, \"drag\": false}}}"
    bst_world *world =
        test_world_with(WARM("steady", "steady", "0") ", " WARM(
                            "lags", "transient", "5000") ", " WARM("none", "none", "0"),
                        "");
    bst_world_view *view;
    bst_world_sight sight, lag, none;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    const bst_world_state eye = {{4.2e7, 0, 0}, {0, 3e3, 0}};
    bool dark = false, lit = false, warm = false;
    for (double t = 0; t < 6000; t += 400) {
        bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 0, t, &sight));
        bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 1, t, &lag));
        bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 2, t, &none));
        bst_assert_close(sight.glow.emission_sr, none.glow.emission_sr, 1e-12);
        double hottest = 0;
        for (int i = 0; i < sight.glow.emission_count; i++) {
            hottest = fmax(hottest, sight.glow.emissions[i].temperature_k);
        }
        bst_bodies bodies;
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, t, &bodies));
        double au = bst_vec3_norm(bodies.sun_m) / 149597870700.0;
        double most = pow(0.3 * 1361 / (au * au) / (0.6 * 5.670374419e-8), 0.25);
        dark = dark || sight.sunlit_fraction == 0;
        lit = lit || hottest > 0.9 * most;
        assert_true(hottest < most * 1.0001);
        assert_true(sight.sunlit_fraction > 0 || hottest == 0);
        warm = warm || (sight.sunlit_fraction == 0 && lag.glow.temperature_k > 150);
    }
    assert_true(dark && lit && warm);
    /* the same in any order */
    bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 1, 800, &sight));
    bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 1, 5600, &sight));
    bst_assert_close(sight.glow.temperature_k, lag.glow.temperature_k, 0);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* A corner of two plates is brighter with light that goes from one to the other; a plate is not. */
static void light_is_reflected_twice(void **state) {
    (void)state;
    bst_ctx ctx = {0};
#define LIT(name, on, more)                                                                    \
    "{\"name\": \"" name "\", \"brightness\": {\"model\": \"shape\", \"interreflection\": " on \
    "}, \"shape\": {\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}], \"joints\": "        \
    "[{\"name\": "                                                                             \
    "\"j\", \"follows\": \"spin\", \"rate_deg_per_s\": 1}], \"parts\": [{\"name\": \"p\", "    \
    "\"kind\": \"plate\", \"joint\": \"j\", \"material\": \"w\"}" more                         \
    "]}, \"attitude\": "                                                                       \
    "[{\"law\": \"sun\", \"rotation_deg\": [0, 45, 0]}], " TEST_GX5 "}"
#define WALL                                                                                     \
    ", {\"name\": \"q\", \"kind\": \"plate\", \"position_m\": [0.5, 0, 0.5], \"rotation_deg\": " \
    "[0, -90, 0], \"joint\": \"j\", \"material\": \"w\"}"
    bst_world *world =
        test_world_with(LIT("once", "false", WALL) ", " LIT("twice", "true", WALL) ", " LIT(
                            "plate", "false", "") ", " LIT("plate too", "true", ""),
                        "");
    bst_world_view *view;
    bst_world_sight s[4];
    double most = 0;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 0; t < 360; t += 45) { /* the joint turns: new form factors each time */
        for (int i = 0; i < 4; i++) {
            bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, i, t, &s[i]));
        }
        assert_true(!(s[1].v_mag > s[0].v_mag));
        if (isfinite(s[0].v_mag)) {
            most = fmax(most, s[0].v_mag - s[1].v_mag);
        }
        assert_true(s[2].v_mag == s[3].v_mag);
    }
    assert_true(most > 0.03 && most < 1);
    bst_world_view_free(view);
    bst_world_free(world);
}

static void wrong_shapes_are_refused(void **state) {
    (void)state;
    static const char *const wrong[][2] = {
        {"\"brightness\": {\"model\": \"shape\"}", "/world/objects/0/shape: "},
        {"\"shape\": {\"parts\": [{\"name\": \"p\"}]}", "/world/objects/0/brightness/model: "},
        {SHAPE("{\"name\": \"p\", \"material\": \"v\"}"),
         "/world/objects/0: shape: /parts/0: material: "},
        {SHAPE("{\"name\": \"p\", \"material\": \"w\", \"size_m\": [1, 0, 1]}"),
         "shape: /parts/0: size_m: "},
        {SHAPE("{\"name\": \"p\", \"material\": \"w\", \"joint\": \"j\"}"),
         "shape: /parts/0: joint: "},
        {"\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": "
         "\"w\"}], \"joints\": [{\"name\": \"j\", \"follows\": \"table\", \"file\": "
         "\"/no/angles.csv\"}], \"parts\": [{\"name\": \"p\", \"material\": \"w\"}]}",
         "shape: /joints/0: file: "},
        {"\"brightness\": {\"interreflection\": true}", "/brightness/interreflection: true"},
        {"\"brightness\": {\"model\": \"shape\", \"interreflection\": true}, \"shape\": "
         "{\"materials\": [{\"name\": \"w\"}], \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", "
         "\"segments\": 96, \"material\": \"w\"}]}",
         "facets, too many for light"},
        {"\"brightness\": {\"heat_balance\": \"steady\"}", "/brightness/heat_balance: it needs"},
        {"\"external_states\": true, \"brightness\": {\"model\": \"shape\", "
         "\"heat_balance\": \"transient\"}, \"shape\": {\"materials\": [{\"name\": \"w\"}], "
         "\"parts\": [{\"name\": \"p\", \"material\": \"w\"}]}",
         "/brightness/heat_balance: transient"},
        {"\"burns\": [{\"time_s\": 5, \"dv_rtn_mps\": [0, 1, 0]}], \"brightness\": "
         "{\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"w\"}], "
         "\"joints\": [{\"name\": \"j\", \"follows\": \"burn\", \"burn\": 2}], \"parts\": "
         "[{\"name\": \"p\", \"material\": \"w\"}]}",
         "shape: /joints/0/burn: found 2, but the object has 1 burns"},
        {SHAPE("{\"name\": \"p\", \"kind\": \"mesh\", \"file\": \"/no/such.obj\"}"),
         "/no/such.obj"},
        {SHAPE("{\"name\": \"p\", \"material\": \"w\"}, {\"name\": \"p\", \"material\": \"w\"}"),
         "shape: /parts/1: name: "},
        {SHAPE("{\"name\": \"p\", \"material\": \"w\"}") ", \"attitude\": [{\"law\": \"tumble\", "
                                                         "\"inertia_kg_m2\": [1, 1, 5]}]",
         "/world/objects/0: attitude: 0: inertia_kg_m2: "},
        {"\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"m\", "
         "\"model\": \"phong\", \"diffuse\": 0.9, \"specular\": 0.9}], \"parts\": [{\"name\": "
         "\"p\", \"material\": \"m\"}]}",
         "shape: /materials/0: the surface reflects"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        bst_ctx ctx = {0};
        bst_world *world;
        char text[3000];
        snprintf(text, sizeof text,
                 "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"o\", "
                 "%s, " TEST_GX5 "}]}, \"observers\": [{\"name\": \"n\", " TEST_NEOSSAT
                 ", \"sensors\": [{" TEST_CAMERA "}]}]}",
                 wrong[i][0]);
        assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
        if (!strstr(ctx.message, wrong[i][1])) {
            fail_msg("%s: not in: %s", wrong[i][1], ctx.message);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_round_shape_is_a_sphere),
        cmocka_unit_test(farther_from_the_sun),
        cmocka_unit_test(a_spinning_plate_glints),
        cmocka_unit_test(glints_are_neither_missed_nor_smeared),
        cmocka_unit_test(small_spheres_are_discs),
        cmocka_unit_test(discs_of_a_distorted_field),
        cmocka_unit_test(earthlight_is_that_of_spheres),
        cmocka_unit_test(facets_have_their_temperatures),
        cmocka_unit_test(light_is_reflected_twice),
        cmocka_unit_test(penumbrae_are_those_of_points),
        cmocka_unit_test(wrong_shapes_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
