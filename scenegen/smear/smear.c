#include "scenegen/smear/smear.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/kernels/deposit_shared.h"
#include "scenegen/reference.h"
#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_internal.h"
#include "scenegen/stamp/fixed_point_px.h"
#include "scenegen/stamp/profile_law.h"
#include "sim/core/invariant.h"

/* Shares of the tolerance: for the stamp border, and for a track shared by the stars. */
#define CUT_SHARE 0.3
#define SINGLE_SHARE 0.1

_Static_assert((int)BST_SMEAR_LEVELS <= (int)BST_MOTION_ERRORS,
               "a cell keeps an error of each level");

enum { MAX_TAPS = BST_PLACE_TAPS };

bst_status bst_smear_create(bst_ctx *ctx, const bst_camera *camera,
                            const bst_smear_options *options, bst_smear **out) {
    bst_smear *s = calloc(1, sizeof *s);
    *out = s;
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the smear of an exposure");
    }
    s->camera = *camera;
    s->options = *options;
    s->sigma_px =
        options->node_sigma_px > 0.0 ? options->node_sigma_px : bst_camera_psf_sigma_px(camera);
    s->widest = options->widest > 0.0 ? options->widest : BST_NODE_WIDEST;
    s->share_sigma_px = options->share_sigma_px > 0.0 ? options->share_sigma_px : s->sigma_px;
    bst_stamp_init(&s->stamp, s->sigma_px, options->node_sigma_px > 0.0);
    /* the error function misses 2.3e-7 per axis, for nodes near a pixel whose light is on average a
     * quarter of the peak */
    s->edge_error = 2.0 * 4.0 * 2.3e-7 / bst_reference_pixel_share(0.0, s->sigma_px, 0);
    s->edge_error = options->node_sigma_px > 0.0 ? 0.0 : s->edge_error;
    s->point_error = options->law_widest > 0.0 ? 2.0 * options->law_error : s->edge_error;
    for (int n = 0; n < BST_SMEAR_LEVELS; n++) {
        s->tolerance[n] = 0.08 * pow(2.0, -n);
    }
    s->stretch = bst_camera_stretch(camera);
    s->far_px = bst_fixed_point_px_far_px(camera);
    s->place_parts = ldexp(1.0, bst_fixed_point_px_bits(camera));
    s->half_diagonal_px =
        tan(bst_camera_half_diagonal_rad(camera)) / bst_camera_scale_rad(camera) * s->stretch;
    if (!camera->geometry.general) {
        s->half_diagonal_px =
            0.5 * hypot((double)camera->width_px + 2.0 * fabs(camera->boresight_offset_px[0]),
                        (double)camera->height_px + 2.0 * fabs(camera->boresight_offset_px[1]));
    }
    /* a tilt t moves the image at tangent R by (1 + R^2) t along the direction from the boresight;
     * the second-order remainder is R (1 + R^2) t^2 */
    double tangent = s->half_diagonal_px / s->stretch * bst_camera_scale_rad(camera);
    s->wide_field = 1.0 + tangent * tangent;
    s->curvature = 2.0 * tangent / s->wide_field * bst_camera_scale_rad(camera) +
                   camera->geometry.curvature * bst_camera_scale_rad(camera) / s->stretch;
    bst_status status = bst_motion_map_create(ctx, &s->map);
    if (status != BST_OK) {
        bst_smear_free(s);
        *out = NULL;
    }
    return status;
}

void bst_smear_free(bst_smear *s) {
    if (s) {
        free(s->path);
        free(s->own_path);
        free(s->turn);
        free(s->parts);
        free(s->nodes.items);
        free(s->points.items);
        bst_smear_bodies_clear(&s->bodies);
        free(s->table);
        bst_smear_free_ahead(s);
        bst_motion_map_free(s->map);
        for (int n = 0; n < BST_PIXEL_PARTS; n++) {
            free(s->binned[n]);
            free(s->gaussian_flanks[n]);
        }
        free(s);
    }
}

bst_status bst_smear_reserve(bst_ctx *ctx, void **items, int *capacity, int need, size_t bytes) {
    if (need <= *capacity) {
        return BST_OK;
    }
    int grown = need > 2 * *capacity ? need : 2 * *capacity;
    void *p = realloc(*items, (size_t)grown * bytes);
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of a smear", grown);
    }
    *items = p;
    *capacity = grown;
    return BST_OK;
}

