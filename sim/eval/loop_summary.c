#include "sim/eval/loop_summary.h"

#include <stdlib.h>
#include <string.h>

#include "sim/world/frame_updates.h"

/* 99.99 % quantile of chi-square, 2 degrees of freedom. */
#define FORESEEN_CHI2 18.42

/* frames that wait for their tracks: 1 s of latency at 60 Hz */
enum { WAITING = 64 };

typedef struct waiting_frame {
    bst_loop_frame frame;
    bst_vec3 direction; /* true, geometric */
    int64_t mid_tick;
    bool known;  /* the target's position is known: not decayed */
    bool judged; /* tracks of this exposure have arrived */
} waiting_frame;

struct bst_loop_summary {
    bst_camera camera;
    bst_world_view *view;
    int observer;
    double rate_hz;
    int object_count; /* of the world */
    int target;
    bst_loop_frame_fn fn;
    void *user;
    waiting_frame waiting[WAITING]; /* frames first..next-1, at index % WAITING */
    int64_t first, next;
    /* latest track of interest, for frames without tracks */
    bst_track toi;
    bool has_toi;
    int64_t toi_tick;
    int mode;
    bool last_in_track;
    bst_loop_frame newest;
    bst_loop_figures figures;
    int64_t acquire_tick, settle_tick; /* -1: never */
    bst_loop_tally tally;
};

bst_status bst_loop_summary_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   int64_t tick_rate_hz, int target_object,
                                   bst_loop_summary **out) {
    *out = NULL;
    bst_loop_summary *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the summary");
    }
    bst_status status = bst_world_view_create(ctx, world, &s->view);
    if (status != BST_OK) {
        free(s);
        return status;
    }
    s->camera = *bst_world_camera(world, observer, sensor);
    s->observer = observer;
    s->rate_hz = (double)tick_rate_hz;
    s->object_count = bst_world_object_count(world);
    s->target = target_object;
    s->acquire_tick = -1;
    s->settle_tick = -1;
    s->figures.time_to_confirm_s = NAN;
    s->figures.time_to_acquire_s = NAN;
    s->figures.time_to_settle_s = NAN;
    *out = s;
    return BST_OK;
}

void bst_loop_summary_free(bst_loop_summary *s) {
    if (s) {
        bst_world_view_free(s->view);
        free(s);
    }
}

void bst_loop_summary_archive(bst_loop_summary *s, bst_archive *archive) {
    s->target = (int)bst_archive_integer(archive, s->target, -1, s->object_count - 1);
    BST_ARCHIVE(archive, s->first);
    s->next = s->first + bst_archive_integer(archive, s->next - s->first, 0, WAITING);
    BST_ARCHIVE(archive, s->waiting);
    BST_ARCHIVE(archive, s->toi);
    bst_archive_bool(archive, &s->has_toi);
    BST_ARCHIVE(archive, s->toi_tick);
    BST_ARCHIVE(archive, s->mode);
    bst_archive_bool(archive, &s->last_in_track);
    BST_ARCHIVE(archive, s->newest);
    BST_ARCHIVE(archive, s->figures);
    BST_ARCHIVE(archive, s->acquire_tick);
    BST_ARCHIVE(archive, s->settle_tick);
    bst_loop_tally_archive(&s->tally, archive);
}

void bst_loop_summary_on_frame(bst_loop_summary *s, bst_loop_frame_fn fn, void *user) {
    s->fn = fn;
    s->user = user;
}

static bst_vec3 track_direction_at(const bst_track *track, double seconds) {
    return bst_vec3_unit(bst_vec3_axpy(track->direction_gcrf, seconds, track->rate_gcrf_radps));
}

/* Checks whether a track, propagated to mid-exposure, is on the true target. */
static bool on_target(const bst_loop_summary *s, const waiting_frame *w, const bst_track *track,
                      int64_t tick) {
    return w->known && bst_eval_track_is_on_target(track->direction_gcrf, track->rate_gcrf_radps,
                                                   (double)(w->mid_tick - tick) / s->rate_hz,
                                                   w->direction, bst_camera_scale_rad(&s->camera));
}

/* Checks whether the true direction is within the covariance of a track that predicts an invisible
 * target. Such a prediction over hours need not be accurate to pixels. */
