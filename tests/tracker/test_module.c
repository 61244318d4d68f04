/* The adapter between channels and tracker, in the real engine: fake image processing publishes
 * detections of the onboard catalogue's stars and of one object. */
#include "tests/engine/onboard.h"
#include "tracker/attitude/photocentre.h"
#include "tracker/module.h"
#include "tracker/tracker.h"

enum { KEPT = 16, ROOM = 256, EXPOSURE = 500, BRIGHT = 60, TEXT = 160 };

static const double PIXEL_RAD = 12.0 * BST_ARCSEC_RAD; /* of the sensor in onboard.h */

typedef struct bench {
    onboard o;
    bst_tracker_config config;
    fake imgproc;
    fake *imgproc_p;
    int64_t repeat_id; /* >= 0: what every frame says it is */
    double drift_px;   /* of the object from frame to frame */
    bst_tracks tracks[KEPT];
    bst_track first[KEPT]; /* of each frame */
    bst_predictions predictions[KEPT];
    int64_t written_at[KEPT];
    int tracks_count, predictions_count, events_count;
    int64_t event_at[KEPT];
    char kinds[KEPT][TEXT], texts[KEPT][TEXT];
} bench;

/* Stars where they are and an object that stands still among them. */
static void fill(const bench *b, int64_t id, int64_t end_tick, bst_detections *d, int capacity) {
    *d = (bst_detections){.exposure_id = b->repeat_id >= 0 ? b->repeat_id : id,
                          .start_tick = end_tick - EXPOSURE,
                          .end_tick = end_tick,
                          .q_cam_from_gcrf = b->o.q_telemetry,
                          .q_telemetry_from_gcrf = b->o.q_telemetry,
                          .background_e = 4.0,
                          .noise_e = 8.0,
                          .threshold_snr = 5.0};
    bst_detection star = {
        .cov_xx = 1e-4, .cov_yy = 1e-4, .snr = 120, .length_px = 2, .width_px = 2};
    star.label = BST_LABEL_STAR;
    for (int i = 0; i < b->o.star_count && d->count < BRIGHT && d->count < capacity - 1; i++) {
        star.x_px = b->o.stars[i].x_px;
        star.y_px = b->o.stars[i].y_px;
        star.v_mag = b->o.stars[i].v_mag;
        star.star_id = b->o.stars[i].id;
        d->items[d->count++] = star;
    }
    d->stars_identified = d->count;
    bst_detection object = star;
    object.x_px = 300.25 + b->drift_px * (double)id;
    object.y_px = 200.75 - 0.5 * b->drift_px * (double)id;
    object.v_mag = 13.0;
    object.star_id = 0;
    object.label = BST_LABEL_OBJECT;
    d->items[d->count++] = object;
}

/* `value` frames at once, exposed one after the other up to now. */
static bst_status write_detections(fake *self, struct bst_step *step) {
    const bench *b = self->other;
    for (int64_t i = 0; i < self->value; i++) {
        int capacity;
        bst_detections *d = bst_step_write(step, 0, &capacity);
        fill(b, self->value2++, bst_step_tick(step) - (self->value - 1 - i) * EXPOSURE, d,
             capacity);
    }
    return BST_OK;
}

static bst_status keep(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    bench *b = user;
    (void)scope;
    if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        assert_true(b->tracks_count < KEPT);
        b->written_at[b->tracks_count] = tick;
        const bst_tracks *tracks = payload;
        b->first[b->tracks_count] = tracks->count > 0 ? tracks->items[0] : (bst_track){0};
        memcpy(&b->tracks[b->tracks_count++], payload, sizeof(bst_tracks));
    } else if (strcmp(channel, BST_CHANNEL_PREDICTIONS) == 0) {
        assert_true(b->predictions_count < KEPT);
        memcpy(&b->predictions[b->predictions_count++], payload, sizeof(bst_predictions));
    }
    return BST_OK;
}

static bst_status keep_event(void *user, int64_t tick, const char *instance, const char *kind,
                             const char *text) {
    bench *b = user;
    if (strstr(instance, "tracker") && b->events_count < KEPT) {
        b->event_at[b->events_count] = tick;
        snprintf(b->kinds[b->events_count], TEXT, "%s", kind);
        snprintf(b->texts[b->events_count++], TEXT, "%s", text);
    }
    return BST_OK;
}

static const bst_port detections_ports[] = {
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_OUT, .capacity = ROOM}};
static const bst_module_desc detections_desc = FAKE_DESC(detections_ports);

static void init(bench *b) {
    memset(b, 0, sizeof *b);
    onboard_init(&b->o);
    b->repeat_id = -1;
    b->imgproc = (fake){.on_step = write_detections, .other = b, .value = 1};
    b->imgproc_p = &b->imgproc;
    bst_assert_ok(&b->o.ctx, bst_config_defaults(&b->o.ctx, bst_tracker_config_table, &b->config));
}

