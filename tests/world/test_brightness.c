/* Brightness of objects: phase laws, standard magnitudes, light curves, Earthshine, emission; and
 * through an exposure. */
#include "sim/world/scene/brightness.h"

#include <unistd.h>

#include "sim/optics/band.h"
#include "sim/world/scene/discs.h"
#include "sim/world/scene/field_objects.h"
#include "tests/world/world_support.h"

static const double pi = BST_PI;

static bst_brightness_config plain(void) {
    bst_ctx ctx = {0};
    bst_brightness_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_brightness_config_table, &config));
    return config;
}

static bst_brightness *make(const bst_brightness_config *config) {
    bst_ctx ctx = {0};
    bst_brightness *b;
    bst_assert_ok(&ctx, bst_brightness_create(&ctx, config, "", &b));
    return b;
}

/* An object at 42,000 km on the x axis, seen from `range` at a phase angle; the Sun along +x at
 * 1 au from the object. */
static bst_scene_lighting lit(double range, double phase_rad) {
    bst_vec3 object = {4.2e7, 0, 0};
    return (bst_scene_lighting){
        .area_m2 = 4,
        .albedo = 0.25,
        .object_m = object,
        .eye_m = {object.x + range * cos(phase_rad), range * sin(phase_rad), 0},
        .sun_m = {object.x + BST_AU_M, 0, 0},
        .sunlit_fraction = 1};
}

static bst_scene_glow glow_of(const bst_brightness_config *config,
                              const bst_scene_lighting *lighting) {
    bst_brightness *b = make(config);
    bst_scene_glow glow;
    bst_brightness_at(b, lighting, &glow);
    bst_brightness_free(b);
    return glow;
}

/* A white sphere sends out all the light that falls on it: the integral over all directions is 1.
 */
static void phase_laws(void **state) {
    (void)state;
    for (double s = 0; s <= 1; s += 0.25) {
        double sum = 0;
        for (int i = 0; i < 20000; i++) {
            double phi = pi * (i + 0.5) / 20000;
            sum += bst_astro_sphere_phase(s, phi) * 2 * pi * sin(phi) * pi / 20000;
        }
        bst_assert_close(sum, 1, 1e-7); /* of the midpoints */
    }
    bst_assert_close(bst_astro_sphere_phase(0, 0), 2 / (3 * pi),
                     1e-15); /* closed forms: rounding */
    bst_assert_close(bst_astro_sphere_phase(0, pi / 2), 2 / (3 * pi * pi), 1e-15);
    bst_assert_close(bst_astro_sphere_phase(0, pi), 0, 1e-15);
    bst_assert_close(bst_astro_sphere_phase(1, pi), 1 / (4 * pi), 1e-15);
    bst_assert_close(bst_astro_sphere_phase(0.5, -0.7), bst_astro_sphere_phase(0.5, 0.7), 0);
}

/* McCue's formula by hand: 4 m2, albedo 0.25, half specular, 90 degrees, 40,000 km: F = 0.5 *
 * 0.0675474 + 0.5 * 0.0795775 = 0.0735624; ratio 1 * F / 1.6e15 = 4.59765e-17; V = -26.74
 * + 40.84357 = 14.1036. */
static void diffuse_and_specular(void **state) {
    (void)state;
    bst_brightness_config c = plain();
    c.specular_fraction = 0.5;
    bst_scene_lighting l = lit(4e7, pi / 2);
    bst_scene_glow g = glow_of(&c, &l);
    bst_assert_close(g.v_mag, 14.1036, 2e-4); /* digits above */
    bst_assert_close(g.specular_share, 0.0795775 / (2 * 0.0735624), 1e-5);
    /* without the mirror, as the function of old */
    c.specular_fraction = 0;
    g = glow_of(&c, &l);
    bst_assert_close(g.v_mag, bst_world_lambert_sphere_v_mag(4, 0.25, pi / 2, 4e7, BST_AU_M),
                     1e-12);
    bst_assert_close(g.specular_share, 0, 0);
}

