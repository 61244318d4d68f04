/* Filters of catalogued orbits against numbers that are worked out here: differences of elements by
 * their definitions, slopes by differences of SGP4, light time step by step, the gain by
 * elimination. Observers, axes, covariances and arcs have no symmetry. */
#include "boresight/vec.h"
#include "sim/astro/bodies.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/sgp4_fit.h"
#include "tests/test_support.h"
#include "tracker/orbit/arc_outliers.h"
#include "tracker/orbit/custody.h"

enum { N = BST_CUSTODY_STATE, MOST = 6, COUNT = 3 };
#define DAY_S 86400.0

static const double photocentre_m = 4.0;

/* TEME turned by 0.7 rad about an axis that is none of its own. */
static bst_mat3 turned_axes(void) {
    return bst_quat_to_mat3(bst_quat_from_rotvec((bst_vec3){0.3, -0.5, 0.4}));
}

static bst_elements orbit_of(double inclination_deg, double eccentricity, double hours) {
    return (bst_elements){.norad = 5,
                          .epoch_utc_jd1 = 2459746.5,
                          .eccentricity = eccentricity,
                          .inclination_rad = inclination_deg * BST_DEG_RAD,
                          .raan_rad = 1.0,
                          .arg_perigee_rad = 2.0,
                          .mean_anomaly_rad = 0.5,
                          .mean_motion_radpmin = 2.0 * BST_PI / (60.0 * hours)};
}

/* The elements that differ by x, as custody.h defines x. */
static bst_elements changed(const bst_elements *e, double offset_s, const double x[N]) {
    const double n = e->mean_motion_radpmin / 60.0, a = cbrt(BST_EARTH_MU_M3PS2 / (n * n));
    const double perigee = e->raan_rad + e->arg_perigee_rad;
    const double half = cos(0.5 * e->inclination_rad), t = tan(0.5 * e->inclination_rad);
    const double dn = x[BST_CUSTODY_DRIFT] / DAY_S / a;
    const double ex = e->eccentricity * cos(perigee) + x[BST_CUSTODY_ECC_X] / (2.0 * a);
    const double ey = e->eccentricity * sin(perigee) + x[BST_CUSTODY_ECC_Y] / (2.0 * a);
    const double px = t * cos(e->raan_rad) + x[BST_CUSTODY_PLANE_X] / (2.0 * a * half * half);
    const double py = t * sin(e->raan_rad) + x[BST_CUSTODY_PLANE_Y] / (2.0 * a * half * half);
    bst_elements out = *e;
    out.mean_motion_radpmin = 60.0 * (n + dn);
    out.eccentricity = hypot(ex, ey);
    out.inclination_rad = 2.0 * atan(hypot(px, py));
    out.raan_rad = atan2(py, px);
    out.arg_perigee_rad = atan2(ey, ex) - out.raan_rad;
    /* the change of the mean longitude is given for time 0: at the epoch it lacks the drift */
    out.mean_anomaly_rad =
        e->mean_anomaly_rad + perigee + x[BST_CUSTODY_ALONG] / a - dn * offset_s - atan2(ey, ex);
    return out;
}

/* Position, turned axes, m. */
static bst_vec3 place_of(const bst_sgp4 *sgp4, double offset_s, double time_s) {
    const bst_mat3 turned = turned_axes();
    bst_vec3 r, v;
    assert_true(bst_sgp4_motion(sgp4, (offset_s + time_s) / 60.0, &r, &v));
    return bst_mat3_mul_vec(&turned, r);
}

typedef struct look {
    bst_vec3 direction, rate_radps;
    double range_m;
} look;

/* Direction of the light that arrives `dt_s` after the observer's time. */
static bst_vec3 arriving(const bst_sgp4 *sgp4, double offset_s, const bst_od_observer *eye,
                         double dt_s, double *range_m) {
    const bst_vec3 from = bst_vec3_axpy(eye->position_m, dt_s, eye->velocity_mps);
    bst_vec3 way = {0.0, 0.0, 0.0};
    *range_m = 0.0;
    for (int i = 0; i < 4; i++) {
        way = bst_vec3_sub(place_of(sgp4, offset_s, eye->time_s + dt_s - *range_m / 299792458.0),
                           from);
        *range_m = bst_vec3_norm(way);
    }
    return bst_vec3_unit(way);
}

