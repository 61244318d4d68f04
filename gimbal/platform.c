#include "gimbal/platform.h"

#include <assert.h>

#include "sim/core/invariant.h"

#define P bst_platform_config
const bst_config_desc bst_platform_config_table[] = {
    BST_REALS(P, drift_arcsec_per_s, "arcsec/s", -3600, 3600, "[0, 0, 0]",
              "Constant rotation rate of the true body about its own axes, unknown onboard."),
    BST_REAL(P, jitter_low_px_rms, "px", 0, 100, "0",
             "RMS (radial) of the slow jitter of the line of sight."),
    BST_REAL(P, jitter_low_cutoff_hz, "Hz", 1e-6, 1000, "0.05",
             "Highest frequency of the slow jitter; its spectrum is flat from zero."),
    BST_REAL(P, jitter_high_px_rms, "px", 0, 100, "0",
             "RMS (radial) of the fast jitter of the line of sight."),
    BST_REALS(
        P, jitter_high_band_hz, "Hz", 0, 10000, "[5, 200]",
        "Lowest and highest frequency of the fast jitter; its spectrum is flat between. What is "
        "above 0.4 rate_hz widens the PSF."),
    BST_OBJECT(P, jitter_psd, bst_jitter_psd_config_table, "{}",
               "Jitter by tables of its density and by harmonic lines, besides the flat bands."),
    BST_REALS(P, attitude_bias_arcsec, "arcsec", -648000, 648000, "[0, 0, 0]",
              "Constant error of the believed body attitude, as a rotation about body axes."),
    BST_REAL(
        P, attitude_noise_arcsec, "arcsec", 0, 3600, "0",
        "White noise of the reported body attitude about each axis, one draw a sample; it does "
        "not move the gimbal."),
    BST_REAL(P, history_s, "s", 0.01, 3600, "4",
             "Time that the ring of true line-of-sight samples covers."),
    BST_REAL(P, telemetry_rate_hz, "Hz", 0.01, 10000, "100",
             "Rate of pointing telemetry; divides the plant's rate."),
    BST_REAL(P, telemetry_history_s, "s", 0.01, 3600, "8",
             "Time that the ring of pointing telemetry covers at least; where frames come later "
             "than this, it covers their latency."),
    BST_REAL(P, nav_rate_hz, "Hz", 0.001, 10000, "10",
             "Rate of navigation telemetry; divides the plant's rate."),
    BST_OBJECT(P, spacecraft, bst_spacecraft_config_table, "{}",
               "The body: held, or with dynamics, wheels, sensors and a pointing law."),
    BST_CONFIG_END};
#undef P

static bst_vec3 arcsec_vector(const double v[3]) {
    return bst_vec3_scale((bst_vec3){v[0], v[1], v[2]}, BST_ARCSEC_RAD);
}

/* Camera attitude rotated by small angles about its own x and y axes, renormalised. */
static bst_quat with_jitter(bst_quat q, const double shake_rad[2]) {
    double x = shake_rad[0], y = shake_rad[1], half2 = 0.25 * (x * x + y * y);
    if (half2 < 1e-6) {
        /* series exact to rounding: the quaternion {-s x, -s y, 0, c} times q */
        double s = 0.5 - half2 * (1.0 / 12.0), c = 1.0 - half2 * (0.5 - half2 * (1.0 / 24.0));
        x *= -s;
        y *= -s;
        q = (bst_quat){c * q.x + x * q.w + y * q.z, c * q.y + y * q.w - x * q.z,
                       c * q.z + x * q.y - y * q.x, c * q.w - x * q.x - y * q.y};
    } else {
        q = bst_quat_turn_frame(q, (bst_vec3){x, y, 0.0});
    }
    double n2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
    double scale = fabs(n2 - 1.0) < 1e-8 ? 1.5 - 0.5 * n2 : 1.0 / sqrt(n2);
    return (bst_quat){scale * q.x, scale * q.y, scale * q.z, scale * q.w};
}

