/* Saved states of a sim. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/api/api_internal.h"
#include "sim/engine/simulation_state.h"

static bst_status check_idle(bst_ctx *ctx, const bst_sim *sim) {
    return sim->failed ? bst_fail(ctx, BST_ERR_STATE, "a sim that has failed cannot be saved")
                       : BST_OK;
}

bst_status bst_sim_save(bst_ctx *ctx, bst_sim *sim, void **bytes, size_t *size) {
    assert(sim && bytes && size);
    *bytes = NULL;
    *size = 0;
    BST_TRY(check_idle(ctx, sim));
    const bst_state_origin origin = {
        .digest = sim->model->digest, .seed = bst_model_seed(sim->model), .tick = sim->tick};
    return bst_simulation_save(ctx, sim->simulation, &origin, bytes, size);
}

void bst_state_free(void *bytes) {
    free(bytes);
}

/* Checks that the components fit the sim. */
static bst_status check_components(bst_ctx *ctx, const bst_sim *sim, const bst_state_head *head,
                                   unsigned components) {
    if (components == 0 || (components & ~(unsigned)BST_STATE_ALL)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "components 0x%x: allowed are sums of plant (1), onboard (2), random (4) "
                        "and time (8)",
                        components);
    }
    const unsigned moving = BST_STATE_PLANT | BST_STATE_ONBOARD | BST_STATE_TIME;
    if (head->tick != sim->tick && (components & moving) != moving) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the saved state is at tick %lld, the sim at %lld: components can be "
                        "restored singly at the same tick only",
                        (long long)head->tick, (long long)sim->tick);
    }
    return BST_OK;
}

/* Restores components into a sim whose run number already fits. */
static bst_status restore_components(bst_ctx *ctx, bst_sim *sim, const bst_state_head *head,
                                     const void *bytes, unsigned components) {
    bst_archive *archive;
    BST_TRY(
        bst_archive_open(ctx, (const char *)bytes + sizeof *head, (size_t)head->bytes, &archive));
    sim->failed = true; /* until all is restored */
    bst_status status = bst_simulation_archive(ctx, sim->simulation, archive, components);
    bst_archive_free(archive);
    BST_TRY(status);
    sim->failed = false;
    sim->tick = components & BST_STATE_TIME ? head->tick : sim->tick;
    return BST_OK;
}

/* Makes the run number of a sim that of the saved state: the modules are created anew with its
 * keys. Components that are not to be restored keep their state. */
static bst_status take_run(bst_ctx *ctx, bst_sim *sim, const bst_state_head *head,
                           unsigned components) {
    if (head->run == bst_sim_run(sim)) {
        return BST_OK;
    }
    void *own = NULL;
    size_t size = 0;
    const bool keeps = components != BST_STATE_ALL;
    if (keeps) {
        BST_TRY(bst_sim_save(ctx, sim, &own, &size));
    }
    bst_status status = bst_sim_build(ctx, sim, head->run);
    if (status == BST_OK && keeps) {
        bst_state_head kept;
        memcpy(&kept, own, sizeof kept);
        status = restore_components(ctx, sim, &kept, own, BST_STATE_ALL);
    }
    free(own);
    sim->failed = status != BST_OK;
    return status;
}

bst_status bst_sim_restore(bst_ctx *ctx, bst_sim *sim, const void *bytes, size_t size,
                           unsigned components) {
    assert(sim && (bytes || size == 0));
    bst_state_head head;
    BST_TRY(bst_state_head_read(ctx, bytes, size, sim->model->digest, &head));
    BST_TRY(check_components(ctx, sim, &head, components));
    bst_sim_end_views(sim);
    if (components & BST_STATE_RANDOM) {
        BST_TRY(take_run(ctx, sim, &head, components));
    }
    return restore_components(ctx, sim, &head, bytes, components);
}

bst_status bst_sim_save_file(bst_ctx *ctx, bst_sim *sim, const char *path) {
    void *bytes;
    size_t size;
    BST_TRY(bst_sim_save(ctx, sim, &bytes, &size));
    bst_status status = bst_state_file_write(ctx, path, bytes, size);
    bst_state_free(bytes);
    return status;
}

bst_status bst_sim_restore_file(bst_ctx *ctx, bst_sim *sim, const char *path, unsigned components) {
    char *bytes;
    size_t size;
    BST_TRY(bst_state_file_read(ctx, path, &bytes, &size));
    bst_status status = bst_sim_restore(ctx, sim, bytes, size, components);
    free(bytes);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", path);
}

/* Copies the state of a sim into one that was created with the same run number. The copy refers to
 * the frames, which a device of their own would not outlive. */
static bst_status copy_state(bst_ctx *ctx, bst_sim *from, bst_sim *to) {
    const bool refers = from->own == NULL;
    bst_archive *saved, *read = NULL;
    size_t size;
    BST_TRY(bst_archive_create(ctx, &saved));
    if (refers) {
        bst_archive_refer(saved);
    }
    bst_status status = bst_simulation_archive(ctx, from->simulation, saved, BST_STATE_ALL);
    if (status == BST_OK) {
        const void *bytes = bst_archive_data(saved, &size);
        status = bst_archive_open(ctx, bytes, size, &read);
    }
    if (status == BST_OK && refers) {
        bst_archive_refer(read);
    }
    if (status == BST_OK) {
        status = bst_simulation_archive(ctx, to->simulation, read, BST_STATE_ALL);
    }
    bst_archive_free(read);
    bst_archive_free(saved);
    to->tick = from->tick;
    return status;
}

bst_status bst_sim_clone(bst_ctx *ctx, bst_sim *sim, bst_sim **out) {
    assert(sim && out);
    *out = NULL;
    BST_TRY(check_idle(ctx, sim));
    const bst_sim_options options = {.other_run = true, .run = bst_sim_run(sim)};
    bst_sim *copy;
    BST_TRY(bst_sim_create(ctx, sim->model, &options, &copy));
    bst_status status = copy_state(ctx, sim, copy);
    if (status != BST_OK) {
        bst_sim_free(copy);
        return status;
    }
    *out = copy;
    return BST_OK;
}