static look look_at(const bst_elements *e, double offset_s, const double x[N],
                    const bst_od_observer *eye) {
    bst_ctx ctx = {0};
    const bst_elements set = changed(e, offset_s, x);
    bst_sgp4 *sgp4;
    double unused;
    look out;
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    const bst_vec3 after = arriving(sgp4, offset_s, eye, 0.01, &unused);
    const bst_vec3 before = arriving(sgp4, offset_s, eye, -0.01, &unused);
    out.rate_radps = bst_vec3_scale(bst_vec3_sub(after, before), 50.0);
    out.direction = arriving(sgp4, offset_s, eye, 0.0, &out.range_m);
    bst_sgp4_free(sgp4);
    return out;
}

typedef struct axes {
    bst_vec3 e1, e2;
} axes;

static axes axes_at(bst_vec3 d) {
    axes t = {.e1 = bst_vec3_unit((bst_vec3){-d.y, d.x, 0.0})};
    t.e2 = bst_vec3_cross(d, t.e1);
    return t;
}

/* Direction `a` and `b` rad beside d, along its axes. */
static bst_vec3 beside(bst_vec3 d, double a, double b) {
    const axes t = axes_at(d);
    return bst_vec3_unit(bst_vec3_add(d, bst_vec3_axpy(bst_vec3_scale(t.e1, a), b, t.e2)));
}

/* Direction and rate less those that were observed, in the axes at the observed direction. */
static void less(const look *seen, bst_vec3 direction, bst_vec3 rate, double out[4]) {
    const axes t = axes_at(direction);
    const bst_vec3 turn = bst_vec3_cross(seen->direction, direction); /* microradians: one term */
    const bst_vec3 carried = bst_vec3_add(seen->rate_radps, bst_vec3_cross(turn, seen->rate_radps));
    const bst_vec3 d = bst_vec3_sub(seen->direction, direction), r = bst_vec3_sub(carried, rate);
    out[0] = bst_vec3_dot(t.e1, d);
    out[1] = bst_vec3_dot(t.e2, d);
    out[2] = bst_vec3_dot(t.e1, r);
    out[3] = bst_vec3_dot(t.e2, r);
}

/* Inverse and logarithm of the determinant, by elimination with pivots. */
static double invert(int n, const double a[MOST][MOST], double out[MOST][MOST]) {
    double w[MOST][2 * MOST] = {{0.0}}, log_det = 0.0;
    for (int i = 0; i < n; i++) {
        /* in units of the diagonal's roots */
        for (int j = 0; j < n; j++) {
            w[i][j] = a[i][j] / sqrt(a[i][i] * a[j][j]);
        }
        w[i][n + i] = 1.0;
    }
    for (int c = 0; c < n; c++) {
        log_det += log(w[c][c] * a[c][c]);
        for (int i = 0; i < n; i++) {
            const double f = i == c ? 1.0 - 1.0 / w[c][c] : w[i][c] / w[c][c];
            for (int j = 2 * n - 1; j >= 0; j--) {
                w[i][j] -= f * w[c][j];
            }
        }
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            out[i][j] = w[i][n + j] / sqrt(a[i][i] * a[j][j]);
        }
    }
    return log_det;
}

/* A covariance of the state without zeros: tens of metres, and 100 m a day. */
static void slanting(double p[N][N]) {
    static const double root[N][N] = {{100, 0, 0, 0, 0, 0},  {9, 22, 0, 0, 0, 0},
                                      {-7, 6, 25, 0, 0, 0},  {4, -8, 5, 18, 0, 0},
                                      {-6, 3, -4, 7, 21, 0}, {-12, 8, 6, -5, 9, 30}};
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            p[i][j] = 0.0;
            for (int k = 0; k < N; k++) {
                p[i][j] += root[i][k] * root[j][k];
            }
        }
    }
}

/* An observer 900 km from the catalogued object, along none of the axes. */
static bst_od_observer observer_near(const bst_elements *set, double offset_s) {
    bst_ctx ctx = {0};
    bst_sgp4 *sgp4;
    bst_od_observer eye = {.time_s = 4000.0, .velocity_mps = {5200.0, 1900.0, -5000.0}};
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    eye.position_m = bst_vec3_add(place_of(sgp4, offset_s, eye.time_s), (bst_vec3){6e5, -5e5, 4e5});
    bst_sgp4_free(sgp4);
    return eye;
}