bst_status bst_platform_jitter_spectrum(bst_ctx *ctx, const bst_platform_config *config,
                                        double pixel_rad, bst_jitter_spectrum *out) {
    const double *band = config->jitter_high_band_hz;
    if (config->jitter_high_px_rms > 0.0 && !(band[1] > band[0])) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "platform/jitter_high_band_hz: [%g, %g] is empty; give the lower "
                        "frequency first",
                        band[0], band[1]);
    }
    bst_jitter_spec flat = {.low_rms_rad = config->jitter_low_px_rms * pixel_rad,
                            .low_cutoff_hz = config->jitter_low_cutoff_hz,
                            .high_rms_rad = config->jitter_high_px_rms * pixel_rad,
                            .high_min_hz = band[0],
                            .high_max_hz = band[1]};
    return bst_jitter_spectrum_create(ctx, &flat, &config->jitter_psd, pixel_rad, out);
}

bst_status bst_platform_init(bst_ctx *ctx, bst_platform *platform,
                             const bst_platform_config *config, const bst_platform_setup *setup) {
    assert(platform && config && setup);
    bst_jitter_spectrum spectrum;
    const bst_quat q_nominal_from_gcrf = setup->q_nominal_from_gcrf;
    const double dt_s = setup->dt_s;
    platform->spacecraft = NULL;
    platform->sky = NULL;
    platform->jitter.more = NULL;
    BST_TRY(bst_platform_jitter_spectrum(ctx, config, setup->pixel_rad, &spectrum));
    platform->q_nominal_from_gcrf = q_nominal_from_gcrf;
    platform->q_believed_from_gcrf =
        bst_quat_turn_frame(q_nominal_from_gcrf, arcsec_vector(config->attitude_bias_arcsec));
    platform->drift_radps = arcsec_vector(config->drift_arcsec_per_s);
    platform->attitude_noise_rad = config->attitude_noise_arcsec * BST_ARCSEC_RAD;
    platform->attitude_key = setup->attitude_key;
    platform->jitter_unresolved_rad2 = bst_jitter_unresolved_rad2(&spectrum.flat, dt_s) +
                                       bst_jitter_spectrum_unresolved_rad2(&spectrum, dt_s);
    platform->unresolved_rad2 = platform->jitter_unresolved_rad2;
    platform->rate_believed_radps = (bst_vec3){0, 0, 0};
    platform->body = (bst_body_state){q_nominal_from_gcrf, platform->drift_radps, {0, 0, 0}};
    platform->wheels_saturated = platform->trackers_blind = false;
    bst_jitter_spec followed = bst_jitter_resolved(&spectrum.flat, dt_s);
    bst_jitter_init(&platform->jitter, &followed, dt_s, setup->jitter_key);
    bst_rng_key more_key = setup->jitter_key; /* independent random stream */
    more_key.k[0] ^= 0x7F4A7C15u;
    bst_status status = bst_jitter_add(ctx, &platform->jitter, &spectrum, more_key);
    bst_jitter_spectrum_free(&spectrum);
    return status;
}

/* Attitude of an inertial body after its drift. */
static bst_quat drifted(const bst_platform *platform, double seconds) {
    bst_vec3 drift = platform->drift_radps;
    bst_quat body = platform->q_nominal_from_gcrf;
    if (drift.x != 0.0 || drift.y != 0.0 || drift.z != 0.0) {
        body = bst_quat_turn_frame(body, bst_vec3_scale(drift, seconds));
    }
    return body;
}

bst_status bst_platform_advance(bst_ctx *ctx, bst_platform *platform, int64_t n, double seconds,
                                bst_vec3 reaction_nm) {
    assert(platform && n >= 0 && isfinite(seconds) && bst_is_finite_vec3(reaction_nm));
    if (!platform->spacecraft) {
        platform->body.q_body_from_gcrf = drifted(platform, seconds);
        return BST_OK;
    }
    BST_TRY(bst_spacecraft_step(ctx, platform->spacecraft, n, seconds, reaction_nm));
    const bst_spacecraft_now *now = bst_spacecraft_at(platform->spacecraft);
    platform->body = now->body;
    platform->q_believed_from_gcrf = now->q_believed_from_gcrf;
    platform->rate_believed_radps = now->rate_believed_radps;
    platform->unresolved_rad2 = platform->jitter_unresolved_rad2 + now->unresolved_rad2;
    platform->wheels_saturated = now->wheel_flags != 0u;
    platform->trackers_blind = !now->tracked;
    return BST_OK;
}

