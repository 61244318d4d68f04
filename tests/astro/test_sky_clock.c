#include "sim/astro/sky_clock.h"

#include "tests/test_support.h"

static bst_time utc(const char *text) {
    bst_ctx ctx = {0};
    bst_time t = {0};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, text, &t));
    return t;
}

static void assert_near(bst_vec3 a, bst_vec3 b, double tolerance) {
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(a, b)), 0.0, tolerance);
}

static void assert_like_exact(const bst_astro_eop *eop, bst_sky_clock *clock, bst_time t) {
    bst_ctx ctx = {0};
    bst_sky_rotation sky;
    bst_astro_earth_frames frames;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, clock, t, &sky));
    bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, t, &frames));
    bst_bodies_at(t, &bodies);
    const bst_vec3 geo[2] = {{42164e3, 0, 0}, {0, 29.8e6, 29.8e6}};
    for (int i = 0; i < 2; i++) {
        /* the header's bound; ten times better where no 0h UTC is near */
        assert_near(bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, geo[i]),
                    bst_mat3_mul_vec(&frames.gcrf_from_teme, geo[i]), 1e-3);
        assert_near(bst_mat3_mul_vec(&sky.frames.itrf_from_gcrf, geo[i]),
                    bst_mat3_mul_vec(&frames.itrf_from_gcrf, geo[i]), 1e-3);
    }
    /* acceleration times 120^2 / 8: 6e-3 m/s2 for the Earth, 2.7e-3 for the Moon */
    assert_near(sky.bodies.sun_m, bodies.sun_m, 15.0);
    assert_near(sky.bodies.earth_bary_m, bodies.earth_bary_m, 15.0);
    assert_near(sky.bodies.moon_m, bodies.moon_m, 15.0);
    assert_near(sky.bodies.earth_bary_mps, bodies.earth_bary_mps, 1e-5);
    const bst_mat3 *r = &sky.frames.itrf_from_gcrf;
    bst_mat3 transposed = bst_mat3_transpose(r), unit = bst_mat3_mul(r, &transposed);
    for (int i = 0; i < 9; i++) {
        bst_assert_close(unit.m[i / 3][i % 3], i / 3 == i % 3, 2e-15); /* a few roundings */
    }
}

static void keeps_to_the_exact_values(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &clock));
    bst_time start = utc("2022-06-16T00:00:00Z");
    for (int i = 0; i < 150; i++) {
        assert_like_exact(eop, clock, bst_time_add(start, 1171.3 * i));
    }
    /* through 0h UTC, where the length of day bends, and 0h TAI, where the grid starts anew */
    for (int i = 0; i < 60; i++) {
        assert_like_exact(eop, clock, bst_time_add(start, 86400.0 * 200 - 120.0 + 3.7 * i));
    }
    bst_sky_clock_free(clock);
    bst_astro_eop_free(eop);
}

static void passes_a_leap_second(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_load(&ctx, "tests/astro/data/eopc04_14_2016-12.txt", &eop));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &clock));
    bst_time start = utc("2016-12-31T23:58:00Z");
    for (int i = 0; i < 60; i++) {
        assert_like_exact(eop, clock, bst_time_add(start, 4.1 * i));
    }
    bst_sky_clock_free(clock);
    bst_astro_eop_free(eop);
}

static void order_of_calls_does_not_matter(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL, *other = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &clock));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &other));
    bst_time start = utc("2024-05-04T03:02:01Z");
    bst_sky_rotation forward[40], sky;
    for (int i = 0; i < 40; i++) {
        bst_assert_ok(&ctx,
                      bst_sky_clock_at(&ctx, clock, bst_time_add(start, 47.0 * i), &forward[i]));
    }
    for (int i = 39; i >= 0; i--) {
        int k = (i * 17) % 40;
        bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, other, bst_time_add(start, 47.0 * k), &sky));
        assert_memory_equal(&sky, &forward[k], sizeof sky);
    }
    bst_sky_clock_free(other);
    bst_sky_clock_free(clock);
    bst_sky_clock_free(NULL);
    bst_astro_eop_free(eop);
}

