#include "sim/satellite/resolved_faces.h"

#include <stdlib.h>
#include <string.h>

#include "sim/satellite/part_shadow.h"
#include "sim/satellite/polygon_cut.h"

bst_point2 bst_resolved_project(const bst_resolved_adding *a, bst_vec3 p, double *depth_m) {
    bst_vec3 q = bst_vec3_add(a->view->origin_m, bst_mat3_mul_vec(&a->image_from_body, p));
    double f = a->per_m / q.z;
    *depth_m = q.z;
    return (bst_point2){q.x * f - a->r->image.x0, q.y * f - a->r->image.y0};
}

bool bst_resolved_make_face(const bst_resolved_adding *a, const bst_vec3 *corner, int count,
                            bst_vec3 normal, bst_resolved_face *out) {
    bst_vec3 from = bst_vec3_sub(a->eye_m, corner[0]);
    double before_m = bst_vec3_dot(normal, from);
    if (!(before_m > 1e-9 * bst_vec3_norm(from))) {
        return false;
    }
    out->count = count;
    out->slope[0] = out->slope[1] = out->least = out->most = 0.0;
    out->middle[0] = out->middle[1] = 0.0;
    for (int i = 0; i < count; i++) {
        double depth_m;
        out->corner[i] = bst_resolved_project(a, corner[i], &depth_m);
    }
    /* n . (eye + depth d) = n . corner, d = (x, y, 1) in tangents: 1 over the depth is linear. The
     * origin's is subtracted before it is multiplied by the square of its depth */
    bst_vec3 n = bst_mat3_mul_vec(&a->image_from_body, normal);
    double cell = 1.0 / a->per_m;
    const bst_resolved_image *m = &a->r->image;
    double origin_m = a->view->origin_m.z, by = -origin_m / before_m;
    out->plane.x = origin_m * by * n.x * cell;
    out->plane.y = origin_m * by * n.y * cell;
    out->plane.z = origin_m * (by * (n.z + cell * (n.x * m->x0 + n.y * m->y0)) - 1.0);
    return true;
}

