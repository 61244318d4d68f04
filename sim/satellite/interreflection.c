#include "sim/satellite/interreflection.h"

#include <assert.h>
#include <stdlib.h>

/* A pair of facets that see each other. */
typedef struct exchange {
    int from, to;
    double factor; /* from the first to the second */
} exchange;

struct bst_interreflection {
    const bst_satellite *satellite;
    int stamp; /* of the pose for which the pairs hold; 0: none */
    exchange *pairs;
    int count, capacity;
    bool overflow;       /* out of memory for pairs */
    double *lit;         /* by facet: irradiance by the Sun over that at normal incidence */
    double *visible_m2;  /* by facet: projected toward the observer; below 0: not yet known */
    double *reflectance; /* by material, at 45 degrees */
};

bst_status bst_interreflection_check(bst_ctx *ctx, const bst_satellite *s) {
    return s->facet_count <= BST_INTERREFLECTION_FACETS
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "the shape has %d facets, too many for light that is reflected twice "
                          "(allowed: %d); simplify it or leave out interreflection",
                          s->facet_count, BST_INTERREFLECTION_FACETS);
}

bst_status bst_interreflection_create(bst_ctx *ctx, const bst_satellite *s,
                                      bst_interreflection **out) {
    *out = NULL;
    BST_TRY(bst_interreflection_check(ctx, s));
    bst_interreflection *r = calloc(1, sizeof *r);
    if (r) {
        r->satellite = s;
        r->lit = calloc((size_t)s->facet_count + 1, sizeof *r->lit);
        r->visible_m2 = calloc((size_t)s->facet_count + 1, sizeof *r->visible_m2);
        r->reflectance = calloc((size_t)s->material_count + 1, sizeof *r->reflectance);
    }
    if (!r || !r->lit || !r->visible_m2 || !r->reflectance) {
        bst_interreflection_free(r);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for light that is reflected twice");
    }
    for (int m = 0; m < s->material_count; m++) {
        const bst_material *material = &s->materials[m];
        r->reflectance[m] = material->scale * bst_brdf_reflectance(&material->brdf, sqrt(0.5));
    }
    *out = r;
    return BST_OK;
}

void bst_interreflection_free(bst_interreflection *r) {
    if (r) {
        free(r->pairs);
        free(r->lit);
        free(r->visible_m2);
        free(r->reflectance);
        free(r);
    }
}

static bst_vec3 corner(const bst_satellite_pose *p, const bst_facet *f, int i) {
    return p->vertices[p->satellite->corner[f->first + i % f->count]];
}

static bst_vec3 middle_of(const bst_satellite_pose *p, const bst_facet *f) {
    bst_vec3 sum = {0.0, 0.0, 0.0};
    for (int i = 0; i < f->count; i++) {
        sum = bst_vec3_axpy(sum, 1.0 / f->count, corner(p, f, i));
    }
    return sum;
}

/* Contribution of an edge a-b to Lambert's formula, seen from the origin. */
static double edge_part(bst_vec3 a, bst_vec3 b, bst_vec3 normal) {
    bst_vec3 c = bst_vec3_cross(a, b);
    double size = bst_vec3_norm(c);
    return size > 0.0 ? atan2(size, bst_vec3_dot(a, b)) * bst_vec3_dot(c, normal) / size : 0.0;
}

/* Form factor from a plane element to a facet, of which the part above the element's plane counts.
 */
static double element_factor(const bst_satellite_pose *p, bst_vec3 place, bst_vec3 normal,
                             const bst_facet *to) {
    bst_vec3 start = {0}, last = {0};
    double sum = 0.0;
    bool any = false;
    for (int i = 0; i < to->count; i++) {
        bst_vec3 a = bst_vec3_sub(corner(p, to, i), place);
        bst_vec3 b = bst_vec3_sub(corner(p, to, i + 1), place);
        double ha = bst_vec3_dot(a, normal), hb = bst_vec3_dot(b, normal);
        if (ha < 0.0 && hb < 0.0) {
            continue;
        }
        bst_vec3 cut = ha * hb < 0.0 ? bst_vec3_axpy(a, ha / (ha - hb), bst_vec3_sub(b, a)) : a;
        a = ha < 0.0 ? cut : a;
        b = hb < 0.0 ? cut : b;
        if (any) {
            sum += edge_part(last, a, normal); /* along the horizon, if it is cut */
        } else {
            start = a;
            any = true;
        }
        sum += edge_part(a, b, normal);
        last = b;
    }
    sum += any ? edge_part(last, start, normal) : 0.0;
    /* the corners are counter-clockwise from the side of the element */
    return fmin(fmax(-sum / (2.0 * BST_PI), 0.0), 1.0);
}

