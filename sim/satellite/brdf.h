/* Reflectance of surfaces: isotropic bidirectional reflectance distribution functions (BRDF). */
#ifndef BST_SATELLITE_BRDF_H
#define BST_SATELLITE_BRDF_H

#include <stdbool.h>

#include "boresight/status.h"

/* The reflectance models. */
enum {
    BST_BRDF_LAMBERT,
    BST_BRDF_PHONG,
    BST_BRDF_ASHIKHMIN_SHIRLEY,
    BST_BRDF_COOK_TORRANCE,
    BST_BRDF_BINOMIAL,
    BST_BRDF_MAXWELL_BEARD,
    BST_BRDF_TABLE
};

enum { BST_BRDF_BINOMIAL_TERMS = 10 };

struct bst_brdf_table;

/* A BRDF. Which members a model uses:
 *   LAMBERT            diffuse
 *   PHONG              diffuse, specular, exponent
 *   ASHIKHMIN_SHIRLEY  diffuse, specular (reflectance at normal incidence), exponent
 *   COOK_TORRANCE      diffuse, specular (likewise), roughness
 *   MAXWELL_BEARD      diffuse, volume, specular (likewise), roughness, tau_rad, omega_rad
 *   BINOMIAL           b, c, base, first_power, terms
 *   TABLE              table, borrowed */
typedef struct bst_brdf {
    int model;                 /* BST_BRDF_... */
    double diffuse;            /* hemispherical reflectance of the diffuse part */
    double volume;             /* reflectance of volume scattering */
    double specular;           /* reflectance of the specular lobe */
    double exponent;           /* of the lobe's cosine */
    double roughness;          /* GGX: alpha; Maxwell-Beard: tangent of the width of the slopes */
    double tau_rad, omega_rad; /* of the shadowing and obscuration function */
    double b[2], c[BST_BRDF_BINOMIAL_TERMS], base;
    int first_power, terms;
    const struct bst_brdf_table *table;
} bst_brdf;

/* Value of a BRDF, 1/sr.
 *
 * Given:     cos_in, cos_out  cosines of the angles of incidence and of reflection from the normal,
 *                             in (0, 1]
 *            cos_between      cosine of the angle between the directions to the light and to the
 *                             observer: the phase angle
 * Returned:  0 or more; symmetric in cos_in and cos_out (reciprocity)
 * Reference: Lambert: constant. Phong, energy-conserving: Lafortune and Willems, Report CW 197
 *            (1994). Ashikhmin and Shirley, J. Graphics Tools 5, 25 (2000), with equal exponents.
 *            Cook and Torrance, ACM TOG 1, 7 (1982), with the distribution of Walter et al., EGSR
 *            (2007, "GGX"), the height-correlated masking of Heitz, JCGT 3, 48 (2014), and the
 *            Fresnel factor of Schlick, CGF 13, 233 (1994). Binomial: Greynolds, Proc. SPIE 9577
 *            (2015). Maxwell and Beard, AFAL-TR-73-303 (1973), with the slope distribution of
 *            Westlund and Meyer, Graphics Interface (2002), and the masking of Torrance and Sparrow
 *            (1967), without which its reflectance passes 1 at grazing angles. */
double bst_brdf_value(const bst_brdf *brdf, double cos_in, double cos_out, double cos_between);

/* Reflectance of a surface that a beam lights: the integral of BRDF times cosine over the
 * hemisphere.
 *
 * Given:     cos_in  cosine of the beam's angle of incidence, in (0, 1]
 * Returned:  accurate to 1e-3 for lobes that are wider than 0.01 rad */
double bst_brdf_reflectance(const bst_brdf *brdf, double cos_in);

/* Half width of the specular lobe in the angle of the half vector, rad; pi / 2: no lobe. */
double bst_brdf_lobe_rad(const bst_brdf *brdf);

/* Checks the parameters and that the surface reflects no more light than it receives, for angles of
 * incidence up to 85 degrees.
 *
 * Errors:    BST_ERR_CONFIG with the reflectance, its angle and the remedy */
bst_status bst_brdf_check(bst_ctx *ctx, const bst_brdf *brdf) BST_MUST_CHECK;

/* A measured BRDF in the plane of incidence. */
typedef struct bst_brdf_table bst_brdf_table;

/* Reads a table of measured values.
 *
 * Given:     path  text file: lines of five numbers separated by blanks or commas: zenith angle and
 *                  azimuth of the incident light, zenith angle (negative: on the side of the light)
 *                  and azimuth of the reflected light, in degrees, and the BRDF in 1/sr; lines that
 *                  start with # or a letter are skipped. All directions lie in one plane.
 * Returned:  *out  the table; NULL on error
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_FORMAT with file, line and what is allowed,
 *            BST_ERR_MEMORY
 * Ownership: free *out with bst_brdf_table_free
 * Notes:     directions out of the plane get the value of the pair of directions in the plane that
 *            has the same D and V (Greynolds 2015): D is the distance of the direction cosines from
 *            the specular direction, V their scalar product. Between rows, values at the same D are
 *            interpolated, so that the lobe moves with the angle of incidence. */
bst_status bst_brdf_table_load(bst_ctx *ctx, const char *path, bst_brdf_table **out) BST_MUST_CHECK;
/* Frees a table; NULL is allowed. */
void bst_brdf_table_free(bst_brdf_table *table);
/* Value of a table, 1/sr, for direction cosines in the plane: sin_in in [0, 1], sin_out in [-1, 1],
 * positive on the specular side. Not symmetric; bst_brdf_value takes the mean of both orders. */
double bst_brdf_table_value(const bst_brdf_table *table, double sin_in, double sin_out);

#endif
