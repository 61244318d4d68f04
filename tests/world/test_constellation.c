/* Walker constellations: elements by Walker's definition, and the satellites in a world. */
#include "sim/onboard/knowledge.h"
#include "sim/world/orbit/constellation.h"

#include "tests/world/world_support.h"

static bst_time epoch_of(const char *utc) {
    bst_ctx ctx = {0};
    bst_time t;
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, utc, &t));
    return t;
}

/* 56 deg: 24/3/2 at 1100 km. In plane p, slot s (from 1): node 120 deg (p - 1), mean anomaly
 * 45 deg (s - 1) + 2 * 15 deg (p - 1), each from that of satellite 1-1. */
static void elements_by_definition(void **state) {
    (void)state;
    bst_constellation_config c = {.name = "W",
                                  .pattern = BST_WALKER_DELTA,
                                  .satellites = 24,
                                  .planes = 3,
                                  .phasing = 2,
                                  .inclination_deg = 56,
                                  .semi_major_axis_m = 7478135,
                                  .eccentricity = 0.01,
                                  .raan_deg = -30,
                                  .arg_perigee_deg = 80,
                                  .mean_anomaly_deg = 350,
                                  .at_s = 43200};
    bst_time epoch = epoch_of("2022-06-16T06:00:00Z");
    for (int star = 0; star < 2; star++) {
        c.pattern = star ? BST_WALKER_STAR : BST_WALKER_DELTA;
        for (int p = 1; p <= 3; p++) {
            for (int s = 1; s <= 8; s++) {
                bst_elements e = bst_constellation_elements(&c, epoch, p, s);
                double node = 330 + (star ? 60 : 120) * (p - 1),
                       m = 350 + 45 * (s - 1) + 30 * (p - 1);
                bst_assert_close(e.raan_rad / BST_DEG_RAD, node - 360 * floor(node / 360), 1e-11);
                bst_assert_close(e.mean_anomaly_rad / BST_DEG_RAD, m - 360 * floor(m / 360), 1e-11);
                bst_assert_close(e.inclination_rad / BST_DEG_RAD, 56, 1e-12);
                bst_assert_close(e.arg_perigee_rad / BST_DEG_RAD, 80, 1e-12);
                bst_assert_close(e.eccentricity, 0.01, 0);
                /* 60 sqrt(398600.8 / 7478.135^3), by numpy */
                bst_assert_close(e.mean_motion_radpmin, 0.05857743918453868, 1e-15);
                /* 2022-06-16T18:00:00 is JD 2459747.25 */
                bst_assert_close((e.epoch_utc_jd1 - 2459747.25) + e.epoch_utc_jd2, 0, 1e-9);
            }
        }
    }
    char name[64];
    bst_constellation_name(&c, 2, 7, name);
    assert_string_equal(name, "W 2-7");
}

static void numbers_that_belong_together(void **state) {
    (void)state;
    const bst_constellation_config sound = {.satellites = 12,
                                            .planes = 4,
                                            .phasing = 3,
                                            .semi_major_axis_m = 7e6,
                                            .eccentricity = 0.07};
    static const struct {
        int64_t satellites, planes, phasing;
        double a, e;
        const char *words; /* NULL: sound */
    } cases[] = {
        {12, 4, 3, 7e6, 0.07, NULL},
        {13, 4, 3, 7e6, 0.07, "satellites: 13 do not divide into 4 planes"},
        {12, 4, 4, 7e6, 0.07, "phasing: 4 is not below the number of planes, 4 (allowed: 0 to 3)"},
        {1, 1, 0, 7e6, 0, NULL},
        /* the perigee at 7e6 * 0.92 - 6378135 m */
        {12, 4, 3, 7e6, 0.08, "semi_major_axis_m: the perigee is at a height of 61.9 km"},
        {12, 4, 3, 6478136, 0, NULL},
        {12, 4, 3, 6478134, 0, "semi_major_axis_m: the perigee is at a height of 100.0 km"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_constellation_config c = sound;
        bst_ctx ctx = {0};
        c.satellites = cases[i].satellites;
        c.planes = cases[i].planes;
        c.phasing = cases[i].phasing;
        c.semi_major_axis_m = cases[i].a;
        c.eccentricity = cases[i].e;
        assert_int_equal(bst_constellation_check(&ctx, &c),
                         cases[i].words ? BST_ERR_CONFIG : BST_OK);
        if (cases[i].words && !strstr(ctx.message, cases[i].words)) {
            fail_msg("%s", ctx.message);
        }
    }
}

#define WALKER                                                                                \
    "\"constellations\": [{\"name\": \"W\", \"satellites\": 12, \"planes\": 3, \"phasing\": " \
    "1, \"inclination_deg\": 60, \"semi_major_axis_m\": 26560000, \"area_m2\": 7, "           \
    "\"albedo\": 0.5}, {\"name\": \"V\", \"satellites\": 2, \"planes\": 1, "                  \
    "\"inclination_deg\": 20, \"semi_major_axis_m\": 9e6}]"

static bst_status try_world(bst_ctx *ctx, const char *objects, const char *orbit, bst_world **out) {
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s], " WALKER
             "}, \"observers\": [{\"name\": \"n\", \"orbit\": {\"source\": \"constellation\", %s}, "
             "\"sensors\": "
             "[{" TEST_CAMERA "}]}]}",
             objects, orbit);
    return test_world_try(ctx, TEST_EPOCH, text, out);
}

