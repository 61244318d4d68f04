#include "sim/satellite/resolved_image.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/curved_patches.h"
#include "sim/satellite/polygon_coverage.h"
#include "sim/satellite/sun_disc.h"
#include "sim/satellite/visible_surface.h"

/* Largest number of parts of a facet of a curved surface in one direction. */
enum { PARTS_MAX = 64 };

/* Light of a cell that a facet covers in part: sums over lit polygons. */
typedef struct lit_cell {
    double light, x, y;
} lit_cell;

struct bst_resolved {
    const bst_satellite *satellite;
    bst_resolved_image image;
    size_t cell_capacity;
    bst_curved_places places;
    bst_visible_surface surface;
    bst_polygon_coverage whole, lit; /* of the current facet */
    lit_cell *lit_cells;             /* in the box of the current facet */
    size_t lit_capacity;
    bst_sun_disc disc;
};

bst_status bst_resolved_create(bst_ctx *ctx, const bst_satellite *satellite, bst_resolved **out) {
    bst_resolved *r = *out = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a satellite");
    }
    r->satellite = satellite;
    bst_status status = bst_curved_places_create(ctx, satellite, &r->places);
    if (status != BST_OK) {
        bst_resolved_free(r);
        *out = NULL;
    }
    return status;
}

void bst_resolved_free(bst_resolved *r) {
    if (r) {
        free(r->image.cells);
        free(r->image.part);
        free(r->lit_cells);
        bst_curved_places_free(&r->places);
        bst_visible_surface_free(&r->surface);
        bst_polygon_coverage_free(&r->whole);
        bst_polygon_coverage_free(&r->lit);
        free(r);
    }
}

const bst_resolved_image *bst_resolved_image_of(const bst_resolved *r) {
    return &r->image;
}

bool bst_resolved_box(const bst_satellite_pose *pose, const bst_resolved_view *view, double low[2],
                      double high[2]) {
    bst_mat3 turn = bst_quat_to_mat3(view->q_image_from_body);
    /* facets of curved surfaces are outside of it by a part of their size */
    double margin_m = 0.02 * pose->satellite->radius_m;
    low[0] = low[1] = INFINITY;
    high[0] = high[1] = -INFINITY;
    for (int v = 0; v < pose->satellite->vertex_count; v++) {
        bst_vec3 p = bst_vec3_add(view->origin_m, bst_mat3_mul_vec(&turn, pose->vertices[v]));
        if (!(p.z > margin_m)) {
            return false;
        }
        double f = 1.0 / (p.z * view->scale_rad), margin = margin_m * f;
        low[0] = fmin(low[0], p.x * f - margin);
        low[1] = fmin(low[1], p.y * f - margin);
        high[0] = fmax(high[0], p.x * f + margin);
        high[1] = fmax(high[1], p.y * f + margin);
    }
    return pose->satellite->vertex_count > 0;
}

bst_status bst_resolved_begin(bst_ctx *ctx, bst_resolved *r, const double low[2],
                              const double high[2], double cell_px) {
    assert(cell_px > 0.0 && high[0] >= low[0] && high[1] >= low[1]);
    bst_resolved_image *m = &r->image;
    double x0 = floor(low[0] / cell_px), y0 = floor(low[1] / cell_px);
    double width = ceil(high[0] / cell_px) - x0, height = ceil(high[1] / cell_px) - y0;
    if (!(width * height <= BST_RESOLVED_CELLS_MAX) || fabs(x0) > 1e9 || fabs(y0) > 1e9) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "the image of a satellite has %.3g x %.3g px, which are %.3g million cells "
                        "(allowed: %d million); use a larger range or coarser pixels",
                        width * cell_px, height * cell_px, 1e-6 * width * height,
                        BST_RESOLVED_CELLS_MAX >> 20);
    }
    m->cell_px = cell_px;
    m->x0 = (int)x0;
    m->y0 = (int)y0;
    m->width = width < 1.0 ? 1 : (int)width;
    m->height = height < 1.0 ? 1 : (int)height;
    size_t need = (size_t)m->width * (size_t)m->height;
    if (need > r->cell_capacity) {
        free(m->cells);
        free(m->part);
        m->cells = malloc(need * sizeof *m->cells);
        m->part = malloc(need * sizeof *m->part);
        r->cell_capacity = m->cells && m->part ? need : 0;
        if (r->cell_capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells",
                            m->width, m->height);
        }
    }
    memset(m->cells, 0, need * sizeof *m->cells);
    memset(m->part, -1, need * sizeof *m->part);
    return bst_visible_surface_begin(ctx, &r->surface, m->width, m->height);
}

