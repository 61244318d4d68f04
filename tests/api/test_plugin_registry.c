/* Stages that the program itself registers, and frames that it keeps beyond the next step. */
#include <stdio.h>
#include <string.h>

#include "boresight/boresight.h"
#include "boresight/plugin.h"
#include "boresight/stages.h"
#include "tests/test_support.h"

static int created, applied, destroyed;

static bst_status create(bst_ctx *ctx, const void *config, const bst_frame_stage_env *env,
                         void **self) {
    (void)ctx;
    (void)config;
    *self = (void *)env->camera;
    created++;
    return BST_OK;
}

static bst_status apply(void *self, bst_ctx *ctx, const bst_frame_stage_frame *frame,
                        uint16_t *pixels) {
    (void)self;
    (void)ctx;
    pixels[0] = (uint16_t)(1000 + frame->exposure_id);
    applied++;
    return BST_OK;
}

static void destroy(void *self) {
    (void)self;
    destroyed++;
}

static const bst_frame_stage functions = {.create = create, .apply = apply, .destroy = destroy};
static const bst_stage_desc stage = {.abi = BST_STAGE_ABI,
                                     .kind = BST_STAGE_FRAME,
                                     .type = "mark",
                                     .doc = "marks a pixel",
                                     .functions = &functions};
static const bst_stage_desc *const stages[] = {&stage, NULL};

static const char digest[] = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";

static const char *const assignments[] = {
    "/record/frames=none", "/observers/0/sensors/0/camera/width_px=128",
    "/observers/0/sensors/0/camera/height_px=96",
    "/observers/0/sensors/0/modules/scenegen/frame_stage={\"plugin\": \"test:mark\"}"};
static const bst_model_options options = {
    .assignments = assignments, .assignment_count = 4, .threads = 1};

static void registered_stages_run(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    bst_sim_frame frame;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    assert_int_equal(bst_model_load(&ctx, "scenarios/neossat_geo_track.json", &options, &model),
                     BST_ERR_CONFIG); /* the name is not registered: it is taken for a path */
    bst_assert_ok(&ctx, bst_plugin_register(&ctx, "test:mark", digest, NULL, stages));
    bst_assert_ok(&ctx, bst_plugin_register(&ctx, "test:mark", digest, NULL, stages)); /* anew */
    bst_assert_ok(&ctx, bst_model_load(&ctx, "scenarios/neossat_geo_track.json", &options, &model));
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, NULL, &sim));
    for (int k = 0; k < 2; k++) {
        bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 10.0, NULL));
        bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &frame));
        assert_int_equal(frame.pixels[0], 1000 + k);
    }
    /* the complete scenario names the plug-in as it was named */
    char *text = NULL;
    bst_assert_ok(&ctx, bst_model_scenario(&ctx, model, &text));
    assert_non_null(strstr(text, "\"test:mark\""));
    bst_text_free(text);
    bst_sim_free(sim);
    bst_model_free(model);
    assert_true(created == 1 && applied >= 2 && destroyed == 1);
    bst_assert_ok(&ctx, bst_plugin_register(&ctx, "test:mark", NULL, NULL, NULL)); /* removed */
    assert_int_equal(bst_model_load(&ctx, "scenarios/neossat_geo_track.json", &options, &model),
                     BST_ERR_CONFIG);
}

static void wrong_plugins_are_refused(void **state) {
    (void)state;
    static const char *const names[] = {"", "noplace", "a/b:c", "a:b c", "a:\xc3\xa4"};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        assert_int_equal(bst_plugin_register(&ctx, names[i], NULL, NULL, stages), BST_ERR_ARGUMENT);
    }
    char name[200];
    memset(name, ':', sizeof name);
    name[121] = '\0';
    assert_int_equal(bst_plugin_register(&ctx, name, NULL, NULL, stages), BST_ERR_ARGUMENT);
    static const char *const digests[] = {"", "0123",
                                          "0123456789abcdef0123456789abcdef0123456789abcdef"
                                          "0123456789abcdeX"};
    for (size_t i = 0; i < sizeof digests / sizeof *digests; i++) {
        assert_int_equal(bst_plugin_register(&ctx, "test:wrong", digests[i], NULL, stages),
                         BST_ERR_ARGUMENT);
    }
    bst_stage_desc other = stage;
    const bst_stage_desc *const wrong[] = {&other, NULL};
    other.abi = BST_STAGE_ABI + 1;
    assert_int_equal(bst_plugin_register(&ctx, "test:wrong", NULL, NULL, wrong), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "test:wrong"));
    other = stage;
    other.kind = "nothing";
    assert_int_equal(bst_plugin_register(&ctx, "test:wrong", NULL, NULL, wrong), BST_ERR_CONFIG);
}

static void held_frames_stay(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    bst_sim_frame frame;
    bst_frame *held = NULL;
    static uint16_t before[96 * 128];
    const bst_model_options plain = {
        .assignments = assignments, .assignment_count = 3, .threads = 1};
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&ctx, bst_model_load(&ctx, "scenarios/neossat_geo_track.json", &plain, &model));
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, NULL, &sim));
    bst_assert_ok(&ctx, bst_sim_step(&ctx, sim, NULL, "frame", 10.0, NULL));
    bst_assert_ok(&ctx, bst_sim_view_frame(&ctx, sim, NULL, &frame));
    bst_assert_ok(&ctx, bst_sim_hold_frame(&ctx, &frame, &held));
    memcpy(before, frame.pixels, sizeof before);
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, 30.0)); /* more frames than the pool has */
    assert_memory_equal(before, frame.pixels, sizeof before);
    bst_sim_free(sim);
    assert_memory_equal(before, frame.pixels, sizeof before);
    bst_sim_release_frame(held);
    bst_sim_release_frame(NULL);
    bst_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registered_stages_run),
        cmocka_unit_test(wrong_plugins_are_refused),
        cmocka_unit_test(held_frames_stay),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
