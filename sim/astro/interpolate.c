#include "sim/astro/interpolate.h"

int64_t bst_interpolate_find(const bst_astro_table_state *rows, int64_t count, double t_s) {
    int64_t low = 0, high = count;
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (rows[middle].t_s <= t_s) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

void bst_interpolate(const bst_astro_table_state *rows, int64_t count, double t_s, int points,
                     bool hermite, bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    enum { MOST = BST_INTERPOLATE_MAX_ROWS };
    hermite = hermite || count == 1; /* a single row needs its velocity */
    int most = hermite ? MOST / 2 : MOST;
    points = points < 1 ? 1 : points > most ? most : points;
    int64_t n = points < count ? points : count;
    int64_t near = bst_interpolate_find(rows, count, t_s);
    /* the set of rows changes at a row, where the old and the new polynomial agree */
    int64_t first = near - (n - 1) / 2;
    first = first > count - n ? count - n : first;
    first = first < 0 ? 0 : first;
    /* for small rounding errors: times in units of the points' span, positions relative to a near
     * row, terms added from the nearest row outwards */
    const bst_astro_table_state *origin = &rows[near];
    double span = rows[first + n - 1].t_s - rows[first].t_s, unit = span > 0.0 ? span : 1.0;
    double z[MOST];
    bst_vec3 f[MOST];
    const bst_astro_table_state *node[MOST];
    int m = 0;
    for (int64_t step = 0; m < (hermite ? 2 * n : n); step++) {
        int64_t row = near + (step % 2 ? (step + 1) / 2 : -step / 2);
        for (int twice = 0; twice <= hermite && row >= first && row < first + n; twice++) {
            node[m] = &rows[row];
            z[m] = (rows[row].t_s - t_s) / unit;
            f[m++] = bst_vec3_sub(rows[row].position_m, origin->position_m);
        }
    }
    /* divided differences in place: f[i] becomes that of the last `order` + 1 nodes up to i */
    for (int order = 1; order < m; order++) {
        for (int i = m - 1; i >= order; i--) {
            f[i] = node[i] == node[i - order]
                       ? bst_vec3_scale(node[i]->velocity_mps, unit)
                       : bst_vec3_scale(bst_vec3_sub(f[i], f[i - 1]), 1.0 / (z[i] - z[i - order]));
        }
    }
    /* Horner's scheme at x = 0, with the derivative */
    bst_vec3 value = f[m - 1], slope = {0.0, 0.0, 0.0};
    for (int i = m - 2; i >= 0; i--) {
        slope = bst_vec3_axpy(value, -z[i], slope);
        value = bst_vec3_axpy(f[i], -z[i], value);
    }
    *position_m = bst_vec3_add(origin->position_m, value);
    *velocity_mps = bst_vec3_scale(slope, 1.0 / unit);
}