/* One pose that is added. */
typedef struct adding {
    bst_resolved *r;
    bst_satellite_pose *pose;
    const bst_resolved_view *view;
    const bst_resolved_light *light;
    bst_mat3 image_from_body;
    bst_vec3 eye_m; /* body frame */
    double per_m;   /* cells per metre at one metre */
    double scale;   /* of the current curved surface, see bst_curved_facet_scale */
    bool earth;
} adding;

/* A point of the image plane, in cells; *depth_m: along the boresight. */
static bst_point2 project(const adding *a, bst_vec3 p, double *depth_m) {
    bst_vec3 q = bst_vec3_add(a->view->origin_m, bst_mat3_mul_vec(&a->image_from_body, p));
    double f = a->per_m / q.z;
    *depth_m = q.z;
    return (bst_point2){q.x * f - a->r->image.x0, q.y * f - a->r->image.y0};
}

/* A facet in the image. */
typedef struct face {
    bst_point2 corner[BST_COVERAGE_CORNERS_MAX];
    int count, part, curved;
    bst_vec3 plane;            /* depth at (x, y, 1) in cells: 1 over the scalar product */
    double near_m, far_m;      /* depths of the corners */
    int low[2], width, height; /* box in cells */
    /* change of the light per cell from the middle, per cell, and its limits; all 0: none */
    double slope[2], middle[2], least, most;
} face;

/* Light per cell: where Sun and Earth light the facet, and everywhere. */
typedef struct shading {
    double sun, earth, uniform;
    double sun_change[2]; /* across a part of a curved surface, around and up */
} shading;

/* Sets corners and depths of a facet in the image; false: it shows its back. */
static bool make_face(const adding *a, const bst_vec3 *corner, int count, bst_vec3 normal,
                      face *out) {
    bst_vec3 from = bst_vec3_sub(a->eye_m, corner[0]);
    double before_m = bst_vec3_dot(normal, from);
    if (!(before_m > 1e-9 * bst_vec3_norm(from))) {
        return false;
    }
    out->count = count;
    out->slope[0] = out->slope[1] = out->least = out->most = 0.0;
    out->middle[0] = out->middle[1] = 0.0;
    out->near_m = INFINITY;
    out->far_m = 0.0;
    for (int i = 0; i < count; i++) {
        double depth_m;
        out->corner[i] = project(a, corner[i], &depth_m);
        out->near_m = fmin(out->near_m, depth_m);
        out->far_m = fmax(out->far_m, depth_m);
    }
    /* n . (eye + depth d) = n . corner, d = (x, y, 1) in tangents */
    bst_vec3 n = bst_mat3_mul_vec(&a->image_from_body, normal);
    double cell = 1.0 / a->per_m;
    const bst_resolved_image *m = &a->r->image;
    out->plane =
        bst_vec3_scale((bst_vec3){n.x * cell, n.y * cell, n.z + cell * (n.x * m->x0 + n.y * m->y0)},
                       -1.0 / before_m);
    return true;
}

static double depth_at(const face *f, double x, double y) {
    double inverse = f->plane.x * x + f->plane.y * y + f->plane.z;
    double depth_m = inverse > 0.0 ? 1.0 / inverse : f->far_m;
    return fmin(fmax(depth_m, f->near_m), f->far_m);
}

/* Solid angle of a cell in a direction. */
static double cell_sr(const adding *a, bst_vec3 point) {
    bst_vec3 q = bst_vec3_add(a->view->origin_m, bst_mat3_mul_vec(&a->image_from_body, point));
    double c = q.z / bst_vec3_norm(q);
    return c * c * c / (a->per_m * a->per_m);
}

/* Light per cell of a surface element where it is lit. */
static shading shade(const adding *a, int material, bst_vec3 point, bst_vec3 normal) {
    const bst_resolved_light *l = a->light;
    shading f = {0.0, 0.0, 0.0, {0.0, 0.0}};
    if (!l) {
        return f;
    }
    const bst_material *m = &a->r->satellite->materials[material];
    const bst_resolved_gain *gain = &l->gain[material];
    bst_vec3 eye = bst_vec3_unit(bst_vec3_sub(a->eye_m, point));
    double sr = cell_sr(a, point), out = fmin(fmax(bst_vec3_dot(normal, eye), 1e-4), 1.0);
    if (gain->sun > 0.0 && bst_vec3_dot(normal, l->sun) > 1e-9) {
        f.sun = gain->sun * sr * bst_facet_light(m, &a->r->disc, normal, eye) / out;
        f.sun = fmax(f.sun, 0.0);
    }
    double sum = 0.0;
    for (int i = 0; a->earth && gain->earth > 0.0 && i < l->earthlight->count; i++) {
        double in = bst_vec3_dot(normal, l->earthlight->direction[i]);
        if (in > 1e-9) {
            sum += l->earthlight->irradiance[i] * in *
                   bst_brdf_value(&m->brdf, fmin(in, 1.0), out,
                                  bst_vec3_dot(l->earthlight->direction[i], eye));
        }
    }
    f.earth = gain->earth * sr * sum * m->scale;
    f.uniform = gain->emission * sr;
    return f;
}

