/* Directions of detections, and arcs of tracks. */
#include "sim/run/run_arcs.h"

#include "sim/core/archive.h"
#include "sim/core/tangent.h"
#include "sim/run/run_directions.h"
#include "tests/world/world_support.h"
#include "tracker/orbit/orbit_photocentre.h"

enum { RATE = 10 };

static const bst_quat attitude = {0.1, -0.2, 0.3, 0.927361849549570};

/* A star's measured direction is where it is geometrically; the covariance is that of centroid and
 * attitude, and the part shared that of the attitude about x and y. */
static void measured_directions(void **state) {
    (void)state;
    bst_world *world = test_world_with("", "");
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    const double arcsec = BST_ARCSEC_RAD, scale = bst_camera_scale_rad(camera);
    const bst_light light =
        bst_light_at(&(bst_bodies){.earth_bary_mps = {2e4, -2e4, 1e4}, .sun_m = {1.5e11, 0, 0}},
                     (bst_vec3){7e6, 0, 0}, (bst_vec3){0, 7500, 0});
    const bst_attitude_fix fix = {.valid = true,
                                  .q_cam_from_gcrf = attitude,
                                  .sigma_rad = {1.0 * arcsec, 2.0 * arcsec, 30.0 * arcsec}};
    const double cov_px2[3] = {0.04, 0.01, 0.09};
    const bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(attitude), (bst_vec3){0, 0, 1});
    /* the geometric direction whose apparent one is 0.2 degrees from the boresight */
    bst_tangent axes = bst_tangent_at(ahead);
    bst_vec3 truth = bst_tangent_exp(ahead, bst_tangent_vector(&axes, 3e-3, -2e-3));
    bst_vec3 v = bst_quat_rotate(attitude, bst_light_aberrate(&light, truth));
    double x, y;
    assert_true(bst_camera_project(camera, v, &x, &y));
    bst_od_observation z;
    bst_run_measure_direction(camera, x, y, cov_px2, &fix, &light, &z);
    assert_true(bst_vec3_angle(z.direction, truth) < 1e-4 * arcsec);
    /* the trace does not depend on the axes: pixels, and an attitude error about x moves along y */
    double whole = (0.04 + 0.09) * scale * scale + (1.0 + 4.0) * arcsec * arcsec;
    bst_assert_close(z.cov_11 + z.cov_22, whole, 2e-3 * whole);
    double shared = 0.0;
    for (int i = 0; i < 4; i++) {
        shared += z.shared_rad[i / 2][i % 2] * z.shared_rad[i / 2][i % 2];
    }
    bst_assert_close(shared, 5.0 * arcsec * arcsec, 1e-4 * 5.0 * arcsec * arcsec);
    /* a turn by half of the field's side */
    double side = 0.5 * (double)(camera->width_px + camera->height_px) * scale;
    bst_quat turned = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0.5 * side, 0, 0}), attitude);
    bst_assert_close(bst_run_change_of_stars(camera, attitude, turned), 1.0, 1e-9);
    bst_world_free(world);
}

/* acceleration of the track in the image, px/s^2, and length of exposures, ticks */
static double bend_px;
static int64_t exposure_ticks;

static double column_of(int k) {
    return 100.0 + k + 0.5 * bend_px * k * k;
}

/* Detections and tracks of frame `k`, one every second: track `id` in pixel 100 + k; its detection
 * is 4 frames old where late. */
static void take_frame(bst_ctx *ctx, bst_run_arcs *arcs, int k, int64_t id, int status, bool known,
                       bst_run_arc_fn take, void *user) {
    bst_detections *found = test_calloc(1, sizeof *found + 2 * sizeof found->items[0]);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    *found = (bst_detections){.exposure_id = k,
                              .start_tick = (int64_t)k * RATE - exposure_ticks / 2,
                              .end_tick = (int64_t)k * RATE + exposure_ticks / 2,
                              .count = 2};
    found->items[0] = (bst_detection){.x_px = 7, .y_px = 8, .cov_xx = 9, .cov_yy = 9};
    found->items[1] =
        (bst_detection){.x_px = column_of(k), .y_px = 200, .cov_xx = 0.01, .cov_yy = 0.01};
    bst_assert_ok(ctx, bst_run_arcs_detections(ctx, arcs, 0, found));
    *tracks = (bst_tracks){.exposure_id = known ? k : k - 9,
                           .tick = (int64_t)k * RATE,
                           .count = id != 0,
                           .attitude = {.valid = true,
                                        .q_cam_from_gcrf = attitude,
                                        .sigma_rad = {1e-6, 1e-6, 1e-5},
                                        .shared = 0.25}};
    tracks->items[0] = (bst_track){.id = id,
                                   .status = status,
                                   .direction_gcrf = {0, 0, 1},
                                   .rate_gcrf_radps = {1e-6 * k, 0, 0},
                                   .hits = k,
                                   .x_px = column_of(k),
                                   .y_px = 200};
    bst_assert_ok(ctx, bst_run_arcs_tracks(ctx, arcs, 0, tracks, take, user));
    test_free(found);
    test_free(tracks);
}

