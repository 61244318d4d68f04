/* What becomes of sources whose light overlaps, at slants and in binned pixels: outputs of filters
 * by integrals over paths, and places of single fits by fits on rendered pixels. */
#include "obsgen/generator_internal.h"
#include "tests/obsgen/generator_scene.h"

/* Light of a Gaussian drawn along (dx, dy) about (x, y) in the pixel (i, j). */
static double light_at(int i, int j, double x, double y, double dx, double dy, double sigma) {
    enum { PARTS = 60 };
    double root = sigma * sqrt(2.0), sum = 0.0;
    int parts = dx != 0.0 || dy != 0.0 ? PARTS : 1;
    for (int n = 0; n < parts; n++) {
        double t = (n + 0.5) / parts - 0.5, u = i - x - t * dx, v = j - y - t * dy;
        sum += 0.25 * (erf((u + 0.5) / root) - erf((u - 0.5) / root)) *
               (erf((v + 0.5) / root) - erf((v - 0.5) / root)) / parts;
    }
    return sum;
}

/* Integral over two paths of a Gaussian of variance `variance` of the distance of their points, the
 * second path displaced by (x, y); over that of two like the first in one place. */
static double overlap_of(double x, double y, const double a[2], const double b[2],
                         double variance) {
    enum { PARTS = 160 };
    double sum = 0.0, whole = 0.0;
    for (int i = 0; i < PARTS; i++) {
        for (int k = 0; k < PARTS; k++) {
            double s = (i + 0.5) / PARTS - 0.5, t = (k + 0.5) / PARTS - 0.5;
            double u = x + t * b[0] - s * a[0], v = y + t * b[1] - s * a[1];
            double p = (t - s) * a[0], q = (t - s) * a[1];
            sum += exp(-0.5 * (u * u + v * v) / variance);
            whole += exp(-0.5 * (p * p + q * q) / variance);
        }
    }
    return sum / whole;
}

static const bst_generator *frame_of(scene *s) {
    run(s, 1);
    return s->generator;
}

/* Index of the source of a truth item. */
static int source_of(const scene *s, int item) {
    for (int i = 0; i < s->generator->source_count; i++) {
        if (s->generator->sources[i].item == item) {
            return i;
        }
    }
    fail_msg("no source of item %d", item);
    return -1;
}

static void draw_as_streak(bst_truth_item *item, double dx, double dy) {
    item->x_start_px = item->x_mid_px - 0.5 * dx;
    item->x_end_px = item->x_mid_px + 0.5 * dx;
    item->y_start_px = item->y_mid_px - 0.5 * dy;
    item->y_end_px = item->y_mid_px + 0.5 * dy;
}

/* The filter output of a source beside it, relative to its own: along its path and across it, in
 * sensor pixels and in binned ones. */
static void outputs_beside_a_source(void **state) {
    (void)state;
    const double path[2] = {12.0, 9.0}, none[2] = {0.0, 0.0};
    const double places[][2] = {{1.0, 0.4},  {-0.7, 1.3}, {4.0, 3.0},
                                {-1.2, 1.6}, {6.4, 4.8},  {2, -5}};
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 4; k++) {
        int b = 1 + k / 2;
        bool moves = k % 2 == 1;
        s.truth->count = 0;
        s.frame.binning = b;
        s.frame.streak_dx_px = moves ? path[0] : 0.0;
        s.frame.streak_dy_px = moves ? path[1] : 0.0;
        bst_truth_item *item = add_source(&s, 1, 300.0, 500.0, electrons_of(&s, 60.0));
        if (moves) {
            draw_as_streak(item, path[0], path[1]);
        }
        const bst_generator *g = frame_of(&s);
        const generator_source *a = &g->sources[0];
        double variance = 2.0 * (s.frame.sigma_px * s.frame.sigma_px / b / b + 1.0 / 12.0);
        const double way[2] = {path[0] / b, path[1] / b};
        for (size_t n = 0; n < sizeof places / sizeof *places; n++) {
            double dx = places[n][0] / b, dy = places[n][1] / b;
            generator_source at = {.x = a->x + dx, .y = a->y + dy};
            double want = moves ? overlap_of(dx, dy, way, way, variance)
                                : overlap_of(dx, dy, none, none, variance);
            /* Gaussians for pixels, and a table of the law along a streak */
            bst_assert_close(bst_generator_overlap(g, a, &at), want, 0.01);
        }
    }
    close_scene(&s);
}

