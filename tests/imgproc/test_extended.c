/* Extended targets: silhouettes, centre of mass and hand-over, on images drawn here without the
 * renderer: Lambertian spheres from their closed form, boxes, gaps and shadows. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/extended/centre_of_mass.h"
#include "imgproc/extended/extended_step.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 320, FINE = 4 };

static const bst_extended_config SPHERE = {.enabled = true,
                                           .handover_fwhm = 3.0,
                                           .return_share = 0.8,
                                           .join_share = 0.3,
                                           .phase_offset_factor = 1.0,
                                           .centre_sigma = 0.01,
                                           .target_size_m = 2.0,
                                           .target_size_sigma_m = 0.02};

/* Radiance of a scene at a place, e- per pixel. */
typedef double (*radiance_fn)(const double *p, double x, double y);

/* A Lambertian sphere. p: centre x, y, radius, phase (rad), direction of the Sun (rad), peak. */
static double sphere(const double *p, double x, double y) {
    double u = (x - p[0]) / p[2], v = (y - p[1]) / p[2], r2 = u * u + v * v;
    if (r2 >= 1.0) {
        return 0.0;
    }
    double along = u * cos(p[4]) + v * sin(p[4]);
    return p[5] * fmax(along * sin(p[3]) + sqrt(1.0 - r2) * cos(p[3]), 0.0);
}

/* A body with two wings and dark gaps between, and a dark spot on the body. p: centre x, y, half
 * width of the body, angle (rad), signal of body and wings. */
static double winged(const double *p, double x, double y) {
    double c = cos(p[3]), s = sin(p[3]), u = (x - p[0]) * c + (y - p[1]) * s,
           v = (y - p[1]) * c - (x - p[0]) * s;
    u = fabs(u) / p[2];
    v = v / p[2];
    if (u < 1.0 && fabs(v) < 1.0) {
        return hypot(u, v) < 0.5 ? 0.0 : p[4];
    }
    return u > 1.4 && u < 4.0 && fabs(v) < 0.8 ? p[5] : 0.0;
}

/* A box of two faces, one to the left and one to the right. p: centre x, y, half width, half
 * height, signal of the left and of the right face. */
static double faces(const double *p, double x, double y) {
    double u = (x - p[0]) / p[2], v = (y - p[1]) / p[3];
    return fabs(u) >= 1.0 || fabs(v) >= 1.0 ? 0.0 : u < 0.0 ? p[4] : p[5];
}

/* Adds a scene, blurred by the camera's Gaussian, to the expected electrons. */
static void draw(synthetic *s, radiance_fn radiance, const double *p) {
    int n = SIDE * FINE, reach = (int)ceil(4.0 * FINE * bst_camera_psf_sigma_px(&s->camera));
    double sigma = FINE * bst_camera_psf_sigma_px(&s->camera), sum = 0.0;
    double *image = calloc((size_t)n * (size_t)n, sizeof *image);
    double *blurred = calloc((size_t)n * (size_t)n, sizeof *blurred);
    double *kernel = calloc(2 * (size_t)reach + 1, sizeof *kernel);
    assert_true(image && blurred && kernel);
    for (int k = -reach; k <= reach; k++) {
        sum += kernel[k + reach] = exp(-0.5 * k * k / (sigma * sigma));
    }
    for (int i = 0; i < n * n; i++) {
        double x = (i % n + 0.5) / FINE - 0.5, y = (i / n + 0.5) / FINE - 0.5;
        image[i] = radiance(p, x, y) / (FINE * FINE);
    }
    for (int pass = 0; pass < 2; pass++) { /* along x, then y */
        double *from = pass ? blurred : image, *to = pass ? image : blurred;
        memset(to, 0, (size_t)n * (size_t)n * sizeof *to);
        for (int i = 0; i < n * n; i++) {
            for (int k = -reach; from[i] > 0.0 && k <= reach; k++) {
                int at = pass ? i / n + k : i % n + k;
                if (at >= 0 && at < n) {
                    to[pass ? at * n + i % n : i / n * n + at] += from[i] * kernel[k + reach] / sum;
                }
            }
        }
    }
    for (int i = 0; i < n * n; i++) {
        s->mean_e[i / n / FINE * SIDE + i % n / FINE] += image[i];
    }
    free(image);
    free(blurred);
    free(kernel);
}

