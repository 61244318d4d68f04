/* What the modules of a simulation are given to know, sensor by sensor, and what a module takes
 * over from those that it stands in for. No two sensors are alike. */
#include "sim/engine/simulation.h"

#include "sim/engine/scenario/loop_timing.h"
#include "sim/engine/scenario/module_substitution.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

typedef struct settings {
    double threshold, sigma, own;
    int64_t size;
    char word[16];
} settings;

typedef struct command {
    double exposure_s, period_s;
} command;

/* What each module was made with. */
typedef struct made {
    char instance[64];
    bst_module_env env;
    int64_t width_px;
    settings config;
} made;

static made list[40];
static int count;

static bst_status keep(const bst_module_env *env, const void *config, size_t bytes, void **self) {
    made *m = &list[count++];
    assert_true(count <= 40);
    snprintf(m->instance, sizeof m->instance, "%s", env->instance);
    m->env = *env;
    m->width_px = bst_knowledge_camera(env->knowledge)->width_px;
    memcpy(&m->config, config, bytes);
    *self = m;
    return BST_OK;
}

static bst_status create_settings(const bst_module_env *env, const void *config, void **self) {
    return keep(env, config, sizeof(settings), self);
}
static bst_status create_plain(const bst_module_env *env, const void *config, void **self) {
    return keep(env, config, 0, self);
}
static bst_status rest(void *self, struct bst_step *step) {
    (void)self;
    (void)step;
    return BST_OK;
}
static void destroy(void *self) {
    (void)self;
}

static const made *find(const char *instance) {
    for (int i = 0; i < count; i++) {
        if (strcmp(list[i].instance, instance) == 0) {
            return &list[i];
        }
    }
    return NULL;
}

/* `own` is the generator's alone; a camera's `size` is a number of another type. */
static const bst_config_desc generator_table[] = {
    BST_REAL(settings, threshold, "", 0, 100, "1", "Threshold."),
    BST_REAL(settings, sigma, "", 0, 100, "2", "Sigma."),
    BST_REAL(settings, own, "", 0, 100, "3", "Own."),
    BST_INT(settings, size, "", 0, 100, "4", "Size."),
    BST_STRING(settings, word, "\"five\"", "Word."),
    BST_CONFIG_END};
typedef struct camera_settings {
    char pad[24];
    double size;
    double sigma;
} camera_settings;
static const bst_config_desc camera_table[] = {
    BST_REAL(camera_settings, sigma, "", 0, 100, "20", "Sigma."),
    BST_REAL(camera_settings, size, "", 0, 100, "40", "Size."), BST_CONFIG_END};
typedef struct finder_settings {
    char word[16];
    double threshold;
} finder_settings;
static const bst_config_desc finder_table[] = {
    BST_REAL(finder_settings, threshold, "", 0, 100, "10", "Threshold."),
    BST_STRING(finder_settings, word, "\"fifty\"", "Word."), BST_CONFIG_END};
static const bst_config_desc command_table[] = {
    BST_REAL(command, exposure_s, "s", 0, 100, "0", "Exposure."),
    BST_REAL(command, period_s, "s", 0, 100, "0", "Period."), BST_CONFIG_END};

static const bst_port camera_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_FRAME, .direction = BST_PORT_OUT}};
static const bst_port finder_ports[] = {
    {.channel = BST_CHANNEL_FRAME, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_OUT}};
static const bst_port generator_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_OUT}};
static const bst_port tracker_ports[] = {
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_TRACKS, .direction = BST_PORT_OUT}};
static const bst_port control_ports[] = {
    {.channel = BST_CHANNEL_TRACKS, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_LOS_COMMAND, .direction = BST_PORT_OUT},
    {.channel = BST_CHANNEL_SENSOR_COMMAND, .direction = BST_PORT_OUT}};
static const bst_port gimbal_ports[] = {
    {.channel = BST_CHANNEL_LOS_COMMAND, .direction = BST_PORT_IN, .flags = BST_PORT_FEEDBACK},
    {.channel = BST_CHANNEL_LOS_HISTORY, .direction = BST_PORT_OUT}};

