#include "sim/analysis/characterize/radiation_hits.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Most pixels of a hit: longer groups are no tracks. */
enum { MOST_PIXELS = 4096 };

void bst_radiation_hits_free(bst_radiation_hits *hits) {
    free(hits->items);
    *hits = (bst_radiation_hits){0};
}

/* A pair being searched. */
typedef struct search {
    const bst_hit_pair *pair;
    uint8_t *seen; /* [height * width] */
    int *open;     /* [MOST_PIXELS] pixels whose neighbours are to be looked at */
} search;

/* Difference of a pixel in standard deviations; 0 where it is not used. */
static double deviation(const bst_hit_pair *p, int x, int y, double *difference, bool *hot) {
    size_t i = (size_t)y * (size_t)p->width + (size_t)x;
    int block = (int)((int64_t)x * p->blocks_per_side / p->width) +
                p->blocks_per_side * (int)((int64_t)y * p->blocks_per_side / p->height);
    double a = (double)p->first[i], b = (double)p->second[i], sigma = p->sigma[block];
    *difference = b - a - p->rows[y];
    double below = fmin(a, b);
    *hot = below > p->hot[block];
    double shot = *hot ? 2.0 * (below - p->level[block]) / p->gain_e_per_dn : 0.0;
    return isfinite(*difference) && sigma > 0.0 ? *difference / sqrt(sigma * sigma + shot) : 0.0;
}

static bst_status add_hit(bst_ctx *ctx, bst_radiation_hits *h, double charge, int pixels) {
    if (h->used == h->room) {
        size_t room = h->room ? 2 * h->room : 256;
        bst_radiation_hit *more = realloc(h->items, room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu radiation hits", room);
        }
        h->items = more;
        h->room = room;
    }
    h->items[h->used++] = (bst_radiation_hit){(float)charge, pixels};
    return BST_OK;
}

/* Follows a hit from its brightest side on and adds it. */
static bst_status follow(bst_ctx *ctx, search *s, int x0, int y0, double sign,
                         bst_radiation_hits *hits) {
    const bst_hit_pair *p = s->pair;
    int count = 0, done = 0;
    double charge = 0.0, d;
    bool first_edge = false, last_edge = false, hot;
    s->open[count++] = y0 * p->width + x0;
    s->seen[y0 * p->width + x0] = 1;
    while (done < count) {
        int x = s->open[done] % p->width, y = s->open[done] / p->width;
        done++;
        (void)deviation(p, x, y, &d, &hot);
        charge += fabs(d);
        first_edge = first_edge || x == 0 || y == 0;
        last_edge = last_edge || x == p->width - 1 || y == p->height - 1;
        for (int k = 0; k < 9; k++) {
            int u = x + k % 3 - 1, v = y + k / 3 - 1;
            if (u < 0 || v < 0 || u >= p->width || v >= p->height || count == MOST_PIXELS ||
                s->seen[v * p->width + u] || !(sign * deviation(p, u, v, &d, &hot) > p->grow)) {
                continue;
            }
            s->seen[v * p->width + u] = 1;
            s->open[count++] = v * p->width + u;
        }
    }
    hits->count += !last_edge; /* the edges' share of an unlimited plane */
    return first_edge || last_edge || count == MOST_PIXELS ? BST_OK
                                                           : add_hit(ctx, hits, charge, count);
}

bst_status bst_radiation_hits_add(bst_ctx *ctx, const bst_hit_pair *pair, uint8_t *mask,
                                  bst_radiation_hits *hits) {
    assert(pair && mask && hits);
    search s = {.pair = pair, .seen = mask, .open = malloc(MOST_PIXELS * sizeof *s.open)};
    bst_status status =
        s.open ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a radiation hit");
    memset(mask, 0, (size_t)pair->width * (size_t)pair->height);
    for (int y = 0; status == BST_OK && y < pair->height; y++) {
        for (int x = 0; status == BST_OK && x < pair->width; x++) {
            bool hot;
            double d, v = deviation(pair, x, y, &d, &hot);
            if (!hot && fabs(v) > pair->seed &&
                !s.seen[(size_t)y * (size_t)pair->width + (size_t)x]) {
                status = follow(ctx, &s, x, y, v > 0.0 ? 1.0 : -1.0, hits);
            }
        }
    }
    int blocks = pair->blocks_per_side * pair->blocks_per_side;
    hits->threshold_dn = pair->grow * bst_mean_estimate(pair->sigma, blocks).value;
    hits->frames += 2;
    hits->width = pair->width;
    hits->height = pair->height;
    free(s.open);
    return status;
}