static void the_ends_of_all_scales(void **state) {
    (void)state;
    bst_brightness_config c = plain();
    bst_scene_lighting l = lit(4e7, pi);
    assert_true(glow_of(&c, &l).v_mag > 50); /* phase 180 */
    l.area_m2 = 0;
    bst_scene_glow g = glow_of(&c, &l);
    assert_true(isinf(g.v_mag));
    bst_assert_close(g.emission_sr, 0, 0);
    l = lit(4e7, 1);
    l.albedo = 0; /* black, but it glows */
    g = glow_of(&c, &l);
    assert_true(isinf(g.v_mag));
    bst_assert_close(g.emission_sr, 0.8 * 4 / 1.6e15, 1e-20); /* rounding */
    /* 1e6 km: as far as the law of squares goes */
    l = lit(1e9, 1);
    bst_assert_close(glow_of(&c, &l).v_mag,
                     bst_world_lambert_sphere_v_mag(4, 0.25, 1, 1e9, BST_AU_M), 1e-12);
    for (double r = 1.3; r < 100.0; r *= 2.0) { /* near by; places 7000 km away are rounded */
        double sphere_sr = 2 * pi * (1 - cos(asin(sqrt(4 / pi) / r)));
        l = lit(r, 1);
        bst_assert_close(glow_of(&c, &l).emission_sr / (0.8 * sphere_sr), 1, 1e-8);
    }
    /* from inside, of a speck, and out of nothing: numbers */
    l = lit(0.5, 1);
    assert_true(glow_of(&c, &l).v_mag < 100);
    bst_brightness_at(NULL, &l, &g);
    bst_assert_close(g.emission_sr, 0, 0);
}

/* V is the standard magnitude at 1000 km and 90 degrees, 5 log10(2) fainter at 2000 km, and 2.5
 * log10(pi) brighter at full phase. */
static void standard_magnitudes(void **state) {
    (void)state;
    bst_brightness_config c = plain();
    c.model = BST_BRIGHTNESS_STANDARD;
    c.standard_v_mag = 6.5;
    bst_scene_lighting l = lit(1e6, pi / 2);
    bst_assert_close(glow_of(&c, &l).v_mag, 6.5, 1e-12); /* rounding */
    l = lit(2e6, pi / 2);
    bst_assert_close(glow_of(&c, &l).v_mag, 6.5 + 5 * log10(2), 1e-12);
    l = lit(1e6, 0);
    bst_assert_close(glow_of(&c, &l).v_mag, 6.5 - 2.5 * log10(pi), 1e-12);
    l.sunlit_fraction = 0.25;
    bst_assert_close(glow_of(&c, &l).v_mag, 6.5 - 2.5 * log10(pi / 4), 1e-12);
    l.sunlit_fraction = 0;
    assert_true(isinf(glow_of(&c, &l).v_mag));
}

