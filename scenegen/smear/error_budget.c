#include "scenegen/smear/error_budget.h"

#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* BORDERS: share of a stamp border's length that passes within its own thickness of a point. */
#define REST ((float)BST_ERROR_REST)
#define BORDERS 0.1f

/* REACH: cells within two stamp radii of four PSF sigmas each. MOST_CROSSINGS: most cells searched
 * for crossing borders. */
enum { REACH = 5, MOST_CROSSINGS = 1000 };

/* A dense cell array pays for at least MANY spots if one cell in SPARSE is occupied. */
enum { MANY = 256, SPARSE = 32 };

/* Errors of nodes are summed twice: their bounds, and what is predicted. */
enum { BOUND, PREDICTED, ERRORS };

/* Sources at one position. */
typedef struct spot {
    int64_t key;
    unsigned frame; /* frame in which it was filled; older ones are empty */
    float x, y, peak, nodes[ERRORS], shared, excess, border;
} spot;

/* Error sums of sources in a cell (half a box), in sigma. */
typedef struct cell {
    int64_t key;
    unsigned frame;
    int u, v;
    float squares[ERRORS], worst[ERRORS], second[ERRORS];
    float shared, excess, worst_excess, border, worst_border;
} cell;

struct bst_error_budget {
    bst_error_budget_motion motion;
    bst_error_budget_source *sources;
    int count, capacity;
    spot *spots;
    cell *cells;
    int *used; /* the frame's spots, then its cells */
    unsigned frame, mask;
    /* Dense cell array for close cells: index + 1 of each cell, 0: none, in the order of `used`.
     * columns 0: cells are found by hashing. */
    int *field, field_capacity;
    int first_u, first_v, rows, columns;
    double missing_e;     /* light missing everywhere */
    bool above;           /* a predicted error exceeds its bound */
    double error[ERRORS]; /* negative: not computed yet */
    /* largest errors of a box besides those of nodes, at its sources and next to a stamp; number of
     * cells */
    float rest, beside;
    int boxes;
};

bst_status bst_error_budget_create(bst_ctx *ctx, bst_error_budget **out) {
    *out = calloc(1, sizeof **out);
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the predicted error of a frame");
}

void bst_error_budget_free(bst_error_budget *c) {
    if (c) {
        free(c->sources);
        free(c->spots);
        free(c->cells);
        free(c->used);
        free(c->field);
        free(c);
    }
}

bst_error_budget_motion bst_error_budget_motion_of(const bst_smear_path_point *path, int count,
                                                   bool shift) {
    const double *from = path[0].p, *to = path[count - 1].p;
    double chord[2] = {to[0] - from[0], to[1] - from[1]}, low[3] = {0}, high[3] = {0};
    double length = hypot(chord[0], chord[1]);
    double along[2] = {length > 0.0 ? chord[0] / length : 1.0,
                       length > 0.0 ? chord[1] / length : 0.0};
    for (int k = 0; k < count; k++) {
        const double *p = path[k].p;
        double at[3] = {p[0] * along[0] + p[1] * along[1], p[1] * along[0] - p[0] * along[1], p[2]};
        for (int i = 0; i < 3; i++) {
            low[i] = k == 0 ? at[i] : fmin(low[i], at[i]);
            high[i] = k == 0 ? at[i] : fmax(high[i], at[i]);
        }
    }
    /* a tilt about x moves the image along -y, one about y along x; roll moves corners in any
     * direction */
    double roll = high[2] - low[2], way = 0.0;
    for (int k = 0; k + 1 < count; k++) {
        const double *p = path[k].p, *q = path[k + 1].p;
        way += sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                    (p[2] - q[2]) * (p[2] - q[2]));
    }
    return (bst_error_budget_motion){
        .way_px = way,
        .direction = {shift ? along[0] : along[1], shift ? along[1] : -along[0]},
        .length_px = high[0] - low[0] + roll,
        .width_px = high[1] - low[1] + roll};
}

