#include "sim/analysis/check/check_bodies.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "control/control.h"
#include "gimbal/ideal.h"
#include "sim/analysis/check/boresight_sky.h"
#include "sim/analysis/check/check_reach.h"
#include "sim/analysis/check/check_spans.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/scene/skylight.h"
#include "sim/world/scene/stray.h"
#include "sim/world/world_config.h"

#define LEAST_STEP_S 0.5
#define MOST_STEP_S 10.0
#define EDGE_S 0.1
enum { MOST_SPANS = 1000 };

static const char *const warnings[BST_FIELD_BODIES] = {
    "the Earth is in the field", "the Moon is in the field", "the Sun is in the field",
    "the sky at the boresight, brightened by the Earth's limb or stray light, exceeds the full "
    "well in an exposure"};

/* Known pointing of a sensor. */
typedef enum gaze { GAZE_UNKNOWN, GAZE_CUE, GAZE_STARE, GAZE_IDEAL } gaze;

typedef struct looking {
    int observer, sensor;
    gaze gaze;
    double stare_s;
    const bst_ideal_config *ideal;
    int object;
    bst_knowledge *knowledge;
    bst_knowledge_view *cue;
    bst_world_view *view;
    const bst_world *world;
    double half_rad; /* from the boresight to the most distant corner */
    double exposure_s;
    bst_boresight_sky *sky; /* NULL: the background is uniform and constant */
} looking;

/* Checks whether a module changes the sensors' targets during a run. */
static bool has_tasking(const bst_scenario *scenario) {
    for (int m = 0; m < scenario->module_count; m++) {
        if (!scenario->modules[m].off && strcmp(scenario->modules[m].desc->role, "tasking") == 0) {
            return true;
        }
    }
    return false;
}

/* How the sensor's pointing can be predicted: ideal gimbal, cue, stare, or not at all. */
static gaze gaze_of(const bst_scenario *scenario, looking *l) {
    const bst_scenario_module_config *gimbal =
        bst_scenario_module(scenario, l->observer, l->sensor, "gimbal");
    const bst_scenario_module_config *control =
        bst_scenario_module(scenario, l->observer, l->sensor, "control");
    if (gimbal && gimbal->desc->config == bst_ideal_config_table) {
        l->ideal = gimbal->config;
        l->object = l->ideal->target == BST_IDEAL_OBJECT
                        ? bst_world_find_object(l->world, l->ideal->object)
                        : -1;
        return l->object >= 0 || l->ideal->target == BST_IDEAL_DIRECTION ? GAZE_IDEAL
                                                                         : GAZE_UNKNOWN;
    }
    if (!gimbal || !control || has_tasking(scenario) ||
        control->desc->config != bst_control_config_table ||
        strcmp(gimbal->desc->type, "scripted") == 0 ||
        strcmp(gimbal->desc->type, "external") == 0) {
        return GAZE_UNKNOWN;
    }
    const bst_control_config *config = control->config;
    l->stare_s = config->stare_time_s;
    switch (config->strategy) {
        case BST_CONTROL_TRACK:
        case BST_CONTROL_RATE:
            return GAZE_CUE;
        case BST_CONTROL_STARE:
            return GAZE_STARE;
        default:
            return GAZE_UNKNOWN;
    }
}

/* Geometric direction of the boresight; aberration is negligible against the field. */
static bst_status boresight_at(bst_ctx *ctx, looking *l, double seconds, bool *known,
                               bst_vec3 *direction) {
    *known = true;
    if (l->gaze == GAZE_IDEAL && l->object >= 0) {
        bst_world_sight sight;
        BST_TRY(bst_world_view_sight(ctx, l->view, l->observer, l->object, seconds, &sight));
        *direction = sight.geometric;
        return BST_OK;
    }
    if (l->gaze == GAZE_IDEAL) {
        *direction =
            bst_vec3_from_radec(l->ideal->ra_deg * BST_DEG_RAD, l->ideal->dec_deg * BST_DEG_RAD);
        return BST_OK;
    }
    return bst_knowledge_cue_direction_at(ctx, l->cue, l->gaze == GAZE_STARE ? l->stare_s : seconds,
                                          known, direction);
}

