/* Light of a pose by cell, as exact areas: facets that nothing hides by their edges, others by the
 * polygons that are left of them. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/polygon_cut.h"
#include "sim/satellite/resolved_faces.h"

/* Cells across the view from a light. */
enum { LIGHT_CELLS_MIN = 32, LIGHT_CELLS_MAX = 1024 };

/* Difference of the light of two facets over that of either below which their edge is faint, if
 * more poses than a few blur the image. */
static const double FAINT = 0.1;

/* Edges of a pose that are added before those of the next one: of a part of the body that meets so
 * few cells that they stay in fast memory. */
enum { EDGES = 512 };

/* Cosine of incidence of the earthlight's centroid below which it casts no shadow. */
static const double EARTH_LOW = 0.05;

void bst_resolved_areas_free(bst_resolved_areas *s) {
    if (!s->borrowed) {
        bst_facet_net_free(&s->net);
    }
    bst_facet_layers_free(&s->eye);
    bst_area_sums_free(&s->sums);
    for (int n = 0; n < BST_RESOLVED_LIGHTS; n++) {
        bst_facet_layers_free(&s->lit[n]);
        free(s->from[n]);
    }
    free(s->planes);
    free(s->middles);
    free(s->even);
    free(s->wanted);
    for (int k = 0; k < BST_RESOLVED_KEPT; k++) {
        free(s->kept[k].at);
        free(s->kept[k].even);
    }
    free(s->second);
    *s = (bst_resolved_areas){.made = false};
}

bool bst_resolved_may_add_light(const bst_satellite *satellite) {
    if (satellite->curved_count > 0 || satellite->shell_count > 0) {
        return false;
    }
    for (int f = 0; f < satellite->facet_count; f++) {
        if (satellite->facets[f].count > BST_LAYERS_CORNERS_MAX) {
            return false;
        }
    }
    return true;
}

/* Makes the net, or borrows that of another image (NULL: none), and the arrays by facet. */
static bst_status make(bst_ctx *ctx, bst_resolved *r, const bst_resolved *lender) {
    bst_resolved_areas *s = &r->areas;
    size_t facets = (size_t)r->satellite->facet_count + 1;
    bst_resolved_areas_free(s);
    if (lender) {
        s->borrowed = true;
        s->net = lender->areas.net;
    } else {
        BST_TRY(bst_facet_net_make(ctx, r->satellite, &s->net));
    }
    s->planes = calloc(facets, sizeof *s->planes);
    s->middles = calloc(facets, sizeof *s->middles);
    s->even = calloc(facets, sizeof *s->even);
    s->wanted = calloc(facets, sizeof *s->wanted);
    s->made = s->planes && s->middles && s->even && s->wanted;
    for (int k = 0; k < BST_RESOLVED_KEPT; k++) {
        s->kept[k].at = calloc((size_t)s->net.vertex_count + 1, sizeof *s->kept[k].at);
        s->kept[k].even = calloc(facets, sizeof *s->kept[k].even);
        s->made = s->made && s->kept[k].at && s->kept[k].even;
    }
    for (int n = 0; n < BST_RESOLVED_LIGHTS; n++) {
        s->from[n] = calloc(facets, sizeof *s->from[n]);
        s->made = s->made && s->from[n];
    }
    return s->made ? BST_OK
                   : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light of %d facets",
                              r->satellite->facet_count);
}

/* Starts to sum the light; lender: see make. */
static bst_status begin(bst_ctx *ctx, bst_resolved *r, const bst_resolved *lender, bool blurred) {
    bst_resolved_areas *s = &r->areas;
    size_t cells = (size_t)r->image.width * (size_t)r->image.height;
    if (!s->made) {
        BST_TRY(make(ctx, r, lender));
    }
    s->faint = blurred ? FAINT : 0.0;
    s->kept_count = 0;
    if (cells > s->second_capacity) {
        free(s->second);
        size_t capacity = cells + cells / 4; /* as those of the image */
        s->second = malloc(capacity * sizeof *s->second);
        s->second_capacity = s->second ? capacity : 0;
        if (!s->second) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells",
                            r->image.width, r->image.height);
        }
    }
    return bst_area_sums_begin(ctx, &r->areas.sums, r->image.width, r->image.height);
}

bst_status bst_resolved_begin_light(bst_ctx *ctx, bst_resolved *r, bool blurred) {
    return begin(ctx, r, NULL, blurred);
}

