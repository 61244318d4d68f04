/* Reading a scenario: what is refused and in which words, the echo, the schema. */
#define _XOPEN_SOURCE 700 /* realpath, mkdtemp */
#include <cjson/cJSON.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim/engine/scenario/scenario.h"
#include "tests/test_support.h"

typedef struct gadget {
    double gain_px;
    int64_t size;
    double vector[3];
    char note[16];
    bst_config_list parts;
    struct {
        char file[512];
    } map;
} gadget;

typedef struct part {
    double weight;
} part;

static const bst_config_desc part_table[] = {
    BST_REAL(part, weight, "kg", 0, 10, "1", "Weight of the part."), BST_CONFIG_END};
static const bst_config_desc map_table[] = {{.key = "file",
                                             .type = BST_CONFIG_PATH,
                                             .unit = "",
                                             .fallback = "\"\"",
                                             .doc = "A map.",
                                             .size = 512},
                                            BST_CONFIG_END};
static const bst_config_desc gadget_table[] = {
    BST_REAL(gadget, gain_px, "px", 0, 1, "0.1", "Gain."),
    BST_INT(gadget, size, "", 1, 100, NULL, "Size."),
    BST_REALS(gadget, vector, "", -1, 1, "[0, 0, 0.3]", "A vector."),
    BST_STRING(gadget, note, "\"none\"", "A note."),
    BST_LIST(gadget, parts, part, part_table, 0, 4, "[]", "Parts."),
    BST_OBJECT(gadget, map, map_table, "{}", "A map."),
    BST_CONFIG_END};

static const bst_port gimbal_ports[] = {
    {.channel = "los_command", .direction = BST_PORT_IN, .flags = BST_PORT_FEEDBACK},
    {.channel = "tracks", .direction = BST_PORT_IN},
    {.channel = "los_history", .direction = BST_PORT_OUT},
    {.channel = "nav_telemetry", .direction = BST_PORT_MODIFY}};

static const bst_module_desc gimbal_a = {.abi = BST_MODULE_ABI,
                                         .role = "gimbal",
                                         .type = "two_axis",
                                         .doc = "Gimbal A.",
                                         .config = gadget_table,
                                         .config_bytes = sizeof(gadget),
                                         .default_rate_hz = 1000,
                                         .ports = gimbal_ports,
                                         .port_count = 4};
static const bst_module_desc gimbal_b = {
    .abi = BST_MODULE_ABI, .role = "gimbal", .type = "ideal", .doc = "Gimbal B."};
static const bst_module_desc tracker = {
    .abi = BST_MODULE_ABI, .role = "tracker", .type = "ekf", .doc = "Tracker."};
static const bst_module_desc *const modules[] = {&gimbal_a, &gimbal_b, &tracker};
static const bst_scenario_registry registry = {.modules = modules, .count = 3};

#define HEAD "\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 300"
#define ORBIT "\"orbit\": {\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089}"
#define CAMERA "\"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15}"
#define OBSERVER(name_, sensor_) \
    "{\"name\": \"" name_ "\", " ORBIT ", \"sensors\": [{" sensor_ "}]}"
#define SCENARIO(modules_) \
    "{" HEAD ", \"observers\": [" OBSERVER("sat", CAMERA ", \"modules\": {" modules_ "}") "]}"

static bst_status read_named(bst_ctx *ctx, const char *name, const char *text, bst_scenario *out) {
    bst_json *json = NULL;
    bst_assert_ok(ctx, bst_json_parse(ctx, name, text, strlen(text), &json));
    bst_status status = bst_scenario_read(ctx, json, &registry, out);
    bst_json_free(json);
    return status;
}

static void refuse(const char *text, const char *message) {
    bst_ctx ctx = {0};
    bst_scenario scenario;
    assert_int_equal(read_named(&ctx, "scenarios/x.json", text, &scenario), BST_ERR_CONFIG);
    assert_string_equal(ctx.message, message);
    bst_scenario_free(&scenario);
}

