/* One frame seen in many ways must give one result: turned and mirrored in its eight ways, read out
 * as a window of a larger sensor, and as binned pixels of a finer one. Each axis, sign, corner,
 * half pixel and factor of binning that is confused anywhere in detection and measurement makes a
 * difference. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

/* whole meshes of the background and of its tests for crowding */
enum { WIDTH = 256, HEIGHT = 192, MOST = 512 };

typedef struct scene {
    synthetic s; /* as it is drawn: unturned, unbinned */
    double dx, dy;
    double roll_rad, bend_x, bend_y; /* of the camera during the exposure; of the stars' paths */
    bool windows;                    /* only these parts are looked at */
} scene;

typedef struct view {
    bool flip_x, flip_y, transpose;        /* in this order */
    int binning, left, top, right, bottom; /* of the window on the sensor */
} view;

/* Read-out pixel of the view of a place of the scene. */
static void placed(const view *v, double x, double y, double *u, double *w) {
    x = v->flip_x ? WIDTH - 1 - x : x;
    y = v->flip_y ? HEIGHT - 1 - y : y;
    *u = v->transpose ? y : x;
    *w = v->transpose ? x : y;
}

static void turned(const view *v, double dx, double dy, double *u, double *w) {
    dx = v->flip_x ? -dx : dx;
    dy = v->flip_y ? -dy : dy;
    *u = v->transpose ? dy : dx;
    *w = v->transpose ? dx : dy;
}

static double hashed(int x, int y) {
    uint32_t h = (uint32_t)x * 2654435761u ^ (uint32_t)y * 40503u;
    h ^= h >> 15;
    h *= 2246822519u;
    h ^= h >> 13;
    return (h >> 8) / 16777216.0;
}

/* Motion of a camera of the scene or of a view, from what it does to the middle of the frame. */
static bst_camera_motion motion_of(const scene *s, const view *v, const bst_camera *camera) {
    double b = v->binning, dx, dy, bx, by;
    bool mirrored = (v->flip_x + v->flip_y + v->transpose) % 2;
    synthetic of = {.camera = *camera};
    turned(v, b * s->dx, b * s->dy, &dx, &dy);
    turned(v, b * s->bend_x, b * s->bend_y, &bx, &by);
    bst_camera_motion motion = synthetic_motion(&of, dx, dy);
    motion.turn_cam_rad.z = (mirrored ? -1.0 : 1.0) * s->roll_rad;
    bst_camera_motion_add(&motion, camera, 0.0, 0.0, bx, by);
    return motion;
}

/* Adds a star whose path is that of its place, in parts where it bends. */
static void add_star(scene *s, double x, double y, double electrons) {
    const view plain = {.binning = 1};
    bst_camera_motion motion = motion_of(s, &plain, &s->s.camera);
    double dx, dy;
    int pieces = s->bend_x != 0.0 ? 12 : 1;
    bst_camera_motion_streak(&motion, &s->s.camera, x, y, &dx, &dy);
    for (int i = 0; i < pieces; i++) {
        double to = 2.0 * (i + 1.0) / pieces - 1.0, from = to - 2.0 / pieces, u = to - 1.0 / pieces;
        /* of (3 u^2 - 1) / 2: over the piece, and its mean */
        double along = 1.5 * (to * to - from * from);
        double mean = 0.5 * (to * to + to * from + from * from - 1.0);
        synthetic_add(&s->s, x + 0.5 * u * dx + mean * s->bend_x,
                      y + 0.5 * u * dy + mean * s->bend_y, electrons / pieces,
                      dx / pieces + along * s->bend_x, dy / pieces + along * s->bend_y);
    }
}

