#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/pd/pd.h"
#include "sim/cli/progress.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/wall_clock.h"
#include "sim/eval/detection_theory.h"
#include "sim/eval/location_bound.h"

/* Targets per SNR whose bound is computed: it depends little on the pixel phase, and a long streak
 * takes a millisecond. */
enum { BOUNDS_AT_REST = 100, BOUNDS_OF_STREAKS = 12 };

static const double BOUND_MARGIN_PX = 16.0;
static const int64_t FEWEST_EMPTY = 50, MOST_EMPTY = 400;

typedef struct runner {
    bst_pd_scene *scene;
    bst_pd_detector *detector;
    bst_detections *detections;
    int capacity;
    int *of_target, *of_detection; /* [room], [capacity] */
    bst_pd_result *result;
} runner;

/* Adds the Cramér-Rao bound of an artificial target's position to the tally. */
static bst_status add_bound(bst_ctx *ctx, const runner *r, const bst_eval_match_target *place,
                            const bst_pd_target *target, bst_pd_tally *tally) {
    const bst_pd_scene *s = r->scene;
    if (tally->bounds >= (s->sharpness ? BOUNDS_OF_STREAKS : BOUNDS_AT_REST) ||
        (s->options.known_rate &&
         tally->bounds > r->result->frames)) { /* one direction per frame */
        return BST_OK;
    }
    bst_eval_bound_source source = {.x_px = place->x_px,
                                    .y_px = place->y_px,
                                    .dx_px = place->dx_px,
                                    .dy_px = place->dy_px,
                                    .sigma_px = s->sigma_px,
                                    .flux_e = target->flux_e};
    /* multiplication enlarges all variances, own light included, by one factor */
    double excess = bst_camera_excess_noise(&s->camera);
    bst_eval_bound_noise noise = {target->noise_e / sqrt(excess), true};
    bst_location_bound bound;
    double along[2];
    if (s->image) {
        BST_TRY(bst_pd_image_bound(ctx, s->image, place, target->flux_e, &noise, &bound));
    } else {
        BST_TRY(bst_location_bound_gaussian(ctx, &source, &noise, BOUND_MARGIN_PX, &bound));
    }
    bst_location_bound_along(&bound, place->dx_px, place->dy_px, along);
    /* the mean of n frames has 1 / n of the variance; the position at their end also has that of
     * the rate, 3 (n - 1) / (n + 1) of it */
    double n = bst_pd_scene_stacked(s), share = excess / n,
           end = excess * (4.0 * n - 2.0) / (n * (n + 1.0));
    tally->bound_square[0] += end * along[0];
    tally->bound_square[1] += end * along[1];
    tally->flux_bound_square += share * bound.covariance[BST_BOUND_FLUX][BST_BOUND_FLUX] /
                                (target->flux_e * target->flux_e);
    tally->bounds++;
    return BST_OK;
}

/* Adds the position and flux errors of a matched detection to the tally. */
static void add_error(const bst_eval_match_target *place, const bst_pd_target *target,
                      const bst_detection *d, bst_pd_tally *tally) {
    double x = d->x_px - place->x_px, y = d->y_px - place->y_px;
    double length = hypot(place->dx_px, place->dy_px);
    double c = length > 0.0 ? place->dx_px / length : 1.0,
           s = length > 0.0 ? place->dy_px / length : 0.0;
    const double error[2] = {c * x + s * y, c * y - s * x};
    for (int a = 0; a < 2; a++) {
        tally->error_sum[a] += error[a];
        tally->error_square[a] += error[a] * error[a];
    }
    double flux = d->flux_e / target->flux_e - 1.0;
    tally->flux_sum += flux;
    tally->flux_square += flux * flux;
    double determinant = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
    tally->chi_square +=
        (d->cov_yy * x * x - 2.0 * d->cov_xy * x * y + d->cov_xx * y * y) / determinant;
    const double at[2] = {place->x_px, place->y_px}, off[2] = {x, y};
    for (int a = 0; a < 2; a++) {
        double phase = at[a] + 0.5 - floor(at[a] + 0.5); /* 1/2: centre of the pixel */
        int bin = (int)fmin(phase * BST_PD_PHASES, BST_PD_PHASES - 1.0);
        tally->phase_sum[a][bin] += off[a];
        tally->phase_count[a][bin]++;
    }
}

