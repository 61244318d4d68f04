#include <math.h>

#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_internal.h"
#include "scenegen/stamp/fixed_point_px.h"

/* Distance from the boresight, px without distortion, beyond which a source gives the sensor no
 * light. */
static double far_px(const bst_smear *s) {
    return s->far_px + s->disc_px;
}

/* Largest distance of a path from its chords, px, and its lower limit by rounding of positions. */
#define CHORD_PX 2e-3
#define LEAST_CHORD_PX 1e-6
/* Share of the tolerance for chords. A parabola is on average two thirds of the largest distance
 * from its chord, and a Gaussian changes by 0.607 / sigma of its peak per px. */
#define CHORD_SHARE 0.05
#define CHORD_ERROR (0.607 * 2.0 / 3.0)
/* Share of the tolerance for the points of a ghost with a size. */
#define GHOST_SHARE 0.5

/* Number of chords of a curved image path for a deviation of at most miss_px: a parabola deviates
 * by its bend / chords^2. It is sampled at 17 times; positions off the sensor do not count, but a
 * chord must not step over it. */
static double chords_of(const bst_smear *s, const bst_scene_source *source, double miss_px) {
    enum { N = 16 };
    double x[N + 1], y[N + 1], far = far_px(s), chords = 0.0;
    bool front[N + 1];
    for (int k = 0; k <= N; k++) {
        front[k] =
            bst_smear_project(s, source, s->q_reference,
                              bst_scene_source_direction(source, (double)k / N), &x[k], &y[k]);
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
            chords = fmax(chords, N * sqrt(0.125 * bend * s->stretch / miss_px));
        }
    }
    return fmin(chords, 1e4);
}

/* True if a path segment stays away from the sensor. */
static bool passes_by(const bst_smear *s, const bst_smear_path_point *a,
                      const bst_smear_path_point *b, double x0, double y0, double far) {
    double f = 1.0 / s->stretch;
    double ax = a->p[0] * f + x0, ay = a->p[1] * f + y0, bx = b->p[0] * f + x0,
           by = b->p[1] * f + y0;
    return fmin(ax, bx) > far || fmax(ax, bx) < -far || fmin(ay, by) > far || fmax(ay, by) < -far;
}

/* The same from each track sample to the next. */
static int chords_per_sample(const bst_smear *s, const bst_scene_source *source, double miss_px) {
    return (int)chords_of(s, source, miss_px) / (s->track.count - 1) + 1;
}

/* Image path of a moving source, of at least `chords` from sample to sample, relative to (x0, y0);
 * NAN where it is behind the camera. */
static bst_status own_path(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source, int chords,
                           double x0, double y0, int *count) {
    const bst_los_track *track = &s->track;
    const bst_quat *turn = s->turn;
    *count = s->rests_count = 0;
    for (int k = 0; k + 1 < track->count; turn += s->parts[k++]) {
        double begin_s = track->time_s[k], length_s = track->time_s[k + 1] - begin_s;
        int all = s->parts[k] < chords ? chords : s->parts[k];
        for (double from = 0.0, to; from < 1.0;
             from = to) { /* fractions of the interval between samples */
            int parts;
            to = bst_motion_stretch(source, begin_s, length_s, s->duration_s, from, &parts);
            int least = (int)ceil(all * (to - from) - 1e-9);
            parts = parts < least ? least : parts;
            bool last = k + 2 == track->count && !(to < 1.0);
            BST_TRY(bst_smear_reserve(ctx, (void **)&s->own_path, &s->own_capacity,
                                      *count + parts + 1, sizeof *s->own_path));
            for (int n = 0; n < parts + last; n++) {
                double u = from + (to - from) * n / parts, x, y;
                double t = begin_s + u * length_s;
                t = s->duration_s > 0.0 ? t / s->duration_s : 0.0;
                bool known = parts == s->parts[k] && to - from == 1.0;
                bst_quat q = known ? turn[n]
                                   : bst_quat_slerp(track->q_cam_from_gcrf[k],
                                                    track->q_cam_from_gcrf[k + 1], u);
                bool front =
                    bst_smear_project(s, source, q, bst_scene_source_direction(source, t), &x, &y);
                s->own_path[(*count)++] = (bst_smear_path_point){
                    {front ? (x - x0) * s->stretch : NAN, front ? (y - y0) * s->stretch : NAN, 0.0},
                    bst_scene_source_light(source, t)};
            }
        }
    }
    return BST_OK;
}

/* Nodes of the parts of own_path[count] that may light the sensor; weights are shares of the whole
 * exposure. */
