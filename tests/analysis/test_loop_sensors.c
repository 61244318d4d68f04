/* boresight loop over the sensors of a scenario: the file that it writes, and its refusals. */
#include <cjson/cJSON.h>
#include <unistd.h>

#include "sim/analysis/loop/loop_sensors.h"
#include "sim/cli/load.h"
#include "tests/test_support.h"

static bst_status analyse(bst_ctx *ctx, const char *file, const bst_loop_report_request *request) {
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_option none[] = {{.name = NULL}};
    bst_assert_ok(ctx, bst_load_check(ctx, &load, none));
    bst_assert_ok(ctx, bst_load_scenario(ctx, file, &load, &json, &scenario));
    bst_status status = bst_loop_report_sensors(ctx, request, &scenario);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

static void test_all_sensors_are_in_the_file(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH], text[65536];
    bst_test_template(path, "loop");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    const bst_loop_report_request all = {.loop = BST_LOOP_DEFAULTS, .json = path};
    bst_assert_ok(&ctx, analyse(&ctx, "scenarios/constellation_quick.json", &all));
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t bytes = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[bytes] = '\0';
    cJSON *root = cJSON_Parse(text);
    const cJSON *sensors = cJSON_GetObjectItem(root, "sensors");
    assert_int_equal(cJSON_GetArraySize(sensors), 5); /* observers with one each */
    assert_string_equal(cJSON_GetObjectItem(root, "scenario")->valuestring, "constellation_quick");
    cJSON_Delete(root);
    unlink(path);
}

static void test_refusals(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_loop_report_request unknown = {.loop = BST_LOOP_DEFAULTS, .sensor = "no/sensor"};
    assert_int_equal(analyse(&ctx, "scenarios/two_observers.json", &unknown), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "no/sensor"));
    const bst_loop_report_request all = {.loop = BST_LOOP_DEFAULTS};
    /* its attitudes are scripted */
    assert_int_equal(analyse(&ctx, "scenarios/two_observers.json", &all), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "no sensor has a mount that moves under command"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_sensors_are_in_the_file),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
