/* Frames of shapes against closed forms of their images under a Gaussian PSF. */
#include "scenegen/renderer.h"
#include "sim/world/scene/source_body.h"
#include "sim/world/scene/star_occultation.h"
#include "tests/satellite/satellite_support.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"

enum { SIDE = 128 };

/* One metre is 20 px at this range, and perspective is negligible: 1 m over the range. */
#define RANGE_M 1e6
#define PX_PER_M 20.0

static bst_camera small_camera(void) {
    bst_camera camera = scene_camera(SIDE, SIDE);
    camera.pixel_scale_arcsec = 1.0 / (RANGE_M * PX_PER_M) / BST_ARCSEC_RAD;
    return camera;
}

/* The convex region of an image in which a surface is, with its radiance per px^2. */
typedef struct region {
    double low, high; /* rows */
    void (*chord)(const struct region *r, double y, double *from, double *to);
    double (*radiance)(const struct region *r, double x, double y);
    double corner[4][2]; /* polygon */
    double value;
    double x0, y0, radius; /* of a sphere or cylinder */
    double sun[3];         /* x right, y down, z to the observer */
    double cosine, sine;   /* of a cylinder's roll */
} region;

/* Adds the image of a region under the PSF: exact in x and y but for quadrature in panels of
 * STEP px. */
static void add_region(double *image, const region *r, double sigma) {
    static const double place[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813,
                                    0.93056815579702629};
    static const double weight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                     0.17392742256872693};
    const double step = 0.25, reach = 7.0 * sigma + 1.0, s = sigma * sqrt(2.0);
    int rows = (int)ceil((r->high - r->low) / step);
    for (int n = 0; n < 4 * rows; n++) {
        /* uniform in the angle: smooth where a chord vanishes as a square root */
        double line[SIDE] = {0}, from, to, half = 0.5 * (r->high - r->low);
        double turn = BST_PI * ((n / 4 + place[n % 4]) / rows - 0.5);
        double y = r->low + half * (1.0 + sin(turn)), high = half * cos(turn) * BST_PI / rows;
        r->chord(r, y, &from, &to);
        int parts = (int)ceil((to - from) / step);
        for (int k = 0; k < 4 * parts; k++) {
            /* uniform in the angle: smooth at the limb */
            double t = BST_PI * ((k / 4 + place[k % 4]) / parts - 0.5);
            double x = 0.5 * (from + to) + 0.5 * (to - from) * sin(t);
            double light =
                r->radiance(r, x, y) * 0.5 * (to - from) * cos(t) * BST_PI / parts * weight[k % 4];
            for (int i = (int)fmax(x - reach, 0.0); i < SIDE && i < x + reach; i++) {
                line[i] += 0.5 * light * (erf((i + 0.5 - x) / s) - erf((i - 0.5 - x) / s));
            }
        }
        for (int j = (int)fmax(y - reach, 0.0); j < SIDE && j < y + reach; j++) {
            double part =
                0.5 * high * weight[n % 4] * (erf((j + 0.5 - y) / s) - erf((j - 0.5 - y) / s));
            for (int i = 0; i < SIDE; i++) {
                image[j * SIDE + i] += part * line[i];
            }
        }
    }
}

static void polygon_chord(const region *r, double y, double *from, double *to) {
    *from = INFINITY;
    *to = -INFINITY;
    for (int i = 0; i < 4; i++) {
        const double *a = r->corner[i], *b = r->corner[(i + 1) % 4];
        if ((a[1] <= y) != (b[1] <= y)) {
            double x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            *from = fmin(*from, x);
            *to = fmax(*to, x);
        }
    }
}

static double even(const region *r, double x, double y) {
    (void)x;
    (void)y;
    return r->value;
}

