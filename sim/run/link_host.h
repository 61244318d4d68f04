/* A module of this program played over the link for a simulation elsewhere. */
#ifndef BST_RUN_LINK_HOST_H
#define BST_RUN_LINK_HOST_H

#include "sim/engine/simulation.h"

typedef struct bst_link_host bst_link_host;

/* Makes the module `part` ("observer/sensor/module", or "module" of the first sensor that has it;
 * image processing, tracker or control) of a scenario, and nothing else of it. The scenario
 * outlives the host. */
bst_status bst_link_host_create(bst_ctx *ctx, const bst_scenario *scenario, const char *part,
                                int threads, bst_link_host **out) BST_MUST_CHECK;
/* Frees a host with its simulation; NULL is allowed. */
void bst_link_host_free(bst_link_host *host);
/* Name of the instance that the host runs; it belongs to the host. */
const char *bst_link_host_instance(const bst_link_host *host);

/* Keys of a link that asks for them; the path is lent for as long as the host is. */
void bst_link_host_use_keys(bst_link_host *host, const char *keys_file);

/* Plays it for the simulation at `address` until that ends, *reason as in bst_link_end. A step that
 * comes a second time, after a break of the connection, is answered as the first time. BST_ERR_IO:
 * nothing has come for timeout_s; BST_ERR_INTERRUPTED: `stop` said so. */
bst_status bst_link_host_play(bst_ctx *ctx, bst_link_host *host, const char *address,
                              bool shared_memory, double timeout_s, bool (*stop)(void),
                              int *reason) BST_MUST_CHECK;

#endif
