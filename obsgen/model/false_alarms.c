#include "obsgen/model/false_alarms.h"

#include <assert.h>
#include <math.h>

#include "obsgen/generator_internal.h"
#include "obsgen/model/wing_alarms.h"

/* Random streams of false alarms, beyond those of sources, whose numbers have 33 bits. */
static const uint64_t FALSE_ALARM = (uint64_t)1 << 40, HIT = (uint64_t)1 << 41;
/* Random numbers per false alarm and per cosmic ray. */
enum { ALARM_DRAWS = 8, HIT_DRAWS = 16 };
/* Bound of the loops: the largest configured mean is 1e4 a frame. */
static const uint64_t MOST_ALARMS = 1000000;
/* Image processing labels a pixel as charge if its neighbours lack so many standard deviations of
 * the light that the PSF gives them, with this relative error of the PSF (BST_SHARP_DEVIATION and
 * MODEL_SHARE of imgproc/measure/sharpness.c). */
static const double SHARP_DEVIATION = 4.0, MODEL_SHARE = 0.09;
/* A shorter track has the output of a point: sqrt(pi) s erf(l / 2s) / l = 1 - l^2 / (12 s^2). */
static const double SHORT_TRACK_PX = 0.05;
/* Length over width from which images measure a streak (imgproc/measure/source_moments.c). */
static const double OWN_STREAK_LENGTH = 1.5;
/* Half extent of a source that the frame's edge cuts, sigmas (imgproc/measure/locate.c). */
static const double EDGE_SIGMAS = 2.0;

bst_detection bst_false_alarms_point(const bst_generator *g, double x, double y, double snr,
                                     double length) {
    bst_detection d = {0};
    double norm = bst_crlb_table_norm(&g->bound, length), b = g->binning;
    d.flux_e = snr * g->noise_e / norm;
    bst_crlb_table_at bound =
        bst_crlb_table_wider(&g->bound, d.flux_e, g->noise_e, length, 1.0, g->excess);
    double c = length > 0.0 ? g->star_path.dx / g->streak : 1.0;
    double s = length > 0.0 ? g->star_path.dy / g->streak : 0.0;
    double a2 = bound.var_along_px2 * b * b, b2 = bound.var_across_px2 * b * b;
    d.x_px = g->origin_x + b * x;
    d.y_px = g->origin_y + b * y;
    d.cov_xx = c * c * a2 + s * s * b2;
    d.cov_xy = c * s * (a2 - b2);
    d.cov_yy = s * s * a2 + c * c * b2;
    d.flux_sigma_e = sqrt(bound.flux_variance);
    d.snr = snr;
    const double fwhm = BST_FWHM_PER_SIGMA;
    d.width_px = b * fwhm * g->sigma;
    d.length_px = b * fwhm * sqrt(g->sigma * g->sigma + length * length / 12.0);
    d.angle_rad = length > 0.0 ? atan(s / c) : 0.0;
    d.flags = length > 0.0 ? BST_DETECTION_STREAK : 0u;
    d.v_mag = -2.5 * log10(d.flux_e / (fmax(g->exposure_s, 1e-9) * g->electrons_per_s_v0));
    double edge_x = EDGE_SIGMAS * g->sigma + 0.5 * length * fabs(c);
    double edge_y = EDGE_SIGMAS * g->sigma + 0.5 * length * fabs(s);
    if (x < edge_x - 0.5 || y < edge_y - 0.5 || x > g->width - 0.5 - edge_x ||
        y > g->height - 0.5 - edge_y) {
        d.flags |= BST_DETECTION_EDGE;
    }
    return d;
}

/* False-alarm rate with offsets of rows and columns relative to white noise of equal variance, for
 * which the threshold is set. The output's variance is larger, but its gradient is smaller. */
static double offset_alarm_factor(const bst_generator *g) {
    double more = 0.0;
    for (int k = 0; k < 2; k++) {
        double share = k == 1 ? g->streak_share : 1.0 - g->streak_share;
        double v = g->filters[k].variance, t = g->threshold;
        if (!(g->streak > 0.0)) {
            share = k == 0 ? 1.0 : 0.0;
        }
        /* the density of maxima is sqrt(det of the gradient's covariance) u exp(-u^2 / 2), u in
         * sigma; offsets have no gradient along them */
        more += share * sqrt(g->white_share / v) / sqrt(v) * exp(0.5 * t * t * (1.0 - 1.0 / v));
    }
    return more;
}