/* Adds a convex polygon of even radiance, between the rows of its corners. */
static void add_polygon(double *image, const double corner[4][2], double value, double sigma) {
    region r = {.chord = polygon_chord, .radiance = even, .value = value};
    double row[4];
    for (int i = 0; i < 4; i++) {
        r.corner[i][0] = corner[i][0];
        r.corner[i][1] = corner[i][1];
        row[i] = corner[i][1];
    }
    for (int i = 0; i < 4; i++) {
        for (int k = i + 1; k < 4; k++) {
            if (row[k] < row[i]) {
                double swap = row[i];
                row[i] = row[k];
                row[k] = swap;
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        r.low = row[i];
        r.high = row[i + 1];
        if (r.high > r.low) {
            add_region(image, &r, sigma);
        }
    }
}

static void circle_chord(const region *r, double y, double *from, double *to) {
    double half = sqrt(fmax(r->radius * r->radius - (y - r->y0) * (y - r->y0), 0.0));
    *from = r->x0 - half;
    *to = r->x0 + half;
}

static double sphere_radiance(const region *r, double x, double y) {
    double u = (x - r->x0) / r->radius, v = (y - r->y0) / r->radius;
    double w = sqrt(fmax(1.0 - u * u - v * v, 0.0));
    return r->value * fmax(u * r->sun[0] + v * r->sun[1] + w * r->sun[2], 0.0);
}

/* A cylinder across the line of sight, its axis rolled from the image's y axis. */
static double cylinder_radiance(const region *r, double x, double y) {
    double u = ((x - r->x0) * r->cosine + (y - r->y0) * r->sine) / r->radius;
    double w = sqrt(fmax(1.0 - u * u, 0.0));
    double across = r->sun[0] * r->cosine + r->sun[1] * r->sine;
    return r->value * fmax(u * across + w * r->sun[2], 0.0);
}

/* A body that is turned by q (image axes from body axes) with its origin at pixel (x, y). */
typedef struct scene {
    bst_test_model model;
    bst_scene_source_body body;
    bst_scene_source source;
} scene;

/* `per_px_e`: electrons per px of a surface that a Lambert BRDF of 1 / pi lights at normal
 * incidence. sun: towards it, image axes (x right, y down, z to the observer). */
static void make_scene(scene *s, const bst_camera *camera, const char *text, bst_quat q,
                       const double place[2], const double sun[3], double per_px_e) {
    *s = (scene){.model = bst_test_model_open(text)};
    bst_vec3 to_sun = bst_vec3_unit((bst_vec3){sun[0], sun[1], -sun[2]});
    double a = bst_camera_scale_rad(camera);
    s->body.satellite = s->model.satellite;
    s->body.times = 1;
    s->body.q_body_from_gcrf[0] = bst_quat_conj(q);
    s->body.object_m[0] = s->body.object_m[1] = (bst_vec3){7e6, 0, 0};
    s->body.sun_m = bst_vec3_axpy(s->body.object_m[0], BST_AU_M, to_sun);
    for (int m = 0; m < s->model.satellite->material_count; m++) {
        s->body.gain[m].sun = BST_PI * per_px_e / (a * a);
    }
    s->source = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                   .apparent_mid = bst_camera_unproject(camera, place[0], place[1]),
                                   .range_m = RANGE_M,
                                   .body = &s->body,
                                   .body_u = {0.0, 1.0}};
    bst_vec3 eye =
        bst_quat_rotate(s->body.q_body_from_gcrf[0], bst_vec3_scale(s->source.apparent_mid, -1.0));
    bst_vec3 light = bst_quat_rotate(s->body.q_body_from_gcrf[0], to_sun);
    s->source.electrons_per_s =
        s->body.gain[0].sun * bst_test_flux(&s->model, light, eye) / (RANGE_M * RANGE_M);
}

/* Draws a source without noise during a track. */
static void draw_along(fixture *f, const bst_camera *camera, const bst_los_track *track,
                       const bst_scene_source *source, float image[SIDE * SIDE],
                       bst_render_stats *stats) {
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, NULL, &r));
    bst_render_request q = {
        .window = {0, 0, SIDE, SIDE}, .track = track, .sources = source, .count = 1};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    bst_renderer_get_stats(r, stats);
    bst_renderer_free(r);
}

