/* The fast image of a mesh: one sample per cell, and shadows by a depth map from the Sun. */
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/resolved_faces.h"

void bst_resolved_samples_free(bst_resolved_samples *s) {
    free(s->near);
    free(s->facet);
    free(s->toward);
    free(s->light);
    *s = (bst_resolved_samples){.cells = 0};
}

static bst_status reserve(bst_ctx *ctx, const bst_resolved *r, bst_resolved_samples *s) {
    size_t cells = (size_t)r->image.width * (size_t)r->image.height;
    size_t side = BST_SHADOW_SIDE;
    bool made = true;
    if (!s->toward) {
        s->toward = malloc(side * side * sizeof *s->toward);
        s->light = malloc(((size_t)r->satellite->facet_count + 1) * sizeof *s->light);
        made = s->toward && s->light;
    }
    if (made && cells > s->cells) {
        free(s->near);
        free(s->facet);
        s->near = malloc(cells * sizeof *s->near);
        s->facet = malloc(cells * sizeof *s->facet);
        made = s->near && s->facet;
        s->cells = made ? cells : 0;
    }
    return made ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a satellite");
}

/* A grid of samples at the integers, with the greatest value so far. */
typedef struct target {
    float *most;
    int *facet; /* NULL: not wanted */
    int width, height;
} target;

static double least_of(double a, double b, double c) {
    double least = a < b ? a : b;
    return c < least ? c : least;
}

/* Smallest integer not below x, for the size of an image; 0: x is below 0. */
static int first_of(double x) {
    int i = x > 0.0 ? (int)x : 0;
    return i < x ? i + 1 : i;
}

