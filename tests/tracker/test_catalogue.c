/* Objects near a field as tracks are compared with them: from sights of a script, whose paths,
 * ranges and light are known. The linker puts these functions in the place of the knowledge's. */
#include "tracker/catalogue.h"

#include "tests/test_support.h"

#define AS BST_ARCSEC_RAD

enum { OBJECTS = 9, CUE = 4, ITSELF = 5, BEHIND = 6, DARK = 7, ENDED = 8 };

static const double NOW_S = 40.0, HALF_RAD = 2.0 * BST_DEG_RAD;
static const bst_vec3 axis = {0.36, -0.48, 0.8};

/* Place of an object in the tangent plane, arcsec, and its rate, arcsec/s. */
static const double place_as[OBJECTS][2] = {{300, -40},     {-900, 700}, {2000, 1500},
                                            {-5000, -4900}, {10, 10},    {20, 20},
                                            {30, 30},       {40, 40},    {50, 50}};
static const double rate_as[2] = {35.0, -12.0};

static double asked_axis_off, asked_half_rad, asked_s;

static bst_vec3 direction_of(int object, double seconds) {
    bst_tangent axes = bst_tangent_at(axis);
    double dt = seconds - NOW_S;
    return bst_tangent_exp(
        axis, bst_tangent_vector(&axes, (place_as[object][0] + rate_as[0] * (object + 1) * dt) * AS,
                                 (place_as[object][1] + rate_as[1] * (object + 1) * dt) * AS));
}

static double range_of(int object) {
    return 1e6 * (object + 2);
}

int __wrap_bst_knowledge_object_count(const bst_knowledge *knowledge);
int __wrap_bst_knowledge_object_count(const bst_knowledge *knowledge) {
    (void)knowledge;
    return OBJECTS;
}

int __wrap_bst_knowledge_cue_object(const bst_knowledge_view *view);
int __wrap_bst_knowledge_cue_object(const bst_knowledge_view *view) {
    (void)view;
    return CUE;
}

bool __wrap_bst_knowledge_is_itself(const bst_knowledge *knowledge, int object);
bool __wrap_bst_knowledge_is_itself(const bst_knowledge *knowledge, int object) {
    (void)knowledge;
    return object == ITSELF;
}

bst_status __wrap_bst_knowledge_near(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                     bst_vec3 about, double half_rad, int *indices, int *count);
bst_status __wrap_bst_knowledge_near(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                     bst_vec3 about, double half_rad, int *indices, int *count) {
    (void)view;
    asked_s = seconds;
    asked_axis_off = bst_vec3_angle(about, axis);
    asked_half_rad = half_rad;
    if (seconds < 0.0) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "no place");
    }
    for (int i = 0; i < OBJECTS; i++) {
        indices[i] = OBJECTS - 1 - i;
    }
    *count = OBJECTS;
    return BST_OK;
}

bst_status __wrap_bst_knowledge_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                         double seconds, bst_world_sight *out);
bst_status __wrap_bst_knowledge_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                         double seconds, bst_world_sight *out) {
    (void)view;
    if (object == ENDED && seconds > NOW_S) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "the orbit has ended");
    }
    *out = (bst_world_sight){.geometric = direction_of(object, seconds),
                             .apparent = axis,
                             .range_m = range_of(object) + 5e5 * (seconds - NOW_S),
                             .sunlit_fraction = object == DARK ? 0.0 : 0.1,
                             .v_mag = object == 2 ? INFINITY : 8.0 + object,
                             .occulted = object == BEHIND};
    return BST_OK;
}

bst_status __wrap_bst_knowledge_direction_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                             double seconds, bst_vec3 *geometric);
bst_status __wrap_bst_knowledge_direction_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                             double seconds, bst_vec3 *geometric) {
    bst_world_sight sight;
    BST_TRY(__wrap_bst_knowledge_sight_at(ctx, view, object, seconds, &sight));
    *geometric = sight.geometric;
    return BST_OK;
}

