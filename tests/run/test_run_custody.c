/* Custody in a run: correlation of tracks, tables, figures, saved states. */
#include <cjson/cJSON.h>

#include "sim/core/archive.h"
#include "sim/io/run_reader.h"
#include "sim/run/run_custody.h"
#include "tests/io/scratch.h"
#include "tests/world/world_support.h"
#include "tracker/mtt/tangent.h"
#include "tracker/orbit/custody.h"

enum { RATE = 10 };

static bool updates_fail;

bool __real_bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *z,
                               bst_custody_filter *filter);
bool __wrap_bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *z,
                               bst_custody_filter *filter) {
    return !updates_fail && __real_bst_custody_update(orbit, z, filter);
}

/* What observations of an object, by its number, are predicted to be, in place of a prediction; and
 * the photocentres of all objects. */
static const bst_custody_prediction *predicted;
static int lost_norad = 44802;
static double photocentres_m[8];
static int photocentre_count;

bool __real_bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                const bst_custody_observation *z, bst_custody_prediction *out);
bool __wrap_bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                const bst_custody_observation *z, bst_custody_prediction *out) {
    if (predicted && orbit->elements.norad == lost_norad) {
        *out = *predicted;
        return true;
    }
    return __real_bst_custody_predict(orbit, filter, z, out);
}

bst_status __real_bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements,
                                         double offset_s, double photocentre_m,
                                         bst_custody_orbit *out);
bst_status __wrap_bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements,
                                         double offset_s, double photocentre_m,
                                         bst_custody_orbit *out) {
    photocentres_m[photocentre_count++ % 8] = photocentre_m;
    return __real_bst_custody_orbit_init(ctx, elements, offset_s, photocentre_m, out);
}

/* A scenario that records custody. */
#define SCENARIO(seed_of_errors, run_number)                    \
    ((bst_scenario){.seed = (seed_of_errors),                   \
                    .run = (int64_t)(run_number),               \
                    .tick_rate_hz = RATE,                       \
                    .record = {.custody = true,                 \
                               .custody_sigma_m = 500,          \
                               .custody_drift_m_per_day = 1500, \
                               .custody_within_m = 1000}})

/* Three objects: INMARSAT GX5, MOLNIYA 3-8, and the observer's spacecraft, which is in every
 * direction. */
static bst_world *world_of_two(void) {
    return test_world_with(
        "{\"name\": \"A\", " TEST_GX5
        "}, {\"name\": \"B\", \"orbit\": {\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\", \"norad\": 10455}}, {\"name\": \"own\", " TEST_NEOSSAT
        "}",
        "");
}

/* A confirmed track with errors of 0.5 arcsec and 0.05 arcsec/s. */
static bst_track track_at(int64_t id, bst_vec3 direction, bst_vec3 rate_radps, int hits) {
    bst_track t = {.id = id, .status = BST_TRACK_CONFIRMED, .hits = hits};
    t.direction_gcrf = direction;
    t.rate_gcrf_radps = rate_radps;
    for (int i = 0; i < 4; i++) {
        t.covariance[i][i] = pow((i < 2 ? 0.5 : 0.05) * BST_ARCSEC_RAD, 2.0);
    }
    return t;
}

/* Tracks of a frame: of `object` with `hits` detections, none in the last `misses` frames,
 * `off_rad` beside it; object below 0: none. */