/* Clocks on one grid give what a clock of its own gives, however far apart they are, and when the
 * grid's places are taken again and again: days, in steps that are no multiple of the grid's. */
static void clocks_share_a_grid(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock_grid *grid = NULL;
    bst_sky_clock *own = NULL, *first = NULL, *second = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_sky_clock_grid_create(&ctx, eop, &grid));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &own));
    bst_assert_ok(&ctx, bst_sky_clock_create_on(&ctx, grid, &first));
    bst_assert_ok(&ctx, bst_sky_clock_create_on(&ctx, grid, &second));
    bst_time start = utc("2024-05-04T03:02:01Z");
    for (int i = 0; i < 60; i++) {
        bst_sky_rotation a, b, c;
        bst_time t = bst_time_add(start, 5731.7 * i), later = bst_time_add(t, 86400.0 * 3);
        bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, own, t, &a));
        bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, second, later, &c));
        bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, first, t, &b));
        assert_memory_equal(&a, &b, sizeof a);
        bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, own, later, &a));
        assert_memory_equal(&a, &c, sizeof a);
    }
    bst_sky_clock_free(own);
    bst_sky_clock_free(first);
    bst_sky_clock_free(second);
    bst_sky_clock_grid_free(grid);
    bst_sky_clock_grid_free(NULL);
    bst_astro_eop_free(eop);
}

static void ends_with_the_table(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL;
    bst_sky_rotation sky;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &clock));
    assert_int_equal(bst_sky_clock_at(&ctx, clock, utc("2056-01-01T12:10:00Z"), &sky),
                     BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message, "covers 2020-01-01 to 2026-01-01"));
    /* a failure leaves nothing wrong behind */
    bst_assert_ok(&ctx, bst_sky_clock_at(&ctx, clock, utc("2056-01-01T11:50:00Z"), &sky));
    /* to its very ends, and no further: one of the grid's values lies beyond */
    const struct {
        const char *text;
        bool covered;
    } ends[] = {{"2025-12-31T23:59:50Z", true},  {"2026-01-01T00:00:10Z", true},
                {"2056-01-01T11:59:50Z", true},  {"2056-01-01T12:00:01Z", false},
                {"2019-12-31T23:59:59Z", false}, {"2020-01-01T00:00:00Z", true},
                {"2020-01-01T00:00:10Z", true}};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        bst_time t = utc(ends[i].text);
        bst_status status = bst_sky_clock_at(&ctx, clock, t, &sky);
        assert_int_equal(status, ends[i].covered ? BST_OK : BST_ERR_RANGE);
        if (ends[i].covered) {
            bst_astro_earth_frames exact;
            bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, t, &exact));
            for (int k = 0; k < 9; k++) {
                /* 84 s of the table's drift, 3 ms a day of UT1: 2e-10 rad; the grid's own 1e-10 */
                bst_assert_close((&sky.frames.itrf_from_gcrf.m[0][0])[k],
                                 (&exact.itrf_from_gcrf.m[0][0])[k], 5e-10);
            }
        } else {
            assert_non_null(strncmp(ctx.message, ends[i].text, 19) == 0 ? "" : NULL);
        }
    }
    assert_int_equal(bst_sky_clock_at(&ctx, clock, (bst_time){NAN, 0.0}, &sky), BST_ERR_ARGUMENT);
    assert_int_equal(bst_sky_clock_at(&ctx, clock, (bst_time){2459746.5, 1.0}, &sky),
                     BST_ERR_ARGUMENT);
    bst_sky_clock_free(clock);
    bst_astro_eop_free(eop);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keeps_to_the_exact_values),
        cmocka_unit_test(passes_a_leap_second),
        cmocka_unit_test(order_of_calls_does_not_matter),
        cmocka_unit_test(clocks_share_a_grid),
        cmocka_unit_test(ends_with_the_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
