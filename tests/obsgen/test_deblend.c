/* Pairs of sources: what image processing separates on rendered pixels, and where it places what it
 * does not, against the generator without any calibration. */
#include <stdio.h>
#include <stdlib.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "obsgen/generator.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 512, PITCH = 32, ACROSS = 15, PAIRS = ACROSS * ACROSS, FRAMES = 3 };

/* A kind of pair, and a third source beyond the fainter one where third > 0. */
typedef struct kind {
    double flux_e, ratio, distance, third;
    double streak; /* length of both, px; 0: points, whose pairs lie in any direction */
    double turn;   /* direction of a pair of streaks relative to their path, rad */
    double false_splits;
} kind;

/* Direction of streaks, rad. */
static const double COURSE = 0.6;

typedef struct outcome {
    double separated;  /* share of the pairs */
    double shift;      /* of what is seen as one, from the brighter towards the fainter, mean, px */
    double detections; /* per pair */
    double log_variance; /* of stated positions in separated pairs: sum of logarithms, and number */
    double places;
} outcome;

typedef struct pair {
    double x, y, cosine, sine;
} pair;

static pair pair_of(const kind *k, bst_rng_key key, uint64_t frame, int i) {
    uint64_t draw = 8 * (frame * PAIRS + (uint64_t)i);
    double angle =
        k->streak > 0.0 ? COURSE + k->turn : 2.0 * BST_PI * bst_rng_uniform(key, 1, draw);
    return (pair){PITCH * (i % ACROSS + 0.8) + bst_rng_uniform(key, 1, draw + 1),
                  PITCH * (i / ACROSS + 0.8) + bst_rng_uniform(key, 1, draw + 2), cos(angle),
                  sin(angle)};
}

/* One streak in nine is alone and brighter: images measure the stars' motion on these. One point in
 * six is, 38 of them: images measure the width of the PSF on the 32 brightest. */
static bool is_alone(const kind *k, int i) {
    if (k->false_splits > 0.0) { /* the width comes from all sources: pairs are few */
        return i % 5 != 0;
    }
    return i % (k->streak > 0.0 ? 9 : 6) == 0;
}

/* Those of streaks deviate little from frame to frame. */
static int frames_of(const kind *k) {
    if (k->false_splits > 0.0) {
        return 6;
    }
    return k->streak > 0.0 ? 1 : FRAMES;
}

/* Counts what lies about each pair. */
static void count(outcome *o, const bst_detections *d, bst_rng_key key, uint64_t frame,
                  const kind *k) {
    const double frames = frames_of(k);
    double joined = 0.0, shift = 0.0, pairs = 0.0;
    for (int i = 0; i < PAIRS; i++) {
        pairs += !is_alone(k, i);
    }
    for (int i = 0; i < PAIRS; i++) {
        if (is_alone(k, i)) {
            continue;
        }
        pair p = pair_of(k, key, frame, i);
        int near = 0, at = -1;
        double logs = 0.0;
        for (int n = 0; n < d->count; n++) {
            if (hypot(d->items[n].x_px - p.x, d->items[n].y_px - p.y) < 0.4 * PITCH) {
                near++;
                at = n;
                logs += log(d->items[n].cov_xx + d->items[n].cov_yy);
            }
        }
        o->detections += (double)near / (pairs * frames);
        o->log_variance += near > 1 ? logs : 0.0;
        o->places += near > 1 ? near : 0.0;
        o->separated += near > 1 ? 1.0 / (pairs * frames) : 0.0;
        if (near == 1) {
            joined += 1.0;
            double moved =
                (d->items[at].x_px - p.x) * p.cosine + (d->items[at].y_px - p.y) * p.sine;
            /* two alike are seen from either: of equals count from the nearer one */
            shift += fmin(moved, k->ratio > 0.95 ? k->distance - moved : moved);
        }
    }
    o->shift += joined > 0.0 ? shift / joined / frames : 0.0;
}

static void add_sources(const kind *k, const pair *p, int i, synthetic *s, bst_truth *t) {
    const double at[3] = {0.0, k->distance, 2.0 * k->distance};
    const bool alone = is_alone(k, i);
    const double light[3] = {alone ? 2.0 * k->flux_e : k->flux_e, k->flux_e * k->ratio,
                             k->flux_e * k->third};
    /* by the brightest pixel of a FWHM of 2 px, a fifth of the light */
    const uint32_t saturated = 0.2 * k->flux_e > s->camera.full_well_e ? BST_TRUTH_SATURATED : 0;
    for (int n = 0; n < (alone ? 1 : k->third > 0.0 ? 3 : 2); n++) {
        double x = p->x + at[n] * p->cosine, y = p->y + at[n] * p->sine;
        double dx = k->streak * cos(COURSE), dy = k->streak * sin(COURSE);
        synthetic_add(s, x, y, light[n], dx, dy);
        t->items[t->count++] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                                .id = (uint32_t)(4 * i + n + 1),
                                                .flags = saturated | BST_TRUTH_IN_FIELD,
                                                .x_start_px = x - 0.5 * dx,
                                                .x_mid_px = x,
                                                .x_end_px = x + 0.5 * dx,
                                                .x_centroid_px = x,
                                                .y_start_px = y - 0.5 * dy,
                                                .y_mid_px = y,
                                                .y_end_px = y + 0.5 * dy,
                                                .y_centroid_px = y,
                                                .electrons = light[n]};
    }
}

