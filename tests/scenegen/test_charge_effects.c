/* Charge gathered and moved during read-out, and its amplification, against closed forms, exact
 * distributions and recursions in double precision. */
#include "scenegen/detector/fixed_pattern_noise.h"
#include "scenegen/detector/readout_charge.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 192, PIXELS = SIDE * SIDE };

static const bst_rng_key PATTERN = {{21, 22}};

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

/* A camera without read noise, whose digital numbers are electrons. */
static fixture *open_with(void **state, double sky_e, double dark_e_per_s) {
    fixture *f = *state;
    f->camera = scene_camera(SIDE, SIDE);
    f->camera.detector.dark_doubling_k = 6.5;
    f->camera.dark_current_e_per_s = dark_e_per_s;
    f->camera.read_noise_e = 0.0;
    f->time_s[1] = 0.5;
    f->q[0] = f->q[1] = BST_QUAT_IDENTITY;
    f->track = (bst_los_track){2, f->time_s, f->q};
    f->request = (bst_render_request){.window = {0, 0, SIDE, SIDE},
                                      .track = &f->track,
                                      .background_e = sky_e + 0.5 * dark_e_per_s,
                                      .dark_e = 0.5 * dark_e_per_s,
                                      .key = {{3, 4}}};
    return f;
}

static void make(fixture *f) {
    bst_renderer_free(f->renderer);
    bst_renderer_options options = bst_renderer_default_options();
    options.pattern = PATTERN;
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

/* Asserts that the sum of FRAMES frames is Poisson distributed about `mean` per frame. */
enum { FRAMES = 8 };
static void assert_poisson(fixture *f, const double *mean) {
    static double frame[PIXELS], sum[PIXELS];
    memset(sum, 0, sizeof sum);
    for (int k = 0; k < FRAMES; k++) {
        expose(f, k, frame);
        for (int i = 0; i < PIXELS; i++) {
            sum[i] += frame[i];
        }
    }
    double chi2 = 0.0, excess = 0.0, all = 0.0;
    int counted = 0;
    for (int i = 0; i < PIXELS; i++) {
        double want = FRAMES * mean[i];
        if (want == 0.0) {
            assert_true(sum[i] == 0.0);
            continue;
        }
        chi2 += (sum[i] - want) * (sum[i] - want) / want;
        excess += sum[i] - want;
        all += want;
        counted++;
    }
    /* chi-square of n degrees: standard deviation sqrt(2n), a little more for small counts; five */
    bst_assert_close(chi2 / counted, 1.0, 5.0 * sqrt(2.1 / counted));
    bst_assert_close(excess, 0.0, 4.0 * sqrt(all));
}

/* A packet gathers the dark current of the rows that it passes, for the time of a row each; glow
 * and clock-induced charge come on top; edges have neither light nor, in the overscan, charge. */
static void charge_is_gathered_outside_the_exposure(void **state) {
    static double mean[PIXELS];
    static float dark[PIXELS];
    fixture *f = open_with(state, 60.0, 40.0);
    bst_detector_config *d = &f->camera.detector;
    d->readout_s = 3.0;
    d->clock_induced_e = 5.0;
    d->glow = (bst_detector_glow_config){80.0, 30.0, -4.0, 10.0};
    make(f);
    for (int i = 0; i < PIXELS; i++) {
        int x = i % SIDE, y = i / SIDE;
        mean[i] = 60.0 + 20.0 + 40.0 * y * 3.0 / SIDE + 5.0 +
                  80.0 * exp(-hypot(x + 4.0, y - 10.0) / 30.0);
    }
    assert_poisson(f, mean);
    bst_assert_close(bst_camera_readout_e(&f->camera), 40.0 * 1.5 * (SIDE - 1.0) / SIDE + 5.0,
                     1e-9);

    d->hot_fraction = 0.01;
    d->hot_median_e_per_s = 1000.0;
    d->shielded = (bst_detector_edges_config){6, 7, 8, 9};
    d->overscan = (bst_detector_edges_config){3, 4, 0, 5};
    make(f);
    bst_assert_ok(&f->ctx,
                  bst_fixed_pattern_noise_dark(&f->ctx, &f->camera, PATTERN, NULL, SIDE, dark));
    for (int x = 0; x < SIDE; x++) {
        double passed = 0.0;
        for (int y = 0; y < SIDE; y++) {
            bool lit = x >= 6 && x < SIDE - 7 && y >= 8 && y < SIDE - 9;
            bool column = x >= 3 && x < SIDE - 4, row = y < SIDE - 5;
            double rate = (double)dark[y * SIDE + x];
            assert_true(rate == 0.0 ? !(column && row) : column && row);
            double glow = row ? 80.0 * exp(-hypot(x + 4.0, y - 10.0) / 30.0) : 0.0;
            mean[y * SIDE + x] =
                (lit ? 60.0 : 0.0) + 0.5 * rate + (column ? passed * 3.0 / SIDE + 5.0 + glow : 0.0);
            passed += rate;
        }
    }
    assert_poisson(f, mean);
}

/* The level of a frame, its drift and the pick-up are offsets: what is left is the noise without
 * them. */
static void offsets_change_from_frame_to_frame(void **state) {
    static double plain[PIXELS], frame[PIXELS];
    fixture *f = open_with(state, 100.0, 0.0);
    f->camera.gain_e_per_dn = 0.5;
    make(f);
    expose(f, 4, plain);
    bst_detector_pick_up_config *p = &f->camera.detector.pick_up;
    *p = (bst_detector_pick_up_config){40.0, 0.17, 0.31, 60.0};
    f->camera.detector.offset_drift_dn_per_frame = -2.5; /* by itself: */
    p->amplitude_e = 0.0;
    make(f);
    expose(f, 4, frame);
    for (int i = 0; i < PIXELS; i++) {
        bst_assert_close(frame[i], plain[i] - 4 * 2.5 * 0.5, 0.5 * 0.5 + 0.01);
    }
    p->amplitude_e = 40.0;
    make(f);
    expose(f, 4, frame);
    for (int i = 0; i < PIXELS; i++) {
        double turns = 60.0 / 360.0 + 0.17 * (i % SIDE) + 0.31 * (i / SIDE);
        double want = plain[i] + 40.0 * sin(2.0 * BST_PI * turns) - 4 * 2.5 * 0.5;
        /* rounding of both; floats of 1e5 DN */
        bst_assert_close(frame[i], want, 0.5 * 0.5 + 0.01);
    }
    /* random phases: their mean sine and cosine are those of uniform ones; and normal levels */
    p->phase_deg = NAN;
    f->camera.detector.offset_drift_dn_per_frame = 0.0;
    f->camera.detector.offset_noise_e = 12.0;
    make(f);
    enum { TRIALS = 64 };
    double c = 0.0, s = 0.0, level2 = 0.0;
    for (int k = 0; k < TRIALS; k++) {
        double of_c = 0.0, of_s = 0.0, level = 0.0;
        expose(f, k, frame);
        for (int i = 0; i < PIXELS; i++) {
            double turns = 0.17 * (i % SIDE) + 0.31 * (i / SIDE);
            of_c += frame[i] * cos(2.0 * BST_PI * turns) * 2.0 / PIXELS / 40.0;
            of_s += frame[i] * sin(2.0 * BST_PI * turns) * 2.0 / PIXELS / 40.0;
            level += (frame[i] - 100.0) / PIXELS;
        }
        /* 10 e- of noise: 0.074 e- in an amplitude; leakage of the level below 0.2 e- */
        bst_assert_close(hypot(of_c, of_s), 1.0, 0.02);
        c += of_c / TRIALS;
        s += of_s / TRIALS;
        level2 += level * level / TRIALS;
    }
    bst_assert_close(c, 0.0, 4.0 / sqrt(2.0 * TRIALS));
    bst_assert_close(s, 0.0, 4.0 / sqrt(2.0 * TRIALS));
    bst_assert_close(sqrt(level2), 12.0, 4.0 * 12.0 / sqrt(2.0 * TRIALS));
}

/* Covariance of rows n apart: the mean of exp(-n / 4^k), k = 0 ... 5. */
static void rows_have_flicker_noise(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 10.0, 0.0);
    f->camera.offset_dn = 1000.0;
    f->camera.detector.flicker_noise_e = 40.0;
    make(f);
    enum { TRIALS = 100, LAGS = 3 };
    const int lags[LAGS] = {0, 4, 64};
    double found[LAGS] = {0};
    for (int k = 0; k < TRIALS; k++) {
        double rows[SIDE];
        expose(f, k, frame);
        for (int y = 0; y < SIDE; y++) {
            rows[y] = -10.0;
            for (int x = 0; x < SIDE; x++) {
                rows[y] += frame[y * SIDE + x] / SIDE;
            }
        }
        for (int n = 0; n < LAGS; n++) {
            for (int y = 0; y + 64 < SIDE; y++) {
                found[n] += rows[y] * rows[y + lags[n]] / ((SIDE - 64) * TRIALS);
            }
        }
    }
    for (int n = 0; n < LAGS; n++) {
        double want = n == 0 ? 10.0 / SIDE : 0.0;
        for (int k = 0; k < 6; k++) {
            want += 1600.0 / 6.0 * exp(-lags[n] / pow(4.0, k));
        }
        /* half of the variance is of frames rather than rows: 0.5 sqrt(2 / TRIALS), four of them */
        bst_assert_close(found[n], want, 1600.0 * 2.0 * sqrt(2.0 / TRIALS));
    }
}