/* Enters a triangle: value linear in x and y. Both orientations. */
static void enter(const target *t, const bst_vec3 *a, const bst_vec3 *b, const bst_vec3 *c,
                  int facet) {
    double area = (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
    if (!(fabs(area) > 1e-12)) {
        return;
    }
    double low_y = least_of(a->y, b->y, c->y), high_y = -least_of(-a->y, -b->y, -c->y);
    int first = low_y < t->height ? first_of(low_y) : t->height;
    int last = high_y < t->height - 1.0 ? (high_y < 0.0 ? -1 : (int)high_y) : t->height - 1;
    if (first > last) {
        return;
    }
    double dx = ((b->z - a->z) * (c->y - a->y) - (c->z - a->z) * (b->y - a->y)) / area;
    double dy = ((c->z - a->z) * (b->x - a->x) - (b->z - a->z) * (c->x - a->x)) / area;
    const bst_vec3 *corner[4] = {a, b, c, a};
    double slope[3];
    for (int e = 0; e < 3; e++) {
        const bst_vec3 *p = corner[e], *q = corner[e + 1];
        slope[e] = p->y != q->y ? (q->x - p->x) / (q->y - p->y) : 0.0;
    }
    for (int y = first; y <= last; y++) {
        double from = INFINITY, to = -INFINITY;
        for (int e = 0; e < 3; e++) {
            const bst_vec3 *p = corner[e], *q = corner[e + 1];
            if ((p->y <= y) != (q->y <= y)) {
                double x = p->x + (y - p->y) * slope[e];
                from = x < from ? x : from;
                to = x > to ? x : to;
            }
        }
        int i = from < t->width ? first_of(from) : t->width;
        int end = to < t->width - 1.0 ? (to < 0.0 ? -1 : (int)to) : t->width - 1;
        size_t row = (size_t)y * (size_t)t->width;
        double value = a->z + dx * (i - a->x) + dy * (y - a->y);
        for (; i <= end; i++, value += dx) {
            if ((float)value > t->most[row + (size_t)i]) {
                t->most[row + (size_t)i] = (float)value;
                if (t->facet) {
                    t->facet[row + (size_t)i] = facet;
                }
            }
        }
    }
}

/* The Sun's view: cells of its depth map from the body frame. */
typedef struct sun_view {
    bst_vec3 x, y, z; /* unit */
    double per_m;
} sun_view;

static bst_vec3 in_sun_view(const sun_view *v, bst_vec3 p) {
    double middle = 0.5 * BST_SHADOW_SIDE;
    return (bst_vec3){middle + v->per_m * bst_vec3_dot(p, v->x),
                      middle + v->per_m * bst_vec3_dot(p, v->y), bst_vec3_dot(p, v->z)};
}

/* Light of a facet, computed when it is first seen. */
static const bst_sampled_facet *light_of(const bst_resolved_adding *a, bst_resolved_samples *s,
                                         const sun_view *v, int f) {
    bst_sampled_facet *out = &s->light[f];
    if (out->known) {
        return out;
    }
    const bst_facet *facet = &a->r->satellite->facets[f];
    bst_vec3 middle = {0}, normal = a->pose->normals[f];
    for (int i = 0; i < facet->count; i++) {
        middle = bst_vec3_axpy(middle, 1.0 / facet->count,
                               a->pose->vertices[a->r->satellite->corner[facet->first + i]]);
    }
    bst_resolved_shading light = bst_resolved_shade(a, facet->material, middle, normal);
    /* over the width of a cell of the map, 1 / per_m, the facet rises by its slope */
    double in = fmax(bst_vec3_dot(normal, v->z), 0.05);
    *out = (bst_sampled_facet){.sun = light.sun,
                               .other = light.uniform + light.earth,
                               .rise_m = (1.0 + sqrt(fmax(1.0 - in * in, 0.0)) / in) / v->per_m,
                               .part = (int16_t)facet->part,
                               .known = true};
    return out;
}

/* Where a vertex is in the image, from the sample of cell (0, 0), with 1 over its depth. */
static bst_vec3 in_image(const bst_resolved_adding *a, const double offset[2], bst_vec3 p) {
    double depth_m;
    bst_point2 q = bst_resolved_project(a, p, &depth_m);
    return (bst_vec3){q.x - offset[0], q.y - offset[1], 1.0 / depth_m};
}

/* Enters all facets into the Sun's depth map and into the image. Triangles of a mesh share no
 * vertices, so that each is placed when it is needed: memory takes longer than the computation. */
static void enter_facets(const bst_resolved_adding *a, bst_resolved_samples *s, const target *map,
                         const target *image, const sun_view *sun, const double offset[2]) {
    const bst_satellite *sat = a->r->satellite;
    for (int f = 0; f < sat->facet_count; f++) {
        const bst_facet *facet = &sat->facets[f];
        const int *v = &sat->corner[facet->first];
        const bst_vec3 *vertices = a->pose->vertices, *normal = &a->pose->normals[f];
        if (bst_vec3_dot(*normal, a->light->sun) > 0.0) {
            bst_vec3 p = in_sun_view(sun, vertices[v[0]]), q = in_sun_view(sun, vertices[v[1]]);
            for (int i = 2; i < facet->count; i++) {
                bst_vec3 r = in_sun_view(sun, vertices[v[i]]);
                enter(map, &p, &q, &r, f);
                q = r;
            }
        }
        s->light[f].known = false;
        if (bst_vec3_dot(*normal, bst_vec3_sub(a->eye_m, vertices[v[0]])) > 0.0) {
            bst_vec3 p = in_image(a, offset, vertices[v[0]]);
            bst_vec3 q = in_image(a, offset, vertices[v[1]]);
            for (int i = 2; i < facet->count; i++) {
                bst_vec3 r = in_image(a, offset, vertices[v[i]]);
                enter(image, &p, &q, &r, f);
                q = r;
            }
            if (!a->earth) { /* now, while its memory is near; earthlight takes longer */
                (void)light_of(a, s, sun, f);
            }
        }
    }
}

/* True if a place of the Sun's view sees the Sun. */
static bool is_lit(const bst_resolved_samples *s, bst_vec3 q, double rise_m) {
    double x = q.x + 0.5, y = q.y + 0.5;
    if (!(x >= 0.0 && y >= 0.0 && x < BST_SHADOW_SIDE && y < BST_SHADOW_SIDE)) {
        return true;
    }
    return (double)s->toward[(int)y * BST_SHADOW_SIDE + (int)x] <= q.z + rise_m;
}

/* From the image to the Sun's view: what is seen at tangents (u, w), at a depth, is at the sum of
 * `origin` and the depth times u x + w y + z. */
typedef struct sun_map {
    bst_vec3 origin, x, y, z;
} sun_map;

static sun_map map_to_sun(const bst_resolved_adding *a, const sun_view *v) {
    bst_vec3 axes[4] = {{0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 4; i++) {
        bst_vec3 q = bst_vec3_sub(axes[i], a->view->origin_m);
        axes[i] = in_sun_view(v, bst_mat3_transpose_mul_vec(&a->image_from_body, q));
    }
    return (sun_map){axes[0], bst_vec3_sub(axes[1], axes[0]), bst_vec3_sub(axes[2], axes[0]),
                     bst_vec3_sub(axes[3], axes[0])};
}

/* Adds the samples to the image. */
static double add_samples(const bst_resolved_adding *a, bst_resolved_samples *s, const sun_view *v,
                          const double offset[2], double weight) {
    bst_resolved_image *m = &a->r->image;
    double total = 0.0, cell = 1.0 / a->per_m;
    const sun_map map = map_to_sun(a, v);
    for (int y = 0; y < m->height; y++) {
        double w = (m->y0 + y + offset[1]) * cell;
        bst_vec3 row = bst_vec3_axpy(map.z, w, map.y);
        for (int x = 0; x < m->width; x++) {
            size_t at = (size_t)y * (size_t)m->width + (size_t)x;
            int f = s->facet[at];
            if (f < 0) {
                continue;
            }
            const bst_sampled_facet *light = light_of(a, s, v, f);
            double u = (m->x0 + x + offset[0]) * cell;
            double sum = light->other, c2 = 1.0 / (1.0 + u * u + w * w);
            if (light->sun > 0.0) {
                double depth_m = 1.0 / (double)s->near[at];
                bst_vec3 q = bst_vec3_axpy(map.origin, depth_m, bst_vec3_axpy(row, u, map.x));
                sum += is_lit(s, q, light->rise_m) ? light->sun : 0.0;
            }
            sum *= c2 * sqrt(c2);
            total += sum;
            bst_resolved_cell *to = &m->cells[at];
            to->light += (float)(weight * sum);
            to->moment_x += (float)(weight * sum * (offset[0] - 0.5));
            to->moment_y += (float)(weight * sum * (offset[1] - 0.5));
            to->cover += (float)weight;
            m->part[at] = light->part;
        }
    }
    return total;
}

bst_status bst_resolved_sample(bst_ctx *ctx, const bst_resolved_adding *a, int index, double weight,
                               double *total) {
    bst_resolved *r = a->r;
    bst_resolved_samples *s = &r->samples;
    const bst_satellite *sat = r->satellite;
    BST_TRY(reserve(ctx, r, s));
    /* places of the sample in its cell: multiples of the golden ratio's generalisation to two
     * dimensions (Roberts 2018) fill the square evenly */
    const double offset[2] = {fmod(0.5 + 0.7548776662466927 * index, 1.0),
                              fmod(0.5 + 0.5698402909980532 * index, 1.0)};
    sun_view v = {.z = a->light->sun, .per_m = 0.49 * BST_SHADOW_SIDE / sat->radius_m};
    v.x = bst_vec3_perpendicular(v.z);
    v.y = bst_vec3_cross(v.z, v.x);
    size_t cells = (size_t)r->image.width * (size_t)r->image.height;
    memset(s->near, 0, cells * sizeof *s->near);
    memset(s->facet, -1, cells * sizeof *s->facet);
    for (int i = 0; i < BST_SHADOW_SIDE * BST_SHADOW_SIDE; i++) {
        s->toward[i] = -INFINITY;
    }
    const target shadow = {s->toward, NULL, BST_SHADOW_SIDE, BST_SHADOW_SIDE};
    const target image = {s->near, s->facet, r->image.width, r->image.height};
    enter_facets(a, s, &shadow, &image, &v, offset);
    *total = add_samples(a, s, &v, offset, weight);
    return BST_OK;
}
