/* Which observations an orbit is fitted to, one part after the other, and which of several initial
 * orbits is taken. Fits and initial orbits are made here. */
#include "boresight/vec.h"
#include "tests/test_support.h"
#include "tracker/orbit/orbit_initial.h"

enum { MOST = 400, CALLS = 40 };

typedef struct call {
    int count;
    double first_s, last_s, sum_s;
    bool own_options, residuals;
} call;

static struct {
    call calls[CALLS];
    int count, candidates, started;
    double chi2[8], dof[8], first_chi2[8], range_m[8], speed_mps[8];
    int rejected[8];
} fake;

bst_status __wrap_bst_od_initial(bst_ctx *ctx, const bst_od_observation *observations, int count,
                                 bst_od_candidate candidates[BST_OD_CANDIDATES], int *found);
bst_status __wrap_bst_od_initial(bst_ctx *ctx, const bst_od_observation *observations, int count,
                                 bst_od_candidate candidates[BST_OD_CANDIDATES], int *found) {
    (void)ctx;
    (void)observations;
    (void)count;
    for (int i = 0; i < fake.candidates; i++) {
        /* x carries the number of the candidate through the fits */
        candidates[i] = (bst_od_candidate){.state = {.time_s = i,
                                                     .position_m = {7e6, 0, 0},
                                                     .velocity_mps = {0, fake.speed_mps[i], 0}},
                                           .method = (bst_od_method)(i % 3)};
    }
    *found = fake.candidates;
    fake.started = 0;
    return BST_OK;
}

bst_status __wrap_bst_od_fit(bst_ctx *ctx, const bst_od_observation *observations, int count,
                             const bst_od_options *options, const bst_od_state *first,
                             double *residual_chi2, bst_od_solution *out);
bst_status __wrap_bst_od_fit(bst_ctx *ctx, const bst_od_observation *observations, int count,
                             const bst_od_options *options, const bst_od_state *first,
                             double *residual_chi2, bst_od_solution *out) {
    (void)ctx;
    call *c = &fake.calls[fake.count++];
    assert_true(fake.count < CALLS);
    *c = (call){.count = count,
                .first_s = observations[0].observer.time_s,
                .last_s = observations[count - 1].observer.time_s,
                .own_options = options->reject_chi2 > 0.0,
                .residuals = residual_chi2 != NULL};
    for (int i = 0; i < count; i++) {
        c->sum_s += observations[i].observer.time_s;
    }
    int k = (int)first->time_s;
    bool start = fake.started++ < fake.candidates;
    *out = (bst_od_solution){.state = *first,
                             .chi2 = start ? fake.first_chi2[k] : fake.chi2[k],
                             .dof = (int)fake.dof[k],
                             .rejected = start ? 0 : fake.rejected[k],
                             .range_m = fake.range_m[k]};
    return BST_OK;
}

static void expect_call(int n, int count, double first_s, double last_s) {
    const call *c = &fake.calls[n];
    assert_int_equal(c->count, count);
    bst_assert_close(c->first_s, first_s, 0.0);
    bst_assert_close(c->last_s, last_s, 0.0);
}

static int add(bst_od_observation *o, int n, double from_s, double step_s, int count) {
    for (int i = 0; i < count; i++) {
        o[n++] = (bst_od_observation){.observer = {.time_s = from_s + step_s * i}};
    }
    return n;
}

static void one_candidate(void) {
    memset(&fake, 0, sizeof fake);
    fake.candidates = 1;
    fake.chi2[0] = fake.dof[0] = fake.first_chi2[0] = 100;
    fake.range_m[0] = 1e6;
    fake.speed_mps[0] = 7500;
}

/* The densest half hour first, 40 of it evenly, then arcs of twice the length about its middle as
 * long as they hold more, then all. */
