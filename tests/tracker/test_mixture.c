/* Reduction of a mixture against Runnalls' rule with moments and determinants of the test's own:
 * components with slanting covariances of direction and rate, so close together that the sphere is
 * flat between them. */
#include "tests/test_support.h"
#include "tracker/mtt/filter.h"

enum { COMPONENTS = 7 };

typedef struct gaussian {
    double weight, x[4], p[4][4];
} gaussian;

/* Determinant by expansion along the first row. */
static double determinant(int n, const double a[4][4]) {
    double sum = 0.0;
    for (int k = 0; k < n; k++) {
        double minor[4][4] = {{0.0}};
        for (int i = 1; i < n; i++) {
            for (int j = 0; j < n; j++) {
                if (j != k) {
                    minor[i - 1][j - (j > k)] = a[i][j];
                }
            }
        }
        sum += (k % 2 ? -1.0 : 1.0) * a[0][k] * (n > 1 ? determinant(n - 1, minor) : 1.0);
    }
    return sum;
}

/* Merge that keeps the moments: the spread of the means is w1 w2 / (w1 + w2)^2 times their
 * difference squared. */
static gaussian merged(const gaussian *a, const gaussian *b) {
    gaussian out = {.weight = a->weight + b->weight};
    double u = a->weight / out.weight, v = b->weight / out.weight;
    for (int i = 0; i < 4; i++) {
        out.x[i] = u * a->x[i] + v * b->x[i];
        for (int k = 0; k < 4; k++) {
            out.p[i][k] =
                u * a->p[i][k] + v * b->p[i][k] + u * v * (a->x[i] - b->x[i]) * (a->x[k] - b->x[k]);
        }
    }
    return out;
}

/* Runnalls' bound, twice. */
static double price(const gaussian *a, const gaussian *b) {
    gaussian both = merged(a, b);
    return both.weight * log(determinant(4, both.p)) - a->weight * log(determinant(4, a->p)) -
           b->weight * log(determinant(4, b->p));
}

static int reduced(gaussian *list, int n, int keep) {
    for (; n > keep; n--) {
        int a = 0, b = 1;
        for (int i = 0; i < n; i++) {
            for (int k = i + 1; k < n; k++) {
                if (price(&list[i], &list[k]) < price(&list[a], &list[b])) {
                    a = i;
                    b = k;
                }
            }
        }
        list[a] = merged(&list[a], &list[b]);
        list[b] = list[n - 1];
    }
    return n;
}

static double uniform(uint64_t *random) {
    *random = *random * 6364136223846793005u + 1442695040888963407u;
    return (double)(*random >> 11) * 0x1p-53;
}

/* Draws a component: units of 20 microradians and 1 microradian per second. */
static gaussian drawn(uint64_t *random) {
    const double unit[4] = {2e-5, 2e-5, 1e-6, 1e-6};
    gaussian out = {.weight = 0.05 + uniform(random)};
    double root[4][4];
    for (int i = 0; i < 4; i++) {
        out.x[i] = 2.0 * unit[i] * (uniform(random) - 0.5);
        for (int k = 0; k < 4; k++) {
            root[i][k] = unit[i] * ((i == k ? 0.3 : 0.0) + (uniform(random) - 0.5));
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            for (int j = 0; j < 4; j++) {
                out.p[i][k] += root[i][j] * root[k][j];
            }
        }
    }
    return out;
}

static void reduction_is_runnalls_rule(void **state) {
    (void)state;
    uint64_t random = 20;
    const bst_sky_state base = {.direction = bst_vec3_from_radec(0.7, 1.1)};
    for (int trial = 0; trial < 60; trial++) {
        gaussian list[COMPONENTS];
        bst_sky_state states[COMPONENTS];
        double weights[COMPONENTS], sum = 0.0;
        int count = 3 + trial % (COMPONENTS - 2), keep = 1 + trial % (count - 1);
        for (int i = 0; i < count; i++) {
            list[i] = drawn(&random);
            states[i] = base;
            memcpy(states[i].covariance, list[i].p, sizeof list[i].p);
            bst_sky_shift_by(&states[i], list[i].x);
            weights[i] = list[i].weight;
            sum += list[i].weight;
        }
        assert_int_equal(bst_sky_reduce(states, weights, count, keep), reduced(list, count, keep));
        for (int i = 0; i < keep; i++) {
            double x[4], p[4][4];
            int at = 0;
            for (int k = 1; k < keep; k++) {
                at = fabs(list[k].weight / sum - weights[i]) <
                             fabs(list[at].weight / sum - weights[i])
                         ? k
                         : at;
            }
            /* curvature of 2e-5 rad, twice */
            bst_assert_close(weights[i], list[at].weight / sum, 1e-12);
            bst_sky_difference(&base, &states[i], x);
            bst_sky_turn_covariance(&states[i], base.direction, p);
            for (int a = 0; a < 4; a++) {
                bst_assert_close(x[a], list[at].x[a], a < 2 ? 1e-13 : 1e-14);
                for (int b = 0; b < 4; b++) {
                    bst_assert_close(p[a][b], list[at].p[a][b],
                                     1e-8 * sqrt(list[at].p[a][a] * list[at].p[b][b]));
                }
            }
        }
    }
}

/* A track whose components are given up, as when it splits, begins with all levels of process noise
 * again: those of before are no longer those of its components. */
static void a_new_mixture_has_new_levels(void **state) {
    (void)state;
    const bst_filter_params params = {.noise_rad2ps3 = 1e-14, .steady_noise_rad2ps3 = 1e-16};
    bst_sky_state s = {.direction = {1, 0, 0}};
    for (int i = 0; i < 4; i++) {
        s.covariance[i][i] = i < 2 ? 1e-12 : 1e-14;
    }
    const bst_sky_measurement z = {.direction = {1, 0, 0}, .cov_11 = 1e-12, .cov_22 = 1e-12};
    const bst_filter_candidate candidate = {.measurement = &z};
    const bst_filter_evidence evidence = {&candidate, 1, 0.0, 1.0};
    bst_filter_models models = {0};
    bst_filter_update(&params, &s, &models, &evidence, BST_FILTER_COMPONENTS);
    assert_int_equal(models.count, 1);
    double first[BST_FILTER_LEVELS] = {0.0};
    for (int k = 0; k < 2; k++) {
        bst_filter_predict(&params, 1.0, &s, &models);
        assert_int_equal(models.count, BST_FILTER_LEVELS);
        for (int i = 0; i < models.count; i++) {
            first[models.level[i]] = k == 0 ? models.probability[i] : first[models.level[i]];
            bst_assert_close(models.probability[i], first[models.level[i]], 1e-15);
        }
        models.count = 0;
        bst_filter_update(&params, &s, &models, &evidence, BST_FILTER_COMPONENTS);
        assert_int_equal(models.count, 1);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(reduction_is_runnalls_rule),
                                       cmocka_unit_test(a_new_mixture_has_new_levels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
