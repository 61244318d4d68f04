/* The exposure clock inside a simulation: exact ticks, latching, clipping, dropped frames. */
#include "boresight/boresight.h"
#include "sim/engine/kernel/exposure_clock.h"
#include "sim/engine/simulation_state.h"
#include "tests/test_support.h"

#include <unistd.h>

/* A control that writes one sensor_command at a tick of the test's choice. */
typedef struct commander {
    double exposure_s, period_s, pixel_scale_arcsec;
    int64_t at_tick, x0, y0, width, height, binning;
} commander;

static const bst_config_desc commander_table[] = {
    BST_REAL(commander, exposure_s, "s", -1, 1e300, "0", "Exposure."),
    BST_REAL(commander, period_s, "s", -1, 1e300, "0", "Period."),
    BST_REAL(commander, pixel_scale_arcsec, "arcsec", -1, 100, "0", "Scale."),
    BST_INT(commander, at_tick, "", 0, 1e9, "0", "When."),
    BST_INT(commander, x0, "px", -2147483647, 2147483647, "0", "Window."),
    BST_INT(commander, y0, "px", -2147483647, 2147483647, "0", "Window."),
    BST_INT(commander, width, "px", 0, 2147483647, "0", "Window."),
    BST_INT(commander, height, "px", 0, 2147483647, "0", "Window."),
    BST_INT(commander, binning, "px", 0, 16, "0", "Binning."),
    BST_CONFIG_END};

static bst_status commander_create(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    *self = (void *)(uintptr_t)config; /* read only */
    return BST_OK;
}

static bst_status commander_step(void *self, struct bst_step *step) {
    const commander *c = self;
    if (bst_step_tick(step) < c->at_tick) {
        bst_step_wake_at(step, c->at_tick);
        return BST_OK;
    }
    bst_sensor_command *out = bst_step_write(step, 0, NULL);
    *out = (bst_sensor_command){c->exposure_s,
                                c->period_s,
                                {(int)c->x0, (int)c->y0, (int)c->width, (int)c->height},
                                (int)c->binning,
                                c->pixel_scale_arcsec};
    return BST_OK;
}

static void commander_destroy(void *self) {
    (void)self;
}

static bst_status commander_archive(void *self, bst_archive *archive) {
    return self && archive ? BST_OK : BST_ERR_ARGUMENT; /* the engine knows when it writes */
}

static const bst_port commander_ports[] = {
    {.channel = BST_CHANNEL_SENSOR_COMMAND, .direction = BST_PORT_OUT}};
static const bst_module_desc commander_module = {.abi = BST_MODULE_ABI,
                                                 .role = "control",
                                                 .type = "commander",
                                                 .doc = "Writes one sensor command.",
                                                 .config = commander_table,
                                                 .config_bytes = sizeof(commander),
                                                 .ports = commander_ports,
                                                 .port_count = 1,
                                                 .create = commander_create,
                                                 .step = commander_step,
                                                 .archive = commander_archive,
                                                 .destroy = commander_destroy};
static const bst_module_desc *const modules[] = {&commander_module};
static const bst_scenario_registry registry = {.modules = modules, .count = 1};

typedef struct train {
    bst_exposure items[400];
    int64_t ticks[400];
    int count;
} train;

static bst_status keep(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    train *l = user;
    if (strcmp(channel, BST_CHANNEL_EXPOSURE) == 0) {
        assert_string_equal(scope, "sat/cam");
        assert_true(l->count < 400);
        l->ticks[l->count] = tick;
        l->items[l->count++] = *(const bst_exposure *)payload;
    }
    return BST_OK;
}

/* Where a run is saved, or from where it goes on. */
typedef struct saving {
    int64_t tick;
    bst_archive *archive;
} saving;

static bst_status restore(bst_ctx *ctx, bst_simulation *sim, void *user) {
    return bst_simulation_archive(ctx, sim, user, BST_STATE_ALL);
}

/* Runs a scenario whose sensor has these "exposure" and "modules" blocks, and more keys of its
 * camera, up to a tick or to that of `save`, from `from`; NULL allowed. */
