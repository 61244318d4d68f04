/* Which messages of a run are used, and which frames keep their pixels. */
#include "boresight/messages.h"
#include "sim/core/archive.h"
#include "sim/run/run_watched.h"
#include "tests/test_support.h"

enum { PERIOD = 20, FRAMES = 400 };

static bool is_bare(bst_run_watched *w, int number) {
    bst_hook_mark mark = {.bare = false};
    const bst_frame_message m = {.end_tick = PERIOD * (number + 1)};
    assert_true(bst_run_wants(w, NULL, &m, PERIOD * (number + 1), &mark));
    return mark.bare;
}

/* The first 64, the last ones and every 64th in between keep their pixels for pictures; all of them
 * for a record; none for nothing. */
static void pixels(void **state) {
    (void)state;
    for (int use = 0; use < 4; use++) {
        bst_run_watched w;
        const bst_run_pixels consumers = {
            .recorded = use & 1, .pictured = use & 2, .duration_ticks = PERIOD * FRAMES};
        bst_run_watch(&w, NULL, BST_CHANNEL_FRAME, &consumers);
        assert_int_equal(w.kind, BST_WATCH_FRAMES);
        for (int i = 0; i < FRAMES; i++) {
            bool pictured = i < 64 || i % 64 == 0 || i + 1 + 16 >= FRAMES;
            bool kept = (use & 1) || ((use & 2) && pictured);
            assert_int_equal(is_bare(&w, i), !kept);
        }
    }
}

static void kinds(void **state) {
    (void)state;
    static const struct {
        const char *channel;
        bst_run_watch_kind kind;
    } cases[] = {{BST_CHANNEL_TRUTH, BST_WATCH_ALL},
                 {BST_CHANNEL_DETECTIONS, BST_WATCH_ALL},
                 {BST_CHANNEL_TRACKS, BST_WATCH_ALL},
                 {BST_CHANNEL_TASK, BST_WATCH_ALL},
                 {BST_CHANNEL_LOS_HISTORY, BST_WATCH_NONE},
                 {BST_CHANNEL_MOUNT_STATUS, BST_WATCH_NONE},
                 {BST_CHANNEL_NAV_TELEMETRY, BST_WATCH_NONE},
                 {BST_CHANNEL_WHEEL_STATUS, BST_WATCH_NONE},
                 {BST_CHANNEL_REGIONS_OF_INTEREST, BST_WATCH_NONE},
                 {BST_CHANNEL_SENSOR_COMMAND, BST_WATCH_NONE},
                 {BST_CHANNEL_CONTROL_STATUS, BST_WATCH_STATUS},
                 {BST_CHANNEL_FRAME, BST_WATCH_FRAMES}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_run_watched w;
        bst_hook_mark mark = {.unwanted_before = -1};
        bst_run_watch(&w, NULL, cases[i].channel, &(bst_run_pixels){0});
        assert_int_equal(w.kind, cases[i].kind);
        assert_string_equal(w.channel, cases[i].channel);
        if (w.kind == BST_WATCH_ALL || w.kind == BST_WATCH_NONE) {
            assert_int_equal(bst_run_wants(&w, NULL, NULL, 5, &mark), w.kind == BST_WATCH_ALL);
            assert_true(mark.unwanted_before == (w.kind == BST_WATCH_ALL ? 0 : INT64_MAX));
        }
    }
}

/* Of the controller's status only changes of mode and target, also across a saved state. */
static void changes_of_the_status(void **state) {
    (void)state;
    static const struct {
        int mode;
        int64_t target;
        bool used;
    } cases[] = {{BST_MODE_IDLE, 0, true},  {BST_MODE_IDLE, 0, false}, {BST_MODE_SLEW, 0, true},
                 {BST_MODE_SLEW, 4, true},  {BST_MODE_SLEW, 4, false}, {BST_MODE_TRACK, 5, true},
                 {BST_MODE_TRACK, 5, false}};
    enum { CASES = sizeof cases / sizeof *cases };
    for (int cut = 0; cut <= CASES; cut++) {
        bst_ctx ctx = {0};
        bst_run_watched w;
        bst_run_watch(&w, NULL, BST_CHANNEL_CONTROL_STATUS, &(bst_run_pixels){0});
        for (int i = 0; i < CASES; i++) {
            if (i == cut) {
                bst_archive *saved, *back;
                size_t bytes;
                bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
                bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "w"));
                bst_run_watched_archive(&w, saved);
                bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
                const void *data = bst_archive_data(saved, &bytes);
                bst_assert_ok(&ctx, bst_archive_open(&ctx, data, bytes, &back));
                bst_run_watched restored = {.mode = 77};
                bst_assert_ok(&ctx, bst_archive_begin(&ctx, back, "w"));
                bst_run_watched_archive(&restored, back);
                bst_assert_ok(&ctx, bst_archive_end(&ctx, back));
                bst_run_watch_again(&restored, NULL, &(bst_run_pixels){0});
                w = restored;
                bst_archive_free(saved);
                bst_archive_free(back);
            }
            const bst_control_status status = {.mode = cases[i].mode, .target_id = cases[i].target};
            bst_hook_mark mark = {.bare = false};
            assert_int_equal(bst_run_wants(&w, NULL, &status, i, &mark), cases[i].used);
        }
    }
}

/* The count of frames and their period go on after a saved state. */
static void frames_go_on(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_run_watched w, restored = {.mode = 77};
    const bst_run_pixels consumers = {.pictured = true, .duration_ticks = PERIOD * FRAMES};
    bst_run_watch(&w, NULL, BST_CHANNEL_FRAME, &consumers);
    for (int i = 0; i < 100; i++) {
        (void)is_bare(&w, i);
    }
    bst_archive *saved, *back;
    size_t bytes;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "w"));
    bst_run_watched_archive(&w, saved);
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    const void *data = bst_archive_data(saved, &bytes);
    bst_assert_ok(&ctx, bst_archive_open(&ctx, data, bytes, &back));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, back, "w"));
    bst_run_watched_archive(&restored, back);
    bst_assert_ok(&ctx, bst_archive_end(&ctx, back));
    bst_run_watch_again(&restored, NULL, &consumers);
    bst_archive_free(saved);
    bst_archive_free(back);
    for (int i = 100; i < FRAMES; i++) {
        assert_int_equal(is_bare(&restored, i), is_bare(&w, i));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pixels),
        cmocka_unit_test(kinds),
        cmocka_unit_test(changes_of_the_status),
        cmocka_unit_test(frames_go_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
