#include "obsgen/model/false_alarms.h"

#include <math.h>

#include "obsgen/generator_internal.h"

/* Random streams of false alarms, beyond those of sources, whose numbers have 33 bits. */
static const uint64_t FALSE_ALARM = (uint64_t)1 << 40, HIT = (uint64_t)1 << 41,
                      WING_ALARM = (uint64_t)1 << 42;
/* Wing light below LEAST_WING (SNR) causes a negligible number of false alarms; the law of rare
 * maxima holds above LEAST_OUTPUT. */
static const double LEAST_WING = 0.3, LEAST_OUTPUT = 1.5;
/* Number of independent noise values between two adjacent maxima. */
static const double WAY_PLACES = 2.0;
/* Image processing labels a source as an artefact if its brightest pixel exceeds the fitted peak by
 * HOT_SHARE and HOT_SIGMA. */
static const double HOT_SHARE = 1.1, HOT_SIGMA = 2.5;

/* Uniform draw in (0, 1). */
static double uniform(const bst_generator *g, uint64_t draw) {
    return bst_rng_uniform(g->key, (uint64_t)g->exposure_id, draw);
}

bst_detection bst_false_alarms_point(const bst_generator *g, double x, double y, double snr,
                                     double length) {
    bst_detection d = {0};
    double norm = bst_crlb_table_norm(&g->bound, length), b = g->binning;
    d.flux_e = snr * g->noise_e / norm;
    bst_crlb_table_at bound = bst_crlb_table_of(&g->bound, d.flux_e, g->noise_e, length);
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
    double edge_x = 2.0 * g->sigma + 0.5 * length * fabs(c);
    double edge_y = 2.0 * g->sigma + 0.5 * length * fabs(s);
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

/* Noise of the output on wing light relative to open sky; light: its output, SNR. */
static double wing_noise(const bst_generator *g, double light) {
    return sqrt(1.0 + light * bst_crlb_table_norm(&g->bound, 0.0) / g->noise_e);
}

/* Additional false alarms per noise maximum on wing light. A maximum must exceed the threshold, and
 * the path to a higher maximum nearby must drop below the interpolation limit of image processing.
 */
static double wing_gain(const bst_generator *g, double light) {
    double t = g->filters[0].threshold, noise = wing_noise(g, light);
    double u = fmax((t - light) / noise, LEAST_OUTPUT);
    double above = 0.5 * erfc((bst_generator_looks_from(g) - light) / (noise * sqrt(2.0)));
    double alone = 1.0 - pow(above, WAY_PLACES);
    return fmax(alone * u / t * exp(0.5 * (t * t - u * u)) - 1.0, 0.0);
}

/* Filter output caused by a source's wings at a distance. Image and filter have equal wings, whose
 * correlation is the sum of both; but image processing's kernel is truncated, hence half. */
static double wing_output(const bst_generator *g, const generator_source *s, double distance_px) {
    return 0.5 * s->amplitude * bst_response_falloff(&g->response, distance_px, 0.0, 0.0);
}

/* Draws false alarms on the wings of one source. Near the source none occur: it is the higher
 * maximum, connected by its flank. */
static void draw_wing_alarms(bst_generator *g, const generator_source *s, double per_px) {
    enum { RINGS = 64 };
    double reach = ceil(6.0 * g->fitted_sigma + g->streak) + 2.5;
    double end = (BST_FALLOFF_DISTANCES - 1.0) / BST_FALLOFF_PER_PX, step = (end - reach) / RINGS;
    if (!(step > 0.0) || wing_output(g, s, reach) < LEAST_WING) {
        return;
    }
    uint64_t draw = WING_ALARM | s->name << 8;
    double arrival = -log(uniform(g, draw++));
    for (int i = 0; i < RINGS; i++) {
        double r = reach + (i + 0.5) * step;
        double light = wing_output(g, s, r);
        if (!(light > 0.0)) {
            continue;
        }
        arrival -= per_px * wing_gain(g, light) * 2.0 * BST_PI * r * step;
        while (arrival < 0.0) {
            double angle = 2.0 * BST_PI * uniform(g, draw);
            double energy = -log(uniform(g, draw + 1)), noise = wing_noise(g, light);
            arrival -= log(uniform(g, draw + 2));
            draw += 3;
            double dx = r * cos(angle), dy = r * sin(angle), x = s->x + dx, y = s->y + dy;
            if (x < -0.5 || y < -0.5 || x > g->width - 0.5 || y > g->height - 0.5) {
                continue;
            }
            double least = (g->filters[0].threshold - light) / noise;
            double above =
                sqrt(fmax(least, 0.0) * fmax(least, 0.0) + 2.0 * energy) - fmax(least, 0.0);
            bst_obsgen_generated item = {.detection = bst_false_alarms_point(
                                             g, x, y, g->filters[0].threshold + noise * above, 0.0),
                                         .item = -1};
            item.detection.label = BST_LABEL_ARTEFACT;
            bst_generator_keep(g, &item);
        }
    }
}

void bst_false_alarms_draw(bst_generator *g) {
    double expected = g->settings.false_alarms_per_frame * g->calibration.false_alarm_factor;
    /* an overestimated background lowers the output */
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
    for (int i = 0; i < g->source_count && g->response.falloff.tabulated && !g->smeared; i++) {
        if (g->sources[i].found) {
            double share = g->streak > 0.0 ? 1.0 - g->streak_share : 1.0;
            draw_wing_alarms(g, &g->sources[i], share * expected / ((double)g->width * g->height));
        }
    }
    double arrival = 0.0;
    for (uint64_t i = 0; i < 1000000; i++) {
        uint64_t draw = FALSE_ALARM + 8 * i;
        arrival -= log(uniform(g, draw));
        if (arrival > expected) {
            return;
        }
        double x = g->width * uniform(g, draw + 1) - 0.5;
        double y = g->height * uniform(g, draw + 2) - 0.5;
        bool streak = g->streak > 0.0 && uniform(g, draw + 4) < g->streak_share;
        const bst_generator_filter *filter = &g->filters[streak];
        double energy = -2.0 * log(uniform(g, draw + 3)) / g->calibration.false_alarm_steepness;
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
    for (uint64_t i = 0; i < 1000000; i++) {
        uint64_t draw = HIT + 16 * i;
        arrival -= log(uniform(g, draw));
        if (arrival > expected) {
            return;
        }
        double mu = sqrt(uniform(g, draw + 1));
        double z = bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw + 2);
        double charge =
            h->e_per_um * h->depth_um / mu * fmax(1.0 - h->straggling * log(z * z), 0.0);
        double length = h->depth_um / (h->pixel_pitch_um * g->binning) * sqrt(1.0 - mu * mu) / mu;
        double angle = 2.0 * BST_PI * uniform(g, draw + 3);
        double x = g->width * uniform(g, draw + 4) - 0.5 + 0.5 * length * cos(angle);
        double y = g->height * uniform(g, draw + 5) - 0.5 + 0.5 * length * sin(angle);
        /* output of a track at its middle, relative to a point */
        double s = g->total_sigma * sqrt(2.0);
        double seen = length > 0.05 ? s * sqrt(BST_PI) * erf(0.5 * length / s) / length : 1.0;
        double snr = charge * kernel * fmin(seen, 1.0);
        double peak = snr + bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw + 6);
        if (!(peak > g->filters[0].threshold) || x < -0.5 || y < -0.5 || x > g->width - 0.5 ||
            y > g->height - 0.5) {
            continue;
        }
        bst_obsgen_generated item = {
            .detection = bst_false_alarms_point(g, x, y, peak, 0.0), .item = -1, .hit = true};
        bst_detection *d = &item.detection;
        double hottest = charge / fmax(length, 1.0) / g->noise_e;
        bool stands_out = hottest > HOT_SHARE * peak + HOT_SIGMA;
        if (stands_out && uniform(g, draw + 7) < g->calibration.cosmic_ray_flag_probability) {
            d->label = BST_LABEL_HIT;
        }
        if (length > 1.5 * d->width_px / g->binning) {
            d->length_px = g->binning * length;
            d->angle_rad = atan(tan(angle));
            d->flags |= BST_DETECTION_STREAK;
        }
        bst_generator_keep(g, &item);
    }
}
