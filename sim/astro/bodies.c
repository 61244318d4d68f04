#include "sim/astro/bodies.h"

#include <erfa.h>
#include <erfam.h>

static bst_vec3 scaled(const double v[3], double scale) {
    return (bst_vec3){v[0] * scale, v[1] * scale, v[2] * scale};
}

void bst_bodies_at(bst_time t, bst_bodies *out) {
    double tt1, tt2, earth_helio[2][3], earth_bary[2][3], moon[2][3], of_date[3][3];
    bst_time_tt(t, &tt1, &tt2);
    /* its status warns of dates outside 1900..2100, where only the accuracy is lower */
    (void)eraEpv00(tt1, tt2, earth_helio, earth_bary);
    eraMoon98(tt1, tt2, moon);
    out->sun_m = scaled(earth_helio[0], -BST_AU_M);
    out->moon_m = scaled(moon[0], BST_AU_M);
    out->earth_bary_m = scaled(earth_bary[0], BST_AU_M);
    out->earth_bary_mps = scaled(earth_bary[1], BST_AU_M / ERFA_DAYSEC);
    eraPmat06(tt1, tt2, of_date);
    out->pole = scaled(of_date[2], 1.0);
}

double bst_astro_sphere_phase(double specular_fraction, double phase_rad) {
    double phi = fabs(phase_rad);
    double diffuse =
        phi < BST_PI ? 2.0 / (3.0 * BST_PI * BST_PI) * ((BST_PI - phi) * cos(phi) + sin(phi)) : 0.0;
    return (1.0 - specular_fraction) * fmax(diffuse, 0.0) + specular_fraction / (4.0 * BST_PI);
}
