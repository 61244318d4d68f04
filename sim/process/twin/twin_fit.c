/* Steps of the fit of one frame. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/process/twin/twin_defects.h"

/* Coefficients of the path that are tried in turn, and length of the path per interval that is
 * allowed at least, px. */
static const int COEFFICIENTS[] = {4, 5, 7, 11, 19, 35, 67};
enum { TRIED = sizeof COEFFICIENTS / sizeof *COEFFICIENTS, ROLL_MOST = 7 };
static const double LEAST_INTERVAL_PX = 5.0;
/* Intervals that are tried however short the path is, and length up to which the ends of streaks
 * are not trusted: the fit begins with points, too. */
enum { FREE_INTERVALS = 4 };
static const double SHORT_PX = 12.0;
/* Loss by which a value of the path must improve the fit on average. */
static const double GAIN_PER_VALUE = 1.0;
/* Faintest stars that are added, in rounds. */
static const double ROUND_SNR[] = {20.0, 8.0, 5.5};
enum { ROUNDS = 3 };
/* Stars that count for the number of coefficients of the path. */
static const double PATH_SNR = 15.0;
/* Limit and rounds of the clipping that measures the noise. */
static const double CLIP = 4.0;
enum { CLIPS = 8 };
/* Largest count of 16 bits. */
static const double LARGEST_DN = 65535.0;
/* Share of the full well or the largest count from which a pixel is not used. */
static const double FULL_SHARE = 0.95;
/* Error of the PSF's form at first and at most, as a share of a pixel's light, and light of the
 * pixels that tell it, standard deviations. */
static const double FIRST_FORM_ERROR = 0.02, MOST_FORM_ERROR = 0.1, BRIGHT_SIGMA = 5.0;
/* A pixel with less light of stars than this, in standard deviations, is one of the background. */
static const double DARK_SIGMA = 0.3;

/* Reads the pixels as electrons. */
static bst_status read_data(bst_ctx *ctx, bst_twin *t) {
    bst_process *p = &t->process;
    bst_recorded_frame r;
    const float *pixels;
    BST_TRY(bst_recorded_frames_select(ctx, p->recorded, t->frame->index, &p->options, &r));
    BST_TRY(bst_recorded_frames_pixels(ctx, p->recorded, &p->options, &r, &pixels));
    size_t count = (size_t)r.width * (size_t)r.height;
    t->data_e = malloc(count * sizeof *t->data_e);
    t->model.variance_e2 = malloc(count * sizeof *t->model.variance_e2);
    t->model.stars = calloc(BST_TWIN_STARS, sizeof *t->model.stars);
    if (!t->data_e || !t->model.variance_e2 || !t->model.stars) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a frame of %zu pixels", count);
    }
    const bst_keyword_values *v = &t->frame->values;
    double offset = *p->map.bias_section ? 0.0 : v->offset_dn;
    for (size_t i = 0; i < count; i++) {
        double e = v->gain_e_per_dn * ((double)pixels[i] - offset);
        double count_dn = p->map.pedestal_dn + p->map.dn_per_unit * (double)pixels[i];
        bool full = e > FULL_SHARE * v->full_well_e || count_dn > FULL_SHARE * LARGEST_DN;
        bool below =
            p->map.pedestal_dn > 0.0 && count_dn < 0.0; /* where frames are recorded as 0 */
        t->data_e[i] = full || below ? NAN : (float)e;
        t->below_range += below;
    }
    t->model.width = r.width;
    t->model.height = r.height;
    t->model.data_e = t->data_e;
    t->read_noise_e = v->read_noise_e;
    return BST_OK;
}

/* Mean and standard deviation of those values that are finite, without those beyond CLIP standard
 * deviations of the others. Begins with the median and the median deviation. */
