/* Non-destructive reads: mean and noise of the fitted line against closed forms, and against the
 * light of the intervals. */
#include "sim/optics/ramp_fit.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 192, PIXELS = SIDE * SIDE, READS = 8 };

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_camera camera;
    bst_renderer *renderer;
    bst_render_request request;
    bst_los_track track;
    double time_s[2];
    bst_quat q[2];
} fixture;

/* A camera of 8 reads in 0.7 s. */
static fixture *open_with(void **state, double sky_e, double dark_e_per_s) {
    fixture *f = *state;
    f->camera = scene_camera(SIDE, SIDE);
    f->camera.detector.dark_doubling_k = 6.5;
    f->camera.dark_current_e_per_s = dark_e_per_s;
    f->camera.detector.ramp.reads = READS;
    f->camera.offset_dn = 1000.0;
    f->time_s[1] = 0.7;
    f->q[0] = f->q[1] = BST_QUAT_IDENTITY;
    f->track = (bst_los_track){2, f->time_s, f->q};
    f->request = (bst_render_request){.window = {0, 0, SIDE, SIDE},
                                      .track = &f->track,
                                      .background_e = sky_e + 0.7 * dark_e_per_s,
                                      .dark_e = 0.7 * dark_e_per_s,
                                      .key = {{3, 4}}};
    return f;
}

static void make(fixture *f) {
    bst_renderer_free(f->renderer);
    bst_renderer_options options = bst_renderer_default_options();
    options.saturation_flags = true;
    options.shared_program = true; /* compiled once, not for each effect */
    bst_assert_ok(&f->ctx,
                  bst_renderer_create(&f->ctx, f->device, &f->camera, &options, &f->renderer));
}

