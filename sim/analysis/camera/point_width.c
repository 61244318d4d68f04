#include "sim/analysis/camera/point_width.h"

#include <math.h>

#include "boresight/vec.h"
#include "sim/core/symmetric.h"

enum { SIDE = BST_POINT_WIDTH_SIDE, SIZE = 5, ITERATIONS = 60 };
enum { X, Y, SIGMA, LIGHT, LEVEL };

/* Share of a unit Gaussian of centre c within pixel i, and its derivatives. */
static double share(double i, double c, double sigma, double *by_centre, double *by_sigma) {
    const double high = (i + 0.5 - c) / sigma, low = (i - 0.5 - c) / sigma;
    const double gh = exp(-0.5 * high * high) / sqrt(2.0 * BST_PI),
                 gl = exp(-0.5 * low * low) / sqrt(2.0 * BST_PI);
    *by_centre = (gl - gh) / sigma;
    *by_sigma = (gl * low - gh * high) / sigma;
    return 0.5 * (erfc(low / sqrt(2.0)) - erfc(high / sqrt(2.0)));
}

/* Sum of squares of a model, and the normal equations of a step. */
static double evaluate(const double *pixels, const double p[SIZE], double a[SIZE][SIZE],
                       double b[SIZE]) {
    double sum = 0.0;
    for (int i = 0; i < SIZE; i++) {
        b[i] = 0.0;
        for (int k = 0; k < SIZE; k++) {
            a[i][k] = 0.0;
        }
    }
    for (int row = 0; row < SIDE; row++) {
        double y_c, y_s, y = share(row, p[Y], p[SIGMA], &y_c, &y_s);
        for (int column = 0; column < SIDE; column++) {
            double x_c, x_s, x = share(column, p[X], p[SIGMA], &x_c, &x_s);
            const double left = pixels[row * SIDE + column] - p[LEVEL] - p[LIGHT] * x * y;
            const double j[SIZE] = {p[LIGHT] * x_c * y, p[LIGHT] * x * y_c,
                                    p[LIGHT] * (x_s * y + x * y_s), x * y, 1.0};
            sum += left * left;
            for (int i = 0; i < SIZE; i++) {
                b[i] += j[i] * left;
                for (int k = 0; k < SIZE; k++) {
                    a[i][k] += j[i] * j[k];
                }
            }
        }
    }
    return sum;
}

/* Starts at the mean of the stamp's border and the light above it. */
static void start(const double *pixels, double x_px, double y_px, double p[SIZE]) {
    double border = 0.0, all = 0.0;
    for (int row = 0; row < SIDE; row++) {
        for (int column = 0; column < SIDE; column++) {
            const double v = pixels[row * SIDE + column];
            all += v;
            border += row == 0 || row == SIDE - 1 || column == 0 || column == SIDE - 1 ? v : 0.0;
        }
    }
    p[X] = x_px;
    p[Y] = y_px;
    p[SIGMA] = 1.0;
    p[LEVEL] = border / (4 * SIDE - 4);
    p[LIGHT] = all - SIDE * SIDE * p[LEVEL];
}

bool bst_point_width_fit(const double *pixels, double x_px, double y_px, double *fwhm_px) {
    double p[SIZE], a[SIZE][SIZE], b[SIZE], damping = 1e-3;
    start(pixels, x_px, y_px, p);
    double sum = evaluate(pixels, p, a, b);
    /* Levenberg and Marquardt */
    for (int k = 0; k < ITERATIONS; k++) {
        double inverse[SIZE][SIZE], trial[SIZE], most = 0.0;
        for (int i = 0; i < SIZE; i++) {
            a[i][i] *= 1.0 + damping;
        }
        if (!bst_symmetric_invert(SIZE, a[0], inverse[0])) {
            return false;
        }
        for (int i = 0; i < SIZE; i++) {
            double step = 0.0;
            for (int m = 0; m < SIZE; m++) {
                step += inverse[i][m] * b[m];
            }
            trial[i] = p[i] + step;
            most = i <= SIGMA ? fmax(most, fabs(step)) : most;
        }
        trial[SIGMA] = fmin(fmax(trial[SIGMA], 0.2), SIDE);
        double trial_a[SIZE][SIZE], trial_b[SIZE];
        const double trial_sum = evaluate(pixels, trial, trial_a, trial_b);
        if (trial_sum <= sum) {
            for (int i = 0; i < SIZE; i++) {
                p[i] = trial[i];
            }
            sum = trial_sum;
            damping = fmax(0.1 * damping, 1e-12);
        } else {
            damping *= 10.0;
        }
        (void)evaluate(pixels, p, a, b);
        if (most < 1e-6 || damping > 1e8) {
            break;
        }
    }
    *fwhm_px = p[SIGMA] * BST_FWHM_PER_SIGMA;
    const double off = hypot(p[X] - x_px, p[Y] - y_px);
    return p[LIGHT] > 0.0 && off < 2.0 && p[SIGMA] > 0.21 && p[SIGMA] < 0.25 * SIDE;
}
