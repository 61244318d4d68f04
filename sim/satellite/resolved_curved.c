/* Facets of curved surfaces in the image. */
#include <string.h>

#include "sim/satellite/part_shadow.h"
#include "sim/satellite/resolved_faces.h"

/* Cosine of incidence on a facet below which its plane does not tell what is in shadow. */
static const double GRAZING = 0.02;

/* Samples of a part of a curved facet for its light: more where the terminator crosses it or a lobe
 * is narrower than it is. */
static void samples_for(const bst_resolved_adding *a, const bst_curved_facet *c,
                        const double angle[2], bst_vec3 normal, bst_vec3 eye, int samples[2]) {
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
static bst_resolved_shading shade_part(const bst_resolved_adding *a, const bst_curved_facet *c,
                                       const int parts[2], const int place[2], bst_vec3 middle) {
    int i = place[0], k = place[1], samples[2];
    bst_resolved_shading mean = {0.0, 0.0, 0.0, {0.0, 0.0}};
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
        bst_resolved_shading one = bst_resolved_shade(a, c->curved->material, middle, normal);
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
    return (bst_resolved_shading){
        scale * mean.sun, scale * mean.earth, scale * mean.uniform, {change[0], change[1]}};
}

/* Sets the slope of the light of a part of a curved facet in the image, from its change across the
 * part. */
static void set_slope(const bst_resolved_shading *s, bst_resolved_face *f) {
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
static bst_status add_part_pieces(bst_ctx *ctx, const bst_resolved_adding *a,
                                  const curved_part *part, const bst_resolved_face *f,
                                  double light) {
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
            p.p[i] = bst_resolved_project(a, lift(part, p.p[i]), &depth_m);
        }
        if (p.count > 2) {
            BST_TRY(bst_resolved_add_lit(ctx, a->r, f, p.p, p.count, light));
        }
    }
    return BST_OK;
}

/* Adds one part of a curved facet; with `pieces`, sunlight on the lit pieces only. */
static bst_status add_part(bst_ctx *ctx, const bst_resolved_adding *a, const curved_part *part,
                           double side, const bst_resolved_shading *s, bool pieces,
                           bst_resolved_face *f) {
    bst_vec3 normal = bst_vec3_cross(bst_vec3_sub(part->corner[2], part->corner[0]),
                                     bst_vec3_sub(part->corner[3], part->corner[1]));
    double length = bst_vec3_norm(normal);
    if (!(length > 0.0) ||
        !bst_resolved_make_face(a, part->corner, 4, bst_vec3_scale(normal, side / length), f)) {
        return BST_OK;
    }
    BST_TRY(bst_resolved_cover_face(ctx, a, f));
    if (!pieces && s->sun > 0.0) {
        set_slope(s, f);
    }
    if (a->r->whole.count > 0) {
        bst_resolved_note_light(a, s, true);
    }
    if (a->r->whole.count > 0 && pieces && s->sun > 0.0) {
        BST_TRY(bst_resolved_clear_lit(ctx, a->r, f));
        BST_TRY(add_part_pieces(ctx, a, part, f, s->sun));
        return bst_resolved_add_fragments(ctx, a, f, s->earth + s->uniform, true);
    }
    return bst_resolved_add_fragments(ctx, a, f, s->sun + s->earth + s->uniform, false);
}

