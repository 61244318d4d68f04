/* Charge that pixels gather outside the exposure: dark current during read-out, clock-induced
 * charge, light of the amplifier. */
#ifndef BST_SCENEGEN_DETECTOR_READOUT_CHARGE_H
#define BST_SCENEGEN_DETECTOR_READOUT_CHARGE_H

#include "boresight/camera.h"
#include "boresight/rng.h"
#include "sim/core/parallel.h"

/* True if a detector gathers charge outside the exposure. */
bool bst_readout_charge_is_on(const bst_detector_config *d);

/* Mean charge of each pixel that is gathered outside the exposure.
 *
 * Given:     key     random key of the fixed patterns
 *            pool    threads; NULL: the caller's
 *            stride  floats per row of the map, >= width
 * Returned:  map     [height][stride] e-; columns of the overscan have none
 * Errors:    as bst_fixed_pattern_noise_dark; BST_ERR_MEMORY
 * Notes:     A packet of row y passes rows y - 1 to 0 for readout_s / height each, or those above
 *            with output.top. */
bst_status bst_readout_charge_map(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                  bst_parallel *pool, int stride, float *map) BST_MUST_CHECK;

#endif
