/* A tracker that is saved and restored after every frame gives the same output, to the bit, as one
 * that never is. */
#include "tests/archive_support.h"
#include "tests/tracker/moving_sky.h"
#include "tracker/mtt/multitarget_internal.h"
#include "tracker/tracker_internal.h"

enum { TRACKS = 256, FRAMES = 180 };

typedef struct variant {
    const char *name;
    options sky;
    bst_filter_kind filter;
    bst_mtt_association association;
    bool orbits;
    bool drifts; /* frames without stars have no usable attitude */
} variant;

/* What the saved states held, so that no part of them is always empty. */
typedef struct held {
    int confirmed, at_rest, stars, stored, mixtures, orbits, targets, unused, events, losses;
} held;

static bst_status archive_tracker(void *self, bst_archive *archive) {
    return bst_tracker_archive(self, archive);
}

static bst_tracker *make_tracker(world *w, const variant *v) {
    bst_ctx ctx = {0};
    bst_tracker *tracker;
    bst_tracker_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &config));
    config.filter = v->filter;
    config.association = v->association;
    config.motion = v->orbits;
    config.max_coast_s = 20.0; /* the lost target is stored */
    config.max_misses = 8;
    config.smoothing_lag_frames = v->orbits ? 0 : 6;
    config.drift_noise_arcsec_per_s15 = v->drifts ? 100.0 : config.drift_noise_arcsec_per_s15;
    bst_assert_ok(&ctx,
                  bst_tracker_create(&ctx, &config, &camera, RATE_HZ, find_star, w, &tracker));
    return tracker;
}

static void look_into(const bst_tracker *t, held *h) {
    int count;
    const bst_mtt_track *tracks = bst_mtt_tracks(t->mtt, &count);
    for (int i = 0; i < count; i++) {
        h->confirmed += tracks[i].status == BST_TRACK_CONFIRMED;
        h->at_rest += tracks[i].at_rest;
        h->stars += tracks[i].star;
        assert_true(!tracks[i].star || tracks[i].models.count == 0); /* its place is its state */
        h->mixtures += tracks[i].models.count > 1;
        h->orbits += tracks[i].orbit.valid;
        h->events += tracks[i].manoeuvre_end_s > 0.0;
    }
    const bst_tracker_event *events = bst_tracker_events(t, &count);
    for (int i = 0; i < count; i++) {
        h->losses += events[i].kind == BST_TRACKER_ATTITUDE_LOST;
    }
    (void)bst_mtt_memory(t->mtt, &count);
    h->stored += count;
    h->targets += t->target.id != 0;
    h->unused += t->mtt->history[0].count;
}

/* An observer in a low orbit: orbits need its place. */
static bst_nav_telemetry observer(const world *w) {
    bst_nav_telemetry moving = nav;
    moving.position_gcrf_m = bst_vec3_scale(w->e2, -7.2e6);
    moving.velocity_gcrf_mps = bst_vec3_scale(w->e1, 7.4e3);
    return moving;
}

static void compare_frame(const world *w, bst_tracker *whole, bst_tracker *restored, int k,
                          const variant *v) {
    static bst_tracks *tracks;
    static bst_predictions *predictions;
    const size_t track_bytes = sizeof *tracks + TRACKS * sizeof(bst_track);
    const size_t prediction_bytes = sizeof *predictions + TRACKS * sizeof(bst_prediction);
    tracks = tracks ? tracks : calloc(1, track_bytes);
    predictions = predictions ? predictions : calloc(1, prediction_bytes);
    assert_true(tracks && predictions);
    memset(tracks, 0, track_bytes);
    memset(predictions, 0, prediction_bytes);
    memset(w->tracks, 0, track_bytes);
    memset(w->predictions, 0, prediction_bytes);
    bst_tracker_input input = make_input(w, k);
    bst_nav_telemetry moving = observer(w);
    if (v->orbits) {
        input.nav = &moving;
        input.cue.range_m = 3.6e7;
    }
    assert_int_equal(bst_tracker_step(whole, &input, w->tracks, TRACKS, w->predictions, TRACKS),
                     bst_tracker_step(restored, &input, tracks, TRACKS, predictions, TRACKS));
    assert_memory_equal(tracks, w->tracks, track_bytes);
    assert_memory_equal(predictions, w->predictions, prediction_bytes);
    static bst_tracks_smoothed *smoothed[2];
    const size_t smoothed_bytes = sizeof **smoothed + TRACKS * sizeof(bst_track_smoothed);
    for (int i = 0; i < 2 && bst_tracker_has_smoothed(whole); i++) {
        smoothed[i] = smoothed[i] ? smoothed[i] : calloc(1, smoothed_bytes);
        assert_non_null(smoothed[i]);
        memset(smoothed[i], 0, smoothed_bytes);
        assert_true(bst_tracker_has_smoothed(restored));
        bst_tracker_smoothed(i == 0 ? whole : restored, smoothed[i], TRACKS);
    }
    assert_true(!smoothed[0] || memcmp(smoothed[0], smoothed[1], smoothed_bytes) == 0);
    int count, other;
    const bst_tracker_event *events = bst_tracker_events(whole, &count);
    const bst_tracker_event *others = bst_tracker_events(restored, &other);
    assert_int_equal(count, other);
    assert_memory_equal(events, others, (size_t)count * sizeof *events);
}

