/* Image of one star along the path of the line of sight, with its derivatives. */
#ifndef BST_PROCESS_TWIN_STAR_IMAGE_H
#define BST_PROCESS_TWIN_STAR_IMAGE_H

#include "sim/process/twin/twin_model.h"

/* A time of the quadrature over the exposure. */
typedef struct bst_twin_node {
    double t, weight; /* weights sum to 1 */
    bst_quat q_cam_from_gcrf;
    int first[2]; /* splines of x and y; of z */
    double basis[2][BST_TWIN_SUPPORT];
} bst_twin_node;

/* Two quadratures: for the narrow Gaussian of the PSF and, coarser, for the wide one. */
typedef struct bst_twin_nodes {
    bst_twin_node *node[2];
    int count[2];
} bst_twin_nodes;

/* Makes the quadratures: Gauss's rule with three nodes on parts of the exposure in which the
 * fastest motion is 2 px (narrow) and 5 px (wide).
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_twin_nodes_free */
bst_status bst_twin_nodes_create(bst_ctx *ctx, const bst_twin_model *model,
                                 bst_twin_nodes *out) BST_MUST_CHECK;
/* Frees the quadratures and clears the struct, which belongs to the caller. */
void bst_twin_nodes_free(bst_twin_nodes *nodes);

/* Place of a star at a node, and its derivatives. */
typedef struct bst_twin_place {
    float x_px, y_px;   /* far outside if it is not in front of the camera */
    float dx[3], dy[3]; /* by rotation about the camera's axes, px/rad */
} bst_twin_place;

/* Places of a star at the nodes of a quadrature.
 *
 * Returned:  places  [nodes->count[component]] */
void bst_twin_star_places(const bst_twin_model *model, const bst_twin_nodes *nodes, int component,
                          bst_vec3 apparent, bst_twin_place *places);

/* Gaussian with standard deviation sigma_px, integrated over pixels in a row. */
enum { BST_TWIN_PROFILE = 64 };
typedef struct bst_twin_profile {
    int first, count; /* pixels */
    double value[BST_TWIN_PROFILE];
    double slope[BST_TWIN_PROFILE]; /* by the place, 1/px */
    double width[BST_TWIN_PROFILE]; /* by the logarithm of sigma_px */
} bst_twin_profile;

/* Half width of the Gaussian that is drawn, standard deviations. */
#define BST_TWIN_REACH 4.5

/* Profile of a Gaussian at x_px on pixels from `low` to below `high`, to BST_TWIN_REACH sigma_px.
 */
void bst_twin_profile_at(double x_px, double sigma_px, int low, int high, bst_twin_profile *out);

/* Standard deviation of a Gaussian of the PSF, 0 narrow, 1 wide. */
static inline double bst_twin_sigma_px(const bst_twin_psf *psf, int component) {
    return component == 0 ? psf->sigma_px : bst_twin_psf_wide_px(psf);
}
/* Share of a Gaussian in the light. */
static inline double bst_twin_share(const bst_twin_psf *psf, int component) {
    return component == 0 ? 1.0 - psf->wide : psf->wide;
}

#endif
