/* Tables, manifest and messages of the sightings of a run: every column of a pass and of the sums.
 */
#include <cjson/cJSON.h>

#include "boresight/messages.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/io/run_reader.h"
#include "sim/io/run_store.h"
#include "sim/run/run_sightings.h"
#include "tests/io/scratch.h"
#include "tests/world/world_support.h"

enum { RATE = 10 };

/* A frame of object 1 from a sensor: detected at some, tracked at fewer. */
static void take(bst_ctx *ctx, bst_run_sightings *s, const bst_world *world, int64_t id, int k,
                 double seconds) {
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double x = 300, y = 420, step = camera->pixel_scale_arcsec * BST_ARCSEC_RAD;
    bst_vec3 d = bst_camera_unproject(camera, x, y);
    bst_truth *truth = test_calloc(1, sizeof *truth + sizeof truth->items[0]);
    bst_detections *found = test_calloc(1, sizeof *found + sizeof found->items[0]);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    *truth = (bst_truth){.exposure_id = id,
                         .start_tick = (int64_t)(seconds * RATE),
                         .end_tick = (int64_t)(seconds * RATE),
                         .sun_m = {1.5e11, 0, 0},
                         .count = 1};
    truth->items[0] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                       .id = 1,
                                       .flags = BST_TRUTH_IN_FIELD,
                                       .x_centroid_px = x,
                                       .y_centroid_px = y,
                                       .electrons = k < 4 ? 100 : 0,
                                       .snr = 5 + k % 3,
                                       .v_mag = 12 + 0.25 * k,
                                       .range_m = 1e6 + 100.0 * (k - 2) * (k - 2)};
    bst_vec3_to_radec(d, &truth->items[0].ra_rad, &truth->items[0].dec_rad);
    *found = (bst_detections){.exposure_id = id, .count = k < 3};
    found->items[0] = (bst_detection){.x_px = x + 0.25 * (k + 1), .y_px = y};
    *tracks = (bst_tracks){.exposure_id = id,
                           .attitude = {.valid = true, .q_cam_from_gcrf = {0, 0, 0, 1}},
                           .count = k < 2};
    bst_vec3 side = bst_vec3_unit(bst_vec3_cross(d, (bst_vec3){0, 1, 0}));
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED,
                                   .target_of_interest = k == 1,
                                   .direction_gcrf = bst_vec3_axpy(d, 0.5 * (k + 1) * step, side)};
    bst_assert_ok(ctx, bst_run_sightings_message(ctx, s, 0, BST_CHANNEL_TRUTH, truth));
    bst_assert_ok(ctx, bst_run_sightings_message(ctx, s, 0, BST_CHANNEL_DETECTIONS, found));
    bst_assert_ok(ctx, bst_run_sightings_message(ctx, s, 0, BST_CHANNEL_TRACKS, tracks));
    test_free(truth);
    test_free(found);
    test_free(tracks);
}

typedef struct column {
    const char *name;
    double value, tolerance;
} column;

/* The first row of a query: its columns by their names. */
static void expect_row(bst_run_reader *run, const char *sql, const column *list, size_t count) {
    bst_ctx ctx = {0};
    bst_io_rows *rows;
    bool more;
    bst_assert_ok(&ctx, bst_io_rows_open(&ctx, run, sql, 0, 0, &rows));
    bst_assert_ok(&ctx, bst_io_rows_next(&ctx, rows, &more));
    assert_true(more);
    for (size_t k = 0; k < count; k++) {
        int at = 0;
        while (at < bst_io_rows_columns(rows) &&
               strcmp(bst_io_rows_column_name(rows, at), list[k].name) != 0) {
            at++;
        }
        assert_true(at < bst_io_rows_columns(rows));
        double v = bst_io_rows_real(rows, at);
        if (isnan(list[k].value) ? !isnan(v) : !(fabs(v - list[k].value) <= list[k].tolerance)) {
            fail_msg("%s: %s = %.12g, expected %.12g", sql, list[k].name, v, list[k].value);
        }
    }
    bst_io_rows_close(rows);
}