static void follow(const variant *v, held *h) {
    static world w;
    bst_ctx ctx = {0};
    world_open(&w, 11, &v->sky);
    bst_tracker *whole = make_tracker(&w, v), *restored = make_tracker(&w, v);
    *h = (held){0};
    for (int k = 0; k < v->sky.frames; k++) {
        test_saved saved = test_save(archive_tracker, restored);
        bst_tracker_free(restored);
        restored = make_tracker(&w, v);
        bst_assert_ok(&ctx, test_restore(&ctx, archive_tracker, restored, saved));
        free(saved.bytes);
        if (k > 0) { /* the latest exposure is known */
            assert_int_equal(bst_tracker_check(restored, w.detections), BST_TRACKER_DUPLICATE);
        }
        (void)expose(&w, k);
        compare_frame(&w, whole, restored, k, v);
        look_into(restored, h);
    }
    bst_tracker_free(whole);
    bst_tracker_free(restored);
    world_close(&w);
    print_message(
        "%s: %d confirmed, %d at rest, %d stars, %d stored, %d mixtures, %d orbits, %d "
        "manoeuvring, target in %d frames, %d unused detections\n",
        v->name, h->confirmed, h->at_rest, h->stars, h->stored, h->mixtures, h->orbits, h->events,
        h->targets, h->unused);
    assert_true(h->confirmed > 50 && h->targets > 30 && h->unused > 50);
}

/* A target that burns and goes dark, a neighbour nearly at rest among the stars, another that
 * passes, and frames without stars. */
static const options busy = {.sigma_px = 0.1,
                             .pd = 0.9,
                             .false_alarms = 3,
                             .burn_s = 30,
                             .dark = true,
                             .dark_from_s = 70,
                             .neighbours = 2,
                             .neighbour_rate = {{-51.0, -12.8}, {0.4, -0.3}},
                             .starless_from_s = 20,
                             .starless_to_s = 24,
                             .frames = FRAMES};

static void extended_filter(void **state) {
    (void)state;
    const variant v = {
        .name = "ekf, gnn", .sky = busy, .filter = BST_FILTER_EKF, .association = BST_MTT_GNN};
    held h;
    follow(&v, &h);
    assert_true(h.at_rest > 0 && h.stored > 0);
}

static void mixtures(void **state) {
    (void)state;
    variant v = {.name = "ukf, mixture",
                 .sky = busy,
                 .filter = BST_FILTER_UKF,
                 .association = BST_MTT_MIXTURE};
    v.sky.false_alarms = 40; /* several detections in a gate */
    held h;
    follow(&v, &h);
    assert_true(h.mixtures > 0 && h.stored > 0);
}

static void two_models(void **state) {
    (void)state;
    const variant v = {
        .name = "imm, pda", .sky = busy, .filter = BST_FILTER_IMM, .association = BST_MTT_PDA};
    held h;
    follow(&v, &h);
    assert_true(h.mixtures > 0 && h.stored > 0);
}

static void orbits(void **state) {
    (void)state;
    const variant v = {.name = "ekf, orbits",
                       .sky = busy,
                       .filter = BST_FILTER_EKF,
                       .association = BST_MTT_PMB,
                       .orbits = true};
    held h;
    follow(&v, &h);
    assert_true(h.orbits > 0);
}

/* The loss of the attitude is an event of its first frame only. */
static void lost_attitude(void **state) {
    (void)state;
    const variant v = {.name = "no attitude",
                       .sky = busy,
                       .filter = BST_FILTER_EKF,
                       .association = BST_MTT_GNN,
                       .drifts = true};
    held h;
    follow(&v, &h);
    assert_int_equal(h.losses, 1);
}

/* A tracker in the middle of a run takes the saved state of another one, earlier or later. */
static void into_a_used_tracker(void **state) {
    (void)state;
    const variant v = {
        .name = "used", .sky = busy, .filter = BST_FILTER_EKF, .association = BST_MTT_GNN};
    static world w;
    bst_ctx ctx = {0};
    world_open(&w, 12, &v.sky);
    bst_tracker *whole = make_tracker(&w, &v), *used = make_tracker(&w, &v);
    for (int k = 0; k < 40; k++) {
        (void)expose(&w, k);
        bst_tracker_input input = make_input(&w, k);
        if (k < 30) { /* the other one goes further */
            (void)bst_tracker_step(whole, &input, w.tracks, TRACKS, w.predictions, TRACKS);
        }
        (void)bst_tracker_step(used, &input, w.tracks, TRACKS, w.predictions, TRACKS);
    }
    test_saved saved = test_save(archive_tracker, whole);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_tracker, used, saved));
    free(saved.bytes);
    int count;
    (void)bst_tracker_events(used, &count);
    assert_int_equal(count, 0);
    for (int k = 40; k < 80; k++) {
        (void)expose(&w, k);
        compare_frame(&w, whole, used, k, &v);
    }
    bst_tracker_free(whole);
    bst_tracker_free(used);
    world_close(&w);
}

