#include "sim/analysis/shape/turntable.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/grey_png.h"
#include "sim/satellite/flux.h"

enum { COLUMNS = 4, ROWS = 2, BACKGROUND = 24 };

/* One picture of the sheet. */
typedef struct sheet {
    uint8_t *pixels;
    int size_px, width;
    int left, top;         /* of the current picture */
    double scale;          /* px per m */
    bst_vec3 right, above; /* axes of the picture, body frame */
} sheet;

/* Fills a convex polygon, in pixels of the picture, row by row at the centres of pixels. */
static void fill(const sheet *s, const bst_point2 *p, int count, uint8_t grey) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < count; i++) {
        low = fmin(low, p[i].y);
        high = fmax(high, p[i].y);
    }
    int first = (int)fmax(ceil(low - 0.5), 0.0);
    int last = (int)fmin(floor(high - 0.5), s->size_px - 1.0);
    for (int y = first; y <= last; y++) {
        double left = INFINITY, right = -INFINITY, at = y + 0.5;
        for (int i = 0; i < count; i++) {
            bst_point2 a = p[i], b = p[(i + 1) % count];
            if ((a.y <= at) != (b.y <= at)) {
                double x = a.x + (at - a.y) / (b.y - a.y) * (b.x - a.x);
                left = fmin(left, x);
                right = fmax(right, x);
            }
        }
        if (!(left <= right)) {
            continue; /* the row meets a corner only */
        }
        int x0 = (int)fmin(fmax(ceil(left - 0.5), 0.0), s->size_px);
        int x1 = (int)fmin(floor(right - 0.5), s->size_px - 1.0);
        for (int x = x0; x <= x1; x++) {
            s->pixels[(size_t)(s->top + y) * (size_t)s->width + (size_t)(s->left + x)] = grey;
        }
    }
}

/* Grey of a radiance relative to a white surface in full light: a cube root keeps dark ones
 * visible. */
static uint8_t grey_of(double radiance) {
    return (uint8_t)fmin(32.0 + 223.0 * cbrt(fmax(radiance, 0.0)), 255.0);
}

/* A point of the body in pixels of the picture. */
static bst_point2 project(const sheet *s, bst_vec3 q) {
    return (bst_point2){0.5 * s->size_px + s->scale * bst_vec3_dot(q, s->right),
                        0.5 * s->size_px - s->scale * bst_vec3_dot(q, s->above)};
}

/* Draws what is visible of a facet from `views` views in one grey. */
static void draw_facet(const sheet *s, bst_satellite_pose *p, int index, int views, uint8_t grey) {
    bst_point2 corners[BST_POLYGON_CORNERS_MAX];
    const bst_facet *f = &p->satellite->facets[index];
    bst_vec3 origin, e1, e2;
    bool whole;
    (void)bst_pose_unshadowed(p, index, views, &whole);
    if (whole) {
        for (int i = 0; i < f->count; i++) {
            corners[i] = project(s, p->vertices[p->satellite->corner[f->first + i]]);
        }
        fill(s, corners, f->count, grey);
        return;
    }
    bst_pose_facet_axes(p, index, &origin, &e1, &e2);
    for (int k = 0; k < p->clip.piece_count; k++) {
        bst_polygon_piece piece = p->clip.pieces[k];
        for (int i = 0; i < piece.count; i++) {
            bst_point2 c = p->clip.points[piece.first + i];
            corners[i] = project(s, bst_vec3_axpy(bst_vec3_axpy(origin, c.x, e1), c.y, e2));
        }
        fill(s, corners, piece.count, grey);
    }
}

/* Draws the satellite as seen from a direction. */
static void draw_side(const sheet *s, bst_satellite_pose *p, bst_vec3 eye, bst_vec3 sun) {
    bst_pose_look(p, 0, eye);
    bst_pose_look(p, 1, sun);
    for (int f = 0; f < p->satellite->facet_count; f++) {
        double out = bst_vec3_dot(p->normals[f], eye), in = bst_vec3_dot(p->normals[f], sun);
        const bst_material *m = &p->satellite->materials[p->satellite->facets[f].material];
        if (!(out > 1e-6)) {
            continue;
        }
        double ambient = 0.02 * BST_PI * m->scale * bst_brdf_value(&m->brdf, out, out, 1.0);
        draw_facet(s, p, f, 1, grey_of(fmin(ambient, 0.05)));
        if (in > 1e-6) {
            double light =
                BST_PI * m->scale * in *
                bst_brdf_value(&m->brdf, fmin(in, 1.0), fmin(out, 1.0), bst_vec3_dot(sun, eye));
            draw_facet(s, p, f, 2, grey_of(light));
        }
    }
}

/* Largest distance of a vertex from the body's origin in this pose, m. */
static double reach_of(const bst_satellite_pose *p) {
    double reach = 1e-6;
    for (int i = 0; i < p->satellite->vertex_count; i++) {
        reach = fmax(reach, bst_vec3_norm(p->vertices[i]));
    }
    return reach;
}

/* Draws all sides. */
static void draw_all(sheet *s, bst_satellite_pose *p) {
    for (int k = 0; k < COLUMNS * ROWS; k++) {
        double a = 0.25 * BST_PI * k, up = 20.0 * BST_DEG_RAD;
        bst_vec3 eye = {cos(up) * cos(a), cos(up) * sin(a), sin(up)};
        s->right = (bst_vec3){-sin(a), cos(a), 0.0};
        s->above = bst_vec3_cross(eye, s->right);
        bst_vec3 sun = bst_vec3_axpy(bst_vec3_axpy(eye, 0.6, s->right), 0.45, s->above);
        bst_satellite_aim aim = {.sun = bst_vec3_unit(sun), .earth = {0, 0, 1}, .target = eye};
        bst_satellite_pose_set(p, &aim);
        s->left = k % COLUMNS * s->size_px;
        s->top = k / COLUMNS * s->size_px;
        s->scale = 0.48 * s->size_px / reach_of(p);
        draw_side(s, p, eye, aim.sun);
    }
}

bst_status bst_turntable_draw(bst_ctx *ctx, const bst_satellite *satellite, const char *path,
                              int size_px) {
    assert(satellite && path && size_px >= 16 && size_px <= 2048);
    sheet s = {.size_px = size_px, .width = COLUMNS * size_px};
    size_t count = (size_t)s.width * (size_t)(ROWS * size_px);
    bst_satellite_pose *pose;
    BST_TRY(bst_satellite_pose_create(ctx, satellite, &pose));
    s.pixels = malloc(count);
    bst_status status = BST_OK;
    if (s.pixels) {
        memset(s.pixels, BACKGROUND, count);
        draw_all(&s, pose);
        status = bst_grey_png_write8(ctx, path, s.pixels, s.width, ROWS * size_px);
    } else {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a picture");
    }
    free(s.pixels);
    bst_satellite_pose_free(pose);
    return status;
}
