#include "gimbal/mount/second_order.h"

#include <assert.h>

#include "sim/core/invariant.h"

static const double two_pi = 2.0 * BST_PI;

/* Angle from the cached values after which sines and cosines are recomputed. Targets near the axis
 * stay within the range of the arctangent series. */
#define NEAR_RAD 0.005

/* Distance from the pole, rad, below which the outer angle is too ill-defined to follow. */
#define POLE_RAD 1e-9

#define C bst_mount_two_axis_config
const bst_config_desc bst_two_axis_config_table[] = {
    BST_REAL(C, rate_limit_degps, "deg/s", 1e-6, 1000, "2", "Greatest rate of either axis."),
    BST_REAL(C, accel_limit_degps2, "deg/s^2", 1e-6, 10000, "4",
             "Greatest acceleration of either axis."),
    BST_REAL(C, natural_frequency_hz, "Hz", 0.01, 1000, "8", "Natural frequency of the servo."),
    BST_REAL(C, damping, "", 0.05, 10, "0.7", "Damping ratio of the servo."),
    BST_REAL(C, encoder_noise_arcsec, "arcsec", 0, 3600, "0.1",
             "White noise of an encoder reading, one draw a plant step; the servo follows it."),
    BST_REAL(C, inner_travel_deg, "deg", 0.1, 90, "90", "Stops of the inner axis, both ways."),
    BST_REAL(C, settle_tolerance_arcsec, "arcsec", 1e-6, 36000, "3",
             "The servo reports `settled` within this angle of its command."),
    BST_OBJECT(C, platform, bst_platform_config_table, "{}",
               "The spacecraft: drift, jitter, attitude knowledge, telemetry."),
    BST_CONFIG_END};
#undef C

bst_status bst_mount_two_axis_init(bst_ctx *ctx, bst_mount_two_axis *plant,
                                   const bst_mount_two_axis_config *config,
                                   bst_quat q_nominal_from_gcrf, double pixel_rad, double dt_s,
                                   const bst_mount_two_axis_keys *keys) {
    assert(plant && config && keys && bst_is_positive(pixel_rad) && bst_is_positive(dt_s));
    assert(bst_is_unit_quat(q_nominal_from_gcrf, BST_UNIT_TOLERANCE));
    *plant = (bst_mount_two_axis){
        .encoder_noise_rad = config->encoder_noise_arcsec * BST_ARCSEC_RAD,
        .inner_travel_rad = config->inner_travel_deg * BST_DEG_RAD,
        .settle_tolerance_rad = config->settle_tolerance_arcsec * BST_ARCSEC_RAD,
        .encoder_key = keys->encoder,
        .dt_s = dt_s,
        .near = {{0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}}};
    bst_axis_spec spec = {.rate_limit_radps = config->rate_limit_degps * BST_DEG_RAD,
                          .accel_limit_radps2 = config->accel_limit_degps2 * BST_DEG_RAD,
                          .natural_frequency_radps = two_pi * config->natural_frequency_hz,
                          .damping = config->damping,
                          .dt_s = dt_s};
    bst_axis_init(&plant->axis[0], &spec);
    bst_axis_init(&plant->axis[1], &spec);
    const bst_platform_setup setup = {.q_nominal_from_gcrf = q_nominal_from_gcrf,
                                      .pixel_rad = pixel_rad,
                                      .dt_s = dt_s,
                                      .jitter_key = keys->jitter,
                                      .attitude_key = keys->attitude};
    return bst_platform_init(ctx, &plant->platform, &config->platform, &setup);
}

