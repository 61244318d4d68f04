/* What moves a spacecraft near the Earth: gravity, Sun and Moon, sunlight, air. */
#ifndef BST_ASTRO_FORCES_H
#define BST_ASTRO_FORCES_H

#include <stdbool.h>

#include "sim/astro/frames.h"
#include "sim/astro/gravity.h"

#define BST_SUN_GM_M3PS2 1.32712440018e20 /* DE405 */
#define BST_MOON_GM_M3PS2 4.902800076e12  /* DE405 */
/* Of sunlight on a black surface at 1 au: nominal solar irradiance (IAU 2015), 1361 W/m^2, over c.
 */
#define BST_SUNLIGHT_PRESSURE_PA (1361.0 / 299792458.0)

/* A sphere as sunlight and air meet it. */
typedef struct bst_astro_spacecraft {
    double mass_kg;
    double drag_area_m2, drag_coefficient;
    double light_area_m2, light_coefficient; /* 1: black or a mirror ball, 2: a mirror facing it */
} bst_astro_spacecraft;

typedef struct bst_force_model {
    const bst_gravity *gravity; /* borrowed */
    /* Borrowed; NULL: the Earth does not turn, its axes are those of GCRF, and the air stands still
     */
    const bst_astro_eop *eop;
    bool sun, moon;                  /* as point masses */
    bool solar_pressure;             /* with the Earth's shadow */
    bool drag;                       /* in air that turns with the Earth */
    double density_scale;            /* times bst_atmosphere_density_kgpm3 */
    bst_astro_spacecraft spacecraft; /* used by solar_pressure and drag */
} bst_force_model;

/* A force model at work from one epoch on. One user (thread) at a time; memory is fixed. Values
 * depend on the instant and state alone, never on the order of the calls. */
typedef struct bst_forces bst_forces;

/* BST_ERR_ARGUMENT for a mass that is not above 0 or areas and coefficients below 0, where they
 * count. */
bst_status bst_forces_create(bst_ctx *ctx, const bst_force_model *model, bst_time epoch,
                             bst_forces **out) BST_MUST_CHECK;
void bst_forces_free(bst_forces *forces); /* NULL allowed */

/* Acceleration (m/s^2, GCRF) at a geocentric position and velocity (GCRF), `seconds` after the
 * epoch. Harmonics turn with the Earth (rotation worked out every hour, linear in between but for
 * the Earth's own turn: 1e-10 rad); Sun and Moon are worked out every hour, cubic in between (1 m).
 * Sun and Moon: Battin's form of the third-body term, free of cancellation (Battin, An Introduction
 * to the Mathematics and Methods of Astrodynamics, section 8.4). Sunlight: cannonball, times
 * bst_astro_sun_fraction (Montenbruck and Gill 3.75). Drag: Montenbruck and Gill 3.97.
 * Errors: those of bst_astro_eop_at at the full hours on both sides, where the Earth's rotation
 * counts.
 */
bst_status bst_forces_at(bst_ctx *ctx, bst_forces *forces, double seconds, bst_vec3 position_m,
                         bst_vec3 velocity_mps, bst_vec3 *acceleration_mps2) BST_MUST_CHECK;

/* Fraction of the Sun's disc in sight of a position, as the solar pressure takes it; 1 where the
 * model has none. */
double bst_forces_sunlight(bst_forces *forces, double seconds, bst_vec3 position_m);

#endif
