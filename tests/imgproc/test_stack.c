/* Stacks of frames: the threshold against closed forms, false alarms on noise, faint objects found
 * among stars, hits and hot pixels, under a camera that turns, and at the edges. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/background.h"
#include "imgproc/stack/stack.h"
#include "sim/core/threshold_statistics.h"
#include "tests/test_support.h"

enum { SIDE = 512, FRAMES = 16, MOST = 64 };
static const double FWHM_PX = 2.0, SIGMA_PX = 2.0 / 2.3548200450309493;

/* What moves or stands in the frames: its place in the middle of their times, in the first frame's
 * pixels, and its rate per frame. */
typedef struct body {
    double x, y, vx, vy, snr;
} body;

typedef struct scene {
    bst_ctx ctx;
    bst_camera camera;
    bst_stack *stack;
    bst_background background;
    float *image;
    bst_rng_key key;
    int stars, bodies, hits, hot;
    body star[1024], body[MOST];
    double hot_x[MOST], hot_y[MOST], hot_e[MOST];
    double drift_px[2], roll_rad; /* of the camera, per frame */
    int width, height;            /* of a frame, in its own pixels */
    double origin_x, origin_y, binning;
} scene;

static void open_scene(scene *s, int side, double rate, double false_alarms, int threads) {
    memset(s, 0, sizeof *s);
    s->camera = (bst_camera){
        .width_px = side, .height_px = side, .pixel_scale_arcsec = 3.0, .psf_fwhm_px = FWHM_PX};
    bst_stack_config config = {FRAMES, rate, false_alarms};
    bst_assert_ok(&s->ctx, bst_stack_create(&s->ctx, &s->camera, &config, threads, &s->stack));
    bst_assert_ok(&s->ctx, bst_background_create(&s->ctx, 64, side, side, 1, &s->background));
    s->image = malloc((size_t)side * (size_t)side * sizeof(float));
    assert_non_null(s->image);
    s->key = bst_rng_make_key(7, 0, "test", "stack");
    s->width = s->height = side;
    s->binning = 1.0;
}

static void close_scene(scene *s) {
    bst_stack_free(s->stack);
    bst_background_free(&s->background);
    free(s->image);
}

static double share(double d) {
    double root = SIGMA_PX * sqrt(2.0);
    return 0.5 * (erf((d + 0.5) / root) - erf((d - 0.5) / root));
}

/* A point of this SNR in noise of 1. */
static void draw(scene *s, double x, double y, double snr) {
    enum { REACH = 7 };
    int cx = (int)floor(x + 0.5), cy = (int)floor(y + 0.5);
    double px[2 * REACH + 1], py[2 * REACH + 1], square_x = 0.0, square_y = 0.0;
    for (int i = -REACH; i <= REACH; i++) {
        px[i + REACH] = share(cx + i - x);
        py[i + REACH] = share(cy + i - y);
        square_x += px[i + REACH] * px[i + REACH];
        square_y += py[i + REACH] * py[i + REACH];
    }
    double flux = snr / sqrt(square_x * square_y);
    for (int j = -REACH; j <= REACH; j++) {
        for (int i = -REACH; i <= REACH; i++) {
            if (cx + i >= 0 && cy + j >= 0 && cx + i < s->width && cy + j < s->height) {
                s->image[(cy + j) * s->width + cx + i] +=
                    (float)(flux * px[i + REACH] * py[j + REACH]);
            }
        }
    }
}

static bst_quat attitude(const scene *s, int frame) {
    double scale = bst_camera_scale_rad(&s->camera);
    return bst_quat_from_rotvec((bst_vec3){-s->drift_px[1] * scale * frame,
                                           s->drift_px[0] * scale * frame, s->roll_rad * frame});
}

