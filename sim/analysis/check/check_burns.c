#include "sim/analysis/check/check_burns.h"

#include <math.h>
#include <string.h>

#include "sim/engine/scenario/loop_timing.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"

/* Accelerations that a tracker can follow. */
typedef struct limits {
    double acceleration_radps2, jump_radps;
    double period_s;
    const char *type; /* type of the tracker */
} limits;

/* False: the tracker's filter is unknown. */
static bool limits_of(const bst_scenario *scenario, int observer, int sensor, limits *out) {
    const bst_scenario_module_config *tracker =
        bst_scenario_module(scenario, observer, sensor, "tracker");
    double gate, quiet, swift, events, window;
    if (!tracker || !bst_scenario_module_number(tracker, "gate_chi2", &gate) ||
        !bst_scenario_module_number(tracker, "process_noise_arcsec_per_s15", &quiet) ||
        !bst_scenario_module_number(tracker, "manoeuvre_noise_arcsec_per_s15", &swift) ||
        !bst_scenario_module_number(tracker, "false_events_per_hour", &events) ||
        !bst_scenario_module_number(tracker, "event_window", &window)) {
        return false;
    }
    bst_loop_timing timing;
    bst_loop_timing_of(scenario, observer, sensor, &timing);
    /* without manoeuvre detection the tracker keeps its quiet model */
    bool detects = strcmp(tracker->desc->type, "imm") == 0 || (events > 0.0 && window > 0.0);
    double followed = quiet * BST_ARCSEC_RAD * sqrt(gate / timing.period_s);
    double found =
        detects ? 0.5 * swift * BST_ARCSEC_RAD * sqrt(gate / (3.0 * timing.period_s)) : 0.0;
    out->period_s = timing.period_s;
    out->acceleration_radps2 = fmax(followed, found);
    out->jump_radps = 2.0 * timing.period_s * found;
    if (!detects) {
        out->jump_radps = followed * timing.period_s;
    }
    out->type = tracker->desc->type;
    return timing.period_s > 0.0;
}

/* Cross-line-of-sight velocity change of a burn, m/s, and the range, m. */
static bst_status speed_across(bst_ctx *ctx, bst_world_view *view, int object, int observer,
                               const bst_burn_config *burn, double *across_mps, double *range_m) {
    bst_world_state target, eye;
    BST_TRY(bst_world_view_object_state(ctx, view, object, burn->time_s, &target));
    BST_TRY(bst_world_view_observer_state(ctx, view, observer, burn->time_s, &eye));
    bst_vec3 radial = bst_vec3_unit(target.position_m);
    bst_vec3 normal = bst_vec3_unit(bst_vec3_cross(target.position_m, target.velocity_mps));
    bst_vec3 along = bst_vec3_cross(normal, radial);
    bst_vec3 dv = bst_vec3_scale(radial, burn->dv_rtn_mps[0]);
    dv = bst_vec3_axpy(dv, burn->dv_rtn_mps[1], along);
    dv = bst_vec3_axpy(dv, burn->dv_rtn_mps[2], normal);
    bst_vec3 to = bst_vec3_sub(target.position_m, eye.position_m);
    *range_m = bst_vec3_norm(to);
    *across_mps = bst_vec3_norm(bst_vec3_cross(dv, bst_vec3_unit(to)));
    return BST_OK;
}

static bst_status check_sensor(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world,
                               bst_world_view *view, int observer, int sensor) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    const bst_object_config *objects = scenario->world.objects.items;
    const char *cued = sensors[sensor].cue.object;
    int object = cued[0] ? bst_world_find_object(world, cued) : -1;
    limits limit;
    if (object < 0 || object >= scenario->world.objects.count ||
        strcmp(objects[object].name, cued) != 0 || !limits_of(scenario, observer, sensor, &limit)) {
        return BST_OK;
    }
    const bst_burn_config *burns = objects[object].burns.items;
    for (int k = 0; k < objects[object].burns.count && burns[k].time_s < scenario->duration_s;
         k++) {
        double across, range;
        BST_TRY(speed_across(ctx, view, object, observer, &burns[k], &across, &range));
        bool sudden = burns[k].duration_s <= limit.period_s;
        double most = sudden ? limit.jump_radps : limit.acceleration_radps2;
        double turn = across / range / (sudden ? 1.0 : burns[k].duration_s);
        if (turn > most) {
            const char *unit = sudden ? "arcsec/s" : "arcsec/s2";
            bst_log(ctx, BST_LOG_WARNING,
                    "%s: /world/objects/%d/burns/%d: at %.4g km it turns the line of sight from "
                    "/observers/%d/sensors/%d by %.3g %s; its tracker (%s, a frame each %g s) "
                    "follows %.3g %s and will lose the target; give it a greater "
                    "manoeuvre_noise_arcsec_per_s15 (with false_events_per_hour above 0) or more "
                    "frames a second",
                    scenario->file, object, k, 1e-3 * range, observer, sensor,
                    turn / BST_ARCSEC_RAD, unit, limit.type, limit.period_s, most / BST_ARCSEC_RAD,
                    unit);
            return BST_OK;
        }
    }
    return BST_OK;
}

bst_status bst_check_burns(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) {
    const bst_world *world = bst_simulation_world(simulation);
    const bst_observer_config *observers = scenario->observers.items;
    bst_world_view *view = NULL;
    bst_status status = bst_world_view_create(ctx, world, &view);
    for (int o = 0; status == BST_OK && o < scenario->observers.count; o++) {
        for (int i = 0; status == BST_OK && i < observers[o].sensors.count; i++) {
            status = check_sensor(ctx, scenario, world, view, o, i);
        }
    }
    bst_world_view_free(view);
    return status;
}
