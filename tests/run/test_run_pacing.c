/* What the manifest has of a run that follows the clock, and the room that frames need. */
#include <cjson/cJSON.h>

#include "sim/io/fits_frames.h"
#include "sim/run/run_pacing.h"
#include "sim/run/run_space.h"
#include "tests/test_support.h"

static bst_pacing_figures figures;
static bool paced, linked;
static int gathered;
static int64_t free_bytes;
static char heard[1000];

bool __wrap_bst_engine_pacing(const bst_engine *engine, bst_pacing_figures *out);
bst_engine *__wrap_bst_simulation_engine(bst_simulation *simulation);
struct bst_link *__wrap_bst_simulation_link(bst_simulation *simulation);
bst_status __wrap_bst_link_gather(bst_ctx *ctx, struct bst_link *link);
int64_t __wrap_bst_run_free_bytes(const char *path);

bool __wrap_bst_engine_pacing(const bst_engine *engine, bst_pacing_figures *out) {
    (void)engine;
    *out = figures;
    return paced;
}
bst_engine *__wrap_bst_simulation_engine(bst_simulation *simulation) {
    (void)simulation;
    return NULL;
}
struct bst_link *__wrap_bst_simulation_link(bst_simulation *simulation) {
    (void)simulation;
    return linked ? (struct bst_link *)&linked : NULL;
}
bst_status __wrap_bst_link_gather(bst_ctx *ctx, struct bst_link *link) {
    assert_ptr_equal(link, &linked);
    gathered++;
    return bst_fail(ctx, BST_ERR_IO, "no peers");
}
int64_t __wrap_bst_run_free_bytes(const char *path) {
    assert_string_equal(path, "OUT");
    return free_bytes;
}

static void hear(void *user, bst_log_level level, const char *message) {
    (void)user;
    snprintf(heard, sizeof heard, "%d %s", (int)level, message);
}

static void expect(const bst_scenario *scenario, const char *wanted) {
    cJSON *root = cJSON_CreateObject();
    bst_run_pacing_add(root, scenario, NULL);
    char *text = cJSON_PrintUnformatted(root);
    assert_string_equal(text, wanted);
    cJSON_free(text);
    cJSON_Delete(root);
}

static void manifest(void **state) {
    (void)state;
    bst_scenario s = {
        .pacing = {.mode = BST_PACING_REALTIME, .overrun = BST_OVERRUN_HOLD, .speed = 2.5}};
    figures = (bst_pacing_figures){.frames = 40,
                                   .dropped = 3,
                                   .done = 32,
                                   .late = 5,
                                   .overruns = 7,
                                   .slipped_s = 0.75,
                                   .longest_s = 0.5,
                                   .sum_s = 4,
                                   .deadline_s = 0.25,
                                   .histogram = {1, 2, [14] = 8, [15] = 21},
                                   .priority = true};
    paced = linked = false;
    expect(&s, "{\"pacing\":{\"mode\":\"lockstep\",\"repeats\":true}}");
    paced = true;
#define REST                                                                                       \
    "\"response_longest_s\":0.5,\"response_up_to_ms\":[1,2,5,10,15,20,25,30,40,50,75,100,200,500," \
    "1000,null],\"response_frames\":[1,2,0,0,0,0,0,0,0,0,0,0,0,0,8,21]}}"
#define CLOCK                                                                                      \
    "\"deadline_s\":0.25,\"late\":5,\"overruns\":7,\"dropped\":3,\"slipped_s\":0.75,\"priority\":" \
    "true,\"cpu\":false,\"response_mean_s\":0.125," REST
    expect(&s,
           "{\"pacing\":{\"mode\":\"realtime\",\"repeats\":true,\"frames\":40,\"done\":32,"
           "\"speed\":2.5,\"overrun\":\"hold\"," CLOCK);
    linked = true; /* peers answer when they can */
    expect(&s,
           "{\"pacing\":{\"mode\":\"realtime\",\"repeats\":false,\"frames\":40,\"done\":32,"
           "\"speed\":2.5,\"overrun\":\"hold\"," CLOCK);
    linked = false;
    s.pacing.overrun = BST_OVERRUN_DROP; /* frames were dropped */
    expect(&s,
           "{\"pacing\":{\"mode\":\"realtime\",\"repeats\":false,\"frames\":40,\"done\":32,"
           "\"speed\":2.5,\"overrun\":\"drop\"," CLOCK);
    figures.done = 0;
    s.pacing.mode = BST_PACING_FAST;
    expect(&s,
           "{\"pacing\":{\"mode\":\"fast\",\"repeats\":true,\"frames\":40,\"done\":0,"
           "\"response_mean_s\":0," REST);
}

