#include "sim/eval/track_bound.h"

#include <math.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/core/symmetric.h"

bool bst_track_bound_start(bst_track_bound *bound, const double r1[3], const double r2[3],
                           double dt_s, double noise_rad2ps3) {
    double p[4][4];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double a = r1[i + j], b = r2[i + j];
            p[i][j] = b;
            p[i][j + 2] = p[j + 2][i] = b / dt_s;
            p[i + 2][j + 2] = (a + b) / (dt_s * dt_s) + (i == j ? noise_rad2ps3 * dt_s / 3.0 : 0.0);
        }
    }
    return bst_symmetric_invert(4, p[0], bound->information[0]);
}

bool bst_track_bound_step(bst_track_bound *bound, double dt_s, double rate_radps,
                          double noise_rad2ps3, const double r[3], double factor) {
    double angle = rate_radps * dt_s;
    double sinc = fabs(angle) > 1e-4 ? sin(angle) / angle : 1.0 - angle * angle / 6.0;
    const double f[4][4] = {{1, 0, dt_s, 0},
                            {0, cos(angle), 0, dt_s * sinc},
                            {0, 0, 1, 0},
                            {0, -rate_radps * sin(angle), 0, cos(angle)}};
    double p[4][4], t[4][4], moved[4][4];
    if (!bst_symmetric_invert(4, bound->information[0], p[0])) {
        return false;
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            t[i][j] = 0.0;
            for (int k = 0; k < 4; k++) {
                t[i][j] += f[i][k] * p[k][j];
            }
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            moved[i][j] = 0.0;
            for (int k = 0; k < 4; k++) {
                moved[i][j] += t[i][k] * f[j][k];
            }
        }
    }
    for (int i = 0; i < 2; i++) {
        moved[i][i] += noise_rad2ps3 * dt_s * dt_s * dt_s / 3.0;
        moved[i][i + 2] += noise_rad2ps3 * dt_s * dt_s / 2.0;
        moved[i + 2][i] += noise_rad2ps3 * dt_s * dt_s / 2.0;
        moved[i + 2][i + 2] += noise_rad2ps3 * dt_s;
    }
    double det = r[0] * r[2] - r[1] * r[1];
    if (!(det > 0.0) || !bst_symmetric_invert(4, moved[0], bound->information[0])) {
        return false;
    }
    bound->information[0][0] += factor * r[2] / det;
    bound->information[0][1] -= factor * r[1] / det;
    bound->information[1][0] -= factor * r[1] / det;
    bound->information[1][1] += factor * r[0] / det;
    return true;
}

bool bst_track_bound_covariance(const bst_track_bound *bound, double covariance[4][4]) {
    return bst_symmetric_invert(4, bound->information[0], covariance[0]);
}

/* Half width, in sigma, of the square around the true position in which false alarms are drawn;
 * those beyond contribute less than exp(-18). */
#define REACH 6.0
#define DRAWS 200000

double bst_eval_information_factor(double pd, double density) {
    if (!(density > 0.0)) {
        return pd;
    }
    bst_rng_key key = bst_rng_make_key(0, 0, "track_bound", "information_factor");
    double mean = density * 4.0 * REACH * REACH, ratio = pd / (2.0 * BST_PI * density);
    double sum = 0.0;
    for (uint64_t i = 0; i < DRAWS; i++) {
        uint64_t draw = 0;
        double weight = 1.0 - pd, score[2] = {0.0, 0.0};
        if (bst_rng_uniform(key, i, draw++) < pd) {
            double n[2];
            bst_rng_normal2(key, i, draw++, n);
            double w = ratio * exp(-0.5 * (n[0] * n[0] + n[1] * n[1]));
            weight += w;
            score[0] += w * n[0];
            score[1] += w * n[1];
        }
        /* gaps between false alarms in a Poisson sequence of length `mean` */
        for (double t = -log(bst_rng_uniform(key, i, draw++)); t < mean;
             t -= log(bst_rng_uniform(key, i, draw++))) {
            double x = REACH * (2.0 * bst_rng_uniform(key, i, draw++) - 1.0);
            double y = REACH * (2.0 * bst_rng_uniform(key, i, draw++) - 1.0);
            double w = ratio * exp(-0.5 * (x * x + y * y));
            weight += w;
            score[0] += w * x;
            score[1] += w * y;
        }
        if (weight > 0.0) {
            sum += (score[0] * score[0] + score[1] * score[1]) / (weight * weight);
        }
    }
    return 0.5 * sum / DRAWS;
}
