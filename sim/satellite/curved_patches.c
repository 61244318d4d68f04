#include "sim/satellite/curved_patches.h"

#include <stdlib.h>

#include "sim/satellite/pose_view.h"

/* Radius of a regular polygon with the area of a circle, over the circle's radius.
 *
 * Given:     angle  at the centre, of one side */
static double polygon_radius(double angle) {
    return angle > 1e-9 ? sqrt(angle / sin(angle)) : 1.0;
}

void bst_curved_places_free(bst_curved_places *places) {
    free(places->centre);
    free(places->rim);
    *places = (bst_curved_places){.centre = NULL};
}

bst_status bst_curved_places_create(bst_ctx *ctx, const bst_satellite *s, bst_curved_places *out) {
    int *corners = calloc((size_t)s->curved_count + 1, sizeof *corners);
    out->centre = calloc((size_t)s->curved_count + 1, sizeof *out->centre);
    out->rim = malloc(((size_t)s->vertex_count + 1) * sizeof *out->rim);
    if (!corners || !out->centre || !out->rim) {
        free(corners);
        bst_curved_places_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the curved surfaces of a satellite");
    }
    for (int v = 0; v < s->vertex_count; v++) {
        out->rim[v] = -1;
    }
    for (int f = 0; f < s->facet_count; f++) {
        const bst_facet *facet = &s->facets[f];
        int c = facet->curved;
        for (int i = 0; i < facet->count && c >= 0; i++) {
            int v = s->corner[facet->first + i];
            out->centre[c] = bst_vec3_add(out->centre[c], s->vertices[v]);
            corners[c]++;
            out->rim[v] = s->curved[c].sphere ? out->rim[v] : c;
        }
    }
    for (int c = 0; c < s->curved_count; c++) {
        out->centre[c] = bst_vec3_scale(out->centre[c], corners[c] ? 1.0 / corners[c] : 0.0);
    }
    free(corners);
    return BST_OK;
}

/* Frame of a curved surface in the body frame. */
static void frame_of(const bst_satellite_pose *p, const bst_curved_places *places, int curved,
                     bst_curved_facet *out) {
    const bst_curved *c = &p->satellite->curved[curved];
    *out = (bst_curved_facet){.curved = c,
                              .centre = bst_pose_moved(p, c->joint, places->centre[curved]),
                              .x = bst_pose_turned(p, c->joint, c->x),
                              .y = bst_pose_turned(p, c->joint, c->y),
                              .z = bst_pose_turned(p, c->joint, c->z)};
}

void bst_curved_facet_make(const bst_satellite_pose *p, const bst_curved_places *places, int facet,
                           bst_curved_facet *out) {
    const bst_facet *f = &p->satellite->facets[facet];
    frame_of(p, places, f->curved, out);
    double radius[4] = {0}, height[4] = {0}, azimuth[2] = {0}, first = 0.0;
    int known = 0, count = f->count < 4 ? f->count : 4;
    for (int i = 0; i < count; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[p->satellite->corner[f->first + i]], out->centre);
        double x = bst_vec3_dot(r, out->x), y = bst_vec3_dot(r, out->y);
        radius[i] = hypot(x, y);
        height[i] = bst_vec3_dot(r, out->z);
        if (radius[i] < 1e-9 * bst_vec3_norm(r) || radius[i] < 1e-12) {
            continue; /* a tip */
        }
        double turn = known ? bst_wrap_angle(atan2(y, x) - first) : 0.0;
        first = known ? first : atan2(y, x);
        azimuth[0] = fmin(azimuth[0], turn);
        azimuth[1] = fmax(azimuth[1], turn);
        known++;
    }
    out->azimuth[0] = first + azimuth[0];
    out->azimuth[1] = first + azimuth[1];
    double coarse = polygon_radius(azimuth[1] - azimuth[0]);
    int low = 0, high = 0;
    for (int i = 1; i < count; i++) {
        low = height[i] < height[low] ? i : low;
        high = height[i] > height[high] ? i : high;
    }
    const int end[2] = {low, high};
    for (int i = 0; i < 2; i++) {
        out->radius_m[i] = radius[end[i]] / coarse;
        out->height[i] =
            out->curved->sphere ? atan2(height[end[i]], out->radius_m[i]) : height[end[i]];
    }
}

