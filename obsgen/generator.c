#include "obsgen/generator.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/camera_motion.h"
#include "obsgen/generator_internal.h"
#include "obsgen/model/false_alarms.h"
#include "obsgen/streak/streak_breakup.h"
#include "sim/optics/column_level.h"

/* In a smeared frame, sources that move less than this are seen as one maximum. */
static const double ROUGH_PX = 8.0;
/* Clip level of image processing for background and noise, sigma. */
static const double CLIP_SIGMA = 3.0;
/* Sources with a smaller share of their image on the frame, and less than this SNR of it, are not
 * generated. */
static const double LEAST_VISIBLE = 0.01, LEAST_VISIBLE_SNR = 1.0;
/* Ghosts of one source with random draws of their own. */
enum { GHOST_STREAMS = 32 };
/* SNR below which noise alone determines a maximum, as in bst_obsgen_peak. */
static const double LEAST_RAISED = 3.0;

bst_status bst_generator_create(bst_ctx *ctx, const bst_camera *camera, const bst_camera *knowledge,
                                const bst_generator_settings *settings,
                                const bst_obsgen_calibration *calibration, bst_rng_key key,
                                bst_generator **out) {
    assert(camera && knowledge && settings && calibration && out);
    *out = NULL;
    bst_generator *g = calloc(1, sizeof *g);
    if (!g) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the observation generator");
    }
    g->camera = camera;
    g->electrons_per_s_v0 = bst_camera_electrons_per_s(knowledge, 0.0);
    g->onboard_sigma_px = hypot(bst_camera_psf_sigma_px(knowledge), settings->jitter_px);
    g->settings = *settings;
    g->settings.mesh_px = settings->mesh_px > 0 ? settings->mesh_px : 64;
    g->levels_columns = bst_column_level_wanted(settings->column_correction, knowledge);
    g->calibration = *calibration;
    bst_blend_weights_init(&g->blend_weights);
    g->key = key;
    g->items = calloc((size_t)settings->capacity, sizeof *g->items);
    g->centroid_error = calloc(1, sizeof *g->centroid_error);
    if (!g->items || !g->centroid_error) {
        bst_generator_free(g);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d detections", settings->capacity);
    }
    *out = g;
    return BST_OK;
}

void bst_generator_free(bst_generator *g) {
    if (g) {
        free(g->items);
        free(g->centroid_error);
        free(g->sources);
        free(g->ranks);
        free(g->route);
        free(g->way);
        bst_streak_breakup_free(g->streaks);
        bst_local_sky_free(&g->wing_sky);
        free(g->path_x);
        free(g->path_y);
        free(g->object_x);
        free(g->object_y);
        free(g);
    }
}

double bst_generator_peak_e(double sigma_px, const bst_truth_item *item) {
    double sigma = fmax(sigma_px, 0.1);
    double length = hypot(item->x_end_px - item->x_start_px, item->y_end_px - item->y_start_px);
    double across = erf(0.5 / (sigma * sqrt(2.0)));
    double along = across;
    if (length > 1e-3) {
        double s = sigma * sqrt(2.0), a = 0.5 * (length + 1.0) / s, b = 0.5 * (length - 1.0) / s;
        /* a segment over a pixel at its middle */
        double second =
            (a * erf(a) + exp(-a * a) / sqrt(BST_PI)) - (b * erf(b) + exp(-b * b) / sqrt(BST_PI));
        along = fmin(along, s * second / length);
    }
    return item->electrons * across * along;
}

/* SNR of a true source relative to one with the PSF alone on the mean background. Jitter and path
 * bend widen the image, and the local background may differ. */
static double snr_factor(const bst_generator *g, const bst_generator_frame *f,
                         const bst_truth_item *item, const generator_source *s) {
    double level_e = f->truth->background_e + f->truth->dark_e;
    double read_e = bst_camera_read_noise_e(g->camera);
    double v = (double)g->binning * g->binning * bst_camera_excess_noise(g->camera) * level_e +
               read_e * read_e;
    const bst_crlb_table *bound = g->image_bound ? g->image_bound : &g->bound;
    double plain = item->electrons * bst_crlb_table_norm(bound, s->length) / sqrt(fmax(v, 1e-6));
    bool known = item->snr > 0.0 && plain > 0.0;
    /* limits: noise variance of 25 times and of a quarter of that of the frame */
    double factor = known ? fmin(fmax(item->snr / s->snr_ratio / plain, 0.2), 2.0) : 1.0;
    return factor * s->snr_ratio;
}