void bst_mount_two_axis_archive(bst_mount_two_axis *plant, bst_archive *archive) {
    bst_platform_archive(&plant->platform, archive);
    bst_axis_archive(&plant->axis[0], archive);
    bst_axis_archive(&plant->axis[1], archive);
    plant->steps = bst_archive_integer(archive, plant->steps, 0, BST_PLANT_STEPS_MOST);
    BST_ARCHIVE(archive, plant->encoder_noise);
    BST_ARCHIVE(archive, plant->near);
    BST_ARCHIVE(archive, plant->q_cam_from_gcrf);
    BST_ARCHIVE(archive, plant->q_measured_from_gcrf);
    BST_ARCHIVE(archive, plant->q_measured_body_from_gcrf);
    BST_ARCHIVE(archive, plant->encoder_rad);
    bst_archive_bool(archive, &plant->settled);
    bst_archive_bool(archive, &plant->limited);
    bst_archive_bool(archive, &plant->at_stop);
}

void bst_mount_two_axis_solve(bst_vec3 b, bst_vec3 rate, double outer_at_pole_rad,
                              double angle_rad[2], double rate_radps[2]) {
    double h2 = b.x * b.x + b.z * b.z;
    double h = sqrt(h2);
    angle_rad[1] = atan2(-b.y, h);
    if (h < POLE_RAD) {
        angle_rad[0] = outer_at_pole_rad;
        rate_radps[0] = rate_radps[1] = 0.0;
        return;
    }
    angle_rad[0] = atan2(b.x, b.z);
    rate_radps[0] = (b.z * rate.x - b.x * rate.z) / h2;
    rate_radps[1] = -rate.y / h;
}

/* Sines and cosines of half the axis angles. */
typedef struct halves {
    double sin[2], cos[2];
} halves;

static halves halves_of(const double angle_rad[2]) {
    return (halves){{sin(0.5 * angle_rad[0]), sin(0.5 * angle_rad[1])},
                    {cos(0.5 * angle_rad[0]), cos(0.5 * angle_rad[1])}};
}

/* Sine and cosine of half an angle more_rad further, up to 0.02 rad by series exact to rounding. */
static void beside(double sin_half, double cos_half, double more_rad, double *sin_out,
                   double *cos_out) {
    double d = 0.5 * more_rad, s, c;
    if (fabs(d) < 0.01) {
        double q = d * d;
        s = d * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0))));
        c = 1.0 - q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40320.0))));
    } else {
        s = sin(d);
        c = cos(d);
    }
    *sin_out = sin_half * c + cos_half * s;
    *cos_out = cos_half * c - sin_half * s;
}

/* Half-angle sines and cosines slightly further. */
static halves halves_beside(const halves *h, const double more_rad[2]) {
    halves out;
    for (int a = 0; a < 2; a++) {
        beside(h->sin[a], h->cos[a], more_rad[a], &out.sin[a], &out.cos[a]);
    }
    return out;
}

/* Half-angle sines and cosines of the current axis angles. */
static halves halves_now(bst_mount_two_axis *plant) {
    halves out;
    for (int a = 0; a < 2; a++) {
        bst_mount_two_axis_half *near = &plant->near[a];
        double angle = plant->axis[a].angle_rad;
        if (!(fabs(angle - near->angle_rad) < NEAR_RAD)) {
            *near = (bst_mount_two_axis_half){angle, sin(0.5 * angle), cos(0.5 * angle)};
        }
        beside(near->sin, near->cos, angle - near->angle_rad, &out.sin[a], &out.cos[a]);
    }
    return out;
}

/* Half-angle values after a whole turn of the outer axis. */
static void turn_half(halves *h) {
    h->sin[0] = -h->sin[0];
    h->cos[0] = -h->cos[0];
}

static bst_quat attitude_of(const halves *h) {
    /* from_rotvec(-inner x) * from_rotvec(-outer y), multiplied out */
    return (bst_quat){-h->sin[1] * h->cos[0], -h->cos[1] * h->sin[0], h->sin[1] * h->sin[0],
                      h->cos[1] * h->cos[0]};
}

bst_quat bst_mount_two_axis_attitude(const double angle_rad[2]) {
    halves h = halves_of(angle_rad);
    return attitude_of(&h);
}

