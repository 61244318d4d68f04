#include <math.h>

#include "obsgen/generator_internal.h"
#include "obsgen/model/place_error.h"
#include "sim/onboard/other_path.h"

/* Lower limit of the visible share used for errors. */
static const double LEAST_SEEN = 0.02;
/* Draws of a point's error until its maximum exceeds the threshold, and their number's place in
 * that of the random stream. */
enum { POINT_TRIALS = 8, TRIAL_BITS = 52 };

double bst_generator_saturation_e(const bst_generator *g) {
    const bst_camera *c = g->camera;
    double converter_e = (ldexp(1.0, (int)c->bits) - 1.0 - c->offset_dn) * c->gain_e_per_dn;
    /* saturated from 98 % of the full well, as in imgproc/detect/detect.c */
    return fmin(converter_e, 0.98 * bst_camera_full_e(c) * g->binning * g->binning) -
           g->background_e;
}

/* Bias of a saturated star's streak: the saturated pixels, where the star moved least, are left out
 * of the fit. */
static void saturated_bias(const bst_generator *g, const generator_source *s, double light,
                           double bias[2]) {
    bst_streak_model model = bst_generator_streak_model(g);
    double peak_e = s->flux_e / (2.0 * BST_PI * model.sigma_px * model.sigma_px);
    model.saturated = fmax(bst_generator_saturation_e(g), 0.0) / peak_e;
    bst_star_trail_bias(&g->path, g->fit_path.dx, g->fit_path.dy, g->fit_bend_x, g->fit_bend_y,
                        g->total_sigma, bias);
    bst_path_fit(&g->path, &model, light, bias);
}

/* Mean centroid bias of a fit: stars share the bias by the camera motion; an object in different
 * motion has its own. */
static void shared_bias(const bst_generator *g, const generator_source *s, bool as_streak,
                        double light, double bias[2]) {
    bool shared = s->star || s->broken || g->path.count < 3;
    bias[0] = bias[1] = 0.0;
    if (g->followed && !s->saturated) {
        return;
    }
    if (shared && as_streak && s->saturated && !bst_generator_is_uniform(g)) {
        saturated_bias(g, s, light, bias);
        return;
    }
    if (shared) {
        const double(*table)[2] = as_streak ? g->streak_bias : g->star_bias;
        double at = log10(fmax(light, GENERATOR_FIRST_LIGHT) / GENERATOR_FIRST_LIGHT);
        /* inside of the last interval of the table */
        at = fmin(at, GENERATOR_BIASES - 1.001);
        int i = (int)at;
        for (int k = 0; k < 2; k++) {
            bias[k] = table[i][k] + (at - i) * (table[i + 1][k] - table[i][k]);
        }
        return;
    }
    if (s->own_streak) {
        bias[0] = s->start_x;
        bias[1] = s->start_y;
        return;
    }
    const bst_star_trail_path path = bst_generator_object_path(g, s);
    bias[0] = bias[1] = 0.0;
    if (!as_streak) {
        bias[0] = s->start_x;
        bias[1] = s->start_y;
        bst_star_trail_point_bias(&path, &g->blend_weights, light, g->bias_sigma, bias);
        return;
    }
    bst_star_trail_bias(&path, g->fit_path.dx, g->fit_path.dy, g->fit_bend_x, g->fit_bend_y,
                        g->total_sigma, bias);
    if (!bst_generator_is_uniform(g)) {
        const bst_streak_model model = bst_generator_streak_model(g);
        bst_path_fit(&path, &model, light, bias);
    }
}

/* Centroid standard deviation along an axis for a fit with another width, relative to the matched
 * one: sum (q')^2 sum (p')^2 over (sum p' q')^2, for Gaussians at rest with these variances along
 * the axis and across. The width measured by image processing is in the model but not in its
 * gradient. */
static double mismatch_factor(const double image[2], const double model[2]) {
    double along = 0.25 * (image[0] + model[0]) * (image[0] + model[0]) / (image[0] * model[0]);
    double across = 0.25 * (image[1] + model[1]) * (image[1] + model[1]) / (image[1] * model[1]);
    return sqrt(along * sqrt(along * across));
}

