/* The smoother against theory: exact least squares on one track, errors and NEES over Monte Carlo
 * runs, gaps, and the end of a track.
 * Usage: test_tracker_smoother [slow]; slow: more runs, and a table of the figures. */
#include "boresight/rng.h"
#include "sim/eval/consistency.h"
#include "tests/test_support.h"
#include "tracker/mtt/smoother.h"

#define AS BST_ARCSEC_RAD

enum { MOST_RUNS = 400, START = 20, STEPS = 60, LAG = 15 };

static int runs = 60;
static const double noise_as = 0.02, manoeuvre_as = 1.0, sigma_as = 0.3, dt_s = 1.0,
                    quiescent_s = 60.0, manoeuvre_s = 10.0;

typedef struct setup {
    const char *name;
    bst_filter_kind filter;
    bst_mtt_association association;
    double pd, dec_deg;
    int gap;         /* frames without a detection, from START + 20 on */
    bool manoeuvres; /* begin and end as the models of the IMM expect it */
} setup;

typedef struct figures {
    double rms, filtered_rms, rate_rms, filtered_rate_rms; /* arcsec, arcsec/s */
    bst_consistency nees, filtered_nees;
    int judged;
} figures;

static bst_mtt *make_mtt(bst_ctx *ctx, const setup *s) {
    const bst_mtt_params params = {.max_tracks = 10,
                                   .max_detections = 20,
                                   .filter = s->filter,
                                   .association = s->association,
                                   .noise_rad2ps3 = pow(noise_as * AS, 2),
                                   .manoeuvre_noise_rad2ps3 = pow(manoeuvre_as * AS, 2),
                                   .quiescent_sojourn_s = quiescent_s,
                                   .manoeuvre_sojourn_s = manoeuvre_s,
                                   .gate_chi2 = 16,
                                   .detection_probability = fmin(s->pd, 0.999),
                                   .false_alarms_per_frame = 1e-3,
                                   .field_sr = pow(100.0 * AS, 2),
                                   .confirm_hits = 4,
                                   .confirm_frames = 6,
                                   .confirm_score = 2,
                                   .max_rate_radps = 60.0 * AS,
                                   .initiation_gap_s = 5,
                                   .max_misses = 25,
                                   .max_coast_s = 120,
                                   .max_sigma_rad = 60 * AS,
                                   .keep_priors = true};
    bst_mtt *mtt;
    bst_assert_ok(ctx, bst_mtt_create(ctx, &params, &mtt));
    return mtt;
}

/* White acceleration over dt on a true state. */
static void random_walk(bst_sky_state *truth, double noise, bst_rng_key key, uint64_t k) {
    double q = pow(noise * AS, 2), n[4];
    bst_rng_normal2(key, 1, 2 * k, n);
    bst_rng_normal2(key, 1, 2 * k + 1, n + 2);
    bst_sky_predict(truth, dt_s, 0.0);
    bst_tangent axes = bst_tangent_at(truth->direction);
    double sp = sqrt(q * dt_s * dt_s * dt_s / 3.0), sr = sqrt(q * dt_s);
    double c = sqrt(0.75), d = 0.5; /* correlation of direction and rate: sqrt(3)/2 */
    bst_sky_shift(
        truth, bst_tangent_vector(&axes, sp * n[0], sp * n[1]),
        bst_tangent_vector(&axes, sr * (c * n[0] + d * n[2]), sr * (c * n[1] + d * n[3])));
}

/* True if the object manoeuvres in a frame: a two-state Markov chain in continuous time. */
static bool is_accelerated(const setup *s, bst_rng_key key, int k, bool before) {
    double u = bst_rng_uniform(key, 4, (uint64_t)k);
    double both = 1.0 / quiescent_s + 1.0 / manoeuvre_s, mixed = -expm1(-both * dt_s) / both;
    return s->manoeuvres && (before ? u > mixed / manoeuvre_s : u < mixed / quiescent_s);
}

static bool is_seen(const setup *s, bst_rng_key key, int k) {
    bool gap = k >= START + 20 && k < START + 20 + s->gap;
    return !gap && (k < START || bst_rng_uniform(key, 3, (uint64_t)k) < s->pd);
}

/* Adds the squares of a state's errors. */
static void add_error(const bst_sky_state *state, const bst_sky_state *truth, double *place2,
                      double *rate2) {
    double x[4];
    bst_sky_difference(truth, state, x);
    *place2 += (x[0] * x[0] + x[1] * x[1]) / (AS * AS);
    *rate2 += (x[2] * x[2] + x[3] * x[3]) / (AS * AS);
}