bst_resolved_shading bst_resolved_shade(const bst_resolved_adding *a, int material, bst_vec3 point,
                                        bst_vec3 normal) {
    const bst_resolved_light *l = a->light;
    bst_resolved_shading f = {0.0, 0.0, 0.0, {0.0, 0.0}};
    if (!l) {
        return f;
    }
    const bst_material *m = &a->r->satellite->materials[material];
    const bst_resolved_gain *gain = &l->gain[material];
    bst_vec3 eye = bst_vec3_unit(bst_vec3_sub(a->eye_m, point));
    double sr = 1.0 / (a->per_m * a->per_m), out = fmin(fmax(bst_vec3_dot(normal, eye), 1e-4), 1.0);
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

void bst_resolved_note_light(const bst_resolved_adding *a, const bst_resolved_shading *light,
                             bool round) {
    bst_resolved_image *m = &a->r->image;
    double per_px = (light->sun + light->earth + light->uniform) / (m->cell_px * m->cell_px);
    m->surface_light = fmax(m->surface_light, per_px);
    m->curved_light = round ? fmax(m->curved_light, per_px) : m->curved_light;
}

/* Exchanges the views, so that the first is that of the other light. */
static void swap_views(bst_satellite_pose *p) {
    bst_pose_view v = p->views[0];
    p->views[0] = p->views[1];
    p->views[1] = v;
}

double bst_resolved_lit_fraction(const bst_resolved_adding *a, int facet, int view) {
    bool whole;
    double area_m2 = a->r->satellite->facets[facet].area_m2;
    if (view == 0 && !(bst_vec3_dot(a->pose->normals[facet], a->pose->views[0].z) > 1e-9)) {
        return 1.0; /* the Sun's centre lights it at grazing incidence, that point does not */
    }
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

bst_status bst_resolved_reach(bst_ctx *ctx, const bst_resolved_adding *a) {
    bst_resolved *r = a->r;
    const bst_satellite *sat = r->satellite;
    /* facets of curved surfaces are divided, so that they reach beyond the body's corners by less
     * than this share of its size */
    static const double BEYOND = 0.015;
    if (sat->occluder_count > BST_SEPARATION_BODIES) {
        return BST_OK;
    }
    for (int o = 0; o < sat->occluder_count; o++) {
        const bst_occluder *body = &sat->occluders[o];
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        for (int i = 0; i < body->vertex_count; i++) {
            double depth_m;
            bst_point2 p =
                bst_resolved_project(a, a->pose->vertices[body->first_vertex + i], &depth_m);
            r->outline[i] = p;
            low[0] = fmin(low[0], p.x);
            low[1] = fmin(low[1], p.y);
            high[0] = fmax(high[0], p.x);
            high[1] = fmax(high[1], p.y);
        }
        double room = BEYOND * fmax(high[0] - low[0], high[1] - low[1]) + 1e-3;
        for (int i = body->vertex_count - 1; i >= 0; i--) { /* a square about each */
            bst_point2 p = r->outline[i];
            for (int k = 0; k < 4; k++) {
                r->outline[4 * i + k] =
                    (bst_point2){p.x + (k & 1 ? room : -room), p.y + (k & 2 ? room : -room)};
            }
        }
        int n = bst_polygon_hull(r->outline, 4 * body->vertex_count, r->hull);
        bst_polygon_coverage_clear(&r->whole);
        BST_TRY(bst_polygon_coverage_add(ctx, &r->whole, r->hull,
                                         n < BST_COVERAGE_CORNERS_MAX ? n : 0, r->image.width,
                                         r->image.height));
        for (int i = 0; i < r->whole.count; i++) {
            const bst_coverage_cell *c = &r->whole.cells[i];
            for (int x = c->x; x < c->x + c->run; x++) {
                /* the two sides of a shell hide each other */
                bst_visible_surface_reach(&r->surface, x, c->y, body->shell >= 0 ? -1 : 2 * o);
            }
        }
    }
    return BST_OK;
}

bst_status bst_resolved_cover_face(bst_ctx *ctx, const bst_resolved_adding *a,
                                   bst_resolved_face *f) {
    bst_resolved *r = a->r;
    bst_polygon_coverage_clear(&r->whole);
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

static bst_resolved_lit_cell *lit_cell(bst_resolved *r, const bst_resolved_face *f, int x, int y) {
    return &r->lit_cells[(size_t)(y - f->low[1]) * (size_t)f->width + (size_t)(x - f->low[0])];
}

bst_status bst_resolved_clear_lit(bst_ctx *ctx, bst_resolved *r, const bst_resolved_face *f) {
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
    for (int i = 0; i < r->whole.count; i++) {
        const bst_coverage_cell *c = &r->whole.cells[i];
        for (int x = c->x; x < c->x + c->run; x++) {
            lit_cell(r, f, x, c->y)->area = c->area;
        }
    }
    return BST_OK;
}

/* A fragment of a facet. */
static bst_surface_fragment fragment_of(const bst_resolved_face *f, const bst_coverage_cell *c,
                                        int x, double light) {
    double middle_m = f->plane.x * (x + 0.5) + f->plane.y * (c->y + 0.5) + f->plane.z;
    return (bst_surface_fragment){.near = {(float)middle_m, (float)f->plane.x, (float)f->plane.y},
                                  .area = (float)c->area,
                                  .area_x = (float)c->moment_x,
                                  .area_y = (float)c->moment_y,
                                  .light = (float)light,
                                  .part = (int16_t)f->part,
                                  .body = f->body};
}

bst_status bst_resolved_add_lit(bst_ctx *ctx, bst_resolved *r, const bst_resolved_face *f,
                                const bst_point2 *corner, int count, double light) {
    bst_polygon_coverage_clear(&r->lit);
    BST_TRY(bst_polygon_coverage_add(ctx, &r->lit, corner, count, r->image.width, r->image.height));
    for (int i = 0; i < r->lit.count; i++) {
        const bst_coverage_cell *c = &r->lit.cells[i];
        for (int x = c->x; x < c->x + c->run; x++) {
            if (x < f->low[0] || c->y < f->low[1] || x >= f->low[0] + f->width ||
                c->y >= f->low[1] + f->height) {
                continue;
            }
            bst_resolved_lit_cell *to = lit_cell(r, f, x, c->y);
            if (c->area >= to->area - 1e-7) {
                to->light += light;
            } else {
                bst_surface_fragment one = fragment_of(f, c, x, light);
                one.more_light = true;
                BST_TRY(bst_visible_surface_add(ctx, &r->surface, x, c->y, &one,
                                                r->lit.corners + c->first, c->count));
            }
        }
    }
    return BST_OK;
}

/* Adds the light of a facet's lit pieces, in pose->clip, to its box. */
static bst_status add_pieces(bst_ctx *ctx, const bst_resolved_adding *a, int facet,
                             const bst_resolved_face *f, double light) {
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
            corner[i] = bst_resolved_project(
                a, bst_vec3_axpy(bst_vec3_axpy(origin, p.x, e1), p.y, e2), &depth_m);
        }
        BST_TRY(bst_resolved_add_lit(ctx, a->r, f, corner, count, light));
    }
    return BST_OK;
}

/* Sets a convex polygon that contains a facet with a round border: its own corners, by the sagitta
 * farther out. */
static int around_facet(const bst_resolved_adding *a, int facet, bst_vec3 *corner) {
    int count = bst_plane_facet_corners(a->pose, &a->r->places, facet, 1, corner);
    bst_vec3 middle = {0};
    double step = 2.0 * BST_PI / count;
    for (int i = 0; i < count; i++) {
        middle = bst_vec3_axpy(middle, 1.0 / count, corner[i]);
    }
    for (int i = 0; i < count; i++) {
        bst_vec3 r = bst_vec3_sub(corner[i], middle);
        corner[i] = bst_vec3_axpy(middle, 1.0 + step * step / 8.0, r);
    }
    return count;
}

/* Makes a polygon counter-clockwise. */
static void turn_left(bst_point2 *p, int count) {
    bool right = bst_polygon_area(p, count) < 0.0;
    for (int i = 0, k = count - 1; i < k && right; i++, k--) {
        bst_point2 swap = p[i];
        p[i] = p[k];
        p[k] = swap;
    }
}

/* Adds what a light reaches of a facet with a round border, of which the model's corners are not
 * those of the image.
 *
 * Returned:  *done  false: too many bodies */
static bst_status add_round_pieces(bst_ctx *ctx, const bst_resolved_adding *a, int facet, int view,
                                   const bst_resolved_face *f, double light, bool *done) {
    uint64_t hiders;
    bst_vec3 corner[BST_POLYGON_CORNERS_MAX], normal = a->pose->normals[facet];
    bst_point2 flat[BST_POLYGON_CORNERS_MAX], border[BST_COVERAGE_CORNERS_MAX];
    bst_point2 at[BST_POLYGON_CORNERS_MAX], kept[BST_POLYGON_INTERSECTION_MAX];
    bst_point2 work[BST_POLYGON_INTERSECTION_MAX];
    *done = bst_part_shadow_hiders(a->pose, view, facet, &hiders);
    if (!*done) {
        return BST_OK;
    }
    int count = around_facet(a, facet, corner);
    (void)bst_part_shadow_lit(a->pose, view, facet, hiders, corner, count, flat);
    const bst_polygon_clip *clip = &a->pose->clip;
    const bst_pose_view *v = &a->pose->views[view];
    double in = bst_vec3_dot(normal, v->z);
    memcpy(border, f->corner, (size_t)f->count * sizeof *border);
    turn_left(border, f->count);
    for (int n = 0; n < clip->piece_count; n++) {
        const bst_polygon_piece *piece = &clip->pieces[n];
        int corners = piece->count;
        if (corners < 3 || corners + f->count > BST_POLYGON_INTERSECTION_MAX) {
            continue;
        }
        for (int i = 0; i < corners; i++) {
            bst_point2 p = clip->points[piece->first + i];
            bst_vec3 q = bst_vec3_axpy(bst_vec3_scale(v->x, p.x), p.y, v->y);
            double way = bst_vec3_dot(normal, bst_vec3_sub(corner[0], q)) / in, depth_m;
            at[i] = bst_resolved_project(a, bst_vec3_axpy(q, way, v->z), &depth_m);
        }
        turn_left(at, corners);
        corners = bst_polygon_intersection(at, corners, border, f->count, work, kept);
        BST_TRY(bst_resolved_add_lit(ctx, a->r, f, kept, corners, light));
    }
    return BST_OK;
}

bst_status bst_resolved_add_fragments(bst_ctx *ctx, const bst_resolved_adding *a,
                                      const bst_resolved_face *f, double uniform, bool pieces) {
    bst_resolved *r = a->r;
    for (int i = 0; i < r->whole.count; i++) {
        const bst_coverage_cell *c = &r->whole.cells[i];
        double dx = c->moment_x / c->area, dy = c->moment_y / c->area;
        for (int x = c->x; x < c->x + c->run; x++) {
            double more = f->slope[0] * (x + 0.5 + dx - f->middle[0]) +
                          f->slope[1] * (c->y + 0.5 + dy - f->middle[1]);
            double light = uniform + fmin(fmax(more, f->least), f->most);
            light += pieces ? lit_cell(r, f, x, c->y)->light : 0.0;
            bst_surface_fragment one = fragment_of(f, c, x, light);
            BST_TRY(bst_visible_surface_add(ctx, &r->surface, x, c->y, &one,
                                            r->whole.corners + c->first, c->count));
        }
    }
    return BST_OK;
}

/* Largest angle of a part of a curved surface: the light of a part is that of its middle. */
static const double PART_RAD = 0.05;

/* The step between the corners of a circle's polygon is that of its error: the polygon has the area
 * of the circle. A circle in the image plane is wrong by step^2 / (24 radius), the straight side of
 * a cylinder by twice that. */
int bst_resolved_parts(const bst_resolved_adding *a, double radius_m, double angle, bst_vec3 at,
                       bool limb, int most) {
    const bst_resolved_view *v = a->view;
    double depth_m, error_px = v->curved_px > 0.0 ? v->curved_px : BST_RESOLVED_CURVED_PX;
    (void)bst_resolved_project(a, at, &depth_m);
    double radius_px = radius_m * a->per_m / depth_m * a->r->image.cell_px;
    if (limb) {
        error_px = fmin(v->limb_px > 0.0 ? v->limb_px : BST_RESOLVED_LIMB_PX, error_px);
    }
    double step_px = sqrt(12.0 * radius_px * error_px);
    double parts = fmax(angle * radius_px / step_px, angle / PART_RAD);
    if (parts > most) {
        double step = angle / most, *reached_px = &a->r->image.reached_px[limb];
        *reached_px = fmax(*reached_px, radius_px * step * step / 12.0);
    }
    return (int)fmin(ceil(parts - 1e-6), most);
}

/* Corners of a plane facet with a round border, at most: they fit with those of a lit piece. */
enum { ROUND_CORNERS = BST_POLYGON_INTERSECTION_MAX - BST_POLYGON_CORNERS_MAX };

bst_status bst_resolved_add_plane_facet(bst_ctx *ctx, bst_resolved_adding *a, int facet,
                                        bst_resolved_face *f) {
    bst_resolved *r = a->r;
    const bst_facet *from = &r->satellite->facets[facet];
    bst_vec3 corner[BST_COVERAGE_CORNERS_MAX], middle = {0};
    bst_vec3 normal = a->pose->normals[facet];
    int around = 1, first = r->satellite->corner[from->first];
    if (r->places.rim[first] >= 0 && from->count > 4) {
        double angle = 2.0 * BST_PI / from->count;
        double side_m = bst_vec3_norm(bst_vec3_sub(
            a->pose->vertices[r->satellite->corner[from->first + 1]], a->pose->vertices[first]));
        int most = ROUND_CORNERS / from->count;
        most = most < 1 ? 1 : most < BST_RESOLVED_PARTS_MAX ? most : BST_RESOLVED_PARTS_MAX;
        around = bst_resolved_parts(a, side_m / angle, angle, a->pose->vertices[first], true, most);
    }
    int count = bst_plane_facet_corners(a->pose, &r->places, facet, around, corner);
    if (!bst_resolved_make_face(a, corner, count, normal, f)) {
        return BST_OK;
    }
    BST_TRY(bst_resolved_cover_face(ctx, a, f));
    if (r->whole.count == 0) {
        return BST_OK;
    }
    for (int i = 0; i < count; i++) {
        middle = bst_vec3_axpy(middle, 1.0 / count, corner[i]);
    }
    bst_resolved_shading s = bst_resolved_shade(a, from->material, middle, normal);
    bst_resolved_note_light(a, &s, around > 1);
    const double light[2] = {s.sun, s.earth};
    bool pieces = false;
    for (int view = 0; view < 2; view++) {
        double lit = light[view] > 0.0 ? 1.0 : 0.0;
        /* light from below the horizon of the facet that is not from the centroid: no shadow */
        if (lit > 0.0 && (view == 0 || bst_vec3_dot(normal, a->light->earthlight->centre) > 0.05)) {
            lit = bst_resolved_lit_fraction(a, facet, view);
        }
        if (view == 0 && lit > 0.0 && lit < 1.0 && a->light->penumbrae) {
            bst_resolved_note_shadows_on(a, facet, middle, normal, s.sun, false);
        }
        if (lit >= 1.0) {
            s.uniform += light[view];
        } else if (lit > 0.0) {
            if (!pieces) {
                BST_TRY(bst_resolved_clear_lit(ctx, r, f));
                pieces = true;
            }
            bool done = false;
            if (around > 1) {
                BST_TRY(add_round_pieces(ctx, a, facet, view, f, light[view], &done));
            }
            if (!done) {
                BST_TRY(add_pieces(ctx, a, facet, f, light[view]));
            }
        }
    }
    return bst_resolved_add_fragments(ctx, a, f, s.uniform, pieces);
}
