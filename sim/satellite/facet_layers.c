#include "sim/satellite/facet_layers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/polygon_cut.h"

/* Side of a bin, in cells; levels of nearness. */
enum { BIN = 8, LEVELS = 4096 };

/* Marks of cells; borders are marked last. */
enum { SEVERAL_LAYERS = 1, AT_BORDER = 2 };

/* Width about borders that counts as theirs, in cells: they may cross another one there. */
static const double MARGIN = 1.0;

/* Areas of facets in a view, in cells, below that are none. */
static const double LEAST_AREA = 1e-9;

void bst_facet_layers_free(bst_facet_layers *l) {
    free(l->at);
    free(l->near);
    free(l->facing);
    free(l->doubtful);
    free(l->crowded);
    free(l->boxes);
    free(l->order);
    free(l->crossings);
    free(l->outside);
    free(l->needed);
    free(l->bin_first);
    free(l->entries);
    free(l->seen);
    bst_polygon_clip_free(&l->clip);
    *l = (bst_facet_layers){.width = 0};
}

/* Allocates for a model once. */
static bst_status reserve_facets(bst_ctx *ctx, bst_facet_layers *l, const bst_facet_net *net) {
    size_t facets = (size_t)net->satellite->facet_count + 1;
    size_t vertices = (size_t)net->vertex_count + 1;
    l->net = net;
    l->at = calloc(vertices, sizeof *l->at);
    l->near = calloc(vertices, sizeof *l->near);
    l->facing = calloc(facets, sizeof *l->facing);
    l->doubtful = calloc(facets, sizeof *l->doubtful);
    l->boxes = calloc(facets, sizeof *l->boxes);
    l->order = calloc(facets, sizeof *l->order);
    l->seen = calloc(facets, sizeof *l->seen);
    l->outside = calloc((size_t)net->edge_count + 1, sizeof *l->outside);
    if (!l->at || !l->near || !l->facing || !l->doubtful || !l->boxes || !l->order || !l->seen ||
        !l->outside) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the view of %d facets",
                        net->satellite->facet_count);
    }
    return bst_polygon_clip_create(ctx, &l->clip);
}

bst_status bst_facet_layers_begin(bst_ctx *ctx, bst_facet_layers *l, const bst_facet_net *net,
                                  int width, int height) {
    size_t cells = (size_t)width * (size_t)height;
    if (!l->clip.points) {
        BST_TRY(reserve_facets(ctx, l, net));
    }
    l->width = width;
    l->height = height;
    l->bins_x = (width + BIN - 1) / BIN;
    l->bins_y = (height + BIN - 1) / BIN;
    if (cells > l->cell_capacity) {
        size_t bins = cells / BIN + (size_t)(width + height) + 2;
        free(l->crowded);
        free(l->bin_first);
        free(l->needed);
        l->crowded = malloc(cells * sizeof *l->crowded);
        l->bin_first = malloc(bins * sizeof *l->bin_first);
        l->needed = malloc(bins * sizeof *l->needed);
        l->cell_capacity = cells;
        if (!l->crowded || !l->bin_first || !l->needed) {
            l->cell_capacity = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a view of %d x %d cells", width,
                            height);
        }
    }
    return BST_OK;
}

static int cell_of(double x, int count) {
    return x > 0.0 ? (x < count ? (int)x : count - 1) : 0;
}