/* P H', S^-1 with S = H P H' + R, and the gain K = P H' S^-1. */
static void gain_of(int size, double h[MOST][N], double r[MOST][MOST],
                    const bst_custody_filter *before, double ph[N][MOST],
                    double inverse[MOST][MOST], double k[N][MOST]) {
    double s[MOST][MOST];
    for (int i = 0; i < N; i++) {
        for (int a = 0; a < size; a++) {
            ph[i][a] = 0.0;
            for (int j = 0; j < N; j++) {
                ph[i][a] += before->p[i][j] * h[a][j];
            }
        }
    }
    for (int a = 0; a < size; a++) {
        for (int b = 0; b < size; b++) {
            s[a][b] = r[a][b];
            for (int i = 0; i < N; i++) {
                s[a][b] += h[a][i] * ph[i][b];
            }
        }
    }
    invert(size, (const double(*)[MOST])s, inverse);
    for (int i = 0; i < N; i++) {
        for (int a = 0; a < size; a++) {
            k[i][a] = 0.0;
            for (int b = 0; b < size; b++) {
                k[i][a] += ph[i][b] * inverse[b][a];
            }
        }
    }
}

/* Variance of the place along the orbit after an update. */
static double updated_variance(int size, double h[MOST][N], double r[MOST][MOST],
                               const bst_custody_filter *before) {
    double ph[N][MOST], inverse[MOST][MOST], k[N][MOST], p = before->p[5][5];
    gain_of(size, h, r, before, ph, inverse, k);
    for (int a = 0; a < size; a++) {
        p -= k[5][a] * ph[5][a];
    }
    return p;
}

/* Fails unless `after` is x + K y and P - K H P. */
static void check_update(int size, double h[MOST][N], double y[MOST], double r[MOST][MOST],
                         const bst_custody_filter *before, const bst_custody_filter *after,
                         double share) {
    double ph[N][MOST], inverse[MOST][MOST], k[N][MOST];
    gain_of(size, h, r, before, ph, inverse, k);
    for (int i = 0; i < N; i++) {
        double x = before->x[i];
        for (int a = 0; a < size; a++) {
            x += k[i][a] * y[a];
        }
        bst_assert_close(after->x[i], x, share * sqrt(before->p[i][i]));
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            double p = before->p[i][j];
            for (int a = 0; a < size; a++) {
                p -= k[i][a] * ph[j][a];
            }
            bst_assert_close(after->p[i][j], p, share * sqrt(before->p[i][i] * before->p[j][j]));
        }
    }
}

/* Slopes of direction and rate at the observed direction by x, by differences over 5 m. */
static void slopes(const bst_elements *set, double offset_s, const double x[N],
                   const bst_od_observer *from, bst_vec3 direction, double h[4][N]) {
    for (int k = 0; k < N; k++) {
        double side[2][4], at[N];
        for (int s = 0; s < 2; s++) {
            memcpy(at, x, sizeof at);
            at[k] += s ? 5.0 : -5.0;
            const look seen = look_at(set, offset_s, at, from);
            less(&seen, direction, (bst_vec3){0.0, 0.0, 0.0}, side[s]);
        }
        for (int i = 0; i < 4; i++) {
            h[i][k] = (side[1][i] - side[0][i]) / 10.0;
        }
    }
}

/* Innovation, its covariance, chi-square, determinant and update of direction and rate, for a low
 * orbit, a transfer orbit and one near the equator, with an observer off all axes. */
