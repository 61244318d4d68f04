/* The state of a simulation as bytes: a head with version and digests, then the archive of engine
 * and world, then that of its recording, if there is one. */
#ifndef BST_ENGINE_SIMULATION_STATE_H
#define BST_ENGINE_SIMULATION_STATE_H

#include "sim/core/archive.h"
#include "sim/core/sha256.h"
#include "sim/engine/simulation.h"

enum { BST_STATE_PROGRAM_BYTES = 64 };

/* First bytes of a saved state. */
typedef struct bst_state_head {
    char magic[8];
    uint32_t version;                      /* of this layout */
    uint32_t recording;                    /* 1: the archive of a recording follows; else 0 */
    char program[BST_STATE_PROGRAM_BYTES]; /* version and revision of the program */
    char scenario[BST_SHA256_TEXT + 7];    /* digest of the scenario */
    uint64_t check;                        /* CRC-32C of the archive */
    uint64_t seed, run;
    int64_t tick;   /* modules due at earlier ticks have stepped */
    uint64_t bytes; /* of the archive, which follows */
} bst_state_head;

/* Archives what belongs to a recording, in records of its own. */
typedef bst_status (*bst_state_recording_fn)(bst_ctx *ctx, void *user, bst_archive *archive);

/* What a state is saved with. */
typedef struct bst_state_origin {
    const char *digest;               /* bst_scenario_digest */
    uint64_t seed;                    /* of the scenario */
    int64_t tick;                     /* see bst_state_head */
    bst_state_recording_fn recording; /* NULL: none */
    void *user;
} bst_state_origin;

/* Digest of everything in a scenario that its states depend on: not of names, the end of the run,
 * its number, and what is recorded.
 *
 * Returned:  digest  64 hexadecimal digits
 * Errors:    BST_ERR_MEMORY */
bst_status bst_scenario_digest(bst_ctx *ctx, const bst_scenario *scenario,
                               char digest[BST_SHA256_TEXT]) BST_MUST_CHECK;

/* Saves the engine and the world of a simulation, or restores components of them.
 *
 * Given:     components  BST_STATE_... to restore; ignored while saving
 * Errors:    those of bst_engine_archive */
bst_status bst_simulation_archive(bst_ctx *ctx, bst_simulation *simulation, bst_archive *archive,
                                  unsigned components) BST_MUST_CHECK;

/* Saves a simulation to bytes.
 *
 * Returned:  *bytes  [*size] to be freed with free; NULL on error
 * Errors:    those of bst_engine_archive and of origin->recording
 * Notes:     between two calls of bst_engine_advance. */
bst_status bst_simulation_save(bst_ctx *ctx, bst_simulation *simulation,
                               const bst_state_origin *origin, void **bytes,
                               size_t *size) BST_MUST_CHECK;

/* Reads and checks the head of a saved state; the archive begins after it.
 *
 * Given:     digest  bst_scenario_digest of the scenario that the state is for
 * Errors:    BST_ERR_FORMAT: no state, of another build, cut or damaged; BST_ERR_STATE: of another
 *            scenario */
bst_status bst_state_head_read(bst_ctx *ctx, const void *bytes, size_t size, const char *digest,
                               bst_state_head *head) BST_MUST_CHECK;

/* Writes the file of a saved state: readers see the former file or the complete new one.
 *
 * Given:     bytes  [size]
 * Errors:    BST_ERR_IO with path and reason */
bst_status bst_state_file_write(bst_ctx *ctx, const char *path, const void *bytes,
                                size_t size) BST_MUST_CHECK;

/* Reads the file of a saved state.
 *
 * Returned:  *bytes  [*size] to be freed with free; NULL on error
 * Errors:    BST_ERR_IO with path and reason, BST_ERR_MEMORY */
bst_status bst_state_file_read(bst_ctx *ctx, const char *path, char **bytes,
                               size_t *size) BST_MUST_CHECK;

#endif
