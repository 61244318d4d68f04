/* When Earth, Moon and Sun are in a field that is fixed among the stars, against places of the
 * bodies sampled finely. */
#include "sim/analysis/check/check_bodies.h"
#include "sim/astro/bodies.h"
#include "sim/cli/plugins.h"
#include "tests/test_support.h"

enum { MOST = 100, DURATION = 30000 };

typedef struct scene {
    bst_json *json;
    bst_scenario scenario;
    bst_world *world;
    bst_world_view *view;
} scene;

/* An ideal mount that looks at a place, in NEOSSat's orbit; a field of 0.5 x 0.3 degrees. */
static void open_scene(scene *s, double ra_deg, double dec_deg) {
    bst_ctx ctx = {0};
    char text[2000];
    int n = snprintf(
        text, sizeof text,
        "{\"boresight\": 1, \"name\": \"field\", \"epoch_utc\": \"2022-06-16T22:10:00Z\", "
        "\"duration_s\": %d,"
        " \"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": \"eye\","
        " \"orbit\": {\"elements_file\": \"scenarios/catalogue_2022-06.tle\", \"norad\": 39089},"
        " \"sensors\": [{\"name\": \"camera\", \"camera\": {\"width_px\": 600, \"height_px\": 360,"
        " \"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15, \"throughput\": 0.7, "
        "\"quantum_efficiency\": 0.7,"
        " \"photon_flux_v0_per_s_m2\": 3.6e10}, \"exposure\": {\"exposure_s\": 0.5, \"period_s\": "
        "1},"
        " \"modules\": {\"gimbal\": {\"type\": \"ideal\", \"target\": \"direction\", \"ra_deg\": "
        "%.9f,"
        " \"dec_deg\": %.9f}}}]}]}",
        DURATION, ra_deg, dec_deg);
    assert_true(n > 0 && n < (int)sizeof text);
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "field", text, (size_t)n, &s->json));
    bst_assert_ok(&ctx, bst_plugins_scenario_read(&ctx, s->json, &s->scenario));
    bst_assert_ok(&ctx, bst_world_create(&ctx, s->scenario.file, &s->scenario.world,
                                         &s->scenario.observers, "", s->scenario.epoch, &s->world));
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, s->world, &s->view));
}

static void close_scene(scene *s) {
    bst_world_view_free(s->view);
    bst_world_free(s->world);
    bst_scenario_free(&s->scenario);
    bst_json_free(s->json);
}

/* Direction of a body from the observer, and its angular radius. */
static bst_vec3 body_at(const scene *s, int body, double seconds, double *radius_rad) {
    bst_ctx ctx = {0};
    bst_world_state eye;
    bst_bodies b;
    bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, s->view, 0, seconds, &eye));
    bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, s->view, seconds, &b));
    const bst_vec3 places[] = {{0, 0, 0}, b.moon_m, b.sun_m};
    const double radii[] = {6371e3, 1737.4e3, 695700e3};
    bst_vec3 line = bst_vec3_sub(places[body], eye.position_m);
    *radius_rad = asin(radii[body] / bst_vec3_norm(line));
    return bst_vec3_unit(line);
}

/* Spans by samples each second: the edge of the disc within the circle about the field, whose
 * radius is half of its diagonal; the Earth as a sphere is off by 0.1 degrees, which it moves in 2
 * s. */
static void expect_spans(const scene *s, bst_vec3 look, int body, double tolerance_s,
                         const bst_check_body_spans *found, int least) {
    double half = 0.5 * atan(hypot(600, 360) * 3.0 * BST_ARCSEC_RAD), from = 0.0;
    bool inside = false;
    int n = 0, spans = 0;
    for (int t = 0; t <= DURATION; t++) {
        double radius;
        bst_vec3 d = body_at(s, body, t, &radius);
        bool now = bst_vec3_angle(d, look) < radius + half;
        if (now && !inside) {
            from = t;
        }
        if ((inside && !now) || (now && t == DURATION)) {
            spans++;
            while (n < found->count && (int)found->items[n].body != body) {
                n++;
            }
            assert_true(n < found->count);
            bst_assert_close(found->items[n].from_s, from, tolerance_s);
            bst_assert_close(found->items[n].until_s, t, tolerance_s);
            n++;
        }
        inside = now;
    }
    while (n < found->count && (int)found->items[n].body != body) {
        n++;
    }
    assert_int_equal(n, found->count);
    assert_true(spans >= least);
}

