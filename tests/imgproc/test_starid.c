#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/identify/starid.h"
#include "tests/test_support.h"

enum { MOST = 12000 };

typedef struct scene {
    bst_ctx ctx;
    bst_starid *id;
    bst_rng_key key;
    bst_imgproc_expected_star stars[MOST];
    int star_count;
    bst_detection items[MOST];
    int truth[MOST]; /* star of each detection, -1: none */
    int count;
    bst_starid_options options;
    bst_starid_result result;
} scene;

static int setup(void **state) {
    scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->key = bst_rng_make_key(5, 0, "test", "starid");
    s->options = (bst_starid_options){60.0, 3.0, 511.5, 511.5, 1024, 1024};
    bst_assert_ok(&s->ctx, bst_starid_create(&s->ctx, MOST, MOST, 60.0, &s->id));
    *state = s;
    return 0;
}
static int teardown(void **state) {
    scene *s = *state;
    bst_starid_free(s->id);
    free(s);
    return 0;
}

static double uniform(const scene *s, uint64_t stream, int i) {
    return bst_rng_uniform(s->key, stream, (uint64_t)i);
}

/* Stars over the field and its margin, numbers growing as 10^(0.4 V) from V 8 to 13. */
static void make_stars(scene *s, uint64_t seed, int count) {
    s->star_count = count;
    s->count = 0;
    for (int i = 0; i < count; i++) {
        double v = 13.0 + log10(fmax(uniform(s, seed, 3 * i), 0.01)) / 0.4;
        s->stars[i] = (bst_imgproc_expected_star){-60.0 + 1144.0 * uniform(s, seed, 3 * i + 1),
                                                  -60.0 + 1144.0 * uniform(s, seed, 3 * i + 2), v,
                                                  (uint32_t)(1000 + i)};
    }
}

static void detect(scene *s, double x, double y, double v, int star) {
    if (x < 0 || y < 0 || x > 1023 || y > 1023) {
        return;
    }
    bst_detection *d = &s->items[s->count];
    double flux = 1e4 * pow(10.0, -0.4 * (v - 10.0));
    *d = (bst_detection){.x_px = x,
                         .y_px = y,
                         .cov_xx = 0.01,
                         .cov_yy = 0.01,
                         .flux_e = flux,
                         .flux_sigma_e = 0.05 * flux,
                         .v_mag = v,
                         .label = BST_LABEL_UNKNOWN};
    s->truth[s->count++] = star;
}

/* The stars shifted and turned with 0.1 px and 0.05 mag of error; every one of `drop` is missed. */
static void detect_stars(scene *s, uint64_t seed, double dx, double dy, double roll, int drop) {
    for (int i = 0; i < s->star_count; i++) {
        if (drop > 0 && i % drop == 0) {
            continue;
        }
        double z[2], m[2];
        bst_rng_normal2(s->key, seed, (uint64_t)(2 * i), z);
        bst_rng_normal2(s->key, seed, (uint64_t)(2 * i + 1), m);
        double rx = s->stars[i].x_px - 511.5, ry = s->stars[i].y_px - 511.5;
        detect(s, s->stars[i].x_px + dx - roll * ry + 0.1 * z[0],
               s->stars[i].y_px + dy + roll * rx + 0.1 * z[1], s->stars[i].v_mag + 0.05 * m[0], i);
    }
}

/* `count` detections that are no stars. */
static void detect_others(scene *s, uint64_t seed, int count) {
    for (int i = 0; i < count; i++) {
        detect(s, 1023 * uniform(s, seed, 3 * i), 1023 * uniform(s, seed, 3 * i + 1),
               9.0 + 4.0 * uniform(s, seed, 3 * i + 2), -1);
    }
}

static void match(scene *s) {
    bst_starid_match(s->id, &s->options, s->stars, s->star_count, s->items, s->count, &s->result);
}

static void score(const scene *s, int *right, int *wrong, int *missed) {
    *right = *wrong = *missed = 0;
    for (int i = 0; i < s->count; i++) {
        int expected = s->truth[i] >= 0 ? 1000 + s->truth[i] : 0;
        bool matched = s->items[i].star_id != 0;
        assert_int_equal(matched, s->items[i].label == BST_LABEL_STAR);
        *right += matched && (int)s->items[i].star_id == expected;
        *wrong += matched && (int)s->items[i].star_id != expected;
        *missed += !matched && expected;
    }
}

/* The case that is asked for: shift (37, -22) px, 30 % of the detections false, one star of five
 * missing. */
