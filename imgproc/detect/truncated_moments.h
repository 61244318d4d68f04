/* Mean and deviation of noise from the moments of what lies between two edges. */
#ifndef BST_IMGPROC_DETECT_TRUNCATED_MOMENTS_H
#define BST_IMGPROC_DETECT_TRUNCATED_MOMENTS_H

/* Noise that is the sum of a normal part and of counted electrons, in digital steps. */
typedef struct bst_truncated_moments_noise {
    double read_variance_e2; /* of the normal part, without that of the steps; INFINITY: all is */
    double step_e;           /* >= 0 */
} bst_truncated_moments_noise;

/* Improves *mean and *deviation (of the noise as it is digitised, electrons; on entry a guess) of
 * pixels whose values from `low` to `high` have the mean `inner_mean` and the variance
 * `inner_variance`. The edges lie midway between digital values: what is left is then the noise
 * before it was digitised, cut at the edges, and step^2 / 12 (Sheppard). That noise is taken for
 * normal with the third and fourth cumulants of the electrons counted, variance beyond
 * read_variance_e2, by Edgeworth's series to the second order; its moments between two edges are
 * integrals of z^k He_n(z) phi(z), which Hermite polynomials have in closed form.
 *
 * Below 12 electrons counted, with a normal part below 0.8 e-^2 and no more than 100 steps between
 * the edges, no such series holds: the Poisson law of whole electrons, the normal part about each,
 * is digitised and cut as it is, and mean and deviation are those of all digital values. */
void bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low, double high,
                                 double inner_mean, double inner_variance, double *mean,
                                 double *deviation);

#endif
