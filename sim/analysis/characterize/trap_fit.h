/* Traps of the detector model that leave the charge trails of a sensor's hot pixels. */
#ifndef BST_ANALYSIS_CHARACTERIZE_TRAP_FIT_H
#define BST_ANALYSIS_CHARACTERIZE_TRAP_FIT_H

#include "boresight/detector_config.h"
#include "sim/analysis/characterize/hot_pixels.h"

/* Conditions under which trails were measured. */
typedef struct bst_trap_fit_input {
    double gain_e_per_dn;
    double background_e; /* of all pixels, at the middle of the sensor */
    int transfers;       /* of the middle row or column */
} bst_trap_fit_input;

/* Fits two species of traps.
 *
 * Given:     trail     measured
 *            parallel  along columns, otherwise rows
 * Returned:  rms of the misfit of profile and classes, in shares of the hot pixels' charge
 * Notes:     The recursion of kernels/charge_transfer.cl for a hot pixel in the middle of a
 *            uniform background is fitted to the profile of the median charge and to the sums of
 *            the four classes of charge. */
double bst_trap_fit(const bst_charge_trail *trail, bool parallel, const bst_trap_fit_input *input,
                    bst_detector_traps_config *out);

#endif
