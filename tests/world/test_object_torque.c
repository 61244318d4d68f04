/* Torques on tumbling objects with a shape, against closed forms. */
#include "sim/astro/atmosphere.h"
#include "sim/astro/forces.h"
#include "sim/world/object_torque.h"
#include "sim/world/scene/object_shape.h"
#include "tests/world/world_support.h"

#define MATERIALS                                                                             \
    "\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"b\", "  \
    "\"diffuse\": 0.5, \"absorptance\": 1}, {\"name\": \"d\", \"diffuse\": 0.6}, {\"name\": " \
    "\"m\", \"model\": \"phong\", \"diffuse\": 0, \"specular\": 0.8, \"exponent\": 3000}], "  \
    "\"parts\": ["
#define CIRCLE(radius, forces)                                                       \
    "\"orbit\": {\"source\": \"numerical\", \"state\": {\"source\": \"keplerian\", " \
    "\"semi_major_axis_m\": " radius                                                 \
    "}, \"forces\": {\"gravity\": \"two_body\", \"sun\": "                           \
    "false, \"moon\": false" forces "}}"
#define OFF ", \"solar_pressure\": false, \"drag\": false"
#define TUMBLE(more) "\"attitude\": [{\"from_s\": 0, \"law\": \"tumble\"" more "}]"
#define ALL                                                                            \
    ", \"torques\": {\"gravity_gradient\": true, \"solar_pressure\": true, \"drag\": " \
    "true}"

static const bst_attitude_config sunlight = {.torques = {.solar_pressure = true}};

static bst_vec3 torque_on(const bst_world *world, int object, const bst_attitude_config *phase,
                          double seconds, bst_quat q) {
    bst_vec3 n;
    assert_true(bst_object_torque_at(bst_world_object(world, object)->shape->torque, phase, seconds,
                                     q, &n));
    return n;
}

static bst_quat attitude_at(const bst_world *world, int object, double seconds) {
    const bst_attitude_state state = {
        .position_m = {7e6, 0, 0}, .velocity_mps = {0, 7.5e3, 0}, .sun = {1, 0, 0}, seconds};
    return bst_body_attitude_at(bst_world_object(world, object)->shape->attitude, &state);
}

/* Direction and distance of the Sun, GCRF, from a place. */
static bst_vec3 sun_from(bst_vec3 place_m, double seconds) {
    bst_ctx ctx = {0};
    bst_time epoch;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, TEST_EPOCH, &epoch));
    bst_bodies_at(bst_time_add(epoch, seconds), &bodies);
    return bst_vec3_sub(bst_bodies_sunlight_from(&bodies), place_m);
}

#define PLATE(material)                                                                          \
    "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 0], \"position_m\": [1.5, -0.5, " \
    "0.25], \"material\": \"" material "\"}]}, " CIRCLE("2e7", OFF) ", " TUMBLE(ALL) "}"

/* A plate beside the centre of mass: lever x force, of a black, a diffuse and a mirror surface. */
static void a_plate_has_its_torque(void **state) {
    (void)state;
    bst_world *world = test_world_with(
        "{\"name\": \"0\", " MATERIALS PLATE("b") ", {\"name\": \"1\", " MATERIALS PLATE(
            "d") ", {\"name\": \"2\", " MATERIALS PLATE("m"),
        "");
    const bst_vec3 lever = {1.5, -0.5, 0.25}, place = {2e7, 0, 0}, axis = {0, 0, 1};
    bst_vec3 sun_m = sun_from(place, 0);
    double au = bst_vec3_norm(sun_m) / BST_AU_M, pressure = BST_SUNLIGHT_PRESSURE_PA / au / au;
    for (int deg = 0; deg <= 60; deg += 20) {
        /* the Sun at this angle from the plate's normal */
        bst_vec3 sun = bst_vec3_unit((bst_vec3){
            sin(deg * BST_DEG_RAD) * 0.6, sin(deg * BST_DEG_RAD) * 0.8, cos(deg * BST_DEG_RAD)});
        bst_quat q = bst_quat_mul(bst_quat_conj(bst_quat_look(sun, (bst_vec3){1, 2, 0})),
                                  bst_quat_look(sun_m, (bst_vec3){0, 1, 5}));
        bst_assert_close(bst_vec3_angle(bst_quat_rotate(q, sun_m), sun), 0, 1e-12);
        for (int k = 0; k < 3; k++) {
            const bst_satellite *s = bst_world_object(world, k)->shape->satellite;
            double c = sun.z, rho_d = k == 1 ? 0.6 : 0;
            double rho_s = k == 2 ? bst_brdf_reflectance(&s->materials[2].brdf, c) : 0;
            bst_vec3 force = bst_vec3_scale(sun, -6 * c * (1 - rho_s) * pressure);
            force = bst_vec3_axpy(force, -12 * c * (rho_s * c + rho_d / 3) * pressure, axis);
            bst_vec3 want = bst_vec3_cross(lever, force);
            bst_vec3 got = torque_on(world, k, &sunlight, 0, q);
            assert_true(k != 2 || (rho_s > 0.39 && rho_s < 0.81));
            /* Sun from the sky clock: 15 m; the reflectance is tabulated in 16 steps */
            bst_assert_close(bst_vec3_norm(bst_vec3_sub(got, want)), 0,
                             (k == 2 ? 5e-3 : 1e-4) * bst_vec3_norm(want));
        }
    }
    bst_world_free(world);
}

