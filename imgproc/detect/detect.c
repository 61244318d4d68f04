#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/calibrate/bad_map.h"
#include "imgproc/calibrate/pixel_learner.h"
#include "imgproc/calibrate/reference_pixels.h"
#include "imgproc/detect/detect_internal.h"
#include "imgproc/detect/region_of_interest.h"
#include "imgproc/detect/row_kernels.h"
#include "imgproc/measure/sensor_order.h"
#include "imgproc/streak/streak_locate.h"
#include "imgproc/streak/streak_motion.h"
#include "sim/core/invariant.h"
#include "sim/core/pages.h"
#include "sim/core/threshold_statistics.h"
#include "sim/optics/column_level.h"

/* Least share of the detection threshold from which maxima are interpolated between pixels. */
static const double LOOK_SHARE = 0.65;
/* SNR above which pixels of a crowded frame are masked as stars. It is low because a crowd raises
 * the noise estimate. */
static const float STAR_SNR = 3.0f;
/* Least share of a crowded frame that counts as free of stars. */
static const double LEAST_OPEN = 0.02;
/* Margin above the threshold, sigma, beyond which the skewness correction is negligible. */
static const double CERTAIN_ABOVE = 1.5;

static bst_status allocate(bst_ctx *ctx, bst_imgproc *ip) {
    int width = (int)ip->camera.width_px, height = (int)ip->camera.height_px;
    if (ip->maps.psf) {
        BST_TRY(bst_known_psf_create(ctx, ip->maps.psf, width, height, ip->config.jitter_px,
                                     &ip->known));
    }
    double fwhm = ip->camera.psf_fwhm_px, streak = ip->config.streak_max_px;
    int side = (int)ceil(streak + 6.0 * fwhm) + 14;
    side = side < BST_PSF_MAX_SIDE ? side : BST_PSF_MAX_SIDE;
    int capacity = (int)ip->config.capacity;
    ip->electrons = bst_pages_alloc((size_t)width * (size_t)height * sizeof(float));
    ip->order = calloc((size_t)capacity, sizeof(int));
    ip->order_swap = calloc((size_t)capacity, sizeof(int));
    ip->row = calloc((size_t)height + 1, sizeof(int));
    ip->cropped = bst_pages_zero((size_t)width * (size_t)height, sizeof *ip->cropped);
    if (!ip->electrons || !ip->order || !ip->order_swap || !ip->row || !ip->cropped) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a frame of %d x %d", width, height);
    }
    BST_TRY(bst_bad_map_create(ctx, &ip->camera, &ip->maps, &ip->config.bad_pixels, &ip->bad));
    BST_TRY(bst_reference_pixels_mask(ctx, &ip->config.reference_pixels, &ip->camera, &ip->bad));
    if (bst_column_level_wanted(ip->config.column_correction, &ip->camera)) {
        BST_TRY(bst_columns_create(ctx, width, &ip->columns));
    }
    BST_TRY(bst_parallel_create(ctx, (int)ip->config.threads, &ip->pool));
    BST_TRY(bst_background_create(ctx, (int)ip->config.mesh_px, width, height,
                                  bst_parallel_threads(ip->pool), &ip->background));
    BST_TRY(bst_filter_create(ctx, ip->known, width, height, streak, bst_parallel_threads(ip->pool),
                              &ip->filter));
    BST_TRY(bst_candidates_create(ctx, width, height, &ip->candidates));
    const bst_imgproc_locator_limits limits = {bst_parallel_threads(ip->pool), capacity, width,
                                               height, side};
    const bst_streak_locator_limits streaks = {width, height, fwhm, ip->config.streak_search_px};
    BST_TRY(bst_imgproc_locator_create(ctx, ip->known, &limits, &ip->locator));
    ip->locator.max_fits = (int)ip->config.max_fits;
    ip->locator.false_splits = ip->config.false_splits;
    BST_TRY(bst_streak_motion_create(ctx, side, &ip->streak_motion));
    BST_TRY(bst_streak_fragments_create(ctx, width, height,
                                        hypot(fwhm / BST_FWHM_PER_SIGMA, ip->config.jitter_px),
                                        &ip->fragments));
    BST_TRY(bst_imgproc_open_silhouettes(ctx, ip));
    return ip->config.streak_search_px > 0.0
               ? bst_streak_locator_create(ctx, &ip->locator.psf, ip->pool, &streaks, &ip->streaks)
               : BST_OK;
}

