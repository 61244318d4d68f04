/* List of the files of recorded frames. */
#ifndef BST_IO_RECORDED_FILES_INTERNAL_H
#define BST_IO_RECORDED_FILES_INTERNAL_H

#include "boresight/status.h"

/* Paths of files; all zero: none. */
typedef struct bst_recorded_files {
    char **paths; /* [count], owned */
    int count, room;
} bst_recorded_files;

/* Adds a file, the files of a folder, or those of a list; see bst_recorded_frames_open. */
bst_status bst_recorded_files_add(bst_ctx *ctx, bst_recorded_files *files,
                                  const char *path) BST_MUST_CHECK;
/* Frees the paths. */
void bst_recorded_files_free(bst_recorded_files *files);

#endif
