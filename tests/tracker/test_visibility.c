/* Tracks of objects that the Earth or its shadow hides: they sleep, nothing is taken for them, and
 * they wake as themselves. */
#include "tracker/mtt/visibility.h"

#include "boresight/rng.h"
#include "sim/astro/kepler.h"
#include "tests/test_support.h"
#include "tests/tracker/geo_look.h"
#include "tracker/mtt/multitarget_internal.h"

#define AS BST_ARCSEC_RAD
#define SIGMA (0.3 * AS)

static const bst_vec3 sun = {BST_AU_M, 0, 0};

static bst_mtt_sight sight_at(double angle_deg, bst_vec3 eye, double snr, double *sunlight) {
    double a = angle_deg * BST_DEG_RAD;
    bst_vec3 object = {-42164e3 * cos(a), 42164e3 * sin(a), 0};
    bst_mtt_light light;
    bst_mtt_sight sight =
        bst_visibility_of(object, eye, sun, &(bst_visibility_seen){.snr = snr}, 5.0, &light);
    *sunlight = light.sunlight;
    return sight;
}

/* Angles from the axis of the shadow, of a geostationary object: the Earth's disc is 8.70 deg in
 * radius there, the Sun's 0.266. */
static void shadow_by_angle(void **state) {
    (void)state;
    bst_vec3 eye = {0, 0, 7e6};
    double light;
    assert_int_equal(sight_at(0.0, eye, 20.0, &light), BST_MTT_DARK);
    bst_assert_close(light, 0.0, 0.0);
    assert_int_equal(sight_at(8.40, eye, 20.0, &light), BST_MTT_SHADOW);
    /* half of the Sun: of an SNR of 20 it leaves 10, two thresholds; of 9 only 4.5; of 5 half of
     * one */
    assert_int_equal(sight_at(8.70, eye, 20.0, &light), BST_MTT_CLEAR);
    bst_assert_close(light, 0.5, 0.02); /* the Earth's limb is curved */
    assert_int_equal(sight_at(8.70, eye, 9.0, &light), BST_MTT_FAINT);
    assert_int_equal(sight_at(8.70, eye, 5.0, &light), BST_MTT_SHADOW);
    /* full light, but an Earth 2 % larger would take some of it */
    assert_int_equal(sight_at(9.05, eye, 6.0, &light), BST_MTT_FAINT);
    bst_assert_close(light, 1.0, 0.0);
    assert_int_equal(sight_at(9.3, eye, 6.0, &light), BST_MTT_CLEAR);
    /* nothing known of its SNR: dark is dark, and what gets some light might be seen */
    assert_int_equal(sight_at(0.0, eye, 0.0, &light), BST_MTT_DARK);
    assert_int_equal(sight_at(8.70, eye, 0.0, &light), BST_MTT_FAINT);
}

static void behind_the_earth(void **state) {
    (void)state;
    bst_vec3 object = {42164e3, 0, 0};
    const bst_visibility_seen seen = {.snr = 20.0};
    bst_mtt_light light;
    const struct {
        double miss_km; /* of the line of sight, from the Earth's centre */
        bst_mtt_sight sight;
    } cases[] = {{0, BST_MTT_EARTH},
                 {6350, BST_MTT_EARTH},
                 {6370, BST_MTT_FAINT},
                 {6450, BST_MTT_FAINT},
                 {6510, BST_MTT_CLEAR}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        /* the line from the object that misses the centre by so much, carried on by 5000 km */
        double angle = asin(cases[k].miss_km * 1e3 / 42164e3), length = 42164e3 * cos(angle) + 5e6;
        bst_vec3 eye = {42164e3 - length * cos(angle), length * sin(angle), 0};
        assert_int_equal(bst_visibility_of(object, eye, sun, &seen, 5.0, &light), cases[k].sight);
    }
    /* an observer on the near side sees it past nothing */
    assert_int_equal(bst_visibility_of(object, (bst_vec3){7e6, 0, 0}, sun, &seen, 5.0, &light),
                     BST_MTT_CLEAR);
}

/* An object of SNR 20 at a phase angle of 20 degrees, as that angle grows. The light of a diffuse
 * sphere goes as (pi - phase) cos(phase) + sin(phase) (McCue et al. 1971): 2.966 there, 1 at 90
 * degrees, 0.427 at 115, 0.342 at 120, 0.151 at 135. */
