/* Bodies in the sky of a camera: shares of the window that they cover, and light from a part of the
 * Earth. */
#include "sim/world/scene/skylight.h"
#include "sim/world/scene/stray.h"
#include "tests/world/skylight_scene.h"

/* A camera that looks along -x, columns along y, from `eye`. */
static bst_camera test_camera(double scale_arcsec) {
    return (bst_camera){.width_px = 256,
                        .height_px = 256,
                        .pixel_scale_arcsec = scale_arcsec,
                        .psf_fwhm_px = 2,
                        .background = {.model = BST_BACKGROUND_SKY,
                                       .earth = true,
                                       .moon = true,
                                       .sun = true,
                                       .earth_albedo = 0.3}};
}

/* The Moon and the Sun cover a circle's share of the window that they are in, and none of another;
 * where many places of a coarse lattice are in the circle, to a part of its border. */
static void round_bodies_cover_their_share(void **state) {
    (void)state;
    static const double scales[] = {200, 20};
    const bst_vec3 eye = {4.2164e7, 0, 0};
    for (int k = 0; k < 4; k++) {
        const bool moon = k % 2 == 0;
        bst_camera camera = test_camera(scales[k / 2]);
        bst_scene_surroundings around = look_down(eye, 1);
        const bst_vec3 towards = {-cos(1), sin(1), 0}, away = {cos(1), -sin(1), 0};
        const double radius = moon ? 1737.4e3 / 3.844e8 : 6.957e8 / BST_AU_M;
        around.bodies.moon_m = bst_vec3_axpy(eye, 3.844e8, moon ? towards : away);
        around.bodies.sun_m = bst_vec3_axpy(eye, BST_AU_M, moon ? away : towards);
        around.light.sun_m = bst_vec3_sub(around.bodies.sun_m, eye);
        bst_discs discs;
        bst_discs_make(&camera, &around, &discs);
        const double px = radius / bst_camera_scale_rad(&camera);
        const bst_window windows[] = {{0, 0, 251, 243}, {70, 61, 110, 150}, {0, 0, 40, 256}};
        for (int w = 0; w < 3; w++) {
            const double area = windows[w].width * windows[w].height;
            const double share =
                bst_discs_share(&discs, &camera, moon ? BST_BODY_MOON : BST_BODY_SUN, windows[w]);
            /* a coarse lattice: half a step along part of its border */
            const double step = fmax(windows[w].width, windows[w].height) / 32.0;
            const double tolerance = k < 2 ? 2e-3 * px * px : 0.5 * px * step;
            bst_assert_close(share * area, w < 2 ? BST_PI * px * px : 0.0, tolerance);
            assert_true(bst_discs_share(&discs, &camera, moon ? BST_BODY_SUN : BST_BODY_MOON,
                                        windows[w]) == 0.0);
        }
    }
}

/* Earthlight from one side of a low orbit, in a baffle that falls off by a decade in 20 degrees:
 * against the sum over the sphere's surface by latitude and longitude. */
static void earthlight_comes_from_where_it_is_lit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_optics_pst_point points[] = {{0, 1e-1}, {180, 1e-10}};
    const bst_background_config decade = {.pst = {points, 2}, .pixel_pitch_um = 10};
    bst_scene_pst *steep;
    bst_assert_ok(&ctx, bst_scene_pst_create(&ctx, &decade, 0, "", &steep));
    const bst_background_config earth = {.earth = true, .earth_albedo = 0.3};
    const bst_vec3 eye = bst_vec3_scale(bst_vec3_unit((bst_vec3){3, -2, 1}), 8.2e6);
    const bst_vec3 sun_unit = bst_vec3_unit((bst_vec3){2, 3, -1});
    const bst_bodies bodies = {.sun_m = bst_vec3_scale(sun_unit, BST_AU_M)};
    const bst_vec3 nadir = bst_vec3_unit(bst_vec3_scale(eye, -1)),
                   side = bst_vec3_unit(bst_vec3_perpendicular(nadir)),
                   other = bst_vec3_cross(nadir, side);
    for (int k = 0; k < 6; k++) {
        const double phi = k * BST_PI / 3, tilt = 1.3;
        const bst_vec3 look =
            bst_vec3_axpy(bst_vec3_scale(nadir, cos(tilt)), sin(tilt),
                          bst_vec3_axpy(bst_vec3_scale(side, cos(phi)), sin(phi), other));
        double sum = 0.0;
        enum { LATITUDES = 200, LONGITUDES = 400 };
        for (int i = 0; i < LATITUDES * LONGITUDES; i++) {
            const double z = -1 + 2 * (i / LONGITUDES + 0.5) / LATITUDES, r = sqrt(1 - z * z),
                         l = 2 * BST_PI * (i % LONGITUDES + 0.5) / LONGITUDES;
            const bst_vec3 n = {r * cos(l), r * sin(l), z};
            const bst_vec3 way = bst_vec3_axpy(bst_vec3_scale(eye, -1), BST_EARTH_RADIUS_M, n);
            const double far = bst_vec3_norm(way), lit = bst_vec3_dot(n, sun_unit),
                         seen = -bst_vec3_dot(n, way) / far;
            if (lit > 0 && seen > 0) {
                sum += lit * seen / (far * far) *
                       pow(10, -1 - bst_vec3_angle(way, look) / BST_DEG_RAD / 20);
            }
        }
        const double area =
            4 * BST_PI * BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M / (LATITUDES * LONGITUDES);
        const double expected = 0.3 / BST_PI * FULL_SUN * sum * area;
        /* 16 x 32 cells, one of which spans a fifth of a decade */
        bst_assert_close(bst_stray_irradiance(steep, &earth, eye, &bodies, look), expected,
                         0.03 * expected);
    }
    bst_scene_pst_free(steep);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(round_bodies_cover_their_share),
        cmocka_unit_test(earthlight_comes_from_where_it_is_lit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
