/* Formats element sets as two lines. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/astro/tle.h"

enum { ALPHA5_FIRST = 100000, ALPHA5_END = BST_TLE_NORAD_MOST + 1 };

/* Appends the checksum: sum of digits modulo 10, a minus counts 1. */
static void put_checksum(char *line) {
    int sum = 0;
    for (int i = 0; i < BST_TLE_CHARS - 1; i++) {
        sum += line[i] >= '0' && line[i] <= '9' ? line[i] - '0' : line[i] == '-';
    }
    line[BST_TLE_CHARS - 1] = (char)('0' + sum % 10);
    line[BST_TLE_CHARS] = '\0';
}

static void number_text(int norad, char out[8]) {
    static const char letters[] = "ABCDEFGHJKLMNPQRSTUVWXYZ";
    if (norad >= ALPHA5_FIRST) {
        snprintf(out, 8, "%c%04d", letters[(norad - ALPHA5_FIRST) / 10000], norad % 10000);
    } else {
        snprintf(out, 8, "%05d", norad);
    }
}

/* Formats " 12345-3": implied decimal point, one-digit exponent; the sign of 0 is '+'. */
static bool implied_text(double value, char out[32]) {
    double size = fabs(value);
    int exponent = size > 0.0 ? (int)floor(log10(size)) + 1 : 0;
    exponent = exponent < -9 ? -9 : exponent;
    long digits = lround(size * pow(10.0, 5 - exponent));
    if (digits > 99999) {
        digits /= 10;
        exponent++;
    }
    snprintf(out, 32, "%c%05ld%c%d", value < 0.0 ? '-' : ' ', digits, exponent < 0 ? '-' : '+',
             exponent < 0 ? -exponent : exponent);
    return exponent <= 9;
}

/* Formats a derivative: "-.00000123". */
static bool derivative_text(double value, char out[16]) {
    char digits[16];
    snprintf(digits, sizeof digits, "%.8f", fabs(value));
    snprintf(out, 16, "%c%.9s", value < 0.0 ? '-' : ' ', digits + 1);
    return fabs(value) < 0.999999995;
}

/* Degrees with four decimals; 360 becomes 0. */
static double degrees_of(double angle_rad) {
    double degrees = round(angle_rad / BST_DEG_RAD * 1e4) * 1e-4;
    degrees = fmod(degrees, 360.0);
    return degrees < 0.0 ? degrees + 360.0 : degrees;
}

/* Days from 1 January 1900 (JD 2415020.5) to 1 January of a year; every fourth year is a leap year,
 * valid from 1901 to 2099. */
static double first_day(int year) {
    return 365.0 * (year - 1900) + floor((year - 1901) / 4.0);
}

/* Formats year and day of year of the epoch. */
static void epoch_text(const bst_elements *set, char out[16], int *year) {
    double whole = floor(set->epoch_utc_jd1 - 2415020.5), fraction = set->epoch_utc_jd2;
    fraction += set->epoch_utc_jd1 - 2415020.5 - whole;
    whole += floor(fraction);
    fraction = round((fraction - floor(fraction)) * 1e8) * 1e-8;
    if (fraction >= 1.0) {
        whole += 1.0;
        fraction = 0.0;
    }
    *year = 1900 + (int)floor(whole / 365.25);
    double first = first_day(*year);
    if (whole < first || whole >= first_day(*year + 1)) {
        *year += whole < first ? -1 : 1;
        first = first_day(*year);
    }
    snprintf(out, 16, "%02d%012.8f", *year % 100, whole - first + 1.0 + fraction);
}

bst_status bst_tle_format(bst_ctx *ctx, const bst_elements *set, char line1[BST_TLE_CHARS + 1],
                          char line2[BST_TLE_CHARS + 1]) {
    char norad[8], epoch[16], ndot[16], nddot[32], bstar[32], text[160];
    int year = 0;
    if (set->norad < 0 || set->norad >= ALPHA5_END) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "catalogue number %d has no place in two lines (allowed: 0 to 339999)",
                        set->norad);
    }
    number_text(set->norad, norad);
    epoch_text(set, epoch, &year);
    if (year < 1957 || year > 2056) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "an epoch in %d has no place in two lines (allowed: 1957 to 2056)", year);
    }
    double motion = set->mean_motion_radpmin * 1440.0 / (2.0 * BST_PI);
    bool fits = derivative_text(set->ndot_rev_day2, ndot);
    fits = implied_text(set->nddot_rev_day3, nddot) && fits;
    fits = implied_text(set->bstar, bstar) && fits && motion < 99.999999995;
    long eccentricity = lround(set->eccentricity * 1e7);
    if (!fits || eccentricity > 9999999) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "the elements of %d are too great for the columns of two lines",
                        set->norad);
    }
    snprintf(text, sizeof text, "1 %sU %-8.8s %s %s %s %s 0 %4d0", norad, set->designator, epoch,
             ndot, nddot, bstar, set->element_set % 10000);
    memcpy(line1, text, BST_TLE_CHARS);
    put_checksum(line1);
    snprintf(text, sizeof text, "2 %s %8.4f %8.4f %07ld %8.4f %8.4f %11.8f%5d0", norad,
             set->inclination_rad >= BST_PI ? 180.0 : degrees_of(set->inclination_rad),
             degrees_of(set->raan_rad), eccentricity, degrees_of(set->arg_perigee_rad),
             degrees_of(set->mean_anomaly_rad), motion, set->revolution % 100000);
    memcpy(line2, text, BST_TLE_CHARS);
    put_checksum(line2);
    return BST_OK;
}