static bst_tracker_catalogue *create(bst_ctx *ctx) {
    static char nothing; /* the functions above do not look at it */
    const bst_tracker_config config = {
        .catalogue_sigma_m = 300.0, .catalogue_sigma_mps = 0.7, .catalogue_mag_sigma = 0.4};
    bst_tracker_catalogue *c = NULL;
    bst_assert_ok(
        ctx, bst_tracker_catalogue_create(ctx, &config, (const bst_knowledge *)(void *)&nothing,
                                          (bst_knowledge_view *)(void *)&nothing, &c));
    assert_int_equal(bst_tracker_catalogue_set(c, NOW_S, 0.0), CUE);
    return c;
}

static void check_object(const bst_identity_object *o) {
    int k = o->object;
    bst_vec3 late = direction_of(k, NOW_S + 1e-3), early = direction_of(k, NOW_S - 1e-3);
    bst_vec3 rate = bst_vec3_scale(bst_vec3_sub(late, early), 500.0);
    bst_assert_close(bst_vec3_angle(o->direction, direction_of(k, NOW_S)), 0.0, 1e-12);
    /* differences over 1 s: the cube of 150 arcsec/s over 24 */
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(o->rate_radps, rate)) / AS, 0.0, 4e-6);
    bst_assert_close(o->sigma_rad * range_of(k), 300.0, 1e-9);
    bst_assert_close(o->rate_sigma_radps * range_of(k), 0.7, 1e-12);
    assert_true(k == 2 ? o->v_mag_sigma == INFINITY && o->v_mag == 0.0
                       : o->v_mag_sigma == 0.4 && o->v_mag == 8.0 + k);
}

/* All that can be seen within the cone, without the cue, the spacecraft and what has no light, no
 * orbit or the Earth before it; the last is outside of the cone by half a degree. */
static void what_is_in_the_cone(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_tracker_catalogue *c = create(&ctx);
    const bst_tracker_search search = {.axis = axis, .half_angle_rad = 0.75 * HALF_RAD};
    bst_identity_object out[BST_IDENTITY_OBJECTS];
    int left_out = -1,
        count = bst_tracker_catalogue_near(c, &search, out, BST_IDENTITY_OBJECTS, &left_out);
    assert_int_equal(count, 3);
    assert_int_equal(left_out, 0);
    for (int i = 0; i < count; i++) {
        assert_int_equal(out[i].object, 2 - i);
        check_object(&out[i]);
    }
    assert_true(asked_s == NOW_S && asked_half_rad == search.half_angle_rad);
    bst_assert_close(asked_axis_off, 0.0, 1e-15);
    assert_false(bst_tracker_catalogue_failed(c));
    assert_int_equal(bst_tracker_catalogue_set(c, -1.0, 0.0), CUE);
    assert_int_equal(bst_tracker_catalogue_near(c, &search, out, 3, &left_out), -1);
    assert_true(bst_tracker_catalogue_failed(c));
    bst_tracker_catalogue_free(c);
}

/* Too little room: those nearest to the axis stay, or nearest to any of the tracks. */
static void the_nearest_have_the_room(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_tracker_catalogue *c = create(&ctx);
    const bst_vec3 tracks[2] = {direction_of(3, NOW_S + 4.0), direction_of(1, NOW_S + 2.0)};
    static const int nearest[2][3] = {{0, 1, 2}, {1, 3, 0}}; /* to the axis, to the tracks */
    for (int k = 0; k < 2; k++) {
        for (int room = 1; room <= 4; room++) {
            bst_identity_object out[4];
            int left_out = -1, of_them = 0;
            const bst_tracker_search search = {
                .axis = axis, .half_angle_rad = HALF_RAD, .tracks = tracks, .track_count = 2 * k};
            assert_int_equal(bst_tracker_catalogue_near(c, &search, out, room, &left_out), room);
            assert_int_equal(left_out, 4 - room);
            for (int i = 0; i < room; i++) {
                for (int n = 0; n < room && n < 3; n++) {
                    of_them += out[i].object == nearest[k][n];
                }
                check_object(&out[i]);
            }
            assert_int_equal(of_them, room < 4 ? room : 3);
        }
    }
    bst_tracker_catalogue_free(c);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_in_the_cone),
                                       cmocka_unit_test(the_nearest_have_the_room)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
