#include "sim/analysis/calibration/calibrate.h"

#include <math.h>
#include <stdlib.h>

#include "sim/analysis/calibration/calibrate_internal.h"

/* SNR around the threshold in which Pd is fitted */
static const double PD_REACH = 4.0;
enum { LEAST_COMMON = 8, GRID = 48, CAPACITY = 4096 };

bst_status bst_calibration_fitter_create(bst_ctx *ctx, bst_calibration_fitter **out) {
    *out = calloc(1, sizeof **out);
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a calibration");
}

void bst_calibration_fitter_free(bst_calibration_fitter *c) {
    if (c) {
        bst_generator_free(c->theory);
        bst_pairing_free(&c->pairing);
        free(c->trials);
        free(c->alarm_energy);
        free(c);
    }
}

bst_status bst_calibration_fitter_begin(bst_ctx *ctx, bst_calibration_fitter *c,
                                        const bst_calibration_path *path) {
    bst_obsgen_calibration theory;
    bst_obsgen_calibration_theory(&theory);
    theory.crowding = theory.background_fraction = 0.0;
    const bst_generator_settings settings = {.capacity = CAPACITY,
                                             .false_alarms_per_frame = path->false_alarms_per_frame,
                                             .jitter_px = path->jitter_px,
                                             .streak_min_px = path->streak_min_px,
                                             .streak_max_px = path->streak_max_px};
    bst_generator_free(c->theory);
    c->theory = NULL;
    c->path = *path;
    c->sigma_px = hypot(bst_camera_psf_sigma_px(path->camera), path->jitter_px);
    bst_crlb_table_init(&c->bound, c->sigma_px);
    bst_rng_key key = bst_rng_make_key(1, 0, "calibration", "observations");
    return bst_generator_create(ctx, path->camera, path->camera, &settings, &theory, key,
                                &c->theory);
}

static bst_status grow(bst_ctx *ctx, void **items, long count, long *room, size_t bytes) {
    if (count < *room) {
        return BST_OK;
    }
    long more = 2 * *room + 1024;
    void *moved = realloc(*items, (size_t)more * bytes);
    if (!moved) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %ld sources of a calibration", more);
    }
    *items = moved;
    *room = more;
    return BST_OK;
}

/* Length in px of a source's streak in the frame. */
static double length_of(const bst_truth_item *t) {
    double length = hypot(t->x_end_px - t->x_start_px, t->y_end_px - t->y_start_px);
    return isfinite(length) ? length : 0.0;
}

/* Path of the stars at the centre of the frame, from the star nearest to it; false: none. */
static bool star_path(const bst_truth *truth, double x, double y, double *dx, double *dy) {
    double nearest = INFINITY;
    *dx = *dy = 0.0;
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *t = &truth->items[i];
        double distance = hypot(t->x_centroid_px - x, t->y_centroid_px - y);
        if (t->kind == BST_SOURCE_STAR && distance < nearest && isfinite(t->x_end_px) &&
            isfinite(t->x_start_px)) {
            nearest = distance;
            *dx = t->x_end_px - t->x_start_px;
            *dy = t->y_end_px - t->y_start_px;
        }
    }
    return isfinite(nearest);
}

/* Checks that a position is further than `reach` from every visible source of the truth. */
static bool is_free(const bst_truth *truth, double x, double y, double reach, int except,
                    double snr) {
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *t = &truth->items[i];
        if (i == except || !(t->snr > snr) || (t->flags & BST_TRUTH_OCCULTED)) {
            continue;
        }
        double away = reach * fmin(1.0 + t->snr / 1000.0, 4.0) + 0.5 * length_of(t);
        if (fabs(t->x_centroid_px - x) < away && fabs(t->y_centroid_px - y) < away) {
            return false;
        }
    }
    return true;
}

