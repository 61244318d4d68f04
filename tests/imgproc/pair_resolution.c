/* Pairs that are found as two, and single sources that are split.
 *
 * Usage: test_imgproc_pair_resolution runs a test; with NAME=VALUE ..., those of read_arguments
 * below, it prints the share of single sources that are split over their SNR. A fifth of the
 * sources of a frame are pairs, of random direction and pixel phase. SNR is that of both lights
 * together, as one source. `boresight pd --pair` measures the separations. */
#include <stdlib.h>

#include "imgproc/detect/detect_internal.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 512, STAMP = 96 };

typedef struct arguments {
    double frames;       /* of a separation */
    double ratio;        /* of brightness */
    double streak;       /* px; 0: points */
    double false_splits; /* share asked for */
    double moving;       /* a quarter of the single sources, which alone are counted, move
                            by so much, unknown to the processing, px */
    double snr;          /* 0: all of the table */
} arguments;

static void read_arguments(int argc, char **argv, arguments *a) {
    *a = (arguments){.frames = 8, .ratio = 1, .false_splits = 0.01};
    struct {
        const char *name;
        double *value;
    } all[] = {{"frames=", &a->frames},
               {"streak=", &a->streak},
               {"false_splits=", &a->false_splits},
               {"moving=", &a->moving},
               {"snr=", &a->snr}};
    for (int i = 1; i < argc; i++) {
        for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
            size_t n = strlen(all[k].name);
            if (strncmp(argv[i], all[k].name, n) == 0) {
                *all[k].value = atof(argv[i] + n);
            }
        }
    }
}

/* The motion of the streaks: 0.8 and 0.6 of their length. */
static void motion_of(const arguments *a, double d[2]) {
    d[0] = 0.8 * a->streak;
    d[1] = 0.6 * a->streak;
}

/* Shares of pairs and of single sources that are found as two. */
typedef struct shares {
    double pairs, singles;
} shares;

static int found_near(const bst_detections *d, double x, double y, double reach) {
    int count = 0;
    for (int i = 0; i < d->count; i++) {
        count += hypot(d->items[i].x_px - x, d->items[i].y_px - y) < reach;
    }
    return count;
}

static shares measure(const arguments *a, double flux, double separation, double false_splits,
                      uint64_t stream) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.false_splits = false_splits;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    assert_non_null(ip);
    bst_detections *d = synthetic_detections(2048);
    double path[2], cell = 28.0 + a->streak, faint = 1.0 / (1.0 + a->ratio);
    motion_of(a, path);
    int columns = (int)(SIDE / cell), count[2] = {0}, two[2] = {0};
    for (uint64_t frame = 0; frame < (uint64_t)a->frames; frame++) {
        bst_rng_key key = bst_rng_make_key(stream, frame, "test", "pair resolution");
        synthetic_clear(&s);
        double x[400], y[400];
        for (int k = 0; k < columns * columns; k++) {
            double angle = 2.0 * BST_PI * bst_rng_uniform(key, 2, (uint64_t)k),
                   part = k % 5 ? 0.0 : separation;
            x[k] = (k % columns + 0.5) * cell + bst_rng_uniform(key, 0, (uint64_t)k);
            y[k] = ((int)(k / columns) + 0.5) * cell + bst_rng_uniform(key, 1, (uint64_t)k);
            if (k % 5 == 1 && a->moving > 0.0) {
                synthetic_add(&s, x[k], y[k], flux, a->moving * cos(angle), a->moving * sin(angle));
                continue;
            }
            synthetic_add(&s, x[k] - faint * part * cos(angle), y[k] - faint * part * sin(angle),
                          (1.0 - faint) * flux, path[0], path[1]);
            synthetic_add(&s, x[k] + (1.0 - faint) * part * cos(angle),
                          y[k] + (1.0 - faint) * part * sin(angle), faint * flux, path[0], path[1]);
        }
        synthetic_expose(&s, bst_rng_make_key(stream + 1000, frame, "test", "noise"), frame);
        bst_imgproc_frame f = synthetic_frame(&s);
        bst_camera_motion motion = synthetic_motion(&s, path[0], path[1]);
        bst_assert_ok(&ctx,
                      bst_imgproc_detect(&ctx, ip, &f, a->streak > 0.0 ? &motion : NULL, d, 2048));
        for (int k = 0; k < columns * columns; k++) {
            if (k % 5 > 1 && a->moving > 0.0) {
                continue;
            }
            count[k % 5 != 0]++;
            two[k % 5 != 0] += found_near(d, x[k], y[k], 5.0 + separation) >= 2;
        }
    }
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return (shares){(double)two[0] / count[0], (double)two[1] / count[1]};
}

/* Pairs of 1.2 times the separation in docs/results/detection.md are found; without the test none
 * is. 0.023 of the single sources: 1 % and six standard deviations of 2,000. */
static void close_pairs_are_found(void **state) {
    (void)state;
    static const struct {
        double snr, ratio, streak, separation;
    } cases[] = {{50, 1, 0, 1.31}, {100, 4, 0, 1.31}, {100, 1, 20, 1.9}};
    synthetic s;
    synthetic_init(&s, STAMP, STAMP);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        arguments a = {
            .frames = 8, .ratio = cases[k].ratio, .streak = cases[k].streak, .false_splits = 0.01};
        double path[2];
        motion_of(&a, path);
        double flux = cases[k].snr * synthetic_noise(&s) /
                      synthetic_norm(&s, 0.5 * STAMP, 0.5 * STAMP, path[0], path[1]);
        shares with = measure(&a, flux, cases[k].separation, 0.01, 78);
        shares without = measure(&a, flux, cases[k].separation, 0.0, 78);
        print_message(
            "SNR %g, ratio %g, streak %g px: %.3f of pairs at %g px found, %.4f of single sources "
            "split\n",
            cases[k].snr, cases[k].ratio, cases[k].streak, with.pairs, cases[k].separation,
            with.singles);
        assert_true(with.pairs > 0.9);
        assert_true(with.singles < 0.023);
        assert_true(without.pairs < 0.02 && without.singles < 0.002);
    }
    synthetic_free(&s);
}

int main(int argc, char **argv) {
    if (argc == 1) {
        const struct CMUnitTest tests[] = {cmocka_unit_test(close_pairs_are_found)};
        return cmocka_run_group_tests(tests, NULL, NULL);
    }
    arguments a;
    read_arguments(argc, argv, &a);
    static const double table[] = {12, 20, 30, 50, 100, 200, 400};
    double path[2];
    motion_of(&a, path);
    synthetic s;
    synthetic_init(&s, STAMP, STAMP);
    double norm = synthetic_norm(&s, 0.5 * STAMP, 0.5 * STAMP, path[0], path[1]);
    printf("  SNR  singles split, %g asked for\n", a.false_splits);
    for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
        if (a.snr > 0.0 && a.snr != table[k]) {
            continue;
        }
        double flux = table[k] * synthetic_noise(&s) / norm;
        printf("%5g  %.4f\n", table[k], measure(&a, flux, 0.0, a.false_splits, 77).singles);
        fflush(stdout);
    }
    synthetic_free(&s);
    return 0;
}
