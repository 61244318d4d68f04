/* Light of curved parts in part shadow against integrals, where the shadow is thin or the lobe is
 * narrow: the light and its stated error. */
#include "tests/satellite/satellite_support.h"

typedef struct found {
    double light, error; /* m^2/sr */
} found;

static found light_of(const char *text, bst_vec3 sun, bst_vec3 eye) {
    bst_test_model m = bst_test_model_open(text);
    bst_satellite_light light = {.sun = sun, .observer = eye, .sunlit = 1.0};
    bst_satellite_aim aim = {.sun = sun, .earth = {0, 0, 1}, .target = eye};
    bst_satellite_flux flux;
    bst_satellite_pose_set(m.pose, &aim);
    bst_satellite_flux_at(m.pose, &light, &flux);
    bst_test_model_close(&m);
    return (found){flux.sun[BST_SUNLIGHT_V], flux.error};
}

/* Share of the light of a mirror-like sphere from latitudes above one, from the plane of Sun and
 * observer at 60 degrees. */
static double share_above(double roughness, double latitude) {
    enum { STEPS = 700 };
    const bst_brdf brdf = {
        .model = BST_BRDF_COOK_TORRANCE, .specular = 0.9, .roughness = roughness};
    double phase = BST_PI / 3.0, sum = 0.0, free = 0.0;
    /* equal steps of s, the angle from the middle of the lobe is roughness sinh(s) */
    double wide = asinh(BST_PI / 3.0 / roughness), high = asinh(0.5 * BST_PI / roughness);
    double border = asinh(latitude / roughness);
    for (int part = 0; part < 2; part++) {
        double from = part ? border : -high, to = part ? high : border;
        for (int i = 0; i < STEPS * STEPS; i++) {
            double s = wide * ((i % STEPS + 0.5) / STEPS * 2.0 - 1.0);
            double t = from + (to - from) * ((double)(i / STEPS) + 0.5) / STEPS;
            double l = 0.5 * phase + roughness * sinh(s), c = cos(roughness * sinh(t));
            double in = cos(l - phase) * c, out = cos(l) * c;
            if (in > 1e-9 && out > 1e-9) {
                double light = in * out * c * bst_brdf_value(&brdf, in, out, cos(phase)) * cosh(s) *
                               cosh(t) * (to - from);
                sum += light;
                free += part ? light : 0.0;
            }
        }
    }
    return free / sum;
}

/* A plate takes the Sun from all latitudes of a sphere beyond one, within a few widths of its
 * lobe. */
static void lobes_lose_what_is_in_shadow(void **state) {
    (void)state;
    static const double roughness[] = {0.02, 0.05, 0.3}, border_m[] = {0.05, -0.01, 0.0, 0.3};
    static const char format[] =
        "{\"materials\": [{\"name\": \"m\", \"model\": \"cook_torrance\", \"diffuse\": 0, "
        "\"specular\": 0.9, \"roughness\": %g}, {\"name\": \"k\", \"diffuse\": 0}], \"parts\": "
        "[{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 1, \"material\": \"m\"}, "
        "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [4, 1.9, 1], \"position_m\": [0, %g, "
        "3], \"material\": \"k\"}]}";
    bst_vec3 sun = {0, 0, 1}, eye = {0.8660254037844386, 0, 0.5};
    for (int i = 0; i < 3; i++) {
        char text[900];
        snprintf(text, sizeof text, format, roughness[i], -60.0);
        double whole = light_of(text, sun, eye).light;
        for (int k = 0; k < 4; k++) {
            snprintf(text, sizeof text, format, roughness[i], border_m[k] + 0.95);
            found f = light_of(text, sun, eye);
            /* the plate reaches from the border to 1.9 m on: y below it is free */
            double truth = share_above(roughness[i], -asin(border_m[k]));
            double off = fabs(f.light / whole - truth);
            assert_true(off <= f.error / whole);
            bst_assert_close(off, 0.0, 4e-4);             /* 2.1e-4 found */
            bst_assert_close(f.error / whole, 0.0, 4e-3); /* 2.5e-3 found */
        }
    }
}

/* A boom before the brightest line of a cylinder that has 2.9 % of the light. */
static void booms_before_dim_cylinders(void **state) {
    (void)state;
    static const char format[] =
        "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"k\", \"diffuse\": 0}], "
        "\"parts\": [{\"name\": \"c\", \"kind\": \"cylinder\", \"radius_m\": 1, \"length_m\": 2, "
        "\"material\": \"w\"}, {\"name\": \"b\", \"size_m\": [0.05, %.9g, 4], \"position_m\": [3, "
        "%.9g, 0], \"material\": \"k\"}, {\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [10.7, "
        "10, 1], \"position_m\": [0, 100, 0], \"rotation_deg\": [0, 90, 0], \"material\": "
        "\"w\"}]}";
    bst_vec3 sun = {1, 0, 0}, eye = {cos(BST_PI / 6), sin(BST_PI / 6), 0};
    for (double width = 0.02; width < 0.5; width += 0.03) {
        for (double middle = 0.1; middle < 0.5; middle += 0.16180339887) {
            double low = middle - 0.5 * width, high = middle + 0.5 * width;
            char text[900];
            snprintf(text, sizeof text, format, sin(high) - sin(low), 0.5 * (sin(high) + sin(low)));
            found f = light_of(text, sun, eye);
            double side = 0.5 * (sin(BST_PI / 6) + (BST_PI - BST_PI / 6) * cos(BST_PI / 6));
            double lost = 0.5 * (width * cos(BST_PI / 6) +
                                 0.5 * (sin(2 * high - BST_PI / 6) - sin(2 * low - BST_PI / 6)));
            double whole = 0.8 / BST_PI * (2.0 * side + 107.0 * eye.x);
            double off = fabs(f.light - whole + 0.8 / BST_PI * 2.0 * lost);
            assert_true(off <= f.error + 1e-9 * whole);
            bst_assert_close(off, 0.0, 8e-4 * whole); /* 5.4e-4 found */
        }
    }
}

