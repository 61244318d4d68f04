/* Prediction and update of tracks by their orbits. */
#include <assert.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

bool bst_mtt_predict_orbit(const bst_mtt *m, bst_mtt_track *track, const bst_mtt_frame *frame) {
    if (!m->params.orbits || !track->orbit.valid || !frame->observer ||
        !bst_orbit_track_predict(&track->orbit, m->params.orbit_noise_m2ps3, frame->observer)) {
        return false;
    }
    track->state = track->orbit.sky;
    track->models.count = 0;
    return true;
}

/* The range of the detection that has updated a track in the frame. False: none. */
static bool range_of(const bst_mtt *m, const bst_mtt_frame *frame, const bst_mtt_track *track,
                     bst_orbit_measured_range *out) {
    for (int i = 0; i < frame->count && m->params.range_correlation_s > 0.0; i++) {
        const bst_mtt_detection *d = &frame->detections[i];
        if (d->range_m > 0.0 && d->range_sigma_m > 0.0 && track->last_update_tick == frame->tick &&
            track->x_px == d->x_px && track->y_px == d->y_px) {
            *out = (bst_orbit_measured_range){d->range_m, d->range_sigma_m,
                                              m->params.range_correlation_s};
            return true;
        }
    }
    return false;
}

/* Range prior of a track: by the cue or an assumption, else by its size. False: none. */
static bool prior_of(const bst_mtt_frame *frame, const bst_mtt_track *track,
                     const bst_orbit_measured_range *measured, bst_orbit_range *out) {
    if (frame->range && frame->range(frame->user, track, out)) {
        return true;
    }
    *out = (bst_orbit_range){.range_m = measured->range_m,
                             .range_sigma_m = measured->sigma_m,
                             .range_rate_sigma_mps = BST_ANY_RANGE_RATE_MPS};
    return measured->range_m > 0.0;
}

void bst_mtt_update_orbits(bst_mtt *m, const bst_mtt_frame *frame) {
    assert(m && frame);
    for (int t = 0; m->params.orbits && frame->observer && t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        bst_orbit_track *orbit = &track->orbit;
        bst_orbit_measured_range measured = {.range_m = 0.0};
        bool known = range_of(m, frame, track, &measured);
        if (orbit->valid) {
            if (memcmp(&orbit->sky, &track->state, sizeof orbit->sky) != 0) {
                (void)bst_orbit_track_update(orbit, &track->state);
            }
        } else {
            bst_orbit_range range;
            if (track->status == BST_TRACK_TENTATIVE || track->at_rest ||
                !prior_of(frame, track, &measured, &range)) {
                continue;
            }
            bst_orbit_track_start(&track->state, frame->observer, &range, orbit);
            orbit->ranged = known && range.range_m == measured.range_m; /* it is the prior */
            orbit->range_s = orbit->state.time_s;
            known = known && !orbit->ranged;
        }
        if (known && orbit->valid && bst_orbit_track_range(orbit, frame->observer, &measured)) {
            track->state = orbit->sky;
        }
    }
}
