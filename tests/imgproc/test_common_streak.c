/* The common streak of a frame: shape, ends and stars from the pixels alone. */
#include "boresight/rng.h"
#include "imgproc/streak/common_streak_internal.h"
#include "tests/test_support.h"

enum { SIDE = 240, STARS = 9 };

typedef struct scene {
    bst_ctx ctx;
    float pixels[SIDE * SIDE];
    double x[STARS], y[STARS], flux[STARS]; /* places at the exposure's start */
} scene;

static double uniform(uint64_t a, uint64_t b) {
    return bst_rng_uniform(bst_rng_make_key(4, 0, "test", "common streak"), a, b);
}

/* Path of a star, u from 0 to 1: `length` px to the right and downwards, bent. */
static void path(double length, double u, double *dx, double *dy) {
    *dx = length * (0.92 * u - 0.05 * u * u);
    *dy = length * (0.2 * u + 0.2 * u * u);
}

static void add_star(scene *s, int i, double length) {
    int steps = 1 + (int)(4.0 * length);
    for (int k = 0; k < steps; k++) {
        double dx, dy;
        path(length, steps > 1 ? (double)k / (steps - 1) : 0.0, &dx, &dy);
        double cx = s->x[i] + dx, cy = s->y[i] + dy;
        for (int y = (int)cy - 5; y <= (int)cy + 5; y++) {
            for (int x = (int)cx - 5; x <= (int)cx + 5; x++) {
                if (x >= 0 && y >= 0 && x < SIDE && y < SIDE) {
                    double r2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
                    s->pixels[y * SIDE + x] += (float)(s->flux[i] / steps * exp(-r2 / 1.8));
                }
            }
        }
    }
}

/* Stars of unit noise on a slope of columns; with bad pixels. */
static void draw(scene *s, double length, double per_px) {
    memset(s, 0, sizeof *s);
    bst_rng_key key = bst_rng_make_key(4, 0, "test", "noise");
    for (uint64_t i = 0; i < SIDE * SIDE; i++) {
        s->pixels[i] = (float)(100.0 + 0.5 * (double)(i % SIDE) + bst_rng_normal(key, i, 0));
    }
    for (int i = 0; i < STARS; i++) {
        /* a grid, so that streaks do not lie on each other */
        s->x[i] = 22.0 + 68.0 * (i % 3) + 10.0 * uniform((uint64_t)i, 0);
        s->y[i] = 20.0 + 68.0 * (i / 3) + 12.0 * uniform((uint64_t)i, 1);
        s->flux[i] = per_px * fmax(length, 1.0) * (i == 4 ? 3.0 : 1.0 + uniform((uint64_t)i, 2));
        add_star(s, i, length);
    }
    s->pixels[5 * SIDE + 7] = NAN;
    s->pixels[50 * SIDE + 7] = -30000.0f;
}

/* Finds the stars by the first shape; the finder is to be freed. */
static bst_streak_finder *find(scene *s, bst_common_streak *found) {
    const bst_common_streak_options options = {.max_sources = 40, .least_snr = 15.0};
    bst_streak_finder *finder;
    bst_assert_ok(&s->ctx,
                  bst_streak_finder_create(&s->ctx, s->pixels, SIDE, SIDE, &options, &finder));
    assert_true(bst_streak_finder_shapes(finder) >= 1);
    bst_assert_ok(&s->ctx, bst_streak_finder_find(&s->ctx, finder, 0, found));
    return finder;
}