/* A maximum has the light of its neighbours on it; of two that cannot be separated the brighter one
 * is found, and the other belongs to it. */
static void maxima_have_their_neighbours_light(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double e100 = electrons_of(&s, 100.0),
           sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    const double offset[3][2] = {{3.1, 2.6}, {-0.5, 0.8}, {-3.5, 2.9}}, part[3] = {0.6, 0.2, 0.4};
    add_source(&s, 10, 300.2, 400.4, e100);
    for (uint32_t k = 0; k < 3; k++) {
        add_source(&s, 11 + k, 300.2 + offset[k][0], 400.4 + offset[k][1], part[k] * e100);
    }
    const bst_generator *g = frame_of(&s);
    const generator_source *first = &g->sources[source_of(&s, 0)];
    double peak = first->amplitude;
    for (int k = 0; k < 3; k++) {
        double d2 = offset[k][0] * offset[k][0] + offset[k][1] * offset[k][1];
        const generator_source *o = &g->sources[source_of(&s, 1 + k)];
        bst_assert_close(o->amplitude / first->amplitude, part[k], 1e-5); /* shares as float */
        peak += o->amplitude * exp(-0.25 * d2 / sigma2);
        assert_true(o->found == (k != 1));
        assert_int_equal(o->head, k == 1 ? source_of(&s, 0) : -1);
    }
    assert_true(first->found && first->head == -1);
    bst_assert_close(first->peak / peak, 1.0, 5e-3); /* Gaussians for pixels */
    close_scene(&s);
}

/* Least squares with the weights 1 / (noise + model): x, y and flux of one point fitted to the
 * light on a square of pixels about (cx, cy), and for a bright one flux times widening of the
 * variance, to first order. As in images, gradients are those without widening. */
typedef struct pixel_fit {
    double x, y, flux, widening;
} pixel_fit;

enum { HALF = 4, STAMP = 2 * HALF + 1 };

static pixel_fit fit_point(double light[STAMP][STAMP], int cx, int cy, double sigma, double noise_e,
                           bool bright, pixel_fit at) {
    const double h = 1e-4, wider = 0.01;
    int n = bright ? 4 : 3;
    for (int round = 0; round < 60; round++) {
        double a[4][5] = {{0.0}};
        for (int k = STAMP * (cy < HALF ? HALF - cy : 0); k < STAMP * STAMP; k++) {
            int x = cx + k % STAMP - HALF, y = cy + k / STAMP - HALF;
            double p = light_at(x, y, at.x, at.y, 0, 0, sigma);
            double by_variance = (light_at(x, y, at.x, at.y, 0, 0, sigma * sqrt(1.0 + wider)) - p) /
                                 (wider * sigma * sigma);
            const double g[4] = {at.flux * (light_at(x, y, at.x + h, at.y, 0, 0, sigma) - p) / h,
                                 at.flux * (light_at(x, y, at.x, at.y + h, 0, 0, sigma) - p) / h, p,
                                 by_variance};
            double model = at.flux * (p + at.widening * by_variance);
            double weight = 1.0 / (noise_e * noise_e + fmax(model, 0.0));
            for (int r = 0; r < n; r++) {
                for (int c = 0; c < n; c++) {
                    a[r][c] += weight * g[r] * g[c];
                }
                a[r][4] += weight * g[r] * (light[k / STAMP][k % STAMP] - model);
            }
        }
        for (int r = 0; r < n; r++) { /* Gauss-Jordan */
            for (int o = 0; o < n; o++) {
                double factor = o == r ? 0.0 : a[o][r] / a[r][r];
                for (int c = 0; c < 5; c++) {
                    a[o][c] -= factor * a[r][c];
                }
            }
        }
        double widened = at.flux * at.widening;
        at.x += 0.5 * a[0][4] / a[0][0];
        at.y += 0.5 * a[1][4] / a[1][1];
        at.flux += 0.5 * a[2][4] / a[2][2];
        widened += bright ? 0.5 * a[3][4] / a[3][3] : 0.0;
        at.widening = widened / at.flux;
    }
    return at;
}

