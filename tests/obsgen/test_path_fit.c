/* Stars on a path that telemetry does not know: what is fitted to their light, against sums over
 * fine pixels, and what the generator reports of them. */
#include "obsgen/streak/path_fit.h"

#include "obsgen/generator_internal.h"
#include "tests/obsgen/generator_scene.h"

enum { STEPS = 401, FINE = 4, ACROSS = 30 * FINE, ALONG = 60 * FINE };

typedef struct path {
    double x[STEPS], y[STEPS];
} path;

static bst_star_trail_path route_of(const path *p) {
    return (bst_star_trail_path){p->x, p->y, STEPS};
}

static double share_of(int k) {
    return (k == 0 || k == STEPS - 1 ? 0.5 : 1.0) / (STEPS - 1);
}

/* Places less their mean. */
static void centre(path *p) {
    double x = 0.0, y = 0.0;
    for (int k = 0; k < STEPS; k++) {
        x += share_of(k) * p->x[k];
        y += share_of(k) * p->y[k];
    }
    for (int k = 0; k < STEPS; k++) {
        p->x[k] -= x;
        p->y[k] -= y;
    }
}

/* A path along (0.8, 0.6) that telemetry takes for a uniform one of `length`: it starts fast and
 * ends slowly. */
static path slowing(double length, double part) {
    path p;
    for (int k = 0; k < STEPS; k++) {
        double t = (double)k / (STEPS - 1), u = length * (1.0 - pow(1.0 - t, 1.0 + part));
        p.x[k] = 0.8 * u;
        p.y[k] = 0.6 * u;
    }
    centre(&p);
    return p;
}

/* A path of `length` that stays at its end for `rest` of the exposure. */
static path resting(double length, double rest) {
    path p;
    for (int k = 0; k < STEPS; k++) {
        double t = (double)k / (STEPS - 1), u = length * fmin(t / (1.0 - rest), 1.0);
        p.x[k] = u;
        p.y[k] = 0.0;
    }
    centre(&p);
    return p;
}

/* Pixels of a quarter px along (0.8, 0.6) and across. */
typedef struct plane {
    double v[ACROSS][ALONG];
} plane;

/* Light of a path (NULL: of a uniform one of `length`) displaced along by `shift`. */
static void draw(plane *out, const path *p, double length, double shift, double sigma) {
    memset(out, 0, sizeof *out);
    int count = p ? STEPS : 200;
    double along[ALONG] = {0.0};
    for (int k = 0; k < count; k++) {
        double u = p ? 0.8 * p->x[k] + 0.6 * p->y[k] : length * ((k + 0.5) / count - 0.5) + shift;
        double w = p ? share_of(k) : 1.0 / count;
        for (int i = 0; i < ALONG; i++) {
            double x = (double)(i - ALONG / 2) / FINE - u;
            along[i] += w * exp(-0.5 * x * x / (sigma * sigma));
        }
    }
    for (int j = 0; j < ACROSS; j++) {
        double y = (double)(j - ACROSS / 2) / FINE, e = exp(-0.5 * y * y / (sigma * sigma));
        for (int i = 0; i < ALONG && e > 1e-8; i++) {
            out->v[j][i] = e * along[i];
        }
    }
}

/* How far along a fit of flux, place and width would still move from `shift`, by differences;
 * pixels with more light than `full` are left out. */
