/* The shared ephemeris against direct evaluation, and the field query over candidates against brute
 * force. */
#include "sim/world/orbit/ephemeris.h"

#include <pthread.h>
#include <stdlib.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/world/scene/field_objects.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"
#define DAY 86400.0

typedef struct family {
    const char *name;
    double perigee_km, apogee_km, inclination_deg;
} family;

/* Low, transfer, half-day resonant, one-day resonant and very eccentric orbits. */
static const family families[] = {
    {"low", 400, 420, 51.6},
    {"low, high", 1300, 1400, 98},
    {"debris", 600, 2500, 74},
    {"transfer", 300, 35800, 7},
    {"Molniya", 600, 39700, 63.4},
    {"navigation", 20100, 20250, 55},
    {"synchronous", 35770, 35800, 0.05},
    {"drifting", 35500, 36400, 14},
    {"far", 600, 250000, 30},
};
enum { FAMILIES = sizeof families / sizeof *families };

static double drawn(int i, int what) {
    return bst_rng_uniform(bst_rng_make_key(5, 0, "test", "orbits"), (uint64_t)i, (uint64_t)what);
}

static bst_elements elements_of(const family *f, int i) {
    double low = 6378.135 + f->perigee_km, high = 6378.135 + f->apogee_km, a = 0.5 * (low + high);
    return (bst_elements){.epoch_utc_jd1 = 2459746.5, /* 2022-06-16 */
                          .epoch_utc_jd2 = drawn(i, 0),
                          .bstar = f->perigee_km < 1000 ? 1e-5 : 0.0,
                          .inclination_rad = f->inclination_deg * BST_DEG_RAD,
                          .raan_rad = 2 * BST_PI * drawn(i, 1),
                          .eccentricity = (high - low) / (high + low),
                          .arg_perigee_rad = 2 * BST_PI * drawn(i, 2),
                          .mean_anomaly_rad = 2 * BST_PI * drawn(i, 3),
                          .mean_motion_radpmin = 60 * sqrt(3.986008e5 / (a * a * a))};
}

static void set_orbit(bst_ctx *ctx, const bst_world *world, const bst_elements *set,
                      bst_world_orbit *orbit) {
    bst_time epoch;
    bst_assert_ok(ctx, bst_time_from_utc_jd(ctx, set->epoch_utc_jd1, set->epoch_utc_jd2, &epoch));
    bst_sgp4_free(orbit->sgp4);
    bst_assert_ok(ctx, bst_sgp4_create(ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &orbit->sgp4));
    orbit->source = BST_ORBIT_SGP4;
    orbit->epoch_offset_s = bst_time_diff(world->epoch, epoch);
    orbit->name = "drawn";
}

static void renew(bst_ctx *ctx, bst_world *world) {
    bst_ephemeris_free(world->ephemeris);
    bst_assert_ok(ctx, bst_ephemeris_create(ctx, world, &world->ephemeris));
}

/* A world of `count` objects of all families, seen from NEOSSat with such pixels. */
static bst_world *populated(int count, double pixel_arcsec) {
    bst_ctx ctx = {0};
    bst_world *world = test_world_with("", "");
    free(world->objects);
    world->objects = calloc((size_t)count + 1, sizeof *world->objects);
    assert_non_null(world->objects);
    world->object_count = count;
    for (int i = 0; i < count; i++) {
        bst_elements set = elements_of(&families[i % FAMILIES], i);
        set_orbit(&ctx, world, &set, &world->objects[i].orbit);
        world->objects[i].info = (bst_world_object_info){.area_m2 = 4, .albedo = 0.25};
    }
    world->observers[0].sensors[0].config.camera.pixel_scale_arcsec = pixel_arcsec;
    renew(&ctx, world);
    return world;
}

