/* What `boresight view` does: serves a recorded run, a live one, or the start page. */
#ifndef BST_VIEW_SESSION_H
#define BST_VIEW_SESSION_H

#include "sim/run/run_parts.h"

/* Options of the command. All zero but `load`: the defaults. */
typedef struct bst_view_session {
    bst_load_options load; /* of a live scenario */
    const char *device, *out;
    int64_t port, threads;
    const char *other; /* folder of a second run, to compare; NULL: none */
    bool help, no_browser, overwrite;
    bst_run_check check; /* of a live scenario, before its run */
} bst_view_session;

/* Serves a run or scenario until a signal asks for the end. Prints the address of the page and
 * opens a browser there.
 *
 * Given:     path  folder of a run or study; scenario file; NULL: the start page
 * Errors:    those of bst_view_server_start, and of what is opened */
bst_status bst_view_serve(bst_ctx *ctx, const bst_view_session *session,
                          const char *path) BST_MUST_CHECK;

#endif
