/* Headers of recorded frames as times of a run, and the scenario that is made of them. Linked with
 * wraps of files and keyword map. */
#include <cjson/cJSON.h>

#include "sim/cli/shipped.h"
#include "sim/process/process_internal.h"
#include "tests/test_support.h"

enum { FRAMES = 4 };

static struct {
    double start_s[FRAMES], exposure_s;
    int files, width[FRAMES];
    bst_time begin;
    const char *camera; /* of the map, JSON */
    bool flipped;       /* rows as they were read last */
} script;

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

WRAP(bst_status, bst_cli_find_keyword_map, (bst_ctx * ctx, const char *name, char *path)) {
    (void)ctx;
    (void)name;
    path[0] = '\0';
    return BST_OK;
}

WRAP(bst_status, bst_keyword_map_load, (bst_ctx * ctx, const char *path, bst_keyword_map *out)) {
    (void)ctx;
    (void)path;
    *out = (bst_keyword_map){
        .pedestal_dn = 32768.0,
        .dn_per_unit = 2.0,
        .pixel_scale_arcsec = {.keyword = "SCALE", .factor = 3.0, .value = 25.0 / 6.0}};
    snprintf(out->time.keyword, sizeof out->time.keyword, "DATE-OBS");
    return BST_OK;
}

WRAP(bst_status, bst_keyword_map_camera, (bst_ctx * ctx, const char *path, struct cJSON **out)) {
    (void)ctx;
    (void)path;
    *out = cJSON_Parse(script.camera);
    return BST_OK;
}

WRAP(bst_status, bst_recorded_frames_open,
     (bst_ctx * ctx, const char *const *paths, int count, const bst_keyword_map *map,
      bst_recorded_frames **out)) {
    (void)ctx;
    (void)paths;
    (void)count;
    (void)map;
    *out = NULL;
    return BST_OK;
}

WRAP(int64_t, bst_recorded_frames_count, (const bst_recorded_frames *frames)) {
    (void)frames;
    return FRAMES;
}

WRAP(int, bst_recorded_frames_files, (const bst_recorded_frames *frames)) {
    (void)frames;
    return script.files;
}

WRAP(bst_frame_source *, bst_recorded_frames_source, (bst_recorded_frames * frames)) {
    (void)frames;
    return NULL;
}

WRAP(bst_status, bst_keyword_attitude,
     (bst_ctx * ctx, const bst_keyword_map *map, bst_frame_source *source,
      const bst_frame_place *frame, bool flip_rows, bool *has, bst_quat *q_cam_from_gcrf)) {
    (void)ctx;
    (void)map;
    (void)source;
    (void)frame;
    (void)flip_rows;
    (void)q_cam_from_gcrf;
    *has = false;
    return BST_OK;
}

WRAP(const char *, bst_keyword_name,
     (bst_frame_source * source, const char *keywords, char *text)) {
    (void)source;
    return strcpy(text, keywords);
}

WRAP(void, bst_keyword_rate_trend,
     (bst_ctx * ctx, const bst_keyword_map *map, bst_frame_source *source,
      const bst_frame_place *frame, double exposure_s, double *trend, double *sigma)) {
    (void)ctx;
    (void)map;
    (void)source;
    (void)frame;
    (void)exposure_s;
    *trend = *sigma = NAN;
}

WRAP(bst_status, bst_recorded_frames_select,
     (bst_ctx * ctx, bst_recorded_frames *frames, int64_t index,
      const bst_recorded_options *options, bst_recorded_frame *out)) {
    (void)ctx;
    (void)frames;
    double scale_arcsec = NAN; /* without a map: only the keyword's name is looked for */
    if (options->map) {
        const bst_keyword_number *scale = &options->map->pixel_scale_arcsec;
        scale_arcsec = scale->factor * scale->value;
    }
    script.flipped = options->flip_rows;
    *out =
        (bst_recorded_frame){.path = "some.fits",
                             .place = {.hdu = (int)index + 1, .plane = -1},
                             .width = script.width[index],
                             .height = 400,
                             .values = {.start = bst_time_add(script.begin, script.start_s[index]),
                                        .exposure_s = script.exposure_s,
                                        .gain_e_per_dn = 3.0,
                                        .read_noise_e = 7.0,
                                        .offset_dn = 50.0,
                                        .full_well_e = 9e4,
                                        .pixel_scale_arcsec = scale_arcsec}};
    return BST_OK;
}

