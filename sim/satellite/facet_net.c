#include "sim/satellite/facet_net.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

void bst_facet_net_free(bst_facet_net *net) {
    free(net->vertex);
    free(net->first);
    free(net->corner);
    free(net->beside);
    free(net->edges);
    free(net->apart);
    free(net->size_m);
    free(net->material);
    *net = (bst_facet_net){.vertex_count = 0};
}

/* A vertex of the model, for sorting by place. */
typedef struct placed {
    bst_vec3 v;
    int joint, index;
} placed;

static int compare_places(const placed *p, const placed *q) {
    if (p->joint != q->joint) {
        return p->joint < q->joint ? -1 : 1;
    }
    if (p->v.x != q->v.x) {
        return p->v.x < q->v.x ? -1 : 1;
    }
    if (p->v.y != q->v.y) {
        return p->v.y < q->v.y ? -1 : 1;
    }
    return (p->v.z > q->v.z) - (p->v.z < q->v.z);
}

static int compare_placed(const void *a, const void *b) {
    int order = compare_places(a, b);
    int i = ((const placed *)a)->index, k = ((const placed *)b)->index;
    return order != 0 ? order : (i > k) - (i < k);
}

/* A side of a facet, for sorting by its vertices. */
typedef struct side {
    int low, high, index; /* vertices; place in the order of corners */
} side;

static int compare_sides(const void *a, const void *b) {
    const side *p = a, *q = b;
    if (p->low != q->low) {
        return p->low < q->low ? -1 : 1;
    }
    if (p->high != q->high) {
        return p->high < q->high ? -1 : 1;
    }
    return (p->index > q->index) - (p->index < q->index);
}

/* Work memory. */
typedef struct work {
    placed *placed;
    int *first;   /* by vertex of the model: the first one at its place */
    int *number;  /* by vertex of the model: vertex of the net, or -1 */
    int *facet;   /* by corner */
    int *partner; /* by corner: the corner whose side is the same edge in the other sense; or -1 */
    side *sides;
} work;

static void free_work(work *w) {
    free(w->placed);
    free(w->first);
    free(w->number);
    free(w->facet);
    free(w->partner);
    free(w->sides);
}

/* Numbers the vertices in the order of the facets. */
static void weld(const bst_satellite *s, work *w, bst_facet_net *net) {
    for (int i = 0; i < s->vertex_count; i++) {
        w->placed[i] = (placed){s->vertices[i], s->vertex_joint[i], i};
        w->number[i] = -1;
    }
    qsort(w->placed, (size_t)s->vertex_count, sizeof *w->placed, compare_placed);
    for (int i = 0; i < s->vertex_count; i++) {
        bool same = i > 0 && compare_places(&w->placed[i - 1], &w->placed[i]) == 0;
        w->first[w->placed[i].index] = same ? w->first[w->placed[i - 1].index] : w->placed[i].index;
    }
    for (int i = 0; i < s->corner_count; i++) {
        int v = w->first[s->corner[i]];
        if (w->number[v] < 0) {
            w->number[v] = net->vertex_count;
            net->vertex[net->vertex_count++] = v;
        }
        net->corner[i] = w->number[v];
    }
}

/* The corner after one of the same facet. */
static int next_corner(const bst_satellite *s, const work *w, int corner) {
    const bst_facet *f = &s->facets[w->facet[corner]];
    return corner + 1 < f->first + f->count ? corner + 1 : f->first;
}

/* Pairs the sides of one edge, sides[0] to sides[count - 1]: those in opposite senses whose facets
 * are the least bent, such as the same sides of the thin parts of an open mesh. */
static void pair_sides(const bst_facet_net *net, work *w, const side *sides, int count) {
    const bst_satellite *s = net->satellite;
    for (int i = 0; i < count; i++) {
        int own = sides[i].index, best = -1;
        double most = -INFINITY;
        bool forward = net->corner[own] == sides[i].low;
        for (int k = i + 1; k < count && w->partner[own] < 0; k++) {
            int other = sides[k].index;
            const bst_facet *f = &s->facets[w->facet[own]], *g = &s->facets[w->facet[other]];
            double bend = bst_vec3_dot(f->normal, g->normal);
            if (w->partner[other] < 0 && forward != (net->corner[other] == sides[k].low) &&
                bend > most && f->joint == g->joint) {
                most = bend;
                best = other;
            }
        }
        if (best >= 0) {
            w->partner[own] = best;
            w->partner[best] = own;
        }
    }
}