static bst_status robust(bst_ctx *ctx, const float *values, size_t count, double *mean,
                         double *sigma) {
    float *kept = malloc((count + 1) * sizeof *kept);
    size_t n = 0;
    if (!kept) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
    }
    for (size_t i = 0; i < count; i++) {
        if (isfinite(values[i])) {
            kept[n++] = values[i];
        }
    }
    qsort(kept, n, sizeof *kept, bst_compare_floats);
    *mean = n > 0 ? (double)kept[n / 2] : 0.0;
    double low = n > 0 ? *mean - (double)kept[n / 6] : 0.0; /* 0.97 sigma */
    *sigma = fmax(low, 1e-3);
    for (int round = 0; round < CLIPS; round++) {
        double sum = 0.0, sum2 = 0.0, in = 0.0;
        for (size_t i = 0; i < n; i++) {
            double d = (double)kept[i] - *mean;
            if (fabs(d) < CLIP * *sigma) {
                sum += d;
                sum2 += d * d;
                in += 1.0;
            }
        }
        if (in < 2.0) {
            break;
        }
        *mean += sum / in;
        *sigma = sqrt(fmax(sum2 / in - sum * sum / (in * in), 1e-6));
    }
    free(kept);
    return BST_OK;
}

/* Error of the PSF's form: what residuals of bright pixels have beyond noise and shot noise. */
static void measure_form(bst_twin *t, const float *light) {
    bst_twin_model *m = &t->model;
    double excess = 0.0, light2 = 0.0;
    for (size_t i = 0; i < (size_t)m->width * (size_t)m->height; i++) {
        int x = (int)(i % (size_t)m->width), y = (int)(i / (size_t)m->width);
        double stars = (double)light[i];
        double r = (double)t->data_e[i] - stars - bst_twin_background(m, x, y);
        double variance = m->noise_e * m->noise_e + fmax(stars, 0.0);
        double most = variance + MOST_FORM_ERROR * MOST_FORM_ERROR * stars * stars;
        if (isfinite(r) && stars > BRIGHT_SIGMA * m->noise_e && r * r < CLIP * CLIP * most) {
            excess += r * r - variance;
            light2 += stars * stars;
        }
    }
    m->form_error = light2 > 0.0 ? fmin(sqrt(fmax(excess, 0.0) / light2), MOST_FORM_ERROR) : 0.0;
}

/* Noise of the pixels without stars, from the residual there, and error of the PSF's form. */
static bst_status measure_noise(bst_ctx *ctx, bst_twin *t) {
    bst_twin_model *m = &t->model;
    size_t count = (size_t)m->width * (size_t)m->height;
    float *residual = malloc(count * sizeof *residual);
    double mean, sigma;
    bst_status status = residual ? bst_twin_model_render(ctx, m, t->pool, residual)
                                 : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
    if (status == BST_OK) {
        measure_form(t, residual);
    }
    for (size_t i = 0; i < count && status == BST_OK; i++) {
        bool dark = (double)residual[i] < DARK_SIGMA * m->noise_e;
        int x = (int)(i % (size_t)m->width), y = (int)(i / (size_t)m->width);
        residual[i] = dark ? t->data_e[i] - residual[i] - (float)bst_twin_background(m, x, y) : NAN;
    }
    if (status == BST_OK) {
        status = robust(ctx, residual, count, &mean, &sigma);
    }
    if (status == BST_OK && sigma > 0.0) {
        m->noise_e = sigma;
    }
    free(residual);
    return status;
}

/* First path, PSF, background and noise. */
static bst_status begin(bst_ctx *ctx, bst_twin *t) {
    bst_twin_model *m = &t->model;
    const bst_process_frame *f = t->frame;
    bst_twin_attitude nodes[BST_PROCESS_NODES + 2];
    int count = 0;
    m->camera = (bst_camera){.width_px = m->width,
                             .height_px = m->height,
                             .pixel_scale_arcsec = t->process.scale_arcsec};
    BST_TRY(bst_camera_prepare(ctx, &m->camera));
    m->path = (bst_twin_path){.q_reference = f->q_middle, .count = {1, 1}};
    for (; count < f->node_count; count++) {
        nodes[count] = (bst_twin_attitude){f->nodes[count].share, f->nodes[count].q_cam_from_gcrf};
    }
    if (count >= COEFFICIENTS[0]) {
        m->path.count[0] = COEFFICIENTS[1];
        if (count > 2 * COEFFICIENTS[2]) {
            m->path.count[0] = COEFFICIENTS[2];
        }
        if (!bst_twin_path_fit(&m->path, nodes, count)) {
            return bst_recorded_frame_fail(
                ctx, f->path, &f->place,
                bst_fail(ctx, BST_ERR_NUMERIC, "the streaks give no path"));
        }
    }
    m->form_error = FIRST_FORM_ERROR;
    m->psf = (bst_twin_psf){.sigma_px = 0.9, .ratio = 2.5, .wide = 0.1};
    return robust(ctx, t->data_e, (size_t)m->width * (size_t)m->height, &m->background_e[0],
                  &m->noise_e);
}

