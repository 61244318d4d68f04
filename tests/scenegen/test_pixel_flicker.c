/* 1/f noise of single pixels from frame to frame, and noise of their reset: the recursion against
 * covariance and spectrum in closed form, frames against the recursion. */
#include "scenegen/detector/pixel_noise.h"
#include "tests/archive_support.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

/* columns in two chunks of 64, and more rows than that */
enum { WIDTH = 70, HEIGHT = 140, PIXELS = WIDTH * HEIGHT, FRAMES = 6 };

static const bst_detector_pixel_flicker_config NOISE = {3.0, 1e-3, 2.0};
/* ends of exposures, s: distances of 0.2 s to 5,000 s, and two reads at once */
static const double READ_S[FRAMES] = {10.0, 10.2, 11.0, 140.0, 140.0, 5140.0};

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_camera camera;
} fixture;

/* Covariance that the processes give frames i and j, by their definition: values, or differences of
 * two reads. */
static double covariance_of(const bst_pixel_flicker *f, int i, int j, double apart_s) {
    double t = READ_S[i] - READ_S[j];
    double same = bst_pixel_flicker_covariance(f, t);
    return apart_s > 0.0 ? 2.0 * same - bst_pixel_flicker_covariance(f, t + apart_s) -
                               bst_pixel_flicker_covariance(f, t - apart_s)
                         : same;
}

/* The frames are linear in their deviates, so that their covariance follows without any noise. */
static void frames_have_the_covariance(void **state) {
    (void)state;
    const double apart[3] = {0.0, 0.05, 0.15}, white[3] = {2.0, 1.5, 0.1};
    for (int c = 0; c < 3; c++) {
        bst_detector_config d = {.pixel_flicker_noise = NOISE, .double_sampling_s = apart[c]};
        bst_pixel_flicker f;
        bst_pixel_flicker_begin(&d, &f);
        assert_int_equal(f.terms, 7); /* 2000 = 4^5.5 */
        double response[FRAMES][FRAMES] = {{0}}, m[FRAMES][BST_FLICKER_TERMS] = {{0}};
        const int used = c == 0 ? FRAMES : 4; /* reads of two frames do not overlap */
        for (int i = 0; i < used; i++) {
            bst_pixel_flicker_step s;
            bst_pixel_flicker_advance(&f, READ_S[i], apart[c], white[c], &s);
            for (int n = 0; n <= i; n++) { /* by the deviate of frame n alone */
                double z = n == i;
                response[i][n] = s.spread * z;
                for (int k = 0; k < s.terms; k++) {
                    response[i][n] += s.weight[k] * m[n][k];
                    m[n][k] = s.decay[k] * m[n][k] + s.gain[k] * z;
                }
            }
        }
        for (int i = 0; i < used; i++) {
            for (int j = 0; j <= i; j++) {
                double sum = 0.0;
                for (int n = 0; n <= j; n++) {
                    sum += response[i][n] * response[j][n];
                }
                double want = covariance_of(&f, i, j, apart[c]) + (i == j) * white[c] * white[c];
                /* rounding of the filter's covariances, which are about 9 e-^2 */
                bst_assert_close(sum, want, 1e-11);
            }
        }
        bst_assert_close(bst_pixel_flicker_noise_e(&d), sqrt(covariance_of(&f, 0, 0, apart[c])),
                         1e-12);
    }
}

/* Power spectrum: the sum of Lorentzians is sigma^2 / (f n ln ratio) within 6 % between twice the
 * lowest and half of the highest frequency of three decades, and is the Fourier transform of the
 * autocovariance. */
static void spectrum_is_one_over_f(void **state) {
    (void)state;
    const bst_detector_config d = {.pixel_flicker_noise = {1.0, 1e-2, 1e-2 * 4096.0}};
    bst_pixel_flicker f;
    bst_pixel_flicker_begin(&d, &f);
    assert_int_equal(f.terms, 7);
    for (int i = 0; i <= 40; i++) {
        double hz = 0.16 * pow(16.0, i / 40.0), sum = 0.0;
        for (int k = 0; k < f.terms; k++) {
            double tau_s = 1.0 / f.rate_per_s[k], w = 2.0 * BST_PI * hz * tau_s;
            sum += 4.0 * f.variance_e2 * tau_s / (1.0 + w * w);
        }
        /* the ends of the range lack what terms beyond them would add: 2/pi atan(1/16) each */
        bst_assert_close(sum * hz * f.terms * log(4.0), 1.0, 0.14);
    }
    const double hz = 1.0, step_s = 2e-4;
    double integral = 0.5 * bst_pixel_flicker_covariance(&f, 0.0), sum = 0.0;
    for (int n = 1; n < 300000; n++) {
        double t = n * step_s;
        integral += bst_pixel_flicker_covariance(&f, t) * cos(2.0 * BST_PI * hz * t);
    }
    for (int k = 0; k < f.terms; k++) {
        double tau_s = 1.0 / f.rate_per_s[k], w = 2.0 * BST_PI * hz * tau_s;
        sum += 4.0 * f.variance_e2 * tau_s / (1.0 + w * w);
    }
    bst_assert_close(4.0 * step_s * integral / sum, 1.0, 1e-3); /* rectangles of 0.2 ms, 60 s */
}

