/* Images as short sums of products of a function of the row and one of the column. */
#ifndef BST_IMGPROC_DETECT_LOW_RANK_H
#define BST_IMGPROC_DETECT_LOW_RANK_H

/* items[p][j][i]: `planes` images of side x side. */
typedef struct bst_low_rank_images {
    const double *items;
    int planes, side;
} bst_low_rank_images;

/* Finds up to `most` functions of the row, down[t][j], orthonormal and common to all images, that
 * leave the least of the images' squares:
 *     images[p][j][i] ~ sum over t of down[t][j] across[p][t][i].
 * They are the first left singular vectors of the images side by side, by subspace iteration
 * (Golub and Van Loan, Matrix Computations, 4th ed., 8.2.4). Returns how many are needed for no
 * image to miss more than `tolerance` of its square, `most` at the most; across has room for `most`
 * rows a plane and is [planes][returned][side] then. work: room for most * side. */
int bst_low_rank(const bst_low_rank_images *images, int most, double tolerance, double *down,
                 double *across, double *work);

#endif
