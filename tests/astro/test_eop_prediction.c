/* Earth orientation after the end of its table: what is predicted from a part of the C04 series
 * against the rest of it. */
#include "sim/astro/frames.h"
#include "sim/astro/frames_internal.h"

#include <stdlib.h>
#include <string.h>

#include "tests/test_support.h"

enum { FIRST = 58849, LAST = 61041 }; /* of the built-in table, 2020-01-01 and 2026-01-01 */

/* No leap second since 2017. */
static bst_time midnight(int mjd) {
    bst_ctx ctx = {0};
    bst_time t;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2020-01-01T00:00:00Z", &t));
    return bst_time_add(t, 86400.0 * (mjd - FIRST));
}

/* The rows of `table` from one day to another, as a table of its own. */
static bst_astro_eop *part_of(const bst_astro_eop *table, int first, int last) {
    enum { ROW = 80 };
    bst_ctx ctx = {0};
    size_t room = (size_t)(last - first + 1) * ROW + 1, used = 0;
    char *text = malloc(room);
    assert_non_null(text);
    for (int mjd = first; mjd <= last; mjd++) {
        bst_astro_eop_values v;
        char utc[40];
        bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, table, midnight(mjd), &v));
        bst_time_to_utc(midnight(mjd), 0, utc, sizeof utc);
        used += (size_t)snprintf(text + used, room - used, "%.4s %.2s %.2s %d %.6f %.6f %.7f 0\n",
                                 utc, utc + 5, utc + 8, mjd, v.xp_rad / BST_ARCSEC_RAD,
                                 v.yp_rad / BST_ARCSEC_RAD, v.ut1_minus_utc_s);
        assert_true(used < room - 1);
    }
    bst_astro_eop *out = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_read_buffer(&ctx, "part", text, used, &out));
    free(text);
    return out;
}

typedef struct tally {
    int all, outside;
    double worst, sum2; /* of error over stated uncertainty */
} tally;

static void count(tally *t, double error, double stated) {
    double ratio = fabs(error) / stated;
    t->all++;
    t->outside += ratio > 1.0;
    t->worst = fmax(t->worst, ratio);
    t->sum2 += ratio * ratio;
}

/* Tables cut every 30 days from 2023 on, each against all days that follow. */
static void predictions_keep_their_uncertainty(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *whole = NULL;
    tally ut1 = {0}, pole = {0};
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &whole));
    for (int last = FIRST + 3 * 365; last < LAST - 30; last += 30) {
        bst_astro_eop *cut = part_of(whole, FIRST, last);
        for (int mjd = last + 1; mjd <= LAST; mjd += 3) {
            bst_astro_eop_values is, was;
            bst_astro_eop_uncertainty u;
            bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, whole, midnight(mjd), &is));
            bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, cut, midnight(mjd), &was));
            assert_true(bst_astro_eop_uncertainty_at(cut, midnight(mjd), &u));
            bst_assert_close(u.days, mjd - last, 1e-9);
            count(&ut1, was.ut1_minus_utc_s - is.ut1_minus_utc_s, u.ut1_s);
            count(&pole, (was.xp_rad - is.xp_rad) / BST_ARCSEC_RAD, u.pole_arcsec);
            count(&pole, (was.yp_rad - is.yp_rad) / BST_ARCSEC_RAD, u.pole_arcsec);
        }
        bst_astro_eop_free(cut);
    }
    const tally *both[] = {&ut1, &pole};
    for (int i = 0; i < 2; i++) {
        double rms = sqrt(both[i]->sum2 / both[i]->all);
        print_message("%s: %d values, %d outside, worst %.2f, rms %.2f of the stated uncertainty\n",
                      i ? "pole" : "UT1", both[i]->all, both[i]->outside, both[i]->worst, rms);
        /* 95 % are inside by calibration over 40 years; these cuts overlap, so that one bad year
         * weighs: at most a tenth outside, and none by far */
        assert_true(both[i]->outside <= both[i]->all / 10);
        assert_true(both[i]->worst < 2.0);
        /* and the uncertainty is not true by being huge: 0.4 where it is 2.5 times the rms */
        assert_true(rms > 0.2);
    }
    bst_astro_eop_free(whole);
}

static void goes_on_where_the_table_ends(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_astro_eop_values end, after, day;
    bst_astro_eop_uncertainty u;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, midnight(LAST), &end));
    assert_false(bst_astro_eop_uncertainty_at(eop, midnight(LAST), &u));
    bst_time next = bst_time_add(midnight(LAST), 1e-3);
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, next, &after));
    assert_true(bst_astro_eop_uncertainty_at(eop, next, &u));
    /* a millisecond of rates that are below 3 ms and 10 mas a day */
    bst_assert_close(after.ut1_minus_utc_s, end.ut1_minus_utc_s, 1e-10);
    bst_assert_close(after.xp_rad, end.xp_rad, 1e-9 * BST_ARCSEC_RAD);
    bst_assert_close(after.yp_rad, end.yp_rad, 1e-9 * BST_ARCSEC_RAD);
    bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, eop, midnight(LAST + 1), &day));
    bst_assert_close(day.ut1_minus_utc_s, end.ut1_minus_utc_s, 3e-3);
    bst_assert_close(day.xp_rad, end.xp_rad, 10e-3 * BST_ARCSEC_RAD);
    bst_assert_close(day.yp_rad, end.yp_rad, 10e-3 * BST_ARCSEC_RAD);
    bst_astro_eop_free(eop);
}

