#include "obsgen/streak/streak_light.h"

#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"

enum {
    LIGHT_ROWS = BST_STREAK_LIGHT_ROWS,
    LIGHT_WIDE = 2 * LIGHT_ROWS + 1,
    LANES = BST_STREAK_LANES,
    ROWS = BST_STREAK_ROWS,
    WIDE = BST_STREAK_WIDE,
    SPARSE = BST_STREAK_SPARSE,
    /* pixels of a band: it fits the cache while all runs are added */
    BAND_VALUES = 49152
};

/* ---- Runs ---- */

void bst_streak_light_begin(bst_streak_light *l, int width, int height, bool by_row) {
    l->width = width;
    l->height = height;
    l->by_row = by_row;
    l->run_count = 0;
    l->place_count = l->seen_count = 0;
}

void bst_streak_light_free(bst_streak_light *l) {
    free(l->places);
    free(l->runs);
    free(l->seen);
    free(l->band);
    *l = (bst_streak_light){0};
}

/* Grows an array. */
static bst_status grow(bst_ctx *ctx, void **items, size_t needed, size_t *room, size_t bytes) {
    if (needed <= *room) {
        return BST_OK;
    }
    size_t more = 2 * needed + 1024;
    void *moved = realloc(*items, more * bytes);
    if (!moved) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu places of streaks", more);
    }
    *items = moved;
    *room = more;
    return BST_OK;
}

bst_status bst_streak_light_run(bst_ctx *ctx, bst_streak_light *l, int source, bool by_row,
                                int step) {
    size_t room = (size_t)l->run_room;
    BST_TRY(grow(ctx, (void **)&l->runs, (size_t)l->run_count + 1, &room, sizeof *l->runs));
    l->run_room = (int)room;
    l->runs[l->run_count++] =
        (bst_streak_run){.source = source, .first = l->place_count, .step = step, .by_row = by_row};
    return BST_OK;
}

bst_status bst_streak_light_grow(bst_ctx *ctx, bst_streak_light *l) {
    return grow(ctx, (void **)&l->places, l->place_count + 1, &l->place_room, sizeof *l->places);
}

bst_status bst_streak_light_end(bst_ctx *ctx, bst_streak_light *l, double least_seen,
                                double least_lit, double least_dense) {
    bst_streak_run *run = &l->runs[l->run_count - 1];
    if (run->count == 0 || !((double)run->top > least_seen)) {
        l->place_count = run->first;
        l->run_count--;
        return BST_OK;
    }
    run->lit = (double)run->top >= least_lit;
    run->dense = (double)run->top >= least_dense;
    int count = run->dense ? run->count * WIDE : (run->count + SPARSE - 1) / SPARSE;
    run->seen = l->seen_count;
    l->seen_count += (size_t)count;
    return grow(ctx, (void **)&l->seen, l->seen_count, &l->seen_room, sizeof *l->seen);
}

/* ---- Bands ---- */

/* Lines of the frame from `first` on, crossed by most trails. A line holds the frame's pixels with
 * a margin on both sides. */
typedef struct band {
    float *values;
    int first, end, places; /* lines; pixels per line */
    ptrdiff_t stride;
} band;

enum { MARGIN = LANES };

/* Range of places of a run along the lines that lie on the band: from *from, before *to. */
static void on_band(const bst_streak_light *l, const bst_streak_run *run, const band *b, int *from,
                    int *to) {
    int at = l->places[run->first].at;
    int low = run->step > 0 ? b->first - at : at - (b->end - 1);
    int high = run->step > 0 ? b->end - at : at - b->first + 1;
    *from = low > 0 ? low : 0;
    *to = high < run->count ? high : run->count;
}

#define BST_SIMD_KERNELS "obsgen/streak/streak_light_kernels.inc"
#include "sim/core/simd_each.inc"

void bst_streak_light_of(const bst_streak_place *place, float light[LANES]) {
    BST_SIMD_PICK(light_of)(place, light);
}

/* Adds the light of a run that runs along the band's lines. */
static void add_parallel_run(const band *b, const bst_streak_place *places, int count) {
    for (int k = 0; k < count; k++) {
        const bst_streak_place *p = &places[k];
        if (p->at < 0 || p->at >= b->places || p->middle + LIGHT_ROWS < b->first ||
            p->middle - LIGHT_ROWS >= b->end) {
            continue;
        }
        float light[LANES];
        bst_streak_light_of(p, light);
        for (int r = 0; r < LIGHT_WIDE; r++) {
            int line = p->middle + r - LIGHT_ROWS;
            if (line >= b->first && line < b->end) {
                b->values[(line - b->first) * b->stride + p->at + MARGIN] += light[r];
            }
        }
    }
}