/* Every star is found once, at its place by the template's first end. */
static void check(scene *s, double length) {
    bst_common_streak found;
    bst_streak_finder *finder = find(s, &found);
    bst_assert_close(found.sigma, 1.0, 0.1); /* the stars widen it a little */
    double dx, dy;
    path(length, 1.0, &dx, &dy);
    /* ends where the light has fallen to half: a quarter of a sample, which is 2 px long */
    bst_assert_close(found.ends[1].x_px - found.ends[0].x_px, dx, 0.5);
    bst_assert_close(found.ends[1].y_px - found.ends[0].y_px, dy, 0.5);
    int matched[STARS] = {0};
    double sum_x = 0.0, sum_y = 0.0, square = 0.0;
    for (int k = 0; k < found.count; k++) {
        for (int i = 0; i < STARS; i++) {
            double ex = found.items[k].x_px + found.ends[0].x_px - s->x[i];
            double ey = found.items[k].y_px + found.ends[0].y_px - s->y[i];
            if (hypot(ex, ey) < 4.0) {
                matched[i]++;
                sum_x += ex;
                sum_y += ey;
                square += ex * ex + ey * ey;
                assert_true(found.items[k].cov_xx > 0.0 && found.items[k].cov_yy > 0.0);
                if (length > 10.0) { /* vague along it, which is right and down */
                    assert_true(found.items[k].cov_xy > 0.0 &&
                                found.items[k].cov_xx > found.items[k].cov_yy);
                }
            }
        }
    }
    for (int i = 0; i < STARS; i++) {
        assert_int_equal(matched[i], 1);
    }
    assert_int_equal(found.count, STARS); /* nothing is left of bright stars */
    double bias = hypot(sum_x, sum_y) / STARS;
    double rms = sqrt(square / STARS - bias * bias);
    print_message("%g px: %d stars, ends off by %.2f px, stars by %.3f px\n", length, found.count,
                  bias, rms);
    assert_true(bias < 0.4); /* as the ends */
    assert_true(rms < 0.2);  /* 0.1 px of noise, the template's own noise */
    bst_streak_finder_free(finder);
}

/* Light of 300 standard deviations about a place beside the frame, as of a limb or a ghost. */
static void uneven_background(void **state) {
    (void)state;
    static scene s;
    draw(&s, 40.0, 14.0);
    for (int i = 0; i < SIDE * SIDE; i++) {
        double x = i % SIDE - 250.0, y = (double)(i / SIDE) - 250.0;
        s.pixels[i] += (float)(300.0 * exp(-(x * x + y * y) / (2.0 * 70.0 * 70.0)));
    }
    bst_common_streak found;
    bst_streak_finder *finder = find(&s, &found);
    double dx, dy;
    int matched = 0;
    path(40.0, 1.0, &dx, &dy);
    bst_assert_close(found.ends[1].x_px - found.ends[0].x_px, dx, 1.0);
    bst_assert_close(found.ends[1].y_px - found.ends[0].y_px, dy, 1.0);
    for (int k = 0; k < found.count; k++) {
        for (int i = 0; i < STARS; i++) {
            matched += hypot(found.items[k].x_px + found.ends[0].x_px - s.x[i],
                             found.items[k].y_px + found.ends[0].y_px - s.y[i]) < 4.0;
        }
    }
    assert_true(matched >= STARS - 1);     /* one lies in the brightest corner */
    assert_true(found.count <= 2 * STARS); /* what the cells leave of the glow */
    bst_streak_finder_free(finder);
}

static void points(void **state) {
    (void)state;
    static scene s;
    draw(&s, 0.0, 60.0);
    check(&s, 0.0);
}

static void curved_streaks(void **state) {
    (void)state;
    static scene s;
    draw(&s, 45.0, 12.0);
    check(&s, 45.0);
}

/* Stars that the frame cuts off are found by the end that is left. */
static void streaks_at_the_edge(void **state) {
    (void)state;
    static scene s;
    draw(&s, 45.0, 12.0);
    s.x[0] = SIDE - 32.0;
    s.y[0] = 205.0;
    s.flux[0] = 45.0 * 40.0;
    add_star(&s, 0, 45.0);
    bst_common_streak found;
    bst_streak_finder *finder = find(&s, &found);
    int seen = 0;
    for (int k = 0; k < found.count; k++) {
        seen += hypot(found.items[k].x_px + found.ends[0].x_px - s.x[0],
                      found.items[k].y_px + found.ends[0].y_px - s.y[0]) < 1.5;
    }
    assert_int_equal(seen, 1);
    bst_streak_finder_free(finder);
}

/* Frames that end on stars: places are those whose middle is in the frame, below and to the right
 * alike. */
