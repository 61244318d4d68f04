/* Stars merged into one detection: how image processing fits them as one point or streak. */
#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "obsgen/model/psf_fit.h"

/* An isolated detection above this SNR and this many FWHM long is fitted as a streak of its own
 * (imgproc/measure/source_moments.c); above WIDTH_SNR the width of its fit is free (locate.c). */
static const double OWN_STREAK_SNR = 10.0, OWN_STREAK_LENGTH = 1.5, WIDTH_SNR = 20.0;
/* A streak's fit must lower chi-square by this much (LEAST_GAIN of source_moments.c). */
static const double LEAST_GAIN = 9.0;

/* Light farther than this on an axis does not reach the fitted pixels: they end at about 4 sigma
 * (REACH_SIGMAS of imgproc/measure/deblend.c, in whole pixels), and so does the light. */
static const double FITTED_SIGMAS = 8.0;
/* Stamp and largest move of a fit (imgproc/measure/deblend.c). */
static const double REACH_SIGMAS = 3.6, LEAST_REACH_PX = 3.0, LIMIT_PX = 1.5, LIMIT_PER_PATH = 0.4;
/* Most sources whose light is fitted as one streak. */
enum { MOST_LIGHTS = 65 };

/* Symmetric 2 x 2 matrix. */
typedef struct covariance {
    double xx, xy, yy;
} covariance;

static covariance inverse(covariance m) {
    double det = m.xx * m.yy - m.xy * m.xy;
    return (covariance){m.yy / det, -m.xy / det, m.xx / det};
}

/* True if a source's light belongs to another detection, which is fitted jointly. */
static bool is_of_another(const bst_generator *g, const generator_source *s,
                          const generator_source *o) {
    return o->head >= 0 && g->sources[o->head].item != s->item;
}

/* Collects the light of a merged detection about (x, y), within `beyond` of it on each axis.
 * Returns the number of points. */
static int gather_points(const bst_generator *g, const generator_source *s,
                         const generator_source *merged, int count, const double about[2],
                         double beyond, bst_path_point points[BST_PATH_POINTS]) {
    int used = 0;
    for (int k = -1; k < count && used + 2 <= BST_PATH_POINTS; k++) {
        const generator_source *o = k < 0 ? s : &merged[k];
        double dx = o->x - about[0], dy = o->y - about[1];
        if (is_of_another(g, s, o) || fabs(dx) > beyond || fabs(dy) > beyond) {
            continue;
        }
        double half = 0.5 * o->flux_e; /* two points have a path's variance */
        double px = o->path.dx / sqrt(12.0), py = o->path.dy / sqrt(12.0);
        points[used++] = (bst_path_point){dx - px, dy - py, half};
        points[used++] = (bst_path_point){dx + px, dy + py, half};
    }
    return used;
}

/* Gives a bright streak with other streaks in its light the place and flux of a fit with a free
 * width. */
static void fit_as_streak(const bst_generator *g, const generator_source *s,
                          const generator_source *merged, int count, generator_blend *at) {
    bst_path_streak lights[MOST_LIGHTS];
    int used = 0;
    for (int k = -1; k < count && used < MOST_LIGHTS; k++) {
        const generator_source *o = k < 0 ? s : &merged[k];
        if (!is_of_another(g, s, o)) {
            lights[used++] =
                (bst_path_streak){o->x - at->x, o->y - at->y, o->flux_e / s->flux_e, o->path};
        }
    }
    const bst_response *r = &g->response;
    double reach = fmax(LEAST_REACH_PX, ceil(REACH_SIGMAS * g->fitted_sigma));
    double image = r->source.across_px * r->source.along_px;
    bst_streak_model model = {.path = g->fit_path, .sigma_px = g->filter_sigma};
    double peak_e = s->flux_e / (2.0 * BST_PI * model.sigma_px * model.sigma_px);
    model.saturated = s->saturated ? fmax(bst_generator_saturation_e(g), 1.0) / peak_e : 0.0;
    double limit =
        LIMIT_PX + g->fitted_sigma + LIMIT_PER_PATH * hypot(g->fit_path.dx, g->fit_path.dy);
    bst_path_point_fit fit =
        bst_path_fit_streaks(lights, used, sqrt(image), &model,
                             bst_generator_streak_light(g, s->flux_e), reach + 0.5, limit);
    at->x += fit.x_px;
    at->y += fit.y_px;
    at->flux_e = fit.flux * s->flux_e;
}

/* Fits a single point: gives a bright one the place and flux of a fit with a free width. Returns
 * the variance of the Gaussian window of its moments: twice that of the fitted image, never below
 * the PSF's. */