static void monte_carlo(const setup *s, figures *out) {
    static double nees[MOST_RUNS * STEPS], filtered_nees[MOST_RUNS * STEPS];
    static bst_sky_state truth[START + STEPS + LAG], filtered[START + STEPS + LAG];
    double sum[4] = {0};
    memset(out, 0, sizeof *out);
    for (int i = 0; i < runs * STEPS; i++) {
        nees[i] = filtered_nees[i] = NAN;
    }
    for (int run = 0; run < runs; run++) {
        bst_ctx ctx = {0};
        bst_mtt *mtt = make_mtt(&ctx, s);
        bst_smoother *smoother;
        bst_assert_ok(&ctx, bst_smoother_create(&ctx, 10, LAG, &smoother));
        bst_rng_key key = bst_rng_make_key(29, (uint64_t)run, "test", s->name);
        bst_sky_state now = {
            .direction = bst_vec3_from_radec(359.99 * BST_DEG_RAD, s->dec_deg * BST_DEG_RAD)};
        bst_tangent axes = bst_tangent_at(now.direction);
        now.rate_radps = bst_tangent_vector(&axes, 50.0 * AS * cos(run), 50.0 * AS * sin(run));
        bool turning = false;
        for (int k = 0; k < START + STEPS + LAG; k++) {
            turning = is_accelerated(s, key, k, turning);
            random_walk(&now, turning ? manoeuvre_as : noise_as, key, (uint64_t)k);
            truth[k] = now;
            memset(truth[k].covariance, 0, sizeof truth[k].covariance);
            double n[2];
            bst_rng_normal2(key, 2, (uint64_t)k, n);
            bst_tangent at = bst_tangent_at(now.direction);
            bst_vec3 off = bst_tangent_vector(&at, sigma_as * AS * n[0],
                                              sigma_as * AS * (0.8 * n[0] + 0.6 * n[1]));
            const bst_mtt_detection seen = {
                .sky = {.direction = bst_tangent_exp(now.direction, off),
                        .cov_11 = pow(sigma_as * AS, 2),
                        .cov_12 = 0.8 * pow(sigma_as * AS, 2),
                        .cov_22 = pow(sigma_as * AS, 2)},
                .v_mag = 13.0,
                .v_mag_sigma = 0.1,
                .snr = 10};
            const bst_mtt_frame frame = {
                .tick = k, .seconds = k * dt_s, .detections = &seen, .count = is_seen(s, key, k)};
            bst_mtt_step(mtt, &frame);
            bst_smoother_step(smoother, &(bst_smoother_frame){k, k, k * dt_s, 1}, mtt);
            const bst_mtt_track *track = bst_mtt_find(mtt, 1);
            filtered[k] = track ? track->state : truth[k];
            bst_smoother_frame then;
            const bst_smoothed *states;
            int count, lost;
            if (!bst_smoother_get(smoother, &then, &states, &count, &lost) ||
                then.exposure_id < START || count == 0 || states[0].id != 1 || !track) {
                continue;
            }
            int at_frame = (int)then.exposure_id;
            assert_int_equal(at_frame, k - LAG);
            assert_int_equal(states[0].later_frames, LAG);
            int at_step = run * STEPS + at_frame - START;
            nees[at_step] = bst_sky_distance2(&states[0].state, &truth[at_frame]);
            filtered_nees[at_step] = bst_sky_distance2(&filtered[at_frame], &truth[at_frame]);
            add_error(&states[0].state, &truth[at_frame], &sum[0], &sum[2]);
            add_error(&filtered[at_frame], &truth[at_frame], &sum[1], &sum[3]);
            out->judged++;
        }
        bst_smoother_free(smoother);
        bst_mtt_free(mtt);
    }
    bst_consistency_check(nees, runs, STEPS, 4, 0.95, &out->nees);
    bst_consistency_check(filtered_nees, runs, STEPS, 4, 0.95, &out->filtered_nees);
    out->rms = sqrt(sum[0] / out->judged);
    out->filtered_rms = sqrt(sum[1] / out->judged);
    out->rate_rms = sqrt(sum[2] / out->judged);
    out->filtered_rate_rms = sqrt(sum[3] / out->judged);
    print_message(
        "%s: %d states, RMS %.4f of %.4f arcsec, rate %.4f of %.4f arcsec/s, NEES/4 "
        "%.3f (filtered %.3f)\n",
        s->name, out->judged, out->rms, out->filtered_rms, out->rate_rms, out->filtered_rate_rms,
        out->nees.mean_over_dof, out->filtered_nees.mean_over_dof);
}

/* The smoothed states are better than the filtered ones, and their covariances are right. */
static void more_accurate_and_consistent(void **state) {
    (void)state;
    static const struct {
        setup of;
        double gain;      /* least improvement of the RMS */
        double tolerance; /* of the mean NEES */
    } cases[] = {
        {{"ekf", BST_FILTER_EKF, BST_MTT_PMB, 0.9, 20, 0, false}, 0.6, 0.1},
        {{"ukf", BST_FILTER_UKF, BST_MTT_PMB, 0.9, 89.99, 0, false}, 0.6, 0.1},
        {{"gnn", BST_FILTER_EKF, BST_MTT_GNN, 0.9, -60, 0, false}, 0.6, 0.1},
        {{"gap", BST_FILTER_EKF, BST_MTT_GNN, 0.95, 20, 12, false}, 0.6, 0.1},
        {{"imm", BST_FILTER_IMM, BST_MTT_PMB, 0.95, 20, 0, true}, 0.8, 0.2},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        figures f;
        monte_carlo(&cases[i].of, &f);
        assert_true(f.judged > 0.9 * runs * STEPS);
        assert_true(f.rms < cases[i].gain * f.filtered_rms);
        assert_true(f.rate_rms < f.filtered_rate_rms);
        /* neighbouring states share most of their errors, so that a run counts as about six: 1
         * sigma of the mean is sqrt(2 / (4 * 6 * runs)), 0.037 and slow 0.014 */
        bst_assert_close(f.nees.mean_over_dof, 1.0, cases[i].tolerance);
    }
}

