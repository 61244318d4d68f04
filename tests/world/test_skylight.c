/* Background of the sky against published numbers and closed forms. */
#include "sim/world/scene/skylight.h"

#include "sim/world/scene/stray.h"
#include "sim/world/scene/zodiacal.h"
#include "tests/world/skylight_scene.h"

static bst_scene_pst *make_pst(const bst_optics_pst_point *points, int count) {
    bst_ctx ctx = {0};
    bst_background_config c = {.pst = {(void *)points, count}, .pixel_pitch_um = 10};
    bst_scene_pst *pst;
    bst_assert_ok(&ctx, bst_scene_pst_create(&ctx, &c, 0, "", &pst));
    return pst;
}

static void transmittance_is_log_linear(void **state) {
    (void)state;
    bst_scene_pst *pst = make_pst((bst_optics_pst_point[]){{20, 1e-3}, {40, 1e-5}, {60, 0}}, 3);
    bst_assert_close(bst_scene_pst_at(pst, 30 * BST_DEG_RAD), 1e-4, 1e-15); /* geometric mean */
    bst_assert_close(bst_scene_pst_at(pst, 50 * BST_DEG_RAD), 5e-6, 1e-17); /* next to a zero */
    bst_assert_close(bst_scene_pst_at(pst, 0), 1e-3, 0);
    bst_assert_close(bst_scene_pst_at(pst, 3), 0, 0);
    bst_scene_pst_free(pst);
    bst_ctx ctx = {0};
    bst_optics_pst_point wrong[] = {{20, 1e-3}, {20, 1e-5}};
    bst_background_config c = {.pst = {wrong, 2}, .pixel_pitch_um = 10};
    assert_int_equal(bst_scene_pst_create(&ctx, &c, 0, "", &pst), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "pst/1/angle_deg"));
    c.pst.count = 1;
    c.pixel_pitch_um = 0;
    assert_int_equal(bst_scene_pst_create(&ctx, &c, 0, "", &pst), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "pixel_pitch_um"));
}

static void stray_light_by_hand(void **state) {
    (void)state;
    bst_scene_pst *flat = make_pst((bst_optics_pst_point[]){{0, 1}}, 1);
    bst_vec3 x = {1, 0, 0};
    bst_bodies bodies = {.sun_m = {1.25 * BST_AU_M, 0, 0}, .moon_m = {0, 3.844e8, 0}};
    bst_background_config sun = {.sun = true}, moon = {.moon = true},
                          earth = {.earth = true, .earth_albedo = 0.3};
    bst_vec3 day = {4e7, 0, 0}, night = {-4e7, 0, 0};
    double au = (1.25 * BST_AU_M - 4e7) / BST_AU_M;
    bst_assert_close(bst_stray_irradiance(flat, &sun, day, &bodies, x), FULL_SUN / (au * au),
                     1e-9 * FULL_SUN);
    /* inside the Earth's shadow */
    assert_true(bst_stray_irradiance(flat, &sun, night, &bodies, x) == 0);
    /* a quarter Moon, seen from the Earth's centre's distance; hidden behind the Earth */
    double v = bst_scene_moon_v_mag(bst_vec3_sub(bodies.moon_m, day),
                                    bst_vec3_sub(bodies.sun_m, bodies.moon_m));
    bst_assert_close(bst_stray_irradiance(flat, &moon, day, &bodies, x), pow(10, -0.4 * v),
                     1e-6 * pow(10, -0.4 * v));
    assert_true(bst_stray_irradiance(flat, &moon, (bst_vec3){0, -7e6, 0}, &bodies, x) == 0);
    /* from afar the Earth is a Lambertian sphere: 2/3 albedo (R / r)^2 at full phase, 1/pi of that
     * at half; the midpoint rule's 512 cells are good to 1 % */
    for (int half = 0; half < 2; half++) {
        bst_vec3 eye = half ? (bst_vec3){0, 0, 1e9} : (bst_vec3){1e9, 0, 0};
        double ratio = BST_EARTH_RADIUS_M / 1e9;
        double expected = FULL_SUN / 1.5625 * 0.2 * ratio * ratio * (half ? 1 / BST_PI : 1);
        bst_assert_close(bst_stray_irradiance(flat, &earth, eye, &bodies, x), expected,
                         0.01 * expected);
    }
    /* the night side sends nothing; the Sun's place decides, not the Earth's */
    assert_true(bst_stray_irradiance(flat, &earth, (bst_vec3){-1e9, 0, 0}, &bodies, x) <
                1e-6 * FULL_SUN * 1e-5);
    bst_scene_pst_free(flat);
    bst_scene_pst *steep = make_pst((bst_optics_pst_point[]){{30, 1e-2}, {90, 1e-8}}, 2);
    double near = bst_stray_irradiance(steep, &sun, day, &bodies, bst_vec3_from_radec(0.6, 0));
    double far = bst_stray_irradiance(steep, &sun, day, &bodies, bst_vec3_from_radec(1.2, 0));
    /* 0.6 rad further out: 34.377 degrees of 0.1 decade each */
    bst_assert_close(log10(near / far), 0.1 * 0.6 / BST_DEG_RAD, 1e-9);
    bst_scene_pst_free(steep);
}

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

