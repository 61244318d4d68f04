/* Several sims at the same time: a pool of threads steps them, and one call looks at a channel of
 * all of them, as columns. For environments of reinforcement learning and for Monte Carlo runs. */
#ifndef BORESIGHT_SIM_POOL_H
#define BORESIGHT_SIM_POOL_H

#include "boresight/boresight.h"

#pragma GCC visibility push(default)

typedef struct bst_sim_pool bst_sim_pool;

/* Creates a pool of threads, which sleep between calls.
 *
 * Given:     threads  including that of the caller; 0: one per available processor, at most 32
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_sim_pool_free
 * Notes:     a pool is for one thread at a time, as each of the sims that it steps. */
bst_status bst_sim_pool_create(bst_ctx *ctx, int threads, bst_sim_pool **out) BST_MUST_CHECK;
/* Frees a pool; NULL is allowed. */
void bst_sim_pool_free(bst_sim_pool *pool);

/* Steps sims at the same time, each until messages are published, or until a time.
 *
 * Given:     sims      [count]; NULL: left out. No sim twice
 *            channel   as bst_sim_step, of any sensor; NULL: all go to the time
 *            messages  [count] number of messages after which a sim stops; NULL: 1 each
 *            until_s   as bst_sim_run_until
 * Returned:  arrived   [count] number of messages that came; less than asked for: until_s was
 *                      reached; NULL is allowed
 * Errors:    those of bst_sim_step, of the first sim in the order given that failed; the others
 *            are stepped all the same */
bst_status bst_sim_pool_step(bst_ctx *ctx, bst_sim_pool *pool, bst_sim *const *sims, int count,
                             const char *channel, const int *messages, double until_s,
                             int *arrived) BST_MUST_CHECK;

/* Newest messages of a channel of several sims, as columns. */
typedef struct bst_sim_columns {
    void *headers;       /* [count] structs of the channel without items; zero: no message yet */
    void *items;         /* [count][item_capacity]; may be NULL if item_capacity is 0 */
    int item_capacity;   /* further items are left out: the last, of rings the oldest */
    int *item_counts;    /* [count] items of each message, also those that are left out */
    int64_t *written_at; /* [count] tick; -1: no message yet */
} bst_sim_columns;

/* Copies the newest message of a channel of each sim.
 *
 * Given:     sims     [count]; NULL: left out, its columns are not changed
 *            scope    as bst_sim_view
 *            channel  name
 *            columns  memory to fill
 * Returned:  columns  items of rings (pointing_telemetry, los_history) are the newest ones, oldest
 *                     first
 * Errors:    BST_ERR_NOT_FOUND: no module writes such a channel */
bst_status bst_sim_pool_view(bst_ctx *ctx, bst_sim *const *sims, int count, const char *scope,
                             const char *channel, const bst_sim_columns *columns) BST_MUST_CHECK;

/* Gives the external modules of several sims their next output, as bst_sim_command.
 *
 * Given:     sims      [count]; NULL: left out
 *            payloads  [count] structs of the channel, without items
 * Errors:    those of bst_sim_command, of the first sim that refuses; later ones get nothing */
bst_status bst_sim_pool_command(bst_ctx *ctx, bst_sim *const *sims, int count, const char *scope,
                                const char *channel, const void *payloads) BST_MUST_CHECK;

#pragma GCC visibility pop

#endif
