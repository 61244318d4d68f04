/* The poses of a turning body: the image of an edge that moves is that of its integral. */
#include <math.h>

#include "scenegen/smear/body_glints.h"
#include "scenegen/smear/body_poses.h"
#include "tests/test_support.h"

#define DARK_E2 74.0

/* Image of an edge at x, PSF sigmas. */
static double edge(double x) {
    return 0.5 * erfc(-x / sqrt(2.0));
}

/* Integral of that. */
static double edge_integral(double x) {
    return x * edge(x) + exp(-0.5 * x * x) / sqrt(2.0 * BST_PI);
}

/* Largest difference of the image of an edge from its integral, and of that over the noise of a
 * pixel with `light_e` electrons where the edge has passed, in sigma. */
static void find_error(const bst_body_times *t, double length, double light_e, double *error,
                       double *sigma) {
    *error = *sigma = 0.0;
    for (double x = -4.0; x < length + 4.0; x += 0.1) {
        double image = 0.0;
        for (int k = 0; k < t->count; k++) {
            image += t->weight[k] * edge(x - t->u[k] * length);
        }
        double right = (edge_integral(x) - edge_integral(x - length)) / length;
        double off = fabs(image - right);
        *error = fmax(*error, off);
        *sigma = fmax(*sigma, off * light_e / sqrt(fmax(right, 0.0) * light_e + DARK_E2));
    }
}

static void test_moving_edge(void **state) {
    (void)state;
    const double sigmas[] = {0.5, 6.0, 11.0, 25.0, 27.0, 60.0, 84.0, 300.0};
    const double allowed[] = {0.1, 0.03, 0.01};
    static bst_body_times t;
    for (int n = 0; n < 24; n++) {
        double length = sigmas[n / 3], sum = 0.0, error, sigma, light_e = 1e4;
        const bst_body_times_aim aim = {length, light_e, light_e, DARK_E2, allowed[n % 3], NULL, 0};
        bst_body_times_choose(&aim, &t);
        for (int k = 0; k < t.count; k++) {
            sum += t.weight[k];
        }
        bst_assert_close(sum, 1.0, 1e-12);
        find_error(&t, length, light_e, &error, &sigma);
        /* the error is a bound, also where there is little light */
        assert_true(error < t.error);
        double predicted = bst_body_times_sigma(&t, light_e, light_e, DARK_E2);
        assert_true(sigma < predicted && predicted <= allowed[n % 3]);
    }
    /* equal steps with weights corrected at the ends took 47 for 7e-4 */
    const bst_body_times_aim large = {84.0, 1e4, 1e4, DARK_E2, 0.096, NULL, 0};
    bst_body_times_choose(&large, &t);
    assert_true(t.count < 42);
}

/* Light of a glint by Trowbridge and Reitz (1975), at x widths of the lobe from its middle. */
static double lobe(double x) {
    return 1.0 / ((1.0 + x * x) * (1.0 + x * x));
}

/* Integral of that (Bronshtein and Semendyayev, integral 65). */
static double lobe_integral(double x) {
    return 0.5 * (x / (1.0 + x * x) + atan(x));
}

/* A glint that lasts for a small part of the exposure keeps its light, wherever it falls: with
 * poses for the motion alone it may fall between two of them. */
static void test_glints(void **state) {
    (void)state;
    static bst_body_times t;
    const double lengths[] = {0.5, 5.0, 40.0}, widths[] = {0.003, 0.03, 0.2};
    for (int n = 0; n < 9 * 23; n++) {
        const bst_glint glint = {-0.05 + 0.05 * (n % 23), widths[n / 23 % 3]};
        double length = lengths[n / 23 / 3], sum = 0.0, image = 0.0, all = 0.5 * BST_PI * glint.per;
        const bst_body_times_aim aim = {length, 1e4, 1e4, DARK_E2, 0.05, &glint, 1};
        bst_body_times_choose(&aim, &t);
        assert_true(t.count < length / 1.3 + 30.0);
        for (int k = 0; k < t.count; k++) {
            sum += t.weight[k];
            image += t.weight[k] * lobe((t.u[k] - glint.u) / glint.per);
        }
        bst_assert_close(sum, 1.0, 1e-12);
        double right = glint.per * (lobe_integral((1.0 - glint.u) / glint.per) -
                                    lobe_integral(-glint.u / glint.per));
        /* of all light of the glint: most where one end of the exposure cuts it */
        bst_assert_close(image / all, right / all, 1e-3);

        double error, sigma; /* edges are as right as without it */
        find_error(&t, length, 1e4, &error, &sigma);
        assert_true(error < t.error);
    }
}

