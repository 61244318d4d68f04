#include "sim/astro/frames.h"
#include "tests/astro/astropy_reference.h"
#include "tests/test_support.h"

static bst_time utc(const char *text) {
    bst_ctx ctx = {0};
    bst_time t = {0};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, text, &t));
    return t;
}

static bst_astro_eop *builtin(void) {
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    return eop;
}

static bst_astro_earth_frames frames_at(const bst_astro_eop *eop, bst_time t) {
    bst_ctx ctx = {0};
    bst_astro_earth_frames frames;
    bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, t, &frames));
    return frames;
}

static double distance(bst_vec3 a, const double b[3]) {
    return bst_vec3_norm(bst_vec3_sub(a, bst_vec3_make(b[0], b[1], b[2])));
}

static void geostationary_positions_agree_with_astropy(void **state) {
    (void)state;
    bst_astro_eop *eop = builtin();
    for (size_t i = 0; i < sizeof reference_frames / sizeof *reference_frames; i++) {
        const double *p = reference_frames[i].teme_m;
        bst_astro_earth_frames f = frames_at(eop, utc(reference_frames[i].utc));
        bst_vec3 gcrf = bst_mat3_mul_vec(&f.gcrf_from_teme, bst_vec3_make(p[0], p[1], p[2]));
        bst_vec3 itrf = bst_mat3_mul_vec(&f.itrf_from_gcrf, gcrf);
        /* The chain is astropy's own: rounding of both sides in angles of 1e-16 and times of
         * 1e-11 s leaves micrometres; 1 m is the requirement. */
        bst_assert_close(distance(gcrf, reference_frames[i].gcrf_m), 0.0, 1e-4);
        bst_assert_close(distance(itrf, reference_frames[i].itrf_m), 0.0, 1e-4);
    }
    bst_astro_eop_free(eop);
}

static void rotations_are_rotations(void **state) {
    (void)state;
    bst_astro_eop *eop = builtin();
    bst_astro_earth_frames f = frames_at(eop, utc("2022-06-16T22:10:00Z"));
    const bst_mat3 *both[] = {&f.gcrf_from_teme, &f.itrf_from_gcrf};
    for (int k = 0; k < 2; k++) {
        bst_mat3 transposed = bst_mat3_transpose(both[k]);
        bst_mat3 unit = bst_mat3_mul(both[k], &transposed);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                bst_assert_close(unit.m[i][j], i == j, 1e-15); /* a few roundings */
            }
        }
    }
    bst_astro_eop_free(eop);
}

static void earth_rate_turns_itrf(void **state) {
    (void)state;
    bst_astro_eop *eop = builtin();
    bst_time t = utc("2022-06-16T22:10:00Z");
    bst_astro_earth_frames f = frames_at(eop, t);
    bst_astro_earth_frames before = frames_at(eop, bst_time_add(t, -5.0));
    bst_astro_earth_frames after = frames_at(eop, bst_time_add(t, 5.0));
    bst_vec3 ground = {4000e3, -3000e3, 3900e3};
    bst_vec3 a = bst_mat3_transpose_mul_vec(&before.itrf_from_gcrf, ground);
    bst_vec3 b = bst_mat3_transpose_mul_vec(&after.itrf_from_gcrf, ground);
    bst_vec3 moved = bst_vec3_scale(bst_vec3_sub(b, a), 0.1);
    bst_vec3 now = bst_mat3_transpose_mul_vec(&f.itrf_from_gcrf, ground);
    bst_vec3 velocity = bst_vec3_cross(bst_astro_earth_rate_gcrf(&f), now);
    /* Central difference: (7.3e-5 * 5)^2 / 6 of 365 m/s is 8e-6; precession 4e-5; length of day
     * 1.5e-8 of 365 m/s. */
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(velocity, moved)), 0.0, 1e-4);
    bst_astro_eop_free(eop);
}

