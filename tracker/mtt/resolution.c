#include "tracker/mtt/resolution.h"

#include <assert.h>
#include <math.h>

/* -ln of the probability of an unresolved pair at merge_rad: 5 % */
static const double LOG_RARE = 2.9957;
/* a share of light below this carries no information on the position */
static const double LEAST_SHARE = 1e-3;
/* 1 sigma of the motion of two objects relative to each other between two frames, share of the
 * offset from their centre of light: a design choice */
static const double RELATIVE_MOTION = 0.5;

/* Position covariance of a track (11, 12, 22) in the tangent axes of a direction nearby. */
static void position_covariance(const bst_sky_state *state, bst_vec3 direction, double out[3]) {
    double p[4][4];
    bst_sky_turn_covariance(state, direction, p);
    out[0] = p[0][0];
    out[1] = p[0][1];
    out[2] = p[1][1];
}

double bst_mtt_unresolved(double merge_rad, const bst_mtt_track *a, const bst_mtt_track *b) {
    bst_vec3 d = a->state.direction, to = bst_tangent_log(d, b->state.direction);
    bst_tangent axes = bst_tangent_at(d);
    double x = bst_vec3_dot(to, axes.e1), y = bst_vec3_dot(to, axes.e2), pa[3], pb[3];
    position_covariance(&a->state, d, pa);
    position_covariance(&b->state, d, pb);
    double s2 = 0.5 * merge_rad * merge_rad / LOG_RARE;
    double p11 = s2 + pa[0] + pb[0], p12 = pa[1] + pb[1], p22 = s2 + pa[2] + pb[2];
    double det = p11 * p22 - p12 * p12;
    double chi2 = (p22 * x * x - 2.0 * p12 * x * y + p11 * y * y) / det;
    return det > 0.0 ? s2 / sqrt(det) * exp(-0.5 * chi2) : 0.0;
}

/* Share of the light of the first of two sources, whose magnitudes differ by off_mag. */
static double share_of(double off_mag) {
    return 1.0 / (1.0 + pow(10.0, 0.4 * off_mag));
}

double bst_mtt_light_share(const bst_mtt_track *a, const bst_mtt_track *b) {
    return share_of(a->v_mag - b->v_mag);
}

double bst_mtt_detection_share(const bst_mtt_detection *a, const bst_mtt_detection *b) {
    bool known = isfinite(a->v_mag_sigma) && isfinite(b->v_mag_sigma);
    return known ? share_of(a->v_mag - b->v_mag) : 0.5;
}

/* Half the chi-square of a magnitude, at most 4.5 as in bst_mtt_brightness_cost; 0: unknown. */
static double magnitude_cost(double off_mag, double variance) {
    double chi2 = off_mag * off_mag / variance;
    return isfinite(chi2) ? 0.5 * fmin(chi2, 9.0) : 0.0;
}

/* Covariance (11, 12, 22) in the tangent axes of a direction, turned to those of another one. */
static void turn_covariance(bst_vec3 from, const double cov[3], bst_vec3 to, double out[3]) {
    bst_tangent axes = bst_tangent_at(from), own = bst_tangent_at(to);
    bst_tangent_turn_covariance(from, &axes, to, &own, cov, out);
}

/* Mean and covariance of two hypotheses on one measurement, the second of probability p. */
static bst_sky_measurement mix(const bst_sky_measurement *a, const bst_sky_measurement *b,
                               double p) {
    bst_vec3 step = bst_tangent_log(a->direction, b->direction);
    bst_sky_measurement out = {.direction = bst_tangent_exp(a->direction, bst_vec3_scale(step, p))};
    const double of_a[3] = {a->cov_11, a->cov_12, a->cov_22},
                 of_b[3] = {b->cov_11, b->cov_12, b->cov_22};
    double pa[3], pb[3];
    turn_covariance(a->direction, of_a, out.direction, pa);
    turn_covariance(b->direction, of_b, out.direction, pb);
    bst_vec3 off = bst_tangent_carry(a->direction, out.direction, step);
    bst_tangent axes = bst_tangent_at(out.direction);
    double x = bst_vec3_dot(off, axes.e1), y = bst_vec3_dot(off, axes.e2);
    out.cov_11 = (1.0 - p) * pa[0] + p * pb[0] + p * (1.0 - p) * x * x;
    out.cov_12 = (1.0 - p) * pa[1] + p * pb[1] + p * (1.0 - p) * x * y;
    out.cov_22 = (1.0 - p) * pa[2] + p * pb[2] + p * (1.0 - p) * y * y;
    return out;
}

bst_mtt_doubtful bst_mtt_doubt_of_pair(double merge_rad, double detection_probability,
                                       const bst_mtt_detection *single,
                                       const bst_mtt_detection *own,
                                       const bst_mtt_detection *companion) {
    assert(single && own && companion && merge_rad > 0.0);
    bst_vec3 to = bst_tangent_log(own->sky.direction, companion->sky.direction);
    double s2 = 0.5 * merge_rad * merge_rad / LOG_RARE;
    double share = bst_mtt_detection_share(own, companion);
    double unresolved = exp(-0.5 * bst_vec3_dot(to, to) / s2);
    double variance =
        0.09 + own->v_mag_sigma * own->v_mag_sigma + single->v_mag_sigma * single->v_mag_sigma;
    double sum_mag = own->v_mag + 2.5 * log10(share);
    double merged = unresolved * exp(-magnitude_cost(single->v_mag - sum_mag, variance));
    double missed = (1.0 - unresolved) * (1.0 - detection_probability) *
                    exp(-magnitude_cost(single->v_mag - own->v_mag, variance));
    /* the object was as far from the centre of light as in the other frame, but for its motion
     * relative to the companion */
    bst_vec3 off = bst_tangent_carry(own->sky.direction, single->sky.direction,
                                     bst_vec3_scale(to, -(1.0 - share)));
    bst_tangent axes = bst_tangent_at(single->sky.direction);
    double x = RELATIVE_MOTION * bst_vec3_dot(off, axes.e1),
           y = RELATIVE_MOTION * bst_vec3_dot(off, axes.e2);
    const double cov[3] = {single->sky.cov_11 + x * x, single->sky.cov_12 + x * y,
                           single->sky.cov_22 + y * y};
    double turned[3];
    bst_vec3 there = bst_tangent_exp(single->sky.direction, off);
    turn_covariance(single->sky.direction, cov, there, turned);
    const bst_sky_measurement implied = {there, turned[0], turned[1], turned[2]};
    double p = merged / (merged + missed);
    return (bst_mtt_doubtful){mix(&single->sky, &implied, p), p};
}

