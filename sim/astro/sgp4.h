/* SGP4/SDP4 analytic orbit propagation. */
#ifndef BST_ASTRO_SGP4_H
#define BST_ASTRO_SGP4_H

#include "sim/astro/tle.h"

typedef enum bst_sgp4_gravity { BST_SGP4_WGS72, BST_SGP4_WGS84 } bst_sgp4_gravity;
typedef enum bst_sgp4_mode {
    BST_SGP4_IMPROVED,
    BST_SGP4_AFSPC
} bst_sgp4_mode; /* opsmode 'i' and 'a' */

/* The error codes of the published reference (Vallado et al., AIAA 2006-6753). */
typedef enum bst_sgp4_error {
    BST_SGP4_OK = 0,
    BST_SGP4_MEAN_ECCENTRICITY = 1,
    BST_SGP4_MEAN_MOTION = 2,
    BST_SGP4_PERTURBED_ECCENTRICITY = 3,
    BST_SGP4_SEMI_LATUS_RECTUM = 4,
    BST_SGP4_DECAYED = 6
} bst_sgp4_error;

/* One initialised satellite. Plain data; the fields are the model's own and private to sgp4.c. */
typedef struct bst_sgp4 bst_sgp4;

/* Makes a propagator. Returns BST_ERR_NUMERIC with the code in the message for elements that the
 * model refuses. */
bst_status bst_sgp4_create(bst_ctx *ctx, const bst_elements *elements, bst_sgp4_gravity gravity,
                           bst_sgp4_mode mode, bst_sgp4 **out) BST_MUST_CHECK;
void bst_sgp4_free(bst_sgp4 *sgp4);

/* State at `minutes` after the element epoch: TEME, km and km/s. Pure: no state is kept between
 * calls, so any order of times gives the same bits and threads may share one propagator.
 * position/velocity are still written on BST_SGP4_DECAYED, else untouched on error. */
bst_sgp4_error bst_sgp4_propagate(const bst_sgp4 *sgp4, double minutes, double position_teme_km[3],
                                  double velocity_teme_kmps[3]);

/* What an error code means, in words. */
const char *bst_sgp4_error_text(bst_sgp4_error error);

#endif