/* Appends the crossings of a border with the middles of rows. */
static bst_status cross_rows(bst_ctx *ctx, bst_facet_layers *l, int edge, int layers) {
    bst_point2 a = l->at[l->net->edges[edge].a], b = l->at[l->net->edges[edge].b];
    if (b.y < a.y) {
        bst_point2 c = a;
        a = b;
        b = c;
        layers = -layers;
    }
    /* rows whose middle is from a.y on and before b.y */
    double first = ceil(a.y - 0.5), end = ceil(b.y - 0.5);
    first = first > 0.0 ? first : 0.0;
    end = end < l->height ? end : l->height;
    if (!(first < end)) {
        return BST_OK;
    }
    double slope = (b.x - a.x) / (b.y - a.y);
    int count = (int)(end - first);
    if (l->crossing_count + count > l->crossing_capacity) {
        int capacity = 2 * l->crossing_capacity + count + 1024;
        void *crossings = realloc(l->crossings, (size_t)capacity * sizeof *l->crossings);
        if (!crossings) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d borders of facets", capacity);
        }
        l->crossings = crossings;
        l->crossing_capacity = capacity;
    }
    for (int j = (int)first; j < (int)end; j++) {
        l->crossings[l->crossing_count++] =
            (bst_layers_crossing){a.x + (j + 0.5 - a.y) * slope, j, edge, layers};
    }
    return BST_OK;
}

static int compare_crossings(const void *p, const void *q) {
    const bst_layers_crossing *a = p, *b = q;
    if (a->row != b->row) {
        return a->row < b->row ? -1 : 1;
    }
    if (a->x != b->x) {
        return a->x < b->x ? -1 : 1;
    }
    return (a->edge > b->edge) - (a->edge < b->edge);
}

/* Counts the layers along the rows: marks cells of several, and sets `outside` of the borders. */
static void count_layers(bst_facet_layers *l) {
    qsort(l->crossings, (size_t)l->crossing_count, sizeof *l->crossings, compare_crossings);
    int layers = 0;
    for (int n = 0; n < l->crossing_count; n++) {
        const bst_layers_crossing *c = &l->crossings[n];
        if (n > 0 && l->crossings[n - 1].row != c->row) {
            layers = 0;
        }
        int after = layers + c->layers, least = layers < after ? layers : after;
        int8_t *outside = &l->outside[c->edge];
        *outside = least > *outside ? (int8_t)(least < 2 ? least : 2) : *outside;
        layers = after;
        if (layers > 1 || layers < 0) {
            bool more = n + 1 < l->crossing_count && c[1].row == c->row;
            double to = more ? c[1].x : l->width;
            if (to > 0.0 && c->x < l->width) {
                int i = cell_of(c->x, l->width), end = cell_of(to, l->width);
                memset(l->crowded + (size_t)c->row * (size_t)l->width + i, SEVERAL_LAYERS,
                       (size_t)(end - i + 1));
            }
        }
    }
}

/* Marks the cells about a border. */
static void mark_border(bst_facet_layers *l, bst_point2 a, bst_point2 b) {
    if (b.y < a.y) {
        bst_point2 c = a;
        a = b;
        b = c;
    }
    if (b.y < -MARGIN || a.y > l->height + MARGIN) {
        return;
    }
    double slope = b.y > a.y ? (b.x - a.x) / (b.y - a.y) : 0.0;
    int first = cell_of(a.y - MARGIN, l->height), last = cell_of(b.y + MARGIN, l->height);
    for (int j = first; j <= last; j++) {
        double up = j - MARGIN, down = j + 1.0 + MARGIN;
        double from = up > a.y ? a.x + (up - a.y) * slope : a.x;
        double to = down < b.y ? a.x + (down - a.y) * slope : b.x;
        double low = (from < to ? from : to) - MARGIN, high = (from < to ? to : from) + MARGIN;
        if (low <= l->width && high >= 0.0) {
            int i = cell_of(low, l->width), end = cell_of(high, l->width);
            memset(l->crowded + (size_t)j * (size_t)l->width + i, AT_BORDER, (size_t)(end - i + 1));
        }
    }
}

/* Marks the cells where something may be hidden. */
static bst_status mark_cells(bst_ctx *ctx, bst_facet_layers *l) {
    memset(l->crowded, 0, (size_t)l->width * (size_t)l->height);
    l->crossing_count = 0;
    for (int e = 0; e < l->net->edge_count; e++) {
        const bst_net_edge *edge = &l->net->edges[e];
        int layers = l->facing[edge->left] - l->facing[edge->right];
        if (layers != 0) {
            l->outside[e] = -1;
            BST_TRY(cross_rows(ctx, l, e, layers));
        }
    }
    count_layers(l);
    for (int e = 0; e < l->net->edge_count; e++) {
        const bst_net_edge *edge = &l->net->edges[e];
        /* a border that crosses no middle of a row may have layers on both sides */
        if (l->facing[edge->left] != l->facing[edge->right] && l->outside[e] != 0) {
            mark_border(l, l->at[edge->a], l->at[edge->b]);
        }
    }
    return BST_OK;
}

