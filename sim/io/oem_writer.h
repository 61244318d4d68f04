/* Writes orbits as a CCSDS Orbit Ephemeris Message (OEM 2.0, KVN; CCSDS 502.0-B-2 and -3). */
#ifndef BST_IO_OEM_WRITER_H
#define BST_IO_OEM_WRITER_H

#include <stdio.h>

#include "sim/io/state_series.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A state's covariance, order x y z vx vy vz, m and m/s, in the axes of the segment's ref_frame. */
typedef struct bst_oem_covariance {
    bst_time epoch;
    double matrix[6][6];
} bst_oem_covariance;

typedef struct bst_oem_segment {
    const char *object_name, *object_id; /* "INMARSAT GX5", "2019-081A"; not empty */
    const char *ref_frame;               /* of the series, by its OEM name: "GCRF", "TEME" ... */
    const char *comment;                 /* one or more lines; NULL: none */
    /* Interpolation that readers shall use: HERMITE of this degree; 0: LAGRANGE of degree 9 (less
     * for fewer rows). SGP4's velocity is not the derivative of its position (several cm/s):
     * Hermite interpolation would cause 0.6 m between rows of a LEO 60 s apart. */
    int hermite_degree;
    const bst_oem_covariance *covariance; /* after the states; NULL: none */
    bst_state_series series;              /* at least one row */
} bst_oem_segment;

/* Writes the head of an OEM. `creation_utc`: "YYYY-MM-DDThh:mm:ss"; `comment` may be NULL. The
 * caller owns the stream. Non-printable or non-ASCII characters become '_'. Errors of all
 * functions: BST_ERR_ARGUMENT for an empty name or no rows; BST_ERR_IO. */
bst_status bst_oem_write_head(bst_ctx *ctx, FILE *stream, const char *creation_utc,
                              const char *originator, const char *comment) BST_MUST_CHECK;

/* Writes one object: metadata with time span, TIME_SYSTEM UTC and interpolation; a row per state
 * (UTC to 1 ns, km to 1e-9, km/s to 1e-12); the covariance (km and km/s, 13 digits). Times must
 * increase (BST_ERR_ARGUMENT). */
bst_status bst_oem_write_segment(bst_ctx *ctx, FILE *stream,
                                 const bst_oem_segment *segment) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
