#include "sim/world/scene/field.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/messages/message_invariants.h"
#include "sim/optics/psf.h"
#include "sim/world/scene/field_ghosts.h"
#include "sim/world/scene/field_internal.h"
#include "sim/world/scene/field_objects.h"
#include "sim/world/scene/los_track.h"
#include "sim/world/scene/skylight.h"

/* statistical stars cached for the next field query: 40 MiB */
#define FAINT_CACHE_STARS 1048576

bst_status bst_field_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                            bst_field **out) {
    assert(world && out && observer >= 0 && sensor >= 0);
    *out = NULL;
    bst_field *field = calloc(1, sizeof *field);
    if (!field) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a field query");
    }
    field->world = world;
    field->observer = observer;
    field->camera = bst_world_camera(world, observer, sensor);
    field->star_capacity = 4096;
    field->stars = malloc((size_t)field->star_capacity * sizeof *field->stars);
    field->near = malloc(((size_t)bst_world_object_count(world) + 1) * sizeof *field->near);
    bst_status status = field->stars && field->near
                            ? bst_world_view_create(ctx, world, &field->view)
                            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a field query");
    if (status == BST_OK && bst_skylight_may_vary(field->camera)) {
        status = bst_skylight_create(ctx, world, field->camera, &field->skylight);
    }
    if (status == BST_OK && world->faint && isfinite(world->faint_limit_v_mag)) {
        status = bst_faint_stars_create(ctx, world->faint, FAINT_CACHE_STARS, &field->faint);
    }
    if (status != BST_OK) {
        bst_field_free(field);
        return status;
    }
    *out = field;
    return BST_OK;
}

/* Frees the memory of the objects. */
static void free_parts(bst_field *field) {
    for (int i = 0; i < field->part_capacity; i++) {
        free(field->parts[i].body);
    }
    free(field->parts);
}

void bst_field_free(bst_field *field) {
    if (field) {
        bst_world_view_free(field->view);
        bst_faint_stars_free(field->faint);
        bst_skylight_free(field->skylight);
        bst_los_track_store_free(&field->track);
        bst_los_track_store_free(&field->middle);
        free(field->stars);
        free(field->sources);
        free_parts(field);
        free(field->near);
        free(field->ghost_near);
        bst_star_occultation_free(&field->hiding);
        free(field);
    }
}

void bst_field_set_camera(bst_field *field, const bst_camera *camera) {
    field->camera = camera;
    if (field->skylight) {
        bst_skylight_set_camera(field->skylight, camera);
    }
}

void bst_field_set_background_places_only(bst_field *field) {
    if (field->skylight) {
        bst_skylight_set_places_only(field->skylight);
    }
}

bst_status bst_field_track(bst_ctx *ctx, bst_field *field, const bst_los_history *history,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_los_track *out) {
    assert(field && history && out && start_tick <= end_tick && tick_rate_hz > 0);
    return bst_los_track_cut(ctx, &field->track, history, start_tick, end_tick, tick_rate_hz, out);
}

/* Rotation vector from attitude `from` to `to`, camera axes. */
static bst_vec3 deviation(bst_quat from, bst_quat to) {
    return bst_quat_to_rotvec(bst_quat_mul(to, bst_quat_conj(from)));
}

/* Attitude that maps a star near the boresight to its mean position in the exposure. The mean
 * rotation differs if the camera rolls while it slews, because the star trail is curved. */
static bst_quat attitude_of_mean_place(const bst_field *field) {
    bst_quat mean = field->sigma_q[0];
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(mean), (bst_vec3){0, 0, 1});
    double x = 0.0, y = 0.0;
    for (int p = 1; p < BST_FIELD_SIGMA_POINTS; p++) {
        bst_vec3 seen = bst_quat_rotate(field->sigma_q[p], axis);
        x += seen.x / seen.z / (BST_FIELD_SIGMA_POINTS - 1);
        y += seen.y / seen.z / (BST_FIELD_SIGMA_POINTS - 1);
    }
    if (!isfinite(x) || !isfinite(y)) {
        return mean; /* rotation by 90 degrees: no image */
    }
    return bst_quat_mul(bst_quat_from_rotvec((bst_vec3){-y, x, 0.0}), mean);
}

/* Computes the sigma points of the exposure, the mean attitude, and the largest displacement (px)
 * of any image point from mid-exposure. */
