/* Charge-transfer inefficiency of an image, and the image without it. */
#ifndef BST_ANALYSIS_CHARACTERIZE_TRAP_CORRECTION_H
#define BST_ANALYSIS_CHARACTERIZE_TRAP_CORRECTION_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/detector_config.h"

/* Traps of both directions and the sides that are read first. */
typedef struct bst_trap_model {
    bst_detector_traps_config parallel, serial;
    bool top, right;
} bst_trap_model;

/* Moves the charge of one line of pixels to the output, as kernels/charge_transfer.cl.
 *
 * Given:     first  transfers of the pixel at q, which is read first; the next ones have one more
 *            step   from a pixel to the next in q
 *            q      electrons, changed
 * Reference: Short et al. 2013, MNRAS 430, 3078 */
void bst_trap_pass_line(const bst_detector_traps_config *traps, int first, int count, int64_t step,
                        float *q);

/* Moves the charge of an image to the output, as kernels/charge_transfer.cl.
 *
 * Given:     image  [height][width] electrons */
void bst_trap_model_pass(const bst_trap_model *model, int width, int height, float *image);

/* Replaces an image by that of the charge before it was moved.
 *
 * Given:     image  [height][width] electrons
 *            work   [2][height][width]
 * Notes:     Three turns of the fixed point x + (image - pass(x)); an error of the share e of
 *            deferred charge is e^4 then.
 * Reference: Bristow 2003, STIS ISR 2003-001; Massey et al. 2010, MNRAS 401, 371 */
void bst_trap_model_undo(const bst_trap_model *model, int width, int height, float *image,
                         float *work);

#endif