static void places_are_in_frames_of_any_shape(void **state) {
    (void)state;
    static scene s;
    static float part[SIDE * SIDE];
    draw(&s, 20.0, 25.0);
    for (int k = 0; k < 6; k++) {
        /* 3, 5 or 7 px beyond the middle of a star in the last row, or of one in the last column */
        double dx, dy;
        path(20.0, 0.5, &dx, &dy);
        int width = k % 2 ? (int)(s.x[8] + dx) - 2 - k : SIDE;
        int height = k % 2 ? SIDE : (int)(s.y[8] + dy) - 2 - k;
        for (int i = 0; i < width * height; i++) {
            part[i] = s.pixels[i / width * SIDE + i % width];
        }
        const bst_common_streak_options options = {.max_sources = 40, .least_snr = 8.0};
        bst_streak_finder *finder;
        bst_common_streak found;
        bst_assert_ok(&s.ctx,
                      bst_streak_finder_create(&s.ctx, part, width, height, &options, &finder));
        assert_true(bst_streak_finder_shapes(finder) >= 1);
        bst_assert_ok(&s.ctx, bst_streak_finder_find(&s.ctx, finder, 0, &found));
        assert_true(found.count >= 6);
        for (int i = 0; i < found.count; i++) {
            assert_true(found.items[i].x_px >= 0.0 && found.items[i].x_px <= width - 1);
            assert_true(found.items[i].y_px >= 0.0 && found.items[i].y_px <= height - 1);
        }
        bst_streak_finder_free(finder);
    }
}

/* Noise alone has no shape. */
static void nothing_to_find(void **state) {
    (void)state;
    static scene s;
    draw(&s, 0.0, 0.0);
    const bst_common_streak_options options = {.max_sources = 40, .least_snr = 15.0};
    bst_streak_finder *finder;
    bst_assert_ok(&s.ctx,
                  bst_streak_finder_create(&s.ctx, s.pixels, SIDE, SIDE, &options, &finder));
    assert_int_equal(bst_streak_finder_shapes(finder), 0);
    bst_streak_finder_free(finder);
}

/* A path of 1,002 samples is too long to be measured on several stars: its ends are not certain. */
static void ends_of_a_long_path(void **state) {
    (void)state;
    enum { WIDTH = 2100, HEIGHT = 60 };
    static float pixels[WIDTH * HEIGHT];
    bst_ctx ctx = {0};
    bst_rng_key key = bst_rng_make_key(4, 0, "test", "noise");
    for (uint64_t i = 0; i < WIDTH * HEIGHT; i++) {
        pixels[i] = (float)bst_rng_normal(key, i, 0);
    }
    for (int x = 40; x < 2040; x++) {
        double middle = 14.0 + 0.015 * x;
        for (int y = (int)middle - 5; y <= (int)middle + 5; y++) {
            pixels[y * WIDTH + x] += (float)(20.0 * exp(-(y - middle) * (y - middle) / 1.8));
        }
    }
    const bst_common_streak_options options = {.max_sources = 40, .least_snr = 15.0};
    bst_streak_finder *finder;
    bst_star_path found, points;
    double quality;
    bst_assert_ok(&ctx, bst_streak_finder_create(&ctx, pixels, WIDTH, HEIGHT, &options, &finder));
    assert_true(bst_streak_finder_shapes(finder) >= 1);
    bst_assert_ok(&ctx, bst_streak_finder_measure(&ctx, finder, 0, false, &found, &quality));
    assert_true(quality > 0.0 && found.count > 1000);
    /* points are certain to fit worse than the streak, but not than themselves */
    assert_true(bst_streak_finder_points_fit_worse(finder, quality));
    bst_assert_ok(&ctx, bst_streak_finder_measure(&ctx, finder, BST_STREAK_FINDER_POINT, false,
                                                  &points, &quality));
    assert_true(quality > 0.0 && points.count == 1);
    assert_true(!bst_streak_finder_points_fit_worse(finder, quality));
    bst_assert_close(found.margin[0], 0.0, 0.0);
    bst_assert_close(found.margin[1], 0.0, 0.0);
    bst_streak_finder_free(finder);
}

/* The cleaned image of pixels; to be freed. */
static bst_streak_finder *clean(scene *s) {
    const bst_common_streak_options options = {
        .max_sources = 4, .least_snr = 15.0, .known_path = true};
    bst_streak_finder *f;
    bst_assert_ok(&s->ctx, bst_streak_finder_create(&s->ctx, s->pixels, SIDE, SIDE, &options, &f));
    return f;
}

/* Mean and standard deviation in a box. */
static void moments(const bst_streak_finder *f, int x0, int x1, int y0, int y1, double out[2]) {
    double sum = 0.0, square = 0.0, n = (double)(x1 - x0) * (y1 - y0);
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            double v = (double)f->image[y * SIDE + x];
            sum += v;
            square += v * v;
        }
    }
    out[0] = sum / n;
    out[1] = sqrt(square / n - out[0] * out[0]);
}

