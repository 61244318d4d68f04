/* The quicklook: first and last frame of a run side by side, with overlays. */
#ifndef BST_IO_QUICKLOOK_H
#define BST_IO_QUICKLOOK_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef enum bst_io_mark_kind {
    BST_MARK_DETECTION,
    BST_MARK_STAR, /* identified with a star of the catalogue */
    BST_MARK_REST  /* labelled a star because it rests among them */
} bst_io_mark_kind;

/* A detection's mark on a frame, in pixels of the frame. */
typedef struct bst_io_mark {
    double x_px, y_px;
    double radius_px;  /* size of the circle; 0: a default */
    double importance; /* those with most are drawn */
    bst_io_mark_kind kind;
} bst_io_mark;

/* Marks of detections that a panel shows at most. */
enum { BST_QUICKLOOK_MARKS = 512 };

/* Sorts marks by falling importance. */
void bst_io_mark_sort(bst_io_mark *marks, int count);

/* One frame and what is drawn on it. Everything but the pixels may be missing. */
typedef struct bst_quicklook_frame {
    const uint16_t *pixels; /* row-major [height][width] */
    int width, height;
    const char *title;             /* "First frame" */
    const char *time;              /* "2022-06-16T22:10:00Z  t = 0.5 s" */
    const char *mode;              /* "slew" */
    const bst_io_mark *detections; /* by falling importance: the first BST_QUICKLOOK_MARKS are
                                   drawn, the first of all on top */
    int detection_count;
    bool has_target; /* true place of the target */
    double target_x_px, target_y_px;
    bool has_track; /* the tracker's target of interest */
    double track_x_px, track_y_px;
    const char *track_label; /* "track 1  SNR 13.2" */
    double boresight_x_px, boresight_y_px;
    double pixel_scale_arcsec; /* > 0: a scale bar is drawn */
} bst_quicklook_frame;

/* Writes a PNG of two panels (`second` NULL: one), each with an inset that enlarges the
 * surroundings of the target (or the boresight), and a legend. */
bst_status bst_quicklook_write(bst_ctx *ctx, const char *path, const char *title,
                               const bst_quicklook_frame *first,
                               const bst_quicklook_frame *second) BST_MUST_CHECK;

#endif
