/* Figures of merit that are saved after any message and restored into new ones go on as if nothing
 * had been. */
#include "sim/core/archive.h"
#include "sim/eval/loop_summary.h"
#include "sim/eval/run_metrics.h"
#include "sim/eval/sightings.h"
#include "tests/world/world_support.h"

enum { RATE = 100, OBJECTS = 4, FRAMES = 40, ITEMS = 8 };

static const char world_text[] =
    "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"A\", " TEST_GX5
    "}, {\"name\": \"B\", " TEST_GX5 "}, {\"name\": \"C\", " TEST_GX5
    "}, {\"name\": \"D\", " TEST_GX5 "}]}, \"observers\": [{\"name\": \"eye\", " TEST_NEOSSAT
    ", \"sensors\": [{\"name\": \"a\", " TEST_CAMERA "}, {\"name\": \"b\", " TEST_CAMERA "}]}]}";

typedef struct parts {
    bst_loop_summary *loop;
    bst_run_metrics *metrics;
    bst_sightings *sightings;
    bst_eval_pass passes[64];
    int pass_count;
} parts;

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

static bst_status keep_pass(void *user, bst_ctx *ctx, const bst_eval_pass *pass) {
    parts *p = user;
    (void)ctx;
    assert_true(p->pass_count < 64);
    p->passes[p->pass_count++] = *pass;
    return BST_OK;
}

static void create(bst_ctx *ctx, const bst_world *world, parts *p) {
    bst_assert_ok(ctx, bst_loop_summary_create(ctx, world, 0, 0, RATE, 1, &p->loop));
    bst_assert_ok(ctx, bst_run_metrics_create(ctx, world, 0, 0, 1, &p->metrics));
    bst_assert_ok(ctx, bst_sightings_create(ctx, world, RATE, 30.0, keep_pass, p, &p->sightings));
}

static void destroy(parts *p) {
    bst_loop_summary_free(p->loop);
    bst_run_metrics_free(p->metrics);
    bst_sightings_free(p->sightings);
}

static void archive(bst_ctx *ctx, parts *p, bst_archive *a) {
    bst_assert_ok(ctx, bst_archive_begin(ctx, a, "loop"));
    bst_loop_summary_archive(p->loop, a);
    bst_assert_ok(ctx, bst_archive_end(ctx, a));
    bst_assert_ok(ctx, bst_archive_begin(ctx, a, "metrics"));
    bst_assert_ok(ctx, bst_run_metrics_archive(p->metrics, a));
    bst_assert_ok(ctx, bst_archive_end(ctx, a));
    bst_assert_ok(ctx, bst_archive_begin(ctx, a, "sightings"));
    bst_assert_ok(ctx, bst_sightings_archive(p->sightings, a));
    bst_assert_ok(ctx, bst_archive_end(ctx, a));
}

typedef struct messages {
    bst_truth *truth;
    bst_detections *found;
    bst_tracks *tracks;
} messages;

static messages allocate(void) {
    return (messages){test_calloc(1, sizeof(bst_truth) + ITEMS * sizeof(bst_truth_item)),
                      test_calloc(1, sizeof(bst_detections) + ITEMS * sizeof(bst_detection)),
                      test_calloc(1, sizeof(bst_tracks) + ITEMS * sizeof(bst_track))};
}

static void release(messages *m) {
    test_free(m->truth);
    test_free(m->found);
    test_free(m->tracks);
}

/* Messages of frame k of a sensor: objects come and go, with their tracks beside them. */
static void make(int sensor, int k, messages *m) {
    uint64_t r = (uint64_t)(1000 * sensor + k + 1);
    int64_t id = 2 * k + sensor, tick = 900 * k + 300 * sensor; /* 9 s apart */
    *m->truth = (bst_truth){.exposure_id = id,
                            .start_tick = tick,
                            .end_tick = tick + 50,
                            .sun_m = {1e11, -1e11, 2e10},
                            .q_cam_from_gcrf_mid = {0.1, -0.2, 0.3, 0.92736184954957},
                            .count = 0};
    *m->found = (bst_detections){.exposure_id = id, .stars_identified = k % 3, .lost = k % 5 == 0};
    *m->tracks = (bst_tracks){.exposure_id = id,
                              .tick = tick + 25,
                              .lost = k % 4 == 0,
                              .attitude = {.valid = k % 3 != 0, .q_cam_from_gcrf = {0, 0, 0, 1}}};
    for (int o = 0; o < OBJECTS; o++) {
        if ((k / (4 + o)) % 2 == 1) {
            continue; /* not in the field */
        }
        double ra = 1.0 + 0.001 * o, dec = 0.2 - 0.002 * o, x = 100 + 50 * o, y = 300 - 40 * o;
        m->truth->items[m->truth->count++] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                                              .id = (uint32_t)o,
                                                              .flags = BST_TRUTH_IN_FIELD,
                                                              .ra_rad = ra,
                                                              .dec_rad = dec,
                                                              .x_centroid_px = x,
                                                              .y_centroid_px = y,
                                                              .electrons = 100,
                                                              .snr = 5 + 5 * draw(&r),
                                                              .v_mag = 11 + draw(&r),
                                                              .range_m = 1e7 + 1e6 * draw(&r)};
        if (draw(&r) < 0.7) {
            m->found->items[m->found->count++] =
                (bst_detection){.x_px = x + draw(&r) - 0.5, .y_px = y + draw(&r) - 0.5};
        }
        if (draw(&r) < 0.8) {
            m->tracks->items[m->tracks->count++] = (bst_track){
                .id = o + 10 * (k / 13),
                .status = draw(&r) < 0.8 ? BST_TRACK_CONFIRMED : BST_TRACK_TENTATIVE,
                .target_of_interest = o == 1,
                .direction_gcrf = bst_vec3_from_radec(ra + 2e-5 * (draw(&r) - 0.5),
                                                      dec + (draw(&r) < 0.2 ? 3e-4 : 1e-5))};
        }
    }
}

