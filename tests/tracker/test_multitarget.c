/* Many targets in clutter: identity through crossings, false tracks, load, misses. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "tests/tracker/pixel_tracker.h"

#define MAX_DETECTIONS 8000

static bst_mtt_params defaults(void) {
    return pixel_tracker(256, MAX_DETECTIONS);
}

/* An object in a plane of pixels about a point of the sky. */
typedef struct object {
    double x, y, vx, vy;
} object;

typedef struct bench {
    bst_mtt *mtt;
    bst_mtt_detection detections[MAX_DETECTIONS];
    int count;
    bst_rng_key key;
    uint64_t draw;
    bst_vec3 centre;
} bench;

static bench work;

static bench *start(uint64_t seed, const bst_mtt_params *params) {
    bst_ctx ctx = {0};
    bench *b = &work;
    memset(b, 0, sizeof *b);
    b->key = bst_rng_make_key(seed, 0, "test", "multitarget");
    b->centre = bst_vec3_from_radec(0.0001, 0.3);
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, params, &b->mtt));
    return b;
}

static double uniform(bench *b) {
    return bst_rng_uniform(b->key, 0, b->draw++);
}

static double normal(bench *b) {
    return bst_rng_normal(b->key, 1, b->draw++);
}

static bst_vec3 at_pixel(const bench *b, double x, double y) {
    bst_tangent axes = bst_tangent_at(b->centre);
    return bst_vec3_unit(
        bst_vec3_add(b->centre, bst_tangent_vector(&axes, tan(x * PX), tan(y * PX))));
}

static void see(bench *b, double x, double y, double sigma_px, double v_mag) {
    double r = pow(sigma_px * PX, 2);
    b->detections[b->count++] = (bst_mtt_detection){
        .sky = {.direction = at_pixel(b, x + sigma_px * normal(b), y + sigma_px * normal(b)),
                .cov_11 = r,
                .cov_22 = r},
        .x_px = x,
        .y_px = y,
        .v_mag = v_mag + 0.05 * normal(b),
        .v_mag_sigma = 0.05,
        .snr = 20,
        .length_rad = 2 * PX};
}

static void clutter(bench *b, int n, double sigma_px) {
    for (int i = 0; i < n; i++) {
        double x = FIELD_PX * (uniform(b) - 0.5), y = FIELD_PX * (uniform(b) - 0.5);
        see(b, x, y, sigma_px, 14.5);
    }
}

static void frame(bench *b, double seconds) {
    bst_mtt_frame f = {.tick = (int64_t)llround(seconds * 1000),
                       .seconds = seconds,
                       .detections = b->detections,
                       .count = b->count};
    bst_mtt_step(b->mtt, &f);
    b->count = 0;
}

static int poisson(bench *b, double mean) {
    int n = 0;
    for (double p = uniform(b), l = exp(-mean); p > l; p *= uniform(b)) {
        n++;
    }
    return n;
}

/* The confirmed track nearest to a pixel, within 2 px; 0 when none. */
static int64_t track_at(const bench *b, double x, double y) {
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &n);
    bst_vec3 d = at_pixel(b, x, y);
    double nearest = 2.0 * PX;
    int64_t id = 0;
    for (int i = 0; i < n; i++) {
        double off = bst_vec3_angle(d, tracks[i].state.direction);
        if (tracks[i].status != BST_TRACK_TENTATIVE && off < nearest) {
            nearest = off;
            id = tracks[i].id;
        }
    }
    return id;
}

static int confirmed_count(const bench *b) {
    int n, c = 0;
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &n);
    for (int i = 0; i < n; i++) {
        c += tracks[i].status != BST_TRACK_TENTATIVE;
    }
    return c;
}

/* Two equally bright objects cross; light nearer than 3 px melts into one detection. True when
 * both keep their identity. */