static void take_track(bst_ctx *ctx, bst_run_custody *c, const bst_world *world, int object,
                       int64_t id, int hits, int misses, double seconds, double off_rad) {
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    *tracks = (bst_tracks){
        .tick = (int64_t)(seconds * RATE), .attitude = {.valid = true}, .count = object >= 0};
    if (object >= 0) {
        bst_world_view *view;
        bst_world_sight now, later;
        bst_assert_ok(ctx, bst_world_view_create(ctx, world, &view));
        bst_assert_ok(ctx, bst_world_view_sight(ctx, view, 0, object, seconds, &now));
        bst_assert_ok(ctx, bst_world_view_sight(ctx, view, 0, object, seconds + 0.1, &later));
        bst_world_view_free(view);
        bst_tangent axes = bst_tangent_at(now.geometric);
        bst_vec3 d = bst_tangent_exp(now.geometric, bst_tangent_vector(&axes, off_rad, 0.0));
        bst_vec3 moved = bst_vec3_scale(bst_vec3_sub(later.geometric, now.geometric), 10.0);
        tracks->items[0] = track_at(id, d, bst_tangent_project(d, moved), hits);
        tracks->items[0].misses_in_row = misses;
    }
    bst_assert_ok(ctx, bst_run_custody_tracks(ctx, c, 0, tracks));
    test_free(tracks);
}

/* Six frames in which `objects` are detected, as track `id` and as seen from the field's middle;
 * one that ends it. */
static void take_detected(bst_ctx *ctx, bst_run_custody *c, const bst_world *world,
                          const int objects[6], int64_t id, double seconds) {
    bst_detections *found = test_calloc(1, sizeof *found + sizeof found->items[0]);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    bst_world_view *view;
    bst_assert_ok(ctx, bst_world_view_create(ctx, world, &view));
    for (int k = 0; k < 6; k++) {
        const double now_s = seconds + 10.0 * k, sigma = 0.1 * BST_ARCSEC_RAD;
        bst_world_sight now, later;
        bst_assert_ok(ctx, bst_world_view_sight(ctx, view, 0, objects[k], now_s, &now));
        bst_assert_ok(ctx, bst_world_view_sight(ctx, view, 0, objects[k], now_s + 0.1, &later));
        const bst_quat attitude = bst_quat_look(now.apparent, (bst_vec3){0.1, 0.2, 1.0});
        bst_vec3 moved = bst_vec3_scale(bst_vec3_sub(later.geometric, now.geometric), 10.0);
        double x, y;
        assert_true(bst_camera_project(bst_world_camera(world, 0, 0),
                                       bst_quat_rotate(attitude, now.apparent), &x, &y));
        *found = (bst_detections){.exposure_id = 100 * id + k, .count = 1};
        found->items[0] = (bst_detection){.x_px = x, .y_px = y, .cov_xx = 0.01, .cov_yy = 0.01};
        *tracks = (bst_tracks){
            .exposure_id = found->exposure_id,
            .tick = (int64_t)(now_s * RATE),
            .count = 1,
            .attitude = {
                .valid = true, .q_cam_from_gcrf = attitude, .sigma_rad = {sigma, sigma, sigma}}};
        tracks->items[0] =
            track_at(id, now.geometric, bst_tangent_project(now.geometric, moved), k + 1);
        tracks->items[0].x_px = x, tracks->items[0].y_px = y;
        bst_assert_ok(ctx, bst_run_custody_detections(ctx, c, 0, found));
        bst_assert_ok(ctx, bst_run_custody_tracks(ctx, c, 0, tracks));
    }
    tracks->count = 0;
    bst_assert_ok(ctx, bst_run_custody_tracks(ctx, c, 0, tracks));
    bst_world_view_free(view);
    test_free(found);
    test_free(tracks);
}

static void take(bst_ctx *ctx, bst_run_custody *c, const bst_world *world, int object, int64_t id,
                 int hits, double seconds, double off_rad) {
    take_track(ctx, c, world, object, id, hits, 0, seconds, off_rad);
}

static int64_t tracks_of(const bst_run_custody *c) {
    bst_custody_figures f;
    assert_true(bst_run_custody_figures(c, &f));
    return f.tracks;
}

