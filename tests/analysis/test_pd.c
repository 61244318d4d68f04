/* A detector that is not Boresight's, measured by pd: a 5 x 5 sum over a fixed threshold; and
 * modules that pd cannot drive. */
#include "sim/analysis/pd/pd.h"
#include "sim/eval/detection_theory.h"
#include "sim/registry/registry.h"
#include "tests/test_support.h"

enum { PORT_FRAME, PORT_OUT, CAPACITY = 4096 };

typedef struct sum_config {
    double threshold_dn;
    bool silent;
} sum_config;

static const bst_config_desc sum_table[] = {
    BST_REAL(sum_config, threshold_dn, "DN", 0, 1e6, "0", "Sum above 25 offsets."),
    BST_BOOL(sum_config, silent, "false", "Never answers."),
    BST_CONFIG_END,
};

static const bst_port sum_ports[] = {
    {BST_CHANNEL_FRAME, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, CAPACITY},
};
static const bst_port needy_ports[] = {
    {BST_CHANNEL_FRAME, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    {BST_CHANNEL_TRUTH, BST_PORT_IN, 0, 0.0, 0},
    {BST_CHANNEL_DETECTIONS, BST_PORT_OUT, 0, 0.0, CAPACITY},
};

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    *self = (void *)(uintptr_t)config; /* read only */
    return BST_OK;
}

static void destroy(void *self) {
    (void)self;
}

static double sum_at(const uint16_t *p, int width, int x, int y) {
    double sum = 0;
    for (int j = -2; j <= 2; j++) {
        for (int i = -2; i <= 2; i++) {
            sum += p[(y + j) * width + x + i];
        }
    }
    return sum - 25 * 500.0;
}

/* Local maxima of the sum. */
static void find(const uint16_t *pixels, int width, int height, double threshold,
                 bst_detections *out) {
    out->count = out->lost = 0;
    for (int y = 3; y < height - 3; y++) {
        for (int x = 3; x < width - 3; x++) {
            double s = sum_at(pixels, width, x, y);
            bool top = s > threshold;
            for (int j = -1; j <= 1 && top; j++) {
                for (int i = -1; i <= 1 && top; i++) {
                    top = s >= sum_at(pixels, width, x + i, y + j);
                }
            }
            if (top && out->count < CAPACITY) {
                out->items[out->count++] = (bst_detection){
                    .x_px = x, .y_px = y, .cov_xx = 1, .cov_yy = 1, .flux_e = 1.6 * s};
            }
        }
    }
}

static bst_status step(void *self, struct bst_step *step_) {
    const sum_config *c = self;
    bst_sample sample;
    while ((sample = bst_step_next(step_, PORT_FRAME)).payload) {
        const bst_frame_message *m = sample.payload;
        const uint16_t *pixels;
        if (c->silent) {
            continue;
        }
        BST_TRY(bst_frame_map(m->frame, bst_step_ctx(step_), &pixels));
        bst_detections *out = bst_step_write(step_, PORT_OUT, NULL);
        out->exposure_id = m->exposure_id;
        find(pixels, m->frame->width, m->frame->height, c->threshold_dn, out);
        bst_frame_unmap(m->frame);
    }
    return BST_OK;
}

#define SUM_DESC(type_, ports_)                                                          \
    {                                                                                    \
        .abi = BST_MODULE_ABI, .role = "imgproc", .type = type_, .doc = "A test's.",     \
        .config = sum_table, .config_bytes = sizeof(sum_config), .ports = ports_,        \
        .port_count = sizeof(ports_) / sizeof *(ports_), .create = create, .step = step, \
        .destroy = destroy                                                               \
    }
static const bst_module_desc sum_module = SUM_DESC("sum", sum_ports),
                             needy_module = SUM_DESC("needy", needy_ports);

typedef struct bench {
    bst_ctx ctx;
    bst_json *json;
    bst_scenario scenario;
    bst_pd_scene *scene;
    bst_pd_result *result;
} bench;

static const bst_pd_options options = {.low = 2,
                                       .high = 24,
                                       .step = 2,
                                       .trials = 120,
                                       .empty_frames = 8,
                                       .background_e = -1,
                                       .jitter_px = 0,
                                       .min_separation_px = 20,
                                       .cell_px = 40};