bst_status bst_resolved_begin_light_beside(bst_ctx *ctx, bst_resolved *r, const bst_resolved *first,
                                           bool blurred) {
    assert(first->areas.made && first->satellite == r->satellite);
    return begin(ctx, r, first, blurred);
}

static bst_resolved_light_view light_view_of(const bst_resolved_adding *a, bst_vec3 direction) {
    double radius_m = a->r->satellite->radius_m;
    double across = ceil(2.0 * radius_m * a->per_m / fmax(a->view->origin_m.z, radius_m));
    bst_resolved_light_view v = {.z = direction};
    v.side = (int)fmin(fmax(across, LIGHT_CELLS_MIN), LIGHT_CELLS_MAX);
    v.middle = 0.5 * v.side;
    v.per_m = 0.499 * v.side / radius_m;
    /* the other way round than axes of a right-handed frame, as in an image with y down */
    v.y = bst_vec3_perpendicular(direction);
    v.x = bst_vec3_cross(v.z, v.y);
    return v;
}

/* Starts the view from a light. */
static bst_status begin_light_view(bst_ctx *ctx, const bst_resolved_adding *a, int n,
                                   const bst_resolved_light_view *v) {
    bst_facet_layers *l = &a->r->areas.lit[n];
    l->same = BST_RESOLVED_SAME * a->r->satellite->radius_m;
    l->cells_per_m = v->per_m;
    return bst_facet_layers_begin(ctx, l, &a->r->areas.net, v->side, v->side);
}

/* Places vertices and facets in the view from the Earth: see bst_resolved_place_facets. */
static void place_for_earth(const bst_resolved_adding *a, const bst_resolved_light_view *v) {
    bst_resolved_areas *s = &a->r->areas;
    bst_facet_layers *l = &s->lit[1];
    int facets = a->r->satellite->facet_count;
    for (int i = 0; i < s->net.vertex_count; i++) {
        bst_vec3 p = a->pose->vertices[s->net.vertex[i]];
        l->at[i] = bst_resolved_light_place(v, p);
        l->near[i] = bst_vec3_dot(p, v->z);
    }
    for (int f = 0; f < facets; f++) {
        l->facing[f] = bst_vec3_dot(s->planes[f].normal, v->z) > 0.0;
    }
    l->facing[facets] = 0;
}

/* Finds the facets in sight that may be in the shadow of others. */
static bst_status look_from_light(bst_ctx *ctx, const bst_resolved_adding *a, int n,
                                  const bst_resolved_light_view *v) {
    bst_resolved_areas *s = &a->r->areas;
    bst_facet_layers *l = &s->lit[n];
    for (int f = 0; f < a->r->satellite->facet_count; f++) {
        s->wanted[f] = l->facing[f] && s->eye.facing[f] && s->from[n][f] > 0.0 &&
                       (n == 0 || bst_vec3_dot(s->planes[f].normal, v->z) > EARTH_LOW);
    }
    return bst_facet_layers_find(ctx, l, s->wanted);
}

/* Point of a facet at a place of the view from a light, body frame.
 *
 * Given:     plane  of the facet: bst_facet_layers_plane */
static bst_vec3 place_on(const bst_resolved_light_view *v, const double plane[3], bst_point2 p) {
    bst_vec3 at = bst_vec3_scale(v->z, plane[0] + plane[1] * p.x + plane[2] * p.y);
    at = bst_vec3_axpy(at, (p.x - v->middle) / v->per_m, v->x);
    return bst_vec3_axpy(at, (p.y - v->middle) / v->per_m, v->y);
}

/* Keeps the widths of the penumbrae on a facet of which the Sun reaches a part. */
static void note_shadows(const bst_resolved_adding *a, int facet, const bst_resolved_light_view *v,
                         double light) {
    const bst_resolved_areas *s = &a->r->areas;
    bst_layers_end end[BST_LAYERS_ENDS];
    double plane[3];
    bst_resolved_border border = {.normal = s->planes[facet].normal, .light = light};
    int count = bst_facet_layers_ends(&s->lit[0], facet, end);
    if (count < 0) {
        border.at[0] = border.at[1] = s->middles[facet];
        border.gap_m = 2.0 * a->r->satellite->radius_m;
        bst_resolved_note_shadow(a, &border);
    }
    for (int i = 0; i < count && bst_facet_layers_plane(&s->lit[0], facet, plane); i++) {
        border.gap_m = end[i].gap;
        for (int k = 0; k < 2; k++) {
            bst_point2 p = end[i].place[k], way = end[i].side[k];
            int beside = end[i].beside[k];
            border.at[k] = place_on(v, plane, p);
            bst_vec3 next = place_on(v, plane, (bst_point2){p.x + way.x, p.y + way.y});
            border.side[k] = bst_vec3_sub(next, border.at[k]);
            /* the shadow goes on there if it is lit */
            bool lit = beside >= 0 && s->eye.facing[beside] && s->lit[0].facing[beside];
            border.change[k] = lit ? fmin(fabs(light - s->from[0][beside]), light) : light;
        }
        bst_resolved_note_shadow(a, &border);
    }
}