/* Exchanges the views, so that the first is that of the other light. */
static void swap_views(bst_satellite_pose *p) {
    bst_pose_view v = p->views[0];
    p->views[0] = p->views[1];
    p->views[1] = v;
}

/* Fraction of a facet that a light reaches; the pieces are in pose->clip if it is between 0 and 1.
 *
 * Given:     view  0: Sun; 1: earthlight */
static double lit_fraction(const adding *a, int facet, int view) {
    bool whole;
    double area_m2 = a->r->satellite->facets[facet].area_m2;
    if (view == 1) {
        swap_views(a->pose);
    }
    double lit_m2 = bst_pose_unshadowed(a->pose, facet, 1, &whole);
    if (view == 1) {
        swap_views(a->pose);
    }
    return whole || lit_m2 > (1.0 - 1e-9) * area_m2 ? 1.0
           : lit_m2 > 1e-9 * area_m2                ? lit_m2 / area_m2
                                                    : 0.0;
}

/* Covers the grid by a facet. */
static bst_status cover_face(bst_ctx *ctx, const adding *a, face *f) {
    bst_resolved *r = a->r;
    r->whole.count = 0;
    BST_TRY(bst_polygon_coverage_add(ctx, &r->whole, f->corner, f->count, r->image.width,
                                     r->image.height));
    int high[2] = {0, 0};
    f->low[0] = f->low[1] = INT32_MAX;
    for (int i = 0; i < r->whole.count; i++) {
        const bst_coverage_cell *c = &r->whole.cells[i];
        f->low[0] = c->x < f->low[0] ? c->x : f->low[0];
        f->low[1] = c->y < f->low[1] ? c->y : f->low[1];
        high[0] = c->x + c->run > high[0] ? c->x + c->run : high[0];
        high[1] = c->y >= high[1] ? c->y + 1 : high[1];
    }
    f->width = high[0] - f->low[0];
    f->height = high[1] - f->low[1];
    return BST_OK;
}

/* Empties the light of the facet's box. */
static bst_status clear_lit(bst_ctx *ctx, bst_resolved *r, const face *f) {
    size_t need = (size_t)f->width * (size_t)f->height;
    if (need > r->lit_capacity) {
        free(r->lit_cells);
        r->lit_cells = malloc(need * sizeof *r->lit_cells);
        r->lit_capacity = r->lit_cells ? need : 0;
        if (!r->lit_cells) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a facet of %d x %d cells", f->width,
                            f->height);
        }
    }
    memset(r->lit_cells, 0, need * sizeof *r->lit_cells);
    return BST_OK;
}

/* Adds the light of a polygon within the facet, in cells, to its box. */
static bst_status add_lit(bst_ctx *ctx, bst_resolved *r, const face *f, const bst_point2 *corner,
                          int count, double light) {
    r->lit.count = 0;
    BST_TRY(bst_polygon_coverage_add(ctx, &r->lit, corner, count, r->image.width, r->image.height));
    for (int i = 0; i < r->lit.count; i++) {
        const bst_coverage_cell *c = &r->lit.cells[i];
        int y = c->y - f->low[1];
        for (int x = c->x - f->low[0]; x < c->x - f->low[0] + c->run; x++) {
            if (x >= 0 && y >= 0 && x < f->width && y < f->height) {
                lit_cell *to = &r->lit_cells[(size_t)y * (size_t)f->width + (size_t)x];
                to->light += light * c->area;
                to->x += light * c->moment_x;
                to->y += light * c->moment_y;
            }
        }
    }
    return BST_OK;
}

/* Adds the light of a facet's lit pieces, in pose->clip, to its box. */
static bst_status add_pieces(bst_ctx *ctx, const adding *a, int facet, const face *f,
                             double light) {
    const bst_polygon_clip *clip = &a->pose->clip;
    bst_vec3 origin, e1, e2;
    bst_pose_facet_axes(a->pose, facet, &origin, &e1, &e2);
    for (int n = 0; n < clip->piece_count; n++) {
        const bst_polygon_piece *piece = &clip->pieces[n];
        bst_point2 corner[BST_COVERAGE_CORNERS_MAX];
        int count = piece->count < BST_COVERAGE_CORNERS_MAX ? piece->count : 0;
        for (int i = 0; i < count; i++) {
            bst_point2 p = clip->points[piece->first + i];
            double depth_m;
            corner[i] =
                project(a, bst_vec3_axpy(bst_vec3_axpy(origin, p.x, e1), p.y, e2), &depth_m);
        }
        BST_TRY(add_lit(ctx, a->r, f, corner, count, light));
    }
    return BST_OK;
}

