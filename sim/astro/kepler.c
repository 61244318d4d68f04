#include "sim/astro/kepler.h"

#include <assert.h>
#include <stdbool.h>

/* Stumpff functions c2 and c3; series where the closed forms lose precision. */
static void stumpff(double z, double *c2, double *c3) {
    if (fabs(z) < 0.1) {
        double t2 = 0.5, t3 = 1.0 / 6.0;
        *c2 = 0.0;
        *c3 = 0.0;
        for (int k = 1; k < 10; k++) {
            *c2 += t2;
            *c3 += t3;
            t2 *= -z / ((2.0 * k + 1.0) * (2.0 * k + 2.0));
            t3 *= -z / ((2.0 * k + 2.0) * (2.0 * k + 3.0));
        }
    } else if (z > 0.0) {
        double s = sqrt(z);
        *c2 = (1.0 - cos(s)) / z;
        *c3 = (s - sin(s)) / (s * z);
    } else {
        double s = sqrt(-z);
        *c2 = (cosh(s) - 1.0) / -z;
        *c3 = (sinh(s) - s) / (s * -z);
    }
}

/* Upper limit of chi on a hyperbola: for a change of anomaly 2 y the time is shortest when
 * symmetric about the pericentre, n t = 2 (e sinh y - y) >= 2 (e - 1) sinh y. */
static double hyperbolic_limit(double p, double alpha, double target) {
    double e2_1 = -alpha * p, e_1 = e2_1 / (1.0 + sqrt(1.0 + e2_1)); /* e^2 - 1, e - 1 */
    double root = sqrt(-alpha);
    return 2.0 * asinh(0.5 * fabs(target) * -alpha * root / e_1) / root;
}

/* Solves Kepler's universal equation f(chi) = 0, which is monotonic because its derivative is the
 * radius. Laguerre steps that leave the bracket are replaced by bisection. Ends at rounding
 * level. */
static bool solve(double r0, double sigma0, double p, double alpha, double target, double *chi) {
    double limit = alpha < 0.0 ? hyperbolic_limit(p, alpha, target) : INFINITY;
    double low = target < 0.0 ? -limit : 0.0, high = target > 0.0 ? limit : 0.0;
    double x = alpha > 0.0 ? target * alpha : target / r0;
    if (!(x >= low && x <= high)) {
        x = 0.5 * (low + high);
    }
    for (int iteration = 0; iteration < 200; iteration++) {
        double z = alpha * x * x, c2, c3;
        stumpff(z, &c2, &c3);
        double a = r0 * x * (1.0 - z * c3), b = sigma0 * x * x * c2, c = x * x * x * c3;
        double f = a + b + c - target;
        if (fabs(f) <= 2e-16 * (fabs(a) + fabs(b) + fabs(c) + fabs(target))) {
            *chi = x;
            return true;
        }
        if (f > 0.0) {
            high = x;
        } else {
            low = x;
        }
        double df = r0 * (1.0 - z * c2) + sigma0 * x * (1.0 - z * c3) + x * x * c2; /* radius */
        double ddf = sigma0 * (1.0 - z * c2) + (1.0 - alpha * r0) * x * (1.0 - z * c3);
        const double n = 5.0;
        double root = sqrt(fabs((n - 1.0) * (n - 1.0) * df * df - n * (n - 1.0) * f * ddf));
        double next = x - n * f / (df + root);
        if (!(next > low && next < high)) {
            next = isfinite(low) && isfinite(high) ? 0.5 * (low + high) : 2.0 * x;
            if (next == low || next == high) { /* adjacent numbers: exact */
                *chi = x;
                return true;
            }
        }
        x = next;
    }
    return false;
}

bst_status bst_kepler_propagate(bst_ctx *ctx, double mu, bst_vec3 position_m, bst_vec3 velocity_mps,
                                double seconds, bst_vec3 *position_out_m,
                                bst_vec3 *velocity_out_mps) {
    assert(mu > 0.0 && position_out_m && velocity_out_mps);
    double r0 = bst_vec3_norm(position_m);
    double v2 = bst_vec3_dot(velocity_mps, velocity_mps);
    double h = bst_vec3_norm(bst_vec3_cross(position_m, velocity_mps));
    if (!(r0 > 0.0) || !(h > 1e-9 * r0 * sqrt(v2)) || !isfinite(v2) || !isfinite(seconds)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "two-body motion from a rectilinear or non-finite state");
    }
    double root_mu = sqrt(mu);
    double sigma0 = bst_vec3_dot(position_m, velocity_mps) / root_mu;
    double alpha = 2.0 / r0 - v2 / mu; /* 1 / semi-major axis */
    if (alpha > 0.0) {
        /* remove whole revolutions, which would cost digits */
        double period = 2.0 * BST_PI / (root_mu * alpha * sqrt(alpha));
        seconds = remainder(seconds, period);
    }
    double chi;
    if (!solve(r0, sigma0, h * h / mu, alpha, root_mu * seconds, &chi)) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "two-body motion over %g s did not converge",
                        seconds);
    }
    double z = alpha * chi * chi, c2, c3;
    stumpff(z, &c2, &c3);
    double f = 1.0 - chi * chi * c2 / r0;
    double g = seconds - chi * chi * chi * c3 / root_mu;
    bst_vec3 r = bst_vec3_axpy(bst_vec3_scale(position_m, f), g, velocity_mps);
    double radius = bst_vec3_norm(r);
    double fdot = root_mu * chi * (z * c3 - 1.0) / (radius * r0);
    double gdot = 1.0 - chi * chi * c2 / radius;
    *velocity_out_mps = bst_vec3_axpy(bst_vec3_scale(position_m, fdot), gdot, velocity_mps);
    *position_out_m = r;
    return BST_OK;
}

double bst_kepler_eccentric_anomaly(double mean_anomaly_rad, double e) {
    const double turn = remainder(mean_anomaly_rad, 2.0 * BST_PI), m = fabs(turn);
    double x = m + e; /* start above the root: Newton's steps descend to it */
    for (int i = 0; i < 20; i++) {
        double step = (x - e * sin(x) - m) / (1.0 - e * cos(x));
        x -= step;
        if (fabs(step) < 1e-14) {
            break;
        }
    }
    return mean_anomaly_rad - turn + copysign(x, turn);
}
