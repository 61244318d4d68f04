/* Matched filters of a generated frame: response to its images, detection threshold, output noise.
 */
#include <math.h>

#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "obsgen/model/wing_alarms.h"
#include "sim/core/threshold_statistics.h"
#include "sim/optics/column_level.h"

/* Shot noise of a source in its own matched filter, relative to pixel noise / sqrt(sum p^2): the
 * sum of k^2 p for a Gaussian at rest, and for a long line. */
static const double POINT_SHOT = 4.0 / 3.0, LINE_SHOT = 1.1547005383792515;

/* Mean square deviation, per axis, of the true path from the path models of image processing. */
typedef struct path_residual {
    double filter_px2; /* from the straight uniform path; for a streak filter, across it */
    /* from the fitted path: a streak model includes the bend known from telemetry */
    double fit_px2;
    double uniform_px2; /* from the path that telemetry reports, without bend */
} path_residual;

/* Sets the straight uniform path nearest to the true one. */
static path_residual fit_straight_path(bst_generator *g) {
    path_residual out = {0.0, 0.0, 0.0};
    g->straight_path = g->whole_path;
    if (g->smeared || g->path.count < 3) {
        return out;
    }
    double moment = 0.0, x = 0.0, y = 0.0;
    int last = g->path.count - 1;
    for (int k = 0; k <= last; k++) {
        double u = (double)k / last - 0.5, weight = k == 0 || k == last ? 0.5 : 1.0;
        moment += weight * u * u;
        x += weight * u * g->path_x[k];
        y += weight * u * g->path_y[k];
    }
    g->straight_path = (bst_obsgen_path_px){x / moment, y / moment};
    double length = hypot(g->star_path.dx, g->star_path.dy);
    bool drawn = length > 0.0;
    double c = drawn ? g->star_path.dx / length : 1.0, s = drawn ? g->star_path.dy / length : 0.0;
    for (int k = 0; k <= last; k++) {
        double u = (double)k / last - 0.5, weight = k == 0 || k == last ? 0.5 : 1.0;
        double dx = g->path_x[k] - u * g->straight_path.dx;
        double dy = g->path_y[k] - u * g->straight_path.dy, across = dy * c - dx * s;
        double bent = drawn ? 6.0 * u * u - 0.5 : 0.0; /* as imgproc's fit models it */
        double ex = dx - bent * g->fit_bend_x, ey = dy - bent * g->fit_bend_y;
        out.filter_px2 += weight * (drawn ? across * across : 0.5 * (dx * dx + dy * dy)) / last;
        out.fit_px2 += weight * 0.5 * (ex * ex + ey * ey) / last;
        double ux = g->path_x[k] - u * g->star_path.dx, uy = g->path_y[k] - u * g->star_path.dy;
        out.uniform_px2 += weight * 0.5 * (ux * ux + uy * uy) / last;
    }
    return out;
}

/* Geometric mean width of an image, px. */
static double mean_width(const bst_obsgen_image_width *w) {
    return sqrt(w->across_px * w->along_px);
}

/* Path deviation per axis, in widths of the filter output, from which the filters' outputs are
 * computed for the true path; below, they are those of the nearest uniform path to 2 %. */
static const double UNEVEN_SIGMAS = 0.7;

/* Sets the outputs of the filters for a star whose path is far from the filtered one. */
static void set_uneven_outputs(bst_generator *g, double uniform_px2) {
    g->uneven = g->streak > 0.0 && g->path.count >= 3 &&
                uniform_px2 > UNEVEN_SIGMAS * UNEVEN_SIGMAS * g->bias_sigma * g->bias_sigma;
    if (g->uneven) {
        const bst_path_widths widths = {g->image_sigma, g->filter_sigma, g->bias_sigma};
        g->outputs = bst_path_fit_outputs(&g->path, g->star_path, &widths);
        g->filters[0].efficiency = fmin(g->outputs.point, 1.0);
        g->filters[1].efficiency = fmin(g->outputs.streak, 1.0);
    }
}

