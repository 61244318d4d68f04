/* False alarms of the generator: noise, wings of bright stars, light from beyond the edge, cosmic
 * rays. */
#include "tests/obsgen/generator_scene.h"

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

static void hits_come_at_the_detectors_rate(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){.rate_per_cm2_s = 5.0,
                                                                     .pixel_pitch_um = 13.0,
                                                                     .depth_um = 15.0,
                                                                     .e_per_um = 80.0,
                                                                     .straggling = 0.12};
    start(&s);
    double seen = 0.0, reported = 0.0;
    enum { FRAMES = 400 };
    for (int f = 0; f < FRAMES; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            assert_true(r.items[i].hit && r.items[i].item == -1);
            reported += r.items[i].detection.label == BST_LABEL_HIT;
        }
        seen += r.count;
    }
    /* all of them shine: 1200 e- at least on the filter's few pixels; four standard deviations, and
     * tracks that leave the frame */
    double expected = 5.0 * SIDE * SIDE * 169e-8 * 0.5;
    bst_assert_close(seen / FRAMES, expected, 4.0 * sqrt(expected / FRAMES) + 0.01 * expected);
    /* most fill one pixel or two, and stand out */
    assert_true(reported > 0.6 * seen);
    close_scene(&s);
}

/* Charge of at least 12 sigma in one pixel is detected and labelled by images at FWHM 1.5 px
 * (tests/imgproc/calibrate_charge.c: 0.87 at 12, 0.99 at 15). */
static void charge_is_labelled_by_its_sharpness(void **state) {
    (void)state;
    enum { FRAMES = 200 };
    scene s;
    open_scene(&s);
    s.camera.psf_fwhm_px = 1.5;
    s.frame.sigma_px = bst_camera_psf_sigma_px(&s.camera);
    double noise = sqrt(s.truth->background_e + s.camera.read_noise_e * s.camera.read_noise_e);
    /* so thin that a track stays in its pixel */
    s.camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){
        .rate_per_cm2_s = 5.0, .pixel_pitch_um = 13.0, .depth_um = 0.1, .e_per_um = 120.0 * noise};
    start(&s);
    double seen = 0.0, labelled = 0.0;
    for (int f = 0; f < FRAMES; f++) {
        bst_generator_result r = run(&s, f);
        for (int i = 0; i < r.count; i++) {
            seen += r.items[i].hit;
            labelled += r.items[i].hit && r.items[i].detection.label == BST_LABEL_HIT;
        }
    }
    assert_true(seen > 100.0);
    /* mean over the slants, whose charges are 12 sigma and more: 0.95; four standard deviations */
    bst_assert_close(labelled / seen, 0.95, 4.0 * sqrt(0.05 / seen) + 0.02);
    close_scene(&s);
}

/* Images detect nothing where the sky alone fills the converter. */
static void a_full_sky_hides_everything(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    s.settings.false_alarms_per_frame = 5.0;
    s.truth->background_e = 65535.0 * s.camera.gain_e_per_dn + 1.0;
    start(&s);
    add_source(&s, 1, 512.0, 512.0, electrons_of(&s, 100.0));
    assert_int_equal(run(&s, 0).count, 0);
    s.camera.bits = 18; /* room above the sky, up to the full well */
    s.camera.full_well_e = 2e5;
    start(&s);
    assert_true(run(&s, 1).count > 1);
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

/* Where stars move further than is filtered for, images fit nothing and look at no shape: hits are
 * whole pixels without a label. */
static void hits_of_a_smeared_frame(void **state) {
    (void)state;
    for (int smeared = 0; smeared < 2; smeared++) {
        scene s;
        open_scene(&s);
        s.camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){.rate_per_cm2_s = 20.0,
                                                                         .pixel_pitch_um = 13.0,
                                                                         .depth_um = 15.0,
                                                                         .e_per_um = 75.0,
                                                                         .straggling = 0.15};
        s.frame.streak_dx_px = smeared ? 100.0 : 0.0;
        start(&s);
        bst_generator_result r = run(&s, 7);
        assert_true(r.count > 5 && r.smeared == (smeared == 1));
        int labelled = 0;
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            labelled += d->label == BST_LABEL_HIT;
            if (smeared) {
                assert_true(d->cov_xx == 1.0 && d->cov_yy == 1.0 && d->x_px == floor(d->x_px));
            }
        }
        assert_true(smeared ? labelled == 0 : labelled > 3);
        close_scene(&s);
    }
}

/* Radiation comes by the sensor's area, whatever pixels are read, for as long as charge is
 * collected, and from all directions of a half space: a track goes by tan(theta) of the depth,
 * which exceeds T with probability 1 / (1 + T^2) for a flux that falls on a surface (cosine law).
 */
