#include "gimbal/spacecraft/attitude_warm_up.h"

#define MOST_STEPS 5000.0

void bst_attitude_warm_up(const bst_attitude_past *past, bst_attitude_filter *filter) {
    double fastest_hz = 1.0;
    for (int i = 0; i < past->trackers; i++) {
        fastest_hz = fmax(fastest_hz, past->rate_hz[i]);
    }
    double dt = fmax(1.0 / fastest_hz, past->seconds / MOST_STEPS);
    int64_t steps = (int64_t)ceil(past->seconds / dt);
    bst_spacecraft_gyro gyro = *past->gyro;
    gyro.dt_s = dt;
    gyro.samples = 0;
    gyro.key = past->key;
    bst_spacecraft_star_tracker tracker[BST_TRACKERS_MOST];
    bst_mat3 noise[BST_TRACKERS_MOST];
    int64_t every[BST_TRACKERS_MOST];
    for (int i = 0; i < past->trackers; i++) {
        double measurements = past->rate_hz[i] * dt;
        every[i] = (int64_t)fmax(round(1.0 / measurements), 1.0);
        double averaged = sqrt(fmax(measurements * (double)every[i], 1.0));
        tracker[i] = *past->tracker[i];
        tracker[i].sigma_rad[0] /= averaged;
        tracker[i].sigma_rad[1] /= averaged;
        tracker[i].key.k[0] ^= past->key.k[0]; /* independent of the noise after the epoch */
        noise[i] = bst_spacecraft_star_tracker_covariance(&tracker[i]);
    }

    bst_vec3 turn = bst_vec3_scale(past->rate_radps, dt);
    bst_quat q = past->q_body_from_gcrf; /* only relative attitudes matter */
    for (int64_t n = 1; n <= steps; n++) {
        q = bst_quat_unit(bst_quat_turn_frame(q, turn));
        bst_attitude_filter_propagate(filter, bst_spacecraft_gyro_measure(&gyro, turn), dt);
        for (int i = 0; i < past->trackers; i++) {
            if (n % every[i] == 0) {
                bst_quat measured = bst_spacecraft_star_tracker_measure(&tracker[i], n, q);
                bst_attitude_filter_update(
                    filter, bst_attitude_filter_error(measured, filter->q_body_from_gcrf), 0.0,
                    BST_QUAT_IDENTITY, &noise[i], NULL);
            }
        }
    }
    /* convert to attitude and gyro bias at the epoch */
    bst_vec3 error = bst_attitude_filter_error(q, filter->q_body_from_gcrf);
    filter->q_body_from_gcrf =
        bst_quat_unit(bst_quat_turn_frame(past->q_body_from_gcrf, bst_vec3_scale(error, -1.0)));
    filter->bias_radps =
        bst_vec3_add(filter->bias_radps, bst_vec3_sub(past->gyro->bias_radps, gyro.bias_radps));
}
