#include "gimbal/spacecraft/spacecraft.h"

#include <assert.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>

#include "gimbal/jitter/jitter.h"
#include "gimbal/mount/axis.h"
#include "gimbal/spacecraft/attitude_warm_up.h"
#include "sim/core/invariant.h"

/* A delayed star-tracker measurement. */
typedef struct pending {
    int64_t sampled, due; /* plant steps */
    int tracker;
    bst_quat measured, estimate; /* estimate: current estimate of the attitude at the measurement */
} pending;

struct bst_spacecraft {
    double dt_s;
    bst_spacecraft_body body;
    bst_wheels wheels;
    double wheel_phase_rad[BST_WHEELS_MOST], wheel_load_kgm2[BST_WHEELS_MOST];
    double motor_nm[BST_WHEELS_MOST];
    bst_disturbance_config disturbances;
    bst_surface_torque *surface; /* NULL: no shape */
    bst_vec3 disturbance_nm;     /* held */
    bst_spacecraft_gyro gyro;
    bst_quat q_at_gyro;          /* true, at the latest sample */
    bst_vec3 turn_since_control; /* sum of gyro samples since the last controller step */
    int samples_since_control;
    bst_vec3 rate_control_radps; /* their mean rate */
    int64_t gyro_steps, control_steps;
    int trackers;
    bst_spacecraft_star_tracker tracker[BST_TRACKERS_MOST];
    bst_mat3 tracker_noise[BST_TRACKERS_MOST];
    int64_t tracker_steps[BST_TRACKERS_MOST], tracker_latency[BST_TRACKERS_MOST];
    pending *pending;
    int pendings, pending_room;
    bst_attitude_filter filter;
    int64_t filter_step; /* plant step of the filter's estimate */
    bst_spacecraft_attitude_control control;
    bst_pointing_law law;
    bst_axis roll; /* command shaper of the roll */
    double roll_target_rad;
    bst_spacecraft_sky_grid grid;
    bst_spacecraft_sky sky;
    bst_spacecraft_now now;
};

const bst_spacecraft_now *bst_spacecraft_at(const bst_spacecraft *craft) {
    return &craft->now;
}

const bst_spacecraft_body *bst_spacecraft_dynamics(const bst_spacecraft *craft) {
    return &craft->body;
}

const bst_attitude_filter *bst_spacecraft_filter(const bst_spacecraft *craft) {
    return &craft->filter;
}

bst_vec3 bst_spacecraft_gyro_bias(const bst_spacecraft *craft) {
    return craft->gyro.bias_radps;
}

int bst_spacecraft_wheel_count(const bst_spacecraft *craft) {
    return craft->wheels.count;
}

bst_wheel_state bst_spacecraft_wheel_state(const bst_spacecraft *craft, int index) {
    assert(index >= 0 && index < craft->wheels.count);
    const bst_wheel *wheel = &craft->wheels.wheel[index];
    return (bst_wheel_state){.speed_radps = craft->now.wheel_radps[index],
                             .speed_limit_radps = wheel->speed_limit_radps,
                             .motor_nm = craft->motor_nm[index],
                             .motor_limit_nm = wheel->torque_limit_nm};
}

void bst_spacecraft_command_roll(bst_spacecraft *craft, double roll_rad) {
    craft->roll_target_rad = roll_rad;
}

void bst_spacecraft_free(bst_spacecraft *craft) {
    if (craft) {
        free(craft->pending);
        bst_surface_torque_free(craft->surface);
        free(craft);
    }
}

static bst_rng_key stream(const bst_spacecraft_setup *setup, const char *name) {
    return bst_rng_make_key(setup->seed, setup->run, setup->instance, name);
}

/* Plant steps per period of wanted_hz. */
static bst_status whole_steps(bst_ctx *ctx, const char *key, double plant_hz, double wanted_hz,
                              int64_t *out) {
    double ratio = plant_hz / wanted_hz, steps = round(ratio);
    if (steps < 1.0 || fabs(ratio - steps) > 1e-9 * ratio) {
        double fewer = fmax(1.0, floor(ratio));
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %g Hz does not divide the plant's rate of %g Hz; the nearest rates "
                        "that do are %g and %g Hz",
                        key, wanted_hz, plant_hz, plant_hz / fewer, plant_hz / (fewer + 1.0));
    }
    *out = (int64_t)steps;
    return BST_OK;
}

