/* A recorded run as the viewer's page asks for it: description, frames, marks, time series. Calls
 * from several threads wait for each other. */
#ifndef BST_VIEW_RECORDED_RUN_H
#define BST_VIEW_RECORDED_RUN_H

#include <cjson/cJSON.h>

#include "boresight/status.h"
#include "sim/io/run_reader.h"
#include "view/pixel_bins.h"

typedef struct bst_view_run bst_view_run;

/* Memory that is sent to the page. */
typedef struct bst_view_bytes {
    void *data; /* malloc; NULL: none */
    size_t bytes;
    int width, height; /* of pixels; 0: something else */
    int binning;       /* pixels of the frame along a side of one of these; 0: none are sent */
    int frame_width, frame_height; /* of the whole frame, px */
    int x, y;                      /* of the first pixel in the frame */
} bst_view_bytes;

/* Numbers of a frame in the list of frames, all 64-bit floating point. */
enum { BST_VIEW_FRAME_NUMBERS = 5 };

enum { BST_VIEW_EVENTS = 2000 };

/* Opens the folder of a run in any state.
 *
 * Errors:    those of bst_run_reader_open and bst_run_sensors; BST_ERR_MEMORY
 * Ownership: free *out with bst_view_run_close */
bst_status bst_view_run_open(bst_ctx *ctx, const char *path, bst_view_run **out) BST_MUST_CHECK;
/* Closes a run; NULL is allowed. */
void bst_view_run_close(bst_view_run *run);

/* Reads the folder again if its run was in progress: what was recorded since is then found. A run
 * that ended meanwhile is found under its final name.
 *
 * Errors:    those of bst_view_run_open */
bst_status bst_view_run_refresh(bst_ctx *ctx, bst_view_run *run) BST_MUST_CHECK;

/* Closes the files of a run and frees what was read, until it is asked for again. False: a call is
 * going on, or this process writes the run. */
bool bst_view_run_suspend(bst_view_run *run);

/* Says whether this process writes the run: it then counts as in progress, also between its parts.
 */
void bst_view_run_set_written(bst_view_run *run, bool written);

/* Describes the run: name, state, problems, figures, sensors with their panels.
 *
 * Errors:    those of bst_run_reader_open, while the run is in progress; BST_ERR_MEMORY
 * Ownership: free *out with cJSON_Delete */
bst_status bst_view_run_describe(bst_ctx *ctx, bst_view_run *run, cJSON **out) BST_MUST_CHECK;

/* Lists the changes of the controller's mode: {"modes": [{time_s, mode}]}.
 *
 * Errors:    BST_ERR_NOT_FOUND: no such sensor; BST_ERR_FORMAT: damaged tables */
bst_status bst_view_run_modes(bst_ctx *ctx, bst_view_run *run, int64_t sensor,
                              cJSON **out) BST_MUST_CHECK;

/* Names of the objects by their numbers in truth and tracks: {"names": {"0": "ASTRA 1N"}}.
 *
 * Errors:    those of bst_run_reader_open, while the run is in progress */
bst_status bst_view_run_names(bst_ctx *ctx, bst_view_run *run, cJSON **out) BST_MUST_CHECK;

/* Lists the first BST_VIEW_EVENTS events: {"total": N, "events": [{time_s, source, kind, text}]}.
 *
 * Errors:    BST_ERR_FORMAT: damaged tables */
bst_status bst_view_run_events(bst_ctx *ctx, bst_view_run *run, cJSON **out) BST_MUST_CHECK;

/* Lists the exposures of a sensor, also those whose pixels were not kept.
 *
 * Given:     sensor  from 0, in the order of the description
 * Returned:  out     rows of BST_VIEW_FRAME_NUMBERS doubles: exposure number, middle (s), exposure
 *                    time (s), index in the FITS file (-1: not kept), 1 if it was dropped
 * Errors:    BST_ERR_NOT_FOUND: no such sensor; BST_ERR_MEMORY */
bst_status bst_view_run_frames(bst_ctx *ctx, bst_view_run *run, int64_t sensor,
                               bst_view_bytes *out) BST_MUST_CHECK;

/* Describes a frame: WCS and calibration of its header; truth, detections and tracks in pixels of
 * the frame.
 *
 * Given:     frame  row of the list of frames, from 0
 * Errors:    BST_ERR_NOT_FOUND: no such sensor or frame */
bst_status bst_view_run_frame(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                              cJSON **out) BST_MUST_CHECK;

/* Most pixels of an answer. */
enum { BST_VIEW_PIXELS_MOST = 1 << 24 };

/* Pixels of a part of a frame, or the means of their bins. The frame is read in bands of rows, so
 * that the memory is that of the answer and a band, however large the frame is; of a compressed
 * frame only the rows of the part are unpacked.
 *
 * Given:     part  which part and bins (view/pixel_bins.h); {0}: the whole frame
 * Returned:  out   [height][width] digital numbers, 16 bits in the byte order of the machine; the
 *                  first row of the file is row 0
 * Errors:    BST_ERR_NOT_FOUND: no such frame, or its pixels were not kept; BST_ERR_ARGUMENT: the
 *            part is not within the frame, or has more than BST_VIEW_PIXELS_MOST pixels or bins;
 *            those of bst_fits_reader_rows */
bst_status bst_view_run_pixels(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                               const bst_view_part *part, bst_view_bytes *out) BST_MUST_CHECK;

/* A plot that is asked for. */
typedef struct bst_view_plot {
    int64_t sensor;
    const char *panel; /* its name in the description */
    double from_s, to_s;
    int columns; /* 1 to BST_VIEW_COLUMNS */
} bst_view_plot;

enum { BST_VIEW_COLUMNS = 4096 };

/* Lines of a panel, reduced to the columns of a plot.
 *
 * Returned:  out  doubles: for each line of the panel the number of extents, then time, low and
 *                 high of each (sim/io/decimate.h)
 * Errors:    BST_ERR_NOT_FOUND: no such sensor or panel; BST_ERR_ARGUMENT: range or columns;
 *            BST_ERR_FORMAT: damaged tables */
bst_status bst_view_run_plot(bst_ctx *ctx, bst_view_run *run, const bst_view_plot *plot,
                             bst_view_bytes *out) BST_MUST_CHECK;

#endif
