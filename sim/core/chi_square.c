#include "sim/core/chi_square.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

static double normal_tail(double x) {
    return 0.5 * erfc(x / sqrt(2.0));
}

double bst_chi_square3_tail(double x, double d) {
    assert(x >= 0.0 && d >= 0.0);
    /* up to here the first order of the last term is right to 2e-9 */
    const double least = 1e-4, density = 1.0 / sqrt(2.0 * BST_PI);
    double r = sqrt(x), near = exp(-0.5 * (r - d) * (r - d)), far = exp(-0.5 * (r + d) * (r + d));
    return normal_tail(r - d) + normal_tail(r + d) +
           density * (d > least ? (near - far) / d : 2.0 * r * exp(-0.5 * (x + d * d)));
}

double bst_chi_square3_quantile(double tail) {
    assert(tail > 0.0 && tail <= 1.0);
    double low = 0.0, high = 1400.0;
    for (int step = 0; step < 60; step++) {
        double middle = 0.5 * (low + high);
        *(bst_chi_square3_tail(middle, 0.0) > tail ? &low : &high) = middle;
    }
    return low;
}
