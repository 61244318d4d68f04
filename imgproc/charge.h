/* Candidates that are charge instead of light: part of locate.c. */
#ifndef BST_IMGPROC_CHARGE_H
#define BST_IMGPROC_CHARGE_H

#include "imgproc/locate.h"

/* SNR from which there is a source beside charge. */
#define BST_CHARGE_LIGHT_SNR 4.0

/* Whether a candidate is charge and nothing else. */
static inline bool bst_charge_is(const bst_found *found) {
    return found->label == BST_LABEL_HOT_PIXEL || found->label == BST_LABEL_HIT;
}

/* Charge about every candidate, and then off all pixels that hold it: one candidate's must not hide
 * from another. Fills l->charged and each candidate's `charge`. */
void bst_charge_remove(bst_locator *l, const bst_locate_frame *f);

/* SNR of what the pixels without charge show of a point (or streak, locally) there. */
double bst_charge_light_beside(const bst_locate_frame *f, const bst_found *found);

/* Whether the fit to the pixels without charge shows no source: too little light, or light that the
 * PSF does not explain. */
bool bst_charge_is_alone(const bst_found *found);

/* Says that a candidate is charge and nothing else. */
void bst_charge_take(bst_found *found);

#endif
