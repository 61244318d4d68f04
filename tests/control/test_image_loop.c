/* The correction by image error in a loop without dynamics: the camera points at once where it is
 * commanded, wrong by a rotation that the loop has to find. */
#include "boresight/rng.h"
#include "control/loop/image_loop.h"
#include "control/loop/tracking_loop.h"
#include "tests/test_support.h"

#define TICKS 1000 /* a second */
enum { COMMAND_TICKS = 50, WAY = 64 };

typedef struct scene {
    double bias_rad, drift_radps; /* of telemetry about a fixed axis */
    double drop_share;            /* of frames that give no attitude */
    double missing_share;         /* of frames that never come */
    int64_t frame_ticks, exposure_ticks, latency_ticks, command_ticks;
    int64_t jump_at; /* the aim turns away by jump_rad from then on */
    double jump_rad; /* and is reached slew_ticks later */
    int64_t slew_ticks;
    double aim_radps;
    double output_limit;
} scene;

typedef struct result {
    double last_rad, worst_after_rad; /* error at the end; worst in the last half */
    double worst_kick_rad;            /* change of the correction in the second after the jump */
    int used;
} result;

static scene defaults(void) {
    return (scene){.bias_rad = 1e-4,
                   .frame_ticks = 100,
                   .exposure_ticks = 50,
                   .latency_ticks = 90,
                   .command_ticks = 10,
                   .jump_at = INT64_MAX,
                   .aim_radps = 1e-3};
}

static bst_vec3 aim_at(const scene *s, int64_t tick) {
    double angle = s->aim_radps * (double)tick / TICKS + (tick >= s->jump_at ? s->jump_rad : 0.0);
    return (bst_vec3){sin(angle), 0.0, cos(angle)};
}

static bst_quat wrong_at(const scene *s, int64_t tick) {
    double angle = s->bias_rad + s->drift_radps * (double)tick / TICKS;
    return bst_quat_from_rotvec(bst_vec3_scale((bst_vec3){0.6, 0.64, 0.48}, angle));
}

static bst_image_loop loop;

static result run(const scene *s, const bst_compensator_config *law, double seconds) {
    bst_ctx ctx = {0};
    result r = {0};
    bst_compensator_config config = *law;
    config.output_limit = s->output_limit;
    bst_image_loop_env env = {.tick_rate_hz = TICKS,
                              .frame_period_s = (double)s->frame_ticks / TICKS,
                              .frame_exposure_s = (double)s->exposure_ticks / TICKS,
                              .frame_latency_s = (double)s->latency_ticks / TICKS,
                              .command_latency_s = (double)s->command_ticks / TICKS,
                              .jump_rad = 5e-4};
    bst_assert_ok(&ctx, bst_image_loop_init(&ctx, &loop, &config, &env));
    bst_pointing_error correction;
    bst_pointing_error_init(&correction, 1e-6, 0.05, 1e-7, 1e-3, 1e-4);
    bst_rng_key key = bst_rng_make_key(3, 0, "image loop", "frames");
    int64_t total = (int64_t)(seconds * TICKS);
    bst_vec3 pointed[WAY] = {{0, 0, 0}}; /* at the middles of the latest exposures */
    bool at_jump = false;
    bst_vec3 before = {0, 0, 0};
    for (int64_t tick = 0; tick < total; tick++) {
        /* the command of now, as the gimbal extrapolates it */
        bst_quat c = bst_pointing_error_at(&correction, tick, TICKS);
        bst_vec3 commanded = bst_quat_rotate(c, aim_at(s, tick));
        bst_vec3 sight = bst_quat_rotate(bst_quat_conj(wrong_at(s, tick)), commanded);
        double off = bst_vec3_angle(sight, aim_at(s, tick));
        r.last_rad = off;
        r.worst_after_rad = 2 * tick > total ? fmax(r.worst_after_rad, off) : 0.0;
        int64_t middle = s->exposure_ticks / 2;
        int64_t frame = tick / s->frame_ticks;
        if (tick % s->frame_ticks == middle) {
            pointed[frame % WAY] = sight;
        }
        if (tick % COMMAND_TICKS == 0) {
            int64_t at = tick + s->command_ticks, half = TICKS / 4;
            bst_vec3 d[3];
            const int64_t when[3] = {at, at + half, at - half};
            for (int i = 0; i < 3; i++) {
                /* a control that has just changed its aim extrapolates the new one both ways */
                scene now = *s;
                now.jump_at = at >= s->jump_at ? INT64_MIN : INT64_MAX;
                d[i] = bst_quat_rotate(bst_pointing_error_at(&correction, when[i], TICKS),
                                       aim_at(&now, when[i]));
            }
            bool arrived =
                !(tick >= s->jump_at - s->command_ticks && tick < s->jump_at + s->slew_ticks);
            (void)bst_image_loop_commanded(&loop, &correction, at, half, d, arrived, tick);
        }
        int64_t seen = tick - middle - s->exposure_ticks / 2 - s->latency_ticks;
        if (seen >= 0 && seen % s->frame_ticks == 0) {
            int64_t number = seen / s->frame_ticks;
            bool never = bst_rng_uniform(key, (uint64_t)number, 0) < s->missing_share;
            bst_attitude_fix fix = {
                .valid = bst_rng_uniform(key, (uint64_t)number, 1) >= s->drop_share,
                .tick = number * s->frame_ticks + middle,
                .q_cam_from_gcrf = bst_quat_look(pointed[number % WAY], (bst_vec3){0.0, 1.0, 0.0})};
            r.used += !never && bst_image_loop_update(&loop, &correction, tick, &fix);
        }
        bst_vec3 value = bst_quat_to_rotvec(bst_pointing_error_at(&correction, tick, TICKS));
        if (tick >= s->jump_at) {
            before = at_jump ? before : value;
            at_jump = true;
            if (tick < s->jump_at + TICKS) {
                r.worst_kick_rad =
                    fmax(r.worst_kick_rad, bst_vec3_norm(bst_vec3_sub(value, before)));
            }
        }
        assert_true(isfinite(off) && isfinite(value.x + value.y + value.z));
    }
    return r;
}

