#include "tracker/mtt/smoother.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/arena.h"

/* A track in one frame. */
typedef struct entry {
    bst_sky_state prior, state; /* before (not in a chain's first) and after the frame's update */
    int32_t status, pad;
} entry;

/* Frames `first` to `last` of a track, by their numbers since the start. */
typedef struct chain {
    int64_t id; /* 0: free */
    int64_t first, last;
    int32_t confirmed, pad;
} chain;

struct bst_smoother {
    bst_arena arena;
    int lag, room;            /* frames; chains */
    int64_t frames;           /* number of frames so far */
    bst_smoother_frame *info; /* [lag + 1], of frame n at n modulo lag + 1; so are the entries */
    chain *chains;            /* [room] */
    entry *entries;           /* [room][lag + 1] */
    bst_smoothed *out;        /* [room] */
    int count, lost;
};

static void lay_out(bst_smoother *s) {
    size_t room = (size_t)s->room, frames = (size_t)s->lag + 1;
    BST_ARENA_TAKE(&s->arena, s->info, frames);
    BST_ARENA_TAKE(&s->arena, s->chains, room);
    BST_ARENA_TAKE(&s->arena, s->entries, room * frames);
    BST_ARENA_TAKE(&s->arena, s->out, room);
}

bst_status bst_smoother_create(bst_ctx *ctx, int tracks, int lag_frames, bst_smoother **out) {
    assert(out && tracks >= 1 && lag_frames >= 1 && lag_frames <= BST_SMOOTHER_MAX_LAG);
    *out = NULL;
    bst_smoother *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
    }
    s->lag = lag_frames;
    s->room = tracks;
    lay_out(s);
    bst_status status = bst_arena_alloc(ctx, &s->arena, "the smoother of the tracker");
    if (status != BST_OK) {
        free(s);
        return status;
    }
    lay_out(s);
    *out = s;
    return BST_OK;
}

void bst_smoother_free(bst_smoother *s) {
    if (s) {
        bst_arena_free(&s->arena);
        free(s);
    }
}

static entry *entry_of(const bst_smoother *s, const chain *c, int64_t frame) {
    int64_t frames = s->lag + 1;
    return &s->entries[(c - s->chains) * frames + frame % frames];
}

/* True if a chain and its entries can be used as they were restored. */
static bool is_intact(const bst_smoother *s, const chain *c) {
    bool intact = c->id >= 0 && c->first >= 0 && c->first <= c->last && c->last < s->frames;
    for (int64_t f = c->last; intact && c->id != 0 && f >= c->first && f >= s->frames - 1 - s->lag;
         f--) {
        const entry *e = entry_of(s, c, f);
        intact = e->status >= BST_TRACK_TENTATIVE && e->status <= BST_TRACK_COASTING;
    }
    return intact || c->id == 0;
}

static bst_status archive_chains(bst_smoother *s, bst_archive *archive) {
    size_t frames = (size_t)s->lag + 1;
    s->frames = bst_archive_integer(archive, s->frames, 0, INT64_MAX / 2);
    bst_archive_bytes(archive, s->info, frames * sizeof *s->info);
    bst_archive_bytes(archive, s->chains, (size_t)s->room * sizeof *s->chains);
    for (int i = 0; i < s->room; i++) {
        chain *c = &s->chains[i];
        if (c->id != 0) {
            bst_archive_bytes(archive, &s->entries[(size_t)i * frames], frames * sizeof(entry));
        }
        if (bst_archive_is_restoring(archive) && !is_intact(s, c)) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state of the tracker's smoother is damaged at track %d", i);
        }
    }
    if (bst_archive_is_restoring(archive)) {
        s->count = s->lost = 0;
    }
    return BST_OK;
}

bst_status bst_smoother_archive(bst_smoother *s, int tracks, bst_archive *archive) {
    int lag = s ? s->lag : 0;
    int saved_lag = (int)bst_archive_integer(archive, lag, 0, BST_SMOOTHER_MAX_LAG);
    if (saved_lag == 0) {
        return BST_OK;
    }
    if (s && saved_lag == lag) {
        return archive_chains(s, archive);
    }
    bst_smoother *dropped;
    BST_TRY(bst_smoother_create(bst_archive_ctx(archive), tracks, saved_lag, &dropped));
    bst_status status = archive_chains(dropped, archive);
    bst_smoother_free(dropped);
    return status;
}