static void one_observation(void **state) {
    (void)state;
    const struct {
        double inclination_deg, eccentricity, hours, share;
    } orbits[] = {{68.0, 0.02, 1.6, 1e-3},
                  {27.0, 0.5, 8.0, 1e-3},
                  /* near the equator x changes the osculating elements: perturbations of the
                   * difference are a thousandth of it in a revolution */
                  {0.05, 0.01, 1.9, 4e-2}};
    const double offset_s = 30000.0;
    for (int o = 0; o < 3; o++) {
        bst_ctx ctx = {0};
        const double share = orbits[o].share;
        const bst_elements set =
            orbit_of(orbits[o].inclination_deg, orbits[o].eccentricity, orbits[o].hours);
        bst_custody_orbit orbit;
        bst_custody_filter filter = {.x = {40.0, -25.0, 18.0, 30.0, -22.0, 35.0}}, after;
        bst_custody_prediction out;
        double h[MOST][N], r[MOST][MOST] = {{0.0}}, y[MOST], inverse[MOST][MOST],
                           s[MOST][MOST] = {{0.0}}, chi2 = 0.0;
        const bst_od_observer eye = observer_near(&set, offset_s);
        slanting(filter.p);
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, offset_s, photocentre_m, &orbit));
        const look seen = look_at(&set, offset_s, filter.x, &eye);
        bst_custody_observation z = {
            .observer = eye,
            .gcrf_from_teme = turned_axes(),
            .direction = beside(seen.direction, 6e-6, -4e-6),
        };
        const axes t = axes_at(z.direction);
        z.rate_radps =
            bst_vec3_add(seen.rate_radps, bst_vec3_axpy(bst_vec3_scale(t.e1, 4e-8), -6e-8, t.e2));
        z.rate_radps =
            bst_vec3_axpy(z.rate_radps, -bst_vec3_dot(z.rate_radps, z.direction), z.direction);
        static const double root[4][4] = {
            {3e-6, 0, 0, 0}, {1e-6, 2e-6, 0, 0}, {5e-9, -8e-9, 3e-8, 0}, {-9e-9, 6e-9, 1e-8, 4e-8}};
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < 4; j++) {
                for (int k = 0; k < 4; k++) {
                    z.covariance[i][j] += root[i][k] * root[j][k];
                }
                r[i][j] = z.covariance[i][j];
            }
        }
        const double spread = photocentre_m / seen.range_m;
        r[0][0] += spread * spread;
        r[1][1] += spread * spread;
        less(&seen, z.direction, z.rate_radps, y);
        slopes(&set, offset_s, filter.x, &eye, z.direction, h);
        assert_true(bst_custody_predict(&orbit, &filter, &z, &out));
        for (int i = 0; i < 4; i++) {
            y[i] = -y[i];
            for (int j = 0; j < 4; j++) {
                s[i][j] = r[i][j];
                for (int k = 0; k < N; k++) {
                    for (int l = 0; l < N; l++) {
                        s[i][j] += h[i][k] * filter.p[k][l] * h[j][l];
                    }
                }
            }
        }
        const double log_det = invert(4, (const double(*)[MOST])s, inverse);
        for (int i = 0; i < 4; i++) {
            bst_assert_close(out.innovation[i], y[i], share * sqrt(s[i][i]));
            for (int j = 0; j < 4; j++) {
                bst_assert_close(out.covariance[i][j], s[i][j], share * sqrt(s[i][i] * s[j][j]));
                chi2 += y[i] * inverse[i][j] * y[j];
            }
        }
        bst_assert_close(out.log_determinant, log_det, 10.0 * share);
        bst_assert_close(out.chi2, chi2, 10.0 * share * chi2);
        after = filter;
        assert_true(bst_custody_update(&orbit, &z, &after));
        check_update(4, h, y, r, &filter, &after, 4.0 * share); /* curvature in 30 m */
    }
}

/* A pass of three directions with errors of their own and errors that they share, which change
 * between them by unequal amounts, as the photocentre's do by the angles of orbit and direction. */
typedef struct pass {
    bst_custody_orbit orbit;
    bst_custody_filter filter;
    bst_od_observation list[COUNT];
    double range_m[COUNT], h[MOST][N], y[MOST];
} pass;

