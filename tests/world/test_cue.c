/* Regions of the sky and errors of the cue, against spherical trigonometry by astropy 5.2
 * (SkyCoord.directional_offset_by) and places over the turning Earth. */
#include "sim/onboard/knowledge.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"

typedef struct onboard {
    bst_ctx ctx;
    bst_world *world;
    bst_knowledge *knowledge;
    bst_knowledge_view *view;
} onboard;

static onboard make(const char *sensor) {
    onboard o = {.world = test_world_with(GX5, sensor)};
    bst_assert_ok(&o.ctx, bst_knowledge_create(&o.ctx, o.world, 0, 0, &o.knowledge));
    bst_assert_ok(&o.ctx, bst_knowledge_view_create(&o.ctx, o.knowledge, &o.view));
    return o;
}

static void drop(onboard *o) {
    bst_knowledge_view_free(o->view);
    bst_knowledge_free(o->knowledge);
    bst_world_free(o->world);
}

static bst_vec3 radec(double ra_deg, double dec_deg) {
    double a = ra_deg * BST_DEG_RAD, d = dec_deg * BST_DEG_RAD;
    return (bst_vec3){cos(d) * cos(a), cos(d) * sin(a), sin(d)};
}

/* From the middle of the arc towards its second end, then to the left of it. */
static void places_of_an_arc(void **state) {
    (void)state;
    static const struct {
        const char *ends;
        double half;
        double rows[4][4]; /* along, across rad; right ascension, declination deg */
    } arcs[] = {{"10, 20, 50, 40",
                 0.3449728511468292,
                 {{0, 0, 27.877987144333, 31.549175657725},
                  {0.2, 0, 40.121815486997, 36.952167780086},
                  {-0.3, 0.05, 10.192139704084, 23.848297296042},
                  {0.1, -0.2, 39.713697338709, 24.162379241111}}},
                {"300, -10, 250, 15",
                 0.48426648355013335,
                 {{0, 0, 275.258607180408, 2.758036338973},
                  {0.2, 0, 265.027485196543, 8.015037473064},
                  {-0.3, 0.05, 289.161195771809, -7.780013818832},
                  {0.1, -0.2, 275.601112738517, 15.548162187266}}}};
    for (int a = 0; a < 2; a++) {
        char text[300];
        snprintf(text, sizeof text,
                 ", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [%s], "
                 "\"half_width_deg\": 3}}",
                 arcs[a].ends);
        onboard o = make(text);
        for (int i = 0; i < 4; i++) {
            const double *row = arcs[a].rows[i];
            bst_vec3 d;
            bst_assert_ok(
                &o.ctx, bst_knowledge_region_direction_at(&o.ctx, o.view, 7.0, row[0], row[1], &d));
            /* 12 decimals of a degree */
            bst_assert_close(test_distance(d, radec(row[2], row[3])), 0, 1e-13);
        }
        bst_region region;
        bst_knowledge_region(o.knowledge, &region);
        assert_int_equal(region.kind, BST_REGION_ARC);
        bst_assert_close(region.half_length_rad, arcs[a].half, 1e-14);
        bst_assert_close(region.half_width_rad, 3 * BST_DEG_RAD, 1e-16);
        /* the cue is its middle, as uncertain as it is long; it rests, and has no range */
        bst_onboard_cue cue;
        bool known = true;
        double range, rate;
        bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 7.0, &cue));
        bst_assert_close(
            test_distance(cue.direction_gcrf, radec(arcs[a].rows[0][2], arcs[a].rows[0][3])), 0,
            1e-13);
        bst_assert_close(bst_vec3_norm(cue.rate_gcrf_radps), 0, 1e-15);
        bst_assert_close(cue.sigma_rad, arcs[a].half, 1e-14);
        bst_assert_ok(&o.ctx,
                      bst_knowledge_cue_range_at(&o.ctx, o.view, 7.0, &known, &range, &rate));
        assert_false(known);
        drop(&o);
    }
    /* wider than long: as uncertain as it is wide */
    onboard o = make(
        ", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [0, 1, 0, 3], "
        "\"half_width_deg\": 5}}");
    bst_onboard_cue cue;
    bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 0, &cue));
    bst_assert_close(cue.sigma_rad, 5 * BST_DEG_RAD, 1e-15);
    drop(&o);
}

/* Longitude and latitude over the Earth as it has turned by the time that the onboard clock shows,
 * from where the spacecraft is then. */