/* Chain to which a frame of a track belongs; NULL: there is no room.
 *
 * Given:     goes_on  the track was predicted from the frame before */
static chain *chain_of(bst_smoother *s, int64_t id, int64_t frame, bool goes_on) {
    chain *unused = NULL;
    for (int i = 0; i < s->room; i++) {
        chain *c = &s->chains[i];
        if (goes_on && c->id == id && c->last == frame - 1) {
            return c;
        }
        if (c->id == 0 || c->last < (c->confirmed ? frame - s->lag : frame - 1)) {
            unused = unused ? unused : c;
        }
    }
    if (unused) {
        *unused = (chain){.id = id, .first = frame, .last = frame};
    }
    return unused;
}

/* Adds the tracks of a frame to their chains. */
static void extend_chains(bst_smoother *s, int64_t frame, const bst_mtt *mtt) {
    int count, prior_count, next = 0; /* both lists have the same order */
    const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &count);
    const bst_mtt_prior *priors = bst_mtt_priors(mtt, &prior_count);
    s->lost = 0;
    for (int t = 0; t < count; t++) {
        const bst_mtt_track *track = &tracks[t];
        int p = next;
        while (p < prior_count && priors[p].id != track->id) {
            p++;
        }
        bool goes_on = p < prior_count;
        next = goes_on ? p + 1 : next;
        if (track->at_rest || track->star) {
            continue;
        }
        chain *c = chain_of(s, track->id, frame, goes_on);
        if (!c) {
            s->lost++;
            continue;
        }
        c->last = frame;
        c->confirmed |= track->status != BST_TRACK_TENTATIVE;
        entry *e = entry_of(s, c, frame);
        *e = (entry){.state = track->state, .status = (int32_t)track->status};
        if (c->first < frame) {
            e->prior = priors[p].state;
        }
    }
}

/* Smoothed state of a chain in a frame, from its last one backwards. */
static void smooth_chain(const bst_smoother *s, const chain *c, int64_t frame, bst_smoothed *out) {
    int64_t frames = s->lag + 1, from = c->last;
    bst_sky_state state = entry_of(s, c, c->last)->state;
    for (int64_t f = c->last - 1; f >= frame; f--) {
        bst_sky_state next = state;
        double dt = s->info[(f + 1) % frames].seconds - s->info[f % frames].seconds;
        if (!bst_sky_smooth(&entry_of(s, c, f)->state, dt, &entry_of(s, c, f + 1)->prior, &next,
                            &state)) {
            from = f; /* the later frames do not count */
        }
    }
    *out = (bst_smoothed){.id = c->id,
                          .status = (bst_track_status)entry_of(s, c, frame)->status,
                          .later_frames = (int)(from - frame),
                          .state = state};
}

/* Sorts the states: the target first, then by identity. */
static void insert(bst_smoother *s, const bst_smoothed *state, int64_t target_id) {
    int at = s->count++;
    while (at > 0 && s->out[at - 1].id != target_id &&
           (state->id == target_id || s->out[at - 1].id > state->id)) {
        s->out[at] = s->out[at - 1];
        at--;
    }
    s->out[at] = *state;
}

void bst_smoother_step(bst_smoother *s, const bst_smoother_frame *frame, const bst_mtt *mtt) {
    assert(s && frame && mtt);
    int64_t now = s->frames++, then = now - s->lag, frames = s->lag + 1;
    s->info[now % frames] = *frame;
    extend_chains(s, now, mtt);
    s->count = 0;
    for (int i = 0; then >= 0 && i < s->room; i++) {
        const chain *c = &s->chains[i];
        if (c->id != 0 && c->confirmed && c->first <= then && c->last >= then) {
            bst_smoothed state;
            smooth_chain(s, c, then, &state);
            insert(s, &state, s->info[then % frames].target_id);
        }
    }
}

bool bst_smoother_get(const bst_smoother *s, bst_smoother_frame *frame, const bst_smoothed **states,
                      int *count, int *lost) {
    assert(s && frame && states && count && lost);
    int64_t then = s->frames - 1 - s->lag;
    *states = s->out;
    *count = s->count;
    *lost = s->lost;
    if (then < 0) {
        return false;
    }
    *frame = s->info[then % (s->lag + 1)];
    return true;
}