/* Node of the calibration's SNR grid that is nearest on a logarithmic scale. */
static int snr_node(double snr) {
    int best = 0;
    for (int i = 1; i < BST_OBSGEN_SNRS; i++) {
        best =
            fabs(log(snr / bst_obsgen_snrs[i])) < fabs(log(snr / bst_obsgen_snrs[best])) ? i : best;
    }
    return best;
}

/* Position error that all stars of a frame share; the generator gets it from the camera's
 * motion. */
typedef struct common_error {
    double x, y, weight; /* sum of 1 / variance, px^-2 */
    int count;
} common_error;

/* Weight of a star in the common centroid error: inverse Cramér-Rao variance. */
static double place_weight(const bst_calibration_fitter *c, const bst_truth_item *t,
                           double noise_e) {
    bst_crlb_table_at at = bst_crlb_table_wider(&c->bound, t->electrons, noise_e, length_of(t), 1.0,
                                                bst_camera_excess_noise(c->path.camera));
    return 1.0 / (at.var_along_px2 + at.var_across_px2 + 1e-4);
}

/* Adds the squared centroid error of a detection, in units of the Cramér-Rao bound. */
static void add_place(bst_calibration_fitter *c, const bst_truth_item *t, const bst_detection *d,
                      double noise_e, const common_error *common) {
    /* each star contributes its own weight to the mean */
    double own = place_weight(c, t, noise_e) / common->weight;
    if (common->count < LEAST_COMMON || own > 0.5) {
        return;
    }
    double free_part = 1.0 / sqrt(1.0 - own);
    double length = length_of(t), dx = (d->x_px - t->x_centroid_px - common->x) * free_part,
           dy = (d->y_px - t->y_centroid_px - common->y) * free_part;
    double cosine = length > 0.0 ? (t->x_end_px - t->x_start_px) / length : 1.0;
    double sine = length > 0.0 ? (t->y_end_px - t->y_start_px) / length : 0.0;
    bst_crlb_table_at at = bst_crlb_table_wider(&c->bound, t->electrons, noise_e, length, 1.0,
                                                bst_camera_excess_noise(c->path.camera));
    double along = dx * cosine + dy * sine, across = dy * cosine - dx * sine;
    int node = snr_node(t->electrons * at.norm / noise_e);
    const double squares[2] = {along * along / at.var_along_px2,
                               across * across / at.var_across_px2};
    for (int k = 0; k < 2; k++) {
        /* a larger error belongs to the light of another source */
        if (squares[k] < CALIBRATE_MOST_SIGMAS * CALIBRATE_MOST_SIGMAS) {
            calibrate_mean *sum = k == 0 && length > 1.0 ? &c->along[node] : &c->across[node];
            sum->sum += squares[k];
            sum->count++;
        }
    }
    double weight = 1.0 / (at.var_across_px2 + 1e-6);
    const double place[2] = {t->x_centroid_px, t->y_centroid_px}, off[2] = {dx, dy};
    for (int k = 0; k < 2 && length < 1.0; k++) {
        double wave = sin(2.0 * BST_PI * place[k]);
        c->bias_sum += weight * wave * off[k];
        c->bias_weight += weight * wave * wave;
    }
}

/* Adds a detection trial of a source near the threshold. */
static bst_status add_trial(bst_ctx *ctx, bst_calibration_fitter *c, const bst_truth_item *t,
                            double amplitude, double threshold, const bst_generator_result *theory,
                            bool detected) {
    const bst_generator_filter *filter = &theory->filter, *point = &theory->point;
    if (fabs(amplitude - threshold) > PD_REACH) {
        return BST_OK;
    }
    BST_TRY(grow(ctx, (void **)&c->trials, c->trial_count, &c->trial_room, sizeof *c->trials));
    c->trials[c->trial_count++] = (calibrate_trial){
        .amplitude = (float)amplitude,
        .threshold = (float)threshold,
        .length = (float)length_of(t),
        .variance = (float)filter->variance,
        .shot = (float)filter->shot,
        .other = theory->streak_px > 0.0 ? (float)(point->efficiency / filter->efficiency) : 0.0f,
        .other_threshold = (float)(threshold + point->threshold - filter->threshold),
        .other_variance = (float)point->variance,
        .other_shot = (float)point->shot,
        .shared_noise = (float)theory->shared_noise,
        .detected = detected};
    return BST_OK;
}