static bst_status try_part(bst_ctx *ctx, const char *camera, const char *exposure,
                           const char *module_block, const char *extra, int64_t until_tick,
                           const saving *save, const saving *from, train *out) {
    static const char format[] =
        "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 300, %s"
        "\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": \"sat\","
        "\"orbit\": {\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089},"
        "\"sensors\": [{\"name\": \"cam\", \"camera\": {\"width_px\": 640, \"height_px\": 480,"
        "\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15%s}, \"exposure\": {%s}, \"modules\": "
        "{%s}}]}]}";
    char text[2000];
    snprintf(text, sizeof text, format, extra, camera, exposure, module_block);
    bst_json *json = NULL;
    bst_assert_ok(ctx, bst_json_parse(ctx, "scenarios/x.json", text, strlen(text), &json));
    bst_scenario scenario;
    bst_assert_ok(ctx, bst_scenario_read(ctx, json, &registry, &scenario));
    bst_simulation *sim = NULL;
    bst_simulation_options options = {.restore = from ? restore : NULL,
                                      .restore_user = from ? from->archive : NULL};
    bst_status status = bst_simulation_create(ctx, &scenario, &options, &sim);
    memset(out, 0, sizeof *out);
    if (status == BST_OK) {
        assert_null(bst_simulation_device(sim)); /* none was asked for */
        bst_engine *engine = bst_simulation_engine(sim);
        bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = out, .message = keep});
        if (save) {
            bst_assert_ok(ctx, bst_engine_advance(ctx, engine, save->tick));
            bst_assert_ok(ctx, bst_simulation_archive(ctx, sim, save->archive, BST_STATE_ALL));
        } else {
            bst_assert_ok(ctx, bst_engine_run(ctx, engine, until_tick));
        }
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

static bst_status try_camera(bst_ctx *ctx, const char *camera, const char *exposure,
                             const char *module_block, const char *extra, int64_t until_tick,
                             train *out) {
    return try_part(ctx, camera, exposure, module_block, extra, until_tick, NULL, NULL, out);
}

static void run_camera(const char *camera, const char *exposure, const char *module_block,
                       const char *extra, int64_t until_tick, train *out) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, try_camera(&ctx, camera, exposure, module_block, extra, until_tick, out));
}

static void run(const char *exposure, const char *module_block, const char *extra,
                int64_t until_tick, train *out) {
    run_camera("", exposure, module_block, extra, until_tick, out);
}

static void expect_train(const train *l, int count, int64_t first, int64_t exposure,
                         int64_t cycle) {
    assert_int_equal(l->count, count);
    for (int i = 0; i < count; i++) {
        const bst_exposure *e = &l->items[i];
        assert_int_equal(e->id, i);
        assert_int_equal(e->start_tick, first + i * cycle);
        assert_int_equal(e->end_tick, e->start_tick + exposure);
        assert_int_equal(l->ticks[i], e->end_tick); /* published when it ends */
        assert_false(e->dropped);
        assert_int_equal(e->window.width, 640);
        assert_int_equal(e->window.height, 480);
        assert_int_equal(e->window.x0, 0);
        assert_int_equal(e->binning, 1);
    }
}

static void exposures_start_and_end_at_exact_ticks(void **state) {
    (void)state;
    train l;
    run("\"exposure_s\": 0.5, \"period_s\": 1", "", "", 1800000, &l);
    expect_train(&l, 300, 0, 3000, 6000);
    run("\"exposure_s\": 0.5, \"period_s\": 1, \"first_s\": 2.5", "", "", 1800000, &l);
    expect_train(&l, 297, 15000, 3000, 6000);
    /* back to back */
    run("\"exposure_s\": 0.25, \"period_s\": 0.25", "", "", 60001, &l);
    expect_train(&l, 40, 0, 1500, 1500);
    /* longer than its period: the next starts when it ends */
    run("\"exposure_s\": 2, \"period_s\": 0.5", "", "", 60001, &l);
    expect_train(&l, 5, 0, 12000, 12000);
    /* no length */
    run("\"exposure_s\": 0, \"period_s\": 1", "", "", 60001, &l);
    expect_train(&l, 11, 0, 0, 6000);
}

/* The end of a run is exclusive: an exposure that ends in the last tick is published, one that ends
 * with the run is not. */
