/* Files of frame updates: what is read, and what every fault is reported as. */
#include "sim/world/frame_updates.h"
#include "tests/test_support.h"

static const bst_camera camera = {.width_px = 640, .height_px = 480, .pixel_scale_arcsec = 3.0};
static const bst_exposure_config exposure = {.exposure_s = 0.5, .period_s = 1.0, .first_s = 2.0};

#define FILE_OF(frames) "{\"boresight_frame_updates\": 1, \"frames\": [" frames "]}"
#define Q "[0, 0, 0, 1]"
#define START_END "\"q_cam_from_gcrf_start\": " Q ", \"q_cam_from_gcrf_end\": " Q

static bst_status parse(bst_ctx *ctx, const char *text, bst_frame_updates **out) {
    return bst_frame_updates_parse(ctx, "u.json", text, strlen(text), &camera, &exposure, out);
}

static void everything(void **state) {
    (void)state;
    static const char text[] = FILE_OF(
        "{\"frame\": 0, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], "
        "\"q_cam_from_gcrf_end\": [0.6, 0, 0, 0.8]},"
        "{\"frame\": 2, \"exposure_s\": 2, \"period_s\": 0.25, \"window_px\": [1, 2, 30, 40], "
        "\"binning\": 3, "
        "\"pointing\": [{\"time_s\": 0, \"q_cam_from_gcrf\": [0, 0, 0, 1]}, {\"time_s\": 0.7, "
        "\"q_cam_from_gcrf\": [0, 1, 0, 0]}, {\"time_s\": 2, \"q_cam_from_gcrf\": [1, 0, 0, 0]}]},"
        "{\"frame\": 3, \"pixel_scale_arcsec\": 6, \"objects\": [{\"object\": \"A\", "
        "\"start_position_m\": [7e6, 1, 2], \"start_velocity_mps\": [1, 2, 3], "
        "\"end_position_m\": [7e6, 5, 6], \"end_velocity_mps\": [4, 5, 6]}]}");
    bst_ctx ctx = {0};
    bst_frame_updates *u;
    bst_assert_ok(&ctx, parse(&ctx, text, &u));
    assert_int_equal(bst_frame_updates_count(u), 3);
    assert_string_equal(bst_frame_updates_name(u), "u.json");
    bst_frame_cursor c = bst_frame_cursor_begin(u, &camera, &exposure, 100.0);
    /* frame: start and exposure in ticks, window, scale, attitudes, binning */
    static const int64_t expected[5][6] = {{200, 50, 640, 3, 2, 1},
                                           {300, 50, 640, 3, 0, 1},
                                           {400, 200, 30, 3, 3, 3},
                                           {600, 200, 30, 6, 0, 3},
                                           {800, 200, 30, 6, 0, 3}};
    for (int k = 0; k < 5; k++, bst_frame_cursor_next(&c)) {
        assert_int_equal(c.frame, k);
        assert_int_equal(c.start_tick, expected[k][0]);
        assert_int_equal(c.exposure_ticks, expected[k][1]);
        assert_int_equal(c.window.width, expected[k][2]);
        assert_int_equal((int)c.pixel_scale_arcsec, expected[k][3]);
        assert_int_equal(c.update ? c.update->node_count : 0, expected[k][4]);
        assert_int_equal(c.binning, expected[k][5]);
        bst_assert_close(c.start_s, (double)c.start_tick / 100.0, 1e-12); /* sums of doubles */
    }
    const bst_frame_update *last = bst_frame_updates_item(u, 2);
    assert_int_equal(last->object_count, 1);
    assert_string_equal(last->objects[0].name, "A");
    bst_assert_close(last->objects[0].end_position_m.z, 6.0, 0.0); /* as written */
    bst_assert_close(bst_frame_updates_item(u, 1)->nodes[1].q_cam_from_gcrf.y, 1.0, 0.0); /* same */
    /* attitudes at their times: start and end of an exposure of the scenario, of the frame's own */
    static const double times[2][3] = {{0.0, 0.5}, {0.0, 0.7, 2.0}};
    for (int k = 0; k < 2; k++) {
        const bst_frame_update *of = bst_frame_updates_item(u, k);
        for (int i = 0; i < of->node_count; i++) {
            bst_assert_close(of->nodes[i].time_s, times[k][i], 0.0); /* as written */
        }
    }
    bst_assert_close(bst_frame_updates_item(u, 0)->nodes[1].q_cam_from_gcrf.x, 0.6, 1e-15);
    double longest, shortest;
    bst_frame_updates_limits(u, &camera, &exposure, &longest, &shortest);
    bst_assert_close(longest, 2.0, 0.0);  /* as written */
    bst_assert_close(shortest, 1.0, 0.0); /* as given */
    bst_frame_updates_free(u);
}

