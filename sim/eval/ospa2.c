#include "sim/eval/ospa2.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/arena.h"
#include "sim/eval/gospa.h"

/* A frame of the window. */
typedef struct slot {
    int tracks;
    int64_t *id;      /* [tracks] */
    bool *visible;    /* [objects] */
    double *distance; /* [object * max_at_once + track], limited to the cutoff */
} slot;

struct bst_ospa2 {
    bst_arena arena; /* of all arrays below */
    bst_ospa2_params params;
    int64_t frames;
    slot *slots;    /* [window] */
    int64_t *ids;   /* identities in the window */
    int *present;   /* number of frames of the window with that identity */
    int *row;       /* objects in the window */
    double *matrix; /* [row * identities + identity] mean distance */
};

static void lay_out(bst_ospa2 *o) {
    size_t objects = (size_t)o->params.objects + 1, now = (size_t)o->params.max_at_once;
    size_t window = (size_t)o->params.window;
    BST_ARENA_TAKE(&o->arena, o->slots, window);
    BST_ARENA_TAKE(&o->arena, o->ids, now * window);
    BST_ARENA_TAKE(&o->arena, o->present, now * window);
    BST_ARENA_TAKE(&o->arena, o->row, objects);
    BST_ARENA_TAKE(&o->arena, o->matrix, objects * now * window);
    for (size_t k = 0; k < window; k++) {
        slot part = {0};
        BST_ARENA_TAKE(&o->arena, part.id, now);
        BST_ARENA_TAKE(&o->arena, part.visible, objects);
        BST_ARENA_TAKE(&o->arena, part.distance, objects * now);
        if (o->slots) {
            o->slots[k] = part;
        }
    }
}

bst_status bst_ospa2_create(bst_ctx *ctx, const bst_ospa2_params *params, bst_ospa2 **out) {
    *out = NULL;
    if (params->objects < 0 || params->max_at_once < 1 || params->window < 1 ||
        !(params->cutoff > 0.0) || !(params->order >= 1.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "ospa2: needs room for a track, a window of at least a frame, a cutoff > 0 "
                        "and an order >= 1");
    }
    bst_ospa2 *o = calloc(1, sizeof *o);
    if (!o) {
        return bst_fail(ctx, BST_ERR_MEMORY, "ospa2: out of memory");
    }
    o->params = *params;
    lay_out(o);
    bst_status status = bst_arena_alloc(ctx, &o->arena, "the window of OSPA(2)");
    if (status != BST_OK) {
        bst_ospa2_free(o);
        return status;
    }
    lay_out(o);
    *out = o;
    return BST_OK;
}

void bst_ospa2_free(bst_ospa2 *o) {
    if (o) {
        bst_arena_free(&o->arena);
        free(o);
    }
}

/* Stores a frame in the window. */
static void store(bst_ospa2 *o, const bst_ospa2_input *frame) {
    int tracks = frame->tracks;
    slot *s = &o->slots[o->frames % o->params.window];
    s->tracks = tracks;
    memset(s->visible, 0, (size_t)o->params.objects * sizeof *s->visible);
    if (tracks > 0) {
        memcpy(s->id, frame->track_ids, (size_t)tracks * sizeof *s->id);
    }
    for (int r = 0; r < frame->rows; r++) {
        int object = frame->object[r];
        assert(object >= 0 && object < o->params.objects);
        s->visible[object] = true;
        for (int t = 0; t < tracks; t++) {
            s->distance[object * o->params.max_at_once + t] =
                fmin(frame->distance[r * tracks + t], o->params.cutoff);
        }
    }
    o->frames++;
}

/* Collects the identities of the window. Returns their number. */
static int collect(bst_ospa2 *o, int slots) {
    int count = 0;
    for (int k = 0; k < slots; k++) {
        for (int t = 0; t < o->slots[k].tracks; t++) {
            int i = 0;
            while (i < count && o->ids[i] != o->slots[k].id[t]) {
                i++;
            }
            if (i == count) {
                o->ids[count] = o->slots[k].id[t];
                o->present[count++] = 0;
            }
            o->present[i]++;
        }
    }
    return count;
}

/* Mean distance of an object and an identity over the window. */
static double mean_distance(const bst_ospa2 *o, int slots, int object, int identity) {
    int visible = 0, both = 0;
    double sum = 0.0;
    for (int k = 0; k < slots; k++) {
        const slot *s = &o->slots[k];
        if (!s->visible[object]) {
            continue;
        }
        visible++;
        for (int t = 0; t < s->tracks; t++) {
            if (s->id[t] == o->ids[identity]) {
                sum += s->distance[object * o->params.max_at_once + t];
                both++;
                break;
            }
        }
    }
    int either = visible + o->present[identity] - both;
    return (sum + o->params.cutoff * (either - both)) / either;
}

bst_status bst_ospa2_frame(bst_ctx *ctx, bst_ospa2 *o, const bst_ospa2_input *frame,
                           double *value) {
    if (frame->tracks > o->params.max_at_once || frame->rows > o->params.objects ||
        frame->tracks < 0 || frame->rows < 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "ospa2: %d objects and %d tracks in a frame, room for %d and %d",
                        frame->rows, frame->tracks, o->params.objects, o->params.max_at_once);
    }
    store(o, frame);
    int slots = o->frames < o->params.window ? (int)o->frames : o->params.window;
    int identities = collect(o, slots), objects = 0;
    for (int i = 0; i < o->params.objects; i++) {
        bool seen = false;
        for (int k = 0; k < slots && !seen; k++) {
            seen = o->slots[k].visible[i];
        }
        if (seen) {
            for (int j = 0; j < identities; j++) {
                o->matrix[objects * identities + j] = mean_distance(o, slots, i, j);
            }
            o->row[objects++] = i;
        }
    }
    bst_gospa_result g;
    BST_TRY(bst_gospa(ctx, o->matrix, objects, identities, o->params.cutoff, o->params.order, NULL,
                      &g));
    /* OSPA: every object or track beyond the pairs of the larger set costs the cutoff, and so does
     * a pair at the cutoff, which GOSPA counts as a miss and a false track */
    int larger = objects > identities ? objects : identities;
    double power = g.localisation + pow(o->params.cutoff, o->params.order) * (larger - g.pairs);
    *value = larger > 0 ? pow(power / larger, 1.0 / o->params.order) : 0.0;
    return BST_OK;
}
