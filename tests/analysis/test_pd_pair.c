/* What a measurement of pairs asks of the bound, which separations it takes, and what it counts of
 * detections that are made up here. Linked with wraps of scene, renderer, detector and bound. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/analysis/pd/pd_pair.h"
#include "tests/test_support.h"

enum { COLUMNS = 4, ROWS = 3, ROOM = COLUMNS * ROWS, PAIRS = 3 /* each fifth of 12 */ };
static const double FWHM = 2.2, SIGMA = 0.95, NOISE_E = 9.0, EM_GAIN = 4.0, EXPOSURE_S = 0.4;

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

/* Shared with the wraps. */
static struct {
    int bounds, opened, rendered, detected, frames; /* frames: of all scenes */
    bst_pd_options options[2];
    double bound_px;                             /* unknown parameters; NAN: none */
    bst_pd_pair_target asked[2][ROOM];           /* of the last two frames */
    int64_t pairs[BST_PD_PAIR_SEPARATIONS];      /* of all frames, by separation */
    int64_t found[BST_PD_PAIR_SEPARATIONS];      /* expected */
    int64_t singles, split;                      /* expected */
    double separations[BST_PD_PAIR_SEPARATIONS]; /* of the present point, in their order */
    int count;                                   /* of separations */
} now;

static double streak_px;

/* Shares of a Gaussian's light in pixels, as sums over points of its path. */
static double share(double x, double y, double dx, double dy) {
    double sum = 0.0;
    int n = dx != 0.0 || dy != 0.0 ? 60 : 1;
    for (int k = 0; k < n; k++) {
        double t = (k + 0.5) / n - 0.5, u = x - t * dx, v = y - t * dy, s = SIGMA * sqrt(2.0);
        sum += 0.25 * (erf((u + 0.5) / s) - erf((u - 0.5) / s)) *
               (erf((v + 0.5) / s) - erf((v - 0.5) / s)) / n;
    }
    return sum;
}

/* The same for the same streak is not computed again. */
static double squares(double dx, double dy) {
    static double of[2] = {-1.0, -1.0}, sum;
    if (dx == of[0] && dy == of[1]) {
        return sum;
    }
    of[0] = dx;
    of[1] = dy;
    sum = 0.0;
    for (int j = -16; j <= 16; j++) {
        for (int i = -16; i <= 16; i++) {
            sum += pow(share(i, j, dx, dy), 2.0);
        }
    }
    return sum;
}

WRAP(bst_status, bst_pair_separations_at,
     (bst_ctx * ctx, const bst_pair_image *image, const bst_close_pair *pair,
      const bst_eval_bound_noise *noise, double rate, double pd, bst_pair_separations *out)) {
    (void)ctx;
    double excess = 2.0 - 1.0 / EM_GAIN, snr = now.bounds < 2 ? 30.0 + 40.0 * now.bounds : 30.0;
    double dx = 0.8 * streak_px, dy = 0.6 * streak_px, loose = streak_px > 0.0 ? 2e-3 : 1e-9;
    /* counts over the excess noise have the variance of their mean */
    bst_assert_close(noise->noise_e * excess, NOISE_E, 1e-12);
    assert_true(noise->own_shot_noise);
    double flux = snr * NOISE_E / excess / sqrt(squares(dx, dy));
    bst_assert_close(pair->flux_e, flux, loose * flux);
    bst_assert_close(pair->ratio, 3.0, 0.0);
    bst_assert_close(rate, 0.02, 0.0);
    bst_assert_close(pd, 0.9, 0.0);
    bst_assert_close(image->x_px, 159.0, 0.0); /* beside the middle of 320 x 200 px */
    bst_assert_close(image->y_px, 99.0, 0.0);
    bst_assert_close(image->largest_apart_px, 4.0 * FWHM, 1e-12);
    /* the region holds both sources, and four widths more */
    double *shares = malloc((size_t)image->count * sizeof *shares), sum = 0.0, most = 0.0;
    image->draw(image->user, image->x_px, image->y_px, shares);
    for (int i = 0; i < image->count; i++) {
        sum += shares[i];
        most = fmax(most, shares[i]);
    }
    bst_assert_close(sum, 1.0, 1e-9);
    bst_assert_close(most, share(0, 0, dx, dy), loose * most);
    double half = ceil(8.0 * FWHM + 0.5 * dx), high = ceil(8.0 * FWHM + 0.5 * dy);
    assert_int_equal(image->count, (int)((2.0 * half + 1.0) * (2.0 * high + 1.0)));
    free(shares);
    now.bounds++;
    *out = (bst_pair_separations){0.8 * now.bound_px, now.bound_px};
    return BST_OK;
}

