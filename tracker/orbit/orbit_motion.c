#include "tracker/orbit/orbit_motion.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/astro/sgp4_fit.h"

#include "sim/astro/kepler.h"
#include "sim/core/invariant.h"
#include "sim/core/tangent.h"

struct bst_od_path {
    bst_od_state state;
    double gm;
    bst_trajectory *trajectory; /* numerical integration */
    bst_sgp4 *sgp4;             /* both NULL: two-body motion */
    bst_od_motion motion;
};

double bst_od_gm(const bst_od_motion *motion) {
    return motion->forces && !motion->sgp4 ? bst_gravity_gm(motion->forces->gravity)
                                           : BST_EARTH_MU_M3PS2;
}

static bst_status teme_at_hour(bst_ctx *ctx, const bst_od_motion *motion, int64_t hour,
                               const bst_mat3 **out) {
    enum { SLOTS = sizeof motion->sgp4->hours / sizeof *motion->sgp4->hours };
    int slot = (int)(((hour % SLOTS) + SLOTS) % SLOTS);
    if (!motion->sgp4->hours[slot].valid || motion->sgp4->hours[slot].hour != hour) {
        bst_sky_rotation sky;
        BST_TRY(bst_sky_clock_at(ctx, motion->sgp4->clock,
                                 bst_time_add(motion->epoch, 3600.0 * (double)hour), &sky));
        motion->sgp4->hours[slot].gcrf_from_teme = sky.frames.gcrf_from_teme;
        motion->sgp4->hours[slot].hour = hour;
        motion->sgp4->hours[slot].valid = true;
    }
    *out = &motion->sgp4->hours[slot].gcrf_from_teme;
    return BST_OK;
}

/* gcrf_from_teme at a time and its derivative (1/s), linear between full hours. Nutation is
 * nonlinear by 5e-11 rad within an hour: 2 mm at geostationary distance. */
static bst_status teme_at(bst_ctx *ctx, const bst_od_motion *motion, double time_s,
                          bst_mat3 *rotation, bst_mat3 *rate) {
    double hour = floor(time_s / 3600.0), f = time_s / 3600.0 - hour;
    const bst_mat3 *a, *b;
    BST_TRY(teme_at_hour(ctx, motion, (int64_t)hour, &a));
    BST_TRY(teme_at_hour(ctx, motion, (int64_t)hour + 1, &b));
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            rate->m[i][k] = (b->m[i][k] - a->m[i][k]) / 3600.0;
            rotation->m[i][k] = a->m[i][k] + f * (b->m[i][k] - a->m[i][k]);
        }
    }
    return BST_OK;
}

static bst_status create_sgp4(bst_ctx *ctx, bst_od_path *path) {
    const bst_od_state *s = &path->state;
    bst_mat3 rotation, rate;
    BST_TRY(teme_at(ctx, &path->motion, s->time_s, &rotation, &rate));
    bst_elements elements = {.bstar = path->motion.sgp4->bstar};
    bst_time_utc(bst_time_add(path->motion.epoch, s->time_s), &elements.epoch_utc_jd1,
                 &elements.epoch_utc_jd2);
    bst_vec3 r = bst_mat3_transpose_mul_vec(&rotation, s->position_m);
    bst_vec3 drift = bst_mat3_mul_vec(&rate, r);
    bst_vec3 v = bst_mat3_transpose_mul_vec(&rotation, bst_vec3_sub(s->velocity_mps, drift));
    BST_TRY(bst_sgp4_through(ctx, r, v, &elements));
    return bst_sgp4_create(ctx, &elements, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &path->sgp4);
}

static bst_status sgp4_state(bst_ctx *ctx, const bst_od_path *path, double time_s,
                             bst_od_state *out) {
    bst_vec3 r, v;
    bst_mat3 rotation, rate;
    if (!bst_sgp4_motion(path->sgp4, (time_s - path->state.time_s) / 60.0, &r, &v)) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "SGP4 has no place %.6g s from the state's time",
                        time_s - path->state.time_s);
    }
    BST_TRY(teme_at(ctx, &path->motion, time_s, &rotation, &rate));
    out->position_m = bst_mat3_mul_vec(&rotation, r);
    out->velocity_mps = bst_vec3_add(bst_mat3_mul_vec(&rotation, v), bst_mat3_mul_vec(&rate, r));
    return BST_OK;
}