static double wrap(double angle) {
    return fabs(angle) < BST_PI ? angle : bst_wrap_angle(angle);
}

/* Angle of (x, y) if it is within the arctangent series' range of a known angle; otherwise false.
 */
static bool angle_near(const bst_mount_two_axis_half *near, double x, double y, double *angle_rad) {
    double c = near->cos * near->cos - near->sin * near->sin, s = 2.0 * near->sin * near->cos;
    double along = x * c + y * s, across = y * c - x * s;
    if (!(fabs(across) < 0.01 * along)) {
        return false;
    }
    *angle_rad = near->angle_rad + bst_atan2(across, along);
    return true;
}

/* bst_mount_two_axis_solve, in the turn nearest to the current angle. */
static void solve(const bst_mount_two_axis *plant, bst_vec3 b, bst_vec3 rate, double angle_rad[2],
                  double rate_radps[2]) {
    double h2 = b.x * b.x + b.z * b.z, h = sqrt(h2), now = plant->axis[0].reference_rad;
    if (h > POLE_RAD && angle_near(&plant->near[0], b.z, b.x, &angle_rad[0]) &&
        angle_near(&plant->near[1], h, -b.y, &angle_rad[1])) {
        rate_radps[0] = (b.z * rate.x - b.x * rate.z) / h2;
        rate_radps[1] = -rate.y / h;
        return;
    }
    bst_mount_two_axis_solve(b, rate, now, angle_rad, rate_radps);
    angle_rad[0] = now + wrap(angle_rad[0] - now);
}

/* Commanded angles and rates of the axes at this step. */
static void command_angles(const bst_mount_two_axis *plant, const bst_los_command *command,
                           double age_s, double angle_rad[2], double rate_radps[2], bool *at_stop) {
    bst_vec3 rate = bst_vec3_axpy(command->rate_gcrf_radps, age_s, command->accel_gcrf_radps2);
    bst_vec3 v = bst_vec3_axpy(command->direction_gcrf, age_s, command->rate_gcrf_radps);
    v = bst_vec3_axpy(v, 0.5 * age_s * age_s, command->accel_gcrf_radps2);
    double scale = 1.0 / bst_vec3_norm(v);
    bst_vec3 d = bst_vec3_scale(v, scale);
    bst_vec3 r = bst_vec3_scale(rate, scale);
    r = bst_vec3_axpy(r, -bst_vec3_dot(r, d), d);
    bst_quat body = plant->platform.q_believed_from_gcrf;
    bst_vec3 d_body = bst_quat_rotate(body, d), r_body = bst_quat_rotate(body, r);
    if (plant->platform.spacecraft) {
        /* the body rotates under the mount */
        r_body = bst_vec3_sub(r_body, bst_vec3_cross(plant->platform.rate_believed_radps, d_body));
    }
    solve(plant, d_body, r_body, angle_rad, rate_radps);
    *at_stop = fabs(angle_rad[1]) > plant->inner_travel_rad;
    if (*at_stop) {
        angle_rad[1] = copysign(plant->inner_travel_rad, angle_rad[1]);
        rate_radps[1] = 0.0;
    }
}

void bst_mount_two_axis_status(const bst_mount_two_axis *plant, int64_t tick,
                               bst_mount_status *out) {
    if (out->axes == 0) {
        *out = (bst_mount_status){.axes = 2, .q_body_from_cam_at_zero = BST_QUAT_IDENTITY};
        for (int i = 0; i < 2; i++) {
            const bst_axis_spec *spec = &plant->axis[i].spec;
            out->axis[i] =
                (bst_mount_axis){.axis_body = i == 0 ? (bst_vec3){0, 1, 0} : (bst_vec3){1, 0, 0},
                                 .rate_limit_radps = spec->rate_limit_radps,
                                 .accel_limit_radps2 = spec->accel_limit_radps2};
        }
        out->axis[1].min_rad = -plant->inner_travel_rad;
        out->axis[1].max_rad = plant->inner_travel_rad;
    }
    out->tick = tick;
    bst_platform_add_status(&plant->platform, plant->q_measured_body_from_gcrf, out);
    for (int i = 0; i < 2; i++) {
        const bst_axis *axis = &plant->axis[i];
        out->axis[i].angle_rad = plant->encoder_rad[i];
        out->axis[i].rate_radps = axis->reference_radps;
        out->axis[i].flags = axis->limited ? BST_AXIS_SATURATED : 0u;
    }
    out->axis[1].flags |= plant->at_stop ? BST_AXIS_AT_STOP : 0u;
}