static void shifted_field_with_false_detections(void **state) {
    scene *s = *state;
    make_stars(s, 1, 80);
    detect_stars(s, 2, 37.0, -22.0, 5e-4, 5);
    detect_others(s, 3, s->count * 3 / 7);
    match(s);
    int right, wrong, missed;
    score(s, &right, &wrong, &missed);
    assert_int_equal(wrong, 0);
    assert_int_equal(missed, 0);
    assert_int_equal(right, s->result.matched);
    assert_true(right > 40);
    /* 0.1 px over the square root of 50 stars, four times; roll: 0.1 px over 40 stars at 400 px */
    bst_assert_close(s->result.shift_x_px, 37.0, 0.06);
    bst_assert_close(s->result.shift_y_px, -22.0, 0.06);
    bst_assert_close(s->result.roll_rad, 5e-4, 2e-4);
    bst_assert_close(s->result.rms_px, 0.1, 0.04);
}

/* Few stars: 3 and 2 among as many others, over many draws. Never a wrong star, hardly ever none.
 */
static void few_stars(void **state) {
    scene *s = *state;
    int found = 0, trials = 200, wrongs = 0;
    for (int t = 0; t < trials; t++) {
        make_stars(s, (uint64_t)(100 + t), 2 + t % 2);
        for (int i = 0; i < s->star_count; i++) {
            s->stars[i].x_px = 100 + 800 * uniform(s, (uint64_t)(5000 + t), 2 * i);
            s->stars[i].y_px = 100 + 800 * uniform(s, (uint64_t)(5000 + t), 2 * i + 1);
        }
        detect_stars(s, (uint64_t)(9000 + t), -31.0, 44.0, 0.0, 0);
        detect_others(s, (uint64_t)(20000 + t), 2);
        match(s);
        int right, wrong, missed;
        score(s, &right, &wrong, &missed);
        found += missed == 0;
        wrongs += wrong;
    }
    assert_int_equal(wrongs, 0);
    assert_true(found >= trials * 95 / 100);
}

/* One star, searched for within the reach of a locked tracker. */
static void single_star_when_locked(void **state) {
    scene *s = *state;
    s->options.search_radius_px = 10.0;
    make_stars(s, 1, 1);
    s->stars[0].x_px = 300;
    s->stars[0].y_px = 700;
    detect_stars(s, 2, 0.4, -0.3, 0.0, 0);
    detect_others(s, 3, 1);
    match(s);
    assert_int_equal(s->result.matched, 1);
    assert_int_equal(s->items[0].star_id, 1000);
}

/* Detections that have nothing to do with the catalogue: nothing is identified, in 95 of 100 fields
 * (the test of chance is at 1 %). */
static void chance_is_not_a_match(void **state) {
    scene *s = *state;
    int fooled = 0;
    for (int t = 0; t < 100; t++) {
        make_stars(s, (uint64_t)(100 + t), 5 + t);
        detect_others(s, (uint64_t)(700 + t), 60);
        match(s);
        fooled += s->result.matched > 0;
    }
    assert_true(fooled <= 5);
}

/* No stars, no detections, or neither. */
static void nothing_to_match(void **state) {
    scene *s = *state;
    match(s);
    assert_int_equal(s->result.matched, 0);
    make_stars(s, 1, 50);
    match(s);
    assert_int_equal(s->result.matched, 0);
    s->star_count = 0;
    detect_others(s, 3, 20);
    match(s);
    assert_int_equal(s->result.matched, 0);
    for (int i = 0; i < s->count; i++) {
        assert_int_equal(s->items[i].label, BST_LABEL_UNKNOWN);
    }
}

/* A target of another brightness close to a star, and one as bright but 5 px away, stay targets. */
static void target_beside_a_star(void **state) {
    scene *s = *state;
    make_stars(s, 1, 60);
    detect_stars(s, 2, 10.0, 5.0, 0.0, 0);
    int near_star = s->truth[3], far_star = s->truth[8];
    int first = s->count;
    detect(s, s->items[3].x_px + 1.5, s->items[3].y_px + 1.0, s->items[3].v_mag + 3.0, -1);
    detect(s, s->items[8].x_px - 5.0, s->items[8].y_px, s->items[8].v_mag, -1);
    assert_int_equal(s->count, first + 2);
    match(s);
    assert_int_equal(s->items[first].star_id, 0);
    assert_int_equal(s->items[first + 1].star_id, 0);
    assert_int_equal(s->items[3].star_id, 1000 + near_star);
    assert_int_equal(s->items[8].star_id, 1000 + far_star);
}