/* Adds the fragments of a facet to the surface: a uniform light per cell and, with `pieces`, that
 * of its box. */
static bst_status add_fragments(bst_ctx *ctx, const adding *a, const face *f, double uniform,
                                bool pieces) {
    bst_resolved *r = a->r;
    double steep = 0.5 * (fabs(f->plane.x) + fabs(f->plane.y)); /* of 1 / depth, half a cell */
    for (int i = 0; i < r->whole.count; i++) {
        const bst_coverage_cell *c = &r->whole.cells[i];
        bst_surface_fragment piece = {.area = (float)c->area,
                                      .area_x = (float)c->moment_x,
                                      .area_y = (float)c->moment_y,
                                      .part = f->part,
                                      .curved = f->curved};
        double dx = c->moment_x / c->area, dy = c->moment_y / c->area;
        for (int x = c->x; x < c->x + c->run; x++) {
            bst_surface_fragment one = piece;
            double depth_m = depth_at(f, x + 0.5 + dx, c->y + 0.5 + dy);
            one.depth_m = (float)(depth_m - a->view->origin_m.z);
            one.reach_m = (float)fmin(steep * depth_m * depth_m, f->far_m - f->near_m);
            double more = f->slope[0] * (x + 0.5 + dx - f->middle[0]) +
                          f->slope[1] * (c->y + 0.5 + dy - f->middle[1]);
            double light = uniform + fmin(fmax(more, f->least), f->most);
            one.light = (float)(light * c->area);
            one.light_x = (float)(light * c->moment_x);
            one.light_y = (float)(light * c->moment_y);
            if (pieces) {
                size_t at = (size_t)(c->y - f->low[1]) * (size_t)f->width + (size_t)(x - f->low[0]);
                const lit_cell *lit = &r->lit_cells[at];
                one.light += (float)lit->light;
                one.light_x += (float)lit->x;
                one.light_y += (float)lit->y;
            }
            BST_TRY(bst_visible_surface_add(ctx, &r->surface, x, c->y, &one));
        }
    }
    return BST_OK;
}

/* Step between the corners of a circle's polygon at the limb, px: the polygon has the area of the
 * circle, and its borders are wrong by LIMB_PX. A circle in the image plane is wrong by step^2 /
 * (24 radius), the straight side of a cylinder by twice that. */
static const double LIMB_PX = 4e-5;

/* Step elsewhere, px. */
static const double STEP_PX = 0.5;

/* Largest angle of a part of a curved surface: the light of a part is that of its middle. */
static const double PART_RAD = 0.05;

/* Parts into which an arc is divided: at the limb, or elsewhere. */
static int parts_for(const adding *a, double radius_m, double angle, bst_vec3 at, bool limb) {
    double depth_m;
    (void)project(a, at, &depth_m);
    double radius_px = radius_m * a->per_m / depth_m * a->r->image.cell_px;
    double step_px = limb ? sqrt(12.0 * radius_px * LIMB_PX) : STEP_PX;
    double parts = fmax(angle * radius_px / step_px, angle / PART_RAD);
    return (int)fmin(ceil(parts - 1e-6), PARTS_MAX);
}

static bst_status add_plane_facet(bst_ctx *ctx, adding *a, int facet, face *f) {
    bst_resolved *r = a->r;
    const bst_facet *from = &r->satellite->facets[facet];
    bst_vec3 corner[BST_COVERAGE_CORNERS_MAX], middle = {0};
    bst_vec3 normal = a->pose->normals[facet];
    int around = 1, first = r->satellite->corner[from->first];
    if (r->places.rim[first] >= 0 && from->count > 4) {
        double angle = 2.0 * BST_PI / from->count;
        double side_m = bst_vec3_norm(bst_vec3_sub(
            a->pose->vertices[r->satellite->corner[from->first + 1]], a->pose->vertices[first]));
        around = parts_for(a, side_m / angle, angle, a->pose->vertices[first], true);
        int most = BST_COVERAGE_CORNERS_MAX / from->count;
        around = around < most ? around : most;
    }
    if (from->count * around > BST_COVERAGE_CORNERS_MAX) {
        around = 1;
    }
    int count = bst_plane_facet_corners(a->pose, &r->places, facet, around, corner);
    if (!make_face(a, corner, count, normal, f)) {
        return BST_OK;
    }
    BST_TRY(cover_face(ctx, a, f));
    if (r->whole.count == 0) {
        return BST_OK;
    }
    for (int i = 0; i < count; i++) {
        middle = bst_vec3_axpy(middle, 1.0 / count, corner[i]);
    }
    shading s = shade(a, from->material, middle, normal);
    const double light[2] = {s.sun, s.earth};
    bool pieces = false;
    for (int view = 0; view < 2; view++) {
        double lit = light[view] > 0.0 ? 1.0 : 0.0;
        /* light from below the horizon of the facet that is not from the centroid: no shadow */
        if (lit > 0.0 && (view == 0 || bst_vec3_dot(normal, a->light->earthlight->centre) > 0.05)) {
            lit = lit_fraction(a, facet, view);
        }
        if (lit >= 1.0) {
            s.uniform += light[view];
        } else if (lit > 0.0) {
            if (!pieces) {
                BST_TRY(clear_lit(ctx, r, f));
                pieces = true;
            }
            BST_TRY(add_pieces(ctx, a, facet, f, light[view]));
        }
    }
    return add_fragments(ctx, a, f, s.uniform, pieces);
}

