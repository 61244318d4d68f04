/* Connected sources of a frame, and their order as candidates for the common path. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/streak/common_streak_internal.h"

enum { EDGE_PX = 2, LEAST_PIXELS = 6, LEVELS = 8, LINE_REACH = BST_STREAK_LINE_REACH };

/* A source begins at a pixel above SEED and has those above GROW, in units of the line filter's
 * noise; brighter ones begin at GROW times powers of two. */
static const float SEED = 6.5f, GROW = 4.0f;
/* Sizes of sources that agree: to AGREE_PX and this share. */
static const double AGREE_PX = 4.0, AGREE_SHARE = 0.08;
/* Length that is added to sources in their rank, px: points count too. */
static const double SHORT_PX = 10.0;
/* Pixels of a source by which its size is measured, sigma. */
static const float LEAST_SAMPLE = 3.0f;

typedef bst_streak_shape shape;
typedef bst_streak_finder finder;

/* Collects the connected pixels of a source above a level. */
shape bst_streak_finder_flood(finder *f, float level, int from, int number) {
    const int w = f->width, h = f->height;
    shape out = {.from = from, .level = level, .x0 = w, .y0 = h};
    f->count = 0;
    f->stack[f->count++] = from;
    f->label[from] = number;
    for (int next = 0; next < f->count; next++) {
        int i = f->stack[next], x = i % w, y = i / w;
        out.sum += (double)f->smooth[i];
        if (f->smooth[i] > LEAST_SAMPLE) { /* the lines reach beyond the source */
            out.x0 = x < out.x0 ? x : out.x0;
            out.x1 = x > out.x1 ? x : out.x1;
            out.y0 = y < out.y0 ? y : out.y0;
            out.y1 = y > out.y1 ? y : out.y1;
        }
        for (int k = 0; k < 9; k++) {
            int u = x + k % 3 - 1, v = y + k / 3 - 1;
            if (u >= 0 && v >= 0 && u < w && v < h && f->label[v * w + u] != number &&
                f->lines[v * w + u] > level) {
                f->label[v * w + u] = number;
                f->stack[f->count++] = v * w + u;
            }
        }
    }
    return out;
}

static bool agree(int a, int b) {
    return abs(a - b) <= AGREE_PX + AGREE_SHARE * (a > b ? a : b);
}

/* True for two sources at the same place: one source at two levels. */
static bool same_place(const shape *a, const shape *b) {
    return abs(a->x0 - b->x0) + abs(a->x1 - b->x1) + abs(a->y0 - b->y0) + abs(a->y1 - b->y1) <
           4.0 * AGREE_PX;
}

/* Adds a source to the list; a full list loses its faintest. */
static int add_shape(shape *list, int count, const shape *found) {
    for (int i = 0; i < count; i++) {
        if (same_place(&list[i], found)) {
            return count;
        }
    }
    int at = count < BST_STREAK_SHAPES ? count++ : BST_STREAK_SHAPES;
    for (; at > 0 && list[at - 1].sum < found->sum; at--) {
        if (at < BST_STREAK_SHAPES) {
            list[at] = list[at - 1];
        }
    }
    if (at < BST_STREAK_SHAPES) {
        list[at] = *found;
    }
    return count;
}

/* Orders shapes: long ones that many others agree with first, then the brightest. */
static int by_rank(const void *a, const void *b) {
    const shape *s = a, *t = b;
    if (s->rank != t->rank) {
        return s->rank > t->rank ? -1 : 1;
    }
    return s->sum != t->sum ? (s->sum > t->sum ? -1 : 1) : s->from - t->from;
}

/* True for a source that ends where the lines end: the frame may cut it. */
static bool is_cut(const finder *f, const shape *s) {
    return s->x0 <= LINE_REACH + EDGE_PX || s->y0 <= LINE_REACH + EDGE_PX ||
           s->x1 >= f->width - 1 - LINE_REACH - EDGE_PX ||
           s->y1 >= f->height - 1 - LINE_REACH - EDGE_PX;
}

/* Lists the sources at several levels, by rank; returns their number. */
int bst_streak_finder_list_shapes(finder *f, shape out[BST_STREAK_SHAPES]) {
    const int pixels = f->width * f->height;
    int count = 0, number = 0, bright = 0;
    int *seeds = (int *)f->scratch; /* not in use */
    for (int i = 0; i < pixels; i++) {
        seeds[bright] = i;
        bright += f->lines[i] > SEED;
    }
    memset(f->label, 0, (size_t)pixels * sizeof *f->label);
    for (int l = LEVELS - 1; l >= 0; l--) {
        float level = GROW * (float)(1 << l), seed = l > 0 ? level : SEED;
        int first = number;
        for (int k = 0; k < bright; k++) {
            int i = seeds[k];
            if (f->lines[i] <= seed || f->label[i] > first) {
                continue;
            }
            shape found = bst_streak_finder_flood(f, level, i, ++number);
            bool any = found.x1 >= found.x0; /* pixels that its size is measured by */
            if (f->count >= LEAST_PIXELS && any) {
                count = add_shape(out, count, &found);
            }
        }
    }
    f->floods = number;
    for (int i = 0; i < count; i++) {
        int width = out[i].x1 - out[i].x0, height = out[i].y1 - out[i].y0, agreeing = 0;
        for (int k = 0; k < count; k++) {
            agreeing += k != i && agree(width, out[k].x1 - out[k].x0) &&
                        agree(height, out[k].y1 - out[k].y0) && !is_cut(f, &out[k]);
        }
        out[i].rank =
            is_cut(f, &out[i]) ? 0.0 : (agreeing + 0.5) * (hypot(width, height) + SHORT_PX);
    }
    qsort(out, (size_t)count, sizeof *out, by_rank);
    return count;
}

bool bst_streak_finder_is_cut(const bst_streak_finder *f, int index) {
    assert(f && index >= 0 && index < f->shape_count);
    return is_cut(f, &f->shapes[index]);
}