/* Where a place of the first frame is in another, both in pixels of the frames. */
static void seen_in(const scene *s, int frame, double x, double y, double *u, double *v) {
    bst_quat turn = bst_quat_mul(attitude(s, frame), bst_quat_conj(attitude(s, 0)));
    bst_vec3 seen = bst_camera_unproject(&s->camera, s->origin_x + s->binning * x,
                                         s->origin_y + s->binning * y);
    assert_true(bst_camera_project(&s->camera, bst_quat_rotate(turn, seen), u, v));
    *u = (*u - s->origin_x) / s->binning;
    *v = (*v - s->origin_y) / s->binning;
}

static void draw_body(scene *s, const body *b, int frame) {
    double u, v, t = frame - 0.5 * (FRAMES - 1);
    seen_in(s, frame, b->x + b->vx * t, b->y + b->vy * t, &u, &v);
    draw(s, u, v, b->snr);
}

static void make_frame(scene *s, int block, int frame) {
    int pixels = s->width * s->height;
    uint64_t number = (uint64_t)(block * FRAMES + frame);
    for (int i = 0; i < pixels; i += 2) {
        double two[2];
        bst_rng_normal2(s->key, number, (uint64_t)i, two);
        s->image[i] = (float)two[0];
        s->image[i + 1] = (float)two[1];
    }
    for (int i = 0; i < s->stars; i++) {
        draw_body(s, &s->star[i], frame);
    }
    for (int i = 0; i < s->bodies; i++) {
        draw_body(s, &s->body[i], frame);
    }
    for (int i = 0; i < s->hot; i++) {
        s->image[(int)s->hot_y[i] * s->width + (int)s->hot_x[i]] += (float)s->hot_e[i];
    }
    for (int i = 0; i < s->hits; i++) { /* charge in two pixels side by side */
        double u = bst_rng_uniform(s->key, number, (uint64_t)(pixels + 3 * i));
        double e = bst_rng_uniform(s->key, number, (uint64_t)(pixels + 3 * i + 1));
        int at = (int)(u * (pixels - 1));
        s->image[at] += (float)(8.0 + 60.0 * e);
        s->image[at + 1] += (float)(4.0 + 30.0 * e);
    }
}

static const bst_stack_found *search(scene *s, int block, int *count) {
    int width = s->width, height = s->height;
    for (int i = 0; i < FRAMES; i++) {
        make_frame(s, block, i);
        bst_background_estimate(&s->background, s->image, width, height, 1e-3f);
        float level[SIDE], inverse[SIDE];
        for (int y = 0; y < height; y++) {
            bst_background_row(&s->background, y, level, inverse);
            for (int x = 0; x < width; x++) {
                s->image[y * width + x] -= level[x];
            }
        }
        bst_stack_frame frame = {.signal = s->image,
                                 .background = &s->background,
                                 .width = width,
                                 .height = height,
                                 .sigma_px = SIGMA_PX,
                                 .time_s = 2.0 * i,
                                 .q_cam_from_gcrf = attitude(s, i),
                                 .origin_x_px = s->origin_x,
                                 .origin_y_px = s->origin_y,
                                 .binning = s->binning};
        assert_int_equal(bst_stack_add(s->stack, &frame), i + 1);
    }
    return bst_stack_search(s->stack, count);
}

/* Number of what is within reach of a body's place in the last frame; -1: nothing. Frames are 2 s
 * apart. */
static int find(const scene *s, const bst_stack_found *found, int count, const body *b) {
    double u, v, t = 0.5 * (FRAMES - 1);
    seen_in(s, FRAMES - 1, b->x + b->vx * t, b->y + b->vy * t, &u, &v);
    for (int i = 0; i < count; i++) {
        double x = (found[i].x_px - s->origin_x) / s->binning;
        double y = (found[i].y_px - s->origin_y) / s->binning;
        if (hypot(x - u, y - v) < FWHM_PX) {
            return i;
        }
    }
    return -1;
}

