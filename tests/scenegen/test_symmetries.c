/* One scene on a sensor that is mirrored along either axis, or whose axes change places: the image
 * is mirrored, and the light of each source is the same. All sizes, places and motions differ
 * between the axes. */
#include "scenegen/renderer.h"
#include "sim/optics/psf.h"
#include "sim/world/scene/source_body.h"
#include "tests/satellite/satellite_support.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"

enum { WIDTH = 150, HEIGHT = 110, WAYS = 8, SAMPLES = 33, SOURCES = 7, TURNS = 9 };

/* A way to turn or mirror the sensor: x and y change places if `swap`, then change signs. */
typedef struct way {
    bool swap;
    double sign[2];
} way;

static way way_of(int n) {
    return (way){n & 4, {n & 1 ? -1.0 : 1.0, n & 2 ? -1.0 : 1.0}};
}

static double determinant(way w) {
    return w.sign[0] * w.sign[1] * (w.swap ? -1.0 : 1.0);
}

static bst_vec3 turned(way w, bst_vec3 v) {
    return (bst_vec3){w.sign[0] * (w.swap ? v.y : v.x), w.sign[1] * (w.swap ? v.x : v.y), v.z};
}

static void turn_pair(way w, double v[2]) {
    bst_vec3 r = turned(w, (bst_vec3){v[0], v[1], 0.0});
    v[0] = r.x;
    v[1] = r.y;
}

/* A rotation in axes that are turned and mirrored. */
static bst_quat turned_rotation(way w, bst_quat q) {
    bst_vec3 v = bst_vec3_scale(turned(w, (bst_vec3){q.x, q.y, q.z}), determinant(w));
    return (bst_quat){v.x, v.y, v.z, q.w};
}

/* Place of a pixel of a grid in the grid of the other way. */
static int place_of(way w, int width, int height, int x, int y) {
    int u = w.swap ? y : x, v = w.swap ? x : y, across = w.swap ? height : width,
        down = w.swap ? width : height;
    u = w.sign[0] < 0.0 ? across - 1 - u : u;
    v = w.sign[1] < 0.0 ? down - 1 - v : v;
    return v * across + u;
}

static bst_window turned_window(way w, bst_window from) {
    bst_window to = w.swap ? (bst_window){from.y0, from.x0, from.height, from.width} : from;
    int across = w.swap ? HEIGHT : WIDTH, down = w.swap ? WIDTH : HEIGHT;
    to.x0 = w.sign[0] < 0.0 ? across - to.x0 - to.width : to.x0;
    to.y0 = w.sign[1] < 0.0 ? down - to.y0 - to.height : to.y0;
    return to;
}

/* The camera the other way. */
static bst_camera turned_camera(way w, const bst_camera *from) {
    bst_camera c = *from;
    double tangential[2] = {c.distortion.p2, c.distortion.p1};
    c.width_px = w.swap ? from->height_px : from->width_px;
    c.height_px = w.swap ? from->width_px : from->height_px;
    turn_pair(w, c.boresight_offset_px);
    turn_pair(w, tangential);
    c.distortion.p2 = tangential[0];
    c.distortion.p1 = tangential[1];
    c.rotation_deg *= determinant(w);
    return c;
}

/* A scene with room of its own. */
typedef struct scene {
    bst_scene_source sources[SOURCES];
    bst_scene_source_path path[2];
    bst_scene_source_rate rate;
    bst_scene_source_shape shape;
    bst_ghost ghost;
    bst_scene_source_body body;
    double time_s[SAMPLES];
    bst_quat q[SAMPLES];
} scene;

static const double times_s = 0.6;

/* Light that grows from u = 0.3 on. */
static bst_scene_source_rate growing(void) {
    return (bst_scene_source_rate){.count = 3,
                                   .u = {0.0, 0.3, 1.0},
                                   .rate = {0.5, 0.5, 0.5 + 10.0 / 7.0},
                                   .light = {0.0, 0.15, 1.0}};
}

