/* `boresight challenge`: random sequences of frames with hidden truth, for detectors of others. */
#ifndef BST_ANALYSIS_CHALLENGE_CHALLENGE_H
#define BST_ANALYSIS_CHALLENGE_CHALLENGE_H

#include "sim/cli/options.h"

enum { BST_CHALLENGE_FRAMES = 5 /* of a sequence, as spotGEO has them */ };

/* What the command line asks for. */
typedef struct bst_challenge_request {
    const char *out; /* folder */
    const char *catalogue, *device;
    uint64_t seed;
    int64_t sequences, size_px, threads;
    bool help;
    const bst_option *table; /* of the command line, with targets: its outputs are protected */
} bst_challenge_request;

/* Request without any option given. */
#define BST_CHALLENGE_REQUEST_DEFAULTS \
    { .catalogue = "default", .sequences = 8, .size_px = 640 }

/* Table of the options, with offsets in a bst_challenge_request. */
extern const bst_option bst_challenge_options[];

/* Draws a camera and sequences, renders them, and writes public/ (frames.fits, frames.csv) and
 * truth/ (truth.csv, and the scenario and run that gave it) into the folder request->out.
 *
 * Errors:    BST_ERR_ARGUMENT: the folder exists; those of the run and the outputs */
bst_status bst_challenge_make(bst_ctx *ctx, const bst_challenge_request *request) BST_MUST_CHECK;

/* Writes the random scenario: scenario.json and updates.json in a folder.
 *
 * Given:     folder  exists
 * Errors:    BST_ERR_MEMORY, BST_ERR_IO */
bst_status bst_challenge_write_scenario(bst_ctx *ctx, const bst_challenge_request *request,
                                        const char *folder) BST_MUST_CHECK;

#endif
