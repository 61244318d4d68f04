/* Predicts Earth orientation after the end of its table. */
#include <erfa.h>
#include <erfam.h>

#include "sim/astro/frames_internal.h"
#include "sim/core/cholesky.h"

/* annual and Chandler period, days (IERS Bulletin A) */
static const double PERIODS[2] = {365.25, 435.0};
/* decay time of the difference between the last row and the fit, days */
static const double FADE_DAYS = 60.0;
/* Weight of a row in the fit of the pole: exp(-age / this), days; rows older than MOST_ROWS are
 * ignored. */
static const double MEMORY_DAYS = 730.5;
enum { TERMS = 5, MOST_ROWS = 2190, RATE_ROWS = 180 };
/* Prior standard deviations of the pole's terms, arcsec: offset of the mean pole; cosine and sine,
 * annual and Chandler; and of a row. */
static const double PRIOR_ARCSEC[TERMS] = {0.05, 0.1, 0.1, 0.2, 0.2};
static const double ROW_ARCSEC = 0.05;
/* Long-term rate of UT1-TAI without seasonal terms, s/day (1972 to 2020), and its weight in days of
 * the table's own rate. Rates above MOST_RATE are rejected (1962 to 2025: 4 ms). */
static const double MEAN_RATE = -0.0008, MEAN_RATE_DAYS = 20.0, MOST_RATE = 0.01;

/* The secular pole of the IERS (Conventions 2010, version 1.2.0, eq. 21), arcsec. */
static void secular_pole(double mjd, double out[2]) {
    double years = (mjd - 51544.5) / 365.25;
    out[0] = 0.0550 + 0.001677 * years;
    out[1] = 0.3205 + 0.003460 * years;
}

/* UT1 - UT2: conventional seasonal terms of the Earth's rotation, s (IERS Bulletin A; Explanatory
 * Supplement to the Astronomical Almanac 1992, 2.582). */
static double seasons_s(double mjd) {
    double x = ERFA_D2PI * (mjd - 51544.03) / 365.2422;
    return -(0.022 * sin(x) - 0.012 * cos(x) - 0.006 * sin(2.0 * x) + 0.007 * cos(2.0 * x));
}

/* Terms of the polar motion model: constant and two periodic pairs. */
static void terms_at(double days, double out[TERMS]) {
    out[0] = 1.0;
    for (int i = 0; i < 2; i++) {
        double x = ERFA_D2PI * days / PERIODS[i];
        out[1 + 2 * i] = cos(x);
        out[2 + 2 * i] = sin(x);
    }
}

/* Pole coordinate x or y in arcsec. */
static double pole_of(const bst_astro_eop_values *row, int axis) {
    return (axis ? row->yp_rad : row->xp_rad) / BST_ARCSEC_RAD;
}

static bool fit_pole(int first_mjd, int count, const bst_astro_eop_values *rows,
                     bst_astro_eop_prediction *out) {
    double n[TERMS][TERMS] = {{0}}, b[2][TERMS] = {{0}}, a[TERMS], mean[2];
    int last = count - 1, first = count > MOST_ROWS ? count - MOST_ROWS : 0;
    for (int k = 0; k < TERMS; k++) {
        n[k][k] = 1.0 / (PRIOR_ARCSEC[k] * PRIOR_ARCSEC[k]);
    }
    for (int i = first; i < count; i++) {
        double weight = exp(2.0 * (i - last) / MEMORY_DAYS) / (ROW_ARCSEC * ROW_ARCSEC);
        terms_at(i - last, a);
        secular_pole(first_mjd + i, mean);
        for (int k = 0; k < TERMS; k++) {
            for (int l = 0; l <= k; l++) {
                n[k][l] += weight * a[k] * a[l];
            }
            for (int axis = 0; axis < 2; axis++) {
                b[axis][k] += weight * a[k] * (pole_of(&rows[i], axis) - mean[axis]);
            }
        }
    }
    if (!bst_cholesky_factor(n[0], TERMS, TERMS, 0.0)) {
        return false;
    }
    terms_at(0.0, a);
    secular_pole(out->last_mjd, mean);
    for (int axis = 0; axis < 2; axis++) {
        bst_cholesky_solve(n[0], TERMS, TERMS, b[axis]);
        out->rest_arcsec[axis] = pole_of(&rows[last], axis) - mean[axis];
        for (int k = 0; k < TERMS; k++) {
            out->terms_arcsec[axis][k] = b[axis][k];
            out->rest_arcsec[axis] -= a[k] * b[axis][k];
        }
    }
    return true;
}

/* Rate of UT1-TAI without seasonal terms, s/day: least squares over the last rows. */
static double rate_of(int first_mjd, int count, const bst_astro_eop_values *rows) {
    int rows_used = count < RATE_ROWS + 1 ? count : RATE_ROWS + 1, last = count - 1;
    double middle = -0.5 * (rows_used - 1), sum_tt = 0.0, sum_ty = 0.0, y = 0.0;
    for (int back = 0; back < rows_used; back++) {
        int i = last - back;
        if (back > 0) { /* removes leap seconds */
            double step = rows[i + 1].ut1_minus_utc_s - rows[i].ut1_minus_utc_s;
            y -= step - round(step);
        }
        double t = -back - middle;
        sum_tt += t * t;
        sum_ty += t * (y - seasons_s(first_mjd + i));
    }
    double span = rows_used - 1;
    double rate = (sum_ty / sum_tt * span + MEAN_RATE * MEAN_RATE_DAYS) / (span + MEAN_RATE_DAYS);
    return fmax(-MOST_RATE, fmin(MOST_RATE, rate));
}

