/* Element sets side by side, for SGP4 on vectors: the constants of eight propagators, one row of
 * eight numbers per constant. */
#ifndef BST_ASTRO_SGP4_LANES_H
#define BST_ASTRO_SGP4_LANES_H

#include "sim/astro/sgp4_internal.h"

enum { BST_SGP4_LANES = 8 };

/* Rows that every set has: name, value of the propagator `s`. A set whose drag polynomials end
 * early has zeros in the rest of them. */
#define BST_SGP4_ROWS(X)                 \
    X(RADIUS_KM, s->k.radius_km)         \
    X(SPEED_KMPS, s->k.speed_kmps)       \
    X(J2, s->k.j2)                       \
    X(N0, s->n0)                         \
    X(A0, s->a0)                         \
    X(E0, s->e0)                         \
    X(I0, s->i0)                         \
    X(M0, s->m0)                         \
    X(ARGP0, s->argp0)                   \
    X(RAAN0, s->raan0)                   \
    X(M_RATE, s->m_rate)                 \
    X(ARGP_RATE, s->argp_rate)           \
    X(RAAN_RATE, s->raan_rate)           \
    X(RAAN_DRAG, s->raan_drag)           \
    X(A_DRAG_1, s->a_drag[0])            \
    X(E_DRAG, s->e_drag)                 \
    X(L_DRAG_2, s->l_drag[0])            \
    X(SIN_I, s->plane.sin_i)             \
    X(COS_I, s->plane.cos_i)             \
    X(Y_LONG, s->plane.y_long)           \
    X(L_LONG, s->plane.l_long)           \
    X(THREE_C2_M1, s->plane.three_c2_m1) \
    X(ONE_M_C2, s->plane.one_m_c2)       \
    X(SEVEN_C2_M1, s->plane.seven_c2_m1)

/* Rows of near-Earth sets. */
#define BST_SGP4_NEAR_ROWS(X)                          \
    X(SHORT_DRAG, s->short_drag ? 1.0 : 0.0)           \
    X(A_DRAG_2, s->short_drag ? 0.0 : s->a_drag[1])    \
    X(A_DRAG_3, s->short_drag ? 0.0 : s->a_drag[2])    \
    X(A_DRAG_4, s->short_drag ? 0.0 : s->a_drag[3])    \
    X(E_DRAG_SIN, s->short_drag ? 0.0 : s->e_drag_sin) \
    X(L_DRAG_3, s->short_drag ? 0.0 : s->l_drag[1])    \
    X(L_DRAG_4, s->short_drag ? 0.0 : s->l_drag[2])    \
    X(L_DRAG_5, s->short_drag ? 0.0 : s->l_drag[3])    \
    X(ETA, s->short_drag ? 0.0 : s->eta)               \
    X(ARGP_DRAG, s->short_drag ? 0.0 : s->argp_drag)   \
    X(M_DRAG, s->short_drag ? 0.0 : s->m_drag)         \
    X(CUBE_M0, s->short_drag ? 0.0 : s->cube_m0)       \
    X(SIN_M0, s->short_drag ? 0.0 : s->sin_m0)

