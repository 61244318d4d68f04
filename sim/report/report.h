/* The parts of boresight report: a page of HTML that holds all it shows. */
#ifndef BST_REPORT_REPORT_H
#define BST_REPORT_REPORT_H

#include <stdio.h>

#include "boresight/messages.h"
#include "sim/engine/scenario/scenario.h"
#include "sim/eval/loop_figures.h"
#include "sim/io/chart.h"
#include "sim/io/html.h"
#include "sim/run/run_losses.h"
#include "sim/run/run_observations.h"

/* ---- report_page.c: the page's own elements ---- */

/* Head of the page; `title` is its first heading. */
void bst_report_page_begin(FILE *out, const char *title);
/* Ends the HTML page. */
void bst_report_page_end(FILE *out);

/* Begins a section with a heading.
 *
 * Given:     level  2 or 3 */
void bst_report_page_section(FILE *out, int level, const char *heading);
/* Ends a section. */
void bst_report_page_section_end(FILE *out);
typedef enum bst_page_width { BST_PAGE_WIDE, BST_PAGE_HALF, BST_PAGE_THIRD } bst_page_width;
/* A grid of figures of half or a third of the page, as many beside each other as there is room for.
 */
void bst_report_page_grid(FILE *out, bst_page_width width);
/* Ends a grid of figures. */
void bst_report_page_grid_end(FILE *out);
/* A figure round a chart. */
void bst_report_page_figure(FILE *out, bst_page_width width);
/* Ends a figure with its caption, plain text. */
void bst_report_page_figure_end(FILE *out, const char *caption);
/* A box with a figure that is to be seen at once; `unit` and `note` may be "". */
void bst_report_page_card(FILE *out, const char *value, const char *unit, const char *name,
                          const char *note);
/* A row of a table of two columns. */
void bst_report_page_row(FILE *out, const char *name, const char *format, ...) BST_PRINTF(3, 4);
/* "12.3", with so many significant digits; "-" for what is not a number. */
const char *bst_report_page_number(char text[32], double value, int digits);

/* ---- warnings, gathered before the page begins ---- */

enum { BST_REPORT_WARNINGS = 128 };

typedef struct bst_report_warnings {
    struct {
        bst_run_severity severity;
        char text[400];
    } items[BST_REPORT_WARNINGS];
    int count;
    int more; /* that found no room */
} bst_report_warnings;

/* Adds a warning; those beyond BST_REPORT_WARNINGS are only counted.
 *
 * Given:     format  printf-style */
void bst_report_warnings_add(bst_report_warnings *warnings, bst_run_severity severity,
                             const char *format, ...) BST_PRINTF(3, 4);
/* The section "Warnings": the worst first, otherwise in their order. */
void bst_report_warnings_write(FILE *out, const bst_report_warnings *warnings);

/* ---- report_data.c: what one sensor recorded, frame by frame ---- */

/* NAN: not known. Errors are bst_eval_pointing_error_px's. */
typedef struct bst_report_frame {
    int64_t exposure_id;
    double mid_s, end_s;
    double tracked_s; /* when its tracks were published */
    double boresight_x_px, boresight_y_px;
    double error_px, error_x_px, error_y_px;
    double snr;               /* true one of the target, in the field and shining */
    double track_snr;         /* of the detection that the track of interest got */
    double detections, stars; /* kept, and of these identified as stars */
    double track_east_arcsec, track_north_arcsec; /* track of interest from the true direction */
    double track_sigma_arcsec;                    /* sqrt of the trace of its covariance */
    double nees;                                  /* of its direction, 2 degrees of freedom */
    double v_mag, range_m, phase_rad;             /* of the target */
    double ra_deg, dec_deg;                       /* of the boresight, apparent */
    double target_ra_deg, target_dec_deg;         /* true, geometric with light time */
    double apparent_ra_deg, apparent_dec_deg;     /* true, with aberration where that is known */
    double sun_rad, limb_rad;           /* from the boresight to the Sun, and to the Earth's limb */
    double latitude_rad, longitude_rad; /* below the observer */
    bool known;                         /* the target's true direction is */
    bool visible, occulted, in_field, dark; /* of the target; dark: no sunlight at all */
    bool attitude;                          /* stars gave an attitude */
    bool in_track, acquired, settled;       /* as in bst_loop_frame */
    bool task_begins;                       /* it is the first of another target */
    bool updated; /* the track of interest got a detection of this frame */
    bool dropped;
    int mode; /* bst_mode at the end of the exposure, -1: not known */
} bst_report_frame;

