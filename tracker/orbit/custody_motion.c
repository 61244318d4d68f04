/* Motion of an object on elements that differ from its catalogued ones. */
#include "tracker/orbit/custody_motion.h"

#include <math.h>

#include "sim/astro/kepler.h"
#include "sim/astro/sgp4_fit.h"

enum { N = BST_CUSTODY_STATE };

bst_status bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements, double epoch_offset_s,
                                  double photocentre_m, bst_custody_orbit *out) {
    double n = elements->mean_motion_radpmin / 60.0;
    if (!(n > 0.0 && elements->eccentricity >= 0.0 && elements->eccentricity < 1.0)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "object \"%s\" (catalogue number %d): mean motion %g rad/min and "
                        "eccentricity %g are no ellipse: allowed are mean motions above 0 and "
                        "eccentricities from 0 to below 1",
                        elements->name, elements->norad, elements->mean_motion_radpmin,
                        elements->eccentricity);
    }
    *out = (bst_custody_orbit){.elements = *elements,
                               .epoch_offset_s = epoch_offset_s,
                               .a_m = cbrt(BST_EARTH_MU_M3PS2 / (n * n)),
                               .photocentre_m = photocentre_m};
    return BST_OK;
}

/* The element set that differs from the catalogued one by x. False: no ellipse. */
static bool elements_at(const bst_custody_orbit *o, const double x[N], bst_elements *out) {
    const bst_elements *e = &o->elements;
    const double perigee = e->raan_rad + e->arg_perigee_rad, t = tan(0.5 * e->inclination_rad);
    const double plane_m = 2.0 * o->a_m / (1.0 + t * t);
    const double dn = x[BST_CUSTODY_DRIFT] / (o->a_m * BST_DAY_S); /* rad/s */
    const double y[N] = {
        e->mean_motion_radpmin + 60.0 * dn,
        e->eccentricity * cos(perigee) + x[BST_CUSTODY_ECC_X] / (2.0 * o->a_m),
        e->eccentricity * sin(perigee) + x[BST_CUSTODY_ECC_Y] / (2.0 * o->a_m),
        t * cos(e->raan_rad) + x[BST_CUSTODY_PLANE_X] / plane_m,
        t * sin(e->raan_rad) + x[BST_CUSTODY_PLANE_Y] / plane_m,
        e->mean_anomaly_rad + perigee + x[BST_CUSTODY_ALONG] / o->a_m - dn * o->epoch_offset_s};
    *out = *e;
    return bst_sgp4_regular_elements(y, out);
}

/* State of an ellipse with these elements about a point mass. */
static void ellipse_state(const bst_elements *set, bst_vec3 *r, bst_vec3 *v) {
    const double n = set->mean_motion_radpmin / 60.0, e = set->eccentricity;
    const double a = cbrt(BST_EARTH_MU_M3PS2 / (n * n));
    const double anomaly = bst_kepler_eccentric_anomaly(set->mean_anomaly_rad, e);
    const double c = cos(anomaly), s = sin(anomaly), root = sqrt(1.0 - e * e);
    const double rate = n * a / (1.0 - e * c);
    const double cw = cos(set->arg_perigee_rad), sw = sin(set->arg_perigee_rad);
    const double co = cos(set->raan_rad), so = sin(set->raan_rad);
    const double ci = cos(set->inclination_rad), si = sin(set->inclination_rad);
    const bst_vec3 p = {co * cw - so * sw * ci, so * cw + co * sw * ci, sw * si};
    const bst_vec3 q = {-co * sw - so * cw * ci, -so * sw + co * cw * ci, cw * si};
    *r = bst_vec3_axpy(bst_vec3_scale(p, a * (c - e)), a * root * s, q);
    *v = bst_vec3_axpy(bst_vec3_scale(p, -rate * s), rate * root * c, q);
}

/* Motion of an orbit near the equator or circular: the catalogued one, whose osculating elements
 * differ by x. What perturbations do to the difference, a thousandth of it in a revolution, is left
 * out. */
static bool osculating_motion(const bst_custody_orbit *o, bst_vec3 cat_r, bst_vec3 cat_v,
                              const double x[N], double time_s, bst_vec3 *r, bst_vec3 *v) {
    const bst_astro_kepler_elements k =
        bst_astro_kepler_elements_of(BST_EARTH_MU_M3PS2, cat_r, cat_v);
    if (!(k.semi_major_axis_m > 0.0)) {
        return false;
    }
    const double a = k.semi_major_axis_m;
    const bst_custody_orbit osculating = {
        .elements = {.mean_motion_radpmin = 60.0 * sqrt(BST_EARTH_MU_M3PS2 / a) / a,
                     .eccentricity = k.eccentricity,
                     .inclination_rad = k.inclination_rad,
                     .raan_rad = k.raan_rad,
                     .arg_perigee_rad = k.arg_perigee_rad,
                     .mean_anomaly_rad = k.mean_anomaly_rad},
        .epoch_offset_s = -time_s, /* its elements are those of time_s */
        .a_m = o->a_m};
    bst_elements set;
    if (!elements_at(&osculating, x, &set)) {
        return false;
    }
    ellipse_state(&set, r, v);
    return true;
}

