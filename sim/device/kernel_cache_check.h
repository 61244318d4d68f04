/* Whether PoCL's cached kernels, which are loaded into the process, can be trusted and are whole.
 */
#ifndef BST_DEVICE_KERNEL_CACHE_CHECK_H
#define BST_DEVICE_KERNEL_CACHE_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <time.h>

/* Removes the programs of the cache folder `root` that hold a damaged file, so that PoCL builds
 * them anew; PoCL 3 to 6 abort the process for such a file. Damaged is a file (*.so, *.bc) of
 * another user, one that is no whole ELF or LLVM file, and one that differs from what
 * bst_kernel_cache_note wrote down. Returned: how many programs were removed. */
int bst_kernel_cache_repair(const char *root);

/* Writes down size, time and FNV-1a sum of the files of those programs that were changed since
 * `since`: ROOT/XX/PROGRAM/boresight.sums. */
void bst_kernel_cache_note(const char *root, time_t since);

#endif
