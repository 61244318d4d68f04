/* Defects of a recorded frame: single pixels whose level no light explains. */
#ifndef BST_PROCESS_TWIN_TWIN_DEFECTS_H
#define BST_PROCESS_TWIN_TWIN_DEFECTS_H

#include "sim/process/twin/twin_internal.h"

/* Largest median residual of the eight neighbours of a defect, over its own. Stars have twice as
 * much there.
 *
 * Given:     psf  of the stars; its narrow Gaussian counts, integrated over the pixels */
double bst_twin_defect_neighbours(const bst_twin_psf *psf);

/* Finds pixels that are more than 5 standard deviations off the model, and sharper than the PSF.
 * The variance is the noise, the shot noise of the stars, and the error of the PSF's form.
 *
 * Returned:  twin->defects, twin->defect_count; their level_e is the residual
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_find_defects(bst_ctx *ctx, bst_twin *twin) BST_MUST_CHECK;

/* Fits the model with the level of each defect as a free value: its pixel has no other information,
 * so that this is a fit without these pixels.
 *
 * Given:     fit  of twin->model to its data_e
 * Returned:  level_e of the defects
 * Errors:    BST_ERR_MEMORY, those of the fit */
bst_status bst_twin_fit_defects(bst_ctx *ctx, bst_twin *twin,
                                bst_status (*fit)(bst_ctx *ctx, bst_twin *twin)) BST_MUST_CHECK;

/* Dark signal of the pixels in the exposure: a uniform one with the levels of the defects.
 *
 * Returned:  dark_e  [height][width], at least 0: levels below -uniform_e are cut */
void bst_twin_defect_map(const bst_twin *twin, double uniform_e, float *dark_e);

#endif
