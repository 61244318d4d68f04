#include "sim/run/run_custody_reach.h"

#include "sim/core/simd.h"

/* Positions are tabulated within 4 s and 1 km: distance of an object from the line of sight beyond
 * which it is no candidate, m; and standard deviations of its own position. */
#define TABLE_REACH_M (4.1 * 11500.0 + 1000.0)
#define CANDIDATE_SIGMAS 6.0

double bst_run_reach_of(const bst_custody_orbit *orbit, const bst_custody_filter *f,
                        double time_s) {
    double days = time_s / BST_DAY_S, variance = 0.0;
    for (int k = BST_CUSTODY_ECC_X; k < BST_CUSTODY_ALONG; k++) {
        variance += f->p[k][k];
    }
    /* a mean anomaly moves the object most at perigee, by the speed there over the mean one */
    double e = orbit->elements.eccentricity;
    variance += (1.0 + e) / (1.0 - e) *
                (f->p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] +
                 days * (2.0 * f->p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] +
                         days * f->p[BST_CUSTODY_DRIFT][BST_CUSTODY_DRIFT]));
    return TABLE_REACH_M + CANDIDATE_SIGMAS * sqrt(fmax(variance, 0.0));
}

bool bst_run_reach_holds(double reach_m, bst_vec3 place, const bst_custody_observation *z) {
    bst_vec3 line = bst_vec3_sub(place, z->observer.position_m);
    double along = bst_vec3_dot(line, z->direction);
    double across2 = bst_vec3_dot(line, line) - along * along;
    return isnan(place.x) || (along > -reach_m && across2 < reach_m * reach_m);
}

static BST_CLONES bool may_be_any(double *const place_m[3], const double *reach_m, int begin, int n,
                                  const bst_custody_observation *z, int *out) {
    const double *x_m = place_m[0] + begin, *y_m = place_m[1] + begin, *z_m = place_m[2] + begin;
    const bst_vec3 eye = z->observer.position_m, axis = z->direction;
    int any = 0;
    for (int i = 0; i < n; i++) {
        const double x = x_m[i] - eye.x, y = y_m[i] - eye.y, h = z_m[i] - eye.z;
        const double along = x * axis.x + y * axis.y + h * axis.z;
        const double across2 = x * x + y * y + h * h - along * along;
        const int behind = along <= -reach_m[begin + i],
                  beside = across2 >= reach_m[begin + i] * reach_m[begin + i];
        out[i] = !(behind | beside);
        any |= out[i];
    }
    return any != 0;
}

bool bst_run_reach_any(double *const place_m[3], const double *reach_m, int begin, int n,
                       const bst_custody_observation *z, int *out) {
    return may_be_any(place_m, reach_m, begin, n, z, out); /* a clone is seen outside the library */
}