static bst_renderer *make(fixture *f) {
    bst_renderer *r;
    bst_renderer_options options = bst_renderer_default_options();
    options.shared_program = true;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &f->camera, &options, &r));
    return r;
}

/* A dark frame of no charge, in electrons. */
static void expose(fixture *f, bst_renderer *r, int id, bst_window window, float *electrons) {
    const double time_s[2] = {0.0, 0.125};
    const bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    const bst_los_track track = {2, time_s, q};
    const bst_render_request request = {.window = window,
                                        .track = &track,
                                        .key = {{3, 4}},
                                        .exposure_id = id,
                                        .start_s = READ_S[id] - 0.125};
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    for (int i = 0; i < window.width * window.height; i++) {
        electrons[i] = (float)((pixels[i] - f->camera.offset_dn) * f->camera.gain_e_per_dn);
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
}

static void set_camera(fixture *f) {
    f->camera = scene_camera(WIDTH, HEIGHT);
    f->camera.detector.dark_doubling_k = 6.5;
    f->camera.read_noise_e = 2.0;
    f->camera.gain_e_per_dn = 1e-3;
    f->camera.offset_dn = 30000.0;
}

/* Pixels follow the recursion by the deviates of the frame, which a renderer without earlier frames
 * shows alone. One frame is a window: the pixels around it have that frame, too. */
static void pixels_follow_the_recursion(void **state) {
    static float alone[PIXELS], frame[PIXELS];
    static double m[PIXELS][BST_FLICKER_TERMS];
    fixture *f = *state;
    const bst_window all = {0, 0, WIDTH, HEIGHT}, part = {13, 7, 50, 125};
    const double alone_e = sqrt(15.25); /* 3 e-, 2 e- and 1.5 e- */
    set_camera(f);
    f->camera.detector.pixel_flicker_noise = NOISE;
    f->camera.detector.reset_noise_e = 1.5;
    bst_assert_close(bst_camera_white_noise_e(&f->camera), 2.5, 1e-15);
    bst_assert_close(bst_camera_read_noise_e(&f->camera), alone_e, 1e-14);
    bst_renderer *r = make(f);
    bst_pixel_flicker flicker;
    bst_pixel_flicker_begin(&f->camera.detector, &flicker);
    memset(m, 0, sizeof m);
    double squares = 0.0;
    for (int i = 0; i < FRAMES; i++) {
        const bst_window w = i == 2 ? part : all;
        bst_pixel_flicker_step s;
        bst_pixel_flicker_advance(&flicker, READ_S[i], 0.0, 2.5, &s);
        bst_renderer *first = make(f);
        expose(f, first, i, all, alone);
        bst_renderer_free(first);
        expose(f, r, i, w, frame);
        for (int p = 0; p < PIXELS; p++) {
            int x = p % WIDTH - w.x0, y = p / WIDTH - w.y0;
            double z = (double)alone[p] / alone_e, want = s.spread * z;
            squares += z * z / (FRAMES * PIXELS);
            for (int k = 0; k < s.terms; k++) {
                want += s.weight[k] * m[p][k];
                m[p][k] = s.decay[k] * m[p][k] + s.gain[k] * z;
            }
            if (x >= 0 && x < w.width && y >= 0 && y < w.height) {
                /* both frames are rounded to 1e-3 e-: half of that, times up to 2.2 */
                bst_assert_close((double)frame[y * w.width + x], want, 2.5e-3);
            }
        }
    }
    bst_renderer_free(r);
    bst_assert_close(squares, 1.0, 4.0 * sqrt(2.0 / (FRAMES * PIXELS)));
}

/* A state that is restored, and a renderer that takes over, go on to the bit. */
static bst_status archive(void *self, bst_archive *a) {
    return bst_renderer_archive(self, a);
}

static void noise_is_saved_and_handed_over(void **state) {
    static float first[PIXELS], next[PIXELS], again[PIXELS], fresh[PIXELS];
    fixture *f = *state;
    const bst_window all = {0, 0, WIDTH, HEIGHT};
    set_camera(f);
    f->camera.detector.pixel_flicker_noise = NOISE;
    f->camera.detector.double_sampling_s = 0.05;
    bst_assert_close(bst_camera_white_noise_e(&f->camera), sqrt(8.0), 1e-14);
    bst_renderer *r = make(f), *other = make(f);
    expose(f, r, 0, all, first);
    test_saved saved = test_save(archive, r);
    expose(f, r, 1, all, next);
    expose(f, other, 1, all, fresh);
    assert_memory_not_equal(fresh, next, sizeof next);
    bst_assert_ok(&f->ctx, test_restore(&f->ctx, archive, other, saved));
    expose(f, other, 1, all, again);
    assert_memory_equal(again, next, sizeof next);
    bst_assert_ok(&f->ctx, test_restore(&f->ctx, archive, r, saved));
    bst_renderer_inherit(other, r);
    expose(f, other, 1, all, again);
    assert_memory_equal(again, next, sizeof next);
    expose(f, r, 1, all, again); /* nothing is left where it came from */
    assert_memory_equal(again, fresh, sizeof next);
    memset(saved.bytes + saved.size / 2, 0xFF, 16); /* not a number at any alignment */
    assert_int_equal(test_restore(&f->ctx, archive, other, saved), BST_ERR_FORMAT);
    free(saved.bytes);
    bst_renderer_free(other);
    bst_renderer_free(r);
}

/* Reset noise is part of the read noise, and neither of a ramp nor of double sampling. */
static void resets_have_noise(void **state) {
    static float frame[PIXELS];
    fixture *f = *state;
    set_camera(f);
    f->camera.detector.reset_noise_e = 5.0;
    f->camera.detector.frame_transfer_s = 1e-3; /* the same compiled read-out as above */
    bst_renderer *r = make(f);
    expose(f, r, 0, (bst_window){0, 0, WIDTH, HEIGHT}, frame);
    bst_renderer_free(r);
    double squares = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        squares += (double)frame[i] * (double)frame[i];
    }
    bst_assert_close(squares / PIXELS / 29.0, 1.0, 4.0 * sqrt(2.0 / PIXELS));
    f->camera.detector.double_sampling_s = 1e-5;
    bst_assert_close(bst_camera_read_noise_e(&f->camera), sqrt(8.0), 1e-14);
    f->camera.detector.double_sampling_s = 0.0;
    f->camera.detector.ramp.reads = 2;
    bst_assert_close(bst_camera_read_noise_e(&f->camera), sqrt(8.0), 1e-14);
}