static double left_to_go(const path *p, double length, double shift, double light, double sigma,
                         double full) {
    static plane seen, model, next, wide;
    const double step = 0.02;
    double flux = 1.0, widening = 0.0, move = 0.0, top = 0.0;
    draw(&seen, p, 0.0, 0.0, sigma);
    draw(&model, NULL, length, shift, sigma);
    draw(&next, NULL, length, shift + step, sigma);
    draw(&wide, NULL, length, shift, sigma * 1.01);
    for (int j = 0; j < ACROSS; j++) {
        for (int i = 0; i < ALONG; i++) {
            top = fmax(top, model.v[j][i]);
        }
    }
    double variance = sigma * sigma * (1.01 * 1.01 - 1.0);
    for (int round = 0; round < 12; round++) {
        double a[3][3] = {{0.0}}, g[3] = {0.0};
        for (int j = 0; j < ACROSS; j++) {
            for (int i = 0; i < ALONG; i++) {
                /* a wider image of the same light is lower by the square of its width */
                double wider = (wide.v[j][i] / (1.01 * 1.01) - model.v[j][i]) / variance;
                double shape = model.v[j][i] + widening * wider;
                const double by[3] = {flux * (next.v[j][i] - model.v[j][i]) / step, shape,
                                      flux * wider};
                double w =
                    seen.v[j][i] > full ? 0.0 : 1.0 / (1.0 + light * fmax(flux * shape, 0.0) / top);
                for (int m = 0; m < 3; m++) {
                    g[m] += w * by[m] * (seen.v[j][i] - flux * shape);
                    for (int n = 0; n < 3; n++) {
                        a[m][n] += w * by[m] * by[n];
                    }
                }
            }
        }
        for (int m = 0; m < 3; m++) { /* Gauss-Jordan */
            double pivot = a[m][m];
            for (int n = 0; n < 3; n++) {
                a[m][n] /= pivot;
            }
            g[m] /= pivot;
            for (int k = 0; k < 3; k++) {
                double part = a[k][m];
                for (int n = 0; n < 3 && k != m; n++) {
                    a[k][n] -= part * a[m][n];
                }
                g[k] -= k != m ? part * g[m] : 0.0;
            }
        }
        move = g[0]; /* the place stays: it is what is tested */
        flux += g[1];
        widening += g[2];
    }
    return move;
}

/* The fit has converged on fine pixels too, for faint and bright stars, whose places differ. */
static void fits_end_where_they_would_on_fine_pixels(void **state) {
    (void)state;
    const double sigma = 1.1, length = 10.0, lights[] = {0.1, 10.0, 1000.0};
    path p = slowing(length, 0.5);
    bst_star_trail_path route = route_of(&p);
    bst_streak_model model = {.path = {0.8 * length, 0.6 * length}, .sigma_px = sigma};
    double places[3];
    for (int i = 0; i < 3; i++) {
        double at[2] = {0.0, 0.0};
        bst_path_fit_squares squares = bst_path_fit(&route, &model, lights[i], at);
        assert_true(squares.left > 0.0 && squares.left < 0.1 * squares.all);
        /* across there is nothing to move to */
        bst_assert_close(0.8 * at[1] - 0.6 * at[0], 0.0, 2e-3);
        places[i] = 0.8 * at[0] + 0.6 * at[1];
        /* steps of 1 sigma in the sums, and where iterations end: 1e-3 px each */
        bst_assert_close(left_to_go(&p, length, places[i], lights[i], sigma, INFINITY), 0.0, 6e-3);
    }
    assert_true(fabs(places[2] - places[0]) > 0.2);
}

/* The saturated pixels, where the star was slow, are left out: the fit lands farther from the mean
 * of the light than that of a star that does not saturate. */
static void saturated_pixels_are_left_out(void **state) {
    (void)state;
    const double sigma = 1.1, length = 10.0, light = 100.0, full = 0.25;
    path p = resting(length, 0.3);
    for (int k = 0; k < STEPS; k++) {
        p.y[k] = 0.6 * p.x[k];
        p.x[k] *= 0.8;
    }
    bst_star_trail_path route = route_of(&p);
    bst_streak_model model = {.path = {0.8 * length, 0.6 * length}, .sigma_px = sigma};
    double places[2];
    for (int i = 0; i < 2; i++) {
        double at[2] = {0.0, 0.0};
        model.saturated = i > 0 ? full : 0.0;
        (void)bst_path_fit(&route, &model, light, at);
        places[i] = 0.8 * at[0] + 0.6 * at[1];
    }
    printf("place %.3f, with saturated pixels %.3f\n", places[0], places[1]);
    assert_true(fabs(places[1]) > 1.2 * fabs(places[0]));
    /* the limit of saturation runs between the places of the sums, 1 sigma apart */
    bst_assert_close(left_to_go(&p, length, places[1], light, sigma, full), 0.0, 0.05);
}

