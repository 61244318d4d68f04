/* The generator's statistics against the laws that it states. */
#include "sim/core/threshold_statistics.h"
#include "tests/obsgen/generator_scene.h"

static double above(double z) {
    return 0.5 * erfc(z / sqrt(2.0));
}

/* The share of a Gaussian's light in a pixel. */
static double pixel_share(double from, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((from + 0.5) / s) - erf((from - 0.5) / s));
}

/* What image processing asks of the output of its filter on these pixels, and what the photons of a
 * source of SNR 1 add to its variance: by sums over the pixels, mean over places in the pixel. */
static void filter_by_sums(const scene *s, double threshold, double noise_e, double *asked,
                           double *shot) {
    enum { PHASES = 6, REACH = 5 };
    bst_threshold_weights weights = {{0.0}};
    *shot = 0.0;
    for (int phase = 0; phase < PHASES * PHASES; phase++) {
        double p[(2 * REACH + 1) * (2 * REACH + 1)], square = 0.0, cube = 0.0;
        double px = (phase % PHASES + 0.5) / PHASES - 0.5;
        double py = ((double)(phase / PHASES) + 0.5) / PHASES - 0.5;
        int n = 0;
        for (int y = -REACH; y <= REACH; y++) {
            for (int x = -REACH; x <= REACH; x++, n++) {
                p[n] =
                    pixel_share(x - px, s->frame.sigma_px) * pixel_share(y - py, s->frame.sigma_px);
                square += p[n] * p[n];
                cube += p[n] * p[n] * p[n];
            }
        }
        for (int k = 0; k < n; k++) {
            double value = p[k] / sqrt(square), power = value * value;
            for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
                power *= value;
                weights.power[i] += power / (PHASES * PHASES);
            }
        }
        /* F = noise / sqrt(square) at SNR 1 */
        *shot += cube / (square * sqrt(square)) / noise_e / (PHASES * PHASES);
    }
    double gain = s->camera.gain_e_per_dn;
    double read = s->camera.read_noise_e * s->camera.read_noise_e + gain * gain / 12.0;
    bst_threshold_noise noise = {noise_e, noise_e * noise_e - read, gain};
    *asked = bst_threshold_quantile(threshold, &weights, &noise);
}

static void detection_follows_the_ideal_law(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1.0;
    s.calibration.false_alarm_factor = 0.0;
    s.calibration.crowding = 0.0;
    for (int slope = 0; slope < 2; slope++) {
        s.calibration.slope = slope ? 0.8 : 1.0;
        s.calibration.gain[0] = slope ? 0.95 : 1.0;
        start(&s);
        for (double snr = 3.0; snr < 8.0; snr += 0.5) {
            enum { FRAMES = 10 };
            fill(&s, snr);
            int found = 0, trials = 0;
            double threshold = 0.0, noise_e = 1.0;
            for (int f = 0; f < FRAMES; f++) {
                bst_generator_result r = run(&s, f);
                found += r.count;
                trials += s.truth->count;
                threshold = r.threshold_snr;
                noise_e = r.noise_e;
            }
            double asked, shot, a = bst_obsgen_peak(snr, s.calibration.gain[0]);
            filter_by_sums(&s, threshold, noise_e, &asked, &shot);
            double pd = above(s.calibration.slope * (asked - a) / sqrt(1.0 + shot * a));
            /* four standard deviations of a binomial share, and 0.01 for integrals in the place of
             * sums over pixels */
            double sigma = sqrt(fmax(pd * (1.0 - pd), 1e-4) / trials);
            bst_assert_close((double)found / trials, pd, 4.0 * sigma + 0.01);
        }
    }
    close_scene(&s);
}

/* Reported places are off by what the bound and the factor say, and their covariance is the bound.
 */