static bst_status set_law(bst_ctx *ctx, bst_spacecraft *craft,
                          const bst_spacecraft_attitude_config *config, bst_quat q_nominal) {
    bst_vec3 axis = bst_vec3_unit(bst_vec3_from_array(config->axis)),
             second = bst_vec3_unit(bst_vec3_from_array(config->second_axis));
    if (!(bst_vec3_norm(bst_vec3_cross(axis, second)) > 1e-3)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "attitude/second_axis: [%g, %g, %g] is parallel to axis [%g, %g, %g], or "
                        "one of them has no length; give two directions at an angle",
                        second.x, second.y, second.z, axis.x, axis.y, axis.z);
    }
    craft->law = (bst_pointing_law){.law = (bst_spacecraft_law)config->law,
                                    .q_nominal = q_nominal,
                                    .axis = axis,
                                    .second_axis = second,
                                    .roll_rad = config->roll_deg * BST_DEG_RAD};
    return BST_OK;
}

static bst_status set_body(bst_ctx *ctx, bst_spacecraft *craft, const bst_spacecraft_config *config,
                           bst_quat q, bst_vec3 rate) {
    bst_spacecraft_spec spec = {.wheels = craft->wheels.count,
                                .modes = config->modes.count,
                                .integrator = (bst_integrator)config->integrator,
                                .dt_s = craft->dt_s};
    for (int i = 0; i < 6; i++) {
        spec.inertia_kgm2[i] = config->inertia_kgm2[i];
    }
    double start[BST_WHEELS_MOST] = {0};
    for (int i = 0; i < spec.wheels; i++) {
        const bst_wheel *wheel = &craft->wheels.wheel[i];
        spec.wheel[i] = (bst_spacecraft_wheel){wheel->axis, wheel->inertia_kgm2};
        start[i] = wheel->start_radps;
        craft->wheel_phase_rad[i] = wheel->phase0_rad;
    }
    const bst_spacecraft_mode_config *modes = config->modes.items;
    for (int k = 0; k < spec.modes; k++) {
        spec.mode[k] = (bst_spacecraft_mode){2.0 * BST_PI * modes[k].frequency_hz, modes[k].damping,
                                             bst_vec3_from_array(modes[k].coupling)};
    }
    BST_TRY(bst_spacecraft_body_init(ctx, &craft->body, &spec, q, rate, start));
    for (int i = 0; i < spec.wheels; i++) {
        craft->wheel_load_kgm2[i] = bst_spacecraft_body_wheel_load_kgm2(&craft->body, i);
    }
    return BST_OK;
}

/* Checks that the working wheels span three axes, unless the attitude is uncontrolled. */
static bst_status check_wheels(bst_ctx *ctx, const bst_spacecraft *craft) {
    double speed[BST_WHEELS_MOST] = {0}, motor[BST_WHEELS_MOST];
    if (craft->law.law != BST_LAW_FREE &&
        (bst_wheels_share(&craft->wheels, speed, (bst_vec3){0, 0, 0}, motor) & BST_WHEELS_SHORT)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "wheels: those that work do not turn the body about all three axes, which "
                        "attitude/law \"%s\" needs; give three with axes that span space, or the "
                        "law \"free\"",
                        bst_law_names[craft->law.law]);
    }
    return BST_OK;
}

