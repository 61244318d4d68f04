#include "sim/world/name_index.h"

#include <assert.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct bst_name_index {
    size_t slots; /* a power of two, at least twice the number of names */
    int count;
    struct {
        const char *name;
        int number;
    } slot[];
};

bst_status bst_name_index_create(bst_ctx *ctx, int capacity, bst_name_index **out) {
    size_t slots = 16;
    while (slots < 2 * (size_t)capacity) {
        slots *= 2;
    }
    bst_name_index *index = calloc(1, sizeof *index + slots * sizeof index->slot[0]);
    *out = index;
    if (!index) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the names of %d objects", capacity);
    }
    index->slots = slots;
    return BST_OK;
}

void bst_name_index_free(bst_name_index *index) {
    free(index);
}

/* The slot of object name `name`, or the free slot for it. Hash: FNV-1a (Fowler, Noll, Vo). */
static size_t slot_of(const bst_name_index *index, const char *name) {
    uint64_t hash = 14695981039346656037u;
    for (const char *c = name; *c; c++) {
        hash = (hash ^ (unsigned char)*c) * 1099511628211u;
    }
    size_t i = (size_t)(hash ^ hash >> 32) & (index->slots - 1);
    while (index->slot[i].name && strcmp(index->slot[i].name, name) != 0) {
        i = (i + 1) & (index->slots - 1);
    }
    return i;
}

int bst_name_index_find(const bst_name_index *index, const char *name) {
    size_t i = slot_of(index, name);
    return index->slot[i].name ? index->slot[i].number : -1;
}

void bst_name_index_add(bst_name_index *index, const char *name, int number) {
    size_t i = slot_of(index, name);
    assert(!index->slot[i].name && 2 * (size_t)index->count < index->slots);
    index->slot[i].name = name;
    index->slot[i].number = number;
    index->count++;
}
