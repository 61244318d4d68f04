/* An object's filter: its first covariance, process noise, root of a covariance, errors
 * against it. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/cholesky.h"
#include "tracker/orbit/custody.h"

enum { N = BST_CUSTODY_STATE };

void bst_custody_filter_init(const bst_custody_config *config, const bst_custody_orbit *orbit,
                             const double normals[N], bst_custody_filter *out) {
    assert(config && orbit && out && config->sigma_m > 0.0 && config->drift_m_per_day > 0.0);
    *out = (bst_custody_filter){.noise_until_s = 0.0};
    /* the error along the orbit has grown since the epoch of the elements by that of the drift */
    const double age = orbit->epoch_offset_s / BST_DAY_S;
    const double s = config->sigma_m, drift = config->drift_m_per_day;
    for (int i = 0; i < N; i++) {
        out->p[i][i] = i == BST_CUSTODY_DRIFT ? drift * drift : s * s;
        out->x[i] = normals ? normals[i] * (i == BST_CUSTODY_DRIFT ? drift : s) : 0.0;
    }
    out->p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] += drift * drift * age * age;
    out->p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] = out->p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] =
        drift * drift * age;
    out->x[BST_CUSTODY_ALONG] += out->x[BST_CUSTODY_DRIFT] * age;
}

void bst_custody_add_process_noise(const bst_custody_config *config, double time_s,
                                   bst_custody_filter *filter) {
    if (!(time_s > filter->noise_until_s)) {
        return;
    }
    /* A change dD of the drift at time u displaces the object by (s - u) dD at time s, which is
     * the state's DRIFT + dD and ALONG - u dD. The sums over u of a random walk with variance
     * `rate` per day are integrals of 1, -u and u^2. */
    const double rate = config->noise_m_per_day * config->noise_m_per_day;
    const double from = filter->noise_until_s / BST_DAY_S, to = time_s / BST_DAY_S;
    const double cross = -rate * (to * to - from * from) / 2.0;
    double(*p)[N] = filter->p;
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_DRIFT] += rate * (to - from);
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] += cross;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] += cross;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] += rate * (to * to * to - from * from * from) / 3.0;
    filter->noise_until_s = time_s;
}

bool bst_custody_root(const double p[N][N], double root[N][N]) {
    double unit[N];
    for (int i = 0; i < N; i++) {
        unit[i] = sqrt(p[i][i]);
        for (int j = 0; j <= i; j++) {
            root[i][j] = p[i][j] / (unit[i] * unit[j]);
        }
    }
    if (!bst_cholesky_factor(&root[0][0], N, N, 1e-15)) {
        return false;
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            root[i][j] = j <= i ? root[i][j] * unit[i] : 0.0;
        }
    }
    return true;
}

double bst_custody_nees(const bst_custody_filter *filter) {
    double l[N][N], y[N], sum = 0.0;
    for (int i = 0; i < N; i++) {
        double unit = sqrt(filter->p[i][i]);
        y[i] = filter->x[i] / unit;
        for (int j = 0; j < N; j++) {
            l[i][j] = filter->p[i][j] / (unit * sqrt(filter->p[j][j]));
        }
    }
    double w[N];
    memcpy(w, y, sizeof w);
    if (!bst_cholesky_factor(&l[0][0], N, N, 1e-15)) {
        return NAN;
    }
    bst_cholesky_solve(&l[0][0], N, N, w);
    for (int i = 0; i < N; i++) {
        sum += w[i] * y[i];
    }
    return sum;
}
