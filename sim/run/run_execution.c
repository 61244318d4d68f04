/* Figures and times of a run in progress. */
#include <stdio.h>

#include "sim/core/wall_clock.h"
#include "sim/run/run_internal.h"

void bst_run_get_figures(const bst_run_sensor_watch *sensor, bst_run_sensor_figures *out) {
    snprintf(out->scope, sizeof out->scope, "%s", sensor->scope);
    bst_loop_summary_figures(sensor->summary, &out->loop);
    bst_run_metrics_figures(sensor->metrics, &out->metrics);
}

double bst_run_wall_s(const bst_run_execution *run) {
    return run->earlier_s + bst_wall_seconds() - run->started;
}

double bst_run_seconds(const bst_run_execution *run) {
    return (double)(bst_engine_tick(bst_simulation_engine(run->sim)) + 1) /
           (double)run->scenario->tick_rate_hz;
}

double bst_run_simulated_s(const bst_run_execution *run) {
    return bst_run_seconds(run) - (double)run->begin_tick / (double)run->scenario->tick_rate_hz;
}

bst_run_pixels bst_run_pixels_of(const bst_run_execution *run, const bst_run_sensor_watch *sensor) {
    return (bst_run_pixels){
        .recorded = (run->recorder && run->scenario->record.frames != BST_RECORD_NO_FRAMES) ||
                    (run->steering && run->steering->message),
        .pictured = sensor->pictures != NULL,
        .duration_ticks = run->end_tick};
}
