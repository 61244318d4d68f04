#include "sim/optics/streak_image.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

double bst_optics_image_squared(double along, double across, double length) {
    assert(along >= 0.0 && across >= 0.0 && length >= 0.0);
    const double root_pi = sqrt(BST_PI);
    double a = length / (2.0 * along);
    double line = a < 1e-3 ? 1.0 / (2.0 * root_pi * along) * (1.0 - a * a / 6.0)
                           : erf(a) / length -
                                 (2.0 * along / (length * length * root_pi)) * (1.0 - exp(-a * a));
    return line / (2.0 * root_pi * across);
}
