/* Pictures of a run: what the quick look and the pointing plot get, of binned windows of the
 * sensor, late messages and long runs. Linked with wraps of the two that draw. */
#include "boresight/archive.h"
#include "sim/core/archive.h"
#include "sim/io/plot.h"
#include "sim/io/quicklook.h"
#include "sim/run/run_pictures.h"
#include "tests/test_support.h"

enum { RATE = 100, WIDTH = 6, HEIGHT = 4, TARGET = 3 };

/* What was drawn last. */
static bst_quicklook_frame shown[2];
static bst_io_mark marks[2][40];
static uint16_t pixels_of[2][WIDTH * HEIGHT];
static char labels[2][3][80];
static int shown_count, point_count;
static bst_io_pointing_point points[4096];
static char plot_label[200];

bst_status __wrap_bst_quicklook_write(bst_ctx *ctx, const char *path, const char *title,
                                      const bst_quicklook_frame *first,
                                      const bst_quicklook_frame *second);
bst_status __wrap_bst_quicklook_write(bst_ctx *ctx, const char *path, const char *title,
                                      const bst_quicklook_frame *first,
                                      const bst_quicklook_frame *second) {
    const bst_quicklook_frame *both[2] = {first, second};
    (void)ctx;
    assert_string_equal(path, "somewhere/quicklook.png");
    assert_string_equal(title, "chase");
    shown_count = 1 + (second != NULL);
    for (int i = 0; i < shown_count; i++) {
        shown[i] = *both[i];
        assert_true(both[i]->detection_count <= 40);
        for (int k = 0; k < both[i]->detection_count; k++) {
            marks[i][k] = both[i]->detections[k];
        }
        memcpy(pixels_of[i], both[i]->pixels, sizeof pixels_of[i]);
        snprintf(labels[i][0], 80, "%s", both[i]->time);
        snprintf(labels[i][1], 80, "%s", both[i]->mode);
        snprintf(labels[i][2], 80, "%s", both[i]->track_label);
    }
    return BST_OK;
}

bst_status __wrap_bst_io_pointing_plot(bst_ctx *ctx, const char *path, const char *title,
                                       const char *label, const bst_io_pointing_point *list,
                                       int count, double limit_px, bool *made);
bst_status __wrap_bst_io_pointing_plot(bst_ctx *ctx, const char *path, const char *title,
                                       const char *label, const bst_io_pointing_point *list,
                                       int count, double limit_px, bool *made) {
    (void)ctx;
    (void)title;
    assert_string_equal(path, "somewhere/pointing.png");
    bst_assert_close(limit_px, 0.5, 0);
    snprintf(plot_label, sizeof plot_label, "%s", label);
    point_count = count;
    memcpy(points, list, (size_t)count * sizeof *list);
    *made = true;
    return BST_OK;
}

static uint16_t frame_pixels[WIDTH * HEIGHT];

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)owner;
    (void)ctx;
    *pixels = frame_pixels;
    return BST_OK;
}
static void nothing(void *owner) {
    (void)owner;
}
static const bst_frame_ops ops = {.map = map, .unmap = nothing, .recycle = nothing};

typedef struct fixture {
    bst_ctx ctx;
    bst_run_pictures *pictures;
} fixture;

static bst_run_pictures *create(bst_ctx *ctx) {
    bst_camera camera = {.width_px = 200, .height_px = 100, .pixel_scale_arcsec = 2.5};
    bst_time epoch;
    bst_run_pictures *p;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_assert_ok(ctx, bst_run_pictures_create(ctx, &camera, RATE, epoch, TARGET, &p));
    return p;
}

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->pictures = create(&f->ctx);
    shown_count = point_count = 0;
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_run_pictures_free(f->pictures);
    free(f);
    return 0;
}

static void give(fixture *f, const char *channel, const void *payload) {
    bst_assert_ok(&f->ctx, bst_run_pictures_message(&f->ctx, f->pictures, channel, payload));
}

static void give_frame(fixture *f, int64_t id, int binning) {
    bst_frame frame = {.ops = &ops, .width = WIDTH, .height = HEIGHT};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        frame_pixels[i] = (uint16_t)(100 * id + i);
    }
    const bst_frame_message m = {.frame = &frame,
                                 .exposure_id = id,
                                 .start_tick = 1000 * id,
                                 .end_tick = 1000 * id + 50,
                                 .window = {.x0 = 40, .y0 = 30, .width = 12, .height = 8},
                                 .binning = binning};
    give(f, BST_CHANNEL_FRAME, &m);
}