/* Draws a source without noise and motion. */
static void draw(fixture *f, const bst_camera *camera, const bst_scene_source *source,
                 float image[SIDE * SIDE], bst_render_stats *stats) {
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    scene_track track = scene_track_make(camera, &still);
    draw_along(f, camera, &track.track, source, image, stats);
    scene_track_free(&track);
}

/* Largest error of the frame in sigma of its pixel. */
static double compare(fixture *f, const bst_camera *camera, const bst_scene_source *source,
                      const double *expected, double *sigma_e) {
    static float image[SIDE * SIDE];
    bst_render_stats stats;
    draw(f, camera, source, image, &stats);
    double worst = 0.0, read2 = camera->read_noise_e * camera->read_noise_e;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double error = fabs((double)image[i] - expected[i]) / sqrt(expected[i] + read2);
        worst = fmax(worst, error);
    }
    *sigma_e = stats.predicted_sigma;
    return worst;
}

#define MATERIAL \
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"parts\": [{\"name\": \"b\", "
static const char *const plate =
    MATERIAL "\"kind\": \"plate\", \"size_m\": [2.2, 1.3, 0], \"material\": \"m\"}]}";
static const char *const sphere =
    MATERIAL "\"kind\": \"sphere\", \"radius_m\": 1.1, \"material\": \"m\"}]}";
static const char *const cylinder =
    MATERIAL "\"kind\": \"cylinder\", \"radius_m\": 0.8, \"length_m\": 2.5, \"material\": \"m\"}]}";
static const char *const box =
    MATERIAL "\"kind\": \"box\", \"size_m\": [1.5, 1.1, 2.0], \"material\": \"m\"}]}";

static const char *const two_boxes =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"parts\": ["
    "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1.5, 1.1, 2.0], \"material\": \"m\"},"
    "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [3.0, 1.1, 0], \"position_m\": [2.5, 0, "
    "0.2],"
    "\"rotation_deg\": [30, 0, 0], \"material\": \"m\"}]}";

static const double bright[] = {1.5e3, 4e4};

/* Corners of a face of the box or plate in the image, and whether it faces the observer. */
static bool project_face(bst_quat q, const bst_vec3 body[4], bst_vec3 normal, const double place[2],
                         double corner[4][2]) {
    for (int i = 0; i < 4; i++) {
        bst_vec3 p = bst_quat_rotate(q, body[i]);
        corner[i][0] = place[0] + PX_PER_M * p.x;
        corner[i][1] = place[1] + PX_PER_M * p.y;
    }
    return bst_quat_rotate(q, normal).z < 0.0;
}

