/* Reads the track of interest of a sensor from the tables and compares it with the truth, for the
 * report. */
#ifndef BST_REPORT_REPORT_TRACK_H
#define BST_REPORT_REPORT_TRACK_H

#include "sim/report/report.h"

/* Fills attitude and track of interest of the report frames from the tables track_frames and
 * tracks.
 *
 * Notes:     error against the true direction; NEES e' P^-1 e with the direction part P
 *            of the covariance (Bar-Shalom, Li and Kirubarajan 2001, section 5.4). in_track follows
 *            the run's summary: confirmed or coasting, within 5 px of the true direction at
 *            mid-exposure. A frame without tracks is compared with the latest track. */
bst_status bst_report_read_tracks(bst_ctx *ctx, const bst_run_reader *run,
                                  bst_report_sensor *sensor) BST_MUST_CHECK;

#endif