static void write_curve(char path[BST_TEST_PATH], const char *text, bst_brightness_config *c) {
    bst_test_template(path, "curve");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_true(write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    *c = plain();
    c->model = BST_BRIGHTNESS_LIGHT_CURVE;
    snprintf(c->light_curve_file, sizeof c->light_curve_file, "%s", path);
}

static void light_curves(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    bst_brightness_config c;
    bst_scene_lighting l = lit(2e6, pi / 3);
    double sphere = bst_world_lambert_sphere_v_mag(4, 0.25, pi / 3, 2e6, BST_AU_M);

    write_curve(path, "time_s,factor\n10,1\n12,4\n14,0\n", &c);
    l.seconds = 11; /* factor 2.5 between the points */
    bst_assert_close(glow_of(&c, &l).v_mag, sphere - 2.5 * log10(2.5), 1e-6); /* nearness */
    l.seconds = 3;                                                            /* held */
    bst_assert_close(glow_of(&c, &l).v_mag, sphere, 1e-6);
    l.seconds = 20;
    assert_true(isinf(glow_of(&c, &l).v_mag));
    c.light_curve_period_s = 4;
    l.seconds = 19; /* 11 and two periods */
    bst_assert_close(glow_of(&c, &l).v_mag, sphere - 2.5 * log10(2.5), 1e-6);
    l.seconds = 7;
    bst_assert_close(glow_of(&c, &l).v_mag, sphere - 2.5 * log10(2.5), 1e-6);
    unlink(path);

    write_curve(path, "phase_deg,v_mag_1000km\n0,5\n90,8\n180,20\n", &c);
    bst_assert_close(glow_of(&c, &l).v_mag, 7 + 5 * log10(2), 1e-9); /* 60 degrees, 2000 km */
    unlink(path);
}

static void wrong_curves_are_refused(void **state) {
    (void)state;
    const char *wrong[][2] = {
        {"time,factor\n0,1\n", ":1: the column is not known"},
        {"time_s,factor\n0,1\n0,2\n", ":3: the first column does not ascend"},
        {"time_s,factor\n0,1\n1,-2\n", "factors are 0 or more"},
        {"phase_deg,factor\n0,1\n200,2\n", "phase angles are 0 to 180"},
        {"time_s,v_mag_1000km\n0,bright\n", ":2: v_mag_1000km is not a number"},
        {"time_s,factor\n", "has no rows"}};
    for (int i = 0; i < 6; i++) {
        char path[BST_TEST_PATH];
        bst_brightness_config c;
        bst_brightness *b;
        bst_ctx ctx = {0};
        write_curve(path, wrong[i][0], &c);
        assert_int_equal(bst_brightness_create(&ctx, &c, "", &b), BST_ERR_CONFIG);
        unlink(path);
        if (!strstr(ctx.message, wrong[i][1]) || !strstr(ctx.message, "light_curve_file")) {
            fail_msg("\"%s\" is not in \"%s\"", wrong[i][1], ctx.message);
        }
    }
    bst_ctx ctx = {0};
    bst_brightness *b;
    bst_brightness_config c = plain();
    c.model = BST_BRIGHTNESS_LIGHT_CURVE;
    assert_int_equal(bst_brightness_create(&ctx, &c, "", &b), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "needs a file"));
}

/* From far away the Earth is a Lambert sphere: F(alpha) rho pi R^2 / d^2 of the Sun's irradiance,
 * from one direction. From just above the ground under the Sun it is a plane of radiance rho / pi
 * on one half of the sky: a mirror ball sends 1 / (4 pi) of it everywhere, rho / (2 pi) in all. */
static void earthshine_from_far_and_near(void **state) {
    (void)state;
    bst_vec3 middle, sun = {BST_AU_M, 0, 0};
    for (double alpha = 0.2; alpha < 3; alpha += 0.6) {
        double d = 2e9;
        bst_vec3 object = {d * cos(alpha), d * sin(alpha), 0};
        bst_vec3 eye = {object.x, object.y, 1e7}; /* Earth and eye at right angles */
        double earth = bst_astro_sphere_phase(0, alpha) * 0.3 * pi * pow(BST_EARTH_RADIUS_M / d, 2);
        double expected = earth * bst_astro_sphere_phase(0.4, pi / 2);
        double found_full =
            expected / bst_astro_sphere_phase(0, alpha) * bst_astro_sphere_phase(0, 0);
        double found = bst_scene_earthshine(0.4, 0.3, object, eye, sun, &middle);
        /* Earth's angular radius squared, and the quadrature across the terminator */
        bst_assert_close(found, expected, 6e-3 * expected + 1e-3 * found_full);
        bst_assert_close(bst_vec3_angle(middle, bst_vec3_scale(object, -1)), 0, 4e-3);
    }
    bst_vec3 low = {BST_EARTH_RADIUS_M + 100, 0, 0}, eye = {BST_EARTH_RADIUS_M + 1e6, 0, 0};
    double found = bst_scene_earthshine(1, 0.3, low, eye, sun, &middle);
    bst_assert_close(found / (0.3 / (2 * pi)), 1, 6e-3); /* the horizon's dip: 0.0056 */
    bst_vec3 night = {-7e6, 0, 0};
    bst_assert_close(bst_scene_earthshine(0, 0.3, night, eye, sun, &middle), 0, 0);
    /* it adds to sunlight, and is all there is in the shadow's place when the Earth is lit */
    bst_brightness_config c = plain();
    bst_scene_lighting l = lit(4e7, 1);
    double sunlight = glow_of(&c, &l).v_mag;
    c.earthshine = true;
    bst_scene_glow g = glow_of(&c, &l);
    assert_true(g.v_mag < sunlight && g.earth_share > 0 && g.earth_share < 0.05);
    bst_assert_close(pow(10, -0.4 * (g.v_mag - sunlight)), 1 / (1 - g.earth_share), 1e-9);
    l.sunlit_fraction = 0;
    g = glow_of(&c, &l);
    bst_assert_close(g.earth_share, 1, 0);
    assert_true(isfinite(g.v_mag));
}

