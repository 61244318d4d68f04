/* Whole tracks against theory: NEES and NIS over Monte Carlo runs, errors over the posterior
 * Cramer-Rao bound, without and with clutter, for each filter and association.
 * Usage: test_tracker_consistency [slow]; slow: longer tracks in clutter, and twice the runs. */
#include "boresight/rng.h"
#include "sim/eval/consistency.h"
#include "sim/eval/track_bound.h"
#include "tests/test_support.h"
#include "tracker/mtt/multitarget.h"

#define AS BST_ARCSEC_RAD
#define HALF_AS 8.0 /* half width of the sky in which false alarms are drawn */
#define MAX_DETECTIONS 200

/* frames without clutter, in which the track starts; with clutter but not judged; judged */
enum { MOST_RUNS = 200, CLEAN = 14, SETTLE = 6, START = CLEAN + SETTLE, STEPS = 200, FEW = 60 };

static int clutter_steps = FEW;
static int runs = 100;

typedef struct setup {
    const char *name;
    bst_filter_kind filter;
    bst_mtt_association association;
    double pd;
    double alarms_per_gate;      /* in the gate of a settled filter */
    double dec_deg, rate_arcsec; /* where and how fast */
    bool manoeuvres;             /* as the IMM's own models have it */
    int steps;                   /* judged, at most STEPS */
    bool adaptive;               /* process noise with a steady level */
    double driven;               /* adaptive: share of the noise that drives the object */
    int learning;                /* of the judged frames, without NEES and NIS */
} setup;

typedef struct figures {
    bst_consistency nees, nis;
    double angle, rate; /* RMS error over the bound */
    double alarms;      /* in the gate, measured */
    int lost;
} figures;

static const double STEADY_SHARE = 0.1; /* of the default configuration */
static const double noise_as = 0.02, manoeuvre_as = 1.0, quiescent_sojourn_s = 60.0,
                    manoeuvre_sojourn_s = 10.0, sigma_as = 0.3, dt_s = 1.0, gate = 16.0;

static bst_mtt_params make_params(const setup *s, double alarms_per_frame) {
    double field_as2 = 4.0 * HALF_AS * HALF_AS;
    return (bst_mtt_params){
        .max_tracks = 100,
        .max_detections = MAX_DETECTIONS,
        .filter = s->filter,
        .association = s->association,
        .noise_rad2ps3 = pow(noise_as * AS, 2),
        .steady_noise_rad2ps3 = s->adaptive ? pow(STEADY_SHARE * noise_as * AS, 2) : 0.0,
        .manoeuvre_noise_rad2ps3 = pow(manoeuvre_as * AS, 2),
        .quiescent_sojourn_s = quiescent_sojourn_s,
        .manoeuvre_sojourn_s = manoeuvre_sojourn_s,
        .gate_chi2 = gate,
        .detection_probability = fmin(s->pd, 0.999),
        .false_alarms_per_frame = fmax(1e-3, alarms_per_frame),
        .field_sr = field_as2 * AS * AS,
        .confirm_hits = 12,
        .confirm_frames = 14,
        .confirm_score = 2,
        .max_rate_radps = (s->rate_arcsec + 1.0) * AS,
        .initiation_gap_s = 5,
        .max_misses = 12,
        .max_coast_s = 120,
        .max_sigma_rad = 60 * AS};
}

/* Square root of det S of a filter that has settled without clutter. */
static double settled_area(double pd) {
    bst_track_bound b;
    const double r[3] = {pow(sigma_as * AS, 2), 0.0, pow(sigma_as * AS, 2)};
    double p[4][4];
    assert_true(bst_track_bound_start(&b, r, r, dt_s, pow(noise_as * AS, 2)));
    for (int k = 0; k < 200; k++) {
        assert_true(bst_track_bound_step(&b, dt_s, 0.0, pow(noise_as * AS, 2), r, pd));
    }
    /* predicted: the information before the next measurement */
    assert_true(bst_track_bound_step(&b, dt_s, 0.0, pow(noise_as * AS, 2), r, 0.0));
    assert_true(bst_track_bound_covariance(&b, p));
    return (p[0][0] + r[0]) / (AS * AS);
}