/* Cramer-Rao bound of an image widened by the path's deviation from the fitted path. */
static bst_crlb_table_at bound_of_image(const bst_generator *g, double flux_e, double length) {
    const bst_crlb_table *bound = g->image_bound ? g->image_bound : &g->bound;
    return bst_crlb_table_wider(bound, flux_e, g->noise_e, length, g->widening, g->excess);
}

/* Cramer-Rao bound of the fitted image. */
static bst_crlb_table_at bound_of_model(const bst_generator *g, double flux_e, double length) {
    const bst_crlb_table *bound = g->onboard_bound ? g->onboard_bound : &g->bound;
    double wider = g->onboard_bound ? 1.0 : g->known_width;
    return bst_crlb_table_wider(bound, flux_e, g->noise_e, length, wider, g->excess);
}

bool bst_generator_fits_point(const bst_generator *g, const generator_source *s,
                              const generator_blend *b) {
    if (!s->as_streak || b->drawn) {
        return false;
    }
    /* A fit lowers chi-square by the squared filter output. */
    return bst_generator_other_output(s, s->amplitude) + bst_generator_other_noise(g, s) >
           s->amplitude + s->noise;
}

/* Draws the position error of a point, in standard deviations of the linear fit: that of a maximum
 * of the output that exceeds the threshold. */
static void draw_point_error(const bst_generator *g, const generator_source *s, double snr,
                             double error[2]) {
    double spread = fmax(s->spread, 1e-3), threshold = g->filters[0].threshold;
    snr = fmax(snr, 1.0); /* below, the maximum is one of the noise alone */
    double level = fmax(fmax(snr + s->spread * s->noise, threshold - 1.0 / snr), 0.1), output = 0.0;
    for (int trial = 0; trial < POINT_TRIALS && output <= threshold; trial++) {
        uint64_t first = (uint64_t)trial << TRIAL_BITS | s->name * GENERATOR_DRAWS;
        double h[3] = {0.0, 0.0,
                       bst_rng_normal(g->key, (uint64_t)g->exposure_id, first + GENERATOR_TWIST)};
        bst_rng_normal2(g->key, (uint64_t)g->exposure_id, first + GENERATOR_CURVATURE, h);
        bst_rng_normal2(g->key, (uint64_t)g->exposure_id, first + GENERATOR_PLACE, error);
        /* own shot noise is part of the noise at the source */
        output = spread * bst_place_error_bend(snr / spread, level / spread, h, error);
    }
}

