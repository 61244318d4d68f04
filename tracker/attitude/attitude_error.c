#include "tracker/attitude/attitude_error.h"

#include <string.h>

#include "sim/core/symmetric.h"

void bst_attitude_error_predict(bst_attitude_error *filter, const bst_attitude_error_params *params,
                                double dt_s) {
    if (!filter->started) {
        return;
    }
    double(*p)[6] = filter->p;
    double q = params->noise_rad2ps3;
    for (int i = 0; i < 3; i++) {
        filter->e[i] += dt_s * filter->e[i + 3];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 6; j++) {
            p[i][j] += dt_s * p[i + 3][j];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            p[i][j] += dt_s * p[i][j + 3];
        }
    }
    for (int i = 0; i < 3; i++) {
        p[i][i] += q * dt_s * dt_s * dt_s / 3.0;
        p[i][i + 3] += q * dt_s * dt_s / 2.0;
        p[i + 3][i] += q * dt_s * dt_s / 2.0;
        p[i + 3][i + 3] += q * dt_s;
    }
}

/* Rotates a 3 x 3 covariance: out = m a m^T. */
static void rotate_covariance(const bst_mat3 *m, const double a[3][3], double out[3][3]) {
    bst_mat3 b;
    memcpy(b.m, a, sizeof b.m);
    bst_mat3 t = bst_mat3_transpose(m), left = bst_mat3_mul(m, &b), all = bst_mat3_mul(&left, &t);
    memcpy(out, all.m, sizeof all.m);
}

/* Initialises the attitude error filter with the first fix. */
static void start_filter(bst_attitude_error *filter, const bst_attitude_error_params *params,
                         const double z[3], const double r[3][3]) {
    memset(filter, 0, sizeof *filter);
    filter->started = true;
    filter->fixes = 1;
    for (int i = 0; i < 3; i++) {
        filter->e[i] = z[i];
        for (int j = 0; j < 3; j++) {
            filter->p[i][j] = r[i][j];
        }
        filter->p[i + 3][i + 3] = params->rate_sigma_radps * params->rate_sigma_radps;
    }
}

bool bst_attitude_error_update(bst_attitude_error *filter, const bst_attitude_error_params *params,
                               bst_quat q_telemetry_from_gcrf, bst_vec3 e_cam_rad,
                               const double covariance_cam[3][3]) {
    bst_mat3 gcrf_from_cam = bst_quat_to_mat3(bst_quat_conj(q_telemetry_from_gcrf));
    bst_vec3 e = bst_mat3_mul_vec(&gcrf_from_cam, e_cam_rad);
    double z[3] = {e.x, e.y, e.z}, r[3][3], s[3][3], inverse[3][3];
    rotate_covariance(&gcrf_from_cam, covariance_cam, r);
    for (int i = 0; i < 3; i++) {
        r[i][i] += params->jitter_rad * params->jitter_rad;
    }
    if (!filter->started) {
        start_filter(filter, params, z, r);
        return true;
    }
    double(*p)[6] = filter->p, nu[3], chi2 = 0.0;
    for (int i = 0; i < 3; i++) {
        nu[i] = z[i] - filter->e[i];
        for (int j = 0; j < 3; j++) {
            s[i][j] = p[i][j] + r[i][j];
        }
    }
    bool invertible = bst_symmetric_invert(3, s[0], inverse[0]);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            chi2 += invertible ? nu[i] * inverse[i][j] * nu[j] : 0.0;
        }
    }
    if (!invertible || chi2 > params->gate_chi2) {
        /* after two fixes error and rate are barely determined: a contradicting fix is as likely to
         * be right */
        int patience = filter->fixes - 1;
        patience = patience < 1 ? 1 : patience;
        patience = patience < params->gate_patience ? patience : params->gate_patience;
        if (++filter->rejected_in_row >= patience) {
            start_filter(filter, params, z, r);
            return true;
        }
        return false;
    }
    filter->rejected_in_row = 0;
    filter->fixes += filter->fixes <= params->gate_patience;
    double k[6][3], a[6][6] = {{0}}, t[6][6];
    for (int i = 0; i < 6; i++) {
        a[i][i] = 1.0;
        for (int j = 0; j < 3; j++) {
            k[i][j] = p[i][0] * inverse[0][j] + p[i][1] * inverse[1][j] + p[i][2] * inverse[2][j];
            a[i][j] -= k[i][j];
            filter->e[i] += k[i][j] * nu[j];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            t[i][j] = 0.0;
            for (int m = 0; m < 6; m++) {
                t[i][j] += a[i][m] * p[m][j];
            }
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = i; j < 6; j++) {
            double v = 0.0;
            for (int m = 0; m < 6; m++) {
                v += t[i][m] * a[j][m];
            }
            for (int m = 0; m < 3; m++) {
                v += k[i][m] * (r[m][0] * k[j][0] + r[m][1] * k[j][1] + r[m][2] * k[j][2]);
            }
            p[i][j] = p[j][i] = v;
        }
    }
    return true;
}

void bst_attitude_error_get(const bst_attitude_error *filter,
                            const bst_attitude_error_params *params, bst_quat q_telemetry_from_gcrf,
                            bst_vec3 *e_cam_rad, bst_vec3 *rate_cam_radps,
                            double covariance_cam[3][3]) {
    bst_mat3 cam_from_gcrf = bst_quat_to_mat3(q_telemetry_from_gcrf);
    const double *e = filter->e;
    *e_cam_rad = bst_mat3_mul_vec(&cam_from_gcrf, (bst_vec3){e[0], e[1], e[2]});
    *rate_cam_radps = bst_mat3_mul_vec(&cam_from_gcrf, (bst_vec3){e[3], e[4], e[5]});
    if (!covariance_cam) {
        return;
    }
    double p[3][3] = {{0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3 && filter->started; j++) {
            p[i][j] = filter->p[i][j];
        }
        p[i][i] += params->jitter_rad * params->jitter_rad;
        if (!filter->started) {
            p[i][i] += params->telemetry_sigma_rad * params->telemetry_sigma_rad;
        }
    }
    rotate_covariance(&cam_from_gcrf, p, covariance_cam);
}
