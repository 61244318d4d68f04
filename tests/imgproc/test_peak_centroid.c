/* Places by the matched filter alone (max_fits), against the Cramer-Rao bound and what they claim.
 */
#include <stdlib.h>

#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

static const bst_optics_zero_point no_zero_point = {.stars = 0};

enum { SIDE = 6, PER_FRAME = SIDE * SIDE, SPACING = 30, FRAMES = 10 };

typedef struct scene {
    bst_ctx ctx;
    synthetic s;
    bst_imgproc *ip;
    bst_detections *d;
    bst_rng_key key;
    bst_camera_motion motion;
    double dx, dy, flux;
    double x[PER_FRAME], y[PER_FRAME];
} scene;

static double em_gain; /* of the sensor; 0: no multiplication */

static void open(scene *c, double dx, double dy, double snr, int max_fits, int threads) {
    *c = (scene){.key = bst_rng_make_key(21, 0, "test", "tops"), .dx = dx, .dy = dy};
    synthetic_init(&c->s, SIDE * SPACING + 28, SIDE * SPACING + 28);
    c->s.config.max_fits = max_fits;
    c->s.config.threads = threads;
    c->s.camera.detector.em_gain = em_gain;
    c->ip = synthetic_processor(&c->ctx, &c->s);
    c->d = synthetic_detections(2048);
    c->motion = synthetic_motion(&c->s, dx, dy);
    c->flux = snr * synthetic_noise(&c->s) / synthetic_norm(&c->s, 100.3, 100.7, dx, dy);
}

static void close(scene *c) {
    free(c->d);
    bst_imgproc_free(c->ip);
    synthetic_free(&c->s);
}

static void show(scene *c, int frame) {
    synthetic_clear(&c->s);
    for (int k = 0; k < PER_FRAME; k++) {
        c->x[k] =
            28 + k % SIDE * SPACING + bst_rng_uniform(c->key, (uint64_t)frame, (uint64_t)(2 * k));
        c->y[k] = 28 + k / SIDE * SPACING +
                  bst_rng_uniform(c->key, (uint64_t)frame, (uint64_t)(2 * k + 1));
        synthetic_add(&c->s, c->x[k], c->y[k], c->flux, c->dx, c->dy);
    }
    synthetic_expose(&c->s, c->key, (uint64_t)(1000 + frame));
    bst_imgproc_frame shot = synthetic_frame(&c->s);
    bst_assert_ok(&c->ctx, bst_imgproc_detect(&c->ctx, c->ip, &shot, &c->motion, c->d, 2048));
    assert_true(synthetic_sound(c->d));
}

/* Mean of e^T C^-1 e, and RMS over the bound, of all sources; each refined first if so asked. */
static void measure(scene *c, bool refine, double *chi2, double *ratio) {
    double chi = 0.0, square = 0.0, bound = 0.0;
    for (int i = 0; i < FRAMES; i++) {
        show(c, i);
        for (int k = 0; k < PER_FRAME; k++) {
            int n = synthetic_nearest(c->d, c->x[k], c->y[k], 2.0);
            assert_true(n >= 0);
            if (refine) {
                bst_imgproc_refine(c->ip, c->d, n, &no_zero_point);
            }
            const bst_detection *p = &c->d->items[n];
            double ex = p->x_px - c->x[k], ey = p->y_px - c->y[k], b[3];
            double det = p->cov_xx * p->cov_yy - p->cov_xy * p->cov_xy;
            chi += (p->cov_yy * ex * ex - 2 * p->cov_xy * ex * ey + p->cov_xx * ey * ey) / det;
            square += ex * ex + ey * ey;
            if (k == 0) {
                synthetic_bound(&c->s, c->x[k], c->y[k], c->flux, c->dx, c->dy, b);
                bound += PER_FRAME * (b[0] + b[2]);
            }
        }
    }
    *chi2 = chi / (FRAMES * PER_FRAME);
    *ratio = sqrt(square / bound);
}

/* 360 sources know chi2 (mean 2, standard deviation 2) to 0.11 and the RMS to 2.7 %: three of those
 * beside what is asked, 2 within 0.35 and 1.1. Below SNR 10 covariances of the first order are a
 * little small, for fits too. */
static void tops_are_as_good_as_they_say(void **state) {
    (void)state;
    static const double cases[][3] = {{0, 0, 10}, {0, 0, 25}, {4, 3, 12}, {4, 3, 30}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        scene c;
        double chi2, ratio;
        open(&c, cases[k][0], cases[k][1], cases[k][2], 1, 1);
        measure(&c, false, &chi2, &ratio);
        bst_assert_close(chi2, 2.0, 0.35 + 0.33);
        assert_true(ratio < 1.1 + 0.08);
        close(&c);
    }
    /* with plain shot noise chi2 is 2.72 */
    scene c;
    double chi2, ratio;
    em_gain = 200.0;
    open(&c, 0, 0, 100, 1, 1);
    measure(&c, false, &chi2, &ratio);
    print_message("         multiplied: chi2 %.2f\n", chi2);
    bst_assert_close(chi2, 2.0, 0.35 + 0.33);
    close(&c);
    em_gain = 0.0;
}

