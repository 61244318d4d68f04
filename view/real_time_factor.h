/* The speed of a run over time, from its file wall_clock.csv (sim/run/run_wall_clock.h). */
#ifndef BST_VIEW_REAL_TIME_FACTOR_H
#define BST_VIEW_REAL_TIME_FACTOR_H

#include <stdbool.h>

#include "view/plot_samples.h"

/* True if a file says how fast a run was. */
bool bst_view_has_wall_clock(const char *path);

/* Adds the real-time factors of a run to samples: of the interval that ends at each row, at least
 * 0.05 s of wall time. Lines that are no rows are left out.
 *
 * Errors:    those of bst_view_collect; a file that cannot be read has no samples */
bst_status bst_view_read_factors(bst_ctx *ctx, const char *path,
                                 bst_view_samples *out) BST_MUST_CHECK;

#endif
