/* Covariances of orbits from angles with everything in them: errors that go together, shared parts
 * that change, the range's; written out by brute force. */
#include "sim/core/symmetric.h"
#include "tests/tracker/orbit_scene.h"

#define ARCSEC BST_ARCSEC_RAD

/* About the Earth's velocity in June. */
static const bst_vec3 EARTH = {21000.0, -18500.0, -8000.0};

static bst_od_state leo_eye(void) {
    return from_elements(7.155e6, 0.001, 98.5, 40.0, 80.0, 10.0); /* as NEOSSat's */
}
static bst_od_state geo(void) {
    return from_elements(42164e3, 1e-4, 0.05, 20.0, 0.0, 35.0);
}

/* Direction of a state in the tangent axes at an observation's. */
static void seen_from(const scene *s, const bst_od_state *at, const bst_od_observation *o,
                      double out[2]) {
    bst_ctx ctx = {0};
    bst_od_path *path;
    bst_od_state then;
    bst_od_sight sight;
    bst_assert_ok(&ctx, bst_od_path_create(&ctx, &s->motion, at, &path));
    bst_assert_ok(&ctx, bst_od_path_state(&ctx, path, o->observer.time_s, &then));
    bst_od_path_free(path);
    bst_od_see(&then, &o->observer, &sight);
    bst_tangent axes = bst_tangent_at(o->direction);
    bst_vec3 off = bst_tangent_log(o->direction, sight.direction);
    out[0] = bst_vec3_dot(axes.e1, off);
    out[1] = bst_vec3_dot(axes.e2, off);
}

static bst_od_state displaced(const bst_od_state *s, int axis, double by) {
    bst_od_state out = *s;
    double *place[6] = {&out.position_m.x,   &out.position_m.y,   &out.position_m.z,
                        &out.velocity_mps.x, &out.velocity_mps.y, &out.velocity_mps.z};
    *place[axis] += by;
    return out;
}

/* Slopes of range (row 0) and range rate (row 1) from an observer by the state. */
static void range_slopes(const bst_od_state *s, const bst_od_observer *eye, double out[2][6]) {
    for (int k = 0; k < 6; k++) {
        double value[2][2], h = k < 3 ? 10.0 : 0.01;
        for (int side = 0; side < 2; side++) {
            bst_od_state near = displaced(s, k, side ? -h : h);
            bst_vec3 line = bst_vec3_sub(near.position_m, eye->position_m);
            bst_vec3 rate = bst_vec3_sub(near.velocity_mps, eye->velocity_mps);
            value[side][0] = bst_vec3_norm(line);
            value[side][1] = bst_vec3_dot(line, rate) / bst_vec3_norm(line);
        }
        for (int i = 0; i < 2; i++) {
            out[i][k] = (value[0][i] - value[1][i]) / (2.0 * h);
        }
    }
}

/* Directions whose errors along the two axes go together, of other size each, and share a part that
 * changes. The solution's covariance is (H^T C^-1 H)^-1 of the independent errors C, and what the
 * shared ones S make of it by the estimator K = (H^T C^-1 H)^-1 H^T C^-1: K S K^T, all of it
 * written out for the whole list. */