/* Motion of a ghost over that of its source; path: of the ghost. By a table that of a ghost of a
 * star, whose path is the stars'. */
static double ghost_motion(const bst_generator *g, const bst_ghost *ghost,
                           const bst_obsgen_path_px *path) {
    if (ghost->map.columns == 0) {
        return ghost->factor;
    }
    const bst_obsgen_path_px *stars = &g->whole_path;
    double square = stars->dx * stars->dx + stars->dy * stars->dy;
    double motion = square > 0.0 ? (path->dx * stars->dx + path->dy * stars->dy) / square : 0.0;
    return fmin(fmax(motion, -ghost->map.magnification), ghost->map.magnification);
}

/* Position of a true source in frame pixels; false if nothing of it is on the frame. ghost: that
 * the source is; NULL: none. */
static bool position_source(const bst_generator *g, const bst_generator_frame *f,
                            const bst_truth_item *item, const bst_ghost *ghost,
                            generator_source *s) {
    double b = g->binning;
    if (!(item->electrons > 0.0) || (item->flags & BST_TRUTH_OCCULTED) ||
        !isfinite(item->x_centroid_px) || !isfinite(item->x_start_px) ||
        !isfinite(item->x_end_px)) {
        return false;
    }
    double x0 = f->window.x0 + 0.5 * (b - 1.0), y0 = f->window.y0 + 0.5 * (b - 1.0);
    s->path.dx = (item->x_end_px - item->x_start_px) / b;
    s->path.dy = (item->y_end_px - item->y_start_px) / b;
    s->x = (item->x_centroid_px - x0) / b;
    s->y = (item->y_centroid_px - y0) / b;
    if (!g->smeared) { /* ends displaced by jitter only are no path */
        double share = ghost ? ghost_motion(g, ghost, &s->path) : 1.0;
        s->path.dx += share * (g->straight_path.dx - g->whole_path.dx);
        s->path.dy += share * (g->straight_path.dy - g->whole_path.dy);
    }
    s->length = hypot(s->path.dx, s->path.dy);
    s->flux_e = item->electrons;
    if (ghost) {
        bst_generator_set_ghost_image(g, ghost, s);
    }
    s->sharp = snr_factor(g, f, item, s);
    s->visible = s->ends = 1.0;
    s->seen_x = s->x;
    s->seen_y = s->y;
    if (g->smeared && s->length > ROUGH_PX) {
        s->broken = true; /* its path is laid out later */
    }
    bst_generator_set_visible_share(g, s);
    return s->broken || s->visible > 0.0;
}

/* Factor by which noise raises the maximum of a wider image more than that of one of the fitted
 * width. On each axis it does so by the noise's squared gradient over the curvature: that of the
 * image, which is flatter, and that of the noise which lifts a fainter source to the threshold and
 * is as curved as the output of a source of the fitted width. */
static double flatness_of(const bst_generator *g, const generator_source *s) {
    double width = g->filter_sigma / g->cross_sigma, level = fmax(s->unraised, LEAST_RAISED);
    double lift = fmax(g->threshold - level, 0.0);
    return (level + lift) / (s->curvature * width * width * level + lift);
}

/* Noise-free amplitude of a source in the matched-filter output, and the filter that gives it. */
static void set_amplitude(const bst_generator *g, generator_source *s) {
    double gain = bst_obsgen_between(bst_obsgen_lengths_px, g->calibration.gain, BST_OBSGEN_LENGTHS,
                                     s->length);
    double ideal = s->sharp * s->flux_e * bst_crlb_table_norm(&g->bound, s->length) / g->noise_e *
                   sqrt(s->visible);
    if (s->broken) { /* at rest */
        s->amplitude =
            g->filters[0].efficiency * s->flux_e * bst_crlb_table_norm(&g->bound, 0.0) / g->noise_e;
        return;
    }
    double efficiency = bst_generator_set_filter(g, s) * (s->filter_ratio / s->snr_ratio);
    if (g->image_bound) {
        ideal *= bst_crlb_table_norm(g->image_bound, s->length) /
                 bst_crlb_table_norm(&g->bound, s->length);
    } else if (g->response.source.across_px != g->response.source.along_px) {
        ideal *= bst_response_norm_ratio(&g->response, s->length);
    }
    s->unraised = efficiency * ideal;
    gain = g->smeared ? 1.0 : 1.0 + (gain - 1.0) * flatness_of(g, s);
    /* that of the greater output, if the source is seen in the smaller one */
    double most = s->unraised * fmax(s->other, 1.0);
    s->rise = bst_obsgen_peak(most, gain) - most;
    s->amplitude = s->unraised + s->rise;
}