static void peers(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, hear, NULL, BST_LOG_INFO);
    bst_scenario s = {.pacing = {.mode = BST_PACING_FAST}};
    for (int k = 0; k < 8; k++) {
        paced = k & 1;
        linked = k & 2;
        s.pacing.mode = k & 4 ? BST_PACING_FAST : BST_PACING_REALTIME;
        gathered = 0;
        *heard = '\0';
        bst_status status = bst_run_pacing_begin(&ctx, &s, NULL);
        assert_int_equal(gathered, paced && linked);
        assert_int_equal(status, paced && linked ? BST_ERR_IO : BST_OK);
        assert_int_equal(*heard != '\0', k == 7);
    }
}

/* Two sensors: 100 x 200 px each 0.5 s from 10 s on, of which the last exposure begins at 999.5 s,
 * and every 7 s a window of 1801 x 1201 px, binned by 2, of which the last one ends at the end of
 * the run and is not recorded. */
static void room(void **state) {
    (void)state;
    bst_sensor_config sensors[2] = {0};
    bst_observer_config observers[2] = {0};
    bst_scenario s = {.duration_s = 1000};
    sensors[0].camera.width_px = 100;
    sensors[0].camera.height_px = 200;
    sensors[0].exposure.first_s = 10;
    sensors[0].exposure.period_s = 0.5;
    sensors[0].exposure.exposure_s = 0.1;
    sensors[1].camera.width_px = sensors[1].camera.height_px = 3000;
    sensors[1].exposure = (bst_exposure_config){
        .period_s = 7, .exposure_s = 6, .binning = 2, .window_px = {100, 50, 1801, 1201}};
    for (int i = 0; i < 2; i++) {
        observers[i].sensors.items = &sensors[i];
        observers[i].sensors.count = 1;
    }
    s.observers.items = observers;
    s.observers.count = 2;
    s.record.frames = BST_RECORD_EXTENSIONS;
    const double pixels = 1980.0 * 20000 + 142.0 * 900.0 * 600.0;
    const struct {
        bool compressed;
        uint32_t planes;
        double per_pixel;
    } cases[] = {{false, 0, 2},
                 {false, 1u << BST_PLANE_SATURATION, 3},
                 {true, 0, 1},
                 {true, (1u << BST_PLANE_SATURATION) | (1u << BST_PLANE_STARS), 6},
                 {true, (1u << BST_PLANE_SATURATION) | (1u << BST_PLANE_PARTS), 6}};
    bst_ctx ctx;
    bst_ctx_init(&ctx, hear, NULL, BST_LOG_INFO);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[100];
        double bytes = pixels * cases[i].per_pixel;
        s.record.compression = cases[i].compressed ? BST_FITS_RICE : BST_FITS_RAW;
        s.record.planes = cases[i].planes;
        free_bytes = (int64_t)bytes;
        bst_assert_ok(&ctx, bst_run_check_space(&ctx, &s, "OUT", false));
        snprintf(text, sizeof text, "%d OUT: the frames will take about %.1f GB of %.1f GB free",
                 BST_LOG_INFO, bytes * 1e-9, bytes * 1e-9);
        assert_string_equal(heard, text);
        free_bytes--;
        assert_int_equal(bst_run_check_space(&ctx, &s, "OUT", false), BST_ERR_IO);
        bst_assert_ok(&ctx, bst_run_check_space(&ctx, &s, "OUT", true));
        assert_non_null(strstr(heard, "GB are free there"));
        assert_int_equal(heard[0], '0' + BST_LOG_WARNING);
        free_bytes = -1;
        bst_assert_ok(&ctx, bst_run_check_space(&ctx, &s, "OUT", false));
        snprintf(text, sizeof text, "%d OUT: the frames will take about %.1f GB", BST_LOG_INFO,
                 bytes * 1e-9);
        assert_string_equal(heard, text);
    }
    *heard = '\0';
    s.record.frames = BST_RECORD_NO_FRAMES;
    s.record.planes = 0;
    bst_assert_ok(&ctx, bst_run_check_space(&ctx, &s, "OUT", false));
    assert_string_equal(heard, "");
}

/* Frames come no faster than exposures and the rows of a rolling shutter allow. */
static void frames_of_a_cycle(void **state) {
    (void)state;
    bst_scenario s = {.duration_s = 100, .tick_rate_hz = 1000};
    bst_sensor_config sensor = {.exposure = {.period_s = 1, .exposure_s = 0.5}};
    sensor.camera.width_px = sensor.camera.height_px = 1001;
    assert_true(bst_run_sensor_frames(&s, &sensor) == 100);
    sensor.exposure.exposure_s = 4; /* one after the other; the last one ends with the run */
    assert_true(bst_run_sensor_frames(&s, &sensor) == 24);
    sensor.camera.detector.row_time_s = -1e-3; /* 0.5 s before and after the middle row */
    assert_true(bst_run_sensor_frames(&s, &sensor) == 20);
    sensor.exposure.exposure_s = 0.5; /* cycles of 1.5 s, of which the last begins at 98 s */
    sensor.exposure.first_s = 0.5;
    assert_true(bst_run_sensor_frames(&s, &sensor) == 66);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(manifest),
        cmocka_unit_test(peers),
        cmocka_unit_test(frames_of_a_cycle),
        cmocka_unit_test(room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