/* All light that was the Sun's goes with the square of its distance: of every model, and by way of
 * the Earth, whose own distance counts there. */
static void farther_from_the_sun(void **state) {
    (void)state;
    const bst_scene_lighting at_1_au = lit(4e7, 0.8);
    for (int k = 0; k < 4; k++) {
        bst_brightness_config c = plain();
        c.model = k < 2 ? BST_BRIGHTNESS_SPHERE : BST_BRIGHTNESS_STANDARD;
        c.specular_fraction = k % 2 ? 0.3 : 0.0;
        c.standard_v_mag = 5.0;
        for (int earth = 0; earth < 2; earth++) {
            bst_scene_lighting l = at_1_au;
            c.earthshine = earth;
            l.sunlit_fraction = 1 - earth;
            double before = glow_of(&c, &l).v_mag, from = bst_vec3_norm(l.sun_m);
            l.sun_m.x += 0.4 * BST_AU_M;
            double change = earth ? bst_vec3_norm(l.sun_m) / from : 1.4;
            bst_assert_close(glow_of(&c, &l).v_mag - before, 5.0 * log10(change), 1e-9);
        }
    }
}

/* The same of the Earth's disc; the Sun's own is as bright at any distance. */
static void discs_farther_from_the_sun(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        bst_camera camera = {.width_px = 512, .height_px = 512, .pixel_scale_arcsec = 3};
        *(k ? &camera.background.sun : &camera.background.earth) = true;
        camera.background.earth_albedo = 0.3;
        camera.background.earth_night_mag_arcsec2 = 99;
        double light[2];
        for (int far = 0; far < 2; far++) {
            bst_scene_surroundings a = {.eye_m = {k ? -4e7 : 4e7, 2e7, 0},
                                        .bodies = {.sun_m = {BST_AU_M * (1 + 0.4 * far), 0, 0},
                                                   .moon_m = {0, 0, -3.8e8},
                                                   .pole = {0, 0, 1}},
                                        .itrf_from_gcrf = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                        .exposure_s = 1};
            a.light.sun_m = bst_vec3_sub(a.bodies.sun_m, a.eye_m);
            bst_vec3 to = k ? a.light.sun_m : bst_vec3_scale(a.eye_m, -1);
            for (int i = 0; i <= BST_DISC_PARTS; i++) {
                a.q[i] = bst_quat_look(bst_vec3_unit(to), (bst_vec3){0, 0, 1});
            }
            bst_discs discs;
            bst_discs_make(&camera, &a, &discs);
            light[far] = bst_discs_light(&discs, (bst_vec3){0, 0, 1}).sunlight;
        }
        bst_assert_close(light[0] / light[1], k ? 1 : 1.96, 1e-3);
    }
}