/* Finds the boxes of the facets that face the view, and the range of their nearness. */
static void make_boxes(bst_facet_layers *l) {
    const bst_satellite *s = l->net->satellite;
    double least = INFINITY, most = -INFINITY;
    for (int v = 0; v < l->net->vertex_count; v++) {
        least = l->near[v] < least ? l->near[v] : least;
        most = l->near[v] > most ? l->near[v] : most;
    }
    l->level_from = most + l->same;
    l->level_per = (LEVELS - 1) / fmax(most - least + 2.0 * l->same, 1e-300);
    for (int f = 0; f < s->facet_count; f++) {
        if (!l->facing[f]) {
            continue;
        }
        const int *corner = l->net->corner + s->facets[f].first;
        bst_point2 low = l->at[corner[0]], high = low;
        double near = l->near[corner[0]], far = near;
        for (int i = 1; i < s->facets[f].count; i++) {
            bst_point2 p = l->at[corner[i]];
            double z = l->near[corner[i]];
            low.x = p.x < low.x ? p.x : low.x;
            low.y = p.y < low.y ? p.y : low.y;
            high.x = p.x > high.x ? p.x : high.x;
            high.y = p.y > high.y ? p.y : high.y;
            near = z > near ? z : near;
            far = z < far ? z : far;
        }
        bool off = !(high.x >= 0.0 && high.y >= 0.0 && low.x < l->width && low.y < l->height);
        l->boxes[f] = (bst_layers_box){{(float)low.x, (float)low.y},
                                       {off ? -1.0F : (float)high.x, (float)high.y},
                                       f,
                                       (uint16_t)((l->level_from - near - l->same) * l->level_per),
                                       (uint16_t)((l->level_from - far + l->same) * l->level_per)};
    }
}

/* Orders the facets that face the view by their nearest level. */
static void order_facets(bst_facet_layers *l) {
    int first[LEVELS + 1] = {0}, facets = l->net->satellite->facet_count;
    for (int f = 0; f < facets; f++) {
        first[l->facing[f] && l->boxes[f].high[0] >= 0.0F ? l->boxes[f].nearest + 1 : 0]++;
    }
    first[0] = 0;
    for (int i = 0; i < LEVELS; i++) {
        first[i + 1] += first[i];
    }
    l->order_count = first[LEVELS];
    for (int f = 0; f < facets; f++) {
        if (l->facing[f] && l->boxes[f].high[0] >= 0.0F) {
            l->order[first[l->boxes[f].nearest]++] = f;
        }
    }
}

/* Cells or bins of a box: first and last column, first and last row. */
static void range_of(const bst_facet_layers *l, const bst_layers_box *b, int size, int out[4]) {
    out[0] = cell_of((double)b->low[0], l->width) / size;
    out[1] = cell_of((double)b->high[0], l->width) / size;
    out[2] = cell_of((double)b->low[1], l->height) / size;
    out[3] = cell_of((double)b->high[1], l->height) / size;
}

/* All marks of the cells of a box. */
static int marks_of(const bst_facet_layers *l, const bst_layers_box *b) {
    int at[4], marks = 0;
    range_of(l, b, 1, at);
    for (int j = at[2]; j <= at[3] && marks < AT_BORDER; j++) {
        const uint8_t *row = l->crowded + (size_t)j * (size_t)l->width;
        for (int i = at[0]; i <= at[1]; i++) {
            marks |= row[i];
        }
    }
    return marks;
}

