#include "imgproc/identify/star_fit.h"

#include <assert.h>

#include "sim/core/symmetric.h"

enum { PARAMETERS = 4, ITERATIONS = 4 };
/* Furthest that a step of the fit may turn, rad: beyond it the start was wrong. */
static const double MOST_STEP_RAD = 0.5;

/* Direction in the camera frame of a pair's place, by a scale. */
static bst_vec3 seen(const bst_camera *camera, const bst_star_fit_pair *pair, double scale) {
    bst_vec3 v = bst_camera_unproject(camera, pair->x_px, pair->y_px);
    return bst_vec3_unit((bst_vec3){v.x * scale, v.y * scale, v.z});
}

/* Right-handed axes of two directions; false if they are parallel. */
static bool axes_of(bst_vec3 a, bst_vec3 b, bst_vec3 out[3]) {
    bst_vec3 normal = bst_vec3_cross(a, b);
    out[0] = bst_vec3_unit(bst_vec3_add(a, b));
    out[2] = bst_vec3_unit(normal);
    out[1] = bst_vec3_cross(out[2], out[0]);
    return bst_vec3_norm(normal) > 0.0;
}

bool bst_star_fit_start(const bst_camera *camera, const bst_star_fit_pair pairs[2], double scale,
                        bst_star_fit *out) {
    bst_vec3 cam[3], gcrf[3];
    if (!axes_of(seen(camera, &pairs[0], scale), seen(camera, &pairs[1], scale), cam) ||
        !axes_of(pairs[0].gcrf, pairs[1].gcrf, gcrf)) {
        return false;
    }
    bst_mat3 r = {{{0}}};
    for (int k = 0; k < 3; k++) {
        const double c[3] = {cam[k].x, cam[k].y, cam[k].z};
        const double g[3] = {gcrf[k].x, gcrf[k].y, gcrf[k].z};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                r.m[i][j] += c[i] * g[j];
            }
        }
    }
    *out = (bst_star_fit){.q_cam_from_gcrf = bst_quat_unit(bst_quat_from_mat3(&r)), .scale = scale};
    return true;
}

/* Sums of the squared residuals of a fit: px^2, and by the covariances. */
typedef struct residuals {
    double square, chi_squared;
} residuals;

/* Adds a star to the normal equations and the sums. False: behind. */
static bool add_star(const bst_camera *camera, const bst_star_fit_pair *pair,
                     const bst_star_fit *fit, double m[PARAMETERS][PARAMETERS],
                     double g[PARAMETERS], residuals *sum) {
    bst_vec3 v = bst_camera_unproject(camera, pair->x_px, pair->y_px);
    bst_vec3 u = bst_quat_rotate(fit->q_cam_from_gcrf, pair->gcrf);
    if (!(u.z > 0.0)) {
        return false;
    }
    const double a = u.x / u.z, b = u.y / u.z, f = fit->scale, unit = bst_camera_scale_rad(camera);
    const double det = pair->cov_xx * pair->cov_yy - pair->cov_xy * pair->cov_xy;
    const double w[2][2] = {{pair->cov_yy / det, -pair->cov_xy / det},
                            {-pair->cov_xy / det, pair->cov_xx / det}};
    /* tangent coordinates, by the camera's scale, of the star turned by a small rotation vector;
     * the last parameter is the logarithm of the scale */
    const double j[2][PARAMETERS] = {{-a * b / f, (1.0 + a * a) / f, -b / f, -a / f},
                                     {(-1.0 - b * b) / f, a * b / f, a / f, -b / f}};
    const double r[2] = {(v.x / v.z - a / f) / unit, (v.y / v.z - b / f) / unit};
    sum->square += r[0] * r[0] + r[1] * r[1];
    sum->chi_squared += w[0][0] * r[0] * r[0] + 2.0 * w[0][1] * r[0] * r[1] + w[1][1] * r[1] * r[1];
    for (int p = 0; p < PARAMETERS; p++) {
        /* the parameter's derivatives, weighted */
        const double a0 = (w[0][0] * j[0][p] + w[1][0] * j[1][p]) / unit;
        const double a1 = (w[0][1] * j[0][p] + w[1][1] * j[1][p]) / unit;
        g[p] += a0 * r[0] + a1 * r[1];
        for (int q = 0; q < PARAMETERS; q++) {
            m[p][q] += (a0 * j[0][q] + a1 * j[1][q]) / unit;
        }
    }
    return true;
}

bool bst_star_fit_refine(const bst_camera *camera, const bst_star_fit_pair *pairs, int count,
                         bst_star_fit *fit) {
    assert(camera && pairs && fit && count >= 0);
    bst_star_fit now = *fit;
    for (int pass = 0; pass <= ITERATIONS; pass++) {
        double m[PARAMETERS][PARAMETERS] = {{0}}, inverse[PARAMETERS][PARAMETERS];
        double g[PARAMETERS] = {0}, step[PARAMETERS] = {0};
        residuals sum = {0.0, 0.0};
        for (int i = 0; i < count; i++) {
            if (!add_star(camera, &pairs[i], &now, m, g, &sum)) {
                return false;
            }
        }
        now.rms_px = sqrt(sum.square / fmax(2.0 * count, 1.0));
        now.chi_squared = sum.chi_squared;
        if (pass == ITERATIONS) {
            break;
        }
        if (!bst_symmetric_invert(PARAMETERS, m[0], inverse[0])) {
            return false;
        }
        for (int p = 0; p < PARAMETERS; p++) {
            for (int q = 0; q < PARAMETERS; q++) {
                step[p] += inverse[p][q] * g[q];
            }
        }
        bst_vec3 turn = {step[0], step[1], step[2]};
        if (!(bst_vec3_norm(turn) < MOST_STEP_RAD) || !(fabs(step[3]) < MOST_STEP_RAD)) {
            return false;
        }
        now.q_cam_from_gcrf =
            bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(turn), now.q_cam_from_gcrf));
        now.scale *= exp(step[3]);
    }
    *fit = now;
    return true;
}

bool bst_star_fit_project(const bst_star_fit *fit, const bst_camera *camera, bst_vec3 gcrf,
                          double *x_px, double *y_px) {
    bst_vec3 u = bst_quat_rotate(fit->q_cam_from_gcrf, gcrf);
    return bst_camera_project(camera, (bst_vec3){u.x / fit->scale, u.y / fit->scale, u.z}, x_px,
                              y_px);
}
