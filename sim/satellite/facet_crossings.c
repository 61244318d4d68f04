/* Facets of a rigid model that others cross: found once, in a grid of cubes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/facet_net.h"

/* Distances over the model's radius that are none. */
static const double SAME = 2e-6;

enum { CUBES_MAX = 64 };

/* Box of a facet, m. */
typedef struct box {
    double low[3], high[3];
} box;

/* Work memory: facets by cube. */
typedef struct cubes {
    box *boxes; /* by facet */
    int *first; /* [across^3 + 1] */
    int *facets;
    int *seen; /* by facet: the last one that it was compared with */
    int across;
    double from[3], per_m[3];
} cubes;

static bst_vec3 corner_of(const bst_facet_net *net, int corner) {
    return net->satellite->vertices[net->vertex[net->corner[corner]]];
}

static box box_of(const bst_facet_net *net, int facet, double margin) {
    box b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = net->first[facet]; i < net->first[facet + 1]; i++) {
        bst_vec3 p = corner_of(net, i);
        const double at[3] = {p.x, p.y, p.z};
        for (int k = 0; k < 3; k++) {
            double low = at[k] - margin, high = at[k] + margin;
            b.low[k] = low < b.low[k] ? low : b.low[k];
            b.high[k] = high > b.high[k] ? high : b.high[k];
        }
    }
    return b;
}

/* Cubes of a box: first and last one along each axis. */
static void range_of(const cubes *c, const box *b, int from[3], int to[3]) {
    for (int k = 0; k < 3; k++) {
        from[k] = (int)fmin(fmax((b->low[k] - c->from[k]) * c->per_m[k], 0.0), c->across - 1);
        to[k] = (int)fmin(fmax((b->high[k] - c->from[k]) * c->per_m[k], 0.0), c->across - 1);
    }
}

/* Counts the facets of each cube, or with `fill` enters them. */
static void enter(const bst_facet_net *net, cubes *c, bool fill) {
    for (int f = 0; f < net->satellite->facet_count; f++) {
        int from[3], to[3];
        range_of(c, &c->boxes[f], from, to);
        for (int z = from[2]; z <= to[2]; z++) {
            for (int y = from[1]; y <= to[1]; y++) {
                for (int x = from[0]; x <= to[0]; x++) {
                    int at = (z * c->across + y) * c->across + x;
                    if (fill) {
                        c->facets[c->first[at]++] = f;
                    } else {
                        c->first[at + 1]++;
                    }
                }
            }
        }
    }
}

