/* The standard controller in a sky that is turned as a whole, with a camera that is rolled by a
 * right angle, and with ticks and pixels of another size: it goes through the same modes at the
 * same times and commands the turned directions. An axis that is treated unlike the others, a sign,
 * or a time in wrong units makes a difference. */
#include <stdlib.h>

#include "control/control.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

#define PX (3.0 * BST_ARCSEC_RAD)
#define STEP_S 0.05
#define FRAME_S 1.0
#define LATENCY_S 0.4
#define BARY_MPS ((bst_vec3){1e4, 2.5e4, -7e3})

#define RING 3 /* samples of telemetry */

typedef struct rig {
    bst_ctx ctx;
    bst_control control;
    bst_quat turn, roll; /* of the sky; of the camera about its boresight, by quarters */
    int quarters, hz;    /* right angles of the roll; ticks a second */
    bst_tracks *tracks;
    bst_pointing_telemetry *telemetry;
    bst_los_command command;
    bst_control_status status;
    bool commanded;
    bst_quat q_cam, before[16]; /* by telemetry, now and at steps modulo 16 */
} rig;

/* Direction of the cue without a turn: bent, at 50 arcsec/s. */
static bst_vec3 cue_unturned(double s) {
    double a = 50.0 * BST_ARCSEC_RAD * s, b = 0.3 + 8e-6 * s + 3e-8 * s * s;
    return (bst_vec3){cos(a) * cos(b), sin(a) * cos(b), sin(b)};
}

static bst_vec3 rate_of(bst_vec3 (*path)(double), double s) {
    return bst_vec3_scale(bst_vec3_sub(path(s + 0.01), path(s - 0.01)), 1.0 / 0.02);
}

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    (void)ctx;
    *valid = true;
    *direction = bst_quat_rotate(((rig *)user)->turn, cue_unturned(seconds));
    return BST_OK;
}

static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    (void)ctx;
    const rig *r = user;
    *out = (bst_onboard_cue){
        .valid = true,
        .direction_gcrf = bst_quat_rotate(r->turn, cue_unturned(seconds)),
        .rate_gcrf_radps = bst_quat_rotate(r->turn, rate_of(cue_unturned, seconds)),
        .sigma_rad = 0.3 * BST_DEG_RAD,
        .rate_sigma_radps = 0.3 * BST_ARCSEC_RAD,
        .v_mag = 13.0,
        .v_mag_sigma = 0.5};
    return BST_OK;
}

/* The target, off the cue by 0.4 and 0.25 degrees. */
static bst_vec3 target_unturned(double s) {
    bst_vec3 d = cue_unturned(s);
    bst_vec3 e1 = bst_vec3_unit((bst_vec3){-d.y, d.x, 0.0}), e2 = bst_vec3_cross(d, e1);
    return bst_vec3_unit(
        bst_vec3_axpy(bst_vec3_axpy(d, 0.007 + 1e-7 * s, e1), -0.0045 + 2e-7 * s, e2));
}

static void open_rig(rig *r, const bst_control_config *config, bst_quat turn, int quarters,
                     int hz) {
    memset(r, 0, sizeof *r);
    r->turn = turn;
    r->quarters = quarters;
    r->hz = hz;
    r->roll = bst_quat_from_rotvec((bst_vec3){0, 0, 0.5 * BST_PI * quarters});
    r->tracks = calloc(1, sizeof *r->tracks + 4 * sizeof(bst_track));
    r->telemetry = calloc(1, sizeof *r->telemetry + RING * sizeof(bst_pointing_sample));
    assert_true(r->tracks && r->telemetry);
    bst_control_env env = {.tick_rate_hz = hz,
                           .pixel_rad = PX,
                           /* the same image axes on the sky: they turn in the rolled camera */
                           .rotation_rad = 0.35 + 0.5 * BST_PI * quarters,
                           .width_px = 1024,
                           .height_px = 700,
                           .frame_exposure_s = 0.5,
                           .frame_period_s = FRAME_S,
                           .frame_latency_s = LATENCY_S,
                           .cue_at = cue_at,
                           .cue_direction_at = cue_direction_at,
                           .cue_user = r};
    bst_assert_ok(&r->ctx, bst_control_init(&r->ctx, &r->control, config, &env));
    r->q_cam = bst_quat_mul(
        r->roll,
        bst_quat_mul(bst_quat_look(bst_vec3_unit((bst_vec3){1, 0.1, 0.4}), (bst_vec3){0, 1, 0}),
                     bst_quat_conj(turn)));
}