/* Bodies on a grid, each with a rate of its own up to `rate`. */
static void place_bodies(scene *s, int columns, double rate, double snr) {
    double step = (double)s->camera.width_px / columns;
    for (int i = 0; i < columns * columns; i++) {
        double u[4];
        for (uint64_t k = 0; k < 4; k++) {
            u[k] = bst_rng_uniform(s->key, 1u << 20, 4 * (uint64_t)i + k);
        }
        s->body[s->bodies++] =
            (body){(i % columns + 0.5) * step + 4.0 * u[0], (i / columns + 0.5) * step + 4.0 * u[1],
                   rate * (2.0 * u[2] - 1.0), rate * (2.0 * u[3] - 1.0), snr};
    }
}

static void place_stars(scene *s, int count) {
    for (int i = 0; i < count; i++) {
        double u[3];
        for (uint64_t k = 0; k < 3; k++) {
            u[k] = bst_rng_uniform(s->key, 1u << 21, 3 * (uint64_t)i + k);
        }
        /* as many per factor of light as the sky has: N ~ 1 / flux^1.2 */
        s->star[s->stars++] =
            (body){560.0 * u[0] - 24.0, 560.0 * u[1] - 24.0, 0, 0, pow(u[2] + 1e-4, -0.8)};
    }
}

/* All but `lost` of the bodies, and at most `stray` other things that move. */
static void all_found(const scene *s, const bst_stack_found *found, int count, int lost,
                      int stray) {
    int matched = 0, moving = 0;
    double chi = 0.0;
    for (int i = 0; i < s->bodies; i++) {
        int k = find(s, found, count, &s->body[i]);
        if (k < 0) {
            continue;
        }
        matched++;
        double ex = found[k].rate_x_pxps - 0.5 * s->body[i].vx,
               ey = found[k].rate_y_pxps - 0.5 * s->body[i].vy;
        chi += (ex * ex + ey * ey) / (found[k].rate_sigma_pxps * found[k].rate_sigma_pxps);
        assert_false(found[k].at_rest);
        /* SNR 10 in all: light to a tenth, and a few tenths for what noise and grid add */
        bst_assert_close(found[k].snr, 4.0 * s->body[i].snr, 4.5);
    }
    for (int i = 0; i < count; i++) {
        moving += !found[i].at_rest;
    }
    assert_in_range(matched, s->bodies - lost, s->bodies);
    assert_in_range(moving - matched, 0, stray);
    /* two degrees of freedom each: the mean of 2 n has a deviation of sqrt(4 n), here 1.4 of 2 for
     * 9 bodies in five of them; the camera's turn may add to axes that are detected alone */
    assert_true(chi / matched < 5.0);
}

static void threshold_in_closed_form(void **state) {
    (void)state;
    /* a slow search is one over places: Adler's density of maxima in two dimensions */
    const double side[2] = {2000.0, 1000.0}, roughness = 0.6;
    double u = bst_stack_threshold(3.0, side, 1e-9, roughness, 21.25);
    /* the frame's edges add sqrt(2 pi) / u / side per axis, 0.1 % */
    bst_assert_close(bst_threshold_maxima(u, roughness) * side[0] * side[1], 3.0, 0.01);
    /* a wide one over four: volume sqrt(det L) (2 pi)^(-5/2) (u^3 - 3 u) exp(-u^2 / 2); faces of
     * the rates add 2 sqrt(2 pi) / u in 2 * 20 * 4.6 * 0.77, 1.2 % together */
    u = bst_stack_threshold(3.0, side, 20.0, roughness, 21.25);
    double volume = side[0] * side[1] * 1600.0 * roughness * roughness * 21.25;
    double maxima = volume * pow(2.0 * BST_PI, -2.5) * u * (u * u - 3.0) * exp(-0.5 * u * u);
    bst_assert_close(maxima, 3.0, 0.05);
}

