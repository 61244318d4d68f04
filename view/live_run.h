/* A run that is steered while it goes on: pause, steps, rate, changes, saved states, branches. The
 * run is a folder like any other; the page reads it by the same routes. */
#ifndef BST_VIEW_LIVE_RUN_H
#define BST_VIEW_LIVE_RUN_H

#include "sim/run/run_parts.h"
#include "view/live_feed.h"
#include "view/subject.h"

typedef struct bst_view_live bst_view_live;

/* Prepares a live run. Its time begins with bst_view_live_go.
 *
 * Given:     parts    the scenario; used by bst_view_live_go alone from now on
 *            subject  gets the folder of the run, and those of its branches
 *            out      folder of the run; copied
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out_live with bst_view_live_free; `parts` and `subject` outlive it */
bst_status bst_view_live_create(bst_ctx *ctx, bst_run_parts *parts, bst_view_subject *subject,
                                const char *out, bst_view_live **out_live) BST_MUST_CHECK;
/* Prepares to watch a run that another caller steps: its page has no controls.
 *
 * Given:     as bst_view_live_create; the scenario is not kept
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out_live with bst_view_live_free, after the run */
bst_status bst_view_live_watch(bst_ctx *ctx, const bst_scenario *scenario,
                               bst_view_subject *subject, const char *out,
                               bst_view_live **out_live) BST_MUST_CHECK;
/* What bst_run_request.steering of a watched run is; it belongs to the live run. */
const bst_run_steering *bst_view_live_steering(bst_view_live *live);
/* Frees a live run; NULL is allowed. */
void bst_view_live_free(bst_view_live *live);

/* Runs it, in the calling thread, until a signal or a command ends it. It is paused at first.
 *
 * Given:     overwrite  replace an earlier run
 *            begun      called with `user` once simulation and folder are there
 * Errors:    those of bst_run_parts_run: the run has failed */
bst_status bst_view_live_go(bst_ctx *ctx, bst_view_live *live, bool overwrite,
                            void (*begun)(void *user), void *user) BST_MUST_CHECK;

/* Newest frames of the run; they belong to it. */
bst_view_feed *bst_view_live_feed(bst_view_live *live);

/* Takes a command; it is obeyed between two steps. Any thread.
 *
 * Given:     command  {"do": "pause"}, {"do": "run", "rate": x real time, 0: flat out},
 *                     {"do": "step", "frames": N}, {"do": "save"}, {"do": "end"},
 *                     {"do": "rewind", "state": ID}, {"do": "branch", "state": ID},
 *                     {"do": "set", "set": "/json/pointer=value"},
 *                     {"do": "burn", "object": NAME, "dv_rtn_mps": [R, T, N]}
 * Returned:  false: unknown, or too many are waiting */
bool bst_view_live_command(bst_view_live *live, const cJSON *command);

/* State of the run: {time_s, duration_s, paused, steps, rate, speed, ended, run, steered, changes,
 * obeyed: number of commands, message: of the last one, states: [{id, time_s, why}]}. Any thread;
 * delete it with cJSON_Delete. */
cJSON *bst_view_live_state(bst_view_live *live);

/* The scenario's text at the time of the run; free it with free. Any thread. NULL: none yet.
 */
char *bst_view_live_scenario(bst_view_live *live);

#endif
