/* Attitude and motion of each frame from its stars. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/compare.h"
#include "sim/process/process_internal.h"

/* Frames without an attitude after which the other order of rows is tried. */
enum { TRIES = 3 };
/* Catalogue stars of a frame that have room. */
enum { PREDICTED = 4096 };

/* The solver with its database, for all frames. */
typedef struct solver {
    bst_camera camera;
    bst_stars *stars;
    bst_star_patterns *patterns;
    bst_lost_in_space *lost;
    bst_predicted_stars sky;
    bst_plate_solve_result result;
} solver;

static void close_solver(solver *s) {
    bst_lost_in_space_free(s->lost);
    bst_predicted_stars_free(&s->sky);
    bst_star_patterns_free(s->patterns);
    bst_stars_close(s->stars);
}

double bst_process_julian_year(const bst_process_frame *f) {
    return bst_time_julian_year(f->values.start);
}

static double v_limit_of(const bst_process *p) {
    return p->request->v_limit > 0.0 ? p->request->v_limit : p->map.star_limit_v_mag;
}

static bst_status open_solver(bst_ctx *ctx, const bst_process *p, solver *s) {
    int least = p->width < p->height ? p->width : p->height;
    s->camera = (bst_camera){
        .width_px = p->width, .height_px = p->height, .pixel_scale_arcsec = p->scale_arcsec};
    BST_TRY(bst_camera_prepare(ctx, &s->camera));
    BST_TRY(bst_stars_open(ctx, p->request->catalogue, &s->stars));
    double year = bst_process_julian_year(&p->frames[0]);
    const bst_star_patterns_options options = {
        2.0 * atan(0.5 * least * bst_camera_scale_rad(&s->camera)), v_limit_of(p), year};
    BST_TRY(bst_star_patterns_create(ctx, s->stars, &options, &s->patterns));
    BST_TRY(bst_predicted_stars_create(ctx, &s->camera, s->stars, year, PREDICTED, &s->sky));
    return bst_lost_in_space_create(ctx, &s->camera, s->stars, s->patterns, year,
                                    BST_PLATE_SOLVE_STARS, &s->lost);
}

bst_light bst_process_light(const bst_process_frame *f) {
    bst_bodies bodies;
    bst_vec3 position, velocity;
    bst_process_observer(f, &position, &velocity);
    bst_bodies_at(bst_time_add(f->values.start, 0.5 * f->values.exposure_s), &bodies);
    return bst_light_at(&bodies, position, velocity);
}

/* The header's attitude is one of catalogue places: moves the boresight to its apparent place. */
static void aberrate_header(bst_process_frame *f, const bst_light *light) {
    bst_vec3 b = bst_quat_rotate(bst_quat_conj(f->q_header), (bst_vec3){0, 0, 1});
    bst_vec3 turn = bst_vec3_cross(b, bst_light_apparent_star(light, b));
    /* the camera turns with the sky's frame: q_cam_from_gcrf of the turned axes */
    f->q_header =
        bst_quat_unit(bst_quat_mul(f->q_header, bst_quat_from_rotvec(bst_vec3_scale(turn, -1.0))));
}

/* Rotation that moves the image of a star from the frame's middle to a place. */
static bst_quat rotation_to(double x_rad, double y_rad) {
    bst_vec3 v = bst_vec3_unit((bst_vec3){x_rad, y_rad, 1.0});
    bst_vec3 axis = bst_vec3_cross((bst_vec3){0, 0, 1}, v);
    double s = bst_vec3_norm(axis);
    return s > 0.0 ? bst_quat_from_rotvec(bst_vec3_scale(axis, atan2(s, v.z) / s))
                   : BST_QUAT_IDENTITY;
}

/* Attitudes along the path of the streaks, from its left end to its right one. */
static bst_status set_nodes(bst_ctx *ctx, const solver *s, bst_process_frame *f) {
    const bst_star_path *path = &s->result.path;
    double px = bst_camera_scale_rad(&s->camera) * f->scale, done = 0.0, total = 0.0;
    int every = 1 + (path->count - 1) / (BST_PROCESS_NODES - 2);
    f->nodes = calloc(BST_PROCESS_NODES + 2, sizeof *f->nodes);
    if (!f->nodes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the path of a frame");
    }
    for (int k = 0; k < path->count; k++) {
        total += path->light[k];
    }
    f->nodes[f->node_count++] = (bst_process_node){
        0.0, bst_quat_mul(rotation_to(px * path->ends[0][0], px * path->ends[0][1]), f->q_middle)};
    for (int k = 0; k < path->count; k++) {
        double share = (done + 0.5 * path->light[k]) / total;
        if (k % every == every / 2 && k > 0 && k < path->count - 1) {
            f->nodes[f->node_count++] = (bst_process_node){
                share, bst_quat_mul(rotation_to(px * path->place[k][0], px * path->place[k][1]),
                                    f->q_middle)};
        }
        done += path->light[k];
    }
    f->nodes[f->node_count++] = (bst_process_node){
        1.0, bst_quat_mul(rotation_to(px * path->ends[1][0], px * path->ends[1][1]), f->q_middle)};
    return BST_OK;
}

