/* Search patterns: no gaps, no waste, their order, and how long they take. */
#include "control/modes/search_pattern.h"

#include <stdbool.h>

#include "boresight/vec.h"
#include "tests/test_support.h"

static const double field = 0.8533 * BST_DEG_RAD;

static bst_search_area square(double extent_deg, double field_x, double field_y, double step) {
    return (bst_search_area){.half_x_rad = extent_deg * BST_DEG_RAD,
                             .half_y_rad = extent_deg * BST_DEG_RAD,
                             .field_x_rad = field_x,
                             .field_y_rad = field_y,
                             .step = step};
}

static void assert_covered(const bst_search *search, const bst_search_area *area) {
    for (int i = 0; i <= 100; i++) {
        for (int j = 0; j <= 100; j++) {
            double x = area->half_x_rad * (i / 50.0 - 1.0), y = area->half_y_rad * (j / 50.0 - 1.0);
            bool seen = false;
            for (int k = 0; k < search->count && !seen; k++) {
                seen = fabs(x - search->tile[k].x_rad) <= 0.5 * area->field_x_rad * (1 + 1e-9) &&
                       fabs(y - search->tile[k].y_rad) <= 0.5 * area->field_y_rad * (1 + 1e-9);
            }
            assert_true(seen);
        }
    }
}

static void every_place_is_covered(void **state) {
    (void)state;
    const double extents[] = {0.2, 0.5, 1.0, 1.15, 2.0, 5.0};
    const double steps[] = {0.5, 0.85, 1.0};
    for (int pattern = 0; pattern < 4; pattern++) {
        for (int e = 0; e < 6; e++) {
            for (int s = 0; s < 3; s++) {
                bst_search search;
                bst_search_area area = square(extents[e], field, 1.3 * field, steps[s]);
                area.half_x_rad *= pattern; /* none, equal and longer along */
                bst_search_plan(&search, (bst_search_pattern)pattern, &area);
                if (search.complete) {
                    assert_covered(&search, &area);
                } else { /* 61 by 29 places and more */
                    assert_true(extents[e] == 5.0 && steps[s] == 0.5);
                }
            }
        }
    }
}

/* Each place once, neighbours a step apart: the same grid in each order. */
static void the_orders_share_one_grid(void **state) {
    (void)state;
    bst_search search[4];
    bst_search_area area = square(2.0, field, field, 0.85);
    area.half_x_rad = 10.0 * BST_DEG_RAD;
    for (int p = 0; p < 4; p++) {
        bst_search_plan(&search[p], (bst_search_pattern)p, &area);
        assert_int_equal(search[p].count, search[0].count);
        for (int k = 0; k < search[p].count; k++) {
            int found = 0;
            for (int m = 0; m < search[0].count; m++) {
                /* products of the same numbers: exact but for rounding */
                found += fabs(search[p].tile[k].x_rad - search[0].tile[m].x_rad) < 1e-12 &&
                         fabs(search[p].tile[k].y_rad - search[0].tile[m].y_rad) < 1e-12;
            }
            assert_int_equal(found, 1);
        }
    }
    /* neighbours overlap by 1 - step of a field, and no more places are there than that takes */
    int columns = 2 * (int)ceil((10.0 * BST_DEG_RAD - 0.5 * field) / (0.85 * field)) + 1;
    int rows = 2 * (int)ceil((2.0 * BST_DEG_RAD - 0.5 * field) / (0.85 * field)) + 1;
    assert_int_equal(search[0].count, columns * rows);
    /* raster and belt go from one place to the next one beside it; raster along x, belt along y */
    for (int p = BST_SEARCH_RASTER; p <= BST_SEARCH_BELT;
         p += BST_SEARCH_BELT - BST_SEARCH_RASTER) {
        int along_x = 0, along_y = 0;
        for (int k = 1; k < search[p].count; k++) {
            double dx = fabs(search[p].tile[k].x_rad - search[p].tile[k - 1].x_rad);
            double dy = fabs(search[p].tile[k].y_rad - search[p].tile[k - 1].y_rad);
            bst_assert_close(dx + dy, 0.85 * field, 1e-12);
            along_x += dx > dy;
            along_y += dy > dx;
        }
        assert_int_equal(p == BST_SEARCH_RASTER ? along_y : along_x,
                         (p == BST_SEARCH_RASTER ? rows : columns) - 1);
    }
    /* within the square about the middle the spiral goes step by step too */
    for (int k = 1; k < rows * rows; k++) {
        double dx =
            search[BST_SEARCH_SPIRAL].tile[k].x_rad - search[BST_SEARCH_SPIRAL].tile[k - 1].x_rad;
        double dy =
            search[BST_SEARCH_SPIRAL].tile[k].y_rad - search[BST_SEARCH_SPIRAL].tile[k - 1].y_rad;
        bst_assert_close(fabs(dx) + fabs(dy), 0.85 * field, 1e-12);
    }
    bst_assert_close(search[BST_SEARCH_SPIRAL].tile[0].x_rad, 0.0, 0.0);
}