/* White acceleration over dt on a true state, arcsec/s^1.5. */
static void random_walk(bst_sky_state *truth, double acceleration_as, bst_rng_key key, uint64_t run,
                        uint64_t k) {
    double q = pow(acceleration_as * AS, 2), n[4];
    bst_rng_normal2(key, run, 2 * k, n);
    bst_rng_normal2(key, run, 2 * k + 1, n + 2);
    bst_sky_predict(truth, dt_s, 0.0);
    bst_tangent axes = bst_tangent_at(truth->direction);
    double sp = sqrt(q * dt_s * dt_s * dt_s / 3.0), sr = sqrt(q * dt_s);
    /* correlation of place and rate: sqrt(3)/2 */
    double c = sqrt(0.75), d = 0.5;
    bst_sky_shift(
        truth, bst_tangent_vector(&axes, sp * n[0], sp * n[1]),
        bst_tangent_vector(&axes, sr * (c * n[0] + d * n[2]), sr * (c * n[1] + d * n[3])));
}

static bst_mtt_detection see(bst_vec3 centre, double a1, double a2) {
    bst_tangent axes = bst_tangent_at(centre);
    double r = pow(sigma_as * AS, 2);
    return (bst_mtt_detection){
        .sky = {.direction = bst_tangent_exp(centre, bst_tangent_vector(&axes, a1 * AS, a2 * AS)),
                .cov_11 = r,
                .cov_22 = r},
        .v_mag = 13.0,
        .v_mag_sigma = 0.1,
        .snr = 10};
}

static const bst_mtt_track *confirmed(const bst_mtt *mtt) {
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n), *oldest = NULL;
    for (int i = 0; i < n && !oldest; i++) {
        oldest = tracks[i].status != BST_TRACK_TENTATIVE ? &tracks[i] : NULL;
    }
    return oldest;
}

