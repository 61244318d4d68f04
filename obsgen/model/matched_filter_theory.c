#include "obsgen/model/matched_filter_theory.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#include "boresight/vec.h"

static const double ROOT_2PI = 2.5066282746310002;

static double density(double z) {
    return exp(-0.5 * z * z) / ROOT_2PI;
}
static double above(double z) {
    return 0.5 * erfc(z * 0.70710678118654752);
}

/* Second antiderivative of a normal density of standard deviation s. */
static double ramp(double z, double s) {
    return z * bst_matched_normal_below(z / s) + s * density(z / s);
}

/* Autocorrelation of a blurred segment along its direction, times s. */
static double along_itself(double d, double length, double s) {
    if (length < 0.05 * s) {
        return density(d / s);
    }
    return s * (ramp(d + length, s) - 2.0 * ramp(d, s) + ramp(d - length, s)) / (length * length);
}

double bst_matched_product(bst_obsgen_path_px p, bst_obsgen_path_px q, double sigma_px) {
    double lp = hypot(p.dx, p.dy), lq = hypot(q.dx, q.dy), s = sigma_px * sqrt(2.0);
    if (lp > lq) {
        bst_obsgen_path_px swapped = p;
        p = q;
        q = swapped;
        double length = lp;
        lp = lq;
        lq = length;
    }
    /* L^2 / 12 < 3e-5 s^2: a point to 2e-5 */
    if (lq < 0.02 * s) {
        return 1.0 / (2.0 * BST_PI * s * s);
    }
    if (p.dx == q.dx && p.dy == q.dy) {
        return density(0.0) * along_itself(0.0, lq, s) / (s * s);
    }
    double cx = q.dx / lq, cy = q.dy / lq;
    /* midpoints h = sigma / 2 apart: the ends err by h^2 / 24 of the slope, 0.3 % of the level */
    int parts = lp < 0.02 * s ? 1 : (int)ceil(2.0 * lp / sigma_px);
    double sum = 0.0;
    for (int i = 0; i < parts; i++) {
        double u = (i + 0.5) / parts - 0.5;
        double along = u * (p.dx * cx + p.dy * cy), across = u * (p.dy * cx - p.dx * cy);
        sum += density(across / s) * (bst_matched_normal_below((along + 0.5 * lq) / s) -
                                      bst_matched_normal_below((along - 0.5 * lq) / s));
    }
    return sum / (parts * s * lq);
}

double bst_matched_efficiency(bst_obsgen_path_px source, bst_obsgen_path_px filter,
                              double sigma_px) {
    double both = bst_matched_product(source, source, sigma_px) *
                  bst_matched_product(filter, filter, sigma_px);
    return fmin(bst_matched_product(source, filter, sigma_px) / sqrt(both), 1.0);
}

double bst_matched_falloff(double along_px, double across_px, double length_px, double sigma_px) {
    double s = sigma_px * sqrt(2.0);
    double across = exp(-0.5 * across_px * across_px / (s * s));
    if (across < 1e-9) {
        return 0.0;
    }
    if (length_px < 0.05 * s) {
        return across * exp(-0.5 * along_px * along_px / (s * s));
    }
    return across * fmax(along_itself(along_px, length_px, s), 0.0) /
           along_itself(0.0, length_px, s);
}

/* P(next > u | this > u) of two normal variables with correlation rho. */
static double stays_above(double u, double rho) {
    enum { NODES = 48 };
    double root = sqrt(fmax(1.0 - rho * rho, 1e-12)), sum = 0.0, total = 0.0;
    for (int i = 0; i < NODES; i++) {
        /* exponential substitution: the tail falls as exp(-u z) */
        double e = (i + 0.5) / NODES, z = u - log(e) / (u + 1.0);
        double weight = exp(-0.5 * (z * z - u * u)) / e;
        sum += weight * above((u - rho * z) / root);
        total += weight;
    }
    return sum / total;
}

/* Density of maxima above u per pixel of a field of unit variance; roughness: sqrt of the
 * determinant of its gradient's covariance. */
static double maxima(double u, double roughness) {
    return roughness * u * exp(-0.5 * u * u) / (2.0 * BST_PI * ROOT_2PI);
}

double bst_matched_threshold(double sigma_px, double length_px, double false_alarms, double pixels,
                             double *streak_share) {
    assert(sigma_px > 0.0 && length_px >= 0.0 && false_alarms > 0.0 && pixels > 0.0);
    double s = sigma_px * sqrt(2.0), steep = 1.0 / (s * s), drawn = 0.0, shared = 1.0;
    if (length_px > 0.0) {
        double curve = length_px < 0.05 * s ? steep * along_itself(0.0, 0.0, s) / s
                                            : 2.0 * (density(0.0) - density(length_px / s)) /
                                                  (s * length_px * length_px);
        drawn = sqrt(steep * curve * s / along_itself(0.0, length_px, s));
        shared = bst_matched_efficiency((bst_obsgen_path_px){length_px, 0.0},
                                        (bst_obsgen_path_px){0.0, 0.0}, sigma_px);
    }
    double low = 2.5, high = 9.0, point = 0.0, streak = 0.0;
    for (int i = 0; i < 24; i++) {
        double u = 0.5 * (low + high);
        point = maxima(u, steep);
        streak = length_px > 0.0 ? maxima(u, drawn) * (1.0 - stays_above(u, fmin(shared, 0.999999)))
                                 : 0.0;
        *((point + streak) * pixels > false_alarms ? &low : &high) = u;
    }
    if (streak_share) {
        *streak_share = streak / (point + streak);
    }
    return 0.5 * (low + high);
}

double bst_matched_pixel_maxima(double sigma_px, double threshold) {
    double lag = bst_matched_falloff(1.0, 0.0, 0.0, sigma_px);
    double stays = stays_above(threshold, lag);
    return above(threshold) * (1.0 - stays) * (1.0 - stays);
}

double bst_matched_either_above(double first, double second, double correlation) {
    enum { HALF = 4 };
    static const double node[HALF] = {0.183434642495650, 0.525532409916329, 0.796666477413627,
                                      0.960289856497536};
    static const double weight[HALF] = {0.362683783378362, 0.313706645877887, 0.222381034453374,
                                        0.101228536290376};
    static const double ALL = 4.0; /* sigmas beyond which nothing is left */
    double root = sqrt(fmax(1.0 - correlation * correlation, 1e-8));
    /* t: how far the first variable is below its threshold */
    double start = fmax(-first - ALL, 0.0), end = ALL + fmax(-first, 0.0), sum = 0.0;
    double lead = second - correlation * first;
    if (correlation > 0.0) {
        end = fmin(end, (lead + ALL * root) / correlation);
    }
    for (int i = 0; i < 2 * HALF && end > start; i++) {
        double at = i % 2 ? node[i / 2] : -node[i / 2];
        double t = start + 0.5 * (end - start) * (1.0 + at);
        sum += 0.5 * (end - start) * weight[i / 2] * density(first + t) *
               bst_matched_normal_below((lead - correlation * t) / root);
    }
    return bst_matched_normal_below(first) + sum;
}