/* The surface summed up patch by patch as seen from the eye, over the formula for a far eye. */
static double patches(double ratio, double phase) {
    enum { N = 600 };
    double sum = 0;
    for (int i = 0; i < N; i++) {
        double c = 1 - (1 - ratio) * (i + 0.5) / N, s = sqrt(1 - c * c); /* to the eye's horizon */
        for (int k = 0; k < N; k++) {
            double a = 2 * pi * (k + 0.5) / N;
            double sunward = c * cos(phase) + s * cos(a) * sin(phase);
            /* distance to the eye at (0, 0, 1 / ratio) radii */
            double h = 1 / ratio - c, way = sqrt(h * h + s * s);
            double seen = (c * h - s * s) / way;
            sum += sunward > 0 && seen > 0 ? sunward * seen / (way * way) : 0;
        }
    }
    sum *= (1 - ratio) / N * 2 * pi / N / pi; /* radiance 1 / pi of unit sunlight */
    return sum / (pi * ratio * ratio * bst_astro_sphere_phase(0, phase));
}

static void near_spheres(void **state) {
    (void)state;
    for (double ratio = 0.01; ratio < 0.5; ratio *= 3) {
        for (double phase = 0; phase < 2.9; phase += 0.7) {
            double expected = patches(ratio, phase);
            bst_assert_close(bst_scene_sphere_nearness(ratio, phase), expected,
                             2e-3 * expected + 1e-4);
        }
    }
    bst_assert_close(bst_scene_sphere_nearness(0, 1), 1, 0);
    bst_assert_close(bst_scene_sphere_nearness(1e-6, 1), 1, 2e-6); /* first order in the ratio */
}

/* LWIR, 0.2 m, 0.5, 0.8: effective area 0.01256637 m2. In the shadow at 230 K: radiance 4.3e20 by
 * the band's own integral; 0.8 * 4 m2 at 1000 km: 3.2e-12 sr. In the light at 290 K the object is
 * brighter, and half in it has the mean of fourth powers: 265.05 K. */
static void it_glows_in_the_shadow(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_band *lwir;
    bst_band_config band = {.preset = BST_BAND_LWIR};
    bst_assert_ok(&ctx, bst_band_create(&ctx, &band, "", &lwir));
    bst_camera camera = {
        .aperture_m = 0.2, .throughput = 0.5, .quantum_efficiency = 0.8, .spectrum = lwir};
    bst_brightness_config c = plain();
    bst_scene_lighting l = lit(1e6, 1);
    l.sunlit_fraction = 0;
    bst_scene_glow dark = glow_of(&c, &l);
    double reflected, e = bst_scene_glow_electrons_per_s(&camera, &dark, &reflected);
    assert_true(isinf(dark.v_mag));
    bst_assert_close(dark.temperature_k, 230, 1e-9); /* rounding */
    bst_assert_close(reflected, 0, 0);
    bst_assert_close(e / (bst_band_radiance(lwir, 230) * 3.2e-12 * 0.01256637), 1, 1e-6);
    l.sunlit_fraction = 0.5;
    bst_scene_glow half = glow_of(&c, &l);
    bst_assert_close(half.temperature_k, 265.05, 0.05); /* (290^4 + 230^4) / 2 = 4.9356e9 */
    l.sunlit_fraction = 1;
    bst_scene_glow full = glow_of(&c, &l);
    double all = bst_scene_glow_electrons_per_s(&camera, &full, &reflected);
    assert_true(all > 2 * e);
    /* what is reflected has 1 - 0.8 instead of the albedo 0.25; 1e-3 of the glow */
    double sun =
        bst_band_sun(lwir) * 0.01256637 * 0.8 * pow(10, -0.4 * (full.v_mag - BST_SUN_V_MAG));
    bst_assert_close(reflected / sun, 1, 1e-6); /* digits of the area */
    assert_true(reflected < 0.01 * all && reflected > 0);
    /* a visible camera sees nothing of it in the shadow */
    camera.spectrum = NULL;
    bst_assert_close(bst_scene_glow_electrons_per_s(&camera, &dark, NULL), 0, 0);
    bst_band_free(lwir);
}

