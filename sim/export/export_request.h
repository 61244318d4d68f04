/* The options of boresight export. */
#ifndef BST_EXPORT_EXPORT_REQUEST_H
#define BST_EXPORT_EXPORT_REQUEST_H

#include "sim/cli/options.h"
#include "sim/export/export.h"

/* What the command line asks for. */
typedef struct bst_export_request {
    bst_export_parts parts;
    int stretch, angles, bits; /* indices of the words of these options */
    bool help;
} bst_export_request;

/* Request without any option given. */
#define BST_EXPORT_REQUEST_DEFAULTS                                                                \
    {                                                                                              \
        .parts =                                                                                   \
        {.e = {.last = INT64_C(9007199254740992), .every = 1, .box_px = 20.0, .star_limit = 10.0}, \
         .page_limit_mb = 20.0,                                                                    \
         .frames = BST_EXPORT_NOT,                                                                 \
         .table = BST_EXPORT_NOT,                                                                  \
         .orbits = BST_EXPORT_NOT,                                                                 \
         .observations = BST_EXPORT_NOT }                                                          \
    }

/* Table of the options, with offsets in a bst_export_request; bst_options_bind makes a table with
 * targets of it. */
extern const bst_option bst_export_options[];

/* Checks that the options given fit together, and derives the formats in request->parts.e.
 *
 * Errors:    BST_ERR_ARGUMENT: nothing to export, --last before --first, --fps without a film, or a
 *            --split that bst_export_split refuses */
bst_status bst_export_request_settle(bst_ctx *ctx, bst_export_request *request) BST_MUST_CHECK;

#endif
