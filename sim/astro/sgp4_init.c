/* SGP4 initialisation: constants of one satellite from its element set. */
#include <stdlib.h>

#include "sim/astro/sgp4_internal.h"

/* minimum period with luni-solar perturbations, min (STR3) */
#define DEEP_SPACE_PERIOD_MIN 225.0

/* VCHK table of gravity constants; GM in km^3/s^2. */
static bst_sgp4_constants make_constants(bst_sgp4_gravity gravity) {
    const bool wgs72 = gravity == BST_SGP4_WGS72;
    double gm = wgs72 ? 398600.8 : 398600.5;
    double j3 = wgs72 ? -0.00000253881 : -0.00000253215306;
    bst_sgp4_constants k = {.radius_km = wgs72 ? 6378.135 : 6378.137,
                            .j2 = wgs72 ? 0.001082616 : 0.00108262998905,
                            .j4 = wgs72 ? -0.00000165597 : -0.00000161098761};
    k.j3_over_j2 = j3 / k.j2;
    k.ke = 60.0 / sqrt(k.radius_km * k.radius_km * k.radius_km / gm);
    k.speed_kmps = k.radius_km * k.ke / 60.0;
    return k;
}

/* Greenwich sidereal time at the epoch, rad. Improved: IAU 1982 (Aoki et al., A&A 105, 1982), UTC
 * taken for UT1. AFSPC: the older expression from 1970 January 0 (VCHK). */
static double sidereal_time(double days_1950, bool afspc) {
    double angle;
    if (afspc) {
        double days = days_1950 - 7305.0;
        double whole = floor(days + 1e-8);
        double sun_rate = 1.72027916940703639e-2;
        angle = 1.7321343856509374 + sun_rate * whole +
                (sun_rate + BST_SGP4_TWO_PI) * (days - whole) +
                days * days * 5.07551419432269442e-15;
    } else {
        double c = (days_1950 - 18263.5) / 36525.0; /* Julian centuries from J2000 */
        double seconds =
            67310.54841 + c * (876600.0 * 3600.0 + 8640184.812866 + c * (0.093104 - c * 6.2e-6));
        angle = seconds * (BST_PI / 43200.0);
    }
    angle = fmod(angle, BST_SGP4_TWO_PI);
    return angle < 0.0 ? angle + BST_SGP4_TWO_PI : angle;
}

/* Brouwer mean motion from the Kozai mean motion of the element set (STR3 section 6). */
static void recover_mean_motion(bst_sgp4 *s, double kozai_n, double cos_i) {
    double one_e2 = 1.0 - s->e0 * s->e0;
    double j2_term = 0.75 * s->k.j2 * (3.0 * cos_i * cos_i - 1.0) / (sqrt(one_e2) * one_e2);
    double a1 = pow(s->k.ke / kozai_n, 2.0 / 3.0);
    double d = j2_term / (a1 * a1);
    double a2 = a1 * (1.0 - d * (1.0 / 3.0 + d * (1.0 + d * 134.0 / 81.0)));
    s->n0 = kozai_n / (1.0 + j2_term / (a2 * a2));
    s->a0 = pow(s->k.ke / s->n0, 2.0 / 3.0);
}

/* Lower boundary s of the density function, Earth radii: 78 km, lowered for low perigees (STR3). */
static double density_floor(double perigee_km, double radius_km) {
    double height = perigee_km >= 156.0 ? 78.0 : perigee_km < 98.0 ? 20.0 : perigee_km - 78.0;
    return 1.0 + height / radius_km;
}

/* Secular rates by J2 and J4 (STR3 section 6; HSG appendix B). */
static void set_secular_rates(bst_sgp4 *s) {
    double c2 = s->plane.cos_i * s->plane.cos_i, c4 = c2 * c2;
    double beta2 = 1.0 - s->e0 * s->e0, beta = sqrt(beta2);
    double inv_p2 = 1.0 / (s->a0 * s->a0 * beta2 * beta2);
    double q1 = 1.5 * s->k.j2 * inv_p2 * s->n0;
    double q2 = 0.5 * q1 * s->k.j2 * inv_p2;
    double q4 = -0.46875 * s->k.j4 * inv_p2 * inv_p2 * s->n0;
    s->m_rate = s->n0 + 0.5 * q1 * beta * s->plane.three_c2_m1 +
                0.0625 * q2 * beta * (13.0 - 78.0 * c2 + 137.0 * c4);
    s->argp_rate = -0.5 * q1 * (1.0 - 5.0 * c2) + 0.0625 * q2 * (7.0 - 114.0 * c2 + 395.0 * c4) +
                   q4 * (3.0 - 36.0 * c2 + 49.0 * c4);
    s->raan_rate =
        s->plane.cos_i * (-q1 + 0.5 * q2 * (4.0 - 19.0 * c2) + 2.0 * q4 * (3.0 - 7.0 * c2));
    s->raan_drag = -3.5 * beta2 * q1 * s->plane.cos_i; /* times C1, once that is known */
}

