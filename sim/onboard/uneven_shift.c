/* Displacement that all images of one path share because the camera's motion departs from what is
 * known of it: for paths that are not uniform. */
#include <assert.h>
#include <math.h>

#include "boresight/camera_motion.h"

enum { KNOTS = BST_CAMERA_MOTION_KNOTS };

/* Least RMS of bend and departure, in sigmas of the PSF, that matters to points, whose places err
 * by its third power over the square of the PSF's sigma: by a hundredth of a sigma. */
static const double LEAST_UNEVEN = 0.2;
/* Displacement of all images of a path by telemetry that is drawn as it is, in its bend: knots,
 * samples of the telemetry and what the bent path makes of an error of its length. */
static const double PATH_LEFT = 0.005;
/* The same in each source of itself: its own motion need not be uniform, and its fit has a weight
 * of its own along the path. */
static const double OWN_LEFT = 0.01;

typedef struct matrix {
    double xx, xy, yx, yy;
} matrix;

static matrix product(matrix a, matrix b) {
    return (matrix){a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy, a.yx * b.xx + a.yy * b.yx,
                    a.yx * b.xy + a.yy * b.yy};
}

static matrix sum(matrix a, double share, matrix b) {
    return (matrix){a.xx + share * b.xx, a.xy + share * b.xy, a.yx + share * b.yx,
                    a.yy + share * b.yy};
}

/* a b a^T for a symmetric b */
static matrix spread(matrix a, matrix b) {
    return product(product(a, b), (matrix){a.xx, a.yx, a.xy, a.yy});
}

static matrix diagonal(double v) {
    return (matrix){v, 0.0, 0.0, v};
}

/* Weight of Simpson's rule at a knot; all together 1. */
static double simpson(int k) {
    const int last = KNOTS - 1;
    return (k == 0 || k == last ? 1.0 : k % 2 ? 4.0 : 2.0) / (3.0 * last);
}

/* Weight of a displacement at each knot of the path in the place that a fit finds; mean: unity. */
static void weigh(const double path[KNOTS][2], double sigma_px, matrix out[KNOTS]) {
    const double variance = 2.0 * sigma_px * sigma_px; /* of the overlap of two images */
    matrix all = diagonal(0.0);
    for (int i = 0; i < KNOTS; i++) {
        out[i] = diagonal(0.0);
        for (int k = 0; k < KNOTS; k++) {
            const double x = path[i][0] - path[k][0], y = path[i][1] - path[k][1];
            const double overlap = simpson(k) * exp(-0.5 * (x * x + y * y) / variance);
            const double cross = -x * y / variance;
            out[i] = sum(out[i], overlap,
                         (matrix){1.0 - x * x / variance, cross, cross, 1.0 - y * y / variance});
        }
        all = sum(all, simpson(i), out[i]);
    }
    const double f = 1.0 / (all.xx * all.yy - all.xy * all.yx);
    const matrix inverse = {all.yy * f, -all.xy * f, -all.yx * f, all.xx * f};
    for (int i = 0; i < KNOTS; i++) {
        out[i] = product(inverse, out[i]);
    }
}

bool bst_camera_motion_is_uneven(const bst_camera_motion *motion, const bst_camera *camera,
                                 double sigma_px) {
    double x, y;
    bst_camera_motion_bend(motion, camera, &x, &y);
    double square = (x * x + y * y) / 5.0;
    for (int k = 0; k < KNOTS; k++) {
        bst_camera_motion_departure(motion, camera, k, &x, &y);
        square += simpson(k) * (x * x + y * y);
    }
    return square > LEAST_UNEVEN * LEAST_UNEVEN * sigma_px * sigma_px;
}

void bst_camera_motion_path(const bst_camera_motion *motion, const bst_camera *camera,
                            double path[KNOTS][2]) {
    double dx, dy, bend_x, bend_y;
    bst_camera_motion_streak(motion, camera, bst_camera_centre_x(camera),
                             bst_camera_centre_y(camera), &dx, &dy);
    bst_camera_motion_bend(motion, camera, &bend_x, &bend_y);
    for (int k = 0; k < KNOTS; k++) {
        const double u = 2.0 * k / (KNOTS - 1) - 1.0, bow = 1.5 * u * u - 0.5;
        bst_camera_motion_departure(motion, camera, k, &path[k][0], &path[k][1]);
        path[k][0] += 0.5 * u * dx + bow * bend_x;
        path[k][1] += 0.5 * u * dy + bow * bend_y;
    }
}

