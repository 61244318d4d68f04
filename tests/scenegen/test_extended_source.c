/* Targets that are larger than a point: discs of all sizes, and light that changes during an
 * exposure. */
#include "scenegen/smear/extended_source.h"

#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/world/scene/brightness.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
    bst_renderer *renderer; /* of scene_camera(SIDE, SIDE) */
} fixture;

enum { SIDE = 64 };

static int open_device(void **state) {
    static fixture f;
    *state = &f;
    bst_camera camera = scene_camera(SIDE, SIDE);
    return bst_device_open(&f.ctx, "", 0, &f.device) == BST_OK &&
                   bst_renderer_create(&f.ctx, f.device, &camera, NULL, &f.renderer) == BST_OK
               ? 0
               : -1;
}

static int close_device(void **state) {
    bst_renderer_free(((fixture *)*state)->renderer);
    bst_device_close(((fixture *)*state)->device);
    return 0;
}

/* A sphere of radius_px whose middle is off the sensor's by (x, y) px, lit at a phase angle from
 * the image's direction `turn`. */
static bst_scene_source_shape shape_of(const bst_camera *camera, bst_vec3 middle, double radius_px,
                                       double phase_rad, double turn_rad) {
    double a = bst_camera_scale_rad(camera);
    bst_vec3 z = bst_vec3_scale(middle, -1.0);
    bst_vec3 x = bst_vec3_unit(
        bst_vec3_axpy((bst_vec3){cos(turn_rad), sin(turn_rad), 0.0},
                      -bst_vec3_dot((bst_vec3){cos(turn_rad), sin(turn_rad), 0.0}, z), z));
    return (bst_scene_source_shape){
        .radius = sin(atan(radius_px * a)),
        .sun = bst_vec3_axpy(bst_vec3_scale(z, cos(phase_rad)), sin(phase_rad), x),
        .earth = z,
        .diffuse = 1.0};
}

static bst_scene_source source_at(const bst_camera *camera, double x, double y, double electrons,
                                  const bst_scene_source_shape *shape) {
    return (bst_scene_source){
        .kind = BST_SOURCE_OBJECT,
        .apparent_mid = bst_camera_unproject(camera, bst_camera_centre_x(camera) + x,
                                             bst_camera_centre_y(camera) + y),
        .electrons_per_s = electrons,
        .shape = shape};
}

typedef struct images {
    float *fast;
    double *reference;
    double sum, sum_x, sum_y; /* of the fast one */
} images;

static images render(fixture *f, const bst_camera *camera, const scene_motion *motion,
                     const bst_scene_source *source, bool with_reference) {
    bst_renderer *r = f->renderer;
    size_t pixels = (size_t)camera->width_px * (size_t)camera->height_px;
    scene_track track = scene_track_make(camera, motion);
    images m = {malloc(pixels * sizeof *m.fast), calloc(pixels, sizeof *m.reference), 0, 0, 0};
    if (camera->pixel_scale_arcsec != 3.0 || camera->optics.psf != BST_PSF_GAUSSIAN) {
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, NULL, &r));
    }
    bst_render_request q = {.window = {0, 0, (int)camera->width_px, (int)camera->height_px},
                            .track = &track.track,
                            .sources = source,
                            .count = 1};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, m.fast));
    if (with_reference) {
        bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, camera, q.window, &track.track, source,
                                                    1, 1e-7, m.reference));
    }
    for (size_t i = 0; i < pixels; i++) {
        double v = (double)m.fast[i];
        m.sum += v;
        m.sum_x += v * (double)(i % (size_t)camera->width_px);
        m.sum_y += v * (double)(i / (size_t)camera->width_px);
    }
    if (r != f->renderer) {
        bst_renderer_free(r);
    }
    scene_track_free(&track);
    return m;
}

static void release(images *m) {
    free(m->fast);
    free(m->reference);
}

static double worst_sigma(const bst_camera *camera, const images *m) {
    double worst = 0.0, variance = camera->read_noise_e * camera->read_noise_e;
    for (long long i = 0; i < camera->width_px * camera->height_px; i++) {
        worst = fmax(worst,
                     fabs((double)m->fast[i] - m->reference[i]) / sqrt(m->reference[i] + variance));
    }
    return worst;
}

static const scene_motion still = {.duration_s = 1.0, .samples = 2};

/* Of a Lambert sphere of unit radius at phase phi the light's middle lies towards the Sun by the
 * integral of mu mu0 x over that of mu mu0; longitudes l from phi - pi/2 to pi/2 and latitudes b:
 * (3 pi / 16) * int cos l cos(l - phi) sin l dl / int cos l cos(l - phi) dl * (4/3) / (4/3) ...
 * with the latitudes' integrals of cos^4 = 3 pi / 8 over cos^3 = 4/3, 9 pi / 32. Above,
 * (1 - sin^3 or so) is left to numbers: midpoints in l. */