/* The frame as the loop's figures take it. */
bst_loop_frame bst_report_loop_frame(const bst_report_frame *frame);

typedef struct bst_report_mode {
    double from_s;
    int mode;
} bst_report_mode;

typedef struct bst_report_sensor {
    bst_run_sensor sensor;
    char name[164]; /* "observer/sensor" */
    int64_t width_px, height_px;
    double pixel_scale_arcsec;
    int64_t exposures;        /* all of them */
    int64_t every;            /* each so-manieth of them is among `frames` */
    bst_report_frame *frames; /* in the order of time */
    size_t count;
    bst_report_mode *modes; /* changes of mode */
    size_t mode_count;
    /* of the run's summary; of a run without one (it was killed) by the same rules from `frames`,
     * but for the time to confirm and wrong_target_frames */
    bst_loop_figures loop;
    double real_time_factor; /* NAN: not known */
    int64_t bad_pixels;      /* that image processing had learned at the end */
    int64_t track_frames;    /* track errors of the summary; 0: none */
    double track_rms_px, track_median_px, track_p95_px, track_max_px;
    bool has_truth;    /* the target's true place is known in some frame */
    bool has_tracks;   /* there is a tracker, and its work was recorded */
    size_t task_count; /* targets that it was given in turn */
    bool damaged;      /* some table could not be read to its end */
} bst_report_sensor;

/* Reads it. `scene` is the run's world; NULL when it cannot be made again: what was recorded must
 * do then. `summary`: the sensor's in the manifest (cJSON), NULL: none. Tables that are missing
 * leave their columns NAN. */
bst_status bst_report_read(bst_ctx *ctx, const bst_run_reader *run, bst_run_scene *scene,
                           const bst_run_sensor *sensor, const struct cJSON *summary,
                           bst_report_sensor *out) BST_MUST_CHECK;
/* Frees the memory of the series of a sensor and clears the struct, which belongs to the caller. */
void bst_report_sensor_free(bst_report_sensor *sensor);

/* ---- report_figures.c: the figures of a sensor's loop ---- */

/* Marks the frames that are acquired and settled, and fills the sensor's figures: those of
 * `summary` (NULL: none), the others by the rules of sim/eval/loop_figures.h from the frames. */
void bst_report_judge(bst_report_sensor *sensor, const struct cJSON *summary);

/* ---- the parts ---- */

/* The last part of the folder's path. */
const char *bst_report_folder(const bst_run_reader *run, char text[256]);
/* A message about a file of the run without the path of the run's folder: pages do not depend on
 * where it is. */
const char *bst_report_local(const bst_run_reader *run, const char *message);

/* What the manifest, counters, tables and events of a run say of what went wrong. */
void bst_report_run_warnings(bst_run_reader *run, const bst_report_sensor *sensors, int count,
                             const bst_scenario *scenario, bst_report_warnings *warnings);
/* The charts of a sensor. `span_s`: length of the run as far as it went. */
bst_status bst_report_plots(bst_ctx *ctx, FILE *out, const bst_report_sensor *sensor,
                            double span_s) BST_MUST_CHECK;
/* Some of its frames, with what the tables know of them drawn over. Where they
 * cannot be read the page and the run's problems say so. */
bst_status bst_report_frames(bst_ctx *ctx, FILE *out, bst_run_reader *run,
                             const bst_report_sensor *sensor) BST_MUST_CHECK;

/* Who saw what, of a run with several objects and the table passes; nothing of others. */
bst_status bst_report_sightings(bst_ctx *ctx, FILE *out, const bst_run_reader *run,
                                double span_s) BST_MUST_CHECK;

/* The whole page of a run. */
bst_status bst_report_run(bst_ctx *ctx, bst_run_reader *run, FILE *out) BST_MUST_CHECK;

#endif
