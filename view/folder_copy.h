/* Copies of a run's folder, for branches of a live run. */
#ifndef BST_VIEW_FOLDER_COPY_H
#define BST_VIEW_FOLDER_COPY_H

#include "boresight/status.h"

/* Copies the files of a complete run that another run can go on with: tables, frames, scenario.
 *
 * Given:     from  folder of the run
 *            to    folder, which is created
 * Errors:    BST_ERR_IO with the file and the reason. Nothing remains then. */
bst_status bst_view_copy_run(bst_ctx *ctx, const char *from, const char *to) BST_MUST_CHECK;
/* Removes a copy that nothing has gone on with. */
void bst_view_remove_copy(const char *folder);

#endif