static void test_boxes(void **state) {
    fixture *f = *state;
    bst_camera camera = small_camera();
    double sigma_px = bst_camera_psf_sigma_px(&camera), predicted;
    const char *const texts[] = {plate, box};
    const double size[2][3] = {{2.2, 1.3, 0.0}, {1.5, 1.1, 2.0}}, sun[3] = {0.5, -0.3, 0.8};
    const bst_vec3 turns[] = {{BST_PI, 0.0, 0.0}, {2.7, 0.4, 0.3}, {2.9, 0.35, 0.6}};
    double *expected = malloc(SIDE * SIDE * sizeof *expected);
    for (int n = 0; n < 12; n += 2) {
        bst_quat q = bst_quat_from_rotvec(turns[n % 3]);
        const double place[2] = {63.2, 64.45};
        double per_px_e = bright[n / 6];
        int kind = n / 3 % 2;
        scene s;
        make_scene(&s, &camera, texts[kind], q, place, sun, per_px_e);
        memset(expected, 0, SIDE * SIDE * sizeof *expected);
        bst_vec3 to_sun = bst_vec3_unit((bst_vec3){sun[0], sun[1], -sun[2]});
        for (int face = 0; face < 6; face++) {
            int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
            double side = face % 2 ? 1.0 : -1.0, corner[4][2], part[3];
            bst_vec3 body[4],
                normal = {axis == 0 ? side : 0, axis == 1 ? side : 0, axis == 2 ? side : 0};
            if (kind == 0 && axis != 2) {
                continue;
            }
            for (int i = 0; i < 4; i++) {
                part[axis] = 0.5 * side * size[kind][axis];
                part[u] = (i == 1 || i == 2 ? 0.5 : -0.5) * size[kind][u];
                part[v] = (i >= 2 ? 0.5 : -0.5) * size[kind][v];
                body[i] = bst_vec3_from_array(part);
            }
            if (project_face(q, body, normal, place, corner)) {
                double in = fmax(bst_vec3_dot(bst_quat_rotate(q, normal), to_sun), 0.0);
                add_polygon(expected, (const double(*)[2])corner, per_px_e * in, sigma_px);
            }
        }
        double worst = compare(f, &camera, &s.source, expected, &predicted);
        assert_true(worst <= 0.05);
        assert_true(worst <= predicted);
        bst_test_model_close(&s.model);
    }
    free(expected);
}

static void test_sphere_and_cylinder(void **state) {
    fixture *f = *state;
    bst_camera camera = small_camera();
    double sigma_px = bst_camera_psf_sigma_px(&camera), predicted;
    const double suns[3][3] = {{0.0, 0.0, 1.0}, {0.8, 0.3, 0.52}, {-0.9, 0.2, -0.3}};
    double *expected = malloc(SIDE * SIDE * sizeof *expected);
    for (int n = 0; n < 12; n += 1 + (n % 3 == 0)) {
        const double place[2] = {63.2, 64.45}, *sun = suns[n % 3];
        double per_px_e = bright[n / 6], roll = 0.35;
        bool round = n / 3 % 2 == 0;
        bst_vec3 direction = bst_vec3_unit((bst_vec3){sun[0], sun[1], sun[2]});
        /* body z to the image's -y, then rolled */
        bst_quat q = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, roll}),
                                  bst_quat_from_rotvec((bst_vec3){0.5 * BST_PI, 0, 0}));
        scene s;
        make_scene(&s, &camera, round ? sphere : cylinder, q, place, sun, per_px_e);
        memset(expected, 0, SIDE * SIDE * sizeof *expected);
        region r = {.value = per_px_e,
                    .x0 = place[0],
                    .y0 = place[1],
                    .radius = PX_PER_M * (round ? 1.1 : 0.8),
                    .sun = {direction.x, direction.y, direction.z},
                    .cosine = cos(roll),
                    .sine = sin(roll)};
        if (round) {
            r.low = place[1] - r.radius;
            r.high = place[1] + r.radius;
            r.chord = circle_chord;
            r.radiance = sphere_radiance;
            add_region(expected, &r, sigma_px);
        } else {
            double half = 0.5 * PX_PER_M * 2.5, row[4];
            r.chord = polygon_chord;
            r.radiance = cylinder_radiance;
            for (int i = 0; i < 4; i++) {
                double x = (i == 1 || i == 2 ? 1.0 : -1.0) * r.radius, y = (i >= 2 ? half : -half);
                r.corner[i][0] = place[0] + x * r.cosine - y * r.sine;
                r.corner[i][1] = place[1] + x * r.sine + y * r.cosine;
            }
            row[0] = r.corner[0][1];
            row[1] = r.corner[1][1];
            row[2] = r.corner[3][1];
            row[3] = r.corner[2][1];
            for (int i = 0; i < 3; i++) {
                r.low = fmin(row[i], row[i + 1]);
                r.high = fmax(row[i], row[i + 1]);
                add_region(expected, &r, sigma_px);
            }
        }
        double worst = compare(f, &camera, &s.source, expected, &predicted);
        assert_true(worst <= 0.05);
        assert_true(worst <= predicted);
        bst_test_model_close(&s.model);
    }
    free(expected);
}