/* Two and three points that are seen as one, apart at slants, in pixels of one and of two: where
 * the fit of one point on rendered pixels lands, mean over places in the pixel. */
static void blends_lie_where_a_single_fit_does(void **state) {
    (void)state;
    const struct {
        double snr, dx, dy, part, dx2, dy2, part2;
    } cases[] = {{10, 1.2, -0.6, 0.3, 0, 0, 0},
                 {10, -0.5, 1.3, 0.5, 0, 0, 0},
                 {300, 1.1, 0.9, 0.2, 0, 0, 0},
                 {300, -1.2, -0.5, 0.3, 0.4, 1.2, 0.15},
                 {40, 0.3, -1.5, 0.4, 1, 0, 0.2}};
    scene s;
    open_scene(&s);
    start(&s);
    for (int b = 1; b <= 2; b++) {
        /* as close for the image's width: sqrt(sigma^2 + b^2 / 12) */
        double sigma2 = s.frame.sigma_px * s.frame.sigma_px;
        double wide = sqrt((sigma2 + b * b / 12.0) / (sigma2 + 1.0 / 12.0));
        for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
            enum { PHASES = 3 };
            double flux = electrons_of(&s, cases[k].snr), moved[2][3] = {{0.0}};
            for (int phase = 0; phase < PHASES * PHASES; phase++) {
                double x = 300.5 + b * ((phase % PHASES + 0.5) / PHASES - 0.5);
                double y = 420.5 + b * ((phase / PHASES + 0.5) / PHASES - 0.5);
                const double at[3][3] = {
                    {x, y, 1.0},
                    {x + wide * cases[k].dx, y + wide * cases[k].dy, cases[k].part},
                    {x + wide * cases[k].dx2, y + wide * cases[k].dy2, cases[k].part2}};
                int count = cases[k].part2 > 0.0 ? 3 : 2, cx = 0, cy = 0;
                s.truth->count = 0;
                s.frame.binning = b;
                for (int n = 0; n < count; n++) {
                    add_source(&s, 1 + (uint32_t)n, at[n][0], at[n][1], flux * at[n][2]);
                }
                const bst_generator *g = frame_of(&s);
                int i = source_of(&s, 0);
                for (int n = 0; n < count; n++) { /* whatever the noise did */
                    s.generator->sources[source_of(&s, n)].found = n == 0;
                    s.generator->sources[source_of(&s, n)].head = n == 0 ? -1 : i;
                }
                double px = g->sources[i].x, py = g->sources[i].y; /* read-out pixels */
                bst_assert_close(px, (x - 0.5 * (b - 1)) / b, 1e-9);
                bst_assert_close(py, (y - 0.5 * (b - 1)) / b, 1e-9);
                double light[STAMP][STAMP] = {{0.0}}, sigma = s.frame.sigma_px / b;
                cx = (int)lround(px);
                cy = (int)lround(py);
                for (int n = 0; n < count * STAMP * STAMP; n++) {
                    const double *p = at[n / (STAMP * STAMP)];
                    int u = n % STAMP, v = n / STAMP % STAMP;
                    light[v][u] += flux * p[2] *
                                   light_at(cx + u - HALF, cy + v - HALF, px + (p[0] - x) / b,
                                            py + (p[1] - y) / b, 0, 0, sigma);
                }
                pixel_fit fit =
                    fit_point(light, cx, cy, sigma, g->noise_e, g->sources[i].peak > 20.0,
                              (pixel_fit){px, py, flux, 0.0});
                generator_blend blend = bst_generator_blend_of(g, i);
                const double got[2][3] = {{blend.x - px, blend.y - py, blend.flux_e / flux - 1.0},
                                          {fit.x - px, fit.y - py, fit.flux / flux - 1.0}};
                for (int n = 0; n < 6; n++) {
                    moved[n / 3][n % 3] += got[n / 3][n % 3] / (PHASES * PHASES);
                }
                assert_true(!blend.near && !blend.drawn && blend.widen == 1.0);
            }
            double far = hypot(moved[1][0], moved[1][1]);
            assert_true(far > 0.1);
            /* a Gaussian in the place of pixels, a circle of them in that of a square: for pixels
             * of two sigma, 7 % */
            bst_assert_close(moved[0][0], moved[1][0], 0.002 + (b > 1 ? 0.07 : 0.03) * far);
            bst_assert_close(moved[0][1], moved[1][1], 0.002 + (b > 1 ? 0.07 : 0.03) * far);
            bst_assert_close(moved[0][2], moved[1][2], 0.16 * moved[1][2]);
        }
    }
    close_scene(&s);
}

