/* Names of the files that runs and studies write into their folders. */
#ifndef BST_IO_RUN_FILES_H
#define BST_IO_RUN_FILES_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* page that "boresight report" writes into the folder of a run or study */
#define BST_RUN_PAGE "report.html"

/* Length of a folder's path without the slashes at its end; "/" has 1. */
size_t bst_run_folder_length(const char *path);

/* True if a run writes files of this name (without folder): tables, manifest, scenario, frames,
 * planes, pictures, recorded packets, lock, and their drafts. */
bool bst_run_owns(const char *name);

/* True if a study writes files of this name: tables, CSV files, description, lock, shards and kept
 * runs. */
bool bst_io_study_owns(const char *name);

/* True if a folder holds a run, complete or not. */
bool bst_io_folder_is_run(const char *folder);
/* True if a folder holds a study (study.sqlite or shards). */
bool bst_io_folder_is_study(const char *folder);

#ifdef __cplusplus
}
#endif

#endif
