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
            double asked, shot, a = s.calibration.gain[0] * snr;
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
    double sum2 = 0.0, told = 0.0, flux = 0.0, flux2 = 0.0, cross = 0.0;
    long n = 0;
    for (int f = 0; f < 12; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            const bst_truth_item *t = &s.truth->items[r.items[i].item];
            double dx = d->x_px - t->x_centroid_px, dy = d->y_px - t->y_centroid_px;
            sum2 += dx * dx + dy * dy;
            cross += dx * dy;
            told += d->cov_xx + d->cov_yy;
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
    /* the covariance is told for the measured flux: its mean is off by the square of 5 % */
    bst_assert_close(told / (2.0 * (double)n) / at.var_along_px2, 1.0, 0.015);
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
        double told = bst_crlb_table_of(&onboard, electrons, noise, 0.0).var_along_px2;
        /* the gradient of the narrow PSF on the wide image */
        double model2 = plain2 + s.settings.jitter_px * s.settings.jitter_px;
        double misfit = pow(0.5 * (model2 + wide2), 4.0) / (model2 * model2 * wide2 * wide2);
        assert_true(r.count > 880);
        /* 1800 places: 3.3 % of a variance, three of them; shares of a table */
        bst_assert_close(sum / (error * misfit), 1.0, 0.12);
        bst_assert_close(stated / told, 1.0, 0.12);
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
    double worst = 0.0;
    bst_generator_result r = run(&s, 3);
    for (int i = 0; i < r.count; i++) {
        const bst_detection *d = &r.items[i].detection;
        const bst_truth_item *t = &s.truth->items[r.items[i].item];
        double bias = 0.03 * sin(2.0 * BST_PI * t->x_centroid_px);
        worst = fmax(worst, fabs(d->x_px - t->x_centroid_px - bias));
    }
    /* five standard deviations of places of 1e5 electrons */
    assert_true(r.count == 900 && worst < 0.014);
    close_scene(&s);
}

static void false_alarms_are_poisson_with_a_gaussian_tail(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 5.0;
    start(&s);
    enum { FRAMES = 4000 };
    double n = 0.0, n2 = 0.0, energy = 0.0, x = 0.0, y2 = 0.0, least = 1e9;
    for (int f = 0; f < FRAMES; f++) {
        bst_generator_result r = run(&s, f);
        n += r.count;
        n2 += (double)r.count * r.count;
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            double asked = r.filter.threshold;
            assert_true(d->snr >= asked && r.items[i].item == -1);
            energy += 0.5 * (d->snr * d->snr - asked * asked);
            least = fmin(least, d->snr - asked);
            x += d->x_px;
            y2 += (d->y_px - 0.5 * (SIDE - 1)) * (d->y_px - 0.5 * (SIDE - 1));
        }
    }
    double mean = n / FRAMES;
    /* four standard deviations each: of a Poisson mean, its variance, an exponential's mean, and
     * the first two moments of a uniform place */
    bst_assert_close(mean, 5.0, 4.0 * sqrt(5.0 / FRAMES));
    bst_assert_close((n2 / FRAMES - mean * mean) / mean, 1.0, 4.0 * sqrt(2.0 / FRAMES));
    bst_assert_close(energy / n, 1.0, 4.0 / sqrt(n));
    assert_true(least < 0.001);
    bst_assert_close(x / n, 0.5 * (SIDE - 1), 4.0 * SIDE / sqrt(12.0 * n));
    bst_assert_close(y2 / n / (SIDE * (double)SIDE / 12.0), 1.0, 4.0 * sqrt(0.8 / n));
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
    s.calibration.crowding = s.calibration.background_share = 0.0;
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
    d->read_tail_fraction = 0.1;
    d->read_tail_rms_e = 20.0;
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

static void hits_come_at_the_detectors_rate(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.camera.detector.hits = (bst_detector_cosmic_ray_config){.rate_per_cm2_s = 5.0,
                                                              .pixel_pitch_um = 13.0,
                                                              .depth_um = 15.0,
                                                              .e_per_um = 80.0,
                                                              .straggling = 0.12};
    start(&s);
    double seen = 0.0, told = 0.0;
    enum { FRAMES = 400 };
    for (int f = 0; f < FRAMES; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            assert_true(r.items[i].hit && r.items[i].item == -1);
            told += r.items[i].detection.label == BST_LABEL_HIT;
        }
        seen += r.count;
    }
    /* all of them shine: 1200 e- at least on the filter's few pixels; four standard deviations, and
     * tracks that leave the frame */
    double expected = 5.0 * SIDE * SIDE * 169e-8 * 0.5;
    bst_assert_close(seen / FRAMES, expected, 4.0 * sqrt(expected / FRAMES) + 0.01 * expected);
    /* most fill one pixel or two, and stand out */
    assert_true(told > 0.6 * seen);
    close_scene(&s);
}

