/* The module "tasking" of two sensors in a simulation: each one's telemetry and tracks count for
 * itself, tasks go to the right one, and reports add up. */
#include "control/modules.h"
#include "gimbal/modules.h"
#include "sim/engine/simulation.h"
#include "tests/test_support.h"

enum { RATE = 6000, LOW, HIGH };

/* A fake tracker writes every two seconds from `from_s` on that the target is in track. */
typedef struct watcher {
    double from_s;
} watcher;

static bst_status watcher_create(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    *self = calloc(1, sizeof(watcher));
    if (!*self) {
        return BST_ERR_MEMORY;
    }
    *(watcher *)*self = *(const watcher *)config;
    return BST_OK;
}

static bst_status watcher_step(void *self, struct bst_step *step) {
    const watcher *w = self;
    if (bst_step_seconds(step) < w->from_s) {
        return BST_OK;
    }
    bst_tracks *tracks = bst_step_write(step, 0, NULL);
    tracks->tick = bst_step_tick(step);
    tracks->count = 1;
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED, .target_of_interest = true};
    return BST_OK;
}

static void watcher_destroy(void *self) {
    free(self);
}

static const bst_config_desc watcher_table[] = {
    BST_REAL(watcher, from_s, "s", 0, 1e9, "1e9", "When it begins."), BST_CONFIG_END};
static const bst_port watcher_ports[] = {
    {.channel = BST_CHANNEL_TRACKS, .direction = BST_PORT_OUT, .capacity = 1}};
static const bst_module_desc watcher_module = {.abi = BST_MODULE_ABI,
                                               .role = "tracker",
                                               .type = "watcher",
                                               .doc = "Says that the target is in track.",
                                               .config = watcher_table,
                                               .config_bytes = sizeof(watcher),
                                               .default_rate_hz = 0.5,
                                               .ports = watcher_ports,
                                               .port_count = 1,
                                               .create = watcher_create,
                                               .step = watcher_step,
                                               .destroy = watcher_destroy};
static const bst_module_desc *const modules[] = {&bst_gimbal_ideal_module, &watcher_module,
                                                 &bst_tasking_priority_module};
static const bst_scenario_registry registry = {.modules = modules, .count = 3};

enum { KEPT = 16 };

typedef struct observed_run {
    bst_ctx ctx;
    bst_task tasks[2][KEPT];
    int64_t ticks[2][KEPT];
    int count[2];
    char reports[KEPT][400];
    int64_t report_ticks[KEPT];
    int report_count;
} observed_run;

static bst_status keep(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    observed_run *t = user;
    if (strcmp(channel, BST_CHANNEL_TASK) == 0) {
        int s = strcmp(scope, "high/camera") == 0;
        assert_true(s == 1 || strcmp(scope, "low/camera") == 0);
        assert_true(t->count[s] < KEPT);
        t->ticks[s][t->count[s]] = tick;
        t->tasks[s][t->count[s]++] = *(const bst_task *)payload;
    }
    return BST_OK;
}

static bst_status hear(void *user, int64_t tick, const char *instance, const char *kind,
                       const char *text) {
    observed_run *t = user;
    (void)instance;
    if (strcmp(kind, "visible") == 0) {
        assert_true(t->report_count < KEPT);
        t->report_ticks[t->report_count] = tick;
        snprintf(t->reports[t->report_count++], sizeof *t->reports, "%s", text);
    }
    return BST_OK;
}

/* NEOSSat and a spacecraft 360 km from INMARSAT GX5, the five objects of the catalogue. */
#define SENSOR(from_)                                                                          \
    "\"sensors\": [{\"name\": \"camera\", \"camera\": {\"pixel_scale_arcsec\": 3, "            \
    "\"aperture_m\": "                                                                         \
    "0.15}, \"exposure\": {\"exposure_s\": 0.5, \"period_s\": 2}, \"cue\": {\"object\": "      \
    "\"INMARSAT GX5\"}, \"modules\": {\"tracker\": {\"type\": \"watcher\", \"from_s\": " from_ \
    "}, \"gimbal\": {\"type\": \"ideal\", \"rate_hz\": 20, \"object\": \"INMARSAT GX5\", "     \
    "\"platform\": {\"telemetry_rate_hz\": 20}}}}]"
#define SCENARIO(low_, high_, tasking_) \
    "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 300, "            \
    "\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{\"elements_file\": "          \
    "\"catalogue_2022-06.tle\"}], \"objects\": []}, \"observers\": [{\"name\": \"low\", \"orbit\": " \
    "{\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089}, " SENSOR(low_)              \
    "}, {\"name\": \"high\", \"orbit\": {\"source\": \"relative\", \"reference\": \"INMARSAT "     \
    "GX5\", \"offset_rtn_m\": [-200000, -300000, 50000]}, " SENSOR(high_)                          \
    "}], \"tasking\": {\"type\": \"priority\", \"rate_hz\": 2, " tasking_ "}}"

