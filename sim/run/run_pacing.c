#include "sim/run/run_pacing.h"

#include <stdio.h>
#include <string.h>

#include <cjson/cJSON.h>

bst_status bst_run_pacing_begin(bst_ctx *ctx, const bst_scenario *scenario,
                                bst_simulation *simulation) {
    bst_link *link = bst_simulation_link(simulation);
    bst_pacing_figures f;
    bool paced = bst_engine_pacing(bst_simulation_engine(simulation), &f);
    if (paced && scenario->pacing.mode == BST_PACING_FAST && link) {
        bst_log(ctx, BST_LOG_WARNING,
                "pacing fast: peers are not waited for; the results will not repeat");
    }
    return paced && link ? bst_link_gather(ctx, link) : BST_OK;
}

/* Checks whether a repeated run of the scenario has the same results. */
static bool repeats(const bst_scenario *scenario, bst_simulation *sim,
                    const bst_pacing_figures *f) {
    if (scenario->pacing.mode == BST_PACING_FAST || scenario->pacing.overrun == BST_OVERRUN_HOLD) {
        return !bst_simulation_link(sim);
    }
    return f->dropped == 0;
}

void bst_run_pacing_add(cJSON *root, const bst_scenario *scenario, bst_simulation *sim) {
    bst_pacing_figures f;
    const bst_pacing_config *c = &scenario->pacing;
    cJSON *node = cJSON_AddObjectToObject(root, "pacing");
    if (!bst_engine_pacing(bst_simulation_engine(sim), &f)) {
        cJSON_AddStringToObject(node, "mode", bst_pacing_mode_name(BST_PACING_LOCKSTEP));
        cJSON_AddBoolToObject(node, "repeats", true);
        return;
    }
    cJSON_AddStringToObject(node, "mode", bst_pacing_mode_name(c->mode));
    cJSON_AddBoolToObject(node, "repeats", repeats(scenario, sim, &f));
    cJSON_AddNumberToObject(node, "frames", (double)f.frames);
    cJSON_AddNumberToObject(node, "done", (double)f.done);
    if (c->mode == BST_PACING_REALTIME) {
        cJSON_AddNumberToObject(node, "speed", c->speed);
        cJSON_AddStringToObject(node, "overrun", bst_overrun_name(c->overrun));
        cJSON_AddNumberToObject(node, "deadline_s", f.deadline_s);
        cJSON_AddNumberToObject(node, "late", (double)f.late);
        cJSON_AddNumberToObject(node, "overruns", (double)f.overruns);
        cJSON_AddNumberToObject(node, "dropped", (double)f.dropped);
        cJSON_AddNumberToObject(node, "slipped_s", f.slipped_s);
        cJSON_AddBoolToObject(node, "priority", f.priority);
        cJSON_AddBoolToObject(node, "cpu", f.cpu);
    }
    cJSON_AddNumberToObject(node, "response_mean_s", f.done > 0 ? f.sum_s / (double)f.done : 0.0);
    cJSON_AddNumberToObject(node, "response_longest_s", f.longest_s);
    cJSON *edges = cJSON_AddArrayToObject(node, "response_up_to_ms");
    cJSON *counts = cJSON_AddArrayToObject(node, "response_frames");
    for (int i = 0; i < BST_PACING_BINS; i++) {
        cJSON_AddItemToArray(counts, cJSON_CreateNumber((double)f.histogram[i]));
        cJSON_AddItemToArray(edges, i < BST_PACING_BINS - 1
                                        ? cJSON_CreateNumber(bst_pacing_edges_ms[i])
                                        : cJSON_CreateNull());
    }
}

void bst_run_pacing_print(const bst_scenario *scenario, bst_simulation *sim) {
    bst_pacing_figures f;
    if (!bst_engine_pacing(bst_simulation_engine(sim), &f)) {
        return;
    }
    char text[80];
    snprintf(text, sizeof text, "%lld of %lld", (long long)f.late, (long long)f.frames);
    if (scenario->pacing.mode == BST_PACING_REALTIME) {
        printf("  %-28s %12s (response longer than %.4g ms; longest %.4g ms)\n", "late frames",
               text, 1e3 * f.deadline_s, 1e3 * f.longest_s);
        printf("  %-28s %12lld %s: %lld dropped, clock set back by %.3f s\n", "overruns",
               (long long)f.overruns, bst_overrun_name(scenario->pacing.overrun),
               (long long)f.dropped, f.slipped_s);
    }
    if (!repeats(scenario, sim, &f)) {
        printf("  %-28s %12s\n", "results repeat", "no");
    }
}