/* TAI-UTC on a day; after ERFA's tables the last known value. */
static double tai_minus_utc_s(double mjd) {
    int year, month, day;
    double fraction, seconds = 0.0;
    if (eraJd2cal(ERFA_DJM0, mjd, &year, &month, &day, &fraction) != 0 ||
        eraDat(year, month, day, fraction, &seconds) < 0) {
        return 0.0;
    }
    return seconds;
}

bst_status bst_astro_eop_prediction_fit(bst_ctx *ctx, int first_mjd, int count,
                                        const bst_astro_eop_values *rows,
                                        bst_astro_eop_prediction *out) {
    *out = (bst_astro_eop_prediction){.last_mjd = first_mjd + count - 1, .rows = count};
    out->ut1_minus_tai_s = rows[count - 1].ut1_minus_utc_s - tai_minus_utc_s(out->last_mjd);
    out->rate_s_per_day = rate_of(first_mjd, count, rows);
    return fit_pole(first_mjd, count, rows, out)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_NUMERIC,
                          "the pole of the Earth-orientation table cannot be "
                          "continued: its values are no numbers");
}

void bst_astro_eop_prediction_at(const bst_astro_eop_prediction *p, double mjd,
                                 bst_astro_eop_values *out) {
    double days = mjd - p->last_mjd, a[TERMS], mean[2], pole[2];
    terms_at(days, a);
    secular_pole(mjd, mean);
    for (int axis = 0; axis < 2; axis++) {
        pole[axis] = mean[axis] + p->rest_arcsec[axis] * exp(-days / FADE_DAYS);
        for (int k = 0; k < TERMS; k++) {
            pole[axis] += a[k] * p->terms_arcsec[axis][k];
        }
    }
    out->xp_rad = pole[0] * BST_ARCSEC_RAD;
    out->yp_rad = pole[1] * BST_ARCSEC_RAD;
    out->ut1_minus_utc_s = p->ut1_minus_tai_s + p->rate_s_per_day * days + seasons_s(mjd) -
                           seasons_s(p->last_mjd) + tai_minus_utc_s(floor(mjd));
}

/* Root mean squares of the errors over 99 predictions made from the C04 series of 1982 to 2022,
 * by tests/astro/calibrate_eop_prediction.py; interpolated in logarithms. */
static const struct {
    double days, ut1_s, pole_arcsec;
} ERRORS[] = {{1.0, 0.0004, 0.0007},    {3.0, 0.0012, 0.0019},   {10.0, 0.0027, 0.0051},
              {30.0, 0.0060, 0.0114},   {90.0, 0.0162, 0.0221},  {180.0, 0.0345, 0.0241},
              {365.0, 0.0801, 0.0282},  {730.0, 0.2034, 0.0380}, {1095.0, 0.3724, 0.0457},
              {1461.0, 0.5715, 0.0466}, {1825.0, 0.8050, 0.0477}};
enum { ERROR_ROWS = sizeof ERRORS / sizeof *ERRORS };
/* minimum rows for the pole's two periods, and for the rate of UT1 */
enum { POLE_ROWS = 730, UT1_ROWS = 60 };
/* ratio of stated uncertainty to RMS: covers 98 % of those predictions, and 95 % of those for 2023
 * to 2025, when the Chandler wobble had almost vanished */
static const double STATED = 2.5;
static const double SHORT_POLE_ARCSEC = 0.12, SHORT_UT1 = 3.0;

void bst_astro_eop_prediction_error(const bst_astro_eop_prediction *p, double mjd,
                                    bst_astro_eop_uncertainty *out) {
    double days = fmax(mjd - p->last_mjd, 0.0), x = log(fmax(days, ERRORS[0].days));
    int i = 0;
    while (i < ERROR_ROWS - 2 && days > ERRORS[i + 1].days) {
        i++;
    }
    /* interpolates log(error) over log(days) */
    double f = (x - log(ERRORS[i].days)) / log(ERRORS[i + 1].days / ERRORS[i].days);
    double ut1 = ERRORS[i].ut1_s * pow(ERRORS[i + 1].ut1_s / ERRORS[i].ut1_s, f);
    double pole = ERRORS[i].pole_arcsec *
                  pow(ERRORS[i + 1].pole_arcsec / ERRORS[i].pole_arcsec, fmin(f, 1.0));
    out->days = days;
    out->ut1_s = STATED * ut1 * (p->rows < UT1_ROWS ? SHORT_UT1 : 1.0);
    out->pole_arcsec = STATED * (p->rows < POLE_ROWS ? fmax(pole, SHORT_POLE_ARCSEC) : pole);
}