/* The largest outputs of both filters are those of sums over fine pixels. */
static void outputs_are_those_of_sums(void **state) {
    (void)state;
    const double sigma = 1.1, length = 10.0;
    static plane seen, filter;
    path p = slowing(length, 1.5);
    bst_star_trail_path route = route_of(&p);
    const bst_path_widths widths = {sigma, sigma, sigma};
    bst_path_outputs o =
        bst_path_fit_outputs(&route, (bst_obsgen_path_px){0.8 * length, 0.6 * length}, &widths);
    draw(&seen, &p, 0.0, 0.0, sigma);
    double best[2] = {0.0, 0.0}, at = 0.0, streak_at = 0.0, beside = 0.0;
    for (int shape = 1; shape >= 0; shape--) {
        for (double shift = -6.0; shift <= 6.0; shift += 0.25) {
            double both = 0.0, own = 0.0, norm = 0.0;
            draw(&filter, NULL, shape ? length : 1e-6, shift, sigma);
            for (int j = 0; j < ACROSS; j++) {
                for (int i = 0; i < ALONG; i++) {
                    both += seen.v[j][i] * filter.v[j][i];
                    own += seen.v[j][i] * seen.v[j][i];
                    norm += filter.v[j][i] * filter.v[j][i];
                }
            }
            double output = both / sqrt(own * norm);
            at = shape == 0 && output > best[0] ? shift : at;
            streak_at = shape == 1 && output > best[1] ? shift : streak_at;
            /* within 2 px on the frame's first axis, which is 0.8 of the way */
            if (shape == 0 && fabs(shift - streak_at) <= 2.5) {
                beside = fmax(beside, output);
            }
            best[shape] = fmax(best[shape], output);
        }
    }
    /* the path's samples are up to 0.4 px apart: 1 % of a maximum */
    bst_assert_close(o.point, best[0], 0.01);
    bst_assert_close(o.streak, best[1], 0.01);
    bst_assert_close(0.8 * o.point_at[0] + 0.6 * o.point_at[1], at, 0.3);
    assert_true(o.streak_beside <= o.streak);
    /* the greatest on a slope, at steps of 0.25 px and of the path */
    bst_assert_close(o.point_beside, beside, 0.05);
}

/* Stars of one SNR on a path, of which telemetry reports the ends. */
static bst_generator_result run_on(scene *s, const path *p, double snr, int64_t exposure) {
    s->frame.path_x_px = p->x;
    s->frame.path_y_px = p->y;
    s->frame.path_count = STEPS;
    s->frame.streak_dx_px = p->x[STEPS - 1] - p->x[0];
    s->frame.streak_dy_px = p->y[STEPS - 1] - p->y[0];
    fill(s, snr);
    for (int i = 0; i < s->truth->count; i++) {
        bst_truth_item *t = &s->truth->items[i];
        t->x_start_px += p->x[0];
        t->x_end_px += p->x[STEPS - 1];
        t->y_start_px += p->y[0];
        t->y_end_px += p->y[STEPS - 1];
    }
    return run(s, exposure);
}

static double mean_along(const scene *s, const bst_generator_result *r, double c, double n) {
    double sum = 0.0;
    for (int i = 0; i < r->count; i++) {
        const bst_truth_item *t = &s->truth->items[r->items[i].item];
        sum += c * (r->items[i].detection.x_px - t->x_centroid_px) +
               n * (r->items[i].detection.y_px - t->y_centroid_px);
    }
    return sum / r->count;
}

/* Bright stars of a frame land nearer to the mean of their light than faint ones. */
static void bright_streaks_have_another_bias(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = slowing(10.0, 0.5);
    double sigma = sqrt(s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0);
    const double snrs[2] = {40.0, 6000.0};
    for (int k = 0; k < 2; k++) {
        bst_generator_result r = run_on(&s, &p, snrs[k], k);
        assert_true(r.count > 850);
        double seen = mean_along(&s, &r, 0.8, 0.6);
        /* brightest pixel of the streak over the noise variance */
        double peak = electrons_of(&s, snrs[k]) / (sqrt(2.0 * BST_PI) * sigma * 10.0);
        double light = peak / (r.noise_e * r.noise_e);
        /* mean of 900 errors of 0.4 and 0.003 px; the table's levels are a decade apart */
        bst_assert_close(left_to_go(&p, 10.0, seen, light, sigma, INFINITY), 0.0,
                         k == 0 ? 0.06 : 0.03);
    }
    close_scene(&s);
}