static bool cross(uint64_t seed, double rate_pxps, double miss_px, double sigma_px, double pd) {
    bst_mtt_params params = defaults();
    bench *b = start(seed, &params);
    double meet = 25.0 + 5.0 * uniform(b), angle = 2 * BST_PI * uniform(b);
    double c = cos(angle), s = sin(angle);
    object o[2] = {{0, 0, 3.0, 1.0},
                   {-miss_px * s - rate_pxps * meet * c, miss_px * c - rate_pxps * meet * s,
                    3.0 + rate_pxps * c, 1.0 + rate_pxps * s}};
    int64_t before[2] = {0, 0}, after[2] = {0, 0};
    double end = meet + fmax(20.0, 14.0 / rate_pxps);
    for (double t = 0.0; t < end; t += 1.0) {
        double x[2], y[2];
        for (int i = 0; i < 2; i++) {
            x[i] = o[i].x + o[i].vx * t - 3.0 * meet;
            y[i] = o[i].y + o[i].vy * t - meet;
        }
        double apart = hypot(x[1] - x[0], y[1] - y[0]);
        if (apart < 3.0) {
            see(b, 0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), sigma_px, 12.25);
        } else {
            for (int i = 0; i < 2; i++) {
                if (uniform(b) < pd) {
                    see(b, x[i], y[i], sigma_px, 13.0);
                }
            }
        }
        clutter(b, poisson(b, 1.0), sigma_px);
        frame(b, t);
        for (int i = 0; i < 2 && apart > 5.0; i++) {
            int64_t id = track_at(b, x[i], y[i]);
            if (t < meet) {
                before[i] = id ? id : before[i];
            } else {
                after[i] = id;
            }
        }
    }
    bst_mtt_free(b->mtt);
    return before[0] != 0 && before[1] != 0 && before[0] == after[0] && before[1] == after[1];
}

static void crossing_targets_keep_identity(void **state) {
    (void)state;
    const double cases[][4] = {
        /* px/s, closest px, centroid px, Pd */
        {0.5, 0.0, 0.1, 1.0},   {0.5, 2.0, 0.1, 1.0},   {1.0, 0.5, 0.1, 1.0},  {3.0, 1.0, 0.1, 1.0},
        {0.5, 1.0, 0.25, 0.85}, {1.0, 1.0, 0.25, 0.85}, {3.0, 0.0, 0.25, 0.85}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int kept = 0;
        for (uint64_t seed = 0; seed < 100; seed++) {
            kept += cross(seed, cases[i][0], cases[i][1], cases[i][2], cases[i][3]);
        }
        print_message("crossing at %.1f px/s, %.1f px, centroid %.2f px, Pd %.2f: %d of 100\n",
                      cases[i][0], cases[i][1], cases[i][2], cases[i][3], kept);
        assert_true(kept >= 95);
    }
}

/* Confirmed tracks per hour of clutter alone. */
static double false_tracks_per_hour(double per_frame, double sigma_px, int frames) {
    bst_mtt_params params = defaults();
    bench *b = start(11, &params);
    int confirmed = 0;
    for (int k = 0; k < frames; k++) {
        clutter(b, poisson(b, per_frame), sigma_px);
        frame(b, k);
        int n;
        const bst_mtt_event *events = bst_mtt_events(b->mtt, &n);
        for (int i = 0; i < n; i++) {
            confirmed += events[i].kind == BST_MTT_CONFIRMED;
        }
    }
    bst_mtt_free(b->mtt);
    return confirmed * 3600.0 / frames;
}

static void false_tracks_are_rare(void **state) {
    (void)state;
    double one = false_tracks_per_hour(1.0, 0.25, 200000);
    double ten = false_tracks_per_hour(10.0, 0.25, 20000);
    double hundred = false_tracks_per_hour(100.0, 0.25, 1500);
    print_message("false tracks per hour: %.3f at 1 alarm a frame, %.2f at 10, %.2f at 100\n", one,
                  ten, hundred);
    /* 55 hours: the limit of 1 an hour would give 55 */
    assert_true(one < 0.2);
    assert_true(ten < 3.0);
    assert_true(hundred < 30.0);
}

