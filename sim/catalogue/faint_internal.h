/* Cells of the statistical sky, shared by faint_sky.c and faint_stars.c only.
 *
 * 400 bands of declination, 0.45 degrees high, each cut into equal pieces about as wide: 204,000
 * cells of about 0.2 square degrees. Numbered by band from the south, then by right ascension. */
#ifndef BST_CATALOGUE_FAINT_INTERNAL_H
#define BST_CATALOGUE_FAINT_INTERNAL_H

#include <stdbool.h>

#include "boresight/rng.h"
#include "sim/catalogue/faint_stars.h"

enum {
    FAINT_BANDS = 400,
    FAINT_BINS = BST_FAINT_LIMIT_V - BST_COUNT_FIRST_V, /* of one magnitude, from V 6 */
    FAINT_QUARTERS = 4 * FAINT_BINS,
    FAINT_ZONE_BANDS = 18, /* equal in sin b */
    FAINT_ZONE_SECTORS = 24,
    FAINT_ZONES = FAINT_ZONE_BANDS * FAINT_ZONE_SECTORS,
};

typedef struct faint_patch {
    bst_vec3 centre;
    double radius_rad, cos_radius;
    double complete_to_v;
} faint_patch;

struct bst_faint_sky {
    bst_rng_key key;
    uint32_t first_cell[FAINT_BANDS + 1];
    uint32_t *first_id; /* [cells + 1]: a range of identities for each cell */
    double complete_to_v;
    faint_patch *patches;
    int patch_count;
    float (*kept)[FAINT_QUARTERS]; /* [FAINT_ZONES + patches]: fraction of statistical stars that
                                      are kept */
};

typedef struct faint_cell {
    double ra_rad, width_rad; /* western edge, extent */
    double sin_dec_min, sin_dec_max;
    bst_vec3 centre;
    double radius_rad; /* of a cap that contains it */
    double area_deg2;
} faint_cell;

/* Height of a band, rad. */
#define FAINT_BAND_RAD (BST_PI / FAINT_BANDS)

static inline uint32_t faint_cells(const bst_faint_sky *sky) {
    return sky->first_cell[FAINT_BANDS];
}

/* Geometry of a cell of the faint sky: limits, centre, radius and area.
 *
 * Given:     band  band of declination, 0 to FAINT_BANDS - 1
 *            cell  number of the cell, within the band's */
faint_cell bst_faint_cell(const bst_faint_sky *sky, int band, uint32_t cell);

/* Zone of a direction (ICRS). */
int bst_faint_zone(bst_vec3 icrs);

/* The first catalogue patch that contains a direction, -1: none, and the completeness limit
 * there. */
int bst_faint_patch(const bst_faint_sky *sky, bst_vec3 icrs, double *complete_to_v);

#endif
