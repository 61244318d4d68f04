/* Queries of the embedded star catalogue: against brute force, published stars, and ERFA's motion.
 */
#include "tests/test_support.h"

#include <erfa.h>
#include <stdlib.h>

#include "sim/catalogue/star_index.h"
#include "sim/catalogue/stars.h"

#define YEAR 2022.46

typedef struct fixture {
    bst_ctx ctx;
    bst_stars *stars;
    bst_star *all; /* the whole sky at YEAR */
    int count;
    bst_star *out;
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    if (!f || bst_stars_open(&f->ctx, "embedded", &f->stars) != BST_OK) {
        return -1;
    }
    bst_stars_info info;
    bst_stars_get_info(f->stars, &info);
    f->all = malloc((size_t)info.count * sizeof *f->all);
    f->out = malloc((size_t)info.count * sizeof *f->out);
    *state = f;
    return f->all && f->out &&
                   bst_stars_query(&f->ctx, f->stars, (bst_vec3){0, 0, 1}, BST_PI, INFINITY, YEAR,
                                   f->all, (int)info.count, &f->count) == BST_OK &&
                   f->count == info.count
               ? 0
               : -1;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_stars_close(f->stars);
    free(f->all);
    free(f->out);
    free(f);
    return 0;
}

static bst_vec3 at_deg(double ra, double dec) {
    return bst_vec3_from_radec(ra * BST_DEG_RAD, dec * BST_DEG_RAD);
}

/* The same stars in the same order as a search through all of them. */
static void compare_with_brute_force(fixture *f, bst_vec3 centre, double radius, double v_limit) {
    int count = 0, expected = 0;
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, centre, radius, v_limit, YEAR, f->out,
                                           f->count, &count));
    for (int i = 0; i < f->count; i++) {
        const bst_star *s = &f->all[i];
        /* The margin is the rounding of a magnitude to float; no catalogue value lies in it but
         * those on the limit itself. */
        if (s->v_mag <= v_limit + 1e-6 && bst_vec3_angle(s->icrs, centre) <= radius) {
            assert_true(expected < count);
            assert_memory_equal(&f->out[expected].icrs, &s->icrs, sizeof s->icrs);
            assert_int_equal(f->out[expected].id, s->id);
            expected++;
        }
    }
    assert_int_equal(count, expected);
}

static void test_cones_equal_brute_force(void **state) {
    static const double places[][2] = {
        {0.0, 90.0},   {123.0, 90.0}, {0.0, -90.0},  {40.0, 89.3},    {200.0, -89.9},
        {0.0, 0.0},    {359.99, 5.0}, {0.01, -40.0}, {180.0, 60.0},   {266.4, -29.0},
        {254.0, -8.0}, {269.45, 4.7}, {90.0, 88.0},  {315.2, -87.41},
    };
    static const double radii_deg[] = {0.05, 1.06, 3.0, 12.0};
    for (size_t p = 0; p < sizeof places / sizeof places[0]; p++) {
        for (size_t r = 0; r < 4; r++) {
            compare_with_brute_force(*state, at_deg(places[p][0], places[p][1]),
                                     radii_deg[r] * BST_DEG_RAD, 8.7);
            compare_with_brute_force(*state, at_deg(places[p][0], places[p][1]),
                                     radii_deg[r] * BST_DEG_RAD, INFINITY);
        }
    }
    compare_with_brute_force(*state, at_deg(77.0, 12.0), 100.0 * BST_DEG_RAD, 6.0);
    compare_with_brute_force(*state, at_deg(77.0, -80.0), 179.0 * BST_DEG_RAD, 7.0);
}

static void test_radius_zero_and_pi(void **state) {
    fixture *f = *state;
    int count = -1;
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, at_deg(10.0, 10.0), 0.0, 20.0, YEAR,
                                           f->out, f->count, &count));
    assert_int_equal(count, 0);
    /* A cone of no width around a star's very direction holds that star and nothing that lies
     * elsewhere; stars in all parts of the index. */
    for (int i = 0; i < f->count; i += 17) {
        bool is_there = false;
        bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, f->all[i].icrs, 0.0, INFINITY,
                                               YEAR, f->out, f->count, &count));
        for (int k = 0; k < count; k++) {
            is_there = is_there || f->out[k].id == f->all[i].id;
            assert_memory_equal(&f->out[k].icrs, &f->all[i].icrs, sizeof f->out[k].icrs);
        }
        assert_true(is_there);
    }
    /* The whole sky from any place, the antipode of a star included. */
    bst_vec3 antipode = bst_vec3_scale(f->all[0].icrs, -1.0);
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, antipode, BST_PI, INFINITY, YEAR,
                                           NULL, 0, &count));
    assert_int_equal(count, f->count);
}

