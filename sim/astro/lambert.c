#include "sim/astro/lambert.h"

/* Geometry of the transfer: lambda of the paper, and revolutions. */
typedef struct path {
    double lambda;
    int turns;
} path;

/* Hypergeometric function 2F1(3, 1; 5/2; z) for small arguments: Battin's series near the
 * parabola. */
static double battin_series(double z) {
    double sum = 1.0, term = 1.0;
    for (int k = 0; k < 60 && fabs(term) > 1e-17 * fabs(sum); k++) {
        term *= (3.0 + k) * (1.0 + k) / (2.5 + k) * z / (1.0 + k);
        sum += term;
    }
    return sum;
}

/* Time of flight at x, in units of sqrt(s^3 / (2 mu)). */
static double flight_time(const path *p, double x) {
    double lambda = p->lambda, e = x * x - 1.0, rho = fabs(e);
    double z = sqrt(1.0 + lambda * lambda * e);
    double away = fabs(x - 1.0);
    if (away < 0.01) {
        double eta = z - lambda * x;
        double q = 4.0 / 3.0 * battin_series(0.5 * (1.0 - lambda - x * eta));
        double turns = p->turns ? p->turns * BST_PI / pow(rho, 1.5) : 0.0;
        return 0.5 * (eta * eta * eta * q + 4.0 * lambda * eta) + turns;
    }
    if (away < 0.2) {
        double a = -1.0 / e, sign = lambda < 0.0 ? -1.0 : 1.0;
        if (a > 0.0) {
            double alpha = 2.0 * acos(x), beta = sign * 2.0 * asin(sqrt(lambda * lambda / a));
            return 0.5 * a * sqrt(a) *
                   (alpha - sin(alpha) - (beta - sin(beta)) + 2.0 * BST_PI * p->turns);
        }
        double alpha = 2.0 * acosh(x), beta = sign * 2.0 * asinh(sqrt(-lambda * lambda / a));
        return -0.5 * a * sqrt(-a) * (beta - sinh(beta) - (alpha - sinh(alpha)));
    }
    double y = sqrt(rho), g = x * z - lambda * e, d;
    if (e < 0.0) {
        d = p->turns * BST_PI + acos(fmax(-1.0, fmin(1.0, g)));
    } else {
        d = log(y * (z - lambda * x) + g);
    }
    return (x - lambda * z - d / y) / e;
}

/* First three derivatives of the time of flight `t` with respect to x. */
static void slopes(const path *p, double x, double t, double d[3]) {
    double l2 = p->lambda * p->lambda, l3 = l2 * p->lambda, u = 1.0 - x * x;
    double y = sqrt(1.0 - l2 * u), y2 = y * y, y3 = y2 * y;
    d[0] = (3.0 * t * x - 2.0 + 2.0 * l3 * x / y) / u;
    d[1] = (3.0 * t + 5.0 * x * d[0] + 2.0 * (1.0 - l2) * l3 / y3) / u;
    d[2] = (7.0 * x * d[1] + 8.0 * d[0] - 6.0 * (1.0 - l2) * l2 * l3 * x / (y3 * y2)) / u;
}

/* Householder's third-order iteration for flight_time(x) = target. */
static bool solve(const path *p, double target, double *x) {
    for (int i = 0; i < 30; i++) {
        double t = flight_time(p, *x), d[3];
        slopes(p, *x, t, d);
        double off = t - target, d2 = d[0] * d[0];
        double step =
            off * (d2 - 0.5 * off * d[1]) / (d[0] * (d2 - off * d[1]) + d[2] * off * off / 6.0);
        if (!isfinite(step)) {
            return false;
        }
        double next = *x - step;
        if (!(next > -1.0) || (p->turns > 0 && !(next < 1.0))) {
            next = next < 0.0 ? 0.5 * (*x - 1.0) : 0.5 * (*x + 1.0);
        }
        double moved = fabs(next - *x);
        *x = next;
        if (moved <= 1e-13 * (1.0 + fabs(next))) {
            return true;
        }
    }
    /* rounding may prevent convergence of the last digits */
    return fabs(flight_time(p, *x) - target) <= 1e-9 * target;
}

/* Minimum time of flight with whole revolutions. */
static double least_time(const path *p, double *x) {
    for (int i = 0; i < 30; i++) {
        double t = flight_time(p, *x), d[3];
        slopes(p, *x, t, d);
        double step = 2.0 * d[0] * d[1] / (2.0 * d[1] * d[1] - d[0] * d[2]);
        double next = fmax(0.5 * (*x - 1.0), fmin(0.5 * (*x + 1.0), *x - step));
        if (!(fabs(next - *x) > 1e-13)) {
            break;
        }
        *x = next;
    }
    return flight_time(p, *x);
}

