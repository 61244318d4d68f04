#include "sim/analysis/shape/light_curve_rows.h"
#include "sim/bench/bench.h"
#include "sim/world/world_config.h"

#define WING(name_, y_)                                                            \
    ", {\"name\": \"wing_" name_                                                   \
    "\", \"kind\": \"plate\", \"size_m\": [2.4, 14.3, 1], \"position_m\": [0, " y_ \
    ", 0], \"material\": \"cell\", \"back_material\": \"back\", \"joint\": \"array\"}"
#define DISH(name_, x_, tilt_)                                                          \
    ", {\"name\": \"dish_" name_                                                        \
    "\", \"kind\": \"dish\", \"radius_m\": 1.1, \"length_m\": 0.28, \"segments\": 24, " \
    "\"position_m\": [" x_ ", 0, 1.6], \"rotation_deg\": [0, " tilt_                    \
    ", 0], \"material\": \"paint\", \"back_material\": \"back\"}"
#define MAST(name_, at_)                                                                   \
    ", {\"name\": \"mast_" name_                                                           \
    "\", \"kind\": \"cylinder\", \"radius_m\": 0.2, \"length_m\": 1.5, \"segments\": 24, " \
    "\"position_m\": [" at_ ", 2.7], \"material\": \"paint\"}"

/* A communication satellite of some 500 facets in the geostationary orbit, seen from a low orbit: a
 * bus, wings that follow the Sun, two dishes, and masts that shade them. */
static const char scenario[] =
    "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"seen\", \"orbit\": "
    "{\"tle_line1\": \"1 44801U 19080B   22167.00079919  .00000075  00000+0  00000+0 0  9998\", "
    "\"tle_line2\": \"2 44801   0.0366 343.6423 0001933 100.2390 191.6441  1.00270919  9442\"}, "
    "\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": ["
    "{\"name\": \"foil\", \"library\": \"mli_gold\"}, {\"name\": \"paint\", \"library\": "
    "\"white_paint\"}, {\"name\": \"cell\", \"library\": \"solar_cell\"}, {\"name\": \"back\", "
    "\"library\": \"panel_back\"}], \"joints\": [{\"name\": \"array\", \"follows\": \"sun\", \"axis\": "
    "[0, 1, 0], \"normal\": [0, 0, 1]}], \"parts\": ["
    "{\"name\": \"bus\", \"kind\": \"box\", \"size_m\": [2.4, 2.9, 4], \"material\": \"foil\"}"
    WING("north", "-9.75") WING("south", "9.75") DISH("east", "2.6", "-15")
    DISH("west", "-2.6", "15") MAST("1", "0.8, 0.8") MAST("2", "-0.8, 0.8")
    MAST("3", "0.8, -0.8") MAST("4", "-0.8, -0.8") "]}}, {\"name\": \"observer\", \"orbit\": "
    "{\"tle_line1\": \"1 39089U 13009D   22166.78481540  .00000151  00000+0  68433-4 0  9990\", "
    "\"tle_line2\": \"2 39089  98.4228   3.1337 0010095 284.4434  75.5631 14.34664650486975\"}}]}, "
    "\"observers\": []}";

typedef struct scene {
    bst_world_config world;
    bst_config_list observers;
} scene;

static const bst_config_desc scene_table[] = {
    BST_OBJECT(scene, world, bst_world_config_table, "{}", "The world."),
    BST_LIST(scene, observers, bst_observer_config, bst_observer_config_table, 0, 1, "[]",
             "Observers."),
    BST_CONFIG_END};

static bst_status make_world(bst_ctx *ctx, bst_time epoch, bst_world **world) {
    bst_json *json = NULL;
    scene s = {.observers = {.count = 0}};
    BST_TRY(bst_json_parse(ctx, "bench", scenario, sizeof scenario - 1, &json));
    bst_status status = bst_config_read(ctx, json, bst_json_root(json), "", scene_table, &s);
    if (status == BST_OK) {
        status = bst_world_create(ctx, "bench", &s.world, &s.observers, "", epoch, world);
        bst_config_free(scene_table, &s);
    }
    bst_json_free(json);
    return status;
}

bst_status bst_bench_lightcurve(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    enum { ROWS = 16384, ROUNDS = 3 };
    static bst_light_curve_row rows[ROWS];
    bst_light_curve_request request = BST_LIGHT_CURVE_DEFAULTS;
    bst_light_curve c = {.request = &request, .object = 0, .observer = -1, .observing_object = 1};
    bst_bench_clock clock = {.count = 0};
    request.step_s = 1.0;
    BST_TRY(bst_time_from_utc(ctx, "2022-06-16T02:00:00Z", &c.epoch));
    bst_status status = make_world(ctx, c.epoch, &c.world);
    for (int i = 0; i < ROUNDS && status == BST_OK; i++) {
        bst_bench_start(&clock);
        status = bst_light_curve_rows(ctx, &c, options->threads, ROWS, rows);
        bst_bench_stop(&clock, ROWS);
    }
    if (status == BST_OK) {
        bst_bench_summarise(&clock, out);
    }
    bst_world_free(c.world);
    return status;
}