static bst_status set_trackers(bst_ctx *ctx, bst_spacecraft *craft,
                               const bst_spacecraft_config *config,
                               const bst_spacecraft_setup *setup) {
    const bst_spacecraft_star_tracker_config *all =
        bst_spacecraft_trackers(config, &craft->trackers);
    for (int i = 0; i < craft->trackers; i++) {
        char name[64];
        snprintf(name, sizeof name, "star_trackers/%d/rate_hz", i);
        if (!(bst_vec3_norm(bst_vec3_from_array(all[i].axis)) > 0.0)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "star_trackers/%d/axis: a direction of length zero (allowed: any "
                            "other)",
                            i);
        }
        BST_TRY(
            whole_steps(ctx, name, 1.0 / craft->dt_s, all[i].rate_hz, &craft->tracker_steps[i]));
        if (craft->tracker_steps[i] % craft->gyro_steps != 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "star_trackers/%d/rate_hz: %g Hz does not divide the gyro's rate_hz of "
                            "%g; it takes one of its %g-th parts",
                            i, all[i].rate_hz, config->gyro.rate_hz,
                            ceil(config->gyro.rate_hz / all[i].rate_hz));
        }
        craft->tracker_latency[i] =
            (int64_t)ceil(all[i].latency_s / craft->gyro.dt_s - 1e-9) * craft->gyro_steps;
        snprintf(name, sizeof name, "star_tracker_%d", i);
        bst_spacecraft_star_tracker_init(&craft->tracker[i], &all[i], stream(setup, name));
        craft->tracker_noise[i] = bst_spacecraft_star_tracker_covariance(&craft->tracker[i]);
        craft->pending_room += (int)(craft->tracker_latency[i] / craft->tracker_steps[i]) + 1;
    }
    craft->pending = calloc((size_t)craft->pending_room + 1, sizeof *craft->pending);
    return craft->pending ? BST_OK
                          : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for star trackers");
}

static bst_vec3 normal3(bst_rng_key key) {
    double a[2], b[2];
    bst_rng_normal2(key, 0, 0, a);
    bst_rng_normal2(key, 0, 1, b);
    return (bst_vec3){a[0], a[1], b[0]};
}

/* Sets the attitude filter's state at the epoch. */
static void set_filter(bst_spacecraft *craft, const bst_spacecraft_config *config,
                       const bst_spacecraft_setup *setup, bst_quat q, bst_vec3 rate) {
    double sigma = config->initial_knowledge_arcsec * BST_ARCSEC_RAD;
    bst_vec3 error = bst_vec3_scale(normal3(stream(setup, "knowledge")), sigma);
    bst_attitude_filter_init(&craft->filter, bst_quat_unit(bst_quat_turn_frame(q, error)), sigma,
                             config->gyro.bias_sigma_degph * BST_DEG_RAD / 3600.0,
                             craft->gyro.angle_walk, craft->gyro.rate_walk);
    if (config->filter_warm_up_s <= 0.0) {
        return;
    }
    bst_attitude_past past = {.seconds = config->filter_warm_up_s,
                              .q_body_from_gcrf = q,
                              .rate_radps = rate,
                              .gyro = &craft->gyro,
                              .key = stream(setup, "past")};
    for (int all = 0; all < 2 && past.trackers == 0; all++) {
        for (int i = 0; i < craft->trackers; i++) {
            const bst_spacecraft_star_tracker *tracker = &craft->tracker[i];
            if (all || bst_spacecraft_star_tracker_sees(tracker, 0.0, q, rate,
                                                        craft->sky.position_m, craft->sky.sun_m)) {
                past.rate_hz[past.trackers] = 1.0 / ((double)craft->tracker_steps[i] * craft->dt_s);
                assert(past.trackers < BST_TRACKERS_MOST);
                past.tracker[past.trackers++] = tracker;
            }
        }
    }
    bst_attitude_warm_up(&past, &craft->filter);
}

