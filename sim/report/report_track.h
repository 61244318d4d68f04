/* The track of interest of a report's sensor, judged against the truth. */
#ifndef BST_REPORT_REPORT_TRACK_H
#define BST_REPORT_REPORT_TRACK_H

#include "sim/report/report.h"

/* Fills what the frames say of attitude and track of interest from the tables track_frames and
 * tracks: its error against the true direction (bst_report_frame), its NEES
 * e' P^-1 e with the direction's part P of its covariance (Bar-Shalom, Li and Kirubarajan 2001,
 * section 5.4), and whether it is the target's as in the run's summary: confirmed or coasting,
 * within 5 px of the true direction at mid-exposure; a frame without an answer of the tracker is
 * judged by the latest track. */
bst_status bst_report_read_tracks(bst_ctx *ctx, const bst_run_reader *run,
                                  bst_report_sensor *sensor) BST_MUST_CHECK;

#endif
