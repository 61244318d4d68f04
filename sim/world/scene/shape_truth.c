#include "sim/world/scene/shape_truth.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/world/scene/source_body.h"

void bst_shape_truth_free(bst_shape_truth *work) {
    for (int i = 0; i < BST_TRUTH_SHAPES; i++) {
        bst_satellite_pose_free(work->poses[i]);
    }
    free(work->points);
    free(work->hull);
    *work = (bst_shape_truth){0};
}

/* Pose of a model, in place of another one if there is no room. */
static bst_status pose_of(bst_ctx *ctx, bst_shape_truth *work, const bst_satellite *satellite,
                          bst_satellite_pose **out) {
    int free_slot = BST_TRUTH_SHAPES - 1;
    for (int i = BST_TRUTH_SHAPES - 1; i >= 0; i--) {
        if (work->poses[i] && work->poses[i]->satellite == satellite) {
            *out = work->poses[i];
            return BST_OK;
        }
        free_slot = work->poses[i] ? free_slot : i;
    }
    bst_satellite_pose_free(work->poses[free_slot]);
    BST_TRY(bst_satellite_pose_create(ctx, satellite, &work->poses[free_slot]));
    *out = work->poses[free_slot];
    return BST_OK;
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

/* Projects the body: centre of mass, box and extent. */
static void project(bst_shape_truth *work, const bst_camera *camera, bst_quat q_cam_from_gcrf,
                    const bst_source_body_state *body, const bst_satellite_pose *pose,
                    bst_truth_shape *out) {
    bst_vec3 centre = bst_vec3_scale(body->apparent, body->range_m);
    bst_quat back = bst_quat_conj(body->q_body_from_gcrf);
    int count = pose->satellite->vertex_count;
    *out = (bst_truth_shape){.x_px = NAN,
                             .y_px = NAN,
                             .x0_px = INFINITY,
                             .y0_px = INFINITY,
                             .x1_px = -INFINITY,
                             .y1_px = -INFINITY,
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
}

bst_status bst_shape_truth_fill(bst_ctx *ctx, bst_shape_truth *work, const bst_camera *camera,
                                const bst_scene_source *sources, const int *source_of,
                                bst_truth *truth) {
    assert(work && camera && truth && (truth->count == 0 || (sources && source_of)));
    truth->shape_count = 0;
    for (int i = 0; i < truth->count && truth->shape_count < BST_TRUTH_SHAPES; i++) {
        const bst_scene_source *source = &sources[source_of[i]];
        if (!source->body) {
            continue;
        }
        bst_satellite_pose *pose;
        bst_source_body_state body;
        BST_TRY(pose_of(ctx, work, source->body->satellite, &pose));
        BST_TRY(reserve(ctx, work, pose->satellite->vertex_count));
        bst_source_body_at(source, 0.5, &body, NULL);
        bst_satellite_pose_set(pose, &body.aim);
        bst_truth_shape *shape = &truth->shapes[truth->shape_count++];
        project(work, camera, truth->q_cam_from_gcrf_mid, &body, pose, shape);
        shape->item = i;
    }
    return BST_OK;
}