bst_status bst_imgproc_create(bst_ctx *ctx, const bst_camera *camera, double electrons_per_s_v0,
                              const bst_imgproc_config *config, const bst_imgproc_maps *maps,
                              bst_imgproc **out) {
    assert(camera && config && out && bst_is_positive(electrons_per_s_v0));
    *out = NULL;
    if (camera->width_px < 1 || camera->height_px < 1 || camera->width_px > 32768 ||
        camera->height_px > 32768 || !(camera->psf_fwhm_px > 0.0) || camera->psf_fwhm_px > 16.0 ||
        !(camera->gain_e_per_dn > 0.0) || config->capacity < 1 || config->mesh_px < 4 ||
        !(config->false_alarms_per_frame > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "image processing needs 1 to 32768 pixels a side, a PSF of up to 16 px "
                        "FWHM, a positive gain, room for a detection, meshes of at least 4 px and "
                        "a positive false-alarm rate");
    }
    bst_imgproc *ip = bst_pages_zero(1, sizeof *ip);
    if (!ip) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for image processing");
    }
    ip->camera = *camera;
    ip->config = *config;
    ip->electrons_per_s_v0 = electrons_per_s_v0;
    if (maps) {
        ip->maps = *maps;
    }
    bst_status status = allocate(ctx, ip);
    if (status != BST_OK) {
        bst_imgproc_free(ip);
        return status;
    }
    *out = ip;
    return BST_OK;
}

void bst_imgproc_free(bst_imgproc *ip) {
    if (!ip) {
        return;
    }
    free(ip->bad);
    free(ip->electrons);
    free(ip->order);
    free(ip->order_swap);
    free(ip->row);
    bst_pages_free(ip->cropped);
    bst_imgproc_close_silhouettes(ip);
    bst_background_free(&ip->background);
    bst_filter_free(&ip->filter);
    bst_candidates_free(&ip->candidates);
    bst_imgproc_locator_free(&ip->locator);
    bst_streak_motion_free(&ip->streak_motion);
    bst_streak_locator_free(&ip->streaks);
    bst_streak_fragments_free(&ip->fragments);
    bst_parallel_free(ip->pool);
    bst_known_psf_free(ip->known);
    bst_pixel_shows_free(&ip->shows);
    bst_columns_free(&ip->columns);
    bst_pages_free(ip);
}

/* Pixel reader that masks the stars found by the matched filter. */
typedef struct star_masking_reader {
    bst_calibrate_pixels read;
    const bst_filter *filter;
} star_masking_reader;

/* Reads calibrated pixels with the filter's stars masked. */
static void read_star_masked(const void *user, int y, int x, int count, float *out) {
    const star_masking_reader *r = user;
    bst_calibrate_pixels_read(&r->read, y, x, count, out);
    bst_filter_mask(r->filter, y, x, count, STAR_SNR, out);
}

/* Scales a row by its columns' noise, and masks learned bad pixels if bst_calibrate_pixels_read did
 * not. */
static void correct_column_noise(const void *user, int y, int width, float *signal,
                                 float *normalised) {
    const bst_calibrate_pixels *e = user;
    for (int x = 0; e->columns && x < width; x++) {
        normalised[x] /= e->columns->noise[e->first_column + x];
    }
    if (!e->learned) {
        return;
    }
    const bst_bad_rows_run run = {&e->frame->window, e->frame->binning, y, 0, width};
    bst_bad_rows_mask(e->learned, &run, BST_PIXEL_BAD, signal);
    bst_bad_rows_mask(e->learned, &run, 0.0f, normalised);
}

/* Context of the significance test of a maximum. */
typedef struct significance_test {
    const bst_imgproc *ip;
    const float *column_noise; /* noise of each column, see bst_locate_frame */
    double threshold;
    double normal_variance; /* variance of a pixel without shot noise, e-^2 */
    double charge_e;        /* see bst_imgproc_charge */
} significance_test;

