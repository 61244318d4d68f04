/* Channel nav_telemetry: onboard navigation: orbit of the spacecraft, Sun and Moon. */
#ifndef BORESIGHT_MESSAGES_NAV_TELEMETRY_H
#define BORESIGHT_MESSAGES_NAV_TELEMETRY_H

#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_NAV_TELEMETRY "nav_telemetry"

/* nav_telemetry (latest): orbit of the spacecraft by onboard navigation. */
typedef struct bst_nav_telemetry {
    int64_t tick;               /* of validity */
    bst_vec3 position_gcrf_m;   /* geocentric */
    bst_vec3 velocity_gcrf_mps; /* geocentric */
    bst_vec3 velocity_bary_mps; /* relative to the solar-system barycentre, for aberration */
    bst_vec3 sun_m;             /* observer to Sun */
    bst_vec3 moon_m;            /* observer to Moon */
} bst_nav_telemetry;

#endif