/* The body, which turns and passes; `a`: a pixel, rad. */
static void make_body(double a, const bst_satellite *model, scene *s) {
    s->body = (bst_scene_source_body){.satellite = model, .times = TURNS};
    for (int k = 0; k < TURNS; k++) {
        bst_quat turn = bst_quat_from_rotvec((bst_vec3){0.04 * k, -0.01 * k, 0.02 * k});
        s->body.q_body_from_gcrf[k] =
            bst_quat_conj(bst_quat_mul(turn, bst_quat_from_rotvec((bst_vec3){2.7, 0.4, 0.3})));
    }
    s->body.object_m[0] = s->body.object_m[1] = (bst_vec3){7e6, 1e6, -2e6};
    s->body.sun_m = bst_vec3_scale(bst_vec3_unit((bst_vec3){0.5, -0.3, -0.8}), BST_AU_M);
    s->body.gain[0].sun = 1e2 / (a * a);
    s->body.gain[1].sun = 3e2 / (a * a);
    s->sources[6] = s->sources[3];
    s->sources[6].apparent_mid = bst_vec3_unit(s->path[1].place[2]);
    s->sources[6].path = &s->path[1];
    s->sources[6].rate = NULL;
    s->sources[6].body = &s->body;
    s->sources[6].body_u[1] = 1.0;
    s->sources[6].electrons_per_s = 1e6;
}

/* Stars, a target that passes, grows brighter and casts a ghost, a planet, and a body that turns.
 */
static void make_scene(const bst_camera *camera, const bst_satellite *model, scene *s) {
    double a = bst_camera_scale_rad(camera);
    for (int k = 0; k < SAMPLES; k++) {
        double u = (double)k / (SAMPLES - 1), bend = 4.0 * (u - 0.5) * (u - 0.5);
        s->time_s[k] = times_s * u;
        s->q[k] = bst_quat_from_rotvec((bst_vec3){-a * (5.0 * (u - 0.5) - 2.0 * bend),
                                                  a * (16.0 * (u - 0.5) + 0.3 * sin(9.0 * u)),
                                                  0.03 * (u - 0.5)});
    }
    const double stars[3][3] = {{33.3, 41.8, 1e4}, {101.7, 84.2, 6e4}, {62.4, -3.6, 1e5}};
    for (int i = 0; i < 3; i++) {
        s->sources[i] = scene_star(camera, stars[i][0], stars[i][1], stars[i][2]);
    }
    s->rate = growing();
    for (int i = 0; i < 2; i++) { /* the target, and the body */
        bst_vec3 middle =
            bst_vec3_scale(bst_camera_unproject(camera, i ? 108.3 : 47.3, i ? 31.2 : 80.9), 1e6);
        bst_vec3 step = bst_vec3_scale((bst_vec3){i ? 2.0 : -9.0, i ? -3.0 : 14.0, 0.0}, a * 1e6);
        s->path[i] = bst_scene_source_path_through(bst_vec3_sub(middle, step), middle,
                                                   bst_vec3_add(middle, step));
    }
    bst_scene_source target = {
        .kind = BST_SOURCE_OBJECT,
        .apparent_mid = bst_scene_source_direction(&(bst_scene_source){.path = &s->path[0]}, 0.5),
        .path = &s->path[0],
        .rate = &s->rate,
        .electrons_per_s = 5e4,
        .range_m = 1e6};
    s->sources[3] = target;
    s->ghost =
        (bst_ghost){.intensity = 1.0, .factor = -0.7, .radius_px = 4.0, .inner_radius_px = 2.0};
    s->ghost.centre_x_px = bst_camera_centre_x(camera) + 4.0;
    s->ghost.centre_y_px = bst_camera_centre_y(camera) - 7.0;
    s->sources[4] = target;
    s->sources[4].ghost = &s->ghost;
    s->sources[4].electrons_per_s = 1e4;
    s->shape = (bst_scene_source_shape){.radius = 5.0 * a,
                                        .sun = bst_vec3_unit((bst_vec3){0.7, -0.3, -0.4}),
                                        .earth = bst_vec3_unit((bst_vec3){-0.5, -0.6, -0.4}),
                                        .diffuse = 0.7,
                                        .specular = 0.1,
                                        .earthshine = 0.15,
                                        .thermal = 0.05};
    s->sources[5] = scene_star(camera, 22.2, 14.7, 4e4);
    s->sources[5].kind = BST_SOURCE_OBJECT;
    s->sources[5].range_m = 1e6;
    s->sources[5].shape = &s->shape;
    make_body(a, model, s);
}

/* A body that is the same behind its mirror y = 0; 1 m is 12 px at 1000 km. */
static const char model_text[] =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.8}, {\"name\": \"n\", \"diffuse\": 0.3}], "
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1.5, 1.1, 2.0], \"material\": "
    "\"m\"}, {\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2.0, 0.8, 0], \"position_m\": "
    "[1.9, "
    "0, 0.3], \"rotation_deg\": [0, 25, 0], \"material\": \"n\"}]}";

