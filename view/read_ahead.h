/* Reads the plots of a run before its page asks for them: while the browser starts and the page
 * loads, and on several processors. */
#ifndef BST_VIEW_READ_AHEAD_H
#define BST_VIEW_READ_AHEAD_H

#include "view/recorded_run.h"

typedef struct bst_view_ahead bst_view_ahead;

/* Begins to read the description of a run and the plots of its first sensor, in threads that have
 * their own connections to its tables. Requests for a plot that is being read wait for it; others
 * do not. A run in progress is not read ahead: its tables are open for the time of a request only.
 *
 * Given:     run  stays open until bst_view_ahead_stop
 * Returned:  NULL: nothing is read ahead, also if there is no memory for it: requests read then
 * Ownership: end it with bst_view_ahead_stop */
bst_view_ahead *bst_view_ahead_start(bst_view_run *run);
/* Interrupts the queries of the threads, and waits for them; a description that is being made, for
 * which requests may wait too, is made first. NULL is allowed. */
void bst_view_ahead_stop(bst_view_ahead *ahead);

#endif
