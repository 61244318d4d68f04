#include "boresight/boresight.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/engine/simulation.h"
#include "sim/registry/registry.h"

struct bst_model {
    bst_json *json;
    bst_scenario scenario;
    bool read; /* the scenario must be freed */
};

struct bst_sim {
    const bst_model *model;
    bst_simulation *simulation;
    int64_t tick; /* end of the stepped time, exclusive */
};

static bst_status read_model(bst_ctx *ctx, const char *path, const char *const *assignments,
                             int count, bst_model *model) {
    BST_TRY(bst_json_load_described(ctx, path, bst_registry_tables(), &model->json));
    for (int i = 0; i < count; i++) {
        BST_TRY(bst_json_set(ctx, model->json, assignments[i]));
    }
    model->read = true; /* free it after an error too */
    return bst_scenario_read(ctx, model->json, bst_registry_shipped(), &model->scenario);
}

bst_status bst_model_load(bst_ctx *ctx, const char *path, const char *const *assignments, int count,
                          bst_model **out) {
    assert(path && out && count >= 0 && (assignments || count == 0));
    *out = NULL;
    bst_model *model = calloc(1, sizeof *model);
    if (!model) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a model of %s", path);
    }
    bst_status status = read_model(ctx, path, assignments, count, model);
    if (status != BST_OK) {
        bst_model_free(model);
        return status;
    }
    *out = model;
    return BST_OK;
}

void bst_model_free(bst_model *model) {
    if (model) {
        if (model->read) {
            bst_scenario_free(&model->scenario);
        }
        bst_json_free(model->json);
        free(model);
    }
}

int64_t bst_model_tick_rate_hz(const bst_model *model) {
    return model->scenario.tick_rate_hz;
}

double bst_model_duration_s(const bst_model *model) {
    return model->scenario.duration_s;
}

bst_status bst_sim_create(bst_ctx *ctx, const bst_model *model, const bst_sim_options *options,
                          bst_sim **out) {
    assert(model && out);
    *out = NULL;
    bst_sim *sim = calloc(1, sizeof *sim);
    if (!sim) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a sim");
    }
    sim->model = model;
    const bst_simulation_options how = {.device = options ? options->device : NULL,
                                        .threads = options ? options->threads : 0};
    bst_status status = bst_simulation_create(ctx, &model->scenario, &how, &sim->simulation);
    if (status != BST_OK) {
        bst_sim_free(sim);
        return status;
    }
    *out = sim;
    return BST_OK;
}

void bst_sim_free(bst_sim *sim) {
    if (sim) {
        bst_simulation_free(sim->simulation);
        free(sim);
    }
}

void bst_sim_observe(bst_sim *sim, const bst_sim_observer *observer) {
    bst_engine_hooks hooks = {0};
    if (observer) {
        hooks = (bst_engine_hooks){.user = observer->user,
                                   .message = observer->message,
                                   .event = observer->event,
                                   .interrupted = observer->interrupted};
    }
    bst_engine_set_hooks(bst_simulation_engine(sim->simulation), &hooks);
}

bst_status bst_sim_run_until(bst_ctx *ctx, bst_sim *sim, double until_s) {
    double ticks = until_s * (double)sim->model->scenario.tick_rate_hz;
    if (!(fabs(ticks) < 9e15)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "cannot run until %g s: allowed is up to %g s",
                        until_s, 9e15 / (double)sim->model->scenario.tick_rate_hz);
    }
    int64_t until =
        (int64_t)ceil(ticks - 1e-6); /* tolerance for a time rounded to just above its tick */
    if (until <= sim->tick) {
        return BST_OK;
    }
    BST_TRY(bst_engine_advance(ctx, bst_simulation_engine(sim->simulation), until));
    sim->tick = until;
    return BST_OK;
}

double bst_sim_time_s(const bst_sim *sim) {
    return (double)sim->tick / (double)sim->model->scenario.tick_rate_hz;
}
