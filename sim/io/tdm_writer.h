/* Writes angles and magnitudes as a CCSDS Tracking Data Message (TDM 2.0, KVN; CCSDS 503.0-B-2). */
#ifndef BST_IO_TDM_WRITER_H
#define BST_IO_TDM_WRITER_H

#include <stdbool.h>
#include <stdio.h>

#include "sim/astro/time.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One direction from the observer at `time` (of reception) to the object. */
typedef struct bst_tdm_observation {
    bst_time time;
    double ra_rad, dec_rad; /* ICRS; right ascension in any turn */
    double mag;             /* NAN: none */
} bst_tdm_observation;

typedef struct bst_tdm_segment {
    const char *observer, *object;  /* PARTICIPANT_1 and _2; not empty */
    const char *observer_ephemeris; /* name of the OEM with the observer's states; NULL: none */
    const char *comment;            /* one or more lines; NULL: none */
    double integration_s; /* exposure, its middle being the time of the angles; 0: not stated */
    /* What was done to the measured directions, stated in the metadata: */
    bool aberration_removed;       /* the observer's stellar aberration */
    bool light_time_removed;       /* false: they point to where the object was at emission */
    double aberration_yearly_deg;  /* mean size of what was removed for the Earth's velocity and */
    double aberration_orbital_deg; /* for the observer's around the Earth; NAN: not stated */
    const bst_tdm_observation *observations; /* by time */
    int64_t count;                           /* at least 1 */
} bst_tdm_segment;

/* Starts the message. `creation_utc` is "YYYY-MM-DDThh:mm:ss"; `comment` may be NULL. The stream is
 * the caller's. What is not printable ASCII in a text is written as '_'. Every function:
 * BST_ERR_ARGUMENT for an empty name, no observations, ones that do not rise in time or angles that
 * are not finite; BST_ERR_IO when the stream has an error. */
bst_status bst_tdm_write_head(bst_ctx *ctx, FILE *stream, const char *creation_utc,
                              const char *originator, const char *comment) BST_MUST_CHECK;

/* One pair of participants: metadata (TIME_SYSTEM UTC, ANGLE_TYPE RADEC in ICRF, TIMETAG_REF
 * RECEIVE, PATH 2,1, the corrections), then ANGLE_1 and ANGLE_2 in degrees to 1e-9 and MAG to
 * 1e-4. CORRECTIONS_APPLIED is YES with CORRECTION_ABERRATION_YEARLY and _DIURNAL when their sizes
 * are given; comments say in words what is in the angles either way. */
bst_status bst_tdm_write_segment(bst_ctx *ctx, FILE *stream,
                                 const bst_tdm_segment *segment) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