/* Reads the accumulated light at one place, as far as it is on the band. */
static void read_place(const band *b, bool across, const bst_streak_place *p, int rows,
                       float *out) {
    for (int r = -rows; r <= rows; r++) {
        int line = across ? p->at : p->middle + r, place = across ? p->middle + r : p->at;
        if (line >= b->first && line < b->end && place >= 0 && place < b->places) {
            float all = b->values[(line - b->first) * b->stride + place + MARGIN];
            /* light below `least_lit` is not accumulated: at least the place's own counts */
            out[r + rows] = all > out[r + rows] ? all : out[r + rows];
        }
    }
}

/* True if a band contains all rows of a place. */
static bool is_whole(const bst_streak_run *run, const band *b, int lines,
                     const bst_streak_place *p) {
    return run->lit && p->at >= 0 && p->at < lines && p->middle >= ROWS &&
           p->middle + ROWS < b->places;
}

/* Reads the light of a dense run that crosses the lines. */
static void read_crossing_run(const bst_streak_run *run, const band *b, int lines,
                              const bst_streak_place *places, int count, float *out) {
    for (int k = 0; k < count; k++, out += WIDE) {
        const bst_streak_place *p = &places[k];
        if (is_whole(run, b, lines, p)) {
            const float *all = b->values + (p->at - b->first) * b->stride + p->middle + MARGIN;
            memcpy(out, all - ROWS, WIDE * sizeof *out);
        } else {
            read_place(b, true, p, ROWS, out);
        }
    }
}

/* Reads the accumulated light at a run's places on a band. */
static void read_run(const bst_streak_light *l, const bst_streak_run *run, const band *b,
                     int lines) {
    bool across = run->by_row == l->by_row;
    int from = 0, to = run->count;
    if (across) {
        on_band(l, run, b, &from, &to);
    }
    const bst_streak_place *places = &l->places[run->first];
    float *out = l->seen + run->seen;
    if (across && run->dense) {
        read_crossing_run(run, b, lines, places + from, to - from, out + (ptrdiff_t)from * WIDE);
        return;
    }
    int every = run->dense ? 1 : SPARSE;
    for (int k = (from + every - 1) / every * every; k < to; k += every) {
        read_place(b, across, &places[k], run->dense ? ROWS : 0,
                   out + (run->dense ? k * WIDE : k / SPARSE));
    }
}

/* Own light of places where nothing was accumulated, unless the bands contain all rows. */
static void read_own_light(const bst_streak_light *l, const bst_streak_run *run, const band *b,
                           int lines) {
    const bst_streak_place *places = &l->places[run->first];
    bool across = run->by_row == l->by_row;
    float *out = l->seen + run->seen;
    if (run->dense) {
        for (int k = 0; k < run->count; k++) {
            if (!across || !is_whole(run, b, lines, &places[k])) {
                float light[LANES];
                bst_streak_light_of(&places[k], light);
                memcpy(out + (ptrdiff_t)k * WIDE, light + LIGHT_ROWS - ROWS, WIDE * sizeof *out);
            }
        }
    } else {
        for (int k = 0; k < run->count; k += SPARSE) {
            out[k / SPARSE] = places[k].height;
        }
    }
}

bst_status bst_streak_light_add_up(bst_ctx *ctx, bst_streak_light *l) {
    int lines = l->by_row ? l->height : l->width;
    band b = {.places = l->by_row ? l->width : l->height};
    b.stride = (b.places + 2 * MARGIN + LANES - 1) / LANES * LANES;
    int high = BAND_VALUES / (int)b.stride > 8 ? BAND_VALUES / (int)b.stride : 8;
    size_t room = (size_t)high * (size_t)b.stride;
    if (room > l->band_room) {
        free(l->band);
        l->band = bst_pages_alloc(room * sizeof *l->band);
        l->band_room = l->band ? room : 0;
        if (!l->band) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for long streaks");
        }
    }
    b.values = l->band;
    for (int i = 0; i < l->run_count; i++) {
        read_own_light(l, &l->runs[i], &b, lines);
    }
    for (b.first = 0; b.first < lines; b.first = b.end) {
        b.end = b.first + high < lines ? b.first + high : lines;
        memset(b.values, 0, (size_t)(b.end - b.first) * (size_t)b.stride * sizeof *b.values);
        for (int i = 0; i < l->run_count; i++) {
            const bst_streak_run *run = &l->runs[i];
            int from, to;
            if (run->lit && run->by_row == l->by_row) {
                on_band(l, run, &b, &from, &to);
                BST_SIMD_PICK(lay_run)(&b, &l->places[run->first + (size_t)from], to - from);
            } else if (run->lit) {
                add_parallel_run(&b, &l->places[run->first], run->count);
            }
        }
        for (int i = 0; i < l->run_count; i++) {
            read_run(l, &l->runs[i], &b, lines);
        }
    }
    return BST_OK;
}