/* Grows the arrays of sources. */
static bst_status reserve(bst_ctx *ctx, bst_generator *g, int count) {
    if (count < g->source_capacity) {
        return BST_OK;
    }
    int capacity = 2 * count + 16;
    generator_source *sources = realloc(g->sources, (size_t)capacity * sizeof *sources);
    g->sources = sources ? sources : g->sources;
    generator_rank *ranks = realloc(g->ranks, (size_t)capacity * sizeof *ranks);
    g->ranks = ranks ? ranks : g->ranks;
    if (!sources || !ranks) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", count);
    }
    g->source_capacity = capacity;
    return BST_OK;
}

static int by_row(const void *a, const void *b) {
    const generator_source *p = a, *q = b;
    if (p->y != q->y) {
        return p->y < q->y ? -1 : 1;
    }
    return p->x != q->x ? (p->x < q->x ? -1 : 1) : (p->item > q->item) - (p->item < q->item);
}

/* Sets the pixel noise as image processing measures it, including the light of faint sources. */
static void set_noise(bst_generator *g, const bst_generator_frame *f) {
    const bst_camera *c = g->camera;
    const bst_detector_config *d = &c->detector;
    double added = (double)g->binning * g->binning;
    double level = (f->truth->background_e + f->truth->dark_e) * added;
    double uneven_dark = f->truth->dark_e * d->dsnu_rms;
    double read_e = bst_camera_read_noise_e(c);
    g->excess = bst_camera_excess_noise(c);
    double variance =
        g->excess * level + read_e * read_e + c->gain_e_per_dn * c->gain_e_per_dn / 12.0 +
        d->row_noise_e * d->row_noise_e + d->row_offset_rms_e * d->row_offset_rms_e +
        d->flicker_noise_e * d->flicker_noise_e +
        0.5 * d->pick_up.amplitude_e * d->pick_up.amplitude_e + bst_generator_column_variance(g) +
        d->telegraph_noise_fraction * d->telegraph_noise_rms_e * d->telegraph_noise_rms_e +
        level * level * d->prnu_rms * d->prnu_rms / added + added * uneven_dark * uneven_dark;
    g->background_e = level;
    g->noise_e = sqrt(fmax(variance, 1e-6)) * g->calibration.noise_factor;
}

/* Light and squared light of a source that survives the sigma clip of the background: the part of a
 * Gaussian image or a line below the clip. */
static void unclipped_light(const bst_generator *g, const generator_source *s, double clip_e,
                            double *light, double *square) {
    double area = 2.0 * BST_PI * g->total_sigma * g->total_sigma;
    double peak = s->flux_e / (area * sqrt(1.0 + s->length * s->length / area));
    double below = fmin(clip_e / peak, 1.0); /* of the peak */
    if (s->length > 3.0 * g->total_sigma) {
        double flank = -log(below);
        *light = s->visible * s->flux_e * erfc(sqrt(flank));
        *square = s->visible * s->flux_e * peak * sqrt(0.5) * erfc(sqrt(2.0 * flank));
    } else {
        *light = s->visible * s->flux_e * below;
        *square = s->visible * s->flux_e * peak * 0.5 * below * below;
    }
}