/* Light and centroid of the frame of a scene whose body is `across` px, relative to the point
 * source of the same flux. */
static void light_at(fixture *f, bst_renderer *r, const bst_camera *camera, scene *s, double across,
                     double *light, double *x, double *y) {
    static float image[SIDE * SIDE];
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    scene_track track = scene_track_make(camera, &still);
    double range_m = 2.0 * s->model.satellite->radius_m / bst_camera_scale_rad(camera) / across;
    double nearer = s->source.range_m / range_m;
    s->source.range_m = range_m;
    s->source.electrons_per_s *= nearer * nearer;
    /* the same electrons at any range */
    double scale = 2e5 / s->source.electrons_per_s;
    s->source.electrons_per_s *= scale;
    s->body.gain[0].sun *= scale;
    bst_render_request q = {
        .window = {0, 0, SIDE, SIDE}, .track = &track.track, .sources = &s->source, .count = 1};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    *light = *x = *y = 0.0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        *light += (double)image[i];
        *x += (double)image[i] * (i % SIDE);
        *y += (double)image[i] * (double)(i / SIDE);
    }
    *x /= *light;
    *y /= *light;
    *light /= s->source.electrons_per_s;
    scene_track_free(&track);
}

/* From far to near the light is that of the point source, and its centroid starts at the centre of
 * mass and moves in proportion to the size: no step where the shape is first drawn (0.02 px), nor
 * where the grid changes. */
static void test_hand_over(void **state) {
    fixture *f = *state;
    bst_camera camera = small_camera();
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
    const double place[2] = {63.2, 64.45}, sun[3] = {0.7, -0.3, 0.2};
    const double sizes[] = {0.02, 0.1, 0.5, 1.0, 1.9, 2.1, 5.0, 12.0, 31.0, 33.0, 60.0};
    scene s;
    make_scene(&s, &camera, two_boxes, bst_quat_from_rotvec((bst_vec3){2.7, 0.4, 0.3}), place, sun,
               1e3);
    double slope[2] = {0.0, 0.0};
    for (int n = 10; n >= 0; n--) { /* the slope is that of the largest */
        double light, x, y;
        light_at(f, r, &camera, &s, sizes[n], &light, &x, &y);
        if (n == 10) {
            slope[0] = (x - place[0]) / sizes[n];
            slope[1] = (y - place[1]) / sizes[n];
            assert_true(hypot(slope[0], slope[1]) > 0.05); /* there is something to see */
        }
        /* the limits */
        bst_assert_close(light, 1.0, 1e-3);
        bst_assert_close(x, place[0] + slope[0] * sizes[n], 0.01);
        bst_assert_close(y, place[1] + slope[1] * sizes[n], 0.01);
    }
    bst_test_model_close(&s.model);
    bst_renderer_free(r);
}