static void places_scatter_by_the_bound(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        s.calibration.across_factor[i] = 1.2;
    }
    start(&s);
    bst_crlb_table bound;
    bst_crlb_table_init(&bound, s.frame.sigma_px);
    fill(&s, 25.0);
    double sum2 = 0.0, reported = 0.0, flux = 0.0, flux2 = 0.0, cross = 0.0;
    long n = 0;
    for (int f = 0; f < 12; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            const bst_truth_item *t = &s.truth->items[r.items[i].item];
            double dx = d->x_px - t->x_centroid_px, dy = d->y_px - t->y_centroid_px;
            sum2 += dx * dx + dy * dy;
            cross += dx * dy;
            reported += d->cov_xx + d->cov_yy;
            flux += d->flux_e / t->electrons - 1.0;
            flux2 += (d->flux_e - t->electrons) * (d->flux_e - t->electrons);
            n++;
        }
    }
    assert_true(n == 900 * 12);
    bst_generator_result r = run(&s, 0);
    bst_crlb_table_at at = bst_crlb_table_of(&bound, electrons_of(&s, 25.0), r.noise_e, 0.0);
    double variance = sum2 / (2.0 * (double)n);
    /* four standard deviations of a variance of 21,600 normal deviates: 4 sqrt(2 / n) */
    bst_assert_close(variance / (1.44 * at.var_along_px2), 1.0, 4.0 * sqrt(1.0 / (double)n));
    bst_assert_close(cross / (double)n / variance, 0.0, 4.0 / sqrt((double)n));
    /* the covariance is stated for the measured flux: its mean is off by the square of 5 % */
    bst_assert_close(reported / (2.0 * (double)n) / at.var_along_px2, 1.0, 0.015);
    bst_assert_close(flux2 / (double)n / at.flux_variance, 1.0, 4.0 * sqrt(2.0 / (double)n));
    bst_assert_close(flux / (double)n, 0.0,
                     4.0 * sqrt(at.flux_variance / (double)n) / electrons_of(&s, 25.0));
    close_scene(&s);
}

/* A tremor of 0.7 px at rest: images are wider by it, and so are the errors; what is stated is the
 * bound of the onboard PSF, with the tremor where image processing's jitter_px has it. */
static void errors_and_statements_have_their_own_width(void **state) {
    (void)state;
    enum { STEPS = 200 };
    const double jitter = 0.7, snr = 20.0;
    double x[STEPS + 1], y[STEPS + 1];
    for (int k = 0; k <= STEPS; k++) {
        x[k] = jitter * sqrt(2.0) * cos(2.0 * BST_PI * k * 10 / STEPS);
        y[k] = jitter * sqrt(2.0) * sin(2.0 * BST_PI * k * 10 / STEPS);
    }
    for (int known = 0; known < 2; known++) {
        scene s;
        open_scene(&s);
        s.settings.jitter_px = known ? jitter : 0.0;
        s.frame.path_x_px = x;
        s.frame.path_y_px = y;
        s.frame.path_count = STEPS + 1;
        start(&s);
        double electrons = electrons_of(&s, snr);
        fill(&s, snr);
        double noise = sqrt(36.0 + 64.0 + 1.6 * 1.6 / 12.0), sigma = s.frame.sigma_px;
        /* as generators see sources: their SNR is that of the wider image */
        double plain2 = sigma * sigma + 1.0 / 12.0, wide2 = plain2 + jitter * jitter;
        for (int i = 0; i < s.truth->count; i++) {
            s.truth->items[i].snr = snr * sqrt(plain2 / wide2);
        }
        bst_generator_result r = run(&s, 1);
        double sum = 0.0, stated = 0.0;
        for (int i = 0; i < r.count; i++) {
            const bst_truth_item *t = &s.truth->items[r.items[i].item];
            double dx = r.items[i].detection.x_px - t->x_centroid_px;
            double dy = r.items[i].detection.y_px - t->y_centroid_px;
            sum += 0.5 * (dx * dx + dy * dy) / r.count;
            stated += r.items[i].detection.cov_xx / r.count;
        }
        bst_crlb_table image, onboard;
        bst_crlb_table_init(&image, sqrt(sigma * sigma + jitter * jitter));
        bst_crlb_table_init(&onboard, hypot(sigma, s.settings.jitter_px));
        double error = bst_crlb_table_of(&image, electrons, noise, 0.0).var_along_px2;
        double reported = bst_crlb_table_of(&onboard, electrons, noise, 0.0).var_along_px2;
        /* the gradient of the narrow PSF on the wide image */
        double model2 = plain2 + s.settings.jitter_px * s.settings.jitter_px;
        double misfit = pow(0.5 * (model2 + wide2), 4.0) / (model2 * model2 * wide2 * wide2);
        assert_true(r.count > 880);
        /* 1800 places: 3.3 % of a variance, three of them; shares of a table */
        bst_assert_close(sum / (error * misfit), 1.0, 0.12);
        bst_assert_close(stated / reported, 1.0, 0.12);
        close_scene(&s);
    }
}

