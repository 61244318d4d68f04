#include "sim/dynamics/integrators.h"

#include <assert.h>
#include <stdbool.h>
#include <string.h>

const char *const bst_integrator_names[] = {"symplectic", "symplectic4", "rk4", NULL};

void bst_dynamics_rk4_step(bst_dynamics_rate_fn rate, const void *user, int count, double dt_s,
                           double *y) {
    assert(count <= BST_RK4_MOST);
    static const double node[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
    double stage[BST_RK4_MOST], slope[BST_RK4_MOST] = {0}, sum[BST_RK4_MOST] = {0};
    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < count; i++) {
            stage[i] = y[i] + node[s] * dt_s * slope[i];
        }
        rate(user, stage, slope);
        for (int i = 0; i < count; i++) {
            sum[i] += weight[s] * slope[i];
        }
    }
    for (int i = 0; i < count; i++) {
        y[i] += dt_s / 6.0 * sum[i];
    }
}

/* Sine and cosine; for small angles by series, accurate to rounding and three times as fast. */
static inline void sine_cosine(double h, double *s, double *c) {
    double h2 = h * h;
    if (h2 < 4e-4) {
        *s = h * (1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0)));
        *c = 1.0 - h2 / 2.0 * (1.0 - h2 / 12.0 * (1.0 - h2 / 30.0 * (1.0 - h2 / 56.0)));
    } else {
        *s = sin(h);
        *c = cos(h);
    }
}

/* Motion under one axis's part of the kinetic energy: the body rotates about axis i at a constant
 * rate. q: {x, y, z, w}. */
static inline void turn_about(const bst_dynamics_free_body *body, int i, double dt_s, double q[4],
                              double pi[3]) {
    int j = i == 2 ? 0 : i + 1, k = 3 - i - j;
    double s, c;
    sine_cosine(0.5 * dt_s * (pi[i] - body->shift[i]) * body->per_moment[i], &s, &c);
    double sin2 = 2.0 * s * c, versine = 2.0 * s * s;
    double pj = pi[j], pk = pi[k];
    pi[j] = pj - versine * pj + sin2 * pk;
    pi[k] = pk - versine * pk - sin2 * pj;
    /* from_rotvec(-angle e_i) * q */
    double qi = q[i], qj = q[j], qk = q[k], qw = q[3];
    q[i] = c * qi - s * qw;
    q[j] = c * qj + s * qk;
    q[k] = c * qk - s * qj;
    q[3] = c * qw + s * qi;
}

void bst_dynamics_turn_free_body(const bst_dynamics_free_body *body, double dt_s,
                                 bst_quat *q_from_gcrf, double pi[3]) {
    double q[4] = {q_from_gcrf->x, q_from_gcrf->y, q_from_gcrf->z, q_from_gcrf->w};
    turn_about(body, 0, 0.5 * dt_s, q, pi);
    turn_about(body, 1, 0.5 * dt_s, q, pi);
    turn_about(body, 2, dt_s, q, pi);
    turn_about(body, 1, 0.5 * dt_s, q, pi);
    turn_about(body, 0, 0.5 * dt_s, q, pi);
    *q_from_gcrf = (bst_quat){q[0], q[1], q[2], q[3]};
}

void bst_dynamics_turn_free_body4(const bst_dynamics_free_body *body, double dt_s,
                                  bst_quat *q_from_gcrf, double pi[3]) {
    const double s = 0.41449077179437573714; /* 1 / (4 - 4^(1/3)) */
    bst_dynamics_turn_free_body(body, s * dt_s, q_from_gcrf, pi);
    bst_dynamics_turn_free_body(body, s * dt_s, q_from_gcrf, pi);
    bst_dynamics_turn_free_body(body, (1.0 - 4.0 * s) * dt_s, q_from_gcrf, pi);
    bst_dynamics_turn_free_body(body, s * dt_s, q_from_gcrf, pi);
    bst_dynamics_turn_free_body(body, s * dt_s, q_from_gcrf, pi);
}

static void multiply(int n, const double *a, const double *b, double *out) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) {
                sum += a[i * n + k] * b[k * n + j];
            }
            out[i * n + j] = sum;
        }
    }
}