/* The messages of a run in the order of their times: truth first, tracks two frames later. */
static void give(bst_ctx *ctx, parts *p, int step) {
    messages m = allocate();
    int sensor = step % 2, k = step / 2;
    make(sensor, k, &m);
    if (k % 7 == 3) {
        bst_control_status status = {.mode = k % 2 ? BST_MODE_TRACK : BST_MODE_COAST};
        bst_loop_summary_status(p->loop, &status);
        bst_task task = {.object = k % 4, .before = BST_TASK_DONE};
        bst_sightings_task(p->sightings, &task);
    }
    bst_assert_ok(ctx, bst_sightings_truth(ctx, p->sightings, sensor, m.truth));
    if (sensor == 0) {
        bst_assert_ok(ctx, bst_run_metrics_truth(ctx, p->metrics, m.truth));
        bst_assert_ok(ctx, bst_loop_summary_truth(ctx, p->loop, m.truth));
    }
    if (k >= 2) {
        make(sensor, k - 2, &m);
        bst_sightings_detections(p->sightings, sensor, m.found);
        bst_sightings_tracks(p->sightings, sensor, m.tracks);
        if (sensor == 0) {
            bst_run_metrics_detections(p->metrics, m.found);
            bst_assert_ok(ctx, bst_run_metrics_tracks(ctx, p->metrics, m.tracks));
            bst_tracks_smoothed *smoothed =
                calloc(1, sizeof *smoothed + sizeof(bst_track_smoothed));
            assert_non_null(smoothed);
            smoothed->exposure_id = m.tracks->exposure_id;
            smoothed->count = m.tracks->count > 0;
            smoothed->items[0] = (bst_track_smoothed){
                .target_of_interest = true, .direction_gcrf = m.tracks->items[0].direction_gcrf};
            bst_run_metrics_smoothed(p->metrics, smoothed);
            free(smoothed);
            bst_loop_summary_tracks(p->loop, m.tracks, m.tracks->tick + 1800);
        }
    }
    release(&m);
}

typedef struct outcome {
    bst_loop_figures loop;
    bst_loop_frame newest;
    bst_run_metric_figures metrics;
    bst_sightings_figures sightings;
    bst_sighting sums[32];
    int sum_count;
} outcome;

static bst_status keep_sum(void *user, bst_ctx *ctx, const bst_sighting *sum) {
    outcome *o = user;
    (void)ctx;
    assert_true(o->sum_count < 32);
    o->sums[o->sum_count++] = *sum;
    return BST_OK;
}

static void finish(bst_ctx *ctx, parts *p, outcome *o) {
    memset(o, 0, sizeof *o);
    bst_loop_summary_newest(p->loop, &o->newest);
    bst_loop_summary_finish(p->loop);
    bst_loop_summary_figures(p->loop, &o->loop);
    bst_run_metrics_figures(p->metrics, &o->metrics);
    bst_assert_ok(ctx, bst_sightings_finish(ctx, p->sightings, 9.0 * FRAMES));
    bst_sightings_summary(p->sightings, &o->sightings);
    bst_assert_ok(ctx, bst_sightings_each(ctx, p->sightings, keep_sum, o));
}

