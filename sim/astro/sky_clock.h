/* Earth rotation and body positions at any time, fast enough for a plant at 1 kHz. */
#ifndef BST_ASTRO_SKY_CLOCK_H
#define BST_ASTRO_SKY_CLOCK_H

#include "sim/astro/bodies.h"
#include "sim/astro/frames.h"

typedef struct bst_sky_rotation {
    bst_astro_earth_frames frames;
    bst_bodies bodies;
} bst_sky_rotation;

/* Interpolates between exact values on a fixed time grid (TAI). Constant memory. Results depend on
 * time only, not on the order of calls. One thread at a time. */
typedef struct bst_sky_clock bst_sky_clock;

/* Grid values shared by several clocks, which may run in different threads; each value is computed
 * once. Constant memory. eop is borrowed and must outlive it. */
typedef struct bst_sky_clock_grid bst_sky_clock_grid;

/* Creates a grid of values that several sky clocks share; its functions lock it.
 *
 * Given:     eop  Earth orientation; must outlive the grid
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_sky_clock_grid_create(bst_ctx *ctx, const bst_astro_eop *eop,
                                     bst_sky_clock_grid **out) BST_MUST_CHECK;
void bst_sky_clock_grid_free(bst_sky_clock_grid *grid); /* NULL allowed; after its clocks */

/* Creates a clock on a shared grid, which is borrowed and must outlive it. Free with
 * bst_sky_clock_free. */
bst_status bst_sky_clock_create_on(bst_ctx *ctx, bst_sky_clock_grid *grid,
                                   bst_sky_clock **out) BST_MUST_CHECK;

/* Creates a clock with its own grid; eop is borrowed and must outlive it. Free with
 * bst_sky_clock_free. */
bst_status bst_sky_clock_create(bst_ctx *ctx, const bst_astro_eop *eop,
                                bst_sky_clock **out) BST_MUST_CHECK;
void bst_sky_clock_free(bst_sky_clock *clock); /* NULL allowed */

/* Values at t. Against bst_astro_earth_frames_at and bst_bodies_at: rotations to 1 mm at a
 * geostationary distance, Sun, Moon and Earth to 15 m, the Earth's velocity to 1e-5 m/s. About 0.2
 * us; each new grid interval of 120 s needs one exact value (about 0.1 ms). Error: BST_ERR_RANGE
 * where bst_astro_eop_at has it, and in the last 120 s of the table. */
bst_status bst_sky_clock_at(bst_ctx *ctx, bst_sky_clock *clock, bst_time t,
                            bst_sky_rotation *out) BST_MUST_CHECK;

#endif