/* Frame `id` in electrons from the offset on. */
static void expose(fixture *f, int64_t id, double *electrons) {
    bst_frame *frame;
    const uint16_t *pixels;
    f->request.exposure_id = id;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, f->renderer, &f->request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    for (int i = 0; i < frame->width * frame->height; i++) {
        electrons[i] = (pixels[i] - f->camera.offset_dn) * f->camera.gain_e_per_dn;
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
}

/* Asserts mean and variance of all pixels of a frame, rounding included. */
static void assert_law(const double *frame, double mean, double variance) {
    double sum = 0.0, squares = 0.0;
    variance += 1.0 / 12.0;
    for (int i = 0; i < PIXELS; i++) {
        sum += frame[i] - mean;
        squares += (frame[i] - mean) * (frame[i] - mean);
    }
    bst_assert_close(sum / PIXELS, 0.0, 4.0 * sqrt(variance / PIXELS));
    bst_assert_close(squares / PIXELS, variance, 4.0 * variance * sqrt(2.1 / PIXELS));
}

/* Read noise and shot noise of a line (Garnett and Forrest 1993, equations in ramp_fit.h). */
static void lines_have_closed_forms(void **state) {
    (void)state;
    for (int n = 2; n <= BST_RAMP_READS; n++) {
        bst_detector_ramp_config ramp = {.reads = n};
        double all = n;
        bst_assert_close(bst_ramp_excess(&ramp), 1.2 * (all * all + 1.0) / (all * (all + 1.0)),
                         1e-12);
        bst_assert_close(bst_ramp_noise_e(&ramp, 5.0, n),
                         5.0 * sqrt(12.0 * (all - 1.0) / (all * (all + 1.0))), 1e-11);
        ramp.fit = BST_RAMP_LAST_MINUS_FIRST;
        bst_assert_close(bst_ramp_excess(&ramp), 1.0, 1e-12);
        bst_assert_close(bst_ramp_noise_e(&ramp, 5.0, n), 5.0 * sqrt(2.0), 1e-11);
        /* the 1/f noise of two reads that are n - 1 apart */
        double apart = 0.0;
        for (int k = 0; k < 6; k++) {
            apart += 9.0 / 6.0 * exp(-(n - 1) / pow(4.0, k));
        }
        ramp.flicker_noise_e = 3.0;
        bst_assert_close(bst_ramp_noise_e(&ramp, 0.0, n), sqrt(2.0 * (9.0 - apart)), 1e-11);
    }
    bst_camera camera = scene_camera(16, 16);
    bst_assert_close(bst_camera_read_noise_e(&camera), 8.0, 0.0);
    bst_assert_close(bst_camera_full_e(&camera), 65000.0, 0.0);
    camera.detector.ramp.reads = 8;
    bst_assert_close(bst_camera_read_noise_e(&camera), 8.0 * sqrt(84.0 / 72.0), 1e-12);
    bst_assert_close(bst_camera_excess_noise(&camera), 1.2 * 65.0 / 72.0, 1e-12);
    bst_assert_close(bst_camera_full_e(&camera), 455000.0, 1e-6);
    bst_assert_close(bst_camera_noise_e(&camera, 600.0, 1.0),
                     sqrt(600.0 * 1.2 * 65.0 / 72.0 + 64.0 * 84.0 / 72.0), 1e-9);
}

/* Frames of a flat: both lines, with 1/f noise, and with a well that is full at the fifth read. */
static void flats_have_their_noise(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 2000.0, 143.0);
    bst_detector_ramp_config *ramp = &f->camera.detector.ramp;
    make(f);
    expose(f, 0, frame);
    double noise_e = bst_camera_read_noise_e(&f->camera);
    assert_law(frame, 2100.1, 2100.1 * bst_ramp_excess(ramp) + noise_e * noise_e);
    ramp->flicker_noise_e = 60.0;
    ramp->fit = BST_RAMP_LAST_MINUS_FIRST;
    make(f);
    expose(f, 1, frame);
    noise_e = bst_camera_read_noise_e(&f->camera);
    assert_true(noise_e > 30.0);
    assert_law(frame, 2100.1, 2100.1 + noise_e * noise_e);

    /* reads of 300, 600 and 900 electrons are used, 1200 is beyond the well: 4 standard deviations
     */
    *ramp = (bst_detector_ramp_config){.reads = READS};
    f->camera.full_well_e = 1050.0;
    make(f);
    expose(f, 2, frame);
    double weight[READS], of_interval = 0.0, shot = 0.0;
    bst_ramp_weights(ramp, 4, weight);
    for (int i = 3; i > 0; i--) {
        of_interval += weight[i];
        shot += of_interval * of_interval * 300.01;
    }
    noise_e = bst_ramp_noise_e(ramp, 8.0, 4);
    assert_law(frame, 2100.1, shot + noise_e * noise_e);
    long long full;
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, f->renderer, &full));
    assert_int_equal(full, 0);
    f->camera.full_well_e = 150.0;
    f->camera.read_noise_e = 0.0;
    make(f);
    expose(f, 3, frame);
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, f->renderer, &full));
    assert_int_equal(full, PIXELS);
    for (int i = 0; i < PIXELS; i++) {
        bst_assert_close(frame[i], 1050.0, 0.5);
    }
    /* each read passes the amplifier before the line is fitted */
    f->camera.full_well_e = 10000.0;
    f->camera.detector.nonlinearity[0] = -0.3;
    make(f);
    expose(f, 4, frame);
    bst_ramp_weights(ramp, READS, weight);
    double mean = 0.0;
    for (int i = 1; i < READS; i++) {
        double q = 300.014 * i;
        mean += weight[i] * (q - 0.3 * (q * q + q) / 10000.0); /* mean square of Poisson charge */
    }
    double sum = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        sum += frame[i] / PIXELS;
    }
    bst_assert_close(sum, mean, 4.0 * sqrt(2300.0 / PIXELS));
}

/* Signals that are drawn at once, a little above the least of them, in steady light: mean, variance
 * and skewness of the line through Poisson charges, whose cumulants are the sums of weight^k mean.
 */