/* A black sphere about its centre: no torque of sunlight, air and gravity, but in a faceted white
 * one by its facets; beside the centre, sunlight has one. */
static void round_bodies_have_no_torque(void **state) {
    (void)state;
#define BALL(at, of)                                                                \
    "{\"name\": \"p\", \"kind\": \"sphere\", \"radius_m\": 1, \"position_m\": [" at \
    "], "                                                                           \
    "\"material\": \"" of                                                           \
    "\"}]}, " CIRCLE("6.6e6", ", \"solar_pressure\": false") ", " TUMBLE(ALL) "}"
    bst_world *world = test_world_with(
        "{\"name\": \"0\", " MATERIALS BALL("0, 0, 0", "b") ", {\"name\": \"1\", " MATERIALS BALL(
            "0, 0, 3", "b") ", {\"name\": \"2\", " MATERIALS BALL("0, 0, 0", "d"),
        "");
    bst_attitude_config phase = {.torques = {true, true, true, 1e-3}, .inertia_kg_m2 = {5, 5, 5}};
    double force = BST_SUNLIGHT_PRESSURE_PA * BST_PI, beside = 0, white = 0;
    for (int i = 0; i < 20; i++) {
        bst_quat q = bst_quat_unit((bst_quat){sin(i), cos(2 * i), 0.3, 0.1 * i});
        bst_vec3 got = torque_on(world, 0, &phase, 270.0 * i, q);
        /* the air's pressure is up to 1e4 times that of sunlight at 220 km */
        bst_assert_close(bst_vec3_norm(got), 0, 1e-12 * 1e4 * force);
        got = torque_on(world, 0, &sunlight, 270.0 * i, q);
        bst_assert_close(bst_vec3_norm(got), 0, 1e-12 * force);
        beside = fmax(beside, bst_vec3_norm(torque_on(world, 1, &sunlight, 270.0 * i, q)));
        white = fmax(white, bst_vec3_norm(torque_on(world, 2, &sunlight, 270.0 * i, q)));
    }
    assert_true(beside > 2 * force);
    printf("white sphere: %.2g of force times radius\n", white / force);
    bst_assert_close(white, 0, 2e-3 * force); /* normals do not pass the facets' centroids */
    bst_world_free(world);
}

/* Sunlight has its torque in sunlight, a part in the penumbra and none in the umbra; the gravity
 * gradient and air are those of their formulas. */
static void eclipses_gradient_and_air(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"0\", " MATERIALS
        "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 0], \"position_m\": [1.5, 0, "
        "0], \"material\": \"b\"}]}, " CIRCLE("6.7e6",
                                              ", \"density_scale\": 2" OFF) ", " TUMBLE(ALL) "}",
        "");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_attitude_config gradient = {.torques = {.gravity_gradient = true},
                                    .inertia_kg_m2 = {10, 20, 25}};
    bst_attitude_config air = {.torques = {.drag = true}};
    double radius = 6.7e6, rate = sqrt(BST_EARTH_MU_M3PS2 / radius) / radius;
    int lit = 0, dark = 0, partial = 0;
    for (int i = 0; i < 5500; i += 2) {
        bst_vec3 place = {radius * cos(rate * i), radius * sin(rate * i), 0};
        bst_vec3 sun_m = sun_from(place, i);
        bst_quat q = bst_quat_look(sun_m, (bst_vec3){0, 0, 1});
        bst_vec3 got = torque_on(world, 0, &sunlight, i, q);
        double au = bst_vec3_norm(sun_m) / BST_AU_M;
        double share = got.y / (9 * BST_SUNLIGHT_PRESSURE_PA / au / au);
        lit += fabs(share - 1) < 1e-6;
        dark += share == 0;
        partial += share > 1e-6 && share < 1 - 1e-6;
        if (i % 500 == 0) {
            const double *m = gradient.inertia_kg_m2;
            bst_vec3 u = bst_quat_rotate(q, bst_vec3_unit(place));
            double k = 3 * rate * rate;
            got = torque_on(world, 0, &gradient, i, q);
            bst_assert_close(got.x, k * u.y * u.z * (m[2] - m[1]), 1e-8 * k * m[2]);
            bst_assert_close(got.y, k * u.z * u.x * (m[0] - m[2]), 1e-8 * k * m[2]);
            bst_assert_close(got.z, k * u.x * u.y * (m[1] - m[0]), 1e-8 * k * m[2]);
            /* plate ahead, at x = 1.5 m */
            bst_vec3 wind =
                bst_vec3_scale(bst_vec3_cross((bst_vec3){0, 0, rate - 7.292115e-5}, place), 1);
            q = bst_quat_look(wind, place);
            double want = 0.5 * 2 * bst_atmosphere_density_kgpm3(bst_astro_height_m(place)) *
                          bst_vec3_dot(wind, wind) * 2.2 * 6 * 1.5;
            got = torque_on(world, 0, &air, i, q);
            bst_assert_close(got.y, want, 1e-6 * want);
            bst_assert_close(hypot(got.x, got.z), 0, 1e-6 * want);
        }
    }
    assert_true(lit > 1500 && dark > 600 && partial >= 4 && lit + dark + partial == 2750);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Four white plates, each canted by 30 degrees, turn about the Sun's direction as a windmill:
 * torque 4 r P A cos c (2/3 rho_d) sin c about the axis. */
