/* Reads angles and magnitudes from CCSDS Tracking Data Messages (TDM, KVN; 503.0-B-1 and -2). */
#ifndef BST_ASTRO_TDM_H
#define BST_ASTRO_TDM_H

#include "sim/astro/time.h"

/* One direction to the body, right ascension and declination in ICRF. */
typedef struct bst_tdm_angles {
    bst_time time;          /* of reception; mid-exposure if the file gives the exposure time */
    double ra_rad, dec_rad; /* from the file, with requested corrections added */
    double mag;             /* NAN: none at that time */
} bst_tdm_angles;

/* Angles of one pair of participants. */
typedef struct bst_tdm_pair {
    char observer[80];           /* last participant of PATH: receives */
    char object[80];             /* the participant before it */
    char ephemeris[256];         /* EPHEMERIS_NAME of the observer; "": none */
    const bst_tdm_angles *items; /* sorted by time */
    int64_t count;               /* 0: the segment has no angles */
} bst_tdm_pair;

/* The angles of one TDM file; immutable. */
typedef struct bst_tdm bst_tdm;

/* Reads a file of any number of segments. Every segment needs TIME_SYSTEM (UTC, TAI, TT, TDB or
 * GPS) and PARTICIPANT_1; one with angles also ANGLE_TYPE RADEC and a REFERENCE_FRAME of ICRF, GCRF
 * or EME2000 (which is turned to ICRF). PATH is "2,1" where it is not given. TIMETAG_REF must be
 * RECEIVE where given; with INTEGRATION_INTERVAL, INTEGRATION_REF START and END are moved to the
 * middle. CORRECTION_ANGLE_1, _2 and CORRECTION_MAG are added unless CORRECTIONS_APPLIED is YES.
 * ANGLE_1 and ANGLE_2 (degrees) belong together by their times (to 1 us); each needs the other.
 * Other keywords of metadata and other kinds of data are checked for their form alone.
 *
 * *out is freed with bst_tdm_free; NULL on error. Messages start with "path:line: ". BST_ERR_FORMAT
 * for content, also when no segment has angles or the file is over 256 MiB; BST_ERR_NOT_FOUND when
 * there is none; BST_ERR_IO when it cannot be read or is no regular file; BST_ERR_MEMORY. */
bst_status bst_tdm_load(bst_ctx *ctx, const char *path, bst_tdm **out) BST_MUST_CHECK;

/* As bst_tdm_load, from memory: `bytes` bytes at data (any bytes, no terminator needed); `name`:
 * file name for messages. */
bst_status bst_tdm_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                               bst_tdm **out) BST_MUST_CHECK;

void bst_tdm_free(bst_tdm *tdm); /* NULL allowed */

/* Number of pairs of angles of a TDM. */
int bst_tdm_pair_count(const bst_tdm *tdm);
/* A pair of a TDM, borrowed; index from 0 in file order. */
const bst_tdm_pair *bst_tdm_pair_at(const bst_tdm *tdm, int index);

#endif