typedef struct taken {
    int count;
    bst_run_arc arc;
} taken;

static bst_status keep(void *user, bst_ctx *ctx, int sensor, const bst_run_arc *arc) {
    (void)ctx;
    taken *t = user;
    assert_int_equal(sensor, 0);
    t->count++;
    t->arc = *arc;
    return BST_OK;
}

static bst_run_arcs *arcs_of(const bst_world *world) {
    bst_ctx ctx = {0};
    bst_run_arcs *arcs;
    bst_assert_ok(&ctx, bst_run_arcs_create(&ctx, world, RATE, &arcs));
    return arcs;
}

static void copy_state(bst_run_arcs *from, bst_run_arcs *to) {
    bst_ctx ctx = {0};
    bst_archive *saved, *read;
    size_t size;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "arcs"));
    bst_assert_ok(&ctx, bst_run_arcs_archive(from, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    const void *bytes = bst_archive_data(saved, &size);
    bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "arcs"));
    bst_assert_ok(&ctx, bst_run_arcs_archive(to, read));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, read));
    bst_archive_free(read);
    bst_archive_free(saved);
}

/* A saved state with fewer centroids than it says is an error, before memory is taken for them. */
static void saved_centroids_are_there(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_archive *saved, *read;
    bst_run_centroids centroids = {.next = 0};
    size_t size;
    int64_t few[4] = {0, 0, 0, 0};
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "centroids"));
    (void)bst_archive_count(saved, 1 << 24, 1 << 24);
    BST_ARCHIVE(saved, few);
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    const void *bytes = bst_archive_data(saved, &size);
    bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "centroids"));
    assert_int_equal(bst_run_centroids_archive(&centroids, read), BST_ERR_FORMAT);
    assert_int_equal(centroids.frames[0].room, 0);
    bst_run_centroids_clear(&centroids);
    bst_archive_free(read);
    bst_archive_free(saved);
}

/* An arc has the track's last state, and directions from its first detections on, fewer in long
 * arcs, which leave the first two out; it is the same in a run that goes on from a saved state. */
static void arcs_of_tracks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("", "");
    bst_run_arcs *arcs = arcs_of(world), *later = arcs_of(world);
    taken out = {0}, other = {0};
    for (int k = 1; k <= 40; k++) {
        take_frame(&ctx, arcs, k, 3, k > 3 ? BST_TRACK_CONFIRMED : BST_TRACK_TENTATIVE, true, keep,
                   &out);
    }
    assert_int_equal(out.count, 0);
    copy_state(arcs, later);
    for (int k = 41; k <= 42; k++) {
        const int64_t id = k == 41 ? 3 : 0;
        take_frame(&ctx, arcs, k, id, BST_TRACK_CONFIRMED, true, keep, &out);
        take_frame(&ctx, later, k, id, BST_TRACK_CONFIRMED, true, keep, &other);
    }
    assert_int_equal(out.count, 1);
    const bst_run_arc *a = &out.arc;
    assert_true(a->id == 3 && a->hits == 41);
    bst_assert_close(a->state.observer.time_s, 41.0, 1e-12);
    bst_assert_close(a->state.rate_radps.x, 41e-6, 1e-15);
    /* 41 directions: every fourth of them, from the ninth on */
    assert_int_equal(a->count, 9);
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double scale = bst_camera_scale_rad(camera);
    bst_world_view *view;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (int i = 0; i < a->count; i++) {
        const bst_od_observation *z = &a->directions[i];
        bst_assert_close(z->observer.time_s, 9.0 + 4.0 * i, 1e-12);
        /* 0.1 px, not the 3 px of the other detection; a quarter of the attitude's is shared */
        double variance = 2.0 * (0.01 * scale * scale + 1e-12);
        bst_assert_close(z->cov_11 + z->cov_22, variance, 0.01 * variance);
        double shared = 0.0;
        for (int n = 0; n < 4; n++) {
            shared += z->shared_rad[n / 2][n % 2] * z->shared_rad[n / 2][n % 2];
        }
        bst_assert_close(shared, 0.25 * 2e-12, 0.01 * 0.25 * 2e-12);
        bst_assert_close(z->shared_change, 0.0, 1e-9);
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, z->observer.time_s, &bodies));
        const double phase = acos(-bst_vec3_dot(bst_vec3_unit(bodies.sun_m), z->direction));
        assert_true(phase > 0.5 && phase < 2.6); /* neither full nor new */
        bst_assert_close(z->photocentre_factor, bst_od_photocentre_factor(phase), 1e-6);
        if (i > 0) {
            bst_assert_close(bst_vec3_angle(a->directions[i - 1].direction, z->direction),
                             4.0 * scale, 0.01 * 4.0 * scale);
        }
    }
    assert_int_equal(other.count, 1);
    assert_memory_equal(&other.arc, a, sizeof *a);
    bst_world_view_free(view);
    bst_run_arcs_free(arcs);
    bst_run_arcs_free(later);
    bst_world_free(world);
}

/* Directions are those of the middle of an exposure: the mean of a path that bends lies beside it
 * by the acceleration times T^2 / 24. */
