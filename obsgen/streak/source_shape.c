/* Shape in which image processing sees a source, point or streak, and the bias of the stars' fits.
 */
#include <math.h>
#include <string.h>

#include "obsgen/generator_internal.h"
#include "obsgen/streak/path_fit.h"

/* Path deviation, px RMS per axis, below which the bias of a streak's fit is the same for bright
 * and faint stars to 0.01 px. */
static const double UNIFORM_PX = 0.05;

/* Image processing fits both shapes to a point whose streak output is above this share, and to a
 * streak whose squared point output is within these limits below its own
 * (imgproc/measure/locate.c).
 */
static const double CLOSE_SHARE = 0.8, CLEAR_CHI = 3.0, CLEAR_SHARE = 0.04;
/* A shorter path measures less than 1.5 FWHM of a point. */
static const double LEAST_OWN_SIGMAS = 3.9;

bst_streak_model bst_generator_streak_model(const bst_generator *g) {
    return (bst_streak_model){
        .path = g->fit_path, .bend = {g->fit_bend_x, g->fit_bend_y}, .sigma_px = g->total_sigma};
}

bool bst_generator_is_uniform(const bst_generator *g) {
    return !(g->path_rms_px > UNIFORM_PX);
}

/* Light that a point of the PSF at a place finds by least squares on white noise, of the whole. */
static double light_under_point(const bst_star_trail_path *path, double sigma_px,
                                const double at_px[2]) {
    double sum = 0.0;
    for (int k = 0; k < path->count; k++) {
        double dx = path->x_px[k] - at_px[0], dy = path->y_px[k] - at_px[1];
        double share = k == 0 || k == path->count - 1 ? 0.5 : 1.0;
        sum += share * exp(-0.25 * (dx * dx + dy * dy) / (sigma_px * sigma_px));
    }
    return sum / (path->count - 1);
}

/* Lead of a point's fit over a streak's: difference of the outputs of their filters, for a source
 * of SNR 1 without its own noise. A fit lowers chi-square by the square of its filter's output.
 *
 * Given:     streak  squares of the streak's fit
 *            plain   weighted square of all light without the source's own noise
 *            at_px   start of the point's fit
 * Returned:  *flux   light that the point's fit finds, of the whole */
static double point_lead(const bst_star_trail_path *path, const bst_path_light *star, double light,
                         bst_path_fit_squares streak, double plain, double at_px[2], double *flux) {
    const bst_streak_model point = {.sigma_px = star->sigma_px};
    const double start[2] = {at_px[0], at_px[1]};
    bst_path_fit_squares fit = bst_path_fit_light(star, &point, light, at_px);
    double own = sqrt(fmax(1.0 - fit.left / streak.all, 0.0));
    /* a fit that explains nothing: the point is beyond the pixels of a streak at the mean place */
    *flux =
        own > 0.0 ? fmin(fmax(fit.flux, 0.0), 1.0) : light_under_point(path, star->sigma_px, start);
    double other = sqrt(fmax(1.0 - streak.left / streak.all, 0.0));
    return sqrt(streak.all / plain) * (own - other);
}

/* SNR of a source whose filter finds all of its light. */
static double full_snr(const bst_generator *g, const generator_source *s) {
    return s->sharp * s->flux_e * bst_crlb_table_norm(&g->bound, s->length) / g->noise_e;
}

/* True if image processing sees a noisy source as a point: the shape of the greater output, or of
 * the better fit where it fits both. */
static bool is_point(const bst_generator *g, const generator_source *s, const bst_path_outputs *o,
                     double lead) {
    double snr = full_snr(g, s);
    double noise = bst_generator_filter_noise(g, s, 0), other = bst_generator_filter_noise(g, s, 1);
    double point = snr * o->point + noise, streak = snr * o->streak + other;
    if (point > streak) {
        if (!(snr * o->streak_beside + other > CLOSE_SHARE * point)) {
            return true;
        }
    } else {
        double beside = fmax(snr * o->point_beside + noise, 0.0);
        if (!(beside * beside > (1.0 - CLEAR_SHARE) * streak * streak - CLEAR_CHI)) {
            return false;
        }
    }
    return lead * snr + noise > other;
}