#define MODULE(role_, table_, bytes_, ports_, create_)                                            \
    {                                                                                             \
        .abi = BST_MODULE_ABI, .role = role_, .type = "fake", .doc = "A fake.", .config = table_, \
        .config_bytes = bytes_, .ports = ports_, .port_count = sizeof(ports_) / sizeof *(ports_), \
        .create = create_, .step = rest, .destroy = destroy                                       \
    }
static const char *const substitutes_for[] = {"scenegen", "imgproc", NULL};
static const bst_module_desc camera_desc = MODULE("scenegen", camera_table, sizeof(camera_settings),
                                                  camera_ports, create_plain),
                             finder_desc = MODULE("imgproc", finder_table, sizeof(finder_settings),
                                                  finder_ports, create_plain),
                             tracker_desc = MODULE("tracker", NULL, 0, tracker_ports, create_plain),
                             control_desc = MODULE("control", command_table, sizeof(command),
                                                   control_ports, create_plain),
                             gimbal_desc = MODULE("gimbal", NULL, 0, gimbal_ports, create_plain),
                             generator_desc = {.abi = BST_MODULE_ABI,
                                               .role = "obsgen",
                                               .type = "fake",
                                               .doc = "Stands in.",
                                               .config = generator_table,
                                               .config_bytes = sizeof(settings),
                                               .ports = generator_ports,
                                               .port_count = 2,
                                               .create = create_settings,
                                               .step = rest,
                                               .destroy = destroy,
                                               .substitutes_for = substitutes_for};
static const bst_module_desc *const modules[] = {&camera_desc,  &finder_desc, &tracker_desc,
                                                 &control_desc, &gimbal_desc, &generator_desc};
static const bst_scenario_registry registry = {.modules = modules, .count = 6};

#define ORBIT "\"orbit\": {\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089}"
#define CAMERA(width, more)             \
    "\"camera\": {\"width_px\": " width \
    ", \"height_px\": 480, \"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15" more "}"
#define IMAGES                                                                               \
    "\"scenegen\": {\"type\": \"fake\", \"sigma\": 21, \"delay_s\": {\"exposure\": 0.01}}, " \
    "\"imgproc\": {\"type\": \"fake\", \"threshold\": 11, \"word\": \"fifteen\", "           \
    "\"delay_s\": {\"frame\": 0.05}}, "
#define LOOP(control, gimbal)                                                               \
    "\"tracker\": {\"type\": \"fake\", \"delay_s\": {\"detections\": 0.02}}, \"control\": " \
    "{\"type\": \"fake\"" control                                                           \
    ", \"delay_s\": {\"tracks\": 0.03}}, \"gimbal\": {\"type\": \"fake\"" gimbal "}"

