#include "scenegen/smear/smear_body.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/reference.h"
#include "scenegen/smear/body_precision.h"
#include "scenegen/smear/image_nodes.h"
#include "scenegen/smear/smear_internal.h"
#include "sim/world/scene/body_limb.h"
#include "sim/world/scene/los_track.h"

/* Share of the tolerance for the nodes of the image. */
#define IMAGE_SHARE 0.25
/* Image motion by rotation, px, up to which one pose is enough: as a blur it has 1 / 12 of its
 * square as variance. */
#define STILL_PX 0.1
/* Size of the body, px, up to which its light is that of the point source, and from which it is
 * that of its own image. */
#define POINT_PX 2.0
#define IMAGE_PX 32.0

/* An image whose predicted error leaves too little of the tolerance for its nodes, because it is
 * brighter than expected, is drawn again for the light that it has, unless the error stays above
 * that share of what it is. */
#define WORTH 0.9
/* Error of neighbouring nodes together, over the largest of one. */
#define NEIGHBOURS 1.25
/* The same where the image is that of some poses, of which the errors have the same signs. */
#define NEIGHBOURS_IN_POSES 1.7

enum { PATH_TIMES = 64 };

void bst_smear_bodies_clear(bst_smear_bodies *bodies) {
    for (int i = 0; i < bodies->count; i++) {
        bst_satellite_pose_free(bodies->items[i].pose);
        bst_resolved_free(bodies->items[i].image);
        bst_resolved_free(bodies->items[i].trial);
        bst_body_poses_free(&bodies->items[i].others);
        free(bodies->items[i].glints.items);
    }
    free(bodies->items);
    bst_parallel_free(bodies->pool);
    *bodies = (bst_smear_bodies){.count = 0};
}

double bst_smear_radius_px(const bst_smear *s, const bst_scene_source *source) {
    double scale_rad = bst_camera_scale_rad(&s->camera);
    if (source->body) {
        return source->body->satellite->radius_m / fmax(source->range_m, 1e-3) / scale_rad;
    }
    double ghost_px = source->ghost ? bst_ghost_reach_px(source->ghost) : 0.0;
    return source->shape ? tan(asin(source->shape->radius)) / scale_rad : ghost_px;
}

/* Finds or creates the work memory of a source. Memory of a source that left the field is used
 * again. */
static bst_status body_of(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                          bst_smear_body **out) {
    bst_smear_bodies *all = &s->bodies;
    const bst_satellite *satellite = source->body->satellite;
    bst_smear_body *found = NULL;
    for (int i = 0; i < all->count; i++) {
        bst_smear_body *b = &all->items[i];
        if (b->satellite == satellite && b->id == source->id) {
            *out = b;
            return BST_OK;
        }
        found = b->satellite == satellite && b->frame + 2 < s->frame ? b : found;
    }
    if (!found) {
        if (all->count == all->capacity) {
            int capacity = all->capacity ? 2 * all->capacity : 4;
            bst_smear_body *items = realloc(all->items, (size_t)capacity * sizeof *items);
            if (!items) {
                return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d satellites", capacity);
            }
            all->items = items;
            all->capacity = capacity;
        }
        found = &all->items[all->count];
        *found = (bst_smear_body){.satellite = satellite};
        all->count++;
        BST_TRY(bst_satellite_pose_create(ctx, satellite, &found->pose));
        BST_TRY(bst_resolved_create(ctx, satellite, &found->image));
        BST_TRY(bst_resolved_create(ctx, satellite, &found->trial));
        BST_TRY(bst_body_glints_list(ctx, satellite, &found->glints));
    }
    found->id = source->id;
    found->frame = 0;
    *out = found;
    return BST_OK;
}