static void the_phase_bias_is_as_stated(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.calibration.phase_bias_px = 0.03;
    start(&s);
    fill(&s, 3000.0);
    for (int b = 1; b <= 2; b++) {
        double worst = 0.0, off = 0.5 * (b - 1);
        s.frame.binning = b;
        bst_generator_result r = run(&s, 3);
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            const bst_truth_item *t = &s.truth->items[r.items[i].item];
            /* of the phase in the pixel that is read; in sensor pixels, whatever the binning */
            double x = 0.03 * sin(2.0 * BST_PI * (t->x_centroid_px - off) / b);
            double y = 0.03 * sin(2.0 * BST_PI * (t->y_centroid_px - off) / b);
            worst = fmax(worst, fabs(d->x_px - t->x_centroid_px - x));
            worst = fmax(worst, fabs(d->y_px - t->y_centroid_px - y));
        }
        /* five standard deviations of places of 1e5 electrons */
        assert_true(r.count == 900 && worst < 0.016);
    }
    close_scene(&s);
}

/* Light of a Gaussian drawn along x over the pixel at its middle, summed up over the path. */
static void the_brightest_pixel_of_a_streak(void **state) {
    (void)state;
    const double lengths[] = {0.0, 0.4, 3.0, 20.0}, sigma = 0.85, root = sigma * sqrt(2.0);
    for (int k = 0; k < 4; k++) {
        bst_truth_item item = {.electrons = 1000.0,
                               .x_start_px = 10.0,
                               .y_start_px = 5.0,
                               .x_end_px = 10.0 + 0.6 * lengths[k],
                               .y_end_px = 5.0 - 0.8 * lengths[k]};
        double along = 0.0, across = erf(0.5 / root);
        enum { PARTS = 20000 };
        for (int i = 0; i < PARTS; i++) {
            double u = lengths[k] * ((i + 0.5) / PARTS - 0.5);
            along += 0.5 * (erf((0.5 - u) / root) + erf((0.5 + u) / root)) / PARTS;
        }
        /* midpoint rule in steps of 1e-3 px */
        bst_assert_close(bst_generator_peak_e(sigma, &item), 1000.0 * along * across, 1e-4);
    }
}

/* The light that a filter of norm n gives SNR in the noise, in the exposure's time. */
static void the_faintest_star_is_as_bright_as_its_light(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    for (int k = 0; k < 2; k++) {
        s.frame.exposure_s = k ? 2.5 : 0.5;
        run(&s, 1);
        double e_per_s = electrons_of(&s, 6.0) / s.frame.exposure_s;
        /* by the definition of a magnitude, from a star of V = 0 */
        double v = -2.5 * log10(e_per_s / bst_camera_electrons_per_s(&s.camera, 0.0));
        bst_assert_close(bst_generator_v_limit(s.generator, 6.0), v, 1e-6); /* tables of floats */
    }
    close_scene(&s);
}

static bool same(const bst_obsgen_generated *a, const bst_obsgen_generated *b) {
    const bst_detection *p = &a->detection, *q = &b->detection;
    const double x[] = {p->x_px, p->y_px, p->cov_xx, p->cov_xy, p->cov_yy, p->flux_e, p->snr},
                 y[] = {q->x_px, q->y_px, q->cov_xx, q->cov_xy, q->cov_yy, q->flux_e, q->snr};
    return memcmp(x, y, sizeof x) == 0 && p->flags == q->flags && p->label == q->label;
}