static void one_degree_box_takes_nine_fields(void **state) {
    (void)state;
    bst_search s;
    bst_search_area area = square(1.0, field, field, 0.85);
    bst_search_plan(&s, BST_SEARCH_NEAREST_FIRST, &area);
    assert_int_equal(s.count, 9);
    /* centre, the four neighbours along the axes, then the corners, each set by angle */
    const int x[] = {0, 1, 0, -1, 0, 1, -1, -1, 1}, y[] = {0, 0, 1, 0, -1, 1, 1, -1, -1};
    for (int k = 0; k < 9; k++) {
        bst_assert_close(s.tile[k].x_rad, x[k] * 0.85 * field, 1e-15); /* the same products */
        bst_assert_close(s.tile[k].y_rad, y[k] * 0.85 * field, 1e-15);
    }
    /* round about the middle */
    const int sx[] = {0, 1, 1, 0, -1, -1, -1, 0, 1}, sy[] = {0, 0, 1, 1, 1, 0, -1, -1, -1};
    bst_search_plan(&s, BST_SEARCH_SPIRAL, &area);
    for (int k = 0; k < 9; k++) {
        bst_assert_close(s.tile[k].x_rad, sx[k] * 0.85 * field, 1e-15);
        bst_assert_close(s.tile[k].y_rad, sy[k] * 0.85 * field, 1e-15);
    }
}

static void small_extent_needs_one_field_and_huge_ones_are_bounded(void **state) {
    (void)state;
    bst_search s;
    for (int pattern = 0; pattern < 4; pattern++) {
        bst_search_area area = square(0.0, field, field, 0.85);
        bst_search_plan(&s, (bst_search_pattern)pattern, &area);
        assert_int_equal(s.count, 1);
        area.half_x_rad = area.half_y_rad = 0.5 * field;
        bst_search_plan(&s, (bst_search_pattern)pattern, &area);
        assert_int_equal(s.count, 1);
        assert_true(s.complete);
        area.half_x_rad = area.half_y_rad = 1.0;
        area.step = 0.05;
        bst_search_plan(&s, (bst_search_pattern)pattern, &area);
        assert_int_equal(s.count, 31 * 33);
        assert_false(s.complete);
    }
}

static void distances_never_decrease(void **state) {
    (void)state;
    bst_search s;
    bst_search_area area = square(3.0, field, 0.5 * field, 0.7);
    bst_search_plan(&s, BST_SEARCH_NEAREST_FIRST, &area);
    for (int k = 1; k < s.count; k++) {
        double a = hypot(s.tile[k - 1].x_rad, s.tile[k - 1].y_rad);
        double b = hypot(s.tile[k].x_rad, s.tile[k].y_rad);
        assert_true(b >= a * (1 - 1e-8));
    }
}

