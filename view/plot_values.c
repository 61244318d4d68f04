#include "view/plot_values.h"

#include <math.h>

#include "boresight/vec.h"

double bst_view_angle_arcsec(double ra_deg, double dec_deg, double other_ra_deg,
                             double other_dec_deg) {
    /* haversine: exact for small angles */
    double a = dec_deg * BST_DEG_RAD, b = other_dec_deg * BST_DEG_RAD;
    double s = sin(0.5 * (b - a)), t = sin(0.5 * (other_ra_deg - ra_deg) * BST_DEG_RAD);
    return 2.0 * asin(fmin(1.0, sqrt(s * s + cos(a) * cos(b) * t * t))) / BST_ARCSEC_RAD;
}

double bst_view_three_sigma_arcsec(double d11_rad2, double d22_rad2) {
    return 3.0 * sqrt(0.5 * (d11_rad2 + d22_rad2)) / BST_ARCSEC_RAD;
}

/* A symmetric matrix of two rows: its elements 11, 12, 22. */
typedef struct symmetric {
    double a, b, c;
} symmetric;

/* True if a matrix is positive definite. */
static bool is_positive(symmetric m) {
    return m.a > 0.0 && m.a * m.c - m.b * m.b > 0.0;
}

/* x = m^-1 y */
static void solve(symmetric m, const double y[2], double x[2]) {
    double det = m.a * m.c - m.b * m.b;
    x[0] = (m.c * y[0] - m.b * y[1]) / det;
    x[1] = (m.a * y[1] - m.b * y[0]) / det;
}

bool bst_view_innovation(const bst_view_track_state *before, const bst_view_track_state *after,
                         double *innovation_arcsec, double *sigma3_arcsec) {
    double dt_s = after->time_s - before->time_s;
    if (before->track != after->track || after->misses_in_row != 0 || !(dt_s > 0.0)) {
        return false;
    }
    const symmetric p = {
        before->d11 + 2.0 * dt_s * before->dr[0][0] + dt_s * dt_s * before->r11,
        before->d12 + dt_s * (before->dr[0][1] + before->dr[1][0]) + dt_s * dt_s * before->r12,
        before->d22 + 2.0 * dt_s * before->dr[1][1] + dt_s * dt_s * before->r22};
    const symmetric gained = {p.a - after->d11, p.b - after->d12, p.c - after->d22};
    if (!is_positive(p) || !is_positive(gained)) {
        return false;
    }
    double turn = remainder(after->ra_deg - before->ra_deg, 360.0);
    double east = turn * cos(after->dec_deg * BST_DEG_RAD) * BST_DEG_RAD;
    double north = (after->dec_deg - before->dec_deg) * BST_DEG_RAD;
    const double c[2] = {east - before->rate_arcsec_per_s[0] * dt_s * BST_ARCSEC_RAD,
                         north - before->rate_arcsec_per_s[1] * dt_s * BST_ARCSEC_RAD};
    /* K = gained p^-1, so K^-1 c = p gained^-1 c */
    double x[2], column[2];
    solve(gained, c, x);
    *innovation_arcsec = hypot(p.a * x[0] + p.b * x[1], p.b * x[0] + p.c * x[1]) / BST_ARCSEC_RAD;
    double trace = 0.0; /* of S = p gained^-1 p */
    solve(gained, (const double[2]){p.a, p.b}, column);
    trace += p.a * column[0] + p.b * column[1];
    solve(gained, (const double[2]){p.b, p.c}, column);
    trace += p.b * column[0] + p.c * column[1];
    *sigma3_arcsec = 3.0 * sqrt(0.5 * trace) / BST_ARCSEC_RAD;
    return true;
}