/* Counts detected and missed artificial targets of a frame. */
static bst_status count_targets(bst_ctx *ctx, runner *r, const bst_pd_frame *f) {
    bst_pd_result *out = r->result;
    int taken = 0, near = 0;
    bst_eval_match_targets(f->places, f->count, r->scene->fwhm_px, r->detections, r->of_target,
                           r->of_detection);
    for (int i = 0; i < f->count; i++) {
        bst_pd_tally *tally = &out->tallies[f->targets[i].point];
        BST_TRY(add_bound(ctx, r, &f->places[i], &f->targets[i], tally));
        tally->trials++;
        if (r->of_target[i] >= 0) {
            tally->matched++;
            taken++;
            add_error(&f->places[i], &f->targets[i], &r->detections->items[r->of_target[i]], tally);
        }
    }
    for (int i = 0; i < r->detections->count; i++) {
        near += r->of_detection[i] >= 0;
    }
    out->unmatched += r->detections->count - near;
    out->second += near - taken;
    out->frames += bst_pd_scene_stacked(r->scene);
    return BST_OK;
}

/* Counts false alarms and chance matches in a frame without artificial targets. */
static void count_chance(runner *r, const bst_pd_frame *f) {
    bst_pd_result *out = r->result;
    out->chance_hits += bst_eval_match_targets(f->places, f->count, r->scene->fwhm_px,
                                               r->detections, r->of_target, r->of_detection);
    out->chance_trials += f->count;
    for (int i = 0; i < r->detections->count; i++) {
        bool star = bst_pd_is_star(&f->stars, r->scene->fwhm_px, &r->detections->items[i]);
        out->stars += star;
        out->false_alarms += !star;
    }
    out->empty_frames += bst_pd_scene_stacked(r->scene);
}

/* Processes a frame and counts. `answers`: it is the last frame of a stack. */
static bst_status process(bst_ctx *ctx, runner *r, bst_frame *frame, const bst_pd_frame *f,
                          bool targets, bool answers) {
    const uint16_t *pixels;
    BST_TRY(bst_frame_map(frame, ctx, &pixels)); /* waits for the renderer before timing starts */
    double started = bst_wall_seconds();
    bst_status status =
        bst_pd_detect(ctx, r->detector, r->scene, frame, f, r->detections, r->capacity);
    r->result->process_s += targets ? 0.0 : bst_wall_seconds() - started;
    bst_frame_unmap(frame);
    if (status != BST_OK || !answers) {
        return status;
    }
    r->result->threshold_snr = r->detections->threshold_snr;
    r->result->lost += r->detections->lost;
    if (!targets) {
        count_chance(r, f);
        return BST_OK;
    }
    return count_targets(ctx, r, f);
}

/* Renders and processes frames; each is requested before the previous one is processed. */
static bst_status do_frames(bst_ctx *ctx, runner *r, int64_t count, bool targets,
                            bst_progress *progress, int64_t done) {
    bst_pd_scene *s = r->scene;
    bst_frame *frames[2] = {NULL, NULL};
    bst_status status = BST_OK;
    for (int64_t n = 0; n <= count && status == BST_OK; n++) {
        if (bst_stop_requested()) {
            status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
            break;
        }
        if (n < count) {
            bst_pd_frame *f = &s->frames[n % 2];
            status = bst_pd_scene_set(ctx, s, n, targets, f);
        }
        if (n < count && status == BST_OK) {
            status =
                bst_renderer_render(ctx, s->renderer, &s->frames[n % 2].request, &frames[n % 2]);
        }
        if (n > 0 && status == BST_OK) {
            int k = (int)((n - 1) % 2);
            status = process(ctx, r, frames[k], &s->frames[k], targets,
                             n % bst_pd_scene_stacked(s) == 0);
            bst_frame_release(frames[k]);
            frames[k] = NULL;
            bst_progress_update(progress, done + n);
        }
    }
    for (int i = 0; i < 2; i++) {
        bst_frame_release(frames[i]);
    }
    return status;
}

static int64_t empty_frames(const bst_pd_options *o, double requested) {
    if (o->empty_frames > 0) {
        return o->empty_frames;
    }
    double wanted = requested > 0.0 ? ceil(400.0 / requested) : (double)MOST_EMPTY;
    return (int64_t)fmin(fmax(wanted, (double)FEWEST_EMPTY), (double)MOST_EMPTY);
}