/* Angles between the edge of the field and each body, rad; for the sky, the share of the full well
 * that it leaves free. */
static bst_status clearances(bst_ctx *ctx, looking *l, double seconds,
                             double clear[BST_FIELD_BODIES]) {
    bool known;
    bst_vec3 d;
    bst_world_state eye;
    bst_bodies bodies;
    for (int b = 0; b < BST_FIELD_BODIES; b++) {
        clear[b] = BST_PI;
    }
    BST_TRY(boresight_at(ctx, l, seconds, &known, &d));
    if (!known) {
        return BST_OK;
    }
    BST_TRY(bst_world_view_observer_state(ctx, l->view, l->observer, seconds, &eye));
    BST_TRY(bst_world_view_bodies(ctx, l->view, seconds, &bodies));
    bst_vec3 moon = bst_vec3_sub(bodies.moon_m, eye.position_m);
    bst_vec3 sun = bst_vec3_sub(bodies.sun_m, eye.position_m);
    double limb = bst_astro_earth_limb_angle(eye.position_m, bodies.pole, d);
    clear[BST_FIELD_EARTH] = limb - l->half_rad;
    clear[BST_FIELD_MOON] =
        bst_vec3_angle(d, moon) - asin(BST_MOON_RADIUS_M / bst_vec3_norm(moon)) - l->half_rad;
    clear[BST_FIELD_SUN] =
        bst_vec3_angle(d, sun) - asin(BST_SUN_RADIUS_M / bst_vec3_norm(sun)) - l->half_rad;
    if (l->sky && limb > 0.0) {
        double sky_e,
            full_e = bst_camera_full_e(bst_world_camera(l->world, l->observer, l->sensor));
        BST_TRY(bst_boresight_sky_at(ctx, l->sky, seconds, d, l->exposure_s, &sky_e));
        clear[BST_FIELD_BRIGHT_SKY] = 1.0 - sky_e / full_e;
    }
    return BST_OK;
}

/* Finds the time at which a body enters or leaves the field, by bisection. */
static bst_status edge_between(bst_ctx *ctx, looking *l, int body, double from_s, double to_s,
                               bool inside_first, double *at_s) {
    while (to_s - from_s > EDGE_S) {
        double middle = 0.5 * (from_s + to_s), clear[BST_FIELD_BODIES];
        BST_TRY(clearances(ctx, l, middle, clear));
        *((clear[body] < 0.0) == inside_first ? &from_s : &to_s) = middle;
    }
    *at_s = 0.5 * (from_s + to_s);
    return BST_OK;
}

/* State of scanning for one body over time. */
typedef struct meeting {
    bool inside;
    double from_s;
} meeting;

/* Finds the spans in which the Sun, Moon or Earth is in the field of view. */
static bst_status spans_of(bst_ctx *ctx, looking *l, double duration_s, bst_check_body_spans *out) {
    double step = fmin(fmax(1e-3 * duration_s, LEAST_STEP_S), MOST_STEP_S);
    double clear[BST_FIELD_BODIES];
    meeting met[BST_FIELD_BODIES] = {{0}};
    BST_TRY(clearances(ctx, l, 0.0, clear));
    for (int b = 0; b < BST_FIELD_BODIES; b++) {
        met[b].inside = clear[b] < 0.0;
    }
    for (double before = 0.0; before < duration_s; before += step) {
        double now = fmin(before + step, duration_s);
        BST_TRY(clearances(ctx, l, now, clear));
        for (int b = 0; b < BST_FIELD_BODIES; b++) {
            meeting *m = &met[b];
            bool in = clear[b] < 0.0, was = m->inside;
            double at = now;
            if (in != was) {
                BST_TRY(edge_between(ctx, l, b, before, now, was, &at));
                m->from_s = in ? at : m->from_s;
            }
            m->inside = in;
            if ((was && !in) || (in && now >= duration_s)) {
                if (out->count < out->capacity) {
                    out->items[out->count] =
                        (bst_check_body_span){(bst_check_field_body)b, m->from_s, in ? now : at};
                }
                out->count++;
            }
        }
    }
    return BST_OK;
}

