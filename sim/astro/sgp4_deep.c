/* SGP4's deep-space part: Sun, Moon and resonance with the geopotential (STR3 section 7, "SDP4";
 * HSG appendix B; numbers as in VCHK). */
#include "sim/astro/sgp4_lanes.h"

#define EARTH_RATE_RADPMIN BST_SGP4_EARTH_RATE_RADPMIN
#define STEP_MIN 720.0
/* below 3 degrees of inclination the luni-solar secular effect on the node is omitted */
#define NODE_SECULAR_MIN_I 5.2359877e-2
#define LYDDANE_I BST_SGP4_LYDDANE_I

/* A perturbing body: orbit and strength. */
typedef struct perturber {
    double strength;                 /* STR3's C, rad/min */
    double rate, eccentricity;       /* mean motion of its orbit, rad/min */
    double sin_perigee, cos_perigee; /* of its argument of perigee */
    double sin_i, cos_i;             /* of its orbit */
    double sin_node, cos_node;       /* of the satellite's node minus its node */
} perturber;

/* A vector in the satellite's orbit: nodal frame (0 along the node, 1 in the plane, 2 along the
 * angular momentum) and its two in-plane components from perigee. */
typedef struct orbit_vector {
    double nodal[3];
    double p, q;         /* along perigee and 90 degrees ahead of it */
    double w_sin, w_cos; /* out-of-plane component times sin, cos of perigee */
} orbit_vector;

static orbit_vector make_orbit_vector(double x, double y, double z, const bst_sgp4_plane *plane,
                                      double sin_w, double cos_w) {
    orbit_vector v;
    v.nodal[0] = x;
    v.nodal[1] = plane->cos_i * y + plane->sin_i * z;
    v.nodal[2] = -plane->sin_i * y + plane->cos_i * z;
    v.p = x * cos_w + v.nodal[1] * sin_w;
    v.q = -x * sin_w + v.nodal[1] * cos_w;
    v.w_sin = v.nodal[2] * sin_w;
    v.w_cos = v.nodal[2] * cos_w;
    return v;
}

/* The averaged disturbing function is quadratic in the direction to the body; with X towards its
 * perigee and Y a quarter turn ahead, STR3's Z(k)1, Z(k)2 / 2 and Z(k)3 are one symmetric bilinear
 * form at (X, X), (X, Y) and (Y, Y). These are the forms. */
typedef struct forms {
    double z3; /* Z3k: perigee and node */
    double z;  /* Zk: mean anomaly */
    double z1; /* Z1k: inclination */
    double z2; /* Z2k: node */
    double h;  /* X1 X3: eccentricity */
} forms;

static forms evaluate_forms(const orbit_vector *u, const orbit_vector *v, double e2) {
    forms f;
    const double *a = u->nodal, *b = v->nodal;
    f.z3 = 12.0 * u->p * v->p - 3.0 * u->q * v->q;
    double z = 3.0 * (a[0] * b[0] + a[1] * b[1]) + e2 * f.z3;
    f.z = 2.0 * z + (1.0 - e2) * f.z3;
    f.z1 = -3.0 * (a[0] * b[2] + a[2] * b[0]) - e2 * (12.0 * (u->p * v->w_cos + v->p * u->w_cos) +
                                                      3.0 * (u->q * v->w_sin + v->q * u->w_sin));
    f.z2 = 3.0 * (a[1] * b[2] + a[2] * b[1]) + e2 * (12.0 * (u->p * v->w_sin + v->p * u->w_sin) -
                                                     3.0 * (u->q * v->w_cos + v->q * u->w_cos));
    f.h = 0.5 * (u->p * v->q + v->p * u->q);
    return f;
}

