#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/stack/stack_internal.h"
#include "sim/core/heapsort.h"

enum { GROUP = 4, MAX_GROUPS = BST_STACK_MAX_FRAMES / GROUP, HITS = 16384, MAX_RATES = 1024 };

/* Grid steps in units of the noise field's length 1 / sqrt(roughness) at the paths' ends: of groups
 * and of the whole stack. A rate is up to half a step off on each axis, so that the ends are off by
 * a quarter of a step, uniformly. At a distance of d lengths the signal loses d^2 / 2: averaged
 * over rates, both axes and the frames (STEP / 4)^2 / 9 = 2 % and 1.2 % of the sum, at most three
 * times that. Pixels, to whose centres all positions are rounded, lose several times as much. */
static const double GROUP_STEP = 1.3, STEP = 1.7;
/* Grid sums down to this margin below the threshold are refined: the loss of the grid's steps and
 * pixels. Measured by tests/imgproc/calibrate_stack_search.c: 0.5 to 1.0 on average by the width of
 * the PSF, and more than this for 1 of 120 paths at the threshold. */
static const double MARGIN_SNR = 1.7;
/* Limit of a single frame's value, quanta: one cosmic ray must not make a path. 2.5 standard
 * deviations: a path at a threshold of 6.5 in 16 frames has 1.6 in each, and one ray adds no more
 * than 2.5 / sqrt(16) = 0.6 to its sum. */
static const int BRIGHT_COUNTS = 5 * STACK_QUANTA / 2;

typedef struct hit {
    int16_t x, y, value;
    float vx, vy;
} hit;

/* Work space for the search of one tile. */
typedef struct stack_tile {
    int16_t *frames; /* [count][side][side] */
    int16_t *groups; /* [count / 4][group_side][group_side] */
    int16_t row[STACK_TILE];
    hit *hits;
    int *order;
    int count, level;
} stack_tile;

/* Search grid of a stack, the same for all tiles. */
typedef struct grid {
    bst_stack *s;
    int groups, margin, group_margin, side, group_side;
    double group_tau[MAX_GROUPS];
    int group_rates, rates;
    double group_rate[MAX_RATES], rate[MAX_RATES];
    int group_of[MAX_RATES]; /* nearest group rate of a rate */
    int level;               /* sums above this, quanta, are refined */
    int workers;
} grid;

static int side_of(double rate, int frames) {
    return STACK_TILE + 2 * ((int)ceil(rate * 0.5 * frames) + 4);
}

bst_status stack_search_create(bst_ctx *ctx, bst_stack *s) {
    int frames = (int)s->config.frames, side = side_of(s->config.rate_px_per_frame, frames);
    size_t square = (size_t)side * (size_t)side;
    s->tiles_x = (s->max_width + STACK_TILE - 1) / STACK_TILE;
    s->tiles_y = (s->max_height + STACK_TILE - 1) / STACK_TILE;
    size_t tiles = (size_t)s->tiles_x * (size_t)s->tiles_y;
    s->worker_count = s->pool ? bst_parallel_threads(s->pool) : 1;
    s->workers = calloc((size_t)s->worker_count, sizeof *s->workers);
    s->tile_paths = calloc(tiles * STACK_TILE_FOUND, sizeof *s->tile_paths);
    s->tile_count = calloc(tiles, sizeof *s->tile_count);
    s->tile_followed = calloc(tiles, sizeof *s->tile_followed);
    bool made = s->workers && s->tile_paths && s->tile_count && s->tile_followed;
    for (int i = 0; i < s->worker_count && made; i++) {
        stack_tile *t = &s->workers[i];
        t->frames = calloc(square * (size_t)frames, sizeof *t->frames);
        t->groups = calloc(square * (size_t)(frames / GROUP), sizeof *t->groups);
        t->hits = calloc(HITS, sizeof *t->hits);
        t->order = calloc(HITS, sizeof *t->order);
        made = t->frames && t->groups && t->hits && t->order;
    }
    return made ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory to search stacks");
}

void stack_search_free(bst_stack *s) {
    for (int i = 0; i < s->worker_count && s->workers; i++) {
        free(s->workers[i].frames);
        free(s->workers[i].groups);
        free(s->workers[i].hits);
        free(s->workers[i].order);
    }
    free(s->workers);
    free(s->tile_paths);
    free(s->tile_count);
    free(s->tile_followed);
}

/* Evenly spaced rates from -most to most, at most `step` apart; returns their number. */
static int spread_rates(double most, double step, double *out) {
    int n = 2 * (int)fmin(ceil(most / step), (MAX_RATES - 1) / 2) + 1;
    for (int i = 0; i < n; i++) {
        out[i] = most * (2.0 * i / (n - 1) - 1.0);
    }
    return n;
}