static void error_is_below_a_thousandth_of_a_pixel(void **state) {
    (void)state;
    const double pixels[] = {0.5, 3.0}; /* 3: the sharpest that is shipped */
    for (int c = 0; c < 2; c++) {
        bst_ctx ctx = {0};
        enum { EACH = 4, TIMES = 100 };
        bst_world *world = populated(EACH * FAMILIES, pixels[c]);
        bst_sky_clock *clock;
        bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, world->eop, &clock));
        int used[FAMILIES] = {0};
        /* one end of two; 10 um: what SGP4 itself is rounded to */
        double tolerance = fmax(0.5e-3 * pixels[c] * BST_ARCSEC_RAD * 1e4, 10e-6);
        for (int k = 0; k < TIMES; k++) {
            double t = DAY * (k + drawn(k, 9)) / TIMES;
            for (int i = 0; i < world->object_count; i++) {
                bst_world_state direct;
                bst_vec3 r, v;
                if (bst_world_orbit_state(&ctx, &world->objects[i].orbit, clock, world->epoch, t,
                                          true, &direct) != BST_OK) {
                    assert_false(bst_ephemeris_at(world->ephemeris, NULL, i, t, &r, &v));
                    continue;
                }
                if (bst_ephemeris_at(world->ephemeris, NULL, i, t, &r, &v)) {
                    used[i % FAMILIES]++;
                    bst_assert_close(test_distance(r, direct.position_m), 0, tolerance);
                    bst_world_state before, after;
                    bst_assert_ok(&ctx,
                                  bst_world_orbit_state(&ctx, &world->objects[i].orbit, clock,
                                                        world->epoch, t - 0.5, true, &before));
                    bst_assert_ok(&ctx, bst_world_orbit_state(&ctx, &world->objects[i].orbit, clock,
                                                              world->epoch, t + 0.5, true, &after));
                    /* third derivative at perigee (1.2e-3 rad/s)^3 r / 24 = 0.5 mm/s */
                    bst_vec3 slope = bst_vec3_sub(after.position_m, before.position_m);
                    bst_assert_close(test_distance(v, slope), 0, 1e-3);
                }
            }
        }
        for (int f = 0; f < FAMILIES; f++) {
            /* resonances are left to SGP4 for 40 minutes in 12 hours, 6 % */
            if (used[f] < 0.93 * EACH * TIMES) {
                fail_msg("%s: only %d of %d are interpolated", families[f].name, used[f],
                         EACH * TIMES);
            }
        }
        bst_sky_clock_free(clock);
        bst_world_free(world);
    }
}

typedef struct answer {
    bst_vec3 r, v;
    bool there;
} answer;

enum { ASKED_BODIES = 30, ASKED_TIMES = 15 };

static double asked_time(int k) {
    return k % 2 ? 3.7 * k : -7000 + 3 * DAY * drawn(k, 11);
}

static void ask(bst_ephemeris *e, bst_ephemeris_reader *reader, int n, answer *out) {
    int body = n % ASKED_BODIES;
    out->there = bst_ephemeris_at(e, reader, body, asked_time(n / ASKED_BODIES), &out->r, &out->v);
}

typedef struct asking {
    bst_ephemeris *ephemeris;
    const answer *expected;
    int from, step, differences;
    bst_ephemeris_reader reader;
} asking;

static void *ask_all(void *argument) {
    asking *a = argument;
    int n = ASKED_BODIES * ASKED_TIMES, *near = malloc(2000 * sizeof *near);
    for (int i = 0; i < n && near; i++) {
        int k = (a->from + a->step * i) % n;
        answer got = {0};
        if (i % 100 == 0) { /* moves the window about as well */
            bst_ephemeris_cone cone = {
                .apex_m = {7e6, 0, 0}, .axis = {1, 0, 0}, .half_angle_rad = 0.1};
            (void)bst_ephemeris_near(a->ephemeris, asked_time(k / ASKED_BODIES), &cone, near);
        }
        ask(a->ephemeris, &a->reader, k, &got);
        a->differences += memcmp(&got, &a->expected[k], sizeof got) != 0;
    }
    free(near);
    return NULL;
}

/* In the order of time, in another, from two threads at once. */
static void order_and_threads_change_no_bit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { ALL = ASKED_BODIES * ASKED_TIMES };
    bst_world *world = populated(400, 3.0);
    answer *expected = calloc(ALL, sizeof *expected);
    assert_non_null(expected);
    for (int n = 0; n < ALL; n++) {
        ask(world->ephemeris, NULL, n, &expected[n]);
    }
    for (int threads = 1; threads <= 2; threads++) {
        renew(&ctx, world);
        bst_assert_ok(&ctx, bst_ephemeris_prepare(&ctx, world->ephemeris, threads));
        asking a = {world->ephemeris, expected, 17, 1129, 0, {{{0}}}},
               b = {world->ephemeris, expected, 3, 1517, 0, {{{0}}}};
        pthread_t other;
        assert_int_equal(pthread_create(&other, NULL, ask_all, &b), 0);
        ask_all(&a);
        pthread_join(other, NULL);
        assert_int_equal(a.differences, 0);
        assert_int_equal(b.differences, 0);
    }
    free(expected);
    bst_world_free(world);
}

