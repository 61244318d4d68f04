/* Temperatures of the facets of a satellite, each in balance by itself, and their emission. */
#ifndef BST_SATELLITE_HEAT_H
#define BST_SATELLITE_HEAT_H

#include "sim/satellite/flux.h"

/* Stefan-Boltzmann constant, W/m^2/K^4 (CODATA 2018). */
#define BST_STEFAN_BOLTZMANN 5.670374419e-8

/* What heats a satellite; directions in the body frame. */
typedef struct bst_heat_environment {
    bst_vec3 sun, earth;              /* unit */
    double sunlight_wpm2;             /* at the satellite; 0: in the shadow */
    const bst_earthlight *earthlight; /* NULL: none */
    double earthlight_wpm2;           /* irradiance of the Sun at the Earth */
    double earth_sine;                /* radius of the Earth over the distance of its centre */
    double earth_infrared_wpm2;       /* exitance of the Earth, a sphere that emits evenly */
} bst_heat_environment;

/* View factor of a plane element to a distant sphere: the part of what a diffuse sphere of unit
 * exitance sends that an element of unit area receives.
 *
 * Given:     cosine  of the angle between the element's normal and the sphere's centre
 *            sine    radius over distance of the centre, below 1
 * Returned:  0 to sine^2
 * Reference: Cunningham, NASA TN D-710 (1961), also Howell, A Catalog of Radiation Heat Transfer
 *            Configuration Factors, B-43 */
double bst_heat_sphere_factor(double cosine, double sine);

/* Heat that each facet absorbs.
 *
 * Given:     pose    joints as bst_satellite_pose_set left them; its view 0 is changed
 * Returned:  load_wpm2  [facets] mean over the facet
 * Notes:     sunlight and earthlight times the absorptance, the Earth's infrared times the
 *            emissivity of the material; shadows of parts on parts are those of the Sun and of the
 *            middle of the Earth's light. No conduction, no exchange between facets. */
void bst_heat_loads(bst_satellite_pose *pose, const bst_heat_environment *environment,
                    double *load_wpm2);

/* Temperature at which a surface emits what it absorbs, K; 0 for a surface that does not emit. */
double bst_heat_steady_k(double load_wpm2, double emissivity);

/* Temperature of a surface with heat capacity after a time, in which its load changes linearly.
 *
 * Given:     kelvin      at the start
 *            load_wpm2   [2] at start and end
 *            capacity_jpm2k  above 0
 *            seconds     0 or more
 * Notes:     Runge-Kutta of fourth order with steps of at most a tenth of the time constant */
double bst_heat_after(double kelvin, const double load_wpm2[2], double emissivity,
                      double capacity_jpm2k, double seconds);

enum { BST_EMISSION_BINS = 8 };

/* Thermal emission toward an observer, sorted by temperature. */
typedef struct bst_thermal_emission {
    struct bst_emission_bin {
        double area_m2;   /* projected visible area times emissivity */
        double kelvin;    /* mean, weighted by area */
        double deviation; /* root of the variance, K */
    } bins[BST_EMISSION_BINS];
    int count;
} bst_thermal_emission;

/* Emission of the facets that an observer sees.
 *
 * Given:     pose      its view 0 is changed
 *            observer  unit, body frame
 *            kelvin    [facets]
 * Notes:     the light of a bin is that of half its area at each of kelvin +- deviation, which is
 *            exact to the third moment of its temperatures */
void bst_heat_emission(bst_satellite_pose *pose, bst_vec3 observer, const double *kelvin,
                       bst_thermal_emission *out);

#endif
