/* Modes beside the main loop: fixed, scan, the search of a region, coasting, cues that jump or end,
 * and a search that gives up. */
#include "tests/control/open_rig.h"

static void a_direction_is_held_among_the_stars(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    config.strategy = BST_CONTROL_FIXED;
    config.fixed_direction[0] = 3.0;
    config.fixed_direction[1] = -4.0;
    config.fixed_direction[2] = 0.0;
    rig_open(&r, &config, BST_REGION_NONE);
    for (int64_t t = 0; t < 5000; t += 50) {
        step(&r, t, t % 1000 == 0);
        assert_int_equal(r.status.mode, BST_MODE_FIXED);
        /* no velocity of the observer: apparent is geometric but for rounding */
        assert_true(bst_vec3_angle(r.command.direction_gcrf, (bst_vec3){0.6, -0.8, 0}) < 1e-12);
        assert_true(bst_vec3_norm(r.command.rate_gcrf_radps) < 1e-12);
    }
    rig_close(&r);
}

static void a_direction_is_held_in_the_body(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    config.strategy = BST_CONTROL_FIXED;
    config.fixed_frame = BST_CONTROL_FIXED_BODY;
    config.fixed_direction[0] = 1.0;
    config.fixed_direction[1] = 1.0;
    config.fixed_direction[2] = 0.0;
    config.command_latency_s = 0.2;
    rig_open(&r, &config, BST_REGION_NONE);
    bst_vec3 held = bst_vec3_unit((bst_vec3){1, 1, 0}), rate = {0, 0, 1e-3};
    for (int64_t t = 0; t < 20000; t += 50) {
        /* coordinates of the body, which turns by `rate` */
        r.q_body = bst_quat_from_rotvec(bst_vec3_scale(rate, -(double)t / TICKS));
        /* a fix of the stars that would move any other aim is of no account here */
        r.tracks->attitude = (bst_attitude_fix){.valid = true,
                                                .stars = 9,
                                                .tick = t - 400,
                                                .error_cam_rad = {1e-3, 0, 0},
                                                .sigma_rad = {1e-6, 1e-6, 1e-6},
                                                .q_cam_from_gcrf = r.q_cam};
        step(&r, t, t % 1000 == 500);
        assert_int_equal(r.status.mode, BST_MODE_FIXED);
        bst_quat then = bst_quat_from_rotvec(bst_vec3_scale(rate, -(double)r.command.tick / TICKS));
        double off =
            bst_vec3_angle(r.command.direction_gcrf, bst_quat_rotate(bst_quat_conj(then), held));
        /* the rate is learnt within a few of its 2 s: 0.2 s of it are missing at first */
        assert_true(off <= 2e-4 * exp(-(double)t / 2000.0) + 1e-9);
    }
    rig_close(&r);
}

static void the_scan_goes_to_and_fro(void **state) {
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        rig r;
        bst_control_config config = defaults();
        config.strategy = BST_CONTROL_SCAN;
        config.scan_rate_arcsec_per_s = sign * 3600.0; /* 1 deg/s over 6 deg */
        rig_open(&r, &config, BST_REGION_GEOSTATIONARY);
        for (int64_t t = 0; t < 30000; t += 50) {
            step(&r, t, false);
            assert_int_equal(r.status.mode, BST_MODE_SCAN);
            double u = fmod((double)t / TICKS, 12.0), from_end = u <= 6.0 ? u : 12.0 - u;
            double along = sign * (from_end - 3.0) * BST_DEG_RAD;
            bst_vec3 d;
            bst_assert_ok(&r.ctx, region_at(&r, &r.ctx, (double)t / TICKS, along, 0.0, &d));
            assert_true(bst_vec3_angle(r.command.direction_gcrf, d) < 1e-9);
            if (fabs(from_end - 3.0) < 2.7) { /* the difference that gives it spans half a second */
                double scan = (u <= 6.0 ? 1 : -1) * sign * BST_DEG_RAD + DRIFT;
                bst_assert_close(bst_vec3_norm(r.command.rate_gcrf_radps), fabs(scan), 1e-6);
            }
        }
        rig_close(&r);
    }
}

/* Brute force: places of the region, each of which must have been within the field for a whole
 * dwell, on a sky on which the region drifts and lies askew to the image. */
