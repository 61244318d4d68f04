/* Light of long streaks on the pixels about their trails, in the point filter's output. Internal to
 * the generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_LIGHT_H
#define BST_OBSGEN_STREAK_STREAK_LIGHT_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

/* Rows on either side of the trail with light, and those that are searched. */
enum {
    BST_STREAK_LIGHT_ROWS = 4,
    BST_STREAK_LANES = 16, /* SIMD lanes for the rows of light */
    BST_STREAK_ROWS = 2,
    BST_STREAK_WIDE = 2 * BST_STREAK_ROWS + 1,
    BST_STREAK_SPARSE = 4 /* one of so many places of a faint run is evaluated */
};

/* Crossing of a trail with a pixel step along it. */
typedef struct bst_streak_place {
    int at, middle; /* px along; nearest pixel across */
    float height;   /* light on the trail, SNR */
    /* off: of the trail from the middle across, px; light falls as exp(-fall d^2) */
    float off, fall;
} bst_streak_place;

/* Part of a trail that runs mainly along one axis in one direction, with a place per pixel. */
typedef struct bst_streak_run {
    int source;
    size_t first, seen; /* first place; start of its light in `seen` */
    int count;
    float top;   /* largest height */
    int step;    /* of the places' `at`: 1 or -1 */
    bool by_row; /* the run is along y */
    bool lit;    /* its light affects others */
    /* all BST_STREAK_WIDE rows of each place are evaluated; else the middle of every
     * BST_STREAK_SPARSEth */
    bool dense;
} bst_streak_run;

/* Places and runs of a frame, the accumulated light at them, and a band of pixels. */
typedef struct bst_streak_light {
    int width, height; /* of the frame, px */
    bool by_row;       /* most trails run mainly along y */
    bst_streak_place *places;
    bst_streak_run *runs;
    float *seen;
    int run_count, run_room;
    size_t place_count, place_room, seen_count, seen_room;
    float *band; /* lines across most trails */
    size_t band_room;
} bst_streak_light;

/* Begins a frame.
 *
 * Given:     by_row  most trails run mainly along y */
void bst_streak_light_begin(bst_streak_light *light, int width, int height, bool by_row);
/* Frees the memory of a work space and clears the struct, which belongs to the caller. */
void bst_streak_light_free(bst_streak_light *light);

/* Begins a run of a source. */
bst_status bst_streak_light_run(bst_ctx *ctx, bst_streak_light *light, int source, bool by_row,
                                int step);

/* Allocates space for more places. */
bst_status bst_streak_light_grow(bst_ctx *ctx, bst_streak_light *light);

/* Ensures space for one more place. */
static inline bst_status bst_streak_light_room(bst_ctx *ctx, bst_streak_light *light) {
    return light->place_count == light->place_room ? bst_streak_light_grow(ctx, light) : BST_OK;
}

/* Accepts or rejects the place written after the last one of the current run. */
static inline void bst_streak_light_take(bst_streak_light *light, bool taken) {
    bst_streak_run *run = &light->runs[light->run_count - 1];
    float height = taken ? light->places[light->place_count].height : 0.0f;
    light->place_count += taken;
    run->count += taken;
    run->top = height > run->top ? height : run->top;
}

/* Appends a place to the current run. */
static inline bst_status bst_streak_light_place(bst_ctx *ctx, bst_streak_light *light,
                                                const bst_streak_place *place) {
    BST_TRY(bst_streak_light_room(ctx, light));
    light->places[light->place_count] = *place;
    bst_streak_light_take(light, true);
    return BST_OK;
}

/* Ends the current run. It is dropped if its largest height is at most `least_seen`; it affects
 * others from `least_lit` on, and is dense from `least_dense` on (SNR). */
bst_status bst_streak_light_end(bst_ctx *ctx, bst_streak_light *light, double least_seen,
                                double least_lit, double least_dense);

/* Accumulates the light of all runs and stores the total at their places. Outside the frame it is
 * the place's own light, which is also the lower limit. */
bst_status bst_streak_light_add_up(bst_ctx *ctx, bst_streak_light *light);

/* Total light at a place of a run; for a dense run the rows from BST_STREAK_ROWS before its middle
 * on. */
static inline const float *bst_streak_seen(const bst_streak_light *light, const bst_streak_run *run,
                                           int place) {
    int at = run->dense ? place * BST_STREAK_WIDE : place / BST_STREAK_SPARSE;
    return light->seen + run->seen + at;
}

/* Own light of a place on the pixels from BST_STREAK_LIGHT_ROWS before its middle on. */
void bst_streak_light_of(const bst_streak_place *place, float light[BST_STREAK_LANES]);

#endif