/* Faults, and words of the message. */
static const struct {
    const char *text, *words[4];
} faults[] = {
    {"{\"frames\": []}", {"u.json", "boresight_frame_updates", "missing", ""}},
    {"{\"boresight_frame_updates\": 2, \"frames\": []}",
     {"/boresight_frame_updates", "found 2", "", ""}},
    {"{\"boresight_frame_updates\": 1}", {"/frames", "missing", "", ""}},
    {FILE_OF(""), {"/frames", "no frames", "", ""}},
    {FILE_OF("{\"exposure_s\": 1}"), {"/frames/0/frame", "required", "", ""}},
    {FILE_OF("{\"frame\": 7, \"exposre_s\": 1}"),
     {"(frame 7)/exposre_s", "did you mean \"exposure_s\"", "", ""}},
    {FILE_OF("{\"frame\": 7, \"exposure_s\": -1}"),
     {"(frame 7)/exposure_s", "found -1", "0 to 3600 s", ""}},
    {FILE_OF("{\"frame\": 7, \"exposure_s\": NaN}"), {"u.json", "NaN", "", ""}},
    {FILE_OF("{\"frame\": 7, \"exposure_s\": 1e999}"), {"u.json", "1e999", "", ""}},
    {FILE_OF("{\"frame\": 7, \"exposure_s\": null}"),
     {"(frame 7)/exposure_s", "wrong type", "", ""}},
    {FILE_OF("{\"frame\": 1}, {\"frame\": 3}, {\"frame\": 2}"),
     {"/frames/2 (frame 2)/frame", "out of order", "4 or more", ""}},
    {FILE_OF("{\"frame\": 1}, {\"frame\": 1}"), {"(frame 1)", "comes twice", "", ""}},
    {FILE_OF("{\"frame\": 1.5}"), {"/frame", "not an integer", "", ""}},
    {FILE_OF("{\"frame\": 4, \"q_cam_from_gcrf_start\": " Q "}"),
     {"(frame 4)/q_cam_from_gcrf_end", "missing", "both or none", ""}},
    {FILE_OF("{\"frame\": 4, \"q_cam_from_gcrf_start\": [0, 0, 0, 0.9], \"q_cam_from_gcrf_end\": " Q
             "}"),
     {"(frame 4)/q_cam_from_gcrf_start", "not a unit quaternion", "[x, y, z, w]", "scalar w last"}},
    {FILE_OF("{\"frame\": 4, \"q_cam_from_gcrf_start\": [0, 0, 1], \"q_cam_from_gcrf_end\": " Q
             "}"),
     {"(frame 4)/q_cam_from_gcrf_start", "4 numbers", "", ""}},
    {FILE_OF("{\"frame\": 4, " START_END ", \"pointing\": []}"),
     {"(frame 4)", "history too", "either pointing", ""}},
    {FILE_OF("{\"frame\": 4, \"pointing\": [{\"time_s\": 0, \"q_cam_from_gcrf\": " Q
             "}, {\"time_s\": 0.4, \"q_cam_from_gcrf\": " Q "}]}"),
     {"(frame 4)/pointing", "does not cover", "0.5 s", ""}},
    {FILE_OF("{\"frame\": 4, \"pointing\": [{\"time_s\": 0, \"q_cam_from_gcrf\": " Q
             "}, {\"time_s\": 0, \"q_cam_from_gcrf\": " Q
             "}, {\"time_s\": 0.5, \"q_cam_from_gcrf\": " Q "}]}"),
     {"(frame 4)/pointing", "do not ascend", "", ""}},
    {FILE_OF("{\"frame\": 4, \"pointing\": [{\"time_s\": 0.1, \"q_cam_from_gcrf\": " Q
             "}, {\"time_s\": 0.5, \"q_cam_from_gcrf\": " Q "}]}"),
     {"(frame 4)/pointing", "does not cover", "0.5 s", ""}},
    {FILE_OF("{\"frame\": 4, \"pointing\": [{\"time_s\": 0, \"q_cam_from_gcrf\": " Q
             "}, {\"time_s\": 0.6, \"q_cam_from_gcrf\": " Q "}]}"),
     {"(frame 4)/pointing", "does not cover", "0.5 s", ""}},
    {FILE_OF("{\"frame\": 4, \"window_px\": [600, 0, 41, 10]}"),
     {"(frame 4)/window_px", "not a window", "640 x 480", ""}},
    {FILE_OF("{\"frame\": 4, \"window_px\": [0.5, 0, 41, 10]}"),
     {"(frame 4)/window_px", "not whole pixels", "", ""}},
    {FILE_OF("{\"frame\": 4, \"window_px\": [0, 0, 0, 10]}"), {"(frame 4)/window_px", "", "", ""}},
    {FILE_OF("{\"frame\": 4, \"binning\": 9}"), {"(frame 4)/binning", "9", "8", ""}},
    {FILE_OF("{\"frame\": 1, \"binning\": 4}, {\"frame\": 4, \"window_px\": [0, 0, 9, 3]}"),
     {"(frame 4)/window_px", "no pixel is left", "9 x 3", ""}},
    {FILE_OF("{\"frame\": 4, \"window_px\": [0, 0, 9, 3], \"binning\": 4}"),
     {"(frame 4)/binning", "no pixel is left", "9 x 3", ""}},
    {FILE_OF("{\"frame\": 4, \"pixel_scale_arcsec\": 0}"),
     {"(frame 4)/pixel_scale_arcsec", "out of range", "", ""}},
    {FILE_OF("{\"frame\": 4, \"objects\": [{\"object\": \"A\"}]}"),
     {"(frame 4)/objects/0/start_position_m", "required", "", ""}},
    {FILE_OF("{\"frame\": 4, \"objects\": [{\"object\": \"A\", \"start_q_body_from_gcrf\": " Q
             "}]}"),
     {"(frame 4)/objects/0/end_q_body_from_gcrf", "required", "", ""}},
    {FILE_OF("{\"frame\": 4, \"objects\": [{\"object\": \"A\", \"start_q_body_from_gcrf\": " Q
             ", \"end_q_body_from_gcrf\": [0, 0, 0, 0]}]}"),
     {"(frame 4)/objects/0/end_q_body_from_gcrf", "unit quaternion", "", ""}},
    {FILE_OF("{\"frame\": 4, \"exposure_s\": 0, \"objects\": [{\"object\": \"A\", "
             "\"start_position_m\": [7e6, 1, 2], \"start_velocity_mps\": [1, 2, 3], "
             "\"end_position_m\": [7e6, 5, 6], \"end_velocity_mps\": [4, 5, 6]}]}"),
     {"(frame 4)/objects", "no length", "", ""}},
};

