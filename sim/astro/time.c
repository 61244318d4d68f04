#include "sim/astro/time.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>

/* Start of UTC. ERFA checks the following day, and accepts the day before. */
#define FIRST_YEAR 1960
#define FIRST_JD 2436934.5
/* after ERFA's tables its known leap seconds hold; a later date is treated as a typing error */
#define LAST_YEAR 2099
#define END_JD 2488069.5 /* 2100-01-01 */

/* Normalises jd1 + jd2 to a midnight and a fraction in [0, 1). */
static bst_time normalised(double jd1, double jd2) {
    double midnight = floor(jd1 - 0.5) + 0.5;
    double fraction = (jd1 - midnight) + jd2;
    double days = floor(fraction);
    midnight += days;
    fraction -= days;
    if (fraction >= 1.0) { /* a tiny negative fraction may round to a whole day */
        midnight += 1.0;
        fraction = 0.0;
    }
    return (bst_time){midnight, fraction};
}

/* Parses exactly `digits` decimal digits; false: fewer. */
static bool read_digits(const char **text, int digits, int *value) {
    int v = 0;
    for (int i = 0; i < digits; i++) {
        char c = **text;
        if (c < '0' || c > '9') {
            return false;
        }
        v = 10 * v + (c - '0');
        (*text)++;
    }
    *value = v;
    return true;
}

static bool read_char(const char **text, char c) {
    if (**text != c) {
        return false;
    }
    (*text)++;
    return true;
}

/* Parses the digits after a decimal point; those beyond the 15th are ignored. */
static bool read_fraction(const char **text, double *value) {
    int64_t mantissa = 0, scale = 1;
    int digits = 0;
    while (**text >= '0' && **text <= '9') {
        if (digits < 15) {
            mantissa = 10 * mantissa + (**text - '0');
            scale *= 10;
        }
        digits++;
        (*text)++;
    }
    *value = (double)mantissa / (double)scale;
    return digits > 0;
}

typedef struct calendar {
    int year, month, day, hour, minute, second;
    double fraction;
} calendar;

static bool read_iso(const char *text, calendar *c) {
    c->fraction = 0.0;
    if (!(read_digits(&text, 4, &c->year) && read_char(&text, '-') &&
          read_digits(&text, 2, &c->month) && read_char(&text, '-') &&
          read_digits(&text, 2, &c->day) && read_char(&text, 'T') &&
          read_digits(&text, 2, &c->hour) && read_char(&text, ':') &&
          read_digits(&text, 2, &c->minute) && read_char(&text, ':') &&
          read_digits(&text, 2, &c->second))) {
        return false;
    }
    if (*text == '.') {
        text++;
        if (!read_fraction(&text, &c->fraction)) {
            return false;
        }
    }
    if (*text == 'Z') {
        text++;
    }
    return *text == '\0';
}

static bst_status fail_years(bst_ctx *ctx, const char *what) {
    return bst_fail(ctx, BST_ERR_RANGE,
                    "the time %s lies outside the years for which UTC is accepted, %d to %d", what,
                    FIRST_YEAR, LAST_YEAR);
}

bst_status bst_time_from_utc(bst_ctx *ctx, const char *iso, bst_time *out) {
    calendar c;
    if (!read_iso(iso, &c)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "\"%.60s\" is not a UTC time; write YYYY-MM-DDThh:mm:ss, then if wanted "
                        "decimals and Z, as in 2022-06-16T22:10:00.5Z",
                        iso);
    }
    double utc1, utc2, tai1, tai2;
    int status = eraDtf2d("UTC", c.year, c.month, c.day, c.hour, c.minute,
                          (double)c.second + c.fraction, &utc1, &utc2);
    switch (status) {
        case 0:
        case 1: /* a year after ERFA's tables */
            break;
        case -2:
            return bst_fail(ctx, BST_ERR_FORMAT, "\"%.60s\": month %02d is not in 01..12", iso,
                            c.month);
        case -3:
            return bst_fail(ctx, BST_ERR_FORMAT, "\"%.60s\": month %02d of %04d has no day %02d",
                            iso, c.month, c.year, c.day);
        case -4:
            return bst_fail(ctx, BST_ERR_FORMAT, "\"%.60s\": hour %02d is not in 00..23", iso,
                            c.hour);
        case -5:
            return bst_fail(ctx, BST_ERR_FORMAT, "\"%.60s\": minute %02d is not in 00..59", iso,
                            c.minute);
        case 2:
        case 3:
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "\"%.60s\": second %02d is not in 00..59, and 60 is allowed only where "
                            "a leap second was inserted",
                            iso, c.second);
        default:
            return fail_years(ctx, iso);
    }
    if (c.year < FIRST_YEAR || c.year > LAST_YEAR || eraUtctai(utc1, utc2, &tai1, &tai2) < 0) {
        return fail_years(ctx, iso);
    }
    *out = normalised(tai1, tai2);
    return BST_OK;
}

