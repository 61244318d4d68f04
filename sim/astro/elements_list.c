/* Growing list of element sets, filled by the readers. */
#include <stdlib.h>

#include "sim/astro/elements_internal.h"

bst_elements_reader bst_elements_start(bst_ctx *ctx, const char *name,
                                       const bst_elements_options *options) {
    bst_elements_reader reader = {.source = {ctx, name}};
    if (options) {
        reader.options = *options;
    }
    return reader;
}

bst_status bst_elements_append(bst_elements_reader *r, const bst_elements *set) {
    if (r->count == r->capacity) {
        int capacity = r->capacity ? 2 * r->capacity : 16;
        bst_elements *sets = realloc(r->sets, (size_t)capacity * sizeof *sets);
        if (!sets) {
            return bst_fail(r->source.ctx, BST_ERR_MEMORY, "%.400s: no memory for %d element sets",
                            r->source.name, capacity);
        }
        r->sets = sets;
        r->capacity = capacity;
    }
    r->sets[r->count++] = *set;
    return BST_OK;
}

bst_status bst_elements_tolerate(bst_elements_reader *r, bst_status status) {
    if (status == BST_ERR_FORMAT && r->options.skip_bad_sets) {
        r->skipped++;
        bst_log(r->source.ctx, BST_LOG_WARNING, "%s; element set left out",
                r->source.ctx ? r->source.ctx->message : "");
        if (r->source.ctx) {
            r->source.ctx->message[0] = '\0';
        }
        return BST_OK;
    }
    return status;
}

bst_status bst_elements_finish(bst_elements_reader *r, bst_status status, bool empty,
                               const char *expected, bst_elements **out, int *count) {
    bst_ctx *ctx = r->source.ctx;
    *out = NULL;
    *count = 0;
    if (status == BST_OK && r->count == 0) {
        if (empty) {
            status = bst_fail(ctx, BST_ERR_FORMAT, "%.400s:1: the file is empty (expected %s)",
                              r->source.name, expected);
        } else if (r->others > 0) {
            status = bst_fail(ctx, BST_ERR_NOT_FOUND,
                              "%.400s: no element set of satellite %d, only %d of others",
                              r->source.name, r->options.norad, r->others);
        } else if (r->skipped == 0) {
            status = bst_fail(ctx, BST_ERR_FORMAT,
                              "%.400s:1: the file holds no element set (expected %s)",
                              r->source.name, expected);
        } else {
            status = bst_fail(ctx, BST_ERR_FORMAT,
                              "%.400s:1: the file holds no element set that can be used (%d bad "
                              "ones left out; expected %s)",
                              r->source.name, r->skipped, expected);
        }
    }
    if (status != BST_OK) {
        free(r->sets);
        return status;
    }
    *out = r->sets;
    *count = r->count;
    return BST_OK;
}
