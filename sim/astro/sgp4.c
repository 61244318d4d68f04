/* SGP4: public creation function and propagation. */
#include "sim/astro/sgp4_internal.h"

/* limit of 1,900 years: beyond it the polynomials in time are meaningless, and resonant orbits
 * would take long to integrate */
#define MAX_MINUTES 1e9

#define KEPLER_STEPS BST_SGP4_KEPLER_STEPS
#define KEPLER_LONGEST_STEP BST_SGP4_KEPLER_LONGEST_STEP

void bst_sgp4_set_plane(const bst_sgp4_constants *k, double sin_i, double cos_i,
                        bst_sgp4_plane *plane) {
    double c2 = cos_i * cos_i;
    double one_c = 1.0 + cos_i;
    /* an orbit of inclination 180 degrees would divide by zero (VCHK) */
    double divisor = fabs(one_c) > 1.5e-12 ? one_c : 1.5e-12;
    plane->sin_i = sin_i;
    plane->cos_i = cos_i;
    plane->y_long = -0.5 * k->j3_over_j2 * sin_i;
    plane->l_long = -0.25 * k->j3_over_j2 * sin_i * (3.0 + 5.0 * cos_i) / divisor;
    plane->three_c2_m1 = 3.0 * c2 - 1.0;
    plane->one_m_c2 = 1.0 - c2;
    plane->seven_c2_m1 = 7.0 * c2 - 1.0;
}

/* Solves u = E - ax sin E + ay cos E for the eccentric longitude E by Newton's method from E = u;
 * gives sin E and cos E. A step d leaves an error of at most d^2 / (2 (1 - e cos E)), so that the
 * size of a step decides whether it is the last one. */
static void solve_kepler(double u, double ax, double ay, double *sin_e, double *cos_e) {
    double s = sin(u), c = cos(u);
    double delta = 0.0;
    for (int step = 0; step < KEPLER_STEPS; step++) {
        double slope = 1.0 - (ax * c + ay * s);
        double d = ((ax * s - ay * c) - delta) / slope;
        if (fabs(d) > KEPLER_LONGEST_STEP) {
            d = d > 0.0 ? KEPLER_LONGEST_STEP : -KEPLER_LONGEST_STEP;
        }
        delta += d;
        bst_sgp4_turn(u + delta, d, &s, &c);
        if (d * d < 2e-15 * slope) {
            break;
        }
    }
    *sin_e = s;
    *cos_e = c;
}

/* Turn of the line of apsides by drag, for which the mean anomaly makes up, and loss of
 * eccentricity. */
typedef struct apsides_drag {
    double turn, e_loss;
} apsides_drag;

/* Those of a set at time t, m its mean anomaly without drag: STR3 section 6. */
static apsides_drag drag_of_apsides(const bst_sgp4 *s, double t, double m) {
    if (s->short_drag) {
        return (apsides_drag){0.0, s->e_drag * t};
    }
    double sin_m = sin(m), cos_m = cos(m);
    double w = 1.0 + s->eta * cos_m;
    double turn = s->argp_drag * t + s->m_drag * (w * w * w - s->cube_m0);
    bst_sgp4_turn(m + turn, turn, &sin_m, &cos_m);
    return (apsides_drag){turn, s->e_drag * t + s->e_drag_sin * (sin_m - s->sin_m0)};
}

/* Adds the displacement of the middle set's eccentricity vector by drag to that of a set near it.
 * The steady loss in proportion to e is each set's own. */
static void displace_as_middle(const bst_sgp4 *s, double t, bst_sgp4_mean *x) {
    const bst_sgp4 *c = s->middle;
    const apsides_drag drag = drag_of_apsides(c, t, c->m0 + c->m_rate * t);
    const double e = c->e0 - drag.e_loss;
    if (!(e >= BST_SGP4_LEAST_E)) { /* the middle set has ended */
        x->e = e;
        return;
    }
    const double e_after = fmax(e, BST_SGP4_ROUND_E);
    const double e_before = c->e0 - (c->e_drag - c->e_drag_oblate) * t;
    const double own = x->e - (s->e_drag - s->e_drag_oblate) * t;
    const double before = c->argp0 + c->argp_rate * t, after = before - drag.turn;
    const double ex = own * cos(x->argp) + (e_after * cos(after) - e_before * cos(before));
    const double ey = own * sin(x->argp) + (e_after * sin(after) - e_before * sin(before));
    const double turn = remainder(x->argp - atan2(ey, ex), BST_SGP4_TWO_PI);
    x->e = hypot(ex, ey);
    x->argp -= turn;
    x->m += turn;
}

