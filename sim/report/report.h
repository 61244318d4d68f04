/* Functions of `boresight report`: one self-contained HTML page about a run or a study. */
#ifndef BST_REPORT_REPORT_H
#define BST_REPORT_REPORT_H

#include <stdio.h>

#include "boresight/messages.h"
#include "sim/core/sha256.h"
#include "sim/engine/scenario/scenario.h"
#include "sim/eval/loop_figures.h"
#include "sim/io/chart.h"
#include "sim/io/html.h"
#include "sim/run/run_losses.h"
#include "sim/run/run_observations.h"

/* ---- report_page.c: the page's own elements ---- */

/* Random-looking word that marks the page's own scripts and styles: a digest of the manifest and
 * of the title, so that the same folder gives the same page.
 *
 * Given:     manifest  NULL: none
 * Errors:    BST_ERR_MEMORY */
bst_status bst_report_page_nonce(bst_ctx *ctx, const struct cJSON *manifest, const char *title,
                                 char nonce[BST_SHA256_TEXT]) BST_MUST_CHECK;
/* Writes the head of the HTML page; `title`: its first heading. */
void bst_report_page_begin(FILE *out, const char *title, const char *nonce);
/* Ends the HTML page with the modules that make its charts interactive.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_report_page_end(bst_ctx *ctx, FILE *out, const char *nonce) BST_MUST_CHECK;

/* Begins a section with a heading.
 *
 * Given:     level  2 or 3 */
void bst_report_page_section(FILE *out, int level, const char *heading);
/* Ends a section. */
void bst_report_page_section_end(FILE *out);
typedef enum bst_page_width { BST_PAGE_WIDE, BST_PAGE_HALF, BST_PAGE_THIRD } bst_page_width;
/* Begins a grid of figures of a half or third of the page width. */
void bst_report_page_grid(FILE *out, bst_page_width width);
/* Ends a grid of figures. */
void bst_report_page_grid_end(FILE *out);
/* Begins a figure around a chart. */
void bst_report_page_figure(FILE *out, bst_page_width width);
/* Ends a figure with its caption, plain text. */
void bst_report_page_figure_end(FILE *out, const char *caption);
/* Writes a card with a key figure; `unit` and `note` may be "". */
void bst_report_page_card(FILE *out, const char *value, const char *unit, const char *name,
                          const char *note);
/* Writes a row of a two-column table. */
void bst_report_page_row(FILE *out, const char *name, const char *format, ...) BST_PRINTF(3, 4);
/* Formats a number with significant digits, "12.3"; "-" for NAN. */
const char *bst_report_page_number(char text[32], double value, int digits);

/* ---- warnings, gathered before the page begins ---- */

enum { BST_REPORT_WARNINGS = 128 };

typedef struct bst_report_warnings {
    struct {
        bst_run_severity severity;
        char text[400];
    } items[BST_REPORT_WARNINGS];
    int count;
    int more; /* warnings beyond the capacity */
} bst_report_warnings;

/* Adds a warning; those beyond BST_REPORT_WARNINGS are only counted.
 *
 * Given:     format  printf-style */
void bst_report_warnings_add(bst_report_warnings *warnings, bst_run_severity severity,
                             const char *format, ...) BST_PRINTF(3, 4);
/* Writes the section "Warnings", the most severe first. */
void bst_report_warnings_write(FILE *out, const bst_report_warnings *warnings);

/* ---- report_data.c: what one sensor recorded, frame by frame ---- */

/* Values of one frame for the report; NAN: unknown. Errors are those of
 * bst_eval_pointing_error_px. */
typedef struct bst_report_frame {
    int64_t exposure_id;
    double mid_s, end_s;
    double tracked_s; /* time of publication of its tracks */
    double boresight_x_px, boresight_y_px;
    double error_px, error_x_px, error_y_px;
    double snr;               /* true SNR of the target, in the field and illuminated */
    double track_snr;         /* of the detection assigned to the track of interest */
    double detections, stars; /* recorded detections, and those identified as stars */
    double track_east_arcsec,
        track_north_arcsec;    /* error of the track of interest against the true direction */
    double track_sigma_arcsec; /* sqrt of the trace of its direction covariance */
    double nees;               /* of its direction, 2 degrees of freedom */
    double v_mag, range_m, phase_rad;         /* of the target */
    double ra_deg, dec_deg;                   /* apparent direction of the boresight */
    double target_ra_deg, target_dec_deg;     /* true, geometric with light time */
    double apparent_ra_deg, apparent_dec_deg; /* true, with aberration if known */
    double sun_rad, limb_rad; /* angles from the boresight to the Sun and to the Earth's limb */
    double latitude_rad, longitude_rad;     /* sub-satellite point of the observer */
    bool known;                             /* the target's true direction is known */
    bool visible, occulted, in_field, dark; /* of the target; dark: not illuminated */
    bool attitude;                          /* a stellar attitude was determined */
    bool in_track, acquired, settled;       /* as in bst_loop_frame */
    bool task_begins;                       /* first frame of a new task */
    bool updated;                           /* the track of interest was updated by this frame */
    bool dropped;
    int mode; /* bst_mode at the end of the exposure, -1: unknown */
} bst_report_frame;