/* The same pairs by both. */
static void compare(const kind *k, uint64_t number, outcome *image, outcome *generated) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.false_splits = k->false_splits;
    bst_rng_key key = bst_rng_make_key(number, 0, "test", "deblend");
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    bst_truth *t = calloc(1, sizeof *t + 3 * PAIRS * sizeof t->items[0]);
    assert_non_null(t);
    const bst_generator_settings settings = {.capacity = 2048,
                                             .false_alarms_per_frame = 1.0,
                                             .false_splits = k->false_splits,
                                             .streak_min_px = 1.5,
                                             .streak_max_px = 64.0};
    bst_obsgen_calibration theory;
    bst_obsgen_calibration_theory(&theory);
    bst_generator *g;
    bst_assert_ok(&ctx,
                  bst_generator_create(&ctx, &s.camera, &s.camera, &settings, &theory, key, &g));
    const bst_generator_frame f = {.truth = t,
                                   .window = {0, 0, SIDE, SIDE},
                                   .binning = 1,
                                   .exposure_s = 0.5,
                                   .sigma_px = bst_camera_psf_sigma_px(&s.camera),
                                   .streak_dx_px = k->streak * cos(COURSE),
                                   .streak_dy_px = k->streak * sin(COURSE)};
    bst_camera_motion motion = synthetic_motion(&s, f.streak_dx_px, f.streak_dy_px);
    *image = *generated = (outcome){0};
    for (uint64_t frame = 0; frame < (uint64_t)frames_of(k); frame++) {
        synthetic_clear(&s);
        t->count = 0;
        t->exposure_id = (int64_t)frame;
        t->background_e = s.sky_e;
        for (int i = 0; i < PAIRS; i++) {
            pair p = pair_of(k, key, frame, i);
            add_sources(k, &p, i, &s, t);
        }
        synthetic_expose(&s, key, frame);
        bst_imgproc_frame pixels = synthetic_frame(&s);
        bst_assert_ok(
            &ctx, bst_imgproc_detect(&ctx, ip, &pixels, k->streak > 0.0 ? &motion : NULL, d, 2048));
        count(image, d, key, frame, k);
        bst_generator_result r;
        bst_assert_ok(&ctx, bst_generator_run(&ctx, g, &f, &r));
        d->count = r.count;
        for (int i = 0; i < r.count; i++) {
            d->items[i] = r.items[i].detection;
        }
        count(generated, d, key, frame, k);
    }
    free(t);
    free(d);
    bst_generator_free(g);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

/* From pairs that are hardly ever separated to some that nearly always are; SNR 200, 60, 12. */
static void pairs_are_separated_as_in_images(void **state) {
    (void)state;
    const kind kinds[] = {{8000, 0.9, 3.2, 0, 0, 0, 0}, {8000, 0.9, 3.5, 0, 0, 0, 0},
                          {8000, 0.5, 3.8, 0, 0, 0, 0}, {8000, 0.25, 4.4, 0, 0, 0, 0},
                          {2000, 0.7, 3.4, 0, 0, 0, 0}, {2000, 0.7, 3.8, 0, 0, 0, 0},
                          {400, 0.8, 3.8, 0, 0, 0, 0},  {400, 0.8, 4.6, 0, 0, 0, 0}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        outcome image, generated;
        compare(&kinds[i], 10 + i, &image, &generated);
        printf("flux %g ratio %g at %g px: separated %.3f, generator %.3f\n", kinds[i].flux_e,
               kinds[i].ratio, kinds[i].distance, image.separated, generated.separated);
        double p = 0.5 * (image.separated + generated.separated);
        /* 3.5 sigma of two counts, and 0.08: the slope is 1 per 0.4 px, and places of a filter's
         * top between pixels are good to 0.03 px */
        bst_assert_close(generated.separated, image.separated,
                         0.08 + 3.5 * sqrt(2.0 * p * (1.0 - p) / (PAIRS * FRAMES)));
    }
}