bst_status bst_pd_run(bst_ctx *ctx, bst_pd_scene *s, bst_pd_detector *detector,
                      bst_pd_result *out) {
    int room = bst_pd_scene_room(s);
    runner r = {.scene = s, .detector = detector, .capacity = 4 * room + 65536, .result = out};
    memset(out, 0, sizeof *out);
    out->pixels = (double)s->camera.width_px * (double)s->camera.height_px;
    r.detections =
        malloc(sizeof *r.detections + (size_t)r.capacity * sizeof r.detections->items[0]);
    r.of_target = malloc((size_t)room * sizeof *r.of_target);
    r.of_detection = malloc((size_t)r.capacity * sizeof *r.of_detection);
    bst_status status = BST_OK;
    if (!r.detections || !r.of_target || !r.of_detection) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d detections", r.capacity);
    }
    double started = bst_wall_seconds();
    int64_t stacked = bst_pd_scene_stacked(s);
    int64_t trials = s->points * s->options.trials, frames = (trials + room - 1) / room * stacked;
    int64_t empty = empty_frames(&s->options, s->options.false_alarms);
    empty = (empty + stacked - 1) / stacked * stacked;
    bst_progress progress;
    bst_progress_start(&progress, s->name, "frames", frames + empty);
    progress.off = s->options.quiet;
    if (status == BST_OK) {
        status = do_frames(ctx, &r, empty, false, &progress, 0);
    }
    if (status == BST_OK) {
        status = do_frames(ctx, &r, frames, true, &progress, empty);
    }
    bst_progress_end(&progress);
    out->wall_s = bst_wall_seconds() - started;
    out->process_s /= fmax((double)out->empty_frames, 1.0);
    free(r.detections);
    free(r.of_target);
    free(r.of_detection);
    return status;
}

/* Standard error of the SNR loss in dB. */
static double loss_sigma(bst_pd_needed needed, double pfa, int64_t alarms, double pd) {
    /* d ln(snr) of both; Q^-1(pfa) changes by -d ln(pfa) / hazard; the hazard of a normal tail is
     * about Q^-1 */
    double t = bst_eval_ideal_snr(pfa, 0.5), ideal = bst_eval_ideal_snr(pfa, pd);
    double of_alarms = 1.0 / (sqrt((double)alarms) * t * ideal);
    return 20.0 / log(10.0) * hypot(needed.sigma / needed.snr, of_alarms);
}

void bst_pd_figures_of(const bst_pd_scene *s, const bst_pd_result *r, bst_pd_figures *out) {
    bst_pd_point points[BST_PD_POINTS];
    for (int i = 0; i < s->points; i++) {
        points[i] = (bst_pd_point){s->snr[i], r->tallies[i].trials, r->tallies[i].matched};
    }
    double frames = (double)r->empty_frames;
    bst_eval_interval alarms = bst_eval_poisson_interval(r->false_alarms, 0.05);
    *out = (bst_pd_figures){.false_alarms_per_frame = (double)r->false_alarms / frames,
                            .false_alarms_low = alarms.low / frames,
                            .false_alarms_high = alarms.high / frames};
    out->pfa = fmin(out->false_alarms_per_frame / r->pixels, 0.5);
    out->chance = r->chance_trials > 0 ? (double)r->chance_hits / (double)r->chance_trials : 0.0;
    out->pd50 = bst_pd_snr_at(points, s->points, out->chance, 0.5);
    out->pd90 = bst_pd_snr_at(points, s->points, out->chance, 0.9);
    out->loss_db_pd50 = bst_pd_loss_db(out->pd50.snr, out->pfa, 0.5);
    out->loss_db_pd90 = bst_pd_loss_db(out->pd90.snr, out->pfa, 0.9);
    out->own_light_db_pd50 =
        20.0 * log10(out->pd50.snr / bst_eval_matched_filter_snr(out->pfa, 0.5, s->own_light));
    out->own_light_db_pd90 =
        20.0 * log10(out->pd90.snr / bst_eval_matched_filter_snr(out->pfa, 0.9, s->own_light));
    out->gain_db_pd50 = -out->loss_db_pd50;
    out->gain_db_pd90 = -out->loss_db_pd90;
    out->gain_over_single_db_pd50 = out->gain_over_single_db_pd90 = NAN;
    out->loss_db_sigma_pd50 = loss_sigma(out->pd50, out->pfa, r->false_alarms, 0.5);
    out->loss_db_sigma_pd90 = loss_sigma(out->pd90, out->pfa, r->false_alarms, 0.9);
}

void bst_pd_compare_single(const bst_pd_figures *single, bst_pd_figures *stack) {
    stack->gain_over_single_db_pd50 = stack->gain_db_pd50 + single->loss_db_pd50;
    stack->gain_over_single_db_pd90 = stack->gain_db_pd90 + single->loss_db_pd90;
}