static void monte_carlo(const setup *s, figures *out) {
    static double nees[MOST_RUNS * STEPS], nis[MOST_RUNS * STEPS];
    static bst_mtt_detection list[MAX_DETECTIONS];
    memset(out, 0, sizeof *out);
    double per_as2 = s->alarms_per_gate / (BST_PI * gate * settled_area(s->pd));
    double mean = per_as2 * 4.0 * HALF_AS * HALF_AS;
    bst_mtt_params params = make_params(s, mean);
    double quiet_as = s->adaptive ? s->driven * noise_as : noise_as,
           bound_q = pow(quiet_as * AS, 2);
    const double r[3] = {pow(sigma_as * AS, 2), 0.0, pow(sigma_as * AS, 2)};
    double factor = bst_eval_information_factor(s->pd, per_as2 * sigma_as * sigma_as);
    double angle2 = 0.0, rate2 = 0.0, bound_angle2 = 0.0, bound_rate2 = 0.0;
    int in_gate = 0, gates = 0;
    for (uint64_t run = 0; run < (uint64_t)runs; run++) {
        bst_ctx ctx = {0};
        bst_mtt *mtt;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
        bst_rng_key key = bst_rng_make_key(17, run, "test", s->name);
        bst_sky_state truth = {
            .direction = bst_vec3_from_radec(359.99 * BST_DEG_RAD, s->dec_deg * BST_DEG_RAD)};
        bst_tangent axes = bst_tangent_at(truth.direction);
        truth.rate_radps = bst_tangent_vector(&axes, s->rate_arcsec * AS * cos((double)run),
                                              s->rate_arcsec * AS * sin((double)run));
        bst_track_bound bound;
        bool unconfirmed = false, gone = false, turning = false;
        for (int k = 0; k < START + s->steps; k++) {
            uint64_t u = 0;
            double n[2];
            if (s->manoeuvres) {
                double u0 = bst_rng_uniform(key, 4, (uint64_t)k),
                       both = 1 / quiescent_sojourn_s + 1 / manoeuvre_sojourn_s;
                double mixed = -expm1(-both * dt_s) / both;
                turning =
                    turning ? u0 > mixed / manoeuvre_sojourn_s : u0 < mixed / quiescent_sojourn_s;
            }
            random_walk(&truth, turning ? manoeuvre_as : quiet_as, key, 1, (uint64_t)k);
            bst_rng_normal2(key, 2, (uint64_t)k, n);
            bool seen = k < CLEAN || bst_rng_uniform(key, 3, (uint64_t)k) < s->pd;
            bst_mtt_detection own = see(truth.direction, sigma_as * n[0], sigma_as * n[1]);
            int count = 0;
            if (seen) {
                list[count++] = own;
            }
            for (double t = -log(bst_rng_uniform(key, 100 + (uint64_t)k, u++));
                 k >= CLEAN && t < mean && count < MAX_DETECTIONS;
                 t -= log(bst_rng_uniform(key, 100 + (uint64_t)k, u++))) {
                double x = HALF_AS * (2 * bst_rng_uniform(key, 100 + (uint64_t)k, u++) - 1);
                double y = HALF_AS * (2 * bst_rng_uniform(key, 100 + (uint64_t)k, u++) - 1);
                list[count++] = see(truth.direction, x, y);
            }
            const bst_mtt_track *track = confirmed(mtt);
            int at = (int)run * s->steps + k - START;
            if (k >= START) {
                nis[at] = nees[at] = NAN;
            }
            if (k >= START + s->learning && track) {
                bst_filter_params filter = {
                    .kind = params.filter,
                    .noise_rad2ps3 = params.noise_rad2ps3,
                    .steady_noise_rad2ps3 = params.steady_noise_rad2ps3,
                    .manoeuvre_noise_rad2ps3 = params.manoeuvre_noise_rad2ps3,
                    .quiescent_sojourn_s = params.quiescent_sojourn_s,
                    .manoeuvre_sojourn_s = params.manoeuvre_sojourn_s};
                bst_sky_state state = track->state;
                bst_filter_models models = track->models;
                bst_sky_innovation v;
                bst_filter_predict(&filter, dt_s, &state, &models);
                for (int i = 0; i < count; i++) {
                    assert_true(bst_sky_innovate(&state, &list[i].sky, NULL, &v));
                    if (i == 0 && seen) {
                        nis[at] = v.chi2;
                    } else {
                        in_gate += v.chi2 <= gate;
                    }
                }
                gates++;
            }
            bst_mtt_frame f = {.tick = k, .seconds = k * dt_s, .detections = list, .count = count};
            bst_mtt_step(mtt, &f);
            track = confirmed(mtt);
            if (k == 1) {
                assert_true(bst_track_bound_start(&bound, r, r, dt_s, bound_q));
            } else if (k > 1) {
                assert_true(bst_track_bound_step(&bound, dt_s, s->rate_arcsec * AS, bound_q, r,
                                                 k < CLEAN ? 1.0 : factor));
            }
            if (k == START && !track) {
                unconfirmed = true;
            }
            if (k < START || !track) {
                gone = gone || (k >= START && !unconfirmed);
                continue;
            }
            bst_sky_state exact = truth;
            memset(exact.covariance, 0, sizeof exact.covariance);
            if (k >= START + s->learning) {
                nees[at] = bst_sky_distance2(&track->state, &exact);
            }
            bst_vec3 off = bst_tangent_log(truth.direction, track->state.direction);
            bst_vec3 rate = bst_vec3_sub(
                bst_tangent_carry(track->state.direction, truth.direction, track->state.rate_radps),
                truth.rate_radps);
            gone = gone || bst_vec3_norm(off) > 10.0 * sigma_as * AS;
            if (gone) {
                continue;
            }
            double p[4][4];
            assert_true(bst_track_bound_covariance(&bound, p));
            angle2 += bst_vec3_dot(off, off);
            rate2 += bst_vec3_dot(rate, rate);
            bound_angle2 += p[0][0] + p[1][1];
            bound_rate2 += p[2][2] + p[3][3];
        }
        out->lost += gone;
        bst_mtt_free(mtt);
    }
    bst_consistency_check(nees, runs, s->steps, 4, 0.95, &out->nees);
    bst_consistency_check(nis, runs, s->steps, 2, 0.95, &out->nis);
    out->angle = sqrt(angle2 / bound_angle2);
    out->rate = sqrt(rate2 / bound_rate2);
    out->alarms = (double)in_gate / gates;
    print_message(
        "%s, Pd %.2f, %.2f alarms per gate: NEES/4 %.3f (inside %.2f), NIS/2 %.3f (inside "
        "%.2f), angle and rate over bound %.3f %.3f, lost %d of %d\n",
        s->name, s->pd, out->alarms, out->nees.mean_over_dof, out->nees.inside,
        out->nis.mean_over_dof, out->nis.inside, out->angle, out->rate, out->lost, runs);
}

/* measures.md of the project: means within 10 %, at least 90 % of the steps within the 95 % bounds
 */
static void check_consistent(const figures *f) {
    bst_assert_close(f->nees.mean_over_dof, 1.0, 0.1);
    bst_assert_close(f->nis.mean_over_dof, 1.0, 0.1);
    assert_true(f->nees.inside >= 0.9);
    assert_true(f->nis.inside >= 0.9);
}

static void check_efficient(const figures *f) {
    assert_true(f->angle <= 1.15);
    assert_true(f->rate <= 1.15);
    /* nothing beats the bound: 1 sigma of the ratio is about 0.01 */
    assert_true(f->angle >= 0.95);
    assert_true(f->rate >= 0.95);
}