/* Threads at different times, in turn: each keeps its knots, which the ring of 16 could not. */
static void readers_at_different_times_keep_their_knots(void **state) {
    (void)state;
    bst_world *world = test_world_with(GX5, "");
    bst_ephemeris_reader readers[2] = {{{{0}}}};
    bst_vec3 r, v;
    for (int k = 0; k < 100; k++) {
        for (int i = 0; i < 2; i++) { /* the observer, in a low orbit */
            assert_true(
                bst_ephemeris_at(world->ephemeris, &readers[i], 1, 0.01 * k + 7200.0 * i, &r, &v));
        }
    }
    assert_int_equal(bst_ephemeris_knots_made(world->ephemeris), 2 * BST_EPHEMERIS_KNOTS);
    bst_world_free(world);
}

static long resident_pages(void) {
    long size, resident = -1;
    FILE *file = fopen("/proc/self/statm", "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%ld %ld", &size, &resident), 2);
    fclose(file);
    return resident;
}

static void a_day_takes_no_more_memory_than_ten_minutes(void **state) {
    (void)state;
    bst_world *world = populated(1500, 3.0);
    bst_ephemeris_cone cone = {.apex_m = {7e6, 0, 0}, .axis = {1, 0, 0}, .half_angle_rad = 0.02};
    int *near = malloc(1500 * sizeof *near);
    assert_non_null(near);
    long before = 0;
    for (double t = 0; t < DAY; t += t < 600 ? 4 : 900) {
        (void)bst_ephemeris_near(world->ephemeris, t, &cone, near);
        before = t < 600 ? resident_pages() : before; /* all tables are made */
    }
    /* knots of a day would be 100 MiB; the test's own files and stack take a few pages */
    assert_true((resident_pages() - before) * sysconf(_SC_PAGESIZE) < 1 << 20);
    free(near);
    bst_world_free(world);
}

/* Observers that ask for times of two minutes ago and of now, by turns, as the custody of a
 * catalogue does: no table is made twice, whatever the distance of the times. */
static void times_by_turns_make_no_table_twice(void **state) {
    (void)state;
    bst_world *world = populated(1500, 3.0);
    bst_ephemeris_cone cone = {.apex_m = {7e6, 0, 0}, .axis = {1, 0, 0}, .half_angle_rad = 0.02};
    int *near = malloc(1500 * sizeof *near);
    assert_non_null(near);
    for (int back = 8; back <= 200; back += 8) {
        const double now = 1e4 + 1e3 * back;
        (void)bst_ephemeris_near(world->ephemeris, now - back, &cone, near);
        (void)bst_ephemeris_near(world->ephemeris, now, &cone, near);
        const int64_t made = bst_ephemeris_tables_made(world->ephemeris);
        for (int i = 0; i < 10; i++) {
            (void)bst_ephemeris_near(world->ephemeris, now - back, &cone, near);
            (void)bst_ephemeris_near(world->ephemeris, now, &cone, near);
        }
        assert_int_equal(bst_ephemeris_tables_made(world->ephemeris), made);
    }
    free(near);
    bst_world_free(world);
}

/* How far a position is outside of a cone, m. */
static double outside_m(const bst_ephemeris_cone *cone, bst_vec3 place_m, double half_rad) {
    bst_vec3 d = bst_vec3_sub(place_m, cone->apex_m);
    double along = bst_vec3_dot(d, cone->axis);
    double across = bst_vec3_norm(bst_vec3_axpy(d, -along, cone->axis));
    return across * cos(half_rad) - along * sin(half_rad);
}

/* A search finds all objects in a cone, at all times between two tables, and others only within its
 * tolerances: 11.5 km/s in the span, two times 1 km, and 5e-4 rad of aberration and light time. In
 * the 4 s from a table a low object moves by 31 km. */
