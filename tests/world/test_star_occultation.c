/* Stars behind satellites with a shape: contacts against closed forms. */
#include "sim/world/scene/star_occultation.h"
#include "tests/satellite/satellite_support.h"

#define RANGE_M 1000.0
#define MATERIAL "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], "
#define PLATE(name, size, place)                                                                 \
    "{\"name\": \"" name "\", \"kind\": \"plate\", \"size_m\": " size ", \"position_m\": " place \
    ", \"material\": \"m\"}"
static const char *const plate = MATERIAL "\"parts\": [" PLATE("p", "[4, 2, 0]", "[0, 0, 0]") "]}";
static const char *const two = MATERIAL "\"parts\": [" PLATE(
    "p", "[2, 2, 0]", "[-3, 0, 0]") ", " PLATE("q", "[4, 2, 0]", "[2, 0, 1]") "]}";
static const char *const deep = MATERIAL
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 2, 8], \"material\": "
    "\"m\"}]}";
static const char *const hinged = MATERIAL
    "\"joints\": [{\"name\": \"j\", \"follows\": \"burn\", \"axis\": [0, 1, 0], \"turn_deg\": 60, "
    "\"rate_deg_per_s\": 1000}], \"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": "
    "[4, 2, 0], "
    "\"joint\": \"j\", \"material\": \"m\"}]}";

/* A body that moves along x, m at its range, seen along z. */
typedef struct scene {
    bst_test_model model;
    bst_scene_source_path path;
    bst_scene_source_body body;
    bst_scene_source sources[4]; /* stars, then the body */
    int stars;
} scene;

static void make_scene(scene *s, const char *text, double range_m, double from_m, double to_m) {
    *s = (scene){.model = bst_test_model_open(text)};
    bst_vec3 start = {from_m, 0, range_m}, end = {to_m, 0, range_m};
    bst_vec3 middle = bst_vec3_scale(bst_vec3_add(start, end), 0.5);
    s->path = bst_scene_source_path_through(start, middle, end);
    s->body = (bst_scene_source_body){.satellite = s->model.satellite,
                                      .times = 1,
                                      .q_body_from_gcrf = {{0, 0, 0, 1}},
                                      .object_m = {{7e6, 0, 0}, {7e6, 0, 0}},
                                      .sun_m = {BST_AU_M, 0, 0}};
}

/* A star at (x, y) m in the plane across the line of sight at RANGE_M. */
static void add_star(scene *s, double x, double y) {
    s->sources[s->stars++] =
        (bst_scene_source){.kind = BST_SOURCE_STAR,
                           .apparent_mid = bst_vec3_unit((bst_vec3){x, y, RANGE_M}),
                           .electrons_per_s = 100.0,
                           .range_m = INFINITY};
}

static void apply(scene *s, bst_star_occultation *work) {
    bst_ctx ctx = {0};
    bst_vec3 middle = bst_scene_source_place(&s->path, 0.5);
    s->sources[s->stars] = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                              .apparent_mid = bst_vec3_unit(middle),
                                              .path = &s->path,
                                              .body = &s->body,
                                              .body_u = {0.0, 1.0},
                                              .electrons_per_s = 7.0,
                                              .range_m = bst_vec3_norm(middle)};
    bst_assert_ok(&ctx, bst_star_occultation_apply(&ctx, work, s->sources, s->stars + 1));
    assert_null(s->sources[s->stars].rate);
    bst_assert_close(s->sources[s->stars].electrons_per_s, 7.0, 0);
}

/* A star whose light comes outside of the given intervals only. */
static void expect_hidden(const bst_scene_source *star, const double (*hidden)[2], int count) {
    double lit = 1.0;
    for (int i = 0; i < count; i++) {
        lit -= hidden[i][1] - hidden[i][0];
    }
    assert_non_null(star->rate);
    assert_false(star->occulted);
    /* contacts are right to 1e-6 of the exposure */
    bst_assert_close(star->electrons_per_s, 100.0 * lit, 100.0 * 4e-6);
    bst_assert_close(bst_scene_source_light(star, 0.0), 0.0, 0);
    bst_assert_close(bst_scene_source_light(star, 1.0), 1.0, 1e-12);
    for (int i = 0; i < count; i++) {
        double middle = 0.5 * (hidden[i][0] + hidden[i][1]);
        bst_assert_close(bst_scene_source_rate_at(star, middle), 0.0, 0);
        for (int end = 0; end < 2; end++) {
            double u = hidden[i][end], away = end ? 3e-6 : -3e-6;
            if (u > 0.0 && u < 1.0) {
                bst_assert_close(bst_scene_source_rate_at(star, u + away), 1.0 / lit, 1e-5);
                bst_assert_close(bst_scene_source_rate_at(star, u - away), 0.0, 0);
            }
        }
    }
}