/* *out: all directions are off by `off_rad` along their first axes beside errors of their own. */
static void make_pass(double off_rad, pass *out) {
    static const double change[COUNT] = {9.0, 0.3, 0.8}, at_s[COUNT] = {0.0, 60.0, 240.0};
    bst_ctx ctx = {0};
    const bst_elements set = orbit_of(68.0, 0.6, 6.0);
    const double offset_s = -20000.0;
    const bst_od_observer eye = observer_near(&set, offset_s);
    *out = (pass){.filter = {.x = {40.0, -25.0, 18.0, 30.0, -22.0, 35.0}}};
    slanting(out->filter.p);
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, offset_s, photocentre_m, &out->orbit));
    for (int i = 0; i < COUNT; i++) {
        double part[4][N], miss[4];
        bst_od_observer from = eye;
        from.time_s += at_s[i];
        from.position_m = bst_vec3_axpy(eye.position_m, at_s[i], eye.velocity_mps);
        const look seen = look_at(&set, offset_s, out->filter.x, &from);
        bst_od_observation *z = &out->list[i];
        *z = (bst_od_observation){
            .observer = from,
            .direction = beside(seen.direction, off_rad + 5e-6 - 3e-6 * i, -2e-6 + 4e-6 * i),
            .cov_11 = 9e-12,
            .cov_12 = -3e-12 + 2e-12 * i,
            .cov_22 = 7e-12 + 1e-12 * i,
            .shared_rad = {{1.6e-6, -0.7e-6}, {0.5e-6 + 0.2e-6 * i, 1.2e-6}},
            .shared_change = change[i]};
        out->range_m[i] = seen.range_m;
        less(&seen, z->direction, seen.rate_radps, miss);
        slopes(&set, offset_s, out->filter.x, &from, z->direction, part);
        for (int a = 0; a < 2; a++) {
            out->y[2 * i + a] = -miss[a];
            memcpy(out->h[2 * i + a], part[a], sizeof part[a]);
        }
    }
}

/* Covariance of the directions' errors; `factor` multiplies all but the photocentre's part. */
static void errors_of(const pass *t, double factor, double r[MOST][MOST]) {
    const double near = 1.0 - t->orbit.elements.eccentricity, root = sqrt((2.0 - near) / near);
    const double perigee = t->orbit.elements.mean_motion_radpmin / 60.0 * root / near;
    for (int i = 0; i < COUNT; i++) {
        double kept = 1.0; /* of what directions share */
        for (int k = i; k < COUNT; k++) {
            const bst_od_observation *u = &t->list[i], *v = &t->list[k];
            const axes a = axes_at(u->direction), b = axes_at(v->direction);
            const bst_vec3 ea[2] = {a.e1, a.e2}, eb[2] = {b.e1, b.e2};
            const double own[2][2] = {{u->cov_11, u->cov_12}, {u->cov_12, u->cov_22}};
            kept *= k > i ? exp(-v->shared_change) : 1.0;
            const double round = perigee * (v->observer.time_s - u->observer.time_s);
            const double turn = 2.0 * sin(0.5 * bst_vec3_angle(u->direction, v->direction));
            const double displaced = photocentre_m * photocentre_m / t->range_m[i] / t->range_m[k] *
                                     exp(-0.5 * (round * round + turn * turn));
            for (int p = 0; p < 2; p++) {
                for (int q = 0; q < 2; q++) {
                    const double *sa = u->shared_rad[p], *sb = v->shared_rad[q];
                    const double both = kept * (sa[0] * sb[0] + sa[1] * sb[1]);
                    r[2 * i + p][2 * k + q] = r[2 * k + q][2 * i + p] =
                        factor * (i == k ? own[p][q] : both) +
                        displaced * bst_vec3_dot(ea[p], eb[q]);
                }
            }
        }
    }
}

/* The variance of unit weight multiplies the errors of the directions: it is what makes one element
 * of the covariance right, and must then make all. */
static void directions_that_share_errors(void **state) {
    (void)state;
    const bst_mat3 turned[2] = {turned_axes(), turned_axes()};
    pass t;
    double r[MOST][MOST];
    make_pass(0.0, &t);
    bst_custody_filter after = t.filter;
    assert_true(bst_custody_update_directions(&t.orbit, turned, t.list, COUNT, &after));
    double low = 0.1, high = 10.0;
    for (int trial = 0; trial < 60; trial++) {
        const double factor = sqrt(low * high);
        errors_of(&t, factor, r);
        *(updated_variance(2 * COUNT, t.h, r, &t.filter) < after.p[5][5] ? &low : &high) = factor;
    }
    /* the errors are about as large as stated: 20 known degrees of freedom against 5 or less */
    assert_true(low > 0.8 && low < 1.3);
    check_update(2 * COUNT, t.h, t.y, r, &t.filter, &after, 1e-3);
}

/* Directions farther off than errors of twice the size are with probability 2e-5 are refused: the
 * chi-square of six of them, a quarter of that of errors as stated, has exp(-x / 2) (1 + x / 2 +
 * x^2 / 8) above x. */