void bst_mount_two_axis_step(bst_mount_two_axis *plant, const bst_los_command *command,
                             double command_age_s, bool measure) {
    assert(plant &&
           (!command || bst_is_unit_vec3(command->direction_gcrf, BST_LINK_UNIT_TOLERANCE)));
    int64_t n = plant->steps++;
    double noise[2] = {0.0, 0.0};
    if (plant->encoder_noise_rad > 0.0) {
        int at = (int)(n % BST_RNG_BLOCK);
        if (at == 0) {
            bst_rng_normal_block(plant->encoder_key, (uint64_t)n, plant->encoder_noise);
        }
        noise[0] = plant->encoder_noise_rad * plant->encoder_noise[0][at];
        noise[1] = plant->encoder_noise_rad * plant->encoder_noise[1][at];
    }
    double angle[2], rate[2];
    bool at_stop = false;
    if (command) {
        command_angles(plant, command, command_age_s, angle, rate, &at_stop);
    } else {
        for (int a = 0; a < 2; a++) {
            angle[a] = plant->axis[a].reference_rad;
            rate[a] = 0.0;
        }
    }
    bst_axis *outer = &plant->axis[0], *inner = &plant->axis[1];
    if (n > 0) {
        bst_axis_step(outer, angle[0], rate[0], noise[0]);
        bst_axis_step(inner, angle[1], rate[1], noise[1]);
    }
    halves half = halves_now(plant);
    double cross = half.cos[1] * half.cos[1] - half.sin[1] * half.sin[1];
    double off_o = (outer->angle_rad - angle[0]) * cross, off_i = inner->angle_rad - angle[1];
    double rate_o = (outer->rate_radps - rate[0]) * cross, rate_i = inner->rate_radps - rate[1];
    double settle_rate = plant->settle_tolerance_rad * outer->spec.natural_frequency_radps;
    double tolerance = plant->settle_tolerance_rad;
    plant->settled = command && off_o * off_o + off_i * off_i <= tolerance * tolerance &&
                     rate_o * rate_o + rate_i * rate_i <= settle_rate * settle_rate;
    plant->at_stop = at_stop;
    plant->limited = at_stop || outer->limited || inner->limited;

    if (fabs(outer->reference_rad) > BST_PI) {
        double turns = outer->reference_rad > 0.0 ? -1.0 : 1.0;
        bst_axis_unwind(outer, turns);
        bst_mount_two_axis_half *near = &plant->near[0];
        *near = (bst_mount_two_axis_half){near->angle_rad + turns * two_pi, -near->sin, -near->cos};
        turn_half(&half);
    }
    plant->q_cam_from_gcrf =
        bst_platform_true_camera(&plant->platform, n, (double)n * plant->dt_s, attitude_of(&half));
    if (measure) {
        double wrapped = wrap(outer->angle_rad);
        if (wrapped != outer->angle_rad) {
            turn_half(&half);
        }
        halves seen = halves_beside(&half, noise);
        plant->encoder_rad[0] = wrapped + noise[0];
        plant->encoder_rad[1] = inner->angle_rad + noise[1];
        plant->q_measured_body_from_gcrf = bst_platform_measured_body(&plant->platform, n);
        plant->q_measured_from_gcrf =
            bst_quat_unit(bst_quat_mul(attitude_of(&seen), plant->q_measured_body_from_gcrf));
    }
}
