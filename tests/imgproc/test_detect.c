/* Scenes that are hard or must not be. */
#include <stdlib.h>

#include "sim/onboard/discriminate.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    synthetic s;
    bst_imgproc *ip;
    bst_detections *d;
    bst_rng_key key;
} fixture;

static fixture begin(int width, int height) {
    fixture f = {.key = bst_rng_make_key(11, 0, "test", "scene")};
    synthetic_init(&f.s, width, height);
    f.d = synthetic_detections(2048);
    return f;
}

/* Processes the frame as it is in pixels; motion NULL: at rest. */
static void process(fixture *f, const bst_camera_motion *motion) {
    if (!f->ip) {
        f->ip = synthetic_processor(&f->ctx, &f->s);
    }
    bst_imgproc_frame frame = synthetic_frame(&f->s);
    bst_assert_ok(&f->ctx, bst_imgproc_detect(&f->ctx, f->ip, &frame, motion, f->d, 2048));
    assert_true(synthetic_sound(f->d));
}

static void expose(fixture *f, const bst_camera_motion *motion) {
    synthetic_expose(&f->s, f->key, 1);
    process(f, motion);
}

static void end(fixture *f) {
    bst_imgproc_free(f->ip);
    free(f->d);
    synthetic_free(&f->s);
}

static const bst_detection *near_to(const fixture *f, double x, double y, double radius) {
    int n = synthetic_nearest(f->d, x, y, radius);
    if (n < 0) {
        fail_msg("nothing found within %g px of (%g, %g)", radius, x, y);
    }
    return &f->d->items[n];
}

/* Two equal points 4 px apart, FWHM 2 px, along x and along a diagonal, with and without a streak
 * filter. 0.15 px: four sigma at SNR 30. */
static void neighbours_are_told_apart(void **state) {
    (void)state;
    for (int streaks = 0; streaks < 2; streaks++) {
        fixture f = begin(128, 128);
        double flux = 30 * synthetic_noise(&f.s) / synthetic_norm(&f.s, 50, 50, 0, 0);
        synthetic_add(&f.s, 40.2, 50.4, flux, 0, 0);
        synthetic_add(&f.s, 44.2, 50.4, flux, 0, 0);
        synthetic_add(&f.s, 80.7, 90.1, flux, 0, 0);
        synthetic_add(&f.s, 83.5, 92.9, flux, 0, 0);
        bst_camera_motion motion = synthetic_motion(&f.s, 0, 8.3);
        expose(&f, streaks ? &motion : NULL);
        static const double places[][2] = {{40.2, 50.4}, {44.2, 50.4}, {80.7, 90.1}, {83.5, 92.9}};
        for (int i = 0; i < 4; i++) {
            const bst_detection *d = near_to(&f, places[i][0], places[i][1], 1.0);
            bst_assert_close(d->x_px, places[i][0], 0.15);
            bst_assert_close(d->y_px, places[i][1], 0.15);
            /* four sigma of flux, a fifth of it at most */
            bst_assert_close(d->flux_e / flux, 1.0, 0.2);
            assert_true(d->flags & BST_DETECTION_BLEND);
        }
        end(&f);
    }
}

/* A point beside a bright streak, both found in their own shapes. */
static void target_beside_a_streaking_star(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    double noise = synthetic_noise(&f.s);
    double star = 100 * noise / synthetic_norm(&f.s, 50, 50, 8.3, 0);
    double target = 20 * noise / synthetic_norm(&f.s, 50, 50, 0, 0);
    synthetic_add(&f.s, 60.3, 60.6, star, 8.3, 0);
    synthetic_add(&f.s, 61.0, 65.6, target, 0, 0);
    bst_camera_motion motion = synthetic_motion(&f.s, 8.3, 0);
    expose(&f, &motion);
    const bst_detection *s = near_to(&f, 60.3, 60.6, 1.0), *t = near_to(&f, 61.0, 65.6, 1.0);
    assert_true(s->flags & BST_DETECTION_STREAK);
    assert_false(t->flags & BST_DETECTION_STREAK);
    /* four sigma: 0.05 px along the streak, 0.08 px for the point */
    bst_assert_close(s->x_px, 60.3, 0.2);
    bst_assert_close(s->y_px, 60.6, 0.08);
    bst_assert_close(t->x_px, 61.0, 0.32);
    bst_assert_close(t->y_px, 65.6, 0.32);
    end(&f);
}