static void directions_of_another_object(void **state) {
    (void)state;
    const bst_mat3 turned[2] = {turned_axes(), turned_axes()};
    double low = 1e-5, high = 3e-3, r[MOST][MOST], ph[N][MOST], k[N][MOST], inverse[MOST][MOST],
           x = 0.0;
    pass t;
    for (int trial = 0; trial < 16; trial++) {
        const double middle = 0.5 * (low + high);
        make_pass(middle, &t);
        bst_custody_filter filter = t.filter;
        *(bst_custody_update_directions(&t.orbit, turned, t.list, COUNT, &filter) ? &low : &high) =
            middle;
    }
    errors_of(&t, 1.0, r);
    gain_of(2 * COUNT, t.h, r, &t.filter, ph, inverse, k);
    for (int a = 0; a < 2 * COUNT; a++) {
        for (int b = 0; b < 2 * COUNT; b++) {
            x += 0.25 * t.y[a] * inverse[a][b] * t.y[b];
        }
    }
    /* Wilson and Hilferty's cube root is 0.7 too large there, which makes 1.4e-5 of it */
    bst_assert_close(exp(-0.5 * x) * (1.0 + 0.5 * x + 0.125 * x * x), 1.4e-5, 0.1e-5);
}

/* The first covariance, the drift's share in the place along the orbit, and process noise, which is
 * summed in small steps; the error in units of a slanting covariance. */
static void covariances_of_a_filter(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_elements set = orbit_of(68.0, 0.02, 1.6);
    const bst_custody_config config = {
        .sigma_m = 70.0, .drift_m_per_day = 300.0, .noise_m_per_day = 50.0};
    const double normals[N] = {1.5, -0.5, 0.25, 2.0, -1.0, 0.75}, age = 2.5;
    bst_custody_orbit orbit;
    bst_custody_filter filter, aged, slanted = {.x = {40.0, -25.0, 18.0, 30.0, -22.0, 35.0}};
    double inverse[MOST][MOST], nees = 0.0, sum[3] = {0.0};
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, age * DAY_S, 0.0, &orbit));
    bst_custody_filter_init(&config, &orbit, normals, &filter);
    for (int i = 0; i < N; i++) {
        const double sigma = i == BST_CUSTODY_DRIFT ? 300.0 : 70.0;
        const double carried = i == BST_CUSTODY_ALONG ? age * 300.0 * normals[0] : 0.0;
        bst_assert_close(filter.x[i], sigma * normals[i] + carried, 1e-9);
        for (int j = 0; j < N; j++) {
            const bool along = i == BST_CUSTODY_ALONG, other = j == BST_CUSTODY_ALONG;
            double p = i == j ? sigma * sigma : 0.0;
            p += (along || i == BST_CUSTODY_DRIFT) && (other || j == BST_CUSTODY_DRIFT) &&
                         (along || other)
                     ? 300.0 * 300.0 * (along ? age : 1.0) * (other ? age : 1.0)
                     : 0.0;
            bst_assert_close(filter.p[i][j], p, 1e-9 * 300.0 * 300.0);
        }
    }
    aged = filter;
    bst_custody_add_process_noise(&config, 0.5 * DAY_S, &aged);
    bst_custody_add_process_noise(&config, 1.25 * DAY_S, &aged);
    for (int k = 0; k < 10000;
         k++) { /* a change of the drift at u moves the place at time 0 by -u */
        const double u = 1.25 * (k + 0.5) / 10000.0, change2 = 50.0 * 50.0 * 1.25 / 10000.0;
        sum[0] += change2;
        sum[1] -= u * change2;
        sum[2] += u * u * change2;
    }
    /* of a rule with steps of 1e-4: 1e-8 */
    bst_assert_close(aged.p[0][0] - filter.p[0][0], sum[0], 1e-6 * sum[0]);
    bst_assert_close(aged.p[0][5] - filter.p[0][5], sum[1], -1e-6 * sum[1]);
    bst_assert_close(aged.p[5][0] - filter.p[5][0], sum[1], -1e-6 * sum[1]);
    bst_assert_close(aged.p[5][5] - filter.p[5][5], sum[2], 1e-6 * sum[2]);
    slanting(slanted.p);
    invert(N, (const double(*)[MOST])slanted.p, inverse); /* N is MOST */
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            nees += slanted.x[i] * inverse[i][j] * slanted.x[j];
        }
    }
    bst_assert_close(bst_custody_nees(&slanted), nees, 1e-9 * nees);
}