static void hits_on_a_binned_window(void **state) {
    (void)state;
    const double depth_um = 40.0, pitch_um = 13.0;
    enum { FRAMES = 150 };
    for (int b = 1; b <= 2; b++) {
        scene s;
        open_scene(&s);
        s.camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){.rate_per_cm2_s = 20.0,
                                                                         .pixel_pitch_um = pitch_um,
                                                                         .depth_um = depth_um,
                                                                         .e_per_um = 80.0,
                                                                         .straggling = 0.0,
                                                                         .readout_s = 0.7};
        s.frame.window = (bst_window){96, 160, 800, 480};
        s.frame.binning = b;
        start(&s);
        double n = 0.0, drawn = 0.0, sum[2] = {0.0}, turned[2] = {0.0}, snr[2] = {0.0};
        double sigma2 = pow(s.frame.sigma_px / b, 2.0) + 1.0 / 12.0;
        bst_crlb_table bound;
        bst_crlb_table_init(&bound, s.frame.sigma_px / b);
        for (int f = 0; f < FRAMES; f++) {
            bst_generator_result r = run(&s, f);
            double point =
                1.0 / (2.0 * BST_PI * sigma2 * bst_crlb_table_norm(&bound, 0.0) * r.noise_e);
            n += r.count;
            for (int i = 0; i < r.count; i++) {
                const bst_detection *d = &r.items[i].detection;
                sum[0] += (d->x_px - 95.5) / 800.0 - 0.5;
                sum[1] += (d->y_px - 159.5) / 480.0 - 0.5;
                if (d->flags & BST_DETECTION_STREAK) {
                    drawn += 1.0;
                    turned[0] += cos(2.0 * d->angle_rad);
                    turned[1] += sin(2.0 * d->angle_rad);
                    assert_true(d->length_px > 1.5 * d->width_px);
                    /* the line's charge under the filter at its middle, and unit noise */
                    double way_um = hypot(d->length_px * pitch_um, depth_um);
                    double x = d->length_px / b / sqrt(8.0 * sigma2);
                    double want = 80.0 * way_um * point * 0.5 * sqrt(BST_PI) * erf(x) / x;
                    snr[0] += d->snr - want;
                    snr[1] += (d->snr - want) * (d->snr - want);
                }
            }
        }
        double expected = 20.0 * 800 * 480 * pitch_um * pitch_um * 1e-8 * (0.5 + 0.7) * FRAMES;
        /* four standard deviations; one in a hundred has its middle outside */
        bst_assert_close(n, expected, 4.0 * sqrt(expected) + 0.01 * expected);
        bst_assert_close(sum[0] / n, 0.0, 4.0 * sqrt(1.0 / 12.0 / n));
        bst_assert_close(sum[1] / n, 0.0, 4.0 * sqrt(1.0 / 12.0 / n));
        bst_assert_close(snr[0] / drawn, 0.0, 4.0 / sqrt(drawn));
        bst_assert_close(snr[1] / drawn, 1.0, 4.0 * sqrt(2.0 / drawn));
        /* longer than 1.5 FWHM of 2 px */
        double t = 3.0 * pitch_um / depth_um, share = 1.0 / (1.0 + t * t);
        bst_assert_close(drawn / n, share, 4.0 * sqrt(share * (1.0 - share) / n) + 0.01);
        bst_assert_close(turned[0] / drawn, 0.0, 4.0 * sqrt(0.5 / drawn));
        bst_assert_close(turned[1] / drawn, 0.0, 4.0 * sqrt(0.5 / drawn));
        close_scene(&s);
    }
}

/* Share of a Gaussian's light in pixel k along an axis. */
static double axis_share(double at, double sigma, int k) {
    double c = sigma * sqrt(2.0);
    return 0.5 * (erf((k + 0.5 - at) / c) - erf((k - 0.5 - at) / c));
}

/* Light of a bright star beyond the edge is a source on the edge; of a fainter one it is too
 * little. */
static void bright_stars_beyond_the_edge_are_on_it(void **state) {
    (void)state;
    enum { X0 = 40, Y0 = 130, WIDE = 640, HIGH = 220 };
    scene s;
    open_scene(&s);
    start(&s);
    const double sigma = s.frame.sigma_px;
    for (int k = 1; k <= 3; k++) {
        /* output of the filter on the pixel at the edge, for a star so many pixels beyond */
        double beyond = k, square = 0.0, sum = 0.0;
        for (int i = -12; i <= 12; i++) {
            double filter = axis_share(0.0, sigma, i);
            square += filter * filter;
            sum += i <= 0 ? filter * axis_share(beyond, sigma, i) : 0.0;
        }
        double share = sum / square;  /* of the SNR of the whole star */
        for (int n = 0; n < 8; n++) { /* faint and bright, beyond each of the sides */
            bool bright = n % 2, above = n / 2 % 2, upright = n / 4;
            double expected = bright ? 100.0 : 1.5, last = upright ? HIGH - 1 : WIDE - 1;
            double off = above ? last + beyond : -beyond, on = above ? last : 0.0;
            s.frame.window = (bst_window){X0, Y0, WIDE, HIGH};
            s.truth->count = 0;
            add_source(&s, 1, X0 + (upright ? 300.2 : off), Y0 + (upright ? off : 100.2),
                       electrons_of(&s, expected / share));
            bst_generator_result r = run(&s, k);
            assert_int_equal(r.count, bright);
            if (bright) {
                const bst_detection *d = &r.items[0].detection;
                assert_int_equal(d->label, BST_LABEL_ARTEFACT);
                double across = upright ? d->y_px - Y0 : d->x_px - X0,
                       along = upright ? d->x_px - X0 : d->y_px - Y0;
                bst_assert_close(across, on, 0.2);
                bst_assert_close(along, upright ? 300.2 : 100.2, 0.5);
                /* noise is less on the edge, where the filter has 0.78 of its squares; the pixel of
                 * a narrow PSF is no Gaussian: 1.24 and 1.5 at 2 and 3 px */
                bst_assert_close(log(d->snr / (expected / sqrt(0.78))), 0.0, 0.5);
            }
        }
    }
    close_scene(&s);
}

