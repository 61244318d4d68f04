/* Saved states of a sim: a head with version and digests, then the archive of the engine. */
#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/api/api_internal.h"
#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "sim/engine/kernel/engine_state.h"
#include "sim/link/crc32c.h"

enum { STATE_VERSION = 1, VERSION_BYTES = 64 };
static const char magic[8] = "BSTSTATE";

/* First bytes of a saved state. */
typedef struct state_head {
    char magic[8];
    uint32_t version;                   /* of this layout: STATE_VERSION */
    uint32_t reserved;                  /* 0 */
    char program[VERSION_BYTES];        /* version and revision of the program */
    char scenario[BST_SHA256_TEXT + 7]; /* digest of the scenario */
    uint64_t check;                     /* CRC-32C of the archive */
    uint64_t seed, run;
    int64_t tick;
    uint64_t bytes; /* of the archive, which follows */
} state_head;

static void set_program(char out[VERSION_BYTES]) {
    memset(out, 0, VERSION_BYTES);
    snprintf(out, VERSION_BYTES, "%s (%s)", bst_version(), bst_version_git_revision());
}

static bst_status check_idle(bst_ctx *ctx, const bst_sim *sim) {
    return sim->failed ? bst_fail(ctx, BST_ERR_STATE, "a sim that has failed cannot be saved")
                       : BST_OK;
}

/* Archives the engine and the states that objects of the world were given. */
static bst_status archive_sim(bst_ctx *ctx, bst_sim *sim, bst_archive *archive,
                              unsigned components) {
    BST_TRY(bst_engine_archive(ctx, bst_simulation_engine(sim->simulation), archive, components));
    if (!(components & BST_STATE_PLANT) && bst_archive_is_restoring(archive)) {
        return bst_archive_skip(ctx, archive, "world");
    }
    BST_TRY(bst_archive_begin(ctx, archive, "world"));
    bst_world_archive(bst_simulation_world(sim->simulation), archive);
    return bst_archive_end(ctx, archive);
}

bst_status bst_sim_save(bst_ctx *ctx, bst_sim *sim, void **bytes, size_t *size) {
    assert(sim && bytes && size);
    *bytes = NULL;
    *size = 0;
    BST_TRY(check_idle(ctx, sim));
    state_head head = {.version = STATE_VERSION,
                       .seed = bst_model_seed(sim->model),
                       .run = bst_sim_run(sim),
                       .tick = sim->tick};
    memcpy(head.magic, magic, sizeof head.magic);
    set_program(head.program);
    snprintf(head.scenario, sizeof head.scenario, "%s", sim->model->digest);
    bst_archive *archive;
    BST_TRY(bst_archive_create(ctx, &archive));
    bst_archive_raw(archive, &head, sizeof head);
    bst_status status = archive_sim(ctx, sim, archive, BST_STATE_ALL);
    if (status == BST_OK) {
        char *all = bst_archive_take(archive, size);
        assert(all); /* an archive without memory has failed at the end of a record */
        head.bytes = *size - sizeof head;
        head.check = bst_crc32c(all + sizeof head, head.bytes);
        memcpy(all, &head, sizeof head);
        *bytes = all;
    }
    bst_archive_free(archive);
    return status;
}

void bst_state_free(void *bytes) {
    free(bytes);
}

/* Reads and checks the head of a saved state. */
static bst_status read_head(bst_ctx *ctx, const bst_sim *sim, const void *bytes, size_t size,
                            state_head *head) {
    char program[VERSION_BYTES];
    if (size < sizeof *head || memcmp(bytes, magic, sizeof magic) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "this is no saved state of a simulation");
    }
    memcpy(head, bytes, sizeof *head);
    head->program[VERSION_BYTES - 1] = head->scenario[BST_SHA256_TEXT - 1] = '\0';
    set_program(program);
    if (head->version != STATE_VERSION || strcmp(head->program, program) != 0) {
        return bst_fail(
            ctx, BST_ERR_FORMAT,
            "the saved state is of Boresight %s, this is %s: a state is restored by the "
            "build that saved it",
            head->program, program);
    }
    if (head->bytes != size - sizeof *head) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state is cut: %zu bytes of %llu",
                        size - sizeof *head, (unsigned long long)head->bytes);
    }
    if (bst_crc32c((const char *)bytes + sizeof *head, (size_t)head->bytes) != head->check) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the saved state is damaged: its checksum is wrong");
    }
    if (strcmp(head->scenario, sim->model->digest) != 0) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the saved state is that of another scenario, or of other overrides: load "
                        "the model with those of the run that was saved");
    }
    return BST_OK;
}