/* Number of straight parts of the path from sample k to k + 1: the attitude rotates about one axis,
 * so its image is curved. */
static int parts_of(const bst_smear *s, int k) {
    const bst_quat *q = s->track.q_cam_from_gcrf;
    bst_quat d = bst_quat_mul(q[k + 1], bst_quat_conj(q[k]));
    if (d.x * d.x + d.y * d.y + d.z * d.z < 2.4e-7 * d.w * d.w) { /* less than 0.98e-3 */
        return 1;
    }
    bst_vec3 r = bst_quat_to_rotvec(d);
    double n = ceil(bst_vec3_norm(r) / 1e-3);
    return n > 64.0 ? 64 : n < 1.0 ? 1 : (int)n;
}

static bst_quat attitude_at(const bst_los_track *track, double time_s) {
    int k = 0;
    while (k + 2 < track->count && track->time_s[k + 1] < time_s) {
        k++;
    }
    double dt = track->time_s[k + 1] - track->time_s[k];
    double u = dt > 0.0 ? (time_s - track->time_s[k]) / dt : 0.0;
    return bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1], u);
}

/* Rotates a vector from camera axes to focal-plane axes (sign +1) or back (-1). */
static bst_vec3 turned(const bst_smear *s, bst_vec3 v, double sign) {
    if (!s->camera.geometry.general) {
        return v;
    }
    double cs = s->camera.geometry.cos_rotation, sn = sign * s->camera.geometry.sin_rotation;
    return (bst_vec3){cs * v.x + sn * v.y, cs * v.y - sn * v.x, v.z};
}

/* Rotation of the camera from the reference attitude as a path point, focal-plane axes: two tilts
 * in px of image motion where distortion stretches most, and roll in px at the sensor's corners. */
static bst_smear_path_point attitude_point(const bst_smear *s, bst_quat q, double time) {
    bst_vec3 r = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(s->q_reference)));
    r = turned(s, r, 1.0);
    double scale = 1.0 / bst_camera_scale_rad(&s->camera) * s->stretch;
    return (bst_smear_path_point){{r.x * scale, r.y * scale, r.z * s->half_diagonal_px}, time};
}

double bst_smear_largest_share(bst_smear *s, double *read_share) {
    double least = bst_camera_shrink(&s->camera) / s->stretch;
    for (int n = 0; n < s->nodes.count && least < 1.0; n++) {
        s->nodes.items[n].p[0] *= least;
        s->nodes.items[n].p[1] *= least;
    }
    double share = bst_smear_nodes_peak_share(s->nodes.items, s->nodes.count, s->share_sigma_px);
    *read_share = share;
    if (s->binning > 1) {
        double spread, own, pixel = bst_motion_pixel_share(s->share_sigma_px, s->binning, &spread);
        double wider = bst_motion_pixel_share(spread, 1, &own);
        *read_share =
            bst_smear_nodes_peak_share(s->nodes.items, s->nodes.count, spread) * pixel / wider;
    }
    return share;
}

void bst_smear_nodes_box(const bst_smear *s, double low[2], double high[2]) {
    for (int i = 0; i < 2; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
        for (int n = 0; n < s->nodes.count; n++) {
            low[i] = fmin(low[i], s->nodes.items[n].p[i] / s->stretch);
            high[i] = fmax(high[i], s->nodes.items[n].p[i] / s->stretch);
        }
    }
}

/* Chooses a shared track for the stars if requested, or accurate enough for the brightest. */
static void choose_motion(bst_smear *s, double brightest_e_per_s) {
    double scale = bst_camera_scale_rad(&s->camera), roll_px = s->half_diagonal_px;
    double half_turn_px = 1.0 / scale;
    bool small = true;
    s->single = false;
    if (s->options.motion == BST_STAR_MOTION_MULTI) {
        return;
    }
    s->spread_px =
        bst_motion_spread_px(s->path, s->path_count, scale, s->stretch, roll_px, roll_px);
    for (int k = 0; k < s->path_count; k++) {
        small &= hypot(s->path[k].p[0], s->path[k].p[1]) < half_turn_px;
    }
    double line = bst_reference_pixel_share(0.0, s->share_sigma_px, 0);
    double peak_e = brightest_e_per_s * s->duration_s * line * line * s->binning * s->binning;
    s->single = s->options.motion == BST_STAR_MOTION_SINGLE ||
                (small && bst_smear_single_error(s, peak_e, s->half_diagonal_px) <=
                              SINGLE_SHARE * s->options.tolerance_sigma);
    for (int k = 0; s->single && k < s->path_count; k++) {
        bst_motion_to_shift(&s->path[k], scale, s->stretch, roll_px);
    }
}