/* Initial value of Izzo's x for a transfer of less than one revolution. */
static double first_guess(const path *p, double target) {
    double l = p->lambda;
    double t0 = acos(l) + l * sqrt(1.0 - l * l), t1 = 2.0 / 3.0 * (1.0 - l * l * l);
    if (target >= t0) {
        return pow(t0 / target, 2.0 / 3.0) - 1.0;
    }
    if (target <= t1) {
        return 2.5 * t1 * (t1 - target) / (target * (1.0 - l * l * l * l * l)) + 1.0;
    }
    return pow(target / t0, log(2.0) / log(t1 / t0)) - 1.0;
}

/* Solves Lambert's time equation for Izzo's x. */
static bst_status find_x(bst_ctx *ctx, const path *p, double target, bool high_energy, double *x) {
    bool found;
    if (p->turns == 0) {
        *x = first_guess(p, target);
        found = solve(p, target, x);
    } else {
        double bottom = 0.0;
        if (target < p->turns * BST_PI || target < least_time(p, &bottom)) {
            return bst_fail(ctx, BST_ERR_NUMERIC,
                            "Lambert's problem: %d revolutions take longer than the time given",
                            p->turns);
        }
        double k = high_energy ? pow(8.0 * target / (p->turns * BST_PI), 2.0 / 3.0)
                               : pow((p->turns + 1) * BST_PI / (8.0 * target), 2.0 / 3.0);
        *x = (k - 1.0) / (k + 1.0);
        found = solve(p, target, x) && (high_energy ? *x >= bottom : *x <= bottom);
        if (!found) {
            /* start near the minimum, where the curve is a parabola */
            double t = flight_time(p, bottom), d[3];
            slopes(p, bottom, t, d);
            double away = sqrt(2.0 * fmax(0.0, target - t) / d[1]);
            *x = bottom + (high_energy ? 1.0 : -1.0) * fmin(away, 0.5 * (1.0 - fabs(bottom)));
            found = solve(p, target, x);
        }
    }
    return found ? BST_OK : bst_fail(ctx, BST_ERR_NUMERIC, "Lambert's problem did not converge");
}

bst_status bst_lambert(bst_ctx *ctx, double mu, bst_vec3 r1_m, bst_vec3 r2_m, double seconds,
                       bst_lambert_way way, bst_vec3 *v1_mps, bst_vec3 *v2_mps) {
    double r1 = bst_vec3_norm(r1_m), r2 = bst_vec3_norm(r2_m);
    if (!(mu > 0.0) || !(r1 > 0.0) || !(r2 > 0.0) || !isfinite(r1 + r2) || !(seconds > 0.0) ||
        !isfinite(seconds) || way.revolutions < 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "Lambert's problem needs two places off the centre and a time above 0");
    }
    bst_vec3 normal = bst_vec3_cross(r1_m, r2_m);
    double sine = bst_vec3_norm(normal) / (r1 * r2);
    if (!(sine > 1e-10)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "Lambert's problem: the places lie in one line with the centre, which "
                        "leaves the orbit's plane open");
    }
    normal = bst_vec3_unit(normal);
    double c = bst_vec3_norm(bst_vec3_sub(r2_m, r1_m)), s = 0.5 * (r1 + r2 + c);
    /* sqrt(1 - c / s) without cancellation: sqrt(r1 r2) cos(half the angle) / s */
    double half = 0.5 * atan2(sine, bst_vec3_dot(r1_m, r2_m) / (r1 * r2));
    path p = {.lambda = sqrt(r1 * r2) * cos(half) / s, .turns = way.revolutions};
    if (way.long_way) {
        p.lambda = -p.lambda;
        normal = bst_vec3_scale(normal, -1.0);
    }
    double x;
    BST_TRY(find_x(ctx, &p, sqrt(2.0 * mu / (s * s * s)) * seconds, way.high_energy, &x));
    bst_vec3 e1 = bst_vec3_scale(r1_m, 1.0 / r1), e2 = bst_vec3_scale(r2_m, 1.0 / r2);
    double l = p.lambda, y = sqrt(1.0 - l * l + l * l * x * x);
    double gamma = sqrt(0.5 * mu * s), rho = (r1 - r2) / c, sigma = sqrt(fmax(0.0, 1 - rho * rho));
    double along1 = gamma * (l * y - x - rho * (l * y + x)) / r1;
    double along2 = -gamma * (l * y - x + rho * (l * y + x)) / r2;
    double across = gamma * sigma * (y + l * x);
    *v1_mps = bst_vec3_axpy(bst_vec3_scale(e1, along1), across / r1, bst_vec3_cross(normal, e1));
    *v2_mps = bst_vec3_axpy(bst_vec3_scale(e2, along2), across / r2, bst_vec3_cross(normal, e2));
    return isfinite(along1 + along2 + across)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_NUMERIC, "Lambert's problem did not converge");
}
