#include "sim/catalogue/star_counts.h"

#include <stdbool.h>

#include "sim/catalogue/star_counts_table.h"

_Static_assert((int)COUNT_V == (int)BST_COUNT_NODES && (int)COUNT_V_FIRST == (int)BST_COUNT_FIRST_V,
               "table and header");

static const bst_vec3 galactic_axes[3] = {
    {-0.0548755604162154, -0.8734370902348850, -0.4838350155487132},
    {0.4941094278755837, -0.4448296299600112, 0.7469822444972189},
    {-0.8676661490190047, -0.1980763734312015, 0.4559837761750669}};

bst_vec3 bst_catalogue_galactic_from_icrs(bst_vec3 v) {
    return (bst_vec3){bst_vec3_dot(galactic_axes[0], v), bst_vec3_dot(galactic_axes[1], v),
                      bst_vec3_dot(galactic_axes[2], v)};
}

bst_vec3 bst_catalogue_icrs_from_galactic(bst_vec3 v) {
    bst_vec3 sum = bst_vec3_scale(galactic_axes[0], v.x);
    return bst_vec3_axpy(bst_vec3_axpy(sum, v.y, galactic_axes[1]), v.z, galactic_axes[2]);
}

void bst_star_counts_at(bst_vec3 icrs, bst_star_counts *out) {
    bst_vec3 g = bst_catalogue_galactic_from_icrs(icrs);
    double b = fmin(atan2(fabs(g.z), hypot(g.x, g.y)) / BST_DEG_RAD, 90.0);
    double l = atan2(fabs(g.y), g.x) / BST_DEG_RAD; /* |l|, 0 to 180 */
    int i = 0;
    while (i + 2 < COUNT_B && b > count_b_deg[i + 1]) {
        i++;
    }
    double s = (b - count_b_deg[i]) / (count_b_deg[i + 1] - count_b_deg[i]);
    double at = l / count_l_step_deg;
    int j = at < COUNT_L - 2 ? (int)at : COUNT_L - 2;
    double t = at - j;
    for (int k = 0; k < COUNT_V; k++) {
        double low = (1.0 - t) * count_table[i][j][k] + t * count_table[i][j + 1][k];
        double high = (1.0 - t) * count_table[i + 1][j][k] + t * count_table[i + 1][j + 1][k];
        out->log_n[k] = 1e-3 * ((1.0 - s) * low + s * high);
    }
}

/* Segment of the table that contains v; outside, the first or last one. */
static int segment(double v) {
    double at = v - BST_COUNT_FIRST_V;
    return at <= 0.0 ? 0 : at >= BST_COUNT_NODES - 1 ? BST_COUNT_NODES - 2 : (int)at;
}

/* Slope of the logarithmic star count between two magnitudes. */
static double slope(const bst_star_counts *counts, int k) {
    return counts->log_n[k + 1] - counts->log_n[k];
}

double bst_star_counts_brighter(const bst_star_counts *counts, double v) {
    int k = segment(v);
    return pow(10.0, counts->log_n[k] + slope(counts, k) * (v - BST_COUNT_FIRST_V - k));
}

double bst_star_counts_light(const bst_star_counts *counts, double v_from, double v_to) {
    double sum = 0.0;
    for (int k = segment(v_from); k < BST_COUNT_NODES - 1; k++) {
        bool last = k == BST_COUNT_NODES - 2;
        double base = BST_COUNT_FIRST_V + k;
        double a = k == segment(v_from) ? v_from : base;
        double b = last ? v_to : fmin(v_to, base + 1.0);
        if (a >= v_to) {
            break;
        }
        /* dN = ln10 s N dV: the integrand is 10^(log N0 - 0.4 base + (s - 0.4) (V - base)) */
        double s = slope(counts, k), e = s - 0.4;
        double scale = s * pow(10.0, counts->log_n[k] - 0.4 * base);
        double upper = isinf(b) ? 0.0 : pow(10.0, e * (b - base));
        sum += fabs(e) < 1e-9 ? scale * log(10.0) * (b - a)
                              : scale * (upper - pow(10.0, e * (a - base))) / e;
    }
    return sum;
}