/* Extents of a bright point and of a bright streak. The streak is no Gaussian, so its windowed
 * length is held to 15 %. */
static void extents_and_magnitude(void **state) {
    (void)state;
    fixture f = begin(160, 128);
    synthetic_add(&f.s, 40.3, 40.8, 2e4, 0, 0);
    synthetic_add(&f.s, 100.2, 80.4, 2e4, 6, 6);
    bst_camera_motion motion = synthetic_motion(&f.s, 6, 6);
    expose(&f, &motion);
    const bst_detection *p = near_to(&f, 40.3, 40.8, 1.0), *s = near_to(&f, 100.2, 80.4, 1.0);
    bst_assert_close(p->length_px, 2.0, 0.1);
    bst_assert_close(p->width_px, 2.0, 0.1);
    double sigma = bst_camera_psf_sigma_px(&f.s.camera);
    double length = 2.3548200450309493 * sqrt(sigma * sigma + 72.0 / 12.0);
    bst_assert_close(s->length_px, length, 0.15 * length);
    bst_assert_close(s->width_px, 2.0, 0.15);
    /* a tenth of a radian: moments of SNR 300 */
    bst_assert_close(s->angle_rad, BST_PI / 4, 0.1);
    /* zero point 1e8 e-/s, 0.5 s; photon noise of 2e4 e- is 0.008 mag, five of it */
    double v = -2.5 * log10(2e4 / 0.5 / 1e8);
    bst_assert_close(p->v_mag, v, 0.04);
    bst_assert_close(s->v_mag, v, 0.04);
    end(&f);
}

/* A PSF that jitter widened from 0.849 px a little and by a third: fluxes must not follow the
 * mismatch, and places have their covariance. */
static void widened_psf_keeps_fluxes(void **state) {
    (void)state;
    static const double widths_px[] = {0.90, 1.13};
    for (int k = 0; k < 2; k++) {
        fixture f = begin(256, 256);
        bst_camera onboard = f.s.camera;
        f.s.camera.psf_fwhm_px = 2.3548200450309493 * widths_px[k];
        double bright = 5000, faint = 600;
        for (int i = 0; i < 36; i++) {
            synthetic_add(&f.s, 30 + i % 6 * 38 + 0.1 * i, 30 + i / 6 * 38 + 0.07 * i,
                          i < 12 ? bright : faint, 0, 0);
        }
        f.s.camera = onboard;
        expose(&f, NULL);
        double sum[2] = {0}, square = 0.0;
        for (int i = 0; i < 36; i++) {
            double x = 30 + i % 6 * 38 + 0.1 * i, y = 30 + i / 6 * 38 + 0.07 * i;
            const bst_detection *d = near_to(&f, x, y, 1);
            sum[i >= 12] += d->flux_e;
            square += (d->x_px - x) * (d->x_px - x) / d->cov_xx +
                      (d->y_px - y) * (d->y_px - y) / d->cov_yy;
        }
        /* means of 12 and 24 sources of 2 % and 6 %: three standard errors; a fixed width gives
         * -6 and -24 %, a width to first order 0 and -5 % */
        bst_assert_close(sum[0] / 12 / bright, 1.0, 0.02);
        bst_assert_close(sum[1] / 24 / faint, 1.0, 0.035);
        /* 72 values: four standard deviations of the mean square */
        bst_assert_close(square / 72, 1.0, 4.0 * sqrt(2.0 / 72));
        end(&f);
    }
}

/* What detections of known sources are off by. */
typedef struct deviations {
    int count;
    double flux, flux_square, place_square; /* means: of flux over truth, and of squared errors */
    double snr, snr_by_error; /* means over that of the truth, and over flux / error */
} deviations;

static void add_deviation(deviations *o, const bst_detection *d, const double place[2],
                          double flux_e, double norm) {
    double off = (d->flux_e - flux_e) / d->flux_sigma_e, n = ++o->count;
    double ex = d->x_px - place[0], ey = d->y_px - place[1];
    double square = (ex * ex * d->cov_yy - 2.0 * ex * ey * d->cov_xy + ey * ey * d->cov_xx) /
                    (d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy);
    o->flux += (d->flux_e / flux_e - o->flux) / n;
    o->flux_square += (off * off - o->flux_square) / n;
    o->place_square += (0.5 * square - o->place_square) / n;
    o->snr += (d->snr / (d->flux_e * norm) - o->snr) / n;
    o->snr_by_error += (d->snr * d->flux_sigma_e / d->flux_e - o->snr_by_error) / n;
}