/* Image processing measures a bend that telemetry does not report on bright streaks, and fits all
 * stars with it: their common shift is less. Faint stars show no bend. */
static void a_bend_is_measured_on_bright_streaks(void **state) {
    (void)state;
    const double length = 10.0, bend = 0.25, snrs[2] = {15.0, 400.0};
    double seen[2];
    scene s;
    open_scene(&s);
    s.frame.bend_sigma_px = bend;
    start(&s);
    path p;
    for (int k = 0; k < STEPS; k++) {
        double v = 2.0 * k / (STEPS - 1) - 1.0;
        double u = 0.5 * length * v + bend * 0.5 * (3.0 * v * v - 1.0);
        p.x[k] = 0.8 * u;
        p.y[k] = 0.6 * u;
    }
    centre(&p);
    for (int k = 0; k < 2; k++) {
        (void)run_on(&s, &p, snrs[k], 5);
        double norm = bst_crlb_table_norm(&s.generator->bound, length) / s.generator->noise_e;
        for (int i = 0; i < s.truth->count; i++) {
            s.truth->items[i].electrons = (float)(snrs[k] / norm);
            s.truth->items[i].snr = (float)snrs[k];
        }
        bst_generator_result r = run(&s, 6);
        assert_true(r.count > 850);
        seen[k] = mean_along(&s, &r, 0.8, 0.6);
    }
    printf("bend of %.2f px: shift %.3f, with bright stars %.3f\n", bend, seen[0], seen[1]);
    assert_true(seen[0] > 0.15 * bend); /* 0.7 of it at most: imgproc/streak/streak_motion.h */
    assert_true(seen[0] < 0.8 * bend);
    /* 12 stars of SNR 400 measure it to length / (sqrt(12) SNR sqrt(12)) without their own noise,
     * 0.002 px, and twice that with it */
    bst_assert_close(seen[1], 0.0, 0.015);
    close_scene(&s);
}

/* A star that rests for most of the exposure is seen where it rests, as a point, whatever the
 * streak that telemetry reports. */
static void stars_that_rest_are_points_where_they_rest(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = resting(22.0, 0.85);
    bst_generator_result r = run_on(&s, &p, 60.0, 0);
    assert_true(r.count > 850 && !r.smeared);
    for (int i = 0; i < r.count; i++) {
        assert_int_equal(r.items[i].detection.flags & BST_DETECTION_STREAK, 0);
    }
    /* the mean of 900 errors of 0.05 px; light of the path pulls by a few hundredths */
    bst_assert_close(mean_along(&s, &r, 1.0, 0.0), p.x[STEPS - 1], 0.15);
    /* on a uniform path of that length they are streaks about its middle */
    path even = resting(22.0, 0.0);
    r = run_on(&s, &even, 60.0, 1);
    int streaks = 0;
    for (int i = 0; i < r.count; i++) {
        streaks += (r.items[i].detection.flags & BST_DETECTION_STREAK) != 0;
    }
    assert_int_equal(streaks, r.count);
    bst_assert_close(mean_along(&s, &r, 1.0, 0.0), 0.0, 0.1);
    close_scene(&s);
}

/* Jitter that is faster than the path is sampled for fits widens the image as much as all of it. */
static void fast_jitter_widens_the_image(void **state) {
    (void)state;
    const double jitter = 1.0, length = 8.0;
    path smooth = slowing(length, 0.0), shaken = smooth;
    for (int k = 0; k < STEPS; k++) { /* equal squares on both axes, no mean over four steps */
        shaken.x[k] += jitter * (k % 2 ? 1.0 : -1.0);
        shaken.y[k] += jitter * (k / 2 % 2 ? 1.0 : -1.0);
    }
    const bst_obsgen_path_px filter = {0.8 * length, 0.6 * length};
    const double own2 = 0.8, source2 = own2 + jitter * jitter;
    const bst_path_widths narrow = {sqrt(own2), sqrt(own2), sqrt(own2)};
    const bst_path_widths wide = {sqrt(source2), sqrt(own2), sqrt(0.5 * (own2 + source2))};
    const bst_star_trail_path paths[2] = {route_of(&smooth), route_of(&shaken)};
    bst_path_outputs seen = bst_path_fit_outputs(&paths[1], filter, &narrow);
    bst_path_outputs expected = bst_path_fit_outputs(&paths[0], filter, &wide);
    bst_assert_close(seen.streak, expected.streak, 0.01);
    bst_assert_close(seen.point, expected.point, 0.01);
}