static int same_until(const bst_obsgen_generated *a, const bst_obsgen_generated *b, int count) {
    int n = 0;
    while (n < count && same(&a[n], &b[n])) {
        n++;
    }
    return n;
}

/* The same bytes again; and a source's draws do not depend on what else there is or in which
 * order. */
static void draws_depend_on_names_alone(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    fill(&s, 8.0);
    bst_generator_result r = run(&s, 11);
    int count = r.count;
    bst_obsgen_generated *first = malloc((size_t)count * sizeof *first);
    assert_non_null(first);
    memcpy(first, r.items, (size_t)count * sizeof *first);
    r = run(&s, 12);
    assert_true(r.count != count || same_until(first, r.items, count) < count);
    r = run(&s, 11);
    assert_int_equal(r.count, count);
    assert_int_equal(same_until(first, r.items, count), count);
    /* reversed, and every third source gone; crowding goes by all sources and is left out */
    s.calibration.crowding = s.calibration.background_fraction = 0.0;
    start(&s);
    r = run(&s, 11);
    count = r.count;
    bst_obsgen_generated *all = realloc(first, (size_t)count * sizeof *all);
    assert_non_null(all);
    memcpy(all, r.items, (size_t)count * sizeof *all);
    static bst_truth_item kept[MOST];
    int left = 0;
    for (int i = s.truth->count - 1; i >= 0; i--) {
        if (i % 3 != 0) {
            kept[left++] = s.truth->items[i];
        }
    }
    memcpy(s.truth->items, kept, (size_t)left * sizeof *kept);
    s.truth->count = left;
    r = run(&s, 11);
    int met = 0;
    for (int i = 0, k = 0; i < r.count; i++) {
        while (k < count && !same(&all[k], &r.items[i])) {
            k++;
        }
        met += k < count;
    }
    assert_true(r.count > 300);
    assert_int_equal(met, r.count);
    free(all);
    close_scene(&s);
}

static void close_sources_are_one(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    start(&s);
    double bright = electrons_of(&s, 80.0), faint = electrons_of(&s, 40.0);
    const double distance[] = {0.8, 5.0};
    for (int k = 0; k < 2; k++) {
        double x = 0.0, y = 0.0;
        enum { FRAMES = 200 };
        for (int f = 0; f < FRAMES; f++) {
            s.truth->count = 0;
            add_source(&s, 1, 300.0, 400.0, bright);
            add_source(&s, 2, 300.0 + distance[k], 400.0, faint);
            bst_generator_result r = run(&s, f);
            assert_int_equal(r.count, 1 + k);
            const bst_obsgen_generated *seen = &r.items[r.items[0].item == 0 ? 0 : r.count - 1];
            assert_int_equal((seen->detection.flags & BST_DETECTION_BLEND) != 0, k);
            x += seen->detection.x_px / FRAMES;
            y += seen->detection.y_px / FRAMES;
        }
        /* the fit of one source lands on the maximum of the filter's output, F1 exp(-x^2 / 4 s2) +
         * F2 exp(-(x - d)^2 / 4 s2): the root of its slope; five standard deviations of 200 places
         * at SNR 100 */
        double s2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0, low = 0.0, high = 0.4;
        for (int i = 0; i < 40 && k == 0; i++) {
            double at = 0.5 * (low + high), away = 0.8 - at;
            double slope =
                0.5 * away * exp(-away * away / (4.0 * s2)) - at * exp(-at * at / (4.0 * s2));
            *(slope > 0.0 ? &low : &high) = at;
        }
        double expected = 300.0 + (k == 0 ? low : 0.0);
        bst_assert_close(x, expected, 0.01);
        bst_assert_close(y, 400.0, 0.01);
    }
    close_scene(&s);
}