static void places_of_the_belt(void **state) {
    (void)state;
    onboard o = make(
        ", \"knowledge\": {\"clock_offset_s\": 90}, \"cue\": {\"region\": {\"kind\": "
        "\"geostationary\", \"longitude_deg\": [100, 140], \"half_width_deg\": 2}}");
    bst_region region;
    bst_knowledge_region(o.knowledge, &region);
    assert_int_equal(region.kind, BST_REGION_GEOSTATIONARY);
    bst_assert_close(region.half_length_rad, 20 * BST_DEG_RAD, 1e-15);
    bst_world_view *view;
    bst_assert_ok(&o.ctx, bst_world_view_create(&o.ctx, o.world, &view));
    const double t = 600, believed = t + 90;
    bst_astro_earth_frames frames;
    bst_world_state eye;
    bst_assert_ok(&o.ctx, bst_world_view_earth_frames(&o.ctx, view, believed, &frames));
    bst_assert_ok(&o.ctx, bst_world_view_observer_state(&o.ctx, view, 0, believed, &eye));
    static const double places[][2] = {{0, 0}, {12, 1.5}, {-20, -2}};
    for (int i = 0; i < 3; i++) {
        double lon = (120 + places[i][0]) * BST_DEG_RAD, lat = places[i][1] * BST_DEG_RAD;
        double p[3] = {cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat)}, g[3] = {0};
        for (int r = 0; r < 3; r++) { /* the transpose: GCRF from ITRF */
            for (int c = 0; c < 3; c++) {
                g[c] += 42164172.0 * p[r] * frames.itrf_from_gcrf.m[r][c];
            }
        }
        bst_vec3 expected =
            bst_vec3_unit(bst_vec3_sub((bst_vec3){g[0], g[1], g[2]}, eye.position_m));
        bst_vec3 d;
        bst_assert_ok(&o.ctx, bst_knowledge_region_direction_at(
                                  &o.ctx, o.view, t, places[i][0] * BST_DEG_RAD, lat, &d));
        /* the view's ephemeris and the orbit itself agree to a millimetre, of 35,000 km */
        bst_assert_close(test_distance(d, expected), 0, 1e-10);
    }
    /* what its places' rates follow from */
    bst_belt_eye belt;
    bool known = false;
    bst_assert_ok(&o.ctx, bst_knowledge_belt_eye_at(&o.ctx, o.view, t, &known, &belt));
    assert_true(known);
    bst_assert_close(test_distance(belt.position_m, eye.position_m), 0, 0.01);
    bst_assert_close(test_distance(belt.velocity_mps, eye.velocity_mps), 0, 1e-5);
    /* 7.292115e-5 rad/s (IERS conventions), about the ITRF's pole to 1e-6 */
    bst_assert_close(bst_vec3_norm(belt.earth_radps), 7.292115e-5, 1e-11);
    const double(*m)[3] = frames.itrf_from_gcrf.m;
    bst_vec3 pole = {m[2][0], m[2][1], m[2][2]};
    bst_assert_close(test_distance(bst_vec3_unit(belt.earth_radps), pole), 0, 3e-6);
    bst_world_view_free(view);
    drop(&o);
}

/* Along an axis of the image, and turned from it from x towards y. */
static void errors_at_an_angle(void **state) {
    (void)state;
    static const char *const axes[] = {"x", "-x", "y", "-y"};
    static const double base_deg[] = {0, 180, 90, 270};
    static const double turns[] = {25, -70};
    for (int k = 0; k < 8; k++) {
        char text[300];
        double turn = turns[k / 4];
        snprintf(text, sizeof text,
                 ", \"x_axis_gcrf\": [0.3, -0.5, 0.2], \"cue\": {\"direction_radec_deg\": [40, "
                 "25], \"offset_deg\": 2, \"offset_axis\": \"%s\", \"offset_angle_deg\": %g}",
                 axes[k % 4], turn);
        onboard o = make(text);
        bst_onboard_cue cue;
        bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 0, &cue));
        /* image axes: x as near the hint as the line of sight lets it */
        bst_vec3 z = radec(40, 25), hint = {0.3, -0.5, 0.2};
        bst_vec3 x = bst_vec3_unit(bst_vec3_axpy(hint, -bst_vec3_dot(hint, z), z));
        bst_vec3 y = bst_vec3_cross(z, x);
        double a = (base_deg[k % 4] + turn) * BST_DEG_RAD, s = sin(2 * BST_DEG_RAD);
        bst_assert_close(bst_vec3_dot(cue.direction_gcrf, x), s * cos(a), 1e-14);
        bst_assert_close(bst_vec3_dot(cue.direction_gcrf, y), s * sin(a), 1e-14);
        drop(&o);
    }
}

/* The light's way, and how it changes. */
static void range_of_the_cue_s_object(void **state) {
    (void)state;
    onboard o = make(", \"cue\": {\"object\": \"GX5\", \"offset_deg\": 1}");
    bst_world_view *view;
    bst_assert_ok(&o.ctx, bst_world_view_create(&o.ctx, o.world, &view));
    for (double t = 100; t < 6000; t += 1500) {
        bool known = false;
        double range, rate, way[3];
        bst_assert_ok(&o.ctx, bst_knowledge_cue_range_at(&o.ctx, o.view, t, &known, &range, &rate));
        assert_true(known);
        for (int i = 0; i < 3; i++) {
            bst_world_sight s;
            bst_assert_ok(&o.ctx, bst_world_view_sight(&o.ctx, view, 0, 0, t + 2 * (i - 1), &s));
            way[i] = s.light_time_s * BST_LIGHT_SPEED_MPS;
        }
        /* a few metres of light bending; of the third derivative, 7 km/s (1e-3 rad/s)^2, 2 s^2/3 */
        bst_assert_close(range, way[1], 20);
        bst_assert_close(rate, (way[2] - way[0]) / 4, 0.02);
    }
    bst_world_view_free(view);
    drop(&o);
}

