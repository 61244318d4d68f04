/* The choice of the target of interest among tracks made by hand. */
#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/target.h"
#include "tracker/tracker_internal.h"

#define AS BST_ARCSEC_RAD

static const bst_target_params params = {.direction_chi2 = 18.4,
                                         .rate_chi2 = 11.8,
                                         .magnitude_chi2 = 16,
                                         .release_chi2 = 200,
                                         .rate_floor_radps = 0.1 * AS,
                                         .max_rate_sigma_radps = 0.8 * AS,
                                         .max_chi2 = 4,
                                         .min_hits = 4,
                                         .margin = 2,
                                         .margin_hits = 8,
                                         .max_dormant_s = 600,
                                         .dormant_gate_chi2 = 23.5,
                                         .memory_noise_rad2ps3 = 0.04 * AS * AS};

static bst_vec3 place(double a1_as, double a2_as) {
    bst_vec3 centre = bst_vec3_from_radec(0.0, 0.5);
    bst_tangent axes = bst_tangent_at(centre);
    return bst_tangent_exp(centre, bst_tangent_vector(&axes, a1_as * AS, a2_as * AS));
}

static bst_target_cue make_cue(void) {
    bst_target_cue cue = {.valid = true,
                          .direction = place(0, 0),
                          .sigma_rad = 0.5 * BST_DEG_RAD,
                          .rate_sigma_radps = 0.5 * AS,
                          .v_mag = 13,
                          .v_mag_sigma = 1};
    bst_tangent axes = bst_tangent_at(cue.direction);
    cue.rate_radps = bst_tangent_vector(&axes, 50 * AS, 0);
    return cue;
}

static bst_mtt_track make_track(int64_t id, double a1_as, double rate_off_as, double v_mag) {
    bst_mtt_track t = {.id = id,
                       .status = BST_TRACK_CONFIRMED,
                       .v_mag = v_mag,
                       .v_mag_variance = 0.01,
                       .hits = 10,
                       .chi2 = 16};
    t.state.direction = place(a1_as, 30);
    bst_vec3 centre = place(0, 0);
    bst_tangent axes = bst_tangent_at(centre);
    t.state.rate_radps = bst_tangent_carry(centre, t.state.direction,
                                           bst_tangent_vector(&axes, 50 * AS, rate_off_as * AS));
    for (int i = 0; i < 4; i++) {
        t.state.covariance[i][i] = i < 2 ? 0.04 * AS * AS : 0.0025 * AS * AS;
    }
    return t;
}

static int64_t choose(bst_mtt_track *tracks, int count) {
    bst_target target = {0};
    bst_target_cue cue = make_cue();
    bst_target_step(&target, &params, &cue, 0.0, tracks, count);
    return target.id;
}

static void misfit_is_chi_square(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    bst_mtt_track t = make_track(1, 2160, 1.0, 14.0); /* 0.6 degree away */
    bst_target_fit fit = bst_target_misfit(&params, &cue, &t);
    /* (2160^2 + 30^2) / 1800^2 + 1 / (0.5^2 + 0.1^2 + 0.05^2) + 1 / 1.02; the track's own 0.2
     * arcsec adds to the cue's 1800 */
    double expected = (2160.0 * 2160.0 + 900.0) / (1800.0 * 1800.0) + 1.0 / 0.2625 + 1.0 / 1.02;
    bst_assert_close(fit.chi2, expected, 1e-6);
}

/* Chi-square of two, by elimination. */
static double chi2_of(const double x[2], double p11, double p12, double p22) {
    double y = x[1] - p12 / p11 * x[0];
    return x[0] * x[0] / p11 + y * y / (p22 - p12 * p12 / p11);
}

/* Covariances of all directions: direction, rate and magnitude each by its own, and the logarithm
 * of the determinants. */
