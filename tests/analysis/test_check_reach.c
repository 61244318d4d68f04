/* What the check of a cue's reach asks of the mount and says of the answers: the geometry at a time
 * against vectors worked out here, the spans of a scripted search. Linked with wraps of the search
 * itself. */
#include <string.h>

#include "boresight/vec.h"
#include "control/guidance/pointing_feasibility.h"
#include "sim/analysis/check/check_moves.h"
#include "sim/analysis/check/check_reach.h"
#include "sim/cli/load.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

#define SENSOR "/observers/0/sensors/0/"
#define DURATION 3000.0

static struct {
    bst_world *world;
    int searches, chases, moves;
    double middle_s;
    bst_check_mount_moves request;
    double first_slew_rad;
    bst_pointing_feasibility_look seen[2]; /* at 0 s and 700 s */
    bst_mount_status mount;
} now;

const bst_world *__wrap_bst_simulation_world(const bst_simulation *simulation);
const bst_world *__wrap_bst_simulation_world(const bst_simulation *simulation) {
    (void)simulation;
    return now.world;
}

/* The searches in their order, and the answers. */
static const struct {
    double from_s, horizon_s;
    bool wanted, found;
    double when_s;
    bst_pointing_feasibility why;
} script[] = {{0, 3000, false, true, 100, BST_REACH_SUN},
              {100, 2900, true, true, 150, BST_REACH_OK},
              {150, 2850, false, true, 400, BST_REACH_RATE},
              {400, 2600, true, true, 430, BST_REACH_OK},
              {550, 2450, false, true, 551, BST_REACH_SUN},
              {551, 2449, true, true, 552, BST_REACH_OK},
              {553, 2447, false, true, 2990, BST_REACH_BEHIND_EARTH},
              {2990, 10, true, false, 0, BST_REACH_OK}};

bst_status __wrap_bst_pointing_feasibility_next(bst_ctx *ctx,
                                                const bst_pointing_feasibility_problem *problem,
                                                const bst_pointing_feasibility_search *search,
                                                bst_pointing_feasibility_change *out);
bst_status __wrap_bst_pointing_feasibility_next(bst_ctx *ctx,
                                                const bst_pointing_feasibility_problem *problem,
                                                const bst_pointing_feasibility_search *search,
                                                bst_pointing_feasibility_change *out) {
    int k = now.searches++;
    assert_in_range(k, 0, sizeof script / sizeof *script - 1);
    bst_assert_close(search->from_s, script[k].from_s, 1e-9);
    bst_assert_close(search->horizon_s, script[k].horizon_s, 1e-9);
    bst_assert_close(search->step_s, 1e-3 * DURATION, 1e-9);
    assert_int_equal(search->wanted, script[k].wanted);
    *out = (bst_pointing_feasibility_change){script[k].found, script[k].when_s, script[k].why};
    if (k == 0) {
        bst_assert_close(problem->limit_fraction, 0.7, 0);
        now.mount = *problem->mount;
        for (int i = 0; i < 2; i++) {
            bst_assert_ok(ctx, problem->look(problem->user, ctx, 700.0 * i, &now.seen[i]));
        }
    }
    return BST_OK;
}

bst_status __wrap_bst_pointing_feasibility_at(bst_ctx *ctx,
                                              const bst_pointing_feasibility_problem *problem,
                                              double seconds, bst_pointing_feasibility *out);
bst_status __wrap_bst_pointing_feasibility_at(bst_ctx *ctx,
                                              const bst_pointing_feasibility_problem *problem,
                                              double seconds, bst_pointing_feasibility *out) {
    (void)ctx;
    (void)problem;
    now.middle_s = seconds;
    *out = BST_REACH_KEYHOLE;
    return BST_OK;
}

bst_status __wrap_bst_pointing_feasibility_chase(bst_ctx *ctx,
                                                 const bst_pointing_feasibility_problem *problem,
                                                 const bst_pointing_feasibility_span *span,
                                                 bst_pointing_feasibility_loss *losses, int most,
                                                 int *count);
bst_status __wrap_bst_pointing_feasibility_chase(bst_ctx *ctx,
                                                 const bst_pointing_feasibility_problem *problem,
                                                 const bst_pointing_feasibility_span *span,
                                                 bst_pointing_feasibility_loss *losses, int most,
                                                 int *count) {
    (void)ctx;
    (void)problem;
    now.chases++;
    assert_true(most >= 2);
    /* from 5 s before to 120 s after the time in which limits are exceeded; 8 px of 3 arcsec */
    bst_assert_close(span->from_s, 395.0, 1e-9);
    bst_assert_close(span->until_s, 550.0, 1e-9);
    bst_assert_close(span->tolerance_rad, 24.0 * BST_ARCSEC_RAD, 1e-12);
    losses[0] = (bst_pointing_feasibility_loss){402, 440, 1e-3};
    losses[1] = (bst_pointing_feasibility_loss){530, INFINITY, 1e-3};
    *count = 2;
    return BST_OK;
}