/* Of a star beyond the edge the part on the frame counts, as a point in its centroid. */
static void light_beyond_the_edge_is_not_fitted(void **state) {
    (void)state;
    /* y of a star on the frame; one as bright is beyond the edge, so far to the right and above */
    const double places[][3] = {{0.2, 2.6, 1.3}, {0.7, 2.9, 1.8}, {0.4, 3.4, 1.1}};
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 3; k++) {
        double x = 300.2, y = places[k][0], dx = places[k][1], dy = -(y + 0.5) - places[k][2];
        double flux = electrons_of(&s, 140.0), light[STAMP][STAMP], sigma = s.frame.sigma_px;
        s.truth->count = 0;
        add_source(&s, 1, x, y, flux);
        add_source(&s, 2, x + dx, y + dy, flux);
        frame_of(&s);
        int i = source_of(&s, 0), cy = (int)lround(y);
        s.generator->sources[source_of(&s, 1)].found = false;
        s.generator->sources[source_of(&s, 1)].head = i;
        for (int n = 0; n < STAMP * STAMP; n++) {
            int u = 300 + n % STAMP - HALF, v = cy + n / STAMP - HALF;
            light[n / STAMP][n % STAMP] = flux * (light_at(u, v, x, y, 0, 0, sigma) +
                                                  light_at(u, v, x + dx, y + dy, 0, 0, sigma));
        }
        pixel_fit at = {x, y, flux, 0.0};
        pixel_fit fit = fit_point(light, 300, cy, sigma, s.generator->noise_e, true, at);
        generator_blend blend = bst_generator_blend_of(s.generator, i);
        bst_assert_close(hypot(blend.x - fit.x, blend.y - fit.y), 0.0, 0.12);
        bst_assert_close(blend.flux_e / fit.flux, 1.0, 0.1);
    }
    close_scene(&s);
}

/* Two sources that are both detected and fitted together: the part of their images that they share
 * is undetermined. */