void bst_dynamics_matrix_exp(int n, const double *a, double *out) {
    assert(n <= BST_LINEAR_MOST);
    double scaled[BST_LINEAR_MOST * BST_LINEAR_MOST], term[BST_LINEAR_MOST * BST_LINEAR_MOST],
        next[BST_LINEAR_MOST * BST_LINEAR_MOST];
    double norm = 0.0; /* largest row sum */
    for (int i = 0; i < n; i++) {
        double sum = 0.0;
        for (int j = 0; j < n; j++) {
            sum += fabs(a[i * n + j]);
        }
        norm = fmax(norm, sum);
    }
    int squarings = 0;
    while (norm > 0.25) {
        norm *= 0.5;
        squarings++;
    }
    size_t cells = (size_t)(n * n);
    for (size_t i = 0; i < cells; i++) {
        scaled[i] = ldexp(a[i], -squarings);
    }
    memset(out, 0, cells * sizeof *out);
    for (int i = 0; i < n; i++) {
        out[i * n + i] = 1.0;
    }
    memcpy(term, out, cells * sizeof *term);
    for (int order = 1; order <= 14; order++) { /* 0.25^15 / 15! < 1e-21 */
        multiply(n, term, scaled, next);
        for (size_t i = 0; i < cells; i++) {
            term[i] = next[i] / order;
            out[i] += term[i];
        }
    }
    for (int s = 0; s < squarings; s++) {
        multiply(n, out, out, next);
        memcpy(out, next, cells * sizeof *out);
    }
}

/* Jacobi rotation that zeroes a[p][q]. */
static void rotate(int n, double *a, double *v, int p, int q) {
    double apq = a[p * n + q];
    double theta = 0.5 * (a[q * n + q] - a[p * n + p]) / apq;
    double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
    double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
    for (int k = 0; k < n; k++) {
        double x = a[k * n + p], y = a[k * n + q];
        a[k * n + p] = c * x - s * y;
        a[k * n + q] = s * x + c * y;
    }
    for (int k = 0; k < n; k++) {
        double x = a[p * n + k], y = a[q * n + k];
        a[p * n + k] = c * x - s * y;
        a[q * n + k] = s * x + c * y;
        x = v[k * n + p];
        y = v[k * n + q];
        v[k * n + p] = c * x - s * y;
        v[k * n + q] = s * x + c * y;
    }
    a[p * n + q] = a[q * n + p] = 0.0;
}

void bst_dynamics_symmetric_eigen(int n, const double *a, double *values, double *vectors) {
    assert(n <= BST_LINEAR_MOST);
    double m[BST_LINEAR_MOST * BST_LINEAR_MOST], v[BST_LINEAR_MOST * BST_LINEAR_MOST] = {0};
    size_t cells = (size_t)(n * n);
    memcpy(m, a, cells * sizeof *m);
    double size = 0.0;
    for (int i = 0; i < n; i++) {
        v[i * n + i] = 1.0;
        for (int j = 0; j < n; j++) {
            size = fmax(size, fabs(m[i * n + j]));
        }
    }
    for (int sweep = 0; sweep < 50; sweep++) {
        bool clear = true;
        for (int p = 0; p < n; p++) {
            for (int q = p + 1; q < n; q++) {
                if (fabs(m[p * n + q]) > 1e-17 * size) {
                    rotate(n, m, v, p, q);
                    clear = false;
                }
            }
        }
        if (clear) {
            break;
        }
    }
    for (int k = 0; k < n;
         k++) { /* selection sort: the smallest remaining value goes to position k */
        int least = k;
        for (int i = k + 1; i < n; i++) {
            least = m[i * n + i] < m[least * n + least] ? i : least;
        }
        values[k] = m[least * n + least];
        m[least * n + least] = m[k * n + k];
        for (int i = 0; i < n; i++) {
            double held = v[i * n + k];
            v[i * n + k] = v[i * n + least];
            v[i * n + least] = held;
        }
    }
    if (!vectors) {
        return;
    }
    memcpy(vectors, v, cells * sizeof *vectors);
    if (n == 3) {
        bst_vec3 x = {v[0], v[3], v[6]}, y = {v[1], v[4], v[7]}, z = {v[2], v[5], v[8]};
        if (bst_vec3_dot(bst_vec3_cross(x, y), z) < 0.0) {
            for (int i = 0; i < 3; i++) {
                vectors[i * 3 + 2] = -vectors[i * 3 + 2];
            }
        }
    }
}
