/* The index over sky cells, and the cells that a table's stars are divided into. */
#include "tests/test_support.h"

#include <math.h>
#include <stdlib.h>

#include "sim/catalogue/cell_index.h"
#include "sim/catalogue/star_list.h"

static uint64_t seed = 2611;

static double draw(void) {
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(seed >> 11) / 9007199254740992.0;
}

static bst_vec3 draw_direction(void) {
    const double ra = 2.0 * BST_PI * draw();
    return bst_vec3_from_radec(ra, asin(2.0 * draw() - 1.0));
}

/* Record of a star without colour whose V is in whole mmag. */
static bst_star_record record_of(bst_ctx *ctx, bst_vec3 u, int v_mmag, int pm) {
    bst_star_values values = {.pm_ra_cosdec = pm, .vt_mmag = v_mmag};
    bst_vec3_to_radec(u, &values.ra_rad, &values.dec_rad);
    bst_star_record r;
    bst_assert_ok(ctx, bst_star_pack(ctx, &values, &r));
    assert_int_equal(bst_star_record_v(&r), 100 * v_mmag);
    return r;
}

/* Cells of one star each, some of them empty, in more than one block of regions. */
enum { CELLS = 34000 };
static bst_star_cell cells[CELLS];
static bst_star_record records[CELLS];

static bst_star_view make_view(bst_ctx *ctx, bst_star_header *header) {
    uint32_t stars = 0;
    for (uint32_t c = 0; c < CELLS; c++) {
        cells[c] = (bst_star_cell){.first = stars};
        if (c % 7 == 3 || c / 64 % 11 == 5) {
            continue; /* empty: single ones, and whole groups */
        }
        bst_vec3 u = draw_direction();
        records[stars] = record_of(ctx, u, 6000 + (int)(9000.0 * draw()), (int)(90000.0 * draw()));
        cells[c].centre[0] = (float)u.x;
        cells[c].centre[1] = (float)u.y;
        cells[c].centre[2] = (float)u.z;
        cells[c].radius_rad = (float)(0.02 * draw());
        cells[c].pm_max_radpyr = (float)(1e-5 * draw());
        cells[c].count = 1;
        stars++;
    }
    *header = (bst_star_header){.cell_count = CELLS, .star_count = stars};
    return (bst_star_view){.header = header, .cells = cells, .records = records};
}

/* Compares a search with a look at each cell. */
static void compare(const bst_cell_index *index, const bst_cell_cone *cone) {
    static uint32_t found[CELLS];
    bst_cell_search search;
    bst_cell_search_begin(index, cone, &search);
    uint32_t count = 0, more, next = 0, beside = 0;
    while ((more = bst_cell_search_next(&search, found + count, CELLS - count)) > 0) {
        count += more;
        assert_true(CELLS - count >= BST_CELL_BRANCHES || count == 0);
    }
    assert_int_equal(bst_cell_search_next(&search, found + count, CELLS - count), 0);
    for (uint32_t c = 0; c < CELLS; c++) {
        const bst_star_cell *cell = &cells[c];
        const bool has = next < count && found[next] == c;
        next += has;
        bst_vec3 d = {(double)cell->centre[0] - cone->centre.x,
                      (double)cell->centre[1] - cone->centre.y,
                      (double)cell->centre[2] - cone->centre.z};
        const double away = bst_vec3_norm(d) - (double)cell->radius_rad - cone->radius_rad -
                            (double)cell->pm_max_radpyr * cone->years;
        const bool is_bright =
            cell->count > 0 && bst_star_record_v(&records[cell->first]) <= cone->faintest;
        if (!is_bright || away > 1e-5) { /* 2": rounding to single precision is below 5e-6 */
            assert_false(has);
        } else if (away <= 0.0) {
            assert_true(has);
        }
        beside += has && away > 0.0;
    }
    assert_int_equal(next, count); /* ascending, each once */
    assert_true(beside <= 2);
}

static void test_no_cell_is_missed(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_star_header header;
    const bst_star_view view = make_view(&ctx, &header);
    bst_cell_index *index = NULL;
    bst_assert_ok(&ctx, bst_cell_index_create(&ctx, &view, &index));
    for (int k = 0; k < 60; k++) {
        const bst_cell_cone cone = {draw_direction(), 0.5 * pow(draw(), 4.0), 100.0 * (k % 4),
                                    (int32_t)(1e5 * (5.0 + 10.0 * draw()))};
        compare(index, &cone);
    }
    compare(index, &(bst_cell_cone){{0, 0, 1}, 0.0, 0.0, 2000000});
    compare(index, &(bst_cell_cone){{1, 0, 0}, 1.3, 10.0, 599999}); /* brighter than all */
    /* all of the sky, now and after any time; room for all and for one block */
    uint32_t found[BST_CELL_BRANCHES], count = 0, more;
    for (int k = 0; k < 2; k++) {
        const bst_cell_cone cone = {{0, 1, 0}, k ? 0.0 : BST_PI, k ? 1e300 : 0.0, INT32_MAX};
        bst_cell_search search;
        bst_cell_search_begin(index, &cone, &search);
        for (count = 0; (more = bst_cell_search_next(&search, found, BST_CELL_BRANCHES)) > 0;) {
            count += more;
        }
        assert_int_equal(count, header.star_count);
    }
    bst_cell_index_free(index);
}

/* Stars of a table: cells of like brightness in ascending order, with at most 128 stars each. */
static void test_cells_of_a_table(void **state) {
    (void)state;
    enum { STARS = 20000 };
    static const int32_t limits[] = {1200000, 1500000, 1800000, 2100000};
    enum { LIMITS = sizeof limits / sizeof *limits };
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_star_list list = {0};
    for (int i = 0; i < STARS; i++) {
        bst_star_record r = record_of(&ctx, draw_direction(), 10000 + (int)(13000 * draw()), 0);
        bst_assert_ok(&ctx, bst_star_list_add(&ctx, &list, &r, 0));
        list.stars[i].source = i + 1;
    }
    bst_assert_ok(&ctx, bst_star_list_divide(&ctx, &list, 0));
    int shell = 0, per_cell = 0;
    int64_t sources = 0;
    uint32_t cell = BST_STAR_CELLS;
    for (int i = 0; i < STARS; i++) {
        const int32_t v = bst_star_record_v(&list.stars[i].record);
        int own = 0;
        while (own < LIMITS && v > limits[own]) {
            own++;
        }
        assert_true(own >= shell);
        assert_true(list.stars[i].cell == cell || list.stars[i].cell == cell + 1);
        if (own > shell) {
            assert_true(list.stars[i].cell > cell);
        }
        per_cell = list.stars[i].cell == cell ? per_cell + 1 : 1;
        assert_true(per_cell <= 128);
        cell = list.stars[i].cell;
        shell = own;
        sources += list.stars[i].source;
    }
    assert_int_equal(shell, LIMITS);
    assert_int_equal(list.cells, cell + 1);
    assert_int_equal(sources, (int64_t)STARS * (STARS + 1) / 2); /* each is there */
    bst_star_list_free(&list);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_cell_is_missed),
        cmocka_unit_test(test_cells_of_a_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