/* Places the body at time u of the exposure. *light: its illumination, with *earthlight. */
static void pose_at(const bst_smear *s, const bst_scene_source *source, double u,
                    bst_satellite_pose *pose, bst_resolved_view *view, bst_resolved_light *light,
                    bst_earthlight *earthlight) {
    bst_source_body_state state;
    bst_source_body_at(source, u, &state, earthlight);
    bst_quat focal =
        bst_quat_mul(bst_smear_focal_turn(s), bst_los_track_attitude(&s->track, u * s->duration_s));
    view->q_image_from_body = bst_quat_mul(focal, bst_quat_conj(state.q_body_from_gcrf));
    view->origin_m = bst_vec3_scale(bst_quat_rotate(focal, state.apparent), state.range_m);
    view->scale_rad = bst_camera_scale_rad(&s->camera);
    view->limb_px = view->curved_px = 0.0;
    view->hidden = NULL;
    if (pose) {
        bst_source_body_set_pose(source, &state, pose);
    }
    if (light) {
        *light = (bst_resolved_light){.sun = state.aim.sun,
                                      .sun_radius_rad = state.sun_radius_rad,
                                      .earthlight = state.earth ? earthlight : NULL,
                                      .gain = source->body->gain};
    }
}

/* Angle of the rotation from one attitude to another. */
static double turn_between(bst_quat from, bst_quat to) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(to, bst_quat_conj(from))));
}

/* What the Earth hides of the body at time u; NULL: nothing. */
static const bst_resolved_hidden *hidden_at(const bst_smear *s, const bst_scene_source *source,
                                            double u, bst_resolved_hidden *hidden) {
    bst_quat focal =
        bst_quat_mul(bst_smear_focal_turn(s), bst_los_track_attitude(&s->track, u * s->duration_s));
    const bst_body_limb_view view = {focal, bst_camera_scale_rad(&s->camera)};
    return bst_body_limb_hidden(source, u, &view, hidden) ? hidden : NULL;
}

/* Motion of the Earth's limb across the body in the exposure, px. */
static double limb_moved_px(const bst_smear *s, const bst_scene_source *source) {
    double moved = 0.0, radius = bst_smear_radius_px(s, source), before = 0.0;
    for (int k = 0; k <= PATH_TIMES && source->body->limb; k++) {
        double behind = bst_body_limb_behind(source, (double)k / PATH_TIMES);
        behind = fmin(fmax(behind / bst_camera_scale_rad(&s->camera), -radius), radius);
        moved += k > 0 ? fabs(behind - before) : 0.0;
        before = behind;
    }
    return moved;
}

/* Image motion in the exposure: of the body's origin, px, and the rotation of its parts, rad. */
static void measure(const bst_smear *s, const bst_scene_source *source, double *moved_px,
                    double *turn_rad) {
    bst_resolved_view before = {.scale_rad = 0.0}, view;
    double turn = 0.0;
    *moved_px = 0.0;
    for (int k = 0; k <= PATH_TIMES; k++) {
        pose_at(s, source, (double)k / PATH_TIMES, NULL, &view, NULL, NULL);
        if (k > 0) {
            turn += turn_between(before.q_image_from_body, view.q_image_from_body);
            double f = 1.0 / view.scale_rad;
            *moved_px +=
                f *
                hypot(view.origin_m.x / view.origin_m.z - before.origin_m.x / before.origin_m.z,
                      view.origin_m.y / view.origin_m.z - before.origin_m.y / before.origin_m.z);
        }
        before = view;
    }
    const bst_scene_source_body *b = source->body;
    double seconds = (b->seconds[1] - b->seconds[0]) * (source->body_u[1] - source->body_u[0]);
    for (int j = 0; j < b->satellite->joint_count; j++) {
        const bst_joint *joint = &b->satellite->joints[j];
        turn += joint->follows == BST_JOINT_SPIN ? fabs(joint->rate_radps) * seconds : 0.0;
    }
    *turn_rad = turn;
}

/* Electrons per pixel of the body's lit and visible part, about: a body fills a third of the square
 * about its sphere, and its lit fraction is that of a sphere. */
static double per_px_e(const bst_smear *s, const bst_scene_source *source) {
    bst_earthlight earthlight;
    bst_resolved_light light;
    bst_resolved_view view;
    pose_at(s, source, 0.5, NULL, &view, &light, &earthlight);
    bst_vec3 eye = bst_quat_rotate(bst_quat_conj(view.q_image_from_body),
                                   bst_vec3_scale(bst_vec3_unit(view.origin_m), -1.0));
    double lit = fmax(0.5 * (1.0 + bst_vec3_dot(eye, light.sun)), 0.02);
    double across_px = 2.0 * bst_smear_radius_px(s, source);
    double electrons = source->electrons_per_s * s->duration_s;
    return electrons / fmax(0.3 * lit * across_px * across_px, 1.0);
}