static int noise_alone(int blocks, double false_alarms) {
    scene *s = malloc(sizeof *s);
    open_scene(s, SIDE, 3.0, false_alarms, 0);
    int sum = 0;
    for (int i = 0; i < blocks; i++) {
        int count;
        search(s, i, &count);
        sum += count;
    }
    close_scene(s);
    free(s);
    return sum;
}

/* 0.25 per frame and 4 stacks are 16 expected, a standard deviation of 4; what the search misses of
 * noise is at most a seventh. */
static void false_alarms_as_asked(void **state) {
    (void)state;
    int found = noise_alone(4, 0.25);
    assert_in_range(found, 3, 28);
}

/* 480 expected: 4.6 % is a standard deviation. The mean noise of a mesh is known to a few in a
 * thousand, and its square comes 35 times into the exponent; what the search misses is below 5 %.
 */
static void false_alarms_to_a_tenth(void **state) {
    (void)state;
    int found = noise_alone(120, 0.25);
    assert_in_range(found, 480 - 48 - 66, 480 + 66);
}

static void run_scene(scene *s, int lost, int stray) {
    int count;
    const bst_stack_found *found = search(s, 0, &count);
    all_found(s, found, count, lost, stray);
    close_scene(s);
    free(s);
}

static scene *new_scene(void) {
    scene *s = malloc(sizeof *s);
    open_scene(s, SIDE, 3.0, 0.01, 0);
    return s;
}

/* SNR 2.5 per frame, 10 in all, far above what one false alarm in six stacks asks for (6.5). */
static void faint_bodies_found(void **state) {
    (void)state;
    scene *s = new_scene();
    place_bodies(s, 3, 3.0, 2.5);
    run_scene(s, 0, 1);
}

static void found_among_stars(void **state) {
    (void)state;
    scene *s = new_scene();
    place_bodies(s, 3, 3.0, 2.5);
    place_stars(s, 300);
    run_scene(s, 0, 1);
}

/* A camera that drifts and rolls, over hot pixels and stars, with hits: 480 of them. */
static void found_by_a_turning_camera(void **state) {
    (void)state;
    scene *s = new_scene();
    place_bodies(s, 3, 2.5, 2.8);
    place_stars(s, 200);
    s->drift_px[0] = 1.37;
    s->drift_px[1] = -0.61;
    s->roll_rad = 8e-4;
    s->hits = 30;
    s->hot = 20;
    for (int i = 0; i < s->hot; i++) {
        s->hot_x[i] = 20 + 23 * i;
        s->hot_y[i] = 490 - 17 * i;
        s->hot_e[i] = 2.0 + i;
    }
    run_scene(s, 1, 2); /* one passes behind a bright star; and what is left of it may count */
}

static void hits_alone_are_nothing(void **state) {
    (void)state;
    scene *s = new_scene();
    s->hits = 120;
    int count;
    search(s, 0, &count);
    /* 0.16 expected of noise */
    assert_in_range(count, 0, 1);
    close_scene(s);
    free(s);
}

/* Rest is distinguished from slow motion: 0.25 px per frame are 3.75 px in all, 7 standard
 * deviations at SNR 10. */
static void at_rest_and_slow(void **state) {
    (void)state;
    scene *s = new_scene();
    s->body[0] = (body){150.3, 200.6, 0.0, 0.0, 2.5};
    s->body[1] = (body){350.7, 300.1, 0.2, -0.15, 2.5};
    s->bodies = 2;
    int count;
    const bst_stack_found *found = search(s, 0, &count);
    int rest = find(s, found, count, &s->body[0]), slow = find(s, found, count, &s->body[1]);
    assert_true(rest >= 0 && slow >= 0);
    assert_true(found[rest].at_rest);
    assert_false(found[slow].at_rest);
    assert_true(slow < rest);
    close_scene(s);
    free(s);
}