/* True if a facet lies on the way between two points. */
static bool meets(const bst_satellite_pose *p, int facet, bst_vec3 a, bst_vec3 b) {
    const bst_facet *f = &p->satellite->facets[facet];
    bst_vec3 n = p->normals[facet], origin = corner(p, f, 0);
    double ha = bst_vec3_dot(bst_vec3_sub(a, origin), n);
    double hb = bst_vec3_dot(bst_vec3_sub(b, origin), n);
    if (!(ha * hb < 0.0) || fmin(fabs(ha), fabs(hb)) < 1e-9) {
        return false;
    }
    bst_vec3 q = bst_vec3_axpy(a, ha / (ha - hb), bst_vec3_sub(b, a));
    for (int i = 0; i < f->count; i++) {
        bst_vec3 from = corner(p, f, i), side = bst_vec3_sub(corner(p, f, i + 1), from);
        if (bst_vec3_dot(bst_vec3_cross(side, bst_vec3_sub(q, from)), n) < 0.0) {
            return false;
        }
    }
    return true;
}

/* True if nothing of the model lies between two points of facets. */
static bool sees(const bst_satellite_pose *p, int from, bst_vec3 a, int to, bst_vec3 b) {
    for (int k = 0; k < p->satellite->facet_count; k++) {
        if (k != from && k != to && meets(p, k, a, b)) {
            return false;
        }
    }
    return true;
}

/* Largest distance of a corner from a point. */
static double size_about(const bst_satellite_pose *p, const bst_facet *f, bst_vec3 middle) {
    double most = 0.0;
    for (int i = 0; i < f->count; i++) {
        most = fmax(most, bst_vec3_norm(bst_vec3_sub(corner(p, f, i), middle)));
    }
    return most;
}

/* True if no point of either facet is in front of the other one. */
static bool are_averted(const bst_satellite_pose *p, int from, int to) {
    for (int side = 0; side < 2; side++) {
        int a = side ? to : from;
        const bst_facet *f = &p->satellite->facets[a], *g = &p->satellite->facets[side ? from : to];
        double most = -INFINITY;
        for (int i = 0; i < g->count; i++) {
            bst_vec3 way = bst_vec3_sub(corner(p, g, i), corner(p, f, 0));
            most = fmax(most, bst_vec3_dot(way, p->normals[a]));
        }
        if (!(most > 1e-9)) {
            return true;
        }
    }
    return false;
}

double bst_interreflection_factor(const bst_satellite_pose *p, int from, int to) {
    const bst_facet *f = &p->satellite->facets[from], *g = &p->satellite->facets[to];
    if (from == to || are_averted(p, from, to)) {
        return 0.0;
    }
    bst_vec3 end = middle_of(p, g), n = p->normals[from], start = middle_of(p, f);
    double distance = bst_vec3_norm(bst_vec3_sub(end, start));
    double near = (size_about(p, f, start) + size_about(p, g, end)) / fmax(distance, 1e-9);
    int sides = near < 0.2 ? 1 : near < 0.7 ? 3 : 8; /* triangles along an edge */
    double sum = 0.0;
    bst_vec3 a = corner(p, f, 0);
    for (int t = 2; t < f->count; t++) {
        bst_vec3 u = bst_vec3_scale(bst_vec3_sub(corner(p, f, t - 1), a), 1.0 / sides);
        bst_vec3 v = bst_vec3_scale(bst_vec3_sub(corner(p, f, t), a), 1.0 / sides);
        double area = 0.5 * bst_vec3_norm(bst_vec3_cross(u, v));
        for (int i = 0; i < sides; i++) {
            for (int k = 0; k < 2 * (sides - i) - 1; k++) {
                double third = k % 2 ? 2.0 / 3 : 1.0 / 3; /* of the triangle's middle */
                bst_vec3 q = bst_vec3_axpy(bst_vec3_axpy(a, i + third, u), k / 2 + third, v);
                bool ahead = bst_vec3_dot(bst_vec3_sub(q, end), p->normals[to]) > 0.0;
                if (ahead && sees(p, from, q, to, end)) {
                    sum += area * element_factor(p, q, n, g);
                }
            }
        }
    }
    return sum / f->area_m2;
}

