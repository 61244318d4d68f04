#include "sim/satellite/shape_silhouette.h"

#include <assert.h>
#include <stdlib.h>

bst_status bst_shape_silhouette_create(bst_ctx *ctx, int vertices, bst_shape_silhouette *out) {
    /* outlines have at most twice the vertices of a body; a hull takes three times all */
    int capacity = 3 * vertices + BST_SILHOUETTE_CIRCLE;
    *out = (bst_shape_silhouette){.capacity = capacity};
    out->points = calloc((size_t)capacity, sizeof *out->points);
    return out->points
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a silhouette of %d points", capacity);
}

void bst_shape_silhouette_free(bst_shape_silhouette *s) {
    free(s->points);
    s->points = NULL;
}

void bst_shape_silhouette_of_sphere(bst_shape_silhouette *s, double radius_m) {
    double step = 2.0 * BST_PI / BST_SILHOUETTE_CIRCLE;
    double radius = radius_m * sqrt(step / sin(step)); /* the polygon has the disc's area */
    for (int i = 0; i < BST_SILHOUETTE_CIRCLE; i++) {
        s->points[i] = (bst_point2){radius * cos(step * i), radius * sin(step * i)};
    }
    s->first[0] = 0;
    s->first[1] = BST_SILHOUETTE_CIRCLE;
    s->pieces = 1;
}

/* Convex hull of a pose with many bodies. */
static void make_hull(bst_shape_silhouette *s, const bst_satellite_pose *p, bst_vec3 x,
                      bst_vec3 y) {
    int n = p->satellite->vertex_count;
    bst_point2 *flat = s->points + 2 * n;
    for (int i = 0; i < n; i++) {
        flat[i] = (bst_point2){bst_vec3_dot(p->vertices[i], x), bst_vec3_dot(p->vertices[i], y)};
    }
    int corners = bst_polygon_hull(flat, n, s->points);
    if (corners < 3 || corners > BST_POLYGON_CORNERS_MAX) {
        bst_shape_silhouette_of_sphere(s, p->satellite->radius_m);
        return;
    }
    s->first[0] = 0;
    s->first[1] = corners;
    s->pieces = 1;
}

void bst_shape_silhouette_of_pose(bst_shape_silhouette *s, bst_satellite_pose *p, bst_vec3 x,
                                  bst_vec3 y) {
    const bst_satellite *model = p->satellite;
    assert(3 * model->vertex_count + BST_SILHOUETTE_CIRCLE <= s->capacity);
    if (model->occluder_count > BST_SILHOUETTE_PIECES) {
        make_hull(s, p, x, y);
        return;
    }
    bst_pose_look(p, 0, bst_vec3_unit(bst_vec3_cross(x, y)));
    const bst_pose_view *v = &p->views[0];
    /* the axes of the view and of the plane differ by a rotation */
    double c = bst_vec3_dot(v->x, x), d = bst_vec3_dot(v->x, y);
    s->pieces = 0;
    s->first[0] = 0;
    for (int o = 0; o < model->occluder_count; o++) {
        const bst_point2 *outline;
        int corners = bst_pose_outline(p, 0, o, &outline), at = s->first[s->pieces];
        if (corners < 3) {
            continue; /* a plate that is seen edge-on */
        }
        for (int i = 0; i < corners; i++) {
            s->points[at + i] = (bst_point2){c * outline[i].x - d * outline[i].y,
                                             d * outline[i].x + c * outline[i].y};
        }
        s->first[++s->pieces] = at + corners;
    }
}

bool bst_shape_silhouette_meets(const bst_satellite_pose *p, bst_vec3 eye_m, bst_vec3 direction) {
    const bst_satellite *model = p->satellite;
    for (int f = 0; f < model->facet_count; f++) {
        const bst_facet *facet = &model->facets[f];
        const int *corner = &model->corner[facet->first];
        bst_vec3 a = bst_vec3_sub(p->vertices[corner[facet->count - 1]], eye_m);
        bool inside = bst_vec3_dot(p->normals[f], a) < 0.0; /* it faces the eye */
        for (int i = 0; i < facet->count && inside; i++) {
            bst_vec3 b = bst_vec3_sub(p->vertices[corner[i]], eye_m);
            /* corners are counter-clockwise as the eye sees them */
            inside = bst_vec3_dot(direction, bst_vec3_cross(a, b)) <= 0.0;
            a = b;
        }
        if (inside) {
            return true;
        }
    }
    return false;
}

/* Area of the union of all pieces, outside of `front` if that is not NULL. */
static double union_area(bst_polygon_clip *clip, const bst_shape_silhouette *s,
                         const bst_shape_silhouette *front, double scale, bst_point2 shift) {
    double area = 0.0;
    for (int i = 0; i < s->pieces; i++) {
        bst_polygon_clip_start(clip, s->points + s->first[i], s->first[i + 1] - s->first[i]);
        for (int k = 0; k < i; k++) {
            bst_polygon_clip_subtract(clip, s->points + s->first[k], s->first[k + 1] - s->first[k],
                                      false);
        }
        for (int k = 0; front && k < front->pieces; k++) {
            bst_point2 moved[BST_POLYGON_CORNERS_MAX];
            int n = front->first[k + 1] - front->first[k];
            for (int c = 0; c < n; c++) {
                const bst_point2 *from = &front->points[front->first[k] + c];
                moved[c] = (bst_point2){shift.x + scale * from->x, shift.y + scale * from->y};
            }
            bst_polygon_clip_subtract(clip, moved, n, false);
        }
        area += bst_polygon_clip_area(clip);
    }
    return area;
}

double bst_shape_silhouette_hidden(bst_polygon_clip *clip, const bst_shape_silhouette *s,
                                   const bst_shape_silhouette *front, double scale,
                                   bst_point2 shift) {
    double all = union_area(clip, s, NULL, 0.0, shift);
    double left = all > 0.0 ? union_area(clip, s, front, scale, shift) : 0.0;
    return all > 0.0 ? fmin(fmax(1.0 - left / all, 0.0), 1.0) : 0.0;
}
