#include "scenegen/smear/gaussian_flank.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

/* STEPS: places from the point outwards. FAR_SIGMAS: where the last class of light begins. */
enum { STEPS = 40, PLACES = 2 * STEPS + 1, MOST_ORDER = 6, ANGLES = 3 };
#define FAR_SIGMAS 5.5

/* Means over a pixel's side of a Gaussian of unit integral and its derivatives, by sigma. */
typedef struct axis_means {
    double at[PLACES][MOST_ORDER + 1];
} axis_means;

/* (-1)^n times the n-th derivative of exp(-u^2 / 2), n = 0 to 5. */
static void derivatives_of(double u, double value[MOST_ORDER]) {
    value[0] = exp(-0.5 * u * u);
    value[1] = u * value[0];
    for (int n = 1; n + 1 < MOST_ORDER; n++) {
        value[n + 1] = u * value[n] - n * value[n - 1];
    }
}

/* half: of the pixel's side; step: between places, both in sigma. */
static void find_means(double half, double step, axis_means *out) {
    for (int i = 0; i < PLACES; i++) {
        double at = (i - STEPS) * step, low[MOST_ORDER], high[MOST_ORDER];
        derivatives_of(at - half, low);
        derivatives_of(at + half, high);
        out->at[i][0] =
            sqrt(0.5 * BST_PI) * (erf((at + half) / sqrt(2.0)) - erf((at - half) / sqrt(2.0)));
        for (int n = 1; n <= MOST_ORDER; n++) {
            double sign = n % 2 == 1 ? 1.0 : -1.0;
            out->at[i][n] = sign * (high[n - 1] - low[n - 1]);
        }
    }
}

/* Derivative of an order along an angle, from those along the axes. */
static double derivative(const double x[], const double y[], int order, double c, double s) {
    double sum = 0.0, choose = 1.0;
    for (int k = 0; k <= order; k++) {
        sum += choose * pow(c, order - k) * pow(s, k) * x[order - k] * y[k];
        choose *= (double)(order - k) / (k + 1);
    }
    return sum;
}

/* Absolute derivative along an angle. both_ways: of order 2 also with that across subtracted, as of
 * a covariance that is too large along the angle and as much too small across: twice the mixed
 * derivative of axes at 45 degrees. */
static double greatest_of(const double x[], const double y[], int order, double c, double s,
                          bool both_ways) {
    double along = derivative(x, y, order, c, s);
    double across = both_ways && order == 2 ? derivative(x, y, 2, -s, c) : 0.0;
    return fmax(fabs(along), fabs(along - across));
}

void bst_gaussian_flank_measure(double sigma_px, int binning, double smoothed_px2,
                                bst_light_flank *out) {
    assert(sigma_px > 0.0 && binning >= 1 && smoothed_px2 >= 0.0 && out);
    static const int orders[] = {2, 3, 4, 6};
    double half = 0.5 * binning / sigma_px, step = (FAR_SIGMAS + half) / STEPS;
    double wide = sqrt(1.0 + smoothed_px2 / (sigma_px * sigma_px));
    int angles = smoothed_px2 > 0.0 ? 1 : ANGLES;
    axis_means image, light;
    find_means(half, step, &image);
    find_means(half / wide, step / wide, &light);
    *out = (bst_light_flank){.error = {0.0}};
    double peak = light.at[STEPS][0] * image.at[STEPS][0];
    for (int o = 0; o < (int)(sizeof orders / sizeof *orders); o++) {
        double top = 0.0;
        for (int i = 0; i < PLACES; i++) {
            top = fmax(top, fabs(image.at[i][orders[o]]) * image.at[STEPS][0]);
        }
        for (int a = 0; a < angles; a++) {
            double c = cos(a * BST_PI / 8.0), s = sin(a * BST_PI / 8.0);
            for (int k = 0; k < (STEPS + 1) * PLACES; k++) { /* a half plane: the other is alike */
                int i = STEPS + k / PLACES, j = a == 0 ? STEPS : k % PLACES;
                if (a == 0 && k % PLACES > 0) { /* along the rows most is in the row of the peak */
                    continue;
                }
                double e = greatest_of(image.at[i], image.at[j], orders[o], c, s, angles > 1);
                double share = light.at[i][0] * image.at[j][0] / peak;
                double error = e / top;
                bst_light_flank_raise(out, share, error, error / sqrt(fmax(share, 1e-12)));
            }
        }
    }
}
