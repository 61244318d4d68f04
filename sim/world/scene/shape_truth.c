#include "sim/world/scene/shape_truth.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/world/scene/body_limb.h"

void bst_shape_truth_free(bst_shape_truth *work) {
    for (int i = 0; i < BST_TRUTH_SHAPES; i++) {
        bst_satellite_pose_free(work->poses[i]);
        bst_resolved_free(work->images[i]);
    }
    free(work->points);
    free(work->hull);
    bst_shape_light_free(&work->light);
    *work = (bst_shape_truth){0};
}

/* Slot of a model's pose and image, in place of another one if there is no room. */
static bst_status slot_of(bst_ctx *ctx, bst_shape_truth *work, const bst_satellite *satellite,
                          int *slot) {
    *slot = BST_TRUTH_SHAPES - 1;
    for (int i = BST_TRUTH_SHAPES - 1; i >= 0; i--) {
        if (work->images[i] && work->poses[i]->satellite == satellite) {
            *slot = i;
            return BST_OK;
        }
        *slot = work->images[i] ? *slot : i;
    }
    bst_satellite_pose_free(work->poses[*slot]);
    bst_resolved_free(work->images[*slot]);
    work->poses[*slot] = NULL;
    work->images[*slot] = NULL;
    BST_TRY(bst_satellite_pose_create(ctx, satellite, &work->poses[*slot]));
    return bst_resolved_create(ctx, satellite, &work->images[*slot]);
}

static bst_status reserve(bst_ctx *ctx, bst_shape_truth *work, int count) {
    if (count <= work->capacity) {
        return BST_OK;
    }
    free(work->points);
    free(work->hull);
    work->points = malloc((size_t)count * sizeof *work->points);
    work->hull = malloc(2 * (size_t)count * sizeof *work->hull);
    work->capacity = work->points && work->hull ? count : 0;
    return work->capacity > 0 ? BST_OK
                              : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d corners", count);
}

/* Largest distance of two corners. */
static double largest_extent(const bst_point2 *hull, int count) {
    double largest = 0.0;
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < i; k++) {
            largest = fmax(largest, hypot(hull[i].x - hull[k].x, hull[i].y - hull[k].y));
        }
    }
    return largest;
}

/* A body at mid-exposure, and the camera. */
typedef struct placed_body {
    const bst_camera *camera;
    bst_quat q_cam_from_gcrf;
    const bst_scene_source *source;
    bst_source_body_state state;
    bst_earthlight earthlight;
    bst_resolved_hidden hidden; /* by the Earth */
} placed_body;

/* Least and largest places of points along directions. */
enum { DIRECTIONS = 64 };
typedef struct extents {
    bst_point2 along[DIRECTIONS]; /* of length 1 */
    double least[DIRECTIONS], most[DIRECTIONS];
} extents;

/* Adds what the Earth leaves of a convex part to box and extents. `corners`: [count] places in the
 * image without distortion, px from the boresight. */
static void add_visible(const placed_body *placed, bst_polygon_clip *clip,
                        const bst_point2 *corners, int count, extents *e, bst_truth_shape *out) {
    double scale_rad = bst_camera_scale_rad(placed->camera);
    bst_polygon_clip_start(clip, corners, count);
    bst_polygon_clip_subtract(clip, placed->hidden.corner, placed->hidden.count, false);
    for (int i = 0; i < clip->piece_count; i++) {
        for (int k = 0; k < clip->pieces[i].count; k++) {
            bst_point2 p = clip->points[clip->pieces[i].first + k];
            const bst_vec3 v = {p.x * scale_rad, p.y * scale_rad, 1.0};
            if (!bst_camera_project(placed->camera, v, &p.x, &p.y)) {
                continue;
            }
            out->x0_px = fmin(out->x0_px, p.x);
            out->y0_px = fmin(out->y0_px, p.y);
            out->x1_px = fmax(out->x1_px, p.x);
            out->y1_px = fmax(out->y1_px, p.y);
            for (int d = 0; d < DIRECTIONS; d++) {
                double at = p.x * e->along[d].x + p.y * e->along[d].y;
                e->least[d] = fmin(e->least[d], at);
                e->most[d] = fmax(e->most[d], at);
            }
        }
    }
}

/* Box and extent of what the Earth leaves in sight of the body, by its convex parts. The extent is
 * right to 1 - cos(pi / (2 DIRECTIONS)). */