static void wrong_modules_are_refused(void **state) {
    (void)state;
    refuse(SCENARIO("\"gimball\": {\"type\": \"ideal\"}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimball: no module of this name "
           "(allowed: \"gimbal\", \"tracker\")");
    refuse(SCENARIO("\"gimbal\": {\"type\": \"three_axis\"}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/type: there is no gimbal of "
           "type \"three_axis\" (allowed: \"two_axis\", \"ideal\")");
    refuse(SCENARIO("\"gimbal\": \"ideal\""),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal: wrong type (found \"ideal\"; "
           "allowed: an object with a \"type\")");
    refuse(SCENARIO("\"gimbal\": {}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/type: missing; it is required: "
           "Which of the alternatives is used.");
    refuse(SCENARIO("\"gimbal\": {\"type\": \"two_axis\"}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/size: missing; it is required: "
           "Size.");
    refuse("{" HEAD ", \"observers\": [" OBSERVER("sat", CAMERA ", \"modules\": []") "]}",
           "scenarios/x.json: /observers/0/sensors/0/modules: wrong type (found []; allowed: an "
           "object)");
    refuse(SCENARIO("\"gimbal\": {\"type\": \"two_axis\", \"size\": 2, \"parts\": [{\"weight\": "
                    "1}, {\"weight\": 11}]}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/parts/1/weight: out of range "
           "(found 11; allowed: a number from 0 to 10 kg)");
}

static void wrong_times_are_refused(void **state) {
    (void)state;
#define GIMBAL "\"gimbal\": {\"type\": \"two_axis\", \"size\": 2, "
#define PATH "scenarios/x.json: /observers/0/sensors/0/modules/gimbal"
    refuse(SCENARIO(GIMBAL "\"rate_hz\": 700}"), PATH
           "/rate_hz: a rate of 700 Hz does not divide the tick rate of 6000 Hz; the nearest "
           "that do are 666.666667 and 750 Hz");
    refuse(SCENARIO(GIMBAL "\"offset_s\": 0.0001}"), PATH
           "/offset_s: a time of 0.0001 s is no whole number of ticks at 6000 Hz; the nearest "
           "that are 0 and 0.000166666666667 s");
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"detections\": 1}}"),
           PATH "/delay_s/detections: not an input of this module (allowed: los_command, tracks)");
    /* neither an output nor what is changed in place can be delayed */
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"los_history\": 1}}"),
           PATH "/delay_s/los_history: not an input of this module (allowed: los_command, tracks)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"nav_telemetry\": 1}}"), PATH
           "/delay_s/nav_telemetry: not an input of this module (allowed: los_command, tracks)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"tracks\": -1}}"),
           PATH "/delay_s/tracks: out of range (found -1; allowed: a number from 0 to 1e6 s)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"tracks\": \"1\"}}"),
           PATH "/delay_s/tracks: wrong type (found \"1\"; allowed: a number from 0 to 1e6 s)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": [1]}"),
           PATH "/delay_s: wrong type (found [1]; allowed: an object of seconds by channel)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": 1}"),
           PATH "/delay_s: wrong type (found 1; allowed: an object of seconds by channel)");
    refuse(SCENARIO(GIMBAL "\"delay_s\": {\"tracks\": 0.00005}}"), PATH
           "/delay_s/tracks: a time of 5e-05 s is no whole number of ticks at 6000 Hz; the "
           "nearest that are 0 and 0.000166666666667 s");
#define REST ", \"observers\": [" OBSERVER("sat", CAMERA) "]}"
    refuse(
        "{\"boresight\": 1, \"epoch_utc\": \"2022-06-31T00:00:00Z\", \"duration_s\": 1" REST,
        "scenarios/x.json: /epoch_utc: \"2022-06-31T00:00:00Z\": month 06 of 2022 has no day 31");
    refuse(
        "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T00:00:00Z\", \"duration_s\": 0.33335" REST,
        "scenarios/x.json: /duration_s: a time of 0.33335 s is no whole number of ticks at 6000 "
        "Hz; the nearest that are 0.333333333333 and 0.3335 s");
}

