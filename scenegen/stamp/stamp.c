#include "scenegen/stamp/stamp.h"

#include <assert.h>
#include <math.h>

#include "scenegen/reference.h"

/* Mean light share, over sub-pixel phases, within a profile's two nearest pixels and r more on each
 * side. */
static double kept_light(double sigma_px, int r) {
    enum { PHASES = 16 };
    double sum = 0.0, scale = 1.0 / (sigma_px * sqrt(2.0));
    for (int k = 0; k < PHASES; k++) {
        double f = (k + 0.5) / PHASES;
        sum += 0.5 * (erf((r + 1.5 - f) * scale) + erf((r + 0.5 + f) * scale));
    }
    return sum / PHASES;
}

void bst_stamp_init(bst_stamp *stamp, double sigma_px, bool whole) {
    assert(stamp && sigma_px > 0.0);
    double centre = bst_reference_pixel_share(0.0, sigma_px, 0);
    for (int r = 0; r < BST_PLACE_TAPS / 2; r++) {
        stamp->tail[r] = whole ? 0.0 : bst_reference_pixel_share(0.0, sigma_px, r) / centre;
        stamp->kept[r] = whole ? 1.0 : kept_light(sigma_px, r);
    }
    for (int r = 0; r + 1 < BST_PLACE_TAPS / 2; r++) {
        stamp->missed[r] = fmax(stamp->tail[r + 1], bst_stamp_excess(stamp, r));
    }
}

double bst_stamp_excess(const bst_stamp *stamp, int radius) {
    return 1.0 / (stamp->kept[radius] * stamp->kept[radius]) - 1.0;
}

int bst_stamp_radius(const bst_stamp *stamp, double peak_e, double limit_e, int most) {
    int r = 1;
    while (r < most && peak_e * stamp->missed[r] > limit_e) {
        r++;
    }
    return r;
}
