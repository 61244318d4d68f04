#include "gimbal/mount/mount.h"

#include <assert.h>
#include <string.h>

/* share of the motor's capability, if the acceleration limit is left to the mount */
#define ACCEL_SHARE 0.7
#define RATE_MARGIN 0.1 /* share of the rate limit over which the motor torque falls to zero */
#define POLE_SHARE 0.8  /* share of the shaped outer rate while passing the pole */
#include "sim/core/invariant.h"
#define RATE_WINDOW_S 0.01
#define STUCK_AFTER_S 0.25
/* rate, in settling tolerances per second, above which an axis has not settled */
#define SETTLE_PER_S 50.0

enum { M = BST_MOUNT_MOST };

static const double two_pi = 2.0 * BST_PI;

static double clamp(double x, double least, double most) {
    return x < least ? least : x > most ? most : x;
}

static bst_status init_servo(bst_ctx *ctx, bst_mount *m, const bst_mount_config *c, int k) {
    bst_mount_servo *servo = &m->servo[k];
    double start[M] = {0.0};
    for (int i = 0; i < m->axes; i++) {
        start[i] = m->joints.state.angle_rad[i];
    }
    bst_mount_linear linear;
    bst_mount_linearise(&m->joints, k, start, m->dt_s, m->delay_steps, m->sight_share[k], &linear);
    BST_TRY(bst_mount_servo_compensator(ctx, &c->servo, &linear, &servo->compensator));
    servo->output_limit_radps2 = servo->compensator.limit;
    servo->torque_limit_nm = c->motor_torque_nm[k];
    servo->rate_limit_radps = c->rate_limit_degps[k] * BST_DEG_RAD;
    double accel = c->accel_limit_degps2[k] * BST_DEG_RAD;
    bst_axis_spec spec = {
        .rate_limit_radps = servo->rate_limit_radps,
        .accel_limit_radps2 =
            accel > 0.0 ? accel : ACCEL_SHARE * servo->torque_limit_nm / linear.inertia_kgm2,
        .natural_frequency_radps = 1.0,
        .damping = 1.0,
        .dt_s = m->dt_s};
    bst_axis_init(&servo->shaper, &spec);
    servo->shaper.reference_rad = start[k];
    for (int i = 0; i <= BST_MOUNT_DELAYS; i++) {
        servo->ring_rad[i] = start[k];
    }
    servo->unwrapped_rad = servo->before_rad = servo->watched_rad = start[k];
    servo->reading_rad = bst_wrap_angle(start[k]);
    return BST_OK;
}

bst_status bst_mount_init(bst_ctx *ctx, bst_mount *m, int type, const bst_mount_config *c,
                          double dt_s, bst_rng_key encoder_key) {
    assert(m && c && bst_is_positive(dt_s));
    *m = (bst_mount){.type = type,
                     .encoder_step_rad = c->encoder.resolution_arcsec * BST_ARCSEC_RAD,
                     .encoder_noise_rad = c->encoder.noise_arcsec * BST_ARCSEC_RAD,
                     .settle_tolerance_rad = c->servo.settle_tolerance_arcsec * BST_ARCSEC_RAD,
                     .feed_model = c->servo.model_feed_forward,
                     .feed_friction = c->servo.friction_feed_forward,
                     .delay_steps = (int)c->servo.delay_steps,
                     .stuck_axis = c->fault.stuck_axis - 1,
                     .stuck_from_step = (int64_t)ceil(c->fault.stuck_from_s / dt_s - 1e-9),
                     .rate_steps = (int64_t)fmax(1.0, round(RATE_WINDOW_S / dt_s)),
                     .stuck_steps = (int64_t)ceil(STUCK_AFTER_S / dt_s),
                     .encoder_key = encoder_key,
                     .dt_s = dt_s};
    BST_TRY(bst_mount_config_joints(ctx, type, c, dt_s, &m->joints));
    m->axes = m->joints.chain.stages;
    m->model = m->joints.chain;
    if (m->stuck_axis >= m->axes) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "fault/stuck_axis: this mount has no third axis; set third_axis, or name "
                        "another");
    }
    for (int k = 0; k < m->axes; k++) {
        m->sight_share[k] = c->flexible.line_of_sight_fraction[k];
        m->model.flex_inertia[k] = m->model.flex_stiffness[k] = m->model.flex_damping[k] = 0.0;
        m->travel_min_rad[k] = m->joints.joint[k].min_rad;
        m->travel_max_rad[k] = m->joints.joint[k].max_rad;
    }
    for (int k = 0; k < m->axes; k++) {
        BST_TRY(init_servo(ctx, m, c, k));
    }
    m->q_cam_from_body = m->q_seen_from_body = bst_mount_attitude(type, m->joints.state.angle_rad);
    return BST_OK;
}