static bst_status prepare(bst_ctx *ctx, bst_spacecraft *craft, const bst_spacecraft_config *config,
                          const bst_spacecraft_setup *setup) {
    double plant_hz = 1.0 / setup->dt_s;
    craft->dt_s = setup->dt_s;
    craft->disturbances = config->disturbances;
    BST_TRY(bst_disturbance_surface_create(ctx, &config->disturbances, &craft->surface));
    BST_TRY(set_law(ctx, craft, &config->attitude, setup->q_nominal));
    int wheels;
    const bst_wheel_config *wheel = bst_spacecraft_wheels(config, &wheels);
    BST_TRY(bst_wheels_init(ctx, &craft->wheels, wheel, wheels, stream(setup, "wheels")));
    BST_TRY(check_wheels(ctx, craft));
    BST_TRY(whole_steps(ctx, "gyro/rate_hz", plant_hz, config->gyro.rate_hz, &craft->gyro_steps));
    BST_TRY(whole_steps(ctx, "attitude/rate_hz", plant_hz, config->attitude.rate_hz,
                        &craft->control_steps));
    bst_spacecraft_gyro_init(&craft->gyro, &config->gyro, (double)craft->gyro_steps * setup->dt_s,
                             stream(setup, "gyro"));
    BST_TRY(set_trackers(ctx, craft, config, setup));

    craft->grid =
        (bst_spacecraft_sky_grid){.sky_at = setup->sky_at, .user = setup->user, .law = &craft->law};
    BST_TRY(bst_spacecraft_sky_grid_at(&craft->grid, ctx, 0.0, &craft->sky, &craft->now.reference));
    bst_vec3 turn =
        bst_vec3_scale(bst_vec3_from_array(config->initial_attitude_error_deg), BST_DEG_RAD);
    bst_quat q = bst_quat_unit(bst_quat_turn_frame(craft->now.reference.q_body_from_gcrf, turn));
    bst_vec3 rate = bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(turn, -1.0)),
                                    craft->now.reference.rate_radps);
    rate = bst_vec3_axpy(rate, BST_DEG_RAD, bst_vec3_from_array(config->initial_rate_degps));
    BST_TRY(set_body(ctx, craft, config, q, rate));
    set_filter(craft, config, setup, q, rate);
    bst_spacecraft_attitude_control_spec spec = bst_spacecraft_attitude_control_of(config);
    bst_spacecraft_attitude_control_init(&craft->control, &spec);
    if (craft->law.law != BST_LAW_FREE) {
        const bst_axis_spec limits = {.rate_limit_radps = spec.rate_limit_radps,
                                      .accel_limit_radps2 = spec.accel_limit_radps2,
                                      .natural_frequency_radps = spec.natural_radps,
                                      .damping = spec.damping,
                                      .dt_s = spec.dt_s};
        bst_axis_init(&craft->roll, &limits);
        craft->now.roll = (bst_body_roll){.axis_body = craft->law.axis,
                                          .rate_limit_radps = spec.rate_limit_radps,
                                          .accel_limit_radps2 = spec.accel_limit_radps2};
    }
    return BST_OK;
}

bst_status bst_spacecraft_create(bst_ctx *ctx, const bst_spacecraft_config *config,
                                 const bst_spacecraft_setup *setup, bst_spacecraft **out) {
    assert(config && setup && out);
    bst_spacecraft *craft = calloc(1, sizeof *craft);
    if (!craft) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a spacecraft");
    }
    bst_status status = prepare(ctx, craft, config, setup);
    if (status != BST_OK) {
        bst_spacecraft_free(craft);
        return bst_fail_prefix(ctx, status, "platform/spacecraft");
    }
    *out = craft;
    return BST_OK;
}

/* Archives the measurements that are under way. */
static void archive_pending(bst_spacecraft *craft, bst_archive *archive) {
    craft->pendings = bst_archive_count(archive, craft->pendings, craft->pending_room);
    for (int k = 0; k < craft->pendings; k++) {
        pending *p = &craft->pending[k];
        p->tracker = (int)bst_archive_integer(archive, p->tracker, 0, craft->trackers - 1);
        p->sampled = bst_archive_integer(archive, p->sampled, 0, INT64_MAX / 4);
        p->due = bst_archive_integer(archive, p->due, 0, INT64_MAX / 4);
        BST_ARCHIVE(archive, p->measured);
        BST_ARCHIVE(archive, p->estimate);
    }
}

/* Archives bst_spacecraft_now. */
static void archive_now(bst_spacecraft_now *now, bst_archive *archive) {
    BST_ARCHIVE(archive, now->body);
    BST_ARCHIVE(archive, now->q_believed_from_gcrf);
    BST_ARCHIVE(archive, now->rate_believed_radps);
    BST_ARCHIVE(archive, now->reference);
    BST_ARCHIVE(archive, now->wheel_radps);
    BST_ARCHIVE(archive, now->wheel_flags);
    bst_archive_bool(archive, &now->tracked);
    BST_ARCHIVE(archive, now->roll);
    BST_ARCHIVE(archive, now->unresolved_rad2);
}