/* Equal as text: NAN equals NAN, and there are no bytes between members in it. */
static void expect_same(const outcome *a, const outcome *b) {
#define SAME(format, member)                      \
    do {                                          \
        char text[2][64];                         \
        snprintf(text[0], 64, format, a->member); \
        snprintf(text[1], 64, format, b->member); \
        assert_string_equal(text[0], text[1]);    \
    } while (0)
#define COUNT(member) assert_int_equal(a->member, b->member)
    COUNT(loop.frames);
    COUNT(loop.visible_frames);
    COUNT(loop.in_track_frames);
    COUNT(loop.breaks);
    COUNT(loop.wrong_target_frames);
    COUNT(loop.pointing_frames);
    COUNT(loop.final_mode);
    COUNT(loop.in_track_at_end);
    SAME("%.17g", loop.time_to_confirm_s);
    SAME("%.17g", loop.time_to_acquire_s);
    SAME("%.17g", loop.time_to_settle_s);
    SAME("%.17g", loop.custody);
    SAME("%.17g", loop.track_fraction);
    SAME("%.17g", loop.pointing_rms_px);
    SAME("%.17g", loop.pointing_p95_px);
    SAME("%.17g", loop.pointing_max_px);
    SAME("%.17g", loop.pointing_bias_px);
    COUNT(newest.exposure_id);
    COUNT(newest.in_track);
    SAME("%.17g", newest.error_px);
    COUNT(metrics.in_field_frames);
    COUNT(metrics.detected_frames);
    COUNT(metrics.detections);
    COUNT(metrics.track_frames);
    SAME("%.17g", metrics.track_rms_px);
    SAME("%.17g", metrics.track_median_px);
    SAME("%.17g", metrics.track_max_px);
    COUNT(metrics.smoothed_frames);
    SAME("%.17g", metrics.smoothed_rms_px);
    SAME("%.17g", metrics.smoothed_filtered_rms_px);
    COUNT(metrics.tracks);
    COUNT(metrics.false_tracks);
    COUNT(metrics.scored_frames);
    COUNT(metrics.id_switches);
    COUNT(metrics.ghosts);
    SAME("%.17g", metrics.gospa_px);
    SAME("%.17g", metrics.ospa2_px);
    SAME("%.17g", metrics.purity);
    COUNT(metrics.objects_seen);
    COUNT(metrics.objects_tracked);
    assert_memory_equal(&a->metrics.losses, &b->metrics.losses, sizeof a->metrics.losses);
    COUNT(sightings.passes);
    COUNT(sightings.revisits);
    COUNT(sightings.tasks_done);
    SAME("%.17g", sightings.place_rms_arcsec);
    SAME("%.17g", sightings.track_rms_arcsec);
    COUNT(sum_count);
    for (int i = 0; i < a->sum_count; i++) {
        COUNT(sums[i].sensor);
        COUNT(sums[i].object);
        COUNT(sums[i].frames);
        COUNT(sums[i].detected);
        COUNT(sums[i].tracked);
        COUNT(sums[i].passes_seen);
        SAME("%.17g", sums[i].first_s);
        SAME("%.17g", sums[i].last_s);
        SAME("%.17g", sums[i].custody_s);
        SAME("%.17g", sums[i].longest_gap_s);
        SAME("%.17g", sums[i].snr);
        SAME("%.17g", sums[i].place.greatest);
    }
}

static void after_any_message(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world(world_text);
    static outcome whole, other;
    static parts reference;
    memset(&reference, 0, sizeof reference);
    create(&ctx, world, &reference);
    for (int step = 0; step < 2 * FRAMES; step++) {
        give(&ctx, &reference, step);
    }
    finish(&ctx, &reference, &whole);
    assert_true(whole.metrics.track_frames > 5 && whole.sightings.passes > 10 &&
                whole.loop.frames == FRAMES && reference.pass_count > 10);
    for (int cut = 1; cut < 2 * FRAMES; cut += 6) {
        static parts before, after;
        bst_archive *saved, *back;
        size_t bytes;
        memset(&before, 0, sizeof before);
        memset(&after, 0, sizeof after);
        create(&ctx, world, &before);
        for (int step = 0; step < cut; step++) {
            give(&ctx, &before, step);
        }
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
        archive(&ctx, &before, saved);
        const void *data = bst_archive_data(saved, &bytes);
        create(&ctx, world, &after);
        for (int step = 0; step < 5; step++) { /* into one that holds other things */
            give(&ctx, &after, step);
        }
        after.pass_count = before.pass_count;
        memcpy(after.passes, before.passes, sizeof after.passes);
        bst_assert_ok(&ctx, bst_archive_open(&ctx, data, bytes, &back));
        archive(&ctx, &after, back);
        bst_archive_free(saved);
        bst_archive_free(back);
        for (int step = cut; step < 2 * FRAMES; step++) {
            give(&ctx, &after, step);
        }
        finish(&ctx, &after, &other);
        expect_same(&whole, &other);
        assert_int_equal(after.pass_count, reference.pass_count);
        for (int i = 0; i < after.pass_count; i++) {
            assert_int_equal(after.passes[i].object, reference.passes[i].object);
            assert_int_equal(after.passes[i].frames, reference.passes[i].frames);
            assert_int_equal(after.passes[i].detected, reference.passes[i].detected);
            bst_assert_close(after.passes[i].start_s, reference.passes[i].start_s, 0);
            bst_assert_close(after.passes[i].v_mag, reference.passes[i].v_mag, 0);
        }
        destroy(&before);
        destroy(&after);
    }
    destroy(&reference);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(after_any_message)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
