/* Made-up observations for the tests of orbits from angles: a body and an observer in two-body or
 * integrated motion, light time and the Earth's own motion solved by a plain iteration of its own,
 * noise by a counter, of which the components are correlated by 0.6. */
#ifndef BST_TESTS_ORBIT_SCENE_H
#define BST_TESTS_ORBIT_SCENE_H

#include "boresight/rng.h"
#include "sim/astro/bodies.h"
#include "sim/core/tangent.h"
#include "tests/test_support.h"
#include "tracker/orbit/orbit_initial.h"

typedef struct scene {
    bst_od_motion motion;
    bst_od_state body, eye;
    bst_vec3 earth_mps;
    double from_s, to_s;
    int count;
    double sigma_rad;
} scene;

/* State of classical elements at time 0; angles in degrees. */
static inline bst_od_state from_elements(double a_m, double e, double i_deg, double node_deg,
                                         double perigee_deg, double anomaly_deg) {
    const double mu = BST_EARTH_MU_M3PS2, d = BST_DEG_RAD;
    double p = a_m * (1.0 - e * e), nu = anomaly_deg * d, r = p / (1.0 + e * cos(nu));
    double u = perigee_deg * d + nu, h = sqrt(mu / p);
    double cn = cos(node_deg * d), sn = sin(node_deg * d), ci = cos(i_deg * d), si = sin(i_deg * d);
    bst_vec3 radial = {cn * cos(u) - sn * sin(u) * ci, sn * cos(u) + cn * sin(u) * ci, sin(u) * si};
    bst_vec3 across = {-cn * sin(u) - sn * cos(u) * ci, -sn * sin(u) + cn * cos(u) * ci,
                       cos(u) * si};
    return (bst_od_state){.position_m = bst_vec3_scale(radial, r),
                          .velocity_mps = bst_vec3_axpy(bst_vec3_scale(radial, h * e * sin(nu)),
                                                        h * (1.0 + e * cos(nu)), across)};
}

/* Fills `out` (count items). run < 0: no noise. */
static inline void observe(const scene *s, int run, bst_od_observation *out) {
    bst_ctx ctx = {0};
    bst_od_path *body, *eye;
    bst_assert_ok(&ctx, bst_od_path_create(&ctx, &s->motion, &s->body, &body));
    bst_assert_ok(&ctx, bst_od_path_create(&ctx, &s->motion, &s->eye, &eye));
    bst_rng_key key = bst_rng_make_key(7, (uint64_t)(run + 1), "test", "angles");
    for (int i = 0; i < s->count; i++) {
        double t = s->from_s + (s->to_s - s->from_s) * i / (s->count - 1.0), tau = 0.0;
        bst_od_state there, here;
        bst_vec3 line = {0};
        bst_assert_ok(&ctx, bst_od_path_state(&ctx, eye, t, &here));
        for (int k = 0; k < 5; k++) {
            bst_assert_ok(&ctx, bst_od_path_state(&ctx, body, t - tau, &there));
            line =
                bst_vec3_axpy(bst_vec3_sub(there.position_m, here.position_m), -tau, s->earth_mps);
            tau = bst_vec3_norm(line) / BST_LIGHT_SPEED_MPS;
        }
        bst_vec3 d = bst_vec3_unit(line);
        double noise[2] = {0.0, 0.0};
        if (run >= 0) {
            bst_rng_normal2(key, (uint64_t)i, 0, noise);
        }
        bst_tangent axes = bst_tangent_at(d);
        d = bst_tangent_exp(d,
                            bst_tangent_vector(&axes, s->sigma_rad * noise[0],
                                               s->sigma_rad * (0.6 * noise[0] + 0.8 * noise[1])));
        double variance = s->sigma_rad * s->sigma_rad;
        out[i] = (bst_od_observation){.observer = {.time_s = t,
                                                   .position_m = here.position_m,
                                                   .velocity_mps = here.velocity_mps,
                                                   .earth_bary_mps = s->earth_mps},
                                      .direction = d,
                                      .cov_11 = variance,
                                      .cov_12 = 0.6 * variance,
                                      .cov_22 = variance};
    }
    bst_od_path_free(body);
    bst_od_path_free(eye);
}

/* True state at a time. */
static inline bst_od_state truth_at(const scene *s, double time_s) {
    bst_ctx ctx = {0};
    bst_od_path *path;
    bst_od_state out;
    bst_assert_ok(&ctx, bst_od_path_create(&ctx, &s->motion, &s->body, &path));
    bst_assert_ok(&ctx, bst_od_path_state(&ctx, path, time_s, &out));
    bst_od_path_free(path);
    return out;
}

/* e^T P^-1 e by Cholesky on a unit diagonal. */
static inline double normalised(const double e[6], const double p[6][6]) {
    double l[6][6] = {{0}}, y[6], sum = 0.0;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double v = p[i][j] / sqrt(p[i][i] * p[j][j]);
            for (int k = 0; k < j; k++) {
                v -= l[i][k] * l[j][k];
            }
            if (i == j) {
                assert_true(v > 0.0);
            }
            l[i][j] = i == j ? sqrt(v) : v / l[j][j];
        }
        y[i] = e[i] / sqrt(p[i][i]);
        for (int k = 0; k < i; k++) {
            y[i] -= l[i][k] * y[k];
        }
        y[i] /= l[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}

static inline void difference(const bst_od_state *a, const bst_od_state *b, double e[6]) {
    bst_vec3 r = bst_vec3_sub(a->position_m, b->position_m);
    bst_vec3 v = bst_vec3_sub(a->velocity_mps, b->velocity_mps);
    const double all[6] = {r.x, r.y, r.z, v.x, v.y, v.z};
    memcpy(e, all, sizeof all);
}

#endif