bst_status bst_time_from_utc_jd(bst_ctx *ctx, double jd1, double jd2, bst_time *out) {
    double tai1, tai2;
    char what[64];
    snprintf(what, sizeof what, "JD %.9f (UTC)", jd1 + jd2);
    if (!isfinite(jd1 + jd2) || jd1 + jd2 < FIRST_JD || jd1 + jd2 >= END_JD ||
        eraUtctai(jd1, jd2, &tai1, &tai2) < 0) {
        return fail_years(ctx, what);
    }
    *out = normalised(tai1, tai2);
    return BST_OK;
}

void bst_time_to_utc(bst_time t, int digits, char *buffer, size_t bytes) {
    double utc1, utc2;
    int year, month, day, hmsf[4];
    digits = digits < 0 ? 0 : digits > 9 ? 9 : digits;
    bst_time_utc(t, &utc1, &utc2);
    if (eraD2dtf("UTC", digits, utc1, utc2, &year, &month, &day, hmsf) < 0) {
        snprintf(buffer, bytes, "(no date)");
        return;
    }
    char fraction[16] = "";
    if (digits > 0) {
        snprintf(fraction, sizeof fraction, ".%0*d", digits, hmsf[3]);
    }
    snprintf(buffer, bytes, "%04d-%02d-%02dT%02d:%02d:%02d%sZ", year, month, day, hmsf[0], hmsf[1],
             hmsf[2], fraction);
}

bst_time bst_time_add(bst_time t, double seconds) {
    double rest = fmod(seconds, BST_DAY_S); /* exact */
    double days = (seconds - rest) / BST_DAY_S;
    return normalised(t.jd1 + round(days), t.jd2 + rest / BST_DAY_S);
}

bst_time bst_time_at_tick(bst_time epoch, int64_t tick, int64_t ticks_per_second) {
    int64_t per_day = 86400 * ticks_per_second;
    int64_t days = tick / per_day;
    int64_t rest = tick % per_day;
    return normalised(epoch.jd1 + (double)days, epoch.jd2 + (double)rest / (double)per_day);
}

double bst_time_diff(bst_time a, bst_time b) {
    return ((a.jd1 - b.jd1) + (a.jd2 - b.jd2)) * BST_DAY_S;
}

void bst_time_tt(bst_time t, double *jd1, double *jd2) {
    bst_time tt = normalised(t.jd1, t.jd2 + ERFA_TTMTAI / BST_DAY_S);
    *jd1 = tt.jd1;
    *jd2 = tt.jd2;
}

double bst_time_julian_year(bst_time t) {
    double tt1, tt2;
    bst_time_tt(t, &tt1, &tt2);
    return 2000.0 + (tt1 - 2451545.0 + tt2) / 365.25;
}

void bst_time_utc(bst_time t, double *jd1, double *jd2) {
    double utc1 = t.jd1, utc2 = t.jd2;
    if (eraTaiutc(t.jd1, t.jd2, &utc1, &utc2) < 0) {
        utc1 = t.jd1; /* beyond the calendar: treat the scales as equal */
        utc2 = t.jd2;
    }
    bst_time utc = normalised(utc1, utc2);
    *jd1 = utc.jd1;
    *jd2 = utc.jd2;
}