/* Place and its standard deviation over all three axes, from differences along each component. */
static void place_and_its_deviation(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_elements set = orbit_of(27.0, 0.5, 8.0);
    const double offset_s = 30000.0, time_s = 9000.0, none[N] = {0.0};
    bst_custody_orbit orbit;
    bst_custody_filter filter = {.x = {40.0, -25.0, 18.0, 30.0, -22.0, 35.0}};
    bst_vec3 place, expected, catalogued, slope[N];
    double sigma, variance = 0.0;
    slanting(filter.p);
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, offset_s, 0.0, &orbit));
    for (int k = -2; k < N; k++) {
        bst_vec3 side[2];
        for (int s = 0; s < 2; s++) {
            double x[N];
            bst_vec3 v;
            bst_sgp4 *sgp4;
            memcpy(x, k == -2 ? none : filter.x, sizeof x);
            x[k < 0 ? 0 : k] += k < 0 ? 0.0 : s ? 5.0 : -5.0;
            const bst_elements near = changed(&set, offset_s, x);
            bst_assert_ok(&ctx,
                          bst_sgp4_create(&ctx, &near, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
            assert_true(bst_sgp4_motion(sgp4, (offset_s + time_s) / 60.0, &side[s], &v));
            bst_sgp4_free(sgp4);
        }
        *(k == -2   ? &catalogued
          : k == -1 ? &expected
                    : &slope[k]) =
            k < 0 ? side[0] : bst_vec3_scale(bst_vec3_sub(side[1], side[0]), 0.1);
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            variance += filter.p[i][j] * bst_vec3_dot(slope[i], slope[j]);
        }
    }
    assert_true(bst_custody_predict_position(&orbit, &filter, time_s, &place, &sigma));
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(place, expected)), 0.0, 1e-3);
    bst_assert_close(sigma, sqrt(variance), 1e-3 * sigma);
    assert_true(bst_custody_catalogued_position(&orbit, time_s, &place));
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(place, catalogued)), 0.0, 1e-3);
}

/* The worst of an arc, both limits on either side, and what a removed direction leaves. */
static void outliers_of_an_arc(void **state) {
    (void)state;
    /* the median of an even number is the upper one of the middle two: 2.0, 2.0, 2.6 */
    const double quiet[] = {2.0, 24.9, 1.0, 3.0}, far[] = {1.0, 2.0, 0.5, 25.1, 25.05};
    const double wide[] = {2.6, 25.9, 0.1, 3.0, 0.2}, beyond[] = {2.6, 26.1, 0.1, 3.0, 0.2};
    assert_int_equal(bst_arc_outlier(quiet, 4), -1);
    assert_int_equal(bst_arc_outlier(far, 5), 3);
    assert_int_equal(bst_arc_outlier(wide, 5), -1);
    assert_int_equal(bst_arc_outlier(beyond, 5), 1);
    const bst_od_observation arc[4] = {{.cov_11 = 1.0, .shared_change = 0.1},
                                       {.cov_11 = 2.0, .shared_change = 0.2},
                                       {.cov_11 = 3.0, .shared_change = 0.4},
                                       {.cov_11 = 4.0, .shared_change = 0.8}};
    const struct {
        int index;
        double left[3], change[3];
    } drops[] = {{0, {2.0, 3.0, 4.0}, {0.3, 0.4, 0.8}},
                 {2, {1.0, 2.0, 4.0}, {0.1, 0.2, 1.2}},
                 {3, {1.0, 2.0, 3.0}, {0.1, 0.2, 0.4}}};
    for (int d = 0; d < 3; d++) {
        bst_od_observation list[4] = {arc[0], arc[1], arc[2], arc[3]};
        bst_arc_drop(list, 4, drops[d].index);
        for (int i = 0; i < 3; i++) {
            bst_assert_close(list[i].cov_11, drops[d].left[i], 0.0);
            bst_assert_close(list[i].shared_change, drops[d].change[i], 1e-15);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_observation),
        cmocka_unit_test(directions_that_share_errors),
        cmocka_unit_test(directions_of_another_object),
        cmocka_unit_test(covariances_of_a_filter),
        cmocka_unit_test(place_and_its_deviation),
        cmocka_unit_test(outliers_of_an_arc),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
