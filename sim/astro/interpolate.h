/* Interpolation between tabulated orbit states. */
#ifndef BST_ASTRO_INTERPOLATE_H
#define BST_ASTRO_INTERPOLATE_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

/* A tabulated state, m and m/s in any axes, at `t_s` seconds after a reference time. */
typedef struct bst_astro_table_state {
    double t_s;
    bst_vec3 position_m, velocity_mps;
} bst_astro_table_state;

enum { BST_INTERPOLATE_MAX_ROWS = 32 };

/* Index of the last row with rows[].t_s <= t_s; 0 if none. Times increase; count >= 1. */
int64_t bst_interpolate_find(const bst_astro_table_state *rows, int64_t count, double t_s);

/* Interpolates with the polynomial through `points` rows around t_s (limited to 1 ..
 * BST_INTERPOLATE_MAX_ROWS, half of it with velocities, and count): through positions, and with
 * `hermite` or a single row also through velocities. Position and its derivative at t_s. The rows
 * reach equally far to both sides of the interval that holds t_s, shifted where the table ends.
 * Extrapolates outside the table. */
void bst_interpolate(const bst_astro_table_state *rows, int64_t count, double t_s, int points,
                     bool hermite, bst_vec3 *position_m, bst_vec3 *velocity_mps);

#endif