static const bst_compensator_config pi = {
    .type = BST_COMPENSATOR_PI, .crossover_hz = 0.4, .phase_margin_deg = 50.0, .gain_scale = 1.0};

static void test_bias_and_drift(void **state) {
    (void)state;
    scene s = defaults();
    result r = run(&s, &pi, 60.0);
    /* 24 times the crossover's period: all but rounding of quaternions is gone */
    assert_true(r.worst_after_rad < 1e-9);
    s.drift_radps = 2e-5; /* 4 arcsec/s: pi follows without lag */
    r = run(&s, &pi, 60.0);
    /* what of it lies across the turning sight changes by 2e-8 rad/s^2, over ki of about 2 /s^2 */
    assert_true(r.worst_after_rad < 5e-8);
    /* proportional alone lags by drift / gain */
    bst_compensator_config p = {.type = BST_COMPENSATOR_PI, .proportional = 2.0, .gain_scale = 1.0};
    r = run(&s, &p, 60.0);
    bst_vec3 about = bst_vec3_unit((bst_vec3){0.6, 0.64, 0.48}), z = aim_at(&s, 60 * TICKS);
    double across = bst_vec3_norm(bst_vec3_cross(about, z));
    /* and by what turns across the sight with it: 1.3e-3 rad at 1e-3 rad/s, over the gain */
    bst_assert_close(r.last_rad, 2e-5 / 2.0 * across, 7e-7);
    s.bias_rad = s.drift_radps = s.aim_radps = 0.0; /* nothing to do, no motion at all */
    r = run(&s, &pi, 10.0);
    assert_true(r.worst_after_rad < 1e-12);
}

static void test_late(void **state) {
    (void)state;
    scene s = defaults();
    s.latency_ticks = 330; /* more than three frames */
    s.drift_radps = 2e-5;
    bst_compensator_config slow = pi, fast = pi;
    slow.crossover_hz = 0.2;
    assert_true(run(&s, &slow, 60.0).worst_after_rad < 2e-7); /* ki of about 0.4 /s^2 */
    fast.crossover_hz = 1.0;
    bst_ctx ctx = {0};
    bst_image_loop_env env = {.tick_rate_hz = TICKS,
                              .frame_period_s = 0.1,
                              .frame_exposure_s = 0.05,
                              .frame_latency_s = 0.33,
                              .command_latency_s = 0.01};
    assert_int_equal(bst_image_loop_init(&ctx, &loop, &fast, &env), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "at most"));
    env.frame_period_s = 0.0;
    assert_int_equal(bst_image_loop_init(&ctx, &loop, &pi, &env), BST_ERR_CONFIG);
}

static void test_dropped(void **state) {
    (void)state;
    scene s = defaults();
    s.drift_radps = 2e-5;
    for (int kind = 0; kind < 2; kind++) {
        s.drop_share = kind == 0 ? 0.5 : 0.0;
        s.missing_share = kind == 0 ? 0.0 : 0.5;
        result r = run(&s, &pi, 120.0);
        assert_true(r.used > 400 && r.used < 800);
        /* a rate of 2e-5 found and held: what is left while two or three frames fail is far less
         * than the 2e-6 that the drift alone would do in one */
        assert_true(r.worst_after_rad < 1e-7);
    }
}

