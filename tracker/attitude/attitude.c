#include "tracker/attitude/attitude.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"
#include "sim/core/symmetric.h"

/* The identified stars of a frame. */
typedef struct star_set {
    const bst_camera *camera;
    bst_attitude_star *items;
    int count;
    bool placed; /* the work space of the items is that of q and extra_px2 */
    bst_quat q;
    double extra_px2;
} star_set;

/* Residual of a star at an attitude, and its derivative. */
static void place_star(const bst_camera *camera, bst_quat q, bst_attitude_star *star) {
    bst_vec3 v = bst_quat_rotate(q, star->apparent_gcrf);
    double x, y;
    star->in_front = bst_camera_project(camera, v, &x, &y);
    if (!star->in_front) {
        return;
    }
    star->residual_px[0] = star->x_px - x;
    star->residual_px[1] = star->y_px - y;
    /* v rotates by e x v; the pixel is a function of a = vx / vz and b = vy / vz */
    double f = 1.0 / bst_camera_scale_rad(camera), a = v.x / v.z, b = v.y / v.z;
    const double ja[3] = {-a * b, 1 + a * a, -b}, jb[3] = {-(1 + b * b), a * b, a};
    double by_tangent[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    if (camera->geometry.general) {
        bst_camera_jacobian(camera, v, by_tangent);
    }
    for (int k = 0; k < 3; k++) {
        star->by_rotation_px[0][k] = (by_tangent[0][0] * ja[k] + by_tangent[0][1] * jb[k]) * f;
        star->by_rotation_px[1][k] = (by_tangent[1][0] * ja[k] + by_tangent[1][1] * jb[k]) * f;
    }
}

/* Inverse covariance of a star with an excess variance. */
static void invert_covariance(double extra_px2, bst_attitude_star *star) {
    double cxx = star->cov_xx + extra_px2, cyy = star->cov_yy + extra_px2, cxy = star->cov_xy,
           det = cxx * cyy - cxy * cxy;
    star->positive = det > 0.0 && cxx > 0.0;
    star->information[0] = cyy / det;
    star->information[1] = -cxy / det;
    star->information[2] = cxx / det;
}

/* Misfit of a placed star. */
static void weigh_star(bst_attitude_star *star) {
    const double *r = star->residual_px, *w = star->information;
    star->fits = star->in_front && star->positive;
    if (star->fits) {
        star->chi2 = w[0] * r[0] * r[0] + 2 * w[1] * r[0] * r[1] + w[2] * r[1] * r[1];
        star->fits = isfinite(star->chi2);
    }
}

/* Residuals and misfits of all stars at an attitude; several steps in a row ask for the same. */
static void place_stars(star_set *stars, double extra_px2, bst_quat q) {
    bool same_q = stars->placed && memcmp(&stars->q, &q, sizeof q) == 0;
    bool same_extra = stars->placed && stars->extra_px2 == extra_px2;
    if (same_q && same_extra) {
        return;
    }
    for (int i = 0; i < stars->count; i++) {
        bst_attitude_star *star = &stars->items[i];
        if (!same_q) {
            place_star(stars->camera, q, star);
        }
        if (!same_extra) {
            invert_covariance(extra_px2, star);
        }
        weigh_star(star);
    }
    stars->placed = true;
    stars->q = q;
    stars->extra_px2 = extra_px2;
}

typedef enum weighting { WEIGHT_CAUCHY, WEIGHT_GIVEN } weighting;

/* One Gauss-Newton step of the attitude; false if the normal matrix is singular. */
static bool attitude_step(star_set *stars, double extra_px2, weighting how, double scale2,
                          bst_quat *q, double covariance[3][3], double *moved_rad) {
    double n[3][3] = {{0}}, g[3] = {0};
    place_stars(stars, extra_px2, *q);
    for (int i = 0; i < stars->count; i++) {
        const bst_attitude_star *star = &stars->items[i];
        const double *r = star->residual_px, (*j)[3] = star->by_rotation_px, *w = star->information;
        if (!star->fits) {
            continue;
        }
        double weight = how == WEIGHT_GIVEN ? star->weight : 1.0 / (1.0 + star->chi2 / scale2);
        for (int k = 0; k < 3; k++) {
            double a = weight * (w[0] * j[0][k] + w[1] * j[1][k]);
            double b = weight * (w[1] * j[0][k] + w[2] * j[1][k]);
            g[k] += a * r[0] + b * r[1];
            for (int m = 0; m <= k; m++) { /* the lower triangle is all that is inverted */
                n[k][m] += a * j[0][m] + b * j[1][m];
            }
        }
    }
    if (!bst_symmetric_invert(3, n[0], covariance[0])) {
        return false;
    }
    bst_vec3 e = {covariance[0][0] * g[0] + covariance[0][1] * g[1] + covariance[0][2] * g[2],
                  covariance[1][0] * g[0] + covariance[1][1] * g[1] + covariance[1][2] * g[2],
                  covariance[2][0] * g[0] + covariance[2][1] * g[1] + covariance[2][2] * g[2]};
    *moved_rad = bst_vec3_norm(e);
    if (!(*moved_rad < 0.5)) {
        return false;
    }
    *q = bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(e), *q));
    return true;
}

