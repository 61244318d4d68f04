/* Penumbrae: the point of the Sun's disc that casts the shadows, and how wide they are. */
#include "sim/satellite/pose_view.h"
#include "sim/satellite/resolved_faces.h"

bst_vec3 bst_resolved_shadow_sun(const bst_resolved_light *l) {
    if (l->shadow_at[0] == 0.0 && l->shadow_at[1] == 0.0) {
        return l->sun;
    }
    bst_vec3 right = bst_vec3_perpendicular(l->sun), up = bst_vec3_cross(l->sun, right);
    bst_vec3 at = bst_vec3_axpy(l->sun, l->sun_radius_rad * l->shadow_at[0], right);
    return bst_vec3_unit(bst_vec3_axpy(at, l->sun_radius_rad * l->shadow_at[1], up));
}

/* Least cosine of incidence: at less, the penumbra is as wide as the facet. */
static const double GRAZING = 0.005;
/* Distance from an outline, over the satellite's radius, and from a rim's circle, over its radius,
 * up to which a side lies on it: the model's rims have 12 corners or more, the image's 96. */
static const double BESIDE = 1e-6, BESIDE_RIM = 0.05;

/* Share of a length below which it is none. */
static const double TINY = 1e-9;

/* Keeps a width. */
static void keep(bst_resolved_image *m, double px, double light) {
    int octave = (int)fmin(fmax(floor(log2(px)) + 8.0, 0.0), BST_RESOLVED_PENUMBRAE - 1.0);
    bst_resolved_penumbra *p = &m->penumbrae[octave];
    p->light_px2 = fmax(p->light_px2, light / (m->cell_px * m->cell_px) * px * px);
    p->px = fmax(p->px, px);
}

/* Cotangent of the angle between two directions as seen along another one, at most MOST. */
static double cotangent(bst_vec3 a, bst_vec3 b, bst_vec3 eye) {
    static const double MOST = 8.0;
    a = bst_vec3_axpy(a, -bst_vec3_dot(a, eye), eye);
    b = bst_vec3_axpy(b, -bst_vec3_dot(b, eye), eye);
    double sine = bst_vec3_norm(bst_vec3_cross(a, b)), cosine = fabs(bst_vec3_dot(a, b));
    return cosine < MOST * sine ? cosine / sine : cosine > 0.0 ? MOST : 0.0;
}

/* Where the Sun is moved by d across the light, a shadow moves by gap (d - z (n . d) / (n . z)) on
 * the facet. Half the width of the penumbra is the largest motion across its border in the image,
 * of which d is on the Sun's limb. Where the border meets a side of the facet at an angle, the
 * corner moves along the side by the cotangent of that more than across the border: the error of
 * order n in the width there has n - 1 of it as factors, about.
 * tests/scenegen/test_penumbra_bound.c: 0.5 is too little with 7 points. */
void bst_resolved_note_shadow(const bst_resolved_adding *a, const bst_resolved_border *b) {
    static const double CORNER_POWER = 0.6;
    bst_resolved_image *m = &a->r->image;
    bst_vec3 z = a->light->sun, way[2], along = bst_vec3_sub(b->at[1], b->at[0]);
    bst_vec3 eye = bst_vec3_sub(a->eye_m, bst_vec3_axpy(b->at[0], 0.5, along));
    double range_m = bst_vec3_norm(eye), in = fmax(bst_vec3_dot(b->normal, z), GRAZING);
    if (!(a->light->sun_radius_rad > 0.0 && b->gap_m > 0.0 && b->light > 0.0)) {
        return;
    }
    eye = bst_vec3_scale(eye, 1.0 / range_m);
    way[0] = bst_vec3_perpendicular(z);
    way[1] = bst_vec3_cross(z, way[0]);
    for (int i = 0; i < 2; i++) {
        way[i] = bst_vec3_axpy(way[i], -bst_vec3_dot(b->normal, way[i]) / in, z);
        way[i] = bst_vec3_axpy(way[i], -bst_vec3_dot(way[i], eye), eye);
    }
    double xx = bst_vec3_dot(way[0], way[0]), yy = bst_vec3_dot(way[1], way[1]);
    double xy = bst_vec3_dot(way[0], way[1]);
    double largest = sqrt(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy));
    bst_vec3 across = bst_vec3_cross(eye, along);
    double length = bst_vec3_norm(across);
    if (length > TINY * a->r->satellite->radius_m) {
        across = bst_vec3_scale(across, 1.0 / length);
        largest = hypot(bst_vec3_dot(way[0], across), bst_vec3_dot(way[1], across));
    }
    double px = a->light->sun_radius_rad * b->gap_m * largest * a->per_m * m->cell_px / range_m;
    keep(m, px, b->light);
    for (int k = 0; k < 2; k++) {
        double cot = cotangent(along, b->side[k], eye);
        if (cot > 1.0 && b->change[k] > 0.0) {
            keep(m, px * pow(cot, CORNER_POWER), b->change[k]);
        }
    }
}