/* Measurement of the direction of a track with share w of the light: nu is the measured centre of
 * light minus the predicted track, other the other's contribution to it, both in the axes of the
 * track; r the covariance of their difference. */
static bst_sky_measurement implied(const bst_sky_state *state, double w, const double nu[2],
                                   const double other[2], const double r[3]) {
    bst_tangent axes = bst_tangent_at(state->direction);
    w = fmax(w, LEAST_SHARE);
    bst_sky_measurement out;
    out.direction =
        bst_tangent_exp(state->direction,
                        bst_tangent_vector(&axes, (nu[0] - other[0]) / w, (nu[1] - other[1]) / w));
    const double cov[3] = {r[0] / (w * w), r[1] / (w * w), r[2] / (w * w)};
    double turned[3];
    turn_covariance(state->direction, cov, out.direction, turned);
    out.cov_11 = turned[0];
    out.cov_12 = turned[1];
    out.cov_22 = turned[2];
    return out;
}

/* The part of bst_mtt_merge for track a. */
static bool merge_one(const bst_mtt_track *a, const bst_mtt_track *b,
                      const bst_sky_measurement *measurement, double floor_rad, bst_mtt_merged *fit,
                      bst_sky_measurement *out) {
    bst_sky_innovation innovation;
    if (!bst_sky_innovate(&a->state, measurement, NULL, &innovation)) {
        return false;
    }
    double wa = bst_mtt_light_share(a, b), wb = 1.0 - wa, pa[3], pb[3], r[3], s[3];
    bst_tangent axes = bst_tangent_at(a->state.direction);
    bst_vec3 to = bst_tangent_log(a->state.direction, b->state.direction);
    double other[2] = {wb * bst_vec3_dot(to, axes.e1), wb * bst_vec3_dot(to, axes.e2)};
    position_covariance(&a->state, a->state.direction, pa);
    position_covariance(&b->state, a->state.direction, pb);
    for (int i = 0; i < 3; i++) {
        double floor2 = i == 1 ? 0.0 : floor_rad * floor_rad;
        r[i] = innovation.r[i] + wb * wb * pb[i] + floor2;
        s[i] = r[i] + wa * wa * pa[i];
    }
    double x = innovation.nu[0] - other[0], y = innovation.nu[1] - other[1];
    double det = s[0] * s[2] - s[1] * s[1];
    if (!(det > 0.0)) {
        return false;
    }
    fit->chi2 = (s[2] * x * x - 2.0 * s[1] * x * y + s[0] * y * y) / det;
    fit->log_likelihood = -0.5 * fit->chi2 - 0.5 * log(det) - log(2.0 * BST_PI);
    *out = implied(&a->state, wa, innovation.nu, other, r);
    return true;
}

bool bst_mtt_merge(const bst_mtt_track *a, const bst_mtt_track *b,
                   const bst_sky_measurement *measurement, double floor_rad, bst_mtt_merged *out) {
    assert(a && b && measurement && out);
    return merge_one(b, a, measurement, floor_rad, out, &out->of_b) &&
           merge_one(a, b, measurement, floor_rad, out, &out->of_a);
}

bst_mtt_doubtful bst_mtt_doubt_of_track(const bst_mtt_params *params, const bst_mtt_track *a,
                                        const bst_mtt_track *b, const bst_mtt_detection *detection,
                                        double detection_probability,
                                        double single_log_likelihood) {
    assert(params && a && b && detection);
    bst_mtt_merged fit;
    if (!bst_mtt_merge(a, b, &detection->sky, params->merge_floor_rad, &fit)) {
        return (bst_mtt_doubtful){detection->sky, 0.0};
    }
    double unresolved = fmin(bst_mtt_unresolved(params->merge_rad, a, b), 0.999);
    double exists = fmin(1.0, b->existence / a->existence);
    double alone = 1.0 - exists + exists * (1.0 - unresolved) * (1.0 - detection_probability);
    double log_ratio = log(exists * unresolved / alone) + fit.log_likelihood -
                       bst_mtt_merged_brightness_cost(a, b, detection) - single_log_likelihood;
    double p = 1.0 / (1.0 + exp(-log_ratio));
    return (bst_mtt_doubtful){mix(&detection->sky, &fit.of_a, p), p};
}

double bst_mtt_merged_brightness_cost(const bst_mtt_track *a, const bst_mtt_track *b,
                                      const bst_mtt_detection *detection) {
    double v = a->v_mag + 2.5 * log10(bst_mtt_light_share(a, b));
    double variance = fmax(a->v_mag_variance, b->v_mag_variance) + 0.09 +
                      detection->v_mag_sigma * detection->v_mag_sigma;
    double chi2 = (v - detection->v_mag) * (v - detection->v_mag) / variance;
    return isfinite(chi2) ? 0.5 * fmin(chi2, 9.0) : 0.0;
}