static void filters_without_clutter(void **state) {
    (void)state;
    const setup cases[] = {
        {"ekf", BST_FILTER_EKF, BST_MTT_GNN, 0.9, 0.0, 20, 50, false, STEPS, false, 0.0, 0},
        {"ukf", BST_FILTER_UKF, BST_MTT_GNN, 0.9, 0.0, 89.999, 50, false, STEPS, false, 0.0, 0},
        {"fast", BST_FILTER_EKF, BST_MTT_NEAREST, 1.0, 0.0, 60, 18000, false, STEPS, false, 0.0,
         0}};
    for (int i = 0; i < 3; i++) {
        figures f;
        monte_carlo(&cases[i], &f);
        assert_int_equal(f.lost, 0);
        check_consistent(&f);
        check_efficient(&f);
    }
}

/* An object that manoeuvres as the models have it: the mixture of two Gaussians is consistent on
 * average though no Gaussian itself. */
static void imm_through_manoeuvres(void **state) {
    (void)state;
    const setup imm = {"imm", BST_FILTER_IMM, BST_MTT_GNN, 0.95,  0.0, 20,
                       50,    true,           FEW,         false, 0.0, 0};
    const setup ekf = {"ekf", BST_FILTER_EKF, BST_MTT_GNN, 0.95,  0.0, 20,
                       50,    true,           FEW,         false, 0.0, 0};
    figures with, without;
    int asked = runs;
    runs = MOST_RUNS; /* for the share of tracks that are lost, and they are short */
    monte_carlo(&imm, &with);
    monte_carlo(&ekf, &without);
    runs = asked;
    /* a jump out of the gate of both models: chi-square 16 has a tail of 3e-4 */
    assert_true(with.lost <= MOST_RUNS / 10);
    bst_assert_close(with.nees.mean_over_dof, 1.0, 0.2);
    bst_assert_close(with.nis.mean_over_dof, 1.0, 0.2);
    /* one quiet model alone loses the object */
    assert_true(without.lost > MOST_RUNS / 4);
}

static void single_target_in_clutter(void **state) {
    (void)state;
    const setup cases[] = {
        {"mixture", BST_FILTER_EKF, BST_MTT_MIXTURE, 0.9, 0.5, 20, 50, false, clutter_steps, false,
         0.0, 0},
        {"pmb", BST_FILTER_EKF, BST_MTT_PMB, 0.9, 0.5, 20, 50, false, clutter_steps, false, 0.0, 0},
        {"mixture ukf", BST_FILTER_UKF, BST_MTT_MIXTURE, 0.95, 0.5, -89.999, 50, false,
         clutter_steps, false, 0.0, 0}};
    for (int i = 0; i < 3; i++) {
        figures f;
        monte_carlo(&cases[i], &f);
        assert_true(f.alarms >= 0.5);
        assert_int_equal(f.lost, 0);
        check_consistent(&f);
        check_efficient(&f);
    }
}

/* What the others do there: one choice per frame is overconfident; weighing all of them in one
 * Gaussian is right until a track in a hundred is led away. */
static void other_associations_in_clutter(void **state) {
    (void)state;
    const setup gnn = {"gnn", BST_FILTER_EKF, BST_MTT_GNN, 0.9,   0.5, 20,
                       50,    false,          FEW,         false, 0.0, 0};
    const setup pda = {"pda", BST_FILTER_EKF, BST_MTT_PDA, 0.9,   0.5, 20,
                       50,    false,          FEW,         false, 0.0, 0};
    figures f;
    monte_carlo(&gnn, &f);
    assert_true(f.nees.mean_over_dof > 1.5);
    monte_carlo(&pda, &f);
    assert_true(f.lost <= runs / 40);
}

/* Objects with the configured process noise, with less, and on straight paths: tracks learn which
 * within tens of frames. Until a level is certain, the others widen the covariance. */
