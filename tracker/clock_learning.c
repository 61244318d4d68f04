/* Which detections show the offset of the onboard clock. */
#include <stdlib.h>

#include "tracker/tracker_internal.h"

/* Time between measurements, s: those of successive frames share most of their attitude's error. */
static const double PERIOD_S = 1.0;
/* Least probability that a track is of the object. */
static const double SURE = 0.999;

bst_status bst_tracker_clock_create(bst_ctx *ctx, const bst_tracker_config *c, bst_tracker *t) {
    if (!(c->clock_sigma_s > 0.0)) {
        return BST_OK;
    }
    if (!(c->identity_period_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "tracker: clock_sigma_s (%g) needs the identity of tracks; give "
                        "identity_period_s above 0, or clock_sigma_s 0",
                        c->clock_sigma_s);
    }
    t->clock_params = (bst_clock_params){.sigma_s = c->clock_sigma_s,
                                         .object_sigma_m = c->catalogue_sigma_m,
                                         .object_sigma_mps = c->catalogue_sigma_mps,
                                         .observer_sigma_m = c->navigation_sigma_m};
    t->clock = calloc(1, sizeof *t->clock);
    return t->clock ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
}

bst_status bst_tracker_clock_archive(bst_tracker *t, bst_archive *archive) {
    bool saved = t->clock != NULL;
    bst_archive_bool(archive, &saved);
    if (!saved) {
        return BST_OK;
    }
    bst_clock *unused = t->clock ? NULL : calloc(1, sizeof *unused);
    bst_clock *c = t->clock ? t->clock : unused;
    if (!c) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_MEMORY, "tracker: out of memory");
    }
    bst_archive_bool(archive, &c->started);
    BST_ARCHIVE(archive, c->time_s);
    BST_ARCHIVE(archive, c->measurements);
    BST_ARCHIVE(archive, c->object);
    BST_ARCHIVE(archive, c->seen_s);
    BST_ARCHIVE(archive, c->state);
    BST_ARCHIVE(archive, c->covariance);
    free(unused);
    return BST_OK;
}

double bst_tracker_clock_sigma_s(const bst_tracker *t, double corrected_s) {
    return t->clock ? hypot(bst_clock_sigma_s(t->clock, &t->clock_params),
                            t->clock->state[0] - corrected_s)
                    : 0.0;
}

/* The catalogue's object that a track certainly is; negative: none. */
static int32_t object_of(const bst_identity *identity, int64_t track_id) {
    for (int t = 0; t < identity->tracks; t++) {
        for (int o = 0; o < identity->objects && identity->track_id[t] == track_id; o++) {
            if (identity->probability[t][o] >= SURE) {
                return identity->object[o];
            }
        }
    }
    return BST_IDENTITY_UNKNOWN;
}

/* The detection that a track alone has in this frame; NULL: none. */
static const bst_mtt_detection *detection_of(const bst_mtt_frame *frame,
                                             const bst_mtt_track *track) {
    const bst_mtt_detection *found = NULL;
    if (track->last_chi2 < 0.0 || track->merged_in_row > 0) {
        return NULL;
    }
    for (int i = 0; i < frame->count && !found; i++) {
        const bst_mtt_detection *d = &frame->detections[i];
        bool same = !(d->x_px < track->x_px) && !(d->x_px > track->x_px) &&
                    !(d->y_px < track->y_px) && !(d->y_px > track->y_px);
        found = same ? d : NULL;
    }
    return found;
}

void bst_tracker_learn_clock(bst_tracker *t, const bst_tracker_input *input,
                             const bst_mtt_frame *frame) {
    bst_clock *c = t->clock;
    int count;
    const bst_mtt_track *tracks = bst_mtt_tracks(t->mtt, &count);
    if (!c || !input->sight || (c->started && frame->seconds - c->time_s < PERIOD_S) ||
        frame->seconds - t->identified_s > t->identity_period_s) {
        return;
    }
    for (int i = 0; i < count; i++) {
        const bst_mtt_detection *d = detection_of(frame, &tracks[i]);
        int32_t object = d ? object_of(t->identity, tracks[i].id) : BST_IDENTITY_UNKNOWN;
        bst_clock_sight sight;
        if (object >= 0 && input->sight(input->near_user, object, &sight)) {
            bst_clock_predict(c, &t->clock_params, frame->seconds);
            bst_clock_measure(c, &t->clock_params, &sight, &d->sky);
        }
    }
}