/* Levels of columns and of rows are removed, noise becomes 1, and what no PSF makes is cleared. */
static void levels_of_columns_and_rows(void **state) {
    (void)state;
    static scene drawn, *s = &drawn;
    draw(s, 0.0, 0.0);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double level = 40.0 * uniform((uint64_t)x, 8) + 6.0 * uniform((uint64_t)y, 9);
            double noise = (double)s->pixels[y * SIDE + x] - 100.0 - 0.5 * x;
            s->pixels[y * SIDE + x] = (float)(3.0 * noise + level);
        }
    }
    s->pixels[5 * SIDE + 7] = NAN;
    s->pixels[50 * SIDE + 7] = -30000.0f;
    s->pixels[40 * SIDE + 30] += 300.0f; /* 100 sigma alone: hot */
    for (int k = 0; k < 2; k++) {
        s->pixels[80 * SIDE + 30 + k] += 300.0f; /* as much in two pixels: light */
        s->pixels[(120 + k) * SIDE + 30] += 300.0f;
    }
    bst_streak_finder *f = clean(s);
    double m[2];
    bst_assert_close(f->sigma, 3.0, 0.06); /* 57,600 pixels: 0.6 %, 1 sigma */
    for (int k = 0; k < SIDE; k++) {       /* medians of 240 are known to 0.08, means to 0.1 */
        moments(f, k, k + 1, 130, SIDE, m);
        bst_assert_close(m[0], 0.0, 0.6);
        moments(f, 40, SIDE, k, k + 1, m);
        bst_assert_close(m[0], 0.0, 0.6);
    }
    moments(f, 100, 240, 0, SIDE, m);
    bst_assert_close(m[1], 1.0, 0.02);
    assert_true(f->image[5 * SIDE + 7] == 0.0f && f->image[50 * SIDE + 7] == -5.0f);
    assert_true(f->image[40 * SIDE + 30] == 0.0f);
    for (int k = 0; k < 2; k++) {
        bst_assert_close((double)f->image[80 * SIDE + 30 + k], 100.0, 5.0);
        bst_assert_close((double)f->image[(120 + k) * SIDE + 30], 100.0, 5.0);
    }
    bst_streak_finder_free(f);
}

/* A glow of a corner, of unequal slopes, is removed between the middles of its cells, and noise
 * that is greater elsewhere is reduced; without a glow that stays as it is. */
static void glow_of_a_corner(void **state) {
    (void)state;
    static scene drawn, *s = &drawn;
    for (int glow = 0; glow < 2; glow++) {
        draw(s, 0.0, 0.0);
        for (int y = 0; y < SIDE; y++) {
            for (int x = 0; x < SIDE; x++) {
                float *at = &s->pixels[y * SIDE + x];
                double noise = (double)*at - 100.0 - 0.5 * x;
                noise = isfinite(noise) && fabs(noise) < 10.0 ? noise : 0.0;
                *at = (float)(noise * (x < 64 && y < 64 ? 2.0 : 1.0) +
                              glow * 0.5 * fmax(x - 150.0, 0.0) * fmax(y - 125.0, 0.0));
            }
        }
        bst_streak_finder *f = clean(s);
        double m[2], usual[2];
        moments(f, 16, 48, 16, 48, m);
        moments(f, 70, 140, 0, SIDE, usual);
        /* that of a cell is known to 8 %; the glow's steep slope counts as noise, so that there is
         * little of it left in its corner, a seventh of the frame */
        bst_assert_close(m[1] / usual[1], glow ? 1.0 : 2.0, 0.2);
        bst_assert_close(usual[1], 1.0, glow ? 0.15 : 0.05);
        for (int k = 0; k < 9; k++) {
            /* the glow is 400 to 2300 there; its noise by the quartile of a slope some hundreds */
            int x = 178 + 10 * (k % 3), y = 178 + 10 * (k / 3);
            moments(f, x - 2, x + 3, y - 2, y + 3, m);
            bst_assert_close(m[0], 0.0, glow ? 0.3 : 0.8);
        }
        bst_streak_finder_free(f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uneven_background),
        cmocka_unit_test(points),
        cmocka_unit_test(curved_streaks),
        cmocka_unit_test(streaks_at_the_edge),
        cmocka_unit_test(places_are_in_frames_of_any_shape),
        cmocka_unit_test(nothing_to_find),
        cmocka_unit_test(ends_of_a_long_path),
        cmocka_unit_test(levels_of_columns_and_rows),
        cmocka_unit_test(glow_of_a_corner),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