void bst_error_budget_begin(bst_error_budget *c, const bst_error_budget_motion *motion) {
    assert(c && motion && motion->sigma_px > 0.0);
    c->motion = *motion;
    double psf = 3.0 * motion->sigma_px + 1.0;
    c->motion.overlap = fmin(
        1.0, (motion->way_px + psf) * psf / ((motion->length_px + psf) * (motion->width_px + psf)));
    c->count = 0;
    c->above = false;
    c->missing_e = 0.0;
    c->error[BOUND] = -1.0;
}

void bst_error_budget_miss(bst_error_budget *c, double electrons) {
    assert(c && electrons >= 0.0);
    c->missing_e += electrons;
    c->error[BOUND] = -1.0;
}

bst_status bst_error_budget_add(bst_ctx *ctx, bst_error_budget *c,
                                const bst_error_budget_source *source) {
    if (c->count == c->capacity) {
        int capacity = c->capacity > 0 ? 2 * c->capacity : 1024;
        bst_error_budget_source *sources = realloc(c->sources, (size_t)capacity * sizeof *sources);
        c->sources = sources ? sources : c->sources;
        /* twice as many slots as entries, for short searches; the old content is not needed */
        free(c->spots);
        free(c->cells);
        free(c->used);
        c->spots = calloc((size_t)capacity, 2 * sizeof *c->spots);
        c->cells = calloc((size_t)capacity, 2 * sizeof *c->cells);
        c->used = malloc((size_t)capacity * sizeof *c->used);
        c->frame = 0;
        c->mask = 2 * (unsigned)capacity - 1;
        c->capacity = sources && c->spots && c->cells && c->used ? capacity : 0;
        if (c->capacity == 0) {
            c->count = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the errors of %d sources",
                            capacity);
        }
    }
    assert(c->count < c->capacity);
    c->sources[c->count++] = *source;
    c->above = c->above || source->predicted_e > source->nodes_e;
    return BST_OK;
}

/* fmaxf for finite `so_far`, in one instruction. */
static inline float greater(float so_far, float x) {
    return x > so_far ? x : so_far;
}

static int64_t key_of(int u, int v) {
    return (int64_t)((uint64_t)(uint32_t)u << 32 | (uint32_t)v);
}

static unsigned place_of(int64_t key) {
    return (unsigned)((uint64_t)key * 0x9E3779B97F4A7C15u >> 32);
}

/* Slot of the entry with this key, or the empty slot for it. */
static int find_spot(const bst_error_budget *c, int64_t key) {
    unsigned i = place_of(key) & c->mask;
    while (c->spots[i].frame == c->frame && c->spots[i].key != key) {
        i = (i + 1) & c->mask;
    }
    return (int)i;
}

/* Slot of cell (u, v), or an empty slot for it. */
static int find_cell(const bst_error_budget *c, int u, int v) {
    int64_t key = key_of(u, v);
    unsigned i = place_of(key) & c->mask;
    while (c->cells[i].frame == c->frame && c->cells[i].key != key) {
        i = (i + 1) & c->mask;
    }
    return (int)i;
}

static int *field_at(const bst_error_budget *c, int u, int v) {
    return &c->field[(v - c->first_v) * c->columns + u - c->first_u];
}

/* Cell (u, v), NULL if it has no light; must be within REACH of an occupied cell. */
static const cell *look_up(const bst_error_budget *c, int u, int v) {
    if (c->columns > 0) {
        int n = *field_at(c, u, v);
        return n > 0 ? &c->cells[n - 1] : NULL;
    }
    const cell *p = &c->cells[find_cell(c, u, v)];
    return p->frame == c->frame ? p : NULL;
}

/* Cell (u, v), created if there is none; *cells: number of cells. */
static cell *make_cell(bst_error_budget *c, int u, int v, int *cells) {
    int n = c->columns > 0 ? *field_at(c, u, v) - 1 : find_cell(c, u, v);
    if (n >= 0 && c->cells[n].frame == c->frame) {
        return &c->cells[n];
    }
    if (c->columns > 0) {
        n = *cells;
        *field_at(c, u, v) = n + 1;
    }
    c->cells[n] = (cell){.key = key_of(u, v), .frame = c->frame, .u = u, .v = v};
    c->used[(*cells)++] = n;
    return &c->cells[n];
}