/* Limits of the image: what can light the sensor. */
static void clip_box(const bst_smear *s, double room_px, double low[2], double high[2]) {
    double margin = 0.5 * s->options.taps + 2.0 + room_px;
    double cx = bst_camera_centre_x(&s->camera), cy = bst_camera_centre_y(&s->camera);
    bool general = s->camera.geometry.general;
    const double from[2] = {general ? -s->far_px - room_px : -cx - margin,
                            general ? -s->far_px - room_px : -cy - margin};
    const double to[2] = {
        general ? s->far_px + room_px : (double)s->camera.width_px - cx + margin,
        general ? s->far_px + room_px : (double)s->camera.height_px - cy + margin};
    for (int i = 0; i < 2; i++) {
        low[i] = fmax(low[i], from[i]);
        high[i] = fmin(high[i], to[i]);
    }
}

/* Factor on the light of a pose: brings the flux of a body of few pixels to that of the point. */
static double flux_factor(double across_px, double point, double image) {
    if (!(image > 0.0) || !(point > 0.0) || across_px >= IMAGE_PX) {
        return 1.0;
    }
    double x = log(across_px / POINT_PX) / log(IMAGE_PX / POINT_PX);
    x = fmin(fmax(x, 0.0), 1.0);
    return pow(point / image, 1.0 - x * x * (3.0 - 2.0 * x));
}

/* Light of a body's pose over that of the point source, at time u. */
static bst_status find_factor(bst_ctx *ctx, bst_smear *s, bst_smear_body *b,
                              const bst_scene_source *source, double u, double *factor) {
    enum { ACROSS = 64 };
    double across_px = 2.0 * bst_smear_radius_px(s, source);
    *factor = 1.0;
    if (across_px >= IMAGE_PX) {
        return BST_OK;
    }
    bst_earthlight earthlight;
    bst_resolved_light light;
    bst_resolved_view view;
    double low[2], high[2], total;
    pose_at(s, source, u, b->pose, &view, &light, &earthlight);
    if (!bst_resolved_box(b->pose, &view, low, high)) {
        return BST_OK;
    }
    BST_TRY(bst_resolved_begin(ctx, b->trial, low, high, across_px / ACROSS));
    BST_TRY(bst_resolved_add(ctx, b->trial, b->pose, &view, &light, 1.0, &total));
    *factor = flux_factor(across_px, source->electrons_per_s * bst_scene_source_rate_at(source, u),
                          total);
    return BST_OK;
}

/* Largest turn between poses of which the boxes are found, rad, if the body has no joints, is
 * BOX_RANGE radii away or more, and its range changes by BOX_RANGE_CHANGE at most. Between them a
 * place is off the line by 1 / 8 of the square of the turn, of the radius. Where the least turn
 * from one to the other is BOX_DIRECT of the path or more, the path is off it by sqrt(1 -
 * BOX_DIRECT^2) / 2 of its length. Both together are BOX_ROOM at most. */
#define BOX_TURN_RAD 0.25
#define BOX_DIRECT 0.9999
#define BOX_ROOM 0.01
#define BOX_RANGE 20.0
#define BOX_RANGE_CHANGE 0.01

/* True if the boxes of some poses tell those of the others. */
static bool may_skip_boxes(const bst_smear *s, const bst_scene_source *source,
                           const bst_body_times *t) {
    const bst_satellite *satellite = source->body->satellite;
    double least_m = INFINITY, most_m = 0.0;
    for (int k = 0; k < t->count; k++) {
        bst_resolved_view view;
        pose_at(s, source, t->u[k], NULL, &view, NULL, NULL);
        least_m = fmin(least_m, view.origin_m.z);
        most_m = fmax(most_m, view.origin_m.z);
    }
    return satellite->joint_count == 0 && least_m >= BOX_RANGE * satellite->radius_m &&
           most_m <= (1.0 + BOX_RANGE_CHANGE) * least_m;
}

