/* Forces against formulas written anew. */
#include "sim/astro/forces.h"

#include "sim/astro/atmosphere.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    bst_gravity *point, *field;
    bst_astro_eop *eop;
    bst_time epoch;
} fixture;

static fixture fx;

static int set_up(void **state) {
    (void)state;
    bst_assert_ok(&fx.ctx, bst_gravity_point(&fx.ctx, BST_EARTH_MU_M3PS2, &fx.point));
    bst_assert_ok(&fx.ctx, bst_gravity_builtin(&fx.ctx, 20, 20, &fx.field));
    bst_assert_ok(&fx.ctx, bst_astro_eop_builtin(&fx.ctx, &fx.eop));
    bst_assert_ok(&fx.ctx, bst_time_from_utc(&fx.ctx, "2022-06-16T22:10:00Z", &fx.epoch));
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    bst_gravity_free(fx.point);
    bst_gravity_free(fx.field);
    bst_astro_eop_free(fx.eop);
    return 0;
}

static bst_vec3 force(const bst_force_model *model, double t, bst_vec3 r, bst_vec3 v) {
    bst_forces *f;
    bst_vec3 a;
    bst_assert_ok(&fx.ctx, bst_forces_create(&fx.ctx, model, fx.epoch, &f));
    bst_assert_ok(&fx.ctx, bst_forces_at(&fx.ctx, f, t, r, v, &a));
    bst_forces_free(f);
    return a;
}