/* Sets up the grid of positions and rates for the stack. */
static void make_grid(bst_stack *s, grid *g) {
    double most = s->config.rate_px_per_frame, length = 1.0 / sqrt(s->roughness);
    double whole = s->tau[s->count - 1] - s->tau[0], longest = 0.0, group_reach = 0.0;
    *g = (grid){.s = s, .groups = s->count / GROUP, .workers = s->worker_count};
    for (int i = 0; i < g->groups; i++) {
        const double *t = s->tau + GROUP * i;
        g->group_tau[i] = 0.25 * (t[0] + t[1] + t[2] + t[3]);
        longest = fmax(longest, t[GROUP - 1] - t[0]);
        group_reach = fmax(group_reach, fabs(g->group_tau[i]));
    }
    g->group_rates = spread_rates(most, GROUP_STEP * length / longest, g->group_rate);
    g->rates = spread_rates(most, STEP * length / whole, g->rate);
    for (int i = 0; i < g->rates; i++) {
        g->group_of[i] =
            (int)floor((g->rate[i] + most) / (2.0 * most) * (g->group_rates - 1) + 0.5);
    }
    double reach = fmax(-s->tau[0], s->tau[s->count - 1]);
    g->margin = (int)ceil(most * reach) + 2;
    g->group_margin = (int)ceil(most * group_reach) + 1;
    g->side = STACK_TILE + 2 * g->margin;
    g->group_side = STACK_TILE + 2 * g->group_margin;
    g->level = (int)((s->threshold - MARGIN_SNR) * STACK_QUANTA * sqrt((double)s->count));
}

static int nearest(double v) {
    return (int)floor(v + 0.5);
}

/* Copies a tile of the aligned frames; pixels without a measurement become 0. */
static void read_tile(const grid *g, stack_tile *t, int x0, int y0) {
    const bst_stack *s = g->s;
    int side = g->side;
    for (int i = 0; i < s->count; i++) {
        const int8_t *map = stack_map(s, i);
        int16_t *out = t->frames + (size_t)i * (size_t)side * (size_t)side;
        for (int y = 0; y < side; y++, out += side) {
            int from_y = y0 - g->margin + y, first = x0 - g->margin;
            memset(out, 0, (size_t)side * sizeof *out);
            if (from_y < 0 || from_y >= s->height) {
                continue;
            }
            const int8_t *in = map + (size_t)from_y * (size_t)s->width;
            int left = first < 0 ? -first : 0;
            int right = first + side > s->width ? s->width - first : side;
            for (int x = left; x < right; x++) {
                int v = in[first + x];
                v = v == STACK_NONE ? 0 : v;
                out[x] = (int16_t)(v > STACK_VISIBLE ? BRIGHT_COUNTS : v);
            }
        }
    }
}

/* Sums groups of four frames along a group rate. */
static void add_groups(const grid *g, stack_tile *t, double vx, double vy) {
    const bst_stack *s = g->s;
    size_t square = (size_t)g->side * (size_t)g->side;
    size_t group_square = (size_t)g->group_side * (size_t)g->group_side;
    int base = g->margin - g->group_margin;
    for (int i = 0; i < g->groups; i++) {
        const int16_t *in[GROUP];
        for (int k = 0; k < GROUP; k++) {
            double dt = s->tau[GROUP * i + k] - g->group_tau[i];
            int ox = base + nearest(vx * dt), oy = base + nearest(vy * dt);
            in[k] = t->frames + (size_t)(GROUP * i + k) * square + (long)oy * g->side + ox;
        }
        stack_rows_add4(in, g->side, t->groups + (size_t)i * group_square, g->group_side,
                        g->group_side, g->group_side);
    }
}

static bool greater_hit(const void *context, int a, int b) {
    const hit *p = (const hit *)context + a, *q = (const hit *)context + b;
    return p->value != q->value ? p->value > q->value : a < b;
}

/* Keeps only the strongest of hits that one maximum may have caused. */
static void suppress_neighbours(const bst_stack *s, stack_tile *t) {
    double near = 1.5 / sqrt(s->roughness), near_rate = near / sqrt(s->time_variance);
    for (int i = 0; i < t->count; i++) {
        t->order[i] = i;
    }
    bst_heapsort_indices(t->order, t->count, greater_hit, t->hits);
    int kept = 0;
    for (int i = 0; i < t->count; i++) {
        const hit *h = &t->hits[t->order[i]];
        bool apart = true;
        for (int k = 0; k < kept && apart; k++) {
            const hit *o = &t->hits[t->order[k]];
            apart = fabs((double)h->x - o->x) > near || fabs((double)h->y - o->y) > near ||
                    fabs((double)h->vx - (double)o->vx) > near_rate ||
                    fabs((double)h->vy - (double)o->vy) > near_rate;
        }
        if (apart) {
            t->order[kept++] = t->order[i];
        }
    }
    t->count = kept;
}

/* Moves the hits kept by suppress_neighbours to the front. */
static void compact_hits(stack_tile *t) {
    for (int i = 1; i < t->count; i++) { /* ascending, so that no unread hit is overwritten */
        int k = i, moved = t->order[i];
        for (; k > 0 && t->order[k - 1] > moved; k--) {
            t->order[k] = t->order[k - 1];
        }
        t->order[k] = moved;
    }
    for (int i = 0; i < t->count; i++) {
        t->hits[i] = t->hits[t->order[i]];
    }
}