/* A multiplication register doubles the sky's shot noise but for 1 / gain. */
static void multiplication_adds_to_the_noise(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.truth->background_e = 30.0, s.truth->dark_e = 6.0;
    s.camera.detector.em_gain = 50.0;
    start(&s);
    double variance = (2.0 - 1.0 / 50.0) * 36.0 + 64.0 + 1.6 * 1.6 / 12.0;
    bst_assert_close(run(&s, 1).noise_e, sqrt(variance), 1e-9);
    close_scene(&s);
}

/* Every part of a pixel's variance by itself, binned two by two: what is added before the read-out
 * grows with the pixels, what the read-out adds does not. */
static void a_pixels_noise_is_the_sum_of_its_parts(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.truth->background_e = 36.0;
    s.truth->dark_e = 5.0;
    bst_detector_config *d = &s.camera.detector;
    d->row_noise_e = 2.0;
    d->row_offset_rms_e = 3.0;
    d->telegraph_noise_fraction = 0.1;
    d->telegraph_noise_rms_e = 20.0;
    d->prnu_rms = 0.03;
    d->dsnu_rms = 0.4;
    s.calibration.noise_factor = 1.25;
    for (int binning = 1; binning <= 2; binning++) {
        s.frame.binning = binning;
        start(&s);
        bst_generator_result r = run(&s, 1);
        double pixels = binning * binning, level = pixels * (36.0 + 5.0);
        double variance = level + 64.0 + 1.6 * 1.6 / 12.0 + 4.0 + 9.0 + 0.1 * 400.0 +
                          level * level * 9e-4 / pixels + pixels * 5.0 * 5.0 * 0.16;
        bst_assert_close(r.background_e, level, 1e-9);
        bst_assert_close(r.noise_e, 1.25 * sqrt(variance), 1e-9); /* rounding */
    }
    close_scene(&s);
}

/* Light and its square of one source per pixel of the frame, as far as they lie below three noises
 * of a pixel: sums over a fine grid of its image. */
static void light_below_the_clip_is_background(void **state) {
    (void)state;
    const double paths[3][2] = {{0.0, 0.0}, {36.0, 27.0}, {-27.0, 36.0}};
    const double fluxes[4] = {30.0, 900.0, 6e3, 8e4};
    for (int p = 0; p < 3; p++) {
        for (int k = 0; k < 4; k++) {
            scene s;
            open_scene(&s);
            double length = hypot(paths[p][0], paths[p][1]), flux = fluxes[k];
            bst_truth_item *item = add_source(&s, 1, 500.0, 480.0, flux);
            item->x_start_px -= 0.5 * paths[p][0];
            item->x_end_px += 0.5 * paths[p][0];
            item->y_start_px -= 0.5 * paths[p][1];
            item->y_end_px += 0.5 * paths[p][1];
            s.frame.streak_dx_px = paths[p][0];
            s.frame.streak_dy_px = paths[p][1];
            start(&s);
            bst_generator_result r = run(&s, 1);
            double sigma = sqrt(s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0);
            double clip = 3.0 * sqrt(36.0 + 64.0 + 1.6 * 1.6 / 12.0), light = 0.0, square = 0.0;
            const double h = 1e-3;
            if (length == 0.0) {
                for (double u = 0.5 * h; u < 8.0; u += h) {
                    double e =
                        flux / (2.0 * BST_PI * sigma * sigma) * exp(-0.5 * u * u / (sigma * sigma));
                    double ring = 2.0 * BST_PI * u * h;
                    light += e < clip ? ring * e : 0.0;
                    square += e < clip ? ring * e * e : 0.0;
                }
            } else {
                for (double u = 0.5 * h; u < 8.0; u += h) {
                    double e = flux / (length * sigma * sqrt(2.0 * BST_PI)) *
                               exp(-0.5 * u * u / (sigma * sigma));
                    light += e < clip ? 2.0 * h * length * e : 0.0;
                    square += e < clip ? 2.0 * h * length * e * e : 0.0;
                }
            }
            /* the line's ends: (sigma / length)^2 and what they hold; and the steps of 0.001 px */
            double share = length > 0.0 ? 0.03 : 0.02, pixels = (double)SIDE * SIDE;
            bst_assert_close(r.faint_light_e * pixels, light, share * light);
            bst_assert_close(r.faint_square_e2 * pixels, square, share * square);
            close_scene(&s);
        }
    }
}

