/* Allocates large arrays on large pages, which need fewer TLB entries. */
#ifndef BST_CORE_PAGES_H
#define BST_CORE_PAGES_H

#include <stddef.h>

/* Allocates memory aligned to 64 bytes, uninitialised; NULL: out of memory. From 4 MiB on it
 * requests pages of 2 MiB, which the system may decline. Free with free(). */
void *bst_pages_alloc(size_t bytes);

#endif
