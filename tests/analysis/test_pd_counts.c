/* What a measurement of detection counts and sums, for detections that are made up here: errors
 * along and across streaks, their chi-square, phases within the pixel, bounds of stacks. Linked
 * with wraps of what renders and detects. */
#include "boresight/vec.h"
#include "sim/analysis/pd/pd.h"
#include "sim/core/symmetric.h"
#include "sim/eval/location_bound.h"
#include "tests/test_support.h"

enum { COLUMNS = 2, ROWS = 2, ROOM = COLUMNS * ROWS, POINTS = 2 };

/* Shared with the wraps. */
static struct {
    bool streaks;
    double excess; /* factor by which multiplication enlarges all variances */
    int rendered, detected;
    bst_pd_tally tallies[POINTS]; /* as expected */
} now;

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)owner;
    (void)ctx;
    *pixels = NULL;
    return BST_OK;
}

static void ignore(void *owner) {
    (void)owner;
}

static const bst_frame_ops ops = {.map = map, .unmap = ignore, .recycle = ignore};
static bst_frame frames[2];

bst_status __wrap_bst_renderer_render(bst_ctx *ctx, bst_renderer *renderer,
                                      const bst_render_request *request, bst_frame **out);
bst_status __wrap_bst_renderer_render(bst_ctx *ctx, bst_renderer *renderer,
                                      const bst_render_request *request, bst_frame **out) {
    (void)ctx;
    (void)renderer;
    (void)request;
    *out = &frames[now.rendered++ % 2];
    **out = (bst_frame){.ops = &ops, .references = 1};
    return BST_OK;
}

bst_status __wrap_bst_pd_scene_set(bst_ctx *ctx, bst_pd_scene *scene, int64_t number, bool targets,
                                   bst_pd_frame *f);
bst_status __wrap_bst_pd_scene_set(bst_ctx *ctx, bst_pd_scene *scene, int64_t number, bool targets,
                                   bst_pd_frame *f) {
    (void)ctx;
    (void)scene;
    (void)targets;
    f->count = ROOM;
    for (int i = 0; i < ROOM; i++) {
        int k = (int)number + i;
        f->targets[i] =
            (bst_pd_target){.point = i % POINTS, .flux_e = 500.0 * (i + 1), .noise_e = 8.0 + i};
        f->places[i] =
            (bst_eval_match_target){.x_px = 100.5 + 100 * (i % COLUMNS) + ((k * 3) % 10 + 0.5) / 10,
                                    .y_px = 80.5 + 70 * (i / COLUMNS) + ((k * 7) % 10 + 0.5) / 10,
                                    .dx_px = now.streaks ? 12.0 - i : 0.0,
                                    .dy_px = now.streaks ? 4.0 * i - 9.0 : 0.0};
    }
    return BST_OK;
}

/* Adds a match to the sums: angles instead of components, chi-square by a Cholesky factor. */
static void expect_match(const bst_eval_match_target *place, const bst_pd_target *target,
                         const bst_detection *d, bst_pd_tally *t) {
    double x = d->x_px - place->x_px, y = d->y_px - place->y_px;
    double turn = atan2(y, x) - atan2(place->dy_px, place->dx_px);
    const double off[2] = {x, y}, at[2] = {place->x_px, place->y_px},
                 error[2] = {hypot(x, y) * cos(turn), hypot(x, y) * sin(turn)};
    for (int a = 0; a < 2; a++) {
        t->error_sum[a] += error[a];
        t->error_square[a] += error[a] * error[a];
        int bin = (int)floor(10.0 * fmod(at[a] + 0.5, 1.0));
        t->phase_sum[a][bin] += off[a];
        t->phase_count[a][bin]++;
    }
    double flux = (d->flux_e - target->flux_e) / target->flux_e;
    t->flux_sum += flux;
    t->flux_square += flux * flux;
    double first = x / sqrt(d->cov_xx), slant = d->cov_xy / sqrt(d->cov_xx);
    double second = (y - slant * first) / sqrt(d->cov_yy - slant * slant);
    t->chi_square += first * first + second * second;
    t->matched++;
}

/* Share of a Gaussian's light in a pixel, and its derivatives by the place. */
static void share_of(double u, double v, double out[3]) {
    const double s = 0.9 * sqrt(2.0), density = 1.0 / (0.9 * sqrt(2.0 * BST_PI));
    double x = 0.5 * (erf((u + 0.5) / s) - erf((u - 0.5) / s)),
           y = 0.5 * (erf((v + 0.5) / s) - erf((v - 0.5) / s));
    out[0] = y * density * (exp(-pow((u - 0.5) / s, 2.0)) - exp(-pow((u + 0.5) / s, 2.0)));
    out[1] = x * density * (exp(-pow((v - 0.5) / s, 2.0)) - exp(-pow((v + 0.5) / s, 2.0)));
    out[2] = x * y;
}