/* Measures the camera's rotation from the reference attitude. */
static void measure_turn(bst_smear *s) {
    double tilt2 = 0.0, roll = 0.0;
    for (int k = 0; k < s->path_count; k++) {
        const double *p = s->path[k].p;
        tilt2 = fmax(tilt2, p[0] * p[0] + p[1] * p[1]);
        roll = fmax(roll, fabs(p[2]));
    }
    s->tilt_rad = sqrt(tilt2) * bst_camera_scale_rad(&s->camera) / s->stretch;
    s->roll_rad = s->half_diagonal_px > 0.0 ? roll / s->half_diagonal_px : 0.0;
}

/* True if a star at (x, y) px from the boresight stays too far from the window to light it;
 * first-order estimate. */
static bool stays_beside(const bst_smear *s, double x, double y) {
    double scale = bst_camera_scale_rad(&s->camera), r = sqrt(x * x + y * y) * scale;
    if (s->camera.geometry.general || s->tilt_rad + s->roll_rad > 0.05 || r > 2.0) {
        return false;
    }
    double moved = 1.2 * (s->tilt_rad * (1.0 + r * r) + s->roll_rad * r) / scale;
    double far = moved + s->margin_px + 2.0;
    x += bst_camera_centre_x(&s->camera) - s->window.x0;
    y += bst_camera_centre_y(&s->camera) - s->window.y0;
    return x < -far || y < -far || x > s->window.width + far || y > s->window.height + far;
}

/* Starts the motion map with the nodes of the coarsest level, which were computed last. */
static bst_status begin_map(bst_ctx *ctx, bst_smear *s) {
    double tilt = s->tilt_rad / bst_camera_scale_rad(&s->camera) * s->wide_field;
    double from = s->half_diagonal_px / s->stretch;
    bst_motion_map_frame frame = {
        .nodes = s->nodes.items,
        .count = s->nodes.count,
        .table = s->table + (size_t)s->levels[0].first_block * BST_TABLE_FLOATS,
        .scale_rad = bst_camera_scale_rad(&s->camera),
        .tilt_px = s->stretch * s->wide_field,
        .roll_px = s->half_diagonal_px,
        .reach_px = fmin(from + tilt, 4.0 * s->far_px),
        .sensor_px = from + 6.0 * s->sigma_px,
        .binning = s->binning,
        .sources = s->sources,
        .shrink = bst_camera_shrink(&s->camera),
        .stretch = s->stretch,
        .sigma_px = s->share_sigma_px};
    return bst_motion_map_begin(ctx, s->map, &frame);
}

/* Samples of the track whose path points a thread makes at a time. */
enum { SAMPLES_AT_ONCE = 512 };

/* Makes the path points from the track's samples begin to end (callback). */
static void fill_path(void *user, int begin, int end) {
    bst_smear *s = user;
    const bst_los_track *track = &s->track;
    double inverse = s->duration_s > 0.0 ? 1.0 / s->duration_s : 0.0;
    int at = 0;
    for (int k = 0; k < begin; k++) {
        at += s->parts[k];
    }
    for (int k = begin; k < end; k++) {
        int parts = s->parts[k];
        for (int n = 0; n < parts + (k + 2 == track->count); n++, at++) {
            double u = (double)n / parts;
            const bst_quat *ends = &track->q_cam_from_gcrf[k];
            bst_quat q = n == 0 ? bst_quat_unit(ends[0]) : bst_quat_slerp(ends[0], ends[1], u);
            double t = track->time_s[k] + u * (track->time_s[k + 1] - track->time_s[k]);
            assert(at < s->path_count);
            s->turn[at] = q;
            s->path[at] = attitude_point(s, q, t * inverse);
        }
    }
}

