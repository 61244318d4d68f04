#include "obsgen/fragments.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "obsgen/clutter.h"
#include "obsgen/streak_noise.h"
#include "sim/core/pages.h"
#include "sim/core/vec.h"

/* As image processing tells maxima apart. */
static const double SADDLE_SIGMA = 3.0, SADDLE_SHARE = 0.15;
/* What stays further below the threshold is seen here and there: the places are drawn. */
static const double FAINTEST_SIGMA = 3.0;
/* Light below this counts for no other streak, and below SEEN it adds no alarms. */
static const double LEAST_LIGHT = 0.4, LEAST_SEEN = 0.25;
/* Share of the light on a pixel from which on a source looks there itself. */
static const double OWN_SHARE = 0.3;
/* Draws of faint streaks; those of other clutter stay below. */
static const uint64_t FAINT_STREAK = (uint64_t)1 << 59;
/* A source whose path differs more from the stars' has a way of its own. */
static const double OWN_WAY_PX = 1.0;

/* LIGHT_ROWS: on either side of the way that its light reaches. */
enum {
    ROWS = BST_STREAK_ROWS,
    WIDE = BST_STREAK_WIDE,
    LIGHT_ROWS = 4,
    LIGHT_WIDE = 2 * LIGHT_ROWS + 1,
    /* of the tables below: outputs in steps of 1/8 from 1, lights in steps of 1/8 */
    OUTPUTS = 64,
    LIGHTS = 48,
    SPARSE = 4 /* of so many nodes of faint light one is looked at */,
};

typedef bst_streak_section section;

typedef struct maximum {
    int x, y, item, order; /* order: in which it was found */
    bool by_row;
    float value;
} maximum;

/* The filter's output on a pixel that streaks reach. */
typedef struct pixel {
    float light;  /* of all streaks */
    float output; /* with noise; 0: not made */
} pixel;

typedef struct touched {
    int at, middle;
    bool by_row;
} touched;

struct generator_streaks {
    section sections[BST_ROUTE_NODES];
    float light[BST_ROUTE_NODES * LIGHT_WIDE]; /* of the sections' rows */
    bst_streak_noise noise;
    double shot; /* variance that an output of one adds, by the photons' own noise */
    double log_maxima[OUTPUTS], maxima_sigma; /* logarithm of maxima per pixel above an output */
    double alarms[LIGHTS]; /* more of them than noise alone makes, per pixel of the way */
    pixel *map;            /* the frame; about the touched sections it is not zero */
    touched *touched;
    maximum *maxima;
    int map_room, touched_count, touched_room, maxima_count, maxima_room;
};

static float output_at(const section *s, int count, int k, int across) {
    int r = k >= 0 && k < count ? across - s[k].middle + ROWS : -1;
    return r >= 0 && r <= 2 * ROWS ? s[k].output[r] : -INFINITY;
}

static bst_status grow(bst_ctx *ctx, void **items, int count, int *room, size_t bytes) {
    if (count < *room) {
        return BST_OK;
    }
    int more = 2 * *room + 1024;
    void *moved = realloc(*items, (size_t)more * bytes);
    if (!moved) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d pixels of streaks", more);
    }
    *items = moved;
    *room = more;
    return BST_OK;
}

/* A section whose pixels are not all zero any more. */
static bst_status touch(bst_ctx *ctx, struct generator_streaks *w, const section *s, bool by_row) {
    BST_TRY(
        grow(ctx, (void **)&w->touched, w->touched_count, &w->touched_room, sizeof *w->touched));
    w->touched[w->touched_count++] = (touched){s->at, s->middle, by_row};
    return BST_OK;
}