static void adaptive_noise(void **state) {
    (void)state;
    const setup cases[] = {{.name = "driven", .driven = 1.0},
                           {.name = "less driven", .driven = 0.3},
                           {.name = "steady", .driven = STEADY_SHARE},
                           {.name = "straight", .driven = 0.0}};
    for (int i = 0; i < 4; i++) {
        setup s = {.association = BST_MTT_PMB,
                   .pd = 0.9,
                   .dec_deg = 20,
                   .rate_arcsec = 50,
                   .steps = STEPS,
                   .adaptive = true,
                   .learning = 60};
        s.name = cases[i].name;
        s.driven = cases[i].driven;
        figures f;
        monte_carlo(&s, &f);
        assert_int_equal(f.lost, 0);
        bst_assert_close(f.nis.mean_over_dof, 1.0, 0.1);
        assert_true(f.nis.inside >= 0.9);
        assert_true(f.nees.mean_over_dof <= 1.1);
        if (s.driven == 1.0) {
            bst_assert_close(f.nees.mean_over_dof, 1.0, 0.1);
            /* lower levels keep a few per cent, which the narrower bounds of twice the runs show */
            assert_true(f.nees.inside >= (runs > 100 ? 0.85 : 0.9));
        }
        /* the bound knows the noise; without adaptation steady objects have 2.1 and 4 times it */
        assert_true(s.driven == 0.0 || f.angle <= 1.1);
        assert_true(s.driven == 0.0 || f.rate <= 1.15);
    }
}

/* Largest error from a thrust's start to its end, arcsec, after the track has learnt that its
 * object is steady. The track must be kept. */
static double through_thrust(bool adaptive, double acceleration_as, uint64_t run) {
    const setup s = {.pd = 0.99, .association = BST_MTT_PMB, .adaptive = adaptive};
    bst_mtt_params params = make_params(&s, 0.0);
    params.event_window = 8;
    params.false_events_per_hour = 0.01;
    params.quiescent_sojourn_s = 3600;
    params.manoeuvre_sojourn_s = 60;
    params.manoeuvre_noise_rad2ps3 = pow(3 * AS, 2);
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
    bst_rng_key key = bst_rng_make_key(18, run, "test", "thrust");
    bst_sky_state truth = {.direction = bst_vec3_from_radec(1.0, 0.3)};
    double worst = 0.0;
    int64_t id = -1;
    for (int k = 0; k < 400; k++) {
        double n[2];
        bst_sky_predict(&truth, dt_s, 0.0);
        if (k >= 150 && k < 350) {
            bst_tangent axes = bst_tangent_at(truth.direction);
            bst_vec3 a = bst_tangent_vector(&axes, acceleration_as * AS, 0.0);
            bst_sky_shift(&truth, bst_vec3_scale(a, 0.5), a);
        }
        bst_rng_normal2(key, 2, (uint64_t)k, n);
        bst_mtt_detection seen = see(truth.direction, sigma_as * n[0], sigma_as * n[1]);
        bst_mtt_frame f = {.tick = k, .seconds = k * dt_s, .detections = &seen, .count = 1};
        bst_mtt_step(mtt, &f);
        const bst_mtt_track *track = confirmed(mtt);
        if (k >= 100) {
            assert_non_null(track);
            id = k == 100 ? track->id : id;
            assert_int_equal(track->id, id);
        }
        if (k >= 150) {
            bst_vec3 off = bst_tangent_log(truth.direction, track->state.direction);
            worst = fmax(worst, bst_vec3_norm(off) / AS);
        }
    }
    bst_mtt_free(mtt);
    return worst;
}

/* A steady object's thrust, 0.1 to 30 m/s^2 for 200 s at 40,000 km: 0.0005 to 0.15 arcsec/s^2, is
 * followed as well as without adaptation. */
static void adaptive_noise_through_thrust(void **state) {
    (void)state;
    const double accelerations_as[] = {0.0005, 0.005, 0.02, 0.05, 0.15};
    for (int i = 0; i < 5; i++) {
        double fixed = 0.0, adaptive = 0.0;
        for (uint64_t run = 0; run < 10; run++) {
            fixed += through_thrust(false, accelerations_as[i], run) / 10;
            adaptive += through_thrust(true, accelerations_as[i], run) / 10;
        }
        print_message("thrust of %.4f arcsec/s^2: largest error %.2f and, adaptive, %.2f arcsec\n",
                      accelerations_as[i], fixed, adaptive);
        assert_true(adaptive <= 1.2 * fixed);
    }
}

int main(int argc, char **argv) {
    bool slow = argc > 1 && strcmp(argv[1], "slow") == 0;
    clutter_steps = slow ? STEPS : FEW;
    runs = slow ? MOST_RUNS : runs;
    const struct CMUnitTest tests[] = {cmocka_unit_test(adaptive_noise),
                                       cmocka_unit_test(adaptive_noise_through_thrust),
                                       cmocka_unit_test(filters_without_clutter),
                                       cmocka_unit_test(imm_through_manoeuvres),
                                       cmocka_unit_test(single_target_in_clutter),
                                       cmocka_unit_test(other_associations_in_clutter)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
