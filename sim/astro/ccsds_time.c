#include "sim/astro/ccsds_time.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sim/core/text_reader.h"

#define GPS_BEHIND_TAI_S 19.0

typedef struct calendar {
    int year, month, day, hour, minute;
    double second;
} calendar;

bool bst_astro_time_system_find(const char *name, size_t length, bst_astro_time_system *out) {
    static const char *const names[] = {"UTC", "TAI", "TT", "TDB", "GPS"};
    for (int i = 0; i < 5; i++) {
        if (bst_text_is((bst_text_span){name, length}, names[i])) {
            *out = (bst_astro_time_system)i;
            return true;
        }
    }
    return false;
}

/* Parses exactly `digits` digits, then the character `after` unless it is 0. */
static bool take(bst_text_span *s, size_t digits, char after, int *value) {
    size_t bytes = digits + (after != 0);
    if (s->length < bytes || (after && s->text[digits] != after) ||
        !bst_text_count((bst_text_span){s->text, digits}, 9999, value)) {
        return false;
    }
    s->text += bytes;
    s->length -= bytes;
    return true;
}

static bool read_calendar(bst_text_span s, calendar *c) {
    int whole;
    if (!take(&s, 4, '-', &c->year)) {
        return false;
    }
    if (s.length > 3 && s.text[3] == 'T') {
        c->month = 0;
        if (!take(&s, 3, 'T', &c->day)) {
            return false;
        }
    } else if (!take(&s, 2, '-', &c->month) || !take(&s, 2, 'T', &c->day)) {
        return false;
    }
    if (!take(&s, 2, ':', &c->hour) || !take(&s, 2, ':', &c->minute) || !take(&s, 2, 0, &whole)) {
        return false;
    }
    if (s.length > 0 && s.text[s.length - 1] == 'Z') {
        s.length--;
    }
    c->second = (double)whole;
    if (s.length > 0) {
        /* parses the seconds with their decimals, so that they are rounded once; digits beyond
         * double precision are ignored */
        char text[48];
        for (size_t i = 1; i < s.length; i++) {
            if (s.text[i] < '0' || s.text[i] > '9') {
                return false;
            }
        }
        size_t length = s.length < 30 ? s.length : 30;
        snprintf(text, sizeof text, "%d%.*s", whole, (int)length, s.text);
        return s.length > 1 && s.text[0] == '.' &&
               bst_text_number((bst_text_span){text, strlen(text)}, &c->second);
    }
    return true;
}

static bst_status fail_date(bst_ctx *ctx, bst_text_span s, const char *problem) {
    char quoted[BST_TEXT_QUOTE_BYTES];
    bst_text_quote(s.text, s.length < 60 ? s.length : 60, quoted);
    return bst_fail(ctx, BST_ERR_FORMAT, "%s %s", quoted, problem);
}

/* Converts day of year to month and day. */
static bst_status resolve_day(bst_ctx *ctx, bst_text_span s, calendar *c) {
    double mjd0, mjd, fraction;
    if (c->month != 0) {
        return BST_OK;
    }
    bool leap = (c->year % 4 == 0 && c->year % 100 != 0) || c->year % 400 == 0;
    if (c->day < 1 || c->day > (leap ? 366 : 365) || eraCal2jd(c->year, 1, 1, &mjd0, &mjd) != 0 ||
        eraJd2cal(mjd0, mjd + c->day - 1, &c->year, &c->month, &c->day, &fraction) != 0) {
        return fail_date(ctx, s,
                         leap ? "has no day of the year in 001..366"
                              : "has no day of the year in 001..365, as that year does");
    }
    return BST_OK;
}

/* Two-part Julian date in the given time system, quasi-JD for UTC. */
static bst_status read_jd(bst_ctx *ctx, bst_text_span s, bool utc, double *jd1, double *jd2) {
    calendar c;
    if (!read_calendar(s, &c)) {
        return fail_date(ctx, s,
                         "is not a date (expected YYYY-MM-DDThh:mm:ss or YYYY-DDDThh:mm:ss, then "
                         "if wanted decimals, as in 2022-06-16T22:10:00.5)");
    }
    BST_TRY(resolve_day(ctx, s, &c));
    switch (eraDtf2d(utc ? "UTC" : "TAI", c.year, c.month, c.day, c.hour, c.minute, c.second, jd1,
                     jd2)) {
        case 0:
        case 1:
            return BST_OK;
        case -2:
            return fail_date(ctx, s, "has no month in 01..12");
        case -3:
            return fail_date(ctx, s, "has no day that this month has");
        case -4:
            return fail_date(ctx, s, "has no hour in 00..23");
        case -5:
            return fail_date(ctx, s, "has no minute in 00..59");
        default:
            return fail_date(ctx, s,
                             utc ? "has no second in 00..59 (60 only where a leap second was "
                                   "inserted)"
                                 : "has no second in 00..59");
    }
}

/* TDB - TT in seconds. */
static double tdb_minus_tt(double jd1, double jd2) {
    double t = ((jd1 - ERFA_DJ00) + jd2) / ERFA_DJC;
    return 0.001657 * sin(628.3076 * t + 6.2401) + 0.000022 * sin(575.3385 * t + 4.2970) +
           0.000014 * sin(1256.6152 * t + 6.1969) + 0.000005 * sin(606.9777 * t + 4.0212) +
           0.000005 * sin(52.9691 * t + 0.4444) + 0.000002 * sin(21.3299 * t + 5.5431) +
           0.000010 * t * sin(628.3076 * t + 4.2490);
}

bst_status bst_time_from_jd(bst_ctx *ctx, bst_astro_time_system system, double jd1, double jd2,
                            bst_time *out) {
    switch (system) {
        case BST_TIME_UTC:
            return bst_time_from_utc_jd(ctx, jd1, jd2, out);
        case BST_TIME_TAI:
            *out = bst_time_add((bst_time){jd1, jd2}, 0.0);
            return BST_OK;
        case BST_TIME_GPS:
            *out = bst_time_add((bst_time){jd1, jd2}, GPS_BEHIND_TAI_S);
            return BST_OK;
        case BST_TIME_TT:
            *out = bst_time_add((bst_time){jd1, jd2}, -ERFA_TTMTAI);
            return BST_OK;
        case BST_TIME_TDB:
            *out = bst_time_add((bst_time){jd1, jd2}, -ERFA_TTMTAI - tdb_minus_tt(jd1, jd2));
            return BST_OK;
        default:
            return bst_fail(ctx, BST_ERR_ARGUMENT, "time system %d does not exist", (int)system);
    }
}

bst_status bst_ccsds_time(bst_ctx *ctx, const char *text, size_t length,
                          bst_astro_time_system system, bst_time *out) {
    double jd1, jd2;
    BST_TRY(read_jd(ctx, (bst_text_span){text, length}, system == BST_TIME_UTC, &jd1, &jd2));
    return bst_time_from_jd(ctx, system, jd1, jd2, out);
}

bst_status bst_ccsds_utc_jd(bst_ctx *ctx, const char *text, size_t length, double *jd1,
                            double *jd2) {
    bst_time t;
    BST_TRY(read_jd(ctx, (bst_text_span){text, length}, true, jd1, jd2));
    return bst_time_from_utc_jd(ctx, *jd1, *jd2, &t); /* checks the range */
}
