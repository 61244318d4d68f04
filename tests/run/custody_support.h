/* Worlds, tracks and stand-ins of the tests of custody in a run. */
#ifndef BST_TESTS_RUN_CUSTODY_SUPPORT_H
#define BST_TESTS_RUN_CUSTODY_SUPPORT_H

#include <cjson/cJSON.h>

#include "sim/core/archive.h"
#include "sim/core/tangent.h"
#include "sim/io/run_reader.h"
#include "sim/run/run_custody.h"
#include "tests/io/scratch.h"
#include "tests/world/world_support.h"
#include "tracker/orbit/custody.h"

enum { RATE = 10 };

static bool updates_fail;

bool __real_bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *z,
                               bst_custody_filter *filter);
bool __wrap_bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *z,
                               bst_custody_filter *filter) {
    return !updates_fail && __real_bst_custody_update(orbit, z, filter);
}

/* What observations of an object, by its number (below 0: of all), are predicted to be, in place of
 * a prediction; and the photocentres of all objects. */
static const bst_custody_prediction *predicted;
static int lost_norad = 44802;
static double photocentres_m[8];
static int photocentre_count;

bool __real_bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                const bst_custody_observation *z, bst_custody_prediction *out);
bool __wrap_bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                const bst_custody_observation *z, bst_custody_prediction *out) {
    if (predicted && (orbit->elements.norad == lost_norad || lost_norad < 0)) {
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
static inline bst_world *world_of_two(void) {
    return test_world_with(
        "{\"name\": \"A\", " TEST_GX5
        "}, {\"name\": \"B\", \"orbit\": {\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\", \"norad\": 10455}}, {\"name\": \"own\", " TEST_NEOSSAT
        "}",
        "");
}

/* A confirmed track with errors of 0.5 arcsec and 0.05 arcsec/s. */
static inline bst_track track_at(int64_t id, bst_vec3 direction, bst_vec3 rate_radps, int hits) {
    bst_track t = {.id = id, .status = BST_TRACK_CONFIRMED, .hits = hits};
    t.direction_gcrf = direction;
    t.rate_gcrf_radps = rate_radps;
    for (int i = 0; i < 4; i++) {
        t.covariance[i][i] = pow((i < 2 ? 0.5 : 0.05) * BST_ARCSEC_RAD, 2.0);
    }
    return t;
}

/* A direction `off_rad` beside another one. */
static inline bst_vec3 beside(bst_vec3 direction, double off_rad) {
    const bst_tangent axes = bst_tangent_at(direction);
    return bst_tangent_exp(direction, bst_tangent_vector(&axes, off_rad, 0.0));
}

/* The sensor of tracks. */
static int from_sensor;

/* Tracks of a frame: of `object` with `hits` detections, none in the last `misses` frames,
 * `off_rad` beside it; object below 0: none. */
static inline void take_track(bst_ctx *ctx, bst_run_custody *c, const bst_world *world, int object,
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
        bst_vec3 d = beside(now.geometric, off_rad);
        bst_vec3 moved = bst_vec3_scale(bst_vec3_sub(later.geometric, now.geometric), 10.0);
        tracks->items[0] = track_at(id, d, bst_tangent_project(d, moved), hits);
        tracks->items[0].misses_in_row = misses;
    }
    bst_assert_ok(ctx, bst_run_custody_tracks(ctx, c, from_sensor, tracks));
    test_free(tracks);
}

/* Error of the attitude of the last frame of take_detected, and of the track's state with it. */
static double last_off_rad;

/* Six frames in which `objects` are detected, as track `id` and as seen from the field's middle;
 * one that ends it. */
static inline void take_detected(bst_ctx *ctx, bst_run_custody *c, const bst_world *world,
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
        const bst_vec3 up = {0.1, 0.2, 1.0};
        const bst_quat attitude = bst_quat_look(now.apparent, up);
        bst_vec3 moved = bst_vec3_scale(bst_vec3_sub(later.geometric, now.geometric), 10.0);
        double x, y;
        assert_true(bst_camera_project(bst_world_camera(world, 0, 0),
                                       bst_quat_rotate(attitude, now.apparent), &x, &y));
        *found = (bst_detections){.exposure_id = 100 * id + k, .count = 1};
        found->items[0] = (bst_detection){.x_px = x, .y_px = y, .cov_xx = 0.01, .cov_yy = 0.01};
        const double off_rad = k == 5 ? last_off_rad : 0.0;
        *tracks = (bst_tracks){
            .exposure_id = found->exposure_id,
            .tick = (int64_t)(now_s * RATE),
            .count = 1,
            .attitude = {.valid = true,
                         .q_cam_from_gcrf = bst_quat_look(beside(now.apparent, off_rad), up),
                         .sigma_rad = {sigma, sigma, sigma}}};
        const bst_vec3 seen = beside(now.geometric, off_rad);
        tracks->items[0] = track_at(id, seen, bst_tangent_project(seen, moved), k + 1);
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

static inline void take(bst_ctx *ctx, bst_run_custody *c, const bst_world *world, int object,
                        int64_t id, int hits, double seconds, double off_rad) {
    take_track(ctx, c, world, object, id, hits, 0, seconds, off_rad);
}

static inline int64_t tracks_of(const bst_run_custody *c) {
    bst_custody_figures f;
    assert_true(bst_run_custody_figures(c, &f));
    return f.tracks;
}

/* Copies the state of a custody to another one. */
static inline void copy_state(bst_ctx *ctx, bst_run_custody *from, bst_run_custody *to) {
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

/* Custody without object A, by a seed that draws it and nothing else; or with all objects. */
static inline bst_run_custody *without_a(bst_ctx *ctx, const bst_world *world, bst_run *store) {
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

#endif