bst_status bst_od_path_create(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                              bst_od_path **out) {
    assert(motion && state && out);
    *out = NULL;
    bst_od_path *path = malloc(sizeof *path);
    if (!path) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an orbit");
    }
    *path = (bst_od_path){.state = *state, .gm = bst_od_gm(motion), .motion = *motion};
    if (motion->sgp4) {
        bst_status status = create_sgp4(ctx, path);
        if (status != BST_OK) {
            free(path);
            return status;
        }
    } else if (motion->forces) {
        const bst_trajectory_options options = {.forces = *motion->forces,
                                                .epoch = motion->epoch,
                                                .at_s = state->time_s,
                                                .position_m = state->position_m,
                                                .velocity_mps = state->velocity_mps};
        bst_status status = bst_trajectory_create(ctx, &options, &path->trajectory);
        if (status != BST_OK) {
            free(path);
            return status;
        }
    }
    *out = path;
    return BST_OK;
}

void bst_od_path_free(bst_od_path *path) {
    if (path) {
        bst_trajectory_free(path->trajectory);
        bst_sgp4_free(path->sgp4);
        free(path);
    }
}

bst_status bst_od_path_state(bst_ctx *ctx, const bst_od_path *path, double time_s,
                             bst_od_state *out) {
    assert(path && out && isfinite(time_s));
    out->time_s = time_s;
    if (path->sgp4) {
        return sgp4_state(ctx, path, time_s, out);
    }
    if (path->trajectory) {
        return bst_trajectory_state(ctx, path->trajectory, time_s, &out->position_m,
                                    &out->velocity_mps);
    }
    return bst_kepler_propagate(ctx, path->gm, path->state.position_m, path->state.velocity_mps,
                                time_s - path->state.time_s, &out->position_m, &out->velocity_mps);
}

void bst_od_see(const bst_od_state *state, const bst_od_observer *observer, bst_od_sight *out) {
    assert(state && observer && out);
    const bst_vec3 r = state->position_m, v = state->velocity_mps;
    double distance = bst_vec3_norm(r), u = BST_EARTH_MU_M3PS2 / (distance * distance * distance);
    bst_vec3 a = bst_vec3_scale(r, -u);
    bst_vec3 away = bst_vec3_sub(r, observer->position_m);
    /* velocity of the emission point by light time tau */
    bst_vec3 drift = bst_vec3_add(v, observer->earth_bary_mps);
    bst_vec3 line = away;
    double tau = bst_vec3_norm(away) / BST_LIGHT_SPEED_MPS;
    for (int i = 0; i < 4; i++) {
        line = bst_vec3_axpy(bst_vec3_axpy(away, -tau, drift), 0.5 * tau * tau, a);
        tau = bst_vec3_norm(line) / BST_LIGHT_SPEED_MPS;
    }
    out->range_m = bst_vec3_norm(line);
    out->direction = bst_vec3_unit(line);
    /* d(line)/dt = v_body(t - tau) (1 - tau') - v_observer - tau' v_Earth, tau' = range rate / c */
    bst_vec3 emitted = bst_vec3_axpy(v, -tau, a);
    bst_vec3 still = bst_vec3_sub(emitted, observer->velocity_mps);
    bst_vec3 moved = bst_vec3_add(emitted, observer->earth_bary_mps);
    out->range_rate_mps = bst_vec3_dot(out->direction, still) /
                          (1.0 + bst_vec3_dot(out->direction, moved) / BST_LIGHT_SPEED_MPS);
    bst_vec3 rate = bst_vec3_axpy(still, -out->range_rate_mps / BST_LIGHT_SPEED_MPS, moved);
    out->rate_radps = bst_vec3_scale(bst_tangent_project(out->direction, rate), 1.0 / out->range_m);
}

