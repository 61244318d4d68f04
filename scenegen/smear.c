#include "scenegen/smear.h"

#include <math.h>
#include <stdlib.h>

#include "scenegen/motion.h"
#include "scenegen/nodes.h"
#include "scenegen/place.h"
#include "scenegen/reference.h"
#include "scenegen/shape.h"
#include "scenegen/stamp.h"

/* Shares of the tolerance: for nodes, for the border of the stamp, and for a track that stars
 * share. */
#define NODE_SHARE 0.8
#define CUT_SHARE 0.3
#define SINGLE_SHARE 0.1

/* Fidelities: level n is right to about 0.08 * 2^-n of the smeared image's peak. */
enum { LEVELS = 14, TABLE_FLOATS = BST_TABLE_ROWS * BST_BLOCK, MAX_TAPS = BST_PLACE_TAPS };

typedef struct level {
    int first_block, blocks; /* blocks 0: not made in this frame */
    double error;            /* expected, of the smeared image's peak */
} level;

struct bst_smear {
    bst_camera camera;
    bst_smear_options options;
    double sigma_px, share_sigma_px, widest;
    bst_stamp stamp;
    double tolerance[LEVELS];
    double half_diagonal_px;
    double stretch;             /* of the image by distortion where it is greatest */
    double far_px, place_parts; /* see place.h */

    bst_los_track track;
    double dark_variance_e2, duration_s;
    bst_quat q_reference;
    double star_share; /* largest share of a star's light on one pixel */
    double travel_px;  /* largest distance of a node from its source's place */
    bool single;       /* stars share one track */
    double spread_px;  /* by which stars in the corners move otherwise */
    double last_peak_e;
    bst_crowd_source last_error;
    level levels[LEVELS];

    bst_path_point *path, *own_path;
    int path_count, path_capacity, own_capacity;
    bst_node_list nodes;    /* scratch */
    bst_disc_points points; /* scratch */
    double disc_px;         /* radius of the present source's disc; 0: a point */
    float *table;
    int table_blocks, table_capacity;
};

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
    for (int n = 0; n < LEVELS; n++) {
        s->tolerance[n] = 0.08 * pow(2.0, -n);
    }
    s->stretch = bst_camera_stretch(camera);
    s->far_px = bst_place_far_px(camera);
    s->place_parts = ldexp(1.0, bst_place_bits(camera));
    s->half_diagonal_px =
        tan(bst_camera_half_diagonal_rad(camera)) / bst_camera_scale_rad(camera) * s->stretch;
    if (!camera->geometry.general) {
        s->half_diagonal_px = 0.5 * hypot((double)camera->width_px, (double)camera->height_px);
    }
    return BST_OK;
}

void bst_smear_free(bst_smear *s) {
    if (s) {
        free(s->path);
        free(s->own_path);
        free(s->nodes.items);
        free(s->points.items);
        free(s->table);
        free(s);
    }
}

static bst_status reserve(bst_ctx *ctx, void **items, int *capacity, int need, size_t bytes) {
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

/* Into how many straight parts the path from sample k to k + 1 goes: the attitude turns about one
 * axis, the image of it bends. */
static int parts_of(const bst_smear *s, int k) {
    const bst_quat *q = s->track.q_cam_from_gcrf;
    bst_vec3 r = bst_quat_to_rotvec(bst_quat_mul(q[k + 1], bst_quat_conj(q[k])));
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

/* Turns a vector from camera axes to those of the focal plane (sign +1) or back (-1). */
static bst_vec3 turned(const bst_smear *s, bst_vec3 v, double sign) {
    if (!s->camera.geometry.general) {
        return v;
    }
    double cs = s->camera.geometry.cos_rotation, sn = sign * s->camera.geometry.sin_rotation;
    return (bst_vec3){cs * v.x + sn * v.y, cs * v.y - sn * v.x, v.z};
}

/* The camera's turn from the reference attitude as a path point, in the focal plane's axes: two
 * tilts in pixels of image motion where the distortion stretches most, and roll by what it moves in
 * the sensor's corners. */
static bst_path_point attitude_point(const bst_smear *s, bst_quat q, double time) {
    bst_vec3 r = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(s->q_reference)));
    r = turned(s, r, 1.0);
    double scale = 1.0 / bst_camera_scale_rad(&s->camera) * s->stretch;
    return (bst_path_point){{r.x * scale, r.y * scale, r.z * s->half_diagonal_px}, time};
}