/* The place is where the body is `beside_deg` from at 9000 s. */
static void spans_beside(int body, double beside_deg, double tolerance_s, int least) {
    bst_ctx ctx = {0};
    scene s;
    double radius, ra, dec;
    open_scene(&s, 0, 0);
    bst_vec3 d = body_at(&s, body, 9000.0, &radius);
    close_scene(&s);
    bst_vec3 look =
        bst_vec3_unit(bst_vec3_axpy(d, tan(beside_deg * BST_DEG_RAD), bst_vec3_perpendicular(d)));
    bst_vec3_to_radec(look, &ra, &dec);
    open_scene(&s, ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    bst_check_body_span items[MOST];
    bst_check_body_spans found = {.items = items, .capacity = MOST};
    bst_assert_ok(&ctx, bst_check_bodies_in_field(&ctx, &s.scenario, s.world, 0, 0, &found));
    assert_in_range(found.count, least, MOST);
    expect_spans(&s, look, BST_FIELD_EARTH, 8.0, &found, body == BST_FIELD_EARTH ? least : 0);
    expect_spans(&s, look, BST_FIELD_MOON, tolerance_s, &found, body == BST_FIELD_MOON ? least : 0);
    expect_spans(&s, look, BST_FIELD_SUN, tolerance_s, &found, body == BST_FIELD_SUN ? least : 0);
    close_scene(&s);
}

static void the_moon(void **state) {
    (void)state;
    spans_beside(BST_FIELD_MOON, 0.3, 1.2, 2);
}

static void the_sun(void **state) {
    (void)state;
    spans_beside(BST_FIELD_SUN, 0.52, 6.0, 1); /* it moves by 0.04 arcsec/s */
}

static void the_earth(void **state) {
    (void)state;
    spans_beside(BST_FIELD_EARTH, 40.0, 1.2, 4);
}

/* A body that enters in the last step of the search, 10 s, stays until the end of the run; one that
 * leaves in it leaves where it does. */
static void the_last_step(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s;
    double radius, ra, dec;
    open_scene(&s, 0, 0);
    bst_vec3 d = body_at(&s, BST_FIELD_EARTH, 9000.0, &radius);
    close_scene(&s);
    bst_vec3 look =
        bst_vec3_unit(bst_vec3_axpy(d, tan(40.0 * BST_DEG_RAD), bst_vec3_perpendicular(d)));
    bst_vec3_to_radec(look, &ra, &dec);
    open_scene(&s, ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    bst_check_body_span items[MOST], last[MOST];
    bst_check_body_spans found = {.items = items, .capacity = MOST};
    bst_assert_ok(&ctx, bst_check_bodies_in_field(&ctx, &s.scenario, s.world, 0, 0, &found));
    int which = 0;
    while (which < found.count &&
           !(items[which].body == BST_FIELD_EARTH && items[which].from_s > 12000.0)) {
        which++;
    }
    assert_true(which < found.count);
    const double ends[2] = {items[which].from_s + 3.0, items[which].until_s + 3.0};
    for (int leaves = 0; leaves < 2; leaves++) {
        s.scenario.duration_s = ends[leaves];
        bst_check_body_spans again = {.items = last, .capacity = MOST};
        bst_assert_ok(&ctx, bst_check_bodies_in_field(&ctx, &s.scenario, s.world, 0, 0, &again));
        int at = again.count - 1;
        while (at >= 0 && last[at].body != BST_FIELD_EARTH) {
            at--;
        }
        assert_true(at >= 0);
        /* both bisected to 0.1 s */
        bst_assert_close(last[at].from_s, items[which].from_s, 0.2);
        bst_assert_close(last[at].until_s, leaves ? items[which].until_s : ends[0], 0.2);
        assert_true(leaves || last[at].until_s == s.scenario.duration_s);
    }
    close_scene(&s);
}

/* Sky at the boresight that fills the well. The day side has V 2.4 per square arcsecond (an albedo
 * of 0.3: -26.74 - 2.5 log10(0.3 / pi) + 26.57), which the limb glow falls from by e every 8 km.
 * Pixels of 3 arcsec behind 0.15 m of 0.7 x 0.7 fill 100,000 e- in 0.5 s up to 59 km of height
 * where the Sun is overhead, not above that. */
static void a_sky_that_fills_the_well(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s;
    double radius, ra, dec;
    open_scene(&s, 0, 0);
    bst_vec3 d = body_at(&s, BST_FIELD_EARTH, 9000.0, &radius);
    close_scene(&s);
    bst_vec3 look =
        bst_vec3_unit(bst_vec3_axpy(d, tan(40.0 * BST_DEG_RAD), bst_vec3_perpendicular(d)));
    bst_vec3_to_radec(look, &ra, &dec);
    open_scene(&s, ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    bst_check_body_span items[MOST];
    bst_check_body_spans found = {.items = items, .capacity = MOST};
    bst_assert_ok(&ctx, bst_check_bodies_in_field(&ctx, &s.scenario, s.world, 0, 0, &found));
    int spans = 0;
    for (int i = 0; i < found.count; i++) {
        if (items[i].body != BST_FIELD_BRIGHT_SKY) {
            continue;
        }
        spans++;
        double highest = 0.0, lowest = INFINITY;
        for (int end = 0; end < 2; end++) {
            bst_world_state eye;
            bst_assert_ok(&ctx,
                          bst_world_view_observer_state(
                              &ctx, s.view, 0, end ? items[i].until_s : items[i].from_s, &eye));
            double down = bst_vec3_angle(look, bst_vec3_scale(eye.position_m, -1.0));
            double height = bst_vec3_norm(eye.position_m) * sin(down) - 6371e3;
            highest = fmax(highest, height);
            lowest = fmin(lowest, height);
        }
        /* from the limb on; the Earth as a sphere errs by 15 km at the poles, the step of 10 s of
         * 0.06 degrees each is bisected */
        assert_true(fabs(lowest) < 20e3);
        assert_true(highest > 20e3 && highest < 59e3 + 15e3);
    }
    assert_true(spans >= 1);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_moon),
        cmocka_unit_test(the_sun),
        cmocka_unit_test(the_earth),
        cmocka_unit_test(the_last_step),
        cmocka_unit_test(a_sky_that_fills_the_well),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