/* Copies the state of a custody to another one. */
static void copy_state(bst_ctx *ctx, bst_run_custody *from, bst_run_custody *to) {
    bst_archive *saved, *read;
    size_t size;
    bst_assert_ok(ctx, bst_archive_create(ctx, &saved));
    bst_assert_ok(ctx, bst_archive_begin(ctx, saved, "custody"));
    bst_assert_ok(ctx, bst_run_custody_archive(from, saved));
    bst_assert_ok(ctx, bst_archive_end(ctx, saved));
    const void *bytes = bst_archive_data(saved, &size);
    bst_assert_ok(ctx, bst_archive_open(ctx, bytes, size, &read));
    bst_assert_ok(ctx, bst_archive_begin(ctx, read, "custody"));
    bst_assert_ok(ctx, bst_run_custody_archive(to, read));
    bst_assert_ok(ctx, bst_archive_end(ctx, read));
    bst_archive_free(read);
    bst_archive_free(saved);
}

/* Tracks of both objects at two times, one beside an object, and a short one. */
static void take_all(bst_ctx *ctx, bst_run_custody *c, const bst_world *world) {
    const double beside = 3.0 * BST_DEG_RAD;
    take(ctx, c, world, 0, 1, 9, 100.0, 0.0);
    take(ctx, c, world, -1, 0, 0, 110.0, 0.0); /* no longer listed: it has ended */
    take(ctx, c, world, 1, 2, 5, 200.0, 0.0);
    take(ctx, c, world, 0, 3, 9, 300.0, beside); /* ends 2 */
    take(ctx, c, world, 0, 4, 4, 400.0, 0.0);    /* ends 3; too short itself */
    take(ctx, c, world, 0, 5, 9, 700.0, 0.0);    /* goes on to the end */
}

static void tracks_update_their_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_custody *c, *plain;
    bst_run_reader *run;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), store, &c));
    take_all(&ctx, c, world);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 1000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.objects == 3 && f.updated == 2);
    assert_true(f.tracks == 4 && f.correlated == 3 && f.uncorrelated == 1);
    assert_true(f.ambiguous == 0 && f.cross_tags == 0);
    bst_assert_close(f.age_mean_s, 0.5 * (300.0 + 800.0), 1e-9);
    assert_true(f.nees_mean > 0.0 && f.nees_mean < 20.0 && f.nees_low < 6.0 && f.nees_high > 6.0);

    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &plain));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, plain, 1000.0));
    bst_custody_figures without;
    (void)bst_run_custody_figures(plain, &without);
    assert_true(without.updated == 0 && isnan(without.age_mean_s) && isnan(without.nees_mean));
    assert_true(f.sigma_p90_m < 0.9 * without.sigma_p90_m);
    bst_run_custody_free(plain);

    cJSON *manifest = cJSON_CreateObject();
    bst_run_custody_add(c, manifest);
    const cJSON *node = cJSON_GetObjectItem(manifest, "custody");
    const char *keys[] = {"objects",          "updated",     "in_custody",
                          "tracks",           "correlated",  "ambiguous",
                          "uncorrelated",     "cross_tags",  "age_mean_s",
                          "sigma_median_m",   "sigma_p90_m", "sigma_updated_median_m",
                          "nees_mean",        "nees_low",    "nees_high",
                          "unknown",          "candidates",  "candidates_confirmed",
                          "candidates_wrong", "new_objects", "new_tracks",
                          "new_wrong",        "new_matched"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        assert_true(cJSON_IsNumber(cJSON_GetObjectItem(node, keys[i])));
    }
    cJSON_Delete(manifest);
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    assert_int_equal(bst_run_reader_int(run, "SELECT count(*) FROM custody_tracks", 0, 0), 4);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE object = "
                                        "true_object AND candidates = 1 AND chi2 < 27 AND nees > 0",
                                        0, 0),
                     3);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE track_id = 3 "
                                        "AND object IS NULL AND true_object IS NULL AND hits = 9",
                                        0, 0),
                     1);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE object = 0 AND name = "
                                        "'A' AND norad = 44801 AND updates = 2 AND last_s = 700 "
                                        "AND age_s = 300 AND error_m < 4 * sigma_m",
                                        0, 0),
                     1);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A run that goes on from a saved state ends with the same figures. */
