/* The light of long streaks as it is added up, against sums over all places in double precision. */
#include "obsgen/streak/streak_path.h"

#include <stdlib.h>
#include <string.h>

#include "sim/core/simd.h"
#include "tests/test_support.h"

enum { ROWS = BST_STREAK_ROWS, LIGHT_ROWS = BST_STREAK_LIGHT_ROWS };

/* A way from (at, across) on that climbs by `slope` rows a step. */
static void lay(bst_ctx *ctx, bst_streak_light *l, int source, bool by_row, int step, int at,
                double across, double slope, int count, double height) {
    assert_int_equal(bst_streak_light_run(ctx, l, source, by_row, step), BST_OK);
    for (int k = 0; k < count; k++) {
        double c = across + k * slope;
        bst_streak_place p = {.at = at + k * step, .middle = (int)floor(c + 0.5)};
        p.off = (float)(c - p.middle);
        p.height = (float)(height * (1.0 + 0.5 * sin(0.1 * k)));
        p.fall = 0.3f;
        assert_int_equal(bst_streak_light_place(ctx, l, &p), BST_OK);
    }
    assert_int_equal(bst_streak_light_end(ctx, l, 0.1, 0.4, 2.0), BST_OK);
}

static double light_of(const bst_streak_place *p, int r) {
    double d = r - (double)p->off;
    return abs(r) <= LIGHT_ROWS ? (double)p->height * exp(-(double)p->fall * d * d) : 0.0;
}

/* Light of all runs that count on a pixel. */
static double light_on(const bst_streak_light *l, int x, int y) {
    double sum = 0.0;
    for (int i = 0; i < l->run_count; i++) {
        const bst_streak_run *run = &l->runs[i];
        int along = run->by_row ? y : x, across = run->by_row ? x : y;
        for (int k = 0; run->lit && k < run->count; k++) {
            const bst_streak_place *p = &l->places[run->first + (size_t)k];
            sum += p->at == along ? light_of(p, across - p->middle) : 0.0;
        }
    }
    return sum;
}

/* Streaks either way along both axes, that cross, leave the frame, lie on the same pixels, or are
 * too faint to count for others; frames whose bands are few lines and all of them. */
static void light_is_that_of_all_runs(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_streak_light l = {0};
    const int sizes[][2] = {{300, 200}, {60, 2500}, {2500, 60}};
    for (int i = 0; i < 6; i++) {
        int wide = sizes[i / 2][0], high = sizes[i / 2][1];
        bst_streak_light_begin(&l, wide, high, i % 2 == 1);
        lay(&ctx, &l, 0, false, 1, -8, 20.3, 0.31, wide + 16, 7.0);
        lay(&ctx, &l, 1, false, -1, wide + 7, 52.0, -0.2, wide + 10, 3.0);
        lay(&ctx, &l, 2, true, 1, -4, 30.2, 0.1, high + 8, 5.0);
        lay(&ctx, &l, 2, true, -1, high + 3, 59.6, 0.0, high + 8, 0.9);
        lay(&ctx, &l, 3, false, 1, 4, 23.4, 0.31, 40, 0.22); /* seen, but not for others */
        lay(&ctx, &l, 4, false, 1, 4, 23.4, 0.31, 40, 0.05); /* forgotten */
        lay(&ctx, &l, 5, false, 1, 10, -14.0, 0.5, 60, 1.0);
        assert_int_equal(l.run_count, 6);
        assert_false(l.runs[4].lit);
        assert_true(l.runs[0].dense && !l.runs[3].dense);
        assert_int_equal(bst_streak_light_add_up(&ctx, &l), BST_OK);
        for (int r = 0; r < l.run_count; r++) {
            const bst_streak_run *run = &l.runs[r];
            int rows = run->dense ? ROWS : 0, every = run->dense ? 1 : BST_STREAK_SPARSE;
            for (int k = 0; k < run->count; k += every) {
                const bst_streak_place *p = &l.places[run->first + (size_t)k];
                const float *seen = bst_streak_seen(&l, run, k);
                for (int q = -rows; q <= rows; q++) {
                    int x = run->by_row ? p->middle + q : p->at;
                    int y = run->by_row ? p->at : p->middle + q;
                    bool inside = x >= 0 && y >= 0 && x < wide && y < high;
                    double own = run->dense ? light_of(p, q) : (double)p->height;
                    double light = inside ? fmax(light_on(&l, x, y), own) : own;
                    /* sums of up to six floats */
                    bst_assert_close((double)seen[q + rows], light, 3e-6 * (1.0 + light));
                }
            }
        }
    }
    bst_streak_light_free(&l);
}