/* True if a peak of the filter output is significant in noise of the given skewness. */
static bool exceeds(double peak, const significance_test *g, const bst_threshold_weights *weights,
                    const bst_threshold_noise *noise) {
    return peak > g->threshold && peak > bst_threshold_quantile(g->threshold, weights, noise);
}

/* Significance test of a maximum: its interpolated peak must be as improbable in the local, skewed
 * noise as the threshold is in normal noise. */
static bool is_significant(const void *user, const bst_candidate *c) {
    const significance_test *g = user;
    const bst_filter *f = &g->ip->filter;
    double noise_e = bst_background_noise_at(&g->ip->background, c->x, c->y);
    noise_e *= g->column_noise ? (double)g->column_noise[c->x] : 1.0;
    double level_e = bst_background_level_at(&g->ip->background, c->x, c->y);
    double variance = noise_e * noise_e, counted = fmax(variance - g->normal_variance, 0.0);
    if (g->normal_variance < 1.0) {
        /* an ADC step wider than the read noise: the shot noise is then that of the level */
        counted = fmax(counted, fmin(level_e, variance));
    }
    /* multiplied electrons are as skewed as Poisson charges of so many electrons each */
    const double charge = g->charge_e;
    bst_threshold_noise noise = {noise_e / charge, counted / (charge * charge),
                                 g->ip->camera.gain_e_per_dn / charge};
    double point = bst_filter_peak(f, g->ip->electrons, noise_e, false, c->x, c->y);
    if (exceeds(point, g, &f->point_weights, &noise)) {
        return true;
    }
    return f->streak && exceeds(bst_filter_peak(f, g->ip->electrons, noise_e, true, c->x, c->y), g,
                                &f->streak_weights, &noise);
}

/* Digital number at which a pixel saturates: end of the ADC range or full well. */
static int saturation_dn(const bst_imgproc *ip, const bst_imgproc_frame *frame) {
    double top = ldexp(1.0, frame->bits) - 1.0;
    double well = bst_camera_full_e(&ip->camera) * frame->binning * frame->binning;
    double full = ip->camera.offset_dn + 0.98 * well / ip->camera.gain_e_per_dn;
    return (int)fmin(top, fmax(full, 1.0));
}

/* Least signal above the frame's background of a saturated pixel, e-. */
static double saturation_e(const bst_imgproc *ip, int saturated_dn) {
    const bst_camera *c = &ip->camera;
    double level = (saturated_dn - c->offset_dn) * c->gain_e_per_dn;
    bool overflows = c->detector.saturation == BST_WELL_BLOOM;
    return overflows ? 0.0 : fmax(level - (double)ip->background.median_level, 0.0);
}

/* Star streak at the window's centre for the matched filter, binned px, rounded to half a pixel so
 * that the filter need not be rebuilt for small changes of telemetry. It is (0, 0) if the streak is
 * too short, or with its bend too long, to filter for. */
static void filter_streak_vector(bst_imgproc *ip, const bst_imgproc_frame *frame,
                                 const bst_camera_motion *motion, double *dx, double *dy) {
    *dx = *dy = 0.0;
    ip->smeared = false;
    if (!motion) {
        return;
    }
    const bst_window *w = &frame->window;
    bst_camera_motion_streak(motion, &ip->camera, w->x0 + 0.5 * (w->width - 1),
                             w->y0 + 0.5 * (w->height - 1), dx, dy);
    double bend_x, bend_y;
    bst_camera_motion_bend(motion, &ip->camera, &bend_x, &bend_y);
    double length = hypot(*dx, *dy) / frame->binning;
    double bend = hypot(bend_x, bend_y) / frame->binning;
    ip->smeared = length + 2.0 * bend > ip->config.streak_max_px;
    if (length < ip->config.streak_min_px || ip->smeared) {
        *dx = *dy = 0.0;
        return;
    }
    *dx = 0.5 * round(2.0 * *dx / frame->binning);
    *dy = 0.5 * round(2.0 * *dy / frame->binning);
}

