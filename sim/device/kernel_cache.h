/* Cache of kernels that PoCL compiles on disk; without it PoCL offers no device. */
#ifndef BST_DEVICE_KERNEL_CACHE_H
#define BST_DEVICE_KERNEL_CACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <time.h>

#include "boresight/status.h"

/* True if PoCL cannot write its cache; `text`: folder, reason and remedy. The folder is chosen as
 * by PoCL 3 to 6: $POCL_CACHE_DIR, else pocl/kcache in $XDG_CACHE_HOME, in ~/.cache, or in /tmp. It
 * changes nothing on disk. */
bool bst_kernel_cache_is_unusable(char *text, size_t bytes);

/* Makes PoCL use a cache that only this user and root can write to, because it loads shared objects
 * from it: PoCL's default folder, or, if that belongs to another user or there is no HOME,
 * /tmp/boresight-UID/kcache (sets POCL_CACHE_DIR). Then removes damaged programs
 * (bst_kernel_cache_repair). Call it before any OpenCL function.
 * Errors: BST_ERR_DEVICE: POCL_CACHE_DIR names a folder that others can write to, or no folder is
 * this user's alone. */
bst_status bst_kernel_cache_prepare(bst_ctx *ctx) BST_MUST_CHECK;

/* Makes PoCL use the cache `folder`, which this user alone can write to, with the kernels that the
 * cache chosen as in bst_kernel_cache_prepare has now (bst_kernel_cache_link). */
void bst_kernel_cache_take(const char *folder);

/* Records the checksums of programs built since `since` (bst_kernel_cache_note). */
void bst_kernel_cache_settle(time_t since);

#endif
