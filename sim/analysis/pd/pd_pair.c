#include "sim/analysis/pd/pd_pair.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/progress.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/wall_clock.h"

/* One target of EACH is a pair: the detector takes the width of the PSF from all sources. */
enum { EACH = 5, CHOSEN = 9 };

/* Separations about the bound of a test with unknown parameters: Pd from 0.3 to 1 for a detector
 * that is up to 1.4 times above it. */
static const double OVER_BOUND[CHOSEN] = {0.75, 0.85, 0.92, 1.0, 1.08, 1.18, 1.3, 1.5, 1.75};
/* Without pair test or bound: those about which a matched filter separates, FWHM. */
static const double OF_FWHM[CHOSEN] = {1.4, 1.6, 1.7, 1.8, 2.0, 2.2, 2.5, 3.0, 3.6};
static const double ASKED_PD = 0.9;
/* False splits of the bound for a detector that does not test for pairs. */
static const double USUAL_FALSE_SPLITS = 0.01;
/* Light beyond this from a source does not matter to the bound, FWHM. */
static const double MARGIN_FWHM = 4.0;

typedef struct runner {
    bst_pd_scene *scene;
    bst_pd_detector *detector;
    bst_detections *detections;
    int capacity;
    bst_pd_pair_target *targets[2]; /* [room] each, beside scene->frames */
    int64_t frames;                 /* of the scene so far */
    bst_progress *progress;
    int64_t done;
} runner;

/* Region and shape of a bound. */
typedef struct drawing {
    const bst_pd_scene *scene;
    bst_eval_region region;
    double dx_px, dy_px;
} drawing;

static void draw(void *user, double x_px, double y_px, double *share) {
    const drawing *d = user;
    if (d->scene->image) {
        const bst_eval_match_target place = {x_px, y_px, d->dx_px, d->dy_px};
        bst_pd_image_shares(d->scene->image, &place, d->region.x0, d->region.y0, d->region.width,
                            d->region.height, share);
    } else {
        const bst_eval_bound_source source = {x_px, y_px, d->dx_px, d->dy_px, d->scene->sigma_px,
                                              1.0};
        bst_eval_gaussian_shares(&source, &d->region, share);
    }
}

bst_status bst_pd_pair_bound(bst_ctx *ctx, const bst_pd_scene *s, double snr, double ratio,
                             double false_splits, bst_pair_separations *out) {
    const bst_camera *c = &s->camera;
    double x = floor(bst_camera_centre_x(c)), y = floor(bst_camera_centre_y(c));
    drawing d = {
        .scene = s, .dx_px = 0.8 * s->options.streak_px, .dy_px = 0.6 * s->options.streak_px};
    double largest = BST_PD_WIDEST_PAIR_FWHM * s->fwhm_px,
           margin = largest + MARGIN_FWHM * s->fwhm_px;
    int half_x = (int)ceil(0.5 * d.dx_px + margin), half_y = (int)ceil(0.5 * d.dy_px + margin);
    d.region =
        (bst_eval_region){(int)x - half_x, (int)y - half_y, 2 * half_x + 1, 2 * half_y + 1, NULL};
    d.region.work = malloc(2 * sizeof(double) * (size_t)(d.region.width + d.region.height));
    if (!d.region.work) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the bound of pairs");
    }
    const bst_pair_image image = {d.region.width * d.region.height, x, y, largest, draw, &d};
    const bst_eval_match_target place = {x, y, d.dx_px, d.dy_px};
    /* in units of the excess noise, in which the variance of the light is its mean */
    double excess = bst_camera_excess_noise(c);
    double flux = snr * s->noise_e / excess / sqrt(bst_pd_sharpness(s, &place));
    const bst_eval_bound_noise noise = {s->noise_e / excess, true};
    const bst_close_pair pair = {.flux_e = flux, .ratio = ratio};
    bst_status status =
        bst_pair_separations_at(ctx, &image, &pair, &noise, false_splits, ASKED_PD, out);
    free(d.region.work);
    return status;
}

/* Sets the separations of a point. */
static void set_separations(const bst_pd_scene *s, const bst_pd_pair_options *pairs,
                            bst_pd_pair_point *p) {
    bool by_bound = s->options.false_splits != 0.0 && isfinite(p->bound.unknown_px);
    double widest = BST_PD_WIDEST_PAIR_FWHM * s->fwhm_px;
    p->separations = pairs->separations > 0 ? pairs->separations : CHOSEN;
    for (int k = 0; k < p->separations; k++) {
        p->counts[k].separation_px = pairs->separations > 0 ? pairs->separation_px[k]
                                     : by_bound ? fmin(OVER_BOUND[k] * p->bound.unknown_px, widest)
                                                : OF_FWHM[k] * s->fwhm_px;
    }
}