static bst_eval_match_target places[2][ROOM];
static bst_pd_target targets[2][ROOM];

WRAP(bst_status, bst_pd_scene_open,
     (bst_ctx * ctx, const bst_scenario *scenario, const bst_pd_options *options,
      bst_pd_scene *out)) {
    (void)ctx;
    now.options[now.opened++] = *options;
    streak_px = options->streak_px;
    now.bounds = now.rendered = now.detected = 0;
    *out = (bst_pd_scene){.options = *options,
                          .scenario = scenario,
                          .columns = COLUMNS,
                          .rows = ROWS,
                          .name = "a/b",
                          .fwhm_px = FWHM,
                          .sigma_px = SIGMA,
                          .noise_e = NOISE_E,
                          .exposure_s = EXPOSURE_S};
    static bst_module_desc desc = {.type = "mine"};
    static bst_scenario_module_config imgproc = {.desc = &desc};
    out->imgproc = &imgproc;
    out->camera.width_px = 320;
    out->camera.height_px = 200;
    out->camera.photon_flux_v0_per_s_m2 = 1e10;
    out->camera.aperture_m = 0.1;
    out->camera.throughput = 0.5;
    out->camera.quantum_efficiency = 1.0;
    out->camera.detector.em_gain = EM_GAIN;
    /* a table of streaks that is as it would be at all angles */
    static double sharpness[46];
    for (int i = 0; i < 46; i++) {
        sharpness[i] = streak_px > 0.0 ? squares(0.8 * streak_px, 0.6 * streak_px) : 0.0;
    }
    out->sharpness = streak_px > 0.0 ? sharpness : NULL;
    for (int i = 0; i < 2; i++) {
        out->frames[i].places = places[i];
        out->frames[i].targets = targets[i];
    }
    return BST_OK;
}

WRAP(void, bst_pd_scene_close, (bst_pd_scene * scene)) {
    (void)scene;
}

WRAP(bst_status, bst_pd_detector_open,
     (bst_ctx * ctx, bst_pd_scene *scene, bst_pd_detector **out)) {
    (void)ctx;
    *out = NULL;
    (void)scene;
    return BST_OK;
}

WRAP(void, bst_pd_detector_close, (bst_pd_detector * detector)) {
    (void)detector;
}

static void ignore(void *owner) {
    (void)owner;
}

static const bst_frame_ops ops = {.recycle = ignore};
static bst_frame frames[2];

WRAP(void, bst_pd_scene_set_pairs,
     (bst_pd_scene * scene, int64_t number, const bst_pd_pair_target *asked, bst_pd_frame *f)) {
    (void)scene;
    assert_int_equal(number, now.rendered);
    f->count = ROOM;
    for (int i = 0; i < ROOM; i++) {
        double turn = 0.7 * i + 0.3 * (double)number;
        now.asked[number % 2][i] = asked[i];
        f->places[i] =
            (bst_eval_match_target){40.25 + 80.0 * (i % COLUMNS), 30.5 + 60.0 * (i / COLUMNS),
                                    streak_px * cos(turn), streak_px * sin(turn)};
    }
}

WRAP(bst_status, bst_renderer_render,
     (bst_ctx * ctx, bst_renderer *renderer, const bst_render_request *request, bst_frame **out)) {
    (void)ctx;
    (void)renderer;
    (void)request;
    *out = &frames[now.rendered++ % 2];
    **out = (bst_frame){.ops = &ops, .references = 1};
    return BST_OK;
}

