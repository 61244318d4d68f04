/* Stationary tracks: stars that are in no catalogue. */
#include "tracker/mtt/multitarget_internal.h"

/* Camera model errors give a star crossing the field a slow apparent motion: 1 sigma, as a share of
 * the slowest object's rate. */
#define MODEL_SHARE 0.1
/* Number of sigmas from the rate estimate to its upper limit. */
#define RATE_SIGMAS 3.0

bool bst_mtt_has_room(const bst_mtt *m, bool at_rest, int reserve) {
    return at_rest ? m->rest_count < m->params.max_stationary_tracks
                   : m->track_count - m->rest_count + reserve < m->params.max_tracks;
}

/* Variance per axis of a star's apparent rate, in addition to the track's own covariance,
 * (rad/s)^2. */
static double apparent_rate_variance(const bst_mtt *m, const bst_mtt_frame *frame) {
    double model = MODEL_SHARE * m->params.star_rate_radps, common = frame->common_rate_sigma_radps;
    return model * model + common * common;
}

bool bst_mtt_is_at_rest(const bst_mtt *m, const bst_mtt_frame *frame, const bst_mtt_track *track) {
    if (!(m->params.star_rate_radps > 0.0)) {
        return false;
    }
    const bst_sky_state *s = &track->state;
    bst_tangent axes = bst_tangent_at(s->direction);
    double seeming = apparent_rate_variance(m, frame);
    double a = s->covariance[2][2] + seeming, b = s->covariance[2][3],
           c = s->covariance[3][3] + seeming;
    double r1 = bst_vec3_dot(s->rate_radps, axes.e1), r2 = bst_vec3_dot(s->rate_radps, axes.e2);
    double chi2 = (c * r1 * r1 - 2.0 * b * r1 * r2 + a * r2 * r2) / (a * c - b * b);
    return (chi2 <= m->params.motion_chi2 || !track->moved) &&
           !(frame->expected && frame->expected(frame->user, track));
}

bool bst_mtt_is_star(const bst_mtt *m, const bst_mtt_frame *frame, const bst_mtt_track *track) {
    const bst_sky_state *s = &track->state;
    double variance =
        fmax(s->covariance[2][2], s->covariance[3][3]) + apparent_rate_variance(m, frame);
    return track->hits >= m->params.confirm_hits &&
           bst_vec3_norm(s->rate_radps) + RATE_SIGMAS * sqrt(variance) < m->params.star_rate_radps;
}

void bst_mtt_note_place(bst_mtt_track *track, const bst_mtt_detection *detection) {
    track->moved = bst_vec3_norm(bst_vec3_sub(detection->sky.direction, track->first_direction)) >
                   fmax(detection->length_rad, track->first_length_rad);
}

void bst_mtt_set_rest(bst_mtt *m, bst_mtt_track *track, bool at_rest) {
    if (at_rest != track->at_rest && bst_mtt_has_room(m, at_rest, 0)) {
        m->rest_count += at_rest ? 1 : -1;
        track->at_rest = at_rest;
    }
}

void bst_mtt_make_star(bst_mtt_track *track) {
    track->star = true;
    track->status = BST_TRACK_CONFIRMED;
    track->models.count = 0;
    track->state.rate_radps = (bst_vec3){0, 0, 0};
    for (int i = 0; i < 4; i++) {
        for (int j = i < 2 ? 2 : 0; j < 4; j++) {
            track->state.covariance[i][j] = 0.0;
        }
    }
}

void bst_mtt_predict_star(const bst_mtt *m, double dt_s, bst_mtt_track *track) {
    double walk = MODEL_SHARE * m->params.star_rate_radps * dt_s;
    for (int i = 0; i < 2; i++) {
        track->state.covariance[i][i] += walk * walk;
    }
}
