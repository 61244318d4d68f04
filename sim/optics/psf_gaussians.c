/* Approximates the squared image of a non-Gaussian PSF by a sum of Gaussians, which can be widened
 * and smeared in closed form. */
#include <math.h>

#include "sim/optics/psf_internal.h"
#include "sim/optics/streak_image.h"

enum { PARTS = BST_PSF_GAUSSIANS, RADII = 128, DIRECTIONS = 12, SWEEPS = 1000 };
/* widths relative to the Gaussian of equal noise-equivalent area: the first, and the ratio of
 * consecutive ones */
static const double FIRST_WIDTH = 0.5, NEXT_WIDTH = 1.35;

/* Non-negative least squares (coordinate descent) over the frequency plane; by Parseval equivalent
 * to the image's autocorrelation over shifts. */
static void solve(double a[PARTS][PARTS], const double b[PARTS], double x[PARTS]) {
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int i = 0; i < PARTS; i++) {
            double rest = b[i];
            for (int k = 0; k < PARTS; k++) {
                rest -= k == i ? 0.0 : a[i][k] * x[k];
            }
            x[i] = fmax(rest / a[i][i], 0.0);
        }
    }
}

void bst_psf_fit_gaussians(const bst_psf *psf, int node, bst_psf_node *out) {
    double width = sqrt(bst_psf_noise_area_px2(psf, node) / (4.0 * BST_PI)) * FIRST_WIDTH;
    double a[PARTS][PARTS] = {{0.0}}, b[PARTS] = {0.0}, squared = 0.0;
    for (int i = 0; i < PARTS; i++, width *= NEXT_WIDTH) {
        out->gaussian_px2[i] = width * width;
        out->gaussian_weight[i] = 0.0;
    }
    for (int n = 0; n < RADII; n++) {
        /* includes frequencies beyond the cutoff, where the OTF is 0 */
        double f = 2.0 * psf->cutoff * (n + 0.5) / RADII, mean = 0.0, basis[PARTS];
        for (int d = 0; d < DIRECTIONS; d++) { /* half the plane: the image is real */
            double angle = BST_PI * (d + 0.5) / DIRECTIONS, h[2];
            bst_psf_otf(psf, node, f * cos(angle), f * sin(angle), h);
            mean += (h[0] * h[0] + h[1] * h[1]) / DIRECTIONS;
        }
        for (int i = 0; i < PARTS; i++) {
            basis[i] = exp(-4.0 * BST_PI * BST_PI * out->gaussian_px2[i] * f * f);
            b[i] += f * basis[i] * mean;
            for (int k = 0; k <= i; k++) {
                a[i][k] += f * basis[i] * basis[k];
                a[k][i] = a[i][k];
            }
        }
    }
    solve(a, b, out->gaussian_weight);
    for (int i = 0; i < PARTS; i++) {
        squared += out->gaussian_weight[i] / (4.0 * BST_PI * out->gaussian_px2[i]);
    }
    for (int i = 0; i < PARTS; i++) {
        out->gaussian_weight[i] /= squared * bst_psf_noise_area_px2(psf, node);
    }
}

/* Integral of the squared image for one node and spectrum. */
static double squared_of(const bst_psf_node *n, double along_px2, double across_px2,
                         double length_px) {
    double sum = 0.0;
    for (int i = 0; i < PARTS; i++) {
        if (n->gaussian_weight[i] > 0.0) {
            double own = n->gaussian_px2[i];
            sum +=
                n->gaussian_weight[i] *
                bst_optics_image_squared(sqrt(own + along_px2), sqrt(own + across_px2), length_px);
        }
    }
    return sum;
}

double bst_psf_squared_image(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                             double y_px, double along_px2, double across_px2, double length_px) {
    enum { MOST = 4 * BST_PSF_SPECTRA };
    int node[4], fields = psf->columns * psf->rows, count = 0;
    double weight[4], share[MOST], squared[MOST], sum = 0.0;
    int nodes = bst_psf_weights(psf, x_px, y_px, node, weight);
    for (int k = 0; k < nodes; k++) {
        for (int s = 0; s < psf->spectra; s++) {
            share[count] = weight[k] * (psf->spectra > 1 ? bst_psf_share(colour, s) : 1.0);
            squared[count++] =
                squared_of(&psf->nodes[s * fields + node[k]], along_px2, across_px2, length_px);
        }
    }
    /* the image is the sum of the nodes' images; the integral of a product is approximated by the
     * harmonic mean of those of the squares, exact for circular Gaussians */
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < count; k++) {
            double both = squared[i] + squared[k];
            sum += both > 0.0 ? share[i] * share[k] * 2.0 * squared[i] * squared[k] / both : 0.0;
        }
    }
    return sum;
}
