/* What is done behind the stepping thread: the same messages in the same order. */
#include <pthread.h>
#include <time.h>

#include "tests/engine/fake_module.h"

static const bst_port exposing_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_OUT}};
static const bst_port steering_ports[] = {
    {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_OUT}};
enum { IN_EXPOSURE, IN_NAV, IN_PREDICTIONS, OUT_DETECTIONS };
static const bst_port seeing_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_IN, .max_age_s = 1e-9},
    {.channel = BST_CHANNEL_PREDICTIONS, .direction = BST_PORT_IN, .flags = BST_PORT_FEEDBACK},
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_OUT, .capacity = 1}};
enum { IN_DETECTIONS, IN_NAV_TOO, OUT_TRACKS, OUT_PREDICTIONS };
static const bst_port following_ports[] = {
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_IN},
    {.channel = BST_CHANNEL_TRACKS, .direction = BST_PORT_OUT, .capacity = 1},
    {.channel = BST_CHANNEL_PREDICTIONS, .direction = BST_PORT_OUT, .capacity = 1}};
static const bst_port waiting_ports[] = {
    {.channel = BST_CHANNEL_TRACKS, .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL}};

static const bst_module_desc exposing = FAKE_DESC(exposing_ports);
static const bst_module_desc steering = FAKE_DESC(steering_ports);
static const bst_module_desc waiting = FAKE_DESC(waiting_ports);

typedef struct scene {
    char log[1 << 16];
    size_t used;
    pthread_t stepping;
    bool behind; /* a step was made by another thread */
    bool looks;  /* the module that sees looks ahead */
    int looked, used_looks;
    int busy[BST_STEP_LANES]; /* exposures under way */
    int64_t kept[BST_STEP_LANES], kept_nav[BST_STEP_LANES];
    pthread_mutex_t lanes; /* over busy and looked */
    int64_t fail_at;       /* tick of the follower's failure */
    int64_t full_at;       /* tick from which the hook fails */
    bst_ctx hooks;
} scene;

static bst_status expose(fake *self, struct bst_step *step) {
    bst_exposure *e = bst_step_write(step, 0, NULL);
    *e = (bst_exposure){.id = self->steps, .end_tick = bst_step_tick(step)};
    return BST_OK;
}

static bst_status steer(fake *self, struct bst_step *step) {
    (void)self;
    bst_nav_telemetry *nav = bst_step_write(step, 0, NULL);
    nav->tick = bst_step_tick(step);
    return BST_OK;
}

/* One more or less in a lane; never two. */
static void occupy(scene *s, int lane, int more) {
    pthread_mutex_lock(&s->lanes);
    s->busy[lane] += more;
    assert_in_range(s->busy[lane], 0, 1);
    pthread_mutex_unlock(&s->lanes);
}

/* Notes which exposure it has seen with which telemetry; fails now and then, which the step makes
 * good. */
static bst_status look(void *module, struct bst_step *step) {
    fake *self = module;
    scene *s = self->other;
    int lane = bst_step_lane(step);
    assert_false(pthread_equal(pthread_self(), s->stepping));
    occupy(s, lane, 1);
    nanosleep(&(struct timespec){.tv_nsec = 300000}, NULL);
    bst_sample e = bst_step_next(step, IN_EXPOSURE), nav = bst_step_latest(step, IN_NAV);
    s->kept[lane] = ((const bst_exposure *)e.payload)->id;
    s->kept_nav[lane] = nav.payload ? ((const bst_nav_telemetry *)nav.payload)->tick : -1;
    pthread_mutex_lock(&s->lanes);
    int looked = ++s->looked;
    pthread_mutex_unlock(&s->lanes);
    bst_status status =
        looked % 7 == 3 ? bst_fail(bst_step_ctx(step), BST_ERR_NUMERIC, "not yet") : BST_OK;
    s->kept[lane] = status == BST_OK ? s->kept[lane] : -1;
    occupy(s, lane, -1);
    return status;
}

/* Slow, so that the others run ahead. */
static bst_status see(fake *self, struct bst_step *step) {
    scene *s = self->other;
    s->behind = s->behind || !pthread_equal(pthread_self(), s->stepping);
    int lane = bst_step_lane(step);
    occupy(s, lane, 1);
    nanosleep(&(struct timespec){.tv_nsec = 300000}, NULL);
    for (bst_sample e; (e = bst_step_next(step, IN_EXPOSURE)).payload;) {
        bst_sample nav = bst_step_latest(step, IN_NAV);
        bst_sample guess = bst_step_latest(step, IN_PREDICTIONS);
        bst_detections *d = bst_step_write(step, OUT_DETECTIONS, NULL);
        d->exposure_id = ((const bst_exposure *)e.payload)->id;
        d->start_tick = nav.payload ? ((const bst_nav_telemetry *)nav.payload)->tick : -1;
        d->end_tick = guess.payload ? ((const bst_predictions *)guess.payload)->tick : -1;
        d->stars_identified = nav.stale;
        if (s->kept[lane] == d->exposure_id) {
            s->used_looks++;
            assert_int_equal(s->kept_nav[lane], d->start_tick);
        }
    }
    s->kept[lane] = -1;
    occupy(s, lane, -1);
    return BST_OK;
}