/* What a frame gives: detections with extended targets appended, as the module does. */
typedef struct outcome {
    bst_detections *detections;
    const bst_detection *target; /* NULL: none */
} outcome;

typedef struct bench {
    bst_ctx ctx;
    synthetic s;
    bst_imgproc *ip;
    bst_extended_step step;
    bst_detections *d;
    uint64_t frames;
} bench;

static void bench_init(bench *b, const bst_extended_config *config) {
    *b = (bench){.frames = 0};
    synthetic_init(&b->s, SIDE, SIDE);
    b->s.config.extended = *config;
    b->s.config.threads = 1;
    b->ip = synthetic_processor(&b->ctx, &b->s);
    b->step.config = config;
    b->d = synthetic_detections(2048);
}

static void bench_free(bench *b) {
    bst_imgproc_free(b->ip);
    synthetic_free(&b->s);
    free(b->d);
}

/* Processes a frame with the Sun at a phase angle, in a direction of the image. The only extended
 * target or NULL. */
static const bst_detection *process(bench *b, double phase, double direction) {
    bst_frame_message message = {.window = {0, 0, SIDE, SIDE}, .binning = 1};
    synthetic_expose(&b->s, bst_rng_make_key(1, 0, "test", "extended"), b->frames++);
    bst_imgproc_frame frame = synthetic_frame(&b->s);
    bst_assert_ok(&b->ctx, bst_imgproc_detect(&b->ctx, b->ip, &frame, NULL, b->d, 2048));
    const bst_extended_input input = {
        .camera = &b->s.camera,
        .message = &message,
        .silhouettes = bst_imgproc_silhouettes(b->ip),
        .sun_known = true,
        .sun_m = {1.5e11 * sin(phase) * cos(direction), 1.5e11 * sin(phase) * sin(direction),
                  -1.5e11 * cos(phase)},
        .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    bst_optics_zero_point zero = {.stars = 0};
    bst_extended_step_begin(&b->step, &input, b->d);
    bst_extended_step_append(&b->step, 1.0, &zero, b->d, 2048);
    assert_true(synthetic_sound(b->d));
    const bst_detection *found = NULL;
    for (int i = 0; i < b->d->count; i++) {
        if (b->d->items[i].flags & BST_DETECTION_EXTENDED) {
            assert_null(found);
            found = &b->d->items[i];
        }
    }
    return found;
}

/* Detections that a tracker may take for objects, apart from extended ones. */
static int points(const bst_detections *d) {
    int count = 0;
    for (int i = 0; i < d->count; i++) {
        count += d->items[i].label == BST_LABEL_UNKNOWN;
    }
    return count;
}

/* Offsets of a lit sphere against sums over its disc. */
static void offsets_of_a_sphere(void **state) {
    (void)state;
    for (int k = 0; k <= 8; k++) {
        double phase = k * 20.0 * BST_DEG_RAD, area = 0.0, ax = 0.0, light = 0.0, lx = 0.0;
        const double p[] = {0.0, 0.0, 1.0, phase, 0.0, 1.0};
        enum { N = 800 };
        for (int i = 0; i < N * N; i++) {
            double x = 2.0 * (i % N + 0.5) / N - 1.0, y = 2.0 * (i / N + 0.5) / N - 1.0;
            double e = sphere(p, x, y);
            area += e > 0.0;
            ax += e > 0.0 ? x : 0.0;
            light += e;
            lx += e * x;
        }
        /* sums over 800^2 cells: borders to 1e-3 of the radius, a crescent's to 3e-3 */
        bst_assert_close(bst_outline_phase_offset(phase), 0.5 * ax / area, 3e-3);
        bst_assert_close(bst_light_phase_offset(phase), 0.5 * lx / light, 3e-3);
    }
    bst_assert_close(bst_light_phase_offset(0.5 * BST_PI), 3.0 * BST_PI / 32.0, 1e-12);
    bst_assert_close(bst_light_phase_offset(BST_PI), 0.5, 1e-12);
}

/* Outlines of closed form: a square turned by an angle. */
static void outline_of_a_square(void **state) {
    (void)state;
    enum { N = 41 };
    bst_outline_point points[N * N], hull[2 * N * N];
    double angle = 0.3, c = cos(angle), s = sin(angle);
    for (int i = 0; i < N * N; i++) {
        double u = i % N - 20, v = 0.5 * (i / N - 20);
        points[i] = (bst_outline_point){7.0 + c * u - s * v, -2.0 + s * u + c * v};
    }
    bst_outline o;
    bst_outline_make(points, N * N, hull, &o);
    double x, y, length, turned, width;
    /* rounding only */
    bst_assert_close(bst_outline_centroid(&o, &x, &y), 40.0 * 20.0, 1e-9);
    bst_assert_close(x, 7.0, 1e-9);
    bst_assert_close(y, -2.0, 1e-9);
    bst_outline_extent(&o, &length, &turned, &width);
    bst_assert_close(length, hypot(40.0, 20.0), 1e-9);
    bst_assert_close(width, 20.0, 1e-9);
    bst_assert_close(bst_outline_extent_along(&o, c, s), 40.0, 1e-9);
}

/* Outline of the corners of a box of 1 x 4.6 x 1 m, turned by an angle about x (away from the
 * image's plane) and by another within the image, 20 m away in a camera of 2' per pixel. */
static bst_outline box_in_perspective(double tilt, double roll, double missing) {
    bst_outline_point points[8], hull[16];
    double px_per_rad = 648000.0 / BST_PI / 120.0;
    for (int i = 0; i < 8; i++) {
        double x = i & 1 ? 0.5 : -0.5, y = i & 2 ? 2.3 - missing : -2.3, z = i & 4 ? 0.5 : -0.5;
        double v = y * cos(tilt) - z * sin(tilt), range = 20.0 + y * sin(tilt) + z * cos(tilt);
        double u = x * cos(roll) - v * sin(roll);
        v = x * sin(roll) + v * cos(roll);
        points[i] =
            (bst_outline_point){100.0 + px_per_rad * u / range, 90.0 + px_per_rad * v / range};
    }
    bst_outline o;
    bst_outline_make(points, 8, hull, &o);
    return o;
}

static void centre_in_perspective(void **state) {
    (void)state;
    double worst = 0.0, worst_centroid = 0.0;
    for (int k = 0; k < 60; k++) {
        bst_outline o = box_in_perspective(0.02 * k, 0.1 * k, 0.0);
        double x, y, length, angle, width, cx, cy;
        bst_outline_extent(&o, &length, &angle, &width);
        (void)bst_outline_centroid(&o, &cx, &cy);
        bst_outline_centre(&o, length * 120.0 * BST_PI / 648000.0, &x, &y);
        worst = fmax(worst, hypot(x - 100.0, y - 90.0) / length);
        worst_centroid = fmax(worst_centroid, hypot(cx - 100.0, cy - 90.0) / length);
        /* far away there is no perspective */
        bst_outline_centre(&o, 0.0, &x, &y);
        bst_assert_close(hypot(x - cx, y - cy), 0.0, 1e-9);
        /* a body without one of its ends moves by some standard deviations of the centroid */
        o = box_in_perspective(0.02 * k, 0.1 * k, 1.0);
        bst_outline_extent(&o, &length, &angle, &width);
        (void)bst_outline_centroid(&o, &cx, &cy);
        bst_outline_centre(&o, 0.01, &x, &y);
        assert_true(hypot(x - cx, y - cy) < 0.015 * length);
    }
    printf("centre %.4f, centroid %.4f of the size\n", worst, worst_centroid);
    /* of a box seen end on, sides of unlike ends are taken for opposite ones */
    assert_true(worst_centroid > 0.05 && worst < 0.02);
}

/* Spheres of 12 to 240 px at phase angles up to 90 deg: centre, size and range, and no other
 * detection of an object. */
static void spheres(void **state) {
    (void)state;
    static const double radii[] = {6.0, 12.0, 40.0, 120.0}, phases[] = {0.0, 45.0, 90.0};
    bench b;
    bench_init(&b, &SPHERE);
    for (size_t r = 0; r < sizeof radii / sizeof *radii; r++) {
        for (size_t k = 0; k < sizeof phases / sizeof *phases; k++) {
            double direction = 0.7 + (double)k, phase = phases[k] * BST_DEG_RAD;
            const double p[] = {159.3, 160.8, radii[r], phase, direction, 2e4};
            synthetic_clear(&b.s);
            draw(&b.s, sphere, p);
            const bst_detection *t = process(&b, phase, direction);
            assert_non_null(t);
            double size = 2.0 * radii[r];
            /* the threshold cuts a strip at the terminator; small: the phase law of a blurred
             * disc */
            double tolerance = fmax(0.012 * size, 0.25);
            bst_assert_close(t->x_px, p[0], tolerance);
            bst_assert_close(t->y_px, p[1], tolerance);
            bst_assert_close(t->extent.size_px, size, 3.0 * t->extent.size_sigma_px);
            assert_true(t->extent.size_sigma_px < 0.08 * size);
            double range = 2.0 / (size * bst_camera_scale_rad(&b.s.camera));
            bst_assert_close(t->extent.range_m, range, 3.0 * t->extent.range_sigma_m);
            bst_assert_close(t->extent.phase_rad, phase, 1e-2); /* parallax in the field */
            assert_true(points(b.d) <= 4);                      /* false alarms of noise */
            assert_false(t->flags & (BST_DETECTION_EDGE | BST_DETECTION_SATURATED));
        }
    }
    bench_free(&b);
}

/* Body, wings beyond dark gaps and a dark spot within are one target; the spot is filled. */
static void parts_and_shadows(void **state) {
    (void)state;
    bench b;
    bench_init(&b, &SPHERE);
    const double p[] = {150.2, 170.4, 22.0, 0.4, 3e4, 4e3};
    draw(&b.s, winged, p);
    const bst_detection *t = process(&b, 0.0, 0.0);
    assert_non_null(t);
    bst_assert_close(t->x_px, p[0], 0.3); /* pixels of the outline's corners */
    bst_assert_close(t->y_px, p[1], 0.3);
    double length = hypot(8.0, 1.6) * p[2];
    bst_assert_close(t->extent.size_px, length, 0.02 * length);
    bst_assert_close(t->width_px, 2.0 * p[2], 0.05 * 2.0 * p[2]); /* seen through the corners */
    /* body with its spot, two wings */
    double area = (4.0 + 2.0 * 2.6 * 1.6) * p[2] * p[2];
    double edges =
        2.0 * (4.0 + 2.0 * (2.6 + 1.6)) * p[2]; /* widened by less than the PSF's sigma */
    double sigma = bst_camera_psf_sigma_px(&b.s.camera);
    assert_true(t->extent.area_px2 > area && t->extent.area_px2 < area + sigma * edges);
    assert_true(points(b.d) <= 4);
    bench_free(&b);
}

/* Two bars side by side are one target if the gap is less than join_share of a bar's diagonal,
 * however they stand. */
static void bars_side_by_side(void **state) {
    (void)state;
    bench b;
    bench_init(&b, &SPHERE);
    for (int lying = 0; lying < 2; lying++) {
        synthetic_clear(&b.s);
        for (int k = 0; k < 2; k++) {
            double off = 25.0 * k - 12.5, wide = lying ? 30.0 : 6.0, high = lying ? 6.0 : 30.0;
            const double p[] = {
                150.0 + (lying ? 0.0 : off), 150.0 + (lying ? off : 0.0), wide, high, 8e3, 8e3};
            draw(&b.s, faces, p);
        }
        const bst_detection *t = process(&b, 0.0, 0.0); /* the only one */
        assert_non_null(t);
        bst_assert_close(t->x_px, 150.0, 0.3); /* pixels of the outline's corners */
        bst_assert_close(t->y_px, 150.0, 0.3);
        bst_assert_close(t->extent.size_px, hypot(37.0, 60.0), 2.0);
    }
    bench_free(&b);
}

/* Edges of bright, dim and full faces are all in their places: the centre is that of the box,
 * however unlike its faces are. */
static void unlike_faces(void **state) {
    (void)state;
    static const double signal[][2] = {
        {3e4, 3e4}, {3e4, 1.5e3}, {300, 6e4}, {4e5, 2e4}, {1e3, 4e5}};
    static const double half_px[][2] = {{6.0, 4.0}, {14.0, 9.0}};
    bench b;
    bench_init(&b, &SPHERE);
    for (size_t k = 0; k < 2 * sizeof signal / sizeof *signal; k++) {
        const double *half = half_px[k % 2], *e = signal[k / 2];
        const double p[] = {150.25, 170.0, half[0], half[1], e[0], e[1]};
        synthetic_clear(&b.s);
        draw(&b.s, faces, p);
        const bst_detection *t = process(&b, 0.0, 0.0);
        assert_non_null(t);
        /* edges are right to a third of a pixel each, by their place between pixels; threshold
         * crossings miss by 0.8 px with the second pair of faces, and lose the third's dim one */
        bst_assert_close(t->x_px, p[0], 0.5);
        bst_assert_close(t->y_px, p[1], 0.2);
        bst_assert_close(t->extent.size_px, 2.0 * hypot(half[0], half[1]), 1.0);
    }
    bench_free(&b);
}

/* Full wells, and a hit of a star beside the target, do not move it. */
static void saturated(void **state) {
    (void)state;
    bench b;
    bench_init(&b, &SPHERE);
    const double p[] = {150.2, 170.4, 40.0, 0.6, 1.0, 4e5};
    draw(&b.s, sphere, p);
    synthetic_add(&b.s, 40.0, 60.0, 3e4, 0.0, 0.0);
    const bst_detection *t = process(&b, p[3], p[4]);
    assert_non_null(t);
    assert_true(t->flags & BST_DETECTION_SATURATED);
    assert_true(t->extent.saturated_share > 0.5);
    bst_assert_close(t->x_px, p[0], 0.8);
    bst_assert_close(t->y_px, p[1], 0.8);
    assert_true(synthetic_nearest(b.d, 40.0, 60.0, 0.5) >= 0); /* the star stays a point */
    bench_free(&b);
}

/* A point, however bright, is none; a target that fills most of the frame still has a sky. */
static void limits(void **state) {
    (void)state;
    bench b;
    bench_init(&b, &SPHERE);
    synthetic_add(&b.s, 100.3, 99.8, 5e6, 0.0, 0.0);
    assert_null(process(&b, 0.3, 0.0));
    int n = synthetic_nearest(b.d, 100.3, 99.8, 0.5);
    assert_true(n >= 0);
    assert_int_equal(b.d->items[n].label, BST_LABEL_UNKNOWN);
    const double p[] = {160.0, 158.0, 150.0, 0.5, 0.0, 2e4};
    synthetic_clear(&b.s);
    draw(&b.s, sphere, p);
    const bst_detection *t = process(&b, p[3], p[4]);
    assert_non_null(t);
    bst_assert_close(t->x_px, p[0], 3.0);
    const double cut[] = {10.0, 158.0, 50.0, 0.5, 0.0, 2e4};
    synthetic_clear(&b.s);
    draw(&b.s, sphere, cut);
    t = process(&b, cut[3], cut[4]);
    assert_non_null(t);
    assert_true(t->flags & BST_DETECTION_EDGE);
    double error = hypot(t->x_px - cut[0], t->y_px - cut[1]);
    assert_true(error < 3.0 * sqrt(t->cov_xx + t->cov_yy));
    bench_free(&b);
}

/* A sphere that grows from a point to 40 px and shrinks again is one object in every frame. It
 * changes from point to extended and back once each, at different sizes, without a jump. */
static void handover(void **state) {
    (void)state;
    bench b;
    bench_init(&b, &SPHERE);
    double grown = 0.0, shrunk = 0.0, before = 0.0;
    bool extended = false;
    for (int k = 0; k <= 60; k++) {
        double radius = 0.5 + 9.5 * (k <= 30 ? k : 60 - k) / 30.0, phase = 0.5;
        const double p[] = {160.2, 159.6, radius, phase, 0.0, 2e4};
        synthetic_clear(&b.s);
        draw(&b.s, sphere, p);
        const bst_detection *t = process(&b, phase, 0.0);
        if (!t) {
            int n = synthetic_nearest(b.d, p[0], p[1], 2.0);
            assert_true(n >= 0);
            t = &b.d->items[n];
            assert_int_equal(t->label, BST_LABEL_UNKNOWN);
        }
        bool now = t->flags & BST_DETECTION_EXTENDED;
        double error = t->x_px - p[0];
        if (now != extended) {
            *(now ? &grown : &shrunk) = 2.0 * radius;
            assert_int_equal(now, k <= 30);
        }
        /* noise of an outline, and pixels that come and go */
        assert_true(k == 0 || fabs(error - before) < 0.45);
        assert_true(fabs(error) < 0.4);
        extended = now;
        before = error;
    }
    assert_false(extended);
    /* hand-over size 6 px, hysteresis 0.8 */
    assert_true(grown > 5.4 && grown < 7.5 && shrunk > 0.7 * grown && shrunk < 0.92 * grown);
    bench_free(&b);
}

/* A silhouette of made-up numbers on a binned window off the corner, whose outline is a rectangle:
 * what is reported of it, term by term. */
typedef struct made_up {
    bst_camera camera;
    bst_extended_config config;
    bst_extended_view view;
    bst_silhouette s;
    double x, y;      /* origin of the window on the sensor */
    double phase_rad; /* of the target at a place */
    double along[2];  /* towards the Sun */
    double across_px; /* extent of the rectangle across that direction, sensor px */
} made_up;

static made_up make_up(double length_px, bool sun_known) {
    made_up m = {.camera = {.width_px = 900,
                            .height_px = 700,
                            .pixel_scale_arcsec = 30.0,
                            .psf_fwhm_px = 2.0},
                 .config = SPHERE,
                 .s = {.centre_x_px = 90.0,
                       .centre_y_px = 41.5,
                       .light_x_px = 91.7,
                       .light_y_px = 40.2,
                       .area_px2 = 70.0,
                       .flux_e = 4e4,
                       .flux_variance = 9e6,
                       .moment_size_px = 2.0,
                       .length_px = length_px / 3.0,
                       .width_px = 4.5,
                       .angle_rad = 0.8,
                       .x0_px = 84.0,
                       .y0_px = 38.0,
                       .x1_px = 96.0,
                       .y1_px = 45.0,
                       .saturated_px = 14}};
    m.config.phase_offset_factor = 0.8;
    m.config.target_size_sigma_m = 0.1;
    bst_outline_point points[4] = {{84, 38}, {96, 38}, {96, 45}, {84, 45}}, hull[8];
    bst_outline_make(points, 4, hull, &m.s.outline);
    m.view = (bst_extended_view){.camera = &m.camera,
                                 .origin_x_px = 121.0,
                                 .origin_y_px = 61.0,
                                 .binning = 3.0,
                                 .sun_known = sun_known,
                                 .sun_cam = bst_vec3_unit((bst_vec3){0.7, -0.4, -0.3})};
    return m;
}

/* Sets the Sun's direction at a place of the sensor: how the image of what is there, s, moves when
 * it turns towards the Sun, a. x / z goes by a_x - a_z x / z. */
static void set_sun(made_up *m, double x_px, double y_px) {
    double scale = bst_camera_scale_rad(&m->camera);
    double x = (x_px - bst_camera_centre_x(&m->camera)) * scale;
    double y = (y_px - bst_camera_centre_y(&m->camera)) * scale;
    bst_vec3 s = bst_vec3_unit((bst_vec3){x, y, 1.0}), sun = m->view.sun_cam;
    bst_vec3 a = bst_vec3_axpy(sun, -bst_vec3_dot(sun, s), s);
    double u = a.x - a.z * x, v = a.y - a.z * y;
    m->along[0] = u / hypot(u, v);
    m->along[1] = v / hypot(u, v);
    m->phase_rad = acos(-bst_vec3_dot(sun, s));
    m->across_px = 3.0 * (12.0 * fabs(m->along[1]) + 7.0 * fabs(m->along[0]));
}

static void a_made_up_silhouette(void **state) {
    (void)state;
    /* hand-over size 6 px: 0.8 of it the centroid of light, at it half of each, the outline's
     * centre
     */
    const double lengths[3] = {4.8, 6.0, 27.0};
    for (int k = 0; k < 3 * 2 * 2; k++) {
        bool sun = k & 1, edge = k & 2;
        double length = lengths[k / 4], share = 0.5 * (double)(k / 4);
        made_up m = make_up(length, sun);
        m.s.edge = edge;
        bst_detection d;
        bst_extended_measure(&m.config, &m.view, &m.s, 0.0, &d);
        double light[2] = {121 + 3 * 91.7, 61 + 3 * 40.2};
        double centre[2] = {121 + 3 * 90.0, 61 + 3 * 41.5};
        set_sun(&m, centre[0], centre[1]);
        double p = m.phase_rad, across = m.across_px;
        double outline = bst_outline_phase_offset(p) * across;
        double offset =
            sun ? 0.8 * (share * outline + (1.0 - share) * bst_light_phase_offset(p) * across)
                : 0.0;
        double at[2];
        for (int a = 0; a < 2; a++) {
            at[a] = share * centre[a] + (1.0 - share) * light[a] - offset * m.along[a];
        }
        bst_assert_close(d.x_px, at[0], 1e-3); /* a step of 1e-4 rad for the direction */
        bst_assert_close(d.y_px, at[1], 1e-3);
        double own =
            length * length *
            (SPHERE.centre_sigma * SPHERE.centre_sigma + (edge ? 0.0625 : 0.0) + 9e6 / (4e4 * 4e4));
        double radial = sun ? 0.5 * offset : 2.0 / (3.0 * BST_PI) * length, r2 = radial * radial;
        double xx = sun ? m.along[0] * m.along[0] : 1.0, yy = sun ? m.along[1] * m.along[1] : 1.0,
               xy = sun ? m.along[0] * m.along[1] : 0.0;
        bst_assert_close(d.cov_xx, own + r2 * xx, 1e-3 * r2);
        bst_assert_close(d.cov_yy, own + r2 * yy, 1e-3 * r2);
        bst_assert_close(d.cov_xy, r2 * xy, 1e-3 * r2);
        bst_assert_close(d.snr, 4e4 / 3e3, 1e-9);
        bst_assert_close(d.flux_sigma_e, 3e3, 1e-9);
        bst_assert_close(d.length_px, length, 1e-9);
        bst_assert_close(d.width_px, 13.5, 1e-9);
        const bst_detection_extent *e = &d.extent;
        const double reported[] = {e->light_x_px, e->light_y_px, e->x0_px,    e->y0_px,
                                   e->x1_px,      e->y1_px,      e->area_px2, e->saturated_share};
        const double want[] = {light[0],     light[1],    121 + 3 * 84, 61 + 3 * 38,
                               121 + 3 * 96, 61 + 3 * 45, 630.0,        0.2};
        for (int i = 0; i < 8; i++) {
            bst_assert_close(reported[i], want[i], 1e-9);
        }
        double sigma = m.camera.psf_fwhm_px / BST_FWHM_PER_SIGMA;
        bst_assert_close(e->size_sigma_px, hypot(0.6 * sigma, 0.02 * length), 1e-9);
        bst_assert_close(e->phase_rad, sun ? p : 0.0, 1e-9);
        double range = 2.0 / (length * bst_camera_scale_rad(&m.camera));
        bst_assert_close(e->range_m, range, 1e-9 * range);
        bst_assert_close(e->range_sigma_m / range, hypot(e->size_sigma_px / length, 0.05), 1e-9);
        assert_int_equal((d.flags & BST_DETECTION_EDGE) != 0, edge);
    }
}

/* A point of the silhouette's light: from a third of the hand-over size on its centroid is moved
 * back from the Sun, as a whole from twice that on. */
static void points_are_moved_back_from_the_sun(void **state) {
    (void)state;
    const double shares[3] = {0.0, 0.6, 1.0};
    for (int k = 0; k < 3; k++) {
        made_up m = make_up(5.0, true);
        /* sizes by second moments: 0.3 times 6 px, and the share more of that */
        m.s.moment_size_px = 1.8 * (1.0 + shares[k]) / 3.0 + (k == 2 ? 1.0 : 0.0);
        bst_detection d = {
            .x_px = 380.2, .y_px = 190.7, .cov_xx = 0.3, .cov_xy = -0.05, .cov_yy = 0.2};
        set_sun(&m, d.x_px, d.y_px);
        double offset = shares[k] * 0.8 * bst_light_phase_offset(m.phase_rad) * m.across_px;
        bst_extended_correct_point(&m.config, &m.view, &m.s, &d);
        bst_assert_close(d.x_px, 380.2 - offset * m.along[0], 1e-3);
        bst_assert_close(d.y_px, 190.7 - offset * m.along[1], 1e-3);
        double v = 0.25 * offset * offset;
        bst_assert_close(d.cov_xx, 0.3 + v * m.along[0] * m.along[0], 1e-3 * (v + 1e-6));
        bst_assert_close(d.cov_xy, -0.05 + v * m.along[0] * m.along[1], 1e-3 * (v + 1e-6));
        bst_assert_close(d.cov_yy, 0.2 + v * m.along[1] * m.along[1], 1e-3 * (v + 1e-6));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(offsets_of_a_sphere),
        cmocka_unit_test(outline_of_a_square),
        cmocka_unit_test(centre_in_perspective),
        cmocka_unit_test(a_made_up_silhouette),
        cmocka_unit_test(points_are_moved_back_from_the_sun),
        cmocka_unit_test(spheres),
        cmocka_unit_test(parts_and_shadows),
        cmocka_unit_test(bars_side_by_side),
        cmocka_unit_test(unlike_faces),
        cmocka_unit_test(saturated),
        cmocka_unit_test(limits),
        cmocka_unit_test(handover),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