/* Position with error and covariance, along and across the path. */
static void measure_place(const bst_generator *g, const generator_source *s,
                          const generator_blend *b, const bst_crlb_table_at *truth,
                          const bst_crlb_table_at *crlb, double snr, double length,
                          bst_detection *d) {
    const bst_obsgen_calibration *cal = &g->calibration;
    double across = bst_obsgen_between(bst_obsgen_snrs, cal->across_factor, BST_OBSGEN_SNRS, snr);
    double along =
        length > 1.0 ? bst_obsgen_between(bst_obsgen_snrs, cal->along_factor, BST_OBSGEN_SNRS, snr)
                     : across;
    double error[2];
    if (!b->drawn && length <= 1.0 && snr < BST_PLACE_ERROR_MOST_SNR) {
        double core =
            bst_obsgen_between(bst_obsgen_snrs, bst_place_error_core, BST_OBSGEN_SNRS, snr);
        draw_point_error(g, s, snr, error);
        across /= core;
        along /= core;
    } else {
        bst_rng_normal2(g->key, (uint64_t)g->exposure_id,
                        s->name * GENERATOR_DRAWS + GENERATOR_PLACE, error);
    }
    /* light off the frame carries no information; the position along a streak comes from its ends
     */
    double widen_along =
        b->widen * g->place_ratio2 / fmax(length > 1.0 ? s->ends : s->visible, LEAST_SEEN);
    double widen_across = b->widen * g->place_ratio2 / fmax(s->visible, LEAST_SEEN);
    /* the part of `sharp` beyond image width (which `truth` covers): the local background */
    const bst_crlb_table *bound = g->image_bound ? g->image_bound : &g->bound;
    double sharp = s->sharp * bst_crlb_table_norm(bound, s->length) / truth->norm;
    /* Saturated pixels are left out of the fit, whose covariance is that of the others: in images
     * three stars of SNR 79,000 to 161,000 have errors of 1.6 to 2.0 times the bound. */
    const double left_out = s->saturated && !b->drawn ? 2.0 : 1.0;
    double worse = left_out / fmin(sharp, 1.0);
    double open = b->drawn ? 0.0 : worse;
    /* `sharp` has the lower SNR of a shape already */
    double c = s->length > 0.0 ? s->path.dx / s->length : 1.0;
    double n = s->length > 0.0 ? s->path.dy / s->length : 0.0;
    if (s->shape_xx + s->shape_yy > 0.0 && !(s->length > 1.0)) { /* the axes of its image */
        double angle = 0.5 * atan2(2.0 * s->shape_xy, s->shape_xx - s->shape_yy);
        c = cos(angle);
        n = sin(angle);
    }
    const double shape[2] = {bst_generator_image_factor(g, s, c, n),
                             bst_generator_image_factor(g, s, -n, c)};
    open *= s->snr_ratio;
    /* a point model fitted to a short streak */
    double streak = length > 0.0 ? 0.0 : s->length * s->length / 12.0;
    const double model = g->fit_px2;
    const double image = g->response.source.across_px * g->response.source.along_px;
    const double images[2] = {image + streak, image}, turned[2] = {image, image + streak};
    const double models[2] = {model, model};
    /* the position along a streak comes from its ends and flanks, whatever its bend */
    bool at_rest = length <= 1.0;
    error[0] *= along * open * (at_rest ? mismatch_factor(images, models) : 1.0) * b->flat *
                shape[0] * sqrt(truth->var_along_px2 * widen_along);
    error[1] *= across * open * (at_rest ? mismatch_factor(turned, models) : 1.0) * shape[1] *
                sqrt(truth->var_across_px2 * widen_across);
    double x = b->x + c * error[0] - n * error[1], y = b->y + n * error[0] + c * error[1];
    double bias = cal->phase_bias_px / g->binning, shared[2];
    bool drawn = s->as_streak && !b->point;
    double light =
        drawn ? bst_generator_streak_light(g, b->flux_e) : b->flux_e * truth->norm * g->fit_light;
    shared_bias(g, s, drawn, light, shared);
    x += shared[0] + bias * sin(2.0 * BST_PI * b->x);
    y += shared[1] + bias * sin(2.0 * BST_PI * b->y);
    double scale = g->binning, unit2 = scale * scale * left_out * left_out;
    double a2 = crlb->var_along_px2 * widen_along * unit2 * shape[0] * shape[0];
    double b2 = crlb->var_across_px2 * widen_across * unit2 * shape[1] * shape[1];
    d->x_px = g->origin_x + scale * x;
    d->y_px = g->origin_y + scale * y;
    d->cov_xx = c * c * a2 + n * n * b2;
    d->cov_xy = c * n * (a2 - b2);
    d->cov_yy = n * n * a2 + c * c * b2;
}

/* True if image processing would measure an image of this length as longer than a point. */
static bool is_drawn_out(const bst_generator *g, const generator_source *s) {
    double across2 = g->sigma * g->sigma, along2 = across2 + s->length * s->length / 12.0;
    return BST_FWHM_PER_SIGMA * sqrt(along2) > 1.5 * fmax(BST_FWHM_PER_SIGMA * sqrt(across2), 1.0);
}