static void test_capacity_overflow_is_counted(void **state) {
    fixture *f = *state;
    bst_star few[8];
    int count = 0, count_few = 0;
    bst_vec3 centre = at_deg(266.4, -29.0);
    memset(few, 0xA5, sizeof few);
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, centre, 0.01, INFINITY, YEAR, f->out,
                                           f->count, &count));
    bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, centre, 0.01, INFINITY, YEAR, few, 7,
                                           &count_few));
    assert_true(count > 7);
    assert_int_equal(count_few, count);
    for (int i = 0; i < 7; i++) {
        assert_int_equal(few[i].id, f->out[i].id);
    }
    bst_star untouched;
    memset(&untouched, 0xA5, sizeof untouched);
    assert_memory_equal(&few[7], &untouched, sizeof untouched);
}

static void test_order_within_cells(void **state) {
    fixture *f = *state;
    for (int i = 1; i < f->count; i++) {
        const bst_star *a = &f->all[i - 1], *b = &f->all[i];
        if (a->id >> 16 == b->id >> 16) {
            assert_true(a->v_mag < b->v_mag || (a->v_mag == b->v_mag && a->id <= b->id));
        } else {
            assert_true(a->id >> 16 < b->id >> 16);
        }
    }
}

/* Measured once from the catalogue by another program in double precision, whose rounding drops
 * the stars whose V is the limit to the digit: those are the difference between the two counts. */
static void test_counts_per_magnitude(void **state) {
    fixture *f = *state;
    /* companions whose light is in the published V of their primaries (bright_stars_table.inc) */
    enum { DARK = 4 };
    static const struct {
        double v;
        int count;
    } known[] = {{6.0, 5028 - DARK}, {8.0, 45631 - DARK}, {9.0, 130727 - DARK}};
    for (size_t i = 0; i < 3; i++) {
        int below = 0, within = 0;
        bst_vec3 pole = {0, 0, 1};
        bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, pole, BST_PI, known[i].v - 5e-6,
                                               YEAR, NULL, 0, &below));
        bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, pole, BST_PI, known[i].v, YEAR,
                                               NULL, 0, &within));
        assert_in_range(known[i].count, below, within);
        assert_true(within - below <= 3);
    }
}

static void test_bright_stars_stand_where_published(void **state) {
    fixture *f = *state;
    /* Directions at epoch J2000 in ICRS and V as in the SIMBAD database, which takes them from the
     * new reduction of the Hipparcos data (van Leeuwen 2007), not from Tycho-2.
     * Positions: the two reductions differ by up to 20 mas at J2000 for single stars; Procyon and
     * Sirius have companions (50 mas); Polaris has no proper motion in Tycho-2 and stands where it
     * was in 1991 (46 mas/yr for 8.75 years); Barnard's star is 0.40 arcsec off in Tycho-2 itself,
     * which fits a straight line to a century of plates on which its motion was speeding up.
     * V: the formula for V is approximate by 0.05 mag; Betelgeuse varies; Hp in place of VT errs by
     * 0.1 mag, by 0.3 for Sirius, which is above that detector's range. */
    static const struct {
        const char *name;
        double h, m, s, sign, deg, min, sec, v;
        double position_arcsec, v_tolerance;
    } known[] = {
        {"Sirius", 6, 45, 8.91728, -1, 16, 42, 58.0171, -1.46, 0.05, 0.33},
        {"Vega", 18, 36, 56.33635, 1, 38, 47, 1.2802, 0.03, 0.02, 0.05},
        {"Arcturus", 14, 15, 39.67207, 1, 19, 10, 56.6730, -0.05, 0.02, 0.16},
        {"Canopus", 6, 23, 57.10988, -1, 52, 41, 44.3810, -0.74, 0.02, 0.15},
        {"Rigel", 5, 14, 32.27210, -1, 8, 12, 5.8981, 0.13, 0.02, 0.16},
        {"Betelgeuse", 5, 55, 10.30536, 1, 7, 24, 25.4304, 0.42, 0.05, 0.30},
        {"Procyon", 7, 39, 18.11950, 1, 5, 13, 29.9552, 0.37, 0.05, 0.10},
        {"Polaris", 2, 31, 49.09456, 1, 89, 15, 50.7923, 2.02, 0.45, 0.05},
        {"Barnard's star", 17, 57, 48.49803, 1, 4, 41, 36.2072, 9.51, 0.45, 0.15},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        bst_vec3 u =
            at_deg(15.0 * (known[i].h + known[i].m / 60.0 + known[i].s / 3600.0),
                   known[i].sign * (known[i].deg + known[i].min / 60.0 + known[i].sec / 3600.0));
        int count = 0;
        bst_assert_ok(&f->ctx, bst_stars_query(&f->ctx, f->stars, u,
                                               known[i].position_arcsec * BST_ARCSEC_RAD,
                                               known[i].v + 0.5, 2000.0, f->out, f->count, &count));
        if (count != 1) {
            fail_msg("%s: %d stars within %g arcsec", known[i].name, count,
                     known[i].position_arcsec);
        }
        if (fabs(f->out[0].v_mag - known[i].v) > known[i].v_tolerance) {
            fail_msg("%s: V %g, published %g", known[i].name, (double)f->out[0].v_mag, known[i].v);
        }
    }
}