static void saved_states_go_on(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *whole, *part;
    bst_custody_figures a, b;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &whole));
    take(&ctx, whole, world, 1, 2, 9, 200.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(6, 0), NULL, &part));
    copy_state(&ctx, whole, part);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, whole, 500.0));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, part, 500.0));
    (void)bst_run_custody_figures(whole, &a);
    (void)bst_run_custody_figures(part, &b);
    assert_true(a.updated == 1 && b.updated == 1 && a.nees_mean == b.nees_mean &&
                a.sigma_p90_m == b.sigma_p90_m);
    bst_run_custody_free(whole);
    bst_run_custody_free(part);
    bst_world_free(world);
}

/* A track without detections goes on while it is listed; one that is resumed later, in a run that
 * goes on from a saved state too, is not used again. */
static void a_track_is_used_once(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c, *later;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &later));
    take(&ctx, c, world, 0, 7, 9, 100.0, 0.0);
    take_track(&ctx, c, world, 0, 7, 9, 40, 190.0, 0.0);
    assert_int_equal(tracks_of(c), 0);
    take(&ctx, c, world, 0, 7, 12, 200.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 210.0, 0.0);
    assert_int_equal(tracks_of(c), 1);
    take(&ctx, c, world, 1, 3, 9, 220.0, 0.0); /* another one, with a smaller id */
    take(&ctx, c, world, 0, 7, 15, 300.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 310.0, 0.0);
    assert_int_equal(tracks_of(c), 2);
    copy_state(&ctx, c, later);
    take(&ctx, later, world, 0, 7, 20, 400.0, 0.0);
    take(&ctx, later, world, 1, 3, 20, 410.0, 0.0);
    take(&ctx, later, world, 0, 8, 9, 420.0, 0.0); /* a new one */
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, later, 500.0));
    assert_int_equal(tracks_of(later), 3);
    bst_run_custody_free(c);
    bst_run_custody_free(later);
    bst_world_free(world);
}

/* An object on another element set than in the saved state starts anew, the others go on. */
static void changed_objects_start_anew(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_world *changed = test_world_with(
        "{\"name\": \"A\", " TEST_GX5
        "}, {\"name\": \"B\", \"orbit\": {\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\", \"norad\": 25544}}, {\"name\": \"own\", " TEST_NEOSSAT
        "}",
        "");
    bst_run_custody *c, *later;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    take(&ctx, c, world, 1, 2, 9, 200.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 210.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, changed, &SCENARIO(5, 0), NULL, &later));
    copy_state(&ctx, c, later);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, later, 500.0));
    assert_true(bst_run_custody_figures(later, &f));
    assert_true(f.objects == 3 && f.updated == 1 && f.correlated == 2);
    bst_run_custody_free(c);
    bst_run_custody_free(later);
    bst_world_free(changed);
    bst_world_free(world);
}

/* NEES of an object's elements at the start of a run. */
static double first_nees(const bst_world *world, uint64_t number, const char *object) {
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_custody *c;
    bst_run_reader *run;
    char query[128];
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, number), store, &c));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 1.0));
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    snprintf(query, sizeof query,
             "SELECT CAST(1e6 * nees AS INTEGER) FROM custody WHERE name = '%s'", object);
    double nees = 1e-6 * (double)bst_run_reader_int(run, query, 0, -1);
    bst_run_reader_close(run);
    scratch_remove(&place);
    return nees;
}

/* The error of an object depends on the run, not on the other objects. */
static void errors_of_the_catalogue(void **state) {
    (void)state;
    bst_world *world = world_of_two();
    bst_world *other = test_world_with(
        "{\"name\": \"own\", " TEST_NEOSSAT "}, {\"name\": \"A\", " TEST_GX5 "}", "");
    double nees = first_nees(world, 0, "A");
    assert_true(nees > 0.0);
    bst_assert_close(first_nees(other, 0, "A"), nees, 1e-9 * nees);
    assert_true(fabs(first_nees(world, 1, "A") - nees) > 1e-3);
    bst_world_free(other);
    bst_world_free(world);
}

