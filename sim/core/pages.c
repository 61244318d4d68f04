#define _DEFAULT_SOURCE /* madvise, MAP_ANONYMOUS */
#include "sim/core/pages.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define VECTOR ((size_t)64)
#define LARGE_PAGE ((size_t)2 << 20)
/* bytes below which clearing memory costs less than mapping pages and their first use */
#define SMALL ((size_t)32 << 10)

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

/* True for more than an address space has. */
static bool is_too_large(size_t count, size_t bytes) {
    return bytes > 0 && count > (PTRDIFF_MAX - VECTOR) / bytes;
}

#if defined(__SANITIZE_ADDRESS__)
/* the sanitizer knows the ends of what the allocator gives */
void *bst_pages_zero(size_t count, size_t bytes) {
    if (is_too_large(count, bytes)) {
        return NULL;
    }
    return calloc(count > 0 ? count : 1, bytes > 0 ? bytes : 1);
}

void bst_pages_free(void *memory) {
    free(memory);
}
#else
void *bst_pages_zero(size_t count, size_t bytes) {
    if (is_too_large(count, bytes)) {
        return NULL;
    }
    size_t whole = count * bytes + VECTOR, mapped = whole < SMALL ? 0 : whole;
    void *memory;
    if (mapped == 0) {
        if (posix_memalign(&memory, VECTOR, whole) != 0) {
            return NULL;
        }
        memset(memory, 0, whole);
    } else {
        memory = mmap(NULL, whole, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) {
            return NULL;
        }
    }
    *(size_t *)memory = mapped; /* before the array: the size to unmap */
    return (char *)memory + VECTOR;
}

void bst_pages_free(void *memory) {
    if (memory) {
        void *whole = (char *)memory - VECTOR;
        size_t mapped = *(size_t *)whole;
        if (mapped == 0) {
            free(whole);
        } else {
            (void)munmap(whole, mapped);
        }
    }
}
#endif
