/* How far the stamps of nodes reach, and what that leaves out. */
#ifndef BST_SCENEGEN_STAMP_STAMP_H
#define BST_SCENEGEN_STAMP_STAMP_H

#include <stdbool.h>

#include "scenegen/stamp/fixed_point_px.h"

typedef struct bst_stamp {
    double tail[BST_PLACE_TAPS / 2]; /* profile at r px from the centre, over the centre's */
    double kept[BST_PLACE_TAPS / 2]; /* light within the two nearest pixels and r more each side */
} bst_stamp;

/* For a Gaussian; `whole`: for a PSF of which no light is left out. */
void bst_stamp_init(bst_stamp *stamp, double sigma_px, bool whole);

/* By how much of itself a source is brighter on a stamp of this radius, which takes the light
 * beyond. */
double bst_stamp_excess(const bst_stamp *stamp, int radius);

/* Rows beyond the two nearest pixels, at least 1 and at most `most`: what lies outside is under
 * limit_e per pixel for a source of peak_e, and so is what it adds inside. */
int bst_stamp_radius(const bst_stamp *stamp, double peak_e, double limit_e, int most);

#endif
