/* Times and time scales, based on ERFA. */
#ifndef BST_ASTRO_TIME_H
#define BST_ASTRO_TIME_H

#include <stdint.h>

#include "boresight/status.h"

#define BST_DAY_S 86400.0 /* of a Julian date */

/* A time as two-part Julian date in TAI. jd1: Julian date of a midnight (x.5); jd2 in [0, 1):
 * fraction of the day; resolution better than 1e-10 s. */
typedef struct bst_time {
    double jd1, jd2;
} bst_time;

/* Parses "YYYY-MM-DDThh:mm:ss[.fff...][Z]" (UTC; second 60 only in a leap second). Errors:
 * BST_ERR_FORMAT with the text and the allowed form; BST_ERR_RANGE before 1960 or after 2099. Leap
 * seconds as known to ERFA; later ones are assumed not to occur. */
bst_status bst_time_from_utc(bst_ctx *ctx, const char *iso, bst_time *out) BST_MUST_CHECK;

/* Formats UTC as "YYYY-MM-DDThh:mm:ss.fffZ" with `digits` decimals (limited to 0..9); buffer of >=
 * 40 bytes. Rounding carries into minute, hour and day, with leap seconds. */
void bst_time_to_utc(bst_time t, int digits, char *buffer, size_t bytes);

/* t + seconds (SI), rounded once, to better than 1e-10 s, for any |seconds| < 1e10. */
bst_time bst_time_add(bst_time t, double seconds);

/* epoch + ticks / ticks_per_second without accumulation: whole days are separated in integers.
 * ticks_per_second in 1..1e14; tick may be negative. */
bst_time bst_time_at_tick(bst_time epoch, int64_t tick, int64_t ticks_per_second);

/* a - b in SI seconds. */
double bst_time_diff(bst_time a, bst_time b);

/* Converts a time to TT as a two-part Julian date, split like bst_time. */
void bst_time_tt(bst_time t, double *jd1, double *jd2);
/* Julian year in TT, 2000.0 at J2000: the time of proper motions. */
double bst_time_julian_year(bst_time t);
void bst_time_utc(bst_time t, double *jd1, double *jd2); /* ERFA's quasi-JD */
/* Converts a quasi-JD in UTC, as in TLE epochs, to a time. BST_ERR_RANGE as bst_time_from_utc. */
bst_status bst_time_from_utc_jd(bst_ctx *ctx, double jd1, double jd2, bst_time *out) BST_MUST_CHECK;

#endif
