#include "sim/run/run_watched.h"

#include <stdio.h>
#include <string.h>

static bool is_one_of(const char *channel, const char *const *names, int count) {
    for (int i = 0; i < count; i++) {
        if (strcmp(channel, names[i]) == 0) {
            return true;
        }
    }
    return false;
}

/* Frames at the beginning and end that may be pictured, and every n-th in between in case of an
 * interrupt. A retained frame occupies the frame pool: the number is small. */
enum { FIRST_SHOWN = 64, LAST_SHOWN = 16, SHOWN_EVERY = 64 };

void bst_run_watch(bst_run_watched *w, const bst_recorder *recorder, const char *channel,
                   const bst_run_pixels *pixels) {
    static const char *const telemetry[] = {BST_CHANNEL_LOS_HISTORY, BST_CHANNEL_POINTING_TELEMETRY,
                                            BST_CHANNEL_MOUNT_STATUS, BST_CHANNEL_NAV_TELEMETRY,
                                            BST_CHANNEL_WHEEL_STATUS};
    static const char *const judged[] = {
        BST_CHANNEL_TRUTH,           BST_CHANNEL_DETECTIONS,       BST_CHANNEL_TRACKS,
        BST_CHANNEL_TRACKS_SMOOTHED, BST_CHANNEL_TRACK_IDENTITIES, BST_CHANNEL_TASK};
    *w = (bst_run_watched){.recorded = recorder && bst_recorder_wants(recorder, channel),
                           .last = -1,
                           .mode = -1,
                           .pixels = *pixels};
    snprintf(w->channel, sizeof w->channel, "%s", channel);
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        w->kind = BST_WATCH_FRAMES;
    } else if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        w->kind = BST_WATCH_STATUS;
    } else if (is_one_of(channel, telemetry, 5)) {
        w->kind = w->recorded ? BST_WATCH_TELEMETRY : BST_WATCH_NONE;
    } else {
        w->kind = w->recorded || is_one_of(channel, judged, 6) ? BST_WATCH_ALL : BST_WATCH_NONE;
    }
}

void bst_run_watched_archive(bst_run_watched *w, bst_archive *archive) {
    BST_ARCHIVE(archive, w->channel);
    w->channel[sizeof w->channel - 1] = '\0';
    BST_ARCHIVE(archive, w->last);
    BST_ARCHIVE(archive, w->not_due_before);
    BST_ARCHIVE(archive, w->mode);
    BST_ARCHIVE(archive, w->target_id);
    BST_ARCHIVE(archive, w->frames);
    BST_ARCHIVE(archive, w->end_tick);
}

void bst_run_watch_again(bst_run_watched *w, const bst_recorder *recorder,
                         const bst_run_pixels *pixels) {
    const bst_run_watched restored = *w;
    bst_run_watch(w, recorder, restored.channel, pixels);
    w->last = restored.last;
    w->not_due_before = restored.not_due_before;
    w->mode = restored.mode;
    w->target_id = restored.target_id;
    w->frames = restored.frames;
    w->end_tick = restored.end_tick;
}

static bool wants_pixels(bst_run_watched *w, const bst_frame_message *m) {
    int64_t period = m->end_tick - w->end_tick, number = w->frames++;
    bool last = m->end_tick + LAST_SHOWN * period >= w->pixels.duration_ticks;
    w->end_tick = m->end_tick;
    return w->pixels.recorded ||
           (w->pixels.pictured && (number < FIRST_SHOWN || last || number % SHOWN_EVERY == 0));
}

bool bst_run_wants(bst_run_watched *w, const bst_recorder *recorder, const void *payload,
                   int64_t tick, bst_hook_mark *mark) {
    if (w->kind == BST_WATCH_FRAMES) {
        mark->bare = !wants_pixels(w, payload);
        return true;
    }
    if (w->kind == BST_WATCH_NONE || w->kind == BST_WATCH_ALL) {
        mark->unwanted_before = w->kind == BST_WATCH_ALL ? 0 : INT64_MAX;
        return w->kind == BST_WATCH_ALL;
    }
    bool due =
        w->recorded && tick >= w->not_due_before && bst_recorder_due(recorder, tick, &w->last);
    if (due) {
        w->not_due_before = bst_recorder_not_due_before(recorder, w->last);
    }
    if (w->kind == BST_WATCH_TELEMETRY) {
        mark->unwanted_before = w->not_due_before;
    }
    if (w->kind == BST_WATCH_STATUS) {
        const bst_control_status *status = payload;
        due = due || status->mode != w->mode || status->target_id != w->target_id;
        w->mode = status->mode;
        w->target_id = status->target_id;
    }
    return due;
}