void bst_generator_set_response(bst_generator *g, const bst_generator_frame *f) {
    bst_response response;
    if (f->response) {
        response = *f->response;
    } else {
        const bst_response_side source = {NULL, g->sigma * g->binning};
        /* as in imgproc/detect/detect.c */
        const bst_response_side filter = {NULL, fmax(g->onboard_sigma_px, 0.2 * g->binning)};
        bst_response_set(&response, &source, &filter, g->binning, 0.0, 0.0);
    }
    path_residual residual = fit_straight_path(g);
    g->response = bst_response_widened(&response, residual.filter_px2);
    bst_response fitted = bst_response_widened(&response, residual.fit_px2);
    g->widening = mean_width(&fitted.source) / mean_width(&response.source);
    g->known_width = mean_width(&g->response.filter) / mean_width(&response.source);
    g->fit_px2 = g->response.filter.across_px * g->response.filter.along_px;
    g->cross_sigma = mean_width(&g->response.both);
    g->bias_sigma = mean_width(&response.both);
    g->image_sigma = mean_width(&response.source);
    g->filter_sigma = mean_width(&g->response.filter);
    /* the position is determined by the image's gradient */
    double ratio = g->response.maxima_sigma_px / g->filter_sigma;
    g->image_bound = f->image_bound;
    g->onboard_bound = f->onboard_bound;
    g->place_ratio2 = g->image_bound && g->onboard_bound ? 1.0 : ratio * ratio;
    const bst_obsgen_path_px rest = {0.0, 0.0}, paths[2] = {rest, g->star_path};
    for (int k = 0; k < (g->streak > 0.0 ? 2 : 1); k++) {
        g->filters[k] = (bst_generator_filter){
            .efficiency = bst_response_efficiency(&g->response,
                                                  g->smeared ? rest : g->straight_path, paths[k])};
        g->norm_ratio[k] =
            sqrt(bst_response_product(&g->response.filter, paths[k], paths[k]) /
                 bst_matched_product(paths[k], paths[k], mean_width(&response.source)));
    }
    g->path_rms_px = sqrt(residual.fit_px2);
    set_uneven_outputs(g, residual.uniform_px2);
    const bst_obsgen_image_width *w = &g->response.filter;
    g->shared_noise = fmin(bst_response_product(w, g->star_path, rest) /
                               sqrt(bst_response_product(w, rest, rest) *
                                    bst_response_product(w, g->star_path, g->star_path)),
                           1.0);
}

/* Image processing makes its fits' Gaussian as wide as bright stars are: the same limits as in
 * imgproc/measure/frame_width.c and locate.c. */
static const double ADAPTS_FROM = 0.15, ADAPTS_SNR = 20.0;
enum { ADAPTS_STARS = 5 };

void bst_generator_adapt_width(bst_generator *g) {
    double filter = g->fit_px2, image = g->image_sigma * g->widening;
    int bright = 0;
    for (int i = 0; i < g->source_count; i++) {
        bright += g->sources[i].found && g->sources[i].amplitude > ADAPTS_SNR;
    }
    /* the profiles' variances are those without the pixel's; far from a uniform path, images are no
     * wider PSF */
    if (g->uneven || g->smeared || bright < ADAPTS_STARS ||
        fabs(image * image - filter) < ADAPTS_FROM * fmax(filter - 1.0 / 12.0, 0.04)) {
        return;
    }
    g->known_width = g->widening;
    g->fit_px2 = g->response.source.across_px * g->response.source.along_px;
    const bst_obsgen_path_px rest = {0.0, 0.0}, paths[2] = {rest, g->star_path};
    for (int k = 0; k < (g->streak > 0.0 ? 2 : 1); k++) {
        g->norm_ratio[k] = sqrt(bst_matched_product(paths[k], paths[k], image) /
                                bst_matched_product(paths[k], paths[k], g->image_sigma));
    }
}

/* Sets the detection threshold, cached by streak length. Streaks are counted in steps of half a
 * pixel, as the filters do. */
static void set_threshold(bst_generator *g) {
    struct generator_thresholds *t = &g->thresholds;
    double sigma = g->response.maxima_sigma_px;
    if (t->width != g->width || t->height != g->height || t->sigma != sigma) {
        *t = (struct generator_thresholds){.width = g->width, .height = g->height, .sigma = sigma};
    }
    int step = (int)floor(2.0 * g->streak + 0.5);
    step = step < GENERATOR_STEPS ? step : GENERATOR_STEPS - 1;
    if (!(t->threshold[step] > 0.0)) {
        t->threshold[step] =
            bst_matched_threshold(sigma, 0.5 * step, g->settings.false_alarms_per_frame,
                                  (double)g->width * g->height, &t->streak_share[step]);
    }
    double threshold = t->threshold[step];
    g->streak_share = t->streak_share[step];
    if (g->open_share < 1.0) { /* noise causes detections only on open sky */
        threshold = bst_matched_threshold(sigma, 0.5 * step, g->settings.false_alarms_per_frame,
                                          g->open_share * g->width * g->height, &g->streak_share);
    }
    g->threshold = fmax(threshold + g->calibration.threshold_offset, 1.0);
}

/* Sum over an axis of the squared cross sums of a unit-norm filter smeared by `moved` px on that
 * axis: its response to offsets of rows or columns. */
static double offset_response(const bst_generator *g, double moved, double square) {
    const bst_obsgen_path_px shadow = {moved, 0.0};
    double width = g->filter_sigma;
    /* the integral across a Gaussian is that of the product over 1 / (2 sqrt(pi) width) */
    return bst_matched_product(shadow, shadow, width) * 2.0 * sqrt(BST_PI) * width / square;
}

/* Variance of a filter's output relative to white noise of equal pixel variance, if `columns` and
 * `rows` are the shares of column and row offsets. */
static double output_variance(const bst_generator *g, const bst_obsgen_path_px *path,
                              double columns, double rows) {
    if (columns == 0.0 && rows == 0.0) {
        return 1.0;
    }
    double square = bst_response_product(&g->response.filter, *path, *path);
    return g->white_share + columns * offset_response(g, path->dx, square) +
           rows * offset_response(g, path->dy, square);
}

/* Sums of powers of a unit-norm filter for the threshold statistics: Gaussian across, uniform along
 * the streak. */