static void give_truth(fixture *f, int64_t id, uint32_t flags) {
    bst_truth *t = test_calloc(1, sizeof *t + 3 * sizeof t->items[0]);
    t->exposure_id = id;
    t->count = 3;
    const uint32_t ids[] = {TARGET, TARGET, 1};
    for (int i = 0; i < 3; i++) {
        t->items[i] = (bst_truth_item){.kind = i == 0 ? BST_SOURCE_STAR : BST_SOURCE_OBJECT,
                                       .id = ids[i],
                                       .flags = i == 1 ? flags : BST_TRUTH_IN_FIELD,
                                       .x_centroid_px = 45.0 + 3 * (i - 1),
                                       .y_centroid_px = 43.5 - 2 * (i - 1)};
    }
    give(f, BST_CHANNEL_TRUTH, t);
    test_free(t);
}

/* A star, one at rest, the target's (faint) and a hit, the last in its column. */
static void give_detections(fixture *f, int64_t id) {
    bst_detections *d = test_calloc(1, sizeof *d + 4 * sizeof d->items[0]);
    *d = (bst_detections){.exposure_id = id, .count = 4};
    d->items[0] = (bst_detection){
        .x_px = 30, .y_px = 31, .flux_e = 500, .label = BST_LABEL_STAR, .star_id = 9};
    d->items[1] = (bst_detection){.x_px = 54, .y_px = 37, .flux_e = 900, .label = BST_LABEL_STAR};
    d->items[2] = (bst_detection){.x_px = 45.5, .y_px = 44, .flux_e = 5, .label = BST_LABEL_OBJECT};
    d->items[3] = (bst_detection){.x_px = 46, .y_px = 36, .flux_e = 700, .label = BST_LABEL_HIT};
    give(f, BST_CHANNEL_DETECTIONS, d);
    test_free(d);
}

static void give_tracks(fixture *f, int64_t id) {
    bst_tracks *t = test_calloc(1, sizeof *t + 2 * sizeof t->items[0]);
    *t = (bst_tracks){.exposure_id = id, .count = 2};
    t->items[0] = (bst_track){
        .id = 70 + id, .target_of_interest = true, .x_px = 46, .y_px = 35, .snr = 12.25};
    t->items[1] = (bst_track){.id = 99, .x_px = 1, .y_px = 2, .snr = 3};
    give(f, BST_CHANNEL_TRACKS, t);
    test_free(t);
}

static void write(fixture *f) {
    const bst_loop_figures figures = {.pointing_frames = 3,
                                      .pointing_rms_px = 0.1234,
                                      .pointing_max_px = 0.5678,
                                      .custody = 0.875,
                                      .time_to_acquire_s = 12.34};
    bst_assert_ok(&f->ctx,
                  bst_run_pictures_write(&f->ctx, f->pictures, "somewhere", "chase", &figures));
}

/* A picture's pixel of a place on the sensor: the centre of a binned pixel lies (b - 1) / 2 after
 * that of its first one. */
static double column(double x_px, int binning) {
    return (x_px - 40 - 0.5 * (binning - 1)) / binning;
}
static double row(double y_px, int binning) {
    return (y_px - 30 - 0.5 * (binning - 1)) / binning;
}

