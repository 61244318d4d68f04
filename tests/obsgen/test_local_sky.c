/* Background and noise that long streaks are part of, against clipped pixels. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "obsgen/model/local_sky.h"
#include "tests/test_support.h"

enum { SIDE = 256, MESH = 64, TRIALS = 60 };
static const double SIGMA = 0.9;

static void begin(bst_local_sky *sky) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_local_sky_begin(&ctx, sky, SIDE, SIDE, MESH, SIGMA));
}

/* Adds to means a share of mean and deviation of a mesh's pixels within three deviations of it, in
 * noises of a pixel, with a line through it, less those of the same pixels without. */
static void add_clipped(double height, int trial, double means[2]) {
    const bst_rng_key key = {{5, (uint32_t)trial}};
    for (int lit = 0; lit < 2; lit++) {
        double level = 0.0, noise = 1.5;
        for (int pass = 0; pass < 5; pass++) {
            double sum = 0.0, square = 0.0, count = 0.0;
            for (int k = 0; k < MESH * MESH; k++) {
                double off = k / MESH - 30.3;
                double light =
                    height / (SIGMA * sqrt(2.0 * BST_PI)) * exp(-0.5 * off * off / (SIGMA * SIGMA));
                double value = bst_rng_normal(key, 0, (uint64_t)k) + (lit ? light : 0.0);
                if (fabs(value - level) < 3.0 * noise) {
                    sum += value;
                    square += value * value;
                    count += 1.0;
                }
            }
            level = sum / count;
            /* of a normal distribution cut at 3 deviations */
            noise = sqrt((square / count - level * level) / 0.97334);
        }
        means[0] += (lit ? level : -level) / TRIALS;
        means[1] += (lit ? noise : -noise) / TRIALS;
    }
}

static void the_level_is_that_of_clipped_pixels(void **state) {
    (void)state;
    const double heights[] = {2.0, 6.0, 20.0};
    for (int h = 0; h < 3; h++) {
        bst_local_sky sky = {0};
        begin(&sky);
        for (int x = 0; x < SIDE; x++) { /* the same line in all four of a row's meshes */
            for (int y = 30; y < SIDE; y += MESH) {
                bst_local_sky_add(&sky, x, y, heights[h], 1.0);
            }
        }
        bst_local_sky_settle(&sky, 1.0, 1.0);
        double level, noise, mean[2] = {0.0, 0.0};
        bst_local_sky_at(&sky, 100.0, 100.0, &level, &noise);
        for (int i = 0; i < TRIALS; i++) {
            add_clipped(heights[h], i, mean);
        }
        /* noise takes pixels over the clip, and the clip grows with what is inside of it: to a
         * quarter of the level and 0.6 of the noise, and 0.0005 from noise here */
        bst_assert_close(level, mean[0], 0.0005 + 0.25 * mean[0]);
        bst_assert_close(noise - 1.0, mean[1], 0.0005 + 0.6 * mean[1]);
        bst_local_sky_free(&sky);
    }
}

static void only_neighbours_that_agree_are_averaged(void **state) {
    (void)state;
    double level, noise;
    for (int strong = 0; strong < 2; strong++) {
        bst_local_sky sky = {0};
        begin(&sky);
        double height = strong ? 12.0 : 1.0;
        for (int k = 0; k < MESH; k++) {
            bst_local_sky_add(&sky, MESH + k, MESH + MESH / 2, height, strong ? 6.0 : 1.0);
        }
        bst_local_sky_settle(&sky, 1.0, 1.0);
        double middle = 1.5 * MESH - 0.5;
        bst_local_sky_at(&sky, middle, middle, &level, &noise);
        if (strong) { /* differs from all its neighbours, and they keep theirs */
            assert_true(level > 0.2);
            bst_local_sky_at(&sky, 3.5 * MESH, 3.5 * MESH, &level, &noise);
            bst_assert_close(level, 0.0, 1e-12);
        } else { /* one of nine, exact but for floats */
            bst_assert_close(level, (double)MESH / (MESH * MESH) / 9.0, 1e-6);
        }
        assert_true(noise >= 1.0);
        bst_local_sky_free(&sky);
    }
}

