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

enum { BST_PATH_KNOTS = 65 };

/* What is left of a path beside its mean, its uniform motion and its bend: at knots of equal steps
 * in time from the start of the exposure to its end, linear between them. */
typedef struct bst_path_departure {
    double x_px[BST_PATH_KNOTS], y_px[BST_PATH_KNOTS];
    double speed_px;    /* the largest speed, px per exposure */
    double reach_px[2]; /* the largest |x| and |y| */
    double variance[3]; /* mean x^2, x y, y^2 over the exposure */
} bst_path_departure;

/* Position, smear path and width of a source of unit flux. */
typedef struct bst_imgproc_shape {
    double x_px, y_px;           /* centroid */
    double dx_px, dy_px;         /* path during the exposure; 0, 0: at rest */
    double bend_x_px, bend_y_px; /* of the path: coefficient of (3 u^2 - 1) / 2, u from -1 to 1 */
    double sigma_px;
    const bst_path_departure *departure; /* lent; NULL: none */
} bst_imgproc_shape;

/* Adds the departure at the time `node`, from -1/2 to 1/2 over the exposure, to a place. */
static inline void bst_path_departure_add(const bst_path_departure *d, double node, double *x_px,
                                          double *y_px) {
    double at = (node + 0.5) * (BST_PATH_KNOTS - 1);
    int k = at < BST_PATH_KNOTS - 2 ? (int)at : BST_PATH_KNOTS - 2;
    double part = at - k;
    *x_px += d->x_px[k] + part * (d->x_px[k + 1] - d->x_px[k]);
    *y_px += d->y_px[k] + part * (d->y_px[k + 1] - d->y_px[k]);
}

/* Place of the source at the time `node`, and the factor of its bend there. */
static inline void bst_imgproc_shape_at(const bst_imgproc_shape *s, double node, double *x_px,
                                        double *y_px, double *bow) {
    *bow = 6.0 * node * node - 0.5;
    *x_px = s->x_px + node * s->dx_px + *bow * s->bend_x_px;
    *y_px = s->y_px + node * s->dy_px + *bow * s->bend_y_px;
    if (s->departure) {
        bst_path_departure_add(s->departure, node, x_px, y_px);
    }
}

/* Length of a path as long as the exposure at the largest speed on it, px. */
double bst_imgproc_shape_speed(const bst_imgproc_shape *shape);

/* Half of the extent of the path along x and y, at most, px. */
void bst_imgproc_shape_reach(const bst_imgproc_shape *shape, double *x_px, double *y_px);

/* Sets speed, reach and variance of a departure from its knots. */
void bst_path_departure_finish(bst_path_departure *departure);

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
 * The path is quadratic in time but for its departure. It is integrated by a Gauss-Legendre rule
 * with an error below 1e-5 of the peak. Light beyond 6 sigma is neglected. Sides of the stamp are
 * at most BST_PSF_MAX_SIDE.
 */
void bst_imgproc_gauss_render(const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                              const bst_imgproc_stamp *stamp, double *share, double *by_x,
                              double *by_y, double *by_variance);

/* Pixel-integrated Gaussian along one axis about `centre` on pixels 0 to side - 1 (side at most
 * BST_PSF_MAX_SIDE), with first and second derivative by the centre; 0 beyond 6 sigma. */
void bst_imgproc_gauss_profile(const bst_imgproc_gauss *psf, double centre, double sigma, int side,
                               double *share, double *slope, double *curvature);

#endif