static void damage_is_refused_or_another_state(void **state) {
    (void)state;
    const variant v = {
        .name = "damaged", .sky = busy, .filter = BST_FILTER_EKF, .association = BST_MTT_MIXTURE};
    static world w;
    bst_ctx ctx = {0};
    world_open(&w, 13, &v.sky);
    bst_tracker *tracker = make_tracker(&w, &v), *other = make_tracker(&w, &v);
    for (int k = 0; k < 18; k++) {
        (void)expose(&w, k);
        bst_tracker_input input = make_input(&w, k);
        (void)bst_tracker_step(tracker, &input, w.tracks, TRACKS, w.predictions, TRACKS);
    }
    test_saved saved = test_save(archive_tracker, tracker);
    test_restore_damaged(archive_tracker, other, saved, saved.size / 1500);
    free(saved.bytes);

    /* numbers by which arrays are accessed */
    assert_true(tracker->mtt->track_count > 0);
    bst_mtt_track *track = &tracker->mtt->tracks[0];
    int *const numbers[] = {&track->models.count, &track->innovation_count,
                            &track->brightness_count};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        int right = *numbers[i];
        *numbers[i] = -1;
        bst_archive *archive;
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
        assert_int_equal(bst_tracker_archive(tracker, archive), BST_ERR_FORMAT);
        bst_archive_free(archive);
        *numbers[i] = right;
    }
    /* levels of process noise: more components of one than it may have, none that exists, and a
     * time that is none */
    const bst_filter_models right = track->models;
    for (int i = 0; i < 3; i++) {
        bst_archive *archive;
        track->models.levels = i == 1 ? 2 : BST_FILTER_LEVELS;
        track->models.count = i == 0 ? BST_FILTER_COMPONENTS / BST_FILTER_LEVELS + 1 : 1;
        memset(track->models.level, 0, sizeof track->models.level);
        track->models.unswitched_s = i == 2 ? NAN : 0.0;
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
        assert_int_equal(bst_tracker_archive(tracker, archive), BST_ERR_FORMAT);
        bst_archive_free(archive);
        track->models = right;
    }
    bst_tracker_free(tracker);
    bst_tracker_free(other);
    world_close(&w);
}

/* Smoothing and comparisons with the catalogue may change during a run: what was saved of them is
 * dropped, and the tracks go on. */
static void settings_that_change(void **state) {
    (void)state;
    static const struct {
        int64_t lag;
        double period_s;
    } settings[] = {{6, 10.0}, {0, 0.0}, {3, 10.0}, {6, 0.0}};
    enum { SETTINGS = sizeof settings / sizeof *settings };
    static const options sky = {.sigma_px = 0.1, .pd = 0.99, .false_alarms = 1, .frames = 12};
    static world w;
    bst_ctx ctx = {0};
    bst_tracker *trackers[SETTINGS];
    world_open(&w, 5, &sky);
    for (int i = 0; i < SETTINGS; i++) {
        bst_tracker_config config;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &config));
        config.smoothing_lag_frames = settings[i].lag;
        config.identity_period_s = settings[i].period_s;
        bst_assert_ok(
            &ctx, bst_tracker_create(&ctx, &config, &camera, RATE_HZ, find_star, &w, &trackers[i]));
    }
    for (int k = 0; k < sky.frames; k++) {
        (void)expose(&w, k);
        bst_tracker_input input = make_input(&w, k);
        (void)bst_tracker_step(trackers[0], &input, w.tracks, TRACKS, w.predictions, TRACKS);
    }
    assert_true(w.tracks->target_id != 0);
    for (int i = 0; i < SETTINGS; i++) { /* around: each into the next one */
        bst_tracker *to = trackers[(i + 1) % SETTINGS];
        test_saved saved = test_save(archive_tracker, trackers[i]);
        bst_assert_ok(&ctx, test_restore(&ctx, archive_tracker, to, saved));
        free(saved.bytes);
        assert_int_equal(to->target.id, w.tracks->target_id);
    }
    for (int i = 0; i < SETTINGS; i++) {
        bst_tracker_free(trackers[i]);
    }
    world_close(&w);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(extended_filter),
        cmocka_unit_test(mixtures),
        cmocka_unit_test(two_models),
        cmocka_unit_test(orbits),
        cmocka_unit_test(lost_attitude),
        cmocka_unit_test(into_a_used_tracker),
        cmocka_unit_test(settings_that_change),
        cmocka_unit_test(damage_is_refused_or_another_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