static void a_region_is_searched_without_gaps(void **state) {
    (void)state;
    enum { NU = 61, NV = 21 };
    static int seen[NU][NV], now[NU][NV];
    static const struct {
        int region, rate;
        double roll; /* of the region on the image, rad */
    } cases[] = {{BST_REGION_GEOSTATIONARY, BST_CONTROL_RATE_BELT, 0.0},
                 {BST_REGION_GEOSTATIONARY, BST_CONTROL_RATE_BELT, 0.5},
                 {BST_REGION_GEOSTATIONARY, BST_CONTROL_RATE_SIDEREAL, 0.0},
                 {BST_REGION_ARC, BST_CONTROL_RATE_SIDEREAL, 1.2},
                 {BST_REGION_ARC, BST_CONTROL_RATE_BELT, 0.0}};
    for (int pattern = 0; pattern < 4; pattern++) {
        for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
            rig r;
            bst_control_config config = defaults();
            config.search_pattern = pattern;
            config.search_rate = cases[c].rate;
            rig_open(&r, &config, cases[c].region);
            r.image_x = (bst_vec3){0, cos(cases[c].roll), sin(cases[c].roll)};
            r.q_cam = bst_quat_look((bst_vec3){1, 0, 0}, r.image_x);
            memset(seen, 0, sizeof seen);
            int places = 0, last = -1, swept = 0;
            for (int64_t t = 0; t < 400000 && !swept; t += 250) {
                step(&r, t, t % 1000 == 500);
                r.q_cam = bst_quat_look(r.command.direction_gcrf, r.image_x);
                assert_int_equal(r.status.mode, BST_MODE_SEARCH);
                swept = t > 0 && r.control.transition_count > 0;
                if (r.status.search_step != last) {
                    last = r.status.search_step;
                    places++;
                    memset(now, 0, sizeof now);
                }
                for (int i = 0; i < NU * NV; i++) {
                    double u = r.control.env.region.half_length_rad *
                               (2.0 * (i / NV) / (NU - 1) - 1),
                           v = r.control.env.region.half_width_rad *
                               (2.0 * (i % NV) / (NV - 1) - 1);
                    bst_vec3 d, f;
                    bst_assert_ok(&r.ctx, region_at(&r, &r.ctx, (double)t / TICKS, u, v, &d));
                    f = bst_quat_rotate(r.q_cam, d);
                    bool in = fabs(atan2(f.x, f.z)) <= 0.5 * FIELD * (1 + 1e-9) &&
                              fabs(atan2(f.y, f.z)) <= 0.5 * FIELD * (1 + 1e-9);
                    now[i / NV][i % NV] += in;
                    /* two whole exposures at rest last 1.5 s at a frame a second */
                    seen[i / NV][i % NV] |= now[i / NV][i % NV] >= 6;
                }
            }
            assert_true(swept);
            assert_int_equal(places, r.control.search.count + (last == 0 && places > 1));
            for (int i = 0; i < NU * NV; i++) {
                assert_true(seen[i / NV][i % NV]);
            }
            rig_close(&r);
        }
    }
}