/* Recursion of Short et al. (2013) in double precision, along columns or rows. */
static void pass_traps(double *image, const bst_detector_traps_config *t, bool columns,
                       bool backwards) {
    int along = columns ? SIDE : 1, across = columns ? 1 : SIDE;
    for (int line = 0; line < SIDE; line++) {
        double held[BST_TRAP_SPECIES] = {0};
        for (int i = 0; i < SIDE; i++) {
            double *q = &image[line * across + (backwards ? SIDE - 1 - i : i) * along];
            for (int k = 0; k < BST_TRAP_SPECIES; k++) {
                double met =
                    (i + 1) * t->traps_per_px[k] * pow(*q / t->reference_e, t->fill_exponent);
                double caught = *q > 0.01 ? fmax((met - held[k]) / (met / *q + 1.0), 0.0) : 0.0;
                double released = (held[k] + caught) * (1.0 - exp(-1.0 / t->release_px[k]));
                held[k] += caught - released;
                *q += released - caught;
            }
        }
    }
}

/* Compares a frame with an image that was computed from the same charge. */
static void assert_frame(fixture *f, int64_t id, const double *want) {
    static double frame[PIXELS];
    make(f);
    expose(f, id, frame);
    for (int i = 0; i < PIXELS; i++) {
        /* rounding of the frame; floats over SIDE steps */
        bst_assert_close(frame[i], want[i], 0.51 + 2e-5 * want[i]);
    }
}