/* Checks window, binning and bit depth of a frame. */
static bst_status check_frame(bst_ctx *ctx, const bst_imgproc *ip, const bst_imgproc_frame *f) {
    const bst_window *w = &f->window;
    if (f->binning < 1 || w->x0 < 0 || w->y0 < 0 || w->width < f->binning ||
        w->height < f->binning || w->width > ip->camera.width_px - w->x0 ||
        w->height > ip->camera.height_px - w->y0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "window %d x %d at (%d, %d) with binning %d does not fit a sensor of %lld "
                        "x %lld",
                        w->width, w->height, w->x0, w->y0, f->binning,
                        (long long)ip->camera.width_px, (long long)ip->camera.height_px);
    }
    if (f->bits < 1 || f->bits > 16 || !(f->exposure_s >= 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a frame of %d bits and %g s: 1 to 16 bits, 0 s up",
                        f->bits, f->exposure_s);
    }
    return BST_OK;
}

/* Detection in full-sensor pixels from a located source. */
static bst_detection report(const bst_imgproc *ip, const bst_locate_frame *f,
                            const bst_imgproc_found *found) {
    const bst_imgproc_source *s = &found->source;
    double b = f->binning;
    bst_detection d = {0};
    d.x_px = f->origin_x_px + b * s->shape.x_px;
    d.y_px = f->origin_y_px + b * s->shape.y_px;
    d.cov_xx = b * b * s->cov_xx;
    d.cov_xy = b * b * s->cov_xy;
    d.cov_yy = b * b * s->cov_yy;
    d.flux_e = s->flux_e;
    d.flux_sigma_e = sqrt(s->flux_variance);
    d.snr = found->snr;
    d.length_px = b * found->length_px;
    d.width_px = b * found->width_px;
    d.angle_rad = found->angle_rad;
    double rate = s->flux_e / fmax(ip->exposure_s, 1e-9);
    d.v_mag = -2.5 * log10(rate / ip->electrons_per_s_v0);
    d.flags = found->flags;
    bst_imgproc_add_bend_covariance(&ip->camera, f, found, &d);
    d.label = found->label;
    d.label_probability = found->label_probability;
    return d;
}

/* Filter output from which maxima are interpolated between pixels. */
static double interpolation_threshold(const bst_imgproc *ip, double threshold) {
    return ip->smeared ? threshold : fmax(0.93 * ip->filter.corner, LOOK_SHARE) * threshold;
}

/* Detection threshold and false alarms with which a frame, or a window of it, was searched. */
typedef struct part {
    double threshold, false_alarms;
    /* also searched for object streaks */
    bool search;
} part;

/* Sets the frame view for the locator and for stacking. */
static void set_frame_view(bst_imgproc *ip, const bst_imgproc_frame *frame,
                           const bst_camera_motion *motion, double sigma, const float *column_noise,
                           bst_parallel *pool) {
    if (motion) {
        ip->motion = *motion;
    }
    ip->view = (bst_locate_frame){.signal = bst_imgproc_signal_of(ip, frame),
                                  .width = frame->window.width / frame->binning,
                                  .height = frame->window.height / frame->binning,
                                  .background = &ip->background,
                                  .filter = &ip->filter,
                                  .column_noise = column_noise,
                                  .excess = bst_camera_excess_noise(&ip->camera),
                                  .sigma_px = sigma,
                                  .motion = motion ? &ip->motion : NULL,
                                  .camera = &ip->camera,
                                  .binning = frame->binning,
                                  .pool = pool};
    bst_imgproc_set_departure(ip);
    ip->view.origin_x_px = frame->window.x0 + 0.5 * (frame->binning - 1);
    ip->view.origin_y_px = frame->window.y0 + 0.5 * (frame->binning - 1);
    ip->left = (bst_stack_frame){.signal = bst_imgproc_signal_of(ip, frame),
                                 .background = &ip->background,
                                 .width = frame->window.width / frame->binning,
                                 .height = frame->window.height / frame->binning,
                                 .sigma_px = sigma,
                                 .origin_x_px = ip->view.origin_x_px,
                                 .origin_y_px = ip->view.origin_y_px,
                                 .binning = frame->binning};
}

/* Runs background, matched filter and candidate search on `frame` and sets ip->view. If `frame` is
 * a window, `whole` is its frame, which sets the density of false alarms and the filter. */