/* The PSF known rightly, half as wide again and as two thirds of it, points and streaks: fluxes,
 * places and SNR are those of the true PSF. Read noise above all photons: SNR is flux over its
 * error where the width is that of the frame. */
static void psf_known_wrongly(void **state) {
    (void)state;
    static const double known_px[] = {2.0, 3.0, 2.0}, true_px[] = {2.0, 2.0, 3.0};
    static const double snr[] = {60.0, 14.0};
    enum { FRAMES = 8 };
    for (int k = 0; k < 6; k++) {
        fixture f = begin(256, 256);
        const double dx = k < 3 ? 0.0 : 6.0;
        bst_camera_motion motion = synthetic_motion(&f.s, dx, 0.0);
        f.s.read_e = f.s.camera.read_noise_e = 400.0;
        f.s.camera.offset_dn = 1000.0;
        bst_camera onboard = f.s.camera;
        onboard.psf_fwhm_px = known_px[k % 3];
        f.s.camera.psf_fwhm_px = true_px[k % 3];
        const double norm = synthetic_norm(&f.s, 50, 50, dx, 0) / synthetic_noise(&f.s);
        double place[36][2];
        for (int i = 0; i < 36; i++) {
            place[i][0] = 30 + i % 6 * 38 + 0.1 * i;
            place[i][1] = 30 + i / 6 * 38 + 0.07 * i;
            synthetic_add(&f.s, place[i][0], place[i][1], snr[i >= 12] / norm, dx, 0);
        }
        f.s.camera = onboard;
        deviations seen[2] = {{0}};
        for (int n = 0; n < FRAMES; n++) {
            synthetic_expose(&f.s, f.key, (uint64_t)n + 1);
            process(&f, dx > 0.0 ? &motion : NULL);
            for (int i = 0; i < 36; i++) {
                const bst_detection *d = near_to(&f, place[i][0], place[i][1], 1.5);
                /* a point in the middle of a pixel is sharper than a PSF known too wide allows */
                if (!bst_label_is_charge(d->label)) {
                    add_deviation(&seen[i >= 12], d, place[i], snr[i >= 12] / norm, norm);
                }
            }
        }
        for (int c = 0; c < 2; c++) {
            const deviations *o = &seen[c];
            assert_true(o->count >= FRAMES * (c == 0 ? 9 : 24));
            /* four standard errors; a free width makes a flux's twice 1 / SNR at most */
            bst_assert_close(o->flux, 1.0, (c == 0 ? 8.0 : 4.0) / snr[c] / sqrt(o->count));
            bst_assert_close(o->flux_square, 1.0, 4.0 * sqrt(2.0 / o->count));
            bst_assert_close(o->place_square, 1.0, 4.0 * sqrt(1.0 / o->count));
            /* noise of the background to 1 %; a star streak has the norm of the frame's centre */
            bst_assert_close(o->snr, 1.0, 0.03);
            if (c == 1) {
                bst_assert_close(o->snr_by_error, 1.0, 0.03);
            }
        }
        end(&f);
    }
}

/* Stars under an accelerated motion: the mean place is found, not that of the even streak. */
static void bent_path_keeps_its_mean(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    double noise = synthetic_noise(&f.s), flux = 0.0;
    /* a path from rest: 8 t^2 px, drawn by 40 short even pieces; its mean is 8/3 px on */
    enum { PIECES = 40 };
    for (int k = 0; k < PIECES; k++) {
        double a = (double)k / PIECES, b = (k + 1.0) / PIECES;
        double from = 8 * a * a, to = 8 * b * b;
        flux += 200 * noise / PIECES;
        synthetic_add(&f.s, 60.3 - 8.0 / 3.0 + 0.5 * (from + to), 62.8, 200 * noise / PIECES,
                      to - from, 0);
    }
    bst_camera_motion motion = synthetic_motion(&f.s, 8, 0);
    /* 8 t^2 = 8/3 + 8 (u/2) + (8/6) P2(u) with t = (u + 1) / 2 */
    motion.bend_cam_rad = (bst_vec3){0, 8.0 / 6.0 * bst_camera_scale_rad(&f.s.camera), 0};
    expose(&f, &motion);
    const bst_detection *d = near_to(&f, 60.3, 62.8, 1.5);
    /* four sigma of SNR 50 along and across the path */
    bst_assert_close(d->x_px, 60.3, 0.3);
    bst_assert_close(d->y_px, 62.8, 0.12);
    bst_assert_close(d->flux_e / flux, 1.0, 0.08);
    assert_false(bst_imgproc_smeared(f.ip));
    motion = synthetic_motion(&f.s, 70, 0);
    process(&f, &motion);
    assert_true(bst_imgproc_smeared(f.ip));
    /* one that is too long with its bend alone: no straight streak is filtered for */
    motion = synthetic_motion(&f.s, 45, 0);
    motion.bend_cam_rad = (bst_vec3){0, 12.0 * bst_camera_scale_rad(&f.s.camera), 0};
    process(&f, &motion);
    assert_true(bst_imgproc_smeared(f.ip));
    bst_assert_close(bst_imgproc_streak_px(f.ip), 0.0, 0.0);
    end(&f);
}

