/* One spacecraft described in two body frames, the second with the axes exchanged in a cycle: x is
 * its y, y its z, z its x. Inertia with products, wheels, modes, star trackers, gyro errors, the
 * surroundings' torques and the mount's reaction are the same, and so is the flight. An axis that
 * is treated unlike the others makes a difference. */
#include "sim/core/symmetric.h"
#include "tests/gimbal/craft_flight.h"

enum { WHEELS = 4, MODES = 2, TRACKERS = 2 };

typedef struct lists {
    bst_wheel_config wheels[WHEELS];
    bst_spacecraft_mode_config modes[MODES];
    bst_spacecraft_star_tracker_config trackers[TRACKERS];
} lists;

static void cycle(double v[3]) {
    double z = v[2];
    v[2] = v[1];
    v[1] = v[0];
    v[0] = z;
}

/* The other frame from the first one. */
static bst_quat exchange(void) {
    return bst_quat_unit((bst_quat){1, 1, 1, 1});
}

static bst_vec3 exchanged(bst_vec3 v) {
    return (bst_vec3){v.z, v.x, v.y};
}

static bst_spacecraft_config describe(bst_spacecraft_law law, bool other, lists *l) {
    bst_spacecraft_config c = config_make(law);
    const double axes[WHEELS][3] = {{1, 0.7, 0.2}, {-1, 1, 0.6}, {-0.4, -1, 1}, {0.3, -0.5, 1}};
    for (int i = 0; i < WHEELS; i++) {
        l->wheels[i] = bst_spacecraft_wheels(&c, &(int){0})[0];
        memcpy(l->wheels[i].axis, axes[i], sizeof axes[i]);
        l->wheels[i].speed_rpm = 1500.0 - 900.0 * i;
        l->wheels[i].static_imbalance_kgm = 1e-6;
        l->wheels[i].dynamic_imbalance_kgm2 = 1e-7;
        const double place[3] = {0.1 + 0.1 * i, -0.2, 0.3};
        memcpy(l->wheels[i].position_m, place, sizeof place);
    }
    l->modes[0] = (bst_spacecraft_mode_config){1.1, 0.01, {0.4, -0.2, 0.7}};
    l->modes[1] = (bst_spacecraft_mode_config){2.3, 0.02, {-0.1, 0.5, 0.3}};
    for (int i = 0; i < TRACKERS; i++) {
        l->trackers[i] = bst_spacecraft_trackers(&c, &(int){0})[i];
        const double axis[3] = {0.2, i ? -1.0 : 1.0, 0.4};
        memcpy(l->trackers[i].axis, axis, sizeof axis);
        /* noise is drawn about axes of the tracker's own: as good as none */
        l->trackers[i].noise_arcsec = l->trackers[i].noise_about_axis_arcsec = 1e-6;
    }
    c.wheels = (bst_config_list){l->wheels, WHEELS};
    c.modes = (bst_config_list){l->modes, MODES};
    c.star_trackers = (bst_config_list){l->trackers, TRACKERS};
    const double inertia[6] = {12, 17, 9, 1.1, -0.7, 0.5}, swapped[6] = {9, 12, 17, -0.7, 0.5, 1.1};
    memcpy(c.inertia_kgm2, other ? swapped : inertia, sizeof inertia);
    c.initial_knowledge_arcsec = 1e-6;
    c.gyro.angle_random_walk_deg_rth = c.gyro.rate_random_walk_deg_rth3 = 0.0;
    c.gyro.bias_sigma_degph = 0.0;
    c.disturbances.gravity_gradient = true;
    c.disturbances.srp_area_m2 = 3.0;
    c.disturbances.unload_dipole_am2 = 5.0;
    double *const vectors[] = {c.initial_attitude_error_deg,
                               c.initial_rate_degps,
                               c.gyro.bias_degph,
                               c.gyro.scale_factor_ppm,
                               c.disturbances.centre_of_pressure_m,
                               c.disturbances.residual_dipole_am2,
                               c.disturbances.constant_torque_nm,
                               c.attitude.axis,
                               c.attitude.second_axis};
    const double values[][3] = {{3, -2, 5},          {0.05, -0.1, 0.02}, {0.5, -1, 2},
                                {40, -70, 20},       {0.05, -0.1, 0.2},  {0.3, -0.8, 0.5},
                                {2e-4, -5e-4, 1e-4}, {0.3, -0.2, 1},     {1, 0.2, -0.1}};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        memcpy(vectors[i], values[i], sizeof values[i]);
    }
    if (other) {
        for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
            cycle(vectors[i]);
        }
        for (int i = 0; i < WHEELS; i++) {
            cycle(l->wheels[i].axis);
            cycle(l->wheels[i].position_m);
        }
        for (int i = 0; i < MODES; i++) {
            cycle(l->modes[i].coupling);
        }
        for (int i = 0; i < TRACKERS; i++) {
            cycle(l->trackers[i].axis);
        }
    }
    return c;
}

