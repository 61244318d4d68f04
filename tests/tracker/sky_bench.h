/* Objects on the sky and a tracker that sees them, for tests. */
#ifndef BST_TESTS_SKY_BENCH_H
#define BST_TESTS_SKY_BENCH_H

#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/mtt/multitarget.h"

#define AS BST_ARCSEC_RAD
#define SIGMA (0.3 * AS)

typedef struct bench {
    bst_mtt *mtt;
    bst_mtt_params params;
    bst_mtt_detection list[1200];
    int count;
    bst_rng_key key;
    uint64_t draw;
} bench;

static bench work;

static inline bst_mtt_params defaults(void) {
    return (bst_mtt_params){.max_tracks = 1000,
                            .max_detections = 1200,
                            .noise_rad2ps3 = pow(0.02 * AS, 2),
                            .manoeuvre_noise_rad2ps3 = pow(3 * AS, 2),
                            .quiescent_sojourn_s = 3600,
                            .manoeuvre_sojourn_s = 60,
                            .gate_chi2 = 16,
                            .detection_probability = 0.9,
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
                            .merge_rad = 18 * AS,
                            .merge_floor_rad = 0.9 * AS,
                            .max_merged_frames = 30,
                            .feed_forward_rad = 0.09,
                            .brightness_systematic_mag = 0.0,
                            .brightness_random_walk_mag = 0.02,
                            .event_window = 8,
                            .max_dormant_tracks = 64,
                            .max_dormant_s = 7200,
                            .max_dormant_sigma_rad = 1.0 * BST_DEG_RAD,
                            .dormant_gate_chi2 = 18.5};
}

static inline bench *start(uint64_t seed, const bst_mtt_params *params) {
    bst_ctx ctx = {0};
    bench *b = &work;
    memset(b, 0, sizeof *b);
    b->params = *params;
    b->key = bst_rng_make_key(seed, 0, "test", "hard");
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, params, &b->mtt));
    return b;
}

static inline double uniform(bench *b) {
    return bst_rng_uniform(b->key, 0, b->draw++);
}

static inline void see(bench *b, bst_vec3 d, double v_mag) {
    double n[2], m = bst_rng_normal(b->key, 2, b->draw++);
    bst_rng_normal2(b->key, 1, b->draw++, n);
    bst_tangent axes = bst_tangent_at(d);
    b->list[b->count++] =
        (bst_mtt_detection){.sky = {.direction = bst_tangent_exp(
                                        d, bst_tangent_vector(&axes, SIGMA * n[0], SIGMA * n[1])),
                                    .cov_11 = SIGMA * SIGMA,
                                    .cov_22 = SIGMA * SIGMA},
                            .v_mag = v_mag + 0.1 * m,
                            .v_mag_sigma = 0.1,
                            .snr = 10,
                            .length_rad = 6 * AS};
}

static inline void frame(bench *b, double seconds) {
    bst_mtt_frame f = {.tick = (int64_t)llround(seconds * 6000),
                       .seconds = seconds,
                       .detections = b->list,
                       .count = b->count};
    bst_mtt_step(b->mtt, &f);
    b->count = 0;
}

/* The confirmed track within `reach` of a direction; NULL when none. */
static inline const bst_mtt_track *track_at(const bench *b, bst_vec3 d, double reach) {
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &n);
    for (int i = 0; i < n; i++) {
        if (tracks[i].status != BST_TRACK_TENTATIVE &&
            bst_vec3_angle(d, tracks[i].state.direction) < reach) {
            return &tracks[i];
        }
    }
    return NULL;
}

static inline int events_of(const bench *b, bst_mtt_event_kind kind) {
    int n, c = 0;
    const bst_mtt_event *events = bst_mtt_events(b->mtt, &n);
    for (int i = 0; i < n; i++) {
        c += events[i].kind == kind;
    }
    return c;
}

/* A great circle from d along heading. */
static inline bst_vec3 along(bst_vec3 d, double heading, double angle) {
    bst_tangent axes = bst_tangent_at(d);
    return bst_tangent_exp(d,
                           bst_tangent_vector(&axes, angle * cos(heading), angle * sin(heading)));
}

#endif
