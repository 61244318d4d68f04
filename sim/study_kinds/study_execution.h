/* Executes a study: all runs that have no results, then the tables. */
#ifndef BST_STUDY_KINDS_STUDY_EXECUTION_H
#define BST_STUDY_KINDS_STUDY_EXECUTION_H

#include "sim/studies/kind.h"
#include "sim/study_kinds/study_request.h"

/* Reads the files and folders that a request names beside the study, so that a mistake is found
 * before a folder is made.
 *
 * Errors:    those of bst_study_gather_check, bst_scheduler_load and bst_slurm_site_load */
bst_status bst_study_check_inputs(bst_ctx *ctx, const bst_study_request *request) BST_MUST_CHECK;

/* Executes the missing runs of a study with worker processes or Slurm, writes the tables once all
 * runs are done, and prints the outcome to stdout and errors to stderr.
 *
 * Given:     kind  its `user` is a bst_study_plugins
 *            out   folder of the results
 * Returned:  exit status: BST_EXIT_OK, BST_EXIT_FAILED if runs are missing, BST_EXIT_RUNS_FAILED,
 *            or BST_EXIT_INTERRUPTED */
int bst_study_execute(bst_ctx *ctx, const bst_study_request *request, const bst_study *study,
                      const bst_study_kind *kind, const char *out);

#endif
