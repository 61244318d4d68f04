#include "gimbal/mount/mount_response.h"

#include <string.h>

#define DEFAULT_CROSSOVER_HZ 10.0

static void multiply(double a[5][5], double b[5][5], double out[5][5]) {
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            double sum = 0.0;
            for (int m = 0; m < 5; m++) {
                sum += a[i][m] * b[m][k];
            }
            out[i][k] = sum;
        }
    }
}

/* Matrix exponential: Taylor series of a / 2^s, squared s times. */
static void exponential(double a[5][5], double out[5][5]) {
    double norm = 0.0, scaled[5][5], term[5][5], next[5][5];
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            norm = fmax(norm, fabs(a[i][k]));
        }
    }
    int squarings = norm > 0.0 ? (int)fmax(ceil(log2(norm)) + 6.0, 0.0) : 0;
    double scale = ldexp(1.0, -squarings);
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            scaled[i][k] = scale * a[i][k];
            term[i][k] = out[i][k] = i == k ? 1.0 : 0.0;
        }
    }
    for (int order = 1; order <= 10; order++) { /* 5 * 2^-6: the next term is below 1e-19 */
        multiply(term, scaled, next);
        for (int i = 0; i < 5; i++) {
            for (int k = 0; k < 5; k++) {
                term[i][k] = next[i][k] / order;
                out[i][k] += term[i][k];
            }
        }
    }
    for (int s = 0; s < squarings; s++) {
        multiply(out, out, next);
        memcpy(out, next, sizeof next);
    }
}

void bst_mount_linearise(const bst_mount_joints *joints, int axis,
                         const double angle_rad[BST_CHAIN_MOST], double dt_s, int delay_steps,
                         double line_of_sight_fraction, bst_mount_linear *out) {
    const bst_mount_chain *chain = &joints->chain;
    const bst_mount_joint *joint = &joints->joint[axis];
    double s[BST_CHAIN_MOST], c[BST_CHAIN_MOST];
    for (int k = 0; k < BST_CHAIN_MOST; k++) {
        s[k] = sin(angle_rad[k]);
        c[k] = cos(angle_rad[k]);
    }
    bst_mount_chain_state still = {{0.0}, {0.0}, {0.0}, {0.0}};
    bst_mount_chain_base base = {{0, 0, 0}, {0, 0, 0}};
    bst_mount_chain_equations eq;
    bst_mount_chain_equations_at(chain, &still, s, c, &base, &eq);
    double flex = chain->flex_inertia[axis];
    double own = eq.mass[axis][axis]; /* without the masses on its springs */
    double all = own + flex;
    *out = (bst_mount_linear){.inertia_kgm2 = all,
                              .dt_s = dt_s,
                              .delay_steps = delay_steps,
                              .line_of_sight_fraction = line_of_sight_fraction};
    double k = chain->flex_stiffness[axis], d = chain->flex_damping[axis];
    double a[5][5] = {{0, 1, 0, 0, 0},
                      {-joint->spring_nm / own, -joint->viscous_nms / own, k / own, d / own,
                       all / own}, /* input: all * u */
                      {0, 0, 0, 1, 0},
                      {0, 0, 0, 0, 0},
                      {0, 0, 0, 0, 0}};
    if (flex > 0.0) {
        for (int i = 0; i < 5; i++) {
            a[3][i] = -a[1][i];
        }
        a[3][2] -= k / flex;
        a[3][3] -= d / flex;
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 5; j++) {
            a[i][j] *= dt_s;
        }
    }
    double e[5][5];
    exponential(a, e);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            out->step[i][j] = e[i][j];
        }
        out->drive[i] = e[i][4];
    }
}

