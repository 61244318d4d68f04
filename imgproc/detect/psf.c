#include "imgproc/detect/psf.h"

#include <assert.h>
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>

#include "boresight/vec.h"

/* Gauss-Legendre rule of n nodes, stored from index n (n - 1) / 2. The roots of the Legendre
 * polynomial are found by Newton's method from the asymptotic estimate (Abramowitz and Stegun
 * 25.4.29 and 22.16.6). */
static void legendre_rule(int n, double *node, double *weight) {
    for (int i = 0; i < n; i++) {
        double x = cos(BST_PI * (i + 0.75) / (n + 0.5)), slope = 1.0;
        for (int iteration = 0; iteration < 20; iteration++) {
            double p0 = 1.0, p1 = x;
            for (int k = 2; k <= n; k++) {
                double p2 = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
                p0 = p1;
                p1 = p2;
            }
            slope = n * (x * p1 - p0) / (x * x - 1.0);
            double step = p1 / slope;
            x -= step;
            if (fabs(step) < 1e-15) {
                break;
            }
        }
        node[i] = -0.5 * x;
        weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
}

static bst_imgproc_gauss tables; /* constant once fill_tables has run */

static void fill_tables(void) {
    bst_imgproc_gauss *psf = &tables;
    for (int i = 0; i < BST_PSF_TABLE_SIZE; i++) {
        double t = (double)i / BST_PSF_TABLE_PER_SIGMA - BST_PSF_REACH_SIGMA;
        psf->cdf[i] = 0.5 * erfc(-t / sqrt(2.0));
        psf->pdf[i] = exp(-0.5 * t * t) / sqrt(2.0 * BST_PI);
    }
    for (int n = 1; n <= BST_PSF_MAX_NODES; n++) {
        legendre_rule(n, psf->node + n * (n - 1) / 2, psf->weight + n * (n - 1) / 2);
    }
}

void bst_imgproc_gauss_init(bst_imgproc_gauss *psf) {
    static pthread_once_t filled = PTHREAD_ONCE_INIT; /* they take 5 ms of a new simulation */
    pthread_once(&filled, fill_tables);
    *psf = tables;
}

typedef struct profile {
    int first, count;
    double share[BST_PSF_MAX_SIDE], slope[BST_PSF_MAX_SIDE], curvature[BST_PSF_MAX_SIDE];
} profile;

/* Normal distribution and density at t (in sigma) by cubic Hermite interpolation. */
static void normal_at(const bst_imgproc_gauss *psf, double t, double *cdf, double *pdf) {
    double u = (t + BST_PSF_REACH_SIGMA) * BST_PSF_TABLE_PER_SIGMA;
    if (!(u > 0.0)) {
        *cdf = *pdf = 0.0;
        return;
    }
    if (u >= BST_PSF_TABLE_SIZE - 1) {
        *cdf = 1.0;
        *pdf = 0.0;
        return;
    }
    int i = (int)u;
    double s = u - i, h = 1.0 / BST_PSF_TABLE_PER_SIGMA;
    double t0 = i * h - BST_PSF_REACH_SIGMA, t1 = t0 + h;
    double b = s * s * (3.0 - 2.0 * s), c = s * (1.0 - s) * (1.0 - s) * h,
           d = -s * s * (1.0 - s) * h;
    double g0 = psf->pdf[i], g1 = psf->pdf[i + 1];
    *cdf = psf->cdf[i] + b * (psf->cdf[i + 1] - psf->cdf[i]) + c * g0 + d * g1;
    *pdf = g0 + b * (g1 - g0) - c * t0 * g0 - d * t1 * g1;
}

/* One-dimensional pixel-integrated Gaussian about `centre` on pixels 0 to side - 1, with first and
 * second derivative by the centre; only pixels within reach are set. */
static void make_profile(const bst_imgproc_gauss *psf, double centre, double sigma, int side,
                         profile *out) {
    double reach = BST_PSF_REACH_SIGMA * sigma;
    double lo = floor(centre - reach + 0.5), hi = floor(centre + reach + 0.5);
    int first = lo < 0.0 ? 0 : lo > side ? side : (int)lo;
    int last = hi < 0.0 ? -1 : hi > side - 1 ? side - 1 : (int)hi;
    out->first = first;
    out->count = last >= first ? last - first + 1 : 0;
    double inverse = 1.0 / sigma, c0, g0, d0;
    double t = (first - 0.5 - centre) * inverse;
    normal_at(psf, t, &c0, &g0);
    d0 = t * g0;
    for (int i = 0; i < out->count; i++) {
        double c1, g1, d1;
        t = (first + i + 0.5 - centre) * inverse;
        normal_at(psf, t, &c1, &g1);
        d1 = t * g1;
        out->share[i] = c1 - c0;
        out->slope[i] = (g0 - g1) * inverse;
        out->curvature[i] = (d0 - d1) * inverse * inverse;
        c0 = c1;
        g0 = g1;
        d0 = d1;
    }
}

double bst_imgproc_shape_speed(const bst_imgproc_shape *s) {
    double speed = hypot(s->dx_px, s->dy_px) + 6.0 * hypot(s->bend_x_px, s->bend_y_px);
    return s->departure ? speed + s->departure->speed_px : speed;
}

void bst_imgproc_shape_reach(const bst_imgproc_shape *s, double *x_px, double *y_px) {
    *x_px = 0.5 * fabs(s->dx_px) + fabs(s->bend_x_px);
    *y_px = 0.5 * fabs(s->dy_px) + fabs(s->bend_y_px);
    if (s->departure) {
        *x_px += s->departure->reach_px[0];
        *y_px += s->departure->reach_px[1];
    }
}

void bst_path_departure_finish(bst_path_departure *d) {
    const int last = BST_PATH_KNOTS - 1;
    d->speed_px = d->reach_px[0] = d->reach_px[1] = 0.0;
    d->variance[0] = d->variance[1] = d->variance[2] = 0.0;
    for (int k = 0; k <= last; k++) {
        const double x = d->x_px[k], y = d->y_px[k], weight = k % last ? 1.0 : 0.5;
        d->reach_px[0] = fmax(d->reach_px[0], fabs(x));
        d->reach_px[1] = fmax(d->reach_px[1], fabs(y));
        d->variance[0] += weight * x * x / last;
        d->variance[1] += weight * x * y / last;
        d->variance[2] += weight * y * y / last;
        if (k > 0) {
            const double step = hypot(x - d->x_px[k - 1], y - d->y_px[k - 1]);
            d->speed_px = fmax(d->speed_px, last * step);
        }
    }
}

/* Number of quadrature nodes along a streak, from its length in sigma. */
static int node_count(const bst_imgproc_shape *shape) {
    /* path length at the largest speed, which occurs at an end */
    double length = bst_imgproc_shape_speed(shape) / shape->sigma_px;
    /* Gauss-Legendre on a uniform path: error below 1e-5 of the peak up to 60 sigma, 2e-8 at 5
     * sigma */
    return length < 1e-3 ? 1 : (int)fmin(5.0 + 1.15 * length, BST_PSF_MAX_NODES);
}

void bst_imgproc_gauss_profile(const bst_imgproc_gauss *psf, double centre, double sigma, int side,
                               double *share, double *slope, double *curvature) {
    assert(psf && share && side > 0 && sigma > 0.0);
    profile p;
    make_profile(psf, centre, sigma, side, &p);
    for (int i = 0; i < side; i++) {
        bool in = i >= p.first && i < p.first + p.count;
        share[i] = in ? p.share[i - p.first] : 0.0;
        slope[i] = in ? p.slope[i - p.first] : 0.0;
        curvature[i] = in ? p.curvature[i - p.first] : 0.0;
    }
}

void bst_imgproc_gauss_render(const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                              const bst_imgproc_stamp *stamp, double *share, double *by_x,
                              double *by_y, double *by_variance) {
    size_t bytes = (size_t)stamp->width * (size_t)stamp->height * sizeof(double);
    memset(share, 0, bytes);
    memset(by_x, 0, bytes);
    memset(by_y, 0, bytes);
    memset(by_variance, 0, bytes);
    int nodes = node_count(shape);
    const double *node = psf->node + nodes * (nodes - 1) / 2;
    const double *weight = psf->weight + nodes * (nodes - 1) / 2;
    profile px, py;
    for (int k = 0; k < nodes; k++) {
        double x, y, bow;
        bst_imgproc_shape_at(shape, node[k], &x, &y, &bow);
        make_profile(psf, x - stamp->x0, shape->sigma_px, stamp->width, &px);
        make_profile(psf, y - stamp->y0, shape->sigma_px, stamp->height, &py);
        for (int j = 0; j < py.count; j++) {
            double p = weight[k] * py.share[j], d = weight[k] * py.slope[j];
            double half_p = 0.5 * p, half_c = 0.5 * weight[k] * py.curvature[j];
            size_t row = (size_t)(py.first + j) * (size_t)stamp->width + (size_t)px.first;
            double *s = share + row, *sx = by_x + row, *sy = by_y + row, *sv = by_variance + row;
            for (int i = 0; i < px.count; i++) {
                s[i] += p * px.share[i];
                sx[i] += p * px.slope[i];
                sy[i] += d * px.share[i];
                sv[i] += half_p * px.curvature[i] + half_c * px.share[i];
            }
        }
    }
}

void bst_imgproc_shape_path_variance(const bst_imgproc_shape *s, double out[3]) {
    out[0] = s->dx_px * s->dx_px / 12.0 + s->bend_x_px * s->bend_x_px / 5.0;
    out[1] = s->dx_px * s->dy_px / 12.0 + s->bend_x_px * s->bend_y_px / 5.0;
    out[2] = s->dy_px * s->dy_px / 12.0 + s->bend_y_px * s->bend_y_px / 5.0;
    for (int k = 0; k < 3 && s->departure; k++) {
        out[k] += s->departure->variance[k];
    }
}