static void misfit_off_the_diagonal(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    cue.sigma_rad = 10.0 * AS;
    cue.rate_sigma_radps = 0.04 * AS;
    bst_mtt_track t = make_track(1, 6.0, 0.12, 13.4);
    double(*p)[4] = t.state.covariance;
    p[0][0] = 900.0 * AS * AS;
    p[1][1] = 600.0 * AS * AS;
    p[0][1] = p[1][0] = -500.0 * AS * AS;
    p[2][2] = 0.0024 * AS * AS;
    p[3][3] = 0.0019 * AS * AS;
    p[2][3] = p[3][2] = 0.0015 * AS * AS;
    bst_vec3 east = bst_vec3_unit((bst_vec3){-t.state.direction.y, t.state.direction.x, 0});
    bst_vec3 north = bst_vec3_cross(t.state.direction, east);
    bst_vec3 off = bst_vec3_sub(cue.direction, t.state.direction);
    bst_vec3 slow = bst_vec3_sub(t.state.rate_radps, cue.rate_radps);
    const double d[2] = {bst_vec3_dot(off, east), bst_vec3_dot(off, north)};
    const double r[2] = {bst_vec3_dot(slow, east), bst_vec3_dot(slow, north)};
    double sigma2 = 100.0 * AS * AS;
    double floor2 = 0.04 * 0.04 * AS * AS + params.rate_floor_radps * params.rate_floor_radps;
    double m = t.v_mag - cue.v_mag, v = cue.v_mag_sigma * cue.v_mag_sigma + 0.01 + 0.01;
    double expected = chi2_of(d, p[0][0] + sigma2, p[0][1], p[1][1] + sigma2) +
                      chi2_of(r, p[2][2] + floor2, p[2][3], p[3][3] + floor2) + m * m / v;
    bst_target_fit fit = bst_target_misfit(&params, &cue, &t);
    bst_assert_close(fit.chi2, expected, 1e-3 * expected); /* axes turn by 1e-4 over the distance */
    double det = ((p[0][0] + sigma2) * (p[1][1] + sigma2) - p[0][1] * p[0][1]) *
                 ((p[2][2] + floor2) * (p[3][3] + floor2) - p[2][3] * p[2][3]) * v;
    bst_assert_close(fit.log_det, log(det), 1e-6);
}

/* A target is released beyond a chi-square of its rate by the covariance of both directions:
 * against the cue's rate, and, once it has left that, against its own departure unless it burned.
 */
static void released_by_the_covariance_of_its_rate(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    cue.rate_sigma_radps = 0.04 * AS;
    double floor2 = 0.04 * 0.04 * AS * AS + params.rate_floor_radps * params.rate_floor_radps;
    for (int n = 0; n < 32; n++) {
        bst_mtt_track t = make_track(1, 0, 0, 13.0);
        double(*p)[4] = t.state.covariance, angle = BST_PI * (n % 8) / 8.0;
        bool departed = n >= 16;
        p[2][2] = 0.0024 * AS * AS;
        p[3][3] = 0.0011 * AS * AS;
        p[2][3] = p[3][2] = (n % 16 < 8 ? 0.0014 : -0.0014) * AS * AS;
        bst_tangent axes = bst_tangent_at(t.state.direction);
        bst_vec3 own = bst_tangent_carry(cue.direction, t.state.direction, cue.rate_radps);
        bst_vec3 left = departed ? bst_tangent_vector(&axes, 3.0 * AS, -2.0 * AS) : (bst_vec3){0};
        const double way[2] = {cos(angle), sin(angle)};
        double limit =
            sqrt(params.release_chi2 / chi2_of(way, p[2][2] + floor2, p[2][3], p[3][3] + floor2));
        for (int k = 0; k < 3; k++) {
            double off = (k ? 1.001 : 0.999) * limit;
            t.state.rate_radps = bst_vec3_add(
                bst_vec3_add(own, left), bst_tangent_vector(&axes, off * way[0], off * way[1]));
            t.burned = k == 2;
            const bst_target target = {.id = 1, .departed = departed, .departure_radps = left};
            bool kept = bst_target_is_expected(&params, &cue, &t, &target);
            assert_int_equal(kept, k == 0 || (k == 2 && departed));
        }
    }
}