/* Two plates with a gap of 2 m pass from x = -20 to x = 20 m: each star is hidden while it is
 * within a plate's edges. The far plate is 1 m nearer to the star. */
static void plates_pass(void **state) {
    (void)state;
    scene s;
    bst_star_occultation work = {0};
    make_scene(&s, two, RANGE_M, -20, 20);
    add_star(&s, 1.0, 0.5);   /* passes both */
    add_star(&s, -19.0, 0.9); /* behind the second plate from the start */
    add_star(&s, 5.0, 1.2);   /* beside */
    apply(&s, &work);
    /* edges x0 of the plates from the origin: -4 to -2 and, 1 m farther, 0 to 4 */
    double far = 1.0 + 1.0 / RANGE_M;
    const double first[2][2] = {{(1.0 * far - 4.0 + 20.0) / 40.0, (1.0 * far + 20.0) / 40.0},
                                {(1.0 + 2.0 + 20.0) / 40.0, (1.0 + 4.0 + 20.0) / 40.0}};
    const double second[1][2] = {{0.0, (-19.0 * far + 20.0) / 40.0}};
    const double both[2][2] = {{second[0][0], second[0][1]},
                               {(-19.0 + 2.0 + 20.0) / 40.0, (-19.0 + 4.0 + 20.0) / 40.0}};
    expect_hidden(&s.sources[0], first, 2);
    expect_hidden(&s.sources[1], both, 2);
    assert_null(s.sources[2].rate);
    bst_assert_close(s.sources[2].electrons_per_s, 100.0, 0);
    bst_star_occultation_free(&work);
    bst_test_model_close(&s.model);
}

/* At rest: hidden all the time, or not at all; the outline is that of the near face in
 * perspective. */
static void outline_in_perspective(void **state) {
    (void)state;
    scene s;
    bst_star_occultation work = {0};
    make_scene(&s, deep, 20.0, 0, 0);
    double edge = RANGE_M / 16.0; /* of the near face, 16 m away */
    add_star(&s, 0.999 * edge, -0.999 * edge);
    add_star(&s, 1.001 * edge, 0.0);
    add_star(&s, 0.0, 0.0);
    apply(&s, &work);
    assert_true(s.sources[0].occulted && s.sources[2].occulted);
    assert_false(s.sources[1].occulted);
    assert_null(s.sources[1].rate);
    bst_assert_close(s.sources[0].electrons_per_s, 0.0, 0);
    bst_assert_close(s.sources[1].electrons_per_s, 100.0, 0);
    bst_star_occultation_free(&work);
    bst_test_model_close(&s.model);
}

/* A plate of half width 2 m turns about y by a quarter: a star at x = 1 m appears when
 * 2 cos(angle) = 1, seen from afar. */
static void plate_turns(void **state) {
    (void)state;
    scene s;
    bst_star_occultation work = {0};
    make_scene(&s, plate, RANGE_M, 0, 0);
    s.body.times = 17;
    for (int k = 0; k < 17; k++) {
        s.body.q_body_from_gcrf[k] =
            bst_quat_from_rotvec((bst_vec3){0, 0.5 * BST_PI * k / 16.0, 0});
    }
    add_star(&s, 1.0, 0.0);
    apply(&s, &work);
    /* the edge that hides the star goes away by 2 sin(angle) m of 1000 */
    double angle = acos(0.5 + 1e-3 * sin(BST_PI / 3.0));
    const double hidden[1][2] = {{0.0, angle / (0.5 * BST_PI)}};
    expect_hidden(&s.sources[0], hidden, 1);
    bst_star_occultation_free(&work);
    bst_test_model_close(&s.model);
}

/* A joint that turns at a burn: by 60 degrees, so that the half width is 1 m instead of 2 m. */
static void joint_at_a_burn(void **state) {
    (void)state;
    const double burn[] = {50.0};
    for (int after = 0; after < 2; after++) {
        scene s;
        bst_star_occultation work = {0};
        make_scene(&s, hinged, RANGE_M, 0, 0);
        s.body.burn_s = burn;
        s.body.burn_count = 1;
        s.body.seconds[0] = s.body.seconds[1] = after ? 100.0 : 0.0;
        add_star(&s, 1.5, 0.0);
        apply(&s, &work);
        assert_int_equal(s.sources[0].occulted, !after);
        bst_star_occultation_free(&work);
        bst_test_model_close(&s.model);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plates_pass), cmocka_unit_test(outline_in_perspective),
        cmocka_unit_test(plate_turns), cmocka_unit_test(joint_at_a_burn)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
