/* Observations of a track as CSV, JSON and TDM: every number in its column, unit and sign. */
#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/run/track_files.h"
#include "tests/test_support.h"

#define DEG (BST_PI / 180.0)
#define ARCSEC (BST_PI / 648000.0)

static const bst_run_sensor sensor = {
    .index = 1, .observer = "eye", .name = "camera", .target = "PREY, A"};

static bst_run_observation items[2];

/* Sigmas of 2 and 0.5 arcsec with a correlation of -0.3; 3 and 4 with 0.6. */
static bst_run_track make_track(bool target) {
    bst_ctx ctx = {0};
    bst_time start;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &start));
    const double places[2][2] = {{123.4, -56.7}, {350.25, 12.5}};
    const double cov[2][3] = {{4.0, -0.3 * 2.0 * 0.5, 0.25}, {9.0, 0.6 * 12.0, 16.0}};
    for (int i = 0; i < 2; i++) {
        double ra = places[i][0] * DEG, dec = places[i][1] * DEG;
        items[i] = (bst_run_observation){
            .time = bst_time_add(start, 1.25 + 2.5 * i),
            .v_mag = i ? NAN : 11.5,
            .snr = 7.25 + i,
            .od = {.direction = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)},
                   .cov_11 = cov[i][0] * ARCSEC * ARCSEC,
                   .cov_12 = cov[i][1] * ARCSEC * ARCSEC,
                   .cov_22 = cov[i][2] * ARCSEC * ARCSEC,
                   .observer = {.position_m = {1000.0 + i, -2000.0, 3000.0},
                                .velocity_mps = {-40.0, 50.0, 60.0 + i}}}};
    }
    return (bst_run_track){.sensor = &sensor,
                           .id = 7,
                           .target = target,
                           .exposure_s = 0.5,
                           .items = items,
                           .count = 2};
}

static void names(void **state) {
    (void)state;
    char name[96];
    bst_run_track track = make_track(true);
    bst_track_object(&track, name, sizeof name);
    assert_string_equal(name, "PREY, A");
    track = make_track(false);
    bst_track_object(&track, name, sizeof name);
    assert_string_equal(name, "TRACK-7");
    bst_run_sensor none = sensor;
    none.target[0] = '\0';
    track = make_track(true);
    track.sensor = &none;
    bst_track_object(&track, name, sizeof name);
    assert_string_equal(name, "TRACK-7");
}