static void satellites_of_a_world(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world;
    bst_assert_ok(&ctx, try_world(&ctx, "{\"name\": \"GX5\", " TEST_GX5 "}",
                                  "\"constellation\": \"W\", \"member\": [2, 3]", &world));
    assert_int_equal(bst_world_object_count(world), 1 + 12 + 2);
    assert_int_equal(bst_world_find_object(world, "GX5"), 0);
    assert_int_equal(bst_world_find_object(world, "W 1-1"), 1);
    assert_int_equal(bst_world_find_object(world, "W 2-3"), 7);
    assert_int_equal(bst_world_find_object(world, "V 1-2"), 14);
    assert_int_equal(bst_world_find_object(world, "W 2-5"), -1);
    bst_assert_close(bst_world_object(world, 7)->area_m2, 7, 0);
    bst_assert_close(bst_world_object(world, 7)->albedo, 0.5, 0);
    bst_world_view *view;
    bst_world_state s[12], own;
    bst_vec3 normal[12];
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (int i = 0; i < 12; i++) {
        bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 1 + i, 0, &s[i]));
        normal[i] = bst_vec3_unit(bst_vec3_cross(s[i].position_m, s[i].velocity_mps));
        /* the Moon and the Sun give the orbit an eccentricity of 3e-4 */
        bst_assert_close(bst_vec3_norm(s[i].position_m), 26560000, 1e4);
        bst_assert_close(normal[i].z, cos(60 * BST_DEG_RAD), 3e-3); /* precession since J2000 */
    }
    for (int i = 0; i < 12; i++) {
        int p = i / 4;
        /* four in a plane, at right angles; planes 120 deg apart in node */
        bst_assert_close(bst_vec3_angle(s[i].position_m, s[4 * p + (i + 1) % 4].position_m),
                         0.5 * BST_PI, 1e-3);
        double between = cos(60 * BST_DEG_RAD) * cos(60 * BST_DEG_RAD) -
                         0.5 * sin(60 * BST_DEG_RAD) * sin(60 * BST_DEG_RAD);
        bst_assert_close(bst_vec3_dot(normal[i], normal[(i + 4) % 12]), between, 1e-3);
        /* eastwards: turned about the pole by +120 deg */
        bst_vec3 turn = bst_vec3_cross(normal[i], normal[(i + 4) % 12]);
        assert_true(turn.z > 0);
    }
    /* the observer is the satellite that it says, and knows it */
    bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, 0, &own));
    bst_assert_close(test_distance(own.position_m, s[6].position_m), 0, 1e-3);
    bst_knowledge *k;
    bst_assert_ok(&ctx, bst_knowledge_create(&ctx, world, 0, 0, &k));
    for (int i = 0; i < 15; i++) {
        assert_true(bst_knowledge_is_itself(k, i) == (i == 7));
    }
    bst_knowledge_free(k);
    bst_world_view_free(view);
    bst_world_free(world);
}

static void what_is_no_member(void **state) {
    (void)state;
    static const struct {
        const char *objects, *orbit, *words;
    } cases[] = {
        {"", "\"constellation\": \"X\", \"member\": [1, 1]",
         "orbit/constellation: there is no \"X\" in /world/constellations"},
        {"", "\"constellation\": \"W\", \"member\": [4, 1]",
         "orbit/member: W has no satellite 4-1"},
        {"", "\"constellation\": \"W\", \"member\": [3, 5]",
         "orbit/member: W has no satellite 3-5"},
        {"", "\"constellation\": \"W\", \"member\": [1.5, 1]",
         "orbit/member: W has no satellite 1.5-1"},
        {"", "\"constellation\": \"W\", \"member\": [1, 2.5]",
         "orbit/member: W has no satellite 1-2.5"},
        {"{\"name\": \"W 3-2\", " TEST_GX5 "}", "\"constellation\": \"W\", \"member\": [1, 1]",
         "/world/constellations/0: name: \"W 3-2\" is the name of another object"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_world *world;
        assert_int_equal(try_world(&ctx, cases[i].objects, cases[i].orbit, &world), BST_ERR_CONFIG);
        if (!strstr(ctx.message, cases[i].words)) {
            fail_msg("%s", ctx.message);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(elements_by_definition),
        cmocka_unit_test(numbers_that_belong_together),
        cmocka_unit_test(satellites_of_a_world),
        cmocka_unit_test(what_is_no_member),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
