/* Live runs that are started from the page: each is a viewer of its own, which ends with this one.
 */
#ifndef BST_VIEW_LAUNCH_H
#define BST_VIEW_LAUNCH_H

#include "boresight/status.h"

typedef struct bst_view_launcher bst_view_launcher;

/* Room for the address of a viewer with the zero byte. */
enum { BST_VIEW_LAUNCH_URL_BYTES = 128 };

/* Creates a launcher.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_view_launcher_free */
bst_status bst_view_launcher_create(bst_ctx *ctx, bst_view_launcher **out) BST_MUST_CHECK;
/* Ends the viewers that were started, as Ctrl-C does, and frees the launcher; NULL is allowed. */
void bst_view_launcher_free(bst_view_launcher *launcher);

/* Starts a viewer of a scenario.
 *
 * Given:     scenario  file; does not begin with "-"
 * Returned:  url       address of its page: begins with "http://127.0.0.1:"
 * Errors:    BST_ERR_STATE: too many run; BST_ERR_IO; BST_ERR_CONFIG: the scenario cannot run, with
 *            the viewer's own reason, or is not ready in time; the viewer has ended then */
bst_status bst_view_launch(bst_ctx *ctx, bst_view_launcher *launcher, const char *scenario,
                           char url[BST_VIEW_LAUNCH_URL_BYTES]) BST_MUST_CHECK;

#endif
