#include "sim/engine/scenario/loop_timing.h"

#include <math.h>
#include <string.h>

static bool has_port(const bst_scenario_module_config *module, bst_port_direction direction,
                     const char *channel) {
    for (int p = 0; p < module->desc->port_count; p++) {
        const bst_port *port = &module->desc->ports[p];
        if (port->direction == direction && strcmp(port->channel, channel) == 0) {
            return true;
        }
    }
    return false;
}

/* Declared delay in seconds of a module's input channel. */
static double delay_of(const bst_scenario *scenario, const bst_scenario_module_config *module,
                       const char *channel) {
    for (int i = 0; i < module->delay_count; i++) {
        if (strcmp(module->desc->ports[module->delays[i].port].channel, channel) == 0) {
            return (double)module->delays[i].ticks / (double)scenario->tick_rate_hz;
        }
    }
    return 0.0;
}

/* The first gimbal step at or after a delay, if frames and gimbal steps start together. */
static double on_grid(double seconds, double grid_s) {
    return grid_s > 0.0 ? ceil(seconds / grid_s - 1e-9) * grid_s : seconds;
}

void bst_loop_timing_of(const bst_scenario *scenario, int observer, int sensor,
                        bst_loop_timing *out) {
    static const char *const way[] = {BST_CHANNEL_EXPOSURE, BST_CHANNEL_FRAME,
                                      BST_CHANNEL_DETECTIONS, BST_CHANNEL_TRACKS};
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    const bst_exposure_config *exposure = &sensors[sensor].exposure;
    double tick_s = 1.0 / (double)scenario->tick_rate_hz;
    *out = (bst_loop_timing){.exposure_s = exposure->exposure_s, .period_s = exposure->period_s};
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (module->observer != observer || module->sensor != sensor || module->off) {
            continue;
        }
        for (size_t w = 0; w < sizeof way / sizeof *way; w++) {
            out->frame_latency_s += delay_of(scenario, module, way[w]);
        }
        if (has_port(module, BST_PORT_OUT, BST_CHANNEL_SENSOR_COMMAND)) {
            double exposure_s = 0.0, period_s = 0.0;
            (void)bst_scenario_module_number(module, "exposure_s", &exposure_s);
            (void)bst_scenario_module_number(module, "period_s", &period_s);
            out->exposure_s = exposure_s > 0.0 ? exposure_s : out->exposure_s;
            out->period_s = period_s > 0.0 ? period_s : out->period_s;
        }
        if (has_port(module, BST_PORT_IN, BST_CHANNEL_LOS_COMMAND)) {
            out->gimbal_period_s = (double)module->period_ticks * tick_s;
            double delay = delay_of(scenario, module, BST_CHANNEL_LOS_COMMAND);
            out->command_delay_s = fmax(delay, tick_s);
        }
    }
    out->period_s = fmax(out->period_s, out->exposure_s);
    double half = 0.5 * out->exposure_s, before = half + out->frame_latency_s;
    out->command_delay_s = on_grid(before + out->command_delay_s, out->gimbal_period_s) - before;
}