/* Adds the sources' unclipped light to background and noise. */
static void add_crowding(bst_generator *g) {
    double pixels = (double)g->width * g->height, before = g->noise_e;
    g->dark_noise_e = before;
    g->faint_light_e = g->faint_square_e2 = 0.0;
    for (int i = 0; i < g->source_count; i++) {
        double light, square;
        unclipped_light(g, &g->sources[i], CLIP_SIGMA * before, &light, &square);
        g->faint_light_e += light / pixels;
        g->faint_square_e2 += square / pixels;
    }
    g->background_bias_e = g->calibration.background_fraction * g->faint_light_e;
    g->background_e += g->background_bias_e;
    g->noise_e = sqrt(before * before + g->calibration.crowding * g->faint_square_e2);
    for (int i = 0; i < g->source_count; i++) {
        generator_source *s = &g->sources[i];
        if (!s->broken) { /* bias of the output: the filter's sum over its norm times the background
                             excess */
            s->amplitude *= before / g->noise_e;
            s->unraised *= before / g->noise_e;
            double length = s->as_streak ? g->streak : 0.0;
            double taken =
                g->background_bias_e / (bst_crlb_table_norm(&g->bound, length) * g->noise_e);
            s->amplitude -= taken;
            s->unraised -= taken;
        }
    }
}

/* In a crowded frame image processing estimates background and noise again on the open sky between
 * stars: removes their light from both. */
static void set_open_sky(bst_generator *g) {
    g->open_share = bst_generator_open_share(g);
    if (!(g->open_share < 1.0)) {
        return;
    }
    for (int i = 0; i < g->source_count; i++) {
        generator_source *s = &g->sources[i];
        double length = s->as_streak ? g->streak : 0.0;
        double taken = g->background_bias_e / (bst_crlb_table_norm(&g->bound, length) * g->noise_e);
        s->amplitude += taken;
        s->unraised += taken;
        s->amplitude *= g->noise_e / g->dark_noise_e;
        s->unraised *= g->noise_e / g->dark_noise_e;
    }
    g->background_e -= g->background_bias_e;
    g->background_bias_e = 0.0;
    g->noise_e = g->dark_noise_e;
    bst_generator_set_filters(g);
}

/* Grows the arrays of the stars' path. */
static bst_status reserve_path(bst_ctx *ctx, bst_generator *g, int count) {
    if (count <= g->path_room) {
        return BST_OK;
    }
    double **all[] = {&g->path_x, &g->path_y, &g->object_x, &g->object_y};
    for (int i = 0; i < 4; i++) {
        double *more = realloc(*all[i], (size_t)count * sizeof **all[i]);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a path of %d steps", count);
        }
        *all[i] = more;
    }
    g->path_room = count;
    return BST_OK;
}

/* Sets the stars' true path and the quantities derived from it. */
static bst_status set_path(bst_ctx *ctx, bst_generator *g, const bst_generator_frame *f) {
    double b = g->binning;
    bool known = f->path_count >= 2;
    int count = known ? f->path_count : 2;
    BST_TRY(reserve_path(ctx, g, count > GENERATOR_PLACES ? count : GENERATOR_PLACES));
    for (int k = 0; k < count; k++) {
        g->path_x[k] = known ? f->path_x_px[k] / b : (k - 0.5) * f->streak_dx_px / b;
        g->path_y[k] = known ? f->path_y_px[k] / b : (k - 0.5) * f->streak_dy_px / b;
    }
    g->path = (bst_star_trail_path){g->path_x, g->path_y, count};
    if (count >= 3 && !g->smeared) { /* `way` of smeared frames has the light of whole steps */
        int parts = bst_star_trail_parts(&g->path, 0.0, 0.0, g->total_sigma, GENERATOR_PLACES);
        count = g->path.count = bst_star_trail_divide(g->path_x, g->path_y, count, parts);
    }
    g->whole_path = (bst_obsgen_path_px){g->path_x[count - 1] - g->path_x[0],
                                         g->path_y[count - 1] - g->path_y[0]};
    memset(g->star_bias, 0, sizeof g->star_bias);
    memset(g->streak_bias, 0, sizeof g->streak_bias);
    g->route_count = 0;
    g->route_top = 0.0;
    if (!g->smeared) {
        return BST_OK;
    }
    if (!g->route) {
        g->route = malloc(BST_ROUTE_NODES * sizeof *g->route);
        g->way = malloc(BST_ROUTE_NODES * sizeof *g->way);
        if (!g->route || !g->way) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the way of stars");
        }
    }
    g->route_count = bst_star_trail_lay(&g->path, g->cross_sigma, g->route);
    double *box = g->route_box;
    box[0] = box[2] = INFINITY;
    box[1] = box[3] = -INFINITY;
    for (int i = 0; i < g->route_count; i++) {
        const bst_star_trail_node *n = &g->route[i];
        g->route_top = fmax(g->route_top, n->light);
        box[0] = fmin(box[0], n->x);
        box[1] = fmax(box[1], n->x);
        box[2] = fmin(box[2], n->y);
        box[3] = fmax(box[3], n->y);
    }
    return BST_OK;
}

