/* Internal state of a recorded run, shared by recorded_run.c, describe.c, frame_details.c,
 * frame_part.c and plots.c. */
#ifndef BST_VIEW_RECORDED_RUN_INTERNAL_H
#define BST_VIEW_RECORDED_RUN_INTERNAL_H

#include <pthread.h>

#include "sim/io/decimate.h"
#include "sim/io/fits_reader.h"
#include "sim/io/fits_source.h"
#include "sim/run/run_observations.h"
#include "sim/run/run_sensors.h"
#include "view/recorded_run.h"

/* Lines of all panels of a sensor, and panels. */
enum { BST_VIEW_LINES = 34, BST_VIEW_PANELS = 14 };

/* An exposure of a sensor. */
typedef struct bst_view_exposure {
    int64_t id, fits_index; /* fits_index: in the order of the file, from 0; -1: not kept */
    double mid_s, exposure_s;
    double x0_px, y0_px, binning; /* window on the sensor */
    bool dropped;
} bst_view_exposure;

/* A line of a panel; read at its first use. */
typedef struct bst_view_line {
    bst_io_sample *samples; /* NULL: not read */
    size_t count;
    uint64_t used; /* number of the last request for it */
} bst_view_line;

typedef struct bst_view_sensor {
    bst_run_sensor sensor;
    int64_t target; /* row of the table objects; -1: none */
    int64_t width_px, height_px;
    double pixel_scale_arcsec; /* NAN: unknown */
    bst_view_exposure *exposures;
    size_t count;
    bst_fits_reader *pixels; /* NULL: not open */
    bst_fits_source *header; /* NULL: not open */
    bool listed, no_header;  /* no_header: the headers cannot be read */
    bst_view_line lines[BST_VIEW_LINES];
    signed char recorded[BST_VIEW_LINES]; /* 1: the line is worth showing; -1: it is not; 0: unknown
                                           */
} bst_view_sensor;

struct bst_view_run {
    pthread_mutex_t lock;   /* of everything below: readers of tables and files are not shared */
    char path[4096];        /* of the folder, as it was given */
    bst_run_reader *reader; /* NULL between calls while the run is in progress */
    bool written;           /* by this process, now */
    bool running;           /* it was in progress when its sensors were read */
    bool suspended;         /* what was read about the sensors was freed */
    int endings;            /* looks in a row at which it was about to end */
    int sensors;
    bst_view_sensor sensor[BST_EXPORT_SENSORS];
    uint64_t requests;
    size_t samples;                         /* held by all lines */
    bst_run_scene *scene;                   /* its world; NULL: not made (view/space_scene.c) */
    struct bst_view_thumbnails *thumbnails; /* NULL: none (view/thumbnail_store.h) */
    /* of what is read ahead (view/read_ahead.h), with a lock of its own */
    pthread_mutex_t ahead_lock;
    pthread_cond_t ahead_changed;
    bool ahead[BST_VIEW_PANELS]; /* panels of the first sensor that are being read */
};

/* Begins a call: locks the run and opens its tables if they are not open. End it with
 * bst_view_unlock, also after an error.
 *
 * Errors:    those of bst_run_reader_open */
bst_status bst_view_lock(bst_ctx *ctx, bst_view_run *run) BST_MUST_CHECK;

/* Ends a call. The tables of a run in progress are closed: an open connection would keep the run
 * from merging its journal at its end. */
void bst_view_unlock(bst_view_run *run);

/* Finds a sensor by its number and lists its exposures. Call it with the lock held.
 *
 * Errors:    BST_ERR_NOT_FOUND; BST_ERR_MEMORY; BST_ERR_FORMAT: damaged tables */
bst_status bst_view_find_sensor(bst_ctx *ctx, bst_view_run *run, int64_t number,
                                bst_view_sensor **out) BST_MUST_CHECK;

/* Reads rows of a frame (bst_fits_reader_rows). Call it with the lock held.
 *
 * Returned:  *out  belongs to the reader of the sensor, until its next rows
 * Errors:    BST_ERR_NOT_FOUND: no such frame, or its pixels were not kept; those of
 *            bst_fits_reader_rows */
bst_status bst_view_read_rows(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                              int first, int rows, bst_fits_read_frame *out) BST_MUST_CHECK;

/* Rows of bins of n x n pixels that are read at a time: a million pixels, at least one row of bins.
 */
int bst_view_band_rows(int width, int n);

/* Fits a part to a frame, and begins its answer.
 *
 * Given:     width, height  of the frame, px
 * Returned:  part  as bst_view_fit_part
 *            out   sizes and places; data: room for its pixels
 * Errors:    BST_ERR_ARGUMENT: the part is not within the frame, or has more than
 *            BST_VIEW_PIXELS_MOST pixels or bins; BST_ERR_MEMORY
 * Ownership: free out->data, also after an error */
bst_status bst_view_begin_part(bst_ctx *ctx, bst_view_part *part, int width, int height,
                               bst_view_bytes *out) BST_MUST_CHECK;

/* Rows of a table from the first of an exposure on.
 *
 * Given:     sensor    row of the table sensors
 *            columns   that are read behind exposure_id
 *            exposure  number of the exposure
 * Errors:    those of bst_io_rows_open: not recorded
 * Ownership: close *out with bst_io_rows_close */
bst_status bst_view_open_from(bst_ctx *ctx, const bst_view_run *run, int64_t sensor,
                              const char *table, const char *columns, int64_t exposure,
                              bst_io_rows **out) BST_MUST_CHECK;

/* Ends a description: deletes it after an error, *out is then NULL. Returns the status. */
bst_status bst_view_keep(bst_status status, cJSON **out);

/* Reads the lines of a panel of a sensor that are not held; none if the panel is not shown.
 *
 * Errors:    those of bst_view_run_plot */
bst_status bst_view_read_panel(bst_ctx *ctx, bst_view_run *run, int sensor,
                               int panel) BST_MUST_CHECK;
/* Takes over which lines are worth showing from the same run, opened before.
 *
 * Given:     to  belongs to the caller alone */
void bst_view_take_looks(bst_view_run *to, bst_view_run *from, int sensor);
/* Moves the lines of a panel to the same run, opened again. Lines that it holds stay, and those for
 * which it has no room are left.
 *
 * Given:     from  belongs to the caller alone
 * Returned:  run   has the lines; nothing happens if its sensors are not there */
void bst_view_take_lines(bst_view_run *run, bst_view_run *from, int sensor, int panel);
/* Says that the panels from `first` to before `end` of the first sensor are being read: requests
 * for them wait. */
void bst_view_begin_wait(bst_view_run *run, int first, int end);
/* Ends the waiting for a panel. */
void bst_view_end_wait(bst_view_run *run, int panel);

/* Adds the panels of a sensor to its description: [{name, title, unit, lines}]. */
void bst_view_add_panels(const bst_view_run *run, bst_view_sensor *sensor, cJSON *out);

#endif
