/* Arrays that grow with what a run shows, and their part of a saved state. */
#ifndef BST_EVAL_GROWING_H
#define BST_EVAL_GROWING_H

#include <stdint.h>

#include "boresight/archive.h"
#include "sim/core/memory.h"

/* Gives an array room for `count` items of `bytes`.
 *
 * Given:     items  the array, NULL if it is empty; moved
 *            room   its number of items; updated
 * Errors:    BST_ERR_MEMORY */
static inline bst_status bst_grow(bst_ctx *ctx, void **items, int count, int *room, size_t bytes) {
    if (count <= *room) {
        return BST_OK;
    }
    int more = count < INT32_MAX / 2 ? count + count / 2 + 16 : INT32_MAX;
    size_t held = (size_t)*room * bytes;
    BST_TRY(bst_memory_grow(ctx, "out of memory for the figures of tracks", items, &held,
                            (size_t)more * bytes));
    *room = more;
    return BST_OK;
}

/* Saves or restores such an array of items without pointers.
 *
 * Errors:    BST_ERR_MEMORY */
static inline bst_status bst_grow_archive(bst_archive *archive, void **items, int *count, int *room,
                                          size_t bytes) {
    *count = bst_archive_count(archive, *count, INT32_MAX / 2);
    bst_status status = bst_grow(bst_archive_ctx(archive), items, *count, room, bytes);
    if (status != BST_OK) {
        *count = 0;
        return status;
    }
    if (*count > 0) {
        bst_archive_bytes(archive, *items, (size_t)*count * bytes);
    }
    return BST_OK;
}

#endif