static void missing_keys_and_names_are_refused(void **state) {
    (void)state;
    refuse(
        "{\"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 1" REST,
        "scenarios/x.json: /boresight: missing; it is required: Version of the scenario format.");
    refuse("{\"boresight\": 2, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 1" REST,
           "scenarios/x.json: /boresight: out of range (found 2; allowed: 1)");
    refuse("{\"boresight\": 1, \"duration_s\": 1" REST,
           "scenarios/x.json: /epoch_utc: missing; it is required: Start of the simulated time, "
           "UTC: YYYY-MM-DDThh:mm:ss[.f]Z.");
    refuse("{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\"" REST,
           "scenarios/x.json: /duration_s: missing; it is required: Length of the simulated time.");
    refuse("{" HEAD "}",
           "scenarios/x.json: /observers: missing; it is required: The spacecraft that look.");
    refuse("{" HEAD ", \"observers\": [{\"name\": \"a\", " ORBIT ", \"sensors\": [{}]}]}",
           "scenarios/x.json: /observers/0/sensors/0/camera: missing; it is required: Optics and "
           "detector.");
    refuse("{" HEAD ", \"observers\": [" OBSERVER("sat", CAMERA) ", " OBSERVER("sat", CAMERA) "]}",
           "scenarios/x.json: /observers/1/name: \"sat\" is the name of /observers/0 too");
    refuse("{" HEAD ", \"observers\": [" OBSERVER("s a", CAMERA) "]}",
           "scenarios/x.json: /observers/0/name: \"s a\" is no name (allowed: letters, digits, _ - "
           ".)");
    refuse("{" HEAD ", \"observers\": [" OBSERVER("a/b", CAMERA) "]}",
           "scenarios/x.json: /observers/0/name: \"a/b\" is no name (allowed: letters, digits, _ - "
           ".)");
    refuse("{" HEAD ", \"observers\": [" OBSERVER("sat", CAMERA "}, {" CAMERA) "]}",
           "scenarios/x.json: /observers/0/sensors/1/name: \"camera\" is the name of sensor 0 too");
}

static const char full[] = SCENARIO(
    "\"tracker\": {\"type\": \"ekf\", \"description\": \"words\"}, \"gimbal\": {\"type\": "
    "\"two_axis\", \"size\": 2, \"gain_px\": 0.123456789012345, \"rate_hz\": 600, \"offset_s\": "
    "0.0005, \"delay_s\": {\"tracks\": 0.15, \"los_command\": 0}, \"parts\": [{}, {\"weight\": "
    "2}]}");

static void modules_are_read(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_scenario s;
    bst_assert_ok(&ctx, read_named(&ctx, "scenarios/x.json", full, &s));
    assert_int_equal(s.duration_ticks, 1800000);
    assert_int_equal(s.seed, 1);
    assert_int_equal(s.module_count, 2);
    const bst_scenario_module_config *t = &s.modules[0], *g = &s.modules[1];
    assert_string_equal(t->name, "tracker");
    assert_ptr_equal(t->desc, &tracker);
    assert_int_equal(t->period_ticks, 0);
    assert_ptr_equal(g->desc, &gimbal_a);
    assert_int_equal(g->period_ticks, 10);
    assert_int_equal(g->offset_ticks, 3);
    assert_int_equal(g->delay_count, 2);
    assert_int_equal(g->delays[0].port, 1);
    assert_int_equal(g->delays[0].ticks, 900);
    const gadget *config = g->config;
    assert_true(config->gain_px == 0.123456789012345); /* read as it is written */
    assert_int_equal(config->parts.count, 2);
    bst_scenario_free(&s);
    /* the module's default rate */
    bst_assert_ok(&ctx,
                  read_named(&ctx, "scenarios/x.json",
                             SCENARIO("\"gimbal\": {\"type\": \"two_axis\", \"size\": 1}"), &s));
    assert_int_equal(s.modules[0].period_ticks, 6);
    bst_scenario_free(&s);
}

