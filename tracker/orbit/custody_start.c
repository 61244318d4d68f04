/* Orbits of new objects as those of a catalogue, and differences between orbits. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/astro/sgp4_fit.h"
#include "tracker/orbit/custody.h"

enum { N = BST_CUSTODY_STATE };
/* B* of satellites in low orbits, 1 / Earth radii: the order of a catalogue's at 500 km */
#define UNKNOWN_BSTAR 3e-4

/* Elements as numbers that are regular for circular and equatorial orbits; mean motion in rad/s. */
static void regular_of(double n, double e, double inclination, double raan, double perigee,
                       double anomaly, double out[N]) {
    const double t = tan(0.5 * inclination);
    out[BST_CUSTODY_DRIFT] = n;
    out[BST_CUSTODY_ECC_X] = e * cos(perigee + raan);
    out[BST_CUSTODY_ECC_Y] = e * sin(perigee + raan);
    out[BST_CUSTODY_PLANE_X] = t * cos(raan);
    out[BST_CUSTODY_PLANE_Y] = t * sin(raan);
    out[BST_CUSTODY_ALONG] = anomaly + perigee + raan;
}

static void mean_numbers(const bst_elements *e, double out[N]) {
    regular_of(e->mean_motion_radpmin / 60.0, e->eccentricity, e->inclination_rad, e->raan_rad,
               e->arg_perigee_rad, e->mean_anomaly_rad, out);
}

/* False: no ellipse. */
static bool osculating_numbers(bst_vec3 r, bst_vec3 v, double out[N]) {
    const bst_astro_kepler_elements k = bst_astro_kepler_elements_of(BST_EARTH_MU_M3PS2, r, v);
    const double a = k.semi_major_axis_m;
    if (!(a > 0.0)) {
        return false;
    }
    regular_of(sqrt(BST_EARTH_MU_M3PS2 / a) / a, k.eccentricity, k.inclination_rad, k.raan_rad,
               k.arg_perigee_rad, k.mean_anomaly_rad, out);
    return true;
}

/* Numbers minus those of a reference as distances, with ALONG at the time of the numbers. */
static void distances(double a_m, const double at[N], const double from[N], double out[N]) {
    const double t2 = from[BST_CUSTODY_PLANE_X] * from[BST_CUSTODY_PLANE_X] +
                      from[BST_CUSTODY_PLANE_Y] * from[BST_CUSTODY_PLANE_Y];
    const double unit[N] = {a_m * BST_DAY_S,        2.0 * a_m, 2.0 * a_m, 2.0 * a_m / (1.0 + t2),
                            2.0 * a_m / (1.0 + t2), a_m};
    for (int k = 0; k < N; k++) {
        const double d = at[k] - from[k];
        out[k] = unit[k] * (k == BST_CUSTODY_ALONG ? remainder(d, 2.0 * BST_PI) : d);
    }
}

/* Adds to a covariance half the difference of both sides of a column of a root, squared. */
static void add_column(const double sides[N], double p[N][N]) {
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            p[i][j] += 0.25 * sides[i] * sides[j];
        }
    }
}

bool bst_custody_difference(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                            double time_s, bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps,
                            bst_custody_filter *out) {
    assert(orbit && filter && out);
    double root[N][N], from[N], at[N];
    bst_vec3 r, v;
    memset(out, 0, sizeof *out);
    if (!bst_custody_root(filter->p, root) ||
        !osculating_numbers(position_teme_m, velocity_teme_mps, from) ||
        !bst_custody_state(orbit, filter->x, time_s, &r, &v) || !osculating_numbers(r, v, at)) {
        return false;
    }
    distances(orbit->a_m, at, from, out->x);
    for (int k = 0; k < N; k++) {
        double side[2][N], column[N];
        for (int s = 0; s < 2; s++) {
            double x[N];
            for (int i = 0; i < N; i++) {
                x[i] = filter->x[i] + (s ? -root[i][k] : root[i][k]);
            }
            if (!bst_custody_state(orbit, x, time_s, &r, &v) ||
                !osculating_numbers(r, v, side[s])) {
                return false;
            }
        }
        distances(orbit->a_m, side[0], side[1], column);
        add_column(column, out->p);
    }
    return true;
}

