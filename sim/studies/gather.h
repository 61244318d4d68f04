/* Brings the rows of a study together that machines without a shared folder have made. */
#ifndef BST_STUDIES_GATHER_H
#define BST_STUDIES_GATHER_H

#include "sim/studies/results.h"

/* Checks that `from` is the folder of a study. BST_ERR_NOT_FOUND: it has no folder "shards". */
bst_status bst_study_gather_check(bst_ctx *ctx, const char *from) BST_MUST_CHECK;

/* Loads the shards of the folder `from` and publishes copies of their files in the folder `out`,
 * whose lock is held. Damaged files are left out with a warning; files that are there already are
 * kept.
 *
 * Given:     results  of the study; existing rows are kept
 * Returned:  *files   number of files copied
 * Errors:    BST_ERR_STATE: shards of another study; BST_ERR_IO; BST_ERR_MEMORY */
bst_status bst_study_gather(bst_ctx *ctx, bst_results *results, const char *from, const char *out,
                            int64_t *files) BST_MUST_CHECK;

#endif
