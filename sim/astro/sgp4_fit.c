#include "sim/astro/sgp4_fit.h"

#include <math.h>
#include <string.h>

enum { ELEMENTS = 6, MAX_ITERATIONS = 40 };

/* WGS-72, m^3/s^2, as used by SGP4 */
static const double MU_72 = 3.986008e14;

bst_astro_kepler_elements bst_astro_kepler_elements_of(double mu, bst_vec3 r, bst_vec3 v) {
    bst_astro_kepler_elements k;
    double distance = bst_vec3_norm(r), v2 = bst_vec3_dot(v, v), along = bst_vec3_dot(r, v);
    bst_vec3 h = bst_vec3_cross(r, v);
    bst_vec3 normal = bst_vec3_unit(h);
    bst_vec3 e = bst_vec3_axpy(bst_vec3_scale(r, (v2 - mu / distance) / mu), -along / mu, v);
    k.semi_major_axis_m = 1.0 / (2.0 / distance - v2 / mu);
    k.eccentricity = bst_vec3_norm(e);
    k.inclination_rad = atan2(hypot(normal.x, normal.y), normal.z);
    bool flat = hypot(normal.x, normal.y) < 1e-12, round = k.eccentricity < 1e-12;
    bst_vec3 node =
        flat ? (bst_vec3){1.0, 0.0, 0.0} : bst_vec3_unit((bst_vec3){-normal.y, normal.x, 0.0});
    bst_vec3 ahead = bst_vec3_cross(normal, node);
    k.raan_rad = atan2(node.y, node.x);
    k.arg_perigee_rad = round ? 0.0 : atan2(bst_vec3_dot(e, ahead), bst_vec3_dot(e, node));
    double latitude = atan2(bst_vec3_dot(r, ahead), bst_vec3_dot(r, node));
    double nu = latitude - k.arg_perigee_rad;
    if (k.semi_major_axis_m > 0.0) {
        double root = sqrt(fmax(0.0, 1.0 - k.eccentricity * k.eccentricity));
        double anomaly = atan2(root * sin(nu), k.eccentricity + cos(nu));
        k.mean_anomaly_rad = anomaly - k.eccentricity * sin(anomaly);
    } else {
        double sinh_f = along / (k.eccentricity * sqrt(-mu * k.semi_major_axis_m));
        k.mean_anomaly_rad = k.eccentricity * sinh_f - asinh(sinh_f);
    }
    const double turn = 2.0 * BST_PI;
    double *angles[3] = {&k.raan_rad, &k.arg_perigee_rad, &k.mean_anomaly_rad};
    for (int i = 0; i < (k.semi_major_axis_m > 0.0 ? 3 : 2); i++) {
        *angles[i] = fmod(*angles[i], turn);
        *angles[i] += *angles[i] < 0.0 ? turn : 0.0;
    }
    return k;
}

bool bst_sgp4_regular_elements(const double x[ELEMENTS], bst_elements *out) {
    double e = hypot(x[1], x[2]);
    double node = atan2(x[4], x[3]), perigee = atan2(x[2], x[1]), turn = 2.0 * BST_PI;
    if (!(e < 1.0) || !(x[0] > 0.0)) {
        return false;
    }
    out->mean_motion_radpmin = x[0];
    out->eccentricity = e;
    out->inclination_rad = 2.0 * atan(hypot(x[3], x[4]));
    out->raan_rad = fmod(node + turn, turn);
    out->arg_perigee_rad = fmod(perigee - node + 2.0 * turn, turn);
    double anomaly = fmod(x[5] - perigee, turn);
    out->mean_anomaly_rad = anomaly < 0.0 ? anomaly + turn : anomaly;
    return true;
}

/* Residuals of SGP4 against the positions (three numbers each, m) and their sum of squares; false:
 * no SGP4 state at one of them. */