/* Bound of x, y and flux of a point whose pixels have the variance noise^2 + excess light, with an
 * unknown level: the inverse of the information as a sum over pixels within 16 px. */
static void direct_bound(const bst_eval_match_target *place, const bst_pd_target *target,
                         double covariance[16]) {
    enum { HALF = 17 };
    double information[16] = {0};
    for (int k = 0; k < (2 * HALF + 1) * (2 * HALF + 1); k++) {
        double row[4] = {0, 0, 0, 1.0};
        double u = round(place->x_px) + k % (2 * HALF + 1) - HALF - place->x_px,
               v = round(place->y_px) + k / (2 * HALF + 1) - HALF - place->y_px;
        if (fabs(u) > 16.0 || fabs(v) > 16.0) {
            continue;
        }
        share_of(u, v, row);
        double variance = target->noise_e * target->noise_e + now.excess * target->flux_e * row[2];
        row[0] *= target->flux_e;
        row[1] *= target->flux_e;
        for (int i = 0; i < 16; i++) {
            information[i] += row[i / 4] * row[i % 4] / variance;
        }
    }
    assert_true(bst_symmetric_invert(4, information, covariance));
}

/* Adds the bounds of a target: the mean of n fluxes, and the end of the straight line through n
 * positions in equal steps, by the theory of regression. */
static void expect_bound(const bst_eval_match_target *place, const bst_pd_target *target,
                         int stacked, bst_pd_tally *t) {
    bst_ctx ctx = {0};
    bst_location_bound bound;
    const bst_eval_bound_source source = {place->x_px,  place->y_px, place->dx_px,
                                          place->dy_px, 0.9,         target->flux_e};
    const bst_eval_bound_noise noise = {target->noise_e, true};
    bst_assert_ok(&ctx, bst_location_bound_gaussian(&ctx, &source, &noise, 16.0, &bound));
    double direct[16];
    if (!now.streaks) {
        direct_bound(place, target, direct);
        for (int i = 0; i < 16; i++) {
            bst_assert_close(now.excess > 1.0 ? 0.0 : bound.covariance[i / 4][i % 4],
                             now.excess > 1.0 ? 0.0 : direct[i],
                             1e-6 * sqrt(direct[i / 4 * 5] * direct[i % 4 * 5]));
            bound.covariance[i / 4][i % 4] = direct[i];
        }
    }
    double middle = 0.5 * (stacked - 1), squares = 0.0;
    for (int k = 0; k < stacked; k++) {
        squares += (k - middle) * (k - middle);
    }
    double end = 1.0 / stacked + (stacked > 1 ? middle * middle / squares : 0.0);
    double turn = atan2(place->dy_px, place->dx_px), c = cos(turn), s = sin(turn),
           xx = bound.covariance[0][0], xy = bound.covariance[0][1], yy = bound.covariance[1][1];
    t->bound_square[0] += end * (c * c * xx + 2 * c * s * xy + s * s * yy);
    t->bound_square[1] += end * (s * s * xx - 2 * c * s * xy + c * c * yy);
    t->flux_bound_square += bound.covariance[2][2] / stacked / (target->flux_e * target->flux_e);
    t->bounds++;
    t->trials++;
}

bst_status __wrap_bst_pd_detect(bst_ctx *ctx, bst_pd_detector *detector, const bst_pd_scene *scene,
                                bst_frame *frame, const bst_pd_frame *f, bst_detections *out,
                                int capacity);
bst_status __wrap_bst_pd_detect(bst_ctx *ctx, bst_pd_detector *detector, const bst_pd_scene *scene,
                                bst_frame *frame, const bst_pd_frame *f, bst_detections *out,
                                int capacity) {
    (void)ctx;
    (void)detector;
    assert_true(frame == &frames[now.detected % 2] && capacity > 10);
    int stacked = bst_pd_scene_stacked(scene);
    int64_t empty = now.detected++ - scene->options.empty_frames;
    bool answers = now.detected % stacked == 0;
    *out = (bst_detections){.threshold_snr = 4.5, .lost = 3};
    /* one where no target is, one on a target: in empty frames a chance match */
    out->items[out->count++] = (bst_detection){.x_px = 10, .y_px = 12, .cov_xx = 1, .cov_yy = 1};
    if (empty < 0) {
        out->items[out->count++] = (bst_detection){.x_px = f->places[1].x_px + 0.5,
                                                   .y_px = f->places[1].y_px - 0.5,
                                                   .cov_xx = 1,
                                                   .cov_yy = 1};
        return BST_OK;
    }
    for (int i = 0; i < ROOM; i++) {
        const bst_eval_match_target *place = &f->places[i];
        const bst_pd_target *target = &f->targets[i];
        bst_pd_tally *t = &now.tallies[target->point];
        if (answers) {
            expect_bound(place, target, stacked, t);
        }
        if (i == 2) { /* missed */
            continue;
        }
        bst_detection d = {.x_px = place->x_px + 0.3 - 0.2 * i,
                           .y_px = place->y_px + 0.15 + 0.1 * (i + (int)empty % 3),
                           .cov_xx = 0.09 + 0.01 * i,
                           .cov_xy = 0.04 - 0.03 * i,
                           .cov_yy = 0.05 + 0.02 * i,
                           .flux_e = target->flux_e * (1.1 - 0.15 * i)};
        out->items[out->count++] = d;
        if (answers) {
            expect_match(place, target, &d, t);
        }
        if (i == 3) { /* a second one, farther off */
            d.x_px -= 0.8;
            out->items[out->count++] = d;
        }
    }
    return BST_OK;
}

