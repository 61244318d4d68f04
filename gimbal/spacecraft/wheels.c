#include "gimbal/spacecraft/wheels.h"

#define RPM_RADPS (BST_PI / 30.0)

#define C bst_wheel_config
const bst_config_desc bst_wheel_config_table[] = {
    BST_REALS(C, axis, "", -1e6, 1e6, NULL, "Spin axis in body axes, any length."),
    BST_REAL(C, inertia_kgm2, "kg m^2", 1e-9, 1e6, "0.001", "Moment of inertia about the axis."),
    BST_REAL(C, torque_limit_nm, "N m", 0, 1e6, "0.05", "Greatest torque of the motor."),
    BST_REAL(C, speed_limit_rpm, "1/min", 1e-3, 1e6, "6000",
             "Greatest speed: times the inertia, the momentum at which the wheel is saturated."),
    BST_REAL(C, speed_rpm, "1/min", -1e6, 1e6, "0", "Speed at the epoch."),
    BST_REAL(C, coulomb_nm, "N m", 0, 1e3, "0", "Friction that does not depend on speed."),
    BST_REAL(C, viscous_nms, "N m s", 0, 1e3, "0", "Friction torque per rad/s."),
    BST_REAL(C, static_imbalance_kgm, "kg m", 0, 1e3, "0",
             "Mass times its distance from the axis."),
    BST_REAL(C, dynamic_imbalance_kgm2, "kg m^2", 0, 1e3, "0", "Product of inertia."),
    BST_REALS(C, position_m, "m", -100, 100, "[0, 0, 0]",
              "Place of the wheel from the centre of mass, body axes: lever of the force of its "
              "static imbalance."),
    BST_BOOL(C, failed, "false", "The motor gives no torque; friction and imbalance remain."),
    BST_CONFIG_END};
#undef C

bst_status bst_wheels_init(bst_ctx *ctx, bst_wheels *wheels, const bst_wheel_config *config,
                           int count, bst_rng_key key) {
    *wheels = (bst_wheels){.count = count};
    for (int i = 0; i < count; i++) {
        const bst_wheel_config *c = &config[i];
        bst_vec3 axis = bst_vec3_from_array(c->axis);
        if (!(bst_vec3_norm(axis) > 0.0)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "wheels/%d/axis: a direction of length zero (allowed: any other)", i);
        }
        axis = bst_vec3_unit(axis);
        bst_vec3 x = bst_vec3_perpendicular(axis);
        if (fabs(c->speed_rpm) > c->speed_limit_rpm) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "wheels/%d/speed_rpm: %g is beyond the wheel's speed_limit_rpm of %g",
                            i, c->speed_rpm, c->speed_limit_rpm);
        }
        wheels->wheel[i] =
            (bst_wheel){.axis = axis,
                        .position_m = bst_vec3_from_array(c->position_m),
                        .across = {x, bst_vec3_cross(axis, x)},
                        .inertia_kgm2 = c->inertia_kgm2,
                        .torque_limit_nm = c->failed ? 0.0 : c->torque_limit_nm,
                        .speed_limit_radps = c->speed_limit_rpm * RPM_RADPS,
                        .start_radps = c->speed_rpm * RPM_RADPS,
                        .coulomb_nm = c->coulomb_nm,
                        .viscous_nms = c->viscous_nms,
                        .static_kgm = c->static_imbalance_kgm,
                        .dynamic_kgm2 = c->dynamic_imbalance_kgm2,
                        .phase0_rad = 2.0 * BST_PI * bst_rng_uniform(key, (uint64_t)i, 0)};
    }
    return BST_OK;
}

/* Share of a direction below which the wheels count as not spanning it. */
#define REACH 1e-6

/* Solves sum a a' x = torque over the wheels in use; components outside their span are omitted.
 * Returns true if they span all axes. */