static void takes_the_likeliest(void **state) {
    (void)state;
    bst_mtt_track t[3] = {make_track(1, 100, 1.6, 13), make_track(2, 2160, 0.1, 13),
                          make_track(3, 50, -30, 13)};
    /* nearer to the cue, but its rate is wrong by 1.6 arcsec/s: the far one is the target */
    assert_int_equal(choose(t, 3), 2);
    /* brightness decides among equals */
    bst_mtt_track b[2] = {make_track(1, 500, 0.1, 15.5), make_track(2, 500, 0.1, 13.2)};
    assert_int_equal(choose(b, 2), 2);
}

/* While the filter assumes a manoeuvre its noise keeps the rate from becoming well known: such a
 * track is compared by that rate. */
static void takes_a_track_that_manoeuvres(void **state) {
    (void)state;
    for (int manoeuvre = 0; manoeuvre < 2; manoeuvre++) {
        bst_mtt_track t = make_track(1, 100, 1.0, 13);
        t.state.covariance[2][2] = t.state.covariance[3][3] = 1.6 * 1.6 * AS * AS;
        t.last_update_s = 100.0;
        t.manoeuvre_end_s = manoeuvre ? 160.0 : 99.0;
        assert_int_equal(choose(&t, 1), manoeuvre);
        t.state.rate_radps = bst_vec3_scale(t.state.rate_radps, 0.5); /* 25 arcsec/s off */
        assert_int_equal(choose(&t, 1), 0);
    }
}

static void takes_nothing_wrong(void **state) {
    (void)state;
    bst_mtt_track t = make_track(1, 0, 2.5, 13); /* wrong rate */
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 0, 0, 13);
    t.state.rate_radps = (bst_vec3){0, 0, 0}; /* a star */
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 0, 0, 13);
    t.status = BST_TRACK_TENTATIVE;
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 0, 0, 18); /* 5 sigma too faint */
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 9000, 0, 13); /* 2.5 degrees away */
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 0, 0, 13);
    t.state.covariance[2][2] = AS * AS; /* a rate that fits only because it is not known */
    assert_int_equal(choose(&t, 1), 0);
    t = make_track(1, 0, 0, 13);
    t.chi2 = 80; /* moves unlike any object */
    assert_int_equal(choose(&t, 1), 0);
    /* a poor candidate needs more hits than a good one */
    t = make_track(1, 0, 1.6, 13);
    t.hits = 6;
    assert_int_equal(choose(&t, 1), 0);
    t.hits = 12;
    assert_int_equal(choose(&t, 1), 1);
    t = make_track(1, 0, 0, 13);
    t.hits = 4;
    t.chi2 = 4;
    assert_int_equal(choose(&t, 1), 1);
    /* two young tracks that nothing distinguishes: wait */
    bst_mtt_track two[2] = {make_track(1, 10, 0.1, 13), make_track(2, 20, -0.1, 13)};
    two[0].hits = two[1].hits = 6;
    assert_int_equal(choose(two, 2), 0);
    assert_int_equal(choose(two, 0), 0);
    /* no cue */
    bst_target target = {0};
    bst_target_cue none = {.valid = false};
    bst_target_step(&target, &params, &none, 0.0, two, 2);
    assert_int_equal(target.id, 0);
    /* unknown brightness of the cue does not matter */
    bst_target_cue cue = make_cue();
    cue.v_mag_sigma = INFINITY;
    t = make_track(1, 0, 0, 18);
    bst_target_step(&target, &params, &cue, 0.0, &t, 1);
    assert_int_equal(target.id, 1);
}