static const char scenario_text[] =
    "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 300, \"run\": 7, "
    "\"seed\": \"0x1234\", \"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": ["
    "{\"name\": \"A\", " ORBIT ", \"sensors\": ["
    "{\"name\": \"s0\", " CAMERA("640", "") ", \"exposure\": {\"exposure_s\": 0.5, \"period_s\": "
    "1}, \"modules\": {" IMAGES LOOP(", \"exposure_s\": 0.8",
                                     ", \"rate_hz\": 50, \"offset_s\": 0.004, \"delay_s\": "
                                     "{\"los_command\": 0.007}")
    ", \"obsgen\": {\"type\": \"fake\", \"own\": 6}}}, "
    "{\"name\": \"s1\", " CAMERA("320", "") ", \"observation_source\": \"generator\", "
    "\"exposure\": {\"exposure_s\": 0.5, \"period_s\": 2}, \"modules\": {" IMAGES LOOP(
        ", \"exposure_s\": 0.3, \"period_s\": 0.2", ", \"rate_hz\": 100") "}}]}, "
    "{\"name\": \"B\", " ORBIT ", \"sensors\": [{\"name\": \"s0\", " CAMERA(
        "512", ", \"detector\": {\"row_time_s\": 1e-4}") ", \"exposure\": {\"exposure_s\": 0.25, "
    "\"period_s\": 1, \"first_s\": 0.1}, \"modules\": {" IMAGES LOOP(
        "", ", \"rate_hz\": 20, \"offset_s\": 0.01") "}}]}]}";

static bst_status read_text(bst_ctx *ctx, const bst_scenario_registry *known, const char *text,
                            bst_scenario *scenario, bst_json **json) {
    bst_assert_ok(ctx, bst_json_parse(ctx, "scenarios/x.json", text, strlen(text), json));
    return bst_scenario_read(ctx, *json, known, scenario);
}

static void every_sensor_s_modules_know_their_own(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario scenario;
    bst_simulation *sim;
    const bst_simulation_options options = {0};
    count = 0;
    bst_assert_ok(&ctx, read_text(&ctx, &registry, scenario_text, &scenario, &json));
    bst_assert_ok(&ctx, bst_simulation_create(&ctx, &scenario, &options, &sim));
    static const struct {
        const char *scope;
        int observer, sensor;
        int64_t width, los_period, los_offset;
        double exposure_s, frame_exposure_s, frame_period_s;
    } expected[] = {
        /* what control commands is longer; 50 Hz at 6000 ticks a second */
        {"A/s0", 0, 0, 640, 120, 24, 0.8, 0.8, 1.0},
        /* shorter, and a period that the exposure does not fit into */
        {"A/s1", 0, 1, 320, 60, 0, 0.5, 0.3, 0.3},
        /* 479 rows of 0.1 ms from the first to the last */
        {"B/s0", 1, 0, 512, 300, 60, 0.25 + 0.0479, 0.25, 1.0},
    };
    for (int i = 0; i < 3; i++) {
        static const char *const roles[] = {"tracker", "control", "gimbal"};
        for (int r = 0; r < 3; r++) {
            char name[64];
            snprintf(name, sizeof name, "%s/%s", expected[i].scope, roles[r]);
            const made *m = find(name);
            assert_non_null(m);
            assert_int_equal(m->env.observer, expected[i].observer);
            assert_int_equal(m->env.sensor, expected[i].sensor);
            assert_int_equal(m->width_px, expected[i].width);
            assert_int_equal(m->env.los_period_ticks, expected[i].los_period);
            assert_int_equal(m->env.los_offset_ticks, expected[i].los_offset);
            bst_assert_close(m->env.exposure_s, expected[i].exposure_s, 1e-12);
            bst_assert_close(m->env.frame_exposure_s, expected[i].frame_exposure_s, 1e-12);
            bst_assert_close(m->env.frame_period_s, expected[i].frame_period_s, 1e-12);
            /* 0.01 + 0.05 + 0.02 + 0.03, with the generator in the place of two as well */
            bst_assert_close(m->env.frame_latency_s, 0.11, 1e-12);
            assert_int_equal(m->env.seed, 0x1234);
            assert_int_equal(m->env.run, 7);
            assert_int_equal(m->env.tick_rate_hz, 6000);
            assert_null(m->env.world); /* no descriptor says that it reads the truth */
            assert_null(m->env.link);
            assert_null(m->env.members);
        }
        assert_int_equal(find("A/s0/gimbal")->env.period_ticks, 120);
    }
    /* either the camera and its image processing, or the generator */
    assert_true(find("A/s0/scenegen") && find("A/s0/imgproc") && !find("A/s0/obsgen"));
    assert_true(!find("A/s1/scenegen") && !find("A/s1/imgproc") && find("A/s1/obsgen"));
    assert_true(find("B/s0/scenegen") && find("B/s0/imgproc") && !find("B/s0/obsgen"));
    const settings *taken = &find("A/s1/obsgen")->config;
    bst_assert_close(taken->threshold, 11, 0);
    bst_assert_close(taken->sigma, 21, 0);
    bst_assert_close(taken->own, 3, 0);
    assert_int_equal(taken->size, 4); /* a camera's size is a real number */
    assert_string_equal(taken->word, "fifteen");
    bst_simulation_free(sim);
    for (int m = 0; m < scenario.module_count; m++) {
        const bst_scenario_module_config *module = &scenario.modules[m];
        if (strcmp(module->name, "obsgen") == 0 && module->sensor == 1) {
            /* what processing waits for the frame, it waits for the exposure */
            assert_int_equal(module->delay_count, 1);
            assert_int_equal(module->delays[0].port, 0);
            assert_int_equal(module->delays[0].ticks, 360);
            assert_true(bst_module_substitution_delayed(&scenario, module));
            assert_true(bst_module_substitution_taken(&scenario, module, "sigma"));
            assert_true(bst_module_substitution_taken(&scenario, module, "threshold"));
            assert_false(bst_module_substitution_taken(&scenario, module, "own"));
            assert_false(bst_module_substitution_taken(&scenario, module, "size"));
            assert_false(bst_module_substitution_taken(&scenario, module, "nothing"));
        } else if (strcmp(module->name, "tracker") == 0) {
            assert_false(bst_module_substitution_delayed(&scenario, module));
        }
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* A command is read at the gimbal's next step after the middle of the exposure, the frame's latency
 * and its own delay. */
static void times_in_the_loop(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario scenario;
    bst_assert_ok(&ctx, read_text(&ctx, &registry, scenario_text, &scenario, &json));
    static const double expected[3][5] = {
        /* 0.4 + 0.11 + 0.007 = 0.517: at 0.52 */
        {0.8, 1.0, 0.11, 0.01, 0.02},
        /* 0.15 + 0.11 and a tick: at 0.27 */
        {0.3, 0.3, 0.11, 0.01, 0.01},
        /* 0.125 + 0.11 and a tick: at 0.25 */
        {0.25, 1.0, 0.11, 0.015, 0.05},
    };
    for (int i = 0; i < 3; i++) {
        bst_loop_timing t;
        bst_loop_timing_of(&scenario, i / 2, i % 2, &t);
        bst_assert_close(t.exposure_s, expected[i][0], 1e-12);
        bst_assert_close(t.period_s, expected[i][1], 1e-12);
        bst_assert_close(t.frame_latency_s, expected[i][2], 1e-12);
        bst_assert_close(t.command_delay_s, expected[i][3], 1e-12);
        bst_assert_close(t.gimbal_period_s, expected[i][4], 1e-12);
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

#define ONE(source, modules_)                                                           \
    "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 300, " \
    "\"observers\": [{\"name\": \"A\", " ORBIT                                          \
    ", \"sensors\": [{" CAMERA("64", "") ", \"observation_source\": \"" source          \
                                         "\", \"modules\": {" modules_ "}}]}]}"

static void what_is_said_twice(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
        int known;
    } cases[] = {
        {ONE("generator", IMAGES "\"obsgen\": {\"type\": \"fake\", \"sigma\": 4}"),
         "/observers/0/sensors/0/modules/obsgen/sigma: given twice", 6},
        {ONE("image", IMAGES "\"obsgen\": {\"type\": \"fake\", \"threshold\": 4}"),
         "it is the \"threshold\" of this sensor's imgproc", 6},
        {ONE("generator",
             IMAGES "\"obsgen\": {\"type\": \"fake\", \"delay_s\": {\"exposure\": 0.1}}"),
         "modules/obsgen/delay_s: given twice", 6},
        {ONE("generator", ""), "observation_source: there is no module that generates observations",
         5},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const bst_scenario_registry known = {.modules = modules, .count = cases[i].known};
        bst_ctx ctx = {0};
        bst_json *json;
        bst_scenario scenario;
        assert_int_equal(read_text(&ctx, &known, cases[i].text, &scenario, &json), BST_ERR_CONFIG);
        if (!strstr(ctx.message, cases[i].words)) {
            fail_msg("%s", ctx.message);
        }
        bst_scenario_free(&scenario);
        bst_json_free(json);
    }
    /* alone it has its own delays and settings */
    bst_ctx ctx = {0};
    bst_json *json;
    bst_scenario scenario;
    bst_assert_ok(&ctx, read_text(&ctx, &registry,
                                  ONE("generator",
                                      "\"obsgen\": {\"type\": \"fake\", \"sigma\": 4, "
                                      "\"delay_s\": {\"exposure\": 0.1}}"),
                                  &scenario, &json));
    assert_int_equal(scenario.module_count, 1);
    assert_int_equal(scenario.modules[0].delays[0].ticks, 600);
    assert_false(scenario.modules[0].off);
    bst_assert_close(((const settings *)scenario.modules[0].config)->sigma, 4, 0);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_sensor_s_modules_know_their_own),
        cmocka_unit_test(times_in_the_loop),
        cmocka_unit_test(what_is_said_twice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
