#include "sim/engine/simulation.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/device/device.h"
#include "sim/engine/kernel/exposure_clock.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/engine/scenario/loop_timing.h"
#include "sim/engine/shared_model.h"
#include "sim/io/wcs.h"
#include "sim/onboard/knowledge.h"

struct bst_simulation {
    bst_shared_model *own;          /* NULL: options->shared is used */
    const bst_shared_model *shared; /* own or that of the caller */
    bst_device *device;
    bool lent;                 /* the caller owns the device */
    bst_fleet_member *members; /* [sensors of all observers] */
    char (*scopes)[160];       /* [sensors] of the members */
    bst_engine *engine;
    uint64_t run; /* number of the run, which keys its random streams */
    bst_link *link;
    bool never_steps;     /* options->never_steps */
    bst_module_desc only; /* options->only without input delays */
    bst_port only_ports[BST_MAX_DELAYS];
};

/* The longest exposure time that the scenario sets for a sensor: of its exposure block, or
 * exposure_s of a module that commands it. */
static double longest_exposure_s(const bst_scenario *scenario, int observer, int sensor) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    double longest = sensors[sensor].exposure.exposure_s;
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        bool commands = false;
        for (int p = 0; p < module->desc->port_count; p++) {
            const bst_port *port = &module->desc->ports[p];
            commands = commands || (port->direction == BST_PORT_OUT &&
                                    strcmp(port->channel, BST_CHANNEL_SENSOR_COMMAND) == 0);
        }
        for (const bst_config_desc *d = module->desc->config;
             commands && module->observer == observer && module->sensor == sensor && d && d->key;
             d++) {
            if (d->type == BST_CONFIG_REAL && strcmp(d->key, "exposure_s") == 0) {
                double value;
                memcpy(&value, (const char *)module->config + d->offset, sizeof value);
                longest = fmax(longest, value);
            }
        }
    }
    return longest + 2.0 * bst_detector_lead_s(&sensors[sensor].camera.detector,
                                               (int)sensors[sensor].camera.height_px);
}

/* Sets the step ticks of the sensor's gimbal, which writes the line of sight. */
static void los_ticks(const bst_scenario *scenario, bst_instance_spec *spec) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        for (int p = 0; p < module->desc->port_count; p++) {
            const bst_port *port = &module->desc->ports[p];
            if (module->observer == spec->observer && module->sensor == spec->sensor &&
                port->direction == BST_PORT_OUT &&
                strcmp(port->channel, BST_CHANNEL_LOS_HISTORY) == 0) {
                spec->los_period_ticks = module->period_ticks;
                spec->los_offset_ticks = module->offset_ticks;
            }
        }
    }
}

/* Instance spec of a sensor's modules, without the module itself. */
static bst_instance_spec sensor_spec(const bst_scenario *scenario, const bst_simulation *sim,
                                     int observer, int sensor, const char *scope) {
    const bst_observer_config *observers = scenario->observers.items;
    int index = sensor;
    for (int i = 0; i < observer; i++) {
        index += observers[i].sensors.count;
    }
    bst_loop_timing timing;
    bst_loop_timing_of(scenario, observer, sensor, &timing);
    return (bst_instance_spec){.scope = scope,
                               .world = sim->shared->world,
                               .knowledge = sim->shared->knowledge[index],
                               .device = sim->device,
                               .link = sim->link,
                               .observer = observer,
                               .sensor = sensor,
                               .exposure_s = longest_exposure_s(scenario, observer, sensor),
                               .frame_exposure_s = timing.exposure_s,
                               .frame_period_s = timing.period_s,
                               .frame_latency_s = timing.frame_latency_s,
                               .planes = scenario->record.planes,
                               .mask_threshold_sigma = scenario->record.mask_threshold_sigma,
                               .never_steps = sim->never_steps,
                               .seed = scenario->seed,
                               .run = sim->run};
}

