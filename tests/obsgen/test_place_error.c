/* Position errors of faint points against the maxima of filtered noisy pixels. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "obsgen/model/crlb_table.h"
#include "obsgen/model/place_error.h"
#include "tests/obsgen/generator_scene.h"

static const double THRESHOLD = 5.1, MOST_BOUNDS = 2.5, SIGMA_PX = 1.2;
enum { HALF = 7, PATCH = 2 * HALF + 1 };

static double image_at(double x, double y) {
    return exp(-0.5 * (x * x + y * y) / (SIGMA_PX * SIGMA_PX));
}

/* Filter output at (x, y) from the middle of a patch, unit noise. */
static double output_at(double pixels[PATCH][PATCH], double x, double y) {
    double sum = 0.0, square = 0.0;
    for (int j = 0; j < PATCH; j++) {
        for (int i = 0; i < PATCH; i++) {
            double weight = image_at(i - HALF - x, j - HALF - y);
            sum += weight * pixels[j][i];
            square += weight * weight;
        }
    }
    return sum / sqrt(square);
}

/* Maximum of the output by steps that halve. */
static double climb(double pixels[PATCH][PATCH], double at[2]) {
    double best = output_at(pixels, at[0], at[1]);
    for (double step = 0.6; step > 0.02; step *= 0.5) {
        for (bool moved = true; moved;) {
            moved = false;
            for (int k = 0; k < 9; k++) {
                double x = at[0] + step * (k % 3 - 1), y = at[1] + step * (k / 3 - 1);
                double value = k == 4 ? best : output_at(pixels, x, y);
                if (value > best && hypot(x, y) < 3.0) {
                    best = value;
                    at[0] = x;
                    at[1] = y;
                    moved = true;
                }
            }
        }
    }
    return best;
}

/* RMS error per axis over the bound of sources of this SNR in filtered pixels. */
static double rms_in_pixels(double snr, int trials, bst_rng_key key) {
    double sum = 0.0, norm = sqrt(BST_PI) * SIGMA_PX;
    int found = 0;
    for (int n = 0; n < trials; n++) {
        double pixels[PATCH][PATCH], at[2] = {0.0, 0.0};
        for (int i = 0; i < PATCH * PATCH; i++) {
            double light = snr / norm * image_at(i % PATCH - HALF, i / PATCH - HALF);
            pixels[i / PATCH][i % PATCH] = light + bst_rng_normal(key, (uint64_t)n, (uint64_t)i);
        }
        if (climb(pixels, at) > THRESHOLD) {
            sum += 0.5 * (at[0] * at[0] + at[1] * at[1]);
            found++;
        }
    }
    return sqrt(sum / found) * snr / (sqrt(2.0) * SIGMA_PX);
}

/* RMS error per axis over the bound by the model, of sources between two SNRs whose number falls
 * with the square of the SNR; *core: as a calibration measures it. */
static double rms_by_model(const double snrs[2], int trials, bst_rng_key key, double *core) {
    double sum = 0.0, inside = 0.0;
    int found = 0, kept = 0;
    for (int n = 0; n < trials; n++) {
        double z[6];
        for (int k = 0; k < 6; k++) {
            z[k] = bst_rng_normal(key, (uint64_t)n, (uint64_t)k);
        }
        double part = bst_rng_uniform(key, (uint64_t)n, 100);
        double snr = 1.0 / (part / snrs[0] + (1.0 - part) / snrs[1]);
        double level = snr + z[5], error[2] = {z[0], z[1]};
        if (!(level > 0.5) || !(bst_place_error_bend(snr, level, z + 2, error) > THRESHOLD)) {
            continue;
        }
        for (int k = 0; k < 2; k++, found++) {
            sum += error[k] * error[k];
            if (fabs(error[k]) < MOST_BOUNDS) {
                inside += error[k] * error[k];
                kept++;
            }
        }
    }
    /* the normal law whose errors within MOST_BOUNDS have that mean square */
    double low = 0.1, high = 10.0;
    while (high - low > 1e-6) {
        double f = 0.5 * (low + high), c = MOST_BOUNDS / f;
        double square =
            f * f * (1.0 - 2.0 * c * exp(-0.5 * c * c) / sqrt(2.0 * BST_PI) / erf(c / sqrt(2.0)));
        low = square < inside / kept ? f : low;
        high = square < inside / kept ? high : f;
    }
    *core = 0.5 * (low + high);
    return sqrt(sum / found);
}

static void errors_are_those_of_maxima(void **state) {
    (void)state;
    const double snrs[3][2] = {{5.0, 5.0}, {6.0, 6.0}, {7.0, 7.0}};
    for (int i = 0; i < 3; i++) {
        double core;
        double pixels = rms_in_pixels(snrs[i][0], 2000, bst_rng_make_key(1, 0, "test", "pixels"));
        double model = rms_by_model(snrs[i], 40000, bst_rng_make_key(2, 0, "test", "m"), &core);
        print_message("         SNR %g: pixels %.3f, model %.3f of the bound, core %.3f\n",
                      snrs[i][0], pixels, model, core);
        /* 2000 trials: 1.6 % */
        bst_assert_close(model, pixels, 0.045);
    }
}

/* The nodes of a calibration have the sources that are nearest on a logarithmic scale; the first
 * one those down to where nothing is detected, the last one all brighter ones. */
static void cores_are_those_of_a_calibration(void **state) {
    (void)state;
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        const double *node = bst_obsgen_snrs + i;
        const double snrs[2] = {i == 0 ? 3.0 : sqrt(node[-1] * node[0]),
                                i == BST_OBSGEN_SNRS - 1 ? 1e3 : sqrt(node[0] * node[1])};
        double core;
        (void)rms_by_model(snrs, 40000, bst_rng_make_key(3, 0, "test", "core"), &core);
        print_message("         SNR %g: %.4f\n", *node, core);
        bst_assert_close(bst_place_error_core[i], core, 0.008);
    }
}

/* At SNR 7 a linear fit has 1.00 of the bound. */
static void faint_points_have_the_errors_of_maxima(void **state) {
    (void)state;
    scene s;
    bst_crlb_table bound;
    double sum = 0.0;
    int found = 0;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1.0;
    start(&s);
    fill(&s, 7.0);
    for (int f = 0; f < 12; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            if (r.items[i].item >= 0) {
                const bst_truth_item *t = &s.truth->items[r.items[i].item];
                double dx = r.items[i].detection.x_px - t->x_centroid_px;
                double dy = r.items[i].detection.y_px - t->y_centroid_px;
                sum += 0.5 * (dx * dx + dy * dy);
                found++;
            }
        }
    }
    bst_crlb_table_init(&bound, s.frame.sigma_px);
    double electrons = s.truth->items[0].electrons;
    double noise = electrons * bst_crlb_table_norm(&bound, 0.0) / 7.0;
    double ratio =
        sqrt(sum / found / bst_crlb_table_of(&bound, electrons, noise, 0.0).var_across_px2);
    print_message("         %d points: %.3f of the bound\n", found, ratio);
    bst_assert_close(ratio, 1.03, 0.02);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_are_those_of_maxima),
        cmocka_unit_test(cores_are_those_of_a_calibration),
        cmocka_unit_test(faint_points_have_the_errors_of_maxima),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