static bool is_foreseen(const bst_loop_summary *s, const waiting_frame *w, const bst_track *track,
                        int64_t tick) {
    if (track->hidden == BST_HIDDEN_NOT || !w->known) {
        return false;
    }
    double dt = (double)(w->mid_tick - tick) / s->rate_hz, p[2][2];
    const double(*c)[4] = track->covariance;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            p[i][j] = c[i][j] + dt * (c[i][j + 2] + c[i + 2][j]) + dt * dt * c[i + 2][j + 2];
        }
    }
    bst_vec3 d = track_direction_at(track, dt);
    bst_vec3 pole = hypot(d.x, d.y) < 1e-6 ? bst_vec3_make(1, 0, 0) : bst_vec3_make(0, 0, 1);
    bst_vec3 e1 = bst_vec3_unit(bst_vec3_cross(pole, d)); /* as bst_track's covariance */
    double x = bst_vec3_dot(w->direction, e1),
           y = bst_vec3_dot(w->direction, bst_vec3_cross(d, e1)),
           det = p[0][0] * p[1][1] - p[0][1] * p[0][1];
    return bst_vec3_dot(w->direction, d) > 0.0 && det > 0.0 &&
           p[1][1] * x * x - 2.0 * p[0][1] * x * y + p[0][0] * y * y <= FORESEEN_CHI2 * det;
}

/* Decides whether a frame is in track, and updates acquisition and settling. */
static void judge(bst_loop_summary *s, waiting_frame *w, const bst_track *track, int64_t track_tick,
                  int64_t now) {
    w->frame.in_track = false;
    if (!track) {
        return;
    }
    if (on_target(s, w, track, track_tick)) {
        w->frame.in_track = true;
        if (s->acquire_tick < 0) {
            s->acquire_tick = now;
            if (isnan(s->figures.time_to_acquire_s)) {
                s->figures.time_to_acquire_s = (double)now / s->rate_hz;
            }
        }
    } else if (!is_foreseen(s, w, track, track_tick)) {
        s->figures.wrong_target_frames++;
    }
}

/* Completes the oldest waiting frame: its result is final. */
static void retire(bst_loop_summary *s) {
    waiting_frame *w = &s->waiting[s->first % WAITING];
    bst_loop_frame *f = &w->frame;
    if (!w->judged) {
        judge(s, w, s->has_toi ? &s->toi : NULL, s->toi_tick, w->mid_tick);
    }
    s->first++;
    f->acquired = s->acquire_tick >= 0 && w->mid_tick >= s->acquire_tick;
    bst_loop_tally_add(&s->tally, f);
    s->last_in_track = f->in_track;
    if (s->fn) {
        s->fn(s->user, f);
    }
}

/* Computes the true target at mid-exposure, in or out of the field. */
static bst_status look_at_target(bst_ctx *ctx, bst_loop_summary *s, const bst_truth *truth,
                                 waiting_frame *w) {
    bst_loop_frame *f = &w->frame;
    bst_world_sight sight;
    bst_status status =
        bst_world_view_sight(ctx, s->view, s->observer, s->target, f->time_s, &sight);
    if (status == BST_ERR_NUMERIC) {
        return BST_OK; /* decayed: not visible */
    }
    BST_TRY(status);
    w->known = true;
    w->direction = sight.geometric;
    f->visible =
        !sight.occulted && bst_scene_glow_electrons_per_s(&s->camera, &sight.glow, NULL) > 0.0;
    f->error_px = bst_eval_pointing_error_px(&s->camera, truth->pixel_scale_arcsec,
                                             truth->q_cam_from_gcrf_mid, sight.apparent,
                                             &f->error_x_px, &f->error_y_px);
    const bst_camera *camera = &s->camera;
    bst_camera scaled;
    if (truth->pixel_scale_arcsec > 0.0 &&
        truth->pixel_scale_arcsec != camera->pixel_scale_arcsec) {
        BST_TRY(bst_world_camera_at_scale(ctx, camera, truth->pixel_scale_arcsec, &scaled));
        camera = &scaled;
    }
    /* the position stays unknown if there is no image */
    (void)bst_camera_project(camera, bst_quat_rotate(truth->q_cam_from_gcrf_mid, sight.apparent),
                             &f->target_x_px, &f->target_y_px);
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *item = &truth->items[i];
        if (item->kind == BST_SOURCE_OBJECT && (int)item->id == s->target &&
            (item->flags & BST_TRUTH_IN_FIELD)) {
            f->target_snr = item->snr;
        }
    }
    return BST_OK;
}

