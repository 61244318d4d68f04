#include "sim/app/run_watched.h"

#include <string.h>

static bool is_one_of(const char *channel, const char *const *names, int count) {
    for (int i = 0; i < count; i++) {
        if (strcmp(channel, names[i]) == 0) {
            return true;
        }
    }
    return false;
}

void bst_run_watch(bst_run_watched *w, const bst_recorder *recorder, const char *channel) {
    static const char *const telemetry[] = {BST_CHANNEL_LOS_HISTORY, BST_CHANNEL_POINTING_TELEMETRY,
                                            BST_CHANNEL_MOUNT_STATUS, BST_CHANNEL_NAV_TELEMETRY};
    static const char *const judged[] = {BST_CHANNEL_FRAME, BST_CHANNEL_TRUTH,
                                         BST_CHANNEL_DETECTIONS, BST_CHANNEL_TRACKS,
                                         BST_CHANNEL_TASK};
    *w = (bst_run_watched){
        .recorded = recorder && bst_recorder_wants(recorder, channel), .last = -1, .mode = -1};
    if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        w->kind = BST_WATCH_STATUS;
    } else if (is_one_of(channel, telemetry, 4)) {
        w->kind = w->recorded ? BST_WATCH_TELEMETRY : BST_WATCH_NONE;
    } else {
        w->kind = w->recorded || is_one_of(channel, judged, 5) ? BST_WATCH_ALL : BST_WATCH_NONE;
    }
}

bool bst_run_wants(bst_run_watched *w, const bst_recorder *recorder, const void *payload,
                   int64_t tick, int64_t *unwanted_before) {
    if (w->kind == BST_WATCH_NONE || w->kind == BST_WATCH_ALL) {
        *unwanted_before = w->kind == BST_WATCH_ALL ? 0 : INT64_MAX;
        return w->kind == BST_WATCH_ALL;
    }
    bool due =
        w->recorded && tick >= w->not_due_before && bst_recorder_due(recorder, tick, &w->last);
    if (due) {
        w->not_due_before = bst_recorder_not_due_before(recorder, w->last);
    }
    if (w->kind == BST_WATCH_TELEMETRY) {
        *unwanted_before = w->not_due_before;
    }
    if (w->kind == BST_WATCH_STATUS) {
        const bst_control_status *status = payload;
        due = due || status->mode != w->mode || status->target_id != w->target_id;
        w->mode = status->mode;
        w->target_id = status->target_id;
    }
    return due;
}