/* It leaves the frame after ten frames; and one stays beside the edge. */
static void at_the_edges(void **state) {
    (void)state;
    scene *s = new_scene();
    s->body[0] = (body){505.0, 250.0, 2.2, 0.4, 3.6};
    s->body[1] = (body){6.0, 100.0, 0.0, 2.6, 2.8};
    s->body[2] = (body){300.0, 506.5, -2.9, 0.1, 2.8};
    s->bodies = 3;
    int count;
    const bst_stack_found *found = search(s, 0, &count);
    for (int i = 0; i < 3; i++) {
        int k = find(s, found, count, &s->body[i]);
        assert_true(k >= 0);
        assert_true(i > 0 || (found[k].frames >= 8 && found[k].frames <= 11));
    }
    close_scene(s);
    free(s);
}

static void threads_change_nothing(void **state) {
    (void)state;
    bst_stack_found first[MOST];
    int first_count = 0;
    for (int threads = 1; threads <= 3; threads += 2) {
        scene *s = malloc(sizeof *s);
        open_scene(s, 256, 3.0, 0.25, threads);
        place_bodies(s, 2, 3.0, 2.0);
        int count;
        const bst_stack_found *found = search(s, 3, &count);
        assert_in_range(count, 4, MOST);
        if (threads == 1) {
            first_count = count;
            memcpy(first, found, (size_t)count * sizeof *found);
        } else {
            assert_int_equal(count, first_count);
            for (int i = 0; i < count; i++) {
                assert_true(found[i].x_px == first[i].x_px && found[i].snr == first[i].snr &&
                            found[i].rate_y_pxps == first[i].rate_y_pxps);
            }
        }
        close_scene(s);
        free(s);
    }
}

static void begins_anew(void **state) {
    (void)state;
    scene *s = malloc(sizeof *s);
    open_scene(s, 256, 1.0, 1.0, 1);
    make_frame(s, 0, 0);
    bst_background_estimate(&s->background, s->image, 256, 256, 1e-3f);
    bst_stack_frame frame = {.signal = s->image,
                             .background = &s->background,
                             .width = 256,
                             .height = 256,
                             .sigma_px = SIGMA_PX,
                             .q_cam_from_gcrf = BST_QUAT_IDENTITY,
                             .binning = 1.0};
    int count = -1;
    assert_int_equal(bst_stack_add(s->stack, &frame), 1);
    assert_int_equal(bst_stack_add(s->stack, &frame), 1); /* not later */
    frame.time_s = 1.0;
    assert_int_equal(bst_stack_add(s->stack, &frame), 2);
    bst_stack_search(s->stack, &count); /* not full */
    assert_int_equal(count, 0);
    frame.time_s = 2.0;
    frame.origin_x_px = 10.0; /* another window */
    assert_int_equal(bst_stack_add(s->stack, &frame), 1);
    close_scene(s);
    free(s);
}

static void bad_arguments(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {
        .width_px = 64, .height_px = 64, .pixel_scale_arcsec = 3.0, .psf_fwhm_px = 2.0};
    static const bst_stack_config bad[] = {
        {0, 3.0, 1.0},  {14, 3.0, 1.0}, {68, 3.0, 1.0},
        {16, 0.0, 1.0}, {16, 3.0, 0.0}, {64, 16.0, 1.0},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bst_stack *stack;
        assert_int_equal(bst_stack_create(&ctx, &camera, &bad[i], 1, &stack), BST_ERR_ARGUMENT);
        assert_null(stack);
    }
}

/* A window of binned pixels under a camera that drifts and rolls: places and rates come in sensor
 * pixels, those of the last frame, and are as wrong as they say. */