/* Samples of a part of a curved facet for its light: more where the terminator crosses it or a lobe
 * is narrower than it is. */
static void samples_for(const adding *a, const bst_curved_facet *c, const double angle[2],
                        bst_vec3 normal, bst_vec3 eye, int samples[2]) {
    enum { LEAST = 2, TERMINATOR = 6, FINEST = 12 };
    double lobe = bst_brdf_lobe_rad(&a->r->satellite->materials[c->curved->material].brdf);
    double sum = angle[0] + angle[1];
    bst_vec3 half = bst_vec3_unit(bst_vec3_add(eye, a->light->sun));
    bool bright = bst_vec3_angle(half, normal) < sum + 8.0 * lobe;
    bool terminator = fabs(bst_vec3_dot(normal, a->light->sun)) < 0.5 * sum;
    for (int n = 0; n < 2; n++) {
        double wanted = bright ? ceil(angle[n] / (0.4 * lobe)) : 0.0;
        wanted = fmax(fmin(wanted, FINEST), terminator ? TERMINATOR : LEAST);
        samples[n] = angle[n] > 0.0 ? (int)wanted : 1;
    }
}

/* Mean light of a part of a curved facet. */
static shading shade_part(const adding *a, const bst_curved_facet *c, const int parts[2],
                          const int place[2], bst_vec3 middle) {
    int i = place[0], k = place[1], samples[2];
    shading mean = {0.0, 0.0, 0.0, {0.0, 0.0}};
    if (!a->light) {
        return mean;
    }
    double change[2] = {0.0, 0.0}, spread[2] = {0.0, 0.0};
    bool sphere = c->curved->sphere;
    const double angle[2] = {(c->azimuth[1] - c->azimuth[0]) / parts[0],
                             sphere ? (c->height[1] - c->height[0]) / parts[1] : 0.0};
    bst_vec3 eye = bst_vec3_unit(bst_vec3_sub(a->eye_m, middle));
    bst_vec3 normal = bst_curved_facet_normal(c, (i + 0.5) / parts[0], (k + 0.5) / parts[1]);
    samples_for(a, c, angle, normal, eye, samples);
    double weights = 0.0;
    for (int n = 0; n < samples[0] * samples[1]; n++) {
        double u = (i + (n % samples[0] + 0.5) / samples[0]) / parts[0];
        double v = (k + (n / samples[0] + 0.5) / samples[1]) / parts[1];
        normal = bst_curved_facet_normal(c, u, v);
        /* the projected area */
        double up = sphere ? bst_vec3_dot(normal, c->z) : 0.0;
        double weight = fmax(bst_vec3_dot(normal, eye), 1e-4) * sqrt(fmax(1.0 - up * up, 0.0));
        shading one = shade(a, c->curved->material, middle, normal);
        const double off[2] = {u * parts[0] - i - 0.5, v * parts[1] - k - 0.5};
        for (int m = 0; m < 2; m++) {
            change[m] += off[m] * one.sun;
            spread[m] += off[m] * off[m];
        }
        mean.sun += weight * one.sun;
        mean.earth += weight * one.earth;
        mean.uniform += weight * one.uniform;
        weights += weight;
    }
    double scale = weights > 0.0 ? 1.0 / weights : 0.0;
    for (int m = 0; m < 2; m++) {
        change[m] = spread[m] > 0.0 ? change[m] / spread[m] : 0.0;
    }
    return (shading){
        scale * mean.sun, scale * mean.earth, scale * mean.uniform, {change[0], change[1]}};
}

/* Sets the slope of the light of a part of a curved facet in the image, from its change across the
 * part. */