static void five_hundred_tracks(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.max_tracks = 700;
    bench *b = start(12, &params);
    enum { N = 500 };
    static object o[N];
    for (int i = 0; i < N; i++) {
        o[i] = (object){900 * (uniform(b) - 0.5), 900 * (uniform(b) - 0.5), 2 * normal(b),
                        2 * normal(b)};
    }
    for (int k = 0; k < 25; k++) {
        for (int i = 0; i < N; i++) {
            if (uniform(b) < 0.9) {
                see(b, o[i].x + o[i].vx * k, o[i].y + o[i].vy * k, 0.1, 13.0);
            }
        }
        frame(b, k);
    }
    int found = 0;
    for (int i = 0; i < N; i++) {
        found += track_at(b, o[i].x + o[i].vx * 24, o[i].y + o[i].vy * 24) != 0;
    }
    print_message("500 objects: %d found, %d tracks confirmed\n", found, confirmed_count(b));
    assert_true(found >= 490);
    assert_in_range(confirmed_count(b), 485, 510);
    bst_mtt_free(b->mtt);
}

static void heavy_clutter_overflows_gracefully(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    bench *b = start(13, &params);
    object o = {-100, -50, 3, 2};
    int lost = 0;
    for (int k = 0; k < 40; k++) {
        if (k >= 20) {
            clutter(b, 5000, 0.1);
        }
        see(b, o.x + o.vx * k, o.y + o.vy * k, 0.1, 13.0);
        frame(b, k);
        lost += bst_mtt_lost(b->mtt);
        int n;
        bst_mtt_tracks(b->mtt, &n);
        assert_in_range(n, 0, 256);
    }
    assert_true(lost > 0);
    assert_int_not_equal(track_at(b, o.x + o.vx * 39, o.y + o.vy * 39), 0);
    bst_mtt_free(b->mtt);
    params.max_detections = 10;
    b = start(13, &params);
    clutter(b, 25, 0.1);
    frame(b, 0);
    assert_int_equal(bst_mtt_lost(b->mtt), 15);
    bst_mtt_free(b->mtt);
}

static bool outside(const void *user, bst_vec3 direction) {
    (void)user;
    (void)direction;
    return false;
}

static void coasting_and_deletion(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    bench *b = start(14, &params);
    for (int k = 0; k < 10; k++) {
        see(b, 2.0 * k, 1.0 * k, 0.1, 13.0);
        frame(b, k);
        assert_int_equal(confirmed_count(b), k >= 2 ? 1 : 0);
    }
    int64_t id = track_at(b, 18, 9);
    for (int k = 10; k < 22; k++) {
        frame(b, k);
        const bst_mtt_track *track = bst_mtt_find(b->mtt, id);
        assert_non_null(track);
        assert_int_equal(track->status, BST_TRACK_COASTING);
        assert_int_equal(track->misses_in_row, k - 9);
    }
    see(b, 44, 22, 0.1, 13.0); /* comes back where it should be */
    frame(b, 22);
    assert_int_equal(track_at(b, 44, 22), id);
    assert_int_equal(bst_mtt_find(b->mtt, id)->status, BST_TRACK_CONFIRMED);
    /* outside the field nothing is missed; time alone ends it */
    for (int k = 23; k < 120; k++) {
        bst_mtt_frame f = {
            .tick = k * 1000, .seconds = k, .detections = b->detections, .in_field = outside};
        bst_mtt_step(b->mtt, &f);
        assert_int_equal(bst_mtt_find(b->mtt, id)->misses_in_row, 0);
    }
    bst_mtt_frame late = {
        .tick = 200000, .seconds = 200, .detections = b->detections, .in_field = outside};
    bst_mtt_step(b->mtt, &late);
    assert_null(bst_mtt_find(b->mtt, id));
    int n;
    const bst_mtt_event *events = bst_mtt_events(b->mtt, &n);
    assert_int_equal(n, 1);
    assert_int_equal(events[0].kind, BST_MTT_LOST);
    assert_int_equal(events[0].track.id, id);
    bst_mtt_free(b->mtt);
}