static void a_search_finds_what_is_in_the_cone_and_little_beside_it(void **state) {
    (void)state;
    enum { COUNT = 1500, CONES = 400 };
    bst_world *world = populated(COUNT, 3.0);
    int *near = malloc(COUNT * sizeof *near), found = 0, beside = 0;
    assert_non_null(near);
    for (int k = 0; k < CONES; k++) {
        /* towards an object, from places between 100 km and 40,000 km away */
        double t = 8.0 * k + 8.0 * drawn(k, 10), half_span_s = 0.5 * (k % 2);
        bst_vec3 aim, velocity, p;
        if (!bst_ephemeris_at(world->ephemeris, NULL, k, t, &aim, &velocity)) {
            continue;
        }
        bst_ephemeris_cone cone = {.half_angle_rad = 0.3 * drawn(k, 11) * drawn(k, 12),
                                   .half_span_s = half_span_s};
        bst_vec3 way =
            bst_vec3_unit((bst_vec3){drawn(k, 13) - 0.5, drawn(k, 14) - 0.5, drawn(k, 15) - 0.5});
        cone.apex_m = bst_vec3_axpy(aim, -1e5 * pow(400.0, drawn(k, 16)), way);
        cone.axis = way;
        int count = bst_ephemeris_near(world->ephemeris, t, &cone, near), next = 0;
        for (int i = 0; i < COUNT; i++) {
            double least = INFINITY;
            bool known = true;
            for (int j = -1; j <= 1; j++) {
                known = known && bst_ephemeris_at(world->ephemeris, NULL, i, t + j * half_span_s,
                                                  &p, &velocity);
                least = fmin(least, outside_m(&cone, p, cone.half_angle_rad));
            }
            bool listed = next < count && near[next] == i;
            next += listed;
            found += known && least <= 0.0;
            assert_true(listed || !known || least > 0.0);
            if (listed && known && least > 0.0) {
                beside++;
                assert_true(outside_m(&cone, p, cone.half_angle_rad + 5e-4) <
                            2.0 * 11500.0 * (half_span_s + 1e-3) + 2001.0);
            }
        }
        assert_int_equal(next, count);
    }
    assert_true(found > 1000 && beside > 10);
    free(near);
    bst_world_free(world);
}

static void what_has_decayed_stays_away(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"gone\", \"orbit\": {\"elements_file\": "
        "\"tests/world/data/decayed.tle\", \"norad\": 28872}}, " GX5,
        "");
    bst_ephemeris_cone all = {.axis = {0, 0, 1}, .half_angle_rad = 3.0};
    bst_world_view *view;
    bst_world_state s;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = -10; t < 1000; t += 33) {
        int near[2] = {-1, -1};
        assert_int_equal(bst_ephemeris_near(world->ephemeris, t, &all, near), 1);
        assert_int_equal(near[0], 1);
        assert_int_equal(bst_world_view_object_state(&ctx, view, 0, t, &s), BST_ERR_NUMERIC);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Knots after a decay, which a later time has asked for, change no bit of a table before it. */
static void a_decay_that_is_ahead_changes_no_table(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(GX5, "");
    /* that of tests/world/data/decayed.tle with another epoch: it decays after about 3000 s */
    const bst_elements set = {.epoch_utc_jd1 = 2459746.5,
                              .epoch_utc_jd2 = 22.0 / 24 + 10.0 / 1440, /* TEST_EPOCH */
                              .bstar = 0.24476e-3,
                              .inclination_rad = 96.4736 * BST_DEG_RAD,
                              .raan_rad = 157.9986 * BST_DEG_RAD,
                              .eccentricity = 0.0303955,
                              .arg_perigee_rad = 244.0492 * BST_DEG_RAD,
                              .mean_anomaly_rad = 110.6523 * BST_DEG_RAD,
                              .mean_motion_radpmin = 16.46015938 * 2 * BST_PI / 1440};
    set_orbit(&ctx, world, &set, &world->objects[0].orbit);
    int found = 0;
    for (double t = 1600; t < 4000; t += 48) {
        bst_vec3 first = {0, 0, 0}, r, v;
        renew(&ctx, world);
        (void)bst_ephemeris_places(world->ephemeris, t, &first.x, &first.y, &first.z);
        for (double ahead = 16; ahead < 1000; ahead *= 2) {
            bst_vec3 place = {0, 0, 0};
            renew(&ctx, world);
            (void)bst_ephemeris_at(world->ephemeris, NULL, 0, t + ahead, &r, &v);
            (void)bst_ephemeris_places(world->ephemeris, t, &place.x, &place.y, &place.z);
            assert_memory_equal(&place, &first, sizeof first);
        }
        found += isfinite(first.x) && first.x != 0.0;
    }
    assert_in_range(found, 16, 49); /* some before it, some after it */
    bst_world_free(world);
}

/* Nearer than 10 km both ends are SGP4's, to the bit; further off neither is. */
static void near_objects_are_evaluated_directly(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world_with(
        "{\"name\": \"near\", " TEST_NEOSSAT
        "}, {\"name\": \"5 km\", \"orbit\": {\"source\": "
        "\"relative\", \"reference\": \"near\", \"offset_rtn_m\": [0, 5000, 0]}}, {\"name\": "
        "\"20 km\", \"orbit\": {\"source\": \"relative\", \"reference\": \"near\", "
        "\"offset_rtn_m\": [0, 20000, 0]}}",
        "");
    bst_world_view *view;
    bst_sky_clock *clock;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, world->eop, &clock));
    int same = 0;
    for (double t = 1; t < 6000; t += 101) {
        for (int i = 1; i <= 2; i++) {
            bst_world_state eye, target;
            bst_bodies bodies;
            bst_world_sight sight;
            bst_vec3 geometric;
            double emission;
            bst_assert_ok(&ctx, bst_world_orbit_state(&ctx, &world->observers[0].orbit, clock,
                                                      world->epoch, t, true, &eye));
            bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, t, &bodies));
            const bst_world_reception at = {&eye, clock, world->epoch, &bodies, t};
            bst_assert_ok(&ctx,
                          bst_world_orbit_line_of_sight(&ctx, &world->objects[i].orbit, &at, true,
                                                        &geometric, &target, &emission));
            bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, i, t, &sight));
            double off = test_distance(sight.geometric, bst_vec3_unit(geometric));
            same += i == 2 && off == 0;
            /* at 20 km half a thousandth of a pixel of 3 arcsec */
            bst_assert_close(off, 0, i == 1 ? 0 : 0.5e-3 * 3 * BST_ARCSEC_RAD);
        }
        /* the observer itself: nothing to see, and no failure */
        bst_world_sight self;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &self));
        assert_true(self.range_m == 0);
    }
    assert_true(same < 10);
    bst_sky_clock_free(clock);
    bst_world_view_free(view);
    bst_world_free(world);
}

