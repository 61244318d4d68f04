/* The file of a report: where it goes, and writing it. */
#ifndef BST_REPORT_REPORT_FILE_H
#define BST_REPORT_REPORT_FILE_H

#include <stdbool.h>

#include "boresight/status.h"

/* Chooses the path of a page: report.html in `folder`, or what is given: a file, or a folder that
 * gets a report.html.
 *
 * Given:     given   path of a file or folder; NULL: none
 *            folder  of the run or study
 * Errors:    BST_ERR_ARGUMENT if the path is too long */
bst_status bst_report_path(bst_ctx *ctx, const char *given, const char *folder,
                           char path[4096]) BST_MUST_CHECK;

/* Writes the page about a run or a study, and prints the problems of its folder to stderr.
 *
 * Given:     folder    of the run or study
 *            out       as `given` of bst_report_path
 * Returned:  path      of the page
 *            *damaged  set to true if the folder has problems; else left as it is
 * Errors:    those of reading the folder and writing the file; no file is left then */
bst_status bst_report_write(bst_ctx *ctx, const char *folder, const char *out, char path[4096],
                            bool *damaged) BST_MUST_CHECK;

#endif