static void an_hour_without_frames(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    bench *b = start(15, &params);
    for (int k = 0; k < 10; k++) {
        see(b, 2.0 * k, 1.0 * k, 0.1, 13.0);
        frame(b, k);
    }
    int64_t first = track_at(b, 18, 9);
    for (int k = 0; k < 10; k++) {
        see(b, -300 + 2.0 * k, 1.0 * k, 0.1, 13.0);
        frame(b, 3609 + k);
    }
    /* the old track is gone and a new one is there */
    assert_null(bst_mtt_find(b->mtt, first));
    int64_t second = track_at(b, -282, 9);
    assert_true(second > first);
    bst_mtt_free(b->mtt);
}

/* A cue whose motion bends: the track follows it through a gap. */
static void feeds_the_cue_forward(void **state) {
    (void)state;
    const double acceleration = 0.05 * AS; /* along axis 1 */
    double error[2];
    for (int with = 0; with < 2; with++) {
        bst_mtt_params params = defaults();
        bench *b = start(16, &params);
        bst_tangent axes = bst_tangent_at(b->centre);
        bst_vec3 cue_before = b->centre, rate_before = {0, 0, 0};
        for (int k = 0; k <= 40; k++) {
            double x = 0.5 * acceleration * k * k / PX;
            bst_vec3 cue = at_pixel(b, x + 300, 100),
                     rate = bst_vec3_scale(axes.e1, acceleration * k);
            if (k < 20 || k == 40) {
                see(b, x, 0, 0.05, 13.0);
            }
            if (k == 40) {
                break;
            }
            bst_mtt_frame f = {.tick = k * 1000,
                               .seconds = k,
                               .detections = b->detections,
                               .count = b->count,
                               .in_field = k < 20 ? NULL : outside,
                               .cue_valid = with,
                               .cue_before_valid = with && k > 0,
                               .cue_direction = cue,
                               .cue_rate_radps = bst_tangent_project(cue, rate),
                               .cue_before_direction = cue_before,
                               .cue_before_rate_radps = rate_before,
                               .cue_rate_sigma_radps = 0.5 * AS};
            bst_mtt_step(b->mtt, &f);
            b->count = 0;
            cue_before = cue;
            rate_before = f.cue_rate_radps;
        }
        int n;
        const bst_mtt_track *t = bst_mtt_tracks(b->mtt, &n);
        assert_int_equal(n, 1);
        double x39 = 0.5 * acceleration * 39 * 39 / PX;
        error[with] = bst_vec3_angle(t->state.direction, at_pixel(b, x39, 0)) / PX;
        bst_mtt_free(b->mtt);
    }
    print_message("after 20 s of coasting at 0.05 arcsec/s2: %.2f px, with the cue %.2f px\n",
                  error[0], error[1]);
    assert_true(error[1] < 0.8); /* 0.05 px centroids: about 0.03 px/s of rate error over 20 s */
    assert_true(error[0] > 2.5); /* a t^2 / 2 = 3.3 px: the help is needed */
}

/* ---- what is at rest ---- */

static bst_mtt_params with_stars(void) {
    bst_mtt_params params = defaults();
    params.star_rate_radps = 0.5 * AS;
    params.motion_chi2 = 25;
    params.max_stationary_tracks = 1000;
    return params;
}

static int rest_count(const bench *b) {
    int n, c = 0;
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &n);
    for (int i = 0; i < n; i++) {
        c += tracks[i].at_rest;
    }
    return c;
}

static int events_of(const bench *b, bst_mtt_event_kind kind) {
    int n, c = 0;
    const bst_mtt_event *events = bst_mtt_events(b->mtt, &n);
    for (int i = 0; i < n; i++) {
        c += events[i].kind == kind;
    }
    return c;
}

