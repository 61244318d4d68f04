#include "sim/world/scene/body_limb.h"

#include <math.h>

#include "sim/astro/earth_limb.h"

/* Observer and body at a time, in coordinates in which the Earth is the unit sphere: a ray from
 * `eye` along d meets it if (eye . d)^2 > (|eye|^2 - 1) |d|^2. */
typedef struct sight {
    bst_vec3 geometric; /* unit, GCRF */
    bst_vec3 eye;
    double outside; /* |eye|^2 - 1 */
} sight;

/* Finds it. False: the body is before the limb, or the observer is on the ground. */
static bool sight_at(const bst_scene_source *source, double u, sight *out) {
    const bst_scene_source_body *b = source->body;
    double v = source->body_u[0] + u * (source->body_u[1] - source->body_u[0]);
    bst_vec3 eye_m = bst_scene_source_place(&b->eye, v);
    bst_vec3 way_m;
    if (source->path) {
        way_m = bst_vec3_add(bst_scene_source_place(source->path, u), b->lag_m);
    } else {
        bst_vec3 moved = bst_vec3_sub(b->object_m[1], b->object_m[0]);
        way_m = bst_vec3_sub(bst_vec3_axpy(b->object_m[0], v, moved), eye_m);
    }
    bst_vec3 way = bst_earth_unit_sphere(way_m, b->pole, 0.0);
    out->geometric = bst_vec3_unit(way_m);
    out->eye = bst_earth_unit_sphere(eye_m, b->pole, 0.0);
    out->outside = bst_vec3_dot(out->eye, out->eye) - 1.0;
    /* beyond the place of the way that is next to the Earth */
    double nearest = -bst_vec3_dot(out->eye, way);
    return out->outside > 0.0 && nearest > 0.0 && nearest < bst_vec3_dot(way, way);
}

/* The Earth in a plane of directions a + x b + y c, in coordinates of the unit sphere:
 * f(x, y) = (eye . d)^2 - outside |d|^2 is positive within it. */
typedef struct plane {
    const sight *s;
    bst_vec3 d[3]; /* a, b, c */
    double e[3];   /* eye . d */
} plane;

static plane make_plane(const sight *s, bst_vec3 pole, bst_vec3 a, bst_vec3 b, bst_vec3 c) {
    plane p = {.s = s,
               .d = {bst_earth_unit_sphere(a, pole, 0.0), bst_earth_unit_sphere(b, pole, 0.0),
                     bst_earth_unit_sphere(c, pole, 0.0)}};
    for (int i = 0; i < 3; i++) {
        p.e[i] = bst_vec3_dot(s->eye, p.d[i]);
    }
    return p;
}

/* The bilinear form of f of two directions of the plane. */
static double form(const plane *p, const double g[3], const double h[3]) {
    bst_vec3 u = {0}, v = {0};
    double eu = 0.0, ev = 0.0;
    for (int i = 0; i < 3; i++) {
        u = bst_vec3_axpy(u, g[i], p->d[i]);
        v = bst_vec3_axpy(v, h[i], p->d[i]);
        eu += g[i] * p->e[i];
        ev += h[i] * p->e[i];
    }
    return eu * ev - p->s->outside * bst_vec3_dot(u, v);
}

/* Direction in the plane out of the Earth at a place. False: none. */
static bool outward(const plane *p, bst_point2 at, bst_point2 *out) {
    const double here[3] = {1.0, at.x, at.y}, x[3] = {0.0, 1.0, 0.0}, y[3] = {0.0, 0.0, 1.0};
    double gx = form(p, here, x), gy = form(p, here, y), length = hypot(gx, gy);
    *out = (bst_point2){-gx / length, -gy / length};
    return length > 0.0;
}

/* Distance from a place to the limb along a direction: positive from within the Earth. False: the
 * line misses it. */
static bool limb_along(const plane *p, bst_point2 from, bst_point2 way, double *out) {
    const double here[3] = {1.0, from.x, from.y}, step[3] = {0.0, way.x, way.y};
    double c = form(p, here, here), b = -form(p, here, step), a = form(p, step, step);
    double root = b * b - a * c;
    if (!(root >= 0.0) || !(b > 0.0)) {
        return false;
    }
    *out = c / (b + sqrt(root));
    return true;
}

