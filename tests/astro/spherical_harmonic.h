/* GeographicLib's sum of spherical harmonics, to check ours with. */
#ifndef BST_TESTS_ASTRO_SPHERICAL_HARMONIC_H
#define BST_TESTS_ASTRO_SPHERICAL_HARMONIC_H

#ifdef __cplusplus
extern "C" {
#endif

/* Potential (m^2/s^2) and its gradient of fully normalised coefficients cs[n (n + 1) / 2 + m],
 * degree n from 0 on, cut at degree and order. */
double test_spherical_harmonic(double gm, double radius, int degree, int order,
                               const double (*cs)[2], const double position[3], double gradient[3]);

#ifdef __cplusplus
}
#endif

#endif