static void impossible_noise_is_refused(void **state) {
    fixture *f = *state;
    bst_detector_config d = {.pixel_flicker_noise = {1.0, 1.0, 0.5}};
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message,
                           "highest_hz is 0.5 and lowest_hz 1; allowed are 1 to "
                           "262144 times"));
    d.pixel_flicker_noise.highest_hz = 262144.0;
    bst_assert_ok(&f->ctx, bst_detector_config_check(&f->ctx, &d));
    d.pixel_flicker_noise.highest_hz = 262145.0;
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    d.pixel_flicker_noise.highest_hz = 1.0;
    d.ramp.reads = 4;
    assert_int_equal(bst_detector_config_check(&f->ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(f->ctx.message, "pixel_flicker_noise"));
    set_camera(f);
    f->camera.detector.pixel_flicker_noise = NOISE;
    const double time_s[2] = {0.0, 1.0};
    const bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    const bst_los_track track = {2, time_s, q};
    const bst_render_request request = {
        .window = {0, 0, WIDTH, HEIGHT}, .track = &track, .binning = 2};
    bst_renderer *r = make(f);
    bst_frame *frame;
    assert_int_equal(bst_renderer_render(&f->ctx, r, &request, &frame), BST_ERR_ARGUMENT);
    assert_non_null(strstr(f->ctx.message, "pixel_flicker_noise"));
    bst_renderer_free(r);
}

static int open_device(void **state) {
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    return f && bst_device_open(&f->ctx, "", 0, &f->device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    fixture *f = *state;
    bst_device_close(f->device);
    free(f);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_have_the_covariance),
        cmocka_unit_test(spectrum_is_one_over_f),
        cmocka_unit_test(pixels_follow_the_recursion),
        cmocka_unit_test(noise_is_saved_and_handed_over),
        cmocka_unit_test(resets_have_noise),
        cmocka_unit_test(impossible_noise_is_refused),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
