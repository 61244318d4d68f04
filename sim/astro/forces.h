/* Force model of a spacecraft near the Earth: gravity, Sun, Moon, solar radiation pressure,
 * drag. */
#ifndef BST_ASTRO_FORCES_H
#define BST_ASTRO_FORCES_H

#include <stdbool.h>

#include "sim/astro/bodies.h"
#include "sim/astro/frames.h"
#include "sim/astro/gravity.h"

#define BST_SUN_GM_M3PS2 1.32712440018e20 /* DE405 */
#define BST_MOON_GM_M3PS2 4.902800076e12  /* DE405 */
/* solar radiation pressure on a black surface at 1 au */
#define BST_SUNLIGHT_PRESSURE_PA (BST_SOLAR_IRRADIANCE_WPM2 / BST_LIGHT_SPEED_MPS)

/* Sphere model of a spacecraft for radiation pressure and drag. */
typedef struct bst_astro_spacecraft {
    double mass_kg;
    double drag_area_m2, drag_coefficient;
    double light_area_m2,
        light_coefficient; /* coefficient 1: black or mirror ball; 2: flat mirror facing the Sun */
} bst_astro_spacecraft;

/* Where a spacecraft is, for the forces on its surface. GCRF. */
typedef struct bst_force_state {
    double seconds;                    /* after the epoch */
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 sun;                      /* unit: to the Sun */
} bst_force_state;

/* The surface of a spacecraft with a shape, in place of the areas of the sphere; its functions
 * depend on their arguments alone and may be called by several threads. */
typedef struct bst_force_surface {
    /* Force of sunlight over its pressure on a black surface, m^2. */
    bst_vec3 (*light_area_m2)(void *user, const bst_force_state *state);
    /* Area of the silhouette seen from `ahead` (unit), m^2. */
    double (*drag_area_m2)(void *user, const bst_force_state *state, bst_vec3 ahead);
    void *user;
} bst_force_surface;

typedef struct bst_force_model {
    const bst_gravity *gravity; /* borrowed */
    /* Borrowed; NULL: non-rotating Earth with GCRF axes and resting atmosphere. */
    const bst_astro_eop *eop;
    bool sun, moon;                   /* third bodies as point masses */
    bool solar_pressure;              /* with the Earth's shadow */
    bool drag;                        /* in an atmosphere that rotates with the Earth */
    double density_scale;             /* factor on bst_atmosphere_density_kgpm3 */
    bst_astro_spacecraft spacecraft;  /* used by solar_pressure and drag */
    const bst_force_surface *surface; /* borrowed; NULL: the sphere of the spacecraft; else of this
                                         only the mass and the drag coefficient count */
} bst_force_model;

/* A force model with its epoch and caches. One thread at a time; constant memory. Results depend on
 * time and state only, not on the order of calls. */
typedef struct bst_forces bst_forces;

/* Creates a force model. BST_ERR_ARGUMENT: mass not positive, or negative areas and coefficients
 * where they are used. */
bst_status bst_forces_create(bst_ctx *ctx, const bst_force_model *model, bst_time epoch,
                             bst_forces **out) BST_MUST_CHECK;
void bst_forces_free(bst_forces *forces); /* NULL allowed */

/* Acceleration (m/s^2, GCRF) at a geocentric position and velocity (GCRF), `seconds` after the
 * epoch. Harmonics rotate with the Earth (computed every hour, interpolated linearly except for the
 * Earth rotation angle: 1e-10 rad); Sun and Moon are computed every hour, with cubic interpolation
 * (1 m).
 * Sun and Moon: Battin's form of the third-body term, free of cancellation (Battin, An Introduction
 * to the Mathematics and Methods of Astrodynamics, section 8.4). Sunlight: cannonball, times
 * bst_astro_sun_fraction (Montenbruck and Gill 3.75). Drag: Montenbruck and Gill 3.97.
 * Errors: those of bst_astro_eop_at at the full hours on both sides, where the Earth's rotation
 * counts. */
bst_status bst_forces_at(bst_ctx *ctx, bst_forces *forces, double seconds, bst_vec3 position_m,
                         bst_vec3 velocity_mps, bst_vec3 *acceleration_mps2) BST_MUST_CHECK;

/* Visible fraction of the Sun's disc at a position, as used for solar radiation pressure; 1 if the
 * force model has none. */
double bst_forces_sunlight(bst_forces *forces, double seconds, bst_vec3 position_m);

#endif
