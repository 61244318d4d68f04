#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/facet_layers_internal.h"

/* Levels of nearness. */
enum { LEVELS = 4096 };

/* Width about borders that counts as theirs, in cells: they may cross another one there. */
static const double MARGIN = 0.01;

/* Areas of facets in a view, in cells, below that are none. */
static const double LEAST_AREA = 1e-9;

void bst_facet_layers_free(bst_facet_layers *l) {
    free(l->at);
    free(l->near);
    free(l->facing);
    free(l->doubtful);
    free(l->known);
    free(l->crowded);
    free(l->vertex_bins);
    free(l->off);
    free(l->about);
    free(l->boxes);
    free(l->bins);
    free(l->order);
    free(l->crossings);
    free(l->sorted);
    free(l->row_first);
    free(l->borders);
    free(l->border_first);
    free(l->border_entries);
    free(l->chosen);
    free(l->marked);
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
    l->known = calloc(facets, sizeof *l->known);
    l->vertex_bins = calloc(vertices, sizeof *l->vertex_bins);
    l->off = calloc(vertices, sizeof *l->off);
    l->boxes = calloc(facets, sizeof *l->boxes);
    l->bins = calloc(facets, sizeof *l->bins);
    l->order = calloc(facets, sizeof *l->order);
    l->seen = calloc(facets, sizeof *l->seen);
    l->chosen = calloc(facets, sizeof *l->chosen);
    if (!l->at || !l->near || !l->facing || !l->doubtful || !l->known || !l->vertex_bins ||
        !l->off || !l->boxes || !l->bins || !l->order || !l->seen || !l->chosen) {
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
        free(l->marked);
        free(l->about);
        l->crowded = malloc(cells * sizeof *l->crowded);
        l->bin_first = malloc(bins * sizeof *l->bin_first);
        l->border_first = malloc(bins * sizeof *l->border_first);
        l->needed = malloc(bins * sizeof *l->needed);
        l->marked = malloc(bins * sizeof *l->marked);
        l->about = malloc(bins * sizeof *l->about);
        l->cell_capacity = cells;
        if (!l->crowded || !l->bin_first || !l->border_first || !l->needed || !l->marked ||
            !l->about) {
            l->cell_capacity = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a view of %d x %d cells", width,
                            height);
        }
    }
    return BST_OK;
}

/* Appends the crossings of a border with the middles of rows. */
static bst_status cross_rows(bst_ctx *ctx, bst_facet_layers *l, int border) {
    bst_point2 a = l->borders[border].a, b = l->borders[border].b;
    int layers = l->borders[border].layers;
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
            (bst_layers_crossing){a.x + (j + 0.5 - a.y) * slope, j, border, layers};
    }
    return BST_OK;
}

