/* The newest frames of a run in progress: which messages make a frame, in which order, and what it
 * says; the second sensor of three. */
#include <time.h>

#include <cjson/cJSON.h>

#include "boresight/frame.h"
#include "boresight/messages.h"
#include "sim/core/wall_clock.h"
#include "tests/test_support.h"
#include "view/live_feed.h"

enum { RATE = 200, OWN = 1 };

static uint16_t pixels[12];

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **out) {
    (void)owner;
    (void)ctx;
    *out = pixels;
    return BST_OK;
}

static void ignore(void *owner) {
    (void)owner;
}

static const bst_frame_ops ops = {.map = map, .unmap = ignore, .recycle = ignore};
static bst_frame image = {.ops = &ops, .width = 4, .height = 3, .references = 1};

typedef struct fixture {
    bst_ctx ctx;
    bst_sensor_config sensors[2][2];
    bst_observer_config observers[2];
    bst_scenario scenario;
    bst_view_feed *feed;
    bst_truth *truth;
    bst_detections *detections;
    bst_tracks *tracks;
    bst_regions_of_interest *regions;
} fixture;

static fixture f;

static void begin(void) {
    memset(&f, 0, sizeof f);
    for (int i = 0; i < 3; i++) { /* two of the first observer, one of the second */
        f.sensors[i / 2][i % 2].camera = (bst_camera){.width_px = 100 + i,
                                                      .height_px = 80 + i,
                                                      .pixel_scale_arcsec = 10.0,
                                                      .gain_e_per_dn = 1.0 + i,
                                                      .offset_dn = 100.0 * i};
    }
    f.observers[0].sensors = (bst_config_list){f.sensors[0], 2};
    f.observers[1].sensors = (bst_config_list){f.sensors[1], 1};
    f.scenario.observers = (bst_config_list){f.observers, 2};
    f.scenario.tick_rate_hz = RATE;
    bst_assert_ok(&f.ctx, bst_time_from_utc(&f.ctx, "2024-01-01T12:00:00Z", &f.scenario.epoch));
    bst_assert_ok(&f.ctx, bst_view_feed_create(&f.ctx, &f.scenario, &f.feed));
    f.truth = calloc(1, sizeof *f.truth + sizeof f.truth->items[0]);
    f.detections = calloc(1, sizeof *f.detections + sizeof f.detections->items[0]);
    f.tracks = calloc(1, sizeof *f.tracks + sizeof f.tracks->items[0]);
    f.regions = calloc(1, sizeof *f.regions + sizeof f.regions->items[0]);
    f.regions->count = 1;
    f.regions->items[0] = (bst_searched_window){
        .window = {20, 26, 24, 16}, .reason = BST_REGION_TARGET, .track_id = 5};
    f.truth->q_cam_from_gcrf_mean = BST_QUAT_IDENTITY;
    f.truth->sun_m = (bst_vec3){1.5e11, 0.0, 0.0};
    f.truth->count = f.detections->count = f.tracks->count = 1;
    f.truth->items[0] =
        (bst_truth_item){.flags = BST_TRUTH_IN_FIELD, .x_centroid_px = 30.0, .y_centroid_px = 40.0};
    f.detections->items[0] = (bst_detection){.x_px = 30.0, .y_px = 40.0};
    f.tracks->items[0] =
        (bst_track){.id = 5, .x_px = 30.0, .y_px = 40.0, .direction_gcrf = {1.0, 0.0, 0.0}};
    for (int i = 0; i < 12; i++) {
        pixels[i] = (uint16_t)(50 + i);
    }
}

static void end(void) {
    bst_view_feed_free(f.feed);
    free(f.truth);
    free(f.detections);
    free(f.tracks);
    free(f.regions);
}

static void send(const char *channel, int64_t id) {
    const bst_frame_message message = {
        .frame = &image, .exposure_id = id, .window = {10, 20, 8, 6}, .binning = 2};
    const void *payload = &message;
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        f.truth->exposure_id = id;
        f.truth->start_tick = 100 * id;
        f.truth->end_tick = 100 * id + 60;
        payload = f.truth;
    } else if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        f.detections->exposure_id = id;
        payload = f.detections;
    } else if (strcmp(channel, BST_CHANNEL_REGIONS_OF_INTEREST) == 0) {
        f.regions->exposure_id = id;
        payload = f.regions;
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        f.tracks->exposure_id = id;
        payload = f.tracks;
    }
    bst_assert_ok(&f.ctx, bst_view_feed_message(f.feed, &f.ctx, OWN, channel, payload, 0));
}

