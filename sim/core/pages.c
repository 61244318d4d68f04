#define _DEFAULT_SOURCE /* madvise */
#include "sim/core/pages.h"

#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>

#define VECTOR ((size_t)64)
#define LARGE_PAGE ((size_t)2 << 20)

void *bst_pages_alloc(size_t bytes) {
    size_t align = bytes >= 2 * LARGE_PAGE ? LARGE_PAGE : VECTOR;
    void *memory;
    if (bytes > PTRDIFF_MAX || posix_memalign(&memory, align, bytes ? bytes : align) != 0) {
        return NULL;
    }
#ifdef MADV_HUGEPAGE
    if (align == LARGE_PAGE) {
        /* whole pages only: the remainder is shared with other allocations */
        (void)madvise(memory, bytes / LARGE_PAGE * LARGE_PAGE, MADV_HUGEPAGE);
    }
#endif
    return memory;
}