/* Solves one frame. */
static bst_status solve_frame(bst_ctx *ctx, bst_process *p, solver *s, bst_process_frame *f) {
    bst_recorded_frame r;
    const float *pixels;
    BST_TRY(bst_recorded_frames_select(ctx, p->recorded, f->index, &p->options, &r));
    BST_TRY(bst_recorded_frames_pixels(ctx, p->recorded, &p->options, &r, &pixels));
    const bst_light light = bst_process_light(f);
    const bst_plate_solve_options options = {.scale_tolerance = p->request->scale_tolerance,
                                             .v_limit = v_limit_of(p),
                                             .least_snr = p->request->least_snr,
                                             .tangent_per_px = bst_camera_scale_rad(&s->camera),
                                             .light = &light};
    BST_TRY(bst_plate_solve(ctx, s->lost, &options, pixels, r.width, r.height, &s->result));
    const bst_lost_in_space_result *a = &s->result.attitude;
    f->found = s->result.stars;
    f->solved = a->solved;
    if (!f->solved) {
        return BST_OK;
    }
    f->points = s->result.points;
    f->q_middle = a->q_cam_from_gcrf;
    f->scale = a->scale;
    f->rms_px = a->rms_px;
    f->matched = a->matched;
    f->predicted = a->predicted;
    if (!f->points) {
        const bst_common_streak_point *e = s->result.ends;
        f->streak_px = hypot(e[1].x_px - e[0].x_px, e[1].y_px - e[0].y_px);
        BST_TRY(set_nodes(ctx, s, f));
    }
    p->solved++;
    return bst_process_zero_point(ctx, &s->sky, &light, &s->result, v_limit_of(p), f);
}

/* Solves all frames in one order of rows; ends early if none of the first is solved. */
static bst_status solve_all(bst_ctx *ctx, bst_process *p, solver *s, bool may_end) {
    for (int i = 0; i < p->count; i++) {
        if (bst_stop_requested()) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
        }
        BST_TRY(solve_frame(ctx, p, s, &p->frames[i]));
        if (may_end && p->solved == 0 && i + 1 == TRIES) {
            return BST_OK;
        }
    }
    return BST_OK;
}

/* Takes the median pixel scale and zero point of the solved frames. */
static bst_status take_medians(bst_ctx *ctx, bst_process *p) {
    double *scales = malloc((size_t)p->count * sizeof *scales);
    int n = 0;
    if (!scales) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d pixel scales", p->count);
    }
    for (int i = 0; i < p->count; i++) {
        if (p->frames[i].solved) {
            scales[n++] = p->frames[i].scale;
        }
    }
    qsort(scales, (size_t)n, sizeof *scales, bst_compare_doubles);
    p->scale_arcsec *= n > 0 ? scales[n / 2] : 1.0;
    n = 0;
    for (int i = 0; i < p->count; i++) {
        if (p->frames[i].solved && isfinite(p->frames[i].zero_point_mag)) {
            scales[n++] = p->frames[i].zero_point_mag;
        }
    }
    qsort(scales, (size_t)n, sizeof *scales, bst_compare_doubles);
    p->zero_point_mag = n > 0 ? scales[n / 2] : NAN;
    free(scales);
    return BST_OK;
}

/* Orders the nodes of a frame so that the camera turns as it does to the next or from the previous
 * solved frame; false: there is no other. */
static bool orient(const bst_process *p, int i) {
    bst_process_frame *f = &p->frames[i];
    int other = -1;
    for (int k = 1; k < p->count && other < 0; k++) {
        other = i + k < p->count && p->frames[i + k].solved ? i + k
                : i - k >= 0 && p->frames[i - k].solved     ? i - k
                                                            : -1;
    }
    if (f->node_count < 2) {
        return true;
    }
    if (other < 0) {
        return bst_process_orient_by_rates(f);
    }
    bst_vec3 own =
        bst_process_turn(f->nodes[0].q_cam_from_gcrf, f->nodes[f->node_count - 1].q_cam_from_gcrf);
    bst_vec3 way = bst_process_turn(f->q_middle, p->frames[other].q_middle);
    if (bst_vec3_dot(own, way) * (other > i ? 1.0 : -1.0) < 0.0) {
        bst_process_reverse(f);
    }
    return true;
}

bst_status bst_process_solve(bst_ctx *ctx, bst_process *p) {
    solver s = {.stars = NULL};
    bool automatic = p->request->flip == BST_PROCESS_FLIP_AUTO;
    bst_status status = open_solver(ctx, p, &s);
    if (status == BST_OK) {
        status = solve_all(ctx, p, &s, automatic && p->count > TRIES);
    }
    if (status == BST_OK && automatic && p->solved == 0) {
        p->options.flip_rows = true;
        status = solve_all(ctx, p, &s, p->count > TRIES);
        p->options.flip_rows = p->solved > 0;
        if (status == BST_OK && p->solved == 0 && p->count > TRIES) {
            status = solve_all(ctx, p, &s, false);
        }
    }
    close_solver(&s);
    if (status != BST_OK) {
        return status;
    }
    p->direction_known = true;
    for (int i = 0; i < p->count; i++) {
        bst_process_frame *f = &p->frames[i];
        /* the headers were read for the order of rows in the files */
        bool same = p->map.attitude != BST_KEYWORD_WCS ||
                    p->options.flip_rows == (p->request->flip == BST_PROCESS_FLIP_YES);
        f->has_header_attitude = f->has_header_attitude && same;
        /* a quaternion is of the camera, the others are of catalogue places */
        if (f->has_header_attitude && p->map.attitude != BST_KEYWORD_QUATERNION) {
            const bst_light light = bst_process_light(f);
            aberrate_header(f, &light);
        }
        p->direction_known = orient(p, i) && p->direction_known;
    }
    return take_medians(ctx, p);
}