double bst_generator_streak_light(const bst_generator *g, double flux_e) {
    /* the brightest pixel of a long line is sqrt(2) sum p^2 of its light */
    double norm = bst_crlb_table_norm(&g->bound, g->streak);
    return sqrt(2.0) * g->excess * flux_e * norm * norm / (g->noise_e * g->noise_e);
}

/* Value of a table by light level for a star of this flux. */
static double by_light(const bst_generator *g, const double table[GENERATOR_BIASES],
                       double flux_e) {
    double light = bst_generator_streak_light(g, flux_e);
    double at = log10(fmax(light, GENERATOR_FIRST_LIGHT) / GENERATOR_FIRST_LIGHT);
    /* inside of the last interval of the table */
    at = fmin(at, GENERATOR_BIASES - 1.001);
    int i = (int)at;
    return table[i] + (at - i) * (table[i + 1] - table[i]);
}

/* Centroid bias of the stars' streaks for each light level, and whether a point fits better. */
static void set_streak_bias(bst_generator *g) {
    const bst_streak_model model = bst_generator_streak_model(g);
    const bool fitted = !bst_generator_is_uniform(g);
    bst_path_light star; /* the same for all of them */
    if (fitted || g->uneven) {
        bst_path_light_make(&g->path, model.sigma_px, &model, &star);
    }
    double light = GENERATOR_FIRST_LIGHT, plain = 1.0;
    double at[2] = {g->outputs.point_at[0], g->outputs.point_at[1]};
    bst_star_trail_bias(&g->path, g->fit_path.dx, g->fit_path.dy, g->fit_bend_x, g->fit_bend_y,
                        g->total_sigma, g->streak_bias[0]);
    for (int i = 0; i < GENERATOR_BIASES; i++, light *= 10.0) {
        bst_path_fit_squares squares = {0.0, 0.0, 0.0};
        if (i > 0) {
            memcpy(g->streak_bias[i], g->streak_bias[i - 1], sizeof g->streak_bias[0]);
        }
        if (fitted && (i > 0 || g->uneven)) {
            squares = bst_path_fit_light(&star, &model, light, g->streak_bias[i]);
        }
        plain = i == 0 ? squares.all : plain;
        g->point_lead[i] = 0.0;
        if (g->uneven) {
            g->point_lead[i] =
                point_lead(&g->path, &star, light, squares, plain, at, &g->point_flux[i]);
        }
    }
}

void bst_generator_set_star_bias(bst_generator *g) {
    if (g->smeared || g->path.count < 3) {
        return;
    }
    if (g->streak > 0.0) {
        set_streak_bias(g);
    }
    double light = GENERATOR_FIRST_LIGHT;
    if (g->uneven) { /* a point is where the star stayed longest */
        memcpy(g->star_bias[0], g->outputs.point_at, sizeof g->star_bias[0]);
    }
    for (int i = 0; i < GENERATOR_BIASES; i++, light *= 10.0) {
        if (i > 0) {
            memcpy(g->star_bias[i], g->star_bias[i - 1], sizeof g->star_bias[0]);
        }
        bst_star_trail_point_bias(&g->path, &g->blend_weights, light, g->bias_sigma,
                                  g->star_bias[i]);
    }
}

bst_star_trail_path bst_generator_object_path(const bst_generator *g, const generator_source *s) {
    const bst_obsgen_path_px *stars = g->smeared ? &g->whole_path : &g->straight_path;
    double dx = s->path.dx - stars->dx, dy = s->path.dy - stars->dy;
    int count = g->path.count;
    int parts = bst_star_trail_parts(&g->path, dx, dy, g->total_sigma, GENERATOR_PLACES);
    for (int k = 0; k < count; k++) {
        double u = (double)k / (count - 1) - 0.5;
        g->object_x[k] = g->path_x[k] + u * dx;
        g->object_y[k] = g->path_y[k] + u * dy;
    }
    count = bst_star_trail_divide(g->object_x, g->object_y, count, parts);
    return (bst_star_trail_path){g->object_x, g->object_y, count};
}

/* Fits an object's elongated point again as a streak of its own (imgproc/measure/source_moments.h),
 * if that leaves less of the light than the point does. */