static void find_candidates(bst_imgproc *ip, const bst_imgproc_frame *frame,
                            const bst_imgproc_frame *whole, const bst_camera_motion *motion,
                            bst_parallel *pool, part *out) {
    int width = frame->window.width / frame->binning;
    int height = frame->window.height / frame->binning;
    double sigma = ip->known ? ip->known->sigma_px
                             : hypot(bst_camera_psf_sigma_px(&ip->camera), ip->config.jitter_px);
    /* a Gaussian of 0.2 px has 99 % of its light along an axis in one pixel: a narrower PSF gives
     * the same image */
    sigma = fmax(sigma / frame->binning, 0.2);
    ip->exposure_s = frame->exposure_s;
    ip->binning = frame->binning;
    const uint8_t *bad = ip->bad;
    if (frame == whole && ip->config.extended.enabled) {
        bad = bst_imgproc_find_silhouettes(ip, frame, motion, sigma, saturation_dn(ip, frame));
    }
    const bst_bad_rows *learned = ip->map && ip->map->rows.count > 0 ? &ip->map->rows : NULL;
    const bst_columns *columns = ip->columns.count > 0 ? &ip->columns : NULL;
    int first_column = (frame->window.x0 - whole->window.x0) / frame->binning;
    star_masking_reader masking = {
        {&ip->camera, &ip->maps, bad, frame, learned, columns, first_column}, &ip->filter};
    ip->filter.correct_row = learned || columns ? correct_column_noise : NULL;
    ip->filter.correct_user = &masking.read;
    const bst_calibrate_pixels *read = &masking.read;
    bst_row_gain by_gain;
    const bst_row_gain *plain = bst_calibrate_pixels_plain(read, &by_gain) ? &by_gain : NULL;
    double gain = ip->camera.gain_e_per_dn, read_noise = bst_camera_read_noise_e(&ip->camera);
    double read_variance = read_noise * read_noise + gain * gain / 12.0;
    bst_background_input ground = {bst_calibrate_pixels_read, read, gain,
                                   -ip->camera.offset_dn * gain, read_noise * read_noise};
    bst_background_read(&ip->background, pool, &ground, width, height);
    double dx, dy;
    filter_streak_vector(ip, whole, motion, &dx, &dy);
    ip->streak_px = hypot(dx, dy) * frame->binning;
    ip->followed_sigma_e = 0.0;
    bst_filter_set(&ip->filter, sigma, frame->binning, dx, dy);
    /* search for object streaks only if the stars are points */
    bool search =
        ip->config.streak_search_px > 0.0 && !ip->filter.streak && !ip->smeared && frame == whole;
    double pixels = (double)(whole->window.width / whole->binning) *
                    (double)(whole->window.height / whole->binning);
    double false_alarms = (search ? 0.5 : 1.0) * ip->config.false_alarms_per_frame;
    double threshold = bst_filter_threshold(&ip->filter, false_alarms, pixels);
    int saturated_dn = saturation_dn(ip, frame);
    bst_filter_input input = {.background = &ip->background,
                              .read = bst_calibrate_pixels_read,
                              .user = read,
                              .raw = frame->pixels,
                              .gain = plain,
                              .signal = bst_imgproc_signal_of(ip, frame),
                              .width = width,
                              .height = height,
                              .saturated_dn = saturated_dn,
                              .provisional = !ip->smeared};
    bst_filter_run(&ip->filter, pool, &input, (float)interpolation_threshold(ip, threshold));
    if (ip->filter.crowded && !ip->smeared) {
        ground.read = read_star_masked;
        ground.user = &masking;
        double share = bst_background_read_again(&ip->background, pool, &ground);
        /* no false alarms are expected on masked stars */
        pixels *= fmax(share, LEAST_OPEN);
        threshold = bst_filter_threshold(&ip->filter, false_alarms, pixels);
        input.provisional = false;
        bst_filter_run(&ip->filter, pool, &input, (float)interpolation_threshold(ip, threshold));
    }
    double look = interpolation_threshold(ip, threshold);
    const float *column_noise = columns ? columns->noise + first_column : NULL;
    double charge = bst_imgproc_charge(bst_camera_excess_noise(&ip->camera));
    significance_test noise = {ip, column_noise, threshold, read_variance, charge};
    double certain = ip->smeared ? threshold : threshold + CERTAIN_ABOVE * charge;
    const bst_candidates_criteria criteria = {(int)ceil(6.0 * sigma + hypot(dx, dy)) + 2,
                                              (float)look, (float)certain, is_significant, &noise};
    bst_candidates_find(&ip->candidates, pool, &ip->filter, &criteria);
    set_frame_view(ip, frame, motion, sigma, column_noise, pool);
    ip->view.full_e = saturation_e(ip, saturated_dn);
    *out = (part){threshold, false_alarms, search};
}