/* Box of the image over all poses; false: a pose has none, or all are off the sensor. */
static bool find_box(const bst_smear *s, const bst_smear_body *b, const bst_scene_source *source,
                     const bst_body_times *t, double low[2], double high[2]) {
    bool skip = t->count > 2 && may_skip_boxes(s, source, t);
    double room = skip ? BOX_ROOM * bst_smear_radius_px(s, source) : 0.0, turn = 0.0;
    /* of the body about the image of its origin, in all poses so far; and of the origin */
    double about[2][2] = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    double origin[2][2] = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    bst_resolved_view view = {.scale_rad = 0.0}, next;
    bst_quat measured = {0.0, 0.0, 0.0, 1.0};
    low[0] = low[1] = INFINITY;
    high[0] = high[1] = -INFINITY;
    pose_at(s, source, t->u[0], NULL, &next, NULL, NULL);
    for (int k = 0; k < t->count; k++) {
        view = next;
        double step = 0.0, direct = 0.0; /* direct: from the last pose measured to the next one */
        if (k + 1 < t->count) {
            pose_at(s, source, t->u[k + 1], NULL, &next, NULL, NULL);
            step = turn_between(view.q_image_from_body, next.q_image_from_body);
            direct = turn_between(measured, next.q_image_from_body);
        }
        double per_m = 1.0 / (view.origin_m.z * view.scale_rad);
        const double at[2] = {view.origin_m.x * per_m, view.origin_m.y * per_m};
        bool ends = k == 0 || k + 1 == t->count;
        if (!skip || ends || turn + step > BOX_TURN_RAD || direct < BOX_DIRECT * (turn + step)) {
            double from[2], to[2];
            measured = view.q_image_from_body;
            pose_at(s, source, t->u[k], b->pose, &view, NULL, NULL);
            if (!bst_resolved_box(b->pose, &view, from, to)) {
                return false;
            }
            for (int i = 0; i < 2; i++) {
                about[0][i] = fmin(about[0][i], from[i] - at[i] - room);
                about[1][i] = fmax(about[1][i], to[i] - at[i] + room);
                low[i] = fmin(low[i], from[i]);
                high[i] = fmax(high[i], to[i]);
            }
            turn = 0.0;
        }
        for (int i = 0; i < 2; i++) {
            origin[0][i] = fmin(origin[0][i], at[i]);
            origin[1][i] = fmax(origin[1][i], at[i]);
        }
        turn += step;
    }
    for (int i = 0; i < 2 && skip; i++) {
        low[i] = origin[0][i] + about[0][i];
        high[i] = origin[1][i] + about[1][i];
    }
    return true;
}

/* Adds pose k to an image: its light only, or with `light_only` false with cover and parts. */
static bst_status draw(bst_ctx *ctx, const bst_body_image_plan *d, int k, bool light_only,
                       bst_satellite_pose *pose, bst_resolved *image) {
    bst_earthlight earthlight;
    bst_resolved_light light;
    bst_resolved_view view;
    double weight = d->times.weight[k];
    pose_at(d->s, d->source, d->times.u[k], pose, &view, &light, &earthlight);
    light.penumbrae = d->s->options.penumbrae;
    light.shadow_at[0] = d->times.shadow_at[k][0];
    light.shadow_at[1] = d->times.shadow_at[k][1];
    view.curved_px = d->curved_px;
    view.limb_px = fmin(d->limb_px, d->curved_px);
    bst_resolved_hidden hidden;
    view.hidden = hidden_at(d->s, d->source, d->times.u[k], &hidden);
    return light_only ? bst_resolved_add_light(ctx, image, pose, &view, &light, weight)
                      : bst_resolved_add(ctx, image, pose, &view, &light, weight, NULL);
}

/* Callback of several threads. */
static bst_status draw_light(bst_ctx *ctx, void *user, int k, bst_satellite_pose *pose,
                             bst_resolved *image) {
    return draw(ctx, user, k, true, pose, image);
}