/* Traps of three species with sky and hot pixels; the trail of one packet in the closed form. */
static void traps_defer_charge(void **state) {
    static double plain[PIXELS], want[PIXELS];
    fixture *f = open_with(state, 3.0, 2.0);
    bst_detector_config *d = &f->camera.detector;
    d->hot_fraction = 0.004;
    d->hot_median_e_per_s = 4000.0;
    d->hot_spread_dex = 0.5;
    bst_detector_traps_config traps = {{1e-30, 0.0, 0.0}, {1.0, 1.0, 1.0}, 0.4, 1e4};
    d->parallel_traps = traps; /* none worth the name: the charge as collected */
    make(f);
    expose(f, 2, plain);
    traps = (bst_detector_traps_config){{20.0, 8.0, 3.0}, {0.7, 4.0, 60.0}, 0.4, 65000.0};
    d->parallel_traps = traps;
    memcpy(want, plain, sizeof want);
    pass_traps(want, &traps, true, false);
    assert_frame(f, 2, want);
    d->output.right = true;
    d->serial_traps = (bst_detector_traps_config){{0.0, 5.0, 0.0}, {1.0, 1.5, 1.0}, 0.7, 65000.0};
    pass_traps(want, &d->serial_traps, false, true);
    assert_frame(f, 2, want);
    /* of a window as of the whole frame */
    static double part[PIXELS], whole[PIXELS];
    expose(f, 2, whole);
    f->request.window = (bst_window){70, 50, 61, 40};
    expose(f, 2, part);
    for (int i = 0; i < 61 * 40; i++) {
        assert_true(part[i] == whole[(50 + i / 61) * SIDE + 70 + i % 61]);
    }

    /* one packet of a electrons in row y: (y + 1) n (a / w)^b / (1 + (y + 1) n a^(b-1) / w^b) are
     * captured, of which 1 - e^(-1/t) leave in each transfer */
    memset(want, 0, sizeof want);
    want[100 * SIDE + 7] = 2000.0;
    traps = (bst_detector_traps_config){{2.0, 0.0, 0.0}, {3.0, 1.0, 1.0}, 0.6, 65000.0};
    pass_traps(want, &traps, true, false);
    double met = 101.0 * 2.0 * pow(2000.0 / 65000.0, 0.6), caught = met / (1.0 + met / 2000.0);
    bst_assert_close(want[100 * SIDE + 7], 2000.0 - caught * exp(-1.0 / 3.0), 1e-9);
    for (int k = 1; k < 20; k++) { /* an empty packet captures nothing */
        double trail = caught * exp(-k / 3.0) * (1.0 - exp(-1.0 / 3.0));
        bst_assert_close(want[(100 + k) * SIDE + 7], trail, 1e-9);
    }
}