/* Adds a share of a second moment. */
static void add_moment(double share, const double of[N], double p[N][N]) {
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            p[i][j] += share * of[i] * of[j];
        }
    }
}

/* Numbers of the orbit through a state: of its mean elements, or of osculating ones. */
static bool numbers_through(bst_vec3 r, bst_vec3 v, bool osculating, bst_elements *elements,
                            double out[N]) {
    bst_ctx quiet = {0}; /* a state without an orbit is no error here */
    if (osculating) {
        return osculating_numbers(r, v, out);
    }
    if (bst_sgp4_through(&quiet, r, v, elements) != BST_OK) {
        return false;
    }
    mean_numbers(elements, out);
    return true;
}

bool bst_custody_start(const bst_custody_fix *fix, double photocentre_m, bst_custody_orbit *orbit,
                       bst_custody_filter *filter) {
    assert(fix && orbit && filter);
    const bst_vec3 r = fix->position_m, v = fix->velocity_mps;
    const double turn_radps = bst_vec3_norm(v) / bst_vec3_norm(r);
    double root[N][N], middle[N], covariance[N][N];
    bst_ctx quiet = {0};
    memcpy(covariance, fix->covariance, sizeof covariance);
    for (int k = 0; k < N; k++) {
        const double off = photocentre_m * (k < 3 ? 1.0 : turn_radps);
        covariance[k][k] += off * off;
    }
    bst_elements elements = {.epoch_utc_jd1 = fix->epoch_utc_jd[0],
                             .epoch_utc_jd2 = fix->epoch_utc_jd[1]};
    memset(filter, 0, sizeof *filter);
    if (!bst_custody_root(fix->covariance, root) || !bst_custody_root(covariance, root) ||
        !numbers_through(r, v, false, &elements, middle) ||
        bst_custody_orbit_init(&quiet, &elements, -fix->time_s, photocentre_m, orbit) != BST_OK) {
        return false;
    }
    const bool osculating = bst_custody_osculates(&elements);
    double shift[N] = {0.0};
    if (osculating && !osculating_numbers(r, v, middle)) {
        return false;
    }
    for (int k = 0; k < N; k++) {
        double side[2][N], column[N], off[2][N], bent[N];
        for (int s = 0; s < 2; s++) {
            const double to = s ? -1.0 : 1.0;
            const bst_vec3 dr = {root[0][k], root[1][k], root[2][k]};
            const bst_vec3 dv = {root[3][k], root[4][k], root[5][k]};
            bst_elements near = elements;
            if (!numbers_through(bst_vec3_axpy(r, to, dr), bst_vec3_axpy(v, to, dv), osculating,
                                 &near, side[s])) {
                return false;
            }
            distances(orbit->a_m, side[s], middle, off[s]);
        }
        distances(orbit->a_m, side[0], side[1], column);
        for (int i = 0; i < N; i++) {
            bent[i] = 0.5 * (off[0][i] + off[1][i]);
        }
        column[BST_CUSTODY_ALONG] -= column[BST_CUSTODY_DRIFT] * fix->time_s / BST_DAY_S;
        bent[BST_CUSTODY_ALONG] -= bent[BST_CUSTODY_DRIFT] * fix->time_s / BST_DAY_S;
        add_column(column, filter->p);
        /* bent z^2 has a variance of 2 bent^2 and a mean of bent, which the middle lacks */
        add_moment(2.0, bent, filter->p);
        for (int i = 0; i < N; i++) {
            shift[i] += bent[i];
        }
    }
    add_moment(1.0, shift, filter->p);
    filter->noise_until_s = fix->time_s;
    return true;
}

double bst_custody_drag_noise_m_per_day(const bst_custody_orbit *orbit) {
    const double day_later_s = BST_DAY_S - orbit->epoch_offset_s;
    bst_custody_orbit drag = *orbit;
    bst_vec3 with, without;
    drag.elements.bstar += UNKNOWN_BSTAR;
    if (!bst_custody_catalogued_position(orbit, day_later_s, &without) ||
        !bst_custody_catalogued_position(&drag, day_later_s, &with)) {
        return 0.0;
    }
    /* the place of a random walk of the drift after one day: its step over the root of 3 */
    return sqrt(3.0) * bst_vec3_norm(bst_vec3_sub(with, without));
}