/* Adds the secular rates of one perturbing body to `deep` and sets its periodic coefficients. */
static void set_body(const bst_sgp4 *s, const perturber *body, double anomaly0, bst_sgp4_deep *deep,
                     bst_sgp4_body *out) {
    const bst_sgp4_plane *plane = &s->plane;
    const double sin_w = sin(s->argp0), cos_w = cos(s->argp0);
    const double sg = body->sin_perigee, cg = body->cos_perigee;
    const double sh = body->sin_node, ch = body->cos_node;
    const double si = body->sin_i, ci = body->cos_i;
    orbit_vector x = make_orbit_vector(cg * ch + sg * ci * sh, -cg * sh + sg * ci * ch, sg * si,
                                       plane, sin_w, cos_w);
    orbit_vector y = make_orbit_vector(-sg * ch + cg * ci * sh, sg * sh + cg * ci * ch, cg * si,
                                       plane, sin_w, cos_w);
    const double e2 = s->e0 * s->e0, beta = sqrt(1.0 - e2);
    forms xx = evaluate_forms(&x, &x, e2);
    forms xy = evaluate_forms(&x, &y, e2);
    forms yy = evaluate_forms(&y, &y, e2);

    const double s3 = body->strength / s->n0;
    const double s2 = -0.5 * s3 / beta;
    const double s4 = s3 * beta;
    const double s1 = -15.0 * s->e0 * s4;

    double node_rate = 0.0;
    if (s->i0 >= NODE_SECULAR_MIN_I && s->i0 <= BST_PI - NODE_SECULAR_MIN_I) {
        node_rate = -body->rate * s2 * (xx.z2 + yy.z2) / plane->sin_i;
    }
    deep->e_rate += body->rate * s1 * (xx.h + yy.h);
    deep->i_rate += body->rate * s2 * (xx.z1 + yy.z1);
    deep->m_rate -= body->rate * s3 * (xx.z + yy.z - 14.0 - 6.0 * e2);
    deep->argp_rate += body->rate * s4 * (xx.z3 + yy.z3 - 6.0) - plane->cos_i * node_rate;
    deep->raan_rate += node_rate;

    out->anomaly0 = anomaly0;
    out->anomaly_rate = body->rate;
    out->two_e = 2.0 * body->eccentricity;
    const double coefficients[BST_SGP4_TERMS][3] = {
        [BST_SGP4_E] = {4.0 * s1 * xy.h, 2.0 * s1 * (yy.h - xx.h), 0.0},
        [BST_SGP4_I] = {4.0 * s2 * xy.z1, 2.0 * s2 * (yy.z1 - xx.z1), 0.0},
        [BST_SGP4_L] = {-4.0 * s3 * xy.z, -2.0 * s3 * (yy.z - xx.z),
                        2.0 * s3 * (21.0 + 9.0 * e2) * body->eccentricity},
        [BST_SGP4_G] = {4.0 * s4 * xy.z3, 2.0 * s4 * (yy.z3 - xx.z3),
                        -18.0 * s4 * body->eccentricity},
        [BST_SGP4_H] = {-4.0 * s2 * xy.z2, -2.0 * s2 * (yy.z2 - xx.z2), 0.0}};
    for (int k = 0; k < BST_SGP4_TERMS; k++) {
        for (int j = 0; j < 3; j++) {
            out->c[k][j] = coefficients[k][j];
        }
    }
}

/* Computes the orbits of Sun and Moon at the epoch and their perturbations of the satellite. */
static void set_sun_and_moon(bst_sgp4 *s, double days) {
    const double sin_raan = sin(s->raan0), cos_raan = cos(s->raan0);
    const double sin_obliquity = 0.39785416, cos_obliquity = 0.91744867;
    perturber sun = {.strength = 2.9864797e-6,
                     .rate = 1.19459e-5,
                     .eccentricity = 0.01675,
                     .sin_perigee = -0.98088458,
                     .cos_perigee = 0.1945905,
                     .sin_i = sin_obliquity,
                     .cos_i = cos_obliquity,
                     .sin_node = sin_raan,
                     .cos_node = cos_raan};
    set_body(s, &sun, fmod(6.2565837 + 0.017201977 * days, BST_SGP4_TWO_PI), &s->deep,
             &s->deep.body[0]);

    /* The Moon's ecliptic node carries its orbit around the pole of the ecliptic. */
    double node = fmod(4.5236020 - 9.2422029e-4 * days, BST_SGP4_TWO_PI);
    double sin_node = sin(node), cos_node = cos(node);
    double cos_i = 0.91375164 - 0.03568096 * cos_node;
    double sin_i = sqrt(1.0 - cos_i * cos_i);
    double sin_h = 0.089683511 * sin_node / sin_i; /* node on the equator */
    double cos_h = sqrt(1.0 - sin_h * sin_h);
    double longitude = 5.8351514 + 0.0019443680 * days;
    double perigee = longitude - node +
                     atan2(sin_obliquity * sin_node / sin_i,
                           cos_h * cos_node + cos_obliquity * sin_h * sin_node);
    perturber moon = {.strength = 4.7968065e-7,
                      .rate = 1.5835218e-4,
                      .eccentricity = 0.05490,
                      .sin_perigee = sin(perigee),
                      .cos_perigee = cos(perigee),
                      .sin_i = sin_i,
                      .cos_i = cos_i,
                      .sin_node = sin_raan * cos_h - cos_raan * sin_h,
                      .cos_node = cos_raan * cos_h + sin_raan * sin_h};
    set_body(s, &moon, fmod(4.7199672 + 0.22997150 * days - longitude, BST_SGP4_TWO_PI), &s->deep,
             &s->deep.body[1]);
}