/* Shows the multi-target tracker and the smoother one frame. */
static void show(bst_mtt *mtt, bst_smoother *smoother, int k, const bst_mtt_detection *found,
                 int count) {
    const bst_mtt_frame frame = {
        .tick = k, .seconds = k * dt_s, .detections = found, .count = count};
    bst_mtt_step(mtt, &frame);
    bst_smoother_step(smoother, &(bst_smoother_frame){100 + k, k, k * dt_s, 2}, mtt);
}

static bst_mtt_detection at(bst_vec3 centre, double east_as) {
    bst_tangent axes = bst_tangent_at(centre);
    return (bst_mtt_detection){
        .sky = {bst_tangent_exp(centre, bst_tangent_vector(&axes, east_as * AS, 0.0)),
                pow(sigma_as * AS, 2), 0.0, pow(sigma_as * AS, 2)},
        .v_mag = 13.0,
        .v_mag_sigma = 0.1,
        .snr = 10};
}

/* Two objects, of which the first vanishes for good: every frame of a track that has been
 * confirmed comes once, the last ones with fewer and fewer later frames; the target is first. */
static void every_frame_once(void **state) {
    (void)state;
    enum { LAST = 30, FRAMES = 80, SHORT = 5 };
    const setup of = {.filter = BST_FILTER_EKF, .association = BST_MTT_GNN, .pd = 0.9};
    bst_ctx ctx = {0};
    bst_mtt *mtt = make_mtt(&ctx, &of);
    bst_smoother *smoother;
    bst_assert_ok(&ctx, bst_smoother_create(&ctx, 2, SHORT, &smoother));
    const bst_vec3 centre = bst_vec3_from_radec(1.0, 0.5);
    int shown[2] = {0}, last_of_first = -1, last_later = -1, end_of_first = 0;
    for (int k = 0; k < FRAMES; k++) {
        const bst_mtt_detection both[] = {at(centre, 2.0 * k), at(centre, 300.0 - 1.0 * k)};
        show(mtt, smoother, k, k < LAST ? both : both + 1, k < LAST ? 2 : 1);
        end_of_first = bst_mtt_find(mtt, 1) ? k : end_of_first;
        bst_smoother_frame then;
        const bst_smoothed *states;
        int count, lost;
        assert_true(bst_smoother_get(smoother, &then, &states, &count, &lost) == (k >= SHORT));
        assert_int_equal(lost, 0);
        assert_true(k < SHORT || (then.exposure_id == 100 + k - SHORT && then.tick == k - SHORT));
        for (int i = 0; k >= SHORT && i < count; i++) {
            shown[states[i].id - 1]++;
            assert_true(count == 1 || states[i].id == 2 - i);
            if (states[i].id == 1) {
                last_of_first = k - SHORT;
                last_later = states[i].later_frames;
            } else {
                assert_int_equal(states[i].later_frames, SHORT);
            }
        }
    }
    /* a track begins with its second detection */
    assert_int_equal(shown[1], FRAMES - SHORT - 1);
    assert_int_equal(shown[0], end_of_first);
    assert_int_equal(last_of_first, end_of_first);
    assert_int_equal(last_later, 0);
    /* the room of two chains is taken, so that a third track has none */
    bst_smoother_free(smoother);
    bst_assert_ok(&ctx, bst_smoother_create(&ctx, 1, SHORT, &smoother));
    const bst_mtt_detection again[] = {at(centre, 300.0 - FRAMES), at(centre, 900.0)};
    const bst_mtt_detection then_again[] = {at(centre, 299.0 - FRAMES), at(centre, 901.0)};
    show(mtt, smoother, FRAMES, again, 2);
    show(mtt, smoother, FRAMES + 1, then_again, 2);
    bst_smoother_frame frame;
    const bst_smoothed *states;
    int count, lost;
    assert_false(bst_smoother_get(smoother, &frame, &states, &count, &lost));
    assert_int_equal(lost, 1);
    bst_smoother_free(smoother);
    bst_mtt_free(mtt);
}

int main(int argc, char **argv) {
    runs = argc > 1 && strcmp(argv[1], "slow") == 0 ? MOST_RUNS : runs;
    const struct CMUnitTest tests[] = {cmocka_unit_test(more_accurate_and_consistent),
                                       cmocka_unit_test(every_frame_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