/* Atmospheric drag in powers of time (STR3 section 6, C1 to C5 and D2 to D4). The polynomials end
 * early where those of the middle set do. */
static void set_drag(bst_sgp4 *s, double bstar) {
    const double a = s->a0, e = s->e0, n = s->n0;
    const double radius = s->k.radius_km;
    double perigee_km = (a * (1.0 - e) - 1.0) * radius;
    double floor_re = density_floor(perigee_km, radius);
    double depth = 1.0 + 120.0 / radius - floor_re; /* q0 - s */
    double xi = 1.0 / (a - floor_re);
    double eta = a * e * xi, eta2 = eta * eta, e_eta = e * eta;
    double psi2 = fabs(1.0 - eta2);
    double beta2 = 1.0 - e * e;
    double q_xi = depth * xi;
    double q_xi4 = q_xi * q_xi * q_xi * q_xi;
    double density = q_xi4 / (psi2 * psi2 * psi2 * sqrt(psi2));
    double j2_xi = s->k.j2 * xi / psi2;
    double x3 = s->plane.three_c2_m1;

    double c1 = bstar * density * n *
                (a * (1.0 + 1.5 * eta2 + e_eta * (4.0 + eta2)) +
                 0.375 * j2_xi * x3 * (8.0 + 3.0 * eta2 * (8.0 + eta2)));
    double c4_oblate =
        j2_xi / a *
        (-3.0 * x3 * (1.0 - 2.0 * e_eta + eta2 * (1.5 - 0.5 * e_eta)) +
         0.75 * s->plane.one_m_c2 * (2.0 * eta2 - e_eta * (1.0 + eta2)) * cos(2.0 * s->argp0));
    double c4 = 2.0 * n * density * a * beta2 *
                (eta * (2.0 + 0.5 * eta2) + e * (0.5 + 2.0 * eta2) - c4_oblate);
    double c5 = 2.0 * density * a * beta2 * (1.0 + 2.75 * (eta2 + e_eta) + e_eta * eta2);

    s->raan_drag *= c1;
    s->a_drag[0] = c1;
    s->e_drag = bstar * c4;
    s->e_drag_oblate = -bstar * 2.0 * n * density * a * beta2 * c4_oblate;
    s->l_drag[0] = n * 1.5 * c1;
    const bool low = a * (1.0 - e) < 220.0 / radius + 1.0;
    s->short_drag = s->deep_space || (s->middle ? s->middle->short_drag : low);
    if (s->short_drag) {
        return;
    }
    double w = 1.0 + eta * cos(s->m0);
    s->eta = eta;
    s->sin_m0 = sin(s->m0);
    s->cube_m0 = w * w * w;
    s->e_drag_sin = bstar * c5;
    if (e > 1e-4) { /* both contain 1 / e (VCHK) */
        double c3 = -2.0 * q_xi4 * xi * s->k.j3_over_j2 * n * s->plane.sin_i / e;
        s->argp_drag = bstar * c3 * cos(s->argp0);
        s->m_drag = -(2.0 / 3.0) * q_xi4 * bstar / e_eta;
    }
    double d2 = 4.0 * a * xi * c1 * c1;
    double d3 = d2 * xi * c1 / 3.0 * (17.0 * a + floor_re);
    double d4 = d2 * xi * xi * c1 * c1 / 6.0 * a * (221.0 * a + 31.0 * floor_re);
    s->a_drag[1] = d2;
    s->a_drag[2] = d3;
    s->a_drag[3] = d4;
    s->l_drag[1] = n * (d2 + 2.0 * c1 * c1);
    s->l_drag[2] = n * 0.25 * (3.0 * d3 + c1 * (12.0 * d2 + 10.0 * c1 * c1));
    s->l_drag[3] =
        n * 0.2 *
        (3.0 * d4 + 12.0 * c1 * d3 + 6.0 * d2 * d2 + 15.0 * c1 * c1 * (2.0 * d2 + c1 * c1));
}

