/* Positions and velocities from element sets, by SGP4. */
#ifndef BST_EXPORT_EXPORT_STATES_H
#define BST_EXPORT_EXPORT_STATES_H

#include <stdbool.h>

#include "sim/astro/time.h"

enum { BST_EXPORT_STATES_TEME, BST_EXPORT_STATES_GCRF };
enum { BST_EXPORT_STATES_CSV, BST_EXPORT_STATES_OEM, BST_EXPORT_STATES_CZML };

/* Steps are whole microseconds, so that times are ticks and nothing accumulates. */
enum { BST_EXPORT_STATES_TICKS_PER_SECOND = 1000000 };

typedef struct bst_export_states_request {
    const char *elements; /* file of element sets */
    const char *output;   /* NULL: the standard output */
    const char *eop_path; /* Earth orientation; NULL: the program's own */
    int norad;            /* 0: all */
    int frame, format;    /* BST_EXPORT_STATES_... */
    int gravity, mode;    /* bst_sgp4_gravity, bst_sgp4_mode */
    bst_time start;
    int64_t step_ticks, rows;
    int time_digits; /* of seconds */
} bst_export_states_request;

/* Writes the states of all satellites, of several sets of one satellite those of the set whose
 * epoch is nearest to the start. *complete: whether SGP4 reached the last row of each. Errors: what
 * reading and writing fail with, and times that the Earth orientation does not cover. */
bst_status bst_export_states(bst_ctx *ctx, const bst_export_states_request *request,
                             bool *complete) BST_MUST_CHECK;

#endif