/* Every track is in one of the counts. */
static void a_failed_update_is_counted(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    updates_fail = true;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    updates_fail = false;
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.tracks == 1 && f.uncorrelated == 1 && f.correlated == 0 && f.ambiguous == 0);
    bst_run_custody_free(c);
    bst_world_free(world);
}

/* GX5, called A, of 12 m^2, and C, with a mean anomaly of its own. */
static bst_world *world_with_neighbour(const scratch *place, const char *anomaly) {
    char text[256], objects[2048], line[70];
    snprintf(line, sizeof line, "2 44802   0.0366 343.6423 0001933 100.2390 %s  1.00270919  944",
             anomaly);
    int sum = 0;
    for (const char *c = line; *c; c++) {
        sum += *c >= '0' && *c <= '9' ? *c - '0' : 0;
    }
    snprintf(text, sizeof text,
             "1 44802U 19080B   22167.00079919  .00000075  00000+0  00000+0 0  9999\n%s%d\n", line,
             sum % 10);
    scratch at = *place;
    FILE *file = fopen(scratch_path(&at, "near.tle"), "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    snprintf(objects, sizeof objects,
             "{\"name\": \"A\", \"area_m2\": 12, " TEST_GX5
             "}, {\"name\": \"C\", \"orbit\": {\"elements_file\": \"%s\", \"norad\": 44802}}",
             scratch_path(&at, "near.tle"));
    return test_world_with(objects, "");
}

/* What becomes of one track of A. */
static bst_custody_figures figures_of_a(const bst_world *world) {
    bst_ctx ctx = {0};
    bst_scenario scenario = SCENARIO(5, 0);
    scenario.record.custody_sigma_m = 20;
    scenario.record.custody_drift_m_per_day = 20;
    bst_run_custody *c;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &scenario, NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    assert_true(bst_run_custody_figures(c, &f));
    bst_run_custody_free(c);
    return f;
}

/* A track beside which a second object is predicted, outside of the gate but nearer than two images
 * can be separated, updates none. */
static void neighbours_are_ambiguous(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    /* 0.001 degrees (4 arcsec, 0.7 of a FWHM) and 0.01 degrees beside GX5 */
    const char *anomalies[2] = {"191.6451", "191.6541"};
    for (int n = 0; n < 2; n++) {
        bst_world *world = world_with_neighbour(&place, anomalies[n]);
        bst_custody_figures f = figures_of_a(world);
        assert_true(f.tracks == 1 && f.ambiguous == (n == 0) && f.correlated == (n == 1));
        bst_world_free(world);
    }
    scratch_remove(&place);
}

/* The limit of it: one FWHM and two standard deviations over both axes, at most two FWHM. */
static void neighbours_by_their_uncertainty(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    bst_world *world = world_with_neighbour(&place, "191.6451");
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    const double fwhm = camera->psf_fwhm_px * camera->pixel_scale_arcsec * BST_ARCSEC_RAD;
    const double sigmas[3][2] = {{0.1, 0.3}, {0.3, 0.1}, {0.2, 0.6}};
    for (int k = 0; k < 6; k++) {
        const double *s = sigmas[k / 2], limit = 1.0 + fmin(2.0 * hypot(s[0], s[1]), 1.0);
        const double d = fwhm * limit * (k % 2 ? 1.01 : 0.99);
        bst_custody_prediction p = {.innovation = {0.6 * d, -0.8 * d}, .chi2 = 1e3};
        p.covariance[0][0] = pow(s[0] * fwhm, 2.0);
        p.covariance[1][1] = pow(s[1] * fwhm, 2.0);
        p.covariance[0][1] = p.covariance[1][0] = -0.5 * s[0] * s[1] * fwhm * fwhm;
        predicted = &p;
        photocentre_count = 0;
        bst_custody_figures f = figures_of_a(world);
        predicted = NULL;
        assert_true(f.tracks == 1 && f.ambiguous == (k % 2 == 0) && f.correlated == (k % 2));
        /* half of the radius of a disc of this area */
        bst_assert_close(photocentres_m[0], 0.5 * sqrt(12.0 / BST_PI), 1e-12);
    }
    bst_world_free(world);
    scratch_remove(&place);
}