/* Fails with the reason why SGP4 cannot propagate the element set. */
static bst_status refuse(bst_ctx *ctx, const bst_elements *el, bst_sgp4_error code) {
    return bst_fail(ctx, BST_ERR_NUMERIC,
                    "SGP4 cannot propagate satellite %d: error %d, %s (eccentricity %.9g, mean "
                    "motion %.9g rad/min); leave this element set out",
                    el->norad, (int)code, bst_sgp4_error_text(code), el->eccentricity,
                    el->mean_motion_radpmin);
}

/* middle: NULL, or the set in the middle of those that are near each other */
static bst_status create(bst_ctx *ctx, const bst_elements *elements, const bst_sgp4 *middle,
                         bst_sgp4_gravity gravity, bst_sgp4_mode mode, bst_sgp4 **out) {
    const bst_elements *el = elements;
    *out = NULL;
    double sum = el->epoch_utc_jd1 + el->epoch_utc_jd2 + el->bstar + el->raan_rad +
                 el->arg_perigee_rad + el->mean_anomaly_rad;
    if (!isfinite(sum) || !(el->inclination_rad >= 0.0 && el->inclination_rad <= BST_PI)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "satellite %d: element set has a value that is not finite or an "
                        "inclination outside 0 to pi rad; check its source",
                        el->norad);
    }
    if (!(el->eccentricity >= 0.0 && el->eccentricity < 1.0)) {
        return refuse(ctx, el, BST_SGP4_MEAN_ECCENTRICITY);
    }
    if (!(el->mean_motion_radpmin > 0.0 && isfinite(el->mean_motion_radpmin))) {
        return refuse(ctx, el, BST_SGP4_MEAN_MOTION);
    }
    bst_sgp4 *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an SGP4 propagator (%zu bytes)",
                        sizeof *s);
    }
    s->gravity = gravity;
    s->k = make_constants(gravity);
    s->afspc = mode == BST_SGP4_AFSPC;
    s->e0 = el->eccentricity;
    s->i0 = el->inclination_rad;
    s->m0 = el->mean_anomaly_rad;
    s->argp0 = el->arg_perigee_rad;
    s->raan0 = el->raan_rad;
    double cos_i = cos(s->i0);
    recover_mean_motion(s, el->mean_motion_radpmin, cos_i);
    if (!(s->n0 > 0.0 && isfinite(s->a0))) {
        free(s);
        return refuse(ctx, el, BST_SGP4_MEAN_MOTION);
    }
    s->deep_space = BST_SGP4_TWO_PI / s->n0 >= DEEP_SPACE_PERIOD_MIN;
    s->middle = s->deep_space ? NULL : middle; /* those have no such displacement */
    bst_sgp4_set_plane(&s->k, sin(s->i0), cos_i, &s->plane);
    set_secular_rates(s);
    set_drag(s, el->bstar);
    if (s->deep_space) {
        /* summed to one double first, like the reference: rounding moves the Moon by 1e-10 rad,
         * 1e-6 km at the highest orbits */
        double days_1950 = (el->epoch_utc_jd1 + el->epoch_utc_jd2) - 2433281.5;
        bst_sgp4_deep_init(s, days_1950 + 18261.5, sidereal_time(days_1950, s->afspc));
    }
    if (s->deep.resonance != BST_SGP4_NOT_RESONANT) {
        s->deep.memo = calloc(1, sizeof *s->deep.memo);
        if (s->deep.memo == NULL) {
            free(s);
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an SGP4 propagator (%zu bytes)",
                            sizeof *s->deep.memo);
        }
    }
    *out = s;
    return BST_OK;
}

bst_status bst_sgp4_create(bst_ctx *ctx, const bst_elements *elements, bst_sgp4_gravity gravity,
                           bst_sgp4_mode mode, bst_sgp4 **out) {
    return create(ctx, elements, NULL, gravity, mode, out);
}

bst_status bst_sgp4_create_near(bst_ctx *ctx, const bst_elements *elements, const bst_sgp4 *middle,
                                bst_sgp4 **out) {
    return create(ctx, elements, middle, middle->gravity,
                  middle->afspc ? BST_SGP4_AFSPC : BST_SGP4_IMPROVED, out);
}

void bst_sgp4_free(bst_sgp4 *sgp4) {
    if (sgp4) {
        free(sgp4->deep.memo);
    }
    free(sgp4);
}
