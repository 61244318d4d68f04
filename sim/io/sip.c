#include "sim/io/sip.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/invariant.h"
#include "sim/io/tangent.h"

enum { NODES = 16, GRID = 15, ROUNDS = 3, N = BST_SIP_ORDER + 1 };

static const double LEFT_OUT_PX = 1e-5; /* truncation limit that selects the polynomial order */
static const double INVERSE_PX = 1e-4;  /* required accuracy of the inverse */

/* Mapping from pixels to catalogue directions. */
typedef struct mapping {
    const bst_camera *camera;
    bst_quat q_gcrf_from_cam;
    const bst_light *light;
    double x0, y0;         /* boresight */
    double cx, cy, hx, hy; /* centre and half size of the sensor, px */
} mapping;

/* ICRS direction of a light ray that falls on a pixel position. */
static bst_vec3 place(const mapping *m, double x, double y) {
    bst_vec3 cam = bst_camera_unproject(m->camera, x, y);
    return bst_light_catalogue_star(m->light, bst_quat_rotate(m->q_gcrf_from_cam, cam));
}

/* Value of a SIP polynomial at (u, v). */
static double evaluate(const double *c, int order, double u, double v) {
    double sum = 0.0, row = 1.0;
    for (int p = 0; p <= order; p++, row *= u) {
        double term = row;
        for (int q = 0; p + q <= order; q++, term *= v) {
            sum += c[bst_sip_term(p, q)] * term;
        }
    }
    return sum;
}

/* rows[i]: coefficients of T_i(s + shift) in powers of s. */
static void chebyshev_rows(double shift, double rows[N][N]) {
    memset(rows, 0, N * N * sizeof(double));
    rows[0][0] = 1.0;
    rows[1][0] = shift;
    rows[1][1] = 1.0;
    for (int i = 2; i < N; i++) {
        for (int k = 0; k < N; k++) {
            rows[i][k] =
                2.0 * (shift * rows[i - 1][k] + (k ? rows[i - 1][k - 1] : 0.0)) - rows[i - 2][k];
        }
    }
}

/* Converts products of Chebyshev polynomials of t = (pixel - centre) / half to powers of pixels
 * from the origin, in place. c: ordered by bst_sip_term. */
static void to_powers(double *c, int order, double shift_x, double shift_y, double half_x,
                      double half_y) {
    double tx[N][N], ty[N][N], out[BST_SIP_TERMS] = {0};
    chebyshev_rows(shift_x, tx);
    chebyshev_rows(shift_y, ty);
    for (int i = 0; i <= order; i++) {
        for (int j = 0; i + j <= order; j++) {
            double value = c[bst_sip_term(i, j)];
            for (int p = 0; p <= i; p++) {
                for (int q = 0; q <= j; q++) {
                    out[bst_sip_term(p, q)] += value * tx[i][p] * ty[j][q];
                }
            }
        }
    }
    double row = 1.0;
    for (int p = 0; p <= order; p++, row /= half_x) {
        double scale = row;
        for (int q = 0; p + q <= order; q++, scale /= half_y) {
            out[bst_sip_term(p, q)] *= scale;
        }
    }
    memcpy(c, out, sizeof out);
}

/* Chebyshev coefficients from values at the roots of T_NODES in both axes. */
static void transform(const double value[NODES][NODES], double coefficient[NODES][NODES]) {
    double half[NODES][NODES];
    for (int i = 0; i < NODES; i++) {
        for (int y = 0; y < NODES; y++) {
            double sum = 0.0;
            for (int x = 0; x < NODES; x++) {
                sum += value[y][x] * cos(BST_PI * i * (x + 0.5) / NODES);
            }
            half[i][y] = sum * (i ? 2.0 : 1.0) / NODES;
        }
    }
    for (int i = 0; i < NODES; i++) {
        for (int j = 0; j < NODES; j++) {
            double sum = 0.0;
            for (int y = 0; y < NODES; y++) {
                sum += half[i][y] * cos(BST_PI * j * (y + 0.5) / NODES);
            }
            coefficient[i][j] = sum * (j ? 2.0 : 1.0) / NODES;
        }
    }
}

typedef struct samples {
    bst_vec3 icrs[NODES][NODES];
    double c[2][NODES][NODES]; /* Chebyshev coefficients of xi and eta, rad */
} samples;