/* Makes the edges. */
static void join(const bst_satellite *s, work *w, bst_facet_net *net) {
    net->first[s->facet_count] = s->corner_count;
    for (int f = 0; f < s->facet_count; f++) {
        net->first[f] = s->facets[f].first;
        assert(f == 0 || net->first[f] == s->facets[f - 1].first + s->facets[f - 1].count);
        for (int i = s->facets[f].first; i < s->facets[f].first + s->facets[f].count; i++) {
            w->facet[i] = f;
        }
    }
    for (int i = 0; i < s->corner_count; i++) {
        int a = net->corner[i], b = net->corner[next_corner(s, w, i)];
        w->sides[i] = (side){a < b ? a : b, a < b ? b : a, i};
        w->partner[i] = -1;
    }
    qsort(w->sides, (size_t)s->corner_count, sizeof *w->sides, compare_sides);
    for (int i = 0; i < s->corner_count;) {
        int end = i + 1;
        while (end < s->corner_count && w->sides[end].low == w->sides[i].low &&
               w->sides[end].high == w->sides[i].high) {
            end++;
        }
        pair_sides(net, w, w->sides + i, end - i);
        for (int k = i; k < end; k++) {
            int partner = end - i == 2 ? w->partner[w->sides[k].index] : -1;
            net->beside[w->sides[k].index] = partner < 0 ? s->facet_count : w->facet[partner];
        }
        i = end;
    }
    for (int i = 0; i < s->corner_count; i++) {
        if (w->partner[i] < 0 || w->partner[i] > i) {
            net->edges[net->edge_count++] =
                (bst_net_edge){net->corner[i], net->corner[next_corner(s, w, i)], w->facet[i],
                               w->partner[i] < 0 ? s->facet_count : w->facet[w->partner[i]]};
        }
    }
}

/* Finds the sizes of the facets, and lists their materials. */
static void measure(const bst_satellite *s, bst_facet_net *net) {
    for (int f = 0; f < s->facet_count; f++) {
        double most = 0.0; /* squared */
        for (int i = net->first[f]; i < net->first[f + 1]; i++) {
            for (int k = i + 1; k < net->first[f + 1]; k++) {
                bst_vec3 way = bst_vec3_sub(s->vertices[s->corner[k]], s->vertices[s->corner[i]]);
                most = fmax(most, bst_vec3_dot(way, way));
            }
        }
        net->size_m[f] = nextafterf((float)sqrt(most), INFINITY);
        net->material[f] = s->facets[f].material;
    }
}

bst_status bst_facet_net_make(bst_ctx *ctx, const bst_satellite *s, bst_facet_net *out) {
    size_t vertices = (size_t)s->vertex_count + 1, corners = (size_t)s->corner_count + 1;
    *out = (bst_facet_net){.satellite = s,
                           .vertex = calloc(vertices, sizeof *out->vertex),
                           .first = calloc((size_t)s->facet_count + 1, sizeof *out->first),
                           .corner = calloc(corners, sizeof *out->corner),
                           .beside = calloc(corners, sizeof *out->beside),
                           .edges = calloc(corners, sizeof *out->edges),
                           .apart = calloc((size_t)s->facet_count + 1, sizeof *out->apart),
                           .size_m = calloc((size_t)s->facet_count + 1, sizeof *out->size_m),
                           .material = calloc((size_t)s->facet_count + 1, sizeof *out->material)};
    work w = {.placed = calloc(vertices, sizeof *w.placed),
              .first = calloc(vertices, sizeof *w.first),
              .number = calloc(vertices, sizeof *w.number),
              .facet = calloc(corners, sizeof *w.facet),
              .partner = calloc(corners, sizeof *w.partner),
              .sides = calloc(corners, sizeof *w.sides)};
    bst_status status = BST_OK;
    if (!out->vertex || !out->first || !out->corner || !out->beside || !out->edges || !out->apart ||
        !out->size_m || !out->material || !w.placed || !w.first || !w.number || !w.facet ||
        !w.partner || !w.sides) {
        status =
            bst_fail(ctx, BST_ERR_MEMORY, "no memory for the edges of %d facets", s->facet_count);
    } else {
        weld(s, &w, out);
        join(s, &w, out);
        measure(s, out);
        status = bst_facet_net_find_apart(ctx, out);
    }
    free_work(&w);
    return status;
}
