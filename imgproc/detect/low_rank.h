/* Low-rank approximation of images by separable terms (row function times column function). */
#ifndef BST_IMGPROC_DETECT_LOW_RANK_H
#define BST_IMGPROC_DETECT_LOW_RANK_H

/* items[p][j][i]: `planes` images of side x side. */
typedef struct bst_low_rank_images {
    const double *items;
    int planes, side;
} bst_low_rank_images;

/* Low-rank approximation common to several images:
 *     images[p][j][i] ~ sum over t of down[t][j] across[p][t][i].
 * The row functions are the first left singular vectors of the images side by side, by subspace
 * iteration.
 *
 * Given:     most       largest number of terms
 *            tolerance  share of an image's energy that may be lost
 *            work       room for most * side
 * Returned:  number of terms needed, at most `most`
 *            down    [t][j]: orthonormal row functions
 *            across  [planes][returned][side]; room for most rows per plane
 * Reference: Golub and Van Loan, Matrix Computations, 4th ed., 8.2.4 */
int bst_low_rank(const bst_low_rank_images *images, int most, double tolerance, double *down,
                 double *across, double *work);

#endif
