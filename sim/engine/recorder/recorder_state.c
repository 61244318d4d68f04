/* Saves and restores a recorder. */
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/archive.h"
#include "sim/engine/kernel/saved_frame.h"
#include "sim/engine/recorder/recorder_internal.h"

/* Removes a file that the run began after it was saved. */
static bst_status remove_later_file(bst_ctx *ctx, const bst_recorder *recorder, int sensor,
                                    const char *what) {
    char name[256], path[4096];
    bst_recorder_file_name(recorder, &recorder->sensors[sensor], what, name, sizeof name);
    BST_TRY(bst_run_file(ctx, recorder->run, name, path, sizeof path));
    return unlink(path) == 0 || errno == ENOENT
               ? BST_OK
               : bst_fail(ctx, BST_ERR_IO, "%s: cannot be removed: %s", path, strerror(errno));
}

/* Archives the FITS file of a sensor's frames or planes. */
static bst_status archive_file(bst_ctx *ctx, bst_recorder *recorder, int sensor, const char *what,
                               bst_fits **fits, bst_archive *archive) {
    bool begun = *fits != NULL;
    bst_archive_bool(archive, &begun);
    if (bst_archive_is_restoring(archive)) {
        BST_TRY(begun ? bst_recorder_open_file(ctx, recorder, sensor, what, true, fits)
                      : remove_later_file(ctx, recorder, sensor, what));
    }
    return begun ? bst_fits_archive(ctx, *fits, archive) : BST_OK;
}

/* Archives the frame that waits for its truth. */
static bst_status archive_waiting(bst_ctx *ctx, bst_recorder_state *s, bst_archive *archive) {
    bool has_pixels = s->frame_waits && s->frame.frame;
    bst_archive_bool(archive, &s->frame_waits);
    if (!s->frame_waits) {
        return BST_OK;
    }
    bst_frame *frame = s->frame.frame;
    BST_ARCHIVE(archive, s->frame);
    s->frame.frame = frame;
    bst_archive_bool(archive, &has_pixels);
    if (!has_pixels) {
        return BST_OK;
    }
    if (!bst_archive_is_restoring(archive)) {
        return bst_frame_save(ctx, archive, frame);
    }
    bst_status status = bst_frame_restore(ctx, archive, &s->frame.frame);
    s->frame_waits = status == BST_OK;
    return status;
}

static bst_status archive_sensor(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                 bst_archive *archive) {
    bst_recorder_state *s = &recorder->sensors[sensor];
    BST_TRY(archive_file(ctx, recorder, sensor, "frames", &s->fits, archive));
    for (int k = 0; k < BST_PLANE_COUNT; k++) {
        BST_TRY(archive_file(ctx, recorder, sensor, bst_recorder_plane_file(k), &s->planes[k],
                             archive));
    }
    BST_TRY(archive_waiting(ctx, s, archive));
    BST_ARCHIVE(archive, s->shown);
    bst_archive_bool(archive, &s->wcs_warned);
    BST_ARCHIVE(archive, s->heads);
    s->next_head = (int)bst_archive_integer(archive, s->next_head, 0, BST_TRUTH_HEADS - 1);
    BST_ARCHIVE(archive, s->last_los);
    BST_ARCHIVE(archive, s->last_pointing);
    BST_ARCHIVE(archive, s->last_mount);
    BST_ARCHIVE(archive, s->last_nav);
    BST_ARCHIVE(archive, s->last_control);
    BST_ARCHIVE(archive, s->last_wheels);
    BST_ARCHIVE(archive, s->last_mode);
    BST_ARCHIVE(archive, s->last_target);
    return BST_OK;
}

bst_status bst_recorder_archive(bst_ctx *ctx, bst_recorder *recorder, bst_archive *archive) {
    BST_ARCHIVE(archive, recorder->begin_tick);
    for (int i = 0; i < recorder->sensor_count; i++) {
        BST_TRY(archive_sensor(ctx, recorder, i, archive));
    }
    const int objects = recorder->object_seen ? bst_world_object_count(recorder->world) : 0;
    for (int o = 0; o < objects; o++) {
        bst_archive_bool(archive, &recorder->object_seen[o]);
    }
    return BST_OK;
}