static double fit_as_point(const bst_generator *g, const generator_source *s,
                           const generator_source *merged, int count, generator_blend *at) {
    double model = g->filter_sigma * g->filter_sigma;
    double image = g->response.source.across_px * g->response.source.along_px;
    double widening = image - model;
    if (s->peak > WIDTH_SNR && !g->response.falloff.tabulated) {
        bst_path_point points[BST_PATH_POINTS];
        const double about[2] = {at->x, at->y};
        int used = gather_points(g, s, merged, count, about, FITTED_SIGMAS * sqrt(model), points);
        for (int i = 0; i < used; i++) {
            points[i].flux /= s->flux_e;
        }
        double peak_e = s->flux_e / (2.0 * BST_PI * model),
               light = g->excess * peak_e / (g->noise_e * g->noise_e);
        double saturated = s->saturated ? fmax(bst_generator_saturation_e(g), 1.0) / peak_e : 0.0;
        bst_path_point_fit fit =
            bst_path_fit_points(points, used, sqrt(image), g->filter_sigma, light, saturated);
        /* as in imgproc/measure/fit.c: a fit without light, here with that of a long path beyond
         * its pixels, changes nothing */
        if (fit.flux > 0.0) {
            at->x += fit.x_px;
            at->y += fit.y_px;
            at->flux_e = fit.flux * s->flux_e;
            widening = fit.widening_px2;
        }
    }
    return 2.0 * (model + fmax(widening, 0.0));
}

/* Fourth moment of a Gaussian of variance `variance` about `mean`: mean square of x^2 - mean. */
static double spread_of_square(double variance, double mean) {
    return variance * (3.0 * variance - 2.0 * mean) + mean * mean;
}

/* Standard deviation of a measured second moment by the noise of the pixels and of the light: the
 * windowed moment is sum(w d x^2) / sum(w d), and removing the window multiplies its error by
 * (moment / windowed)^2.
 *
 * Given:     moment, across  variances of the light along the axis and across it, px^2 */
static double moment_noise(const bst_generator *g, double flux_e, double window, double moment,
                           double across) {
    double half = 0.5 * window, windowed = moment * window / (moment + window);
    double inside = moment * half / (moment + half);
    double sum = flux_e * sqrt(window / (window + moment) * window / (window + across));
    double light = flux_e * sqrt(half / (half + moment) * half / (half + across));
    double variance = g->noise_e * g->noise_e * BST_PI * window * spread_of_square(half, windowed) +
                      g->excess * light * spread_of_square(inside, windowed);
    double gain = moment / windowed;
    return gain * gain * sqrt(variance) / sum;
}

/* Larger principal moment without the pixel's, px^2, with the noise of its measurement.
 *
 * Given:     m  moments with the pixel */
static double longest_with_noise(const bst_generator *g, const generator_source *s, covariance m,
                                 double window, double flux_e) {
    double mean = 0.5 * (m.xx + m.yy), half = hypot(0.5 * (m.xx - m.yy), m.xy);
    double noise = moment_noise(g, flux_e, window, mean + half, mean - half);
    return mean + half - 1.0 / 12.0 + noise * bst_generator_draw(g, s, GENERATOR_MOMENT);
}

/* Largest second moment of the light about the detection, px^2, as image processing measures it:
 * under a Gaussian window, which is removed by adding inverse covariances; the pixel's variance is
 * subtracted. */
static double longest_moment(const bst_generator *g, const generator_source *s,
                             const generator_source *merged, int count, double window,
                             const generator_blend *at) {
    double image = g->response.source.across_px * g->response.source.along_px;
    double sum = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (int k = -1; k < count; k++) {
        const generator_source *o = k < 0 ? s : &merged[k];
        if (is_of_another(g, s, o)) {
            continue;
        }
        double dx = o->x - at->x, dy = o->y - at->y, px = o->path.dx, py = o->path.dy;
        covariance own = {image + px * px / 12.0, px * py / 12.0, image + py * py / 12.0};
        /* Gaussian times window: weight, mean and covariance */
        covariance both = inverse((covariance){own.xx + window, own.xy, own.yy + window});
        double det = both.xx * both.yy - both.xy * both.xy;
        double bx = both.xx * dx + both.xy * dy, by = both.xy * dx + both.yy * dy;
        double light = o->flux_e * sqrt(det) * exp(-0.5 * (dx * bx + dy * by));
        double mx = window * bx, my = window * by;
        sum += light;
        xx += light * (window - window * window * both.xx + mx * mx);
        xy += light * (mx * my - window * window * both.xy);
        yy += light * (window - window * window * both.yy + my * my);
    }
    covariance seen = inverse((covariance){xx / sum, xy / sum, yy / sum});
    seen.xx -= 1.0 / window;
    seen.yy -= 1.0 / window;
    if (!(seen.xx > 0.0 && seen.yy > 0.0 && seen.xx * seen.yy > seen.xy * seen.xy)) {
        return 0.0; /* image processing measures no moments */
    }
    return longest_with_noise(g, s, inverse(seen), window, at->flux_e);
}