static void columns_of_the_tables(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_sightings *s;
    bst_run_reader *run;
    bst_world *world =
        test_world_with("{\"name\": \"A\", " TEST_GX5 "}, {\"name\": \"B\", " TEST_GX5 "}", "");
    const bst_recorder_config record = {.sightings = true, .custody_timeout_s = 100};
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_sightings_create(&ctx, world, &record, RATE, store, &s));
    for (int k = 0; k < 5; k++) { /* a pass of five frames, one at 400 s and one at 700 s */
        take(&ctx, s, world, 1 + k, k, 10.0 + 2 * k);
    }
    take(&ctx, s, world, 9, 0, 400.0);
    take(&ctx, s, world, 12, 0, 700.0);
    const bst_task tasks[] = {{.object = 0},
                              {.object = 1, .before = BST_TASK_DONE},
                              {.object = -1, .before = BST_TASK_LOST}};
    for (int k = 0; k < 3; k++) {
        bst_assert_ok(&ctx, bst_run_sightings_message(&ctx, s, 0, BST_CHANNEL_TASK, &tasks[k]));
    }
    bst_assert_ok(&ctx, bst_run_sightings_finish(&ctx, s, 1000.0));
    cJSON *manifest = cJSON_CreateObject();
    bst_run_sightings_add(s, manifest);
    const cJSON *node = cJSON_GetObjectItem(manifest, "sightings");
    const column keys[] = {{"objects", 2, 0},
                           {"objects_in_field", 1, 0},
                           {"objects_seen", 1, 0},
                           {"passes", 3, 0},
                           {"passes_seen", 3, 0},
                           {"detections", 5, 0},
                           {"revisits", 2, 0},
                           {"revisit_mean_s", 343, 1e-9},
                           {"revisit_most_s", 386, 1e-9},
                           {"longest_gap_mean_s", 386, 1e-9},
                           {"custody_fraction_seen", 0.304, 1e-9},
                           {"custody_fraction_all", 0.152, 1e-9},
                           {"place_rms_arcsec", 0.75 * sqrt((1 + 4 + 9 + 1 + 1) / 5.0), 0.01},
                           {"track_rms_arcsec", 1.5 * sqrt((1 + 4 + 1 + 1) / 4.0), 0.01},
                           {"tasks", 2, 0},
                           {"tasks_done", 1, 0},
                           {"tasks_not_found", 0, 0},
                           {"tasks_lost", 1, 0}};
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        const cJSON *item = cJSON_GetObjectItem(node, keys[k].name);
        assert_true(cJSON_IsNumber(item));
        bst_assert_close(item->valuedouble, keys[k].value, keys[k].tolerance);
    }
    cJSON_Delete(manifest);
    bst_run_sightings_free(s);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    /* 3 arcsec a pixel: detections 0.25, 0.5, 0.75 px off; tracks 0.5 and 1 px */
    const column pass[] = {{"sensor", 0, 0},
                           {"object", 1, 0},
                           {"norad", 44801, 0},
                           {"start_s", 10, 1e-9},
                           {"end_s", 18, 1e-9},
                           {"frames", 5, 0},
                           {"lit", 4, 0},
                           {"detected", 3, 0},
                           {"tracked", 2, 0},
                           {"target", 1, 0},
                           {"first_s", 10, 1e-9},
                           {"last_s", 14, 1e-9},
                           {"snr", 7, 0},
                           {"v_mag", 12.5, 0},
                           {"range_m", 1e6, 0},
                           {"place_rms_arcsec", 0.75 * sqrt((1 + 4 + 9) / 3.0), 0.01},
                           {"place_most_arcsec", 2.25, 0.01},
                           {"track_rms_arcsec", 1.5 * sqrt((1 + 4) / 2.0), 0.01},
                           {"track_most_arcsec", 3.0, 0.01}};
    expect_row(run, "SELECT * FROM passes ORDER BY start_s", pass, sizeof pass / sizeof *pass);
    const column sums[] = {{"object", 1, 0},
                           {"norad", 44801, 0},
                           {"passes", 3, 0},
                           {"passes_seen", 3, 0},
                           {"frames", 7, 0},
                           {"lit", 6, 0},
                           {"detected", 5, 0},
                           {"tracked", 4, 0},
                           {"first_s", 10, 1e-9},
                           {"last_s", 700, 1e-9},
                           {"revisits", 2, 0},
                           {"revisit_mean_s", 343, 1e-9},
                           {"revisit_most_s", 386, 1e-9},
                           {"longest_gap_s", 386, 1e-9},
                           {"custody_s", 304, 1e-9},
                           {"custody_fraction", 0.304, 1e-12},
                           {"snr", 7, 0},
                           {"place_most_arcsec", 2.25, 0.01},
                           {"track_most_arcsec", 3.0, 0.01}};
    expect_row(run, "SELECT * FROM sightings WHERE sensor IS NULL", sums,
               sizeof sums / sizeof *sums);
    expect_row(run, "SELECT * FROM sightings WHERE sensor = 0", sums, sizeof sums / sizeof *sums);
    assert_int_equal(bst_run_reader_int(run, "SELECT count(*) FROM sightings", 0, 0), 2);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(columns_of_the_tables)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
