#include "gimbal/mount/mount_config.h"

#define STEPS_PER_PERIOD 10.0 /* plant steps per period of the fastest mode */

static const char *const axis_names[] = {"outer", "inner", "third"};

#define F bst_mount_friction_config
static const bst_config_desc friction_table[] = {
    BST_REALS(F, coulomb_nm, "N m", 0, 1e12, "[0.02, 0.01, 0.005]",
              "Friction of a sliding axis, far above stribeck_degps."),
    BST_REALS(F, breakaway_nm, "N m", 0, 1e12, "[0.03, 0.015, 0.0075]",
              "Friction that an axis at rest can hold; at least coulomb_nm."),
    BST_REALS(F, stribeck_degps, "deg/s", 1e-9, 1000, "[0.05, 0.05, 0.05]",
              "Rate at which half of the difference of the two is left."),
    BST_REALS(F, viscous_nms_per_rad, "N m s/rad", 0, 1e9, "[0.05, 0.02, 0.01]",
              "Friction in proportion to the rate."),
    BST_CONFIG_END};
#undef F

#define C bst_mount_cable_config
static const bst_config_desc cable_table[] = {
    BST_REALS(C, stiffness_nm_per_rad, "N m/rad", 0, 1e9, "[0.02, 0.01, 0.005]",
              "Torque of the cable across an axis per angle, whole turns counted."),
    BST_REALS(C, zero_deg, "deg", -36000, 36000, "[0, 0, 0]",
              "Angle at which the cable is without torque."),
    BST_CONFIG_END};
#undef C

#define E bst_mount_encoder_config
static const bst_config_desc encoder_table[] = {
    BST_REAL(E, resolution_arcsec, "arcsec", 0, 36000, "0.05", "Step of the encoders; 0: none."),
    BST_REAL(E, noise_arcsec, "arcsec", 0, 3600, "0.05",
             "White noise of a reading, one draw a plant step, before the rounding."),
    BST_CONFIG_END};
#undef E

#define M bst_mount_flexible_config
static const bst_config_desc flexible_table[] = {
    BST_REALS(M, frequency_hz, "Hz", 0, 1e5, "[0, 0, 0]",
              "Of the mode about each axis with the joint held (the antiresonance from torque to "
              "encoder); 0: rigid. With the joint free it is higher by 1 / sqrt(1 - share)."),
    BST_REALS(M, damping, "", 0, 1, "[0.005, 0.005, 0.005]", "Damping ratio with the joint held."),
    BST_REALS(M, inertia_fraction, "", 0, 0.95, "[0.2, 0.2, 0.2]",
              "Share that swings, of the axis' inertia at zero angles."),
    BST_FORMER("inertia_share", "inertia_fraction"),
    BST_REALS(M, line_of_sight_fraction, "", -10, 10, "[1, 1, 1]",
              "How far the line of sight follows the swinging part's angle."),
    BST_FORMER("line_of_sight_share", "line_of_sight_fraction"),
    BST_CONFIG_END};
#undef M

#define S bst_mount_servo_config
static const bst_config_desc compensator_table[] = {
    BST_COMPENSATOR_KEYS(bst_compensator_types, "\"pid\""), BST_CONFIG_END};

static const bst_config_desc servo_table[] = {
    BST_OBJECT(S, compensator, compensator_table, "{}",
               "From the encoder's error, rad, to the axis' acceleration, rad/s^2 (torque over "
               "inertia), at the plant's rate. Where it has neither gains nor a specification: "
               "crossover_hz 10."),
    BST_INT(S, delay_steps, "", 0, 16, "1",
            "Plant steps from an encoder's reading to the torque that follows from it."),
    BST_REAL(S, model_feed_forward, "", 0, 2, "1",
             "Share of the torque against viscous friction, cables and gyroscopic coupling that is "
             "fed forward."),
    BST_REAL(S, friction_feed_forward, "", 0, 2, "0",
             "Share of the Coulomb and Stribeck friction that is fed forward."),
    BST_REAL(S, settle_tolerance_arcsec, "arcsec", 1e-6, 36000, "3",
             "The servo reports `settled` within this angle of its command."),
    BST_CONFIG_END};