static void keeps_and_lets_go(void **state) {
    (void)state;
    bst_target target = {0};
    bst_target_cue cue = make_cue();
    bst_mtt_track t[2] = {make_track(1, 300, 0.8, 13), make_track(2, 0, 0, 13)};
    bst_target_step(&target, &params, &cue, 0.0, t, 1);
    assert_int_equal(target.id, 1);
    /* a better one comes, the rate changes by a burn: identity holds */
    t[0] = make_track(1, 300, 3.0, 13);
    bst_target_step(&target, &params, &cue, 1.0, t, 2);
    assert_int_equal(target.id, 1);
    /* it has become a star */
    t[0].state.rate_radps = (bst_vec3){0, 0, 0};
    bst_target_step(&target, &params, &cue, 2.0, t, 1);
    assert_int_equal(target.id, 0);
    /* after a loss the place must fit, too */
    target = (bst_target){0};
    t[0] = make_track(1, 300, 0.1, 13);
    bst_target_step(&target, &params, &cue, 0.0, t, 1);
    bst_target_step(&target, &params, &cue, 10.0, NULL, 0);
    assert_int_equal(target.id, 0);
    t[0] = make_track(5, 300, 0.1, 13); /* where the target was, not where it must be by now */
    bst_target_step(&target, &params, &cue, 10.0, t, 1);
    assert_int_equal(target.id, 0);
    t[0] = make_track(6, 800, 0.1, 13); /* 50 arcsec/s later */
    bst_target_step(&target, &params, &cue, 10.0, t, 1);
    assert_int_equal(target.id, 6);
    /* and when the memory has faded, the cue alone decides */
    bst_target_step(&target, &params, &cue, 20.0, NULL, 0);
    t[0] = make_track(7, 300, 0.1, 13);
    bst_target_step(&target, &params, &cue, 400.0, t, 1);
    assert_int_equal(target.id, 0);
    bst_target_step(&target, &params, &cue, 700.0, t, 1);
    assert_int_equal(target.id, 7);
}

/* Only the cue makes something slow a candidate; a kept target is given more. */
static void expects_what_the_cue_says(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    const bst_target held = {.id = 1};
    bst_mtt_track t = make_track(1, 100, 0, 13);
    assert_true(bst_target_is_expected(&params, &cue, &t, NULL));
    t.state.rate_radps = (bst_vec3){0, 0, 0};
    assert_false(bst_target_is_expected(&params, &cue, &t, NULL));
    assert_false(bst_target_is_expected(&params, &cue, &t, &held));
    cue.rate_radps = (bst_vec3){0, 0, 0}; /* the target stands still */
    assert_true(bst_target_is_expected(&params, &cue, &t, NULL));
    bst_mtt_track far = make_track(2, 9000, 0, 13); /* but not 2.5 degrees from the cue, */
    far.state.rate_radps = (bst_vec3){0, 0, 0};
    assert_false(bst_target_is_expected(&params, &cue, &far, NULL));
    assert_true(bst_target_is_expected(&params, &cue, &far, &held)); /* unless it is the target */
    cue.valid = false;
    assert_false(bst_target_is_expected(&params, &cue, &t, &held));
    /* what became a star is no target, and says nothing about where the target is */
    bst_target target = {.id = 1};
    t = make_track(1, 100, 0, 13);
    t.at_rest = t.star = true;
    cue = make_cue();
    bst_target_step(&target, &params, &cue, 0.0, &t, 1);
    assert_int_equal(target.id, 0);
    assert_false(target.remembered);
}

/* Burns of several sizes, seconds long or many minutes: the target, seen in each frame, is held,
 * however far its rate gets from the cue's (1 arcsec/s^2: 200 m/s^2 at 40,000 km). A rate that has
 * jumped while it was not seen alone is another object's. */
