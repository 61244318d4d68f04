#include "scenegen/smear/motion_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/kernels/scene_shared.h"

/* Cells per axis: as many as it takes for a cell's stars to move alike, but for UNLIKE of the
 * path's length, or where most cells would have to be filled, UNLIKE_MANY; and nodes about which
 * light is summed. */
enum { FEW_CELLS = 6, MANY_CELLS = 96, ANCHORS = 48, FEW_SOURCES = 256 };
#define UNLIKE 0.01
#define UNLIKE_MANY 0.06
/* Nodes that are nearer to each other than this, in sigma, give no scale. */
#define LEAST_STEP 0.02

/* A node as the map needs it. */
typedef struct turn {
    double m[9]; /* as in the table */
    double weight, roll_rad, tilt_px, p[3];
} turn;

/* Place of the present cell's middle at a node. */
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
    unsigned frame, filled[MANY_CELLS * MANY_CELLS];
    bst_smear_star_motion_cell cells[MANY_CELLS * MANY_CELLS];
};

bst_status bst_motion_map_create(bst_ctx *ctx, bst_motion_map **out) {
    *out = calloc(1, sizeof **out);
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the motion of the field");
}

void bst_motion_map_free(bst_motion_map *map) {
    if (map) {
        free(map->turns);
        free(map->places);
        free(map);
    }
}

/* By how much a star's motion between two nodes differs, at most, from that of a star `apart_px`
 * from it: the field turns, and a tilt stretches the tangent plane. */
static double other_motion(const bst_motion_map *map, const turn *a, const turn *b,
                           double apart_px) {
    double tangent = map->f.reach_px * map->f.scale_rad;
    double tilt = hypot(a->p[0] - b->p[0], a->p[1] - b->p[1]) / map->f.tilt_px;
    return apart_px * (fabs(a->roll_rad - b->roll_rad) + 2.0 * tangent * tilt * map->f.scale_rad);
}

bst_status bst_motion_map_begin(bst_ctx *ctx, bst_motion_map *map,
                                const bst_motion_map_frame *frame) {
    if (frame->count > map->capacity) {
        free(map->turns);
        free(map->places);
        map->turns = malloc((size_t)frame->count * sizeof *map->turns);
        map->places = malloc((size_t)frame->count * sizeof *map->places);
        map->capacity = map->turns && map->places ? frame->count : 0;
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
        out->tilt_px = hypot(node->p[0], node->p[1]) / frame->tilt_px;
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
    double side =
        sqrt(2.0) * other_motion(map, &from, &to, frame->reach_px) /
        ((frame->sources <= FEW_SOURCES ? UNLIKE : UNLIKE_MANY) * fmax(length, map->f.sigma_px));
    map->side = (int)fmin(fmax(ceil(side), FEW_CELLS), MANY_CELLS);
    map->cell_px = 2.0 * frame->reach_px / map->side;
    return BST_OK;
}

static void place_cell(bst_motion_map *map, double x, double y) {
    for (int n = 0; n < map->count; n++) {
        const double *m = map->turns[n].m;
        double depth = m[6] * x + m[7] * y + m[8], scale = 1.0 / depth;
        place *p = &map->places[n];
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

/* Largest share of the light that falls on one pixel, of any star of the cell. */
static double cell_share(const bst_motion_map *map, int binning, double radius_px) {
    double spread, line = bst_motion_pixel_share(map->f.sigma_px, binning, &spread);
    double per = 1.0 / (spread * sqrt(2.0)), best = 0.0;
    int stride = map->count / ANCHORS + 1;
    for (int a = 0; a < map->count; a += stride) {
        const place *at = &map->places[a];
        double sum = 0.0;
        for (int n = 0; n < map->count && at->front; n++) {
            const place *p = &map->places[n];
            double dx = p->x - at->x, dy = p->y - at->y, d = sqrt(dx * dx + dy * dy);
            d = d * map->f.shrink - other_motion(map, &map->turns[a], &map->turns[n], radius_px);
            double q = d > 0.0 ? d * d * per * per : 0.0;
            sum += p->front && q < 20.0 ? map->turns[n].weight * exp(-q) : 0.0;
        }
        best = fmax(best, sum);
    }
    return best * line;
}

/* Largest motion of a star of the cell over the path's, from node to node. */
static double cell_scale(const bst_motion_map *map, double radius_px) {
    double worst = 0.0, far = map->f.sensor_px + radius_px;
    bool any = false;
    for (int n = 0; n + 1 < map->count; n++) {
        const place *p = &map->places[n], *q = p + 1;
        const turn *a = &map->turns[n], *b = a + 1;
        double step = sqrt((a->p[0] - b->p[0]) * (a->p[0] - b->p[0]) +
                           (a->p[1] - b->p[1]) * (a->p[1] - b->p[1]) +
                           (a->p[2] - b->p[2]) * (a->p[2] - b->p[2]));
        if (!p->front || !q->front || step < LEAST_STEP * map->f.sigma_px ||
            fmin(hypot(p->x, p->y), hypot(q->x, q->y)) > far) {
            continue;
        }
        double moved = hypot(p->x - q->x, p->y - q->y) + other_motion(map, a, b, radius_px);
        worst = fmax(worst, moved * map->f.stretch / step);
        any = true;
    }
    return any ? worst : 1.0;
}

static void fill_cell(bst_motion_map *map, bst_smear_star_motion_cell *cell, double x, double y) {
    double radius = map->cell_px * sqrt(0.5);
    place_cell(map, x, y);
    cell->share = cell->read_share = cell_share(map, 1, radius);
    if (map->f.binning > 1) {
        cell->read_share = cell_share(map, map->f.binning, radius);
    }
    cell->scale = cell_scale(map, radius);
    turn still = {.weight = 0.0};
    for (int n = 0; n < map->count; n++) {
        const place *p = &map->places[n];
        double other = other_motion(map, &still, &map->turns[n], radius);
        double way[2] = {p->x - x, p->y - y};
        for (int i = 0; i < 2; i++) {
            way[i] = p->front ? way[i] : 0.0;
            cell->low[i] = n == 0 ? way[i] - other : fmin(cell->low[i], way[i] - other);
            cell->high[i] = n == 0 ? way[i] + other : fmax(cell->high[i], way[i] + other);
        }
    }
}

const bst_smear_star_motion_cell *bst_motion_map_at(bst_motion_map *map, double x, double y) {
    double per = 1.0 / map->cell_px, most = map->side - 1.0;
    double i = fmin(fmax(floor((x + map->f.reach_px) * per), 0.0), most);
    double j = fmin(fmax(floor((y + map->f.reach_px) * per), 0.0), most);
    int n = (int)j * map->side + (int)i;
    if (map->filled[n] != map->frame) {
        map->filled[n] = map->frame;
        fill_cell(map, &map->cells[n], (i + 0.5) * map->cell_px - map->f.reach_px,
                  (j + 0.5) * map->cell_px - map->f.reach_px);
    }
    return &map->cells[n];
}