bst_status bst_false_alarms_draw(bst_ctx *ctx, bst_generator *g) {
    assert(ctx && g);
    double expected = g->settings.false_alarms_per_frame * g->calibration.false_alarm_factor;
    /* an overestimated background lowers the output: the ratio of exp(-u^2 / 2) at both thresholds
     */
    double taken = g->background_bias_e / (bst_crlb_table_norm(&g->bound, 0.0) * g->noise_e);
    expected *= exp(-taken * (g->threshold + 0.5 * taken));
    expected *= offset_alarm_factor(g);
    if (g->smeared) { /* maxima are not interpolated */
        double least =
            g->threshold * g->noise_e / g->dark_noise_e +
            g->background_bias_e / (bst_crlb_table_norm(&g->bound, 0.0) * g->dark_noise_e);
        least /= sqrt(g->filters[0].variance);
        expected = bst_matched_pixel_maxima(g->filter_sigma, least) * g->width * g->height;
    }
    BST_TRY(bst_wing_alarms_draw(ctx, g));
    double arrival = 0.0;
    for (uint64_t i = 0; i < MOST_ALARMS; i++) {
        uint64_t draw = FALSE_ALARM + ALARM_DRAWS * i;
        arrival -= log(bst_generator_uniform(g, draw));
        if (arrival > expected) {
            break;
        }
        double x = g->width * bst_generator_uniform(g, draw + 1) - 0.5;
        double y = g->height * bst_generator_uniform(g, draw + 2) - 0.5;
        bool streak = g->streak > 0.0 && bst_generator_uniform(g, draw + 4) < g->streak_share;
        const bst_generator_filter *filter = &g->filters[streak];
        double energy =
            -2.0 * log(bst_generator_uniform(g, draw + 3)) / g->calibration.false_alarm_steepness;
        double snr = sqrt(filter->threshold * filter->threshold + filter->variance * energy);
        if (g->smeared) {
            bst_generator_keep_rough(g, (int)lround(x), (int)lround(y), snr, -1);
            continue;
        }
        bst_obsgen_generated item = {
            .detection = bst_false_alarms_point(g, x, y, snr, streak ? g->streak : 0.0),
            .item = -1,
            .drawn = streak};
        bst_generator_keep(g, &item);
    }
    return BST_OK;
}

/* Light that the eight neighbours of a pixel with charge lack, in standard deviations, as
 * sigma_of_group of imgproc/measure/sharpness.c gives them for a Gaussian PSF: noise and shot noise
 * of the pixel, of the neighbours that are expected to be lit, and error of the PSF.
 *
 * Given:     charge_e  charge of the pixel, electrons */
static double deviation_of_charge(const bst_generator *g, double charge_e) {
    /* light of a neighbour relative to the pixel's: along an axis, diagonal */
    double side = exp(-0.5 / (g->filter_sigma * g->filter_sigma)), corner = side * side;
    double square = 4.0 * (side * side + corner * corner);
    double cube = 4.0 * (side * side * side + corner * corner * corner);
    double noise2 = g->noise_e * g->noise_e, model = MODEL_SHARE * charge_e;
    return charge_e / sqrt(noise2 + charge_e + noise2 / square +
                           cube / (square * square) * charge_e + model * model);
}

void bst_false_alarms_cosmic_rays(bst_generator *g) {
    const bst_detector_cosmic_ray_config *h = &g->camera->detector.cosmic_rays;
    if (!(h->rate_per_cm2_s > 0.0)) {
        return;
    }
    double pixel_cm2 = h->pixel_pitch_um * h->pixel_pitch_um * 1e-8 * g->binning * g->binning;
    double expected =
        h->rate_per_cm2_s * pixel_cm2 * g->width * g->height * (g->exposure_s + h->readout_s);
    /* filter output of a point of one electron: the kernel's maximum over the noise */
    double kernel = 1.0 / (2.0 * BST_PI * g->total_sigma * g->total_sigma) /
                    bst_crlb_table_norm(&g->bound, 0.0) / g->noise_e;
    double arrival = 0.0;
    for (uint64_t i = 0; i < MOST_ALARMS; i++) {
        uint64_t draw = HIT + HIT_DRAWS * i;
        arrival -= log(bst_generator_uniform(g, draw));
        if (arrival > expected) {
            return;
        }
        double mu = sqrt(bst_generator_uniform(g, draw + 1));
        double z = bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw + 2);
        double charge =
            h->e_per_um * h->depth_um / mu * fmax(1.0 - h->straggling * log(z * z), 0.0);
        double length = h->depth_um / (h->pixel_pitch_um * g->binning) * sqrt(1.0 - mu * mu) / mu;
        double angle = 2.0 * BST_PI * bst_generator_uniform(g, draw + 3);
        double x = g->width * bst_generator_uniform(g, draw + 4) - 0.5 + 0.5 * length * cos(angle);
        double y = g->height * bst_generator_uniform(g, draw + 5) - 0.5 + 0.5 * length * sin(angle);
        /* output of a track at its middle, relative to a point */
        double s = g->total_sigma * sqrt(2.0);
        double seen =
            length > SHORT_TRACK_PX ? s * sqrt(BST_PI) * erf(0.5 * length / s) / length : 1.0;
        double snr = charge * kernel * fmin(seen, 1.0);
        double peak = snr + bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw + 6);
        if (!(peak > g->filters[0].threshold) || x < -0.5 || y < -0.5 || x > g->width - 0.5 ||
            y > g->height - 0.5) {
            continue;
        }
        if (g->smeared) { /* nothing is fitted, and no shape is looked at */
            bst_generator_keep_rough(g, (int)lround(x), (int)lround(y), peak, -1);
            continue;
        }
        bst_obsgen_generated item = {
            .detection = bst_false_alarms_point(g, x, y, peak, 0.0), .item = -1, .hit = true};
        bst_detection *d = &item.detection;
        double sharp = deviation_of_charge(g, charge / fmax(length, 1.0)) +
                       bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw + 8);
        if (sharp > SHARP_DEVIATION &&
            bst_generator_uniform(g, draw + 7) < g->calibration.cosmic_ray_flag_probability) {
            d->label = BST_LABEL_HIT;
        }
        if (length > OWN_STREAK_LENGTH * d->width_px / g->binning) {
            d->length_px = g->binning * length;
            d->angle_rad = atan(tan(angle));
            d->flags |= BST_DETECTION_STREAK;
            /* imgproc/measure/other_path.h */
            d->flags |=
                g->streak > 0.0 && peak >= GENERATOR_MOMENTS_SNR ? BST_DETECTION_OTHER_PATH : 0u;
        }
        bst_generator_keep(g, &item);
    }
}