static void expect_picture(int at, int64_t id, int binning, const char *mode) {
    const bst_quicklook_frame *q = &shown[at];
    char text[80];
    assert_int_equal(q->width, WIDTH);
    assert_int_equal(q->height, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        assert_int_equal(pixels_of[at][i], 100 * id + i);
    }
    assert_string_equal(labels[at][1], mode);
    /* mid-exposure, 1000 id + 25 ticks */
    double seconds = (double)(1000 * id + 25) / RATE;
    snprintf(text, sizeof text, "t = %.1f s", seconds);
    assert_non_null(strstr(labels[at][0], text));
    assert_true(q->has_target && q->has_track);
    bst_assert_close(q->target_x_px, column(45.0, binning), 1e-12);
    bst_assert_close(q->target_y_px, row(43.5, binning), 1e-12);
    bst_assert_close(q->track_x_px, column(46, binning), 1e-12);
    bst_assert_close(q->track_y_px, row(35, binning), 1e-12);
    snprintf(text, sizeof text, "track %d  SNR %.1f", (int)(70 + id), 12.25);
    assert_string_equal(labels[at][2], text);
    bst_assert_close(q->boresight_x_px, column(99.5, binning), 1e-12);
    bst_assert_close(q->boresight_y_px, row(49.5, binning), 1e-12);
    bst_assert_close(q->pixel_scale_arcsec, 2.5 * binning, 1e-12);
    /* the target's first, then by brightness */
    static const double places[4][2] = {{45.5, 44}, {54, 37}, {46, 36}, {30, 31}};
    static const int kinds[4] = {BST_MARK_DETECTION, BST_MARK_REST, BST_MARK_DETECTION,
                                 BST_MARK_STAR};
    assert_int_equal(q->detection_count, 4);
    for (int k = 0; k < 4; k++) {
        bst_assert_close(marks[at][k].x_px, column(places[k][0], binning), 1e-12);
        bst_assert_close(marks[at][k].y_px, row(places[k][1], binning), 1e-12);
        assert_int_equal(marks[at][k].kind, kinds[k]);
    }
}

static void play(fixture *f, int64_t id, int binning) {
    give(f, BST_CHANNEL_CONTROL_STATUS,
         &(bst_control_status){.mode = id == 1 ? BST_MODE_SLEW : BST_MODE_TRACK});
    give_frame(f, id, binning);
    give_truth(f, id, BST_TRUTH_IN_FIELD);
    give_detections(f, id);
    give_tracks(f, id);
}

static void first_and_last(void **state) {
    fixture *f = *state;
    play(f, 1, 2);
    play(f, 2, 1);
    play(f, 3, 2);
    give_frame(f, 4, 1); /* its tracks do not come */
    give_truth(f, 4, BST_TRUTH_IN_FIELD);
    write(f);
    assert_int_equal(shown_count, 2);
    expect_picture(0, 1, 2, "slew");
    expect_picture(1, 3, 2, "track");
}

/* Messages of other frames change nothing; one frame is one panel. */
static void late_messages(void **state) {
    fixture *f = *state;
    give_frame(f, 5, 1);
    give_truth(f, 4, BST_TRUTH_IN_FIELD);
    give_detections(f, 6);
    give_tracks(f, 4);
    write(f);
    assert_int_equal(shown_count, 1);
    assert_false(shown[0].has_target || shown[0].has_track);
    assert_int_equal(shown[0].detection_count, 0);
    give_truth(f, 5, 0); /* out of the field */
    give_tracks(f, 5);
    give_detections(f, 5); /* after the frame was completed */
    write(f);
    assert_int_equal(shown_count, 1);
    assert_false(shown[0].has_target);
    assert_true(shown[0].has_track);
    assert_int_equal(shown[0].detection_count, 0);
}

static void points_of_long_runs(void **state) {
    fixture *f = *state;
    enum { FRAMES = 10000 };
    for (int i = 0; i < FRAMES; i++) {
        const bst_loop_frame frame = {.time_s = i,
                                      .error_px = 1,
                                      .error_x_px = 0.25 * i,
                                      .error_y_px = -0.5 * i,
                                      .visible = i % 8 != 0,
                                      .in_track = i % 16 == 0,
                                      .settled = i % 32 == 4,
                                      .mode = BST_MODE_TRACK};
        bst_run_pictures_judged(f->pictures, &frame);
    }
    write(f);
    /* 4096 at most: every fourth frame */
    assert_int_equal(point_count, FRAMES / 4);
    for (int k = 0; k < point_count; k++) {
        int i = 4 * k;
        bst_assert_close(points[k].time_s, i, 0);
        bst_assert_close(points[k].dx_px, 0.25 * i, 0);
        bst_assert_close(points[k].dy_px, -0.5 * i, 0);
        assert_int_equal(points[k].visible, i % 8 != 0);
        assert_int_equal(points[k].in_track, i % 16 == 0);
        assert_int_equal(points[k].counted, i % 32 == 4);
        assert_int_equal(points[k].mode, BST_MODE_TRACK);
    }
    assert_string_equal(
        plot_label,
        "pointing RMS 0.123 px    largest 0.568 px    custody 87.5 %    acquired at "
        "12.3 s");
    assert_int_equal(shown_count, 0);
}

