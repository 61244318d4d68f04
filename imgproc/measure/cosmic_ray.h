/* Charge among the candidates that are being located: finds it, takes it off the signal, and says
 * which candidates are nothing else. */
#ifndef BST_IMGPROC_MEASURE_COSMIC_RAY_H
#define BST_IMGPROC_MEASURE_COSMIC_RAY_H

#include "imgproc/measure/locate.h"

/* Beside charge, from here there is a source as well. */
#define BST_CHARGE_LIGHT_SNR 4.0
#define BST_FWHM_PER_SIGMA 2.3548200450309493

/* Whether a label says charge instead of light. */
static inline bool bst_cosmic_ray_label(int32_t label) {
    return label == BST_LABEL_HOT_PIXEL || label == BST_LABEL_HIT;
}

/* Charge about every candidate (bst_imgproc_found.charge), and then off all pixels that hold it:
 * one candidate's must not hide from another. */
void bst_cosmic_ray_remove(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* SNR of what the pixels without charge show of a point (or streak, locally) there. */
double bst_cosmic_ray_light(const bst_locate_frame *frame, const bst_imgproc_found *found);

/* Says that a candidate is charge and nothing else. */
void bst_cosmic_ray_take(bst_imgproc_found *found);

/* Whether the fit to the pixels without charge shows no source: too little light, or light that the
 * PSF does not explain. */
bool bst_cosmic_ray_alone(const bst_imgproc_found *found);

/* Whether charge was taken off in a stamp; width: of the frame. */
bool bst_cosmic_ray_in(const bst_imgproc_locator *locator, int width,
                       const bst_imgproc_stamp *stamp);

#endif