/* A task with an object is a cue without an error, and has no region. */
static void a_task_takes_the_cue_s_place(void **state) {
    (void)state;
    onboard o = make(
        ", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [10, 20, 50, "
        "40]}, \"offset_deg\": 1, \"sigma_deg\": 0.3, \"rate_sigma_arcsec_per_s\": 4, "
        "\"v_mag\": 11, \"v_mag_sigma\": 2}");
    bst_world_view *view;
    bst_world_sight sight;
    bst_assert_ok(&o.ctx, bst_world_view_create(&o.ctx, o.world, &view));
    bst_assert_ok(&o.ctx, bst_world_view_sight(&o.ctx, view, 0, 0, 50, &sight));
    bst_task task = {.id = 5, .object = 0};
    assert_true(bst_knowledge_view_task(o.view, &task));
    assert_false(bst_knowledge_view_task(o.view, &task)); /* it is no new one */
    bst_onboard_cue cue;
    bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 50, &cue));
    bst_assert_close(test_distance(cue.direction_gcrf, sight.geometric), 0, 1e-10);
    bst_assert_close(cue.sigma_rad, 0.3 * BST_DEG_RAD, 1e-16);
    bst_assert_close(cue.rate_sigma_radps, 4 * BST_ARCSEC_RAD, 1e-20);
    bst_assert_close(cue.v_mag, 11, 0);
    bst_assert_close(cue.v_mag_sigma, 2, 0);
    bst_region region;
    bst_knowledge_view_region(o.view, &region);
    assert_int_equal(region.kind, BST_REGION_NONE);
    bst_belt_eye belt;
    bool known = true;
    double range, rate;
    bst_assert_ok(&o.ctx, bst_knowledge_belt_eye_at(&o.ctx, o.view, 50, &known, &belt));
    assert_false(known);
    bst_assert_ok(&o.ctx, bst_knowledge_cue_range_at(&o.ctx, o.view, 50, &known, &range, &rate));
    assert_true(known);
    /* what the task itself says goes before the scenario */
    task = (bst_task){.id = 6,
                      .object = 0,
                      .sigma_rad = 1e-3,
                      .rate_sigma_radps = 2e-6,
                      .v_mag = 9,
                      .v_mag_sigma = 0.5};
    assert_true(bst_knowledge_view_task(o.view, &task));
    bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 50, &cue));
    bst_assert_close(cue.sigma_rad, 1e-3, 0);
    bst_assert_close(cue.rate_sigma_radps, 2e-6, 0);
    bst_assert_close(cue.v_mag, 9, 0);
    bst_assert_close(cue.v_mag_sigma, 0.5, 0);
    /* and without an object the sensor's own cue is back, with its region and its error */
    task = (bst_task){.id = 7, .object = -1};
    assert_true(bst_knowledge_view_task(o.view, &task));
    bst_assert_ok(&o.ctx, bst_knowledge_cue_at(&o.ctx, o.view, 50, &cue));
    bst_assert_close(
        bst_vec3_angle(cue.direction_gcrf, radec(27.877987144333, 31.549175657725)) / BST_DEG_RAD,
        1, 1e-9);
    bst_world_view_free(view);
    drop(&o);
}

static void cues_that_cannot_be(void **state) {
    (void)state;
    static const struct {
        const char *sensor, *words;
    } cases[] = {
        {", \"cue\": {\"object\": \"nobody\"}", "there is no object \"nobody\""},
        {", \"x_axis_gcrf\": [0, 0, 0]", "x_axis_gcrf: a direction of length zero"},
        {", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [1, 2, 1, 2]}}",
         "cue/region/arc_radec_deg: the region is 0 deg long"},
        {", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [0, 0, 177, 0]}}",
         "cue/region/arc_radec_deg: the region is 177 deg long"},
        {", \"cue\": {\"region\": {\"kind\": \"geostationary\", \"longitude_deg\": [100, 90]}}",
         "cue/region/longitude_deg: the region is -10 deg long"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1500];
        snprintf(text, sizeof text,
                 "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
                 "]}, \"observers\": [{\"name\": \"n\", " TEST_NEOSSAT
                 ", \"sensors\": [{" TEST_CAMERA "%s}]}]}",
                 cases[i].sensor);
        bst_ctx ctx = {0};
        bst_world *world;
        assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
        if (!strstr(ctx.message, cases[i].words)) {
            fail_msg("%s", ctx.message);
        }
    }
    /* just short enough */
    onboard o = make(
        ", \"cue\": {\"region\": {\"kind\": \"arc\", \"arc_radec_deg\": [0, 0, 176, "
        "0]}}");
    drop(&o);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_of_an_arc),
        cmocka_unit_test(places_of_the_belt),
        cmocka_unit_test(errors_at_an_angle),
        cmocka_unit_test(range_of_the_cue_s_object),
        cmocka_unit_test(a_task_takes_the_cue_s_place),
        cmocka_unit_test(cues_that_cannot_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