static void set_slope(const shading *s, face *f) {
    const bst_point2 *c = f->corner;
    double ux = 0.5 * (c[1].x - c[0].x + c[2].x - c[3].x);
    double uy = 0.5 * (c[1].y - c[0].y + c[2].y - c[3].y);
    double vx = 0.5 * (c[3].x - c[0].x + c[2].x - c[1].x);
    double vy = 0.5 * (c[3].y - c[0].y + c[2].y - c[1].y);
    double area = ux * vy - uy * vx, range = fabs(s->sun_change[0]) + fabs(s->sun_change[1]);
    /* seen edge-on, its mean is enough */
    if (fabs(area) > 1e-3 * (ux * ux + uy * uy + vx * vx + vy * vy)) {
        f->slope[0] = (s->sun_change[0] * vy - s->sun_change[1] * uy) / area;
        f->slope[1] = (s->sun_change[1] * ux - s->sun_change[0] * vx) / area;
    }
    f->middle[0] = 0.25 * (c[0].x + c[1].x + c[2].x + c[3].x);
    f->middle[1] = 0.25 * (c[0].y + c[1].y + c[2].y + c[3].y);
    f->most = 0.5 * range;
    f->least = -fmin(0.5 * range, s->sun);
}

/* A convex polygon with few corners. */
typedef struct small_polygon {
    bst_point2 p[BST_POLYGON_CORNERS_MAX + 8];
    int count;
} small_polygon;

/* Keeps what of a polygon is on the left of the line between two points. */
static void keep_left(small_polygon *polygon, bst_point2 from, bst_point2 to) {
    small_polygon kept = {.count = 0};
    for (int i = 0; i < polygon->count && kept.count < BST_POLYGON_CORNERS_MAX; i++) {
        bst_point2 u = polygon->p[i], v = polygon->p[i + 1 < polygon->count ? i + 1 : 0];
        double du = (to.x - from.x) * (u.y - from.y) - (to.y - from.y) * (u.x - from.x);
        double dv = (to.x - from.x) * (v.y - from.y) - (to.y - from.y) * (v.x - from.x);
        if (du >= 0.0) {
            kept.p[kept.count++] = u;
        }
        if ((du < 0.0) != (dv < 0.0)) {
            double t = du / (du - dv);
            kept.p[kept.count++] = (bst_point2){u.x + t * (v.x - u.x), u.y + t * (v.y - u.y)};
        }
    }
    polygon->count = kept.count;
    memcpy(polygon->p, kept.p, (size_t)kept.count * sizeof kept.p[0]);
}

/* Part (i, k) of a curved facet: its corners on the surface and in the facet's plane, both from low
 * left, low right, high right, high left. */
typedef struct curved_part {
    bst_vec3 corner[4];
    bst_point2 flat[4];
} curved_part;

/* Point of a part that stands for a point of the facet's plane: at the same fractions of width and
 * height. */
static bst_vec3 lift(const curved_part *part, bst_point2 p) {
    const bst_point2 *q = part->flat;
    bst_point2 low = {q[1].x - q[0].x, q[1].y - q[0].y}, high = {q[2].x - q[3].x, q[2].y - q[3].y};
    bst_point2 along =
        low.x * low.x + low.y * low.y > high.x * high.x + high.y * high.y ? low : high;
    double length = hypot(along.x, along.y);
    along = (bst_point2){along.x / length, along.y / length};
    double rise = along.x * (q[3].y - q[0].y) - along.y * (q[3].x - q[0].x);
    double v = (along.x * (p.y - q[0].y) - along.y * (p.x - q[0].x)) / rise;
    v = fmin(fmax(v, 0.0), 1.0);
    bst_point2 left = {q[0].x + v * (q[3].x - q[0].x), q[0].y + v * (q[3].y - q[0].y)};
    double width = hypot(low.x, low.y) + v * (hypot(high.x, high.y) - hypot(low.x, low.y));
    double u =
        width > 1e-9 * length ? ((p.x - left.x) * along.x + (p.y - left.y) * along.y) / width : 0.5;
    u = fmin(fmax(u, 0.0), 1.0);
    const bst_vec3 *c = part->corner;
    bst_vec3 l = bst_vec3_axpy(c[0], v, bst_vec3_sub(c[3], c[0]));
    bst_vec3 r = bst_vec3_axpy(c[1], v, bst_vec3_sub(c[2], c[1]));
    return bst_vec3_axpy(l, u, bst_vec3_sub(r, l));
}

