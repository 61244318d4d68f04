/* PoCL's cache of compiled kernels on disk, without which it offers no device and builds nothing.
 */
#ifndef BST_DEVICE_KERNEL_CACHE_H
#define BST_DEVICE_KERNEL_CACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <time.h>

#include "boresight/status.h"

/* Whether PoCL cannot write its cache; then `text` says so, which folder it is, why, and what to
 * do. The folder is, as PoCL 3 to 6 choose it, $POCL_CACHE_DIR, else pocl/kcache in
 * $XDG_CACHE_HOME, in ~/.cache, or in /tmp. Changes nothing on disk. */
bool bst_kernel_cache_is_unusable(char *text, size_t bytes);

/* Makes PoCL use a cache that only this user and root can write to, since it loads the shared
 * objects that are in there: the folder that it would choose; where that is another user's, or
 * there is no HOME, /tmp/boresight-UID/kcache (sets POCL_CACHE_DIR). Then removes damaged programs
 * from it (bst_kernel_cache_repair). Before the first call of OpenCL.
 * Errors: BST_ERR_DEVICE: POCL_CACHE_DIR names a folder that others can write to, or no folder is
 * this user's alone. */
bst_status bst_kernel_cache_prepare(bst_ctx *ctx) BST_MUST_CHECK;

/* Writes down the sums of what was built since `since` (bst_kernel_cache_note). */
void bst_kernel_cache_settle(time_t since);

#endif