static void lit_from_behind(void **state) {
    (void)state;
    const bst_vec3 object = {0, 0, 42164e3};
    const double range = 35e6;
    const struct {
        double phase_deg, light;
        bst_mtt_sight bright, dim; /* of what was seen bright and what was not */
    } cases[] = {
        {20, 2.96614, BST_MTT_CLEAR, BST_MTT_CLEAR},
        {90, 1.0, BST_MTT_FAINT, BST_MTT_CLEAR}, /* 6.74 */
        {115, 0.42686, BST_MTT_SHADOW, BST_MTT_SHADOW},
        {135, 0.15175, BST_MTT_SHADOW, BST_MTT_SHADOW},
    };
    bst_visibility_seen seen = {.snr = 20.0};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        double a = cases[k].phase_deg * BST_DEG_RAD;
        bst_vec3 eye = {object.x + range * cos(a), object.y + range * sin(a), object.z};
        bst_mtt_light light;
        for (int bright = 0; bright <= 1; bright++) {
            seen.was_bright = bright;
            assert_int_equal(bst_visibility_of(object, eye, sun, &seen, 5.0, &light),
                             bright ? cases[k].bright : cases[k].dim);
            /* the Sun stands 2e-4 rad beside its direction from the Earth */
            bst_assert_close(light.glow, 2.0 / (3.0 * BST_PI * BST_PI) * cases[k].light / 1225e12,
                             1e-3 * light.glow);
            seen.glow = seen.glow > 0.0 ? seen.glow : light.glow;
            bst_assert_close(light.snr, 20.0 * cases[k].light / cases[0].light, 0.02);
        }
    }
    /* twice as far: a quarter */
    bst_mtt_light light;
    bst_vec3 eye = {2.0 * range * cos(20.0 * BST_DEG_RAD), 2.0 * range * sin(20.0 * BST_DEG_RAD),
                    object.z};
    assert_int_equal(bst_visibility_of(object, eye, sun, &seen, 5.0, &light), BST_MTT_FAINT);
    bst_assert_close(light.snr, 5.0, 0.01); /* as above */
}

/* ---- the tracker through an hour of darkness ---- */

typedef struct bench {
    bst_orbit_range range;
    bst_mtt_sight sight;
} bench;

static bool range_of(const void *user, const bst_mtt_track *track, bst_orbit_range *out) {
    (void)track;
    *out = ((const bench *)user)->range;
    return true;
}

static bst_mtt_sight sight_of(const void *user, const bst_mtt_track *track, bst_mtt_light *light) {
    (void)track;
    *light = (bst_mtt_light){.sunlight = 1.0};
    return ((const bench *)user)->sight;
}

enum { DARK_FROM = 300, DARK_TO = 3900, END = 3920 };

typedef struct night {
    double max_dormant_s;
    int decoys;         /* detections at the predicted place in each dark frame, that do not last */
    double neighbour_m; /* another object so far ahead, seen all night; 0: none */
    /* results */
    int64_t id, id_after;
    int slept;      /* frames */
    int lost;       /* events of the track */
    int confirmed;  /* tracks in the dark */
    double off_rad; /* of the prediction from the truth at the end of the night */
} night;

static bst_mtt_detection seen_at(bst_vec3 d, bst_rng_key key, uint64_t n) {
    double e[2];
    bst_rng_normal2(key, 3, n, e);
    bst_tangent axes = bst_tangent_at(d);
    return (bst_mtt_detection){
        .sky = {.direction =
                    bst_tangent_exp(d, bst_tangent_vector(&axes, SIGMA * e[0], SIGMA * e[1])),
                .cov_11 = SIGMA * SIGMA,
                .cov_22 = SIGMA * SIGMA},
        .v_mag = 12.0,
        .v_mag_sigma = 0.1,
        .snr = 20.0};
}

