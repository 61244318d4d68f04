/* The sky background beside the Earth's limb: polynomials in cells against every pixel's own value,
 * and windows against the whole sensor. */
#include "tests/world/skylight_scene.h"

/* A scene near the limb: a camera of SIDE px beside the Earth of the x-axis's Sun. */
typedef struct limb_scene {
    double altitude_m;
    double off_deg; /* of the sensor's middle outside of the limb */
    double scale;   /* arcsec */
    double sun_deg; /* of the Sun from the observer's zenith, in the plane of the line of sight */
    double slew_px[2]; /* in the exposure, along and across the limb */
    double throughput; /* of the camera */
    bool has_no_map;   /* the light is beyond the sensor: nodes are enough */
} limb_scene;

enum { SIDE = 384 };

static bst_world *world_of(const limb_scene *s) {
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": "
             "\"neossat\", " TEST_NEOSSAT
             ", \"sensors\": [{\"camera\": {\"pixel_scale_arcsec\": %g, \"aperture_m\": 0.15, "
             "\"throughput\": %g, \"width_px\": %d, \"height_px\": %d, \"background_mag_arcsec2\": "
             "22, \"background\": {}}}]}]}",
             s->scale, s->throughput, SIDE, SIDE);
    return test_world(text);
}

static bst_scene_surroundings surroundings_of(const limb_scene *s) {
    const double radius = BST_EARTH_RADIUS_M + s->altitude_m;
    bst_scene_surroundings around = look_down((bst_vec3){radius, 0, 0}, 0);
    const double to = asin(BST_EARTH_RADIUS_M / radius) + s->off_deg * BST_DEG_RAD;
    const double scale = s->scale * BST_ARCSEC_RAD, sun = s->sun_deg * BST_DEG_RAD;
    around.bodies.sun_m = (bst_vec3){BST_AU_M * cos(sun), BST_AU_M * sin(sun), 0};
    around.light.sun_m = bst_vec3_sub(around.bodies.sun_m, around.eye_m);
    around.exposure_s = 0.1;
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        const double u = ((double)k / BST_DISC_PARTS - 0.5) * scale;
        const bst_quat turn =
            bst_quat_from_rotvec((bst_vec3){s->slew_px[0] * u, -to + s->slew_px[1] * u, 0});
        around.q[k] = bst_quat_mul(turn, around.q[k]);
    }
    return around;
}

/* Low orbits with the limb in the field, and 1 and 5 degrees outside of it, by day and night; in
 * slews, at the terminator, in fine and coarse pixels, and from a geostationary orbit. */
static const limb_scene scenes[] = {
    {785e3, 0, 5, 60, {0, 0}, 0.7, false},
    {785e3, 0, 5, -160, {0, 0}, 0.7, false},
    {785e3, -0.3, 5, 60, {0, 0}, 0.7, false},
    {785e3, 0.3, 5, 60, {0, 0}, 0.7, false},
    {785e3, 0.3, 5, -160, {0, 0}, 0.7, false},
    {785e3, 1, 5, 60, {0, 0}, 0.7, false},
    {785e3, 1, 5, -160, {0, 0}, 0.7, false},
    {785e3, 5, 5, 60, {0, 0}, 0.7, true},
    {785e3, 5, 5, -160, {0, 0}, 0.7, true},
    {785e3, 0.2, 5, -117, {0, 0}, 0.7, false},
    {785e3, 0, 5, -117, {0, 0}, 1e-5, false},
    {785e3, 0, 5, 60, {0, 0}, 1e-6, false},
    {785e3, 0.1, 5, 60, {30, 200}, 0.7, false},
    {785e3, 0.1, 5, 60, {600, 30}, 1e-4, false},
    {785e3, 1, 1, 60, {0, 0}, 0.7, false},
    {785e3, 1, 30, 60, {0, 0}, 0.7, false},
    {500e3, 0.5, 8, 100, {0, 3}, 0.7, false},
    {3.5786e7, 0.02, 5, 60, {0, 0}, 0.7, false},
    /* edges about as dim as the bound */
    {785e3, 0, 5, 60, {0, 0}, 1e-9, false},
    {785e3, 0.02, 5, 60, {0, 0}, 3e-10, false},
    {785e3, 0, 5, 60, {3, 8}, 1e-10, false},
};
enum { SCENES = sizeof scenes / sizeof *scenes };