/* Sets length, width and angle of a detection. */
static void set_extent(const bst_generator *g, const generator_source *s, bool as_streak,
                       bst_detection *d) {
    double modelled = as_streak ? g->streak : 0.0, b = g->binning;
    /* on an uneven path a point is the bright part of the light */
    double length = d->snr >= GENERATOR_MOMENTS_SNR && (as_streak || s->own_streak || !g->uneven)
                        ? s->length
                        : modelled;
    double across2 = g->sigma * g->sigma, along2 = across2 + length * length / 12.0;
    d->length_px = b * BST_FWHM_PER_SIGMA * sqrt(along2);
    d->width_px = b * BST_FWHM_PER_SIGMA * sqrt(across2);
    d->angle_rad = length > 0.01 ? atan2(s->path.dy, s->path.dx) : 0.0;
    if (d->snr >= GENERATOR_MOMENTS_SNR && s->shape_xx + s->shape_yy > 0.0) {
        bst_generator_set_image_extent(g, s, length, d);
    }
    if (d->angle_rad > 0.5 * BST_PI) {
        d->angle_rad -= BST_PI;
    } else if (d->angle_rad <= -0.5 * BST_PI) {
        d->angle_rad += BST_PI;
    }
    bool long_enough = d->length_px > 1.5 * fmax(d->width_px, b);
    if (as_streak || (d->snr >= GENERATOR_MOMENTS_SNR && long_enough)) {
        d->flags |= BST_DETECTION_STREAK;
    }
}

/* Nearest pixel of the frame along an axis. */
static double on_frame(double at, double first, int last) {
    return fmin(fmax(at, first), first + last);
}

/* Detection of a source centred off the frame: image processing fits the visible part as a point.
 */
static void fit_visible_part(const bst_generator *g, const generator_source *s, bst_detection *d) {
    double off_x = g->binning * (s->seen_x - s->x), off_y = g->binning * (s->seen_y - s->y);
    d->x_px = on_frame(d->x_px + off_x, g->origin_x, g->binning * (g->width - 1));
    d->y_px = on_frame(d->y_px + off_y, g->origin_y, g->binning * (g->height - 1));
    d->flux_e *= s->visible;
    d->flux_sigma_e *= s->visible;
    d->snr *= sqrt(s->visible);
    d->v_mag -= 2.5 * log10(s->visible);
    d->flags &= ~(unsigned)BST_DETECTION_STREAK;
    d->label = BST_LABEL_ARTEFACT;
}

/* Share of a moving source's light that a fit of a point to it finds. The point has the mean width
 * of the stars' images (widening of imgproc/measure/locate.c), and with it that of their paths
 * where they are fitted as points. */
static double caught_by_point(const bst_generator *g, const generator_source *s) {
    if (g->uneven) {
        return s->point_flux;
    }
    const bst_obsgen_path_px rest = {0.0, 0.0};
    double image = g->response.source.across_px * g->response.source.along_px;
    double stars =
        g->straight_path.dx * g->straight_path.dx + g->straight_path.dy * g->straight_path.dy;
    double fitted = image + (g->streak > 0.0 ? 0.0 : stars / 24.0);
    return bst_matched_product(s->path, rest, sqrt(0.5 * (image + fitted))) /
           bst_matched_product(rest, rest, sqrt(fitted));
}

double bst_generator_fit_norm(const bst_generator *g, const generator_source *s, double length_px,
                              bool as_streak) {
    double norm = g->onboard_bound
                      ? bst_crlb_table_norm(g->onboard_bound, length_px)
                      : bst_crlb_table_norm(&g->bound, length_px) * g->norm_ratio[as_streak];
    return norm / g->noise_e * s->snr_ratio;
}

/* True if image processing finds that a streak is no star's (imgproc/measure/other_path.h): by the
 * light that the stars' path leaves of it. */