/* What the profile table misses of the nodes' image, over its peak, by its phases and widths. */
static double table_error(const bst_smear *s, const bst_node_list *list) {
    double psf = s->sigma_px * s->stretch, worst = 0.0;
    for (int n = 0; n < list->count; n++) {
        double w = list->items[n].variance / (psf * psf), wide = 1.0 + w;
        worst = fmax(worst, 0.75 * w / (wide * wide));
    }
    return s->options.table_error + worst / (BST_WIDTHS * BST_WIDTHS);
}

/* Appends nodes to the table in whole blocks; to_table fills one column of BST_TABLE_ROWS. */
static bst_status append_nodes(bst_ctx *ctx, bst_smear *s, const bst_node_list *list,
                               void (*to_table)(const bst_smear *, const bst_node *, float *),
                               level *out) {
    int blocks = (list->count + BST_BLOCK - 1) / BST_BLOCK;
    BST_TRY(reserve(ctx, (void **)&s->table, &s->table_capacity, s->table_blocks + blocks,
                    TABLE_FLOATS * sizeof(float)));
    *out = (level){s->table_blocks, blocks, list->error + table_error(s, list)};
    s->table_blocks += blocks;
    for (int n = 0; n < blocks * BST_BLOCK; n++) {
        float *block = s->table + (size_t)(out->first_block + n / BST_BLOCK) * TABLE_FLOATS;
        /* the last block is filled up with dark copies of the last node */
        to_table(s, &list->items[n < list->count ? n : list->count - 1], block + n % BST_BLOCK);
        if (n >= list->count) {
            block[9 * BST_BLOCK + n % BST_BLOCK] = 0.0f;
        }
    }
    return BST_OK;
}

/* A node's widening in PSF variances, before the distortion stretches it. */
static double widening(const bst_smear *s, const bst_node *node) {
    double psf = s->sigma_px * s->stretch;
    return node->variance / (psf * psf);
}

/* Node of the camera's turn: v_node = M v_reference as a map of the undistorted tangent plane, in
 * pixels and the focal plane's axes,
 * x' - x = ((m00 - m22) x + m01 y + m02 / a - x d) / (d + m22), d = a (m20 x + m21 y). */
static void attitude_to_table(const bst_smear *s, const bst_node *node, float *t) {
    double a = bst_camera_scale_rad(&s->camera), tilt = a / s->stretch;
    bst_quat q = bst_quat_from_rotvec(
        (bst_vec3){node->p[0] * tilt, node->p[1] * tilt, node->p[2] / s->half_diagonal_px});
    bst_mat3 m = bst_quat_to_mat3(q);
    double rows[BST_TABLE_ROWS] = {
        m.m[0][0] - m.m[2][2], m.m[0][1],     m.m[0][2] / a, m.m[1][0], m.m[1][1] - m.m[2][2],
        m.m[1][2] / a,         m.m[2][0] * a, m.m[2][1] * a, m.m[2][2], node->weight,
        widening(s, node)};
    for (int i = 0; i < BST_TABLE_ROWS; i++) {
        t[i * BST_BLOCK] = (float)rows[i];
    }
}

/* Node of an own path: a shift of the image. */
static void shift_to_table(const bst_smear *s, const bst_node *node, float *t) {
    double x = node->p[0] / s->stretch, y = node->p[1] / s->stretch;
    double rows[BST_TABLE_ROWS] = {0, 0, x, 0, 0, y, 0, 0, 1.0, node->weight, widening(s, node)};
    for (int i = 0; i < BST_TABLE_ROWS; i++) {
        t[i * BST_BLOCK] = (float)rows[i];
    }
}

/* Largest share of light on one pixel over the scratch nodes, where the distortion stretches the
 * image least. Spoils their places. */
static double largest_share(bst_smear *s) {
    double least = bst_camera_shrink(&s->camera) / s->stretch;
    for (int n = 0; n < s->nodes.count && least < 1.0; n++) {
        s->nodes.items[n].p[0] *= least;
        s->nodes.items[n].p[1] *= least;
    }
    return bst_nodes_peak_share(s->nodes.items, s->nodes.count, s->share_sigma_px);
}

