/* Cramer-Rao lower bound of position and flux of a smeared source, tabulated by signal-to-noise
 * ratio and streak length. */
#ifndef BST_OBSGEN_MODEL_CRLB_TABLE_H
#define BST_OBSGEN_MODEL_CRLB_TABLE_H

#include "boresight/status.h"

enum { BST_BOUND_RATIOS = 25, BST_BOUND_LENGTHS = 11 };

/* Fisher information of a pixel-integrated Gaussian of sigma_px smeared along a straight path, in
 * white noise of variance v per pixel plus shot noise, averaged over sub-pixel positions. For F
 * electrons and r = F / v: position F r J, flux J_flux / v. Logarithms of J at r = 10^(-1 + n/4)
 * and lengths 0, 1, 2, 4, ... 512 sigma. */
typedef struct bst_crlb_table {
    double sigma_px;
    float along[BST_BOUND_LENGTHS][BST_BOUND_RATIOS], across[BST_BOUND_LENGTHS][BST_BOUND_RATIOS],
        flux[BST_BOUND_LENGTHS][BST_BOUND_RATIOS];
    float squared[BST_BOUND_LENGTHS]; /* log of sum p^2 */
} bst_crlb_table;

/* Computes the table.
 *
 * Given:     sigma_px  without the pixel width, at least 0.2 */
void bst_crlb_table_init(bst_crlb_table *bound, double sigma_px);

/* Lower bound of a source. */
typedef struct bst_crlb_table_at {
    double var_along_px2, var_across_px2, flux_variance;
    double norm; /* sqrt(sum p^2): the SNR on white noise is F norm / sqrt(v) */
} bst_crlb_table_at;

/* Lower bound at flux_e > 0 in noise_e > 0 (sqrt v) for a streak of length_px. */
bst_crlb_table_at bst_crlb_table_of(const bst_crlb_table *bound, double flux_e, double noise_e,
                                    double length_px);
/* Lower bound for a Gaussian `wider` times as wide as the table's, pixel width included.
 *
 * Given:     excess  variance of the source's shot noise per electron: 1, up to 2 with a
 *                    multiplication register (bst_camera_excess_noise) */
bst_crlb_table_at bst_crlb_table_wider(const bst_crlb_table *bound, double flux_e, double noise_e,
                                       double length_px, double wider, double excess);

/* bst_crlb_table_of, member `norm` only.
 *
 * Given:     length_px  length of the streak, px */
double bst_crlb_table_norm(const bst_crlb_table *bound, double length_px);

#endif