static bst_status find_maxima(bst_ctx *ctx, bst_generator *g, const section *s, int count,
                              bool by_row, int item) {
    struct generator_streaks *w = g->streaks;
    int wide = by_row ? g->height : g->width, high = by_row ? g->width : g->height;
    for (int k = 0; k < count; k++) {
        for (int r = -ROWS + 1; r < ROWS && s[k].at >= 0 && s[k].at < wide; r++) {
            int across = s[k].middle + r;
            float value = s[k].output[r + ROWS];
            bool top = value > (float)g->threshold && across >= 0 && across < high;
            for (int i = -1; i <= 1 && top; i++) {
                for (int j = -1; j <= 1 && top; j++) {
                    top = (i == 0 && j == 0) || value > output_at(s, count, k + i, across + j);
                }
            }
            if (top) {
                BST_TRY(grow(ctx, (void **)&w->maxima, w->maxima_count, &w->maxima_room,
                             sizeof *w->maxima));
                w->maxima[w->maxima_count] = (maximum){.x = by_row ? across : s[k].at,
                                                       .y = by_row ? s[k].at : across,
                                                       .item = item,
                                                       .order = w->maxima_count,
                                                       .by_row = by_row,
                                                       .value = value};
                w->maxima_count++;
            }
        }
    }
    return BST_OK;
}

/* Whether the output stays above `least` on the pixels between two maxima. */
static bool is_ridge(const bst_generator *g, const maximum *a, const maximum *b, float least) {
    int dx = b->x - a->x, dy = b->y - a->y;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    for (int i = 1; i < steps; i++) {
        float t = (float)i / (float)steps;
        int x = a->x + (int)lroundf(t * (float)dx), y = a->y + (int)lroundf(t * (float)dy);
        if (!(g->streaks->map[y * g->width + x].output > least)) {
            return false;
        }
    }
    return true;
}

/* By place; of one that several streaks show, the brightest's first. */
static int by_place(const void *a, const void *b) {
    const maximum *p = a, *q = b;
    if (p->y != q->y) {
        return p->y < q->y ? -1 : 1;
    }
    if (p->x != q->x) {
        return p->x < q->x ? -1 : 1;
    }
    return p->order < q->order ? -1 : 1;
}

/* Reports what no higher maximum in a box about it shares a ridge with. */
static void report(bst_generator *g) {
    struct generator_streaks *w = g->streaks;
    int reach = (int)ceil(6.0 * g->sigma) + 2;
    if (w->maxima_count > 0) {
        qsort(w->maxima, (size_t)w->maxima_count, sizeof *w->maxima, by_place);
    }
    for (int i = 0; i < w->maxima_count; i++) {
        const maximum *m = &w->maxima[i];
        bool kept = i == 0 || m->x != m[-1].x || m->y != m[-1].y;
        double saddle = m->value - fmax(SADDLE_SIGMA, SADDLE_SHARE * m->value);
        float least = (float)fmax(saddle, g->threshold);
        for (int way = -1; way <= 1 && kept; way += 2) {
            for (int k = i + way; k >= 0 && k < w->maxima_count && kept; k += way) {
                const maximum *o = &w->maxima[k];
                if (abs(o->y - m->y) > reach) {
                    break;
                }
                /* where a way turns, light of both of its parts is one ridge */
                kept = !(o->value > m->value) || abs(o->x - m->x) > reach ||
                       (o->by_row == m->by_row && !is_ridge(g, m, o, least));
            }
        }
        if (kept) {
            bst_generator_keep_rough(g, m->x, m->y, (double)m->value, m->item);
        }
    }
}

