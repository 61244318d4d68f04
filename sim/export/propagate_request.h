/* The options of boresight propagate. */
#ifndef BST_EXPORT_PROPAGATE_REQUEST_H
#define BST_EXPORT_PROPAGATE_REQUEST_H

#include "sim/astro/sgp4.h"
#include "sim/cli/options.h"
#include "sim/export/export_states.h"

/* Value of states.frame until bst_propagate_request_settle chooses one. */
enum { BST_PROPAGATE_FRAME_DEFAULT = -1 };

/* What the command line asks for. */
typedef struct bst_propagate_request {
    bst_export_states_request states;
    const char *start_text, *stop_text, *norad_text;
    double step_s;
    bool help;
} bst_propagate_request;

/* Request without any option given. */
#define BST_PROPAGATE_REQUEST_DEFAULTS            \
    {                                             \
        .states = {                               \
            .frame = BST_PROPAGATE_FRAME_DEFAULT, \
            .gravity = BST_SGP4_WGS72,            \
            .mode = BST_SGP4_IMPROVED             \
        }                                         \
    }

/* Table of the options, with offsets in a bst_propagate_request. */
extern const bst_option bst_propagate_options[];

/* Reads the texts of the request and checks that its options fit together: fills in
 * request->states. Rows run from --start in steps of SI seconds up to and with --stop.
 *
 * Errors:    BST_ERR_ARGUMENT: --elements is missing, a frame that does not go with the format or
 *            --eop, a wrong catalogue number, --stop before --start, a step that is not whole
 *            microseconds, or too many rows; those of bst_time_from_utc */
bst_status bst_propagate_request_settle(bst_ctx *ctx,
                                        bst_propagate_request *request) BST_MUST_CHECK;

#endif