static void summarise_track(bst_field *field, const bst_los_track *track, bst_quat *mean,
                            double *reach_px) {
    enum { D = BST_FIELD_SIGMA_DIMENSIONS };
    double exposure = track->time_s[track->count - 1];
    field->exposure_s = exposure;
    field->q_mid = bst_los_track_attitude(track, 0.5 * exposure);
    double first[D] = {0}, second[D][D] = {{0}}, total = 0.0, reach = 0.0;
    double previous[D] = {0};
    for (int k = 0; k < track->count; k++) {
        bst_vec3 d = deviation(field->q_mid, track->q_cam_from_gcrf[k]);
        double now[D] = {d.x, d.y, d.z, exposure > 0.0 ? track->time_s[k] / exposure : 0.5};
        reach = fmax(reach, bst_los_track_turned_px(field->camera, d));
        /* moments of the piecewise linear path between samples */
        double w = k > 0 ? (exposure > 0.0 ? track->time_s[k] - track->time_s[k - 1] : 1.0) : 0.0;
        for (int i = 0; i < D; i++) {
            first[i] += 0.5 * w * (previous[i] + now[i]);
            for (int j = 0; j < D; j++) {
                second[i][j] += w / 6.0 *
                                (2.0 * previous[i] * previous[j] + 2.0 * now[i] * now[j] +
                                 previous[i] * now[j] + now[i] * previous[j]);
            }
        }
        total += w;
        memcpy(previous, now, sizeof now);
    }
    double chol[D][D] = {{0}};
    for (int i = 0; i < D; i++) {
        first[i] /= total;
    }
    for (int i = 0; i < D; i++) {
        for (int j = 0; j <= i; j++) {
            double c = second[i][j] / total - first[i] * first[j];
            for (int m = 0; m < j; m++) {
                c -= chol[i][m] * chol[j][m];
            }
            /* zero variance gives a zero column */
            chol[i][j] = i == j ? sqrt(fmax(c, 0.0)) : chol[j][j] > 1e-300 ? c / chol[j][j] : 0.0;
        }
    }
    const double spread = sqrt((double)D); /* the centre has zero weight */
    for (int p = 0; p < BST_FIELD_SIGMA_POINTS; p++) {
        double point[D];
        for (int i = 0; i < D; i++) {
            double step = p == 0 ? 0.0 : chol[i][(p - 1) / 2] * spread * ((p & 1) ? 1.0 : -1.0);
            point[i] = first[i] + step;
        }
        field->sigma_q[p] = bst_quat_mul(
            bst_quat_from_rotvec((bst_vec3){point[0], point[1], point[2]}), field->q_mid);
        field->sigma_time[p] = point[3];
    }
    *mean = attitude_of_mean_place(field);
    *reach_px = reach;
}

bool bst_field_project(const bst_camera *camera, const bst_los_track *track, int k,
                       const bst_scene_source *source, double *x_px, double *y_px) {
    double exposure = track->time_s[track->count - 1];
    double u = exposure > 0.0 ? track->time_s[k] / exposure : 0.5;
    return bst_camera_project(
        camera,
        bst_scene_source_seen(
            camera, source,
            bst_quat_rotate(track->q_cam_from_gcrf[k], bst_scene_source_direction(source, u))),
        x_px, y_px);
}

/* Records in the truth how much of the window Earth, Moon and Sun cover. True: a disc must be
 * rendered. */
static bool bodies_in_field(const bst_camera *camera, const bst_scene_surroundings *around,
                            bst_window window, bst_truth *truth) {
    bst_discs discs;
    bst_discs_make(camera, around, &discs);
    truth->earth_fraction = bst_discs_share(&discs, camera, BST_BODY_EARTH, window);
    truth->moon_fraction = bst_discs_share(&discs, camera, BST_BODY_MOON, window);
    truth->sun_fraction = bst_discs_share(&discs, camera, BST_BODY_SUN, window);
    return bst_discs_any(&discs);
}

static bst_status reserve_parts(bst_ctx *ctx, bst_field *field, int count) {
    if (count > field->part_capacity) {
        count += count / 2; /* few later frames then need more */
        free_parts(field);
        field->parts = calloc((size_t)count, sizeof *field->parts);
        field->part_capacity = field->parts ? count : 0;
        if (!field->parts) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d objects", count);
        }
    }
    return BST_OK;
}