/* Largest difference of a map from every pixel's own value: in standard deviations of the photon
 * noise (of 1 e- at least) where the light is below 1e6 e-, and as its share elsewhere. */
typedef struct worst {
    double sigma, share;
} worst;

static worst worst_of(const bst_camera *camera, const bst_scene_surroundings *around,
                      const bst_skylight_map *map) {
    bst_discs discs;
    bst_discs_make(camera, around, &discs);
    const double scale = bst_camera_scale_rad(camera), sky = bst_camera_background_e_per_s(camera);
    const double sun = bst_camera_electrons_per_s(camera, 0) * scale * scale;
    worst w = {0, 0};
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE;
        const bst_disc_light l = bst_discs_light(&discs, bst_camera_unproject(camera, x, y));
        const double e = (sky * (1 - l.earth) + sun * l.sunlight) * around->exposure_s;
        const double error = fabs(bst_skylight_at(map, x, y) - e);
        if (e < 1e6) {
            w.sigma = fmax(w.sigma, error / sqrt(fmax(e, 1.0)));
        } else {
            w.share = fmax(w.share, error / e);
        }
    }
    return w;
}

/* Polynomials are as near to the pixels' own values as documented: 1e-3 sigma, or 1e-6 of the
 * light. */
static void cells_are_within_their_bound(void **state) {
    (void)state;
    for (int c = 0; c < SCENES; c++) {
        bst_world *world = world_of(&scenes[c]);
        const bst_scene_surroundings around = surroundings_of(&scenes[c]);
        bst_skylight *s;
        const bst_skylight_map *map = make(world, &around, (bst_window){0, 0, SIDE, SIDE}, &s);
        const worst w = worst_of(bst_world_camera(world, 0, 0), &around, map);
        assert_int_equal(map->step_px > 1, scenes[c].has_no_map);
        print_message("scene %d: %.2g sigma, %.2g of the light\n", c, w.sigma, w.share);
        if (!(w.sigma <= 1e-3) || !(w.share <= 1e-6)) {
            fail_msg("scene %d: %g sigma, %g of the light", c, w.sigma, w.share);
        }
        bst_skylight_free(s);
        bst_world_free(world);
    }
}

/* A window has the bits of the same pixels of the whole sensor, wherever the limb is. */
static void windows_have_the_bits_of_the_whole(void **state) {
    (void)state;
    static const bst_window windows[] = {{0, 0, 1, 1},     {200, 100, 1, 1},  {31, 63, 2, 3},
                                         {383, 383, 1, 1}, {5, 0, 70, 384},   {0, 300, 384, 9},
                                         {90, 95, 64, 64}, {250, 17, 40, 111}};
    for (int c = 0; c < SCENES; c++) {
        bst_world *world = world_of(&scenes[c]);
        const bst_scene_surroundings around = surroundings_of(&scenes[c]);
        bst_skylight *a, *b;
        const bst_skylight_map *whole = make(world, &around, (bst_window){0, 0, SIDE, SIDE}, &a);
        for (size_t k = 0; k < sizeof windows / sizeof *windows; k++) {
            const bst_window w = windows[k];
            const bst_skylight_map *part = make(world, &around, w, &b);
            assert_int_equal(part->step_px, whole->step_px);
            for (int y = w.y0; y < w.y0 + w.height; y++) {
                for (int x = w.x0; x < w.x0 + w.width; x++) {
                    if (bst_skylight_at(part, x, y) != bst_skylight_at(whole, x, y)) {
                        fail_msg("scene %d, window %zu: (%d, %d)", c, k, x, y);
                    }
                }
            }
            bst_skylight_free(b);
        }
        bst_skylight_free(a);
        bst_world_free(world);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_are_within_their_bound),
        cmocka_unit_test(windows_have_the_bits_of_the_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
