#include "obsgen/streak/streak_path.h"

#include <math.h>

/* A source whose path differs more than this from the stars' gets a trail of its own. */
static const double OWN_WAY_PX = 1.0;

enum { ROWS = BST_STREAK_ROWS, BLOCK = BST_STREAK_BLOCK };

/* Displacement of a source's trail from another: shift, and its change from end to end. */
typedef struct shift {
    double x, y, dx, dy;
} shift;

/* ---- A trail and its parts ---- */

/* Mean direction of a trail after a node, averaged over jitter. */
static void mean_direction(const bst_streak_way *way, int at, double *dx, double *dy) {
    enum { AHEAD = 12 };
    int end = at + AHEAD < way->count ? at + AHEAD : way->count - 1;
    int start = end - AHEAD > 0 ? end - AHEAD : 0;
    *dx = way->x[end] - way->x[start];
    *dy = way->y[end] - way->y[start];
}

/* Splits a trail into parts that run mainly along one axis in one direction. */
static void split_trail(bst_streak_way *way) {
    way->parts = 0;
    for (int first = 0, end; first + 1 < way->count; first = end) {
        double dx, dy;
        mean_direction(way, first, &dx, &dy);
        bool by_row = fabs(dy) > fabs(dx);
        for (end = first + 1; end + 1 < way->count; end++) {
            double ex, ey;
            mean_direction(way, end, &ex, &ey);
            /* hysteresis about the diagonal */
            bool same = by_row ? ey * dy > 0.0 && fabs(ey) > 0.6 * fabs(ex)
                               : ex * dx > 0.0 && fabs(ex) > 0.6 * fabs(ey);
            if (!same) {
                break;
            }
        }
        way->by_row[way->parts] = by_row;
        way->first[way->parts++] = first;
        way->first[way->parts] = end;
    }
}

/* Sets a trail from nodes, with bounding boxes of its blocks. */
static void set_trail(bst_streak_way *way, const bst_star_trail_node *nodes, int count) {
    way->count = count;
    for (int k = 0; k < count; k++) {
        way->x[k] = nodes[k].x;
        way->y[k] = nodes[k].y;
        way->time[k] = nodes[k].time;
        way->light[k] = nodes[k].light;
    }
    split_trail(way);
    for (int i = 0; i * BLOCK < count; i++) {
        double *box = way->box[i];
        box[0] = box[2] = INFINITY;
        box[1] = box[3] = -INFINITY;
        for (int k = i * BLOCK; k <= (i + 1) * BLOCK && k < count; k++) {
            double x = way->x[k], y = way->y[k];
            box[0] = x < box[0] ? x : box[0];
            box[1] = x > box[1] ? x : box[1];
            box[2] = y < box[2] ? y : box[2];
            box[3] = y > box[3] ? y : box[3];
        }
    }
}

void bst_streak_ways_begin(bst_streak_ways *w, const bst_generator *g,
                           const bst_streak_limits *limits) {
    w->limits = *limits;
    set_trail(&w->stars, g->route, g->route_count);
}

/* ---- Runs of a source ---- */

/* Block of a source's nodes, along and across its main axis, and the lines between them. */
typedef struct node_block {
    double along[BLOCK + 1], across[BLOCK + 1];
    double slope[BLOCK], more[BLOCK]; /* per px along: across, light */
    double slant[BLOCK]; /* ratio of distances across the trail to those across the axis */
} node_block;

/* Sets a block from node `first` on, `count` lines. */
static void set_node_block(const bst_streak_way *way, const shift *by, bool by_row, int first,
                           int count, node_block *s) {
    const double *x = by_row ? way->y + first : way->x + first;
    const double *y = by_row ? way->x + first : way->y + first;
    double bx = by_row ? by->y : by->x, by_dx = by_row ? by->dy : by->dx;
    double cx = by_row ? by->x : by->y, by_dy = by_row ? by->dx : by->dy;
    const double *time = way->time + first, *light = way->light + first;
    for (int i = 0; i <= count; i++) {
        double u = time[i] - 0.5;
        s->along[i] = x[i] + bx + u * by_dx;
        s->across[i] = y[i] + cx + u * by_dy;
    }
    for (int i = 0; i < count; i++) {
        double run = s->along[i + 1] - s->along[i], rise = s->across[i + 1] - s->across[i];
        s->slant[i] = run * run / (run * run + rise * rise);
        s->slope[i] = rise / run;
        s->more[i] = (light[i + 1] - light[i]) / run;
    }
}