/* Sets up all frame quantities: geometry, path, noise, filters. */
static bst_status set_frame(bst_ctx *ctx, bst_generator *g, const bst_generator_frame *f) {
    g->binning = f->binning > 1 ? f->binning : 1;
    g->width = f->window.width / g->binning;
    g->height = f->window.height / g->binning;
    g->exposure_s = f->exposure_s;
    /* as in imgproc/detect/detect.c */
    double sigma = fmax(f->sigma_px / g->binning, 0.2);
    if (sigma != g->sigma) {
        g->sigma = sigma;
        g->total_sigma = sqrt(sigma * sigma + 1.0 / 12.0);
        bst_crlb_table_init(&g->bound, sigma);
    }
    double onboard = f->response ? f->response->nearest_sigma_px : g->onboard_sigma_px / g->binning;
    g->fitted_sigma = fmax(onboard, 0.2);
    double length = hypot(f->streak_dx_px, f->streak_dy_px) / g->binning;
    g->bend_x = f->bend_x_px / g->binning;
    g->bend_y = f->bend_y_px / g->binning;
    bool filtered = length >= g->settings.streak_min_px && length <= g->settings.streak_max_px;
    g->smeared = length + 2.0 * hypot(g->bend_x, g->bend_y) > g->settings.streak_max_px;
    g->star_path =
        filtered ? (bst_obsgen_path_px){f->streak_dx_px / g->binning, f->streak_dy_px / g->binning}
                 : (bst_obsgen_path_px){0.0, 0.0};
    g->streak = filtered ? length : 0.0;
    g->followed = f->followed && !g->smeared;
    g->path.count = 0;
    bst_generator_set_response(g, f);
    BST_TRY(set_path(ctx, g, f));
    bst_generator_measure_motion(g, f);
    bst_generator_set_response(g, f); /* after the path is set */
    bst_generator_set_star_bias(g);
    return BST_OK;
}

/* Collects the truth sources of the frame and their filter amplitudes. */
static bst_status collect(bst_ctx *ctx, bst_generator *g, const bst_generator_frame *f) {
    const bst_truth *t = f->truth;
    BST_TRY(reserve(ctx, g, t->count));
    g->source_count = 0;
    g->open_share = 1.0;
    bst_generator_set_filters(g); /* amplitudes depend on the threshold */
    for (int i = 0; i < t->count; i++) {
        generator_source *s = &g->sources[g->source_count];
        *s = (generator_source){
            .item = i, .star = t->items[i].kind == BST_SOURCE_STAR, .head = -1, .partner = -1};
        bst_generator_set_image(g, t, s);
        int of = f->ghost ? f->ghost[i] : -1; /* each ghost of a source has draws of its own */
        s->name = (uint64_t)t->items[i].id | (uint64_t)(t->items[i].kind & 3) << 32 |
                  (uint64_t)(of > 0 ? of % GHOST_STREAMS : 0) << 34;
        const bst_ghost *ghost = of >= 0 ? &g->camera->ghost_images->items[of] : NULL;
        if (!position_source(g, f, &t->items[i], ghost, s)) {
            continue;
        }
        set_amplitude(g, s);
        g->source_count +=
            s->broken || s->visible > LEAST_VISIBLE || s->unraised > LEAST_VISIBLE_SNR;
    }
    add_crowding(g);
    bst_generator_set_filters(g);
    if (!g->smeared) {
        set_open_sky(g);
    }
    qsort(g->sources, (size_t)g->source_count, sizeof *g->sources, by_row);
    return BST_OK;
}