/* 300 stars, each seen in 4 of 5 frames, and objects of 60, 6 and 1.2 arcsec/s. */
static void unknown_stars_are_no_tracks(void **state) {
    (void)state;
    bst_mtt_params params = with_stars();
    bench *b = start(21, &params);
    static object stars[300];
    for (int i = 0; i < 300; i++) {
        stars[i] = (object){.x = 900 * (uniform(b) - 0.5), .y = 900 * (uniform(b) - 0.5)};
    }
    const double speed[3] = {20.0, 2.0, 0.4};
    int confirmed = 0, since[3] = {0};
    for (int k = 0; k < 40; k++) {
        for (int i = 0; i < 300; i++) {
            if (uniform(b) < 0.8) {
                see(b, stars[i].x, stars[i].y, 0.15, 14);
            }
        }
        for (int i = 0; i < 3; i++) {
            see(b, -400 + speed[i] * k, 465 + 10 * i, 0.1, 13);
        }
        frame(b, k);
        confirmed += events_of(b, BST_MTT_CONFIRMED);
        for (int i = 0; i < 3; i++) {
            bool there = track_at(b, -400 + speed[i] * k, 465 + 10 * i) != 0;
            since[i] = there && since[i] == 0 ? k : since[i];
        }
    }
    print_message("300 stars: %d at rest; objects confirmed after %d, %d, %d frames\n",
                  rest_count(b), since[0], since[1], since[2]);
    assert_int_equal(confirmed, 3);                          /* the objects and nothing else */
    assert_int_equal(confirmed_count(b) - 3, rest_count(b)); /* a star's status is not tentative */
    assert_true(rest_count(b) >= 297 && rest_count(b) <= 305); /* a blend or a copy of one or two */
    assert_true(since[0] > 0 && since[0] <= 4);
    assert_true(since[1] > 0 && since[1] <= 6);
    /* its rate's error falls below a fifth of the rate within ten frames of 0.1 px */
    assert_true(since[2] > 0 && since[2] <= 15);
    bst_mtt_free(b->mtt);
}

/* A star unseen for a minute is the same one; without room stars are counted as lost, and what
 * moves is followed all the same. */
static void stars_are_kept_while_there_is_room(void **state) {
    (void)state;
    bst_mtt_params params = with_stars();
    bench *b = start(22, &params);
    for (int k = 0; k < 75; k++) {
        if (k < 15 || k == 74) {
            see(b, 100, 100, 0.1, 13);
        }
        frame(b, k);
        assert_int_equal(events_of(b, BST_MTT_CONFIRMED), 0);
    }
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &n);
    assert_int_equal(n, 1);
    assert_true(tracks[0].star);
    assert_int_equal(tracks[0].hits, 16);
    frame(b, 74 + 121); /* longer than max_coast_s */
    bst_mtt_tracks(b->mtt, &n);
    assert_int_equal(n, 0);
    assert_int_equal(events_of(b, BST_MTT_LOST), 0);
    bst_mtt_free(b->mtt);

    params.max_stationary_tracks = 10;
    b = start(23, &params);
    for (int k = 0; k < 10; k++) {
        for (int i = 0; i < 50; i++) {
            see(b, -400 + 15 * i, -300, 0.1, 13);
        }
        see(b, 5.0 * k, 0, 0.1, 13);
        frame(b, k);
    }
    assert_int_equal(rest_count(b), 10);
    assert_true(track_at(b, 45, 0) != 0);
    bst_mtt_free(b->mtt);
}

static bool always(const void *user, const bst_mtt_track *track) {
    (void)track;
    return *(const bool *)user;
}

/* What the cue expects to stand still is confirmed; once the cue expects something else, it is a
 * star. */