static bst_status follow(fake *self, struct bst_step *step) {
    scene *s = self->other;
    for (bst_sample d; (d = bst_step_next(step, IN_DETECTIONS)).payload;) {
        if (bst_step_tick(step) == s->fail_at) {
            return bst_fail(bst_step_ctx(step), BST_ERR_NUMERIC, "lost");
        }
        bst_sample nav = bst_step_latest(step, IN_NAV_TOO);
        bst_tracks *t = bst_step_write(step, OUT_TRACKS, NULL);
        t->exposure_id = ((const bst_detections *)d.payload)->exposure_id;
        t->tick = ((const bst_nav_telemetry *)nav.payload)->tick;
        ((bst_predictions *)bst_step_write(step, OUT_PREDICTIONS, NULL))->tick = 1000 + t->tick;
        bst_step_event(step, "seen", "%lld", (long long)t->exposure_id);
        bst_step_count(step, "followed");
    }
    return BST_OK;
}

static void note(scene *s, const char *what, long long a, long long b, long long c, long long d) {
    s->used += (size_t)snprintf(s->log + s->used, sizeof s->log - s->used,
                                "%s %lld %lld %lld %lld\n", what, a, b, c, d);
    assert_true(s->used < sizeof s->log);
}

static bst_status keep(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    scene *s = user;
    (void)scope;
    if (tick >= s->full_at) {
        return bst_fail(&s->hooks, BST_ERR_IO, "disk full");
    }
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *d = payload;
        note(s, channel, tick, d->exposure_id, d->start_tick,
             10 * d->end_tick + d->stars_identified);
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        note(s, channel, tick, ((const bst_tracks *)payload)->exposure_id,
             ((const bst_tracks *)payload)->tick, 0);
    } else if (strcmp(channel, BST_CHANNEL_NAV_TELEMETRY) == 0) {
        note(s, channel, tick, ((const bst_nav_telemetry *)payload)->tick, 0, 0);
    } else {
        note(s, channel, tick, 0, 0, 0);
    }
    return BST_OK;
}

static bst_status hear(void *user, int64_t tick, const char *instance, const char *kind,
                       const char *text) {
    note(user, instance, tick, kind[0], atoll(text), 0);
    return BST_OK;
}

/* Runs 2000 ticks; `awaited` adds a module that reads the tracks. */
static bst_status run(scene *s, bst_ctx *ctx, bool overlap, bool awaited) {
    bst_module_desc seeing = FAKE_DESC(seeing_ports), following = FAKE_DESC(following_ports);
    seeing.flags = following.flags = BST_MODULE_DEFERRABLE;
    seeing.ahead = s->looks ? look : NULL;
    s->stepping = pthread_self();
    s->kept[0] = s->kept[1] = -1;
    pthread_mutex_init(&s->lanes, NULL);
    bst_engine *engine = fake_engine(ctx, 1000);
    fake x = {.on_step = expose}, n = {.on_step = steer}, v = {.on_step = see, .other = s},
         f = {.on_step = follow, .other = s}, w = {0};
    fake *px = &x, *pn = &n, *pv = &v, *pf = &f, *pw = &w;
    fake_add(ctx, engine, FAKE_SPEC(following, "a_follow", pf, 0));
    bst_instance_spec seer = FAKE_SPEC(seeing, "b_see", pv, 0);
    seer.delays[0] = (bst_input_delay){IN_EXPOSURE, 7};
    seer.delay_count = 1;
    fake_add(ctx, engine, seer);
    fake_add(ctx, engine, FAKE_SPEC(steering, "n", pn, 3));
    fake_add(ctx, engine, FAKE_SPEC(exposing, "x", px, 20));
    if (awaited) {
        fake_add(ctx, engine, FAKE_SPEC(waiting, "w", pw, 100));
    }
    bst_assert_ok(ctx, bst_engine_load(ctx, engine));
    bst_engine_set_hooks(
        engine, &(bst_engine_hooks){.user = s, .message = keep, .event = hear, .ctx = &s->hooks});
    if (overlap) {
        bst_assert_ok(ctx, bst_engine_parallel(ctx, engine, 1));
    }
    bst_status status = bst_engine_run(ctx, engine, 1000);
    if (status == BST_OK) {
        status = bst_engine_run(ctx, engine, 2000);
    }
    note(s, "counted", fake_counter(engine, "followed"), fake_counter(engine, "stale_input"),
         v.steps, f.steps);
    bst_engine_free(engine);
    pthread_mutex_destroy(&s->lanes);
    return status;
}

