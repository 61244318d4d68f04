/* Attitude of a satellite's body: laws that follow from its orbit and the Sun, rotation, tables. */
#ifndef BST_SATELLITE_BODY_ATTITUDE_H
#define BST_SATELLITE_BODY_ATTITUDE_H

#include "boresight/config.h"
#include "boresight/vec.h"
#include "sim/satellite/attitude_table.h"
#include "sim/satellite/commanded_attitude.h"

enum {
    BST_ATTITUDE_NADIR,
    BST_ATTITUDE_NADIR_SUN,
    BST_ATTITUDE_VELOCITY,
    BST_ATTITUDE_SUN,
    BST_ATTITUDE_INERTIAL,
    BST_ATTITUDE_SPIN,
    BST_ATTITUDE_TUMBLE,
    BST_ATTITUDE_TABLE
};

/* Torques on a body of the law tumble. */
typedef struct bst_attitude_torques {
    bool gravity_gradient, solar_pressure, drag;
    double tolerance_rad;
} bst_attitude_torques;

/* One phase of an object's attitude. */
typedef struct bst_attitude_config {
    double from_s;
    int32_t law; /* BST_ATTITUDE_... */
    double rotation_deg[3];
    double quaternion[4]; /* q_body_from_gcrf at from_s; all zero: not given */
    double rate_body_deg_per_s[3];
    double inertia_kg_m2[3];
    bst_attitude_torques torques;
    char file[512];
    char object[64]; /* of the file */
} bst_attitude_config;

extern const bst_config_desc bst_attitude_config_table[];

/* State of a body, GCRF. */
typedef struct bst_attitude_state {
    bst_vec3 position_m, velocity_mps; /* geocentric */
    bst_vec3 sun;                      /* unit: to the Sun */
    double seconds;                    /* after the epoch */
} bst_attitude_state;

/* The phases of an object's attitude; immutable after the last bst_body_attitude_start. */
typedef struct bst_body_attitude bst_body_attitude;

/* Prepares the phases.
 *
 * Given:     phases  bst_attitude_config, from_s ascending; an empty list: nadir
 *            source  of attitudes from files
 * Returned:  *out  the attitude; NULL on error
 * Errors:    BST_ERR_CONFIG with the key below `attitude`, BST_ERR_MEMORY
 * Ownership: free *out with bst_body_attitude_free */
bst_status bst_body_attitude_create(bst_ctx *ctx, const bst_config_list *phases,
                                    const bst_attitude_source *source,
                                    bst_body_attitude **out) BST_MUST_CHECK;
/* Frees an attitude; NULL is allowed. */
void bst_body_attitude_free(bst_body_attitude *attitude);

/* Accepts commands (commanded_attitude.h), which take precedence over the phases from the first one
 * on. BST_ERR_MEMORY. */
bst_status bst_body_attitude_accept(bst_ctx *ctx, bst_body_attitude *attitude) BST_MUST_CHECK;
/* The ring of commands of an attitude; NULL: it accepts none. It belongs to the attitude; threads
 * may add to it while others read the attitude. */
bst_commanded_attitude *bst_body_attitude_commands(const bst_body_attitude *attitude);

/* Torque about the centre of mass in a phase, N m, body axes, at `seconds` after the epoch; false:
 * unknown then. It depends on its arguments alone; several threads may call it. */
typedef bool (*bst_body_torque_fn)(void *user, const bst_attitude_config *phase, double seconds,
                                   bst_quat q_body_from_gcrf, bst_vec3 *torque_nm);
/* True if a phase has torques; bst_body_attitude_set_torque is then required. */
bool bst_body_attitude_has_torques(const bst_body_attitude *attitude);
/* Sets the source of torques, before all calls that follow.
 *
 * Given:     torque, user  outlive the attitude
 * Errors:    BST_ERR_MEMORY */
bst_status bst_body_attitude_set_torque(bst_ctx *ctx, bst_body_attitude *attitude,
                                        bst_body_torque_fn torque, void *user) BST_MUST_CHECK;

/* Time at which the next phase starts whose attitude continues that of the phase before (spin or
 * tumble without quaternion), s.
 *
 * Given:     *phase  0 first, then as returned
 * Returned:  false: no more; else *phase and *seconds for bst_body_attitude_start */
bool bst_body_attitude_next_start(const bst_body_attitude *attitude, int *phase, double *seconds);

/* Sets the attitude at which a phase starts, from the body's state at that time. */
void bst_body_attitude_start(bst_body_attitude *attitude, int phase,
                             const bst_attitude_state *state);

/* Attitude at a time.
 *
 * Given:     state  the body's state then
 * Returned:  q_body_from_gcrf
 * Notes:     nadir: z to the Earth's centre, y against the orbit's normal, x forward (the axes of
 *            CCSDS "LVLH"). nadir_sun: z to the Earth's centre, the Sun in the half plane of +x.
 *            velocity: x forward, z as close to the Earth's centre as possible. sun: z to the Sun,
 *            x as close to the celestial pole as possible. rotation_deg turns the body from there
 *            about its x, then y, then z axis. */
bst_quat bst_body_attitude_at(const bst_body_attitude *attitude, const bst_attitude_state *state);

/* Largest angular rate of a phase about a time, rad/s, without that of the orbit; under torques,
 * from the rate at that time. */
double bst_body_attitude_rate_radps(const bst_body_attitude *attitude, double seconds);

#endif