/* Crosstalk of 0.004 between outputs of equal parts of a row. */
static void add_crosstalk(double *image, int outputs, bool mirrored) {
    int part = SIDE / outputs;
    for (int y = 0; y < SIDE; y++) {
        double *row = image + y * SIDE;
        for (int i = 0; i < part; i++) {
            double all = 0.0;
            int at[8];
            for (int o = 0; o < outputs; o++) {
                at[o] = mirrored && o % 2 == 1 ? (o + 1) * part - 1 - i : o * part + i;
                all += row[at[o]];
            }
            for (int o = 0; o < outputs; o++) {
                row[at[o]] += 0.004 * (all - row[at[o]]);
            }
        }
    }
}

/* Borders that charge moves by `shift` pixels per electron, or coupling, between real pixels. */
static void couple(const double *q, const bst_detector_edges_config *o, double shift,
                   double coupling, double *out) {
    int left = (int)o->left, right = SIDE - 1 - (int)o->right;
    int bottom = (int)o->bottom, top = SIDE - 1 - (int)o->top;
    for (int i = 0; i < PIXELS; i++) {
        int x = i % SIDE, y = i / SIDE;
        const int near[4] = {x > left ? i - 1 : i, x < right ? i + 1 : i, y > bottom ? i - SIDE : i,
                             y < top ? i + SIDE : i};
        bool real = x >= left && x <= right && y >= bottom && y <= top;
        out[i] = q[i];
        for (int k = 0; k < 4 && real; k++) {
            double n = q[near[k]];
            out[i] += coupling * (n - q[i]) + shift * (n - q[i]) * (n + q[i]) / 2.0;
        }
    }
}

