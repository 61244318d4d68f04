/* Control with a gimbal that is at its command at once, for tests of modes without the main loop.
 */
#ifndef BST_TESTS_CONTROL_OPEN_RIG_H
#define BST_TESTS_CONTROL_OPEN_RIG_H

#include <stdlib.h>

#include "control/control.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

#define TICKS 1000
#define RING 3 /* samples of telemetry */
#define PX (3.0 * BST_ARCSEC_RAD)
#define FIELD (1024 * PX)
#define DRIFT (15.0 * BST_ARCSEC_RAD) /* of the region's places, rad/s */

typedef struct rig {
    bst_ctx ctx;
    bst_control control;
    bool cue_valid;
    double cue_jump_rad, jump_s, cue_end_s;
    bst_quat region_turn; /* of the region on the sky */
    bst_tracks *tracks;
    bst_pointing_telemetry *telemetry;
    bst_los_command command;
    bst_control_status status;
    bool commanded;
    bst_quat q_body, q_cam;
    bst_vec3 image_x; /* about which way the image's x axis points */
} rig;

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    (void)ctx;
    const rig *r = user;
    double a = 50.0 * BST_ARCSEC_RAD * seconds + (seconds >= r->jump_s ? r->cue_jump_rad : 0.0);
    *valid = r->cue_valid && seconds < r->cue_end_s;
    *direction = (bst_vec3){cos(a), sin(a), 0.0};
    return BST_OK;
}

static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    bool valid;
    bst_vec3 d;
    BST_TRY(cue_direction_at(user, ctx, seconds, &valid, &d));
    double rate = 50.0 * BST_ARCSEC_RAD;
    *out = (bst_onboard_cue){.valid = valid,
                             .direction_gcrf = d,
                             .rate_gcrf_radps = {-rate * d.y, rate * d.x, 0.0},
                             .sigma_rad = 0.3 * BST_DEG_RAD,
                             .rate_sigma_radps = 0.3 * BST_ARCSEC_RAD,
                             .v_mag = 13.0,
                             .v_mag_sigma = 0.5};
    return BST_OK;
}

/* Along the equator, which drifts eastwards among the stars. */
static bst_status region_at(void *user, bst_ctx *ctx, double seconds, double along_rad,
                            double across_rad, bst_vec3 *direction) {
    (void)ctx;
    const rig *r = user;
    double a = along_rad + (r->control.env.region.kind == BST_REGION_ARC ? 0.0 : DRIFT * seconds);
    bst_vec3 d = {cos(across_rad) * cos(a), cos(across_rad) * sin(a), sin(across_rad)};
    *direction = bst_quat_rotate(r->region_turn, d);
    return BST_OK;
}

/* From the Earth's centre the belt moves as the Earth turns: here by DRIFT about z. */
static bst_status belt_eye_at(void *user, bst_ctx *ctx, double seconds, bool *known,
                              bst_belt_eye *eye) {
    (void)ctx;
    (void)seconds;
    const rig *r = user;
    *known = r->control.env.region.kind != BST_REGION_NONE;
    *eye = (bst_belt_eye){.earth_radps = bst_quat_rotate(r->region_turn, (bst_vec3){0, 0, DRIFT})};
    return BST_OK;
}

static bst_control_config defaults(void) {
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.exposure_s = 0.5;
    config.dwell_frames = 2;
    config.command_latency_s = 0.0;
    return config;
}

static bst_status rig_try(rig *r, const bst_control_config *config, const bst_region *region) {
    r->tracks = calloc(1, sizeof *r->tracks + 4 * sizeof(bst_track));
    r->telemetry = calloc(1, sizeof *r->telemetry + RING * sizeof(bst_pointing_sample));
    assert_true(r->tracks && r->telemetry);
    r->q_body = r->q_cam = BST_QUAT_IDENTITY;
    bst_control_env env = {.tick_rate_hz = TICKS,
                           .pixel_rad = PX,
                           .width_px = 1024,
                           .height_px = 1024,
                           .cue_at = cue_at,
                           .cue_direction_at = cue_direction_at,
                           .region = *region,
                           .region_at = region_at,
                           .belt_eye_at = belt_eye_at,
                           .cue_user = r};
    return bst_control_init(&r->ctx, &r->control, config, &env);
}

static void rig_open(rig *r, const bst_control_config *config, int region) {
    memset(r, 0, sizeof *r);
    r->cue_valid = true;
    r->jump_s = r->cue_end_s = INFINITY;
    r->region_turn = BST_QUAT_IDENTITY;
    r->image_x = (bst_vec3){0, 1, 0};
    bst_assert_ok(&r->ctx, rig_try(r, config,
                                   &(bst_region){.kind = region,
                                                 .half_length_rad = 3.0 * BST_DEG_RAD,
                                                 .half_width_rad = 1.0 * BST_DEG_RAD}));
}

static void rig_close(rig *r) {
    free(r->tracks);
    free(r->telemetry);
}

/* A gimbal that is at its command, at once. */
static void step(rig *r, int64_t tick, bool frame) {
    bst_nav_telemetry nav = {.tick = tick, .sun_m = {1.5e11, 0, 0}};
    if (r->commanded) {
        double dt = (double)(tick - r->command.tick) / TICKS;
        r->q_cam = bst_quat_look(
            bst_vec3_axpy(r->command.direction_gcrf, dt, r->command.rate_gcrf_radps), r->image_x);
    }
    r->telemetry->capacity = RING;
    r->telemetry->settled = true;
    r->telemetry->q_body_from_gcrf = r->q_body;
    r->telemetry->items[r->telemetry->written++ % RING] =
        (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = r->q_cam};
    bst_control_telemetry(&r->control, r->telemetry, &nav);
    r->control.transition_count = 0;
    if (frame) {
        r->tracks->tick = tick - 400;
        bst_assert_ok(&r->ctx, bst_control_observe(&r->ctx, &r->control, tick, r->tracks));
    }
    bst_assert_ok(&r->ctx, bst_control_update(&r->ctx, &r->control, tick, &r->commanded,
                                              &r->command, &r->status));
}

static bst_vec3 boresight(const rig *r) {
    return bst_quat_rotate(bst_quat_conj(r->q_cam), (bst_vec3){0, 0, 1});
}

static void put_target(rig *r, bst_vec3 d, bst_vec3 rate, int hidden) {
    r->tracks->count = 1;
    r->tracks->target_id = 1;
    r->tracks->items[0] = (bst_track){.id = 1,
                                      .status = hidden ? BST_TRACK_COASTING : BST_TRACK_CONFIRMED,
                                      .hits = 9,
                                      .score = 20.0,
                                      .hidden = hidden,
                                      .direction_gcrf = d,
                                      .rate_gcrf_radps = rate};
}

#endif
