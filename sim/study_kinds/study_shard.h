/* One shard of a study, executed in this process for a scheduler of the user. */
#ifndef BST_STUDY_KINDS_STUDY_SHARD_H
#define BST_STUDY_KINDS_STUDY_SHARD_H

#include "sim/studies/kind.h"
#include "sim/study_kinds/study_request.h"

/* Executes the runs of request->shard (bst_study_shard_range) that have no results, and prints what
 * was done to stdout and errors to stderr.
 *
 * Given:     out  folder of the study
 * Returned:  exit status: BST_EXIT_OK, BST_EXIT_USAGE for a wrong text of the shard,
 *            BST_EXIT_INTERRUPTED or BST_EXIT_FAILED */
int bst_study_execute_shard(bst_ctx *ctx, const bst_study_request *request, const bst_study *study,
                            const bst_study_kind *kind, const char *out);

#endif