/* Adds the module that options->only names, and the source of its inputs. */
static bst_status add_only(bst_ctx *ctx, const bst_simulation_options *options, const char *scope,
                           const bst_scenario_module_config *module, bst_instance_spec *spec,
                           bst_simulation *sim) {
    char source[256];
    if (strcmp(spec->instance, options->only) != 0) {
        return BST_OK;
    }
    sim->only = *module->desc;
    if (sim->only.port_count > BST_MAX_DELAYS) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s has %d ports (allowed: %d)", options->only,
                        sim->only.port_count, BST_MAX_DELAYS);
    }
    for (int p = 0; p < sim->only.port_count; p++) {
        sim->only_ports[p] = sim->only.ports[p];
        sim->only_ports[p].flags &= ~(unsigned)BST_PORT_FEEDBACK;
    }
    sim->only.ports = sim->only_ports;
    spec->desc = &sim->only;
    spec->delay_count = 0;
    BST_TRY(bst_engine_add(ctx, sim->engine, spec));
    bst_instance_spec writer = {.desc = options->source,
                                .scope = scope,
                                .config = options->source_config,
                                .observer = spec->observer,
                                .sensor = spec->sensor};
    snprintf(source, sizeof source, "%s/source", scope);
    writer.instance = source;
    return bst_engine_add(ctx, sim->engine, &writer);
}

/* Adds the multi-sensor modules. */
static bst_status add_multi_sensor(bst_ctx *ctx, const bst_scenario *scenario,
                                   bst_simulation *sim) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (module->observer >= 0) {
            continue;
        }
        bst_instance_spec spec = {.scope = "",
                                  .instance = module->name,
                                  .desc = module->desc,
                                  .plugin = module->plugin,
                                  .config = module->config,
                                  .period_ticks = module->period_ticks,
                                  .offset_ticks = module->offset_ticks,
                                  .delay_count = module->delay_count,
                                  .world = sim->shared->world,
                                  .device = sim->device,
                                  .observer = -1,
                                  .sensor = -1,
                                  .members = sim->members,
                                  .member_count = sim->shared->knowledge_count,
                                  .seed = scenario->seed,
                                  .run = sim->run};
        memcpy(spec.delays, module->delays, sizeof spec.delays);
        BST_TRY(bst_engine_add(ctx, sim->engine, &spec));
    }
    return BST_OK;
}

static bst_status add_modules(bst_ctx *ctx, const bst_scenario *scenario,
                              const bst_simulation_options *options, bst_simulation *sim) {
    const bst_observer_config *observers = scenario->observers.items;
    sim->members = calloc((size_t)sim->shared->knowledge_count + 1, sizeof *sim->members);
    sim->scopes = calloc((size_t)sim->shared->knowledge_count + 1, sizeof *sim->scopes);
    if (!sim->members || !sim->scopes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors",
                        sim->shared->knowledge_count);
    }
    int count = 0;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            char *scope = sim->scopes[count], name[256];
            snprintf(scope, sizeof sim->scopes[0], "%s/%s", observers[i].name, sensors[s].name);
            bst_instance_spec spec = sensor_spec(scenario, sim, i, s, scope);
            sim->members[count++] = (bst_fleet_member){.scope = scope,
                                                       .observer = i,
                                                       .sensor = s,
                                                       .knowledge = spec.knowledge,
                                                       .frame_exposure_s = spec.frame_exposure_s,
                                                       .frame_period_s = spec.frame_period_s,
                                                       .frame_latency_s = spec.frame_latency_s};
            snprintf(name, sizeof name, "%s/exposure", scope);
            spec.instance = name;
            spec.desc = &bst_exposure_clock_module;
            los_ticks(scenario, &spec);
            spec.config = &sensors[s].exposure;
            if (!options->only) {
                BST_TRY(bst_engine_add(ctx, sim->engine, &spec));
            }
            for (int m = 0; m < scenario->module_count; m++) {
                const bst_scenario_module_config *module = &scenario->modules[m];
                if (module->observer != i || module->sensor != s || module->off) {
                    continue;
                }
                snprintf(name, sizeof name, "%s/%s", scope, module->name);
                spec.instance = name;
                spec.desc = module->desc;
                spec.plugin = module->plugin;
                spec.config = module->config;
                spec.period_ticks = module->period_ticks;
                spec.offset_ticks = module->offset_ticks;
                spec.delay_count = module->delay_count;
                for (int d = 0; d < module->delay_count; d++) {
                    spec.delays[d] = module->delays[d];
                }
                BST_TRY(options->only ? add_only(ctx, options, scope, module, &spec, sim)
                                      : bst_engine_add(ctx, sim->engine, &spec));
            }
        }
    }
    return options->only ? BST_OK : add_multi_sensor(ctx, scenario, sim);
}