/* State of the run being generated. */
typedef struct run_builder {
    bst_streak_light *light;
    int source, step; /* step: of the places along it */
    bool by_row, begun;
    double amplitude, fall, at; /* fall: across the trail; at: next place along it */
} run_builder;

static int floor_of(double value) {
    int whole = (int)value;
    return whole - (value < whole);
}

/* Limits of a run's places, along and across. */
typedef struct bounds {
    double first, last, low, high;
} bounds;

/* Place at coordinate `at` on line k of a block; false if it is outside the limits. */
static inline bool place_on(const node_block *s, const double *lights, const bounds *b, int k,
                            double at, const run_builder *m, bst_streak_place *p) {
    double off = at - s->along[k], part = m->step * off > 0.0 ? off : 0.0;
    double c = s->across[k] + part * s->slope[k];
    int middle = floor_of(c + 0.5);
    *p = (bst_streak_place){.at = (int)at,
                            .middle = middle,
                            .height = (float)(m->amplitude * (lights[k] + part * s->more[k])),
                            .off = (float)(c - middle),
                            .fall = (float)(m->fall * s->slant[k])};
    return (at >= b->first) & (at <= b->last) & (c > b->low) & (c < b->high);
}

/* Generates the places of a block. */
static bst_status make_places(bst_ctx *ctx, const bst_streak_limits *limits, const bounds *b,
                              const node_block *s, const double *lights, int count,
                              run_builder *m) {
    bst_streak_light *l = m->light;
    double at = m->at, way = m->step;
    for (int k = 0; k < count; k++) {
        double end = s->along[k] + (s->along[k + 1] - s->along[k]);
        if (m->begun) { /* most lines have one place or none: continue the run */
            BST_TRY(bst_streak_light_room(ctx, l));
            bst_streak_place *p = &l->places[l->place_count];
            bool here = way * (end - at) > 0.0, near = place_on(s, lights, b, k, at, m, p);
            bst_streak_light_take(l, here & near);
            at += (here & near) ? way : 0.0;
            if (here <= near && !(way * (end - at) > 0.0)) {
                continue;
            }
        }
        for (; way * (end - at) > 0.0; at += way) {
            bst_streak_place p;
            bool near = place_on(s, lights, b, k, at, m, &p);
            if (near != m->begun) {
                BST_TRY(
                    near ? bst_streak_light_run(ctx, l, m->source, m->by_row, m->step)
                         : bst_streak_light_end(ctx, l, limits->seen, limits->lit, limits->dense));
                m->begun = near;
            }
            if (near) {
                BST_TRY(bst_streak_light_place(ctx, l, &p));
            }
        }
    }
    m->at = at;
    return BST_OK;
}

/* Generates the runs of nodes first to last of a part of a trail. */
static bst_status make_runs(bst_ctx *ctx, const bst_generator *g, const bst_streak_limits *limits,
                            const bst_streak_way *way, int first, int last, const shift *by,
                            run_builder *m) {
    int beyond = limits->beyond, across = beyond + ROWS;
    const bounds b = {-beyond, (m->by_row ? g->height : g->width) + beyond, -across,
                      (m->by_row ? g->width : g->height) + across};
    m->begun = false;
    for (int k = first; k < last; k += BLOCK) {
        int count = last - k < BLOCK ? last - k : BLOCK;
        node_block s;
        set_node_block(way, by, m->by_row, k, count, &s);
        if (k == first) {
            m->at = m->step > 0 ? ceil(s.along[0]) : floor(s.along[0]);
        }
        BST_TRY(make_places(ctx, limits, &b, &s, way->light + k, count, m));
    }
    return m->begun ? bst_streak_light_end(ctx, m->light, limits->seen, limits->lit, limits->dense)
                    : BST_OK;
}

