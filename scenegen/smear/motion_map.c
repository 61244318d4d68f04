#include "scenegen/smear/motion_map.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/kernels/scene_shared.h"
#include "sim/core/pages.h"

/* Cells per axis: stars of a cell move alike to within UNLIKE of the path length, or UNLIKE_MANY if
 * most cells are used. ANCHORS: nodes about which light is summed. */
enum { FEW_CELLS = 6, MANY_CELLS = 96, ANCHORS = 48, FEW_SOURCES = 256 };
/* Up to so many nodes, the motion between any two is computed once for all cells. */
enum { FEW_NODES = 24 };
#define UNLIKE 0.01
#define UNLIKE_MANY 0.06
/* Nodes closer than this, in sigma, give no motion scale. */
#define LEAST_STEP 0.02
/* Node light below exp(-MOST_EXPONENT) at a position is neglected. */
#define MOST_EXPONENT 20.0
/* Margin of bounds that only save work, above their rounding error. */
#define SAFELY 1e-9

/* A node of the camera path as the map uses it. */
typedef struct turn {
    double m[9]; /* as in the node table */
    double weight, roll_rad, p[3];
    /* to the next node: path length in px, and relative motion of a star 1 px away */
    double step_px, other_step;
    double other_still; /* the same, from the reference attitude */
} turn;

/* Position of the current cell's centre at a node. */
typedef struct place {
    double x, y;
    bool front;
} place;

struct bst_motion_map {
    bst_motion_map_frame f;
    turn *turns;
    place *places;
    int count, capacity;
    int side; /* cells per axis */
    double cell_px;
    double between[FEW_NODES][FEW_NODES]; /* other_motion of two nodes, if there are few */
    double other; /* largest relative motion between any two nodes of a star 1 px away */
    unsigned frame, filled[MANY_CELLS * MANY_CELLS];
    bst_smear_star_motion_cell cells[MANY_CELLS * MANY_CELLS];
};

bst_status bst_motion_map_create(bst_ctx *ctx, bst_motion_map **out) {
    *out = bst_pages_zero(1, sizeof **out);
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the motion of the field");
}

void bst_motion_map_free(bst_motion_map *map) {
    if (map) {
        free(map->turns);
        free(map->places);
        bst_pages_free(map);
    }
}

/* Upper bound of the relative motion between two nodes of stars 1 px apart: field rotation and
 * tangent-plane stretch. */
static double other_motion(const bst_motion_map *map, const turn *a, const turn *b) {
    double tangent = map->f.reach_px * map->f.scale_rad;
    double tilt = hypot(a->p[0] - b->p[0], a->p[1] - b->p[1]) / map->f.tilt_px;
    return fabs(a->roll_rad - b->roll_rad) + 2.0 * tangent * tilt * map->f.scale_rad;
}

/* Motion between nodes common to all cells. */
static void measure_steps(bst_motion_map *map) {
    const turn still = {.weight = 0.0};
    for (int n = 0; n < map->count; n++) {
        turn *a = &map->turns[n];
        a->other_still = other_motion(map, &still, a);
        if (n + 1 < map->count) {
            const turn *b = a + 1;
            a->step_px = sqrt((a->p[0] - b->p[0]) * (a->p[0] - b->p[0]) +
                              (a->p[1] - b->p[1]) * (a->p[1] - b->p[1]) +
                              (a->p[2] - b->p[2]) * (a->p[2] - b->p[2]));
            a->other_step = other_motion(map, a, b);
        }
    }
    for (int a = 0; a < map->count && map->count <= FEW_NODES; a++) {
        for (int n = 0; n < a; n++) {
            map->between[a][n] = map->between[n][a] =
                other_motion(map, &map->turns[a], &map->turns[n]);
        }
        map->between[a][a] = 0.0;
    }
}

