/* Effects between pixels on a sensor whose sides are no multiples of the kernels' vectors and
 * blocks: traps along rows, and crosstalk. Rows of windows of it. */
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { WIDTH = 150, HEIGHT = 77, PIXELS = WIDTH * HEIGHT };

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_camera camera;
} fixture;

/* A window of a frame with sky and hot pixels, electrons. */
static void expose_window(fixture *f, bst_window window, double *electrons) {
    const double time_s[2] = {0.0, 0.5};
    const bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    const bst_los_track track = {2, time_s, q};
    const bst_render_request request = {.window = window,
                                        .exposure_id = 2,
                                        .track = &track,
                                        .background_e = 41.0,
                                        .dark_e = 1.0,
                                        .key = {{3, 4}}};
    bst_renderer_options options = bst_renderer_default_options();
    options.pattern = (bst_rng_key){{21, 22}};
    options.shared_program = true;
    bst_renderer *renderer;
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(&f->ctx,
                  bst_renderer_create(&f->ctx, f->device, &f->camera, &options, &renderer));
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, renderer, &request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    for (int i = 0; i < window.width * window.height; i++) {
        electrons[i] = (pixels[i] - f->camera.offset_dn) * f->camera.gain_e_per_dn;
    }
    bst_frame_unmap(frame);
    bst_frame_release(frame);
    bst_renderer_free(renderer);
}

static void expose(fixture *f, double *electrons) {
    expose_window(f, (bst_window){0, 0, WIDTH, HEIGHT}, electrons);
}

static void assert_frame(fixture *f, const double *want) {
    static double frame[PIXELS];
    expose(f, frame);
    for (int i = 0; i < PIXELS; i++) {
        /* rounding of the frame; floats over WIDTH steps */
        bst_assert_close(frame[i], want[i], 0.51 + 2e-5 * want[i]);
    }
}

/* Recursion of Short et al. (2013) in double precision for one species. */
static void traps_along_rows(void **state) {
    static double plain[PIXELS], want[PIXELS];
    fixture *f = *state;
    bst_detector_config *d = &f->camera.detector;
    d->serial_traps = (bst_detector_traps_config){{1e-30, 0.0, 0.0}, {1.0, 1.0, 1.0}, 0.5, 1e4};
    expose(f, plain); /* no trap worth the name: the charge as collected */
    const bst_detector_traps_config t = {{0.0, 6.0, 0.0}, {1.0, 1.5, 1.0}, 0.5, 65000.0};
    d->serial_traps = t;
    for (int right = 0; right < 2; right++) {
        double moved = 0.0;
        d->output.right = right;
        for (int y = 0; y < HEIGHT; y++) {
            double held = 0.0;
            for (int i = 0; i < WIDTH; i++) {
                int at = y * WIDTH + (right ? WIDTH - 1 - i : i);
                double q = plain[at], met = (i + 1) * 6.0 * pow(q / 65000.0, 0.5);
                double caught = q > 0.01 ? fmax((met - held) / (met / q + 1.0), 0.0) : 0.0;
                double released = (held + caught) * (1.0 - exp(-1.0 / 1.5));
                held += caught - released;
                want[at] = q + released - caught;
                moved += fabs(want[at] - q);
            }
        }
        assert_true(moved > 2.0 * PIXELS);
        assert_frame(f, want);
    }
    d->serial_traps = (bst_detector_traps_config){0};
    d->output.right = false;
}

/* Outputs of 75 and of 25 columns: a chunk of 64 pixels has several of them. */
static void crosstalk(void **state) {
    static double plain[PIXELS], want[PIXELS];
    fixture *f = *state;
    bst_detector_config *d = &f->camera.detector;
    expose(f, plain);
    for (int outputs = 2; outputs <= 6; outputs += 4) {
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            int part = WIDTH / outputs;
            for (int i = 0; i < PIXELS; i++) {
                int x = i % WIDTH, of = x / part, step = x - of * part;
                double others = 0.0;
                for (int o = 0; o < outputs; o++) {
                    int turned = mirrored && (o + of) % 2 == 1;
                    int there = o * part + (turned ? part - 1 - step : step);
                    others += o == of ? 0.0 : plain[i - x + there];
                }
                want[i] = plain[i] + 0.02 * others;
            }
            d->crosstalk = (bst_detector_crosstalk_config){outputs, 0.02, mirrored};
            assert_frame(f, want);
        }
    }
    d->crosstalk = (bst_detector_crosstalk_config){0};
}

/* Pixels of a window are those of the whole frame, with the offsets of their rows. */
static void rows_of_a_window(void **state) {
    static double whole[PIXELS], part[PIXELS];
    const bst_window windows[] = {{16, 50, 40, 27}, {0, 0, WIDTH, 9}, {3, 21, 5, 1}};
    fixture *f = *state;
    bst_detector_config *d = &f->camera.detector;
    d->row_noise_e = d->flicker_noise_e = 9.0;
    d->pick_up = (bst_detector_pick_up_config){7.0, 0.0, 0.013, NAN};
    expose(f, whole);
    for (int n = 0; n < 3; n++) {
        const bst_window *w = &windows[n];
        expose_window(f, *w, part);
        for (int i = 0; i < w->width * w->height; i++) {
            int x = w->x0 + i % w->width, y = w->y0 + i / w->width;
            assert_true(part[i] == whole[y * WIDTH + x]);
        }
    }
    d->row_noise_e = d->flicker_noise_e = d->pick_up.amplitude_e = 0.0;
}

static int open_device(void **state) {
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    if (!f || bst_device_open(&f->ctx, "", 0, &f->device) != BST_OK) {
        return -1;
    }
    f->camera = scene_camera(WIDTH, HEIGHT);
    f->camera.read_noise_e = 0.0;
    f->camera.dark_current_e_per_s = 2.0;
    f->camera.detector.dark_doubling_k = 6.5;
    f->camera.detector.hot_fraction = 0.03;
    f->camera.detector.hot_median_e_per_s = 4000.0;
    f->camera.detector.hot_spread_dex = 0.5;
    return 0;
}

static int close_device(void **state) {
    fixture *f = *state;
    bst_device_close(f->device);
    free(f);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(traps_along_rows),
        cmocka_unit_test(crosstalk),
        cmocka_unit_test(rows_of_a_window),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
