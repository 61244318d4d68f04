/* Host of `boresight serve`: executes one module over the link for a simulation in another
 * process. */
#ifndef BST_RUN_LINK_HOST_H
#define BST_RUN_LINK_HOST_H

#include "sim/engine/simulation.h"

typedef struct bst_link_host bst_link_host;

/* Creates only the module `part` of a scenario ("observer/sensor/module", or "module" of the first
 * sensor that has it; image processing, tracker or control). The scenario must outlive the host. */
bst_status bst_link_host_create(bst_ctx *ctx, const bst_scenario *scenario, const char *part,
                                int threads, bst_link_host **out) BST_MUST_CHECK;
/* Frees a host with its simulation; NULL is allowed. */
void bst_link_host_free(bst_link_host *host);
/* Name of the instance that the host runs; it belongs to the host. */
const char *bst_link_host_instance(const bst_link_host *host);

/* Sets the key file of a link with authentication; the path must outlive the host. */
void bst_link_host_use_keys(bst_link_host *host, const char *keys_file);

/* Executes the module for the simulation at `address` until its end; *reason as in bst_link_end. A
 * repeated step after a lost connection gets the same answer. BST_ERR_IO: no message for timeout_s;
 * BST_ERR_INTERRUPTED: `stop` returned true. */
bst_status bst_link_host_play(bst_ctx *ctx, bst_link_host *host, const char *address,
                              bool shared_memory, double timeout_s, bool (*stop)(void),
                              int *reason) BST_MUST_CHECK;

#endif