static bst_status archive_servo(bst_mount_servo *servo, bst_archive *archive) {
    bst_axis_archive(&servo->shaper, archive);
    BST_TRY(bst_compensator_archive(&servo->compensator, archive));
    BST_ARCHIVE(archive, servo->ring_rad);
    BST_ARCHIVE(archive, servo->ring_radps);
    BST_ARCHIVE(archive, servo->waiting_nm);
    BST_ARCHIVE(archive, servo->torque_nm);
    BST_ARCHIVE(archive, servo->reading_rad);
    BST_ARCHIVE(archive, servo->unwrapped_rad);
    BST_ARCHIVE(archive, servo->rate_radps);
    BST_ARCHIVE(archive, servo->before_rad);
    BST_ARCHIVE(archive, servo->watched_rad);
    servo->pushed = bst_archive_integer(archive, servo->pushed, 0, BST_PLANT_STEPS_MOST);
    bst_archive_bool(archive, &servo->saturated);
    bst_archive_bool(archive, &servo->stuck);
    return BST_OK;
}

bst_status bst_mount_archive(bst_mount *m, bst_archive *archive) {
    bst_mount_joints_archive(&m->joints, archive);
    for (int k = 0; k < m->axes; k++) {
        BST_TRY(archive_servo(&m->servo[k], archive));
    }
    m->steps = bst_archive_integer(archive, m->steps, 0, BST_PLANT_STEPS_MOST);
    BST_ARCHIVE(archive, m->base_rate_radps);
    BST_ARCHIVE(archive, m->target_body);
    BST_ARCHIVE(archive, m->q_cam_from_body);
    BST_ARCHIVE(archive, m->q_seen_from_body);
    BST_ARCHIVE(archive, m->reaction_nm);
    bst_archive_bool(archive, &m->settled);
    bst_archive_bool(archive, &m->limited);
    return BST_OK;
}

/* Requested angles and rates of the axes at one time. */
typedef struct request {
    double angle_rad[M], rate_radps[M];
    bool out_of_travel;
} request;

/* The whole turn of an angle nearest to `near` within travel; otherwise the nearer stop. */
static double best_turn(double angle, double near, double least, double most, bool *outside) {
    double best = near + bst_wrap_angle(angle - near);
    if (best > most) {
        best -= two_pi * ceil((best - most) / two_pi);
    } else if (best < least) {
        best += two_pi * ceil((least - best) / two_pi);
    }
    if (best > most || best < least) {
        *outside = true;
        /* the stop nearest to any turn of the angle */
        best = fabs(bst_wrap_angle(angle - most)) <= fabs(bst_wrap_angle(angle - least)) ? most
                                                                                         : least;
    }
    return best;
}

/* Chooses the faster of the two mount solutions. */
static void choose_solution(const bst_mount *m, const bst_mount_pose *pose, const double near[M],
                            request *out) {
    double best = INFINITY;
    for (int way = 0; way < 2; way++) {
        double outer = pose->angle_rad[0], inner = pose->angle_rad[1], sense = 1.0;
        if (way == 1) {
            outer += BST_PI;
            inner = BST_PI - inner;
            sense = -1.0;
        }
        bool outside = false;
        outer = best_turn(outer, near[0], m->travel_min_rad[0], m->travel_max_rad[0], &outside);
        inner = best_turn(inner, near[1], m->travel_min_rad[1], m->travel_max_rad[1], &outside);
        double time = fmax(fabs(outer - near[0]) / m->servo[0].rate_limit_radps,
                           fabs(inner - near[1]) / m->servo[1].rate_limit_radps);
        if (outside) {
            time += 1e6; /* only if there is no other */
        }
        if (time < best) {
            best = time;
            out->angle_rad[0] = outer;
            out->angle_rad[1] = inner;
            out->rate_radps[0] = pose->rate_radps[0];
            out->rate_radps[1] = sense * pose->rate_radps[1];
            out->out_of_travel = outside;
        }
    }
}