bst_status bst_smear_begin(bst_ctx *ctx, bst_smear *s, const bst_smear_frame *frame) {
    assert(s && frame && frame->track && frame->track->count >= 2 && frame->sources >= 0);
    assert(bst_is_ascending(frame->track->time_s, frame->track->count));
    const bst_los_track *track = frame->track;
    s->track = *track;
    s->window = frame->window;
    s->margin_px = frame->margin_px;
    s->dark_variance_e2 = fmax(frame->dark_variance_e2, 1e-2);
    s->binning = frame->binning > 1 ? frame->binning : 1;
    int binned = s->binning < BST_PIXEL_PARTS ? s->binning : BST_PIXEL_PARTS;
    if (s->options.node_sigma_px > 0.0) {
        memcpy(s->pixel_part, s->options.pixel_part[binned - 1], sizeof s->pixel_part);
    } else if (s->parts_binning != s->binning) {
        bst_smear_find_pixel_parts(s->sigma_px, s->binning, s->pixel_part);
        s->parts_binning = s->binning;
    }
    BST_TRY(bst_smear_find_sensitivity(ctx, s));
    bst_smear_clear_ahead(s);
    s->sources = frame->sources;
    s->aim = frame->aim > 0.0 ? frame->aim : 1.0;
    s->grid_per_px = s->options.grid_per_px;
    s->frame++;
    s->duration_s = track->time_s[track->count - 1];
    s->q_reference = attitude_at(track, 0.5 * s->duration_s);
    s->table_blocks = s->path_count = s->rests_count = 0;
    s->travel_px = 0.0;
    for (int n = 0; n < BST_SMEAR_LEVELS; n++) {
        s->levels[n].blocks = 0;
    }
    BST_TRY(bst_smear_reserve(ctx, (void **)&s->parts, &s->parts_capacity, track->count,
                              sizeof *s->parts));
    for (int k = 0; k + 1 < track->count; k++) {
        s->parts[k] = parts_of(s, k);
        s->path_count += s->parts[k];
    }
    s->path_count++;
    BST_TRY(bst_smear_reserve(ctx, (void **)&s->path, &s->path_capacity, s->path_count,
                              sizeof *s->path));
    BST_TRY(bst_smear_reserve(ctx, (void **)&s->turn, &s->turn_capacity, s->path_count,
                              sizeof *s->turn));
    bst_parallel_for(s->options.pool, track->count - 1, SAMPLES_AT_ONCE, fill_path, s);
    for (int k = 0; k < s->path_count; k++) {
        const double *p = s->path[k].p;
        s->travel_px = fmax(s->travel_px, fabs(p[0]) + fabs(p[1]) + fabs(p[2]));
    }
    measure_turn(s);
    choose_motion(s, frame->brightest_e_per_s);
    for (int k = 0; k < s->path_count && !s->single; k++) {
        s->path[k].p[0] *= s->wide_field;
        s->path[k].p[1] *= s->wide_field;
    }
    BST_TRY(bst_smear_make_level(ctx, s, 0));
    if (!s->single) {
        BST_TRY(begin_map(ctx, s));
    } else {
        bst_smear_nodes_box(s, s->low, s->high);
        s->star_share = bst_smear_largest_share(s, &s->read_share);
    }
    bst_smear_begin_ahead(s, frame);
    return BST_OK;
}

void bst_smear_restart(bst_smear *s, double aim) {
    assert(s && aim > 0.0 && isfinite(aim)); /* above 1 where nodes are limited */
    s->aim = aim;
    s->table_blocks = s->levels[0].first_block + s->levels[0].blocks;
    for (int n = 1; n < BST_SMEAR_LEVELS; n++) {
        s->levels[n].blocks = 0;
    }
}

void bst_smear_refine_grid(bst_smear *s, double per_px) {
    assert(s && per_px > 0.0);
    s->grid_per_px = per_px;
}

/* Error bound of a level for stars of a cell (NULL: of all stars), cached in the cell. */
static double star_error(const bst_smear *s, int n, bst_smear_star_motion_cell *cell) {
    if (!cell) {
        return bst_smear_level_error(&s->levels[n], 1.0);
    }
    if (cell->error[n] >= 0.0) {
        return cell->error[n];
    }
    double error = bst_smear_level_error(&s->levels[n], cell->scale);
    if (!s->fixed) {
        cell->error[n] = error;
    }
    return error;
}

/* Predicted error, as star_error. */
static double star_prediction(const bst_smear *s, int n, bst_smear_star_motion_cell *cell) {
    if (s->levels[n].alike) {
        return star_error(s, n, cell);
    }
    if (!cell) {
        return bst_smear_level_prediction(&s->levels[n], 1.0);
    }
    if (cell->predicted[n] >= 0.0) {
        return cell->predicted[n];
    }
    double predicted = bst_smear_level_prediction(&s->levels[n], cell->scale);
    if (!s->fixed) {
        cell->predicted[n] = predicted;
    }
    return predicted;
}

