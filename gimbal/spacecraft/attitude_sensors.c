#include "gimbal/spacecraft/attitude_sensors.h"

#include <assert.h>

#include "sim/astro/bodies.h"
#include "sim/core/invariant.h"

#define C bst_spacecraft_star_tracker_config
const bst_config_desc bst_star_tracker_config_table[] = {
    BST_REALS(C, axis, "", -1e6, 1e6, NULL, "Boresight in body axes, any length."),
    BST_REAL(C, noise_arcsec, "arcsec", 1e-6, 36000, "3", "White noise across the boresight."),
    BST_REAL(C, noise_about_axis_arcsec, "arcsec", 1e-6, 36000, "20",
             "White noise about the boresight."),
    BST_REALS(C, misalignment_arcsec, "arcsec", -36000, 36000, "[0, 0, 0]",
              "Constant error of its alignment, a rotation about body axes, unknown onboard."),
    BST_FORMER("alignment_arcsec", "misalignment_arcsec"),
    BST_REAL(C, rate_hz, "Hz", 1e-3, 1000, "4", "Measurements a second; divides the gyro's rate."),
    BST_REAL(C, latency_s, "s", 0, 10, "0.1",
             "From the instant of a measurement to when the filter has it."),
    BST_REAL(C, sun_exclusion_deg, "deg", 0, 180, "30",
             "Blind when the Sun is nearer to the boresight."),
    BST_REAL(C, earth_exclusion_deg, "deg", 0, 180, "20",
             "Blind when the Earth's limb is nearer to the boresight."),
    BST_REAL(C, rate_limit_degps, "deg/s", 1e-6, 1000, "2", "Blind while the body turns faster."),
    BST_REALS(C, outage_s, "s", 0, 1e9, "[0, 0]", "Blind from the first to the second time."),
    BST_CONFIG_END};
#undef C

#define C bst_spacecraft_gyro_config
const bst_config_desc bst_gyro_config_table[] = {
    BST_REAL(C, rate_hz, "Hz", 0.1, 10000, "100", "Samples a second; divides the plant's rate."),
    BST_REAL(C, angle_random_walk_deg_rth, "deg/sqrt(h)", 1e-9, 10, "0.005", "Angle random walk."),
    BST_REAL(C, rate_random_walk_deg_rth3, "deg/h^1.5", 1e-9, 100, "0.01",
             "Rate random walk, by which the bias drifts."),
    BST_REALS(C, bias_degph, "deg/h", -3600, 3600, "[0, 0, 0]", "Bias at the epoch."),
    BST_REAL(C, bias_sigma_degph, "deg/h", 1e-6, 3600, "0.05",
             "Drawn about each axis on top of bias_degph; what the filter first expects of it (it "
             "takes bias_degph for zero). The default is about what it comes to know."),
    BST_REALS(C, scale_factor_ppm, "1e-6", -1e5, 1e5, "[0, 0, 0]",
              "Errors of the scale factors, unknown onboard."),
    BST_REALS(C, misalignment_arcsec, "arcsec", -36000, 36000, "[0, 0, 0]",
              "Constant error of its alignment, a rotation about body axes, unknown onboard."),
    BST_FORMER("alignment_arcsec", "misalignment_arcsec"),
    BST_CONFIG_END};
#undef C

static bst_vec3 arcsec(const double v[3]) {
    return bst_vec3_scale((bst_vec3){v[0], v[1], v[2]}, BST_ARCSEC_RAD);
}

void bst_spacecraft_star_tracker_init(bst_spacecraft_star_tracker *tracker,
                                      const bst_spacecraft_star_tracker_config *c,
                                      bst_rng_key key) {
    bst_vec3 axis = bst_vec3_unit((bst_vec3){c->axis[0], c->axis[1], c->axis[2]});
    *tracker = (bst_spacecraft_star_tracker){
        .axis = axis,
        .across = bst_vec3_perpendicular(axis),
        .sigma_rad = {c->noise_arcsec * BST_ARCSEC_RAD,
                      c->noise_about_axis_arcsec * BST_ARCSEC_RAD},
        .alignment = bst_quat_from_rotvec(bst_vec3_scale(arcsec(c->misalignment_arcsec), -1.0)),
        .sun_exclusion_rad = c->sun_exclusion_deg * BST_DEG_RAD,
        .earth_exclusion_rad = c->earth_exclusion_deg * BST_DEG_RAD,
        .rate_limit_radps = c->rate_limit_degps * BST_DEG_RAD,
        .outage_s = {c->outage_s[0], c->outage_s[1]},
        .key = key};
}