static void test_colours(void **state) {
    fixture *f = *state;
    bst_star star;
    /* zeta Persei is not in the table of bright stars: V = VT - 0.090 (BT - VT), B-V = 0.850 (BT -
     * VT); float rounding. */
    bst_assert_ok(
        &f->ctx, bst_stars_find(&f->ctx, f->stars, bst_star_id_make(2361, 2820, 1), 2000.0, &star));
    bst_assert_close(star.v_mag, 2.858 - 0.090 * 0.097, 1e-6);
    bst_assert_close(star.b_minus_v, 0.850 * 0.097, 1e-7);
}

static void test_motion_is_erfas(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static const double places[][2] = {{0.0, 0.0}, {101.3, -16.7}, {250.0, 60.0}, {359.999, 89.3}};
    static const int motions[][2] = {{0, 0}, {-5460, -12231}, {-7988, 102773}, {65442, -57743}};
    const double unit = 1e-4 * BST_ARCSEC_RAD;
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < 4; j++) {
            bst_star_values v = {.ra_rad = places[i][0] * BST_DEG_RAD,
                                 .dec_rad = places[i][1] * BST_DEG_RAD,
                                 .pm_ra_cosdec = motions[j][0],
                                 .pm_dec = motions[j][1]};
            bst_star_record record;
            bst_assert_ok(&ctx, bst_star_pack(&ctx, &v, &record));
            bst_vec3 u = bst_star_record_direction(&record, 35.0);
            double ra, dec, pm_ra, pm_dec, parallax, rv;
            /* At 1 parsec, so that the speed is an ordinary one. */
            int warn = eraStarpm(v.ra_rad, v.dec_rad, v.pm_ra_cosdec * unit / cos(v.dec_rad),
                                 v.pm_dec * unit, 1.0, 0.0, 2451545.0, 0.0, 2451545.0,
                                 35.0 * 365.25, &ra, &dec, &pm_ra, &pm_dec, &parallax, &rv);
            assert_int_equal(warn, 0);
            /* 0.21 mas: half a unit of 0.30 mas in both stored angles; 0.03 mas: light time. */
            bst_assert_close(bst_vec3_angle(u, bst_vec3_from_radec(ra, dec)) / BST_ARCSEC_RAD, 0.0,
                             0.24e-3);
        }
    }
}

