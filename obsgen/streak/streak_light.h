/* Light of long streaks on the pixels about them, as the filter for points shows it. Inside of the
 * generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_LIGHT_H
#define BST_OBSGEN_STREAK_STREAK_LIGHT_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

/* Rows on either side of the way that its light reaches, and those that are looked at. */
enum {
    BST_STREAK_LIGHT_ROWS = 4,
    BST_STREAK_LANES = 16, /* hold the rows of light */
    BST_STREAK_ROWS = 2,
    BST_STREAK_WIDE = 2 * BST_STREAK_ROWS + 1,
    BST_STREAK_SPARSE = 4 /* of so many places of a faint run one is looked at */
};

/* Where a way crosses a step of a pixel along it. */
typedef struct bst_streak_place {
    int at, middle;  /* px along, and the nearest pixel across */
    float height;    /* of the light on the way, SNR */
    float off, fall; /* way across from the middle, px; light falls as exp(-fall d^2) */
} bst_streak_place;

/* A part of a source's way that runs more along one axis, one way, with a place for each pixel. */
typedef struct bst_streak_run {
    int source;
    size_t first, seen; /* of the places; of the light that was seen */
    int count;
    float top;   /* greatest height */
    int step;    /* of the places' `at`: 1 or -1 */
    bool by_row; /* along is y */
    bool lit;    /* its light counts for others */
    bool dense;  /* seen are BST_STREAK_WIDE rows of each place; else each SPARSEth's middle */
} bst_streak_run;

/* Places and runs of a frame, what is seen at them, and a band of the frame's pixels. */
typedef struct bst_streak_light {
    int width, height; /* of the frame, px */
    bool by_row;       /* most ways run more along y */
    bst_streak_place *places;
    bst_streak_run *runs;
    float *seen;
    int run_count, run_room;
    size_t place_count, place_room, seen_count, seen_room;
    float *band; /* lines across most ways */
    size_t band_room;
} bst_streak_light;

/* Begins a frame. by_row: most ways run more along y. */
void bst_streak_light_begin(bst_streak_light *light, int width, int height, bool by_row);
/* Frees the memory of a work space and clears the struct, which belongs to the caller. */
void bst_streak_light_free(bst_streak_light *light);

/* Begins a run. */
bst_status bst_streak_light_run(bst_ctx *ctx, bst_streak_light *light, int source, bool by_row,
                                int step);

/* Makes room for more places. */
bst_status bst_streak_light_grow(bst_ctx *ctx, bst_streak_light *light);

/* Makes room for one. */
static inline bst_status bst_streak_light_room(bst_ctx *ctx, bst_streak_light *light) {
    return light->place_count == light->place_room ? bst_streak_light_grow(ctx, light) : BST_OK;
}

/* Takes the place that was written behind the last into the run that was begun last, or not. */
static inline void bst_streak_light_take(bst_streak_light *light, bool taken) {
    bst_streak_run *run = &light->runs[light->run_count - 1];
    float height = taken ? light->places[light->place_count].height : 0.0f;
    light->place_count += taken;
    run->count += taken;
    run->top = height > run->top ? height : run->top;
}

/* Adds a place to the run that was begun last. */
static inline bst_status bst_streak_light_place(bst_ctx *ctx, bst_streak_light *light,
                                                const bst_streak_place *place) {
    BST_TRY(bst_streak_light_room(ctx, light));
    light->places[light->place_count] = *place;
    bst_streak_light_take(light, true);
    return BST_OK;
}

/* Ends it. It is forgotten when its greatest height is no more than `least_seen`, its light counts
 * for others from `least_lit` on, and it is dense from `least_dense` on (SNR). */
bst_status bst_streak_light_end(bst_ctx *ctx, bst_streak_light *light, double least_seen,
                                double least_lit, double least_dense);

/* Adds up the light of all runs and notes what is seen of it at their places: beyond the frame,
 * and at least, the light of the place alone. */
bst_status bst_streak_light_add_up(bst_ctx *ctx, bst_streak_light *light);

/* Light of all at a place of a run; rows of a dense run from BST_STREAK_ROWS before its middle on.
 */
static inline const float *bst_streak_seen(const bst_streak_light *light, const bst_streak_run *run,
                                           int place) {
    int at = run->dense ? place * BST_STREAK_WIDE : place / BST_STREAK_SPARSE;
    return light->seen + run->seen + at;
}

/* Light of a place alone on the pixels from BST_STREAK_LIGHT_ROWS before its middle on. */
void bst_streak_light_of(const bst_streak_place *place, float light[BST_STREAK_LANES]);

#endif