static double step_rate(void *user, double u) {
    const double *edge = user;
    double s = (u - edge[0]) / edge[1];
    return s < 0 ? 1 : s > 1 ? 0 : 1 - s * s * (3 - 2 * s);
}

/* A smooth edge of any width and place in the exposure: the mean is the integral, the knots follow
 * it, and light sums up to 1. */
static void rates_with_an_edge(void **state) {
    (void)state;
    const bst_field_rate_start start = {.intervals = 16, .most_knots = 129};
    for (double width = 2.0; width > 1e-3; width *= 0.4) {
        double edge[2] = {0.31, width}, mean, sum = 0;
        bst_scene_source_rate rate;
        assert_true(bst_field_rate(step_rate, edge, &start, &rate, &mean));
        for (int i = 0; i < 100000; i++) {
            sum += step_rate(edge, (i + 0.5) / 100000) / 100000;
        }
        bst_assert_close(mean, sum, 2e-5); /* 128 straight lines on a cubic */
        assert_true(fabs(mean - sum) <= 1.1 * rate.error * mean + 1e-9);
        bst_scene_source s = {.rate = &rate};
        bst_assert_close(bst_scene_source_light(&s, 0), 0, 0);
        bst_assert_close(bst_scene_source_light(&s, 1), 1, 1e-12); /* rounding */
        double last = 0;
        for (double u = 0; u <= 1; u += 0.01) {
            double light = bst_scene_source_light(&s, u);
            assert_true(light >= last - 1e-12);
            last = light;
            bst_assert_close(bst_scene_source_rate_at(&s, u) * mean, step_rate(edge, u), 2e-3);
        }
    }
    double none[2] = {5, 1}, mean;
    bst_scene_source_rate rate;
    assert_false(bst_field_rate(step_rate, none, &start, &rate, &mean));
    bst_assert_close(mean, 1, 0);
    double dark[2] = {-5, 1};
    assert_false(bst_field_rate(step_rate, dark, &start, &rate, &mean));
    bst_assert_close(mean, 0, 0);
}

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"

/* The field query of one exposure of `object` in a world, with the camera on it. */
typedef struct look {
    bst_ctx ctx;
    bst_field *field;
    bst_truth truth;
    const bst_scene_source *source;
    bst_los_track track;
    double time_s[2];
    bst_quat q[2];
} look;

static void look_at(look *l, const bst_world *world, double start, double seconds, bst_vec3 aim) {
    const int64_t rate = 1000;
    int64_t from = llround(start * 1000), to = from + llround(seconds * 1000);
    bst_field_options options = {.v_limit = -10, .margin_px = 5};
    *l = (look){.time_s = {0, seconds}};
    bst_vec3 x = bst_vec3_unit(bst_vec3_cross((bst_vec3){0.3, 0.1, 0.9}, aim));
    bst_vec3 y = bst_vec3_cross(aim, x);
    bst_mat3 m = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {aim.x, aim.y, aim.z}}};
    l->q[0] = l->q[1] = bst_quat_from_mat3(&m);
    l->track = (bst_los_track){2, l->time_s, l->q};
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    bst_window window = {0, 0, (int)camera->width_px, (int)camera->height_px};
    int count;
    bst_assert_ok(&l->ctx, bst_field_create(&l->ctx, world, 0, 0, &l->field));
    /* the track's sums are made by bst_field_track: a history of two samples */
    bst_los_history *history = calloc(1, sizeof *history + 2 * sizeof *history->items);
    history->capacity = 2;
    history->written = 2;
    history->items[0] = (bst_los_sample){from, l->q[0]};
    history->items[1] = (bst_los_sample){to, l->q[1]};
    bst_assert_ok(&l->ctx, bst_field_track(&l->ctx, l->field, history, from, to, rate, &l->track));
    free(history);
    bst_assert_ok(&l->ctx, bst_field_query(&l->ctx, l->field, &l->track, from, to, rate, window,
                                           &options, &l->truth, &l->source, &count));
    assert_int_equal(count, 1);
}

