/* The gimbal of type "scripted" in a simulation: the pointing of a file at the start, in the middle
 * and at the end of every exposure, windows and exposures of the file, injected states, faults. */
#include <stdlib.h>

#include "gimbal/modules.h"
#include "gimbal/scripted.h"
#include "sim/engine/simulation.h"
#include "sim/world/scene/field.h"
#include "tests/io/scratch.h"

static const bst_module_desc *const modules[] = {&bst_gimbal_scripted_module};
static const bst_scenario_registry registry = {.modules = modules, .count = 1};

#define SCENARIO                                                                                  \
    "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 3, "             \
    "\"world\": {\"star_catalogue\": \"embedded\"%s}, \"observers\": [{\"name\": \"sat\", "       \
    "\"orbit\": {\"elements_file\": \"%s/scenarios/catalogue_2022-06.tle\", \"norad\": 39089}, "  \
    "\"sensors\": [{\"frame_updates_file\": \"u.json\", \"camera\": {\"pixel_scale_arcsec\": 3, " \
    "\"aperture_m\": 0.15}, \"exposure\": {\"exposure_s\": 0.0335, \"period_s\": 0.5}, "          \
    "\"modules\": {\"gimbal\": {\"type\": \"scripted\"%s}}}]}]}"

enum { MOST = 32 };

typedef struct fixture {
    scratch folder;
    bst_ctx ctx;
    bst_scenario scenario;
    bst_simulation *sim;
    bst_field *field;
    const bst_los_history *history;
    int count;
    bst_exposure exposures[MOST];
    bst_quat start[MOST], mid[MOST], end[MOST];
    int samples[MOST];
} fixture;

static bst_quat at(const bst_los_track *track, double s) {
    double t = s * track->time_s[track->count - 1];
    int k = 0;
    while (k + 2 < track->count && track->time_s[k + 1] <= t) {
        k++;
    }
    double span = track->time_s[k + 1] - track->time_s[k];
    return bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1],
                          span > 0.0 ? (t - track->time_s[k]) / span : 0.0);
}

static bst_status watch(void *user, const char *scope, const char *channel, const void *payload,
                        int64_t tick) {
    fixture *f = user;
    (void)scope;
    (void)tick;
    if (strcmp(channel, BST_CHANNEL_LOS_HISTORY) == 0) {
        f->history = payload;
    }
    if (strcmp(channel, BST_CHANNEL_EXPOSURE) == 0 && f->count < MOST) {
        f->exposures[f->count++] = *(const bst_exposure *)payload;
    }
    return BST_OK;
}

static bst_status begin(fixture *f, const char *objects, const char *gimbal, const char *updates) {
    char text[2000], here[1000];
    memset(f, 0, sizeof *f);
    scratch_make(&f->folder);
    FILE *file = fopen(scratch_path(&f->folder, "u.json"), "w");
    assert_non_null(file);
    fprintf(file, "{\"boresight_frame_updates\": 1, \"frames\": [%s]}", updates);
    fclose(file);
    assert_non_null(getcwd(here, sizeof here));
    snprintf(text, sizeof text, SCENARIO, objects, here, gimbal);
    bst_json *json;
    bst_assert_ok(&f->ctx, bst_json_parse(&f->ctx, scratch_path(&f->folder, "s.json"), text,
                                          strlen(text), &json));
    bst_assert_ok(&f->ctx, bst_scenario_read(&f->ctx, json, &registry, &f->scenario));
    bst_json_free(json);
    static const bst_simulation_options options = {0};
    return bst_simulation_create(&f->ctx, &f->scenario, &options, &f->sim);
}

static void finish(fixture *f) {
    bst_field_free(f->field);
    bst_simulation_free(f->sim);
    bst_scenario_free(&f->scenario);
    scratch_remove_tree(f->folder.folder);
}

