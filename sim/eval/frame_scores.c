#include "sim/eval/frame_scores.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/eval/growing.h"

struct bst_frame_scores {
    bst_track_metrics *metrics;
    double cutoff_rad;
    /* work space of a frame */
    int64_t *number, *id;
    bst_vec3 *truth, *direction;
    int number_room, truth_room, id_room, direction_room;
};

bst_status bst_frame_scores_create(bst_ctx *ctx, int objects, double cutoff_rad,
                                   bst_frame_scores **out) {
    *out = NULL;
    bst_frame_scores *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the figures of tracks");
    }
    s->cutoff_rad = cutoff_rad;
    bst_status status = bst_track_metrics_create(ctx, objects, cutoff_rad, &s->metrics);
    if (status != BST_OK) {
        free(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_frame_scores_free(bst_frame_scores *s) {
    if (s) {
        bst_track_metrics_free(s->metrics);
        free(s->number);
        free(s->id);
        free(s->truth);
        free(s->direction);
        free(s);
    }
}

bst_status bst_frame_scores_archive(bst_frame_scores *s, bst_archive *archive) {
    return bst_track_metrics_archive(s->metrics, archive);
}

/* True if a geometric direction is on the sensor. */
static bool is_in_field(const bst_scored_frame *frame, bst_vec3 direction) {
    bst_vec3 apparent = bst_light_aberrate(&frame->light, direction);
    double x, y;
    return bst_camera_project(frame->camera, bst_quat_rotate(frame->q_cam_from_gcrf, apparent), &x,
                              &y) &&
           x >= -0.5 && y >= -0.5 && x < (double)frame->camera->width_px - 0.5 &&
           y < (double)frame->camera->height_px - 0.5;
}

/* True if a track is scored. */
static bool counts(const bst_frame_scores *s, const bst_scored_frame *frame,
                   const bst_track *track) {
    if ((track->status != BST_TRACK_CONFIRMED && track->status != BST_TRACK_COASTING) ||
        track->hidden != BST_HIDDEN_NOT) {
        return false;
    }
    bool near = false;
    for (int o = 0; o < frame->count; o++) {
        bst_vec3 off = bst_vec3_sub(frame->objects[o].direction, track->direction_gcrf);
        if (bst_vec3_dot(off, off) < s->cutoff_rad * s->cutoff_rad) {
            if (frame->objects[o].counts) {
                return true;
            }
            near = true;
        }
    }
    return !near && is_in_field(frame, track->direction_gcrf);
}

bst_status bst_frame_scores_add(bst_ctx *ctx, bst_frame_scores *s, const bst_scored_frame *frame,
                                const bst_tracks *tracks) {
    assert(s && frame && tracks);
    BST_TRY(
        bst_grow(ctx, (void **)&s->number, frame->count + 1, &s->number_room, sizeof *s->number));
    BST_TRY(bst_grow(ctx, (void **)&s->truth, frame->count + 1, &s->truth_room, sizeof *s->truth));
    BST_TRY(bst_grow(ctx, (void **)&s->id, tracks->count + 1, &s->id_room, sizeof *s->id));
    BST_TRY(bst_grow(ctx, (void **)&s->direction, tracks->count + 1, &s->direction_room,
                     sizeof *s->direction));
    bst_track_frame scored = {.seconds = frame->mid_tick,
                              .objects = s->number,
                              .truth = s->truth,
                              .track_ids = s->id,
                              .track_directions = s->direction};
    for (int o = 0; o < frame->count; o++) {
        if (frame->objects[o].counts) {
            s->number[scored.visible] = frame->objects[o].number;
            s->truth[scored.visible++] = frame->objects[o].direction;
        }
    }
    for (int t = 0; t < tracks->count; t++) {
        if (counts(s, frame, &tracks->items[t])) {
            s->id[scored.tracks] = tracks->items[t].id;
            s->direction[scored.tracks++] = tracks->items[t].direction_gcrf;
        }
    }
    return scored.visible + scored.tracks > 0 ? bst_track_metrics_frame(ctx, s->metrics, &scored)
                                              : BST_OK;
}

void bst_frame_scores_figures(const bst_frame_scores *s, bst_track_figures *out) {
    bst_track_metrics_figures(s->metrics, out);
}
