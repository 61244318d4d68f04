/* Published V and B-V of the brightest stars, which replace those of Tycho-2. Internal to
 * sim/catalogue. */
#ifndef BST_CATALOGUE_BRIGHT_STARS_H
#define BST_CATALOGUE_BRIGHT_STARS_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/catalogue/star_index.h"

/* Tycho-2 magnitude above which no star has a replaced V. */
#define BST_BRIGHT_STARS_V 4.7

/* Published V and B-V of a star by its Tycho-2 identity (bst_star_id_make). False: not in the
 * table; the outputs are unchanged. */
bool bst_bright_star(uint32_t id, float *v_mag, float *b_minus_v);

/* Replaces the catalogue values of a bright star for an import: VT and BT - VT that give the
 * published V and B-V (bst_star_record_v; B-V = 0.850 (BT - VT)). */
void bst_bright_star_correct(bst_star_values *values);

#endif