static void lines_drawn_at_once_have_the_moments(void **state) {
    static double frame[PIXELS];
    enum { FRAMES = 12 };
    static const int reads[2] = {6, 16};
    const double all = (double)FRAMES * PIXELS;
    fixture *f = open_with(state, 405.0, 0.0);
    f->camera.gain_e_per_dn = 0.05;
    f->camera.read_noise_e = 0.0;
    for (int c = 0; c < 2; c++) {
        const bst_detector_ramp_config ramp = {.reads = reads[c]};
        double weight[BST_RAMP_READS], of_interval = 0.0, cumulant[4] = {0.0};
        bst_ramp_weights(&ramp, reads[c], weight);
        for (int i = reads[c] - 1; i > 0; i--) {
            double part = 405.0 / (reads[c] - 1);
            of_interval += weight[i];
            for (int k = 1; k <= 3; k++) {
                part *= of_interval;
                cumulant[k] += part;
            }
        }
        assert_true(cumulant[1] > 400.0);
        f->camera.detector.ramp = ramp;
        make(f);
        double moment[4] = {0.0};
        for (int id = 0; id < FRAMES; id++) {
            expose(f, 20 + id, frame);
            for (int i = 0; i < PIXELS; i++) {
                double d = frame[i] - cumulant[1];
                moment[1] += d / all;
                moment[2] += d * d / all;
                moment[3] += d * d * d / all;
            }
        }
        double sigma = sqrt(cumulant[2]), skewness = cumulant[3] / (sigma * sigma * sigma);
        double found = (moment[3] - 3.0 * moment[1] * moment[2]) / pow(moment[2], 1.5);
        /* four standard errors: 0.12 e-, 0.9 %, 0.015 */
        bst_assert_close(moment[1], 0.0, 4.0 * sigma / sqrt(all));
        bst_assert_close(moment[2] / cumulant[2], 1.0, 4.0 * sqrt(2.0 / all));
        assert_true(skewness > 0.05); /* 0 without the expansion */
        bst_assert_close(found, skewness, 4.0 * sqrt(6.0 / all));
    }
}

/* A star that crosses the frame: each part of its streak has the weight of its time. */
static void light_has_the_weight_of_its_time(void **state) {
    static double frame[PIXELS], want[PIXELS], variance[PIXELS];
    static float image[PIXELS];
    fixture *f = open_with(state, 50.0, 10.0);
    make(f);
    double scale = f->camera.pixel_scale_arcsec * BST_ARCSEC_RAD;
    f->q[0] = bst_quat_from_rotvec((bst_vec3){0.0, -30.0 * scale, 0.0});
    f->q[1] = bst_quat_from_rotvec((bst_vec3){0.0, 30.0 * scale, 0.0});
    const bst_scene_source star = {
        .kind = BST_SOURCE_STAR, .apparent_mid = {0.0, 0.0, 1.0}, .electrons_per_s = 1e6};
    f->request.sources = &star;
    f->request.count = 1;
    double weight[READS], of_interval[READS] = {0};
    bst_ramp_weights(&f->camera.detector.ramp, READS, weight);
    for (int i = READS - 1; i > 0; i--) {
        of_interval[i - 1] = weight[i] + (i < READS - 1 ? of_interval[i] : 0.0);
    }
    memset(want, 0, sizeof want);
    memset(variance, 0, sizeof variance);
    for (int k = 0; k < READS - 1; k++) {
        double from = k / (READS - 1.0), to = (k + 1) / (READS - 1.0);
        const double time_s[2] = {0.0, 0.1};
        const bst_quat q[2] = {
            bst_quat_from_rotvec((bst_vec3){0.0, (60.0 * from - 30.0) * scale, 0.0}),
            bst_quat_from_rotvec((bst_vec3){0.0, (60.0 * to - 30.0) * scale, 0.0})};
        const bst_los_track track = {2, time_s, q};
        bst_render_request part = f->request;
        part.track = &track;
        part.background_e /= READS - 1.0;
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, f->renderer, &part, image));
        for (int i = 0; i < PIXELS; i++) {
            want[i] += of_interval[k] * (double)image[i];
            variance[i] += of_interval[k] * of_interval[k] * (double)image[i];
        }
    }
    double chi2 = 0.0, noise_e = bst_camera_read_noise_e(&f->camera), light = 0.0, most = 0.0;
    expose(f, 5, frame);
    for (int i = 0; i < PIXELS; i++) {
        double v = variance[i] + noise_e * noise_e + 1.0 / 12.0;
        chi2 += (frame[i] - want[i]) * (frame[i] - want[i]) / v / PIXELS;
        light += want[i] - 57.0;
        most = fmax(most, want[i]);
    }
    bst_assert_close(chi2, 1.0, 5.0 * sqrt(2.0 / PIXELS));
    assert_true(most > 3000.0);               /* the streak is there, */
    bst_assert_close(light, 7e5, 7e5 * 1e-3); /* with all of its light */
}