static void a_windmill_spins_up(void **state) {
    (void)state;
#define SAIL(name, at, turned)                                                                  \
    "{\"name\": \"" name "\", \"kind\": \"plate\", \"size_m\": [1, 2, 0], \"position_m\": [" at \
    "], \"rotation_deg\": [" turned "], \"material\": \"d\"}"
    char text[3000];
    bst_vec3 sun_m = sun_from((bst_vec3){4.2e7, 0, 0}, 0);
    bst_quat q = bst_quat_look(sun_m, (bst_vec3){0, 0, 1});
    snprintf(
        text, sizeof text,
        "{\"name\": \"0\", " MATERIALS
            SAIL("a", "5, 0, 0", "30, 0, 0") ", " SAIL("b", "-5, 0, 0", "-30, 0, 0") ", " SAIL(
                "c", "0, 5, 0",
                "0, 30, 0") ", " SAIL("d", "0, -5, 0",
                                      "0, -30, 0") "]}, " CIRCLE("4.2e7",
                                                                 OFF) ", " TUMBLE(", "
                                                                                  "\"quaternion\": "
                                                                                  "[%.17g, %.17g, "
                                                                                  "%.17g, %.17g], "
                                                                                  "\"inertia_kg_"
                                                                                  "m2\": [60, 60, "
                                                                                  "100], "
                                                                                  "\"rate_body_deg_"
                                                                                  "per_s\": [0, 0, "
                                                                                  "2], "
                                                                                  "\"torques\": "
                                                                                  "{\"solar_"
                                                                                  "pressure\": "
                                                                                  "true}") "}",
        q.x, q.y, q.z, q.w);
    bst_world *world = test_world_with(text, "");
    double c = 30 * BST_DEG_RAD, au = bst_vec3_norm(sun_m) / BST_AU_M;
    double torque = 4 * 5 * BST_SUNLIGHT_PRESSURE_PA / au / au * 2 * cos(c) * sin(c) * 0.4;
    bst_vec3 got = torque_on(world, 0, &sunlight, 0, q);
    bst_assert_close(fabs(got.z), torque, 1e-4 * torque);
    bst_assert_close(hypot(got.x, got.y), 0, 1e-4 * torque);
    double seconds = 4 * 3600;
    const bst_body_attitude *attitude = bst_world_object(world, 0)->shape->attitude;
    double rate = bst_body_attitude_rate_radps(attitude, seconds) / sqrt(100.0 / 60);
    double change = torque / 100 * seconds;
    assert_true(change > 0.1 * 2 * BST_DEG_RAD);
    /* the Sun moves by 3e-3 rad; it turns the axis by as much at most */
    bst_assert_close(fabs(rate - 2 * BST_DEG_RAD), change, 1e-3 * change);
    bst_world_free(world);
}

/* A phase that continues starts from the attitude before, and its torques from there on; forces and
 * torques of one shape go together. */