static void faults_are_reported(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        bst_ctx ctx = {0};
        bst_frame_updates *u;
        assert_int_not_equal(parse(&ctx, faults[i].text, &u), BST_OK);
        assert_null(u);
        for (int k = 0; k < 4; k++) {
            if (!strstr(ctx.message, faults[i].words[k])) {
                fail_msg("fault %zu: \"%s\" does not say \"%s\"", i, ctx.message,
                         faults[i].words[k]);
            }
        }
    }
}

/* Windows at the edges of a sensor of 640 x 480 and one pixel beyond, each side by itself. */
static void windows_at_the_edges(void **state) {
    (void)state;
    static const struct {
        int window[4];
        bool good;
    } cases[] = {{{0, 0, 640, 480}, true},  {{639, 479, 1, 1}, true},  {{0, 0, 641, 480}, false},
                 {{0, 0, 640, 481}, false}, {{1, 0, 640, 480}, false}, {{0, 1, 640, 480}, false},
                 {{630, 3, 10, 5}, true},   {{631, 3, 10, 5}, false},  {{3, 475, 10, 5}, true},
                 {{3, 476, 10, 5}, false},  {{3, 4, 10, 0}, false},    {{3, 4, 0, 10}, false},
                 {{-1, 0, 10, 10}, false},  {{0, -1, 10, 10}, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[300];
        const int *w = cases[i].window;
        snprintf(text, sizeof text, FILE_OF("{\"frame\": 4, \"window_px\": [%d, %d, %d, %d]}"),
                 w[0], w[1], w[2], w[3]);
        bst_ctx ctx = {0};
        bst_frame_updates *u;
        assert_int_equal(parse(&ctx, text, &u) == BST_OK, cases[i].good);
        bst_frame_updates_free(u);
    }
}

/* Any one of the keys of an object's states asks for the three others, and any one of its attitudes
 * for the other one. */
static void keys_of_objects_come_together(void **state) {
    (void)state;
    static const char *const keys[6] = {
        "\"start_position_m\": [7e6, 1, 2]", "\"start_velocity_mps\": [1, 2, 3]",
        "\"end_position_m\": [7e6, 5, 6]",   "\"end_velocity_mps\": [4, 5, 6]",
        "\"start_q_body_from_gcrf\": " Q,    "\"end_q_body_from_gcrf\": " Q};
    for (int given = 0; given < 64; given++) {
        char text[1000] = "", file[1400];
        for (int k = 0; k < 6; k++) {
            if (given >> k & 1) {
                strcat(strcat(text, ", "), keys[k]);
            }
        }
        snprintf(file, sizeof file, FILE_OF("{\"frame\": 4, \"objects\": [{\"object\": \"A\"%s}]}"),
                 text);
        bst_ctx ctx = {0};
        bst_frame_updates *u;
        bool good = given == 15 || given == 48 || given == 63;
        assert_int_equal(parse(&ctx, file, &u) == BST_OK, good);
        bst_frame_updates_free(u);
    }
}

/* A distorted camera that folds when its field is made wider. */
static void a_field_too_wide(void **state) {
    (void)state;
    bst_camera lens = camera;
    lens.distortion.k1 = -40.0;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &lens));
    static const char text[] = FILE_OF("{\"frame\": 5, \"pixel_scale_arcsec\": 300}");
    bst_frame_updates *u;
    assert_int_equal(
        bst_frame_updates_parse(&ctx, "u.json", text, strlen(text), &lens, &exposure, &u),
        BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "(frame 5)/pixel_scale_arcsec"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(everything), cmocka_unit_test(faults_are_reported),
        cmocka_unit_test(windows_at_the_edges), cmocka_unit_test(keys_of_objects_come_together),
        cmocka_unit_test(a_field_too_wide)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