/* A panel that a burn 50 s ago has turned by 40 degrees is drawn as one that is mounted so. */
static void test_joint_at_a_burn(void **state) {
    fixture *f = *state;
    bst_camera camera = small_camera();
    static const char hinged[] =
        "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"joints\": [{\"name\": \"j\", "
        "\"follows\": \"burn\", \"axis\": [0, 1, 0], \"turn_deg\": 40, \"rate_deg_per_s\": 10}], "
        "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2.2, 1.3, 0], "
        "\"joint\": \"j\", \"material\": \"m\"}]}";
    static const char mounted[] = MATERIAL
        "\"kind\": \"plate\", \"size_m\": [2.2, 1.3, 0], \"rotation_deg\": [0, 40, 0], "
        "\"material\": \"m\"}]}";
    static float images[3][SIDE * SIDE];
    const double place[2] = {63.2, 64.45}, sun[3] = {0.1, 0.0, 1.0}, burn[] = {50.0};
    bst_quat q = bst_quat_from_rotvec((bst_vec3){BST_PI, 0.0, 0.0});
    for (int n = 0; n < 3; n++) { /* mounted, before the burn, after it */
        scene s;
        bst_render_stats stats;
        make_scene(&s, &camera, n == 0 ? mounted : hinged, q, place, sun, 1e3);
        s.source.electrons_per_s = 1e5; /* the share of the image is that of its own light */
        s.body.burn_s = burn;
        s.body.burn_count = 1;
        s.body.seconds[0] = s.body.seconds[1] = n < 2 ? 0.0 : 100.0;
        draw(f, &camera, &s.source, images[n], &stats);
        bst_test_model_close(&s.model);
    }
    double worst = 0.0, before = 0.0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        worst = fmax(worst, fabs((double)images[2][i] - (double)images[0][i]));
        before = fmax(before, fabs((double)images[1][i] - (double)images[0][i]));
    }
    assert_true(worst < 1.0); /* of 1000 electrons: rounding of the rotation */
    assert_true(before > 300.0);
}

/* A beam that turns about the line of sight keeps its light, up to its ends: of many poses, few
 * tell how far the image reaches. */
static void test_turning_beam(void **state) {
    enum { TIMES = 17 };
    fixture *f = *state;
    bst_camera camera = small_camera();
    static const char beam[] =
        MATERIAL "\"kind\": \"plate\", \"size_m\": [3.4, 0.1, 0], \"material\": \"m\"}]}";
    static float images[2][SIDE * SIDE];
    const double place[2] = {63.2, 64.45}, sun[3] = {0.0, 0.0, 1.0};
    double sum[2] = {0.0}, ends[2] = {0.0};
    bst_quat q = bst_quat_from_rotvec((bst_vec3){BST_PI, 0.0, 0.0});
    scene s;
    make_scene(&s, &camera, beam, q, place, sun, 1e4);
    for (int n = 0; n < 2; n++) { /* at rest, turning by 2 rad */
        bst_render_stats stats;
        s.body.times = n == 0 ? 1 : TIMES;
        for (int k = 0; k < s.body.times; k++) {
            bst_vec3 turn = {0.0, 0.0, n == 0 ? 0.0 : 0.4 + 2.0 * k / (TIMES - 1)};
            s.body.q_body_from_gcrf[k] = bst_quat_conj(bst_quat_mul(bst_quat_from_rotvec(turn), q));
        }
        draw(f, &camera, &s.source, images[n], &stats);
        for (int i = 0; i < SIDE * SIDE; i++) {
            double x = i % SIDE - place[0], y = (double)(i / SIDE) - place[1];
            sum[n] += (double)images[n][i];
            ends[n] += hypot(x, y) > 0.85 * 1.7 * PX_PER_M ? (double)images[n][i] : 0.0;
        }
    }
    /* solid angles differ by the cosine of the angle from the axis, 0.1 degrees */
    bst_assert_close(sum[1], sum[0], 1e-3 * sum[0]);
    assert_true(ends[0] > 0.1 * sum[0]);
    bst_assert_close(ends[1], ends[0], 2e-3 * sum[0]); /* pixels on the circle */
    bst_test_model_close(&s.model);
}

/* A camera that rolls by 0.14 rad and back: the beam at the turning point, where the last pose that
 * is like the first one is far off in the path. */