bst_status bst_motion_map_begin(bst_ctx *ctx, bst_motion_map *map,
                                const bst_motion_map_frame *frame) {
    assert(map && frame);
    if (frame->count > map->capacity) {
        /* few later frames need more */
        const int capacity = frame->count < 2048 ? 4096 : 2 * frame->count;
        free(map->turns);
        free(map->places);
        map->turns = malloc((size_t)capacity * sizeof *map->turns);
        map->places = malloc((size_t)capacity * sizeof *map->places);
        map->capacity = map->turns && map->places ? capacity : 0;
        if (map->capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the motion of the field");
        }
    }
    map->f = *frame;
    map->count = frame->count;
    map->frame++;
    double low[3] = {0.0}, high[3] = {0.0};
    for (int n = 0; n < frame->count; n++) {
        const bst_smear_node *node = &frame->nodes[n];
        const float *t = frame->table + (size_t)(n / BST_BLOCK) * BST_TABLE_ROWS * BST_BLOCK;
        turn *out = &map->turns[n];
        for (int i = 0; i < 9; i++) {
            out->m[i] = (double)t[i * BST_BLOCK + n % BST_BLOCK];
        }
        memcpy(out->p, node->p, sizeof out->p);
        out->weight = node->weight;
        out->roll_rad = frame->roll_px > 0.0 ? node->p[2] / frame->roll_px : 0.0;
        for (int i = 0; i < 3; i++) {
            low[i] = n == 0 ? node->p[i] : fmin(low[i], node->p[i]);
            high[i] = n == 0 ? node->p[i] : fmax(high[i], node->p[i]);
        }
    }
    turn from = {.p = {low[0], low[1], low[2]}}, to = {.p = {high[0], high[1], high[2]}};
    if (frame->roll_px > 0.0) {
        from.roll_rad = low[2] / frame->roll_px;
        to.roll_rad = high[2] / frame->roll_px;
    }
    double length =
        sqrt((high[0] - low[0]) * (high[0] - low[0]) + (high[1] - low[1]) * (high[1] - low[1]) +
             (high[2] - low[2]) * (high[2] - low[2]));
    map->other = other_motion(map, &from, &to);
    measure_steps(map);
    double side =
        sqrt(2.0) * (frame->reach_px * map->other) /
        ((frame->sources <= FEW_SOURCES ? UNLIKE : UNLIKE_MANY) * fmax(length, map->f.sigma_px));
    map->side = (int)fmin(fmax(ceil(side), FEW_CELLS), MANY_CELLS);
    map->cell_px = 2.0 * frame->reach_px / map->side;
    return BST_OK;
}

static void place_cell(const bst_motion_map *map, place *places, double x, double y) {
    for (int n = 0; n < map->count; n++) {
        const double *m = map->turns[n].m;
        double depth = m[6] * x + m[7] * y + m[8], scale = 1.0 / depth;
        place *p = &places[n];
        p->front = depth > 1e-3;
        p->x = ((m[0] + m[8]) * x + m[1] * y + m[2]) * scale;
        p->y = (m[3] * x + (m[4] + m[8]) * y + m[5]) * scale;
    }
}

double bst_motion_pixel_share(double sigma_px, int binning, double *spread_px) {
    double line = erf(0.5 * binning / (sigma_px * sqrt(2.0)));
    *spread_px = sqrt(sigma_px * sigma_px + (binning * binning - 1.0) / 12.0);
    return line * line;
}

/* Upper bound of a star's light share in one pixel, over the cell. */
static double cell_share(const bst_motion_map *map, const place *places, int binning,
                         double radius_px) {
    double spread, line = bst_motion_pixel_share(map->f.sigma_px, binning, &spread);
    double per = 1.0 / (spread * sqrt(2.0)), best = 0.0;
    /* nodes further apart share no pixel */
    double reach =
        (1.0 + SAFELY) * (sqrt(MOST_EXPONENT) / per + map->other * radius_px) / map->f.shrink;
    double reach2 = reach * reach;
    int stride = map->count / ANCHORS + 1;
    for (int a = 0; a < map->count; a += stride) {
        const place *at = &places[a];
        double sum = 0.0;
        for (int n = 0; n < map->count && at->front; n++) {
            const place *p = &places[n];
            double dx = p->x - at->x, dy = p->y - at->y, d2 = dx * dx + dy * dy;
            if (d2 > reach2 || !p->front) {
                continue;
            }
            double other = map->count <= FEW_NODES
                               ? map->between[a][n]
                               : other_motion(map, &map->turns[a], &map->turns[n]);
            double d = sqrt(d2) * map->f.shrink - radius_px * other;
            double q = d > 0.0 ? d * d * per * per : 0.0;
            sum += q < MOST_EXPONENT ? map->turns[n].weight * exp(-q) : 0.0;
        }
        best = fmax(best, sum);
    }
    return best * line;
}