/* A side of what the Sun reaches of a plane, and its ends along the x and y of the view from the
 * Sun. */
typedef struct lit_side {
    bst_resolved_border border;
    bst_point2 flat[2];
} lit_side;

/* Sets the side of a plane facet that an end of a lit side is on. */
static void find_side(const bst_resolved_adding *a, int index, bst_resolved_border *b, int k) {
    const bst_satellite *sat = a->r->satellite;
    const bst_facet *facet = &sat->facets[index];
    for (int i = 0; i < facet->count; i++) {
        int next = i + 1 < facet->count ? i + 1 : 0;
        bst_vec3 p = a->pose->vertices[sat->corner[facet->first + i]];
        bst_vec3 way = bst_vec3_sub(a->pose->vertices[sat->corner[facet->first + next]], p);
        bst_vec3 off = bst_vec3_cross(way, bst_vec3_sub(b->at[k], p));
        if (bst_vec3_norm(off) <= BESIDE * sat->radius_m * bst_vec3_norm(way)) {
            b->side[k] = way;
            b->change[k] = b->light;
        }
    }
}

/* Nearness to the Sun of a corner of an outline, m: that of the nearest vertex there. */
static double depth_of(const bst_pose_view *v, const bst_occluder *o, bst_point2 corner) {
    double depth_m = -INFINITY;
    for (int i = o->first_vertex; i < o->first_vertex + o->vertex_count; i++) {
        if (v->flat[i].x == corner.x && v->flat[i].y == corner.y) {
            depth_m = fmax(depth_m, v->depth_m[i]);
        }
    }
    return depth_m;
}

/* Keeps the width of the penumbra where a lit side ends at the outline of a body. */
static void note_outline(const bst_resolved_adding *a, lit_side *s, int body) {
    const bst_pose_view *v = &a->pose->views[0];
    const bst_occluder *o = &a->r->satellite->occluders[body];
    const bst_point2 *outline;
    int count = bst_pose_outline(a->pose, 0, body, &outline);
    double beside_m = BESIDE * a->r->satellite->radius_m;
    double from_m = bst_vec3_dot(s->border.at[0], v->z), to_m = bst_vec3_dot(s->border.at[1], v->z);
    for (int i = 0; i < count; i++) {
        bst_point2 p = outline[i], q = outline[i + 1 < count ? i + 1 : 0];
        double length = hypot(q.x - p.x, q.y - p.y), t[2];
        if (!(length > beside_m) ||
            fabs(bst_point2_left_of(p, q, s->flat[0])) > beside_m * length ||
            fabs(bst_point2_left_of(p, q, s->flat[1])) > beside_m * length) {
            continue;
        }
        for (int k = 0; k < 2; k++) { /* along the outline's side */
            t[k] = (s->flat[k].x - p.x) * (q.x - p.x) + (s->flat[k].y - p.y) * (q.y - p.y);
            t[k] /= length * length;
        }
        double low = fmax(fmin(t[0], t[1]), 0.0), high = fmin(fmax(t[0], t[1]), 1.0);
        if (!(low < high)) {
            continue;
        }
        double near_m = depth_of(v, o, p), far_m = depth_of(v, o, q), gap_m = 0.0;
        for (int k = 0; k < 2; k++) {
            double at = k == 0 ? low : high, u = (at - t[0]) / (t[1] - t[0]);
            double above_m = near_m + at * (far_m - near_m);
            gap_m = fmax(gap_m, above_m - from_m - u * (to_m - from_m));
        }
        s->border.gap_m = gap_m;
        bst_resolved_note_shadow(a, &s->border);
    }
}

