/* Large arrays on large pages, so that walking through them does not wait for page tables. */
#ifndef BST_CORE_PAGES_H
#define BST_CORE_PAGES_H

#include <stddef.h>

/* Memory aligned for vectors (64 bytes), its content undefined; NULL when there is none. From 4 MiB
 * on the system is asked for pages of 2 MiB, which it may decline. Freed by free(). */
void *bst_pages_alloc(size_t bytes);

#endif
