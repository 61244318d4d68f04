/* Limits of plots: the stops of mounts of both kinds in the sensor's own scenario, and the limits
 * of wheels, with scenario and rows in place of a run's. */
#include "view/plot_limits.h"

#include "tests/test_support.h"

static const char scenario[] =
    "{\"observers\": [{\"name\": \"eye\", \"sensors\": ["
    "{\"name\": \"a\", \"modules\": {\"gimbal\": {\"inner_travel_deg\": 65}}}, "
    "{\"name\": \"b\", \"modules\": {\"gimbal\": {\"travel_min_deg\": [-120, -30], "
    "\"travel_max_deg\": [150, 80]}}}]}, {\"name\": \"other\", \"sensors\": ["
    "{\"name\": \"a\", \"modules\": {\"gimbal\": {\"travel_min_deg\": [0, -20], "
    "\"travel_max_deg\": [0, 45]}}}, {\"name\": \"b\", \"modules\": {}}]}]}";

static cJSON *root;

const cJSON *__wrap_bst_run_reader_scenario(const bst_run_reader *reader);
const cJSON *__wrap_bst_run_reader_scenario(const bst_run_reader *reader) {
    (void)reader;
    return root;
}

static const double wheels_rpm[] = {6000.0, NAN, 3500.0};
static int row;

bst_status __wrap_bst_io_rows_open(bst_ctx *ctx, const bst_run_reader *run, const char *sql,
                                   int64_t one, int64_t two, bst_io_rows **out);
bst_status __wrap_bst_io_rows_open(bst_ctx *ctx, const bst_run_reader *run, const char *sql,
                                   int64_t one, int64_t two, bst_io_rows **out) {
    (void)ctx, (void)run, (void)sql, (void)two;
    assert_int_equal(one, 7);
    row = -1;
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_io_rows_next(bst_ctx *ctx, bst_io_rows *rows, bool *more);
bst_status __wrap_bst_io_rows_next(bst_ctx *ctx, bst_io_rows *rows, bool *more) {
    (void)ctx, (void)rows;
    *more = ++row < 3;
    return BST_OK;
}

double __wrap_bst_io_rows_real(const bst_io_rows *rows, int column);
double __wrap_bst_io_rows_real(const bst_io_rows *rows, int column) {
    (void)rows;
    assert_int_equal(column, 1);
    return wheels_rpm[row];
}

void __wrap_bst_io_rows_close(bst_io_rows *rows);
void __wrap_bst_io_rows_close(bst_io_rows *rows) {
    (void)rows;
}

typedef struct stop {
    int line;
    double low, high;
} stop;

static void expect(const cJSON *panel, const stop *stops, int count) {
    const cJSON *list = cJSON_GetObjectItem(panel, "stops");
    assert_int_equal(cJSON_GetArraySize(list), count);
    for (int i = 0; i < count; i++) {
        const cJSON *item = cJSON_GetArrayItem(list, i);
        bst_assert_close(cJSON_GetObjectItem(item, "line")->valuedouble, stops[i].line, 0.0);
        bst_assert_close(cJSON_GetObjectItem(item, "low")->valuedouble, stops[i].low, 0.0);
        bst_assert_close(cJSON_GetObjectItem(item, "high")->valuedouble, stops[i].high, 0.0);
    }
}

static void stops_of_each_sensor(void **state) {
    (void)state;
    static const struct {
        const char *observer, *name;
        int count;
        stop stops[2];
    } cases[] = {{"eye", "a", 1, {{1, -65.0, 65.0}}},
                 {"eye", "b", 2, {{0, -120.0, 150.0}, {1, -30.0, 80.0}}},
                 {"other", "a", 1, {{1, -20.0, 45.0}}}, /* the outer axis has no end */
                 {"other", "b", 0, {{0, 0.0, 0.0}}},
                 {"eye", "c", 0, {{0, 0.0, 0.0}}}};
    bst_view_run *run = calloc(1, sizeof *run);
    bst_view_sensor *s = calloc(1, sizeof *s);
    root = cJSON_Parse(scenario);
    assert_true(run && s && root);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        snprintf(s->sensor.observer, sizeof s->sensor.observer, "%s", cases[k].observer);
        snprintf(s->sensor.name, sizeof s->sensor.name, "%s", cases[k].name);
        cJSON *panel = cJSON_CreateObject();
        bst_view_add_stops(run, s, panel);
        expect(panel, cases[k].stops, cases[k].count);
        cJSON_Delete(panel);
    }
    cJSON_Delete(root);
    free(run);
    free(s);
}

static void limits_of_wheels(void **state) {
    (void)state;
    bst_view_run *run = calloc(1, sizeof *run);
    bst_view_sensor *s = calloc(1, sizeof *s);
    assert_true(run && s);
    s->sensor.index = 7;
    cJSON *panel = cJSON_CreateObject();
    bst_view_add_wheel_limits(run, s, panel);
    expect(panel, (const stop[2]){{0, -6000.0, 6000.0}, {2, -3500.0, 3500.0}}, 2);
    assert_string_equal(cJSON_GetObjectItem(panel, "limit_word")->valuestring, "limits");
    cJSON_Delete(panel);
    free(run);
    free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(stops_of_each_sensor),
                                       cmocka_unit_test(limits_of_wheels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