static double angle_between(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

static double apart(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

static void fly_both(bst_spacecraft_law law) {
    static lists l[2];
    bst_spacecraft *craft[2];
    const double dt_s = 1e-2;
    const bst_quat q_nominal = bst_quat_unit((bst_quat){0.1, 0.3, -0.2, 0.9});
    double turned = 0.0;
    for (int k = 0; k < 2; k++) {
        bst_spacecraft_config c = describe(law, k, &l[k]);
        bst_spacecraft_setup setup = {
            .dt_s = dt_s,
            .q_nominal = k ? bst_quat_mul(exchange(), q_nominal) : q_nominal,
            .sky_at = sky_at,
            .seed = 7,
            .instance = "craft"};
        bst_assert_ok(&ctx, bst_spacecraft_create(&ctx, &c, &setup, &craft[k]));
    }
    for (int64_t n = 0; n < 9000; n++) {
        double s = dt_s * (double)n;
        bst_vec3 reaction = {1e-3 * sin(s), -2e-3 * cos(0.7 * s), 5e-4};
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, craft[0], n, s, reaction));
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, craft[1], n, s, exchanged(reaction)));
        if (n % 500 != 499) {
            continue;
        }
        const bst_spacecraft_now *a = bst_spacecraft_at(craft[0]), *b = bst_spacecraft_at(craft[1]);
        turned = fmax(turned, angle_between(a->body.q_body_from_gcrf, q_nominal));
        /* what noise of 1e-6 arcsec leaves: 1e-10 of the filter, and of the control after it */
        bst_assert_close(angle_between(b->body.q_body_from_gcrf,
                                       bst_quat_mul(exchange(), a->body.q_body_from_gcrf)),
                         0.0, 1e-9);
        bst_assert_close(angle_between(b->q_believed_from_gcrf,
                                       bst_quat_mul(exchange(), a->q_believed_from_gcrf)),
                         0.0, 1e-9);
        bst_assert_close(angle_between(b->reference.q_body_from_gcrf,
                                       bst_quat_mul(exchange(), a->reference.q_body_from_gcrf)),
                         0.0, 1e-11);
        bst_assert_close(apart(b->reference.rate_radps, exchanged(a->reference.rate_radps)), 0.0,
                         1e-11);
        bst_assert_close(apart(b->reference.accel_radps2, exchanged(a->reference.accel_radps2)),
                         0.0, 1e-10);
        bst_assert_close(apart(b->body.rate_radps, exchanged(a->body.rate_radps)), 0.0, 1e-9);
        bst_assert_close(apart(b->body.accel_radps2, exchanged(a->body.accel_radps2)), 0.0, 1e-8);
        bst_assert_close(apart(b->rate_believed_radps, exchanged(a->rate_believed_radps)), 0.0,
                         1e-9);
        for (int i = 0; i < WHEELS; i++) {
            bst_assert_close(b->wheel_radps[i], a->wheel_radps[i], 1e-5);
        }
        assert_int_equal(b->wheel_flags, a->wheel_flags);
        assert_int_equal(b->tracked, a->tracked);
        bst_assert_close(b->unresolved_rad2, a->unresolved_rad2, 1e-20);
        if (law != BST_LAW_FREE && s > 80.0) { /* the attitude is that of the law but for a lag */
            assert_true(off(a) < 2e-3);
        }
    }
    assert_true(turned > 0.1);
    bst_spacecraft_free(craft[0]);
    bst_spacecraft_free(craft[1]);
}

static void the_axes_are_alike(void **state) {
    (void)state;
    const bst_spacecraft_law laws[] = {BST_LAW_NADIR, BST_LAW_TARGET, BST_LAW_FREE};
    for (int i = 0; i < 3; i++) {
        fly_both(laws[i]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_axes_are_alike)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