/* Sections of a part of the way that runs more along one axis, one way; their number. */
static int make_sections(bst_generator *g, const generator_source *source,
                         const bst_route_node *nodes, int count, bool by_row) {
    struct generator_streaks *w = g->streaks;
    double fall = 0.25 / (g->total_sigma * g->total_sigma);
    int made = 0, outside = w->noise.reach + 1, wide = by_row ? g->height : g->width;
    double from = by_row ? nodes[0].y : nodes[0].x;
    double to = by_row ? nodes[count - 1].y : nodes[count - 1].x, way = to > from ? 1.0 : -1.0;
    double at = way > 0.0 ? ceil(from) : floor(from);
    for (int k = 0; k + 1 < count; k++) {
        const bst_route_node *n = &nodes[k], *m = &nodes[k + 1];
        double a = by_row ? n->y : n->x, run = (by_row ? m->y : m->x) - a;
        double rise = by_row ? m->x - n->x : m->y - n->y;
        /* distances across the way, not across the axis */
        double slant = run * run / (run * run + rise * rise);
        for (; way * (a + run - at) > 0.0 && made < BST_ROUTE_NODES; at += way) {
            double part = fmax((at - a) / run, 0.0);
            double across = (by_row ? n->x : n->y) + part * rise;
            if (at < -outside || at > wide + outside) {
                continue;
            }
            section *now = &w->sections[made++];
            now->at = (int)at;
            now->middle = (int)lround(across);
            now->height = (float)(source->amplitude * (n->light + part * (m->light - n->light)));
            now->off = (float)(across - now->middle);
            now->fall = (float)(fall * slant);
        }
    }
    return made;
}

/* Light of the sections on the rows about them, into w->light. */
static void light_rows(struct generator_streaks *w, int count, int rows) {
    int wide = 2 * rows + 1;
    for (int k = 0; k < count; k++) {
        const section *s = &w->sections[k];
        for (int r = 0; r < wide; r++) {
            float d = (float)(r - rows) - s->off;
            w->light[k * wide + r] = -s->fall * d * d;
        }
    }
    bst_streak_exponentials(w->light, count * wide);
    for (int k = 0; k < count; k++) {
        for (int r = 0; r < wide; r++) {
            w->light[k * wide + r] *= w->sections[k].height;
        }
    }
}

/* Pixel of the frame of a section's row, -1: outside. */
static int pixel_of(const bst_generator *g, bool by_row, int at, int across) {
    int x = by_row ? across : at, y = by_row ? at : across;
    return x >= 0 && y >= 0 && x < g->width && y < g->height ? y * g->width + x : -1;
}

/* Adds the light of a part of the way to the map. */
static bst_status lay_part(bst_ctx *ctx, bst_generator *g, const generator_source *source,
                           const bst_route_node *nodes, int count, bool by_row) {
    struct generator_streaks *w = g->streaks;
    int made = make_sections(g, source, nodes, count, by_row);
    light_rows(w, made, LIGHT_ROWS);
    for (int k = 0; k < made; k++) {
        const section *s = &w->sections[k];
        BST_TRY(touch(ctx, w, s, by_row));
        for (int r = 0; r < LIGHT_WIDE; r++) {
            int at = pixel_of(g, by_row, s->at, s->middle + r - LIGHT_ROWS);
            if (at >= 0) {
                w->map[at].light += w->light[k * LIGHT_WIDE + r];
            }
        }
    }
    return BST_OK;
}

/* The background that was found is too much by this, in the filter's output. */
static double taken_of(const bst_generator *g) {
    return g->background_bias_e / (bst_bound_norm(&g->bound, 0.0) * g->noise_e);
}

/* Maxima along a part of the way. */
static bst_status search_part(bst_ctx *ctx, bst_generator *g, const generator_source *source,
                              const bst_route_node *nodes, int count, bool by_row) {
    struct generator_streaks *w = g->streaks;
    section *s = w->sections;
    int made = make_sections(g, source, nodes, count, by_row);
    if (made < 2) {
        return BST_OK;
    }
    double taken = taken_of(g);
    light_rows(w, made, ROWS);
    for (int k = 0; k < made; k++) {
        for (int r = 0; r < WIDE; r++) {
            int at = pixel_of(g, by_row, s[k].at, s[k].middle + r - ROWS);
            float light = at >= 0 ? w->map[at].light : w->light[k * WIDE + r];
            s[k].output[r] = light - (float)taken;
        }
    }
    bst_streak_noise_add(&w->noise, g->key, g->exposure_id, by_row, w->shot, s, made);
    for (int k = 0; k < made; k++) {
        BST_TRY(touch(ctx, w, &s[k], by_row));
        for (int r = 0; r < WIDE; r++) {
            int at = pixel_of(g, by_row, s[k].at, s[k].middle + r - ROWS);
            if (at >= 0) {
                w->map[at].output = s[k].output[r];
            }
        }
    }
    return find_maxima(ctx, g, s, made, by_row, source->item);
}

