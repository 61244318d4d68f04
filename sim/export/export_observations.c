/* Exports the directions that a run's sensors measured, as TDM, JSON or CSV. */
#include <inttypes.h>
#include <stdio.h>

#include "sim/cli/progress.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/io/draft_file.h"
#include "sim/io/tdm_writer.h"
#include "sim/run/track_files.h"

typedef struct output {
    const bst_export *e;
    bst_run_scene *scene;
    FILE *stream;
    int64_t observations, tracks, skipped;
} output;

static bst_status write_track(void *user, bst_ctx *ctx, const bst_run_track *track) {
    output *o = user;
    bst_status status;
    char object[96];
    BST_TRY(bst_export_check(ctx));
    if (o->e->observation_format == BST_OBSERVATIONS_TDM) {
        status = bst_track_write_tdm(
            ctx, o->stream, track, "observers.oem",
            o->e->filtered
                ? "states of the onboard filter at mid exposure, in frames with a detection"
                : "measured directions, independent from frame to frame");
    } else if (o->e->observation_format == BST_OBSERVATIONS_JSON) {
        bst_track_object(track, object, sizeof object);
        int index = bst_world_find_object(o->scene->world, object);
        status = bst_track_write_json(
            ctx, o->stream, track, index >= 0 ? bst_world_object(o->scene->world, index)->norad : 0,
            o->tracks == 0);
    } else {
        status = bst_track_write_csv(ctx, o->stream, track);
    }
    o->observations += track->count;
    o->skipped += track->skipped;
    o->tracks++;
    return status;
}

static bst_status write_all(bst_ctx *ctx, output *o) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    char created[32];
    int count;
    BST_TRY(bst_run_sensors(ctx, o->e->run, o->e->sensor, sensors, &count));
    if (o->e->observation_format == BST_OBSERVATIONS_TDM) {
        bst_run_creation_date(created);
        BST_TRY(
            bst_tdm_write_head(ctx, o->stream, created, "BORESIGHT", "angles of a simulated run"));
    } else if (o->e->observation_format == BST_OBSERVATIONS_JSON) {
        fputc('[', o->stream);
    } else {
        bst_track_csv_head(o->stream);
    }
    for (int i = 0; i < count; i++) {
        BST_TRY(
            bst_run_observations(ctx, o->scene, &sensors[i], 0, o->e->filtered, write_track, o));
    }
    if (o->tracks == 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: holds no confirmed track to write",
                        bst_run_reader_folder(o->e->run));
    }
    if (o->e->observation_format == BST_OBSERVATIONS_JSON) {
        fputs("\n]\n", o->stream);
    }
    return BST_OK;
}

bst_status bst_export_observations(bst_ctx *ctx, const bst_export *e) {
    static const char *const endings[] = {"tdm", "json", "csv"};
    char path[4096];
    bst_draft draft;
    bst_run_scene scene;
    output o = {.e = e, .scene = &scene};
    int n =
        snprintf(path, sizeof path, "%s/observations.%s", e->out, endings[e->observation_format]);
    if (n < 0 || (size_t)n >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", e->out);
    }
    bst_status status = bst_run_scene_open(ctx, e->run, &scene);
    if (status == BST_OK) {
        status = bst_draft_open(ctx, path, &draft);
        if (status == BST_OK) {
            o.stream = draft.stream;
            status = bst_draft_close(ctx, &draft, write_all(ctx, &o));
        }
    }
    bst_run_scene_close(&scene);
    BST_TRY(status);
    printf(
        "%s: %s of %s\n", path,
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, o.observations, "observation", "observations"),
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, o.tracks, "track", "tracks"));
    if (o.skipped > 0) {
        bst_log(ctx, BST_LOG_WARNING,
                "%" PRId64
                " detections of tracks are left out: no attitude from stars in their "
                "frames",
                o.skipped);
    }
    return BST_OK;
}
