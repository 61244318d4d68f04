/* The options of boresight orbit. */
#ifndef BST_ANALYSIS_ORBIT_ORBIT_OPTIONS_H
#define BST_ANALYSIS_ORBIT_ORBIT_OPTIONS_H

#include "sim/analysis/orbit/orbit_determination.h"
#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_orbit_command {
    bst_orbit_determination determination;
    bool help;
} bst_orbit_command;

/* Request without any option given. */
#define BST_ORBIT_COMMAND_DEFAULTS                     \
    {                                                  \
        .determination = {                             \
            .reject_chi2 = 30.0,                       \
            .radius_m = -1.0,                          \
            .aberration = BST_ORBIT_ABERRATION_DEFAULT \
        }                                              \
    }

/* Table of the options, with offsets in a bst_orbit_command. */
extern const bst_option bst_orbit_options[];

#endif
