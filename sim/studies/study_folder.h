/* The folder of a study's results. */
#ifndef BST_STUDIES_STUDY_FOLDER_H
#define BST_STUDIES_STUDY_FOLDER_H

#include "sim/studies/study.h"

/* Creates the folder `out` if necessary, locks it and writes study.json.
 * Given: resume: the study may exist already; shared: a shared lock (shards of one study).
 * Returned: *lock, which the caller closes; -1 after an error.
 * Errors: BST_ERR_IO: the folder cannot be made, holds something else, or is locked;
 * BST_ERR_STATE: it contains another study, or this one without `resume`; BST_ERR_MEMORY. */
bst_status bst_study_folder_open(bst_ctx *ctx, const bst_study *study, const char *out, bool resume,
                                 bool shared, int *lock) BST_MUST_CHECK;

#endif
