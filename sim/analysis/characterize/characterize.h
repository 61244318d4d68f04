/* `boresight characterize`: a sensor's detector block from its bias, dark and flat frames. */
#ifndef BST_ANALYSIS_CHARACTERIZE_CHARACTERIZE_H
#define BST_ANALYSIS_CHARACTERIZE_CHARACTERIZE_H

#include <math.h>
#include <stdio.h>

#include "sim/analysis/characterize/frame_comparison.h"
#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_characterize_request {
    const char *map, *out, *extends, *camera;
    bst_option_list bias, dark, flat, linearity, simulated, warm;
    double pixel_pitch_um, warmer_k;
    bool overwrite, maps, help;
} bst_characterize_request;

/* Request without any option given. */
#define BST_CHARACTERIZE_REQUEST_DEFAULTS \
    { .camera = "/observers/0/sensors/0/camera", .pixel_pitch_um = 13.0, .warmer_k = NAN }

/* Table of the options, with offsets in a bst_characterize_request. */
extern const bst_option bst_characterize_options[];

/* Reads the frames, computes the figures, prints them and writes the folder request->out:
 * detector.json, report.json, dark_map.fits, prnu_map.fits, plot.png (docs/how-to/characterize.md).
 *
 * Errors:    BST_ERR_ARGUMENT: no frames, or frames that do not belong together; those of the files
 *            and outputs */
bst_status bst_characterize_run(bst_ctx *ctx, const bst_characterize_request *request,
                                FILE *out) BST_MUST_CHECK;

/* Name in JSON and unit of a figure. */
typedef struct bst_sensor_figure_name {
    const char *key, *unit;
    const char *camera_key; /* of the camera in a scenario; NULL: the model does not have it */
} bst_sensor_figure_name;

extern const bst_sensor_figure_name bst_sensor_figure_names[BST_SENSOR_FIGURES];

/* Statistics of the last real and of the last simulated frame. */
typedef struct bst_characterize_comparison {
    bool made;
    const char *kind; /* of the real frames */
    bst_frame_statistics real, simulated;
} bst_characterize_comparison;

/* Draws plot.png of the folder: spectrum of the rows, dark current, linearity and photon transfer,
 * radiation hits; none without any of these.
 *
 * Errors:    those of the outputs */
bst_status bst_characterize_plot(bst_ctx *ctx, const char *folder, const bst_sensor_stacks *stacks,
                                 const bst_sensor_figures *figures,
                                 const bst_characterize_comparison *comparison) BST_MUST_CHECK;

/* Writes the files of the folder.
 *
 * Errors:    those of the outputs */
bst_status bst_characterize_write(bst_ctx *ctx, const bst_characterize_request *request,
                                  const bst_sensor_stacks *stacks,
                                  const bst_sensor_figures *figures,
                                  const bst_characterize_comparison *comparison) BST_MUST_CHECK;

#endif