static void fit_own_streak(const bst_generator *g, const bst_star_trail_path *path, double light,
                           generator_source *s) {
    double c = s->path.dx / s->length, n = s->path.dy / s->length, square = 0.0;
    for (int k = 0; k < path->count; k++) {
        double u = path->x_px[k] * c + path->y_px[k] * n;
        square += (k == 0 || k == path->count - 1 ? 0.5 : 1.0) * u * u / (path->count - 1);
    }
    double length = sqrt(12.0 * square); /* of a uniform streak with this second moment */
    const bst_streak_model own = {.path = {length * c, length * n}, .sigma_px = g->total_sigma},
                           point = {.sigma_px = g->total_sigma};
    double at[2] = {0.0, 0.0}, point_at[2] = {s->start_x, s->start_y};
    bst_path_light seen;
    bst_path_light_make(path, g->total_sigma, &own, &seen);
    bst_path_fit_squares streak = bst_path_fit_light(&seen, &own, light, at);
    s->own_streak = streak.left < bst_path_fit_light(&seen, &point, light, point_at).left;
    if (s->own_streak) {
        s->start_x = at[0];
        s->start_y = at[1];
        s->point_flux = fmin(fmax(streak.flux, 0.0), 1.0);
    }
}

/* Efficiencies of both filters and shape of an object in a frame whose stars have an uneven path.
 */
static void set_uneven_object(const bst_generator *g, generator_source *s, double efficiency[2]) {
    const bst_star_trail_path path = bst_generator_object_path(g, s);
    const bst_path_widths widths = {g->image_sigma, g->filter_sigma, g->bias_sigma};
    const bst_streak_model model = bst_generator_streak_model(g);
    bst_path_outputs o = bst_path_fit_outputs(&path, g->star_path, &widths);
    double light = bst_generator_streak_light(g, s->flux_e), at[2] = {0.0, 0.0};
    bst_star_trail_bias(&path, g->fit_path.dx, g->fit_path.dy, g->fit_bend_x, g->fit_bend_y,
                        g->total_sigma, at);
    bst_path_light seen;
    bst_path_light_make(&path, model.sigma_px, &model, &seen);
    double plain = bst_path_fit_light(&seen, &model, GENERATOR_FIRST_LIGHT, at).all;
    bst_path_fit_squares streak = bst_path_fit_light(&seen, &model, light, at);
    at[0] = s->start_x = o.point_at[0];
    at[1] = s->start_y = o.point_at[1];
    s->as_streak =
        !is_point(g, s, &o, point_lead(&path, &seen, light, streak, plain, at, &s->point_flux));
    efficiency[0] = fmin(o.point, 1.0);
    efficiency[1] = fmin(o.streak, 1.0);
    if (!s->as_streak && s->length > LEAST_OWN_SIGMAS * g->total_sigma &&
        full_snr(g, s) * o.point > GENERATOR_MOMENTS_SNR) {
        fit_own_streak(g, &path, light, s);
    }
}

double bst_generator_set_filter(const bst_generator *g, generator_source *s) {
    const bst_obsgen_path_px point = {0.0, 0.0};
    double efficiency[2] = {g->filters[0].efficiency, g->filters[1].efficiency};
    s->as_streak = s->own_streak = false;
    s->other = 0.0;
    bst_response wide; /* widths alone */
    const bst_response *response = &g->response;
    if (s->blur > 0.0) {
        wide = (bst_response){
            .source = g->response.source, .filter = g->response.filter, .both = g->response.both};
        wide = bst_response_widened(&wide, s->blur);
        response = &wide;
    }
    if (!s->star) {
        efficiency[0] = bst_response_efficiency(response, s->path, point);
    }
    if (!(g->streak > 0.0)) {
        return efficiency[0];
    }
    if (!s->star && g->uneven) {
        set_uneven_object(g, s, efficiency);
    } else if (!s->star) {
        efficiency[1] = bst_response_efficiency(response, s->path, g->star_path);
        s->as_streak = efficiency[1] > efficiency[0];
    } else {
        s->point_flux = g->uneven ? by_light(g, g->point_flux, s->flux_e) : 1.0;
        s->as_streak =
            !(g->uneven && is_point(g, s, &g->outputs, by_light(g, g->point_lead, s->flux_e)));
    }
    s->other = efficiency[!s->as_streak] / efficiency[s->as_streak];
    return efficiency[s->as_streak];
}