static void the_last_frame_ends_before_the_run(void **state) {
    (void)state;
    train l;
    run("\"exposure_s\": 1, \"period_s\": 1", "", "", 12000, &l);
    expect_train(&l, 1, 0, 6000, 6000);
    run("\"exposure_s\": 1, \"period_s\": 1", "", "", 12001, &l);
    expect_train(&l, 2, 0, 6000, 6000);
}

/* A command during an exposure counts from the next one's start. */
static void commands_are_latched_at_the_start(void **state) {
    (void)state;
    train l;
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"at_tick\": 7000, \"exposure_s\": 0.1, "
        "\"period_s\": 2, \"binning\": 2, \"x0\": 10, \"y0\": 20, \"width\": 30, \"height\": 40}",
        "", 60000, &l);
    const int64_t starts[] = {0, 6000, 12000, 24000, 36000, 48000};
    assert_int_equal(l.count, 6);
    for (int i = 0; i < 6; i++) {
        const bst_exposure *e = &l.items[i];
        assert_int_equal(e->start_tick, starts[i]);
        assert_int_equal(e->end_tick - e->start_tick, i < 2 ? 3000 : 600);
        assert_int_equal(e->binning, i < 2 ? 1 : 2);
        assert_int_equal(e->window.x0, i < 2 ? 0 : 10);
        assert_int_equal(e->window.y0, i < 2 ? 0 : 20);
        assert_int_equal(e->window.width, i < 2 ? 640 : 30);
        assert_int_equal(e->window.height, i < 2 ? 480 : 40);
    }
    /* written in the very tick of a start: seen one tick later, so it counts for the next */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"at_tick\": 6000, \"binning\": 2}", "", 20000, &l);
    assert_int_equal(l.items[1].binning, 1);
    assert_int_equal(l.items[2].binning, 2);
    /* one tick earlier it counts */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"at_tick\": 5999, \"binning\": 2}", "", 20000, &l);
    assert_int_equal(l.items[1].binning, 2);
}

static void odd_commands_do_no_harm(void **state) {
    (void)state;
    train l;
    /* partly outside: clipped */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"x0\": -20, \"y0\": 400, \"width\": 100, "
        "\"height\": 2147483647}",
        "", 20000, &l);
    const bst_window *w = &l.items[2].window;
    assert_int_equal(w->x0, 0);
    assert_int_equal(w->width, 80);
    assert_int_equal(w->y0, 400);
    assert_int_equal(w->height, 80);
    /* wholly outside: the full sensor */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"x0\": 700, \"y0\": 0, \"width\": 100, "
        "\"height\": 100}",
        "", 20000, &l);
    assert_int_equal(l.items[2].window.width, 640);
    /* a binning that leaves no pixel of the window */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"x0\": 600, \"y0\": 0, \"width\": 100, "
        "\"height\": 9, \"binning\": 16}",
        "", 20000, &l);
    assert_int_equal(l.items[2].binning, 9);
    /* an exposure and period shorter than half a tick, straight after another: one a tick */
    run("\"exposure_s\": 0.5, \"period_s\": 0.5",
        "\"control\": {\"type\": \"commander\", \"exposure_s\": 1e-9, \"period_s\": 1e-9, "
        "\"at_tick\": 10}",
        "", 3100, &l);
    assert_int_equal(l.count, 101);
    assert_int_equal(l.items[1].start_tick, 3000);
    assert_int_equal(l.items[1].end_tick, 3000);
    assert_int_equal(l.items[100].start_tick, 3099);
    /* absurdly long: a day at most, and no overflow */
    run("\"exposure_s\": 0.5, \"period_s\": 1",
        "\"control\": {\"type\": \"commander\", \"exposure_s\": 1e300, \"period_s\": 1e300}", "",
        1800000, &l);
    assert_int_equal(l.count, 1);
}

/* Exposures are those of the middle row; they are published when the last row's is over, and the
 * next one's first row waits for that. */
