/* A simulation: world, device, onboard knowledge and modules of a scenario, ready to run. */
#ifndef BST_ENGINE_SIMULATION_H
#define BST_ENGINE_SIMULATION_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_simulation bst_simulation;
struct bst_device;
struct bst_shared_model;

typedef struct bst_simulation_options {
    const char *device;        /* selector as in bst_device_open; NULL: default */
    int threads;               /* 0: all processors */
    bool pace;                 /* use the scenario's "pacing"; false: lockstep */
    bool replay;               /* answers of peers come from a recording: no wall clock */
    bool local_link;           /* modules of type "external" take what bst_link_put gives, if the
                                  scenario's "link" has no address */
    bool parallel;             /* as bst_engine_parallel: another thread may call the observers */
    struct bst_device *opened; /* an open device to use; the caller closes it; NULL: none */
    /* world, knowledge and device of this scenario (sim/engine/shared_model.h), which must outlive
     * the simulation; NULL: the simulation creates its own, with `device` and `threads` */
    const struct bst_shared_model *shared;
    bool never_steps;  /* it is only looked at: kernels are not compiled */
    bool changes_made; /* the caller makes the scenario's `changes`; false: they are refused */
    bool other_run;    /* `run` replaces the scenario's number of the run */
    uint64_t run;
    /* NULL, or restores a state after the modules are created and before the engine gets its
     * threads */
    bst_status (*restore)(bst_ctx *ctx, bst_simulation *simulation, void *user);
    void *restore_user;
    /* NULL, or the only module ("observer/sensor/module") that steps. The module `source`, named
     * "observer/sensor/source", replaces all others: it writes the inputs, which are visible at
     * once. */
    const char *only;
    const bst_module_desc *source;
    const void *source_config;
} bst_simulation_options;

/* Creates the world, device, knowledge and modules that a scenario names, and connects the modules.
 * It writes no files. The scenario must outlive the simulation. */
bst_status bst_simulation_create(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation_options *options,
                                 bst_simulation **out) BST_MUST_CHECK;
/* Frees a simulation with its engine and worlds; NULL is allowed. */
void bst_simulation_free(bst_simulation *simulation);

/* Engine of a simulation; it belongs to the simulation. */
bst_engine *bst_simulation_engine(bst_simulation *simulation);
/* World (truth) of a simulation; it belongs to the simulation. */
const struct bst_world *bst_simulation_world(const bst_simulation *simulation);
/* Link to other programs. NULL: no module is of type "external". */
struct bst_link *bst_simulation_link(bst_simulation *simulation);
/* Number of the run, which keys the random streams of the modules. */
uint64_t bst_simulation_run(const bst_simulation *simulation);
/* OpenCL device of a simulation. NULL: no module needs one. */
const struct bst_device *bst_simulation_device(const bst_simulation *simulation);

#endif
