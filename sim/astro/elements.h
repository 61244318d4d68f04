/* Mean orbital elements for SGP4, and readers for all supported file formats. */
#ifndef BST_ASTRO_ELEMENTS_H
#define BST_ASTRO_ELEMENTS_H

#include <stdbool.h>
#include <stddef.h>

#include "sim/astro/time.h"

/* The largest catalogue number, of nine digits. */
#define BST_NORAD_MAX 999999999

typedef struct bst_elements {
    char name[32];        /* line 0 of a 3LE without "0 ", OBJECT_NAME of an OMM; "" when none */
    int norad;            /* catalogue number, Alpha-5 decoded; to BST_NORAD_MAX */
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

typedef struct bst_elements_options {
    bool skip_bad_sets; /* true: invalid sets are logged with their position and skipped */
    int norad;          /* only this catalogue number, others are not checked; 0: all */
} bst_elements_options;

/* Reads a file of element sets; the content determines the format:
 * - two or three lines each (sim/astro/tle.h);
 * - CCSDS OMM (502.0-B-3) as JSON, one object or an array of them: text beginning with { or [;
 * - CCSDS OMM as CSV with a header row: a first line with the column EPOCH or NORAD_CAT_ID.
 * Both as space-track.org and celestrak.org deliver them: numbers in JSON may be strings, keys and
 * columns that are not known are left alone, null or "" is as good as absent. Needed are
 * NORAD_CAT_ID (0 to 999,999,999), EPOCH (calendar or day of the year, any number of decimals),
 * MEAN_MOTION (above 0, at most 10,000 rev/day), ECCENTRICITY (0 <= e < 1), INCLINATION (0 to 180
 * deg), RA_OF_ASC_NODE, ARG_OF_PERICENTER, MEAN_ANOMALY (-360 to 360 deg) and BSTAR (below 1e9 in
 * size). OBJECT_NAME (printable ASCII, cut to 31 characters), OBJECT_ID, MEAN_MOTION_DOT and _DDOT
 * (taken as the fields of a TLE's line 1), ELEMENT_SET_NO and REV_AT_EPOCH are read when there.
 * MEAN_ELEMENT_THEORY must be SGP4 or SGP/SGP4, REF_FRAME TEME, TIME_SYSTEM UTC, CENTER_NAME EARTH
 * and EPHEMERIS_TYPE not 4 (SGP4-XP) where given. A key or column of these that comes twice is an
 * error. Other forms (OMM as KVN or XML) are refused by name.
 *
 * options NULL: all sets, no bad ones. *out: array of *count > 0 sets in the order of the file,
 * freed with free(); NULL and 0 on error. Messages start with "path:line: " or, in JSON, "path:
 * /index/KEY: ". BST_ERR_FORMAT for content, also when there is no set at all or the file is over
 * 256 MiB; BST_ERR_NOT_FOUND when there is no such file or no set of options->norad; BST_ERR_IO
 * when it cannot be read or is no regular file. */
bst_status bst_elements_load(bst_ctx *ctx, const char *path, const bst_elements_options *options,
                             bst_elements **out, int *count) BST_MUST_CHECK;

/* As bst_elements_load, from memory: `bytes` bytes at data (any bytes, no terminator needed);
 * `name`: file name for messages. */
bst_status bst_elements_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                    const bst_elements_options *options, bst_elements **out,
                                    int *count) BST_MUST_CHECK;

#endif
