/* One allocation for arrays that belong together: one error path, one free.
 *
 * The owner writes the list of its arrays once, in a function that takes each from the arena. The
 * function runs twice: the first time with an empty arena, which only adds up the bytes; after
 * bst_arena_alloc it runs again and sets the pointers.
 *
 *     static void lay_out(table *t, size_t rows, bst_arena *arena) {
 *         BST_ARENA_TAKE(arena, t->key, rows);
 *         BST_ARENA_TAKE(arena, t->value, rows);
 *     }
 *     ...
 *     lay_out(t, rows, &arena);
 *     BST_TRY(bst_arena_alloc(ctx, &arena, "a table"));
 *     lay_out(t, rows, &arena);
 *
 * Under the address sanitizer a poisoned gap lies behind each array. */
#ifndef BST_CORE_ARENA_H
#define BST_CORE_ARENA_H

#include <assert.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "boresight/status.h"
#include "sim/core/pages.h"

#if defined(__SANITIZE_ADDRESS__)
#define BST_ARENA_GAP 64
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define BST_ARENA_GAP 64
#endif
#endif
#ifdef BST_ARENA_GAP
#include <sanitizer/asan_interface.h>
#else
#define BST_ARENA_GAP 0
#define ASAN_POISON_MEMORY_REGION(address, bytes) ((void)(address), (void)(bytes))
#endif

/* Zero-initialise. Free with bst_arena_free. */
typedef struct bst_arena {
    char *memory;      /* NULL while the bytes are added up */
    size_t used, room; /* bytes */
    bool overflow;     /* the bytes exceed SIZE_MAX */
} bst_arena;

/* Alignment of an array, that of malloc. */
enum { BST_ARENA_ALIGNMENT = 16 };

/* Memory for `count` elements of `bytes` each, zero; NULL while the bytes are added up. */
static inline void *bst_arena_take(bst_arena *a, size_t count, size_t bytes) {
    const size_t extra = BST_ARENA_GAP + BST_ARENA_ALIGNMENT - 1;
    if (a->overflow || (bytes > 0 && count > (SIZE_MAX - extra) / bytes)) {
        a->overflow = true;
        return NULL;
    }
    size_t padded = (count * bytes + extra) / BST_ARENA_ALIGNMENT * BST_ARENA_ALIGNMENT;
    if (padded > SIZE_MAX - a->used) {
        a->overflow = true;
        return NULL;
    }
    void *taken = a->memory ? a->memory + a->used : NULL;
    a->used += padded;
    if (taken) {
        assert(a->used <= a->room);
        ASAN_POISON_MEMORY_REGION((char *)taken + count * bytes, padded - count * bytes);
    }
    return taken;
}

/* Sets an array's pointer to memory for `count` elements of its type. */
#define BST_ARENA_TAKE(arena, array, count) \
    ((array) = bst_arena_take(arena, count, sizeof *(array)))

/* Allocates what was added up, zero; arrays are then taken anew. BST_ERR_MEMORY. */
static inline bst_status bst_arena_alloc(bst_ctx *ctx, bst_arena *a, const char *what) {
    assert(!a->memory);
    a->memory = a->overflow ? NULL : bst_pages_zero(1, a->used + 1);
    if (!a->memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %s", what);
    }
    a->room = a->used;
    a->used = 0;
    return BST_OK;
}

/* Frees all arrays that were taken. */
static inline void bst_arena_free(bst_arena *a) {
    bst_pages_free(a->memory);
    *a = (bst_arena){0};
}

#endif
