#include "sim/engine/simulation_state.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/core/file.h"
#include "sim/engine/kernel/engine_state.h"
#include "sim/io/manifest.h"
#include "sim/link/crc32c.h"
#include "sim/world/world.h"

enum { STATE_VERSION = 6 };
static const char magic[8] = "BSTSTATE";

bst_status bst_scenario_digest(bst_ctx *ctx, const bst_scenario *scenario,
                               char digest[BST_SHA256_TEXT]) {
    static const char *const irrelevant[] = {"name",   "description", "duration_s",
                                             "record", "pacing",      "run"};
    cJSON *echo = bst_scenario_echo(scenario);
    for (size_t i = 0; echo && i < sizeof irrelevant / sizeof *irrelevant; i++) {
        cJSON_DeleteItemFromObjectCaseSensitive(echo, irrelevant[i]);
    }
    char *text = echo ? cJSON_PrintUnformatted(echo) : NULL;
    cJSON_Delete(echo);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the digest of a scenario");
    }
    bst_sha256_text(text, strlen(text), digest);
    cJSON_free(text);
    return BST_OK;
}

static void set_program(char out[BST_STATE_PROGRAM_BYTES]) {
    memset(out, 0, BST_STATE_PROGRAM_BYTES);
    snprintf(out, BST_STATE_PROGRAM_BYTES, "%s (%s)", bst_version(), bst_version_git_revision());
}

bst_status bst_simulation_archive(bst_ctx *ctx, bst_simulation *sim, bst_archive *archive,
                                  unsigned components) {
    BST_TRY(bst_engine_archive(ctx, bst_simulation_engine(sim), archive, components));
    if (!(components & BST_STATE_PLANT) && bst_archive_is_restoring(archive)) {
        return bst_archive_skip(ctx, archive, "world");
    }
    BST_TRY(bst_archive_begin(ctx, archive, "world"));
    bst_world_archive(bst_simulation_world(sim), archive);
    return bst_archive_end(ctx, archive);
}

bst_status bst_simulation_save(bst_ctx *ctx, bst_simulation *sim, const bst_state_origin *origin,
                               void **bytes, size_t *size) {
    assert(sim && origin && bytes && size);
    *bytes = NULL;
    *size = 0;
    bst_state_head head = {.version = STATE_VERSION,
                           .recording = origin->recording != NULL,
                           .seed = origin->seed,
                           .run = bst_simulation_run(sim),
                           .tick = origin->tick};
    memcpy(head.magic, magic, sizeof head.magic);
    set_program(head.program);
    snprintf(head.scenario, sizeof head.scenario, "%s", origin->digest);
    bst_archive *archive;
    BST_TRY(bst_archive_create(ctx, &archive));
    bst_archive_raw(archive, &head, sizeof head);
    bst_status status = bst_simulation_archive(ctx, sim, archive, BST_STATE_ALL);
    if (status == BST_OK && origin->recording) {
        status = origin->recording(ctx, origin->user, archive);
    }
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

bst_status bst_state_head_read(bst_ctx *ctx, const void *bytes, size_t size, const char *digest,
                               bst_state_head *head) {
    char program[BST_STATE_PROGRAM_BYTES];
    if (size < sizeof *head || memcmp(bytes, magic, sizeof magic) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "this is no saved state of a simulation");
    }
    memcpy(head, bytes, sizeof *head);
    head->program[BST_STATE_PROGRAM_BYTES - 1] = head->scenario[BST_SHA256_TEXT - 1] = '\0';
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
    if (strcmp(head->scenario, digest) != 0) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the saved state is that of another scenario, or of other overrides: give "
                        "those of the run that was saved");
    }
    return BST_OK;
}

bst_status bst_state_file_write(bst_ctx *ctx, const char *path, const void *bytes, size_t size) {
    return bst_io_write_file_atomic(ctx, path, bytes, size);
}

bst_status bst_state_file_read(bst_ctx *ctx, const char *path, char **bytes, size_t *size) {
    const uint64_t most = UINT64_C(4) << 30;
    *bytes = NULL;
    return bst_file_read(ctx, path, most, "the saved state of a simulation", bytes, size);
}