/* Locates a part's candidates and appends the detections to `out`. */
static void locate_candidates(bst_imgproc *ip, const part *p, bst_detections *out, int capacity) {
    if (ip->smeared) {
        bst_locate_roughly(&ip->locator, &ip->view, &ip->candidates);
    } else {
        bst_locate(&ip->locator, &ip->view, &ip->candidates);
    }
    int kept = 0, room = capacity - out->count;
    room = room < ip->locator.capacity ? room : ip->locator.capacity;
    /* of the candidates those beyond the capacity; a candidate may become two sources */
    int lost = (int)fmax(ip->candidates.count - ip->locator.capacity, 0.0);
    if (p->search) {
        bst_streak_locate(&ip->streaks, &ip->view, &ip->candidates, p->false_alarms, &ip->locator);
    }
    bst_locate_join_streaks(&ip->locator, &ip->view);
    if (!ip->smeared) {
        bst_streak_fragments_join(&ip->fragments, &ip->view, ip->candidates.count, &ip->locator);
    }
    for (int i = 0; i < ip->locator.count; i++) {
        if (ip->locator.found[i].dropped) {
            continue;
        }
        if (kept < room) {
            ip->order[kept++] = i;
        } else {
            lost++;
        }
    }
    bst_sensor_order(ip->locator.found, kept, ip->view.height, ip->order, ip->order_swap, ip->row);
    for (int i = 0; i < kept; i++) {
        out->items[out->count++] = report(ip, &ip->view, &ip->locator.found[ip->order[i]]);
    }
    out->lost += lost;
    out->threshold_snr = p->threshold;
}

static void measure_columns(bst_imgproc *ip, bst_parallel *pool, const bst_imgproc_frame *frame) {
    if (ip->columns.capacity > 0) {
        bst_columns_measure(&ip->columns, pool, &ip->camera, frame);
    }
}

static void empty(bst_detections *out) {
    out->background_e = out->noise_e = out->threshold_snr = 0.0;
    out->shared_xx = out->shared_xy = out->shared_yy = 0.0;
    out->stars_identified = 0;
    out->count = 0;
    out->lost = 0;
}

bst_status bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                              const bst_camera_motion *motion, bst_detections *out, int capacity) {
    assert(ip && frame && frame->pixels && out && capacity >= 0);
    BST_TRY(check_frame(ctx, ip, frame));
    /* a pool that waits for processors is slower than one thread with a processor */
    bool alone = frame->beside_another && bst_parallel_threads(ip->pool) <= BST_STEP_LANES;
    part whole;
    empty(out);
    measure_columns(ip, alone ? NULL : ip->pool, frame);
    ip->windowed = false;
    find_candidates(ip, frame, frame, motion, alone ? NULL : ip->pool, &whole);
    const bool measured = !ip->smeared && bst_streak_motion_begin(&ip->streak_motion, &ip->view);
    if (measured) {
        bst_streak_motion_add(&ip->streak_motion, &ip->view, &ip->candidates);
        bst_imgproc_correct_motion(ip, frame->binning, &ip->motion);
    }
    bst_imgproc_begin_shows(ip);
    bst_imgproc_add_shows(ip, frame, frame);
    bst_pixel_shows_sort(&ip->shows);
    locate_candidates(ip, &whole, out, capacity);
    bst_imgproc_set_shared_shift(ip, motion, measured ? &ip->motion : NULL, out);
    out->background_e = (double)ip->background.median_level;
    out->noise_e = (double)ip->background.median_noise;
    return BST_OK;
}

/* Adds the star streaks of all windows to the measurement of the camera motion. Returns false if
 * the motion cannot be measured. */
