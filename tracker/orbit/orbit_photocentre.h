/* Displacement of an object's centre of light from its centre of mass, for fits and custody. */
#ifndef BST_TRACKER_ORBIT_ORBIT_PHOTOCENTRE_H
#define BST_TRACKER_ORBIT_ORBIT_PHOTOCENTRE_H

#include "boresight/vec.h"

/* Standard deviation of the photocentre of a Lambertian sphere along each axis at a phase angle,
 * over half the sphere's radius. At least 0.2: satellites are no spheres.
 *
 * Given:     phase_rad  0 to pi; values beyond are taken for the nearer end
 * Notes:     the displacement towards the Sun is 3 pi / 16 sin a (1 + cos a) / (sin a + (pi - a)
 *            cos a) radii; its square is shared by two axes, as the shape is not known
 * Reference: the integral of a Lambertian sphere's radiance over what is lit and seen */
double bst_od_photocentre_factor(double phase_rad);

/* The same for an object in a direction, at the phase angle there.
 *
 * Given:     sun        unit, from the Earth, GCRF: that of an object differs by its parallax
 *            direction  unit, from the observer to the object, GCRF */
double bst_od_photocentre_factor_seen(bst_vec3 sun, bst_vec3 direction);

/* Standard deviation of the photocentre from the centre of mass along each axis where the factor is
 * 1, m: half the radius of a sphere of this cross-section. */
double bst_od_photocentre_of_area(double area_m2);

/* Standard deviation of the photocentre in a direction, along each axis, rad.
 *
 * Given:     photocentre_m  where the factor is 1
 *            factor         bst_od_photocentre_factor; 0: not known, it is taken for 1 */
double bst_od_photocentre_rad(double photocentre_m, double factor, double range_m);

/* Correlation of the photocentre's displacement, a vector in GCRF, at two times. It turns with the
 * line of sight and grows with the phase angle, by about itself in a radian; as the object goes
 * round, both change by its rate at perigee at most beside the line of sight's own turn.
 *
 * Given:     turn_rad  of the object around the Earth between the times, at most
 *            a, b      unit, to the object at the two times */
double bst_od_photocentre_correlation(double turn_rad, bst_vec3 a, bst_vec3 b);

/* What the photocentre of one observation does to the normal equations of a fit. */
typedef struct bst_od_photocentre_effect {
    double time_s;
    bst_vec3 direction; /* unit, to the object */
    double rhs[3][6];   /* right-hand side for one standard deviation along each axis of GCRF */
} bst_od_photocentre_effect;

/* Covariance of the right-hand side of the normal equations by the photocentre: the sum over all
 * pairs of observations and the axes k of rhs_i[k] rhs_j[k]^T times the correlation of the two.
 *
 * Given:     items      [count], by ascending time; overwritten
 *            rate_radps largest rate of the object around the Earth
 * Returned:  out
 * Notes:     successive observations within 0.02 rad count as one, whose correlation with others
 *            is then wrong by 0.01 at most */
void bst_od_photocentre_covariance(bst_od_photocentre_effect *items, int count, double rate_radps,
                                   double out[6][6]);

#endif