double bst_body_limb_behind(const bst_scene_source *source, double u) {
    sight s;
    bst_point2 out;
    double behind;
    if (!source->body->limb || !sight_at(source, u, &s)) {
        return -INFINITY;
    }
    bst_vec3 x = bst_vec3_perpendicular(s.geometric), y = bst_vec3_cross(s.geometric, x);
    plane p = make_plane(&s, source->body->pole, s.geometric, x, y);
    const bst_point2 origin = {0.0, 0.0};
    return outward(&p, origin, &out) && limb_along(&p, origin, out, &behind) ? behind : -INFINITY;
}

bool bst_body_limb_hidden(const bst_scene_source *source, double u, const bst_body_limb_view *view,
                          bst_resolved_hidden *out) {
    enum { CHORDS = BST_RESOLVED_HIDDEN_CORNERS - 3 };
    const double BEND_PX = 1e-5; /* of the limb from a chord */
    sight s;
    double behind;
    bst_point2 away;
    out->count = 0;
    if (!source->body->limb || !sight_at(source, u, &s)) {
        return false;
    }
    bst_vec3 apparent = bst_vec3_unit(bst_scene_source_direction(source, u));
    bst_vec3 place = bst_quat_rotate(view->q_image_from_gcrf, apparent);
    if (!(place.z > 0.0)) {
        return false;
    }
    double range_m =
        source->path ? bst_vec3_norm(bst_scene_source_place(source->path, u)) : source->range_m;
    /* px about the body's image, which is longer off the boresight and, near by, in perspective */
    double per_px = view->scale_rad, stretch = 1.5 / (place.z * place.z);
    double reach = stretch * source->body->satellite->radius_m / range_m / per_px;
    bst_quat turn = bst_quat_from_rotvec(bst_vec3_cross(apparent, s.geometric));
    bst_quat back = bst_quat_mul(turn, bst_quat_conj(view->q_image_from_gcrf));
    plane p = make_plane(&s, source->body->pole,
                         bst_quat_rotate(back, bst_vec3_scale(place, 1.0 / place.z)),
                         bst_quat_rotate(back, (bst_vec3){per_px, 0.0, 0.0}),
                         bst_quat_rotate(back, (bst_vec3){0.0, per_px, 0.0}));
    const bst_point2 origin = {0.0, 0.0};
    if (!outward(&p, origin, &away) || !limb_along(&p, origin, away, &behind) || behind < -reach) {
        return false;
    }
    bst_point2 along = {away.y, -away.x}; /* from it to `away` by a right angle counter-clockwise */
    bst_point2 middle = {place.x / (place.z * per_px), place.y / (place.z * per_px)};
    double wide = 2.0 * reach, side;
    const bst_point2 end = {wide * along.x, wide * along.y};
    if (!limb_along(&p, end, away, &side)) {
        return false;
    }
    int chords = (int)fmin(fmax(ceil(sqrt(fabs(behind - side) / BEND_PX)), 1.0), CHORDS);
    for (int i = 0; i < chords + 3; i++) {
        /* along the limb, then back at a distance within the Earth */
        double t = i <= chords ? wide * (1.0 - 2.0 * i / chords) : i == chords + 1 ? -wide : wide;
        double depth = -3.0 * reach;
        bst_point2 from = {t * along.x, t * along.y};
        if (i <= chords && !limb_along(&p, from, away, &depth)) {
            return false;
        }
        depth = fmin(depth, 3.0 * reach);
        out->corner[out->count++] =
            (bst_point2){middle.x + from.x + depth * away.x, middle.y + from.y + depth * away.y};
    }
    return true;
}

bst_body_limb_kind bst_body_limb_during(const bst_scene_source *source) {
    enum { TIMES = 9 };
    double least = INFINITY, most = -INFINITY, step = 0.0, before = 0.0, nearest_m = INFINITY;
    bool before_earth = false;
    for (int k = 0; k < TIMES; k++) {
        double u = (double)k / (TIMES - 1), behind = bst_body_limb_behind(source, u);
        before_earth = before_earth || isinf(behind);
        step = k > 0 ? fmax(step, fabs(behind - before)) : step;
        least = fmin(least, behind);
        most = fmax(most, behind);
        before = behind;
        nearest_m =
            fmin(nearest_m, source->path ? bst_vec3_norm(bst_scene_source_place(source->path, u))
                                         : source->range_m);
    }
    double radius = 1.1 * source->body->satellite->radius_m / nearest_m;
    if (before_earth || most + step < -radius) {
        return BST_BODY_LIMB_FAR;
    }
    return least - step > radius ? BST_BODY_LIMB_HIDES : BST_BODY_LIMB_CUTS;
}