static void places_of_a_binned_window(void **state) {
    (void)state;
    for (int b = 1; b <= 2; b++) {
        scene *s = new_scene();
        s->width = 208;
        s->height = 144;
        s->binning = b;
        s->origin_x = 40.0 + 0.5 * (b - 1);
        s->origin_y = 160.0 + 0.5 * (b - 1);
        s->drift_px[0] = 0.9 * b;
        s->drift_px[1] = -0.4 * b;
        s->roll_rad = 1e-3;
        for (int i = 0; i < 12; i++) {
            s->body[i] = (body){36.3 + 45.1 * (i % 4), 30.2 + 41.7 * (i / 4), 0.5 * (i % 5) - 1.1,
                                0.7 - 0.4 * (i % 4), 3.5};
        }
        s->bodies = 12;
        int count, matched = 0;
        double chi_place = 0.0, chi_rate = 0.0, light = 0.0;
        const bst_stack_found *found = search(s, b, &count);
        for (int i = 0; i < s->bodies; i++) {
            const body *o = &s->body[i];
            int k = find(s, found, count, o);
            if (k < 0 || found[k].frames < FRAMES) { /* light of others is taken out beside it */
                continue;
            }
            matched++;
            double last[2], before[2], t = 0.5 * (FRAMES - 1);
            seen_in(s, FRAMES - 1, o->x + o->vx * t, o->y + o->vy * t, &last[0], &last[1]);
            seen_in(s, FRAMES - 1, o->x + o->vx * (t - 1), o->y + o->vy * (t - 1), &before[0],
                    &before[1]);
            const bst_stack_found *f = &found[k];
            double x = f->x_px - (s->origin_x + b * last[0]);
            double y = f->y_px - (s->origin_y + b * last[1]);
            assert_true(f->cov_xy == 0.0);
            chi_place += x * x / f->cov_xx + y * y / f->cov_yy;
            x = f->rate_x_pxps - 0.5 * b * (last[0] - before[0]); /* 2 s between frames */
            y = f->rate_y_pxps - 0.5 * b * (last[1] - before[1]);
            chi_rate += (x * x + y * y) / (f->rate_sigma_pxps * f->rate_sigma_pxps);
            /* SNR 3.5 in noise of 1: the light is that over the norm of its image, sum of squares
             * 1 / (4 pi (sigma^2 + 1/12)) */
            double wide = SIGMA_PX * SIGMA_PX + 1.0 / 12.0;
            light += f->flux_e / (3.5 * sqrt(4.0 * BST_PI * wide));
            bst_assert_close(f->flux_sigma_e / f->flux_e, 1.0 / f->snr, 1e-9);
        }
        print_message("%d places %.2f rates %.2f light %.3f\n", matched, chi_place / (2 * matched),
                      chi_rate / (2 * matched), light / matched);
        assert_in_range(matched, 8, 12);
        /* chi-square of 2 matched degrees of freedom, 16 at least: its mean 1 +- 0.35 each;
         * interpolation and the bytes of the maps add a little */
        assert_true(chi_place / (2 * matched) > 0.3 && chi_place / (2 * matched) < 2.4);
        assert_true(chi_rate / (2 * matched) > 0.3 && chi_rate / (2 * matched) < 2.4);
        bst_assert_close(light / matched, 1.0, 0.1); /* SNR 14 each, 3 % in all; maps */
        close_scene(s);
        free(s);
    }
}

int main(int argc, char **argv) {
    const struct CMUnitTest quick[] = {
        cmocka_unit_test(places_of_a_binned_window),
        cmocka_unit_test(threshold_in_closed_form),
        cmocka_unit_test(false_alarms_as_asked),
        cmocka_unit_test(faint_bodies_found),
        cmocka_unit_test(found_among_stars),
        cmocka_unit_test(found_by_a_turning_camera),
        cmocka_unit_test(hits_alone_are_nothing),
        cmocka_unit_test(at_rest_and_slow),
        cmocka_unit_test(at_the_edges),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(begins_anew),
        cmocka_unit_test(bad_arguments),
    };
    const struct CMUnitTest thorough[] = {cmocka_unit_test(false_alarms_to_a_tenth)};
    if (argc > 1 && strcmp(argv[1], "thorough") == 0) {
        return cmocka_run_group_tests(thorough, NULL, NULL);
    }
    return cmocka_run_group_tests(quick, NULL, NULL);
}
