#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/facet_layers_internal.h"

/* Levels of nearness. */
enum { LEVELS = 4096 };

/* Width about borders that counts as theirs, in cells: they may cross another one there. */
static const double MARGIN = 1.0;

void bst_facet_layers_free(bst_facet_layers *l) {
    free(l->at);
    free(l->near);
    free(l->facing);
    free(l->doubtful);
    free(l->crowded);
    free(l->boxes);
    free(l->order);
    free(l->crossings);
    free(l->sorted);
    free(l->row_first);
    free(l->borders);
    free(l->border_first);
    free(l->border_entries);
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
    l->bins_x = (width + BST_LAYERS_BIN - 1) / BST_LAYERS_BIN;
    l->bins_y = (height + BST_LAYERS_BIN - 1) / BST_LAYERS_BIN;
    if (height > l->row_capacity) {
        free(l->row_first);
        l->row_first = malloc(((size_t)height + 1) * sizeof *l->row_first);
        l->row_capacity = l->row_first ? height : 0;
        if (!l->row_first) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a view of %d rows", height);
        }
    }
    if (cells > l->cell_capacity) {
        size_t bins = cells / BST_LAYERS_BIN + (size_t)(width + height) + 2;
        free(l->crowded);
        free(l->bin_first);
        free(l->border_first);
        free(l->needed);
        l->crowded = malloc(cells * sizeof *l->crowded);
        l->bin_first = malloc(bins * sizeof *l->bin_first);
        l->border_first = malloc(bins * sizeof *l->border_first);
        l->needed = malloc(bins * sizeof *l->needed);
        l->cell_capacity = cells;
        if (!l->crowded || !l->bin_first || !l->border_first || !l->needed) {
            l->cell_capacity = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a view of %d x %d cells", width,
                            height);
        }
    }
    return BST_OK;
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

/* Orders the crossings by row, then by x; those of one place by their edge. */
static bst_status sort_crossings(bst_ctx *ctx, bst_facet_layers *l) {
    if (l->crossing_capacity > l->sorted_capacity) {
        free(l->sorted);
        l->sorted = malloc((size_t)l->crossing_capacity * sizeof *l->sorted);
        l->sorted_capacity = l->sorted ? l->crossing_capacity : 0;
        if (!l->sorted) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d borders of facets",
                            l->crossing_capacity);
        }
    }
    /* row_first[j + 1]: where the next crossing of row j goes; at the end, the end of the row */
    int *next = l->row_first + 1, sum = 0;
    memset(l->row_first, 0, ((size_t)l->height + 1) * sizeof *l->row_first);
    for (int n = 0; n < l->crossing_count; n++) {
        next[l->crossings[n].row]++;
    }
    for (int j = 0; j < l->height; j++) {
        int count = next[j];
        next[j] = sum;
        sum += count;
    }
    for (int n = 0; n < l->crossing_count; n++) { /* edges come in order */
        l->sorted[next[l->crossings[n].row]++] = l->crossings[n];
    }
    for (int n = 1; n < l->crossing_count; n++) {
        bst_layers_crossing c = l->sorted[n];
        int at = n;
        for (; at > 0 && l->sorted[at - 1].row == c.row && l->sorted[at - 1].x > c.x; at--) {
            l->sorted[at] = l->sorted[at - 1];
        }
        l->sorted[at] = c;
    }
    bst_layers_crossing *former = l->crossings;
    int capacity = l->crossing_capacity;
    l->crossings = l->sorted;
    l->crossing_capacity = l->sorted_capacity;
    l->sorted = former;
    l->sorted_capacity = capacity;
    return BST_OK;
}

/* Counts the layers along the rows: marks cells of several, and sets `outside` of the borders. */
static void count_layers(bst_facet_layers *l) {
    int layers = 0;
    for (int n = 0; n < l->crossing_count; n++) {
        bst_layers_crossing *c = &l->crossings[n];
        if (n > 0 && l->crossings[n - 1].row != c->row) {
            layers = 0;
        }
        int after = layers + c->layers, least = layers < after ? layers : after;
        int8_t *outside = &l->outside[c->edge];
        *outside = least > *outside ? (int8_t)(least < 2 ? least : 2) : *outside;
        c->layers = layers = after;
        if (layers > 1 || layers < 0) {
            bool more = n + 1 < l->crossing_count && c[1].row == c->row;
            double to = more ? c[1].x : l->width;
            if (to > 0.0 && c->x < l->width) {
                int i = bst_layers_cell_of(c->x, l->width), end = bst_layers_cell_of(to, l->width);
                memset(l->crowded + (size_t)c->row * (size_t)l->width + i, BST_LAYERS_SEVERAL,
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
    int first = bst_layers_cell_of(a.y - MARGIN, l->height), last = bst_layers_cell_of(b.y + MARGIN, l->height);
    for (int j = first; j <= last; j++) {
        double up = j - MARGIN, down = j + 1.0 + MARGIN;
        double from = up > a.y ? a.x + (up - a.y) * slope : a.x;
        double to = down < b.y ? a.x + (down - a.y) * slope : b.x;
        double low = (from < to ? from : to) - MARGIN, high = (from < to ? to : from) + MARGIN;
        if (low <= l->width && high >= 0.0) {
            int i = bst_layers_cell_of(low, l->width), end = bst_layers_cell_of(high, l->width);
            memset(l->crowded + (size_t)j * (size_t)l->width + i, BST_LAYERS_AT_BORDER, (size_t)(end - i + 1));
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
    BST_TRY(sort_crossings(ctx, l));
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

/* All marks of the cells of a box. */
static int marks_of(const bst_facet_layers *l, const bst_layers_box *b) {
    int at[4], marks = 0;
    bst_layers_range(l, b, 1, at);
    for (int j = at[2]; j <= at[3] && marks < BST_LAYERS_AT_BORDER; j++) {
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
    bst_layers_range(l, b, BST_LAYERS_BIN, at);
    for (int j = at[2]; j <= at[3]; j++) {
        memset(l->needed + j * l->bins_x + at[0], 1, (size_t)(at[1] - at[0] + 1));
    }
}

/* Enters the facets in the bins that are needed: counts them, or with `fill` copies their boxes. */
static void enter(bst_facet_layers *l, bool fill) {
    for (int n = 0; n < l->order_count; n++) {
        const bst_layers_box *b = &l->boxes[l->order[n]];
        int at[4];
        bst_layers_range(l, b, BST_LAYERS_BIN, at);
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
    if (any) {
        BST_TRY(bst_facet_borders_fill(ctx, l));
        BST_TRY(fill_bins(ctx, l));
    }
    return BST_OK;
}