/* The space station enters the Earth's shadow: mid-exposure the Sun goes down behind the Earth. The
 * light of the exposure is the mean of what it has at many instants, and what comes early weighs
 * more. */
static void into_the_umbra_mid_exposure(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_world_sight sight;
    double start = -1;
    bst_world *world;
    const char *text =
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"ISS\", "
        "\"orbit\": "
        "{\"elements_file\": \"scenarios/catalogue_2022-06.tle\", \"norad\": 25544}}]}, "
        "\"observers\": [{\"name\": \"near\", \"orbit\": {\"source\": \"relative\", \"reference\": "
        "\"ISS\", \"offset_rtn_m\": [0, 1e6, 0]}, \"sensors\": [{" TEST_CAMERA
        ", \"cue\": {\"object\": \"ISS\"}}]}]}";
    bst_assert_ok(&ctx, test_world_try(&ctx, TEST_EPOCH, text, &world));
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 0; t < 20000 && start < 0; t += 1) {
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &sight));
        bst_world_sight later;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t + 6, &later));
        if (!sight.occulted && !later.occulted && sight.sunlit_fraction > 0.9 &&
            sight.sunlit_fraction < 1 && later.sunlit_fraction < sight.sunlit_fraction) {
            start = t;
        }
    }
    assert_true(start > 0);
    const double seconds = 16;
    bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, start + seconds / 2, &sight));
    look l;
    look_at(&l, world, start, seconds, sight.apparent);
    assert_non_null(l.source->rate);
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double mean = 0;
    enum { N = 4000 };
    for (int i = 0; i < N; i++) {
        bst_assert_ok(
            &ctx, bst_world_view_sight(&ctx, view, 0, 0, start + seconds * (i + 0.5) / N, &sight));
        mean += bst_scene_glow_electrons_per_s(camera, &sight.glow, NULL) / N;
    }
    /* straight lines between knots, lag of light held constant */
    bst_assert_close(l.source->electrons_per_s / mean, 1, 1e-4);
    assert_true(bst_scene_source_light(l.source, 0.5) > 0.9);
    bst_truth_item item;
    bst_window window = {0, 0, 1024, 1024};
    bst_field_truth_item(l.field, &l.track, l.source, window, 1, &l.truth, &item);
    bst_assert_close(item.electrons / (mean * seconds), 1, 1e-4);
    if (isfinite(item.x_start_px) && isfinite(item.x_chief_px)) {
        /* the light is near the start of the path */
        double early = hypot(item.x_chief_px - item.x_start_px, item.y_chief_px - item.y_start_px);
        double late = hypot(item.x_chief_px - item.x_end_px, item.y_chief_px - item.y_end_px);
        assert_true(early < 0.7 * late);
    }
    bst_field_free(l.field);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* What is seen at t left the object at t - range / c, and shows the light of that instant: a light
 * curve that grows by its first value every second, seen over 40,000 km (0.13 s). */