static void draw_scene(scene *s, double dx, double dy, bool windows, bool turns) {
    memset(s, 0, sizeof *s);
    synthetic_init(&s->s, WIDTH, HEIGHT);
    s->dx = dx;
    s->dy = dy;
    s->windows = windows;
    if (turns) {
        s->roll_rad = 0.02;
        s->bend_x = 0.9;
        s->bend_y = 1.3;
    }
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            s->s.mean_e[y * WIDTH + x] += 0.03 * x + 0.07 * y;
        }
    }
    for (int i = 0; i < 48; i++) {
        double x = 14.0 + 30.0 * (i % 8) + 9.0 * hashed(i, 1),
               y = 12.0 + 30.0 * (i / 8) + 9.0 * hashed(i, 2);
        double flux = 900.0 * pow(30.0, hashed(i, 3)) * (i == 21 ? 300.0 : 1.0);
        bool own = dx == 0.0 && i % 12 == 5; /* an object in motion */
        if (own) {
            synthetic_add(&s->s, x, y, 6.0 * flux, dx + 9.0, dy - 5.0);
        } else {
            add_star(s, x, y, flux);
        }
        if (i % 7 == 0) {
            add_star(s, x + 3.1, y - 2.2, 0.7 * flux);
        }
    }
    synthetic_expose(&s->s, bst_rng_make_key(3, 0, "test", "symmetries"), 1);
}

/* Whole meshes of the scene: x0, y0, width, height. */
static const int parts[2][4] = {{64, 0, 64, 128}, {128, 128, 128, 64}};

/* The parts as windows of a view. */
static void place_windows(const view *v, bst_window out[2]) {
    for (int k = 0; k < 2; k++) {
        double a[2], c[2];
        placed(v, parts[k][0], parts[k][1], &a[0], &a[1]);
        placed(v, parts[k][0] + parts[k][2] - 1, parts[k][1] + parts[k][3] - 1, &c[0], &c[1]);
        out[k] = (bst_window){.x0 = v->left + v->binning * (int)fmin(a[0], c[0]),
                              .y0 = v->top + v->binning * (int)fmin(a[1], c[1]),
                              .width = v->binning * ((int)fabs(a[0] - c[0]) + 1),
                              .height = v->binning * ((int)fabs(a[1] - c[1]) + 1)};
    }
}

typedef struct seen {
    bst_detections *d;
    double level[3], noise[3], v_limit, streak_px;
} seen;

static const double places[3][2] = {{40.3, 55.8}, {171.2, 30.6}, {220.9, 150.1}};

/* Camera, maps and pixels of a view, and what is detected in them, in the scene's own pixels. */
static void process(const scene *s, const view *v, seen *out) {
    bst_ctx ctx = {0};
    int b = v->binning, wide = v->transpose ? HEIGHT : WIDTH, high = v->transpose ? WIDTH : HEIGHT;
    synthetic o = s->s;
    o.camera.width_px = v->left + b * wide + v->right;
    o.camera.height_px = v->top + b * high + v->bottom;
    o.camera.pixel_scale_arcsec /= b;
    o.camera.psf_fwhm_px *= b;
    o.camera.full_well_e /= b * b;
    o.config.jitter_px = 0.3 * b;
    size_t sensor = (size_t)(o.camera.width_px * o.camera.height_px);
    float *dark = calloc(sensor, sizeof *dark), *flat = calloc(sensor, sizeof *flat);
    uint8_t *bad = calloc(sensor, 1);
    uint16_t *pixels = calloc(WIDTH * HEIGHT, sizeof *pixels);
    assert_true(dark && flat && bad && pixels);
    for (size_t i = 0; i < sensor; i++) {
        flat[i] = 1.0f;
    }
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            double u, w;
            placed(v, x, y, &u, &w);
            pixels[(int)w * wide + (int)u] = s->s.pixels[y * WIDTH + x];
            for (int k = 0; k < b * b; k++) {
                size_t at = (size_t)((v->top + b * (int)w + k / b) * o.camera.width_px + v->left +
                                     b * (int)u + k % b);
                dark[at] = (float)(8.0 * hashed(x, y) / (b * b));
                flat[at] = (float)(0.98 + 0.04 * hashed(y, x));
                bad[at] = hashed(x + 999, y) < 0.002 && k == b * b - 1;
            }
        }
    }
    const bst_imgproc_maps maps = {.dark_e_per_s = dark, .flat = flat, .bad = bad};
    bst_imgproc *ip;
    bst_assert_ok(&ctx, bst_imgproc_create(&ctx, &o.camera, 1e8, &o.config, &maps, &ip));
    bst_camera_motion motion = motion_of(s, v, &o.camera);
    const bst_imgproc_frame frame = {.pixels = pixels,
                                     .window = {v->left, v->top, b * wide, b * high},
                                     .binning = b,
                                     .bits = 16,
                                     .exposure_s = 0.5};
    out->d = synthetic_detections(MOST);
    const bst_camera_motion *moves = s->dx != 0.0 ? &motion : NULL;
    if (s->windows) {
        bst_window items[2];
        place_windows(v, items);
        const bst_imgproc_windows windows = {items, 2};
        bst_assert_ok(&ctx,
                      bst_imgproc_detect_windows(&ctx, ip, &frame, &windows, moves, out->d, MOST));
    } else {
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, moves, out->d, MOST));
    }
    assert_true(synthetic_sound(out->d));
    out->v_limit = bst_imgproc_v_limit(ip, 7.0);
    out->streak_px = bst_imgproc_streak_px(ip) / b;
    for (int k = 0; k < 3 && !s->windows; k++) {
        double u, w;
        placed(v, places[k][0], places[k][1], &u, &w);
        bst_imgproc_ground(ip, v->left + b * u + 0.5 * (b - 1), v->top + b * w + 0.5 * (b - 1),
                           &out->level[k], &out->noise[k]);
    }
    bst_imgproc_free(ip);
    free(dark);
    free(flat);
    free(bad);
    free(pixels);
}