/* Without a cue: only what moves as the belt there, and is as bright, is a candidate. */
static void candidates_of_a_region(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    config.search_pattern = BST_SEARCH_BELT;
    rig_open(&r, &config, BST_REGION_GEOSTATIONARY);
    step(&r, 0, false);
    step(&r, 50, false);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    bst_vec3 d = boresight(&r), along = bst_vec3_cross((bst_vec3){0, 0, 1}, d);
    bst_track fits = {.id = 1,
                      .hits = 2,
                      .score = 20.0,
                      .v_mag = 13.4,
                      .direction_gcrf = d,
                      .rate_gcrf_radps = bst_vec3_scale(along, DRIFT)};
    fits.covariance[2][2] = fits.covariance[3][3] = 0.01 * BST_ARCSEC_RAD * BST_ARCSEC_RAD;
    bst_track others[4];
    for (int k = 0; k < 4; k++) {
        others[k] = fits;
        others[k].id = 2 + k;
    }
    others[0].rate_gcrf_radps = (bst_vec3){0, 0, 0};                               /* a star */
    others[1].rate_gcrf_radps = bst_vec3_scale(along, DRIFT + 3 * BST_ARCSEC_RAD); /* too fast */
    others[2].v_mag = 16.0;                                                        /* too dim */
    others[3].uncorrelated = true; /* the tracker knows better */
    r.tracks->count = 4;
    memcpy(r.tracks->items, others, sizeof others);
    step(&r, 500, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->items[1] = fits;
    step(&r, 1500, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    assert_int_equal(r.control.held.id, 1);
    /* labelled as something else: the search goes on at once, and does not come back to it */
    r.tracks->items[1].status = BST_TRACK_CONFIRMED;
    r.tracks->items[1].uncorrelated = true;
    step(&r, 2500, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->items[1].uncorrelated = false;
    step(&r, 3500, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    rig_close(&r);
}

static void coasting_follows_the_prediction(void **state) {
    (void)state;
    for (int hidden = BST_HIDDEN_SHADOW; hidden <= BST_HIDDEN_EARTH; hidden++) {
        rig r;
        bst_control_config config = defaults();
        rig_open(&r, &config, BST_REGION_NONE);
        int64_t t = 0;
        bst_onboard_cue cue;
        for (; t < 3000; t += 50) {
            step(&r, t, false);
        }
        for (int k = 0; k < 3; k++) {
            bst_assert_ok(&r.ctx, cue_at(&r, &r.ctx, (double)(t + 100) / TICKS, &cue));
            put_target(&r, cue.direction_gcrf, cue.rate_gcrf_radps, 0);
            step(&r, t + 500, true);
            t += 1000;
        }
        assert_int_equal(r.status.mode, BST_MODE_TRACK);
        /* hidden for ten minutes, in which the prediction drifts by an arcsecond a second; no
         * transition moves the aim */
        for (int k = 0; k < 600; k++, t += 1000) {
            bst_los_command before = r.command;
            bst_assert_ok(&r.ctx, cue_at(&r, &r.ctx, (double)(t + 100) / TICKS, &cue));
            bst_vec3 d = bst_vec3_unit(
                bst_vec3_axpy(cue.direction_gcrf, k * BST_ARCSEC_RAD, (bst_vec3){0, 0, 1}));
            put_target(&r, d, cue.rate_gcrf_radps, hidden);
            step(&r, t + 500, true);
            assert_int_equal(r.status.mode, BST_MODE_COAST);
            bst_vec3 was =
                bst_vec3_axpy(before.direction_gcrf, (double)(r.command.tick - before.tick) / TICKS,
                              before.rate_gcrf_radps);
            /* the drift, and the arc of a second */
            assert_true(bst_vec3_angle(was, r.command.direction_gcrf) < 1.2 * BST_ARCSEC_RAD);
        }
        /* to be seen again: awaited there first, then searched about it */
        for (int k = 0; k < 15; k++, t += 1000) {
            r.tracks->items[0].hidden = BST_HIDDEN_AWAITED;
            step(&r, t + 500, true);
            assert_int_equal(r.status.mode, BST_MODE_REACQUIRE);
            assert_int_equal(r.status.search_step, 0);
        }
        for (int k = 0; k < 15; k++, t += 1000) {
            step(&r, t + 500, true);
        }
        assert_true(r.status.search_step > 0);
        /* seen */
        bst_vec3 d = boresight(&r);
        put_target(&r, d, cue.rate_gcrf_radps, 0);
        step(&r, t + 500, true);
        assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
        rig_close(&r);
    }
}

static void a_cue_that_jumps_is_followed(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    rig_open(&r, &config, BST_REGION_NONE);
    r.jump_s = 5.0;
    r.cue_jump_rad = 5.0 * BST_DEG_RAD;
    for (int64_t t = 0; t < 5000; t += 50) {
        step(&r, t, t % 1000 == 500);
    }
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    step(&r, 5000, false);
    assert_int_equal(r.status.mode, BST_MODE_SLEW);
    assert_int_equal(r.control.transition_count, 1);
    bst_onboard_cue cue;
    bst_assert_ok(&r.ctx, cue_at(&r, &r.ctx, 5.0, &cue));
    assert_true(bst_vec3_angle(r.command.direction_gcrf, cue.direction_gcrf) < 1e-9);
    for (int64_t t = 5050; t < 6000; t += 50) {
        step(&r, t, false); /* the rate is a difference over half a second */
    }
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    assert_true(bst_vec3_angle(boresight(&r), cue.direction_gcrf) < 60.0 * BST_ARCSEC_RAD);
    rig_close(&r);

    /* a target that is held does not jump with it, before the next frame or after it */
    rig_open(&r, &config, BST_REGION_NONE);
    r.jump_s = 5.0;
    r.cue_jump_rad = 5.0 * BST_DEG_RAD;
    bst_vec3 rate = {0, 50.0 * BST_ARCSEC_RAD, 0};
    for (int64_t t = 0; t < 9000; t += 50) {
        double mid_s = (double)(t - 400) / TICKS, a = 50.0 * BST_ARCSEC_RAD * mid_s;
        if (t % 1000 == 500) {
            put_target(&r, (bst_vec3){cos(a), sin(a), 0}, rate, 0);
        }
        step(&r, t, t % 1000 == 500);
        if (t > 2000) {
            assert_int_equal(r.status.mode, BST_MODE_TRACK);
            double now = 50.0 * BST_ARCSEC_RAD * (double)r.command.tick / TICKS;
            assert_true(bst_vec3_angle(r.command.direction_gcrf,
                                       (bst_vec3){cos(now), sin(now), 0}) < 0.1 * PX);
        }
    }
    rig_close(&r);
}

static void a_cue_that_ends_and_comes_back(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    rig_open(&r, &config, BST_REGION_NONE);
    r.cue_end_s = 3.0;
    for (int64_t t = 0; t < 6000; t += 50) {
        step(&r, t, t % 1000 == 500);
        bst_vec3 d = r.command.direction_gcrf;
        assert_true(isfinite(d.x) && fabs(bst_vec3_norm(d) - 1.0) < 1e-9);
    }
    /* a target is followed without it */
    put_target(&r, boresight(&r), (bst_vec3){0, 50.0 * BST_ARCSEC_RAD, 0}, 0);
    step(&r, 6500, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    rig_close(&r);

    rig_open(&r, &config, BST_REGION_NONE);
    r.cue_end_s = 3.0;
    for (int64_t t = 0; t < 6000; t += 50) {
        step(&r, t, t % 1000 == 500);
    }
    r.cue_end_s = INFINITY;
    step(&r, 6050, false);
    assert_int_equal(r.status.mode, BST_MODE_SLEW);
    assert_true(r.commanded);
    rig_close(&r);
}

static void the_search_gives_up_when_told_to(void **state) {
    (void)state;
    for (int region = BST_REGION_NONE; region <= BST_REGION_ARC; region++) {
        rig r;
        bst_control_config config = defaults();
        config.search_timeout_s = 60.0;
        rig_open(&r, &config, region);
        for (int64_t t = 0; t <= 60000; t += 50) {
            step(&r, t, t % 1000 == 500);
            assert_true(r.status.mode == BST_MODE_SEARCH || r.status.mode == BST_MODE_SLEW);
        }
        step(&r, 60050, false);
        assert_int_equal(r.status.mode, BST_MODE_IDLE);
        assert_int_equal(r.control.transition_count, 1);
        for (int64_t t = 60100; t < 65000; t += 50) {
            step(&r, t, t % 1000 == 500);
            assert_int_equal(r.status.mode, BST_MODE_IDLE);
        }
        /* but what the tracker names is still taken */
        put_target(&r, boresight(&r), (bst_vec3){0, 0, 0}, 0);
        step(&r, 65500, true);
        assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
        rig_close(&r);
    }
}

static void what_needs_a_region_is_refused_without(void **state) {
    (void)state;
    rig r = {.cue_valid = true};
    bst_region none = {.kind = BST_REGION_NONE};
    bst_control_config config = defaults();
    config.search_pattern = BST_SEARCH_BELT;
    assert_int_equal(rig_try(&r, &config, &none), BST_ERR_CONFIG);
    assert_non_null(strstr(r.ctx.message, "search_pattern"));
    rig_close(&r);
    config = defaults();
    config.strategy = BST_CONTROL_SCAN;
    assert_int_equal(rig_try(&r, &config, &none), BST_ERR_CONFIG);
    assert_non_null(strstr(r.ctx.message, "region"));
    rig_close(&r);
    config = defaults();
    config.strategy = BST_CONTROL_FIXED;
    config.fixed_direction[0] = config.fixed_direction[1] = config.fixed_direction[2] = 0.0;
    assert_int_equal(rig_try(&r, &config, &none), BST_ERR_CONFIG);
    assert_non_null(strstr(r.ctx.message, "fixed_direction"));
    rig_close(&r);
    for (int k = 0; k < 6; k++) { /* either way along one axis alone is a direction */
        double part[3] = {0.0, 0.0, 0.0};
        part[k / 2] = k % 2 ? 1e-3 : -1.0;
        memcpy(config.fixed_direction, part, sizeof part);
        bst_assert_ok(&r.ctx, rig_try(&r, &config, &none));
        rig_close(&r);
    }
}

/* Nothing is commanded while the attitude is unknown; the first one from stars begins the slew, at
 * once with the whole correction. Frames without stars lead back. */
static void nothing_is_commanded_without_an_attitude(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    config.attitude = 1;
    config.lost_after_frames = 3;
    config.lost_hold = false;
    rig_open(&r, &config, BST_REGION_NONE);
    const bst_quat error = bst_quat_from_rotvec((bst_vec3){0.3, 2.0, -1.0});
    int searched = 0;
    for (int64_t t = 0; t < 12000; t += 50) {
        bool frame = t % 1000 == 500;
        bool valid = (t > 3000 && t < 6000) || t > 10000;
        r.tracks->attitude = (bst_attitude_fix){.valid = valid, .tick = t - 400};
        if (valid) {
            bst_quat q = bst_quat_mul(r.q_cam, error);
            bst_vec3 e = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(r.q_cam)));
            r.tracks->attitude.q_cam_from_gcrf = q;
            r.tracks->attitude.error_cam_rad = e;
        }
        step(&r, t, frame);
        /* at 3.5 s found; 6.5, 7.5 and 8.5 s without; at 10.5 s found again */
        bool lost = t < 3500 || (t >= 8500 && t < 10500);
        assert_int_equal(r.status.mode == BST_MODE_LOST, lost);
        assert_int_equal(r.commanded, !lost);
        if (r.commanded && r.status.mode == BST_MODE_SLEW) {
            bool known;
            bst_vec3 cue;
            double s = (double)r.command.tick / TICKS;
            bst_assert_ok(&r.ctx, cue_direction_at(&r, &r.ctx, s, &known, &cue));
            bst_vec3 wanted = bst_quat_rotate(error, cue);
            assert_true(bst_vec3_angle(r.command.direction_gcrf, wanted) < 1e-9); /* rounding */
        }
        if (r.status.mode == BST_MODE_SEARCH && searched++ == 0) {
            /* the places of the search lie along the image's true axes */
            bst_quat q = bst_quat_conj(bst_quat_mul(r.q_cam, error));
            bst_vec3 x = bst_quat_rotate(q, (bst_vec3){1, 0, 0});
            assert_true(bst_vec3_angle(r.control.search_x_gcrf, x) < 1e-6);
        }
    }
    assert_true(searched > 0);
    rig_close(&r);
}

/* While it is lost the boresight is held at rest where the telemetry has it, without the error of
 * attitude that control believed before; where it cannot be held, at a new place. */
static void the_boresight_is_held_while_lost(void **state) {
    (void)state;
    rig r;
    bst_control_config config = defaults();
    config.lost_after_frames = 2;
    config.strategy = BST_CONTROL_FIXED;
    config.fixed_direction[0] = 1.0;
    config.fixed_direction[2] = 0.0;
    rig_open(&r, &config, BST_REGION_NONE);
    bst_vec3 held = {0, 0, 0};
    const bst_vec3 body_rate = {0.0, 0.0, 0.2 * BST_DEG_RAD}; /* rad/s, of a mount that is stuck */
    int lost = 0, places = 0;
    for (int64_t t = 0; t < 20000; t += 50) {
        bool stuck = t >= 8000;
        r.tracks->attitude = (bst_attitude_fix){.valid = t < 3000, .tick = t - 400};
        r.tracks->attitude.q_cam_from_gcrf = r.q_cam;
        r.tracks->attitude.error_cam_rad = (bst_vec3){0.0, 1e-3, 0.0};
        if (stuck) {
            r.commanded = false; /* the rig's gimbal does not follow */
            r.q_cam =
                bst_quat_look(bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(body_rate, 0.05)),
                                              boresight(&r)),
                              r.image_x);
        }
        step(&r, t, t % 1000 == 500);
        if (r.status.mode != BST_MODE_LOST) {
            continue;
        }
        assert_true(r.commanded);
        assert_true(bst_vec3_norm(r.command.rate_gcrf_radps) < 1e-12); /* rounding */
        bool anew = lost++ == 0 || bst_vec3_angle(r.command.direction_gcrf, held) > 1e-9;
        if (anew) { /* where the boresight is */
            assert_true(bst_vec3_angle(r.command.direction_gcrf, boresight(&r)) < 1e-9);
            held = r.command.direction_gcrf;
            places++;
        }
        assert_true(bst_vec3_angle(held, boresight(&r)) < 1.02 * BST_DEG_RAD);
    }
    /* 2.4 degrees in 12 s: it is given up twice */
    assert_true(lost > 200);
    assert_int_equal(places, 3);
    rig_close(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_boresight_is_held_while_lost),
        cmocka_unit_test(a_direction_is_held_among_the_stars),
        cmocka_unit_test(a_direction_is_held_in_the_body),
        cmocka_unit_test(the_scan_goes_to_and_fro),
        cmocka_unit_test(a_region_is_searched_without_gaps),
        cmocka_unit_test(candidates_of_a_region),
        cmocka_unit_test(coasting_follows_the_prediction),
        cmocka_unit_test(a_cue_that_jumps_is_followed),
        cmocka_unit_test(a_cue_that_ends_and_comes_back),
        cmocka_unit_test(the_search_gives_up_when_told_to),
        cmocka_unit_test(nothing_is_commanded_without_an_attitude),
        cmocka_unit_test(what_needs_a_region_is_refused_without),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
