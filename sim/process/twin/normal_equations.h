/* Normal equations of a model's fit, summed over the pixels tile by tile. */
#ifndef BST_PROCESS_TWIN_NORMAL_EQUATIONS_H
#define BST_PROCESS_TWIN_NORMAL_EQUATIONS_H

#include "sim/process/twin/star_image.h"

enum { BST_TWIN_PSF = 3 /* ln sigma_px, ln ratio, wide */ };

/* Places of the parameters in the vector; -1: not fitted. */
typedef struct bst_twin_layout {
    int angle[3];  /* first coefficient of x, y, z */
    int log_scale; /* ln of the focal length in pixels */
    int psf, background;
    int flux[BST_TWIN_STARS];  /* of a star */
    int place[BST_TWIN_STARS]; /* x of the star's image; y follows */
    int count;
} bst_twin_layout;

/* Sums over the frame. */
typedef struct bst_twin_sums {
    double *matrix;   /* [count][count], lower triangle; NULL: only the loss */
    double *gradient; /* [count] */
    double loss;
} bst_twin_sums;

/* Layout for what may change. */
void bst_twin_layout_make(const bst_twin_model *model, const bst_twin_freedom *freedom,
                          bst_twin_layout *out);

/* Evaluates the model on all pixels with a value.
 *
 * Given:     layout   NULL: no derivatives, sums->matrix is NULL
 *            stars_e  NULL, or [height][width] for the light of the stars
 *            sums     NULL, or where the sums over the pixels go; allocated by the caller
 * Notes:     the sums do not depend on the number of threads.
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_evaluate(bst_ctx *ctx, const bst_twin_model *model,
                             const bst_twin_layout *layout, bst_parallel *pool, float *stars_e,
                             bst_twin_sums *sums) BST_MUST_CHECK;

/* Limit of Huber's loss, standard deviations of the pixel. */
#define BST_TWIN_HUBER 4.0

#endif
