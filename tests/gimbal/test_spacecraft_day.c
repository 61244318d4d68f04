/* Days of a spacecraft at 1 kHz; with an argument, fewer seconds: `test_gimbal_spacecraft_day 30`.
 */
#include "gimbal/spacecraft/spacecraft.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

static bst_ctx ctx;
static double day_s = 86400.0;
static const double nothing[BST_WHEELS_MOST];

/* Torque-free: spinning wheels, swinging modes, a tumbling body. */
static void test_momentum_over_a_day(void **state) {
    (void)state;
    for (int full = 0; full < 2; full++) {
        bst_spacecraft_spec spec = {.inertia_kgm2 = {10.0, 12.0, 14.0, 0.3, -0.2, 0.1},
                                    .wheels = full ? 4 : 0,
                                    .modes = full ? 2 : 0,
                                    .wheel = {{{0.6, 0, 0.8}, 1e-3},
                                              {{-0.6, 0, 0.8}, 1e-3},
                                              {{0, 0.6, 0.8}, 1e-3},
                                              {{0, -0.6, 0.8}, 1e-3}},
                                    .mode = {{2.0 * BST_PI * 1.1, 0.0, {1.2, 0.0, 0.3}},
                                             {2.0 * BST_PI * 3.4, 0.0, {0.0, 0.8, 0.1}}},
                                    .integrator = BST_INTEGRATE_SYMPLECTIC,
                                    .dt_s = 1e-3};
        double spin[BST_WHEELS_MOST] = {300.0, -200.0, 100.0, 500.0};
        bst_spacecraft_body body;
        bst_assert_ok(&ctx, bst_spacecraft_body_init(&ctx, &body, &spec, BST_QUAT_IDENTITY,
                                                     (bst_vec3){0.02, 0.1, 0.03}, spin));
        body.mode_place[0] = full ? 0.01 : 0.0;
        bst_vec3 l0 = bst_spacecraft_body_momentum(&body);
        double e0 = bst_spacecraft_body_energy(&body), moving = e0;
        for (int i = 0; i < spec.wheels; i++) {
            double g = body.wheel_momentum[i];
            moving -= 0.5 * g * g / spec.wheel[i].inertia_kgm2;
        }
        double momentum = 0.0, energy[2] = {0, 0}, norm = 0.0;
        int64_t steps = (int64_t)(day_s * 1000.0);
        for (int64_t n = 1; n <= steps; n++) {
            bst_spacecraft_body_step(&body, (bst_vec3){0, 0, 0}, nothing);
            if (n % 997 == 0) {
                bst_vec3 off = bst_vec3_sub(bst_spacecraft_body_momentum(&body), l0);
                bst_quat q = bst_spacecraft_body_attitude(&body);
                momentum = fmax(momentum, bst_vec3_norm(off) / bst_vec3_norm(l0));
                norm = fmax(norm, fabs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0));
                double *e = &energy[n > steps / 2];
                *e = fmax(*e, fabs(bst_spacecraft_body_energy(&body) - e0) / moving);
            }
        }
        print_message(
            "%s, %g s: momentum %.1e, norm %.1e, energy %.1e in the first half, %.1e in "
            "the second\n",
            full ? "with wheels and modes" : "rigid", day_s, momentum, norm, energy[0], energy[1]);
        assert_true(momentum < 1e-9);
        assert_true(norm < 1e-14);
        /* the rigid body's stays within its bounds; with modes it grows, with time at most; 1e-8:
         * (w dt)^2, for short runs */
        assert_true(energy[1] < (full ? 2.5 : 1.5) * energy[0] + 1e-8);
        assert_true(energy[0] < 1e-6);
    }
}

/* Low orbit, inclined; the Sun in the orbit's plane, so that there are eclipses. */
static bst_status sky_at(void *user, bst_ctx *c, double seconds, bst_spacecraft_sky *out) {
    (void)user;
    (void)c;
    double r = 7e6, n = sqrt(BST_EARTH_MU_M3PS2 / (r * r * r)), phase = n * seconds;
    bst_vec3 u = {cos(phase), 0.5 * sin(phase), 0.8660254037844386 * sin(phase)};
    bst_vec3 v = {-sin(phase), 0.5 * cos(phase), 0.8660254037844386 * cos(phase)};
    bst_vec3 sun = {BST_AU_M, 0, 0};
    *out = (bst_spacecraft_sky){.position_m = bst_vec3_scale(u, r), .sun_m = sun};
    out->sunlit = bst_astro_sun_fraction(out->position_m, sun, BST_EARTH_POLE_J2000);
    out->known = (bst_spacecraft_law_inputs){
        .position_m = out->position_m, .velocity_mps = bst_vec3_scale(v, n * r), .sun_m = sun};
    return BST_OK;
}