static void csv(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char *text;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    const bst_run_track track = make_track(true);
    bst_track_csv_head(out);
    bst_assert_ok(&ctx, bst_track_write_csv(&ctx, out, &track));
    fclose(out);
    const char *row = strstr(text, "\r\n");
    assert_non_null(row);
    assert_int_equal(strncmp(text, "utc,track,object,sensor,ra_deg,dec_deg,ra_sigma_arcsec,", 54),
                     0);
    double n[13];
    assert_int_equal(
        sscanf(row + 2,
               "2022-06-16T22:10:01.250000Z,eye/camera/7,\"PREY, A\",eye/camera,%lf,%lf,%lf,"
               "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf",
               n, n + 1, n + 2, n + 3, n + 4, n + 5, n + 6, n + 7, n + 8, n + 9, n + 10, n + 11,
               n + 12),
        13);
    const double first[13] = {123.4, -56.7, 2.0,  0.5,   -0.3, 11.5, 7.25,
                              1000,  -2000, 3000, -40.0, 50.0, 60.0};
    for (int k = 0; k < 13; k++) {
        bst_assert_close(n[k], first[k], 1e-9 * fabs(first[k]));
    }
    row = strstr(row + 2, "\r\n");
    assert_non_null(row);
    /* no magnitude: an empty cell */
    assert_int_equal(
        sscanf(row + 2,
               "2022-06-16T22:10:03.750000Z,eye/camera/7,\"PREY, A\",eye/camera,%lf,%lf,%lf,"
               "%lf,%lf,,%lf,%lf",
               n, n + 1, n + 2, n + 3, n + 4, n + 5, n + 6),
        7);
    const double second[7] = {350.25, 12.5, 3.0, 4.0, 0.6, 8.25, 1001};
    for (int k = 0; k < 7; k++) {
        bst_assert_close(n[k], second[k], 1e-9 * second[k]);
    }
    free(text);
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static cJSON *json_of(const bst_run_track *track, int norad) {
    bst_ctx ctx = {0};
    char *text;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    fputc('[', out);
    bst_assert_ok(&ctx, bst_track_write_json(&ctx, out, track, norad, true));
    bst_assert_ok(&ctx, bst_track_write_json(&ctx, out, track, norad, false));
    fputc(']', out);
    fclose(out);
    cJSON *root = cJSON_Parse(text);
    assert_non_null(root);
    free(text);
    assert_int_equal(cJSON_GetArraySize(root), 4);
    return root;
}

static void json(void **state) {
    (void)state;
    bst_run_track track = make_track(true);
    cJSON *root = json_of(&track, 44801);
    const cJSON *o = cJSON_GetArrayItem(root, 0);
    const struct {
        const char *key;
        double value;
    } numbers[] = {{"ra", 123.4},         {"declination", -56.7},
                   {"raUnc", 2.0 / 3600}, {"declinationUnc", 0.5 / 3600},
                   {"mag", 11.5},         {"snrEst", 7.25},
                   {"expDuration", 0.5},  {"senx", 1.0},
                   {"seny", -2.0},        {"senz", 3.0},
                   {"senvelx", -0.04},    {"senvely", 0.05},
                   {"senvelz", 0.06},     {"satNo", 44801}};
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
        bst_assert_close(number(o, numbers[k].key), numbers[k].value,
                         1e-9 * fabs(numbers[k].value));
    }
    const char *const texts[][2] = {{"obTime", "2022-06-16T22:10:01.250000Z"},
                                    {"idSensor", "eye/camera"},
                                    {"trackId", "7"},
                                    {"origObjectId", "PREY, A"},
                                    {"idOnOrbit", "PREY, A"},
                                    {"senReferenceFrame", "GCRF"}};
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        assert_string_equal(cJSON_GetObjectItem(o, texts[k][0])->valuestring, texts[k][1]);
    }
    assert_true(cJSON_IsFalse(cJSON_GetObjectItem(o, "uct")));
    o = cJSON_GetArrayItem(root, 3);
    bst_assert_close(number(o, "ra"), 350.25, 1e-9);
    bst_assert_close(number(o, "senvelz"), 0.061, 1e-9);
    assert_true(isnan(number(o, "mag")));
    cJSON_Delete(root);
    /* not the target, or one without a catalogue number */
    track = make_track(false);
    root = json_of(&track, 44801);
    o = cJSON_GetArrayItem(root, 0);
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(o, "uct")));
    assert_null(cJSON_GetObjectItem(o, "satNo"));
    assert_null(cJSON_GetObjectItem(o, "idOnOrbit"));
    cJSON_Delete(root);
    track = make_track(true);
    root = json_of(&track, 0);
    assert_null(cJSON_GetObjectItem(cJSON_GetArrayItem(root, 0), "satNo"));
    cJSON_Delete(root);
}

static void tdm(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char *text;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    bst_run_track track = make_track(true);
    bst_assert_ok(&ctx, bst_track_write_tdm(&ctx, out, &track, "observers.oem", "angles"));
    fclose(out);
    /* RMS over both axes and observations: (4 + 0.25 + 9 + 16) / 4 */
    char sigma[80];
    snprintf(sigma, sizeof sigma, "standard deviation per axis %.4f arcsec", sqrt(29.25 / 4));
    assert_non_null(strstr(text, sigma));
    assert_non_null(strstr(text, "track 7, which the tracker took for its target"));
    double ra = 0.0, dec = 0.0, mag = 0.0;
    const char *angles = strstr(text, "ANGLE_1 = 2022-06-16T22:10:01.25");
    assert_true(angles && sscanf(angles, "ANGLE_1 = %*s %lf", &ra) == 1);
    angles = strstr(angles, "ANGLE_2 = 2022-06-16T22:10:01.25");
    assert_true(angles && sscanf(angles, "ANGLE_2 = %*s %lf", &dec) == 1);
    bst_assert_close(ra, 123.4, 1e-7);
    bst_assert_close(dec, -56.7, 1e-7);
    const char *light = strstr(text, "MAG = ");
    assert_true(light && sscanf(light, "MAG = %*s %lf", &mag) == 1);
    bst_assert_close(mag, 11.5, 1e-3);
    assert_null(strstr(light + 3, "MAG = ")); /* the second has none */
    assert_non_null(strstr(text, "INTEGRATION_INTERVAL = 0.5"));
    assert_non_null(strstr(text, "observers.oem"));
    free(text);
    track = make_track(false);
    track.exposure_s = NAN;
    out = open_memstream(&text, &bytes);
    bst_assert_ok(&ctx, bst_track_write_tdm(&ctx, out, &track, NULL, "angles"));
    fclose(out);
    assert_null(strstr(text, "took for its target"));
    assert_null(strstr(text, "INTEGRATION_INTERVAL"));
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names),
        cmocka_unit_test(csv),
        cmocka_unit_test(json),
        cmocka_unit_test(tdm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