/* Long silence: the integrator's rate goes on, the error of the last frame is not acted on again.
 */
static void test_silence(void **state) {
    (void)state;
    scene s = defaults();
    s.drift_radps = 2e-5;
    result r = run(&s, &pi, 60.0);
    assert_true(r.worst_after_rad < 5e-8);
    /* the same loop, its frames stopped: 10 s of drift are 2e-4 without the held rate */
    bst_pointing_error e;
    bst_pointing_error_init(&e, 1e-6, 0.05, 1e-7, 1e-3, 1e-4);
    e.started = true;
    e.tick = 60 * TICKS;
    e.error = wrong_at(&s, e.tick);
    e.rate_gcrf_radps = bst_vec3_scale((bst_vec3){0.6, 0.64, 0.48}, 5e-5); /* with a stale part */
    bst_vec3 d[3] = {aim_at(&s, e.tick), aim_at(&s, e.tick + 250), aim_at(&s, e.tick - 250)};
    for (int i = 0; i < 3; i++) {
        d[i] = bst_quat_rotate(
            bst_pointing_error_at(&e, e.tick + (int64_t[]){0, 250, -250}[i], TICKS), d[i]);
    }
    loop.coasting = false;
    assert_true(bst_image_loop_commanded(&loop, &e, e.tick + 500, 250, d, true, e.tick));
    assert_true(loop.coasting);
    /* the part across the sight is all that frames show */
    bst_vec3 about = {0.6, 0.64, 0.48};
    double across = bst_vec3_norm(bst_vec3_cross(about, aim_at(&s, e.tick)));
    bst_assert_close(bst_vec3_norm(e.rate_gcrf_radps), 2e-5 * across, 1e-6); /* along: 1e-3 rad/s */
}

static void test_saturated(void **state) {
    (void)state;
    scene s = defaults();
    s.bias_rad = 1e-3;
    s.output_limit = 1e-4; /* ten seconds at the limit */
    result r = run(&s, &pi, 60.0);
    assert_true(r.worst_after_rad < 1e-8);
    /* without windup the correction overshoots by no more than an unlimited loop's third */
    s.output_limit = 0.0;
    r = run(&s, &pi, 60.0);
    assert_true(r.worst_after_rad < 1e-8);
}

static void test_bumpless(void **state) {
    (void)state;
    scene s = defaults();
    s.jump_at = 30 * TICKS;
    s.jump_rad = 0.01; /* another mode, another aim */
    s.slew_ticks = 700;
    result r = run(&s, &pi, 60.0);
    /* what was found stays: the jump is the aim's alone (0.01 rad; with the sight the correction
     * turns by 1e-7 rad in a second) */
    assert_true(r.worst_kick_rad < 3e-7);
    assert_true(r.worst_after_rad <
                2e-5); /* the new aim sees more of the rotation about the sight */
    assert_true(r.last_rad < 1e-8);
    s.jump_rad = 2e-4; /* a small one is no slew, and in the command all the same */
    s.slew_ticks = 0;
    r = run(&s, &pi, 60.0);
    assert_true(r.worst_kick_rad < 3e-7);
}

/* One frame by hand, with a proportional law of 2 per second. The aim rests; the frame shows the
 * boresight short of it by a turn of 3e-4 rad about an axis across. The correction turns by twice
 * that rate from the time at which the command acts on; frames that began before the mount was at
 * rest say nothing; and 90 + 25 + 150 ms after the middle of the latest exposure it coasts. */