static void holds_what_manoeuvres(void **state) {
    (void)state;
    static const double steps_as[] = {0.02, 0.06, 0.3, 1.0, 5.0};
    bst_target_cue cue = make_cue();
    for (size_t i = 0; i < sizeof steps_as / sizeof *steps_as; i++) {
        bst_target target = {0};
        bst_mtt_track t = make_track(1, 0, 0, 13);
        bst_target_step(&target, &params, &cue, 0.0, &t, 1);
        assert_int_equal(target.id, 1);
        for (int n = 1; n <= 400; n++) {
            double more = steps_as[i] * n;
            t = make_track(1, 100.0, 0, 13);
            bst_tangent axes = bst_tangent_at(t.state.direction);
            bst_vec3 burnt = bst_tangent_vector(&axes, 0.0, more * AS);
            t.state.rate_radps = bst_vec3_add(t.state.rate_radps, burnt);
            assert_true(bst_target_is_expected(&params, &cue, &t, &target));
            bst_target_step(&target, &params, &cue, n, &t, 1);
            assert_int_equal(target.id, 1);
        }
        /* hidden by another object's light for some frames, and then with that one's rate: 15 sigma
         * off (of 0.5 arcsec/s, the cue's) */
        bst_vec3 before = t.state.rate_radps;
        t.merged_in_row = 1;
        bst_target_step(&target, &params, &cue, 401, &t, 1);
        assert_int_equal(target.id, 1);
        bst_tangent axes = bst_tangent_at(t.state.direction);
        t.state.rate_radps = bst_vec3_add(before, bst_tangent_vector(&axes, 0.0, 8 * AS));
        if (steps_as[i] * 400 > 8) {
            bst_target_step(&target, &params, &cue, 402, &t, 1);
            assert_int_equal(target.id, 0);
        }
    }
    /* one that came to rest after a burn is a star */
    bst_target target = {0};
    bst_mtt_track t = make_track(1, 0, 0, 13);
    bst_target_step(&target, &params, &cue, 0.0, &t, 1);
    for (int n = 1; n <= 50; n++) {
        t.state.rate_radps = bst_vec3_scale(cue.rate_radps, 1.0 - 0.02 * n);
        bst_target_step(&target, &params, &cue, n, &t, 1);
    }
    assert_int_equal(target.id, 0);
}

/* What the tracker asks of a frame: the field without its margin, behind the aberration; the range
 * of the cue for the target, the assumed one for others; where the observer is. */