/* Adds the light of what a light reaches of a facet.
 *
 * Given:     whole  nothing hides the facet from the observer; else eye.clip has what is seen */
static void add_lit(const bst_resolved_adding *a, int facet, int n,
                    const bst_resolved_light_view *v, bool whole, double light) {
    bst_resolved_areas *s = &a->r->areas;
    const bst_polygon_clip *lit = &s->lit[n].clip, *seen = &s->eye.clip;
    bst_point2 corner[BST_POLYGON_CORNERS_MAX], both[2 * BST_POLYGON_CORNERS_MAX];
    bst_point2 work[2 * BST_POLYGON_CORNERS_MAX];
    double plane[3], depth_m;
    if (!bst_facet_layers_plane(&s->lit[n], facet, plane)) {
        return;
    }
    for (int i = 0; i < lit->piece_count; i++) {
        const bst_polygon_piece *piece = &lit->pieces[i];
        for (int k = 0; k < piece->count; k++) {
            bst_vec3 at = place_on(v, plane, lit->points[piece->first + k]);
            corner[k] = bst_resolved_project(a, at, &depth_m);
        }
        if (whole) {
            bst_area_sums_polygon(&s->sums, corner, piece->count, light);
            continue;
        }
        for (int j = 0; j < seen->piece_count && piece->count > 0; j++) {
            const bst_polygon_piece *part = &seen->pieces[j];
            int count = part->count < 3 ? 0
                                        : bst_polygon_intersection(corner, piece->count,
                                                                   seen->points + part->first,
                                                                   part->count, work, both);
            bst_area_sums_polygon(&s->sums, both, count, light);
        }
    }
}

/* Adds a facet that faces the observer. Returned: its light per cell, if all of it has the same. */
static double add_facet(const bst_resolved_adding *a, int facet,
                        const bst_resolved_light_view *views, double weight) {
    bst_resolved_areas *s = &a->r->areas;
    bool whole = !s->eye.doubtful[facet] || bst_facet_layers_cut(&s->eye, facet);
    double even = s->even[facet];
    whole = bst_resolved_cut_hidden(a, facet, whole);
    if (!whole && bst_polygon_clip_is_empty(&s->eye.clip)) {
        return 0.0;
    }
    for (int n = 0; n < BST_RESOLVED_LIGHTS; n++) {
        double light = s->from[n][facet];
        if (!(light > 0.0)) {
            continue;
        }
        if (!s->lit[n].doubtful[facet] || bst_facet_layers_cut(&s->lit[n], facet)) {
            even += light;
        } else {
            if (n == 0 && a->light->penumbrae && !bst_polygon_clip_is_empty(&s->lit[0].clip)) {
                note_shadows(a, facet, &views[0], light);
            }
            add_lit(a, facet, n, &views[n], whole, weight * light);
        }
    }
    if (whole) {
        return weight * even;
    }
    for (int i = 0; i < s->eye.clip.piece_count; i++) {
        const bst_polygon_piece *piece = &s->eye.clip.pieces[i];
        bst_area_sums_polygon(&s->sums, s->eye.clip.points + piece->first, piece->count,
                              weight * even);
    }
    return 0.0;
}

/* Adds some edges of the whole facets of a pose. */
static void add_edges(bst_resolved_areas *s, const bst_resolved_kept *kept, int first, int end) {
    int steps[EDGES], count = 0; /* those at which the light changes */
    for (int e = first; e < end; e++) {
        const bst_net_edge *edge = &s->net.edges[e];
        steps[count] = e;
        count += kept->even[edge->left] != kept->even[edge->right];
    }
    for (int n = 0; n < count; n++) {
        const bst_net_edge *edge = &s->net.edges[steps[n]];
        double left = kept->even[edge->left], right = kept->even[edge->right], step = left - right;
        bst_point2 a = kept->at[edge->a], b = kept->at[edge->b];
        if (fabs(step) < s->faint * (left < right ? left : right)) {
            bst_area_sums_faint_edge(&s->sums, a, b, step);
        } else {
            bst_area_sums_edge(&s->sums, a, b, step);
        }
    }
}

