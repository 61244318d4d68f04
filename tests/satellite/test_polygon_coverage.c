/* Cells that a polygon covers, against counts of points. */
#include "sim/satellite/polygon_coverage.h"
#include "tests/test_support.h"

typedef struct covered {
    double area, moment[2];
} covered;

/* A cell's covered part by counting points of it. */
static covered count_points(const bst_point2 *p, int corners, double turn, int x, int y) {
    enum { POINTS = 40 };
    covered sum = {0.0, {0.0, 0.0}};
    for (int k = 0; k < POINTS * POINTS; k++) {
        double u = (k % POINTS + 0.5) / POINTS - 0.5, v = (k / POINTS + 0.5) / POINTS - 0.5;
        bool in = true;
        for (int i = 0; i < corners && in; i++) {
            bst_point2 a = p[i], b = p[(i + 1) % corners];
            in = turn * ((b.x - a.x) * (y + 0.5 + v - a.y) - (b.y - a.y) * (x + 0.5 + u - a.x)) >=
                 0.0;
        }
        sum.area += in ? 1.0 / (POINTS * POINTS) : 0.0;
        sum.moment[0] += in ? u / (POINTS * POINTS) : 0.0;
        sum.moment[1] += in ? v / (POINTS * POINTS) : 0.0;
    }
    return sum;
}

/* Twice the area of a cell's own corners, counter-clockwise positive. */
static double twice_area(const bst_point2 *q, int count) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        sum += q[i].x * q[(i + 1) % count].y - q[(i + 1) % count].x * q[i].y;
    }
    return sum;
}

/* Areas and moments of every cell that a polygon covers, of either orientation, also where it
 * leaves the grid on one or the other side. A line across a cell is counted to 0.008. */
static void test_cells_of_a_polygon(void **state) {
    (void)state;
    enum { WIDE = 13, HIGH = 9, CORNERS = 5 };
    const bst_point2 polygons[3][CORNERS] = {
        {{1.3, 2.7}, {6.9, 0.4}, {11.6, 3.1}, {9.2, 7.8}, {2.45, 6.15}},
        {{-3.2, 5.1}, {4.4, -2.6}, {16.3, 1.9}, {12.2, 8.3}, {3.1, 8.9}},
        {{5.2, 3.3}, {5.7, 3.15}, {14.9, 6.2}, {11.3, 12.4}, {5.3, 3.6}}};
    for (int n = 0; n < 6; n++) {
        bst_ctx ctx = {0};
        bst_polygon_coverage list = {.count = 0};
        bst_point2 p[CORNERS];
        double turn = n % 2 ? -1.0 : 1.0, seen[HIGH][WIDE] = {{0.0}};
        for (int i = 0; i < CORNERS; i++) {
            p[i] = polygons[n / 2][n % 2 ? CORNERS - 1 - i : i];
        }
        bst_assert_ok(&ctx, bst_polygon_coverage_add(&ctx, &list, p, CORNERS, WIDE, HIGH));
        for (int k = 0; k < list.count; k++) {
            const bst_coverage_cell *c = &list.cells[k];
            assert_true(c->x >= 0 && c->y >= 0 && c->x + c->run <= WIDE && c->y < HIGH);
            for (int i = 0; i < c->run; i++) {
                covered here = count_points(p, CORNERS, turn, c->x + i, c->y);
                bst_assert_close(c->area, here.area, 0.008);
                bst_assert_close(c->moment_x, here.moment[0], 0.004);
                bst_assert_close(c->moment_y, here.moment[1], 0.004);
                assert_true(seen[c->y][c->x + i] == 0.0);
                seen[c->y][c->x + i] = c->area;
            }
            if (c->count > 0) {
                bst_assert_close(twice_area(list.corners + c->first, c->count), 2.0 * c->area,
                                 1e-12);
            } else {
                assert_true(c->area == 1.0);
            }
        }
        for (int i = 0; i < WIDE * HIGH; i++) { /* none is left out */
            covered here = count_points(p, CORNERS, turn, i % WIDE, i / WIDE);
            bst_assert_close(seen[i / WIDE][i % WIDE], here.area, 0.008);
        }
        bst_polygon_coverage_free(&list);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cells_of_a_polygon)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