static void run(observed_run *t, const char *text, double seconds) {
    memset(t, 0, sizeof *t);
    bst_json *json;
    bst_scenario scenario;
    bst_simulation *simulation;
    bst_assert_ok(&t->ctx,
                  bst_json_parse(&t->ctx, "scenarios/test.json", text, strlen(text), &json));
    bst_assert_ok(&t->ctx, bst_scenario_read(&t->ctx, json, &registry, &scenario));
    bst_json_free(json);
    static const bst_simulation_options options = {0};
    bst_assert_ok(&t->ctx, bst_simulation_create(&t->ctx, &scenario, &options, &simulation));
    bst_engine *engine = bst_simulation_engine(simulation);
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = t, .message = keep, .event = hear});
    bst_assert_ok(&t->ctx, bst_engine_run(&t->ctx, engine, (int64_t)(seconds * RATE)));
    bst_simulation_free(simulation);
    bst_scenario_free(&scenario);
}

#define ONE_TARGET                                                                        \
    "\"targets\": [{\"object\": \"INMARSAT GX5\", \"revisit_s\": 600, \"frames\": 3}], "  \
    "\"min_snr\": 0, \"sun_keep_out_deg\": 0, \"settle_s\": 10, \"find_timeout_s\": 30, " \
    "\"retry_s\": 100"

/* The low sensor gets the only target at once; its tracker has it in three frames at 4, 6 and 8 s.
 */
static void tracks_of_the_sensor_with_the_task_end_it(void **state) {
    (void)state;
    observed_run t;
    run(&t, SCENARIO("3", "1e9", ONE_TARGET ", \"report_every_s\": 20"), 50.0);
    assert_int_equal(t.count[0], 2);
    assert_int_equal(t.count[1], 0);
    assert_int_equal(t.tasks[0][0].norad, 44801);
    assert_true(t.ticks[0][0] <= RATE); /* with the first telemetry */
    assert_int_equal(t.tasks[0][0].tick, t.ticks[0][0]);
    assert_int_equal(t.tasks[0][1].object, -1);
    assert_int_equal(t.tasks[0][1].before, BST_TASK_DONE);
    assert_true(t.ticks[0][1] >= 8 * RATE && t.ticks[0][1] <= 9 * RATE);
    /* at 0, 20 and 40 s; seen from 4 s on */
    assert_int_equal(t.report_count, 3);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(t.report_ticks[i], 20 * i * RATE);
        char want[100];
        snprintf(want, sizeof want, "1 of 1 targets can be seen, %d have been", i > 0);
        assert_string_equal(t.reports[i], want);
    }
}

/* Tracks of the other sensor, which has no task, do not count. */
static void tracks_of_the_other_do_not(void **state) {
    (void)state;
    observed_run t;
    run(&t, SCENARIO("1e9", "3", ONE_TARGET ", \"report_every_s\": 0"), 55.0);
    assert_int_equal(t.report_count, 0);
    assert_true(t.count[0] >= 2);
    assert_int_equal(t.tasks[0][1].before, BST_TASK_NOT_FOUND);
    /* arrival at 10 s, and 30 s; plans are made twice a second */
    int64_t after = t.ticks[0][1] - t.ticks[0][0];
    assert_true(after > 40 * RATE && after <= 41 * RATE);
    /* from then on the other one may have it, which plans every 10 s */
    assert_int_equal(t.count[1], 1);
    assert_int_equal(t.tasks[1][0].norad, 44801);
    assert_true(t.ticks[1][0] >= t.ticks[0][1] && t.ticks[1][0] <= t.ticks[0][1] + 10 * RATE);
}

/* Reasons with the number of the targets that each holds for: nothing is bright enough, but one is
 * the spacecraft itself for the low one and for the high one too faint. */
static void a_report_adds_up(void **state) {
    (void)state;
    observed_run t;
    run(&t, SCENARIO("1e9", "1e9", "\"targets\": [{}], \"min_snr\": 1e6, \"report_every_s\": 20"),
        5.0);
    assert_int_equal(t.count[0] + t.count[1], 0);
    assert_int_equal(t.report_count, 1);
    static const char begin[] = "0 of 5 targets can be seen, 0 have been; not: ";
    assert_memory_equal(t.reports[0], begin, strlen(begin));
    int sum = 0, parts = 0;
    for (const char *at = t.reports[0] + strlen(begin); at; at = strstr(at, ", ")) {
        at += *at == ',' ? 2 : 0;
        sum += atoi(at);
        parts++;
    }
    assert_int_equal(sum, 5);
    assert_true(parts >= 2 && strstr(t.reports[0], " too faint") != NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tracks_of_the_sensor_with_the_task_end_it),
        cmocka_unit_test(tracks_of_the_other_do_not),
        cmocka_unit_test(a_report_adds_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