static void between_middles_it_is_straight_and_beyond_them_constant(void **state) {
    (void)state;
    bst_local_sky sky = {0};
    begin(&sky);
    for (int j = 0; j < sky.rows; j++) {
        for (int i = 0; i < sky.columns; i++) {
            sky.level[j * sky.columns + i] = (float)(i + 10 * j);
            sky.noise[j * sky.columns + i] = 1.0f;
        }
    }
    double level, noise, middle = 0.5 * MESH - 0.5;
    bst_local_sky_at(&sky, middle + 0.25 * MESH, middle + 1.5 * MESH, &level, &noise);
    bst_assert_close(level, 0.25 + 15.0, 1e-6);
    bst_local_sky_at(&sky, 0.0, 0.0, &level, &noise);
    bst_assert_close(level, 0.0, 1e-6);
    bst_local_sky_at(&sky, SIDE - 1.0, SIDE - 1.0, &level, &noise);
    bst_assert_close(level, 33.0, 1e-6);
    /* pixel after pixel as one by one */
    bst_local_sky_cell cell = {.column = -1};
    for (int k = 0; k < SIDE; k++) {
        double same_level, same_noise;
        bst_local_sky_next(&sky, &cell, k, SIDE - 1 - k / 3, &same_level, &same_noise);
        bst_local_sky_at(&sky, k, SIDE - 1 - k / 3, &level, &noise);
        assert_true(level == same_level && noise == same_noise);
    }
    bst_local_sky_free(&sky);
    /* a frame smaller than a mesh is one */
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_local_sky_begin(&ctx, &sky, 20, 30, MESH, SIGMA));
    bst_local_sky_add(&sky, 3, 4, 4.0, 10.0);
    bst_local_sky_settle(&sky, 1.0, 1.0);
    bst_local_sky_at(&sky, 10.0, 10.0, &level, &noise);
    bst_assert_close(level, 40.0 / 600.0, 1e-6);
    bst_local_sky_free(&sky);
}

/* Light that decreases as the wings of a diffraction pattern, in pixel noises. */
static double wings(const void *user, double distance_px) {
    return *(const double *)user / pow(fmax(distance_px, 0.5), 3.0);
}

/* Clipped mean and deviation of a mesh with a star in its middle, corrected for the clip, up to
 * light by which the clip widens by a third. */
static void the_level_about_a_star_contains_its_wings(void **state) {
    (void)state;
    const double strengths[] = {100.0, 400.0, 1200.0, 9000.0};
    for (int n = 0; n < 4; n++) {
        bst_ctx ctx = {0};
        bst_local_sky sky = {0};
        begin(&sky);
        bst_assert_ok(&ctx, bst_local_sky_begin_wings(&ctx, &sky));
        /* a star in the middle of each mesh, so that meshes are equal */
        for (int k = 0; k < 16; k++) {
            bst_local_sky_add_wings(&sky, 31.3 + 64.0 * (k % 4), 31.6 + 64.0 * (k / 4), 31.0, wings,
                                    &strengths[n]);
        }
        bst_local_sky_settle_wings(&sky, 0.0);
        double level, noise, mean[2] = {0.0, 0.0};
        bst_local_sky_at(&sky, 100.0, 100.0, &level, &noise);
        for (int trial = 0; trial < TRIALS; trial++) {
            const bst_rng_key key = {{6, (uint32_t)trial}};
            double middle = 0.0, deviation = 1.5;
            for (int pass = 0; pass < 6; pass++) {
                double sum = 0.0, square = 0.0, count = 0.0;
                for (int k = 0; k < MESH * MESH; k++) {
                    double r = hypot(k % MESH - 31.3, k / MESH - 31.6);
                    double value = bst_rng_normal(key, 0, (uint64_t)k) +
                                   (r <= 31.0 ? wings(&strengths[n], r) : 0.0);
                    if (fabs(value - middle) < 3.0 * deviation) {
                        sum += value;
                        square += value * value;
                        count += 1.0;
                    }
                }
                /* of a normal distribution cut at 3 deviations */
                middle = sum / count;
                deviation = sqrt((square / count - middle * middle) / 0.97334);
            }
            mean[0] += middle / TRIALS;
            mean[1] += deviation / TRIALS;
        }
        print_message("         %g: level %.4f, pixels %.4f; noise %.4f, %.4f\n", strengths[n],
                      level, mean[0], noise, mean[1]);
        /* 60 meshes: three deviations of 1/64/sqrt(60) = 0.002 */
        bst_assert_close(level, mean[0], 0.006 + 0.02 * mean[0]);
        bst_assert_close(noise, mean[1], 0.006 + 0.02 * (mean[1] - 1.0));
        bst_local_sky_free(&sky);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_level_about_a_star_contains_its_wings),
        cmocka_unit_test(the_level_is_that_of_clipped_pixels),
        cmocka_unit_test(only_neighbours_that_agree_are_averaged),
        cmocka_unit_test(between_middles_it_is_straight_and_beyond_them_constant),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