static bst_mtt *make_tracker(bst_ctx *ctx, bst_mtt_association association, double max_dormant_s) {
    bst_mtt_params params = {.max_tracks = 50,
                             .max_detections = 50,
                             .association = association,
                             .noise_rad2ps3 = pow(0.02 * AS, 2),
                             .orbits = true,
                             .orbit_noise_m2ps3 = 1e-6,
                             .gate_chi2 = 16,
                             .detection_probability = 0.95,
                             .false_alarms_per_frame = 1,
                             .field_sr = pow(3000 * AS, 2),
                             .confirm_hits = 3,
                             .confirm_frames = 5,
                             .confirm_score = 12,
                             .max_rate_radps = 120 * AS,
                             .initiation_gap_s = 5,
                             .max_misses = 12,
                             .max_coast_s = 120,
                             .max_sigma_rad = 60 * AS,
                             .max_dormant_tracks = 16,
                             .max_dormant_s = max_dormant_s,
                             .max_dormant_sigma_rad = BST_DEG_RAD,
                             .dormant_gate_chi2 = 18.5};
    bst_mtt *mtt;
    bst_assert_ok(ctx, bst_mtt_create(ctx, &params, &mtt));
    return mtt;
}

static void run_night(night *g, uint64_t seed) {
    bst_ctx ctx = {0};
    bst_mtt *mtt = make_tracker(&ctx, BST_MTT_MIXTURE, g->max_dormant_s);
    bst_rng_key key = bst_rng_make_key(seed, 1, "test", "night");
    for (int k = 0; k < END; k++) {
        bool dark = k >= DARK_FROM && k < DARK_TO;
        if (dark && k % 30 > 5) {
            continue; /* six frames in a row of each half minute of the night */
        }
        bst_od_observer eye, side;
        bst_vec3 d, unused;
        double range, from, to;
        look(k, 0.0, &eye, &d, &range);
        look(k - 0.5, 0.0, &side, &unused, &from);
        look(k + 0.5, 0.0, &side, &unused, &to);
        bench b = {.range = {range, 0.02 * range, to - from, 50.0},
                   .sight = dark ? BST_MTT_DARK : BST_MTT_CLEAR};
        bst_mtt_detection seen[8];
        int count = 0;
        if (!dark) {
            seen[count++] = seen_at(d, key, (uint64_t)k);
        }
        for (int i = 0; dark && i < g->decoys; i++) {
            seen[count] = seen_at(d, key, (uint64_t)(10000 + 10 * k + i));
            bst_vec3 aside = bst_vec3_perpendicular(d);
            seen[count].sky.direction = bst_vec3_unit(
                bst_vec3_axpy(seen[count].sky.direction, 20 * AS * cos(2.0 * i + 1.7 * k), aside));
            count++;
        }
        if (g->neighbour_m != 0.0) {
            bst_od_observer same;
            bst_vec3 other;
            double far;
            look(k, g->neighbour_m, &same, &other, &far);
            seen[count++] = seen_at(other, key, (uint64_t)(100000 + k));
        }
        bst_mtt_frame f = {.tick = k,
                           .seconds = k,
                           .detections = seen,
                           .count = count,
                           .observer = &eye,
                           .range = range_of,
                           .sight = sight_of,
                           .user = &b};
        bst_mtt_step(mtt, &f);
        int n;
        const bst_mtt_event *events = bst_mtt_events(mtt, &n);
        for (int i = 0; i < n; i++) {
            g->lost += events[i].kind == BST_MTT_LOST && events[i].track.id == g->id;
        }
        const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
        for (int i = 0; i < n; i++) {
            const bst_mtt_track *t = &tracks[i];
            bool here =
                t->status != BST_TRACK_TENTATIVE && bst_vec3_angle(t->state.direction, d) < 30 * AS;
            if (k == DARK_FROM - 1 && here) {
                g->id = t->id;
            }
            if (t->id == g->id && t->asleep) {
                g->slept += dark;
                assert_int_equal(t->status, dark || k == DARK_TO ? BST_TRACK_COASTING : t->status);
                g->off_rad = bst_vec3_angle(t->state.direction, d);
            }
            g->confirmed += dark && t->status == BST_TRACK_CONFIRMED && t->id != g->id && here;
            if (k == END - 1 && here && !t->asleep) {
                g->id_after = t->id;
            }
        }
    }
    bst_mtt_free(mtt);
}

enum { DARK_FRAMES = (DARK_TO - DARK_FROM) / 30 * 6 };

static void it_wakes_as_itself(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        for (int decoys = 0; decoys <= 1; decoys++) {
            night g = {.max_dormant_s = 7200, .decoys = decoys};
            run_night(&g, seed);
            assert_true(g.id > 0);
            assert_int_equal(g.slept, DARK_FRAMES);
            assert_int_equal(g.lost, 0);
            assert_int_equal(g.id_after, g.id);
            /* five minutes seen, an hour not: a minute of arc is many sigma */
            assert_true(g.off_rad < 60 * AS);
        }
    }
}