/* A row of a table that is moved to another epoch, with its motion in the axes there. */
static void test_row_moves_as_erfa_says(void **state) {
    (void)state;
    static const double places[][2] = {{0.003, -37.0}, {101.3, -16.7}, {250.0, 60.0}, {88.0, 89.2}};
    static const int motions[][2] = {{0, 0}, {-5460, -12231}, {-7988, 102773}, {65442, -57743}};
    const double unit = 1e-4 * BST_ARCSEC_RAD;
    for (int i = 0; i < 16; i++) {
        bst_star_values v = {.ra_rad = places[i / 4][0] * BST_DEG_RAD,
                             .dec_rad = places[i / 4][1] * BST_DEG_RAD,
                             .pm_ra_cosdec = motions[i % 4][0],
                             .pm_dec = motions[i % 4][1]};
        double years = i % 2 ? -40.0 : 25.5, ra, dec, pm_ra, pm_dec, parallax, rv;
        int warn = eraStarpm(v.ra_rad, v.dec_rad, v.pm_ra_cosdec * unit / cos(v.dec_rad),
                             v.pm_dec * unit, 1.0, 0.0, 2451545.0, 0.0, 2451545.0, years * 365.25,
                             &ra, &dec, &pm_ra, &pm_dec, &parallax, &rv);
        assert_int_equal(warn, 0);
        bst_star_move_epoch(&v, years);
        bst_vec3 found = bst_vec3_from_radec(v.ra_rad, v.dec_rad);
        /* 0.03 mas: light time; the motion is a whole number */
        bst_assert_close(bst_vec3_angle(found, bst_vec3_from_radec(ra, dec)) / BST_ARCSEC_RAD, 0.0,
                         0.04e-3);
        bst_assert_close(v.pm_ra_cosdec, pm_ra * cos(dec) / unit, 1.0);
        bst_assert_close(v.pm_dec, pm_dec / unit, 1.0);
    }
}

static void test_find(void **state) {
    fixture *f = *state;
    bst_star star;
    unsigned a, b, c;
    for (int i = 0; i < f->count; i += 101) {
        bst_assert_ok(&f->ctx, bst_stars_find(&f->ctx, f->stars, f->all[i].id, YEAR, &star));
        assert_int_equal(star.id, f->all[i].id);
        bst_star_id_split(star.id, &a, &b, &c);
        assert_int_equal(bst_star_id_make(a, b, c), star.id);
        assert_true(star.v_mag <= f->all[i].v_mag);
    }
    assert_int_equal(
        bst_stars_find(&f->ctx, f->stars, bst_star_id_make(9537, 16000, 2), YEAR, &star),
        BST_ERR_NOT_FOUND);
    assert_string_equal(f->ctx.message, "star TYC 9537-16000-2 is not in the catalogue");
    assert_int_equal(bst_stars_find(&f->ctx, f->stars, UINT32_MAX, YEAR, &star), BST_ERR_NOT_FOUND);
}

static void test_bad_arguments(void **state) {
    fixture *f = *state;
    bst_vec3 u = {1, 0, 0};
    int count;
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, -0.1, 9, YEAR, f->out, 9, &count),
                     BST_ERR_ARGUMENT);
    assert_string_equal(
        f->ctx.message,
        "star query: radius -0.1 rad (0 to pi), limit V 9, year 2022.46, |centre| 1 "
        "(1), room for 9 stars");
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, NAN, 9, YEAR, f->out, 9, &count),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, 0.1, NAN, YEAR, f->out, 9, &count),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, 0.1, 9, INFINITY, f->out, 9, &count),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, 0.1, 9, YEAR, NULL, 9, &count),
                     BST_ERR_ARGUMENT);
    u.x = 1.1;
    assert_int_equal(bst_stars_query(&f->ctx, f->stars, u, 0.1, 9, YEAR, f->out, 9, &count),
                     BST_ERR_ARGUMENT);
}

static void test_embedded_says_how_far_it_goes(void **state) {
    fixture *f = *state;
    bst_stars_info info;
    bst_stars_get_info(f->stars, &info);
    assert_true(info.embedded);
    assert_string_equal(info.source, "embedded default");
    assert_string_equal(info.path, "");
    assert_true(info.complete_to_v_mag == 9.0);
    assert_int_equal(info.patches, 6);
    assert_true(bst_stars_complete_to(f->stars, at_deg(10.0, 10.0), 0.01) == 9.0);
    /* The field of the shipped scenarios with its search, at start and end; too wide a cone. */
    double wide = 2.5 * BST_DEG_RAD;
    assert_true(bst_stars_complete_to(f->stars, at_deg(252.166, -8.888), wide) == 12.0);
    assert_true(bst_stars_complete_to(f->stars, at_deg(255.993, -7.081), wide) == 12.0);
    assert_true(bst_stars_complete_to(f->stars, at_deg(255.993, -7.081), 3.2 * BST_DEG_RAD) == 9.0);
}