/* Adds nodes of a path that takes `part` of the exposure. */
static bst_status path_nodes(bst_ctx *ctx, bst_smear *s, const bst_path_point *path, int count,
                             double part, double tolerance) {
    double parts = ceil(part * s->options.temporal_oversample - 1e-9);
    if (parts > 0.0) {
        return bst_motion_midpoints(ctx, path, count, (int)parts, &s->nodes);
    }
    return bst_nodes_from_path(ctx, path, count, s->sigma_px, tolerance, s->widest, &s->nodes);
}

static bst_status make_level(bst_ctx *ctx, bst_smear *s, int n) {
    if (s->levels[n].blocks == 0) {
        s->nodes.count = 0;
        s->nodes.error = 0.0;
        BST_TRY(path_nodes(ctx, s, s->path, s->path_count, 1.0, s->tolerance[n]));
        BST_TRY(append_nodes(ctx, s, &s->nodes, s->single ? shift_to_table : attitude_to_table,
                             &s->levels[n]));
    }
    return BST_OK;
}

/* Error of a star `from_boresight_px` away that follows the boresight's track, in sigma of its
 * worst pixel: a Gaussian of amplitude A on dark noise d changes by at most 0.86 / sigma of A /
 * sqrt(A + d^2) per px of shift, and by all of its light when it lies elsewhere. */
static double single_error(const bst_smear *s, double peak_e, double from_boresight_px) {
    double part = s->half_diagonal_px > 0.0 ? from_boresight_px / s->half_diagonal_px : 0.0;
    double moved = s->spread_px * part * fmax(part, 1.0) * s->stretch;
    return fmin(0.86 * moved / s->sigma_px * peak_e / sqrt(peak_e + s->dark_variance_e2),
                peak_e / sqrt(s->dark_variance_e2));
}

/* Lets the stars share one track where that is asked for, or good enough for the brightest. */
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
    double peak_e = brightest_e_per_s * s->duration_s * line * line;
    s->single = s->options.motion == BST_STAR_MOTION_SINGLE ||
                (small && single_error(s, peak_e, s->half_diagonal_px) <=
                              SINGLE_SHARE * s->options.tolerance_sigma);
    for (int k = 0; s->single && k < s->path_count; k++) {
        bst_motion_to_shift(&s->path[k], scale, s->stretch, roll_px);
    }
}

bst_status bst_smear_begin(bst_ctx *ctx, bst_smear *s, const bst_los_track *track,
                           double dark_variance_e2, double brightest_e_per_s) {
    s->track = *track;
    s->dark_variance_e2 = fmax(dark_variance_e2, 1e-2);
    s->duration_s = track->time_s[track->count - 1];
    s->q_reference = attitude_at(track, 0.5 * s->duration_s);
    s->table_blocks = s->path_count = 0;
    s->travel_px = 0.0;
    for (int n = 0; n < LEVELS; n++) {
        s->levels[n].blocks = 0;
    }
    double inverse = s->duration_s > 0.0 ? 1.0 / s->duration_s : 0.0;
    for (int k = 0; k + 1 < track->count; k++) {
        int parts = parts_of(s, k);
        BST_TRY(reserve(ctx, (void **)&s->path, &s->path_capacity, s->path_count + parts + 1,
                        sizeof *s->path));
        for (int n = 0; n < parts + (k + 2 == track->count); n++) {
            double u = (double)n / parts;
            bst_quat q =
                bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1], u);
            double t = track->time_s[k] + u * (track->time_s[k + 1] - track->time_s[k]);
            bst_path_point *p = &s->path[s->path_count++];
            *p = attitude_point(s, q, t * inverse);
            s->travel_px = fmax(s->travel_px, fabs(p->p[0]) + fabs(p->p[1]) + fabs(p->p[2]));
        }
    }
    choose_motion(s, brightest_e_per_s);
    BST_TRY(make_level(ctx, s, 0));
    s->star_share = largest_share(s);
    return BST_OK;
}

/* The coarsest level whose predicted error is within the aim. */
static int choose_level(bst_smear *s, double peak_e) {
    double sigmas = peak_e / sqrt(peak_e + s->dark_variance_e2);
    int n = 0;
    if (s->options.temporal_oversample > 0) {
        return n;
    }
    while (n + 1 < LEVELS && (s->tolerance[n] + s->options.table_error) * sigmas >
                                 NODE_SHARE * s->options.tolerance_sigma) {
        n++;
    }
    return n;
}