/* The same scene the other way. The body is mirrored with it, which its shape permits. */
static void turn_scene(way w, const scene *from, scene *to) {
    *to = *from;
    double side = determinant(w); /* body' = S R M^T, S the mirror of its y axis or none */
    bst_vec3 x = turned(w, (bst_vec3){1.0, 0.0, 0.0}), y = turned(w, (bst_vec3){0.0, 1.0, 0.0});
    /* S M^T is a rotation about z: its first column is S times the first row of M */
    bst_quat own = bst_quat_from_rotvec((bst_vec3){0.0, 0.0, atan2(side * y.x, x.x)});
    for (int k = 0; k < SAMPLES; k++) {
        to->q[k] = turned_rotation(w, from->q[k]);
    }
    for (int k = 0; k < TURNS; k++) {
        to->body.q_body_from_gcrf[k] =
            bst_quat_mul(own, turned_rotation(w, from->body.q_body_from_gcrf[k]));
    }
    for (int i = 0; i < 2; i++) {
        to->body.object_m[i] = turned(w, from->body.object_m[i]);
        for (int k = 0; k < BST_PATH_NODES; k++) {
            to->path[i].place[k] = turned(w, from->path[i].place[k]);
        }
        for (int k = 0; k < 3; k++) {
            to->path[i].shift[k] = turned(w, from->path[i].shift[k]);
        }
    }
    to->body.sun_m = turned(w, from->body.sun_m);
    to->shape.sun = turned(w, from->shape.sun);
    to->shape.earth = turned(w, from->shape.earth);
    for (int i = 0; i < SOURCES; i++) {
        bst_scene_source *s = &to->sources[i];
        s->apparent_mid = turned(w, s->apparent_mid);
        s->path = s->path ? &to->path[s->path == &from->path[1]] : NULL;
        s->rate = s->rate ? &to->rate : NULL;
        s->shape = s->shape ? &to->shape : NULL;
        s->ghost = s->ghost ? &to->ghost : NULL;
        s->body = s->body ? &to->body : NULL;
    }
}

/* What a frame shows. */
typedef struct picture {
    float image[WIDTH * HEIGHT];
    double peak_e[SOURCES];
    bst_render_stats stats;
} picture;

static void take(fixture *f, const bst_camera *camera, const scene *s, bst_window window,
                 int binning, int threads, picture *out) {
    bst_renderer *r;
    bst_renderer_options options = bst_renderer_default_options();
    options.planning_threads = threads;
    const bst_los_track track = {SAMPLES, (double *)s->time_s, (bst_quat *)s->q};
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, &options, &r));
    bst_render_request q = {.window = window,
                            .track = &track,
                            .sources = s->sources,
                            .count = SOURCES,
                            .background_e = 20.0,
                            .binning = binning};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, out->image));
    bst_renderer_get_stats(r, &out->stats);
    for (int i = 0; i < SOURCES; i++) {
        out->peak_e[i] = bst_renderer_peak_e(r, i);
    }
    bst_renderer_free(r);
}

/* Compares the pictures of the ways, of which all others are made, with the first. */
static void compare_ways(fixture *f, const bst_camera *camera, int binning) {
    static scene straight, other;
    static picture want, got;
    const bst_window window = {12, 6, 132, 84};
    int width = window.width, height = window.height; /* an image without noise is not binned */
    bst_test_model model = bst_test_model_open(model_text);
    for (int n = 0; n < WAYS; n += n < 1 ? 1 : n) {
        way w = way_of(n);
        bst_camera c = turned_camera(w, camera);
        bst_assert_ok(&f->ctx, bst_camera_prepare(&f->ctx, &c));
        if (n == 0) {
            make_scene(&c, model.satellite, &straight);
        }
        turn_scene(w, &straight, &other);
        bst_vec3 centre = turned(w, (bst_vec3){4.0, -7.0, 0.0});
        other.ghost.centre_x_px = bst_camera_centre_x(&c) + centre.x;
        other.ghost.centre_y_px = bst_camera_centre_y(&c) + centre.y;
        take(f, &c, &other, turned_window(w, window), binning, 1, n == 0 ? &want : &got);
        double worst = 0.0, read2 = c.read_noise_e * c.read_noise_e;
        for (int i = 0; i < width * height && n > 0; i++) {
            double e = (double)want.image[i];
            double at = (double)got.image[place_of(w, width, height, i % width, i / width)];
            worst = fmax(worst, fabs(at - e) / sqrt(e + read2));
        }
        /* places are rounded to 1 / 4096 px; thresholds of the choice of nodes */
        assert_true(worst < 0.02);
        for (int i = 0; i < SOURCES && n > 0; i++) {
            bst_assert_close(got.peak_e[i], want.peak_e[i], 1e-6 * want.peak_e[i]);
        }
    }
    bst_test_model_close(&model);
}