/* From (r, 0) the tangent to the ellipse x^2 / a^2 + z^2 / b^2 = 1 has the slope b / sqrt(r^2 -
 * a^2); in the equator's plane the limb is at asin(a / r). */
static void the_limb_is_where_geometry_has_it(void **state) {
    (void)state;
    static const double radii[] = {6.7e6, 7.2e6, 4.2164e7, 3.8e8};
    bst_camera camera = test_camera(3);
    for (int i = 0; i < 4; i++) {
        double r = radii[i], a = BST_EARTH_RADIUS_M, b = a * (1 - BST_EARTH_FLATTENING);
        double angle[2] = {asin(a / r), atan(b / sqrt(r * r - a * a))};
        for (int polar = 0; polar < 2; polar++) {
            bst_scene_surroundings around = look_down((bst_vec3){r, 0, 0}, 0);
            around.exposure_s = 1e-3; /* the observer falls by less than a micrometre */
            /* turned so that the boresight is 20 px inside of the limb */
            double scale = bst_camera_scale_rad(&camera), to = angle[polar] - 20 * scale;
            bst_quat turn =
                bst_quat_from_rotvec(polar ? (bst_vec3){to, 0, 0} : (bst_vec3){0, -to, 0});
            for (int k = 0; k <= BST_DISC_PARTS; k++) {
                around.q[k] = bst_quat_mul(turn, around.q[k]);
            }
            bst_discs discs;
            bst_discs_make(&camera, &around, &discs);
            assert_true(discs.body[BST_BODY_EARTH].present);
            /* the side on which the limb is */
            double found = NAN;
            for (int sign = -1; sign <= 1; sign += 2) {
                double low = 0, high = 200;
                for (int n = 0; n < 60; n++) {
                    double px = 0.5 * (low + high), t = sign * px * scale;
                    bst_vec3 d = bst_vec3_unit((bst_vec3){polar ? 0 : t, polar ? t : 0, 1});
                    if (bst_discs_light(&discs, d).earth > 0.5) {
                        low = px;
                    } else {
                        high = px;
                    }
                }
                found = low < 199 ? low : found;
            }
            bst_assert_close(found, tan(20 * scale) / scale, 1e-5); /* px; bisection and rounding */
        }
    }
}

/* Stars vanish where the disc is drawn, aberration by Earth and observer included. */
static void stars_set_at_the_limb(void **state) {
    (void)state;
    bst_camera camera = test_camera(3);
    bst_vec3 eye = {7.2e6, 0, 0};
    bst_scene_surroundings around = look_down(eye, 0);
    around.exposure_s = 1e-3;
    around.eye_mps = (bst_vec3){0, 5e3, 5.5e3};
    around.bodies.earth_bary_mps = (bst_vec3){0, 2e4, -2.2e4};
    around.light = bst_light_at(&around.bodies, eye, around.eye_mps);
    bst_light geocentric = bst_light_at(&around.bodies, eye, (bst_vec3){0, 0, 0});
    double to = asin(BST_EARTH_RADIUS_M / 7.2e6), scale = bst_camera_scale_rad(&camera);
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -to, 0}), around.q[k]);
    }
    bst_discs discs;
    bst_discs_make(&camera, &around, &discs);
    int hidden = 0, seen = 0;
    for (int i = 0; i < 400; i++) {
        bst_vec3 d =
            bst_vec3_unit((bst_vec3){(i % 40 - 20) * 0.25 * scale, (i / 40 - 5) * 25 * scale, 1});
        double share = bst_discs_light(&discs, d).earth;
        bst_vec3 star =
            bst_light_catalogue_star(&around.light, bst_quat_rotate(bst_quat_conj(around.q[0]), d));
        bst_vec3 far = bst_vec3_axpy(eye, 1e12, bst_light_apparent_star(&geocentric, star));
        bool occulted = bst_astro_earth_occults(eye, far, around.bodies.pole);
        hidden += occulted;
        seen += !occulted;
        /* 0.05 px of an edge that the PSF softens to 0.9 px */
        assert_true(occulted ? share > 0.48 : share < 0.52);
    }
    assert_true(hidden > 50 && seen > 50);
}