/* The brightest stars against the Bright Star Catalogue (5th edition) and, for Canopus and
 * Arcturus, Ducati 2002: independent of the table, but for the entries that it takes from them. */
static void bright_stars_have_their_published_magnitudes(void **state) {
    (void)state;
    static const struct {
        const char *name;
        unsigned tyc[3];
        double v, bv;
    } published[] = {
        {"Sirius", {5949, 2777, 1}, -1.46, 0.00},     {"Canopus", {8534, 2277, 1}, -0.74, 0.15},
        {"Arcturus", {1472, 1436, 1}, -0.05, 1.23},   {"alpha Cen A", {9007, 5849, 1}, -0.01, 0.71},
        {"alpha Cen B", {9007, 5848, 1}, 1.33, 0.88}, {"Vega", {3105, 2070, 1}, 0.03, 0.00},
        {"Capella", {3358, 3141, 1}, 0.08, 0.80},     {"Procyon", {187, 2184, 1}, 0.38, 0.42},
        {"Achernar", {8478, 1395, 1}, 0.46, -0.16},   {"Hadar", {9005, 3919, 1}, 0.61, -0.23},
        {"Altair", {1058, 3399, 1}, 0.77, 0.22},      {"Aldebaran", {1266, 1416, 1}, 0.85, 1.54},
        {"Spica", {5547, 1518, 1}, 0.98, -0.23},      {"Pollux", {1920, 2194, 1}, 1.14, 1.00},
        {"Fomalhaut", {6977, 1267, 1}, 1.16, 0.09},   {"Deneb", {3574, 3347, 1}, 1.25, 0.09},
        {"Regulus", {833, 1381, 1}, 1.35, -0.11},     {"Dubhe", {4146, 1274, 1}, 1.79, 1.07},
        {"Alhena", {1329, 1746, 1}, 1.93, 0.00},      {"Avior", {8579, 2692, 1}, 1.86, 1.28},
        {"Mintaka", {4766, 2445, 1}, 2.23, -0.22},    {"Rigel", {5331, 1752, 1}, 0.12, -0.03},
    };
    bst_ctx ctx = {0};
    bst_stars *stars;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    for (size_t k = 0; k < sizeof published / sizeof *published; k++) {
        bst_star star;
        uint32_t id =
            bst_star_id_make(published[k].tyc[0], published[k].tyc[1], published[k].tyc[2]);
        bst_assert_ok(&ctx, bst_stars_find(&ctx, stars, id, 2000.0, &star));
        /* photometry of different years and instruments; Avior is a pair of 0.4 arcsec */
        bst_assert_close((double)star.v_mag, published[k].v, 0.06);
        bst_assert_close((double)star.b_minus_v, published[k].bv, k == 19 ? 0.1 : 0.065);
    }
    const int room = 4000;
    bst_star *all = malloc((size_t)room * sizeof *all);
    assert_non_null(all);
    int count, bright = 0;
    bst_assert_ok(&ctx, bst_stars_query(&ctx, stars, bst_vec3_make(0, 0, 1), BST_PI, 4.0, 2000.0,
                                        all, room, &count));
    assert_true(count > 480 && count < room); /* the Bright Star Catalogue has 513 to V 4.00 */
    for (int i = 0; i < count; i++) {
        assert_true(isfinite(all[i].b_minus_v) != 0); /* all have a colour */
        assert_true(all[i].v_mag <= 4.0f);
        bright += all[i].v_mag < 1.5f;
    }
    assert_int_equal(bright, 22); /* as the Bright Star Catalogue, with alpha Cen B and Acrux A */
    free(all);
    bst_stars_close(stars);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bright_stars_have_their_published_magnitudes),
        cmocka_unit_test(test_cones_equal_brute_force),
        cmocka_unit_test(test_radius_zero_and_pi),
        cmocka_unit_test(test_capacity_overflow_is_counted),
        cmocka_unit_test(test_order_within_cells),
        cmocka_unit_test(test_counts_per_magnitude),
        cmocka_unit_test(test_bright_stars_stand_where_published),
        cmocka_unit_test(test_colours),
        cmocka_unit_test(test_motion_is_erfas),
        cmocka_unit_test(test_row_moves_as_erfa_says),
        cmocka_unit_test(test_find),
        cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_embedded_says_how_far_it_goes),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