/* ------------------------------------------------------------------ Covariance */

/* Displaces one component of an orbit state. */
static void add_to_state(bst_od_state *s, int axis, double amount) {
    double *place[6] = {&s->position_m.x,   &s->position_m.y,   &s->position_m.z,
                        &s->velocity_mps.x, &s->velocity_mps.y, &s->velocity_mps.z};
    *place[axis] += amount;
}

/* Step of central differences: far above rounding (1e-9 m) and small against the scale on which
 * two-body motion is nonlinear. */
static double step_of(const bst_od_state *s, int axis) {
    double r = bst_vec3_norm(s->position_m), v = bst_vec3_norm(s->velocity_mps);
    return axis < 3 ? 1e-6 * r : 1e-6 * v;
}

bst_status bst_od_propagate(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                            const double covariance[6][6], double time_s, bst_od_state *out,
                            double covariance_out[6][6]) {
    assert(motion && state && out && bst_is_covariance(&covariance[0][0], 6));
    double transition[6][6], half[6][6];
    for (int i = -1; i < 12; i++) {
        int axis = i / 2;
        bst_od_state from = *state, to;
        bst_od_path *path;
        double step = i < 0 ? 0.0 : step_of(state, axis);
        if (i >= 0) {
            add_to_state(&from, axis, i % 2 ? -step : step);
        }
        BST_TRY(bst_od_path_create(ctx, motion, &from, &path));
        bst_status status = bst_od_path_state(ctx, path, time_s, &to);
        bst_od_path_free(path);
        BST_TRY(status);
        if (i < 0) {
            *out = to;
            continue;
        }
        const double y[6] = {to.position_m.x,   to.position_m.y,   to.position_m.z,
                             to.velocity_mps.x, to.velocity_mps.y, to.velocity_mps.z};
        for (int k = 0; k < 6; k++) {
            transition[k][axis] = i % 2 ? (transition[k][axis] - y[k]) / (2.0 * step) : y[k];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            half[i][j] = 0.0;
            for (int k = 0; k < 6; k++) {
                half[i][j] += transition[i][k] * covariance[k][j];
            }
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < 6; k++) {
                sum += half[i][k] * transition[j][k];
            }
            covariance_out[i][j] = covariance_out[j][i] = sum;
        }
    }
    return BST_OK;
}

void bst_od_project(const bst_od_state *state, const double covariance[6][6],
                    const bst_od_observer *observer, bst_od_sight *out, double slope[4][6],
                    double sky_covariance[4][4]) {
    bst_od_see(state, observer, out);
    bst_tangent axes = bst_tangent_at(out->direction);
    for (int k = 0; k < 6; k++) {
        /* within a thousandth of the range, which may be much smaller than the orbit's radius */
        double step = k < 3 ? 1e-5 * out->range_m : step_of(state, k);
        bst_od_sight side[2];
        for (int i = 0; i < 2; i++) {
            bst_od_state near = *state;
            add_to_state(&near, k, i ? -step : step);
            bst_od_see(&near, observer, &side[i]);
        }
        bst_vec3 d = bst_vec3_sub(side[0].direction, side[1].direction);
        bst_vec3 r =
            bst_vec3_sub(bst_tangent_carry(side[0].direction, out->direction, side[0].rate_radps),
                         bst_tangent_carry(side[1].direction, out->direction, side[1].rate_radps));
        const double column[4] = {bst_vec3_dot(axes.e1, d), bst_vec3_dot(axes.e2, d),
                                  bst_vec3_dot(axes.e1, r), bst_vec3_dot(axes.e2, r)};
        for (int i = 0; i < 4; i++) {
            slope[i][k] = column[i] / (2.0 * step);
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int a = 0; a < 6; a++) {
                for (int b = 0; b < 6; b++) {
                    sum += slope[i][a] * covariance[a][b] * slope[j][b];
                }
            }
            sky_covariance[i][j] = sky_covariance[j][i] = sum;
        }
    }
}