static void set_weights(const bst_generator *g, double length, bst_threshold_weights *out) {
    double s = g->filter_sigma, even = sqrt(length * length + BST_PI * s * s);
    double top = 1.0 / sqrt(sqrt(BST_PI) * s * even), power = top * top;
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        int n = i + 3;
        power *= top;
        double along = length > 0.0 ? even : sqrt(2.0 * BST_PI / n) * s;
        out->power[i] = power * sqrt(2.0 * BST_PI / n) * s * along;
    }
}

/* Shot-noise part of the noise as image processing assumes it: total minus read noise. */
static bst_threshold_noise noise_law(const bst_generator *g) {
    const bst_camera *c = g->camera;
    double gain = c->gain_e_per_dn, variance = g->noise_e * g->noise_e;
    double read_e = bst_camera_read_noise_e(c);
    double normal = read_e * read_e + gain * gain / 12.0;
    double counted = fmax(variance - normal, 0.0);
    if (normal < 1.0) {
        counted = fmax(counted, fmin(g->background_e, variance));
    }
    /* multiplied electrons are as skewed as Poisson charges of so many electrons each */
    double charge = bst_wing_alarms_cube(g->excess) / g->excess;
    return (bst_threshold_noise){g->noise_e / charge, counted / (charge * charge), gain / charge};
}

/* True if image processing subtracts a level per column in this frame. */
static bool has_levels(const bst_generator *g) {
    return g->levels_columns && g->height >= BST_COLUMN_LEVEL_LEAST_ROWS;
}

double bst_generator_column_variance(const bst_generator *g) {
    double offset_e = g->camera->detector.column_offset_rms_e;
    return has_levels(g) ? 0.0 : offset_e * offset_e;
}

/* Share of a pixel's variance that is common to its column. The level subtracted is the mean of its
 * rows and removes their noise too: one row's share is missing. */
static double column_share(const bst_generator *g, double variance) {
    int rows = g->height < BST_COLUMN_LEVEL_MOST_ROWS ? g->height : BST_COLUMN_LEVEL_MOST_ROWS;
    return has_levels(g) ? -1.0 / rows : bst_generator_column_variance(g) / variance;
}

void bst_generator_set_filters(bst_generator *g) {
    /* peak of a Gaussian over its sqrt(sum p^2) */
    g->fit_light = g->excess / (sqrt(BST_PI) * g->cross_sigma * g->noise_e * g->noise_e);
    set_threshold(g);
    const bst_obsgen_path_px paths[2] = {{0.0, 0.0}, g->star_path};
    const double lengths[2] = {0.0, g->streak};
    const bst_threshold_noise law = noise_law(g);
    const bst_detector_config *d = &g->camera->detector;
    double variance = g->noise_e * g->noise_e;
    double columns = column_share(g, variance);
    double rows = (d->row_offset_rms_e * d->row_offset_rms_e + d->row_noise_e * d->row_noise_e +
                   d->flicker_noise_e * d->flicker_noise_e) /
                  variance;
    /* the alarm rate is not defined for offsets alone */
    g->white_share = fmax(1.0 - columns - rows, 0.05);
    for (int k = 0; k < 2; k++) {
        bst_generator_filter *filter = &g->filters[k];
        bst_threshold_weights weights;
        set_weights(g, lengths[k], &weights);
        /* maxima of smeared frames are not interpolated */
        filter->threshold =
            g->smeared ? g->threshold
                       : fmax(bst_threshold_quantile(g->threshold, &weights, &law), g->threshold);
        filter->variance = output_variance(g, &paths[k], columns, rows);
        double share = lengths[k] > g->filter_sigma ? LINE_SHOT : POINT_SHOT;
        filter->shot = share * bst_camera_excess_noise(g->camera) *
                       bst_crlb_table_norm(&g->bound, lengths[k]) / g->noise_e;
        if (!(g->streak > 0.0)) {
            g->filters[1] = g->filters[0];
            break;
        }
    }
}

/* A frame with more than one maximum per CROWDED_PX pixels is crowded. Image processing then
 * estimates background and noise from pixels at least SPARED_PX away from star outputs above
 * STAR_SNR. */
static const double CROWDED_PX = 400.0, STAR_SNR = 3.0, LEAST_OPEN = 0.02;
enum { SPARED_PX = 2 };

double bst_generator_open_share(const bst_generator *g) {
    double pixels = (double)g->width * g->height, covered = 0.0, maxima = 0.0;
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        maxima += s->amplitude > bst_generator_looks_from(g);
        if (s->amplitude > STAR_SNR) {
            /* area: the circle where the output exceeds STAR_SNR, extended by SPARED_PX, along the
             * streak */
            double r = 2.0 * g->cross_sigma * sqrt(log(s->amplitude / STAR_SNR)), h = SPARED_PX;
            covered += BST_PI * r * r + 8.0 * h * r + 4.0 * h * h + 2.0 * (r + h) * s->length;
        }
    }
    return maxima > pixels / CROWDED_PX ? fmax(exp(-covered / pixels), LEAST_OPEN) : 1.0;
}
