/* Allocates large arrays on large pages, which need fewer TLB entries. */
#ifndef BST_CORE_PAGES_H
#define BST_CORE_PAGES_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Allocates memory aligned to 64 bytes, uninitialised; NULL: out of memory. From 4 MiB on it
 * requests pages of 2 MiB, which the system may decline. Free with free(). */
void *bst_pages_alloc(size_t bytes);

/* Allocates zeros whose pages the system provides at their first use: a large array costs what is
 * used of it, also when the allocator has memory to reuse, which calloc would clear. A small one
 * comes from the allocator.
 *
 * Returned:  aligned to 64 bytes; NULL: out of memory. Free with bst_pages_free */
void *bst_pages_zero(size_t count, size_t bytes);
/* Frees memory of bst_pages_zero; NULL is allowed. */
void bst_pages_free(void *memory);

#ifdef __cplusplus
}
#endif

#endif