static void project_visible(bst_shape_truth *work, const placed_body *placed,
                            bst_satellite_pose *pose, bst_truth_shape *out) {
    const bst_satellite *sat = pose->satellite;
    const bst_source_body_state *body = &placed->state;
    bst_vec3 centre = bst_vec3_scale(body->apparent, body->range_m);
    bst_quat back = bst_quat_conj(body->q_body_from_gcrf);
    double per = 1.0 / bst_camera_scale_rad(placed->camera);
    extents e;
    for (int d = 0; d < DIRECTIONS; d++) {
        e.along[d] = (bst_point2){cos(BST_PI * d / DIRECTIONS), sin(BST_PI * d / DIRECTIONS)};
        e.least[d] = INFINITY;
        e.most[d] = -INFINITY;
    }
    out->x0_px = out->y0_px = INFINITY;
    out->x1_px = out->y1_px = -INFINITY;
    for (int o = 0; o < sat->occluder_count; o++) {
        const bst_occluder *part = &sat->occluders[o];
        for (int i = 0; i < part->vertex_count; i++) {
            bst_vec3 v = bst_quat_rotate(back, pose->vertices[part->first_vertex + i]);
            v = bst_quat_rotate(placed->q_cam_from_gcrf, bst_vec3_add(centre, v));
            work->points[i] = (bst_point2){per * v.x / v.z, per * v.y / v.z};
        }
        int count = bst_polygon_hull(work->points, part->vertex_count, work->hull);
        if (count > 0 && count <= BST_POLYGON_CORNERS_MAX) {
            add_visible(placed, &pose->clip, work->hull, count, &e, out);
        }
    }
    out->size_px = 0.0;
    for (int d = 0; d < DIRECTIONS; d++) {
        out->size_px = fmax(out->size_px, e.most[d] - e.least[d]);
    }
    if (!(out->x0_px <= out->x1_px)) { /* nothing is left */
        out->x0_px = out->y0_px = out->x1_px = out->y1_px = out->size_px = NAN;
    }
}

/* Projects the body: centre of mass, box and extent. */
static void project(bst_shape_truth *work, const placed_body *placed, bst_satellite_pose *pose,
                    bst_truth_shape *out) {
    const bst_camera *camera = placed->camera;
    const bst_source_body_state *body = &placed->state;
    bst_quat q_cam_from_gcrf = placed->q_cam_from_gcrf;
    bst_vec3 centre = bst_vec3_scale(body->apparent, body->range_m);
    bst_quat back = bst_quat_conj(body->q_body_from_gcrf);
    int count = pose->satellite->vertex_count;
    *out = (bst_truth_shape){.x_px = NAN,
                             .y_px = NAN,
                             .x0_px = INFINITY,
                             .y0_px = INFINITY,
                             .x1_px = -INFINITY,
                             .y1_px = -INFINITY,
                             .visible = 1.0,
                             .q_body_from_gcrf = body->q_body_from_gcrf};
    (void)bst_camera_project(camera, bst_quat_rotate(q_cam_from_gcrf, body->apparent), &out->x_px,
                             &out->y_px);
    for (int i = 0; i < count; i++) {
        bst_vec3 v = bst_vec3_add(centre, bst_quat_rotate(back, pose->vertices[i]));
        bst_point2 *p = &work->points[i];
        if (!bst_camera_project(camera, bst_quat_rotate(q_cam_from_gcrf, v), &p->x, &p->y)) {
            out->x0_px = out->y0_px = out->x1_px = out->y1_px = out->size_px = NAN;
            return;
        }
        out->x0_px = fmin(out->x0_px, p->x);
        out->y0_px = fmin(out->y0_px, p->y);
        out->x1_px = fmax(out->x1_px, p->x);
        out->y1_px = fmax(out->y1_px, p->y);
    }
    out->size_px = largest_extent(work->hull, bst_polygon_hull(work->points, count, work->hull));
    if (placed->hidden.count > 0) {
        project_visible(work, placed, pose, out);
    }
}

/* Cells across the image of a body: a sixteenth of a pixel, within limits. */
static double cells_across(double across_px) {
    enum { FEWEST = 32, MOST = 256 };
    return fmin(fmax(16.0 * across_px, FEWEST), MOST);
}

/* Area of the cells of an image that the body covers. */
static double covered(const bst_resolved_image *m) {
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)m->width * (size_t)m->height; i++) {
        sum += (double)m->cells[i].cover;
    }
    return sum;
}