/* The uncertainty grows, and covers what is physically possible: the pole of a century is within
 * 0.8 arcsec, the length of the day has been within 4 ms of 86400 s since 1900. */
static void far_dates(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *whole = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &whole));
    bst_astro_eop *two = part_of(whole, LAST - 1, LAST);
    const bst_astro_eop *tables[] = {whole, two};
    for (int i = 0; i < 2; i++) {
        bst_astro_eop_uncertainty before = {0}, u;
        for (int days = 1; days < 10950; days += 50) {
            bst_astro_eop_values v;
            bst_assert_ok(&ctx, bst_astro_eop_at(&ctx, tables[i], midnight(LAST + days), &v));
            assert_true(bst_astro_eop_uncertainty_at(tables[i], midnight(LAST + days), &u));
            assert_true(u.ut1_s > before.ut1_s && u.pole_arcsec >= before.pole_arcsec);
            assert_true(hypot(v.xp_rad, v.yp_rad) < 0.8 * BST_ARCSEC_RAD);
            assert_true(fabs(v.ut1_minus_utc_s) < 0.9 + 0.004 * days);
            before = u;
        }
    }
    /* 2030 is four years on: rms 0.5715 s and 0.0466 arcsec over 40 years of predictions, times
     * 2.5 */
    bst_astro_eop_uncertainty u;
    assert_true(bst_astro_eop_uncertainty_at(whole, midnight(LAST + 1461), &u));
    bst_assert_close(u.ut1_s, 2.5 * 0.5715, 1e-9);
    bst_assert_close(u.pole_arcsec, 2.5 * 0.0466, 1e-9);
    bst_astro_eop_free(two);
    bst_astro_eop_free(whole);
}

static char said[400];

static void listen(void *user, bst_log_level level, const char *message) {
    (void)user;
    assert_int_equal(level, BST_LOG_WARNING);
    snprintf(said, sizeof said, "%s", message);
}

static void the_warning_states_the_uncertainty(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_astro_eop *eop = NULL;
    bst_ctx_init(&ctx, listen, NULL, BST_LOG_WARNING);
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_astro_eop_warn(&ctx, eop, midnight(LAST), "here: ");
    assert_string_equal(said, "");
    bst_astro_eop_warn(&ctx, eop, midnight(LAST + 1461), "here: ");
    assert_string_equal(said,
                        "here: the Earth-orientation table ends on 2026-01-01, 1461 days earlier: "
                        "UT1 is predicted to within 1429 ms (21 arcsec of the Earth's rotation), "
                        "the pole to within 0.12 arcsec (95 %); leap seconds after the last one "
                        "announced are not known");
    bst_astro_eop_free(eop);
}

/* UT2 - UT1 by its conventional terms, s (IERS Bulletin A). */
static double seasons_s(double mjd) {
    double x = 2.0 * BST_PI * (mjd - 51544.03) / 365.2422;
    return 0.022 * sin(x) - 0.012 * cos(x) - 0.006 * sin(2.0 * x) + 0.007 * cos(2.0 * x);
}

/* A day that lengthens by -0.8 ms, the mean of decades, with seasons, and a pole that stays beside
 * the secular one go on as they are: x and y, and all seasons. */
static void seasons_and_pole_go_on(void **state) {
    (void)state;
    enum { ROWS = 900 };
    static bst_astro_eop_values rows[ROWS];
    bst_ctx ctx = {0};
    bst_astro_eop_prediction p;
    static const double off[2] = {0.03, -0.02};
    for (int i = 0; i < ROWS; i++) {
        double mjd = FIRST + i, years = (mjd - 51544.5) / 365.25;
        rows[i].ut1_minus_utc_s = -0.1 - 0.0008 * i - seasons_s(mjd);
        rows[i].xp_rad = (0.0550 + 0.001677 * years + off[0]) * BST_ARCSEC_RAD;
        rows[i].yp_rad = (0.3205 + 0.003460 * years + off[1]) * BST_ARCSEC_RAD;
    }
    bst_assert_ok(&ctx, bst_astro_eop_prediction_fit(&ctx, FIRST, ROWS, rows, &p));
    for (int days = 1; days < 365; days += 40) {
        double mjd = FIRST + ROWS - 1 + days, years = (mjd - 51544.5) / 365.25;
        bst_astro_eop_values v;
        bst_astro_eop_prediction_at(&p, mjd, &v);
        bst_assert_close(v.ut1_minus_utc_s, -0.1 - 0.0008 * (ROWS - 1 + days) - seasons_s(mjd),
                         1e-9);
        /* priors of 0.05 arcsec and more beside the rows of two years: 1e-4 */
        bst_assert_close(v.xp_rad / BST_ARCSEC_RAD, 0.0550 + 0.001677 * years + off[0], 2e-4);
        bst_assert_close(v.yp_rad / BST_ARCSEC_RAD, 0.3205 + 0.003460 * years + off[1], 2e-4);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(seasons_and_pole_go_on),
        cmocka_unit_test(predictions_keep_their_uncertainty),
        cmocka_unit_test(goes_on_where_the_table_ends),
        cmocka_unit_test(far_dates),
        cmocka_unit_test(the_warning_states_the_uncertainty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
