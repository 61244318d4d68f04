/* Text of a shard: which runs of a study it holds. */
#ifndef BST_STUDIES_SHARD_RANGE_H
#define BST_STUDIES_SHARD_RANGE_H

#include "sim/studies/executor.h"

/* Reads "3/8", the third of eight parts whose sizes differ by at most one run; "env/8", the part
 * whose number is that of this job in an array, from the environment: BORESIGHT_SHARD_INDEX (from
 * 0), else the variable of Kubernetes, AWS Batch, Slurm, SGE or LSF; or "40:20", the 20 runs from
 * run 40 on.
 *
 * Given:     runs  of the study, below 2^53
 * Returned:  job->first, job->count
 *            *exact  true for FIRST:COUNT
 * Errors:    BST_ERR_ARGUMENT: neither form, no number in the environment, or runs that the study
 *            does not have */
bst_status bst_study_shard_range(bst_ctx *ctx, const char *text, int64_t runs,
                                 bst_study_shard_job *job, bool *exact) BST_MUST_CHECK;

#endif