/* What a strip of the observer's view takes of the light of a Lambertian sphere of 1 m. The strip
 * is `width` wide and `aside` from the middle, turned from the axis of Sun and observer. */
static double light_behind(double phase, double aside, double width, double turn) {
    enum { ACROSS = 40, ALONG = 20000 };
    double sum = 0.0;
    for (int i = 0; i < ACROSS; i++) {
        double u = aside + width * ((i + 0.5) / ACROSS - 0.5), half = sqrt(1.0 - u * u);
        for (int k = 0; k < ALONG; k++) {
            double v = half * ((k + 0.5) / ALONG * 2.0 - 1.0);
            double x = sqrt(1.0 - u * u - v * v), y = u * cos(turn) - v * sin(turn);
            sum += fmax(x * cos(phase) + y * sin(phase), 0.0) * 2.0 * half;
        }
    }
    return 0.8 / BST_PI * sum * width / ((double)ACROSS * ALONG);
}

/* Thin rods across all of a sphere, with corners or round, which no corner betrays. */
static void rods_before_spheres(void **state) {
    (void)state;
    static const char *const kinds[] = {
        "\"kind\": \"box\", \"size_m\": [0.001, 0.02, 4]",
        "\"kind\": \"cylinder\", \"radius_m\": 0.01, \"length_m\": 4"};
    static const double turn_deg[] = {0, 3, 25, 90}, aside_m[] = {0.06, -0.4, 0.02};
    bst_vec3 eye = {1, 0, 0}, sun = {cos(BST_PI / 6), sin(BST_PI / 6), 0};
    for (int i = 0; i < 24; i++) {
        double turn = turn_deg[i / 2 % 4], aside = aside_m[i / 8], t = turn * BST_DEG_RAD;
        char text[900];
        snprintf(text, sizeof text,
                 "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"k\", "
                 "\"diffuse\": 0}], \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", "
                 "\"radius_m\": 1, \"material\": \"w\"}, {\"name\": \"r\", %s, \"position_m\": "
                 "[6, %.12g, %.12g], \"rotation_deg\": [%g, 0, 0], \"material\": \"k\"}]}",
                 kinds[i % 2], aside * cos(t), aside * sin(t), turn);
        found f = light_of(text, sun, eye);
        double phase = BST_PI / 6;
        double whole = 0.8 / BST_PI * 2.0 / 3.0 * (sin(phase) + (BST_PI - phase) * cos(phase));
        double off = fabs(whole - f.light - light_behind(phase, aside, 0.02, t));
        assert_true(off <= f.error);
        bst_assert_close(off, 0.0, 1e-3 * whole); /* 4.7e-4 found */
    }
}

/* A sphere before a plate, in a model of many bodies: the shadow is round, or its error known. */
static void round_shadows_among_many_bodies(void **state) {
    (void)state;
    static char text[20000];
    snprintf(text, sizeof text,
             "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"k\", \"diffuse\": "
             "0}], \"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [4, 4, 1], "
             "\"material\": \"w\"}, {\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 1, "
             "\"position_m\": [0.3, 0.2, 3], \"rotation_deg\": [40, 10, 0], \"material\": \"k\"}");
    for (int i = 0; i < 70; i++) {
        snprintf(text + strlen(text), sizeof text - strlen(text),
                 ", {\"name\": \"b%d\", \"size_m\": [0.1, 0.1, 0.1], \"position_m\": [%d, 0, -9], "
                 "\"material\": \"k\"}",
                 i, i - 35);
    }
    strcat(text, "]}");
    bst_vec3 up = {0, 0, 1};
    found f = light_of(text, up, up);
    double truth = 0.8 / BST_PI * (16.0 - BST_PI), off = fabs(f.light - truth);
    assert_true(f.error > 0.0 && off <= f.error);
    bst_assert_close(off, 0.0, 7e-4 * truth); /* the tolerance of round borders */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lobes_lose_what_is_in_shadow),
        cmocka_unit_test(booms_before_dim_cylinders),
        cmocka_unit_test(rods_before_spheres),
        cmocka_unit_test(round_shadows_among_many_bodies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
