/* Mean and standard deviation of noise from the moments of its values between two clip edges. */
#ifndef BST_IMGPROC_DETECT_TRUNCATED_MOMENTS_H
#define BST_IMGPROC_DETECT_TRUNCATED_MOMENTS_H

/* Noise model: a normal part plus shot noise, digitised in steps. */
typedef struct bst_truncated_moments_noise {
    /* variance of the normal part without quantisation; INFINITY: all noise is normal */
    double read_variance_e2;
    double step_e; /* >= 0 */
} bst_truncated_moments_noise;

/* Corrects mean and deviation of clipped pixel noise for the clip.
 *
 * Given:     low, high       clip edges midway between digital values, e-
 *            inner_mean      mean of the values between the edges, e-
 *            inner_variance  their variance, e-^2
 *            *mean, *deviation  first estimate of the digitised noise, e-
 * Returned:  *mean, *deviation
 * Notes:     The quantisation adds step^2 / 12 (Sheppard). The noise is taken as normal with the
 *            third and fourth cumulants of its shot noise, the variance beyond read_variance_e2, by
 *            the Edgeworth series to second order. Integrals of z^k He_n(z) phi(z) between the
 *            edges have closed forms in Hermite polynomials. Below 12 electrons of shot-noise
 *            variance, with a normal part below 0.8 e-^2 and at most 100 steps between the edges,
 *            the series fails. Then the Poisson-normal distribution itself is digitised and
 *            clipped. */
void bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low, double high,
                                 double inner_mean, double inner_variance, double *mean,
                                 double *deviation);

#endif