static void neighbours_widen_each_other(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double flux = electrons_of(&s, 100.0),
           sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    add_source(&s, 1, 300.2, 400.4, flux);
    add_source(&s, 2, 300.2 + 2.2, 400.4 - 1.6, flux);
    add_source(&s, 3, 300.2 - 2.4, 400.4 - 1.8, flux);
    const bst_generator *g = frame_of(&s);
    for (int n = 0; n < 3; n++) {
        s.generator->sources[source_of(&s, n)].found = true;
        s.generator->sources[source_of(&s, n)].head = -1;
    }
    double first = exp(-0.25 * (2.2 * 2.2 + 1.6 * 1.6) / sigma2);
    double second = exp(-0.25 * (2.4 * 2.4 + 1.8 * 1.8) / sigma2);
    generator_blend b = bst_generator_blend_of(g, source_of(&s, 0));
    assert_true(b.near);
    bst_assert_close(b.widen, 1.0 / (1.0 - first * first) / (1.0 - second * second), 2e-3);
    bst_assert_close(b.flux_e, flux, 1e-9 * flux);
    bst_assert_close(b.x, g->sources[source_of(&s, 0)].x, 1e-12);
    bst_assert_close(b.y, g->sources[source_of(&s, 0)].y, 1e-12);
    close_scene(&s);
}

/* A detection beside the fitted pixels, in any of four directions, is none that is fitted with
 * them. */
static void far_neighbours_are_fitted_alone(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 8; k++) {
        /* half a stamp: 3.6 sigma rounded up and 1.5 px, 5.5 px */
        double away = k < 4 ? 6.5 : 4.5, x = away * (k % 4 == 0 ? 1 : k % 4 == 1 ? -1 : 0);
        double y = away * (k % 4 == 2 ? 1 : k % 4 == 3 ? -1 : 0);
        s.truth->count = 0;
        add_source(&s, 1, 300.2, 400.4, electrons_of(&s, 100.0));
        add_source(&s, 2, 300.2 + x, 400.4 + y, electrons_of(&s, 90.0));
        frame_of(&s);
        int i = source_of(&s, 0);
        assert_true(s.generator->sources[i].found && s.generator->sources[source_of(&s, 1)].found);
        assert_true(bst_generator_blend_of(s.generator, i).near == (k >= 4));
    }
    /* streaks along x: beside them no farther than points are, along them by half their length more
     */
    s.frame.streak_dx_px = 14.0;
    const double places[6][2] = {{2.0, 6.5},   {2.0, -6.5}, {13.5, 1.0},
                                 {-13.5, 1.0}, {12.0, 1.0}, {2.0, -4.5}};
    for (int k = 0; k < 6; k++) {
        s.truth->count = 0;
        draw_as_streak(add_source(&s, 1, 300.2, 400.4, electrons_of(&s, 200.0)), 14.0, 0.0);
        draw_as_streak(
            add_source(&s, 2, 300.2 + places[k][0], 400.4 + places[k][1], electrons_of(&s, 190.0)),
            14.0, 0.0);
        frame_of(&s);
        int i = source_of(&s, 0), o = source_of(&s, 1);
        s.generator->sources[i].found = s.generator->sources[o].found = true;
        s.generator->sources[i].head = s.generator->sources[o].head = -1;
        assert_true(bst_generator_blend_of(s.generator, i).near == (k >= 4));
    }
    close_scene(&s);
}

/* Of two that are one, that one is seen whose pixel is brighter: here the fainter, in the middle of
 * its pixel, while the other lies on a corner of four. */
static void the_brighter_pixel_is_the_one_seen(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 4; k++) {
        double x = k % 2 ? 1.0 : -1.0, y = k / 2 ? 1.0 : -1.0;
        s.truth->count = 0;
        add_source(&s, 1, 300.0 + 0.499 * x, 417.0 + 0.499 * y, electrons_of(&s, 210.0));
        add_source(&s, 2, 300.0 + x, 417.0 + y, electrons_of(&s, 200.0));
        const bst_generator *g = frame_of(&s);
        int corner = source_of(&s, 0), middle = source_of(&s, 1);
        assert_true(g->sources[middle].found && !g->sources[corner].found);
        assert_int_equal(g->sources[corner].head, middle);
    }
    close_scene(&s);
}

/* A bright pair that is longer than a point is fitted by a streak, whose middle is the centroid of
 * its light; what lies beyond its ends is left out. */