double bst_generator_uniform(const bst_generator *g, uint64_t draw) {
    return bst_rng_uniform(g->key, (uint64_t)g->exposure_id, draw);
}

double bst_generator_draw(const bst_generator *g, const generator_source *s, int which) {
    return bst_rng_normal(g->key, (uint64_t)g->exposure_id,
                          s->name * GENERATOR_DRAWS + (uint64_t)which);
}

void bst_generator_keep(bst_generator *g, const bst_obsgen_generated *item) {
    assert(g && item && g->count >= 0);
    if (g->count < g->settings.capacity) {
        g->items[g->count++] = *item;
        return;
    }
    /* the brightest are kept */
    g->lost++;
    int faintest = 0;
    for (int i = 1; i < g->count; i++) {
        faintest = g->items[i].detection.snr < g->items[faintest].detection.snr ? i : faintest;
    }
    if (g->items[faintest].detection.snr < item->detection.snr) {
        g->items[faintest] = *item;
    }
}

void bst_generator_keep_rough(bst_generator *g, double x, double y, double snr, int item) {
    double b = g->binning, norm = bst_crlb_table_norm(&g->bound, 0.0), sigma = g->noise_e / norm;
    bst_obsgen_generated out = {.item = item};
    bst_detection *d = &out.detection;
    d->x_px = g->origin_x + b * x;
    d->y_px = g->origin_y + b * y;
    d->cov_xx = d->cov_yy = b * b;
    d->flux_e = snr * sigma;
    d->flux_sigma_e = sqrt(sigma * sigma + d->flux_e);
    d->snr = snr;
    d->length_px = d->width_px = b * BST_FWHM_PER_SIGMA * g->sigma;
    d->v_mag = -2.5 * log10(d->flux_e / (fmax(g->exposure_s, 1e-9) * g->electrons_per_s_v0));
    bst_generator_keep(g, &out);
}

/* Keeps a source that hardly moved in a smeared frame: its brightest pixel, with the peak
 * interpolated from the outputs about it. */
static void keep_whole_rough(bst_generator *g, int i) {
    const generator_source *s = &g->sources[i];
    generator_blend b = bst_generator_blend_of(g, i);
    int x = (int)lround(b.x), y = (int)lround(b.y);
    double peak = fmax(s->peak, s->amplitude * b.flux_e / s->flux_e);
    double value = peak * bst_matched_falloff(x - b.x, y - b.y, 0.0, g->cross_sigma) +
                   s->spread * s->noise / g->calibration.slope;
    if (!(value > g->threshold) || x < 0 || y < 0 || x >= g->width || y >= g->height) {
        return;
    }
    /* peak of noise plus light: gradient of the noise over curvature of the light */
    double off[2], both = g->cross_sigma * g->cross_sigma;
    double sigma = sqrt(2.0) * both / (g->filter_sigma * fmax(peak, g->threshold));
    bst_rng_normal2(g->key, (uint64_t)g->exposure_id, s->name * GENERATOR_DRAWS + GENERATOR_PLACE,
                    off);
    bst_generator_keep_rough(g, b.x + sigma * off[0], b.y + sigma * off[1], value, s->item);
}

static int generated_by_row(const void *a, const void *b) {
    const bst_detection *p = &((const bst_obsgen_generated *)a)->detection,
                        *q = &((const bst_obsgen_generated *)b)->detection;
    if (p->y_px != q->y_px) {
        return p->y_px < q->y_px ? -1 : 1;
    }
    return (p->x_px > q->x_px) - (p->x_px < q->x_px);
}

/* Adds the uncertainty of the camera's bend to all places, as imgproc/detect/camera_motion_left.c.
 */
static void widen_by_bend(bst_generator *g, const bst_generator_frame *f) {
    for (int i = 0; i < g->count; i++) {
        bst_detection *d = &g->items[i].detection;
        bool drawn = g->items[i].drawn;
        if (g->followed) {
            bst_camera_motion_widen_drawn(f->bend_x_px, f->bend_y_px, d);
            continue;
        }
        bst_camera_motion_widen(f->bend_x_px, f->bend_y_px, drawn ? f->bend_x_px : 0.0,
                                drawn ? f->bend_y_px : 0.0, d);
    }
}