static bool measure_in_windows(bst_imgproc *ip, const bst_imgproc_frame *frame,
                               const bst_imgproc_windows *windows,
                               const bst_camera_motion *motion) {
    for (int i = 0; i < windows->count; i++) {
        part p;
        bst_imgproc_frame window =
            bst_region_of_interest_crop(frame, &windows->items[i], ip->cropped);
        find_candidates(ip, &window, frame, motion, NULL, &p);
        if (i == 0 && (ip->smeared || !bst_streak_motion_begin(&ip->streak_motion, &ip->view))) {
            return false;
        }
        bst_streak_motion_add(&ip->streak_motion, &ip->view, &ip->candidates);
    }
    return windows->count > 0;
}

bst_status bst_imgproc_detect_windows(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                      const bst_imgproc_windows *windows,
                                      const bst_camera_motion *motion, bst_detections *out,
                                      int capacity) {
    assert(ip && frame && frame->pixels && windows && out && capacity >= 0);
    assert(windows->count >= 0 && (windows->items || windows->count == 0));
    BST_TRY(check_frame(ctx, ip, frame));
    double pixels = 0.0;
    bool measured = false;
    bst_camera_motion used = {.q_cam_from_gcrf = BST_QUAT_IDENTITY};
    empty(out);
    measure_columns(ip, ip->pool, frame);
    ip->windowed = true;
    if (motion) {
        used = *motion;
        measured = measure_in_windows(ip, frame, windows, motion);
        if (measured) {
            bst_imgproc_correct_motion(ip, frame->binning, &used);
        }
    }
    bst_imgproc_begin_shows(ip);
    for (int i = 0; i < windows->count; i++) {
        part p;
        const bst_window *w = &windows->items[i];
        bst_imgproc_frame window = bst_region_of_interest_crop(frame, w, ip->cropped);
        find_candidates(ip, &window, frame, motion ? &used : NULL, NULL, &p);
        bst_imgproc_add_shows(ip, &window, frame);
        locate_candidates(ip, &p, out, capacity);
        double n = (double)w->width * (double)w->height;
        pixels += n;
        out->background_e += n * (double)ip->background.median_level;
        out->noise_e += n * (double)ip->background.median_noise;
    }
    bst_pixel_shows_sort(&ip->shows);
    if (pixels > 0.0) {
        bst_imgproc_set_shared_shift(ip, motion, measured ? &used : NULL, out);
        out->background_e /= pixels;
        out->noise_e /= pixels;
    }
    return BST_OK;
}

void bst_imgproc_refine(bst_imgproc *ip, bst_detections *detections, int index,
                        const bst_optics_zero_point *zero_point) {
    assert(ip && detections && zero_point && index >= 0 && index < detections->count);
    bst_detection *item = &detections->items[index];
    if (ip->windowed || ip->followed_sigma_e > 0.0) {
        return;
    }
    int source = ip->order[index];
    if (!bst_locate_again(&ip->locator, &ip->view, source)) {
        return;
    }
    bst_detection fitted = report(ip, &ip->view, &ip->locator.found[source]), before = *item;
    bst_photometry_correct(zero_point, &fitted);
    fitted.label = before.label;
    fitted.label_probability = before.label_probability;
    fitted.star_id = before.star_id;
    *item = fitted;
}

double bst_imgproc_v_limit(const bst_imgproc *ip, double snr) {
    const bst_filter *f = &ip->filter;
    double norm = f->streak ? f->streak_norm : f->norm;
    double electrons = snr * (double)ip->background.median_noise / norm;
    electrons = ip->followed_sigma_e > 0.0 ? snr * ip->followed_sigma_e : electrons;
    return -2.5 * log10(electrons / (fmax(ip->exposure_s, 1e-9) * ip->electrons_per_s_v0));
}

void bst_imgproc_ground(const bst_imgproc *ip, double x_px, double y_px, double *level_e,
                        double *noise_e) {
    double x = (x_px - ip->view.origin_x_px) / ip->view.binning;
    double y = (y_px - ip->view.origin_y_px) / ip->view.binning;
    *level_e = bst_background_level_at(&ip->background, x, y);
    *noise_e = bst_background_noise_at(&ip->background, x, y);
}

double bst_imgproc_streak_px(const bst_imgproc *ip) {
    return ip->streak_px;
}

bool bst_imgproc_smeared(const bst_imgproc *ip) {
    return ip->smeared;
}