/* Uses the third axis for motion beyond the outer axis' limits. */
static void add_third_axis(const bst_mount *m, bst_vec3 direction, bst_vec3 rate,
                           const bst_los_command *command, double age_s, const bst_mount_pose *pose,
                           request *out) {
    const bst_axis *outer = &m->servo[0].shaper;
    double angle = pose->angle_rad[0], speed = pose->rate_radps[0];
    bool outside = false;
    if (command->near_given) {
        double near = command->near_rad[0] + age_s * command->near_radps[0];
        double wanted = clamp(near, m->travel_min_rad[0], m->travel_max_rad[0]);
        bst_mount_pose rest = bst_mount_solve_rest(m->type, direction, rate, wanted, 0.0);
        if (rest.angle_rad[2] >= m->travel_min_rad[2] &&
            rest.angle_rad[2] <= m->travel_max_rad[2] &&
            rest.angle_rad[1] >= m->travel_min_rad[1] &&
            rest.angle_rad[1] <= m->travel_max_rad[1]) {
            angle = wanted;
            speed = wanted == near ? command->near_radps[0] : 0.0;
        } else {
            angle = best_turn(angle, near, m->travel_min_rad[0], m->travel_max_rad[0], &outside);
        }
    } else {
        double limit = POLE_SHARE * outer->spec.rate_limit_radps;
        bst_mount_pass_pole(m->type, direction, rate, limit, pose, &angle, &speed);
        angle = best_turn(angle, outer->reference_rad, m->travel_min_rad[0], m->travel_max_rad[0],
                          &outside);
    }
    out->angle_rad[0] = angle;
    out->rate_radps[0] = outside ? 0.0 : speed;
    /* from the outer axis' next reference within its limits */
    bst_axis next = *outer;
    double accel = bst_axis_shape(&next, out->angle_rad[0], out->rate_radps[0]);
    double next_radps = outer->reference_radps + m->dt_s * accel;
    double next_rad = outer->reference_rad + 0.5 * m->dt_s * (outer->reference_radps + next_radps);
    bst_mount_pose rest = bst_mount_solve_rest(m->type, direction, rate, next_rad, next_radps);
    for (int k = 1; k < 3; k++) {
        double wanted = rest.angle_rad[k];
        out->angle_rad[k] = clamp(wanted, m->travel_min_rad[k], m->travel_max_rad[k]);
        out->rate_radps[k] = out->angle_rad[k] == wanted ? rest.rate_radps[k] : 0.0;
        outside = outside || out->angle_rad[k] != wanted;
    }
    out->out_of_travel = outside;
}

/* Commanded direction and rate, body axes, `ahead_s` from now, by the estimated attitude. */
static void direction_at(const bst_mount_body *body, const bst_los_command *command, double age_s,
                         double ahead_s, bst_vec3 *direction, bst_vec3 *rate) {
    double t = age_s + ahead_s;
    bst_vec3 r = bst_vec3_axpy(command->rate_gcrf_radps, t, command->accel_gcrf_radps2);
    bst_vec3 v = bst_vec3_axpy(command->direction_gcrf, t, command->rate_gcrf_radps);
    v = bst_vec3_axpy(v, 0.5 * t * t, command->accel_gcrf_radps2);
    double scale = 1.0 / bst_vec3_norm(v);
    bst_vec3 d = bst_vec3_scale(v, scale);
    r = bst_vec3_scale(r, scale);
    r = bst_vec3_axpy(r, -bst_vec3_dot(r, d), d);
    d = bst_quat_rotate(body->q_believed_from_gcrf, d);
    r = bst_quat_rotate(body->q_believed_from_gcrf, r);
    /* the body keeps rotating meanwhile */
    r = bst_vec3_sub(r, bst_vec3_cross(body->believed_rate_radps, d));
    if (ahead_s > 0.0) {
        d = bst_vec3_unit(bst_vec3_axpy(d, -ahead_s, bst_vec3_cross(body->believed_rate_radps, d)));
    }
    *direction = d;
    *rate = r;
}