static int choose_radius(const bst_smear *s, double peak_e) {
    double limit = CUT_SHARE * s->options.tolerance_sigma * sqrt(s->dark_variance_e2);
    int most = s->options.taps / 2 - 1, asked = s->options.stamp_radius_px;
    return asked > 0 ? (asked < most ? asked : most)
                     : bst_stamp_radius(&s->stamp, peak_e, limit, most);
}

/* Place on the focal plane from the boresight, px, without the distortion, which the kernel adds;
 * false when it is not in front of the camera or far away. */
static bool project(const bst_smear *s, bst_quat q, bst_vec3 v, double *x, double *y) {
    bst_vec3 c = bst_quat_rotate(q, v);
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

/* Light further than this from the boresight (px, without distortion) stays off the sensor: the
 * PSF's table ends before. */
static double far_px(const bst_smear *s) {
    return s->far_px + s->disc_px;
}

/* How many chords the curved motion over the image wants: of a parabola they miss
 * (its bend) / chords^2. Seen at 17 instants; those that are off the sensor do not count, but a
 * chord must not step over it. */
static double chords_of(const bst_smear *s, const bst_source *source) {
    enum { N = 16 };
    double x[N + 1], y[N + 1], far = far_px(s), chords = 0.0;
    bool front[N + 1];
    for (int k = 0; k <= N; k++) {
        front[k] =
            project(s, s->q_reference, bst_source_direction(source, (double)k / N), &x[k], &y[k]);
    }
    for (int k = 0; k < N; k++) {
        if (!front[k] || !front[k + 1]) {
            continue;
        }
        bool near = fmin(hypot(x[k], y[k]), hypot(x[k + 1], y[k + 1])) < far ||
                    x[k] * x[k + 1] < 0.0 || y[k] * y[k + 1] < 0.0;
        double step = hypot(x[k + 1] - x[k], y[k + 1] - y[k]);
        chords = fmax(chords, near ? N * step / far : 0.0);
        if (near && k > 0 && front[k - 1]) {
            double bend = hypot(x[k - 1] - 2.0 * x[k] + x[k + 1], y[k - 1] - 2.0 * y[k] + y[k + 1]);
            chords = fmax(chords, N * sqrt(0.125 * bend * s->stretch / 0.002));
        }
    }
    return fmin(chords, 1e4);
}

/* Neither end nor anything between is near the sensor. */
static bool passes_by(const bst_smear *s, const bst_path_point *a, const bst_path_point *b,
                      double x0, double y0, double far) {
    double f = 1.0 / s->stretch;
    double ax = a->p[0] * f + x0, ay = a->p[1] * f + y0, bx = b->p[0] * f + x0,
           by = b->p[1] * f + y0;
    return fmin(ax, bx) > far || fmax(ax, bx) < -far || fmin(ay, by) > far || fmax(ay, by) < -far;
}

/* A moving source's path over the image, relative to (x0, y0); NAN where the source is not in front
 * of the camera. */
static bst_status own_path(bst_ctx *ctx, bst_smear *s, const bst_source *source, double x0,
                           double y0, int *count) {
    const bst_los_track *track = &s->track;
    double per_s = s->duration_s > 0.0 ? 1.0 / s->duration_s : 0.0;
    int chords = (int)chords_of(s, source) / (track->count - 1) + 1;
    *count = 0;
    for (int k = 0; k + 1 < track->count; k++) {
        double begin = track->time_s[k] * per_s, end = track->time_s[k + 1] * per_s, to;
        int all = parts_of(s, k);
        all = all < chords ? chords : all;
        for (double from = begin; from < end || from == begin; from = to) {
            int parts;
            to = bst_motion_stretch(source, from, end, &parts);
            double share = end > begin ? (to - from) / (end - begin) : 1.0;
            int least = (int)ceil(all * share - 1e-9);
            parts = parts < least ? least : parts;
            bool last = k + 2 == track->count && !(to < end);
            BST_TRY(reserve(ctx, (void **)&s->own_path, &s->own_capacity, *count + parts + 1,
                            sizeof *s->own_path));
            for (int n = 0; n < parts + last; n++) {
                double x, y, t = from + (to - from) * n / parts;
                double u = end > begin ? (t - begin) / (end - begin) : (double)n / parts;
                bst_quat q =
                    bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1], u);
                bool front = project(s, q, bst_source_direction(source, t), &x, &y);
                s->own_path[(*count)++] = (bst_path_point){
                    {front ? (x - x0) * s->stretch : NAN, front ? (y - y0) * s->stretch : NAN, 0.0},
                    bst_source_light(source, t)};
            }
            if (!(to > from)) {
                break; /* no time */
            }
        }
    }
    return BST_OK;
}