static bst_status own_nodes(bst_ctx *ctx, bst_smear *s, int count, double x0, double y0,
                            double tolerance) {
    const bst_smear_path_point *p = s->own_path;
    double far = far_px(s), total = p[count - 1].s - p[0].s;
    bst_smear_nodes_clear(&s->nodes);
    for (int first = 0, last; first + 1 < count; first = last > first ? last : first + 1) {
        last = first;
        while (last + 1 < count && !isnan(p[last].p[0]) && !isnan(p[last + 1].p[0]) &&
               !passes_by(s, &p[last], &p[last + 1], x0, y0, far)) {
            last++;
        }
        if (last > first) {
            int n = s->nodes.count;
            double part = total > 0.0 ? (p[last].s - p[first].s) / total : 1.0;
            BST_TRY(
                bst_smear_path_nodes(ctx, s, p + first, last - first + 1, part, false, tolerance));
            for (; n < s->nodes.count && part < 1.0; n++) {
                s->nodes.items[n].weight *= part;
            }
        }
    }
    return BST_OK;
}

bst_quat bst_smear_focal_turn(const bst_smear *s) {
    bool general = s->camera.geometry.general;
    double turn = general ? asin(s->camera.geometry.sin_rotation) : 0.0;
    if (general && s->camera.geometry.cos_rotation < 0.0) {
        turn = BST_PI - turn;
    }
    return bst_quat_from_rotvec((bst_vec3){0.0, 0.0, turn});
}

bst_status bst_smear_centre_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                  double x, double y, double tolerance) {
    int count;
    BST_TRY(own_path(ctx, s, source, chords_per_sample(s, source, CHORD_PX), x, y, &count));
    return own_nodes(ctx, s, count, x, y, tolerance);
}

/* Computes a disc's points; the work list holds the nodes of its centre about (x, y). *peak: upper
 * bound of the light share in one pixel, without smear. */
static bst_status shape_points(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source, double x,
                               double y, double *peak) {
    enum { MOST_NODES = 2000000 };
    double x0 = x, y0 = y, low[2] = {0.0, 0.0}, high[2] = {0.0, 0.0};
    (void)bst_smear_project(s, source, s->q_reference, source->apparent_mid, &x0, &y0);
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
    bst_quat focal = bst_smear_focal_turn(s);
    bst_extended_source_view view = {
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
    return bst_extended_source_points(ctx, source, &view, &s->points, peak);
}

/* Most nodes of a ghost with a size. */
enum { GHOST_NODES = 2000000 };

/* Replaces the nodes of a ghost's centre by those of its image, and adds its error. */
static bst_status spread_ghost(bst_ctx *ctx, bst_smear *s, const bst_ghost *ghost) {
    double error;
    const bst_ghost_points_aim aim = {
        .sigma_px = s->sigma_px,
        .widest = s->widest,
        .allowed = GHOST_SHARE * bst_smear_allowed(s, s->last_read_e),
        .most_points = GHOST_NODES / (s->nodes.count > 0 ? s->nodes.count : 1) + 1};
    BST_TRY(bst_ghost_points(ctx, ghost, &aim, &s->points, &error));
    s->chord_error += error;
    return bst_extended_source_spread(ctx, &s->points, s->stretch, &s->nodes);
}

bst_status bst_smear_moving_nodes(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                  double electrons, double x, double y) {
    int count;
    bool there = false;
    if (source->body) {
        BST_TRY(bst_smear_body_nodes(ctx, s, source, x, y, &there));
    }
    if (there) {
        return BST_OK;
    }
    const int chords = chords_per_sample(s, source, CHORD_PX);
    BST_TRY(own_path(ctx, s, source, chords, x, y, &count));
    BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[0]));
    if (s->nodes.count == 0) {
        return BST_OK;
    }
    double read_share, share = bst_smear_largest_share(s, &read_share), peak;
    if (source->shape) {
        BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[0]));
        BST_TRY(shape_points(ctx, s, source, x, y, &peak));
        share = fmin(share, peak);
        read_share = fmin(read_share, peak * s->binning * s->binning);
    }
    bool wide = source->ghost && bst_ghost_reach_px(source->ghost) > 0.0;
    if (wide) {
        peak = bst_ghost_peak_share(source->ghost);
        share = fmin(share, peak);
        read_share = fmin(read_share, peak * s->binning * s->binning);
    }
    s->last_peak_e = electrons * share;
    s->last_read_e = electrons * read_share;
    double miss_px = bst_smear_allowed(s, s->last_read_e) * CHORD_SHARE * s->sigma_px / CHORD_ERROR;
    miss_px = fmin(fmax(miss_px, LEAST_CHORD_PX), CHORD_PX);
    if (source->path && miss_px < CHORD_PX) {
        const int finer = chords_per_sample(s, source, miss_px);
        BST_TRY(finer > chords ? own_path(ctx, s, source, finer, x, y, &count) : BST_OK);
    }
    s->chord_error = source->path ? CHORD_ERROR * miss_px / s->sigma_px : 0.0;
    int level = bst_smear_choose_level(s, 1.0);
    BST_TRY(own_nodes(ctx, s, count, x, y, s->tolerance[level]));
    if (wide && s->nodes.count > 0) {
        return spread_ghost(ctx, s, source->ghost);
    }
    return source->shape ? bst_extended_source_spread(ctx, &s->points, s->stretch, &s->nodes)
                         : BST_OK;
}
