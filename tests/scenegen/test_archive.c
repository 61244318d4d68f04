/* A renderer that is saved between any two exposures and restored elsewhere goes on to the bit. */
#include "boresight/stages.h"
#include "tests/archive_support.h"
#include "tests/scenegen/module_support.h"

enum { MOST = 8 };
static const bst_window whole = {0, 0, SIDE, SIDE};

/* One exposure of a sequence. */
typedef struct shot {
    bst_window window;
    double jitter_px, scale_arcsec;
    int binning;
    bool dropped;
} shot;

/* What a step of the module published and counted. */
typedef struct published {
    size_t pixels;
    uint16_t *dn; /* [pixels]; NULL: no frame */
    bst_truth *truth;
    size_t truth_bytes;
    int saturated;
} published;

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_device *device;
    struct bst_step step;
    void *config;
    const shot *shots;
    int count;
} scene;

static const bst_module_desc *const desc = &bst_scenegen_module;

static void begin(scene *s, const char *sensor, const shot *shots, int count) {
    memset(s, 0, sizeof *s);
    bst_assert_ok(&s->ctx, bst_device_open(&s->ctx, "", 0, &s->device));
    s->world = make_world(&s->ctx, sensor);
    s->step = (struct bst_step){.ctx = &s->ctx, .history = make_history()};
    s->config = calloc(1, desc->config_bytes);
    bst_assert_ok(&s->ctx, bst_config_defaults(&s->ctx, desc->config, s->config));
    s->shots = shots;
    s->count = count;
}

static void end(scene *s) {
    bst_world_free(s->world);
    bst_device_close(s->device);
    free(s->config);
    free(s->step.history);
    free(s->step.truth);
}

static void *make_module(scene *s) {
    const bst_module_env env = {.ctx = &s->ctx,
                                .instance = "obs/cam/scenegen",
                                .tick_rate_hz = RATE,
                                .seed = 1,
                                .world = s->world,
                                .device = s->device,
                                .engine_private = &s->step};
    void *self;
    bst_assert_ok(&s->ctx, desc->create(&env, s->config, &self));
    return self;
}

/* Steps the module with exposure k of the sequence. */
static published take(scene *s, void *self, int k) {
    const shot *e = &s->shots[k];
    struct bst_step *step = &s->step;
    bst_exposure exposure = {.id = 100 + k,
                             .start_tick = 40 + 3 * k,
                             .end_tick = 340 + 3 * k,
                             .window = e->window,
                             .binning = e->binning > 1 ? e->binning : 1,
                             .pixel_scale_arcsec = e->scale_arcsec,
                             .dropped = e->dropped};
    step->history->jitter_rad2 = pow(e->jitter_px * 12.0 * BST_ARCSEC_RAD, 2);
    step->exposure = &exposure;
    step->frame_written = step->truth_written = false;
    step->saturated = 0;
    bst_assert_ok(&s->ctx, desc->step(self, step));
    assert_true(step->truth_written && step->frame_written == !e->dropped);
    published p = {.saturated = step->saturated};
    p.truth_bytes = sizeof *p.truth + (size_t)step->truth->count * sizeof step->truth->items[0];
    p.truth = malloc(p.truth_bytes);
    memcpy(p.truth, step->truth, p.truth_bytes);
    if (!e->dropped) {
        bst_frame *frame = step->frame.frame;
        const uint16_t *dn;
        bst_assert_ok(&s->ctx, bst_frame_map(frame, &s->ctx, &dn));
        p.pixels = (size_t)frame->width * (size_t)frame->height;
        p.dn = malloc(p.pixels * sizeof *p.dn);
        memcpy(p.dn, dn, p.pixels * sizeof *p.dn);
        bst_frame_unmap(frame);
        bst_frame_release(frame);
    }
    return p;
}

static void expect_same(const published *a, const published *b) {
    assert_int_equal(a->pixels, b->pixels);
    assert_int_equal(a->truth_bytes, b->truth_bytes);
    assert_memory_equal(a->truth, b->truth, a->truth_bytes);
    if (a->dn) {
        assert_memory_equal(a->dn, b->dn, a->pixels * sizeof *a->dn);
    }
    assert_int_equal(a->saturated, b->saturated);
}

static void forget(published *p) {
    free(p->dn);
    free(p->truth);
}

/* Frames that finish counts. */
static int finish(scene *s, void *self) {
    s->step.saturated = 0;
    bst_assert_ok(&s->ctx, desc->finish(self, &s->step));
    return s->step.saturated;
}

/* Restores the state before exposure k and goes on to the end as the first module did. */
static void go_on(scene *s, void *self, test_saved saved, int k, const published *expected,
                  int last) {
    bst_assert_ok(&s->ctx, test_restore(&s->ctx, desc->archive, self, saved));
    for (; k < s->count; k++) {
        published p = take(s, self, k);
        expect_same(&expected[k], &p);
        forget(&p);
    }
    assert_int_equal(finish(s, self), last);
}

/* Runs the sequence and saves the state before each exposure. Then restores the state before each
 * exposure of `from` (bits) into one other module in turn, the last one into a new module. */