static void load(bench *b, int64_t first, int64_t period) {
    bst_ctx *ctx = &b->o.ctx;
    bst_instance_spec spec = FAKE_SPEC(detections_desc, "imgproc", b->imgproc_p, period);
    spec.offset_ticks = first;
    fake_add(ctx, b->o.engine, spec);
    fake_add(ctx, b->o.engine,
             (bst_instance_spec){.desc = &bst_tracker_module,
                                 .scope = "o/s",
                                 .instance = "tracker",
                                 .config = &b->config,
                                 .world = b->o.world,
                                 .knowledge = b->o.knowledge});
    bst_engine_hooks hooks = {.user = b, .message = keep, .event = keep_event};
    bst_engine_set_hooks(b->o.engine, &hooks);
    bst_assert_ok(ctx, bst_engine_load(ctx, b->o.engine));
}

static void run(bench *b, int64_t until) {
    bst_assert_ok(&b->o.ctx, bst_engine_run(&b->o.ctx, b->o.engine, until));
}

static void end(bench *b) {
    onboard_free(&b->o);
    bst_config_free(bst_tracker_config_table, &b->config);
}

/* Times at which the module asks for the cue; the linker puts this in the function's place. */
static double asked_s[KEPT];
static int asked;
bst_status __real_bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                       bst_onboard_cue *out);
bst_status __wrap_bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                       bst_onboard_cue *out);
bst_status __wrap_bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                       bst_onboard_cue *out) {
    asked_s[asked++ % KEPT] = seconds;
    return __real_bst_knowledge_cue_at(ctx, view, seconds, out);
}

/* Stars for whose companions the module asks. */
static int photocentres, companions;
bst_vec3 __real_bst_photocentre(const bst_star *star, const bst_star *near, int count,
                                double radius_rad);
bst_vec3 __wrap_bst_photocentre(const bst_star *star, const bst_star *near, int count,
                                double radius_rad);
bst_vec3 __wrap_bst_photocentre(const bst_star *star, const bst_star *near, int count,
                                double radius_rad) {
    photocentres++;
    /* one image: within the onboard camera's FWHM, 2 px */
    bst_assert_close(radius_rad, 2.0 * PIXEL_RAD, 1e-12);
    bool itself = false;
    for (int i = 0; i < count; i++) {
        assert_true(bst_vec3_angle(near[i].icrs, star->icrs) <= 1.001 * radius_rad);
        assert_true(near[i].v_mag <= star->v_mag + 6.0f);
        itself = itself || near[i].id == star->id;
        companions += near[i].id != star->id;
    }
    assert_true(itself);
    return __real_bst_photocentre(star, near, count, radius_rad);
}

/* Events of a script in place of the tracker's own. */
static const bst_tracker_event *script;
static int script_count;
const bst_tracker_event *__real_bst_tracker_events(const bst_tracker *tracker, int *count);
const bst_tracker_event *__wrap_bst_tracker_events(const bst_tracker *tracker, int *count);
const bst_tracker_event *__wrap_bst_tracker_events(const bst_tracker *tracker, int *count) {
    *count = script_count;
    return script ? script : __real_bst_tracker_events(tracker, count);
}

/* Tracks and predictions for every frame, at its tick; telemetry's error comes out of the stars and
 * is handed back through the predictions. */
static void one_answer_per_frame(void **state) {
    (void)state;
    const bst_vec3 error = {-0.8 * PIXEL_RAD, 1.5 * PIXEL_RAD, 1e-4};
    bench b;
    init(&b);
    asked = 0;
    onboard_set_error(&b.o, error);
    onboard_add_telemetry(&b.o, 0, 0);
    load(&b, 1000, 1000);
    run(&b, 6001);
    assert_int_equal(b.tracks_count, 6);
    assert_int_equal(b.predictions_count, 6);
    for (int i = 0; i < 6; i++) {
        const bst_tracks *t = &b.tracks[i];
        assert_int_equal(b.written_at[i], 1000 * (i + 1));
        assert_int_equal(t->exposure_id, i);
        assert_int_equal(t->tick, 1000 * (i + 1) - EXPOSURE / 2);
        assert_true(t->attitude.valid);
        assert_true(t->attitude.stars >= 15);
        /* the detections lie where the catalogue's apparent places project to: rounding of the
         * least squares, far below the 1e-8 rad that 20 stars of 0.01 px would give */
        bst_assert_close(t->attitude.error_cam_rad.x, error.x, 1e-9);
        bst_assert_close(t->attitude.error_cam_rad.y, error.y, 1e-9);
        bst_assert_close(t->attitude.error_cam_rad.z, error.z, 1e-7);
        const bst_predictions *p = &b.predictions[i];
        assert_true(p->attitude_valid);
        /* telemetry is constant: to mid-exposure or now makes no difference; a hundredth pixel */
        double dt = (double)(1000 * (i + 1) - p->tick) / ONBOARD_RATE;
        bst_vec3 now =
            bst_vec3_axpy(p->attitude_error_cam_rad, dt, p->attitude_error_rate_cam_radps);
        bst_assert_close(now.x, error.x, 0.01 * PIXEL_RAD);
        bst_assert_close(now.y, error.y, 0.01 * PIXEL_RAD);
    }
    /* the cue is that of the middle of the exposure */
    assert_int_equal(asked, 6);
    for (int i = 0; i < 6; i++) {
        bst_assert_close(asked_s[i], (1000 * (i + 1) - 0.5 * EXPOSURE) / ONBOARD_RATE, 1e-12);
    }
    /* the object that stands still is a track */
    assert_int_equal(b.tracks[5].count, 1);
    assert_int_equal(fake_counter(b.o.engine, "tracker_frame_ignored"), 0);
    end(&b);
}

