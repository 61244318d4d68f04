#include "obsgen/pending_exposure.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Greatest number of sources of an exposure and of steps of a path in a saved state: a damaged
 * number must not take all memory. */
enum { MOST_SOURCES = 1 << 24, MOST_STEPS = 1 << 20 };

/* Largest number of steps of a path that is set. */
enum { PATH_STEPS = 1024 };

void bst_obsgen_pending_free(bst_obsgen_pending *p) {
    free(p->truth);
    free(p->ghost);
    free(p->path_x_px);
    free(p->path_y_px);
}

bst_status bst_obsgen_pending_reserve_path(bst_ctx *ctx, bst_obsgen_pending *p, int count) {
    if (count <= p->path_room) {
        return BST_OK;
    }
    double *x = realloc(p->path_x_px, (size_t)count * sizeof *x);
    p->path_x_px = x ? x : p->path_x_px;
    double *y = realloc(p->path_y_px, (size_t)count * sizeof *y);
    p->path_y_px = y ? y : p->path_y_px;
    if (!x || !y) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a path of %d steps", count);
    }
    p->path_room = count;
    return BST_OK;
}

bst_status bst_obsgen_pending_set_path(bst_ctx *ctx, bst_obsgen_pending *p,
                                       const bst_camera *camera, const bst_los_track *track,
                                       double lead_s, bst_window window) {
    assert(p && camera && track && track->count >= 2 && lead_s >= 0.0);
    double x = window.x0 + 0.5 * (window.width - 1), y = window.y0 + 0.5 * (window.height - 1);
    bst_vec3 star = bst_quat_rotate(bst_quat_conj(track->q_cam_from_gcrf[track->count / 2]),
                                    bst_camera_unproject(camera, x, y));
    int count = track->count < PATH_STEPS ? track->count : PATH_STEPS;
    double step_s = (track->time_s[track->count - 1] - 2.0 * lead_s) / (count - 1);
    double mean_x = 0.0, mean_y = 0.0;
    bool even = lead_s == 0.0 && count == track->count;
    for (int k = 1; k < count && even; k++) {
        even = fabs(track->time_s[k] - k * step_s) < 1e-3 * step_s;
    }
    BST_TRY(bst_obsgen_pending_reserve_path(ctx, p, count));
    p->path_count = count;
    for (int k = 0; k < count; k++) {
        bst_quat q =
            even ? track->q_cam_from_gcrf[k] : bst_los_track_attitude(track, lead_s + k * step_s);
        double weight = (k == 0 || k == count - 1 ? 0.5 : 1.0) / (count - 1);
        if (!bst_camera_project(camera, bst_quat_rotate(q, star), &x, &y)) {
            p->path_count = 0;
            return BST_OK;
        }
        p->path_x_px[k] = x;
        p->path_y_px[k] = y;
        mean_x += weight * x;
        mean_y += weight * y;
    }
    for (int k = 0; k < count; k++) {
        p->path_x_px[k] -= mean_x;
        p->path_y_px[k] -= mean_y;
    }
    return BST_OK;
}

bst_status bst_obsgen_pending_reserve(bst_ctx *ctx, bst_obsgen_pending *p, int count) {
    if (p->truth && count <= p->room) {
        return BST_OK;
    }
    int room = count + count / 4 + 64;
    bst_truth *more = realloc(p->truth, sizeof *more + (size_t)room * sizeof more->items[0]);
    p->truth = more ? more : p->truth;
    int32_t *ghost = realloc(p->ghost, (size_t)room * sizeof *ghost);
    p->ghost = ghost ? ghost : p->ghost;
    if (!more || !ghost) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", room);
    }
    p->room = room;
    return BST_OK;
}

/* Saves or restores header and items of the truth, and of which ghosts these are. A live edit may
 * have shortened the camera's list since: no light comes from a ghost that is no longer there. */
static bst_status archive_truth(bst_obsgen_pending *p, int ghosts, bst_archive *archive) {
    bst_ctx *ctx = bst_archive_ctx(archive);
    BST_TRY(bst_obsgen_pending_reserve(ctx, p, 0));
    BST_ARCHIVE(archive, *p->truth);
    int count = bst_archive_count(archive, p->truth->count, MOST_SOURCES);
    if (count != p->truth->count) {
        p->truth->count = 0;
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved truth of exposure %lld is damaged: two numbers of its sources "
                        "differ",
                        (long long)p->exposure_id);
    }
    BST_TRY(bst_obsgen_pending_reserve(ctx, p, count));
    bst_archive_bytes(archive, p->truth->items, (size_t)count * sizeof *p->truth->items);
    bst_archive_bytes(archive, p->ghost, (size_t)count * sizeof *p->ghost);
    int saved = ghosts;
    BST_ARCHIVE(archive, saved);
    for (int i = 0; bst_archive_is_restoring(archive) && i < count; i++) {
        if (p->ghost[i] < -1 || p->ghost[i] >= saved) {
            int found = p->ghost[i];
            p->truth->count = 0;
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "the saved truth of exposure %lld is damaged: ghost %d of a camera "
                            "with %d",
                            (long long)p->exposure_id, found, saved);
        }
        if (p->ghost[i] >= ghosts) {
            p->ghost[i] = -1;
            p->truth->items[i].electrons = 0.0;
        }
    }
    return BST_OK;
}

bst_status bst_obsgen_pending_archive(bst_obsgen_pending *p, int ghosts, bst_archive *archive) {
    BST_ARCHIVE(archive, p->exposure_id);
    if (p->exposure_id < 0) {
        return BST_OK;
    }
    BST_TRY(archive_truth(p, ghosts, archive));
    BST_ARCHIVE(archive, p->sigma_px);
    bst_archive_bool(archive, &p->own_response);
    if (p->own_response) {
        BST_ARCHIVE(archive, p->response);
        BST_ARCHIVE(archive, p->image_bound);
        BST_ARCHIVE(archive, p->onboard_bound);
    }
    int count = bst_archive_count(archive, p->path_count, MOST_STEPS);
    BST_TRY(bst_obsgen_pending_reserve_path(bst_archive_ctx(archive), p, count));
    p->path_count = count;
    bst_archive_bytes(archive, p->path_x_px, (size_t)count * sizeof *p->path_x_px);
    bst_archive_bytes(archive, p->path_y_px, (size_t)count * sizeof *p->path_y_px);
    return BST_OK;
}

bst_generator_frame bst_obsgen_pending_frame(const bst_obsgen_pending *p, const bst_exposure *e,
                                             double tick_rate_hz) {
    return (bst_generator_frame){.truth = p->truth,
                                 .ghost = p->ghost,
                                 .window = e->window,
                                 .binning = e->binning,
                                 .exposure_s = (double)(e->end_tick - e->start_tick) / tick_rate_hz,
                                 .sigma_px = p->sigma_px,
                                 .response = p->own_response ? &p->response : NULL,
                                 .image_bound = p->own_response ? &p->image_bound : NULL,
                                 .onboard_bound = p->own_response ? &p->onboard_bound : NULL,
                                 .path_x_px = p->path_x_px,
                                 .path_y_px = p->path_y_px,
                                 .path_count = p->path_count};
}
