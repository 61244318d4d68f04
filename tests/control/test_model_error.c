/* What a wrong model of the mount's motion does to frames and commands, by hand for a mount that
 * turns evenly. */
#include "control/loop/model_error.h"

#include <stdlib.h>

#include "tests/test_support.h"

enum { TICKS = 1000, CAPACITY = 64, STEP = 5 };

typedef struct mount {
    bst_vec3 aim, axis; /* unit; the axis across the aim */
    double rate_radps;  /* of the boresight from the aim, about the axis */
    bst_pointing_telemetry *telemetry;
} mount;

static bst_quat camera_at(const mount *m, int64_t tick) {
    double angle = m->rate_radps * (double)tick / TICKS;
    bst_vec3 z = bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(m->axis, angle)), m->aim);
    return bst_quat_look(z, (bst_vec3){0, 1, 0});
}

/* Commands every 50 ticks and telemetry of every 5th up to a tick. */
static void go_on(bst_model_error *e, const bst_pointing_error *observer, mount *m, int64_t from,
                  int64_t to) {
    for (int64_t tick = from; tick < to; tick++) {
        if (tick % 50 == 0) {
            bst_vec3 corrected[3];
            const int64_t when[3] = {tick, tick + 100, tick - 100};
            for (int i = 0; i < 3; i++) {
                corrected[i] = bst_quat_rotate(
                    bst_model_error_correction(e, observer, when[i], TICKS), m->aim);
            }
            bst_model_error_commanded(e, observer, tick, 100, corrected);
        }
        if (tick % STEP == 0) {
            bst_pointing_telemetry *t = m->telemetry;
            t->items[t->written++ % t->capacity] =
                (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = camera_at(m, tick)};
            bst_model_error_telemetry(e, t);
        }
    }
}

static mount make_mount(double rate_radps) {
    mount m = {.aim = bst_vec3_unit((bst_vec3){0.5, -0.3, 0.8}), .rate_radps = rate_radps};
    m.axis = bst_vec3_unit(bst_vec3_cross(m.aim, (bst_vec3){0.1, 1.0, 0.4}));
    m.telemetry = calloc(1, sizeof *m.telemetry + CAPACITY * sizeof(bst_pointing_sample));
    assert_non_null(m.telemetry);
    m.telemetry->capacity = CAPACITY;
    m.telemetry->settled = true;
    return m;
}

/* The mount turns by v t. A frame whose middle is at T shows, late by L, what the mount did at T -
 * L, telemetry at T; from the frame at T0 on, where the error sets in, a frame is changed by (real
 * - origin) - (reported - origin) / gain with origin v (T0 - L), which is v (T - T0) - v (T - T0 +
 * L) / gain; exposures average what grows evenly to its middle. */
static void frames_show_more_and_later(void **state) {
    (void)state;
    const double gains[] = {1.3, 1.0, 0.8}, lates[] = {0.04, 0.0313, 0.0};
    /* of the second, neither end is at a sample of telemetry */
    const double exposures_s[] = {0.06, 0.0534, 0.06};
    for (int k = 0; k < 3; k++) {
        const double g = gains[k], late = lates[k], v = 2e-5;
        const bst_model_error_env env = {.gain = g,
                                         .late_s = late,
                                         .exposure_s = exposures_s[k],
                                         .latency_s = 0.05,
                                         .tick_rate_hz = TICKS,
                                         .jump_rad = 1e-3};
        bst_model_error e = {0};
        bst_model_error_init(&e, &env);
        assert_true(e.active);
        const bst_pointing_error observer = {.error = BST_QUAT_IDENTITY};
        mount m = make_mount(v);
        const bst_vec3 shown = {3e-5, -1e-5, 2e-5};
        int64_t begun = -1;
        for (int64_t tick = 0; tick < 6000; tick += 100) {
            go_on(&e, &observer, &m, tick, tick + 100);
            bst_attitude_fix fix = {.valid = true,
                                    .tick = tick,
                                    .q_cam_from_gcrf = camera_at(&m, tick),
                                    .error_cam_rad = shown};
            bst_attitude_fix got = bst_model_error_apply(&e, &observer, &fix);
            begun = begun < 0 && e.begun ? tick : begun;
            double t = (double)(tick - begun) / TICKS;
            double more = begun < 0 ? 0.0 : v * t - v * (t + late) / g;
            bst_vec3 change = bst_quat_rotate(fix.q_cam_from_gcrf, bst_vec3_scale(m.axis, more));
            /* rounding of angles of 1e-4 */
            bst_assert_close(got.error_cam_rad.x, shown.x - change.x, 1e-12);
            bst_assert_close(got.error_cam_rad.y, shown.y - change.y, 1e-12);
            bst_assert_close(got.error_cam_rad.z, shown.z - change.z, 1e-12);
        }
        /* after some thirty attitudes */
        assert_true(begun >= 2800 && begun <= 3300);
        free(m.telemetry);
    }
}

/* The correction that is commanded: the observer's as it was when the error set in, and `gain`
 * times its change since. */
static void commands_turn_by_the_gain(void **state) {
    (void)state;
    const bst_model_error_env env = {.gain = 1.5,
                                     .late_s = 0.0,
                                     .exposure_s = 0.06,
                                     .latency_s = 0.05,
                                     .tick_rate_hz = TICKS,
                                     .jump_rad = 1e-3};
    bst_model_error e = {0};
    bst_model_error_init(&e, &env);
    mount m = make_mount(0.0);
    const bst_vec3 first = {2e-4, -1e-4, 3e-4}, later = {5e-4, 2e-4, -1e-4};
    bst_pointing_error observer = {.started = true, .error = bst_quat_from_rotvec(first)};
    for (int64_t tick = 0; tick < 6000; tick += 100) {
        go_on(&e, &observer, &m, tick, tick + 100);
        bst_attitude_fix fix = {
            .valid = true, .tick = tick, .q_cam_from_gcrf = camera_at(&m, tick)};
        (void)bst_model_error_apply(&e, &observer, &fix);
        bst_vec3 now = bst_quat_to_rotvec(bst_model_error_correction(&e, &observer, tick, TICKS));
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(now, first)), 0.0, 1e-12);
    }
    assert_true(e.begun);
    observer.error = bst_quat_from_rotvec(later);
    bst_vec3 now = bst_quat_to_rotvec(bst_model_error_correction(&e, &observer, 7000, TICKS));
    bst_assert_close(now.x, first.x + 1.5 * (later.x - first.x), 1e-12);
    bst_assert_close(now.y, first.y + 1.5 * (later.y - first.y), 1e-12);
    bst_assert_close(now.z, first.z + 1.5 * (later.z - first.z), 1e-12);
    free(m.telemetry);
}

static void a_true_model_changes_nothing(void **state) {
    (void)state;
    const bst_model_error_env env = {.gain = 1.0, .exposure_s = 0.06, .tick_rate_hz = TICKS};
    bst_model_error e = {0};
    bst_model_error_init(&e, &env);
    assert_false(e.active);
    const bst_pointing_error observer = {.error = BST_QUAT_IDENTITY};
    const bst_attitude_fix fix = {.valid = true, .error_cam_rad = {1, 2, 3}};
    bst_attitude_fix got = bst_model_error_apply(&e, &observer, &fix);
    assert_true(got.valid && got.tick == fix.tick);
    assert_true(got.error_cam_rad.x == 1.0 && got.error_cam_rad.y == 2.0 &&
                got.error_cam_rad.z == 3.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_show_more_and_later),
        cmocka_unit_test(commands_turn_by_the_gain),
        cmocka_unit_test(a_true_model_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