static void rolling_shutters_take_their_time(void **state) {
    (void)state;
    static const char rolling[] = ", \"detector\": {\"row_time_s\": 1e-4}",
                      backwards[] = ", \"detector\": {\"row_time_s\": -1e-4}";
    const int64_t lead = 144; /* 239.5 rows of 0.1 ms: 143.7 ticks */
    for (int way = 0; way < 2; way++) {
        const char *camera = way ? backwards : rolling;
        train l;
        run_camera(camera, "\"exposure_s\": 0.5, \"period_s\": 1, \"first_s\": 0.024", "", "",
                   60001, &l);
        assert_int_equal(l.count, 10);
        for (int i = 0; i < l.count; i++) {
            assert_int_equal(l.items[i].start_tick, lead + i * 6000);
            assert_int_equal(l.items[i].end_tick, l.items[i].start_tick + 3000);
            assert_int_equal(l.ticks[i], l.items[i].end_tick + lead);
        }
        /* as long as its period: the rows' time comes on top */
        run_camera(camera, "\"exposure_s\": 1, \"period_s\": 1, \"first_s\": 0.1", "", "", 60001,
                   &l);
        for (int i = 0; i < l.count; i++) {
            assert_int_equal(l.items[i].start_tick, 600 + i * (6000 + 2 * lead));
        }
        assert_int_equal(l.count, 9);
    }
}

/* The scale stays as commanded; a command without a window gives the scenario's own. */
static void scale_and_own_window(void **state) {
    (void)state;
    train l;
    run("\"exposure_s\": 0.5, \"period_s\": 1, \"window_px\": [16, 32, 200, 100]",
        "\"control\": {\"type\": \"commander\", \"at_tick\": 7000, \"pixel_scale_arcsec\": 1.5}",
        "", 30000, &l);
    assert_int_equal(l.count, 5);
    for (int i = 0; i < 5; i++) {
        const bst_exposure *e = &l.items[i];
        bst_assert_close(e->pixel_scale_arcsec, i < 2 ? 0 : 1.5, 0);
        assert_true(e->window.x0 == 16 && e->window.y0 == 32);
        assert_true(e->window.width == 200 && e->window.height == 100);
    }
    run("\"exposure_s\": 0.5, \"period_s\": 1, \"window_px\": [16, 32, 200, 100]",
        "\"control\": {\"type\": \"commander\", \"x0\": 300, \"y0\": 400, \"width\": 50, "
        "\"height\": 60, \"pixel_scale_arcsec\": -1}",
        "", 20000, &l);
    assert_true(l.items[2].window.x0 == 300 && l.items[2].window.y0 == 400);
    assert_true(l.items[2].window.width == 50 && l.items[2].window.height == 60);
    bst_assert_close(l.items[2].pixel_scale_arcsec, 0, 0);
}

/* Saves at ticks[0], goes on with another "exposure" block, saves at ticks[1] (0: not), goes on. */
static void run_changed(const char *before, const char *after, const char *module_block,
                        const int64_t ticks[3], train *out) {
    bst_ctx ctx = {0};
    saving save[2], from[2], *start = NULL;
    int n = 0;
    for (size_t size; n < (ticks[1] ? 2 : 1); start = &from[n++]) {
        save[n].tick = ticks[n];
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &save[n].archive));
        bst_assert_ok(&ctx, try_part(&ctx, "", n ? after : before, module_block, "", 0, &save[n],
                                     start, out));
        const void *bytes = bst_archive_data(save[n].archive, &size);
        bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &from[n].archive));
    }
    bst_assert_ok(&ctx, try_part(&ctx, "", after, module_block, "", ticks[2], NULL, start, out));
    while (n-- > 0) {
        bst_archive_free(from[n].archive), bst_archive_free(save[n].archive);
    }
}

/* What the scenario has changed while a run was saved holds from the next exposure on, each setting
 * by itself; the exposure that is open keeps its own. Frames begin every 6000 ticks and last 3000:
 * saved while the second one is open, or after it. */