static void test_one_frame_by_hand(void **state) {
    (void)state;
    const bst_compensator_config law = {
        .type = BST_COMPENSATOR_PI, .proportional = 2.0, .gain_scale = 1.0};
    const bst_image_loop_env env = {.tick_rate_hz = TICKS,
                                    .frame_period_s = 0.1,
                                    .frame_exposure_s = 0.05,
                                    .frame_latency_s = 0.09,
                                    .command_latency_s = 0.01,
                                    .jump_rad = 5e-4};
    const bst_vec3 aim = bst_vec3_unit((bst_vec3){0.3, -0.4, 1.0});
    const bst_vec3 axes[2] = {bst_vec3_unit(bst_vec3_cross(aim, (bst_vec3){1, 0, 0})),
                              bst_vec3_unit(bst_vec3_cross(aim, (bst_vec3){0.2, 1, 0.5}))};
    for (int n = 0; n < 2; n++) {
        bst_ctx ctx = {0};
        bst_pointing_error c;
        bst_assert_ok(&ctx, bst_image_loop_init(&ctx, &loop, &law, &env));
        bst_pointing_error_init(&c, 1e-6, 0.05, 1e-7, 1e-3, 1e-4);
        const bst_vec3 d[3] = {aim, aim, aim};
        for (int64_t tick = 10; tick <= 610; tick += 50) {
            /* seen to have arrived at 60, the first time after the jump of the first command */
            assert_false(bst_image_loop_commanded(&loop, &c, tick, 100, d, true, tick));
        }
        bst_vec3 short_of =
            bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(axes[n], -3e-4)), aim);
        bst_attitude_fix fix = {.valid = true,
                                .tick = 84,
                                .q_cam_from_gcrf = bst_quat_look(short_of, (bst_vec3){0, 1, 0})};
        assert_false(bst_image_loop_update(&loop, &c, 200, &fix)); /* began at 59, moving */
        fix.tick = 500;
        assert_true(bst_image_loop_update(&loop, &c, 640, &fix));
        assert_false(bst_image_loop_update(&loop, &c, 640, &fix)); /* not twice */
        assert_int_equal(c.tick, 650);
        bst_vec3 rate = bst_vec3_scale(axes[n], 2.0 * 3e-4);
        /* rounding of quaternions over 3e-4 */
        bst_assert_close(c.rate_gcrf_radps.x, rate.x, 1e-13);
        bst_assert_close(c.rate_gcrf_radps.y, rate.y, 1e-13);
        bst_assert_close(c.rate_gcrf_radps.z, rate.z, 1e-13);
        bst_vec3 turned = bst_quat_to_rotvec(bst_pointing_error_at(&c, 700, TICKS));
        bst_assert_close(bst_vec3_dot(turned, axes[n]), 0.05 * 6e-4, 1e-13);
        for (int64_t tick = 660; tick <= 860; tick += 5) {
            bst_vec3 commanded[3];
            const int64_t when[3] = {tick, tick + 100, tick - 100};
            for (int i = 0; i < 3; i++) {
                commanded[i] = bst_quat_rotate(bst_pointing_error_at(&c, when[i], TICKS), aim);
            }
            /* commands act 10 ticks later */
            assert_true(bst_image_loop_commanded(&loop, &c, tick, 100, commanded, true,
                                                 tick - 10) == (tick == 780));
        }
        bst_assert_close(bst_vec3_norm(c.rate_gcrf_radps), 0.0, 1e-15); /* no integrator */
        turned = bst_quat_to_rotvec(bst_pointing_error_at(&c, 2000, TICKS));
        bst_assert_close(bst_vec3_dot(turned, axes[n]), 0.13 * 6e-4, 1e-12);
    }
}

/* The compensator crosses over where it shall and with its margin, in a loop whose latencies all
 * differ: half an exposure, that of frames, that of commands, and the servo's lag. */
static void test_designed_for_all_latencies(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_compensator_config config = {.type = BST_COMPENSATOR_PI,
                                           .crossover_hz = 0.11,
                                           .phase_margin_deg = 40.0,
                                           .gain_scale = 1.0};
    const bst_image_loop_env env = {.tick_rate_hz = TICKS,
                                    .frame_period_s = 0.5,
                                    .frame_exposure_s = 0.3,
                                    .frame_latency_s = 0.21,
                                    .command_latency_s = 0.17,
                                    .servo_lag_s = 0.13,
                                    .jump_rad = 5e-4};
    bst_assert_ok(&ctx, bst_image_loop_init(&ctx, &loop, &config, &env));
    /* the command acts 0.15 + 0.21 + 0.17 s after the middle of an exposure, the mount later */
    const bst_tracking_timing timing = {0.5, 0.3, 0.36, 0.53, 0.53};
    const bst_control_servo_response servo = {.delay_s = 0.13};
    bst_tracking_loop *tracking;
    bst_assert_ok(&ctx,
                  bst_tracking_loop_create(&ctx, &timing, &servo, &loop.axis[0], NULL, &tracking));
    const double complex open = bst_tracking_open(tracking, 2.0 * BST_PI * 0.11);
    bst_assert_close(cabs(open), 1.0, 1e-6);
    bst_assert_close(carg(-open) / BST_DEG_RAD, 40.0, 1e-4);
    bst_tracking_loop_free(tracking);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_designed_for_all_latencies),
        cmocka_unit_test(test_one_frame_by_hand),
        cmocka_unit_test(test_bias_and_drift),
        cmocka_unit_test(test_late),
        cmocka_unit_test(test_dropped),
        cmocka_unit_test(test_silence),
        cmocka_unit_test(test_saturated),
        cmocka_unit_test(test_bumpless),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