/* Merges sources into spots; returns their number. *apart: largest error of sources in their own
 * motion. */
static int fill_spots(bst_error_budget *c, float apart[ERRORS]) {
    float per_px = 1.0f / fmaxf((float)c->motion.sigma_px, 1.0f);
    float dark = (float)c->motion.dark_variance_e2;
    int spots = 0;
    for (int i = 0; i < c->count; i++) {
        const bst_error_budget_source *s = &c->sources[i];
        if (s->apart) {
            float noise = sqrtf(s->peak_e + dark), border = s->border_e / sqrtf(dark);
            const float nodes[ERRORS] = {s->nodes_e, s->predicted_e};
            for (int k = 0; k < ERRORS; k++) {
                float e = (nodes[k] + s->excess_e + s->shared_e) / noise;
                apart[k] = fmaxf(apart[k], fmaxf(e, border));
            }
            continue;
        }
        int64_t key = key_of((int)floorf(s->x_px * per_px), (int)floorf(s->y_px * per_px));
        int n = find_spot(c, key);
        spot *p = &c->spots[n];
        if (p->frame != c->frame) {
            *p = (spot){.key = key, .frame = c->frame, .x = s->x_px, .y = s->y_px};
            assert(spots < c->capacity);
            c->used[spots++] = n;
        }
        p->peak += s->peak_e;
        p->nodes[BOUND] += s->nodes_e;
        p->nodes[PREDICTED] += s->predicted_e;
        p->shared += s->shared_e;
        p->excess += s->excess_e;
        p->border += s->border_e;
    }
    return spots;
}

/* Scale of half a box: cells per px along the motion and across it. */
typedef struct lattice {
    float dx, dy, per_u, per_v;
} lattice;

static lattice lattice_of(const bst_error_budget_motion *m) {
    float psf = 3.0f * (float)m->sigma_px + 1.0f;
    return (lattice){.dx = (float)m->direction[0],
                     .dy = (float)m->direction[1],
                     .per_u = 2.0f / ((float)m->length_px + psf),
                     .per_v = 2.0f / ((float)m->width_px + psf)};
}

/* Cell of a spot. */
static void cell_of(const lattice *l, const spot *s, int *u, int *v) {
    *u = (int)floorf((s->x * l->dx + s->y * l->dy) * l->per_u);
    *v = (int)floorf((s->y * l->dx - s->x * l->dy) * l->per_v);
}

/* Creates the dense cell array, with a margin of empty cells, if there are many spots on few cells:
 * neighbours are then adjacent in memory. */
static void make_field(bst_error_budget *c, const lattice *l, int spots) {
    int low[2] = {INT_MAX, INT_MAX}, high[2] = {INT_MIN, INT_MIN};
    c->columns = c->rows = 0;
    if (spots < MANY) {
        return;
    }
    for (int i = 0; i < spots; i++) {
        int at[2];
        cell_of(l, &c->spots[c->used[i]], &at[0], &at[1]);
        for (int a = 0; a < 2; a++) {
            low[a] = at[a] < low[a] ? at[a] : low[a];
            high[a] = at[a] > high[a] ? at[a] : high[a];
        }
    }
    int64_t most = (int64_t)SPARSE * spots, columns = (int64_t)high[0] - low[0] + 1 + 2 * REACH,
            rows = (int64_t)high[1] - low[1] + 1 + 2 * REACH;
    if (columns > most || rows > most || columns * rows > most || most > INT_MAX) {
        return;
    }
    int places = (int)(columns * rows);
    if (places > c->field_capacity) {
        free(c->field);
        c->field = malloc((size_t)places * sizeof *c->field);
        c->field_capacity = c->field ? places : 0;
        if (!c->field) { /* only an optimisation */
            return;
        }
    }
    memset(c->field, 0, (size_t)places * sizeof *c->field);
    c->first_u = low[0] - REACH;
    c->first_v = low[1] - REACH;
    c->columns = (int)columns;
    c->rows = (int)rows;
}