static double lambert_middle(double phi) {
    double up = 0.0, down = 0.0;
    for (int i = 0; i < 20000; i++) {
        double l = phi - 0.5 * BST_PI + (BST_PI - phi) * (i + 0.5) / 20000;
        up += cos(l) * cos(l - phi) * sin(l);
        down += cos(l) * cos(l - phi);
    }
    return 9.0 * BST_PI / 32.0 * up / down;
}

/* All light is there and its middle is where it belongs, for discs from a tenth of a pixel to half
 * the frame, at all phases and places between pixels. the flux is right to 1e-4. */
static void light_and_its_middle(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    const double radii[] = {0.1, 0.5, 2.0, 11.9, 12.1, 22.0};
    const double phases[] = {0.0, 40.0, 90.0, 150.0, 175.0};
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 5; k++) {
            double dx = 0.37 * i - 0.8, dy = 0.21 * k, turn = 0.7 + k;
            double phase = phases[k] * BST_DEG_RAD;
            bst_scene_source s = source_at(&camera, dx, dy, 1e6, NULL);
            bst_scene_source_shape shape = shape_of(&camera, s.apparent_mid, radii[i], phase, turn);
            s.shape = &shape;
            images m = render(f, &camera, &still, &s, false);
            double way = radii[i] * lambert_middle(phase);
            bst_assert_close(m.sum, 1e6, 1e-4 * 1e6);
            /* nearness: a radius of 1.5e-5 of the distance a px, in a crescent 0.09 wide */
            double centre = 0.5 * (SIDE - 1), slack = 1e-3 + 2.5e-5 * radii[i] * radii[i];
            bst_assert_close(m.sum_x / m.sum, centre + dx + way * cos(turn), slack);
            bst_assert_close(m.sum_y / m.sum, centre + dy + way * sin(turn), slack);
            release(&m);
        }
    }
}

/* Against the reference (quadrature of panels half as wide, in double), in sigma of the pixel with
 * 200 e in the brightest pixels of the largest. */
static void discs_agree_with_the_reference(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    const double radii[] = {0.3, 1.5, 6.0, 13.0};
    for (int i = 0; i < 4; i++) {
        for (int k = radii[i] > 10.0 ? 2 : 0; k < 3; k++) {
            bst_scene_source s = source_at(&camera, 0.3, -0.45, 3e5, NULL);
            bst_scene_source_shape shape =
                shape_of(&camera, s.apparent_mid, radii[i], 50.0 * k * BST_DEG_RAD, 0.4 + k);
            shape.diffuse = 0.8;
            shape.specular = 0.1;
            shape.thermal = 0.1;
            s.shape = &shape;
            images m = render(f, &camera, &still, &s, true);
            double worst = worst_sigma(&camera, &m);
            bst_assert_close(worst, 0, 0.05); /* the project's accuracy */
            release(&m);
        }
    }
}

/* Smeared over 9 px by the camera's turn. */
static void moving_discs(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    const scene_motion motion = {.x_px = 8.0, .y_px = 4.0, .duration_s = 1.0, .samples = 3};
    const double radii[] = {1.0, 4.0, 13.0};
    for (int i = 0; i < 3; i++) {
        bst_scene_source s = source_at(&camera, 0.0, 0.0, 3e5, NULL);
        bst_scene_source_shape shape = shape_of(&camera, s.apparent_mid, radii[i], 1.2, 2.0);
        s.shape = &shape;
        images m = render(f, &camera, &motion, &s, true);
        double worst = worst_sigma(&camera, &m);
        bst_assert_close(worst, 0, 0.05); /* the project's accuracy */
        bst_assert_close(m.sum, 3e5, 30);
        release(&m);
    }
}

/* A disc of 45,000 px, that of a 4 m2 sphere at 10 m and 0.5 arcsec/px, with its limb across the
 * sensor: where it covers pixels they have its radiance times their solid angle, and across the
 * limb the light falls as the integral of the PSF does. */
