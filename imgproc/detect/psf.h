/* Image model of a star: pixel-integrated Gaussian PSF, at rest or smeared along a path. */
#ifndef BST_IMGPROC_DETECT_PSF_H
#define BST_IMGPROC_DETECT_PSF_H

enum {
    BST_PSF_TABLE_PER_SIGMA = 64,
    BST_PSF_REACH_SIGMA = 6,
    BST_PSF_TABLE_SIZE = 2 * BST_PSF_REACH_SIGMA * BST_PSF_TABLE_PER_SIGMA + 1,
    BST_PSF_MAX_NODES = 96,
    BST_PSF_MAX_SIDE = 192, /* largest side of a stamp, px */
};

/* Tables of the normal distribution and of Gauss-Legendre rules of 1 to BST_PSF_MAX_NODES nodes. */
typedef struct bst_imgproc_gauss {
    double cdf[BST_PSF_TABLE_SIZE], pdf[BST_PSF_TABLE_SIZE];
    double node[BST_PSF_MAX_NODES * (BST_PSF_MAX_NODES + 1) / 2];   /* in [-1/2, 1/2] */
    double weight[BST_PSF_MAX_NODES * (BST_PSF_MAX_NODES + 1) / 2]; /* sum 1 */
} bst_imgproc_gauss;

/* Position, smear path and width of a source of unit flux. */
typedef struct bst_imgproc_shape {
    double x_px, y_px;           /* centroid */
    double dx_px, dy_px;         /* path during the exposure; 0, 0: at rest */
    double bend_x_px, bend_y_px; /* of the path: coefficient of (3 u^2 - 1) / 2, u from -1 to 1 */
    double sigma_px;
} bst_imgproc_shape;

/* Second moments of the smear path alone, px^2: variance along x, covariance, variance along y. */
void bst_imgproc_shape_path_variance(const bst_imgproc_shape *shape, double out[3]);

/* Rectangle of pixels (postage stamp) [height][width] whose first pixel is (x0, y0). */
typedef struct bst_imgproc_stamp {
    int x0, y0, width, height;
} bst_imgproc_stamp;

/* Fills the tables of the normal distribution and of Gauss-Legendre rules. Any thread. */
void bst_imgproc_gauss_init(bst_imgproc_gauss *psf);

/* Renders a source on a stamp: share of its light in each pixel, and derivatives by x, y and
 * sigma^2 (half the Laplacian, by the heat equation), each [height][width].
 *
 * The path is quadratic in time. It is integrated by a Gauss-Legendre rule with an error below 1e-5
 * of the peak. Light beyond 6 sigma is neglected. Sides of the stamp are at most BST_PSF_MAX_SIDE.
 */
void bst_imgproc_gauss_render(const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                              const bst_imgproc_stamp *stamp, double *share, double *by_x,
                              double *by_y, double *by_variance);

/* Pixel-integrated Gaussian along one axis about `centre` on pixels 0 to side - 1 (side at most
 * BST_PSF_MAX_SIDE), with first and second derivative by the centre; 0 beyond 6 sigma. */
void bst_imgproc_gauss_profile(const bst_imgproc_gauss *psf, double centre, double sigma, int side,
                               double *share, double *slope, double *curvature);

#endif