static void a_neighbour_that_is_seen_all_night_does_not_become_it(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        night g = {.max_dormant_s = 7200, .neighbour_m = 40e3}; /* 200 arcsec */
        run_night(&g, seed);
        assert_int_equal(g.id_after, g.id);
        assert_int_equal(g.lost, 0);
    }
}

static void a_night_longer_than_the_memory_ends_the_track(void **state) {
    (void)state;
    night g = {.max_dormant_s = 1800};
    run_night(&g, 1);
    assert_int_equal(g.lost, 1);
    assert_true(g.slept < DARK_FRAMES / 2 + 6);
    assert_true(g.id_after > g.id); /* a new object */
}

/* A faint track without a detection becomes dormant in the first frame whose own time is more than
 * half of max_coast_s (120 s) after its last detection, at any frame period. */
static void a_faint_track_sleeps_after_half_its_coast(void **state) {
    (void)state;
    enum { LAST_SEEN = 300, PERIOD = 7, COAST_HALF = 60 };
    bst_ctx ctx = {0};
    bst_mtt *mtt = make_tracker(&ctx, BST_MTT_MIXTURE, 7200);
    bst_rng_key key = bst_rng_make_key(1, 1, "test", "faint");
    int asleep_from = 0;
    for (int k = 0; k < LAST_SEEN + 120; k += k < LAST_SEEN ? 1 : PERIOD) {
        bst_od_observer eye, side;
        bst_vec3 d, unused;
        double range, from, to;
        look(k, 0.0, &eye, &d, &range);
        look(k - 0.5, 0.0, &side, &unused, &from);
        look(k + 0.5, 0.0, &side, &unused, &to);
        bench b = {.range = {range, 0.02 * range, to - from, 50.0},
                   .sight = k > LAST_SEEN ? BST_MTT_FAINT : BST_MTT_CLEAR};
        bst_mtt_detection seen = seen_at(d, key, (uint64_t)k);
        bst_mtt_frame f = {.tick = k,
                           .seconds = k,
                           .detections = &seen,
                           .count = k <= LAST_SEEN,
                           .observer = &eye,
                           .range = range_of,
                           .sight = sight_of,
                           .user = &b};
        bst_mtt_step(mtt, &f);
        int n;
        const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
        for (int i = 0; i < n; i++) {
            asleep_from = asleep_from == 0 && tracks[i].asleep ? k : asleep_from;
        }
    }
    /* the ninth frame: 63 s after the last detection */
    assert_int_equal(asleep_from, LAST_SEEN + (COAST_HALF / PERIOD + 1) * PERIOD);
    bst_mtt_free(mtt);
}

static bst_mtt_sight behind(const void *user, const bst_mtt_track *track, bst_mtt_light *light) {
    (void)user;
    (void)track;
    *light = (bst_mtt_light){.sunlight = 1.0};
    return BST_MTT_EARTH;
}

static bool is_waited_for(const void *user, const bst_mtt_track *track) {
    (void)user;
    (void)track;
    return true;
}

/* The chance that an object is dark does not depend on how the time is divided into frames, and
 * comes to the share of dark time: 60 s of every 660 s. */
static void darkness_is_the_same_at_any_frame_period(void **state) {
    (void)state;
    const double steps_s[] = {1.0, 5.0, 120.0};
    for (size_t k = 0; k < sizeof steps_s / sizeof *steps_s; k++) {
        bst_mtt_track track = {.status = BST_TRACK_CONFIRMED};
        bool observable = true;
        bst_mtt m = {.tracks = &track, .track_count = 1, .observable = &observable};
        double middle = 0.0;
        for (; m.seconds < 1200.0; m.seconds += steps_s[k]) {
            const bst_mtt_frame frame = {.seconds = m.seconds + steps_s[k],
                                         .expected = is_waited_for};
            bst_mtt_look(&m, 0, &frame);
            middle = frame.seconds == 120.0 ? track.dark : middle;
        }
        /* rates of 1/600 and 1/60 per second, 120 s: (1 - exp(-2.2)) / 11 */
        bst_assert_close(middle, (1.0 - exp(-2.2)) / 11.0, 1e-12);
        bst_assert_close(track.dark, (1.0 - exp(-22.0)) / 11.0, 1e-12);
    }
}