static void close_rig(rig *r) {
    free(r->tracks);
    free(r->telemetry);
}

/* A gimbal that goes towards its command, and stars that say where the camera is: off the telemetry
 * by a drifting angle about each axis. */
static bst_vec3 camera_error(double s) {
    return (bst_vec3){(6.0 + 0.05 * s) * PX, (-4.0 + 0.02 * s) * PX, 3e-4 - 1e-6 * s};
}

static void step(rig *r, int k) {
    double s = k * STEP_S;
    int64_t tick = llround(s * r->hz);
    bst_nav_telemetry nav = {
        .tick = tick,
        .position_gcrf_m = bst_quat_rotate(r->turn, (bst_vec3){5e6, -3e6, 4e6}),
        .velocity_gcrf_mps = bst_quat_rotate(r->turn, (bst_vec3){3e3, 6e3, -2e3}),
        .velocity_bary_mps = bst_quat_rotate(r->turn, BARY_MPS),
        .sun_m = bst_quat_rotate(r->turn, (bst_vec3){-1.2e11, 5e10, -6e10})};
    if (r->commanded) { /* the roll about the boresight stays what it was */
        bst_vec3 to = bst_vec3_unit(bst_vec3_axpy(r->command.direction_gcrf,
                                                  (double)(tick - r->command.tick) / r->hz,
                                                  r->command.rate_gcrf_radps));
        bst_vec3 from = bst_quat_rotate(bst_quat_conj(r->q_cam), (bst_vec3){0, 0, 1});
        double angle = bst_vec3_angle(from, to);
        if (angle > 0.0) {
            bst_vec3 axis = bst_vec3_scale(bst_vec3_unit(bst_vec3_cross(from, to)), -angle);
            r->q_cam = bst_quat_mul(r->q_cam, bst_quat_from_rotvec(axis));
        }
    }
    r->before[k % 16] = r->q_cam;
    r->telemetry->capacity = RING;
    r->telemetry->settled = true;
    r->telemetry->q_body_from_gcrf = bst_quat_conj(r->turn);
    r->telemetry->items[r->telemetry->written++ % RING] =
        (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = r->q_cam};
    bst_control_telemetry(&r->control, r->telemetry, &nav);
    r->control.transition_count = 0;
    double mid_s = s - LATENCY_S - 0.25;
    if (k % 20 == 13 && mid_s >= 0.0) {
        bst_tracks *t = r->tracks;
        t->tick = llround(mid_s * r->hz);
        bst_quat then = r->before[(k - 13) % 16]; /* LATENCY_S + 0.25 s ago */
        bst_vec3 error = bst_quat_rotate(r->roll, camera_error(mid_s));
        t->attitude =
            (bst_attitude_fix){.valid = k % 260 != 13,
                               .stars = 30,
                               .tick = t->tick,
                               .q_cam_from_gcrf = bst_quat_mul(bst_quat_from_rotvec(error), then),
                               .error_cam_rad = error,
                               .sigma_rad = {0.1 * PX, 0.1 * PX, 2e-5},
                               .rms_px = 0.1};
        t->attitude.sigma_rad[r->quarters % 2] = 0.2 * PX;
        bst_vec3 d = target_unturned(mid_s);
        bst_vec3 seen = bst_quat_rotate(r->turn, d);
        bst_vec3 look = bst_quat_rotate(bst_quat_conj(r->q_cam), (bst_vec3){0, 0, 1});
        bool lost = s > 260.0 && s<290.0, hidden = s> 200.0 && s < 215.0,
             in_field = bst_vec3_angle(look, seen) < 0.006;
        int hits = in_field && !lost ? 9 : 0;
        t->count = hits > 0;
        t->target_id = r->control.held.id && hits ? 1 : 0;
        t->items[0] = (bst_track){
            .id = 1,
            .status = hidden ? BST_TRACK_COASTING : BST_TRACK_CONFIRMED,
            .hidden = hidden ? BST_HIDDEN_SHADOW : BST_HIDDEN_NOT,
            .hits = hits,
            .score = 20.0,
            .v_mag = 13.2,
            .direction_gcrf = seen,
            .rate_gcrf_radps = bst_quat_rotate(r->turn, rate_of(target_unturned, mid_s))};
        for (int i = 0; i < 4; i++) {
            t->items[0].covariance[i][i] = pow((i < 2 ? 0.1 : 0.02) * BST_ARCSEC_RAD, 2);
        }
        bst_assert_ok(&r->ctx, bst_control_observe(&r->ctx, &r->control, tick, t));
    }
    bst_assert_ok(&r->ctx, bst_control_update(&r->ctx, &r->control, tick, &r->commanded,
                                              &r->command, &r->status));
}