/* Closer pairs, found by their likelihood ratio: points of SNR 200, 50 and 20 and streaks. */
static void pairs_are_split_as_in_images(void **state) {
    (void)state;
    const kind kinds[] = {{3100, 0.9, 0.55, 0, 0, 0, 0},  {3100, 0.9, 0.65, 0, 0, 0, 0},
                          {4800, 0.25, 0.75, 0, 0, 0, 0}, {780, 0.9, 0.95, 0, 0, 0, 0},
                          {1200, 0.25, 1.25, 0, 0, 0, 0}, {310, 0.9, 1.4, 0, 0, 0, 0},
                          {310, 0.9, 2.8, 0, 0, 0, 0},    {3100, 0.9, 1.2, 0, 12, 0.0, 0},
                          {3100, 0.9, 0.9, 0, 12, 1.5, 0}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        outcome image, generated;
        kind k = kinds[i];
        k.false_splits = 0.01;
        compare(&k, 90 + i, &image, &generated);
        double wider =
            exp(generated.log_variance / generated.places - image.log_variance / image.places);
        printf(
            "flux %g ratio %g at %g px, streak %g: split %.3f, generator %.3f, its variance %.2f "
            "of theirs\n",
            k.flux_e, k.ratio, k.distance, k.streak, image.separated, generated.separated, wider);
        /* one factor for both axes; of pairs that are rarely split, images find those that noise
         * puts farther apart, whose errors are smaller */
        assert_true(wider > 0.6 && wider < (image.separated < 0.5 ? 2.5 : 1.7));
        /* 3.5 sigma of two counts of 270 pairs, and 0.1: the slope is 1 per 0.25 of the separation
         * of points, and the test is that of three parameters to 4 % of it */
        double p = 0.5 * (image.separated + generated.separated);
        bst_assert_close(generated.separated, image.separated,
                         0.1 + 3.5 * sqrt(2.0 * p * (1.0 - p) / 270.0));
    }
}

/* What is seen as one: fits of a point at small distances, of a streak where the pair is long. The
 * last seven but two are near the limit of a streak, where noise and the free width of the fit
 * decide. The last two are saturated: their light is where the saturated pixels end, and the
 * fainter star has a greater share of it there than at the centroid. */
static void joined_pairs_are_placed_as_in_images(void **state) {
    (void)state;
    const kind kinds[] = {
        {8000, 0.3, 1.6, 0, 0, 0, 0},  {8000, 0.3, 2.4, 0, 0, 0, 0},  {8000, 0.2, 3.0, 0, 0, 0, 0},
        {8000, 0.8, 2.4, 0, 0, 0, 0},  {8000, 0.8, 3.0, 0, 0, 0, 0},  {2000, 0.25, 2.4, 0, 0, 0, 0},
        {2000, 0.9, 2.8, 0, 0, 0, 0},  {8000, 0.35, 3.0, 0, 0, 0, 0}, {8000, 0.45, 3.0, 0, 0, 0, 0},
        {8000, 0.55, 3.0, 0, 0, 0, 0}, {8000, 0.3, 3.4, 0, 0, 0, 0},  {8000, 0.4, 3.2, 0, 0, 0, 0},
        {2000, 0.45, 3.0, 0, 0, 0, 0}, {700, 0.5, 3.0, 0, 0, 0, 0},   {6e6, 0.1, 1.2, 0, 0, 0, 0},
        {2e6, 0.1, 1.2, 0, 0, 0, 0}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        outcome image, generated;
        compare(&kinds[i], 30 + i, &image, &generated);
        printf("flux %g ratio %g at %g px: shift %.3f px, generator %.3f px\n", kinds[i].flux_e,
               kinds[i].ratio, kinds[i].distance, image.shift, generated.shift);
        /* the streak's fit weighs the pair by its light: 7 % of its centroid; errors in the mean */
        bst_assert_close(generated.shift, image.shift, 0.02 + 0.07 * image.shift);
    }
}

/* Pairs of streaks in line, across and between: bright ones are fitted on their pixels with a free
 * width, which places what is seen as one nearer to the brighter streak than the centroid. */
static void joined_streaks_are_placed_as_in_images(void **state) {
    (void)state;
    const kind kinds[] = {{12000, 0.5, 3.5, 0, 2.7, 0.0, 0},  {12000, 0.3, 3.5, 0, 2.7, 0.0, 0},
                          {12000, 0.5, 2.4, 0, 2.7, 1.57, 0}, {12000, 0.5, 2.8, 0, 4.0, 0.8, 0},
                          {12000, 0.4, 4.0, 0, 6.0, 0.0, 0},  {3000, 0.5, 2.4, 0, 6.0, 1.57, 0}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        outcome image, generated;
        compare(&kinds[i], 70 + i, &image, &generated);
        printf(
            "streaks of %g px, flux %g ratio %g at %g px: separated %.3f, generator %.3f; shift "
            "%.3f px, generator %.3f px\n",
            kinds[i].streak, kinds[i].flux_e, kinds[i].ratio, kinds[i].distance, image.separated,
            generated.separated, image.shift, generated.shift);
        bst_assert_close(generated.shift, image.shift, 0.02 + 0.07 * image.shift);
    }
}

/* Light between two others makes a ridge: three in a row are one where two alone would be two. */
static void light_between_joins(void **state) {
    (void)state;
    const kind row = {8000, 0.6, 2.4, 0.4, 0, 0, 0};
    outcome image, generated;
    compare(&row, 50, &image, &generated);
    printf("row of three: %.3f detections, generator %.3f\n", image.detections,
           generated.detections);
    bst_assert_close(generated.detections, image.detections, 0.1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_are_separated_as_in_images),
        cmocka_unit_test(pairs_are_split_as_in_images),
        cmocka_unit_test(joined_pairs_are_placed_as_in_images),
        cmocka_unit_test(joined_streaks_are_placed_as_in_images),
        cmocka_unit_test(light_between_joins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
