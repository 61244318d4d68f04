/* Fixed-step integrators: Runge-Kutta for general equations, symplectic for the attitude of a rigid
 * body with wheels, exact steps of linear systems. Errors by step size:
 * docs/how-to/spacecraft.md. */
#ifndef BST_DYNAMICS_INTEGRATORS_H
#define BST_DYNAMICS_INTEGRATORS_H

#include "boresight/vec.h"

/* Attitude integrators, with their names in scenarios. */
typedef enum bst_integrator {
    BST_INTEGRATE_SYMPLECTIC,  /* "symplectic": second order, about 60 ns a step */
    BST_INTEGRATE_SYMPLECTIC4, /* "symplectic4": fourth order, five steps of the former */
    BST_INTEGRATE_RK4,         /* "rk4" */
} bst_integrator;

/* NULL-terminated, in the order of bst_integrator. */
extern const char *const bst_integrator_names[];

/* maximum number of variables of bst_dynamics_rk4_step, and rows of the matrices below */
#define BST_RK4_MOST 32
#define BST_LINEAR_MOST 20

/* rate[count] = dy/dt at y[count]. */
typedef void (*bst_dynamics_rate_fn)(const void *user, const double *y, double *rate);

/* One step of dt_s of the classical fourth-order Runge-Kutta method, in place; count at most
 * BST_RK4_MOST. Other inputs of the rate are constant over the step. */
void bst_dynamics_rk4_step(bst_dynamics_rate_fn rate, const void *user, int count, double dt_s,
                           double *y);

/* A gyrostat in principal axes: angular velocity (pi - shift) / moment; pi: total angular momentum;
 * shift: that of wheels and modes. */
typedef struct bst_dynamics_free_body {
    double per_moment[3]; /* 1 / (kg m^2) */
    double shift[3];      /* N m s, constant */
} bst_dynamics_free_body;

/* Propagates attitude q_from_gcrf (of the principal axes) and angular momentum pi (principal axes)
 * of a torque-free gyrostat over dt_s: rotations about x, y, z, y, x, each the exact motion under
 * its part of the energy. Symplectic, time-symmetric, conserves the angular momentum in GCRF to
 * rounding; the energy error is bounded in proportion to dt_s^2. McLachlan, Phys. Rev. Lett. 71
 * (1993) 3043; Reich, Physica D 76 (1994) 375; the wheels' constant shift leaves each part a
 * rotation. */
void bst_dynamics_turn_free_body(const bst_dynamics_free_body *body, double dt_s,
                                 bst_quat *q_from_gcrf, double pi[3]);
/* Propagates a torque-free gyrostat to fourth order: five steps of bst_dynamics_turn_free_body with
 * s, s, 1 - 4 s, s, s times dt_s, s = 1 / (4 - 4^(1/3)). Suzuki, Phys. Lett. A 146 (1990) 319. */
void bst_dynamics_turn_free_body4(const bst_dynamics_free_body *body, double dt_s,
                                  bst_quat *q_from_gcrf, double pi[3]);

/* Matrix exponential: out = exp(a) of an n by n matrix (row-major, n at most BST_LINEAR_MOST), by
 * Taylor series with scaling and squaring; relative error about 1e-15 of the largest element. x' =
 * A x + B w with constant w steps exactly by exp(dt [A B; 0 0]). */
void bst_dynamics_matrix_exp(int n, const double *a, double *out);

/* Eigenvalues (ascending) and, where vectors is not NULL, unit eigenvectors (column k of the
 * row-major n by n matrix, right-handed for n = 3) of a symmetric matrix, by Jacobi's rotations; n
 * at most BST_LINEAR_MOST. Golub and Van Loan, Matrix Computations, section 8.5. */
void bst_dynamics_symmetric_eigen(int n, const double *a, double *values, double *vectors);

#endif