/* Secular gravity and drag: STR3 section 6; HSG appendix B. *a: semi-major axis. */
static bst_sgp4_error move_mean(const bst_sgp4 *s, double t, bst_sgp4_mean *x, double *a) {
    *x = (bst_sgp4_mean){.n = s->n0,
                         .e = s->e0,
                         .i = s->i0,
                         .m = s->m0 + s->m_rate * t,
                         .argp = s->argp0 + s->argp_rate * t,
                         .raan = s->raan0 + t * (s->raan_rate + t * s->raan_drag)};
    double root_a_ratio, e_loss = 0.0, l_gain;
    if (s->middle) {
        displace_as_middle(s, t, x);
    } else {
        const apsides_drag drag = drag_of_apsides(s, t, x->m);
        x->m += drag.turn;
        x->argp -= drag.turn;
        e_loss = drag.e_loss;
    }
    if (s->short_drag) {
        root_a_ratio = 1.0 - s->a_drag[0] * t;
        l_gain = s->l_drag[0] * t * t;
    } else {
        const double *ad = s->a_drag, *ld = s->l_drag;
        root_a_ratio = 1.0 - t * (ad[0] + t * (ad[1] + t * (ad[2] + t * ad[3])));
        l_gain = t * t * (ld[0] + t * (ld[1] + t * (ld[2] + t * ld[3])));
    }
    *a = s->a0;
    if (s->deep_space) {
        bst_sgp4_deep_secular(s, t, x);
        if (!(x->n > 0.0)) {
            return BST_SGP4_MEAN_MOTION;
        }
        if (s->deep.resonance != BST_SGP4_NOT_RESONANT) {
            double root = cbrt(s->k.ke / x->n);
            *a = root * root;
        }
    }
    *a *= root_a_ratio * root_a_ratio;
    x->e -= e_loss;
    x->m += l_gain;
    /* Summed and wrapped like the reference implementation: after years the rounding of this sum is
     * the largest error at perigee of an eccentric orbit. */
    x->m = fmod(x->m + x->argp + x->raan, BST_SGP4_TWO_PI) - x->argp - x->raan;
    if (!(x->e < 1.0 && x->e >= BST_SGP4_LEAST_E)) {
        return BST_SGP4_MEAN_ECCENTRICITY;
    }
    if (x->e < BST_SGP4_ROUND_E) {
        x->e = BST_SGP4_ROUND_E;
    }
    return BST_SGP4_OK;
}

/* Perturbed elements with the orbital plane. */
typedef struct disturbed {
    bst_sgp4_mean x;
    double a, ax, ay, u; /* ax, ay: eccentricity vector; u: mean argument of latitude */
    double p;            /* semi-latus rectum */
    double sin_raan, cos_raan;
    bst_sgp4_plane plane;
} disturbed;

/* Adds the luni-solar terms, then the long periodics by J3. The node drops out of the argument of
 * Kepler's equation. */
static bst_sgp4_error add_long_periodics(const bst_sgp4 *s, double t, disturbed *d) {
    bst_sgp4_mean *x = &d->x;
    d->plane = s->plane;
    if (s->deep_space) {
        double i[2], node[2];
        bst_sgp4_deep_periodic(s, t, x, i, node);
        if (!(x->e >= 0.0 && x->e <= 1.0)) {
            return BST_SGP4_PERTURBED_ECCENTRICITY;
        }
        bst_sgp4_set_plane(&s->k, i[0], i[1], &d->plane);
        d->sin_raan = node[0];
        d->cos_raan = node[1];
    } else {
        d->sin_raan = sin(x->raan);
        d->cos_raan = cos(x->raan);
    }
    double inv_p_mean = 1.0 / (d->a * (1.0 - x->e * x->e));
    d->ax = x->e * cos(x->argp);
    d->ay = x->e * sin(x->argp) + inv_p_mean * d->plane.y_long;
    d->u = x->m + x->argp + inv_p_mean * d->plane.l_long * d->ax;
    double e2 = d->ax * d->ax + d->ay * d->ay;
    d->p = d->a * (1.0 - e2);
    return d->p >= 0.0 ? BST_SGP4_OK : BST_SGP4_SEMI_LATUS_RECTUM;
}

/* Radius, velocity components and angles after short periodics. */
typedef struct osculating {
    double r, v_radial, v_along;
    double sin_u, cos_u, sin_i, cos_i, sin_raan, cos_raan;
} osculating;

