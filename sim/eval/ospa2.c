#include "sim/eval/ospa2.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/eval/growing.h"

/* Longest window: frames are bits. */
enum { MOST_FRAMES = 32 };

/* An object or a track of the window. */
typedef struct member {
    int64_t id;
    uint64_t frames; /* bit k: it existed k frames before the latest */
} member;

/* An object and a track that were nearer than the cutoff in a frame of the window. */
typedef struct encounter {
    int64_t object, track;
    uint64_t frames;              /* in which they were */
    double distance[MOST_FRAMES]; /* of frame n at n % window */
} encounter;

struct bst_ospa2 {
    bst_ospa2_params params;
    int64_t frames;
    member *object, *track;
    int objects, tracks, object_room, track_room;
    encounter *near;
    int nears, near_room;
    bst_gospa_pair *pair;
    int pair_room;
};

bst_status bst_ospa2_create(bst_ctx *ctx, const bst_ospa2_params *params, bst_ospa2 **out) {
    *out = NULL;
    if (params->window < 1 || params->window > MOST_FRAMES || !(params->cutoff > 0.0) ||
        !(params->order >= 1.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "ospa2: needs a window of 1 to %d frames, a cutoff > 0 and an order >= 1",
                        MOST_FRAMES);
    }
    bst_ospa2 *o = calloc(1, sizeof *o);
    if (!o) {
        return bst_fail(ctx, BST_ERR_MEMORY, "ospa2: out of memory");
    }
    o->params = *params;
    *out = o;
    return BST_OK;
}

void bst_ospa2_free(bst_ospa2 *o) {
    if (o) {
        free(o->object);
        free(o->track);
        free(o->near);
        free(o->pair);
        free(o);
    }
}

bst_status bst_ospa2_archive(bst_ospa2 *o, bst_archive *archive) {
    BST_ARCHIVE(archive, o->frames);
    BST_TRY(bst_grow_archive(archive, (void **)&o->object, &o->objects, &o->object_room,
                             sizeof *o->object));
    BST_TRY(bst_grow_archive(archive, (void **)&o->track, &o->tracks, &o->track_room,
                             sizeof *o->track));
    return bst_grow_archive(archive, (void **)&o->near, &o->nears, &o->near_room, sizeof *o->near);
}

/* Moves the window on by a frame, and removes what is no longer in it. */
static int age(member *members, int count, uint64_t window) {
    int kept = 0;
    for (int i = 0; i < count; i++) {
        members[i].frames = (members[i].frames << 1) & window;
        if (members[i].frames != 0) {
            members[kept++] = members[i];
        }
    }
    return kept;
}

/* Index of a member; -1: it is not there. Identities come in about the same order in each frame:
 * the search begins at `hint`. */
static int find_member(const member *members, int count, int64_t id, int hint) {
    for (int n = 0; n < count; n++) {
        int i = (hint + n) % count;
        if (members[i].id == id) {
            return i;
        }
    }
    return -1;
}

/* Marks the members that exist in the latest frame; new ones are added. */
static bst_status mark(bst_ctx *ctx, const int64_t *ids, int count, member **members, int *size,
                       int *room) {
    int hint = 0;
    for (int i = 0; i < count; i++) {
        int at = find_member(*members, *size, ids[i], hint);
        if (at < 0) {
            BST_TRY(bst_grow(ctx, (void **)members, *size + 1, room, sizeof **members));
            at = (*size)++;
            (*members)[at] = (member){.id = ids[i]};
        }
        (*members)[at].frames |= 1u;
        hint = at + 1;
    }
    return BST_OK;
}

/* Adds the pairs of the latest frame. */
static bst_status meet(bst_ctx *ctx, bst_ospa2 *o, const bst_ospa2_input *frame) {
    int hint = 0;
    for (int i = 0; i < frame->count; i++) {
        const bst_gospa_pair *pair = &frame->pairs[i];
        if (!(pair->distance < o->params.cutoff)) {
            continue;
        }
        int64_t object = frame->objects[pair->truth], track = frame->track_ids[pair->track];
        int at = -1;
        for (int n = 0; n < o->nears && at < 0; n++) {
            int k = (hint + n) % o->nears;
            at = o->near[k].object == object && o->near[k].track == track ? k : -1;
        }
        if (at < 0) {
            BST_TRY(bst_grow(ctx, (void **)&o->near, o->nears + 1, &o->near_room, sizeof *o->near));
            at = o->nears++;
            o->near[at] = (encounter){.object = object, .track = track};
        }
        o->near[at].frames |= 1u;
        o->near[at].distance[o->frames % o->params.window] = pair->distance;
        hint = at + 1;
    }
    return BST_OK;
}

static int count_bits(uint64_t bits) {
    int count = 0;
    for (; bits != 0; bits &= bits - 1) {
        count++;
    }
    return count;
}

/* Mean distance over the window of a pair that was near in at least one frame. */
static double mean_distance(const bst_ospa2 *o, const encounter *near, uint64_t either) {
    int window = o->params.window, frames = count_bits(either), apart = frames;
    double sum = 0.0;
    for (int k = 0; k < window; k++) {
        if (near->frames >> k & 1u) {
            sum += near->distance[(o->frames - k) % window];
            apart--;
        }
    }
    return (sum + o->params.cutoff * apart) / frames;
}

bst_status bst_ospa2_frame(bst_ctx *ctx, bst_ospa2 *o, const bst_ospa2_input *frame,
                           double *value) {
    assert(o && frame && value && frame->rows >= 0 && frame->tracks >= 0 && frame->count >= 0);
    uint64_t window = (UINT64_C(1) << o->params.window) - 1u;
    o->frames++;
    o->objects = age(o->object, o->objects, window);
    o->tracks = age(o->track, o->tracks, window);
    int kept = 0;
    for (int i = 0; i < o->nears; i++) {
        o->near[i].frames = (o->near[i].frames << 1) & window;
        if (o->near[i].frames != 0) {
            o->near[kept++] = o->near[i];
        }
    }
    o->nears = kept;
    BST_TRY(mark(ctx, frame->objects, frame->rows, &o->object, &o->objects, &o->object_room));
    BST_TRY(mark(ctx, frame->track_ids, frame->tracks, &o->track, &o->tracks, &o->track_room));
    BST_TRY(meet(ctx, o, frame));
    BST_TRY(bst_grow(ctx, (void **)&o->pair, o->nears + 1, &o->pair_room, sizeof *o->pair));
    int row = 0, column = 0;
    for (int i = 0; i < o->nears; i++) {
        const encounter *near = &o->near[i];
        row = find_member(o->object, o->objects, near->object, row);
        column = find_member(o->track, o->tracks, near->track, column);
        assert(row >= 0 && column >= 0);
        uint64_t either = o->object[row].frames | o->track[column].frames;
        o->pair[i] = (bst_gospa_pair){row, column, mean_distance(o, near, either)};
    }
    const bst_gospa_problem problem = {o->pair,   o->nears,         o->objects,
                                       o->tracks, o->params.cutoff, o->params.order};
    bst_gospa_result g;
    BST_TRY(bst_gospa_near(ctx, &problem, NULL, &g));
    /* OSPA: every object or track beyond the pairs of the larger set costs the cutoff, and so does
     * a pair at the cutoff, which GOSPA counts as a miss and a false track */
    int larger = o->objects > o->tracks ? o->objects : o->tracks;
    double power = g.localisation + pow(o->params.cutoff, o->params.order) * (larger - g.pairs);
    *value = larger > 0 ? pow(power / larger, 1.0 / o->params.order) : 0.0;
    return BST_OK;
}
