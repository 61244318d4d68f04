/* Text of a shard: which runs of a study it holds. */
#ifndef BST_STUDIES_SHARD_RANGE_H
#define BST_STUDIES_SHARD_RANGE_H

#include "sim/studies/executor.h"

/* Reads "3/8", the third of eight parts whose sizes differ by at most one run, or "40:20", the 20
 * runs from run 40 on.
 *
 * Given:     runs  of the study, below 2^53
 * Returned:  job->first, job->count
 *            *exact  true for FIRST:COUNT
 * Errors:    BST_ERR_ARGUMENT: neither form, or runs that the study does not have */
bst_status bst_study_shard_range(bst_ctx *ctx, const char *text, int64_t runs,
                                 bst_study_shard_job *job, bool *exact) BST_MUST_CHECK;

#endif