void bst_camera_motion_widen_drawn(double bend_x_px, double bend_y_px, bst_detection *d) {
    d->cov_xx += OWN_LEFT * OWN_LEFT * bend_x_px * bend_x_px;
    d->cov_xy += OWN_LEFT * OWN_LEFT * bend_x_px * bend_y_px;
    d->cov_yy += OWN_LEFT * OWN_LEFT * bend_y_px * bend_y_px;
}

void bst_camera_motion_uneven_shift(const double path[KNOTS][2], double sigma_px,
                                    const bst_camera_motion_unknown *unknown, double shared[3]) {
    assert(path && sigma_px > 0.0 && unknown && shared);
    matrix weight[KNOTS], first = diagonal(0.0), second = diagonal(0.0), square = diagonal(-1.0);
    weigh(path, sigma_px, weight);
    for (int i = 0; i < KNOTS; i++) {
        const double u = 2.0 * i / (KNOTS - 1) - 1.0;
        first = sum(first, simpson(i) * u, weight[i]);
        second = sum(second, simpson(i) * (1.5 * u * u - 0.5), weight[i]);
        square = sum(square, simpson(i), spread(weight[i], diagonal(1.0)));
    }
    /* Legendre coefficients of degree n have variances in proportion to 2 n + 1 */
    const double bend2 = unknown->bend_px * unknown->bend_px;
    square = sum(square, -3.0, spread(first, diagonal(1.0)));
    square = sum(square, -5.0, spread(second, diagonal(1.0)));
    matrix total = sum(diagonal(0.0), 0.2 * bend2, square);
    if (unknown->covariance) {
        const double ex = unknown->ex, ey = unknown->ey;
        const double by[3][2] = {
            {0.5 * (first.xx * ex + first.xy * ey), 0.5 * (first.yx * ex + first.yy * ey)},
            {0.5 * (first.xy * ex - first.xx * ey), 0.5 * (first.yy * ex - first.yx * ey)},
            {second.xx * ex + second.xy * ey, second.yx * ex + second.yy * ey}};
        for (int k = 0; k < 9; k++) {
            const double c = unknown->covariance[k / 3][k % 3], *a = by[k / 3], *b = by[k % 3];
            total = sum(total, c, (matrix){a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]});
        }
        /* the bend across the path is not measured */
        total = sum(total, bend2, spread(second, (matrix){ey * ey, -ex * ey, -ex * ey, ex * ex}));
    } else {
        const double half = 0.5 * unknown->drift_px;
        total = sum(total, half * half, spread(first, diagonal(1.0)));
        total = sum(total, bend2, spread(second, diagonal(1.0)));
    }
    double bend[2] = {0.0, 0.0};
    for (int i = 0; i < KNOTS; i++) {
        const double u = 2.0 * i / (KNOTS - 1) - 1.0, part = 5.0 * simpson(i) * (1.5 * u * u - 0.5);
        bend[0] += PATH_LEFT * part * path[i][0];
        bend[1] += PATH_LEFT * part * path[i][1];
    }
    total =
        sum(total, 1.0,
            (matrix){bend[0] * bend[0], bend[0] * bend[1], bend[0] * bend[1], bend[1] * bend[1]});
    shared[0] = fmax(total.xx, 0.0);
    shared[2] = fmax(total.yy, 0.0);
    const double most = sqrt(shared[0] * shared[2]);
    shared[1] = fmax(-most, fmin(0.5 * (total.xy + total.yx), most));
}

void bst_camera_motion_set_uneven_shift(const bst_camera_motion *motion, const bst_camera *camera,
                                        double sigma_px, const bst_camera_motion_unknown *unknown,
                                        bst_detections *detections) {
    double path[KNOTS][2], shared[3];
    bst_camera_motion_path(motion, camera, path);
    bst_camera_motion_uneven_shift(path, sigma_px, unknown, shared);
    detections->shared_xx = shared[0];
    detections->shared_xy = shared[1];
    detections->shared_yy = shared[2];
}
