/* The options before the command: boresight [--plugin FILE]... [--no-plugins] COMMAND. */
#ifndef BST_CLI_PLUGIN_OPTIONS_H
#define BST_CLI_PLUGIN_OPTIONS_H

#include "boresight/status.h"

/* Takes the options about plug-ins that stand before the command, and stores them in the
 * environment (sim/cli/plugins.h).
 *
 * Given:     argc, argv  of the program
 *            *first      index of the first word to look at
 * Returned:  *first      index of the command; argc if there is none
 * Errors:    BST_ERR_ARGUMENT: an unknown option, --plugin without FILE or command, or a FILE that
 *            bst_plugins_add refuses; BST_ERR_MEMORY */
bst_status bst_plugin_options_take(bst_ctx *ctx, int argc, char **argv, int *first) BST_MUST_CHECK;

#endif
