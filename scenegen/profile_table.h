/* The table of pixel-integrated Gaussian profiles that stamps are read from. */
#ifndef BST_SCENEGEN_PROFILE_TABLE_H
#define BST_SCENEGEN_PROFILE_TABLE_H

#include "sim/device/device.h"

/* Share of the peak that linear interpolation between the phases misses: 1 / (8 phases^2 sigma^2)
 * on each axis. */
double bst_profile_error(double sigma_px, int phases);

/* Phases with which a source that nearly fills the pixels' wells is right to a third of the
 * tolerance; for fainter ones the error is less. */
int bst_profile_phases(double sigma_px, double tolerance_sigma, double full_well_e);

/* Makes the buffer [BST_WIDTHS + 1][phases + 1][taps with BST_PROFILE_PAD zeros on either side]:
 * shares of a profile centred phase / phases right of a pixel. BST_ERR_MEMORY, BST_ERR_DEVICE. */
bst_status bst_profile_table(bst_ctx *ctx, cl_context context, double sigma_px, int taps,
                             int phases, cl_mem *out) BST_MUST_CHECK;

#endif