static void light_curves_are_those_of_the_instant_of_emission(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH], object[600];
    bst_brightness_config c;
    write_curve(path, "time_s,factor\n0,1\n1000,1001\n", &c);
    snprintf(object, sizeof object,
             "{\"name\": \"GX5\", \"brightness\": {\"model\": \"light_curve\", "
             "\"light_curve_file\": \"%s\"}, " TEST_GX5 "}, {\"name\": \"steady\", " TEST_GX5 "}",
             path);
    bst_world *world = test_world_with(object, "");
    unlink(path);
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 5.0; t < 80.0; t += 25.0) {
        bst_world_sight varying, steady;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &varying));
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 1, t, &steady));
        assert_true(steady.range_m > 3e7);
        double factor = pow(10.0, -0.4 * (varying.v_mag - steady.v_mag));
        /* the instant to 1e-4 s; its sign would make 0.2 s */
        bst_assert_close(factor - 1.0, t - steady.range_m / BST_LIGHT_SPEED_MPS, 1e-4);
        /* and within an exposure of 2 s about it */
        bst_scene_source_path path_of;
        bst_scene_path_light light;
        bst_world_sight mid;
        const bst_world_view_span span = {0, t - 1.0, t + 1.0};
        bst_assert_ok(&ctx, bst_world_view_path(&ctx, view, &span, 0, &path_of, &light, &mid));
        for (double u = 0.0; u <= 1.0; u += 0.25) {
            bst_world_sight then;
            bst_scene_view_light(view, &span, 0, &path_of, &light, u, &then);
            double at = t - 1.0 + 2.0 * u;
            bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 1, at, &steady));
            factor = pow(10.0, -0.4 * (then.v_mag - steady.v_mag));
            /* light time changes by 2 km in a second: 7e-6 s */
            bst_assert_close(factor - 1.0, at - steady.range_m / BST_LIGHT_SPEED_MPS, 1e-3);
        }
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* An observer 10 m from a sphere of 4 m2: a disc of 6.5 degrees, all of its light as near by. */
static void ten_metres_away(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world;
    const char *text =
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"near\", \"orbit\": {\"source\": \"relative\", "
        "\"reference\": \"GX5\", \"offset_rtn_m\": [0, 10, 0]}, \"sensors\": [{" TEST_CAMERA
        ", \"cue\": {\"object\": \"GX5\"}}]}]}";
    bst_assert_ok(&ctx, test_world_try(&ctx, TEST_EPOCH, text, &world));
    bst_world_view *view;
    bst_world_sight sight;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, 0.5, &sight));
    bst_assert_close(sight.range_m, 10, 1e-3);
    look l;
    look_at(&l, world, 0, 1, sight.apparent);
    assert_non_null(l.source->shape);
    double ratio = sqrt(4 / pi) / 10;
    bst_assert_close(l.source->shape->radius, ratio, 1e-4 * ratio); /* the range's millimetres */
    bst_assert_close(l.source->shape->diffuse, 1, 1e-12);
    double far =
        bst_world_lambert_sphere_v_mag(4, 0.25, sight.phase_rad, sight.range_m, BST_AU_M * 1.0158);
    double nearness = bst_scene_sphere_nearness(ratio, sight.phase_rad);
    /* the Sun is at 1.0158 au in the middle of June */
    bst_assert_close(sight.v_mag, far - 2.5 * log10(nearness), 2e-3);
    bst_assert_close(bst_vec3_angle(l.source->shape->sun, sight.apparent), pi - sight.phase_rad,
                     1e-3); /* aberration and the orbit's motion in half a second */
    bst_field_free(l.field);
    bst_world_view_free(view);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(phase_laws),
        cmocka_unit_test(diffuse_and_specular),
        cmocka_unit_test(the_ends_of_all_scales),
        cmocka_unit_test(standard_magnitudes),
        cmocka_unit_test(light_curves),
        cmocka_unit_test(light_curves_are_those_of_the_instant_of_emission),
        cmocka_unit_test(wrong_curves_are_refused),
        cmocka_unit_test(earthshine_from_far_and_near),
        cmocka_unit_test(farther_from_the_sun),
        cmocka_unit_test(discs_farther_from_the_sun),
        cmocka_unit_test(near_spheres),
        cmocka_unit_test(it_glows_in_the_shadow),
        cmocka_unit_test(rates_with_an_edge),
        cmocka_unit_test(into_the_umbra_mid_exposure),
        cmocka_unit_test(ten_metres_away),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