static void the_cue_may_expect_rest(void **state) {
    (void)state;
    bst_mtt_params params = with_stars();
    bench *b = start(24, &params);
    for (int k = 0; k < 30; k++) {
        bool expected = k < 20;
        see(b, 10, 10, 0.1, 13);
        bst_mtt_frame f = {.tick = k * 1000,
                           .seconds = k,
                           .detections = b->detections,
                           .count = b->count,
                           .expected = always,
                           .user = &expected};
        bst_mtt_step(b->mtt, &f);
        b->count = 0;
        assert_int_equal(events_of(b, BST_MTT_CONFIRMED), k == 2);
        assert_int_equal(events_of(b, BST_MTT_LOST), k == 20);
        assert_int_equal(rest_count(b), k >= 20);
    }
    bst_mtt_free(b->mtt);
}

/* A drift of 1 arcsec/s that all directions share makes satellites of stars unless it is known that
 * there may be one. */
static void a_common_rate_is_no_motion(void **state) {
    (void)state;
    for (int known = 0; known < 2; known++) {
        bst_mtt_params params = with_stars();
        bench *b = start(25, &params);
        int confirmed = 0;
        for (int k = 0; k < 20; k++) {
            for (int i = 0; i < 20; i++) {
                see(b, -400 + 40 * i + k / 3.0, 0, 0.1, 13);
            }
            bst_mtt_frame f = {.tick = k * 1000,
                               .seconds = k,
                               .detections = b->detections,
                               .count = b->count,
                               .common_rate_sigma_radps = known ? 0.5 * AS : 0.0};
            bst_mtt_step(b->mtt, &f);
            b->count = 0;
            confirmed += events_of(b, BST_MTT_CONFIRMED);
        }
        assert_int_equal(confirmed, known ? 0 : 20);
        bst_mtt_free(b->mtt);
    }
}

/* One detection beside another, equally far from where the track is expected: brightness decides.
 * The misfit counts in standard deviations of both magnitudes. */
static void brightness_counts_by_its_uncertainty(void **state) {
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        bst_mtt_params params = defaults();
        params.merge_rad = 0.0;
        bench *b = start(31, &params);
        for (int k = 0; k < 8; k++) {
            see(b, 3.0 * k, 0, 0.3, 12.0);
            frame(b, k);
        }
        int64_t id = track_at(b, 21.0, 0.0);
        assert_true(id > 0);
        /* 1.2 mag off and known to 1 mag: 1.2 sigma. 0.8 mag off and known to 0.01 mag: 2.6 sigma,
         * with the 0.3 mag by which any object may change */
        see(b, 24.0, 0.5 * side, 1e-3, 12.0);
        b->detections[0].v_mag = 13.2;
        b->detections[0].v_mag_sigma = 1.0;
        see(b, 24.0, -0.5 * side, 1e-3, 12.0);
        b->detections[1].v_mag = 12.8;
        b->detections[1].v_mag_sigma = 0.01;
        for (int i = 0; i < 2; i++) {
            b->detections[i].sky.cov_11 = b->detections[i].sky.cov_22 = pow(0.5 * PX, 2);
        }
        frame(b, 8);
        const bst_mtt_track *track = bst_mtt_find(b->mtt, id);
        assert_non_null(track);
        bst_assert_close(track->y_px, 0.5 * side, 1e-9); /* that very detection */
        bst_mtt_free(b->mtt);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(crossing_targets_keep_identity),
                                       cmocka_unit_test(false_tracks_are_rare),
                                       cmocka_unit_test(brightness_counts_by_its_uncertainty),
                                       cmocka_unit_test(five_hundred_tracks),
                                       cmocka_unit_test(heavy_clutter_overflows_gracefully),
                                       cmocka_unit_test(coasting_and_deletion),
                                       cmocka_unit_test(an_hour_without_frames),
                                       cmocka_unit_test(feeds_the_cue_forward),
                                       cmocka_unit_test(unknown_stars_are_no_tracks),
                                       cmocka_unit_test(stars_are_kept_while_there_is_room),
                                       cmocka_unit_test(the_cue_may_expect_rest),
                                       cmocka_unit_test(a_common_rate_is_no_motion)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