/* Asserts a frame with moved borders and coupling, computed from the same charge.
 *
 * Returned:  the charge as collected, with moved borders, and coupled */
static void assert_coupled(fixture *f, double *plain, double *moved, double *want) {
    bst_detector_config *d = &f->camera.detector;
    d->brighter_fatter_per_e = 1e-30; /* none worth the name */
    make(f);
    expose(f, 1, plain);
    d->brighter_fatter_per_e = 1.5e-6;
    d->interpixel_coupling = 0.013;
    couple(plain, &d->overscan, 1.5e-6, 0.0, moved);
    couple(moved, &d->overscan, 0.0, 0.013, want);
    assert_frame(f, 1, want);
}

/* Borders that charge moves, coupling of neighbours and crosstalk, from the same charge. */
static void pixels_and_outputs_couple(void **state) {
    static double plain[PIXELS], moved[PIXELS], want[PIXELS], signal[PIXELS];
    fixture *f = open_with(state, 20000.0, 0.0);
    bst_detector_config *d = &f->camera.detector;
    bst_scene_source star = scene_star(&f->camera, 100.3, 90.4, 2.0 * 3e4);
    f->request.sources = &star;
    f->request.count = 1;
    assert_coupled(f, plain, moved, want);
    double sum = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        sum += want[i] - plain[i];
    }
    bst_assert_close(sum, 0.0, 1e-3); /* charge is kept */

    /* brighter-fatter in a flat: variance of a pixel (1 - 4 s q)^2 + 4 (s q)^2 of Poisson's */
    double q = 0.0, before = 0.0, after = 0.0;
    for (int i = 0; i < 60 * SIDE; i++) { /* rows without the star */
        q += plain[i] / (60 * SIDE);
    }
    for (int i = SIDE; i < 59 * SIDE; i++) {
        int x = i % SIDE;
        before += x > 0 && x < SIDE - 1 ? (plain[i] - q) * (plain[i] - q) : 0.0;
        after += x > 0 && x < SIDE - 1 ? (moved[i] - q) * (moved[i] - q) : 0.0;
    }
    double a = 1.5e-6 * q;
    /* 11,000 pixels, of which the two images share the noise: 1 % */
    bst_assert_close(after / before, pow(1.0 - 4.0 * a, 2.0) + 4.0 * a * a, 0.02);

    for (int outputs = 4; outputs <= 8; outputs += 4) { /* parts of 48 and of 24 columns: vectors */
        /* of 16 pixels lie across borders */
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            d->crosstalk = (bst_detector_crosstalk_config){outputs, 0.004, mirrored};
            memcpy(signal, want, sizeof signal);
            add_crosstalk(signal, outputs, mirrored);
            assert_frame(f, 1, signal);
        }
    }
}

/* Asserts that a frame's overscan is empty; returns the charge of the frame. */
static double charge_of(fixture *f, int64_t id, double *frame) {
    const bst_detector_edges_config *o = &f->camera.detector.overscan;
    double sum = 0.0;
    make(f);
    expose(f, id, frame);
    for (int i = 0; i < PIXELS; i++) {
        int x = i % SIDE, y = i / SIDE;
        bool real = x >= o->left && x < SIDE - o->right && y >= o->bottom && y < SIDE - o->top;
        assert_true(real || frame[i] == 0.0);
        sum += frame[i];
    }
    return sum;
}

/* Neighbours beside an overscan of unequal widths: charge passes between all real pixels, up to the
 * last, and nothing passes their borders. Stars lie beside all four. */
static void neighbours_couple_up_to_the_overscan(void **state) {
    static double plain[PIXELS], moved[PIXELS], want[PIXELS];
    fixture *f = open_with(state, 500.0, 0.0);
    f->camera.detector.overscan = (bst_detector_edges_config){17, 4, 9, 22};
    const bst_scene_source stars[] = {scene_star(&f->camera, 17.2, 60.3, 2.0 * 2e4),
                                      scene_star(&f->camera, SIDE - 5.3, 110.4, 2.0 * 2e4),
                                      scene_star(&f->camera, 80.3, 9.2, 2.0 * 2e4),
                                      scene_star(&f->camera, 120.4, SIDE - 22.7, 2.0 * 2e4)};
    f->request.sources = stars;
    f->request.count = 4;
    assert_coupled(f, plain, moved, want);
}