static void long_pairs_have_their_centroid(void **state) {
    (void)state;
    const struct {
        double dx, dy, part;
        bool streak;
    } cases[] = {{2.5, 1.7, 0.8, true},
                 {-1.8, 2.4, 0.7, true},
                 {-2.5, -1.7, 0.8, true},
                 {1.4, -2.6, 0.9, true},
                 {1.0, 0.7, 0.8, false}};
    scene s;
    open_scene(&s);
    start(&s);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        double flux = electrons_of(&s, 150.0), part = cases[k].part;
        s.truth->count = 0;
        add_source(&s, 1, 300.2, 400.4, flux);
        add_source(&s, 2, 300.2 + cases[k].dx, 400.4 + cases[k].dy, flux * part);
        /* on the other side, and too far */
        add_source(&s, 3, 300.2 + (cases[k].dx > 0.0 ? -9.5 : 9.5),
                   400.4 + (cases[k].dy > 0.0 ? -4.0 : 4.0), flux * 0.3);
        const bst_generator *g = frame_of(&s);
        int i = source_of(&s, 0), o = source_of(&s, 1), far = source_of(&s, 2);
        s.generator->sources[far].found = false;
        s.generator->sources[far].head = i;
        s.generator->sources[i].found = true;
        s.generator->sources[o].found = false;
        s.generator->sources[i].head = -1;
        s.generator->sources[o].head = i;
        generator_blend b = bst_generator_blend_of(g, i);
        double x = part / (1.0 + part) * cases[k].dx, y = part / (1.0 + part) * cases[k].dy;
        bool centroid = hypot(b.x - g->sources[i].x - x, b.y - g->sources[i].y - y) < 1e-9;
        assert_true(centroid == cases[k].streak);
        if (centroid) {
            bst_assert_close(b.flux_e, flux * (1.0 + part), 1e-9 * flux);
        }
    }
    close_scene(&s);
}

/* The nearest part of a long streak that passes a star at a distance of 1.2 px draws its fit as it
 * does on rendered pixels. */
static void a_long_streak_draws_a_star(void **state) {
    (void)state;
    /* so faint that both together are not fitted as a streak */
    const double paths[2][2] = {{24.0, 32.0}, {-35.0, 20.0}}, away = 1.2, ray = 2.5;
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 4; k++) {
        const double *path = paths[k / 2];
        double length = hypot(path[0], path[1]), c = path[0] / length, n = path[1] / length;
        double side = k % 2 ? -away : away, flux = electrons_of(&s, 60.0), along = 7.0;
        double x = 300.3, y = 400.4;
        s.truth->count = 0;
        add_source(&s, 1, x, y, flux);
        bst_truth_item *object =
            add_source(&s, 2, x + along * c - side * n, y + along * n + side * c, ray * flux);
        object->kind = BST_SOURCE_OBJECT;
        draw_as_streak(object, path[0], path[1]);
        const bst_generator *g = frame_of(&s);
        int i = source_of(&s, 0);
        s.generator->sources[i].found = true;
        s.generator->sources[i].head = -1;
        s.generator->sources[source_of(&s, 1)].found = false;
        double light[STAMP][STAMP];
        for (int v = 0; v < STAMP; v++) {
            for (int u = 0; u < STAMP; u++) {
                int px = 300 + u - HALF, py = 400 + v - HALF;
                light[v][u] = flux * light_at(px, py, x, y, 0, 0, s.frame.sigma_px) +
                              ray * flux *
                                  light_at(px, py, object->x_mid_px, object->y_mid_px, path[0],
                                           path[1], s.frame.sigma_px);
            }
        }
        pixel_fit fit = fit_point(light, 300, 400, s.frame.sigma_px, g->noise_e, true,
                                  (pixel_fit){x, y, flux, 0.0});
        generator_blend b = bst_generator_blend_of(g, i);
        double far = hypot(fit.x - x, fit.y - y);
        assert_true(far > 0.1);
        /* one source of its nearest light in the place of a line */
        bst_assert_close(b.x, fit.x, 0.15 * far);
        bst_assert_close(b.y, fit.y, 0.15 * far);
        bst_assert_close(b.flux_e, fit.flux, 0.08 * fit.flux);
    }
    close_scene(&s);
}

