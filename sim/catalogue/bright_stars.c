#include "sim/catalogue/bright_stars.h"

#include <math.h>

#include "sim/catalogue/bright_stars_table.inc"

bool bst_bright_star(uint32_t id, float *v_mag, float *b_minus_v) {
    int low = 0, high = (int)(sizeof bright_stars / sizeof *bright_stars) - 1;
    while (low <= high) {
        int middle = (low + high) / 2;
        if (bright_stars[middle].id == id) {
            *v_mag = bright_stars[middle].v_mag;
            *b_minus_v = bright_stars[middle].b_minus_v;
            return true;
        }
        if (bright_stars[middle].id < id) {
            low = middle + 1;
        } else {
            high = middle - 1;
        }
    }
    return false;
}

void bst_bright_star_correct(bst_star_values *values) {
    float v_mag, b_minus_v;
    if (!bst_bright_star(values->id, &v_mag, &b_minus_v)) {
        return;
    }
    double colour = (double)b_minus_v / 0.850;
    values->colour_mmag = (int)lround(1000.0 * colour);
    values->vt_mmag = (int)lround(1000.0 * ((double)v_mag + 0.090 * colour));
    values->has_colour = 1;
}