/* Adds the edges of all poses that are kept. */
static void add_kept(bst_resolved_areas *s) {
    for (int e = 0; e < s->net.edge_count && s->kept_count > 0; e += EDGES) {
        int end = e + EDGES < s->net.edge_count ? e + EDGES : s->net.edge_count;
        for (int k = 0; k < s->kept_count; k++) {
            add_edges(s, &s->kept[k], e, end);
        }
    }
    s->kept_count = 0;
}

/* Keeps the places and the light of a pose, in exchange for other memory. */
static void keep(bst_resolved_areas *s) {
    bst_resolved_kept *to = &s->kept[s->kept_count++];
    bst_resolved_kept now = {s->eye.at, s->even};
    s->eye.at = to->at;
    s->even = to->even;
    *to = now;
    if (s->kept_count == BST_RESOLVED_KEPT) {
        add_kept(s);
    }
}

void bst_resolved_settle_light(bst_resolved *r) {
    add_kept(&r->areas);
}

/* Sums that are joined. */
typedef struct joining {
    bst_area_sums *to;
    const bst_area_sums *from;
} joining;

/* Callback of the loop over rows. */
static void join_rows(void *user, int begin, int end) {
    const joining *j = user;
    bst_area_sums_add(j->to, j->from, begin, end);
}

void bst_resolved_join_light(bst_resolved *to, const bst_resolved *from, bst_parallel *pool) {
    enum { ROWS = 32 };
    joining rows = {&to->areas.sums, &from->areas.sums};
    assert(to->areas.kept_count == 0 && from->areas.kept_count == 0);
    bst_parallel_for(pool, to->image.height, ROWS, join_rows, &rows);
    to->image.surface_light = fmax(to->image.surface_light, from->image.surface_light);
    for (int i = 0; i < BST_RESOLVED_PENUMBRAE; i++) {
        bst_resolved_penumbra *p = &to->image.penumbrae[i];
        p->light_px2 = fmax(p->light_px2, from->image.penumbrae[i].light_px2);
        p->px = fmax(p->px, from->image.penumbrae[i].px);
    }
    for (int i = 0; i < 2; i++) {
        to->image.reached_px[i] = fmax(to->image.reached_px[i], from->image.reached_px[i]);
    }
}

void bst_resolved_end_light(bst_resolved *r, double scale_rad) {
    add_kept(&r->areas);
    r->image.second = r->areas.second;
    bst_area_sums_finish(&r->areas.sums, r->image.cell_px * scale_rad, &r->image);
}

bst_status bst_resolved_add_areas(bst_ctx *ctx, const bst_resolved_adding *a, double weight) {
    bst_resolved_areas *s = &a->r->areas;
    const bst_satellite *sat = a->r->satellite;
    bst_resolved_light_view views[BST_RESOLVED_LIGHTS];
    views[0] = light_view_of(a, bst_resolved_shadow_sun(a->light));
    BST_TRY(begin_light_view(ctx, a, 0, &views[0]));
    BST_TRY(bst_resolved_place_facets(ctx, a, &views[0]));
    BST_TRY(bst_facet_layers_find(ctx, &s->eye, s->wanted));
    BST_TRY(look_from_light(ctx, a, 0, &views[0]));
    if (a->earth) {
        views[1] = light_view_of(a, a->light->earthlight->centre);
        BST_TRY(begin_light_view(ctx, a, 1, &views[1]));
        place_for_earth(a, &views[1]);
        BST_TRY(look_from_light(ctx, a, 1, &views[1]));
    } else if (s->lit[1].doubtful) {
        memset(s->lit[1].doubtful, 0, (size_t)sat->facet_count);
    }
    /* light of whole facets, in place of `even` */
    for (int f = 0; f < sat->facet_count; f++) {
        s->even[f] = s->eye.facing[f] ? add_facet(a, f, views, weight) : 0.0;
    }
    s->even[sat->facet_count] = 0.0;
    keep(s);
    return BST_OK;
}