/* Two stars' streaks in line: how much flatter the top of both outputs is than that of one, by
 * integrals over the paths. Beside each other they make it no flatter along. */
static void streaks_in_line_have_a_flat_top(void **state) {
    (void)state;
    const double paths[2][2] = {{9.0, 12.0}, {-12.0, 5.0}};
    scene s;
    open_scene(&s);
    int flatter = 0;
    for (int k = 0; k < 8; k++) {
        const double *path = paths[k / 4];
        double length = hypot(path[0], path[1]), c = path[0] / length, n = path[1] / length;
        const double places[4][2] = {
            {0.55, 0.0}, {-0.8, 0.3}, {0.3, -0.6}, {0.0, 1.5}}; /* length, px */
        double part = k % 4 == 1 ? 0.6 : 0.9, along = places[k % 4][0] * length;
        double dx = along * c - places[k % 4][1] * n, dy = along * n + places[k % 4][1] * c;
        s.frame.streak_dx_px = path[0];
        s.frame.streak_dy_px = path[1];
        start(&s);
        s.truth->count = 0;
        double flux = electrons_of(&s, 1000.0);
        draw_as_streak(add_source(&s, 1, 300.3, 400.4, flux), path[0], path[1]);
        draw_as_streak(add_source(&s, 2, 300.3 + dx, 400.4 + dy, part * flux), path[0], path[1]);
        const bst_generator *g = frame_of(&s);
        int i = source_of(&s, 0);
        s.generator->sources[i].found = true;
        s.generator->sources[i].head = -1;
        s.generator->sources[source_of(&s, 1)].found = false;
        generator_blend b = bst_generator_blend_of(g, i);
        double variance = 2.0 * (s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0);
        double x = b.x - 300.3, y = b.y - 400.4, step = 0.25, alone = 0.0, all = 0.0;
        for (int m = -1; m <= 1; m++) {
            double weight = m == 0 ? 2.0 : -1.0, u = m * step * path[0], v = m * step * path[1];
            alone += weight * overlap_of(u, v, path, path, variance);
            all += weight * overlap_of(x + u, y + v, path, path, variance) +
                   weight * part * overlap_of(x + u - dx, y + v - dy, path, path, variance);
        }
        double want = all > 0.0 ? fmin(fmax(alone / all, 1.0), 6.0) : 6.0;
        assert_false(b.drawn);
        bst_assert_close(b.flat, want, 0.005 * want); /* steps of the integrals */
        flatter += want > 1.2 && want < 6.0;
    }
    assert_true(flatter >= 3);
    close_scene(&s);
}

/* Stars' streaks of SNR 7, whose output has its top somewhere along the path: errors along it and
 * across are near the bound, and independent. A fainter streak in line with it draws the top to its
 * side. */
