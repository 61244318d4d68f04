/* Where the spacecraft's body shall point: laws by name, from what is known on board. */
#ifndef BST_GIMBAL_SPACECRAFT_POINTING_LAW_H
#define BST_GIMBAL_SPACECRAFT_POINTING_LAW_H

#include <stdbool.h>

#include "boresight/vec.h"

typedef enum bst_spacecraft_law {
    BST_LAW_INERTIAL, /* "inertial": the attitude of the epoch */
    BST_LAW_NADIR,    /* "nadir": axis to the Earth's centre, second axis along the velocity */
    BST_LAW_SUN,      /* "sun": axis to the Sun, second axis near to where the nominal has it */
    BST_LAW_TARGET,   /* "target": axis to the cue's apparent place, second axis likewise */
    BST_LAW_FREE,     /* "free": no control */
} bst_spacecraft_law;

extern const char *const bst_law_names[];

typedef struct bst_pointing_law {
    bst_spacecraft_law law;
    bst_quat q_nominal;         /* body from GCRF at the epoch */
    bst_vec3 axis, second_axis; /* body axes, unit, not parallel */
    double roll_rad;            /* a turn of the body about `axis` on top */
} bst_pointing_law;

/* What the onboard side believes; GCRF. */
typedef struct bst_spacecraft_law_inputs {
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 sun_m;                    /* from the spacecraft */
    bst_vec3 target;                   /* apparent direction; zero: not known */
} bst_spacecraft_law_inputs;

/* q_body_from_gcrf that the law wants. The axis points exactly, the second axis as nearly as it can
 * (any way where both directions fall together). `target` without a target: the nominal. */
bst_quat bst_pointing_law_attitude(const bst_pointing_law *law,
                                   const bst_spacecraft_law_inputs *inputs);

/* A wanted motion; rates in the axes of q. */
typedef struct bst_spacecraft_attitude_reference {
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_radps, accel_radps2;
} bst_spacecraft_attitude_reference;

/* The motion through four attitudes step_s apart, at `place` steps after the first: a cubic of the
 * rotation vectors against the second, its rates with the first term of the exponential's
 * derivative: off by the square of the turn between nodes (0.01 % at 2 deg a step). Attitudes that
 * jump by more than BST_REFERENCE_JUMP_RAD between neighbours are no motion: the nearest one holds,
 * at rest. */
bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_at(const bst_quat node[4],
                                                                       double step_s, double place);

#define BST_REFERENCE_JUMP_RAD 0.3

/* The same motion with the body turned by roll (angle, rate) about an axis of it. */
bst_spacecraft_attitude_reference bst_spacecraft_attitude_reference_rolled(
    const bst_spacecraft_attitude_reference *reference, bst_vec3 axis, double roll_rad,
    double roll_radps);

#endif