#undef S

static const char *const stuck_names[] = {"none", "outer", "inner", "third", NULL};
#define T bst_mount_fault_config
static const bst_config_desc fault_table[] = {
    BST_ENUM(T, stuck_axis, stuck_names, "\"none\"", "An axis that does not turn any more ..."),
    BST_REAL(T, stuck_from_s, "s", 0, 1e9, "0", "... from this time on."), BST_CONFIG_END};
#undef T

static const char *const integrator_names[] = {"rk4", "leapfrog", NULL};

#define G bst_mount_config
const bst_config_desc bst_mount_config_table[] = {
    BST_BOOL(G, third_axis, "false",
             "A third axis on the inner stage, along the outer axis at zero angles, by which "
             "targets are followed past the pole."),
    BST_REALS(G, inertia_outer_kgm2, "kg m^2", -1e6, 1e6, "[0.6, 0.5, 0.5, 0, 0, 0]",
              "Inertia tensor of the outer stage without the inner one, about the point where the "
              "axes meet, body axes at zero angles: xx, yy, zz, xy, xz, yz."),
    BST_REALS(G, inertia_inner_kgm2, "kg m^2", -1e6, 1e6, "[0.3, 0.3, 0.2, 0, 0, 0]",
              "The same of the inner stage, without the third one."),
    BST_REALS(G, inertia_third_kgm2, "kg m^2", -1e6, 1e6, "[0.1, 0.1, 0.08, 0, 0, 0]",
              "The same of the third stage, where there is one."),
    BST_REALS(G, motor_torque_nm, "N m", 1e-9, 1e9, "[2, 1, 0.5]",
              "Greatest torque of the motors."),
    BST_REALS(
        G, rate_limit_degps, "deg/s", 1e-6, 1000, "[10, 10, 5]",
        "Greatest rate of the axes: a motor's torque in the direction of motion falls to zero "
        "between this rate and 1.1 times it."),
    BST_REALS(G, accel_limit_degps2, "deg/s^2", 0, 1e5, "[0, 0, 0]",
              "Greatest acceleration that the servo asks for; 0: 0.7 of what the motor can give at "
              "zero angles."),
    BST_REALS(G, travel_min_deg, "deg", -36000, 0, "[-270, -90, -10]",
              "Stops, with those above: the outer axis' count whole turns of the cable; both 0 "
              "for no stops."),
    BST_REALS(G, travel_max_deg, "deg", 0, 36000, "[270, 90, 10]", "The other stops."),
    BST_REALS(G, start_deg, "deg", -36000, 36000, "[0, 0, 0]", "Angles at the start, at rest."),
    BST_REAL(G, stop_restitution, "", 0, 1, "0.2",
             "Rate after meeting a stop over the rate before."),
    BST_OBJECT(G, friction, friction_table, "{}", "Friction of the axes."),
    BST_OBJECT(G, cable, cable_table, "{}", "Cables across the axes."),
    BST_OBJECT(G, encoder, encoder_table, "{}", "Encoders of the axes."),
    BST_OBJECT(G, flexible, flexible_table, "{}", "A flexible mode about each axis."),
    BST_OBJECT(G, servo, servo_table, "{}", "The loop of each axis."),
    BST_OBJECT(G, fault, fault_table, "{}", "What breaks."),
    BST_ENUM(G, integrator, integrator_names, "\"rk4\"",
             "How a step of the axes is worked out between events of friction and stops: "
             "Runge-Kutta of order 4, or leapfrog, of order 2, which takes half of the time."),
    BST_OBJECT(G, platform, bst_platform_config_table, "{}",
               "The spacecraft: drift, jitter, attitude knowledge, telemetry."),
    BST_CONFIG_END};