static void queries_of_a_frame(void **state) {
    (void)state;
    static bst_tracker t;
    t = (bst_tracker){.camera = {.width_px = 800, .height_px = 500, .pixel_scale_arcsec = 4.0},
                      .tick_rate_hz = 500.0,
                      .target_params = params,
                      .assumed_range_m = 2e6,
                      .range_sigma = 0.1,
                      .range_rate_sigma_mps = 70.0,
                      .edge_margin_px = 12.0};
    bst_tracker_frame_view f = {
        .tracker = &t, .cue = make_cue(), .range_m = 9e6, .range_rate_mps = -400};
    bst_vec3 z = place(0, 0), moving = {2e4, -1e4, 2.5e4};
    f.q_cam_from_gcrf = bst_quat_look(z, (bst_vec3){0.2, 0.3, 0.9});
    f.light = (bst_light){.velocity_mps = moving, .sun_m = {1.5e11, 0, 0}};
    const double c_mps = 299792458.0;
    const struct {
        double x, y;
        bool in;
    } at[] = {{12.2, 250, true}, {11.8, 250, false}, {786.8, 250, true}, {787.2, 250, false},
              {400, 12.2, true}, {400, 11.8, false}, {400, 486.8, true}, {400, 487.2, false}};
    for (int i = 0; i < 8; i++) {
        double u = (at[i].x - 399.5) * 4.0 * AS, v = (at[i].y - 249.5) * 4.0 * AS;
        bst_vec3 seen =
            bst_quat_rotate(bst_quat_conj(f.q_cam_from_gcrf), bst_vec3_unit((bst_vec3){u, v, 1.0}));
        /* the direction without aberration, of first order: 3 mas of the second, 0.001 px */
        bst_vec3 before = bst_vec3_unit(bst_vec3_axpy(seen, -1.0 / c_mps, moving));
        assert_int_equal(bst_tracker_frame_in_field(&f, before), at[i].in);
    }
    assert_false(bst_tracker_frame_in_field(&f, bst_vec3_scale(z, -1.0)));
    bst_orbit_range range;
    bst_mtt_track own = make_track(3, 5, 0.0, 13.0), other = make_track(4, 5, 60.0, 13.0);
    assert_true(bst_tracker_frame_is_expected(&f, &own));
    assert_false(bst_tracker_frame_is_expected(&f, &other));
    assert_true(bst_tracker_frame_range_of(&f, &own, &range));
    bst_assert_close(range.range_m, 9e6, 0.0);
    bst_assert_close(range.range_sigma_m, 9e5, 1e-6);
    bst_assert_close(range.range_rate_mps, -400.0, 0.0);
    bst_assert_close(range.range_rate_sigma_mps, 70.0, 0.0);
    assert_true(bst_tracker_frame_range_of(&f, &other, &range));
    bst_assert_close(range.range_m, 2e6, 0.0);
    bst_assert_close(range.range_sigma_m, 2e5, 1e-6);
    bst_assert_close(range.range_rate_mps, 0.0, 0.0);
    bst_assert_close(range.range_rate_sigma_mps, 3000.0, 0.0);
    t.assumed_range_m = 0.0;
    assert_false(bst_tracker_frame_range_of(&f, &other, &range));
    bst_vec3 rate;
    assert_true(bst_tracker_frame_expected_rate(&f, z, &rate));
    bst_assert_close(bst_vec3_angle(rate, f.cue.rate_radps), 0.0, 1e-6);
    bst_assert_close(bst_vec3_norm(rate), 50 * AS, 1e-3 * AS);
    f.cue.valid = false;
    assert_false(bst_tracker_frame_expected_rate(&f, z, &rate));
    /* a circular orbit 2.5 s after its telemetry; the Earth's own velocity is what is left */
    double r = 7e6, speed = sqrt(3.986004418e14 / r), turn = speed / r * 2.5;
    const bst_nav_telemetry nav = {.tick = 1000,
                                   .position_gcrf_m = {r, 0, 0},
                                   .velocity_gcrf_mps = {0, 0, speed},
                                   .velocity_bary_mps = {3e4, -1e4, speed + 5e3}};
    bst_od_observer eye;
    assert_true(bst_tracker_frame_observer(&t, &nav, 4.5, &eye));
    bst_assert_close(eye.time_s, 4.5, 0.0);
    bst_assert_close(eye.position_m.x, r * cos(turn), 0.01);
    bst_assert_close(eye.position_m.z, r * sin(turn), 0.01);
    bst_assert_close(eye.velocity_mps.x, -speed * sin(turn), 1e-4);
    bst_assert_close(eye.velocity_mps.z, speed * cos(turn), 1e-4);
    bst_assert_close(eye.earth_bary_mps.x, 3e4, 1e-9);
    bst_assert_close(eye.earth_bary_mps.y, -1e4, 1e-9);
    bst_assert_close(eye.earth_bary_mps.z, 5e3, 1e-9);
    /* by a clock that is 1.5 s fast the frame is at 3 s: navigation knows the time, 1 s before */
    static bst_clock clock;
    clock.state[0] = 1.5;
    t.clock = &clock;
    assert_true(bst_tracker_frame_observer(&t, &nav, 4.5, &eye));
    bst_assert_close(eye.position_m.x, r * cos(speed / r), 0.01);
    bst_assert_close(eye.position_m.z, r * sin(speed / r), 0.01);
    t.clock = NULL;
}

/* Two equal tracks are ambiguous; the rate decides later. A target that became certain keeps its
 * identity. */