static double distance(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

static const bst_vec3 at_rest = {0, 0, 0};

/* Harmonics alone: the model's less the point mass of the same GM. */
static void the_field_turns_with_the_earth(void **state) {
    (void)state;
    bst_force_model model = {.gravity = fx.field, .eop = fx.eop};
    bst_vec3 r = {4e6, -3e6, 4.5e6};
    for (double t = -5e5; t < 1e6; t += 34567.8) {
        bst_astro_earth_frames frames;
        bst_assert_ok(&fx.ctx, bst_astro_earth_frames_at(&fx.ctx, fx.eop, bst_time_add(fx.epoch, t),
                                                         &frames));
        bst_vec3 fixed = bst_mat3_mul_vec(&frames.itrf_from_gcrf, r);
        bst_vec3 expected = bst_mat3_transpose_mul_vec(&frames.itrf_from_gcrf,
                                                       bst_gravity_acceleration(fx.field, fixed));
        /* 1e-10 rad of a field whose harmonics are 1e-2 m/s^2 there */
        bst_assert_close(distance(force(&model, t, r, at_rest), expected), 0, 2e-12);
    }
}

static void sun_and_moon_pull_as_point_masses(void **state) {
    (void)state;
    for (int body = 0; body < 2; body++) {
        bst_force_model without = {.gravity = fx.point};
        bst_force_model with = {.gravity = fx.point, .sun = body == 0, .moon = body == 1};
        for (double t = -1e6; t < 1e6; t += 87654.3) {
            bst_bodies b;
            bst_bodies_at(bst_time_add(fx.epoch, t), &b);
            bst_vec3 s = body == 0 ? b.sun_m : b.moon_m, r = {2e8, -1e8, 5e7};
            double gm = body == 0 ? 1.32712440018e20 : 4.902800076e12;
            bst_vec3 d = bst_vec3_sub(s, r);
            bst_vec3 expected = bst_vec3_sub(bst_vec3_scale(d, gm / pow(bst_vec3_norm(d), 3)),
                                             bst_vec3_scale(s, gm / pow(bst_vec3_norm(s), 3)));
            bst_vec3 pull =
                bst_vec3_sub(force(&with, t, r, at_rest), force(&without, t, r, at_rest));
            /* places to 1 m of 4e8; the plain difference is good to 1e-11 this far out */
            bst_assert_close(distance(pull, expected) / bst_vec3_norm(expected), 0, 1e-7);
        }
        /* near the Earth the tide is linear: -gm / d^3 (r - 3 (r . s) s), to r / d */
        bst_bodies b;
        bst_bodies_at(fx.epoch, &b);
        bst_vec3 s = body == 0 ? b.sun_m : b.moon_m, u = bst_vec3_unit(s);
        bst_vec3 r = {700, 0, 0}; /* where a plain difference has no digit left for the Sun */
        double gm = body == 0 ? 1.32712440018e20 : 4.902800076e12;
        bst_vec3 tide = bst_vec3_scale(bst_vec3_axpy(r, -3 * bst_vec3_dot(r, u), u),
                                       -gm / pow(bst_vec3_norm(s), 3));
        bst_gravity *none;
        bst_assert_ok(&fx.ctx, bst_gravity_point(&fx.ctx, 0, &none));
        with.gravity = none;
        /* next term: 2 r / d = 4e-6 of it for the Moon */
        bst_assert_close(distance(force(&with, 0, r, at_rest), tide) / bst_vec3_norm(tide), 0,
                         1e-5);
        bst_gravity_free(none);
    }
}

static bst_vec3 slanted_area(void *user, const bst_force_state *at) {
    (void)user;
    (void)at;
    return (bst_vec3){3, -2, 1};
}

static void sunlight_pushes_away_and_not_in_the_shadow(void **state) {
    (void)state;
    bst_force_model model = {
        .gravity = fx.point,
        .solar_pressure = true,
        .spacecraft = {.mass_kg = 50, .light_area_m2 = 10, .light_coefficient = 1.5}};
    bst_force_model without = {.gravity = fx.point};
    bst_bodies b;
    bst_bodies_at(fx.epoch, &b);
    bst_vec3 u = bst_vec3_unit(b.sun_m);
    for (int side = -1; side <= 1; side += 2) {
        bst_vec3 r = bst_vec3_scale(u, side * 7e6);
        bst_vec3 push = bst_vec3_sub(force(&model, 0, r, at_rest), force(&without, 0, r, at_rest));
        double far = (bst_vec3_norm(b.sun_m) - side * 7e6) / 149597870700.0;
        double expected = side > 0 ? 1361.0 / 299792458.0 * 1.5 * 10 / 50 / (far * far) : 0;
        /* differences of accelerations of 8 m/s^2 */
        bst_assert_close(distance(push, bst_vec3_scale(u, -expected)), 0, 1e-14);
        /* on a shape: its area by direction, without a coefficient */
        const bst_force_surface surface = {.light_area_m2 = slanted_area};
        bst_force_model shaped = model;
        shaped.surface = &surface;
        push = bst_vec3_sub(force(&shaped, 0, r, at_rest), force(&without, 0, r, at_rest));
        bst_vec3 area = bst_vec3_scale((bst_vec3){3, -2, 1}, expected / 15);
        bst_assert_close(distance(push, area), 0, 1e-14);
    }
    assert_true(BST_SUNLIGHT_PRESSURE_PA > 4.5e-6 && BST_SUNLIGHT_PRESSURE_PA < 4.6e-6);
}

static void air_turns_with_the_earth_and_brakes(void **state) {
    (void)state;
    bst_force_model model = {
        .gravity = fx.point,
        .eop = fx.eop,
        .drag = true,
        .density_scale = 2,
        .spacecraft = {.mass_kg = 50, .drag_area_m2 = 3, .drag_coefficient = 2.2}};
    bst_force_model without = {.gravity = fx.point};
    bst_vec3 r = {6778137, 0, 0};
    bst_vec3 still = {0, 7.2921151467e-5 * 6778137, 0}; /* with the air, but for the pole's tilt */
    bst_vec3 brake = bst_vec3_sub(force(&model, 0, r, still), force(&without, 0, r, still));
    double factor = 0.5 * 2.2 * 3 / 50 * 2 * 3.725e-12;    /* density at 400 km */
    bst_assert_close(bst_vec3_norm(brake), 0, factor * 4); /* (2 m/s)^2: the tilt of 0.12 deg */
    bst_vec3 v = {0, 0, 7600};
    brake = bst_vec3_sub(force(&model, 0, r, v), force(&without, 0, r, v));
    double wind = hypot(7600, still.y);
    /* height to 5 m by the pole's tilt: 1e-4 of the density */
    bst_assert_close(brake.z / (-factor * wind * 7600), 1, 2e-4);
    bst_assert_close(brake.y / (factor * wind * still.y), 1, 2e-3);
}

static void density_is_the_table_s_and_smooth(void **state) {
    (void)state;
    static const double table[][2] = {{0, 1.225},       {100, 5.297e-7},  {150, 2.070e-9},
                                      {200, 2.789e-10}, {400, 3.725e-12}, {700, 3.614e-14},
                                      {1000, 3.019e-15}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        /* rounding through the logarithm */
        bst_assert_close(bst_atmosphere_density_kgpm3(1e3 * table[i][0]) / table[i][1], 1, 1e-13);
    }
    double last_slope = NAN, h = 500;
    for (double km = -5; km < 1500; km += 0.5) {
        double low = log(bst_atmosphere_density_kgpm3(1e3 * km));
        double slope = (log(bst_atmosphere_density_kgpm3(1e3 * km + h)) - low) / (h / 1e3);
        assert_true(slope < 0);
        if (!isnan(last_slope)) {
            /* the curvature is 3.6e-3 / km^2 at most */
            bst_assert_close(slope, last_slope, 2e-3);
        }
        last_slope = slope;
    }
}

static void heights_are_above_the_ellipsoid(void **state) {
    (void)state;
    /* exact on the axes */
    bst_assert_close(bst_astro_height_m((bst_vec3){6378137 + 4e5, 0, 0}), 4e5, 1e-8);
    bst_assert_close(bst_astro_height_m((bst_vec3){0, 0, -6356752.314245 - 4e5}), 4e5, 1e-5);
    /* at 45 degrees the geodetic point 400 km up: N = a / sqrt(1 - e2 / 2) */
    double e2 = 0.00669437999014, n = 6378137 / sqrt(1 - e2 / 2), c = sqrt(0.5);
    bst_vec3 p = {(n + 4e5) * c, 0, (n * (1 - e2) + 4e5) * c};
    double h = bst_astro_height_m(p);
    assert_true(h >= 4e5 && h < 4e5 + 2.5); /* what the header says */
}

static void values_do_not_depend_on_what_was_asked_before(void **state) {
    (void)state;
    bst_force_model model = {.gravity = fx.field,
                             .eop = fx.eop,
                             .sun = true,
                             .moon = true,
                             .solar_pressure = true,
                             .drag = true,
                             .density_scale = 1,
                             .spacecraft = {100, 1, 2.2, 1, 1.3}};
    bst_forces *f;
    bst_assert_ok(&fx.ctx, bst_forces_create(&fx.ctx, &model, fx.epoch, &f));
    bst_vec3 r = {7e6, 1e5, -3e5}, v = {0, 7e3, 2e3};
    for (int i = 0; i < 200; i++) {
        double t = 3600.0 * ((i * 7919) % 1000 - 500) + 0.123 * i;
        bst_vec3 a, b = force(&model, t, r, v);
        bst_assert_ok(&fx.ctx, bst_forces_at(&fx.ctx, f, t, r, v, &a));
        assert_memory_equal(&a, &b, sizeof a);
    }
    bst_vec3 a;
    assert_int_equal(bst_forces_at(&fx.ctx, f, 1.2e9, r, v, &a), BST_ERR_RANGE); /* 2060 */
    assert_int_equal(bst_forces_at(&fx.ctx, f, NAN, r, v, &a), BST_ERR_ARGUMENT);
    bst_forces_free(f);
    model.spacecraft.mass_kg = 0;
    assert_int_equal(bst_forces_create(&fx.ctx, &model, fx.epoch, &f), BST_ERR_ARGUMENT);
    assert_string_equal(fx.ctx.message, "solar pressure and drag need a mass above 0 (found 0 kg)");
    assert_null(f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_field_turns_with_the_earth),
        cmocka_unit_test(sun_and_moon_pull_as_point_masses),
        cmocka_unit_test(sunlight_pushes_away_and_not_in_the_shadow),
        cmocka_unit_test(air_turns_with_the_earth_and_brakes),
        cmocka_unit_test(density_is_the_table_s_and_smooth),
        cmocka_unit_test(heights_are_above_the_ellipsoid),
        cmocka_unit_test(values_do_not_depend_on_what_was_asked_before),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