/* A part of a curved facet that is divided into parts[0] x parts[1]. */
static void make_part(const bst_resolved_adding *a, int facet, const bst_curved_facet *c,
                      const int parts[2], const int place[2], curved_part *out) {
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

/* How a curved facet is divided, and what of it is lit. */
typedef struct curved_plan {
    bst_curved_facet c;
    int facet, parts[2], fine[2]; /* parts of the facet, and of parts at limb and terminator */
    double scale[2], half, near;  /* half: angle of half a part */
    bst_vec3 to_eye;
    /* what the Sun reaches: by part of those bodies, else of the whole facet, of which pose->clip
     * has the pieces if it is split */
    bool by_part, split;
    uint64_t hiders;
    double lit[2]; /* fraction that Sun and Earth reach */
} curved_plan;

static void divide(const bst_resolved_adding *a, int facet, curved_plan *p) {
    const bst_facet *from = &a->r->satellite->facets[facet];
    bst_vec3 first = a->pose->vertices[a->r->satellite->corner[from->first]];
    const bst_curved_facet *c = &p->c;
    bst_curved_facet_make(a->pose, &a->r->places, facet, &p->c);
    p->facet = facet;
    double radius_m =
        c->curved->sphere ? c->curved->radius_m : fmax(c->radius_m[0], c->radius_m[1]);
    const double angle[2] = {c->azimuth[1] - c->azimuth[0], c->height[1] - c->height[0]};
    const int most = c->curved->sphere ? BST_RESOLVED_PARTS_MAX : 4 * BST_RESOLVED_PARTS_MAX;
    for (int n = 0; n < 2; n++) {
        bool round = n == 0 || c->curved->sphere;
        p->parts[n] = round ? bst_resolved_parts(a, radius_m, angle[n], first, false, most) : 1;
        p->fine[n] = round ? bst_resolved_parts(a, radius_m, angle[n], first, true, most) : 1;
    }
    p->half = 0.5 * angle[0] / p->parts[0];
    p->scale[0] = p->scale[1] = bst_curved_facet_scale(c, p->fine[0], p->fine[1]);
    if (c->curved->sphere) {
        p->half = 0.5 * hypot(angle[0] / p->parts[0], angle[1] / p->parts[1]);
        /* where large and small parts of a sphere meet, gaps and overlaps have the same area */
        p->scale[0] = sqrt(bst_curved_facet_scale(c, p->parts[0], p->parts[1]));
    }
    for (int n = 0; n < 2; n++) {
        p->fine[n] = (p->fine[n] + p->parts[n] - 1) / p->parts[n];
    }
    bst_vec3 eye = bst_vec3_sub(a->eye_m, first);
    p->to_eye = bst_vec3_unit(eye);
    /* the direction to the observer differs over a facet by this */
    p->near = radius_m / bst_vec3_norm(eye);
}

/* Finds what the lights reach. */
static void find_lit(const bst_resolved_adding *a, curved_plan *p) {
    bst_vec3 normal = a->pose->normals[p->facet];
    p->lit[0] = p->lit[1] = 1.0;
    p->by_part = p->split = false;
    if (!a->light) {
        return;
    }
    /* at grazing incidence the true surface, not its facet, decides */
    if (a->earth && bst_vec3_dot(normal, a->light->earthlight->centre) > GRAZING) {
        p->lit[1] = bst_resolved_lit_fraction(a, p->facet, 1);
    }
    p->by_part = bst_part_shadow_hiders(a->pose, 0, p->facet, &p->hiders);
    if (!p->by_part && bst_vec3_dot(normal, a->light->sun) > GRAZING) {
        p->lit[0] = bst_resolved_lit_fraction(a, p->facet, 0); /* its pieces remain */
        p->split = p->lit[0] > 0.0 && p->lit[0] < 1.0;
    }
}

/* Adds a part with its light. */
static bst_status add_lit_part(bst_ctx *ctx, const bst_resolved_adding *a, const curved_plan *p,
                               const int all[2], const int place[2], bst_resolved_face *f) {
    curved_part part;
    make_part(a, p->facet, &p->c, all, place, &part);
    bst_vec3 middle = bst_vec3_scale(bst_vec3_add(part.corner[0], part.corner[2]), 0.5);
    bst_resolved_shading s = shade_part(a, &p->c, all, place, middle);
    bool split = p->split;
    double lit = split ? 1.0 : p->lit[0];
    if (p->by_part && p->hiders != 0 && s.sun > 0.0) {
        double fraction =
            bst_part_shadow_lit(a->pose, 0, p->facet, p->hiders, part.corner, 4, part.flat);
        split = fraction > 0.0 && fraction < 1.0;
        lit = split ? 1.0 : fraction;
    }
    if (split && a->light->penumbrae) {
        bst_vec3 normal =
            bst_curved_facet_normal(&p->c, (place[0] + 0.5) / all[0], (place[1] + 0.5) / all[1]);
        bst_resolved_note_shadows_on(a, p->facet, middle, normal, s.sun, p->by_part);
    }
    s.sun *= lit;
    s.sun_change[0] *= lit;
    s.sun_change[1] *= lit;
    s.earth *= p->lit[1];
    return add_part(ctx, a, &part, p->c.curved->side, &s, split, f);
}

bst_status bst_resolved_add_curved_facet(bst_ctx *ctx, bst_resolved_adding *a, int facet,
                                         bst_resolved_face *f) {
    curved_plan p;
    divide(a, facet, &p);
    find_lit(a, &p);
    for (int n = 0; n < p.parts[0] * p.parts[1]; n++) {
        int i = n % p.parts[0], k = n / p.parts[0];
        bst_vec3 outward =
            bst_curved_facet_normal(&p.c, (i + 0.5) / p.parts[0], (k + 0.5) / p.parts[1]);
        double up = bst_vec3_dot(outward, p.to_eye);
        bool limb = fabs(up) < 2.5 * p.half + p.near;
        if (up < 0.0 && !limb) {
            continue; /* shows its back */
        }
        limb = limb || (a->light && fabs(bst_vec3_dot(outward, a->light->sun)) < 1.2 * p.half);
        const int by[2] = {limb ? p.fine[0] : 1, limb ? p.fine[1] : 1};
        const int all[2] = {p.parts[0] * by[0], p.parts[1] * by[1]};
        a->scale = p.scale[limb];
        for (int m = 0; m < by[0] * by[1]; m++) {
            const int place[2] = {i * by[0] + m % by[0], k * by[1] + m / by[0]};
            BST_TRY(add_lit_part(ctx, a, &p, all, place, f));
        }
    }
    return BST_OK;
}
