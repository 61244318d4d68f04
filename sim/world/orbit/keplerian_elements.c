/* Completes the Keplerian elements of a scenario: size and anomaly. */
#include <math.h>

#include "boresight/vec.h"
#include "sim/world/world_config.h"

static const double AGREES =
    1e-6; /* tolerance of redundant elements: relative radius; anomaly in degrees */

/* Mean anomaly (rad) from the true anomaly on an ellipse or a hyperbola (Vallado, Fundamentals of
 * Astrodynamics and Applications, 4th ed., section 2.2). */
static double mean_of_true(double e, double nu) {
    if (e < 1.0) {
        double turns = 2.0 * BST_PI * round(nu / (2.0 * BST_PI));
        double half = 0.5 * (nu - turns);
        double anomaly = 2.0 * atan2(sqrt(1.0 - e) * sin(half), sqrt(1.0 + e) * cos(half));
        return anomaly - e * sin(anomaly) + turns;
    }
    double h = 2.0 * atanh(sqrt((e - 1.0) / (e + 1.0)) * tan(0.5 * nu));
    return e * sinh(h) - h;
}

/* True anomaly (rad) from the mean anomaly: Kepler's equation by bisection, to rounding. */
static double true_of_mean(double e, double mean) {
    double turns = e < 1.0 ? 2.0 * BST_PI * round(mean / (2.0 * BST_PI)) : 0.0, m = mean - turns;
    /* the root of e sinh H - H = |M| is below asinh(|M| / (e - 1)) + 1 */
    double low = e < 1.0 ? -BST_PI : -asinh(fabs(m) / (e - 1.0)) - 1.0, high = -low;
    for (int i = 0; i < 200; i++) {
        double x = 0.5 * (low + high);
        double found = e < 1.0 ? x - e * sin(x) : e * sinh(x) - x;
        *(found < m ? &low : &high) = x;
    }
    double x = 0.5 * (low + high);
    if (e < 1.0) {
        return 2.0 * atan2(sqrt(1.0 + e) * sin(0.5 * x), sqrt(1.0 - e) * cos(0.5 * x)) + turns;
    }
    return 2.0 * atan(sqrt((e + 1.0) / (e - 1.0)) * tanh(0.5 * x));
}

/* Computes semi-major axis or perigee radius from the other. */
static bst_status resolve_size(bst_ctx *ctx, bst_initial_state_config *s) {
    double a = s->semi_major_axis_m, e = s->eccentricity, by_axis = a * (1.0 - e);
    if (isnan(a) && isnan(s->perigee_radius_m)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "keplerian elements need semi_major_axis_m or perigee_radius_m");
    }
    if (!isnan(a) && !(by_axis > 0.0)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "semi_major_axis_m %.9g and eccentricity %.9g: no orbit has them; an ellipse "
            "(eccentricity below 1) has an axis above 0, a hyperbola one below 0, a "
            "parabola needs perigee_radius_m",
            a, e);
    }
    if (isnan(s->perigee_radius_m)) {
        s->perigee_radius_m = by_axis;
    } else if (!isnan(a) &&
               !(fabs(by_axis - s->perigee_radius_m) <= AGREES * s->perigee_radius_m)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "semi_major_axis_m and eccentricity give a perigee of %.9g m, but "
                        "perigee_radius_m gives %.9g m; give one of the two",
                        by_axis, s->perigee_radius_m);
    }
    if (!(s->perigee_radius_m > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "keplerian elements need perigee_radius_m above 0");
    }
    if (isnan(a) && e != 1.0) {
        s->semi_major_axis_m = s->perigee_radius_m / (1.0 - e);
    }
    return BST_OK;
}

bst_status bst_keplerian_resolve(bst_ctx *ctx, bst_initial_state_config *s) {
    double e = s->eccentricity;
    BST_TRY(resolve_size(ctx, s));
    if (isnan(s->true_anomaly_deg) && !isnan(s->mean_anomaly_deg)) {
        if (e == 1.0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "mean_anomaly_deg: a parabola has none; give true_anomaly_deg");
        }
        s->true_anomaly_deg =
            true_of_mean(e, fmod(s->mean_anomaly_deg, e < 1.0 ? 360.0 : INFINITY) * BST_DEG_RAD) /
            BST_DEG_RAD;
    }
    if (isnan(s->true_anomaly_deg)) {
        s->true_anomaly_deg = 0.0;
    }
    double nu = s->true_anomaly_deg * BST_DEG_RAD;
    if (!(1.0 + e * cos(nu) > 1e-9)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "true_anomaly_deg %.9g: the hyperbola does not reach it",
                        s->true_anomaly_deg);
    }
    double mean_deg = e == 1.0 ? NAN : mean_of_true(e, nu) / BST_DEG_RAD;
    if (isnan(s->mean_anomaly_deg)) {
        s->mean_anomaly_deg = mean_deg;
        return BST_OK;
    }
    double off = s->mean_anomaly_deg - mean_deg;
    off = e < 1.0 ? remainder(off, 360.0) : off / fmax(1.0, fabs(mean_deg));
    return fabs(off) <= AGREES
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "true_anomaly_deg %.9g is a mean anomaly of %.9g degrees, but "
                          "mean_anomaly_deg gives %.9g; give one of the two",
                          s->true_anomaly_deg, mean_deg, s->mean_anomaly_deg);
}