static bool is_of_other_path(const bst_generator *g, const generator_source *s, bool as_streak,
                             const bst_detection *d) {
    const unsigned unclear = BST_DETECTION_BLEND | BST_DETECTION_EDGE | BST_DETECTION_SATURATED;
    if (!(g->streak > 0.0) || s->star || !(d->flags & BST_DETECTION_STREAK) ||
        (d->flags & unclear) || d->snr < GENERATOR_MOMENTS_SNR) {
        return false;
    }
    const bst_obsgen_path_px *own = &s->path, *stars = &g->straight_path;
    if (g->streak < BST_OTHER_PATH_SHORT_FWHM * BST_FWHM_PER_SIGMA * g->fitted_sigma) {
        return !as_streak && d->length_px > BST_OTHER_PATH_LONG_SHARE * d->width_px;
    }
    const double apart = bst_paths_apart_px(own->dx, own->dy, stars->dx, stars->dy);
    const double same = bst_matched_efficiency(*own, *stars, g->total_sigma);
    return !as_streak || (apart > BST_OTHER_PATH_PX + BST_OTHER_PATH_SHARE * g->streak &&
                          (1.0 - same * same) * d->snr * d->snr > BST_OTHER_PATH_GAIN);
}

bst_detection bst_generator_measure(const bst_generator *g, const generator_source *s,
                                    const generator_blend *b) {
    bst_detection d = {0};
    double seen = fmax(s->visible, LEAST_SEEN);
    /* the point filter's flux of a streak too faint to be fitted as one */
    bool own = !b->point && (s->as_streak || s->own_streak || s->peak >= GENERATOR_MOMENTS_SNR ||
                             s->length < 0.5);
    double length = own && (s->as_streak || is_drawn_out(g, s)) ? s->length : 0.0;
    double caught = own && !s->own_streak ? 1.0 : caught_by_point(g, s);
    double flux = b->flux_e * caught;
    /* errors follow the image's bound; the stated covariance follows that of the onboard PSF */
    bst_crlb_table_at truth = bound_of_image(g, b->flux_e, s->length);
    bst_crlb_table_at fitted = bound_of_model(g, flux, length);
    /* flux is correlated with the detected peak: nearly the same filter on the same noise */
    const double together = 0.95;
    double noise = together * s->noise +
                   sqrt(1.0 - together * together) * bst_generator_draw(g, s, GENERATOR_FLUX);
    flux -= g->background_bias_e / (fitted.norm * fitted.norm);
    /* least flux of a step of the fit, as in imgproc/measure/fit.c */
    d.flux_e = fmax(flux + noise * sqrt(fitted.flux_variance * b->widen / seen) / s->snr_ratio,
                    0.1 * fabs(flux));
    if (b->drawn) {
        d.flux_e = b->snr * g->noise_e / fitted.norm;
    }
    bst_crlb_table_at crlb = bound_of_model(g, d.flux_e, length);
    d.flux_sigma_e = sqrt(crlb.flux_variance * b->widen / seen) / s->snr_ratio;
    d.snr = d.flux_e * bst_generator_fit_norm(g, s, length, own && s->as_streak);
    measure_place(g, s, b, &truth, &crlb, b->flux_e * truth.norm / g->noise_e, length, &d);
    d.v_mag = -2.5 * log10(d.flux_e / (fmax(g->exposure_s, 1e-9) * g->electrons_per_s_v0));
    set_extent(g, s, s->as_streak && !b->point, &d);
    d.flags |= b->near ? BST_DETECTION_BLEND : 0u;
    d.flags |= s->saturated ? BST_DETECTION_SATURATED : 0u;
    double half_x = 0.5 * fabs(s->path.dx) + 2.0 * g->sigma;
    double half_y = 0.5 * fabs(s->path.dy) + 2.0 * g->sigma;
    if (s->x - half_x < -0.5 || s->y - half_y < -0.5 || s->x + half_x > g->width - 0.5 ||
        s->y + half_y > g->height - 0.5) {
        d.flags |= BST_DETECTION_EDGE;
    }
    if (s->x < -0.5 || s->y < -0.5 || s->x > g->width - 0.5 || s->y > g->height - 0.5) {
        fit_visible_part(g, s, &d);
    }
    if (is_of_other_path(g, s, s->as_streak && !b->point, &d)) {
        d.flags |= BST_DETECTION_OTHER_PATH;
    }
    return d;
}
