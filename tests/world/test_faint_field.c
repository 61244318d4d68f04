/* Statistical stars through the field query: single stars, background, and an onboard side that
 * does not know them. */
#include <stdlib.h>

#include "sim/catalogue/faint_stars.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/scene/field.h"
#include "tests/world/world_support.h"

static bst_world *world_with_faint(const char *faint) {
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\"%s}, \"observers\": [{\"name\": "
             "\"neossat\", " TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA
             ", \"cue\": {\"direction_radec_deg\": [266.0, -10.0]}}]}]}",
             faint);
    return test_world(text);
}

/* Through the field query: single stars, background, and an onboard side that knows nothing. */
static void field_query_has_them(void **state) {
    (void)state;
    enum { CASES = 4 };
    const char *faint[CASES] = {"", ", \"faint_stars\": \"statistical\", \"faint_limit_v_mag\": 13",
                                ", \"faint_stars\": \"statistical\", \"faint_limit_v_mag\": 15",
                                ", \"faint_stars\": \"statistical\", \"faint_limit_v_mag\": 19"};
    double background[CASES], light[CASES];
    int drawn[CASES] = {0};
    for (int i = 0; i < CASES; i++) {
        bst_ctx ctx = {0};
        bst_world *world = world_with_faint(faint[i]);
        bst_field *field;
        bst_assert_ok(&ctx, bst_field_create(&ctx, world, 0, 0, &field));
        bst_los_history *history = calloc(1, sizeof *history + 4 * sizeof *history->items);
        history->capacity = 4;
        history->written = 2;
        bst_quat q = bst_world_body_attitude(world, 0, 0);
        history->items[0] = (bst_los_sample){0, q};
        history->items[1] = (bst_los_sample){6000, q};
        bst_los_track track;
        bst_truth truth = {0};
        const bst_scene_source *sources;
        int count;
        /* the renderer's own limit is 16: what lies between goes to the background */
        bst_field_options options = {.v_limit = 16, .margin_px = 0};
        bst_assert_ok(&ctx, bst_field_track(&ctx, field, history, 0, 6000, 6000, &track));
        bst_assert_ok(&ctx, bst_field_query(&ctx, field, &track, 0, 6000, 6000,
                                            (bst_window){0, 0, 1024, 1024}, &options, &truth,
                                            &sources, &count));
        background[i] = truth.background_e;
        light[i] = 0;
        for (int k = 0; k < count; k++) {
            if (sources[k].id & BST_FAINT_ID_BIT) {
                drawn[i]++;
                light[i] += sources[k].electrons_per_s;
                assert_true(sources[k].v_mag > 9 && sources[k].v_mag <= 16);
            }
        }
        bst_knowledge *knowledge;
        bst_assert_ok(&ctx, bst_knowledge_create(&ctx, world, 0, 0, &knowledge));
        assert_ptr_equal(bst_knowledge_stars(knowledge), bst_world_stars(world));
        bst_knowledge_free(knowledge);
        free(history);
        bst_field_free(field);
        bst_world_free(world);
    }
    assert_true(drawn[0] == 0 && drawn[1] > 50 && drawn[2] > 2 * drawn[1]);
    assert_true(drawn[3] > drawn[2]);
    for (int i = 1; i < CASES; i++) {
        double per_px = light[i] / (1024.0 * 1024.0);
        double all = light[1] / (1024.0 * 1024.0) + background[1] - background[0];
        assert_true(background[i] > background[0]);
        /* the same light in all; the brightest few stars vary, but they are in all three: what
         * moves is fainter than V 13, of which the field has thousands */
        bst_assert_close(per_px + background[i] - background[0], all, 0.06 * all);
    }
    assert_true(background[1] > background[2] && background[2] > background[3]);
}

/* A limit brighter than the catalogue's: the stars between are in the background. */
static void stars_left_out_are_in_the_background(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_with_faint(", \"faint_stars\": \"statistical\"");
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    bst_field *field;
    bst_assert_ok(&ctx, bst_field_create(&ctx, world, 0, 0, &field));
    bst_los_history *history = calloc(1, sizeof *history + 2 * sizeof *history->items);
    history->capacity = 2;
    history->written = 2;
    history->items[0] = (bst_los_sample){0, bst_world_body_attitude(world, 0, 0)};
    history->items[1] = (bst_los_sample){6000, history->items[0].q_cam_from_gcrf};
    bst_los_track track;
    bst_assert_ok(&ctx, bst_field_track(&ctx, field, history, 0, 6000, 6000, &track));
    double background[2];
    const double limits[2] = {16, 7};
    for (int i = 0; i < 2; i++) {
        bst_truth truth = {0};
        const bst_scene_source *sources;
        int count;
        bst_field_options options = {.v_limit = limits[i]};
        bst_assert_ok(&ctx, bst_field_query(&ctx, field, &track, 0, 6000, 6000,
                                            (bst_window){0, 0, 1024, 1024}, &options, &truth,
                                            &sources, &count));
        background[i] = truth.background_e;
    }
    /* all the light between the limits, by the table at the window's centre: the catalogue is
     * complete to V 9 and the statistical stars go on from there */
    bst_vec3 centre = bst_quat_rotate(bst_quat_conj(history->items[0].q_cam_from_gcrf),
                                      bst_camera_unproject(camera, 511.5, 511.5));
    bst_star_counts counts;
    bst_star_counts_at(centre, &counts);
    double pixel_deg = camera->pixel_scale_arcsec / 3600;
    double light = bst_star_counts_light(&counts, 7, 16) * pixel_deg * pixel_deg *
                   bst_camera_electrons_per_s(camera, 0);
    /* the zone's own count of catalogue stars beyond the limit takes the place of the table's */
    bst_assert_close(background[1] - background[0], light, 1e-6 * light);
    free(history);
    bst_field_free(field);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(field_query_has_them),
        cmocka_unit_test(stars_left_out_are_in_the_background),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
