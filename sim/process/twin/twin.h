/* `boresight twin`: a scenario that renders what a recorded frame shows. */
#ifndef BST_PROCESS_TWIN_TWIN_H
#define BST_PROCESS_TWIN_TWIN_H

#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_twin_request {
    const char *map; /* name of a shipped keyword map, or path of one */
    const char *out; /* the scenario */
    const char *catalogue, *device;
    double scale_arcsec, scale_tolerance, v_limit, least_snr; /* as in bst_process_request */
    int flip;
    int64_t frame; /* that gets a twin, from 1; 0: the first with an attitude */
    int64_t threads;
    bool catalogue_only; /* fluxes by the catalogue, no other stars */
    bool overwrite, quiet, help;
    const bst_option *table; /* of the command line, with targets: its outputs are protected */
} bst_twin_request;

/* Request without any option given. */
#define BST_TWIN_REQUEST_DEFAULTS \
    { .catalogue = "default", .scale_tolerance = 0.05, .least_snr = 12.0 }

/* Table of the options, with offsets in a bst_twin_request. */
extern const bst_option bst_twin_options[];

/* Makes the twin of a frame: finds its attitude, fits the path of the line of sight, PSF,
 * background and stars to the pixels, writes the scenario and what it reads, runs it, and compares
 * its frame with the recorded one.
 *
 * Given:     paths, count  files, folders and lists as bst_recorded_frames_open takes them
 * Returned:  request->out and files beside it; docs/how-to/real_frames.md
 * Errors:    BST_ERR_ARGUMENT: an output is an input or is there already; no frame has an
 *            attitude; those of the files, the map, the catalogue and the run;
 *            BST_ERR_INTERRUPTED */
bst_status bst_twin_make(bst_ctx *ctx, const bst_twin_request *request, const char *const *paths,
                         int count) BST_MUST_CHECK;

#endif