/* Charge of a star far above the full well, whose borders would move by several pixels, is kept;
 * neither neighbours nor blooming reach the overscan. */
static void charge_is_kept_and_stays_out_of_the_overscan(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 5000.0, 0.0);
    bst_detector_config *d = &f->camera.detector;
    f->camera.full_well_e = 60000.0;
    d->saturation = BST_WELL_BLOOM;
    d->overscan = (bst_detector_edges_config){16, 5, 3, 10};
    bst_scene_source star = scene_star(&f->camera, 100.3, 90.4, 2.0 * 3e6);
    f->request.sources = &star;
    f->request.count = 1;
    double plain = charge_of(f, 3, frame);
    d->brighter_fatter_per_e = 5e-6;
    /* rounding of two frames, 5 sigma; floats of 3e8 e- */
    double rounding = 5.0 * sqrt(2.0 * PIXELS / 12.0) + 20.0;
    bst_assert_close(charge_of(f, 3, frame), plain, rounding);
    d->interpixel_coupling = 0.02;
    bst_assert_close(charge_of(f, 3, frame), plain, rounding);
    star = scene_star(&f->camera, 100.3, 175.4, 2.0 * 2e8); /* runs to both ends of its columns */
    (void)charge_of(f, 3, frame);
    assert_true(frame[3 * SIDE + 100] > 55000.0 && frame[(SIDE - 11) * SIDE + 100] > 55000.0);
}

/* What counts is the charge that was collected: traps take some from full pixels and give some to
 * others. */
static void saturation_is_that_of_collected_charge(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 900.0, 0.0);
    bst_detector_config *d = &f->camera.detector;
    f->camera.full_well_e = 1000.0;
    for (int well = BST_WELL_CLIP; well <= BST_WELL_BLOOM; well++) {
        long long found[2];
        d->saturation = well;
        for (int traps = 0; traps < 2; traps++) {
            d->parallel_traps = (bst_detector_traps_config){
                {traps ? 2.0 : 0.0, 0.0, 0.0}, {5.0, 1.0, 1.0}, 0.5, 1000.0};
            make(f);
            expose(f, 6, frame);
            bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, f->renderer, &found[traps]));
        }
        assert_true(found[0] > 3);
        assert_int_equal(found[1], found[0]);
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Probability of at most x from a multiplication with high gain of Poisson electrons. */
static double multiplied_below(double x, double mean) {
    double p = exp(-mean), sum = p, term = exp(-x), tail = 0.0; /* tail: of the gamma law of n */
    for (int n = 1; n < 80; n++) {
        tail += term;
        term *= x / n;
        p *= mean / n;
        sum += p * (1.0 - tail);
    }
    return sum;
}