/* Selects the stars whose chi-square is within `limit` (weight 1, else 0); returns the number of
 * changes. */
static int select_stars(star_set *stars, double extra_px2, double limit, bst_quat q, int *used) {
    int changed = 0;
    *used = 0;
    place_stars(stars, extra_px2, q);
    for (int i = 0; i < stars->count; i++) {
        bst_attitude_star *star = &stars->items[i];
        double weight = star->fits && star->chi2 <= limit ? 1.0 : 0.0;
        changed += weight != star->weight;
        star->weight = weight;
        *used += weight > 0.0;
    }
    return changed;
}

static double mean_chi2(star_set *stars, double extra_px2, bst_quat q) {
    double sum = 0.0;
    int n = 0;
    place_stars(stars, extra_px2, q);
    for (int i = 0; i < stars->count; i++) {
        if (stars->items[i].fits) {
            sum += stars->items[i].chi2;
            n++;
        }
    }
    return n > 0 ? sum / n : 0.0;
}

/* Limits of the excess variance per axis that the stars' covariances lack. */
enum { FEWEST_FOR_EXCESS = 6, BISECTIONS = 40 };
static const double LARGEST_EXCESS_PX2 = 4.0;

/* The `rank`-th smallest `sorted` of the stars, rank from 1, none of them NaN; reorders these
 * numbers (quickselect: Hoare, Comm. ACM 4, 1961). */
static double select_rank(bst_attitude_star *list, int count, int rank) {
    int low = 0, high = count - 1, at = rank - 1;
    while (low < high) {
        double pivot = list[at].sorted;
        int i = low, k = high;
        while (i <= k) {
            while (list[i].sorted < pivot) {
                i++;
            }
            while (list[k].sorted > pivot) {
                k--;
            }
            if (i <= k) {
                double swapped = list[i].sorted;
                list[i++].sorted = list[k].sorted;
                list[k--].sorted = swapped;
            }
        }
        low = k < at ? i : low;
        high = i > at ? k : high;
    }
    return list[at].sorted;
}

/* Median chi-square of the stars: the smallest number in steps of 1e6 / 2^60 that is not below half
 * of them. */
static double median_chi2(star_set *stars, double extra_px2, bst_quat q) {
    double low = 0.0, high = 1e6;
    place_stars(stars, extra_px2, q);
    for (int i = 0; i < stars->count; i++) {
        bst_attitude_star *star = &stars->items[i];
        star->sorted = star->fits ? star->chi2 : INFINITY;
    }
    double median = select_rank(stars->items, stars->count, (stars->count + 1) / 2);
    for (int k = 0; k < 60; k++) {
        double middle = 0.5 * (low + high);
        *(middle >= median ? &high : &low) = middle;
    }
    return high;
}

/* Excess variance from the median chi-square, which misidentified stars hardly affect; 0 if the
 * median lies within three standard errors of its expectation ln 4. */
static double excess_of_median(star_set *stars, double floor_px2, bst_quat q) {
    const double right = log(4.0), error = 2.0 / sqrt((double)stars->count);
    if (stars->count < FEWEST_FOR_EXCESS || median_chi2(stars, floor_px2, q) <= right + error) {
        return 0.0;
    }
    double low = 0.0, high = LARGEST_EXCESS_PX2;
    for (int k = 0; k < BISECTIONS; k++) {
        double middle = 0.5 * (low + high);
        *(median_chi2(stars, floor_px2 + middle, q) > right ? &low : &high) = middle;
    }
    return high;
}

/* Sum of chi-square over the stars used. */
static double total_chi2(star_set *stars, double extra_px2, bst_quat q) {
    double sum = 0.0;
    place_stars(stars, extra_px2, q);
    for (int i = 0; i < stars->count; i++) {
        const bst_attitude_star *star = &stars->items[i];
        if (star->weight > 0.0 && star->fits) {
            sum += star->chi2;
        }
    }
    return sum;
}

/* Excess variance from the sum of chi-square over the stars used (Paule and Mandel, J. Res. NBS 87,
 * 1982); 0 if the sum is below its 99.9 % quantile (Wilson and Hilferty 1931). */
static double excess_of_sum(star_set *stars, double floor_px2, bst_quat q, int dof) {
    double spread = 2.0 / (9.0 * dof), root = 1.0 - spread + 3.09 * sqrt(spread);
    if (dof < 2 * FEWEST_FOR_EXCESS - 3 ||
        total_chi2(stars, floor_px2, q) <= dof * root * root * root) {
        return 0.0;
    }
    double low = 0.0, high = LARGEST_EXCESS_PX2;
    for (int k = 0; k < BISECTIONS; k++) {
        double middle = 0.5 * (low + high);
        *(total_chi2(stars, floor_px2 + middle, q) > dof ? &low : &high) = middle;
    }
    return high;
}

