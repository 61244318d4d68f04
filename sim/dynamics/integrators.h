/* Fixed-step integrators: Runge and Kutta's for anything, the symplectic one for the attitude of a
 * rigid body with wheels, and exact steps of linear systems. docs/how-to/spacecraft.md has their
 * errors against the step. */
#ifndef BST_DYNAMICS_INTEGRATORS_H
#define BST_DYNAMICS_INTEGRATORS_H

#include "boresight/vec.h"

/* How the attitude is stepped; the names a scenario gives. */
typedef enum bst_integrator {
    BST_INTEGRATE_SYMPLECTIC,  /* "symplectic": second order, about 60 ns a step */
    BST_INTEGRATE_SYMPLECTIC4, /* "symplectic4": fourth order, five of the former */
    BST_INTEGRATE_RK4,         /* "rk4" */
} bst_integrator;

/* NULL-terminated, in the order of bst_integrator. */
extern const char *const bst_integrator_names[];

/* Most variables of bst_dynamics_rk4_step, and rows of the matrices below. */
#define BST_RK4_MOST 32
#define BST_LINEAR_MOST 20

/* rate[count] = dy/dt at y[count]. */
typedef void (*bst_dynamics_rate_fn)(const void *user, const double *y, double *rate);

/* One step of dt_s of the classical fourth-order Runge-Kutta method, in place; count at most
 * BST_RK4_MOST. What the rate depends on besides y is held over the step. */
void bst_dynamics_rk4_step(bst_dynamics_rate_fn rate, const void *user, int count, double dt_s,
                           double *y);

/* A gyrostat in principal axes: angular velocity (pi - shift) / moment, pi its whole angular
 * momentum and shift that of the wheels and modes in it. */
typedef struct bst_dynamics_free_body {
    double per_moment[3]; /* 1 / (kg m^2) */
    double shift[3];      /* N m s, constant */
} bst_dynamics_free_body;

/* Turns attitude q_from_gcrf (of the principal axes) and angular momentum pi (principal axes) of a
 * torque-free gyrostat over dt_s: rotations about x, y, z, y, x in turn, each of them the exact
 * motion under its part of the energy. Symplectic, symmetric in time, keeps the angular momentum
 * in GCRF to rounding; the energy's error stays within bounds that fall with dt_s^2.
 * McLachlan, Phys. Rev. Lett. 71 (1993) 3043; Reich, Physica D 76 (1994) 375; the wheels' constant
 * shift leaves each part a rotation. */
void bst_dynamics_turn_free_body(const bst_dynamics_free_body *body, double dt_s,
                                 bst_quat *q_from_gcrf, double pi[3]);
/* The same to fourth order: five such steps of s, s, 1 - 4 s, s, s times dt_s with s = 1 / (4 -
 * 4^(1/3)). Suzuki, Phys. Lett. A 146 (1990) 319. */
void bst_dynamics_turn_free_body4(const bst_dynamics_free_body *body, double dt_s,
                                  bst_quat *q_from_gcrf, double pi[3]);

/* out = exp(a) of an n by n matrix (row-major, n at most BST_LINEAR_MOST), by its Taylor series
 * with scaling and squaring: relative errors of about 1e-15 of the largest element. An x' = A x + B
 * w with constant w steps exactly by exp(dt [A B; 0 0]). */
void bst_dynamics_matrix_exp(int n, const double *a, double *out);

/* Eigenvalues (ascending) and, where vectors is not NULL, unit eigenvectors (column k of the
 * row-major n by n matrix, right-handed for n = 3) of a symmetric matrix, by Jacobi's rotations; n
 * at most BST_LINEAR_MOST. Golub and Van Loan, Matrix Computations, section 8.5. */
void bst_dynamics_symmetric_eigen(int n, const double *a, double *values, double *vectors);

#endif