static void nothing_but_the_thread_changes(void **state) {
    (void)state;
    static scene serial, overlapped;
    serial = overlapped = (scene){.fail_at = -1, .full_at = INT64_MAX};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, run(&serial, &ctx, false, false));
    bst_assert_ok(&ctx, run(&overlapped, &ctx, true, false));
    assert_false(serial.behind);
    assert_true(overlapped.behind);
    assert_string_equal(overlapped.log, serial.log);
    /* 100 exposures, the last one seen at 1987; telemetry of every third tick, as of tick 27 */
    assert_non_null(strstr(serial.log, "detections 27 2 27 "));
    assert_non_null(strstr(serial.log, "counted 100 "));
}

static void what_is_seen_ahead_is_used(void **state) {
    (void)state;
    static scene serial, ahead;
    serial = ahead = (scene){.looks = true, .fail_at = -1, .full_at = INT64_MAX};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, run(&serial, &ctx, false, false));
    bst_assert_ok(&ctx, run(&ahead, &ctx, true, false));
    assert_int_equal(serial.looked, 0);
    /* how many is up to the threads' scheduling; the exposures wait for their steps */
    assert_true(ahead.looked > 0 && ahead.used_looks > 0);
    assert_string_equal(ahead.log, serial.log);
}

static void what_is_awaited_stays_with_the_stepping_thread(void **state) {
    (void)state;
    static scene s;
    s = (scene){.fail_at = -1, .full_at = INT64_MAX};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, run(&s, &ctx, true, true));
    assert_false(s.behind);
}

static void failures_are_those_of_a_serial_run(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        static scene serial, overlapped;
        serial = overlapped =
            (scene){.looks = true, .fail_at = k ? -1 : 1007, .full_at = k ? 1234 : INT64_MAX};
        bst_ctx a = {0}, b = {0};
        bst_status expected = run(&serial, &a, false, false);
        assert_int_equal(expected, k ? BST_ERR_IO : BST_ERR_NUMERIC);
        assert_int_equal(run(&overlapped, &b, true, false), expected);
        assert_string_equal(b.message, a.message);
        assert_string_equal(a.message, k ? "disk full" : "a_follow at 1.007000 s: lost");
        /* the same was published before; counts may be of more steps ahead */
        *strstr(serial.log, "counted") = *strstr(overlapped.log, "counted") = '\0';
        assert_string_equal(overlapped.log, serial.log);
    }
}

/* Frames whose pixels the hook does not look at are shown without them, and not held for it. */
typedef struct gallery {
    bst_frame frames[128];
    int recycled, shown, bare; /* recycled: atomic */
} gallery;

static void take_back(void *owner) {
    __atomic_fetch_add(&((gallery *)owner)->recycled, 1, __ATOMIC_RELAXED);
}

static bst_status render(fake *self, struct bst_step *step) {
    static const bst_frame_ops ops = {.recycle = take_back};
    gallery *g = self->other;
    bst_frame_message *m = bst_step_write(step, 0, NULL);
    bst_frame *frame = &g->frames[self->steps % 128];
    *frame = (bst_frame){.ops = &ops, .owner = g, .references = 1};
    *m = (bst_frame_message){.frame = frame, .exposure_id = self->steps};
    return BST_OK;
}

static bool wants_pixels(void *user, const char *scope, const char *channel, const void *payload,
                         int64_t tick, bst_hook_mark *mark) {
    (void)user, (void)scope, (void)channel, (void)tick;
    mark->bare = ((const bst_frame_message *)payload)->exposure_id % 4 != 0;
    return true;
}

static bst_status look_at(void *user, const char *scope, const char *channel, const void *payload,
                          int64_t tick) {
    (void)scope, (void)channel, (void)tick;
    gallery *g = user;
    const bst_frame_message *m = payload;
    assert_true((m->frame == NULL) == (m->exposure_id % 4 != 0));
    m->frame ? g->shown++ : g->bare++;
    return BST_OK;
}

static void pixels_are_shown_to_who_looks_at_them(void **state) {
    (void)state;
    static const bst_port ports[] = {{.channel = BST_CHANNEL_FRAME, .direction = BST_PORT_OUT}};
    static const bst_module_desc rendering = FAKE_DESC(ports);
    for (int overlap = 0; overlap < 2; overlap++) {
        bst_ctx ctx = {0};
        gallery g = {.shown = 0};
        bst_engine *engine = fake_engine(&ctx, 1000);
        fake r = {.on_step = render, .other = &g};
        fake *pr = &r;
        fake_add(&ctx, engine, FAKE_SPEC(rendering, "r", pr, 10));
        bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
        bst_engine_set_hooks(
            engine, &(bst_engine_hooks){.user = &g, .message = look_at, .wants = wants_pixels});
        if (overlap) {
            bst_assert_ok(&ctx, bst_engine_parallel(&ctx, engine, 1));
        }
        bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 1000));
        bst_engine_free(engine);
        assert_int_equal(g.shown, 25);
        assert_int_equal(g.bare, 75);
        assert_int_equal(g.recycled, 100);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_but_the_thread_changes),
        cmocka_unit_test(pixels_are_shown_to_who_looks_at_them),
        cmocka_unit_test(what_is_seen_ahead_is_used),
        cmocka_unit_test(what_is_awaited_stays_with_the_stepping_thread),
        cmocka_unit_test(failures_are_those_of_a_serial_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
