/* The lines of the plots that need the target's truth, read at once. */
#ifndef BST_VIEW_PLOT_TRUTH_H
#define BST_VIEW_PLOT_TRUTH_H

#include "view/recorded_run_internal.h"

/* Reads pointing error, SNR, and error of the target's tracks in one pass over the truth.
 *
 * Given:     s      sensor, with a target
 *            error  line: distance from the boresight, px
 *            snr    line
 *            angle  line: distance of the tracks' directions, arcsec
 * Returned:  *done  false: there are too many rows, and the lines must be read one by one
 * Errors:    BST_ERR_MEMORY, BST_ERR_IO, those of bst_io_rows_next; the lines are empty */
bst_status bst_view_read_truth(bst_ctx *ctx, bst_view_run *run, const bst_view_sensor *s,
                               bst_view_line *error, bst_view_line *snr, bst_view_line *angle,
                               bool *done) BST_MUST_CHECK;

#endif