/* Measures a body's light: centroid, width, and how its image differs from a point's. */
static bst_status find_light(bst_ctx *ctx, bst_shape_truth *work, const placed_body *placed,
                             bst_satellite_pose *pose, bst_resolved *resolved,
                             bst_truth_shape *out) {
    const bst_source_body_state *body = &placed->state;
    bst_quat q = placed->q_cam_from_gcrf;
    const bst_resolved_view view = {
        .q_image_from_body = bst_quat_mul(q, bst_quat_conj(body->q_body_from_gcrf)),
        .origin_m = bst_vec3_scale(bst_quat_rotate(q, body->apparent), body->range_m),
        .scale_rad = bst_camera_scale_rad(placed->camera),
        .hidden = placed->hidden.count > 0 ? &placed->hidden : NULL};
    const bst_resolved_light light = {.sun = body->aim.sun,
                                      .sun_radius_rad = body->sun_radius_rad,
                                      .earthlight = body->earth ? &placed->earthlight : NULL,
                                      .gain = placed->source->body->gain};
    bst_shape_light_figures figures;
    double low[2], high[2];
    out->snr_ratio = out->filter_ratio = out->peak_ratio = 1.0;
    if (!bst_resolved_box(pose, &view, low, high)) {
        return BST_OK;
    }
    double across = fmax(fmax(high[0] - low[0], high[1] - low[1]), 1e-6);
    double cell_px = across / cells_across(across), all, seen, cover = 0.0;
    if (view.hidden) {
        bst_resolved_view whole = view;
        whole.hidden = NULL;
        BST_TRY(bst_resolved_begin(ctx, resolved, low, high, cell_px));
        BST_TRY(bst_resolved_add(ctx, resolved, pose, &whole, &light, 1.0, &all));
        cover = covered(bst_resolved_image_of(resolved));
    }
    BST_TRY(bst_resolved_begin(ctx, resolved, low, high, cell_px));
    BST_TRY(bst_resolved_add(ctx, resolved, pose, &view, &light, 1.0, &seen));
    if (view.hidden) {
        double share = all > 0.0   ? seen / all
                       : cover > 0 ? covered(bst_resolved_image_of(resolved)) / cover
                                   : 0.0;
        out->visible = fmin(share, 1.0);
    }
    double sigma_px = sqrt(pow(bst_camera_psf_sigma_px(placed->camera), 2.0) + 1.0 / 12.0);
    BST_TRY(bst_shape_light_measure(ctx, &work->light, bst_resolved_image_of(resolved), sigma_px,
                                    &figures));
    if (figures.light > 0.0) {
        const bst_vec3 direction = {figures.x_px * view.scale_rad, figures.y_px * view.scale_rad,
                                    1.0};
        (void)bst_camera_project(placed->camera, direction, &out->x_light_px, &out->y_light_px);
    }
    out->light_xx_px2 = figures.xx;
    out->light_xy_px2 = figures.xy;
    out->light_yy_px2 = figures.yy;
    out->snr_ratio = figures.snr_ratio;
    out->filter_ratio = figures.filter_ratio;
    out->peak_ratio = figures.peak_ratio;
    return BST_OK;
}

/* Checks whether the Earth hides all of a body. */
static bool nothing_left(const bst_truth_shape *shape) {
    const double LIGHT_ROUNDING = 1e-6;
    return shape->visible < LIGHT_ROUNDING && isnan(shape->x0_px);
}

/* A body without a row of its own: in sight or not as a point is. */
static void hide_whole(const bst_scene_source *source, bst_truth_item *item) {
    if (bst_body_limb_behind(source, 0.5) > 0.0) {
        item->electrons = item->snr = 0.0;
        item->flags |= BST_TRUTH_OCCULTED;
    }
}

bst_status bst_shape_truth_fill(bst_ctx *ctx, bst_shape_truth *work, const bst_camera *camera,
                                const bst_scene_source *sources, const int *source_of,
                                bst_truth *truth) {
    assert(work && camera && truth && (truth->count == 0 || (sources && source_of)));
    truth->shape_count = 0;
    for (int i = 0; i < truth->count; i++) {
        const bst_scene_source *source = &sources[source_of[i]];
        if (!source->body) {
            continue;
        }
        if (truth->shape_count == BST_TRUTH_SHAPES) {
            hide_whole(source, &truth->items[i]);
            continue;
        }
        int slot;
        placed_body placed = {
            .camera = camera, .q_cam_from_gcrf = truth->q_cam_from_gcrf_mid, .source = source};
        BST_TRY(slot_of(ctx, work, source->body->satellite, &slot));
        bst_satellite_pose *pose = work->poses[slot];
        BST_TRY(reserve(ctx, work, pose->satellite->vertex_count));
        bst_source_body_at(source, 0.5, &placed.state, &placed.earthlight);
        bst_source_body_set_pose(source, &placed.state, pose);
        const bst_body_limb_view limb = {placed.q_cam_from_gcrf, bst_camera_scale_rad(camera)};
        (void)bst_body_limb_hidden(source, 0.5, &limb, &placed.hidden);
        bst_truth_shape *shape = &truth->shapes[truth->shape_count++];
        project(work, &placed, pose, shape);
        shape->item = i;
        shape->x_light_px = shape->x_px;
        shape->y_light_px = shape->y_px;
        BST_TRY(find_light(ctx, work, &placed, pose, work->images[slot], shape));
        truth->items[i].electrons *= shape->visible;
        truth->items[i].snr *= shape->visible * shape->snr_ratio;
        truth->items[i].flags |= nothing_left(shape) ? BST_TRUTH_OCCULTED : 0;
        truth->items[i].x_centroid_px += shape->x_light_px - shape->x_px;
        truth->items[i].y_centroid_px += shape->y_light_px - shape->y_px;
    }
    return BST_OK;
}