/* Chooses the coarsest level whose error bound keeps the tolerance for a star, starting from the
 * tolerance's level. */
static bst_status star_level(bst_ctx *ctx, bst_smear *s, bst_smear_star_motion_cell *cell,
                             const bst_smear_level **out, double *error, double *predicted) {
    double allowed = NODE_SHARE * bst_smear_allowed(s, s->last_read_e);
    int n = bst_smear_first_level(s, cell ? cell->scale : 1.0, allowed);
    BST_TRY(bst_smear_make_level(ctx, s, n));
    *error = star_error(s, n, cell);
    while (n + 1 < BST_SMEAR_LEVELS && s->options.temporal_oversample <= 0 && *error > allowed) {
        BST_TRY(bst_smear_make_level(ctx, s, ++n));
        *error = star_error(s, n, cell);
    }
    *predicted = star_prediction(s, n, cell);
    *out = &s->levels[n];
    return BST_OK;
}

static int choose_radius(const bst_smear *s, double peak_e) {
    double limit = CUT_SHARE * s->aim * s->options.tolerance_sigma * sqrt(s->dark_variance_e2);
    int most = s->options.taps / 2 - 1, asked = s->options.stamp_radius_px;
    return asked > 0 ? (asked < most ? asked : most)
                     : bst_stamp_radius(&s->stamp, peak_e, limit, most);
}

/* Radius of the latest source's stamp; nodes of a ghost are wider than the PSF. */
static int radius_of(const bst_smear *s, const bst_scene_source *source) {
    int radius = choose_radius(s, s->last_peak_e * s->binning);
    if (!source->ghost) {
        return radius;
    }
    double wide = radius * sqrt(1.0 + s->last_widening_px2 / (s->sigma_px * s->sigma_px));
    return (int)fmin(ceil(wide), s->options.taps / 2 - 1);
}

bool bst_smear_project(const bst_smear *s, const bst_scene_source *source, bst_quat q, bst_vec3 v,
                       double *x, double *y) {
    bst_vec3 c = bst_scene_source_seen(&s->camera, source, bst_quat_rotate(q, v));
    if (s->camera.geometry.general) {
        c = turned(s, c, 1.0);
        double f = 1.0 / (bst_camera_scale_rad(&s->camera) * c.z);
        *x = c.x * f;
        *y = c.y * f;
        return c.z > 0.0 && fabs(*x) < 1e6 && fabs(*y) < 1e6;
    }
    if (!bst_camera_project(&s->camera, c, x, y)) {
        return false;
    }
    *x -= bst_camera_centre_x(&s->camera);
    *y -= bst_camera_centre_y(&s->camera);
    return fabs(*x) < 1e6 && fabs(*y) < 1e6;
}

bool bst_smear_place_source(const bst_smear *s, const bst_scene_source *source,
                            bst_smear_place *out) {
    double electrons = source->electrons_per_s * s->duration_s, x, y;
    bool moving = source->path || source->rate || source->shape || source->body || source->ghost;
    double disc_px = bst_smear_radius_px(s, source);
    bool front = bst_smear_project(s, source, s->q_reference, source->apparent_mid, &x, &y);
    /* a star that only a wide rotation brings into the field: a float offset is inaccurate */
    double wide = 4.0 * (s->far_px + disc_px);
    moving = moving || !front || x * x + y * y > wide * wide;
    if (moving) { /* nodes are stored as small floats relative to a position on the sensor */
        double far = s->far_px;
        x = front ? fmin(fmax(x, -far), far) : 0.0;
        y = front ? fmin(fmax(y, -far), far) : 0.0;
    }
    *out = (bst_smear_place){
        .x = x, .y = y, .electrons = electrons, .disc_px = disc_px, .moving = moving};
    return !source->occulted && electrons > 0.0 && electrons < 1e30 && (front || moving);
}

/* Nodes of a moving source, in the table: those computed ahead, if there are any. *lit: false if it
 * has none. */
static bst_status moving_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                               const bst_smear_place *at, bst_smear_level *out, bool *lit) {
    bool taken;
    if (s->fixed) {
        return BST_ERR_STATE; /* seen by bst_smear_sources alone */
    }
    BST_TRY(bst_smear_take_ahead(ctx, s, source, out, &taken));
    if (!taken) {
        BST_TRY(bst_smear_moving_nodes(ctx, s, source, at->electrons, at->x, at->y));
    }
    *lit = s->nodes.count > 0;
    return taken || !*lit ? BST_OK : bst_smear_append_nodes(ctx, s, true, out);
}

