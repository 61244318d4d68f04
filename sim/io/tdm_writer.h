/* Writes angles and magnitudes as a CCSDS Tracking Data Message (TDM 2.0, KVN; CCSDS 503.0-B-2). */
#ifndef BST_IO_TDM_WRITER_H
#define BST_IO_TDM_WRITER_H

#include <stdbool.h>
#include <stdio.h>

#include "sim/astro/time.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A measured direction from the observer to the object at `time` (of reception). */
typedef struct bst_tdm_observation {
    bst_time time;
    double ra_rad, dec_rad; /* ICRS; right ascension in any range */
    double mag;             /* NAN: none */
} bst_tdm_observation;

typedef struct bst_tdm_segment {
    const char *observer, *object;  /* PARTICIPANT_1 and _2; not empty */
    const char *observer_ephemeris; /* name of the OEM with the observer's states; NULL: none */
    const char *comment;            /* one or more lines; NULL: none */
    double integration_s; /* exposure time; the angles refer to its middle; 0: not stated */
    /* Corrections applied to the measured directions, stated in the metadata: */
    bool aberration_removed;      /* the observer's stellar aberration */
    bool light_time_removed;      /* false: directions to the object's position at emission */
    double aberration_yearly_deg; /* mean aberration removed for the Earth's velocity, and */
    double
        aberration_orbital_deg; /* for the observer's velocity around the Earth; NAN: not stated */
    const bst_tdm_observation *observations; /* sorted by time */
    int64_t count;                           /* at least 1 */
} bst_tdm_segment;

/* Writes the head of a TDM. `creation_utc`: "YYYY-MM-DDThh:mm:ss"; `comment` may be NULL. The
 * caller owns the stream. Non-printable or non-ASCII characters become '_'. Errors of all
 * functions: BST_ERR_ARGUMENT for an empty name, no observations, times that do not increase or
 * angles that are not finite; BST_ERR_IO. */
bst_status bst_tdm_write_head(bst_ctx *ctx, FILE *stream, const char *creation_utc,
                              const char *originator, const char *comment) BST_MUST_CHECK;

/* Writes the observations of one pair of participants: metadata (TIME_SYSTEM UTC, ANGLE_TYPE RADEC
 * in ICRF, TIMETAG_REF RECEIVE, PATH 2,1, corrections), then ANGLE_1 and ANGLE_2 in degrees to 1e-9
 * and MAG to 1e-4. CORRECTIONS_APPLIED is YES, with CORRECTION_ABERRATION_YEARLY and _DIURNAL, if
 * their sizes are given; comments describe the angles. */
bst_status bst_tdm_write_segment(bst_ctx *ctx, FILE *stream,
                                 const bst_tdm_segment *segment) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