/* Two points apart widen a point's image by half their variance, to first order, in whatever
 * direction; the fit is the same with x and y exchanged. */
static void points_apart_widen_the_image(void **state) {
    (void)state;
    const double sigma = 1.3, apart = 0.3, flux[2] = {0.7, 0.3};
    for (int k = 0; k < 8; k++) {
        double c = cos(0.9 * k), s = sin(0.9 * k);
        bst_path_point one[2], other[2];
        for (int i = 0; i < 2; i++) {
            double u = (i == 0 ? flux[1] : -flux[0]) * apart;
            one[i] =
                (bst_path_point){.x_px = 0.2 + u * c, .y_px = -0.4 + u * s, .flux = 3.0 * flux[i]};
            other[i] =
                (bst_path_point){.x_px = one[i].y_px, .y_px = one[i].x_px, .flux = one[i].flux};
        }
        bst_path_point_fit a = bst_path_fit_points(one, 2, sigma, sigma, 0.0, 0.0);
        bst_path_point_fit b = bst_path_fit_points(other, 2, sigma, sigma, 0.0, 0.0);
        /* second order: the square of 0.3 / 1.3 */
        bst_assert_close(a.x_px, 0.2, 3e-3);
        bst_assert_close(a.y_px, -0.4, 3e-3);
        bst_assert_close(a.flux, 3.0, 3e-3);
        bst_assert_close(a.widening_px2, 0.5 * flux[0] * flux[1] * apart * apart, 5e-4);
        bst_assert_close(b.x_px, a.y_px, 1e-9);
        bst_assert_close(b.y_px, a.x_px, 1e-9);
        bst_assert_close(b.flux, a.flux, 1e-9);
        bst_assert_close(b.widening_px2, a.widening_px2, 1e-9);
    }
    /* a wider image, without a direction */
    const bst_path_point at = {.x_px = 0.2, .y_px = -0.4, .flux = 1.0};
    bst_path_point_fit wide =
        bst_path_fit_points(&at, 1, sqrt(sigma * sigma + 0.05), sigma, 0.0, 0.0);
    bst_assert_close(wide.widening_px2, 0.05, 2e-3);
    bst_assert_close(wide.flux, 1.0, 3e-3);
}

/* A streak in ten parts, one over the other, is fitted as the whole streak. */
static void the_light_of_many_streaks_is_complete(void **state) {
    (void)state;
    const bst_obsgen_path_px along = {24.0, 32.0};
    const bst_streak_model model = {.path = along, .sigma_px = 1.0};
    const bst_path_streak whole = {0.3, -0.2, 1.0, along};
    bst_path_streak parts[10];
    for (int i = 0; i < 10; i++) {
        parts[i] = (bst_path_streak){0.3, -0.2, 0.1, along};
    }
    bst_path_point_fit one = bst_path_fit_streaks(&whole, 1, 1.0, &model, 0.0, 4.0, 3.0);
    bst_path_point_fit ten = bst_path_fit_streaks(parts, 10, 1.0, &model, 0.0, 4.0, 3.0);
    bst_assert_close(one.flux, 1.0, 0.05);
    bst_assert_close(ten.flux, one.flux, 0.02);
    bst_assert_close(ten.x_px, one.x_px, 0.01);
    bst_assert_close(ten.y_px, one.y_px, 0.01);
    bst_assert_close(ten.x_px, 0.3, 0.02);
}

/* A source that is seen as a point has less noise in the filter for streaks, and one that is seen
 * as a streak less in the filter for points: the same noise decides the shape and both detections.
 */