/* Marks the bins of a box. */
static void need_bins(bst_facet_layers *l, const bst_layers_box *b) {
    int at[4];
    range_of(l, b, BIN, at);
    for (int j = at[2]; j <= at[3]; j++) {
        memset(l->needed + j * l->bins_x + at[0], 1, (size_t)(at[1] - at[0] + 1));
    }
}

/* Enters the facets in the bins that are needed: counts them, or with `fill` copies their boxes. */
static void enter(bst_facet_layers *l, bool fill) {
    for (int n = 0; n < l->order_count; n++) {
        const bst_layers_box *b = &l->boxes[l->order[n]];
        int at[4];
        range_of(l, b, BIN, at);
        for (int j = at[2]; j <= at[3]; j++) {
            for (int i = j * l->bins_x + at[0]; i <= j * l->bins_x + at[1]; i++) {
                if (l->needed[i] && fill) {
                    l->entries[l->bin_first[i]++] = *b;
                } else if (l->needed[i]) {
                    l->bin_first[i + 1]++;
                }
            }
        }
    }
}

/* Fills the bins. */
static bst_status fill_bins(bst_ctx *ctx, bst_facet_layers *l) {
    int bins = l->bins_x * l->bins_y;
    order_facets(l);
    memset(l->bin_first, 0, ((size_t)bins + 1) * sizeof *l->bin_first);
    enter(l, false);
    for (int i = 0; i < bins; i++) {
        l->bin_first[i + 1] += l->bin_first[i];
    }
    int count = l->bin_first[bins];
    if (count > l->entry_capacity) {
        free(l->entries);
        l->entry_capacity = count + count / 2 + 1024;
        l->entries = malloc((size_t)l->entry_capacity * sizeof *l->entries);
        if (!l->entries) {
            l->entry_capacity = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the places of %d facets", count);
        }
    }
    enter(l, true);
    /* filling moved the first entry of each bin to that of the next one */
    memmove(l->bin_first + 1, l->bin_first, (size_t)bins * sizeof *l->bin_first);
    l->bin_first[0] = 0;
    return BST_OK;
}

bst_status bst_facet_layers_find(bst_ctx *ctx, bst_facet_layers *l, const uint8_t *wanted) {
    int facets = l->net->satellite->facet_count;
    bool any = false;
    BST_TRY(mark_cells(ctx, l));
    make_boxes(l);
    memset(l->needed, 0, (size_t)l->bins_x * (size_t)l->bins_y);
    for (int f = 0; f < facets; f++) {
        const bst_layers_box *b = &l->boxes[f];
        l->doubtful[f] =
            wanted[f] && l->facing[f] && b->high[0] >= 0.0F ? (uint8_t)marks_of(l, b) : 0;
        if (l->doubtful[f]) {
            need_bins(l, b);
            any = true;
        }
    }
    memset(l->seen, -1, ((size_t)facets + 1) * sizeof *l->seen);
    return any ? fill_bins(ctx, l) : BST_OK;
}

/* A facet in the view, counter-clockwise. */
typedef struct outline {
    bst_point2 p[BST_LAYERS_CORNERS_MAX];
    int count;
    double low[2], high[2], least, most; /* box, and nearness of the corners */
} outline;

static void make_outline(const bst_facet_layers *l, int facet, outline *o) {
    const bst_facet *f = &l->net->satellite->facets[facet];
    const int *corner = l->net->corner + f->first;
    o->count = f->count;
    o->low[0] = o->low[1] = o->least = INFINITY;
    o->high[0] = o->high[1] = o->most = -INFINITY;
    for (int i = 0; i < f->count; i++) {
        int v = corner[f->count - 1 - i];
        bst_point2 p = l->at[v];
        double near = l->near[v];
        o->p[i] = p;
        o->low[0] = p.x < o->low[0] ? p.x : o->low[0];
        o->low[1] = p.y < o->low[1] ? p.y : o->low[1];
        o->high[0] = p.x > o->high[0] ? p.x : o->high[0];
        o->high[1] = p.y > o->high[1] ? p.y : o->high[1];
        o->least = near < o->least ? near : o->least;
        o->most = near > o->most ? near : o->most;
    }
}