/* As fit_as_point and longest_moment, on pixels with a PSF that is no Gaussian: the place and flux
 * of the fit, and the largest second moment about it. */
static double fit_psf(const bst_generator *g, const generator_source *s,
                      const generator_source *merged, int count, generator_blend *at) {
    bst_path_point points[BST_PATH_POINTS];
    double reach = fmax(LEAST_REACH_PX, ceil(REACH_SIGMAS * g->fitted_sigma));
    const double about[2] = {s->x, s->y};
    const double start[2] = {s->x - round(s->x), s->y - round(s->y)};
    int used = gather_points(g, s, merged, count, about, 4.0 * reach, points);
    const bst_psf_fit_frame frame = {
        .reach_px = reach,
        .sigma_px = g->fitted_sigma,
        .limit_px = LIMIT_PX + g->fitted_sigma,
        .noise_e = g->noise_e / sqrt(g->excess),
        .saturated_e = s->saturated ? fmax(bst_generator_saturation_e(g), 1.0) : 0.0};
    bst_path_point_fit fit = bst_psf_fit_points(&g->response, points, used, start, &frame);
    at->x = s->x + fit.x_px;
    at->y = s->y + fit.y_px;
    at->flux_e = fit.flux;
    bst_psf_fit_moments m = bst_psf_fit_measure(&g->response, points, used, start, &frame, &fit);
    if (!(m.xx > 0.0)) {
        return 0.0;
    }
    const double pixel = 1.0 / 12.0;
    double window = 2.0 * (g->fitted_sigma * g->fitted_sigma + fmax(fit.widening_px2, 0.0) + pixel);
    covariance all = {m.xx + pixel, m.xy, m.yy + pixel};
    return longest_with_noise(g, s, all, window, fit.flux);
}

/* By how much a streak's fit lowers chi-square below that of a point: each fit lowers it by its
 * squared SNR, and that of the point is r times the streak's, with the correlation r of two
 * Gaussian images.
 *
 * Given:     snr                    of the point's fit
 *            fitted, along, across  variances of the point's fit and of the streak, px^2 */
static double gain_of_streak(double snr, double fitted, double along, double across) {
    double r2 = 4.0 * fitted * sqrt(along * across) / ((along + fitted) * (across + fitted));
    return snr * snr * (1.0 / r2 - 1.0);
}

void bst_generator_fit_merged(const bst_generator *g, const generator_source *s,
                              const generator_source *merged, int count, generator_blend *out) {
    assert(g && s && out && count >= 0 && (merged || count == 0));
    double point = g->fitted_sigma * g->fitted_sigma;
    if (g->smeared || out->near) {
        return;
    }
    if (s->as_streak) {
        if (s->peak > WIDTH_SNR) {
            fit_as_streak(g, s, merged, count, out);
        }
        return;
    }
    double fitted = point + 1.0 / 12.0, moment;
    if (g->response.falloff.tabulated && s->peak > WIDTH_SNR) {
        moment = fit_psf(g, s, merged, count, out);
    } else {
        double window = fit_as_point(g, s, merged, count, out);
        fitted = 0.5 * window;
        moment = longest_moment(g, s, merged, count, window, out);
    }
    /* the noise of the flux that is measured */
    double snr = out->flux_e * bst_generator_fit_norm(g, s, 0.0, false) + s->noise;
    if (snr < OWN_STREAK_SNR || moment < OWN_STREAK_LENGTH * OWN_STREAK_LENGTH * point ||
        gain_of_streak(snr, fitted, moment + 1.0 / 12.0, point + 1.0 / 12.0) < LEAST_GAIN) {
        return;
    }
    /* a uniform streak of this length has this moment */
    double length = sqrt(12.0 * (moment - point)), x = 0.0, y = 0.0, sum = 0.0;
    for (int k = -1; k < count; k++) {
        const generator_source *o = k < 0 ? s : &merged[k];
        if (hypot(o->x - out->x, o->y - out->y) <= length && !is_of_another(g, s, o)) {
            sum += o->flux_e;
            x += o->flux_e * (o->x - s->x);
            y += o->flux_e * (o->y - s->y);
        }
    }
    if (!(sum > 0.0)) { /* the place that was fitted is far from all of them */
        return;
    }
    out->flux_e = sum;
    out->x = s->x + x / sum;
    out->y = s->y + y / sum;
}