/* A source without a motion of its own beside streaks of an uneven turn has the camera's bend, 1.4
 * P2 px, and no uncertainty of half of it: it is drawn with it. */
static void what_rests_has_the_bend_of_the_camera(void **state) {
    (void)state;
    enum { PIECES = 40 };
    fixture f = begin(128, 128);
    const double flux = 40 * synthetic_noise(&f.s) / synthetic_norm(&f.s, 60, 62, 0, 0);
    for (int k = 0; k < PIECES; k++) {
        const double u = (2.0 * k + 1.0) / PIECES - 1.0;
        synthetic_add(&f.s, 60.3 + 1.4 * (1.5 * u * u - 0.5), 62.8, flux / PIECES, 0, 0);
    }
    bst_camera_motion motion = synthetic_motion(&f.s, 8, 0);
    motion.bend_cam_rad = (bst_vec3){0, 1.4 * bst_camera_scale_rad(&f.s.camera), 0};
    expose(&f, &motion);
    const bst_detection *d = near_to(&f, 60.3, 62.8, 1.0);
    /* FWHM / (2 SNR) is 0.025 px at full contrast; a path of unknown length adds as much */
    assert_true(d->cov_xx < 0.1 * 0.1 && d->cov_yy < 0.1 * 0.1);
    bst_assert_close(d->x_px, 60.3, 3.0 * sqrt(d->cov_xx));
    bst_assert_close(d->y_px, 62.8, 3.0 * sqrt(d->cov_yy));
    end(&f);
}

/* In a stare the target streaks and no telemetry says how. */
static void unknown_streak_is_measured(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    synthetic_add(&f.s, 60.3, 62.8, 4000, 7, -5);
    expose(&f, NULL);
    assert_int_equal(f.d->count <= 3, 1);
    const bst_detection *d = near_to(&f, 60.3, 62.8, 1.0);
    assert_true(d->flags & BST_DETECTION_STREAK);
    /* about five sigma along the streak; 5 % of the light for a length that is itself fitted */
    bst_assert_close(d->x_px, 60.3, 0.25);
    bst_assert_close(d->y_px, 62.8, 0.25);
    bst_assert_close(d->flux_e / 4000, 1.0, 0.1);
    double snr = 4000 * synthetic_norm(&f.s, 60.3, 62.8, 7, -5) / synthetic_noise(&f.s);
    bst_assert_close(d->snr / snr, 1.0, 0.1);
    end(&f);
}

/* The core is clipped by the full well; the wings still place it. */
static void saturated_star(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    synthetic_add(&f.s, 60.37, 70.81, 3e6, 0, 0);
    synthetic_add(&f.s, 20.0, 20.0, 2000, 0, 0);
    expose(&f, NULL);
    const bst_detection *d = near_to(&f, 60.37, 70.81, 0.2);
    assert_true(d->flags & BST_DETECTION_SATURATED);
    /* the unsaturated ring has half the light's information at least: within 10 % of the flux */
    bst_assert_close(d->flux_e / 3e6, 1.0, 0.1);
    assert_false(near_to(&f, 20, 20, 0.5)->flags & BST_DETECTION_SATURATED);
    /* wholly saturated blocks must not break anything */
    for (int y = 80; y < 120; y++) {
        for (int x = 70; x < 120; x++) {
            f.s.pixels[y * 128 + x] = 65535;
        }
    }
    process(&f, NULL);
    end(&f);
}