/* Chebyshev coefficients of the tangent-plane coordinates; false: outside the plane. */
static bool transform_plane(const bst_io_sky_plane *t, samples *s) {
    double value[2][NODES][NODES];
    for (int y = 0; y < NODES; y++) {
        for (int x = 0; x < NODES; x++) {
            if (!bst_io_sky_to_plane(t, s->icrs[y][x], &value[0][y][x], &value[1][y][x])) {
                return false;
            }
        }
    }
    for (int k = 0; k < 2; k++) {
        transform((const double(*)[NODES])value[k], s->c[k]);
    }
    return true;
}

/* Lowest polynomial order whose omitted coefficients sum to less than the truncation limit. */
static int choose_order(const samples *s, double scale) {
    double out = 0.0;
    int order = 2 * NODES - 2;
    for (; order > 2; order--) {
        for (int i = 0; i < NODES; i++) {
            int j = order - i;
            if (j >= 0 && j < NODES) {
                out += (fabs(s->c[0][i][j]) + fabs(s->c[1][i][j])) / scale;
            }
        }
        if (out > LEFT_OUT_PX) {
            break;
        }
    }
    return order < BST_SIP_ORDER ? order : BST_SIP_ORDER;
}

/* Converts the fitted coefficients to powers of u and v about the reference pixel. */
static void powers_of(const mapping *m, const samples *s, int order,
                      double powers[2][BST_SIP_TERMS]) {
    for (int k = 0; k < 2; k++) {
        memset(powers[k], 0, sizeof powers[k]);
        for (int i = 0; i <= order; i++) {
            for (int j = 0; i + j <= order; j++) {
                powers[k][bst_sip_term(i, j)] = s->c[k][i][j];
            }
        }
        to_powers(powers[k], order, (m->x0 - m->cx) / m->hx, (m->y0 - m->cy) / m->hy, m->hx, m->hy);
    }
}

/* Multiplies tangent-plane coordinates by the inverse CD matrix. */
static void apply_inverse(const double cd[2][2], double xi, double eta, double *u, double *v) {
    double det = cd[0][0] * cd[1][1] - cd[0][1] * cd[1][0];
    *u = (cd[1][1] * xi - cd[0][1] * eta) / det;
    *v = (cd[0][0] * eta - cd[1][0] * xi) / det;
}

/* Solves a x = b[0], b[1] for symmetric positive definite a[n][n] by Cholesky decomposition, in
 * place. */
static bool solve(double a[BST_SIP_TERMS][BST_SIP_TERMS], double b[2][BST_SIP_TERMS], int n) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) {
                sum -= a[i][k] * a[j][k];
            }
            if (i == j && !(sum > 0.0)) {
                return false;
            }
            a[i][j] = i == j ? sqrt(sum) : sum / a[j][j];
        }
    }
    for (int r = 0; r < 2; r++) {
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < i; k++) {
                b[r][i] -= a[i][k] * b[r][k];
            }
            b[r][i] /= a[i][i];
        }
        for (int i = n - 1; i >= 0; i--) {
            for (int k = i + 1; k < n; k++) {
                b[r][i] -= a[k][i] * b[r][k];
            }
            b[r][i] /= a[i][i];
        }
    }
    return true;
}

/* A pixel and its position on the undistorted plane. */
typedef struct pair {
    double u, v, big_u, big_v;
} pair;

/* Fits the inverse SIP polynomials: least squares of u - U and v - V by Chebyshev products of U and
 * V. */