static void changes_hold_from_the_next_exposure_on(void **state) {
    (void)state;
#define BLOCK(exposure, period, binning, x0)                                        \
    "\"exposure_s\": " exposure ", \"period_s\": " period ", \"binning\": " binning \
    ", \"window_px\": [" x0 ", 32, 200, 100]"
    static const struct {
        const char *after;
        int exposure, period, binning, x0;
    } rows[] = {{BLOCK("0.5", "1", "3", "16"), 3000, 6000, 3, 16},
                {BLOCK("0.5", "1", "3", "17"), 3000, 6000, 3, 17},
                {BLOCK("0.125", "1", "3", "16"), 750, 6000, 3, 16},
                {BLOCK("0.5", "1.5", "3", "16"), 3000, 9000, 3, 16},
                {BLOCK("0.5", "1", "4", "16"), 3000, 6000, 4, 16}};
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        for (int n = 0; n < 4; n++) { /* saved once, or once more before they hold */
            train l;
            const int64_t open = n % 2, tick = open ? 7000 : 10000;
            const int64_t ticks[] = {tick, n / 2 * (tick + 900), 50000};
            run_changed(rows[0].after, rows[k].after, "", ticks, &l);
            assert_true(l.count >= 4);
            for (int i = 0; i < 4; i++) {
                const bst_exposure *e = &l.items[i];
                bool old = open && i == 0; /* the second one, open when it was saved */
                assert_int_equal(e->id, i + (open ? 1 : 2));
                assert_int_equal(e->start_tick, old ? 6000 : 12000 + (i - open) * rows[k].period);
                assert_int_equal(e->end_tick - e->start_tick, old ? 3000 : rows[k].exposure);
                assert_int_equal(l.ticks[i], e->end_tick);
                assert_int_equal(e->binning, old ? 3 : rows[k].binning);
                assert_int_equal(e->window.x0, old ? 16 : rows[k].x0);
                assert_int_equal(e->window.width, 200);
            }
        }
    }
}

/* What was commanded before holds on, also in the exposure that is open. */
static void commands_outlast_saved_states(void **state) {
    (void)state;
    static const char before[] = "\"exposure_s\": 0.5",
                      after[] =
                          "\"exposure_s\": 0.75, \"period_s\": 3, \"binning\": 4, "
                          "\"window_px\": [16, 32, 200, 100]";
    for (int k = 0; k < 4; k++) { /* changed or not, saved within an exposure or between two */
        train l;
        run_changed(before, k % 2 ? after : before,
                    "\"control\": {\"type\": \"commander\", \"at_tick\": 1000, \"exposure_s\": "
                    "0.25, \"period_s\": 2, \"binning\": 2, \"x0\": 300, \"y0\": 200, "
                    "\"width\": 50, \"height\": 60, \"pixel_scale_arcsec\": 1.5}",
                    (const int64_t[]){k < 2 ? 7000 : 10000, 0, 40000}, &l);
        assert_int_equal(l.count, k < 2 ? 3 : 2);
        for (int i = 0; i < l.count; i++) {
            const bst_exposure *e = &l.items[i];
            assert_int_equal(e->start_tick, 6000 + (i + (k < 2 ? 0 : 1)) * 12000);
            assert_int_equal(e->end_tick - e->start_tick, 1500);
            assert_int_equal(e->binning, 2);
            assert_true(e->window.y0 == 200 && e->window.width == 50);
            bst_assert_close(e->pixel_scale_arcsec, 1.5, 0);
        }
    }
}

/* Writes a file of frame updates and the keys that name it, closing the block "exposure" before. */
static void write_updates(const char *frames, char path[BST_TEST_PATH], char *keys, size_t bytes) {
    bst_test_template(path, "boresight_updates");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    FILE *f = fdopen(fd, "w");
    fprintf(f, "{\"boresight_frame_updates\": 1, \"frames\": [%s]}", frames);
    fclose(f);
    snprintf(
        keys, bytes,
        "\"exposure_s\": 0.5, \"period_s\": 1, \"first_s\": 2}, \"frame_updates_file\": \"%s\", "
        "\"knowledge\": {",
        path);
}

/* A file of frame updates alone decides, whatever is commanded. */
static void a_file_drives_the_frames(void **state) {
    (void)state;
    char path[BST_TEST_PATH], keys[600];
    train l;
    write_updates(
        "{\"frame\": 1, \"exposure_s\": 0.25, \"binning\": 2}, {\"frame\": 3, "
        "\"exposure_s\": 2, \"period_s\": 1.5, \"window_px\": [1, 2, 30, 40], "
        "\"pixel_scale_arcsec\": 6}",
        path, keys, sizeof keys);
    run(keys,
        "\"control\": {\"type\": \"commander\", \"exposure_s\": 0.1, \"period_s\": 0.2, "
        "\"binning\": 5}",
        "", 60001, &l);
    /* starts at 2, 3, 4, 5 s, then as long as the exposure */
    static const int64_t starts[] = {12000, 18000, 24000, 30000, 42000};
    static const int64_t lengths[] = {3000, 1500, 1500, 12000, 12000};
    assert_int_equal(l.count, 5);
    for (int i = 0; i < 5; i++) {
        const bst_exposure *e = &l.items[i];
        assert_int_equal(e->id, i);
        assert_int_equal(e->start_tick, starts[i]);
        assert_int_equal(e->end_tick, starts[i] + lengths[i]);
        assert_int_equal(e->binning, i < 1 ? 1 : 2);
        assert_int_equal(e->window.x0, i < 3 ? 0 : 1);
        assert_int_equal(e->window.y0, i < 3 ? 0 : 2);
        assert_int_equal(e->window.width, i < 3 ? 640 : 30);
        assert_int_equal(e->window.height, i < 3 ? 480 : 40);
        bst_assert_close(e->pixel_scale_arcsec, i < 3 ? 3 : 6, 0);
    }
    unlink(path);
}

