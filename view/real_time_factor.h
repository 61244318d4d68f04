/* The speed of a run over time, from its file wall_clock.csv (sim/run/run_wall_clock.h). */
#ifndef BST_VIEW_REAL_TIME_FACTOR_H
#define BST_VIEW_REAL_TIME_FACTOR_H

#include <stdbool.h>

#include "boresight/status.h"

/* Takes a sample: time of the run (s), and simulated over wall time up to it. */
typedef bst_status (*bst_view_take_factor)(bst_ctx *ctx, void *user, double time_s, double factor);

/* True if a file says how fast a run was. */
bool bst_view_has_wall_clock(const char *path);

/* Reads the real-time factors of a run: of the interval that ends at each row, at least 0.05 s of
 * wall time. Lines that are no rows are left out.
 *
 * Errors:    those of `take`; a file that cannot be read has no samples */
bst_status bst_view_read_factors(bst_ctx *ctx, const char *path, bst_view_take_factor take,
                                 void *user) BST_MUST_CHECK;

#endif
