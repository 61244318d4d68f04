/* "spacecraft" block of a platform. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONFIG_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_CONFIG_H

#include "gimbal/spacecraft/attitude_sensors.h"
#include "gimbal/spacecraft/disturbance.h"
#include "gimbal/spacecraft/pointing_law.h"
#include "gimbal/spacecraft/spacecraft_control.h"
#include "gimbal/spacecraft/wheels.h"

typedef enum bst_spacecraft_type {
    BST_CRAFT_INERTIAL,   /* "inertial": the platform's drift, bias and noise */
    BST_CRAFT_RIGID_BODY, /* "rigid_body" */
} bst_spacecraft_type;

typedef struct bst_spacecraft_mode_config {
    double frequency_hz, damping, coupling[3];
} bst_spacecraft_mode_config;

typedef struct bst_spacecraft_attitude_config {
    int32_t law; /* bst_spacecraft_law */
    double axis[3], second_axis[3];
    double roll_deg;
    double rate_hz;
    double bandwidth_hz, damping, integral_hz;
    double rate_limit_degps, accel_limit_degps2;
} bst_spacecraft_attitude_config;

typedef struct bst_spacecraft_config {
    int32_t type;       /* bst_spacecraft_type */
    int32_t integrator; /* bst_integrator */
    double inertia_kgm2[6];
    double initial_attitude_error_deg[3], initial_rate_degps[3];
    double initial_knowledge_arcsec, filter_warm_up_s;
    bst_config_list wheels, modes, star_trackers;
    bst_spacecraft_gyro_config gyro;
    bst_disturbance_config disturbances;
    bst_spacecraft_attitude_config attitude;
} bst_spacecraft_config;

extern const bst_config_desc bst_spacecraft_config_table[];

/* Reaction wheels of a configuration; the default set if none are given.
 *
 * Returned:  *count  number of wheels
 *            the array, which belongs to the configuration or is constant */
const bst_wheel_config *bst_spacecraft_wheels(const bst_spacecraft_config *config, int *count);

/* Star trackers of a configuration; the default pair if none are given.
 *
 * Returned:  *count  number of trackers
 *            the array, which belongs to the configuration or is constant */
const bst_spacecraft_star_tracker_config *bst_spacecraft_trackers(
    const bst_spacecraft_config *config, int *count);

/* Attitude controller parameters of a configuration. */
bst_spacecraft_attitude_control_spec bst_spacecraft_attitude_control_of(
    const bst_spacecraft_config *config);

#endif