static void measure(int stack, bool streaks, int64_t empty_frames, double em_gain) {
    bst_ctx ctx = {0};
    static bst_eval_match_target places[2][ROOM];
    static bst_pd_target targets[2][ROOM];
    double sharpness = 0.0;
    memset(&now, 0, sizeof now);
    now.streaks = streaks;
    now.excess = em_gain > 1.0 ? 2.0 - 1.0 / em_gain : 1.0; /* Robbins and Hadwen 2003 */
    bst_pd_scene *s = test_calloc(1, sizeof *s);
    bst_pd_result *r = test_calloc(1, sizeof *r);
    *s = (bst_pd_scene){.options = {.trials = 7, .empty_frames = empty_frames, .stack = stack},
                        .points = POINTS,
                        .columns = COLUMNS,
                        .rows = ROWS,
                        .fwhm_px = 2.2,
                        .sigma_px = 0.9,
                        .sharpness = streaks ? &sharpness : NULL};
    s->camera.width_px = 320;
    s->camera.height_px = 200;
    s->camera.detector.em_gain = em_gain;
    s->options.quiet = true;
    for (int i = 0; i < 2; i++) {
        s->frames[i].places = places[i];
        s->frames[i].targets = targets[i];
    }
    bst_assert_ok(&ctx, bst_pd_run(&ctx, s, NULL, r));
    /* 7 trials of 2 points: 4 answers */
    int64_t frames_of = stack > 0 ? stack : 1, answers = 4, empty = empty_frames / frames_of;
    assert_int_equal(r->frames, answers * frames_of);
    assert_int_equal(r->empty_frames, empty_frames);
    assert_int_equal(now.rendered, r->frames + r->empty_frames);
    assert_int_equal(r->unmatched, answers);
    assert_int_equal(r->second, answers);
    assert_int_equal(r->chance_hits, empty);
    assert_int_equal(r->chance_trials, empty * ROOM);
    assert_int_equal(r->false_alarms, 2 * empty);
    assert_int_equal(r->stars, 0);
    assert_int_equal(r->lost, 3 * (answers + empty));
    bst_assert_close(r->pixels, 64000.0, 0);
    bst_assert_close(r->threshold_snr, 4.5, 0);
    for (int p = 0; p < POINTS; p++) {
        const bst_pd_tally *t = &r->tallies[p], *e = &now.tallies[p];
        assert_int_equal(t->trials, e->trials);
        assert_int_equal(t->matched, e->matched);
        assert_int_equal(t->bounds, e->bounds);
        /* rounding */
        bst_assert_close(t->flux_sum, e->flux_sum, 1e-12);
        bst_assert_close(t->flux_square, e->flux_square, 1e-12);
        /* direct sums end elsewhere than those of the bound */
        double loose = streaks ? 1e-12 : 1e-6;
        bst_assert_close(t->flux_bound_square, e->flux_bound_square,
                         loose * fmax(1.0, e->flux_bound_square));
        bst_assert_close(t->chi_square, e->chi_square, 1e-10);
        for (int a = 0; a < 2; a++) {
            bst_assert_close(t->error_sum[a], e->error_sum[a], 1e-12);
            bst_assert_close(t->error_square[a], e->error_square[a], 1e-12);
            bst_assert_close(t->bound_square[a], e->bound_square[a],
                             loose * fmax(1.0, e->bound_square[a]));
            for (int k = 0; k < BST_PD_PHASES; k++) {
                bst_assert_close(t->phase_sum[a][k], e->phase_sum[a][k], 1e-12);
                assert_int_equal(t->phase_count[a][k], e->phase_count[a][k]);
            }
        }
    }
    test_free(s);
    test_free(r);
}

static void points_in_single_frames(void **state) {
    (void)state;
    measure(0, false, 6, 1.0);
}

static void streaks_in_single_frames(void **state) {
    (void)state;
    measure(0, true, 5, 1.0);
}

static void points_in_stacks(void **state) {
    (void)state;
    measure(5, false, 10, 1.0);
}

static void points_of_multiplied_charge(void **state) {
    (void)state;
    measure(0, false, 6, 3.0);
    measure(3, false, 6, 40.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_in_single_frames),
        cmocka_unit_test(streaks_in_single_frames),
        cmocka_unit_test(points_in_stacks),
        cmocka_unit_test(points_of_multiplied_charge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