/* The charge of hits, each with the weight of its interval: these have the mean 1. */
static void hits_come_between_the_reads(void **state) {
    static double frame[PIXELS], first[PIXELS];
    fixture *f = open_with(state, 0.0, 0.0);
    f->camera.read_noise_e = 0.0;
    f->camera.full_well_e = 1e6;
    f->camera.gain_e_per_dn = 4.0;
    f->camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){3000.0, 13, 15, 75, 0.15, 0};
    make(f);
    double weight[READS], shares = 0.0, last = 0.0, sum = 0.0, charge = 0.0;
    int tracks = 0;
    bst_ramp_weights(&f->camera.detector.ramp, READS, weight);
    for (int i = READS - 1; i > 0; i--) {
        last += weight[i];
        shares += last * last / (READS - 1.0);
    }
    for (int k = 0; k < 8; k++) {
        bst_render_stats stats;
        expose(f, k, frame);
        bst_renderer_get_stats(f->renderer, &stats);
        charge += stats.hits_e;
        tracks += stats.hits;
        for (int i = 0; i < PIXELS; i++) {
            sum += frame[i];
        }
        if (k == 0) {
            memcpy(first, frame, sizeof first);
        }
    }
    assert_true(tracks > 500);
    /* the relative spread of a hit's charge is below 2 */
    bst_assert_close(sum / charge, 1.0, 4.0 * sqrt((shares - 1.0) * 5.0 / tracks) + 0.01);
    /* nothing is left of a frame's hits in later ones: the first frame comes again as it was */
    expose(f, 0, frame);
    assert_memory_equal(frame, first, sizeof frame);
}

/* A star that rests until its pixels are full and then leaves: traps take charge from them, which
 * makes no later read usable. */
static void full_pixels_stay_full(void **state) {
    static double frame[PIXELS];
    static float image[PIXELS];
    fixture *f = open_with(state, 0.0, 0.0);
    f->camera.gain_e_per_dn = 8.0;
    f->camera.detector.persistence =
        (bst_detector_persistence_config){{0.2}, {1.0, 1.0, 1.0, 1.0, 1.0}};
    /* 20,000 e- in each of the first four intervals */
    const double time_s[4] = {0.0, 0.4, 0.401, 0.7};
    const double away = 150.0 * f->camera.pixel_scale_arcsec * BST_ARCSEC_RAD;
    const bst_quat gone = bst_quat_from_rotvec((bst_vec3){0.0, away, 0.0});
    const bst_quat q[4] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY, gone, gone};
    const bst_los_track track = {4, time_s, q};
    bst_scene_source star = {
        .kind = BST_SOURCE_STAR, .apparent_mid = {0.0, 0.0, 1.0}, .electrons_per_s = 1e5};
    f->request.track = &track;
    f->request.sources = &star;
    f->request.count = 1;
    f->request.start_s = 0.0;
    make(f);
    bst_assert_ok(&f->ctx,
                  bst_renderer_render_noise_free(&f->ctx, f->renderer, &f->request, image));
    int peak = 0;
    for (int i = 0; i < PIXELS; i++) {
        peak = image[i] > image[peak] ? i : peak;
    }
    star.electrons_per_s *= 8e4 / (double)image[peak];
    make(f);
    expose(f, 10, frame);
    /* three reads are used: 140,000 e- less what is trapped until then, at most 0.2 x 0.3 of it;
     * with the last three reads too it would be 0.86 of it */
    const bst_detector_persistence_config *c = &f->camera.detector.persistence;
    double n = 0.0, sum = 0.0, weight[READS];
    bst_ramp_weights(&f->camera.detector.ramp, 4, weight);
    for (int i = 1; i < 4; i++) {
        for (int s = 0; s < 1000; s++) {
            double charge = 2e4 * (i - 1 + (s + 0.5) / 1000.0);
            n += 1e-4 * (c->trapped_share[0] * charge - n) / c->time_constant_s[0];
        }
        sum += weight[i] * (2e4 * i - n);
    }
    bst_assert_close(frame[peak], sum, 4.0 * 1.5 * sqrt(6e4) * 7.0 / 3.0);
}