/* All there is: four wheels with friction and imbalance, two modes, every disturbance, both star
 * trackers with their exclusions and alignment errors, unloading. It holds nadir all day. */
static void test_a_day_with_everything(void **state) {
    (void)state;
    bst_spacecraft_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_spacecraft_config_table, &c));
    c.type = BST_CRAFT_RIGID_BODY;
    c.attitude.law = BST_LAW_NADIR;
    c.initial_attitude_error_deg[0] = 40.0;
    static bst_wheel_config wheels[4];
    static bst_spacecraft_star_tracker_config trackers[2];
    int count;
    memcpy(wheels, bst_spacecraft_wheels(&c, &count), sizeof wheels);
    memcpy(trackers, bst_spacecraft_trackers(&c, &count), sizeof trackers);
    c.wheels = (bst_config_list){wheels, 4};
    c.star_trackers = (bst_config_list){trackers, 2};
    for (int i = 0; i < 4; i++) {
        wheels[i].speed_rpm = i % 2 ? -1500.0 : 1500.0;
        wheels[i].coulomb_nm = 5e-4;
        wheels[i].viscous_nms = 2e-6;
        wheels[i].static_imbalance_kgm = 1e-6;
        wheels[i].dynamic_imbalance_kgm2 = 1e-8;
        wheels[i].position_m[0] = 0.2;
    }
    static bst_spacecraft_mode_config modes[2] = {{1.1, 0.005, {1.2, 0.0, 0.3}},
                                                  {3.4, 0.005, {0, 0.8, 0.1}}};
    c.modes = (bst_config_list){modes, 2};
    trackers[0].misalignment_arcsec[0] = 10.0;
    c.gyro.scale_factor_ppm[1] = 100.0;
    c.gyro.misalignment_arcsec[2] = 30.0;
    c.disturbances = (bst_disturbance_config){.gravity_gradient = true,
                                              .srp_area_m2 = 2.0,
                                              .cr = 1.3,
                                              .centre_of_pressure_m = {0.0, 0.05, 0.1},
                                              .residual_dipole_am2 = {0.1, -0.1, 0.05},
                                              .constant_torque_nm = {1e-6, 0, -1e-6},
                                              .unload_dipole_am2 = 5.0};
    bst_spacecraft_setup setup = {.dt_s = 1e-3,
                                  .q_nominal = BST_QUAT_IDENTITY,
                                  .sky_at = sky_at,
                                  .seed = 5,
                                  .instance = "craft"};
    bst_spacecraft *craft = NULL;
    bst_assert_ok(&ctx, bst_spacecraft_create(&ctx, &c, &setup, &craft));
    const bst_spacecraft_now *now = bst_spacecraft_at(craft);
    double pointing = 0.0, knowledge = 0.0, fastest = 0.0;
    int64_t steps = (int64_t)(day_s * 1000.0) + 1;
    for (int64_t n = 0; n < steps; n++) {
        bst_assert_ok(&ctx,
                      bst_spacecraft_step(&ctx, craft, n, 1e-3 * (double)n, (bst_vec3){0, 0, 0}));
        if (n % 1000 != 0) {
            continue;
        }
        bst_vec3 p =
            bst_attitude_filter_error(now->body.q_body_from_gcrf, now->reference.q_body_from_gcrf);
        assert_true(isfinite(p.x + p.y + p.z));
        for (int i = 0; i < 4; i++) {
            fastest = fmax(fastest, fabs(now->wheel_radps[i]));
        }
        if (n > 600000) {
            bst_vec3 k =
                bst_attitude_filter_error(now->body.q_body_from_gcrf, now->q_believed_from_gcrf);
            pointing = fmax(pointing, bst_vec3_norm(p));
            knowledge = fmax(knowledge, bst_vec3_norm(k));
            assert_int_equal(now->wheel_flags, 0);
        }
    }
    print_message(
        "%g s: pointing within %.1f arcsec, knowledge within %.1f, wheels below %.0f rpm\n", day_s,
        pointing / BST_ARCSEC_RAD, knowledge / BST_ARCSEC_RAD, fastest * 30.0 / BST_PI);
    assert_true(knowledge < 60.0 * BST_ARCSEC_RAD);
    assert_true(pointing < 300.0 * BST_ARCSEC_RAD);
    assert_true(fastest < 5900.0 * BST_PI / 30.0);
    bst_spacecraft_free(craft);
}

int main(int argc, char **argv) {
    if (argc > 1) {
        day_s = atof(argv[1]);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_momentum_over_a_day),
                                       cmocka_unit_test(test_a_day_with_everything)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