/* Prepares the attitude track of a field query: times, mean attitude, and margin for the motion. */
static bst_status settle_track(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                               const bst_field_options *options, bst_field_scene *q) {
    double reach_px;
    q->own = *track;
    if (options->lead_s > 0.0) {
        BST_TRY(bst_los_track_part(ctx, &field->middle, track, options->lead_s,
                                   options->lead_s + q->exposure_s, &q->own));
    }
    summarise_track(field, &q->own, &q->mean, &reach_px);
    for (int k = 0; options->lead_s > 0.0 && k < track->count; k++) {
        reach_px = fmax(reach_px, bst_los_track_moved_px(field->camera, field->q_mid,
                                                         track->q_cam_from_gcrf[k]));
    }
    q->start_s -= options->lead_s;
    q->end_s += options->lead_s;
    q->margin_px = options->margin_px + reach_px;
    return BST_OK;
}

/* Computes observer, Earth, Sun and Moon at mid-exposure, with aberration and light deflection. */
static bst_status place_observer(bst_ctx *ctx, bst_field *field, bst_field_scene *q) {
    bst_astro_earth_frames frames;
    BST_TRY(bst_world_view_observer_state(ctx, field->view, field->observer, q->mid_s, &q->eye));
    BST_TRY(bst_world_view_bodies(ctx, field->view, q->mid_s, &q->bodies));
    BST_TRY(bst_world_view_earth_frames(ctx, field->view, q->mid_s, &frames));
    q->itrf_from_gcrf = frames.itrf_from_gcrf;
    q->light = bst_light_at(&q->bodies, q->eye.position_m, q->eye.velocity_mps);
    q->geocentric = bst_light_at(&q->bodies, q->eye.position_m, (bst_vec3){0, 0, 0});
    return BST_OK;
}

/* Fills the header of the truth message: times, attitudes, observer. */
static void fill_header(const bst_field *field, const bst_field_scene *q, bst_truth *truth) {
    const bst_camera *camera = field->camera;
    truth->q_cam_from_gcrf_mid = field->q_mid;
    truth->q_cam_from_gcrf_mean = q->mean;
    truth->observer_gcrf_m = q->eye.position_m;
    truth->observer_gcrf_mps = q->eye.velocity_mps;
    truth->velocity_bary_mps = q->light.velocity_mps;
    truth->sun_m = q->light.sun_m;
    truth->pixel_scale_arcsec = camera->pixel_scale_arcsec;
    truth->boresight_x_px = bst_camera_centre_x(camera);
    truth->boresight_y_px = bst_camera_centre_y(camera);
    truth->background_e = bst_camera_background_e_per_s(camera) * q->exposure_s;
    truth->dark_e = bst_camera_dark_e(camera, q->exposure_s);
}

/* Part of the sensor whose light reaches the pixels of a window before they are read. */
static bst_window light_window(const bst_camera *camera, bst_window window) {
    if (bst_detector_config_whole_columns(&camera->detector)) {
        window.y0 = 0;
        window.height = (int)camera->height_px;
    }
    if (bst_detector_config_whole_sensor(&camera->detector)) {
        window.x0 = 0;
        window.width = (int)camera->width_px;
    }
    return window;
}

/* Computes the background of the exposure: bright bodies, sky and stars that are not rendered. */
static bst_status find_background(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                  bst_truth *truth) {
    const bst_camera *camera = field->camera;
    bst_window window = q->window;
    field->map = NULL;
    bst_scene_surroundings around = {.eye_m = q->eye.position_m,
                                     .eye_mps = q->eye.velocity_mps,
                                     .bodies = q->bodies,
                                     .itrf_from_gcrf = q->itrf_from_gcrf,
                                     .light = q->light,
                                     .exposure_s = q->exposure_s,
                                     .v_limit = q->v_limit,
                                     .faint_limit = q->faint_limit};
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        around.q[k] = bst_los_track_attitude(&q->own, q->exposure_s * k / BST_DISC_PARTS);
    }
    if (bodies_in_field(camera, &around, window, truth) || bst_skylight_varies(camera)) {
        bst_window lit = light_window(camera, window);
        BST_TRY(bst_skylight_make(ctx, field->skylight, &around, lit, &field->map));
        truth->background_e = bst_skylight_at(field->map, window.x0 + 0.5 * (window.width - 1),
                                              window.y0 + 0.5 * (window.height - 1));
    } else if (field->faint) {
        double pixel_sr = bst_camera_scale_rad(camera) * bst_camera_scale_rad(camera);
        truth->background_e += bst_faint_sky_undrawn(field->world->faint, q->near_cone.axis,
                                                     q->v_limit, q->faint_limit) *
                               pixel_sr * bst_camera_electrons_per_s(camera, 0.0) * q->exposure_s;
    }
    return BST_OK;
}