/* A glint that an end of the exposure cuts, or passes by: the light that is received, by the poses
 * of the glint and of the end. */
static void test_cut_glints(void **state) {
    (void)state;
    static bst_body_times t;
    const double lengths[] = {0.5, 10.0, 40.0}, widths[] = {0.001, 0.01, 0.1};
    for (int n = 0; n < 2 * 9 * 33; n++) {
        const double per = widths[n % 3], k = -4.0 + 0.25 * (n / 18), end = n / 9 % 2;
        const double at = end > 0.0 ? 1.0 - k * per : k * per;
        bst_body_glints glints = {.items = {{k < 0.0 ? end : at, per}}, .count = 1};
        bst_body_glints_cut(&glints, 3);
        assert_true(glints.count >= 2);
        const bst_body_times_aim aim = {lengths[n / 3 % 3], 1e4,         1e4, DARK_E2, 0.05,
                                        glints.items,       glints.count};
        bst_body_times_choose(&aim, &t);
        double image = 0.0;
        for (int i = 0; i < t.count; i++) {
            image += t.weight[i] * lobe((t.u[i] - at) / per);
        }
        double right = per * (lobe_integral((1.0 - at) / per) - lobe_integral(-at / per));
        bst_assert_close(image / right, 1.0, 1e-4); /* GLINT_ERROR of body_precision.c */
    }
    bst_body_glints whole = {.items = {{0.5, 0.01}}, .count = 1};
    bst_body_glints_cut(&whole, 2);
    assert_int_equal(whole.count, 1);
    bst_assert_close(whole.lost, 0.0, 0.0);
    whole.items[0].u = 0.99; /* without room it counts in the error */
    bst_body_glints_cut(&whole, 1);
    assert_int_equal(whole.count, 1);
    assert_true(whole.lost > 0.0);
}

/* The times at which facets turn into the light or the view, of a body that turns by 1.9
 * revolutions. */
static void test_kinks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_satellite *satellite;
    bst_satellite_pose *pose;
    bst_assert_ok(&ctx,
                  bst_satellite_load(&ctx, "scenarios/satellites/cubesat_3u.json", &satellite));
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    const double turn_rad = 1.9 * 2.0 * BST_PI;
    bst_scene_source_body body = {.satellite = satellite, .times = 9};
    body.object_m[0] = body.object_m[1] = (bst_vec3){7e6, 0, 0};
    body.sun_m =
        bst_vec3_axpy(body.object_m[0], BST_AU_M, bst_vec3_unit((bst_vec3){0.6, 0.1, -0.5}));
    for (int k = 0; k < 9; k++) {
        bst_vec3 turn =
            bst_vec3_scale(bst_vec3_unit((bst_vec3){0.5, 0.8, 0.3}), turn_rad * k / 8.0);
        body.q_body_from_gcrf[k] = bst_quat_from_rotvec(turn);
    }
    bst_scene_source source = {.kind = BST_SOURCE_OBJECT,
                               .apparent_mid = {0.0, 0.0, 1.0},
                               .range_m = 1e5,
                               .body = &body,
                               .body_u = {0.0, 1.0}};
    bst_body_glints kinks = {.count = 0};
    double lost_rad = bst_body_kinks_find(&source, turn_rad, 0.1, pose, &kinks);
    assert_int_equal(kinks.count, BST_BODY_KINKS_MAX);
    assert_true(lost_rad > 0.1); /* there are more than are kept */
    for (int m = 0; m < kinks.count; m++) {
        bst_source_body_state at;
        double least = INFINITY;
        bst_source_body_at(&source, kinks.items[m].u, &at, NULL);
        bst_source_body_set_pose(&source, &at, pose);
        for (int f = 0; f < satellite->facet_count; f++) {
            least = fmin(least, fabs(bst_vec3_dot(pose->normals[f], at.aim.sun)));
            least = fmin(least, fabs(bst_vec3_dot(pose->normals[f], at.aim.target)));
        }
        /* steps of 0.15 rad; 0.06 in 8 steps of the exposure */
        bst_assert_close(least, 0.0, 2e-3);
    }
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moving_edge), cmocka_unit_test(test_glints),
        cmocka_unit_test(test_cut_glints), cmocka_unit_test(test_kinks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