/* Runs exposure by exposure and cuts the line of sight out as the renderer does. */
static void run(fixture *f, int64_t ticks) {
    bst_engine *engine = bst_simulation_engine(f->sim);
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = f, .message = watch});
    bst_assert_ok(&f->ctx,
                  bst_field_create(&f->ctx, bst_simulation_world(f->sim), 0, 0, &f->field));
    int cut = 0;
    for (int64_t tick = 1; tick <= ticks; tick++) {
        bst_assert_ok(&f->ctx, bst_engine_run(&f->ctx, engine, tick));
        for (; cut < f->count; cut++) {
            const bst_exposure *e = &f->exposures[cut];
            bst_los_track track;
            bst_assert_ok(&f->ctx, bst_field_track(&f->ctx, f->field, f->history, e->start_tick,
                                                   e->end_tick, 6000, &track));
            f->samples[cut] = track.count;
            f->start[cut] = at(&track, 0.0);
            f->mid[cut] = at(&track, 0.5);
            f->end[cut] = at(&track, 1.0);
        }
    }
}

static void expect_attitude(bst_quat actual, double x, double y, double z, double w) {
    bst_quat want = bst_quat_unit((bst_quat){x, y, z, w});
    double off = bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(actual, bst_quat_conj(want))));
    bst_assert_close(off, 0.0, 1e-9); /* what pointing truth is allowed */
}

/* The exposure of 201 ticks is no multiple of the plant's step of 6; the last frame has a history
 * that turns back, with an attitude between two ticks, and follows with no pause. The quaternions
 * turn about x by 2 asin: in the middle of the first exposure the half angle is the mean. */
static void pointing(void **state) {
    (void)state;
    static const char updates[] =
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], \"q_cam_from_gcrf_end\": "
        "[0.6, 0, 0, 0.8]},"
        "{\"frame\": 1, \"exposure_s\": 0.1005, \"period_s\": 0.1005, \"window_px\": "
        "[10, 20, 300, 200], \"q_cam_from_gcrf_start\": [0, 0, 1, 0], \"q_cam_from_gcrf_end\": "
        "[0, 0, -1, 0]},"
        "{\"frame\": 2, \"pointing\": [{\"time_s\": 0, \"q_cam_from_gcrf\": [0, 0, 1, 0]}, "
        "{\"time_s\": 0.05025, \"q_cam_from_gcrf\": [0, 0.6, 0.8, 0]}, "
        "{\"time_s\": 0.1005, \"q_cam_from_gcrf\": [0, 0, 1, 0]}]}";
    fixture f;
    bst_assert_ok(&f.ctx, begin(&f, "", "", updates));
    run(&f, 6000);
    assert_true(f.count >= 4);
    assert_int_equal(f.exposures[0].end_tick, 201);
    assert_int_equal(f.exposures[1].start_tick, 3000);
    assert_int_equal(f.exposures[1].end_tick, 3603);
    assert_int_equal(f.exposures[2].start_tick, 3603);
    assert_int_equal(f.exposures[2].end_tick, 4206);
    assert_int_equal(f.exposures[0].window.width, 1024);
    for (int k = 1; k < 4; k++) { /* it stays */
        assert_int_equal(f.exposures[k].window.x0, 10);
        assert_int_equal(f.exposures[k].window.y0, 20);
        assert_int_equal(f.exposures[k].window.width, 300);
        assert_int_equal(f.exposures[k].window.height, 200);
    }
    expect_attitude(f.start[0], 0, 0, 0, 1);
    expect_attitude(f.mid[0], sin(0.5 * asin(0.6)), 0, 0, cos(0.5 * asin(0.6)));
    expect_attitude(f.end[0], 0.6, 0, 0, 0.8);
    expect_attitude(f.start[1], 0, 0, 1, 0);
    expect_attitude(f.mid[1], 0, 0, 1, 0);
    expect_attitude(f.end[1], 0, 0, 1, 0);
    expect_attitude(f.start[2], 0, 0, 1, 0);
    /* 301.5 ticks: the turn is cut off between the ticks beside it, half a tick of the rate */
    double half = asin(0.6), kept = half * 301.0 / 301.5;
    expect_attitude(f.mid[2], 0, sin(kept), cos(kept), 0);
    expect_attitude(f.end[2], 0, 0, 1, 0);
    expect_attitude(f.start[3], 0, 0, 1, 0); /* after the file's last frame it rests */
    expect_attitude(f.end[3], 0, 0, 1, 0);
    finish(&f);
}