static double log_maxima_above(const struct generator_streaks *w, double output) {
    double at = fmin(fmax(8.0 * (output - 1.0), 0.0), OUTPUTS - 1.001);
    int i = (int)at;
    return w->log_maxima[i] + (at - i) * (w->log_maxima[i + 1] - w->log_maxima[i]);
}

/* How often light of a way that is below the threshold makes maxima above it. */
static void set_alarms(bst_generator *g) {
    struct generator_streaks *w = g->streaks;
    /* the squares of the filter average a line's electrons over 1 / (sqrt(3 pi) S) px of it; they
     * are the output times the noise of a pixel */
    w->shot = 1.0 / (sqrt(3.0 * BST_PI) * g->total_sigma * g->noise_e);
    if (w->maxima_sigma != g->total_sigma) {
        for (int i = 0; i < OUTPUTS; i++) {
            w->log_maxima[i] = log(bst_matched_pixel_maxima(g->total_sigma, 1.0 + i / 8.0));
        }
        w->maxima_sigma = g->total_sigma;
    }
    double threshold = g->threshold + taken_of(g), fall = 0.25 / (g->total_sigma * g->total_sigma);
    double alone = exp(log_maxima_above(w, threshold));
    for (int i = 0; i < LIGHTS; i++) {
        w->alarms[i] = 0.0;
        for (int k = -8; k <= 8; k++) {
            double d = 0.5 * k, light = i / 8.0 * exp(-fall * d * d);
            double output = (threshold - light) / sqrt(1.0 + w->shot * light);
            w->alarms[i] += 0.5 * (exp(log_maxima_above(w, output)) - alone);
        }
    }
}

/* Arrivals along the way of one source. */
typedef struct arrivals {
    double next;
    uint64_t draw;
} arrivals;

static double draw_exponential(const bst_generator *g, arrivals *a) {
    return -log(bst_rng_uniform(g->key, (uint64_t)g->exposure_id, a->draw++));
}

/* Light of all streaks at a node; of the source alone where that is too faint to count for others.
 */
static double light_at(const bst_generator *g, const bst_route_node *node, double own) {
    double x = node->x + 0.5, y = node->y + 0.5;
    if (!(x >= 0.0 && y >= 0.0 && x < g->width && y < g->height)) {
        return own;
    }
    double all = (double)g->streaks->map[(int)y * g->width + (int)x].light;
    return all > own ? all : own;
}

/* Alarms that light too faint to be looked at pixel by pixel makes at a node. share: pixels of the
 * way that it stands for, times this source's part of the light. */
static void draw_faint(bst_generator *g, const generator_source *source, const bst_route_node *n,
                       double share, double light, arrivals *a) {
    const struct generator_streaks *w = g->streaks;
    double at = 8.0 * light;
    at = at < LIGHTS - 1.001 ? at : LIGHTS - 1.001;
    int i = (int)at;
    a->next -= share * (w->alarms[i] + (at - i) * (w->alarms[i + 1] - w->alarms[i]));
    while (a->next < 0.0) {
        a->next += draw_exponential(g, a);
        double noise = sqrt(1.0 + w->shot * light);
        double least = (g->threshold + taken_of(g) - light) / noise;
        double value = sqrt(least * least + 2.0 * draw_exponential(g, a));
        double off[2];
        bst_rng_normal2(g->key, (uint64_t)g->exposure_id, a->draw++, off);
        /* alarms are the likelier, the nearer to the way */
        double spread = g->total_sigma * sqrt(2.0 / (g->threshold * light + 1.0));
        int x = (int)lround(n->x + spread * off[0]), y = (int)lround(n->y + spread * off[1]);
        if (pixel_of(g, false, x, y) >= 0) {
            bst_generator_keep_rough(g, x, y, g->threshold + noise * (value - least), source->item);
        }
    }
}

