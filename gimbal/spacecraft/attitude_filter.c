#include "gimbal/spacecraft/attitude_filter.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"
#include "sim/core/symmetric.h"

void bst_attitude_filter_init(bst_attitude_filter *filter, bst_quat q_body_from_gcrf,
                              double sigma_rad, double bias_sigma_radps, double angle_walk,
                              double rate_walk) {
    assert(filter && bst_is_unit_quat(q_body_from_gcrf, BST_UNIT_TOLERANCE));
    assert(bst_is_variance(sigma_rad) && bst_is_variance(bias_sigma_radps));
    *filter = (bst_attitude_filter){
        .q_body_from_gcrf = q_body_from_gcrf, .angle_walk = angle_walk, .rate_walk = rate_walk};
    for (int i = 0; i < 3; i++) {
        filter->covariance[i][i] = sigma_rad * sigma_rad;
        filter->covariance[3 + i][3 + i] = bias_sigma_radps * bias_sigma_radps;
    }
}

void bst_attitude_filter_archive(bst_attitude_filter *filter, bst_archive *archive) {
    BST_ARCHIVE(archive, filter->q_body_from_gcrf);
    BST_ARCHIVE(archive, filter->bias_radps);
    BST_ARCHIVE(archive, filter->covariance);
}

bst_vec3 bst_attitude_filter_error(bst_quat q, bst_quat estimate) {
    return bst_vec3_scale(bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(estimate))), -1.0);
}

void bst_attitude_filter_propagate(bst_attitude_filter *filter, bst_vec3 sample_rad, double dt_s) {
    assert(filter && bst_is_finite_vec3(sample_rad) && bst_is_positive(dt_s));
    bst_vec3 turn = bst_vec3_axpy(sample_rad, -dt_s, filter->bias_radps);
    bst_quat step = bst_quat_from_rotvec(bst_vec3_scale(turn, -1.0));
    filter->q_body_from_gcrf = bst_quat_unit(bst_quat_mul(step, filter->q_body_from_gcrf));

    /* blocks A (e, e), B (e, b), D (b, b): A' = C A C' - dt (C B + B' C') + dt^2 D + noise, B' = C
     * B - dt D + noise, D' = D + noise */
    const bst_mat3 c = bst_quat_to_mat3(step);
    double(*p)[6] = filter->covariance;
    double ca[3][3], cb[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            ca[i][j] = c.m[i][0] * p[0][j] + c.m[i][1] * p[1][j] + c.m[i][2] * p[2][j];
            cb[i][j] = c.m[i][0] * p[0][3 + j] + c.m[i][1] * p[1][3 + j] + c.m[i][2] * p[2][3 + j];
        }
    }
    double v2 = filter->angle_walk * filter->angle_walk;
    double u2 = filter->rate_walk * filter->rate_walk;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            double cac = ca[i][0] * c.m[j][0] + ca[i][1] * c.m[j][1] + ca[i][2] * c.m[j][2];
            p[i][j] = cac - dt_s * (cb[i][j] + cb[j][i]) + dt_s * dt_s * p[3 + i][3 + j];
            p[j][i] = p[i][j];
        }
        p[i][i] += v2 * dt_s + u2 * dt_s * dt_s * dt_s / 3.0;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            p[i][3 + j] = cb[i][j] - dt_s * p[3 + i][3 + j];
        }
        p[i][3 + i] -= 0.5 * u2 * dt_s * dt_s;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            p[3 + j][i] = p[i][3 + j];
        }
        p[3 + i][3 + i] += u2 * dt_s;
    }
}

/* Joseph form of the covariance update: P = (1 - K H) P (1 - K H)' + K R K', H = [1, age]. */
static void joseph(double p[6][6], const double k[6][3], double age_s, const bst_mat3 *r) {
    double left[6][6], half[6][6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            left[i][j] = (i == j ? 1.0 : 0.0) - k[i][j];
            left[i][3 + j] = (i == 3 + j ? 1.0 : 0.0) - age_s * k[i][j];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            half[i][j] = 0.0;
            for (int l = 0; l < 6; l++) {
                half[i][j] += left[i][l] * p[l][j];
            }
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int l = 0; l < 6; l++) {
                sum += half[i][l] * left[j][l];
            }
            for (int l = 0; l < 3; l++) {
                for (int m = 0; m < 3; m++) {
                    sum += k[i][l] * r->m[l][m] * k[j][m];
                }
            }
            p[i][j] = p[j][i] = sum;
        }
    }
}

void bst_attitude_filter_update(bst_attitude_filter *filter, bst_vec3 error, double age_s,
                                bst_quat q_now_from_then, const bst_mat3 *noise,
                                bst_vec3 correction[2]) {
    assert(filter && noise && bst_is_finite_vec3(error) && age_s >= 0.0);
    assert(bst_is_covariance(&noise->m[0][0], 3));
    double(*p)[6] = filter->covariance;
    /* in current axes, where e then = e now + age b */
    const bst_mat3 c = bst_quat_to_mat3(q_now_from_then), back = bst_mat3_transpose(&c);
    const bst_mat3 half = bst_mat3_mul(&c, noise), r = bst_mat3_mul(&half, &back);
    bst_vec3 e = bst_mat3_mul_vec(&c, error);
    double pht[6][3], s[9], inverse[9], k[6][3];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            pht[i][j] = p[i][j] + age_s * p[i][3 + j];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            s[3 * i + j] = pht[i][j] + age_s * pht[3 + i][j] + r.m[i][j];
        }
    }
    if (!bst_symmetric_invert(3, s, inverse)) {
        return; /* a noise-free measurement of an exactly known state carries no information */
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++) {
            k[i][j] =
                pht[i][0] * inverse[j] + pht[i][1] * inverse[3 + j] + pht[i][2] * inverse[6 + j];
        }
    }
    double x[6];
    for (int i = 0; i < 6; i++) {
        x[i] = k[i][0] * e.x + k[i][1] * e.y + k[i][2] * e.z;
    }
    bst_vec3 turn = {x[0], x[1], x[2]}, bias = {x[3], x[4], x[5]};
    filter->q_body_from_gcrf = bst_quat_unit(bst_quat_turn_frame(filter->q_body_from_gcrf, turn));
    filter->bias_radps = bst_vec3_add(filter->bias_radps, bias);
    joseph(p, (const double(*)[3])k, age_s, &r);
    if (correction) {
        correction[0] = turn;
        correction[1] = bias;
    }
}

bst_attitude_steady bst_attitude_steady_state(double angle_walk, double rate_walk, double noise_rad,
                                              double dt_s) {
    double su = rate_walk * dt_s * sqrt(dt_s) / noise_rad;
    double sv = angle_walk * sqrt(dt_s) / noise_rad;
    /* (z - 1/z)^2 = su (z + 1/z) + sv^2 - su^2 / 6, the larger root z */
    double y = 0.5 * su + sqrt(4.0 + sv * sv + su * su / 12.0);
    double z = 0.5 * y + sqrt(0.25 * y * y - 1.0);
    double bias =
        rate_walk * noise_rad / sqrt(dt_s) * (z - 1.0 / z) - 0.5 * rate_walk * rate_walk * dt_s;
    return (bst_attitude_steady){noise_rad * sqrt(z * z - 1.0),
                                 noise_rad * sqrt(1.0 - 1.0 / (z * z)), sqrt(bias)};
}