static void directions_of_the_middle(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("", "");
    taken out[2] = {{0}, {0}};
    bend_px = 0.02;
    for (int n = 0; n < 2; n++) {
        bst_run_arcs *arcs = arcs_of(world);
        exposure_ticks = n * 8 * (RATE / 10); /* 0 and 0.8 s */
        for (int k = 1; k <= 13; k++) {
            take_frame(&ctx, arcs, k, k < 13 ? 3 : 0, BST_TRACK_CONFIRMED, true, keep, &out[n]);
        }
        bst_run_arcs_free(arcs);
    }
    assert_true(out[0].arc.count == 10 && out[1].arc.count == 10);
    const double scale = bst_camera_scale_rad(bst_world_camera(world, 0, 0));
    for (int i = 0; i < 10; i++) {
        const bst_vec3 a = out[0].arc.directions[i].direction,
                       b = out[1].arc.directions[i].direction;
        const bst_vec3 ahead = bst_vec3_sub(out[0].arc.directions[i > 0 ? i : 1].direction,
                                            out[0].arc.directions[i > 0 ? i - 1 : 0].direction);
        const double back = bend_px * scale * 0.8 * 0.8 / 24.0;
        bst_assert_close(-bst_vec3_dot(bst_vec3_sub(b, a), bst_vec3_unit(ahead)), back,
                         0.01 * back);
    }
    bend_px = 0.0;
    exposure_ticks = 0;
    bst_world_free(world);
}

/* A saved state with a direction at a time that no run has is an error. */
static void saved_times_are_possible(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("", "");
    bst_run_arcs *arcs = arcs_of(world), *later = arcs_of(world);
    bst_archive *saved, *read;
    taken out = {0};
    size_t size;
    const double first = 1.0, hostile = 1e300;
    for (int k = 1; k <= 5; k++) {
        take_frame(&ctx, arcs, k, 3, BST_TRACK_CONFIRMED, true, keep, &out);
    }
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "arcs"));
    bst_assert_ok(&ctx, bst_run_arcs_archive(arcs, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    const char *bytes = bst_archive_data(saved, &size);
    char *changed = test_malloc(size);
    memcpy(changed, bytes, size);
    for (size_t i = 0; i + sizeof first <= size; i++) {
        if (memcmp(bytes + i, &first, sizeof first) == 0) {
            memcpy(changed + i, &hostile, sizeof hostile);
        }
    }
    bst_assert_ok(&ctx, bst_archive_open(&ctx, changed, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "arcs"));
    assert_int_equal(bst_run_arcs_archive(later, read), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "a direction at 1e+300 s"));
    bst_archive_free(read);
    bst_archive_free(saved);
    test_free(changed);
    bst_run_arcs_free(arcs);
    bst_run_arcs_free(later);
    bst_world_free(world);
}

/* Centroids that are too old, and short or unconfirmed tracks, give nothing; confirmed tracks take
 * the place of others. */
static void arcs_that_lack_something(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("", "");
    bst_run_arcs *arcs = arcs_of(world);
    taken out = {0};
    for (int k = 1; k <= 9; k++) {
        take_frame(&ctx, arcs, k, 3, BST_TRACK_CONFIRMED, false, keep, &out);
    }
    take_frame(&ctx, arcs, 10, 0, 0, true, keep, &out);
    assert_true(out.count == 1 && out.arc.count == 0 && out.arc.hits == 9);
    for (int k = 11; k <= 30; k++) {
        take_frame(&ctx, arcs, k, 4, BST_TRACK_TENTATIVE, true, keep, &out);
    }
    take_frame(&ctx, arcs, 4, 5, BST_TRACK_CONFIRMED, true, keep, &out);  /* four hits */
    take_frame(&ctx, arcs, 31, 3, BST_TRACK_CONFIRMED, true, keep, &out); /* used already */
    bst_assert_ok(&ctx, bst_run_arcs_finish(&ctx, arcs, keep, &out));
    assert_int_equal(out.count, 1);
    /* 70 tracks that are not confirmed, and a confirmed one */
    bst_tracks *many = test_calloc(1, sizeof *many + 71 * sizeof many->items[0]);
    *many = (bst_tracks){.exposure_id = 50, .tick = 500, .count = 71, .attitude = {.valid = true}};
    for (int i = 0; i < 71; i++) {
        many->items[i] = (bst_track){
            .id = 100 + i, .status = i < 70 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED, .hits = 9};
    }
    bst_assert_ok(&ctx, bst_run_arcs_tracks(&ctx, arcs, 0, many, keep, &out));
    bst_assert_ok(&ctx, bst_run_arcs_finish(&ctx, arcs, keep, &out));
    assert_true(out.count == 2 && out.arc.id == 170);
    test_free(many);
    bst_run_arcs_free(arcs);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(measured_directions),      cmocka_unit_test(saved_centroids_are_there),
        cmocka_unit_test(saved_times_are_possible), cmocka_unit_test(arcs_of_tracks),
        cmocka_unit_test(directions_of_the_middle), cmocka_unit_test(arcs_that_lack_something),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
