/* Cosmic-ray and hot-pixel charge among the candidates: finds it, masks it in the signal, and
 * decides which candidates consist of charge only. */
#ifndef BST_IMGPROC_MEASURE_COSMIC_RAY_H
#define BST_IMGPROC_MEASURE_COSMIC_RAY_H

#include "imgproc/measure/locate.h"
#include "sim/onboard/discriminate.h"

/* SNR of light beside charge above which there is also a source. */
#define BST_CHARGE_LIGHT_SNR 4.0

/* Finds the charge about every candidate (bst_imgproc_found.charge), then masks all pixels that
 * hold it. All are found before any is masked, so that one candidate's charge cannot hide
 * another's. */
void bst_cosmic_ray_remove(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* SNR of a point, or of the local star streak, in the pixels without charge at a candidate. */
double bst_cosmic_ray_light(const bst_locate_frame *frame, const bst_imgproc_found *found);

/* Labels a candidate as charge only (hot pixel or cosmic ray). */
void bst_cosmic_ray_take(bst_imgproc_found *found);

/* True if the fit to the pixels without charge shows no source: too faint, or inconsistent with the
 * PSF. */
bool bst_cosmic_ray_alone(const bst_imgproc_found *found);

/* True if charge was masked in a stamp.
 *
 * Given:     width  of the frame, px */
bool bst_cosmic_ray_in(const bst_imgproc_locator *locator, int width,
                       const bst_imgproc_stamp *stamp);

#endif