/* True if a block of nodes may touch the frame. */
static bool block_touches_frame(const bst_generator *g, int beyond, const double box[4],
                                const shift *by) {
    double margin = beyond + ROWS + 1.0;
    double x = margin + 0.5 * fabs(by->dx), y = margin + 0.5 * fabs(by->dy);
    return by->x + box[1] > -x && by->x + box[0] < g->width + x && by->y + box[3] > -y &&
           by->y + box[2] < g->height + y;
}

/* Generates the runs of a source: the parts of its trail that touch the frame. */
static bst_status run_along(bst_ctx *ctx, const bst_generator *g, const bst_streak_limits *limits,
                            int source, const bst_streak_way *way, const shift *by,
                            bst_streak_light *light) {
    run_builder m = {.light = light,
                     .source = source,
                     .amplitude = g->sources[source].amplitude,
                     .fall = 0.25 / (g->cross_sigma * g->cross_sigma)};
    for (int i = 0; i < way->parts; i++) {
        int first = way->first[i], last = way->first[i + 1], from = -1;
        m.by_row = way->by_row[i];
        const double *along = m.by_row ? way->y : way->x;
        m.step = along[last] - along[first] > 0.0 ? 1 : -1;
        for (int k = first; k < last;) {
            int end = (k / BLOCK + 1) * BLOCK;
            end = end < last ? end : last;
            bool in = block_touches_frame(g, limits->beyond, way->box[k / BLOCK], by);
            from = in && from < 0 ? k : from;
            if (from >= 0 && (!in || end == last)) {
                BST_TRY(make_runs(ctx, g, limits, way, from, in ? end : k, by, &m));
                from = -1;
            }
            k = end;
        }
    }
    return BST_OK;
}

/* True if a source's trail touches the frame. */
static bool touches_frame(const bst_generator *g, const generator_source *s) {
    double margin_x = ROWS + 1.0 + 0.5 * fabs(s->path.dx - g->whole_path.dx);
    double margin_y = ROWS + 1.0 + 0.5 * fabs(s->path.dy - g->whole_path.dy);
    return s->x + g->route_box[1] > -margin_x && s->x + g->route_box[0] < g->width + margin_x &&
           s->y + g->route_box[3] > -margin_y && s->y + g->route_box[2] < g->height + margin_y;
}

/* A source follows the stars' trail, corrected for its own end points, or has a trail of its own.
 */
bst_status bst_streak_ways_add(bst_ctx *ctx, bst_streak_ways *w, bst_generator *g, int index,
                               bst_streak_light *light) {
    const generator_source *source = &g->sources[index];
    if ((source->star && source->amplitude * g->route_top < w->limits.seen) ||
        !touches_frame(g, source)) {
        return BST_OK;
    }
    shift by = {source->x, source->y, source->path.dx - g->whole_path.dx,
                source->path.dy - g->whole_path.dy};
    if (source->star || hypot(by.dx, by.dy) <= OWN_WAY_PX) {
        return run_along(ctx, g, &w->limits, index, &w->stars, &by, light);
    }
    for (int k = 0; k < g->path.count; k++) {
        double u = (double)k / (g->path.count - 1) - 0.5;
        g->object_x[k] = g->path_x[k] + u * by.dx;
        g->object_y[k] = g->path_y[k] + u * by.dy;
    }
    const bst_star_trail_path own = {g->object_x, g->object_y, g->path.count};
    set_trail(&w->own, g->way, bst_star_trail_lay(&own, g->cross_sigma, g->way));
    by.dx = by.dy = 0.0;
    return run_along(ctx, g, &w->limits, index, &w->own, &by, light);
}