static void fill(fixture *f, int kind) {
    for (int i = 0; i < f->s.width * f->s.height; i++) {
        int x = i % f->s.width;
        f->s.pixels[i] = (uint16_t)(kind == 0 ? 0 : kind == 1 ? 1234 : kind == 2 ? 65535 : 50 * x);
    }
}

/* All zero, constant, all saturated, and one bright gradient: no false sources beyond the
 * gradient's own edges, no NaN. */
static void dull_images(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        fixture f = begin(200, 150);
        bst_camera_motion motion = synthetic_motion(&f.s, 5, 5);
        fill(&f, kind);
        process(&f, kind % 2 ? &motion : NULL);
        if (kind < 3) {
            assert_int_equal(f.d->count, 0);
        }
        end(&f);
    }
}

/* Steep but smooth light of 1e4 e- across the frame hides no bright star. */
static void star_on_a_gradient(void **state) {
    (void)state;
    fixture f = begin(256, 256);
    for (int i = 0; i < 256 * 256; i++) {
        f.s.mean_e[i] += 40.0 * (i % 256);
    }
    synthetic_add(&f.s, 128.4, 100.2, 5e4, 0, 0);
    expose(&f, NULL);
    near_to(&f, 128.4, 100.2, 0.2);
    assert_true(f.d->count < 20);
    end(&f);
}

/* Sensors of 1 and 64 pixels, and windows of them in a larger sensor. */
static void tiny_frames(void **state) {
    (void)state;
    static const int sides[] = {1, 2, 8};
    for (int i = 0; i < 3; i++) {
        fixture f = begin(sides[i], sides[i]);
        bst_camera_motion motion = synthetic_motion(&f.s, 4, 1);
        synthetic_add(&f.s, 3.6, 4.3, 3000, 0, 0);
        expose(&f, &motion);
        assert_true(f.d->count <= 4);
        end(&f);
    }
    fixture f = begin(64, 64);
    f.ip = synthetic_processor(&f.ctx, &f.s);
    bst_imgproc_frame frame = synthetic_frame(&f.s);
    frame.window = (bst_window){40, 20, 8, 8};
    for (int i = 0; i < 64; i++) {
        f.s.pixels[i] = (uint16_t)(104 + (i * 7 % 5));
    }
    f.s.pixels[3 * 8 + 4] += 120;
    f.s.pixels[3 * 8 + 3] += 60;
    f.s.pixels[3 * 8 + 5] += 60;
    f.s.pixels[2 * 8 + 4] += 60;
    f.s.pixels[4 * 8 + 4] += 60;
    bst_assert_ok(&f.ctx, bst_imgproc_detect(&f.ctx, f.ip, &frame, NULL, f.d, 64));
    assert_true(synthetic_sound(f.d));
    /* full-sensor coordinates; a symmetric cross on a ramp of 4 DN */
    const bst_detection *d = near_to(&f, 44, 23, 0.5);
    bst_assert_close(d->x_px, 44.0, 0.1);
    bst_assert_close(d->y_px, 23.0, 0.1);
    end(&f);
}

/* Each 2 x 2 block of a binned frame is centred half a pixel on. */
static void binned_frames(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    f.s.camera.psf_fwhm_px = 4.0;
    synthetic_add(&f.s, 60.3, 70.8, 5e3, 0, 0);
    synthetic_expose(&f.s, f.key, 1);
    static uint16_t binned[64 * 64];
    for (int i = 0; i < 64 * 64; i++) {
        const uint16_t *p = f.s.pixels + i / 64 * 2 * 128 + i % 64 * 2;
        binned[i] = (uint16_t)(p[0] + p[1] + p[128] + p[129] - 300);
    }
    f.ip = synthetic_processor(&f.ctx, &f.s);
    bst_imgproc_frame frame = synthetic_frame(&f.s);
    frame.pixels = binned;
    frame.binning = 2;
    bst_assert_ok(&f.ctx, bst_imgproc_detect(&f.ctx, f.ip, &frame, NULL, f.d, 64));
    const bst_detection *d = near_to(&f, 60.3, 70.8, 1.0);
    /* five sigma */
    bst_assert_close(d->x_px, 60.3, 5 * sqrt(d->cov_xx));
    bst_assert_close(d->y_px, 70.8, 5 * sqrt(d->cov_yy));
    assert_true(d->cov_xx < 0.01);
    end(&f);
}