/* Merges spots into cells, whose indices replace the spots' in `used`; returns their number. */
static int fill_cells(bst_error_budget *c, int spots) {
    const lattice l = lattice_of(&c->motion);
    float dark = (float)c->motion.dark_variance_e2, quiet = 1.0f / sqrtf(dark);
    int cells = 0;
    make_field(c, &l, spots);
    for (int i = 0; i < spots; i++) {
        const spot *s = &c->spots[c->used[i]];
        int u, v;
        cell_of(&l, s, &u, &v);
        cell *p = make_cell(c, u, v, &cells);
        float lit = 1.0f / sqrtf(s->peak + dark);
        for (int k = 0; k < ERRORS; k++) {
            float nodes = s->nodes[k] * lit;
            p->squares[k] += nodes * nodes;
            p->second[k] = greater(p->second[k], nodes < p->worst[k] ? nodes : p->worst[k]);
            p->worst[k] = greater(p->worst[k], nodes);
        }
        p->shared += s->shared * lit;
        p->excess += s->excess * lit;
        p->worst_excess = greater(p->worst_excess, s->excess * lit);
        p->border += s->border * quiet;
        p->worst_border = greater(p->worst_border, s->border * quiet);
    }
    return cells;
}

/* Error of the box about a cell, of one kind. */
static float box_error(bst_error_budget *c, const cell *middle, int kind) {
    cell sum = {.key = 0};
    float squares = 0.0f, worst = 0.0f, second = 0.0f;
    for (int u = -1; u <= 1; u++) {
        for (int v = -1; v <= 1; v++) {
            const cell *p = u == 0 && v == 0 ? middle : look_up(c, middle->u + u, middle->v + v);
            if (p) {
                squares += p->squares[kind];
                float less = p->worst[kind] < worst ? p->worst[kind] : worst;
                second = greater(greater(second, p->second[kind]), less);
                worst = greater(worst, p->worst[kind]);
                sum.shared += p->shared;
                sum.excess += p->excess;
                sum.worst_excess = greater(sum.worst_excess, p->worst_excess);
                sum.border += p->border;
                sum.worst_border = greater(sum.worst_border, p->worst_border);
            }
        }
    }
    float part = (float)c->motion.overlap;
    float others = sqrtf(part * fmaxf(squares - worst * worst, 0.0f));
    float excess = sum.worst_excess + part * (sum.excess - sum.worst_excess);
    float all = sum.shared + BORDERS * (sum.border - sum.worst_border);
    c->rest = greater(c->rest, excess + all);
    c->beside = greater(c->beside, sum.worst_border + all);
    return fmaxf(worst + excess, sum.worst_border) + all + REST * fmaxf(others, second);
}

/* Cells by the square of SIDE cells that they lie in, as lists, to find those within REACH of a
 * cell without a search for each place. */
enum { SIDE_BITS = 3, SQUARE_BITS = 12 };
_Static_assert(REACH <= 1 << SIDE_BITS, "a cell's neighbours lie in its square or the next");

typedef struct squares {
    int first[1 << SQUARE_BITS]; /* place + 1 in `used` of a square's first cell, 0: none */
    int next[MOST_CROSSINGS];    /* the same for the next of each */
} squares;

/* First of the list that holds the cells of square (i, j), and perhaps others. */
static int *square_at(squares *all, int i, int j) {
    return &all->first[place_of(key_of(i, j)) & ((1U << SQUARE_BITS) - 1U)];
}

static void fill_squares(const bst_error_budget *c, int cells, squares *all) {
    memset(all->first, 0, sizeof all->first);
    for (int k = 0; k < cells; k++) {
        const cell *p = &c->cells[c->used[k]];
        int *first = square_at(all, p->u >> SIDE_BITS, p->v >> SIDE_BITS);
        all->next[k] = *first;
        *first = k + 1;
    }
}

/* Error where the border of the stamps in a cell crosses another: two circles cross if they are no
 * further apart than the sum of their radii. */