/* Converts a report frame for the loop figures (sim/eval/loop_figures.h). */
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
    int64_t exposures;        /* number of all exposures */
    int64_t every;            /* `frames` has every n-th exposure */
    bst_report_frame *frames; /* sorted by time */
    size_t count;
    bst_report_mode *modes; /* changes of mode */
    size_t mode_count;
    /* from the run's summary; of a killed run, computed from `frames` by the same rules, without
     * time to confirm and wrong_target_frames */
    bst_loop_figures loop;
    double real_time_factor; /* NAN: unknown */
    int64_t bad_pixels;      /* learned by image processing until the end */
    int64_t track_frames;    /* frames with track errors in the summary; 0: none */
    double track_rms_px, track_median_px, track_p95_px, track_max_px;
    double smoothed_rms_px, smoothed_filtered_rms_px; /* NAN: no smoothed tracks */
    /* all tracks against all objects, from the summary; 0 and NAN: none */
    int64_t scored_frames, id_switches, ghosts;
    double gospa_px, ospa2_px, track_purity;
    bool has_truth;    /* the true direction of the target is known in some frame */
    bool has_tracks;   /* tracks were recorded */
    size_t task_count; /* number of successive targets */
    bool damaged;      /* a table could not be read completely */
} bst_report_sensor;

/* Reads the recorded data of a sensor for the report. `scene`: the run's world; NULL: not
 * available, recorded values are used. `summary`: the sensor's part of the manifest; NULL: none.
 * Missing tables leave NAN. */
bst_status bst_report_read(bst_ctx *ctx, const bst_run_reader *run, bst_run_scene *scene,
                           const bst_run_sensor *sensor, const struct cJSON *summary,
                           bst_report_sensor *out) BST_MUST_CHECK;
/* Frees the memory of the series of a sensor and clears the struct, which belongs to the caller. */
void bst_report_sensor_free(bst_report_sensor *sensor);

/* ---- report_figures.c: the figures of a sensor's loop ---- */

/* Marks acquired and settled frames, and fills the loop figures: from `summary` (NULL: none), the
 * others computed from the frames by sim/eval/loop_figures.h. */
void bst_report_judge(bst_report_sensor *sensor, const struct cJSON *summary);

/* ---- the parts ---- */

/* Name of the run's folder, without its parents. */
const char *bst_report_folder(const bst_run_reader *run, char text[256]);
/* Removes the path of the run's folder from a message, so that pages do not depend on it. */
const char *bst_report_local(const bst_run_reader *run, const char *message);

/* Collects warnings about a run from manifest, counters, tables and events. */
void bst_report_run_warnings(bst_run_reader *run, const bst_report_sensor *sensors, int count,
                             const bst_scenario *scenario, bst_report_warnings *warnings);
/* Writes the charts of a sensor into the HTML page. `span_s`: simulated duration so far. */
bst_status bst_report_plots(bst_ctx *ctx, FILE *out, const bst_report_sensor *sensor,
                            double span_s) BST_MUST_CHECK;
/* Writes the chart of a spacecraft's wheels; nothing without table `wheels`.
 *
 * Given:     sensor  row of the table sensors */
bst_status bst_report_wheels(bst_ctx *ctx, FILE *out, const bst_run_reader *run, int64_t sensor,
                             double span_s) BST_MUST_CHECK;
/* Writes selected frames with overlays into the page. Unreadable frames are reported on the page
 * and as problems of the run. */
bst_status bst_report_frames(bst_ctx *ctx, FILE *out, bst_run_reader *run,
                             const bst_report_sensor *sensor) BST_MUST_CHECK;

/* Writes the section on sightings of a run with several objects and the table passes; nothing for
 * others. */
bst_status bst_report_sightings(bst_ctx *ctx, FILE *out, const bst_run_reader *run,
                                double span_s) BST_MUST_CHECK;

/* Writes the section on the custody of the catalogue; nothing for runs without record.custody. */
bst_status bst_report_custody(bst_ctx *ctx, FILE *out, const bst_run_reader *run,
                              double span_s) BST_MUST_CHECK;

/* Writes the HTML page of a run. */
bst_status bst_report_run(bst_ctx *ctx, bst_run_reader *run, FILE *out) BST_MUST_CHECK;

#endif
