/* Fixed-pattern noise of a detector: maps and vectors that are the same in every frame. */
#ifndef BST_SCENEGEN_DETECTOR_FIXED_PATTERN_NOISE_H
#define BST_SCENEGEN_DETECTOR_FIXED_PATTERN_NOISE_H

#include <stdint.h>

#include "boresight/camera.h"
#include "boresight/rng.h"
#include "sim/core/parallel.h"

/* True if pixels differ in response: PRNU, a map, dead pixels, bad columns, shielded edges or
 * overscan. */
bool bst_fixed_pattern_noise_has_gain(const bst_camera *camera);
/* True if pixels differ in dark current: DSNU, a map, hot pixels, or overscan. */
bool bst_fixed_pattern_noise_has_dark(const bst_camera *camera);

/* Pixel response map (PRNU), [height][stride], stride >= width: 1 + prnu_rms z, at least 0, or
 * prnu_map; 0 in dead pixels, bad columns, shielded edges and overscan. Drawn by the threads of
 * pool (NULL: the caller's): the same bits for any number of them. */
bst_status bst_fixed_pattern_noise_gain(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                        bst_parallel *pool, int stride, float *gain) BST_MUST_CHECK;

/* Dark current map (DSNU) at the detector's temperature, e-/s, [height][stride]: log-normal with
 * mean dark_current_e_per_s and relative RMS dsnu_rms, or dark_map; plus hot pixels, log-normal
 * about their median; 0 in the overscan. Threads as for the response. */
bst_status bst_fixed_pattern_noise_dark(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                        bst_parallel *pool, int stride, float *dark) BST_MUST_CHECK;

/* Fixed offsets of `count` columns or rows ("columns", "rows"), DN. */
void bst_fixed_pattern_noise_offsets(const bst_camera *camera, bst_rng_key key, const char *which,
                                     int count, float *offsets);

/* Output code of each of the converter's 2^bits digital numbers: square-root companding or table.
 *
 * Returned:  codes  [2^bits]. Square root: code = floor(C sqrt(dn / D) + 1/2), C and D the highest
 *                   code and number */
bst_status bst_fixed_pattern_noise_codes(bst_ctx *ctx, const bst_camera *camera,
                                         uint16_t *codes) BST_MUST_CHECK;

#endif