bst_status bst_generator_run(bst_ctx *ctx, bst_generator *g, const bst_generator_frame *f,
                             bst_generator_result *out) {
    assert(g && f && f->truth && out && f->truth->count >= 0 && f->exposure_s > 0.0);
    assert(f->window.width > 0 && f->window.height > 0 && f->path_count >= 0);
    BST_TRY(set_frame(ctx, g, f));
    g->origin_x = f->window.x0 + 0.5 * (g->binning - 1);
    g->origin_y = f->window.y0 + 0.5 * (g->binning - 1);
    g->exposure_id = f->truth->exposure_id;
    g->count = g->lost = 0;
    set_noise(g, f);
    BST_TRY(collect(ctx, g, f));
    const bst_truth *truth = f->truth;
    double disc = fmax(fmax(truth->earth_fraction, truth->moon_fraction), truth->sun_fraction);
    /* the sky alone saturates every pixel; background_e is that of the middle, which may be on a
     * disc that leaves the rest dark */
    bool full = bst_generator_saturation_e(g) <= 0.0 && (disc == 0.0 || disc == 1.0);
    g->source_count = full ? 0 : g->source_count;
    for (int i = 0; i < g->source_count; i++) {
        g->sources[i].saturated =
            (f->truth->items[g->sources[i].item].flags & BST_TRUTH_SATURATED) != 0;
    }
    bst_generator_decide(g);
    if (g->settings.false_splits > 0.0 && !g->smeared) {
        bst_generator_split_pairs(g);
    }
    if (!f->response) { /* both Gaussian */
        bst_generator_adapt_width(g);
    }
    for (int i = 0; i < g->source_count; i++) {
        const generator_source *s = &g->sources[i];
        if (s->broken) {
            continue;
        }
        if (s->found && g->smeared) {
            keep_whole_rough(g, i);
        } else if (s->found) {
            generator_blend b = bst_generator_blend_of(g, i);
            b.point = g->uneven ? !s->as_streak && !s->own_streak
                                : b.point || bst_generator_fits_point(g, s, &b);
            bst_obsgen_generated item = {.detection = bst_generator_measure(g, s, &b),
                                         .item = s->item,
                                         .drawn = s->as_streak && !b.point};
            bst_generator_keep(g, &item);
        }
    }
    if (!full) {
        BST_TRY(g->smeared ? bst_streak_breakup_fragments(ctx, g) : BST_OK);
        BST_TRY(bst_false_alarms_draw(ctx, g));
        bst_false_alarms_cosmic_rays(g);
    }
    widen_by_bend(g, f);
    qsort(g->items, (size_t)g->count, sizeof *g->items, generated_by_row);
    *out = (bst_generator_result){.items = g->items,
                                  .count = g->count,
                                  .lost = g->lost,
                                  .background_e = g->background_e,
                                  .noise_e = g->noise_e,
                                  .threshold_snr = g->threshold,
                                  .filter = g->filters[g->streak > 0.0],
                                  .point = g->filters[0],
                                  .shared_noise = g->shared_noise,
                                  .faint_light_e = g->faint_light_e,
                                  .faint_square_e2 = g->faint_square_e2,
                                  .streak_px = g->streak * g->binning,
                                  .bend_before_px = g->bend_before * g->binning,
                                  .bend_after_px = g->bend_after * g->binning,
                                  .ends_after_px = g->ends_after * g->binning,
                                  .smeared = g->smeared,
                                  .shared_dx_px = g->fit_path.dx,
                                  .shared_dy_px = g->fit_path.dy};
    if (g->streak > 0.0 && !g->smeared) {
        bst_camera_motion_shared_shift(g->binning * hypot(g->fit_path.dx, g->fit_path.dy),
                                       g->binning * g->total_sigma, g->binning * g->bend_before,
                                       g->binning * g->bend_after, &out->shared_along_px2,
                                       &out->shared_across_px2);
    }
    return BST_OK;
}

double bst_generator_v_limit(const bst_generator *g, double snr) {
    double electrons = snr * g->noise_e / bst_crlb_table_norm(&g->bound, g->streak);
    return -2.5 * log10(electrons / (fmax(g->exposure_s, 1e-9) * g->electrons_per_s_v0));
}