static void ambiguity_is_resolved_by_time(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    for (int first_is_right = 0; first_is_right < 2; first_is_right++) {
        bst_target target = {0};
        bst_mtt_track t[2] = {make_track(1, 10, 0.0, 13), make_track(2, 10, 0.0, 13)};
        bst_target_step(&target, &params, &cue, 0.0, t, 2);
        assert_int_equal(target.id, 1);
        assert_true(target.ambiguous);
        assert_int_equal(target.rival_id, 2);
        bst_assert_close(target.probability, 0.5, 1e-12);
        bst_assert_close(target.rival_probability, 0.5, 1e-12);
        /* 1 arcsec/s off, of 0.512: 1/(1 + exp(-1/(2 * 0.2625))) = 0.870, not enough */
        t[first_is_right] = make_track(1 + first_is_right, 10, 1.0, 13);
        bst_target_step(&target, &params, &cue, 1.0, t, 2);
        assert_int_equal(target.id, 1);
        assert_true(target.ambiguous);
        double right = 1.0 / (1.0 + exp(-0.5 / 0.2625));
        bst_assert_close(target.probability, first_is_right ? right : 1.0 - right, 1e-6);
        /* 1.7 arcsec/s: odds of 246 */
        t[first_is_right] = make_track(1 + first_is_right, 10, 1.7, 13);
        bst_target_step(&target, &params, &cue, 2.0, t, 2);
        int64_t chosen = first_is_right ? 1 : 2;
        assert_int_equal(target.id, chosen);
        assert_false(target.ambiguous);
        /* now certain: it may manoeuvre */
        t[0] = make_track(chosen, 10, 1.7, 13);
        t[1] = make_track(3 - chosen, 10, 0.0, 13);
        t[1].hits = 16; /* no longer new */
        bst_target_step(&target, &params, &cue, 3.0, t, 2);
        assert_int_equal(target.id, chosen);
        assert_false(target.ambiguous);
    }
}

/* Neither a limit nor a disturbed motion makes the other of two like tracks certain. */
static void limits_do_not_make_certain(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    bst_target target = {0};
    /* limit: 1.76 arcsec/s */
    bst_mtt_track t[2] = {make_track(1, 10, 1.75, 13), make_track(2, 10, 1.78, 13)};
    t[0].hits = 12;
    for (int k = 0; k < 2; k++) { /* a rival from the first frame on, and a new one */
        target = (bst_target){0};
        bst_target_step(&target, &params, &cue, 0.0, t, 2 - k);
        bst_target_step(&target, &params, &cue, 1.0, t, 2);
        assert_int_equal(target.id, 1);
        assert_true(target.ambiguous);
        double odds = exp(0.5 * (1.78 * 1.78 - 1.75 * 1.75) / 0.2625);
        bst_assert_close(target.probability, odds / (1.0 + odds), 1e-6);
        assert_int_equal(target.rival_id, 2);
    }
    target = (bst_target){0};
    t[0] = make_track(1, 10, 0.0, 13);
    t[1] = make_track(2, 10, 0.0, 13);
    bst_target_step(&target, &params, &cue, 0.0, t, 2);
    t[0].chi2 = 80; /* a merged detection that was no centre of light */
    bst_target_step(&target, &params, &cue, 1.0, t, 2);
    assert_int_equal(target.id, 1);
    bst_assert_close(target.probability, 0.5, 1e-12);
    bst_mtt_track wrong[2] = {make_track(1, 10, 1.7, 13), t[1]}; /* but it can be refuted */
    wrong[0].chi2 = 80;
    bst_target other = target;
    bst_target_step(&other, &params, &cue, 2.0, wrong, 2);
    assert_int_equal(other.id, 2);
    t[0].state.covariance[2][2] = AS * AS; /* nor a rate that is not known */
    bst_target_step(&target, &params, &cue, 2.0, t, 2);
    assert_int_equal(target.id, 1);
    bst_assert_close(target.probability, 0.5, 1e-12);
    assert_true(target.ambiguous);
}

/* Two objects that pass each other swap their tracks while they share detections: the cue's rate
 * shows it, unless the target had left it by a manoeuvre. */
