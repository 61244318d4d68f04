/* The least variances with which place and flux of a smeared source can be measured (Cramer and
 * Rao), tabulated by how far its light stands above the noise and by the length of its streak. */
#ifndef BST_OBSGEN_MODEL_CRLB_TABLE_H
#define BST_OBSGEN_MODEL_CRLB_TABLE_H

#include "boresight/status.h"

enum { BST_BOUND_RATIOS = 25, BST_BOUND_LENGTHS = 11 };

/* Information of a Gaussian of sigma_px, integrated over pixels and drawn along a straight path, on
 * white noise of variance v per pixel and its own shot noise; mean over places in the pixel. For F
 * electrons and r = F / v: of place F r J, of flux J_flux / v. Logarithms of J at ratios r of
 * 10^(-1 + n/4) and at lengths 0, 1, 2, 4, ... 512 sigma. */
typedef struct bst_crlb_table {
    double sigma_px;
    float along[BST_BOUND_LENGTHS][BST_BOUND_RATIOS], across[BST_BOUND_LENGTHS][BST_BOUND_RATIOS],
        flux[BST_BOUND_LENGTHS][BST_BOUND_RATIOS];
    float squared[BST_BOUND_LENGTHS]; /* log of sum p^2 */
} bst_crlb_table;

/* sigma_px without the pixel's width, at least 0.2. */
void bst_crlb_table_init(bst_crlb_table *bound, double sigma_px);

typedef struct bst_crlb_table_at {
    double var_along_px2, var_across_px2, flux_variance;
    double norm; /* sqrt(sum p^2): the SNR on white noise is F norm / sqrt(v) */
} bst_crlb_table_at;

/* flux_e > 0, noise_e > 0 (sqrt v). */
bst_crlb_table_at bst_crlb_table_of(const bst_crlb_table *bound, double flux_e, double noise_e,
                                    double length_px);
/* The same for a Gaussian that is `wider` times as wide as the tables', with the pixel's own width:
 * lengths in units of it, a pixel small beside it. */
bst_crlb_table_at bst_crlb_table_wider(const bst_crlb_table *bound, double flux_e, double noise_e,
                                       double length_px, double wider);

/* bst_crlb_table_of, member `norm` only.
 *
 * Given:     length_px  length of the streak, px */
double bst_crlb_table_norm(const bst_crlb_table *bound, double length_px);

#endif