static float crossing_error(const bst_error_budget *c, squares *all, const cell *middle) {
    float other = fminf(middle->border - middle->worst_border, middle->worst_border);
    int i = middle->u >> SIDE_BITS, j = middle->v >> SIDE_BITS;
    for (int n = 0; n < 9; n++) {
        for (int k = *square_at(all, i + n % 3 - 1, j + n / 3 - 1); k > 0; k = all->next[k - 1]) {
            const cell *p = &c->cells[c->used[k - 1]];
            if (p != middle && abs(p->u - middle->u) <= REACH && abs(p->v - middle->v) <= REACH) {
                other = fmaxf(other, p->worst_border);
            }
        }
    }
    return middle->worst_border + other;
}

/* Largest error where borders cross, from `worst` on. Both cells of a pair find it; the one with
 * the larger border, at least half of the pair's error, suffices. */
static float worst_crossing(const bst_error_budget *c, int cells, float worst) {
    squares all;
    assert(cells <= MOST_CROSSINGS);
    fill_squares(c, cells, &all);
    for (int i = 0; i < cells; i++) {
        const cell *p = &c->cells[c->used[i]];
        worst = 2.0f * p->worst_border > worst ? fmaxf(worst, crossing_error(c, &all, p)) : worst;
    }
    return worst;
}

/* Computes the errors of the frame. */
static void sum_errors(bst_error_budget *c) {
    float worst[ERRORS] = {0.0f}, apart[ERRORS] = {0.0f}, border = 0.0f;
    c->frame++;
    int cells = fill_cells(c, fill_spots(c, apart));
    c->rest = c->beside = 0.0f;
    c->boxes = cells;
    /* in the order of the dense array, if there is one */
    int places = c->columns > 0 ? c->columns * c->rows : cells;
    for (int i = 0; i < places; i++) {
        int n = c->columns > 0 ? c->field[i] - 1 : c->used[i];
        if (n >= 0) {
            float bound = box_error(c, &c->cells[n], BOUND);
            worst[BOUND] = greater(worst[BOUND], bound);
            if (c->above || bound > worst[PREDICTED]) {
                worst[PREDICTED] = greater(worst[PREDICTED], box_error(c, &c->cells[n], PREDICTED));
            }
            border = greater(border, c->cells[n].worst_border);
        }
    }
    float crossing = fminf(worst[BOUND], worst[PREDICTED]);
    if (cells > MOST_CROSSINGS) { /* too many cells: assume that the worst ones cross */
        crossing = fmaxf(crossing, 2.0f * border);
    }
    if (2.0f * border > crossing) {
        crossing = worst_crossing(c, cells, crossing);
    }
    for (int k = 0; k < ERRORS; k++) {
        worst[k] = fmaxf(worst[k], crossing);
        c->error[k] = fmaxf(worst[k], apart[k]) + REST * fminf(worst[k], apart[k]) +
                      c->missing_e / sqrt(c->motion.dark_variance_e2);
    }
}

double bst_error_budget_bound_sigma(bst_error_budget *c) {
    if (c->error[BOUND] < 0.0) {
        sum_errors(c);
    }
    return c->error[BOUND];
}

double bst_error_budget_error_sigma(bst_error_budget *c) {
    (void)bst_error_budget_bound_sigma(c);
    return c->error[PREDICTED];
}

double bst_error_budget_limited_sigma(bst_error_budget *c, double nodes_sigma) {
    double all = bst_error_budget_error_sigma(c);
    if (!(nodes_sigma < all)) {
        return all;
    }
    double beside = (double)c->beside + BST_ERROR_REST * nodes_sigma;
    float limited = (float)fmax(nodes_sigma + (double)c->rest, beside);
    limited = c->boxes > MOST_CROSSINGS ? INFINITY : worst_crossing(c, c->boxes, limited);
    return fmin(all, (double)limited + c->missing_e / sqrt(c->motion.dark_variance_e2));
}

const bst_error_budget_source *bst_error_budget_sources(const bst_error_budget *c, int *count) {
    *count = c->count;
    return c->sources;
}

const bst_error_budget_motion *bst_error_budget_frame_motion(const bst_error_budget *c) {
    return &c->motion;
}
