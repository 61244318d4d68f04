/* Mode logic and commands, message by message. */
#include <stdlib.h>

#include "control/control.h"
#include "sim/astro/bodies.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

#define TICKS 1000
#define RING 3 /* samples of telemetry */
#define PX (3.0 * BST_ARCSEC_RAD)

/* A cue that moves along a great circle at 50 arcsec/s. */
static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    (void)ctx;
    double rate = 50.0 * BST_ARCSEC_RAD, a = rate * seconds;
    *out = (bst_onboard_cue){.valid = *(bool *)user,
                             .direction_gcrf = {cos(a), sin(a), 0.0},
                             .rate_gcrf_radps = {-rate * sin(a), rate * cos(a), 0.0},
                             .sigma_rad = 0.3 * BST_DEG_RAD,
                             .rate_sigma_radps = 0.3 * BST_ARCSEC_RAD};
    return BST_OK;
}

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    bst_onboard_cue cue;
    BST_TRY(cue_at(user, ctx, seconds, &cue));
    *valid = cue.valid;
    *direction = cue.direction_gcrf;
    return BST_OK;
}

typedef struct rig {
    bst_ctx ctx;
    bst_control control;
    bool cue_valid;
    bst_tracks *tracks;
    bst_pointing_telemetry *telemetry;
    bst_los_command command;
    bst_control_status status;
    bool commanded;
} rig;

static void rig_open(rig *r, bst_control_config *config_or_null, bool cue_valid) {
    memset(r, 0, sizeof *r);
    bst_control_config config;
    bst_assert_ok(&r->ctx, bst_config_defaults(&r->ctx, bst_control_config_table, &config));
    config.exposure_s = 0.5;
    config.dwell_frames = 3; /* what the steps of these tests count on */
    if (config_or_null) {
        config = *config_or_null;
    }
    r->cue_valid = cue_valid;
    bst_control_env env = {.tick_rate_hz = TICKS,
                           .pixel_rad = PX,
                           .width_px = 1024,
                           .height_px = 1024,
                           .cue_at = cue_at,
                           .cue_direction_at = cue_direction_at,
                           .cue_user = &r->cue_valid};
    bst_assert_ok(&r->ctx, bst_control_init(&r->ctx, &r->control, &config, &env));
    r->tracks = calloc(1, sizeof *r->tracks + 4 * sizeof(bst_track));
    r->telemetry = calloc(1, sizeof *r->telemetry + RING * sizeof(bst_pointing_sample));
    assert_true(r->tracks && r->telemetry);
}

static void rig_close(rig *r) {
    free(r->tracks);
    free(r->telemetry);
}

/* A gimbal that is at its command, at once. */
static void step(rig *r, int64_t tick, bool frame) {
    bst_nav_telemetry nav = {.tick = tick, .sun_m = {1.5e11, 0, 0}};
    bst_vec3 d = {0, 0, 1};
    if (r->commanded) {
        d = bst_vec3_unit(bst_vec3_axpy(r->command.direction_gcrf,
                                        (double)(tick - r->command.tick) / TICKS,
                                        r->command.rate_gcrf_radps));
    }
    r->telemetry->capacity = RING;
    r->telemetry->settled = true;
    r->telemetry->items[r->telemetry->written++ % RING] = (bst_pointing_sample){
        .tick = tick, .q_cam_from_gcrf = bst_quat_look(d, (bst_vec3){0, 1, 0})};
    bst_control_telemetry(&r->control, r->telemetry, &nav);
    r->control.transition_count = 0;
    if (frame) {
        r->tracks->tick = tick - 400;
        bst_assert_ok(&r->ctx, bst_control_observe(&r->ctx, &r->control, tick, r->tracks));
    }
    bst_assert_ok(&r->ctx, bst_control_update(&r->ctx, &r->control, tick, &r->commanded,
                                              &r->command, &r->status));
}