/* Frames of a ramp are not binned, also if control asks for it. */
static void ramps_are_not_binned(void **state) {
    (void)state;
    train l;
    run_camera(", \"detector\": {\"ramp\": {\"reads\": 4}}", "\"exposure_s\": 0.5, \"period_s\": 1",
               "\"control\": {\"type\": \"commander\", \"exposure_s\": 0.25, \"binning\": 2}", "",
               20000, &l);
    assert_int_equal(l.count, 4);
    assert_int_equal(l.items[2].end_tick - l.items[2].start_tick, 1500);
    assert_int_equal(l.items[2].binning, 1);
}

static void settings_that_do_not_fit(void **state) {
    (void)state;
    static const char rolling[] = ", \"detector\": {\"row_time_s\": 1e-4}";
    static const char ramp[] = ", \"detector\": {\"ramp\": {\"reads\": 4}}";
    static const struct {
        const char *camera, *exposure, *frames, *words;
    } cases[] = {
        {"", "\"dropped_fraction\": 0.8, \"dropped_burst_frames\": 3.9", NULL,
         "dropped_burst_frames: 3.9 (allowed: 0, or 4 and more"},
        {"", "\"dropped_fraction\": 0.2, \"dropped_burst_frames\": 0.9", NULL,
         "dropped_burst_frames: 0.9 (allowed: 0, or 1 and more"},
        {rolling, "\"exposure_s\": 0.5, \"first_s\": 0.0235", NULL,
         "the first row is exposed 0.024 s before the middle one"},
        {ramp, "\"binning\": 2", NULL,
         "binning: 2, but the camera's detector/ramp reads each pixel"},
        {ramp, NULL, "{\"frame\": 2}, {\"frame\": 4, \"binning\": 3}",
         "/frames/1 (frame 4)/binning: 3, but the camera's detector/ramp reads each pixel"},
        {"", NULL, "{\"frame\": 4, \"exposure_s\": 0.00001}", "/frames/0 (frame 4)/exposure_s"},
        {"", NULL, "{\"frame\": 2}, {\"frame\": 4, \"period_s\": 1.00001}",
         "/frames/1 (frame 4)/period_s"},
        /* with 2 * 0.024 s of rows */
        {rolling, NULL, "{\"frame\": 2, \"period_s\": 0.548}, {\"frame\": 5, \"period_s\": 0.547}",
         "frame 5: a period_s of 0.547 is too short (allowed: at least 0.548"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char path[BST_TEST_PATH] = "", keys[600];
        bst_ctx ctx = {0};
        train l;
        if (cases[i].frames) {
            write_updates(cases[i].frames, path, keys, sizeof keys);
        }
        assert_int_equal(try_camera(&ctx, cases[i].camera,
                                    cases[i].frames ? keys : cases[i].exposure, "", "", 0, &l),
                         BST_ERR_CONFIG);
        if (!strstr(ctx.message, cases[i].words)) {
            fail_msg("%s", ctx.message);
        }
        if (*path) {
            unlink(path);
        }
    }
}

static int dropped(const train *l) {
    int n = 0;
    for (int i = 0; i < l->count; i++) {
        n += l->items[i].dropped;
    }
    return n;
}

static void dropped_frames_follow_the_seed(void **state) {
    (void)state;
    const char *exposure = "\"exposure_s\": 0.5, \"period_s\": 1, \"dropped_fraction\": 0.2";
    train a, b, c, d;
    run(exposure, "", "", 1800000, &a);
    run(exposure, "", "", 1800000, &b);
    run(exposure, "", "\"seed\": \"0x2\", ", 1800000, &c);
    run(exposure, "", "\"run\": 1, ", 1800000, &d);
    assert_int_equal(a.count, 300);
    int same_seed = 0, other_seed = 0, other_run = 0;
    for (int i = 0; i < 300; i++) {
        same_seed += a.items[i].dropped == b.items[i].dropped;
        other_seed += a.items[i].dropped == c.items[i].dropped;
        other_run += a.items[i].dropped == d.items[i].dropped;
    }
    assert_int_equal(same_seed, 300);
    assert_true(other_seed < 300 && other_run < 300);
    /* binomial, 300 frames of 0.2: mean 60, sigma 6.9; 4.5 sigma, fixed seeds */
    bst_assert_close(dropped(&a), 60, 31);
    bst_assert_close(dropped(&c), 60, 31);
    run("\"dropped_fraction\": 1", "", "", 60000, &a);
    assert_int_equal(dropped(&a), a.count);
    assert_int_equal(a.count, 10);
}

/* Gilbert's channel in numbers of its own: bursts are geometric of mean L = 5, and of 20 % of the
 * frames; the good stretches between them of mean L (1 - f) / f = 20. */
static void dropped_frames_come_in_bursts(void **state) {
    (void)state;
    train l;
    int count = 0, lost = 0, bursts = 0, singles = 0;
    for (int number = 0; number < 10; number++) {
        char extra[40];
        snprintf(extra, sizeof extra, "\"run\": %d, ", number);
        run("\"exposure_s\": 0.5, \"period_s\": 1, \"dropped_fraction\": 0.2, "
            "\"dropped_burst_frames\": 5",
            "", extra, 1800000, &l);
        assert_int_equal(l.count, 300);
        count += l.count;
        lost += dropped(&l);
        for (int i = 0; i < l.count; i++) {
            bool first = l.items[i].dropped && (i == 0 || !l.items[i - 1].dropped);
            bursts += first;
            singles += first && i + 1 < l.count && !l.items[i + 1].dropped;
        }
    }
    /* Markov chain of eigenvalue 1 - 1/5 - 1/20 = 0.75: the share's variance is
     * f (1 - f) (1 + 0.75) / (1 - 0.75) / n, sigma 0.0193 */
    bst_assert_close((double)lost / count, 0.2, 4.0 * 0.0193);
    /* n (1 - f) / 20 = 120 bursts, nearly Poisson: their mean length has sigma
     * sqrt(20 / 120) = 0.41; without bursts it is 1 / 0.8. The ends of ten runs cut two bursts. */
    bst_assert_close((double)lost / bursts, 5.0, 4.0 * 0.41);
    /* a fifth of them last one frame: sigma sqrt(0.2 * 0.8 / 120) = 0.037 */
    bst_assert_close((double)singles / bursts, 0.2, 4.0 * 0.037);
    /* at the limit every second frame is lost, in turn */
    run("\"exposure_s\": 0.5, \"period_s\": 1, \"dropped_fraction\": 0.5, "
        "\"dropped_burst_frames\": 1",
        "", "", 60000, &l);
    for (int i = 1; i < l.count; i++) {
        assert_int_equal(l.items[i].dropped, !l.items[i - 1].dropped);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(exposures_start_and_end_at_exact_ticks),
                                       cmocka_unit_test(the_last_frame_ends_before_the_run),
                                       cmocka_unit_test(commands_are_latched_at_the_start),
                                       cmocka_unit_test(odd_commands_do_no_harm),
                                       cmocka_unit_test(rolling_shutters_take_their_time),
                                       cmocka_unit_test(scale_and_own_window),
                                       cmocka_unit_test(changes_hold_from_the_next_exposure_on),
                                       cmocka_unit_test(commands_outlast_saved_states),
                                       cmocka_unit_test(a_file_drives_the_frames),
                                       cmocka_unit_test(ramps_are_not_binned),
                                       cmocka_unit_test(settings_that_do_not_fit),
                                       cmocka_unit_test(dropped_frames_follow_the_seed),
                                       cmocka_unit_test(dropped_frames_come_in_bursts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
