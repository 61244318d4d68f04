#include "sim/run/run_used_tracks.h"

#include <stdlib.h>
#include <string.h>

#include "sim/core/archive.h"

enum { MOST_USED = 1 << 24 };

/* Number of used tracks with a smaller id. */
static int used_before(const bst_run_used_tracks *u, int64_t id) {
    int low = 0, high = u->count;
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (u->ids[middle] < id) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

bool bst_run_used_tracks_has(const bst_run_used_tracks *u, int64_t id) {
    int i = used_before(u, id);
    return i < u->count && u->ids[i] == id;
}

static bst_status make_room(bst_ctx *ctx, bst_run_used_tracks *u, int count) {
    if (count > u->room) {
        int room = count + u->room + 32;
        int64_t *ids = realloc(u->ids, (size_t)room * sizeof *ids);
        if (!ids) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d used tracks", count);
        }
        u->ids = ids;
        u->room = room;
    }
    return BST_OK;
}

bst_status bst_run_used_tracks_add(bst_ctx *ctx, bst_run_used_tracks *u, int64_t id) {
    if (u->count == MOST_USED) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "/record/custody: a sensor has used %d tracks (allowed: "
                        "at most that many)",
                        MOST_USED);
    }
    BST_TRY(make_room(ctx, u, u->count + 1));
    int i = used_before(u, id);
    memmove(u->ids + i + 1, u->ids + i, (size_t)(u->count - i) * sizeof *u->ids);
    u->ids[i] = id;
    u->count++;
    return BST_OK;
}

bst_status bst_run_used_tracks_archive(bst_run_used_tracks *u, bst_archive *archive) {
    int count = bst_archive_count(archive, u->count, MOST_USED);
    if (bst_archive_is_restoring(archive) &&
        bst_archive_remaining(archive) / sizeof *u->ids < (size_t)count) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved state has not all of %d ids of used tracks", count);
    }
    BST_TRY(make_room(bst_archive_ctx(archive), u, count));
    u->count = count;
    if (count > 0) {
        bst_archive_bytes(archive, u->ids, (size_t)count * sizeof *u->ids);
    }
    return BST_OK;
}

void bst_run_used_tracks_clear(bst_run_used_tracks *u) {
    free(u->ids);
    *u = (bst_run_used_tracks){.ids = NULL};
}