static void full_covariances_by_brute_force(void **state) {
    (void)state;
    enum { N = 12 };
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 9000, N, ARCSEC};
    static bst_od_observation items[N];
    observe(&s, 11, items);
    double own[N][3], change = 0.0, place[N];
    for (int i = 0; i < N; i++) {
        bst_od_observation *o = &items[i];
        const double a2 = ARCSEC * ARCSEC, size = 1.0 + 0.3 * (i % 3), mix = i % 2 ? 0.7 : -0.4;
        own[i][0] = a2 * size;
        own[i][2] = a2 * (2.5 - size);
        own[i][1] = mix * sqrt(own[i][0] * own[i][2]);
        const double shared[2][2] = {{0.5, -0.2 + 0.05 * i}, {0.3, 0.4}};
        memcpy(o->shared_rad, shared, sizeof shared);
        for (int k = 0; k < 4; k++) {
            o->shared_rad[k / 2][k % 2] *= ARCSEC;
        }
        const double(*r)[2] = (const double(*)[2])o->shared_rad;
        o->cov_11 = own[i][0] + r[0][0] * r[0][0] + r[0][1] * r[0][1];
        o->cov_12 = own[i][1] + r[0][0] * r[1][0] + r[0][1] * r[1][1];
        o->cov_22 = own[i][2] + r[1][0] * r[1][0] + r[1][1] * r[1][1];
        o->shared_change = 0.1 * (1 + i % 3);
        change += i > 0 ? o->shared_change : 0.0;
        place[i] = change;
    }
    for (int scaled = 0; scaled < 2; scaled++) {
        bst_ctx ctx = {0};
        const bst_od_options options = {.scale_variance = scaled == 1};
        bst_od_solution got;
        double chi2[N];
        bst_assert_ok(&ctx, bst_od_fit(&ctx, items, N, &options, &s.body, chi2, &got));
        double inverse[N][2][2], h[N][2][6], normal[6][6] = {{0.0}}, p[6][6], sum = 0.0,
                                             squares = 0.0;
        for (int i = 0; i < N; i++) {
            double det = own[i][0] * own[i][2] - own[i][1] * own[i][1], r[2];
            inverse[i][0][0] = own[i][2] / det;
            inverse[i][1][1] = own[i][0] / det;
            inverse[i][0][1] = inverse[i][1][0] = -own[i][1] / det;
            seen_from(&s, &got.state, &items[i], r);
            double mine = inverse[i][0][0] * r[0] * r[0] + 2.0 * inverse[i][0][1] * r[0] * r[1] +
                          inverse[i][1][1] * r[1] * r[1];
            bst_assert_close(chi2[i], mine, 1e-6 * (1.0 + mine)); /* rounding of 1e-16 rad */
            sum += mine;
            squares += r[0] * r[0] + r[1] * r[1];
            for (int k = 0; k < 6; k++) {
                double side[2][2], step = k < 3 ? 100.0 : 0.01;
                for (int e = 0; e < 2; e++) {
                    bst_od_state near = displaced(&got.state, k, e ? -step : step);
                    seen_from(&s, &near, &items[i], side[e]);
                }
                for (int j = 0; j < 2; j++) {
                    h[i][j][k] = (side[0][j] - side[1][j]) / (2.0 * step);
                }
            }
            for (int k = 0; k < 6; k++) {
                for (int l = 0; l < 6; l++) {
                    for (int a = 0; a < 2; a++) {
                        for (int b = 0; b < 2; b++) {
                            normal[k][l] += h[i][a][k] * inverse[i][a][b] * h[i][b][l];
                        }
                    }
                }
            }
        }
        assert_int_equal(got.used, N);
        assert_int_equal(got.dof, 2 * N - 6);
        bst_assert_close(got.chi2, sum, 1e-6 * sum);
        bst_assert_close(got.rms_rad, sqrt(squares / (2.0 * N)), 1e-6 * got.rms_rad);
        double factor = scaled ? (20.0 + sum) / (20.0 + 2 * N - 6) : 1.0;
        bst_assert_close(got.variance_factor, factor, 1e-6);
        assert_true(bst_symmetric_invert(6, normal[0], p[0]));
        double gain[N][6][2]; /* K, and K times the shared errors' factors */
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < 6; k++) {
                for (int c = 0; c < 2; c++) {
                    gain[i][k][c] = 0.0;
                    for (int l = 0; l < 6; l++) {
                        for (int a = 0; a < 2; a++) {
                            for (int b = 0; b < 2; b++) {
                                gain[i][k][c] += p[k][l] * h[i][a][l] * inverse[i][a][b] *
                                                 items[i].shared_rad[b][c];
                            }
                        }
                    }
                }
            }
        }
        double want[6][6];
        for (int k = 0; k < 6; k++) {
            for (int l = 0; l < 6; l++) {
                want[k][l] = factor * p[k][l];
                for (int i = 0; i < N; i++) {
                    for (int j = 0; j < N; j++) {
                        double kept = exp(-fabs(place[i] - place[j]));
                        want[k][l] +=
                            kept * (gain[i][k][0] * gain[j][l][0] + gain[i][k][1] * gain[j][l][1]);
                    }
                }
            }
        }
        for (int k = 0; k < 6; k++) {
            for (int l = 0; l < 6; l++) {
                /* differences of both, and the normal matrix's condition */
                bst_assert_close(got.covariance[k][l], want[k][l],
                                 1e-3 * sqrt(want[k][k] * want[l][l]));
            }
        }
        double slope[2][6], variance[2] = {0.0};
        range_slopes(&got.state, &items[0].observer, slope);
        for (int i = 0; i < N; i++) {
            if (items[i].observer.time_s == got.state.time_s) {
                range_slopes(&got.state, &items[i].observer, slope);
            }
        }
        for (int k = 0; k < 6; k++) {
            for (int l = 0; l < 6; l++) {
                variance[0] += slope[0][k] * want[k][l] * slope[0][l];
                variance[1] += slope[1][k] * want[k][l] * slope[1][l];
            }
        }
        bst_assert_close(got.range_sigma_m / sqrt(variance[0]), 1.0, 1e-3);
        bst_assert_close(got.range_rate_sigma_mps / sqrt(variance[1]), 1.0, 1e-3);
    }
}