static const bst_window full = {0, 0, 1024, 1024};

/* Whether the object is on the window at any of many instants. */
static bool seen(bst_ctx *ctx, const bst_world *world, bst_world_view *view, int object, bst_quat q,
                 double start, double end) {
    bst_scene_source_path path;
    bst_scene_path_light light;
    bst_world_sight mid;
    const bst_world_view_span span = {0, start, end};
    if (bst_world_view_path(ctx, view, &span, object, &path, &light, &mid) != BST_OK) {
        return false;
    }
    bst_scene_source s = {.kind = BST_SOURCE_OBJECT, .path = &path};
    for (int k = 0; k <= 150; k++) {
        double x, y;
        bst_vec3 d = bst_scene_source_direction(&s, k / 150.0);
        if (bst_camera_project(bst_world_camera(world, 0, 0), bst_quat_rotate(q, d), &x, &y) &&
            x >= -4 && x <= 1027 && y >= -4 && y <= 1027) {
            return true;
        }
    }
    return false;
}

/* Random skies, half of whose objects fly about the observer, and random exposures: each object
 * that brute force finds is among the sources. */
static void no_object_is_missed(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { OBJECTS = 120, QUERIES = 40 };
    bst_world *world = populated(OBJECTS, 3.0);
    family own = {"own", 760, 790, 98.4};
    bst_elements home = elements_of(&own, 1000);
    set_orbit(&ctx, world, &home, &world->observers[0].orbit);
    for (int i = 0; i < OBJECTS; i += 2) { /* from metres to a thousand kilometres, to 15 km/s */
        bst_elements set = home;
        double size = pow(10.0, -5.0 + 4.5 * drawn(i, 20));
        set.mean_anomaly_rad += size * (drawn(i, 21) - 0.5);
        set.arg_perigee_rad += size * (drawn(i, 22) - 0.5);
        set.inclination_rad += (i % 4 ? size : 1.2) * (drawn(i, 23) - 0.5);
        set.eccentricity += 0.01 * size * drawn(i, 24);
        set_orbit(&ctx, world, &set, &world->objects[i].orbit);
    }
    renew(&ctx, world);
    bst_world_view *view;
    bst_field *field;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_field_create(&ctx, world, 0, 0, &field));
    int found = 0, extra = 0;
    for (int n = 0; n < QUERIES; n++) {
        const double lengths[] = {0, 0.1, 2, 30};
        int64_t start = (int64_t)(6e6 * drawn(n, 30)),
                end = start + (int64_t)(1e3 * lengths[n % 4]);
        /* towards an object in the middle of the exposure, a little beside it */
        bst_world_sight sight;
        double mid = 0.5e-3 * (double)(start + end);
        bst_assert_ok(
            &ctx, bst_world_view_sight(&ctx, view, 0, (int)(OBJECTS * drawn(n, 31)), mid, &sight));
        bst_vec3 beside = {0.015 * (drawn(n, 32) - 0.5), 0.015 * (drawn(n, 33) - 0.5), 0};
        bst_quat q = bst_quat_look(bst_vec3_add(sight.apparent, beside), (bst_vec3){0, 0, 1});
        const double times[] = {0, 1e-3 * (double)(end - start)};
        const bst_quat attitudes[] = {q, q};
        const bst_los_track track = {2, times, attitudes};
        const bst_field_options options = {.v_limit = -90, .margin_px = 5};
        bst_truth truth;
        const bst_scene_source *sources;
        int count, next = 0;
        bst_assert_ok(&ctx, bst_field_query(&ctx, field, &track, start, end, 1000, full, &options,
                                            &truth, &sources, &count));
        for (int i = 0; i < OBJECTS; i++) {
            bool listed = next < count && sources[next].id == (uint32_t)i;
            bool there = seen(&ctx, world, view, i, q, 1e-3 * (double)start, 1e-3 * (double)end);
            next += listed;
            found += there;
            extra += listed && !there;
            if (there && !listed) {
                fail_msg("query %d: object %d is missing", n, i);
            }
        }
        assert_int_equal(next, count);
    }
    assert_true(found > QUERIES / 2);
    assert_true(extra < found); /* and the list is not simply everything */
    bst_field_free(field);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Three observers and the shipped sets: what each sees is where direct evaluation has it. */