/* With the stars' streak in the filter, false alarms have its length and direction and the
 * covariance of a streak: in its own axes, on a binned window. */
static void alarms_of_a_streak_are_streaks(void **state) {
    (void)state;
    for (int b = 1; b <= 2; b++) {
        for (int down = 0; down < 2; down++) {
            scene s;
            open_scene(&s);
            s.settings.false_alarms_per_frame = 300.0;
            s.frame.window = (bst_window){96, 160, 800, 480};
            s.frame.binning = b;
            s.frame.streak_dx_px = 12.0 * b;
            s.frame.streak_dy_px = (down ? -5.0 : 5.0) * b;
            start(&s);
            bst_crlb_table bound;
            bst_crlb_table_init(&bound, s.frame.sigma_px / b);
            bst_generator_result r = run(&s, 3);
            int drawn = 0;
            for (int i = 0; i < r.count; i++) {
                const bst_detection *d = &r.items[i].detection;
                bool streak = d->flags & BST_DETECTION_STREAK;
                double length = streak ? 13.0 : 0.0;
                drawn += streak;
                bst_crlb_table_at want = bst_crlb_table_of(&bound, d->flux_e, r.noise_e, length);
                double c = 12.0 / 13.0, q = s.frame.streak_dy_px / (13.0 * b);
                double along = c * c * d->cov_xx + 2.0 * c * q * d->cov_xy + q * q * d->cov_yy;
                double across = q * q * d->cov_xx - 2.0 * c * q * d->cov_xy + c * c * d->cov_yy;
                double mixed = c * q * (d->cov_yy - d->cov_xx) + (c * c - q * q) * d->cov_xy;
                double px2 = b * b;
                bst_assert_close(along / px2, want.var_along_px2, 1e-6 * want.var_along_px2);
                bst_assert_close(across / px2, want.var_across_px2, 1e-6 * want.var_along_px2);
                bst_assert_close(mixed / px2, 0.0, 1e-6 * want.var_along_px2);
                bst_assert_close(d->snr * r.noise_e / d->flux_e,
                                 bst_crlb_table_norm(&bound, length), 1e-6);
                double sigma = s.frame.sigma_px / b;
                bst_assert_close(d->length_px / b,
                                 BST_FWHM_PER_SIGMA * sqrt(sigma * sigma + length * length / 12.0),
                                 1e-6);
                bst_assert_close(d->width_px / b, BST_FWHM_PER_SIGMA * sigma, 1e-6);
                bst_assert_close(d->angle_rad, streak ? atan2(q, c) : 0.0, 1e-9);
                /* cut: two deviations and half the path from an edge */
                double half_x = b * (2.0 * sigma + 0.5 * length * c),
                       half_y = b * (2.0 * sigma + 0.5 * length * fabs(q));
                bool cut = d->x_px < 95.5 + half_x || d->x_px > 895.5 - half_x ||
                           d->y_px < 159.5 + half_y || d->y_px > 639.5 - half_y;
                assert_int_equal((d->flags & BST_DETECTION_EDGE) != 0, cut);
            }
            assert_true(drawn > 30);
            close_scene(&s);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(false_alarms_are_poisson_with_a_gaussian_tail),
        cmocka_unit_test(hits_come_at_the_detectors_rate),
        cmocka_unit_test(charge_is_labelled_by_its_sharpness),
        cmocka_unit_test(a_full_sky_hides_everything),
        cmocka_unit_test(wings_make_alarms),
        cmocka_unit_test(crowded_frames_are_looked_at_twice),
        cmocka_unit_test(hits_of_a_smeared_frame),
        cmocka_unit_test(hits_on_a_binned_window),
        cmocka_unit_test(alarms_of_a_streak_are_streaks),
        cmocka_unit_test(bright_stars_beyond_the_edge_are_on_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