int __wrap_bst_check_moves(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves);
int __wrap_bst_check_moves(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves) {
    (void)ctx;
    assert_string_equal(name, "neossat/telescope");
    now.request = *moves;
    now.moves++;
    return 0;
}

int __wrap_bst_check_first_slew(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves,
                                double angle_rad);
int __wrap_bst_check_first_slew(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves,
                                double angle_rad) {
    (void)ctx;
    (void)name;
    (void)moves;
    now.first_slew_rad = angle_rad;
    return 0;
}

typedef struct said_log {
    int count;
    char lines[8][256];
} said_log;

static void take(void *user, bst_log_level level, const char *message) {
    said_log *l = user;
    (void)level;
    if (l->count < 8) {
        snprintf(l->lines[l->count], sizeof l->lines[0], "%s", message);
    }
    l->count++;
}

/* The geometry of the check at a time, from the world's orbits. */
static void expect_geometry(double seconds, const bst_pointing_feasibility_look *seen) {
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_world_state eye;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, now.world, &view));
    bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, seconds, &eye));
    bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, seconds, &bodies));
    assert_true(seen->valid);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(seen->position_m, eye.position_m)), 0.0, 1e-3);
    /* the cue is the object; it has moved by 1.5 m/s x 0.12 s of light time in between, 300 m */
    bst_world_state object;
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, seconds, &object));
    bst_vec3 line = bst_vec3_sub(object.position_m, eye.position_m);
    double range = bst_vec3_norm(line);
    bst_assert_close(seen->range_m, range, 2e3);
    /* where the light left, and aberration to first order, of 1e-4 rad */
    double delay_s = range / 299792458.0;
    bst_vec3 earth = bodies.earth_bary_mps;
    line = bst_vec3_axpy(line, -delay_s, bst_vec3_add(object.velocity_mps, earth));
    bst_vec3 wanted = bst_vec3_unit(bst_vec3_axpy(bst_vec3_unit(line), 1.0 / 299792458.0,
                                                  bst_vec3_add(earth, eye.velocity_mps)));
    assert_true(bst_vec3_angle(seen->direction_gcrf, wanted) < 3e-7);
    /* the axis points to nadir, the second one along the velocity, then 30 degrees about the axis
     */
    bst_quat q = bst_quat_conj(seen->q_body_from_gcrf);
    bst_vec3 down = bst_vec3_unit(bst_vec3_scale(eye.position_m, -1.0));
    bst_vec3 axis = bst_quat_rotate(q, bst_vec3_unit((bst_vec3){1, 2, -2}));
    bst_vec3 second = bst_quat_rotate(q, bst_vec3_unit((bst_vec3){2, -2, -1}));
    bst_assert_close(bst_vec3_angle(axis, down), 0.0, 1e-9);
    bst_vec3 ahead =
        bst_vec3_unit(bst_vec3_axpy(eye.velocity_mps, -bst_vec3_dot(eye.velocity_mps, down), down));
    bst_assert_close(bst_vec3_dot(second, ahead), cos(30 * BST_DEG_RAD), 1e-9);
    bst_assert_close(bst_vec3_dot(bst_vec3_cross(ahead, second), down), sin(30 * BST_DEG_RAD),
                     1e-9);
    /* cones about Sun and Moon as seen from the spacecraft */
    assert_int_equal(seen->zone_count, 2);
    for (int i = 0; i < 2; i++) {
        const bst_keep_out_zone *z = &seen->zones[i];
        bool moon = z->kind == BST_ZONE_MOON;
        bst_vec3 place = moon ? bodies.moon_m : bodies.sun_m;
        bst_assert_close(
            bst_vec3_angle(z->axis, bst_vec3_unit(bst_vec3_sub(place, eye.position_m))), 0.0, 1e-7);
        bst_assert_close(z->half_angle_rad, (moon ? 12 : 25) * BST_DEG_RAD, 1e-12);
    }
    bst_world_view_free(view);
}