static void an_echo_reads_back_as_itself(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_scenario s;
    bst_assert_ok(&ctx, read_named(&ctx, "scenarios/x.json", full, &s));
    cJSON *first = bst_scenario_echo(&s);
    char *first_text = cJSON_Print(first);
    bst_scenario_free(&s);
    /* under another name, in another folder */
    bst_assert_ok(&ctx, read_named(&ctx, "/tmp/scenario.json", first_text, &s));
    cJSON *second = bst_scenario_echo(&s);
    char *second_text = cJSON_Print(second);
    assert_string_equal(first_text, second_text);
    assert_non_null(strstr(first_text, "\"tracks\":\t0.15"));
    assert_non_null(strstr(first_text, "\"gain_px\":\t0.123456789012345"));
    assert_non_null(strstr(first_text, "\"rate_hz\":\t600"));
    bst_scenario_free(&s);
    cJSON_free(first_text);
    cJSON_free(second_text);
    cJSON_Delete(first);
    cJSON_Delete(second);
}

static void paths_are_made_absolute(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_scenario s;
    char expected[4096];
    assert_non_null(realpath("scenarios/catalogue_2022-06.tle", expected));
    const bst_observer_config *o;
    /* relative to the scenario's folder, not to ours */
    bst_assert_ok(&ctx, read_named(&ctx, "scenarios/x.json", SCENARIO(""), &s));
    o = s.observers.items;
    assert_string_equal(o->orbit.elements_file, expected);
    assert_string_equal(s.world.star_catalogue, "default"); /* words stay words */
    assert_string_equal(s.world.earth_orientation, "builtin");
    bst_scenario_free(&s);
    /* a module's files too; those have to be there */
    bst_assert_ok(
        &ctx, read_named(&ctx, "scenarios/x.json",
                         SCENARIO(GIMBAL "\"map\": {\"file\": \"catalogue_2022-06.tle\"}}"), &s));
    const gadget *config = s.modules[0].config;
    assert_string_equal(config->map.file, expected);
    cJSON *echo = bst_scenario_echo(&s);
    char *text = cJSON_PrintUnformatted(echo);
    assert_non_null(strstr(text, expected));
    cJSON_free(text);
    cJSON_Delete(echo);
    bst_scenario_free(&s);
    refuse(SCENARIO(GIMBAL "\"map\": {\"file\": \"maps/dark.fits\"}}"),
           PATH "/map/file: there is no file scenarios/maps/dark.fits");
    /* a file that is not there is left to those who open it */
    bst_assert_ok(&ctx, read_named(&ctx, "x.json", SCENARIO(""), &s));
    o = s.observers.items;
    assert_string_equal(o->orbit.elements_file, "catalogue_2022-06.tle");
    bst_scenario_free(&s);

    /* deep down in the file system, so that the full path does not fit */
    char top[BST_TEST_PATH], home[4096], name[201], message[6000];
    bst_test_template(top, "boresight-test");
    assert_non_null(mkdtemp(top));
    assert_non_null(getcwd(home, sizeof home));
    memset(name, 'd', 200);
    name[200] = '\0';
    assert_int_equal(chdir(top), 0);
    for (int i = 0; i < 3; i++) {
        char command[300];
        snprintf(command, sizeof command, "mkdir %s", name);
        assert_int_equal(system(command), 0);
        assert_int_equal(chdir(name), 0);
    }
    FILE *file = fopen("catalogue_2022-06.tle", "w");
    assert_non_null(file);
    fclose(file);
    assert_int_equal(read_named(&ctx, "x.json", SCENARIO(""), &s), BST_ERR_CONFIG);
    assert_non_null(realpath("catalogue_2022-06.tle", expected));
    snprintf(
        message, sizeof message,
        "x.json: /observers/0/orbit/elements_file: the full path of \"catalogue_2022-06.tle\" is "
        "%zu bytes long (allowed: 511); move the file",
        strlen(expected));
    assert_string_equal(ctx.message, message);
    bst_scenario_free(&s);
    assert_int_equal(chdir(home), 0);
    snprintf(message, sizeof message, "rm -r %s", top);
    assert_int_equal(system(message), 0);
}