/* Adds the light of a curved facet's lit pieces, in pose->clip, within one of its parts. */
static bst_status add_part_pieces(bst_ctx *ctx, const adding *a, const curved_part *part,
                                  const face *f, double light) {
    const bst_polygon_clip *clip = &a->pose->clip;
    bool turned = bst_polygon_area(part->flat, 4) < 0.0;
    for (int n = 0; n < clip->piece_count; n++) {
        const bst_polygon_piece *piece = &clip->pieces[n];
        small_polygon p = {.count = piece->count};
        if (piece->count > BST_POLYGON_CORNERS_MAX) {
            continue;
        }
        memcpy(p.p, clip->points + piece->first, (size_t)piece->count * sizeof p.p[0]);
        for (int e = 0; e < 4 && p.count > 2; e++) {
            int from = turned ? 3 - e : e, to = turned ? (from + 3) % 4 : (from + 1) % 4;
            keep_left(&p, part->flat[from], part->flat[to]);
        }
        for (int i = 0; i < p.count; i++) {
            double depth_m;
            p.p[i] = project(a, lift(part, p.p[i]), &depth_m);
        }
        if (p.count > 2) {
            BST_TRY(add_lit(ctx, a->r, f, p.p, p.count, light));
        }
    }
    return BST_OK;
}

/* Adds one part of a curved facet; with `pieces`, sunlight on the lit pieces only. */
static bst_status add_part(bst_ctx *ctx, const adding *a, const curved_part *part, double side,
                           const shading *s, bool pieces, face *f) {
    bst_vec3 normal = bst_vec3_cross(bst_vec3_sub(part->corner[2], part->corner[0]),
                                     bst_vec3_sub(part->corner[3], part->corner[1]));
    double length = bst_vec3_norm(normal);
    if (!(length > 0.0) ||
        !make_face(a, part->corner, 4, bst_vec3_scale(normal, side / length), f)) {
        return BST_OK;
    }
    BST_TRY(cover_face(ctx, a, f));
    if (!pieces && s->sun > 0.0) {
        set_slope(s, f);
    }
    if (a->r->whole.count > 0 && pieces && s->sun > 0.0) {
        BST_TRY(clear_lit(ctx, a->r, f));
        BST_TRY(add_part_pieces(ctx, a, part, f, s->sun));
        return add_fragments(ctx, a, f, s->earth + s->uniform, true);
    }
    return add_fragments(ctx, a, f, s->sun + s->earth + s->uniform, false);
}

/* A part of a curved facet that is divided into parts[0] x parts[1]. */
static void make_part(const adding *a, int facet, const bst_curved_facet *c, const int parts[2],
                      const int place[2], curved_part *out) {
    static const int one[2] = {1, 1}, first[2] = {0, 0};
    int i = place[0], k = place[1];
    bst_vec3 whole[4], origin, e1, e2;
    bst_curved_facet_part(c, parts, place, a->scale, out->corner);
    bst_curved_facet_part(c, one, first, bst_curved_facet_scale(c, 1, 1), whole);
    bst_pose_facet_axes(a->pose, facet, &origin, &e1, &e2);
    for (int n = 0; n < 4; n++) {
        double u = (double)(i + (n == 1 || n == 2)) / parts[0], v = (double)(k + n / 2) / parts[1];
        bst_vec3 left = bst_vec3_axpy(whole[0], v, bst_vec3_sub(whole[3], whole[0]));
        bst_vec3 right = bst_vec3_axpy(whole[1], v, bst_vec3_sub(whole[2], whole[1]));
        bst_vec3 q = bst_vec3_sub(bst_vec3_axpy(left, u, bst_vec3_sub(right, left)), origin);
        out->flat[n] = (bst_point2){bst_vec3_dot(q, e1), bst_vec3_dot(q, e2)};
    }
}