static void faint_streaks_lie_at_the_top_of_noise(void **state) {
    (void)state;
    const double paths[2][2] = {{9.0, 12.0}, {-12.0, 5.0}};
    scene s;
    open_scene(&s);
    for (int k = 0; k < 2; k++) {
        const double *path = paths[k];
        double length = hypot(path[0], path[1]), c = path[0] / length, n = path[1] / length;
        s.frame.streak_dx_px = path[0];
        s.frame.streak_dy_px = path[1];
        start(&s);
        fill(&s, 10.0);
        static bst_crlb_table bound;
        bst_crlb_table_init(&bound, s.frame.sigma_px);
        double noise = sqrt(36.0 + 64.0 + 1.6 * 1.6 / 12.0);
        for (int i = 0; i < s.truth->count; i++) {
            s.truth->items[i].electrons = 7.0 * noise / bst_crlb_table_norm(&bound, length);
            draw_as_streak(&s.truth->items[i], path[0], path[1]);
        }
        double square[3] = {0.0}, count = 0.0;
        for (int f = 0; f < 3; f++) {
            bst_generator_result r = run(&s, f);
            for (int i = 0; i < r.count; i++) {
                const bst_truth_item *t = &s.truth->items[r.items[i].item];
                double x = r.items[i].detection.x_px - t->x_mid_px;
                double y = r.items[i].detection.y_px - t->y_mid_px;
                double u = x * c + y * n, v = y * c - x * n;
                square[0] += u * u;
                square[1] += u * v;
                square[2] += v * v;
                count += 1.0;
            }
        }
        bst_crlb_table_at at =
            bst_crlb_table_of(&bound, s.truth->items[0].electrons, noise, length);
        assert_true(count > 500.0);
        /* four standard errors of a variance of 500 are 25 %; the top of a chosen one lies better
         * across, by what the noise adds to its light */
        bst_assert_close(square[0] / count / at.var_along_px2, 1.15, 0.3);
        bst_assert_close(square[2] / count / at.var_across_px2, 0.9, 0.25);
        bst_assert_close(square[1] / sqrt(square[0] * square[2]), 0.0, 4.0 / sqrt(count));
        double mean[2][2] = {{0.0}}, drawn = 0.0;
        for (int64_t f = 0; f < 150; f++) {
            s.truth->exposure_id = f;
            for (int with = 0; with < 2; with++) {
                s.truth->count = 0;
                double flux = 9.0 * noise / bst_crlb_table_norm(&bound, length);
                draw_as_streak(add_source(&s, 1, 300.3, 400.4, flux), path[0], path[1]);
                draw_as_streak(add_source(&s, 2, 300.3 + 0.5 * path[0], 400.4 + 0.5 * path[1],
                                          with ? 0.6 * flux : 1.0),
                               path[0], path[1]);
                bst_generator_result r;
                bst_assert_ok(&s.ctx, bst_generator_run(&s.ctx, s.generator, &s.frame, &r));
                int i = source_of(&s, 0), o = source_of(&s, 1);
                s.generator->sources[i].found = true;
                s.generator->sources[i].head = -1;
                s.generator->sources[o].found = false;
                generator_blend b = bst_generator_blend_of(s.generator, i);
                double x = b.x - 300.3, y = b.y - 400.4;
                mean[with][0] += (x * c + y * n) / 150.0;
                mean[with][1] += (y * c - x * n) / 150.0;
                drawn += b.drawn;
            }
        }
        assert_true(drawn == 300.0);
        /* four standard errors of 150 places: 0.6 px along, 0.17 across at SNR 9 */
        bst_assert_close(mean[0][0], 0.0, 0.2);
        bst_assert_close(mean[0][1], 0.0, 0.06);
        bst_assert_close(mean[1][1], 0.0, 0.06);
        /* the centroid of both lies 0.19 of the length behind, the top of both before it */
        assert_true(mean[1][0] > 0.8 && mean[1][0] < 0.19 * length);
    }
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_beside_a_source),
        cmocka_unit_test(maxima_have_their_neighbours_light),
        cmocka_unit_test(blends_lie_where_a_single_fit_does),
        cmocka_unit_test(light_beyond_the_edge_is_not_fitted),
        cmocka_unit_test(neighbours_widen_each_other),
        cmocka_unit_test(long_pairs_have_their_centroid),
        cmocka_unit_test(far_neighbours_are_fitted_alone),
        cmocka_unit_test(the_brighter_pixel_is_the_one_seen),
        cmocka_unit_test(faint_streaks_lie_at_the_top_of_noise),
        cmocka_unit_test(a_long_streak_draws_a_star),
        cmocka_unit_test(streaks_in_line_have_a_flat_top),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
