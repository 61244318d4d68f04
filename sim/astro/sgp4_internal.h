/* Internal types of SGP4: the initialised satellite and small helper functions.
 *
 * Units inside the model: Earth radii, minutes, radians. Sources, cited by these names:
 * STR3: Hoots and Roehrich, "Models for propagation of NORAD element sets", Spacetrack Report 3,
 *   1980. VCHK: Vallado, Crawford, Hujsak and Kelso, "Revisiting Spacetrack Report #3",
 *   AIAA 2006-6753. HSG: Hoots, Schumacher and Glover, "History of analytical orbit modeling in the
 *   U.S. space surveillance system", J. Guidance 27(2), 2004. */
#ifndef BST_ASTRO_SGP4_INTERNAL_H
#define BST_ASTRO_SGP4_INTERNAL_H

#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "boresight/vec.h"
#include "sim/astro/sgp4.h"

#define BST_SGP4_TWO_PI (2.0 * BST_PI)
#define BST_SGP4_EARTH_RATE_RADPMIN 4.37526908801129966e-3
/* below 0.2 rad the luni-solar periodics of node and perigee follow Lyddane (1963) */
#define BST_SGP4_LYDDANE_I 0.2
/* mean eccentricity: below the first is an error, and the second is the least (VCHK) */
#define BST_SGP4_LEAST_E -0.001
#define BST_SGP4_ROUND_E 1e-6
/* Newton's method for Kepler's equation */
#define BST_SGP4_KEPLER_STEPS 10
#define BST_SGP4_KEPLER_LONGEST_STEP 0.95

typedef struct bst_sgp4_complex {
    double re, im;
} bst_sgp4_complex;

/* A gravity model with the constants that the equations use. */
typedef struct bst_sgp4_constants {
    double radius_km;  /* equatorial radius */
    double ke;         /* sqrt(GM), Earth radii^1.5 / min */
    double j2, j4;     /* zonal harmonics */
    double j3_over_j2; /* J3 / J2 */
    double speed_kmps; /* km/s of one Earth radius times ke per minute */
} bst_sgp4_constants;

/* Functions of the inclination for long and short periodics. */
typedef struct bst_sgp4_plane {
    double sin_i, cos_i;
    double y_long;      /* long-period term in e sin(perigee), times 1 / p */
    double l_long;      /* long-period term in the mean longitude, times e cos(perigee) / p */
    double three_c2_m1; /* 3 cos^2 i - 1 */
    double one_m_c2;    /* 1 - cos^2 i */
    double seven_c2_m1; /* 7 cos^2 i - 1 */
} bst_sgp4_plane;

/* elements with luni-solar periodics, in the order of the coefficient table */
enum { BST_SGP4_E, BST_SGP4_I, BST_SGP4_L, BST_SGP4_G, BST_SGP4_H, BST_SGP4_TERMS };

/* Periodic perturbation by Sun or Moon: element k changes by c[k][0] (sin^2 f / 2 - 1/4) - c[k][1]
 * (sin f cos f) / 2 + c[k][2] sin f. */
typedef struct bst_sgp4_body {
    double anomaly0, anomaly_rate; /* mean anomaly at the epoch, rad, and its rate, rad/min */
    double two_e;                  /* twice the eccentricity of its orbit */
    double c[BST_SGP4_TERMS][3];
} bst_sgp4_body;

typedef enum bst_sgp4_resonance {
    BST_SGP4_NOT_RESONANT,
    BST_SGP4_ONE_DAY,
    BST_SGP4_HALF_DAY
} bst_sgp4_resonance;

/* A resonant orbit after whole integration steps from the epoch. */
typedef struct bst_sgp4_knot {
    double steps;     /* their number, with the sign of the time */
    double n, lambda; /* mean motion and resonance angle */
    bst_sgp4_complex perigee;
} bst_sgp4_knot;

/* The knot that was last integrated, so that the next time needs not begin at the epoch. A knot
 * depends on its number of steps alone: which one is kept changes no result. Threads share it: odd
 * versions mark a write (a sequence lock); a thread that meets one goes without. */
typedef struct bst_sgp4_memo {
    atomic_uint version; /* 0: empty */
    _Atomic double steps, n, lambda, perigee_re, perigee_im;
} bst_sgp4_memo;