/* amplitude * exp(-i phase) */
static bst_sgp4_complex phasor(double amplitude, double phase) {
    return (bst_sgp4_complex){amplitude * cos(phase), -amplitude * sin(phase)};
}

static bst_sgp4_complex add(bst_sgp4_complex a, bst_sgp4_complex b) {
    return (bst_sgp4_complex){a.re + b.re, a.im + b.im};
}

static bst_sgp4_complex multiply(bst_sgp4_complex a, bst_sgp4_complex b) {
    return (bst_sgp4_complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

/* Synchronous orbits: tesseral terms (3,1), (2,2), (3,3). */
static void set_one_day(bst_sgp4 *s) {
    bst_sgp4_deep *d = &s->deep;
    const double e2 = s->e0 * s->e0, c = s->plane.cos_i, one_c = 1.0 + c;
    double g200 = 1.0 + e2 * (-2.5 + 0.8125 * e2);
    double g310 = 1.0 + 2.0 * e2;
    double g300 = 1.0 + e2 * (-6.0 + 6.60937 * e2);
    double f220 = 0.75 * one_c * one_c;
    double f311 = 0.9375 * s->plane.sin_i * s->plane.sin_i * (1.0 + 3.0 * c) - 0.75 * one_c;
    double f330 = 1.875 * one_c * one_c * one_c;
    double base = 3.0 * s->n0 * s->n0 / (s->a0 * s->a0);
    d->p[1][1] = phasor(base * f311 * g310 * 2.1460748e-6 / s->a0, 0.13130908);
    d->p[2][1] = phasor(2.0 * base * f220 * g200 * 1.7891679e-6, 2.0 * 2.8843198);
    d->p[3][1] = phasor(3.0 * base * f330 * g300 * 2.2123015e-7 / s->a0, 3.0 * 0.37448087);
    d->lambda0 = fmod(s->m0 + s->raan0 + s->argp0 - d->sidereal0, BST_SGP4_TWO_PI);
    d->lambda_rate = s->m_rate + (s->argp_rate + s->raan_rate) - EARTH_RATE_RADPMIN + d->m_rate +
                     d->argp_rate + d->raan_rate - s->n0;
}

static double cubic(double e, double c0, double c1, double c2, double c3) {
    return c0 + e * (c1 + e * (c2 + e * c3));
}

/* Eccentricity functions of the half-day resonance, fitted by ranges of e (VCHK). */
typedef struct half_day_g {
    double g201, g211, g310, g322, g410, g422, g520, g521, g532, g533;
} half_day_g;

static half_day_g evaluate_half_day_g(double e) {
    half_day_g g;
    g.g201 = -0.306 - (e - 0.64) * 0.440;
    if (e <= 0.65) {
        g.g211 = cubic(e, 3.616, -13.2470, 16.2900, 0.0);
        g.g310 = cubic(e, -19.302, 117.3900, -228.4190, 156.5910);
        g.g322 = cubic(e, -18.9068, 109.7927, -214.6334, 146.5816);
        g.g410 = cubic(e, -41.122, 242.6940, -471.0940, 313.9530);
        g.g422 = cubic(e, -146.407, 841.8800, -1629.014, 1083.4350);
        g.g520 = cubic(e, -532.114, 3017.977, -5740.032, 3708.2760);
    } else {
        g.g211 = cubic(e, -72.099, 331.819, -508.738, 266.724);
        g.g310 = cubic(e, -346.844, 1582.851, -2415.925, 1246.113);
        g.g322 = cubic(e, -342.585, 1554.908, -2366.899, 1215.972);
        g.g410 = cubic(e, -1052.797, 4758.686, -7193.992, 3651.957);
        g.g422 = cubic(e, -3581.690, 16178.110, -24462.770, 12422.520);
        g.g520 = e > 0.715 ? cubic(e, -5149.66, 29936.92, -54087.36, 31324.56)
                           : cubic(e, 1464.74, -4664.75, 3763.64, 0.0);
    }
    if (e < 0.7) {
        g.g533 = cubic(e, -919.22770, 4988.6100, -9064.7700, 5542.21);
        g.g521 = cubic(e, -822.71072, 4568.6173, -8491.4146, 5337.524);
        g.g532 = cubic(e, -853.66600, 4690.2500, -8624.7700, 5341.4);
    } else {
        g.g533 = cubic(e, -37995.780, 161616.52, -229838.20, 109377.94);
        g.g521 = cubic(e, -51752.104, 218913.95, -309468.16, 146349.42);
        g.g532 = cubic(e, -40023.880, 170470.89, -242699.48, 115605.82);
    }
    return g;
}

/* Eccentric half-day orbits: terms (2,2), (3,2), (4,4), (5,2), (5,4). */
static void set_half_day(bst_sgp4 *s) {
    bst_sgp4_deep *d = &s->deep;
    const double c = s->plane.cos_i, si = s->plane.sin_i;
    const double c2 = c * c, s2 = si * si;
    const half_day_g g = evaluate_half_day_g(s->e0);
    double f220 = 0.75 * (1.0 + 2.0 * c + c2);
    double f221 = 1.5 * s2;
    double f321 = 1.875 * si * (1.0 - 2.0 * c - 3.0 * c2);
    double f322 = -1.875 * si * (1.0 + 2.0 * c - 3.0 * c2);
    double f441 = 35.0 * s2 * f220;
    double f442 = 39.3750 * s2 * s2;
    double f522 =
        9.84375 * si * (s2 * (1.0 - 2.0 * c - 5.0 * c2) + 0.33333333 * (-2.0 + 4.0 * c + 6.0 * c2));
    double f523 = si * (4.92187512 * s2 * (-2.0 - 4.0 * c + 10.0 * c2) +
                        6.56250012 * (1.0 + 2.0 * c - 3.0 * c2));
    double f542 = 29.53125 * si * (2.0 - 8.0 * c + c2 * (-12.0 + 8.0 * c + 10.0 * c2));
    double f543 = 29.53125 * si * (-2.0 - 8.0 * c + c2 * (12.0 + 8.0 * c - 10.0 * c2));

    const double inv_a = 1.0 / s->a0;
    const double k2 = 3.0 * s->n0 * s->n0 * inv_a * inv_a; /* degree 2, then 3, 4, 5 */
    const double k3 = k2 * inv_a, k4 = k3 * inv_a, k5 = k4 * inv_a;
    const double r22 = k2 * 1.7891679e-6, r32 = k3 * 3.7393792e-7, r44 = 2.0 * k4 * 7.3636953e-9,
                 r52 = k5 * 1.1428639e-7, r54 = 2.0 * k5 * 2.1765803e-9;
    const double g22 = 5.7686396, g32 = 0.95240898, g44 = 1.8014998, g52 = 1.0508330,
                 g54 = 4.4108898;
    d->p[1][0] = add(phasor(r32 * f322 * g.g322, g32), phasor(r52 * f523 * g.g532, g52));
    d->p[1][1] = phasor(r22 * f221 * g.g211, g22);
    d->p[1][2] = add(phasor(r32 * f321 * g.g310, g32), phasor(r52 * f522 * g.g520, g52));
    d->p[1][3] = phasor(r22 * f220 * g.g201, g22);
    d->p[2][0] = phasor(r54 * f543 * g.g533, g54);
    d->p[2][1] = phasor(r44 * f442 * g.g422, g44);
    d->p[2][2] = phasor(r54 * f542 * g.g521, g54);
    d->p[2][3] = phasor(r44 * f441 * g.g410, g44);
    d->perigee0 = phasor(1.0, -s->argp0);
    d->perigee_step = phasor(1.0, -s->argp_rate * STEP_MIN);
    d->lambda0 = fmod(s->m0 + 2.0 * s->raan0 - 2.0 * d->sidereal0, BST_SGP4_TWO_PI);
    d->lambda_rate =
        s->m_rate + d->m_rate + 2.0 * (s->raan_rate + d->raan_rate - EARTH_RATE_RADPMIN) - s->n0;
}

void bst_sgp4_deep_init(bst_sgp4 *s, double days_1900, double sidereal0) {
    s->deep.sidereal0 = sidereal0;
    set_sun_and_moon(s, days_1900);
    if (s->n0 > 0.0034906585 && s->n0 < 0.0052359877) {
        s->deep.resonance = BST_SGP4_ONE_DAY;
        set_one_day(s);
    } else if (s->n0 >= 8.26e-3 && s->n0 <= 9.24e-3 && s->e0 >= 0.5) {
        s->deep.resonance = BST_SGP4_HALF_DAY;
        set_half_day(s);
    }
}

/* Acceleration of the mean motion at resonance angle lambda, and its derivative with respect to
 * lambda. */
static void resonance_force(const bst_sgp4_deep *d, double lambda, bst_sgp4_complex perigee,
                            double *force, double *slope) {
    bst_sgp4_complex e1 = {cos(lambda), sin(lambda)};
    bst_sgp4_complex e2 = multiply(e1, e1);
    bst_sgp4_complex t1, t2, t3 = {0.0, 0.0};
    if (d->resonance == BST_SGP4_ONE_DAY) {
        t1 = multiply(e1, d->p[1][1]);
        t2 = multiply(e2, d->p[2][1]);
        t3 = multiply(multiply(e1, e2), d->p[3][1]);
    } else {
        bst_sgp4_complex w = perigee, w2 = multiply(w, w), w_back = {w.re, -w.im};
        t1 = add(add(multiply(d->p[1][0], w_back), d->p[1][1]),
                 add(multiply(d->p[1][2], w), multiply(d->p[1][3], w2)));
        t2 = add(add(multiply(d->p[2][0], w_back), d->p[2][1]),
                 add(multiply(d->p[2][2], w), multiply(d->p[2][3], w2)));
        t1 = multiply(e1, t1);
        t2 = multiply(e2, t2);
    }
    *force = t1.im + t2.im + t3.im;
    *slope = t1.re + 2.0 * t2.re + 3.0 * t3.re;
}

/* Taylor step of mean motion and resonance angle by h minutes. */
static void step_resonance(const bst_sgp4_deep *d, double h, bst_sgp4_knot *k) {
    double force, slope;
    resonance_force(d, k->lambda, k->perigee, &force, &slope);
    double rate = k->n + d->lambda_rate;
    slope *= rate;
    k->lambda += h * (rate + 0.5 * h * force);
    k->n += h * (force + 0.5 * h * slope);
}

/* Integrates mean motion and resonance angle from the epoch to t by Taylor steps of 720 min. The
 * reference restarts at the epoch if time reverses; here the states are those of always doing so,
 * though whole steps that the memo has are not repeated. */
double bst_sgp4_resonance_knot(const bst_sgp4 *s, double t, bst_sgp4_knot *out) {
    const bst_sgp4_deep *d = &s->deep;
    const double sign = t < 0.0 ? -1.0 : 1.0;
    const bst_sgp4_complex turn = {d->perigee_step.re, sign * d->perigee_step.im};
    /* the multiples of 720 are exact, and so are the differences: t has a finer spacing */
    double whole = floor(fabs(t) / STEP_MIN);
    double left = fabs(t) - whole * STEP_MIN;
    if (left < 0.0) { /* the quotient was rounded up */
        whole -= 1.0;
        left += STEP_MIN;
    }
    bst_sgp4_knot k = {0.0, s->n0, d->lambda0, d->perigee0}, kept;
    if (whole > 0.0 && bst_sgp4_recall(d->memo, &kept) && sign * kept.steps > 0.0 &&
        sign * kept.steps <= whole) {
        k = kept;
    }
    if (sign * k.steps < whole) {
        while (sign * k.steps < whole) {
            step_resonance(d, sign * STEP_MIN, &k);
            k.perigee = multiply(k.perigee, turn);
            k.steps += sign;
        }
        bst_sgp4_remember(d->memo, &k);
    }
    *out = k;
    return sign * left;
}

double bst_sgp4_step_minutes(const bst_sgp4 *s) {
    return s->deep_space && s->deep.resonance != BST_SGP4_NOT_RESONANT ? STEP_MIN : 0.0;
}

void bst_sgp4_deep_secular(const bst_sgp4 *s, double t, bst_sgp4_mean *x) {
    const bst_sgp4_deep *d = &s->deep;
    x->e += d->e_rate * t;
    x->i += d->i_rate * t;
    x->m += d->m_rate * t;
    x->argp += d->argp_rate * t;
    x->raan += d->raan_rate * t;
    if (d->resonance == BST_SGP4_NOT_RESONANT) {
        return;
    }
    bst_sgp4_knot k;
    double left = bst_sgp4_resonance_knot(s, t, &k);
    step_resonance(d, left, &k);
    x->n = k.n;
    const double lambda = k.lambda;
    double sidereal = fmod(d->sidereal0 + t * EARTH_RATE_RADPMIN, BST_SGP4_TWO_PI);
    x->m = d->resonance == BST_SGP4_ONE_DAY ? lambda + sidereal - x->raan - x->argp
                                            : lambda + 2.0 * (sidereal - x->raan);
}

void bst_sgp4_deep_periodic(const bst_sgp4 *s, double t, bst_sgp4_mean *x, double sin_cos_i[2],
                            double sin_cos_raan[2]) {
    double change[BST_SGP4_TERMS] = {0};
    for (int b = 0; b < 2; b++) {
        const bst_sgp4_body *body = &s->deep.body[b];
        double anomaly = body->anomaly0 + body->anomaly_rate * t;
        double sf = sin(anomaly), cf = cos(anomaly);
        double centre = body->two_e * sf;
        bst_sgp4_turn(anomaly + centre, centre, &sf, &cf);
        double f2 = 0.5 * sf * sf - 0.25, f3 = -0.5 * sf * cf;
        for (int k = 0; k < BST_SGP4_TERMS; k++) {
            change[k] += body->c[k][0] * f2 + body->c[k][1] * f3 + body->c[k][2] * sf;
        }
    }
    const double d_i = change[BST_SGP4_I], d_h = change[BST_SGP4_H];
    x->e += change[BST_SGP4_E];
    x->i += d_i;
    double sin_i = s->plane.sin_i, cos_i = s->plane.cos_i;
    bst_sgp4_turn(x->i, x->i - s->i0, &sin_i, &cos_i);

    double sin_raan, cos_raan;
    if (x->i >= LYDDANE_I) {
        double d_node = d_h / sin_i;
        x->argp += change[BST_SGP4_G] - cos_i * d_node;
        x->raan += d_node;
        x->m += change[BST_SGP4_L];
        sin_raan = sin(x->raan);
        cos_raan = cos(x->raan);
    } else {
        /* Elements that stay regular at the equator: sin i times (sin, cos) of the node. */
        double node = fmod(x->raan, BST_SGP4_TWO_PI);
        if (s->afspc && node < 0.0) {
            node += BST_SGP4_TWO_PI;
        }
        double sin_node = sin(node), cos_node = cos(node);
        double alpha = sin_i * sin_node + (d_h * cos_node + d_i * cos_i * sin_node);
        double beta = sin_i * cos_node + (-d_h * sin_node + d_i * cos_i * cos_node);
        double length = sqrt(alpha * alpha + beta * beta);
        sin_raan = length > 0.0 ? alpha / length : 0.0;
        cos_raan = length > 0.0 ? beta / length : 1.0;
        double moved = atan2(alpha, beta);
        if (s->afspc && moved < 0.0) {
            moved += BST_SGP4_TWO_PI;
        }
        if (moved - node > BST_PI) {
            moved -= BST_SGP4_TWO_PI;
        } else if (node - moved > BST_PI) {
            moved += BST_SGP4_TWO_PI;
        }
        /* the change of the longitude M + perigee + node cos i is applied as a whole */
        x->argp += change[BST_SGP4_G] - d_i * node * sin_i + cos_i * (node - moved);
        x->m += change[BST_SGP4_L];
        x->raan = moved;
    }
    if (x->i < 0.0) {
        x->i = -x->i;
        sin_i = -sin_i;
        x->raan += BST_PI;
        x->argp -= BST_PI;
        sin_raan = -sin_raan;
        cos_raan = -cos_raan;
    }
    sin_cos_i[0] = sin_i;
    sin_cos_i[1] = cos_i;
    sin_cos_raan[0] = sin_raan;
    sin_cos_raan[1] = cos_raan;
}
