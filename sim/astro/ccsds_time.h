/* Parses dates of CCSDS messages in their time systems. */
#ifndef BST_ASTRO_CCSDS_TIME_H
#define BST_ASTRO_CCSDS_TIME_H

#include <stdbool.h>
#include <stddef.h>

#include "sim/astro/time.h"

typedef enum bst_astro_time_system {
    BST_TIME_UTC,
    BST_TIME_TAI,
    BST_TIME_TT,
    BST_TIME_TDB,
    BST_TIME_GPS, /* TAI - 19 s */
} bst_astro_time_system;

/* Finds a time system by name ("UTC"; `length` characters); false: unknown. */
bool bst_astro_time_system_find(const char *name, size_t length, bst_astro_time_system *out);

/* Reads "YYYY-MM-DDThh:mm:ss[.d...][Z]" or "YYYY-DDDThh:mm:ss[.d...][Z]" (CCSDS 301.0-B-4, ASCII
 * time codes A and B) of `length` characters, in a time system; second 60 in a leap second of UTC
 * only. TDB - TT to 10 us (Kaplan, USNO Circular 179, equation 2.6). Errors: BST_ERR_FORMAT with
 * the text and the allowed form; BST_ERR_RANGE for UTC as bst_time_from_utc. */
bst_status bst_ccsds_time(bst_ctx *ctx, const char *text, size_t length,
                          bst_astro_time_system system, bst_time *out) BST_MUST_CHECK;

/* Converts a two-part Julian date of a time system (quasi-JD for UTC). BST_ERR_RANGE for UTC as
 * bst_time_from_utc. */
bst_status bst_time_from_jd(bst_ctx *ctx, bst_astro_time_system system, double jd1, double jd2,
                            bst_time *out) BST_MUST_CHECK;

/* Parses a CCSDS date in UTC into a quasi-JD in two parts: midnight and fraction of the day. */
bst_status bst_ccsds_utc_jd(bst_ctx *ctx, const char *text, size_t length, double *jd1,
                            double *jd2) BST_MUST_CHECK;

#endif