static void expect_vec(bst_vec3 found, bst_vec3 expected, double tolerance) {
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(found, expected)), 0.0, tolerance);
}

/* Rounding errors of directions: 1e-15; of rates by differences over some 10 ms: 1e-12. */
static void expect_same(const rig *a, const rig *b) {
    assert_int_equal(b->status.mode, a->status.mode);
    assert_int_equal(b->status.search_step, a->status.search_step);
    assert_int_equal(b->status.target_id, a->status.target_id);
    assert_int_equal(b->commanded, a->commanded);
    if (a->commanded) {
        const bst_los_command *x = &a->command, *y = &b->command;
        bst_quat turn = bst_quat_mul(b->turn, bst_quat_conj(a->turn));
        bst_assert_close((double)y->tick / b->hz, (double)x->tick / a->hz, 1e-9);
        expect_vec(y->direction_gcrf, bst_quat_rotate(turn, x->direction_gcrf), 1e-11);
        expect_vec(y->rate_gcrf_radps, bst_quat_rotate(turn, x->rate_gcrf_radps), 1e-9);
        expect_vec(y->accel_gcrf_radps2, bst_quat_rotate(turn, x->accel_gcrf_radps2), 1e-6);
    }
    /* camera x of the one is y of the other */
    bst_vec3 off = {a->status.aim_error_px[0], a->status.aim_error_px[1], 0.0};
    off = bst_quat_rotate(b->roll, off);
    if (bst_vec3_norm(off) < 1000.0) { /* angles to z, which far off are no vector */
        expect_vec((bst_vec3){b->status.aim_error_px[0], b->status.aim_error_px[1], 0.0}, off,
                   1e-5);
    }
}

/* A run of 330 s with a search, a track, a coast and a loss, as it is, turned and rolled, and
 * rolled by three quarters with finer ticks. */
static void compare(const bst_control_config *config) {
    static rig a, b, c;
    bst_quat turn = bst_quat_from_rotvec((bst_vec3){1.1, -0.7, 2.0});
    unsigned modes = 0;
    double last_px = INFINITY;
    int tracked = 0;
    open_rig(&a, config, BST_QUAT_IDENTITY, 0, 1000);
    open_rig(&b, config, turn, 1, 1000);
    open_rig(&c, config, BST_QUAT_IDENTITY, 3, 6000);
    for (int k = 0; k < 330 * 20; k++) {
        step(&a, k);
        step(&b, k);
        step(&c, k);
        expect_same(&a, &b);
        expect_same(&a, &c);
        modes |= 1u << a.status.mode;
        if (a.status.mode == BST_MODE_TRACK && a.control.mode_tick < (k - 1500) * 50) {
            /* the true boresight is on the apparent target */
            bst_quat q = bst_quat_mul(bst_quat_from_rotvec(camera_error(k * STEP_S)), a.q_cam);
            bst_vec3 d = target_unturned(k * STEP_S), v = BARY_MPS;
            v = bst_quat_rotate(q, bst_vec3_axpy(d, 1.0 / 299792458.0, v)); /* to 4e-9 rad */
            v = bst_vec3_unit(v);
            last_px = hypot(v.x, v.y) / PX;
            tracked++;
        }
    }
    print_message("modes %x, %d steps in track, boresight off by %.4f px in the end\n", modes,
                  tracked, last_px);
    assert_int_equal(modes, 1u << BST_MODE_SLEW | 1u << BST_MODE_SEARCH | 1u << BST_MODE_ACQUIRE |
                                1u << BST_MODE_TRACK | 1u << BST_MODE_REACQUIRE |
                                1u << BST_MODE_COAST);
    assert_true(tracked > 2000);
    bst_assert_close(last_px, 0.0, 0.005); /* the drift is followed without lag */
    close_rig(&a);
    close_rig(&b);
    close_rig(&c);
}

static bst_control_config defaults(void) {
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.exposure_s = 0.5;
    config.dwell_frames = 2;
    config.guidance.acceleration_feed_forward = true;
    return config;
}

static void by_the_observer(void **state) {
    (void)state;
    bst_control_config config = defaults();
    compare(&config);
}

static void by_the_image_error(void **state) {
    (void)state;
    bst_control_config config = defaults();
    config.compensator.type = BST_COMPENSATOR_PID;
    config.compensator.crossover_hz = 0.05;
    compare(&config);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(by_the_observer),
                                       cmocka_unit_test(by_the_image_error)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