static void builtin_table_holds_the_published_values(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = builtin(), *file = NULL;
    bst_astro_eop_values v, w;
    /* the row of 2022-06-16 of IERS EOP 20 C04 */
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, utc("2022-06-16T00:00:00Z"), &v));
    bst_assert_close(v.xp_rad / BST_ARCSEC_RAD, 0.189230, 1e-9); /* digits printed: 1e-6 */
    bst_assert_close(v.yp_rad / BST_ARCSEC_RAD, 0.478013, 1e-9);
    bst_assert_close(v.ut1_minus_utc_s, -0.0847385, 1e-10);
    bst_assert_ok(&ctx, bst_astro_eop_load(&ctx, "tests/astro/data/eopc04_20_2022-06.txt", &file));
    bst_time t = utc("2022-06-12T07:08:09Z");
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, t, &v));
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, file, t, &w));
    bst_assert_close(v.ut1_minus_utc_s, w.ut1_minus_utc_s, 1e-15); /* the same numbers */
    bst_assert_close(v.xp_rad, w.xp_rad, 1e-20);
    bst_assert_close(v.yp_rad, w.yp_rad, 1e-20);
    bst_astro_eop_free(file);
    bst_astro_eop_free(eop);
    bst_astro_eop_free(NULL);
}

static void earth_turns_evenly_through_a_leap_second(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_load(&ctx, "tests/astro/data/eopc04_14_2016-12.txt", &eop));
    bst_astro_eop_values v;
    /* rows of 2016-12-31 and 2017-01-01: -0.4077492 and +0.5912977 s, a step of one leap second */
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, utc("2016-12-31T12:00:00Z"), &v));
    assert_true(v.ut1_minus_utc_s < -0.4 && v.ut1_minus_utc_s > -0.42);
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, utc("2017-01-01T12:00:00Z"), &v));
    assert_true(v.ut1_minus_utc_s > 0.58 && v.ut1_minus_utc_s < 0.6);

    bst_time start = utc("2016-12-31T23:59:57Z");
    bst_astro_earth_frames last = frames_at(eop, start);
    for (int i = 1; i < 28; i++) {
        bst_astro_earth_frames next = frames_at(eop, bst_time_add(start, 0.25 * i));
        bst_mat3 back = bst_mat3_transpose(&last.itrf_from_gcrf);
        bst_mat3 turn = bst_mat3_mul(&next.itrf_from_gcrf, &back);
        double angle = atan2(turn.m[0][1], turn.m[0][0]);
        /* Earth rotation angle: 2 pi * 1.00273781191135448 / 86400 rad/s; the length of day is off
         * by 2e-8, and interpolation may bend at 0h by one second in a day of 1e-3 s */
        bst_assert_close(angle, 0.25 * 7.292115146706979e-5, 2e-12);
        last = next;
    }
    bst_astro_eop_free(eop);
}

static void outside_the_table_is_an_error(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = builtin();
    bst_astro_eop_values v;
    bst_astro_earth_frames frames;
    assert_int_equal(bst_astro_eop_at(&ctx, eop, utc("2019-12-31T23:59:59Z"), &v), BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message,
                           "2019-12-31T23:59:59Z is outside the Earth-orientation table, which "
                           "covers 2020-01-01 to 2026-01-01 0h UTC and is continued for 30 "
                           "years"));
    bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, utc("2056-01-01T11:59:59Z"), &frames));
    assert_int_equal(bst_astro_earth_frames_at(&ctx, eop, utc("2056-01-01T12:00:01Z"), &frames),
                     BST_ERR_RANGE);
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, utc("2020-01-01T00:00:00Z"), &v));
    bst_assert_ok(&ctx,
                  bst_astro_eop_at(&ctx, eop, utc("2026-01-01T00:00:00Z"), &v)); /* last row */
    assert_int_equal(bst_astro_eop_at(&ctx, eop, (bst_time){NAN, 0.0}, &v), BST_ERR_RANGE);
    bst_astro_eop_free(eop);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(geostationary_positions_agree_with_astropy),
        cmocka_unit_test(rotations_are_rotations),
        cmocka_unit_test(earth_rate_turns_itrf),
        cmocka_unit_test(builtin_table_holds_the_published_values),
        cmocka_unit_test(earth_turns_evenly_through_a_leap_second),
        cmocka_unit_test(outside_the_table_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