/* Largest motion of a star in the cell relative to the path's, from node to node. */
static double cell_scale(const bst_motion_map *map, const place *places, double radius_px) {
    double worst = 0.0, far = map->f.sensor_px + radius_px;
    double least = LEAST_STEP * map->f.sigma_px, near2 = (1.0 - SAFELY) * far * far;
    bool any = false;
    for (int n = 0; n + 1 < map->count; n++) {
        const place *p = &places[n], *q = p + 1;
        const turn *a = &map->turns[n];
        if (!p->front || !q->front || a->step_px < least) {
            continue;
        }
        double dx = p->x - q->x, dy = p->y - q->y, other = radius_px * a->other_step;
        double most = (sqrt(dx * dx + dy * dy) + other) * map->f.stretch * (1.0 + SAFELY);
        if (any && most <= worst * a->step_px) {
            continue;
        }
        if (p->x * p->x + p->y * p->y > near2 && q->x * q->x + q->y * q->y > near2 &&
            fmin(hypot(p->x, p->y), hypot(q->x, q->y)) > far) {
            continue;
        }
        worst = fmax(worst, (hypot(dx, dy) + other) * map->f.stretch / a->step_px);
        any = true;
    }
    return any ? worst : 1.0;
}

static void fill_cell(const bst_motion_map *map, place *places, bst_smear_star_motion_cell *cell,
                      double x, double y) {
    double radius = map->cell_px * sqrt(0.5);
    place_cell(map, places, x, y);
    cell->share = cell->read_share = cell_share(map, places, 1, radius);
    if (map->f.binning > 1) {
        cell->read_share = cell_share(map, places, map->f.binning, radius);
    }
    cell->scale = cell_scale(map, places, radius);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int n = 0; n < map->count; n++) {
        const place *p = &places[n];
        double other = radius * map->turns[n].other_still;
        double way[2] = {p->front ? p->x - x : 0.0, p->front ? p->y - y : 0.0};
        for (int i = 0; i < 2; i++) {
            low[i] = way[i] - other < low[i] ? way[i] - other : low[i];
            high[i] = way[i] + other > high[i] ? way[i] + other : high[i];
        }
    }
    memcpy(cell->low, low, sizeof low);
    memcpy(cell->high, high, sizeof high);
    for (int k = 0; k < BST_MOTION_ERRORS; k++) {
        cell->error[k] = cell->predicted[k] = -1.0;
    }
}

/* Number of the cell of a position. */
static int cell_at(const bst_motion_map *map, double x, double y) {
    double per = 1.0 / map->cell_px, most = map->side - 1.0;
    double i = fmin(fmax(floor((x + map->f.reach_px) * per), 0.0), most);
    double j = fmin(fmax(floor((y + map->f.reach_px) * per), 0.0), most);
    return (int)j * map->side + (int)i;
}

static void fill_number(bst_motion_map *map, place *places, int n) {
    double x = (n % map->side + 0.5) * map->cell_px - map->f.reach_px;
    double y = (n / map->side + 0.5) * map->cell_px - map->f.reach_px;
    fill_cell(map, places, &map->cells[n], x, y);
}

bst_smear_star_motion_cell *bst_motion_map_at(bst_motion_map *map, double x, double y) {
    int n = cell_at(map, x, y);
    if (map->filled[n] != map->frame) {
        map->filled[n] = map->frame;
        fill_number(map, map->places, n);
    }
    return &map->cells[n];
}

/* Cells that threads fill. */
typedef struct cells_to_fill {
    bst_motion_map *map;
    int *cells; /* -1: filled when it is asked for */
} cells_to_fill;

/* Fills some of the cells (callback). */
static void fill_some(void *user, int begin, int end) {
    const cells_to_fill *all = user;
    place *places = malloc((size_t)all->map->count * sizeof *places);
    for (int k = begin; k < end; k++) {
        if (places) {
            fill_number(all->map, places, all->cells[k]);
        } else {
            all->cells[k] = -1;
        }
    }
    free(places);
}

bool bst_motion_map_fill(bst_motion_map *map, bst_parallel *pool, const double *xy, int count) {
    enum { AT_ONCE = 4 };
    int found = 0, *cells = malloc(MANY_CELLS * MANY_CELLS * sizeof *cells);
    for (int i = 0; i < count && cells; i++) {
        int n = isnan(xy[2 * i]) ? -1 : cell_at(map, xy[2 * i], xy[2 * i + 1]);
        if (n >= 0 && map->filled[n] != map->frame) {
            map->filled[n] = map->frame;
            cells[found++] = n;
        }
    }
    cells_to_fill all = {map, cells};
    bst_parallel_for(pool, found, AT_ONCE, fill_some, &all);
    bool complete = cells != NULL;
    for (int k = 0; k < found; k++) {
        complete = complete && cells[k] >= 0;
    }
    free(cells);
    map->frame += complete ? 0U : 1U; /* otherwise none of them counts as filled */
    return complete;
}