static void put_track(rig *r, int64_t id, int hits, double off_px, double rate_off_arcsec,
                      int64_t mid_tick) {
    bst_onboard_cue cue;
    bst_assert_ok(&r->ctx, cue_at(&(bool){true}, &r->ctx, (double)mid_tick / TICKS, &cue));
    bst_track *t = &r->tracks->items[r->tracks->count++];
    *t = (bst_track){.id = id, .hits = hits, .score = 20.0};
    t->direction_gcrf =
        bst_vec3_unit(bst_vec3_axpy(cue.direction_gcrf, off_px * PX, (bst_vec3){0, 0, 1}));
    t->rate_gcrf_radps =
        bst_vec3_axpy(cue.rate_gcrf_radps, rate_off_arcsec * BST_ARCSEC_RAD, (bst_vec3){0, 0, 1});
    t->covariance[2][2] = t->covariance[3][3] = 0.1 * BST_ARCSEC_RAD * 0.1 * BST_ARCSEC_RAD;
}

/* A cue with this acceleration, rad/s^2. */
static bst_status turning_cue(void *user, bst_ctx *ctx, double seconds, bool *valid,
                              bst_vec3 *direction) {
    (void)ctx;
    double a = 0.5 * *(double *)user * seconds * seconds;
    *valid = true;
    *direction = (bst_vec3){cos(a), sin(a), 0.0};
    return BST_OK;
}

static bst_status turning_cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    *out = (bst_onboard_cue){.sigma_rad = 0.3 * BST_DEG_RAD};
    return turning_cue(user, ctx, seconds, &out->valid, &out->direction_gcrf);
}

/* A cue has jumped if it is farther from where its last two places led than 2e-2 rad/s^2 of
 * acceleration explain, at steps of t and s seconds 2e-2 t (t + s); a steady acceleration a is off
 * by a t (t + s) / 2. */
static void jumps_of_the_cue(void **state) {
    (void)state;
    static const int64_t steps[][2] = {{100, 100}, {100, 400}, {400, 100}, {1000, 1000}};
    for (size_t k = 0; k < sizeof steps / sizeof *steps; k++) {
        for (int beyond = 0; beyond < 2; beyond++) {
            rig r;
            rig_open(&r, NULL, true);
            double t = (double)steps[k][1] / TICKS, s = (double)steps[k][0] / TICKS;
            double most = r.control.config.arrival_tolerance_px * PX + 2e-2 * t * (t + s);
            double accel = (beyond ? 1.05 : 0.95) * 2.0 * most / (t * (t + s));
            r.control.env.cue_at = turning_cue_at;
            r.control.env.cue_direction_at = turning_cue;
            r.control.env.cue_user = &accel;
            step(&r, 0, false);
            step(&r, steps[k][0], false);
            int64_t jumped = r.control.watch.jump_tick;
            step(&r, steps[k][0] + steps[k][1], false);
            assert_int_equal(r.control.watch.jump_tick != jumped, beyond);
            rig_close(&r);
        }
    }
}

