/* Sparse assignment against exhaustive search. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/mtt/assignment.h"

enum { MAX_ROWS = 6, MAX_COLUMNS = 6 };

typedef struct problem {
    int rows, columns;
    int first[MAX_ROWS + 1], edge_columns[MAX_ROWS * MAX_COLUMNS];
    double costs[MAX_ROWS * MAX_COLUMNS], miss[MAX_ROWS];
} problem;

static double exhaustive(const problem *p, int row, unsigned taken) {
    if (row >= p->rows || row >= MAX_ROWS) {
        return 0.0;
    }
    double best = p->miss[row] + exhaustive(p, row + 1, taken);
    for (int e = p->first[row]; e < p->first[row + 1]; e++) {
        unsigned bit = 1u << p->edge_columns[e];
        if (!(taken & bit)) {
            best = fmin(best, p->costs[e] + exhaustive(p, row + 1, taken | bit));
        }
    }
    return best;
}

static problem make(bst_rng_key key, uint64_t seed) {
    uint64_t n = 0;
    int rows = 1 + (int)(bst_rng_uniform(key, seed, n++) * MAX_ROWS);
    int columns = 1 + (int)(bst_rng_uniform(key, seed, n++) * MAX_COLUMNS);
    problem p = {.rows = rows, .columns = columns};
    double density = bst_rng_uniform(key, seed, n++);
    int edges = 0;
    for (int i = 0; i < p.rows; i++) {
        p.first[i] = edges;
        p.miss[i] = 10.0 * bst_rng_uniform(key, seed, n++) - 3.0;
        for (int c = 0; c < p.columns; c++) {
            if (bst_rng_uniform(key, seed, n++) < density) {
                p.edge_columns[edges] = c;
                /* every fourth problem has many ties */
                double cost = 20.0 * bst_rng_uniform(key, seed, n++) - 10.0;
                p.costs[edges++] = seed % 4 == 0 ? floor(cost / 5.0) : cost;
            }
        }
    }
    p.first[p.rows] = edges;
    return p;
}

static void matches_exhaustive_search(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_assignment *work;
    bst_assert_ok(&ctx, bst_assignment_create(&ctx, MAX_ROWS, MAX_COLUMNS, &work));
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "assignment");
    for (uint64_t seed = 0; seed < 3000; seed++) {
        problem p = make(key, seed);
        int column_of_row[MAX_ROWS];
        const bst_assignment_problem asked = {p.rows,         p.columns, p.first,
                                              p.edge_columns, p.costs,   p.miss};
        bst_assignment_solve(work, &asked, column_of_row);
        double total = 0.0;
        unsigned taken = 0;
        for (int i = 0; i < p.rows; i++) {
            int c = column_of_row[i], found = c < 0;
            total += c < 0 ? p.miss[i] : 0.0;
            for (int e = p.first[i]; e < p.first[i + 1]; e++) {
                if (p.edge_columns[e] == c) {
                    total += p.costs[e];
                    found = 1;
                }
            }
            assert_true(found); /* only candidates are assigned */
            if (c >= 0) {
                assert_false(taken >> c & 1u); /* each column once */
                taken |= 1u << c;
            }
        }
        /* sums of at most 6 numbers below 10: rounding only */
        bst_assert_close(total, exhaustive(&p, 0, 0), 1e-12);
    }
    bst_assignment_free(work);
}

static void empty_problems(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_assignment *work;
    bst_assert_ok(&ctx, bst_assignment_create(&ctx, 1, 0, &work));
    int first[2] = {0, 0}, column = 7;
    double miss = 1.0;
    const bst_assignment_problem empty = {.first = first};
    const bst_assignment_problem one_row = {.rows = 1, .first = first, .miss = &miss};
    bst_assignment_solve(work, &empty, NULL);
    bst_assignment_solve(work, &one_row, &column);
    assert_int_equal(column, -1);
    bst_assignment_free(work);
    assert_int_equal(bst_assignment_create(&ctx, -1, 0, &work), BST_ERR_ARGUMENT);
    assert_null(work);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(matches_exhaustive_search),
                                       cmocka_unit_test(empty_problems)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