/* Warns of frames whose fitted WCS has a larger error than a star's centroid. */
static void warn_of_misfits(bst_ctx *ctx, const bst_scenario *scenario) {
    const double allowed_px = 1e-3;
    const bst_observer_config *observers = scenario->observers.items;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            double misfit_px = bst_wcs_distortion_misfit_px(&sensors[s].camera);
            if (misfit_px > allowed_px && isfinite(misfit_px)) {
                bst_log(
                    ctx, BST_LOG_WARNING,
                    "%s/%s: the WCS of its frames misfits the camera's distortion by up to %.2g "
                    "px: SIP polynomials end at order %d; places by pixel are exact in truth "
                    "and tables",
                    observers[i].name, sensors[s].name, misfit_px, BST_SIP_ORDER);
            }
        }
    }
}

/* Creates the link to other programs if a module needs it. */
static bst_status make_link(bst_ctx *ctx, const bst_scenario *scenario,
                            const bst_simulation_options *options, bst_simulation *sim) {
    bool needed = false;
    for (int m = 0; m < scenario->module_count && !options->only; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        needed |= !module->off && (module->desc->flags & BST_MODULE_NEEDS_LINK);
    }
    if (!needed) {
        return BST_OK;
    }
    bool local = options->local_link && !*scenario->link.address;
    if (!local && !*scenario->link.address) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "/link/address: a module is of type \"external\" and there is no address "
                        "where its peer could connect (allowed: tcp://127.0.0.1:PORT, ipc://PATH)");
    }
    bst_link_run run = {.scenario = scenario->name,
                        .epoch = scenario->epoch,
                        .tick_rate_hz = scenario->tick_rate_hz,
                        .duration_ticks = scenario->duration_ticks};
    if (local) {
        return bst_link_create_local(ctx, &run, &sim->link);
    }
    const bst_pacing_config *pacing = &scenario->pacing;
    if (options->pace && pacing->mode == BST_PACING_FAST) {
        run.waiting = BST_LINK_RUSH;
    } else if (options->pace && pacing->mode == BST_PACING_REALTIME &&
               pacing->overrun == BST_OVERRUN_HOLD) {
        run.waiting = BST_LINK_HOLD;
        run.hold_s = pacing->deadline_s;
    }
    const bst_observer_config *observers = scenario->observers.items;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            double period_s = sensors[s].exposure.period_s / pacing->speed;
            if (pacing->deadline_s == 0.0 && (run.hold_s == 0.0 || period_s < run.hold_s)) {
                run.hold_s = period_s;
            }
            size_t bytes = sizeof(uint16_t) * (size_t)sensors[s].camera.width_px *
                           (size_t)sensors[s].camera.height_px;
            run.pixel_bytes = bytes > run.pixel_bytes ? bytes : run.pixel_bytes;
        }
    }
    return bst_link_create(ctx, &scenario->link, &run, &sim->link);
}

static int processors(int threads) {
    long online = sysconf(_SC_NPROCESSORS_ONLN);
    return threads > 0 ? threads : online > 1 ? (int)online : 1;
}