#undef G

/* Converts a tensor from body axes to the base frame (bst_mount_swap). */
static void to_base(int type, const double body[6], double out[6]) {
    bool swap = type != BST_MOUNT_AZIMUTH_ELEVATION;
    out[0] = body[swap ? 1 : 0];
    out[1] = body[swap ? 0 : 1];
    out[2] = body[2];
    out[3] = body[3];
    out[4] = swap ? -body[5] : body[4];
    out[5] = swap ? -body[4] : body[5];
}

/* True for a physical inertia tensor: positive definite, and no principal moment above the sum of
 * the others. Then half the trace times 1 minus the tensor, the second moments of mass, is positive
 * too. */
static bool is_inertia(const double j[6]) {
    double half = 0.5 * (j[0] + j[1] + j[2]), slack = 1e-9 * half;
    double x = half - j[0] + slack, y = half - j[1] + slack, z = half - j[2] + slack;
    double minor = x * y - j[3] * j[3];
    double det = z * minor - x * j[5] * j[5] - y * j[4] * j[4] - 2.0 * j[3] * j[4] * j[5];
    return half > 0.0 && x > 0.0 && y > 0.0 && z > 0.0 && minor > 0.0 && det > 0.0;
}

static bst_status put_flexible(bst_ctx *ctx, const bst_mount_flexible_config *f, double dt_s,
                               bst_mount_chain *chain) {
    static const double zero[BST_CHAIN_MOST] = {0.0}, one[BST_CHAIN_MOST] = {1.0, 1.0, 1.0};
    bst_mount_chain_state still = {{0.0}, {0.0}, {0.0}, {0.0}};
    bst_mount_chain_base base = {{0, 0, 0}, {0, 0, 0}};
    bst_mount_chain_equations eq;
    bst_mount_chain_equations_at(chain, &still, zero, one, &base, &eq);
    for (int k = 0; k < chain->stages; k++) {
        if (f->frequency_hz[k] <= 0.0) {
            continue;
        }
        double w = 2.0 * BST_PI * f->frequency_hz[k];
        double swings = f->inertia_fraction[k] * eq.mass[k][k];
        double own = chain->inertia[k][k == 1 ? 1 : 0];
        if (swings <= 0.0 || swings >= 0.98 * own) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "flexible/inertia_fraction: %g of the %s axis' %g kg m^2 must be above "
                            "zero and less than the %g kg m^2 of its own stage: at most %.3g",
                            f->inertia_fraction[k], axis_names[k], eq.mass[k][k], own,
                            0.98 * own / eq.mass[k][k]);
        }
        double free_hz = f->frequency_hz[k] / sqrt(1.0 - f->inertia_fraction[k]);
        double longest_s = 1.0 / (STEPS_PER_PERIOD * free_hz);
        if (dt_s > longest_s * (1.0 + 1e-9)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "flexible/frequency_hz: the %s axis' mode swings at %g Hz with the "
                            "joint free, and a plant step of %g s cannot follow it; the largest "
                            "step allowed is %.4g s, a tenth of its period: give rate_hz at least "
                            "%.6g, or frequency_hz 0 for a rigid axis",
                            axis_names[k], free_hz, dt_s, longest_s, 1.0 / longest_s);
        }
        chain->flex_inertia[k] = swings;
        chain->flex_stiffness[k] = swings * w * w;
        chain->flex_damping[k] = 2.0 * f->damping[k] * w * swings;
    }
    return BST_OK;
}