/* Adds the false alarms of a frame. above: threshold at the pixels' own noise over that for normal
 * noise. */
static bst_status add_alarms(bst_ctx *ctx, bst_calibration_fitter *c, const bst_truth *truth,
                             const bst_detections *detections, double reach, double taken,
                             double above) {
    double width = (double)c->path.camera->width_px, height = (double)c->path.camera->height_px;
    int open = 0;
    for (int k = 0; k < GRID * GRID; k++) {
        double x = width * (k % GRID + 0.5) / GRID;
        double y = height * ((double)(k / GRID) + 0.5) / GRID;
        open += is_free(truth, x, y, reach, -1, 1.0);
    }
    /* an overestimated background also reduces the noise */
    double less = exp(-taken * (detections->threshold_snr + 0.5 * taken));
    c->alarms_expected += c->path.false_alarms_per_frame * less * open / (GRID * GRID);
    for (int i = 0; i < detections->count; i++) {
        const bst_detection *d = &detections->items[i];
        if (c->pairing.item_of[i] >= 0 || !is_free(truth, d->x_px, d->y_px, reach, -1, 1.0)) {
            continue;
        }
        double T = detections->threshold_snr + above;
        if (truth->hits > 0 && d->snr > 1.5 * T) {
            c->hits++;
            c->hits_told += d->label == BST_LABEL_HIT || d->label == BST_LABEL_HOT_PIXEL;
            continue;
        }
        BST_TRY(grow(ctx, (void **)&c->alarm_energy, c->alarm_count, &c->alarm_room,
                     sizeof *c->alarm_energy));
        c->alarm_energy[c->alarm_count++] = fmax(0.5 * (d->snr * d->snr - T * T), 0.0);
    }
    return BST_OK;
}

/* Adds the measured noise and background of a frame to their fit. */
static void add_noise(bst_calibration_fitter *c, const bst_detections *detections,
                      const bst_generator_result *theory) {
    double variance = theory->noise_e * theory->noise_e, n = 1.0,
           q = theory->faint_square_e2 / variance,
           y = detections->noise_e * detections->noise_e / variance;
    c->nn += n * n;
    c->nq += n * q;
    c->qq += q * q;
    c->ny += n * y;
    c->qy += q * y;
    c->light_square += theory->faint_light_e * theory->faint_light_e;
    c->light_bias += theory->faint_light_e * (detections->background_e - theory->background_e);
}

/* Checks that a star is completely on the frame, without neighbours. */
static bool is_isolated(const bst_calibration_fitter *c, const bst_truth *truth, int i,
                        double reach) {
    const bst_truth_item *t = &truth->items[i];
    const bst_camera *camera = c->path.camera;
    double x = t->x_centroid_px, y = t->y_centroid_px, edge = reach + 0.5 * length_of(t);
    bool whole = x > edge && y > edge && x < (double)camera->width_px - edge &&
                 y < (double)camera->height_px - edge;
    bool dark = !(t->flags & BST_TRUTH_IN_FIELD) || (t->flags & BST_TRUTH_OCCULTED) ||
                (t->flags & BST_TRUTH_SATURATED);
    return !dark && whole && t->snr > 1.0 && t->kind == BST_SOURCE_STAR &&
           is_free(truth, x, y, reach + 0.5 * length_of(t), i, 0.5);
}

/* Values that hold for all stars of a frame. */
typedef struct frame_facts {
    const bst_detections *detections;
    const bst_generator_result *theory;
    double dark_e; /* background and dark current */
    const common_error *common;
} frame_facts;

