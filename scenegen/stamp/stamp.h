/* Stamp radius of nodes, and the light beyond it. */
#ifndef BST_SCENEGEN_STAMP_STAMP_H
#define BST_SCENEGEN_STAMP_STAMP_H

#include <stdbool.h>

#include "scenegen/stamp/fixed_point_px.h"

typedef struct bst_stamp {
    double tail[BST_PLACE_TAPS / 2]; /* profile at r px from the centre, relative to the centre */
    /* light within the two nearest pixels and r more on each side */
    double kept[BST_PLACE_TAPS / 2];
    /* the larger of the light beyond a stamp and the excess within it, relative to the peak */
    double missed[BST_PLACE_TAPS / 2 - 1];
} bst_stamp;

/* Sets the tables for a Gaussian; `whole`: for a PSF whose light is not truncated. */
void bst_stamp_init(bst_stamp *stamp, double sigma_px, bool whole);

/* Relative excess brightness of a source on a stamp of this radius, to which the light beyond is
 * added. */
double bst_stamp_excess(const bst_stamp *stamp, int radius);

/* Smallest stamp radius in pixels, 1 to `most`, for a source of peak_e electrons. The light outside
 * and the excess inside are at most limit_e electrons per pixel, unless `most` is reached. */
int bst_stamp_radius(const bst_stamp *stamp, double peak_e, double limit_e, int most);

#endif