bool bst_facet_layers_plane(const bst_facet_layers *l, int facet, double out[3]) {
    const bst_facet *f = &l->net->satellite->facets[facet];
    const int *corner = l->net->corner + f->first;
    bst_point2 o = l->at[corner[0]];
    double most = 0.0, z0 = l->near[corner[0]];
    for (int i = 2; i < f->count; i++) {
        bst_point2 a = l->at[corner[i - 1]], b = l->at[corner[i]];
        double area = (a.x - o.x) * (b.y - o.y) - (b.x - o.x) * (a.y - o.y);
        if (fabs(area) > fabs(most)) {
            double za = l->near[corner[i - 1]] - z0, zb = l->near[corner[i]] - z0;
            most = area;
            out[1] = (za * (b.y - o.y) - zb * (a.y - o.y)) / area;
            out[2] = (zb * (a.x - o.x) - za * (b.x - o.x)) / area;
            out[0] = z0 - out[1] * o.x - out[2] * o.y;
        }
    }
    return fabs(most) > LEAST_AREA;
}

/* True if the boxes of two facets share cells. */
static bool boxes_meet(const bst_layers_box *a, const bst_layers_box *b) {
    return a->low[0] < b->high[0] && b->low[0] < a->high[0] && a->low[1] < b->high[1] &&
           b->low[1] < a->high[1];
}