/* Adds an isolated star with its detection: index k, or -1. */
static bst_status add_star(bst_ctx *ctx, bst_calibration_fitter *c, const bst_truth_item *t, int k,
                           const frame_facts *f) {
    const bst_detections *detections = f->detections;
    const bst_generator_result *theory = f->theory;
    const bst_camera *camera = c->path.camera;
    double read_e = bst_camera_read_noise_e(camera);
    double plain = sqrt(f->dark_e + read_e * read_e);
    /* the excess of its background is missing in the filter output */
    double missing = (detections->background_e - theory->background_e) /
                     (bst_crlb_table_norm(&c->bound, length_of(t)) * detections->noise_e);
    double threshold = theory->filter.threshold + detections->threshold_snr - theory->threshold_snr;
    BST_TRY(add_trial(ctx, c, t, t->snr * plain / detections->noise_e, threshold + missing, theory,
                      k >= 0));
    if (k < 0) {
        return BST_OK;
    }
    c->detected++;
    const bst_detection *d = &detections->items[k];
    add_place(c, t, d, detections->noise_e, f->common);
    if (detections->stars_identified > 0 && t->snr > detections->threshold_snr + 2.0 &&
        !(t->id & UINT32_C(0x80000000))) {
        c->identifiable++;
        c->identified += d->star_id == t->id;
    }
    return BST_OK;
}

bst_status bst_calibration_fitter_add(bst_ctx *ctx, bst_calibration_fitter *c,
                                      const bst_truth *truth, const bst_detections *detections,
                                      double exposure_s) {
    const bst_camera *camera = c->path.camera;
    bst_generator_frame frame = {.truth = truth,
                                 .window = {0, 0, (int)camera->width_px, (int)camera->height_px},
                                 .binning = 1,
                                 .exposure_s = exposure_s,
                                 .sigma_px = c->sigma_px};
    if (!star_path(truth, 0.5 * (double)camera->width_px, 0.5 * (double)camera->height_px,
                   &frame.streak_dx_px, &frame.streak_dy_px)) {
        return BST_OK; /* the camera motion is unknown */
    }
    bst_generator_result theory;
    BST_TRY(bst_generator_run(ctx, c->theory, &frame, &theory));
    if (theory.smeared || !(detections->noise_e > 0.0)) {
        return BST_OK;
    }
    c->frames++;
    c->threshold_offset += detections->threshold_snr - theory.threshold_snr;
    add_noise(c, detections, &theory);
    double fwhm = BST_FWHM_PER_SIGMA * c->sigma_px, reach = 5.0 * c->sigma_px + 3.0;
    BST_TRY(bst_pairing_make(ctx, &c->pairing, truth, detections, fwhm));
    /* first the common error, then each star */
    common_error common = {0.0, 0.0, 0.0, 0};
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < truth->count; i++) {
            const bst_truth_item *t = &truth->items[i];
            int k = c->pairing.detection_of[i];
            if ((pass == 0 && k < 0) || !is_isolated(c, truth, i, reach)) {
                continue;
            }
            if (pass == 0) {
                double weight = place_weight(c, t, detections->noise_e);
                common.x += weight * (detections->items[k].x_px - t->x_centroid_px);
                common.y += weight * (detections->items[k].y_px - t->y_centroid_px);
                common.weight += weight;
                common.count++;
            } else {
                const frame_facts facts = {detections, &theory, truth->background_e + truth->dark_e,
                                           &common};
                BST_TRY(add_star(ctx, c, t, k, &facts));
            }
        }
        if (pass == 0 && common.count > 0) {
            common.x /= common.weight;
            common.y /= common.weight;
        }
    }
    double taken = (detections->background_e - theory.background_e) /
                   (bst_crlb_table_norm(&c->bound, 0.0) * detections->noise_e);
    double above = theory.filter.threshold - theory.threshold_snr;
    return add_alarms(ctx, c, truth, detections, reach, taken, above);
}
