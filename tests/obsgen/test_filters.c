/* Filters of a generated frame: the straight path nearest to a bent one, the output's noise beside
 * offsets of columns and rows, and the sky that bright stars leave, against sums of their own. */
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "tests/test_support.h"

enum { NODES = 9 };

/* A path that bends across a telemetry path which is not that of the stars; weights of the ends are
 * half. */
static void straight_path_and_what_it_leaves(void **state) {
    (void)state;
    for (int streaks = 0; streaks < 2; streaks++) {
        static bst_generator generator;
        bst_generator *g = &generator;
        double x[NODES], y[NODES];
        double sxu = 0.0, syu = 0.0, suu = 0.0, total = 0.0, across = 0.0, both = 0.0, fit = 0.0;
        *g = (bst_generator){.binning = 1, .sigma = 1.4, .onboard_sigma_px = 1.4};
        g->star_path = (bst_obsgen_path_px){streaks ? 3.0 : 0.0, streaks ? 4.0 : 0.0};
        g->streak = streaks ? 5.0 : 0.0;
        g->fit_bend_x = 0.1;
        g->fit_bend_y = -0.06;
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5;
            x[k] = 3.3 * u + 0.6 * (u * u - 1.0 / 12.0) + 0.3 * u * u * u;
            y[k] = 3.7 * u - 0.9 * (u * u - 1.0 / 12.0);
        }
        g->path_x = x;
        g->path_y = y;
        g->path = (bst_star_trail_path){x, y, NODES};
        bst_response response;
        const bst_response_side side = {NULL, 1.4};
        bst_response_set(&response, &side, &side, 1, 0.0, 0.0);
        const bst_generator_frame f = {.response = &response};
        bst_generator_set_response(g, &f);
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5, w = k % (NODES - 1) ? 1.0 : 0.5;
            sxu += w * x[k] * u;
            syu += w * y[k] * u;
            suu += w * u * u;
            total += w;
        }
        bst_assert_close(g->straight_path.dx, sxu / suu, 1e-12);
        bst_assert_close(g->straight_path.dy, syu / suu, 1e-12);
        for (int k = 0; k < NODES; k++) {
            double u = k / (NODES - 1.0) - 0.5, w = (k % (NODES - 1) ? 1.0 : 0.5) / total;
            double dx = x[k] - sxu / suu * u, dy = y[k] - syu / suu * u;
            double bend = streaks ? 1.5 * (2.0 * u) * (2.0 * u) - 0.5 : 0.0; /* of mean 0 */
            double off = streaks ? dy * 0.6 - dx * 0.8 : 0.0;
            across += w * off * off;
            both += w * 0.5 * (dx * dx + dy * dy);
            fit += w * 0.5 *
                   (pow(dx - bend * g->fit_bend_x, 2.0) + pow(dy - bend * g->fit_bend_y, 2.0));
        }
        bst_assert_close(g->path_rms_px, sqrt(fit), 1e-12);
        bst_response want = bst_response_widened(&response, streaks ? across : both);
        bst_assert_close(g->response.source.across_px, want.source.across_px, 1e-12);
        bst_assert_close(g->response.source.along_px, want.source.along_px, 1e-12);
        bst_assert_close(g->response.both.along_px, want.both.along_px, 1e-12);
        assert_true(want.source.across_px > response.source.across_px + 1e-3);
        bst_response fitted = bst_response_widened(&response, fit);
        double ratio = sqrt(fitted.source.across_px * fitted.source.along_px /
                            (response.source.across_px * response.source.along_px));
        bst_assert_close(g->widening, ratio, 1e-12);
        assert_false(g->uneven);
    }
}

/* Area about each star of SNR above 3 in which its output is, two pixels wider: a Gaussian with the
 * variance of filter and image, dilated by a square and drawn along its path. */
