/* A simulation: a scenario's world, device, onboard knowledge and modules, ready to run. */
#ifndef BST_ENGINE_SIMULATION_H
#define BST_ENGINE_SIMULATION_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_simulation bst_simulation;
struct bst_device;

typedef struct bst_simulation_options {
    const char *device;        /* selector as in bst_device_open; NULL: default */
    int threads;               /* 0: all */
    bool pace;                 /* by the scenario's "pacing"; else as lockstep */
    bool replay;               /* answers of peers will be those of a recording: no clock */
    bool parallel;             /* as bst_engine_parallel: hooks are called by another thread */
    struct bst_device *opened; /* used instead of opening one, and not closed; NULL: none */
    /* NULL, or the one module ("observer/sensor/module") that steps; in place of all others the
     * module `source`, called "observer/sensor/source", writes its inputs, which are seen at once
     */
    const char *only;
    const bst_module_desc *source;
    const void *source_config;
} bst_simulation_options;

/* Opens what the scenario names (catalogue, orbits, the OpenCL device if a module needs one), makes
 * every module and wires it. The scenario must outlive the simulation. Nothing is written anywhere.
 */
bst_status bst_simulation_create(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation_options *options,
                                 bst_simulation **out) BST_MUST_CHECK;
/* Frees a simulation with its engine and worlds; NULL is allowed. */
void bst_simulation_free(bst_simulation *simulation);

/* Engine of a simulation; it belongs to the simulation. */
bst_engine *bst_simulation_engine(bst_simulation *simulation);
/* World of a simulation; it belongs to the simulation. */
const struct bst_world *bst_simulation_world(const bst_simulation *simulation);
/* NULL when no module is of type "external". */
struct bst_link *bst_simulation_link(bst_simulation *simulation);
/* NULL when no module needed a device. */
const struct bst_device *bst_simulation_device(const bst_simulation *simulation);

#endif
