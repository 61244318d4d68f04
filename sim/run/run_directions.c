#include "sim/run/run_directions.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/archive.h"
#include "sim/core/tangent.h"

enum { MOST_CENTROIDS = 1 << 24 };
#define CENTROID_BYTES sizeof(bst_run_centroid)

void bst_run_measure_direction(const bst_camera *camera, double x_px, double y_px,
                               const double cov_px2[3], const bst_attitude_fix *attitude,
                               const bst_light *light, bst_od_observation *out) {
    const bst_quat back = bst_quat_conj(bst_quat_unit(attitude->q_cam_from_gcrf));
    const bst_vec3 v = bst_camera_unproject(camera, x_px, y_px);
    const bst_vec3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    bst_vec3 columns[5];
    columns[0] = bst_vec3_sub(bst_camera_unproject(camera, x_px + 0.5, y_px),
                              bst_camera_unproject(camera, x_px - 0.5, y_px));
    columns[1] = bst_vec3_sub(bst_camera_unproject(camera, x_px, y_px + 0.5),
                              bst_camera_unproject(camera, x_px, y_px - 0.5));
    const double *sigma = attitude->sigma_rad;
    double c[5][5] = {{cov_px2[0], cov_px2[1]}, {cov_px2[1], cov_px2[2]}};
    for (int i = 0; i < 3; i++) {
        columns[2 + i] = bst_vec3_cross(unit[i], v);
        c[2 + i][2 + i] = sigma[i] * sigma[i];
    }
    for (int i = 0; i < 3; i++) { /* xy, xz, yz */
        const int a = i / 2, b = i < 1 ? 1 : 2;
        c[2 + a][2 + b] = c[2 + b][2 + a] = attitude->correlation[i] * sigma[a] * sigma[b];
    }
    out->direction = bst_light_unaberrate(light, bst_quat_rotate(back, v));
    const bst_tangent axes = bst_tangent_at(out->direction);
    double j[2][5];
    for (int i = 0; i < 5; i++) {
        bst_vec3 column = bst_quat_rotate(back, columns[i]);
        j[0][i] = bst_vec3_dot(column, axes.e1);
        j[1][i] = bst_vec3_dot(column, axes.e2);
    }
    /* columns of a root of the covariance about x and y */
    const double r = attitude->correlation[0], rest = sqrt(fmax(1.0 - r * r, 0.0));
    for (int k = 0; k < 2; k++) {
        out->shared_rad[k][0] = j[k][2] * sigma[0] + j[k][3] * r * sigma[1];
        out->shared_rad[k][1] = j[k][3] * rest * sigma[1];
    }
    out->cov_11 = out->cov_12 = out->cov_22 = 0.0;
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            out->cov_11 += j[0][i] * c[i][k] * j[0][k];
            out->cov_12 += j[0][i] * c[i][k] * j[1][k];
            out->cov_22 += j[1][i] * c[i][k] * j[1][k];
        }
    }
}

double bst_run_change_of_stars(const bst_camera *camera, bst_quat q_cam_from_gcrf,
                               bst_quat next_cam_from_gcrf) {
    const bst_vec3 ahead = {0.0, 0.0, 1.0};
    bst_vec3 before = bst_quat_rotate(bst_quat_conj(bst_quat_unit(q_cam_from_gcrf)), ahead);
    bst_vec3 now = bst_quat_rotate(bst_quat_conj(bst_quat_unit(next_cam_from_gcrf)), ahead);
    double side =
        0.5 * (double)(camera->width_px + camera->height_px) * bst_camera_scale_rad(camera);
    return 2.0 * bst_vec3_angle(before, now) / side;
}

/* Makes room for the centroids of a frame. */
static bst_status make_room(bst_ctx *ctx, bst_run_centroids *c, int frame, int count) {
    if (count > c->frames[frame].room) {
        size_t size = (size_t)count * CENTROID_BYTES;
        bst_run_centroid *items = realloc(c->frames[frame].items, size);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d centroids", count);
        }
        c->frames[frame].items = items;
        c->frames[frame].room = count;
    }
    c->frames[frame].count = count;
    return BST_OK;
}

bst_status bst_run_centroids_add(bst_ctx *ctx, bst_run_centroids *c, const bst_detections *d) {
    const int frame = c->next;
    BST_TRY(make_room(ctx, c, frame, d->count));
    c->next = (frame + 1) % BST_RUN_CENTROID_FRAMES;
    c->frames[frame].exposure_id = d->exposure_id;
    for (int i = 0; i < d->count; i++) {
        const bst_detection *from = &d->items[i];
        c->frames[frame].items[i] = (bst_run_centroid){from->x_px,
                                                       from->y_px,
                                                       {from->cov_xx, from->cov_xy, from->cov_yy},
                                                       (double)(d->end_tick - d->start_tick)};
    }
    return BST_OK;
}

const bst_run_centroid *bst_run_centroids_find(const bst_run_centroids *c, int64_t exposure_id,
                                               double x_px, double y_px) {
    for (int i = 0; i < BST_RUN_CENTROID_FRAMES; i++) {
        for (int k = 0; c->frames[i].exposure_id == exposure_id && k < c->frames[i].count; k++) {
            const bst_run_centroid *item = &c->frames[i].items[k];
            if (item->x_px == x_px && item->y_px == y_px) {
                return item;
            }
        }
    }
    return NULL;
}

bst_status bst_run_centroids_archive(bst_run_centroids *c, bst_archive *archive) {
    bst_ctx *ctx = bst_archive_ctx(archive);
    for (int i = 0; i < BST_RUN_CENTROID_FRAMES; i++) {
        int count = bst_archive_count(archive, c->frames[i].count, MOST_CENTROIDS);
        if (bst_archive_is_restoring(archive) &&
            bst_archive_remaining(archive) / CENTROID_BYTES < (size_t)count) {
            return bst_fail(ctx, BST_ERR_FORMAT, "the saved state has not all of %d centroids",
                            count);
        }
        BST_TRY(make_room(ctx, c, i, count));
        BST_ARCHIVE(archive, c->frames[i].exposure_id);
        if (count > 0) {
            bst_archive_bytes(archive, c->frames[i].items, (size_t)count * CENTROID_BYTES);
        }
    }
    int next = bst_archive_count(archive, c->next, BST_RUN_CENTROID_FRAMES - 1);
    c->next = next;
    return BST_OK;
}

void bst_run_centroids_clear(bst_run_centroids *c) {
    for (int i = 0; i < BST_RUN_CENTROID_FRAMES; i++) {
        free(c->frames[i].items);
    }
    *c = (bst_run_centroids){.next = 0};
}
