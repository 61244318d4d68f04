#include "sim/analysis/calibration/watch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/simulation.h"

enum { WAITING = 32 };

typedef struct watch {
    bst_ctx *ctx;
    const bst_calibration_watcher *watcher;
    char scope[160];
    bst_truth *waiting[WAITING];
    int room[WAITING];
    bst_loop_summary *summary;
    const bst_camera *camera;
    int target;
} watch;

/* Keeps the true sources of a frame until its detections arrive. */
static bst_status keep_truth(watch *w, const bst_truth *truth) {
    int place = (int)(truth->exposure_id % WAITING);
    if (truth->count > w->room[place] || !w->waiting[place]) {
        bst_truth *more =
            realloc(w->waiting[place], sizeof *more + (size_t)truth->count * sizeof more->items[0]);
        if (!more) {
            return bst_fail(w->ctx, BST_ERR_MEMORY, "no memory for %d sources", truth->count);
        }
        w->waiting[place] = more;
        w->room[place] = truth->count;
    }
    memcpy(w->waiting[place], truth, sizeof *truth + (size_t)truth->count * sizeof truth->items[0]);
    return BST_OK;
}

static const bst_truth *truth_of(const watch *w, int64_t exposure_id) {
    const bst_truth *truth = w->waiting[exposure_id % WAITING];
    return truth && truth->exposure_id == exposure_id ? truth : NULL;
}

/* Passes on the error of the confirmed track of interest. */
static void judge_track(const watch *w, const bst_tracks *tracks) {
    const bst_truth *truth = truth_of(w, tracks->exposure_id);
    for (int i = 0; truth && i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (!t->target_of_interest || t->status != BST_TRACK_CONFIRMED) {
            continue;
        }
        for (int k = 0; k < truth->count; k++) {
            const bst_truth_item *item = &truth->items[k];
            if (item->kind == BST_SOURCE_OBJECT && (int)item->id == w->target) {
                double angle = bst_vec3_angle(t->direction_gcrf,
                                              bst_vec3_from_radec(item->ra_rad, item->dec_rad));
                w->watcher->track_error(w->watcher->user, angle / bst_camera_scale_rad(w->camera));
            }
        }
    }
}

static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    watch *w = user;
    if (strcmp(scope, w->scope) != 0) {
        return BST_OK;
    }
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        BST_TRY(bst_loop_summary_truth(w->ctx, w->summary, payload));
        return keep_truth(w, payload);
    }
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *detections = payload;
        const bst_truth *truth = truth_of(w, detections->exposure_id);
        return truth ? w->watcher->frame(w->watcher->user, w->ctx, truth, detections) : BST_OK;
    }
    if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        bst_loop_summary_tracks(w->summary, payload, tick);
        if (w->watcher->track_error) {
            judge_track(w, payload);
        }
    } else if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        bst_loop_summary_status(w->summary, payload);
    }
    return BST_OK;
}

bst_status bst_watch_run(bst_ctx *ctx, const bst_scenario *scenario,
                         const bst_calibration_watcher *watcher, const char *device, int threads,
                         bst_loop_figures *figures) {
    const bst_observer_config *observer = scenario->observers.items;
    const bst_sensor_config *sensor = observer->sensors.items;
    const bst_simulation_options options = {.device = device, .threads = threads};
    watch w = {.ctx = ctx, .watcher = watcher};
    snprintf(w.scope, sizeof w.scope, "%s/%s", observer->name, sensor->name);
    bst_simulation *sim;
    BST_TRY(bst_simulation_create(ctx, scenario, &options, &sim));
    const bst_world *world = bst_simulation_world(sim);
    w.camera = bst_world_camera(world, 0, 0);
    w.target = *sensor->cue.object ? bst_world_find_object(world, sensor->cue.object) : -1;
    bst_status status =
        bst_loop_summary_create(ctx, world, 0, 0, scenario->tick_rate_hz, w.target, &w.summary);
    if (status == BST_OK) {
        const bst_engine_hooks hooks = {.user = &w, .message = on_message};
        bst_engine_set_hooks(bst_simulation_engine(sim), &hooks);
        status = bst_engine_run(ctx, bst_simulation_engine(sim), scenario->duration_ticks);
        bst_loop_summary_finish(w.summary);
        if (figures) {
            bst_loop_summary_figures(w.summary, figures);
        }
    }
    bst_loop_summary_free(w.summary);
    for (int i = 0; i < WAITING; i++) {
        free(w.waiting[i]);
    }
    bst_simulation_free(sim);
    return status;
}
