/* Queries of the multi-target tracker answered from a frame's attitude, cue and observer state. */
#include <math.h>

#include "sim/onboard/nav_motion.h"
#include "tracker/mtt/visibility.h"
#include "tracker/tracker_internal.h"

bool bst_tracker_frame_expected_rate(const void *user, bst_vec3 direction, bst_vec3 *rate_radps) {
    const bst_tracker_frame_view *f = user;
    if (!f->cue.valid) {
        return false;
    }
    *rate_radps = bst_target_expected_rate(&f->cue, direction);
    return true;
}

bool bst_tracker_frame_in_field(const void *user, bst_vec3 direction) {
    const bst_tracker_frame_view *f = user;
    const bst_camera *camera = &f->tracker->camera;
    double x, y, margin = f->tracker->edge_margin_px;
    bst_vec3 v = bst_quat_rotate(f->q_cam_from_gcrf, bst_light_aberrate(&f->light, direction));
    return bst_camera_project(camera, v, &x, &y) && x >= margin && y >= margin &&
           x <= (double)(camera->width_px - 1) - margin &&
           y <= (double)(camera->height_px - 1) - margin;
}

bool bst_tracker_frame_is_expected(const void *user, const bst_mtt_track *track) {
    const bst_tracker_frame_view *f = user;
    const bst_tracker *t = f->tracker;
    return bst_target_is_expected(&t->target_params, &f->cue, track,
                                  track->id == t->target.id ? &t->target : NULL);
}

bool bst_tracker_frame_range_of(const void *user, const bst_mtt_track *track,
                                bst_orbit_range *out) {
    const bst_tracker_frame_view *f = user;
    const bst_tracker *t = f->tracker;
    double range_m, range_rate_mps;
    if (f->cue.valid && f->cue.in_region) {
        bst_vec3 rate;
        if (!bst_tracker_frame_is_expected(user, track) ||
            !bst_belt_motion(&f->cue.belt_eye, track->state.direction, &rate, &range_m,
                             &range_rate_mps)) {
            return false;
        }
        *out = (bst_orbit_range){.range_m = range_m,
                                 .range_sigma_m = t->range_sigma * range_m,
                                 .range_rate_mps = range_rate_mps,
                                 .range_rate_sigma_mps = t->range_rate_sigma_mps};
        return true;
    }
    bool cued = f->range_m > 0.0 && bst_tracker_frame_is_expected(user, track);
    if (!cued && !(t->assumed_range_m > 0.0)) {
        return false;
    }
    double range = cued ? f->range_m : t->assumed_range_m;
    *out = (bst_orbit_range){
        .range_m = range,
        .range_sigma_m = t->range_sigma * range,
        .range_rate_mps = cued ? f->range_rate_mps : 0.0,
        .range_rate_sigma_mps = cued ? t->range_rate_sigma_mps : BST_ANY_RANGE_RATE_MPS};
    return true;
}

bst_mtt_sight bst_tracker_frame_sight_of(const void *user, const bst_mtt_track *track,
                                         bst_mtt_light *light) {
    const bst_tracker_frame_view *f = user;
    bst_vec3 eye = f->observer.position_m;
    return bst_visibility_of(
        track->orbit.state.position_m, eye, bst_vec3_add(eye, f->light.sun_m),
        &(bst_visibility_seen){track->full_snr, track->full_glow, track->was_bright},
        f->threshold_snr, light);
}

bool bst_tracker_frame_observer(const bst_tracker *t, const bst_nav_telemetry *nav, double seconds,
                                bst_od_observer *out) {
    double dt = seconds - bst_tracker_clock_s(t) - (double)nav->tick / t->tick_rate_hz;
    out->time_s = seconds;
    out->earth_bary_mps = bst_vec3_sub(nav->velocity_bary_mps, nav->velocity_gcrf_mps);
    bst_nav_state_after(nav, dt, &out->position_m, &out->velocity_mps);
    return isfinite(bst_vec3_norm(out->position_m)) && bst_vec3_norm(out->position_m) > 0.0;
}