static void without_figures(void **state) {
    fixture *f = *state;
    bst_loop_figures figures = {.custody = 0.25, .time_to_acquire_s = NAN};
    const bst_loop_frame none = {.error_px = NAN}, one = {.error_px = 1, .time_s = 7};
    bst_run_pictures_judged(f->pictures, &none);
    bst_run_pictures_judged(f->pictures, &one);
    bst_assert_ok(&f->ctx, bst_run_pictures_write(&f->ctx, f->pictures, "somewhere", "", &figures));
    assert_int_equal(point_count, 0); /* one point is no plot */
    bst_run_pictures_judged(f->pictures, &one);
    bst_assert_ok(&f->ctx, bst_run_pictures_write(&f->ctx, f->pictures, "somewhere", "", &figures));
    assert_int_equal(point_count, 2);
    assert_string_equal(plot_label, "never acquired");
    figures.time_to_acquire_s = 3.0;
    bst_assert_ok(&f->ctx, bst_run_pictures_write(&f->ctx, f->pictures, "somewhere", "", &figures));
    assert_string_equal(plot_label, "never settled    custody 25.0 %    acquired at 3.0 s");
}

/* Saved between any two messages and restored, the pictures are the same. */
static void saved_and_restored(void **state) {
    fixture *f = *state;
    play(f, 1, 2);
    play(f, 2, 2);
    give(f, BST_CHANNEL_CONTROL_STATUS, &(bst_control_status){.mode = BST_MODE_TRACK});
    for (int i = 0; i < 5000; i++) {
        bst_run_pictures_judged(f->pictures, &(bst_loop_frame){.error_px = 1, .time_s = i});
    }
    give_frame(f, 3, 2);
    give_truth(f, 3, BST_TRUTH_IN_FIELD);
    give_detections(f, 3);
    bst_archive *saved, *back;
    size_t bytes;
    bst_assert_ok(&f->ctx, bst_archive_create(&f->ctx, &saved));
    bst_assert_ok(&f->ctx, bst_archive_begin(&f->ctx, saved, "pictures"));
    bst_assert_ok(&f->ctx, bst_run_pictures_archive(f->pictures, saved));
    bst_assert_ok(&f->ctx, bst_archive_end(&f->ctx, saved));
    const void *data = bst_archive_data(saved, &bytes);
    bst_run_pictures_free(f->pictures);
    f->pictures = create(&f->ctx);
    bst_assert_ok(&f->ctx, bst_archive_open(&f->ctx, data, bytes, &back));
    bst_assert_ok(&f->ctx, bst_archive_begin(&f->ctx, back, "pictures"));
    bst_assert_ok(&f->ctx, bst_run_pictures_archive(f->pictures, back));
    bst_assert_ok(&f->ctx, bst_archive_end(&f->ctx, back));
    bst_archive_free(saved);
    bst_archive_free(back);
    give_tracks(f, 3);
    for (int i = 5000; i < 6000; i++) {
        bst_run_pictures_judged(f->pictures, &(bst_loop_frame){.error_px = 1, .time_s = i});
    }
    write(f);
    assert_int_equal(shown_count, 2);
    expect_picture(0, 1, 2, "slew");
    expect_picture(1, 3, 2, "track");
    assert_int_equal(point_count, 3000);
    bst_assert_close(points[2999].time_s, 5998, 0);
    give_frame(f, 4, 1);
    give_truth(f, 4, BST_TRUTH_IN_FIELD);
    give_detections(f, 4);
    give_tracks(f, 4);
    write(f);
    expect_picture(1, 4, 1, "track"); /* the mode is known */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(first_and_last, set_up, tear_down),
        cmocka_unit_test_setup_teardown(late_messages, set_up, tear_down),
        cmocka_unit_test_setup_teardown(points_of_long_runs, set_up, tear_down),
        cmocka_unit_test_setup_teardown(without_figures, set_up, tear_down),
        cmocka_unit_test_setup_teardown(saved_and_restored, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
