/* Internal state of the sky background; shared by skylight.c, skylight_paint.c and
 * skylight_cells.c. */
#ifndef BST_WORLD_SCENE_SKYLIGHT_INTERNAL_H
#define BST_WORLD_SCENE_SKYLIGHT_INTERNAL_H

#include <stddef.h>

#include "sim/world/scene/skylight.h"

enum {
    BST_SKYLIGHT_MOST_STEP_PX = 32,
    BST_SKYLIGHT_LEVELS = 3, /* polynomials of degree 1, 2 and 4 */
    BST_SKYLIGHT_SIZES = 3,  /* squares of 32, 16 and 8 px */
    BST_SKYLIGHT_MOST_DEGREE = 4
};

/* Values at nodes of the sensor. */
typedef struct bst_skylight_lattice {
    int step, x0, y0, columns, rows;
    float *value;
    size_t capacity;
} bst_skylight_lattice;

/* State of computing the background map of one exposure. */
typedef struct bst_skylight_painter {
    const bst_skylight *b;
    const bst_scene_surroundings *around;
    bst_discs discs;
    bst_mat3 gcrf_from_cam;
    bst_vec3 sun;
    double sun_e, star_e; /* electrons per pixel and second of one star of V = 0 per steradian */
    double even_e;        /* uniform background per pixel and second, after vignetting */
    double earth_e;       /* the Earth's own emission, per pixel and second */
    double map_e; /* electrons of an exposure that 1 of the map of stray light is; 0: none */
} bst_skylight_painter;

/* Lagrange's polynomials of a square's equidistant nodes along one axis, at each of its pixels. */
typedef float bst_skylight_weights[BST_SKYLIGHT_LEVELS][BST_SKYLIGHT_SIZES]
                                  [BST_SKYLIGHT_MOST_DEGREE + 1][BST_SKYLIGHT_MOST_STEP_PX];

struct bst_skylight {
    const bst_world *world;
    const bst_camera *camera;
    int step;
    bst_skylight_lattice stars, sky, nodes, pixels;
    bst_skylight_map map;
    bool places_only;
    /* of the latest map, for places */
    bst_skylight_painter painter;
    bst_scene_surroundings around;
    bst_window window;
    bst_skylight_weights weights;
};

/* Sets the nodes around a rectangle of pixels, at least 3 per axis. BST_ERR_MEMORY. */
bst_status bst_skylight_set_nodes(bst_ctx *ctx, bst_skylight_lattice *l, int step,
                                  bst_window w) BST_MUST_CHECK;

/* Index of the cell that has a position, in steps from the first node; the first or last beyond. */
int bst_skylight_cell_of(float u, int nodes);

/* Bilinear interpolation between nodes. The step is a power of two: the weights are exact, and
 * overlapping maps agree to the bit. */
float bst_skylight_interpolate(const bst_skylight_lattice *l, float x, float y);

/* Total background at a pixel position, electrons per pixel of the exposure; sky_e from
 * paint_sky. *sides: of the terminators. */
double bst_skylight_paint_at(const bst_skylight_painter *p, double x, double y, double sky_e,
                             unsigned *sides);

/* Background at a pixel, with the interpolated sky, electrons of the exposure.
 *
 * Returned:  *sides  of the terminators, as in bst_disc_light */
double bst_skylight_paint(const bst_skylight_painter *p, int x, int y, unsigned *sides);

/* Distance of a position from the edge of the vignetting, px. */
double bst_skylight_vignetting_edge_px(const bst_camera *camera, double x, double y);

/* Computes the weights of polynomials. */
void bst_skylight_fill_weights(bst_skylight_weights *weights);

/* Fills b->pixels, set to a window, cell by cell of the lattice of b->step: by polynomials between
 * exact values where the light is smooth, else exactly. A pixel's value does not depend on the
 * window. The polynomials are within 1e-3 sigma of the photon noise of the light (of 1 e- at
 * least), or within 1e-6 of the light where that is more. */
void bst_skylight_fill_cells(const bst_skylight_painter *p, bst_skylight *b);

#endif