void bst_spacecraft_archive(bst_spacecraft *craft, bst_archive *archive) {
    bst_spacecraft_body_archive(&craft->body, archive);
    BST_ARCHIVE(archive, craft->wheel_phase_rad);
    BST_ARCHIVE(archive, craft->motor_nm);
    BST_ARCHIVE(archive, craft->disturbance_nm);
    bst_spacecraft_gyro_archive(&craft->gyro, archive);
    BST_ARCHIVE(archive, craft->q_at_gyro);
    BST_ARCHIVE(archive, craft->turn_since_control);
    craft->samples_since_control =
        (int)bst_archive_integer(archive, craft->samples_since_control, 0, INT_MAX / 2);
    BST_ARCHIVE(archive, craft->rate_control_radps);
    archive_pending(craft, archive);
    bst_attitude_filter_archive(&craft->filter, archive);
    craft->filter_step = bst_archive_integer(archive, craft->filter_step, 0, INT64_MAX / 4);
    bst_spacecraft_attitude_control_archive(&craft->control, archive);
    bst_axis_archive(&craft->roll, archive);
    BST_ARCHIVE(archive, craft->roll_target_rad);
    bst_spacecraft_sky_grid_archive(&craft->grid, archive);
    BST_ARCHIVE(archive, craft->sky);
    archive_now(&craft->now, archive);
}

/* Highest resolved wheel imbalance frequency, rad/s. */
static double followed_radps(const bst_spacecraft *craft) {
    return 2.0 * BST_PI * BST_JITTER_RESOLVED / craft->dt_s;
}

static void move(bst_spacecraft *craft, bst_vec3 reaction_nm) {
    int wheels = craft->wheels.count;
    double dt = craft->dt_s, top = followed_radps(craft);
    double torque[BST_WHEELS_MOST];
    bst_vec3 outer = bst_vec3_add(craft->disturbance_nm, reaction_nm);
    for (int i = 0; i < wheels; i++) {
        const bst_wheel *wheel = &craft->wheels.wheel[i];
        double speed = craft->now.wheel_radps[i];
        torque[i] =
            bst_wheel_torque(wheel, speed, craft->motor_nm[i], craft->wheel_load_kgm2[i], dt);
        double next = craft->wheel_phase_rad[i] + speed * dt;
        if ((wheel->static_kgm > 0.0 || wheel->dynamic_kgm2 > 0.0) && fabs(speed) <= top) {
            bst_wheel_imbalance(wheel, 0.5 * (craft->wheel_phase_rad[i] + next), speed, &outer);
        }
        craft->wheel_phase_rad[i] =
            fabs(next) > 2.0 * BST_PI ? next - copysign(2.0 * BST_PI, next) : next;
    }
    bst_spacecraft_body_step(&craft->body, outer, torque);
}

static void observe_motion(bst_spacecraft *craft, bool moved) {
    bst_body_state *body = &craft->now.body;
    bst_vec3 before = body->rate_radps;
    body->q_body_from_gcrf = bst_spacecraft_body_attitude(&craft->body);
    body->rate_radps = bst_spacecraft_body_rate(&craft->body);
    body->accel_radps2 =
        moved ? bst_vec3_scale(bst_vec3_sub(body->rate_radps, before), 1.0 / craft->dt_s)
              : (bst_vec3){0, 0, 0};
    for (int i = 0; i < craft->wheels.count; i++) {
        craft->now.wheel_radps[i] = bst_spacecraft_body_wheel_radps(&craft->body, i);
    }
}

static void read_gyro(bst_spacecraft *craft, int64_t n) {
    double dt = craft->gyro.dt_s;
    bst_quat q = craft->now.body.q_body_from_gcrf;
    bst_vec3 turn = n == 0 ? bst_vec3_scale(craft->now.body.rate_radps, dt)
                           : bst_attitude_filter_error(q, craft->q_at_gyro);
    bst_vec3 sample = bst_spacecraft_gyro_measure(&craft->gyro, turn);
    if (n > 0) {
        bst_attitude_filter_propagate(&craft->filter, sample, dt);
    }
    craft->now.rate_believed_radps =
        bst_vec3_axpy(bst_vec3_scale(sample, 1.0 / dt), -1.0, craft->filter.bias_radps);
    craft->q_at_gyro = q;
    craft->filter_step = n;
    craft->turn_since_control = bst_vec3_add(craft->turn_since_control, sample);
    craft->samples_since_control++;
}

