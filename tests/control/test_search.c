/* The search pattern: no gaps, no waste, nearest first. */
#include "control/search.h"

#include <stdbool.h>

#include "sim/core/vec.h"
#include "tests/test_support.h"

static const double field = 0.8533 * BST_DEG_RAD;

static void box_is_covered_without_gaps(void **state) {
    (void)state;
    const double extents[] = {0.2, 0.5, 1.0, 1.15, 2.0, 5.0};
    const double steps[] = {0.5, 0.85, 1.0};
    for (int e = 0; e < 6; e++) {
        for (int s = 0; s < 3; s++) {
            bst_search search;
            double extent = extents[e] * BST_DEG_RAD;
            if (extents[e] == 5.0 && steps[s] == 0.5) {
                continue; /* beyond the greatest pattern */
            }
            bst_search_plan(&search, extent, field, 1.3 * field, steps[s]);
            for (int i = 0; i <= 100; i++) {
                for (int j = 0; j <= 100; j++) {
                    double x = extent * (i / 50.0 - 1.0), y = extent * (j / 50.0 - 1.0);
                    bool seen = false;
                    for (int k = 0; k < search.count && !seen; k++) {
                        seen = fabs(x - search.tile[k].x_rad) <= 0.5 * field * (1 + 1e-9) &&
                               fabs(y - search.tile[k].y_rad) <= 0.65 * field * (1 + 1e-9);
                    }
                    assert_true(seen);
                }
            }
        }
    }
}

static void one_degree_box_takes_nine_fields(void **state) {
    (void)state;
    bst_search s;
    bst_search_plan(&s, 1.0 * BST_DEG_RAD, field, field, 0.85);
    assert_int_equal(s.count, 9);
    /* centre, the four neighbours along the axes, then the corners, each set by angle */
    const int x[] = {0, 1, 0, -1, 0, 1, -1, -1, 1}, y[] = {0, 0, 1, 0, -1, 1, 1, -1, -1};
    for (int k = 0; k < 9; k++) {
        bst_assert_close(s.tile[k].x_rad, x[k] * 0.85 * field, 1e-15); /* the same products */
        bst_assert_close(s.tile[k].y_rad, y[k] * 0.85 * field, 1e-15);
    }
}

static void small_extent_needs_one_field_and_huge_ones_are_bounded(void **state) {
    (void)state;
    bst_search s;
    bst_search_plan(&s, 0.0, field, field, 0.85);
    assert_int_equal(s.count, 1);
    bst_search_plan(&s, 0.5 * field, field, field, 0.85);
    assert_int_equal(s.count, 1);
    bst_search_plan(&s, 1.0, field, field, 0.05);
    assert_int_equal(s.count, BST_SEARCH_MAX_TILES);
}

static void distances_never_decrease(void **state) {
    (void)state;
    bst_search s;
    bst_search_plan(&s, 3.0 * BST_DEG_RAD, field, 0.5 * field, 0.7);
    for (int k = 1; k < s.count; k++) {
        double a = hypot(s.tile[k - 1].x_rad, s.tile[k - 1].y_rad);
        double b = hypot(s.tile[k].x_rad, s.tile[k].y_rad);
        assert_true(b >= a * (1 - 1e-8));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(box_is_covered_without_gaps),
        cmocka_unit_test(one_degree_box_takes_nine_fields),
        cmocka_unit_test(small_extent_needs_one_field_and_huge_ones_are_bounded),
        cmocka_unit_test(distances_never_decrease),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