static bst_status fill_cubes(bst_ctx *ctx, const bst_facet_net *net, cubes *c) {
    size_t facets = (size_t)net->satellite->facet_count;
    box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    c->across = (int)fmin(fmax(cbrt((double)facets), 1.0), CUBES_MAX);
    size_t count = (size_t)c->across * (size_t)c->across * (size_t)c->across;
    c->boxes = calloc(facets + 1, sizeof *c->boxes);
    c->first = calloc(count + 1, sizeof *c->first);
    c->seen = calloc(facets + 1, sizeof *c->seen);
    if (!c->boxes || !c->first || !c->seen) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the places of %zu facets", facets);
    }
    for (size_t f = 0; f < facets; f++) {
        c->boxes[f] = box_of(net, (int)f, SAME * net->satellite->radius_m);
        for (int k = 0; k < 3; k++) {
            all.low[k] = fmin(all.low[k], c->boxes[f].low[k]);
            all.high[k] = fmax(all.high[k], c->boxes[f].high[k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        c->from[k] = all.low[k];
        c->per_m[k] = c->across / fmax(all.high[k] - all.low[k], 1e-300);
    }
    enter(net, c, false);
    for (size_t i = 0; i < count; i++) {
        c->first[i + 1] += c->first[i];
    }
    c->facets = calloc((size_t)c->first[count] + 1, sizeof *c->facets);
    if (!c->facets) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the places of %zu facets", facets);
    }
    enter(net, c, true);
    /* filling moved the first facet of each cube to that of the next one */
    memmove(c->first + 1, c->first, count * sizeof *c->first);
    c->first[0] = 0;
    return BST_OK;
}

/* How one facet lies about the plane of another one. */
typedef enum side { ON_ONE_SIDE, IN_THE_PLANE, ON_BOTH_SIDES } side;

static double height_of(const bst_facet_net *net, int plane, bst_vec3 p) {
    return bst_vec3_dot(net->satellite->facets[plane].normal,
                        bst_vec3_sub(p, corner_of(net, net->first[plane])));
}

static side side_of(const bst_facet_net *net, int plane, int facet) {
    double same = SAME * net->satellite->radius_m, least = INFINITY, most = -INFINITY;
    for (int i = net->first[facet]; i < net->first[facet + 1]; i++) {
        double height = height_of(net, plane, corner_of(net, i));
        least = height < least ? height : least;
        most = height > most ? height : most;
    }
    return least >= -same && most <= same   ? IN_THE_PLANE
           : least >= -same || most <= same ? ON_ONE_SIDE
                                            : ON_BOTH_SIDES;
}

static bool has_corner(const bst_facet_net *net, int facet, int corner) {
    for (int i = net->first[facet]; i < net->first[facet + 1]; i++) {
        if (net->corner[i] == net->corner[corner]) {
            return true;
        }
    }
    return false;
}

/* The part of a convex facet within the plane of another one: from where to where on the line of
 * both planes, m. A corner of both is in the plane exactly; one on the plane counts as above it, so
 * that the border changes sides twice. */
static void span_in_plane(const bst_facet_net *net, int plane, int facet, bst_vec3 line,
                          double span[2]) {
    int first = net->first[facet], end = net->first[facet + 1];
    span[0] = INFINITY;
    span[1] = -INFINITY;
    bst_vec3 a = corner_of(net, end - 1);
    double from = has_corner(net, plane, end - 1) ? 0.0 : height_of(net, plane, a);
    for (int i = first; i < end; i++) {
        bst_vec3 b = corner_of(net, i);
        double to = has_corner(net, plane, i) ? 0.0 : height_of(net, plane, b);
        if ((from < 0.0) != (to < 0.0)) {
            bst_vec3 at = bst_vec3_axpy(a, from / (from - to), bst_vec3_sub(b, a));
            span[0] = fmin(span[0], bst_vec3_dot(line, at));
            span[1] = fmax(span[1], bst_vec3_dot(line, at));
        }
        a = b;
        from = to;
    }
}

/* True if two facets, each on both sides of the other's plane, share a part of the line of both
 * planes (Moeller 1997, J. Graphics Tools 2(2), 25). A common corner alone is none. */
static bool share_a_line(const bst_facet_net *net, int f, int g) {
    const bst_facet *facets = net->satellite->facets;
    bst_vec3 line = bst_vec3_unit(bst_vec3_cross(facets[f].normal, facets[g].normal));
    double of_f[2], of_g[2];
    span_in_plane(net, g, f, line, of_f);
    span_in_plane(net, f, g, line, of_g);
    return fmin(of_f[1], of_g[1]) - fmax(of_f[0], of_g[0]) > SAME * net->satellite->radius_m;
}

/* True if a side of a facet separates it from another one in its plane. */
static bool is_beside(const bst_facet_net *net, int f, int g) {
    double same = SAME * net->satellite->radius_m;
    int first = net->first[f], end = net->first[f + 1];
    bst_vec3 a = corner_of(net, end - 1);
    for (int i = first; i < end; i++) {
        bst_vec3 b = corner_of(net, i);
        bst_vec3 out = bst_vec3_cross(bst_vec3_sub(b, a), net->satellite->facets[f].normal);
        double length = bst_vec3_norm(out), least = -same * length;
        bool outside = length > same;
        for (int k = net->first[g]; k < net->first[g + 1] && outside; k++) {
            outside = bst_vec3_dot(out, bst_vec3_sub(corner_of(net, k), a)) >= least;
        }
        if (outside) {
            return true;
        }
        a = b;
    }
    return false;
}

/* True if two facets may cross, or overlap in one plane. */
static bool may_cross(const bst_facet_net *net, int f, int g) {
    side of_g = side_of(net, f, g);
    if (of_g != ON_BOTH_SIDES) {
        return of_g == IN_THE_PLANE && !is_beside(net, f, g) && !is_beside(net, g, f);
    }
    return side_of(net, g, f) == ON_BOTH_SIDES && share_a_line(net, f, g);
}

/* Number of corners that two facets share. */
static int shared_corners(const bst_facet_net *net, int f, int g) {
    int shared = 0;
    for (int i = net->first[f]; i < net->first[f + 1]; i++) {
        shared += has_corner(net, g, i);
    }
    return shared;
}

/* True if a side of a facet may lie in another one that does not cross it: both of its corners are
 * in the plane of that, and it is not a side of both. */
static bool may_touch(const bst_facet_net *net, int facet, int plane) {
    double same = SAME * net->satellite->radius_m;
    int in_plane = 0;
    if (shared_corners(net, facet, plane) >= 2) {
        return false;
    }
    for (int i = net->first[facet]; i < net->first[facet + 1]; i++) {
        in_plane += fabs(height_of(net, plane, corner_of(net, i))) <= same;
    }
    return in_plane >= 2;
}

static bool boxes_meet(const box *a, const box *b) {
    for (int k = 0; k < 3; k++) {
        if (a->low[k] > b->high[k] || b->low[k] > a->high[k]) {
            return false;
        }
    }
    return true;
}

/* Whether others cross or touch a facet: a value of `apart`. */
static uint8_t find_apart(const bst_facet_net *net, cubes *c, int f) {
    int from[3], to[3];
    uint8_t apart = BST_NET_FREE;
    range_of(c, &c->boxes[f], from, to);
    for (int z = from[2]; z <= to[2]; z++) {
        for (int y = from[1]; y <= to[1]; y++) {
            for (int x = from[0]; x <= to[0]; x++) {
                int at = (z * c->across + y) * c->across + x;
                for (int n = c->first[at]; n < c->first[at + 1]; n++) {
                    int g = c->facets[n];
                    if (g == f || c->seen[g] == f + 1) {
                        continue;
                    }
                    c->seen[g] = f + 1;
                    if (!boxes_meet(&c->boxes[f], &c->boxes[g])) {
                        continue;
                    }
                    if (may_cross(net, f, g)) {
                        return 0;
                    }
                    apart = apart == BST_NET_FREE && may_touch(net, f, g) ? BST_NET_APART : apart;
                }
            }
        }
    }
    return apart;
}

bst_status bst_facet_net_find_apart(bst_ctx *ctx, bst_facet_net *net) {
    const bst_satellite *s = net->satellite;
    cubes c = {.across = 0};
    for (int f = 1; f < s->facet_count; f++) {
        if (s->facets[f].joint != s->facets[0].joint) {
            return BST_OK;
        }
    }
    bst_status status = fill_cubes(ctx, net, &c);
    for (int f = 0; f < s->facet_count && status == BST_OK; f++) {
        net->apart[f] = find_apart(net, &c, f);
    }
    free(c.boxes);
    free(c.first);
    free(c.facets);
    free(c.seen);
    return status;
}