static void three_observers_share_it(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const int numbers[] = {39089, 25544, 26360};
    char text[3000] =
        "{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\"}]}, \"observers\": [";
    for (int i = 0; i < 3; i++) {
        size_t used = strlen(text);
        snprintf(text + used, sizeof text - used,
                 "%s{\"name\": \"%d\", \"orbit\": {\"elements_file\": "
                 "\"scenarios/catalogue_2022-06.tle\", \"norad\": %d}, \"sensors\": [{" TEST_CAMERA
                 "}]}",
                 i ? ", " : "", i, numbers[i]);
    }
    strcat(text, "]}");
    bst_world *world = test_world(text);
    bst_world_view *view;
    bst_sky_clock *clock;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, world->eop, &clock));
    assert_int_equal(world->object_count, 5);
    for (int k = 0; k < 100; k++) {
        double t = 600.7 * k;
        for (int n = 0; n < 15; n++) {
            const bst_world_orbit *eye_orbit = &world->observers[n % 3].orbit;
            bst_world_state eye, target;
            bst_bodies bodies;
            bst_world_sight sight;
            bst_vec3 geometric;
            double emission;
            bst_assert_ok(
                &ctx, bst_world_orbit_state(&ctx, eye_orbit, clock, world->epoch, t, true, &eye));
            bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, t, &bodies));
            const bst_world_reception at = {&eye, clock, world->epoch, &bodies, t};
            bst_assert_ok(
                &ctx, bst_world_orbit_line_of_sight(&ctx, &world->objects[n / 3].orbit, &at, true,
                                                    &geometric, &target, &emission));
            bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, n % 3, n / 3, t, &sight));
            if (sight.range_m > 0) {
                bst_assert_close(test_distance(sight.geometric, bst_vec3_unit(geometric)), 0,
                                 1e-3 * 3 * BST_ARCSEC_RAD);
            }
        }
    }
    bst_sky_clock_free(clock);
    bst_world_view_free(view);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(error_is_below_a_thousandth_of_a_pixel),
        cmocka_unit_test(order_and_threads_change_no_bit),
        cmocka_unit_test(readers_at_different_times_keep_their_knots),
        cmocka_unit_test(a_day_takes_no_more_memory_than_ten_minutes),
        cmocka_unit_test(times_by_turns_make_no_table_twice),
        cmocka_unit_test(what_has_decayed_stays_away),
        cmocka_unit_test(a_decay_that_is_ahead_changes_no_table),
        cmocka_unit_test(a_search_finds_what_is_in_the_cone_and_little_beside_it),
        cmocka_unit_test(near_objects_are_evaluated_directly),
        cmocka_unit_test(no_object_is_missed),
        cmocka_unit_test(three_observers_share_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
