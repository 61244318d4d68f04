/* Types behind boresight/boresight.h. */
#ifndef BST_API_API_INTERNAL_H
#define BST_API_API_INTERNAL_H

#include <pthread.h>

#include "boresight/boresight.h"
#include "sim/core/sha256.h"
#include "sim/engine/shared_model.h"
#include "sim/engine/simulation.h"

struct bst_model {
    bst_json *json;
    bst_scenario scenario;
    bool read;                    /* the scenario must be freed */
    char digest[BST_SHA256_TEXT]; /* of everything that a state depends on */
    char (*sensors)[160];         /* [sensor_count] "observer/sensor" */
    int sensor_count;
    char device[256];
    int threads;
    pthread_mutex_t opening;  /* protects `shared` while it is created */
    bst_shared_model *shared; /* NULL: not opened yet */
};

struct bst_sim {
    const bst_model *model;
    bst_shared_model *own; /* of a model whose world a run changes; NULL: the model's is shared */
    bst_simulation *simulation;
    bst_sim_observer observer;
    int64_t tick; /* modules due at earlier ticks have stepped */
    bool failed;  /* a step or a restore has failed */
    /* the message at which bst_sim_step stops; names are those of the engine's channels */
    const char *wanted_channel, *wanted_scope; /* scope NULL: any */
    bool arrived;
    bst_frame **mapped; /* [channel] frame lent by bst_sim_view_frame; NULL: none */
};

/* Creates the simulation of a sim, in place of the one it has.
 *
 * Given:     run  number of the run
 * Errors:    those of bst_sim_create */
bst_status bst_sim_build(bst_ctx *ctx, bst_sim *sim, uint64_t run) BST_MUST_CHECK;
/* Takes back the pixels that bst_sim_view_frame has lent. */
void bst_sim_end_views(bst_sim *sim);

#endif
