/* Among streaks of stars: which streaks have another path, by the gain of chi-square that images
 * drawn by other code give; stars, and two in one image, have none. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 320, CELLS = 4, FRAMES = 14 };

/* A source, or two of which the second lies (apart_x, apart_y) from the first. */
typedef struct subject {
    double x, y, dx, dy, flux_e;
    double apart_x, apart_y; /* 0: one */
    double gain;             /* of chi-square by its own path over the stars' */
} subject;

/* Star's path, on both axes. */
static const double STAR[2] = {19.0, -8.0};

static void image_of(synthetic *s, const subject *o, double dx, double dy, double *out) {
    synthetic_clear(s);
    synthetic_add(s, o->x, o->y, 1.0, dx, dy);
    for (int k = 0; k < SIDE * SIDE; k++) {
        out[k] = s->mean_e[k] - s->sky_e;
    }
}

/* Chi-square that is left of the source if it is fitted with the stars' path at its place. */
static double gain_of(synthetic *s, const subject *o) {
    double *own = calloc(2 * SIDE * SIDE, sizeof *own), *star = own + SIDE * SIDE;
    assert_non_null(own);
    const double noise = synthetic_noise(s);
    image_of(s, o, o->dx, o->dy, own);
    image_of(s, o, STAR[0], STAR[1], star);
    double aa = 0.0, ab = 0.0, bb = 0.0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double weight = 1.0 / (noise * noise + o->flux_e * own[k]);
        aa += weight * own[k] * own[k];
        ab += weight * own[k] * star[k];
        bb += weight * star[k] * star[k];
    }
    free(own);
    return o->flux_e * o->flux_e * (aa - ab * ab / bb);
}

static double draw(bst_rng_key key, int frame, int i, double from, double to) {
    return from + (to - from) * bst_rng_uniform(key, (uint64_t)frame, (uint64_t)i);
}

typedef struct tally {
    int found, other;
    double chi2; /* of the places, over degrees of freedom */
} tally;

static void count(const bst_detections *d, const subject *o, tally *t) {
    const int n = synthetic_nearest(d, o->x, o->y, 4.0);
    if (n < 0 || (d->items[n].flags & (BST_DETECTION_BLEND | BST_DETECTION_EDGE))) {
        return;
    }
    const bst_detection *item = &d->items[n];
    const double x = item->x_px - o->x, y = item->y_px - o->y;
    const double xx = item->cov_xx, xy = item->cov_xy, yy = item->cov_yy;
    t->found++;
    /* what is no streak is none of a star's either */
    t->other += (item->flags & BST_DETECTION_OTHER_PATH) || !(item->flags & BST_DETECTION_STREAK);
    t->chi2 += 0.5 * (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy);
}

/* Frames of 4 x 4 subjects that `set` makes. */
static tally see(void (*set)(bst_rng_key, int, int, subject *), double least_gain) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(200);
    const bst_camera_motion motion = synthetic_motion(&s, STAR[0], STAR[1]);
    const bst_rng_key key = bst_rng_make_key(4, 0, "test", "other_path");
    tally out = {0};
    for (int frame = 0; frame < FRAMES; frame++) {
        subject all[CELLS * CELLS];
        for (int k = 0; k < CELLS * CELLS; k++) {
            all[k] = (subject){.x = 40 + 80 * (k % CELLS) + draw(key, frame, 10 * k, -5.0, 5.0),
                               .y = 40 + 80 * (k / CELLS) + draw(key, frame, 10 * k + 1, -5.0, 5.0),
                               .flux_e = 3000 * exp(draw(key, frame, 10 * k + 2, 0.0, 3.5)),
                               .dx = STAR[0],
                               .dy = STAR[1]};
            set(key, frame, k, &all[k]);
            all[k].gain = gain_of(&s, &all[k]);
        }
        synthetic_clear(&s);
        for (int k = 0; k < CELLS * CELLS; k++) {
            const subject *o = &all[k];
            const double second = hypot(o->apart_x, o->apart_y) > 0.0 ? 0.5 : 0.0;
            synthetic_add(&s, o->x, o->y, o->flux_e, o->dx, o->dy);
            synthetic_add(&s, o->x + o->apart_x, o->y + o->apart_y, second * o->flux_e, o->dx,
                          o->dy);
        }
        synthetic_expose(&s, key, (uint64_t)frame);
        const bst_imgproc_frame f = synthetic_frame(&s);
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, &motion, d, 200));
        for (int k = 0; k < CELLS * CELLS; k++) {
            if (all[k].gain >= least_gain) {
                count(d, &all[k], &out);
            }
        }
    }
    out.chi2 /= out.found;
    printf("%d found, %d of another path, chi-square of places %.2f\n", out.found, out.other,
           out.chi2);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return out;
}

static void one_star(bst_rng_key key, int frame, int k, subject *o) {
    (void)key;
    (void)frame;
    (void)k;
    (void)o;
}

/* Two stars of brightness 2 to 1 up to 9 px from each other, along the path, across or between. */
static void two_stars(bst_rng_key key, int frame, int k, subject *o) {
    const double by = draw(key, frame, 10 * k + 3, 0.5, 9.0);
    const double angle = draw(key, frame, 10 * k + 4, 0.0, 6.28);
    const double along = k % 2 ? atan2(STAR[1], STAR[0]) : angle;
    o->apart_x = by * cos(along);
    o->apart_y = by * sin(along);
}

/* A path that differs by 4 px or more: shorter and longer along the stars', and in all directions.
 */
static void object(bst_rng_key key, int frame, int k, subject *o) {
    if ((k + k / CELLS) % 2) { /* a bright star: the motion of the camera is that of the stars */
        o->flux_e = 40000.0;
        return;
    }
    const double share = draw(key, frame, 10 * k + 3, 0.1, 1.5);
    const double turn = k / 2 % 2 ? 0.0 : draw(key, frame, 10 * k + 4, -1.57, 1.57);
    const double scale = fabs(share - 1.0) < 0.2 && turn == 0.0 ? 0.7 : share;
    const double by = fabs(turn) > 0.25 || turn == 0.0 ? turn : 0.5;
    o->dx = scale * (STAR[0] * cos(by) - STAR[1] * sin(by));
    o->dy = scale * (STAR[0] * sin(by) + STAR[1] * cos(by));
}

static void stars_have_the_path_of_stars(void **state) {
    (void)state;
    const tally one = see(one_star, 0.0);
    assert_true(one.found > 200);
    assert_int_equal(one.other, 0);
    const tally two = see(two_stars, 0.0);
    assert_true(two.found > 60);
    assert_int_equal(two.other, 0);
}

/* Those whose own path explains 100 more of chi-square than the stars': at least 9 in 10 sigma. */
static void objects_have_another(void **state) {
    (void)state;
    const tally all = see(object, 100.0);
    assert_true(all.found > 90);
    assert_true(all.other > 0.97 * all.found);
    assert_true(all.chi2 < 1.4);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(stars_have_the_path_of_stars),
                                       cmocka_unit_test(objects_have_another)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