/* A reader of a recorded run loads nothing of it. */
static void plugins_can_be_left_out(void **state) {
    (void)state;
    const char *text = SCENARIO(
        "\"gimbal\": {\"plugin\": \"none.so\", \"gain\": 3}, "
        "\"tracker\": {\"type\": \"ekf\"}");
    bst_scenario_registry without = registry;
    bst_json *json = NULL;
    bst_scenario s;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "scenarios/x.json", text, strlen(text), &json));
    without.policy = BST_PLUGINS_SKIP;
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, &without, &s));
    assert_int_equal(s.module_count, 1);
    assert_ptr_equal(s.modules[0].desc, &tracker);
    assert_int_equal(s.plugin_count, 0);
    bst_scenario_free(&s);
    without.policy = BST_PLUGINS_REFUSE;
    assert_int_equal(bst_scenario_read(&ctx, json, &without, &s), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "scenarios/x.json: "
                        "/observers/0/sensors/0/modules/gimbal/plugin: plug-ins are "
                        "not loaded here, as --no-plugins asks (found \"none.so\")");
    bst_scenario_free(&s);
    bst_json_free(json);
    refuse(text,
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/plugin: plug-in "
           "scenarios/none.so: there is no such file; build it, or correct the path");
    refuse(SCENARIO("\"gimbal\": {\"plugin\": 3}"),
           "scenarios/x.json: /observers/0/sensors/0/modules/gimbal/plugin: wrong type (found 3; "
           "allowed: a string of at most 511 bytes)");
}

static void the_schema_lists_every_module(void **state) {
    (void)state;
    cJSON *schema = bst_scenario_schema(&registry);
    char *text = cJSON_Print(schema);
    cJSON *again = cJSON_ParseWithOpts(text, NULL, 1);
    assert_non_null(again);
    const char *const down[] = {"properties", "observers",  "items",   "properties", "sensors",
                                "items",      "properties", "modules", "properties"};
    const cJSON *node = again;
    for (size_t i = 0; i < sizeof down / sizeof *down; i++) {
        node = cJSON_GetObjectItemCaseSensitive(node, down[i]);
        assert_non_null(node);
    }
    for (int m = 0; m < registry.count; m++) {
        const cJSON *choices = cJSON_GetObjectItemCaseSensitive(
            cJSON_GetObjectItemCaseSensitive(node, modules[m]->role), "oneOf");
        int found = 0, unknown = 0;
        const cJSON *choice;
        cJSON_ArrayForEach(choice, choices) {
            const cJSON *properties = cJSON_GetObjectItemCaseSensitive(choice, "properties");
            if (cJSON_GetObjectItemCaseSensitive(properties, "plugin")) {
                unknown++;
                continue;
            }
            const cJSON *type = cJSON_GetObjectItemCaseSensitive(
                cJSON_GetObjectItemCaseSensitive(properties, "type"), "const");
            found += strcmp(cJSON_GetStringValue(type), modules[m]->type) == 0;
            assert_non_null(cJSON_GetObjectItemCaseSensitive(properties, "rate_hz"));
            assert_true(
                cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(choice, "additionalProperties")));
        }
        assert_int_equal(found, 1);
        assert_int_equal(unknown, 1); /* that of a plug-in */
    }
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(
                         cJSON_GetObjectItemCaseSensitive(node, "gimbal"), "oneOf")),
                     3);
    /* what can be delayed */
    assert_non_null(strstr(text, "\"los_command\""));
    assert_null(strstr(text, "\"los_history\""));
    assert_null(strstr(text, "\"nav_telemetry\""));
    cJSON_free(text);
    cJSON_Delete(again);
    cJSON_Delete(schema);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_modules_are_refused),
        cmocka_unit_test(wrong_times_are_refused),
        cmocka_unit_test(missing_keys_and_names_are_refused),
        cmocka_unit_test(modules_are_read),
        cmocka_unit_test(an_echo_reads_back_as_itself),
        cmocka_unit_test(paths_are_made_absolute),
        cmocka_unit_test(the_schema_lists_every_module),
        cmocka_unit_test(plugins_can_be_left_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