/* Pairs in each frame. */
static int pairs_per_frame(const bst_pd_scene *s) {
    return (bst_pd_scene_room(s) + EACH - 1) / EACH;
}

static int64_t frames_of_point(const bst_pd_scene *s, const bst_pd_pair_point *p) {
    int64_t wanted = s->options.trials * p->separations, each = pairs_per_frame(s);
    return (wanted + each - 1) / each;
}

/* Sets the targets of frame n of a point: its separations in turn. */
static void set_targets(const bst_pd_scene *s, const bst_pd_pair_point *p, double ratio, int64_t n,
                        bst_pd_pair_target *targets) {
    int64_t next = n * pairs_per_frame(s), last = s->options.trials * p->separations;
    for (int i = 0; i < bst_pd_scene_room(s); i++) {
        bool is_pair = i % EACH == 0 && next < last;
        targets[i] = (bst_pd_pair_target){
            p->snr, ratio, is_pair ? p->counts[next % p->separations].separation_px : 0.0};
        next += is_pair;
    }
}

/* True if a detection lies on a target's light. */
static bool is_of(const bst_detection *d, const bst_eval_match_target *place, double reach_px) {
    double length = hypot(place->dx_px, place->dy_px), x = d->x_px - place->x_px,
           y = d->y_px - place->y_px;
    double c = length > 0.0 ? place->dx_px / length : 1.0,
           s = length > 0.0 ? place->dy_px / length : 0.0;
    double along = fmax(fabs(c * x + s * y) - 0.5 * length, 0.0), across = c * y - s * x;
    return hypot(along, across) < reach_px;
}

/* Counts a frame: separations follow one another as set_targets has set them. */
static void count_frame(const runner *r, const bst_pd_frame *f, const bst_pd_pair_target *targets,
                        bst_pd_pair_point *p, int64_t *next) {
    for (int i = 0; i < f->count; i++) {
        double reach = BST_PD_PAIR_REACH_FWHM * r->scene->fwhm_px + targets[i].separation_px;
        int near = 0;
        for (int k = 0; k < r->detections->count && near < 2; k++) {
            near += is_of(&r->detections->items[k], &f->places[i], reach);
        }
        if (targets[i].separation_px > 0.0) {
            bst_pd_pair_count *at = &p->counts[*next % p->separations];
            at->pairs++;
            at->found += near > 1;
            ++*next;
        } else {
            p->singles++;
            p->split += near > 1;
        }
    }
}

/* Renders and processes the frames of one SNR; each is requested before the previous one is
 * processed. */
static bst_status measure_point(bst_ctx *ctx, runner *r, double ratio, bst_pd_pair_point *p) {
    bst_pd_scene *s = r->scene;
    bst_frame *frames[2] = {NULL, NULL};
    bst_status status = BST_OK;
    int64_t count = frames_of_point(s, p), counted = 0;
    for (int64_t n = 0; n <= count && status == BST_OK; n++) {
        if (bst_stop_requested()) {
            status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
            break;
        }
        if (n < count) {
            int k = (int)(n % 2);
            set_targets(s, p, ratio, n, r->targets[k]);
            bst_pd_scene_set_pairs(s, r->frames++, r->targets[k], &s->frames[k]);
            status = bst_renderer_render(ctx, s->renderer, &s->frames[k].request, &frames[k]);
        }
        if (n > 0 && status == BST_OK) {
            int k = (int)((n - 1) % 2);
            status = bst_pd_detect(ctx, r->detector, s, frames[k], &s->frames[k], r->detections,
                                   r->capacity);
            if (status == BST_OK) {
                count_frame(r, &s->frames[k], r->targets[k], p, &counted);
            }
            bst_frame_release(frames[k]);
            frames[k] = NULL;
            bst_progress_update(r->progress, ++r->done);
        }
    }
    for (int i = 0; i < 2; i++) {
        bst_frame_release(frames[i]);
    }
    return status;
}

/* The separation at Pd 0.9: Q^-1 of the probability is D - Q^-1(false splits), and D is quadratic
 * in a small separation, as the probit regression of Pd over SNR is. */
static bst_pd_needed separation_of(const bst_pd_pair_point *p) {
    bst_pd_point points[BST_PD_PAIR_SEPARATIONS];
    for (int k = 0; k < p->separations; k++) {
        points[k] =
            (bst_pd_point){p->counts[k].separation_px, p->counts[k].pairs, p->counts[k].found};
    }
    return bst_pd_snr_at(points, p->separations, 0.0, ASKED_PD);
}

/* V magnitude of both sources as one, at the centre of the sensor. */
static double v_mag_of(const bst_pd_scene *s, double snr) {
    const bst_eval_match_target place = {bst_camera_centre_x(&s->camera),
                                         bst_camera_centre_y(&s->camera),
                                         0.8 * s->options.streak_px, 0.6 * s->options.streak_px};
    double flux = snr * s->noise_e / sqrt(bst_pd_sharpness(s, &place));
    return bst_camera_v_mag(&s->camera, flux / s->exposure_s);
}