bool bst_spacecraft_star_tracker_sees(const bst_spacecraft_star_tracker *tracker, double seconds,
                                      bst_quat q_body_from_gcrf, bst_vec3 rate_radps,
                                      bst_vec3 position_m, bst_vec3 sun_m) {
    assert(tracker && bst_is_unit_quat(q_body_from_gcrf, BST_UNIT_TOLERANCE));
    if ((seconds >= tracker->outage_s[0] && seconds < tracker->outage_s[1]) ||
        bst_vec3_norm(rate_radps) > tracker->rate_limit_radps) {
        return false;
    }
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(q_body_from_gcrf), tracker->axis);
    double distance = bst_vec3_norm(position_m);
    double limb = distance > BST_EARTH_RADIUS_M ? asin(BST_EARTH_RADIUS_M / distance) : BST_PI;
    bst_vec3 down = bst_vec3_scale(position_m, -1.0);
    return bst_vec3_angle(axis, sun_m) >= tracker->sun_exclusion_rad &&
           bst_vec3_angle(axis, down) >= limb + tracker->earth_exclusion_rad;
}

bst_quat bst_spacecraft_star_tracker_measure(const bst_spacecraft_star_tracker *tracker,
                                             int64_t sample, bst_quat q_body_from_gcrf) {
    double a[2], b[2];
    bst_rng_normal2(tracker->key, (uint64_t)sample, 0, a);
    bst_rng_normal2(tracker->key, (uint64_t)sample, 1, b);
    bst_vec3 third = bst_vec3_cross(tracker->axis, tracker->across);
    bst_vec3 noise = bst_vec3_scale(tracker->across, -a[0] * tracker->sigma_rad[0]);
    noise = bst_vec3_axpy(noise, -a[1] * tracker->sigma_rad[0], third);
    noise = bst_vec3_axpy(noise, -b[0] * tracker->sigma_rad[1], tracker->axis);
    return bst_quat_unit(bst_quat_mul(bst_quat_mul(bst_quat_from_rotvec(noise), tracker->alignment),
                                      q_body_from_gcrf));
}

bst_mat3 bst_spacecraft_star_tracker_covariance(const bst_spacecraft_star_tracker *tracker) {
    double across = tracker->sigma_rad[0] * tracker->sigma_rad[0];
    double more = tracker->sigma_rad[1] * tracker->sigma_rad[1] - across;
    double a[3] = {tracker->axis.x, tracker->axis.y, tracker->axis.z};
    bst_mat3 out;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out.m[i][j] = (i == j ? across : 0.0) + more * a[i] * a[j];
        }
    }
    return out;
}

static bst_vec3 normal3(bst_rng_key key, uint64_t sample, uint64_t draw) {
    double a[2], b[2];
    bst_rng_normal2(key, sample, draw, a);
    bst_rng_normal2(key, sample, draw + 1, b);
    return (bst_vec3){a[0], a[1], b[0]};
}

void bst_spacecraft_gyro_init(bst_spacecraft_gyro *gyro, const bst_spacecraft_gyro_config *c,
                              double dt_s, bst_rng_key key) {
    bst_mat3 turned = bst_quat_to_mat3(
        bst_quat_from_rotvec(bst_vec3_scale(arcsec(c->misalignment_arcsec), -1.0)));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            turned.m[i][j] *= 1.0 + 1e-6 * c->scale_factor_ppm[i];
        }
    }
    bst_vec3 bias = bst_vec3_axpy((bst_vec3){c->bias_degph[0], c->bias_degph[1], c->bias_degph[2]},
                                  c->bias_sigma_degph, normal3(key, 0, 0));
    *gyro =
        (bst_spacecraft_gyro){.angle_walk = c->angle_random_walk_deg_rth * BST_DEG_RAD / 60.0,
                              .rate_walk = c->rate_random_walk_deg_rth3 * BST_DEG_RAD / 216000.0,
                              .response = turned,
                              .bias_radps = bst_vec3_scale(bias, BST_DEG_RAD / 3600.0),
                              .dt_s = dt_s,
                              .key = key};
}

bst_vec3 bst_spacecraft_gyro_measure(bst_spacecraft_gyro *gyro, bst_vec3 turn_rad) {
    uint64_t sample = (uint64_t)++gyro->samples;
    double dt = gyro->dt_s, v = gyro->angle_walk, u = gyro->rate_walk;
    double a[2], b[2], c[2];
    bst_rng_normal2(gyro->key, sample, 0, a);
    bst_rng_normal2(gyro->key, sample, 1, b);
    bst_rng_normal2(gyro->key, sample, 2, c);
    bst_vec3 walk = {a[0], a[1], b[0]}, noise = {b[1], c[0], c[1]};
    bst_vec3 next = bst_vec3_axpy(gyro->bias_radps, u * sqrt(dt), walk);
    bst_vec3 out = bst_mat3_mul_vec(&gyro->response, turn_rad);
    out = bst_vec3_axpy(out, 0.5 * dt, bst_vec3_add(gyro->bias_radps, next));
    gyro->bias_radps = next;
    return bst_vec3_axpy(out, sqrt(v * v * dt + u * u * dt * dt * dt / 12.0), noise);
}

void bst_spacecraft_gyro_archive(bst_spacecraft_gyro *gyro, bst_archive *archive) {
    BST_ARCHIVE(archive, gyro->bias_radps);
    gyro->samples = bst_archive_integer(archive, gyro->samples, 0, INT64_MAX / 2);
}
