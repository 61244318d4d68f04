/* Growing memory blocks. */
#ifndef BST_CORE_MEMORY_H
#define BST_CORE_MEMORY_H

#include <stddef.h>
#include <stdlib.h>

#include "boresight/status.h"

/* Extends *memory to at least `bytes`; *room: its size. BST_ERR_MEMORY, "PROBLEM for N bytes": both
 * are unchanged. */
static inline bst_status bst_memory_grow(bst_ctx *ctx, const char *problem, void **memory,
                                         size_t *room, size_t bytes) {
    if (*room < bytes) {
        void *more = realloc(*memory, bytes);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s for %zu bytes", problem, bytes);
        }
        *memory = more;
        *room = bytes;
    }
    return BST_OK;
}

#endif