/* The corners of the inscribed field lie in the camera's, and two of them on its edge. */
static void inscribed_fields_fit(void **state) {
    (void)state;
    for (int k = -40; k <= 40; k++) {
        double turn = 0.1 * k, x, y, w = 0.02, h = 0.013;
        bst_search_inscribe(w, h, turn, &x, &y);
        double far_x = 0.0, far_y = 0.0;
        for (int corner = 0; corner < 4; corner++) {
            double u = corner & 1 ? 0.5 * x : -0.5 * x, v = corner & 2 ? 0.5 * y : -0.5 * y;
            far_x = fmax(far_x, fabs(u * cos(turn) - v * sin(turn)));
            far_y = fmax(far_y, fabs(u * sin(turn) + v * cos(turn)));
        }
        assert_true(far_x <= 0.5 * w * (1 + 1e-12) && far_y <= 0.5 * h * (1 + 1e-12));
        /* rounding only: the largest of its proportion */
        bst_assert_close(fmax(far_x / w, far_y / h), 0.5, 1e-12);
    }
}

/* Closed forms of a trapezoidal profile, and a sweep counted by hand. */
static void times_of_slews_and_sweeps(void **state) {
    (void)state;
    /* 4 deg at 2 deg/s and 4 deg/s^2: ramps of half a second and 0.5 deg each, 1.5 s between */
    bst_assert_close(bst_search_slew_s(4.0, 2.0, 4.0), 2.5, 1e-12);
    /* 0.25 deg: never at full rate; 2 sqrt(0.25 / 4) */
    bst_assert_close(bst_search_slew_s(0.25, 2.0, 4.0), 0.5, 1e-12);
    /* both ramps are 1 deg long: up to there the full rate is not reached */
    bst_assert_close(bst_search_slew_s(0.8, 2.0, 4.0), 2.0 * sqrt(0.2), 1e-12);
    bst_assert_close(bst_search_slew_s(1.0, 2.0, 4.0), 1.0, 1e-12);
    bst_assert_close(bst_search_slew_s(1.1, 2.0, 4.0), 1.05, 1e-12);
    bst_search s = {.count = 3, .complete = true, .tile = {{0, 0}, {0.5, 0.25}, {4.5, 0}}};
    const bst_search_timing timing = {.rate_radps = 2.0,
                                      .accel_radps2 = 4.0,
                                      .settle_s = 0.1,
                                      .period_s = 1.0,
                                      .exposure_s = 0.5,
                                      .latency_s = 0.3,
                                      .frames = 4};
    /* first: its command 0.8 s into a period, so 1 + 3 periods; second: 0.8 + 0.707 + 0.1, 2 + 3;
     * third: 0.8 + 2.5 + 0.1, 4 + 3 */
    bst_assert_close(bst_search_sweep_s(&s, &timing), 16.0, 1e-12);
    /* each time by itself longer: 1.1, 1.1 + 0.807, 1.1 + 2.6; 1.2, 1.2 + 0.807, 1.2 + 2.6; 0.8,
     * 0.8 + 1.507, 0.8 + 3.3 */
    bst_search_timing t = timing;
    t.latency_s = 0.6;
    bst_assert_close(bst_search_sweep_s(&s, &t), 2.0 + 2.0 + 4.0 + 9.0, 1e-12);
    t = timing;
    t.exposure_s = 0.9;
    bst_assert_close(bst_search_sweep_s(&s, &t), 2.0 + 3.0 + 4.0 + 9.0, 1e-12);
    t = timing;
    t.settle_s = 0.8;
    bst_assert_close(bst_search_sweep_s(&s, &t), 1.0 + 3.0 + 5.0 + 9.0, 1e-12);
    /* periods of 0.4 s: 2, 5 and 9 of them */
    t = timing;
    t.period_s = 0.4;
    t.frames = 2;
    bst_assert_close(bst_search_sweep_s(&s, &t), 0.4 * (2.0 + 5.0 + 9.0 + 3.0), 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_place_is_covered),
        cmocka_unit_test(the_orders_share_one_grid),
        cmocka_unit_test(one_degree_box_takes_nine_fields),
        cmocka_unit_test(small_extent_needs_one_field_and_huge_ones_are_bounded),
        cmocka_unit_test(distances_never_decrease),
        cmocka_unit_test(inscribed_fields_fit),
        cmocka_unit_test(times_of_slews_and_sweeps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