/* Stores a hit; a full list is thinned and, if crowded, its level is raised. */
static void add_hit(const bst_stack *s, stack_tile *t, hit h) {
    if (t->count == HITS) {
        suppress_neighbours(s, t);
        compact_hits(t);
        if (t->count > HITS / 2) { /* crowded: the faintest are dropped */
            t->level += t->level / 16;
            int kept = 0;
            for (int i = 0; i < t->count; i++) {
                if (t->hits[i].value > t->level) {
                    t->hits[kept++] = t->hits[i];
                }
            }
            t->count = kept;
        }
    }
    if (t->count < HITS && h.value > t->level) {
        t->hits[t->count++] = h;
    }
}

/* Searches a tile at one rate for grid sums above the level. */
static void search_rate(const grid *g, stack_tile *t, int width, int height, double vx, double vy) {
    const int16_t *in[MAX_GROUPS];
    size_t group_square = (size_t)g->group_side * (size_t)g->group_side;
    for (int i = 0; i < g->groups; i++) {
        int ox = g->group_margin + nearest(vx * g->group_tau[i]);
        int oy = g->group_margin + nearest(vy * g->group_tau[i]);
        in[i] = t->groups + (size_t)i * group_square + (long)oy * g->group_side + ox;
    }
    if (stack_rows_greatest(in, g->groups, g->group_side, t->row, width, height) <= t->level) {
        return;
    }
    for (int y = 0; y < height; y++) {
        if (stack_rows_greatest(in, g->groups, g->group_side, t->row, width, 1) > t->level) {
            for (int x = 0; x < width; x++) {
                int sum = 0;
                for (int i = 0; i < g->groups; i++) {
                    sum += in[i][x];
                }
                if (sum > t->level) {
                    add_hit(g->s, t,
                            (hit){(int16_t)x, (int16_t)y, (int16_t)sum, (float)vx, (float)vy});
                }
            }
        }
        for (int i = 0; i < g->groups; i++) {
            in[i] += g->group_side;
        }
    }
}

/* Refines a tile's hits to maxima between grid points and keeps those above the threshold. */
static void refine_hits(const grid *g, stack_tile *t, int tile, int x0, int y0) {
    bst_stack *s = g->s;
    suppress_neighbours(s, t);
    stack_path *out = s->tile_paths + (size_t)tile * STACK_TILE_FOUND;
    int kept = 0;
    for (int i = 0; i < t->count && kept < STACK_TILE_FOUND; i++) {
        const hit *h = &t->hits[t->order[i]];
        stack_path p = {.x = x0 + h->x, .y = y0 + h->y, .vx = (double)h->vx, .vy = (double)h->vy};
        stack_climb(s, &p);
        if (p.snr > s->threshold) {
            out[kept++] = p;
        }
    }
    s->tile_count[tile] = kept;
    s->tile_followed[tile] = t->count;
}

/* Searches one tile over all rates. */
static void search_tile(const grid *g, stack_tile *t, int tile) {
    int columns = (g->s->width + STACK_TILE - 1) / STACK_TILE;
    int x0 = tile % columns * STACK_TILE, y0 = tile / columns * STACK_TILE;
    int width = g->s->width - x0 < STACK_TILE ? g->s->width - x0 : STACK_TILE;
    int height = g->s->height - y0 < STACK_TILE ? g->s->height - y0 : STACK_TILE;
    read_tile(g, t, x0, y0);
    t->count = 0;
    t->level = g->level;
    int last_x = g->rates, last_y = g->rates;
    for (int ky = 0; ky < last_y;) {
        int group_y = g->group_of[ky], next_y = ky;
        while (next_y < g->rates && g->group_of[next_y] == group_y) {
            next_y++;
        }
        for (int kx = 0; kx < last_x;) {
            int group_x = g->group_of[kx], next_x = kx;
            while (next_x < g->rates && g->group_of[next_x] == group_x) {
                next_x++;
            }
            add_groups(g, t, g->group_rate[group_x], g->group_rate[group_y]);
            for (int y = ky; y < next_y; y++) {
                for (int x = kx; x < next_x; x++) {
                    search_rate(g, t, width, height, g->rate[x], g->rate[y]);
                }
            }
            kx = next_x;
        }
        ky = next_y;
    }
    refine_hits(g, t, tile, x0, y0);
}

static void search_tiles(void *user, int begin, int end) {
    const grid *g = user;
    int columns = (g->s->width + STACK_TILE - 1) / STACK_TILE;
    int rows = (g->s->height + STACK_TILE - 1) / STACK_TILE;
    for (int worker = begin; worker < end; worker++) {
        for (int tile = worker; tile < columns * rows; tile += g->workers) {
            search_tile(g, &g->s->workers[worker], tile);
        }
    }
}

void stack_search_tiles(bst_stack *s) {
    grid g;
    make_grid(s, &g);
    bst_parallel_for(s->pool, g.workers, 1, search_tiles, &g);
}
