/* Centroid of a single-source fit to the blended light of several sources. Internal to the
 * generator. */
#ifndef BST_OBSGEN_MODEL_BLEND_WEIGHT_H
#define BST_OBSGEN_MODEL_BLEND_WEIGHT_H

/* Light levels, distances, and distances per sigma: the last one is 8 sigma. */
enum { BST_BLEND_LIGHTS = 21, BST_BLEND_DISTANCES = 33, BST_BLEND_PER_SIGMA = 4 };

/* Table by light level (quarter decades) and distance. */
typedef struct bst_blend_weights {
    float weight[BST_BLEND_LIGHTS][BST_BLEND_DISTANCES];
} bst_blend_weights;

/* Computes the table of weights; needed once. */
void bst_blend_weights_init(bst_blend_weights *weights);

/* Weight of a neighbour in the centroid of a single-source least-squares fit, each pixel weighted
 * by 1 / (noise^2 + fitted light).
 *
 * Given:     light    brightest pixel of the fitted light over the noise variance
 *            overlap  matched-filter output of the neighbour at the fitted position, exp(-d^2 / 4
 *                     S^2) of a Gaussian at distance d
 * Returned:  between the overlap (faint) and the neighbour's share on the fitted pixels (bright:
 *            the fit is the centroid)
 * Notes:     stationary point of chi-square for a Gaussian of unit sigma: w(d) ~ (1/d) integral of
 *            x p(x - d) p(x) / (1 + R p(x) / p(0)) */
double bst_blend_weight(const bst_blend_weights *weights, double light, double overlap);

/* Weights of one light level at distances of k / BST_BLEND_PER_SIGMA sigma, relative to that at 0.
 */
void bst_blend_weight_row(const bst_blend_weights *weights, double light,
                          float row[BST_BLEND_DISTANCES]);

#endif