/* A track with detections updates its object with their directions, not with its state; one whose
 * detections are of two objects updates none. */
static void directions_update_their_object(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c, *plain;
    bst_custody_figures f, without;
    const int own[6] = {0, 0, 0, 0, 0, 0}, mixed[6] = {1, 1, 0, 0, 0, 0};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &plain));
    updates_fail = true; /* those with a state */
    take_detected(&ctx, c, world, own, 1, 100.0);
    take_detected(&ctx, c, world, mixed, 2, 300.0);
    updates_fail = false;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.tracks == 2 && f.correlated == 1 && f.uncorrelated == 1 && f.updated == 1);
    assert_true(f.cross_tags == 0 && f.ambiguous == 0);
    /* 264 m, of 2,031 m for all objects without updates */
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, plain, 500.0));
    assert_true(bst_run_custody_figures(plain, &without));
    assert_true(f.sigma_updated_median_m < 0.2 * without.sigma_median_m);
    assert_true(f.nees_mean > 0.5 && f.nees_mean < 20.0);
    bst_run_custody_free(c);
    bst_run_custody_free(plain);
    bst_world_free(world);
}

/* Custody without object A, by a seed that draws it and nothing else; or with all objects. */
static bst_run_custody *without_a(bst_ctx *ctx, const bst_world *world, bst_run *store) {
    for (uint64_t seed = 1; seed < 200; seed++) {
        bst_scenario scenario = SCENARIO(seed, 0);
        bst_run_custody *c;
        bst_custody_figures f;
        const int own[6] = {0, 0, 0, 0, 0, 0};
        scenario.record.custody_unknown_share = 0.5;
        if (bst_run_custody_create(ctx, world, &scenario, NULL, &c) != BST_OK) {
            continue; /* all are unknown */
        }
        take_detected(ctx, c, world, own, 1, 100.0);
        bst_assert_ok(ctx, bst_run_custody_finish(ctx, c, 500.0));
        assert_true(bst_run_custody_figures(c, &f));
        bst_run_custody_free(c);
        if (f.unknown == 1 && f.uncorrelated == 1) {
            bst_assert_ok(ctx, bst_run_custody_create(ctx, world, &scenario, store, &c));
            return c;
        }
    }
    fail_msg("no seed leaves out object A alone");
    return NULL;
}

/* Tracks of an object that the catalogue lacks become a candidate: two of one object are linked,
 * also after a saved state, and a third confirms it. Those of a known object do not. */
static void unknown_objects_become_candidates(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    const int unknown[6] = {0, 0, 0, 0, 0, 0}, known[6] = {1, 1, 1, 1, 1, 1};
    bst_custody_figures f;
    bst_run_custody *c = without_a(&ctx, world, NULL);
    take_detected(&ctx, c, world, unknown, 1, 100.0);
    take_detected(&ctx, c, world, known, 2, 300.0);
    bst_archive *saved;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "it"));
    bst_assert_ok(&ctx, bst_run_custody_archive(c, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    bst_run_custody *again = without_a(&ctx, world, NULL);
    bst_archive *read;
    bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "it"));
    bst_assert_ok(&ctx, bst_run_custody_archive(again, read));
    bst_archive_free(read);
    bst_archive_free(saved);
    take_detected(&ctx, again, world, unknown, 3, 7000.0);
    take_detected(&ctx, again, world, unknown, 4, 13000.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, again, 14000.0));
    assert_true(bst_run_custody_figures(again, &f));
    assert_true(f.unknown == 1 && f.uncorrelated == 3 && f.cross_tags == 0);
    assert_true(f.candidates == 1 && f.candidates_confirmed == 1 && f.candidates_wrong == 0);
    bst_run_custody_free(c);
    bst_run_custody_free(again);
    bst_world_free(world);
}