/* 10 000 stars and as many detections. */
static void crowded_field(void **state) {
    scene *s = *state;
    make_stars(s, 1, 10000);
    detect_stars(s, 2, -41.3, 17.7, 0.0, 0);
    match(s);
    int right, wrong, missed;
    score(s, &right, &wrong, &missed);
    /* 10 px between stars, 3 px tolerance shrinking to four sigma: confusion below 1 % */
    assert_true(wrong * 100 < right);
    assert_true(missed * 50 < right);
}

/* The same in, the same out. */
static void repeatable(void **state) {
    scene *s = *state;
    make_stars(s, 1, 200);
    detect_stars(s, 2, 12.0, -7.0, 1e-3, 4);
    detect_others(s, 3, 50);
    scene *copy = malloc(sizeof *copy);
    assert_non_null(copy);
    memcpy(copy, s, sizeof *s);
    match(s);
    match(copy);
    assert_memory_equal(s->items, copy->items, sizeof s->items);
    assert_memory_equal(&s->result, &copy->result, sizeof s->result);
    free(copy);
}

/* A place counts as a star's within four standard deviations of both axes together, never beyond
 * the tolerance asked for. */
static void the_tolerance_follows_the_errors_up_to_its_limit(void **state) {
    scene *s = *state;
    make_stars(s, 77, 60);
    for (int i = 0; i < s->star_count; i++) {
        s->stars[i].x_px = 60 + 900 * uniform(s, 78, 2 * i);
        s->stars[i].y_px = 60 + 900 * uniform(s, 78, 2 * i + 1);
    }
    const struct {
        double off_px, variance_px2;
        bool known;
    } cases[] = {{0.7, 1e-4, true},   /* floor of 0.25 px: tolerance 1.0 px */
                 {2.0, 1e-4, false},  /* beyond it */
                 {2.0, 0.25, true},   /* known to 0.5 px an axis: tolerance 3.0 px, of sigmas 3.0 */
                 {2.8, 25.0, true},   /* any error */
                 {3.3, 25.0, false}}; /* beyond the tolerance asked for */
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        for (int axis = 0; axis < 2; axis++) {
            s->count = 0;
            for (int i = 0; i < s->star_count; i++) {
                detect(s, s->stars[i].x_px, s->stars[i].y_px, s->stars[i].v_mag, i);
            }
            bst_detection *d = &s->items[30];
            *(axis == 0 ? &d->x_px : &d->y_px) += cases[k].off_px;
            d->cov_xx = d->cov_yy = cases[k].variance_px2;
            match(s);
            assert_true((d->star_id != 0) == cases[k].known);
        }
    }
}

/* Six stars with errors of their own on each axis, and three detections that are none: shift and
 * roll are those of numpy's weighted least squares (weights 1 / (variance + 0.0025 px^2), the roll
 * expected to 3 mrad), and the probabilities follow from the distances by Bayes' rule. */