/* Light of a bright star's wings lifts noise above the threshold where no higher maximum is near.
 */
static void wings_make_alarms(void **state) {
    (void)state;
    enum { FRAMES = 150 };
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1.0;
    start(&s);
    bst_camera camera = s.camera;
    camera.optics = (bst_optics_config){.psf = BST_PSF_DIFFRACTION, .q = 1.9, .wavelengths = 4};
    camera.optics.band_nm[0] = 500.0;
    camera.optics.band_nm[1] = 800.0;
    bst_psf *psf;
    bst_assert_ok(&s.ctx, bst_psf_create(&s.ctx, &camera, &psf));
    bst_response response;
    const bst_response_side side = {psf, 0.0};
    bst_response_set(&response, &side, &side, 1, 512.0, 512.0);
    s.frame.response = &response;
    double near[2] = {0.0, 0.0}, far[2] = {0.0, 0.0};
    for (int bright = 0; bright < 2; bright++) {
        for (int f = 0; f < FRAMES; f++) {
            s.truth->count = 0;
            add_source(&s, 1, 512.0, 512.0, electrons_of(&s, bright ? 4000.0 : 40.0));
            bst_generator_result r = run(&s, f);
            for (int i = 0; i < r.count; i++) {
                const bst_detection *d = &r.items[i].detection;
                double away = hypot(d->x_px - 512.0, d->y_px - 512.0);
                if (r.items[i].item < 0) {
                    (away < 24.0 ? near : far)[bright] += 1.0 / FRAMES;
                    /* within the box in which maxima are compared the star is the higher one */
                    assert_true(!bright || away > 7.0);
                }
            }
        }
    }
    /* at 9 to 13 px the light is 3 to 1 of the noise, so that the rate there is up to exp(12) times
     * that of 1 in 1024^2: a few in a hundred frames at the least; 150 frames, Poisson */
    assert_true(near[0] < 0.04); /* 0.0017 expected */
    assert_true(near[1] > 0.05 && near[1] < 3.0);
    bst_assert_close(far[1], far[0], 0.5);
    bst_psf_free(psf);
    close_scene(&s);
}

/* With a maximum in 400 pixels and more, background and noise are those of the sky between the
 * stars, and the threshold is that for its pixels. */
static void crowded_frames_are_looked_at_twice(void **state) {
    (void)state;
    enum { WINDOW = 512 };
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 1.0;
    start(&s);
    s.frame.window = (bst_window){0, 0, WINDOW, WINDOW};
    bst_generator_result r[2];
    for (int dense = 0; dense < 2; dense++) {
        int side = dense ? 30 : 22; /* a source in 291 pixels, in 542 */
        s.truth->count = 0;
        for (int i = 0; i < side * side; i++) {
            add_source(&s, (uint32_t)i + 1, (i % side + 0.5) * WINDOW / side,
                       (i / side + 0.5) * WINDOW / side, electrons_of(&s, 12.0));
        }
        r[dense] = run(&s, 0);
    }
    const bst_camera *c = &s.camera;
    double dark =
        sqrt(36.0 + c->read_noise_e * c->read_noise_e + c->gain_e_per_dn * c->gain_e_per_dn / 12.0);
    assert_true(r[0].noise_e > 1.01 * dark && r[0].background_e > 36.1);
    bst_assert_close(r[1].noise_e, dark, 1e-6 * dark);
    bst_assert_close(r[1].background_e, 36.0, 1e-6);
    assert_true(r[1].threshold_snr < r[0].threshold_snr - 0.02);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wings_make_alarms),
        cmocka_unit_test(crowded_frames_are_looked_at_twice),
        cmocka_unit_test(detection_follows_the_ideal_law),
        cmocka_unit_test(places_scatter_by_the_bound),
        cmocka_unit_test(errors_and_statements_have_their_own_width),
        cmocka_unit_test(the_phase_bias_is_as_stated),
        cmocka_unit_test(false_alarms_are_poisson_with_a_gaussian_tail),
        cmocka_unit_test(draws_depend_on_names_alone),
        cmocka_unit_test(close_sources_are_one),
        cmocka_unit_test(a_pixels_noise_is_the_sum_of_its_parts),
        cmocka_unit_test(light_below_the_clip_is_background),
        cmocka_unit_test(room_is_for_the_brightest),
        cmocka_unit_test(hits_come_at_the_detectors_rate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