/* Motor torque at a rate, limited by the motor. */
static double motor_torque(const bst_mount_servo *servo, double wanted_nm, double rate) {
    double most = servo->torque_limit_nm, least = -most;
    if (fabs(rate) <= servo->rate_limit_radps) {
        return wanted_nm;
    }
    double over = (fabs(rate) / servo->rate_limit_radps - 1.0) / RATE_MARGIN;
    double left = over < 1.0 ? 1.0 - over : 0.0;
    most *= rate > 0.0 ? left : 1.0;
    least *= rate < 0.0 ? left : 1.0;
    return clamp(wanted_nm, least, most);
}

/* Integrates the joints to this step; base frame. */
static void integrate(bst_mount *m, const double torque_nm[M], bst_vec3 rate_body) {
    bst_vec3 rate = bst_mount_swap(m->type, rate_body), before = m->base_rate_radps;
    if (m->stuck_axis >= 0 && m->steps >= m->stuck_from_step &&
        !m->joints.joint[m->stuck_axis].stuck) {
        m->joints.joint[m->stuck_axis].stuck = true;
        m->joints.state.rate_radps[m->stuck_axis] = 0.0;
    }
    if (m->steps > 0) {
        bst_vec3 momentum = {0, 0, 0};
        if (m->want_reaction) {
            momentum = bst_mount_chain_momentum(&m->joints.chain, &m->joints.state, before);
        }
        bst_mount_joints_step(&m->joints, m->dt_s, torque_nm, before, rate);
        if (m->want_reaction) {
            /* momentum exchange: dH/dt of the mount in inertial space */
            bst_vec3 after = bst_mount_chain_momentum(&m->joints.chain, &m->joints.state, rate);
            bst_vec3 gain = bst_vec3_scale(bst_vec3_sub(after, momentum), 1.0 / m->dt_s);
            gain = bst_vec3_axpy(gain, 0.5, bst_vec3_cross(before, momentum));
            gain = bst_vec3_axpy(gain, 0.5, bst_vec3_cross(rate, after));
            /* in the body axes of the step in which it acts */
            gain = bst_vec3_axpy(gain, -m->dt_s, bst_vec3_cross(rate, gain));
            m->reaction_nm = bst_mount_swap(m->type, bst_vec3_scale(gain, -1.0));
        }
    }
    m->base_rate_radps = rate;
    double sight[M] = {0.0};
    for (int k = 0; k < m->axes; k++) {
        sight[k] = m->joints.state.angle_rad[k] + m->sight_share[k] * m->joints.state.flex_rad[k];
    }
    m->q_cam_from_body = bst_mount_attitude(m->type, sight);
}

void bst_mount_drive(bst_mount *m, const double torque_nm[M], bst_vec3 rate_body) {
    integrate(m, torque_nm, rate_body);
    m->steps++;
}

static void read_encoders(bst_mount *m, int64_t n) {
    double noise[4] = {0.0};
    if (m->encoder_noise_rad > 0.0) {
        bst_rng_normal2(m->encoder_key, (uint64_t)n, 0, noise);
        if (m->axes > 2) {
            bst_rng_normal2(m->encoder_key, (uint64_t)n, 1, noise + 2);
        }
    }
    for (int k = 0; k < m->axes; k++) {
        bst_mount_servo *servo = &m->servo[k];
        double reading = m->joints.state.angle_rad[k] + m->encoder_noise_rad * noise[k];
        if (m->encoder_step_rad > 0.0) {
            reading = m->encoder_step_rad * rint(reading / m->encoder_step_rad);
        }
        servo->reading_rad = bst_wrap_angle(reading);
        servo->unwrapped_rad += bst_wrap_angle(servo->reading_rad - servo->unwrapped_rad);
        if (n % m->rate_steps == 0) {
            servo->rate_radps =
                (servo->unwrapped_rad - servo->before_rad) / ((double)m->rate_steps * m->dt_s);
            servo->before_rad = servo->unwrapped_rad;
        }
    }
}