static int play_and_restore(scene *s, unsigned from) {
    published expected[MOST];
    test_saved saved[MOST + 1];
    void *self = make_module(s), *plain = make_module(s);
    int saturated = 0, latest = 0;
    for (int k = 0; k <= s->count; k++) {
        saved[k] = test_save(desc->archive, self);
        if (k < s->count) {
            expected[k] = take(s, self, k);
            saturated += expected[k].saturated;
            published p =
                take(s, plain, k); /* a module that is never saved: saving changes nothing */
            expect_same(&expected[k], &p);
            forget(&p);
        }
    }
    int last = finish(s, self);
    assert_int_equal(finish(s, plain), last);
    desc->destroy(plain);
    desc->destroy(self);
    void *other = make_module(s);
    for (int k = 0; k <= s->count; k++) {
        if (from & 1u << k) {
            go_on(s, other, saved[k], k, expected, last);
            latest = k;
        }
    }
    desc->destroy(other);
    other = make_module(s);
    go_on(s, other, saved[latest], latest, expected, last);
    desc->destroy(other);
    for (int k = 0; k <= s->count; k++) {
        free(saved[k].bytes);
        if (k < s->count) {
            forget(&expected[k]);
        }
    }
    return saturated + last;
}

/* Jitter and plate scale change; charge overflows; saturated frames are in progress when the state
 * is saved. */
static void any_exposure(void **state) {
    (void)state;
    static const shot shots[] = {{.window = whole},
                                 {.window = whole, .jitter_px = 1.5},
                                 {.window = {64, 32, 200, 150}, .jitter_px = 1.5, .binning = 2},
                                 {.window = whole, .dropped = true},
                                 {.window = whole, .scale_arcsec = 9.0},
                                 {.window = whole}};
    scene s;
    begin(&s,
          "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
          "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 3e4, "
          "\"detector\": {\"saturation\": \"bloom\", \"row_noise_e\": 3, "
          "\"persistence\": {\"trapped_share\": [0.1, 0, 0.2, 0, 0]}, "
          "\"cosmic_rays\": {\"rate_per_cm2_s\": 40}}, "
          "\"background\": {\"gradient_e_per_s\": [20, -10], \"stray_e_per_s\": 40}}}",
          shots, 6);
    /* before and after each change, in the middle, and when only finish is left */
    assert_true(play_and_restore(&s, 1u << 6 | 1u << 1 | 1u << 2 | 1u << 4) >= 4);
    end(&s);
}

/* Diffraction: grids of the Fourier path for several windows; rows exposed in turn. */
static void other_paths(void **state) {
    (void)state;
    static const shot shots[] = {{.window = whole},
                                 {.window = {100, 60, 128, 96}},
                                 {.window = {100, 60, 128, 96}, .binning = 2},
                                 {.window = whole}};
    scene s;
    begin(&s,
          "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
          "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 3e4, "
          "\"optics\": {\"psf\": \"diffraction\", \"q\": 1.2}, "
          "\"detector\": {\"row_time_s\": 2e-5}}}",
          shots, 4);
    assert_true(play_and_restore(&s, 1u << 1 | 1u << 3) >= 1);
    end(&s);
}

static void damaged_states(void **state) {
    (void)state;
    static const shot shots[] = {{.window = whole}};
    scene s;
    begin(&s,
          "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
          "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 3e4}}",
          shots, 1);
    void *self = make_module(&s);
    published p = take(&s, self, 0);
    forget(&p);
    test_saved saved = test_save(desc->archive, self);
    test_restore_damaged(desc->archive, self, saved, 1);
    free(saved.bytes);
    desc->destroy(self);
    end(&s);
}

/* ---- A plug-in's stage that remembers how many frames it has changed */

typedef struct counter {
    int64_t frames;
} counter;

static bst_status counter_create(bst_ctx *ctx, const void *config, const bst_frame_stage_env *env,
                                 void **self) {
    (void)config;
    (void)env;
    *self = calloc(1, sizeof(counter));
    return *self ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a counter");
}

static bst_status counter_apply(void *self, bst_ctx *ctx, const bst_frame_stage_frame *f,
                                uint16_t *pixels) {
    counter *c = self;
    (void)ctx;
    (void)f;
    pixels[0] = (uint16_t)++c->frames;
    return BST_OK;
}

static bst_status counter_archive(void *self, bst_archive *archive) {
    counter *c = self;
    c->frames = bst_archive_integer(archive, c->frames, 0, 1000);
    return BST_OK;
}

/* The member of the module's configuration, by its table. */
static bst_stage_use *stage_of(scene *s) {
    const bst_config_desc *d = desc->config;
    while (strcmp(d->key, "frame_stage") != 0) {
        d++;
    }
    return (bst_stage_use *)((char *)s->config + d->offset);
}

static void stages(void **state) {
    (void)state;
    static const shot shots[] = {{.window = whole}, {.window = whole}};
    static const bst_frame_stage with = {counter_create, counter_apply, free, counter_archive};
    static const bst_frame_stage without = {counter_create, counter_apply, free, NULL};
    bst_stage_desc stage = {.abi = BST_STAGE_ABI, .kind = BST_STAGE_FRAME, .type = "counter"};
    scene s;
    begin(&s,
          "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
          "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 3e4}}",
          shots, 2);
    stage.functions = &with;
    bst_stage_use *use = stage_of(&s);
    *use = (bst_stage_use){.plugin = "/lib/counter.so", .desc = &stage};
    assert_true(play_and_restore(&s, 1u << 1) >= 0);
    stage.functions = &without;
    void *self = make_module(&s);
    bst_archive *archive;
    bst_assert_ok(&s.ctx, bst_archive_create(&s.ctx, &archive));
    bst_assert_ok(&s.ctx, bst_archive_begin(&s.ctx, archive, "it"));
    assert_int_equal(desc->archive(self, archive), BST_ERR_STATE);
    assert_non_null(strstr(s.ctx.message, "/lib/counter.so"));
    bst_archive_free(archive);
    desc->destroy(self);
    end(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_exposure),
        cmocka_unit_test(other_paths),
        cmocka_unit_test(damaged_states),
        cmocka_unit_test(stages),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