/* Shares of windows that bodies cover, against every second pixel's ray by itself. */
static void shares_of_windows(void **state) {
    (void)state;
    bst_camera camera = test_camera(60);
    static const bst_window windows[] = {
        {0, 0, 256, 256}, {100, 0, 40, 256}, {0, 130, 256, 60}, {10, 200, 80, 40}};
    int partial = 0;
    for (int turn = 0; turn < 6; turn++) {
        bst_vec3 eye = {7.2e6 + 3e6 * turn, 0, 0};
        bst_scene_surroundings around = look_down(eye, 0);
        around.exposure_s = 1e-3;
        around.bodies.moon_m = (bst_vec3){-1.6e8, 3.5e8, 1e7};
        double to = asin(BST_EARTH_RADIUS_M / eye.x) + 0.01 * (turn - 3);
        bst_quat tilt = bst_quat_from_rotvec((bst_vec3){0, -to, 0});
        bst_quat roll = bst_quat_from_rotvec((bst_vec3){0, 0, 0.8 * turn});
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            around.q[k] = bst_quat_mul(bst_quat_mul(roll, tilt), around.q[k]);
        }
        bst_discs discs;
        bst_discs_make(&camera, &around, &discs);
        for (size_t w = 0; w < sizeof windows / sizeof *windows; w++) {
            bst_window at = windows[w];
            int hidden = 0, all = 0;
            for (int y = at.y0; y < at.y0 + at.height; y += 2) {
                for (int x = at.x0; x < at.x0 + at.width; x += 2) {
                    bst_vec3 d = bst_quat_rotate(bst_quat_conj(around.q[0]),
                                                 bst_camera_unproject(&camera, x, y));
                    hidden += bst_astro_earth_occults(eye, bst_vec3_axpy(eye, 1e12, d),
                                                      around.bodies.pole);
                    all++;
                }
            }
            partial += hidden > 0 && hidden < all;
            /* a lattice of 33 places a side, and pixel steps of a fortieth of the least window */
            bst_assert_close(bst_discs_share(&discs, &camera, BST_BODY_EARTH, at),
                             hidden / (double)all, 0.06);
        }
    }
    assert_true(partial >= 6);
    /* a Moon of 31 px in the middle: its area; its window's share; elsewhere none */
    bst_vec3 origin = {0, 0, 0};
    bst_scene_surroundings around = look_down(origin, 0);
    around.bodies.moon_m = (bst_vec3){-3.844e8, 0, 0};
    around.bodies.sun_m = (bst_vec3){0, BST_AU_M, 0};
    bst_discs discs;
    bst_discs_make(&camera, &around, &discs);
    double radius = asin(BST_MOON_RADIUS_M / 3.844e8) / bst_camera_scale_rad(&camera);
    bst_assert_close(bst_discs_share(&discs, &camera, BST_BODY_MOON, windows[0]),
                     BST_PI * radius * radius / (256.0 * 256.0), 0.002);
    assert_true(bst_discs_share(&discs, &camera, BST_BODY_MOON, windows[3]) == 0.0);
    assert_true(bst_discs_share(&discs, &camera, BST_BODY_SUN, windows[0]) == 0.0);
}