/* Orders the crossings by row, then by x; those of one place by their border. */
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
    for (int n = 0; n < l->crossing_count; n++) { /* borders come in order */
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

/* Sets bytes, of which there are often few. */
static inline void set_bytes(uint8_t *bytes, int count, uint8_t as) {
    enum { FEW = 8 };
    if (count > FEW) {
        memset(bytes, as, (size_t)count);
        return;
    }
    for (int i = 0; i < count; i++) {
        bytes[i] = as;
    }
}

/* Marks the cells of a row from one place to another, and their bins. */
static void mark(bst_facet_layers *l, int row, double from, double to, uint8_t as) {
    int first = bst_layers_cell_of(from, l->width), end = bst_layers_cell_of(to, l->width);
    uint8_t *bins = l->marked + row / BST_LAYERS_BIN * l->bins_x;
    set_bytes(l->crowded + (size_t)row * (size_t)l->width + first, end - first + 1, as);
    first /= BST_LAYERS_BIN;
    end /= BST_LAYERS_BIN;
    set_bytes(bins + first, end - first + 1, 1);
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
        int *outside = &l->borders[c->border].outside;
        *outside = least > *outside ? least : *outside;
        c->layers = layers = after;
        if (layers > 1 || layers < 0) {
            bool more = n + 1 < l->crossing_count && c[1].row == c->row;
            double to = more ? c[1].x : l->width;
            if (to > 0.0 && c->x < l->width) {
                mark(l, c->row, c->x, to, BST_LAYERS_SEVERAL);
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
    int first = bst_layers_cell_of(a.y - MARGIN, l->height),
        last = bst_layers_cell_of(b.y + MARGIN, l->height);
    for (int j = first; j <= last; j++) {
        double up = j - MARGIN, down = j + 1.0 + MARGIN;
        double from = up > a.y ? a.x + (up - a.y) * slope : a.x;
        double to = down < b.y ? a.x + (down - a.y) * slope : b.x;
        double low = (from < to ? from : to) - MARGIN, high = (from < to ? to : from) + MARGIN;
        if (low <= l->width && high >= 0.0) {
            mark(l, j, low, high, BST_LAYERS_AT_BORDER);
        }
    }
}

/* Marks the cells where something may be hidden. */
static bst_status mark_cells(bst_ctx *ctx, bst_facet_layers *l) {
    memset(l->crowded, 0, (size_t)l->width * (size_t)l->height);
    memset(l->marked, 0, (size_t)l->bins_x * (size_t)l->bins_y);
    l->crossing_count = 0;
    BST_TRY(bst_facet_borders_list(ctx, l));
    for (int n = 0; n < l->border_count; n++) {
        BST_TRY(cross_rows(ctx, l, n));
    }
    BST_TRY(sort_crossings(ctx, l));
    count_layers(l);
    BST_TRY(bst_facet_borders_enter(ctx, l));
    for (int n = 0; n < l->border_count; n++) {
        /* a border that crosses no middle of a row, or another border, may have layers on both
         * sides elsewhere */
        if (l->borders[n].outside != 0 || bst_facet_borders_meet(l, n)) {
            mark_border(l, l->borders[n].a, l->borders[n].b);
        }
    }
    return BST_OK;
}

/* Finds the box of a facet. */
static void make_box(bst_facet_layers *l, int f) {
    const int *corner = l->net->corner + l->net->first[f];
    const int *end = l->net->corner + l->net->first[f + 1];
    bst_point2 low = l->at[corner[0]], high = low;
    double near = l->near[corner[0]], far = near;
    for (corner++; corner < end; corner++) {
        bst_point2 p = l->at[*corner];
        double z = l->near[*corner];
        low.x = p.x < low.x ? p.x : low.x;
        low.y = p.y < low.y ? p.y : low.y;
        high.x = p.x > high.x ? p.x : high.x;
        high.y = p.y > high.y ? p.y : high.y;
        near = z > near ? z : near;
        far = z < far ? z : far;
    }
    l->boxes[f] = (bst_layers_box){{(float)low.x, (float)low.y},
                                   {(float)high.x, (float)high.y},
                                   f,
                                   (uint16_t)((l->level_from - near - l->same) * l->level_per),
                                   (uint16_t)((l->level_from - far + l->same) * l->level_per)};
}

/* Bits of `off`: sides of the grid that a vertex is beyond, and that its bin is about one that is
 * looked for. */
enum { OFF_LEFT = 1, OFF_RIGHT = 2, OFF_UP = 4, OFF_DOWN = 8, OFF = 15, ABOUT = 16 };

/* Finds the bins of the vertices, and the range of nearness. */
static void place_vertices(bst_facet_layers *l) {
    double least = INFINITY, most = -INFINITY, width = l->width, height = l->height;
    for (int v = 0; v < l->net->vertex_count; v++) {
        bst_point2 p = l->at[v];
        l->vertex_bins[v] =
            (bst_layers_bin_of){bst_layers_cell_of(p.x, l->width) / BST_LAYERS_BIN,
                                bst_layers_cell_of(p.y, l->height) / BST_LAYERS_BIN};
        l->off[v] = (uint8_t)((p.x >= 0.0 ? 0 : OFF_LEFT) | (p.x < width ? 0 : OFF_RIGHT) |
                              (p.y >= 0.0 ? 0 : OFF_UP) | (p.y < height ? 0 : OFF_DOWN));
        least = l->near[v] < least ? l->near[v] : least;
        most = l->near[v] > most ? l->near[v] : most;
    }
    l->level_from = most + l->same;
    l->level_per = (LEVELS - 1) / fmax(most - least + 2.0 * l->same, 1e-300);
}

/* Notes which vertices are in a bin that is marked, or beside one. */
static void look_about(bst_facet_layers *l, const uint8_t *marks) {
    memset(l->about, 0, (size_t)l->bins_x * (size_t)l->bins_y);
    for (int j = 0; j < l->bins_y; j++) {
        for (int i = 0; i < l->bins_x; i++) {
            if (!marks[j * l->bins_x + i]) {
                continue;
            }
            int low = i > 0 ? i - 1 : i, high = i + 1 < l->bins_x ? i + 1 : i;
            for (int row = j > 0 ? j - 1 : j; row <= j + 1 && row < l->bins_y; row++) {
                for (int n = low; n <= high; n++) {
                    l->about[row * l->bins_x + n] = ABOUT;
                }
            }
        }
    }
    for (int v = 0; v < l->net->vertex_count; v++) {
        int about = l->about[l->vertex_bins[v].y * l->bins_x + l->vertex_bins[v].x];
        l->off[v] = (uint8_t)((l->off[v] & OFF) | about);
    }
}

/* Size of a facet up to which none of its places is in a bin that is not beside that of a corner:
 * the farthest one from all corners of a triangle is the middle of one of equal sides, 1 / sqrt(3)
 * of a side; a polygon of more is of triangles. */
static double small_m(const bst_facet_layers *l) {
    static const double ROUNDING = 1e-6;
    return l->cells_per_m > 0.0 ? (sqrt(3.0) - ROUNDING) * BST_LAYERS_BIN / l->cells_per_m : -1.0;
}

/* True if a facet may reach a bin that is looked for. *off: it is beyond the grid, perhaps in part.
 */
static inline bool may_reach(const bst_facet_layers *l, int f, double most_m, bool *off) {
    const int *corner = l->net->corner + l->net->first[f];
    const int *end = l->net->corner + l->net->first[f + 1];
    int any = l->off[*corner], all = any;
    for (corner++; corner < end; corner++) {
        int bits = l->off[*corner];
        any |= bits;
        all &= bits;
    }
    *off = (any & OFF) != 0;
    return !(all & OFF) && ((any & ABOUT) || (double)l->net->size_m[f] > most_m);
}

bool bst_facet_layers_is_within(const bst_facet_layers *l, int facet) {
    bool off;
    (void)may_reach(l, facet, 0.0, &off);
    return !off;
}

/* Finds the bins of a facet. */
static void find_bins(bst_facet_layers *l, int f) {
    const int *corner = l->net->corner + l->net->first[f];
    const int *end = l->net->corner + l->net->first[f + 1];
    bst_layers_bin_of low = l->vertex_bins[*corner], high = low;
    for (corner++; corner < end; corner++) {
        bst_layers_bin_of b = l->vertex_bins[*corner];
        low.x = b.x < low.x ? b.x : low.x;
        low.y = b.y < low.y ? b.y : low.y;
        high.x = b.x > high.x ? b.x : high.x;
        high.y = b.y > high.y ? b.y : high.y;
    }
    l->bins[f][0] = low.x;
    l->bins[f][1] = high.x;
    l->bins[f][2] = low.y;
    l->bins[f][3] = high.y;
}

/* True if one of the bins of a facet is marked. */
static bool any_bin(const bst_facet_layers *l, int facet, const uint8_t *marks) {
    const int *at = l->bins[facet];
    int found = 0;
    for (int j = at[2]; j <= at[3]; j++) {
        for (int i = at[0]; i <= at[1]; i++) {
            found |= marks[j * l->bins_x + i];
        }
    }
    return found != 0;
}

/* Orders the facets of the bins that are needed by their nearest level. */
static void order_facets(bst_facet_layers *l) {
    int first[LEVELS + 1] = {0}, count = 0, facets = l->net->satellite->facet_count;
    double most_m = small_m(l);
    look_about(l, l->needed);
    for (int f = 0; f < facets; f++) {
        bool off;
        if (!l->facing[f] || !may_reach(l, f, most_m, &off)) {
            continue;
        }
        if (!l->doubtful[f]) {
            find_bins(l, f);
            if (!any_bin(l, f, l->needed)) {
                continue;
            }
            make_box(l, f);
        }
        l->chosen[count++] = f;
        first[l->boxes[f].nearest + 1]++;
    }
    for (int i = 0; i < LEVELS; i++) {
        first[i + 1] += first[i];
    }
    l->order_count = count;
    for (int n = 0; n < count; n++) {
        l->order[first[l->boxes[l->chosen[n]].nearest]++] = l->chosen[n];
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

/* Marks the bins of a facet: few, for which calls of memset would take longer. */
static void need_bins(bst_facet_layers *l, int facet) {
    const int *at = l->bins[facet];
    for (int j = at[2]; j <= at[3]; j++) {
        for (int i = at[0]; i <= at[1]; i++) {
            l->needed[j * l->bins_x + i] = 1;
        }
    }
}

/* Enters the facets in the bins that are needed: counts them, or with `fill` copies their boxes. */
static void enter(bst_facet_layers *l, bool fill) {
    for (int n = 0; n < l->order_count; n++) {
        const bst_layers_box *b = &l->boxes[l->order[n]];
        const int *at = l->bins[l->order[n]];
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
    bool any = false;
    int facets = l->net->satellite->facet_count;
    double most_m = small_m(l);
    BST_TRY(mark_cells(ctx, l));
    place_vertices(l);
    look_about(l, l->marked);
    memset(l->needed, 0, (size_t)l->bins_x * (size_t)l->bins_y);
    memset(l->doubtful, 0, (size_t)facets);
    memset(l->known, 0, (size_t)facets);
    for (int f = 0; f < facets; f++) {
        if (!wanted[f] || !l->facing[f]) {
            continue;
        }
        bool off;
        if (may_reach(l, f, most_m, &off)) {
            find_bins(l, f);
            if (any_bin(l, f, l->marked)) {
                make_box(l, f);
                l->doubtful[f] = (uint8_t)marks_of(l, &l->boxes[f]);
            }
        }
        if (l->doubtful[f]) {
            need_bins(l, f);
            any = true;
        } else if (!off && l->net->apart[f] == BST_NET_FREE) {
            l->known[f] = BST_LAYERS_KNOWN_ALL;
        }
    }
    if (any) {
        BST_TRY(fill_bins(ctx, l));
    }
    return BST_OK;
}

bool bst_facet_layers_plane(const bst_facet_layers *l, int facet, double out[3]) {
    const int *corner = l->net->corner + l->net->first[facet];
    int count = l->net->first[facet + 1] - l->net->first[facet];
    bst_point2 o = l->at[corner[0]];
    double most = 0.0, z0 = l->near[corner[0]];
    for (int i = 2; i < count; i++) {
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