/* Takes or creates what simulations share, and the device. */
static bst_status take_shared(bst_ctx *ctx, const bst_scenario *scenario,
                              const bst_simulation_options *options, bst_simulation *sim) {
    if (!options->shared) {
        const bst_shared_model_options how = {.device = options->device,
                                              .threads = options->threads,
                                              .no_device = options->only || options->opened};
        BST_TRY(bst_shared_model_create(ctx, scenario, &how, &sim->own));
    }
    sim->shared = options->shared ? options->shared : sim->own;
    if (!options->only && bst_shared_model_needs_device(scenario)) {
        if (options->opened) {
            sim->device = options->opened;
            sim->lent = true;
            bst_device_begin_list(sim->device);
        } else {
            BST_TRY(bst_device_share(ctx, sim->shared->device, &sim->device));
        }
    }
    return BST_OK;
}

/* Takes what is shared and creates the module instances of the simulation. */
static bst_status build(bst_ctx *ctx, const bst_scenario *scenario,
                        const bst_simulation_options *options, bst_simulation *sim) {
    if (scenario->changes.count > 0 && !options->changes_made && !options->never_steps) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "/changes: only boresight run and boresight view make changes during a run: "
            "leave them out here");
    }
    sim->run = options->other_run ? options->run : (uint64_t)scenario->run;
    sim->never_steps = options->never_steps;
    BST_TRY(take_shared(ctx, scenario, options, sim));
    BST_TRY(bst_engine_create(ctx, scenario->tick_rate_hz, &sim->engine));
    bst_status status = make_link(ctx, scenario, options, sim);
    if (status == BST_OK) {
        status = add_modules(ctx, scenario, options, sim);
    }
    if (status == BST_OK && options->only && !sim->only.create) {
        status = bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no module %s", options->only);
    }
    if (status == BST_OK) {
        status = bst_engine_load(ctx, sim->engine);
    }
    if (status == BST_OK && options->pace && scenario->pacing.mode != BST_PACING_LOCKSTEP) {
        bst_pacing_config pacing = scenario->pacing;
        pacing.replay = options->replay;
        status = bst_engine_pace(ctx, sim->engine, &pacing);
    }
    if (status == BST_OK && options->restore) {
        status = options->restore(ctx, sim, options->restore_user);
    }
    if (status == BST_OK && options->parallel) {
        status = bst_engine_parallel(ctx, sim->engine, processors(options->threads));
    }
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", scenario->file);
}

bst_status bst_simulation_create(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation_options *options, bst_simulation **out) {
    assert(scenario && options && out);
    *out = NULL;
    bst_simulation *sim = calloc(1, sizeof *sim);
    if (!sim) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the simulation");
    }
    bst_status status = build(ctx, scenario, options, sim);
    if (status != BST_OK) {
        bst_simulation_free(sim);
        return status;
    }
    if (scenario->record.frames != BST_RECORD_NO_FRAMES) {
        warn_of_misfits(ctx, scenario);
    }
    *out = sim;
    return BST_OK;
}

void bst_simulation_free(bst_simulation *sim) {
    if (!sim) {
        return;
    }
    bst_link_close(sim->link, 2,
                   "the simulation has ended"); /* frames held by the peer come back */
    bst_engine_free(sim->engine);
    free(sim->members);
    free(sim->scopes);
    if (!sim->lent) {
        bst_device_close(sim->device);
    }
    bst_shared_model_free(sim->own);
    free(sim);
}

bst_engine *bst_simulation_engine(bst_simulation *sim) {
    return sim->engine;
}
struct bst_link *bst_simulation_link(bst_simulation *sim) {
    return sim ? sim->link : NULL;
}
const struct bst_world *bst_simulation_world(const bst_simulation *sim) {
    return sim->shared->world;
}
uint64_t bst_simulation_run(const bst_simulation *sim) {
    return sim->run;
}
const struct bst_device *bst_simulation_device(const bst_simulation *sim) {
    return sim->device;
}