static bool solve(const bst_wheels *wheels, const bool *used, bst_vec3 torque, bst_vec3 *x) {
    double g[9] = {0};
    for (int i = 0; i < wheels->count; i++) {
        if (used[i]) {
            bst_vec3 a = wheels->wheel[i].axis;
            double v[3] = {a.x, a.y, a.z};
            for (int r = 0; r < 3; r++) {
                for (int c = 0; c < 3; c++) {
                    g[3 * r + c] += v[r] * v[c];
                }
            }
        }
    }
    double value[3], vector[9];
    bst_dynamics_symmetric_eigen(3, g, value, vector);
    bool all = true;
    *x = (bst_vec3){0, 0, 0};
    for (int k = 0; k < 3; k++) {
        if (value[k] > REACH) {
            bst_vec3 v = {vector[k], vector[3 + k], vector[6 + k]};
            *x = bst_vec3_axpy(*x, bst_vec3_dot(v, torque) / value[k], v);
        } else {
            all = false;
        }
    }
    return all;
}

unsigned bst_wheels_share(const bst_wheels *wheels, const double *speed_radps, bst_vec3 torque_nm,
                          double *motor_nm) {
    bool used[BST_WHEELS_MOST];
    for (int i = 0; i < wheels->count; i++) {
        used[i] = wheels->wheel[i].torque_limit_nm > 0.0;
    }
    unsigned flags = 0;
    bool again = true;
    while (again) {
        bst_vec3 x;
        flags &= ~(unsigned)BST_WHEELS_SHORT;
        flags |= solve(wheels, used, torque_nm, &x) ? 0u : BST_WHEELS_SHORT;
        again = false;
        for (int i = 0; i < wheels->count; i++) {
            const bst_wheel *w = &wheels->wheel[i];
            motor_nm[i] = used[i] ? -bst_vec3_dot(w->axis, x) : 0.0;
            if (used[i] && fabs(speed_radps[i]) >= w->speed_limit_radps &&
                motor_nm[i] * speed_radps[i] > 0.0) {
                used[i] = false;
                again = true;
                flags |= BST_WHEELS_MOMENTUM_LIMIT;
            }
        }
    }
    double scale = 1.0;
    for (int i = 0; i < wheels->count; i++) {
        double limit = wheels->wheel[i].torque_limit_nm;
        if (fabs(motor_nm[i]) * scale > limit) {
            scale = limit / fabs(motor_nm[i]);
            flags |= BST_WHEELS_TORQUE_LIMIT;
        }
    }
    for (int i = 0; i < wheels->count; i++) {
        motor_nm[i] *= scale;
    }
    return flags;
}

double bst_wheel_torque(const bst_wheel *wheel, double speed_radps, double motor_nm,
                        double load_kgm2, double dt_s) {
    if (fabs(speed_radps) >= wheel->speed_limit_radps && motor_nm * speed_radps > 0.0) {
        motor_nm = 0.0;
    }
    double torque = motor_nm - wheel->viscous_nms * speed_radps;
    if (wheel->coulomb_nm > 0.0) {
        /* torque that stops the wheel within the step, if friction suffices */
        double stop = torque + speed_radps * load_kgm2 / dt_s;
        torque -= fmax(-wheel->coulomb_nm, fmin(wheel->coulomb_nm, stop));
    }
    return torque;
}

void bst_wheel_imbalance(const bst_wheel *wheel, double phase_rad, double speed_radps,
                         bst_vec3 *torque_nm) {
    double s = sin(phase_rad), c = cos(phase_rad), square = speed_radps * speed_radps;
    bst_vec3 radial = bst_vec3_axpy(bst_vec3_scale(wheel->across[0], c), s, wheel->across[1]);
    bst_vec3 tangent = bst_vec3_axpy(bst_vec3_scale(wheel->across[0], -s), c, wheel->across[1]);
    bst_vec3 force = bst_vec3_scale(radial, wheel->static_kgm * square);
    *torque_nm = bst_vec3_add(*torque_nm, bst_vec3_cross(wheel->position_m, force));
    *torque_nm = bst_vec3_axpy(*torque_nm, wheel->dynamic_kgm2 * square, tangent);
}

static double amplitude(double a, double b) {
    return sqrt(a * a + b * b);
}

bst_vec3 bst_wheel_imbalance_amplitude(const bst_wheel *wheel, double speed_radps) {
    /* the torque is cos A + sin B with these two */
    bst_vec3 zero = {0, 0, 0}, a = zero, b = zero;
    bst_wheel_imbalance(wheel, 0.0, speed_radps, &a);
    bst_wheel_imbalance(wheel, 0.5 * BST_PI, speed_radps, &b);
    return (bst_vec3){amplitude(a.x, b.x), amplitude(a.y, b.y), amplitude(a.z, b.z)};
}