/* Checks the plant step against viscous friction and cables, which also make an axis fast. */
static bst_status check_step(bst_ctx *ctx, const bst_mount_joints *joints, double dt_s) {
    for (int k = 0; k < joints->chain.stages; k++) {
        const bst_mount_joint *joint = &joints->joint[k];
        /* smallest effective inertia of the axis */
        double inertia = joints->chain.inertia[k][k == 1 ? 1 : 0] - joints->chain.flex_inertia[k];
        double longest_s = joint->viscous_nms > 0.0 ? 0.5 * inertia / joint->viscous_nms : INFINITY;
        if (dt_s > longest_s) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "friction/viscous_nms_per_rad: %g N m s/rad bring the %s axis, %g kg "
                            "m^2, to rest within a step of %g s; the largest step allowed is %.4g "
                            "s: give rate_hz at least %.6g, or less friction",
                            joint->viscous_nms, axis_names[k], inertia, dt_s, longest_s,
                            1.0 / longest_s);
        }
        longest_s = joint->spring_nm > 0.0
                        ? 2.0 * BST_PI / STEPS_PER_PERIOD * sqrt(inertia / joint->spring_nm)
                        : INFINITY;
        if (dt_s > longest_s) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "cable/stiffness_nm_per_rad: on %g N m/rad the %s axis, %g kg m^2, "
                            "swings too fast for a step of %g s; the largest step allowed is %.4g "
                            "s: give rate_hz at least %.6g, or a softer cable",
                            joint->spring_nm, axis_names[k], inertia, dt_s, longest_s,
                            1.0 / longest_s);
        }
    }
    return BST_OK;
}

bst_status bst_mount_config_joints(bst_ctx *ctx, int type, const bst_mount_config *c, double dt_s,
                                   bst_mount_joints *joints) {
    *joints = (bst_mount_joints){.method = c->integrator};
    bst_mount_chain *chain = &joints->chain;
    chain->stages = c->third_axis ? 3 : 2;
    const double *inertia[BST_CHAIN_MOST] = {c->inertia_outer_kgm2, c->inertia_inner_kgm2,
                                             c->inertia_third_kgm2};
    double start[BST_CHAIN_MOST];
    for (int k = 0; k < chain->stages; k++) {
        if (!is_inertia(inertia[k])) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "inertia_%s_kgm2: no body has this tensor: it must be positive, and no "
                            "principal moment greater than the other two together",
                            axis_names[k]);
        }
        to_base(type, inertia[k], chain->inertia[k]);
        const bst_mount_friction_config *f = &c->friction;
        if (f->breakaway_nm[k] < f->coulomb_nm[k]) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "friction/breakaway_nm: %g N m of the %s axis are below its "
                            "coulomb_nm, %g; give at least as much",
                            f->breakaway_nm[k], axis_names[k], f->coulomb_nm[k]);
        }
        bool endless = c->travel_min_deg[k] == 0.0 && c->travel_max_deg[k] == 0.0;
        start[k] = c->start_deg[k] * BST_DEG_RAD;
        if (!endless &&
            (c->start_deg[k] < c->travel_min_deg[k] || c->start_deg[k] > c->travel_max_deg[k])) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "start_deg: %g of the %s axis is outside of its travel, %g to %g",
                            c->start_deg[k], axis_names[k], c->travel_min_deg[k],
                            c->travel_max_deg[k]);
        }
        joints->joint[k] =
            (bst_mount_joint){.coulomb_nm = f->coulomb_nm[k],
                              .breakaway_nm = f->breakaway_nm[k],
                              .stribeck_radps = f->stribeck_degps[k] * BST_DEG_RAD,
                              .viscous_nms = f->viscous_nms_per_rad[k],
                              .spring_nm = c->cable.stiffness_nm_per_rad[k],
                              .spring_zero_rad = c->cable.zero_deg[k] * BST_DEG_RAD,
                              .min_rad = endless ? -INFINITY : c->travel_min_deg[k] * BST_DEG_RAD,
                              .max_rad = endless ? INFINITY : c->travel_max_deg[k] * BST_DEG_RAD,
                              .restitution = c->stop_restitution};
    }
    BST_TRY(put_flexible(ctx, &c->flexible, dt_s, chain));
    BST_TRY(check_step(ctx, joints, dt_s));
    bst_mount_joints_init(joints, start);
    return BST_OK;
}