static void phases_continue(void **state) {
    (void)state;
    bst_world *world = test_world_with(
        "{\"name\": \"0\", " MATERIALS
        "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 0], \"position_m\": [1.5, 0, "
        "0], \"material\": \"d\"}]}, " CIRCLE("7e6", ", \"shape\": true") ", \"attitude\": [{"
        "\"law\": \"inertial\", \"quaternion\": [0.6, 0, 0, 0.8]}, {\"from_s\": 100, \"law\": "
        "\"tumble\", \"rate_body_deg_per_s\": [0.5, 0, 1]" ALL "}]}",
        "");
    bst_assert_close(attitude_at(world, 0, 50).x, 0.6, 1e-12);
    bst_assert_close(attitude_at(world, 0, 100).x, 0.6, 1e-12);
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_world_state place;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, 3000, &place));
    bst_assert_close(bst_vec3_norm(place.position_m), 7e6, 1e4);
    bst_quat q = attitude_at(world, 0, 3000), again = attitude_at(world, 0, 3000);
    assert_memory_equal(&q, &again, sizeof q);
    bst_world_view_free(view);
    bst_world_free(world);
}

static void wrong_torques_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *keys, *says;
    } wrong[] = {
        {"\"attitude\": [{\"from_s\": 0, \"law\": \"spin\"" ALL "}]",
         "/world/objects/0: attitude: 0: torques: found with the law spin"},
        {"\"attitude\": [{\"law\": \"tumble\"" ALL "}]", "from_s: found -1e+09 with torques"},
        {TUMBLE(ALL ", \"inertia_kg_m2\": [1, 1, 3]"), "inertia_kg_m2: found [1, 1, 3]"},
        {TUMBLE(ALL) ", \"external_states\": true", "/world/objects/0/attitude: torques"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char text[3000];
        bst_ctx ctx = {0};
        bst_world *world;
        snprintf(text, sizeof text,
                 "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"0\", "
                 "" MATERIALS
                 "{\"name\": \"p\", \"kind\": \"plate\", \"material\": \"b\"}]}, " CIRCLE(
                     "7e6", "") ", %s}]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
                                ", \"sensors\": [{" TEST_CAMERA "}]}]}",
                 wrong[i].keys);
        assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
        if (!strstr(ctx.message, wrong[i].says)) {
            fail_msg("\"%s\" has no \"%s\"", ctx.message, wrong[i].says);
        }
    }
}

/* The place of an object whose orbit is relative to one with external_states, directly or over
 * others, is not known in advance: no torques, and no heat of its past. */
static void torques_need_a_known_place(void **state) {
    (void)state;
    static const struct {
        const char *external, *reference, *heat, *keys, *says;
    } cases[] = {
        {"true", "middle", "", ", " TUMBLE(ALL),
         "/world/objects/2/attitude: torques need a place that is known in advance, which "
         "/world/objects/0/external_states may change"},
        {"true", "chief", "", ", " TUMBLE(ALL), "which /world/objects/0/external_states may"},
        {"true", "chief", ", \"heat_balance\": \"transient\"", "",
         "/world/objects/2/brightness/heat_balance: transient follows from the past of the object, "
         "which /world/objects/0/external_states may change"},
        {"true", "middle", ", \"heat_balance\": \"steady\"", "", NULL},
        {"false", "middle", "", ", " TUMBLE(ALL), NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[4000];
        bst_ctx ctx = {0};
        bst_world *world = NULL;
        snprintf(text, sizeof text,
                 "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": "
                 "\"chief\", \"external_states\": %s, " CIRCLE("7e6", "") "}, {\"name\": "
                 "\"middle\", \"orbit\": {\"source\": \"relative\", \"reference\": \"chief\"}}, "
                 "{\"name\": \"last\", \"brightness\": {\"model\": \"shape\"%s}, \"shape\": "
                 "{\"materials\": [{\"name\": \"b\"}], \"parts\": [{\"name\": \"p\", \"kind\": "
                 "\"plate\", \"material\": \"b\"}]}, \"orbit\": {\"source\": \"relative\", "
                 "\"reference\": \"%s\"}%s}]}, \"observers\": [{\"name\": \"neossat\", "
                 TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA "}]}]}",
                 cases[i].external, cases[i].heat, cases[i].reference, cases[i].keys);
        bst_status status = test_world_try(&ctx, TEST_EPOCH, text, &world);
        if (!cases[i].says) {
            bst_assert_ok(&ctx, status);
            bst_world_free(world);
        } else if (status != BST_ERR_CONFIG || !strstr(ctx.message, cases[i].says)) {
            fail_msg("\"%s\" has no \"%s\"", ctx.message, cases[i].says);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plate_has_its_torque),
        cmocka_unit_test(round_bodies_have_no_torque),
        cmocka_unit_test(eclipses_gradient_and_air),
        cmocka_unit_test(a_windmill_spins_up),
        cmocka_unit_test(phases_continue),
        cmocka_unit_test(wrong_torques_are_refused),
        cmocka_unit_test(torques_need_a_known_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