/* What an event says of a track is what the track's message of that frame says. */
static void events_are_of_their_tracks(void **state) {
    (void)state;
    bench b;
    init(&b);
    photocentres = companions = 0;
    b.drift_px = 0.4;
    onboard_set_error(&b.o, (bst_vec3){0.4 * PIXEL_RAD, 0.3 * PIXEL_RAD, 0.0});
    onboard_add_telemetry(&b.o, 0, 0);
    load(&b, 1000, 1000);
    run(&b, 9001);
    int seen = 0;
    for (int i = 0; i < b.events_count; i++) {
        long long id;
        double ra, dec, rate, v;
        if (sscanf(b.texts[i], "track %lld at RA %lf Dec %lf deg, %lf arcsec/s, V %lf", &id, &ra,
                   &dec, &rate, &v) != 5) {
            continue;
        }
        const bst_track *track = NULL;
        for (int k = 0; k < b.tracks_count; k++) {
            bool is = b.written_at[k] == b.event_at[i] && b.first[k].id == id;
            track = is ? &b.first[k] : track;
        }
        assert_non_null(track);
        bst_vec3 d = track->direction_gcrf;
        double ra_deg = atan2(d.y, d.x) / BST_DEG_RAD;
        bst_assert_close(ra, ra_deg < 0.0 ? ra_deg + 360.0 : ra_deg, 6e-6); /* digits shown */
        bst_assert_close(dec, asin(d.z) / BST_DEG_RAD, 6e-6);
        bst_assert_close(rate, bst_vec3_norm(track->rate_gcrf_radps) / BST_ARCSEC_RAD, 6e-4);
        bst_assert_close(v, track->v_mag, 6e-3);
        bst_assert_close(v, 13.0, 0.1);
        seen++;
    }
    print_message("%d of %d events, %d stars, %d companions\n", seen, b.events_count, photocentres,
                  companions);
    assert_true(seen > 0 && b.events_count > 0 && photocentres > 50);
    end(&b);
}

/* Each number of an event is where its text has it. */
static void texts_of_events(void **state) {
    (void)state;
    static const struct {
        bst_tracker_event_kind kind;
        const char *name, *text;
    } all[] = {
        {BST_TRACKER_TRACK_CONFIRMED, "track_confirmed",
         "track 11 at RA 210.00000 Dec -35.00000 deg, 2.500 arcsec/s, V 9.25"},
        {BST_TRACKER_TRACK_LOST, "track_lost",
         "track 11 at RA 210.00000 Dec -35.00000 deg, 2.500 arcsec/s, V 9.25"},
        {BST_TRACKER_TRACK_RESUMED, "track_resumed",
         "track 11 at RA 210.00000 Dec -35.00000 deg, 2.500 arcsec/s, V 9.25"},
        {BST_TRACKER_TARGET_SELECTED, "target_selected",
         "track 11 at RA 210.00000 Dec -35.00000 deg, 2.500 arcsec/s, V 9.25"},
        {BST_TRACKER_TARGET_LOST, "target_lost", "track 11"},
        {BST_TRACKER_ATTITUDE_LOST, "attitude_lost", "no attitude from stars that is good enough"},
        {BST_TRACKER_MANOEUVRE, "manoeuvre", "track 11, chi-square 0.7 of 2, V 9.25"},
        {BST_TRACKER_BRIGHTNESS_CHANGE, "brightness_change",
         "track 11, chi-square 0.7 of 1, V 9.25"},
        {BST_TRACKER_TARGET_AMBIGUOUS, "target_ambiguous",
         "track 11 with probability 0.703, track 17 with 0.125"},
        {BST_TRACKER_TARGET_RESOLVED, "target_resolved", "track 11 with probability 0.703"}};
    enum { ALL = sizeof all / sizeof all[0] };
    bst_tracker_event events[ALL];
    for (int i = 0; i < ALL; i++) {
        const double ra = 210.0 * BST_DEG_RAD, dec = -35.0 * BST_DEG_RAD;
        events[i] = (bst_tracker_event){
            .kind = all[i].kind,
            .track_id = 11,
            .direction_gcrf = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)},
            .rate_gcrf_radps = {1.5 * BST_ARCSEC_RAD, 0.0, -2.0 * BST_ARCSEC_RAD},
            .v_mag = 9.25,
            .statistic = 0.703,
            .rival_id = 17,
            .rival_probability = 0.125};
    }
    bench b;
    init(&b);
    onboard_add_telemetry(&b.o, 0, 0);
    script = events;
    script_count = ALL;
    load(&b, 1000, 1000);
    run(&b, 1001);
    script = NULL;
    assert_int_equal(b.events_count, ALL);
    for (int i = 0; i < ALL; i++) {
        assert_string_equal(b.kinds[i], all[i].name);
        assert_string_equal(b.texts[i], all[i].text);
    }
    end(&b);
}