/* Angle from the limb: where an independent ray just passes. */
static void angle_from_the_limb(void **state) {
    (void)state;
    bst_vec3 pole = bst_vec3_from_radec(0.4, 1.3);
    for (int i = 0; i < 200; i++) {
        bst_vec3 eye = bst_vec3_scale(bst_vec3_from_radec(0.7 * i, 1.5 * sin(1.1 * i)),
                                      6.45e6 * pow(6.0, (i % 20) / 19.0));
        bst_vec3 down = bst_vec3_scale(bst_vec3_unit(eye), -1.0);
        bst_vec3 side = bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(down, 0.9 * i)),
                                        bst_vec3_unit(bst_vec3_perpendicular(down)));
        double low = 0.0, high = BST_PI;
        for (int k = 0; k < 50; k++) {
            double a = 0.5 * (low + high);
            bst_vec3 d = bst_vec3_add(bst_vec3_scale(down, cos(a)), bst_vec3_scale(side, sin(a)));
            *(bst_astro_earth_occults(eye, bst_vec3_axpy(eye, 1e12, d), pole) ? &low : &high) = a;
        }
        for (int n = -2; n <= 2; n++) {
            double a = low + 0.005 * n;
            bst_vec3 d = bst_vec3_add(bst_vec3_scale(down, cos(a)), bst_vec3_scale(side, sin(a)));
            /* next to the limb that is not straight at right angles to this plane: flattening */
            bst_assert_close(bst_astro_earth_limb_angle(eye, pole, d), 0.005 * n, 1e-4);
        }
    }
    assert_true(bst_astro_earth_limb_angle((bst_vec3){7e6, 0, 0}, pole, (bst_vec3){1, 0, 0}) > 1.0);
    assert_true(bst_astro_earth_limb_angle((bst_vec3){6e6, 0, 0}, pole, (bst_vec3){1, 0, 0}) <
                -1.0);
}

/* Light of a whole disc, summed over pixels much smaller than it. */
static double disc_flux(const bst_camera *camera, const bst_discs *discs) {
    double sum = 0, scale = bst_camera_scale_rad(camera);
    for (int y = 0; y < camera->height_px; y++) {
        for (int x = 0; x < camera->width_px; x++) {
            sum += bst_discs_light(discs, bst_camera_unproject(camera, x, y)).sunlight;
        }
    }
    return sum * scale * scale;
}

static void discs_hold_their_light(void **state) {
    (void)state;
    bst_camera camera = test_camera(10);
    camera.background.earth = false;
    bst_vec3 eye = {0, 0, 0};
    for (int degrees = 0; degrees < 180; degrees += 30) {
        bst_scene_surroundings around = look_down(eye, 0);
        double phase = degrees * BST_DEG_RAD;
        /* straight ahead, the Sun `phase` from opposition */
        around.bodies.moon_m = (bst_vec3){-3.844e8, 0, 0};
        around.bodies.sun_m = bst_vec3_add(
            around.bodies.moon_m, (bst_vec3){BST_AU_M * cos(phase), BST_AU_M * sin(phase), 0});
        around.light.sun_m = around.bodies.sun_m;
        bst_discs discs;
        bst_discs_make(&camera, &around, &discs);
        assert_true(discs.body[BST_BODY_MOON].present && !discs.body[BST_BODY_SUN].present);
        double expected = pow(10, -0.4 * bst_scene_moon_v_mag(around.bodies.moon_m,
                                                              bst_vec3_sub(around.bodies.sun_m,
                                                                           around.bodies.moon_m)));
        /* pixels of 1/93 of the radius, the edge softened as if it were straight: 2 % */
        bst_assert_close(disc_flux(&camera, &discs), expected, 0.02 * expected);
    }
    bst_scene_surroundings around = look_down(eye, 0);
    around.bodies.sun_m = (bst_vec3){-BST_AU_M, 0, 0};
    around.light.sun_m = around.bodies.sun_m;
    bst_discs discs;
    bst_discs_make(&camera, &around, &discs);
    assert_true(discs.body[BST_BODY_SUN].present);
    bst_assert_close(disc_flux(&camera, &discs), FULL_SUN, 0.005 * FULL_SUN);
    /* mean radiance over a disc of 959.63 arcsec: finite */
    bst_vec3 z = {0, 0, 1};
    double radius = asin(BST_SUN_RADIUS_M / BST_AU_M);
    bst_assert_close(bst_discs_light(&discs, z).sunlight, FULL_SUN / (BST_PI * radius * radius),
                     1e-6 * FULL_SUN / (BST_PI * radius * radius));
}

