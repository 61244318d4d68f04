/* The folder that a study's results go into. */
#ifndef BST_STUDIES_STUDY_FOLDER_H
#define BST_STUDIES_STUDY_FOLDER_H

#include "sim/studies/study.h"

/* Makes the folder `out` where it is missing, locks it and writes study.json.
 * Given: resume, whether the study may be there already; shared, whether others may hold the lock
 * so too (shards of one study).
 * Returned: *lock, which the caller closes; -1 after an error.
 * Errors: BST_ERR_IO: the folder cannot be made, holds something else, or is locked;
 * BST_ERR_STATE: it holds another study, or this one without `resume`; BST_ERR_MEMORY. */
bst_status bst_study_folder_open(bst_ctx *ctx, const bst_study *study, const char *out, bool resume,
                                 bool shared, int *lock) BST_MUST_CHECK;

#endif