/* 10 000 stars: the brightest that fit are kept, the rest counted. */
static void crowded_field(void **state) {
    (void)state;
    fixture f = begin(1024, 1024);
    f.s.config.capacity = 500;
    for (int i = 0; i < 10000; i++) {
        double u = bst_rng_uniform(f.key, 5, (uint64_t)(3 * i));
        double v = bst_rng_uniform(f.key, 5, (uint64_t)(3 * i + 1));
        double w = bst_rng_uniform(f.key, 5, (uint64_t)(3 * i + 2));
        synthetic_add(&f.s, 1023 * u, 1023 * v, 200.0 * pow(w, -1.0), 0, 0);
    }
    expose(&f, NULL);
    assert_int_equal(f.d->count <= 500 && f.d->count > 400, 1);
    assert_true(f.d->lost > 3000);
    double faintest = INFINITY;
    for (int i = 0; i < f.d->count; i++) {
        faintest = fmin(faintest, f.d->items[i].flux_e);
    }
    /* 500 of 10 000 are brighter than 4000 e-; blends may slip below that */
    assert_true(faintest > 800);
    for (int i = 1; i < f.d->count; i++) {
        assert_true(f.d->items[i].y_px >= f.d->items[i - 1].y_px);
    }
    end(&f);
}

/* The same frame gives the same bytes, from another work space and after other frames; one of them
 * is crowded, after which the signal is at first not stored. */
static void same_input_same_bytes(void **state) {
    (void)state;
    fixture a = begin(300, 200), b = begin(300, 200);
    for (int i = 0; i < 1000; i++) {
        synthetic_add(&a.s, 300 * bst_rng_uniform(a.key, 6, (uint64_t)i),
                      200 * bst_rng_uniform(a.key, 7, (uint64_t)i), 4000, 0, 0);
    }
    expose(&a, NULL);
    assert_true(a.d->count + a.d->lost > 300 * 200 / 400); /* the limit of a crowd */
    synthetic_clear(&a.s);
    bst_camera_motion motion = synthetic_motion(&a.s, 6, -3);
    for (int i = 0; i < 60; i++) {
        double x = 300 * bst_rng_uniform(a.key, 2, (uint64_t)i);
        double y = 200 * bst_rng_uniform(a.key, 3, (uint64_t)i);
        synthetic_add(&a.s, x, y, 500 + 200 * i, 6, -3);
    }
    expose(&b, NULL);
    expose(&a, &motion);
    memcpy(b.s.pixels, a.s.pixels, 300 * 200 * sizeof(uint16_t));
    process(&b, &motion);
    assert_true(a.d->count > 40);
    assert_memory_equal(a.d, b.d, sizeof *a.d + (size_t)a.d->count * sizeof a.d->items[0]);
    end(&a);
    end(&b);
}

/* A listed pixel is left out; one that is not listed is found out to be no star. */
static void hot_and_bad_pixels(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    bst_imgproc_bad_pixel bad[] = {{30, 40}, {81, 80}};
    f.s.config.bad_pixels = (bst_config_list){bad, 2};
    synthetic_add(&f.s, 80.3, 80.2, 6000, 0, 0);
    synthetic_expose(&f.s, f.key, 1);
    f.s.pixels[40 * 128 + 30] = 30000;
    f.s.pixels[80 * 128 + 81] = 0;
    f.s.pixels[100 * 128 + 20] = 400;
    process(&f, NULL);
    assert_int_equal(synthetic_nearest(f.d, 30, 40, 5.0), -1);
    assert_int_equal(near_to(&f, 20, 100, 1.0)->label, BST_LABEL_HOT_PIXEL);
    const bst_detection *d = near_to(&f, 80.3, 80.2, 1.0);
    assert_int_equal(d->label, BST_LABEL_UNKNOWN);
    /* five sigma */
    bst_assert_close(d->x_px, 80.3, 5 * sqrt(d->cov_xx));
    bst_assert_close(d->y_px, 80.2, 5 * sqrt(d->cov_yy));
    bst_imgproc_bad_pixel outside[] = {{128, 0}};
    f.s.config.bad_pixels = (bst_config_list){outside, 1};
    bst_imgproc *ip;
    assert_int_equal(bst_imgproc_create(&f.ctx, &f.s.camera, 1e8, &f.s.config, NULL, &ip),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(f.ctx.message, "bad_pixels/0"));
    end(&f);
}