static void room_is_for_the_brightest(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.settings.capacity = 10;
    start(&s);
    fill(&s, 20.0);
    for (int i = 0; i < 10; i++) {
        s.truth->items[50 * i].electrons *= 3.0;
    }
    bst_generator_result r = run(&s, 1);
    assert_int_equal(r.count, 10);
    assert_int_equal(r.lost, 890);
    for (int i = 0; i < 10; i++) {
        assert_int_equal(r.items[i].item % 50, 0);
    }
    close_scene(&s);
}

/* A saturated source is placed twice as badly, and says so by its flag and its covariance. */
static void saturated_sources_are_placed_worse(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.calibration.phase_bias_px = 0.0;
    start(&s);
    double off[2], stated[2];
    for (int k = 0; k < 2; k++) {
        s.truth->count = 0;
        bst_truth_item *item = add_source(&s, 1, 300.25, 200.75, electrons_of(&s, 200.0));
        item->flags |= k ? BST_TRUTH_SATURATED : 0u;
        bst_generator_result r = run(&s, 5);
        assert_int_equal(r.count, 1);
        const bst_detection *d = &r.items[0].detection;
        assert_true(((d->flags & BST_DETECTION_SATURATED) != 0) == (k == 1));
        off[k] = d->x_px - 300.25 + 7.0 * (d->y_px - 200.75);
        stated[k] = d->cov_xx + d->cov_yy;
    }
    bst_assert_close(off[1] / off[0], 2.0, 1e-6); /* rounding of places */
    bst_assert_close(stated[1] / stated[0], 4.0, 1e-6);
    close_scene(&s);
}

/* Eight targets apart from each other, whose image is wider along a diagonal than a point. */
static void fill_with_shapes(scene *s, double snr, const bst_truth_shape *image) {
    s->truth->count = 0;
    s->truth->shape_count = BST_TRUTH_SHAPES;
    for (int i = 0; i < BST_TRUTH_SHAPES; i++) {
        bst_truth_item *item = add_source(s, (uint32_t)i + 1, 100.0 + 110.3 * i, 90.0 + 97.7 * i,
                                          electrons_of(s, snr));
        item->kind = BST_SOURCE_OBJECT;
        s->truth->shapes[i] = *image;
        s->truth->shapes[i].item = i;
    }
}

static void large_images_are_fainter_and_placed_worse(void **state) {
    (void)state;
    enum { FRAMES = 400 };
    scene s;
    open_scene(&s);
    s.calibration.crowding = 0.0;
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0, threshold;
    bst_truth_shape image = {.light_xx_px2 = 1.5 * sigma2,
                             .light_xy_px2 = 1.5 * sigma2,
                             .light_yy_px2 = 1.5 * sigma2,
                             .snr_ratio = 0.7,
                             .filter_ratio = 0.5,
                             .peak_ratio = 0.5};
    start(&s);
    fill_with_shapes(&s, 1.0, &image);
    threshold = run(&s, 0).threshold_snr;
    /* the filter's output at twice the threshold, of which the image leaves a half */
    int found = 0;
    fill_with_shapes(&s, 2.0 * threshold, &image);
    for (int k = 1; k <= FRAMES; k++) {
        found += run(&s, k).count;
    }
    bst_assert_close((double)found / (FRAMES * BST_TRUTH_SHAPES), 0.5, 0.06);
    fill_with_shapes(&s, 200.0, &image);
    double along = 0.0, across = 0.0, chi2 = 0.0, n = 0.0;
    for (int k = 1; k <= FRAMES; k++) {
        bst_generator_result r = run(&s, k);
        assert_int_equal(r.count, BST_TRUTH_SHAPES);
        for (int i = 0; i < r.count; i++, n++) {
            const bst_detection *d = &r.items[i].detection;
            const bst_truth_item *item = &s.truth->items[r.items[i].item];
            double x = d->x_px - item->x_centroid_px, y = d->y_px - item->y_centroid_px;
            double det = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
            along += 0.5 * (x + y) * (x + y);
            across += 0.5 * (x - y) * (x - y);
            chi2 += (d->cov_yy * x * x - 2.0 * d->cov_xy * x * y + d->cov_xx * y * y) / det;
            /* FWHM of a Gaussian with the second moments */
            bst_assert_close(d->length_px, 2.3548 * sqrt(sigma2 - 1.0 / 12.0 + 3.0 * sigma2), 1e-3);
            bst_assert_close(d->width_px, 2.3548 * s.frame.sigma_px, 1e-3);
            bst_assert_close(d->angle_rad, 0.25 * BST_PI, 1e-6);
        }
    }
    /* 3200 draws of each: 2.5 % */
    bst_assert_close(sqrt(along / across), 2.0, 0.15);
    bst_assert_close(chi2 / (2.0 * n), 1.0, 0.08);
    close_scene(&s);
}