/* What one view may differ by from another: fits end where a step is small, sums are in single
 * precision, and medians are by bins of a histogram. The background takes a part of the rows of a
 * mesh, so that a transposed frame has other samples. Joint fits of neighbours go by the order of
 * the rows. */
typedef struct margins {
    double px, sigmas, relative, ground_e;
} margins;

static margins margins_of(const view *v) {
    return v->transpose ? (margins){0.005, 0.4, 0.08, 0.8} : (margins){0.002, 0.1, 0.02, 0.06};
}

static void expect_detection(const view *v, const bst_detection *p, const seen *found) {
    const margins m = margins_of(v);
    double b = v->binning, u, w;
    placed(v, p->x_px, p->y_px, &u, &w);
    double x = v->left + b * u + 0.5 * (b - 1), y = v->top + b * w + 0.5 * (b - 1);
    bool joint = p->flags & BST_DETECTION_BLEND;
    int n = synthetic_nearest(found->d, x, y, joint ? 1.5 * b : 0.5 * b);
    if (n < 0) {
        fail_msg("no detection at (%g, %g), SNR %g", x, y, p->snr);
    }
    const bst_detection *q = &found->d->items[n];
    double most = fmax(p->cov_xx, p->cov_yy), off = m.px + m.sigmas * sqrt(most);
    bst_assert_close(q->v_mag + 2.5 * log10(q->flux_e), p->v_mag + 2.5 * log10(p->flux_e), 1e-6);
    assert_int_equal(q->flags, p->flags);
    if (joint) {
        return;
    }
    bst_assert_close((q->x_px - x) / b, 0.0, off);
    bst_assert_close((q->y_px - y) / b, 0.0, off);
    double xx = v->transpose ? p->cov_yy : p->cov_xx, yy = v->transpose ? p->cov_xx : p->cov_yy;
    double xy = v->flip_x != v->flip_y ? -p->cov_xy : p->cov_xy;
    bst_assert_close(q->cov_xx / (b * b * most), xx / most, 2 * m.relative);
    bst_assert_close(q->cov_yy / (b * b * most), yy / most, 2 * m.relative);
    bst_assert_close(q->cov_xy / (b * b * most), xy / most, 2 * m.relative);
    bst_assert_close(q->flux_e, p->flux_e, m.relative * p->flux_e);
    bst_assert_close(q->flux_sigma_e / p->flux_sigma_e, 1.0, m.relative);
    bst_assert_close(q->snr / p->snr, 1.0, m.relative);
    bst_assert_close(q->length_px / (b * p->length_px), 1.0, 2 * m.relative);
    bst_assert_close(q->width_px / (b * p->width_px), 1.0, 2 * m.relative);
    if (p->length_px > 1.5 * p->width_px) { /* of round ones the angle is undetermined */
        turned(v, cos(p->angle_rad), sin(p->angle_rad), &u, &w);
        bst_assert_close(sin(q->angle_rad - atan2(w, u)), 0.0, 0.05);
    }
}