/* Deep-space part: mean elements change by Sun, Moon and resonance with the geopotential. */
typedef struct bst_sgp4_deep {
    double e_rate, i_rate, m_rate, argp_rate, raan_rate; /* secular, by Sun and Moon */
    bst_sgp4_body body[2];                               /* Sun, Moon */
    bst_sgp4_resonance resonance;
    double sidereal0; /* Greenwich sidereal time at the epoch, rad */
    double lambda0,
        lambda_rate; /* resonance angle at the epoch; its rate without the change of n */
    /* Force on the mean motion: Im sum_k exp(i k lambda) P_k, k = 1..3. One-day: P_k = p[k][1].
     * Half-day: P_k = sum_j p[k][j] exp(i (j - 1) perigee), j = 0..3. */
    bst_sgp4_complex p[4][4];
    bst_sgp4_complex perigee0, perigee_step; /* exp(i perigee) at epoch, and its turn in a step */
    bst_sgp4_memo *memo; /* NULL: not resonant; the one part that changes, see there */
} bst_sgp4_deep;

struct bst_sgp4 {
    bst_sgp4_gravity gravity;
    bst_sgp4_constants k;
    bool deep_space;
    bool short_drag; /* perigee under 220 km or deep space: drag polynomials end early */
    bool afspc;
    double n0, a0, e0, i0, m0, argp0, raan0; /* mean elements, Brouwer mean motion and its a */
    double m_rate, argp_rate, raan_rate;     /* secular rates by J2, J4 */
    double raan_drag;                        /* node, times t^2 */
    double a_drag[4];                        /* sqrt(a / a0) = 1 - sum a_drag[k] t^(k+1) */
    double e_drag, e_drag_sin;               /* e = e0 - e_drag t - e_drag_sin (sin M - sin M0) */
    double e_drag_oblate;                    /* part of e_drag that a circular orbit has: by J2 */
    double l_drag[4];                        /* mean longitude gains sum l_drag[k] t^(k+2) */
    double eta, argp_drag, m_drag;           /* STR3: eta and the rates of delta omega, delta M */
    double cube_m0, sin_m0;                  /* (1 + eta cos M0)^3, sin M0 */
    bst_sgp4_plane plane;
    bst_sgp4_deep deep;
    const bst_sgp4 *middle; /* NULL, or the set whose displacement by drag it has, not its own */
};

/* Mean elements at one time. */
typedef struct bst_sgp4_mean {
    double n, e, i, m, argp, raan;
} bst_sgp4_mean;

/* sin and cos of angle + turn from those of angle; total = angle + turn. Small rotations by series,
 * accurate to 1e-17. */
static inline void bst_sgp4_turn(double total, double turn, double *sine, double *cosine) {
    if (!(fabs(turn) < 0.125)) {
        *sine = sin(total);
        *cosine = cos(total);
        return;
    }
    double x = turn * turn;
    double s_turn =
        turn - turn * x * (1.0 / 6 - x * (1.0 / 120 - x * (1.0 / 5040 - x * (1.0 / 362880))));
    double c_less_1 =
        -x * (0.5 - x * (1.0 / 24 - x * (1.0 / 720 - x * (1.0 / 40320 - x * (1.0 / 3628800)))));
    double s = *sine, c = *cosine;
    *sine = s + (s * c_less_1 + c * s_turn);
    *cosine = c + (c * c_less_1 - s * s_turn);
}

/* Fills the functions of the inclination (STR3 section 6, long and short periodics). */
void bst_sgp4_set_plane(const bst_sgp4_constants *k, double sin_i, double cos_i,
                        bst_sgp4_plane *plane);

/* Deep-space part of create: `days_1900` is the epoch in days since JD 2415020.0; the mean elements
 * and rates of `s` are set. */
void bst_sgp4_deep_init(bst_sgp4 *s, double days_1900, double sidereal0);

/* Secular effect of Sun and Moon and resonance: moves the mean elements, n included, to time
 * t. */
void bst_sgp4_deep_secular(const bst_sgp4 *s, double t, bst_sgp4_mean *x);

/* The knot that a memo holds; false: none, or another thread is writing it. */
bool bst_sgp4_recall(bst_sgp4_memo *memo, bst_sgp4_knot *knot);

/* Keeps a knot, unless another thread is writing one. */
void bst_sgp4_remember(bst_sgp4_memo *memo, const bst_sgp4_knot *knot);

/* Adds the periodics of Sun and Moon to the elements; gives sin and cos of the new inclination and
 * of the new node. On return i >= 0. */
void bst_sgp4_deep_periodic(const bst_sgp4 *s, double t, bst_sgp4_mean *x, double sin_cos_i[2],
                            double sin_cos_raan[2]);

#endif