static bool fit_inverse(const pair *pairs, int count, int order, bst_sip *out) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < count; i++) {
        low[0] = fmin(low[0], pairs[i].big_u);
        high[0] = fmax(high[0], pairs[i].big_u);
        low[1] = fmin(low[1], pairs[i].big_v);
        high[1] = fmax(high[1], pairs[i].big_v);
    }
    double middle[2], half[2];
    for (int k = 0; k < 2; k++) {
        middle[k] = 0.5 * (low[k] + high[k]);
        half[k] = 0.5 * (high[k] - low[k]);
    }
    int terms = bst_sip_term(0, order) + 1;
    double a[BST_SIP_TERMS][BST_SIP_TERMS] = {{0}}, b[2][BST_SIP_TERMS] = {{0}};
    for (int i = 0; i < count; i++) {
        double t[2][N], row[BST_SIP_TERMS];
        double s[2] = {(pairs[i].big_u - middle[0]) / half[0],
                       (pairs[i].big_v - middle[1]) / half[1]};
        for (int k = 0; k < 2; k++) {
            t[k][0] = 1.0;
            t[k][1] = s[k];
            for (int n = 2; n < N; n++) {
                t[k][n] = 2.0 * s[k] * t[k][n - 1] - t[k][n - 2];
            }
        }
        for (int p = 0; p <= order; p++) {
            for (int q = 0; p + q <= order; q++) {
                row[bst_sip_term(p, q)] = t[0][p] * t[1][q];
            }
        }
        for (int p = 0; p < terms; p++) {
            for (int q = 0; q <= p; q++) {
                a[p][q] += row[p] * row[q];
            }
            b[0][p] += row[p] * (pairs[i].u - pairs[i].big_u);
            b[1][p] += row[p] * (pairs[i].v - pairs[i].big_v);
        }
    }
    if (!solve(a, b, terms)) {
        return false;
    }
    for (int k = 0; k < 2; k++) {
        to_powers(b[k], order, -middle[0] / half[0], -middle[1] / half[1], half[0], half[1]);
    }
    memcpy(out->ap, b[0], sizeof out->ap);
    memcpy(out->bp, b[1], sizeof out->bp);
    out->inverse_order = order;
    return true;
}

/* Largest errors of both SIP polynomials over pairs. */
static void misfit(const bst_sip *sip, const pair *pairs, int count, double *forward,
                   double *inverse) {
    *forward = *inverse = 0.0;
    for (int i = 0; i < count; i++) {
        const pair *p = &pairs[i];
        double u, v;
        bst_sip_undistort(sip, p->u, p->v, &u, &v);
        *forward = fmax(*forward, hypot(u - p->big_u, v - p->big_v));
        u = p->big_u + evaluate(sip->ap, sip->inverse_order, p->big_u, p->big_v);
        v = p->big_v + evaluate(sip->bp, sip->inverse_order, p->big_u, p->big_v);
        *inverse = fmax(*inverse, hypot(u - p->u, v - p->v));
    }
}

/* Computes pairs of pixels and undistorted positions: for the fit, and a grid for its error. */
static bool make_pairs(const mapping *m, const samples *s, const bst_io_sky_plane *plane,
                       const double cd[2][2], pair *pairs, pair *grid) {
    for (int i = 0; i < NODES * NODES + GRID * GRID; i++) {
        int g = i - NODES * NODES;
        pair *p = g < 0 ? &pairs[i] : &grid[g];
        double x = g < 0 ? m->hx * cos(BST_PI * (i % NODES + 0.5) / NODES)
                         : (m->hx - 0.5) * (2.0 * (g % GRID) / (GRID - 1) - 1.0);
        double y = g < 0 ? m->hy * cos(BST_PI * (double)(i / NODES) / NODES + 0.5 * BST_PI / NODES)
                         : (m->hy - 0.5) * (2.0 * (double)(g / GRID) / (GRID - 1) - 1.0);
        p->u = m->cx + x - m->x0;
        p->v = m->cy + y - m->y0;
        bst_vec3 icrs = g < 0 ? s->icrs[i / NODES][i % NODES] : place(m, m->cx + x, m->cy + y);
        double xi, eta;
        if (!bst_io_sky_to_plane(plane, icrs, &xi, &eta)) {
            return false;
        }
        apply_inverse(cd, xi, eta, &p->big_u, &p->big_v);
    }
    return true;
}

/* Selects the order of the inverse polynomial with the smallest error, at least the forward order.
 * Returns the larger error of both directions over the grid, px. */
static double fit_best_inverse(const pair *pairs, const pair *grid, bst_sip *out) {
    double forward = 0.0, inverse = INFINITY;
    for (int order = out->order; order <= BST_SIP_ORDER && inverse > INVERSE_PX; order++) {
        bst_sip before = *out;
        double old = inverse;
        if (!fit_inverse(pairs, NODES * NODES, order, out)) {
            *out = before;
            break;
        }
        misfit(out, grid, GRID * GRID, &forward, &inverse);
        if (inverse > old) {
            *out = before;
            inverse = old;
            break;
        }
    }
    return fmax(forward, inverse);
}