/* A streak's place is less certain along it than across it: turned views agree on a covariance
 * whose cross term has the wrong sign. */
static void expect_slants(const bst_detections *d) {
    int slanting = 0;
    for (int i = 0; i < d->count; i++) {
        const bst_detection *p = &d->items[i];
        double c = cos(p->angle_rad), n = sin(p->angle_rad);
        if (p->length_px > 2.0 * p->width_px && !(p->flags & BST_DETECTION_BLEND)) {
            double along = c * c * p->cov_xx + 2.0 * c * n * p->cov_xy + n * n * p->cov_yy;
            double across = n * n * p->cov_xx - 2.0 * c * n * p->cov_xy + c * c * p->cov_yy;
            assert_true(along > across);
            double between = c * n * (p->cov_yy - p->cov_xx) + (c * c - n * n) * p->cov_xy;
            bst_assert_close(between / along, 0.0,
                             0.2); /* pixels, and neighbours that are fitted */
            assert_true(p->cov_xy * c * n > 0.0);
            slanting++;
        }
    }
    assert_true(slanting >= 8);
}

static void compare(const scene *s) {
    seen first;
    const view plain = {.binning = 1};
    process(s, &plain, &first);
    assert_in_range(first.d->count, s->windows ? 10 : 40, 80);
    if (s->dx != 0.0 && s->bend_x == 0.0) { /* a bend's error lies across */
        expect_slants(first.d);
    }
    for (int k = 1; k < 16; k++) {
        view v = {.flip_x = k & 1, .flip_y = k & 2, .transpose = k & 4, .binning = k & 8 ? 2 : 1};
        if (k >= 8) { /* the same margins on opposite sides: the window's middle is the sensor's */
            v.left = v.right = 24;
            v.top = v.bottom = 14;
        }
        seen other;
        process(s, &v, &other);
        assert_int_equal(other.d->count, first.d->count);
        for (int i = 0; i < first.d->count; i++) {
            expect_detection(&v, &first.d->items[i], &other);
        }
        double ground = margins_of(&v).ground_e;
        bst_assert_close(other.d->background_e, first.d->background_e, ground);
        bst_assert_close(other.d->noise_e, first.d->noise_e, ground);
        bst_assert_close(other.d->threshold_snr, first.d->threshold_snr, 1e-5);
        bst_assert_close(other.v_limit, first.v_limit, 0.2 * ground);
        bst_assert_close(other.streak_px, first.streak_px, 1e-3);
        for (int p = 0; p < 3 && !s->windows; p++) {
            bst_assert_close(other.level[p], first.level[p], ground);
            bst_assert_close(other.noise[p], first.noise[p], ground);
        }
        free(other.d);
    }
    free(first.d);
}

static void points(void **state) {
    (void)state;
    scene s;
    draw_scene(&s, 0.0, 0.0, false, false);
    compare(&s);
    synthetic_free(&s.s);
}

/* The camera rolls while it turns, and not uniformly. */
static void streaks(void **state) {
    (void)state;
    scene s;
    draw_scene(&s, 9.0, -4.0, false, true);
    compare(&s);
    synthetic_free(&s.s);
}

static void windows(void **state) {
    (void)state;
    for (int moves = 0; moves < 2; moves++) {
        scene s;
        draw_scene(&s, moves ? -7.0 : 0.0, moves ? -6.0 : 0.0, true, false);
        compare(&s);
        synthetic_free(&s.s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points),
        cmocka_unit_test(streaks),
        cmocka_unit_test(windows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
