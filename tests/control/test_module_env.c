/* What the controller of a module receives about its sensor: the parts around it are replaced here.
 */
#include "control/control.h"
#include "control/modules.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

static bst_camera camera;
static bst_control_env given;
static int knowledge, view, memo;

const bst_camera *__wrap_bst_knowledge_camera(const bst_knowledge *k);
struct bst_memo *__wrap_bst_knowledge_memo(const bst_knowledge *k);
void __wrap_bst_knowledge_region(const bst_knowledge *k, bst_region *out);
bst_status __wrap_bst_knowledge_view_create(bst_ctx *ctx, const bst_knowledge *k,
                                            bst_knowledge_view **out);
void __wrap_bst_knowledge_view_free(bst_knowledge_view *v);
void __wrap_bst_env_ignore(const bst_module_env *env, int port);
bst_status __wrap_bst_control_init(bst_ctx *ctx, bst_control *control,
                                   const bst_control_config *config, const bst_control_env *env);

const bst_camera *__wrap_bst_knowledge_camera(const bst_knowledge *k) {
    assert_ptr_equal(k, &knowledge);
    return &camera;
}

struct bst_memo *__wrap_bst_knowledge_memo(const bst_knowledge *k) {
    assert_ptr_equal(k, &knowledge);
    return (struct bst_memo *)(void *)&memo;
}

void __wrap_bst_knowledge_region(const bst_knowledge *k, bst_region *out) {
    (void)k;
    out->half_length_rad = 0.25;
}

bst_status __wrap_bst_knowledge_view_create(bst_ctx *ctx, const bst_knowledge *k,
                                            bst_knowledge_view **out) {
    (void)ctx;
    assert_ptr_equal(k, &knowledge);
    *out = (bst_knowledge_view *)(void *)&view;
    return BST_OK;
}

void __wrap_bst_knowledge_view_free(bst_knowledge_view *v) {
    assert_ptr_equal(v, &view);
}

void __wrap_bst_env_ignore(const bst_module_env *env, int port) {
    (void)env;
    (void)port;
}

bst_status __wrap_bst_control_init(bst_ctx *ctx, bst_control *control,
                                   const bst_control_config *config, const bst_control_env *env) {
    (void)ctx;
    (void)control;
    (void)config;
    given = *env;
    return BST_OK;
}

static void the_sensor_is_described(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    camera = (bst_camera){.width_px = 900,
                          .height_px = 500,
                          .pixel_scale_arcsec = 4.0,
                          .psf_fwhm_px = 2.0,
                          .rotation_deg = 30.0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    const bst_module_env env = {.ctx = &ctx,
                                .tick_rate_hz = 6000,
                                .knowledge = (const bst_knowledge *)(const void *)&knowledge,
                                .exposure_s = 0.9,
                                .frame_exposure_s = 0.25,
                                .frame_period_s = 0.75,
                                .frame_latency_s = 0.4};
    const bst_control_config config = {.exposure_s = 0.1, .period_s = 0.6};
    void *self;
    bst_assert_ok(&ctx, bst_control_standard_module.create(&env, &config, &self));
    bst_assert_close(given.tick_rate_hz, 6000.0, 0.0);
    bst_assert_close(given.pixel_rad, 4.0 * BST_ARCSEC_RAD, 1e-15);
    bst_assert_close(given.rotation_rad, 30.0 * BST_DEG_RAD, 1e-15);
    assert_int_equal(given.width_px, 900);
    assert_in_range(given.height_px, 499, 500); /* rounded down, behind a turn forth and back */
    bst_assert_close(given.frame_exposure_s, 0.25, 0.0);
    bst_assert_close(given.frame_period_s, 0.75, 0.0);
    bst_assert_close(given.frame_latency_s, 0.4, 0.0);
    bst_assert_close(given.region.half_length_rad, 0.25, 0.0);
    assert_ptr_equal(given.cue_user, &view);
    assert_ptr_equal(given.memo, &memo);
    bst_control_standard_module.destroy(self);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_sensor_is_described)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