static void open_bench(bench *b, const char *imgproc) {
    const bst_scenario_registry *own = bst_registry_shipped();
    const bst_module_desc *modules[32];
    for (int i = 0; i < own->count; i++) {
        modules[i] = own->modules[i];
    }
    modules[own->count] = &sum_module;
    modules[own->count + 1] = &needy_module;
    const bst_scenario_registry registry = {.modules = modules, .count = own->count + 2};
    char set[160];
    snprintf(set, sizeof set, "/observers/0/sensors/0/modules/imgproc=%s", imgproc);
    *b = (bench){.json = NULL};
    bst_assert_ok(&b->ctx,
                  bst_json_load_extended(&b->ctx, "scenarios/neossat_geo_stare.json", &b->json));
    bst_assert_ok(&b->ctx, bst_json_set(&b->ctx, b->json, set));
    bst_assert_ok(&b->ctx,
                  bst_json_set(&b->ctx, b->json, "/observers/0/sensors/0/camera/width_px=256"));
    bst_assert_ok(&b->ctx,
                  bst_json_set(&b->ctx, b->json, "/observers/0/sensors/0/camera/height_px=256"));
    bst_assert_ok(&b->ctx, bst_json_set(&b->ctx, b->json, "/world/star_catalogue=\"embedded\""));
    bst_assert_ok(&b->ctx, bst_scenario_read(&b->ctx, b->json, &registry, &b->scenario));
    b->scene = calloc(1, sizeof *b->scene);
    b->result = calloc(1, sizeof *b->result);
    assert_true(b->scene && b->result);
    bst_assert_ok(&b->ctx, bst_pd_scene_open(&b->ctx, &b->scenario, &options, b->scene));
}

static void close_bench(bench *b) {
    bst_pd_scene_close(b->scene);
    free(b->scene);
    free(b->result);
    bst_scenario_free(&b->scenario);
    bst_json_free(b->json);
}

/* A box of 5 x 5 is no matched filter: it has 92 % of the light at FWHM 2 px and the noise of 25
 * pixels, 0.58 of the best SNR (4.7 dB), of which it gains back by taking the greatest of as many
 * places. */
static void a_box_finds_what_a_box_can(void **state) {
    (void)state;
    bench b;
    bst_pd_detector *detector;
    /* 4 sigma of 25 pixels of 8.15 e- and 1.6 e- per DN, over the sky's mean of 25 x 2.4 e- */
    open_bench(&b, "{\"type\": \"sum\", \"threshold_dn\": 139}");
    bst_assert_ok(&b.ctx, bst_pd_detector_open(&b.ctx, b.scene, &detector));
    bst_assert_ok(&b.ctx, bst_pd_run(&b.ctx, b.scene, detector, b.result));
    bst_pd_figures f;
    bst_pd_figures_of(b.scene, b.result, &f);
    assert_int_equal(b.scene->points, 12);
    for (int i = 0; i < 12; i++) {
        assert_int_equal(b.result->tallies[i].trials, 120);
    }
    assert_true(b.result->tallies[0].matched < 40);       /* SNR 2 */
    assert_int_equal(b.result->tallies[11].matched, 120); /* SNR 24 */
    /* 1 sigma of both is 0.4 dB: 10 false alarms, 120 trials a point */
    assert_true(f.loss_db_pd50 > 0.4 && f.loss_db_pd50 < 3.5);
    assert_true(f.loss_db_pd90 > 0.8 && f.loss_db_pd90 < 4.0);
    /* places are whole pixels, 0.29 px RMS, and noise moves the top of a flat sum; the bound is
     * 0.06 px */
    const bst_pd_tally *t = &b.result->tallies[11];
    double rms = sqrt((t->error_square[0] + t->error_square[1]) / (2.0 * (double)t->matched));
    assert_true(rms > 0.25 && rms < 0.8);
    /* 92 % of the light and 60 e- of sky, on 650 */
    bst_assert_close(t->flux_sum / (double)t->matched, 0.0, 0.2);
    bst_pd_detector_close(detector);
    close_bench(&b);
}

static void a_module_that_never_answers_is_an_error(void **state) {
    (void)state;
    bench b;
    bst_pd_detector *detector;
    open_bench(&b, "{\"type\": \"sum\", \"silent\": true}");
    bst_assert_ok(&b.ctx, bst_pd_detector_open(&b.ctx, b.scene, &detector));
    assert_int_equal(bst_pd_run(&b.ctx, b.scene, detector, b.result), BST_ERR_STATE);
    assert_non_null(strstr(b.ctx.message, "published no detections"));
    bst_pd_detector_close(detector);
    close_bench(&b);
}

static void a_module_that_asks_for_the_truth_is_an_error(void **state) {
    (void)state;
    bench b;
    bst_pd_detector *detector;
    open_bench(&b, "{\"type\": \"needy\"}");
    assert_int_equal(bst_pd_detector_open(&b.ctx, b.scene, &detector), BST_ERR_CONFIG);
    assert_non_null(strstr(b.ctx.message, "truth"));
    assert_null(detector);
    close_bench(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_box_finds_what_a_box_can),
        cmocka_unit_test(a_module_that_never_answers_is_an_error),
        cmocka_unit_test(a_module_that_asks_for_the_truth_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