static bool differences(const bst_elements *elements, const bst_sgp4_place *places, int count,
                        double *out, double *sum2) {
    bst_sgp4 *sgp4;
    if (bst_sgp4_create(NULL, elements, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4) != BST_OK) {
        return false;
    }
    bool good = true;
    *sum2 = 0.0;
    for (int i = 0; i < count && good; i++) {
        double r[3], v[3];
        good = bst_sgp4_propagate(sgp4, places[i].minutes, r, v) == BST_SGP4_OK;
        const bst_vec3 p = places[i].position_teme_m;
        const double wanted[3] = {p.x, p.y, p.z};
        for (int k = 0; k < 3 && good; k++) {
            out[3 * i + k] = 1e3 * r[k] - wanted[k];
            *sum2 += out[3 * i + k] * out[3 * i + k];
        }
    }
    bst_sgp4_free(sgp4);
    return good && isfinite(*sum2);
}

static bool solve6(double a[ELEMENTS][ELEMENTS + 1], double x[ELEMENTS]) {
    for (int k = 0; k < ELEMENTS; k++) {
        if (!(a[k][k] > 0.0)) {
            return false;
        }
        for (int i = 0; i < ELEMENTS; i++) {
            double f = a[i][k] / a[k][k];
            for (int j = k; j <= ELEMENTS && i != k; j++) {
                a[i][j] -= f * a[k][j];
            }
        }
    }
    for (int k = 0; k < ELEMENTS; k++) {
        x[k] = a[k][ELEMENTS] / a[k][k];
    }
    return true;
}

enum { MOST_PLACES = 256 };

/* Fits mean elements to positions by damped least squares. */
static bst_status fit(bst_ctx *ctx, const bst_sgp4_place *places, int count, double x[ELEMENTS],
                      bst_elements *elements, double *rms_m) {
    double here[3 * MOST_PLACES], slope[ELEMENTS][3 * MOST_PLACES], sum2, damping = 1e-6;
    if (!bst_sgp4_regular_elements(x, elements) ||
        !differences(elements, places, count, here, &sum2)) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "SGP4 has no orbit like this one to start from");
    }
    for (int iteration = 0; iteration < MAX_ITERATIONS; iteration++) {
        for (int k = 0; k < ELEMENTS; k++) {
            double other[3 * MOST_PLACES], unused, y[ELEMENTS];
            double step = k == 0 ? 1e-7 * x[0] : 1e-6;
            bst_elements near = *elements;
            memcpy(y, x, sizeof y);
            y[k] += step;
            bool good = bst_sgp4_regular_elements(y, &near) &&
                        differences(&near, places, count, slope[k], &unused);
            y[k] -= 2.0 * step;
            good = good && bst_sgp4_regular_elements(y, &near) &&
                   differences(&near, places, count, other, &unused);
            if (!good) {
                return bst_fail(ctx, BST_ERR_NUMERIC, "SGP4 has no orbit near this one");
            }
            for (int i = 0; i < 3 * count; i++) {
                slope[k][i] = (slope[k][i] - other[i]) / (2.0 * step);
            }
        }
        double before = sum2, moved[ELEMENTS] = {0.0};
        bool better = false;
        for (int attempt = 0; attempt < 10 && !better; attempt++, damping *= 10.0) {
            double a[ELEMENTS][ELEMENTS + 1], y[ELEMENTS], then;
            for (int k = 0; k < ELEMENTS; k++) {
                for (int l = 0; l <= ELEMENTS; l++) {
                    const double *b = l < ELEMENTS ? slope[l] : here;
                    double sum = 0.0;
                    for (int i = 0; i < 3 * count; i++) {
                        sum += slope[k][i] * b[i];
                    }
                    a[k][l] = l < ELEMENTS ? sum : -sum;
                }
                a[k][k] *= 1.0 + damping;
            }
            bst_elements next = *elements;
            if (!solve6(a, moved)) {
                continue;
            }
            for (int k = 0; k < ELEMENTS; k++) {
                y[k] = x[k] + moved[k];
            }
            double trial[3 * MOST_PLACES];
            if (bst_sgp4_regular_elements(y, &next) &&
                differences(&next, places, count, trial, &then) && then <= sum2) {
                better = true;
                memcpy(x, y, sizeof y);
                memcpy(here, trial, sizeof here);
                sum2 = then;
                *elements = next;
                damping = fmax(1e-3 * damping, 1e-15);
            }
        }
        if (!better || before - sum2 <= 1e-10 * before) {
            *rms_m = sqrt(sum2 / count);
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_NUMERIC, "the fit of mean elements does not converge");
}

