/* Throughput and PSF of a camera by its zero point and its ensquared energy. */
#include "boresight/camera.h"
#include "sim/optics/band.h"

static const double LEAST_FWHM_PX = 0.3, MOST_FWHM_PX = 50.0;

/* Share of the light of a Moffat profile in a pixel about its centre, by Simpson's rule over a
 * quarter of the pixel: to 1e-5 at a FWHM of 0.3 px. */
static double moffat_energy(double fwhm_px, double beta) {
    enum { STEPS = 64 };
    double alpha = 0.5 * fwhm_px / sqrt(exp2(1.0 / beta) - 1.0), sum = 0.0;
    const double h = 0.5 / STEPS;
    for (int i = 0; i <= STEPS; i++) {
        double wi = i == 0 || i == STEPS ? 1.0 : i % 2 ? 4.0 : 2.0, row = 0.0;
        for (int k = 0; k <= STEPS; k++) {
            double wk = k == 0 || k == STEPS ? 1.0 : k % 2 ? 4.0 : 2.0;
            double r2 = h * h * (double)(i * i + k * k);
            row += wk * pow(1.0 + r2 / (alpha * alpha), -beta);
        }
        sum += wi * row;
    }
    return 4.0 * sum * h * h / 9.0 * (beta - 1.0) / (BST_PI * alpha * alpha);
}

/* Share of a point's light in the pixel on whose centre it lies. */
static double energy(const bst_camera *c, double fwhm_px) {
    if (c->optics.psf == BST_PSF_MOFFAT) {
        return moffat_energy(fwhm_px, c->optics.moffat_beta);
    }
    double side = erf(0.5 * BST_FWHM_PER_SIGMA / (sqrt(2.0) * fwhm_px));
    return side * side;
}

static bst_status resolve_width(bst_ctx *ctx, bst_camera *c) {
    if (c->optics.psf != BST_PSF_GAUSSIAN && c->optics.psf != BST_PSF_MOFFAT) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "ensquared_energy is given, but optics/psf is neither gaussian nor moffat, "
                        "whose width it sets; leave it out");
    }
    double low = LEAST_FWHM_PX, high = MOST_FWHM_PX, wanted = c->ensquared_energy;
    double most = energy(c, low), least = energy(c, high);
    if (!(wanted <= most && wanted >= least)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "ensquared_energy %g (allowed: %.4g to %.4g, of a psf_fwhm_px from %g to "
                        "%g px)",
                        wanted, least, most, low, high);
    }
    while (high - low > 1e-12 * high) {
        double middle = 0.5 * (low + high);
        if (middle == low || middle == high) {
            break;
        }
        *(energy(c, middle) > wanted ? &low : &high) = middle;
    }
    c->psf_fwhm_px = 0.5 * (low + high);
    return BST_OK;
}

static bst_status resolve_zero_point(bst_ctx *ctx, bst_camera *c) {
    const bst_band_config *b = &c->band;
    const bool preset_v = b->preset == BST_BAND_V && b->response.count == 0 &&
                          b->transmission.count == 0 && !*b->response_file &&
                          !*b->transmission_file;
    if (!preset_v && !c->spectrum) {
        return BST_OK; /* until it has one */
    }
    /* electrons/s are proportional to what is resolved */
    double rate = bst_camera_electrons_per_s(c, c->zero_point_mag);
    double *factor = c->spectrum ? &c->throughput : &c->photon_flux_v0_per_s_m2;
    const char *key = c->spectrum ? "throughput" : "photon_flux_v0_per_s_m2";
    double low = c->spectrum ? 0.0 : 1.0, high = c->spectrum ? 1.0 : 1e15;
    /* another rounding of a resolved value would change the bytes of a repeated run */
    double value = fabs(rate - 1.0) < 1e-13 ? *factor : *factor / rate;
    if (!(rate > 0.0 && value > low && value <= high * (1.0 + 1e-12))) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "zero_point_mag %g needs %s %.4g (allowed: %g to %g; it follows from "
                        "aperture_m, obscuration, quantum_efficiency and band%s)",
                        c->zero_point_mag, key, value, low, high,
                        c->spectrum ? "" : ", and throughput");
    }
    *factor = fmin(value, high);
    return BST_OK;
}

bst_status bst_camera_resolve_figures(bst_ctx *ctx, bst_camera *c) {
    if (c->ensquared_energy > 0.0) {
        BST_TRY(resolve_width(ctx, c));
    }
    return c->zero_point_mag > 0.0 ? resolve_zero_point(ctx, c) : BST_OK;
}
