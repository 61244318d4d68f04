#include "tracker/orbit/orbit_track.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/core/invariant.h"
#include "sim/core/symmetric.h"
#include "tracker/mtt/mixture.h"

/* Sets sky state and cross-covariance of a track's orbit from its state and covariance. */
static void project_to_sky(bst_orbit_track *t, const bst_od_observer *observer) {
    bst_od_sight sight;
    double slope[4][6];
    bst_od_project(&t->state, t->covariance, observer, &sight, slope, t->sky.covariance);
    t->sky.direction = sight.direction;
    t->sky.rate_radps = sight.rate_radps;
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 4; k++) {
            t->cross[i][k] = 0.0;
            for (int j = 0; j < 6; j++) {
                t->cross[i][k] += t->covariance[i][j] * slope[k][j];
            }
        }
    }
}

void bst_orbit_track_start(const bst_sky_state *sky, const bst_od_observer *observer,
                           const bst_orbit_range *range, bst_orbit_track *out) {
    assert(sky && observer && range && out && range->range_m > 0.0);
    *out = (bst_orbit_track){.valid = true};
    bst_od_from_track(observer, sky->direction, sky->rate_radps, sky->covariance, range,
                      &out->state, out->covariance);
    project_to_sky(out, observer);
}

/* Acceleration by the Earth's oblateness (J2 only), m/s^2 (Montenbruck and Gill 2000, 3.2.5). The
 * axis is taken along z of GCRF: 0.1 degree of precession changes it by less than 1 %. */
static bst_vec3 oblateness(bst_vec3 r) {
    const double j2 = 1.08263e-3;
    double n2 = bst_vec3_dot(r, r), n = sqrt(n2);
    double k =
        -1.5 * j2 * BST_EARTH_MU_M3PS2 * BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M / (n2 * n2 * n);
    double z2 = 5.0 * r.z * r.z / n2;
    return (bst_vec3){k * r.x * (1.0 - z2), k * r.y * (1.0 - z2), k * r.z * (3.0 - z2)};
}

/* Longest step between two J2 kicks; the error is a ten-thousandth of the J2 effect. */
#define PUSH_S 30.0

/* Two-body motion with half kicks of J2 before and after (Strang splitting). */
static bst_status propagate_j2(bst_ctx *ctx, bst_orbit_track *t, double to_s) {
    const bst_od_motion motion = {.forces = NULL};
    double span = to_s - t->state.time_s;
    int steps = (int)ceil(fabs(span) / PUSH_S);
    double h = steps > 0 ? span / steps : 0.0, from_s = t->state.time_s;
    for (int k = 1; k <= steps; k++) {
        bst_od_state state;
        double moved[6][6];
        bst_vec3 *v = &t->state.velocity_mps;
        *v = bst_vec3_axpy(*v, 0.5 * h, oblateness(t->state.position_m));
        BST_TRY(bst_od_propagate(ctx, &motion, &t->state, t->covariance,
                                 k < steps ? from_s + k * h : to_s, &state, moved));
        t->state = state;
        *v = bst_vec3_axpy(*v, 0.5 * h, oblateness(t->state.position_m));
        memcpy(t->covariance, moved, sizeof moved);
    }
    return BST_OK;
}

bool bst_orbit_track_predict(bst_orbit_track *t, double noise_m2ps3,
                             const bst_od_observer *observer) {
    assert(t && t->valid && observer && noise_m2ps3 >= 0.0);
    bst_ctx quiet = {0}; /* an orbit that ends is no failure of the run */
    double dt = fabs(observer->time_s - t->state.time_s);
    t->valid = t->valid && propagate_j2(&quiet, t, observer->time_s) == BST_OK;
    if (!t->valid) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        t->covariance[i][i] += noise_m2ps3 * dt * dt * dt / 3.0;
        t->covariance[i][i + 3] += noise_m2ps3 * dt * dt / 2.0;
        t->covariance[i + 3][i] += noise_m2ps3 * dt * dt / 2.0;
        t->covariance[i + 3][i + 3] += noise_m2ps3 * dt;
    }
    project_to_sky(t, observer);
    for (int i = 0; i < 4; i++) {
        t->valid = t->valid && t->sky.covariance[i][i] > 0.0 && isfinite(t->sky.covariance[i][i]);
    }
    return t->valid;
}

/* Difference b - a of two sky states in the tangent axes at a, and b's covariance there. */
static void sky_difference(const bst_sky_state *a, const bst_sky_state *b, double difference[4],
                           double covariance[4][4]) {
    bst_tangent axes = bst_tangent_at(a->direction);
    bst_vec3 step = bst_tangent_log(a->direction, b->direction);
    bst_vec3 rate =
        bst_vec3_sub(bst_tangent_carry(b->direction, a->direction, b->rate_radps), a->rate_radps);
    difference[0] = bst_vec3_dot(step, axes.e1);
    difference[1] = bst_vec3_dot(step, axes.e2);
    difference[2] = bst_vec3_dot(rate, axes.e1);
    difference[3] = bst_vec3_dot(rate, axes.e2);
    bst_sky_turn_covariance(b, a->direction, covariance);
}