/* Adds a detection at a distance from the place, beyond the streak's end or beside its middle. */
static void add(bst_detections *out, const bst_eval_match_target *p, double distance, bool beside) {
    double turn = atan2(p->dy_px, p->dx_px), c = cos(turn), s = sin(turn);
    double along = beside ? 0.3 * streak_px : -(0.5 * streak_px + distance);
    double across = beside ? distance : 0.0;
    out->items[out->count++] = (bst_detection){.x_px = p->x_px + c * along - s * across,
                                               .y_px = p->y_px + s * along + c * across};
}

/* Two of three pairs are found, and a quarter of the single sources is split: a second detection
 * lies just within reach or just beyond it. */
WRAP(bst_status, bst_pd_detect,
     (bst_ctx * ctx, bst_pd_detector *detector, const bst_pd_scene *scene, bst_frame *frame,
      const bst_pd_frame *f, bst_detections *out, int capacity)) {
    (void)ctx;
    (void)detector;
    (void)scene;
    int k = now.detected++ % 2, pairs = 0;
    now.frames++;
    assert_true(frame == &frames[k] && capacity > 3 * ROOM);
    *out = (bst_detections){.count = 0};
    for (int i = 0; i < ROOM; i++) {
        const bst_pd_pair_target *t = &now.asked[k][i];
        double reach = 2.5 * FWHM + t->separation_px;
        bool beside = (i + now.detected) % 2, within = (i + now.detected) % 3 > 0;
        assert_true(t->separation_px == 0.0 || i % 5 == 0);
        bst_assert_close(t->ratio, 3.0, 0.0);
        add(out, &f->places[i], 0.0, false);
        add(out, &f->places[i], within ? 0.98 * reach : 1.02 * reach, beside);
        if (t->separation_px > 0.0) {
            int at = 0;
            while (at < now.count && fabs(t->separation_px - now.separations[at]) > 1e-9) {
                at++;
            }
            assert_in_range(at, 0, now.count - 1);
            now.pairs[at]++;
            now.found[at] += within;
            pairs++;
        } else {
            now.singles++;
            now.split += within;
        }
    }
    assert_in_range(pairs, 1, PAIRS);
    return BST_OK;
}

/* Measures one ratio at SNRs of 30 and 70; checks all counts of the first curves. */
static bst_pd_pair_result *measure(const bst_pd_options *options, const bst_pd_pair_options *pairs,
                                   const double *separations, int count) {
    bst_ctx ctx = {0};
    bst_pd_pair_result *r = calloc(1, sizeof *r);
    bst_scenario *scenario = calloc(1, sizeof *scenario);
    now.opened = now.frames = 0;
    memset(now.pairs, 0, sizeof now.pairs);
    memset(now.found, 0, sizeof now.found);
    now.singles = now.split = 0;
    now.count = count;
    memcpy(now.separations, separations, (size_t)count * sizeof *separations);
    bst_assert_ok(&ctx, bst_pd_pair_run(&ctx, scenario, options, pairs, r));
    int64_t singles = 0, split = 0;
    for (int k = 0; k < count; k++) {
        int64_t of_pairs = 0, found = 0;
        for (int c = 0; c < r->count; c++) {
            for (int i = 0; i < r->curves[c].count; i++) {
                const bst_pd_pair_point *p = &r->curves[c].points[i];
                assert_int_equal(p->separations, count);
                assert_int_equal(p->counts[k].pairs, options->trials);
                bst_assert_close(p->counts[k].separation_px, separations[k], 1e-9);
                of_pairs += p->counts[k].pairs;
                found += p->counts[k].found;
                singles += k == 0 ? p->singles : 0;
                split += k == 0 ? p->split : 0;
            }
        }
        assert_int_equal(of_pairs, now.pairs[k]);
        assert_int_equal(found, now.found[k]);
    }
    assert_int_equal(singles, now.singles);
    assert_int_equal(split, now.split);
    assert_int_equal(r->frames, now.frames);
    free(scenario);
    return r;
}