/* The check of the scenario with these settings besides those that all cases have. */
static void check(const char *const *own, int count, said_log *said) {
    static const char *const sets[] = {
        "/duration_s=3000",
        "/world/star_catalogue=embedded",
        SENSOR "camera/width_px=900",
        SENSOR "camera/height_px=500",
        SENSOR "cue/offset_deg=0",
        SENSOR "cue/sigma_deg=0.3",
        SENSOR
        "modules/control/guidance={\"limit_fraction\": 0.7, \"loss_tolerance_px\": 8, "
        "\"sun_keep_out_deg\": 25, \"moon_keep_out_deg\": 12}",
        SENSOR
        "modules/gimbal/platform/spacecraft={\"type\": \"rigid_body\", \"attitude\": "
        "{\"law\": \"nadir\", \"roll_deg\": 30, \"axis\": [1, 2, -2], \"second_axis\": [4, "
        "-4, -2]}}"};
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_ctx ctx;
    bst_ctx_init(&ctx, take, said, BST_LOG_WARNING);
    bst_json *json;
    bst_scenario scenario;
    memset(&now, 0, sizeof now);
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    for (int i = 0; i < count; i++) {
        load.set.items[load.set.count++] = own[i];
    }
    bst_assert_ok(
        &ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_track.json", &load, &json, &scenario));
    bst_assert_ok(&ctx, bst_world_create(&ctx, scenario.file, &scenario.world, &scenario.observers,
                                         scenario.base_dir, scenario.epoch, &now.world));
    said->count = 0;
    bst_assert_ok(&ctx, bst_check_reach(&ctx, &scenario, NULL));
    assert_int_equal(now.searches, sizeof script / sizeof *script);
    assert_int_equal(now.chases, 1);
    bst_assert_close(now.middle_s, 415.0, 1e-9);
    for (int i = 0; i < 2; i++) {
        expect_geometry(700.0 * i, &now.seen[i]);
    }
    bst_world_free(now.world);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

static void expect_first_slew(bst_vec3 start_at_zero) {
    bst_vec3 target = bst_quat_rotate(now.seen[0].q_body_from_gcrf, now.seen[0].direction_gcrf);
    bst_vec3 start = bst_quat_rotate(now.mount.q_body_from_cam_at_zero, start_at_zero);
    bst_assert_close(now.first_slew_rad, acos(bst_vec3_dot(start, target)), 1e-9);
    assert_true(now.first_slew_rad > 0.1);
}

static void two_axes(void **state) {
    (void)state;
    static const char *const sets[] = {SENSOR "modules/gimbal/rate_limit_degps=1.5"};
    said_log said;
    check(sets, 1, &said);
    assert_int_equal(said.count, 3);
    assert_string_equal(said.lines[0],
                        "neossat/telescope: the cue is out of reach from 2990.0 s until the end of "
                        "the run: behind the Earth");
    assert_string_equal(said.lines[1],
                        "neossat/telescope: the cue is out of reach from 100.0 s until 150.0 s: in "
                        "the keep-out cone of the Sun (the first of 2 times, 51 s in all)");
    assert_non_null(strstr(said.lines[2], "from 402.0 s until 440.0 s: "));
    assert_non_null(strstr(said.lines[2], "(the first of 2 times, 58 s in all)"));
    assert_int_equal(now.moves, 1);
    bst_assert_close(now.request.period_s, 1.0, 1e-12);
    bst_assert_close(now.request.exposure_s, 0.5, 1e-12);
    bst_assert_close(now.request.width_rad, 2700 * BST_ARCSEC_RAD, 1e-12);
    bst_assert_close(now.request.height_rad, 1500 * BST_ARCSEC_RAD, 1e-12);
    bst_assert_close(now.request.cue_sigma_rad, 0.3 * BST_DEG_RAD, 1e-12);
    bst_assert_close(now.request.duration_s, 3000.0, 0);
    assert_int_equal(now.mount.axes, 2);
    bst_assert_close(now.mount.axis[0].rate_limit_radps, 1.5 * BST_DEG_RAD, 1e-12);
    expect_first_slew((bst_vec3){0, 0, 1});
}

/* The outer axis is y, the inner one x. */
static void a_chain_of_joints(void **state) {
    (void)state;
    static const char *const sets[] = {SENSOR "modules/gimbal/type=cross_elevation",
                                       SENSOR "modules/gimbal/start_deg=[20, -35, 0]"};
    said_log said;
    check(sets, 2, &said);
    double a = 20 * BST_DEG_RAD, b = -35 * BST_DEG_RAD;
    expect_first_slew((bst_vec3){cos(b) * sin(a), -sin(b), cos(b) * cos(a)});
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_axes),
        cmocka_unit_test(a_chain_of_joints),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