bool bst_orbit_track_update(bst_orbit_track *t, const bst_sky_state *posterior) {
    assert(t && t->valid && posterior &&
           bst_is_unit_vec3(posterior->direction, BST_UNIT_TOLERANCE));
    double d[4], after[4][4], inverse[4][4], gain[6][4], half[6][4];
    t->valid = t->valid && bst_symmetric_invert(4, t->sky.covariance[0], inverse[0]);
    if (!t->valid) {
        return false;
    }
    sky_difference(&t->sky, posterior, d, after);
    double x[6];
    for (int i = 0; i < 6; i++) {
        x[i] = 0.0;
        for (int k = 0; k < 4; k++) {
            gain[i][k] = 0.0;
            for (int j = 0; j < 4; j++) {
                gain[i][k] += t->cross[i][j] * inverse[j][k];
            }
            x[i] += gain[i][k] * d[k];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 4; k++) {
            half[i][k] = 0.0;
            for (int j = 0; j < 4; j++) {
                half[i][k] += gain[i][j] * (after[j][k] - t->sky.covariance[j][k]);
            }
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < 4; k++) {
                sum += half[i][k] * gain[j][k];
            }
            t->covariance[i][j] += sum;
            t->covariance[j][i] = t->covariance[i][j];
        }
        t->valid = t->valid && t->covariance[i][i] > 0.0 && isfinite(x[i]);
    }
    t->state.position_m = bst_vec3_add(t->state.position_m, (bst_vec3){x[0], x[1], x[2]});
    t->state.velocity_mps = bst_vec3_add(t->state.velocity_mps, (bst_vec3){x[3], x[4], x[5]});
    return t->valid;
}

bool bst_orbit_track_range(bst_orbit_track *t, const bst_od_observer *observer,
                           const bst_orbit_measured_range *z) {
    static const double MOST_SIGMA = 5.0;
    assert(t && t->valid && observer && z && z->range_m > 0.0 && z->sigma_m > 0.0);
    bst_vec3 way = bst_vec3_sub(t->state.position_m, observer->position_m);
    double range_m = bst_vec3_norm(way), variance = z->sigma_m * z->sigma_m;
    double gain[6], along = 0.0, x[6];
    if (t->ranged && z->correlation_s > 0.0) {
        double since_s = fabs(t->state.time_s - t->range_s);
        variance *= fmax(2.0 * z->correlation_s / fmax(since_s, 1e-9), 1.0);
    }
    const double slope[3] = {way.x / range_m, way.y / range_m, way.z / range_m};
    for (int i = 0; i < 6; i++) {
        gain[i] = 0.0;
        for (int k = 0; k < 3; k++) {
            gain[i] += t->covariance[i][k] * slope[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        along += slope[k] * gain[k];
    }
    double total = along + variance, step = z->range_m - range_m;
    if (!(step * step <= MOST_SIGMA * MOST_SIGMA * (along + z->sigma_m * z->sigma_m))) {
        return false;
    }
    for (int i = 0; i < 6; i++) {
        x[i] = gain[i] / total * step;
        for (int k = 0; k <= i; k++) {
            t->covariance[i][k] -= gain[i] * gain[k] / total;
            t->covariance[k][i] = t->covariance[i][k];
        }
        t->valid = t->valid && t->covariance[i][i] > 0.0 && isfinite(x[i]);
    }
    t->state.position_m = bst_vec3_add(t->state.position_m, (bst_vec3){x[0], x[1], x[2]});
    t->state.velocity_mps = bst_vec3_add(t->state.velocity_mps, (bst_vec3){x[3], x[4], x[5]});
    t->ranged = true;
    t->range_s = t->state.time_s;
    project_to_sky(t, observer);
    return t->valid;
}

bool bst_sky_fuse(bst_sky_state *a, const bst_sky_state *b) {
    double d[4], pb[4][4], sum[4][4], inverse[4][4], gain[4][4], after[4][4], x[4];
    sky_difference(a, b, d, pb);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            sum[i][j] = a->covariance[i][j] + pb[i][j];
        }
    }
    if (!bst_symmetric_invert(4, sum[0], inverse[0])) {
        return false;
    }
    for (int i = 0; i < 4; i++) {
        x[i] = 0.0;
        for (int j = 0; j < 4; j++) {
            gain[i][j] = 0.0;
            for (int k = 0; k < 4; k++) {
                gain[i][j] += a->covariance[i][k] * inverse[k][j];
            }
            x[i] += gain[i][j] * d[j];
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            after[i][j] = a->covariance[i][j];
            for (int k = 0; k < 4; k++) {
                after[i][j] -= gain[i][k] * a->covariance[k][j];
            }
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            a->covariance[i][j] = 0.5 * (after[i][j] + after[j][i]);
        }
    }
    bst_sky_shift_by(a, x);
    return true;
}