static void read_trackers(bst_spacecraft *craft, int64_t n, double seconds) {
    bool asked = false, seen = false;
    for (int i = 0; i < craft->trackers; i++) {
        if (n % craft->tracker_steps[i] != 0) {
            continue;
        }
        const bst_body_state *body = &craft->now.body;
        asked = true;
        if (!bst_spacecraft_star_tracker_sees(&craft->tracker[i], seconds, body->q_body_from_gcrf,
                                              body->rate_radps, craft->sky.position_m,
                                              craft->sky.sun_m)) {
            continue;
        }
        seen = true;
        if (craft->pendings == craft->pending_room) {
            continue; /* only after a restore of damaged data: there is room for all until due */
        }
        craft->pending[craft->pendings++] =
            (pending){.sampled = n,
                      .due = n + craft->tracker_latency[i],
                      .tracker = i,
                      .measured = bst_spacecraft_star_tracker_measure(
                          &craft->tracker[i], n / craft->tracker_steps[i], body->q_body_from_gcrf),
                      .estimate = craft->filter.q_body_from_gcrf};
    }
    craft->now.tracked = asked ? seen : craft->now.tracked;
}

/* Applies a current correction to the estimate of an earlier time: e then = e now + age b, in the
 * axes of then. */
static void correct_past(bst_quat *estimate, bst_quat q_now, double age_s,
                         const bst_vec3 correction[2]) {
    bst_quat q_then_from_now = bst_quat_mul(*estimate, bst_quat_conj(q_now));
    bst_vec3 e = bst_vec3_axpy(correction[0], age_s, correction[1]);
    *estimate = bst_quat_unit(bst_quat_turn_frame(*estimate, bst_quat_rotate(q_then_from_now, e)));
}

/* Updates the filter with the star-tracker measurements that have arrived. */
static void process_measurements(bst_spacecraft *craft, int64_t n) {
    int kept = 0;
    for (int k = 0; k < craft->pendings; k++) {
        pending p = craft->pending[k];
        if (p.due > n) {
            craft->pending[kept++] = p;
            continue;
        }
        bst_quat q_now = craft->filter.q_body_from_gcrf;
        bst_vec3 correction[2] = {{0, 0, 0}, {0, 0, 0}};
        bst_attitude_filter_update(
            &craft->filter, bst_attitude_filter_error(p.measured, p.estimate),
            (double)(n - p.sampled) * craft->dt_s, bst_quat_mul(q_now, bst_quat_conj(p.estimate)),
            &craft->tracker_noise[p.tracker], correction);
        craft->now.rate_believed_radps =
            bst_vec3_sub(craft->now.rate_believed_radps, correction[1]);
        for (int j = 0; j < craft->pendings; j++) {
            if (j < kept || j > k) {
                pending *other = &craft->pending[j];
                correct_past(&other->estimate, q_now, (double)(n - other->sampled) * craft->dt_s,
                             correction);
            }
        }
    }
    craft->pendings = kept;
}

/* Variance of wheel imbalance missing from the steps: all above the resolved frequency, and below
 * it what linear interpolation lacks. */
static double unresolved(const bst_spacecraft *craft) {
    double sum = 0.0, top = followed_radps(craft);
    const bst_mat3 *inertia = &craft->body.inertia;
    for (int i = 0; i < craft->wheels.count; i++) {
        const bst_wheel *wheel = &craft->wheels.wheel[i];
        double speed = fabs(craft->now.wheel_radps[i]);
        if ((wheel->static_kgm == 0.0 && wheel->dynamic_kgm2 == 0.0) || speed == 0.0) {
            continue;
        }
        bst_vec3 a = bst_wheel_imbalance_amplitude(wheel, speed);
        bst_vec3 turn = {a.x / inertia->m[0][0], a.y / inertia->m[1][1], a.z / inertia->m[2][2]};
        double share = speed > top ? 1.0 : (1.0 - cos(speed * craft->dt_s)) / 3.0;
        sum += share * bst_vec3_dot(turn, turn) / (6.0 * speed * speed * speed * speed);
    }
    return sum;
}

