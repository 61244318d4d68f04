/* Pointing laws: wanted attitude of the spacecraft's body, from onboard knowledge. */
#ifndef BST_GIMBAL_SPACECRAFT_POINTING_LAW_H
#define BST_GIMBAL_SPACECRAFT_POINTING_LAW_H

#include <stdbool.h>

#include "boresight/vec.h"

typedef enum bst_spacecraft_law {
    BST_LAW_INERTIAL, /* "inertial": the attitude of the epoch */
    BST_LAW_NADIR,    /* "nadir": axis to the Earth's centre, second axis along the velocity */
    BST_LAW_SUN,      /* "sun": axis to the Sun, second axis close to its nominal direction */
    BST_LAW_TARGET,   /* "target": axis to the cue's apparent direction, second axis as for "sun" */
    BST_LAW_FREE,     /* "free": no control */
} bst_spacecraft_law;

extern const char *const bst_law_names[];

typedef struct bst_pointing_law {
    bst_spacecraft_law law;
    bst_quat q_nominal;         /* body from GCRF at the epoch */
    bst_vec3 axis, second_axis; /* body axes, unit, not parallel */
    double roll_rad;            /* additional roll of the body about `axis` */
} bst_pointing_law;

/* Onboard estimates; GCRF. */
typedef struct bst_spacecraft_law_inputs {
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 sun_m;                    /* from the spacecraft */
    bst_vec3 target;                   /* apparent direction; zero: unknown */
} bst_spacecraft_law_inputs;

/* Wanted q_body_from_gcrf of a law. The axis points exactly, the second axis as closely as possible
 * (arbitrary if both directions coincide). `target` without a target: nominal. */
bst_quat bst_pointing_law_attitude(const bst_pointing_law *law,
                                   const bst_spacecraft_law_inputs *inputs);

/* Wanted attitude motion; rates in the axes of q. */
typedef struct bst_spacecraft_attitude_reference {
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_radps, accel_radps2;
} bst_spacecraft_attitude_reference;

/* Reference motion through four attitudes step_s apart, at `place` steps after the first: cubic
 * interpolation of the rotation vectors relative to the second. Rates include the first term of the
 * exponential's derivative; their error is the square of the rotation between nodes (0.01 % at 2
 * deg per step). If neighbours differ by more than BST_REFERENCE_JUMP_RAD, the nearest one is held
 * at rest. */
bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_at(const bst_quat node[4],
                                                                       double step_s, double place);

#define BST_REFERENCE_JUMP_RAD 0.3

/* Reference motion with the body rolled (angle, rate) about one of its axes. */
bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_rolled(
    const bst_spacecraft_attitude_reference *reference, bst_vec3 axis, double roll_rad,
    double roll_radps);

#endif