/* Traps fill as the charge of the ramp grows: a flat and the dark after it. */
static void ramps_leave_charge_behind(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 20000.0, 0.0);
    f->camera.detector.persistence =
        (bst_detector_persistence_config){{0.1, 0.0, 0.05, 0.0, 0.0}, {0.4, 1.0, 5.0, 1.0, 1.0}};
    make(f);
    const bst_detector_persistence_config *c = &f->camera.detector.persistence;
    double n[2] = {0.0, 0.0}, weight[READS];
    bst_ramp_weights(&f->camera.detector.ramp, READS, weight);
    for (int k = 0; k < 2; k++) {
        double sky = k == 0 ? 20000.0 : 0.0, mean = 0.0, shot = 0.0, before = n[0] + n[1];
        double step_s = 0.1 / 1000.0, read[READS] = {0.0};
        for (int i = 1; i < READS; i++) {
            for (int s = 0; s < 1000; s++) { /* midpoint rule: 1e-9 of what is trapped */
                double q = sky * ((i - 1) + (s + 0.5) / 1000.0) / (READS - 1.0);
                for (int j = 0; j < 2; j++) {
                    double rate = (c->trapped_share[2 * j] * q - n[j]) / c->time_constant_s[2 * j];
                    double middle = n[j] + 0.5 * step_s * rate;
                    n[j] +=
                        step_s * (c->trapped_share[2 * j] * q - middle) / c->time_constant_s[2 * j];
                }
            }
            read[i] = sky * i / (READS - 1.0) + before - n[0] - n[1];
            mean += weight[i] * read[i];
        }
        double of_interval = 0.0;
        for (int i = READS - 1; i > 0; i--) {
            of_interval += weight[i];
            shot += of_interval * of_interval * (read[i] - read[i - 1]);
        }
        f->request.background_e = sky;
        f->request.start_s = 0.7 * k;
        expose(f, k, frame);
        double noise_e = bst_camera_read_noise_e(&f->camera);
        assert_law(frame, mean, shot + noise_e * noise_e);
        assert_true(k == 0 ? mean < 19500.0 : mean > 300.0);
    }
}

static void ramps_exclude_moving_charge(void **state) {
    fixture *f = *state;
    bst_detector_config d = {.ramp.reads = 1};
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message, "ramp/reads: 1 read gives no slope"));
    d.ramp.reads = 4;
    d.frame_transfer_s = 0.1;
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(
        strstr(f->ctx.message,
               "ramp/reads: 4 non-destructive reads cannot be combined with frame_transfer_s"));
    d = (bst_detector_config){.ramp.reads = 4, .interpixel_coupling = 0.02};
    bst_assert_ok(&f->ctx, bst_detector_config_check(&f->ctx, &d));
}

static int open_device(void **state) {
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    return f && bst_device_open(&f->ctx, "", 0, &f->device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    fixture *f = *state;
    bst_renderer_free(f->renderer);
    bst_device_close(f->device);
    free(f);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_have_closed_forms),
        cmocka_unit_test(flats_have_their_noise),
        cmocka_unit_test(lines_drawn_at_once_have_the_moments),
        cmocka_unit_test(light_has_the_weight_of_its_time),
        cmocka_unit_test(hits_come_between_the_reads),
        cmocka_unit_test(full_pixels_stay_full),
        cmocka_unit_test(ramps_leave_charge_behind),
        cmocka_unit_test(ramps_exclude_moving_charge),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
