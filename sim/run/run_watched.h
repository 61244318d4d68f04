/* What of a run's messages is looked at, by recorder, pictures or summary: of what comes at the
 * plant's rate, little. */
#ifndef BST_RUN_RUN_WATCHED_H
#define BST_RUN_RUN_WATCHED_H

#include "sim/engine/kernel/engine.h"
#include "sim/engine/recorder/recorder.h"

typedef enum bst_run_watch_kind {
    BST_WATCH_NONE,
    BST_WATCH_ALL,
    BST_WATCH_TELEMETRY, /* what the recorder takes of it */
    BST_WATCH_FRAMES,    /* pixels of those that are recorded or may be shown */
    BST_WATCH_STATUS,    /* changes of control_status, and what the recorder takes */
} bst_run_watch_kind;

/* Who looks at a sensor's pixels. */
typedef struct bst_run_pixels {
    bool recorded, pictured;
    int64_t duration_ticks; /* of the run */
} bst_run_pixels;

/* A channel of a sensor. */
typedef struct bst_run_watched {
    bst_run_watch_kind kind;
    bool recorded;
    int64_t last;           /* on the recorder's grid */
    int64_t not_due_before; /* tick */
    /* of control_status, the latest */
    int32_t mode;
    int64_t target_id;
    /* of frames: how many came, and when the latest was exposed */
    bst_run_pixels pixels;
    int64_t frames, end_tick;
} bst_run_watched;

/* `channel`: its unscoped name. */
void bst_run_watch(bst_run_watched *watched, const bst_recorder *recorder, const char *channel,
                   const bst_run_pixels *pixels);

/* Whether a message is looked at; messages are asked for in order. The mark's tick is put forward
 * where it can be, and frames are bare whose pixels nobody looks at. */
bool bst_run_wants(bst_run_watched *watched, const bst_recorder *recorder, const void *payload,
                   int64_t tick, bst_hook_mark *mark);

#endif