/* Checks that the components fit the sim. */
static bst_status check_components(bst_ctx *ctx, const bst_sim *sim, const state_head *head,
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
static bst_status restore_components(bst_ctx *ctx, bst_sim *sim, const state_head *head,
                                     const void *bytes, unsigned components) {
    bst_archive *archive;
    BST_TRY(
        bst_archive_open(ctx, (const char *)bytes + sizeof *head, (size_t)head->bytes, &archive));
    sim->failed = true; /* until all is restored */
    bst_status status = archive_sim(ctx, sim, archive, components);
    bst_archive_free(archive);
    BST_TRY(status);
    sim->failed = false;
    sim->tick = components & BST_STATE_TIME ? head->tick : sim->tick;
    return BST_OK;
}

/* Makes the run number of a sim that of the saved state: the modules are created anew with its
 * keys. Components that are not to be restored keep their state. */
static bst_status take_run(bst_ctx *ctx, bst_sim *sim, const state_head *head,
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
        state_head kept;
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
    state_head head;
    BST_TRY(read_head(ctx, sim, bytes, size, &head));
    BST_TRY(check_components(ctx, sim, &head, components));
    bst_sim_end_views(sim);
    if (components & BST_STATE_RANDOM) {
        BST_TRY(take_run(ctx, sim, &head, components));
    }
    return restore_components(ctx, sim, &head, bytes, components);
}

/* Writes bytes to a draft that takes the file's name when it is complete. */
static bst_status write_file(bst_ctx *ctx, const char *path, const void *bytes, size_t size) {
    char draft[4096 + 32];
    int fd;
    BST_TRY(bst_draft_make(ctx, path, draft, sizeof draft, &fd));
    bool written = bst_file_write_all(fd, bytes, size) && fsync(fd) == 0;
    int why = errno;
    if (close(fd) != 0 && written) {
        written = false;
        why = errno;
    }
    if (written && rename(draft, path) != 0) {
        written = false;
        why = errno;
    }
    if (!written) {
        unlink(draft);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(why));
    }
    return BST_OK;
}

bst_status bst_sim_save_file(bst_ctx *ctx, bst_sim *sim, const char *path) {
    void *bytes;
    size_t size;
    BST_TRY(bst_sim_save(ctx, sim, &bytes, &size));
    bst_status status = write_file(ctx, path, bytes, size);
    bst_state_free(bytes);
    return status;
}

bst_status bst_sim_restore_file(bst_ctx *ctx, bst_sim *sim, const char *path, unsigned components) {
    const uint64_t most = UINT64_C(4) << 30;
    char *bytes;
    size_t size;
    BST_TRY(
        bst_file_read(ctx, path, most, "a state that bst_sim_save_file has saved", &bytes, &size));
    bst_status status = bst_sim_restore(ctx, sim, bytes, size, components);
    free(bytes);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", path);
}

bst_status bst_sim_clone(bst_ctx *ctx, bst_sim *sim, bst_sim **out) {
    assert(sim && out);
    *out = NULL;
    void *bytes;
    size_t size;
    BST_TRY(bst_sim_save(ctx, sim, &bytes, &size));
    const bst_sim_options options = {.other_run = true, .run = bst_sim_run(sim)};
    bst_sim *copy = NULL;
    bst_status status = bst_sim_create(ctx, sim->model, &options, &copy);
    if (status == BST_OK) {
        state_head head;
        memcpy(&head, bytes, sizeof head);
        status = restore_components(ctx, copy, &head, bytes, BST_STATE_ALL);
    }
    bst_state_free(bytes);
    if (status != BST_OK) {
        bst_sim_free(copy);
        return status;
    }
    *out = copy;
    return BST_OK;
}