/* A refined one is what it would have been with all fitted, but for what neighbours that are not
 * fitted yet hold: none here. The start is the same, so that 1 % of the error is ample. */
static void refining_fits(void **state) {
    (void)state;
    scene all, few;
    open(&all, 4, 3, 15, 0, 1);
    open(&few, 4, 3, 15, 1, 1);
    show(&all, 3);
    show(&few, 3);
    int moved = 0;
    for (int k = 0; k < PER_FRAME; k++) {
        int a = synthetic_nearest(all.d, all.x[k], all.y[k], 2.0);
        int b = synthetic_nearest(few.d, few.x[k], few.y[k], 2.0);
        assert_true(a >= 0 && b >= 0);
        bst_detection *p = &few.d->items[b], *q = &all.d->items[a], before = *p;
        p->label = BST_LABEL_OBJECT;
        p->label_probability = 0.9;
        double v_shift = p->v_mag - 2.5 * log10(q->flux_e / p->flux_e);
        bst_imgproc_refine(few.ip, few.d, b, &no_zero_point);
        moved += p->x_px != before.x_px;
        bst_assert_close(p->x_px, q->x_px, 0.01 * sqrt(q->cov_xx));
        bst_assert_close(p->y_px, q->y_px, 0.01 * sqrt(q->cov_yy));
        bst_assert_close(p->cov_xx, q->cov_xx, 0.02 * q->cov_xx);
        bst_assert_close(p->flux_e, q->flux_e, 0.01 * q->flux_sigma_e);
        bst_assert_close(p->v_mag, v_shift, 1e-3);
        assert_int_equal(p->label, BST_LABEL_OBJECT);
        bst_detection once = *p;
        bst_imgproc_refine(few.ip, few.d, b, &no_zero_point); /* a fitted one stays */
        assert_memory_equal(&once, p, sizeof once);
    }
    assert_true(moved >= PER_FRAME - 1); /* all but the one that was fitted */
    close(&all);
    close(&few);
}

/* Peaks of the noise between pixels of charge, by the filter just above the least SNR beside
 * charge, 4: for some, the fit falls below it, so that it is no source. Such a detection stays as
 * it was; all others are fitted, and differ. */
static void refits_without_light_change_nothing(void **state) {
    (void)state;
    enum { FIELDS = 6, SPACE = 11 };
    int stayed = 0;
    for (int n = 0; n < FIELDS; n++) {
        scene c;
        open(&c, 0, 0, 40, 1, 1);
        bst_imgproc_free(c.ip);
        c.s.config.false_alarms_per_frame = 30;
        c.ip = synthetic_processor(&c.ctx, &c.s);
        synthetic_expose(&c.s, c.key, (uint64_t)n);
        for (int y = 4; y < c.s.height; y += SPACE) {
            for (int x = 4; x < c.s.width; x += SPACE) {
                c.s.pixels[y * c.s.width + x] += 500;
            }
        }
        bst_imgproc_frame shot = synthetic_frame(&c.s);
        bst_assert_ok(&c.ctx, bst_imgproc_detect(&c.ctx, c.ip, &shot, NULL, c.d, 2048));
        for (int i = 0; i < c.d->count; i++) {
            bst_detection before = c.d->items[i], *p = &c.d->items[i];
            if (p->label == BST_LABEL_HOT_PIXEL || p->label == BST_LABEL_HIT) {
                continue;
            }
            bst_imgproc_refine(c.ip, c.d, i, &no_zero_point);
            stayed += memcmp(&before, p, sizeof before) == 0;
        }
        close(&c);
    }
    assert_true(stayed > 0);
}

/* Bit for bit. */
static void threads_do_not_matter(void **state) {
    (void)state;
    scene one, four;
    open(&one, 4, 3, 9, 10, 1);
    open(&four, 4, 3, 9, 10, 4);
    show(&one, 5);
    show(&four, 5);
    assert_int_equal(one.d->count, four.d->count);
    assert_memory_equal(one.d->items, four.d->items, (size_t)one.d->count * sizeof one.d->items[0]);
    close(&one);
    close(&four);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tops_are_as_good_as_they_say),
        cmocka_unit_test(refining_fits),
        cmocka_unit_test(refits_without_light_change_nothing),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