double bst_curved_facet_scale(const bst_curved_facet *f, int around, int up) {
    double scale = polygon_radius((f->azimuth[1] - f->azimuth[0]) / around);
    return f->curved->sphere ? scale * polygon_radius((f->height[1] - f->height[0]) / up) : scale;
}

void bst_curved_facet_part(const bst_curved_facet *f, const int parts[2], const int place[2],
                           double scale, bst_vec3 corner[4]) {
    double turn = (f->azimuth[1] - f->azimuth[0]) / parts[0];
    double step = (f->height[1] - f->height[0]) / parts[1];
    for (int n = 0; n < 4; n++) {
        int right = n == 1 || n == 2, high = n >= 2;
        double a = f->azimuth[0] + turn * (place[0] + right), z, r;
        double height = f->height[0] + step * (place[1] + high);
        if (f->curved->sphere) {
            z = scale * f->curved->radius_m * sin(height);
            r = scale * f->curved->radius_m * cos(height);
        } else {
            double v = (double)(place[1] + high) / parts[1];
            z = height;
            r = scale * (f->radius_m[0] + v * (f->radius_m[1] - f->radius_m[0]));
        }
        bst_vec3 p = bst_vec3_axpy(f->centre, z, f->z);
        p = bst_vec3_axpy(p, r * cos(a), f->x);
        corner[n] = bst_vec3_axpy(p, r * sin(a), f->y);
    }
}

bst_vec3 bst_curved_facet_normal(const bst_curved_facet *f, double u, double v) {
    double a = f->azimuth[0] + u * (f->azimuth[1] - f->azimuth[0]), radial, axial;
    if (f->curved->sphere) {
        double latitude = f->height[0] + v * (f->height[1] - f->height[0]);
        radial = cos(latitude);
        axial = sin(latitude);
    } else {
        double rise = f->radius_m[1] - f->radius_m[0], length = f->height[1] - f->height[0];
        double slant = hypot(rise, length);
        radial = length / slant;
        axial = -rise / slant;
    }
    bst_vec3 n = bst_vec3_scale(f->z, axial);
    n = bst_vec3_axpy(bst_vec3_axpy(n, radial * cos(a), f->x), radial * sin(a), f->y);
    return bst_vec3_scale(n, f->curved->side);
}

int bst_plane_facet_corners(const bst_satellite_pose *p, const bst_curved_places *places, int facet,
                            int around, bst_vec3 *corner) {
    const bst_facet *f = &p->satellite->facets[facet];
    const int *v = &p->satellite->corner[f->first];
    int n = 0;
    for (int i = 0; i < f->count; i++) {
        int a = v[i], b = v[i + 1 < f->count ? i + 1 : 0], c = places->rim[a];
        if (around == 1 || c < 0 || places->rim[b] != c) {
            corner[n++] = p->vertices[a];
            continue;
        }
        bst_curved_facet rim;
        frame_of(p, places, c, &rim);
        bst_vec3 r = bst_vec3_sub(p->vertices[a], rim.centre);
        bst_vec3 s = bst_vec3_sub(p->vertices[b], rim.centre);
        double z = bst_vec3_dot(r, rim.z);
        double first = atan2(bst_vec3_dot(r, rim.y), bst_vec3_dot(r, rim.x));
        double turn = bst_wrap_angle(atan2(bst_vec3_dot(s, rim.y), bst_vec3_dot(s, rim.x)) - first);
        double radius = hypot(bst_vec3_dot(r, rim.x), bst_vec3_dot(r, rim.y));
        radius *= polygon_radius(fabs(turn) / around) / polygon_radius(fabs(turn));
        for (int k = 0; k < around; k++) {
            double angle = first + turn * k / around;
            bst_vec3 q = bst_vec3_axpy(rim.centre, z, rim.z);
            q = bst_vec3_axpy(q, radius * cos(angle), rim.x);
            corner[n++] = bst_vec3_axpy(q, radius * sin(angle), rim.y);
        }
    }
    return n;
}