/* Collects the sources of a field query: stars, then objects. */
static bst_status find_sources(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                               int *count) {
    int star_count, near_count, ghost_near, n = 0, used = 0, stars;
    BST_TRY(bst_field_query_stars(ctx, field, q, &star_count));
    BST_TRY(bst_field_near_ghosts(ctx, field, q, &ghost_near));
    const bst_world_view_span span = {field->observer, q->start_s, q->end_s};
    BST_TRY(bst_world_view_near(ctx, field->view, &span, q->cone.axis, q->cone.radius, field->near,
                                &near_count));
    BST_TRY(bst_field_reserve_sources(ctx, field, star_count + near_count));
    for (int i = 0; i < star_count; i++) {
        n += bst_field_make_star(field, q, &field->stars[i], &field->sources[n]);
    }
    stars = n;
    BST_TRY(reserve_parts(ctx, field, near_count + ghost_near));
    const bst_scene_object_query objects = {.view = field->view,
                                            .camera = field->camera,
                                            .span = span,
                                            .q_mid = field->q_mid,
                                            .lit = q->lit,
                                            .window = q->window,
                                            .wider = q->wider,
                                            .margin_px = q->margin_px,
                                            .cone = q->cone,
                                            .near_cone = q->near_cone};
    for (int i = 0; i < near_count; i++) {
        bool there;
        if (bst_field_is_self(field, field->near[i])) {
            continue;
        }
        BST_TRY(bst_field_object(ctx, &objects, field->near[i], &field->parts[used],
                                 &field->sources[n], &there));
        n += there;
        used += there;
    }
    *count = n;
    BST_TRY(bst_star_occultation_apply(ctx, &field->hiding, field->sources, n));
    return bst_field_add_ghosts(ctx, field, q, stars, ghost_near, used, count);
}

bst_status bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_window window, const bst_field_options *options, bst_truth *truth,
                           const bst_scene_source **sources, int *count) {
    assert(field && track && track->count >= 2 && options && truth && sources && count);
    assert(start_tick <= end_tick && tick_rate_hz > 0 && bst_window_is_valid(&window));
    bst_field_scene q = {.start_s = (double)start_tick / (double)tick_rate_hz,
                         .end_s = (double)end_tick / (double)tick_rate_hz,
                         .window = window,
                         .lit = options->read_charge ? light_window(field->camera, window) : window,
                         .v_limit = options->v_limit,
                         .faint_limit = fmin(options->v_limit, field->world->faint_limit_v_mag),
                         .ghost_sigma = field->camera->ghost_images ? options->ghost_sigma : 0.0,
                         .image_margin_px = options->margin_px,
                         .binning = options->binning > 1 ? options->binning : 1};
    q.mid_s = 0.5 * (q.start_s + q.end_s);
    q.exposure_s = q.end_s - q.start_s;
    BST_TRY(settle_track(ctx, field, track, options, &q));
    BST_TRY(place_observer(ctx, field, &q));
    truth->start_tick = start_tick;
    truth->end_tick = end_tick;
    fill_header(field, &q, truth);
    q.cone = bst_field_find_cone(field, &q, q.lit);
    q.wider = memcmp(&q.lit, &window, sizeof window) != 0;
    q.near_cone = q.wider ? bst_field_find_cone(field, &q, window) : q.cone;
    BST_TRY(find_background(ctx, field, &q, truth));
    bst_field_limit_ghosts(field, &q, truth);
    BST_TRY(find_sources(ctx, field, &q, count));
    *sources = field->sources;
    return BST_OK;
}

const bst_skylight_map *bst_field_background(const bst_field *field) {
    return field->map;
}

double bst_field_background_e(const bst_field *field, const bst_truth *header, double x_px,
                              double y_px) {
    return field->map && isfinite(x_px) && isfinite(y_px) ? bst_skylight_at(field->map, x_px, y_px)
                                                          : header->background_e;
}