/* The part of a polygon, [room 2 * BST_LAYERS_CORNERS_MAX], where c[0] + c[1] x + c[2] y >= 0. */
static int keep(bst_point2 *p, int count, const double c[3]) {
    bst_point2 out[2 * BST_LAYERS_CORNERS_MAX];
    int n = 0;
    for (int i = 0; i < count; i++) {
        bst_point2 a = p[i], b = p[i + 1 < count ? i + 1 : 0];
        double da = c[0] + c[1] * a.x + c[2] * a.y, db = c[0] + c[1] * b.x + c[2] * b.y;
        if (da >= 0.0 && n < 2 * BST_LAYERS_CORNERS_MAX) {
            out[n++] = a;
        }
        if ((da < 0.0) != (db < 0.0) && n < 2 * BST_LAYERS_CORNERS_MAX) {
            double t = da / (da - db);
            out[n++] = (bst_point2){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    memcpy(p, out, (size_t)n * sizeof *out);
    return n >= 3 ? n : 0;
}

/* What a facet hides of another one: the part of their intersection where it is nearer.
 *
 * Given:     own, own_plane  the facet behind
 * Returned:  number of corners in to[2 * BST_LAYERS_CORNERS_MAX] */
static int hidden_part(const bst_facet_layers *l, int facet, int behind, const outline *own,
                       const double own_plane[3], bst_point2 *to) {
    outline other;
    bst_point2 work[2 * BST_LAYERS_CORNERS_MAX];
    double c[3], least = INFINITY, most = -INFINITY;
    make_outline(l, facet, &other);
    if (bst_polygon_is_separate(own->p, own->count, other.p, other.count) ||
        !bst_facet_layers_plane(l, facet, c)) {
        return 0;
    }
    int n = bst_polygon_intersection(other.p, other.count, own->p, own->count, work, to);
    if (n < 3 || other.least > own->most) {
        return n;
    }
    for (int i = 0; i < 3; i++) {
        c[i] -= own_plane[i];
    }
    for (int i = 0; i < n; i++) {
        double d = c[0] + c[1] * to[i].x + c[2] * to[i].y;
        least = d < least ? d : least;
        most = d > most ? d : most;
    }
    if (most <= l->same) { /* behind, or in the same plane: then the first one is seen */
        return least >= -l->same && facet < behind ? n : 0;
    }
    return least >= -l->same ? n : keep(to, n, c);
}

static bool share_vertex(const bst_facet_net *net, int f, int g) {
    const bst_facet *a = &net->satellite->facets[f], *b = &net->satellite->facets[g];
    for (int i = a->first; i < a->first + a->count; i++) {
        for (int k = b->first; k < b->first + b->count; k++) {
            if (net->corner[i] == net->corner[k]) {
                return true;
            }
        }
    }
    return false;
}

/* True if a facet covers a place; its border does. */
static bool covers(const bst_facet_layers *l, int facet, bst_point2 p) {
    static const double ROUNDING = 1e-12;
    const bst_facet *f = &l->net->satellite->facets[facet];
    const int *corner = l->net->corner + f->first;
    for (int i = 0; i < f->count; i++) {
        bst_point2 a = l->at[corner[i]], b = l->at[corner[i + 1 < f->count ? i + 1 : 0]];
        if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > ROUNDING) {
            return false;
        }
    }
    return true;
}

/* What of a facet is seen that no border crosses: all of it, or nothing. */
typedef enum seen_part { SEEN_ALL, SEEN_NOTHING, SEEN_UNKNOWN } seen_part;

/* Finds it at the middle of the facet. Unknown: another facet, not a neighbour, is as near
 * somewhere, so that the planes may cross. */
static seen_part look_at_middle(const bst_facet_layers *l, const bst_layers_box *box,
                                const outline *own) {
    int at[4];
    bst_point2 middle = {0.0, 0.0};
    seen_part seen = SEEN_ALL;
    for (int i = 0; i < own->count; i++) {
        middle.x += own->p[i].x / own->count;
        middle.y += own->p[i].y / own->count;
    }
    range_of(l, box, BIN, at);
    for (int j = at[2]; j <= at[3]; j++) {
        for (int i = j * l->bins_x + at[0]; i <= j * l->bins_x + at[1]; i++) {
            const bst_layers_box *b = &l->entries[l->bin_first[i]];
            const bst_layers_box *end = &l->entries[l->bin_first[i + 1]];
            for (; b < end && b->nearest <= box->farthest; b++) {
                if (!boxes_meet(b, box)) {
                    continue;
                }
                if (b->farthest >= box->nearest) {
                    if (!share_vertex(l->net, b->facet, box->facet)) {
                        return SEEN_UNKNOWN;
                    }
                } else if (seen == SEEN_ALL && covers(l, b->facet, middle)) {
                    seen = SEEN_NOTHING;
                }
            }
        }
    }
    return seen;
}

bool bst_facet_layers_cut(bst_facet_layers *l, int facet) {
    outline own;
    double plane[3];
    bool whole = true;
    int at[4];
    const bst_layers_box *box = &l->boxes[facet];
    if (!bst_facet_layers_plane(l, facet, plane)) {
        return true;
    }
    make_outline(l, facet, &own);
    if (l->doubtful[facet] < AT_BORDER) {
        seen_part seen = look_at_middle(l, box, &own);
        l->clip.piece_count = 0;
        if (seen != SEEN_UNKNOWN) {
            return seen == SEEN_ALL;
        }
    }
    range_of(l, box, BIN, at);
    l->seen[facet] = facet;
    for (int n = 0; n < (at[1] - at[0] + 1) * (at[3] - at[2] + 1); n++) {
        int columns = at[1] - at[0] + 1;
        int bin = (at[2] + n / columns) * l->bins_x + at[0] + n % columns;
        const bst_layers_box *b = &l->entries[l->bin_first[bin]];
        const bst_layers_box *end = &l->entries[l->bin_first[bin + 1]];
        for (; b < end && b->nearest <= box->farthest; b++) {
            bst_point2 part[2 * BST_LAYERS_CORNERS_MAX];
            if (!boxes_meet(b, box) || l->seen[b->facet] == facet) {
                continue;
            }
            l->seen[b->facet] = facet;
            int corners = hidden_part(l, b->facet, facet, &own, plane, part);
            if (corners < 3) {
                continue;
            }
            if (whole) {
                bst_polygon_clip_start(&l->clip, own.p, own.count);
                whole = false;
            }
            bst_polygon_clip_subtract(&l->clip, part, corners, false);
            if (bst_polygon_clip_is_empty(&l->clip)) {
                return false;
            }
        }
    }
    return whole;
}
