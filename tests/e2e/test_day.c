/* The plant at 1 kHz for a long time, image path off, recorder on: ticks stay exact and memory
 * flat. usage: test_e2e_day SECONDS FLAT_AFTER_SECONDS */
#include <stdlib.h>
#include <unistd.h>

#include "sim/app/app.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/engine/simulation.h"
#include "tests/io/scratch.h"

#define SCENARIO "scenarios/day_plant.json"

typedef struct lengths {
    double total_s, flat_after_s;
    const char *telemetry_hz; /* NULL: as in the scenario */
} lengths;

typedef struct observed {
    bst_ctx *ctx;
    bst_recorder *recorder;
    int64_t exposures, inexact;
    int64_t plant_samples;
} observed;

/* Exposures start at whole seconds and last 0.5 s: 6000 and 3000 ticks. */
static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    (void)scope;
    observed *o = user;
    if (strcmp(channel, BST_CHANNEL_EXPOSURE) == 0) {
        const bst_exposure *e = payload;
        o->inexact += e->id != o->exposures || e->start_tick != 6000 * e->id ||
                      e->end_tick != e->start_tick + 3000 || tick != e->end_tick;
        o->exposures++;
    } else if (strcmp(channel, BST_CHANNEL_LOS_HISTORY) == 0) {
        const bst_los_history *h = payload;
        o->inexact +=
            h->items[(h->written - 1) % h->capacity].tick != tick || tick != 6 * o->plant_samples;
        o->plant_samples++;
    }
    return bst_recorder_channel(o->ctx, o->recorder, 0, channel, payload, tick);
}

static long resident_kib(void) {
    FILE *file = fopen("/proc/self/status", "r");
    assert_non_null(file);
    char line[256];
    long kib = -1;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "VmRSS: %ld kB", &kib) == 1) {
            break;
        }
    }
    fclose(file);
    assert_true(kib > 0);
    return kib;
}

static int64_t steps_of(bst_engine *engine, const char *instance) {
    for (int i = 0; i < bst_engine_instance_count(engine); i++) {
        if (strcmp(bst_engine_instance_name(engine, i), instance) == 0) {
            return bst_engine_instance_steps(engine, i);
        }
    }
    fail_msg("there is no instance %s", instance);
    return -1;
}

static void open_recorder(observed *o, bst_run *store, const bst_scenario *scenario) {
    const bst_observer_config *observer = scenario->observers.items;
    const bst_sensor_config *sensor = observer->sensors.items;
    const bst_recorder_sensor recorded = {
        .observer = observer->name, .sensor = sensor->name, .camera = &sensor->camera};
    const bst_recorder_info info = {.epoch = scenario->epoch,
                                    .tick_rate_hz = scenario->tick_rate_hz,
                                    .program = "test",
                                    .sensors = &recorded,
                                    .sensor_count = 1};
    bst_assert_ok(o->ctx,
                  bst_recorder_create(o->ctx, store, &scenario->record, &info, &o->recorder));
}

static void test_long_run(void **state) {
    const lengths *length = *state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    scratch folder;
    scratch_make(&folder);
    bst_json *json = NULL;
    bst_scenario scenario;
    char set[64];
    snprintf(set, sizeof set, "/duration_s=%.0f", length->total_s);
    bst_assert_ok(&ctx, bst_json_load(&ctx, SCENARIO, &json));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/world/star_catalogue=embedded"));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, set));
    if (length->telemetry_hz) {
        snprintf(set, sizeof set, "/record/telemetry_hz=%s", length->telemetry_hz);
        bst_assert_ok(&ctx, bst_json_set(&ctx, json, set));
    }
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, bst_registry_shipped(), &scenario));
    const bst_simulation_options options = {.threads = 1};
    bst_simulation *sim = NULL;
    bst_assert_ok(&ctx, bst_simulation_create(&ctx, &scenario, &options, &sim));
    bst_run *store = NULL;
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&folder, "run"), false, &store));
    observed seen = {.ctx = &ctx};
    open_recorder(&seen, store, &scenario);
    bst_engine *engine = bst_simulation_engine(sim);
    const bst_engine_hooks hooks = {.user = &seen, .message = on_message};
    bst_engine_set_hooks(engine, &hooks);

    int64_t rate = scenario.tick_rate_hz;
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, (int64_t)length->flat_after_s * rate));
    long first = resident_kib(), most = first;
    /* the rest in 20 parts, so that growth that is given back is seen too */
    for (int part = 1; part <= 20; part++) {
        double until_s =
            length->flat_after_s + (length->total_s - length->flat_after_s) * part / 20.0;
        bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, (int64_t)until_s * rate));
        long now = resident_kib();
        most = now > most ? now : most;
    }
    printf("resident memory: %ld KiB after %.0f s, at most %ld KiB until %.0f s\n", first,
           length->flat_after_s, most, length->total_s);

    int64_t ticks = scenario.duration_ticks;
    assert_int_equal(ticks, (int64_t)length->total_s * 6000);
    assert_int_equal(bst_engine_tick(engine), ticks - 6);
    assert_int_equal(steps_of(engine, "neossat/telescope/gimbal"), ticks / 6);    /* 1 kHz */
    assert_int_equal(steps_of(engine, "neossat/telescope/control"), ticks / 300); /* 20 Hz */
    /* each exposure opens and closes */
    assert_int_equal(steps_of(engine, "neossat/telescope/exposure"), ticks / 3000);
    assert_int_equal(seen.exposures, ticks / 6000);
    assert_int_equal(seen.plant_samples, ticks / 6);
    assert_int_equal(seen.inexact, 0);
    /* 1 %: the figure of the issue */
    assert_true((double)most < 1.01 * (double)first);

    bst_assert_ok(&ctx, bst_recorder_close(&ctx, seen.recorder));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    scratch_remove(&folder);
}

int main(int argc, char **argv) {
    if (argc != 3 && argc != 4) {
        fprintf(stderr, "usage: %s SECONDS FLAT_AFTER_SECONDS [TELEMETRY_HZ]\n", argv[0]);
        return 2;
    }
    lengths length = {atof(argv[1]), atof(argv[2]), argc == 4 ? argv[3] : NULL};
    const struct CMUnitTest tests[] = {cmocka_unit_test_prestate(test_long_run, &length)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