/* Takes the newest frame: what it says. */
static cJSON *get(int64_t after, const bst_view_live_frame **out) {
    *out = bst_view_feed_get(f.feed, OWN, after, 0.0);
    return *out ? cJSON_Parse((*out)->json) : NULL;
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(node, key);
    assert_true(cJSON_IsNumber(item));
    return item->valuedouble;
}

static void expect_place(const cJSON *node, const char *list, double x, double y) {
    const cJSON *items = cJSON_GetObjectItem(node, list);
    assert_int_equal(cJSON_GetArraySize(items), 1);
    bst_assert_close(number(items->child, "x"), x, 1e-12);
    bst_assert_close(number(items->child, "y"), y, 1e-12);
}

static void a_frame_is_complete_with_its_tracks(void **state) {
    (void)state;
    for (int order = 0; order < 2; order++) { /* truth or frame first */
        begin();
        const bst_view_live_frame *frame;
        send(BST_CHANNEL_TRUTH, 1); /* nobody watches */
        assert_null(get(0, &frame));
        bst_view_feed_set_every(f.feed, true);
        send(order ? BST_CHANNEL_FRAME : BST_CHANNEL_TRUTH, 7);
        send(order ? BST_CHANNEL_TRUTH : BST_CHANNEL_FRAME, 7);
        send(BST_CHANNEL_DETECTIONS, 7);
        assert_null(get(0, &frame));
        send(BST_CHANNEL_REGIONS_OF_INTEREST, 7);
        send(BST_CHANNEL_TRACKS, 7);
        cJSON *json = get(0, &frame);
        assert_non_null(json);
        assert_int_equal(frame->sequence, 1);
        assert_int_equal(frame->width, 4);
        assert_int_equal(frame->height, 3);
        assert_memory_equal(frame->pixels, pixels, sizeof pixels);
        bst_view_feed_release(frame);
        bst_assert_close(number(json, "exposure_id"), 7, 0.0);
        bst_assert_close(number(json, "time_s"), 730.0 / RATE, 1e-12);
        bst_assert_close(number(json, "exposure_s"), 60.0 / RATE, 1e-12);
        bst_assert_close(number(json, "binning"), 2, 0.0);
        bst_assert_close(number(json, "gain_e_per_dn"), 2.0, 0.0);
        bst_assert_close(number(json, "offset_dn"), 100.0, 0.0);
        assert_true(cJSON_IsFalse(cJSON_GetObjectItem(json, "dropped")));
        assert_non_null(
            strstr(cJSON_GetObjectItem(json, "utc")->valuestring, "2024-01-01T12:00:03.650"));
        expect_place(json, "truth", 9.75, 9.75);
        expect_place(json, "detections", 9.75, 9.75);
        expect_place(json, "tracks", 9.75, 9.75);
        const cJSON *window = cJSON_GetObjectItem(json, "windows")->child;
        bst_assert_close(number(window, "x0"), 5.0, 0.0);
        bst_assert_close(number(window, "y0"), 3.0, 0.0);
        bst_assert_close(number(window, "width"), 12.0, 0.0);
        bst_assert_close(number(window, "height"), 8.0, 0.0);
        assert_string_equal(cJSON_GetObjectItem(window, "reason")->valuestring, "target");
        bst_assert_close(number(window, "track_id"), 5.0, 0.0);
        cJSON_Delete(json);
        assert_null(get(1, &frame)); /* none newer */
        json = get(0, &frame);
        assert_non_null(json);
        cJSON_Delete(json);
        bst_view_feed_release(frame);
        end();
    }
}