static void shape_and_detection_have_one_noise(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = resting(8.0, 0.3);
    (void)run_on(&s, &p, 5.0, 0);
    const bst_generator *g = s.generator;
    double both = 0.0, square[2] = {0.0, 0.0}, other[2] = {0.0, 0.0};
    int seen[2] = {0, 0};
    assert_true(g->shared_noise > 0.3 && g->shared_noise < 0.95 && g->source_count > 800);
    for (int i = 0; i < g->source_count; i++) {
        generator_source o = g->sources[i];
        const double noise[2] = {bst_generator_filter_noise(g, &o, 0),
                                 bst_generator_filter_noise(g, &o, 1)};
        both += noise[0] * noise[1] / g->source_count;
        for (int k = 0; k < 2; k++) {
            square[k] += noise[k] * noise[k] / g->source_count;
            if (noise[k] > noise[!k]) {
                o.as_streak = k == 1;
                other[k] += bst_generator_other_noise(g, &o) - noise[k];
                assert_true(bst_generator_other_noise(g, &o) == noise[!k]);
                seen[k]++;
            }
        }
    }
    /* 900 sources: three standard errors */
    bst_assert_close(square[0], 1.0, 0.15);
    bst_assert_close(square[1], 1.0, 0.15);
    bst_assert_close(both, g->shared_noise, 0.15);
    assert_true(seen[0] > 300 && seen[1] > 300 && other[0] < 0.0 && other[1] < 0.0);
    close_scene(&s);
}

/* A star that moves by 22 px and then rests for 0.46 of the exposure: a point's fit has the light
 * at rest and some of the rest, not that of a uniform streak under a point, 0.2. */
static void a_point_has_the_light_at_rest(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = resting(22.0, 0.46);
    for (int k = 0; k < 2; k++) {
        double electrons = electrons_of(&s, k == 0 ? 60.0 : 200.0), flux = 0.0, snr = 0.0;
        bst_generator_result r = run_on(&s, &p, k == 0 ? 60.0 : 200.0, k);
        assert_true(r.count > 850);
        for (int i = 0; i < r.count; i++) {
            assert_int_equal(r.items[i].detection.flags & BST_DETECTION_STREAK, 0);
            flux += r.items[i].detection.flux_e / electrons / r.count;
            snr += r.items[i].detection.snr / r.count;
        }
        /* 1.5 px of the way are within two deviations of the point: 0.04 of the light */
        assert_true(flux > 0.46 && flux < 0.6);
        double norm = bst_crlb_table_norm(&s.generator->bound, 0.0);
        bst_assert_close(snr, flux * electrons * norm / r.noise_e, 0.05 * snr);
    }
    close_scene(&s);
}

/* A point's fit to an object that moves far on top of the stars' uneven path, where its image is
 * beyond the pixels of a streak of the stars at its mean place, has the light of the path under the
 * point. */
static void a_point_far_along_its_path_has_the_light_there(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = resting(22.0, 0.46);
    bst_generator_result r = run_on(&s, &p, 60.0, 0);
    bst_generator *g = s.generator;
    assert_true(r.count > 850 && g->uneven);
    const double more = 150.0; /* in the time at rest this is the whole speed of the object */
    generator_source o = g->sources[0];
    o.star = false;
    o.path.dx = g->straight_path.dx + more;
    o.path.dy = g->straight_path.dy;
    o.length = hypot(o.path.dx, o.path.dy);
    /* a uniform line under a Gaussian: 2 sqrt(pi) sigma of it, up to 1.7 times with a free width */
    double line = 2.0 * sqrt(BST_PI) * g->total_sigma / more;
    for (int k = 0; k < 3; k++, o.flux_e *= 30.0) {
        (void)bst_generator_set_filter(g, &o);
        printf("point at %.1f px, %.3f of %.0f e, %.3f with a fixed width\n", o.start_x,
               o.point_flux, o.flux_e, line);
        assert_true(hypot(o.start_x, o.start_y) > 0.5 * g->streak + 4.0 * g->total_sigma);
        assert_true(o.point_flux > 0.9 * line && o.point_flux < 2.0 * line);
    }
    close_scene(&s);
}

