/* Exports positions and velocities from element sets by SGP4. */
#ifndef BST_EXPORT_EXPORT_STATES_H
#define BST_EXPORT_EXPORT_STATES_H

#include <stdbool.h>

#include "sim/astro/time.h"

enum { BST_EXPORT_STATES_TEME, BST_EXPORT_STATES_GCRF };
enum { BST_EXPORT_STATES_CSV, BST_EXPORT_STATES_OEM, BST_EXPORT_STATES_CZML };

/* Steps are whole microseconds: times are ticks, and rounding does not accumulate. */
enum { BST_EXPORT_STATES_TICKS_PER_SECOND = 1000000 };

typedef struct bst_export_states_request {
    const char *elements; /* file of element sets */
    const char *output;   /* NULL: the standard output */
    const char *eop_path; /* Earth orientation; NULL: built-in */
    int norad;            /* 0: all */
    int frame, format;    /* BST_EXPORT_STATES_... */
    int gravity, mode;    /* bst_sgp4_gravity, bst_sgp4_mode */
    bst_time start;
    int64_t step_ticks, rows;
    int time_digits; /* decimals of the seconds */
} bst_export_states_request;

/* Writes the states of all satellites, each from its element set with the epoch nearest to the
 * start. *complete: SGP4 reached the last row of all. Errors of reading and writing, and times
 * outside the Earth orientation data. */
bst_status bst_export_states(bst_ctx *ctx, const bst_export_states_request *request,
                             bool *complete) BST_MUST_CHECK;

#endif