bst_status bst_od_predict(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                          const double covariance[6][6], const bst_od_observer *observer,
                          bst_od_sight *out, double sky_covariance[4][4]) {
    bst_od_state then;
    double p[6][6], slope[4][6];
    BST_TRY(bst_od_propagate(ctx, motion, state, covariance, observer->time_s, &then, p));
    bst_od_project(&then, p, observer, out, slope, sky_covariance);
    return BST_OK;
}

void bst_od_from_track(const bst_od_observer *observer, bst_vec3 direction, bst_vec3 rate_radps,
                       const double sky_covariance[4][4], const bst_orbit_range *range,
                       bst_od_state *out, double covariance[6][6]) {
    assert(observer && range && out && range->range_m > 0.0);
    assert(bst_is_unit_vec3(direction, BST_UNIT_TOLERANCE));
    const double range_m = range->range_m, range_rate_mps = range->range_rate_mps;
    double tau = range_m / BST_LIGHT_SPEED_MPS;
    bst_tangent axes = bst_tangent_at(direction);
    /* the line of sight contains -tau times the Earth's velocity and the body's own */
    bst_vec3 line =
        bst_vec3_axpy(bst_vec3_scale(direction, range_m), tau, observer->earth_bary_mps);
    double slow = 1.0 + range_rate_mps / BST_LIGHT_SPEED_MPS;
    bst_vec3 rate = bst_vec3_axpy(bst_vec3_scale(direction, range_rate_mps), range_m, rate_radps);
    rate = bst_vec3_axpy(rate, range_rate_mps / BST_LIGHT_SPEED_MPS, observer->earth_bary_mps);
    out->time_s = observer->time_s;
    /* rate of the line of sight: v (1 - tau') - v_observer */
    out->velocity_mps = bst_vec3_scale(bst_vec3_add(observer->velocity_mps, rate), slow);
    out->position_m =
        bst_vec3_axpy(bst_vec3_add(observer->position_m, line), tau, out->velocity_mps);
    /* columns: d1, d2, r1, r2, range, range rate */
    const bst_vec3 e[2] = {axes.e1, axes.e2};
    bst_vec3 position[6] = {{0}}, velocity[6] = {{0}};
    for (int k = 0; k < 2; k++) {
        position[k] = bst_vec3_scale(e[k], range_m);
        velocity[k] = bst_vec3_axpy(bst_vec3_scale(e[k], range_rate_mps),
                                    -range_m * bst_vec3_dot(rate_radps, e[k]), direction);
        velocity[2 + k] = position[k];
    }
    const double c = BST_LIGHT_SPEED_MPS;
    position[4] = bst_vec3_axpy(direction, 1.0 / c, observer->earth_bary_mps);
    velocity[4] = rate_radps;
    velocity[5] = bst_vec3_axpy(bst_vec3_axpy(direction, 1.0 / c, observer->earth_bary_mps),
                                1.0 / c, out->velocity_mps);
    /* a farther body moves longer during the light time */
    position[4] = bst_vec3_axpy(position[4], 1.0 / c, out->velocity_mps);
    for (int k = 0; k < 6; k++) {
        position[k] = bst_vec3_axpy(position[k], tau, velocity[k]);
    }
    double p[6][6] = {{0}};
    for (int i = 0; i < 4; i++) {
        memcpy(p[i], sky_covariance[i], sizeof sky_covariance[i]);
    }
    p[4][4] = range->range_sigma_m * range->range_sigma_m;
    p[5][5] = range->range_rate_sigma_mps * range->range_rate_sigma_mps;
    double map[6][6];
    for (int k = 0; k < 6; k++) {
        const double column[6] = {position[k].x, position[k].y, position[k].z,
                                  velocity[k].x, velocity[k].y, velocity[k].z};
        for (int i = 0; i < 6; i++) {
            map[i][k] = column[i];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int a = 0; a < 6; a++) {
                for (int b = 0; b < 6; b++) {
                    sum += map[i][a] * p[a][b] * map[j][b];
                }
            }
            covariance[i][j] = covariance[j][i] = sum;
        }
    }
}