static void test_camera_that_swings(void **state) {
    enum { SAMPLES = 101 };
    fixture *f = *state;
    bst_camera camera = small_camera();
    static const char beam[] =
        MATERIAL "\"kind\": \"plate\", \"size_m\": [5.0, 0.3, 0], \"material\": \"m\"}]}";
    static float images[2][SIDE * SIDE];
    const double place[2] = {63.5, 63.5}, sun[3] = {0.0, 0.0, 1.0};
    double sum[2] = {0.0}, time_s[SAMPLES];
    bst_quat attitudes[SAMPLES];
    scene s;
    make_scene(&s, &camera, beam, bst_quat_from_rotvec((bst_vec3){BST_PI, 0.0, 0.0}), place, sun,
               1e4);
    for (int n = 0; n < 2; n++) { /* at rest, swinging */
        bst_render_stats stats;
        for (int k = 0; k < SAMPLES; k++) {
            double u = (double)k / (SAMPLES - 1), swing = n * 0.07 * (1.0 - cos(2.0 * BST_PI * u));
            time_s[k] = u;
            attitudes[k] = bst_quat_from_rotvec((bst_vec3){0.0, 0.0, swing});
        }
        const bst_los_track track = {SAMPLES, time_s, attitudes};
        draw_along(f, &camera, &track, &s.source, images[n], &stats);
        for (int i = 0; i < SIDE * SIDE; i++) {
            sum[n] += (double)images[n][i];
        }
    }
    bst_assert_close(sum[1], sum[0], 1e-3 * sum[0]); /* as of the turning beam */
    bst_test_model_close(&s.model);
}

/* A plate covers a star from mid-exposure on: its trail is that of the first half. */
static void test_star_behind_a_plate(void **state) {
    fixture *f = *state;
    bst_camera camera = small_camera();
    const scene_motion slew = {.x_px = 40.0, .y_px = 7.0, .duration_s = 1.0, .samples = 11};
    scene_track track = scene_track_make(&camera, &slew);
    bst_los_track half = track.track;
    half.count = 6;
    bst_star_occultation work = {0};
    bst_render_stats stats;
    static float images[2][SIDE * SIDE];
    for (int n = 0; n < 2; n++) {
        scene s;
        const double place[2] = {63.5, 63.5}, sun[3] = {0.0, 0.0, 1.0};
        make_scene(&s, &camera, plate, (bst_quat){0, 0, 0, 1}, place, sun, 1e3);
        bst_vec3 from = {-2.2, 0.0, RANGE_M}, to = {0.0, 0.0, RANGE_M};
        bst_scene_source_path path =
            bst_scene_source_path_through(from, bst_vec3_scale(bst_vec3_add(from, to), 0.5), to);
        s.source.path = &path;
        bst_scene_source sources[] = {{.kind = BST_SOURCE_STAR,
                                       .apparent_mid = {0, 0, 1},
                                       .electrons_per_s = n == 0 ? 1e5 : 1e7,
                                       .range_m = INFINITY},
                                      s.source};
        bst_scene_source plain = sources[0];
        bst_assert_ok(&f->ctx, bst_star_occultation_apply(&f->ctx, &work, sources, 2));
        bst_assert_close(sources[0].electrons_per_s, 0.5 * plain.electrons_per_s, 20.0);
        draw_along(f, &camera, &track.track, &sources[0], images[0], &stats);
        draw_along(f, &camera, &half, &plain, images[1], &stats);
        double worst = 0.0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            double error = (double)images[0][i] - (double)images[1][i];
            worst = fmax(worst, fabs(error) / sqrt((double)images[1][i] + 25.0));
        }
        assert_true(worst < 0.1); /* twice the tolerance of a frame */
        bst_test_model_close(&s.model);
    }
    bst_star_occultation_free(&work);
    scene_track_free(&track);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hand_over),          cmocka_unit_test(test_boxes),
        cmocka_unit_test(test_camera_that_swings), cmocka_unit_test(test_turning_beam),
        cmocka_unit_test(test_joint_at_a_burn),    cmocka_unit_test(test_star_behind_a_plate),
        cmocka_unit_test(test_sphere_and_cylinder)};
    return cmocka_run_group_tests(tests, open_device, close_device);
}