static void the_fit_weighs_by_the_errors(void **state) {
    scene *s = *state;
    static const double at[6][2] = {{100, 80},  {900, 150}, {420, 510},
                                    {700, 860}, {60, 940},  {980, 620}};
    static const double seen[6][4] = {
        /* x, y, variances */
        {107.838, 74.3, 0.01, 0.05},     {907.324, 145.65, 0.04, 0.01},
        {427.062, 505.184, 0.09, 0.03},  {706.322, 855.15, 0.02, 0.12},
        {66.636, 934.582, 0.16, 0.0025}, {987.1, 615.276, 0.0225, 0.06}};
    static const double probability[6] = {0.9950445944286893, 0.9963080159108955,
                                          0.995968991639745,  0.9929532586139461,
                                          0.9955579255085463, 0.9883335828879546};
    s->star_count = 6;
    s->count = 0;
    for (int i = 0; i < 6; i++) {
        double v = 9.0 + 0.2 * i;
        s->stars[i] = (bst_imgproc_expected_star){at[i][0], at[i][1], v, (uint32_t)(1000 + i)};
        detect(s, seen[i][0], seen[i][1], v, i);
        s->items[i].cov_xx = seen[i][2];
        s->items[i].cov_yy = seen[i][3];
    }
    for (int i = 0; i < 3; i++) {
        detect(s, 300.0 + 100.0 * i, 300.0, 16.0, -1);
    }
    /* a small field, so that the three are dense: 3 / 600 px^2 */
    s->options = (bst_starid_options){60.0, 3.0, 500.0, 520.0, 30.0, 20.0};
    match(s);
    assert_int_equal(s->result.matched, 6);
    /* rounding, of the normal equations too */
    bst_assert_close(s->result.shift_x_px, 7.083168758563298, 1e-9);
    bst_assert_close(s->result.shift_y_px, -4.880044344382002, 1e-9);
    bst_assert_close(s->result.roll_rad, 0.0013404261493059622, 1e-12);
    bst_assert_close(s->result.rms_px, 0.22908527127097342, 1e-9);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(s->items[i].star_id, 1000 + i);
        assert_int_equal(bst_starid_star_of(s->id, i), i);
        bst_assert_close(s->items[i].label_probability, probability[i], 1e-9);
    }
    for (int i = 6; i < 9; i++) {
        assert_int_equal(s->items[i].star_id, 0);
        assert_int_equal(bst_starid_star_of(s->id, i), -1);
    }
    /* exact places: the residuals count as 0.01 px at the least */
    for (int i = 0; i < 6; i++) {
        s->items[i].x_px = at[i][0] + 7.0;
        s->items[i].y_px = at[i][1] - 5.0;
        s->items[i].cov_xx = s->items[i].cov_yy = 0.0;
    }
    match(s);
    double near = 1.0 / (2.0 * BST_PI * 1e-4), others = 3.0 / 600.0;
    bst_assert_close(s->items[0].label_probability, near / (near + others), 1e-12);
}

/* Two votes of 18 x 18 pairs, in cells of 4 x 4 px out of 900: chance gives them once in 29 fields
 * of 1024 x 400 px, and once in 140 of 1024 x 1024, in which they are believed. */
static void votes_count_by_the_area(void **state) {
    scene *s = *state;
    const double sides[3][2] = {{1024, 400}, {400, 1024}, {1024, 1024}};
    for (int k = 0; k < 3; k++) {
        s->options = (bst_starid_options){60.0, 3.0, 511.5, 511.5, sides[k][0], sides[k][1]};
        s->star_count = 18;
        s->count = 0;
        for (int i = 0; i < 18; i++) {
            double x = 100.0 + 150.0 * (i % 6), y = 100.0 + 150.0 * floor(i / 6.0);
            s->stars[i] = (bst_imgproc_expected_star){x, y, 10.0, (uint32_t)(1000 + i)};
            detect(s, x + (i < 2 ? 7.3 : 75.0), y - (i < 2 ? 4.1 : 75.0), 10.0, i);
        }
        match(s);
        assert_int_equal(s->result.matched, k == 2 ? 2 : 0);
    }
}

/* A star may be 1 mag off and three sigma; fainter by 2.5 mag more if its light is cut. */
static void magnitudes_that_agree(void **state) {
    scene *s = *state;
    const struct {
        double excess;
        unsigned flags;
        bool known;
    } cases[] = {{1.0, 0, true},
                 {1.4, 0, false},
                 {-1.0, 0, true},
                 {-1.4, 0, false},
                 {1.4, BST_DETECTION_SATURATED, true},
                 {3.4, BST_DETECTION_EDGE, true},
                 {4.0, BST_DETECTION_EDGE, false},
                 {-1.4, BST_DETECTION_SATURATED, false},
                 {3.4, BST_DETECTION_BLEND, false}};
    make_stars(s, 1, 60);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        s->count = 0;
        detect_stars(s, 2, 10.0, 5.0, 0.0, 0);
        s->items[8].v_mag = s->stars[s->truth[8]].v_mag + cases[k].excess;
        s->items[8].flags = cases[k].flags;
        match(s);
        assert_int_equal(s->items[8].star_id != 0, cases[k].known);
    }
}

int main(void) {
#define STARID_TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)
    const struct CMUnitTest tests[] = {
        STARID_TEST(shifted_field_with_false_detections),
        STARID_TEST(few_stars),
        STARID_TEST(the_fit_weighs_by_the_errors),
        STARID_TEST(the_tolerance_follows_the_errors_up_to_its_limit),
        STARID_TEST(single_star_when_locked),
        STARID_TEST(votes_count_by_the_area),
        STARID_TEST(magnitudes_that_agree),
        STARID_TEST(chance_is_not_a_match),
        STARID_TEST(nothing_to_match),
        STARID_TEST(target_beside_a_star),
        STARID_TEST(crowded_field),
        STARID_TEST(repeatable),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
