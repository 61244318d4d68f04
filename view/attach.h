/* A page that shows a run while another caller steps it. */
#ifndef BST_VIEW_ATTACH_H
#define BST_VIEW_ATTACH_H

#include "sim/run/run_scenario.h"

typedef struct bst_view_attached bst_view_attached;

/* Starts a server for a run that is about to begin, prints its address and opens a browser there.
 *
 * Given:     scenario  not kept
 *            out       folder of the run
 * Errors:    those of bst_view_live_watch and bst_view_server_start
 * Ownership: end it with bst_view_detach, after the run */
bst_status bst_view_attach(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                           bst_view_attached **attached) BST_MUST_CHECK;
/* For bst_run_request.steering; NULL for NULL. It belongs to `attached`. */
const bst_run_steering *bst_view_attached_steering(const bst_view_attached *attached);
/* Stops the server; NULL is allowed. */
void bst_view_detach(bst_view_attached *attached);

#endif