static bst_status add_curved_facet(bst_ctx *ctx, adding *a, int facet, face *f) {
    const bst_facet *from = &a->r->satellite->facets[facet];
    bst_vec3 normal = a->pose->normals[facet];
    bst_curved_facet c;
    bst_curved_facet_make(a->pose, &a->r->places, facet, &c);
    bst_vec3 first = a->pose->vertices[a->r->satellite->corner[from->first]];
    double radius_m = c.curved->sphere ? c.curved->radius_m : fmax(c.radius_m[0], c.radius_m[1]);
    double turn = c.azimuth[1] - c.azimuth[0], rise = c.height[1] - c.height[0];
    int parts[2] = {parts_for(a, radius_m, turn, first, false), 1};
    int fine[2] = {parts_for(a, radius_m, turn, first, true), 1};
    double half = 0.5 * turn / parts[0];
    if (c.curved->sphere) {
        parts[1] = parts_for(a, radius_m, rise, first, false);
        fine[1] = parts_for(a, radius_m, rise, first, true);
        half = 0.5 * hypot(turn / parts[0], rise / parts[1]);
    }
    const double scale[2] = {
        /* where large and small parts of a sphere meet, gaps and overlaps have the same area */
        c.curved->sphere ? sqrt(bst_curved_facet_scale(&c, parts[0], parts[1]))
                         : bst_curved_facet_scale(&c, fine[0], fine[1]),
        bst_curved_facet_scale(&c, fine[0], fine[1])};
    for (int n = 0; n < 2; n++) { /* parts of parts at limb and terminator */
        fine[n] = (fine[n] + parts[n] - 1) / parts[n];
    }
    /* the direction to the observer differs over a facet by this */
    double near = radius_m / bst_vec3_norm(bst_vec3_sub(a->eye_m, first));
    double lit[2] = {1.0, 1.0};
    bool split = false;
    for (int view = 1; view >= 0 && a->light; view--) { /* the Sun's pieces remain */
        bst_vec3 direction = view == 0  ? a->light->sun
                             : a->earth ? a->light->earthlight->centre
                                        : (bst_vec3){0};
        /* at grazing incidence the true surface, not its facet, decides */
        if (bst_vec3_dot(normal, direction) > 0.02) {
            lit[view] = lit_fraction(a, facet, view);
            split = view == 0 && lit[0] > 0.0 && lit[0] < 1.0;
        }
    }
    for (int n = 0; n < parts[0] * parts[1]; n++) {
        int i = n % parts[0], k = n / parts[0];
        bst_vec3 outward = bst_curved_facet_normal(&c, (i + 0.5) / parts[0], (k + 0.5) / parts[1]);
        double up = bst_vec3_dot(outward, bst_vec3_unit(bst_vec3_sub(a->eye_m, first)));
        bool limb = fabs(up) < 2.5 * half + near;
        if (up < 0.0 && !limb) {
            continue; /* shows its back */
        }
        limb = limb || (a->light && fabs(bst_vec3_dot(outward, a->light->sun)) < 1.2 * half);
        int divide[2] = {limb ? fine[0] : 1, limb ? fine[1] : 1};
        a->scale = scale[limb];
        int all[2] = {parts[0] * divide[0], parts[1] * divide[1]};
        for (int m = 0; m < divide[0] * divide[1]; m++) {
            int place[2] = {i * divide[0] + m % divide[0], k * divide[1] + m / divide[0]};
            curved_part part;
            make_part(a, facet, &c, all, place, &part);
            bst_vec3 middle = bst_vec3_scale(bst_vec3_add(part.corner[0], part.corner[2]), 0.5);
            shading s = shade_part(a, &c, all, place, middle);
            for (int v = 0; v < 2; v++) {
                s.sun_change[v] *= split ? 1.0 : lit[0];
            }
            s.sun *= split ? 1.0 : lit[0];
            s.earth *= lit[1];
            BST_TRY(add_part(ctx, a, &part, c.curved->side, &s, split, f));
        }
    }
    return BST_OK;
}

bst_status bst_resolved_add(bst_ctx *ctx, bst_resolved *r, bst_satellite_pose *pose,
                            const bst_resolved_view *view, const bst_resolved_light *light,
                            double weight, double *total) {
    const bst_satellite *sat = r->satellite;
    assert(pose->satellite == sat && r->image.width > 0);
    adding a = {.r = r,
                .pose = pose,
                .view = view,
                .light = light,
                .image_from_body = bst_quat_to_mat3(view->q_image_from_body),
                .per_m = 1.0 / (view->scale_rad * r->image.cell_px)};
    a.eye_m = bst_vec3_scale(bst_mat3_transpose_mul_vec(&a.image_from_body, view->origin_m), -1.0);
    if (light) {
        a.earth = light->earthlight && light->earthlight->count > 0;
        bst_sun_disc_make(light->sun, light->sun_radius_rad, sat->lobe_rad, &r->disc);
        bst_pose_look(pose, 0, light->sun);
        if (a.earth) {
            bst_pose_look(pose, 1, light->earthlight->centre);
        }
    }
    face f;
    for (int i = 0; i < sat->facet_count; i++) {
        f.part = sat->facets[i].part;
        f.curved = sat->facets[i].curved;
        BST_TRY(sat->facets[i].curved >= 0 ? add_curved_facet(ctx, &a, i, &f)
                                           : add_plane_facet(ctx, &a, i, &f));
    }
    /* bodies closer than that are one surface */
    double gap_m = 0.5 * bst_vec3_norm(view->origin_m) / a.per_m;
    double sum = bst_visible_surface_resolve(&r->surface, gap_m, weight, &r->image);
    if (total) {
        *total = sum;
    }
    return BST_OK;
}