/* Fits all but the number of stars and coefficients. */
static bst_status fit_all(bst_ctx *ctx, bst_twin *t, double least_snr, int iterations,
                          double *loss) {
    const bst_twin_freedom all = {.path = true,
                                  .roll = t->model.path.count[0] > 1,
                                  .scale = true,
                                  .psf = true,
                                  .least_snr = least_snr,
                                  .iterations = iterations};
    return bst_twin_model_fit(ctx, &t->model, &all, t->pool, loss);
}

/* Tries more coefficients of the path while they improve the fit by more than chance does. */
static bst_status refine_path(bst_ctx *ctx, bst_twin *t, double *loss) {
    bst_twin_model *m = &t->model;
    bst_twin_star *stars = malloc(BST_TWIN_STARS * sizeof *stars);
    bst_status status =
        stars ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars", BST_TWIN_STARS);
    for (int i = 0; i < TRIED && status == BST_OK; i++) {
        int n = COEFFICIENTS[i], roll = n < ROLL_MOST ? n : ROLL_MOST;
        int intervals = n - BST_TWIN_SUPPORT + 1;
        if (m->path.count[0] == 1 || (n <= m->path.count[0] && roll <= m->path.count[1])) {
            continue;
        }
        if (intervals > FREE_INTERVALS && t->length_px / intervals < LEAST_INTERVAL_PX) {
            break;
        }
        bst_twin_model before = *m;
        double was = *loss;
        memcpy(stars, m->stars, (size_t)m->count * sizeof *stars);
        int values = bst_twin_path_values(&m->path);
        if (!bst_twin_path_refine(&m->path, n > m->path.count[0] ? n : m->path.count[0], roll)) {
            *m = before;
            break;
        }
        status = fit_all(ctx, t, PATH_SNR, 6, loss);
        int more = bst_twin_path_values(&m->path) - values;
        if (status == BST_OK && was - *loss < GAIN_PER_VALUE * more) {
            bst_twin_star *own = m->stars;
            *m = before; /* variance_e2 is that of the refused fit; the next fit sets it */
            memcpy(own, stars, (size_t)m->count * sizeof *stars);
            *loss = was;
            break;
        }
    }
    free(stars);
    return status;
}

/* A motion of the points: linear in time, this long at first. */
static const double SEED_PX = 1.5;
enum { DIRECTIONS = 4 };

/* The image of a point does not change with a small motion in first order, so that the fit does not
 * find the direction by itself: begins with some directions, and takes the best one. */
static bst_status seed_motion(bst_ctx *ctx, bst_twin *t, double *loss) {
    bst_twin_model *m = &t->model, before = *m, best = *m;
    size_t bytes = BST_TWIN_STARS * sizeof *m->stars;
    bst_twin_star *kept = malloc(2 * bytes), *best_stars = kept ? kept + BST_TWIN_STARS : NULL;
    bst_status status =
        kept ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars", BST_TWIN_STARS);
    double least = *loss - GAIN_PER_VALUE * (bst_twin_path_values(&m->path) + COEFFICIENTS[0]);
    if (status == BST_OK) {
        memcpy(kept, m->stars, bytes);
        memcpy(best_stars, m->stars, bytes);
    }
    for (int d = 0; d < DIRECTIONS && status == BST_OK; d++) {
        double angle = BST_PI * d / DIRECTIONS, now;
        double half = 0.5 * SEED_PX * bst_camera_scale_rad(&m->camera);
        bst_twin_star *own = m->stars;
        *m = before;
        m->stars = own;
        memcpy(m->stars, kept, bytes);
        if (!bst_twin_path_refine(&m->path, COEFFICIENTS[0], COEFFICIENTS[0])) {
            break;
        }
        for (int k = 0; k < COEFFICIENTS[0]; k++) {
            double u = 2.0 * k / (COEFFICIENTS[0] - 1) - 1.0;
            m->path.coefficients[0][k] -= half * u * sin(angle);
            m->path.coefficients[1][k] += half * u * cos(angle);
        }
        status = fit_all(ctx, t, PATH_SNR, 4, &now);
        if (status == BST_OK && now < least) {
            least = *loss = now;
            best = *m;
            memcpy(best_stars, m->stars, bytes);
        }
    }
    if (status == BST_OK) {
        bst_twin_star *own = m->stars;
        *m = best;
        m->stars = own;
        memcpy(m->stars, best_stars, bytes);
    }
    free(kept);
    return status;
}