/* Nodes of the stretches of own_path[count] that may put light on the sensor; their weights are
 * shares of the whole exposure. */
static bst_status own_nodes(bst_ctx *ctx, bst_smear *s, int count, double x0, double y0,
                            double tolerance) {
    const bst_path_point *p = s->own_path;
    double far = far_px(s), total = p[count - 1].s - p[0].s;
    s->nodes.count = 0;
    s->nodes.error = 0.0;
    for (int first = 0, last; first + 1 < count; first = last > first ? last : first + 1) {
        last = first;
        while (last + 1 < count && !isnan(p[last].p[0]) && !isnan(p[last + 1].p[0]) &&
               !passes_by(s, &p[last], &p[last + 1], x0, y0, far)) {
            last++;
        }
        if (last > first) {
            int n = s->nodes.count;
            double part = total > 0.0 ? (p[last].s - p[first].s) / total : 1.0;
            BST_TRY(path_nodes(ctx, s, p + first, last - first + 1, part, tolerance));
            for (; n < s->nodes.count && part < 1.0; n++) {
                s->nodes.items[n].weight *= part;
            }
        }
    }
    return BST_OK;
}

/* Makes the points of a disc; the scratch nodes are those of its middle about (x, y). *peak: share
 * of the light on one pixel at most, without the smear. */
static bst_status shape_points(bst_ctx *ctx, bst_smear *s, const bst_source *source, double x,
                               double y, double *peak) {
    enum { MOST_NODES = 2000000 };
    double x0 = x, y0 = y, low[2] = {0.0, 0.0}, high[2] = {0.0, 0.0};
    (void)project(s, s->q_reference, source->apparent_mid, &x0, &y0);
    for (int n = 0; n < s->nodes.count; n++) {
        double way[2] = {s->nodes.items[n].p[0] / s->stretch + x - x0,
                         s->nodes.items[n].p[1] / s->stretch + y - y0};
        for (int i = 0; i < 2; i++) {
            low[i] = n == 0 ? way[i] : fmin(low[i], way[i]);
            high[i] = n == 0 ? way[i] : fmax(high[i], way[i]);
        }
    }
    double cx = bst_camera_centre_x(&s->camera), cy = bst_camera_centre_y(&s->camera);
    double margin = 0.5 * s->options.taps + 2.0, all = far_px(s) - s->disc_px;
    bool general = s->camera.geometry.general;
    double turn = general ? asin(s->camera.geometry.sin_rotation) : 0.0;
    if (general && s->camera.geometry.cos_rotation < 0.0) {
        turn = BST_PI - turn;
    }
    bst_quat focal = bst_quat_from_rotvec((bst_vec3){0.0, 0.0, turn});
    bst_shape_view view = {
        .q_focal_from_gcrf = general ? bst_quat_mul(focal, s->q_reference) : s->q_reference,
        .scale_rad = bst_camera_scale_rad(&s->camera),
        .edge_x_px = -cx - 0.5,
        .edge_y_px = -cy - 0.5,
        .sigma_px = s->sigma_px,
        .min_x_px = (general ? -all : -cx - margin) - high[0],
        .max_x_px = (general ? all : (double)s->camera.width_px - cx + margin) - low[0],
        .min_y_px = (general ? -all : -cy - margin) - high[1],
        .max_y_px = (general ? all : (double)s->camera.height_px - cy + margin) - low[1],
        .most_points = MOST_NODES / (s->nodes.count > 0 ? s->nodes.count : 1)};
    return bst_shape_points(ctx, source, &view, &s->points, peak);
}