/* A disc that moves during the exposure against the mean of many that stand still. */
static void moving_edges_are_the_mean_of_their_places(void **state) {
    (void)state;
    bst_camera camera = test_camera(20);
    bst_scene_surroundings around = look_down((bst_vec3){4.2164e7, 0, 0}, 0);
    double to = asin(BST_EARTH_RADIUS_M / 4.2164e7), scale = bst_camera_scale_rad(&camera);
    bst_quat q0 = around.q[0];
    const double move_px = 60;
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        double t = to + move_px * scale * ((double)k / BST_DISC_PARTS - 0.5);
        around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -t, 0}), q0);
    }
    bst_discs moving;
    bst_discs_make(&camera, &around, &moving);
    enum { STILLS = 200 };
    double share[11] = {0}, light[11] = {0};
    for (int n = 0; n < STILLS; n++) {
        double t = to + move_px * scale * ((n + 0.5) / STILLS - 0.5);
        bst_scene_surroundings still = around;
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            still.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -t, 0}), q0);
        }
        bst_discs discs;
        bst_discs_make(&camera, &still, &discs);
        for (int i = 0; i < 11; i++) {
            bst_disc_light l =
                bst_discs_light(&discs, bst_vec3_unit((bst_vec3){(i - 5) * 8 * scale, 0, 1}));
            share[i] += l.earth / STILLS;
            light[i] += l.sunlight / STILLS;
        }
    }
    double most = 0.3 / BST_PI * FULL_SUN;
    for (int i = 0; i < 11; i++) {
        bst_disc_light l =
            bst_discs_light(&moving, bst_vec3_unit((bst_vec3){(i - 5) * 8 * scale, 0, 1}));
        bst_assert_close(l.earth, share[i], 2e-3); /* 200 steps of 0.3 px; edge taken as straight */
        /* the surface's light is that of the middle of each of a few stretches */
        bst_assert_close(l.sunlight, light[i], 0.02 * most);
    }
}

static void gradients_are_polynomials(void **state) {
    (void)state;
    bst_world *world = test_world(SKY_WORLD("300",
                                            "\"stray_e_per_s\": 5, \"gradient_e_per_s\": [2, -1], "
                                            "\"curvature_e_per_s\": [1, -0.5, 0.25]"));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    assert_true(bst_skylight_varies(camera));
    bst_scene_surroundings around = look_down((bst_vec3){7e6, 0, 0}, 2);
    around.exposure_s = 3;
    bst_skylight *s;
    const bst_skylight_map *map = make(world, &around, (bst_window){0, 0, 300, 300}, &s);
    assert_int_equal(map->step_px, 32);
    double sky = bst_camera_background_e_per_s(camera);
    for (int i = 0; i < 300; i += 13) {
        int j = (i * 7) % 300;
        double u = (2.0 * i + 1) / 300 - 1, v = (2.0 * j + 1) / 300 - 1;
        double e = sky + 5 + 2 * u - v + u * u - 0.5 * u * v + 0.25 * v * v;
        /* a cell's curvature: (32 / 150)^2 / 4 at most for u^2, a quarter of that for v^2; floats
         */
        bst_assert_close(bst_skylight_at(map, i, j), 3 * e, 3 * 1.25 * 0.0455 / 4 + 1e-5 * e);
    }
    bst_skylight_free(s);
    bst_world_free(world);
}

/* The same place has the same bits in every window, and between nodes the sky is met to 2e-3. */
static void windows_and_interpolation(void **state) {
    (void)state;
    bst_world *world =
        test_world(SKY_WORLD("1000",
                             "\"model\": \"sky\", \"starlight\": false, \"earth\": false, "
                             "\"moon\": false, \"sun\": false"));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    bst_scene_surroundings around = look_down((bst_vec3){7e6, 0, 0}, BST_PI - 0.5);
    bst_skylight *a, *b;
    const bst_skylight_map *whole = make(world, &around, (bst_window){0, 0, 1000, 1000}, &a);
    const bst_skylight_map *part = make(world, &around, (bst_window){437, 611, 130, 7}, &b);
    double pixel_sr = bst_camera_scale_rad(camera) * bst_camera_scale_rad(camera), worst = 0;
    bst_mat3 back = bst_quat_to_mat3(bst_quat_conj(around.q[0]));
    for (int y = 611; y < 618; y++) {
        for (int x = 437; x < 567; x++) {
            assert_true(bst_skylight_at(whole, x, y) == bst_skylight_at(part, x, y));
        }
    }
    for (int y = 3; y < 1000; y += 17) {
        for (int x = 5; x < 1000; x += 19) {
            bst_vec3 d = bst_mat3_mul_vec(&back, bst_camera_unproject(camera, x, y));
            double e = bst_camera_electrons_per_s(camera, 10) * pixel_sr /
                       (BST_DEG_RAD * BST_DEG_RAD) *
                       bst_zodiacal_towards(d, bst_vec3_sub(around.bodies.sun_m, around.eye_m));
            worst = fmax(worst, fabs(bst_skylight_at(whole, x, y) / e - 1));
        }
    }
    assert_true(worst > 0 && worst < 2e-3);
    bst_skylight_free(a);
    bst_skylight_free(b);
    bst_world_free(world);
}