/* Advances the commanded roll by a controller step. */
static void roll(bst_spacecraft *craft) {
    bst_axis *axis = &craft->roll;
    bst_body_roll *now = &craft->now.roll;
    if (craft->roll_target_rad == 0.0 && axis->reference_rad == 0.0 &&
        axis->reference_radps == 0.0) {
        return;
    }
    now->angle_rad = axis->reference_rad;
    now->rate_radps = axis->reference_radps;
    double h = axis->spec.dt_s, accel = bst_axis_shape(axis, craft->roll_target_rad, 0.0);
    craft->now.reference = bst_spacecraft_attitude_reference_rolled(
        &craft->now.reference, now->axis_body, now->angle_rad, now->rate_radps);
    craft->now.reference.accel_radps2 =
        bst_vec3_axpy(craft->now.reference.accel_radps2, accel, now->axis_body);
    axis->reference_rad += axis->reference_radps * h + 0.5 * accel * h * h;
    axis->reference_radps += accel * h;
}

static bst_status control(bst_ctx *ctx, bst_spacecraft *craft, int64_t n, double seconds) {
    BST_TRY(
        bst_spacecraft_sky_grid_at(&craft->grid, ctx, seconds, &craft->sky, &craft->now.reference));
    const bst_body_state *body = &craft->now.body;
    bst_vec3 momentum = {0, 0, 0};
    for (int i = 0; i < craft->wheels.count; i++) {
        const bst_wheel *wheel = &craft->wheels.wheel[i];
        momentum =
            bst_vec3_axpy(momentum, wheel->inertia_kgm2 * craft->now.wheel_radps[i], wheel->axis);
    }
    craft->disturbance_nm = bst_disturbance_torque(&craft->disturbances, &craft->body.inertia,
                                                   body->q_body_from_gcrf, craft->sky.position_m,
                                                   craft->sky.sun_m, craft->sky.sunlit, momentum);
    if (craft->surface) {
        const bst_surface_state state = {body->q_body_from_gcrf,
                                         craft->sky.position_m,
                                         craft->sky.velocity_mps,
                                         craft->sky.sun_m,
                                         craft->sky.sunlit,
                                         seconds,
                                         1.0};
        craft->disturbance_nm =
            bst_vec3_add(craft->disturbance_nm, bst_surface_torque_at(craft->surface, &state));
    }
    craft->now.unresolved_rad2 = unresolved(craft);
    if (craft->law.law == BST_LAW_FREE) {
        return BST_OK;
    }
    roll(craft);
    /* the estimate is at the newest gyro sample */
    double age = (double)(n - craft->filter_step) * craft->dt_s;
    bst_quat q = bst_quat_unit(bst_quat_turn_frame(
        craft->filter.q_body_from_gcrf, bst_vec3_scale(craft->now.rate_believed_radps, age)));
    if (craft->samples_since_control > 0) {
        /* over all samples, to avoid counting their noise twice */
        craft->rate_control_radps =
            bst_vec3_axpy(bst_vec3_scale(craft->turn_since_control,
                                         1.0 / (craft->samples_since_control * craft->gyro.dt_s)),
                          -1.0, craft->filter.bias_radps);
        craft->turn_since_control = (bst_vec3){0, 0, 0};
        craft->samples_since_control = 0;
    }
    bst_vec3 torque = bst_spacecraft_attitude_control_step(&craft->control, &craft->now.reference,
                                                           q, craft->rate_control_radps, momentum,
                                                           craft->now.wheel_flags != 0u);
    craft->now.wheel_flags =
        bst_wheels_share(&craft->wheels, craft->now.wheel_radps, torque, craft->motor_nm);
    return BST_OK;
}

bst_status bst_spacecraft_step(bst_ctx *ctx, bst_spacecraft *craft, int64_t n, double seconds,
                               bst_vec3 reaction_nm) {
    assert(craft && n >= 0 && bst_is_finite_vec3(reaction_nm));
    if (n > 0) {
        move(craft, reaction_nm);
    }
    observe_motion(craft, n > 0);
    if (n % craft->gyro_steps == 0) {
        read_gyro(craft, n);
        read_trackers(craft, n, seconds);
        if (craft->pendings > 0) {
            process_measurements(craft, n);
        }
    }
    if (n % craft->control_steps == 0) {
        BST_TRY(control(ctx, craft, n, seconds));
    }
    double age = (double)(n - craft->filter_step) * craft->dt_s;
    bst_quat q = craft->filter.q_body_from_gcrf;
    craft->now.q_believed_from_gcrf =
        age > 0.0 ? bst_quat_unit(
                        bst_quat_turn_frame(q, bst_vec3_scale(craft->now.rate_believed_radps, age)))
                  : q;
    return BST_OK;
}