static bst_process_request request = {.catalogue = "embedded", .out = "folder/some run"};

static void begin(void) {
    bst_ctx ctx = {0};
    static const double starts[FRAMES] = {0.0, 2.50004, 5.00006, 30.0};
    memset(&script, 0, sizeof script);
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2024-01-01T12:00:00Z", &script.begin));
    for (int i = 0; i < FRAMES; i++) {
        script.start_s[i] = starts[i];
        script.width[i] = 600;
    }
    script.exposure_s = 1.50004;
    script.files = 1;
    script.camera = "{\"aperture_m\": 0.2, \"obscuration\": 0.1}";
}

static bst_status survey(bst_ctx *ctx, bst_process *p) {
    static const char *const paths[] = {"some.fits"};
    *p = (bst_process){.request = &request};
    return bst_process_survey(ctx, p, paths, 1);
}

static void ticks_are_the_nearest(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process p;
    begin();
    bst_assert_ok(&ctx, survey(&ctx, &p));
    static const int64_t want[FRAMES] = {0, 25000, 50001, 300000};
    for (int i = 0; i < FRAMES; i++) {
        assert_int_equal(p.frames[i].start_tick, want[i]);
        assert_int_equal(p.frames[i].exposure_ticks, 15000);
        assert_int_equal(p.frames[i].index, i);
    }
    assert_int_equal(p.width, 600);
    assert_int_equal(p.height, 400);
    bst_assert_close(p.scale_arcsec, 12.5, 0.0);
    free(p.frames);
    begin();
    script.exposure_s = 1.50006;
    bst_assert_ok(&ctx, survey(&ctx, &p));
    assert_int_equal(p.frames[2].exposure_ticks, 15001);
    free(p.frames);
}

/* The request's scale goes before the map's, which is 12.5; rows are read as it says. */
static void request_goes_before_the_map(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process p;
    static const int flips[] = {BST_PROCESS_FLIP_AUTO, BST_PROCESS_FLIP_NO, BST_PROCESS_FLIP_YES};
    for (int i = 0; i < 3; i++) {
        begin();
        request.scale_arcsec = i == 1 ? 0.0 : 7.25;
        request.flip = flips[i];
        bst_assert_ok(&ctx, survey(&ctx, &p));
        bst_assert_close(p.scale_arcsec, i == 1 ? 12.5 : 7.25, 1e-12);
        assert_string_equal(p.map.pixel_scale_arcsec.keyword, i == 1 ? "SCALE" : "");
        assert_int_equal(script.flipped, flips[i] == BST_PROCESS_FLIP_YES);
        free(p.frames);
    }
    request.scale_arcsec = 0.0;
    request.flip = BST_PROCESS_FLIP_AUTO;
}

static void frames_follow_each_other(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process p;
    begin();
    script.start_s[3] = 1.0; /* a frame a file: any order; not two at once */
    script.start_s[1] = 3.0;
    script.files = FRAMES;
    script.exposure_s = 1.0;
    bst_assert_ok(&ctx, survey(&ctx, &p));
    assert_int_equal(p.frames[1].index, 3);
    assert_int_equal(p.frames[1].start_tick, 10000);
    free(p.frames);
    script.files = 1;
    assert_int_equal(survey(&ctx, &p), BST_ERR_ARGUMENT);
    assert_non_null(
        strstr(ctx.message, "some.fits: HDU 4: DATE-OBS begins 5.0001 s before the end"));
    free(p.frames);
    begin();
    script.exposure_s = 2.6; /* 0.1 s into the next one */
    assert_int_equal(survey(&ctx, &p), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "HDU 2: DATE-OBS begins 0.1 s before"));
    free(p.frames);
    begin();
    script.width[2] = 601;
    assert_int_equal(survey(&ctx, &p), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "HDU 3: NAXIS1 and NAXIS2 give 601 x 400 pixels"));
    free(p.frames);
}