bst_status bst_smear_source(bst_ctx *ctx, bst_smear *s, const bst_source *source,
                            bst_scene_source *out, bool *visible) {
    double x, y, electrons = source->electrons_per_s * s->duration_s;
    s->last_peak_e = 0.0;
    bool moving = source->path || source->rate || source->shape;
    s->disc_px =
        source->shape ? tan(asin(source->shape->radius)) / bst_camera_scale_rad(&s->camera) : 0.0;
    bool front = project(s, s->q_reference, source->apparent_mid, &x, &y);
    /* a star that only a wide turn brings into the field is no small float from its place there */
    moving = moving || !front || hypot(x, y) > 4.0 * far_px(s);
    *visible = !source->occulted && electrons > 0.0 && electrons < 1e30 && (front || moving);
    if (!*visible) {
        return BST_OK;
    }
    level own;
    const level *used;
    double travel_px = s->travel_px;
    if (moving) {
        /* nodes are kept as small floats relative to a place on the sensor */
        double far = s->far_px;
        x = front ? fmin(fmax(x, -far), far) : 0.0;
        y = front ? fmin(fmax(y, -far), far) : 0.0;
        int count;
        BST_TRY(own_path(ctx, s, source, x, y, &count));
        BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[0]));
        if (s->nodes.count == 0) {
            *visible = false;
            return BST_OK;
        }
        double share = largest_share(s), peak;
        if (source->shape) {
            BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[0]));
            BST_TRY(shape_points(ctx, s, source, x, y, &peak));
            share = fmin(share, peak);
        }
        s->last_peak_e = electrons * share;
        BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[choose_level(s, s->last_peak_e)]));
        if (source->shape) {
            BST_TRY(bst_shape_spread(ctx, &s->points, s->stretch, &s->nodes));
        }
        if (s->nodes.count == 0) {
            *visible = false;
            return BST_OK;
        }
        travel_px = 0.0;
        for (int n = 0; n < s->nodes.count; n++) {
            const double *p = s->nodes.items[n].p;
            travel_px = fmax(travel_px, fabs(p[0]) + fabs(p[1]));
        }
        BST_TRY(append_nodes(ctx, s, &s->nodes, shift_to_table, &own));
        used = &own;
    } else {
        s->last_peak_e = electrons * s->star_share;
        int n = choose_level(s, s->last_peak_e);
        BST_TRY(make_level(ctx, s, n));
        used = &s->levels[n];
    }
    int radius = choose_radius(s, s->last_peak_e);
    double lost = bst_stamp_excess(&s->stamp, radius);
    int border = radius + 1 < MAX_TAPS / 2 ? radius + 1 : radius;
    /* places in parts of a pixel, the way to the node in float, and some additions of light */
    double parts = s->place_parts;
    double rounded = 0.86 / s->sigma_px * (1.0 / parts + 0x1p-24 * travel_px) + 0x1p-22;
    double shared = s->single && !moving ? single_error(s, s->last_peak_e, hypot(x, y)) : 0.0;
    double sigma_e = sqrt(s->last_peak_e + s->dark_variance_e2);
    s->last_error = (bst_crowd_source){.x_px = (float)x,
                                       .y_px = (float)y,
                                       .peak_e = (float)s->last_peak_e,
                                       .nodes_e = (float)((used->error + rounded) * s->last_peak_e),
                                       .shared_e = (float)(shared * sigma_e),
                                       .excess_e = (float)(lost * s->last_peak_e),
                                       .border_e = (float)(s->last_peak_e * s->stamp.tail[border]),
                                       .apart = moving && travel_px > s->travel_px};
    /* what the stamp leaves out is put on the stamp, so that no light is lost */
    electrons /= s->stamp.kept[radius] * s->stamp.kept[radius];
    *out = (bst_scene_source){.x_px = (float)x,
                              .y_px = (float)y,
                              .place_x = (int)lrint((x + bst_camera_centre_x(&s->camera)) * parts),
                              .place_y = (int)lrint((y + bst_camera_centre_y(&s->camera)) * parts),
                              .electrons = (float)electrons,
                              .first_table = used->first_block,
                              .blocks = used->blocks,
                              .radius = radius};
    return BST_OK;
}

bool bst_smear_single(const bst_smear *s) {
    return s->single;
}

double bst_smear_last_peak_e(const bst_smear *s) {
    return s->last_peak_e;
}

const bst_crowd_source *bst_smear_last_error(const bst_smear *s) {
    return &s->last_error;
}

bst_crowd_motion bst_smear_motion(const bst_smear *s) {
    bst_crowd_motion motion = bst_crowd_motion_of(s->path, s->path_count, s->single);
    motion.sigma_px = s->sigma_px;
    motion.dark_variance_e2 = s->dark_variance_e2;
    return motion;
}

const float *bst_smear_table(const bst_smear *s, int *blocks) {
    *blocks = s->table_blocks;
    return s->table;
}