static void open_sky_between_stars(void **state) {
    (void)state;
    enum { STARS = 30 };
    for (int n = 0; n < 3; n++) {
        static bst_generator generator;
        generator_source sources[STARS] = {0};
        bst_generator *g = &generator;
        double covered = 0.0, pixels = n == 1 ? 200.0 * 100.0 : 80.0 * 100.0;
        *g = (bst_generator){.width = n == 1 ? 200 : 80,
                             .height = 100,
                             .cross_sigma = 1.5,
                             .threshold = 5.0,
                             .sources = sources,
                             .source_count = STARS};
        double least = bst_generator_looks_from(g);
        for (int i = 0; i < STARS; i++) {
            sources[i].amplitude = i < 25 ? (n == 2 ? 1e3 : 1.0) * (least + 1.0 + i) : 2.9;
            sources[i].length = i % 4;
            if (i < 25) {
                double r = 3.0 * sqrt(log(sources[i].amplitude / 3.0));
                /* a circle and a square of 4 px: area, half the product of outlines, area */
                covered +=
                    BST_PI * r * r + 4.0 * 4.0 * r + 16.0 + 2.0 * (r + 2.0) * sources[i].length;
            }
        }
        double share = bst_generator_open_share(g);
        /* 25 maxima: crowded in 8000 px, not in 20,000 */
        bst_assert_close(share, n == 1 ? 1.0 : fmax(exp(-covered / pixels), 0.02), 1e-12);
    }
}

/* Sum over `axis` of the squares of a filter's sums across it, over the sum of its squares: a
 * Gaussian that is drawn along (dx, dy), on a grid. */
static double response_to_offsets(double sigma, double dx, double dy, int axis) {
    enum { SIDE = 120, PIECES = 100 };
    static double p[SIDE][SIDE];
    double step = 0.15, squares = 0.0, sums = 0.0;
    memset(p, 0, sizeof p);
    for (int k = 0; k < PIECES; k++) {
        double u = (k + 0.5) / PIECES - 0.5;
        for (int i = 0; i < SIDE * SIDE; i++) {
            double x = step * (i % SIDE - 0.5 * (SIDE - 1)) - u * dx;
            double y = step * ((double)(i / SIDE) - 0.5 * (SIDE - 1)) - u * dy;
            p[i / SIDE][i % SIDE] += exp(-0.5 * (x * x + y * y) / (sigma * sigma));
        }
    }
    for (int i = 0; i < SIDE; i++) {
        double sum = 0.0;
        for (int k = 0; k < SIDE; k++) {
            squares += p[i][k] * p[i][k];
            sum += axis ? p[i][k] : p[k][i];
        }
        sums += step * sum * sum;
    }
    return sums / squares;
}

/* Offsets of columns and rows are alike along them: a filter that is long along columns sums those
 * of few columns. A level that is subtracted from each column takes their offsets away, and one
 * row's share of the white noise. */
static void noise_of_columns_and_rows(void **state) {
    (void)state;
    const double sigma = 1.2, path[2] = {2.0, 4.5};
    for (int levels = 0; levels < 2; levels++) {
        static bst_generator generator;
        bst_generator *g = &generator;
        bst_camera camera = {
            .width_px = 100, .height_px = 100, .gain_e_per_dn = 2.0, .read_noise_e = 5.0};
        camera.detector.column_offset_rms_e = 2.0;
        camera.detector.row_offset_rms_e = 1.5;
        camera.detector.row_noise_e = 1.0;
        camera.detector.flicker_noise_e = 0.5;
        *g = (bst_generator){.width = 100,
                             .height = 80,
                             .binning = 1,
                             .camera = &camera,
                             .noise_e = 6.0,
                             .excess = 1.0,
                             .open_share = 1.0,
                             .filter_sigma = sigma,
                             .cross_sigma = sigma * sqrt(2.0),
                             .levels_columns = levels,
                             .streak = hypot(path[0], path[1]),
                             .star_path = {path[0], path[1]},
                             .settings = {.false_alarms_per_frame = 1.0}};
        g->response.maxima_sigma_px = sigma;
        g->response.filter.across_px = g->response.filter.along_px = sigma;
        bst_crlb_table_init(&g->bound, sigma);
        bst_generator_set_filters(g);
        double columns = levels ? -1.0 / 80.0 : 4.0 / 36.0, rows = (2.25 + 1.0 + 0.25) / 36.0;
        bst_assert_close(bst_generator_column_variance(g), levels ? 0.0 : 4.0, 0.0);
        bst_assert_close(g->white_share, 1.0 - columns - rows, 1e-12);
        for (int k = 0; k < 2; k++) {
            double dx = k ? path[0] : 0.0, dy = k ? path[1] : 0.0;
            double want = 1.0 - columns - rows + columns * response_to_offsets(sigma, dx, dy, 0) +
                          rows * response_to_offsets(sigma, dx, dy, 1);
            bst_assert_close(g->filters[k].variance, want, 1e-3 * want); /* of 100 pieces */
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(straight_path_and_what_it_leaves),
                                       cmocka_unit_test(open_sky_between_stars),
                                       cmocka_unit_test(noise_of_columns_and_rows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