/* Dark and flat maps are undone: the frame with both measures as the plain one. */
static void calibration_maps(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    f.s.read_e = 2.0;
    float *dark = calloc(128 * 128, sizeof *dark), *flat = calloc(128 * 128, sizeof *flat);
    assert_non_null(dark);
    assert_non_null(flat);
    f.s.sky_e = 100.0;
    synthetic_clear(&f.s);
    synthetic_add(&f.s, 60.3, 70.8, 4000, 0, 0);
    for (int i = 0; i < 128 * 128; i++) {
        flat[i] = (float)(1.0 + 0.3 * (bst_rng_uniform(f.key, 8, (uint64_t)i) - 0.5));
        dark[i] = (float)(200.0 * bst_rng_uniform(f.key, 9, (uint64_t)i));
        f.s.mean_e[i] = (double)flat[i] * f.s.mean_e[i] + 0.5 * (double)dark[i];
    }
    synthetic_expose(&f.s, f.key, 1);
    bst_imgproc_maps maps = {.dark_e_per_s = dark, .flat = flat};
    bst_assert_ok(&f.ctx, bst_imgproc_create(&f.ctx, &f.s.camera, 1e8, &f.s.config, &maps, &f.ip));
    process(&f, NULL);
    /* sky and dark's shot noise, mean 150 e- + 4 e-^2; the flat's spread changes it by 2 % */
    bst_assert_close(f.d->noise_e, sqrt(154.0), 0.5);
    bst_assert_close(f.d->background_e, 100.0, 1.0);
    /* four sigma of photon and background noise, 85 e- */
    bst_assert_close(near_to(&f, 60.3, 70.8, 0.3)->flux_e, 4000, 340);
    assert_true(f.d->count < 8);
    end(&f);
    free(dark);
    free(flat);
}

/* Cut sources carry the flag; one centred outside the frame is no source of this frame. */
static void edges_are_flagged(void **state) {
    (void)state;
    fixture f = begin(128, 128);
    synthetic_add(&f.s, 0.4, 60.0, 5000, 0, 0);
    synthetic_add(&f.s, 64.0, 60.0, 5000, 0, 0);
    synthetic_add(&f.s, -1.2, 90.0, 50000, 0, 0);
    expose(&f, NULL);
    assert_true(near_to(&f, 0.4, 60.0, 0.5)->flags & BST_DETECTION_EDGE);
    assert_false(near_to(&f, 64.0, 60.0, 0.5)->flags & BST_DETECTION_EDGE);
    const bst_detection *d = near_to(&f, -1.2, 90.0, 1.5);
    assert_int_equal(d->label, BST_LABEL_ARTEFACT);
    end(&f);
}

static void wrong_arguments(void **state) {
    (void)state;
    fixture f = begin(64, 64);
    f.ip = synthetic_processor(&f.ctx, &f.s);
    bst_imgproc_frame good = synthetic_frame(&f.s);
    bst_imgproc_frame bad[5] = {good, good, good, good, good};
    bad[0].window.x0 = -1;
    bad[1].window.width = 65;
    bad[2].binning = 0;
    bad[3].bits = 17;
    bad[4].window = (bst_window){0, 0, 3, 3};
    bad[4].binning = 4;
    for (int i = 0; i < 5; i++) {
        assert_int_equal(bst_imgproc_detect(&f.ctx, f.ip, &bad[i], NULL, f.d, 64),
                         BST_ERR_ARGUMENT);
    }
    end(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(neighbours_are_told_apart),
        cmocka_unit_test(target_beside_a_streaking_star),
        cmocka_unit_test(extents_and_magnitude),
        cmocka_unit_test(widened_psf_keeps_fluxes),
        cmocka_unit_test(psf_known_wrongly),
        cmocka_unit_test(bent_path_keeps_its_mean),
        cmocka_unit_test(what_rests_has_the_bend_of_the_camera),
        cmocka_unit_test(unknown_streak_is_measured),
        cmocka_unit_test(saturated_star),
        cmocka_unit_test(dull_images),
        cmocka_unit_test(star_on_a_gradient),
        cmocka_unit_test(tiny_frames),
        cmocka_unit_test(binned_frames),
        cmocka_unit_test(crowded_field),
        cmocka_unit_test(same_input_same_bytes),
        cmocka_unit_test(hot_and_bad_pixels),
        cmocka_unit_test(calibration_maps),
        cmocka_unit_test(edges_are_flagged),
        cmocka_unit_test(wrong_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