/* Draws all poses in the box low to high. */
static bst_status draw_poses(bst_ctx *ctx, bst_smear *s, bst_smear_body *b, bst_body_image_plan *d,
                             const double low[2], const double high[2]) {
    bool light_only = bst_resolved_may_add_light(b->satellite);
    double area_px2 = (high[0] - low[0]) * (high[1] - low[1]);
    b->cell_px = bst_body_cell_px(d, area_px2, light_only, b->blurred);
    BST_TRY((light_only ? bst_resolved_begin_box : bst_resolved_begin)(ctx, b->image, low, high,
                                                                       b->cell_px));
    d->limb_px = bst_body_limb_px(s, d->light_e);
    double inverse = 1.0 / d->source->electrons_per_s;
    if (b->one_pose && d->source->rate) { /* the path has the rate */
        inverse /= bst_scene_source_rate_at(d->source, 0.5);
    }
    double factor = 1.0;
    for (int k = 0; k < d->times.count; k++) {
        if (k == 0 || d->times.u[k] != d->times.u[k - 1]) {
            BST_TRY(find_factor(ctx, s, b, d->source, d->times.u[k], &factor));
        }
        d->times.weight[k] *= factor * inverse;
    }
    if (light_only) {
        bst_parallel *pool = s->options.pool;
        if (d->times.count > 1 && !pool) {
            if (!s->bodies.pool) {
                BST_TRY(bst_parallel_create(ctx, s->options.body_threads, &s->bodies.pool));
            }
            pool = s->bodies.pool;
        }
        const bst_body_drawing all = {.satellite = b->satellite,
                                      .pose = b->pose,
                                      .image = b->image,
                                      .low = {low[0], low[1]},
                                      .high = {high[0], high[1]},
                                      .cell_px = b->cell_px,
                                      .scale_rad = bst_camera_scale_rad(&s->camera),
                                      .count = d->times.count,
                                      .blurred = b->blurred && bst_body_even(d),
                                      .draw = draw_light,
                                      .user = d,
                                      .pool = pool};
        return bst_body_poses_draw(ctx, &b->others, &all);
    }
    for (int k = 0; k < d->times.count; k++) {
        BST_TRY(draw(ctx, d, k, false, b->pose, b->image));
    }
    return BST_OK;
}

/* Draws the image of a source for an expected light in a pixel, in d->light_e. *there false: a part
 * of the body is beside the observer. */
static bst_status draw_image(bst_ctx *ctx, bst_smear *s, bst_smear_body *b, bst_body_image_plan *d,
                             bool *there) {
    double low[2], high[2];
    d->times = (bst_body_times){.u = {0.5}, .weight = {1.0}, .count = 1, .light = 1.0};
    b->blurred = false;
    if (!b->one_pose) {
        bst_body_choose_poses(d, b->pose, &b->blurred);
    }
    if (d->sun_rule > 0) {
        d->sun_rule = bst_body_penumbra_expand(&d->times, d->sun_rule);
    }
    b->penumbrae = d->sun_rule > 0;
    *there = find_box(s, b, d->source, &d->times, low, high);
    if (!*there) {
        return BST_OK;
    }
    clip_box(s, b->one_pose ? d->moved_px : 0.0, low, high);
    b->empty = !(low[0] < high[0] && low[1] < high[1]);
    b->frame = s->frame;
    return b->empty ? BST_OK : draw_poses(ctx, s, b, d, low, high);
}

/* Error of all nodes, over their share of the tolerance. */
static double neighbours_of(const bst_smear_body *b) {
    return (b->one_pose && !b->penumbrae) || b->blurred ? NEIGHBOURS : NEIGHBOURS_IN_POSES;
}

/* Makes the image of a source for the frame: again, finer, if its light turns out to be so bright
 * that the error is too large. *there false: a part of the body is beside the observer. */