static void missing_frames(void **state) {
    (void)state;
    static const char updates[] =
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], \"q_cam_from_gcrf_end\": "
        "[0.6, 0, 0, 0.8]}, {\"frame\": 3, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
        "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}";
    fixture f;
    assert_int_equal(begin(&f, "", "", updates), BST_ERR_CONFIG);
    assert_non_null(strstr(f.ctx.message, "u.json: frame 1: has no pointing"));
    assert_non_null(strstr(f.ctx.message, "sat/camera/gimbal"));
    finish(&f);
    bst_assert_ok(&f.ctx, begin(&f, "", ", \"missing_frames\": \"hold\"", updates));
    run(&f, 12000);
    for (int k = 1; k < 3; k++) {
        expect_attitude(f.start[k], 0.6, 0, 0, 0.8);
        expect_attitude(f.end[k], 0.6, 0, 0, 0.8);
    }
    expect_attitude(f.start[3], 0, 0, 0, 1);
    finish(&f);
}

static void expect_fault(const char *objects, const char *gimbal, const char *updates,
                         const char *word1, const char *word2) {
    fixture f;
    assert_int_equal(begin(&f, objects, gimbal, updates), BST_ERR_CONFIG);
    if (!strstr(f.ctx.message, word1) || !strstr(f.ctx.message, word2)) {
        fail_msg("\"%s\" does not say \"%s\" and \"%s\"", f.ctx.message, word1, word2);
    }
    finish(&f);
}

static void faults(void **state) {
    (void)state;
    expect_fault("", "", "{\"frame\": 0, \"exposure_s\": 0.1}", "u.json", "no frame gives");
    /* a jump from one exposure into the next */
    expect_fault("", "",
                 "{\"frame\": 0, \"exposure_s\": 0.5, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
                 "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}, {\"frame\": 1, "
                 "\"q_cam_from_gcrf_start\": [0, 0, 0.6, 0.8], \"q_cam_from_gcrf_end\": "
                 "[0, 0, 0, 1]}",
                 "frame 1", "jumps by");
    /* no whole number of ticks */
    expect_fault("", "",
                 "{\"frame\": 4, \"exposure_s\": 0.10001, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
                 "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}",
                 "frame 4", "exposure_s");
    /* longer than what the gimbal remembers */
    expect_fault("", "",
                 "{\"frame\": 0, \"exposure_s\": 8, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
                 "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}",
                 "u.json", "history_s");
    expect_fault(
        ", \"objects\": [{\"name\": \"T\", \"orbit\": {\"source\": \"injected\", "
        "\"states_file\": \"other.json\"}}]",
        "",
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
        "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}",
        "/world/objects/0/orbit/states_file", "frame_updates_file");
    expect_fault(
        ", \"objects\": [{\"name\": \"T\", \"orbit\": {\"source\": \"injected\", "
        "\"states_file\": \"u.json\"}}]",
        "",
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
        "\"q_cam_from_gcrf_end\": [0, 0, 0, 1]}",
        "/world/objects/0/orbit/states_file", "no states");
}

