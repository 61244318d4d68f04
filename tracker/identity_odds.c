/* What the choice of the target needs of a comparison with the catalogue. */
#include "tracker/identity.h"

double bst_identity_scale(const bst_target_cue *cue, const bst_mtt_track *track) {
    bool bright = isfinite(cue->v_mag) && isfinite(cue->v_mag_sigma) && isfinite(track->v_mag);
    /* without a magnitude the density is that of direction and rate, over BST_IDENTITY_MAG mag */
    return pow(2.0 * BST_PI, bright ? -2.5 : -2.0) / (bright ? 1.0 : BST_IDENTITY_MAG);
}

double bst_identity_log_unexplained(const bst_identity *identity, int64_t track_id,
                                    int32_t object) {
    for (int t = 0; t < identity->tracks; t++) {
        if (identity->track_id[t] != track_id) {
            continue;
        }
        double others = 0.0; /* relative to unknown */
        for (int o = 0; o < identity->objects; o++) {
            others += identity->object[o] == object ? 0.0 : identity->probability[t][o];
        }
        return -log1p(others / fmax(identity->unknown[t], 1e-300));
    }
    return 0.0;
}