bst_status bst_smear_source(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                            bst_kernel_source_record *out, bool *visible) {
    bst_smear_place at;
    s->last_peak_e = s->last_read_e = s->chord_error = s->body_sigma = 0.0;
    s->last_leaves = true;
    *visible = bst_smear_place_source(s, source, &at);
    s->disc_px = at.disc_px;
    if (!*visible) {
        return BST_OK;
    }
    double x = at.x, y = at.y, electrons = at.electrons;
    const bool moving = at.moving;
    bst_smear_star_motion_cell *cell = NULL;
    double low[2] = {s->low[0], s->low[1]}, high[2] = {s->high[0], s->high[1]};
    if (!moving) {
        double share = s->star_share, read_share = s->read_share;
        if (!s->single) {
            cell = bst_motion_map_at(s->map, x, y);
            share = cell->share;
            read_share = cell->read_share;
            memcpy(low, cell->low, sizeof low);
            memcpy(high, cell->high, sizeof high);
        }
        s->last_peak_e = electrons * share;
        s->last_read_e = electrons * read_share;
        *visible = !stays_beside(s, x, y);
        if (!*visible) {
            return BST_OK;
        }
    }
    bst_smear_level own;
    const bst_smear_level *used;
    double travel_px = s->travel_px, error, predicted;
    if (moving) {
        BST_TRY(moving_nodes(ctx, s, source, &at, &own, visible));
        if (!*visible) {
            return BST_OK;
        }
        travel_px = 0.0;
        for (int n = 0; n < s->nodes.count; n++) {
            const double *p = s->nodes.items[n].p;
            travel_px = fmax(travel_px, fabs(p[0]) + fabs(p[1]));
        }
        bst_smear_nodes_box(s, low, high);
        used = &own;
        error = bst_smear_level_error(used, 1.0);
        predicted = bst_smear_level_prediction(used, 1.0);
    } else {
        BST_TRY(star_level(ctx, s, cell, &used, &error, &predicted));
    }
    s->last_widening_px2 = used->widening_px2;
    bst_smear_drawn drawn = {.x = x,
                             .y = y,
                             .travel_px = travel_px,
                             .error = error,
                             .predicted = predicted,
                             .level = used,
                             .scale = cell ? cell->scale : 1.0,
                             .radius = radius_of(s, source),
                             .moving = moving};
    memcpy(drawn.low, low, sizeof low);
    memcpy(drawn.high, high, sizeof high);
    bst_smear_set_error(s, &drawn);
    bst_smear_bring_to_window(s, &drawn);
    /* light beyond the stamp is added to it, so that flux is conserved */
    electrons /= s->stamp.kept[drawn.radius] * s->stamp.kept[drawn.radius];
    *out = (bst_kernel_source_record){
        .x_px = (float)x,
        .y_px = (float)y,
        .place_x = (int)lrint((x + bst_camera_centre_x(&s->camera)) * s->place_parts),
        .place_y = (int)lrint((y + bst_camera_centre_y(&s->camera)) * s->place_parts),
        .electrons = (float)electrons,
        .first_table = used->first_block,
        .blocks = used->blocks,
        .radius = drawn.radius};
    return BST_OK;
}

bool bst_smear_single(const bst_smear *s) {
    return s->single;
}

double bst_smear_last_peak_e(const bst_smear *s) {
    return s->last_peak_e;
}

double bst_smear_last_read_e(const bst_smear *s) {
    return s->last_read_e;
}

double bst_smear_last_presence(const bst_smear *s) {
    return s->last_presence;
}

double bst_smear_last_widening_px2(const bst_smear *s) {
    return s->last_widening_px2;
}

bool bst_smear_last_leaves(const bst_smear *s) {
    return s->last_leaves;
}

const bst_error_budget_source *bst_smear_last_error(const bst_smear *s) {
    return &s->last_error;
}

bst_error_budget_motion bst_smear_motion(const bst_smear *s) {
    bst_error_budget_motion motion = bst_error_budget_motion_of(s->path, s->path_count, s->single);
    motion.sigma_px = s->sigma_px;
    motion.dark_variance_e2 = s->dark_variance_e2;
    return motion;
}

const float *bst_smear_table(const bst_smear *s, int *blocks) {
    *blocks = s->table_blocks;
    return s->table;
}