/* A track's full covariance of direction and rate, with that of range and range rate, by moving
 * each of them in turn: what bst_od_from_track says of the state's covariance. */
static void a_tracks_covariance_by_differences(void **state) {
    (void)state;
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 600, 2, ARCSEC};
    bst_od_observation items[2];
    observe(&s, -1, items);
    const bst_od_observer *eye = &items[0].observer;
    bst_od_state truth = truth_at(&s, 0.0), got;
    bst_od_sight seen;
    bst_od_see(&truth, eye, &seen);
    bst_tangent axes = bst_tangent_at(seen.direction);
    const double scale[6] = {1e-5, 2e-5, 3e-7, 2e-7, 1e3, 0.01};
    const double mix[6][6] = {{1, 0.5, -0.3, 0.2, 0, 0},  {0.5, 1, 0.1, 0.6, 0, 0},
                              {-0.3, 0.1, 1, -0.4, 0, 0}, {0.2, 0.6, -0.4, 1, 0, 0},
                              {0, 0, 0, 0, 1, 0},         {0, 0, 0, 0, 0, 1}};
    double sky[4][4], p[6][6], j[6][6], unused[6][6], all[6][6];
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            all[i][k] = mix[i][k] * scale[i] * scale[k];
            if (i < 4 && k < 4) {
                sky[i][k] = all[i][k];
            }
        }
    }
    const bst_orbit_range range = {seen.range_m, scale[4], seen.range_rate_mps, scale[5]};
    bst_od_from_track(eye, seen.direction, seen.rate_radps, (const double(*)[4])sky, &range, &got,
                      p);
    /* the body as it moved when its light left, carried on for the light time: its acceleration is
     * left out. Squares of speeds over that of light are 1e-8 of them */
    const double tau = seen.range_m / 299792458.0, r3 = pow(bst_vec3_norm(truth.position_m), 3.0);
    const bst_vec3 pull = bst_vec3_scale(truth.position_m, -BST_EARTH_MU_M3PS2 / r3);
    const bst_vec3 left = bst_vec3_axpy(truth.velocity_mps, -tau, pull);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(got.velocity_mps, left)), 0.0, 2e-3);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(got.position_m, truth.position_m)), 0.0, 5e-3);
    for (int k = 0; k < 6; k++) {
        bst_od_state side[2];
        const double step = 0.1 * scale[k];
        for (int e = 0; e < 2; e++) {
            double x[6] = {0.0};
            x[k] = e ? -step : step;
            bst_vec3 d = bst_tangent_exp(seen.direction, bst_tangent_vector(&axes, x[0], x[1]));
            bst_vec3 w = bst_vec3_add(seen.rate_radps, bst_tangent_vector(&axes, x[2], x[3]));
            w = bst_tangent_carry(seen.direction, d, w);
            const bst_orbit_range beside = {seen.range_m + x[4], scale[4],
                                            seen.range_rate_mps + x[5], scale[5]};
            bst_od_from_track(eye, d, w, (const double(*)[4])sky, &beside, &side[e], unused);
        }
        bst_vec3 r = bst_vec3_sub(side[0].position_m, side[1].position_m);
        bst_vec3 v = bst_vec3_sub(side[0].velocity_mps, side[1].velocity_mps);
        const double column[6] = {r.x, r.y, r.z, v.x, v.y, v.z};
        for (int i = 0; i < 6; i++) {
            j[i][k] = column[i] / (2.0 * step);
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            double want = 0.0;
            for (int a = 0; a < 6; a++) {
                for (int b = 0; b < 6; b++) {
                    want += j[i][a] * all[a][b] * j[k][b];
                }
            }
            /* terms of the Earth's speed over that of light are left out */
            bst_assert_close(p[i][k], want, 1e-3 * sqrt(p[i][i] * p[k][k]));
        }
    }
}