bst_quat bst_platform_true_camera(bst_platform *platform, int64_t n, double seconds,
                                  bst_quat q_cam_from_body) {
    double shake[2];
    bst_jitter_at(&platform->jitter, n, shake);
    bst_quat body =
        platform->spacecraft ? platform->body.q_body_from_gcrf : drifted(platform, seconds);
    return with_jitter(bst_quat_mul(q_cam_from_body, body), shake);
}

bst_quat bst_platform_true_camera_between(bst_platform *platform, int64_t n, double fraction,
                                          double seconds, bst_quat q_cam_from_body) {
    assert(platform && n >= 0 && bst_is_share(fraction));
    assert(bst_is_unit_quat(q_cam_from_body, BST_LINK_UNIT_TOLERANCE));
    double shake[2], next[2];
    bst_jitter_at(&platform->jitter, n, shake);
    if (fraction > 0.0) {
        bst_jitter_at(&platform->jitter, n + 1, next);
        shake[0] += fraction * (next[0] - shake[0]);
        shake[1] += fraction * (next[1] - shake[1]);
    }
    bst_quat body =
        platform->spacecraft ? platform->body.q_body_from_gcrf : drifted(platform, seconds);
    return with_jitter(bst_quat_mul(q_cam_from_body, body), shake);
}

bst_quat bst_platform_measured_body(const bst_platform *platform, int64_t n) {
    if (platform->attitude_noise_rad == 0.0 || platform->spacecraft) {
        return platform->q_believed_from_gcrf;
    }
    double a[2], b[2];
    bst_rng_normal2(platform->attitude_key, (uint64_t)n, 0, a);
    bst_rng_normal2(platform->attitude_key, (uint64_t)n, 1, b);
    return bst_quat_turn_frame(
        platform->q_believed_from_gcrf,
        bst_vec3_scale((bst_vec3){a[0], a[1], b[0]}, platform->attitude_noise_rad));
}

bst_status bst_platform_check_history(bst_ctx *ctx, const bst_platform_config *config,
                                      double exposure_s) {
    if (config->history_s < exposure_s) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "platform/history_s: %g s do not cover the longest exposure_s of this "
                        "sensor, %g s (its exposure's, or what control commands; with row_time_s "
                        "from the first row's start to the last row's end); make history_s at "
                        "least as long",
                        config->history_s, exposure_s);
    }
    return BST_OK;
}

bst_status bst_platform_divider(bst_ctx *ctx, const char *key, double plant_rate_hz,
                                double wanted_hz, int64_t *out) {
    double ratio = plant_rate_hz / wanted_hz;
    double steps = round(ratio);
    if (steps < 1.0 || fabs(ratio - steps) > 1e-9 * ratio) {
        double fewer = floor(ratio) < 1.0 ? 1.0 : floor(ratio);
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "platform/%s: %g Hz does not divide the plant's rate of %g Hz; the nearest "
                        "rates that do are %g and %g Hz",
                        key, wanted_hz, plant_rate_hz, plant_rate_hz / fewer,
                        plant_rate_hz / (fewer + 1.0));
    }
    *out = (int64_t)steps;
    return BST_OK;
}

void bst_platform_append_los(bst_los_history *history, int capacity, int64_t tick,
                             bst_quat q_cam_from_gcrf) {
    assert(history && capacity > 0 && bst_is_unit_quat(q_cam_from_gcrf, BST_LINK_UNIT_TOLERANCE));
    history->capacity = capacity;
    bst_los_sample *sample = &history->items[history->written % capacity];
    sample->tick = tick;
    sample->q_cam_from_gcrf = q_cam_from_gcrf;
    history->written++;
}

void bst_platform_add_status(const bst_platform *platform, bst_quat q_body_seen_from_gcrf,
                             bst_mount_status *out) {
    out->wheels_saturated = platform->wheels_saturated;
    out->rate_body_radps = platform->rate_believed_radps;
    out->q_body_from_gcrf = q_body_seen_from_gcrf;
    if (platform->spacecraft) {
        out->roll = bst_spacecraft_at(platform->spacecraft)->roll;
    }
}