/* States of the file hold at the very ends of its frames. */
static void states(void **state) {
    (void)state;
#define POSE "\"q_cam_from_gcrf_start\": [0, 0, 0, 1], \"q_cam_from_gcrf_end\": [0, 0, 0, 1]"
#define STATES(x, y)                                                       \
    "\"objects\": [{\"object\": \"A\", \"start_position_m\": [" x          \
    ", 0, 0], "                                                            \
    "\"start_velocity_mps\": [0, 7500, 0], \"end_position_m\": [" x ", " y \
    ", 0], "                                                               \
    "\"end_velocity_mps\": [0, 7500, 1]}]"
    static const char updates[] =
        "{\"frame\": 0, " POSE ", " STATES("7e6", "251.25") "},"
        "{\"frame\": 1, \"exposure_s\": 0.1, " POSE ", " STATES("7.1e6", "750") "}";
    fixture f;
    bst_assert_ok(&f.ctx, begin(&f,
                                ", \"objects\": [{\"name\": \"T\", \"orbit\": {\"source\": "
                                "\"injected\", \"states_file\": \"u.json\", \"states_object\": "
                                "\"A\"}}]",
                                "", updates));
    bst_world_view *view;
    bst_assert_ok(&f.ctx, bst_world_view_create(&f.ctx, bst_simulation_world(f.sim), &view));
    static const double expected[4][4] = {
        {0.0, 7e6, 0, 0}, {0.0335, 7e6, 251.25, 1}, {0.5, 7.1e6, 0, 0}, {0.6, 7.1e6, 750, 1}};
    for (int k = 0; k < 4; k++) {
        bst_world_state s;
        bst_assert_ok(&f.ctx, bst_world_view_object_state(&f.ctx, view, 0, expected[k][0], &s));
        bst_assert_close(s.position_m.x, expected[k][1], 1e-8); /* rounding of 7e6 m */
        bst_assert_close(s.position_m.y, expected[k][2], 1e-8);
        bst_assert_close(s.velocity_mps.z, expected[k][3], 1e-6); /* a derivative over 0.03 s */
    }
    bst_world_view_free(view);
    finish(&f);
}

/* Ticks of 1 ms: an exposure of 33.5 ms ends at tick 34, where its last attitude is. The rate
 * changes at the attitudes alone, each of which is after the one before. */
static void ends_are_at_ticks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_camera camera = {.width_px = 64, .height_px = 48, .pixel_scale_arcsec = 3.0};
    const bst_exposure_config exposure = {.exposure_s = 0.0335, .period_s = 0.5, .binning = 1};
    static const char text[] =
        "{\"boresight_frame_updates\": 1, \"frames\": ["
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1],"
        " \"q_cam_from_gcrf_end\": [0.6, 0, 0, 0.8]},"
        "{\"frame\": 1, \"q_cam_from_gcrf_start\": [0.6, 0, 0, 0.8],"
        " \"q_cam_from_gcrf_end\": [0, 0.6, 0, 0.8]}]}";
    bst_frame_updates *updates;
    bst_scripted *s;
    bst_assert_ok(&ctx, bst_frame_updates_parse(&ctx, "u.json", text, sizeof text - 1, &camera,
                                                &exposure, &updates));
    bst_assert_ok(
        &ctx, bst_scripted_create(&ctx, updates, &camera, &exposure, 1000, BST_SCRIPTED_ERROR, &s));
    bst_assert_close(bst_scripted_at(s, 34).x, 0.6, 1e-12);
    /* a quarter and half of the turn of 2 asin(0.6) */
    bst_assert_close(bst_scripted_at(s, 17).x, sin(0.5 * asin(0.6)), 1e-12);
    bst_assert_close(bst_scripted_at(s, 300).x, 0.6, 1e-12);
    bst_assert_close(bst_scripted_at(s, 534).y, 0.6, 1e-12);
    (void)bst_scripted_at(s, 0);
    static const int64_t ticks[] = {0, 34, 500, 534};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(bst_scripted_next(s, ticks[k]), ticks[k + 1]);
        assert_int_equal(bst_scripted_next(s, ticks[k + 1] - 1), ticks[k + 1]);
    }
    assert_true(bst_scripted_next(s, 534) == INT64_MAX);
    bst_scripted_free(s);
    bst_frame_updates_free(updates);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(ends_are_at_ticks),
                                       cmocka_unit_test(pointing), cmocka_unit_test(missing_frames),
                                       cmocka_unit_test(faults), cmocka_unit_test(states)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