/* Sunlight from 30 degrees beside the field: the Sun's irradiance in stars of V = 0, what the table
 * lets through of it, the flux of such a star and the area of a pixel; neither aperture nor
 * throughput count. */
static void stray_light_on_the_detector(void **state) {
    (void)state;
#define DARK "\"model\": \"sky\", \"starlight\": false, \"earth\": false, \"moon\": false"
    double value[2];
    bst_scene_surroundings around = look_down((bst_vec3){7e6, 0, 0}, BST_PI - BST_PI / 6);
    around.exposure_s = 3;
    double v0 = 0, efficiency = 0;
    for (int table = 0; table < 2; table++) {
        bst_world *world = test_world(
            table ? SKY_WORLD("64", DARK
                              ", \"pixel_pitch_um\": 12, \"pst\": [{\"angle_deg\": 0, \"pst\": "
                              "1e-3}, {\"angle_deg\": 60, \"pst\": 1e-9}]")
                  : SKY_WORLD("64", DARK));
        bst_skylight *s;
        const bst_skylight_map *map = make(world, &around, (bst_window){0, 0, 64, 64}, &s);
        value[table] = bst_skylight_at(map, 31, 40);
        v0 = bst_world_camera(world, 0, 0)->photon_flux_v0_per_s_m2;
        efficiency = bst_world_camera(world, 0, 0)->quantum_efficiency;
        bst_skylight_free(s);
        bst_world_free(world);
    }
    /* 1e-6 at half of the angle; the Sun is 7000 km nearer than 1 au: 1e-4 */
    double expected = 3 * FULL_SUN * 1e-6 * v0 * efficiency * 12e-6 * 12e-6;
    bst_assert_close(value[1] - value[0], expected, 3e-4 * expected);
}

/* The limb's glow is drawn pixel by pixel up to where it is 2 % of the sky: with 15 scale heights
 * instead of 22 the coarse map is wrong by 12 % of the sky between its nodes. */
static void the_limb_fades_into_the_sky(void **state) {
    (void)state;
#define SKY_ONLY "\"model\": \"sky\", \"moon\": false, \"sun\": false"
    bst_world *worlds[2] = {test_world(SKY_WORLD("300", SKY_ONLY)),
                            test_world(SKY_WORLD("300", SKY_ONLY ", \"earth\": false"))};
    const bst_camera *camera = bst_world_camera(worlds[0], 0, 0);
    double scale = bst_camera_scale_rad(camera), limb = asin(BST_EARTH_RADIUS_M / 7.2e6);
    bst_scene_surroundings around = look_down((bst_vec3){7.2e6, 0, 0}, 0);
    double sun_e = bst_camera_electrons_per_s(camera, 0) * scale * scale * around.exposure_s;
    int followed = 0, beyond = 0;
    for (int k = 0; k <= BST_DISC_PARTS; k++) { /* a scale height is 25 px: 13 to 25 of them */
        bst_vec3 turn = {0, -limb - 475 * scale, 0};
        around.q[k] = bst_quat_mul(bst_quat_from_rotvec(turn), around.q[k]);
    }
    bst_skylight *s[2];
    const bst_skylight_map *map[2];
    for (int i = 0; i < 2; i++) {
        map[i] = make(worlds[i], &around, (bst_window){0, 0, 300, 300}, &s[i]);
    }
    bst_discs discs;
    bst_discs_make(camera, &around, &discs);
    for (int i = 0; i < 300 * 300; i += 7) {
        int x = i % 300, y = i / 300;
        bst_disc_light light = bst_discs_light(&discs, bst_camera_unproject(camera, x, y));
        double sky = bst_skylight_at(map[1], x, y), glow = sun_e * light.sunlight;
        followed += glow > 0.2 * sky;
        beyond += glow < 0.02 * sky;
        /* what is left of the glow, and 2e-3 between the sky's nodes */
        bst_assert_close(bst_skylight_at(map[0], x, y), sky + glow, 0.03 * sky + 1e-5 * glow);
    }
    assert_true(followed > 1000 && beyond > 1000);
    for (int i = 0; i < 2; i++) {
        bst_skylight_free(s[i]);
        bst_world_free(worlds[i]);
    }
}

