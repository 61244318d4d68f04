/* Renders one frame as a picture: stretched grey levels with an overlay of truth, detections and
 * tracks. */
#ifndef BST_IO_FRAME_PICTURE_H
#define BST_IO_FRAME_PICTURE_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/io/picture.h"

typedef enum bst_io_overlay_kind {
    BST_OVERLAY_TARGET,    /* true position of the target: red square */
    BST_OVERLAY_OBJECT,    /* true position of another object: grey square */
    BST_OVERLAY_STAR,      /* detection that was identified with a star: green circle */
    BST_OVERLAY_REST,      /* labelled a star because it moves with the stars: grey-blue circle */
    BST_OVERLAY_DETECTION, /* any other detection: yellow circle */
    BST_OVERLAY_TRACK,     /* a track: blue diamond */
    BST_OVERLAY_BORESIGHT  /* violet cross */
} bst_io_overlay_kind;

/* A mark at a position of the frame, in frame pixels. */
typedef struct bst_io_overlay_mark {
    bst_io_overlay_kind kind;
    double x_px, y_px;
    double radius_px;            /* detections: size of the circle; 0: a default */
    double half_x_px, half_y_px; /* streaks: from the middle to an end; 0: a circle is drawn */
    bool on_path;                /* streaks: the overlay's path is drawn instead of a line */
    double importance; /* if there are too many marks, those with the largest value are drawn */
    char label[48];    /* "" for none */
} bst_io_overlay_mark;

/* Importance of marks other than detections, and of the target's own detection; other detections:
 * light in electrons. */
#define BST_OVERLAY_FIRST 1e303
#define BST_OVERLAY_OF_TARGET 1e302
#define BST_OVERLAY_OF_OBJECT 1e301

typedef struct bst_io_overlay {
    const bst_io_overlay_mark *marks; /* drawn from last to first: the most important in front */
    int count;
    const char *caption;        /* one line, upper left; NULL: none */
    const double (*path_px)[2]; /* [path_count] places along a star's streak, relative to its own */
    int path_count;
} bst_io_overlay;

/* The pixels of a frame. */
typedef struct bst_io_counts {
    const uint16_t *pixels; /* [rows][columns] */
    int columns, rows;
} bst_io_counts;

/* Makes a picture of width x height with a frame of columns x rows pixels as large as possible,
 * centred on black. `overlay` may be NULL. A frame of the same size is copied pixel by pixel. The
 * caller frees it. */
bst_status bst_frame_picture(bst_ctx *ctx, const bst_io_counts *counts, bst_io_stretch stretch,
                             const bst_io_overlay *overlay, int width, int height,
                             bst_picture **out) BST_MUST_CHECK;

#endif