/* Predicts the sensor's pointing and finds the bodies in its field of view. */
static bst_status look_ahead(bst_ctx *ctx, const bst_scenario *scenario, looking *l,
                             bst_check_body_spans *out) {
    l->gaze = gaze_of(scenario, l);
    if (l->gaze == GAZE_UNKNOWN) {
        return BST_OK;
    }
    BST_TRY(bst_world_view_create(ctx, l->world, &l->view));
    if (l->gaze != GAZE_IDEAL) {
        bst_region region;
        BST_TRY(bst_knowledge_create(ctx, l->world, l->observer, l->sensor, &l->knowledge));
        bst_knowledge_region(l->knowledge, &region);
        if (region.kind != BST_REGION_NONE) {
            return BST_OK;
        }
        BST_TRY(bst_knowledge_view_create(ctx, l->knowledge, &l->cue));
    }
    const bst_camera *camera = bst_world_camera(l->world, l->observer, l->sensor);
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[l->observer].sensors.items;
    l->half_rad = bst_camera_half_diagonal_rad(camera);
    l->exposure_s = sensors[l->sensor].exposure.exposure_s;
    if (bst_skylight_may_vary(camera) && l->exposure_s > 0.0) {
        BST_TRY(bst_boresight_sky_create(ctx, l->world, l->view, l->observer, l->sensor, &l->sky));
    }
    return spans_of(ctx, l, fmin(scenario->duration_s, BST_CHECK_LOOKED_S), out);
}

bst_status bst_check_bodies_in_field(bst_ctx *ctx, const bst_scenario *scenario,
                                     const bst_world *world, int observer, int sensor,
                                     bst_check_body_spans *out) {
    looking l = {.observer = observer, .sensor = sensor, .world = world};
    out->count = 0;
    bst_status status = look_ahead(ctx, scenario, &l, out);
    bst_boresight_sky_free(l.sky);
    bst_knowledge_view_free(l.cue);
    bst_knowledge_free(l.knowledge);
    bst_world_view_free(l.view);
    return status;
}

static void warn_of_body(bst_ctx *ctx, const char *name, int body, const bst_check_body_span *spans,
                         int count, double duration_s) {
    bst_check_spans met = {0};
    for (int i = 0; i < count; i++) {
        if ((int)spans[i].body == body) {
            bst_check_spans_add(&met, spans[i].from_s, spans[i].until_s);
        }
    }
    if (met.count > 0) {
        bst_check_span_words words =
            bst_check_spans_word(&met, fmin(duration_s, BST_CHECK_LOOKED_S), duration_s);
        bst_log(ctx, BST_LOG_WARNING, "%s: %s %s%s", name, warnings[body], words.from, words.more);
    }
}

bst_status bst_check_bodies(bst_ctx *ctx, const bst_scenario *scenario,
                            const bst_simulation *simulation) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_world *world = bst_simulation_world(simulation);
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int i = 0; i < observers[o].sensors.count; i++) {
            char name[160];
            bst_check_body_span spans[MOST_SPANS];
            bst_check_body_spans met = {.items = spans, .capacity = MOST_SPANS};
            snprintf(name, sizeof name, "%s/%s", observers[o].name, sensors[i].name);
            bst_status status = bst_check_bodies_in_field(ctx, scenario, world, o, i, &met);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", name);
            }
            int count = met.count < MOST_SPANS ? met.count : MOST_SPANS;
            for (int b = 0; b < BST_FIELD_BODIES; b++) {
                warn_of_body(ctx, name, b, spans, count, scenario->duration_s);
            }
        }
    }
    return BST_OK;
}