/* Adds the outer product of half the difference of two vectors. */
static void add_square(const double *a, const double *b, int n, double *sum) {
    for (int i = 0; i < n * n; i++) {
        sum[i] += 0.25 * (a[i / n] - b[i / n]) * (a[i % n] - b[i % n]);
    }
}

/* Errors on one or two lines through the state, v v^T + w w^T, slanting to every axis: an hour
 * later, and in the sky, they are on the lines through what becomes of the states at their ends. */
static void errors_along_lines_of_states(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double line[2][6] = {{300.0, -500.0, 200.0, 0.11, 0.07, -0.09},
                               {-150.0, 90.0, 400.0, -0.03, 0.12, 0.05}};
    const bst_od_motion motion = {0};
    const bst_od_state orbit = geo(), eye = leo_eye();
    const bst_od_observer observer = {0.0, eye.position_m, eye.velocity_mps, EARTH};
    for (int lines = 1; lines <= 2; lines++) {
        double p[6][6] = {{0.0}}, later[6][6], slope[4][6], sky[4][4];
        double want_later[6][6] = {{0.0}}, want_sky[4][4] = {{0.0}};
        bst_od_state then;
        bst_od_sight sight;
        for (int i = 0; i < 36; i++) {
            for (int n = 0; n < lines; n++) {
                p[i / 6][i % 6] += line[n][i / 6] * line[n][i % 6];
            }
        }
        bst_assert_ok(&ctx, bst_od_propagate(&ctx, &motion, &orbit, (const double(*)[6])p,
                                             orbit.time_s + 3600.0, &then, later));
        bst_od_project(&orbit, (const double(*)[6])p, &observer, &sight, slope, sky);
        bst_tangent axes = bst_tangent_at(sight.direction);
        for (int n = 0; n < lines; n++) {
            double end[2][6], seen[2][4];
            for (int side = 0; side < 2; side++) {
                bst_od_state at = orbit, moved;
                bst_od_path *path;
                bst_od_sight to;
                for (int k = 0; k < 6; k++) {
                    at = displaced(&at, k, side ? -line[n][k] : line[n][k]);
                }
                bst_assert_ok(&ctx, bst_od_path_create(&ctx, &motion, &at, &path));
                bst_assert_ok(&ctx, bst_od_path_state(&ctx, path, orbit.time_s + 3600.0, &moved));
                bst_od_path_free(path);
                const double six[6] = {moved.position_m.x,   moved.position_m.y,
                                       moved.position_m.z,   moved.velocity_mps.x,
                                       moved.velocity_mps.y, moved.velocity_mps.z};
                memcpy(end[side], six, sizeof six);
                bst_od_see(&at, &observer, &to);
                const double four[4] = {
                    bst_vec3_dot(axes.e1, to.direction), bst_vec3_dot(axes.e2, to.direction),
                    bst_vec3_dot(axes.e1, to.rate_radps), bst_vec3_dot(axes.e2, to.rate_radps)};
                memcpy(seen[side], four, sizeof four);
            }
            add_square(end[0], end[1], 6, want_later[0]);
            add_square(seen[0], seen[1], 4, want_sky[0]);
        }
        for (int i = 0; i < 6; i++) {
            for (int k = 0; k < 6; k++) { /* curvature: (500 m / 42 000 km)^2, and rounding */
                bst_assert_close(later[i][k], want_later[i][k],
                                 1e-6 * sqrt(want_later[i][i] * want_later[k][k]));
                if (i < 4 && k < 4) {
                    bst_assert_close(sky[i][k], want_sky[i][k],
                                     1e-6 * sqrt(want_sky[i][i] * want_sky[k][k]));
                }
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_along_lines_of_states),
        cmocka_unit_test(full_covariances_by_brute_force),
        cmocka_unit_test(a_tracks_covariance_by_differences),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