/* The Earth is found that only a turn of the camera brings near the sensor, at the exposure's ends.
 */
static void bodies_are_found_wherever_the_camera_turns(void **state) {
    (void)state;
    bst_camera camera = test_camera(20);
    double half = bst_camera_half_diagonal_rad(&camera), r = 4.2164e7;
    for (int i = 0; i < 60; i++) {
        double turn = 0.02 * (i % 6), away = half * (0.25 * (i / 6) + 0.2);
        bst_scene_surroundings around = look_down((bst_vec3){r, 0, 0}, 0);
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            double to = asin(BST_EARTH_RADIUS_M / r) + away + turn * (1 - fabs(k - 4.0) / 4);
            around.q[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, -to, 0}), around.q[k]);
        }
        bst_discs discs;
        bst_discs_make(&camera, &around, &discs);
        bool present = discs.body[BST_BODY_EARTH].present;
        assert_true(present || away > half);
        /* 44 px of limb, 45 px of wings, flattening */
        assert_true(!present || away < half + 110.0 * bst_camera_scale_rad(&camera));
    }
}

/* The Sun rises by the ellipsoid's normal, to 0.05 degrees; a sphere's would be 0.19 off. */
static void day_begins_on_the_ellipsoid(void **state) {
    (void)state;
    const double e2 = BST_EARTH_FLATTENING * (2.0 - BST_EARTH_FLATTENING);
    bst_camera camera = {.width_px = 512, .height_px = 512, .pixel_scale_arcsec = 10};
    camera.background.earth = true;
    for (int k = 0; k < 16; k++) {
        double latitude = (k & 1 ? -0.7 : 0.7), up = (k & 2 ? -0.05 : 0.05) * BST_DEG_RAD;
        double c = cos(latitude), n = sin(latitude), bearing = 0.5 * BST_PI * (k / 4);
        double radius = BST_EARTH_RADIUS_M / sqrt(1.0 - e2 * n * n);
        bst_vec3 normal = {c, 0, n}, north = {-n, 0, c}, east = {0, 1, 0};
        bst_vec3 level = bst_vec3_axpy(bst_vec3_scale(north, cos(bearing)), sin(bearing), east);
        bst_vec3 eye = {radius * c + 8e5 * c, 0, radius * (1.0 - e2) * n + 8e5 * n};
        bst_scene_surroundings a = look_down(eye, 0);
        a.bodies.sun_m = bst_vec3_scale(
            bst_vec3_axpy(bst_vec3_scale(level, cos(up)), sin(up), normal), BST_AU_M);
        for (int i = 0; i <= BST_DISC_PARTS; i++) {
            a.q[i] = bst_quat_look(bst_vec3_scale(normal, -1.0), north);
        }
        bst_discs discs;
        bst_discs_make(&camera, &a, &discs);
        const unsigned sides = bst_discs_light(&discs, (bst_vec3){0, 0, 1}).sides;
        assert_true((sides & 1U) == (up > 0.0));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(day_begins_on_the_ellipsoid),
        cmocka_unit_test(shares_of_windows),
        cmocka_unit_test(angle_from_the_limb),
        cmocka_unit_test(transmittance_is_log_linear),
        cmocka_unit_test(stray_light_by_hand),
        cmocka_unit_test(the_limb_is_where_geometry_has_it),
        cmocka_unit_test(stars_set_at_the_limb),
        cmocka_unit_test(discs_hold_their_light),
        cmocka_unit_test(moving_edges_are_the_mean_of_their_places),
        cmocka_unit_test(gradients_are_polynomials),
        cmocka_unit_test(windows_and_interpolation),
        cmocka_unit_test(stray_light_on_the_detector),
        cmocka_unit_test(the_limb_fades_into_the_sky),
        cmocka_unit_test(bodies_are_found_wherever_the_camera_turns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
