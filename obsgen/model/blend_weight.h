/* Where the fit of one source to the light of several lands. Inside of the generator. */
#ifndef BST_OBSGEN_MODEL_BLEND_WEIGHT_H
#define BST_OBSGEN_MODEL_BLEND_WEIGHT_H

enum { BST_BLEND_LIGHTS = 21, BST_BLEND_DISTANCES = 17 };

/* By light (decades in quarters) and distance (half sigmas). */
typedef struct bst_blend_weights {
    float weight[BST_BLEND_LIGHTS][BST_BLEND_DISTANCES];
} bst_blend_weights;

/* Computes the table of weights; needed once. */
void bst_blend_weights_init(bst_blend_weights *weights);

/* The weight of a source beside the fitted one, in the mean that a least-squares fit of one source
 * finds, each pixel weighted with 1 / (noise^2 + fitted light).
 *
 * Given:
 *   light    brightest pixel of the fitted light over the variance of the noise
 *   overlap  what the matched filter shows of the other source at the fitted place,
 *            exp(-d^2 / 4 S^2) of a Gaussian d away
 *
 * Returned: between the overlap (little light) and the share of the source on the fitted pixels
 * (much light: the fit is the centroid). From the stationary point of the square, of a Gaussian of
 * unit sigma: w(d) ~ (1/d) integral of x p(x - d) p(x) / (1 + R p(x) / p(0)). */
double bst_blend_weight(const bst_blend_weights *weights, double light, double overlap);

/* The weights for one light at distances of 0, 0.5, 1, ... sigma, relative to that at 0. */
void bst_blend_weight_row(const bst_blend_weights *weights, double light,
                          float row[BST_BLEND_DISTANCES]);

#endif