/* Initial parameters from an osculating state; false: not an ellipse, or retrograde equatorial. */
static bool start_from(bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps, double x[ELEMENTS]) {
    bst_astro_kepler_elements k =
        bst_astro_kepler_elements_of(MU_72, position_teme_m, velocity_teme_mps);
    if (!(k.semi_major_axis_m > 0.0) || !(k.eccentricity < 1.0) ||
        k.inclination_rad > BST_PI - 0.1 * BST_DEG_RAD) {
        return false;
    }
    double a = k.semi_major_axis_m, perigee = k.arg_perigee_rad + k.raan_rad;
    double tangent = tan(0.5 * k.inclination_rad);
    x[0] = 60.0 * sqrt(MU_72 / (a * a * a));
    x[1] = k.eccentricity * cos(perigee);
    x[2] = k.eccentricity * sin(perigee);
    x[3] = tangent * cos(k.raan_rad);
    x[4] = tangent * sin(k.raan_rad);
    x[5] = k.mean_anomaly_rad + perigee;
    return true;
}

/* Fails: the initial orbit is no ellipse that SGP4 can represent. */
static bst_status fail_start(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_NUMERIC,
                    "mean elements of SGP4 need an ellipse with an inclination below 179.9 "
                    "degrees");
}

bst_status bst_sgp4_fit(bst_ctx *ctx, const bst_sgp4_place *places, int count,
                        bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps,
                        bst_elements *elements, double *rms_m) {
    if (count < ELEMENTS || count > MOST_PLACES) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "mean elements need %d to %d places, not %d",
                        ELEMENTS, MOST_PLACES, count);
    }
    double x[ELEMENTS];
    if (!start_from(position_teme_m, velocity_teme_mps, x)) {
        return fail_start(ctx);
    }
    return fit(ctx, places, count, x, elements, rms_m);
}

bool bst_sgp4_motion(const bst_sgp4 *sgp4, double minutes, bst_vec3 *r, bst_vec3 *v) {
    const double h =
        4.0; /* time step, s: truncation 1e-7 m/s in low orbits, rounding 1e-8 m/s in high ones */
    static const double weight[5] = {1.0 / 12.0, -8.0 / 12.0, 0.0, 8.0 / 12.0, -1.0 / 12.0};
    const bst_sgp4 *sets[5];
    double times[5];
    bst_sgp4_state at[5];
    for (int i = 0; i < 5; i++) {
        sets[i] = sgp4;
        times[i] = minutes + (i - 2) * h / 60.0;
    }
    bst_sgp4_propagate_many(sets, times, 5, at);
    *v = (bst_vec3){0.0, 0.0, 0.0};
    for (int i = 0; i < 5; i++) {
        if (at[i].error != BST_SGP4_OK) {
            return false;
        }
        const double *km = at[i].position_teme_km;
        const bst_vec3 place = bst_vec3_scale((bst_vec3){km[0], km[1], km[2]}, 1e3);
        *v = bst_vec3_axpy(*v, weight[i] / h, place);
        if (i == 2) {
            *r = place;
        }
    }
    return true;
}

/* State at the epoch as six numbers in m: position, and velocity times `time_s`. */
static bool state_of(const bst_elements *elements, double time_s, double out[ELEMENTS]) {
    bst_sgp4 *sgp4;
    bst_vec3 r, v;
    if (bst_sgp4_create(NULL, elements, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4) != BST_OK) {
        return false;
    }
    bool good = bst_sgp4_motion(sgp4, 0.0, &r, &v);
    bst_sgp4_free(sgp4);
    if (good) {
        const double all[ELEMENTS] = {r.x, r.y, r.z, v.x * time_s, v.y * time_s, v.z * time_s};
        memcpy(out, all, sizeof all);
    }
    return good;
}