static void swapped_tracks_are_noticed(void **state) {
    (void)state;
    bst_target_cue cue = make_cue();
    for (int manoeuvred = 0; manoeuvred < 2; manoeuvred++) {
        double own = manoeuvred ? 2.5 : 0.0, other = manoeuvred ? 0.0 : 2.5;
        bst_target target = {0};
        bst_mtt_track t[2] = {make_track(1, 10, 0.0, 13), make_track(2, 20, other, 13)};
        bst_target_step(&target, &params, &cue, 0.0, t, 1);
        t[0] = make_track(1, 10, own, 13);
        bst_target_step(&target, &params, &cue, 1.0, t, 2);
        assert_int_equal(target.id, 1);
        t[0].merged_in_row = t[1].merged_in_row = 5;
        bst_target_step(&target, &params, &cue, 6.0, t, 2);
        assert_int_equal(target.id, 1);
        t[0] = make_track(1, 10, manoeuvred ? own : other, 13);
        t[1] = make_track(2, 20, 0.0, 13);
        bst_target_step(&target, &params, &cue, 7.0, t, 2);
        assert_int_equal(target.id, manoeuvred ? 1 : 2);
        assert_false(target.ambiguous);
    }
}

/* The cue's object has the cue's errors; another one is anywhere in a box of 4 sigma about the cue.
 * Of the choices with a probability p, the share p is right. */
static void probabilities_are_calibrated(void **state) {
    (void)state;
    enum { TRIALS = 60000, BINS = 5 };
    bst_rng_key key = bst_rng_make_key(5, 0, "test", "identity");
    const double sigma[5] = {1800.0, 1800.0, sqrt(0.2625), sqrt(0.2625), sqrt(1.02)};
    int count[BINS] = {0}, right[BINS] = {0};
    double sum[BINS] = {0};
    bst_target_cue cue = make_cue();
    for (uint64_t n = 0; n < TRIALS; n++) {
        bst_mtt_track t[2];
        for (int i = 0; i < 2; i++) {
            double x[5];
            for (uint64_t k = 0; k < 5; k++) {
                x[k] = sigma[k] * (i == 0 ? bst_rng_normal(key, n, k)
                                          : 8.0 * bst_rng_uniform(key, n, 20 + k) - 4.0);
            }
            t[i] = make_track(1 + i, 0, 0, 13 + x[4]);
            t[i].hits = 30; /* enough for any misfit within the gates */
            t[i].state.direction = place(x[0], x[1]);
            bst_tangent axes = bst_tangent_at(place(0, 0));
            t[i].state.rate_radps =
                bst_tangent_carry(place(0, 0), t[i].state.direction,
                                  bst_tangent_vector(&axes, (50 + x[2]) * AS, x[3] * AS));
        }
        bst_target target = {0};
        bst_target_step(&target, &params, &cue, 0.0, t, 2);
        int bin = (int)(10.0 * (target.probability - 0.5));
        if (target.id != 0 && bin >= 0) {
            bin = bin < BINS ? bin : BINS - 1;
            count[bin]++;
            right[bin] += target.id == 1;
            sum[bin] += target.probability;
        }
    }
    for (int b = 0; b < BINS; b++) {
        double stated = sum[b] / count[b], found = (double)right[b] / count[b];
        print_message("%d choices: stated %.3f, right %.3f\n", count[b], stated, found);
        assert_true(count[b] > 100);
        /* 5 %, and 3 sigma of the share */
        bst_assert_close(found, stated, 0.05 + 3.0 * sqrt(0.25 / count[b]) * (b < BINS - 1));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(misfit_is_chi_square),
                                       cmocka_unit_test(misfit_off_the_diagonal),
                                       cmocka_unit_test(released_by_the_covariance_of_its_rate),
                                       cmocka_unit_test(takes_the_likeliest),
                                       cmocka_unit_test(takes_a_track_that_manoeuvres),
                                       cmocka_unit_test(takes_nothing_wrong),
                                       cmocka_unit_test(keeps_and_lets_go),
                                       cmocka_unit_test(expects_what_the_cue_says),
                                       cmocka_unit_test(holds_what_manoeuvres),
                                       cmocka_unit_test(ambiguity_is_resolved_by_time),
                                       cmocka_unit_test(swapped_tracks_are_noticed),
                                       cmocka_unit_test(limits_do_not_make_certain),
                                       cmocka_unit_test(probabilities_are_calibrated),
                                       cmocka_unit_test(queries_of_a_frame)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