static void growing_arcs(void **state) {
    (void)state;
    static bst_od_observation o[MOST];
    bst_ctx ctx = {0};
    bst_od_solution out;
    bst_od_report report;
    const bst_od_options options = {.reject_chi2 = 30.0};
    double residuals[MOST];
    int n = add(o, 0, 0.0, 60.0, 11); /* to 600 s */
    n = add(o, n, 5000.0, 20.0, 46);  /* to 5900 s */
    n = add(o, n, 9000.0, 30.0, 21);  /* to 9600 s */
    n = add(o, n, 30000.0, 50.0, 21); /* to 31000 s */
    one_candidate();
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, residuals, &out, &report));
    /* about 5450 s: 1800, 3600, 7200, 14400, 28800 and 57600 s long */
    assert_int_equal(fake.count, 5);
    expect_call(0, 40, 5000.0, 5900.0);
    double sum = 0.0;
    for (int i = 0; i < 40; i++) {
        sum += 5000.0 + 20.0 * (i * 45 / 39);
    }
    bst_assert_close(fake.calls[0].sum_s, sum, 1e-6);
    expect_call(1, 48, 5000.0, 9030.0);
    expect_call(2, 78, 0.0, 9600.0);
    expect_call(3, 99, 0.0, 31000.0);
    expect_call(4, 99, 0.0, 31000.0);
    assert_false(fake.calls[0].own_options);
    assert_true(fake.calls[1].own_options && fake.calls[3].own_options);
    assert_true(!fake.calls[3].residuals && fake.calls[4].residuals);
    assert_int_equal(report.candidates, 1);
    assert_true(isinf(report.other_chi2));
    /* 330 observations: 200 of them before all */
    n = add(o, 0, 0.0, 5.0, 330);
    one_candidate();
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, NULL, &out, NULL));
    assert_int_equal(fake.count, 3);
    expect_call(0, 40, 0.0, 1645.0);
    expect_call(1, 200, 0.0, 1645.0);
    expect_call(2, 330, 0.0, 1645.0);
    sum = 0.0;
    for (int i = 0; i < 200; i++) {
        sum += 5.0 * (i * 329 / 199);
    }
    bst_assert_close(fake.calls[1].sum_s, sum, 1e-6);
    /* sparse: half an hour has no eight different times, nor have one, two or four hours */
    n = add(o, 0, 0.0, 2000.0, 20);
    one_candidate();
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, NULL, &out, NULL));
    expect_call(0, 8, 0.0, 14000.0);  /* 14400 s */
    expect_call(1, 11, 0.0, 20000.0); /* 28800 s about 7000 s: to 21400 s */
}

/* The one that fits the whole arc best, unless it rejects more; the same orbit twice is one, and a
 * hyperbola none. */
static void choice_of_candidates(void **state) {
    (void)state;
    static bst_od_observation o[MOST];
    bst_ctx ctx = {0};
    bst_od_solution out;
    bst_od_report report;
    const bst_od_options options = {.reject_chi2 = 30.0};
    int n = add(o, 0, 0.0, 10.0, 50);
    const struct {
        double first_chi2, chi2, range_m, speed_mps;
        int rejected;
    } c[6] = {{30, 94 * 1.0, 4e6, 7000, 0},    /* good, but never tried: the one before fits */
              {10, 94 * 5.0, 1e6, 7500, 0},    /* best on the first part, bad on the whole arc */
              {11, 94 * 0.5, 1.01e6, 7510, 0}, /* the same as that */
              {15, 94 * 0.9, 2e6, 7300, 1},    /* good, by 1 rejected of 50: 2 more */
              {20, 94 * 2.5, 3e6, 7200, 0},
              {5, 94 * 0.8, 9e6, 11000, 0}}; /* faster than 10.67 km/s: not about the Earth */
    memset(&fake, 0, sizeof fake);
    fake.candidates = 6;
    for (int i = 0; i < 6; i++) {
        fake.first_chi2[i] = c[i].first_chi2;
        fake.chi2[i] = c[i].chi2;
        fake.dof[i] = 94;
        fake.range_m[i] = c[i].range_m;
        fake.speed_mps[i] = c[i].speed_mps;
        fake.rejected[i] = c[i].rejected;
    }
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, NULL, &out, &report));
    /* 1 first (5), then 3 (0.9 + 2 < 3): no more */
    bst_assert_close(out.range_m, 2e6, 0.0);
    bst_assert_close(report.first_chi2, 15.0, 0.0);
    assert_int_equal(report.method, 0);
    bst_assert_close(report.other_chi2, 15.0, 0.0);
    assert_int_equal(fake.count, 6 + 2);
    /* with 2 rejected it is 4.9: the next one, of 2.5, is better */
    fake.rejected[3] = 2;
    fake.count = 0;
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, NULL, &out, &report));
    bst_assert_close(out.range_m, 3e6, 0.0);
    bst_assert_close(report.first_chi2, 20.0, 0.0);
    assert_int_equal(report.method, 1);
    assert_int_equal(fake.count, 6 + 3);
    /* hyperbolas alone */
    for (int i = 0; i < 6; i++) {
        fake.speed_mps[i] = 10700;
    }
    assert_int_equal(bst_od_determine(&ctx, o, n, &options, NULL, &out, &report), BST_ERR_NUMERIC);
    for (int i = 0; i < 6; i++) {
        fake.speed_mps[i] = 10650; /* below 10.67 km/s at 7000 km */
    }
    fake.count = 0;
    bst_assert_ok(&ctx, bst_od_determine(&ctx, o, n, &options, NULL, &out, &report));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(growing_arcs),
        cmocka_unit_test(choice_of_candidates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
