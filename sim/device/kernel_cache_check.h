/* Integrity checks of PoCL's cached kernels, which are loaded into the process. */
#ifndef BST_DEVICE_KERNEL_CACHE_CHECK_H
#define BST_DEVICE_KERNEL_CACHE_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <time.h>

/* Removes programs with a damaged file from the cache folder `root`, so that PoCL builds them again
 * (PoCL 3 to 6 abort the process for such files). Damaged: a file (*.so, *.bc) of another user,
 * with invalid ELF or LLVM structure, or different from its record by bst_kernel_cache_note.
 * Returned: number of removed programs. */
int bst_kernel_cache_repair(const char *root);

/* Records size, time and FNV-1a checksum of the files of programs changed since `since`:
 * ROOT/XX/PROGRAM/boresight.sums. */
void bst_kernel_cache_note(const char *root, time_t since);

/* Makes the kernels of the cache `root` known to the cache `to` on the same file system, by hard
 * links: PoCL replaces such files by renaming and never writes into one. Kernels of `to` stay. A
 * damaged program, as in bst_kernel_cache_repair, is not linked; its checksums stay with `root`.
 * What is not linked (another file system, a path of 4096 bytes or more) is compiled in `to` when
 * it is needed. */
void bst_kernel_cache_link(const char *root, const char *to);

#endif