bool bst_sip_fit(const bst_camera *camera, bst_quat q_cam_from_gcrf, const bst_light *light,
                 double crval_rad[2], double cd[2][2], bst_sip *out, double *residual_px) {
    assert(camera && light && out && bst_is_unit_quat(q_cam_from_gcrf, BST_LINK_UNIT_TOLERANCE));
    double w = (double)camera->width_px, h = (double)camera->height_px;
    mapping m = {.camera = camera,
                 .q_gcrf_from_cam = bst_quat_conj(q_cam_from_gcrf),
                 .light = light,
                 .x0 = bst_camera_centre_x(camera),
                 .y0 = bst_camera_centre_y(camera),
                 .cx = 0.5 * (w - 1.0),
                 .cy = 0.5 * (h - 1.0),
                 .hx = 0.5 * w,
                 .hy = 0.5 * h};
    samples s;
    for (int y = 0; y < NODES; y++) {
        for (int x = 0; x < NODES; x++) {
            s.icrs[y][x] = place(&m, m.cx + m.hx * cos(BST_PI * (x + 0.5) / NODES),
                                 m.cy + m.hy * cos(BST_PI * (y + 0.5) / NODES));
        }
    }
    bst_vec3_to_radec(place(&m, m.x0, m.y0), &crval_rad[0], &crval_rad[1]);
    double powers[2][BST_SIP_TERMS];
    bst_io_sky_plane plane;
    memset(out, 0, sizeof *out);
    /* the polynomial's value at the boresight becomes the tangent point */
    for (int round = 0; round < ROUNDS; round++) {
        plane = bst_io_sky_plane_at(crval_rad[0], crval_rad[1]);
        if (!transform_plane(&plane, &s)) {
            return false;
        }
        out->order = choose_order(&s, bst_camera_scale_rad(camera));
        powers_of(&m, &s, out->order, powers);
        if (round + 1 < ROUNDS) {
            bst_vec3_to_radec(bst_io_sky_from_plane(&plane, powers[0][0], powers[1][0]),
                              &crval_rad[0], &crval_rad[1]);
        }
    }
    for (int k = 0; k < 2; k++) {
        cd[k][0] = powers[k][bst_sip_term(1, 0)];
        cd[k][1] = powers[k][bst_sip_term(0, 1)];
    }
    if (!(fabs(cd[0][0] * cd[1][1] - cd[0][1] * cd[1][0]) > 0.0)) {
        return false;
    }
    for (int k = bst_sip_term(2, 0); k < BST_SIP_TERMS; k++) {
        apply_inverse((const double(*)[2])cd, powers[0][k], powers[1][k], &out->a[k], &out->b[k]);
    }
    pair pairs[NODES * NODES], grid[GRID * GRID];
    if (!make_pairs(&m, &s, &plane, (const double(*)[2])cd, pairs, grid)) {
        return false;
    }
    *residual_px = fit_best_inverse(pairs, grid, out);
    return isfinite(*residual_px);
}

void bst_sip_undistort(const bst_sip *sip, double u, double v, double *big_u, double *big_v) {
    *big_u = u + (sip->order ? evaluate(sip->a, sip->order, u, v) : 0.0);
    *big_v = v + (sip->order ? evaluate(sip->b, sip->order, u, v) : 0.0);
}

void bst_sip_distort(const bst_sip *sip, double big_u, double big_v, double *u, double *v) {
    *u = big_u;
    *v = big_v;
    if (sip->order == 0) {
        return;
    }
    *u += evaluate(sip->ap, sip->inverse_order, big_u, big_v);
    *v += evaluate(sip->bp, sip->inverse_order, big_u, big_v);
    /* the polynomials are approximate inverses: a few Newton iterations converge */
    for (int k = 0; k < 8; k++) {
        double x, y;
        bst_sip_undistort(sip, *u, *v, &x, &y);
        *u += big_u - x;
        *v += big_v - y;
    }
}

void bst_sip_bin(bst_sip *sip, double binning) {
    for (int n = 0; n <= BST_SIP_ORDER; n++) {
        double scale = pow(binning, n - 1);
        for (int q = 0; q <= n; q++) {
            int k = bst_sip_term(n - q, q);
            sip->a[k] *= scale;
            sip->b[k] *= scale;
            sip->ap[k] *= scale;
            sip->bp[k] *= scale;
        }
    }
}
