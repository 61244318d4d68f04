/* The wall clock of a run: file wall_clock.csv, which says how long the stepping to a time of the
 * run has taken. It is no table of run.sqlite: it differs each time that a scenario is run. */
#ifndef BST_RUN_RUN_WALL_CLOCK_H
#define BST_RUN_RUN_WALL_CLOCK_H

#include <stdbool.h>

#include "boresight/status.h"

#define BST_RUN_WALL_CLOCK "wall_clock.csv"

typedef struct bst_run_wall_clock bst_run_wall_clock;

/* Begins the file, with a row at `begin_s`; or goes on with that of a run that goes on, without its
 * rows after `begin_s`.
 *
 * Given:     path     of the file
 *            resumes  the run goes on in its folder
 *            begin_s  time of the run from which it is stepped, s since the epoch
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY
 * Ownership: free *out with bst_run_wall_clock_close */
bst_status bst_run_wall_clock_open(bst_ctx *ctx, const char *path, bool resumes, double begin_s,
                                   bst_run_wall_clock **out) BST_MUST_CHECK;

/* Counts wall time until the next bst_run_wall_clock_go. It does not run before the first one. */
void bst_run_wall_clock_go(bst_run_wall_clock *clock);
/* Leaves out wall time from now on: the run waits for someone. */
void bst_run_wall_clock_stop(bst_run_wall_clock *clock);

/* Adds a row if the last one is old enough: 0.2 s of wall time, from 400 s on a 2000th of what
 * passed, so that a run of any length has some thousand rows.
 *
 * Given:     clock   NULL: nothing is done
 *            time_s  of the run, s since the epoch */
void bst_run_wall_clock_note(bst_run_wall_clock *clock, double time_s);

/* Adds the last row and closes the file; NULL is allowed.
 *
 * Errors:    BST_ERR_IO: the file could not be written */
bst_status bst_run_wall_clock_close(bst_ctx *ctx, bst_run_wall_clock *clock,
                                    double time_s) BST_MUST_CHECK;

#endif