bst_status bst_loop_summary_truth(bst_ctx *ctx, bst_loop_summary *s, const bst_truth *truth) {
    if (s->next - s->first == WAITING) {
        retire(s);
    }
    waiting_frame *w = &s->waiting[s->next % WAITING];
    memset(w, 0, sizeof *w);
    bst_loop_frame *f = &w->frame;
    w->mid_tick = truth->start_tick + (truth->end_tick - truth->start_tick) / 2;
    f->exposure_id = truth->exposure_id;
    f->time_s = 0.5 * (double)(truth->start_tick + truth->end_tick) / s->rate_hz;
    f->error_px = f->error_x_px = f->error_y_px = NAN;
    f->target_x_px = f->target_y_px = NAN;
    f->mode = s->mode;
    if (s->target >= 0) {
        BST_TRY(look_at_target(ctx, s, truth, w));
    }
    if (s->settle_tick < 0 && bst_loop_settles(s->acquire_tick >= 0, s->mode, f->error_px)) {
        s->settle_tick = truth->start_tick;
        if (isnan(s->figures.time_to_settle_s)) {
            s->figures.time_to_settle_s = (double)truth->start_tick / s->rate_hz;
        }
    }
    f->settled = s->settle_tick >= 0;
    s->figures.frames++;
    s->newest = *f;
    s->newest.in_track = s->last_in_track;
    s->next++;
    return BST_OK;
}

/* Records the time of the first confirmed track of the target. */
static void note_confirmation(bst_loop_summary *s, const waiting_frame *w, const bst_tracks *tracks,
                              int64_t now) {
    for (int i = 0; i < tracks->count && isnan(s->figures.time_to_confirm_s); i++) {
        if (tracks->items[i].status == BST_TRACK_CONFIRMED &&
            on_target(s, w, &tracks->items[i], tracks->tick)) {
            s->figures.time_to_confirm_s = (double)now / s->rate_hz;
        }
    }
}

void bst_loop_summary_tracks(bst_loop_summary *s, const bst_tracks *tracks, int64_t tick) {
    /* tracks arrive in the order of exposures: earlier frames get none and use the previous
     * track */
    while (s->first < s->next &&
           s->waiting[s->first % WAITING].frame.exposure_id < tracks->exposure_id) {
        retire(s);
    }
    s->has_toi = false;
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->target_of_interest &&
            (t->status == BST_TRACK_CONFIRMED || t->status == BST_TRACK_COASTING)) {
            s->toi = *t;
            s->has_toi = true;
            s->toi_tick = tracks->tick;
        }
    }
    waiting_frame *w = &s->waiting[s->first % WAITING];
    if (s->first < s->next && w->frame.exposure_id == tracks->exposure_id) {
        w->judged = true;
        note_confirmation(s, w, tracks, tick);
        judge(s, w, s->has_toi ? &s->toi : NULL, s->toi_tick, tick);
        retire(s);
        s->newest.in_track = s->last_in_track;
    }
}

void bst_loop_summary_status(bst_loop_summary *s, const bst_control_status *status) {
    s->mode = status->mode;
    s->figures.final_mode = status->mode;
}

void bst_loop_summary_retarget(bst_loop_summary *s, int target_object) {
    s->target = target_object;
    s->acquire_tick = s->settle_tick = -1;
    s->has_toi = false;
}

void bst_loop_summary_finish(bst_loop_summary *s) {
    while (s->first < s->next) {
        retire(s);
    }
}

void bst_loop_summary_figures(const bst_loop_summary *s, bst_loop_figures *out) {
    *out = s->figures;
    bst_loop_tally_figures(&s->tally, out);
    out->frames = s->figures.frames; /* includes frames that wait for their tracks */
}

void bst_loop_summary_newest(const bst_loop_summary *s, bst_loop_frame *out) {
    *out = s->newest;
}