/* A path known at eleven places is the same with 40 places on each of the lines between them. No
 * place has the light of a whole step. */
static void a_path_known_at_few_places_goes_on_between_them(void **state) {
    (void)state;
    enum { FEW = 11, EACH = (STEPS - 1) / (FEW - 1) };
    scene s;
    open_scene(&s);
    start(&s);
    path fine = slowing(44.0, 2.0), few;
    for (int k = 0; k < FEW; k++) {
        few.x[k] = fine.x[k * EACH];
        few.y[k] = fine.y[k * EACH];
    }
    for (int k = 0; k < STEPS; k++) {
        int from = k < STEPS - 1 ? k / EACH : FEW - 2;
        double part = (double)k / EACH - from;
        fine.x[k] = few.x[from] + part * (few.x[from + 1] - few.x[from]);
        fine.y[k] = few.y[from] + part * (few.y[from + 1] - few.y[from]);
    }
    (void)run_on(&s, &fine, 60.0, 0);
    bst_path_outputs stars[2];
    double light[2]; /* under a point */
    for (int i = 0; i < 2; i++) {
        s.frame.path_x_px = i ? few.x : fine.x;
        s.frame.path_y_px = i ? few.y : fine.y;
        s.frame.path_count = i ? FEW : STEPS;
        (void)run(&s, 0);
        stars[i] = s.generator->outputs;
        generator_source fast = s.generator->sources[0];
        assert_true(s.generator->uneven);
        fast.star = false;
        fast.path.dx += 120.0;
        fast.path.dy += 60.0;
        (void)bst_generator_set_filter(s.generator, &fast);
        assert_true(fast.as_streak);
        light[i] = fast.point_flux;
    }
    /* steps of up to a sigma in the sums; a step of the path has a tenth of the light */
    bst_assert_close(stars[1].point, stars[0].point, 0.01);
    bst_assert_close(stars[1].streak, stars[0].streak, 0.01);
    bst_assert_close(light[1], light[0], 0.003);
    close_scene(&s);
}

/* Noise decides the shape of a faint star whose streak has a lower output than its point: one that
 * the streak's filter alone shows is a streak, and is no point below the threshold. */
static void faint_stars_may_be_streaks(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    path p = resting(14.0, 0.46);
    bst_generator_result r = run_on(&s, &p, 24.0, 3);
    const bst_path_outputs *o = &s.generator->outputs;
    assert_true(s.generator->uneven && o->streak < o->point && o->streak_beside < 0.8 * o->point);
    int streaks = 0, below = 0;
    for (int i = 0; i < r.count; i++) {
        const bst_detection *d = &r.items[i].detection;
        streaks += (d->flags & BST_DETECTION_STREAK) != 0;
        below += d->snr < 0.6 * r.threshold_snr;
    }
    printf(
        "outputs %.2f, %.2f, beside %.2f, %.2f: %d of %d are streaks, %d far below the threshold\n",
        o->point, o->streak, o->point_beside, o->streak_beside, streaks, r.count, below);
    assert_true(r.count > 700 && streaks > 40 && streaks < r.count / 5);
    assert_true(below < 5);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fits_end_where_they_would_on_fine_pixels),
        cmocka_unit_test(saturated_pixels_are_left_out),
        cmocka_unit_test(a_bend_is_measured_on_bright_streaks),
        cmocka_unit_test(outputs_are_those_of_sums),
        cmocka_unit_test(fast_jitter_widens_the_image),
        cmocka_unit_test(points_apart_widen_the_image),
        cmocka_unit_test(the_light_of_many_streaks_is_complete),
        cmocka_unit_test(shape_and_detection_have_one_noise),
        cmocka_unit_test(bright_streaks_have_another_bias),
        cmocka_unit_test(stars_that_rest_are_points_where_they_rest),
        cmocka_unit_test(a_point_has_the_light_at_rest),
        cmocka_unit_test(a_point_far_along_its_path_has_the_light_there),
        cmocka_unit_test(a_path_known_at_few_places_goes_on_between_them),
        cmocka_unit_test(faint_stars_may_be_streaks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