/* Detects an axis that is driven but does not turn (stuck). */
static void detect_stuck(bst_mount *m, bst_mount_servo *servo, double error_rad) {
    double moved = fabs(servo->unwrapped_rad - servo->watched_rad);
    double blind = 4.0 * m->encoder_noise_rad + 2.0 * m->encoder_step_rad;
    if (moved > blind || fabs(error_rad) <= m->settle_tolerance_rad + blind) {
        servo->watched_rad = servo->unwrapped_rad;
        servo->pushed = 0;
        servo->stuck = false;
    } else {
        servo->pushed++;
        servo->stuck = servo->pushed > m->stuck_steps;
    }
}

/* Servo step: advances the references and computes the torques for the step after the delay, from
 * references and encoders. */
static void control(bst_mount *m, const request *wanted, bst_vec3 believed_rate_body, int64_t n) {
    double asked[M] = {0.0}, s[M], c[M];
    bst_mount_chain_state at = {{0.0}, {0.0}, {0.0}, {0.0}};
    int64_t newest = n + m->delay_steps + 1;
    m->limited = wanted->out_of_travel;
    double accel[M];
    for (int k = 0; k < m->axes; k++) {
        bst_axis *shaper = &m->servo[k].shaper;
        shaper->limited = false;
        accel[k] = bst_axis_shape(shaper, wanted->angle_rad[k], wanted->rate_radps[k]);
        /* middle of the step in which the torque acts */
        at.rate_radps[k] = shaper->reference_radps + 0.5 * m->dt_s * accel[k];
        at.angle_rad[k] = shaper->reference_rad + 0.5 * m->dt_s * at.rate_radps[k];
        s[k] = sin(at.angle_rad[k]);
        c[k] = cos(at.angle_rad[k]);
        shaper->reference_rad += m->dt_s * at.rate_radps[k];
        shaper->reference_radps += m->dt_s * accel[k];
        int slot = (int)(newest % (BST_MOUNT_DELAYS + 1));
        m->servo[k].ring_rad[slot] = shaper->reference_rad;
        m->servo[k].ring_radps[slot] = shaper->reference_radps;
        m->limited = m->limited || shaper->limited;
    }
    bst_mount_chain_base base = {bst_mount_swap(m->type, believed_rate_body), {0, 0, 0}};
    bst_mount_chain_equations eq;
    bst_mount_chain_equations_at(&m->model, &at, s, c, &base, &eq);
    for (int k = 0; k < m->axes; k++) {
        bst_mount_servo *servo = &m->servo[k];
        double error = servo->ring_rad[n % (BST_MOUNT_DELAYS + 1)] - servo->unwrapped_rad;
        servo->compensator.limit =
            fmin(servo->output_limit_radps2, servo->torque_limit_nm / eq.mass[k][k]);
        asked[k] = bst_compensator_step(&servo->compensator, error, accel[k]);
        detect_stuck(m, servo, error);
    }
    for (int k = 0; k < m->axes; k++) {
        bst_mount_servo *servo = &m->servo[k];
        const bst_mount_joint *joint = &m->joints.joint[k];
        double rate = at.rate_radps[k];
        double torque =
            m->feed_model * (eq.bias_nm[k] + joint->viscous_nms * rate +
                             joint->spring_nm * (at.angle_rad[k] - joint->spring_zero_rad));
        if (m->feed_friction > 0.0 && rate != 0.0) {
            double x = rate / joint->stribeck_radps;
            double dry =
                joint->coulomb_nm + (joint->breakaway_nm - joint->coulomb_nm) / (1.0 + x * x);
            torque += m->feed_friction * copysign(dry, rate);
        }
        for (int i = 0; i < m->axes; i++) {
            torque += eq.mass[k][i] * asked[i];
        }
        double given = clamp(torque, -servo->torque_limit_nm, servo->torque_limit_nm);
        servo->saturated = given != torque || servo->compensator.limited;
        m->limited = m->limited || servo->saturated;
        servo->waiting_nm[(n + m->delay_steps) % BST_MOUNT_DELAYS] = given;
    }
}

