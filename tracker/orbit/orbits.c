/* Prediction and update of tracks by their orbits. */
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

void bst_mtt_update_orbits(bst_mtt *m, const bst_mtt_frame *frame) {
    for (int t = 0; m->params.orbits && frame->observer && t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        bst_orbit_track *orbit = &track->orbit;
        if (orbit->valid) {
            if (memcmp(&orbit->sky, &track->state, sizeof orbit->sky) != 0) {
                (void)bst_orbit_track_update(orbit, &track->state);
            }
            continue;
        }
        bst_orbit_range range;
        if (track->status != BST_TRACK_TENTATIVE && !track->at_rest && frame->range &&
            frame->range(frame->user, track, &range)) {
            bst_orbit_track_start(&track->state, frame->observer, &range, orbit);
        }
    }
}