static bst_camera odd_camera(void) {
    bst_camera c = scene_camera(WIDTH, HEIGHT);
    c.boresight_offset_px[0] = 8.0;
    c.boresight_offset_px[1] = -13.0;
    c.pixel_scale_arcsec = 1.0 / (1e6 * 12.0) / BST_ARCSEC_RAD;
    return c;
}

static void gaussian_images_turn(void **state) {
    bst_camera c = odd_camera();
    compare_ways(*state, &c, 1);
    compare_ways(*state, &c, 2);
}

/* Distorted by a few pixels at the corners, and turned. */
static void distorted_images_turn(void **state) {
    bst_camera c = odd_camera();
    double a = bst_camera_scale_rad(&c), corner = 90.0 * a;
    c.rotation_deg = 17.0;
    c.distortion = (bst_camera_distortion){
        .k1 = 0.03 / (corner * corner), .p1 = 0.01 / corner, .p2 = -0.006 / corner};
    compare_ways(*state, &c, 1);
}

/* A smaller sensor about the same boresight sees its part of the image, also of sources whose place
 * is beside it: at each side and at a corner of the body, and next to the other sources. */
static void smaller_sensors_see_their_part(void **state) {
    fixture *f = *state;
    static scene s;
    static picture whole, part;
    bst_camera camera = odd_camera();
    bst_test_model model = bst_test_model_open(model_text);
    make_scene(&camera, model.satellite, &s);
    take(f, &camera, &s, (bst_window){0, 0, WIDTH, HEIGHT}, 1, 1, &whole);
    const bst_window parts[] = {
        {118, 4, 27, 100}, {30, 3, 67, 60}, {46, 41, 90, 29}, {70, 0, 77, 23}, {115, 37, 20, 41}};
    for (int n = 0; n < 5; n++) {
        const bst_window *w = &parts[n];
        bst_camera c = camera;
        c.width_px = w->width;
        c.height_px = w->height;
        c.boresight_offset_px[0] = bst_camera_centre_x(&camera) - w->x0 - 0.5 * (w->width - 1);
        c.boresight_offset_px[1] = bst_camera_centre_y(&camera) - w->y0 - 0.5 * (w->height - 1);
        s.ghost.centre_x_px = bst_camera_centre_x(&c) + 4.0;
        s.ghost.centre_y_px = bst_camera_centre_y(&c) - 7.0;
        take(f, &c, &s, (bst_window){0, 0, w->width, w->height}, 1, 1, &part);
        double worst = 0.0;
        for (int i = 0; i < w->width * w->height; i++) {
            int at = (w->y0 + i / w->width) * WIDTH + w->x0 + i % w->width;
            double want = (double)whole.image[at], error = fabs((double)part.image[i] - want);
            worst = fmax(worst, error / sqrt(want + c.read_noise_e * c.read_noise_e));
        }
        assert_true(worst < 0.1); /* twice the tolerance of a frame */
    }
    bst_test_model_close(&model);
}

/* What several threads compute ahead is what one computes: of sources in the window and beside it.
 */
static void threads_plan_the_same(void **state) {
    fixture *f = *state;
    static scene s;
    static picture one, many;
    bst_camera camera = odd_camera();
    bst_test_model model = bst_test_model_open(model_text);
    make_scene(&camera, model.satellite, &s);
    for (int n = 0; n < 3;
         n++) { /* all; the target, its ghost and the planet left or below of it */
        const bst_window w = {n == 1 ? 70 : 0, n == 2 ? 100 : 0, n == 1 ? 70 : WIDTH,
                              n == 2 ? 10 : 90};
        take(f, &camera, &s, w, 1, 1, &one);
        take(f, &camera, &s, w, 1, 4, &many);
        assert_memory_equal(one.image, many.image, sizeof(float) * (size_t)(w.width * w.height));
        assert_memory_equal(one.peak_e, many.peak_e, sizeof one.peak_e);
        assert_true(one.stats.predicted_sigma > 0.0);
        bst_assert_close(many.stats.predicted_sigma, one.stats.predicted_sigma, 0.0);
        assert_true(many.stats.nodes == one.stats.nodes);
    }
    bst_test_model_close(&model);
}

