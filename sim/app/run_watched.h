/* What of a run's messages is looked at, by recorder, pictures or summary: of what comes at the
 * plant's rate, little. */
#ifndef BST_APP_RUN_WATCHED_H
#define BST_APP_RUN_WATCHED_H

#include "sim/engine/recorder.h"

typedef enum bst_run_watch_kind {
    BST_WATCH_NONE,
    BST_WATCH_ALL,
    BST_WATCH_TELEMETRY, /* what the recorder takes of it */
    BST_WATCH_STATUS,    /* changes of control_status, and what the recorder takes */
} bst_run_watch_kind;

/* A channel of a sensor. */
typedef struct bst_run_watched {
    bst_run_watch_kind kind;
    bool recorded;
    int64_t last;           /* on the recorder's grid */
    int64_t not_due_before; /* tick */
    /* of control_status, the latest */
    int32_t mode;
    int64_t target_id;
} bst_run_watched;

/* `channel`: its unscoped name. */
void bst_run_watch(bst_run_watched *watched, const bst_recorder *recorder, const char *channel);

/* Whether a message is looked at; messages are asked for in order. None need be before the tick
 * *unwanted_before, which is put forward where it can be. */
bool bst_run_wants(bst_run_watched *watched, const bst_recorder *recorder, const void *payload,
                   int64_t tick, int64_t *unwanted_before);

#endif