/* Limits of the iterations: each annealing step halves the scale, from at most 1e6 sigma. */
enum { MAX_ANNEAL = 24, MAX_RESELECT = 8, MAX_NEWTON = 6 };

/* Robust attitude solution: annealed Cauchy weights, rejection, then least squares. */
static bool solve_robust(star_set *stars, const bst_attitude_params *params, bst_quat *q,
                         double covariance[3][3], int *used, double *extra_px2) {
    const double floor_px2 = params->floor_px * params->floor_px;
    double moved, scale2 = fmax(mean_chi2(stars, floor_px2, *q), 4.0);
    for (int i = 0; i < MAX_ANNEAL; i++) {
        if (!attitude_step(stars, floor_px2, WEIGHT_CAUCHY, scale2, q, covariance, &moved)) {
            return false;
        }
        if (scale2 <= 4.0 && moved < 1e-9) {
            break;
        }
        /* the first step removes a common shift of all stars; the scale then follows the remaining
         * misfit */
        double now = mean_chi2(stars, floor_px2, *q);
        scale2 = fmax(fmin(0.25 * scale2, now), 4.0);
    }
    *extra_px2 = floor_px2 + excess_of_median(stars, floor_px2, *q);
    for (int i = 0; i < stars->count; i++) {
        stars->items[i].weight = -1.0;
    }
    for (int i = 0; i < MAX_RESELECT; i++) {
        if (select_stars(stars, *extra_px2, params->reject_chi2, *q, used) == 0) {
            break;
        }
        if (*used < 2) {
            return false;
        }
        for (int k = 0; k < MAX_NEWTON; k++) {
            if (!attitude_step(stars, *extra_px2, WEIGHT_GIVEN, 1.0, q, covariance, &moved)) {
                return false;
            }
            if (moved < 1e-12) {
                break;
            }
        }
        *extra_px2 = floor_px2 + excess_of_sum(stars, floor_px2, *q, 2 * *used - 3);
    }
    return *used >= 2 && attitude_step(stars, *extra_px2, WEIGHT_GIVEN, 1.0, q, covariance, &moved);
}

/* Influence of a star on the attitude: its pull and leverage. */
static void star_influence(const double covariance[3][3], bst_attitude_star *star) {
    const double *r = star->residual_px, (*j)[3] = star->by_rotation_px, *w = star->information;
    double g[3], gain[3] = {0.0}, info[3][3];
    for (int k = 0; k < 3; k++) {
        double a = w[0] * j[0][k] + w[1] * j[1][k];
        double b = w[1] * j[0][k] + w[2] * j[1][k];
        g[k] = a * r[0] + b * r[1];
        for (int m = 0; m < 3; m++) {
            info[k][m] = a * j[0][m] + b * j[1][m];
        }
    }
    star->leverage = 0.0;
    for (int k = 0; k < 3; k++) {
        for (int m = 0; m < 3; m++) {
            gain[k] += covariance[k][m] * g[m];
            star->leverage += k < 2 ? 0.5 * covariance[k][m] * info[m][k] : 0.0;
        }
    }
    star->pull_rad = (bst_vec3){gain[0], gain[1], gain[2]};
}

void bst_attitude_solve(const bst_camera *camera, const bst_attitude_params *params,
                        bst_quat q_start, bst_attitude_star *stars, int count,
                        bst_attitude_solution *out) {
    assert(camera && params && out && count >= 0 && (stars || count == 0));
    assert(bst_is_unit_quat(q_start, BST_LINK_UNIT_TOLERANCE));
    *out = (bst_attitude_solution){.q_cam_from_gcrf = q_start};
    if (count < 2) {
        return;
    }
    bst_quat q = bst_quat_unit(q_start);
    int used = 0;
    double extra_px2 = 0.0;
    star_set set = {.camera = camera, .items = stars, .count = count};
    if (!solve_robust(&set, params, &q, out->covariance, &used, &extra_px2)) {
        return;
    }
    double square = 0.0;
    place_stars(&set, extra_px2, q);
    for (int i = 0; i < count; i++) {
        const double *r = stars[i].residual_px;
        if (stars[i].weight > 0.0 && stars[i].fits) {
            out->chi2 += stars[i].chi2;
            square += r[0] * r[0] + r[1] * r[1];
            star_influence((const double(*)[3])out->covariance, &stars[i]);
        }
    }
    out->q_cam_from_gcrf = q;
    out->stars_used = used;
    out->dof = 2 * used - 3;
    out->excess_px = sqrt(fmax(extra_px2 - params->floor_px * params->floor_px, 0.0));
    out->rms_px = sqrt(square / (2.0 * used));
    bool agree = used >= (used < count ? 3 : 2) && used * 10 >= count * 6;
    out->valid = agree && sqrt(out->covariance[0][0]) <= params->max_cross_rad &&
                 sqrt(out->covariance[1][1]) <= params->max_cross_rad &&
                 sqrt(out->covariance[2][2]) <= params->max_roll_rad;
}