static void all_waiting_frames_are_taken_in_order(void **state) {
    (void)state;
    bench b;
    init(&b);
    b.imgproc.value = 3;
    onboard_add_telemetry(&b.o, 0, 0);
    load(&b, 2000, 2000);
    run(&b, 4001);
    assert_int_equal(b.tracks_count, 6);
    assert_int_equal(b.predictions_count, 6);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(b.tracks[i].exposure_id, i);
        assert_int_equal(b.written_at[i], i < 3 ? 2000 : 4000);
    }
    assert_int_equal(fake_counter(b.o.engine, "queue_overflow"), 0);
    end(&b);
}

static void a_frame_that_came_before_is_ignored(void **state) {
    (void)state;
    bench b;
    init(&b);
    b.repeat_id = 7;
    onboard_add_telemetry(&b.o, 0, 0);
    load(&b, 1000, 1000);
    run(&b, 3001);
    assert_int_equal(b.tracks_count, 1);
    assert_int_equal(b.predictions_count, 1);
    assert_int_equal(fake_counter(b.o.engine, "tracker_frame_ignored"), 2);
    end(&b);
}

/* Without navigation, not yet or no longer, nothing is published and the frame is counted. */
static void no_navigation(void **state) {
    (void)state;
    bench b;
    init(&b);
    onboard_add_telemetry(&b.o, 0, 2500);
    load(&b, 1000, 1000);
    run(&b, 3001);
    assert_int_equal(b.tracks_count, 1);
    assert_int_equal(b.tracks[0].exposure_id, 2);
    assert_int_equal(fake_counter(b.o.engine, "tracker_no_navigation"), 2);
    end(&b);

    init(&b);
    b.o.navigation.value = 1000; /* the last; the greatest age is 60 s */
    onboard_add_telemetry(&b.o, 0, 0);
    load(&b, 61000, 1);
    run(&b, 61002);
    assert_int_equal(b.tracks_count, 1);
    assert_int_equal(fake_counter(b.o.engine, "tracker_no_navigation"), 1);
    assert_int_equal(fake_counter(b.o.engine, "stale_input"), 1);
    end(&b);
}

/* Pointing telemetry is optional: the detections carry the exposure's. */
static void no_pointing(void **state) {
    (void)state;
    const bst_vec3 error = {-0.8 * PIXEL_RAD, 1.5 * PIXEL_RAD, 0.0};
    for (int which = 0; which < 2; which++) {
        bench b;
        init(&b);
        onboard_set_error(&b.o, error);
        if (which == 0) { /* it has no writer */
            fake_add(&b.o.ctx, b.o.engine,
                     FAKE_SPEC(onboard_nav_desc, "nav", b.o.navigation_p, 100));
        } else { /* not yet */
            onboard_add_telemetry(&b.o, 100000, 0);
        }
        load(&b, 1000, 1000);
        run(&b, 2001);
        assert_int_equal(b.tracks_count, 2);
        assert_true(b.tracks[1].attitude.valid);
        assert_true(b.predictions[1].attitude_valid);
        bst_assert_close(b.predictions[1].attitude_error_cam_rad.y, error.y, 0.01 * PIXEL_RAD);
        end(&b);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_answer_per_frame),
        cmocka_unit_test(events_are_of_their_tracks),
        cmocka_unit_test(texts_of_events),
        cmocka_unit_test(all_waiting_frames_are_taken_in_order),
        cmocka_unit_test(a_frame_that_came_before_is_ignored),
        cmocka_unit_test(no_navigation),
        cmocka_unit_test(no_pointing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