/* States of a propagator; derivative: as in bst_custody_motion. */
static bool states(const bst_sgp4 *sgp4, double epoch_offset_s, bool derivative, int count,
                   const double *time_s, bst_vec3 *r, bst_vec3 *v) {
    for (int i = 0; i < count; i++) {
        const double minutes = (epoch_offset_s + time_s[i]) / 60.0;
        double km[3], kmps[3];
        if (derivative) {
            if (!bst_sgp4_motion(sgp4, minutes, &r[i], &v[i])) {
                return false;
            }
            continue;
        }
        if (bst_sgp4_propagate(sgp4, minutes, km, kmps) != BST_SGP4_OK) {
            return false;
        }
        r[i] = (bst_vec3){1e3 * km[0], 1e3 * km[1], 1e3 * km[2]};
        v[i] = (bst_vec3){1e3 * kmps[0], 1e3 * kmps[1], 1e3 * kmps[2]};
    }
    return true;
}

bool bst_custody_motion(const bst_custody_orbit *o, const double x[N], bool derivative, int count,
                        const double *time_s, bst_vec3 *r, bst_vec3 *v) {
    const bool osculating = bst_custody_osculates(&o->elements);
    /* vectors propagate these as fast as one time of the others */
    const bool deep = o->elements.mean_motion_radpmin < 2.0 * BST_PI / 225.0;
    bst_elements set;
    bst_sgp4 *catalogued, *near = NULL;
    if (bst_sgp4_create(NULL, &o->elements, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &catalogued) !=
        BST_OK) {
        return false;
    }
    bool good = osculating || (elements_at(o, x, &set) &&
                               bst_sgp4_create_near(NULL, &set, catalogued, &near) == BST_OK);
    good = good && states(osculating ? catalogued : near, o->epoch_offset_s,
                          derivative || osculating || deep, count, time_s, r, v);
    for (int i = 0; good && osculating && i < count; i++) {
        good = osculating_motion(o, r[i], v[i], x, time_s[i], &r[i], &v[i]);
    }
    bst_sgp4_free(near);
    bst_sgp4_free(catalogued);
    return good;
}

bool bst_custody_state(const bst_custody_orbit *orbit, const double x[N], double time_s,
                       bst_vec3 *position_teme_m, bst_vec3 *velocity_teme_mps) {
    return bst_custody_motion(orbit, x, true, 1, &time_s, position_teme_m, velocity_teme_mps);
}

bool bst_custody_catalogued_position(const bst_custody_orbit *orbit, double time_s,
                                     bst_vec3 *position_teme_m) {
    const double none[N] = {0.0};
    bst_vec3 v;
    return bst_custody_motion(orbit, none, false, 1, &time_s, position_teme_m, &v);
}

bool bst_custody_predict_position(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                  double time_s, bst_vec3 *position_teme_m, double *sigma_m) {
    double root[N][N], sum = 0.0;
    bst_vec3 v;
    if (!bst_custody_root(filter->p, root) ||
        !bst_custody_motion(orbit, filter->x, false, 1, &time_s, position_teme_m, &v)) {
        return false;
    }
    for (int k = 0; k < N; k++) {
        double at[2][N];
        bst_vec3 r[2];
        for (int i = 0; i < N; i++) {
            at[0][i] = filter->x[i] + BST_CUSTODY_SPREAD * root[i][k];
            at[1][i] = filter->x[i] - BST_CUSTODY_SPREAD * root[i][k];
        }
        if (!bst_custody_motion(orbit, at[0], false, 1, &time_s, &r[0], &v) ||
            !bst_custody_motion(orbit, at[1], false, 1, &time_s, &r[1], &v)) {
            return false;
        }
        const bst_vec3 slope = bst_vec3_scale(bst_vec3_sub(r[0], r[1]), 0.5 / BST_CUSTODY_SPREAD);
        const bst_vec3 bend =
            bst_vec3_scale(bst_vec3_axpy(bst_vec3_add(r[0], r[1]), -2.0, *position_teme_m),
                           1.0 / (BST_CUSTODY_SPREAD * BST_CUSTODY_SPREAD));
        sum += bst_vec3_dot(slope, slope) + 0.5 * bst_vec3_dot(bend, bend);
    }
    *sigma_m = sqrt(sum);
    return true;
}
