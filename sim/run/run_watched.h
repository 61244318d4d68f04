/* Selects the messages of a run that recorder, pictures or summary use; few of those at the plant's
 * rate. */
#ifndef BST_RUN_RUN_WATCHED_H
#define BST_RUN_RUN_WATCHED_H

#include "sim/engine/kernel/engine.h"
#include "sim/engine/recorder/recorder.h"

typedef enum bst_run_watch_kind {
    BST_WATCH_NONE,
    BST_WATCH_ALL,
    BST_WATCH_TELEMETRY, /* those that the recorder uses */
    BST_WATCH_FRAMES,    /* pixels of frames that are recorded or may be pictured */
    BST_WATCH_STATUS,    /* changes of control_status, and those that the recorder uses */
} bst_run_watch_kind;

/* Consumers of a sensor's pixels. */
typedef struct bst_run_pixels {
    bool recorded, pictured;
    int64_t duration_ticks; /* of the run */
} bst_run_pixels;

enum { BST_WATCH_NAME_BYTES = 40 };

/* A channel of a sensor. */
typedef struct bst_run_watched {
    char channel[BST_WATCH_NAME_BYTES]; /* without scope */
    bst_run_watch_kind kind;
    bool recorded;
    int64_t last;           /* on the recorder's time grid */
    int64_t not_due_before; /* tick */
    /* of control_status: latest mode */
    int32_t mode;
    int64_t target_id;
    /* of frames: number so far, and tick of the latest exposure */
    bst_run_pixels pixels;
    int64_t frames, end_tick;
} bst_run_watched;

/* Sets up the selection of a channel. `channel`: name without scope. */
void bst_run_watch(bst_run_watched *watched, const bst_recorder *recorder, const char *channel,
                   const bst_run_pixels *pixels);

/* Saves or restores the selection of a channel. A restored one needs bst_run_watch_again before it
 * is used. */
void bst_run_watched_archive(bst_run_watched *watched, bst_archive *archive);
/* As bst_run_watch for a channel that was restored. */
void bst_run_watch_again(bst_run_watched *watched, const bst_recorder *recorder,
                         const bst_run_pixels *pixels);

/* True if a message is used; call it in order. Advances the mark's tick if possible. Frames are
 * passed as metadata only if no consumer needs their pixels. */
bool bst_run_wants(bst_run_watched *watched, const bst_recorder *recorder, const void *payload,
                   int64_t tick, bst_hook_mark *mark);

#endif