/* Finds all pairs of facets that see each other; by reciprocity each one once. */
static void make_pairs(bst_interreflection *r, const bst_satellite_pose *p) {
    const bst_satellite *s = r->satellite;
    r->count = 0;
    r->overflow = false;
    for (int i = 0; i < s->facet_count; i++) {
        for (int k = i + 1; k < s->facet_count; k++) {
            /* from the smaller one, whose points stand closer */
            bool swap = s->facets[k].area_m2 < s->facets[i].area_m2;
            int from = swap ? k : i, to = swap ? i : k;
            double factor = s->facets[i].occluder == s->facets[k].occluder && !s->facets[i].inside
                                ? 0.0
                                : bst_interreflection_factor(p, from, to);
            if (!(factor > 1e-6)) {
                continue;
            }
            if (r->count == r->capacity) {
                int capacity = r->capacity ? 2 * r->capacity : 64;
                exchange *pairs = realloc(r->pairs, (size_t)capacity * sizeof *pairs);
                if (!pairs) {
                    r->overflow = true; /* what is left out is dark, as without interreflection */
                    return;
                }
                r->pairs = pairs;
                r->capacity = capacity;
            }
            r->pairs[r->count++] = (exchange){from, to, factor};
        }
    }
}

/* Projected area of a facet that the observer of view 0 sees. */
static double visible_m2(bst_interreflection *r, bst_satellite_pose *p, int facet) {
    if (r->visible_m2[facet] < 0.0) {
        double cosine = bst_vec3_dot(p->normals[facet], p->views[0].z);
        r->visible_m2[facet] = cosine > 1e-9 ? cosine * bst_pose_unshadowed_area(p, facet, 1) : 0.0;
    }
    return r->visible_m2[facet];
}

/* Light that goes from a lit facet by another one to the observer. */
static void add_way(bst_interreflection *r, bst_satellite_pose *p, int lit, int seen,
                    double factor_from_seen, bst_satellite_flux *flux) {
    const bst_satellite *s = r->satellite;
    int a = s->facets[lit].material, b = s->facets[seen].material;
    double light = r->lit[lit] * r->reflectance[a] * r->reflectance[b] * factor_from_seen;
    if (!(light > 0.0)) {
        return;
    }
    light *= visible_m2(r, p, seen) / BST_PI;
    for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
        flux->sun[k] += light * s->materials[a].colour[k] * s->materials[b].colour[k];
    }
}

void bst_interreflection_add(bst_interreflection *r, bst_satellite_pose *p,
                             const bst_satellite_light *light, bst_satellite_flux *flux) {
    const bst_satellite *s = r->satellite;
    assert(p->satellite == s);
    if (r->stamp != p->stamp) {
        make_pairs(r, p);
        r->stamp = p->stamp;
    }
    bst_pose_look(p, 0, light->sun);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], light->sun);
        r->lit[i] =
            cosine > 1e-9 ? cosine * bst_pose_unshadowed_area(p, i, 1) / s->facets[i].area_m2 : 0.0;
        r->visible_m2[i] = -1.0;
    }
    bst_pose_look(p, 0, light->observer);
    for (int i = 0; i < r->count; i++) {
        const exchange *e = &r->pairs[i];
        double back = e->factor * s->facets[e->from].area_m2 / s->facets[e->to].area_m2;
        add_way(r, p, e->to, e->from, e->factor, flux);
        add_way(r, p, e->from, e->to, back, flux);
    }
}
