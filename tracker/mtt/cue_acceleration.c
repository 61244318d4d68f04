/* Acceleration of the cue, applied to tracks near it. */
#include "tracker/mtt/multitarget_internal.h"

#define JUMP_FLOOR_RAD 1e-6

bool bst_mtt_cue_acceleration(const bst_mtt_frame *frame, double dt_s, bst_vec3 *step,
                              bst_vec3 *rate) {
    if (!frame->cue_valid || !frame->cue_before_valid) {
        return false;
    }
    bst_sky_state cue = {.direction = frame->cue_before_direction,
                         .rate_radps = bst_tangent_project(frame->cue_before_direction,
                                                           frame->cue_before_rate_radps)};
    bst_sky_predict(&cue, dt_s, 0.0);
    bst_vec3 now = frame->cue_direction;
    /* a jump of more than 26 degrees is another cue, not an acceleration */
    if (!(bst_vec3_dot(cue.direction, now) > 0.9)) {
        return false;
    }
    *step = bst_vec3_scale(bst_tangent_log(now, cue.direction), -1.0);
    /* under constant acceleration the offset is half the change of rate; a cue with a larger offset
     * than its rate explains has jumped */
    if (bst_vec3_norm(*step) > 2.0 * bst_vec3_norm(frame->cue_rate_radps) * dt_s + JUMP_FLOOR_RAD) {
        return false;
    }
    *rate = bst_vec3_sub(bst_tangent_project(now, frame->cue_rate_radps),
                         bst_tangent_carry(cue.direction, now, cue.rate_radps));
    return true;
}

bool bst_mtt_shares_acceleration(const bst_mtt *m, const bst_mtt_track *track,
                                 const bst_mtt_frame *frame) {
    return !track->at_rest &&
           bst_vec3_dot(track->state.direction, frame->cue_direction) >
               cos(m->params.feed_forward_rad) &&
           /* design choice: what moves ten times slower than the cue is a star or a defect, not the
            * target */
           bst_vec3_norm(track->state.rate_radps) > 0.1 * bst_vec3_norm(frame->cue_rate_radps);
}
