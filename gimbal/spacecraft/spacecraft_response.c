#include "gimbal/spacecraft/spacecraft_response.h"

#include <complex.h>

typedef double complex cplx;

static void put(double out[2], cplx z) {
    out[0] = creal(z);
    out[1] = cimag(z);
}

/* Element (axis, axis) of the inverse of s^2 (I - sum J a a' - sum d d' s^2 / (s^2 + c s + k)). */
static cplx plant_at(const bst_spacecraft_config *config, int axis, double w) {
    cplx s = I * w, m[3][3];
    bst_mat3 inertia = bst_spacecraft_inertia_matrix(config->inertia_kgm2);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m[i][j] = inertia.m[i][j];
        }
    }
    int count;
    const bst_wheel_config *wheels = bst_spacecraft_wheels(config, &count);
    for (int k = 0; k < count; k++) {
        const double *a = wheels[k].axis;
        double share = wheels[k].inertia_kgm2 / (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                m[i][j] -= share * a[i] * a[j];
            }
        }
    }
    const bst_spacecraft_mode_config *modes = config->modes.items;
    for (int k = 0; k < config->modes.count; k++) {
        const double *d = modes[k].coupling;
        double f = 2.0 * BST_PI * modes[k].frequency_hz;
        cplx gain = s * s / (s * s + 2.0 * modes[k].damping * f * s + f * f);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                m[i][j] -= gain * d[i] * d[j];
            }
        }
    }
    int b = (axis + 1) % 3, c = (axis + 2) % 3;
    cplx minor = m[b][b] * m[c][c] - m[b][c] * m[c][b];
    cplx determinant = 0.0;
    for (int j = 0; j < 3; j++) {
        int p = (j + 1) % 3, q = (j + 2) % 3;
        determinant += m[0][j] * (m[1][p] * m[2][q] - m[1][q] * m[2][p]);
    }
    return minor / determinant / (s * s);
}

/* Mean of a delay over a hold: (1 - exp(-s t)) / (s t). */
static cplx mean_over(cplx s, double t) {
    cplx x = s * t;
    return cabs(x) < 1e-6 ? 1.0 - 0.5 * x : (1.0 - cexp(-x)) / x;
}

/* Controller response to an attitude error, N m per rad, and to a rate error, N m per rad/s. */
typedef struct law {
    cplx attitude, rate;
} law;

static law law_at(const bst_spacecraft_config *config, int axis, double w) {
    if (config->attitude.law == BST_LAW_FREE) {
        return (law){0.0, 0.0};
    }
    bst_spacecraft_attitude_control_spec spec = bst_spacecraft_attitude_control_of(config);
    cplx s = I * w, z = cexp(s * spec.dt_s);
    double wn = spec.natural_radps;
    /* the newest error is included */
    cplx integral = spec.integral_radps * spec.dt_s * z / (z - 1.0);
    double rate_s = fmax(spec.dt_s, 1.0 / config->gyro.rate_hz);
    cplx held = spec.inertia_kgm2.m[axis][axis] * mean_over(s, spec.dt_s);
    return (law){held * wn * wn * (1.0 + integral),
                 held * 2.0 * spec.damping * wn * mean_over(s, rate_s)};
}

bst_spacecraft_response bst_spacecraft_response_at(const bst_spacecraft_config *config, int axis,
                                                   double frequency_hz) {
    double w = 2.0 * BST_PI * frequency_hz;
    law l = law_at(config, axis, w);
    cplx plant = plant_at(config, axis, w), controller = l.attitude + I * w * l.rate;
    cplx loop = plant * controller;
    bst_spacecraft_response out;
    put(out.plant, plant);
    put(out.controller, controller);
    put(out.closed, loop / (1.0 + loop));
    put(out.compliance, plant / (1.0 + loop));
    return out;
}

static double square(cplx z) {
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

bst_spacecraft_noise bst_spacecraft_noise_at(const bst_spacecraft_config *config, int axis,
                                             double frequency_hz) {
    double w = 2.0 * BST_PI * frequency_hz;
    int count;
    const bst_spacecraft_star_tracker_config *first = bst_spacecraft_trackers(config, &count);
    bst_spacecraft_star_tracker tracker;
    bst_spacecraft_gyro gyro;
    bst_spacecraft_star_tracker_init(&tracker, first, (bst_rng_key){{0, 0}});
    bst_spacecraft_gyro_init(&gyro, &config->gyro, 1.0 / config->gyro.rate_hz,
                             (bst_rng_key){{0, 0}});
    double r = bst_spacecraft_star_tracker_covariance(&tracker).m[axis][axis] / first->rate_hz;
    double v = gyro.angle_walk, u = gyro.rate_walk;
    double k1 = sqrt(v * v / r + 2.0 * u / sqrt(r)), k2 = u / sqrt(r);
    cplx s = I * w, denominator = s * s + k1 * s + k2;
    const cplx error[3] = {(k1 * s + k2) / denominator, s / denominator, 1.0 / denominator};
    const double density[3] = {2.0 * r, 2.0 * v * v, 2.0 * u * u};
    law l = law_at(config, axis, w);
    cplx plant = plant_at(config, axis, w);
    cplx compliance = plant / (1.0 + plant * (l.attitude + s * l.rate));
    bst_spacecraft_noise out = {0.0, 0.0};
    for (int i = 0; i < 3; i++) {
        cplx rate = (s + k1) * error[i] - (i == 0 ? k1 : 0.0);
        out.knowledge += density[i] * square(error[i]);
        out.pointing += density[i] * square(compliance * (l.attitude * error[i] + l.rate * rate));
    }
    return out;
}

void bst_spacecraft_imbalance_line(const bst_spacecraft_config *config, int wheel, int axis,
                                   double *frequency_hz, double *amplitude_rad) {
    int count;
    const bst_wheel_config *c = &bst_spacecraft_wheels(config, &count)[wheel];
    bst_vec3 spin = bst_vec3_unit((bst_vec3){c->axis[0], c->axis[1], c->axis[2]});
    bst_vec3 x = bst_vec3_perpendicular(spin);
    bst_wheel w = {.axis = spin,
                   .position_m = {c->position_m[0], c->position_m[1], c->position_m[2]},
                   .across = {x, bst_vec3_cross(spin, x)},
                   .static_kgm = c->static_imbalance_kgm,
                   .dynamic_kgm2 = c->dynamic_imbalance_kgm2};
    double speed = fabs(c->speed_rpm) * BST_PI / 30.0;
    bst_vec3 torque = bst_wheel_imbalance_amplitude(&w, speed);
    double about = axis == 0 ? torque.x : axis == 1 ? torque.y : torque.z;
    *frequency_hz = speed / (2.0 * BST_PI);
    *amplitude_rad = 0.0;
    if (speed > 0.0 && about > 0.0) {
        bst_spacecraft_response response = bst_spacecraft_response_at(config, axis, *frequency_hz);
        *amplitude_rad = about * hypot(response.compliance[0], response.compliance[1]);
    }
}
