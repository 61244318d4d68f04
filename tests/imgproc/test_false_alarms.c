/* False alarms against the rate that was asked for, and the SNR that is needed against theory, on
 * random frames with fixed seeds. */
#include <stdlib.h>

#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

/* The distribution of a background pixel's digital number, to be drawn from fast (Walker's alias
 * method): sky by Poisson, read noise, quantisation. */
enum { VALUES = 512 };
typedef struct sky {
    double share[VALUES];
    int other[VALUES];
    int first;
} sky;

static double upper_tail(double x) {
    return 0.5 * erfc(x / sqrt(2.0));
}

static void make_sky(const synthetic *s, double sky_e, sky *out) {
    double gain = s->camera.gain_e_per_dn, sum = 0.0, log_p = -sky_e;
    double weight[VALUES] = {0};
    out->first = (int)floor(s->camera.offset_dn + sky_e / gain) - VALUES / 2;
    for (int k = 0; k < 4000 && k < sky_e + 12 * sqrt(sky_e) + 30; k++) {
        log_p += k > 0 ? log(sky_e / k) : 0.0;
        for (int i = 0; i < VALUES; i++) {
            double e = (out->first + i - s->camera.offset_dn) * gain - k;
            weight[i] += exp(log_p) * (upper_tail((e - 0.5 * gain) / s->read_e) -
                                       upper_tail((e + 0.5 * gain) / s->read_e));
        }
    }
    for (int i = 0; i < VALUES; i++) {
        sum += weight[i];
    }
    int small[VALUES], large[VALUES], smalls = 0, larges = 0;
    for (int i = 0; i < VALUES; i++) {
        out->share[i] = weight[i] / sum * VALUES;
        out->other[i] = i;
        if (out->share[i] < 1.0) {
            small[smalls++] = i;
        } else {
            large[larges++] = i;
        }
    }
    while (smalls > 0 && larges > 0) {
        int a = small[--smalls], b = large[larges - 1];
        out->other[a] = b;
        out->share[b] -= 1.0 - out->share[a];
        if (out->share[b] < 1.0) {
            small[smalls++] = b;
            larges--;
        }
    }
}

