/* Earth gravity field: point mass, zonal and tesseral harmonics, Earth-fixed axes. */
#ifndef BST_ASTRO_GRAVITY_H
#define BST_ASTRO_GRAVITY_H

#include <stddef.h>

#include "boresight/status.h"
#include "boresight/vec.h"

enum {
    BST_GRAVITY_BUILTIN_DEGREE = 20, /* maximum degree of bst_gravity_builtin */
    BST_GRAVITY_MAX_DEGREE = 360     /* maximum degree read from a file */
};

/* A gravity field to a degree and order; immutable, shareable between threads. */
typedef struct bst_gravity bst_gravity;

/* Creates the field of a point mass with gravitational parameter gm_m3ps2. */
bst_status bst_gravity_point(bst_ctx *ctx, double gm_m3ps2, bst_gravity **out) BST_MUST_CHECK;

/* The field that is part of the program, EGM2008 (tide-free; GM 3.986004415e14 m^3/s^2 and
 * reference radius 6378136.3 m, as the model has them), cut at `degree` (0 to
 * BST_GRAVITY_BUILTIN_DEGREE) and `order` (0 to degree; 0: zonal terms only). Outside of that:
 * BST_ERR_ARGUMENT. Pavlis et al., J. Geophys. Res. 117 (2012), B04406. */
bst_status bst_gravity_builtin(bst_ctx *ctx, int degree, int order,
                               bst_gravity **out) BST_MUST_CHECK;

/* Reads a static field from a file in the format of ICGEM (.gfc), cut at `degree` (0 to
 * BST_GRAVITY_MAX_DEGREE) and `order`. Header up to "end_of_head": earth_gravity_constant (or
 * gravity_constant), radius, max_degree, and norm (fully_normalized where it is not there, or
 * unnormalized); the tide system is taken as it comes. Then lines "gfc degree order C S" with or
 * without errors, in any order, Fortran's D exponents allowed. Coefficients of degree 0 and 1 may
 * be missing and are taken as 1 and 0 whatever they are; others up to the cut may not be missing.
 * Errors start with "path:line: ": BST_ERR_FORMAT for content (also time-variable terms,
 * coefficients given twice or missing, a degree or order that the file does not have);
 * BST_ERR_NOT_FOUND for no such file; BST_ERR_IO when it cannot be read, is a directory or is over
 * 256 MiB. BST_ERR_ARGUMENT for degree or order outside of their range. Format: Barthelmes and
 * Foerste, The ICGEM format (GFZ Potsdam, 2011). */
bst_status bst_gravity_load(bst_ctx *ctx, const char *path, int degree, int order,
                            bst_gravity **out) BST_MUST_CHECK;
/* As bst_gravity_load, from memory; `name`: file name for messages. */
bst_status bst_gravity_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                   int degree, int order, bst_gravity **out) BST_MUST_CHECK;

void bst_gravity_free(bst_gravity *gravity); /* NULL allowed */

double bst_gravity_gm(const bst_gravity *gravity); /* gravitational parameter, m^3/s^2 */
/* Highest degree of the field's coefficients in use. */
int bst_gravity_degree(const bst_gravity *gravity);
/* Highest order of the field's coefficients in use. */
int bst_gravity_order(const bst_gravity *gravity);

/* Acceleration (m/s^2) at a position (m), both in Earth-fixed axes (ITRF), the position outside of
 * the Earth; regular at the poles. Cunningham's recursions (Celestial Mechanics 2, 1970, 207;
 * Montenbruck and Gill, Satellite Orbits, equations 3.29 to 3.33) in fully normalised form. Below
 * degree 2 this is the point mass. About 1 us at degree and order 20. */
bst_vec3 bst_gravity_acceleration(const bst_gravity *gravity, bst_vec3 position_itrf_m);
/* Gravitational potential (m^2/s^2, positive near the Earth: its gradient is the acceleration). */
double bst_gravity_potential(const bst_gravity *gravity, bst_vec3 position_itrf_m);

/* Torque of the gravity gradient of a point-mass Earth on a body, N m, body axes: 3 mu / r^3
 * (u x I u), u the unit vector to the Earth's centre.
 *
 * Given:     inertia_kgm2  about the centre of mass, body axes
 *            position_m    geocentric, GCRF
 * Reference: Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control
 *            (2014), eq. 3.155 */
bst_vec3 bst_gravity_gradient_torque(const bst_mat3 *inertia_kgm2, bst_quat q_body_from_gcrf,
                                     bst_vec3 position_m);

#endif