#define BST_SGP4_BODY_ROWS(X, NAME, b) \
    X(NAME##_ANOMALY0, b.anomaly0)     \
    X(NAME##_RATE, b.anomaly_rate)     \
    X(NAME##_TWO_E, b.two_e)           \
    X(NAME##_E_1, b.c[BST_SGP4_E][0])  \
    X(NAME##_E_2, b.c[BST_SGP4_E][1])  \
    X(NAME##_E_3, b.c[BST_SGP4_E][2])  \
    X(NAME##_I_1, b.c[BST_SGP4_I][0])  \
    X(NAME##_I_2, b.c[BST_SGP4_I][1])  \
    X(NAME##_I_3, b.c[BST_SGP4_I][2])  \
    X(NAME##_L_1, b.c[BST_SGP4_L][0])  \
    X(NAME##_L_2, b.c[BST_SGP4_L][1])  \
    X(NAME##_L_3, b.c[BST_SGP4_L][2])  \
    X(NAME##_G_1, b.c[BST_SGP4_G][0])  \
    X(NAME##_G_2, b.c[BST_SGP4_G][1])  \
    X(NAME##_G_3, b.c[BST_SGP4_G][2])  \
    X(NAME##_H_1, b.c[BST_SGP4_H][0])  \
    X(NAME##_H_2, b.c[BST_SGP4_H][1])  \
    X(NAME##_H_3, b.c[BST_SGP4_H][2])

/* Rows of deep-space sets. */
#define BST_SGP4_DEEP_ROWS(X)                   \
    X(E_RATE, s->deep.e_rate)                   \
    X(I_RATE, s->deep.i_rate)                   \
    X(M_SECULAR, s->deep.m_rate)                \
    X(ARGP_SECULAR, s->deep.argp_rate)          \
    X(RAAN_SECULAR, s->deep.raan_rate)          \
    X(J3_OVER_J2, s->k.j3_over_j2)              \
    X(AFSPC, s->afspc ? 1.0 : 0.0)              \
    BST_SGP4_BODY_ROWS(X, SUN, s->deep.body[0]) \
    BST_SGP4_BODY_ROWS(X, MOON, s->deep.body[1])

#define BST_SGP4_FORCE_ROWS(X, NAME, p) X(NAME##_RE, p.re) X(NAME##_IM, p.im)

/* Rows of resonant sets; the last five change with time, see bst_sgp4_resonance_knot. */
#define BST_SGP4_RESONANT_ROWS(X)                                 \
    X(ONE_DAY, s->deep.resonance == BST_SGP4_ONE_DAY ? 1.0 : 0.0) \
    X(KE, s->k.ke)                                                \
    X(SIDEREAL0, s->deep.sidereal0)                               \
    X(LAMBDA_RATE, s->deep.lambda_rate)                           \
    BST_SGP4_FORCE_ROWS(X, P10, s->deep.p[1][0])                  \
    BST_SGP4_FORCE_ROWS(X, P11, s->deep.p[1][1])                  \
    BST_SGP4_FORCE_ROWS(X, P12, s->deep.p[1][2])                  \
    BST_SGP4_FORCE_ROWS(X, P13, s->deep.p[1][3])                  \
    BST_SGP4_FORCE_ROWS(X, P20, s->deep.p[2][0])                  \
    BST_SGP4_FORCE_ROWS(X, P21, s->deep.p[2][1])                  \
    BST_SGP4_FORCE_ROWS(X, P22, s->deep.p[2][2])                  \
    BST_SGP4_FORCE_ROWS(X, P23, s->deep.p[2][3])                  \
    BST_SGP4_FORCE_ROWS(X, P31, s->deep.p[3][1])                  \
    X(KNOT_LEFT, 0.0)                                             \
    X(KNOT_N, 0.0)                                                \
    X(KNOT_LAMBDA, 0.0)                                           \
    BST_SGP4_FORCE_ROWS(X, KNOT_PERIGEE, s->deep.perigee0)

/* Indices of the rows. Near-Earth and deep-space rows share places. */
#define BST_SGP4_ROW(name, value) BST_SGP4_##name##_ROW,
enum { BST_SGP4_ROWS(BST_SGP4_ROW) BST_SGP4_OWN_ROWS };
enum {
    BST_SGP4_NEAR_START = BST_SGP4_OWN_ROWS - 1,
    BST_SGP4_NEAR_ROWS(BST_SGP4_ROW) BST_SGP4_NEAR_END
};
enum {
    BST_SGP4_DEEP_START = BST_SGP4_OWN_ROWS - 1,
    BST_SGP4_DEEP_ROWS(BST_SGP4_ROW) BST_SGP4_RESONANT_ROWS(BST_SGP4_ROW) BST_SGP4_ROW_COUNT
};
#undef BST_SGP4_ROW

typedef enum bst_sgp4_kind {
    BST_SGP4_NEAR,
    BST_SGP4_DEEP,
    BST_SGP4_RESONANT,
    BST_SGP4_KINDS
} bst_sgp4_kind;

/* Eight sets of one kind, each at its own time. */
typedef struct bst_sgp4_lanes {
    _Alignas(64) double row[BST_SGP4_ROW_COUNT][BST_SGP4_LANES];
    double minutes[BST_SGP4_LANES];
    double state[6][BST_SGP4_LANES]; /* out: TEME, km and km/s */
    double valid[BST_SGP4_LANES];    /* out: 1, or 0 where the scalar code has to judge the set */
} bst_sgp4_lanes;

/* Propagates eight sets with the vectors of this processor. |minutes| <= 2e6. */
void bst_sgp4_propagate_lanes(bst_sgp4_kind kind, bst_sgp4_lanes *lanes);

/* A resonant orbit at the last whole integration step before t, and the time from there, min, with
 * its sign. */
double bst_sgp4_resonance_knot(const bst_sgp4 *s, double t, bst_sgp4_knot *knot);

#endif
