/* What a server shows: the runs that it has opened, any number of them. The files of those that
 * were not asked for lately are closed. */
#ifndef BST_VIEW_SUBJECT_H
#define BST_VIEW_SUBJECT_H

#include "view/launch.h"
#include "view/recorded_run.h"

typedef struct bst_view_subject bst_view_subject;

/* Creates a subject without runs.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_view_subject_free */
bst_status bst_view_subject_create(bst_ctx *ctx, bst_view_subject **out) BST_MUST_CHECK;
/* Closes the runs and frees the subject; NULL is allowed. */
void bst_view_subject_free(bst_view_subject *subject);

/* Opens the folder of a run, or finds it if it is open.
 *
 * Returned:  *number  by which requests name the run, 0 for the first
 * Errors:    those of bst_view_run_open; BST_ERR_MEMORY */
bst_status bst_view_subject_open(bst_ctx *ctx, bst_view_subject *subject, const char *path,
                                 int64_t *number) BST_MUST_CHECK;

/* Shows a study: its folder, which the subject copies.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_view_subject_set_study(bst_ctx *ctx, bst_view_subject *subject,
                                      const char *folder) BST_MUST_CHECK;
/* Folder of the study that is shown; NULL: none. Set before the server starts, so without a lock.
 */
const char *bst_view_subject_study(const bst_view_subject *subject);

/* Path of an open run as it was given; it belongs to the subject. "" for a number that is none. */
const char *bst_view_subject_path(bst_view_subject *subject, int64_t number);

/* Number of runs that are open. */
int64_t bst_view_subject_count(bst_view_subject *subject);
/* What starts live runs from the page; it belongs to the subject. */
bst_view_launcher *bst_view_subject_launcher(bst_view_subject *subject);

/* A run by its number. It stays open as long as the subject.
 *
 * Errors:    BST_ERR_NOT_FOUND */
bst_status bst_view_subject_run(bst_ctx *ctx, bst_view_subject *subject, int64_t number,
                                bst_view_run **out) BST_MUST_CHECK;

#endif