/* A dropped exposure, one of the generator without pixels, and the oldest of too many. */
static void frames_that_lack_a_part(void **state) {
    (void)state;
    begin();
    const bst_view_live_frame *frame;
    assert_null(get(0, &frame));
    bst_view_feed_set_every(f.feed, true);
    f.truth->dropped = true;
    send(BST_CHANNEL_TRUTH, 3);
    cJSON *json = get(0, &frame);
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(json, "dropped")));
    assert_null(frame->pixels);
    assert_int_equal(frame->width, 0);
    bst_assert_close(number(json, "binning"), 1, 0.0);
    expect_place(json, "truth", 30.0, 40.0); /* of the whole sensor */
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(json, "tracks")), 0);
    cJSON_Delete(json);
    const bst_view_live_frame *kept = frame; /* while others become the newest */
    f.truth->dropped = false;
    send(BST_CHANNEL_TRUTH, 4);
    send(BST_CHANNEL_DETECTIONS, 4);
    send(BST_CHANNEL_TRACKS, 4);
    json = get(1, &frame);
    assert_int_equal(frame->sequence, 2);
    expect_place(json, "detections", 30.0, 40.0);
    cJSON_Delete(json);
    bst_view_feed_release(frame);
    assert_int_equal(kept->sequence, 1);
    assert_non_null(strstr(kept->json, "\"exposure_id\":3"));
    bst_view_feed_release(kept);
    for (int64_t id = 10; id < 14; id++) { /* four may wait */
        send(BST_CHANNEL_TRUTH, id);
        send(BST_CHANNEL_FRAME, id);
    }
    assert_null(get(2, &frame));
    send(BST_CHANNEL_TRUTH, 14);
    json = get(2, &frame);
    assert_int_equal(frame->sequence, 3);
    bst_assert_close(number(json, "exposure_id"), 10, 0.0);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(json, "detections")), 0);
    cJSON_Delete(json);
    bst_view_feed_release(frame);
    /* with another time all are forgotten */
    bst_view_feed_restart(f.feed, &f.scenario);
    send(BST_CHANNEL_TRACKS, 12);
    assert_null(get(3, &frame));
    assert_null(bst_view_feed_get(f.feed, 3, 0, 0.0)); /* no such sensor */
    end();
}

static void send_all(int64_t id) {
    send(BST_CHANNEL_TRUTH, id);
    send(BST_CHANNEL_FRAME, id);
    send(BST_CHANNEL_DETECTIONS, id);
    send(BST_CHANNEL_TRACKS, id);
}

/* Nothing is taken in the place of a frame that nobody has got: it would be lost. */
static void what_is_taken_is_got(void **state) {
    (void)state;
    const struct timespec longer_than_due = {.tv_nsec = 150000000};
    begin();
    const bst_view_live_frame *frame;
    assert_null(get(0, &frame));
    send_all(1);
    nanosleep(&longer_than_due, NULL);
    send_all(2);
    for (int64_t sequence = 1; sequence <= 2; sequence++) {
        cJSON *json = get(sequence - 1, &frame);
        assert_non_null(json);
        assert_int_equal(frame->sequence, sequence);
        bst_assert_close(number(json, "exposure_id"), sequence == 1 ? 1.0 : 3.0, 0.0);
        cJSON_Delete(json);
        bst_view_feed_release(frame);
        nanosleep(&longer_than_due, NULL);
        send_all(1 + 2 * sequence);
    }
    end();
}

/* Who asks for a frame that is not there waits as long as it says. */
static void a_frame_is_waited_for(void **state) {
    (void)state;
    begin();
    const double waits_s[] = {0.0, 0.12, 1.05}; /* beyond a second the clock's own carries */
    for (int k = 0; k < 3; k++) {
        const double begun = bst_wall_seconds();
        assert_null(bst_view_feed_get(f.feed, 1, 0, waits_s[k]));
        const double waited = bst_wall_seconds() - begun;
        assert_true(waited >= waits_s[k] - 1e-3 && waited < waits_s[k] + 0.9);
    }
    assert_null(bst_view_feed_get(f.feed, 3, 0, 9.0)); /* there is no such sensor */
    end();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_taken_is_got),
        cmocka_unit_test(a_frame_is_complete_with_its_tracks),
        cmocka_unit_test(frames_that_lack_a_part),
        cmocka_unit_test(a_frame_is_waited_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
