/* Two-line element sets: reading, checking. */
#ifndef BST_ASTRO_TLE_H
#define BST_ASTRO_TLE_H

#include <stdbool.h>

#include "sim/astro/time.h"

typedef struct bst_elements {
    char name[32];        /* line 0 of a 3LE without "0 ", "" in a 2LE */
    int norad;            /* catalogue number, Alpha-5 decoded (100000..339999) */
    char designator[12];  /* international designator, "98067A" */
    double epoch_utc_jd1; /* epoch as UTC quasi-JD in two parts: midnight and fraction */
    double epoch_utc_jd2;
    double bstar;          /* 1 / Earth radii */
    double ndot_rev_day2;  /* first derivative / 2 as printed */
    double nddot_rev_day3; /* second derivative / 6 as printed */
    double inclination_rad, raan_rad, eccentricity, arg_perigee_rad, mean_anomaly_rad;
    double mean_motion_radpmin; /* Kozai mean motion */
    int element_set, revolution;
} bst_elements;

/* Reads one element set from its two lines (no newline needed). Errors say line 1 or 2, column and
 * content. */
bst_status bst_tle_parse(bst_ctx *ctx, const char *line1, const char *line2,
                         bst_elements *out) BST_MUST_CHECK;

typedef struct bst_tle_options {
    bool
        skip_bad_sets; /* true: a bad set is logged as a warning with its line number and skipped */
    int norad;         /* only this number; 0: all */
} bst_tle_options;

/* Reads a file of 2LE or 3LE sets (mixed; blank lines and # comments allowed; CRLF allowed). *out:
 * array of *count, freed with free(). Errors: file and line number. */
bst_status bst_tle_load(bst_ctx *ctx, const char *path, const bst_tle_options *options,
                        bst_elements **out, int *count) BST_MUST_CHECK;

#endif
