#include "tracker/orbit/orbit_photocentre.h"

#include <assert.h>
#include <math.h>
#include <string.h>

double bst_od_photocentre_factor(double phase_rad) {
    /* 0/0 at pi, where it is 9 pi / 32 radii */
    const double a = fmin(fmax(phase_rad, 0.0), BST_PI - 1e-3), s = sin(a), c = cos(a);
    const double radii = 3.0 * BST_PI / 16.0 * s * (1.0 + c) / (s + (BST_PI - a) * c);
    return fmax(radii * sqrt(0.5) / 0.5, 0.2);
}

double bst_od_photocentre_factor_seen(bst_vec3 sun, bst_vec3 direction) {
    return bst_od_photocentre_factor(bst_vec3_angle(sun, bst_vec3_scale(direction, -1.0)));
}

double bst_od_photocentre_of_area(double area_m2) {
    return 0.5 * sqrt(area_m2 / BST_PI);
}

double bst_od_photocentre_rad(double photocentre_m, double factor, double range_m) {
    return (factor > 0.0 ? factor : 1.0) * photocentre_m / range_m;
}

double bst_od_photocentre_correlation(double turn_rad, bst_vec3 a, bst_vec3 b) {
    const bst_vec3 between = bst_vec3_sub(b, a);
    return exp(-0.5 * (turn_rad * turn_rad + bst_vec3_dot(between, between)));
}

/* turn within which observations count as one, and beyond which the correlation, 2e-8, is left out,
 * rad */
static const double SAME_RAD = 0.02, LARGEST_TURN_RAD = 6.0;

/* Adds up successive observations within SAME_RAD, in place; returns the number of sums. */
static int merge(bst_od_photocentre_effect *items, int count, double rate_radps) {
    int last = 0;
    for (int i = 1; i < count; i++) {
        bst_od_photocentre_effect *sum = &items[last];
        const bst_od_photocentre_effect *item = &items[i];
        if (rate_radps * (item->time_s - sum->time_s) < SAME_RAD &&
            bst_vec3_norm(bst_vec3_sub(item->direction, sum->direction)) < SAME_RAD) {
            for (int k = 0; k < 18; k++) {
                sum->rhs[k / 6][k % 6] += item->rhs[k / 6][k % 6];
            }
        } else if (++last < i) {
            items[last] = *item;
        }
    }
    return last + 1;
}

void bst_od_photocentre_covariance(bst_od_photocentre_effect *items, int count, double rate_radps,
                                   double out[6][6]) {
    assert(items && count > 0);
    memset(out, 0, sizeof(double[6][6]));
    const int sums = merge(items, count, rate_radps);
    for (int i = 0; i < sums; i++) {
        const bst_od_photocentre_effect *a = &items[i];
        double seen[3][6] = {{0.0}}; /* half of a, and the later ones by their correlation with a */
        for (int j = i; j < sums; j++) {
            const bst_od_photocentre_effect *b = &items[j];
            const double turn = rate_radps * (b->time_s - a->time_s);
            if (turn > LARGEST_TURN_RAD) {
                break;
            }
            const double weight =
                j > i ? bst_od_photocentre_correlation(turn, a->direction, b->direction) : 0.5;
            for (int k = 0; k < 18; k++) {
                seen[k / 6][k % 6] += weight * b->rhs[k / 6][k % 6];
            }
        }
        for (int k = 0; k < 6; k++) {
            for (int l = 0; l < 6; l++) {
                for (int c = 0; c < 3; c++) {
                    out[k][l] += a->rhs[c][k] * seen[c][l] + seen[c][k] * a->rhs[c][l];
                }
            }
        }
    }
}
