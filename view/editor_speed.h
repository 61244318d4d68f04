/* The speed of a scenario, measured on its beginning. */
#ifndef BST_VIEW_EDITOR_SPEED_H
#define BST_VIEW_EDITOR_SPEED_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

/* Processor time of a trial run, s; it has half of that again by the clock. */
enum { BST_VIEW_SPEED_LIMIT_S = 40 };
/* Longest simulated time of a trial run, s. */
#define BST_VIEW_SPEED_SPAN_S 600.0

/* Runs the beginning of a text, without frames on disk, in a temporary folder that is removed.
 *
 * Given:     body  {"text": TEXT, "duration_s": simulated time, 0 to BST_VIEW_SPEED_SPAN_S}
 * Returned:  *out  {real_time_factor, wall_time_s, duration_s}, or {problem} of a run that failed
 *                  or took too long
 * Errors:    BST_ERR_ARGUMENT: bad body; BST_ERR_IO: no temporary folder; those of
 *            bst_view_child_run
 * Ownership: free *out with cJSON_Delete */
bst_status bst_view_editor_speed(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

#endif