/* Lays the light of a part of the way, where it counts. */
static bst_status lay_bright(bst_ctx *ctx, bst_generator *g, const generator_source *source,
                             const bst_route_node *nodes, int count, bool by_row) {
    double least = LEAST_LIGHT / source->amplitude;
    for (int first = 0, end; first < count; first = end) {
        bool counts = nodes[first].light >= least;
        for (end = first + 1; end < count && (nodes[end].light >= least) == counts; end++) {
        }
        if (counts) {
            int from = first > 0 ? first - 1 : 0, to = end < count ? end : count - 1;
            BST_TRY(lay_part(ctx, g, source, nodes + from, to - from + 1, by_row));
        }
    }
    return BST_OK;
}

/* Looks for maxima in a part of the way: pixel by pixel where light is bright enough, and as far
 * about that as noise is filtered. */
static bst_status search_bright(bst_ctx *ctx, bst_generator *g, const generator_source *source,
                                const bst_route_node *nodes, int count, bool by_row, arrivals *a) {
    double least = g->threshold - FAINTEST_SIGMA;
    int margin = 2 * g->streaks->noise.reach + 4, from = -1, last = -1;
    for (int k = 0; k < count; k++) {
        double own = source->amplitude * nodes[k].light;
        if (own >= OWN_SHARE * least || (own > LEAST_SEEN && k % SPARSE == 0)) {
            double light = light_at(g, &nodes[k], own);
            if (light >= least && own >= OWN_SHARE * light) {
                from = from < 0 ? k : from;
                last = k;
            } else if (light < least) {
                double pixels = own >= OWN_SHARE * least ? 1.0 : SPARSE;
                draw_faint(g, source, &nodes[k], pixels * own / light, light, a);
            }
        }
        if (from >= 0 && (k > last + 2 * margin || k == count - 1)) {
            int start = from > margin ? from - margin : 0;
            int end = last + margin < count ? last + margin : count - 1;
            BST_TRY(search_part(ctx, g, source, nodes + start, end - start + 1, by_row));
            from = -1;
        }
    }
    return BST_OK;
}

/* Where the way goes from a node on; it trembles from one to the next. */
static void course(const bst_route_node *way, int count, int at, double *dx, double *dy) {
    enum { AHEAD = 12 };
    int end = at + AHEAD < count ? at + AHEAD : count - 1;
    int start = end - AHEAD > 0 ? end - AHEAD : 0;
    *dx = way[end].x - way[start].x;
    *dy = way[end].y - way[start].y;
}

/* Whether a source's way comes near the frame at all. */
static bool comes_in(const bst_generator *g, const generator_source *s) {
    double margin_x = ROWS + 1.0 + 0.5 * fabs(s->path.dx - g->whole_path.dx);
    double margin_y = ROWS + 1.0 + 0.5 * fabs(s->path.dy - g->whole_path.dy);
    return s->x + g->route_box[1] > -margin_x && s->x + g->route_box[0] < g->width + margin_x &&
           s->y + g->route_box[3] > -margin_y && s->y + g->route_box[2] < g->height + margin_y;
}

/* The stars' way in the middle of the frame, turned into this source's by what its own ends differ;
 * or its own, where it moves otherwise. Its nodes are g->way; their number. */
static int way_of(bst_generator *g, const generator_source *source) {
    double dx = source->path.dx - g->whole_path.dx, dy = source->path.dy - g->whole_path.dy;
    bst_route_node *way = g->way;
    int count = g->route_count;
    if (!source->star && hypot(dx, dy) > OWN_WAY_PX) {
        for (int k = 0; k < g->path.count; k++) {
            double u = (double)k / (g->path.count - 1) - 0.5;
            g->object_x[k] = g->path_x[k] + u * dx;
            g->object_y[k] = g->path_y[k] + u * dy;
        }
        const bst_route_path own = {g->object_x, g->object_y, g->path.count};
        count = bst_route_lay(&own, g->total_sigma, way);
        dx = dy = 0.0;
    } else {
        memcpy(way, g->route, (size_t)count * sizeof *way);
    }
    for (int i = 0; i < count; i++) {
        double u = way[i].time - 0.5;
        way[i].x += source->x + u * dx;
        way[i].y += source->y + u * dy;
    }
    return count;
}