/* Vectors of all widths give the same bits. */
static void all_widths_agree(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_streak_light l = {0};
    float *first = NULL;
    for (int width = 4; width <= 16; width *= 2) {
        bst_simd_limit(width);
        bst_streak_light_begin(&l, 300, 200, true);
        lay(&ctx, &l, 0, true, 1, -3, 20.3, 0.31, 205, 7.0);
        lay(&ctx, &l, 1, true, -1, 190, 290.0, 0.2, 187, 3.0);
        lay(&ctx, &l, 2, false, 1, 4, 23.4, 0.31, 250, 2.2);
        assert_int_equal(bst_streak_light_add_up(&ctx, &l), BST_OK);
        if (!first) {
            first = calloc(l.seen_count, sizeof *first);
            assert_non_null(first);
            memcpy(first, l.seen, l.seen_count * sizeof *first);
        }
        assert_memory_equal(first, l.seen, l.seen_count * sizeof *first);
    }
    bst_simd_limit(16);
    free(first);
    bst_streak_light_free(&l);
}

/* A float has 6e-8; the series and its argument take a few of that: the argument in units of ln 2
 * is rounded to 24 bits, its own size times 6e-8 more. Below exp(-80) it falls no further. */
static void light_falls_as_a_gaussian(void **state) {
    (void)state;
    for (int i = 0; i <= 2000; i++) {
        bst_streak_place p = {.height = 2.5f, .off = (float)(0.0005 * i - 0.5), .fall = 0.6f};
        float light[BST_STREAK_LANES];
        bst_streak_light_of(&p, light);
        for (int r = 0; r < BST_STREAK_LANES; r++) {
            double d = r - LIGHT_ROWS - (double)p.off, x = fmax(-0.6 * d * d, -80.0);
            /* fall and off are floats too */
            bst_assert_close((double)light[r], 2.5 * exp(x), 2.5 * exp(x) * (1e-6 - 6e-7 * x));
        }
    }
    bst_streak_place far = {.height = 1.0f, .fall = 5.0f};
    float light[BST_STREAK_LANES];
    bst_streak_light_of(&far, light);
    bst_assert_close((double)light[BST_STREAK_LANES - 1], exp(-80.0), 2e-5 * exp(-80.0));
}

/* Stars move by 40 px in x, an object from `from` to `to`, on a frame of 200 x 160 px: its places
 * lie on its own line, with its own ends. */
static void expect_own_way(double dx, double dy) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    enum { NODES = 41 };
    static bst_star_trail_node route[BST_ROUTE_NODES], way[BST_ROUTE_NODES];
    static bst_streak_ways ways;
    double x[NODES], y[NODES], own_x[NODES], own_y[NODES];
    for (int k = 0; k < NODES; k++) {
        x[k] = 40.0 * ((double)k / (NODES - 1) - 0.5);
        y[k] = 0.0;
    }
    generator_source object = {
        .x = 90.25, .y = 70.5, .path = {.dx = dx, .dy = dy}, .amplitude = 9.0};
    bst_generator g = {.width = 200,
                       .height = 160,
                       .cross_sigma = 1.2,
                       .path = {x, y, NODES},
                       .path_x = x,
                       .path_y = y,
                       .object_x = own_x,
                       .object_y = own_y,
                       .route = route,
                       .way = way,
                       .route_top = 1.0,
                       .route_box = {-20.0, 20.0, 0.0, 0.0},
                       .whole_path = {.dx = 40.0},
                       .sources = &object};
    g.route_count = bst_star_trail_lay(&g.path, g.cross_sigma, route);
    const bst_streak_limits limits = {.beyond = 4, .seen = 0.01, .lit = 0.02, .dense = 1e9};
    bst_streak_light l = {0};
    bst_streak_light_begin(&l, g.width, g.height, false);
    bst_streak_ways_begin(&ways, &g, &limits);
    assert_int_equal(bst_streak_ways_add(&ctx, &ways, &g, 0, &l), BST_OK);
    double least = INFINITY, most = -INFINITY;
    bool by_row = fabs(dy) > fabs(dx);
    double along0 = by_row ? object.y : object.x, across0 = by_row ? object.x : object.y;
    double slope = by_row ? dx / dy : dy / dx, length = fabs(by_row ? dy : dx);
    for (int i = 0; i < l.run_count; i++) {
        assert_true(l.runs[i].by_row == by_row);
        for (int k = 0; k < l.runs[i].count; k++) {
            const bst_streak_place *p = &l.places[l.runs[i].first + (size_t)k];
            bst_assert_close(p->middle + (double)p->off, across0 + slope * (p->at - along0), 1e-5);
            least = fmin(least, p->at);
            most = fmax(most, p->at);
        }
    }
    bst_assert_close(0.5 * (least + most), along0, 1.0);
    /* the trail's light reaches beyond its ends by a few of its widths */
    assert_true(most - least > length - 1.5 && most - least < length + 12.0 * g.cross_sigma);
    bst_streak_light_free(&l);
}

static void objects_keep_their_own_way(void **state) {
    (void)state;
    expect_own_way(10.0, 30.0);
    expect_own_way(10.0, -30.0);
    expect_own_way(-36.0, 24.0);
    expect_own_way(60.0, 12.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_is_that_of_all_runs),
        cmocka_unit_test(all_widths_agree),
        cmocka_unit_test(light_falls_as_a_gaussian),
        cmocka_unit_test(objects_keep_their_own_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