/* State response to a unit input at omega, without the delay: (z - step)^-1 drive. */
static void driven(const bst_mount_linear *linear, double omega_radps, double complex x[4]) {
    double complex z = cexp(I * omega_radps * linear->dt_s), a[4][5];
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            a[i][k] = (i == k ? z : 0.0) - linear->step[i][k];
        }
        a[i][4] = linear->drive[i];
    }
    for (int i = 0; i < 4; i++) {
        int pivot = i;
        for (int r = i + 1; r < 4; r++) {
            pivot = cabs(a[r][i]) > cabs(a[pivot][i]) ? r : pivot;
        }
        for (int k = 0; k < 5; k++) {
            double complex t = a[i][k];
            a[i][k] = a[pivot][k];
            a[pivot][k] = t;
        }
        for (int r = i + 1; r < 4; r++) {
            double complex f = a[r][i] / a[i][i];
            for (int k = i; k < 5; k++) {
                a[r][k] -= f * a[i][k];
            }
        }
    }
    for (int i = 3; i >= 0; i--) {
        x[i] = a[i][4];
        for (int k = i + 1; k < 4; k++) {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
}

/* Phase factor of the delay at omega. */
static double complex late(const bst_mount_linear *linear, double omega_radps) {
    return cexp(-I * omega_radps * linear->dt_s * linear->delay_steps);
}

double complex bst_mount_linear_encoder(const bst_mount_linear *linear, double omega_radps) {
    double complex x[4];
    driven(linear, omega_radps, x);
    return x[0] * late(linear, omega_radps);
}

double complex bst_mount_linear_sight(const bst_mount_linear *linear, double omega_radps) {
    double complex x[4];
    driven(linear, omega_radps, x);
    return (x[0] + linear->line_of_sight_fraction * x[2]) * late(linear, omega_radps);
}

static double complex plant_of(const void *user, double omega_radps) {
    return bst_mount_linear_encoder(user, omega_radps);
}

bst_status bst_mount_servo_compensator(bst_ctx *ctx, const bst_mount_servo_config *config,
                                       const bst_mount_linear *linear, bst_compensator *out) {
    bst_compensator_config c = config->compensator;
    bool given = c.bandwidth_hz > 0.0 || c.crossover_hz > 0.0 || c.proportional > 0.0 ||
                 c.integral_per_s > 0.0 || c.derivative_s > 0.0 || c.gain > 0.0;
    if (!given) {
        c.crossover_hz = DEFAULT_CROSSOVER_HZ;
    }
    bst_status status = bst_compensator_init(ctx, out, &c, linear->dt_s, plant_of, linear);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "servo/compensator");
}

bst_status bst_mount_axis_model_init(bst_ctx *ctx, int type, const bst_mount_config *config,
                                     const double angle_rad[BST_CHAIN_MOST], double dt_s, int axis,
                                     bst_mount_axis_model *out) {
    bst_mount_joints joints;
    BST_TRY(bst_mount_config_joints(ctx, type, config, dt_s, &joints));
    if (axis < 0 || axis >= joints.chain.stages) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a mount of %d axes has no axis %d",
                        joints.chain.stages, axis);
    }
    bst_mount_linearise(&joints, axis, angle_rad, dt_s, (int)config->servo.delay_steps,
                        config->flexible.line_of_sight_fraction[axis], &out->linear);
    out->reference_feed_forward = config->servo.compensator.feed_forward;
    out->model_feed_forward = config->servo.model_feed_forward;
    out->viscous_nms = joints.joint[axis].viscous_nms;
    out->spring_nm = joints.joint[axis].spring_nm;
    return bst_mount_servo_compensator(ctx, &config->servo, &out->linear, &out->compensator);
}

void bst_mount_axis_response(const bst_mount_axis_model *model, double frequency_hz,
                             bst_mount_axis_gains *out) {
    const bst_mount_linear *linear = &model->linear;
    double omega = 2.0 * BST_PI * frequency_hz, dt = linear->dt_s, inertia = linear->inertia_kgm2;
    double complex encoder = bst_mount_linear_encoder(linear, omega);
    double complex sight = bst_mount_linear_sight(linear, omega);
    double complex c = bst_compensator_response(&model->compensator, omega);
    double complex back = late(linear, omega), ahead = 1.0 / back, z = cexp(I * omega * dt);
    double complex closed = 1.0 / (1.0 + c * encoder);
    out->plant = encoder / inertia;
    out->compensator = c * inertia;
    out->disturbance = sight * ahead / inertia * closed;
    out->encoder_noise = -sight * c * closed;
    /* The reference r has constant acceleration over a step. That of the step in which the torque
     * acts is fed forward, and its rate and angle against viscous friction and cable. */
    double complex rate = (z - 1.0) * 2.0 / (dt * (z + 1.0)), accel = (z - 1.0) / dt * rate;
    double complex fed =
        model->reference_feed_forward * accel +
        model->model_feed_forward * (model->viscous_nms * rate + model->spring_nm) / inertia;
    out->command = sight * (c + fed * ahead) * closed;
}
