/* Writes orbits as CZML, which Cesium shows on a globe. */
#ifndef BST_IO_CZML_WRITER_H
#define BST_IO_CZML_WRITER_H

#include <stdbool.h>
#include <stdio.h>

#include "sim/io/state_series.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bst_czml_object {
    const char *id;          /* unique in the document, not "document", not empty */
    const char *name;        /* shown; NULL: the id */
    const char *description; /* HTML in Cesium's information box; NULL: none */
    bool label;              /* the name beside the point */
    double path_s;           /* length of the trail, s; 0: no path, INFINITY: all of it */
    unsigned char rgba[4];   /* of point, label and path; all zero: white */
    double point_px;         /* diameter of the point; 0: 6; < 0: not shown */
    bool linear;             /* straight between rows, not Lagrange */
    bst_state_series series; /* GCRF; velocities are not used; at least one row */
} bst_czml_object;

/* Starts the document: its packet with a clock that runs from start to stop at `multiplier` times
 * real time. Texts are UTF-8; bytes that are not become '?'. The stream is the caller's. Every
 * function: BST_ERR_ARGUMENT for an empty or reserved id, no rows, or rows that do not rise in
 * time; BST_ERR_IO when the stream has an error. Format: the CZML Guide of AnalyticalGraphicsInc's
 * czml-writer. */
bst_status bst_czml_write_head(bst_ctx *ctx, FILE *stream, const char *name, bst_time start,
                               bst_time stop, double multiplier) BST_MUST_CHECK;

/* One packet: position in the frame INERTIAL (the ICRF's axes) in m to 0.1 mm, against SI seconds
 * after the first row's UTC, to be interpolated with Lagrange polynomials of degree 5; available
 * from the first row to the last. */
bst_status bst_czml_write_object(bst_ctx *ctx, FILE *stream,
                                 const bst_czml_object *object) BST_MUST_CHECK;

/* A line through the positions of packets, in their order. */
typedef struct bst_czml_line {
    const char *id, *name;
    const char *const *ids; /* [count] of the packets */
    int count;
    const unsigned char *rgba; /* [4] */
    bst_time start, stop;      /* of its availability */
} bst_czml_line;

/* Writes a line.
 *
 * Errors: BST_ERR_IO */
bst_status bst_czml_write_line(bst_ctx *ctx, FILE *stream,
                               const bst_czml_line *line) BST_MUST_CHECK;

/* Ends the document. */
bst_status bst_czml_write_tail(bst_ctx *ctx, FILE *stream) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