static const cJSON *member(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(node, key);
    if (!item) {
        fail_msg("there is no %s", key);
    }
    return item;
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = member(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

static void scenario_has_the_frames_camera_and_times(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process p;
    cJSON *root;
    begin();
    bst_assert_ok(&ctx, survey(&ctx, &p));
    p.zero_point_mag = 19.5;
    bst_assert_ok(&ctx, bst_process_make_scenario(&ctx, &p, &root));
    assert_string_equal(member(root, "name")->valuestring, "some_run");
    assert_string_equal(member(root, "epoch_utc")->valuestring, "2024-01-01T12:00:00.000000000Z");
    bst_assert_close(number(root, "duration_s"), 30.0 + 1.5 + 1.0, 1e-9);
    bst_assert_close(number(root, "tick_rate_hz"), 10000, 0.0);
    bst_assert_close(number(member(root, "record"), "telemetry_hz"), 34.0, 0.0); /* 50 in 1.5 s */
    const cJSON *sensor = member(member(root, "observers")->child, "sensors")->child;
    const cJSON *c = member(sensor, "camera");
    bst_assert_close(number(c, "width_px"), 600, 0.0);
    bst_assert_close(number(c, "height_px"), 400, 0.0);
    bst_assert_close(number(c, "pixel_scale_arcsec"), 12.5, 0.0);
    bst_assert_close(number(c, "aperture_m"), 0.2, 0.0);
    bst_assert_close(number(c, "gain_e_per_dn"), 1.5, 0.0); /* two counts for each unit */
    bst_assert_close(number(c, "read_noise_e"), 7.0, 0.0);
    bst_assert_close(number(c, "full_well_e"), 9e4, 0.0);
    bst_assert_close(number(c, "offset_dn"), 32768.0 + 100.0, 0.0);
    /* one electron a second of V = 19.5, with the usual throughput and efficiency */
    double area = 0.25 * BST_PI * 0.2 * 0.2 * 0.9;
    bst_assert_close(
        number(c, "photon_flux_v0_per_s_m2") * area * 0.8 * 0.8 * pow(10.0, -0.4 * 19.5), 1.0,
        1e-9);
    bst_assert_close(number(member(sensor, "exposure"), "exposure_s"), 1.5, 0.0);
    bst_assert_close(number(member(sensor, "exposure"), "period_s"), 3.5, 0.0);
    const cJSON *modules = member(sensor, "modules");
    const cJSON *platform = member(member(modules, "gimbal"), "platform");
    bst_assert_close(number(platform, "history_s"), 6.0, 0.0);
    bst_assert_close(number(platform, "telemetry_history_s"), 10.0, 0.0);
    /* two and a half of the longest time between two frames */
    bst_assert_close(number(member(modules, "tracker"), "initiation_gap_s"), 2.5 * 24.9999, 1e-9);
    cJSON_Delete(root);
    /* a band gives its own light, and overscan its own level */
    script.camera = "{\"band\": {}, \"gain_e_per_dn\": 2.25}";
    snprintf(p.map.bias_section, sizeof p.map.bias_section, "BIASSEC");
    bst_assert_ok(&ctx, bst_process_make_scenario(&ctx, &p, &root));
    c = member(member(member(root, "observers")->child, "sensors")->child, "camera");
    assert_null(cJSON_GetObjectItem(c, "photon_flux_v0_per_s_m2"));
    bst_assert_close(number(c, "offset_dn"), 32768.0, 0.0);
    bst_assert_close(number(c, "gain_e_per_dn"), 2.25, 0.0);
    bst_assert_close(number(c, "aperture_m"), 0.1, 0.0);
    cJSON_Delete(root);
    free(p.frames);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ticks_are_the_nearest),
        cmocka_unit_test(request_goes_before_the_map),
        cmocka_unit_test(frames_follow_each_other),
        cmocka_unit_test(scenario_has_the_frames_camera_and_times),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