static void a_disc_larger_than_the_frame(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    camera.pixel_scale_arcsec = 0.5;
    double radius = 45000.0, a = bst_camera_scale_rad(&camera);
    bst_scene_source s = source_at(&camera, -radius + 0.3, 0.0, 1e13, NULL);
    bst_scene_source_shape shape = shape_of(&camera, s.apparent_mid, radius, 0.0, 0.0);
    /* the place of the limb: the angle from the middle is that of the sphere */
    double limb_rad = asin(shape.radius);
    double middle_rad = acos(-shape.sun.z);
    double limb_px = bst_camera_centre_x(&camera) + tan(limb_rad - middle_rad) / a;
    shape.diffuse = 0.0;
    shape.thermal = 1.0;
    s.shape = &shape;
    images m = render(f, &camera, &still, &s, false);
    double per_px = 1e13 * a * a / (2.0 * BST_PI * (1.0 - cos(limb_rad)));
    double sigma = sqrt(pow(bst_camera_psf_sigma_px(&camera), 2));
    double worst = 0.0;
    for (int x = 0; x < SIDE; x++) {
        for (int y = 24; y < 40; y++) {
            /* pixel average of the PSF's integral by Simpson; the limb's curve moves it */
            double bow = (y - 31.5) * (y - 31.5) / (2.0 * radius), mean = 0.0;
            for (int n = 0; n <= 20; n++) {
                double w = n == 0 || n == 20 ? 1 : n % 2 ? 4 : 2;
                double at = x - 0.5 + n / 20.0 - (limb_px - bow);
                mean += w / 60.0 * 0.5 * erfc(at / (sigma * sqrt(2.0)));
            }
            double error = fabs((double)m.fast[y * SIDE + x] - per_px * mean) / per_px;
            worst = fmax(worst, error);
        }
    }
    bst_assert_close(worst, 0, 2e-3); /* two points a pixel across the limb */
    bst_assert_close((double)m.fast[31 * SIDE + 10] / per_px, 1.0,
                     1e-4); /* what stamps leave out */
    release(&m);
}

/* Light that falls from all to nothing while the image moves: the mean of what is left lies before
 * the middle. Rate 1 - u: the mean of u is 1/3. */
static void fading_while_it_moves(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    const scene_motion motion = {.x_px = 30.0, .duration_s = 1.0, .samples = 2};
    bst_scene_source_rate rate = {.count = 2, .u = {0, 1}, .rate = {2, 0}, .light = {0, 1}};
    bst_scene_source s = source_at(&camera, 0.0, 0.0, 1e5, NULL);
    s.rate = &rate;
    images m = render(f, &camera, &motion, &s, true);
    bst_assert_close(m.sum, 1e5, 1);
    /* 512 stretches of uniform light */
    bst_assert_close(m.sum_x / m.sum, 0.5 * (SIDE - 1) + 30.0 * (1.0 / 3 - 0.5), 2e-3);
    double worst = worst_sigma(&camera, &m);
    bst_assert_close(worst, 0, 0.05); /* the project's accuracy */
    release(&m);
}

/* A shadow's edge half way through: the streak ends there. */
static void switched_off_half_way(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    const scene_motion motion = {.x_px = 30.0, .duration_s = 1.0, .samples = 2};
    bst_scene_source_rate rate = {
        .count = 4, .u = {0, 0.499, 0.501, 1}, .rate = {2, 2, 0, 0}, .light = {0, 0.998, 1, 1}};
    bst_scene_source s = source_at(&camera, 0.0, 0.0, 1e5, NULL);
    s.rate = &rate;
    images m = render(f, &camera, &motion, &s, true);
    double worst = worst_sigma(&camera, &m);
    bst_assert_close(worst, 0, 0.05);                         /* the project's accuracy */
    bst_assert_close((double)m.fast[31 * SIDE + 48], 0, 0.2); /* the far half is dark */
    assert_true(m.fast[31 * SIDE + 20] > 100.0f);
    release(&m);
}

/* The same through a PSF that is not Gaussian: a disc, and light that fades on its way. */
static void another_psf(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(SIDE, SIDE);
    camera.optics.psf = BST_PSF_MOFFAT;
    camera.optics.moffat_beta = 4.0;
    camera.psf_fwhm_px = 2.5;
    bst_scene_source s = source_at(&camera, 0.2, 0.1, 3e5, NULL);
    bst_scene_source_shape shape = shape_of(&camera, s.apparent_mid, 3.0, 1.0, 2.0);
    s.shape = &shape;
    images m = render(f, &camera, &still, &s, true);
    bst_assert_close(worst_sigma(&camera, &m), 0, 0.05); /* the project's accuracy */
    release(&m);
    const scene_motion motion = {.x_px = 20.0, .duration_s = 1.0, .samples = 2};
    bst_scene_source_rate rate = {.count = 2, .u = {0, 1}, .rate = {2, 0}, .light = {0, 1}};
    s.shape = NULL;
    s.rate = &rate;
    m = render(f, &camera, &motion, &s, true);
    bst_assert_close(worst_sigma(&camera, &m), 0, 0.05);
    release(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_and_its_middle),  cmocka_unit_test(discs_agree_with_the_reference),
        cmocka_unit_test(moving_discs),          cmocka_unit_test(a_disc_larger_than_the_frame),
        cmocka_unit_test(fading_while_it_moves), cmocka_unit_test(switched_off_half_way),
        cmocka_unit_test(another_psf),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
