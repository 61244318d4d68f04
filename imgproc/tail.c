#include "imgproc/tail.h"

#include <math.h>

#include "sim/core/vec.h"

double bst_tail_maxima(double u, double density) {
    return density * u * exp(-0.5 * u * u) / (2.0 * BST_PI * sqrt(2.0 * BST_PI));
}

static double upper_tail(double u) {
    return 0.5 * erfc(u / sqrt(2.0));
}

/* The integral over the density of X beyond u by the midpoint rule in the exponential variable that
 * the tail suggests. */
double bst_tail_both(double u, double v, double rho) {
    if (rho >= 1.0 - 1e-12) {
        return upper_tail(fmax(u, v)) / upper_tail(u);
    }
    enum { NODES = 48 };
    double root = sqrt(1.0 - rho * rho), sum = 0.0, total = 0.0, scale = 1.0 / (u + 1.0);
    for (int i = 0; i < NODES; i++) {
        double e = (i + 0.5) / NODES, z = u - scale * log(e);
        double density = exp(-0.5 * (z * z - u * u)) / e; /* phi(z) dz/de, up to a factor */
        sum += density * upper_tail((v - rho * z) / root);
        total += density;
    }
    return sum / total;
}

double bst_tail_quantile(double u, double skewness, double excess) {
    double square = u * u;
    return u + skewness * (square - 1.0) / 6.0 + excess * u * (square - 3.0) / 24.0 -
           skewness * skewness * u * (2.0 * square - 5.0) / 36.0;
}