/* The extent of a large image that moves, on binned pixels: the axes of the sum of the variances of
 * PSF, path and light, by its trace and determinant. */
static void large_images_in_motion(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    const bst_truth_shape image = {.light_xx_px2 = 3.0,
                                   .light_xy_px2 = -1.2,
                                   .light_yy_px2 = 6.0,
                                   .snr_ratio = 0.7,
                                   .filter_ratio = 0.8,
                                   .peak_ratio = 0.5};
    s.frame.binning = 2;
    s.frame.streak_dx_px = 9.0;
    s.frame.streak_dy_px = 5.0;
    start(&s);
    fill_with_shapes(&s, 300.0, &image);
    for (int i = 0; i < s.truth->count; i++) {
        bst_truth_item *item = &s.truth->items[i];
        item->x_start_px -= 4.5;
        item->x_end_px += 4.5;
        item->y_start_px -= 2.5;
        item->y_end_px += 2.5;
    }
    bst_generator_result r = run(&s, 1);
    assert_int_equal(r.count, BST_TRUTH_SHAPES);
    double psf2 = s.frame.sigma_px * s.frame.sigma_px;
    double xx = psf2 + 81.0 / 12.0 + 3.0, xy = 45.0 / 12.0 - 1.2, yy = psf2 + 25.0 / 12.0 + 6.0;
    for (int i = 0; i < r.count; i++) {
        const bst_detection *d = &r.items[i].detection;
        double a = d->length_px / 2.3548200450309493, b = d->width_px / 2.3548200450309493;
        bst_assert_close(a * a + b * b, xx + yy, 1e-6);
        bst_assert_close(a * a * b * b, xx * yy - xy * xy, 1e-5);
        double c = cos(d->angle_rad), n = sin(d->angle_rad);
        bst_assert_close(c * c * xx + 2.0 * c * n * xy + n * n * yy, a * a, 1e-6);
    }
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(large_images_are_fainter_and_placed_worse),
        cmocka_unit_test(large_images_in_motion),
        cmocka_unit_test(saturated_sources_are_placed_worse),
        cmocka_unit_test(the_brightest_pixel_of_a_streak),
        cmocka_unit_test(the_faintest_star_is_as_bright_as_its_light),
        cmocka_unit_test(detection_follows_the_ideal_law),
        cmocka_unit_test(places_scatter_by_the_bound),
        cmocka_unit_test(errors_and_statements_have_their_own_width),
        cmocka_unit_test(the_phase_bias_is_as_stated),
        cmocka_unit_test(draws_depend_on_names_alone),
        cmocka_unit_test(close_sources_are_one),
        cmocka_unit_test(a_pixels_noise_is_the_sum_of_its_parts),
        cmocka_unit_test(multiplication_adds_to_the_noise),
        cmocka_unit_test(light_below_the_clip_is_background),
        cmocka_unit_test(room_is_for_the_brightest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
