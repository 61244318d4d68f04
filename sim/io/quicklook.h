/* Quicklook picture of a run: first and last frame side by side with truth, track and
 * detections. */
#ifndef BST_IO_QUICKLOOK_H
#define BST_IO_QUICKLOOK_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef enum bst_io_mark_kind {
    BST_MARK_DETECTION,
    BST_MARK_STAR, /* identified with a star of the catalogue */
    BST_MARK_REST  /* labelled a star because it moves with the stars */
} bst_io_mark_kind;

/* Mark of a detection, in frame pixels. */
typedef struct bst_io_mark {
    double x_px, y_px;
    double radius_px;  /* size of the circle; 0: a default */
    double importance; /* those with the largest value are drawn */
    bst_io_mark_kind kind;
} bst_io_mark;

/* maximum number of detections drawn in a panel */
enum { BST_QUICKLOOK_MARKS = 512 };

/* Sorts marks by decreasing importance. */
void bst_io_mark_sort(bst_io_mark *marks, int count);

/* One frame and its overlay. Everything except the pixels is optional. */
typedef struct bst_quicklook_frame {
    const uint16_t *pixels; /* row-major [height][width] */
    int width, height;
    const char *title;             /* "First frame" */
    const char *time;              /* "2022-06-16T22:10:00Z  t = 0.5 s" */
    const char *mode;              /* "slew" */
    const bst_io_mark *detections; /* by decreasing importance; the first BST_QUICKLOOK_MARKS are
                                      drawn, the first in front */
    int detection_count;
    bool has_target; /* true position of the target */
    double target_x_px, target_y_px;
    bool has_track; /* the tracker's target of interest */
    double track_x_px, track_y_px;
    const char *track_label; /* "track 1  SNR 13.2" */
    double boresight_x_px, boresight_y_px;
    double pixel_scale_arcsec; /* > 0: draws a scale bar */
} bst_quicklook_frame;

/* Writes a PNG with two panels (`second` NULL: one), each with an enlarged inset of the target or
 * boresight, and a legend. */
bst_status bst_quicklook_write(bst_ctx *ctx, const char *path, const char *title,
                               const bst_quicklook_frame *first,
                               const bst_quicklook_frame *second) BST_MUST_CHECK;

#endif