/* Short periodics by J2; lengths in Earth radii, velocities in units of ke. */
static osculating add_short_periodics(const bst_sgp4 *s, const disturbed *d) {
    const bst_sgp4_plane *plane = &d->plane;
    const bst_sgp4_mean *x = &d->x;
    double a = d->a, ax = d->ax, ay = d->ay, p = d->p;
    double e2 = ax * ax + ay * ay;
    double sin_e, cos_e;
    solve_kepler(d->u, ax, ay, &sin_e, &cos_e);

    double e_cos_e = ax * cos_e + ay * sin_e;
    double e_sin_e = ax * sin_e - ay * cos_e;
    double beta = sqrt(1.0 - e2);
    double root_a = sqrt(a);
    double r = a * (1.0 - e_cos_e);
    double inv_r = 1.0 / r;
    double r_rate = root_a * e_sin_e * inv_r;
    double rf_rate = root_a * beta * inv_r;
    double skew = e_sin_e / (1.0 + beta);
    double sin_u = a * inv_r * (sin_e - ay - ax * skew);
    double cos_u = a * inv_r * (cos_e - ax + ay * skew);
    double sin_2u = 2.0 * cos_u * sin_u;
    double cos_2u = 1.0 - 2.0 * sin_u * sin_u;
    double inv_p = 1.0 / p;
    double g1 = 0.5 * s->k.j2 * inv_p;
    double g2 = g1 * inv_p;
    double n = 1.0 / (a * root_a);

    osculating o = {.sin_i = plane->sin_i,
                    .cos_i = plane->cos_i,
                    .sin_raan = d->sin_raan,
                    .cos_raan = d->cos_raan};
    o.r = r * (1.0 - 1.5 * g2 * beta * plane->three_c2_m1) + 0.5 * g1 * plane->one_m_c2 * cos_2u;
    double u_shift = -0.25 * g2 * plane->seven_c2_m1 * sin_2u;
    double raan_shift = 1.5 * g2 * plane->cos_i * sin_2u;
    double i_shift = 1.5 * g2 * plane->cos_i * plane->sin_i * cos_2u;
    o.v_radial = r_rate - n * g1 * plane->one_m_c2 * sin_2u;
    o.v_along = rf_rate + n * g1 * (plane->one_m_c2 * cos_2u + 1.5 * plane->three_c2_m1);

    if (fabs(u_shift) < 0.125) {
        bst_sgp4_turn(0.0, u_shift, &sin_u, &cos_u);
    } else {
        bst_sgp4_turn(atan2(sin_u, cos_u) + u_shift, u_shift, &sin_u, &cos_u);
    }
    bst_sgp4_turn(x->raan + raan_shift, raan_shift, &o.sin_raan, &o.cos_raan);
    bst_sgp4_turn(x->i + i_shift, i_shift, &o.sin_i, &o.cos_i);
    o.sin_u = sin_u;
    o.cos_u = cos_u;
    return o;
}

bst_sgp4_error bst_sgp4_propagate(const bst_sgp4 *s, double minutes, double position_teme_km[3],
                                  double velocity_teme_kmps[3]) {
    /* Comparisons are written so that NaN takes the error branch. */
    if (!(fabs(minutes) <= MAX_MINUTES)) {
        return BST_SGP4_MEAN_MOTION;
    }
    disturbed d;
    bst_sgp4_error error = move_mean(s, minutes, &d.x, &d.a);
    if (error == BST_SGP4_OK) {
        error = add_long_periodics(s, minutes, &d);
    }
    if (error != BST_SGP4_OK) {
        return error;
    }
    osculating o = add_short_periodics(s, &d);
    /* Unit vectors along the radius and along track. */
    double m_x = -o.sin_raan * o.cos_i, m_y = o.cos_raan * o.cos_i;
    double radial[3] = {m_x * o.sin_u + o.cos_raan * o.cos_u, m_y * o.sin_u + o.sin_raan * o.cos_u,
                        o.sin_i * o.sin_u};
    double along[3] = {m_x * o.cos_u - o.cos_raan * o.sin_u, m_y * o.cos_u - o.sin_raan * o.sin_u,
                       o.sin_i * o.cos_u};
    double r_km = o.r * s->k.radius_km;
    double vr = o.v_radial * s->k.speed_kmps, va = o.v_along * s->k.speed_kmps;
    for (int j = 0; j < 3; j++) {
        position_teme_km[j] = r_km * radial[j];
        velocity_teme_kmps[j] = vr * radial[j] + va * along[j];
    }
    return o.r >= 1.0 ? BST_SGP4_OK : BST_SGP4_DECAYED;
}

const char *bst_sgp4_error_text(bst_sgp4_error error) {
    switch (error) {
        case BST_SGP4_OK:
            return "no error";
        case BST_SGP4_MEAN_ECCENTRICITY:
            return "mean eccentricity is not within 0 and 1";
        case BST_SGP4_MEAN_MOTION:
            return "mean motion is not above zero, or the time is out of reach";
        case BST_SGP4_PERTURBED_ECCENTRICITY:
            return "eccentricity disturbed by Sun and Moon is not within 0 and 1";
        case BST_SGP4_SEMI_LATUS_RECTUM:
            return "semi-latus rectum is below zero";
        case BST_SGP4_DECAYED:
            return "satellite has decayed";
    }
    return "unknown SGP4 error";
}
