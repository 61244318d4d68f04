/* observation_source: one key chooses between the image and the generator, which takes the settings
 * of the modules that it stands in for. */
#include <cjson/cJSON.h>

#include "sim/app/app.h"
#include "sim/engine/simulation.h"
#include "tests/test_support.h"

#define SHIPPED "scenarios/neossat_geo_track.json"
#define SENSOR "/observers/0/sensors/0"

static bst_status read_with(bst_ctx *ctx, const char *const *sets, int count, bst_json **json,
                            bst_scenario *scenario) {
    BST_TRY(bst_json_load(ctx, SHIPPED, json));
    BST_TRY(bst_json_set(ctx, *json, "/world/star_catalogue=embedded"));
    for (int i = 0; i < count; i++) {
        BST_TRY(bst_json_set(ctx, *json, sets[i]));
    }
    return bst_scenario_read(ctx, *json, bst_registry_shipped(), scenario);
}

static const bst_scenario_module_config *module_of(const bst_scenario *s, const char *role) {
    for (int m = 0; m < s->module_count; m++) {
        if (strcmp(s->modules[m].desc->role, role) == 0) {
            return &s->modules[m];
        }
    }
    return NULL;
}

static double real_of(const bst_scenario_module_config *module, const char *key) {
    for (const bst_config_desc *d = module->desc->config; d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            double value;
            memcpy(&value, (const char *)module->config + d->offset, sizeof value);
            return value;
        }
    }
    fail_msg("no key %s", key);
    return 0.0;
}

static void one_key_chooses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario s;
    bst_assert_ok(&ctx, read_with(&ctx, NULL, 0, &json, &s));
    assert_true(module_of(&s, "obsgen")->off); /* the scenario names its calibration */
    assert_false(module_of(&s, "scenegen")->off);
    bst_scenario_free(&s);
    bst_json_free(json);

    const char *const sets[] = {SENSOR "/observation_source=generator",
                                SENSOR "/modules/imgproc/false_alarms_per_frame=3",
                                SENSOR "/modules/scenegen/star_limit_v_mag=12"};
    bst_assert_ok(&ctx, read_with(&ctx, sets, 3, &json, &s));
    const bst_scenario_module_config *generator = module_of(&s, "obsgen");
    assert_non_null(generator);
    assert_false(generator->off);
    assert_true(module_of(&s, "scenegen")->off && module_of(&s, "imgproc")->off);
    assert_false(module_of(&s, "tracker")->off);
    /* copied: no rounding */
    bst_assert_close(real_of(generator, "false_alarms_per_frame"), 3.0, 0.0);
    bst_assert_close(real_of(generator, "star_limit_v_mag"), 12.0, 0.0);
    bst_assert_close(real_of(generator, "jitter_px"), 0.14, 0.0);
    /* the read-out's 0.15 s, on the last trigger */
    assert_int_equal(generator->delay_count, 1);
    assert_int_equal(generator->delays[0].port, 1);
    assert_int_equal(generator->delays[0].ticks, 900);
    cJSON *echo = bst_scenario_echo(&s);
    char *first = cJSON_Print(echo);
    cJSON_Delete(echo);
    bst_scenario_free(&s);
    bst_json_free(json);
    /* the echo says every setting once, and reads back as itself */
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "echo", first, strlen(first), &json));
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, bst_registry_shipped(), &s));
    bst_assert_close(real_of(module_of(&s, "obsgen"), "star_limit_v_mag"), 12.0, 0.0);
    assert_int_equal(module_of(&s, "obsgen")->delays[0].ticks, 900);
    echo = bst_scenario_echo(&s);
    char *second = cJSON_Print(echo);
    assert_string_equal(first, second);
    cJSON_Delete(echo);
    cJSON_free(first);
    cJSON_free(second);
    bst_scenario_free(&s);
    bst_json_free(json);
}

static void a_block_waits_while_there_is_an_image(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario s;
    const char *const sets[] = {SENSOR "/modules/obsgen={\"type\": \"statistical\"}"};
    bst_assert_ok(&ctx, read_with(&ctx, sets, 1, &json, &s));
    assert_true(module_of(&s, "obsgen")->off);
    assert_false(module_of(&s, "imgproc")->off);
    bst_scenario_free(&s);
    bst_json_free(json);
}

static void refuse(const char *const *sets, int count, const char *part) {
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario s;
    assert_int_equal(read_with(&ctx, sets, count, &json, &s), BST_ERR_CONFIG);
    if (!strstr(ctx.message, part)) {
        fail_msg("\"%s\" does not hold \"%s\"", ctx.message, part);
    }
    bst_scenario_free(&s);
    bst_json_free(json);
}

static void what_is_said_twice_is_refused(void **state) {
    (void)state;
    const char *const twice[] = {
        SENSOR "/observation_source=generator",
        SENSOR "/modules/obsgen={\"type\": \"statistical\", \"star_limit_v_mag\": 12}"};
    refuse(twice, 2,
           "/modules/obsgen/star_limit_v_mag: given twice (found 12; allowed: nothing here: it is "
           "the \"star_limit_v_mag\" of this sensor's scenegen");
    const char *const delayed[] = {SENSOR
                                   "/modules/obsgen={\"type\": \"statistical\", \"delay_s\": "
                                   "{\"exposure\": 1}}"};
    refuse(delayed, 1, "/modules/obsgen/delay_s: given twice");
    const char *const unknown[] = {SENSOR "/observation_source=film"};
    refuse(unknown, 1, "/observation_source: ");
    const char *const file[] = {
        SENSOR "/modules/obsgen={\"type\": \"statistical\", \"calibration_file\": \"none.json\"}"};
    refuse(file, 1, "/modules/obsgen/calibration_file: there is no file");
}

/* Neither rendering nor image processing: no device is opened, and they do not step. */
static void neither_image_module_steps(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario s;
    const char *const sets[] = {SENSOR "/observation_source=generator", "/duration_s=5"};
    bst_assert_ok(&ctx, read_with(&ctx, sets, 2, &json, &s));
    const bst_simulation_options options = {.threads = 1};
    bst_simulation *sim;
    bst_assert_ok(&ctx, bst_simulation_create(&ctx, &s, &options, &sim));
    assert_null(bst_simulation_device(sim));
    bst_engine *engine = bst_simulation_engine(sim);
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, s.duration_ticks));
    int64_t steps = 0;
    for (int i = 0; i < bst_engine_instance_count(engine); i++) {
        const char *name = bst_engine_instance_name(engine, i);
        assert_null(strstr(name, "scenegen"));
        assert_null(strstr(name, "imgproc"));
        steps += strstr(name, "/obsgen") ? bst_engine_instance_steps(engine, i) : 0;
    }
    /* five exposures, each when it ends and when it would have been processed */
    assert_int_equal(steps, 10);
    bst_simulation_free(sim);
    bst_scenario_free(&s);
    bst_json_free(json);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_key_chooses),
        cmocka_unit_test(a_block_waits_while_there_is_an_image),
        cmocka_unit_test(what_is_said_twice_is_refused),
        cmocka_unit_test(neither_image_module_steps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