static void from_idle_to_track_and_back(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, true);
    int64_t t = 0;
    step(&r, t, false);
    assert_int_equal(r.status.mode, BST_MODE_SLEW);
    assert_true(r.commanded);
    step(&r, t += 50, false);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    assert_int_equal(r.status.search_step, 0);
    /* three frames at rest, the first of them exposed before the arrival: not counted */
    step(&r, t = 500, true); /* mid-exposure at 100, start at -150 */
    for (int k = 1; k <= 2; k++) {
        step(&r, t = 500 + 1000 * k, true);
        assert_int_equal(r.status.search_step, 0);
    }
    step(&r, t = 3500, true);
    assert_int_equal(r.status.search_step, 1);

    /* a tentative track that stands still among the stars is no candidate, nor is a single hit, nor
     * two that chance may have brought together */
    put_track(&r, 1, 5, 900.0, -50.0, 4100);
    put_track(&r, 2, 1, 900.0, 0.0, 4100);
    put_track(&r, 3, 2, 900.0, 0.0, 4100);
    r.tracks->items[2].score = 5.0;
    step(&r, t = 4500, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->count = 0;
    put_track(&r, 2, 2, 900.0, 0.5, 5100);
    step(&r, t = 5500, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    assert_int_equal(r.control.transition_count, 1);
    /* confirmed, and centred: the frame's attitude (believed, no fix) has it on the boresight */
    r.tracks->count = 0;
    put_track(&r, 2, 3, 900.0, 0.5, 6100);
    r.tracks->target_id = 2;
    step(&r, t = 6500, true);
    bst_los_command before = r.command;
    step(&r, t = 6550, false);
    /* between frames the command is one smooth line */
    bst_vec3 was = bst_vec3_unit(bst_vec3_axpy(before.direction_gcrf,
                                               (double)(r.command.tick - before.tick) / TICKS,
                                               before.rate_gcrf_radps));
    assert_true(bst_vec3_angle(was, r.command.direction_gcrf) < 1e-9);
    r.tracks->count = 0;
    put_track(&r, 2, 4, 900.0, 0.0, 7100);
    step(&r, t = 7500, true);
    assert_int_equal(r.status.mode, BST_MODE_TRACK);
    assert_int_equal(r.status.target_id, 2);
    /* lost: awaited where it should be, then searched about there, then about the cue */
    r.tracks->count = 0;
    r.tracks->target_id = 0;
    step(&r, t = 8500, true);
    assert_int_equal(r.status.mode, BST_MODE_REACQUIRE);
    bst_los_command waiting = r.command;
    for (int k = 0; k < 15; k++) {
        step(&r, t += 1000, true);
        assert_int_equal(r.status.search_step, 0);
    }
    was = bst_vec3_axpy(waiting.direction_gcrf, 15.0, waiting.rate_gcrf_radps);
    /* 15 s on: the chord of a straight line against the arc */
    assert_true(bst_vec3_angle(was, r.command.direction_gcrf) < 2.0 * PX);
    int greatest = 0;
    for (int k = 0; k < 80 && r.status.mode == BST_MODE_REACQUIRE; k++) {
        step(&r, t += 1000, true);
        greatest = r.status.search_step > greatest ? r.status.search_step : greatest;
    }
    assert_int_equal(greatest, 8);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    rig_close(&r);
}

/* Frames whose stars contradict each other show no target: the search waits for better ones. A
 * track whose rate is so uncertain that it might stand still is no candidate. */
static void wasted_frames_and_vague_tracks(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, true);
    step(&r, 0, false);
    step(&r, 50, false);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->attitude.stars = 20;
    for (int k = 1; k <= 6; k++) {
        step(&r, 500 + 1000 * k, true);
        assert_int_equal(r.status.search_step, 0);
    }
    put_track(&r, 1, 2, 100, 0.0, 7500 - 400);
    r.tracks->items[0].covariance[2][2] = r.tracks->items[0].covariance[3][3] =
        13.0 * BST_ARCSEC_RAD * 13.0 * BST_ARCSEC_RAD; /* four sigma are 52 of 50 arcsec/s */
    step(&r, 7500, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->items[0].covariance[2][2] = r.tracks->items[0].covariance[3][3] =
        11.0 * BST_ARCSEC_RAD * 11.0 * BST_ARCSEC_RAD;
    step(&r, 8500, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    rig_close(&r);
}

static void a_candidate_that_dies_or_stalls_is_given_up(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, true);
    step(&r, 0, false);
    step(&r, 50, false);
    put_track(&r, 7, 2, 100.0, 0.0, 1100);
    step(&r, 1500, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    int64_t t = 1500;
    for (int k = 0; k < 19; k++) {
        t += 1000;
        r.tracks->count = 0;
        put_track(&r, 7, 2, 100.0, 0.0, t - 400);
        step(&r, t, true);
        assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    }
    step(&r, t += 1050, false);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    /* and is not taken again; another one is, and is awaited when it dies, as it may flash */
    step(&r, t += 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    r.tracks->count = 0;
    put_track(&r, 8, 2, 100.0, 0.0, t + 600);
    step(&r, t += 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    r.tracks->count = 0;
    for (int k = 0; k < 10; k++) {
        step(&r, t += 1000, true);
        assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    }
    /* its light comes back as a new track, which has the rest of its time */
    for (int k = 0; k < 9; k++) {
        r.tracks->count = 0;
        put_track(&r, 9, 2, 150.0, 0.0, t + 600);
        step(&r, t += 1000, true);
        assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    }
    assert_int_equal(r.control.held.id, 9);
    step(&r, t += 2050, false);
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    rig_close(&r);
}

/* Puts a track of an object that left the cue's place at time 0, by so many arcsec/s. */
static void put_leaving(rig *r, int64_t id, int hits, double arcsec_per_s, int64_t mid_tick) {
    const double off_rad = arcsec_per_s * BST_ARCSEC_RAD * (double)mid_tick / TICKS;
    put_track(r, id, hits, off_rad / PX, arcsec_per_s, mid_tick);
}

/* A candidate for a lost target that flashes out is awaited with the rate that was lost, which is
 * not the cue's. */
static void a_lost_target_that_flashes_comes_back_by_its_own_rate(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, true);
    step(&r, 0, false);
    int64_t t = 500;
    const double own = 10.0;
    for (int k = 0; k < 12; k++) {
        r.tracks->count = 0;
        put_leaving(&r, 2, 3 + k, own, t + 600);
        r.tracks->target_id = 2;
        step(&r, t += 1000, true);
    }
    assert_int_equal(r.status.mode, BST_MODE_TRACK);
    r.tracks->count = 0;
    r.tracks->target_id = 0;
    step(&r, t += 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_REACQUIRE);
    put_leaving(&r, 5, 3, own, t + 600);
    step(&r, t += 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    /* it goes out; a track that moves as the cue said is another object */
    r.tracks->count = 0;
    put_leaving(&r, 6, 3, 0.0, t + 600);
    step(&r, t += 1000, true);
    assert_int_equal(r.control.held.id, 5);
    put_leaving(&r, 7, 3, own, t + 600);
    step(&r, t += 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    assert_int_equal(r.control.held.id, 7);
    rig_close(&r);
}

static void without_frames_the_search_still_goes_on(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, true);
    for (int64_t t = 0; t <= 31000; t += 50) {
        step(&r, t, false);
    }
    assert_int_equal(r.status.mode, BST_MODE_SEARCH);
    assert_int_equal(r.status.search_step, 1);
    rig_close(&r);
}

static void open_loop_strategies(void **state) {
    (void)state;
    rig r;
    bst_control_config config;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.strategy = BST_CONTROL_STARE;
    config.stare_time_s = 100.0;
    rig_open(&r, &config, true);
    bst_onboard_cue cue;
    bst_assert_ok(&ctx, cue_at(&r.cue_valid, &ctx, 100.0, &cue));
    for (int64_t t = 0; t < 5000; t += 500) {
        step(&r, t, false);
        assert_int_equal(r.status.mode, BST_MODE_STARE);
        /* no velocity in this rig's telemetry: apparent is geometric but for rounding */
        assert_true(bst_vec3_angle(r.command.direction_gcrf, cue.direction_gcrf) < 1e-12);
        assert_true(bst_vec3_norm(r.command.rate_gcrf_radps) < 1e-12);
    }
    rig_close(&r);

    config.strategy = BST_CONTROL_RATE;
    rig_open(&r, &config, true);
    put_track(&r, 3, 9, 0.0, 0.0, 0);
    r.tracks->target_id = 3; /* what is seen does not matter */
    for (int64_t t = 0; t < 5000; t += 500) {
        step(&r, t, t > 0);
        assert_int_equal(r.status.mode, BST_MODE_RATE);
        bst_assert_ok(&ctx, cue_at(&r.cue_valid, &ctx, (double)r.command.tick / TICKS, &cue));
        assert_true(bst_vec3_angle(r.command.direction_gcrf, cue.direction_gcrf) < 1e-12);
        /* central difference over half a second of an arc at 2.4e-4 rad/s: (w h)^2 / 6 of w */
        assert_true(bst_vec3_norm(bst_vec3_sub(r.command.rate_gcrf_radps, cue.rate_gcrf_radps)) <
                    1e-12);
    }
    rig_close(&r);
}

static void command_carries_the_aberration_of_the_observer(void **state) {
    (void)state;
    rig r;
    bst_control_config config;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.strategy = BST_CONTROL_STARE;
    rig_open(&r, &config, true);
    bst_nav_telemetry nav = {.sun_m = {1.5e11, 0, 0}, .velocity_bary_mps = {0, 0, 30000.0}};
    bst_control_telemetry(&r.control, NULL, &nav);
    bst_assert_ok(&ctx,
                  bst_control_update(&ctx, &r.control, 0, &r.commanded, &r.command, &r.status));
    assert_true(r.commanded);
    /* classical aberration v / c towards the motion; relativity changes it by (v/c)^2 = 1e-8 */
    bst_assert_close(r.command.direction_gcrf.z, 30000.0 / BST_LIGHT_SPEED_MPS, 2e-8);
    rig_close(&r);

    /* a second after telemetry at rest at 7000 km, the observer falls at 8.1 m/s */
    rig_open(&r, &config, true);
    nav = (bst_nav_telemetry){
        .tick = -TICKS, .position_gcrf_m = {0, 0, 7e6}, .sun_m = {1.5e11, 0, 0}};
    bst_control_telemetry(&r.control, NULL, &nav);
    bst_assert_ok(&ctx,
                  bst_control_update(&ctx, &r.control, 0, &r.commanded, &r.command, &r.status));
    assert_true(r.commanded);
    double since_s = 1.0 + (double)r.command.tick / TICKS;
    bst_assert_close(r.command.direction_gcrf.z,
                     -since_s * BST_EARTH_MU_M3PS2 / (7e6 * 7e6) / BST_LIGHT_SPEED_MPS, 1e-10);
    rig_close(&r);
}

static void no_cue_no_command_but_a_named_target_is_followed(void **state) {
    (void)state;
    rig r;
    rig_open(&r, NULL, false);
    step(&r, 0, false);
    assert_int_equal(r.status.mode, BST_MODE_IDLE);
    assert_false(r.commanded);
    put_track(&r, 3, 5, 1.0, 0.0, 600);
    step(&r, 1000, true);
    assert_int_equal(r.status.mode, BST_MODE_IDLE);
    r.tracks->target_id = 3;
    step(&r, 2000, true);
    assert_int_equal(r.status.mode, BST_MODE_ACQUIRE);
    assert_true(r.commanded);
    rig_close(&r);
}

/* How far a search reaches: sigmas of the cue up to a limit, and its own extent after a loss; a
 * tile of 1024 px covers 0.427 degrees on each side of its middle. */
static void the_extent_of_a_search(void **state) {
    (void)state;
    static const struct {
        double sigmas, most_deg, extent_deg;
    } cases[] = {{4, 10, 1.2}, {4, 0.9, 0.9}, {8, 2.1, 2.1}};
    for (int i = 0; i < 3; i++) {
        rig r;
        bst_ctx ctx = {0};
        bst_control_config config;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
        config.search_sigmas = cases[i].sigmas;
        config.search_max_deg = cases[i].most_deg;
        config.search_step = 1.0;
        rig_open(&r, &config, true);
        const bst_control_env *env = &r.control.env;
        bst_assert_close(env->pixel_rad, PX, 0);
        step(&r, 0, false);
        step(&r, 1000, true);
        double field_deg = 2 * atan(512 * PX) / BST_DEG_RAD;
        double side = ceil(2 * cases[i].extent_deg / field_deg - 1e-9);
        assert_int_equal(r.control.search.count, side * side);
        rig_close(&r);
    }
    rig r; /* the observer of the pointing error begins with what is known then */
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.attitude_sigma_arcsec = 17;
    config.drift_sigma_arcsec_per_s = 2.5;
    config.fix_sigma_floor_px = 0.04;
    rig_open(&r, &config, true);
    bst_assert_close(r.control.pointing_error.initial_sigma_rad, 17 * BST_ARCSEC_RAD, 1e-15);
    bst_assert_close(r.control.pointing_error.initial_rate_sigma_radps, 2.5 * BST_ARCSEC_RAD,
                     1e-15);
    bst_assert_close(r.control.pointing_error.sigma_floor_rad, 0.04 * PX, 1e-15);
    rig_close(&r);
}

static void contradictory_settings_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.exposure_s = 2.0;
    config.period_s = 1.0;
    bst_control control;
    bst_control_env env = {.tick_rate_hz = TICKS, .pixel_rad = PX, .cue_at = cue_at};
    assert_int_equal(bst_control_init(&ctx, &control, &config, &env), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "exposure_s: 2 s is longer than period_s of 1 s"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(from_idle_to_track_and_back),
        cmocka_unit_test(jumps_of_the_cue),
        cmocka_unit_test(wasted_frames_and_vague_tracks),
        cmocka_unit_test(a_candidate_that_dies_or_stalls_is_given_up),
        cmocka_unit_test(without_frames_the_search_still_goes_on),
        cmocka_unit_test(a_lost_target_that_flashes_comes_back_by_its_own_rate),
        cmocka_unit_test(open_loop_strategies),
        cmocka_unit_test(command_carries_the_aberration_of_the_observer),
        cmocka_unit_test(no_cue_no_command_but_a_named_target_is_followed),
        cmocka_unit_test(the_extent_of_a_search),
        cmocka_unit_test(contradictory_settings_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