/* A confirmed candidate with an orbit becomes an object: a later track updates it, it is in the
 * table `custody` with the error against the truth, also after a saved state. */
static void candidates_become_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_reader *run;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    const int unknown[6] = {0, 0, 0, 0, 0, 0};
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_run_custody *before = without_a(&ctx, world, NULL), *c = without_a(&ctx, world, store);
    for (int k = 0; k < 3; k++) {
        take_detected(&ctx, before, world, unknown, k + 1, 100.0 + 6900.0 * k);
    }
    copy_state(&ctx, before, c);
    take_detected(&ctx, c, world, unknown, 4, 20000.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 25000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.new_objects == 1 && f.new_tracks == 1 && f.new_wrong == 0 && f.new_matched == 0);
    assert_true(f.uncorrelated == 3 && f.correlated == 1 && f.cross_tags == 0);
    assert_true(f.unknown == 1 && f.candidates == 1);
    assert_true(f.new_sigma_median_m > 10.0 && f.new_sigma_median_m < 1000.0);
    /* the directions have no errors here; consistency is shown in test_custody_start.c */
    assert_true(f.new_nees_mean > 0.0 && f.new_nees_mean < 6.0);
    bst_run_custody_free(before);
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE name = 'new 1' AND "
                                        "object IS NULL AND true_object = 0 AND updates = 4 AND "
                                        "cross_tags = 0 AND error_m < 4 * sigma_m AND nees > 0",
                                        0, 0),
                     1);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE new_object = 1 "
                                        "AND object IS NULL AND true_object = 0",
                                        0, 0),
                     1);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A new object's orbit that is that of a catalogued object, whose filter had lost it, starts that
 * filter anew. */
static void new_objects_match_the_catalogue(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c;
    bst_custody_figures f;
    const int own[6] = {0, 0, 0, 0, 0, 0};
    const bst_custody_prediction far = {.innovation = {1.0, 1.0}, .chi2 = 1e3};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    predicted = &far;
    lost_norad = 44801;
    for (int k = 0; k < 3; k++) {
        take_detected(&ctx, c, world, own, k + 1, 100.0 + 6900.0 * k);
    }
    predicted = NULL;
    lost_norad = 44802;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 25000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.uncorrelated == 3 && f.new_objects == 0 && f.new_matched == 1);
    assert_true(f.updated == 1 && f.cross_tags == 0);
    assert_true(f.nees_mean > 0.0 && f.nees_mean < 6.0); /* directions without errors */
    bst_run_custody_free(c);
    bst_world_free(world);
}

static void off_and_without_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_run_custody *c;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    const bst_scenario off = {.record = {.custody = false}};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &off, NULL, &c));
    assert_null(c);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 10.0));
    assert_false(bst_run_custody_figures(c, &f));
    bst_run_custody_add(c, NULL);
    bst_run_custody_free(c);
    bst_world_free(world);
    world = test_world_with("", "");
    assert_int_equal(bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "/record/custody"));
    assert_null(c);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tracks_update_their_objects),
        cmocka_unit_test(saved_states_go_on),
        cmocka_unit_test(a_track_is_used_once),
        cmocka_unit_test(changed_objects_start_anew),
        cmocka_unit_test(errors_of_the_catalogue),
        cmocka_unit_test(a_failed_update_is_counted),
        cmocka_unit_test(neighbours_are_ambiguous),
        cmocka_unit_test(neighbours_by_their_uncertainty),
        cmocka_unit_test(directions_update_their_object),
        cmocka_unit_test(unknown_objects_become_candidates),
        cmocka_unit_test(candidates_become_objects),
        cmocka_unit_test(new_objects_match_the_catalogue),
        cmocka_unit_test(off_and_without_objects),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