/* Newton step for `miss`, wanted minus found; false: no SGP4 orbit nearby. */
static bool newton(const double x[ELEMENTS], const bst_elements *elements, double time_s,
                   const double miss[ELEMENTS], double step[ELEMENTS]) {
    double slope[ELEMENTS][ELEMENTS], a[ELEMENTS][ELEMENTS + 1], size[ELEMENTS];
    for (int k = 0; k < ELEMENTS; k++) {
        double side[2][ELEMENTS];
        size[k] = k == 0 ? x[0] : 1.0;
        for (int s = 0; s < 2; s++) {
            double y[ELEMENTS];
            bst_elements near = *elements;
            memcpy(y, x, sizeof y);
            y[k] += (s ? -1e-6 : 1e-6) * size[k];
            if (!bst_sgp4_regular_elements(y, &near) || !state_of(&near, time_s, side[s])) {
                return false;
            }
        }
        for (int i = 0; i < ELEMENTS; i++) {
            slope[k][i] = (side[0][i] - side[1][i]) / 2e-6;
        }
    }
    for (int k = 0; k < ELEMENTS; k++) {
        for (int l = 0; l <= ELEMENTS; l++) {
            a[k][l] = 0.0;
            for (int i = 0; i < ELEMENTS; i++) {
                a[k][l] += slope[k][i] * (l < ELEMENTS ? slope[l][i] : miss[i]);
            }
        }
    }
    if (!solve6(a, step)) {
        return false;
    }
    step[0] *= size[0];
    return true;
}

/* Wanted state minus the state of x, and its square; false: no SGP4 state. */
static bool miss_of(const double x[ELEMENTS], double time_s, const double wanted[ELEMENTS],
                    bst_elements *elements, double miss[ELEMENTS], double *sum2) {
    double here[ELEMENTS];
    if (!bst_sgp4_regular_elements(x, elements) || !state_of(elements, time_s, here)) {
        return false;
    }
    *sum2 = 0.0;
    for (int k = 0; k < ELEMENTS; k++) {
        miss[k] = wanted[k] - here[k];
        *sum2 += miss[k] * miss[k];
    }
    return isfinite(*sum2);
}

bst_status bst_sgp4_through(bst_ctx *ctx, bst_vec3 r, bst_vec3 v, bst_elements *elements) {
    enum { STEPS = 60, HALVINGS = 12 };
    double x[ELEMENTS], miss[ELEMENTS], sum2, time_s = bst_vec3_norm(r) / bst_vec3_norm(v);
    const double wanted[ELEMENTS] = {r.x, r.y, r.z, v.x * time_s, v.y * time_s, v.z * time_s};
    if (!start_from(r, v, x)) {
        return fail_start(ctx);
    }
    bool good = miss_of(x, time_s, wanted, elements, miss, &sum2);
    for (int i = 0; i < STEPS && good; i++) {
        double step[ELEMENTS], share = 1.0, before = sum2;
        bst_elements near = *elements;
        bool better = false;
        if (!newton(x, elements, time_s, miss, step)) {
            break;
        }
        /* reduce the step where the model is nonlinear: near the equator in deep space */
        for (int k = 0; k < HALVINGS && !better; k++, share *= 0.5) {
            double y[ELEMENTS], then[ELEMENTS];
            for (int j = 0; j < ELEMENTS; j++) {
                y[j] = x[j] + share * step[j];
            }
            better = miss_of(y, time_s, wanted, &near, then, &sum2) && sum2 < before;
            if (better) {
                memcpy(x, y, sizeof y);
                memcpy(miss, then, sizeof then);
                *elements = near;
            }
        }
        sum2 = better ? sum2 : before;
        if (!better || sum2 > 0.25 * before) {
            /* at rounding level */
            if (sum2 < 1e-6) {
                return BST_OK;
            }
            good = better;
        }
    }
    return bst_fail(ctx, BST_ERR_NUMERIC, "SGP4 has no orbit through this state");
}
