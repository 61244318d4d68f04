/* `boresight process`: frames of other programs through the chain that flies in the simulator. */
#ifndef BST_PROCESS_PROCESS_H
#define BST_PROCESS_PROCESS_H

#include "sim/cli/options.h"

enum { BST_PROCESS_FLIP_AUTO, BST_PROCESS_FLIP_NO, BST_PROCESS_FLIP_YES };

/* What the command line asks for. */
typedef struct bst_process_request {
    const char *map; /* name of a shipped keyword map, or path of one */
    const char *out; /* folder */
    const char *catalogue, *device;
    double scale_arcsec; /* 0: from the headers */
    double scale_tolerance;
    double v_limit; /* 0: the map's star_limit_v_mag */
    double least_snr;
    int flip;            /* BST_PROCESS_FLIP_... */
    bst_option_list set; /* overrides of the scenario */
    int64_t threads;
    bool overwrite, prepare, quiet, help;
    const bst_option *table; /* of the command line, with targets: its outputs are protected */
} bst_process_request;

/* Request without any option given. */
#define BST_PROCESS_REQUEST_DEFAULTS \
    { .catalogue = "default", .scale_tolerance = 0.05, .least_snr = 12.0 }

/* Table of the options, with offsets in a bst_process_request. */
extern const bst_option bst_process_options[];

/* Processes frames: reads the headers, finds the attitude and the streaks of each frame from its
 * stars, writes a scenario with recorded frames, runs it, and writes what it found.
 *
 * Given:     paths, count  files, folders and lists as bst_recorded_frames_open takes them
 * Returned:  in the folder request->out: input/ (scenario, pointing, map), run/ (folder of the
 *            run), products/, report.html; docs/how-to/real_frames.md
 * Errors:    BST_ERR_ARGUMENT: frames of several sizes, or not in the order of time; those of the
 *            files, the map, the run and the outputs; BST_ERR_INTERRUPTED */
bst_status bst_process_frames(bst_ctx *ctx, const bst_process_request *request,
                              const char *const *paths, int count) BST_MUST_CHECK;

#endif