/* The same where it ends at the shadow of a shell's rim. */
static void note_rim(const bst_resolved_adding *a, lit_side *s, int shell) {
    const bst_pose_view *v = &a->pose->views[0];
    bst_pose_rim rim = bst_pose_rim_of(a->pose, v, shell);
    double radius_m = a->r->satellite->shells[shell].radius_m, gap_m = 0.0;
    for (int k = 0; k < 2; k++) {
        bst_vec3 r = bst_vec3_sub(s->border.at[k], rim.centre);
        double way = -bst_vec3_dot(r, rim.axis) / rim.rate;
        r = bst_vec3_axpy(r, way, v->z);
        if (!(rim.rate > 0.0 && fabs(bst_vec3_norm(r) - radius_m) < BESIDE_RIM * radius_m)) {
            return;
        }
        gap_m = fmax(gap_m, way);
    }
    s->border.gap_m = gap_m;
    bst_resolved_note_shadow(a, &s->border);
}

/* Keeps it for a side of what is lit of a facet. */
static void note_side(const bst_resolved_adding *a, int index, const double bounds[6],
                      lit_side *s) {
    const bst_satellite *sat = a->r->satellite;
    const bst_facet *facet = &sat->facets[index];
    for (int o = 0; o < sat->occluder_count; o++) {
        int shell = sat->occluders[o].shell;
        if ((o == facet->occluder && !facet->inside) ||
            !bst_pose_may_hide(a->pose->views[0].bounds[o], bounds)) {
            continue;
        }
        if (o != facet->occluder) {
            note_outline(a, s, o);
        }
        if (shell >= 0) {
            note_rim(a, s, shell);
        }
    }
}

void bst_resolved_note_shadows_on(const bst_resolved_adding *a, int index, bst_vec3 place,
                                  bst_vec3 normal, double light, bool flat) {
    const bst_satellite *sat = a->r->satellite;
    const bst_facet *facet = &sat->facets[index];
    const bst_pose_view *v = &a->pose->views[0];
    const bst_polygon_clip *clip = &a->pose->clip;
    double bounds[6], in = fmax(bst_vec3_dot(normal, v->z), GRAZING);
    bst_vec3 origin, e1, e2;
    bst_pose_facet_axes(a->pose, index, &origin, &e1, &e2);
    bst_pose_start_bounds(bounds);
    for (int i = 0; i < facet->count; i++) {
        bst_pose_add_to_bounds(v, sat->corner[facet->first + i], bounds);
    }
    for (int n = 0; n < clip->piece_count; n++) {
        const bst_polygon_piece *piece = &clip->pieces[n];
        for (int i = 0; i < piece->count; i++) {
            lit_side s = {.border = {.normal = normal, .light = light}};
            for (int k = 0; k < 2; k++) {
                int next = i + k < piece->count ? i + k : 0;
                bst_point2 p = clip->points[piece->first + next];
                bst_vec3 q = bst_vec3_axpy(bst_vec3_axpy(origin, p.x, e1), p.y, e2);
                if (flat) {
                    q = bst_vec3_axpy(bst_vec3_scale(v->x, p.x), p.y, v->y);
                    q = bst_vec3_axpy(q, bst_vec3_dot(normal, bst_vec3_sub(place, q)) / in, v->z);
                }
                s.border.at[k] = q;
                s.flat[k] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
                if (!flat) {
                    find_side(a, index, &s.border, k);
                }
            }
            note_side(a, index, bounds, &s);
        }
    }
}
