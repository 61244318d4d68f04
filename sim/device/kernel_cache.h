/* PoCL's cache of compiled kernels on disk, without which it offers no device and builds nothing.
 */
#ifndef BST_DEVICE_KERNEL_CACHE_H
#define BST_DEVICE_KERNEL_CACHE_H

#include <stdbool.h>
#include <stddef.h>

/* Whether PoCL cannot write its cache; then `text` says so, which folder it is, why, and what to
 * do. The folder is, as PoCL 3 to 6 choose it, $POCL_CACHE_DIR, else pocl/kcache in
 * $XDG_CACHE_HOME, in ~/.cache, or in /tmp. Changes nothing on disk. */
bool bst_kernel_cache_is_unusable(char *text, size_t bytes);

#endif
