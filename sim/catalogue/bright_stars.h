/* Published V and B-V of the brightest stars, which take the place of Tycho-2's. Inside of
 * sim/world. */
#ifndef BST_CATALOGUE_BRIGHT_STARS_H
#define BST_CATALOGUE_BRIGHT_STARS_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/catalogue/star_index.h"

/* No star whose published V differs from Tycho-2's is fainter than this in Tycho-2. */
#define BST_BRIGHT_STARS_V 4.7

/* Published V and B-V of a star, by its Tycho-2 identity (bst_star_id_make). false: not in the
 * table; the outputs are untouched. */
bool bst_bright_star(uint32_t id, float *v_mag, float *b_minus_v);

/* The same written into a star's catalogue values, for an import: VT and BT - VT from which V and
 * B-V follow (bst_star_record_v; B-V = 0.850 (BT - VT)). */
void bst_bright_star_correct(bst_star_values *values);

#endif