/* The ends of short streaks, which the PSF blurs, can be a few pixels off, and the fit does not
 * find back from a path that is much too long: begins with points as well, and takes what fits
 * better. */
static bst_status try_points(bst_ctx *ctx, bst_twin *t, double *loss) {
    bst_twin_model *m = &t->model, streaks = *m;
    size_t bytes = BST_TWIN_STARS * sizeof *m->stars;
    bst_twin_star *own = m->stars, *kept = malloc(bytes);
    double as_streaks = *loss;
    if (!kept) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars", BST_TWIN_STARS);
    }
    memcpy(kept, own, bytes);
    m->path =
        (bst_twin_path){.q_reference = bst_twin_path_attitude(&streaks.path, 0.5), .count = {1, 1}};
    bst_status status = fit_all(ctx, t, 0.0, 8, loss);
    if (status == BST_OK) {
        status = seed_motion(ctx, t, loss);
    }
    if (status == BST_OK) {
        status = fit_all(ctx, t, 0.0, 8, loss);
    }
    if (status == BST_OK && !(*loss < as_streaks)) {
        *m = streaks;
        memcpy(own, kept, bytes);
        *loss = as_streaks;
    }
    free(kept);
    return status;
}

/* One round: stars down to a signal-to-noise ratio, then all parameters. */
static bst_status add_stars(bst_ctx *ctx, bst_twin *t, double least_snr, double *loss) {
    int added;
    BST_TRY(bst_twin_add_found(ctx, t, least_snr, &added));
    BST_TRY(fit_all(ctx, t, 0.0, 4, loss));
    bst_twin_remove_faint(t, least_snr);
    return measure_noise(ctx, t);
}

static bst_status fit_last(bst_ctx *ctx, bst_twin *t) {
    double loss;
    return fit_all(ctx, t, 0.0, 4, &loss);
}

bst_status bst_twin_fit_frame(bst_ctx *ctx, bst_twin *t) {
    static const bst_twin_freedom fluxes = {.iterations = 3};
    double loss;
    BST_TRY(read_data(ctx, t));
    BST_TRY(begin(ctx, t));
    t->length_px = bst_twin_path_length_px(&t->model);
    t->direction_known = t->process.direction_known && t->frame->node_count > 1;
    BST_TRY(bst_twin_add_catalogue(ctx, t));
    BST_TRY(bst_twin_model_fit(ctx, &t->model, &fluxes, t->pool, &loss));
    BST_TRY(fit_all(ctx, t, 0.0, 8, &loss));
    if (t->model.path.count[0] == 1) {
        BST_TRY(seed_motion(ctx, t, &loss));
        t->length_px = bst_twin_path_length_px(&t->model);
    } else if (t->length_px < SHORT_PX) {
        BST_TRY(try_points(ctx, t, &loss));
        t->length_px = bst_twin_path_length_px(&t->model);
    }
    for (int i = 0; i < ROUNDS; i++) {
        BST_TRY(bst_twin_measure_photometry(ctx, t));
        BST_TRY(add_stars(ctx, t, ROUND_SNR[i], &loss));
        BST_TRY(fit_all(ctx, t, PATH_SNR, 6, &loss)); /* with the noise of now */
        BST_TRY(refine_path(ctx, t, &loss));
        t->length_px = bst_twin_path_length_px(&t->model);
    }
    BST_TRY(bst_twin_find_defects(ctx, t));
    BST_TRY(bst_twin_fit_defects(ctx, t, fit_last));
    return bst_twin_measure_photometry(ctx, t);
}