/* The law of few electrons by Kolmogorov's test, mean and variance of many. */
static void charge_is_multiplied(void **state) {
    static double frame[PIXELS];
    fixture *f = open_with(state, 4.0, 0.0);
    f->camera.gain_e_per_dn = 0.002;
    f->camera.detector.em_gain = 1e5;
    make(f);
    expose(f, 0, frame);
    qsort(frame, PIXELS, sizeof *frame, ascending);
    double distance = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        if (frame[i] > 0.0) { /* a step of the number of electrons: zero ones */
            double p = multiplied_below(frame[i], 4.0);
            distance =
                fmax(distance, fmax(fabs(p - (i + 1.0) / PIXELS), fabs(p - i / (double)PIXELS)));
        }
    }
    /* exceeded once in 10,000 times; steps of 0.002 e- in a density of at most 0.2 per e- */
    assert_true(distance < 2.23 / sqrt(PIXELS) + 0.0004);

    f = open_with(state, 20000.0, 0.0);
    f->camera.detector.em_gain = 4.0;
    make(f);
    expose(f, 0, frame);
    double mean = 0.0, var = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        mean += frame[i] / PIXELS;
    }
    for (int i = 0; i < PIXELS; i++) {
        var += (frame[i] - mean) * (frame[i] - mean) / PIXELS;
    }
    double want = 20000.0 * (2.0 - 1.0 / 4.0) + 1.0 / 12.0;
    bst_assert_close(mean, 20000.0, 4.0 * sqrt(want / PIXELS));
    bst_assert_close(var, want, 4.0 * want * sqrt(2.0 / PIXELS));
    f->camera.read_noise_e = 3.0;
    f->camera.dark_current_e_per_s = 10.0;
    f->camera.detector.clock_induced_e = 2.0;
    bst_assert_close(bst_camera_dark_e(&f->camera, 0.5), 7.0, 1e-12);
    bst_assert_close(bst_camera_noise_e(&f->camera, 100.0, 0.5), sqrt(107.0 * 1.75 + 9.0), 1e-12);
}

/* Variance of rounding a charge at random of which a pixel's neighbours, by Poisson counts of the
 * same mean, give `share` of the difference. */
static double rounding_variance(double mean, double share) {
    double sum = 0.0, own = exp(-mean);
    for (int n = 0; n < 80; n++, own *= mean / n) {
        double near = exp(-4.0 * mean);
        for (int m = 0; m < 250; m++, near *= 4.0 * mean / m) {
            double q = share * (m - 4.0 * n), part = q - floor(q);
            sum += own * near * part * (1.0 - part);
        }
    }
    return sum;
}

/* Charge with fractions of an electron about BST_MULTIPLY_FEW, where the table of the register's
 * law ends. */
static void fractions_of_electrons_are_multiplied(void **state) {
    static double frame[PIXELS];
    const double mean_e = 15.5, share = 0.02, own = 1.0 - 4.0 * share;
    fixture *f = open_with(state, mean_e, 0.0);
    f->camera.gain_e_per_dn = 0.002;
    f->camera.detector.em_gain = 1e5;
    f->camera.detector.interpixel_coupling = share;
    make(f);
    expose(f, 0, frame);
    double mean = 0.0, var = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        mean += frame[i] / PIXELS;
    }
    for (int i = 0; i < PIXELS; i++) {
        var += (frame[i] - mean) * (frame[i] - mean) / PIXELS;
    }
    /* of what neighbours share, of rounding, of the register; edges are 2 % of the pixels, by less
     * than 0.1 e-^2 each */
    double want = mean_e * (own * own + 4.0 * share * share) + rounding_variance(mean_e, share) +
                  mean_e * (1.0 - 1e-5);
    bst_assert_close(mean, mean_e, 4.0 * sqrt(2.0 * mean_e / PIXELS));
    /* the fourth moment is 3.4 times the square of the variance */
    bst_assert_close(var, want, 4.0 * want * sqrt(2.4 / PIXELS) + 0.002);
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
        cmocka_unit_test(charge_is_gathered_outside_the_exposure),
        cmocka_unit_test(offsets_change_from_frame_to_frame),
        cmocka_unit_test(rows_have_flicker_noise),
        cmocka_unit_test(traps_defer_charge),
        cmocka_unit_test(pixels_and_outputs_couple),
        cmocka_unit_test(neighbours_couple_up_to_the_overscan),
        cmocka_unit_test(charge_is_kept_and_stays_out_of_the_overscan),
        cmocka_unit_test(saturation_is_that_of_collected_charge),
        cmocka_unit_test(charge_is_multiplied),
        cmocka_unit_test(fractions_of_electrons_are_multiplied),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
