#include "sim/analysis/new/sensor_design.h"

#include <math.h>

#include "boresight/vec.h"
#include "sim/analysis/new/reference_sensor.h"

#define MOST_EXPOSURE_S 2.0
#define LEAST_EXPOSURE_S 0.005
/* Motion of stars: in an exposure, and from one to the next. */
#define MOST_STREAK_PX 6.0
#define MOST_STEP_PX 24.0

/* Electrons per second of a point source. */
static double signal_e_per_s(double aperture_m, double v_mag) {
    return BST_NEW_FLUX_V0 * 0.25 * BST_PI * aperture_m * aperture_m * BST_NEW_THROUGHPUT *
           BST_NEW_QUANTUM_EFFICIENCY * pow(10.0, -0.4 * v_mag);
}

double bst_new_snr(double aperture_m, double pixel_arcsec, double sky_mag, double v_mag,
                   double exposure_s) {
    double pixels = BST_PI * BST_NEW_FWHM_PX * BST_NEW_FWHM_PX;
    double s = signal_e_per_s(aperture_m, v_mag) * exposure_s;
    double sky = signal_e_per_s(aperture_m, sky_mag) * pixel_arcsec * pixel_arcsec;
    double noise2 = pixels * (BST_NEW_READ_NOISE_E * BST_NEW_READ_NOISE_E +
                              (sky + BST_NEW_DARK_E_PER_S) * exposure_s);
    return s / sqrt(s + noise2);
}

double bst_new_pixel_arcsec(const bst_new_request *q, double rate, double complete_v_mag) {
    if (q->focal_m > 0.0) {
        return 1e-6 * BST_NEW_PIXEL_UM / q->focal_m / BST_ARCSEC_RAD;
    }
    if (q->pixel_arcsec > 0.0) {
        return q->pixel_arcsec;
    }
    double least = complete_v_mag >= BST_NEW_ENOUGH_STARS_V_MAG ? 0.0
                   : rate <= BST_NEW_STARLESS_RATE_ARCSEC_PER_S ? BST_NEW_FEW_STARS_ARCSEC
                                                                : BST_NEW_FEW_STARS_FAST_ARCSEC;
    return fmax(rate <= 60.0 ? 3.0 : rate <= 600.0 ? 5.0 : 10.0, least);
}

double bst_new_period_s(const bst_new_request *q, double rate, double pixel) {
    static const double steps[] = {1.0, 0.5, 0.2};
    if (q->period_s > 0.0) {
        return q->period_s;
    }
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        if (rate * steps[i] <= (rate > 600.0 ? 0.5 : 1.0) * MOST_STEP_PX * pixel) {
            return steps[i];
        }
    }
    return 0.1;
}

double bst_new_exposure_s(const bst_new_request *q, const bst_new_scene *s, double brightest) {
    const double peak = 0.2; /* share of a point's light in its brightest pixel, FWHM of 2 px */
    double most = fmin(MOST_EXPOSURE_S, 0.5 * s->period_s);
    double wanted = fmin(MOST_STREAK_PX * s->pixel_arcsec / fmax(s->rate_arcsec_per_s, 1e-3), most);
    wanted =
        fmin(wanted, 0.5 * BST_NEW_FULL_WELL_E / peak / signal_e_per_s(q->aperture_m, brightest));
    wanted = fmin(fmax(wanted, LEAST_EXPOSURE_S), most);
    double longest = q->period_s > 0.0 ? fmin(MOST_EXPOSURE_S, 0.8 * s->period_s) : most;
    while (bst_new_snr(q->aperture_m, s->pixel_arcsec, s->sky_mag_arcsec2, s->faintest_v_mag,
                       wanted) < BST_NEW_LEAST_SNR) {
        if (wanted >= longest) {
            return 0.0;
        }
        wanted = fmin(1.2 * wanted, longest);
    }
    double unit = fmax(pow(10.0, floor(log10(wanted)) - 1.0), 1e-3); /* whole ticks */
    return fmax(ceil(wanted / unit - 1e-9) * unit, LEAST_EXPOSURE_S);
}