enum { COLUMNS = 3, ROWS = 2, WIDE = 45, HIGH = 37 };

/* A PSF with a field of widths, or of an image with four samples to a pixel; both the other way. */
static bst_psf *turned_psf(bst_ctx *ctx, way w, const bst_camera *camera, const double *fwhm_px,
                           const float *image) {
    bst_psf_field_node nodes[COLUMNS * ROWS] = {{.psf_fwhm_px = 0.0}};
    static float samples[WIDE * HIGH];
    bst_camera c = *camera;
    bst_psf *psf;
    for (int i = 0; i < COLUMNS * ROWS; i++) {
        nodes[place_of(w, COLUMNS, ROWS, i % COLUMNS, i / COLUMNS)].psf_fwhm_px = fwhm_px[i];
    }
    for (int i = 0; i < WIDE * HIGH; i++) {
        samples[place_of(w, WIDE, HIGH, i % WIDE, i / WIDE)] = image[i];
    }
    const bst_psf_samples sampled = {samples, w.swap ? HIGH : WIDE, w.swap ? WIDE : HIGH, 1, 4.0};
    const bst_psf_inputs inputs = {.samples = c.optics.psf == BST_PSF_FILE ? &sampled : NULL};
    if (c.optics.psf == BST_PSF_MOFFAT) {
        c.optics.field_columns = w.swap ? ROWS : COLUMNS;
        c.optics.field_rows = w.swap ? COLUMNS : ROWS;
        c.optics.field = (bst_config_list){nodes, COLUMNS * ROWS};
    }
    bst_assert_ok(ctx, bst_psf_create_from(ctx, &c, &inputs, &psf));
    return psf;
}

/* Stars at rest behind other PSFs: a Moffat function that is wider at one corner, and the image of
 * a slanted bar that is off its middle. */
static void images_of_other_psfs_turn(void **state) {
    fixture *f = *state;
    static const double fwhm_px[COLUMNS * ROWS] = {1.8, 2.0, 2.4, 1.9, 2.2, 3.0};
    static float bar[WIDE * HIGH], images[2][WIDTH * HEIGHT];
    const double stars[3][2] = {{33.3, 41.8}, {101.7, 84.2}, {122.4, 21.6}}, times[2] = {0.0, 0.6};
    const bst_quat still[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    const bst_los_track track = {2, times, still};
    for (int i = 0; i < WIDE * HIGH; i++) {
        double x = (i % WIDE - 21.0) / 4.0, y = (double)(i / WIDE - 18) / 4.0;
        double u = 0.8 * x + 0.6 * y, v = 0.8 * y - 0.6 * x;
        bar[i] = (float)exp(-0.5 * (u * u / 0.6 + v * v / 1.1));
    }
    for (int n = 0; n < 4; n++) { /* two PSFs, each straight and turned by a quarter */
        way w = way_of(n % 2 ? 5 : 0);
        bst_camera first = odd_camera();
        first.optics =
            (bst_optics_config){.psf = n < 2 ? BST_PSF_MOFFAT : BST_PSF_FILE, .moffat_beta = 3.0};
        bst_camera c = turned_camera(w, &first);
        bst_psf *psf = turned_psf(&f->ctx, w, &c, fwhm_px, bar);
        c.psf = psf;
        bst_scene_source sources[3];
        for (int i = 0; i < 3; i++) {
            sources[i] = scene_star(&first, stars[i][0], stars[i][1], 3e4);
            sources[i].apparent_mid = turned(w, sources[i].apparent_mid);
        }
        bst_renderer *r;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
        bst_render_request q = {.window = {0, 0, (int)c.width_px, (int)c.height_px},
                                .track = &track,
                                .sources = sources,
                                .count = 3};
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, images[n % 2]));
        double worst = 0.0;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            int at = place_of(w, WIDTH, HEIGHT, i % WIDTH, i / WIDTH);
            double want = (double)images[0][i], got = (double)images[n % 2][at];
            worst = fmax(worst, fabs(got - want) / sqrt(want + c.read_noise_e * c.read_noise_e));
        }
        assert_true(worst < 0.02);
        bst_renderer_free(r);
        bst_psf_free(psf);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gaussian_images_turn), cmocka_unit_test(distorted_images_turn),
        cmocka_unit_test(smaller_sensors_see_their_part), cmocka_unit_test(threads_plan_the_same),
        cmocka_unit_test(images_of_other_psfs_turn)};
    return cmocka_run_group_tests(tests, open_device, close_device);
}