/* Splitmix64. */
static uint64_t draw(uint64_t *state) {
    uint64_t z = (*state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static void expose(const synthetic *s, const sky *k, uint64_t *state) {
    for (int i = 0; i < s->width * s->height; i++) {
        uint64_t r = draw(state);
        int at = (int)(r >> 55);
        double u = (double)(r & 0xFFFFFFFFu) * 0x1p-32;
        s->pixels[i] = (uint16_t)(k->first + (u < k->share[at] ? at : k->other[at]));
    }
}

enum { SIDE = 512, ROOM = 4096 };
static const double FRAME_PX = 2048.0 * 2048.0;

typedef struct bench {
    bst_ctx ctx;
    synthetic s;
    sky sky;
    bst_imgproc *ip;
    bst_detections *d;
    bst_camera_motion motion;
    bst_imgproc_frame frame;
    uint64_t state;
} bench;

/* per_frame: false alarms asked for in a frame of 2048 x 2048. */
static void open_bench(bench *b, double sky_e, double read_e, double gain, double fwhm_px,
                       double dx, double dy, double per_frame) {
    synthetic_init(&b->s, SIDE, SIDE);
    b->s.sky_e = sky_e;
    b->s.read_e = b->s.camera.read_noise_e = read_e;
    b->s.camera.gain_e_per_dn = gain;
    b->s.camera.offset_dn = 500.0;
    b->s.camera.psf_fwhm_px = fwhm_px;
    b->s.config.capacity = ROOM;
    b->s.config.false_alarms_per_frame = per_frame * SIDE * SIDE / FRAME_PX;
    make_sky(&b->s, sky_e, &b->sky);
    b->ip = synthetic_processor(&b->ctx, &b->s);
    b->d = synthetic_detections(ROOM);
    b->motion = synthetic_motion(&b->s, dx, dy);
    b->frame = synthetic_frame(&b->s);
    b->state = 7;
}

static void close_bench(bench *b) {
    free(b->d);
    bst_imgproc_free(b->ip);
    synthetic_free(&b->s);
}

static int process(bench *b) {
    bst_assert_ok(&b->ctx, bst_imgproc_detect(&b->ctx, b->ip, &b->frame, &b->motion, b->d, ROOM));
    return b->d->count;
}

/* Held to 10 % and three standard errors of the Poisson count. */
static void check_alarms(double sky_e, double read_e, double gain, double fwhm, double dx,
                         double dy, double per_frame, int frames) {
    bench b = {.state = 0};
    open_bench(&b, sky_e, read_e, gain, fwhm, dx, dy, per_frame);
    int alarms = 0;
    for (int i = 0; i < frames; i++) {
        expose(&b.s, &b.sky, &b.state);
        alarms += process(&b);
    }
    double expected = frames * per_frame * SIDE * SIDE / FRAME_PX;
    double allowed = 0.10 * expected + 3.0 * sqrt(expected);
    if (fabs(alarms - expected) > allowed) {
        fail_msg(
            "sky %g, read %g, FWHM %g, path (%g, %g): %d false alarms in %d frames, %.1f "
            "expected, %.1f off allowed",
            sky_e, read_e, fwhm, dx, dy, alarms, frames, expected, allowed);
    }
    close_bench(&b);
}

/* About 250 alarms each. */
static void alarms_at_three_rates(void **state) {
    (void)state;
    check_alarms(100, 8, 2, 2, 0, 0, 30, 130);
    check_alarms(100, 8, 2, 2, 0, 0, 100, 40);
    check_alarms(100, 8, 2, 2, 0, 0, 1000, 10);
}

/* Where noise is skew, the PSF small or large, and for streaks. A normal law for noise of 1 e- of
 * sky and 1 e- of read noise would give more than twice as many. */
static void alarms_of_other_kinds(void **state) {
    (void)state;
    check_alarms(1, 1, 0.5, 2, 0, 0, 100, 40);
    /* the noise of 1 e- of sky and read noise in steps of 1 and 2 e-, and of 0.2 e- of sky */
    check_alarms(1, 1, 1, 2, 0, 0, 100, 40);
    check_alarms(1, 1, 2, 2, 0, 0, 100, 40);
    check_alarms(0.2, 1, 1, 2, 0, 0, 100, 40);
    check_alarms(20, 5, 1, 1.5, 0, 0, 100, 40);
    check_alarms(20, 5, 1, 3, 0, 0, 100, 40);
    check_alarms(20, 5, 1, 2, 5, 0, 100, 40);
    check_alarms(20, 5, 1, 2, 12, 16, 100, 40);
    check_alarms(20, 5, 1, 2, 0, 60, 100, 40);
}

/* Where single electrons show: as they are, and in steps that are wider than the noise of reading.
 * Without the law of counted electrons there would be up to 1.9 times as many. */
static void alarms_of_single_electrons(void **state) {
    (void)state;
    check_alarms(0.55, 0.3, 0.2, 2, 0, 0, 100, 100);
    check_alarms(0.55, 0.3, 1, 2, 0, 0, 100, 100);
    check_alarms(0.55, 0.5, 1, 2, 0, 0, 100, 100);
    check_alarms(3.25, 0.3, 1, 2, 0, 0, 100, 100);
}

/* The rates that are asked for in use; 100 to 400 alarms each. */
static void alarms_at_low_rates(void **state) {
    (void)state;
    check_alarms(100, 8, 2, 2, 0, 0, 10, 640);
    check_alarms(100, 8, 2, 2, 0, 0, 1, 2400);
    check_alarms(100, 8, 2, 2, 0, 0, 0.1, 8000);
    check_alarms(100, 8, 2, 2, 20, 0, 1, 2400);
    check_alarms(1, 1, 1, 2, 0, 0, 10, 640);
    check_alarms(1, 1, 1, 2, 0, 0, 1, 2400);
}

enum { STARS = 6200 };

/* Fluxes from SNR 11 on in numbers that fall as those of stars do, a star in 42 pixels. */
static void draw_stars(bench *b, double *x, double *y) {
    bst_rng_key key = bst_rng_make_key(9, 0, "test", "crowd");
    synthetic_clear(&b->s);
    double norm = synthetic_norm(&b->s, 100.2, 100.3, 0, 0), noise = synthetic_noise(&b->s);
    for (int i = 0; i < STARS; i++) {
        uint64_t n = (uint64_t)i;
        x[i] = SIDE * bst_rng_uniform(key, n, 0) - 0.5;
        y[i] = SIDE * bst_rng_uniform(key, n, 1) - 0.5;
        double snr = 11.0 * fmin(pow(1.0 - bst_rng_uniform(key, n, 2), -1.0), 1000.0);
        synthetic_add(&b->s, x[i], y[i], snr * noise / norm, 0, 0);
    }
}

/* In a crowd what is found away from all stars is as many as were asked for, to 25 % and three
 * standard errors, and level and noise are those of the
 * sky. */
static void alarms_between_stars(void **state) {
    (void)state;
    enum { FRAMES = 4 };
    bench b = {.state = 0};
    double per_frame = 1000.0, *x = calloc(2 * STARS, sizeof *x), *y = x + STARS;
    assert_non_null(x);
    open_bench(&b, 100, 5, 1.6, 2, 0, 0, per_frame);
    free(b.d);
    b.d = synthetic_detections(ROOM);
    draw_stars(&b, x, y);
    int alarms = 0;
    for (int f = 0; f < FRAMES; f++) {
        synthetic_expose(&b.s, bst_rng_make_key(5, 0, "test", "noise"), (uint64_t)f);
        int count = process(&b);
        assert_true(count > 2000 && count < ROOM);
        for (int k = 0; k < count; k++) {
            double least = INFINITY;
            for (int i = 0; i < STARS; i++) {
                double dx = x[i] - b.d->items[k].x_px, dy = y[i] - b.d->items[k].y_px;
                least = fmin(least, dx * dx + dy * dy);
            }
            alarms += least > 2.0 * 2.0;
        }
        /* of the sky between the stars */
        bst_assert_close(b.d->background_e, 100.0, 0.6);
        bst_assert_close(b.d->noise_e, synthetic_noise(&b.s), 0.02 * synthetic_noise(&b.s));
    }
    double expected = FRAMES * per_frame * SIDE * SIDE / FRAME_PX;
    if (fabs(alarms - expected) > 0.25 * expected + 3.0 * sqrt(expected)) {
        fail_msg("%d false alarms between stars, %.1f expected", alarms, expected);
    }
    free(x);
    close_bench(&b);
}

/* u with Q(u) = p */
static double tail_point(double p) {
    double lo = -10.0, hi = 10.0;
    for (int i = 0; i < 100; i++) {
        double u = 0.5 * (lo + hi);
        if (upper_tail(u) > p) {
            lo = u;
        } else {
            hi = u;
        }
    }
    return lo;
}

/* At an SNR 0.3 dB above what theory needs for this Pd at 1 false alarm per 2048 x 2048 pixels, at
 * random places in their pixels, at least that share is found, less three standard errors. */
static void check_loss(double dx, double dy, double pd, int frames) {
    bench b = {.state = 0};
    open_bench(&b, 400, 8, 2, 2, dx, dy, 1);
    double snr = (tail_point(1.0 / FRAME_PX) - tail_point(pd)) * pow(10.0, 0.3 / 20.0);
    double length = hypot(dx, dy), step = length + 36.0;
    int side = (int)((SIDE - 60.0 - length) / step) + 1, targets = 0, found = 0;
    for (int f = 0; f < frames; f++) {
        double x[256], y[256];
        expose(&b.s, &b.sky, &b.state);
        bst_rng_key key = bst_rng_make_key(5, 0, "test", "light");
        for (int i = 0; i < b.s.width * b.s.height; i++) {
            b.s.mean_e[i] = 0.0;
        }
        for (int k = 0; k < side * side; k++) {
            x[k] = 30 + 0.5 * length + k % side * step +
                   bst_rng_uniform(key, (uint64_t)f, (uint64_t)(2 * k));
            y[k] = 30 + 0.5 * length + k / side * step +
                   bst_rng_uniform(key, (uint64_t)f, (uint64_t)(2 * k + 1));
            double flux = snr * synthetic_noise(&b.s) / synthetic_norm(&b.s, x[k], y[k], dx, dy);
            synthetic_add(&b.s, x[k], y[k], flux, dx, dy);
        }
        for (int i = 0; i < b.s.width * b.s.height; i++) {
            if (b.s.mean_e[i] > 1e-4) {
                /* the light's own photon noise is small beside that of 400 e- of sky */
                double z[2];
                bst_rng_normal2(key, (uint64_t)(1000 + f), (uint64_t)i, z);
                double e = b.s.mean_e[i] + sqrt(b.s.mean_e[i]) * z[0];
                double dn = e / b.s.camera.gain_e_per_dn +
                            bst_rng_uniform(key, (uint64_t)(2000 + f), (uint64_t)i);
                b.s.pixels[i] = (uint16_t)(b.s.pixels[i] + (int)floor(dn));
            }
        }
        process(&b);
        for (int k = 0; k < side * side; k++) {
            targets++;
            found += synthetic_nearest(b.d, x[k], y[k], fmax(2.0, 0.5 * length)) >= 0;
        }
    }
    double least = pd - 3.0 * sqrt(pd * (1.0 - pd) / targets);
    if (found < least * targets) {
        fail_msg("path (%g, %g): %d of %d found at SNR %.2f, %.3f are needed", dx, dy, found,
                 targets, snr, least);
    }
    close_bench(&b);
}

/* About 1000 targets: 0.3 dB is 0.07 of Pd at 0.5, four standard errors. */
static void loss_is_below_0_3_db(void **state) {
    (void)state;
    check_loss(0, 0, 0.5, 7);
    check_loss(0, 0, 0.9, 7);
    check_loss(16, 12, 0.5, 12);
}

static void loss_with_many_targets(void **state) {
    (void)state;
    static const double paths[][2] = {{0, 0}, {5, 0}, {3, 4}, {20, 0}, {12, 16}, {60, 0}, {36, 48}};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        check_loss(paths[i][0], paths[i][1], 0.5, 40);
        check_loss(paths[i][0], paths[i][1], 0.9, 40);
    }
}

/* The same detections, to the bit, from any number of threads. */
static void threads_do_not_matter(void **state) {
    (void)state;
    bench b[2] = {{.state = 0}, {.state = 0}};
    for (int i = 0; i < 2; i++) {
        b[i].s.config.threads = 0;
        open_bench(&b[i], 100, 8, 2, 2, 5, 3, 1000);
        bst_imgproc_free(b[i].ip);
        b[i].s.config.threads = i == 0 ? 1 : 3;
        b[i].ip = synthetic_processor(&b[i].ctx, &b[i].s);
        expose(&b[i].s, &b[i].sky, &b[i].state);
        assert_true(process(&b[i]) > 10);
    }
    assert_int_equal(b[0].d->count, b[1].d->count);
    for (int i = 0; i < b[0].d->count; i++) {
        assert_true(b[0].d->items[i].x_px == b[1].d->items[i].x_px);
        assert_true(b[0].d->items[i].flux_e == b[1].d->items[i].flux_e);
        assert_true(b[0].d->items[i].snr == b[1].d->items[i].snr);
    }
    close_bench(&b[0]);
    close_bench(&b[1]);
}

int main(int argc, char **argv) {
    const struct CMUnitTest quick[] = {
        cmocka_unit_test(alarms_at_three_rates),      cmocka_unit_test(alarms_of_other_kinds),
        cmocka_unit_test(alarms_of_single_electrons), cmocka_unit_test(alarms_between_stars),
        cmocka_unit_test(loss_is_below_0_3_db),       cmocka_unit_test(threads_do_not_matter),
    };
    const struct CMUnitTest thorough[] = {
        cmocka_unit_test(alarms_at_low_rates),
        cmocka_unit_test(loss_with_many_targets),
    };
    if (argc > 1 && strcmp(argv[1], "thorough") == 0) {
        return cmocka_run_group_tests(thorough, NULL, NULL);
    }
    return cmocka_run_group_tests(quick, NULL, NULL);
}
