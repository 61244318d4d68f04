/* What simulations of one scenario share: the world with its catalogue, the onboard knowledge and
 * the device. Constant after its creation; any number of threads may use it. */
#ifndef BST_ENGINE_SHARED_MODEL_H
#define BST_ENGINE_SHARED_MODEL_H

#include <stdbool.h>

#include "sim/engine/scenario/scenario.h"
#include "sim/onboard/knowledge.h"

typedef struct bst_shared_model {
    bst_world *world;
    struct bst_device *device; /* NULL: no module needs one */
    bst_knowledge **knowledge; /* [knowledge_count] sensors of all observers */
    int knowledge_count;
} bst_shared_model;

/* How a shared model is created. All zero: the defaults. */
typedef struct bst_shared_model_options {
    const char *device; /* see bst_device_open; NULL: default */
    int threads;        /* of the host, 0: all cores */
    bool no_device;     /* opens none */
} bst_shared_model_options;

/* Creates what the simulations of a scenario share.
 *
 * Given:     scenario  must outlive the model
 * Returned:  *out  NULL on error
 * Errors:    those of the world, the onboard knowledge and the device
 * Ownership: free *out with bst_shared_model_free, after its simulations */
bst_status bst_shared_model_create(bst_ctx *ctx, const bst_scenario *scenario,
                                   const bst_shared_model_options *options,
                                   bst_shared_model **out) BST_MUST_CHECK;
/* Frees a shared model; NULL is allowed. */
void bst_shared_model_free(bst_shared_model *model);

/* Reads the map of stray light of a sensor whose background names one; `base_dir`: base of its
 * path. Errors with the key: those of bst_fits_read_image and bst_stray_map_create. */
bst_status bst_shared_model_read_stray_map(bst_ctx *ctx, const char *base_dir, bst_world *world,
                                           int observer, int sensor) BST_MUST_CHECK;

/* True if a module of the scenario needs an OpenCL device. */
bool bst_shared_model_needs_device(const bst_scenario *scenario);

#endif