void bst_mount_step(bst_mount *m, const bst_mount_body *body, const bst_los_command *command,
                    double command_age_s, bool measure) {
    assert(m && body && bst_is_finite_vec3(body->rate_radps));
    assert(!command || bst_is_unit_vec3(command->direction_gcrf, BST_LINK_UNIT_TOLERANCE));
    int64_t n = m->steps;
    double torque[M] = {0.0};
    for (int k = 0; k < m->axes; k++) {
        torque[k] = motor_torque(
            &m->servo[k], m->servo[k].waiting_nm[(n + BST_MOUNT_DELAYS - 1) % BST_MOUNT_DELAYS],
            m->joints.state.rate_radps[k]);
        m->servo[k].torque_nm = torque[k];
    }
    integrate(m, torque, body->rate_radps);
    read_encoders(m, n);

    request wanted = {{0.0}, {0.0}, false};
    m->target_body = (bst_vec3){0, 0, 0};
    bst_vec3 direction = {0, 0, 0}, rate = {0, 0, 0};
    if (command) {
        double ahead_s = m->dt_s * (double)(m->delay_steps + 1);
        direction_at(body, command, command_age_s, ahead_s, &direction, &rate);
        const bst_axis *outer = &m->servo[0].shaper;
        bst_mount_pose pose = bst_mount_solve(m->type, direction, rate, outer->reference_rad);
        if (m->axes > 2) {
            add_third_axis(m, direction, rate, command, command_age_s + ahead_s, &pose, &wanted);
        } else {
            double near[M] = {outer->reference_rad, m->servo[1].shaper.reference_rad, 0.0};
            for (int k = 0; command->near_given && k < 2; k++) {
                near[k] = command->near_rad[k] + (command_age_s + ahead_s) * command->near_radps[k];
            }
            choose_solution(m, &pose, near, &wanted);
        }
    } else {
        for (int k = 0; k < m->axes; k++) {
            wanted.angle_rad[k] = m->servo[k].shaper.reference_rad;
        }
    }
    control(m, &wanted, body->believed_rate_radps, n);
    m->steps++;
    if (measure) {
        double seen[M] = {0.0}, rate_off = 0.0;
        for (int k = 0; k < m->axes; k++) {
            seen[k] = m->servo[k].reading_rad;
            rate_off =
                fmax(rate_off, fabs(wanted.rate_radps[k] - m->servo[k].shaper.reference_radps));
        }
        m->q_seen_from_body = bst_mount_attitude(m->type, seen);
        m->settled = false;
        if (command) {
            direction_at(body, command, command_age_s, 0.0, &direction, &rate);
            bst_vec3 sight =
                bst_quat_rotate(bst_quat_conj(m->q_seen_from_body), (bst_vec3){0, 0, 1});
            bst_vec3 off = bst_vec3_sub(sight, direction);
            double tolerance = m->settle_tolerance_rad;
            m->settled = bst_vec3_dot(off, off) <= tolerance * tolerance &&
                         rate_off <= SETTLE_PER_S * tolerance;
        }
    }
}

void bst_mount_status_of(const bst_mount *m, int64_t tick, bst_mount_status *out) {
    assert(m && out);
    *out = (bst_mount_status){
        .tick = tick, .axes = m->axes, .q_body_from_cam_at_zero = BST_QUAT_IDENTITY};
    for (int k = 0; k < m->axes; k++) {
        const bst_mount_servo *servo = &m->servo[k];
        bool endless = isinf(m->travel_min_rad[k]);
        double angle = servo->unwrapped_rad;
        double reach = m->encoder_step_rad + 4.0 * m->encoder_noise_rad + 1e-6;
        bool at_stop = !endless && (angle >= m->travel_max_rad[k] - reach ||
                                    angle <= m->travel_min_rad[k] + reach);
        out->axis[k] = (bst_mount_axis){
            .axis_body = bst_mount_axis_body(m->type, k),
            .angle_rad = endless ? servo->reading_rad : angle,
            .rate_radps = servo->rate_radps,
            .rate_limit_radps = servo->shaper.spec.rate_limit_radps,
            .accel_limit_radps2 = servo->shaper.spec.accel_limit_radps2,
            .min_rad = endless ? 0.0 : m->travel_min_rad[k],
            .max_rad = endless ? 0.0 : m->travel_max_rad[k],
            .redundant = k == 2,
            .flags = (servo->stuck ? BST_AXIS_STUCK : 0u) |
                     (servo->saturated || servo->shaper.limited ? BST_AXIS_SATURATED : 0u) |
                     (at_stop ? BST_AXIS_AT_STOP : 0u)};
    }
}