static void separations_that_are_given(void **state) {
    (void)state;
    const bst_pd_options options = {
        .trials = 7, .false_splits = 0.02, .quiet = true, .streak_px = 9.0};
    const bst_pd_pair_options pairs = {.snr = {30, 70},
                                       .snrs = 2,
                                       .ratio = {3},
                                       .ratios = 1,
                                       .separation_px = {0.9, 1.6, 2.5},
                                       .separations = 3};
    now.bound_px = 1.5;
    bst_pd_pair_result *r = measure(&options, &pairs, pairs.separation_px, 3);
    assert_int_equal(r->count, 2);
    assert_int_equal(now.opened, 2);
    for (int kind = 0; kind < 2; kind++) {
        const bst_pd_options *o = &now.options[kind];
        assert_true(o->pairs && o->known_rate == (kind == 1));
        bst_assert_close(o->streak_px, 9.0 * kind, 0.0);
        bst_assert_close(o->widest_pair_px, 2.5, 0.0);
        bst_assert_close(r->curves[kind].streak_px, 9.0 * kind, 0.0);
        bst_assert_close(r->curves[kind].ratio, 3.0, 0.0);
        for (int i = 0; i < 2; i++) {
            const bst_pd_pair_point *p = &r->curves[kind].points[i];
            /* both sources as one */
            double dx = 7.2 * kind, dy = 5.4 * kind, x = kind ? 0.0 : 0.5;
            double square = 0.0;
            for (int k = 0; k < 33 * 33; k++) { /* the middle lies between pixels */
                square += pow(share(k % 33 - 16 - x, k / 33 - 16 - x, dx, dy), 2.0);
            }
            double flux = p->snr * NOISE_E / sqrt(square) / EXPOSURE_S;
            double of_v0 = 1e10 * 0.25 * BST_PI * 0.01 * 0.5;
            bst_assert_close(p->snr, i ? 70.0 : 30.0, 0.0);
            bst_assert_close(p->v_mag, -2.5 * log10(flux / of_v0), kind ? 2e-3 : 1e-6);
            bst_assert_close(p->bound.known_px, 1.2, 1e-12);
        }
    }
    assert_string_equal(r->sensor, "a/b");
    assert_string_equal(r->detector, "mine");
    bst_assert_close(r->false_splits, 0.02, 0.0);
    bst_assert_close(r->bound_false_splits, 0.02, 0.0);
    free(r);
}

/* About the bound, and not wider than four FWHM; without a bound about what a matched filter
 * separates. */
static void separations_that_are_chosen(void **state) {
    (void)state;
    static const double over[] = {0.75, 0.85, 0.92, 1.0, 1.08, 1.18, 1.3, 1.5, 1.75},
                        of_fwhm[] = {1.4, 1.6, 1.7, 1.8, 2.0, 2.2, 2.5, 3.0, 3.6};
    const bst_pd_options options = {.trials = 5, .false_splits = 0.02, .quiet = true};
    const bst_pd_pair_options pairs = {.snr = {30}, .snrs = 1, .ratio = {3}, .ratios = 1};
    double separations[9];
    for (int k = 0; k < 9; k++) {
        separations[k] = fmin(over[k] * 3.1, 4.0 * FWHM);
    }
    now.bound_px = 3.1;
    bst_pd_pair_result *r = measure(&options, &pairs, separations, 9);
    bst_assert_close(now.options[0].widest_pair_px, 0.0, 0.0);
    assert_int_equal(r->count, 1);
    free(r);
    for (int k = 0; k < 9; k++) {
        separations[k] = of_fwhm[k] * FWHM;
    }
    now.bound_px = (double)NAN;
    free(measure(&options, &pairs, separations, 9));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(separations_that_are_given),
                                       cmocka_unit_test(separations_that_are_chosen)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