/* Frames without a detection after which a track ends whose object is as faint as the threshold of
 * 5, and fades: a detection in every frame, one in eight for 40 s, then none. */
static int frames_after_fading(bool expected) {
    enum { FADES = 12, LAST_SEEN = FADES + 40, END_OF_RUN = LAST_SEEN + 150 };
    bst_ctx ctx = {0};
    bst_mtt *mtt = make_tracker(&ctx, BST_MTT_PMB, 0);
    bst_rng_key key = bst_rng_make_key(2, 1, "test", "faded");
    bst_vec3 d = bst_vec3_from_radec(1.0, 0.3);
    int tracks = 1, k = 0;
    for (; k < END_OF_RUN && (k < FADES || tracks > 0); k++) {
        bst_mtt_detection seen = seen_at(d, key, (uint64_t)k);
        d = bst_tangent_exp(d, (bst_vec3){-sin(1.0) * 50.0 * AS, cos(1.0) * 50.0 * AS, 0.0});
        seen.snr = 4.5;
        bool detected = k < FADES || (k <= LAST_SEEN && (k - FADES) % 8 == 0);
        bst_mtt_frame f = {.tick = k,
                           .seconds = k,
                           .detections = &seen,
                           .count = detected,
                           .threshold_snr = 5.0,
                           .expected = expected ? is_waited_for : NULL};
        bst_mtt_step(mtt, &f);
        (void)bst_mtt_tracks(mtt, &tracks);
    }
    bst_mtt_free(mtt);
    return k - 1 - LAST_SEEN;
}

/* A faint object that the cue expects is kept for max_coast_s, 120 s: misses are no news of it. Any
 * other one ends by max_misses, 12, or because it exists no more. */
static void a_faded_target_is_kept(void **state) {
    (void)state;
    assert_true(frames_after_fading(false) <= 13);
    assert_in_range(frames_after_fading(true), 115, 121);
}

/* A track that falls asleep keeps its correlations: all of its covariances grow by one factor, and
 * its state is that of its orbit. */
static void falling_asleep_keeps_correlations(void **state) {
    (void)state;
    bst_mtt_track track = {.status = BST_TRACK_CONFIRMED, .lit = true};
    track.orbit.valid = true;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            track.orbit.covariance[i][j] = 1.0 + i + 10.0 * j;
        }
        for (int j = 0; j < 4; j++) {
            track.orbit.cross[i][j] = 100.0 + i + 10.0 * j;
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            track.orbit.sky.covariance[i][j] = 200.0 + i + 10.0 * j;
            track.state.covariance[i][j] = 7.0;
        }
    }
    bool observable = true;
    bst_mtt m = {
        .params = {.orbits = true}, .tracks = &track, .track_count = 1, .observable = &observable};
    const bst_mtt_frame frame = {.sight = behind};
    const bst_mtt_track before = track;
    bst_mtt_look(&m, 0, &frame);
    assert_true(track.asleep && !track.may_miss && !observable);
    assert_int_equal(m.sleepers, 1);
    double factor = track.orbit.covariance[0][0] / before.orbit.covariance[0][0];
    assert_true(factor > 1.0);
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            bst_assert_close(track.orbit.covariance[i][j], factor * before.orbit.covariance[i][j],
                             1e-9);
        }
        for (int j = 0; j < 4; j++) {
            bst_assert_close(track.orbit.cross[i][j], factor * before.orbit.cross[i][j], 1e-9);
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            bst_assert_close(track.state.covariance[i][j],
                             factor * before.orbit.sky.covariance[i][j], 1e-9);
        }
    }
    bst_mtt_look(&m, 0, &frame); /* once */
    bst_assert_close(track.orbit.covariance[0][0], factor * before.orbit.covariance[0][0], 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shadow_by_angle),
        cmocka_unit_test(darkness_is_the_same_at_any_frame_period),
        cmocka_unit_test(a_faded_target_is_kept),
        cmocka_unit_test(falling_asleep_keeps_correlations),
        cmocka_unit_test(behind_the_earth),
        cmocka_unit_test(lit_from_behind),
        cmocka_unit_test(it_wakes_as_itself),
        cmocka_unit_test(a_neighbour_that_is_seen_all_night_does_not_become_it),
        cmocka_unit_test(a_faint_track_sleeps_after_half_its_coast),
        cmocka_unit_test(a_night_longer_than_the_memory_ends_the_track),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
