/* Writes orbits as CZML for display in Cesium. */
#ifndef BST_IO_CZML_WRITER_H
#define BST_IO_CZML_WRITER_H

#include <stdbool.h>
#include <stdio.h>

#include "sim/io/state_series.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bst_czml_object {
    const char *id;          /* unique in the document; not "document", not empty */
    const char *name;        /* displayed name; NULL: the id */
    const char *description; /* HTML for Cesium's information box; NULL: none */
    bool label;              /* show the name next to the point */
    double path_s;           /* length of the trail, s; 0: none, INFINITY: complete */
    unsigned char rgba[4];   /* of point, label and path; all zero: white */
    double point_px;         /* diameter of the point; 0: 6; < 0: not shown */
    bool linear;             /* linear interpolation instead of Lagrange */
    bst_state_series series; /* GCRF positions; at least one row */
} bst_czml_object;

/* Writes the head of a document with a clock from start to stop at `multiplier` times real time.
 * Texts are UTF-8; invalid bytes become '?'. The caller owns the stream. Errors of all functions:
 * BST_ERR_ARGUMENT for an empty or reserved id, no rows, or times that do not increase; BST_ERR_IO.
 * Format: the CZML Guide of AnalyticalGraphicsInc's czml-writer. */
bst_status bst_czml_write_head(bst_ctx *ctx, FILE *stream, const char *name, bst_time start,
                               bst_time stop, double multiplier) BST_MUST_CHECK;

/* Writes an object: position in the frame INERTIAL (ICRF axes) in m to 0.1 mm, at SI seconds after
 * the first row's UTC, with Lagrange interpolation of degree 5; available from the first to the
 * last row. */
bst_status bst_czml_write_object(bst_ctx *ctx, FILE *stream,
                                 const bst_czml_object *object) BST_MUST_CHECK;

/* A line through the positions of several packets. */
typedef struct bst_czml_line {
    const char *id, *name;
    const char *const *ids; /* [count] ids of the packets */
    int count;
    const unsigned char *rgba; /* [4] */
    bst_time start, stop;      /* time span of its display */
} bst_czml_line;

/* Writes a line between objects.
 *
 * Errors: BST_ERR_IO */
bst_status bst_czml_write_line(bst_ctx *ctx, FILE *stream,
                               const bst_czml_line *line) BST_MUST_CHECK;

/* Writes the end of a CZML document. */
bst_status bst_czml_write_tail(bst_ctx *ctx, FILE *stream) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