/* Measures all curves of one kind of sources. */
static bst_status measure_curves(bst_ctx *ctx, runner *r, const bst_pd_pair_options *pairs,
                                 bst_pd_pair_result *out) {
    int first = out->count;
    int64_t frames = 0;
    for (int c = 0; c < pairs->ratios; c++) {
        bst_pd_pair_curve *curve = &out->curves[out->count++];
        *curve = (bst_pd_pair_curve){.ratio = pairs->ratio[c],
                                     .streak_px = r->scene->options.streak_px,
                                     .count = pairs->snrs};
        for (int i = 0; i < pairs->snrs; i++) {
            bst_pd_pair_point *p = &curve->points[i];
            p->snr = pairs->snr[i];
            p->v_mag = v_mag_of(r->scene, p->snr);
            BST_TRY(bst_pd_pair_bound(ctx, r->scene, p->snr, curve->ratio, out->bound_false_splits,
                                      &p->bound));
            set_separations(r->scene, pairs, p);
            frames += frames_of_point(r->scene, p);
        }
    }
    bst_progress progress;
    bst_progress_start(&progress, r->scene->options.streak_px > 0.0 ? "streaks" : "points",
                       "frames", frames);
    progress.off = r->scene->options.quiet;
    r->progress = &progress;
    bst_status status = BST_OK;
    for (int c = first; c < out->count && status == BST_OK; c++) {
        bst_pd_pair_curve *curve = &out->curves[c];
        for (int i = 0; i < curve->count && status == BST_OK; i++) {
            status = measure_point(ctx, r, curve->ratio, &curve->points[i]);
            curve->points[i].needed = separation_of(&curve->points[i]);
        }
    }
    bst_progress_end(&progress);
    out->frames += r->done;
    return status;
}

/* Measures with an open scene. */
static bst_status measure_kind(bst_ctx *ctx, bst_pd_scene *s, const bst_pd_pair_options *pairs,
                               bst_pd_pair_result *out) {
    int room = bst_pd_scene_room(s);
    runner r = {.scene = s, .capacity = 4 * room + 65536};
    BST_TRY(bst_pd_detector_open(ctx, s, &r.detector));
    bst_status status = BST_OK;
    r.detections =
        malloc(sizeof *r.detections + (size_t)r.capacity * sizeof r.detections->items[0]);
    for (int k = 0; k < 2; k++) {
        r.targets[k] = malloc((size_t)room * sizeof *r.targets[k]);
    }
    if (!r.detections || !r.targets[0] || !r.targets[1]) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d pairs", room);
    }
    snprintf(out->sensor, sizeof out->sensor, "%s", s->name);
    out->detector = s->imgproc->desc->type;
    out->width_px = s->camera.width_px;
    out->height_px = s->camera.height_px;
    out->fwhm_px = s->fwhm_px;
    out->noise_e = s->noise_e;
    out->exposure_s = s->exposure_s;
    out->false_splits = s->options.false_splits;
    out->bound_false_splits =
        s->options.false_splits > 0.0 ? s->options.false_splits : USUAL_FALSE_SPLITS;
    if (status == BST_OK) {
        status = measure_curves(ctx, &r, pairs, out);
    }
    for (int k = 0; k < 2; k++) {
        free(r.targets[k]);
    }
    free(r.detections);
    bst_pd_detector_close(r.detector);
    return status;
}

bst_status bst_pd_pair_run(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_pd_options *options, const bst_pd_pair_options *pairs,
                           bst_pd_pair_result *out) {
    bst_pd_scene *scene = calloc(1, sizeof *scene);
    if (!scene) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the measurement");
    }
    *out = (bst_pd_pair_result){.scenario = scenario->name};
    double started = bst_wall_seconds();
    bst_pd_options o = *options;
    o.pairs = true;
    o.low = o.high = o.step = 10.0; /* one SNR: those of pairs are set one by one */
    o.widest_pair_px = 0.0;
    for (int k = 0; k < pairs->separations; k++) {
        o.widest_pair_px = fmax(o.widest_pair_px, pairs->separation_px[k]);
    }
    bst_status status = BST_OK;
    for (int kind = 0; kind < (options->streak_px > 0.0 ? 2 : 1) && status == BST_OK; kind++) {
        o.streak_px = kind ? options->streak_px : 0.0;
        o.known_rate = kind;
        status = bst_pd_scene_open(ctx, scenario, &o, scene);
        if (status == BST_OK) {
            status = measure_kind(ctx, scene, pairs, out);
            bst_pd_scene_close(scene);
        }
    }
    out->wall_s = bst_wall_seconds() - started;
    free(scene);
    return status;
}