static bst_status make_image(bst_ctx *ctx, bst_smear *s, bst_smear_body *b,
                             const bst_scene_source *source, bool *there) {
    enum { ROUNDS = 3 };
    bst_body_image_plan d = {.s = s,
                             .source = source,
                             .light_e = per_px_e(s, source),
                             .curved_px = BST_RESOLVED_CURVED_PX};
    measure(s, source, &d.moved_px, &d.turn_rad);
    d.turned_px = d.turn_rad * bst_smear_radius_px(s, source);
    d.hidden_px = limb_moved_px(s, source);
    b->one_pose = d.turned_px + d.hidden_px <= STILL_PX;
    b->x0 = b->y0 = 0.0;
    if (b->one_pose) {
        (void)bst_smear_project(s, source, bst_los_track_attitude(&s->track, 0.5 * s->duration_s),
                                bst_scene_source_direction(source, 0.5), &b->x0, &b->y0);
    } else {
        bst_body_glints_find(source, &b->glints, d.turn_rad, b->pose, &d.glints);
        d.glint_count = d.glints.count;
    }
    double before = 0.0;
    for (int round = 0; round < ROUNDS; round++) {
        double light_e, curved_e;
        BST_TRY(draw_image(ctx, s, b, &d, there));
        if (!*there || b->empty) {
            return BST_OK;
        }
        bst_body_set_error(&d, b, &light_e, &curved_e);
        double limit = 1.0 - IMAGE_SHARE * neighbours_of(b);
        int sun_rule = bst_body_choose_sun(&d, b, limit * s->options.tolerance_sigma);
        d.light_e = fmax(light_e, 1.1 * d.light_e);
        d.curved_px = bst_body_curved_px(s, curved_e);
        d.limb_px = bst_body_limb_px(s, d.light_e);
        /* without that of shadows if they stay as they are, and with what would be left of it */
        bool same = sun_rule == d.sun_rule;
        double sigma = b->sigma - (same ? bst_body_shadow_sigma(&d, b, sun_rule) : 0.0);
        double least = bst_body_least_error(&d, b, curved_e) +
                       (same ? 0.0 : bst_body_shadow_sigma(&d, b, sun_rule));
        d.sun_rule = sun_rule;
        if (sigma <= limit * s->options.tolerance_sigma || (round > 0 && sigma > WORTH * before) ||
            least > WORTH * sigma) {
            break;
        }
        before = sigma;
    }
    return BST_OK;
}

bst_status bst_smear_body_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                double x, double y, bool *there) {
    bst_smear_body *b = NULL;
    *there = true;
    BST_TRY(body_of(ctx, s, source, &b));
    if (b->frame != s->frame) {
        BST_TRY(make_image(ctx, s, b, source, there));
        if (!*there) {
            return BST_OK;
        }
    }
    bst_smear_nodes_clear(&s->nodes);
    if (b->empty) {
        return BST_OK;
    }
    double electrons = source->electrons_per_s * s->duration_s;
    bst_image_nodes_aim aim = {.sigma_px = s->sigma_px,
                               .widest = s->widest,
                               .electrons = electrons,
                               .dark_variance_e2 = s->dark_variance_e2,
                               .tolerance_sigma = IMAGE_SHARE * s->aim * s->options.tolerance_sigma,
                               .blurred = b->blurred,
                               .x0 = b->one_pose ? b->x0 : x,
                               .y0 = b->one_pose ? b->y0 : y};
    bst_image_nodes_result image;
    BST_TRY(bst_image_nodes(ctx, bst_resolved_image_of(b->image), &aim, &s->points, &image));
    double line = bst_reference_pixel_share(0.0, s->share_sigma_px, 0), share = 1.0;
    double read_share = 1.0;
    if (b->one_pose) {
        BST_TRY(bst_smear_centre_nodes(ctx, s, source, x, y, s->tolerance[0]));
        share = bst_smear_largest_share(s, &read_share);
        s->last_peak_e = electrons * fmin(share * image.light, image.peak);
        s->last_read_e =
            electrons * fmin(read_share * image.light, image.peak * s->binning * s->binning);
        int level = bst_smear_choose_level(s, 1.0);
        BST_TRY(bst_smear_centre_nodes(ctx, s, source, x, y, s->tolerance[level]));
    } else {
        bst_smear_node_list *list = &s->nodes;
        BST_TRY(
            bst_smear_reserve(ctx, (void **)&list->items, &list->capacity, 1, sizeof *list->items));
        list->items[0] = (bst_smear_node){.weight = 1.0};
        list->count = 1;
        s->last_peak_e = electrons * fmin(line * line * image.light, image.peak);
        s->last_read_e = electrons * fmin(image.light, image.peak * s->binning * s->binning);
    }
    s->body_sigma = b->sigma;
    s->chord_error = neighbours_of(b) * image.error_e / fmax(s->last_read_e, 1e-9);
    return bst_extended_source_spread(ctx, &s->points, s->stretch, &s->nodes);
}