static bst_status do_source(bst_ctx *ctx, bst_generator *g, const generator_source *source,
                            bool lay) {
    double least = lay ? LEAST_LIGHT : LEAST_SEEN;
    if ((source->star && source->amplitude * g->route_top < least) || !comes_in(g, source)) {
        return BST_OK;
    }
    int count = way_of(g, source);
    const bst_route_node *way = g->way;
    arrivals faint = {.draw = FAINT_STREAK | source->name << 24};
    faint.next = draw_exponential(g, &faint);
    for (int first = 0, end; first + 1 < count; first = end) {
        double dx, dy;
        course(way, count, first, &dx, &dy);
        bool by_row = fabs(dy) > fabs(dx);
        for (end = first + 1; end + 1 < count; end++) {
            double ex, ey;
            course(way, count, end, &ex, &ey);
            /* a little past the diagonal is no reason to part it */
            bool same = by_row ? ey * dy > 0.0 && fabs(ey) > 0.6 * fabs(ex)
                               : ex * dx > 0.0 && fabs(ex) > 0.6 * fabs(ey);
            if (!same) {
                break;
            }
        }
        int nodes = end - first + 1;
        BST_TRY(lay ? lay_bright(ctx, g, source, way + first, nodes, by_row)
                    : search_bright(ctx, g, source, way + first, nodes, by_row, &faint));
    }
    return BST_OK;
}

/* Memory is written to, so that it is the process's from here on. */
bst_status bst_generator_reserve_streaks(bst_ctx *ctx, bst_generator *g, int width, int height) {
    if (!g->streaks) {
        g->streaks = bst_pages_alloc(sizeof *g->streaks);
        if (!g->streaks) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
        memset(g->streaks, 0, sizeof *g->streaks);
        bst_streak_noise_init(&g->streaks->noise);
    }
    struct generator_streaks *w = g->streaks;
    if (width * height > w->map_room) {
        size_t bytes = (size_t)width * (size_t)height * sizeof *w->map;
        free(w->map);
        w->map = bst_pages_alloc(bytes);
        w->map_room = w->map ? width * height : 0;
        if (!w->map) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
        memset(w->map, 0, bytes);
    }
    return BST_OK;
}

bst_status bst_generator_fragments(bst_ctx *ctx, bst_generator *g) {
    BST_TRY(bst_generator_reserve_streaks(ctx, g, g->width, g->height));
    bst_streak_noise_set(&g->streaks->noise, g->total_sigma);
    set_alarms(g);
    struct generator_streaks *w = g->streaks;
    bst_status status = BST_OK;
    for (int pass = 0; pass < 2; pass++) {
        for (int r = 0; r < g->rank_count && status == BST_OK; r++) {
            const generator_source *source = &g->sources[g->ranks[r].index];
            if (source->broken) {
                status = do_source(ctx, g, source, pass == 0);
            }
        }
    }
    if (status == BST_OK) {
        report(g);
    }
    for (int i = 0; i < w->touched_count; i++) {
        const touched *t = &w->touched[i];
        for (int r = -LIGHT_ROWS; r <= LIGHT_ROWS; r++) {
            int at = pixel_of(g, t->by_row, t->at, t->middle + r);
            if (at >= 0) {
                w->map[at] = (pixel){0.0f, 0.0f};
            }
        }
    }
    w->touched_count = w->maxima_count = 0;
    return status;
}

void bst_generator_free_streaks(struct generator_streaks *w) {
    if (w) {
        free(w->map);
        free(w->touched);
        free(w->maxima);
        free(w);
    }
}
